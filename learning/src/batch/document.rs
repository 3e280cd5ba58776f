//! The plan document.

use haptograph_surfaces::files::{Malformed, Place};
use haptograph_surfaces::rendering::Trajectory;
use ron::extensions::Extensions;
use ron::value::RawValue;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A plan, field by field.
#[derive(Debug, Deserialize)]
#[serde(rename = "Batch", deny_unknown_fields)]
pub(super) struct Document {
    pub surfaces: Vec<String>,
    pub motions: BTreeMap<String, Motion>,
    pub jobs: Jobs,
    #[serde(default = "all_signals")]
    pub write: Vec<Signal>,
    #[serde(default)]
    pub samples: Samples,
    #[serde(default)]
    pub format: Format,
    #[serde(default = "usual_update_hz")]
    pub update_hz: f64,
    #[serde(default = "usual_gain")]
    pub gain: f64,
    #[serde(default = "usual_jobs_per_chunk")]
    pub jobs_per_chunk: u64,
}

/// A motion of the hand.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum Motion {
    /// A random walk through speed and force, different for each seed; without ranges through what all surfaces recorded.
    RandomWalk {
        seconds: f64,
        #[serde(default)]
        speed_mm_s: Option<(f64, f64)>,
        #[serde(default)]
        force_n: Option<(f64, f64)>,
        #[serde(default = "usual_cutoff_hz")]
        cutoff_hz: f64,
    },
    /// A constant speed and force.
    Constant { seconds: f64, speed_mm_s: f64, force_n: f64 },
    /// Speed and force of a recording.
    Recording(String),
}

/// The jobs.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum Jobs {
    /// Every surface along every motion with every seed from the first to the last.
    Product { seeds: (u64, u64) },
    /// The rows of a table.
    Table(String),
}

/// A signal of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub(super) enum Signal {
    /// Acceleration, m/s².
    Vibration,
    /// m/s.
    Speed,
    /// N.
    Force,
}

/// The number type of stored samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
pub(super) enum Samples {
    /// Rounded to single precision.
    #[default]
    Float32,
    /// Double precision, as computed.
    Float64,
}

/// The file format of chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) enum Format {
    /// Arrays for NumPy.
    #[default]
    Npz,
    /// A table with a row for each job.
    Parquet,
}

impl Format {
    /// The extension of a file.
    pub(super) fn extension(self) -> &'static str {
        match self {
            Self::Npz => "npz",
            Self::Parquet => "parquet",
        }
    }
}

impl Signal {
    /// The samples in the result of a job.
    pub(super) fn of<'a>(self, trajectory: &'a Trajectory, vibration: &'a [f64]) -> &'a [f64] {
        match self {
            Self::Vibration => vibration,
            Self::Speed => &trajectory.speed_m_s,
            Self::Force => &trajectory.force_n,
        }
    }

    /// The name in a chunk.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Vibration => "vibration_m_s2",
            Self::Speed => "speed_m_s",
            Self::Force => "force_n",
        }
    }
}

impl Samples {
    /// NumPy's name of the type.
    pub(super) fn as_str(self) -> &'static str {
        match self {
            Self::Float32 => "float32",
            Self::Float64 => "float64",
        }
    }

    /// Bytes of a sample.
    pub(super) fn bytes(self) -> u64 {
        match self {
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }
}

fn all_signals() -> Vec<Signal> {
    vec![Signal::Vibration, Signal::Speed, Signal::Force]
}

fn usual_update_hz() -> f64 {
    haptograph_surfaces::rendering::SynthesisSettings::default().update_hz
}

fn usual_gain() -> f64 {
    1.0
}

fn usual_cutoff_hz() -> f64 {
    1.0
}

fn usual_jobs_per_chunk() -> u64 {
    64
}

/// The locations of a plan's parts, for error messages.
#[derive(Deserialize)]
#[serde(rename = "Batch")]
struct Places<'a> {
    #[serde(borrow)]
    surfaces: Vec<&'a RawValue>,
    #[serde(borrow)]
    motions: BTreeMap<String, &'a RawValue>,
    #[serde(borrow)]
    jobs: &'a RawValue,
    #[serde(borrow, default)]
    write: Option<&'a RawValue>,
    #[serde(borrow, default)]
    update_hz: Option<&'a RawValue>,
    #[serde(borrow, default)]
    gain: Option<&'a RawValue>,
    #[serde(borrow, default)]
    jobs_per_chunk: Option<&'a RawValue>,
}

/// A part of a plan.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Part {
    /// An entry of `surfaces`, from 0.
    Surface(usize),
    /// The motion of this name.
    Motion(String),
    Jobs,
    Write,
    UpdateHz,
    Gain,
    JobsPerChunk,
}

fn options() -> ron::Options {
    ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME).with_recursion_limit(32)
}

impl Document {
    /// Parses a plan; an error has its location.
    pub(super) fn parse(text: &str) -> Result<Self, (Place, Malformed)> {
        let parsed = options().from_str(text);
        parsed.map_err(|error| Malformed::of(text, "Batch", error))
    }
}

/// The location of a part of a plan in its text.
pub(super) fn place_of(part: &Part, text: &str) -> Option<Place> {
    let places: Places<'_> = options().from_str(text).ok()?;
    let raw = match part {
        Part::Surface(number) => places.surfaces.get(*number).copied(),
        Part::Motion(name) => places.motions.get(name).copied(),
        Part::Jobs => Some(places.jobs),
        Part::Write => places.write,
        Part::UpdateHz => places.update_hz,
        Part::Gain => places.gain,
        Part::JobsPerChunk => places.jobs_per_chunk,
    };
    let value = raw?.get_ron();
    let begins = value.trim_start();
    let offset = begins.as_ptr() as usize - text.as_ptr() as usize;
    Some(Place::after(text.get(..offset)?))
}
