//! A desktop arm as a device of graphs, and the source that reads one.

use super::acting::{Doing, GripSettings, a_bit_of_everything, actions};
use super::ground::Ground;
use super::hand::Load;
use super::omni::{OMNI_RATE_HZ, OmniSettings, SimulatedOmni as Omni};
use super::script::ScriptSettings;
use super::touchable::Touchable;
use crate::contact::mesh::TriangleMesh;
use crate::contact::nodes::{Solid, SphereSettings};
use crate::contact::shape::Shape;
use crate::vector::{add_scaled, direction};
use haptograph_engine::device::{Channel, Device, DeviceKind, DeviceSpec};
use haptograph_engine::frame::{Kind, Vector};
use haptograph_engine::node::{BuildContext, BuildError, Port};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Grams, Millimetres, NewtonsPerMillimetre};
use std::any::Any;
use std::sync::Arc;

haptograph_engine::node! {
    /// A desktop arm: reads the position of its tip.
    pub struct ArmSource as "Arm"(NoSettings) in "sources";
    source: "4.3";
    example: r#""arm": Arm(clock: "servo", endpoint: "arm")"#;
    out POSITION: Vector = Port::of(Quantity::LENGTH, "Position of the tip (HIP), m.");
}

haptograph_engine::settings! {
    /// Settings of [`SimulatedOmni`].
    pub struct SimulatedOmniSettings {
        /// The scene that the graph renders. The hand aims at its first shape, from above.
        scene: Vec<Solid> = vec![Solid::Sphere(SphereSettings { centre_mm: [Millimetres(0.0); 3], diameter_mm: Millimetres(100.0) })];
        /// Diameter of the ball at the tool's tip, mm.
        proxy_diameter_mm: Millimetres = Millimetres(3.2), in 0.0..=1000.0;
        /// Stiffness of the rendered surface that the hand expects, N/mm; the hand aims as deep as its force can press.
        gives_n_per_mm: Option<NewtonsPerMillimetre> = None, in 1e-6..=1000.0;
        /// Actions of the hand, in a loop: Hover, Draw, Taps, Press.
        does: Vec<Doing> = a_bit_of_everything();
        /// Height of the lifted tip, mm.
        hover_mm: Millimetres = Millimetres(10.0), in 0.01..=1000.0;
        /// The grip of the hand.
        grip: GripSettings = GripSettings::typical();
        /// Step of the position along each axis, mm.
        step_mm: Millimetres = Millimetres::of_si(OmniSettings::default().step_m), in 1e-6..=10.0;
        /// Largest force of the motors, N.
        peak_n: f64 = OmniSettings::default().peak_n, in 0.001..=1000.0;
        /// Apparent mass of the arm at its tip, g.
        mass_g: Grams = Grams::of_si(OmniSettings::default().load.mass_kg), in 0.0..=100_000.0;
        /// Back-drive friction at the tip, N.
        friction_n: f64 = OmniSettings::default().load.dry_friction_n, in 0.0..=100.0;
        /// Viscous damping of the arm at its tip, N s/m.
        damping_n_s_per_m: f64 = OmniSettings::default().load.damping_n_s_per_m, in 0.0..=1000.0;
    }
}

/// A desktop arm of the Omni's kind in a simulated hand.
pub(crate) struct SimulatedOmni;

impl DeviceKind for SimulatedOmni {
    type Settings = SimulatedOmniSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "SimulatedOmni",
        doc: "A desktop arm at 1 kHz with steps of 0.055 mm and 3.3 N, held by a simulated hand: a mass on a spring \
              and a damper that pull it along an intended path. The seed is the person and the attempt.",
        source: "4.3",
        simulated: true,
        senses: &[
            Channel::new("position", Kind::VECTOR, Quantity::LENGTH, "Position of the tip in steps, m."),
            Channel::new("true_position", Kind::VECTOR, Quantity::LENGTH, "True position of the tip, m."),
            Channel::new("true_velocity", Kind::VECTOR, Quantity::SPEED, "True velocity of the tip, m/s."),
        ],
        drives: &[Channel::new(
            "force",
            Kind::VECTOR,
            Quantity::FORCE,
            "Force of the motors on the hand, N.",
        )],
        example: r#""arm": SimulatedOmni(scene: [Sphere(diameter_mm: 100.0)], does: [Draw(stroke: Circles(radius_mm: 20.0), force_n: 1.0), Taps(count: 3)])"#,
    };

    fn build(settings: SimulatedOmniSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        if cx.rate.hz() != OMNI_RATE_HZ {
            return Err(BuildError::of_node(format!(
                "this arm has a servo rate of {OMNI_RATE_HZ} Hz, but its clock ticks at {}",
                cx.rate
            ))
            .help(format!("put its nodes on a clock of {OMNI_RATE_HZ} Hz")));
        }
        let arm = OmniSettings {
            step_m: settings.step_mm.si(),
            peak_n: settings.peak_n,
            load: Load {
                mass_kg: settings.mass_g.si(),
                dry_friction_n: settings.friction_n,
                damping_n_s_per_m: settings.damping_n_s_per_m,
            },
        };
        let scene = settings.scene.iter().map(Solid::to_shape).collect::<Result<Vec<_>, _>>();
        let scene = scene.map_err(|error| BuildError { field: Some("scene"), ..error })?;
        let touchable = Touchable {
            ground: ground(&scene, settings.proxy_diameter_mm.si())?,
            gives_n_per_m: settings.gives_n_per_mm.map_or(f64::INFINITY, NewtonsPerMillimetre::si),
            across_m: across_m(&scene),
            scene,
            tool_diameter_m: settings.proxy_diameter_mm.si(),
        };
        let script = ScriptSettings {
            ground: touchable.ground.clone(),
            actions: actions(&settings.does)?,
            hover_m: settings.hover_mm.si(),
            gives_n_per_m: touchable.gives_n_per_m,
        };
        let omni = Omni::new(arm, settings.grip.to_grip(), &script, cx.seed);
        let omni = omni.map_err(|error| BuildError::at("does", error.to_string()))?;
        Ok(Box::new(Held { omni, touchable, force_n: [0.0; 3] }))
    }
}

/// The surface that the hand on an arm touches.
pub(super) fn touchable(device: &dyn Any) -> Option<&Touchable> {
    device.downcast_ref::<Held>().map(|held| &held.touchable)
}

/// Width of the first shape of a scene, seen from above.
fn across_m(scene: &[Shape]) -> f64 {
    match scene.first() {
        Some(Shape::Sphere { diameter_m, .. }) => *diameter_m,
        Some(Shape::Box { size_m, .. } | Shape::Room { size_m, .. }) => size_m[0].min(size_m[1]),
        _ => f64::INFINITY,
    }
}

/// The surface that the centre of the ball at a tool's tip follows on the first shape of a scene.
fn ground(scene: &[Shape], proxy_diameter_m: f64) -> Result<Ground, BuildError> {
    let Some(first) = scene.first() else {
        return Err(BuildError::at("scene", "the scene is empty").help("give at least one shape"));
    };
    let up = [0.0, 0.0, 1.0];
    let radius_m = 0.5 * proxy_diameter_m;
    Ok(match *first {
        Shape::Plane { origin_m, normal } => {
            let normal = direction(normal).unwrap_or(up);
            Ground::Plane { origin_m: add_scaled(origin_m, normal, radius_m), normal }
        }
        Shape::Sphere { centre_m, diameter_m } => {
            Ground::Sphere { centre_m, radius_m: 0.5 * diameter_m + radius_m, up }
        }
        Shape::Box { centre_m, size_m } => {
            let felt_m = size_m.map(|length_m| length_m + proxy_diameter_m);
            let mesh = TriangleMesh::cuboid(felt_m).and_then(|mesh| mesh.moved(centre_m));
            Ground::solid(Arc::new(mesh.map_err(|error| BuildError::at("scene", error.to_string()))?))
        }
        Shape::Room { centre_m, size_m } => {
            let floor_m = radius_m - 0.5 * size_m[2];
            Ground::Plane { origin_m: add_scaled(centre_m, up, floor_m), normal: up }
        }
        // Contact with a mesh is that of a point.
        Shape::Mesh { ref mesh, .. } => Ground::Relief(mesh.clone()),
    })
}

#[derive(Debug, Clone)]
struct Held {
    omni: Omni,
    touchable: Touchable,
    force_n: [f64; 3],
}

impl Device for Held {
    fn advance(&mut self) {
        self.omni.advance(self.force_n);
    }

    fn read(&mut self, channel: usize, frame: &mut [f64]) {
        let reading = self.omni.read();
        frame.copy_from_slice(match channel {
            0 => &reading.position_m,
            1 => &reading.true_position_m,
            _ => &reading.true_velocity_m_s,
        });
    }

    fn write(&mut self, _: usize, frame: &[f64]) {
        if let Ok(force_n) = frame.try_into() {
            self.force_n = force_n;
        }
    }
}
