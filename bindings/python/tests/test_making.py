"""Surfaces of models that come from elsewhere."""

import pickle

import haptograph as hg
import numpy as np
import pytest

RATE = 1000.0
PLACES = [(force, speed) for force in (0.5, 1.0, 2.0) for speed in (0.05, 0.1, 0.2)]


def resonance(hz, radius=0.9):
    """Coefficients of a pair of poles."""
    return [-2 * radius * np.cos(2 * np.pi * hz / RATE), radius**2]


def power(ar):
    """Of white noise of variance 1 after an AR(2) filter (Box and Jenkins, 3.2.4)."""
    a, b = -ar[0], -ar[1]
    return (1 - b) / ((1 + b) * ((1 - b) ** 2 - a**2))


def lsf(ar):
    """Line spectral frequencies of an AR(2) polynomial, from its sum and difference with its mirror image."""
    return sorted([np.arccos(-(ar[0] + ar[1] - 1) / 2), np.arccos(-(ar[0] - ar[1] + 1) / 2)])


@pytest.fixture(scope="module")
def made():
    return hg.Surface([(f, v, resonance(80 + 400 * v), 0.2 * f) for f, v in PLACES], rate=RATE, name="net")


def test_a_surface_of_coefficients_has_these_models_and_renders_them(made, tmp_path):
    assert (made.name, made.origin, made.rate, made.max_force, made.max_speed) == ("net", "procedural", RATE, 2.0, 0.2)
    model = made.at(force=1.0, speed=0.1)
    assert np.allclose(model.ar, resonance(120), atol=1e-9)
    assert model.variance == pytest.approx(0.2)
    rendered = made.render(1.0, 0.1, seconds=60, seed=1)
    assert np.var(rendered) == pytest.approx(0.2 * power(resonance(120)), rel=0.1)
    assert made.recorded_force is None
    made.save(tmp_path / "net.ron")
    again = hg.Surface.load(tmp_path / "net.ron")
    assert again == made == pickle.loads(pickle.dumps(made))
    assert np.array_equal(again.render(1.0, 0.1, seconds=1, seed=3), made.render(1.0, 0.1, seconds=1, seed=3))


def test_line_spectral_frequencies_and_a_function_make_the_same_surface(made):
    other = hg.Surface.from_lsf([(f, v, lsf(resonance(80 + 400 * v)), 0.2 * f) for f, v in PLACES], rate=RATE)
    function = hg.Surface.from_function(
        lambda force, speed: (resonance(80 + 400 * speed), 0.2 * force), [0.5, 1, 2], [0.05, 0.1, 0.2], RATE
    )
    assert np.allclose(other.at(1, 0.1).lsf, lsf(resonance(120)), atol=1e-9)
    for surface in (other, function):
        for force, speed in [(1, 0.1), (0.7, 0.13), (1.9, 0.06)]:
            one, two = made.at(force, speed), surface.at(force, speed)
            assert np.allclose(one.ar, two.ar, atol=1e-9)
            assert one.variance == pytest.approx(two.variance)


def test_a_highpass_that_was_taken_off_is_applied_to_what_is_rendered(made):
    models = [(f, v, resonance(80 + 400 * v), 0.2 * f) for f, v in PLACES]
    filtered = hg.Surface(models, rate=RATE, highpass=60, name="net")
    power = [np.abs(np.fft.rfft(each.render(1.0, 0.1, seconds=60, seed=1))) ** 2 for each in (made, filtered)]
    assert (made.highpass, filtered.highpass) == (None, 60)
    hertz = np.linspace(0, RATE / 2, len(power[0]))
    for low, high, ratio in ((0, 10, 0.01), (200, 450, 1.0)):
        within = (hertz > low) & (hertz < high)
        assert power[1][within].sum() == pytest.approx(ratio * power[0][within].sum(), rel=0.05, abs=0.01 * power[0][within].sum())
    with pytest.raises(hg.Error, match="high-pass"):
        hg.Surface(models, rate=RATE, highpass=400)


def density(hz, force):
    """Two resonances over a slope, as of a material."""
    return 1e-3 * force * (1 / (1 + (hz / 300) ** 4) + 3 * np.exp(-(((hz - 180) / 40) ** 2)))


def test_a_spectrum_in_points_is_the_density_of_the_surface():
    hz = np.linspace(0, 500, 1001)
    surface = hg.Surface.from_spectra([(f, v, hz, density(hz, f)) for f, v in PLACES], rate=RATE, order=32)
    given, (_, found) = density(hz[20:900], 1.0), surface.at(1.0, 0.1).spectrum(hz[20:900])
    assert np.abs(10 * np.log10(found / given)).max() < 1.0
    assert np.var(surface.render(1.0, 0.1, seconds=60, seed=1)) == pytest.approx(density(hz, 1.0).mean() * 500, rel=0.1)


def test_bands_keep_their_power():
    edges = 20 * 2 ** (np.arange(14) / 3)
    bands = np.stack([edges[:-1], edges[1:]], axis=1)
    powers = np.array([np.mean(density(np.linspace(*band, 50), 1.0)) * (band[1] - band[0]) for band in bands])
    surface = hg.Surface.from_spectra([(f, v, bands, f * powers) for f, v in PLACES], rate=RATE, order=32)
    for band, wanted in zip(bands[1:-1], powers[1:-1]):
        hz = np.linspace(*band, 200)
        found = np.mean(surface.at(1.0, 0.1).spectrum(hz)[1]) * (band[1] - band[0])
        assert abs(10 * np.log10(found / wanted)) < 1.5, band


def test_the_other_parts_are_there(tmp_path):
    tap = np.exp(-np.arange(200) / 20) * np.sin(np.arange(200) / 3)
    surface = hg.Surface(
        [(1.0, 0.1, resonance(100), 0.1)], RATE, "all", taps=[(0.05, tap), (0.2, 3 * tap)], friction=0.4, stiffness=900,
        excitation=np.random.default_rng(1).laplace(size=5000), max_force=3, max_speed=0.4, source="a network", licence="CC0-1.0",
    )  # fmt: skip
    assert (surface.taps, surface.friction, surface.max_force, surface.max_speed) == (2, 0.4, 3, 0.4)
    assert surface.stiffness == pytest.approx(900)
    surface.save(tmp_path / "all.ron")
    text = (tmp_path / "all.ron").read_text()
    assert "a network" in text and "CC0-1.0" in text
    assert hg.Surface.load(tmp_path / "all.ron") == surface
    assert hg.Surface(friction=0.2).friction == 0.2


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: hg.Surface(), "give models"),
        (lambda: hg.Surface([(1, 0.1, [0.5], 1)]), "rate"),
        (lambda: hg.Surface([(1, 0.1, [0.5])], RATE), "four"),
        (lambda: hg.Surface([(1, 0.1, [-1.1], 1)], RATE), "1 N and 0.1 m/s"),
        (lambda: hg.Surface([(1, 0.1, [np.nan], 1)], RATE), "ar"),
        (lambda: hg.Surface([(0, 0.1, [0.5], 1)], RATE), "force"),
        (lambda: hg.Surface([(1, 0.1, [0.5], -1)], RATE), "variance"),
        (lambda: hg.Surface([(1, 0.1, [0.5], 1), (2, 0.1, [0.5, 0.1], 1)], RATE), "order"),
        (lambda: hg.Surface([(1, 0.1, [0.5], 1)], RATE, colour="red"), "colour"),
        (lambda: hg.Surface([(1, 0.1, [0.5], 1)], RATE, max_force=0.5), "0.5 N"),
        (lambda: hg.Surface([(1, 0.1, [0.5], 1)], RATE, excitation=np.zeros(10)), "silent"),
        (lambda: hg.Surface(taps=[(0.1, [1.0, 2.0])]), "taps_rate"),
        (lambda: hg.Surface(taps=[0.1], taps_rate=RATE), "pairs"),
        (lambda: hg.Surface(friction=0.3, excitation=[1.0, -1.0]), "models"),
        (lambda: hg.Surface.from_function(lambda f, v: [0.5], [1], [0.1], RATE), "ar, variance"),
        (lambda: hg.Surface.from_spectra([(1, 0.1, [50, 100], [1, 1])], RATE, warping=0.5), "warping"),
        (lambda: hg.Surface.from_lsf([(1, 0.1, [2.0, 1.0], 1)], RATE), "1 N and 0.1 m/s"),
        (lambda: hg.Surface.from_spectra([(1, 0.1, [100, 50], [1, 1])], RATE), "ascend"),
        (lambda: hg.Surface.from_spectra([(1, 0.1, [50, 100], [1, -1])], RATE), "negative"),
        (lambda: hg.Surface.from_spectra([(1, 0.1, [600, 700], [1, 1])], RATE), "half of the rate"),
        (lambda: hg.Surface.from_spectra([(1, 0.1, [50, 100], [1])], RATE), "shape"),
    ],
)
def test_what_is_no_model_is_refused_with_its_place(make, said):
    with pytest.raises(hg.Error, match=said):
        make()
