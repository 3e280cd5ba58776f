//! Detects grain in whitened recordings, and fits it.
//!
//! The whitened recording, its slow level taken out, is filtered by the law at its middle speed and force: what a hand would
//! feel at that place. There grain shows in the levels of 5 ms, which vary more than those of surrogates: the same spectrum with
//! random phases. The fit renders grain through the same filter again and again, and corrects the shares of its octaves by the
//! spectrum of the 2 ms envelope, and its curve by the quantiles of the levels.

use super::whitening::Whitened;
use crate::metrics::level::excess_kurtosis;
use crate::recording::ProcessedRecording;
use haptograph_signal::filter::Sections;
use haptograph_signal::noise::Gaussian;
use haptograph_signal::spectrum::welch;
use haptograph_signal::statistics::{mean, median, standard_deviation};
use haptograph_signal::warped::unwarp;
use haptograph_signal::window::Window;
use haptograph_signal::{Complex64, fft};
use haptograph_surfaces::TextureModel;
use haptograph_surfaces::interpolation::{Coefficients, Interpolator};
use haptograph_surfaces::layers::LayerVoice;
use haptograph_surfaces::layers::grain::{Grain, GrainSource, OCTAVES_HZ, POINTS};
use std::f64::consts::{SQRT_2, TAU};

/// Lowest rate of a recording, Hz, and of the fit, above which rates are divided by a whole number.
const LOWEST_RATE_HZ: f64 = 1000.0;
const FIT_RATE_HZ: f64 = 4000.0;
/// Shortest and longest stretch, s, and most stretches. Their lengths are multiples, for fast transforms.
const SHORTEST_S: f64 = 0.5;
const LONGEST_S: f64 = 5.0;
const MAX_STRETCHES: usize = 8;
const MULTIPLE: usize = 500;
/// Windows of the levels, s, and deviations of the Gaussian over which the slow level is averaged, in windows.
const WINDOW_S: f64 = 0.005;
const SLOW: f64 = 50.0;
/// Windows of the envelope, and of its spectrum, s.
const ENVELOPE_S: f64 = 0.002;
const SPECTRUM_S: f64 = 1.0;
/// Windows of which a level is taken to be compared with the next, and pairs of surrogates.
const SCALES: [usize; 3] = [1, 4, 16];
const SURROGATES: usize = 10;
/// By how many of the surrogates' deviations a recording with grain exceeds them.
const EXCESS: f64 = 4.0;
/// Rounds of the fit, and pairs of renderings in each.
const ROUNDS: usize = 12;
const RENDERINGS: u64 = 2;
const SEED: u64 = 0x67_7261_696e;
/// Parts of a normal distribution below the points of the curve.
const BELOW: [f64; POINTS] = [
    0.004_661, 0.012_119, 0.028_282, 0.059_380, 0.112_501, 0.193_062, 0.301_532, 0.431_195, 0.568_805,
    0.698_468, 0.806_938, 0.887_499, 0.940_620, 0.971_718, 0.987_881, 0.995_339,
];
const OCTAVES: usize = OCTAVES_HZ.len();

/// The law at the middle speed and force of a recording.
pub(super) struct Middle {
    filter: Coefficients,
    warping: f64,
    pub(super) rate_hz: f64,
    highpass: Option<Sections>,
}

impl Middle {
    pub(super) fn of(
        recordings: &[ProcessedRecording],
        whitened: &[Whitened<'_>],
        texture: &TextureModel,
    ) -> Self {
        let middle = |of: fn(&ProcessedRecording) -> &[f64]| {
            let values = recordings.iter().zip(whitened).flat_map(|(recording, whitened)| {
                let both = of(recording).iter().zip(whitened.dragged()).step_by(64);
                both.filter(|(_, dragged)| *dragged).map(|(value, _)| *value)
            });
            median(&values.collect::<Vec<f64>>())
        };
        let speed_m_s = middle(|recording| &recording.signals().speed_m_s);
        let force_n = middle(|recording| &recording.signals().force_normal_n);
        let mut filter = Coefficients::SILENCE;
        Interpolator::new(texture).interpolate(speed_m_s, force_n, &mut filter);
        Self {
            filter,
            warping: texture.warping(),
            rate_hz: texture.rate_hz(),
            highpass: texture.output_highpass(),
        }
    }

    /// The responses of its filter, without and with the high-pass.
    pub(super) fn response(&self, frequency_hz: f64) -> [Complex64; 2] {
        let delay = Complex64::cis(-unwarp(TAU * frequency_hz / self.rate_hz, -self.warping));
        let ar = self.filter.ar().iter().rev();
        let law = 1.0 / (ar.fold(Complex64::default(), |sum, a| (sum + a) * delay) + 1.0);
        let highpass = self.highpass.as_ref();
        [law, highpass.map_or(law, |high| law * high.response(frequency_hz, self.rate_hz))]
    }
}

/// Whitened recordings that vary more than Gaussian noise of the same spectrum; `None` if they do not, are shorter than 0.5 s, or
/// have a rate below 1 kHz.
pub(super) fn grained(whitened: &[Whitened<'_>], middle: &Middle) -> Option<Fit> {
    let samples = stretched(whitened, middle.rate_hz);
    let fit = Fit::new(&samples, middle.rate_hz, |frequency_hz| middle.response(frequency_hz))?;
    fit.is_grained().then_some(fit)
}

/// The samples at which the tool was dragged, one after the other; of many those of the stretches that [`Fit::new`] takes.
fn stretched(whitened: &[Whitened<'_>], rate_hz: f64) -> Vec<f64> {
    let every = (rate_hz / FIT_RATE_HZ).max(1.0) as usize;
    let whole = (LONGEST_S * (rate_hz / every as f64)) as usize / MULTIPLE * MULTIPLE * every;
    let runs: Vec<_> =
        whitened.iter().flat_map(|of| of.runs().into_iter().map(move |run| (of, run))).collect();
    let count: usize = runs.iter().map(|(_, run)| run.len()).sum();
    let (mut samples, mut begun) = (vec![], 0);
    for (of, run) in runs {
        let end = begun + run.len();
        let stretches = (0..MAX_STRETCHES).map(|k| match count > MAX_STRETCHES * whole {
            true => {
                k * (count - whole) / (MAX_STRETCHES - 1)..k * (count - whole) / (MAX_STRETCHES - 1) + whole
            }
            false => k * whole..(k + 1) * whole,
        });
        for stretch in stretches {
            let (from, to) = (stretch.start.clamp(begun, end), stretch.end.clamp(begun, end));
            samples.extend_from_slice(&of.samples(run.start + from - begun..run.start + to - begun));
        }
        begun = end;
    }
    samples
}

/// A recording to which grain is fitted, and what renders it.
pub(super) struct Fit {
    rate_hz: f64,
    /// Stretches of the recording as it is whitened, and after the law's filter.
    whitened: Vec<Vec<f64>>,
    recorded: Vec<Vec<f64>>,
    /// Response of the law's filter with the high-pass, as long as a stretch.
    response: Vec<Complex64>,
    transforms: [fft::Transform; 2],
}

impl Fit {
    /// `response` gives those of the law's filter, without and with the high-pass. `None` for too little of a recording.
    fn new(samples: &[f64], rate_hz: f64, response: impl Fn(f64) -> [Complex64; 2]) -> Option<Self> {
        let every = (rate_hz / FIT_RATE_HZ).max(1.0) as usize;
        let fit_hz = rate_hz / every as f64;
        let length = (LONGEST_S * fit_hz).min((samples.len() / every) as f64) as usize / MULTIPLE * MULTIPLE;
        if rate_hz < LOWEST_RATE_HZ || (length as f64) < SHORTEST_S * fit_hz {
            return None;
        }
        let bins = (0..length).map(|bin| {
            let [law, whole] = response(bin.min(length - bin) as f64 * fit_hz / length as f64);
            // Without its negative frequencies the recording is the real part of a complex signal.
            let kept = f64::from(2 * bin <= length);
            (Complex64::new(kept, 0.0), law * kept, if kept > 0.0 { whole } else { whole.conj() })
        });
        let (all, law, response): (Vec<_>, Vec<_>, Vec<_>) = bins.collect();
        let transforms = [fft::forward(length), fft::inverse(length)];
        let whole = length * every;
        let forward = fft::forward(whole);
        let count = samples.len().div_ceil(whole).min(MAX_STRETCHES);
        let stretches = (0..count).map(|k| {
            let start = k * (samples.len() - whole) / (count - 1).max(1);
            let level = without_slow_level(&samples[start..start + whole], rate_hz);
            let mut spectrum: Vec<Complex64> = level.into_iter().map(|e| Complex64::new(e, 0.0)).collect();
            forward.process(&mut spectrum);
            let [e, y] = [&all, &law].map(|by| {
                let mut filtered: Vec<_> =
                    spectrum.iter().zip(by).map(|(x, response)| x * response).collect();
                transforms[1].process(&mut filtered);
                filtered.iter().map(|y| y.re).collect()
            });
            (e, y)
        });
        let (whitened, recorded) = stretches.unzip();
        Some(Self { rate_hz: fit_hz, whitened, recorded, response, transforms })
    }

    fn is_grained(&self) -> bool {
        [&self.whitened, &self.recorded].into_iter().any(|of| self.exceeds_surrogates(of))
    }

    /// The grain that is nearest.
    pub(super) fn grain(&self) -> Option<Grain> {
        let recorded = means(self.recorded.iter().map(|y| measured(y, self.rate_hz)));
        let mut shares = [1.0 / OCTAVES as f64; OCTAVES];
        let mut curve_db: [f64; POINTS] = std::array::from_fn(|point| recorded[OCTAVES + point]);
        let rounds = (0..ROUNDS).map(|round| {
            let grain = rounded(shares, &curve_db)?;
            let rendered = (0..RENDERINGS).flat_map(|pair| self.rendered(&grain, pair));
            let rendered = means(rendered.map(|y| measured(&y, self.rate_hz)));
            let step = if round < ROUNDS / 2 { 1.0 } else { 0.6 };
            let off: Vec<f64> = recorded.iter().zip(rendered).map(|(to, from)| step * (to - from)).collect();
            correct(&off, &mut shares, &mut curve_db);
            Some((distance(&rendered, &recorded), grain))
        });
        rounds.flatten().min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, grain)| grain)
    }

    /// Two renderings.
    fn rendered(&self, grain: &Grain, pair: u64) -> [Vec<f64>; 2] {
        let modulated = [2 * pair, 2 * pair + 1].map(|number| {
            let mut noise = vec![0.0; self.response.len()];
            Gaussian::new(!SEED - number).fill(&mut noise);
            GrainSource::new(grain, self.rate_hz, SEED + number).process(&mut noise);
            noise
        });
        let both = modulated[0].iter().zip(&modulated[1]);
        let mut both: Vec<_> = both.map(|(a, b)| Complex64::new(*a, *b)).collect();
        self.transforms[0].process(&mut both);
        both.iter_mut().zip(&self.response).for_each(|(x, response)| *x *= response);
        self.parts(both)
    }

    /// The real and the imaginary part of the signal with this spectrum.
    fn parts(&self, mut spectrum: Vec<Complex64>) -> [Vec<f64>; 2] {
        self.transforms[1].process(&mut spectrum);
        [|y: &Complex64| y.re, |y: &Complex64| y.im].map(|part| spectrum.iter().map(part).collect())
    }

    /// True if levels vary more from one to the next than those of noise of the same spectrum.
    fn exceeds_surrogates(&self, stretches: &[Vec<f64>]) -> bool {
        let spectra = stretches.iter().map(|y| {
            let mut spectrum: Vec<_> = y.iter().map(|y| Complex64::new(*y, 0.0)).collect();
            self.transforms[0].process(&mut spectrum);
            spectrum.iter().map(|x| x.norm_sqr().sqrt()).collect()
        });
        let magnitudes: Vec<Vec<f64>> = spectra.collect();
        let (mut noise, mut random) = (Gaussian::new(SEED), Vec::new());
        for _ in 0..SURROGATES {
            let both = magnitudes.iter().map(|magnitudes| self.surrogates(magnitudes, &mut noise));
            let both: Vec<[Vec<f64>; 2]> = both.collect();
            random.extend([0, 1].map(|k| means(both.iter().map(|both| variations(&both[k], self.rate_hz)))));
        }
        let recorded = means(stretches.iter().map(|y| variations(y, self.rate_hz)));
        (0..SCALES.len()).any(|scale| {
            let of: Vec<f64> = random.iter().map(|one| one[scale]).collect();
            recorded[scale] > mean(&of) + EXCESS * standard_deviation(&of)
        })
    }

    /// Two signals with these magnitudes of the spectrum and random phases: the real and the imaginary part of one transform.
    fn surrogates(&self, magnitudes: &[f64], noise: &mut Gaussian) -> [Vec<f64>; 2] {
        let length = magnitudes.len();
        let mut both = vec![Complex64::default(); length];
        for k in 1..length.div_ceil(2) {
            let [a, b] = [(); 2].map(|()| {
                let turn = Complex64::new(noise.next_sample(), noise.next_sample());
                turn * (magnitudes[k] / turn.norm_sqr().max(f64::MIN_POSITIVE).sqrt())
            });
            // a + i b above zero and its mirror below: the real part is a's signal, the imaginary part b's.
            both[k] = Complex64::new(a.re - b.im, a.im + b.re);
            both[length - k] = Complex64::new(a.re + b.im, b.re - a.im);
        }
        self.parts(both)
    }
}

fn means<const N: usize>(all: impl Iterator<Item = [f64; N]>) -> [f64; N] {
    let all: Vec<[f64; N]> = all.collect();
    std::array::from_fn(|k| all.iter().map(|one| one[k]).sum::<f64>() / all.len() as f64)
}

fn energies(samples: &[f64], window: usize) -> impl Iterator<Item = f64> + '_ {
    let energy = move |part: &[f64]| part.iter().map(|y| y * y).sum::<f64>() / window as f64;
    samples.chunks_exact(window).map(move |part| energy(part).max(f64::MIN_POSITIVE))
}

/// Divides by the level that is left of the map's errors: the mean logarithm of the energies over a quarter of a second.
fn without_slow_level(samples: &[f64], rate_hz: f64) -> Vec<f64> {
    let window = ((WINDOW_S * rate_hz) as usize).max(1);
    let reach = (3.0 * SLOW) as usize;
    let logs: Vec<f64> = energies(samples, window).map(f64::ln).collect();
    let weights: Vec<f64> = (0..=reach).map(|apart| (-0.5 * (apart as f64 / SLOW).powi(2)).exp()).collect();
    let level = |at: usize| {
        let near = at.saturating_sub(reach)..logs.len().min(at + reach + 1);
        let sums = near.map(|n| (weights[n.abs_diff(at)], logs[n]));
        let (weights, sum) =
            sums.fold((0.0, 0.0), |(all, sum), (weight, log)| (all + weight, sum + weight * log));
        (-0.5 * sum / weights).exp()
    };
    let levels: Vec<f64> = (0..logs.len()).map(level).collect();
    samples.iter().enumerate().map(|(n, e)| e * levels[(n / window).min(levels.len() - 1)]).collect()
}

/// Half the mean square of how the logarithm of the energy changes from one stretch of windows to the next.
fn variations(samples: &[f64], rate_hz: f64) -> [f64; SCALES.len()] {
    let windows: Vec<f64> = energies(samples, (WINDOW_S * rate_hz) as usize).collect();
    SCALES.map(|scale| {
        let logs: Vec<f64> = windows.chunks_exact(scale).map(|part| mean(part).ln()).collect();
        mean(&logs.windows(2).map(|pair| 0.5 * (pair[1] - pair[0]).powi(2)).collect::<Vec<f64>>())
    })
}

/// What the fit compares of a vibration, its power taken out: the power of each octave of the 2 ms envelope over its mean, dB;
/// the quantiles of the levels in 5 ms for the points of the curve, dB; and the binary logarithm of the excess kurtosis and 1,
/// without the highest of a thousand samples.
type Measures = [f64; OCTAVES + POINTS + 1];

fn measured(vibration: &[f64], rate_hz: f64) -> Measures {
    let window = ((ENVELOPE_S * rate_hz).round() as usize).max(2);
    let mut envelope: Vec<f64> = energies(vibration, window).map(f64::sqrt).collect();
    let middle = mean(&envelope);
    envelope.iter_mut().for_each(|level| *level = *level / middle - 1.0);
    let envelope_hz = rate_hz / window as f64;
    let segment = envelope.len().min((SPECTRUM_S * envelope_hz) as usize);
    let spectrum = welch(&envelope, envelope_hz, segment, segment / 2, Window::Hann);
    let octave = |middle_hz: f64| {
        let power =
            spectrum.as_ref().map_or(0.0, |of| of.power_between(middle_hz / SQRT_2, middle_hz * SQRT_2));
        10.0 * (power + 1e-12).log10()
    };
    let power = mean(&energies(vibration, vibration.len()).collect::<Vec<f64>>());
    let levels = energies(vibration, (WINDOW_S * rate_hz) as usize);
    let mut levels: Vec<f64> = levels.map(|energy| 10.0 * (energy / power).log10()).collect();
    levels.sort_by(f64::total_cmp);
    let quantile = |part: f64| levels[(part * (levels.len() - 1) as f64).round() as usize];
    let mut highest: Vec<f64> = vibration.iter().map(|y| y.abs()).collect();
    let (_, &mut bound, _) =
        highest.select_nth_unstable_by(vibration.len() - 1 - vibration.len() / 1000, f64::total_cmp);
    let bounded: Vec<f64> = vibration.iter().map(|y| y.clamp(-bound, bound)).collect();
    let tail = (excess_kurtosis(&bounded) + 1.0).max(0.25).log2();
    let all =
        OCTAVES_HZ.map(octave).into_iter().chain(BELOW.map(quantile)).chain([tail]).collect::<Vec<f64>>();
    std::array::from_fn(|k| all[k])
}

/// Mean square errors of octaves and of levels, dB², and of the tail, which counts four times.
fn distance(a: &Measures, b: &Measures) -> f64 {
    let squares: [f64; OCTAVES + POINTS + 1] = std::array::from_fn(|k| (a[k] - b[k]).powi(2));
    let (octaves, rest) = squares.split_at(OCTAVES);
    mean(octaves) + mean(&rest[..POINTS]) + 4.0 * rest[POINTS]
}

/// Corrects what gave measures that are `off` by so much.
fn correct(off: &[f64], shares: &mut [f64; OCTAVES], curve_db: &mut [f64; POINTS]) {
    let (octaves, levels) = off.split_at(OCTAVES);
    shares.iter_mut().zip(octaves).for_each(|(share, off)| *share *= 10f64.powf(0.07 * off));
    let sum: f64 = shares.iter().sum();
    shares.iter_mut().for_each(|share| *share = (*share / sum).max(1e-4));
    let middle = 0.5 * (levels[POINTS / 2 - 1] + levels[POINTS / 2]);
    let mut least = f64::NEG_INFINITY;
    for (gain, off) in curve_db.iter_mut().zip(levels) {
        least = least.max(*gain + 0.9 * (off - middle));
        *gain = least;
    }
}

/// The grain in thousandths and tenths of a decibel, relative to the power's root.
fn rounded(shares: [f64; OCTAVES], curve_db: &[f64; POINTS]) -> Option<Grain> {
    let mut thousandths = shares.map(|share| (1000.0 * share).round());
    let rest = 1000.0 - thousandths.iter().sum::<f64>();
    if let Some(largest) = thousandths.iter_mut().max_by(|a, b| a.total_cmp(b)) {
        *largest += rest;
    }
    let powers = curve_db.map(|gain| 10f64.powf(0.1 * gain));
    let parts = BELOW.windows(2).zip(powers.windows(2));
    let power: f64 = parts.map(|(below, power)| 0.5 * (below[1] - below[0]) * (power[0] + power[1])).sum();
    let level_db = 10.0 * power.log10();
    let gains = curve_db.map(|gain| ((10.0 * (gain - level_db)).round() / 10.0).clamp(-80.0, 30.0));
    Grain::new(&thousandths.map(|share| share / 1000.0), &gains).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Uniform;

    const RATE_HZ: f64 = 10_000.0;

    /// A tool that rings at 250 Hz, and a high-pass.
    fn response(frequency_hz: f64) -> [Complex64; 2] {
        let delay = Complex64::cis(-TAU * frequency_hz / RATE_HZ);
        let law = 1.0 / ((delay * 0.92 - 1.88) * delay + 1.0);
        let high = Complex64::new(0.0, frequency_hz / 20.0);
        [law, law * high * high / ((high + 1.0) * (high + 1.0))]
    }

    fn fit(samples: &[f64]) -> Option<Fit> {
        Fit::new(samples, RATE_HZ, response)
    }

    /// Noise of what is left where the map is off: neighbours are correlated, the level sways slowly.
    fn misfit(seed: u64, seconds: f64) -> Vec<f64> {
        let mut noise = Gaussian::new(seed);
        let (mut last, mut before) = (0.0, 0.0);
        let sample = |n: usize| {
            let y = noise.next_sample() + 0.3 * last - 0.2 * before;
            (before, last) = (last, y);
            y * (1.0 + 0.3 * (TAU * 0.2 * n as f64 / RATE_HZ).sin())
        };
        (0..(seconds * RATE_HZ) as usize).map(sample).collect()
    }

    /// A level that is a first-order log-normal process: crackle.
    fn log_normal(depth: f64, time_constant_s: f64, seed: u64) -> Vec<f64> {
        let mut noise = Gaussian::new(seed + 1000);
        let kept = (-1.0 / (time_constant_s * RATE_HZ)).exp();
        let mut z = noise.next_sample();
        let mut all = misfit(seed, 10.0);
        for e in &mut all {
            z = kept * z + (1.0 - kept * kept).sqrt() * noise.next_sample();
            *e *= (0.5 * depth * z).exp();
        }
        all
    }

    /// Events of unlike size, 25 a second, that die out in 15 ms, over a quiet noise.
    fn shots(seed: u64) -> Vec<f64> {
        let (mut draw, mut sizes) = (Uniform::new(seed + 2000), Gaussian::new(seed + 3000));
        let mut power = 0.0;
        let mut all = misfit(seed, 10.0);
        for e in &mut all {
            let mut chance = [0.0];
            draw.fill(&mut chance);
            power *= (-1.0 / (0.015 * RATE_HZ)).exp();
            power += if chance[0] < 25.0 / RATE_HZ { sizes.next_sample().exp() } else { 0.0 };
            *e *= (0.02 + power).sqrt();
        }
        all
    }

    /// Places of two roughnesses, each felt for 30 to 200 ms, with threads that pass at about 45 Hz.
    fn weave(seed: u64) -> Vec<f64> {
        let (mut draw, mut wander) = (Uniform::new(seed + 4000), Gaussian::new(seed + 5000));
        let (mut left, mut is_rough, mut phase) = (0, false, 0.0);
        let mut all = misfit(seed, 10.0);
        for e in &mut all {
            if left == 0 {
                let mut length = [0.0];
                draw.fill(&mut length);
                (left, is_rough) = (((0.03 + 0.17 * length[0]) * RATE_HZ) as usize, !is_rough);
            }
            left -= 1;
            phase += TAU * 45.0 / RATE_HZ + 0.05 * wander.next_sample();
            *e *= (1.0 + 0.8 * f64::sin(phase)) * if is_rough { 1.0 } else { 0.35 };
        }
        all
    }

    /// Errors of octaves and of levels, dB, and of the tail, of one rendering against each stretch of a take.
    fn errors(take: &Fit, grain: Option<Grain>) -> [f64; 3] {
        let none = Grain::new(&[1.0 / OCTAVES as f64; OCTAVES], &[0.0; POINTS]).expect("in range");
        let [rendered, _] = take.rendered(&grain.unwrap_or(none), 7);
        let rendered = measured(&rendered, take.rate_hz);
        let one = |y: &Vec<f64>| {
            let recorded = measured(y, take.rate_hz);
            let squares: Vec<f64> = rendered.iter().zip(recorded).map(|(a, b)| (a - b).powi(2)).collect();
            let (octaves, rest) = squares.split_at(OCTAVES);
            [mean(octaves).sqrt(), mean(&rest[..POINTS]).sqrt(), rest[POINTS].sqrt()]
        };
        let all: Vec<_> = take.recorded.iter().map(one).collect();
        std::array::from_fn(|k| mean(&all.iter().map(|one| one[k]).collect::<Vec<f64>>()))
    }

    /// The crackle that is nearest to a recording, of a grid.
    fn best_crackle(recording: &Fit) -> Grain {
        let recorded = means(recording.recorded.iter().map(|y| measured(y, recording.rate_hz)));
        let depths = (1..=20).map(|tenths| 0.1 * f64::from(tenths));
        let grid = depths.flat_map(|depth| [0.002, 0.004, 0.008, 0.015, 0.03, 0.05].map(|tau| (depth, tau)));
        let far = |(depth, time_constant_s): (f64, f64)| {
            let grain = Grain::of_crackle(depth, time_constant_s).expect("in range");
            let rendered = recording.rendered(&grain, 0).map(|y| measured(&y, recording.rate_hz));
            (distance(&means(rendered.into_iter()), &recorded), grain)
        };
        grid.map(far).min_by(|(a, _), (b, _)| a.total_cmp(b)).expect("some").1
    }

    #[test]
    #[expect(clippy::print_stdout, reason = "the errors are of interest")]
    fn grain_of_any_making_comes_nearer_than_gaussian_noise_and_crackle() {
        type Make = fn(u64) -> Vec<f64>;
        let makings: [(&str, Make); 4] = [
            ("log-normal, 4 ms", |seed| log_normal(0.8, 0.004, seed)),
            ("log-normal, 30 ms", |seed| log_normal(1.2, 0.03, seed)),
            ("shots", shots),
            ("weave", weave),
        ];
        let mut sums = [[0.0; 3]; 3];
        for (making, of) in makings {
            let (recording, take) = (fit(&of(1)).expect("long enough"), fit(&of(2)).expect("long enough"));
            assert!(recording.is_grained(), "{making}");
            let grain = recording.grain().expect("it has grain");
            let rows = [Some(grain), Some(best_crackle(&recording)), None].map(|grain| errors(&take, grain));
            println!(
                "{making}: grain {:.2?}, crackle {:.2?}, Gaussian {:.2?}; {grain:?}",
                rows[0], rows[1], rows[2]
            );
            for (sum, row) in sums.iter_mut().zip(rows) {
                sum.iter_mut().zip(row).for_each(|(sum, error)| *sum += error);
            }
            let [own, _, gaussian] = rows;
            assert!(
                own.iter().zip(gaussian).all(|(own, gaussian)| *own < 0.6 * gaussian),
                "{making}: {rows:?}"
            );
        }
        let [own, crackle, _] = sums;
        assert!(own.iter().zip(crackle).all(|(own, crackle)| *own < crackle), "{sums:?}");
    }

    #[test]
    fn gaussian_noise_has_no_grain_whatever_its_spectrum() {
        let found = (0..20).filter(|seed| fit(&misfit(*seed, 10.0)).expect("long enough").is_grained());
        assert_eq!(found.count(), 0);
    }

    #[test]
    fn a_little_grain_is_found_in_ten_seconds() {
        let found =
            (0..5).filter(|seed| fit(&log_normal(0.4, 0.004, *seed)).expect("long enough").is_grained());
        assert_eq!(found.count(), 5);
    }

    #[test]
    fn too_little_tells_nothing() {
        assert!(fit(&shots(1)[..4_000]).is_none() && fit(&[]).is_none());
        assert!(fit(&shots(1)[..10_000]).expect("long enough").is_grained());
        assert!(Fit::new(&shots(1), 500.0, response).is_none());
    }
}
