//! Bounds of the numbers in recordings and surfaces, far beyond what hands and sensors reach. A number is held against them
//! where it is read, so that every length that follows from it fits into memory.

use std::ops::RangeInclusive;

/// Samples per second.
pub const RATES_HZ: RangeInclusive<f64> = 1.0..=1e6;
/// The same in messages.
pub const RATES: &str = "from 1 Hz to 1 MHz";
/// Largest speed, m/s.
pub const MAX_SPEED_M_S: f64 = 100.0;
/// Largest force, N, and torque, N m.
pub const MAX_FORCE_N: f64 = 1e4;
/// Largest distance from the origin, m.
pub const MAX_POSITION_M: f64 = 1e3;
/// Largest acceleration, m/s², or reading of its sensor in an unknown unit: a converter has 32 bits at most.
pub const MAX_ACCELERATION_M_S2: f64 = 1e10;
/// Latest time, s: clocks count seconds from 1970.
pub const MAX_TIME_S: f64 = 1e11;

/// Lowest rate of recordings that textures and taps are learned from, Hz: less than a quarter of what a hand feels is in
/// slower ones.
pub const LOWEST_LEARNED_HZ: f64 = 500.0;
/// Highest frequency that a hand feels, Hz.
pub const FELT_HZ: f64 = 1000.0;
/// From this rate on, recordings hold all that a hand feels, Hz.
pub const FULL_BAND_HZ: f64 = 2300.0;

/// The highest frequency that samples at a rate hold, Hz: an analogue filter needs the rest.
pub fn carried_hz(rate_hz: f64) -> f64 {
    0.45 * rate_hz
}

/// A number for a message: seven digits, no trailing zeros, and by its power of ten where it is large.
pub fn shown(value: f64) -> String {
    let rounded = format!("{value:.6e}").parse().unwrap_or(value);
    if rounded.abs() < 1e6 { rounded.to_string() } else { format!("{rounded:e}") }
}

/// The largest magnitude of a quantity of recordings (a column's name without its unit), and its unit.
pub fn largest(quantity: &str) -> Option<(f64, &'static str)> {
    match quantity.split('_').next()? {
        "speed" => Some((MAX_SPEED_M_S, "m/s")),
        "force" => Some((MAX_FORCE_N, "N")),
        "torque" => Some((MAX_FORCE_N, "N m")),
        "position" => Some((MAX_POSITION_M, "m")),
        "accel" => Some((MAX_ACCELERATION_M_S2, "m/s2")),
        "time" => Some((MAX_TIME_S, "s")),
        _ => None,
    }
}
