//! Natural variation: smooth random functions that can be evaluated at any time, in any order.

use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

const TONES: usize = 5;

/// A smooth random function of mean 0 and variance 1: sines of seeded frequency and phase. Never beyond +-3.2.
#[derive(Debug, Clone)]
pub(crate) struct Wobble {
    /// (angular frequency in rad/s, phase in rad)
    tones: [(f64, f64); TONES],
    /// Cosines of the phases.
    cosines: [f64; TONES],
}

impl Wobble {
    /// A function with frequencies between two limits in Hz, one of its tones in each fifth of the band.
    pub(crate) fn new(low_hz: f64, high_hz: f64, rng: &mut Xoshiro256PlusPlus) -> Self {
        let band = (high_hz - low_hz) / TONES as f64;
        let tones = std::array::from_fn(|i| {
            let frequency_hz = low_hz + band * (i as f64 + rng.random::<f64>());
            (TAU * frequency_hz, TAU * rng.random::<f64>())
        });
        Self { tones, cosines: tones.map(|(_, phase)| phase.cos()) }
    }

    /// The value at a time in s.
    pub(crate) fn at(&self, time_s: f64) -> f64 {
        let value: f64 = self.tones.iter().map(|(w, phase)| (w * time_s + phase).sin()).sum();
        value * amplitude()
    }

    /// The integral from time 0 to a time in s.
    pub(crate) fn integral(&self, time_s: f64) -> f64 {
        let tones = self.tones.iter().zip(self.cosines);
        let value: f64 = tones.map(|((w, phase), cosine)| (cosine - (w * time_s + phase).cos()) / w).sum();
        value * amplitude()
    }
}

fn amplitude() -> f64 {
    (2.0 / TONES as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn variance_is_one_and_the_integral_is_the_integral() {
        let wobble = Wobble::new(0.5, 3.0, &mut Xoshiro256PlusPlus::seed_from_u64(3));
        let step_s = 1e-3;
        let (mut square, mut sum) = (0.0, 0.0);
        for k in 0..400_000 {
            let value = wobble.at((f64::from(k) + 0.5) * step_s);
            assert!(value.abs() <= TONES as f64 * amplitude());
            square += value * value / 400_000.0;
            sum += value * step_s;
        }
        assert!((square - 1.0).abs() < 0.02, "{square}");
        assert!((wobble.integral(400.0) - sum).abs() < 1e-5);
    }
}
