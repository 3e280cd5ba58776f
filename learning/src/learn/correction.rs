//! Corrects a power law by a smooth function of speed and force.
//!
//! Kriging of the logarithms of observed over expected densities (Rasmussen and Williams 2006, ch. 2): near observations
//! the correction follows them, as far as they agree with one another; far from all of them it goes to zero. Leave-one-out
//! prediction selects its range and its noise. If no correction predicts better than none, there is no correction.

use nalgebra::{DMatrix, Vector2};
use std::collections::BTreeMap;

/// Candidate ranges: e-folds of speed and force over which the covariance falls to 0.61.
const RANGES: [f64; 3] = [0.7, 1.4, 2.8];
/// Candidate variances, relative to the variance of one stretch.
const VARIANCES: [f64; 6] = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0];
/// Fraction of the variance of one stretch that more stretches at the same place do not reduce.
const REMAINING: f64 = 0.1;
/// Stretches closer than this, in e-folds, count as one place.
const PLACE: f64 = 0.2;

/// The natural logarithms of a speed in m/s and a force in N.
pub(super) type Place = Vector2<f64>;

/// The observed density at a place, and the density that a law expects there.
#[derive(Debug, Clone)]
pub(super) struct Stretch {
    pub place: Place,
    /// Densities over the cells, (m/s²)²/Hz.
    pub seen: Vec<f64>,
    pub expected: Vec<f64>,
}

/// A smooth function of place for each cell: the natural logarithm of the factor on the law's density.
#[derive(Debug, Clone)]
pub(super) struct Correction {
    places: Vec<Place>,
    kernel: Kernel,
    /// Places by cells.
    weights: DMatrix<f64>,
    /// The least and greatest residual of each cell, including 0: they limit the correction.
    bounds: Vec<(f64, f64)>,
}

/// The covariance of the residuals at two places.
#[derive(Debug, Clone, Copy)]
struct Kernel {
    /// Over speed and force.
    ranges: Place,
    variance: f64,
}

impl Kernel {
    fn between(self, a: &Place, b: &Place) -> f64 {
        let distance = (a - b).component_div(&self.ranges);
        self.variance * (-0.5 * distance.norm_squared()).exp()
    }
}

impl Correction {
    /// The correction with the best leave-one-out prediction; `None` if no correction is better.
    pub(super) fn fit(stretches: &[Stretch]) -> Option<Self> {
        let pools = pooled(stretches);
        let places: Vec<Place> = pools.iter().map(|(stretch, _)| stretch.place).collect();
        let count = places.len();
        let misses = DMatrix::from_fn(count, stretches.first()?.seen.len(), |place, cell| {
            let (Stretch { seen, expected, .. }, _) = &pools[place];
            let is_known = seen[cell] > 0.0 && expected[cell] > 0.0;
            if is_known { (seen[cell] / expected[cell]).ln() } else { 0.0 }
        });
        // With few places, one of many kernels predicts better by chance.
        let mut best = (misses.norm_squared() * (1.0 - 1.0 / count as f64), None);
        for kernel in kernels() {
            let mut covariance =
                DMatrix::from_fn(count, count, |a, b| kernel.between(&places[a], &places[b]));
            for (place, (_, stretches)) in pools.iter().enumerate() {
                covariance[(place, place)] += REMAINING + 1.0 / stretches;
            }
            let Some(inverse) = covariance.cholesky().map(|factors| factors.inverse()) else {
                continue;
            };
            let weights = &inverse * &misses;
            // The error at a place that is left out of the fit, in closed form.
            let left_out = |place: usize| weights.row(place).norm_squared() / inverse[(place, place)].powi(2);
            let error: f64 = (0..count).map(left_out).sum();
            if error < best.0 {
                best = (error, Some((kernel, weights)));
            }
        }
        let (kernel, weights) = best.1?;
        let bounds = misses.column_iter().map(|of_cell| (of_cell.min().min(0.0), of_cell.max().max(0.0)));
        Some(Self { bounds: bounds.collect(), places, kernel, weights })
    }

    /// The logarithm of the factor of each cell.
    pub(super) fn at(&self, place: &Place) -> Vec<f64> {
        let near: Vec<f64> = self.places.iter().map(|seen| self.kernel.between(place, seen)).collect();
        let cells = self.weights.column_iter().zip(&self.bounds);
        let mixed = cells.map(|(weights, &(least, most))| {
            let sum: f64 = weights.iter().zip(&near).map(|(weight, near)| weight * near).sum();
            sum.clamp(least, most)
        });
        mixed.collect()
    }
}

fn kernels() -> impl Iterator<Item = Kernel> {
    let ranges = RANGES.into_iter().flat_map(|speed| RANGES.map(|force| Place::new(speed, force)));
    ranges.flat_map(|ranges| VARIANCES.map(|variance| Kernel { ranges, variance }))
}

/// Means of the stretches at each place, and their number.
fn pooled(stretches: &[Stretch]) -> Vec<(Stretch, f64)> {
    let mut pools: BTreeMap<[i64; 2], (Stretch, f64)> = BTreeMap::new();
    for stretch in stretches {
        let key = [0, 1].map(|axis| (stretch.place[axis] / PLACE).round() as i64);
        let Some((pool, count)) = pools.get_mut(&key) else {
            pools.insert(key, (stretch.clone(), 1.0));
            continue;
        };
        *count += 1.0;
        pool.place += (stretch.place - pool.place) / *count;
        // Sums suffice, because only their ratio counts.
        for (sums, values) in [(&mut pool.seen, &stretch.seen), (&mut pool.expected, &stretch.expected)] {
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
    }
    pools.into_values().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;

    /// Six speeds by three forces, of which one density misses by `miss` and the other not at all, both with noise.
    fn stretches(miss: impl Fn(&Place) -> f64, noise: f64, seed: u64) -> Vec<Stretch> {
        let mut errors = vec![0.0; 36];
        Gaussian::new(seed).fill(&mut errors);
        let place = |k: usize| Place::new(0.45 * (k % 6) as f64, 0.4 * (k / 6) as f64);
        let stretch = |(k, errors): (usize, &[f64])| Stretch {
            place: place(k),
            seen: vec![2.0 * (miss(&place(k)) + noise * errors[0]).exp(), 3.0 * (noise * errors[1]).exp()],
            expected: vec![2.0, 3.0],
        };
        errors.chunks(2).enumerate().map(stretch).collect()
    }

    #[test]
    fn a_smooth_miss_is_made_up_for_between_places_and_forgotten_far_away() {
        let miss = |place: &Place| 0.8 * (1.5 * place[0]).sin() - 0.5 * place[1];
        let correction = Correction::fit(&stretches(miss, 0.05, 5)).expect("a correction");
        for k in 0..15 {
            let place = Place::new(0.15 * f64::from(k), 0.05 * f64::from(k));
            let at = correction.at(&place);
            assert!((at[0] - miss(&place)).abs() < 0.15 && at[1].abs() < 0.1, "{place}: {at:?}");
        }
        let far = correction.at(&Place::new(30.0, 30.0));
        assert!(far.iter().all(|log| log.abs() < 1e-9), "{far:?}");
    }

    #[test]
    fn what_no_neighbour_shares_is_mostly_not_corrected() {
        // By chance a draw of noise looks smooth now and then; what is then made up for is a fraction of the noise.
        let sizes: Vec<f64> = (0..20)
            .map(|seed| {
                let correction = Correction::fit(&stretches(|_| 0.0, 0.5, seed));
                correction.map_or(0.0, |found| found.at(&Place::new(0.7, 0.3))[0].abs())
            })
            .collect();
        assert!(sizes.iter().all(|log| *log < 0.4), "{sizes:?}");
        assert!(sizes.iter().sum::<f64>() / 20.0 < 0.1, "{sizes:?}");
        assert!(Correction::fit(&stretches(|place| place[0], 0.0, 5)[..1]).is_none());
        assert!(Correction::fit(&[]).is_none());
    }

    #[test]
    fn no_correction_goes_beyond_what_was_missed() {
        let correction = Correction::fit(&stretches(|place| place[0], 0.05, 5)).expect("a correction");
        for k in -40..80 {
            let at = correction.at(&Place::new(0.1 * f64::from(k), 0.5));
            assert!((-0.2..2.5).contains(&at[0]), "{k}: {at:?}");
        }
    }
}
