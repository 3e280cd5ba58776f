//! Linear regression by least squares, and correlation.

use super::distributions::{f_survival, normal_quantile, t_quantile, t_two_sided};
use super::variance::squares_about;
use super::{Estimate, StatisticsError, all_finite, at_least, is_probability, same_length};
use haptograph_signal::statistics::mean;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Diagonal of the triangular factor, over the norm of the column, below which a column depends on those before it.
const DEPENDENT: f64 = 1e-10;

/// A coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Coefficient {
    /// The estimate, with its 95 % interval.
    pub estimate: Estimate,
    /// Its standard error.
    pub standard_error: f64,
    /// The estimate over its standard error.
    pub t: f64,
    /// Two-sided p.
    pub p: f64,
}

/// A linear regression.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Regression {
    /// The intercept, if the model has one.
    pub intercept: Option<Coefficient>,
    /// One a predictor.
    pub coefficients: Vec<Coefficient>,
    /// Share of the variance explained: about the mean, or, without an intercept, about zero (as in R).
    pub r_squared: f64,
    /// F of all predictors together.
    pub f: f64,
    /// Degrees of freedom of the predictors and of the error.
    pub df: (f64, f64),
    /// P(F >= f).
    pub p: f64,
}

/// Least squares: y = intercept + sum of b x, with a slice of values for each predictor.
pub fn regress<C: AsRef<[f64]>>(
    predictors: &[C],
    y: &[f64],
    with_intercept: bool,
) -> Result<Regression, StatisticsError> {
    at_least("predictors", predictors.len(), 1)?;
    let first = usize::from(with_intercept);
    let width = predictors.len() + first;
    at_least("values", y.len(), width + 1)?;
    all_finite("values", y)?;
    for predictor in predictors {
        same_length("values and predictors", y.len(), predictor.as_ref().len())?;
        all_finite("predictors", predictor.as_ref())?;
    }
    let entry = |row: usize, column: usize| match column.checked_sub(first) {
        None => 1.0,
        Some(predictor) => predictors[predictor].as_ref()[row],
    };
    let values = DVector::from_column_slice(y);
    let fit = least_squares(DMatrix::from_fn(y.len(), width, entry), &values)?;
    let df = (predictors.len() as f64, (y.len() - width) as f64);
    let total = squares_about(y, if with_intercept { mean(y) } else { 0.0 });
    if total <= 0.0 {
        return Err(StatisticsError::NoVariation { what: "values" });
    }
    let r_squared = 1.0 - fit.left / total;
    let variance = fit.left / df.1;
    let f = (total - fit.left).max(0.0) / df.0 / variance;
    let bound = t_quantile(0.05, df.1);
    let mut coefficients: Vec<Coefficient> = (0..width)
        .map(|i| Coefficient::new(fit.solution[i], (variance * fit.inverse_diagonal[i]).sqrt(), df.1, bound))
        .collect();
    all_finite("sums of squares", &[total, fit.left])?;
    Ok(Regression {
        intercept: with_intercept.then(|| coefficients.remove(0)),
        coefficients,
        r_squared,
        f,
        df,
        p: f_survival(f, df.0, df.1),
    })
}

impl Coefficient {
    fn new(value: f64, standard_error: f64, df: f64, bound: f64) -> Self {
        let (t, reach) = (value / standard_error, bound * standard_error);
        let estimate = Estimate { value, low: value - reach, high: value + reach };
        Self { estimate, standard_error, t, p: t_two_sided(t, df) }
    }
}

/// A solved problem of least squares.
struct LeastSquares {
    solution: DVector<f64>,
    /// Sum of squared residuals.
    left: f64,
    /// Diagonal of the inverse of the normal matrix.
    inverse_diagonal: Vec<f64>,
}

/// Solves by QR, whose columns are first scaled to length 1. An error if the columns depend on each other.
fn least_squares(mut design: DMatrix<f64>, y: &DVector<f64>) -> Result<LeastSquares, StatisticsError> {
    let undetermined = StatisticsError::Undetermined { what: "predictors" };
    let lengths: Vec<f64> = design.column_iter().map(|column| column.norm()).collect();
    if design.nrows() < design.ncols() || !lengths.iter().all(|&length| length > 0.0) {
        return Err(undetermined);
    }
    all_finite("predictors", &lengths)?;
    for (mut column, length) in design.column_iter_mut().zip(&lengths) {
        column /= *length;
    }
    let qr = design.clone().qr();
    let r = qr.r();
    if r.diagonal().iter().any(|d| d.abs() < DEPENDENT) {
        return Err(undetermined);
    }
    let inverse = r.clone().try_inverse().ok_or(undetermined)?;
    let scaled = &inverse * (qr.q().transpose() * y);
    let left = (y - design * &scaled).norm_squared();
    let inverse_diagonal =
        inverse.row_iter().zip(&lengths).map(|(row, l)| row.norm_squared() / l / l).collect();
    let solution = DVector::from_iterator(lengths.len(), scaled.iter().zip(&lengths).map(|(b, l)| b / l));
    Ok(LeastSquares { solution, left, inverse_diagonal })
}

/// The sum of squared residuals of a design.
pub(super) fn residual_sum(design: DMatrix<f64>, y: &DVector<f64>) -> Result<f64, StatisticsError> {
    least_squares(design, y).map(|fit| fit.left).map_err(|error| match error {
        StatisticsError::Undetermined { .. } => StatisticsError::Undetermined { what: "levels" },
        error => error,
    })
}

/// A correlation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Correlation {
    /// The coefficient with its interval by Fisher's transformation; NaN ends below four values.
    pub r: Estimate,
    /// Number of pairs of values.
    pub count: usize,
    /// Two-sided p by t on count - 2 degrees of freedom.
    pub p: f64,
}

/// The correlation of values, its p, and the interval of the given confidence.
pub fn pearson(x: &[f64], y: &[f64], confidence: f64) -> Result<Correlation, StatisticsError> {
    let value = coefficient(x, y)?;
    correlation(value, x.len(), confidence)
}

fn coefficient(x: &[f64], y: &[f64]) -> Result<f64, StatisticsError> {
    same_length("values", x.len(), y.len())?;
    at_least("pairs of values", x.len(), 3)?;
    all_finite("values", x).and_then(|()| all_finite("values", y))?;
    let centred = |values: &[f64]| {
        let size = values.iter().fold(f64::MIN_POSITIVE, |size, v| v.abs().max(size));
        let mean = mean(&values.iter().map(|v| v / size).collect::<Vec<_>>());
        let centred = DVector::from_iterator(values.len(), values.iter().map(|v| v / size - mean));
        // Less than this is what rounding leaves of a constant.
        if centred.amax() > 1e-15 {
            Ok(centred)
        } else {
            Err(StatisticsError::NoVariation { what: "values" })
        }
    };
    let (x, y) = (centred(x)?, centred(y)?);
    Ok((x.dot(&y) / (x.norm() * y.norm())).clamp(-1.0, 1.0))
}

fn correlation(r: f64, count: usize, confidence: f64) -> Result<Correlation, StatisticsError> {
    is_probability("confidence", confidence)?;
    let (n, df) = (count as f64, count as f64 - 2.0);
    let p = t_two_sided(r * (df / ((1.0 - r) * (1.0 + r))).sqrt(), df);
    let reach =
        if count > 3 { normal_quantile(1.0 - confidence) * (n - 3.0).sqrt().recip() } else { f64::NAN };
    let at = |sign: f64| if r.abs() < 1.0 { (r.atanh() + sign * reach).tanh() } else { r };
    Ok(Correlation { r: Estimate { value: r, low: at(-1.0), high: at(1.0) }, count, p })
}

/// Pearson's correlations of all pairs of variables: row and column i are the i-th variable.
pub fn correlation_matrix<C: AsRef<[f64]>>(
    variables: &[C],
    confidence: f64,
) -> Result<Vec<Vec<Correlation>>, StatisticsError> {
    at_least("variables", variables.len(), 2)?;
    let row = |a: &C| variables.iter().map(|b| pearson(a.as_ref(), b.as_ref(), confidence)).collect();
    variables.iter().map(row).collect()
}
