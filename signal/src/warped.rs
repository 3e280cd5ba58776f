//! Polynomials on a warped frequency axis: all-pole models with higher resolution at low frequencies.
//!
//! The unit delay of `A(z)` is replaced by the all-pass `D(z) = (z^-1 - l) / (1 - l z^-1)` with the warping factor
//! `l` in [0, 1). On the unit circle `D = exp(-j W)` with the warped frequency `W(w) = w + 2 atan2(l sin w, 1 - l cos
//! w)`, so that a model `d^2 / |A(exp(-jW))|^2` of order 20 spends most of its poles on low frequencies: at a factor
//! of 0.8 and 10 kHz half of the warped axis lies below 350 Hz (Oppenheim and Johnson 1972; Härmä and others 2000).
//! With `l = 0` everything here is the ordinary case.

use crate::arma::MAX_ORDER;
use crate::prediction::{PredictionError, step_down};
use std::f64::consts::PI;

/// Largest warping factor that is supported. Closer to 1 the top of the band is no longer resolved.
pub const MAX_WARPING: f64 = 0.95;

/// The warped frequency of `frequency_rad` in [0, π], both in radians a sample.
pub(crate) fn warp(frequency_rad: f64, warping: f64) -> f64 {
    let (sin, cos) = frequency_rad.sin_cos();
    frequency_rad + 2.0 * (warping * sin).atan2(1.0 - warping * cos)
}

/// The frequency whose warped frequency is `warped_rad`: the inverse of `warp`.
pub fn unwarp(warped_rad: f64, warping: f64) -> f64 {
    warp(warped_rad, -warping)
}

/// The power of white noise of variance 1 after `1 / A(D(z))`, with `ar` the warped polynomial `[a_1, ..., a_p]`.
///
/// The closed form `(1 - l^2) / prod (1 - kappa_m^2)` over the reflection coefficients kappa of `A(zeta) (1 + l
/// zeta^-1)`: the warped axis weighs frequencies by `dw/dW = (1 - l^2) / |1 + l exp(-jW)|^2`, and an all-pole model's
/// power is the inverse product of its `1 - kappa^2`. It is relative to the drive d, not to the first autocovariance
/// of a fit.
///
/// Does not allocate.
///
/// # Errors
/// [`PredictionError::Unstable`], [`PredictionError::NotFinite`], and [`PredictionError::TooShort`] for more than
/// [`MAX_ORDER`] coefficients.
pub fn power_gain(ar: &[f64], warping: f64) -> Result<f64, PredictionError> {
    let mut product = [0.0; MAX_ORDER + 1];
    let (order, needed) = (ar.len(), ar.len() + 1);
    let given = product.len();
    let product = product.get_mut(..needed);
    let product = product.ok_or(PredictionError::TooShort { order, needed, given })?;
    Ok((1.0 - warping * warping) / residual_share(ar, warping, product)?)
}

/// `prod (1 - kappa_m^2)` of `A(zeta) (1 + l zeta^-1)`; `product` has one place more than `ar`.
fn residual_share(ar: &[f64], warping: f64, product: &mut [f64]) -> Result<f64, PredictionError> {
    let mut before = 1.0;
    for (place, a) in product.iter_mut().zip(ar.iter().chain(&[0.0])) {
        *place = a + warping * before;
        before = *a;
    }
    step_down(product)?;
    Ok(product.iter().map(|kappa| (1.0 - kappa) * (1.0 + kappa)).product())
}

/// The error of the first refused model among the models in lanes, with its lane.
#[cold]
pub(crate) fn first_error<const L: usize, E: From<PredictionError>>(
    ar: &[[f64; L]],
    check: impl Fn(usize, &[f64]) -> Result<(), E>,
) -> (usize, E) {
    let of_lane = |lane: usize| ar.iter().map(|row| row[lane]).collect::<Vec<_>>();
    let mut errors = (0..L).filter_map(|lane| Some((lane, check(lane, &of_lane(lane)).err()?)));
    errors.next().unwrap_or_else(|| (0, PredictionError::NotFinite.into()))
}

/// `1 / |A(D)|^2` at `frequency_rad`, radians a sample.
pub fn squared_response(ar: &[f64], warping: f64, frequency_rad: f64) -> f64 {
    let (sin, cos) = warp(frequency_rad, warping).sin_cos();
    let (mut re, mut im) = (0.0, 0.0);
    for &a in ar.iter().rev() {
        (re, im) = ((re + a) * cos + im * sin, im * cos - (re + a) * sin);
    }
    1.0 / ((1.0 + re) * (1.0 + re) + im * im)
}

/// Autocovariances 0..=`max_lag` of a density given as means over equal cells of the warped axis from 0 to π.
///
/// The cells are taken as they are: **no Jacobian**, as white noise drives the filter on the plain axis and the
/// warped one only says where the poles lie. Each lag is the cosine integral over the steps, so that positive cells
/// always give a positive definite sequence.
pub fn cell_autocovariance(cells: &[f64], max_lag: usize) -> Vec<f64> {
    let count = cells.len().max(1);
    let width = PI / count as f64;
    // Every cosine that is needed is one of half a cell's width times a whole number.
    let cosines: Vec<f64> = (0..4 * count).map(|halves| (0.5 * width * halves as f64).cos()).collect();
    (0..=max_lag)
        .map(|lag| {
            let half = 0.5 * lag as f64 * width;
            // The mean of cos(lag W) over a cell is its middle value times this.
            let smear = if lag == 0 { 1.0 } else { half.sin() / half };
            let middles = cells.iter().enumerate();
            let sum: f64 =
                middles.map(|(cell, density)| density * cosines[lag * (2 * cell + 1) % (4 * count)]).sum();
            sum * smear / count as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prediction::tests::reflection_to_ar;
    use crate::prediction::{levinson, power_gain as plain_gain};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    fn random_models(count: usize, order: usize, most: f64) -> Vec<Vec<f64>> {
        let mut generator = Xoshiro256PlusPlus::seed_from_u64(5);
        let mut draw = || (generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0;
        (0..count)
            .map(|_| reflection_to_ar(&(0..order).map(|_| most * draw()).collect::<Vec<_>>()))
            .map(|ar| ar.iter().zip(1..).map(|(a, k)| a * 0.95_f64.powi(k)).collect())
            .collect()
    }

    #[test]
    fn unwarping_undoes_warping() {
        for k in 0..=100 {
            let frequency = PI * f64::from(k) / 100.0;
            assert!((unwarp(warp(frequency, 0.8), 0.8) - frequency).abs() < 1e-12);
            assert!((warp(frequency, 0.0) - frequency).abs() < 1e-15);
        }
    }

    #[test]
    fn the_power_is_the_integral_of_the_density_on_the_plain_axis() {
        for (model, warping) in random_models(50, 12, 0.9).iter().zip([0.0, 0.5, 0.8, 0.9].iter().cycle()) {
            // The midpoint rule on the warped axis, where the response is smooth, with the Jacobian.
            let count = 200_000;
            let step = PI / f64::from(count);
            let integral: f64 = (0..count)
                .map(|k| {
                    let warped = (f64::from(k) + 0.5) * step;
                    let jacobian =
                        (1.0 - warping * warping) / (1.0 + warping * warping + 2.0 * warping * warped.cos());
                    squared_response(model, *warping, unwarp(warped, *warping)) * jacobian
                })
                .sum::<f64>()
                / f64::from(count);
            let closed = power_gain(model, *warping).unwrap();
            assert!((closed / integral - 1.0).abs() < 1e-7, "{closed} {integral}");
        }
    }

    #[test]
    fn without_warping_it_is_the_ordinary_power_gain() {
        for model in random_models(20, 20, 0.8) {
            let ordinary = plain_gain(&model, &[]).unwrap();
            assert!((power_gain(&model, 0.0).unwrap() / ordinary - 1.0).abs() < 1e-9);
        }
        assert!(power_gain(&[-2.0, 1.0], 0.8).is_err());
    }

    #[test]
    fn a_model_is_found_again_from_the_cells_of_its_density() {
        for model in random_models(20, 8, 0.7) {
            let cells: Vec<f64> = (0..4096)
                .map(|cell| {
                    let warped = (f64::from(cell) + 0.5) * PI / 4096.0;
                    3.0 * squared_response(&model, 0.8, unwarp(warped, 0.8))
                })
                .collect();
            let found = levinson(&cell_autocovariance(&cells, 8), 8).unwrap();
            assert!((found.variance / 3.0 - 1.0).abs() < 1e-3);
            let largest = model.iter().fold(1.0_f64, |most, a| most.max(a.abs()));
            assert!(found.ar.iter().zip(&model).all(|(a, b)| (a - b).abs() < 2e-3 * largest));
        }
    }
}
