"""Graphs, whole runs of them, and runs in blocks."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native, _show
from ._arrays import array, finite, number, whole
from ._errors import Diagnostic, Error

if TYPE_CHECKING:
    import pandas


def _ron(value: Any) -> str:
    """A value of a parameter as a graph file writes it."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (str, int)):
        return str(value)
    if isinstance(value, float):
        return repr(number("a parameter", value))
    if isinstance(value, os.PathLike):
        return str(os.fspath(value))
    if isinstance(value, (list, tuple, np.ndarray)):
        quoted = (
            '"' + one.replace("\\", "\\\\").replace('"', '\\"') + '"' if isinstance(one, str) else _ron(one)
            for one in value
        )
        return "[" + ", ".join(quoted) + "]"
    raise Error(f"a parameter cannot be a {type(value).__name__}: give a number, a string, or RON as a string")


def _checking(set: Mapping[str, Any] | None, seed: int | None, endpoints: str | None) -> dict[str, Any]:
    if set is not None and not isinstance(set, Mapping):
        raise Error(f"`set` is a {type(set).__name__}: give a dictionary")
    return {
        "set": [(str(name), _ron(value)) for name, value in (set or {}).items()],
        "seed": None if seed is None else whole("seed", seed),
        "endpoints": None if endpoints is None else str(endpoints),
    }


def _names(name: str, given: Sequence[str] | None) -> list[str] | None:
    if given is None:
        return None
    if isinstance(given, str):
        raise Error(f"`{name}` is one string: give a list, [{given!r}]")
    return [str(one) for one in given]


def _frames(name: str, values: Any) -> tuple[np.ndarray, bool]:
    """Frames by components, and whether it is one frame for all time."""
    made = finite(name, array(name, values))
    if made.ndim == 0:
        return made.reshape(1, 1), True
    if made.ndim == 1:
        return made.reshape(-1, 1), False
    if made.ndim == 2 and made.shape[1] > 0:
        return made, False
    raise Error(
        f"`{name}` has shape {made.shape}: give (frames,) of numbers, (frames, components) of vectors, or one number"
    )


@dataclass(frozen=True)
class Signal:
    """What an output of a graph put out.

    Attributes
    ----------
    name : str
        ``node.output``.
    values : ndarray
        Shape (frames,) of scalars, (frames, components) of others.
    rate : float
        Frames a second.
    unit : str
        SI, ``"m/s2"``; ``"1"`` of plain numbers.
    quantity : str or None
        ``"acceleration"``, where the quantity has a name.
    kind : str
        Shape of a frame: scalar, 3-vector, wrench, contact, and others.
    components : list of str
        Names of the columns.
    simulated : bool
        Whether a simulated device had a part in it.
    """

    name: str
    values: np.ndarray
    rate: float
    unit: str
    quantity: str | None
    kind: str
    components: list[str]
    simulated: bool

    @property
    def times(self) -> np.ndarray:
        """Of its frames, s."""
        return np.arange(len(self.values)) / self.rate

    def __len__(self) -> int:
        return len(self.values)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        values = self.values if dtype is None else self.values.astype(dtype)
        return values.copy() if copy else values

    def to_pandas(self) -> pandas.Series | pandas.DataFrame:
        """A series, or a table by component, by time in s; ``attrs`` has unit and quantity."""
        import pandas

        index = pandas.Index(self.times, name="time (s)")
        made: pandas.Series | pandas.DataFrame
        if self.values.ndim == 1:
            made = pandas.Series(self.values, index=index, name=self.name)
        else:
            made = pandas.DataFrame(self.values, index=index, columns=self.components)
        made.attrs.update(name=self.name, unit=self.unit, quantity=self.quantity, simulated=self.simulated)
        return made

    def __repr__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"<Signal {self.name!r}: {len(self)} frames of {self.kind}{unit} at {self.rate:g} Hz>"

    def _repr_html_(self) -> str:
        frames = self.values.reshape(len(self), -1)
        figures = "".join(_native.figures(self.name, self.quantity, self.rate, frames, self.simulated))
        audible = self.quantity == "acceleration" and self.values.ndim == 1 and self.rate >= 1000
        return figures + (_show.audio(self.values, self.rate, f"{self.name}, as loud as it can be") if audible else "")


@dataclass(frozen=True)
class Outcome:
    """What a run did.

    Attributes
    ----------
    frames : int
        Of the graph's driver.
    seconds : float
        The same in s.
    not_finite_ticks : int
        Ticks at which an actuator was given NaN or infinity, and got zero.
    not_finite_node : str or None
        Where they came from first.
    limited : dict
        Of each actuator how many ticks there were, and how many were held back by each limit: peak, continuous, slew.
    panicked : bool
        Whether a node panicked, which is a fault of haptograph.
    """

    frames: int
    seconds: float
    not_finite_ticks: int
    not_finite_node: str | None
    limited: dict[str, dict[str, int]]
    panicked: bool = False


class Run(Mapping[str, Signal]):
    """The signals of a run by name, and its :attr:`outcome`."""

    def __init__(self, signals: list[Signal], outcome: Outcome):
        self._signals = {signal.name: signal for signal in signals}
        self.outcome = outcome

    def __getitem__(self, name: str) -> Signal:
        if name not in self._signals:
            raise KeyError(f"{name}: the run kept {', '.join(self._signals) or 'nothing'}; ask for others by `probes`")
        return self._signals[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._signals)

    def __len__(self) -> int:
        return len(self._signals)

    def __repr__(self) -> str:
        return f"<Run of {self.outcome.seconds:g} s: {', '.join(self._signals)}>"

    def _repr_html_(self) -> str:
        return "".join(signal._repr_html_() for signal in self.values())


class Graph:
    """A dataflow graph: see :meth:`load` and :meth:`parse`."""

    _inner: _native.Graph

    def __init__(self) -> None:
        raise Error("a Graph comes of `Graph.load` or `Graph.parse`")

    @classmethod
    def _of(cls, native: _native.Graph) -> Graph:
        made = cls.__new__(cls)
        made._inner = native
        return made

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        set: Mapping[str, Any] | None = None,
        seed: int | None = None,
        endpoints: str | None = None,
    ) -> Graph:
        """Read and check a graph file.

        Parameters
        ----------
        path : path
            The file; what it names is looked for beside it.
        set : dict, optional
            Parameters in place of the file's: numbers, strings, lists, or RON as a string.
        seed : int, optional
            Of all random streams, in place of the file's.
        endpoints : str, optional
            The set of endpoints that devices are taken from; ``"simulated"`` where it is not given.

        Raises
        ------
        GraphError
            With everything that is wrong, as the terminal shows it.
        """
        return cls._of(_native.Graph.load(os.fspath(path), _checking(set, seed, endpoints)))

    @classmethod
    def parse(
        cls,
        text: str,
        path: str | os.PathLike[str] = "graph.ron",
        set: Mapping[str, Any] | None = None,
        seed: int | None = None,
        endpoints: str | None = None,
    ) -> Graph:
        """The same from a text; `path` is of the file that it stands for, beside which it looks for others."""
        return cls._of(_native.Graph.parse(str(text), os.fspath(path), _checking(set, seed, endpoints)))

    @property
    def about(self) -> str:
        """What it is about."""
        return self._inner.about

    @property
    def seed(self) -> int:
        """Of its random streams."""
        return self._inner.seed

    @property
    def parameters(self) -> dict[str, str]:
        """Parameters and their defaults, as written."""
        return dict(self._inner.parameters())

    @property
    def clocks(self) -> dict[str, float]:
        """Rates of its clocks, Hz."""
        return dict(self._inner.clocks())

    @property
    def outputs(self) -> list[str]:
        """Everything that can be probed."""
        return [name for name, *_ in self._inner.outputs()]

    @property
    def inputs(self) -> dict[str, tuple[int, str]]:
        """Channels that can be fed: components and unit of each."""
        return {name: (components, unit) for name, components, unit in self._inner.channels()[0]}

    @property
    def settings(self) -> dict[str, float]:
        """Settings that a player can turn while it runs, and their values."""
        return {name: value for name, value, *_ in self._inner.settings()}

    @property
    def warnings(self) -> list[Diagnostic]:
        """What is probably not meant."""
        return [Diagnostic(**one) for one in self._inner.warnings()[1]]

    def run(
        self,
        seconds: float | None = None,
        set: Mapping[str, Any] | None = None,
        seed: int | None = None,
        inputs: Mapping[str, Any] | None = None,
        probes: Sequence[str] | None = None,
        folder: str | os.PathLike[str] | None = None,
        threads: int = 1,
        progress: Callable[[float], object] | None = None,
    ) -> Run:
        """Run it as fast as the processor allows.

        Parameters
        ----------
        seconds : float, optional
            How long, in its own time: as long as `inputs` last, or 10 s, where it is not given.
        set, seed
            As of :meth:`load`, on top of what was set there.
        inputs : dict, optional
            Arrays for channels of endpoints, ``{"stylus.force": newtons}``: one frame a tick of the channel, shape
            (frames,) or (frames, components), or one number for all time. Whoever feeds an endpoint feeds all of its
            channels; the other endpoints stay as they are in the file.
        probes : list of str, optional
            Outputs to keep, ``"texture.output"``; where it is not given, what the page of a run shows.
        folder : path, optional
            Where the graph's file sinks write. It is made; nothing in it is replaced. None: they write nothing.
        threads : int
            The samples do not depend on it; one where there are `inputs`.
        progress : callable, optional
            Called with the part done, 0 to 1, now and then.

        Returns
        -------
        Run
            The same graph with the same seed gives the same bits as the command.
        """
        if inputs is not None and not isinstance(inputs, Mapping):
            raise Error(f"`inputs` is a {type(inputs).__name__}: give a dictionary")
        fed = [(str(name), *_frames(str(name), values)) for name, values in (inputs or {}).items()]
        request = {
            "seconds": None if seconds is None else number("seconds", seconds, 0, above=True),
            "inputs": fed,
            "probes": _names("probes", probes),
            "folder": None if folder is None else os.fspath(folder),
            "threads": whole("threads", threads, 1, 256),
        }
        signals, outcome = self._inner.run(_checking(set, seed, None), request, progress)
        return Run([Signal(**signal) for signal in signals], Outcome(**outcome))

    def player(
        self,
        set: Mapping[str, Any] | None = None,
        seed: int | None = None,
        hosted: Sequence[str] | None = None,
        probes: Sequence[str] = (),
        folder: str | os.PathLike[str] | None = None,
        rested: bool = True,
    ) -> Player:
        """Run it in blocks, from your own loop.

        Parameters
        ----------
        set, seed
            As of :meth:`load`, on top of what was set there.
        hosted : list of str, optional
            The endpoints that you feed and hear; all of them where it is not given.
        probes : list of str
            Outputs whose frames :meth:`Player.process` gives as well.
        folder : path, optional
            Where the graph's file sinks write; it has to be there.
        rested : bool
            Whether actuators are known to be cold. Say False for real ones that may be warm.
        """
        folder = None if folder is None else os.fspath(folder)
        given = _names("hosted", hosted)
        native = self._inner.player(
            _checking(set, seed, None), given, _names("probes", probes) or [], folder, bool(rested)
        )
        return Player._of(native)

    def __repr__(self) -> str:
        return f"<Graph {self._inner.name!r}: {len(self._inner.outputs())} outputs>"

    def _repr_svg_(self) -> str:
        return self._inner.svg()


class Player:
    """A graph in your own loop: see :meth:`Graph.player`. Ends with the ``with`` block.

    >>> with graph.player() as player:                       # doctest: +SKIP
    ...     for position, force in hand:
    ...         current = player.process(480, {"stylus.position": position, "stylus.force": force,
    ...                                        "stylus.touching": 1})["haptuator.current"]
    """

    _inner: _native.Player

    def __init__(self) -> None:
        raise Error("a Player comes of `Graph.player`")

    @classmethod
    def _of(cls, native: _native.Player) -> Player:
        made = cls.__new__(cls)
        made._inner = native
        return made

    @property
    def rate(self) -> float:
        """Frames a second of :meth:`process`."""
        return self._inner.rate

    @property
    def inputs(self) -> dict[str, tuple[int, str, float]]:
        """Components, unit and rate (Hz) of every input."""
        return {name: (width, unit, rate) for name, width, unit, rate in self._inner.inputs()}

    @property
    def outputs(self) -> dict[str, tuple[int, str, float]]:
        """Components, unit and rate (Hz) of every output and probe."""
        return {name: (width, unit, rate) for name, width, unit, rate in self._inner.outputs()}

    @property
    def state(self) -> str:
        """running, stopped, finished or panicked."""
        return self._inner.state()[0]

    @property
    def frames(self) -> int:
        """Frames run so far."""
        return self._inner.state()[1]

    def set(self, name: str, frame: Any, at: float | None = None) -> None:
        """From the next tick on, or from `at` (s of the run) on, an input has this frame: a number or a vector."""
        made = np.atleast_1d(finite(name, array(name, frame)))
        if made.ndim != 1:
            raise Error(f"`{name}` has shape {made.shape}: give one frame, or `push` several")
        self._inner.set(str(name), made, None if at is None else number("at", at, 0))

    def push(self, name: str, frames: Any) -> int:
        """Frames for the next ticks of an input, shape (frames,) or (frames, components).

        Returns
        -------
        int
            How many found room: a second's worth waits at most.
        """
        made, one = _frames(name, frames)
        if one:
            raise Error(f"`{name}` is one number: `set` it, or push an array")
        return self._inner.push(str(name), made)

    def process(self, frames: int, inputs: Mapping[str, Any] | None = None) -> dict[str, np.ndarray]:
        """Run so many frames of the driver.

        Parameters
        ----------
        frames : int
            At :attr:`rate`.
        inputs : dict, optional
            Frames that are :meth:`set` before.

        Returns
        -------
        dict of ndarray
            The frames that every output and probe has put out since, shape (frames,) or (frames, components).
        """
        for name, frame in (inputs or {}).items():
            self.set(name, frame)
        return self._inner.process(whole("frames", frames))

    def turn(self, setting: str, value: float) -> None:
        """Set a live setting, ``"out.gain"``; it glides there in 20 ms."""
        self._inner.turn(str(setting), number("value", value))

    def stop(self) -> None:
        """Fade out in 10 ms, from the next :meth:`process` on."""
        self._inner.stop()

    def finish(self) -> Outcome | None:
        """End the run and complete its files; None where it was ended before."""
        told = self._inner.finish()
        return None if told is None else Outcome(**told)

    def __enter__(self) -> Player:
        return self

    def __exit__(self, *_: object) -> None:
        self.finish()
