//! A constant in a vibration: gravity, or the zero of a sensor.

use super::Finding;
use crate::processing::{ProcessingSettings, high_passed};

/// A mean is small below this fraction of the deviation.
///
/// A vibration above the high-pass has no larger mean over [`SHORTEST_S`] or more: a tone at 20 Hz that ends at its
/// worst moment has a mean of 0.045 deviations.
const SMALL: f64 = 0.1;
/// Deviation of a constant relative to its mean, by rounding.
const ROUNDING: f64 = 1e-9;
/// Shortest time over which a mean is meaningful, s.
const SHORTEST_S: f64 = 0.5;

/// Treats a vibration on one axis whose mean is not small as unprocessed: applies the high-pass of the processing, and
/// returns a finding. `has_unit` is true if it is in m/s². All others keep their bits, as does a constant and a
/// vibration that ends below the cut-off.
#[must_use]
pub fn remove_offset(column: &str, has_unit: bool, values: &mut Vec<f64>, rate_hz: f64) -> Option<Finding> {
    let (mean, cutoff_hz) = without_offset(values, rate_hz)?;
    Some(Finding::HighPassed { column: column.to_owned(), mean, cutoff_hz, has_unit })
}

/// The mean and the cutoff in Hz, where the high-pass was applied.
fn without_offset(values: &mut Vec<f64>, rate_hz: f64) -> Option<(f64, f64)> {
    let mean = offset(values, rate_hz)?;
    let settings = ProcessingSettings::default();
    *values = high_passed(values, rate_hz, &settings).ok()?;
    Some((mean, settings.highpass_hz))
}

/// The mean where it is not small.
fn offset(values: &[f64], rate_hz: f64) -> Option<f64> {
    let count = values.len() as f64;
    if count < SHORTEST_S * rate_hz {
        return None;
    }
    let mean = values.iter().sum::<f64>() / count;
    let deviation = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt();
    let changes = deviation > ROUNDING * mean.abs();
    (changes && mean.abs() > SMALL * deviation).then_some(mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tone(count: usize, offset: f64) -> Vec<f64> {
        let radians = |i: usize| std::f64::consts::TAU * 80.0 * i as f64 / 1000.0;
        (0..count).map(|i| offset + radians(i).sin()).collect()
    }

    #[test]
    fn gravity_is_taken_off_and_what_is_processed_keeps_its_bits() {
        let processed = tone(2000, 0.0);
        let mut kept = processed.clone();
        assert_eq!(without_offset(&mut kept, 1000.0), None);
        assert_eq!(kept, processed);
        let mut heavy = tone(2000, -9.81);
        let (mean, cutoff_hz) = without_offset(&mut heavy, 1000.0).expect("a mean");
        assert!((mean + 9.81).abs() < 1e-3 && cutoff_hz == 20.0, "{mean}");
        let off = heavy.iter().zip(&processed).skip(100).take(1800);
        assert!(off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 0.02);
    }

    #[test]
    fn a_mean_says_nothing_of_a_moment_or_of_what_never_changes() {
        assert_eq!(without_offset(&mut tone(400, 9.81), 1000.0), None);
        assert_eq!(without_offset(&mut vec![9.81; 2000], 1000.0), None);
        // No filter passes what lies above half the rate.
        assert_eq!(without_offset(&mut tone(400, 9.81), 30.0), None);
    }
}
