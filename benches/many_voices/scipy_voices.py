"""What 64 textures at once cost with haptograph and with NumPy and SciPy, on one core.

    pip install ./bindings/python scipy
    python benches/many_voices/scipy_voices.py

Both render the same work: 64 voices of a shipped surface (order 20, with its crackle and its high-pass) at 10 kHz, each along
a random walk of its own through speed and force, coefficients updated at 240 Hz.

The script in NumPy and SciPy is written to be fast: everything that can be is done for all voices and updates at once; only the filters
are run block by block, `scipy.signal.lfilter` with its state, as their coefficients change. lfilter knows no warped frequency axis: it gets the
same polynomials on the plain axis, which is less work. What both have in common is compared before anything is timed: the
coefficients and levels of every update.
"""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import time
from pathlib import Path

import haptograph as hg
import numpy as np
from scipy.signal import butter, lfilter, sosfilt
from scipy.spatial import Delaunay

VOICES, SECONDS, UPDATE_HZ, ROUNDS = 64, 4, 240.0, 5
SURFACE = Path(__file__).resolve().parents[2] / "graphs/surfaces/t2-canvas.ron"
# As the surface's file has them.
CRACKLE_DEPTH, CRACKLE_S, HIGHPASS_HZ = 0.06612613774368245, 0.02784832596115956, 20.0


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
    return 0.5 * (halves[0] + halves[1])


class Texture:
    """The map of a surface in NumPy."""

    def __init__(self, surface):
        self.rate = surface.rate
        self.places = np.array(surface.places())
        models = [surface.at(force=force, speed=speed) for speed, force in self.places]
        self.warping = models[0].warping
        self.lsf = np.array([lsf(model.ar) for model in models])
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


def render(texture, speed, force, seed):
    """Vibrations, a row each."""
    random = np.random.default_rng(seed)
    voices, samples = speed.shape
    every = texture.rate / UPDATE_HZ
    starts = np.ceil(np.arange(int(np.ceil(samples / every))) * every - 1e-9).astype(int)
    places = np.floor(np.arange(len(starts)) * every + 1e-9).astype(int)
    ar, deviation = texture.at(speed[:, places].ravel(), force[:, places].ravel())
    ar, deviation = ar.reshape(voices, len(starts), -1), deviation.reshape(voices, -1)
    ends = np.append(starts[1:], samples)
    excitation = random.standard_normal((voices, samples))
    kept = np.exp(-1 / (CRACKLE_S * texture.rate))
    z = lfilter([np.sqrt(1 - kept * kept)], [1, -kept], random.standard_normal((voices, samples)), axis=1)
    half = 0.5 * CRACKLE_DEPTH
    excitation *= np.exp(half * (z - half))
    excitation *= np.repeat(deviation, ends - starts, axis=1)
    out, one = np.empty_like(excitation), np.ones(1)
    blocks = list(zip(starts.tolist(), ends.tolist()))
    for voice in range(voices):
        state = np.zeros(ar.shape[2] - 1)
        for update, (start, end) in enumerate(blocks):
            out[voice, start:end], state = lfilter(one, ar[voice, update], excitation[voice, start:end], zi=state)
    highpass = butter(2, HIGHPASS_HZ, "highpass", fs=texture.rate, output="sos")
    return sosfilt(np.concatenate([highpass, highpass]), out, axis=1)


def walks(rate):
    """Speeds and forces of hands that explore without a plan."""
    random = np.random.default_rng(1)
    times = np.arange(int(SECONDS * rate)) / rate
    slow = np.arange(0, SECONDS + 1, 0.4)
    draw = lambda low, high: np.array([np.interp(times, slow, random.uniform(low, high, len(slow))) for _ in range(VOICES)])
    return draw(0.005, 0.17), draw(0.1, 2.8)


def main():
    surface = hg.Surface.load(SURFACE)
    texture = Texture(surface)
    speed, force = walks(surface.rate)
    ar, deviation = texture.at(speed[0, ::997], force[0, ::997])
    for row, v, f, sigma in zip(ar, speed[0, ::997], force[0, ::997], deviation):
        model = surface.at(force=f, speed=v)
        assert np.allclose(row[1:], model.ar, atol=1e-6), "the coefficients differ"
        assert np.isclose(sigma**2, model.variance, rtol=1e-6), "the levels differ"
    works = {
        "NumPy and SciPy": lambda: render(texture, speed, force, 1),
        "haptograph, one voice after the other": lambda: [surface.render(f, v) for f, v in zip(force, speed)],
        "haptograph, banks of 64": lambda: hg.render(surface, force, speed, threads=1),
    }
    times = {name: [] for name in works}
    for _ in range(ROUNDS):
        for name, work in works.items():
            began = time.process_time()
            work()
            times[name].append(time.process_time() - began)
    medians = {name: float(np.median(took)) / speed.size * 1e9 for name, took in times.items()}
    plain = medians["NumPy and SciPy"]
    for name, ns in medians.items():
        print(f"{name:40} {ns:7.1f} ns a voice and sample of processor time, {plain / ns:5.1f} times as fast as SciPy")


if __name__ == "__main__":
    main()
