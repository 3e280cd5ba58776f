//! Comparisons of all pairs of means on one error (Tukey 1953, Kramer 1956).

use super::studentized_range::{quantile, survival};
use super::variance::Residual;
use super::{StatisticsError, all_finite, at_least, is_probability, same_length};
use serde::Serialize;

/// The difference of two means.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Comparison {
    /// The mean that is subtracted.
    pub from: usize,
    /// The mean it is subtracted from.
    pub to: usize,
    /// `to` less `from`.
    pub difference: f64,
    /// Lower end of the simultaneous interval.
    pub low: f64,
    /// Upper end of the simultaneous interval.
    pub high: f64,
    /// |difference| over its standard error by the studentized range.
    pub q: f64,
    /// P(Q >= q): adjusted for all pairs.
    pub p: f64,
}

/// Compares all pairs (0, 1), (0, 2), ..., (1, 2), ... of `means` of `counts` values each on the error of an analysis: that
/// between groups, or that within people of [`super::repeated`].
pub fn tukey(
    means: &[f64],
    counts: &[usize],
    error: &Residual,
    confidence: f64,
) -> Result<Vec<Comparison>, StatisticsError> {
    at_least("means", means.len(), 2)?;
    same_length("means and counts", means.len(), counts.len())?;
    all_finite("means", means)?;
    is_probability("confidence", confidence)?;
    at_least("values of a mean", counts.iter().copied().min().unwrap_or(0), 1)?;
    if !(error.ms > 0.0 && error.ms.is_finite() && error.df >= 1.0) {
        return Err(StatisticsError::NoVariation { what: "residuals" });
    }
    let groups = means.len();
    let bound = quantile(1.0 - confidence, groups, error.df);
    let compare = |from: usize, to: usize| {
        let difference = means[to] - means[from];
        let scale = (error.ms / 2.0 * (1.0 / counts[from] as f64 + 1.0 / counts[to] as f64)).sqrt();
        let q = difference.abs() / scale;
        let (low, high) = (difference - bound * scale, difference + bound * scale);
        Comparison { from, to, difference, low, high, q, p: survival(q, groups, error.df) }
    };
    Ok((0..groups)
        .flat_map(|from| (from + 1..groups).map(move |to| (from, to)))
        .map(|(a, b)| compare(a, b))
        .collect())
}
