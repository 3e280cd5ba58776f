"""Recordings: what a tool felt."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native, _show
from ._arrays import by_name, items, line, magnitude, number, path_name, string
from ._content import Content
from ._errors import Error, in_python
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
        The unit by quantity, if the header does not state it: ``{"accel": "g"}``.
    constants : dict, optional
        Constant quantities, with the unit in the name: ``{"speed_mm_s": 100}``.
    rate : float, optional
        Samples per second, in place of the times of the rows.
    full_scale : float, optional
        The acceleration of a sample of 1.0 in a WAV file, m/s2.
    gesture : {"drag", "circle", "tap", "press"}, optional
        The gesture of the hand, if the file does not state it or states it wrongly.
    strict : bool
        Refuse a file that would be repaired: jittering times, missing cells, single outliers.

    Returns
    -------
    Recording
        The recording; ``recording.findings`` lists the faults that were found and repaired.
    """
    paths = [path] if isinstance(path, (str, bytes, os.PathLike)) else items("path", path)
    if not paths:
        raise Error("there is no file to read: `path` is an empty list")
    settings = reading(columns, units, constants, rate, full_scale, gesture, strict)
    return Recording._of(_native.read([path_name("path", one) for one in paths], settings))


def reading(
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    constants: Mapping[str, float] | None = None,
    rate: float | None = None,
    full_scale: float | None = None,
    gesture: str | None = None,
    strict: bool = False,
) -> dict[str, Any]:
    """What a file does not say itself."""
    return {
        "columns": _pairs("columns", columns),
        "units": _pairs("units", units),
        "constants": _pairs("constants", constants),
        "rate": None if rate is None else number("rate", rate, 0, above=True),
        "full_scale": None if full_scale is None else number("full_scale", full_scale, 0, above=True),
        "strict": bool(strict),
        "gesture": None if gesture is None else string("gesture", gesture),
    }


class Recording(Content):
    """The signals of a tool: acceleration, forces and speed, at one rate.

    A recording never changes: it is equal to another of the same content, and can be passed to other processes.
    ``recording[a:b]`` is the part from sample `a` to before sample `b`; seconds are ``round(seconds * recording.rate)``.

    Parameters
    ----------
    acceleration : array_like
        Acceleration along one axis, m/s2. If it contains gravity or another offset, it is high-passed at 20 Hz, and
        `findings` says so.
    force : array_like
        Normal force of the tool, N; of the same length.
    speed : array_like
        Speed of the tip, m/s; of the same length. Of a signed velocity the magnitude is taken, with a warning.
    rate : float
        Samples per second of all arrays.
    tangential : array_like, optional
        Friction force, N, positive against the motion; of the same length.
    gesture : {"drag", "circle", "tap", "press"}
        The gesture of the hand, which decides what is learned from the recording.
    source : str
        Description of the source.
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
            "speed": magnitude("speed", line("speed", speed)),
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
    def _parse(cls, file: bytes, findings: list[str]) -> Recording:
        return cls._of(_native.Recording.parse(file, findings))

    def __reduce__(self) -> Any:
        return Recording._parse, (self._inner.dump(), self._inner.findings)

    def _content(self) -> tuple[bytes]:
        return (self._inner.dump(),)

    @classmethod
    def from_pandas(cls, table: pandas.DataFrame, rate: float | None = None, gesture: str = "drag") -> Recording:
        """Make a recording from a table like that of :meth:`to_pandas`.

        Parameters
        ----------
        table : pandas.DataFrame
            A table with the columns ``acceleration``, ``force`` and ``speed``, optionally ``tangential``, in SI units.
            Unless `rate` is given, the index is the time in s, at even steps.
        rate : float, optional
            Samples per second.
        gesture : str
            The gesture of the hand.
        """
        missing = [name for name in ("acceleration", "force", "speed") if name not in table]
        if missing:
            raise Error(f"the table has no column {', '.join(missing)}: it has {', '.join(map(str, table.columns))}")
        if rate is None:
            times = line("the index", table.index.to_numpy())
            steps = np.diff(times)
            if len(steps) == 0 or steps.mean() <= 0 or np.abs(steps - steps.mean()).max() > 1e-3 * steps.mean():
                raise Error("the index is not a time in s at even steps: give `rate`, or `read` a CSV file")
            rate = 1 / steps.mean()
            # Times of a decimal rate are rounded; the rate is not.
            rate = float(np.round(rate, 6))
        tangential = table.get("tangential")
        return cls(table["acceleration"], table["force"], table["speed"], rate, tangential, gesture, "a pandas table")

    @property
    def is_processed(self) -> bool:
        """Whether the recording has accelerations, forces and speeds, not sensor readings: see :meth:`processed`."""
        return self._inner.is_processed

    @property
    def gesture(self) -> str:
        """The gesture of the hand: drag, circle, tap or press."""
        return self._inner.gesture

    @property
    def origin(self) -> str:
        """simulated, measured, imported or procedural; simulated data are never marked as measured."""
        return self._inner.origin

    @property
    def source(self) -> str:
        """Description of the source."""
        return self._inner.source

    @property
    def findings(self) -> list[str]:
        """Faults that were found in the file or the arrays, and repaired."""
        return [in_python(finding) for finding in self._inner.findings]

    @property
    def rate(self) -> float:
        """Samples per second."""
        return self._inner.rate

    @property
    def acceleration(self) -> Samples:
        """Acceleration along one axis, high-passed, m/s2, shape (samples,). This and the other arrays are copies."""
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
        """Friction force, N, shape (samples,); None if it was not recorded."""
        friction = self._inner.tangential()
        return None if friction is None else Samples.of(friction, self.rate, "force", "N")

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return len(self) / self.rate

    def __len__(self) -> int:
        return self._inner.samples

    def __getitem__(self, part: slice) -> Recording:
        if not isinstance(part, slice) or part.step not in (None, 1):
            raise Error(f"recording[{part!r}]: give a range of samples, recording[a:b]; for one signal recording.force[i]")
        try:
            begin, end, _ = part.indices(len(self))
        except TypeError:
            raise Error(f"recording[{part.start}:{part.stop}]: give whole numbers of samples") from None
        return Recording._of(self._inner.part(begin, max(begin, end)))

    def processed(self, rate: float | None = None) -> Recording:
        """Convert sensor readings to accelerations, forces and speeds, as `learn` does.

        Parameters
        ----------
        rate : float, optional
            Rate to resample to, Hz, below that of the recording.
        """
        return Recording._of(self._inner.processed(None if rate is None else number("rate", rate, 0, above=True)))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a CSV file if the name ends in .csv, else haptograph's archive. Replaces an existing file."""
        self._inner.save(path_name("path", path))

    def to_pandas(self) -> pandas.DataFrame:
        """A table over time in s; ``table.attrs["units"]`` has the units."""
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
            return f"<Recording of {self.gesture}, {self.origin}, sensor readings>"
        return f"<Recording of {self.gesture}, {self.origin}: {self.seconds:g} s at {self.rate:g} Hz>"

    def _repr_html_(self) -> str:
        shown = self if self.is_processed else self.processed()
        sound = _show.audio(shown.acceleration, shown.rate, "acceleration, as loud as it can be")
        return "".join(shown._inner.figures()) + sound
