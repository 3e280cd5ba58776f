//! Logs of live inputs, tick by tick, and their replay.
//!
//! Each device has a file with a line for each tick at which a value changes:
//!
//! ```text
//! tick,stylus.position 1,stylus.position 2,stylus.position 3,stylus.force 1
//! 0,0,0,0,0
//! 412,0.03,0.01,0,1.25
//! ```
//!
//! Values are in SI units, with enough digits to restore their bits.

use super::rows::Lines;
use super::{LogWriter, ReplayBounds, ReplayError, input_file, quoted};
use crate::frame::Kind;
use crate::io::touched_ring;
use crate::plan::{DevicePlan, Plan};
use haptograph_signal::quantity::Quantity;
use rtrb::{Consumer, Producer};
use std::path::{Path, PathBuf};

/// Capacity of the ring to the writer thread, s.
const RING_S: f64 = 1.0;
const LEAST_ROWS: usize = 1024;

/// A live input that a driver reads.
pub(in super::super) struct Input {
    /// Index of the device in the plan.
    pub place: usize,
    /// Rate of its ticks, Hz.
    pub rate_hz: f64,
    /// Name and largest plausible magnitude of each component that a tick reads.
    columns: Vec<(String, f64)>,
}

impl Input {
    /// The live inputs that the driver of a plan reads.
    pub(crate) fn all(plan: &Plan) -> Vec<Self> {
        let devices = plan.devices.iter().enumerate();
        let inputs = devices.filter(|(_, device)| device.input.is_some() && !device.reads.is_empty());
        inputs
            .map(|(place, device)| Self {
                place,
                rate_hz: plan.rates[device.clock].hz(),
                columns: columns(device),
            })
            .collect()
    }

    /// The writer of its file in an existing folder.
    pub(crate) fn writer(&self, path: &Path) -> std::io::Result<LogWriter> {
        LogWriter::create(path, &self.header(), 1 + self.columns.len())
    }

    fn header(&self) -> String {
        let names = self.columns.iter().map(|(name, _)| quoted(name.clone()));
        let cells: Vec<String> = std::iter::once("tick".to_owned()).chain(names).collect();
        cells.join(",")
    }
}

fn columns(device: &DevicePlan) -> Vec<(String, f64)> {
    let mut columns = Vec::new();
    for (place, channel) in &device.reads {
        let channel = device.senses.get(*channel);
        let (name, quantity) = channel.map_or(("", Quantity::NUMBER), |one| (one.name, one.quantity));
        for component in 1..=place.width {
            let number = match channel.is_some_and(|one| one.kind == Kind::SCALAR) {
                true => String::new(),
                false => format!(" {component}"),
            };
            columns.push((format!("{}.{name}{number}", device.name), plausible(quantity)));
        }
    }
    columns
}

/// Largest plausible magnitude of a sensed quantity, SI. Packets and full scales of soundcards are bounded by 1e6,
/// which filters overshoot.
fn plausible(quantity: Quantity) -> f64 {
    match quantity {
        Quantity::LENGTH | Quantity::ANGLE | Quantity::TORQUE => 1e6,
        _ => 1e7,
    }
}

/// The real-time end of an input's file.
pub(in super::super) struct InputLog {
    out: Producer<f64>,
    row: Vec<f64>,
    last: Vec<f64>,
    ticks: u64,
    is_torn: bool,
}

impl InputLog {
    /// Makes the log and the read end for its writer.
    pub(crate) fn new(input: &Input) -> (Self, Consumer<f64>) {
        let width = 1 + input.columns.len();
        // A multiple of the row size: a row never wraps around.
        let rows = LEAST_ROWS.max((RING_S * input.rate_hz).ceil() as usize);
        let (out, far) = touched_ring(rows * width);
        let log = Self {
            out,
            row: Vec::with_capacity(width),
            last: Vec::with_capacity(width),
            ticks: 0,
            is_torn: false,
        };
        (log, far)
    }

    /// Logs the next read of this tick. Does not allocate: the row has the capacity of a tick.
    pub(crate) fn note(&mut self, components: &[f64]) {
        if self.row.is_empty() {
            self.row.push(self.ticks as f64);
        }
        if self.row.len() + components.len() <= self.row.capacity() {
            self.row.extend_from_slice(components);
        }
    }

    /// Ends a tick; pushes the row if it differs from the last one.
    pub(crate) fn end_tick(&mut self) {
        self.ticks += 1;
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        let is_changed =
            self.last.len() != self.row.len() || !self.row.iter().zip(&self.last).skip(1).all(same);
        if is_changed && !self.is_torn {
            self.is_torn = self.out.push_entire_slice(&self.row).is_err();
            std::mem::swap(&mut self.row, &mut self.last);
        }
        self.row.clear();
    }

    /// True if a row was lost. The log is invalid from there on.
    pub(crate) fn is_torn(&self) -> bool {
        self.is_torn
    }
}

/// Replay of an input from its file.
pub(in super::super) struct InputScript {
    lines: Lines,
    limits: Vec<f64>,
    most_ticks: f64,
    /// Ticks done.
    ticks: u64,
    /// Present values.
    values: Vec<f64>,
    /// Number of values read in this tick.
    read: usize,
    /// The next line: its tick and its values.
    next: Option<(u64, Vec<f64>)>,
    failed: Option<ReplayError>,
}

impl InputScript {
    pub(crate) fn open(path: PathBuf, input: &Input, bounds: &ReplayBounds) -> Result<Self, ReplayError> {
        let lines = Lines::open(path, &input.header())?;
        let limits: Vec<f64> = input.columns.iter().map(|(_, limit)| *limit).collect();
        let mut script = Self {
            lines,
            values: vec![0.0; limits.len()],
            limits,
            most_ticks: bounds.longest_s * input.rate_hz,
            ticks: 0,
            read: 0,
            next: None,
            failed: None,
        };
        script.next = script.row(None)?;
        Ok(script)
    }

    /// Reads and checks the whole file.
    pub(crate) fn check(mut self, goes_on: &impl Fn() -> bool) -> Result<(), ReplayError> {
        while let Some((tick, _)) = self.next.take()
            && goes_on()
        {
            self.next = self.row(Some(tick))?;
        }
        Ok(())
    }

    /// Reads the next line, whose tick must be after `before`.
    fn row(&mut self, before: Option<u64>) -> Result<Option<(u64, Vec<f64>)>, ReplayError> {
        let Some(text) = self.lines.next()? else {
            return Ok(None);
        };
        let (tick, cells) = text.split_once(',').unwrap_or((&text, ""));
        let values: Vec<f64> = cells.split(',').flat_map(str::parse).collect();
        let tick = tick.parse::<u64>().ok().filter(|_| values.len() == self.limits.len());
        let Some(tick) = tick.filter(|_| cells.split(',').count() == self.limits.len()) else {
            return Err(self.lines.malformed(1 + self.limits.len()));
        };
        if before.is_some_and(|before| tick <= before) {
            return Err(self.lines.implausible("its tick is not after that of the previous line"));
        }
        if tick as f64 > self.most_ticks {
            return Err(self.lines.implausible("its tick is after the end of the run"));
        }
        let mut limits = values.iter().zip(&self.limits);
        let is_beyond = |(value, limit): &(&f64, &f64)| value.is_nan() || value.abs() > **limit;
        if let Some((value, limit)) = limits.find(is_beyond) {
            let why = format!("{value:e} is beyond {limit:e}, the largest value of a device in its SI unit");
            return Err(self.lines.implausible(why));
        }
        Ok(Some((tick, values)))
    }

    /// Advances to the next tick.
    pub(crate) fn advance(&mut self) {
        self.read = 0;
        if let Some((tick, values)) = self.next.take_if(|(tick, _)| *tick == self.ticks) {
            self.values = values;
            match self.row(Some(tick)) {
                Ok(next) => self.next = next,
                Err(error) => self.failed = Some(error),
            }
        }
        self.ticks += 1;
    }

    /// Gives the next values of this tick.
    pub(crate) fn read(&mut self, components: &mut [f64]) {
        if let Some(values) = self.values.get(self.read..self.read + components.len()) {
            components.copy_from_slice(values);
        }
        self.read += components.len();
    }

    /// The error that ended the replay, if any: the file changed after the check.
    pub(crate) fn failure(&mut self) -> Option<ReplayError> {
        self.failed.take()
    }
}

/// The scripts of a driver's inputs, with the index of the device.
pub(in super::super) fn scripts(
    plan: &Plan,
    (folder, driver): (&Path, usize),
    bounds: &ReplayBounds,
) -> Result<Vec<(usize, InputScript)>, ReplayError> {
    let inputs = Input::all(plan).into_iter();
    inputs
        .map(|input| {
            let path = input_file(folder, driver, input.place);
            Ok((input.place, InputScript::open(path, &input, bounds)?))
        })
        .collect()
}
