//! The checked graph: every name is resolved, every port matches, every node has a clock.
//!
//! Only [`check`] makes one, so later stages need no error handling. Only `graph` and `plan` use petgraph.

mod assemble;
mod attach;
mod bridges;
mod build;
mod check;
mod clocks;
mod connection;
mod context;
mod cycles;
mod declared;
mod declared_devices;
mod devices;
mod expand;
mod findings;
pub(crate) mod fingerprint;
mod given;
mod latency;
mod left_out;
mod live;
mod members;
mod memory;
mod mismatch;
mod nodes;
mod options;
mod reach;
mod registered;
mod types;
mod unused;
mod values;
mod wires;

pub use check::check;
pub use declared_devices::{DeclaredDevice, declared_devices};
pub use latency::PathLatency;
pub use nodes::{Connection, Nodes, TemplateOutput};
pub(crate) use nodes::{id_of, index_of};
pub use options::{CheckOptions, Hosted};
pub(crate) use reach::Reach;

pub use crate::node_id::NodeId;
pub use crate::settings::LiveSetting;

use crate::bridges::BridgeEntry;
use crate::device::{Channel, Device, DeviceEntry, DeviceKind};
use crate::diagnostic::{Diagnostic, Sources, Span};
use crate::document::value::{Name, Value};
use crate::frame::Kind;
use crate::node::{
    AfterData, AnyProcessor, DataEnd, FileProgress, FileSink, Limit, NodeEntry, OfflineOnly, OutputSpec,
    Stream,
};
use crate::settings::SettingId;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::{Rate, TimeBase};
use petgraph::graph::DiGraph;
use std::any::Any;
use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A checked graph.
pub struct Graph {
    /// Description from the file.
    pub(crate) about: String,
    pub(crate) seed: u64,
    pub(crate) clocks: Vec<Clock>,
    /// The periods of all clocks in one unit, in the order of `clocks`.
    pub(crate) base: TimeBase,
    /// Nodes in file order, templates expanded.
    pub(crate) nodes: DiGraph<Node, Edge>,
    pub(crate) template_outputs: Vec<TemplateOutput>,
    pub(crate) devices: Vec<GraphDevice>,
    pub(crate) sources: Sources,
    pub(crate) warnings: Vec<Diagnostic>,
}

/// A clock: a driver with its own crystal or timer, or a clock at an exact ratio of a driver's rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// The name in the file.
    pub name: String,
    /// The rate.
    pub rate: Rate,
    /// Index of its driver in the list of clocks; its own index if it is a driver.
    pub driver: usize,
}

/// A source whose data are finite.
#[derive(Debug, Clone, Copy)]
pub struct SourceEnd<'a> {
    /// Path of the node.
    pub path: &'a str,
    /// Rate of its clock.
    pub rate: Rate,
    /// Length of the data, and what follows them.
    pub end: DataEnd,
}

impl SourceEnd<'_> {
    /// Length of the data, s.
    pub fn seconds(&self) -> f64 {
        self.end.frames as f64 * self.rate.period_s()
    }

    /// Largest number of frames that a driver can run before the source has a tick without data.
    pub fn driver_frames(&self, driver: Rate) -> u64 {
        let ((n, d), (driver_n, driver_d)) = (self.rate.parts(), driver.parts());
        let product = |a: u64, b: u64| u128::from(a) * u128::from(b);
        // Exact unless the product of the rates' parts overflows 128 bits.
        let exact = u128::from(self.end.frames).checked_mul(product(driver_n, d));
        let frames = match exact {
            Some(exact) => exact / product(driver_d, n).max(1),
            None => (self.seconds() * driver.hz()) as u128,
        };
        u64::try_from(frames).unwrap_or(u64::MAX)
    }
}

/// A checked node.
pub struct Node {
    /// The path: `texture/filter`.
    pub path: String,
    /// The kind.
    pub entry: NodeEntry,
    /// The clock, as an index; `None` for file sinks, whose inputs keep their own.
    pub clock: Option<usize>,
    /// Inputs in the order of the spec; the connections of a port that takes several follow one another at its place.
    pub inputs: Vec<Input>,
    /// Outputs in the order of the spec; the members of a family follow one another at its place.
    pub outputs: Vec<Output>,
    pub(crate) work: Work,
    /// Place of its declaration.
    pub span: Span,
    /// True if its output depends on a simulated device.
    pub simulated: bool,
    /// Hash of its kind, rate, connections and non-live settings. Equal for nodes that differ in their path only.
    pub fingerprint: u64,
    /// Live settings, each number of a list by itself: handle, and value as in the graph file.
    pub live: Vec<(SettingId, f64)>,
    /// What the graph gives it, shared with the document.
    pub(crate) given: Arc<[(Name, Value)]>,
    /// Files that its settings name, such as the surface it renders.
    pub files: Vec<PathBuf>,
}

/// An input of a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Name of the port.
    pub name: &'static str,
    /// Name that the graph gives the connection, at a port whose connections have names.
    pub label: Option<String>,
    /// Kind of its frames; the port's kind if it is not connected.
    pub kind: Kind,
    /// Quantity of the components.
    pub quantity: Quantity,
    /// True if the input is connected. The edge whose `input` is this index holds the connection.
    pub connected: bool,
    /// True if the input reads runs of held frames.
    pub held: bool,
}

impl Input {
    /// The name that tells it from the other inputs, as far as the graph gives one: of the connection, or of the port.
    pub fn shown(&self) -> &str {
        self.label.as_deref().unwrap_or(self.name)
    }
}

/// An output of a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Output {
    /// Name of the port.
    pub name: Cow<'static, str>,
    /// Shape of its frames.
    pub kind: Kind,
    /// Quantity of the components.
    pub quantity: Quantity,
}

/// The work of a node in a run. Processors and devices are in their initial state: plans clone them.
pub(crate) enum Work {
    Process(Box<dyn AnyProcessor>),
    /// Output i is channel `channels[i]` of those that the device senses.
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
    pub(crate) fn source_device(&self) -> Option<usize> {
        match self {
            Work::Source { device, .. } => Some(*device),
            _ => None,
        }
    }

    /// The device that a sink drives.
    pub(crate) fn sink_device(&self) -> Option<usize> {
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
    /// The kind.
    pub entry: DeviceEntry,
    /// The clock that it ticks on.
    pub clock: usize,
    pub(crate) device: Box<dyn Device>,
    pub(crate) settings: Arc<dyn Any + Send + Sync>,
    /// Channels that nodes can read; a channel's index is its number.
    pub senses: Vec<Channel>,
    /// Place of its declaration.
    pub span: Span,
    /// Hash of its kind, settings and rate.
    pub fingerprint: u64,
}

/// A connection from an output to an input.
#[derive(Debug, Clone, PartialEq)]
pub struct Edge {
    /// Index of the output at the node it comes from.
    pub output: usize,
    /// Index of the input at the node it goes to.
    pub input: usize,
    /// The bridge of the connection.
    pub bridge: Bridge,
    /// Place of the connection in the text.
    pub span: Span,
}

/// The way in which a connection crosses rates or time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bridge {
    /// No bridge: both ends run on one clock.
    Direct,
    /// Between clocks of one driver, by a registered type of bridge.
    Between(BridgeEntry),
    /// To another driver: a ring and an asynchronous resampler.
    Ring {
        /// Delay from the writer's frame to the reader's tick, the resampler's delay included, s.
        latency_s: f64,
    },
    /// Delay on one clock.
    Delay {
        /// Delay in frames, at least 1.
        frames: u64,
        /// Value of every component until the first frame arrives; `None` for the neutral frame of the kind.
        initial: Option<f64>,
    },
}

impl Bridge {
    /// Name in graph files.
    fn name(self) -> &'static str {
        match self {
            Self::Direct => "Direct",
            Self::Between(bridge) => bridge.spec.name,
            Self::Ring { .. } => "Ring",
            Self::Delay { .. } => "Delay",
        }
    }
}

impl Graph {
    /// The path and limit of every actuator sink.
    pub fn limits(&self) -> impl Iterator<Item = (&str, Limit)> {
        self.nodes.node_weights().filter_map(|node| match &node.work {
            Work::Actuator { limit, .. } => Some((&*node.path, *limit)),
            _ => None,
        })
    }

    /// The node, driven device and limit of every actuator sink.
    pub fn actuators(&self) -> impl Iterator<Item = (&Node, &GraphDevice, Limit)> {
        self.nodes.node_weights().filter_map(|node| match &node.work {
            Work::Actuator { device, limit, .. } => Some((node, self.devices.get(*device)?, *limit)),
            _ => None,
        })
    }

    /// The files that its file sinks write in the run's folder.
    pub fn written_files(&self) -> impl Iterator<Item = (NodeId, &Path)> {
        self.nodes.node_indices().filter_map(|index| match &self.nodes[index].work {
            Work::File(sink) => Some((id_of(index), sink.file_name())),
            _ => None,
        })
    }

    /// The progress of its file sinks, by node path.
    pub fn file_progress(&self) -> impl Iterator<Item = (&str, Arc<dyn FileProgress>)> {
        self.nodes.node_weights().filter_map(|node| match &node.work {
            Work::File(sink) => Some((&*node.path, sink.progress()?)),
            _ => None,
        })
    }

    /// The sources whose data are finite.
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

    /// Driver frames after which the first source that stops the run has no more data.
    pub(crate) fn frames_of_data(&self, driver: Rate) -> Option<u64> {
        let stops = self.data_ends().filter(|source| source.end.then == AfterData::Stop);
        stops.map(|source| source.driver_frames(driver)).min()
    }

    /// Description of an output's signal.
    pub(crate) fn stream(&self, node: NodeId, output: usize) -> Stream {
        let node = &self.nodes[index_of(node)];
        let port = &node.outputs[output];
        Stream {
            name: format!("{}.{}", node.path, port.name),
            kind: port.kind,
            quantity: port.quantity,
            rate: self.clocks[node.clock.unwrap_or(0)].rate,
            simulated: node.simulated,
        }
    }

    /// The devices that actuator sinks drive.
    pub fn driven_devices(&self) -> impl Iterator<Item = &GraphDevice> {
        self.devices_of(Work::sink_device)
    }

    /// The devices that sources read.
    pub fn read_devices(&self) -> impl Iterator<Item = &GraphDevice> {
        self.devices_of(Work::source_device)
    }

    fn devices_of(&self, device_of: fn(&Work) -> Option<usize>) -> impl Iterator<Item = &GraphDevice> {
        let used: HashSet<usize> =
            self.nodes.node_weights().filter_map(|node| device_of(&node.work)).collect();
        let devices = self.devices.iter().enumerate();
        devices.filter(move |(device, _)| used.contains(device)).map(|(_, device)| device)
    }

    /// The scripted nodes; a graph that has one runs offline only.
    pub fn scripted_nodes(&self) -> impl Iterator<Item = &Node> {
        self.nodes().iter().filter(|node| node.entry.is_scripted())
    }

    /// Returns an error if the graph has a scripted node.
    pub(crate) fn refuse_scripts(&self) -> Result<(), OfflineOnly> {
        match self.scripted_nodes().next() {
            None => Ok(()),
            Some(node) => Err(OfflineOnly { node: node.path.clone(), kind: node.entry.spec.name }),
        }
    }

    /// The settings that can change while the graph runs.
    pub fn live_settings(&self) -> Vec<LiveSetting> {
        let count = self.nodes.node_weights().map(|node| node.live.len()).sum();
        let mut found = Vec::with_capacity(count);
        for (index, node) in self.nodes.node_indices().zip(self.nodes.node_weights()) {
            let specs = node.entry.specs();
            found.extend(node.live.iter().filter_map(|(setting, value)| {
                let spec = specs.get(setting.index())?;
                Some(LiveSetting {
                    node: id_of(index),
                    path: node.path.clone(),
                    setting: *setting,
                    field: spec.name,
                    value: *value,
                    range: match node.clock {
                        Some(clock) => spec.range_at(self.clocks[clock].rate.hz()),
                        None => spec.range,
                    },
                    whole: spec.expected.has_whole_numbers(),
                    si_per_unit: spec.si_per_unit,
                    unit: spec.unit.as_ref().map_or_else(Default::default, |unit| unit.symbol.clone()),
                })
            }));
        }
        found
    }

    /// Description from the file.
    pub fn about(&self) -> &str {
        &self.about
    }
    /// Seed from which all random streams derive.
    pub fn seed(&self) -> u64 {
        self.seed
    }
    /// The clocks.
    pub fn clocks(&self) -> &[Clock] {
        &self.clocks
    }
    /// The drivers that nodes use, as indices of the clocks; the first driver if there are no nodes.
    pub fn drivers(&self) -> Vec<usize> {
        let used = |driver: &usize| {
            self.nodes.node_indices().any(|node| self.driver_of(id_of(node)) == Some(*driver))
        };
        let mut drivers: Vec<usize> = (0..self.clocks.len())
            .filter(|clock| self.clocks[*clock].driver == *clock && used(clock))
            .collect();
        if drivers.is_empty() {
            drivers.push(0);
        }
        drivers
    }
    /// The driver of a node's clock, as an index of the clocks; `None` for a file sink.
    pub fn driver_of(&self, node: NodeId) -> Option<usize> {
        let clock = self.nodes.node_weight(index_of(node))?.clock?;
        self.clocks.get(clock).map(|clock| clock.driver)
    }
    /// True if connections lead from one node to another.
    pub fn reaches(&self, from: NodeId, to: NodeId) -> bool {
        petgraph::algo::has_path_connecting(&self.nodes, index_of(from), index_of(to), None)
    }
    /// For every node, by index: whether connections lead from it to this one.
    pub(crate) fn leading_to(&self, to: NodeId) -> Vec<bool> {
        let backwards = petgraph::visit::Reversed(&self.nodes);
        let mut found = vec![false; self.nodes.node_count()];
        let mut search = petgraph::visit::Dfs::new(backwards, index_of(to));
        while let Some(node) = search.next(backwards) {
            found[node.index()] = true;
        }
        found
    }
    /// The devices its nodes are bound to.
    pub fn devices(&self) -> &[GraphDevice] {
        &self.devices
    }
    /// The body of a device, for connecting the real device before the graph runs; `None` if it has another type.
    pub fn body_mut<D: Device + 'static>(&mut self, device: usize) -> Option<&mut D> {
        let body = &mut self.devices.get_mut(device)?.device;
        match body.body().is_some() {
            true => body.body_mut()?.as_any_mut().downcast_mut(),
            false => body.as_any_mut().downcast_mut(),
        }
    }
    /// The files it was read from.
    pub fn sources(&self) -> &Sources {
        &self.sources
    }
    /// Warnings of the check.
    pub fn warnings(&self) -> &[Diagnostic] {
        &self.warnings
    }
}

impl GraphDevice {
    /// The device in its initial state.
    pub fn device(&self) -> &dyn Device {
        self.device.as_ref()
    }

    /// The body in its initial state, if it has this type.
    pub fn body<D: Device + 'static>(&self) -> Option<&D> {
        self.device.body().unwrap_or(&*self.device).as_any().downcast_ref()
    }

    /// The settings, if it is of this kind.
    pub fn settings<K: DeviceKind>(&self) -> Option<&K::Settings> {
        self.settings.downcast_ref()
    }
}

impl Node {
    /// The diagnostic of a scripted node that raised an exception while it ran; `traceback` is its place in the script.
    pub fn raised(&self, exception: &str, traceback: &str) -> Diagnostic {
        let message = format!("`{}` raised {exception}", self.path);
        Diagnostic::error("E0801", self.span, message).help(traceback)
    }

    /// The settings that the graph gives it, with computed values; paths without their folders.
    pub fn written(&self) -> Vec<(String, String)> {
        let specs = self.entry.specs();
        let is_setting = |name: &str| specs.iter().any(|spec| spec.name == name);
        let settings = self.given.iter().filter(|(name, _)| is_setting(&name.text));
        settings.map(|(name, value)| (name.text.clone(), value.brief())).collect()
    }

    /// The declaration of an output, that of the family for a member of it.
    pub fn output_spec(&self, output: usize) -> Option<&'static OutputSpec> {
        self.entry.spec.output(output)
    }

    /// The device that a source reads or an actuator sink drives, as an index of [`Graph::devices`].
    pub fn device(&self) -> Option<usize> {
        self.work.source_device().or_else(|| self.work.sink_device())
    }
}

impl std::fmt::Debug for Graph {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Graph({} nodes, {} edges)", self.nodes.node_count(), self.nodes.edge_count())
    }
}
