//! The toolkit's resampling method, by which its 1 kHz files were made from its 10 kHz files.

use super::FilterError;
use super::{roots, zoh};
use crate::ArmaModel;

/// `model` at a rate `ratio` times lower, its variance scaled with the rate.
pub(super) fn resample(model: &ArmaModel, ratio: usize) -> Result<ArmaModel, FilterError> {
    if !model.ma().is_empty() {
        return Err(FilterError::HasMovingAverage);
    }
    let order = model.ar().len();
    let ar = roots::monic(&zoh::poles(model, ratio)?);
    // The model as z^-p / A1(1/z), a delay of p samples, with its input held.
    let fast = zoh::impulse_response(model, ratio * order + 1);
    let delayed = |k: usize| k.checked_sub(order).map_or(0.0, |k| fast[k]);
    let slow: Vec<f64> = std::iter::once(delayed(0))
        .chain((1..=order).map(|m| (ratio * (m - 1) + 1..=ratio * m).map(delayed).sum()))
        .collect();
    let numerator = zoh::numerator(&ar, &slow);
    // Leading zeros are only delay.
    let first = slow.iter().position(|&h| h != 0.0).ok_or(FilterError::Vanishes)?;
    let mut gain = numerator[first];
    let monic: Vec<f64> = numerator[first + 1..].iter().map(|n| n / gain).collect();
    let mut zeros = roots::of_monic(&monic).ok_or(FilterError::Roots)?;
    for zero in &mut zeros {
        let radius = zero.norm();
        if radius > 1.0 {
            // This is not a reflection and changes the spectrum (checklist F17).
            *zero = zero.unscale(radius + 1e-4);
            gain *= (radius + 1.0) / 2.0;
        }
    }
    Ok(ArmaModel::from_arma(&ar, &roots::monic(&zeros), gain.abs(), model.variance() / ratio as f64)?)
}
