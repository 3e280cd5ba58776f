"""The error of a surface along a recording, and the parameters of an actuator from its sweep."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _native
from ._arrays import line, number, one_seed, path_name, whole
from ._errors import Error, in_python
from ._recording import Recording, reading
from ._surface import Surface


@dataclass(frozen=True)
class Evaluation:
    """Errors of a surface against a recording: the measures of ``haptograph evaluate --holdout``, in dB if not stated.

    None if the recording is too short or too quiet for the measure.

    Attributes
    ----------
    lsd, lsd_100_500, lsd_40_250 : float or None
        Log-spectral distance over third octaves from 20 to 1000 Hz, from 100 to 500 Hz and from 40 to 250 Hz. The powers
        of the seeds are averaged first.
    absolute, low, total : float or None
        Mean absolute error of the bands, mean error from 20 to 40 Hz, error of the power; positive if the surface is louder.
    misplaced : float
        Fraction of the energy that lies in the wrong one of nine bands, 0 to 1.
    bands : list of tuple
        Lower and upper edges of the third octaves, Hz.
    signed : ndarray
        Error of each third octave.
    chance_lsd : float or None
        `lsd` between two stationary takes of this length: that of a surface without error.
    kurtosis : float
        Excess kurtosis minus that of the recording.
    envelope, envelope_seeds : float or None
        RMS difference of the levels over 50 ms from the recording, and between two seeds of the surface.
    nse, pe : float or None
        Normalized spectral error and power error of windows of the first seed (2.5.1 of the thesis), not in dB.
    seed : int
        The first seed; the next ones follow it.
    """

    lsd: float | None
    lsd_100_500: float | None
    lsd_40_250: float | None
    absolute: float | None
    low: float | None
    total: float | None
    misplaced: float
    bands: list[tuple[float, float]]
    signed: np.ndarray
    chance_lsd: float | None
    kurtosis: float
    envelope: float | None
    envelope_seeds: float | None
    nse: float | None
    pe: float | None
    seed: int


def evaluate(
    surface: Surface,
    recording: Recording,
    seeds: int = 16,
    seed: int | np.random.Generator | np.random.SeedSequence | None = 1,
) -> Evaluation:
    """Measure the error of a surface along the forces and speeds of a recording that it was not learned from.

    The higher of the two rates is lowered to the other. To learn from parts of recordings and test on the rest, as
    ``haptograph evaluate --holdout`` does, `learn` from ``recording[:n]`` and evaluate on ``recording[n:]``.

    Parameters
    ----------
    surface : Surface
        A surface with a texture.
    recording : Recording
        A drag over the same material.
    seeds : int
        Number of renderings whose powers are averaged.
    seed : int, numpy.random.Generator or numpy.random.SeedSequence, optional
        Seed of the first one; None is a fresh one.
    """
    if not isinstance(surface, Surface) or not isinstance(recording, Recording):
        raise Error("give a Surface and a Recording")
    if recording.gesture != "drag":
        raise Error(f"the recording is of the gesture {recording.gesture}: give a drag, along which a texture is rendered")
    recording = recording if recording.is_processed else recording.processed()
    if recording.rate > surface.rate:
        recording = recording.processed(surface.rate)
    elif recording.rate < surface.rate:
        surface = surface.resampled(recording.rate)
    first = one_seed("seed", seed)
    found = _native.evaluate(surface._inner, recording._inner, whole("seeds", seeds, 1, 1000), first)
    return Evaluation(**found, seed=first)


@dataclass(frozen=True)
class Identification:
    """A voice-coil actuator on its tool, fitted to a sweep: the numbers of ``haptograph identify``.

    Attributes
    ----------
    resonances : list of (float, float)
        Frequency in Hz and quality of both resonances, the higher first.
    gain : float
        Acceleration per current above them, m/s2 per A.
    delay : float
        Delay of the recording, s.
    unexplained : float
        Fraction of the acceleration's power in the band that the fit does not explain.
    parameters : dict or None
        Masses, springs and dampers, with the names and units of graph files; None if too few masses were given.
    findings : list of str
        Faults that were found in the file, and repaired.
    """

    resonances: list[tuple[float, float]]
    gain: float
    delay: float
    unexplained: float
    parameters: dict[str, float] | None
    findings: list[str]

    @property
    def model(self) -> str | None:
        """The parameters as a graph file has them: ``DynamicCompensator(model: ...)``."""
        if self.parameters is None:
            return None
        return "(" + ", ".join(f"{name}: {value:.4g}" for name, value in self.parameters.items()) + ")"


def identify(
    sweep: str | os.PathLike[str] | Sequence[Any],
    rate: float | None = None,
    band: tuple[float, float] = (10.0, 1000.0),
    magnet_g: float | None = None,
    body_g: float | None = None,
    force_n_per_a: float | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> Identification:
    """Fit a voice-coil actuator on its tool to a recorded sweep of current and acceleration, of about ten seconds.

    A sweep alone determines the resonances, their quality and the gain. With the magnet's mass and either the mass of the
    body or the force per current, it determines every mass, spring and damper.

    Parameters
    ----------
    sweep : path, or (current, acceleration)
        A table with columns of time, current and acceleration; or two arrays in A and m/s2, or two signals of a run.
    rate : float, optional
        Samples per second of arrays, or in place of the times of a table.
    band : (float, float)
        Lowest and highest frequency of the sweep, Hz.
    magnet_g : float, optional
        Mass of the magnet, g.
    body_g : float, optional
        Mass of the body, the tool and the part of the hand that moves with them, g.
    force_n_per_a : float, optional
        Force per current, N/A, in place of `body_g`.
    columns, units : dict, optional
        As for :func:`read`, of the quantities time, current and accel.
    """
    masses = {"magnet_g": magnet_g, "body_g": body_g, "force_n_per_a": force_n_per_a}
    magnet, body, force = (None if one is None else number(name, one, 0, above=True) for name, one in masses.items())
    if body is not None and force is not None:
        raise Error("`body_g` and `force_n_per_a` are both given: leave one out")
    if (magnet is None) != (body is None and force is None):
        raise Error("masses need `magnet_g` and one of `body_g` and `force_n_per_a`: give two of them, or none")
    try:
        low, high = band
    except (TypeError, ValueError):
        raise Error(f"`band` is {band!r}: give (low, high) in Hz") from None
    edges = number("band", low, 0, above=True), number("band", high, 0, above=True)
    current, acceleration, hertz, findings = _sweep(sweep, rate, columns, units)
    known = (None if magnet is None else magnet / 1000, None if body is None else body / 1000, force)
    found = _native.identify(current, acceleration, hertz, edges, known)
    parameters = found.pop("parameters")
    return Identification(**found, parameters=parameters and dict(parameters), findings=findings)


def _sweep(sweep: Any, rate: float | None, columns: Any, units: Any) -> tuple[np.ndarray, np.ndarray, float, list[str]]:
    """Current, acceleration, rate, and what was repaired."""
    if isinstance(sweep, (str, bytes, os.PathLike)):
        settings = reading(columns, units, rate=rate)
        current, acceleration, hertz, findings = _native.sweep(path_name("sweep", sweep), settings)
        return current, acceleration, hertz, [in_python(finding) for finding in findings]
    try:
        current, acceleration = sweep
    except (TypeError, ValueError):
        raise Error("`sweep` is neither a file nor (current, acceleration): give one of them") from None
    rates = {float(one.rate) for one in (current, acceleration) if hasattr(one, "rate")}
    rates |= set() if rate is None else {number("rate", rate, 0, above=True)}
    if len(rates) != 1:
        raise Error(f"the rates of the sweep are {sorted(rates)}: give `rate`, one for both arrays")
    return line("current", current), line("acceleration", acceleration), rates.pop(), []
