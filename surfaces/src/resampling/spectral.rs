//! Spectral refit: the spectral density below the new Nyquist frequency, its autocovariance, and the AR model
//! of that.

use super::FilterError;
use super::deviation::deviation_db;
use crate::model::warping_for;
use crate::{ArmaModel, MAX_ORDER};
use haptograph_signal::prediction::levinson;
use haptograph_signal::warped::{cell_autocovariance, unwarp};
use std::f64::consts::PI;

/// First order tried, and the accuracy, dB, at which the search stops.
const FIRST_ORDER: usize = 20;
const CLOSE_DB: f64 = 0.05;

/// Resamples all `models` (of variance 1) to a lower rate with one order: the lowest that fits all of them
/// closely, otherwise the highest.
pub(super) fn resample_all(
    models: &[ArmaModel],
    old_rate_hz: f64,
    rate_hz: f64,
) -> Result<Vec<ArmaModel>, (usize, FilterError)> {
    // Warped models stay warped.
    let warping = models.first().filter(|model| model.warping() != 0.0).map(|_| warping_for(rate_hz));
    let lags = |model| match warping {
        None => autocovariance(model, old_rate_hz, rate_hz),
        Some(warping) => warped_autocovariance(model, old_rate_hz / rate_hz, warping),
    };
    let autocovariances: Vec<_> = models.iter().map(lags).collect();
    let mut fits = Vec::new();
    for order in (FIRST_ORDER..=MAX_ORDER).step_by(4) {
        fits = autocovariances
            .iter()
            .enumerate()
            .map(|(number, autocovariance)| {
                fit(autocovariance, order, warping).map_err(|error| (number, error))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let close = |(old, new): (&ArmaModel, &ArmaModel)| {
            deviation_db(old, old_rate_hz, new, rate_hz).db.abs() <= CLOSE_DB
        };
        if models.iter().zip(&fits).all(close) {
            break;
        }
    }
    Ok(fits)
}

fn fit(autocovariance: &[f64], order: usize, warping: Option<f64>) -> Result<ArmaModel, FilterError> {
    let model = levinson(autocovariance, order).map_err(|_| FilterError::Roots)?;
    Ok(match warping {
        None => ArmaModel::from_ar(&model.ar, model.variance)?,
        Some(warping) => ArmaModel::warped_from_ar(&model.ar, warping, model.variance)?,
    })
}

/// Cells of the new warped axis over which the density is averaged.
const CELLS: usize = 4096;

/// Like [`autocovariance`], on the warped axis of the new rate.
fn warped_autocovariance(model: &ArmaModel, ratio: f64, warping: f64) -> Vec<f64> {
    let cell = |number: usize| {
        let angle = unwarp((number as f64 + 0.5) * PI / CELLS as f64, warping);
        model.variance() * model.power_gain_at(angle / ratio) / ratio
    };
    cell_autocovariance(&(0..CELLS).map(cell).collect::<Vec<_>>(), MAX_ORDER)
}

/// Autocovariance of the model's output at the new rate, lags 0 to [`MAX_ORDER`], without the band above the
/// new Nyquist frequency. Its density is summed by the trapezoid rule, which converges exponentially for a
/// smooth periodic integrand. The number of points is doubled until the lags converge.
fn autocovariance(model: &ArmaModel, old_rate_hz: f64, rate_hz: f64) -> Vec<f64> {
    let ratio = old_rate_hz / rate_hz;
    // (1/rate) x density at the new rate is variance x power gain / old rate: a mean over the new band of this.
    let density = |angle: f64| model.variance() * model.power_gain_at(angle / ratio) / ratio;
    let mut points = 1 << 11;
    // Twice the trapezoid sums over [0, π], with half weight at the ends.
    let mut sums = [0.0; MAX_ORDER + 1];
    for (angle, weight) in
        [(0.0, 0.5), (PI, 0.5)].into_iter().chain((1..points).map(|i| (PI * i as f64 / points as f64, 1.0)))
    {
        add_lags(&mut sums, weight * density(angle), angle);
    }
    loop {
        let before = sums.map(|sum| sum / points as f64);
        for i in 0..points {
            let angle = PI * (i as f64 + 0.5) / points as f64;
            add_lags(&mut sums, density(angle), angle);
        }
        points *= 2;
        let now = sums.map(|sum| sum / points as f64);
        let moved = before.iter().zip(&now).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if moved <= 1e-10 * now[0] || points >= 1 << 20 {
            return now.to_vec();
        }
    }
}

/// Adds `density` times cos(lag × angle) for each lag, by the recurrence of the cosine.
fn add_lags(sums: &mut [f64; MAX_ORDER + 1], density: f64, angle: f64) {
    let twice = 2.0 * angle.cos();
    let (mut last, mut here) = (0.5 * twice, 1.0);
    for sum in sums {
        *sum += density * here;
        (last, here) = (here, twice * here - last);
    }
}
