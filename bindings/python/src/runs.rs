//! A whole run as fast as the processor allows, its signals kept in memory.

mod fed;

use crate::errors::Failure;
use crate::prototypes::Scripts;
use crate::work::Progress;
use haptograph::engine::frame::Kind;
use haptograph::engine::graph::Graph;
use haptograph::engine::host::AnyOutput;
use haptograph::engine::limiter::ClipCounts;
use haptograph::engine::node::{FrameWriter, Stream};
use haptograph::engine::run::{FileSinks, Outcome, Probe, Session, SessionOptions};
use haptograph::report::record::{watch, watched};
use haptograph::signal::quantity::Quantity;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};

/// Numbers that the signals of a run may have together: 8 GB.
const MAX_NUMBERS: f64 = 1e9;
/// Duration of a run that nothing else ends, s.
const USUAL_S: f64 = 10.0;

/// Name, components, unit.
pub(crate) type Channel = (String, usize, String);

/// A channel as a Python tuple.
pub(crate) fn channel((name, channel): (String, haptograph::engine::device::Channel)) -> Channel {
    (name, channel.kind.width(), channel.quantity.unit())
}

/// The frames for a channel.
pub(crate) struct Feed {
    pub name: String,
    lanes: Vec<f64>,
    width: usize,
    /// True if the one frame is repeated.
    constant: bool,
}

/// Options of a run.
pub(crate) struct Wanted {
    pub seconds: Option<f64>,
    pub probes: Option<Vec<String>>,
    pub folder: Option<PathBuf>,
}

/// The result of a run.
pub(crate) struct Done {
    pub signals: Vec<Signal>,
    pub outcome: Outcome,
}

/// A signal that was kept.
pub(crate) struct Signal {
    name: String,
    kind: Kind,
    quantity: Quantity,
    rate_hz: f64,
    simulated: bool,
    frames: Vec<f64>,
}

impl Feed {
    pub(crate) fn of((name, frames, constant): &(String, PyReadonlyArray2<'_, f64>, bool)) -> Self {
        let frames = frames.as_array();
        Self {
            name: name.clone(),
            lanes: frames.iter().copied().collect(),
            width: frames.ncols(),
            constant: *constant,
        }
    }

    fn frames(&self) -> usize {
        self.lanes.len() / self.width.max(1)
    }

    fn frame(&self, number: usize) -> Option<&[f64]> {
        let number = if self.constant { 0 } else { number };
        self.lanes.get(number * self.width..(number + 1) * self.width)
    }
}

impl Signal {
    fn of(stream: &Stream, name: &str) -> Self {
        Self {
            name: name.to_owned(),
            kind: stream.kind,
            quantity: stream.quantity,
            rate_hz: stream.rate.hz(),
            simulated: stream.simulated,
            frames: Vec::new(),
        }
    }

    pub(crate) fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let width = self.kind.width();
        let frames = self.frames.len() / width;
        let (kind, quantity) = (self.kind, self.quantity);
        let shown = dict!(py; name: self.name, kind: kind.to_string(), components: kind.spec().components,
            quantity: quantity.name(), unit: quantity.unit(), rate: self.rate_hz, simulated: self.simulated);
        let values = PyArray1::from_vec(py, self.frames);
        match width {
            1 => shown.set_item("values", values)?,
            _ => shown.set_item("values", values.reshape([frames, width])?)?,
        }
        Ok(shown)
    }
}

/// Conversion of an outcome to Python.
pub(crate) trait Told {
    fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>>;
}

impl Told for Outcome {
    fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let limited = PyDict::new(py);
        for actuator in &self.actuators {
            let ClipCounts { ticks, peak, continuous, slew, fault, .. } = actuator.clipped;
            let counts =
                dict!(py; ticks: ticks, peak: peak, continuous: continuous, slew: slew, not_finite: fault);
            limited.set_item(&actuator.path, counts)?;
        }
        let (ticks, node) = (self.faults.ticks, self.faults.origin.as_deref());
        Ok(
            dict!(py; frames: self.driver_frames, seconds: self.seconds, not_finite_ticks: ticks, not_finite_node: node,
            limited: limited),
        )
    }
}

/// Writer that keeps frames in memory.
struct Kept(Arc<Mutex<Vec<f64>>>);

impl FrameWriter for Kept {
    fn write(&mut self, _: usize, frames: &[f64]) -> std::io::Result<()> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.try_reserve(frames.len()).map_err(std::io::Error::other)?;
        kept.extend_from_slice(frames);
        Ok(())
    }

    fn finish(self: Box<Self>) -> std::io::Result<()> {
        Ok(())
    }
}

/// Runs a graph; `feeds` feed its endpoints.
pub(crate) fn run(
    (graph, scripts): (&Graph, &Scripts),
    feeds: &[Feed],
    wanted: &Wanted,
    progress: &Progress,
) -> Result<Done, Failure> {
    if let Some(folder) = &wanted.folder {
        claim(graph, folder)?;
    }
    let goes_on = || !progress.stop.load(Ordering::Relaxed) && !scripts.have_failed();
    let done = match feeds.is_empty() {
        true => alone(graph, wanted, progress, &goes_on),
        false => fed::fed(graph, feeds, wanted, progress, &goes_on),
    };
    match scripts.failure(graph) {
        Some(failure) => Err(failure),
        None => done,
    }
}

/// Creates the folder, and refuses to replace files in it.
fn claim(graph: &Graph, folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::Message(format!("cannot make {}: {error}", folder.display())))?;
    for (_, file) in graph.written_files() {
        let path = folder.join(file);
        if path.symlink_metadata().is_ok() {
            return Err(Failure::Message(format!(
                "{} is there already: give another folder",
                path.display()
            )));
        }
    }
    Ok(())
}

/// The outputs that are kept: their names as given, or those that the page of a run shows.
fn probes(graph: &Graph, wanted: &Wanted, any: bool) -> Result<Vec<(String, Stream)>, Failure> {
    let stream = |name: &String| {
        let (node, output) = graph.find_output(name).map_err(Failure::of)?;
        let watch = watch(graph, node, output)
            .ok_or_else(|| Failure::Message(format!("`{name}` has no clock, and so no signal")))?;
        Ok((name.clone(), watch.stream))
    };
    match &wanted.probes {
        Some(names) => names.iter().map(stream).collect(),
        None => Ok(watched(graph)
            .into_iter()
            .filter(|watch| any || watch.stream.kind.is_linear())
            .map(|watch| (watch.stream.name.clone(), watch.stream))
            .collect()),
    }
}

fn seconds(wanted: &Wanted, longest: Option<f64>) -> Result<f64, Failure> {
    let seconds = wanted.seconds.or(longest).unwrap_or(USUAL_S);
    match seconds.is_finite() && seconds > 0.0 && seconds <= 1e7 {
        true => Ok(seconds),
        false => Err(Failure::Message(format!(
            "a run of {seconds} s: give a number of seconds above 0, at most 10000000"
        ))),
    }
}

fn fits(probes: &[(String, Stream)], seconds: f64) -> Result<(), Failure> {
    let numbers = |(_, stream): &(String, Stream)| stream.rate.hz() * stream.kind.width() as f64 * seconds;
    let all: f64 = probes.iter().map(numbers).sum();
    match all <= MAX_NUMBERS {
        true => Ok(()),
        false => Err(Failure::Message(format!(
            "{} signals of {seconds} s are {:.1} GB: probe fewer, or run in parts with a player",
            probes.len(),
            all * 8e-9
        ))),
    }
}

/// Runs a graph like the command, without feeds.
fn alone(
    graph: &Graph,
    wanted: &Wanted,
    progress: &Progress,
    goes_on: &dyn Fn() -> bool,
) -> Result<Done, Failure> {
    let seconds = seconds(wanted, None)?;
    let probes = probes(graph, wanted, true)?;
    fits(&probes, seconds)?;
    let mut outlets = FileSinks::new(graph);
    if let Some(folder) = &wanted.folder {
        outlets.open_files(folder).map_err(Failure::of)?;
    }
    let mut kept = Vec::new();
    for (name, _) in &probes {
        let (node, output) = graph.find_output(name).map_err(Failure::of)?;
        let frames = Arc::default();
        let writer = Box::new(Kept(Arc::clone(&frames)));
        outlets.probe(Probe { node, output, writer });
        kept.push(frames);
    }
    let mut options = SessionOptions::default().seconds(seconds);
    options.stop = Arc::clone(&progress.stop);
    let outcome = Session::run_offline(outlets, &options, &mut |done_s| {
        progress.at(done_s / seconds);
        progress.stop.fetch_or(!goes_on(), Ordering::Relaxed);
    });
    let outcome = outcome.map_err(Failure::of)?;
    let signals = probes.iter().zip(kept).map(|((name, stream), frames)| {
        let mut signal = Signal::of(stream, name);
        signal.frames = std::mem::take(&mut frames.lock().unwrap_or_else(PoisonError::into_inner));
        signal
    });
    Ok(Done { signals: signals.collect(), outcome })
}

/// Takes all waiting frames.
pub(crate) fn drain(output: &mut AnyOutput, frames: &mut Vec<f64>) {
    let width = output.kind().width();
    loop {
        let end = frames.len();
        frames.resize(end + width, 0.0);
        if !output.take(&mut frames[end..]) {
            frames.truncate(end);
            return;
        }
    }
}
