//! Measures of vibrotactile codecs, SPQI and ST-SIM, as defined by vibromaf 0.0.8 (MIT licence, Hofbauer and
//! Noll 2021), tested against its figures, and the reason why they cannot judge textures. For tests only.

use super::{BandPowers, Bands, log_spectral_distance};
use statrs::function::erf::erf;
use std::f64::consts::{PI, SQRT_2, TAU};

/// Samples per block.
const BLOCK: usize = 512;
/// Sampling rate; the definitions support no other.
const RATE_HZ: f64 = 8000.0;

fn energy(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

/// Orthonormal cosine transform of a block in dB, above the perception thresholds.
fn perceived_db(block: &[f64]) -> Vec<f64> {
    let n = block.len() as f64;
    let coefficient = |k: usize| {
        let turn = |i: usize| (PI * k as f64 * (i as f64 + 0.5) / n).cos();
        let sum: f64 = block.iter().enumerate().map(|(i, x)| x * turn(i)).sum();
        sum * (if k == 0 { 1.0 / n } else { 2.0 / n }).sqrt()
    };
    let threshold = thresholds_db();
    (0..block.len()).map(|k| 20.0 * coefficient(k).abs().log10() - threshold[k]).collect()
}

/// A parabola over the logarithm of frequency, clipped at zero.
fn thresholds_db() -> Vec<f64> {
    let (slope, offset) = (1.0 / 550.0, 1.0 - 250.0 / 550.0);
    let at = |k: usize| {
        let frequency_hz = RATE_HZ * k as f64 / (2 * BLOCK - 1) as f64;
        62.0 * ((slope * frequency_hz + offset).log10() / offset.log10()).powi(2) - 77.0
    };
    let limit = (0..BLOCK).find(|k| at(*k) > 0.0).unwrap_or(0);
    (0..BLOCK).map(|k| at(k.min(limit))).collect()
}

fn mean_of_blocks(distorted: &[f64], reference: &[f64], of: impl Fn(&[f64], &[f64]) -> f64) -> f64 {
    let blocks = distorted.chunks_exact(BLOCK).zip(reference.chunks_exact(BLOCK));
    let scores: Vec<f64> = blocks.map(|(d, r)| of(d, r)).collect();
    scores.iter().sum::<f64>() / scores.len() as f64
}

fn spqi(distorted: &[f64], reference: &[f64]) -> f64 {
    mean_of_blocks(distorted, reference, |d, r| {
        let power = |block: &[f64]| perceived_db(block).into_iter().map(|db| 10.0_f64.powf(db / 10.0));
        let off: f64 = power(d).zip(power(r)).map(|(d, r)| (d - r).abs()).sum();
        let difference_db = 10.0 * (off / power(r).sum::<f64>()).log10();
        (1.0 - (0.3 * difference_db + 2.0).tanh()) / 2.0
    })
}

fn st_sim(distorted: &[f64], reference: &[f64]) -> f64 {
    let similarity = |of: &dyn Fn(&[f64]) -> Vec<f64>| {
        mean_of_blocks(distorted, reference, |d, r| {
            let (d, r) = (of(d), of(r));
            d.iter().zip(&r).map(|(d, r)| d * r).sum::<f64>() / energy(&r)
        })
    };
    let support = |db: f64| 0.5 * (1.0 + erf(db / (12.0 * SQRT_2)));
    let spectral = similarity(&|block| perceived_db(block).into_iter().map(support).collect());
    let temporal = similarity(&|block| {
        let mean = block.iter().sum::<f64>() / block.len() as f64;
        let centred: Vec<f64> = block.iter().map(|x| x - mean).collect();
        let deviation = (energy(&centred) / block.len() as f64).sqrt();
        centred.iter().map(|x| x / deviation).collect()
    });
    temporal.powf(2.0 / 3.0) * spectral.powf(1.0 / 3.0)
}

/// Portable uniform pseudo-random noise.
fn noise(seed: u64) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 300.0
    };
    (0..16_000).map(|_| next()).collect()
}

#[test]
fn the_definitions_give_vibromafs_figures() {
    let tone = |i: usize, hz: f64| TAU * i as f64 * hz / RATE_HZ;
    let reference: Vec<f64> =
        (0..4096).map(|i| 100.0 * tone(i, 150.0).sin() + 10.0 * tone(i, 60.0).sin()).collect();
    let distorted: Vec<f64> = (0..4096).map(|i| reference[i] + 20.0 * tone(i, 310.0).cos()).collect();
    let (one, other) = (noise(1), noise(2));
    let half: Vec<f64> = one.iter().map(|x| x / 2.0).collect();
    for (distorted, reference, figures) in [
        (&distorted, &reference, [0.739_681_696, 0.990_790_662]),
        (&other, &one, [0.010_499_399, 0.020_087_921]),
        (&half, &one, [0.037_313_681, 0.994_303_550]),
    ] {
        let found = [spqi(distorted, reference), st_sim(distorted, reference)];
        for (found, figure) in found.iter().zip(figures) {
            assert!((found - figure).abs() < 1e-7, "{found} for {figure}");
        }
    }
}

#[test]
fn they_find_two_recordings_of_one_noise_as_unlike_as_can_be() {
    let (one, other) = (noise(1), noise(2));
    let half: Vec<f64> = one.iter().map(|x| x / 2.0).collect();
    let bands = Bands::counted(2.0, RATE_HZ);
    let powers = |x: &[f64]| -> BandPowers { bands.of_signal([x], RATE_HZ) };
    let lsd = |x: &[f64]| log_spectral_distance(powers(x).powers(), powers(&one).powers());
    // A recording of the same process against a copy with a quarter of the power.
    assert!(lsd(&other) < 1.5 && lsd(&half) > 6.0, "{} {}", lsd(&other), lsd(&half));
    assert!(spqi(&other, &one) < spqi(&half, &one) && st_sim(&other, &one) < 0.05);
}
