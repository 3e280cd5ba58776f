"""Surfaces, recordings, graphs and models as values: compared, hashed, copied, and passed to other processes."""

import copy
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import haptograph as hg

STEP = """Graph(format: 1, clocks: { "servo": Driver(rate_hz: 100) }, nodes: {
    "hand": Sine(clock: "servo", frequency_hz: 1, amplitude: 1, quantity: "length"),
    "twice": Twice(x: "hand"),
})"""


class Twice(hg.Node):
    """A node of one's own, which another process imports."""

    inputs = {"x": "length"}
    outputs = {"y": "length"}

    def process(self, times, x):
        return 2 * x


def vibration(surface: hg.Surface, seed: int) -> np.ndarray:
    return surface.render(1.0, 0.1, seconds=0.2, seed=seed)


def signal(graph: hg.Graph, probe: str) -> np.ndarray:
    return graph.run(0.1, probes=[probe])[probe].values


@pytest.fixture(scope="module")
def learned(drag) -> hg.Surface:
    with pytest.warns(hg.LearningWarning, match="only"):
        return hg.learn(drag[: int(2 * drag.rate)], name="cloth")


@pytest.fixture(params=["file", "learned", "recording", "model", "graph", "own node"])
def value(request, canvas, drag, pad, learned):
    return {
        "file": canvas,
        "learned": learned,
        "recording": drag,
        "model": canvas.at(1.0, 0.1),
        "graph": pad,
        "own node": hg.Graph.parse(STEP, nodes=[Twice]),
    }[request.param]


def test_a_pickle_is_equal_and_has_the_same_hash(value):
    for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
        again = pickle.loads(pickle.dumps(value, protocol))
        assert again is not value and again == value and hash(again) == hash(value)
        assert pickle.dumps(again, protocol) == pickle.dumps(value, protocol)
    assert value != "another" and len({value, again}) == 1


def test_a_copy_is_the_same_object(value):
    assert copy.copy(value) is value and copy.deepcopy([value])[0] is value


def test_what_differs_is_not_equal(canvas, drag, pad, graphs, tmp_path):
    assert canvas != canvas.resampled(1000) and canvas.at(1, 0.1) != canvas.at(1, 0.11)
    assert drag != drag[1:] and drag[1:] == drag[1:]
    path = graphs / "texturepad.ron"
    assert hg.Graph.load(path) == pad != hg.Graph.load(path, seed=5)
    assert hg.Graph.parse(path.read_text(), path) == pad
    canvas.save(tmp_path / "again.ron")
    assert hg.Surface.load(tmp_path / "again.ron") == canvas


def test_a_surface_is_its_file_and_keeps_what_learning_said(learned, tmp_path):
    learned.save(tmp_path / "cloth.ron")
    assert (tmp_path / "cloth.ron").read_bytes() in pickle.dumps(learned)
    again = pickle.loads(pickle.dumps(learned))
    assert np.array_equal(vibration(again, 3), vibration(learned, 3))
    assert again.coverage == learned.coverage and again.recorded_speed == learned.recorded_speed
    assert again.warnings == learned.warnings != []
    with pytest.raises(hg.Error, match="process"):
        again.page()


def test_sensor_readings_pass_too(graphs, tmp_path):
    hg.Graph.load(graphs / "recorder.ron").run(1, folder=tmp_path)
    (file,) = tmp_path.glob("*.npz")
    raw = hg.read(file)
    again = pickle.loads(pickle.dumps(raw))
    assert not raw.is_processed and again == raw and again.processed() == raw.processed()


def test_models_cannot_be_changed(canvas):
    with pytest.raises(ValueError):
        canvas.at(1.0, 0.1).ar[0] = 0
    again = pickle.loads(pickle.dumps(canvas.at(1.0, 0.1)))
    with pytest.raises(ValueError):
        again.ar[0] = 0
    assert np.array_equal(again.spectrum()[1], canvas.at(1.0, 0.1).spectrum()[1])


@pytest.mark.parametrize("way", ["spawn", "forkserver"])
def test_a_new_process_renders_the_same_bits(way, canvas, pad):
    if way not in multiprocessing.get_all_start_methods():
        pytest.skip(f"there is no {way} here")
    graphs = [(pad, "out.delivered"), (hg.Graph.parse(STEP, nodes=[Twice]), "twice")]
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(way)) as pool:
        made = list(pool.map(vibration, [canvas] * 3, range(3)))
        ran = [pool.submit(signal, *one).result() for one in graphs]
    for seed, one in enumerate(made):
        assert np.array_equal(one, vibration(canvas, seed)) and one.seed == seed
    assert all(one.any() and np.array_equal(one, signal(*given)) for one, given in zip(ran, graphs, strict=True))


def test_joblib_remembers_by_content(canvas, drag, graphs, tmp_path):
    joblib = pytest.importorskip("joblib")
    calls = []
    memory = joblib.Memory(tmp_path, verbose=0)

    @memory.cache(ignore=["called"])
    def render(surface, seed, called):
        called()
        return vibration(surface, seed)

    for surface in (canvas, hg.Surface.load(graphs / "surfaces/t2-canvas.ron"), pickle.loads(pickle.dumps(canvas))):
        made = render(surface, 1, lambda: calls.append(1))
        assert np.array_equal(made, vibration(canvas, 1)) and made.seed == 1
    assert len(calls) == 1
    assert joblib.hash(drag) == joblib.hash(pickle.loads(pickle.dumps(drag))) != joblib.hash(drag[1:])
    both = joblib.Parallel(n_jobs=2)(joblib.delayed(vibration)(canvas, seed) for seed in range(2))
    assert all(np.array_equal(one, vibration(canvas, seed)) for seed, one in enumerate(both))


def test_dask_tells_values_by_content(canvas, value):
    dask = pytest.importorskip("dask")
    from dask.base import tokenize

    again = pickle.loads(pickle.dumps(value))
    assert tokenize(value) == tokenize(again) != tokenize(canvas.resampled(1000))
    tasks = [dask.delayed(vibration)(canvas, seed) for seed in range(2)]
    made = dask.compute(*tasks, scheduler="processes", num_workers=2)
    assert all(np.array_equal(one, vibration(canvas, seed)) for seed, one in enumerate(made))


def test_ray_takes_a_surface(canvas):
    ray = pytest.importorskip("ray")
    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False)
    try:
        # A function of this module would have to be imported there.
        made = ray.get(ray.remote(lambda surface: surface.render(1.0, 0.1, seconds=0.2, seed=4)).remote(canvas))
    finally:
        ray.shutdown()
    assert np.array_equal(made, vibration(canvas, 4))


def test_damaged_pickles_are_errors(canvas, drag):
    for cls, arguments in ((type(canvas), (None,)), (type(drag), ([],))):
        with pytest.raises(hg.Error):
            cls._parse(b"nothing", *arguments)
