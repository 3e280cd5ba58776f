"""Vibrations as files of phones and controllers."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _native
from ._arrays import line, number, path_name
from ._errors import Error
from ._recording import Recording


@dataclass(frozen=True)
class Export:
    """What is lost in a file: differences between a vibration and what the file is decoded to, in dB.

    Attributes
    ----------
    format : str
        ``"ahap"``, ``"haptic"`` or ``"hjif"``.
    bytes, points, taps : int
        Size of the file, points of its curves, and number of its taps.
    full_scale : float
        What an amplitude of 1 in the file stands for.
    unit : str
        Unit of that.
    envelope : float
        RMS difference of the levels over 50 ms.
    lsd : float or None
        Log-spectral distance over third octaves from 20 to 1000 Hz; None if the vibration is too short for any.
    bands : ndarray
        A row for each third octave: centre in Hz, level of the vibration, level of the decoded file.
    lost : str
        What no file of the format holds.
    """

    format: str
    bytes: int
    points: int
    taps: int
    full_scale: float
    unit: str
    envelope: float
    lsd: float | None
    bands: np.ndarray
    lost: str


def export(vibration: Any, path: str | os.PathLike[str], rate: float | None = None, unit: str = "m/s2") -> Export:
    """Write a vibration as .ahap (Apple), .haptic (Meta) or .hjif (ISO/IEC 23090-31), and measure what is lost.

    These files hold curves of amplitude and frequency, and taps, in place of samples. The file is decoded again, and its
    levels are compared with those of the vibration. An existing file is replaced.

    Parameters
    ----------
    vibration : array_like, Samples, Recording or Signal
        Samples of one vibration; of a recording its acceleration.
    path : str or path
        The file; its extension determines the format.
    rate : float, optional
        Samples per second of an array without a rate.
    unit : str
        Unit of an array without one.
    """
    if isinstance(vibration, Recording):
        vibration = vibration if vibration.is_processed else vibration.processed()
        rate, samples = vibration.rate, vibration.acceleration
    else:
        # A Signal has values; a pandas Series too.
        samples = vibration if isinstance(vibration, np.ndarray) else getattr(vibration, "values", vibration)
        own, unit = getattr(vibration, "rate", None), getattr(vibration, "unit", unit)
        rate = own if isinstance(own, float) and rate is None else rate
    if rate is None:
        raise Error("an array has no rate: give `rate`")
    told = _native.export(line("vibration", samples), number("rate", rate, 0, above=True), str(unit), path_name("path", path))
    return Export(**{**told, "bands": np.array(told["bands"]).reshape(-1, 3)})
