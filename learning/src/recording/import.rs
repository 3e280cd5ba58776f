//! Settings for reading tables of any logger, and findings about what was repaired.

mod even;
mod offset;
mod repair;

pub(super) use even::{Timing, resampled, timing};
pub use offset::remove_offset;
pub(crate) use repair::clipped;
pub(super) use repair::{interpolate_missing, remove_outliers};

pub(super) use haptograph_surfaces::bounds::shown;

use super::error::listed;
use std::collections::BTreeMap;
use std::fmt;

/// Information that a file does not contain. All names are those of [`COLUMNS`](super::COLUMNS) without their unit, such as
/// `force_normal`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ImportSettings {
    /// Samples per second; overrides the times in the file, and rows count as evenly spaced.
    pub rate_hz: Option<f64>,
    /// Units by quantity, such as `g` of `accel`; `1` means an unknown unit.
    pub units: BTreeMap<String, String>,
    /// Columns of the file by quantity, such as `v` for `speed`.
    pub columns: BTreeMap<String, String>,
    /// Constant quantities, in SI.
    pub constants: BTreeMap<String, f64>,
    /// The acceleration that a sample of 1.0 in a WAV file represents, m/s².
    pub full_scale_m_s2: Option<f64>,
    /// Refuses a file instead of repairing it.
    pub strict: bool,
    /// Low-pass of the velocity from positions, Hz; `None` for the usual one of
    /// [`ProcessingSettings`](crate::processing::ProcessingSettings).
    pub velocity_lowpass_hz: Option<f64>,
    /// Facts about what touched the surface, by the names of [`TOUCH`](haptograph_surfaces::provenance::TOUCH); they replace the file's.
    pub touch: BTreeMap<String, String>,
    /// Keeps the mean of the acceleration, for callers that do not use the vibration.
    pub keeps_offset: bool,
}

impl ImportSettings {
    /// Settings that repair nothing.
    pub fn strict() -> Self {
        Self { strict: true, ..Self::default() }
    }

    /// Sets the unit of a quantity.
    ///
    /// # Errors
    /// An unknown quantity or unit.
    pub fn with_unit(mut self, quantity: &str, unit: &str) -> Result<Self, String> {
        super::csv::parse_unit(quantity, unit)?;
        self.units.insert(quantity.to_owned(), unit.to_owned());
        Ok(self)
    }

    /// Takes a quantity from the column called `column`.
    ///
    /// # Errors
    /// An unknown quantity.
    pub fn with_column(mut self, quantity: &str, column: &str) -> Result<Self, String> {
        super::csv::parse_unit(quantity, "1")?;
        self.columns.insert(quantity.to_owned(), column.to_owned());
        Ok(self)
    }

    /// Sets a constant quantity; `name` contains its unit, as in `speed_mm_s`.
    ///
    /// # Errors
    /// An unknown quantity or unit, or a value that is not a number.
    pub fn with_constant(mut self, name: &str, value: &str) -> Result<Self, String> {
        let (plain, si) = super::csv::constant(name, value)?;
        self.constants.insert(plain, si);
        Ok(self)
    }
}

/// A cell that could not be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadCell {
    /// Line in the file, from 1.
    pub line: u64,
    /// Column in the file, from 1.
    pub column: usize,
    /// The text, if known.
    pub text: Option<String>,
}

/// A finding about a file that was read.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)] // see Display
pub enum Finding {
    /// Columns that are not used.
    NotUsed { columns: Vec<String> },
    /// The given unit differs from the file's.
    OtherUnit { column: String, given: String },
    /// Rows that were not evenly spaced, and were resampled.
    Jitter { rms_s: f64, interval_s: f64, rate_hz: f64, missing_rows: usize },
    /// Times have a coarser resolution than the spacing of rows; rows count as evenly spaced.
    CoarseTimes { resolution_s: f64, rate_hz: f64 },
    /// A rate at which vibrations are not recorded: the time unit is probably wrong.
    StrangeRate { column: String, rate_hz: f64 },
    /// Cells that were interpolated, and the first that could not be read.
    Interpolated { quantity: String, unreadable: usize, empty: usize, of: usize, first: Option<BadCell> },
    /// Single outlying samples that were interpolated.
    Outliers { quantity: String, count: usize },
    /// Samples that stay at the largest or smallest value.
    Clipped { quantity: String, count: usize, of: usize },
    /// One file of a take begins later or ends earlier than another; the part outside it is not used.
    Cut { begins: bool, short: String, short_s: f64, long: String, long_s: f64 },
    /// A magnitude outside what a hand can produce: the unit is probably wrong.
    Implausible {
        quantity: &'static str,
        column: String,
        largest: f64,
        unit: &'static str,
        advice: &'static str,
    },
    /// The unit of the vibration is not known.
    UnknownUnit,
    /// A vibration with a mean, which no processed vibration has: it was high-passed.
    HighPassed {
        column: String,
        mean: f64,
        cutoff_hz: f64,
        /// True if the mean is in m/s².
        has_unit: bool,
    },
    /// A column with another name whose quantity is nevertheless certain.
    TakenAs { column: String, quantity: String },
    /// The speed was computed from these columns of positions.
    SpeedOfPosition { columns: Vec<String>, cutoff_hz: f64 },
    /// A column of times that is not used, because a rate was given.
    TimesNotUsed { column: String },
}

impl Finding {
    /// True if numbers of the file were replaced, moved or left out.
    pub const fn is_repair(&self) -> bool {
        use Finding::{Clipped, CoarseTimes, Cut, HighPassed, Interpolated, Jitter, Outliers};
        matches!(
            self,
            Clipped { .. }
                | CoarseTimes { .. }
                | Cut { .. }
                | HighPassed { .. }
                | Interpolated { .. }
                | Jitter { .. }
                | Outliers { .. }
        )
    }

    /// What follows for a surface that is learned from the file.
    pub const fn consequence(&self) -> &'static str {
        match self {
            Self::NotUsed { .. } => "nothing is learned from them",
            Self::OtherUnit { .. } => "levels are wrong if the file is right",
            Self::Jitter { .. } => {
                "samples between rows are computed, so the highest frequencies become weaker"
            }
            Self::CoarseTimes { .. } => "missing rows cannot be seen",
            Self::StrangeRate { .. } => "with a wrong unit of time all frequencies and rates are wrong",
            Self::Interpolated { .. } => "straight lines in their place are learned as if they had been felt",
            Self::Outliers { .. } => "single samples are not learned; a surface with real clicks loses these",
            Self::Clipped { .. } => {
                "the strongest vibration is learned too weak; record again with a larger range"
            }
            Self::Cut { .. } => "only what all files hold is learned",
            Self::Implausible { .. } => "the surface is too strong or too weak if the unit is wrong",
            Self::UnknownUnit => "the surface can be compared with no other",
            Self::HighPassed { .. } => "gravity and offset are taken out, and with them slower vibration",
            Self::TakenAs { .. } => "choose another column if this one holds something else",
            Self::SpeedOfPosition { .. } => "faster changes of speed are smoothed",
            Self::TimesNotUsed { .. } => "missing rows cannot be seen",
        }
    }
}

/// A number for a message: three digits.
fn digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::NotUsed { columns } => write!(f, "columns not used: {}", listed(columns)),
            Self::OtherUnit { column, given } => {
                write!(f, "column {column:?} names another unit; --unit {given} overrides it")
            }
            Self::Jitter {
                rms_s,
                interval_s,
                rate_hz,
                missing_rows,
            } => {
                let share = 100.0 * rms_s / interval_s;
                let jitter = format!("time stamps jitter by {:.3} ms ({share:.0} % of the interval)", rms_s * 1000.0);
                let missing = match missing_rows {
                    1 => "1 row is missing".to_owned(),
                    _ => format!("{missing_rows} rows are missing"),
                };
                let what = match (share >= 0.5, *missing_rows > 0) {
                    (true, true) => format!("{jitter}, {missing}"),
                    (true, false) => jitter,
                    (false, true) => missing,
                    (false, false) => "time stamps are not even".to_owned(),
                };
                write!(f, "{what}; resampled to {} Hz", shown(*rate_hz))
            }
            Self::CoarseTimes { resolution_s, rate_hz } => write!(
                f,
                "time stamps resolve {:.3} ms, which is coarser than the rows; rows are read as evenly spaced at {rate_hz:.3} Hz",
                resolution_s * 1000.0
            ),
            Self::StrangeRate { column, rate_hz } => {
                let unit = if *rate_hz < 1000.0 { "ms" } else { "s" };
                write!(
                    f,
                    "column {column:?} gives {0} rows per second; if its unit is {unit}, add --unit time={unit}",
                    shown(*rate_hz)
                )
            }
            Self::Interpolated {
                quantity,
                unreadable,
                empty,
                of,
                first,
            } => {
                write!(f, "{quantity}: {unreadable} unreadable and {empty} empty cells of {of} were interpolated")?;
                let Some(BadCell { line, column, text }) = first else {
                    return Ok(());
                };
                write!(f, "; the first unreadable one is in line {line}, column {column}")?;
                text.as_ref().map_or(Ok(()), |text| write!(f, ": {text:?}"))
            }
            Self::Outliers { quantity, count: 1 } => {
                write!(f, "{quantity}: a single outlier was replaced by the mean of its neighbours")
            }
            Self::Outliers { quantity, count } => {
                write!(f, "{quantity}: {count} single outliers were replaced by the mean of their neighbours")
            }
            Self::Clipped { quantity, count, of } => {
                write!(f, "{quantity} is clipped: {count} of {of} samples are at its largest or smallest value")
            }
            Self::Cut {
                begins,
                short,
                short_s,
                long,
                long_s,
            } => {
                let verb = if *begins { "begins" } else { "ends" };
                let rest = shown((long_s - short_s).abs());
                let (short_s, long_s) = (shown(*short_s), shown(*long_s));
                write!(f, "{short} {verb} at {short_s} s, {long} at {long_s} s: {rest} s of {long} are not used")
            }
            Self::Implausible {
                quantity,
                column,
                largest,
                unit,
                advice,
            } => {
                let largest = shown(*largest);
                write!(f, "the largest {quantity} in column {column:?} is {largest} {unit}, {advice}")
            }
            Self::HighPassed {
                column,
                mean,
                cutoff_hz,
                has_unit,
            } => {
                let unit = if *has_unit { " m/s² (gravity?)" } else { "" };
                write!(f, "{column}: the mean is {}{unit}: high-passed at {cutoff_hz} Hz", digits(*mean))
            }
            Self::TakenAs { column, quantity } => write!(f, "column {column:?} is taken as {quantity}"),
            Self::SpeedOfPosition { columns, cutoff_hz } => write!(
                f,
                "the speed is the derivative of {}, low-passed at {cutoff_hz} Hz",
                listed(columns)
            ),
            Self::TimesNotUsed { column } => {
                write!(f, "column {column:?} is not used because --sample-rate gives the rate; gaps cannot be detected")
            }
            Self::UnknownUnit => f.write_str(
                "the unit of the vibration is unknown: the learned texture is not in m/s², and its level is that of the sensor's numbers",
            ),
        }
    }
}

/// The plausible range of a quantity, and the advice below and above it.
struct Plausible {
    name: &'static str,
    quantity: &'static str,
    unit: &'static str,
    least: f64,
    most: f64,
    too_small: &'static str,
    too_large: &'static str,
}

const PLAUSIBLE: [Plausible; 3] = [
    Plausible {
        name: "accel",
        quantity: "acceleration",
        unit: "m/s2",
        least: 1e-3,
        most: 5000.0,
        too_small: "less than any sensor's noise; if the unit is g, add --unit accel=g",
        too_large: "more than any tool produces; if the unit is mm/s2, add --unit accel=mm/s2",
    },
    Plausible {
        name: "force_normal",
        quantity: "normal force",
        unit: "N",
        least: 1e-2,
        most: 200.0,
        too_small: "less than any hand exerts; if the unit is N, add --unit force_normal=N",
        too_large: "more than any hand exerts; if the unit is mN, add --unit force_normal=mN",
    },
    Plausible {
        name: "speed",
        quantity: "speed",
        unit: "m/s",
        least: 1e-3,
        most: 5.0,
        too_small: "slower than any stroke; if the unit is m/s, add --unit speed=m/s",
        too_large: "faster than any hand; if the unit is mm/s, add --unit speed=mm/s",
    },
];

/// The advice about a number that no sensor gives.
pub(super) fn too_large(name: &str) -> &'static str {
    let plausible = PLAUSIBLE.iter().find(|known| known.name == name);
    plausible.map_or("check the cell and the unit", |known| known.too_large)
}

/// A finding if the largest magnitude of a quantity is implausible.
pub(super) fn plausibility(name: &str, column: &str, values: &[f64]) -> Option<Finding> {
    let plausible = PLAUSIBLE.iter().find(|known| known.name == name)?;
    let largest = values.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    // Zeros are zero in every unit.
    if largest == 0.0 || (plausible.least..=plausible.most).contains(&largest) {
        return None;
    }
    Some(Finding::Implausible {
        quantity: plausible.quantity,
        column: column.to_owned(),
        largest,
        unit: plausible.unit,
        advice: match largest < plausible.least {
            true => plausible.too_small,
            false => plausible.too_large,
        },
    })
}
