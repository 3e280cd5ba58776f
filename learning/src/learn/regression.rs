//! Fits power as a product of powers of speed and force: a gamma regression with logarithmic link and a prior.

use haptograph_signal::statistics::median;
use nalgebra::{Matrix3, Vector3};

/// The natural logarithm of a mean: constant, slope over ln speed, slope over ln force (both from the data's centre).
pub(super) type Law = Vector3<f64>;

/// The regressors at a place: 1, ln speed and ln force from the data's centre.
pub(super) type Place = Vector3<f64>;

/// Prior slopes and their weight in observations (each one e-fold from the centre).
#[derive(Debug, Clone, Copy)]
pub(super) struct Prior {
    pub slopes: [f64; 2],
    pub strength: f64,
}

const MAX_STEPS: usize = 50;

/// Fits `mean = exp(law . place)` to positive values, weighted, by Fisher scoring of the gamma likelihood.
///
/// The gamma likelihood fits the mean itself: least squares of the logarithms would fit the geometric mean, which for
/// powers of short windows lies decibels below.
pub(super) fn fit(places: &[Place], values: &[f64], weights: &[f64], prior: Prior) -> Law {
    let total: f64 = weights.iter().sum();
    let mean = values.iter().zip(weights).map(|(y, w)| y * w).sum::<f64>() / total.max(f64::MIN_POSITIVE);
    let centre = Vector3::new(0.0, prior.slopes[0], prior.slopes[1]);
    let pull = Vector3::new(0.0, prior.strength, prior.strength);
    let mut law = centre;
    law[0] = mean.max(f64::MIN_POSITIVE).ln();
    for _ in 0..MAX_STEPS {
        let mut information = Matrix3::from_diagonal(&pull);
        let mut score = -pull.component_mul(&(law - centre));
        for ((place, y), w) in places.iter().zip(values).zip(weights) {
            let expected = law.dot(place).clamp(-600.0, 600.0).exp();
            score += place * (w * (y / expected - 1.0));
            information += place * place.transpose() * *w;
        }
        let Some(step) = information.cholesky().map(|factors| factors.solve(&score)) else {
            return law;
        };
        // Fisher scoring overshoots far from the optimum: at most one e-fold a step.
        let step = step / step.amax().max(1.0);
        law += step;
        if step.amax() < 1e-9 {
            break;
        }
    }
    law
}

/// Like [`fit`], but limits the weight of observations beyond four robust deviations from the law.
pub(super) fn fit_robustly(places: &[Place], values: &[f64], prior: Prior) -> (Law, Vec<f64>) {
    let logs: Vec<f64> = values.iter().map(|y| y.max(f64::MIN_POSITIVE).ln()).collect();
    let typical = of_logs(places, &logs, prior);
    let residuals: Vec<f64> = places.iter().zip(&logs).map(|(place, y)| y - typical.dot(place)).collect();
    let centre = median(&residuals);
    let distances: Vec<f64> = residuals.iter().map(|r| (r - centre).abs()).collect();
    let bound = 4.0 * 1.4826 * median(&distances);
    let weights: Vec<f64> = distances.iter().map(|d| (bound - d).min(0.0).exp()).collect();
    (fit(places, values, &weights, prior), weights)
}

/// Least squares of logarithms: the geometric mean, which single loud observations hardly move.
fn of_logs(places: &[Place], logs: &[f64], prior: Prior) -> Law {
    let pull = Vector3::new(0.0, prior.strength, prior.strength);
    let mut information = Matrix3::from_diagonal(&pull);
    let mut sum = Vector3::new(0.0, pull[1] * prior.slopes[0], pull[2] * prior.slopes[1]);
    for (place, y) in places.iter().zip(logs) {
        information += place * place.transpose();
        sum += place * *y;
    }
    information.cholesky().map_or(sum, |factors| factors.solve(&sum))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const WEAK: Prior = Prior { slopes: [0.0; 2], strength: 1e-3 };

    fn observations(count: usize, noise: f64) -> (Vec<Place>, Vec<f64>) {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
        (0..count)
            .map(|_| {
                let place = Vector3::new(1.0, random.random_range(-1.0..1.0), random.random_range(-1.0..1.0));
                // A mean of four exponentials: gamma of shape 4.
                let gamma: f64 = (0..4).map(|_| -random.random_range(1e-9..1.0_f64).ln()).sum::<f64>() / 4.0;
                let mean = Vector3::<f64>::new(0.7, 2.0, 0.5).dot(&place).exp();
                (place, mean * (1.0 + noise * (gamma - 1.0)))
            })
            .unzip()
    }

    #[test]
    fn a_law_without_noise_is_found_exactly_and_one_with_noise_nearly() {
        for (noise, tolerance) in [(0.0, 1e-3), (1.0, 0.05)] {
            let (places, values) = observations(3000, noise);
            let law = fit(&places, &values, &vec![1.0; values.len()], WEAK);
            assert!((law - Vector3::new(0.7, 2.0, 0.5)).amax() < tolerance, "{law}");
        }
    }

    #[test]
    fn where_speed_does_not_vary_the_slope_is_the_priors() {
        let (mut places, values) = observations(200, 1.0);
        places.iter_mut().for_each(|place| place[1] = 0.0);
        let prior = Prior { slopes: [1.95, 0.44], strength: 1.0 };
        let law = fit(&places, &values, &vec![1.0; values.len()], prior);
        assert!((law[1] - 1.95).abs() < 1e-9);
    }

    #[test]
    fn a_knock_moves_the_law_little() {
        let (places, mut values) = observations(50, 1.0);
        let (before, _) = fit_robustly(&places, &values, WEAK);
        values[7] *= 1e4;
        let (after, weights) = fit_robustly(&places, &values, WEAK);
        assert!(weights[7] < 0.5);
        let plain = fit(&places, &values, &vec![1.0; values.len()], WEAK);
        assert!((after[0] - before[0]).abs() < 0.5 * (plain[0] - before[0]).abs());
    }
}
