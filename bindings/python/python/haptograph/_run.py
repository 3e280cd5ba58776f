"""What a run leaves: signals with their units, and what it did."""

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
    python_nodes : dict
        The nodes that are written in Python, and so are slow and offline only: class by path.
    """

    frames: int
    seconds: float
    not_finite_ticks: int
    not_finite_node: str | None
    limited: dict[str, dict[str, int]]
    panicked: bool = False
    python_nodes: dict[str, str] = field(default_factory=dict)


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
        scripts = ", ".join(self.outcome.python_nodes)
        slow = f"; in Python: {scripts}" if scripts else ""
        return f"<Run of {self.outcome.seconds:g} s: {', '.join(self._signals)}{slow}>"

    def _repr_html_(self) -> str:
        return "".join(signal._repr_html_() for signal in self.values())
