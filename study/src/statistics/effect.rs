//! Sizes of differences within people, and tests that a difference is too small to matter.

use super::distributions::{falling_root, noncentral_t_cdf, t_quantile, t_survival};
use super::{Estimate, StatisticsError, all_finite, at_least, is_probability, same_length};
use haptograph_signal::statistics::{mean, standard_deviation};
use serde::Serialize;

/// t above which the interval by the noncentral distribution is not sought.
const LARGEST_T: f64 = 1e4;

/// Standardised sizes of the differences of pairs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PairedEffect {
    /// Number of pairs.
    pub count: usize,
    /// Mean difference, second less first, with its interval.
    pub difference: Estimate,
    /// Cohen's d_z: over the deviation of the differences. The interval is that of the noncentral t distribution.
    pub d_z: Estimate,
}

/// The size of the change from `first` to `second`, pair by pair.
pub fn paired_effect(
    first: &[f64],
    second: &[f64],
    confidence: f64,
) -> Result<PairedEffect, StatisticsError> {
    same_length("pairs", first.len(), second.len())?;
    all_finite("values", first).and_then(|()| all_finite("values", second))?;
    is_probability("confidence", confidence)?;
    let differences: Vec<f64> = second.iter().zip(first).map(|(b, a)| b - a).collect();
    let sample = Sample::of(&differences)?;
    let (t, df) = (sample.mean / sample.standard_error, sample.count - 1.0);
    if t.abs() > LARGEST_T {
        return Err(StatisticsError::NoVariation { what: "differences" });
    }
    let tail = (1.0 - confidence) / 2.0;
    // The probability below t falls with the noncentrality.
    let (reach, below) = (12.0 + 12.0 * t.abs() / (2.0 * df).sqrt(), |delta| noncentral_t_cdf(t, df, delta));
    let end = |level: f64| falling_root(t - reach, t + reach, |delta| below(delta) - level);
    let ends = (end(1.0 - tail), end(tail));
    let unit = sample.count.sqrt().recip();
    let half = t_quantile(1.0 - confidence, df) * sample.standard_error;
    Ok(PairedEffect {
        count: differences.len(),
        difference: Estimate { value: sample.mean, low: sample.mean - half, high: sample.mean + half },
        d_z: Estimate { value: t * unit, low: ends.0 * unit, high: ends.1 * unit },
    })
}

/// Mean and standard error of values that vary.
struct Sample {
    count: f64,
    mean: f64,
    standard_error: f64,
}

impl Sample {
    fn of(values: &[f64]) -> Result<Self, StatisticsError> {
        all_finite("values", values)?;
        at_least("values", values.len(), 2)?;
        let (mean, count) = (mean(values), values.len() as f64);
        let standard_error = standard_deviation(values) / count.sqrt();
        all_finite("variance", &[mean, standard_error])?;
        if standard_error > mean.abs() * 1e-15 {
            Ok(Self { count, mean, standard_error })
        } else {
            Err(StatisticsError::NoVariation { what: "values" })
        }
    }
}

/// Two one-sided tests that a mean lies within bounds (Schuirmann 1987).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Equivalence {
    /// Mean, with the interval of confidence 1 - 2 alpha, which lies within the bounds just where p is below alpha.
    pub mean: Estimate,
    /// p that the mean is not above the lower bound.
    pub p_low: f64,
    /// p that the mean is not below the upper bound.
    pub p_high: f64,
    /// The larger of both: p of the test.
    pub p: f64,
    /// Whether p is below alpha.
    pub equivalent: bool,
}

/// Tests that the mean of `values` (of pairs: of their differences) lies between two bounds.
pub fn equivalence(values: &[f64], bounds: (f64, f64), alpha: f64) -> Result<Equivalence, StatisticsError> {
    all_finite("bounds", &[bounds.0, bounds.1])?;
    if !(alpha > 0.0 && alpha < 0.5) {
        return Err(StatisticsError::OutOfRange { what: "alpha", value: alpha, expected: "0 to 0.5" });
    }
    if bounds.0 >= bounds.1 {
        let (what, value) = ("upper bound", bounds.1);
        return Err(StatisticsError::OutOfRange { what, value, expected: "more than the lower bound" });
    }
    let Sample { count, mean, standard_error } = Sample::of(values)?;
    let half = t_quantile(2.0 * alpha, count - 1.0) * standard_error;
    let p_low = t_survival((mean - bounds.0) / standard_error, count - 1.0);
    let p_high = t_survival((bounds.1 - mean) / standard_error, count - 1.0);
    let p = p_low.max(p_high);
    let mean = Estimate { value: mean, low: mean - half, high: mean + half };
    Ok(Equivalence { mean, p_low, p_high, p, equivalent: p < alpha })
}
