"""Graphs: whole runs, runs in blocks, and the bits of the command."""

import _thread
import os
import pickle
import shutil
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import haptograph as hg
from conftest import ROOT

PROBE = "texture/filter.acceleration"
TOUCH = {"stylus.force": 1, "stylus.touching": 1}


def command() -> str | None:
    """The command beside this checkout, or wherever HAPTOGRAPH says."""
    built = [ROOT / "target" / profile / "haptograph" for profile in ("release", "debug")]
    found = [str(path) for path in built if path.exists()]
    return os.environ.get("HAPTOGRAPH") or shutil.which("haptograph") or (found[0] if found else None)


def test_a_run_has_the_bits_of_the_command(graphs, tmp_path):
    program = command()
    if program is None:
        assert not os.environ.get("CI"), "the command is not built"
        pytest.skip("the command is not built")
    probe = tmp_path / "probe.csv"
    arguments = f"--for 2 --set gain=0.5 --seed 9 --out {tmp_path}/out --probe {PROBE}={probe}".split()
    subprocess.run([program, "run", graphs / "texturepad.ron", *arguments], check=True, capture_output=True)
    graph = hg.Graph.load(graphs / "texturepad.ron", set={"gain": 0.5})
    run = graph.run(2, seed=9, probes=[PROBE, "out.delivered"])
    wav = (tmp_path / "out/current.wav").read_bytes()
    data = wav.index(b"data") + 8
    current = np.frombuffer(wav[data : data + 4 * 96_000], dtype="<f4")
    assert len(current) == 96_000 and np.array_equal(current, run["out.delivered"].values.astype("f4"))
    written = np.loadtxt(probe, delimiter=",", skiprows=1 + probe.read_text()[:4000].count("#"), usecols=1)
    assert np.array_equal(written, run[PROBE].values)


def test_signals_know_what_they_are(pad):
    run = pad.run(0.5, probes=["stylus.position", "out"])
    position, current = run["stylus.position"], run["out"]
    assert position.values.shape == (63, 3) and position.components == ["x", "y", "z"]
    assert (position.unit, position.rate, position.kind, position.simulated) == ("m", 125, "3-vector", True)
    assert (current.unit, current.quantity, len(current)) == ("A", "current", 24_000)
    assert np.array_equal(np.asarray(current), current.values) and current.times[-1] == pytest.approx(0.5 - 1 / 48_000)
    assert run.outcome.seconds == 0.5 and run.outcome.not_finite_ticks == 0
    assert "<svg" in run._repr_html_() and list(run) == ["stylus.position", "out"]
    with pytest.raises(KeyError, match="stylus.position"):
        run["stylus"]
    with pytest.raises(hg.Error):
        hg.compare(current, current, rate=1000)


def test_pandas_out(pad):
    pytest.importorskip("pandas")
    run = pad.run(0.1, probes=["stylus.position", "out"])
    table = run["stylus.position"].to_pandas()
    assert list(table.columns) == ["x", "y", "z"] and table.attrs["unit"] == "m"
    assert run["out"].to_pandas().index[1] == 1 / 48_000


def test_without_probes_a_run_keeps_what_its_page_shows(pad):
    assert {"stylus.position", "stylus.force"} <= set(pad.run(0.1))


def test_a_hand_of_arrays_feels_what_the_simulated_one_does(pad):
    names = ["stylus.position", "stylus.force", "stylus.touching"]
    simulated = pad.run(3, probes=[*names, PROBE, "out.delivered"])
    hand = {name: simulated[name].values for name in names}
    assert [pad.inputs[name] for name in names] == [(3, "m"), (1, "N"), (1, "1")]
    fed = pad.run(3, inputs=hand, probes=[PROBE, "out.delivered"])
    for name in fed:
        assert np.array_equal(fed[name].values, simulated[name].values) and fed[name].values.any()
    # As long as the arrays.
    assert pad.run(inputs=hand, probes=["out"]).outcome.seconds == pytest.approx(3, abs=0.01)
    # And once more in blocks that fit nothing.
    blocks = []
    with pad.player(hosted=["stylus"], probes=[PROBE]) as player:
        given = {name: 0 for name in names}
        while player.frames < 144_000:
            for name in names:
                given[name] += player.push(name, hand[name][given[name] :])
            blocks.append(player.process(min(977, 144_000 - player.frames))[PROBE])
    assert np.array_equal(np.concatenate(blocks), simulated[PROBE].values)


def test_constants_last_for_all_time(pad):
    circle = 0.03 * np.exp(1j * np.arange(250) * 0.05)
    position = np.column_stack([circle.real, circle.imag, np.zeros(250)])
    hand = {"stylus.position": position, "stylus.force": 1.0, "stylus.touching": 1}
    run = pad.run(2, inputs=hand, probes=["stylus.force", "out.delivered"])
    assert (run["stylus.force"].values == 1).all()
    assert np.abs(run["out.delivered"].values[-4800:]).max() > 0.01
    still = pad.run(1, inputs={**hand, "stylus.force": 0}, probes=["out.delivered"])
    assert not still["out.delivered"].values.any() and still.outcome.seconds == 1


def test_a_players_settings_turn_while_it_runs(pad):
    with pad.player() as player:
        loudest = []
        for call in range(200):
            angle = 0.05 * call
            position = [0.03 * np.cos(angle), 0.03 * np.sin(angle), 0]
            put_out = player.process(480, {"stylus.position": position, "stylus.force": 1, "stylus.touching": 1})
            loudest.append(np.abs(put_out["haptuator.current"]).max())
            if call == 100:
                player.turn("out.gain", 0)
        assert max(loudest[:100]) > 0.01 and max(loudest[110:]) == 0
        assert player.state == "running" and player.rate == 48_000
        assert player.inputs["stylus.position"] == (3, "m", 125) and set(player.outputs) == {"haptuator.current"}
        player.stop()
        player.process(48_000)
        assert player.state == "stopped"
    assert player.finish() is None
    with pytest.raises(hg.Error, match="finished"):
        player.process(1)


COUNTED = """Graph(format: 1, clocks: {"s": Driver(rate_hz: 10000)}, endpoints: {"program": {"e": Host()}}, nodes: {
    "n": LiveInput(clock: "s", endpoint: "e", quantity: "force"), "file": CsvSink(inputs: ["n"], file: "n.csv")})"""


def test_a_run_waits_for_its_files(tmp_path):
    count = np.arange(1.0, 200_001)
    graph = hg.Graph.parse(COUNTED, endpoints="program")
    graph.run(inputs={"e.value": count}, folder=tmp_path / "run")
    with graph.player(folder=tmp_path) as player:
        player.process(200_000, {"e.value": 7.0})
    for file, expected in (("run/n.csv", count), ("n.csv", np.full(200_000, 7.0))):
        assert np.array_equal(np.loadtxt(tmp_path / file, delimiter=",", skiprows=1)[:, 1], expected)


def test_files_go_to_a_folder_and_replace_nothing(pad, tmp_path):
    pad.run(0.1, folder=tmp_path / "new")
    assert (tmp_path / "new/current.wav").stat().st_size > 4800
    with pytest.raises(hg.Error, match="already"):
        pad.run(0.1, folder=tmp_path / "new")


def test_an_error_of_a_graph_keeps_code_place_and_help():
    text = 'Graph(format: 1, clocks: {"c": Driver(rate_hz: 1000)}, nodes: {"a": Gian(input: "b")})'
    with pytest.raises(hg.GraphError) as raised:
        hg.Graph.parse(text, path="mine.ron")
    error = raised.value
    first = next(one for one in error.diagnostics if one.severity == "error")
    assert error.code == first.code and error.code.startswith("E") and error.help == first.help and error.help
    start, end = error.span
    assert text[start:end].startswith("Gian") and (first.file, first.line) == ("mine.ron", 1)
    assert "mine.ron:1:" in str(error) and "Gain" in str(error) and f"error[{error.code}]" in str(error)
    again = pickle.loads(pickle.dumps(error))
    assert (again.code, again.span, str(again)) == (error.code, error.span, str(error))


def test_a_notebook_shows_the_graph(pad):
    assert pad._repr_svg_().startswith("<svg") and "texture" in pad.about
    assert pad.parameters["gain"] == "1.0" and pad.clocks["audio"] == 48_000 and "out.gain" in pad.settings
    assert PROBE in pad.outputs and pad.warnings == [] and pad.seed == 7


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"seconds": 0}, "above"),
        ({"seconds": -1}, "above"),
        ({"seconds": np.nan}, "finite"),
        ({"seconds": 1e6}, "GB"),
        ({"seconds": 1e9, "probes": []}, "10000000"),
        ({"seconds": "1"}, "real"),
        ({"probes": "out"}, "list"),
        ({"probes": ["out.sound"]}, "out.delivered"),
        ({"set": {"gian": 1}}, "gian"),
        ({"set": {"gain": np.nan}}, "finite"),
        ({"set": {"gain": object()}}, "parameter"),
        ({"set": ["gain"]}, "dictionary"),
        ({"seed": -1}, "seed"),
        ({"inputs": [1]}, "dictionary"),
        ({"inputs": {"stylus.force": 1}}, "stylus.position"),
        ({"inputs": {"stylus.forse": 1}}, "stylus.force"),
        ({"inputs": {"nobody.force": 1}}, "nobody"),
        ({"inputs": {"stylus.position": np.ones(9), **TOUCH}}, "3 components"),
        ({"inputs": {"stylus.position": np.ones((9, 3, 1)), **TOUCH}}, "shape"),
        ({"inputs": {"stylus.position": np.ones((9, 0)), **TOUCH}}, "shape"),
        ({"inputs": {"stylus.position": np.full((9, 3), np.nan), **TOUCH}}, "finite"),
        ({"inputs": {"stylus.position": np.ones((9, 3)), "stylus.force": "a", "stylus.touching": 1}}, "real"),
        ({"seconds": 1, "inputs": {"stylus.position": np.ones((9, 3)), **TOUCH}}, "9 frames"),
        ({"inputs": {"stylus.position": np.ones((0, 3)), **TOUCH}}, "above 0"),
    ],
)
def test_hostile_runs_are_errors(pad, arguments, said):
    with pytest.raises(hg.Error, match=said):
        pad.run(**arguments)


def test_hostile_players_are_errors(pad, tmp_path, graphs):
    player = pad.player()
    for call, said in (
        (lambda: player.process(-1), "frames"),
        (lambda: player.process(2**40), "frames"),
        (lambda: player.process(1.5), "whole"),
        (lambda: player.process(1, {"stylus.forse": 1}), "stylus.force"),
        (lambda: player.set("stylus.position", 1), "3 components"),
        (lambda: player.set("stylus.position", [1, 2, np.nan]), "finite"),
        (lambda: player.set("stylus.force", 1, at=np.inf), "finite"),
        (lambda: player.push("stylus.force", 1), "array"),
        (lambda: player.push("stylus.position", np.ones(3)), "components"),
        (lambda: player.turn("out.gian", 1), "out.gain"),
        (lambda: player.turn("out.gain", np.nan), "finite"),
        (lambda: pad.player(probes=["out.sound"]), "out.delivered"),
        (lambda: pad.player(hosted=["nobody"]), "nobody"),
        (lambda: pad.player(folder=tmp_path / "nowhere"), "nowhere"),
        (lambda: hg.Graph.load(graphs / "two-drivers.ron").player(), "driver"),
        (lambda: hg.Graph.load(tmp_path / "none.ron"), "none.ron"),
        (lambda: hg.Player(), "player"),
        (lambda: hg.Graph(), "load"),
    ):
        with pytest.raises(hg.Error, match=said):
            call()
    assert player.push("stylus.force", np.ones(10_000)) < 10_000
    assert player.finish().frames == 0


def test_threads_that_race_for_a_player_get_frames_or_errors(pad):
    player, wrong = pad.player(), []

    def race(number):
        for call in range(100):
            try:
                player.process(48, {"stylus.force": 1})
                if (number, call) == (0, 60):
                    player.finish()
            except hg.Error as error:
                if "finished" not in str(error) and "full" not in str(error):
                    wrong.append(error)

    threads = [threading.Thread(target=race, args=(number,)) for number in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert not wrong


def test_ctrl_c_ends_a_run_and_its_files_are_complete(pad, tmp_path):
    threading.Timer(0.3, _thread.interrupt_main).start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        pad.run(1e5, probes=[], folder=tmp_path)
    assert time.monotonic() - began < 30
    wav = Path(tmp_path / "current.wav").read_bytes()
    assert int.from_bytes(wav[4:8], "little") + 8 == len(wav) > 1000


def test_what_progress_raises_ends_a_run(pad):
    def refuse(part):
        raise RuntimeError(f"at {part}")

    with pytest.raises(RuntimeError, match="^at "):
        pad.run(1e5, probes=[], progress=refuse)


def test_a_frame_is_the_same_in_every_form(graphs):
    graph = hg.Graph.load(graphs / "cookbook/wall.ron")

    def force(position):
        with graph.player() as player:
            return [player.process(1, {"arm.position": position})["arm.force"] for _ in range(9)]

    wanted = force([0.0, 0.0, 0.001])
    assert np.any(wanted)
    array = np.array([0.0, 0.0, 0.001])
    for form in ((0, 0, 0.001), array, array.astype(np.float32).astype(float) * 0 + array, [np.float64(0), 0, 0.001], array[:, None].T[0]):
        assert np.array_equal(force(form), wanted)
    for wrong in (1.0, [0.0] * 4, [0.0, 0.0, np.nan], [0, 0, 10**400], [[0.0, 0.0, 0.0]], ["a"] * 3, [None] * 3, np.zeros(10**6)):
        with pytest.raises(hg.Error):
            force(wrong)
    with graph.player() as player, pytest.raises(hg.Error, match="there is no input `arm.weight`: there are arm.position"):
        player.process(1, {"arm.weight": 1.0})


def test_a_model_of_its_program_steers_the_filter(graphs):
    graph = hg.Graph.load(graphs.parent / "examples/network/network.ron", set={"warping": 0}, seed=1)
    with graph.player(probes=["filter", "steer.refused"]) as player:
        assert player.inputs["network.model"][0] == 33
        lsf = [np.pi * k / 11 for k in range(1, 11)]
        player.process(1000, {"network.model": [4.0, *lsf]})
        played = player.process(5000)
        assert np.std(played["filter"]) == pytest.approx(2, rel=0.1)
        player.process(100, {"network.model": np.array([-1.0])})
        assert player.process(500)["steer.refused"][-1] == 1
        with pytest.raises(hg.Error, match="32 coefficients"):
            player.process(1, {"network.model": np.ones(40)})
    models = np.tile([4.0, *lsf], (500, 1))
    steered = graph.run(1, inputs={"network.model": models}, probes=["filter", "steer.refused"])
    assert np.std(steered["filter"]) == pytest.approx(2, rel=0.1)
    with pytest.raises(hg.Error, match="not 40"):
        graph.run(1, inputs={"network.model": np.ones((500, 40))})
