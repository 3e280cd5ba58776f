"""Surfaces: what makes a virtual surface feel like a real one."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from . import _native, _show
from ._arrays import (
    array,
    finite,
    items,
    line,
    magnitude,
    number,
    one_seed,
    path_name,
    several_seeds,
    shared,
    string,
    whole,
    writable,
)
from ._content import Content
from ._errors import Error, LearningWarning, RangeWarning, in_python
from ._recording import Recording
from ._samples import Samples

_MOST_SAMPLES = 10**9
# Of forces and speeds that come from other units.
_ROUNDING = 1 + 1e-9


def _warn_of_clamped(samples: int, of: int, surfaces: list[Surface]) -> None:
    force, speed = min(one.max_force for one in surfaces), min(one.max_speed for one in surfaces)
    name = f"{surfaces[0].name!r}" if len(surfaces) == 1 else "one of the surfaces"
    warnings.warn(
        f"{samples} of {of} samples have a force above {force:.4g} N or a speed above {speed:.4g} m/s, the largest of {name}: "
        "they are rendered as if at that",
        RangeWarning,
        stacklevel=3,
    )


def learn(
    recordings: Recording | Sequence[Recording],
    name: str = "surface",
    method: str = "law",
    order: int | None = None,
    rate: float | None = None,
    progress: Callable[[float], object] | None = None,
    accept_rate: bool = False,
    clips: bool = True,
) -> Surface:
    """Learn a surface from recordings of one material.

    The gesture of a recording decides what is learned from it: texture from drags (and friction, if there is no
    circle), friction from circles, taps from taps, stiffness from a press.

    Parameters
    ----------
    recordings : Recording or list of Recording
        Recordings of one material.
    name : str
        Name of the material.
    method : {"law", "thesis"}
        ``"law"``: one law of the spectrum over speed and force. ``"thesis"``: a model for each stationary segment,
        triangulated over speed and force.
    order : int, optional
        Order of all models.
    rate : float, optional
        Rate to which vibrations are resampled first, Hz.
    progress : callable, optional
        Called from time to time with the fraction done, 0 to 1.
    accept_rate : bool
        Learn from drags and taps below 500 Hz too, in which little of what a hand feels is left. Below 2300 Hz a
        warning names the highest frequency.
    clips : bool
        Keep up to 20 s of the recording, whitened, as the excitation (``"law"``, from 4 s on). They are a copy of the
        recording, to which its licence applies. False: noise whose level fluctuates as recorded.

    Returns
    -------
    Surface
        The surface; ``surface.missing`` lists the parts that could not be learned, with the reasons.

    Warns
    -----
    LearningWarning
        Of what is in :attr:`Surface.warnings`.
    """
    given = [recordings] if isinstance(recordings, Recording) else items("recordings", recordings)
    for one in given:
        if not isinstance(one, Recording):
            raise Error(f"{one!r} is not a Recording: `read` a file, or make one from arrays")
    settings = {
        "method": string("method", method),
        "order": None if order is None else whole("order", order, 1, 1000),
        "rate": None if rate is None else number("rate", rate, 0, above=True),
        "accept_rate": bool(accept_rate),
        "clips": bool(clips),
    }
    native = _native.learn(string("name", name), [one._inner for one in given], settings, progress)
    surface = Surface._of(native, _notes(native, given))
    for warning in surface.warnings:
        warnings.warn(warning, LearningWarning, stacklevel=2)
    return surface


def _notes(native: _native.Surface, recordings: list[Recording]) -> dict[str, Any]:
    """What is known of a surface that was learned, and is not in its file."""
    warned: list[str] = []
    notes: dict[str, Any] = {"missing": [in_python(one) for one in native.missing]}
    if (learned := native.learned()) is not None:
        if learned["narrow_band"] is not None:
            warned.append(in_python(learned["narrow_band"]))
        seconds, segments = learned["seconds"], learned["segments"]
        if learned["is_short"]:
            warned.append(
                f"the texture is learned from only {seconds:.3g} s in {segments} segments; "
                "record at least 3 s and 3 segments, preferably 10 s"
            )
        # Numbers in a wrong unit say nothing of where more is needed.
        is_implausible = any("the largest " in finding for one in recordings for finding in one.findings)
        record_next = None if is_implausible else learned["record_next"]
        notes["coverage"] = Coverage(learned["areas"], seconds, segments, record_next)
    return {**notes, "warnings": warned + notes["missing"]}


@dataclass(frozen=True)
class Coverage:
    """How much of the plane of force and speed a texture was learned from: see :attr:`Surface.coverage`.

    Attributes
    ----------
    areas : int
        Number of areas with enough data, of 9: slow, medium and fast by light, medium and firm.
    seconds : float
        Duration of what was learned from, s.
    segments : int
        Number of stretches that it is made of.
    record_next : str or None
        The areas to record next; None if there is none.
    """

    areas: int
    seconds: float
    segments: int
    record_next: str | None


@dataclass(frozen=True, eq=False)
class Model(Content):
    """The filter that shapes white noise into the vibration of a surface at one force and speed.

    Attributes
    ----------
    ar, ma : ndarray
        Coefficients a_1 to a_p of A(z) = 1 + sum of a_k z^-k, and b_1 to b_q of B(z) likewise.
    gain : float
        Gain of the MA polynomial.
    variance : float
        Variance of the excitation, (m/s2)^2.
    warping : float
        Warping factor of the frequency axis of the AR polynomial; 0 for an unwarped axis.
    force, speed : float
        Force in N and speed in m/s, limited to the largest that have models.
    rate : float
        Samples per second.
    """

    ar: np.ndarray
    ma: np.ndarray
    gain: float
    variance: float
    warping: float
    force: float
    speed: float
    rate: float
    _surface: Surface = field(repr=False)

    @property
    def lsf(self) -> np.ndarray:
        """The line spectral frequencies of `ar`, rad on its axis (of `warping`), ascending."""
        return _native.lsf(self.ar.tolist())

    def __post_init__(self) -> None:
        for coefficients in (self.ar, self.ma):
            coefficients.flags.writeable = False

    def _content(self) -> tuple[Any, ...]:
        numbers = (self.gain, self.variance, self.warping, self.force, self.speed, self.rate)
        return (self.ar.tobytes(), self.ma.tobytes(), numbers, self._surface._digest())

    def __reduce__(self) -> Any:
        return Model, tuple(getattr(self, field.name) for field in fields(self))

    def spectrum(self, frequencies: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """The power spectral density of the vibration.

        Parameters
        ----------
        frequencies : array_like, optional
            Frequencies, Hz; by default 512 of them up to half the rate.

        Returns
        -------
        frequencies : ndarray
            Hz.
        density : ndarray
            One-sided density, (m/s2)^2/Hz, without spectral lines that are fixed in space.
        """
        if frequencies is None:
            frequencies = np.linspace(0, self.rate / 2, 512)
        frequencies = line("frequencies", frequencies)
        return frequencies, self._surface._inner.density(self.force, self.speed, frequencies)


# Cells of the warped axis to which a spectrum is averaged, the least density beside the largest, and that outside beside the last given.
_CELLS, _LEAST, _OUTSIDE = 1024, 1e-6, 0.1


def _taken(model: Any, numbers: str, rate: Any) -> tuple[float, float, list[float], float]:
    """Force, speed, numbers and variance of a model."""
    if rate is None:
        raise Error("give the `rate` of the models, samples per second")
    try:
        force, speed, given, variance = model
    except (TypeError, ValueError):
        raise Error(f"{model!r} is not a model: give (force, speed, {numbers}, ...) of four") from None
    place = number("force", force, 0, above=True), number("speed", speed, 0, above=True)
    if numbers == "frequencies":
        return (*place, [], 0.0)
    return (*place, line(numbers, given).tolist(), number("variance", variance, 0))


def _cells(model: Any, edges: np.ndarray) -> np.ndarray:
    """Mean densities between neighbours of `edges`, of a spectrum in points or bands."""
    _, _, given, values = model
    frequencies, values = finite("frequencies", array("frequencies", given)), line("density", values)
    is_bands = frequencies.ndim == 2 and frequencies.shape[1] == 2
    if len(frequencies) != len(values) or len(values) < 1 + (not is_bands) or frequencies.ndim != 1 + is_bands:
        raise Error(
            f"the frequencies have shape {frequencies.shape} and the densities {values.shape}: "
            "give (n,) of points, or (n, 2) edges of bands, and n densities"
        )
    ends = frequencies.reshape(-1)
    if ends[0] < 0 or (np.diff(ends) < 0).any() or (is_bands and not (frequencies[:, 1] > frequencies[:, 0]).all()):
        raise Error("the frequencies of a spectrum ascend, from 0 on")
    if (values < 0).any():
        raise Error("the densities of a spectrum are not negative")
    if is_bands:
        # The power below each end of a band.
        powers = np.cumsum(np.stack([np.zeros(len(values)), values], axis=1).reshape(-1))
        below = np.interp(edges, ends, powers)
    else:
        every = np.union1d(edges, frequencies)
        density = np.interp(every, frequencies, values, left=0, right=0)
        below = np.concatenate([[0], np.cumsum(np.diff(every) * (density[1:] + density[:-1]) / 2)])
        below = below[np.searchsorted(every, edges)]
    cells = np.diff(below) / np.diff(edges)
    if not (cells > 0).any():
        raise Error("the spectrum has nothing below half of the rate")
    # A model has no edge as steep as the end of a spectrum, and would smear it over the bands beside.
    (within,) = np.nonzero((edges[1:] > ends[0]) & (edges[:-1] < ends[-1]))
    first, last = within[0], within[-1]
    cells[:first], cells[last + 1 :] = _OUTSIDE * cells[first], _OUTSIDE * cells[last]
    return np.maximum(cells, _LEAST * cells.max())


def _made(
    form: str, models: list[Any], rate: Any, name: str, parts: dict[str, Any], order: int = 0
) -> _native.Surface:
    known = ("warping", "highpass", "max_force", "max_speed", "excitation", "taps", "taps_rate", "friction", "stiffness", "source", "licence")
    for part in parts:
        if part not in known:
            raise Error(f"a surface has no part `{part}`: it has {', '.join(known)}")

    def positive(part: str) -> float | None:
        return None if parts.get(part) is None else number(part, parts[part], 0, above=True)

    def text(part: str) -> str | None:
        return None if parts.get(part) is None else string(part, parts[part])

    if not models and not any(parts.get(part) is not None for part in ("taps", "friction", "stiffness")):
        raise Error("give models, taps, friction or stiffness; or `learn` a surface, or `Surface.load` one")
    excitation = parts.get("excitation")
    if excitation is not None and not models:
        raise Error("an excitation drives models: give them, too")
    try:
        pairs = [(speed, tap) for speed, tap in parts.get("taps") or ()]
    except (TypeError, ValueError):
        raise Error("`taps` are pairs of a speed and an acceleration, [(0.1, acceleration), ...]") from None
    taps = [(number("a tap's speed", speed, 0, above=True), line("a tap", tap).tolist()) for speed, tap in pairs]
    taps_rate = positive("taps_rate") or (None if rate is None else number("rate", rate, 0, above=True))
    if taps and taps_rate is None:
        raise Error("give the `taps_rate`, samples per second")
    given = {
        "form": form,
        "order": order,
        "models": models,
        "rate": 0.0 if rate is None else number("rate", rate, 0, above=True),
        "warping": number("warping", parts.get("warping") or 0, 0),
        "highpass": positive("highpass"),
        "range": (positive("max_force"), positive("max_speed")),
        "excitation": None if excitation is None else line("excitation", excitation).tolist(),
        "taps_rate": taps_rate or 0.0,
        "taps": taps,
        "resistance": (positive("friction"), positive("stiffness")),
        "origin": (text("source") or "models given in Python", text("licence")),
    }
    return _native.make(string("name", name), given)


class Surface(Content):
    """Friction, taps, texture and stiffness of one material: of :func:`learn`, :meth:`load`, or models from elsewhere.

    A surface never changes. Two are equal, with the same hash, if their files are. Passed to another process, it is its
    file: it renders the same bits, and keeps what `learn` said of it, but for its :meth:`page`.
    """

    _inner: _native.Surface
    _notes: dict[str, Any] | None

    def __init__(self, models: Sequence[Any] = (), rate: float | None = None, name: str = "surface", **parts: Any) -> None:
        """Make a surface of models that come from elsewhere, such as those of a network.

        Between them the line spectral frequencies are interpolated; towards zero force or speed the vibration vanishes.

        Parameters
        ----------
        models : list of (force, speed, ar, variance)
            Normal force in N and speed in m/s, above 0; the coefficients a_1 to a_p of ``y[n] = -sum of a_k y[n-k] + e[n]``,
            stable and of one order for all; the variance of e, (m/s2)^2. None of them: a surface without texture.
        rate : float
            Samples per second of the models.
        name : str
            Name of the material.
        warping : float
            Factor of the warped axis on which the coefficients are; 0, the default, is the usual one.
        highpass : float, optional
            Cutoff in Hz, below a quarter of the rate, of a high-pass that was taken off before the models were fitted, as
            `learn` does at 20 Hz: it is applied to the rendered vibration.
        max_force, max_speed : float, optional
            Largest force and speed that it renders, by default those of the models. Beyond the models the nearest is used.
        excitation : array_like, optional
            Noise at `rate` that drives the filters in place of white noise, at most 300 000 samples; its deviation is made 1.
        taps : list of (speed, acceleration), optional
            Speed of impact in m/s, ascending, and acceleration after contact, m/s2; all of one length, at `taps_rate`
            (by default `rate`).
        friction, stiffness : float, optional
            Friction coefficient; N/m.
        source, licence : str, optional
            Where the numbers are from, and the licence of a recording that they hold: kept in the file.
        """
        taken = [_taken(model, "ar", rate) for model in models]
        self._inner, self._notes = _made("ar", taken, rate, name, parts), None

    @classmethod
    def from_lsf(cls, models: Sequence[Any], rate: float, name: str = "surface", **parts: Any) -> Surface:
        """Make a surface of line spectral frequencies: models of (force, speed, lsf, variance), lsf in radians, ascending.

        `parts` are those of :class:`Surface`.
        """
        return cls._of(_made("lsf", [_taken(model, "lsf", rate) for model in models], rate, name, parts))

    @classmethod
    def from_spectra(
        cls, models: Sequence[Any], rate: float, name: str = "surface", order: int = 20, **parts: Any
    ) -> Surface:
        """Make a surface of spectra, to each of which an all-pole model is fitted on the warped axis.

        Parameters
        ----------
        models : list of (force, speed, frequencies, density)
            `frequencies` of shape (n,): Hz, with the one-sided density there, (m/s2)^2/Hz, between them in a straight line.
            Of shape (n, 2): lower and upper edges of bands that do not overlap, with the power in each, (m/s2)^2. Outside,
            a tenth of the nearest density is assumed; below a millionth of the largest nothing is told apart.
        rate : float
            Samples per second of the surface.
        order : int
            Order of the fitted models, at most 32.
        name, **parts
            As for :class:`Surface`.
        """
        if "warping" in parts:
            raise Error("the axis of spectra follows from the rate: leave `warping` out")
        warping, edges = _native.warped_axis(number("rate", rate, 0, above=True), _CELLS)
        taken = [(*_taken(model, "frequencies", rate)[:2], _cells(model, edges).tolist(), 0.0) for model in models]
        return cls._of(_made("cells", taken, rate, name, {**parts, "warping": warping}, whole("order", order, 1, 32)))

    @classmethod
    def from_function(
        cls,
        function: Callable[[float, float], tuple[Any, float]],
        forces: Any,
        speeds: Any,
        rate: float,
        name: str = "surface",
        **parts: Any,
    ) -> Surface:
        """Make a surface of a function of force and speed that returns (ar, variance), on a grid of both.

        `parts` are those of :class:`Surface`.
        """
        grid = [(force, speed) for force in line("forces", forces).tolist() for speed in line("speeds", speeds).tolist()]
        models = [(place, function(*place)) for place in grid]
        for place, made in models:
            if not isinstance(made, (tuple, list)) or len(made) != 2:
                raise Error(f"the function returns {made!r} at {place[0]:g} N and {place[1]:g} m/s: it has to return (ar, variance)")
        return cls([(*place, *made) for place, made in models], rate, name, **parts)

    @classmethod
    def _of(cls, native: _native.Surface, notes: dict[str, Any] | None = None) -> Surface:
        made = cls.__new__(cls)
        made._inner, made._notes = native, notes
        return made

    @classmethod
    def _parse(cls, file: bytes, notes: dict[str, Any] | None) -> Surface:
        return cls._of(_native.Surface.parse(file), notes)

    def __reduce__(self) -> Any:
        return Surface._parse, (self._inner.dump(), self._notes)

    def _content(self) -> tuple[bytes]:
        return (self._inner.dump(),)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Surface:
        """Read a surface: haptograph's .ron, or the toolkit's (HaTT) .xml."""
        return cls._of(_native.Surface.load(path_name("path", path)))

    def save(self, path: str | os.PathLike[str]) -> list[str]:
        """Write the surface as .ron, or as .xml for the toolkit (HaTT).

        Returns
        -------
        list of str
            Parts that the format cannot store.
        """
        return self._inner.save(path_name("path", path))

    @property
    def name(self) -> str:
        """The material's name."""
        return self._inner.name

    @property
    def origin(self) -> str:
        """Origin of the surface: simulated, measured, imported or procedural."""
        return self._inner.origin

    @property
    def friction(self) -> float | None:
        """Friction coefficient, if known."""
        return self._inner.friction

    @property
    def stiffness(self) -> float | None:
        """Stiffness, N/m, if known."""
        return self._inner.stiffness

    @property
    def taps(self) -> int:
        """Number of recorded taps."""
        return self._inner.taps

    @property
    def missing(self) -> list[str]:
        """Parts that could not be learned, with the reasons; a file has them too."""
        return list(self._notes["missing"]) if self._notes else self._inner.missing

    @property
    def warnings(self) -> list[str]:
        """What :func:`learn` warned of: a narrow band, too little data, missing parts. A file has the last alone."""
        return list(self._notes["warnings"]) if self._notes else self.missing

    @property
    def coverage(self) -> Coverage | None:
        """How much of the plane of force and speed it was learned from; None if it was read from a file."""
        return self._notes.get("coverage") if self._notes else None

    def _recorded(self, axis: int) -> tuple[float, float] | None:
        ranges = self._inner.recorded()
        return None if ranges is None else ranges[axis]

    @property
    def recorded_speed(self) -> tuple[float, float] | None:
        """Least and largest speed that was recorded, m/s; beyond it the texture is extrapolated, up to :attr:`max_speed`.

        Medians of short stretches of the recordings. None where a file does not say, as those learned by older versions.
        """
        return self._recorded(0)

    @property
    def recorded_force(self) -> tuple[float, float] | None:
        """Least and largest normal force that was recorded, N: as :attr:`recorded_speed`."""
        return self._recorded(1)

    @property
    def rate(self) -> float:
        """Samples per second of the texture."""
        return self._inner.rate

    @property
    def highpass(self) -> float | None:
        """Cut-off of the high-pass that is applied to what the models give, Hz; None if there is none."""
        return self._inner.highpass

    @property
    def max_speed(self) -> float:
        """The largest speed that has models, m/s; larger speeds are limited to it."""
        return self._inner.range[0]

    @property
    def max_force(self) -> float:
        """The largest force that has models, N; larger forces are limited to it."""
        return self._inner.range[1]

    @property
    def places(self) -> np.ndarray:
        """Speed (m/s) and force (N) of every model, shape (models, 2)."""
        return np.array(self._inner.places())

    def at(self, force: float, speed: float) -> Model:
        """The model at a normal force in N and a speed in m/s."""
        force, speed = number("force", force, 0), number("speed", speed, 0)
        return Model(**self._inner.at(force, speed), _surface=self)

    def render(
        self,
        force: Any,
        speed: Any,
        seconds: float | None = None,
        rate: float | None = None,
        seed: int | np.random.Generator | np.random.SeedSequence | None = None,
        update: float = 240.0,
        progress: Callable[[float], object] | None = None,
    ) -> Samples:
        """Render the vibration of sliding over the surface.

        Parameters
        ----------
        force : float or array_like
            Normal force, N; one for each sample, or one for all.
        speed : float or array_like
            Speed, m/s; one for each sample, or one for all. Of a signed velocity the magnitude is taken.
        seconds : float, optional
            Duration, s, if neither force nor speed is an array.
        rate : float, optional
            Samples per second of the arrays and the result; by default the texture's own, :attr:`rate`. For a lower
            rate the texture is resampled in each call: for many calls, do that once with :meth:`resampled`. At a higher
            rate the result contains nothing above half of the texture's own rate.
        seed : int, numpy.random.Generator or numpy.random.SeedSequence, optional
            The same whole number gives the same samples, and so does the same sequence; a generator gives others in each
            call. By default the seed is a fresh one. ``samples.seed`` is the number that was used.
        update : float
            Rate at which the filter follows force and speed, Hz.
        progress : callable, optional
            Called from time to time with the fraction done, 0 to 1. Ctrl-C, or an exception that it raises, ends the
            call.

        Returns
        -------
        Samples
            Acceleration, m/s2, shape (samples,). ``samples.clamped`` counts the samples whose force or speed is above
            the largest of the surface, at which they are rendered.

        Warns
        -----
        RangeWarning
            If there are such samples, or a speed has a sign.
        """
        surface, wanted = self, self.rate if rate is None else number("rate", rate, 0, above=True)
        if wanted < self.rate:
            surface = self.resampled(wanted)
        own, seed, update = surface.rate, one_seed("seed", seed), number("update", update, 0, above=True)
        for name, given in (("force", force), ("speed", speed)):
            if isinstance(given, Samples) and given.rate != wanted:
                raise Error(f"`{name}` has {given.rate:g} Hz, the result {wanted:g} Hz: give `rate={given.rate:g}`")
        force, speed = finite("force", array("force", force)), finite("speed", array("speed", speed))
        if force.ndim == speed.ndim == 0:
            if seconds is None:
                raise Error("the duration is unknown: give `seconds`, or an array of forces or speeds")
            samples = number("seconds", seconds, 0) * wanted
            if samples > _MOST_SAMPLES:
                raise Error(f"{seconds} s are {samples:.3g} samples: render at most {_MOST_SAMPLES:.0e} at once")
            speed = np.full(math.floor(samples + 0.5), float(speed))
        elif seconds is not None:
            raise Error("`seconds` contradicts the array, whose length is the duration: leave `seconds` out")
        try:
            force, speed = np.broadcast_arrays(force, speed)
        except ValueError:
            raise Error(f"force has shape {force.shape}, speed {speed.shape}: give arrays of the same length") from None
        force, speed = line("force", force), magnitude("speed", line("speed", speed))
        count, clamped = len(force), surface._outside(force, speed)
        if clamped:
            _warn_of_clamped(clamped, count, [surface])
        if wanted > own:
            # The force and speed at the texture's own samples.
            places = np.floor(np.arange(math.ceil(count * own / wanted)) * (wanted / own)).astype(np.int64)
            places = np.minimum(places, count - 1)
            force, speed = force[places], speed[places]
        made = surface._inner.render(force, speed, seed, update, progress)
        if wanted > own:
            made = _native.resample(made, own, wanted, count)
        return Samples.of(made, wanted, "acceleration", "m/s2", seed, clamped)

    def _outside(self, force: np.ndarray, speed: np.ndarray) -> int:
        """Number of samples above the largest force or speed, but for rounding."""
        most_force, most_speed = self.max_force * _ROUNDING, self.max_speed * _ROUNDING
        if force.size == 0 or not (force.max() > most_force or speed.max() > most_speed):
            return 0
        return int(np.count_nonzero((force > most_force) | (speed > most_speed)))

    def resampled(self, rate: float) -> Surface:
        """Copy of the surface with its texture at a lower rate, by the best method of ``haptograph surface resample``.

        Parameters
        ----------
        rate : float
            Samples per second, below :attr:`rate`. A higher rate is an error, because the texture contains nothing
            above half its own rate: render at its rate and resample the result.
        """
        wanted, own = number("rate", rate, 0, above=True), self.rate
        if wanted >= own:
            raise Error(
                f"the texture has a rate of {own:g} Hz and contains nothing above {own / 2:g} Hz: "
                f"render at {own:g} Hz, and resample the result to {wanted:g} Hz"
            )
        return Surface._of(self._inner.resampled(wanted), self._notes)

    def page(self) -> str:
        """The page of ``haptograph learn --report``, as HTML. An error for a surface of a file or of another process."""
        page = self._inner.page()
        if page is None:
            raise Error(
                "a surface that was read from a file, resampled, or made in another process has no report: "
                "learn it from its recordings here"
            )
        return page

    def __repr__(self) -> str:
        friction = "" if self.friction is None else f", friction {self.friction:.3g}"
        stiffness = "" if self.stiffness is None else f", {self.stiffness:.3g} N/m"
        return f"<Surface {self.name!r}, {self.origin}{friction}{stiffness}, {self.taps} taps>"

    def _repr_html_(self) -> str:
        rows = [("origin", self.origin)]
        if self.friction is not None:
            rows.append(("friction coefficient", f"{self.friction:.3g}"))
        if self.stiffness is not None:
            rows.append(("stiffness", f"{self.stiffness:.4g} N/m"))
        rows.append(("taps", str(self.taps)))
        return _show.table(rows, self.name) + (self._inner.figure() or "")


@dataclass(frozen=True)
class Comparison:
    """Differences of two vibrations in dB, positive if the first is louder; None if no band is strong enough to count.

    Attributes
    ----------
    lsd, lsd_100_500, lsd_40_250 : float
        Log-spectral distance over third octaves from 20 to 1000 Hz, from 100 to 500 Hz and from 40 to 250 Hz.
    absolute, low, total : float
        Mean absolute error of the bands, mean error from 20 to 40 Hz, error of the power.
    misplaced : float
        Fraction of the energy that lies in the wrong one of nine bands, 0 to 1.
    nse, pe : float
        Normalized spectral error and power error of windows (2.5.1 of the thesis), not in dB.
    windows : int
        Number of windows.
    bands : list of tuple
        Lower and upper edges of the third octaves, Hz.
    signed : ndarray
        Error of each third octave.
    findings : list of str
        Repairs made before the comparison: a vibration with gravity is high-passed at 20 Hz.
    """

    lsd: float | None
    lsd_100_500: float | None
    lsd_40_250: float | None
    absolute: float | None
    low: float | None
    total: float | None
    misplaced: float
    nse: float
    pe: float
    windows: int
    bands: list[tuple[float, float]]
    signed: np.ndarray
    findings: list[str]


def _vibration(name: str, given: Any) -> tuple[np.ndarray, float | None]:
    if isinstance(given, Recording):
        given = given if given.is_processed else given.processed()
        return given.acceleration, given.rate
    if isinstance(given, Samples) and given.unit != "m/s2":
        raise Error(f"`{name}` is {given.quantity} in {given.unit}: give an acceleration in m/s2")
    values = given if isinstance(given, np.ndarray) else getattr(given, "values", given)
    rate = getattr(given, "rate", None)
    # A Signal knows its rate; a pandas Series has values too.
    return line(name, values), rate if isinstance(rate, float) else None


def compare(
    a: Any,
    b: Any,
    rate: float | None = None,
    window: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> Comparison:
    """Compare two vibrations, over the time that both cover.

    Parameters
    ----------
    a, b : array_like, Samples, Recording or Signal
        Accelerations, m/s2; of a recording its acceleration.
    rate : float, optional
        Samples per second of arrays without a rate. If only one of the two has a rate, it applies to both.
    window : int, optional
        Samples in a window of `nse` and `pe`; 25.6 ms by default.
    progress : callable, optional
        Called from time to time with the fraction done, 0 to 1. Ctrl-C, or an exception that it raises, ends the call.
    """
    (a, of_a), (b, of_b) = _vibration("a", a), _vibration("b", b)
    rates = {number("rate", one, 0, above=True) for one in (of_a, of_b, rate) if one is not None}
    if not rates:
        raise Error("arrays have no rate: give `rate`")
    if len(rates) > 1:
        raise Error(f"the rates differ: {', '.join(f'{one:g} Hz' for one in sorted(rates))}; resample one")
    window = None if window is None else whole("window", window, 2, 2**32)
    return Comparison(**_native.compare(a, b, rates.pop(), window, progress))


def render(
    surfaces: Surface | Sequence[Surface],
    force: Any,
    speed: Any,
    seeds: Any = None,
    update: float = 240.0,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
    out: np.ndarray | None = None,
) -> Samples | np.ndarray:
    """Render many vibrations at once, in SIMD lanes and on all cores.

    A row has the same bits for any other rows, and equals that of :meth:`Surface.render` except for rounding.

    Parameters
    ----------
    surfaces : Surface or list of Surface
        One surface for all rows, or one for each; all of the same rate.
    force, speed : array_like
        Force in N and speed in m/s, shape (rows, samples), or (samples,) for all rows.
    seeds : sequence of int, numpy.random.Generator or numpy.random.SeedSequence, optional
        One seed for each row, a generator or a sequence that gives them; fresh ones by default. ``samples.seed`` has them.
    update : float
        Rate at which the filters follow force and speed, Hz.
    threads : int, optional
        Number of threads; by default one for each core.
    progress : callable, optional
        Called from time to time with the fraction done, 0 to 1. Ctrl-C, or an exception that it raises, ends the call.
    out : ndarray, optional
        Array for the result, as in NumPy's functions: float64, shape (rows, samples), contiguous. Reusing an array
        saves the time in which the system clears a new one. After an error its content is undefined.

    Returns
    -------
    Samples
        Acceleration, m/s2, shape (rows, samples); `out` itself if it is given, which has no seeds and counts.

    Warns
    -----
    RangeWarning
        As :meth:`Surface.render`.
    """
    surfaces = [surfaces] if isinstance(surfaces, Surface) else items("surfaces", surfaces)
    if not surfaces or not all(isinstance(one, Surface) for one in surfaces):
        raise Error("give a Surface, or a list of them")
    if len({one.rate for one in surfaces}) > 1:
        raise Error("the surfaces have different rates: render those of one rate at once")
    # Neither is copied: few of the samples are read.
    given = [np.atleast_2d(shared(name, x)) for name, x in (("force", force), ("speed", speed))]
    given[1] = magnitude("speed", given[1])
    is_drawn = seeds is None or isinstance(seeds, (np.random.Generator, np.random.SeedSequence))
    try:
        seeded = 0 if is_drawn else len(seeds)
    except (TypeError, OverflowError):
        raise Error(f"`seeds` is {seeds!r}: give a list with one whole number for each row") from None
    rows = max(len(surfaces), seeded, *(len(one) for one in given))
    if rows > _MOST_SAMPLES:
        raise Error(f"{rows} rows: render at most {_MOST_SAMPLES:.0e} samples at once")
    try:
        force, speed = np.broadcast_arrays(*given, np.broadcast_to(0.0, (rows, 1)))[:2]
    except ValueError:
        raise Error(
            f"force has shape {given[0].shape}, speed {given[1].shape}, for {rows} rows: give (rows, samples) of both"
        ) from None
    if force.ndim != 2:
        raise Error(f"force and speed have shape {force.shape}: give (rows, samples)")
    if len(surfaces) not in (1, rows) or (not is_drawn and seeded != rows):
        raise Error(f"{len(surfaces)} surfaces and {seeded} seeds for {rows} rows: give one for each")
    if force.size > _MOST_SAMPLES:
        raise Error(f"{force.size:.3g} samples: render at most {_MOST_SAMPLES:.0e} at once")
    inner = [one._inner for one in surfaces] * (rows if len(surfaces) == 1 else 1)
    seeds = several_seeds("seeds", seeds, rows)
    threads = whole("threads", (os.cpu_count() or 1) if threads is None else threads, 1, 1024)
    update = number("update", update, 0, above=True)
    made = np.empty(force.shape) if out is None else writable("out", out, force.shape)
    read = _native.update_samples(surfaces[0].rate, update, force.shape[1])
    points = []
    for name, one, everywhere in zip(("force", "speed"), given, (force, speed)):
        finite(name, one)
        # Read while it is in the cache. It is a copy, checked again: another thread may have changed what was checked.
        points.append(finite(name, everywhere.take(read, axis=1)))
    clamped = _outside_by_row(surfaces, given, force, speed)
    if any(clamped):
        _warn_of_clamped(sum(clamped), force.size, surfaces)
    _native.render(inner, *points, seeds, update, threads, progress, made)
    if out is not None:
        return out
    return Samples.of(made, surfaces[0].rate, "acceleration", "m/s2", tuple(seeds), clamped)


def _outside_by_row(
    surfaces: list[Surface], given: list[np.ndarray], force: np.ndarray, speed: np.ndarray
) -> tuple[int, ...]:
    """Number of samples of each row above the largest force or speed of its surface."""
    limits = [min(one.max_force for one in surfaces), min(one.max_speed for one in surfaces)]
    # What is not broadcast is looked through first: once, and mostly in vain.
    if force.size == 0 or not any(one.max() > most * _ROUNDING for one, most in zip(given, limits)):
        return (0,) * len(force)
    each = surfaces * (len(force) if len(surfaces) == 1 else 1)
    return tuple(one._outside(*row) for one, *row in zip(each, force, speed))
