//! The object on its sensor and the pen that touches it, as one device of graphs, and the sources that read it.

use super::acting::DrawSettings;
use super::acting::{Doing, GripSettings, actions};
use super::drawing::{Drawing, WanderSettings};
use super::ground::Ground;
use super::haptuator::{TOLERANCE, TwoMassSettings};
use super::knock::KnockSettings;
use super::pen_object::{PEN_OBJECT_RATE_HZ, PenObject, PenObjectSettings};
use super::touchable::Touchable;
use crate::contact::object::{CubeSettings, Object, on_sensor};
use crate::contact::shape::Shape;
use haptograph_engine::device::{Channel, Device, DeviceKind, DeviceSpec};
use haptograph_engine::frame::{Kind, Scalar, Vector, Wrench};
use haptograph_engine::node::{BuildContext, BuildError, Port};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::noise::stream_seed;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Grams, Millimetres};
use std::any::Any;

haptograph_engine::node! {
    /// A six-axis force/torque sensor under an object: the wrench on the object, zeroed with the object on it.
    pub struct ForceTorqueSensorSource as "ForceTorqueSensor"(NoSettings) in "sources";
    source: "5.2.1";
    example: r#""sensor": ForceTorqueSensor(clock: "servo", endpoint: "pen")"#;
    out WRENCH: Wrench = Port::of(Quantity::FORCE, "Wrench on the object in the sensor's frame, N and N m.");
}

haptograph_engine::node! {
    /// Reads the true contact, which exists only in a simulation, to compare it with a measurement.
    pub struct TrueContactSource as "TrueContact"(NoSettings) in "sources";
    example: r#""truth": TrueContact(clock: "servo", endpoint: "pen")"#;
    out TRUE_POSITION: Vector = Port::of(Quantity::LENGTH, "True point of contact, m.");
    out TRUE_VELOCITY: Vector = Port::of(Quantity::SPEED, "True velocity of the pen along the surface, m/s.");
    out TRUE_LOAD: Scalar = Port::of(Quantity::FORCE, "True normal force, N; zero in free space.");
    out TRUE_FRICTION: Vector = Port::of(Quantity::FORCE, "True friction on the pen, N.");
}

haptograph_engine::settings! {
    /// Knocks on the table.
    pub struct KnocksSettings {
        /// Mean time between knocks, s.
        every_s: f64 = KnockSettings::default().every_s, in 0.01..=100_000.0;
        /// Hardest knock: acceleration of the table at its start, m/s2.
        hardest_m_s2: f64 = KnockSettings::default().hardest_m_s2, in 0.0..=1000.0;
    }
}

haptograph_engine::settings! {
    /// Settings of [`SimulatedPenAndObject`].
    pub struct SimulatedPenAndObjectSettings {
        /// The convex object: Cube, Cylinder, Ball, or the Solid of a file.
        object: Object = Object::Cube(CubeSettings { edge_mm: Millimetres(25.4) });
        /// Height of its lowest point over the sensor's origin, mm.
        height_mm: Millimetres = Millimetres(8.0), in -1000.0..=1000.0;
        /// Mass of object and mount, g.
        object_g: Grams = Grams(35.0), in 0.0..=100_000.0;
        /// Actions of the hand, in a loop: Hover, Draw, Taps, Press.
        does: Vec<Doing> = exploration();
        /// Height of the lifted pen, mm.
        hover_mm: Millimetres = Millimetres(10.0), in 0.01..=1000.0;
        /// The grip of the hand.
        grip: GripSettings = GripSettings::typical();
        /// Knocks on the table, if any.
        knocks: Option<KnocksSettings> = None;
        /// The haptuator across the pen; placeholders, not measurements.
        haptuator: TwoMassSettings = TwoMassSettings::placeholder();
        /// Tolerance of each parameter of the haptuator, as a fraction; the seed draws it. 0: as stated.
        haptuator_tolerance: f64 = TOLERANCE, in 0.0..=0.5;
    }
}

/// Default actions: exploration of the object's top.
fn exploration() -> Vec<Doing> {
    vec![Doing::Draw(DrawSettings {
        stroke: Drawing::Wander(WanderSettings { side_mm: Millimetres(12.0), fastest_hz: 1.5 }),
        duration_s: 10.0,
        force_n: 1.1,
        force_variation: 0.2,
        pace_variation: 0.15,
        size_variation: 0.05,
    })]
}

/// An object on a force/torque sensor, and a pen with a brake in a simulated hand.
pub(crate) struct SimulatedPenAndObject;

impl DeviceKind for SimulatedPenAndObject {
    type Settings = SimulatedPenAndObjectSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "SimulatedPenAndObject",
        doc: "A convex object on a force/torque sensor at 1 kHz (steps of 1/160 N and 1/32 N mm, noise of one step, 20 \
              Hz low-pass), touched by a rolling-ball pen with a solenoid brake and a haptuator, in a simulated hand. \
              The seed is the person, the pen and the noise; the pen's brake is not the inverse of its controller.",
        source: "5.2, 5.3, 5.5",
        simulated: true,
        senses: &[
            Channel::new("wrench", Kind::WRENCH, Quantity::FORCE, "The sensor's reading, N and N m."),
            Channel::new("true_position", Kind::VECTOR, Quantity::LENGTH, "True point of contact, m."),
            Channel::new(
                "true_velocity",
                Kind::VECTOR,
                Quantity::SPEED,
                "True velocity of the pen along the surface, m/s.",
            ),
            Channel::new("true_load", Kind::SCALAR, Quantity::FORCE, "True normal force, N."),
            Channel::new("true_friction", Kind::VECTOR, Quantity::FORCE, "True friction on the pen, N."),
            Channel::new(
                "acceleration",
                Kind::SCALAR,
                Quantity::ACCELERATION,
                "Acceleration of the pen by the haptuator, m/s2.",
            ),
        ],
        drives: &[
            Channel::new(
                "brake",
                Kind::SCALAR,
                Quantity::CURRENT,
                "Current through the brake's solenoid, A.",
            ),
            Channel::new("current", Kind::SCALAR, Quantity::CURRENT, "Current through the haptuator, A."),
        ],
        example: r#""pen": SimulatedPenAndObject(object: Cube(edge_mm: 25.4), does: [Draw(stroke: Wander(side_mm: 12.0), force_n: 1.1)])"#,
    };

    fn build(
        settings: SimulatedPenAndObjectSettings,
        cx: &BuildContext,
    ) -> Result<Box<dyn Device>, BuildError> {
        if cx.rate.hz() != PEN_OBJECT_RATE_HZ {
            return Err(BuildError::of_node(format!(
                "this sensor has a rate of {PEN_OBJECT_RATE_HZ} Hz, but its clock ticks at {}",
                cx.rate
            ))
            .help(format!("put its nodes on a clock of {PEN_OBJECT_RATE_HZ} Hz")));
        }
        let height_m = settings.height_mm.si();
        let stated = settings.haptuator.to_two_mass().checked();
        let haptuator = stated.map_err(|error| BuildError::at("haptuator", error.to_string()))?;
        let object = on_sensor(&settings.object, height_m)?;
        let across = |axis: usize| {
            let ends = object.vertices().iter().map(|vertex| vertex[axis]);
            ends.clone().fold(f64::NEG_INFINITY, f64::max) - ends.fold(f64::INFINITY, f64::min)
        };
        let touchable = Touchable {
            across_m: across(0).min(across(1)),
            ground: Ground::solid(object.clone()),
            gives_n_per_m: f64::INFINITY,
            scene: vec![Shape::Mesh { mesh: object.clone(), start_m: None }],
            tool_diameter_m: 0.0,
        };
        let device = PenObjectSettings {
            object_kg: settings.object_g.si(),
            height_m,
            knocks: settings.knocks.map(|knocks| KnockSettings {
                every_s: knocks.every_s,
                hardest_m_s2: knocks.hardest_m_s2,
                ..KnockSettings::default()
            }),
            grip: settings.grip.to_grip(),
            hover_m: settings.hover_mm.si(),
            haptuator: haptuator.of_seed(settings.haptuator_tolerance, stream_seed(cx.seed, "haptuator")),
            ..PenObjectSettings::new(object, actions(&settings.does)?)
        };
        let device =
            PenObject::new(&device, cx.seed).map_err(|error| BuildError::at("does", error.to_string()))?;
        Ok(Box::new(Touched { device, touchable, currents_a: [0.0; 2] }))
    }
}

/// The surface that the hand with a pen touches.
pub(super) fn touchable(device: &dyn Any) -> Option<&Touchable> {
    device.downcast_ref::<Touched>().map(|touched| &touched.touchable)
}

#[derive(Debug, Clone)]
struct Touched {
    device: PenObject,
    touchable: Touchable,
    /// Currents of the brake and the haptuator, A.
    currents_a: [f64; 2],
}

impl Device for Touched {
    fn advance(&mut self) {
        let [brake_a, haptuator_a] = self.currents_a;
        self.device.advance(brake_a, haptuator_a);
    }

    fn read(&mut self, channel: usize, frame: &mut [f64]) {
        let truth = self.device.truth();
        match channel {
            0 => {
                let reading = self.device.read();
                let (force, torque) = frame.split_at_mut(3);
                force.copy_from_slice(&reading.force_n);
                torque.copy_from_slice(&reading.torque_n_m);
            }
            1 => frame.copy_from_slice(&truth.position_m),
            2 => frame.copy_from_slice(&truth.velocity_m_s),
            3 => frame.fill(truth.normal_n),
            4 => frame.copy_from_slice(&truth.friction_n),
            _ => frame.fill(truth.felt_m_s2),
        }
    }

    fn group_delay_s(&self, channel: usize) -> f64 {
        if channel == 0 { self.device.reading_delay_s() } else { 0.0 }
    }

    fn write(&mut self, channel: usize, frame: &[f64]) {
        if let (Some(current), [current_a]) = (self.currents_a.get_mut(channel), frame) {
            *current = *current_a;
        }
    }
}
