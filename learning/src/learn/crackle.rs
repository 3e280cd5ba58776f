//! Detects and estimates crackle in whitened recordings.
//!
//! The logarithm of the whitened energy in windows of 5 ms fluctuates, as that of any noise does. Crackle adds fluctuation that
//! is correlated from window to window. Surrogates give the fluctuation without crackle: the same whitened recording with
//! random phases has the same spectrum, errors of the map included, but no crackle.

use super::whitening::Whitened;
use haptograph_signal::Complex64;
use haptograph_signal::fft;
use haptograph_surfaces::layers::crackle::{Crackle, MAX_DEPTH};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

/// Length of a window of energy, s, and the fewest samples in one.
const WINDOW_S: f64 = 0.005;
const MIN_WINDOW: usize = 4;
/// Length of the stretches whose phases are randomised, s, and most stretches used.
const STRETCH_S: f64 = 1.6;
const MAX_STRETCHES: usize = 8;
/// Fewest windows for an estimate.
const MIN_WINDOWS: usize = 64;
/// Lags of the autocovariance, in windows.
const LAGS: usize = 21;
/// Windows on each side of the moving mean that is removed: slower fluctuation follows from force and speed.
const SLOW: usize = 40;
/// Number of surrogates, and how many may exceed the recording: it must exceed the 99th percentile.
const SURROGATES: usize = 100;
const MAX_EXCEEDING: usize = 1;
const SEED: u64 = 0x6372_6163_6b6c_6521;
/// Candidate time constants, s.
const FASTEST_S: f64 = 0.002;
const SLOWEST_S: f64 = 0.05;
const TIME_STEPS: usize = 12;
const DEPTH_STEP: f64 = 0.1;

/// The crackle of whitened recordings at `rate_hz`; `None` if they do not exceed Gaussian noise of the same spectrum.
pub(super) fn find_crackle(recordings: &[Whitened], rate_hz: f64) -> Option<Crackle> {
    let samples: Vec<f64> = recordings.iter().flat_map(Whitened::dragged_samples).collect();
    let window = ((WINDOW_S * rate_hz).round() as usize).max(MIN_WINDOW);
    let longest = samples.len().min((STRETCH_S * rate_hz) as usize);
    // The next power of two, for speed, if there is enough for one.
    let power = (longest + 1).next_power_of_two();
    let length = if power <= samples.len() { power } else { power / 2 };
    if length < MIN_WINDOWS * window {
        return None;
    }
    let stretches = evenly(samples.len() / length, MAX_STRETCHES)
        .map(|k| &samples[k * length..(k + 1) * length])
        .collect::<Vec<_>>();
    let expected = Expected::new(window, rate_hz);
    let mut measured = Autocovariance::default();
    stretches.iter().for_each(|stretch| measured.add(stretch, window));
    let measured = measured.mean();
    let depth = expected.fit(&measured).depth;
    let gaussian = surrogates(&stretches, window, |covariance| expected.fit(covariance).depth >= depth)?;
    // The surrogates include the fluctuation from errors of the map.
    let white = &expected.rows[0].covariance;
    let corrected: [f64; LAGS] = std::array::from_fn(|lag| measured[lag] - gaussian[lag] + white[lag]);
    let found = expected.fit(&corrected);
    Crackle::new(found.depth.min(MAX_DEPTH), found.time_constant_s).ok()
}

/// Returns at most `most` of the numbers below `count`, evenly spread.
fn evenly(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let taken = count.min(most);
    (0..taken).map(move |k| k * count / taken)
}

/// The mean autocovariance of the surrogates; `None` if too many of them exceed the recording.
fn surrogates(
    stretches: &[&[f64]],
    window: usize,
    exceeds: impl Fn(&[f64; LAGS]) -> bool,
) -> Option<[f64; LAGS]> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let mut phases = Phases::new(stretches);
    let (mut sum, mut exceeding) = ([0.0; LAGS], 0);
    for _ in 0..SURROGATES / 2 {
        for covariance in phases.pair(window, &mut random) {
            exceeding += usize::from(exceeds(&covariance));
            if exceeding > MAX_EXCEEDING {
                return None;
            }
            for (sum, value) in sum.iter_mut().zip(covariance) {
                *sum += value / SURROGATES as f64;
            }
        }
    }
    Some(sum)
}

/// Makes surrogates two at a time: the real and the imaginary part of one transform.
struct Phases {
    /// Magnitudes of the stretches' spectra from 0 to half the rate.
    magnitudes: Vec<Vec<f64>>,
    turns: Vec<Complex64>,
    inverse: fft::Transform,
    buffer: Vec<Complex64>,
    scratch: Vec<Complex64>,
    part: Vec<f64>,
}

impl Phases {
    fn new(stretches: &[&[f64]]) -> Self {
        const TURNS: usize = 4096;
        let length = stretches.first().map_or(0, |stretch| stretch.len());
        let (forward, inverse) = (fft::forward(length), fft::inverse(length));
        let magnitudes = stretches.iter().map(|stretch| {
            let mut spectrum: Vec<Complex64> = stretch.iter().map(|e| Complex64::new(*e, 0.0)).collect();
            forward.process(&mut spectrum);
            let scale = 1.0 / length as f64;
            spectrum[..=length / 2].iter().map(|x| x.norm() * scale).collect()
        });
        let magnitudes = magnitudes.collect();
        let zero = Complex64::new(0.0, 0.0);
        Self {
            magnitudes,
            turns: (0..TURNS).map(|k| Complex64::cis(TAU * k as f64 / TURNS as f64)).collect(),
            scratch: vec![zero; inverse.get_inplace_scratch_len()],
            inverse,
            buffer: vec![zero; length],
            part: vec![0.0; length],
        }
    }

    fn pair(&mut self, window: usize, random: &mut Xoshiro256PlusPlus) -> [[f64; LAGS]; 2] {
        let mut both = [Autocovariance::default(), Autocovariance::default()];
        let length = self.buffer.len();
        for magnitudes in &self.magnitudes {
            self.buffer.fill(Complex64::new(0.0, 0.0));
            for (k, magnitude) in magnitudes.iter().enumerate().take(length.div_ceil(2)).skip(1) {
                let bits: u64 = random.random();
                let turn = |shift: u32| self.turns[(bits >> shift) as usize % self.turns.len()] * magnitude;
                let (a, b) = (turn(0), turn(32));
                // a + i b above zero and its mirror below: the real part is a's signal, the imaginary part b's.
                self.buffer[k] = Complex64::new(a.re - b.im, a.im + b.re);
                self.buffer[length - k] = Complex64::new(a.re + b.im, b.re - a.im);
            }
            self.inverse.process_with_scratch(&mut self.buffer, &mut self.scratch);
            for (part, covariance) in [|x: &Complex64| x.re, |x: &Complex64| x.im].iter().zip(&mut both) {
                self.part.clear();
                self.part.extend(self.buffer.iter().map(part));
                covariance.add(&self.part, window);
            }
        }
        both.map(|covariance| covariance.mean())
    }
}

/// Autocovariance of log energies whose slow part is taken out.
#[derive(Default)]
struct Autocovariance {
    sums: [f64; LAGS],
    counts: [usize; LAGS],
}

impl Autocovariance {
    fn add(&mut self, samples: &[f64], window: usize) {
        let mut logs: Vec<f64> = samples
            .chunks_exact(window)
            .map(|part| {
                let energy = part.iter().map(|e| e * e).sum::<f64>() / window as f64;
                energy.max(1e-30).ln()
            })
            .collect();
        take_slow_out(&mut logs);
        for (lag, (sum, count)) in self.sums.iter_mut().zip(&mut self.counts).enumerate() {
            let pairs = logs.iter().zip(logs.get(lag..).unwrap_or_default());
            *count += pairs.len();
            *sum += pairs.map(|(a, b)| a * b).sum::<f64>();
        }
    }

    fn mean(&self) -> [f64; LAGS] {
        std::array::from_fn(|lag| self.sums[lag] / self.counts[lag].max(1) as f64)
    }
}

/// Subtracts the mean over the neighbours, fewer of them at the ends.
fn take_slow_out(values: &mut [f64]) {
    let mut sums = vec![0.0];
    for value in &*values {
        sums.push(sums[sums.len() - 1] + value);
    }
    let count = values.len();
    for (n, value) in values.iter_mut().enumerate() {
        let reach = SLOW.min(n).min(count - 1 - n);
        *value -= (sums[n + reach + 1] - sums[n - reach]) / (2 * reach + 1) as f64;
    }
}

/// Autocovariances expected of crackle of many depths and time constants.
struct Expected {
    /// The first is that of no crackle.
    rows: Vec<Row>,
}

#[derive(Clone, Copy)]
struct Row {
    depth: f64,
    time_constant_s: f64,
    covariance: [f64; LAGS],
}

impl Expected {
    fn new(window: usize, rate_hz: f64) -> Self {
        let window_s = window as f64 / rate_hz;
        let mut rows = vec![Row {
            depth: 0.0,
            time_constant_s: FASTEST_S,
            covariance: expected(0.0, FASTEST_S, window, window_s),
        }];
        for step in 0..TIME_STEPS {
            let part = step as f64 / (TIME_STEPS - 1) as f64;
            let time_constant_s = FASTEST_S * (SLOWEST_S / FASTEST_S).powf(part);
            rows.extend((1..=(MAX_DEPTH / DEPTH_STEP).round() as usize).map(|k| {
                let depth = k as f64 * DEPTH_STEP;
                Row { depth, time_constant_s, covariance: expected(depth, time_constant_s, window, window_s) }
            }));
        }
        Self { rows }
    }

    /// The row nearest to `measured`, its depth refined between the rows; the first for no crackle.
    fn fit(&self, measured: &[f64; LAGS]) -> Row {
        let nearest = self.rows.iter().map(|row| (row, distance(row, measured)));
        let Some((best, _)) = nearest.min_by(|(_, a), (_, b)| a.total_cmp(b)) else {
            return self.rows[0];
        };
        let neighbour = |depth: f64| {
            let same = |row: &&Row| {
                row.time_constant_s == best.time_constant_s && (row.depth - depth).abs() < 0.5 * DEPTH_STEP
            };
            self.rows.iter().find(same).or_else(|| (depth.abs() < 0.5 * DEPTH_STEP).then(|| &self.rows[0]))
        };
        let sides = [best.depth - DEPTH_STEP, best.depth + DEPTH_STEP].map(neighbour);
        let mut refined = *best;
        if let ([Some(below), Some(above)], true) = (sides, best.depth > 0.0) {
            let [a, b, c] = [below, best, above].map(|row| distance(row, measured));
            let curvature = a - 2.0 * b + c;
            if curvature > 0.0 {
                refined.depth += DEPTH_STEP * (0.5 * (a - c) / curvature).clamp(-0.5, 0.5);
            }
        }
        refined
    }
}

fn distance(row: &Row, measured: &[f64; LAGS]) -> f64 {
    let pairs = row.covariance.iter().zip(measured);
    pairs.map(|(a, b)| (a - b).powi(2)).sum()
}

/// Autocovariance of the log energies of crackling white noise, the slow part taken out.
///
/// The energies' covariance is exact; that of their logarithms follows as if the energies were log-normal.
fn expected(depth: f64, time_constant_s: f64, window: usize, window_s: f64) -> [f64; LAGS] {
    /// Places within a window.
    const PARTS: i32 = 6;
    let variance = depth * depth;
    let energy = |lag: usize| {
        let mut sum = 0.0;
        for apart in 1 - PARTS..PARTS {
            let away_s = (lag as f64 + f64::from(apart) / f64::from(PARTS)).abs() * window_s;
            let weight = f64::from(PARTS - apart.abs()) / f64::from(PARTS * PARTS);
            sum += weight * (variance * (-away_s / time_constant_s).exp()).exp_m1();
        }
        let own = if lag == 0 { 2.0 * variance.exp() / window as f64 } else { 0.0 };
        (sum + own).ln_1p()
    };
    let width = 2 * SLOW + 1;
    let raw: Vec<f64> = (0..LAGS + width).map(energy).collect();
    // One minus the moving mean, twice: 1 - 2 box + box * box, whose weights are a triangle.
    std::array::from_fn(|lag| {
        let at = |shift: isize| raw[(lag as isize + shift).unsigned_abs().min(raw.len() - 1)];
        let slow = SLOW as isize;
        let mean: f64 = (-slow..=slow).map(at).sum::<f64>() / width as f64;
        let triangle = |shift: isize| (width as isize - shift.abs()) as f64 / (width * width) as f64;
        let both: f64 = (-2 * slow..=2 * slow).map(|shift| triangle(shift) * at(shift)).sum();
        raw[lag] - 2.0 * mean + both
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;
    use haptograph_surfaces::layers::LayerVoice;
    use haptograph_surfaces::layers::crackle::CrackleSource;

    const RATE_HZ: f64 = 10_000.0;

    fn whitened(samples: Vec<f64>) -> [Whitened; 1] {
        let dragged = vec![true; samples.len()];
        [Whitened { samples, dragged }]
    }

    /// Ten seconds of what is left where the map is off: noise of which neighbours are correlated, its level swaying slowly.
    fn misfit(seed: u64) -> Vec<f64> {
        let mut noise = Gaussian::new(seed);
        let (mut last, mut before) = (0.0, 0.0);
        let sample = |n: usize| {
            let y = noise.next_sample() + 0.6 * last - 0.3 * before;
            (before, last) = (last, y);
            y * (1.0 + 0.3 * (TAU * 0.4 * n as f64 / RATE_HZ).sin())
        };
        (0..100_000).map(sample).collect()
    }

    fn crackling(depth: f64, time_constant_s: f64, seed: u64) -> Vec<f64> {
        let mut samples = misfit(seed);
        let crackle = Crackle::new(depth, time_constant_s).expect("in range");
        CrackleSource::new(crackle, RATE_HZ, seed + 1000).process(&mut samples);
        samples
    }

    #[test]
    fn depth_and_time_constant_come_back() {
        for (depth, time_constant_s) in [(0.4, 0.004), (0.8, 0.01), (1.2, 0.02)] {
            let found = find_crackle(&whitened(crackling(depth, time_constant_s, 5)), RATE_HZ);
            let found = found.expect("it crackles");
            let off = (found.depth() / depth, found.time_constant_s() / time_constant_s);
            assert!((off.0 - 1.0).abs() < 0.15, "{found:?} for {depth}");
            assert!((0.65..1.5).contains(&off.1), "{found:?} for {time_constant_s}");
        }
    }

    #[test]
    fn gaussian_noise_does_not_crackle_whatever_its_spectrum() {
        let found = (0..6).filter(|seed| find_crackle(&whitened(misfit(*seed)), RATE_HZ).is_some());
        assert!(found.count() <= 1);
    }

    #[test]
    fn too_little_tells_nothing() {
        let samples = crackling(1.0, 0.01, 1)[..3000].to_vec();
        assert_eq!(find_crackle(&whitened(samples), RATE_HZ), None);
        assert_eq!(find_crackle(&whitened(vec![]), RATE_HZ), None);
    }
}
