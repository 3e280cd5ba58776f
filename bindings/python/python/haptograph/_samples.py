"""Arrays of samples, with their rate and unit."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import _native, _show


class Samples(np.ndarray):
    """Samples over time: an array with its rate and unit.

    NumPy accepts it like any array. Slices without a step, rows and copies keep rate and unit; all other operations
    return a plain array, since a square has another unit and every second sample another rate. Changes in place keep
    rate and unit.

    Attributes
    ----------
    rate : float
        Samples per second.
    unit : str
        SI unit, ``"m/s2"``.
    quantity : str
        Name of the quantity, ``"acceleration"``.
    axes : tuple of str
        Names of the axes: ``("time",)`` or ``("voice", "time")``.
    seed : int, tuple of int, or None
        The seed of the rendering that the samples are from, which gives them again; one for each row.
    clamped : int, tuple of int, or None
        Number of samples of that rendering whose force or speed was above the largest of the surface; one for each row.
    """

    rate: float
    unit: str
    quantity: str
    axes: tuple[str, ...]
    seed: int | tuple[int, ...] | None
    clamped: int | tuple[int, ...] | None

    @classmethod
    def of(
        cls, values: np.ndarray, rate: float, quantity: str, unit: str, seed: Any = None, clamped: Any = None
    ) -> Samples:
        made = values.view(cls)
        made.rate, made.unit, made.quantity = float(rate), unit, quantity
        made.seed, made.clamped = seed, clamped
        made.axes = ("voice", "time")[-values.ndim :]
        return made

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **settings: Any) -> Any:
        outputs = settings.get("out", ())
        if outputs:
            settings["out"] = tuple(map(_plain, outputs))
        found = getattr(ufunc, method)(*map(_plain, inputs), **settings)
        return outputs[0] if len(outputs) == 1 and outputs[0] is not None else found

    def __array_function__(self, function: Any, types: Any, arguments: Any, settings: Any) -> Any:
        return function(*map(_plain, arguments), **{name: _plain(value) for name, value in settings.items()})

    def __array_wrap__(self, made: np.ndarray, *_: Any) -> Any:
        return _plain(made)

    def _like(self, values: np.ndarray, rows: Any = slice(None)) -> Samples:
        of_rows = [one[rows] if isinstance(one, tuple) else one for one in (self.seed, self.clamped)]
        return Samples.of(values, self.rate, self.quantity, self.unit, *of_rows)

    def __getattribute__(self, name: str) -> Any:
        """Methods and properties of arrays are those of a plain one, but for those that keep what it knows."""
        if name.startswith("_") or name in _OWN:
            return super().__getattribute__(name)
        return getattr(self.view(np.ndarray), name)

    def copy(self, order: Any = "C") -> Samples:
        return self._like(self.view(np.ndarray).copy(order))

    def __copy__(self) -> Samples:
        return self.copy()

    def __deepcopy__(self, memo: Any) -> Samples:
        return self.copy()

    def __getitem__(self, key: Any) -> Any:
        found = self.view(np.ndarray)[key]
        first, *more = key if isinstance(key, tuple) and key else (key,)
        is_part = all(isinstance(one, slice) and one.step in (None, 1) for one in (first, *more))
        # A row of several is the samples of one.
        is_row = self.ndim == 2 and type(first) is int and all(isinstance(one, slice) and one.step in (None, 1) for one in more)
        return self._like(found, first) if is_part or is_row else found

    @property
    def times(self) -> np.ndarray:
        """Times of the samples, s, from the first sample on."""
        return np.arange(self.shape[-1]) / self.rate

    def __reduce__(self) -> Any:
        return Samples.of, (self.view(np.ndarray), self.rate, self.quantity, self.unit, self.seed, self.clamped)

    def __repr__(self) -> str:
        shown = np.array2string(self.view(np.ndarray), precision=4, threshold=6, edgeitems=3, separator=", ", max_line_width=120)
        return f"Samples({shown}, shape={self.shape}, unit={self.unit!r}, rate={self.rate:g})"

    def _repr_html_(self) -> str:
        """The first row over time, as a picture and, where it is a vibration, as sound."""
        row = self.view(np.ndarray).reshape(-1, self.shape[-1])[:1].reshape(-1, 1) if self.size else np.empty((0, 1))
        seconds = row.size / self.rate
        title = f"{self.quantity}, {self.unit}, shape {self.shape}: {seconds:g} s at {self.rate:g} Hz"
        figures = "".join(_native.figures(self.quantity, self.quantity, self.rate, np.ascontiguousarray(row), False))
        audible = self.quantity == "acceleration" and self.rate >= 1000
        return f"<p>{title}</p>{figures}" + (_show.audio(row[:, 0], self.rate, "as loud as it can be") if audible else "")


# What is not left to a plain array: what it knows, and what NumPy needs to know of the array itself.
_OWN = {"rate", "unit", "quantity", "axes", "seed", "clamped", "times", "of", "copy", "view", "ndim", "shape", "dtype", "size", "base", "flags"}


def _plain(value: Any) -> Any:
    """The same as plain arrays, also in lists and tuples of them, as `np.stack` takes them."""
    if type(value) in (list, tuple):
        return type(value)(map(_plain, value))
    return np.ndarray.view(value, np.ndarray) if isinstance(value, Samples) else value
