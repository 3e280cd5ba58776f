"""Arrays that know what they are samples of."""

from __future__ import annotations

from typing import Any

import numpy as np


class Samples(np.ndarray):
    """Samples over time: an array that also knows its rate and unit.

    Every function of NumPy takes it. Slices without a step keep what it knows; all else gives a plain array, as a square
    has another unit and every second sample another rate.

    Attributes
    ----------
    rate : float
        Samples a second.
    unit : str
        SI, ``"m/s2"``.
    quantity : str
        ``"acceleration"``.
    axes : tuple of str
        ``("time",)``, or ``("voice", "time")``.
    """

    rate: float
    unit: str
    quantity: str
    axes: tuple[str, ...]

    @classmethod
    def of(cls, values: np.ndarray, rate: float, quantity: str, unit: str) -> Samples:
        made = values.view(cls)
        made.rate, made.unit, made.quantity = rate, unit, quantity
        made.axes = ("voice", "time")[-values.ndim :]
        return made

    def __array_finalize__(self, source: Any) -> None:
        for name in ("rate", "unit", "quantity", "axes"):
            if hasattr(source, name):
                setattr(self, name, getattr(source, name))

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **settings: Any) -> Any:
        outputs = settings.get("out", ())
        settings["out"] = tuple(map(_plain, outputs)) if outputs else None
        found = getattr(ufunc, method)(*map(_plain, inputs), **settings)
        return outputs[0] if len(outputs) == 1 and outputs[0] is not None else found

    def __array_function__(self, function: Any, types: Any, arguments: Any, settings: Any) -> Any:
        plain = tuple(map(_plain_in, arguments)), {name: _plain_in(value) for name, value in settings.items()}
        return function(*plain[0], **plain[1])

    def __getitem__(self, key: Any) -> Any:
        found = super().__getitem__(key)
        keys = key if isinstance(key, tuple) else (key,)
        is_part = all(isinstance(one, slice) and one.step in (None, 1) or one is Ellipsis for one in keys)
        # A row of several is the samples of one.
        is_row = self.ndim == 2 and isinstance(keys[0], (int, np.integer)) and len(keys) == 1
        if not isinstance(found, Samples) or not (is_part or is_row):
            return _plain(found)
        found.axes = self.axes[-found.ndim :]
        return found

    @property
    def times(self) -> np.ndarray:
        """Of the samples, s."""
        return np.arange(self.shape[-1]) / self.rate

    def __reduce__(self) -> Any:
        return Samples.of, (_plain(self), self.rate, self.quantity, self.unit)


def _plain(value: Any) -> Any:
    return value.view(np.ndarray) if isinstance(value, Samples) else value


def _plain_in(value: Any) -> Any:
    """The same in lists and tuples of arrays, as `np.stack` takes them."""
    return type(value)(map(_plain, value)) if type(value) in (list, tuple) else _plain(value)
