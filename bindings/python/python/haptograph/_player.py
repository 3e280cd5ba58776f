"""Runs of a graph in blocks, from the caller's loop."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ._arrays import array, by_name, finite, number, string, whole
from ._arrays import frames as several
from ._errors import Error
from ._run import Outcome

if TYPE_CHECKING:
    from . import _native


# Numbers of a frame that are looked at one by one, numbers of the largest frame, and frames of which all are counted.
_FEW, _MOST_NUMBERS, _MOST_FRAMES = 16, 1000, 2**25


def _frame(name: str, frame: Any) -> list[float]:
    """The numbers of one frame; of a few plain numbers without an array, which takes longer than running the graph."""
    few: list[Any] = [None]
    if isinstance(frame, float) or type(frame) is int:
        few = [frame]
    elif type(frame) in (list, tuple) and len(frame) <= _FEW:
        few = list(frame)
    elif type(frame) is np.ndarray and frame.ndim == 1 and frame.size <= _FEW and frame.dtype == np.float64:
        few = frame.tolist()
    for one in few:
        if not (isinstance(one, float) and math.isfinite(one) or type(one) is int and -_EXACT < one < _EXACT):
            break
    else:
        return few
    made = np.atleast_1d(finite(name, array(name, frame)))
    if made.ndim != 1 or made.size > _MOST_NUMBERS:
        raise Error(f"`{name}` has shape {made.shape}: give one frame, or `push` several")
    return made.tolist()


# Whole numbers that are floats too.
_EXACT = 2**53


class Player:
    """A run of a graph from your own loop: see :meth:`Graph.player`. The run ends with the ``with`` block.

    >>> with graph.player() as player:                       # doctest: +SKIP
    ...     for position, force in hand:
    ...         current = player.process(480, {"stylus.position": position, "stylus.force": force,
    ...                                        "stylus.touching": 1})["haptuator.current"]
    """

    _inner: _native.Player

    def __init__(self) -> None:
        raise Error("a Player is made by `Graph.player`")

    @classmethod
    def _of(cls, native: _native.Player) -> Player:
        made = cls.__new__(cls)
        made._inner = native
        return made

    @property
    def rate(self) -> float:
        """Rate of the frames that :meth:`process` counts, Hz."""
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
        """Set the frame of an input, a number or a vector, from the next tick or from the time `at` (s) on."""
        self._inner.set(string("name", name), _frame(name, frame), None if at is None else number("at", at, 0))

    def push(self, name: str, frames: Any) -> int:
        """Queue frames for the next ticks of an input, shape (frames,) or (frames, components).

        Returns
        -------
        int
            Number of frames queued: the queue holds one second.
        """
        made, one = several(name, frames)
        if one:
            raise Error(f"`{name}` is one number: `set` it, or push an array")
        return self._inner.push(string("name", name), made)

    def process(self, frames: int, inputs: Mapping[str, Any] | None = None) -> dict[str, np.ndarray]:
        """Run a number of frames of the driver.

        Parameters
        ----------
        frames : int
            Number of frames, at :attr:`rate`.
        inputs : dict, optional
            Frames that are set first, as by :meth:`set`.

        Returns
        -------
        dict of ndarray
            The new frames of every output and probe, shape (frames,) or (frames, components).
        """
        if type(frames) is not int or not 0 <= frames < _MOST_FRAMES:
            frames = whole("frames", frames)
        if inputs is None:
            return self._inner.process(frames, [])
        named = inputs if type(inputs) is dict else by_name("inputs", inputs)
        given = [(string("a name", name), _frame(name, frame)) for name, frame in named.items()]
        return self._inner.process(frames, given)

    def turn(self, setting: str, value: float) -> None:
        """Set a live setting, ``"out.gain"``; its value ramps in 20 ms."""
        self._inner.turn(string("setting", setting), number("value", value))

    def stop(self) -> None:
        """Fade the outputs out in 10 ms, from the next :meth:`process` on."""
        self._inner.stop()

    def finish(self) -> Outcome | None:
        """End the run and complete its files. Returns None if the run has already been ended."""
        told = self._inner.finish()
        return None if told is None else Outcome(**told)

    def __enter__(self) -> Player:
        return self

    def __exit__(self, *_: object) -> None:
        self.finish()
