//! A graph that has been proved sound: every name resolved, every port matched, every clock known.
//!
//! Only [`check`] makes one, so the stages after it have no errors to look for. petgraph is known here and in `plan`, and to nobody else.

mod bridges;
mod build;
mod check;
mod clocks;
mod cycles;
mod devices;
mod draft;
mod expand;
pub(crate) mod fingerprint;
mod latency;
mod left_out;
mod memory;
mod nodes;
mod types;
mod unused;
mod values;
mod wires;

pub use check::{CheckOptions, Hosted, check};
pub use devices::{DeclaredDevice, declared_devices};
pub use latency::PathLatency;
pub use nodes::{Connection, NodeId, Nodes, TemplateOutput};

use crate::device::{Channel, Device, DeviceEntry};
use crate::diagnostic::{Diagnostic, Sources, Span};
use crate::frame::Kind;
use crate::node::{AfterData, DataEnd, FileProgress, FileSink, Limit, NodeEntry, Processor};
use crate::settings::SettingSpec;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::{Rate, TimeBase};
use petgraph::graph::DiGraph;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A sound graph.
pub struct Graph {
    /// What it is about, from the file.
    pub(crate) about: String,
    pub(crate) seed: u64,
    pub(crate) clocks: Vec<Clock>,
    /// Periods of all clocks in one unit, in the order of `clocks`.
    pub(crate) base: TimeBase,
    /// Nodes in the order of the file, templates expanded.
    pub(crate) nodes: DiGraph<Node, Edge>,
    pub(crate) template_outputs: Vec<TemplateOutput>,
    pub(crate) devices: Vec<GraphDevice>,
    pub(crate) sources: Sources,
    pub(crate) warnings: Vec<Diagnostic>,
}

/// A clock: a driver with its own crystal or timer, or an exact ratio of one.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// Its name in the file.
    pub name: String,
    /// Its rate.
    pub rate: Rate,
    /// Index of its driver among the clocks; its own index if it is one.
    pub driver: usize,
}

/// A source whose data end.
#[derive(Debug, Clone, Copy)]
pub struct SourceEnd<'a> {
    /// The node.
    pub path: &'a str,
    /// Rate of its clock.
    pub rate: Rate,
    /// Where, and what follows.
    pub end: DataEnd,
}

impl SourceEnd<'_> {
    /// The same in seconds.
    pub fn seconds(&self) -> f64 {
        self.end.frames as f64 * self.rate.period_s()
    }

    /// The most frames that a driver can run before the source has a tick without data.
    pub fn driver_frames(&self, driver: Rate) -> u64 {
        let ((n, d), (driver_n, driver_d)) = (self.rate.parts(), driver.parts());
        let product = |a: u64, b: u64| u128::from(a) * u128::from(b);
        // Exact but for rates whose parts have no place in 128 bits.
        let exact = u128::from(self.end.frames).checked_mul(product(driver_n, d));
        let frames = match exact {
            Some(exact) => exact / product(driver_d, n).max(1),
            None => (self.seconds() * driver.hz()) as u128,
        };
        u64::try_from(frames).unwrap_or(u64::MAX)
    }
}

/// A node with everything decided.
pub struct Node {
    /// Its path: `texture/filter`.
    pub path: String,
    /// Its kind.
    pub entry: NodeEntry,
    /// Its clock, as an index; `None` for file sinks, whose inputs keep their own.
    pub clock: Option<usize>,
    /// Connections in the order of the spec, those of a `Many` port from its place on.
    pub inputs: Vec<Input>,
    /// Ports with kind and quantity decided.
    pub outputs: Vec<Output>,
    pub(crate) work: Work,
    /// Where it is declared.
    pub span: Span,
    /// Does its output depend on a simulated device?
    pub simulated: bool,
    /// Of its kind, its settings but for the live ones, its rate and its connections: equal for nodes that are the
    /// same but for their path.
    pub fingerprint: u64,
    /// Its live settings: their places among all settings, and their values.
    pub live: Vec<(usize, f64)>,
    /// Settings that the graph gives it, as it writes them.
    pub written: Vec<(String, String)>,
    /// The files that its settings name, like the surface it renders.
    pub files: Vec<PathBuf>,
}

/// An input of a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Name of the port.
    pub name: &'static str,
    /// Shape of its frames; that of the port where it is not connected.
    pub kind: Kind,
    /// What its numbers are.
    pub quantity: Quantity,
    /// Is it connected? The edge of the graph whose `input` is this one's index says to what.
    pub connected: bool,
    /// Does it read runs?
    pub held: bool,
}

/// An output of a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Output {
    /// Name of the port.
    pub name: &'static str,
    /// Shape of its frames.
    pub kind: Kind,
    /// What its numbers are.
    pub quantity: Quantity,
}

/// What a node does when it runs. Processors and devices are pristine: plans take clones.
pub(crate) enum Work {
    Process(Box<dyn Processor>),
    /// Output i is the device's sensed channel `channels[i]`.
    Source {
        device: usize,
        channels: Vec<usize>,
    },
    Actuator {
        device: usize,
        channel: usize,
        gain: f64,
        limit: Limit,
    },
    File(Box<dyn FileSink>),
}

impl Work {
    /// The device that a source reads.
    pub fn source_device(&self) -> Option<usize> {
        match self {
            Work::Source { device, .. } => Some(*device),
            _ => None,
        }
    }

    /// The device that a sink drives.
    pub fn sink_device(&self) -> Option<usize> {
        match self {
            Work::Actuator { device, .. } => Some(*device),
            _ => None,
        }
    }
}

/// A device that at least one node is bound to.
pub struct GraphDevice {
    /// Name of the endpoint.
    pub name: String,
    /// Its kind.
    pub entry: DeviceEntry,
    /// The clock that it ticks on.
    pub clock: usize,
    pub(crate) device: Box<dyn Device>,
    /// What nodes can read; a channel's place is its number.
    pub senses: Vec<Channel>,
    /// Where it is declared.
    pub span: Span,
    /// Of its kind, its settings and its rate.
    pub fingerprint: u64,
}

/// A connection from an output to an input.
#[derive(Debug, Clone, PartialEq)]
pub struct Edge {
    /// Index among the outputs of the node it comes from.
    pub output: usize,
    /// Index among the inputs of the node it goes to.
    pub input: usize,
    /// How it crosses rates or time.
    pub bridge: Bridge,
    /// Where it is written.
    pub span: Span,
}

/// How a signal crosses rates or time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bridge {
    /// The same clock at both ends.
    Direct,
    /// The latest frame with time <= t.
    Hold,
    /// A straight line between frames; one period of the slow clock late.
    Linear,
    /// The mean of the fast frames since the previous slow tick.
    Average,
    /// Band-limited resampling.
    Resample,
    /// To another driver, by a ring and a steered resampler.
    Ring {
        /// From the writer's frame to the reader's tick, the resampler's delay included.
        latency_s: f64,
    },
    /// The same clock, this many frames later; `initial` before that.
    Delay {
        /// At least 1.
        frames: u64,
        /// Every lane before the first frame arrives.
        initial: f64,
    },
}

/// A setting that may change while the graph runs.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveSetting {
    /// The node.
    pub node: NodeId,
    /// The node's path.
    pub path: String,
    /// The setting's place among the node's settings, and its name.
    pub setting: usize,
    /// Its name.
    pub field: &'static str,
    /// Its value.
    pub value: f64,
    /// Smallest and largest value.
    pub range: Option<(f64, f64)>,
    /// Is it a whole number? Then it jumps.
    pub whole: bool,
}

impl LiveSetting {
    /// As it is written: `out.gain`.
    pub fn name(&self) -> String {
        format!("{}.{}", self.path, self.field)
    }

    pub(crate) fn is_same_as(&self, other: &Self) -> bool {
        self.path == other.path && self.field == other.field
    }
}

impl Graph {
    /// The actuator sinks, by path, and what each may give.
    pub fn limits(&self) -> impl Iterator<Item = (&str, Limit)> {
        self.nodes.node_weights().filter_map(|node| match &node.work {
            Work::Actuator { limit, .. } => Some((&*node.path, *limit)),
            _ => None,
        })
    }

    /// The actuator sinks: each with the device that it drives, and what it may give.
    pub fn actuators(&self) -> impl Iterator<Item = (&Node, &GraphDevice, Limit)> {
        self.nodes.node_weights().filter_map(|node| match &node.work {
            Work::Actuator { device, limit, .. } => Some((node, self.devices.get(*device)?, *limit)),
            _ => None,
        })
    }

    /// The files that its sinks write in the folder of a run, by the sinks' nodes.
    pub fn written_files(&self) -> impl Iterator<Item = (NodeId, &Path)> {
        self.nodes
            .node_indices()
            .filter_map(|index| match &self.nodes[index].work {
                Work::File(sink) => Some((NodeId(index), sink.file_name())),
                _ => None,
            })
    }

    /// What its file sinks show of themselves while they are written, by the paths of their nodes.
    pub fn file_progress(&self) -> impl Iterator<Item = (&str, Arc<dyn FileProgress>)> {
        self.nodes.node_weights().filter_map(|node| match &node.work {
            Work::File(sink) => Some((&*node.path, sink.progress()?)),
            _ => None,
        })
    }

    /// The sources whose data end.
    pub fn data_ends(&self) -> impl Iterator<Item = SourceEnd<'_>> {
        self.nodes.node_weights().filter_map(|node| match &node.work {
            Work::Process(processor) => Some(SourceEnd {
                path: &node.path,
                rate: self.clocks[node.clock?].rate,
                end: processor.data_end()?,
            }),
            _ => None,
        })
    }

    /// Frames of a driver after which the first source has no more data and ends the run.
    pub(crate) fn frames_of_data(&self, driver: Rate) -> Option<u64> {
        let stops = self
            .data_ends()
            .filter(|source| source.end.then == AfterData::Stop);
        stops.map(|source| source.driver_frames(driver)).min()
    }

    /// The devices that actuator sinks drive.
    pub fn driven_devices(&self) -> impl Iterator<Item = &GraphDevice> {
        let driven = |wanted: usize| {
            let mut works = self.nodes.node_weights().map(|node| &node.work);
            works.any(|work| matches!(work, Work::Actuator { device, .. } if *device == wanted))
        };
        let devices = self.devices.iter().enumerate();
        devices
            .filter(move |(at, _)| driven(*at))
            .map(|(_, device)| device)
    }

    /// The devices that sources read.
    pub fn read_devices(&self) -> impl Iterator<Item = &GraphDevice> {
        let read = |wanted: usize| {
            let mut works = self.nodes.node_weights().map(|node| &node.work);
            works.any(|work| matches!(work, Work::Source { device, .. } if *device == wanted))
        };
        let devices = self.devices.iter().enumerate();
        devices.filter(move |(at, _)| read(*at)).map(|(_, device)| device)
    }

    /// The settings that may change while it runs.
    pub fn live_settings(&self) -> Vec<LiveSetting> {
        let mut found = Vec::new();
        for (index, node) in self.nodes.node_indices().zip(self.nodes.node_weights()) {
            let specs = node.entry.settings();
            found.extend(node.live.iter().filter_map(|(setting, value)| {
                let spec = specs.get(*setting)?;
                Some(LiveSetting {
                    node: NodeId(index),
                    path: node.path.clone(),
                    setting: *setting,
                    field: spec.name,
                    value: *value,
                    range: self.live_range(node, spec),
                    whole: spec.whole,
                })
            }));
        }
        found
    }

    /// What has to stay below half of the rate of its node does so too, as when the graph is checked.
    fn live_range(&self, node: &Node, spec: &SettingSpec) -> Option<(f64, f64)> {
        let clock = node.clock.filter(|_| spec.below_nyquist);
        let Some(clock) = clock else { return spec.range };
        let (low, high) = spec.range.unwrap_or((0.0, f64::MAX));
        Some((low, high.min((0.5 * self.clocks[clock].rate.hz()).next_down())))
    }

    /// What the graph is about, as the file tells it.
    pub fn about(&self) -> &str {
        &self.about
    }
    /// The seed all random streams derive from.
    pub fn seed(&self) -> u64 {
        self.seed
    }
    /// Its clocks.
    pub fn clocks(&self) -> &[Clock] {
        &self.clocks
    }
    /// The drivers that at least one node hangs from, as indices of the clocks; the first driver where there are no nodes.
    pub fn drivers(&self) -> Vec<usize> {
        let used = |driver: &usize| {
            self.nodes
                .node_indices()
                .any(|node| self.driver_of(NodeId(node)) == Some(*driver))
        };
        let mut drivers: Vec<usize> = (0..self.clocks.len())
            .filter(|clock| self.clocks[*clock].driver == *clock && used(clock))
            .collect();
        if drivers.is_empty() {
            drivers.push(0);
        }
        drivers
    }
    /// The driver that a node hangs from, as an index of the clocks; none for a file sink.
    pub fn driver_of(&self, node: NodeId) -> Option<usize> {
        let clock = self.nodes.node_weight(node.0)?.clock?;
        self.clocks.get(clock).map(|clock| clock.driver)
    }
    /// Does a way lead along the connections from one node to another?
    pub fn reaches(&self, from: NodeId, to: NodeId) -> bool {
        petgraph::algo::has_path_connecting(&self.nodes, from.0, to.0, None)
    }
    /// Of every node, by its index: does a way lead along the connections from it to this one?
    pub(crate) fn leading_to(&self, to: NodeId) -> Vec<bool> {
        let backwards = petgraph::visit::Reversed(&self.nodes);
        let mut found = vec![false; self.nodes.node_count()];
        let mut search = petgraph::visit::Dfs::new(backwards, to.0);
        while let Some(node) = search.next(backwards) {
            found[node.index()] = true;
        }
        found
    }
    /// The devices its nodes are bound to.
    pub fn devices(&self) -> &[GraphDevice] {
        &self.devices
    }
    /// The files it was read from.
    pub fn sources(&self) -> &Sources {
        &self.sources
    }
    /// What is probably not meant.
    pub fn warnings(&self) -> &[Diagnostic] {
        &self.warnings
    }
}

impl GraphDevice {
    /// The device in its initial state.
    pub fn device(&self) -> &dyn Device {
        self.device.as_ref()
    }
}

impl Node {
    /// The device that a source reads or an actuator sink drives, as an index into [`Graph::devices`].
    pub fn device(&self) -> Option<usize> {
        self.work.source_device().or_else(|| self.work.sink_device())
    }
}

impl std::fmt::Debug for Graph {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "Graph({} nodes, {} edges)",
            self.nodes.node_count(),
            self.nodes.edge_count()
        )
    }
}
