//! Natural variation: smooth random functions that can be evaluated at any time, in any order.

use haptograph_signal::sine::sines;
use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::{FRAC_PI_2, TAU};

const TONES: usize = 5;
/// Places of the tones: a whole vector. Those beyond the tones have a sine of 0.
const PLACES: usize = 8;

/// A smooth random function of mean 0 and variance 1: sines of seeded frequency and phase. Never beyond +-3.2.
#[derive(Debug, Clone)]
pub(crate) struct Wobble {
    turn_rad_s: [f64; PLACES],
    phase_rad: [f64; PLACES],
    /// Cosines of the phases.
    before: [f64; PLACES],
}

impl Wobble {
    /// A function with frequencies between two limits in Hz, one of its tones in each fifth of the band.
    pub(crate) fn new(low_hz: f64, high_hz: f64, rng: &mut Xoshiro256PlusPlus) -> Self {
        let band = (high_hz - low_hz) / TONES as f64;
        let mut wobble = Self { turn_rad_s: [0.0; PLACES], phase_rad: [0.0; PLACES], before: [0.0; PLACES] };
        for i in 0..TONES {
            let frequency_hz = low_hz + band * (i as f64 + rng.random::<f64>());
            (wobble.turn_rad_s[i], wobble.phase_rad[i]) = (TAU * frequency_hz, TAU * rng.random::<f64>());
        }
        Self { before: wobble.cosines(0.0), ..wobble }
    }

    /// The values of several at a time in s: their tones fill the vectors together.
    pub(crate) fn at<const COUNT: usize>(wobbles: [&Self; COUNT], time_s: f64) -> [f64; COUNT] {
        let mut tones = wobbles.map(|wobble| wobble.angles(time_s, 0.0));
        sines(tones.as_flattened_mut());
        tones.map(|sines| sines[..TONES].iter().sum::<f64>() * amplitude())
    }

    /// The integral from time 0 to a time in s.
    pub(crate) fn integral(&self, time_s: f64) -> f64 {
        let tones = self.before.iter().zip(self.cosines(time_s)).zip(self.turn_rad_s).take(TONES);
        tones.map(|((before, after), turn)| (before - after) / turn).sum::<f64>() * amplitude()
    }

    fn cosines(&self, time_s: f64) -> [f64; PLACES] {
        let mut angles = self.angles(time_s, FRAC_PI_2);
        sines(&mut angles);
        angles
    }

    fn angles(&self, time_s: f64, ahead_rad: f64) -> [f64; PLACES] {
        std::array::from_fn(|i| self.turn_rad_s[i] * time_s + (self.phase_rad[i] + ahead_rad))
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
            let value = Wobble::at([&wobble], (f64::from(k) + 0.5) * step_s)[0];
            assert!(value.abs() <= TONES as f64 * amplitude());
            square += value * value / 400_000.0;
            sum += value * step_s;
        }
        assert!((square - 1.0).abs() < 0.02, "{square}");
        assert!((wobble.integral(400.0) - sum).abs() < 1e-5);
    }
}
