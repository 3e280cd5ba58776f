//! Exact zero-order hold: the filter's output at every R-th sample for an input that changes only there.

use super::FilterError;
use super::roots;
use crate::ArmaModel;
use haptograph_signal::Complex64;

/// Zeros closer to the unit circle are moved to this radius, since they would have no line spectral
/// frequencies.
const LARGEST_ZERO: f64 = 1.0 - 2e-6;

/// Resamples `model` to a rate `ratio` times lower; the variance is scaled with the rate (Eq. 4.2.2).
pub(super) fn resample(model: &ArmaModel, ratio: usize) -> Result<ArmaModel, FilterError> {
    let (poles_count, zeros_count) = (model.ar().len(), model.ma().len());
    let ar = roots::monic(&poles(model, ratio)?);
    // If the hold is not longer than the delay between the orders, the last coefficient is zero.
    let order =
        if ratio + zeros_count <= poles_count { poles_count - 1 } else { poles_count.max(zeros_count) };
    // h2[0] = h1[0], h2[m] = sum of h1[k], k = R(m-1)+1 .. Rm.
    let fast = impulse_response(model, ratio * order + 1);
    let slow: Vec<f64> = std::iter::once(fast[0])
        .chain((1..=order).map(|m| fast[ratio * (m - 1) + 1..=ratio * m].iter().sum()))
        .collect();
    let (ma, gain) = minimum_phase(&numerator(&ar, &slow))?;
    Ok(ArmaModel::from_arma(&ar, &ma, gain, model.variance() / ratio as f64)?)
}

/// The polynomial with the same spectrum and all zeros inside the unit circle, as a monic polynomial and a
/// gain: each zero outside is reflected to 1 / conj(z) and the gain multiplied by |z| (checklist F17).
fn minimum_phase(polynomial: &[f64]) -> Result<(Vec<f64>, f64), FilterError> {
    let leading = polynomial[0];
    let monic: Vec<f64> = polynomial[1..].iter().map(|c| c / leading).collect();
    let mut zeros = roots::of_monic(&monic).ok_or(FilterError::Roots)?;
    if zeros.iter().all(|zero| zero.norm() <= LARGEST_ZERO) {
        return Ok((monic, leading.abs()));
    }
    for zero in &mut zeros {
        if zero.norm() > 1.0 {
            *zero = zero.unscale(zero.norm_sqr());
        }
        if zero.norm() > LARGEST_ZERO {
            *zero = zero.scale(LARGEST_ZERO / zero.norm());
        }
    }
    let reflected = roots::monic(&zeros);
    // The product of all |z| from the mean of the spectrum, the sum of squares, without the rounding errors
    // of single zeros.
    let energy = |rest: &[f64]| 1.0 + rest.iter().map(|c| c * c).sum::<f64>();
    let gain = leading.abs() * (energy(&monic) / energy(&reflected)).sqrt();
    Ok((reflected, gain))
}

/// The poles at the lower rate: each pole to the power of the ratio, since the coefficients of the polynomial
/// do not carry enough digits (checklist F18).
pub(super) fn poles(model: &ArmaModel, ratio: usize) -> Result<Vec<Complex64>, FilterError> {
    let poles = roots::of_monic(model.ar()).ok_or(FilterError::Roots)?;
    Ok(poles.iter().map(|pole| pole.powu(ratio as u32)).collect())
}

/// The first `length` samples of the impulse response, including the gain.
pub(super) fn impulse_response(model: &ArmaModel, length: usize) -> Vec<f64> {
    let mut response = vec![0.0; length];
    for n in 0..length {
        let input = if n == 0 { 1.0 } else { model.ma().get(n - 1).copied().unwrap_or(0.0) };
        let past: f64 = model.ar().iter().zip(response[..n].iter().rev()).map(|(a, y)| a * y).sum();
        response[n] = model.gain() * input - past;
    }
    response
}

/// The product of the denominator 1 + Σ a_k z⁻ᵏ and a response, to the response's length.
pub(super) fn numerator(ar: &[f64], response: &[f64]) -> Vec<f64> {
    (0..response.len())
        .map(|m| response[m] + ar.iter().zip(response[..m].iter().rev()).map(|(a, h)| a * h).sum::<f64>())
        .collect()
}
