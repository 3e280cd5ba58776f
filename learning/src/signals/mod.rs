//! Signals of a tool on a surface (thesis 2.2): raw, as its sensors gave them, or processed.
//!
//! A [`Recording`] is raw: each sensor at its own rate, in its own frame and unit, with a calibration to physical
//! quantities. Models are learned from a [`ProcessedRecording`]: acceleration on one axis, normal and tangential force
//! and speed, all at one rate. [`processing`](crate::processing) converts the first to the second.

pub(crate) mod series;

pub use haptograph_surfaces::recorder::{Calibration, Gesture, Pose, Wrench};
use series::check;
pub use series::{Sensor, Series};

use haptograph_surfaces::Provenance;
use haptograph_surfaces::bounds::{self, RATES, RATES_HZ, shown};
use haptograph_surfaces::recorder::magnitude;
use haptograph_surfaces::rendering::Trajectory;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A raw recording: the samples of each sensor.
///
/// There are three coordinate frames: the sensor's, the tool's and the world (the tracker's). Forces act on the tool.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    motion: Series<Pose>,
    wrench: Sensor<Wrench>,
    acceleration_v: Sensor<[f64; 3]>,
    calibration: Calibration,
    gesture: Gesture,
    provenance: Provenance,
}

impl Recording {
    /// A recording of `motion` (240 Hz in the thesis), `wrench` and `acceleration_v` (10 kHz, V).
    ///
    /// Checks that each sensor has at least two samples, all numbers are within their [`bounds`], orientations are unit quaternions
    /// (to 1e-3; they are normalised here), the force sensor's rotation is orthonormal, and the three overlap in time.
    pub fn new(
        mut motion: Series<Pose>,
        wrench: impl Into<Sensor<Wrench>>,
        acceleration_v: impl Into<Sensor<[f64; 3]>>,
        calibration: Calibration,
        gesture: Gesture,
        provenance: Provenance,
    ) -> Result<Self, RecordingError> {
        let (wrench, acceleration_v) = (wrench.into(), acceleration_v.into());
        let grid = (motion.rate_hz, motion.start_s, motion.samples.len());
        let sizes = motion.samples.iter();
        let sizes = sizes.map(|pose| magnitude(&pose.position_m).max(magnitude(&pose.orientation)));
        check("motion", (bounds::MAX_POSITION_M, "m"), grid, sizes)?;
        let grid = (wrench.rate_hz, wrench.start_s, wrench.count());
        let sizes = wrench.iter().map(|load| magnitude(&load.force_n).max(magnitude(&load.torque_n_m)));
        check("wrench", (bounds::MAX_FORCE_N, "N or N m"), grid, sizes)?;
        let grid = (acceleration_v.rate_hz, acceleration_v.start_s, acceleration_v.count());
        let sizes = acceleration_v.iter().map(|volts| magnitude(&volts));
        check("acceleration", (bounds::MAX_ACCELERATION_M_S2, "V"), grid, sizes)?;
        if !calibration.is_valid() {
            return Err(RecordingError::Calibration);
        }
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
    pub fn wrench(&self) -> &Sensor<Wrench> {
        &self.wrench
    }

    /// Readings of the accelerometer's axes, V.
    pub fn acceleration_v(&self) -> &Sensor<[f64; 3]> {
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

/// A processed recording, from which models are learned: all quantities have one rate and start at the same time.
#[derive(Debug, Clone, PartialEq)]
pub struct ProcessedRecording {
    // Shared, because minutes at 10 kHz take hundreds of megabytes.
    signals: Arc<Signals>,
    world: Arc<WorldAxes>,
    /// The vibration without its lines, in place of that of the signals.
    noise_m_s2: Option<Arc<[f64]>>,
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
        Ok(Self { signals: Arc::new(signals), world: Arc::default(), noise_m_s2: None, gesture, provenance })
    }

    /// The same recording with axes in the world.
    ///
    /// # Errors
    /// Axes of another length than the signals, or a number that is not finite.
    pub(crate) fn with_world(mut self, world: WorldAxes) -> Result<Self, RecordingError> {
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

    /// The same recording with this vibration, of as many samples, to learn from.
    pub(crate) fn with_noise(&self, noise_m_s2: Vec<f64>) -> Self {
        Self { noise_m_s2: Some(noise_m_s2.into()), ..self.clone() }
    }

    /// The vibration to learn from, m/s².
    pub(crate) fn vibration_m_s2(&self) -> &[f64] {
        self.noise_m_s2.as_deref().unwrap_or(&self.signals.acceleration_m_s2)
    }

    /// Position and force by axis.
    pub(crate) fn world(&self) -> &WorldAxes {
        &self.world
    }

    /// The signals.
    pub fn signals(&self) -> &Signals {
        &self.signals
    }

    /// Speed and force over time, for a synthesis along them.
    pub fn trajectory(&self) -> Trajectory {
        Trajectory {
            rate_hz: self.signals.rate_hz,
            speed_m_s: self.signals.speed_m_s.clone(),
            force_n: self.signals.force_normal_n.clone(),
        }
    }

    /// The same at another rate, held between the samples.
    pub fn trajectory_at(&self, rate_hz: f64) -> Trajectory {
        let ratio = self.rate_hz() / rate_hz;
        let at = |values: &[f64]| {
            let places = 0..(values.len() as f64 / ratio) as usize;
            places.map(|place| values[((place as f64 * ratio) as usize).min(values.len() - 1)]).collect()
        };
        let Signals { speed_m_s, force_normal_n, .. } = self.signals();
        Trajectory { rate_hz, speed_m_s: at(speed_m_s), force_n: at(force_normal_n) }
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
    pub(crate) fn gesture(&self) -> Gesture {
        self.gesture
    }

    /// The origin.
    pub(crate) fn provenance(&self) -> &Provenance {
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
    pub(crate) fn vibration_hz(&self) -> f64 {
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
    pub(crate) fn with_settings(mut self, settings: &BTreeMap<String, String>) -> Self {
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
