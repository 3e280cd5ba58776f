//! A whole run as fast as the processor allows, its signals kept in memory.

use crate::errors::Failure;
use crate::work::Progress;
use haptograph::engine::frame::Kind;
use haptograph::engine::graph::Graph;
use haptograph::engine::host::{AnyInput, AnyOutput, Full, PlayOptions, Player};
use haptograph::engine::node::{FrameWriter, Stream};
use haptograph::engine::run::{FileSinks, Offline, Outcome, Probe};
use haptograph::report::record::{watch, watched};
use haptograph::signal::quantity::Quantity;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Numbers that the signals of a run may have together: 8 GB.
const MOST_NUMBERS: f64 = 1e9;
/// How much of a fed run is processed between two looks at its queues, s; they hold a second.
const PART_S: f64 = 0.25;
/// How long a run takes that nothing else ends, s.
const USUAL_S: f64 = 10.0;

/// Name, components, unit.
pub type Channel = (String, usize, String);

/// A channel as Python sees it.
pub fn channel((name, channel): (String, haptograph::engine::device::Channel)) -> Channel {
    (name, channel.kind.width(), channel.quantity.unit())
}

/// What a channel is fed with.
pub struct Feed {
    pub name: String,
    lanes: Vec<f64>,
    width: usize,
    /// One frame, again and again.
    constant: bool,
}

/// What is wanted of a run.
pub struct Wanted {
    pub seconds: Option<f64>,
    pub probes: Option<Vec<String>>,
    pub folder: Option<PathBuf>,
    pub threads: usize,
}

/// What came of it.
pub struct Done {
    pub signals: Vec<Signal>,
    pub outcome: Outcome,
}

/// A signal that was kept.
pub struct Signal {
    name: String,
    kind: Kind,
    quantity: Quantity,
    rate_hz: f64,
    simulated: bool,
    frames: Vec<f64>,
}

impl Feed {
    pub fn of((name, frames, constant): &(String, PyReadonlyArray2<'_, f64>, bool)) -> Self {
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

    pub fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let width = self.kind.width();
        let frames = self.frames.len() / width;
        let shown = PyDict::new(py);
        shown.set_item("name", self.name)?;
        shown.set_item("kind", self.kind.to_string())?;
        shown.set_item("components", self.kind.component_names())?;
        shown.set_item("quantity", self.quantity.name())?;
        shown.set_item("unit", self.quantity.unit())?;
        shown.set_item("rate", self.rate_hz)?;
        shown.set_item("simulated", self.simulated)?;
        let values = PyArray1::from_vec(py, self.frames);
        match width {
            1 => shown.set_item("values", values)?,
            _ => shown.set_item("values", values.reshape([frames, width])?)?,
        }
        Ok(shown)
    }
}

/// What can be told of a run.
pub trait Told {
    fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>>;
}

impl Told for Outcome {
    fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let told = PyDict::new(py);
        told.set_item("frames", self.driver_frames)?;
        told.set_item("seconds", self.seconds)?;
        told.set_item("not_finite_ticks", self.faults.ticks)?;
        told.set_item("not_finite_node", self.faults.origin.as_deref())?;
        let limited = PyDict::new(py);
        for actuator in &self.actuators {
            let clipped = &actuator.clipped;
            let counts = PyDict::new(py);
            counts.set_item("ticks", clipped.ticks)?;
            counts.set_item("peak", clipped.peak)?;
            counts.set_item("continuous", clipped.continuous)?;
            counts.set_item("slew", clipped.slew)?;
            counts.set_item("not_finite", clipped.fault)?;
            limited.set_item(&actuator.path, counts)?;
        }
        told.set_item("limited", limited)?;
        Ok(told)
    }
}

/// Where frames go.
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

/// Runs a graph; its endpoints are fed where `feeds` say so.
pub fn run(graph: &Graph, feeds: &[Feed], wanted: &Wanted, progress: &Progress) -> Result<Done, Failure> {
    if let Some(folder) = &wanted.folder {
        claim(graph, folder)?;
    }
    match feeds.is_empty() {
        true => alone(graph, wanted, progress),
        false => fed(graph, feeds, wanted, progress),
    }
}

/// Makes the folder, in which nothing is replaced.
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
    match all <= MOST_NUMBERS {
        true => Ok(()),
        false => Err(Failure::Message(format!(
            "{} signals of {seconds} s are {:.1} GB: probe fewer, or run in parts with a player",
            probes.len(),
            all * 8e-9
        ))),
    }
}

/// As the command does it.
fn alone(graph: &Graph, wanted: &Wanted, progress: &Progress) -> Result<Done, Failure> {
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
    let outcome = Offline::new(outlets, 0)
        .threads(wanted.threads)
        .run(seconds, &progress.stop, &mut |done_s| {
            progress.at(done_s / seconds)
        })
        .map_err(Failure::of)?;
    let signals = probes.iter().zip(kept).map(|((name, stream), frames)| {
        let mut signal = Signal::of(stream, name);
        signal.frames = std::mem::take(&mut frames.lock().unwrap_or_else(PoisonError::into_inner));
        signal
    });
    Ok(Done {
        signals: signals.collect(),
        outcome,
    })
}

/// An input and what it is fed with.
struct Fed<'a> {
    input: AnyInput,
    feed: &'a Feed,
    given: usize,
}

impl<'a> Fed<'a> {
    fn of(graph: &Graph, feed: &'a Feed) -> Result<Self, Failure> {
        let input = graph.any_input(&feed.name).map_err(Failure::of)?;
        let width = input.kind().width();
        if feed.width != width {
            return Err(Failure::Message(format!(
                "a frame of `{}` has {width} components, not {}",
                feed.name, feed.width
            )));
        }
        let given = 0;
        Ok(Self { input, feed, given })
    }

    /// Fills the queue to twice a part.
    fn fill(&mut self) -> Result<(), Failure> {
        let wanted = (2.0 * PART_S * self.input.rate().hz()).ceil() as usize + 1;
        while self.input.waiting() < wanted {
            let Some(frame) = self.feed.frame(self.given) else {
                return Ok(());
            };
            match self.input.push(frame) {
                Ok(()) => self.given += 1,
                Err(Full::Full) => return Ok(()),
                Err(error) => {
                    let (name, number) = (&self.feed.name, self.given);
                    return Err(Failure::Message(format!("frame {number} of `{name}`: {error}")));
                }
            }
        }
        Ok(())
    }

    /// How long it has something, s.
    fn seconds(&self) -> f64 {
        match self.feed.constant {
            true => f64::INFINITY,
            false => self.feed.frames() as f64 / self.input.rate().hz(),
        }
    }
}

/// Every channel of an endpoint that is fed has to be.
fn all_fed(graph: &Graph, feeds: &[Feed]) -> Result<(), Failure> {
    let is_fed = |name: &str| {
        let endpoint = name.split('.').next();
        feeds
            .iter()
            .any(|feed| feed.name == name || Some(feed.name.as_str()) == endpoint)
    };
    let missing: Vec<String> = graph
        .host_inputs()
        .map(|(name, _)| name)
        .filter(|name| !is_fed(name))
        .collect();
    match missing.is_empty() {
        true => Ok(()),
        false => Err(Failure::Message(format!(
            "give `{}` as well: who feeds an endpoint feeds all of its channels",
            missing.join("`, `")
        ))),
    }
}

/// How long there is something to feed, s.
fn lasting(fed: &[Fed<'_>], wanted: &Wanted) -> Result<f64, Failure> {
    let shortest = fed.iter().min_by(|a, b| a.seconds().total_cmp(&b.seconds()));
    let Some(shortest) = shortest.filter(|fed| fed.seconds().is_finite()) else {
        return seconds(wanted, None);
    };
    let seconds = seconds(wanted, Some(shortest.seconds()))?;
    if seconds > shortest.seconds() * (1.0 + 1e-9) {
        return Err(Failure::Message(format!(
            "`{}` has {} frames at {} Hz, {} s, for a run of {seconds} s",
            shortest.feed.name,
            shortest.feed.frames(),
            shortest.input.rate().hz(),
            shortest.seconds()
        )));
    }
    Ok(seconds)
}

/// With the caller's arrays.
fn fed(graph: &Graph, feeds: &[Feed], wanted: &Wanted, progress: &Progress) -> Result<Done, Failure> {
    let mut fed = feeds
        .iter()
        .map(|feed| Fed::of(graph, feed))
        .collect::<Result<Vec<_>, _>>()?;
    all_fed(graph, feeds)?;
    let seconds = lasting(&fed, wanted)?;
    let probes = probes(graph, wanted, false)?;
    fits(&probes, seconds)?;
    let mut options = PlayOptions::default().rested();
    options.probes = probes.iter().map(|(name, _)| name.clone()).collect();
    options.folder.clone_from(&wanted.folder);
    let (mut player, session) = Player::open(graph, &options).map_err(Failure::of)?;
    let mut kept: Vec<(AnyOutput, Signal)> = Vec::new();
    for (name, stream) in &probes {
        let output = player.any_probe(name).map_err(Failure::of)?;
        kept.push((output, Signal::of(stream, name)));
    }
    let driver = graph.drivers().first().copied().unwrap_or_default();
    let rate_hz = graph.clocks()[driver].rate.hz();
    let total = (seconds * rate_hz).round() as u64;
    let part = ((PART_S * rate_hz) as u64).max(1);
    while player.frames() < total && !progress.stop.load(std::sync::atomic::Ordering::Relaxed) {
        fed.iter_mut().try_for_each(Fed::fill)?;
        player.process(part.min(total - player.frames()) as usize);
        kept.iter_mut()
            .for_each(|(output, signal)| drain(output, &mut signal.frames));
        progress.at(player.frames() as f64 / total as f64);
    }
    let done = player.finish(session);
    if let Some(failed) = done.failed.first() {
        return Err(Failure::of(failed));
    }
    Ok(Done {
        signals: kept.into_iter().map(|(_, signal)| signal).collect(),
        outcome: done.outcome,
    })
}

/// Takes all frames that wait.
pub fn drain(output: &mut AnyOutput, frames: &mut Vec<f64>) {
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
