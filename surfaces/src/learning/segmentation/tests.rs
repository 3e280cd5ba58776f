use super::*;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

/// A piecewise AR process: (first sample, a_1.., standard deviation) with A(z) = 1 + sum a_k z^-k, started at rest.
fn piecewise(samples: usize, pieces: &[(usize, &[f64], f64)], seed: u64) -> Vec<f64> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut y: Vec<f64> = Vec::with_capacity(samples);
    for n in 0..samples {
        let (_, a, deviation) = pieces.iter().rev().find(|(first, ..)| *first <= n).unwrap();
        let noise: f64 = StandardNormal.sample(&mut random);
        let past: f64 = a.iter().enumerate().filter(|(k, _)| n > *k).map(|(k, a)| a * y[n - 1 - k]).sum();
        y.push(deviation * noise - past);
    }
    y
}

/// Davis, Lee and Rodriguez-Yam's process A: three AR pieces of 512, 256 and 256 samples.
fn process_a(seed: u64) -> Vec<f64> {
    piecewise(1024, &[(0, &[-0.9], 1.0), (512, &[-1.69, 0.81], 1.0), (768, &[-1.32, 0.81], 1.0)], seed)
}

/// Their process B: the coefficient of an AR(1) changes after 50 samples.
fn process_b(seed: u64) -> Vec<f64> {
    piecewise(1024, &[(0, &[-0.75], 1.0), (50, &[0.5], 1.0)], seed)
}

#[test]
#[ignore = "prints"]
fn published() {
    for variance in [VarianceEstimate::ConditionalLeastSquares, VarianceEstimate::YuleWalker, VarianceEstimate::Burg] {
        for grid in [None, Some(4), Some(50)] {
        let settings = SegmentationSettings { variance, method: SegmentationMethod::Exact { grid }, ..Default::default() };
        let t = std::time::Instant::now();
        let mut right = [0, 0];
        let mut sum = [0.0; 3];
        for seed in 0..200 {
            let s = segment(&process_a(seed), &settings).unwrap();
            if s.breaks.len() == 2 { right[0] += 1; sum[0] += s.breaks[0] as f64 / 1024.0; sum[1] += s.breaks[1] as f64 / 1024.0; }
            let s = segment(&process_b(seed), &settings).unwrap();
            if s.breaks.len() == 1 { right[1] += 1; sum[2] += s.breaks[0] as f64 / 1024.0; }
        }
        eprintln!("{variance:?} {grid:?} A {} B {} breaks {:.4} {:.4} {:.4}   {:?}", right[0], right[1], sum[0] / right[0] as f64, sum[1] / right[0] as f64, sum[2] / right[1] as f64, t.elapsed());
        }
    }
}

#[test]
#[ignore = "prints"]
fn timing() {
    let mut pieces: Vec<(usize, &[f64], f64)> = vec![];
    for i in 0..19 { pieces.push((i * 5230, if i % 2 == 0 { &[-1.32, 0.81] } else { &[-1.2, 0.7] }, 1.0 + i as f64 / 10.0)); }
    let y = piecewise(100_000, &pieces, 1);
    let z = piecewise(100_000, &[(0, &[-1.32, 0.81], 1.0)], 1);
    for variance in [VarianceEstimate::ConditionalLeastSquares, VarianceEstimate::YuleWalker, VarianceEstimate::Burg] {
        let settings = SegmentationSettings { variance, ..Default::default() };
        for x in [&y, &z] {
            let t = std::time::Instant::now();
            let s = segment(x, &settings).unwrap();
            eprintln!("{variance:?} {:?} {:?}", t.elapsed(), s);
        }
    }
}
