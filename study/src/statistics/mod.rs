//! Tests, intervals and fits of what participants answered.
//!
//! Pure functions over slices: nothing is read or written, the same input and seed give the same output, and no input panics. A
//! missing cell is NaN where a function says so; elsewhere NaN and infinity are errors.
//!
//! - [`anova`]: one-way and two-way analysis of variance between groups.
//! - [`repeated`]: one-way and two-way analysis of variance within people.
//! - [`studentized_range`], [`tukey`]: comparisons of all pairs of means.
//! - [`ranks`]: Friedman, Wilcoxon, Holm.
//! - [`regression`]: least squares and correlation.
//! - [`space`]: a map of stimuli by their dissimilarities, and their tree.
//! - [`effect`]: standardised differences and tests of equivalence.
//! - [`psychometric`]: psychometric functions by maximum likelihood.

pub mod anova;
mod distributions;
pub mod effect;
pub mod psychometric;
pub mod ranks;
pub mod regression;
pub mod repeated;
pub mod share;
pub mod space;
pub mod studentized_range;
pub mod tukey;
mod variance;

use haptograph_signal::statistics::{mean, standard_deviation};
use nalgebra::DMatrix;
use serde::Serialize;
use thiserror::Error;

/// Why a statistic cannot be computed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StatisticsError {
    /// Fewer values than the statistic needs.
    #[error("too few {what}: {found}, at least {needed} are needed")]
    TooFew {
        /// What is counted.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there have to be.
        needed: usize,
    },
    /// Slices whose values belong together differ in length.
    #[error("{what} differ in length: {first} and {second}")]
    Lengths {
        /// The slices.
        what: &'static str,
        /// Length of the first.
        first: usize,
        /// Length of the one that differs.
        second: usize,
    },
    /// A value, or what follows from it, is NaN or infinite.
    #[error("{what}: NaN, infinite or too large")]
    NotFinite {
        /// What is not finite.
        what: &'static str,
    },
    /// Without variation there is nothing to compare a difference with.
    #[error("{what} do not vary")]
    NoVariation {
        /// What does not vary.
        what: &'static str,
    },
    /// The values do not determine all coefficients.
    #[error("{what} cannot be told apart: some depend linearly on others, or combinations are missing")]
    Undetermined {
        /// What depends on each other.
        what: &'static str,
    },
    /// A setting outside of its range.
    #[error("{what} is {value}; expected {expected}")]
    OutOfRange {
        /// The setting.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Its range.
        expected: &'static str,
    },
}

/// An estimate and its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// The mean of values with its interval by t.
pub(crate) fn mean_interval(values: &[f64], confidence: f64) -> Result<Estimate, StatisticsError> {
    at_least("values", values.len(), 2)?;
    all_finite("values", values)?;
    is_probability("confidence", confidence)?;
    let (value, count) = (mean(values), values.len() as f64);
    let reach =
        distributions::t_quantile(1.0 - confidence, count - 1.0) * standard_deviation(values) / count.sqrt();
    Ok(Estimate { value, low: value - reach, high: value + reach })
}

/// An error unless every value is finite.
fn all_finite(what: &'static str, values: &[f64]) -> Result<(), StatisticsError> {
    if values.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(StatisticsError::NotFinite { what }) }
}

/// An error unless there are at least `needed`.
fn at_least(what: &'static str, found: usize, needed: usize) -> Result<(), StatisticsError> {
    if found < needed { Err(StatisticsError::TooFew { what, found, needed }) } else { Ok(()) }
}

/// An error unless both lengths are the same.
fn same_length(what: &'static str, first: usize, second: usize) -> Result<(), StatisticsError> {
    if first == second { Ok(()) } else { Err(StatisticsError::Lengths { what, first, second }) }
}

/// An error unless `value` lies strictly between 0 and 1.
fn is_probability(what: &'static str, value: f64) -> Result<(), StatisticsError> {
    if value > 0.0 && value < 1.0 {
        return Ok(());
    }
    Err(StatisticsError::OutOfRange { what, value, expected: "a number between 0 and 1" })
}

/// The rows without a missing cell.
fn complete<R: AsRef<[f64]>>(rows: &[R], cells: usize) -> Result<DMatrix<f64>, StatisticsError> {
    let mut kept = Vec::new();
    for row in rows.iter().map(AsRef::as_ref) {
        same_length("rows and conditions", cells, row.len())?;
        if !row.iter().any(|x| x.is_nan()) {
            all_finite("ratings", row)?;
            kept.extend_from_slice(row);
        }
    }
    let people = kept.len() / cells.max(1);
    at_least("people without a missing cell", people, 2)?;
    Ok(DMatrix::from_row_slice(people, cells, &kept))
}
