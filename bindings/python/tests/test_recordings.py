"""Recordings from files, arrays and tables."""

import numpy as np
import pytest

import haptograph as hg


def test_a_recording_of_arrays_has_them(drag):
    assert len(drag) == int(12 * drag.rate) and drag.seconds == 12
    assert drag.acceleration.dtype == np.float64 and drag.gesture == "drag" and drag.is_processed
    assert np.array_equal(drag.tangential, 0.4 * drag.force)


def test_arrays_are_copies(drag):
    drag.force[:] = 0
    assert drag.force.max() > 1


def test_gravity_in_arrays_is_taken_off_and_said(drag):
    heavy = hg.Recording(drag.acceleration + 9.81, drag.force, drag.speed, drag.rate)
    assert len(heavy.findings) == 1 and not hg.Recording(drag.acceleration, drag.force, drag.speed, drag.rate).findings
    assert abs(heavy.acceleration.mean()) < 0.01
    compared = hg.compare(drag.acceleration + 9.81, drag)
    # The high-pass takes 6 dB of the lowest band.
    assert len(compared.findings) == 1 and compared.lsd < 2.5


@pytest.mark.parametrize("name", ["take.csv", "take.zip"])
def test_a_file_has_what_was_written(drag, tmp_path, name):
    drag.save(tmp_path / name)
    again = hg.read(tmp_path / name)
    assert again.rate == drag.rate
    for one in ("acceleration", "force", "speed", "tangential"):
        np.testing.assert_allclose(getattr(again, one), getattr(drag, one), rtol=1e-9, atol=1e-12)


def test_columns_units_and_constants_are_those_that_are_given(tmp_path):
    rows = 400
    table = np.column_stack([np.arange(rows) / 1000, np.sin(np.arange(rows)), np.full(rows, 1.5)])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t,vib,grip", comments="")
    recording = hg.read(
        tmp_path / "log.csv",
        columns={"accel": "vib", "force_normal": "grip"},
        units={"accel": "g", "force_normal": "N"},
        constants={"speed_mm_s": 100},
        rate=1000,
        gesture="circle",
    ).processed()
    assert recording.gesture == "circle" and recording.rate == 1000
    assert np.allclose(recording.speed, 0.1) and np.allclose(recording.force, 1.5)
    assert 5 < np.abs(recording.acceleration).max() < 20


def test_what_cannot_be_read_says_which_file_and_why(tmp_path):
    with pytest.raises(hg.Error, match="nowhere.csv"):
        hg.read(tmp_path / "nowhere.csv")
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(hg.Error, match="empty.csv"):
        hg.read(tmp_path / "empty.csv")
    with pytest.raises(hg.Error, match="no file"):
        hg.read([])
    with pytest.raises(hg.Error, match="gesture"):
        hg.read(tmp_path / "empty.csv", gesture="wave")
    with pytest.raises(hg.Error):
        hg.read(tmp_path / "empty.csv", units={"acceleration": "parsec"})


def test_pandas_there_and_back(drag):
    pandas = pytest.importorskip("pandas")
    table = drag.to_pandas()
    assert isinstance(table, pandas.DataFrame) and table.attrs["units"]["force"] == "N"
    again = hg.Recording.from_pandas(table)
    assert again.rate == drag.rate and np.array_equal(again.acceleration, drag.acceleration)
    with pytest.raises(hg.Error, match="speed"):
        hg.Recording.from_pandas(table.drop(columns="speed"))


@pytest.mark.parametrize(
    "change",
    [
        {"acceleration": [[1.0, 2.0]]},
        {"acceleration": [1.0]},
        {"acceleration": "loud"},
        {"acceleration": [1 + 2j] * 9},
        {"acceleration": [float("nan")] * 9},
        {"force": [1.0] * 8},
        {"force": [np.inf] * 9},
        {"force": [{}] * 9},
        {"speed": None},
        {"rate": 0},
        {"rate": -1},
        {"rate": float("nan")},
        {"rate": "fast"},
        {"rate": [1000]},
        {"gesture": "wave"},
    ],
)
def test_hostile_arrays_are_errors(change):
    sound = {"acceleration": [0.1] * 9, "force": [1.0] * 9, "speed": [0.1] * 9, "rate": 1000}
    hg.Recording(**sound)
    with pytest.raises(hg.Error):
        hg.Recording(**{**sound, **change})


def test_notebooks_show_signals_and_sound(drag):
    shown = drag._repr_html_()
    assert shown.count("<svg") >= 3 and "data:audio/wav;base64," in shown
    assert "12 s" in repr(drag)


def test_a_part_of_a_recording_is_one(drag):
    part = drag[1000:-500]
    assert type(part) is hg.Recording and len(part) == len(drag) - 1500 and part.rate == drag.rate
    for one in ("acceleration", "force", "speed", "tangential"):
        assert np.array_equal(getattr(part, one), getattr(drag, one)[1000:-500])
    assert part.gesture == drag.gesture and part.origin == drag.origin and drag[:] == drag
    for wrong in (5, slice(0, 10, 2), slice(0.0, 1.0), "speed", (slice(0, 9), 1), slice(5, 5), slice(9, 3)):
        with pytest.raises(hg.Error):
            drag[wrong]


def test_what_reading_says_names_arguments_of_python(tmp_path):
    (tmp_path / "log.csv").write_text("t,vib,grip\n" + "".join(f"{i / 1000},{i % 7},1\n" for i in range(400)))
    with pytest.raises(hg.Error, match="`columns=") as raised:
        hg.read(tmp_path / "log.csv")
    assert "--" not in str(raised.value)
    (tmp_path / "fast.csv").write_text(
        "time_s,accel_m_s2,speed_m_s,force_normal_N\n" + "".join(f"{i / 1000},{i % 7},90,1\n" for i in range(400))
    )
    findings = hg.read(tmp_path / "fast.csv").findings
    assert any('`units={"speed": "mm/s"}`' in finding for finding in findings) and "--" not in "".join(findings)
