//! Recording of signals for a page: selects the signals of a graph and reduces them to what can be displayed or played.
//! The size of a recording does not depend on the length of the run.

use super::spectra::Spectra;
use super::thinning::{Decimated, Envelope};
use haptograph_engine::frame::{Event, Kind, OneKind, Record as _};
use haptograph_engine::graph::{Graph, Node, NodeId};
use haptograph_engine::node::{FrameWriter, OutputRole, Stream};
use haptograph_nodes::contact::Contact;
use haptograph_nodes::sinks::plots::GROUP as PLOTS;
use haptograph_nodes::texture::frames::Weights;
use haptograph_signal::quantity::Quantity;
use std::sync::{Arc, Mutex, PoisonError};

/// An output to record.
#[derive(Debug, Clone, PartialEq)]
pub struct WatchedOutput {
    /// The node.
    pub node: NodeId,
    /// Index among its outputs.
    pub output: usize,
    /// Clock, kind and quantity of the signal.
    pub stream: Stream,
}

/// Maximum number of signals on a page.
const MAX_WATCHED: usize = 24;

/// The outputs of a graph that its page shows: signals of sources, inputs of sinks, outputs of actuators, and
/// the positions on texture maps with their force and speed.
pub fn watched(graph: &Graph) -> Vec<WatchedOutput> {
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
        let on_map = node.outputs.iter().any(|output| output.kind == Weights::KIND);
        let shown = |kind: Kind| kind == Weights::KIND || kind == Contact::KIND;
        for (output, _) in node.outputs.iter().enumerate().filter(|(_, port)| shown(port.kind)) {
            want((index, output));
        }
        let kept = node.entry.is_file() && node.entry.spec.group != PLOTS;
        if on_map || kept || node.entry.is_actuator() {
            for read in nodes.incoming(index) {
                want((read.from, read.edge.output));
            }
        }
    }
    wanted.truncate(MAX_WATCHED);
    wanted.into_iter().filter_map(|(node, output)| watch(graph, node, output)).collect()
}

/// The signals that yield the friction coefficient of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Friction {
    /// Name of a signal that is the coefficient.
    Measured(String),
    /// Signals of the tangential and the normal force.
    Forces {
        /// The tangential force.
        tangential: String,
        /// The normal force.
        normal: String,
    },
}

/// The friction signals of a graph: the first output that declares itself a friction coefficient; otherwise
/// the inputs of ports named `friction` and `load`, if there is one of each.
pub fn friction(graph: &Graph) -> Option<Friction> {
    let nodes = graph.nodes();
    let mut outputs =
        nodes.ids().flat_map(|node| (0..nodes[node].outputs.len()).map(move |output| (node, output)));
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
    Some(Friction::Forces { tangential: read_as("friction")?, normal: read_as("load")? })
}

/// True if an output is declared as a coefficient of friction. Its quantity is a plain number and does not show this.
fn is_friction_coefficient(node: &Node, output: usize) -> bool {
    let declared = node.output_spec(output);
    declared.is_some_and(|spec| spec.role == OutputRole::FrictionCoefficient)
}

/// An output of a graph for recording; `None` if it does not exist or has no clock.
pub fn watch(graph: &Graph, node: NodeId, output: usize) -> Option<WatchedOutput> {
    let source = graph.nodes().get(node)?;
    let port = source.outputs.get(output)?;
    let stream = Stream {
        name: format!("{}.{}", source.path, port.name),
        kind: port.kind,
        quantity: port.quantity,
        rate: graph.clocks().get(source.clock?)?.rate,
        simulated: source.simulated,
    };
    Some(WatchedOutput { node, output, stream })
}

/// The recording of one signal.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// Clock, kind and quantity of the signal.
    pub stream: Stream,
    /// The recorded data.
    pub content: Content,
    /// Number of frames.
    pub frames: u64,
}

/// Recorded data by kind of signal.
#[derive(Debug, Clone)]
pub enum Content {
    /// Linear kinds: extremes of each component; for fast scalars also spectra over time.
    Components(Vec<Envelope>, Option<Box<Spectra>>),
    /// Positions on a texture's map: (speed in m/s, force in N).
    Map(Decimated<(f64, f64)>),
    /// Contacts: penetration in m, and positions of the proxy during contact.
    Contact(Envelope, Decimated<[f64; 3]>),
    /// Events: (time in s, value), and their number.
    Events(Decimated<(f64, f64)>, u64),
    /// Kinds that are not displayed.
    Nothing,
}

/// What a signal is reduced to during a run.
pub trait Reduction: Clone + Send + 'static {
    /// Adds frames.
    fn extend(&mut self, frames: &[f64]);
}

/// Writer that reduces a signal.
#[derive(Debug)]
pub(crate) struct Recorder<T>(Arc<Mutex<T>>);

/// Access to what a `Recorder` keeps.
#[derive(Debug)]
pub struct Record<T>(Arc<Mutex<T>>);

/// A recorder that adds to a reduction, and the access to it.
pub(crate) fn recorder<T: Reduction>(reduction: T) -> (Recorder<T>, Record<T>) {
    let shared = Arc::new(Mutex::new(reduction));
    (Recorder(Arc::clone(&shared)), Record(shared))
}

impl<T: Reduction> Record<T> {
    /// The reduction so far.
    pub(crate) fn content(&self) -> T {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl<T: Reduction> FrameWriter for Recorder<T> {
    fn write(&mut self, _: usize, frames: &[f64]) -> std::io::Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend(frames);
        Ok(())
    }

    fn finish(self: Box<Self>) -> std::io::Result<()> {
        Ok(())
    }
}

/// Maximum number of points of a path or scatter plot.
const MAX_POINTS: usize = 3000;
/// Scalars at this rate or above get a spectrogram.
pub(super) const SPECTRAL_RATE_HZ: f64 = 2000.0;

impl Content {
    fn of(stream: &Stream) -> Self {
        let rate_hz = stream.rate.hz();
        match stream.kind {
            linear if linear.is_linear() => {
                let vibrates =
                    [Quantity::ACCELERATION, Quantity::FORCE, Quantity::VOLTAGE, Quantity::CURRENT];
                let spectral = linear == Kind::SCALAR
                    && rate_hz >= SPECTRAL_RATE_HZ
                    && vibrates.contains(&stream.quantity);
                let spectra = spectral.then(|| Box::new(Spectra::new(rate_hz)));
                Self::Components(vec![Envelope::new(rate_hz); linear.width()], spectra)
            }
            weights if weights == Weights::KIND => Self::Map(Decimated::new(MAX_POINTS)),
            contact if contact == Contact::KIND => {
                Self::Contact(Envelope::new(rate_hz), Decimated::new(MAX_POINTS))
            }
            event if event == Kind::EVENT => Self::Events(Decimated::new(MAX_POINTS), 0),
            _ => Self::Nothing,
        }
    }
}

impl Reduction for Recorded {
    fn extend(&mut self, frames: &[f64]) {
        let width = self.stream.kind.width();
        let first = self.frames;
        self.frames += (frames.len() / width) as u64;
        match &mut self.content {
            Content::Components(components, spectra) => {
                for (component, envelope) in components.iter_mut().enumerate() {
                    envelope.extend(frames.chunks(width).filter_map(|frame| frame.get(component)).copied());
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
}

impl Recorded {
    /// The empty recording of a signal.
    pub fn of(stream: Stream) -> Self {
        Self { content: Content::of(&stream), stream, frames: 0 }
    }

    /// Duration, s.
    pub(crate) fn duration_s(&self) -> f64 {
        self.frames as f64 * self.stream.rate.period_s()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::time::Rate;

    fn stream(kind: Kind, quantity: Quantity, hz: u64) -> Stream {
        Stream { name: "a.b".into(), kind, quantity, rate: Rate::from_hz(hz).unwrap(), simulated: true }
    }

    #[test]
    fn the_brakes_own_measurement_of_friction_is_found_by_its_role() {
        use haptograph_engine::document::{Document, LoadOptions};
        use haptograph_engine::graph::{CheckOptions, check};
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/ar-pen.ron");
        let graph = Document::load(path, &LoadOptions::default()).and_then(|document| {
            let registry = haptograph_nodes::registry();
            check(&document, &registry, &CheckOptions::default())
        });
        let graph = graph.unwrap_or_else(|wrong| panic!("{wrong}"));
        assert!(matches!(friction(&graph), Some(Friction::Measured(name)) if name.ends_with(".measured")));
    }

    #[test]
    fn a_fast_scalar_that_vibrates_has_a_spectrum() {
        let mut recorded = Recorded::of(stream(Kind::SCALAR, Quantity::ACCELERATION, 10_000));
        let tone: Vec<f64> = (0..50_000).map(|i| (f64::from(i) * 0.1 * std::f64::consts::PI).sin()).collect();
        for block in tone.chunks(777) {
            recorded.extend(block);
        }
        let Content::Components(components, Some(mut spectra)) = recorded.content else { panic!() };
        spectra.finish();
        assert!((components[0].rms() - 0.5f64.sqrt()).abs() < 1e-3);
        assert!((spectra.strongest_hz().unwrap() - 500.0).abs() < 0.5);
    }

    #[test]
    fn events_keep_their_times_across_blocks() {
        let (mut recorder, record) = recorder(Recorded::of(stream(Kind::EVENT, Quantity::SPEED, 1000)));
        recorder.write(0, &[0.0, 0.0, 1.0, 0.3]).unwrap();
        recorder.write(0, &[0.0, 0.0, 1.0, 0.4]).unwrap();
        let recorded = record.content();
        let Content::Events(points, 2) = recorded.content else { panic!() };
        assert_eq!(points.kept(), [(0.001, 0.3), (0.003, 0.4)]);
    }
}
