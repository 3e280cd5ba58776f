//! Writing the replay log: callbacks push rows without waiting, the writer thread writes them.

use super::super::Run;
use super::super::ramp::ParamRamp;
use super::InputLog;
use super::{FADING, REPLACED, RESUMED, RUNNING, SETTINGS_HEADER, cell, columns, gated, header};
use crate::io::touched_ring;
use crate::node::FrameWriter;
use crate::plan::Plan;
use rtrb::{Consumer, Producer};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Capacity of the ring to each file, in rows.
const ROWS: usize = 8192;
/// Numbers of a change of a setting.
const SETTING: usize = 5;

/// The real-time end of a driver's files.
pub(in super::super) struct ArrivalLog {
    callbacks: Producer<f64>,
    settings: Producer<f64>,
    row: Vec<f64>,
    columns: usize,
    /// Frames arrived by the line before, for each ring that is read.
    before: Vec<u64>,
    /// Number of callbacks lost, from the first row that did not fit.
    lost: u64,
    /// True if another graph took over; the log ends there.
    is_over: bool,
}

/// The read ends, for the writers of both files.
pub(in super::super) struct Kept {
    pub callbacks: Consumer<f64>,
    pub settings: Consumer<f64>,
}

impl ArrivalLog {
    pub(crate) fn new(plan: &Plan) -> (Self, Kept) {
        // A multiple of the row size: a row never wraps around.
        let (callbacks, far_callbacks) = touched_ring(ROWS * columns(plan));
        let (settings, far_settings) = touched_ring(ROWS * SETTING);
        let log = Self {
            callbacks,
            settings,
            row: Vec::with_capacity(columns(plan)),
            columns: columns(plan),
            before: vec![0; plan.ring_reads.len()],
            lost: 0,
            is_over: false,
        };
        let kept = Kept { callbacks: far_callbacks, settings: far_settings };
        (log, kept)
    }

    /// Logs a callback. Does not allocate: the row has the capacity of a callback.
    pub(crate) fn note(&mut self, run: &Run, frames: usize, is_fading: bool) {
        if self.is_over {
            return;
        }
        self.row.clear();
        let state = if is_fading { FADING } else { RUNNING };
        self.row.extend([frames as f64, state]);
        let gates = gated(&run.plan).map(|place| run.state.actuators[place].gate.is_open());
        self.row.extend(gates.map(|is_open| f64::from(u8::from(is_open))));
        let mut inputs = run.state.devices.iter().filter_map(|device| device.log.as_ref());
        if inputs.any(InputLog::is_torn) {
            // The log is invalid from there on.
            self.lost += 1;
        }
        for (reader, before) in run.state.ring_ends.readers.iter().zip(&mut self.before) {
            let arrived = reader.as_ref().map_or(0, |reader| reader.arrived());
            self.row.push((arrived - *before) as f64);
            *before = arrived;
        }
        for writer in &run.state.ring_ends.writers {
            self.row.push(writer.as_ref().map_or(0.0, |writer| writer.accepted() as f64));
        }
        self.keep_row();
    }

    /// Logs a ramp of a setting that starts before frame `frame`.
    pub(crate) fn set(&mut self, frame: u64, ramp: &ParamRamp) {
        let ParamRamp { place, from, to, frames, .. } = *ramp;
        let row: [f64; SETTING] = [frame as f64, from, to, frames as f64, place as f64];
        if !self.is_over && self.settings.push_entire_slice(&row).is_err() {
            // The log is invalid from there on.
            self.lost += 1;
        }
    }

    /// Logs a change of graph, which ends the log.
    pub(crate) fn end(&mut self) {
        self.keep_event(REPLACED, 0);
        self.is_over = true;
    }

    /// Logs that outputs begin from zero again, before the next callback: those of all devices (0), or of one, counted from 1.
    pub(crate) fn resume(&mut self, device: usize) {
        self.keep_event(RESUMED, device);
    }

    fn keep_event(&mut self, state: f64, device: usize) {
        if !self.is_over {
            self.row.clear();
            self.row.resize(self.columns, 0.0);
            (self.row[0], self.row[1]) = (device as f64, state);
            self.keep_row();
        }
    }

    fn keep_row(&mut self) {
        if self.lost > 0 || self.callbacks.push_entire_slice(&self.row).is_err() {
            self.lost += 1;
        }
    }

    /// Number of callbacks missing at the end.
    pub(crate) fn lost(&self) -> u64 {
        self.lost
    }
}

/// Writes a file of the log in an existing folder, row by row.
pub(in super::super) struct LogWriter {
    file: BufWriter<File>,
    columns: usize,
    /// The names that the last number of a row selects; empty if it is a number like the others.
    names: Vec<String>,
}

impl LogWriter {
    /// A file of rows of numbers.
    pub(crate) fn create(path: &Path, header: &str, columns: usize) -> std::io::Result<Self> {
        let mut file = BufWriter::new(File::create(path)?);
        writeln!(file, "{header}")?;
        Ok(Self { file, columns, names: Vec::new() })
    }

    /// The file of a driver's callbacks.
    pub(crate) fn callbacks(path: &Path, plan: &Plan) -> std::io::Result<Self> {
        Self::create(path, &header(plan), columns(plan))
    }

    /// The file of a driver's setting changes, with the names of the settings.
    pub(crate) fn settings(path: &Path, plan: &Plan) -> std::io::Result<Self> {
        let names = plan.live.iter().map(cell).collect();
        Ok(Self { names, ..Self::create(path, SETTINGS_HEADER, SETTING)? })
    }

    /// Writes a line of numbers with enough digits to restore their bits.
    fn write_row(&mut self, row: &[f64]) -> std::io::Result<()> {
        for (place, number) in row.iter().enumerate() {
            let comma = if place > 0 { "," } else { "" };
            match self.names.get(*number as usize).filter(|_| place + 1 == self.columns) {
                Some(name) => write!(self.file, "{comma}{name}")?,
                None => write!(self.file, "{comma}{number}")?,
            }
        }
        writeln!(self.file)
    }
}

impl FrameWriter for LogWriter {
    fn write(&mut self, _: usize, rows: &[f64]) -> std::io::Result<()> {
        rows.chunks(self.columns).try_for_each(|row| self.write_row(row))
    }

    fn finish(mut self: Box<Self>) -> std::io::Result<()> {
        self.file.flush()
    }
}
