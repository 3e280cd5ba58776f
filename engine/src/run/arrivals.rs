//! The replay log of a live run, from which the run can be repeated bit for bit.
//!
//! Clocks and threads determine only the number of frames that a callback runs and the frames that have arrived in its
//! rings. A file of each driver contains these, one line per callback:
//!
//! ```text
//! audio frames,fade,open out,arrived moves.output to moving.input,sent torque.output to arm.torque
//! 48,0,1,1,48
//! ```
//!
//! The columns are: the frames run; 1 from the start of the fade-out of a stop; for each actuator downstream of live
//! inputs, 1 if its gate is open and 0 if an input is silent; for each ring that it reads, the frames that arrived
//! since the line before; for each ring that it writes, the frames that fitted. A last line with a 2 in the second
//! column marks a change of graph, where the log ends. A line with a 3 there is of no callback: the outputs of all devices (0 in
//! the first column), or those of one (counted from 1), began from zero after they had been given zeros. The live inputs have files of their own, see [`inputs`]. A
//! second file of each driver has the setting changes:
//!
//! ```text
//! frame,from,to,glide frames,setting
//! 48000,1,0.5,960,out.gain
//! ```
//!
//! `graph.txt` has a fingerprint of everything that determines the samples, to detect another graph, and whether real
//! actuators started without heat reserve.
//!
//! A replay reads each file twice, line by line: the first pass checks that a run of that length can have written it.

mod inputs;
mod log;
mod replay;
mod rows;

pub(super) use inputs::{Input, InputLog, InputScript};
pub(super) use log::{ArrivalLog, LogWriter};
pub(super) use replay::{Arrivals, check_logs, repeat_inputs, replay};

use crate::plan::{FINGERPRINTS_NAME, FINGERPRINTS_VERSION, Plan, Planner};
use crate::settings::LiveSetting;
use haptograph_signal::files;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Folder of the replay log in a run's folder.
pub const ARRIVALS: &str = "arrivals";
/// Values of a callback's second column.
const RUNNING: f64 = 0.0;
const FADING: f64 = 1.0;
const REPLACED: f64 = 2.0;
/// Outputs begin from zero again; a line of no callback.
const RESUMED: f64 = 3.0;
const SETTINGS_HEADER: &str = "frame,from,to,glide frames,setting";

/// Reason why a run cannot be repeated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// A file is missing or cannot be read.
    #[error("cannot read {}: {error}; a live run writes it", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        error: std::io::Error,
    },
    /// The columns belong to another graph.
    #[error("{} belongs to another graph: its first line is `{found}`, expected `{wanted}`", path.display())]
    OtherGraph {
        /// The file.
        path: PathBuf,
        /// The first line.
        found: String,
        /// The expected line.
        wanted: String,
    },
    /// The run was of another graph with the same rings and drivers.
    #[error("{} belongs to another graph: {differences}; use the graph, files and parameters of that run", path.display())]
    Changed {
        /// The file of fingerprints.
        path: PathBuf,
        /// The differences.
        differences: String,
    },
    /// The fingerprints are of another version: they cannot be compared with those of this program.
    #[error("{} has fingerprints of version {found}, but this program compares version {FINGERPRINTS_VERSION}; \
             replay the run with the version of haptograph that recorded it, or record it again", path.display())]
    OtherVersion {
        /// The file of fingerprints.
        path: PathBuf,
        /// The version as written; `unknown` if it has none.
        found: String,
    },
    /// A line is malformed.
    #[error("{} line {line}: expected {columns} whole numbers", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// Number of columns of a line.
        columns: usize,
    },
    /// A line is not a change of a live setting of the graph.
    #[error("{} line {line}: expected `{SETTINGS_HEADER}`, four numbers and a live setting of this graph", path.display())]
    Setting {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
    },
    /// A run of that length cannot have written the line.
    #[error("{} line {line}: {why}; the file is damaged or belongs to another run", path.display())]
    Implausible {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// The contradiction.
        why: String,
    },
    /// A callback read frames that no driver had sent by then.
    #[error("{} contradicts the files of the other drivers: line {line} waits for frames that they never send", path.display())]
    Contradiction {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
    },
}

/// Bounds of the run, for checking its logs.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ReplayBounds {
    /// Longest possible duration of a driver, s.
    pub longest_s: f64,
    /// Largest number of frames of the first driver, and whether it is exact.
    pub frames: Option<(u64, bool)>,
}

impl ReplayBounds {
    /// Bounds of a run of which no driver can have run for longer than this, s.
    pub fn new(longest_s: f64) -> Self {
        Self { longest_s, frames: None }
    }
}

impl Default for ReplayBounds {
    /// Bounds of an unknown run: 10^7 s.
    fn default() -> Self {
        Self::new(1e7)
    }
}

/// File of a driver's callbacks.
pub(super) fn file(folder: &Path, driver: usize) -> PathBuf {
    folder.join(ARRIVALS).join(format!("{driver}.csv"))
}

/// File of a driver's setting changes.
pub(super) fn settings_file(folder: &Path, driver: usize) -> PathBuf {
    folder.join(ARRIVALS).join(format!("{driver}.settings.csv"))
}

/// File of a live input that a driver reads.
pub(super) fn input_file(folder: &Path, driver: usize, device: usize) -> PathBuf {
    folder.join(ARRIVALS).join(format!("{driver}.input-{device}.csv"))
}

fn graph_file(folder: &Path) -> PathBuf {
    folder.join(ARRIVALS).join("graph.txt")
}

/// Line of a run whose real actuators started without heat reserve.
const UNRESTED: &str = "unrested actuators";

/// Writes the fingerprints of a run's graph, and whether its actuators started rested.
pub(super) fn keep_graph(planner: Planner<'_>, rested: bool, folder: &Path) -> std::io::Result<()> {
    let heat = match rested {
        true => String::new(),
        false => format!("{:016x} {UNRESTED}\n", 1),
    };
    let lines =
        planner.fingerprints().into_iter().map(|(name, fingerprint)| format!("{fingerprint:016x} {name}\n"));
    std::fs::create_dir_all(folder.join(ARRIVALS))?;
    std::fs::write(graph_file(folder), lines.collect::<String>() + &heat)
}

/// Refuses a graph that is not that of the run. Returns whether its actuators started rested.
pub(super) fn check_graph(planner: Planner<'_>, folder: &Path) -> Result<bool, ReplayError> {
    const NAMED: usize = 4;
    let path = graph_file(folder);
    let text = match files::read_text(&path, files::MAX_GRAPH_BYTES) {
        Ok(text) => text,
        Err(error) => return Err(ReplayError::Read { path, error }),
    };
    let mut then: BTreeMap<&str, &str> = text
        .lines()
        .filter_map(|line| line.split_once(' '))
        .map(|(fingerprint, name)| (name, fingerprint))
        .collect();
    // Ahead of the rest: under another version every node would differ.
    let found = then.get(FINGERPRINTS_NAME).copied();
    let found = found.and_then(|version| u64::from_str_radix(version, 16).ok());
    if found != Some(FINGERPRINTS_VERSION) {
        let found = found.map_or_else(|| "unknown".to_owned(), |version| version.to_string());
        return Err(ReplayError::OtherVersion { path, found });
    }
    let rested = then.remove(UNRESTED).is_none();
    let mut differences = Vec::new();
    for (name, fingerprint) in planner.fingerprints() {
        match then.remove(name.as_str()) {
            None => differences.push(format!("`{name}` is new")),
            Some(kept) if kept != format!("{fingerprint:016x}") => {
                differences.push(format!("`{name}` differs"));
            }
            Some(_) => {}
        }
    }
    differences.extend(then.into_keys().map(|name| format!("`{name}` is missing")));
    if differences.is_empty() {
        return Ok(rested);
    }
    let more = differences.len().saturating_sub(NAMED);
    differences.truncate(NAMED);
    if more > 0 {
        differences.push(format!("and {more} more"));
    }
    let differences = differences.join(", ");
    Err(ReplayError::Changed { path, differences })
}

/// A cell of CSV.
fn quoted(text: String) -> String {
    match text.contains([',', '"']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text,
    }
}

/// The cell of a setting's name.
fn cell(live: &LiveSetting) -> String {
    quoted(live.name())
}

fn header(plan: &Plan) -> String {
    let reads = plan.ring_reads.iter().map(|read| format!("arrived {}", read.ring.name));
    let writes = plan.ring_writes.iter().map(|write| format!("sent {}", write.ring.name));
    let gates = gated(plan).map(|place| format!("open {}", plan.actuators[place].path));
    let names = [format!("{} frames", plan.driver_name()), "fade".to_owned()];
    let cells = names.into_iter().chain(gates).chain(reads).chain(writes);
    cells.map(quoted).collect::<Vec<_>>().join(",")
}

fn columns(plan: &Plan) -> usize {
    2 + gated(plan).count() + plan.ring_reads.len() + plan.ring_writes.len()
}

/// Indices of the actuators downstream of live inputs.
fn gated(plan: &Plan) -> impl Iterator<Item = usize> {
    let actuators = plan.actuators.iter().enumerate();
    actuators.filter(|(_, actuator)| !actuator.silenced_by.is_empty()).map(|(place, _)| place)
}
