"""Graphs, and whole runs of them."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from . import _native
from ._arrays import by_name, frames, items, number, one_seed, path_name, string
from ._content import Content
from ._errors import Diagnostic, Error
from ._node import Node, natives
from ._player import Player
from ._run import Outcome, Run, Signal


def _ron(value: Any) -> str:
    """A value of a parameter as a graph file writes it."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (str, int)):
        return string("a parameter", value)
    if isinstance(value, float):
        return repr(number("a parameter", value))
    if isinstance(value, os.PathLike):
        return path_name("a parameter", value)
    if isinstance(value, np.ndarray):
        return _ron(value.tolist())
    if isinstance(value, (list, tuple)):
        quoted = (
            '"' + one.replace("\\", "\\\\").replace('"', '\\"') + '"' if isinstance(one, str) else _ron(one)
            for one in value
        )
        return "[" + ", ".join(quoted) + "]"
    raise Error(f"a parameter cannot be a {type(value).__name__}: give a number, a string, or RON as a string")


# What gives a seed; None is that of the file.
Seed: TypeAlias = "int | np.random.Generator | np.random.SeedSequence | None"


def _checking(set: Mapping[str, Any] | None, seed: Seed, endpoints: str | None) -> dict[str, Any]:
    try:
        given = [(name, _ron(value)) for name, value in by_name("set", set).items()]
    except RecursionError:
        raise Error("`set` has a list that contains itself: give a list of numbers or strings") from None
    return {
        "set": given,
        "seed": None if seed is None else one_seed("seed", seed),
        "endpoints": None if endpoints is None else string("endpoints", endpoints),
    }


def _names(name: str, given: Sequence[str] | None) -> list[str] | None:
    return None if given is None else [string(name, one) for one in items(name, given)]


def _source(node: type[Node]) -> tuple[str, str, str]:
    """A class by its name, and by its text where there is one, so that a changed one is another."""
    try:
        text = inspect.getsource(node)
    except (OSError, TypeError):
        text = ""
    return node.__module__, node.__qualname__, text


class Graph(Content):
    """A dataflow graph: see :meth:`load` and :meth:`parse`.

    A graph never changes. Two are equal if their text, folder, parameters, seed, endpoints and own nodes are. Passed to
    another process, it is its text: files that it names are read again there, from the same folder.
    """

    _inner: _native.Graph
    _given: tuple[str, dict[str, Any], tuple[type[Node], ...]]

    def __init__(self) -> None:
        raise Error("a Graph is made by `Graph.load` or `Graph.parse`")

    @classmethod
    def _of(cls, native: _native.Graph, path: str, checking: dict[str, Any], nodes: Sequence[type[Node]]) -> Graph:
        made = cls.__new__(cls)
        # Another process may have another working directory.
        made._inner, made._given = native, (os.path.abspath(path), checking, tuple(nodes))
        return made

    @classmethod
    def _parse(cls, text: str, path: str, checking: dict[str, Any], nodes: Sequence[type[Node]]) -> Graph:
        return cls._of(_native.Graph.parse(text, path, checking, natives(nodes)), path, checking, nodes)

    def __reduce__(self) -> Any:
        return Graph._parse, (self._inner.text, *self._given)

    def _content(self) -> tuple[Any, ...]:
        path, checking, nodes = self._given
        return (self._inner.text, path, sorted(checking.items()), [_source(node) for node in nodes])

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        set: Mapping[str, Any] | None = None,
        seed: Seed = None,
        endpoints: str | None = None,
        nodes: Sequence[type[Node]] = (),
    ) -> Graph:
        """Read and check a graph file.

        Parameters
        ----------
        path : path
            The graph file. Paths in it are relative to its folder.
        set : dict, optional
            Parameters in place of the file's: numbers, strings, lists, or RON as a string.
        seed : int, numpy.random.Generator or numpy.random.SeedSequence, optional
            Seed of all random streams, in place of the file's: the number, or one drawn from the generator.
        endpoints : str, optional
            The set of endpoints that supplies the devices; ``"simulated"`` by default.
        nodes : list of classes, optional
            Your own kinds of nodes, classes derived from :class:`Node`. The graph uses them by their class names.

        Raises
        ------
        GraphError
            If the graph has errors; its text is that of the terminal.
        """
        path, checking = path_name("path", path), _checking(set, seed, endpoints)
        return cls._of(_native.Graph.load(path, checking, natives(nodes)), path, checking, nodes)

    @classmethod
    def parse(
        cls,
        text: str,
        path: str | os.PathLike[str] = "graph.ron",
        set: Mapping[str, Any] | None = None,
        seed: Seed = None,
        endpoints: str | None = None,
        nodes: Sequence[type[Node]] = (),
    ) -> Graph:
        """Read and check a graph from its text.

        Messages name it `path`, and paths in it are relative to the folder of `path`.
        """
        return cls._parse(string("text", text), path_name("path", path), _checking(set, seed, endpoints), nodes)

    @property
    def about(self) -> str:
        """The description in the graph file."""
        return self._inner.about

    @property
    def seed(self) -> int:
        """Seed of the random streams."""
        return self._inner.seed

    @property
    def parameters(self) -> dict[str, str]:
        """Parameters and their defaults, as in the file."""
        return dict(self._inner.parameters())

    @property
    def clocks(self) -> dict[str, float]:
        """Rates of the clocks, Hz."""
        return dict(self._inner.clocks())

    @property
    def outputs(self) -> list[str]:
        """Outputs that can be probed."""
        return [name for name, *_ in self._inner.outputs()]

    @property
    def inputs(self) -> dict[str, tuple[int, str]]:
        """Channels that you can feed, with the number of components and the unit of each."""
        return {name: (components, unit) for name, components, unit in self._inner.channels()[0]}

    @property
    def settings(self) -> dict[str, float]:
        """Settings that a player can change during the run, and their values."""
        return {name: value for name, value, *_ in self._inner.settings()}

    @property
    def warnings(self) -> list[Diagnostic]:
        """Warnings of the check."""
        return [Diagnostic(**one) for one in self._inner.warnings()[1]]

    def run(
        self,
        seconds: float | None = None,
        set: Mapping[str, Any] | None = None,
        seed: Seed = None,
        inputs: Mapping[str, Any] | None = None,
        probes: Sequence[str] | None = None,
        folder: str | os.PathLike[str] | None = None,
        progress: Callable[[float], object] | None = None,
    ) -> Run:
        """Run the graph as fast as the processor allows.

        Parameters
        ----------
        seconds : float, optional
            Duration of the run, s. By default the run lasts as long as `inputs`, or 10 s.
        set, seed
            As for :meth:`load`; these values override those given there.
        inputs : dict, optional
            Arrays for channels of endpoints, ``{"stylus.force": newtons}``: one frame for each tick of the channel,
            shape (frames,) or (frames, components), or one number for the whole run. All channels of an endpoint must
            be fed, or none; the other endpoints stay as in the file.
        probes : list of str, optional
            Outputs to keep, ``"texture.output"``. By default those that the page of a run shows.
        folder : path, optional
            Folder for the graph's file sinks. It is created; existing files are not replaced. None: they write nothing.
        progress : callable, optional
            Called from time to time with the fraction done, 0 to 1.

        Returns
        -------
        Run
            The signals and the outcome. The same graph with the same seed gives the same bits as the command.

        Raises
        ------
        GraphError
            If your :class:`Node` raises an exception: code ``"E0801"``, with the exception as the cause. Files are
            complete up to that frame.
        """
        fed = [(name, *frames(name, values)) for name, values in by_name("inputs", inputs).items()]
        request = {
            "seconds": None if seconds is None else number("seconds", seconds, 0, above=True),
            "inputs": fed,
            "probes": _names("probes", probes),
            "folder": None if folder is None else path_name("folder", folder),
        }
        checking = _checking(set, seed, None)
        signals, outcome = self._inner.run(checking, request, progress)
        used = self.seed if checking["seed"] is None else checking["seed"]
        return Run([Signal(**signal) for signal in signals], Outcome(**outcome), used)

    def player(
        self,
        set: Mapping[str, Any] | None = None,
        seed: Seed = None,
        hosted: Sequence[str] | None = None,
        probes: Sequence[str] = (),
        folder: str | os.PathLike[str] | None = None,
        rested: bool = True,
    ) -> Player:
        """Run the graph in blocks, from your own loop. A graph with a :class:`Node` in Python is refused.

        Parameters
        ----------
        set, seed
            As for :meth:`load`; these values override those given there.
        hosted : list of str, optional
            The endpoints whose inputs you feed and whose outputs you read; all by default.
        probes : list of str
            Outputs whose frames :meth:`Player.process` returns as well.
        folder : path, optional
            Folder for the graph's file sinks; it must exist.
        rested : bool
            Whether the actuators are known to be cold. Give False for real actuators that may be warm.
        """
        folder = None if folder is None else path_name("folder", folder)
        given = _names("hosted", hosted)
        native = self._inner.player(
            _checking(set, seed, None), given, _names("probes", probes) or [], folder, bool(rested)
        )
        return Player._of(native)

    def __repr__(self) -> str:
        return f"<Graph {self._inner.name!r}: {len(self._inner.outputs())} outputs>"

    def _repr_svg_(self) -> str:
        return self._inner.svg()
