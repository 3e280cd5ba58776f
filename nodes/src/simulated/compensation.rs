//! Accuracy of the compensator on simulated actuators (3.1.2): each differs from the
//! stated parameters within a tolerance, and is compensated by the stated and by identified parameters.

use crate::actuators::compensator::{CORNER_HZ, Compensator, MOST_A_PER_M_S2};
use crate::actuators::identify::{Known, Sweep, identify, sweep_current};
use crate::actuators::two_mass::TwoMass;
use haptograph_signal::noise::{Gaussian, stream_seed};

/// Felt over commanded acceleration, 20 to 500 Hz, for a compensator on an actuator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Felt {
    /// Least of felt over commanded, dB: the target itself, a high-pass, is 3 dB down at 20 Hz.
    pub least_db: f64,
    /// Most of felt over commanded, dB.
    pub most_db: f64,
    /// Farthest from the target, dB.
    pub off_db: f64,
}

/// One simulated actuator, compensated by its stated and by its identified parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compensated {
    /// Compensated by the stated parameters.
    pub stated: Felt,
    /// Compensated by the parameters identified from a noisy sweep, the maker's magnet and force taken as known.
    pub identified: Felt,
}

/// Compensates the simulated actuator of a seed, at 10 kHz. `None` if it cannot be identified or compensated.
pub fn compensated(seed: u64, tolerance: f64) -> Option<Compensated> {
    let stated = TwoMass::PLACEHOLDER;
    let actuator = stated.of_seed(tolerance, seed);
    let known = Known::MagnetAndForce { magnet_kg: stated.magnet_kg, force_n_per_a: stated.force_n_per_a };
    let found = identify(&swept(&actuator, seed).sweep(), known).ok()?.parameters?;
    Some(Compensated { stated: felt(&stated, &actuator)?, identified: felt(&found, &actuator)? })
}

const RATE_HZ: f64 = 10_000.0;

/// A recorded sweep.
struct Swept {
    current_a: Vec<f64>,
    acceleration_m_s2: Vec<f64>,
}

impl Swept {
    fn sweep(&self) -> Sweep<'_> {
        Sweep {
            current_a: &self.current_a,
            acceleration_m_s2: &self.acceleration_m_s2,
            rate_hz: RATE_HZ,
            band_hz: SWEEP_HZ,
        }
    }
}

const SWEEP_HZ: [f64; 2] = [8.0, 1000.0];
/// Noise of the accelerometer of the thesis's recording tool, m/s2.
const NOISE_M_S2: f64 = 0.126;

/// A sweep of ten seconds and the readings of a noisy accelerometer.
fn swept(actuator: &TwoMass, seed: u64) -> Swept {
    let current_a = sweep_current(0.3, SWEEP_HZ, 10.0, RATE_HZ);
    let (mut machine, mut noise) = (actuator.machine(RATE_HZ), Gaussian::new(stream_seed(seed, "noise")));
    let feel = |current_a: &f64| {
        machine.advance(*current_a, 0.0);
        machine.read().acceleration_m_s2 + NOISE_M_S2 * noise.next_sample()
    };
    let acceleration_m_s2 = current_a.iter().map(feel).collect();
    Swept { current_a, acceleration_m_s2 }
}

fn felt(model: &TwoMass, actuator: &TwoMass) -> Option<Felt> {
    let compensator = Compensator::design(&model.response(), CORNER_HZ, MOST_A_PER_M_S2, RATE_HZ).ok()?;
    let machine = actuator.machine(RATE_HZ);
    let over = (0..=400).map(|k| {
        let f_hz = 20.0 * 25.0_f64.powf(f64::from(k) / 400.0);
        let played = compensator.filter().response(f_hz, RATE_HZ) * machine.response_at(f_hz);
        let target = 1.0 / (1.0 + (compensator.corner_hz() / f_hz).powi(8)).sqrt();
        [played.norm(), played.norm() / target].map(|ratio| 20.0 * ratio.log10())
    });
    let none = Felt { least_db: f64::MAX, most_db: f64::MIN, off_db: 0.0 };
    Some(over.fold(none, |felt, [db, off_db]| Felt {
        least_db: felt.least_db.min(db),
        most_db: felt.most_db.max(db),
        off_db: felt.off_db.max(off_db.abs()),
    }))
}

#[cfg(test)]
mod tests {
    use super::super::haptuator::TOLERANCE;
    use super::*;

    #[test]
    fn identifying_the_actuator_makes_compensation_true_for_every_seed() {
        let mut worst = [0.0_f64; 2];
        for seed in 1..=10 {
            let found = compensated(seed, TOLERANCE).unwrap();
            assert!(found.identified.off_db < 0.3, "seed {seed}: {found:?}");
            assert!(found.identified.off_db < 0.5 * found.stated.off_db, "seed {seed}: {found:?}");
            worst = [worst[0].max(found.stated.off_db), worst[1].max(found.identified.off_db)];
        }
        assert!((1.5..6.5).contains(&worst[0]), "the plant is not the model: {worst:?} dB");
        let nominal = compensated(1, 0.0).unwrap();
        assert!(nominal.stated.off_db < 0.3, "{nominal:?}");
    }
}
