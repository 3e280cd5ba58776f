//! Crackle: a texture's excitation whose level fluctuates faster than speed and force.
//!
//! The excitation is `sigma sqrt(v) g` with white Gaussian `g` and the fluctuation `v = exp(s z - s^2 / 2)`, where `z` is a
//! Gaussian process of variance 1 with exponential correlation. The mean of `v` is 1, so that power and spectrum stay those of
//! the map; only the distribution changes: its excess kurtosis is `3 (exp(s^2) - 1)`.

mod lanes;

pub(crate) use lanes::CrackleLanes;

use crate::TextureError;
use haptograph_signal::noise::Gaussian;

/// The strength and speed of the fluctuation of a texture's excitation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crackle {
    depth: f64,
    time_constant_s: f64,
}

/// Deepest crackle: an excess kurtosis of 160.
pub const MAX_DEPTH: f64 = 2.0;
/// Longest time constant, s: slower fluctuation follows from speed and force.
pub const MAX_TIME_CONSTANT_S: f64 = 1.0;

impl Crackle {
    /// Crackle of `depth`, the standard deviation of the power's natural logarithm (above 0, at most [`MAX_DEPTH`]), with the
    /// correlation time `time_constant_s` (above 0, at most [`MAX_TIME_CONSTANT_S`]).
    ///
    /// # Errors
    /// [`TextureError::Crackle`] for values out of these ranges.
    pub fn new(depth: f64, time_constant_s: f64) -> Result<Self, TextureError> {
        let within = |x: f64, most: f64| x > 0.0 && x <= most;
        if !(within(depth, MAX_DEPTH) && within(time_constant_s, MAX_TIME_CONSTANT_S)) {
            return Err(TextureError::Crackle { depth, time_constant_s });
        }
        Ok(Self { depth, time_constant_s })
    }

    /// Standard deviation of the natural logarithm of the excitation's power.
    pub fn depth(&self) -> f64 {
        self.depth
    }

    /// Time in which the fluctuation's correlation falls to 1/e, s.
    pub fn time_constant_s(&self) -> f64 {
        self.time_constant_s
    }
}

/// Samples modulated at a time.
const BATCH: usize = 64;

/// Modulates white excitation with crackle, in real time. It does not allocate; its output does not depend on block sizes.
#[derive(Debug, Clone)]
pub struct CrackleSource {
    noise: Gaussian,
    z: f64,
    kept: f64,
    fresh: f64,
    half_depth: f64,
}

impl CrackleSource {
    /// A source of `crackle` at `rate_hz`; the same `seed` gives the same fluctuation.
    pub fn new(crackle: Crackle, rate_hz: f64, seed: u64) -> Self {
        let mut noise = Gaussian::new(seed);
        let kept = (-1.0 / (crackle.time_constant_s * rate_hz)).exp();
        Self {
            z: noise.next_sample(),
            noise,
            kept,
            fresh: (1.0 - kept * kept).sqrt(),
            half_depth: 0.5 * crackle.depth,
        }
    }

    /// Multiplies the next samples of the excitation by the square root of the fluctuation.
    pub fn modulate(&mut self, excitation: &mut [f64]) {
        let mut noise = [0.0; BATCH];
        for chunk in excitation.chunks_mut(BATCH) {
            let noise = &mut noise[..chunk.len()];
            self.noise.fill(noise);
            for (e, fresh) in chunk.iter_mut().zip(noise) {
                self.z = self.kept * self.z + self.fresh * *fresh;
                *e *= (self.half_depth * (self.z - self.half_depth)).exp();
            }
        }
    }

    /// Continues the fluctuation of `other` with this source's depth and time constant. Does not allocate.
    pub fn copy_state_from(&mut self, other: &Self) {
        self.noise.clone_from(&other.noise);
        self.z = other.z;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crackling(depth: f64, time_constant_s: f64, samples: usize) -> Vec<f64> {
        let mut e = vec![0.0; samples];
        Gaussian::new(1).fill(&mut e);
        let crackle = Crackle::new(depth, time_constant_s).expect("in range");
        CrackleSource::new(crackle, 10_000.0, 2).modulate(&mut e);
        e
    }

    #[test]
    fn the_power_stays_and_the_kurtosis_is_the_depths() {
        let e = crackling(0.8, 0.003, 2_000_000);
        let moment = |k: i32| e.iter().map(|e| e.powi(k)).sum::<f64>() / e.len() as f64;
        let excess = moment(4) / moment(2).powi(2) - 3.0;
        let expected = 3.0 * (0.64_f64.exp() - 1.0);
        assert!((moment(2) - 1.0).abs() < 0.02, "{}", moment(2));
        assert!((excess / expected - 1.0).abs() < 0.2, "{excess} for {expected}");
    }

    #[test]
    fn the_grouping_of_samples_changes_no_bit() {
        let whole = crackling(0.8, 0.01, 1000);
        let mut parts = vec![0.0; 1000];
        Gaussian::new(1).fill(&mut parts);
        let mut source = CrackleSource::new(Crackle::new(0.8, 0.01).expect("in range"), 10_000.0, 2);
        let (first, rest) = parts.split_at_mut(7);
        source.modulate(first);
        rest.chunks_mut(65).for_each(|chunk| source.modulate(chunk));
        assert_eq!(whole, parts);
    }

    #[test]
    fn depths_and_times_out_of_range_are_refused() {
        for (depth, time_constant_s) in [(0.0, 0.01), (2.1, 0.01), (f64::NAN, 0.01), (1.0, 0.0), (1.0, 2.0)] {
            let refused = Crackle::new(depth, time_constant_s);
            assert!(matches!(refused, Err(TextureError::Crackle { .. })));
        }
    }
}
