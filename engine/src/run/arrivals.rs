//! What the drivers of a live run saw of their rings, kept so that the run can be repeated bit for bit.
//!
//! All that clocks and threads decide is how many frames a callback runs and what it then sees of its rings. A file a
//! driver holds just that, one callback a line:
//!
//! ```text
//! audio frames,fade,arrived moves.output to moving.input,sent torque.output to arm.torque
//! 48,0,1,48
//! ```
//!
//! The frames it ran; 1 from where it was stopped and faded out; of each ring that it reads the frames that had arrived
//! since the line before; of each that it fills the frames that found room. Beside these stands `graph.txt`: a
//! fingerprint of everything that the samples come from, so that no other graph is taken for this one.

use super::Run;
use super::fleet::Fleet;
use super::live::FADE_S;
use crate::graph::Graph;
use crate::graph::fingerprint::of_graph;
use crate::node::FrameWriter;
use crate::plan::Plan;
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

/// The folder of a run that holds what its drivers saw.
pub const ARRIVALS: &str = "arrivals";
/// Callbacks that can be on their way to the file.
const ROWS: usize = 8192;

/// Why a run cannot be repeated.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// A file is not there or cannot be read.
    #[error("cannot read {}: {error}; a live run of a graph with several drivers writes it", path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// The file was written by another graph.
    #[error("{} is of another graph: it begins `{found}`, and this graph's would begin `{wanted}`", path.display())]
    OtherGraph {
        /// Which.
        path: PathBuf,
        /// Its first line.
        found: String,
        /// What it would be.
        wanted: String,
    },
    /// The run was of another graph, though its rings and drivers are called the same.
    #[error("{} is of another graph: {differences}; give the graph, its files and --set as they were", path.display())]
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
    /// A callback saw what nobody had sent by then.
    #[error("{} does not go with the files of the other drivers: line {line} waits for ever", path.display())]
    Contradiction {
        /// Which.
        path: PathBuf,
        /// Where, from 1.
        line: usize,
    },
}

/// The file of the driver with this number, in a run's folder.
pub(super) fn file(folder: &Path, driver: usize) -> PathBuf {
    folder.join(ARRIVALS).join(format!("{driver}.csv"))
}

fn graph_file(folder: &Path) -> PathBuf {
    folder.join(ARRIVALS).join("graph.txt")
}

/// Keeps what a run's graph is known by.
pub(super) fn keep_graph(graph: &Graph, folder: &Path) -> std::io::Result<()> {
    let lines = of_graph(graph)
        .into_iter()
        .map(|(name, fingerprint)| format!("{fingerprint:016x} {name}\n"));
    std::fs::create_dir_all(folder.join(ARRIVALS))?;
    std::fs::write(graph_file(folder), lines.collect::<String>())
}

/// Refuses a graph that is not the one of the run.
pub(super) fn check_graph(graph: &Graph, folder: &Path) -> Result<(), ReplayError> {
    const NAMED: usize = 4;
    let path = graph_file(folder);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(error) => return Err(ReplayError::Read { path, error }),
    };
    let mut then: BTreeMap<&str, &str> = text
        .lines()
        .filter_map(|line| line.split_once(' '))
        .map(|(fingerprint, name)| (name, fingerprint))
        .collect();
    let mut differences = Vec::new();
    for (name, fingerprint) in of_graph(graph) {
        match then.remove(name.as_str()) {
            None => differences.push(format!("`{name}` was not in it")),
            Some(kept) if kept != format!("{fingerprint:016x}") => {
                differences.push(format!("`{name}` is not as it was"));
            }
            Some(_) => {}
        }
    }
    differences.extend(then.into_keys().map(|name| format!("`{name}` is gone")));
    if differences.is_empty() {
        return Ok(());
    }
    let more = differences.len().saturating_sub(NAMED);
    differences.truncate(NAMED);
    if more > 0 {
        differences.push(format!("and {more} more"));
    }
    let differences = differences.join(", ");
    Err(ReplayError::Changed { path, differences })
}

fn header(plan: &Plan) -> String {
    let quoted = |text: String| match text.contains([',', '"']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text,
    };
    let reads = plan
        .ring_reads
        .iter()
        .map(|ring| format!("arrived {}", ring.name));
    let writes = plan.ring_writes.iter().map(|ring| format!("sent {}", ring.name));
    let names = [format!("{} frames", plan.driver_name()), "fade".to_owned()];
    let cells = names.into_iter().chain(reads).chain(writes).map(quoted);
    cells.collect::<Vec<_>>().join(",")
}

fn columns(plan: &Plan) -> usize {
    2 + plan.ring_reads.len() + plan.ring_writes.len()
}

/// The real-time end of a driver's file.
pub(super) struct ArrivalLog {
    ring: Producer<f64>,
    row: Vec<f64>,
    /// Of each ring that is read: frames that had arrived by the line before.
    before: Vec<u64>,
    /// Rows that found no room; there is none after the first of them.
    lost: u64,
}

impl ArrivalLog {
    pub(super) fn new(plan: &Plan) -> (Self, Consumer<f64>) {
        // Whole rows, so that none is torn where the ring ends.
        let (ring, out) = RingBuffer::new(ROWS * columns(plan));
        let log = Self {
            ring,
            row: Vec::with_capacity(columns(plan)),
            before: vec![0; plan.ring_reads.len()],
            lost: 0,
        };
        (log, out)
    }

    /// Notes a callback. Does not allocate: the row has room for all of it.
    pub(super) fn note(&mut self, run: &Run, frames: usize, fading: bool) {
        self.row.clear();
        self.row.extend([frames as f64, f64::from(u8::from(fading))]);
        for (reader, before) in run.state.links.readers.iter().zip(&mut self.before) {
            let arrived = reader.as_ref().map_or(0, |reader| reader.arrived());
            self.row.push((arrived - *before) as f64);
            *before = arrived;
        }
        for writer in &run.state.links.writers {
            self.row
                .push(writer.as_ref().map_or(0.0, |writer| writer.accepted() as f64));
        }
        if self.lost > 0 || self.ring.push_entire_slice(&self.row).is_err() {
            self.lost += 1;
        }
    }

    /// Callbacks that are missing at the end.
    pub(super) fn lost(&self) -> u64 {
        self.lost
    }
}

/// Writes a driver's file, on the thread that writes files.
pub(super) struct ArrivalWriter {
    file: BufWriter<File>,
    columns: usize,
}

impl ArrivalWriter {
    pub(super) fn create(path: &Path, plan: &Plan) -> std::io::Result<Self> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let mut file = BufWriter::new(File::create(path)?);
        writeln!(file, "{}", header(plan))?;
        let columns = columns(plan);
        Ok(Self { file, columns })
    }
}

impl FrameWriter for ArrivalWriter {
    fn write(&mut self, _: usize, rows: &[f64]) -> std::io::Result<()> {
        for row in rows.chunks(self.columns) {
            for (place, number) in row.iter().enumerate() {
                let comma = if place > 0 { "," } else { "" };
                write!(self.file, "{comma}{number}")?;
            }
            writeln!(self.file)?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> std::io::Result<()> {
        self.file.flush()
    }
}

/// What a driver saw, as read from its file.
pub(super) struct Arrivals {
    path: PathBuf,
    numbers: Vec<u32>,
    columns: usize,
    done: usize,
    /// Of each ring that is read: frames that had arrived by the line done last.
    arrived: Vec<u64>,
    fading: bool,
}

impl Arrivals {
    pub(super) fn load(folder: &Path, driver: usize, plan: &Plan) -> Result<Self, ReplayError> {
        let path = file(folder, driver);
        let read = |error| ReplayError::Read {
            path: path.clone(),
            error,
        };
        let mut lines = BufReader::new(File::open(&path).map_err(read)?).lines();
        let found = lines.next().transpose().map_err(read)?.unwrap_or_default();
        let (wanted, columns) = (header(plan), columns(plan));
        if found != wanted {
            return Err(ReplayError::OtherGraph { path, found, wanted });
        }
        let mut numbers = Vec::new();
        for (place, line) in lines.enumerate() {
            let text = line.map_err(read)?;
            let before = numbers.len();
            for number in text.split(',') {
                // Nothing is too large: a line with something that is no number is refused as a whole.
                numbers.extend(number.parse::<u32>());
            }
            if numbers.len() != before + columns || text.split(',').count() != columns {
                let line = place + 2;
                return Err(ReplayError::Line { path, line, columns });
            }
        }
        Ok(Self {
            path,
            numbers,
            columns,
            done: 0,
            arrived: vec![0; plan.ring_reads.len()],
            fading: false,
        })
    }

    pub(super) fn is_over(&self) -> bool {
        self.done * self.columns == self.numbers.len()
    }

    /// Runs the next callback, if everything that it saw has been sent by now and what it sent finds room.
    fn run_next<E>(&mut self, run: &mut Run, mut each: impl FnMut(&Run) -> Result<(), E>) -> Result<bool, E> {
        let Some(row) = self.numbers[self.done * self.columns..].get(..self.columns) else {
            return Ok(false);
        };
        let (arrived, sent) = row[2..].split_at(self.arrived.len());
        let links = &mut run.state.links;
        let seen = self
            .arrived
            .iter()
            .zip(arrived)
            .map(|(before, more)| before + u64::from(*more));
        let sees = links.readers.iter().zip(seen).all(|(reader, seen)| {
            let there = |reader: &super::LinkReader| reader.arrivals() >= seen;
            reader.as_ref().is_none_or(there)
        });
        let fits = links.writers.iter().zip(sent).all(|(writer, sent)| {
            let room = |writer: &super::LinkWriter| writer.free() >= u64::from(*sent);
            writer.as_ref().is_none_or(room)
        });
        if !(sees && fits) {
            return Ok(false);
        }
        for (reader, (before, more)) in links.readers.iter_mut().zip(self.arrived.iter_mut().zip(arrived)) {
            *before += u64::from(*more);
            if let Some(reader) = reader {
                reader.look(*before);
            }
        }
        for (writer, sent) in links.writers.iter_mut().zip(sent) {
            if let Some(writer) = writer {
                writer.look_as(u64::from(*sent));
            }
        }
        if row[1] != 0 && !std::mem::replace(&mut self.fading, true) {
            run.fade_out(FADE_S);
        }
        let mut left = row[0] as usize;
        while left > 0 {
            let block = left.min(run.plan.block);
            run.advance(block);
            each(run)?;
            left -= block;
        }
        self.done += 1;
        Ok(true)
    }
}

impl Fleet {
    /// Repeats the callbacks of a live run, each driver's in their order. `each` sees every block of every driver;
    /// `goes_on` is asked now and then.
    pub(super) fn replay<E: From<ReplayError>>(
        &mut self,
        scripts: &mut [Arrivals],
        goes_on: impl Fn() -> bool,
        mut each: impl FnMut(usize, &Run) -> Result<(), E>,
    ) -> Result<(), E> {
        while goes_on() {
            let mut moved = false;
            for (driver, (script, run)) in scripts.iter_mut().zip(self.runs_mut()).enumerate() {
                // As far as the others let it: a ring holds little.
                while script.run_next(run, |run| each(driver, run))? {
                    moved = true;
                }
            }
            if scripts.iter().all(Arrivals::is_over) {
                return Ok(());
            }
            if let (false, Some(stuck)) = (moved, scripts.iter().find(|script| !script.is_over())) {
                let (path, line) = (stuck.path.clone(), stuck.done + 2);
                return Err(ReplayError::Contradiction { path, line }.into());
            }
        }
        Ok(())
    }
}
