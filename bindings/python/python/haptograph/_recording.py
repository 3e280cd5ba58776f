"""Recordings: what a tool felt."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native, _show
from ._arrays import by_name, items, line, number, path_name, string
from ._errors import Error
from ._samples import Samples

if TYPE_CHECKING:
    import pandas


def _pairs(name: str, given: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    return [(key, string(name, value)) for key, value in by_name(name, given).items()]


def read(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    constants: Mapping[str, float] | None = None,
    rate: float | None = None,
    full_scale: float | None = None,
    gesture: str | None = None,
    strict: bool = False,
) -> Recording:
    """Read a recording.

    Parameters
    ----------
    path : path or list of paths
        haptograph's own archive, a table (CSV, spreadsheet, MATLAB up to -v7), a WAV file beside a table, or any file
        of a HaTT triple. Several tables that share a clock are one recording.
    columns : dict, optional
        The file's column by quantity: ``{"speed": "v"}``. Quantities are accel, accel_x, speed, force_normal and so
        on: docs/learning.md lists them.
    units : dict, optional
        The unit by quantity, where the header does not say it: ``{"accel": "g"}``.
    constants : dict, optional
        Quantities that do not change, their unit in the name: ``{"speed_mm_s": 100}``.
    rate : float, optional
        Samples a second, whatever the rows' times.
    full_scale : float, optional
        What a sample of 1.0 in a WAV file stands for, m/s2.
    gesture : {"drag", "circle", "tap", "press"}, optional
        What the hand did, where the file does not say it or says it wrong.
    strict : bool
        Refuse what would be repaired: jittering times, missing cells, single outliers.

    Returns
    -------
    Recording
        ``recording.findings`` says what was found and repaired.
    """
    paths = [path] if isinstance(path, (str, bytes, os.PathLike)) else items("path", path)
    if not paths:
        raise Error("there is no file to read")
    settings = {
        "columns": _pairs("columns", columns),
        "units": _pairs("units", units),
        "constants": _pairs("constants", constants),
        "rate": None if rate is None else number("rate", rate, 0, above=True),
        "full_scale": None if full_scale is None else number("full_scale", full_scale, 0, above=True),
        "strict": bool(strict),
        "gesture": None if gesture is None else string("gesture", gesture),
    }
    return Recording._of(_native.read([path_name("path", one) for one in paths], settings))


class Recording:
    """What a tool felt: acceleration, forces and speed, at one rate.

    Parameters
    ----------
    acceleration : array_like
        Along one axis, m/s2. Where its mean is not that of a vibration above 20 Hz, as with gravity, it is high-passed
        at 20 Hz, and `findings` says so.
    force : array_like
        How hard the tool presses, N; as long.
    speed : array_like
        Of the tip, m/s; as long.
    rate : float
        Samples a second of all of them.
    tangential : array_like, optional
        Friction, N, positive against the motion; as long.
    gesture : {"drag", "circle", "tap", "press"}
        What the hand did, and so what is learned from it.
    source : str
        Where it comes from, in words.
    """

    _inner: _native.Recording

    def __init__(
        self,
        acceleration: Any,
        force: Any,
        speed: Any,
        rate: float,
        tangential: Any = None,
        gesture: str = "drag",
        source: str = "arrays in Python",
    ):
        arrays = {
            "acceleration": line("acceleration", acceleration),
            "force": line("force", force),
            "speed": line("speed", speed),
            "tangential": None if tangential is None else line("tangential", tangential),
            "rate": number("rate", rate, 0, above=True),
        }
        self._inner = _native.recording(arrays, string("gesture", gesture), string("source", source))

    @classmethod
    def _of(cls, native: _native.Recording) -> Recording:
        made = cls.__new__(cls)
        made._inner = native
        return made

    @classmethod
    def from_pandas(cls, table: pandas.DataFrame, rate: float | None = None, gesture: str = "drag") -> Recording:
        """Make a recording of a table as :meth:`to_pandas` gives it.

        Parameters
        ----------
        table : pandas.DataFrame
            With columns ``acceleration``, ``force`` and ``speed``, perhaps ``tangential``, in SI units. The index is
            the time in s, even, unless `rate` is given.
        rate : float, optional
            Samples a second.
        gesture : str
            What the hand did.
        """
        missing = [name for name in ("acceleration", "force", "speed") if name not in table]
        if missing:
            raise Error(f"the table has no column {', '.join(missing)}: it has {', '.join(map(str, table.columns))}")
        if rate is None:
            times = line("the index", table.index.to_numpy())
            steps = np.diff(times)
            if len(steps) == 0 or steps.mean() <= 0 or np.abs(steps - steps.mean()).max() > 1e-3 * steps.mean():
                raise Error("the index is no even time in s: give `rate`, or write a CSV file and `read` it")
            rate = 1 / steps.mean()
            # Times of a decimal rate are rounded; the rate is not.
            rate = float(np.round(rate, 6))
        tangential = table.get("tangential")
        return cls(table["acceleration"], table["force"], table["speed"], rate, tangential, gesture, "a pandas table")

    @property
    def is_processed(self) -> bool:
        """Whether it holds accelerations, forces and speeds, not sensor readings: see :meth:`processed`."""
        return self._inner.is_processed

    @property
    def gesture(self) -> str:
        """What the hand did: drag, circle, tap or press."""
        return self._inner.gesture

    @property
    def origin(self) -> str:
        """simulated, measured, imported or procedural: nothing simulated passes for measured."""
        return self._inner.origin

    @property
    def source(self) -> str:
        """Where it comes from, in words."""
        return self._inner.source

    @property
    def findings(self) -> list[str]:
        """What was found in its file or arrays, and repaired."""
        return self._inner.findings

    @property
    def rate(self) -> float:
        """Samples a second."""
        return self._inner.rate

    @property
    def acceleration(self) -> Samples:
        """High-passed and on one axis, m/s2, shape (samples,); a copy, as are the others."""
        return Samples.of(self._inner.acceleration(), self.rate, "acceleration", "m/s2")

    @property
    def force(self) -> Samples:
        """Normal force, N, shape (samples,)."""
        return Samples.of(self._inner.force(), self.rate, "force", "N")

    @property
    def speed(self) -> Samples:
        """Speed of the tip, m/s, shape (samples,)."""
        return Samples.of(self._inner.speed(), self.rate, "speed", "m/s")

    @property
    def tangential(self) -> Samples | None:
        """Friction, N, shape (samples,); None where it was not recorded."""
        friction = self._inner.tangential()
        return None if friction is None else Samples.of(friction, self.rate, "force", "N")

    @property
    def seconds(self) -> float:
        """How long it is."""
        return len(self) / self.rate

    def __len__(self) -> int:
        return self._inner.samples

    def processed(self, rate: float | None = None) -> Recording:
        """Accelerations, forces and speeds of sensor readings, as `learn` processes them.

        Parameters
        ----------
        rate : float, optional
            Bring it down to this rate, Hz.
        """
        return Recording._of(self._inner.processed(None if rate is None else number("rate", rate, 0, above=True)))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write it: as CSV where the name ends so, else as haptograph's own archive. A file that is there is replaced."""
        self._inner.save(path_name("path", path))

    def to_pandas(self) -> pandas.DataFrame:
        """A table by time in s; ``table.attrs["units"]`` has the units."""
        import pandas

        columns = {"acceleration": self.acceleration, "force": self.force, "speed": self.speed}
        if (tangential := self.tangential) is not None:
            columns["tangential"] = tangential
        times = pandas.Index(np.arange(len(self)) / self.rate, name="time (s)")
        table = pandas.DataFrame(columns, index=times)
        table.attrs["units"] = {"acceleration": "m/s2", "force": "N", "speed": "m/s", "tangential": "N"}
        return table

    def __repr__(self) -> str:
        if not self.is_processed:
            return f"<Recording of {self.gesture}, {self.origin}, as its sensors gave it>"
        return f"<Recording of {self.gesture}, {self.origin}: {self.seconds:g} s at {self.rate:g} Hz>"

    def _repr_html_(self) -> str:
        shown = self if self.is_processed else self.processed()
        sound = _show.audio(shown.acceleration, shown.rate, "acceleration, as loud as it can be")
        return "".join(shown._inner.figures()) + sound
