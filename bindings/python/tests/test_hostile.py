"""What no caller means: every call gives an error or the right numbers, whatever the arrays and threads."""

import contextlib
import decimal
import itertools
import threading

import numpy as np
import pytest

import haptograph as hg
from conftest import stroke

SAMPLES = 400


def views(values):
    """Arrays of the same numbers that lie otherwise in memory."""
    spread = np.zeros((len(values), 3))
    spread[:, 1] = values
    backwards = values[::-1].copy()
    locked = values.copy()
    locked.flags.writeable = False
    return {
        "a column": spread[:, 1],
        "backwards": backwards[::-1],
        "big-endian": values.astype(">f8"),
        "not aligned": np.frombuffer(b"\0" + values.tobytes(), np.uint8)[1:].view("f8"),
        "read-only": locked,
        "a list": values.tolist(),
        "a tuple": tuple(values.tolist()),
        "objects": values.astype(object),
        "decimals": [decimal.Decimal(value) for value in values.tolist()],
        "longdouble": values.astype(np.longdouble),
        "masked, nothing of it": np.ma.array(values, mask=np.zeros(len(values), bool)),
    }


def test_arrays_are_taken_by_their_numbers_whatever_their_type_and_layout(canvas):
    force, speed = stroke(SAMPLES, canvas.rate)
    wanted = canvas.render(force, speed, seed=1)
    for name, one in views(force).items():
        assert np.array_equal(canvas.render(one, speed, seed=1), wanted), name
    for kind in (np.int8, np.uint64, np.float16, np.float32, bool):
        whole = np.ones(SAMPLES, kind)
        assert np.array_equal(canvas.render(whole, speed, seed=1), canvas.render(np.ones(SAMPLES), speed, seed=1)), kind


NOT_NUMBERS = {
    "NaN": [np.nan] * SAMPLES,
    "one infinity": np.where(np.arange(SAMPLES) == 7, np.inf, 1.0),
    "above float64": np.full(SAMPLES, np.finfo(np.longdouble).max),
    "huge integers": [10**400] * SAMPLES,
    "complex": np.ones(SAMPLES, complex),
    "strings": ["1"] * SAMPLES,
    "bytes": b"1" * SAMPLES,
    "dates": np.zeros(SAMPLES, "datetime64[s]"),
    "spans": np.zeros(SAMPLES, "timedelta64[s]"),
    "structures": np.zeros(SAMPLES, [("a", "f8")]),
    "nothing": [None] * SAMPLES,
    "ragged": [[1.0], [1.0, 2.0]],
    "dictionaries": [{}] * SAMPLES,
    "masked": np.ma.array(np.ones(SAMPLES), mask=np.arange(SAMPLES) == 3),
    "huge": np.broadcast_to(1.0, 2**40),
    "huge, of two dimensions": np.broadcast_to(1.0, (2**20, 2**20)),
}


@pytest.mark.parametrize("name", NOT_NUMBERS)
def test_what_are_no_numbers_is_an_error_everywhere(name, canvas, drag, pad):
    wrong, right = NOT_NUMBERS[name], np.full(SAMPLES, 0.1)
    touch = {"stylus.position": np.zeros((SAMPLES, 3)), "stylus.touching": 1}
    with pad.player() as player:
        for call in (
            lambda: canvas.render(wrong, right),
            lambda: canvas.render(right, wrong),
            lambda: hg.render(canvas, wrong, right),
            lambda: hg.compare(wrong, drag, rate=drag.rate),
            lambda: canvas.at(1, 0.1).spectrum(wrong),
            lambda: hg.Recording(right, wrong, right, 1000),
            lambda: pad.run(inputs={"stylus.force": wrong, **touch}),
            lambda: player.push("stylus.force", wrong),
            lambda: player.set("stylus.force", wrong),
        ):
            with pytest.raises(hg.Error):
                call()


@pytest.mark.parametrize(
    "call",
    [
        lambda surface: hg.render(surface, [1.0], [0.1], seeds=range(2**62)),
        lambda surface: hg.render(surface, [1.0], [0.1], seeds=range(2**70)),
        lambda surface: hg.render(surface, [1.0], [0.1], seeds=itertools.count()),
        lambda surface: hg.render(surface, [1.0], [0.1], seeds=5),
        lambda surface: hg.render(surface, [1.0], [0.1], seeds=[]),
        lambda surface: hg.render(surface, [1.0], [0.1], threads=2**70),
        lambda surface: hg.render([surface] * 3, np.ones((2, 9)), 0.1),
        lambda surface: surface.render(1.0, 0.1, seconds=10**400),
        lambda surface: surface.render(1.0, 0.1, seconds=1e12),
        lambda surface: surface.render(np.ones((9, 9)), 0.1),
        lambda surface: surface.render([1.0], [0.1], update=np.inf),
        lambda surface: surface.resampled(10**400),
        lambda surface: hg.Graph.parse("\0"),
        lambda surface: hg.Graph.parse("(" * 100_000),
        lambda surface: hg.Graph.load("/dev/zero"),
        lambda surface: hg.Surface.load("/dev/zero"),
        lambda surface: hg.read("/dev/zero"),
        lambda surface: hg.read("a\0b.csv"),
        lambda surface: hg.Surface.load("a\0b.ron"),
        lambda surface: hg.Graph.parse("\ud800"),
        lambda surface: hg.Recording([1.0], [1.0], [1.0], 1000, gesture="\ud800"),
        lambda surface: hg.read("take.csv", gesture=5),
    ],
)
def test_huge_and_odd_arguments_are_errors(call, canvas):
    with pytest.raises(hg.Error) as raised:
        call(canvas)
    assert len(str(raised.value)) > 10


class Endless:
    """A sequence that never ends, as Python takes one."""

    def __getitem__(self, index):
        return "out"


RECURSIVE = []
RECURSIVE.append(RECURSIVE)
NO_LIST = [None, 5, "out", object(), Endless()]
NO_PATH = [5, 1.5, b"a\0b", "\ud800", object(), [1], {}]


@pytest.mark.parametrize("wrong", NO_PATH, ids=repr)
def test_what_is_no_path_is_an_error_everywhere(wrong, canvas, drag, pad, tmp_path):
    for call in (
        lambda: hg.Graph.load(wrong),
        lambda: hg.Graph.parse("Graph(format: 1, nodes: {})", path=wrong),
        lambda: pad.run(0.01, folder=wrong),
        lambda: pad.player(folder=wrong),
        lambda: hg.Surface.load(wrong),
        lambda: canvas.save(wrong),
        lambda: hg.read(wrong),
        lambda: hg.read([wrong]),
        lambda: drag.save(wrong),
        lambda: hg.batch(wrong, tmp_path),
        lambda: hg.merge([wrong], tmp_path),
    ):
        with pytest.raises(hg.Error):
            call()


@pytest.mark.parametrize("wrong", NO_LIST, ids=lambda one: type(one).__name__)
def test_what_is_no_list_is_an_error_everywhere(wrong, canvas, pad, tmp_path):
    calls = [
        lambda: hg.learn(wrong),
        lambda: hg.render(wrong, [1.0], 0.1),
        lambda: hg.merge(wrong, tmp_path),
        lambda: hg.read(wrong),
    ]
    if wrong is not None:
        calls += [
            lambda: pad.run(0.01, probes=wrong),
            lambda: pad.player(probes=wrong),
            lambda: pad.player(hosted=wrong),
            lambda: hg.render(canvas, [1.0], 0.1, seeds=wrong),
            lambda: hg.Graph.parse("Graph(format: 1, nodes: {})", nodes=wrong),
        ]
    for call in calls:
        with pytest.raises(hg.Error):
            call()


@pytest.mark.parametrize("wrong", ["gain", 5, ["gain"], np.ones(2), {"\ud800": 1}], ids=repr)
def test_what_is_no_dictionary_is_an_error_everywhere(wrong, pad, graphs):
    with pad.player() as player:
        for call in (
            lambda: hg.Graph.load(graphs / "texturepad.ron", set=wrong),
            lambda: pad.run(0.01, set=wrong),
            lambda: pad.run(0.01, inputs=wrong),
            lambda: player.process(1, wrong),
            lambda: hg.read("take.csv", columns=wrong),
            lambda: hg.read("take.csv", units=wrong),
            lambda: hg.read("take.csv", constants=wrong),
        ):
            with pytest.raises(hg.Error):
                call()


@pytest.mark.parametrize("value", [RECURSIVE, [[np.nan]], np.nan, 1j, {}, None, "\ud800", object()], ids=repr)
def test_what_no_graph_file_can_say_is_no_parameter(value, pad):
    with pytest.raises(hg.Error):
        pad.run(0.01, set={"gain": value})


@pytest.mark.parametrize("rate", ["1000", 10**400, np.nan, 0, -1, [1000], np.ma.masked], ids=repr)
def test_what_is_no_rate_is_an_error_everywhere(rate, canvas, drag):
    for call in (
        lambda: hg.compare([1.0] * 400, [1.0] * 400, rate=rate),
        lambda: hg.Recording([1.0], [1.0], [1.0], rate),
        lambda: hg.learn(drag, rate=rate),
        lambda: drag.processed(rate),
        lambda: canvas.resampled(rate),
    ):
        with pytest.raises(hg.Error):
            call()


def test_an_array_that_another_thread_changes_is_taken_as_it_was_or_refused(canvas):
    force, speed = stroke(200_000, canvas.rate)
    given, over = force.copy(), threading.Event()

    def spoil():
        while not over.is_set():
            given[:] = np.nan
            given[:] = force

    thread = threading.Thread(target=spoil)
    thread.start()
    try:
        for _ in range(20):
            try:
                assert np.isfinite(canvas.render(given, speed)).all()
                assert np.isfinite(hg.render(canvas, given, speed)).all()
            except hg.Error as error:
                assert "finite" in str(error)
    finally:
        over.set()
        thread.join()


def test_threads_that_race_for_an_output_fill_it_or_are_refused(canvas):
    rows, out, refused = np.full((32, 100_000), 0.1), np.empty((32, 100_000)), []

    def render():
        try:
            hg.render(canvas, 1.0, rows, seeds=range(1, len(out) + 1), threads=1, out=out)
        except hg.Error as error:
            refused.append(error)

    threads = [threading.Thread(target=render) for _ in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert len(refused) < 4 and all("out" in str(error) for error in refused)
    assert np.array_equal(out, hg.render(canvas, 1.0, rows, seeds=range(1, len(out) + 1)))


def test_threads_that_run_one_graph_have_its_bits(pad):
    def signals():
        return pad.run(0.3, probes=["texture/filter.acceleration"])["texture/filter.acceleration"].values

    wanted, found = signals(), [None] * 6

    def run(number):
        found[number] = signals()

    threads = [threading.Thread(target=run, args=(number,)) for number in range(6)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert all(np.array_equal(one, wanted) for one in found)


def test_threads_that_race_for_a_folder_leave_a_whole_one(graphs, pad, tmp_path):
    plan, kept, refused = tmp_path / "plan.ron", [], []
    plan.write_text(
        f"""Batch(surfaces: ["{graphs}/surfaces/t2-canvas.ron"], motions: {{ "m": Constant(seconds: 0.2, speed_mm_s: 80, force_n: 1) }},
    jobs: Product(seeds: (1, 40)), jobs_per_chunk: 4)"""
    )

    def render():
        try:
            kept.append(hg.batch(plan, tmp_path / "data", threads=1))
        except hg.Error as error:
            refused.append(error)

    threads = [threading.Thread(target=render) for _ in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert kept and len(kept) + len(refused) == 4
    whole = hg.batch(plan, tmp_path / "data")
    assert whole.complete and not whole.replaced and whole.rendered == 0


def test_a_player_that_is_fed_by_one_thread_and_run_by_another_loses_nothing(pad):
    player, pushed = pad.player(probes=["stylus.force"]), []
    frames = np.arange(500) / 500

    def push():
        at = 0
        while at < len(frames):
            at += player.push("stylus.force", frames[at:])
        pushed.append(at)

    thread = threading.Thread(target=push)
    thread.start()
    heard = [0.0]
    for _ in range(100_000):
        heard.extend(player.process(3840)["stylus.force"])
        if heard[-1] == frames[-1]:
            break
    thread.join()
    assert pushed == [500] and set(heard) == set(frames) and np.all(np.diff(heard) >= 0)
    player.finish()


def test_threads_that_race_for_one_player_run_every_frame_once_and_end_it_once(pad):
    player, over, ran, ended = pad.player(), threading.Barrier(6), [], []

    def run():
        over.wait()
        with contextlib.suppress(hg.Error):
            for _ in range(50):
                ran.append(len(player.process(96)["haptuator.current"]))

    def end():
        over.wait()
        with contextlib.suppress(hg.Error):
            while len(ran) < 20:
                player.turn("out.gain", 0.5)
        ended.append(player.finish())

    threads = [threading.Thread(target=work) for work in (run, run, run, run, end, end)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    outcomes = [one for one in ended if one is not None]
    assert len(ended) == 2 and len(outcomes) == 1
    assert outcomes[0].frames == 96 * len(ran) == sum(ran)


def test_threads_that_learn_from_one_recording_learn_the_same(drag):
    found = []
    threads = [threading.Thread(target=lambda: found.append(hg.learn(drag, order=6).at(1, 0.1))) for _ in range(3)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    wanted = hg.learn(drag, order=6).at(1, 0.1)
    assert len(found) == 3 and all(np.array_equal(one.ar, wanted.ar) for one in found)


def test_a_callback_may_call_the_package_again(canvas, pad):
    inner = []

    def again(part):
        if not inner:
            inner.append(canvas.render(1.0, 0.1, seconds=0.1, seed=1))
            inner.append(pad.run(0.1, probes=["out"])["out"].values)

    # Longer than what passes until it is first called: 50 ms.
    wanted = canvas.render(1.0, 0.1, seconds=600, seed=1)
    assert np.array_equal(canvas.render(1.0, 0.1, seconds=600, seed=1, progress=again), wanted)
    assert np.array_equal(inner[0], canvas.render(1.0, 0.1, seconds=0.1, seed=1)) and inner[1].any()
