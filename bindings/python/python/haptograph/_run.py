"""The result of a run: signals with their units, and the outcome."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native, _show

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Signal:
    """The signal of an output of a graph.

    Attributes
    ----------
    name : str
        ``node.output``.
    values : ndarray
        Shape (frames,) for scalars, (frames, components) for other kinds.
    rate : float
        Frames per second.
    unit : str
        SI unit, ``"m/s2"``; ``"1"`` for plain numbers.
    quantity : str or None
        Name of the quantity, ``"acceleration"``; None if it has no name.
    kind : str
        Shape of a frame: scalar, 3-vector, wrench, contact, and others.
    components : list of str
        Names of the columns.
    simulated : bool
        Whether the signal depends on a simulated device.
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
        """Times of the frames, s."""
        return np.arange(len(self.values)) / self.rate

    def __len__(self) -> int:
        return len(self.values)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        values = self.values if dtype is None else self.values.astype(dtype)
        return values.copy() if copy else values

    def to_pandas(self) -> pandas.Series | pandas.DataFrame:
        """A series, or a table with a column for each component, over time in s; ``attrs`` has unit and quantity."""
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
    """The outcome of a run.

    Attributes
    ----------
    frames : int
        Number of frames of the graph's driver.
    seconds : float
        Duration of the run, s.
    not_finite_ticks : int
        Ticks at which an actuator received NaN or infinity; its output was forced to zero.
    not_finite_node : str or None
        The node that first output NaN or infinity.
    limited : dict
        For each actuator the number of ticks, and the number at which each limit reduced its signal: peak, continuous,
        slew.
    panicked : bool
        Whether a node panicked, which is an internal error of haptograph.
    python_nodes : dict
        The nodes that are written in Python, which are slow and run offline only: class by path.
    """

    frames: int
    seconds: float
    not_finite_ticks: int
    not_finite_node: str | None
    limited: dict[str, dict[str, int]]
    panicked: bool = False
    python_nodes: dict[str, str] = field(default_factory=dict)


class Run(Mapping[str, Signal]):
    """The signals of a run by name, its :attr:`outcome`, and the :attr:`seed` that it used."""

    def __init__(self, signals: list[Signal], outcome: Outcome, seed: int):
        self._signals = {signal.name: signal for signal in signals}
        self.outcome, self.seed = outcome, seed

    def __getitem__(self, name: str) -> Signal:
        if name not in self._signals:
            raise KeyError(f"{name}: the run kept {', '.join(self._signals) or 'nothing'}; add to `probes`")
        return self._signals[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._signals)

    def __len__(self) -> int:
        return len(self._signals)

    def __repr__(self) -> str:
        scripts = ", ".join(self.outcome.python_nodes)
        slow = f"; in Python: {scripts}" if scripts else ""
        return f"<Run of {self.outcome.seconds:g} s: {', '.join(self._signals)}{slow}>"

    def _repr_html_(self) -> str:
        return "".join(signal._repr_html_() for signal in self.values())
