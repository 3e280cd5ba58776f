//! What a page keeps of a run: which signals of a graph a person wants to see, and as much of each as can be seen.
//! A recording takes the same space for an hour as for ten seconds.

use super::thinning::{Decimated, Envelope};
use haptograph_engine::frame::{Contact, Event, Kind, Weights};
use haptograph_engine::graph::{Graph, Node, NodeId};
use haptograph_engine::node::{FrameWriter, Stream};
use haptograph_nodes::sinks::plots::GROUP as PLOTS;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::spectrum::Spectrogram;
use haptograph_signal::window::Window;
use std::sync::{Arc, Mutex, PoisonError};

/// An output to be recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Watch {
    /// The node.
    pub node: NodeId,
    /// Index among its outputs.
    pub output: usize,
    /// What it carries.
    pub stream: Stream,
}

/// Signals on a page are at most this many.
const MOST_WATCHED: usize = 24;

/// The outputs of a graph that its page shows: what sources sense, what sinks are given, what actuators deliver, and
/// what is rendered from: the place on a texture's map with the force and speed it was found for.
pub fn watched(graph: &Graph) -> Vec<Watch> {
    let nodes = graph.nodes();
    let mut wanted: Vec<(NodeId, usize)> = Vec::new();
    let mut want = |port: (NodeId, usize)| {
        if !wanted.contains(&port) {
            wanted.push(port);
        }
    };
    for index in nodes.ids() {
        let node = &nodes[index];
        if node.device().is_some() {
            (0..node.outputs.len()).for_each(|output| want((index, output)));
        }
        (0..node.outputs.len())
            .filter(|output| is_friction_coefficient(node, *output))
            .for_each(|output| want((index, output)));
        let on_map = node.outputs.iter().any(|output| output.kind == Kind::Weights);
        let shown = |kind: Kind| matches!(kind, Kind::Weights | Kind::Contact);
        for (output, _) in node
            .outputs
            .iter()
            .enumerate()
            .filter(|(_, port)| shown(port.kind))
        {
            want((index, output));
        }
        let kept = node.entry.is_file() && node.entry.spec.group != PLOTS;
        if on_map || kept || node.entry.is_actuator() {
            for read in nodes.incoming(index) {
                want((read.from, read.edge.output));
            }
        }
    }
    wanted.truncate(MOST_WATCHED);
    wanted
        .into_iter()
        .filter_map(|(node, output)| watch(graph, node, output))
        .collect()
}

/// What tells the friction of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Friction {
    /// A signal that is the coefficient.
    Measured(String),
    /// Signals of the tangential and the normal force.
    Forces {
        /// The tangential force.
        tangential: String,
        /// The normal force.
        normal: String,
    },
}

/// What tells the friction of a run: the first port that declares itself a friction coefficient; else the force that ports
/// named `friction` read by the one that ports named `load` read, where there is one of each.
pub fn friction(graph: &Graph) -> Option<Friction> {
    let nodes = graph.nodes();
    let mut outputs = nodes
        .ids()
        .flat_map(|node| (0..nodes[node].outputs.len()).map(move |output| (node, output)));
    let name = |(node, output): (NodeId, usize)| watch(graph, node, output).map(|watch| watch.stream.name);
    if let Some(measured) = outputs.find(|(node, output)| is_friction_coefficient(&nodes[*node], *output)) {
        return name(measured).map(Friction::Measured);
    }
    let read_as = |port: &str| {
        let mut sources: Vec<(NodeId, usize)> = Vec::new();
        for node in nodes.ids() {
            for read in nodes.incoming(node) {
                let input = nodes[node].inputs.get(read.edge.input);
                let source = (read.from, read.edge.output);
                let fits = input.is_some_and(|input| input.name == port && input.quantity == Quantity::FORCE);
                if fits && !sources.contains(&source) {
                    sources.push(source);
                }
            }
        }
        match sources.as_slice() {
            [one] => name(*one),
            _ => None,
        }
    };
    Some(Friction::Forces {
        tangential: read_as("friction")?,
        normal: read_as("load")?,
    })
}

/// Ports say what they are in their description; the quantity is a plain number.
fn is_friction_coefficient(node: &Node, output: usize) -> bool {
    let Some(port) = node.outputs.get(output) else {
        return false;
    };
    let declared = node.entry.spec.outputs.iter().find(|spec| spec.name == port.name);
    port.quantity == Quantity::NUMBER
        && declared.is_some_and(|spec| spec.doc.starts_with("Friction coefficient"))
}

/// An output of a graph as something to be recorded; `None` where there is none, or no clock.
pub fn watch(graph: &Graph, node: NodeId, output: usize) -> Option<Watch> {
    let source = graph.nodes().get(node)?;
    let port = source.outputs.get(output)?;
    let stream = Stream {
        name: format!("{}.{}", source.path, port.name),
        kind: port.kind,
        quantity: port.quantity,
        rate: graph.clocks().get(source.clock?)?.rate,
        simulated: source.simulated,
    };
    Some(Watch { node, output, stream })
}

/// What was kept of one signal.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// What it is.
    pub stream: Stream,
    /// What its kind makes worth keeping.
    pub content: Content,
    /// Frames seen.
    pub frames: u64,
}

/// What is kept of a signal of each kind.
#[derive(Debug, Clone)]
pub enum Content {
    /// Scalars, vectors and wrenches: extremes of each lane; of fast scalars also how their spectrum changes.
    Lanes(Vec<Envelope>, Option<Box<Spectra>>),
    /// Places on a texture's map: (speed in m/s, force in N).
    Map(Decimated<(f64, f64)>),
    /// Contacts: penetration in m, and where the proxy was while touching.
    Contact(Envelope, Decimated<[f64; 3]>),
    /// Events: (time in s, value), and how many there were.
    Events(Decimated<(f64, f64)>, u64),
    /// Kinds that are not shown.
    Nothing,
}

/// Frames on their way into a page.
#[derive(Debug)]
pub struct Recorder {
    shared: Arc<Mutex<Recorded>>,
}

/// Where a [`Recorder`] leaves what it kept.
#[derive(Debug)]
pub struct Record {
    shared: Arc<Mutex<Recorded>>,
}

/// A recorder for a signal, and where its content will be.
pub fn recorder(stream: Stream) -> (Recorder, Record) {
    let recorded = Recorded {
        content: Content::of(&stream),
        stream,
        frames: 0,
    };
    let shared = Arc::new(Mutex::new(recorded));
    (
        Recorder {
            shared: Arc::clone(&shared),
        },
        Record { shared },
    )
}

impl Record {
    /// What was kept so far.
    pub fn content(&self) -> Recorded {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl FrameWriter for Recorder {
    fn write(&mut self, _: usize, frames: &[f64]) -> std::io::Result<()> {
        self.shared
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .extend(frames);
        Ok(())
    }

    fn finish(self: Box<Self>) -> std::io::Result<()> {
        Ok(())
    }
}

/// Points of a path or cloud that are kept at most.
const MOST_POINTS: usize = 3000;
/// Scalars at this rate or above get a spectrogram.
pub(super) const SPECTRAL_RATE_HZ: f64 = 2000.0;

impl Content {
    fn of(stream: &Stream) -> Self {
        let rate_hz = stream.rate.hz();
        match stream.kind {
            Kind::Scalar | Kind::Vector | Kind::Wrench => {
                let vibrates = [
                    Quantity::ACCELERATION,
                    Quantity::FORCE,
                    Quantity::VOLTAGE,
                    Quantity::CURRENT,
                ];
                let spectral = stream.kind == Kind::Scalar
                    && rate_hz >= SPECTRAL_RATE_HZ
                    && vibrates.contains(&stream.quantity);
                let spectra = spectral.then(|| Box::new(Spectra::new(rate_hz)));
                Self::Lanes(vec![Envelope::new(rate_hz); stream.kind.width()], spectra)
            }
            Kind::Weights => Self::Map(Decimated::new(MOST_POINTS)),
            Kind::Contact => Self::Contact(Envelope::new(rate_hz), Decimated::new(MOST_POINTS)),
            Kind::Event => Self::Events(Decimated::new(MOST_POINTS), 0),
            Kind::Coefficients => Self::Nothing,
        }
    }
}

impl Recorded {
    /// Takes the next frames, lane by lane.
    pub fn extend(&mut self, frames: &[f64]) {
        let width = self.stream.kind.width();
        let first = self.frames;
        self.frames += (frames.len() / width) as u64;
        match &mut self.content {
            Content::Lanes(lanes, spectra) => {
                for (lane, envelope) in lanes.iter_mut().enumerate() {
                    envelope.extend(frames.iter().skip(lane).step_by(width).copied());
                }
                if let Some(spectra) = spectra {
                    spectra.extend(frames);
                }
            }
            Content::Map(points) => {
                for weights in frames.as_chunks().0.iter().map(Weights::from_components) {
                    points.push((weights.speed_m_s, weights.force_n));
                }
            }
            Content::Contact(depth, path) => {
                for contact in frames.as_chunks().0.iter().map(Contact::from_components) {
                    depth.extend([contact.penetration_m]);
                    if contact.touching {
                        path.push(contact.ihip_m);
                    }
                }
            }
            Content::Events(points, count) => {
                let period_s = self.stream.rate.period_s();
                let events = frames.as_chunks().0.iter().map(Event::from_components);
                for (i, event) in events.enumerate().filter(|(_, event)| event.fired) {
                    points.push(((first + i as u64) as f64 * period_s, event.value));
                    *count += 1;
                }
            }
            Content::Nothing => {}
        }
    }

    /// Seconds seen.
    pub fn duration_s(&self) -> f64 {
        self.frames as f64 * self.stream.rate.period_s()
    }
}

/// How the spectrum of a signal changes: columns of density, neighbours averaged when there are too many.
#[derive(Debug, Clone)]
pub struct Spectra {
    rate_hz: f64,
    segment: usize,
    /// Samples that no complete segment has used up.
    waiting: Vec<f64>,
    /// Segments averaged in a column.
    every: usize,
    columns: Vec<Vec<f64>>,
    open: Vec<f64>,
    in_open: usize,
}

const MOST_COLUMNS: usize = 720;

impl Spectra {
    fn new(rate_hz: f64) -> Self {
        // About 20 Hz between bins: enough to tell resonances apart, short enough to see strokes.
        let segment = ((rate_hz / 20.0) as usize).next_power_of_two().clamp(64, 8192);
        let (waiting, columns, open) = (Vec::new(), Vec::new(), Vec::new());
        Self {
            rate_hz,
            segment,
            waiting,
            every: 1,
            columns,
            open,
            in_open: 0,
        }
    }

    fn extend(&mut self, samples: &[f64]) {
        // One sample that is no number would blot out a whole segment.
        self.waiting
            .extend(samples.iter().map(|x| if x.is_finite() { *x } else { 0.0 }));
        // Whole batches, so that windows and transforms are prepared once for many segments.
        while self.waiting.len() >= 16 * self.segment {
            self.take(16 * self.segment);
        }
    }

    fn take(&mut self, samples: usize) {
        let half = self.segment / 2;
        let part = &self.waiting[..samples];
        let Ok(rows) = Spectrogram::new(part, self.rate_hz, self.segment, half, Window::Hann) else {
            return;
        };
        for i in 0..rows.time_s.len() {
            self.push(rows.row(i));
        }
        self.waiting.drain(..rows.time_s.len() * half);
    }

    fn push(&mut self, row: &[f64]) {
        self.open.resize(row.len(), 0.0);
        self.open
            .iter_mut()
            .zip(row)
            .for_each(|(sum, value)| *sum += value);
        self.in_open += 1;
        if self.in_open < self.every {
            return;
        }
        let scale = 1.0 / self.every as f64;
        self.columns
            .push(self.open.drain(..).map(|sum| sum * scale).collect());
        self.in_open = 0;
        if self.columns.len() == MOST_COLUMNS {
            let mean = |pair: &[Vec<f64>]| match pair {
                [a, b] => a.iter().zip(b).map(|(x, y)| (x + y) / 2.0).collect(),
                other => other.concat(),
            };
            self.columns = self.columns.chunks(2).map(mean).collect();
            self.every *= 2;
        }
    }

    /// Uses up what is waiting; call it when the signal has ended.
    pub fn finish(&mut self) {
        if self.waiting.len() >= self.segment {
            self.take(self.waiting.len());
        }
    }

    /// Hertz between bins.
    pub fn bin_hz(&self) -> f64 {
        self.rate_hz / self.segment as f64
    }

    /// Densities from 0 Hz on, in the signal's unit squared per hertz, a column a stretch of time.
    pub fn columns(&self) -> &[Vec<f64>] {
        &self.columns
    }

    /// Seconds that all columns span.
    pub fn duration_s(&self) -> f64 {
        (self.columns.len() * self.every * self.segment / 2) as f64 / self.rate_hz
    }

    /// Where the mean spectrum is strongest at or above a frequency, in Hz: the top of a parabola through the levels of the
    /// strongest bin and its neighbours. `None` for silence.
    pub fn strongest_hz(&self, from_hz: f64) -> Option<f64> {
        let (mean, bin_hz) = (self.mean(), self.bin_hz());
        // A mean leaks into the bin beside 0 Hz.
        let lowest = ((from_hz / bin_hz).ceil() as usize).max(2);
        let peak = (lowest..mean.len())
            .filter(|bin| mean[*bin] > 0.0)
            .max_by(|a, b| mean[*a].total_cmp(&mean[*b]))?;
        let level = |bin: usize| mean.get(bin).map(|density| density.max(1e-300).ln());
        let around = peak.checked_sub(1).and_then(level).zip(level(peak + 1));
        let beside = around.zip(level(peak)).map_or(0.0, |((below, above), top)| {
            let bend = below - 2.0 * top + above;
            if bend < 0.0 {
                0.5 * (below - above) / bend
            } else {
                0.0
            }
        });
        let beside = if peak == lowest { beside.max(0.0) } else { beside };
        Some((peak as f64 + beside.clamp(-0.5, 0.5)) * bin_hz)
    }

    /// The mean of all columns: Welch's estimate over the whole signal.
    pub fn mean(&self) -> Vec<f64> {
        let bins = self.columns.first().map_or(0, Vec::len);
        let mut mean = vec![0.0; bins];
        for column in &self.columns {
            mean.iter_mut()
                .zip(column)
                .for_each(|(sum, x)| *sum += x / self.columns.len() as f64);
        }
        mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::time::Rate;

    fn stream(kind: Kind, quantity: Quantity, hz: u64) -> Stream {
        Stream {
            name: "a.b".into(),
            kind,
            quantity,
            rate: Rate::from_hz(hz).unwrap(),
            simulated: true,
        }
    }

    #[test]
    fn a_tone_stands_at_its_frequency_for_the_whole_run() {
        let (mut recorder, record) = recorder(stream(Kind::Scalar, Quantity::ACCELERATION, 10_000));
        let tone: Vec<f64> = (0..600_000)
            .map(|i| (f64::from(i) * 0.1 * std::f64::consts::PI).sin())
            .collect();
        for block in tone.chunks(777) {
            recorder.write(0, block).unwrap();
        }
        let Content::Lanes(lanes, Some(spectra)) = record.content().content else {
            panic!()
        };
        let mut spectra = *spectra;
        spectra.finish();
        assert!((lanes[0].rms() - 0.5f64.sqrt()).abs() < 1e-3);
        assert!(spectra.columns().len() <= MOST_COLUMNS);
        assert!(
            (spectra.duration_s() - 60.0).abs() < 1.0,
            "{}",
            spectra.duration_s()
        );
        let mean = spectra.mean();
        let peak = (0..mean.len())
            .max_by(|a, b| mean[*a].total_cmp(&mean[*b]))
            .unwrap();
        assert!((peak as f64 * spectra.bin_hz() - 500.0).abs() <= spectra.bin_hz());
        let power: f64 = mean.iter().sum::<f64>() * spectra.bin_hz();
        assert!((power - 0.5).abs() < 0.01, "{power}");
    }

    #[test]
    fn the_strongest_frequency_lies_between_bins() {
        for (rate_hz, tone_hz) in [(48_000, 120.0), (10_000, 120.0), (10_000, 245.0)] {
            let mut spectra = Spectra::new(f64::from(rate_hz));
            let tone: Vec<f64> = (0..2 * rate_hz)
                .map(|i| (std::f64::consts::TAU * tone_hz * f64::from(i) / f64::from(rate_hz)).sin())
                .collect();
            spectra.extend(&tone);
            spectra.finish();
            let found = spectra.strongest_hz(10.0).unwrap();
            assert!((found - tone_hz).abs() < 0.5, "{found} of {tone_hz} at {rate_hz}");
        }
        assert_eq!(Spectra::new(10_000.0).strongest_hz(10.0), None);
    }

    #[test]
    fn events_keep_their_times_across_blocks() {
        let (mut recorder, record) = recorder(stream(Kind::Event, Quantity::SPEED, 1000));
        recorder.write(0, &[0.0, 0.0, 1.0, 0.3]).unwrap();
        recorder.write(0, &[0.0, 0.0, 1.0, 0.4]).unwrap();
        let Content::Events(points, 2) = record.content().content else {
            panic!()
        };
        assert_eq!(points.kept(), [(0.001, 0.3), (0.003, 0.4)]);
    }
}
