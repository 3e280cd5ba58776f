"""The error of a surface along a recording, and actuators fitted to sweeps, as the commands print them."""

import numpy as np
import pytest

import haptograph as hg


def test_a_surface_is_as_good_as_chance_lets_it_along_its_own_rendering(canvas, drag):
    found = hg.evaluate(canvas, drag, seeds=8)
    assert found.lsd < 1.5 * found.chance_lsd and abs(found.total) < 1 and len(found.bands) == len(found.signed)
    assert found.envelope == pytest.approx(found.envelope_seeds, rel=0.3) and found.seed == 1 and found.nse < 0.6
    again = hg.evaluate(canvas, drag, seeds=8)
    assert (again.lsd, again.kurtosis) == (found.lsd, found.kurtosis)
    loud = hg.Recording(0.1 * drag.acceleration, drag.force, drag.speed, drag.rate)
    assert hg.evaluate(canvas, loud, seeds=2).total == pytest.approx(20, abs=1)


def test_the_higher_rate_is_lowered(canvas, drag):
    slow = canvas.resampled(2000)
    for surface, recording in ((canvas, drag.processed(2000)), (slow, drag)):
        assert hg.evaluate(surface, recording, seeds=4).lsd < 1.5


def test_hostile_evaluations_are_errors(canvas, drag):
    circle = hg.Recording(drag.acceleration, drag.force, drag.speed, drag.rate, gesture="circle")
    for call in (
        lambda: hg.evaluate(canvas, circle),
        lambda: hg.evaluate(drag, canvas),
        lambda: hg.evaluate(canvas, drag, seeds=0),
        lambda: hg.evaluate(canvas, drag, seed=-1),
    ):
        with pytest.raises(hg.Error):
            call()
    assert hg.evaluate(canvas, drag[:4], seeds=1).lsd is None


@pytest.fixture(scope="module")
def sweep(graphs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    hg.Graph.load(graphs / "identify.ron").run(10, folder=folder)
    (file,) = folder.glob("*.csv")
    return file


def test_an_actuator_is_identified_from_its_file_and_from_arrays(sweep):
    found = hg.identify(sweep, magnet_g=14, body_g=140)
    (high, q), (low, _) = found.resonances
    assert high > low > 5 and q > 0.3 and found.unexplained < 0.05
    assert found.parameters["magnet_g"] == pytest.approx(14) and found.model.startswith("(force_n_per_a: ")
    table = np.genfromtxt(sweep, delimiter=",", names=True)
    time, current, acceleration = (table[name] for name in table.dtype.names[:3])
    rate = float(np.round(1 / np.diff(time).mean(), 3))
    same = hg.identify((current, acceleration), rate=rate, magnet_g=14, body_g=140)
    assert same.resonances[0] == pytest.approx(found.resonances[0], rel=1e-3)
    alone = hg.identify(sweep)
    assert alone.parameters is alone.model is None and alone.gain == pytest.approx(found.gain)


def test_hostile_sweeps_are_errors(sweep, tmp_path):
    noise = np.random.default_rng(1).normal(size=(2, 20_000))
    for call in (
        lambda: hg.identify(tmp_path / "none.csv"),
        lambda: hg.identify(noise),
        lambda: hg.identify(noise, rate=10_000),
        lambda: hg.identify(noise[:, :9], rate=10_000),
        lambda: hg.identify(5),
        lambda: hg.identify((noise[0], noise[1][:9]), rate=10_000),
        lambda: hg.identify(sweep, body_g=1),
        lambda: hg.identify(sweep, magnet_g=1),
        lambda: hg.identify(sweep, magnet_g=1, body_g=1, force_n_per_a=1),
        lambda: hg.identify(sweep, magnet_g=-1, body_g=1),
        lambda: hg.identify(sweep, band=(100, 10)),
        lambda: hg.identify(sweep, band=5),
    ):
        with pytest.raises(hg.Error):
            call()
