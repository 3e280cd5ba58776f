"""Conversion of arguments to arrays of float64, with an error for each invalid one."""

from __future__ import annotations

import itertools
import math
import os
import secrets
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from ._errors import Error, RangeWarning

# 8 GB of float64.
_MOST_NUMBERS = 10**9
# Files, names and surfaces of one call.
_MOST_ITEMS = 10**6


def array(name: str, values: Any) -> np.ndarray:
    """Real numbers as a contiguous array of float64: a copy, which no other thread changes after it was checked."""
    # What is too large for float64 becomes infinite, which is refused where it matters.
    with np.errstate(over="ignore"):
        return np.array(_numbers(name, values), dtype=np.float64, order="C")


def shared(name: str, values: Any) -> np.ndarray:
    """Real numbers as an array of float64, which others may hold and change: for what is copied in part, and then checked."""
    with np.errstate(over="ignore"):
        return np.asarray(_numbers(name, values), dtype=np.float64)


def _numbers(name: str, values: Any) -> np.ndarray:
    """Real numbers as an array of any type."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise Error(f"`{name}` has masked values: fill or remove them")
    try:
        given = np.asarray(values)
        if given.dtype == object:
            # A list of unlike things, or numbers that NumPy has no type for.
            given = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise Error(f"`{name}` is not an array of numbers: {error}") from None
    if given.dtype.kind not in "biuf":
        raise Error(f"`{name}` is of type {given.dtype}: give real numbers")
    if given.size > _MOST_NUMBERS:
        raise Error(f"`{name}` has {given.size} numbers: give at most {_MOST_NUMBERS}")
    return given


def finite(name: str, values: np.ndarray) -> np.ndarray:
    """The same where every number is finite."""
    # What overflows is looked at number by number.
    with np.errstate(all="ignore"):
        total = values.sum()
    if not np.isfinite(total) and not np.isfinite(values).all():
        where = tuple(int(index) for index in np.argwhere(~np.isfinite(values))[0])
        raise Error(f"`{name}` is {values[where] if where else values} at index {list(where)}: give finite numbers")
    return values


def writable(name: str, given: Any, shape: tuple[int, ...]) -> np.ndarray:
    """An array of float64 that a result is written into: of this shape, its numbers one after the other."""
    if not isinstance(given, np.ndarray) or given.dtype != np.float64:
        kind = given.dtype if isinstance(given, np.ndarray) else type(given).__name__
        raise Error(f"`{name}` is a {kind}: give an array of float64")
    if given.shape != shape:
        raise Error(f"`{name}` has shape {given.shape}: give {shape}, that of the result")
    if not (given.flags.c_contiguous and given.flags.aligned and given.flags.writeable):
        raise Error(f"`{name}` is read-only or not contiguous: give an array like that of np.empty")
    return given


def line(name: str, values: Any) -> np.ndarray:
    """One number after the other."""
    made = array(name, values)
    if made.ndim != 1:
        raise Error(f"`{name}` has shape {made.shape}: give one dimension")
    return finite(name, made)


def number(name: str, value: Any, least: float = -math.inf, above: bool = False) -> float:
    """A single finite number."""
    made = array(name, value)
    if made.ndim != 0:
        raise Error(f"`{name}` has shape {made.shape}: give one number")
    single = float(made)
    if not math.isfinite(single) or single < least or (above and single == least):
        bound = "" if least == -math.inf else f" {'above' if above else 'of at least'} {least:g}"
        raise Error(f"`{name}` is {single}: give a finite number{bound}")
    return single


def whole(name: str, value: Any, least: int = 0, most: int = 2**64 - 1) -> int:
    """A whole number in a range."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise Error(f"`{name}` is {value!r}: give a whole number")
    if not least <= int(value) <= most:
        raise Error(f"`{name}` is {value}: give a whole number from {least} to {most}")
    return int(value)


def one_seed(name: str, value: Any) -> int:
    """The seed that is used: the number itself, one drawn from a generator, or a fresh one."""
    if isinstance(value, (np.random.Generator, np.random.SeedSequence)) or value is None:
        return several_seeds(name, value, 1)[0]
    return whole(name, value)


def several_seeds(name: str, values: Any, count: int) -> list[int]:
    """As many seeds: the numbers themselves, drawn from a generator, or fresh ones."""
    if values is None:
        return [secrets.randbits(63) for _ in range(count)]
    if isinstance(values, np.random.Generator):
        return values.integers(2**63, size=count).tolist()
    if isinstance(values, np.random.SeedSequence):
        return values.generate_state(count, np.uint64).tolist()
    return [whole(name, value) for value in items(name, values)]


def magnitude(name: str, velocity: np.ndarray, stacklevel: int = 3) -> np.ndarray:
    """Speeds of what may be velocities, which have a sign."""
    if velocity.size == 0 or not velocity.min() < 0:
        return velocity
    said = f"`{name}` has negative numbers: a velocity, of which the magnitude is taken"
    warnings.warn(said, RangeWarning, stacklevel)
    return np.abs(velocity)


def frames(name: str, values: Any) -> tuple[np.ndarray, bool]:
    """Frames by components, and whether it is one frame for all time."""
    made = finite(name, array(name, values))
    if made.ndim == 0:
        return made.reshape(1, 1), True
    if made.ndim == 1:
        return made.reshape(-1, 1), False
    if made.ndim == 2 and made.shape[1] > 0:
        return made, False
    raise Error(
        f"`{name}` has shape {made.shape}: give (frames,) of numbers, (frames, components) of vectors, or one number"
    )


def string(name: str, value: Any) -> str:
    """A string that is Unicode, which a str of Python need not be."""
    made = str(value)
    try:
        made.encode()
    except UnicodeEncodeError:
        raise Error(f"`{name}` is {made!r}: give a string without lone surrogates") from None
    return made


def path_name(name: str, value: Any) -> str:
    """The name of a file or folder."""
    try:
        made = os.fsdecode(os.fspath(value))
        if b"\0" in os.fsencode(made):
            raise TypeError
    except (TypeError, UnicodeEncodeError):
        raise Error(f"`{name}` is {value!r}: give a path") from None
    return made


def items(name: str, values: Any) -> list[Any]:
    """What a list or another iterable has, but for a string."""
    try:
        if isinstance(values, (str, bytes)):
            raise TypeError
        made = list(itertools.islice(values, _MOST_ITEMS + 1))
    except TypeError:
        raise Error(f"`{name}` is {values!r}: give a list") from None
    if len(made) > _MOST_ITEMS:
        raise Error(f"`{name}` has more than {_MOST_ITEMS} items: give fewer")
    return made


def by_name(name: str, values: Any) -> dict[str, Any]:
    """What a dictionary has, or nothing where there is none."""
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise Error(f"`{name}` is a {type(values).__name__}: give a dictionary")
    return {string(name, key): value for key, value in values.items()}
