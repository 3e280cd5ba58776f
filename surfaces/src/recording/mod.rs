//! Recordings of a tool on a surface (thesis 2.2), raw or processed, and their files.
//!
//! A [`Recording`] is raw: each sensor at its own rate, in its own frame and unit, with a calibration to physical
//! quantities. Models are learned from a [`ProcessedRecording`]: acceleration on one axis, normal and tangential force
//! and speed, all at one rate. [`learning::processing`](crate::learning::processing) converts the first to the second.
//! Most public data is already processed.

#[cfg(not(target_family = "wasm"))]
mod archive;
mod csv;
mod error;
mod file;
mod formats;
mod hatt;
mod import;
#[cfg(target_family = "wasm")]
mod no_archive;
mod series;
mod signal;
#[cfg(not(target_family = "wasm"))]
mod spool;

#[cfg(not(target_family = "wasm"))]
pub use archive::{read_archive, write_archive};
pub use csv::{COLUMNS, CsvHead, QUANTITIES, RawTable, csv_head, read_csv, write_csv};
pub use error::ReadError;
pub use file::{
    LoadError, Sweep, contents, file_names, load, load_column, load_signal, load_sweep, load_with, save,
};
pub use hatt::{read_hatt, write_hatt};
pub use import::{BadCell, Finding, ImportSettings, remove_offset};
#[cfg(target_family = "wasm")]
pub use no_archive::{Spool, assemble, read_archive, spool_folder, write_archive};
pub use series::Series;
pub use signal::{Column, read_column, read_signal};
#[cfg(not(target_family = "wasm"))]
pub use spool::{Spool, assemble, spool_folder};

use crate::Provenance;
use crate::bounds::{self, RATES, RATES_HZ};
use import::shown;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A raw recording: the samples of each sensor.
///
/// There are three coordinate frames: the sensor's, the tool's and the world (the tracker's). Forces act on the tool.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    motion: Series<Pose>,
    wrench: Series<Wrench>,
    acceleration_v: Series<[f64; 3]>,
    calibration: Calibration,
    gesture: Gesture,
    provenance: Provenance,
}

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

impl Recording {
    /// A recording of `motion` (240 Hz in the thesis), `wrench` and `acceleration_v` (10 kHz, V).
    ///
    /// Checks that each sensor has at least two samples, all numbers are within their [`bounds`], orientations are unit quaternions
    /// (to 1e-3; they are normalised here), the force sensor's rotation is orthonormal, and the three overlap in time.
    pub fn new(
        mut motion: Series<Pose>,
        wrench: Series<Wrench>,
        acceleration_v: Series<[f64; 3]>,
        calibration: Calibration,
        gesture: Gesture,
        provenance: Provenance,
    ) -> Result<Self, RecordingError> {
        motion.check("motion", (bounds::MAX_POSITION_M, "m"), |pose| {
            magnitude(&pose.position_m).max(magnitude(&pose.orientation))
        })?;
        wrench.check("wrench", (bounds::MAX_FORCE_N, "N or N m"), |wrench| {
            magnitude(&wrench.force_n).max(magnitude(&wrench.torque_n_m))
        })?;
        acceleration_v.check("acceleration", (bounds::MAX_ACCELERATION_M_S2, "V"), |a| magnitude(a))?;
        calibration.check()?;
        for (sample, pose) in motion.samples.iter_mut().enumerate() {
            let length = pose.orientation.iter().map(|q| q * q).sum::<f64>().sqrt();
            if (length - 1.0).abs() > 1e-3 {
                return Err(RecordingError::Orientation { sample, length });
            }
            // A quaternion that is already normalised keeps its bits, however often it is read and written.
            if (length - 1.0).abs() > 1e-12 {
                pose.orientation = pose.orientation.map(|q| q / length);
            }
        }
        let begin = motion.start_s.max(wrench.start_s).max(acceleration_v.start_s);
        let end = motion.end_s().min(wrench.end_s()).min(acceleration_v.end_s());
        if begin >= end {
            return Err(RecordingError::NoOverlap { begin_s: begin, end_s: end });
        }
        Ok(Self { motion, wrench, acceleration_v, calibration, gesture, provenance })
    }

    /// Poses of the tracker's sensor.
    pub fn motion(&self) -> &Series<Pose> {
        &self.motion
    }

    /// Loads on the tool in the force sensor's frame.
    pub fn wrench(&self) -> &Series<Wrench> {
        &self.wrench
    }

    /// Readings of the accelerometer's axes, V.
    pub fn acceleration_v(&self) -> &Series<[f64; 3]> {
        &self.acceleration_v
    }

    /// Converts the readings to physical quantities.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// The hand's movement.
    pub fn gesture(&self) -> Gesture {
        self.gesture
    }

    /// The origin.
    pub fn provenance(&self) -> &Provenance {
        &self.provenance
    }
}

impl Calibration {
    fn check(&self) -> Result<(), RecordingError> {
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
        if is_bounded && sensitive && orthonormal && determinant > 0.0 {
            Ok(())
        } else {
            Err(RecordingError::Calibration)
        }
    }
}

/// A processed recording, from which models are learned: all quantities have one rate and start at the same time.
#[derive(Debug, Clone, PartialEq)]
pub struct ProcessedRecording {
    // Shared, because minutes at 10 kHz take hundreds of megabytes.
    signals: Arc<Signals>,
    world: Arc<WorldAxes>,
    gesture: Gesture,
    provenance: Provenance,
}

/// Position and force by axis in the world's frame, at the times of the signals, where a file has them. Nothing is learned
/// from them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WorldAxes {
    /// The tip, m.
    pub position_m: Option<Vec<[f64; 3]>>,
    /// The force on the tool, N; of imported files with their sign.
    pub force_n: Option<Vec<[f64; 3]>>,
}

/// The signals of a [`ProcessedRecording`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Signals {
    /// Samples per second of all signals.
    pub rate_hz: f64,
    /// Acceleration, high-passed and reduced to one axis, m/s².
    pub acceleration_m_s2: Vec<f64>,
    /// Normal force, N; positive in contact.
    pub force_normal_n: Vec<f64>,
    /// Friction force, N; positive against the motion. `None` if only the texture was recorded.
    pub force_tangential_n: Option<Vec<f64>>,
    /// Speed of the tip, m/s.
    pub speed_m_s: Vec<f64>,
    /// The three axes before the reduction, m/s², if known.
    pub axes_m_s2: Option<Vec<[f64; 3]>>,
}

impl ProcessedRecording {
    /// Checks that all quantities have the same number of samples (at least two), that they and the rate are within their
    /// [`bounds`], and no speed is negative.
    pub fn new(signals: Signals, gesture: Gesture, provenance: Provenance) -> Result<Self, RecordingError> {
        let Signals { rate_hz, .. } = signals;
        if !RATES_HZ.contains(&rate_hz) {
            return Err(RecordingError::Rate { quantity: "recording", rate_hz });
        }
        let expected = signals.acceleration_m_s2.len();
        if expected < 2 {
            return Err(RecordingError::TooShort { quantity: "acceleration", samples: expected });
        }
        let columns = [
            ("acceleration", ACCELERATIONS, Some(&signals.acceleration_m_s2)),
            ("normal force", FORCES, Some(&signals.force_normal_n)),
            ("tangential force", FORCES, signals.force_tangential_n.as_ref()),
            ("speed", (bounds::MAX_SPEED_M_S, "m/s"), Some(&signals.speed_m_s)),
        ];
        for (quantity, bound, column) in columns {
            let Some(column) = column else { continue };
            if column.len() != expected {
                return Err(RecordingError::Lengths { quantity, samples: column.len(), expected });
            }
            RecordingError::check(quantity, bound, column.iter().copied())?;
        }
        check_axes("acceleration axes", ACCELERATIONS, signals.axes_m_s2.as_deref(), expected)?;
        if let Some(sample) = signals.speed_m_s.iter().position(|&v| v < 0.0) {
            return Err(RecordingError::NegativeSpeed { sample, speed_m_s: signals.speed_m_s[sample] });
        }
        Ok(Self { signals: Arc::new(signals), world: Arc::default(), gesture, provenance })
    }

    /// The same recording with axes in the world.
    ///
    /// # Errors
    /// Axes of another length than the signals, or a number that is not finite.
    pub fn with_world(mut self, world: WorldAxes) -> Result<Self, RecordingError> {
        check_axes(
            "position axes",
            (bounds::MAX_POSITION_M, "m"),
            world.position_m.as_deref(),
            self.samples(),
        )?;
        check_axes("force axes", FORCES, world.force_n.as_deref(), self.samples())?;
        self.world = Arc::new(world);
        Ok(self)
    }

    /// Position and force by axis.
    pub fn world(&self) -> &WorldAxes {
        &self.world
    }

    /// The signals.
    pub fn signals(&self) -> &Signals {
        &self.signals
    }

    /// Samples per second.
    pub fn rate_hz(&self) -> f64 {
        self.signals.rate_hz
    }

    /// Samples of every quantity.
    pub fn samples(&self) -> usize {
        self.signals.acceleration_m_s2.len()
    }

    /// The hand's movement.
    pub fn gesture(&self) -> Gesture {
        self.gesture
    }

    /// The origin.
    pub fn provenance(&self) -> &Provenance {
        &self.provenance
    }
}

/// A recording of either kind, as read from a file.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant)] // a handful exist at a time, and their samples are elsewhere
pub enum AnyRecording {
    /// Raw.
    Raw(Recording),
    /// Processed, ready to learn from.
    Processed(ProcessedRecording),
}

impl AnyRecording {
    /// The hand's movement.
    pub fn gesture(&self) -> Gesture {
        match self {
            AnyRecording::Raw(recording) => recording.gesture,
            AnyRecording::Processed(recording) => recording.gesture,
        }
    }

    /// Samples of the vibration per second.
    pub fn vibration_hz(&self) -> f64 {
        match self {
            AnyRecording::Raw(recording) => recording.acceleration_v.rate_hz,
            AnyRecording::Processed(recording) => recording.rate_hz(),
        }
    }

    /// The origin.
    pub fn provenance(&self) -> &Provenance {
        match self {
            AnyRecording::Raw(recording) => &recording.provenance,
            AnyRecording::Processed(recording) => &recording.provenance,
        }
    }

    /// The same recording with these settings of its provenance replaced.
    fn with_settings(mut self, settings: &BTreeMap<String, String>) -> Self {
        let provenance = match &mut self {
            AnyRecording::Raw(recording) => &mut recording.provenance,
            AnyRecording::Processed(recording) => &mut recording.provenance,
        };
        provenance.settings.extend(settings.clone());
        self
    }

    /// The same recording with another gesture, for files that do not state one.
    pub fn with_gesture(mut self, gesture: Gesture) -> Self {
        match &mut self {
            AnyRecording::Raw(recording) => recording.gesture = gesture,
            AnyRecording::Processed(recording) => recording.gesture = gesture,
        }
        self
    }
}

fn check_axes(
    quantity: &'static str,
    bound: (f64, &'static str),
    axes: Option<&[[f64; 3]]>,
    expected: usize,
) -> Result<(), RecordingError> {
    let Some(axes) = axes else { return Ok(()) };
    let samples = axes.len();
    if samples != expected {
        return Err(RecordingError::Lengths { quantity, samples, expected });
    }
    RecordingError::check(quantity, bound, axes.iter().map(|a| magnitude(a)))
}

const ACCELERATIONS: (f64, &str) = (bounds::MAX_ACCELERATION_M_S2, "m/s2");
const FORCES: (f64, &str) = (bounds::MAX_FORCE_N, "N");

/// The largest magnitude; infinite if one is no finite number.
fn magnitude(values: &[f64]) -> f64 {
    let finite = |x: &f64| if x.is_finite() { x.abs() } else { f64::INFINITY };
    values.iter().map(finite).fold(0.0, f64::max)
}

/// An error in the samples or the calibration of a recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum RecordingError {
    #[error("the rate of the {quantity} is {} Hz; it must be {RATES}", shown(*rate_hz))]
    Rate { quantity: &'static str, rate_hz: f64 },
    #[error("the {quantity} starts at {start_s} s; that must be at most {} s from 0", bounds::MAX_TIME_S)]
    Start { quantity: &'static str, start_s: f64 },
    #[error("the {quantity} has {samples} samples; a recording needs at least two")]
    TooShort { quantity: &'static str, samples: usize },
    #[error(
        "the {quantity} has {samples} samples, but the acceleration has {expected}; all quantities must have the same number"
    )]
    Lengths { quantity: &'static str, samples: usize, expected: usize },
    #[error(
        "sample {sample} (from 0) of the {quantity} is not a finite number: repair the recording or cut it there"
    )]
    NotFinite { quantity: &'static str, sample: usize },
    #[error(
        "sample {sample} (from 0) of the {quantity} has a magnitude of {} {unit}; at most {} {unit} is read: check the unit", shown(*value), shown(*most)
    )]
    TooLarge { quantity: &'static str, sample: usize, value: f64, most: f64, unit: &'static str },
    #[error(
        "the orientation of sample {sample} (from 0) is a quaternion of length {}; it must be a unit quaternion", shown(*length)
    )]
    Orientation { sample: usize, length: f64 },
    #[error(
        "the calibration is invalid: all numbers must be finite, sensitivities must not be zero, and the force sensor's rotation must be an orthonormal right-handed matrix"
    )]
    Calibration,
    #[error(
        "motion, force and acceleration do not overlap in time: the last begins at {} s, the first ends at {} s; check their start times",
        shown(*begin_s), shown(*end_s)
    )]
    NoOverlap { begin_s: f64, end_s: f64 },
    #[error("the speed at sample {sample} (from 0) is {} m/s; a speed cannot be negative", shown(*speed_m_s))]
    NegativeSpeed { sample: usize, speed_m_s: f64 },
}

impl RecordingError {
    /// The error of the first value that is no finite number, or larger than the bound.
    fn check(
        quantity: &'static str,
        (most, unit): (f64, &'static str),
        values: impl Iterator<Item = f64>,
    ) -> Result<(), Self> {
        // NaN is not within it.
        match values.map(f64::abs).enumerate().find(|(_, x)| !(0.0..=most).contains(x)) {
            None => Ok(()),
            Some((sample, value)) if value.is_finite() => {
                Err(Self::TooLarge { quantity, sample, value, most, unit })
            }
            Some((sample, _)) => Err(Self::NotFinite { quantity, sample }),
        }
    }
}

#[cfg(test)]
mod habits;
#[cfg(test)]
mod loggers;
#[cfg(test)]
pub(crate) mod synthetic;
#[cfg(test)]
mod tests;
