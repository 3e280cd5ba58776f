//! Spectral deviation of a resampled model from the original.

use crate::ArmaModel;
use std::f64::consts::TAU;

/// A difference of spectral density, resampled over original.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Difference, dB.
    pub db: f64,
    /// Frequency of the difference, Hz.
    pub frequency_hz: f64,
}

/// Lower end of the compared band, Hz.
pub(super) const LOWEST_HZ: f64 = 20.0;
/// Upper end of the compared band, relative to the new rate.
pub(super) const HIGHEST_OF_RATE: f64 = 0.4;

/// Number of compared frequencies.
const POINTS: usize = 1024;

/// The largest difference (by magnitude) of spectral density between 20 Hz and 0.4 of the new rate.
pub fn deviation_db(
    original: &ArmaModel,
    original_rate_hz: f64,
    resampled: &ArmaModel,
    rate_hz: f64,
) -> Deviation {
    let density =
        |model: &ArmaModel, rate: f64, f: f64| model.variance() / rate * model.power_gain_at(TAU * f / rate);
    let (low, high) = (LOWEST_HZ, HIGHEST_OF_RATE * rate_hz);
    let mut worst = Deviation { db: 0.0, frequency_hz: low };
    for i in 0..=POINTS {
        let frequency_hz = low + (high - low) * i as f64 / POINTS as f64;
        let ratio =
            density(resampled, rate_hz, frequency_hz) / density(original, original_rate_hz, frequency_hz);
        let db = 10.0 * ratio.log10();
        if db.abs() > worst.db.abs() {
            worst = Deviation { db, frequency_hz };
        }
    }
    worst
}
