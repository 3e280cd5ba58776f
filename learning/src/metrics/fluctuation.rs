//! How the level of a vibration fluctuates: what distinguishes two vibrations of the same spectrum.

use super::level::{envelope_error_db as rms_difference, excess_kurtosis, levels_over_db, powers};
use haptograph_signal::spectrum::welch;
use haptograph_signal::statistics::{mean, standard_deviation, z_scores};
use haptograph_signal::window::Window;
use haptograph_signal::{Complex64, fft};
use haptograph_surfaces::layers::grain::OCTAVES_HZ;
use std::f64::consts::SQRT_2;

/// Shortest signal that is measured, s: one period of the lowest octave; and the lowest rate, Hz, with two samples in an interval
/// of the envelope.
const SHORTEST_S: f64 = 0.5;
const LOWEST_RATE_HZ: f64 = 1000.0;
/// Length of the intervals of the envelope, and of the segments of its spectrum, s.
const ENVELOPE_S: f64 = 0.002;
const SEGMENT_S: f64 = 1.0;
/// Lowest power in an octave, relative to the squared mean of the envelope.
const LEAST_MODULATION: f64 = 1e-12;
/// Lags of the envelope's autocorrelation, s.
const LAGS_S: [f64; 8] = [0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.128, 0.256];
/// Lengths of the intervals of levels, s, and the quantiles of the levels over the shorter ones.
const LEVELS_S: [f64; 2] = [0.005, 0.05];
const QUANTILES: [f64; 7] = [0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99];
/// Samples beyond this quantile of the magnitude are clipped for the kurtosis: a single knock would determine it.
const CLIPPED: f64 = 0.999;
/// Bands whose envelopes are correlated: four of equal width in octaves between these frequencies, Hz, the upper one at most this
/// part of the rate; and the length of the intervals of their envelopes, s.
const BANDS: usize = 4;
const LOWEST_HZ: f64 = 30.0;
const HIGHEST_HZ: f64 = 1000.0;
const HIGHEST_PART: f64 = 0.42;
const BAND_ENVELOPE_S: f64 = 0.008;

/// The fluctuation of a vibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Fluctuation {
    /// Power of the 2 ms RMS envelope over its mean, in octaves, dB.
    modulation_db: [f64; OCTAVES_HZ.len()],
    /// Autocorrelation of the same envelope less its mean, interpolated at the lags.
    autocorrelation: [f64; LAGS_S.len()],
    /// Quantiles of the levels over 5 ms, dB relative to the signal's unit.
    quantiles_db: [f64; QUANTILES.len()],
    /// Excess kurtosis of the clipped samples.
    kurtosis: f64,
    /// Largest magnitude over the standard deviation, dB.
    crest_db: f64,
    /// Correlation of the envelopes of each pair of bands.
    band_correlations: Vec<f64>,
    /// Standard deviations of the levels over 5 and 50 ms, dB.
    deviations_db: [f64; 2],
}

/// Differences between the fluctuations of two vibrations: root mean squares over octaves, lags, quantiles and pairs, and
/// magnitudes of single values.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct FluctuationErrors {
    /// Of the modulation spectrum: the power of the 2 ms envelope over its mean, in octaves from 2 to 128 Hz, dB.
    pub modulation_db: f64,
    /// Of the autocorrelation of that envelope, at lags from 2 to 256 ms.
    pub autocorrelation: f64,
    /// Of the levels over 5 ms: seven quantiles from 1 to 99 %, dB.
    pub level_quantiles_db: f64,
    /// Of the kurtosis of samples clipped at the 99.9 % quantile of their magnitude: `|log2|` of the ratio of excess + 1, each at
    /// least 1/4. Gaussian noise has 1.
    pub kurtosis_octaves: f64,
    /// Of the crest factor, dB.
    pub crest_db: f64,
    /// Of the correlations between the 8 ms envelopes of four bands from 30 to 1000 Hz.
    pub band_correlation: f64,
    /// Of the standard deviation of the levels over 5 ms, dB.
    pub level_deviation_5_ms_db: f64,
    /// Of the standard deviation of the levels over 50 ms, dB.
    pub level_deviation_50_ms_db: f64,
}

impl Fluctuation {
    /// Measures a signal; `None` if it is shorter than 0.5 s, below 1 kHz, constant, or not finite.
    pub fn of(signal: &[f64], rate_hz: f64) -> Option<Self> {
        let middle = mean(signal);
        let signal: Vec<f64> = signal.iter().map(|x| x - middle).collect();
        let deviation = standard_deviation(&signal);
        let is_short = (signal.len() as f64) < SHORTEST_S * rate_hz || rate_hz < LOWEST_RATE_HZ;
        if is_short || !(deviation.is_finite() && deviation > 0.0) {
            return None;
        }
        let (modulation, modulation_rate_hz) = modulation(&signal, rate_hz);
        let covariance = autocovariance(&modulation);
        let correlation = |lag_s: f64| {
            interpolated(&covariance, lag_s * modulation_rate_hz) / covariance[0].max(f64::MIN_POSITIVE)
        };
        let levels = LEVELS_S.map(|seconds| levels_over_db(&signal, seconds, rate_hz));
        let mut sorted = levels[0].clone();
        sorted.sort_by(f64::total_cmp);
        let last = (sorted.len() - 1) as f64;
        let largest = signal.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        Some(Self {
            modulation_db: octaves_db(&modulation, modulation_rate_hz)?,
            autocorrelation: LAGS_S.map(correlation),
            quantiles_db: QUANTILES.map(|part| interpolated(&sorted, part * last)),
            kurtosis: excess_kurtosis(&clipped(&signal)),
            crest_db: 20.0 * (largest / deviation).log10(),
            band_correlations: band_correlations(&signal, rate_hz),
            deviations_db: levels.map(|levels| standard_deviation(&levels)),
        })
    }

    /// Power of the 2 ms RMS envelope over its mean: middle of an octave, Hz, and dB.
    pub fn modulation_db(&self) -> impl Iterator<Item = (f64, f64)> {
        OCTAVES_HZ.into_iter().zip(self.modulation_db)
    }

    /// Quantiles of the levels over 5 ms: part of the time below, and dB relative to the signal's unit.
    pub fn quantiles_db(&self) -> impl Iterator<Item = (f64, f64)> {
        QUANTILES.into_iter().zip(self.quantiles_db)
    }

    /// The differences to another vibration of the same rate.
    pub fn errors(&self, other: &Self) -> FluctuationErrors {
        let octaves = |kurtosis: f64| (kurtosis + 1.0).max(0.25).log2();
        let deviation_db = |over: usize| (self.deviations_db[over] - other.deviations_db[over]).abs();
        FluctuationErrors {
            modulation_db: rms_difference(&self.modulation_db, &other.modulation_db),
            autocorrelation: rms_difference(&self.autocorrelation, &other.autocorrelation),
            level_quantiles_db: rms_difference(&self.quantiles_db, &other.quantiles_db),
            kurtosis_octaves: (octaves(self.kurtosis) - octaves(other.kurtosis)).abs(),
            crest_db: (self.crest_db - other.crest_db).abs(),
            band_correlation: rms_difference(&self.band_correlations, &other.band_correlations),
            level_deviation_5_ms_db: deviation_db(0),
            level_deviation_50_ms_db: deviation_db(1),
        }
    }
}

/// The envelope over its mean, less 1, and its rate, Hz.
fn modulation(signal: &[f64], rate_hz: f64) -> (Vec<f64>, f64) {
    let envelope: Vec<f64> = powers(signal, ENVELOPE_S, rate_hz).map(f64::sqrt).collect();
    let mean_level = mean(&envelope);
    let samples = (ENVELOPE_S * rate_hz).round().max(1.0);
    (envelope.iter().map(|level| level / mean_level - 1.0).collect(), rate_hz / samples)
}

/// Powers in the octaves, dB.
fn octaves_db(modulation: &[f64], rate_hz: f64) -> Option<[f64; OCTAVES_HZ.len()]> {
    let segment = modulation.len().min((SEGMENT_S * rate_hz) as usize);
    let spectrum = welch(modulation, rate_hz, segment, segment / 2, Window::Hann).ok()?;
    let power = |hz: f64| spectrum.power_between(hz / SQRT_2, hz * SQRT_2).max(LEAST_MODULATION);
    Some(OCTAVES_HZ.map(|hz| 10.0 * power(hz).log10()))
}

/// A signal clipped at a quantile of its magnitude.
fn clipped(signal: &[f64]) -> Vec<f64> {
    let mut magnitudes: Vec<f64> = signal.iter().map(|x| x.abs()).collect();
    let place = (CLIPPED * (signal.len() - 1) as f64) as usize;
    let bound = *magnitudes.select_nth_unstable_by(place, f64::total_cmp).1;
    signal.iter().map(|x| x.clamp(-bound, bound)).collect()
}

/// The value at a place in a list that is not empty, or at its end.
fn interpolated(values: &[f64], place: f64) -> f64 {
    let last = values.len() - 1;
    let below = (place as usize).min(last);
    let above = (below + 1).min(last);
    values[below] + (place - below as f64) * (values[above] - values[below])
}

/// Autocovariance by lag of a signal of mean zero, without bias by the lag.
fn autocovariance(signal: &[f64]) -> Vec<f64> {
    let mut spectrum = spectrum(signal, 2 * signal.len());
    spectrum.iter_mut().for_each(|x| *x = Complex64::new(x.norm_sqr(), 0.0));
    fft::inverse(spectrum.len()).process(&mut spectrum);
    let products = (1..=signal.len()).rev();
    spectrum.iter().zip(products).map(|(x, products)| x.re / products as f64).collect()
}

/// The spectrum of a signal followed by zeros. Its length is a power of two, so that few transforms are planned.
fn spectrum(signal: &[f64], least: usize) -> Vec<Complex64> {
    let length = least.next_power_of_two();
    let mut spectrum: Vec<Complex64> = signal.iter().map(|x| Complex64::new(*x, 0.0)).collect();
    spectrum.resize(length, Complex64::new(0.0, 0.0));
    fft::forward(length).process(&mut spectrum);
    spectrum
}

/// Correlations between the envelopes of bands, pair by pair; 0 for a band without power.
fn band_correlations(signal: &[f64], rate_hz: f64) -> Vec<f64> {
    let whole = spectrum(signal, signal.len());
    let highest_hz = HIGHEST_HZ.min(HIGHEST_PART * rate_hz).max(LOWEST_HZ);
    let step = (highest_hz / LOWEST_HZ).powf(1.0 / BANDS as f64);
    let edge = |edge: usize| {
        let bin = LOWEST_HZ * step.powf(edge as f64) / rate_hz * whole.len() as f64;
        (bin.ceil() as usize).min(whole.len() / 2)
    };
    // The positive frequencies alone are the analytic signal, whose magnitude is the envelope. A rate above its highest frequency
    // is enough.
    let length = edge(BANDS).max(1).next_power_of_two();
    let part = length as f64 / whole.len() as f64;
    let inverse = fft::inverse(length);
    let envelope = |band: usize| {
        let mut analytic = vec![Complex64::new(0.0, 0.0); length];
        let bins = edge(band)..edge(band + 1);
        analytic[bins.clone()].copy_from_slice(&whole[bins]);
        inverse.process(&mut analytic);
        analytic.truncate((signal.len() as f64 * part) as usize);
        let magnitudes: Vec<f64> = analytic.iter().map(|x| x.norm()).collect();
        let envelope = powers(&magnitudes, BAND_ENVELOPE_S, rate_hz * part).map(f64::sqrt);
        z_scores(&envelope.collect::<Vec<f64>>())
    };
    let envelopes: Vec<Vec<f64>> = (0..BANDS).map(envelope).collect();
    let pairs = (0..BANDS).flat_map(|a| (a + 1..BANDS).map(move |b| (a, b)));
    let correlation = |(a, b): (usize, usize)| {
        let products: f64 = envelopes[a].iter().zip(&envelopes[b]).map(|(a, b)| a * b).sum();
        products / envelopes[a].len().saturating_sub(1).max(1) as f64
    };
    pairs.map(correlation).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;
    use std::f64::consts::TAU;

    const RATE_HZ: f64 = 5000.0;

    /// Ten seconds of noise whose level swings by `depth` at a frequency.
    fn swinging(depth: f64, hz: f64, seed: u64) -> Vec<f64> {
        let mut noise = Gaussian::new(seed);
        (0..50_000)
            .map(|n| (1.0 + depth * (TAU * hz * f64::from(n) / RATE_HZ).sin()) * noise.next_sample())
            .collect()
    }

    fn of(signal: &[f64]) -> Fluctuation {
        Fluctuation::of(signal, RATE_HZ).expect("it is long enough")
    }

    #[test]
    fn a_swing_of_the_level_is_found_in_its_octave_alone() {
        let (plain, swinging) = (of(&swinging(0.0, 8.0, 1)), of(&swinging(0.5, 16.0, 2)));
        for (octave, hz) in OCTAVES_HZ.into_iter().enumerate() {
            let more_db = swinging.modulation_db[octave] - plain.modulation_db[octave];
            assert_eq!(more_db > 6.0, hz == 16.0, "{hz} Hz: {more_db} dB");
        }
        // A sine of amplitude 0.5 has a power of 1/8.
        assert!((swinging.modulation_db[3] + 9.03).abs() < 1.0, "{}", swinging.modulation_db[3]);
        assert!(swinging.deviations_db[1] < swinging.deviations_db[0]);
        // A period of 62.5 ms.
        assert!(swinging.autocorrelation[5] > 0.3 && swinging.autocorrelation[4] < -0.3);
        assert!(mean(&swinging.band_correlations) > mean(&plain.band_correlations).abs() + 0.1);
        assert!(plain.band_correlations.iter().all(|correlation| correlation.abs() < 0.15));
    }

    #[test]
    fn two_noises_of_one_kind_are_near_and_those_of_two_kinds_are_not() {
        let (a, b, other) =
            (of(&swinging(0.0, 8.0, 1)), of(&swinging(0.0, 8.0, 2)), of(&swinging(0.9, 32.0, 3)));
        let (near, far) = (a.errors(&b), a.errors(&other));
        for (near, far) in [
            (near.modulation_db, far.modulation_db),
            (near.autocorrelation, far.autocorrelation),
            (near.level_quantiles_db, far.level_quantiles_db),
            (near.kurtosis_octaves, far.kurtosis_octaves),
            (near.band_correlation, far.band_correlation),
            (near.level_deviation_5_ms_db, far.level_deviation_5_ms_db),
        ] {
            assert!(far > 3.0 * near, "{near} and {far}");
        }
        assert_eq!(a.errors(&a), FluctuationErrors::default());
    }

    #[test]
    fn a_single_knock_counts_as_crest_and_not_as_kurtosis() {
        let (plain, mut knocked) = (swinging(0.0, 8.0, 1), swinging(0.0, 8.0, 1));
        knocked[700] = 40.0;
        let errors = of(&knocked).errors(&of(&plain));
        assert!(errors.kurtosis_octaves < 0.05 && errors.crest_db > 15.0, "{errors:?}");
    }

    #[test]
    fn the_lowest_rate_has_all_octaves_and_finite_errors() {
        let at = |seed: u64, rate_hz: f64| Fluctuation::of(&swinging(0.5, 16.0, seed), rate_hz);
        let [a, b] = [1, 2].map(|seed| at(seed, 1000.0).expect("it is long enough"));
        assert!(a.modulation_db().all(|(_, power_db)| (-60.0..0.0).contains(&power_db)), "{a:?}");
        let errors = a.errors(&b);
        let errors = [errors.modulation_db, errors.autocorrelation, errors.band_correlation, errors.crest_db];
        assert!(errors.iter().all(|error| error.is_finite()), "{errors:?}");
        assert_eq!(at(1, 999.0), None);
    }

    #[test]
    fn what_is_short_or_silent_has_no_fluctuation() {
        assert_eq!(Fluctuation::of(&swinging(0.0, 8.0, 1)[..2000], RATE_HZ), None);
        assert_eq!(Fluctuation::of(&[0.0; 50_000], RATE_HZ), None);
        assert_eq!(Fluctuation::of(&[f64::NAN; 50_000], RATE_HZ), None);
        assert_eq!(Fluctuation::of(&[], RATE_HZ), None);
    }
}
