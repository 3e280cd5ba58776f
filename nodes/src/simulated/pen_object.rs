//! A simulated object on a force/torque sensor, touched by a rolling-ball pen in a simulated hand (chapter 5).
//!
//! The hand follows its script over the object's surface; the pen's tip meets a stiff surface, its ball has the
//! friction that the brake sets; the haptuator on the pen shakes the tip across; the table under the sensor is knocked.
//! The program may use the sensor's reading only. The true state is in [`PenTruth`], for comparison.

use super::force_sensor::{ForceSensor, ForceSensorSettings, WrenchReading};
use super::ground::Ground;
use super::hand::{Grip, Hand, HandError, Load};
use super::knock::{KnockSettings, Knocks};
use super::pen_brake::{PenBrake, PenConstants};
use super::script::{Action, ScriptSettings};
use crate::actuators::two_mass::{TwoMass, TwoMassMachine};
use crate::contact::mesh::{MeshError, TriangleMesh};
use crate::contact::proxy::MeshProxy;
use crate::contact::stiffness::Wall;
use crate::friction::dahl::{Dahl, DahlSettings, UnderLoad};
use crate::vector::{Vec3, ZERO, add, add_scaled, cross, direction, norm, reject, scale, sub};
use haptograph_signal::filter::DesignError;
use haptograph_signal::noise::stream_seed;
use std::sync::Arc;

/// Readings per second.
pub(crate) const PEN_OBJECT_RATE_HZ: f64 = 1000.0;
/// Steps of the mechanics in a tick: the tip on the stiff object swings at about 150 Hz.
const SUBSTEPS: u32 = 10;
/// Stiffness and damping of the tip on the object: coated acrylic, ours.
const SURFACE: Wall = Wall { stiffness_n_per_m: 40_000.0, damping_n_s_per_m: 20.0 };
/// Mass of the pen, kg.
const PEN_KG: f64 = 0.04;
/// Share of the haptuator's recoil that the tip hands on to the object across its face.
const TIP_SHARE: f64 = 0.2;

/// The object, the pen and the hand.
#[derive(Debug, Clone)]
pub(crate) struct PenObjectSettings {
    /// The convex object in any position; the simulation places it on the sensor.
    pub object: Arc<TriangleMesh>,
    /// Mass of object and mount, kg.
    pub object_kg: f64,
    /// Height of the object's lowest point over the sensor's origin, m.
    pub height_m: f64,
    /// The sensor.
    pub sensor: ForceSensorSettings,
    /// Knocks on the table, if any.
    pub knocks: Option<KnockSettings>,
    /// The grip of the hand.
    pub grip: Grip,
    /// Actions of the hand.
    pub actions: Vec<Action>,
    /// Height of the lifted pen, m.
    pub hover_m: f64,
    /// The pen; none: one by seed.
    pub pen: Option<PenConstants>,
    /// The haptuator across the pen.
    pub haptuator: TwoMass,
}

impl PenObjectSettings {
    /// A hand with a pen over an object, nobody knocking.
    pub(crate) fn new(object: Arc<TriangleMesh>, actions: Vec<Action>) -> Self {
        Self {
            object,
            object_kg: 0.035,
            height_m: 0.008,
            sensor: ForceSensorSettings::default(),
            knocks: None,
            grip: Grip::TYPICAL,
            actions,
            hover_m: 0.01,
            pen: None,
            haptuator: TwoMass::PLACEHOLDER,
        }
    }
}

/// Error of the simulation of pen and object.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum PenObjectError {
    /// The object cannot be placed.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The hand cannot be simulated.
    #[error(transparent)]
    Hand(#[from] HandError),
    /// The sensor's filter cannot be designed.
    #[error(transparent)]
    Sensor(#[from] DesignError),
}

/// The true state of the contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PenTruth {
    /// True if the tip touches.
    pub touching: bool,
    /// Point of contact, in the sensor's frame, m.
    pub position_m: Vec3,
    /// Velocity of the tip along the surface, m/s.
    pub velocity_m_s: Vec3,
    /// Normal force on the pen, N.
    pub normal_n: f64,
    /// Friction on the pen, N.
    pub friction_n: Vec3,
    /// Acceleration of the pen that is felt from the haptuator, m/s2.
    pub felt_m_s2: f64,
}

/// The device: object, sensor, pen and hand. One tick is 1 ms. Labelled simulated wherever it is shown.
#[derive(Debug, Clone)]
pub(crate) struct PenObject {
    object: Arc<TriangleMesh>,
    object_kg: f64,
    sensor: ForceSensor,
    knocks: Option<Knocks>,
    hand: Hand,
    tip: MeshProxy,
    stiction: Dahl,
    brake: PenBrake,
    haptuator: TwoMassMachine,
    reading: WrenchReading,
    truth: PenTruth,
}

impl PenObject {
    /// The device at rest, the pen lifted; the seed is the person, the pen and the noise.
    pub(crate) fn new(settings: &PenObjectSettings, seed: u64) -> Result<Self, PenObjectError> {
        let lowest_m = settings.object.vertices().iter().map(|v| v[2]).fold(f64::INFINITY, f64::min);
        let object = Arc::new(settings.object.moved([0.0, 0.0, settings.height_m - lowest_m])?);
        let script = ScriptSettings {
            ground: Ground::solid(object.clone()),
            actions: settings.actions.clone(),
            hover_m: settings.hover_m,
            gives_n_per_m: f64::INFINITY,
        };
        let load = Load { mass_kg: PEN_KG, ..Load::NONE };
        let step_s = 1.0 / (PEN_OBJECT_RATE_HZ * f64::from(SUBSTEPS));
        let hand = Hand::new(settings.grip, &script, load, step_s, stream_seed(seed, "hand"))?;
        let start_m = hand.read().position_m;
        let knocks = settings
            .knocks
            .map(|knocks| Knocks::new(knocks, 1.0 / PEN_OBJECT_RATE_HZ, stream_seed(seed, "knocks")));
        let pen = settings.pen.unwrap_or_else(|| PenConstants::of_pen(stream_seed(seed, "pen")));
        // The ball starts to roll after a tenth of a millimetre or so, whatever its friction.
        let stiction = DahlSettings { stretch_m: 2.5e-4, under_load: UnderLoad::Passive };
        Ok(Self {
            sensor: ForceSensor::new(settings.sensor, PEN_OBJECT_RATE_HZ, stream_seed(seed, "sensor"))?,
            object_kg: settings.object_kg,
            knocks,
            tip: MeshProxy::new(object.clone(), start_m),
            stiction: Dahl::new(stiction),
            brake: PenBrake::new(pen),
            haptuator: settings.haptuator.machine(PEN_OBJECT_RATE_HZ),
            reading: WrenchReading::default(),
            truth: PenTruth {
                touching: false,
                position_m: start_m,
                velocity_m_s: ZERO,
                normal_n: 0.0,
                friction_n: ZERO,
                felt_m_s2: 0.0,
            },
            hand,
            object,
        })
    }

    /// The sensor's reading of this tick: the wrench on the object.
    pub(crate) fn read(&self) -> WrenchReading {
        self.reading
    }

    /// Delay of slow changes of the reading, s.
    pub(crate) fn reading_delay_s(&self) -> f64 {
        self.sensor.delay_s()
    }

    /// True state of this tick.
    pub(crate) fn truth(&self) -> PenTruth {
        self.truth
    }

    /// Advances one tick under the currents of brake and haptuator, held, A. A current that is not finite counts as zero.
    pub(crate) fn advance(&mut self, brake_a: f64, haptuator_a: f64) {
        let brake_a = if brake_a.is_finite() { brake_a } else { 0.0 };
        let before_m = self.hand.read().position_m;
        let mut mean_n = ZERO;
        let mut mean_n_m = ZERO;
        for _ in 0..SUBSTEPS {
            let force_n = self.step(brake_a);
            let share = 1.0 / f64::from(SUBSTEPS);
            // The tip's force on the object is the opposite of the object's on the tip.
            mean_n = add_scaled(mean_n, force_n, -share);
            mean_n_m = add_scaled(mean_n_m, cross(self.truth.position_m, force_n), -share);
        }
        self.haptuator.advance(haptuator_a, 0.0);
        self.truth.felt_m_s2 = self.haptuator.read().acceleration_m_s2;
        let after_m = self.hand.read().position_m;
        let shaken_n = self.shaken(sub(after_m, before_m));
        let knocked_n = self.knocked();
        let centre_m = self.object.centre_m();
        let force_n = add(add(mean_n, shaken_n), knocked_n);
        let torque_n_m =
            add(add(mean_n_m, cross(self.truth.position_m, shaken_n)), cross(centre_m, knocked_n));
        self.reading = self.sensor.sample(force_n, torque_n_m);
    }

    /// One step of the mechanics; the force on the tip, N.
    fn step(&mut self, brake_a: f64) -> Vec3 {
        let hand = self.hand.read();
        let contact = self.tip.update(hand.position_m);
        let normal_n = SURFACE.force_n(&contact, hand.velocity_m_s);
        let friction_n = self.stiction.update(&contact, normal_n, self.brake.friction(normal_n));
        let along = if contact.touching { reject(hand.velocity_m_s, contact.normal) } else { ZERO };
        let force_n = add_scaled(friction_n, contact.normal, normal_n);
        if contact.touching {
            self.hand.advance_against(force_n, contact.normal);
        } else {
            self.hand.advance(force_n);
        }
        let step_s = 1.0 / (PEN_OBJECT_RATE_HZ * f64::from(SUBSTEPS));
        self.brake.advance(brake_a, norm(along) * step_s, step_s);
        self.truth = PenTruth {
            touching: contact.touching && normal_n > 0.0,
            position_m: contact.ihip_m,
            velocity_m_s: along,
            normal_n,
            friction_n,
            felt_m_s2: self.truth.felt_m_s2,
        };
        force_n
    }

    /// The haptuator's force on the object: across the face, along the motion, no larger than the normal force.
    fn shaken(&self, moved_m: Vec3) -> Vec3 {
        if !self.truth.touching {
            return ZERO;
        }
        let along = direction(reject(moved_m, self.normal())).unwrap_or(ZERO);
        let size_n = TIP_SHARE * PEN_KG * self.truth.felt_m_s2;
        scale(along, size_n.clamp(-self.truth.normal_n, self.truth.normal_n))
    }

    fn normal(&self) -> Vec3 {
        let (_, face) = self.object.closest(self.truth.position_m);
        self.object.normal(face)
    }

    /// The object's own inertia on a shaken table.
    fn knocked(&mut self) -> Vec3 {
        let table_m_s2 = self.knocks.as_mut().map_or(ZERO, Knocks::advance);
        scale(table_m_s2, -self.object_kg)
    }
}

#[cfg(test)]
mod tests;
