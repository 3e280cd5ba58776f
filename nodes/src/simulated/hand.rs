//! A simulated hand: a mass on a spring and a damper that pull it along an intended path.

use super::script::{Intent, Script, ScriptError, ScriptSettings};
use super::wobble::Wobble;
use crate::vector::{Vec3, add, add_scaled, direction, dot, norm, reject, scale, sub};
use nalgebra::Matrix3;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// The grip of a hand on a tool. The numbers are ours, within the range of models of a pen grip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Grip {
    /// Mass that moves with the tip, kg.
    pub mass_kg: f64,
    /// Stiffness towards the intended path, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping towards the intended path, N s/m.
    pub damping_n_s_per_m: f64,
    /// Standard deviation of the tremor (8 to 12 Hz) along each axis, m.
    pub tremor_m: f64,
}

impl Grip {
    /// A typical grip.
    pub(crate) const TYPICAL: Self =
        Self { mass_kg: 0.05, stiffness_n_per_m: 500.0, damping_n_s_per_m: 5.0, tremor_m: 3e-5 };

    /// The grip of a person: a seed picks mass, stiffness and damping around [`Self::TYPICAL`].
    pub(crate) fn of_person(seed: u64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut around = |value: f64| value * 1.6_f64.powf(rng.random_range(-1.0..1.0));
        Self {
            mass_kg: around(Self::TYPICAL.mass_kg),
            stiffness_n_per_m: around(Self::TYPICAL.stiffness_n_per_m),
            damping_n_s_per_m: around(Self::TYPICAL.damping_n_s_per_m),
            tremor_m: around(Self::TYPICAL.tremor_m),
        }
    }
}

/// Depth behind the surface beyond which an aim counts as beyond an edge, m.
const BEHIND_M: f64 = 2e-4;

/// The load on the hand: mass added to its own, and friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Load {
    /// Apparent mass, kg.
    pub mass_kg: f64,
    /// Dry friction against motion, N.
    pub dry_friction_n: f64,
    /// Viscous damping of motion, N s/m.
    pub damping_n_s_per_m: f64,
}

impl Load {
    /// No load.
    pub(crate) const NONE: Self = Self { mass_kg: 0.0, dry_friction_n: 0.0, damping_n_s_per_m: 0.0 };
}

/// Error of a simulated hand.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum HandError {
    /// A property is out of range.
    #[error("the hand's {name} is {value}: give {range}")]
    OutOfRange {
        /// The property.
        name: &'static str,
        /// The value.
        value: f64,
        /// The allowed range.
        range: &'static str,
    },
    /// The script is invalid.
    #[error(transparent)]
    Script(#[from] ScriptError),
}

/// A hand in motion; one tick is the period it was made for. It is labelled simulated wherever it is shown.
#[derive(Debug, Clone)]
pub(crate) struct Hand {
    script: Script,
    grip: Grip,
    tremor: [Wobble; 3],
    /// Exact over a tick of held inputs: (position, velocity) from (position, velocity, acceleration by inputs).
    transition: [[f64; 3]; 2],
    mass_kg: f64,
    /// Largest change of speed by dry friction in a tick, m/s.
    friction_m_s: f64,
    period_s: f64,
    tick: u64,
    intent: Intent,
    position_m: Vec3,
    velocity_m_s: Vec3,
}

/// State of a hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HandReading {
    /// Position of the tip, m.
    pub position_m: Vec3,
    /// Velocity of the tip, m/s.
    pub velocity_m_s: Vec3,
    /// The intent of the hand.
    pub intent: Intent,
}

impl Hand {
    /// A hand at rest where its script begins; the seed is the person and the attempt.
    pub(crate) fn new(
        grip: Grip,
        script: &ScriptSettings,
        load: Load,
        period_s: f64,
        seed: u64,
    ) -> Result<Self, HandError> {
        check(&grip, &load, period_s)?;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let script = Script::new(script, grip.stiffness_n_per_m, rng.random())?;
        let mass_kg = grip.mass_kg + load.mass_kg;
        let start = script.at(0.0);
        Ok(Self {
            tremor: [(); 3].map(|()| Wobble::new(8.0, 12.0, &mut rng)),
            transition: transition(mass_kg, &grip, load.damping_n_s_per_m, period_s),
            mass_kg,
            friction_m_s: load.dry_friction_n * period_s / mass_kg,
            period_s,
            tick: 0,
            intent: start,
            position_m: start.position_m,
            velocity_m_s: [0.0; 3],
            script,
            grip,
        })
    }

    /// State of the hand at this tick.
    pub(crate) fn read(&self) -> HandReading {
        HandReading { position_m: self.position_m, velocity_m_s: self.velocity_m_s, intent: self.intent }
    }

    /// Advances one tick under an external force on the tip, held, N; the hand presses against the intended surface. A force
    /// that is not finite counts as zero.
    pub(crate) fn advance(&mut self, force_n: Vec3) {
        let (aim_m, aim_m_s, press_n) = self.mean();
        self.step(force_n, aim_m, aim_m_s, scale(self.intent.normal, -press_n));
    }

    /// Advances one tick under an external force on the tip, held, N, of a hand that feels the surface's normal at the tip: it presses
    /// against it, and if it aims behind an edge it moves along the surface towards the edge, not through it.
    pub(crate) fn advance_against(&mut self, force_n: Vec3, normal: Vec3) {
        let (aim_m, aim_m_s, press_n) = self.mean();
        let way_m = sub(aim_m, self.position_m);
        let behind_m = -dot(way_m, normal) - BEHIND_M;
        let (aim_m, aim_m_s) = match direction(reject(way_m, normal)) {
            Some(along) if behind_m > 0.0 => {
                let inward_m_s = -dot(aim_m_s, normal);
                (
                    add_scaled(add_scaled(aim_m, normal, behind_m), along, behind_m),
                    add_scaled(add_scaled(aim_m_s, normal, inward_m_s), along, inward_m_s.max(0.0)),
                )
            }
            _ => (aim_m, aim_m_s),
        };
        self.step(force_n, aim_m, aim_m_s, scale(normal, -press_n));
    }

    /// Returns the intended position, velocity and pressing force of the coming tick, and advances the intent.
    fn mean(&mut self) -> (Vec3, Vec3, f64) {
        self.tick += 1;
        let (last, next) = (self.intent, self.intent_at(self.tick as f64 * self.period_s));
        self.intent = next;
        (
            scale(add(last.position_m, next.position_m), 0.5),
            scale(sub(next.position_m, last.position_m), 1.0 / self.period_s),
            0.5 * (last.force_n + next.force_n),
        )
    }

    fn step(&mut self, force_n: Vec3, aim_m: Vec3, aim_m_s: Vec3, press_n: Vec3) {
        let force_n = if force_n.iter().all(|f| f.is_finite()) { force_n } else { [0.0; 3] };
        // Spring and damper towards the aim: the part that does not depend on the hand's own motion.
        let pull_n =
            add_scaled(scale(aim_m, self.grip.stiffness_n_per_m), aim_m_s, self.grip.damping_n_s_per_m);
        let push = scale(add(add(force_n, pull_n), press_n), 1.0 / self.mass_kg);
        let [to_position, to_velocity] = self.transition;
        let all = [self.position_m, self.velocity_m_s, push];
        let free =
            |row: [f64; 3]| -> Vec3 { std::array::from_fn(|i| (0..3).map(|j| row[j] * all[j][i]).sum()) };
        let (position_m, velocity_m_s) = (free(to_position), free(to_velocity));
        // Dry friction removes momentum, at most all of it.
        let speed_m_s = norm(velocity_m_s);
        if speed_m_s > self.friction_m_s || self.friction_m_s == 0.0 {
            let lost = if speed_m_s > 0.0 { self.friction_m_s / speed_m_s } else { 0.0 };
            self.position_m = add_scaled(position_m, velocity_m_s, -lost * 0.5 * self.period_s);
            self.velocity_m_s = scale(velocity_m_s, 1.0 - lost);
        } else {
            self.position_m = add_scaled(self.position_m, self.velocity_m_s, 0.5 * self.period_s);
            self.velocity_m_s = [0.0; 3];
        }
    }

    fn intent_at(&self, time_s: f64) -> Intent {
        let intent = self.script.at(time_s);
        let tremor = Wobble::at(self.tremor.each_ref(), time_s);
        Intent { position_m: add_scaled(intent.position_m, tremor, self.grip.tremor_m), ..intent }
    }
}

fn transition(mass_kg: f64, grip: &Grip, carried_n_s_per_m: f64, period_s: f64) -> [[f64; 3]; 2] {
    let damping_n_s_per_m = grip.damping_n_s_per_m + carried_n_s_per_m;
    let (k, b) = (grip.stiffness_n_per_m / mass_kg, damping_n_s_per_m / mass_kg);
    let exact = (Matrix3::new(0.0, 1.0, 0.0, -k, -b, 1.0, 0.0, 0.0, 0.0) * period_s).exp();
    [0, 1].map(|i| [exact[(i, 0)], exact[(i, 1)], exact[(i, 2)]])
}

fn check(grip: &Grip, load: &Load, period_s: f64) -> Result<(), HandError> {
    let out = |name, value, range| Err(HandError::OutOfRange { name, value, range });
    for (name, value) in [
        ("mass_kg", grip.mass_kg),
        ("stiffness_n_per_m", grip.stiffness_n_per_m),
        ("damping_n_s_per_m", grip.damping_n_s_per_m),
        ("period_s", period_s),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return out(name, value, "a finite number above zero");
        }
    }
    for (name, value) in [
        ("tremor_m", grip.tremor_m),
        ("load.mass_kg", load.mass_kg),
        ("load.dry_friction_n", load.dry_friction_n),
        ("load.damping_n_s_per_m", load.damping_n_s_per_m),
    ] {
        if !(value >= 0.0 && value.is_finite()) {
            return out(name, value, "a finite number, zero or more");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
