//! The simulated recording tool as a device of graphs, and the source that reads it (2.2): a person, a piece of a material, and
//! the tool with the places of its sensors. The graph models the sensors.

use super::habit::habit;
use super::material::{Material, MaterialName};
use super::orientation::{conjugate, rotate, rotation_of, rotation_vector};
use super::tool::{SUBSTEPS, SimulatedTool, TOOL_RATE_HZ, ToolGrip, ToolReading};
use crate::sinks::recording::Motion;
use crate::vector::{Vec3, add_scaled, cross, dot};
use haptograph_engine::device::{Channel, Device, DeviceKind, DeviceSpec};
use haptograph_engine::frame::{Kind, Vector, Wrench};
use haptograph_engine::node::{BuildContext, BuildError, Port};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::noise::stream_seed;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Degrees, Millimetres};

const POSITION: &str = "Position of the tracker's sensor, m.";
const ORIENTATION: &str = "Rotation from the tool's frame to the world: axis times angle, rad.";
const ACCELERATION: &str =
    "Acceleration less gravity in the tool's frame, m/s2, as an accelerometer measures it.";
const WRENCH: &str = "Load of the surface on the tool, at the force sensor and in its frame, N and N m.";

haptograph_engine::node! {
    /// A tool that records surfaces: the true quantities at the places of its sensors.
    pub struct RecordingToolSource as "RecordingTool"(NoSettings) in "sources";
    source: "2.2.1";
    example: r#""tool": RecordingTool(clock: "daq", endpoint: "tool")"#;
    out POSITION: Vector = Port::of(Quantity::LENGTH, POSITION);
    out ORIENTATION: Vector = Port::of(Quantity::ANGLE, ORIENTATION);
    out ACCELERATION: Vector = Port::of(Quantity::ACCELERATION, ACCELERATION);
    out WRENCH: Wrench = Port::of(Quantity::FORCE, WRENCH);
}

haptograph_engine::node! {
    /// A tracker on a tool: position and orientation of its sensor.
    pub struct TrackerSource as "Tracker"(NoSettings) in "sources";
    source: "2.2.1";
    example: r#""tracker": Tracker(clock: "tracker", endpoint: "tool")"#;
    out POSITION: Vector = Port::of(Quantity::LENGTH, POSITION);
    out ORIENTATION: Vector = Port::of(Quantity::ANGLE, ORIENTATION);
}

haptograph_engine::settings! {
    /// Settings of [`SimulatedRecordingTool`].
    pub struct SimulatedRecordingToolSettings {
        /// The material: T1 to T5 have stiffness, friction and fineness of Table 3.1, and heights by our own mapping of its roughness; T6 is invented.
        material: String = "T2".to_owned();
        /// The gesture: Drag, Circle, Tap, or the Press of a testing machine.
        motion: Motion = Motion::Drag;
        /// Friction sticks and slips, and the strokes of a Drag begin from rest. The static friction is ours.
        from_rest: bool = false;
        /// Force to which a Press goes, N; 10 in the thesis.
        press_n: f64 = 5.0, in 0.1..=30.0;
        /// The person: each number has its own hand, posture and habits.
        person: u64 = 1;
        /// From the tracker's sensor to the tip, in the tool's frame (z up along the tool), mm.
        tracker_to_tip_mm: [Millimetres; 3] = [0.0, 0.0, -120.0].map(Millimetres);
        /// From the force sensor to the tip, in the tool's frame, mm.
        force_sensor_to_tip_mm: [Millimetres; 3] = [0.0, 0.0, -30.0].map(Millimetres);
        /// Rotation from the force sensor's frame to the tool's: axis times angle, degrees.
        force_sensor_turn_deg: [Degrees; 3] = [0.0, 0.0, 45.0].map(Degrees);
    }
}

/// A recording tool on a surface.
pub(crate) struct SimulatedRecordingTool;

/// Time before the first tick in which the tool comes down on the surface, s.
const LEAD_S: f64 = 1.0;

impl DeviceKind for SimulatedRecordingTool {
    type Settings = SimulatedRecordingToolSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "SimulatedRecordingTool",
        doc: "A rigid tool in a simulated hand, its tip dragged over a procedural height field: masses, springs, dampers, a \
              Hertzian contact and Coulomb friction, or bristles that stick and slip; no stored vibration, no model of a texture. It ticks at 10 kHz. The graph's \
              seed is the piece of the material and the attempt.",
        source: "2.2",
        simulated: true,
        senses: &[
            Channel::new("position", Kind::VECTOR, Quantity::LENGTH, POSITION),
            Channel::new("orientation", Kind::VECTOR, Quantity::ANGLE, ORIENTATION),
            Channel::new("acceleration", Kind::VECTOR, Quantity::ACCELERATION, ACCELERATION),
            Channel::new("wrench", Kind::WRENCH, Quantity::FORCE, WRENCH),
        ],
        drives: &[],
        example: r#""tool": SimulatedRecordingTool(material: "T2", motion: Drag, person: 1)"#,
    };

    fn build(
        settings: SimulatedRecordingToolSettings,
        cx: &BuildContext,
    ) -> Result<Box<dyn Device>, BuildError> {
        if cx.rate.hz() != TOOL_RATE_HZ {
            let message =
                format!("this tool has a rate of {TOOL_RATE_HZ} Hz, but its clock ticks at {}", cx.rate);
            return Err(BuildError::of_node(message).help("put its nodes on a clock of 10000 Hz"));
        }
        let name = settings.material.parse::<MaterialName>();
        let name = name.map_err(|error| BuildError::at("material", error))?;
        let (motion, person) = (settings.motion, settings.person);
        let grip = if motion == Motion::Press { ToolGrip::LOAD_FRAME } else { ToolGrip::of_person(person) };
        let seed = stream_seed(cx.seed, &format!("{}/{person}/{}", name.as_str(), motion.gesture().as_str()));
        let (material, from_rest) = (Material::of(name), settings.from_rest);
        let mut tool = SimulatedTool::new(
            &material,
            grip,
            &habit(&motion, person, settings.press_n, from_rest),
            SUBSTEPS,
            seed,
        )
        .map_err(|error| BuildError::at("motion", error.to_string()))?;
        if from_rest {
            tool = tool.sticking(&material);
        }
        if motion != Motion::Press {
            (0..(LEAD_S * TOOL_RATE_HZ) as usize).for_each(|_| tool.advance());
        }
        Ok(Box::new(Recorder {
            reading: tool.read(),
            tool,
            tracker_to_tip_m: settings.tracker_to_tip_mm.map(Millimetres::si),
            force_sensor_to_tip_m: settings.force_sensor_to_tip_mm.map(Millimetres::si),
            force_sensor_to_tool: rotation_of(settings.force_sensor_turn_deg),
        }))
    }
}

#[derive(Debug, Clone)]
struct Recorder {
    tool: SimulatedTool,
    reading: ToolReading,
    tracker_to_tip_m: Vec3,
    force_sensor_to_tip_m: Vec3,
    force_sensor_to_tool: [Vec3; 3],
}

impl Recorder {
    fn tracker_m(&self) -> Vec3 {
        add_scaled(self.reading.tip_m, rotate(self.reading.orientation, self.tracker_to_tip_m), -1.0)
    }

    /// Force and torque in the sensor's frame.
    fn wrench(&self) -> [Vec3; 2] {
        let force_n = rotate(conjugate(self.reading.orientation), self.reading.force_n);
        // Sensor to tool is a rotation by rows; its transpose leads back.
        let rows = &self.force_sensor_to_tool;
        let to_sensor = |v: Vec3| -> Vec3 { std::array::from_fn(|i| dot(v, rows.map(|row| row[i]))) };
        [to_sensor(force_n), to_sensor(cross(self.force_sensor_to_tip_m, force_n))]
    }
}

impl Device for Recorder {
    fn advance(&mut self) {
        self.tool.advance();
        self.reading = self.tool.read();
    }

    fn read(&mut self, channel: usize, frame: &mut [f64]) {
        match channel {
            0 => frame.copy_from_slice(&self.tracker_m()),
            1 => frame.copy_from_slice(&rotation_vector(self.reading.orientation)),
            2 => frame.copy_from_slice(&self.reading.specific_m_s2),
            _ => frame.copy_from_slice(self.wrench().as_flattened()),
        }
    }

    fn write(&mut self, _: usize, _: &[f64]) {}
}

#[cfg(test)]
mod tests;
