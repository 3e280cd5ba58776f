// Power spectral density of real signals: fast Fourier transform, Hann window, averages of half-overlapped pieces.

// A transform of `size` (a power of two), with its tables.
class Fourier {
    constructor(size) {
        this.size = size;
        this.cosine = Float64Array.from({ length: size / 2 }, (_, i) => Math.cos((2 * Math.PI * i) / size));
        this.sine = Float64Array.from({ length: size / 2 }, (_, i) => Math.sin((2 * Math.PI * i) / size));
    }

    // In place, radix 2, decimation in time.
    run(re, im) {
        const n = this.size;
        for (let i = 1, j = 0; i < n; i++) {
            let bit = n >> 1;
            for (; j & bit; bit >>= 1) j ^= bit;
            j ^= bit;
            if (i < j) [re[i], re[j], im[i], im[j]] = [re[j], re[i], im[j], im[i]];
        }
        for (let half = 1; half < n; half *= 2) {
            const stride = n / (2 * half);
            for (let start = 0; start < n; start += 2 * half) {
                for (let k = 0, i = start; k < half; k++, i++) {
                    const c = this.cosine[k * stride],
                        s = -this.sine[k * stride];
                    const [a, b] = [re[i + half] * c - im[i + half] * s, re[i + half] * s + im[i + half] * c];
                    re[i + half] = re[i] - a;
                    im[i + half] = im[i] - b;
                    re[i] += a;
                    im[i] += b;
                }
            }
        }
    }
}

const transforms = new Map();

function transformOf(size) {
    if (!transforms.has(size)) transforms.set(size, new Fourier(size));
    return transforms.get(size);
}

// One-sided density, unit squared per hertz, at i * rate_hz / size for i up to size / 2, of one piece of `size` samples.
export function density(samples, rate_hz) {
    const size = samples.length;
    const re = new Float64Array(size),
        im = new Float64Array(size);
    let power = 0;
    for (let i = 0; i < size; i++) {
        const window = 0.5 - 0.5 * Math.cos((2 * Math.PI * i) / size);
        power += window * window;
        re[i] = samples[i] * window;
    }
    transformOf(size).run(re, im);
    const out = new Float64Array(size / 2 + 1);
    for (let i = 0; i < out.length; i++) {
        const sides = i === 0 || i === size / 2 ? 1 : 2;
        out[i] = (sides * (re[i] * re[i] + im[i] * im[i])) / (rate_hz * power);
    }
    return out;
}
