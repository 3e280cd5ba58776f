//! Maps, trees and psychometric functions of known origin.

use crate::people::normal;
use haptograph_study::statistics::psychometric::{Block, FitSettings, Shape, fit};
use haptograph_study::statistics::space::{PerceptualSpace, perceptual_space};
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Ten places: five textures, T1 to T3 apart from T4 and T5, each real and virtual.
fn places() -> DMatrix<f64> {
    let textures = [[0.0, 0.0, 0.0], [1.0, 2.2, 0.3], [0.3, 0.4, 2.3], [4.0, 0.6, 0.8], [4.4, 1.7, 0.0]];
    normal(10, 3, 3) * 0.4 + DMatrix::from_fn(10, 3, |i, axis| textures[i / 2][axis])
}

fn condensed(places: &DMatrix<f64>) -> Vec<f64> {
    let pairs = (0..10).flat_map(|a| (a + 1..10).map(move |b| (a, b)));
    pairs.map(|(a, b)| (places.row(a) - places.row(b)).norm()).collect()
}

/// Root of the share of variance that is left after centring, turning and scaling one map onto another.
fn procrustes(truth: &DMatrix<f64>, found: &PerceptualSpace) -> f64 {
    let centred = |mut m: DMatrix<f64>| {
        let mean = m.row_mean();
        m.row_iter_mut().for_each(|mut row| row -= &mean);
        let norm = m.norm();
        m / norm
    };
    let truth = centred(truth.clone());
    let found = centred(DMatrix::from_fn(10, 3, |i, j| found.places[i][j]));
    let fitted: f64 = (found.transpose() * truth).singular_values().sum();
    (1.0 - fitted * fitted).max(0.0).sqrt()
}

#[test]
fn ten_places_are_found_again() {
    let truth = places();
    let found = perceptual_space(&condensed(&truth), 10, 3, 6).unwrap();
    let apart = procrustes(&truth, &found);
    assert!(found.stress[2] < 1e-6 && apart < 1e-3, "{:?}, {apart}", found.stress);
    assert!(found.stress[0] > 0.05 && found.stress[1] > 5e-3, "the scree bends at three dimensions");
    assert_eq!(found.cuts[0], [0, 0, 0, 0, 0, 0, 1, 1, 1, 1]);
    assert_eq!((found.tree.len(), found.stress.len()), (9, 6));
}

/// Places that many maps share in the order of their 45 distances: stress is as low, but the map is not as exact.
#[test]
fn of_a_monotone_change_the_order_alone_is_left() {
    let truth = places();
    let bent: Vec<f64> = condensed(&truth).iter().map(|d| (0.2 * d).exp_m1()).collect();
    let found = perceptual_space(&bent, 10, 3, 6).unwrap();
    let apart = procrustes(&truth, &found);
    assert!(found.stress[2] < 1e-6 && apart < 0.15, "{:?}, {apart}", found.stress);
}

fn observed(settings: &FitSettings, threshold: f64, slope: f64, lapse: f64, seed: u64) -> Vec<Block> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let block = |level: i32| {
        let level = f64::from(level);
        let shape = settings.shape.at(level, threshold, slope);
        let p = settings.guess + (1.0 - settings.guess - lapse) * shape;
        let positive = (0..60).filter(|_| random.random::<f64>() < p).count() as u32;
        Block { level, trials: 60, positive }
    };
    (1..=8).map(block).collect()
}

#[test]
fn intervals_hold_the_true_threshold_and_slope() {
    for shape in [Shape::Logistic, Shape::Weibull] {
        let settings = FitSettings { shape, resamples: 80, ..FitSettings::default() };
        let (threshold, slope) = (4.0, if shape == Shape::Logistic { 1.5 } else { 3.0 });
        let (mut thresholds, mut slopes, mut unlikely) = (0, 0, 0);
        for seed in 0..40 {
            let found = fit(&observed(&settings, threshold, slope, 0.02, seed), &settings).unwrap();
            let holds = |found: haptograph_study::statistics::Estimate, truth: f64| {
                usize::from(found.low <= truth && truth <= found.high)
            };
            thresholds += holds(found.threshold, threshold);
            slopes += holds(found.slope, slope);
            unlikely += usize::from(found.p < 0.05);
            assert!(found.lapse.value <= settings.largest_lapse && !found.slope_at_bound);
        }
        // 95 % of 40 is 38, with a deviation of 1.4.
        assert!(thresholds >= 34 && slopes >= 34 && unlikely <= 6, "{thresholds} {slopes} {unlikely}");
    }
}

#[test]
fn exact_shares_give_their_function_and_a_seed_its_intervals() {
    let settings = FitSettings { shape: Shape::Weibull, resamples: 50, ..FitSettings::default() };
    let block = |level: i32| {
        let level = f64::from(level);
        let p = 0.5 + 0.48 * Shape::Weibull.at(level, 4.0, 3.0);
        Block { level, trials: 1_000_000, positive: (1e6 * p).round() as u32 }
    };
    let blocks: Vec<Block> = (1..=8).map(block).collect();
    let found = fit(&blocks, &settings).unwrap();
    let close = |value: f64, truth: f64| (value / truth - 1.0).abs() < 1e-3;
    assert!(close(found.threshold.value, 4.0) && close(found.slope.value, 3.0), "{found:?}");
    assert!(close(found.lapse.value, 0.02) && found.deviance < 0.01, "{found:?}");
    assert_eq!(fit(&blocks, &settings).unwrap(), found);
    assert_ne!(fit(&blocks, &FitSettings { seed: 2, ..settings }).unwrap().threshold, found.threshold);
}

#[test]
fn a_step_has_the_steepest_slope_and_says_so() {
    let block =
        |level: i32| Block { level: f64::from(level), trials: 20, positive: if level > 4 { 20 } else { 0 } };
    let blocks: Vec<Block> = (1..=8).map(block).collect();
    let settings = FitSettings { guess: 0.0, resamples: 0, ..FitSettings::default() };
    let found = fit(&blocks, &settings).unwrap();
    assert!(found.threshold.value > 4.0 && found.threshold.value < 5.0 && found.deviance < 1e-3, "{found:?}");
    assert!(found.threshold.low.is_nan() && found.p.is_nan());
}
