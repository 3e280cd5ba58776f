"""What 64 textures at once cost with haptograph and with NumPy and SciPy, on one core.

    pip install ./bindings/python scipy
    python benches/many_voices/scipy_voices.py

Both render the same work: 64 voices of a surface of order 20 at 10 kHz, each along a random walk of its own through speed and
force, coefficients updated at 240 Hz. One surface is learned by the thesis's method: noise through a filter on the plain frequency
axis, the same arithmetic on both sides. The other one is shipped, with its grain and its high-pass.

The script in NumPy and SciPy is written to be fast: everything that can be is done for all voices and updates at once. The filters, whose
coefficients change, are run in two ways:

- by blocks: `scipy.signal.lfilter` with its state, a voice and an update a call. This is what people write, and what the bar is against: banks
  of 64 are at least 20 times as fast.
- by samples: all voices at once, a sample a step, in NumPy alone. It needs as many voices as this to pay, and then is the fastest in Python.

Both, and haptograph, are run twice: with new arrays in each round, and with arrays that are kept from round to round as far as the functions take
them, which saves the time in which the system clears memory.

Neither knows the warped frequency axis of the shipped surface: they get the same polynomials on the plain axis, a quarter of the arithmetic.
What all have in common
is compared before anything is timed: the coefficients and levels of updates, and both ways with each other where coefficients stay.
"""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import re
import tempfile
import time
from pathlib import Path

import haptograph as hg
import numpy as np
from scipy.signal import butter, lfilter, sosfilt
from scipy.spatial import Delaunay

VOICES, SECONDS, UPDATE_HZ, ROUNDS = 64, 4, 240.0, 5
ROOT = Path(__file__).resolve().parents[2]


def lsf(ar):
    """Line spectral frequencies of 1 + sum a_k z^-k."""
    a = np.concatenate([[1.0], ar, [0.0]])
    found = []
    for sign, known in ((1, [1, 1]), (-1, [1, -1])):
        polynomial = np.polydiv(a + sign * a[::-1], known)[0]
        found += [angle for angle in np.angle(np.roots(polynomial)) if angle > 0]
    return np.sort(found)


def polynomials(frequencies):
    """Coefficients of many sets of line spectral frequencies, one a row."""
    b = -2 * np.cos(frequencies)
    halves = []
    for first, sign in ((0, 1.0), (1, -1.0)):
        product = np.ones((len(b), 1))
        for k in range(first, b.shape[1], 2):
            longer = np.pad(product, ((0, 0), (0, 2)))
            longer[:, 1:-1] += b[:, k, None] * product
            longer[:, 2:] += product
            product = longer
        halves.append(np.pad(product, ((0, 0), (0, 1))) + sign * np.pad(product, ((0, 0), (1, 0))))
    # The last coefficients of both cancel.
    return 0.5 * (halves[0] + halves[1])[:, :-1]


class Texture:
    """The map of a surface in NumPy."""

    def __init__(self, surface):
        self.rate = surface.rate
        with tempfile.TemporaryDirectory() as folder:
            surface.save(Path(folder) / "surface.ron")
            text = (Path(folder) / "surface.ron").read_text()
        number = lambda name: next((float(found) for found in re.findall(rf"\b{name}: ([0-9.e-]+)", text)), None)
        numbers = lambda name: [float(part) for found in re.findall(rf"\b{name}: \[([^]]*)\]", text)[:1] for part in found.split(",") if part.strip()]
        self.octave_shares, self.gain_db = numbers("octave_shares"), np.array(numbers("gain_db"))
        self.highpass_hz = number("highpass_hz")
        self.places = surface.places
        models = [surface.at(force=force, speed=speed) for speed, force in self.places]
        self.warping = models[0].warping or 0.0
        self.lsf = np.array([lsf(model.ar) for model in models])
        self.variance = np.array([model.variance for model in models])
        self.amplitude = np.sqrt([model.variance * gain(model.ar, self.warping) for model in models])
        scale = self.places.std(axis=0)
        self.scale = scale
        self.map = Delaunay(self.places / scale)

    def at(self, speed, force):
        """Coefficients and deviations at many speeds and forces."""
        most = self.places.max(axis=0)
        points = np.stack([np.clip(speed, 0, most[0]), np.clip(force, 0, most[1])], axis=1)
        where = points / self.scale
        triangle = self.map.find_simplex(where, tol=1e-9)
        transform = self.map.transform[triangle]
        two = np.einsum("nij,nj->ni", transform[:, :2], where - transform[:, 2])
        weights = np.column_stack([two, 1 - two.sum(axis=1)])
        models = self.map.simplices[triangle]
        ar = polynomials(np.einsum("nk,nkp->np", weights, self.lsf[models]))
        if not self.warping:
            # The thesis's kind of surface.
            return ar, np.sqrt(np.einsum("nk,nk->n", weights, self.variance[models]))
        amplitude = np.einsum("nk,nk->n", weights, self.amplitude[models])
        return ar, amplitude / np.sqrt(gain(ar[:, 1:], self.warping))


def gain(ar, warping):
    """Power of white noise after the warped filter: (1 - l^2) / prod(1 - k^2), of one model or of many."""
    rows = np.atleast_2d(ar)
    a = np.pad(rows, ((0, 0), (0, 1)))
    a[:, 1:] += warping * rows
    a[:, 0] += warping
    share = np.ones(len(a))
    for order in range(a.shape[1], 0, -1):
        k = a[:, order - 1 : order]
        share *= 1 - k[:, 0] ** 2
        a = (a[:, : order - 1] - k * a[:, : order - 1][:, ::-1]) / (1 - k * k)
    power = (1 - warping**2) / share
    return power if np.ndim(ar) == 2 else power[0]


def by_blocks(ar, excitation, blocks, out):
    """Each voice by itself, each update by a call of lfilter."""
    one = np.ones(1)
    for voice in range(len(excitation)):
        state = np.zeros(ar.shape[2] - 1)
        for update, (start, end) in enumerate(blocks):
            out[voice, start:end], state = lfilter(one, ar[voice, update], excitation[voice, start:end], zi=state)
    return out


def by_samples(ar, excitation, blocks, out):
    """All voices at once, a sample a step."""
    order, (voices, samples) = ar.shape[2] - 1, excitation.shape
    excitation, filtered = np.ascontiguousarray(excitation.T), np.zeros((order + samples, voices))
    products, fed_back = np.empty((order, voices)), np.empty(voices)
    for update, (start, end) in enumerate(blocks):
        backwards = np.ascontiguousarray(ar[:, update, :0:-1].T)
        for sample in range(start, end):
            np.multiply(backwards, filtered[sample : sample + order], products)
            np.add.reduce(products, axis=0, out=fed_back)
            np.subtract(excitation[sample], fed_back, filtered[order + sample])
    np.copyto(out, filtered[order:].T)
    return out


def grain(texture, random, voices, samples):
    """The gain of the excitation: a curve over a sum of resonators, once a millisecond, and linear between."""
    every = max(1, round(texture.rate / 1000))
    rate, ticks = texture.rate / every, samples // every + 2
    z = np.zeros((voices, ticks))
    for octave, share in enumerate(texture.octave_shares):
        turn = 2 * np.pi * min(2.0 * 2**octave, 0.4 * rate) / rate
        g = 1 / (1 + np.tan(turn / 4))
        one, other = random.standard_normal((2, voices, 1))
        settled = np.sqrt(g) * np.concatenate([one, np.sin(turn) * other - np.cos(turn) * one], axis=1)
        b, a = np.sqrt(1 - g) * np.array([1, 0, -1]), [1, -2 * g * np.cos(turn), 2 * g - 1]
        z += np.sqrt(share) * lfilter(b, a, random.standard_normal(z.shape), axis=1, zi=settled)[0]
    points, steps = np.linspace(-2.6, 2.6, len(texture.gain_db)), np.linspace(-7, 7, 281)
    gains = 10 ** (texture.gain_db / 20)
    weights = np.exp(-0.5 * steps**2)
    gains /= np.sqrt(np.average(np.interp(steps, points, gains) ** 2, weights=weights))
    gains, place = np.interp(z, points, gains), np.arange(samples)
    last, part = place // every, place % every / every
    return gains[:, last] * (1 - part) + gains[:, last + 1] * part


def render(texture, speed, force, seed, filtered, kept=None):
    """Vibrations, a row each; `kept` are three arrays of the same shape that may be overwritten."""
    random = np.random.default_rng(seed)
    voices, samples = speed.shape
    excitation, level, out = (np.empty(speed.shape) for _ in range(3)) if kept is None else kept
    every = texture.rate / UPDATE_HZ
    starts = np.ceil(np.arange(int(np.ceil(samples / every))) * every - 1e-9).astype(int)
    places = np.floor(np.arange(len(starts)) * every + 1e-9).astype(int)
    ar, deviation = texture.at(speed[:, places].ravel(), force[:, places].ravel())
    ar, deviation = ar.reshape(voices, len(starts), -1), deviation.reshape(voices, -1)
    ends = np.append(starts[1:], samples)
    random.standard_normal(out=excitation)
    if texture.octave_shares:
        excitation *= grain(texture, random, voices, samples)
    excitation *= deviation.take(np.repeat(np.arange(len(starts)), ends - starts), axis=1, out=level, mode="clip")
    out = filtered(ar, excitation, list(zip(starts.tolist(), ends.tolist())), out)
    if texture.highpass_hz is None:
        return out
    highpass = butter(2, texture.highpass_hz, "highpass", fs=texture.rate, output="sos")
    return sosfilt(np.concatenate([highpass, highpass]), out, axis=1)


def walks(rate, places):
    """Speeds and forces of hands that explore without a plan, on straight lines from model to model."""
    random = np.random.default_rng(1)
    times = np.arange(int(SECONDS * rate)) / rate
    slow = np.arange(0, SECONDS + 1, 0.4)
    known = places[(places > 0).all(axis=1)]
    stops = known[random.integers(len(known), size=(VOICES, len(slow)))]
    return tuple(np.array([np.interp(times, slow, stop[:, axis]) for stop in stops]) for axis in (0, 1))


def edges(texture):
    """Speeds and forces at the models and on edges between them. In a grid of models it is open which diagonal of a cell a triangulation
    takes, so that only the sides of cells are edges for sure."""
    known = (texture.places[texture.map.simplices] > 0).all(axis=(1, 2))
    ends = texture.places[texture.map.simplices[known][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)]
    sides = (ends[:, 0] == ends[:, 1]).any(axis=1)
    if sides.sum() > len(ends) / 4:
        ends = ends[sides]
    parts = np.random.default_rng(3).uniform(size=(len(ends), 1))
    return np.concatenate([ends[:, 0], parts * ends[:, 0] + (1 - parts) * ends[:, 1]]).T


def main():
    shipped = hg.Surface.load(ROOT / "graphs/surfaces/t2-canvas.ron")
    print("a surface that the thesis's method learns from the shipped one")
    times = np.arange(int(20 * shipped.rate)) / shipped.rate
    speed, force = 0.09 + 0.07 * np.sin(2 * np.pi * 0.37 * times), 1.2 + 0.8 * np.sin(2 * np.pi * 0.53 * times)
    recording = hg.Recording(shipped.render(force, speed), force, speed, rate=shipped.rate, source="a rendering")
    compare(hg.learn(recording, method="thesis", order=20))
    print("the shipped surface: warped, with its grain and its high-pass")
    compare(shipped)


def compare(surface):
    texture = Texture(surface)
    speed, force = walks(surface.rate, texture.places)
    at_speed, at_force = edges(texture)
    ar, deviation = texture.at(at_speed, at_force)
    for row, v, f, sigma in zip(ar, at_speed, at_force, deviation):
        model = surface.at(force=f, speed=v)
        assert np.allclose(row[1:], model.ar, atol=1e-6), "the coefficients differ"
        assert np.isclose(sigma**2, model.variance, rtol=1e-6), "the levels differ"
    steady, noise = np.stack([ar[:2], ar[:2]], axis=1), np.random.default_rng(2).standard_normal((2, 300))
    halves = [(0, 150), (150, 300)]
    blocks, samples = (way(steady, noise, halves, np.empty(noise.shape)) for way in (by_blocks, by_samples))
    assert np.allclose(blocks, samples), "the filters differ"
    kept = [np.empty(speed.shape) for _ in range(3)]
    works = {
        "SciPy by blocks": lambda: render(texture, speed, force, 1, by_blocks),
        "SciPy by blocks, arrays kept": lambda: render(texture, speed, force, 1, by_blocks, kept),
        "NumPy by samples": lambda: render(texture, speed, force, 1, by_samples),
        "haptograph, one voice after the other": lambda: [surface.render(f, v) for f, v in zip(force, speed)],
        "haptograph, banks of 64": lambda: hg.render(surface, force, speed, threads=1),
        "haptograph, banks of 64, array kept": lambda: hg.render(surface, force, speed, threads=1, out=kept[2]),
    }
    times = {name: [] for name in works}
    for _ in range(ROUNDS):
        for name, work in works.items():
            began = time.process_time()
            work()
            times[name].append(time.process_time() - began)
    medians = {name: float(np.median(took)) / speed.size * 1e9 for name, took in times.items()}
    blocks, samples = (
        min(ns for name, ns in medians.items() if name.startswith(way)) for way in ("SciPy by blocks", "NumPy by samples")
    )
    for name, ns in medians.items():
        ratios = f"{blocks / ns:5.1f} times as fast as SciPy by blocks, {samples / ns:5.1f} as NumPy by samples"
        print(f"{name:40} {ns:7.1f} ns a voice and sample of processor time, {ratios}")


if __name__ == "__main__":
    main()
