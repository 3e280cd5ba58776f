//! The static-resolution experiment of 5.2.5: a probe held at five points of the cube's top, five trials each; how far the
//! located point strays from each trial's mean, along x and along y, and whether the two directions differ.

use super::force_sensor::{ForceSensor, ForceSensorSettings};
use super::wobble::Wobble;
use crate::contact::mesh::{MeshError, TriangleMesh};
use crate::contact::wrench::{WrenchLocator, WrenchSettings};
use crate::vector::{Vec3, cross, scale};
use haptograph_signal::filter::DesignError;
use haptograph_signal::noise::stream_seed;
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use std::sync::Arc;

/// Settings of the experiment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StaticSettings {
    /// Edge of the cube, m.
    pub edge_m: f64,
    /// Height of its lower face over the sensor's origin, m.
    pub height_m: f64,
    /// Distance of the four outer points from the centre lines, m.
    pub offset_m: f64,
    /// Mean force of the probe, N; it trembles by a twentieth.
    pub force_n: f64,
    /// Length of a trial, s; its first and last 50 ms are left out.
    pub trial_s: f64,
    /// Trials at each point.
    pub trials: u32,
    /// The sensor.
    pub sensor: ForceSensorSettings,
}

impl Default for StaticSettings {
    /// The thesis's cube, 1.1 N (the mean force of its users), five trials of 3 s.
    fn default() -> Self {
        Self {
            edge_m: 0.0254,
            height_m: 0.008,
            offset_m: 0.009,
            force_n: 1.1,
            trial_s: 3.0,
            trials: 5,
            sensor: ForceSensorSettings::default(),
        }
    }
}

/// Results of the experiment (simulated).
#[derive(Debug, Clone, PartialEq)]
pub struct StaticResolution {
    /// Results at each point.
    pub points: Vec<PointResolution>,
    /// Deviations from each trial's mean along x and along y, m, all trials after another.
    pub deviations_m: [Vec<f64>; 2],
    /// The largest deviation, m.
    pub largest_m: f64,
    /// Test for a difference between the two directions.
    pub directions: KolmogorovSmirnov,
}

/// Results at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointResolution {
    /// Position of the probe, m.
    pub position_m: [f64; 2],
    /// Standard deviation of the located point along x and along y, m.
    pub deviation_m: [f64; 2],
    /// The largest deviation, m.
    pub largest_m: f64,
}

/// Error of the experiment.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StaticError {
    /// The cube cannot be made.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The sensor's filter cannot be designed.
    #[error(transparent)]
    Sensor(#[from] DesignError),
    /// Settings that make no trial.
    #[error("the experiment needs an edge, a force of at least 0.1 N, a trial and more than 0.2 s for each")]
    NoTrial,
}

const RATE_HZ: f64 = 1000.0;
/// Left out at both ends of a trial, s.
const MARGIN_S: f64 = 0.05;
/// Samples closer than this are not independent behind a 20 Hz filter, s.
const INDEPENDENT_S: f64 = 0.05;

/// Runs the experiment.
pub fn static_resolution(settings: &StaticSettings, seed: u64) -> Result<StaticResolution, StaticError> {
    let sane =
        settings.edge_m > 0.0 && settings.force_n >= 0.1 && settings.trial_s > 0.2 && settings.trials > 0;
    if !sane {
        return Err(StaticError::NoTrial);
    }
    let half_m = 0.5 * settings.edge_m;
    let cube = TriangleMesh::cuboid([settings.edge_m; 3])?.moved([0.0, 0.0, settings.height_m + half_m])?;
    let cube = Arc::new(cube);
    let (top_m, off_m) = (settings.height_m + settings.edge_m, settings.offset_m);
    let points = [[0.0, 0.0], [off_m, off_m], [off_m, -off_m], [-off_m, off_m], [-off_m, -off_m]];
    let mut deviations_m = [Vec::new(), Vec::new()];
    let mut thinned_m = [Vec::new(), Vec::new()];
    let mut found = Vec::new();
    for (place, [x, y]) in points.into_iter().enumerate() {
        let before = deviations_m[0].len();
        for trial in 0..settings.trials {
            let seed = stream_seed(seed, &format!("{place}/{trial}"));
            let located = hold(&cube, [x, y, top_m], settings, seed)?;
            for axis in 0..2 {
                let mean = located.iter().map(|p| p[axis]).sum::<f64>() / located.len() as f64;
                let strays = located.iter().map(|p| p[axis] - mean);
                thinned_m[axis].extend(strays.clone().step_by((INDEPENDENT_S * RATE_HZ) as usize));
                deviations_m[axis].extend(strays);
            }
        }
        let here = deviations_m.each_ref().map(|all| &all[before..]);
        found.push(PointResolution {
            position_m: [x, y],
            deviation_m: here.map(|d| (d.iter().map(|d| d * d).sum::<f64>() / d.len().max(1) as f64).sqrt()),
            largest_m: here.into_iter().flatten().fold(0.0, |most, d| most.max(d.abs())),
        });
    }
    Ok(StaticResolution {
        largest_m: found.iter().fold(0.0, |most, point| most.max(point.largest_m)),
        directions: KolmogorovSmirnov::compare(&thinned_m[0], &thinned_m[1]),
        points: found,
        deviations_m,
    })
}

/// One trial: the located points, its ends left out.
fn hold(
    cube: &Arc<TriangleMesh>,
    point_m: Vec3,
    settings: &StaticSettings,
    seed: u64,
) -> Result<Vec<Vec3>, StaticError> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let tremble = [(); 3].map(|()| Wobble::new(0.5, 10.0, &mut rng));
    let mut sensor = ForceSensor::new(settings.sensor, RATE_HZ, seed)?;
    let Ok(mut locator) = WrenchLocator::new(cube.clone(), WrenchSettings::default()) else {
        return Ok(Vec::new());
    };
    let count = (settings.trial_s * RATE_HZ) as usize;
    let margin = (MARGIN_S * RATE_HZ) as usize;
    let mut located = Vec::with_capacity(count);
    for tick in 0..count {
        let t = tick as f64 / RATE_HZ;
        let loading = (t / MARGIN_S).min((settings.trial_s - t) / MARGIN_S).clamp(0.0, 1.0);
        let [a, b, c] = Wobble::at(tremble.each_ref(), t).map(|value| 0.05 * value);
        let force_n = scale([0.2 * a, 0.2 * b, -1.0 - c], settings.force_n * loading);
        let reading = sensor.sample(force_n, cross(point_m, force_n));
        let contact = locator.update(reading.force_n, reading.torque_n_m);
        if (margin..count - margin).contains(&tick) && contact.touching {
            located.push(contact.position_m);
        }
    }
    Ok(located)
}

/// The two-sample test of Kolmogorov and Smirnov.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KolmogorovSmirnov {
    /// Largest distance of the two empirical distributions.
    pub distance: f64,
    /// Probability of such a distance if both samples have one distribution (asymptotic).
    pub p: f64,
}

impl KolmogorovSmirnov {
    /// Compares two samples of independent values. Empty samples do not differ.
    pub fn compare(a: &[f64], b: &[f64]) -> Self {
        if a.is_empty() || b.is_empty() {
            return Self { distance: 0.0, p: 1.0 };
        }
        let sorted = |x: &[f64]| {
            let mut x = x.to_vec();
            x.sort_by(f64::total_cmp);
            x
        };
        let (a, b) = (sorted(a), sorted(b));
        let below = |x: &[f64], value: f64| x.partition_point(|v| *v <= value) as f64 / x.len() as f64;
        let gaps = a.iter().chain(&b).map(|value| (below(&a, *value) - below(&b, *value)).abs());
        let distance = gaps.fold(0.0, f64::max);
        let size = (a.len() as f64 * b.len() as f64 / (a.len() + b.len()) as f64).sqrt();
        Self { distance, p: survival((size + 0.12 + 0.11 / size) * distance) }
    }
}

/// Q(lambda) = 2 sum (-1)^(j-1) exp(-2 j^2 lambda^2)
fn survival(lambda: f64) -> f64 {
    if lambda < 0.2 {
        return 1.0;
    }
    let terms = (1..=100).map(|j| {
        let sign = if j % 2 == 1 { 2.0 } else { -2.0 };
        sign * (-2.0 * f64::from(j * j) * lambda * lambda).exp()
    });
    terms.sum::<f64>().clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;

    #[test]
    fn no_point_strays_by_more_than_half_a_millimetre_and_the_directions_are_alike() {
        let found = static_resolution(&StaticSettings::default(), 1).unwrap();
        assert!(found.largest_m < 0.5e-3, "{} m", found.largest_m);
        assert!(found.largest_m > 0.05e-3, "a sensor without noise: {} m", found.largest_m);
        assert!(found.directions.p > 0.05, "{:?}", found.directions);
        assert_eq!(found.deviations_m[0].len(), 25 * 2900);
        assert_eq!(static_resolution(&StaticSettings::default(), 1), Ok(found));
    }

    #[test]
    fn the_test_tells_distributions_apart_and_alike() {
        let normal = |seed, spread: f64| {
            let mut noise = Gaussian::new(seed);
            (0..500).map(|_| spread * noise.next_sample()).collect::<Vec<f64>>()
        };
        assert!(KolmogorovSmirnov::compare(&normal(1, 1.0), &normal(2, 2.0)).p < 0.01);
        let often = (0..200)
            .filter(|k| KolmogorovSmirnov::compare(&normal(2 * k, 1.0), &normal(2 * k + 1, 1.0)).p < 0.05)
            .count();
        assert!((2..24).contains(&often), "at the level of 5 % {often} of 200 differ");
        // Published: Q(1.36) = 0.05, Q(1.63) = 0.01.
        assert!((survival(1.358) - 0.05).abs() < 3e-4 && (survival(1.628) - 0.01).abs() < 1e-4);
    }

    #[test]
    fn settings_that_make_no_trial_are_refused() {
        let none = StaticSettings { trials: 0, ..StaticSettings::default() };
        assert_eq!(static_resolution(&none, 1), Err(StaticError::NoTrial));
    }
}
