"""Vibrations as files of phones and controllers, decoded here by other code."""

import json

import numpy as np
import pytest

import haptograph as hg


@pytest.fixture(scope="module")
def vibration(canvas):
    times = np.arange(int(3 * canvas.rate)) / canvas.rate
    return canvas.render(1 + 0.5 * np.sin(2 * np.pi * times), 0.1, seed=1)


def levels(power, rate):
    """Levels over 50 ms, bounded to 80 dB below the loudest."""
    step = round(0.05 * rate)
    means = power[: len(power) // step * step].reshape(-1, step).mean(axis=1)
    return 10 * np.log10(np.maximum(means, 1e-8 * means.max()))


def test_a_file_is_what_it_is_said_to_be(vibration, tmp_path):
    found = hg.export(vibration, tmp_path / "x.haptic")
    text = (tmp_path / "x.haptic").read_bytes()
    envelopes = json.loads(text)["signals"]["continuous"]["envelopes"]
    points = len(envelopes["amplitude"]) + len(envelopes["frequency"])
    assert (found.format, found.bytes, found.points, found.taps, found.unit) == ("haptic", len(text), points, 0, "m/s2")
    # A sine has half the power of its amplitude squared.
    curve = [[point["time"], point["amplitude"]] for point in envelopes["amplitude"]]
    amplitude = found.full_scale * np.interp(vibration.times, *np.transpose(curve))
    apart = levels(amplitude**2 / 2, vibration.rate) - levels(np.square(vibration), vibration.rate)
    assert np.sqrt(np.mean(apart**2)) == pytest.approx(found.envelope, abs=0.3)
    # The third octaves of the vibration have its power.
    spectrum = np.abs(np.fft.rfft(vibration)) ** 2 * 2 / len(vibration) ** 2
    hertz = np.fft.rfftfreq(len(vibration), 1 / vibration.rate)
    power = spectrum[(hertz > 17.8) & (hertz < 1122)].sum()
    assert 10 * np.log10((10 ** (found.bands[:, 1] / 10)).sum()) == pytest.approx(10 * np.log10(power), abs=0.3)


def test_bands_lose_less_than_one_sine(vibration, tmp_path):
    ahap, haptic, hjif = (hg.export(vibration, tmp_path / f"x.{name}") for name in ("ahap", "haptic", "hjif"))
    assert hjif.lsd < min(ahap.lsd, haptic.lsd)
    assert ahap.bands.shape == hjif.bands.shape and np.array_equal(ahap.bands[:, 1], hjif.bands[:, 1])
    for one in (ahap, haptic, hjif):
        assert one.envelope < 3 and one.lost


NUMBER = {"type": "number", "minimum": 0, "maximum": 1}


def shape(required, **more):
    return {"type": "object", "required": list(required), "properties": {**required, **more}, "additionalProperties": False}


TIME = {"type": "number", "minimum": 0}
# What Apple states in "Representing haptic patterns in AHAP files", and at most 16 points a curve.
AHAP = shape(
    {
        "Version": {"const": 1.0},
        "Metadata": {"type": "object"},
        "Pattern": {
            "type": "array",
            "items": {
                "oneOf": [
                    shape(
                        {
                            "Event": shape(
                                {
                                    "Time": TIME,
                                    "EventType": {"enum": ["HapticContinuous", "HapticTransient"]},
                                    "EventParameters": {
                                        "type": "array",
                                        "items": shape(
                                            {"ParameterID": {"enum": ["HapticIntensity", "HapticSharpness"]}, "ParameterValue": NUMBER}
                                        ),
                                    },
                                },
                                EventDuration={"type": "number", "exclusiveMinimum": 0, "maximum": 30},
                            )
                        }
                    ),
                    shape(
                        {
                            "ParameterCurve": shape(
                                {
                                    "ParameterID": {"enum": ["HapticIntensityControl", "HapticSharpnessControl"]},
                                    "Time": TIME,
                                    "ParameterCurveControlPoints": {
                                        "type": "array",
                                        "minItems": 2,
                                        "maxItems": 16,
                                        "items": shape({"Time": TIME, "ParameterValue": NUMBER}),
                                    },
                                }
                            )
                        }
                    ),
                ]
            },
        },
    }
)


def test_ahap_has_the_keys_that_apple_states(vibration, tmp_path):
    jsonschema = pytest.importorskip("jsonschema")
    taps = np.array(vibration) * 0.01
    taps[5000:5100] += np.sin(np.arange(100) / 4)
    for samples in (vibration, taps):
        hg.export(samples, tmp_path / "x.ahap", rate=vibration.rate)
        jsonschema.validate(json.loads((tmp_path / "x.ahap").read_text()), AHAP)


def test_recordings_signals_and_arrays_are_vibrations(drag, pad, tmp_path):
    assert hg.export(drag[:20000], tmp_path / "a.ahap").unit == "m/s2"
    current = pad.run(1)["out.delivered"] if "out.delivered" in dict.fromkeys(pad.outputs) else None
    if current is not None:
        assert hg.export(current, tmp_path / "b.ahap").unit == "A"
    tone = 2 * np.sin(np.arange(4000) * 0.2)
    found = hg.export(tone, tmp_path / "c.ahap", rate=4000, unit="V")
    assert found.unit == "V" and found.full_scale == pytest.approx(2, rel=0.02)


def test_hostile_vibrations_are_errors(vibration, tmp_path):
    broken = np.array(vibration)
    broken[3] = np.inf
    for call in (
        lambda: hg.export(vibration, tmp_path / "x.wav"),
        lambda: hg.export(np.ones(4000), tmp_path / "x.ahap"),
        lambda: hg.export(np.ones(4000), tmp_path / "x.ahap", rate=-1),
        lambda: hg.export(np.ones((2, 4000)), tmp_path / "x.ahap", rate=4000),
        lambda: hg.export(np.zeros(4000), tmp_path / "x.ahap", rate=4000),
        lambda: hg.export(np.ones(10), tmp_path / "x.ahap", rate=4000),
        lambda: hg.export(broken, tmp_path / "x.ahap", rate=4000),
        lambda: hg.export("x", tmp_path / "x.ahap", rate=4000),
    ):
        with pytest.raises(hg.Error):
            call()
    with pytest.raises(OSError):
        hg.export(vibration, tmp_path / "nowhere/x.ahap")
    assert not list(tmp_path.iterdir())
