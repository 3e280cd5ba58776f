"""Surfaces: learned, asked and rendered."""

import _thread
import pickle
import threading
import time
import warnings

import numpy as np
import pytest

import haptograph as hg
from conftest import stroke


def test_the_spectrum_is_that_of_what_is_rendered(canvas):
    rate, size = canvas.rate, 2048
    vibration = canvas.render(force=1.0, speed=0.1, seconds=60, seed=5)
    pieces = vibration[: len(vibration) // size * size].reshape(-1, size) * np.hanning(size)
    measured = 2 * (np.abs(np.fft.rfft(pieces)) ** 2).mean(axis=0) / (rate * (np.hanning(size) ** 2).sum())
    frequencies, density = canvas.at(force=1.0, speed=0.1).spectrum(np.fft.rfftfreq(size, 1 / rate))
    inside = (frequencies > 60) & (frequencies < 800)
    assert np.abs(10 * np.log10(measured[inside] / density[inside])).mean() < 1


def test_the_same_seed_gives_the_same_samples(canvas):
    force, speed = stroke(20_000, canvas.rate)
    one = canvas.render(force, speed, seed=1)
    assert one.shape == (20_000,) and np.array_equal(one, canvas.render(force, speed, seed=1))
    assert not np.array_equal(one, canvas.render(force, speed, seed=2))
    assert np.array_equal(canvas.render(1.0, speed, seed=1), canvas.render(np.ones_like(speed), speed, seed=1))


def test_nothing_vibrates_at_rest_or_without_force(canvas):
    assert canvas.at(force=1, speed=0).variance == canvas.at(force=0, speed=0.1).variance == 0
    assert not canvas.render(1.0, 0.0, seconds=0.5).any()


def test_a_surface_is_learned_and_sounds_like_its_recording(drag, tmp_path):
    parts = []
    learned = hg.learn(drag, name="cloth", progress=parts.append)
    assert learned.name == "cloth" and learned.friction == pytest.approx(0.4, abs=0.02)
    assert parts == sorted(parts)
    again = learned.render(drag.force, drag.speed, seed=9)
    assert hg.compare(again, drag, rate=drag.rate).lsd < 2.5
    quiet = hg.compare(0.1 * drag.acceleration, drag)
    assert quiet.total == pytest.approx(-20, abs=0.1) and len(quiet.signed) == len(quiet.bands)
    assert learned.save(tmp_path / "cloth.ron") == []
    kept = hg.Surface.load(tmp_path / "cloth.ron")
    assert np.array_equal(kept.render(drag.force, drag.speed, seed=9), again)
    assert "<svg" in learned._repr_html_() and "<svg" in learned.page()
    with pytest.raises(hg.Error, match="file"):
        kept.page()


def test_a_low_rate_is_refused_accepted_or_warned_of(drag):
    def every(step):
        columns = (column[::step] for column in (drag.acceleration, drag.force, drag.speed))
        return hg.Recording(*columns, drag.rate / step)

    slow, slower = every(round(drag.rate / 1000)), every(round(drag.rate / 100))
    with pytest.raises(hg.Error, match="500 Hz"):
        hg.learn(slower)
    with pytest.warns(UserWarning, match="above 45 Hz"):
        hg.learn(slower, accept_rate=True)
    with pytest.warns(UserWarning, match="above 450 Hz"):
        hg.learn(slow)


def test_learning_ends_at_ctrl_c_and_where_progress_raises(drag):
    threading.Timer(0.2, _thread.interrupt_main).start()
    with pytest.raises(KeyboardInterrupt):
        hg.learn([drag] * 20)

    def refuse(part):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        hg.learn([drag] * 20, progress=refuse)


def test_what_progress_raises_ends_a_rendering(canvas):
    def refuse(part):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        canvas.render(1.0, 0.1, seconds=600, progress=refuse)
    rows = np.full((64, 600_000), 0.1)
    with pytest.raises(RuntimeError, match="enough"):
        hg.render(canvas, 1.0, rows, progress=refuse)
    with pytest.raises(RuntimeError, match="enough"):
        hg.render(canvas, 1.0, rows, update=0.001, progress=refuse, out=rows)
    told = []
    whole = canvas.render(1.0, 0.1, seconds=600, seed=1, progress=told.append)
    assert told == sorted(told) and 0 <= told[0] <= told[-1] <= 1
    assert np.array_equal(whole, canvas.render(1.0, 0.1, seconds=600, seed=1))


def test_a_lower_rate_is_that_of_the_resampled_texture(canvas):
    slow = canvas.resampled(1000)
    assert slow.rate == 1000 and slow.friction == canvas.friction
    y = canvas.render(1.0, 0.1, seconds=2, rate=1000, seed=3)
    assert len(y) == 2000 and np.array_equal(y, slow.render(1.0, 0.1, seconds=2, seed=3))
    # What there is from 20 to 400 Hz is as loud at either rate.
    frequencies = np.linspace(20, 400, 96)
    (_, fast), (_, same) = (one.at(1.0, 0.1).spectrum(frequencies) for one in (canvas, slow))
    assert np.abs(10 * np.log10(same / fast)).max() < 1
    for rate in (canvas.rate, 2 * canvas.rate, 1, np.nan):
        with pytest.raises(hg.Error):
            canvas.resampled(rate)


def test_a_higher_rate_adds_nothing_above_the_textures_own(canvas):
    own = canvas.rate
    force, speed = stroke(int(2 * own), own)
    times = np.arange(int(2 * 2.5 * own)) / (2.5 * own)
    made = canvas.render(*(np.interp(times, np.arange(len(x)) / own, x) for x in (force, speed)), rate=2.5 * own, seed=3)
    assert made.rate == 2.5 * own and len(made) == len(times)
    power = np.abs(np.fft.rfft(made * np.hanning(len(made)))) ** 2
    above = np.fft.rfftfreq(len(made), 1 / made.rate) > 0.55 * own
    assert power[above].sum() < 1e-6 * power.sum()
    # What is felt of it is what the texture's own rate gives.
    slow = canvas.render(force, speed, seed=3)
    back = np.interp(np.arange(len(slow)) / own, times, made)
    assert abs(hg.compare(back, slow, rate=own).lsd_40_250) < 0.3


def test_samples_know_their_rate_and_unit_until_something_changes_them(canvas, drag):
    made = canvas.render(1.0, 0.1, seconds=1)
    assert (made.rate, made.unit, made.quantity, made.axes) == (canvas.rate, "m/s2", "acceleration", ("time",))
    assert made[100:].rate == made.rate and made.times[-1] == (len(made) - 1) / made.rate
    for plain in (made * 2, made[::2], np.concatenate([made, made]), np.asarray(made), made[[1, 2]]):
        assert type(plain) is np.ndarray
    for plain in (made.take([0, 4]), made.repeat(2), made.reshape(10, -1), made.argsort(), made.T, np.modf(made)[0], -made):
        assert type(plain) is np.ndarray
    assert np.block([[made, made], [made, made]]).shape == (2, 2 * len(made)) and made.mean() == np.asarray(made).mean()
    np.add.at(made, [0], 1)
    assert np.array_equal(divmod(made, 2)[1], np.asarray(made) % 2)
    rows = hg.render(canvas, np.ones((2, 1000)), 0.1)
    assert rows.axes == ("voice", "time") and rows[1].axes == ("time",) and rows[1].unit == "m/s2"
    assert (drag.force.unit, drag.speed.unit, drag.force.rate) == ("N", "m/s", drag.rate)
    assert type(rows.T) is type(rows[:, 0]) is type(rows[::2]) is np.ndarray and rows[0, 10:].axes == ("time",)
    for kept in (made, rows):
        again = pickle.loads(pickle.dumps(kept))
        assert np.array_equal(again, kept) and (again.rate, again.axes) == (kept.rate, kept.axes) == (canvas.rate, kept.copy().axes)
    made += 1
    assert made.rate == canvas.rate
    # A rate that is known is not taken for another.
    with pytest.raises(hg.Error, match="rates differ"):
        hg.compare(canvas.render(1.0, 0.1, seconds=2, rate=1000), drag)
    with pytest.raises(hg.Error, match="rate="):
        canvas.resampled(1000).render(drag.force, drag.speed)
    with pytest.raises(hg.Error, match="m/s2"):
        hg.compare(drag.speed, drag)


def test_rates_whose_ratio_is_rounded_are_rendered_to_the_last_sample(canvas):
    # 95370 samples at three times the rate are a third and a rounding error at the rate itself.
    assert len(canvas.resampled(5685.7).render(np.ones(95370), 0.1, rate=17057.1)) == 95370
    with pytest.raises(hg.Error, match="ratio"):
        canvas.resampled(2000).render(np.ones(100), 0.1, rate=5000.1)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"force": 1.0, "speed": 0.1}, "duration"),
        ({"force": [1.0], "speed": 0.1, "seconds": 1}, "leave"),
        ({"force": [1.0, 1.0], "speed": [0.1] * 3}, "same length"),
        ({"force": [[1.0]], "speed": 0.1}, "dimension"),
        ({"force": [np.nan], "speed": 0.1}, "finite"),
        ({"force": [1j], "speed": 0.1}, "real"),
        ({"force": ["a"], "speed": 0.1}, "real"),
        ({"force": [None], "speed": 0.1}, "finite|numbers"),
        ({"force": 1.0, "speed": 0.1, "seconds": 1e300}, "at most"),
        ({"force": 1.0, "speed": 0.1, "seconds": np.nan}, "finite"),
        ({"force": [1.0], "speed": 0.1, "rate": np.inf}, "finite"),
        ({"force": [1.0], "speed": 0.1, "rate": 1e12}, "rate"),
        ({"force": [1.0], "speed": 0.1, "seed": -1}, "seed"),
        ({"force": [1.0], "speed": 0.1, "seed": 2**64}, "seed"),
        ({"force": [1.0], "speed": 0.1, "seed": 1.5}, "whole"),
        ({"force": [1.0], "speed": 0.1, "update": 0}, "above"),
    ],
)
def test_hostile_trajectories_are_errors(canvas, arguments, said):
    with pytest.raises(hg.Error, match=said):
        canvas.render(**arguments)


def test_other_hostile_calls_are_errors(canvas, drag, tmp_path):
    for call in (
        lambda: canvas.at(force=-1, speed=0.1),
        lambda: canvas.at(force=np.nan, speed=0.1),
        lambda: canvas.at(force=[1, 2], speed=0.1),
        lambda: canvas.at(1, 0.1).spectrum([np.inf]),
        lambda: hg.learn([]),
        lambda: hg.learn([1]),
        lambda: hg.learn(drag, method="magic"),
        lambda: hg.learn(drag, order=0),
        lambda: hg.learn(drag, rate=2 * drag.rate),
        lambda: hg.compare([1.0, 2.0], [1.0]),
        lambda: hg.compare(np.ones(4000), drag, rate=1),
        lambda: hg.compare([1.0, 2.0], [1.0, 2.0], rate=1000),
        lambda: hg.compare(np.ones((2, 2)), drag),
        lambda: hg.compare(drag, drag, window=2**40),
        lambda: hg.Surface.load(tmp_path / "none.ron"),
        lambda: canvas.save(tmp_path / "surface.txt"),
        lambda: hg.Surface(),
    ):
        with pytest.raises(hg.Error) as raised:
            call()
        assert len(str(raised.value)) > 10


def test_other_threads_run_meanwhile(canvas):
    ticks, over = [], threading.Event()

    def tick():
        while not over.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.002)

    thread = threading.Thread(target=tick)
    thread.start()
    try:
        began = time.monotonic()
        canvas.render(1.0, 0.1, seconds=300)
        ended = time.monotonic()
    finally:
        over.set()
        thread.join()
    assert sum(began < at < ended for at in ticks) > 5


def test_many_threads_render_the_same(canvas):
    force, speed = stroke(20_000, canvas.rate)
    wanted, got = canvas.render(force, speed, seed=1), [None] * 8

    def render(number):
        got[number] = canvas.render(force, speed, seed=1)

    threads = [threading.Thread(target=render, args=(number,)) for number in range(8)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert all(np.array_equal(one, wanted) for one in got)


def test_rows_are_rendered_at_once_and_none_depends_on_the_others(graphs, canvas):
    tile = hg.Surface.load(graphs / "surfaces/t3-tile.ron")
    force, speed = stroke(3000, canvas.rate)
    forces = np.stack([force * (1 + 0.01 * row) for row in range(20)])
    surfaces = [canvas, tile] * 10
    many = hg.render(surfaces, forces, speed, seeds=range(5, 25))
    assert many.shape == (20, 3000)
    for row in (0, 7, 19):
        alone = hg.render(surfaces[row], forces[row], speed, seeds=[5 + row], threads=1)
        assert np.array_equal(alone[0], many[row])
        one = surfaces[row].render(forces[row], speed, seed=5 + row)
        assert np.abs(one - many[row]).max() < 1e-9 * np.abs(one).max()
    assert np.array_equal(hg.render(canvas, forces, speed, seeds=range(20)), hg.render([canvas] * 20, forces, speed, seeds=range(20), threads=1))


def test_rows_go_into_an_array_of_the_callers(canvas):
    force, speed = stroke(3000, canvas.rate)
    forces = np.stack([force * (1 + 0.1 * row) for row in range(5)])
    wanted, out = hg.render(canvas, forces, speed, seeds=range(5)), np.full((5, 3000), np.nan)
    assert hg.render(canvas, forces, speed, seeds=range(5), out=out) is out and np.array_equal(out, wanted)
    # An input may be the output: it is read first.
    assert np.array_equal(hg.render(canvas, forces, speed, seeds=range(5), out=forces), wanted)
    none = np.empty((5, 0))
    assert hg.render(canvas, none, none, out=none) is none
    read_only = np.empty((1, 3000))
    read_only.flags.writeable = False
    for wrong in (
        out,
        out[0],
        [[0.0] * 3000],
        np.empty((1, 3000), np.float32),
        np.empty((1, 3000), ">f8"),
        np.empty((1, 6000))[:, ::2],
        np.frombuffer(bytes(8 * 3000 + 1), np.uint8)[1:].view(np.float64).reshape(1, 3000),
        read_only,
    ):
        with pytest.raises(hg.Error, match="out"):
            hg.render(canvas, [force], speed, out=wrong)


def test_rows_are_read_however_their_numbers_lie(canvas):
    force, speed = stroke(3000, canvas.rate)
    wanted = hg.render(canvas, np.tile(force, (3, 1)), speed, seeds=[1, 2, 3])
    wide = np.zeros((3, 6000))
    wide[:, ::-2] = force
    unaligned = np.frombuffer(b"0" + force.tobytes(), np.uint8)[1:].view(np.float64)
    for given in (
        np.broadcast_to(force, (3, 3000)),
        np.asfortranarray(np.tile(force, (3, 1))),
        wide[:, ::-2],
        np.tile(unaligned, (3, 1)),
        [unaligned] * 3,
        np.tile(force, (3, 1)).astype(">f8"),
    ):
        assert np.array_equal(hg.render(canvas, given, speed, seeds=[1, 2, 3]), wanted)
    assert np.array_equal(hg.render(canvas, unaligned, speed, seeds=[1, 2, 3]), wanted)


def test_hostile_rows_are_errors(canvas):
    force, speed = stroke(100, canvas.rate)
    for call in (
        lambda: hg.render([], force, speed),
        lambda: hg.render([canvas, 1], force, speed),
        lambda: hg.render(canvas, [force] * 3, [speed] * 2),
        lambda: hg.render(canvas, force, speed[:50]),
        lambda: hg.render(canvas, [[force]], speed),
        lambda: hg.render([canvas] * 2, [force] * 3, speed),
        lambda: hg.render(canvas, [force] * 3, speed, seeds=[1, 2]),
        lambda: hg.render(canvas, [force], speed, seeds=[-1]),
        lambda: hg.render(canvas, [force], speed * np.nan),
        lambda: hg.render(canvas, [force], speed, update=0),
        lambda: hg.render(canvas, [force], speed, threads=0),
    ):
        with pytest.raises(hg.Error):
            call()


def test_seeds_are_fresh_unless_given_and_are_stated(canvas):
    one, other = (canvas.render(1.0, 0.1, seconds=0.1) for _ in range(2))
    assert one.seed != other.seed and not np.array_equal(one, other)
    assert np.array_equal(canvas.render(1.0, 0.1, seconds=0.1, seed=one.seed), one) and one[5:].seed == one.seed
    generator = np.random.default_rng(3)
    first, second = (canvas.render(1.0, 0.1, seconds=0.1, seed=generator) for _ in range(2))
    assert first.seed != second.seed
    assert first.seed == canvas.render(1.0, 0.1, seconds=0.1, seed=np.random.default_rng(3)).seed
    sequence = np.random.SeedSequence(3)
    assert len({canvas.render(1.0, 0.1, seconds=0.1, seed=child).seed for child in [sequence, sequence, *sequence.spawn(2)]}) == 3
    assert canvas.render(1.0, 0.1, seconds=0.1, seed=np.uint8(7)).seed == 7
    # The same bits, whether or not the rate is another.
    assert canvas.render(1.0, 0.1, seconds=0.1, rate=1000, seed=7).seed == 7


def test_rows_have_seeds_of_their_own(canvas):
    speeds = np.full((3, 200), 0.1)
    rows = hg.render(canvas, 1.0, speeds)
    assert len(set(rows.seed)) == 3 and rows[1].seed == rows.seed[1] and rows[1:].seed == rows.seed[1:]
    assert np.array_equal(hg.render(canvas, 1.0, speeds, seeds=rows.seed), rows)
    for source in (lambda: np.random.default_rng(4), lambda: np.random.SeedSequence(4)):
        drawn = hg.render(canvas, 1.0, speeds, seeds=source())
        assert len(set(drawn.seed)) == 3 and drawn.seed == hg.render(canvas, 1.0, speeds, seeds=source()).seed
    assert pickle.loads(pickle.dumps(rows)).seed == rows.seed and rows.clamped == (0, 0, 0)


def test_a_velocity_is_taken_by_its_magnitude_with_a_warning(canvas):
    velocity = 0.1 * np.sin(np.arange(2000) / 300)
    wanted = canvas.render(1.0, np.abs(velocity), seed=1)
    with pytest.warns(hg.RangeWarning, match="magnitude"):
        assert np.array_equal(canvas.render(1.0, velocity, seed=1), wanted)
    with pytest.warns(hg.RangeWarning, match="magnitude"):
        rows = hg.render(canvas, 1.0, velocity, seeds=[1])
    assert np.array_equal(rows, hg.render(canvas, 1.0, np.abs(velocity), seeds=[1]))
    with pytest.warns(hg.RangeWarning, match="magnitude"):
        recording = hg.Recording(wanted, np.ones(2000), velocity, canvas.rate)
    assert np.array_equal(recording.speed, np.abs(velocity)) and velocity.min() < 0


def test_what_is_outside_the_range_is_counted_and_warned_of_once(canvas, graphs):
    speed = np.full(1000, 0.1)
    speed[:300] = 2 * canvas.max_speed
    with pytest.warns(hg.RangeWarning, match="300 of 1000") as warned:
        made = canvas.render(1.0, speed, seed=1)
    assert len(warned) == 1 and made.clamped == 300 and warned[0].filename == __file__
    assert np.array_equal(made, canvas.render(1.0, np.minimum(speed, canvas.max_speed), seed=1))
    tile = hg.Surface.load(graphs / "surfaces/t3-tile.ron")
    with pytest.warns(hg.RangeWarning, match="300 of 2000") as warned:
        rows = hg.render([canvas, tile], [[1.0], [1.0]], np.stack([speed, np.full(1000, 0.1)]))
    assert len(warned) == 1 and rows.clamped == (300, 0) and warned[0].filename == __file__
    with pytest.warns(hg.RangeWarning):
        assert canvas.render(100.0, 0.1, seconds=0.1, rate=1000).clamped == 100
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert canvas.render(canvas.max_force, canvas.max_speed, seconds=0.1).clamped == 0


def test_samples_show_themselves(canvas):
    made = canvas.render(1.0, 0.1, seconds=1, seed=1)
    assert repr(made).startswith("Samples([") and "..., " in repr(made)
    assert repr(made).endswith(f"shape=({len(made)},), unit='m/s2', rate={made.rate:g})") and str(made).startswith("[")
    assert "<svg" in made._repr_html_() and "data:audio/wav" in made._repr_html_()
    rows = hg.render(canvas, np.ones((2, 1000)), 0.1)
    assert "shape=(2, 1000)" in repr(rows) and "<svg" in rows._repr_html_()
    for empty in (made[:0], rows[:0], rows[:, :0]):
        assert "shape=" in repr(empty) and "<p>" in empty._repr_html_()


def test_what_learning_warns_of_is_a_warning_and_an_attribute(drag, canvas):
    tap = hg.Recording(drag.acceleration, drag.force, drag.speed, drag.rate, gesture="tap")
    with pytest.warns(hg.LearningWarning, match="no taps") as warned:
        surface = hg.learn([drag, tap])
    assert surface.warnings == surface.missing == [str(one.message) for one in warned] != []
    assert warned[0].filename == __file__
    assert surface.coverage.areas == 9 and 11 < surface.coverage.seconds <= 12 and surface.coverage.record_next is None
    with pytest.warns(hg.LearningWarning, match="learned from only 2 s"):
        short = hg.learn(drag[: int(2 * drag.rate)])
    assert short.coverage.areas < 9 and "mm/s" in short.coverage.record_next
    low, high = surface.recorded_speed
    assert 0.01 < low < high < 0.17 and high < surface.max_speed
    low, high = surface.recorded_force
    assert 0.2 < low < high < 2.2 and high <= surface.max_force
    assert surface.resampled(1000).coverage == surface.coverage
    assert canvas.coverage is None and canvas.warnings == [] and 2 < canvas.recorded_force[1] < canvas.max_force
    for learned in (surface, hg.learn(drag, method="thesis")):
        again = hg.Surface._parse(learned._inner.dump(), None)
        assert again.recorded_speed == pytest.approx(learned.recorded_speed, rel=1e-12)
        assert again.recorded_force == pytest.approx(learned.recorded_force, rel=1e-12)
        assert again.coverage is None
    circle = hg.Recording(drag.acceleration, drag.force, drag.speed, drag.rate, drag.tangential, gesture="circle")
    friction = hg.learn(circle)
    for surface in (friction, hg.Surface._parse(friction._inner.dump(), None)):
        assert surface.recorded_speed is surface.recorded_force is surface.coverage is None and surface.warnings == []


def test_messages_name_arguments_of_python(drag):
    slow = hg.Recording(*(column[:: round(drag.rate / 100)] for column in (drag.acceleration, drag.force, drag.speed)), 100)
    with pytest.raises(hg.Error, match=r"`accept_rate=True`"):
        hg.learn(slow)
    for said, wanted in {
        'no speed; --column speed="v" --unit speed=m/s': 'no speed; `columns={"speed": "v"}` `units={"speed": "m/s"}`',
        "choose one with --column accel=NAME": 'choose one with `columns={"accel": "NAME"}`',
        "(or --sample-rate HZ, where rows": "(or `rate=HZ`, where rows",
        "or --constant speed_mm_s=50)": 'or `constants={"speed_mm_s": 50}`)',
        "leave out --strict": "leave out `strict=True`",
        "with --full-scale": "with `full_scale=`",
        "units with --unit": "units with `units=`",
    }.items():
        assert str(hg.Error(said)) == wanted
