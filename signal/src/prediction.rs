//! Linear prediction: autoregressive models and the reflection coefficients that tell whether they are stable.
//!
//! Polynomials are `A(z) = 1 + sum a_k z^-k`, written `[a_1, ..., a_p]`; the thesis's `A_k` is `-a_k`.

use thiserror::Error;

/// An autoregressive model fitted to a signal or to its autocovariance.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// `[a_1, ..., a_p]` of `A(z) = 1 + sum a_k z^-k`.
    pub ar: Vec<f64>,
    /// Reflection coefficients `[k_1, ..., k_p]`, `k_m` being the last coefficient of the model of order m.
    pub reflection: Vec<f64>,
    /// Innovation variance, in the square of the signal's unit.
    pub variance: f64,
}

/// Error of making or using a model.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PredictionError {
    /// A polynomial with a root on or outside the unit circle.
    #[error(
        "A(z) is unstable: reflection coefficient k_{order} is {reflection}, and must lie between -1 and 1"
    )]
    Unstable {
        /// Which coefficient, from 1.
        order: usize,
        /// The value.
        reflection: f64,
    },
    /// A NaN or infinite coefficient.
    #[error("a coefficient is not a finite number")]
    NotFinite,
    /// Fewer lags or samples than the order needs.
    #[error("order {order} needs {needed} values and only {given} were given")]
    TooShort {
        /// The requested order.
        order: usize,
        /// Lags or samples needed.
        needed: usize,
        /// Lags or samples given.
        given: usize,
    },
    /// Lags that are not an autocovariance.
    #[error("these lags are not an autocovariance: at lag {lag} the prediction error would become negative")]
    NotAnAutocovariance {
        /// The first impossible lag.
        lag: usize,
    },
}

/// Biased autocovariance about zero, `r[m] = 1/n sum x[i] x[i+m]` for m = 0..=max_lag, in unit squared.
///
/// "About zero": subtract the mean first where the signal has one. Biased, so that the lags are always those of a
/// stable model. Lags beyond the signal are zero.
pub fn autocovariance(x: &[f64], max_lag: usize) -> Vec<f64> {
    let n = x.len().max(1) as f64;
    (0..=max_lag)
        .map(|lag| {
            let later = x.get(lag..).unwrap_or(&[]);
            later.iter().zip(x).map(|(a, b)| a * b).sum::<f64>() / n
        })
        .collect()
}

/// The autoregressive model of this order whose autocovariance begins with `r[0..=order]` (Levinson and Durbin).
///
/// A silent signal (`r[0] = 0`) gives the zero model. A signal that can be predicted perfectly (constant, periodic)
/// gives variance 0 and the shortest model that does it, on the edge of stability, its other coefficients zero.
///
/// # Errors
/// [`PredictionError::TooShort`], [`PredictionError::NotAnAutocovariance`], [`PredictionError::NotFinite`].
pub fn levinson(r: &[f64], order: usize) -> Result<Prediction, PredictionError> {
    if r.len() <= order {
        let (needed, given) = (order + 1, r.len());
        return Err(PredictionError::TooShort { order, needed, given });
    }
    if r[..=order].iter().any(|r| !r.is_finite()) {
        return Err(PredictionError::NotFinite);
    }
    if r[0] < 0.0 {
        return Err(PredictionError::NotAnAutocovariance { lag: 0 });
    }
    let mut ar = vec![0.0; order];
    let mut reflection = vec![0.0; order];
    let mut variance = r[0];
    for m in 1..=order {
        // Below this nothing is left but rounding.
        if variance <= r[0] * 1e-15 {
            break;
        }
        let lagged: f64 = (1..m).map(|i| ar[i - 1] * r[m - i]).sum();
        let k = -(r[m] + lagged) / variance;
        // Rounding may carry a perfectly predictable signal a little too far.
        if k.abs() > 1.0 + 1e-9 {
            return Err(PredictionError::NotAnAutocovariance { lag: m });
        }
        let k = k.clamp(-1.0, 1.0);
        raise_order(&mut ar[..m], k);
        reflection[m - 1] = k;
        variance *= 1.0 - k * k;
    }
    Ok(Prediction { ar, reflection, variance })
}

/// The autoregressive model that minimises forward and backward prediction errors inside the record (Burg).
///
/// # Errors
/// [`PredictionError::TooShort`] unless there are more samples than the order, [`PredictionError::NotFinite`].
pub fn burg(x: &[f64], order: usize) -> Result<Prediction, PredictionError> {
    let n = x.len();
    if n <= order {
        let (needed, given) = (order + 1, n);
        return Err(PredictionError::TooShort { order, needed, given });
    }
    if x.iter().any(|x| !x.is_finite()) {
        return Err(PredictionError::NotFinite);
    }
    let mut forward = x.to_vec();
    let mut backward = x.to_vec();
    let mut ar = vec![0.0; order];
    let mut reflection = vec![0.0; order];
    let mut variance = x.iter().map(|x| x * x).sum::<f64>() / n as f64;
    for m in 1..=order {
        let (mut product, mut energy) = (0.0, 0.0);
        for i in m..n {
            product += forward[i] * backward[i - 1];
            energy += forward[i] * forward[i] + backward[i - 1] * backward[i - 1];
        }
        if energy <= 0.0 {
            break;
        }
        let k = -2.0 * product / energy;
        for i in (m..n).rev() {
            let (f, b) = (forward[i], backward[i - 1]);
            forward[i] = f + k * b;
            backward[i] = b + k * f;
        }
        raise_order(&mut ar[..m], k);
        reflection[m - 1] = k;
        variance *= 1.0 - k * k;
    }
    Ok(Prediction { ar, reflection, variance })
}

/// Reflection coefficients of a stable polynomial (step-down recursion).
///
/// # Errors
/// [`PredictionError::Unstable`] when a root lies on or outside the unit circle, [`PredictionError::NotFinite`].
pub fn ar_to_reflection(ar: &[f64]) -> Result<Vec<f64>, PredictionError> {
    let mut reflection = ar.to_vec();
    step_down(&mut reflection)?;
    Ok(reflection)
}

/// The power of white noise of variance 1 after `B(z)/A(z)`, both monic: `[b_1, ..., b_q]` over `[a_1, ..., a_p]`.
///
/// Exact up to rounding: a sum of squares over the orthogonal backward signals of the lattice (Gray and Markel 1973).
///
/// # Errors
/// [`PredictionError::Unstable`] and [`PredictionError::NotFinite`].
pub fn power_gain(ar: &[f64], ma: &[f64]) -> Result<f64, PredictionError> {
    let order = ar.len().max(ma.len());
    let mut taps = vec![0.0; order + 1];
    let (mut sine, mut cosine, mut scratch) = (vec![0.0; order], vec![0.0; order], vec![0.0; order]);
    ladder(ar, ma, &mut sine, &mut cosine, &mut taps, &mut scratch)?;
    Ok(taps.iter().map(|v| v * v).sum())
}

/// Turns `[a_1, ..., a_p]` into the reflection coefficients `[k_1, ..., k_p]` in place. Real-time safe.
///
/// # Errors
/// As of [`ar_to_reflection`]; the numbers are then meaningless.
pub fn step_down(ar: &mut [f64]) -> Result<(), PredictionError> {
    for m in (1..=ar.len()).rev() {
        lower_order(&mut ar[..m])?;
    }
    Ok(())
}

/// Turns reflection coefficients `[k_1, ..., k_p]` into `[a_1, ..., a_p]` in place; stable if all lie between -1 and 1. Real-time safe.
pub fn step_up(reflection: &mut [f64]) {
    for m in 1..=reflection.len() {
        let k = reflection[m - 1];
        raise_order(&mut reflection[..m], k);
    }
}

/// [`step_down`] of as many polynomials as there are lanes, row k the coefficients `a_{k+1}` of all, with the same
/// bits.
///
/// Returns true if all are stable; otherwise the rows are meaningless.
#[inline(always)]
#[must_use]
pub(crate) fn step_down_lanes<const L: usize>(rows: &mut [[f64; L]]) -> bool {
    let mut unstable = [0.0; L];
    for order in (1..=rows.len()).rev() {
        lower_order_lanes(&mut rows[..order], &mut unstable);
    }
    unstable == [0.0; L]
}

/// [`lower_order`] of as many polynomials as there are lanes; adds to `unstable` where one is.
#[inline(always)]
fn lower_order_lanes<const L: usize>(rows: &mut [[f64; L]], unstable: &mut [f64; L]) {
    let lower = rows.len() - 1;
    let (k, mut scale) = (rows[lower], [0.0; L]);
    for l in 0..L {
        unstable[l] += if k[l].abs() < 1.0 { 0.0 } else { 1.0 };
        scale[l] = 1.0 / (1.0 - k[l] * k[l]);
    }
    for i in 0..lower / 2 {
        let (near, far) = (rows[i], rows[lower - 1 - i]);
        for l in 0..L {
            rows[i][l] = (near[l] - k[l] * far[l]) * scale[l];
            rows[lower - 1 - i][l] = (far[l] - k[l] * near[l]) * scale[l];
        }
    }
    if lower % 2 == 1 {
        for (middle, k) in rows[lower / 2].iter_mut().zip(k) {
            *middle /= 1.0 + k;
        }
    }
}

/// [`ladder`] of as many filters as there are lanes, with the same bits: `sine` has the coefficients of `A(z)`, then 0, and `taps`
/// those of `B(z)` from 1 on, then 0, a row each.
///
/// Returns true if all are stable; otherwise the rows are meaningless. The taps of a stable one may be infinite.
#[inline(always)]
#[must_use]
pub(crate) fn ladder_lanes<const L: usize>(
    has_ladder: bool,
    sine: &mut [[f64; L]],
    cosine: &mut [[f64; L]],
    taps: &mut [[f64; L]],
) -> bool {
    let mut unstable = [0.0; L];
    for m in (1..=sine.len()).rev() {
        if has_ladder {
            let tap = taps[m];
            for (below, a) in taps[..m].iter_mut().zip(sine[..m].iter().rev()) {
                for l in 0..L {
                    below[l] -= tap[l] * a[l];
                }
            }
        }
        lower_order_lanes(&mut sine[..m], &mut unstable);
    }
    let mut deviation = [1.0; L];
    for m in (0..sine.len()).rev() {
        if has_ladder {
            for (tap, deviation) in taps[m + 1].iter_mut().zip(deviation) {
                *tap /= deviation;
            }
        }
        for l in 0..L {
            cosine[m][l] = (1.0 - sine[m][l] * sine[m][l]).sqrt();
            deviation[l] *= cosine[m][l];
        }
    }
    for l in 0..L {
        taps[0][l] /= deviation[l];
    }
    unstable == [0.0; L]
}

/// The normalised lattice-ladder of `B(z)/A(z)`, of order `sine.len()`: reflection coefficients, `sqrt(1 - k^2)`, and
/// the taps on the unit-power backward signals, one more than the order. `scratch` has as many values as the order.
pub(crate) fn ladder(
    ar: &[f64],
    ma: &[f64],
    sine: &mut [f64],
    cosine: &mut [f64],
    taps: &mut [f64],
    scratch: &mut [f64],
) -> Result<(), PredictionError> {
    if ma.iter().any(|b| !b.is_finite()) {
        return Err(PredictionError::NotFinite);
    }
    let polynomial = scratch;
    polynomial.fill(0.0);
    polynomial[..ar.len()].copy_from_slice(ar);
    taps.fill(0.0);
    taps[0] = 1.0;
    taps[1..=ma.len()].copy_from_slice(ma);
    for m in (1..=sine.len()).rev() {
        // B(z) loses its z^-m term to the backward polynomial z^-m A_m(1/z).
        let tap = taps[m];
        if tap != 0.0 {
            for (tap_below, a) in taps[..m].iter_mut().zip(polynomial[..m].iter().rev()) {
                *tap_below -= tap * a;
            }
        }
        lower_order(&mut polynomial[..m])?;
    }
    for ((sine, cosine), k) in sine.iter_mut().zip(&mut *cosine).zip(&*polynomial) {
        (*sine, *cosine) = (*k, (1.0 - k * k).sqrt());
    }
    // For white noise of variance 1 going in, the backward signal of order m has this deviation's inverse.
    let mut deviation = 1.0;
    for (m, tap) in taps.iter_mut().enumerate().rev() {
        if *tap != 0.0 {
            *tap /= deviation;
        }
        if m > 0 {
            deviation *= cosine[m - 1];
        }
    }
    if taps.iter().all(|tap| tap.is_finite()) { Ok(()) } else { Err(PredictionError::NotFinite) }
}

/// Steps up from the polynomial of order m - 1 in `ar[..m-1]` to that of order m.
fn raise_order(ar: &mut [f64], k: f64) {
    let lower = ar.len() - 1;
    ar[lower] = k;
    for i in 0..lower / 2 {
        let (near, far) = (ar[i], ar[lower - 1 - i]);
        ar[i] = near + k * far;
        ar[lower - 1 - i] = far + k * near;
    }
    if lower % 2 == 1 {
        ar[lower / 2] *= 1.0 + k;
    }
}

/// Steps down from the polynomial of order m in `ar` to that of order m - 1 in `ar[..m-1]`; `k_m` stays in `ar[m-1]`.
fn lower_order(ar: &mut [f64]) -> Result<(), PredictionError> {
    let lower = ar.len() - 1;
    let k = ar[lower];
    if !k.is_finite() {
        return Err(PredictionError::NotFinite);
    }
    if k.abs() >= 1.0 {
        let (order, reflection) = (ar.len(), k);
        return Err(PredictionError::Unstable { order, reflection });
    }
    let scale = 1.0 / (1.0 - k * k);
    for i in 0..lower / 2 {
        let (near, far) = (ar[i], ar[lower - 1 - i]);
        ar[i] = (near - k * far) * scale;
        ar[lower - 1 - i] = (far - k * near) * scale;
    }
    if lower % 2 == 1 {
        ar[lower / 2] /= 1.0 + k;
    }
    Ok(())
}

#[cfg(test)]
pub(crate) mod tests;
