//! Exact time: rates as rationals, and a common unit in which every clock's period is a whole number.
//!
//! ```
//! use haptograph_signal::time::{Rate, TimeBase};
//!
//! let audio = Rate::from_hz(48_000)?;
//! let film = Rate::parse("59.94")?;
//! assert_eq!(film.parts(), (2997, 50));
//!
//! let base = TimeBase::new(&[audio, Rate::from_hz(1000)?])?;
//! assert_eq!(base.period(1), 48 * base.period(0));
//! # Ok::<(), haptograph_signal::time::RateError>(())
//! ```

use std::fmt;
#[cfg(target_family = "wasm")]
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;
#[cfg(not(target_family = "wasm"))]
use std::time::{SystemTime, UNIX_EPOCH};
use thiserror::Error;

/// Time since the beginning of 1970, UTC; in a page, what the page said last by `set_clock`.
pub fn since_1970() -> Duration {
    #[cfg(not(target_family = "wasm"))]
    return SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    #[cfg(target_family = "wasm")]
    Duration::from_micros(CLOCK_US.load(Relaxed))
}

#[cfg(target_family = "wasm")]
static CLOCK_US: AtomicU64 = AtomicU64::new(0);

/// Sets the clock of a page, which has none of its own.
#[cfg(target_family = "wasm")]
pub fn set_clock(since_1970: Duration) {
    CLOCK_US.store(since_1970.as_micros() as u64, Relaxed);
}

/// A rate in hertz, an exact positive rational in lowest terms.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Rate {
    numerator: u64,
    denominator: u64,
}

/// Error of a rate or a set of rates.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RateError {
    /// The rate is zero, negative, not finite, or below 1 mHz or above 100 MHz.
    #[error("a rate must lie between 0.001 Hz and 100 MHz")]
    OutOfRange,
    /// The text is not a decimal number.
    #[error("`{0}` is not a decimal number of hertz")]
    NotANumber(String),
    /// A year in the common time unit of the rates does not fit in 64 bits.
    #[error(
        "the common time unit of these rates is too short for 64 bits; use rates with small ratios to one another"
    )]
    Incommensurable,
}

impl Rate {
    /// `numerator / denominator` hertz.
    ///
    /// # Errors
    /// [`RateError::OutOfRange`] outside 0.001 Hz to 100 MHz.
    pub fn new(numerator: u64, denominator: u64) -> Result<Self, RateError> {
        if denominator == 0 {
            return Err(RateError::OutOfRange);
        }
        let rate = numerator as f64 / denominator as f64;
        if !(1e-3..=1e8).contains(&rate) {
            return Err(RateError::OutOfRange);
        }
        let divisor = gcd(numerator, denominator);
        Ok(Self { numerator: numerator / divisor, denominator: denominator / divisor })
    }

    /// A whole number of hertz.
    ///
    /// # Errors
    /// [`RateError::OutOfRange`] for 0 and above 100 MHz.
    pub fn from_hz(hz: u64) -> Result<Self, RateError> {
        Self::new(hz, 1)
    }

    /// The rate written as a decimal number, exactly: `"44100"`, `"59.94"`, `"1e3"`.
    ///
    /// # Errors
    /// [`RateError::NotANumber`] for other text, [`RateError::OutOfRange`] for rates outside the range.
    pub fn parse(text: &str) -> Result<Self, RateError> {
        let not_a_number = || RateError::NotANumber(text.to_owned());
        let plain = text.replace('_', "");
        let (mantissa, exponent) = match plain.split_once(['e', 'E']) {
            Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().map_err(|_| not_a_number())?),
            None => (plain.as_str(), 0),
        };
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let fraction = fraction.trim_end_matches('0');
        let digits = format!("{whole}{fraction}");
        if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
            return Err(not_a_number());
        }
        let digits: u64 = digits.parse().map_err(|_| RateError::OutOfRange)?;
        let places = i64::from(exponent) - fraction.len() as i64;
        let power = u32::try_from(places.unsigned_abs()).ok().and_then(|p| 10_u64.checked_pow(p));
        let power = power.ok_or(RateError::OutOfRange)?;
        if places >= 0 {
            Self::new(digits.checked_mul(power).ok_or(RateError::OutOfRange)?, 1)
        } else {
            Self::new(digits, power)
        }
    }

    /// The rate in hertz, rounded to the nearest f64.
    pub fn hz(self) -> f64 {
        self.numerator as f64 / self.denominator as f64
    }

    /// The period in seconds.
    pub fn period_s(self) -> f64 {
        self.denominator as f64 / self.numerator as f64
    }

    /// Numerator and denominator in lowest terms.
    pub fn parts(self) -> (u64, u64) {
        (self.numerator, self.denominator)
    }
}

impl fmt::Display for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} Hz", self.hz())
    }
}

impl fmt::Debug for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{} Hz", self.numerator, self.denominator)
    }
}

/// A common time base: every clock ticks at whole multiples of its own whole period, counted in a unit that all clocks
/// share.
///
/// Tick k of a clock with period P happens at unit kP, so that questions such as "which slow frame was the latest
/// at this fast tick" are integer divisions, and have one answer whatever the block size.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TimeBase {
    units_per_second: Rate,
    periods: Vec<u64>,
}

impl TimeBase {
    /// The coarsest unit in which the periods of all `rates` are whole; periods come in the same order.
    ///
    /// # Errors
    /// [`RateError::Incommensurable`] when that unit needs more than 48 bits for a period, or 64 bits hold less than a
    /// year of it.
    pub fn new(rates: &[Rate]) -> Result<Self, RateError> {
        // The periods d_i/n_i are whole multiples of g = gcd(d_i) / lcm(n_i).
        let mut numerator = 1_u64;
        let mut denominator = 0_u64;
        for rate in rates {
            let (n, d) = rate.parts();
            numerator = lcm(numerator, n).ok_or(RateError::Incommensurable)?;
            denominator = gcd(denominator, d);
        }
        let denominator = denominator.max(1);
        let mut periods = Vec::with_capacity(rates.len());
        for rate in rates {
            let (n, d) = rate.parts();
            let period = (numerator / n).checked_mul(d / denominator);
            periods.push(period.filter(|p| *p < 1 << 48).ok_or(RateError::Incommensurable)?);
        }
        let units_per_second = Rate { numerator, denominator };
        if units_per_second.hz() > (1_u64 << 39) as f64 {
            return Err(RateError::Incommensurable);
        }
        Ok(Self { units_per_second, periods })
    }

    /// The period of clock `i` in units.
    pub fn period(&self, clock: usize) -> u64 {
        self.periods[clock]
    }

    /// Number of units in a second.
    pub fn units_per_second(&self) -> f64 {
        self.units_per_second.hz()
    }
}

/// Number of ticks of a clock with this period strictly before `unit`.
pub fn ticks_before(unit: u64, period: u64) -> u64 {
    unit.div_ceil(period)
}

/// Greatest common divisor; `gcd(0, x) = x`.
pub fn gcd(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// Least common multiple, if it fits.
pub(crate) fn lcm(a: u64, b: u64) -> Option<u64> {
    (a / gcd(a, b).max(1)).checked_mul(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hz(text: &str) -> Rate {
        Rate::parse(text).unwrap()
    }

    #[test]
    fn decimal_rates_are_exact() {
        assert_eq!(hz("59.94").parts(), (2997, 50));
        assert_eq!(hz("1e3").parts(), (1000, 1));
        assert_eq!(hz("48_000").parts(), (48000, 1));
        assert_eq!(hz("2.50").parts(), (5, 2));
        for bad in ["", "-3", "x", "1.2.3", "e", "0", "1e99", "99999999999999999999"] {
            assert!(Rate::parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_unit_too_fine_to_last_a_year_is_refused() {
        let rates = ["99991", "99989", "99971"].map(hz);
        assert_eq!(TimeBase::new(&rates), Err(RateError::Incommensurable));
        assert!(TimeBase::new(&rates[..2]).is_ok());
    }

    #[test]
    fn the_rates_of_the_thesis_share_a_unit_of_a_240_thousandth_of_a_second() {
        let base = TimeBase::new(&[hz("48000"), hz("10000"), hz("240"), hz("125"), hz("1000")]).unwrap();
        assert_eq!(base.units_per_second(), 240_000.0);
        assert_eq!((0..5).map(|i| base.period(i)).collect::<Vec<_>>(), [5, 24, 1000, 1920, 240]);
    }

    #[test]
    fn fractional_rates_share_a_unit_too() {
        let base = TimeBase::new(&[hz("0.5"), hz("1.5")]).unwrap();
        assert_eq!((base.period(0), base.period(1)), (3, 1));
    }

    #[test]
    fn ticks_split_the_same_however_time_is_cut() {
        let period = 24;
        let whole = ticks_before(1_000_000, period);
        let mut counted = 0;
        let mut unit = 0;
        for step in [1, 5, 7, 24, 25, 1000].iter().cycle() {
            let next = (unit + step).min(1_000_000);
            counted += ticks_before(next, period) - ticks_before(unit, period);
            unit = next;
            if unit == 1_000_000 {
                break;
            }
        }
        assert_eq!(counted, whole);
    }
}
