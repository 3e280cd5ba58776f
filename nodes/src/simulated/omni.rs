//! A simulated desktop arm of the kind of the Phantom Omni, held by a simulated hand.

use super::hand::{Grip, Hand, HandError, Load};
use super::script::ScriptSettings;
use super::tablet::quantise;
use crate::vector::{Vec3, norm, scale};

/// The arm's servo rate, Hz.
pub(crate) const OMNI_RATE_HZ: f64 = 1000.0;

/// Properties of the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OmniSettings {
    /// Step of the position along each axis, m.
    pub step_m: f64,
    /// Largest force, N.
    pub peak_n: f64,
    /// Apparent mass and back-drive friction.
    pub load: Load,
}

impl Default for OmniSettings {
    /// 0.055 mm, 3.3 N; 45 g and 0.26 N as commonly quoted for the device (not checked against a data sheet); 0.2 N s/m is
    /// an assumption.
    fn default() -> Self {
        Self {
            step_m: 0.055e-3,
            peak_n: 3.3,
            load: Load { mass_kg: 0.045, dry_friction_n: 0.26, damping_n_s_per_m: 0.2 },
        }
    }
}

/// The reading of the arm, and the true state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OmniReading {
    /// Position of the tip in steps, m.
    pub position_m: Vec3,
    /// True position of the tip, m.
    pub true_position_m: Vec3,
    /// True velocity of the tip, m/s.
    pub true_velocity_m_s: Vec3,
}

/// The arm and the hand. One tick is 1 ms. It is labelled simulated wherever it is shown.
#[derive(Debug, Clone)]
pub(crate) struct SimulatedOmni {
    settings: OmniSettings,
    hand: Hand,
}

impl SimulatedOmni {
    /// An arm at rest where the hand's script begins; the seed is the person and the attempt.
    pub(crate) fn new(
        settings: OmniSettings,
        grip: Grip,
        script: &ScriptSettings,
        seed: u64,
    ) -> Result<Self, HandError> {
        for (name, value) in [("step_m", settings.step_m), ("peak_n", settings.peak_n)] {
            if !(value > 0.0 && value.is_finite()) {
                let range = "a finite number above zero";
                return Err(HandError::OutOfRange { name, value, range });
            }
        }
        Ok(Self { settings, hand: Hand::new(grip, script, settings.load, 1.0 / OMNI_RATE_HZ, seed)? })
    }

    /// The reading of this tick.
    pub(crate) fn read(&self) -> OmniReading {
        let hand = self.hand.read();
        OmniReading {
            position_m: hand.position_m.map(|x| quantise(x, self.settings.step_m)),
            true_position_m: hand.position_m,
            true_velocity_m_s: hand.velocity_m_s,
        }
    }

    /// Advances one tick under a requested force of the motors, held, N. They give at most their peak, in the same direction, and zero for a
    /// force that is not finite.
    pub(crate) fn advance(&mut self, force_n: Vec3) {
        let size_n = norm(force_n);
        let given = if size_n > self.settings.peak_n {
            scale(force_n, self.settings.peak_n / size_n)
        } else {
            force_n
        };
        self.hand.advance(given);
    }
}

#[cfg(test)]
mod tests {
    use super::super::ground::Ground;
    use super::super::script::Action;
    use super::super::stroke::{StrokeSettings, StrokeShape};
    use super::*;
    use crate::contact::shape::{Shape, Touch};
    use crate::contact::stiffness::Wall;
    use crate::friction::dahl::{Dahl, DahlSettings};
    use crate::vector::{add, distance, sub};

    fn script(actions: Vec<Action>) -> ScriptSettings {
        ScriptSettings { ground: Ground::TABLE, actions, hover_m: 0.01, gives_n_per_m: f64::INFINITY }
    }

    fn circles(force_n: f64) -> Action {
        let shape = StrokeShape::Circles { radius_m: 0.03, period_s: 1.2 };
        Action::Draw { stroke: StrokeSettings::natural(shape, force_n), duration_s: 10.0 }
    }

    #[test]
    fn readings_are_steps_of_0_055_mm() {
        let mut arm =
            SimulatedOmni::new(OmniSettings::default(), Grip::TYPICAL, &script(vec![circles(1.0)]), 1)
                .unwrap();
        for _ in 0..500 {
            let reading = arm.read();
            assert!(
                reading.position_m.iter().all(|x| ((x / 0.055e-3) - (x / 0.055e-3).round()).abs() < 1e-6)
            );
            assert!(distance(reading.position_m, reading.true_position_m) < 0.055e-3 * 0.87);
            arm.advance([0.0; 3]);
        }
    }

    #[test]
    fn the_motors_give_no_more_than_their_peak() {
        let hover = script(vec![Action::Hover { duration_s: 9.0 }]);
        let grip = Grip { tremor_m: 0.0, ..Grip::TYPICAL };
        let pushed = |force_n: f64| {
            let mut arm = SimulatedOmni::new(OmniSettings::default(), grip, &hover, 1).unwrap();
            let start_m = arm.read().true_position_m;
            (0..2000).for_each(|_| arm.advance([force_n, 0.0, 0.0]));
            sub(arm.read().true_position_m, start_m)[0]
        };
        assert!((pushed(50.0) - pushed(3.3)).abs() < 1e-15);
        assert_eq!(pushed(f64::NAN), 0.0);
    }

    /// The arm on a rendered surface with friction, the loop closed at 1 kHz.
    #[test]
    fn strokes_on_a_rendered_surface_are_held_at_the_force_that_was_meant_and_stay_stable() {
        for stiffness_n_per_m in [250.0, 500.0] {
            let mut arm =
                SimulatedOmni::new(OmniSettings::default(), Grip::TYPICAL, &script(vec![circles(1.2)]), 3)
                    .unwrap();
            let table = Shape::Plane { origin_m: [0.0; 3], normal: [0.0, 0.0, 1.0] };
            let mut touch = Touch::new(&table, 0.0).unwrap();
            let wall = Wall { stiffness_n_per_m, damping_n_s_per_m: 0.0 };
            let mut friction = Dahl::new(DahlSettings::default());
            let (mut loads, mut speeds, mut previous) = (Vec::new(), Vec::new(), [0.0; 3]);
            for tick in 0..10_000 {
                let reading = arm.read();
                let contact = touch.update(reading.position_m);
                let load_n = wall.force_n(&contact, [0.0; 3]);
                let drag = friction.update(&contact, load_n, 0.4);
                arm.advance(add(scale(contact.normal, wall.force_n(&contact, [0.0; 3])), drag));
                if tick > 1500 && tick < 9500 {
                    loads.push(load_n);
                    speeds.push(distance(reading.true_position_m, previous) * 1000.0);
                }
                previous = reading.true_position_m;
            }
            let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
            let series = stiffness_n_per_m / (stiffness_n_per_m + 500.0);
            assert!((mean(&loads) - 1.2 * series).abs() < 0.25, "{} N", mean(&loads));
            assert!((mean(&speeds) - 0.157).abs() < 0.03, "{} m/s", mean(&speeds));
            let roughness = loads.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
            assert!(roughness < 0.06, "no chatter beyond a step or two: {roughness} N");
        }
    }
}
