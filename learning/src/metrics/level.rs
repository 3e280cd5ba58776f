//! Level of a vibration over time: kurtosis, and levels over 50 ms.

use haptograph_signal::noise::Gaussian;
use haptograph_signal::statistics::mean;
use haptograph_signal::{Complex64, fft};
use nalgebra::{Matrix3, Vector3};

/// Length of the intervals of a level, s.
const STRETCH_S: f64 = 0.05;
/// Length of the parts whose spectra the noises of [`envelope_between_seeds_db`] have, s.
const PART_S: f64 = 2.0;
/// Lower bound of levels relative to the loudest, dB, since silence has no level.
const FLOOR_DB: f64 = 80.0;
/// Lower bounds of speed, m/s, and force, N, before their logarithms are taken.
const LEAST: [f64; 2] = [0.001, 0.01];

/// Fourth central moment over the squared variance, minus the 3 of Gaussian noise; 0 for a constant.
pub fn excess_kurtosis(signal: &[f64]) -> f64 {
    let middle = mean(signal);
    let (mut second, mut fourth) = (0.0, 0.0);
    for x in signal {
        let square = (x - middle) * (x - middle);
        second += square;
        fourth += square * square;
    }
    let count = signal.len().max(1) as f64;
    if second > 0.0 { fourth * count / (second * second) - 3.0 } else { 0.0 }
}

/// RMS of each whole interval of 50 ms, dB relative to the signal's unit, bounded to 80 dB below the loudest.
pub fn levels_db(signal: &[f64], rate_hz: f64) -> Vec<f64> {
    levels_over_db(signal, STRETCH_S, rate_hz)
}

/// As [`levels_db`], over intervals of another length.
pub(super) fn levels_over_db(signal: &[f64], seconds: f64, rate_hz: f64) -> Vec<f64> {
    let powers: Vec<f64> = powers(signal, seconds, rate_hz).collect();
    let loudest = powers.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let least = loudest * 10f64.powf(-0.1 * FLOOR_DB);
    powers.iter().map(|power| 10.0 * power.max(least).log10()).collect()
}

/// Mean square of each whole interval, which has at least one sample.
pub(super) fn powers(signal: &[f64], seconds: f64, rate_hz: f64) -> impl Iterator<Item = f64> {
    let power = |stretch: &[f64]| stretch.iter().map(|x| x * x).sum::<f64>() / stretch.len() as f64;
    stretches(signal, seconds, rate_hz).map(power)
}

/// RMS difference between two sequences of levels, dB, over the time that both cover.
pub fn envelope_error_db(a: &[f64], b: &[f64]) -> f64 {
    let squares: Vec<f64> = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).collect();
    mean(&squares).sqrt()
}

/// The [`envelope_error_db`] of two noises with the spectrum of a signal, dB: what is due to chance. The noises have the
/// magnitudes of each 2 s of the signal, and random phases.
pub fn envelope_between_seeds_db(signal: &[f64], rate_hz: f64) -> f64 {
    let [a, b] = [1, 2].map(|seed| {
        let mut noise = Gaussian::new(seed);
        let parts = signal.chunks(((PART_S * rate_hz).round() as usize).max(1));
        let noises = parts.flat_map(|part| with_random_phases(part, &mut noise));
        levels_db(&noises.collect::<Vec<f64>>(), rate_hz)
    });
    envelope_error_db(&a, &b)
}

/// Noise with the magnitudes of a signal's spectrum, and the phases of white noise.
fn with_random_phases(signal: &[f64], noise: &mut Gaussian) -> Vec<f64> {
    let transform = fft::forward(signal.len());
    let spectrum = |values: &mut dyn Iterator<Item = f64>| {
        let mut values: Vec<Complex64> = values.map(|x| Complex64::new(x, 0.0)).collect();
        transform.process(&mut values);
        values
    };
    let magnitudes = spectrum(&mut signal.iter().copied());
    let mut turned = spectrum(&mut signal.iter().map(|_| noise.next_sample()));
    for (turned, magnitude) in turned.iter_mut().zip(&magnitudes) {
        *turned *= magnitude.norm() / turned.norm().max(f64::MIN_POSITIVE);
    }
    fft::inverse(signal.len()).process(&mut turned);
    turned.iter().map(|x| x.re / signal.len() as f64).collect()
}

/// Part of a vibration's levels that its speed (m/s) and force (N) do not explain: the standard deviation,
/// dB, of the residual of a plane over the logarithms of both. `None` for fewer than four levels.
pub fn unexplained_level_db(signal: &[f64], speed_m_s: &[f64], force_n: &[f64], rate_hz: f64) -> Option<f64> {
    let levels = levels_db(signal, rate_hz);
    if levels.len() < 4 {
        return None;
    }
    let logs = |values: &[f64], least: f64| -> Vec<f64> {
        stretches(values, STRETCH_S, rate_hz).map(|stretch| mean(stretch).max(least).ln()).collect()
    };
    let (speed, force) = (logs(speed_m_s, LEAST[0]), logs(force_n, LEAST[1]));
    let places: Vec<Vector3<f64>> =
        speed.iter().zip(&force).map(|(v, f)| Vector3::new(1.0, *v, *f)).collect();
    let (mut normal, mut right) = (Matrix3::identity() * 1e-9, Vector3::zeros());
    for (place, level) in places.iter().zip(&levels) {
        normal += place * place.transpose();
        right += place * *level;
    }
    let plane = normal.cholesky()?.solve(&right);
    let fitted: Vec<f64> = places.iter().map(|place| plane.dot(place)).collect();
    Some(envelope_error_db(&levels, &fitted))
}

fn stretches(signal: &[f64], seconds: f64, rate_hz: f64) -> impl Iterator<Item = &[f64]> {
    signal.chunks_exact(((seconds * rate_hz).round() as usize).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;

    #[test]
    fn kurtosis_is_none_of_gaussian_noise_and_that_of_a_square_wave() {
        let mut noise = vec![0.0; 100_000];
        Gaussian::new(1).fill(&mut noise);
        assert!(excess_kurtosis(&noise).abs() < 0.1);
        let square: Vec<f64> = (0..100).map(|n| if n % 2 == 0 { 1.0 } else { -1.0 }).collect();
        assert!((excess_kurtosis(&square) + 2.0).abs() < 1e-12);
        assert_eq!(excess_kurtosis(&[]), 0.0);
    }

    #[test]
    fn speed_and_force_explain_a_level_that_follows_them_and_no_other() {
        let mut noise = Gaussian::new(2);
        let speed: Vec<f64> = (0..50_000).map(|n| 0.1 + 0.05 * (n as f64 / 2000.0).sin()).collect();
        let force: Vec<f64> = (0..50_000).map(|n| 1.0 + 0.5 * (n as f64 / 3100.0).sin()).collect();
        let follows: Vec<f64> =
            speed.iter().zip(&force).map(|(v, f)| v * f.sqrt() * noise.next_sample()).collect();
        let strays: Vec<f64> =
            (0..50_000).map(|n| (1.0 + 0.9 * (n as f64 / 900.0).sin()) * noise.next_sample()).collect();
        let left = |signal: &[f64]| unexplained_level_db(signal, &speed, &force, 10_000.0).unwrap();
        // The standard error of a level of 500 Gaussian samples is 10 / ln 10 sqrt(2 / 500) = 0.27 dB.
        assert!((left(&follows) - 0.27).abs() < 0.12, "{}", left(&follows));
        assert!(left(&strays) > 3.0);
        assert_eq!(unexplained_level_db(&strays[..1500], &speed, &force, 10_000.0), None);
    }

    #[test]
    fn noises_of_one_spectrum_are_apart_by_what_their_bandwidth_leaves_to_chance() {
        let mut noise = Gaussian::new(3);
        let white: Vec<f64> = (0..50_000).map(|_| noise.next_sample()).collect();
        // 500 samples tell a level to 0.27 dB, the difference of two to 0.39.
        let apart = envelope_between_seeds_db(&white, 10_000.0);
        assert!((apart - 0.39).abs() < 0.05, "{apart}");
        // The narrower the band, the more is left to chance.
        let mut slow = white.clone();
        (1..slow.len()).for_each(|n| slow[n] += 0.94 * slow[n - 1]);
        assert!(envelope_between_seeds_db(&slow, 10_000.0) > 1.0);
        // What is twice as loud is as far apart.
        let louder: Vec<f64> = white.iter().map(|x| 2.0 * x).collect();
        assert!((envelope_between_seeds_db(&louder, 10_000.0) - apart).abs() < 1e-9);
        assert_eq!(envelope_between_seeds_db(&[], 10_000.0), 0.0);
    }

    #[test]
    fn silence_has_the_lowest_level_that_is_told() {
        let mut signal = vec![1.0; 1000];
        signal.extend([0.0; 500]);
        assert_eq!(levels_db(&signal, 10_000.0), [0.0, 0.0, -80.0]);
    }
}
