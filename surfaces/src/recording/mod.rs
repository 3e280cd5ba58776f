//! Recordings: what a tool felt (thesis 2.2), as the sensors gave it or already processed, and their files.
//!
//! A [`Recording`] is raw: each sensor at its own rate, in its own frame and unit, with the calibration that makes
//! physical quantities of it. A [`ProcessedRecording`] is what models are learned from: acceleration on one axis, normal
//! and tangential force and speed, all at one rate. [`learning::processing`](crate::learning::processing) leads from one to the
//! other; most public data is of the second kind.

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
mod rows;
mod series;
mod signal;
#[cfg(not(target_family = "wasm"))]
mod spool;

#[cfg(not(target_family = "wasm"))]
pub use archive::{read_archive, write_archive};
pub use csv::{COLUMNS, CsvHead, QUANTITIES, RawTable, csv_head, read_csv, write_csv};
pub use error::ReadError;
pub use file::{LoadError, Sweep, load, load_column, load_signal, load_sweep, load_with, save};
pub use hatt::read_hatt;
pub use import::{BadCell, Finding, ImportSettings};
#[cfg(target_family = "wasm")]
pub use no_archive::{Spool, assemble, read_archive, spool_folder, write_archive};
pub use rows::decoded;
pub use series::Series;
pub use signal::{Column, read_column, read_signal};
#[cfg(not(target_family = "wasm"))]
pub use spool::{Spool, assemble, spool_folder};

use crate::Provenance;
use import::shown;
use std::sync::Arc;

/// A recording as the sensors gave it.
///
/// Three frames: the sensor's, the tool's and the world (the tracker's). Forces act on the tool.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    motion: Series<Pose>,
    wrench: Series<Wrench>,
    acceleration_v: Series<[f64; 3]>,
    calibration: Calibration,
    gesture: Gesture,
    provenance: Provenance,
}

/// What is known of a raw recording before its first sample.
#[derive(Debug)]
pub struct RawHead<'a> {
    /// Poses a second.
    pub motion_hz: f64,
    /// Loads a second.
    pub wrench_hz: f64,
    /// Accelerations a second.
    pub acceleration_hz: f64,
    /// What makes physical quantities of the readings.
    pub calibration: &'a Calibration,
    /// What the hand does.
    pub gesture: Gesture,
    /// Where it comes from.
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

/// Where the tracker's sensor is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// In the world, m.
    pub position_m: [f64; 3],
    /// Unit quaternion w, x, y, z that turns tool coordinates into world coordinates.
    pub orientation: [f64; 4],
}

/// What the force sensor feels: the load that acts on the tool, in the sensor's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench {
    /// N.
    pub force_n: [f64; 3],
    /// N m.
    pub torque_n_m: [f64; 3],
}

/// What makes physical quantities of sensor readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    /// Sensitivity of each accelerometer axis, m/s² per V.
    pub acceleration_m_s2_per_v: [f64; 3],
    /// What each axis reads when nothing accelerates, V.
    pub acceleration_zero_v: [f64; 3],
    /// Rotation that turns force-sensor coordinates into tool coordinates, by rows.
    pub force_sensor_to_tool: [[f64; 3]; 3],
    /// From the tracker's sensor to the tip, in tool coordinates, m.
    pub tracker_to_tip_m: [f64; 3],
}

impl Default for Calibration {
    /// Readings that are physical quantities in the tool's frame already, the tracker at the tip.
    fn default() -> Self {
        Self {
            acceleration_m_s2_per_v: [1.0; 3],
            acceleration_zero_v: [0.0; 3],
            force_sensor_to_tool: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            tracker_to_tip_m: [0.0; 3],
        }
    }
}

/// What the hand did, and so which part of a surface can be learned from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Gesture {
    /// Dragging freely at all speeds and forces: texture (and friction where there is no better recording).
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

    /// The word for people and files, such as `drag`.
    pub fn word(self) -> &'static str {
        match self {
            Gesture::Drag => "drag",
            Gesture::Circle => "circle",
            Gesture::Tap => "tap",
            Gesture::Press => "press",
        }
    }

    /// The gesture of that word.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|gesture| gesture.word() == word)
    }
}

impl Recording {
    /// A recording of `motion` (240 Hz in the thesis), `wrench` and `acceleration_v` (10 kHz, V).
    ///
    /// Checked: each has two samples at least, all numbers are finite, orientations are unit quaternions (to 1e-3; they are
    /// normalised here), the force sensor's rotation is one, and the three overlap in time.
    pub fn new(
        mut motion: Series<Pose>,
        wrench: Series<Wrench>,
        acceleration_v: Series<[f64; 3]>,
        calibration: Calibration,
        gesture: Gesture,
        provenance: Provenance,
    ) -> Result<Self, RecordingError> {
        motion.check("motion", |pose| {
            all_finite(&pose.position_m) && all_finite(&pose.orientation)
        })?;
        wrench.check("wrench", |w| all_finite(&w.force_n) && all_finite(&w.torque_n_m))?;
        acceleration_v.check("acceleration", |a| all_finite(a))?;
        calibration.check()?;
        for (sample, pose) in motion.samples.iter_mut().enumerate() {
            let length = pose.orientation.iter().map(|q| q * q).sum::<f64>().sqrt();
            if (length - 1.0).abs() > 1e-3 {
                return Err(RecordingError::Orientation { sample, length });
            }
            // What is normalised already keeps its bits, however often it is read and written.
            if (length - 1.0).abs() > 1e-12 {
                pose.orientation = pose.orientation.map(|q| q / length);
            }
        }
        let begin = motion.start_s.max(wrench.start_s).max(acceleration_v.start_s);
        let end = motion.end_s().min(wrench.end_s()).min(acceleration_v.end_s());
        if begin >= end {
            return Err(RecordingError::NoOverlap {
                begin_s: begin,
                end_s: end,
            });
        }
        Ok(Self {
            motion,
            wrench,
            acceleration_v,
            calibration,
            gesture,
            provenance,
        })
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

    /// What makes physical quantities of the readings.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// What the hand did.
    pub fn gesture(&self) -> Gesture {
        self.gesture
    }

    /// Where it came from.
    pub fn provenance(&self) -> &Provenance {
        &self.provenance
    }
}

impl Calibration {
    fn check(&self) -> Result<(), RecordingError> {
        let finite = all_finite(&self.acceleration_zero_v) && all_finite(&self.tracker_to_tip_m);
        let sensitive = self
            .acceleration_m_s2_per_v
            .iter()
            .all(|s| s.is_finite() && *s != 0.0);
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
        if finite && sensitive && orthonormal && determinant > 0.0 {
            Ok(())
        } else {
            Err(RecordingError::Calibration)
        }
    }
}

/// What models are learned from: all quantities at one rate, from the same moment on.
#[derive(Debug, Clone, PartialEq)]
pub struct ProcessedRecording {
    // Shared, as minutes at 10 kHz are hundreds of megabytes.
    signals: Arc<Signals>,
    gesture: Gesture,
    provenance: Provenance,
}

/// The signals of a [`ProcessedRecording`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Signals {
    /// Samples a second of all of them.
    pub rate_hz: f64,
    /// High-passed and combined on one axis, m/s².
    pub acceleration_m_s2: Vec<f64>,
    /// How hard the tool presses, N; positive in contact.
    pub force_normal_n: Vec<f64>,
    /// Friction, N; positive against the motion. `None` where only the texture was recorded.
    pub force_tangential_n: Option<Vec<f64>>,
    /// Of the tip, m/s.
    pub speed_m_s: Vec<f64>,
    /// The three axes that were combined, m/s², where they are known.
    pub axes_m_s2: Option<Vec<[f64; 3]>>,
}

impl ProcessedRecording {
    /// Checked: the rate is positive, there are two samples at least and as many of every quantity, all finite, and no speed is
    /// negative.
    pub fn new(signals: Signals, gesture: Gesture, provenance: Provenance) -> Result<Self, RecordingError> {
        let Signals { rate_hz, .. } = signals;
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(RecordingError::Rate {
                quantity: "recording",
                rate_hz,
            });
        }
        let expected = signals.acceleration_m_s2.len();
        if expected < 2 {
            return Err(RecordingError::TooShort {
                quantity: "acceleration",
                samples: expected,
            });
        }
        let columns = [
            ("acceleration", Some(&signals.acceleration_m_s2)),
            ("normal force", Some(&signals.force_normal_n)),
            ("tangential force", signals.force_tangential_n.as_ref()),
            ("speed", Some(&signals.speed_m_s)),
        ];
        for (quantity, column) in columns {
            let Some(column) = column else { continue };
            if column.len() != expected {
                return Err(RecordingError::Lengths {
                    quantity,
                    samples: column.len(),
                    expected,
                });
            }
            if let Some(sample) = column.iter().position(|x| !x.is_finite()) {
                return Err(RecordingError::NotFinite { quantity, sample });
            }
        }
        if let Some(axes) = &signals.axes_m_s2 {
            if axes.len() != expected {
                return Err(RecordingError::Lengths {
                    quantity: "acceleration axes",
                    samples: axes.len(),
                    expected,
                });
            }
            if let Some(sample) = axes.iter().position(|a| !all_finite(a)) {
                return Err(RecordingError::NotFinite {
                    quantity: "acceleration axes",
                    sample,
                });
            }
        }
        if let Some(sample) = signals.speed_m_s.iter().position(|&v| v < 0.0) {
            return Err(RecordingError::NegativeSpeed {
                sample,
                speed_m_s: signals.speed_m_s[sample],
            });
        }
        Ok(Self {
            signals: Arc::new(signals),
            gesture,
            provenance,
        })
    }

    /// The signals.
    pub fn signals(&self) -> &Signals {
        &self.signals
    }

    /// Samples a second.
    pub fn rate_hz(&self) -> f64 {
        self.signals.rate_hz
    }

    /// Samples of every quantity.
    pub fn samples(&self) -> usize {
        self.signals.acceleration_m_s2.len()
    }

    /// What the hand did.
    pub fn gesture(&self) -> Gesture {
        self.gesture
    }

    /// Where it came from.
    pub fn provenance(&self) -> &Provenance {
        &self.provenance
    }
}

/// A recording of either kind, as files hold them.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant)] // a handful exist at a time, and their samples are elsewhere
pub enum AnyRecording {
    /// As the sensors gave it.
    Raw(Recording),
    /// Ready to learn from.
    Processed(ProcessedRecording),
}

impl AnyRecording {
    /// What the hand did.
    pub fn gesture(&self) -> Gesture {
        match self {
            AnyRecording::Raw(recording) => recording.gesture,
            AnyRecording::Processed(recording) => recording.gesture,
        }
    }

    /// Where it came from.
    pub fn provenance(&self) -> &Provenance {
        match self {
            AnyRecording::Raw(recording) => &recording.provenance,
            AnyRecording::Processed(recording) => &recording.provenance,
        }
    }

    /// The same recording of another gesture, for files that do not say what the hand did.
    pub fn with_gesture(mut self, gesture: Gesture) -> Self {
        match &mut self {
            AnyRecording::Raw(recording) => recording.gesture = gesture,
            AnyRecording::Processed(recording) => recording.gesture = gesture,
        }
        self
    }
}

fn all_finite(values: &[f64]) -> bool {
    values.iter().all(|x| x.is_finite())
}

/// Why numbers make no recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum RecordingError {
    #[error("the rate of the {quantity} is {} Hz; it must be a finite number above 0", shown(*rate_hz))]
    Rate { quantity: &'static str, rate_hz: f64 },
    #[error("the {quantity} starts at {start_s} s; that must be a finite number")]
    Start { quantity: &'static str, start_s: f64 },
    #[error("the {quantity} has {samples} samples; a recording needs two at least")]
    TooShort { quantity: &'static str, samples: usize },
    #[error(
        "the {quantity} has {samples} samples where the acceleration has {expected}; all must have as many"
    )]
    Lengths {
        quantity: &'static str,
        samples: usize,
        expected: usize,
    },
    #[error(
        "sample {sample} (from 0) of the {quantity} is not a finite number: repair the recording or cut it there"
    )]
    NotFinite { quantity: &'static str, sample: usize },
    #[error(
        "the orientation of sample {sample} (from 0) is a quaternion of length {}; it must be a unit quaternion", shown(*length)
    )]
    Orientation { sample: usize, length: f64 },
    #[error(
        "the calibration is unusable: numbers must be finite, sensitivities not zero, and the force sensor's rotation an orthonormal right-handed matrix"
    )]
    Calibration,
    #[error(
        "motion, force and acceleration never overlap: the last begins at {} s, the first ends at {} s; check their start times",
        shown(*begin_s), shown(*end_s)
    )]
    NoOverlap { begin_s: f64, end_s: f64 },
    #[error("the speed at sample {sample} (from 0) is {} m/s; a speed cannot be negative", shown(*speed_m_s))]
    NegativeSpeed { sample: usize, speed_m_s: f64 },
}

#[cfg(test)]
mod habits;
#[cfg(test)]
mod loggers;
#[cfg(test)]
pub(crate) mod synthetic;
#[cfg(test)]
mod tests;
