//! How recordings of other people's loggers are read, and what was found and repaired on the way.

mod even;
mod repair;

pub(super) use even::{Timing, resampled, timing};
pub(super) use repair::{interpolate_missing, remove_outliers};

use std::collections::BTreeMap;
use std::fmt;

/// What a file does not say of itself. All names are those of [`COLUMNS`](super::COLUMNS) without their unit, such as `force_normal`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ImportSettings {
    /// Samples a second: rows follow evenly, whatever their times.
    pub rate_hz: Option<f64>,
    /// Units by quantity, such as `g` of `accel`; `1` is a unit that is not known.
    pub units: BTreeMap<String, String>,
    /// Columns of the file by quantity, such as `v` for `speed`.
    pub columns: BTreeMap<String, String>,
    /// Quantities that do not change, in SI.
    pub constants: BTreeMap<String, f64>,
    /// What a sample of 1.0 in a WAV file stands for, m/s².
    pub full_scale_m_s2: Option<f64>,
    /// Whether anything that would be repaired is refused.
    pub strict: bool,
}

impl ImportSettings {
    /// Takes files as they are: nothing is repaired.
    pub fn strict() -> Self {
        Self {
            strict: true,
            ..Self::default()
        }
    }

    /// Sets the unit of a quantity.
    ///
    /// # Errors
    /// Where there is no such quantity or unit.
    pub fn with_unit(mut self, quantity: &str, unit: &str) -> Result<Self, String> {
        super::csv::parse_unit(quantity, unit)?;
        self.units.insert(quantity.to_owned(), unit.to_owned());
        Ok(self)
    }

    /// Takes a quantity from the column called `column`.
    ///
    /// # Errors
    /// Where there is no such quantity.
    pub fn with_column(mut self, quantity: &str, column: &str) -> Result<Self, String> {
        super::csv::parse_unit(quantity, "1")?;
        self.columns.insert(quantity.to_owned(), column.to_owned());
        Ok(self)
    }

    /// Sets a quantity that does not change; `name` says its unit, as in `speed_mm_s`.
    ///
    /// # Errors
    /// Where there is no such quantity or unit, or the value is no number.
    pub fn with_constant(mut self, name: &str, value: &str) -> Result<Self, String> {
        let (plain, si) = super::csv::constant(name, value)?;
        self.constants.insert(plain, si);
        Ok(self)
    }
}

/// Something worth knowing of a file that was read.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)] // Display says it
pub enum Finding {
    /// Rows that were not evenly spaced, and were resampled.
    Jitter {
        rms_s: f64,
        interval_s: f64,
        rate_hz: f64,
        missing_rows: usize,
    },
    /// Times of a coarser resolution than the rows' spacing; rows count as even.
    CoarseTimes { resolution_s: f64, rate_hz: f64 },
    /// Cells that were interpolated.
    Interpolated {
        quantity: String,
        unreadable: usize,
        empty: usize,
        of: usize,
    },
    /// Single samples far off both neighbours that were interpolated.
    Outliers { quantity: String, count: usize },
    /// Larger or smaller than a hand can make it: is the unit right?
    Implausible {
        quantity: &'static str,
        largest: f64,
        unit: &'static str,
    },
    /// The unit of the vibration is not known.
    UnknownUnit,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Jitter {
                rms_s,
                interval_s,
                rate_hz,
                missing_rows,
            } => {
                let share = 100.0 * rms_s / interval_s;
                write!(f, "time stamps jitter by {:.3} ms ({share:.0} % of the interval)", rms_s * 1000.0)?;
                if *missing_rows > 0 {
                    write!(f, ", {missing_rows} rows are missing")?;
                }
                write!(f, "; resampled to {rate_hz} Hz")
            }
            Self::CoarseTimes { resolution_s, rate_hz } => write!(
                f,
                "time stamps resolve {:.3} ms, which is coarser than the rows; the rows count as even, {rate_hz:.3} a second",
                resolution_s * 1000.0
            ),
            Self::Interpolated {
                quantity,
                unreadable,
                empty,
                of,
            } => write!(
                f,
                "{quantity}: {unreadable} unreadable and {empty} empty cells of {of} were interpolated"
            ),
            Self::Outliers { quantity, count: 1 } => {
                write!(f, "{quantity}: a single outlier was replaced by its neighbours' mean")
            }
            Self::Outliers { quantity, count } => {
                write!(f, "{quantity}: {count} single outliers were replaced by their neighbours' mean")
            }
            Self::Implausible { quantity, largest, unit } => {
                write!(f, "the largest {quantity} is {largest:.3} {unit}: is its unit right?")
            }
            Self::UnknownUnit => f.write_str(
                "the unit of the vibration is not known: what is learned has no m/s², and is only as loud as the sensor's numbers",
            ),
        }
    }
}

/// The most that hand and tool make of each quantity, and the least that its largest is: quantity, SI unit, least, most.
const PLAUSIBLE: [(&str, &str, &str, f64, f64); 3] = [
    ("accel", "acceleration", "m/s2", 1e-3, 5000.0),
    ("force_normal", "normal force", "N", 1e-2, 200.0),
    ("speed", "speed", "m/s", 1e-3, 5.0),
];

/// Whether the largest magnitude of a quantity is one that hands and tools make.
pub(super) fn plausibility(name: &str, values: &[f64]) -> Option<Finding> {
    let &(_, quantity, unit, least, most) = PLAUSIBLE.iter().find(|(known, ..)| *known == name)?;
    let largest = values.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    // Silence has no unit to be wrong about.
    let is_plausible = largest == 0.0 || (least..=most).contains(&largest);
    (!is_plausible).then_some(Finding::Implausible {
        quantity,
        largest,
        unit,
    })
}
