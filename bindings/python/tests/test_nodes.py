"""Nodes written in Python: registered for a graph, run offline, kept from all else."""

import _thread
import threading
import time

import numpy as np
import pytest

import haptograph as hg

HEAD = 'format: 1, clocks: { "servo": Driver(rate_hz: 1000) }'
HAND = '"hand": Sine(clock: "servo", frequency_hz: 3, amplitude: 0.01, quantity: "length"),'


class Detents(hg.Node):
    """Pulls to the nearest rest position."""

    inputs = {"position": hg.Port("length", doc="Where the tool is.")}
    outputs = {"force": "force"}
    settings = {"pitch_mm": hg.Setting(2.0, low=0.01, high=1000, doc="From rest to rest, mm."), "strength_n": 0.5}

    def process(self, times, position):
        return -self.strength_n * np.sin(2 * np.pi / (self.pitch_mm * 1e-3) * position)


class Bristle(hg.Node):
    """Dry friction: a spring to a foot that slips."""

    inputs = {"position": "length"}
    outputs = {"force": "force", "foot": "length"}
    settings = {"stiffness_n_per_m": 500.0, "slips_at_n": float}

    def start(self, stiffness_n_per_m, slips_at_n):
        self.stiffness, self.reach, self.foot = stiffness_n_per_m, slips_at_n / stiffness_n_per_m, 0.0

    def tick(self, time, position):
        self.foot = min(max(self.foot, position - self.reach), position + self.reach)
        return -self.stiffness * (position - self.foot), self.foot


class Smoothed(hg.Node):
    """The same by either way of writing it."""

    inputs = {"input": "force"}
    outputs = {"output": "force"}

    def start(self):
        self.state = 0.0

    def process(self, times, input):
        out = np.empty_like(input)
        for frame, value in enumerate(input):
            self.state += 0.1 * (value - self.state)
            out[frame] = self.state
        return {"output": out}


def graph(nodes, kinds, **arguments):
    return hg.Graph.parse(f"Graph({HEAD}, nodes: {{ {nodes} }})", nodes=kinds, **arguments)


def faulty(action):
    """A kind whose `tick` does this at 0.1 s."""

    class Faulty(hg.Node):
        outputs = {"output": "number"}

        def tick(self, time):
            if time >= 0.1:
                action()
            return 1.0

    return Faulty


def test_a_node_computes_what_its_class_says_and_is_marked_as_slow():
    made = graph(HAND + '"detents": Detents(position: "hand", pitch_mm: 5)', [Detents])
    run = made.run(1, probes=["hand", "detents"])
    position = run["hand"].values
    wanted = -0.5 * np.sin(2 * np.pi / (5 * 1e-3) * position)
    assert np.allclose(run["detents"].values, wanted, rtol=1e-12, atol=1e-12)
    assert (run["detents"].unit, run["detents"].kind) == ("N", "scalar")
    assert run.outcome.python_nodes == {"detents": "Detents"} and "in Python: detents" in repr(run)
    assert [one.code for one in made.warnings if "slow" in one.message] == ["W0107"]
    assert made.run(1, probes=["hand"]).outcome.python_nodes == {"detents": "Detents"}


def test_state_outputs_and_settings_go_by_name_and_every_run_begins_anew():
    made = graph(HAND + '"drag": Bristle(position: "hand", slips_at_n: 0.6)', [Bristle])
    first, again = (made.run(0.5, probes=["hand", "drag.force", "drag.foot"]) for _ in range(2))
    foot, wanted = 0.0, []
    for position in first["hand"].values:
        foot = min(max(foot, position - 0.6 / 500), position + 0.6 / 500)
        wanted.append(foot)
    assert np.array_equal(first["drag.foot"].values, wanted) and np.abs(first["drag.force"].values).max() > 0.59
    for name in first:
        assert np.array_equal(first[name].values, again[name].values)


def test_vectors_optional_inputs_rates_and_seeds():
    seen = {}

    class Noisy(hg.Node):
        inputs = {"along": hg.Port("length", kind="3-vector"), "level": hg.Port("force", optional=True)}
        outputs = {"force": hg.Port("force", "3-vector")}
        settings = {"weights": [1.0, 2.0, 3.0], "name": "a", "count": 2, "is_on": True}

        def start(self, **settings):
            super().start(**settings)
            self.random = np.random.default_rng(self.seed)
            seen[self.path] = (self.rate, self.seed, self.weights, self.name, self.count, self.is_on)

        def process(self, times, along, level):
            assert along.shape == (len(times), 3) and level is None
            return along * self.weights + self.random.standard_normal((len(times), 1))

    text = '"x": Steps(clock: "servo"), "n": Noisy(along: "x", weights: [1, 0, 2], count: 7, is_on: false)'
    made = graph(text, [Noisy, Steps])
    one, other = (made.run(0.3, seed=seed, probes=["n"])["n"].values for seed in (1, 2))
    assert one.shape == (300, 3) and not np.array_equal(one, other)
    assert np.array_equal(one, made.run(0.3, seed=1, probes=["n"])["n"].values)
    assert seen["n"][0] == 1000 and seen["n"][2:] == ([1, 0, 2], "a", 7, False)


class Steps(hg.Node):
    """Frames that say which they are."""

    outputs = {"output": hg.Port("length", "3-vector")}

    def tick(self, time):
        return time, 2 * time, round(time * 1000)


def test_the_samples_do_not_depend_on_blocks(pad, graphs):
    # Blocks of a run of arrays are others than those of a run alone; in a loop there are single frames.
    text = (graphs / "texturepad.ron").read_text()
    used = text.replace("nodes: {", 'nodes: { "smooth": Smoothed(input: "stylus.force"),', 1)
    assert used != text
    made = hg.Graph.parse(used, path=graphs / "texturepad.ron", nodes=[Smoothed])
    names = ["stylus.position", "stylus.force", "stylus.touching"]
    alone = made.run(2, probes=[*names, "smooth"])
    fed = made.run(2, inputs={name: alone[name].values for name in names}, probes=["smooth"])
    assert alone["smooth"].values.any() and np.array_equal(alone["smooth"].values, fed["smooth"].values)
    assert fed.outcome.python_nodes == {"smooth": "Smoothed"}
    loop = (
        '"error": Subtract(input: "push", less: Delay(from: "smooth", frames: 1)), "smooth": Smoothed(input: "error")'
    )
    source = '"push": Constant(clock: "servo", value: 1, quantity: "force"),'
    values = graph(source + loop, [Smoothed]).run(0.2, probes=["smooth"])["smooth"].values
    wanted, state = [], 0.0
    for _ in range(200):
        state += 0.1 * ((1.0 - (wanted[-1] if wanted else 0.0)) - state)
        wanted.append(state)
    assert np.array_equal(values, wanted)


def test_an_exception_is_a_finding_with_its_place_and_traceback(tmp_path):
    def divide():
        return 1 / 0

    sink = '"file": CsvSink(inputs: ["n"], file: "n.csv"),'
    made = graph('"n": Faulty(clock: "servo"),' + sink, [faulty(divide)])
    with pytest.raises(hg.GraphError) as raised:
        made.run(100, folder=tmp_path)
    error = raised.value
    assert error.code == "E0801" and "ZeroDivisionError: division by zero" in str(error) and "`n`" in str(error)
    assert error.diagnostics[0].line == 1 and error.span is not None
    assert "in divide" in error.help[0] and "_node.py" not in error.help[0]
    assert isinstance(error.__cause__, ZeroDivisionError) and error.__cause__.__traceback__ is not None
    rows = (tmp_path / "n.csv").read_text().splitlines()
    assert 100 < len(rows) < 10_000 and rows[-1].count(",") == rows[-2].count(",")
    # A node that failed once is made anew in the next run.
    assert made.run(0.05, probes=["n"])["n"].values.all()


def test_an_exception_of_start_is_a_finding_when_the_graph_is_checked():
    class Strict(hg.Node):
        outputs = {"output": "number"}
        settings = {"level": 1.0}

        def start(self, level):
            if level < 0:
                raise ValueError("the level is below 0")
            self.level = level

        def tick(self, time):
            return self.level

    with pytest.raises(hg.GraphError, match="the level is below 0") as raised:
        graph('"n": Strict(clock: "servo", level: -1)', [Strict])
    assert raised.value.code == "E0304" and "in start" in raised.value.help[0]
    assert isinstance(raised.value.__cause__, ValueError)
    with pytest.raises(hg.GraphError) as raised:
        graph('"n": Strict(clock: "servo", level: "high")', [Strict])
    assert raised.value.code == "E0301"


def test_players_refuse_it():
    made = graph('"n": Faulty(clock: "servo")', [faulty(int)])
    with pytest.raises(hg.Error, match="offline"):
        made.player()


def spin():
    while True:
        pass


@pytest.mark.parametrize("action", [lambda: time.sleep(0.01), spin])
def test_ctrl_c_ends_a_node_also_in_the_middle_of_a_frame(action):
    made = graph('"n": Faulty(clock: "servo")', [faulty(action)])
    threading.Timer(0.5, _thread.interrupt_main).start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        made.run(1e4, probes=["n"])
    assert time.monotonic() - began < 30


def test_what_ends_a_program_is_not_taken_for_a_fault():
    def leave():
        raise SystemExit(3)

    with pytest.raises(SystemExit):
        graph('"n": Faulty(clock: "servo")', [faulty(leave)]).run(1, probes=["n"])


@pytest.mark.parametrize(
    ("returned", "said"),
    [
        (None, "return one value"),
        ("loud", "real"),
        (1j, "real"),
        ([1.0, 2.0], "shape"),
        ({"outpt": 1.0}, "output"),
        ([[1.0], [1.0, 2.0]], "numbers"),
    ],
)
def test_what_is_no_frame_is_an_error(returned, said):
    class Wrong(hg.Node):
        outputs = {"output": "number"}

        def tick(self, time):
            return returned

    with pytest.raises(hg.GraphError, match=said) as raised:
        graph('"n": Wrong(clock: "servo")', [Wrong]).run(0.1, probes=["n"])
    assert raised.value.code == "E0801"


def test_nan_of_a_node_is_counted_where_it_reaches_an_actuator(graphs):
    class Broken(hg.Node):
        inputs = {"input": "current"}
        outputs = {"output": "current"}

        def process(self, times, input):
            return np.full_like(input, np.nan)

    text = (graphs / "texturepad.ron").read_text()
    used = text.replace('Resample("drive")', 'Resample("broken")')
    used = used.replace("nodes: {", 'nodes: { "broken": Broken(input: "drive"),', 1)
    run = hg.Graph.parse(used, path=graphs / "texturepad.ron", nodes=[Broken]).run(0.1, probes=["out.delivered"])
    assert run.outcome.not_finite_ticks > 0 and run.outcome.not_finite_node == "broken"
    assert not run["out.delivered"].values.any()


def kind(**members):
    return type("Kind", (hg.Node,), {"outputs": {"o": "number"}, "tick": lambda self, time: 0.0, **members})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (Detents, "list"),
        ("Detents", "list"),
        ([Detents()], "class"),
        ([hg.Node], "class"),
        ([int], "class"),
        ([kind(tick=None)], "method"),
        ([kind(process=lambda self, times: times)], "not both"),
        ([kind(outputs={"o": "weight"})], "quantity"),
        ([kind(outputs={"o": hg.Port("force", "matrix")})], "kind"),
        ([kind(outputs={"o": 1})], "Port"),
        ([kind(outputs=["o"])], "dictionary"),
        ([kind(outputs={"o p": "force"})], "name"),
        ([kind(inputs={"time": "time"})], "name"),
        ([kind(inputs={"x": "force"}, settings={"x": 1.0})], "input and a setting"),
        ([kind(settings={"clock": 1.0})], "name"),
        ([kind(settings={"x": np.nan})], "finite"),
        ([kind(settings={"x": -1})], "negative"),
        ([kind(settings={"x": object()})], "numbers"),
        ([kind(settings={"x": hg.Setting(5.0, low=0, high=1)})], "5.0"),
        ([kind(settings={"x": hg.Setting(5.0, low=0)})], "both"),
        ([kind(settings={"x": hg.Setting("a", low=0, high=1)})], "number"),
    ],
)
def test_what_is_no_kind_of_node_is_an_error(given, said):
    with pytest.raises(hg.Error, match=said):
        graph(HAND, given)


def test_names_of_kinds_are_taken_once():
    shipped = type("Sine", (hg.Node,), {"outputs": {"o": "number"}, "tick": lambda self, time: 0.0})
    with pytest.raises(hg.GraphError) as raised:
        graph(HAND, [shipped])
    assert raised.value.code == "E0212"


def test_threads_that_race_for_a_graph_have_runs_of_their_own():
    made = graph(HAND + '"drag": Bristle(position: "hand", slips_at_n: 0.6)', [Bristle])
    wanted, found = made.run(0.5, probes=["drag.foot"])["drag.foot"].values, [None] * 4

    def run(number):
        found[number] = made.run(0.5, probes=["drag.foot"])["drag.foot"].values

    threads = [threading.Thread(target=run, args=(number,)) for number in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert all(np.array_equal(one, wanted) for one in found)
