//! Effects and what they are compared with, in any analysis of variance.

use super::StatisticsError;
use super::distributions::{f_survival, falling_root_from_zero, noncentral_f_cdf};
use serde::Serialize;

/// Confidence of the interval of partial eta squared. 90 %, so that it excludes zero just where p is below 0.05 (Steiger 2004).
const CONFIDENCE: f64 = 0.9;
/// Sum of squares over error mean square above which that interval is left out: its series has too many terms.
const LARGEST_SERIES: f64 = 1e5;

/// An effect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Term {
    /// Sum of squares.
    pub ss: f64,
    /// Degrees of freedom.
    pub df: f64,
    /// Mean square.
    pub ms: f64,
    /// Ratio to the mean square of the error.
    pub f: f64,
    /// P(F >= f).
    pub p: f64,
    /// SS / (SS + SS of the error).
    pub partial_eta_squared: f64,
    /// Its 90 % interval by the noncentral F distribution (Steiger 2004): lambda / (lambda + df + error df + 1). `None` where
    /// df * f is above 1e5.
    pub partial_eta_squared_90: Option<(f64, f64)>,
}

/// What effects are compared with.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Residual {
    /// Sum of squares.
    pub ss: f64,
    /// Degrees of freedom.
    pub df: f64,
    /// Mean square.
    pub ms: f64,
}

impl Residual {
    pub(super) fn new(ss: f64, df: f64) -> Result<Self, StatisticsError> {
        if !ss.is_finite() {
            return Err(StatisticsError::NotFinite { what: "sum of squares" });
        }
        if ss <= 0.0 {
            return Err(StatisticsError::NoVariation { what: "residuals" });
        }
        Ok(Self { ss, df, ms: ss / df })
    }

    /// The effect with this sum of squares.
    pub(super) fn term(&self, ss: f64, df: f64) -> Result<Term, StatisticsError> {
        let ss = ss.max(0.0);
        let ms = ss / df;
        let f = ms / self.ms;
        if !f.is_finite() {
            return Err(StatisticsError::NotFinite { what: "F" });
        }
        Ok(Term {
            ss,
            df,
            ms,
            f,
            p: f_survival(f, df, self.df),
            partial_eta_squared: ss / (ss + self.ss),
            partial_eta_squared_90: eta_interval(f, df, self.df),
        })
    }
}

/// The noncentralities that make `f` a likely value, as shares of variance.
fn eta_interval(f: f64, df1: f64, df2: f64) -> Option<(f64, f64)> {
    if df1 * f > LARGEST_SERIES {
        return None;
    }
    let tail = (1.0 - CONFIDENCE) / 2.0;
    let share = |level: f64| {
        let lambda = falling_root_from_zero(|lambda| noncentral_f_cdf(f, df1, df2, lambda) - level);
        lambda / (lambda + df1 + df2 + 1.0)
    };
    Some((share(1.0 - tail), share(tail)))
}

/// The sum of squared distances from `centre`.
pub(super) fn squares_about(values: &[f64], centre: f64) -> f64 {
    values.iter().map(|x| (x - centre).powi(2)).sum()
}
