//! The files that a recording tool writes (thesis 2.2): the readings of each sensor at its own rate, in its own frame and unit,
//! with a calibration to physical quantities.
//!
//! A [`Spool`] becomes haptograph's archive, a [`RawTable`] is CSV. There are three coordinate frames: the sensor's, the
//! tool's and the world (the tracker's). Forces act on the tool.

pub mod head;
#[cfg(target_family = "wasm")]
mod no_spool;
#[cfg(not(target_family = "wasm"))]
mod spool;
mod table;
pub mod vector;

#[cfg(target_family = "wasm")]
pub use no_spool::{Spool, assemble, spool_folder};
#[cfg(not(target_family = "wasm"))]
pub use spool::{Spool, assemble, spool_folder};
pub use table::{Clock, RawTable, origin_lines};

use crate::Provenance;
use crate::bounds;
use vector::{along, dot, rotate};

/// The names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// The header of a raw recording, known before its first sample.
#[derive(Debug)]
pub struct RawHead<'a> {
    /// Poses per second.
    pub motion_hz: f64,
    /// Loads per second.
    pub wrench_hz: f64,
    /// Accelerations per second.
    pub acceleration_hz: f64,
    /// Converts the readings to physical quantities.
    pub calibration: &'a Calibration,
    /// The hand's movement.
    pub gesture: Gesture,
    /// The origin.
    pub provenance: &'a Provenance,
}

/// The arrays of a raw recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // as in the archive
pub enum Member {
    PositionM,
    Orientation,
    ForceN,
    TorqueNM,
    AccelerationV,
}

/// The pose of the tracker's sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Position in the world, m.
    pub position_m: [f64; 3],
    /// Unit quaternion w, x, y, z that turns tool coordinates into world coordinates.
    pub orientation: [f64; 4],
}

/// A reading of the force sensor: the load that acts on the tool, in the sensor's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench {
    /// N.
    pub force_n: [f64; 3],
    /// N m.
    pub torque_n_m: [f64; 3],
}

/// The calibration of the sensors: it converts their readings to physical quantities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    /// Sensitivity of each accelerometer axis, m/s² per V.
    pub acceleration_m_s2_per_v: [f64; 3],
    /// Zero offset of each accelerometer axis, V.
    pub acceleration_zero_v: [f64; 3],
    /// Rotation that turns force-sensor coordinates into tool coordinates, by rows.
    pub force_sensor_to_tool: [[f64; 3]; 3],
    /// Offset from the tracker's sensor to the tip, in tool coordinates, m.
    pub tracker_to_tip_m: [f64; 3],
}

impl Default for Calibration {
    /// No calibration: readings are already physical quantities in the tool's frame, and the tracker is at the tip.
    fn default() -> Self {
        Self {
            acceleration_m_s2_per_v: [1.0; 3],
            acceleration_zero_v: [0.0; 3],
            force_sensor_to_tool: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            tracker_to_tip_m: [0.0; 3],
        }
    }
}

/// The hand's movement in a recording. It decides which part of a surface can be learned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Gesture {
    /// Dragging freely at all speeds and forces: texture (and friction if there is no better recording).
    #[default]
    Drag,
    /// Smooth circles: friction.
    Circle,
    /// Tapping at all speeds: taps.
    Tap,
    /// One slow push: stiffness.
    Press,
}

impl Gesture {
    /// All gestures.
    pub const ALL: [Gesture; 4] = [Gesture::Drag, Gesture::Circle, Gesture::Tap, Gesture::Press];

    /// The name in files and messages, such as `drag`.
    pub fn as_str(self) -> &'static str {
        match self {
            Gesture::Drag => "drag",
            Gesture::Circle => "circle",
            Gesture::Tap => "tap",
            Gesture::Press => "press",
        }
    }
}

impl std::str::FromStr for Gesture {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|gesture| gesture.as_str() == text);
        found.ok_or_else(|| format!("unknown gesture {text:?}; expected one of: drag, circle, tap, press"))
    }
}

impl Calibration {
    /// True if all numbers are within their bounds, no sensitivity is zero, and the rotation is a rotation.
    pub fn is_valid(&self) -> bool {
        let is_bounded = magnitude(&self.acceleration_zero_v) <= bounds::MAX_ACCELERATION_M_S2
            && magnitude(&self.acceleration_m_s2_per_v) <= bounds::MAX_ACCELERATION_M_S2
            && magnitude(&self.tracker_to_tip_m) <= bounds::MAX_POSITION_M;
        let sensitive = self.acceleration_m_s2_per_v.iter().all(|s| *s != 0.0);
        let r = self.force_sensor_to_tool;
        let dot = |i: usize, j: usize| (0..3).map(|k| r[i][k] * r[j][k]).sum::<f64>();
        let orthonormal = (0..3)
            .flat_map(|i| (i..3).map(move |j| (i, j)))
            .all(|(i, j)| (dot(i, j) - f64::from(u8::from(i == j))).abs() < 1e-6);
        let determinant = (0..3)
            .map(|k| {
                r[0][k] * (r[1][(k + 1) % 3] * r[2][(k + 2) % 3] - r[1][(k + 2) % 3] * r[2][(k + 1) % 3])
            })
            .sum::<f64>();
        is_bounded && sensitive && orthonormal && determinant > 0.0
    }

    /// Acceleration of a reading, m/s².
    pub fn acceleration_m_s2(&self, volts: &[f64; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| {
            (volts[axis] - self.acceleration_zero_v[axis]) * self.acceleration_m_s2_per_v[axis]
        })
    }

    /// A load in the tool's own frame, of one in the force sensor's.
    pub fn load_on_tool(&self, load: &Wrench) -> Wrench {
        let turn = |v: [f64; 3]| self.force_sensor_to_tool.map(|row| dot(row, v));
        Wrench { force_n: turn(load.force_n), torque_n_m: turn(load.torque_n_m) }
    }

    /// The tip in the world, m, of a pose of the tracker's sensor.
    pub fn tip_m(&self, pose: &Pose) -> [f64; 3] {
        along(pose.position_m, 1.0, rotate(pose.orientation, self.tracker_to_tip_m))
    }
}

/// The largest magnitude; infinite if one is no finite number.
pub fn magnitude(values: &[f64]) -> f64 {
    let finite = |x: &f64| if x.is_finite() { x.abs() } else { f64::INFINITY };
    values.iter().map(finite).fold(0.0, f64::max)
}
