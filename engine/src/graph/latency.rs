//! Latency from sources to sinks, computed from the graph.

use super::{Bridge, Edge, Graph, NodeId, Work, id_of};
use crate::device::DeviceLatency;
use crate::node::Latency;
use petgraph::graph::{EdgeReference, NodeIndex};
use petgraph::visit::{DfsPostOrder, EdgeFiltered, EdgeRef};

/// Delay from a source to a sink along the slowest path.
#[derive(Debug, Clone, PartialEq)]
pub struct PathLatency {
    /// Path of the source.
    pub source: String,
    /// Path of the sink.
    pub sink: String,
    /// Both nodes.
    pub ends: [NodeId; 2],
    /// Transport delay, s: bridges, look-ahead, buffers of devices.
    pub transport_s: f64,
    /// Transport delay without the buffers of devices, s.
    pub held_s: f64,
    /// Group delay of filters and of holds, s.
    pub group_delay_s: f64,
}

impl Graph {
    /// The latency of every pair of source and sink, without declared feedback.
    pub fn latencies(&self) -> Vec<PathLatency> {
        let mut found = Vec::new();
        let mut slowest = Slowest::of(self);
        for source in self.nodes.externals(petgraph::Incoming) {
            let sensing_s = self.buffers_of(source).sensing_s;
            let reached = slowest.from(source).into_iter();
            found.extend(reached.map(|(sink, latency)| PathLatency {
                source: self.nodes[source].path.clone(),
                sink: self.nodes[sink].path.clone(),
                ends: [id_of(source), id_of(sink)],
                transport_s: sensing_s + latency.transport_s + self.buffers_of(sink).driving_s,
                held_s: latency.transport_s,
                group_delay_s: latency.group_delay_s,
            }));
        }
        found
    }

    /// True if a path ends at this node.
    fn ends_paths(&self, node: NodeIndex) -> bool {
        let drives = matches!(self.nodes[node].work, Work::Actuator { .. });
        drives || self.nodes.edges(node).next().is_none()
    }

    /// Group delay of the slowest channel of a source.
    fn filtered(&self, node: NodeIndex) -> Latency {
        let Work::Source { device, channels } = &self.nodes[node].work else {
            return Latency::default();
        };
        let device = &self.devices[*device].device;
        let delays = channels.iter().map(|channel| device.group_delay_s(*channel));
        Latency { transport_s: 0.0, group_delay_s: delays.fold(0.0, f64::max) }
    }

    /// Delay of the buffers of a node's device.
    fn buffers_of(&self, node: NodeIndex) -> DeviceLatency {
        let device = self.nodes[node].device();
        device.map_or_else(DeviceLatency::default, |device| self.devices[device].device.latency())
    }

    fn crossing(&self, from: NodeIndex, to: NodeIndex, edge: &Edge) -> Latency {
        let rate = |node: NodeIndex| self.nodes[node].clock.map(|clock| self.clocks[clock].rate);
        let (Some(from), Some(to)) = (rate(from), rate(to)) else {
            return Latency::default();
        };
        match edge.bridge {
            Bridge::Direct | Bridge::Delay { .. } => Latency::default(),
            Bridge::Between(bridge) => bridge.latency(from, to),
            Bridge::Ring { latency_s } => Latency::of_transport(latency_s),
        }
    }
}

/// Initial value of the search, below all delays: that of a predicting filter is negative.
const EARLIEST: Latency = Latency { transport_s: 0.0, group_delay_s: f64::NEG_INFINITY };

/// Search for the slowest paths from a source, in one pass in topological order.
struct Slowest<'g> {
    graph: &'g Graph,
    /// Index of each node in the present pass.
    places: Vec<usize>,
    /// Latest arrival at the inputs of each node so far.
    before: Vec<Latency>,
}

impl<'g> Slowest<'g> {
    fn of(graph: &'g Graph) -> Self {
        let count = graph.nodes.node_count();
        Self { graph, places: vec![0; count], before: vec![Latency::default(); count] }
    }

    /// The ends of paths from `source` in the order of the graph's nodes, with their delays.
    fn from(&mut self, source: NodeIndex) -> Vec<(NodeIndex, Latency)> {
        let graph = self.graph;
        let order = self.order_from(source);
        let mut ends = Vec::new();
        for (place, node) in order.iter().enumerate() {
            let own = match &graph.nodes[*node].work {
                Work::Process(processor) => processor.latency(),
                _ => Latency::default(),
            };
            let here = sum(self.before[node.index()], own);
            for edge in graph.nodes.edges(*node).filter(|edge| leads_on(*edge)) {
                let target = edge.target();
                // A loop through rings is followed once.
                if self.places[target.index()] > place {
                    let arrival = sum(here, graph.crossing(*node, target, edge.weight()));
                    let known = &mut self.before[target.index()];
                    if total(&arrival) > total(known) {
                        *known = arrival;
                    }
                }
            }
            if *node != source && graph.ends_paths(*node) {
                ends.push((*node, here));
            }
        }
        ends.sort_unstable_by_key(|(node, _)| *node);
        ends
    }

    /// The nodes that the source reaches, in topological order except for loops.
    fn order_from(&mut self, source: NodeIndex) -> Vec<NodeIndex> {
        let forward = EdgeFiltered::from_fn(&self.graph.nodes, leads_on);
        let mut search = DfsPostOrder::new(&forward, source);
        let mut order = Vec::new();
        while let Some(node) = search.next(&forward) {
            order.push(node);
        }
        order.reverse();
        for (place, node) in order.iter().enumerate() {
            self.places[node.index()] = place;
            self.before[node.index()] = EARLIEST;
        }
        self.before[source.index()] = self.graph.filtered(source);
        order
    }
}

/// True if the edge is not declared feedback.
fn leads_on(edge: EdgeReference<'_, Edge>) -> bool {
    !matches!(edge.weight().bridge, Bridge::Delay { .. })
}

fn total(latency: &Latency) -> f64 {
    latency.transport_s + latency.group_delay_s
}

fn sum(a: Latency, b: Latency) -> Latency {
    Latency { transport_s: a.transport_s + b.transport_s, group_delay_s: a.group_delay_s + b.group_delay_s }
}
