"""Graphs in loops of their users."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ._arrays import array, by_name, finite, number, string, whole
from ._arrays import frames as several
from ._errors import Error
from ._run import Outcome

if TYPE_CHECKING:
    from . import _native


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
        self._inner.set(string("name", name), made, None if at is None else number("at", at, 0))

    def push(self, name: str, frames: Any) -> int:
        """Frames for the next ticks of an input, shape (frames,) or (frames, components).

        Returns
        -------
        int
            How many found room: a second's worth waits at most.
        """
        made, one = several(name, frames)
        if one:
            raise Error(f"`{name}` is one number: `set` it, or push an array")
        return self._inner.push(string("name", name), made)

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
        for name, frame in by_name("inputs", inputs).items():
            self.set(name, frame)
        return self._inner.process(whole("frames", frames))

    def turn(self, setting: str, value: float) -> None:
        """Set a live setting, ``"out.gain"``; it glides there in 20 ms."""
        self._inner.turn(string("setting", setting), number("value", value))

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
