"""Kinds of nodes that are written in Python, for offline prototypes."""

from __future__ import annotations

import ctypes
import inspect
import re
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from . import _native
from ._arrays import array, number
from ._errors import Error


@dataclass(frozen=True)
class Port:
    """An input or output of a :class:`Node`.

    Attributes
    ----------
    quantity : str
        Name of the quantity: ``"force"``, ``"speed"``, ``"acceleration"``, ... A connection with another quantity is
        refused.
    kind : str
        Shape of a frame: ``"scalar"``, ``"3-vector"``, ``"wrench"``, or another kind from the list of ``haptograph
        nodes``.
    optional : bool
        For an input: whether it may stay unconnected. Its value is then None.
    doc : str
        Description in one sentence.
    """

    quantity: str = "number"
    kind: str = "scalar"
    optional: bool = False
    doc: str = ""


@dataclass(frozen=True)
class Setting:
    """A setting of a :class:`Node`.

    Attributes
    ----------
    default : object
        Default value, which also decides the type: a number, a whole number from 0, a bool, a string or a list of
        numbers. For a setting that a graph must give: one of the types ``float``, ``int``, ``bool`` and ``str``.
    low, high : float, optional
        Smallest and largest value of a number; give both or neither.
    doc : str
        Description in one sentence, with the unit.
    """

    default: Any
    low: float | None = None
    high: float | None = None
    doc: str = ""


class Node:
    """Base class of a kind of node in Python. Pass your class to :meth:`Graph.load` by ``nodes=[...]``.

    A graph file uses it by the name of the class, and its ports and settings are checked like those of every kind. It is
    slow: :meth:`Graph.run` accepts it, players and live runs refuse it. The class has one of two methods:

    - ``tick(self, time, **inputs)`` computes one frame. Inputs are numbers, or arrays of the components.
    - ``process(self, times, **inputs)`` computes many frames in NumPy. Inputs are arrays, of shape (frames,) or
      (frames, components). The number of frames of a call varies, down to one if the node is part of a loop, and the
      result must not depend on it: keep the state in ``self``.

    Times are in s. Return the output, a tuple in the order of `outputs`, or a dictionary by name.

    >>> class Smoothed(hg.Node):                             # doctest: +SKIP
    ...     '''A first-order low-pass of a force.'''
    ...     inputs = {"input": "force"}
    ...     outputs = {"output": "force"}
    ...     settings = {"cutoff_hz": hg.Setting(20.0, low=0.1, high=400.0)}
    ...
    ...     def start(self, cutoff_hz):
    ...         self.part = 1 - np.exp(-2 * np.pi * cutoff_hz / self.rate)
    ...         self.force = 0.0
    ...
    ...     def tick(self, time, input):
    ...         self.force += self.part * (input - self.force)
    ...         return self.force

    Attributes
    ----------
    inputs, outputs : dict
        Class attributes: a :class:`Port`, or the name of a quantity, by name of the port.
    settings : dict
        Class attribute: a :class:`Setting`, or its default, by name of the setting.
    path : str
        Path of the node in the graph.
    rate : float
        Frames per second.
    seed : int
        Seed for ``numpy.random.default_rng``, from the graph's seed and the node's path.
    """

    inputs: ClassVar[Mapping[str, Port | str]] = {}
    outputs: ClassVar[Mapping[str, Port | str]] = {}
    settings: ClassVar[Mapping[str, Any]] = {}
    path: str
    rate: float
    seed: int

    def start(self, **settings: Any) -> None:
        """Called before the first frame of a run, and when a graph is checked; by default it stores settings."""
        vars(self).update(settings)


_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_TAKEN = {"clock", "endpoint", "only", "self", "time", "times"}
# What a node has already: a setting of that name would take its place.
_OWN = {"rate", "seed", "path", "tick", "process", "start", "inputs", "outputs", "settings"}
_TYPES: dict[type, Any] = {float: 0.0, int: 0, bool: False, str: ""}


def natives(nodes: Sequence[type[Node]]) -> list[_native.NodeClass]:
    """The classes as kinds of nodes; each is described once and stays as it was then."""
    if isinstance(nodes, (str, type)) or not isinstance(nodes, Sequence):
        raise Error("`nodes` is not a list: give a list of classes, nodes=[MyNode]")
    return [_native_class(node) for node in nodes]


def _native_class(node: type[Node]) -> _native.NodeClass:
    if not (isinstance(node, type) and issubclass(node, Node) and node is not Node):
        raise Error(f"{node!r} is not a kind of node: give a class that is derived from hg.Node")
    if node not in _KNOWN:
        _KNOWN[node] = _described(node)
    return _KNOWN[node]


# Beside the classes, which can be passed to other processes then.
_KNOWN: dict[type[Node], _native.NodeClass] = {}


def _described(node: type[Node]) -> _native.NodeClass:
    name = node.__name__
    if sum(callable(getattr(node, way, None)) for way in ("tick", "process")) != 1:
        raise Error(f"`{name}` must have a method `tick`, for one frame, or `process`, for many frames, and not both")
    inputs, outputs = _ports(name, "inputs", node.inputs), _ports(name, "outputs", node.outputs)
    settings = [_setting(name, *one) for one in _items(name, "settings", node.settings)]
    taken = next((one[0] for one in settings if one[0] in _OWN), None)
    if taken:
        raise Error(f"`{name}.settings` has the name {taken!r}, which every node has already: choose another name")
    fields = [one[0] for one in inputs + settings]
    twice = sorted({field for field in fields if fields.count(field) > 1})
    if twice:
        raise Error(f"`{name}`: `{twice[0]}` is both an input and a setting: rename one of them")
    return _native.NodeClass(node, name, inspect.cleandoc(node.__doc__ or ""), inputs, outputs, settings)


def _items(kind: str, what: str, given: Any) -> list[tuple[str, Any]]:
    if not isinstance(given, Mapping):
        raise Error(f"`{kind}.{what}` is a {type(given).__name__}: give a dictionary by name")
    for name in given:
        if not isinstance(name, str) or not _NAME.fullmatch(name) or name in _TAKEN:
            raise Error(f"`{kind}.{what}` has the name {name!r}: choose another name, of letters, digits and _")
    return list(given.items())


def _ports(kind: str, what: str, given: Any) -> list[tuple[str, str, str, bool, str]]:
    made = []
    for name, port in _items(kind, what, given):
        port = Port(port) if isinstance(port, str) else port
        if not isinstance(port, Port):
            raise Error(f"`{kind}.{what}[{name!r}]` is {port!r}: give an hg.Port, or the name of a quantity")
        made.append((name, str(port.quantity), str(port.kind), bool(port.optional), str(port.doc)))
    return made


def _setting(kind: str, name: str, given: Any) -> tuple[str, Any, bool, tuple[float, float] | None, str]:
    setting = given if isinstance(given, Setting) else Setting(given)
    what, default = f"{kind}.settings[{name!r}]", setting.default
    required = isinstance(default, type) and default in _TYPES
    if required:
        default = _TYPES[default]
    elif isinstance(default, (list, tuple, np.ndarray)):
        default = [number(what, one) for one in default]
    elif isinstance(default, int) and not isinstance(default, bool):
        if not 0 <= default < 2**64:
            raise Error(f"`{what}` is {default}: a whole number must not be negative; write {default}.0 for a float")
    elif not isinstance(default, (bool, str)):
        default = number(what, default)
    bounds = (setting.low, setting.high)
    if bounds == (None, None):
        return name, default, required, None, str(setting.doc)
    if None in bounds or isinstance(default, (bool, str, list)):
        raise Error(f"`{what}`: `low` and `high` apply to numbers: give both or neither")
    low, high = number(f"{what}.low", setting.low), number(f"{what}.high", setting.high)
    if not (required or low <= default <= high):
        raise Error(f"`{what}` is {default}, outside of {low} to {high}")
    return name, default, required, (low, high), str(setting.doc)


def make(node: type[Node], path: str, rate: float, seed: int, settings: dict[str, Any]) -> Node:
    """A node that has not run."""
    made = node()
    made.path, made.rate, made.seed = path, rate, seed
    made.start(**settings)
    return made


def block(node: Any, widths: list[int], times: np.ndarray, inputs: dict[str, Any]) -> list[np.ndarray]:
    """The next frames of every output, each in one line."""
    outputs = list(node.outputs)
    if hasattr(node, "tick"):
        found: Mapping[str, Any] = _ticks(node, outputs, times, inputs)
    else:
        found = _named(outputs, node.process(times, **inputs))
    return [_line(name, found[name], len(times), width) for name, width in zip(outputs, widths, strict=True)]


def _ticks(node: Any, outputs: list[str], times: np.ndarray, inputs: dict[str, Any]) -> dict[str, list[Any]]:
    rows: dict[str, list[Any]] = {name: [] for name in outputs}
    # Numbers of Python are several times as fast as those of NumPy.
    given = {
        name: values.tolist() if values is not None and values.ndim == 1 else values for name, values in inputs.items()
    }
    for frame, time in enumerate(times.tolist()):
        one = {name: None if values is None else values[frame] for name, values in given.items()}
        for name, value in _named(outputs, node.tick(time, **one)).items():
            rows[name].append(value)
    return rows


def _named(outputs: list[str], returned: Any) -> Mapping[str, Any]:
    if isinstance(returned, Mapping):
        found = returned
    elif len(outputs) == 1:
        found = {outputs[0]: returned}
    else:
        found = (
            dict(zip(outputs, returned, strict=True))
            if isinstance(returned, tuple) and len(returned) == len(outputs)
            else {}
        )
    if set(found) != set(outputs) or any(value is None for value in found.values()):
        names = ", ".join(outputs)
        raise Error(f"the node returned {type(returned).__name__}, not the outputs {names}: return one value for each")
    return found


def _line(name: str, values: Any, frames: int, width: int) -> np.ndarray:
    made = array(name, values)
    shape = (frames,) if width == 1 else (frames, width)
    if made.shape != shape:
        raise Error(f"`{name}` has shape {made.shape} in {frames} frames: return {shape}")
    return made.reshape(-1)


def told(error: BaseException) -> tuple[str, str]:
    """What was raised, in a line, and where, without this file."""
    found = traceback.TracebackException.from_exception(error)
    found.stack = traceback.StackSummary.from_list([frame for frame in found.stack if frame.filename != __file__])
    return "".join(found.format_exception_only()).strip(), "".join(found.format()).rstrip()


def interrupt(thread: int) -> None:
    """Raises KeyboardInterrupt in a thread that is in a node, at its next step in Python."""
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(KeyboardInterrupt))
