//! What the drivers of a live run saw of their rings, kept so that the run can be repeated bit for bit.
//!
//! All that clocks and threads decide is how many frames a callback runs and what it then sees of its rings. A file a
//! driver holds just that, one callback a line:
//!
//! ```text
//! audio frames,fade,open out,arrived moves.output to moving.input,sent torque.output to arm.torque
//! 48,0,1,1,48
//! ```
//!
//! The frames it ran; 1 from where it was stopped and faded out; of each actuator that depends on live inputs 1 where
//! these let it be driven, and 0 from the callback on that found one of them silent; of each ring that it reads the frames
//! that had arrived since the line before; of each that it fills the frames that found room. A last line with a 2 in place
//! of that first 1 says that another graph took over, which nothing is kept of. What the live inputs sensed is in files of
//! their own, see [`inputs`]. A second file a driver holds what was set meanwhile:
//!
//! ```text
//! frame,from,to,glide frames,setting
//! 48000,1,0.5,960,out.gain
//! ```
//!
//! Beside these stands `graph.txt`: a fingerprint of everything that the samples come from, so that no other graph is
//! taken for this one, and whether real actuators began with their heat spent.
//!
//! A replay reads each file twice, line by line: first all of it, to see whether a run of that length can have written it.

mod inputs;
mod log;
mod replay;
mod rows;

pub(super) use inputs::{Input, InputLog, InputScript, InputWriter};
pub(super) use log::{ArrivalLog, ArrivalWriter, SettingWriter};
pub(super) use replay::{Arrivals, check_logs};

use crate::graph::fingerprint::of_graph;
use crate::graph::{Graph, LiveSetting};
use crate::plan::Plan;
use haptograph_signal::files;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The folder of a run that holds what its drivers saw.
pub const ARRIVALS: &str = "arrivals";
/// What stands in a callback's second column.
const RUNNING: f64 = 0.0;
const FADING: f64 = 1.0;
const REPLACED: f64 = 2.0;
const SETTINGS_HEADER: &str = "frame,from,to,glide frames,setting";

/// Why a run cannot be repeated.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// A file is not there or cannot be read.
    #[error("cannot read {}: {error}; a live run writes it", path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// The file was written by another graph.
    #[error("{} belongs to another graph: its first line is `{found}`, expected `{wanted}`", path.display())]
    OtherGraph {
        /// Which.
        path: PathBuf,
        /// Its first line.
        found: String,
        /// What it would be.
        wanted: String,
    },
    /// The run was of another graph, though its rings and drivers are called the same.
    #[error("{} belongs to another graph: {differences}; use the graph, files and --set of that run", path.display())]
    Changed {
        /// Where the run's graph is kept.
        path: PathBuf,
        /// What is not as it was.
        differences: String,
    },
    /// A line holds something else.
    #[error("{} line {line}: expected {columns} whole numbers", path.display())]
    Line {
        /// Which.
        path: PathBuf,
        /// Where, from 1.
        line: usize,
        /// How many numbers a line has.
        columns: usize,
    },
    /// A line is no change of a setting that the graph has.
    #[error("{} line {line}: expected `{SETTINGS_HEADER}`, four numbers and a live setting of this graph", path.display())]
    Setting {
        /// Which.
        path: PathBuf,
        /// Where, from 1.
        line: usize,
    },
    /// A line is not what a run of that length can have written.
    #[error("{} line {line}: {why}; the file is damaged or belongs to another run", path.display())]
    Implausible {
        /// Which.
        path: PathBuf,
        /// Where, from 1.
        line: usize,
        /// What is wrong with it.
        why: String,
    },
    /// A callback saw what nobody had sent by then.
    #[error("{} contradicts the files of the other drivers: line {line} waits for frames that they never send", path.display())]
    Contradiction {
        /// Which.
        path: PathBuf,
        /// Where, from 1.
        line: usize,
    },
}

/// What is known of the run whose logs are read, for telling whether they can be its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReplayBounds {
    /// No driver ran for longer, s.
    pub longest_s: f64,
    /// Frames of the first driver at most, and whether they are exactly so many.
    pub frames: Option<(u64, bool)>,
}

impl Default for ReplayBounds {
    /// Of a run that nothing is known of: 10^7 s.
    fn default() -> Self {
        Self {
            longest_s: 1e7,
            frames: None,
        }
    }
}

/// The file of the driver with this number, in a run's folder.
pub(super) fn file(folder: &Path, driver: usize) -> PathBuf {
    folder.join(ARRIVALS).join(format!("{driver}.csv"))
}

/// The file of what was set of it.
pub(super) fn settings_file(folder: &Path, driver: usize) -> PathBuf {
    folder.join(ARRIVALS).join(format!("{driver}.settings.csv"))
}

/// The file of what a live input sensed that this driver reads.
pub(super) fn input_file(folder: &Path, driver: usize, device: usize) -> PathBuf {
    folder.join(ARRIVALS).join(format!("{driver}.input-{device}.csv"))
}

fn graph_file(folder: &Path) -> PathBuf {
    folder.join(ARRIVALS).join("graph.txt")
}

/// The longest list of fingerprints that is read, bytes: a hundred thousand nodes.
const MAX_GRAPH_BYTES: u64 = 16 << 20;
/// In the file of a run whose real actuators began as warm as their limits allow.
const UNRESTED: &str = "unrested actuators";

/// Keeps what a run's graph is known by, and how its actuators began.
pub(super) fn keep_graph(graph: &Graph, rested: bool, folder: &Path) -> std::io::Result<()> {
    let heat = match rested {
        true => String::new(),
        false => format!("{:016x} {UNRESTED}\n", 1),
    };
    let lines = of_graph(graph)
        .into_iter()
        .map(|(name, fingerprint)| format!("{fingerprint:016x} {name}\n"));
    std::fs::create_dir_all(folder.join(ARRIVALS))?;
    std::fs::write(graph_file(folder), lines.collect::<String>() + &heat)
}

/// Refuses a graph that is not the one of the run; did its actuators begin rested?
pub(super) fn check_graph(graph: &Graph, folder: &Path) -> Result<bool, ReplayError> {
    const NAMED: usize = 4;
    let path = graph_file(folder);
    let text = match files::read_text(&path, MAX_GRAPH_BYTES) {
        Ok(text) => text,
        Err(error) => return Err(ReplayError::Read { path, error }),
    };
    let mut then: BTreeMap<&str, &str> = text
        .lines()
        .filter_map(|line| line.split_once(' '))
        .map(|(fingerprint, name)| (name, fingerprint))
        .collect();
    let rested = then.remove(UNRESTED).is_none();
    let mut differences = Vec::new();
    for (name, fingerprint) in of_graph(graph) {
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

/// A cell of a line.
fn quoted(text: String) -> String {
    match text.contains([',', '"']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text,
    }
}

/// A setting's name in a line.
fn cell(live: &LiveSetting) -> String {
    quoted(live.name())
}

fn header(plan: &Plan) -> String {
    let reads = plan
        .ring_reads
        .iter()
        .map(|read| format!("arrived {}", read.ring.name));
    let writes = plan
        .ring_writes
        .iter()
        .map(|write| format!("sent {}", write.ring.name));
    let gates = gated(plan).map(|place| format!("open {}", plan.actuators[place].path));
    let names = [format!("{} frames", plan.driver_name()), "fade".to_owned()];
    let cells = names.into_iter().chain(gates).chain(reads).chain(writes);
    cells.map(quoted).collect::<Vec<_>>().join(",")
}

fn columns(plan: &Plan) -> usize {
    2 + gated(plan).count() + plan.ring_reads.len() + plan.ring_writes.len()
}

/// The places of the actuators that depend on live inputs.
fn gated(plan: &Plan) -> impl Iterator<Item = usize> {
    let actuators = plan.actuators.iter().enumerate();
    actuators
        .filter(|(_, actuator)| !actuator.silenced_by.is_empty())
        .map(|(place, _)| place)
}

/// Writes a line of numbers, each in as many digits as make the same bits again.
fn write_row(to: &mut impl Write, row: &[f64]) -> std::io::Result<()> {
    for (place, number) in row.iter().enumerate() {
        let comma = if place > 0 { "," } else { "" };
        write!(to, "{comma}{number}")?;
    }
    writeln!(to)
}
