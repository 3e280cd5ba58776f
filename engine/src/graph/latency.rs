//! How late what a source senses reaches a sink, from the graph alone.

use super::{Bridge, Edge, Graph, NodeId, Work};
use crate::device::DeviceLatency;
use crate::joining::resampler;
use crate::node::Latency;
use petgraph::graph::{EdgeReference, NodeIndex};
use petgraph::visit::{DfsPostOrder, EdgeFiltered, EdgeRef};

/// The delay from a node without inputs to a node that nothing reads, along the slowest way.
#[derive(Debug, Clone, PartialEq)]
pub struct PathLatency {
    /// Path of the source.
    pub source: String,
    /// Path of the sink.
    pub sink: String,
    /// Both nodes.
    pub ends: [NodeId; 2],
    /// Whole samples held back: bridges that wait, delays, look-ahead, buffers of devices.
    pub transport_s: f64,
    /// The part of it that the graph itself holds back, between what was read and what is written.
    pub held_s: f64,
    /// Group delay of filters and of holding.
    pub group_delay_s: f64,
}

impl Graph {
    /// The delay of every pair of source and sink, declared feedback left out.
    pub fn latencies(&self) -> Vec<PathLatency> {
        let mut found = Vec::new();
        let mut slowest = Slowest::of(self);
        for source in self.nodes.externals(petgraph::Incoming) {
            let sensing_s = self.buffers_of(source).sensing_s;
            let reached = slowest.from(source).into_iter();
            found.extend(reached.map(|(sink, latency)| PathLatency {
                source: self.nodes[source].path.clone(),
                sink: self.nodes[sink].path.clone(),
                ends: [NodeId(source), NodeId(sink)],
                transport_s: sensing_s + latency.transport_s + self.buffers_of(sink).driving_s,
                held_s: latency.transport_s,
                group_delay_s: latency.group_delay_s,
            }));
        }
        found
    }

    /// Is a way's delay told where it ends here?
    fn ends_ways(&self, node: NodeIndex) -> bool {
        let drives = matches!(self.nodes[node].work, Work::Actuator { .. });
        drives || self.nodes.edges(node).next().is_none()
    }

    /// The delay of the filters behind what a source reads, the slowest of its channels.
    fn filtered(&self, node: NodeIndex) -> Latency {
        let Work::Source { device, channels } = &self.nodes[node].work else {
            return Latency::default();
        };
        let device = &self.devices[*device].device;
        let delays = channels.iter().map(|channel| device.group_delay_s(*channel));
        Latency {
            transport_s: 0.0,
            group_delay_s: delays.fold(0.0, f64::max),
        }
    }

    /// What the buffers of a node's device hold back.
    fn buffers_of(&self, node: NodeIndex) -> DeviceLatency {
        let device = self.nodes[node].device();
        device.map_or_else(DeviceLatency::default, |device| {
            self.devices[device].device.latency()
        })
    }

    fn crossing(&self, from: NodeIndex, to: NodeIndex, edge: &Edge) -> Latency {
        let rate = |node: NodeIndex| self.nodes[node].clock.map(|clock| self.clocks[clock].rate);
        let (Some(from), Some(to)) = (rate(from), rate(to)) else {
            return Latency::default();
        };
        let slow_s = from.period_s().max(to.period_s());
        let (transport_s, group_delay_s) = match edge.bridge {
            Bridge::Direct | Bridge::Delay { .. } => (0.0, 0.0),
            Bridge::Hold | Bridge::Average => (0.0, slow_s / 2.0),
            Bridge::Linear => (slow_s, 0.0),
            Bridge::Ring { latency_s } => (latency_s, 0.0),
            Bridge::Resample => (
                resampler(from, to).map_or(0.0, |resampler| resampler.latency_s()),
                0.0,
            ),
        };
        Latency {
            transport_s,
            group_delay_s,
        }
    }
}

/// Before any arrival: a filter that predicts has a delay below zero.
const EARLIEST: Latency = Latency {
    transport_s: 0.0,
    group_delay_s: f64::NEG_INFINITY,
};

/// The slowest ways from a source, by one pass over what it reaches, each node after those before it.
struct Slowest<'g> {
    graph: &'g Graph,
    /// By node: its place in the present pass, and the latest arrival at its inputs so far.
    places: Vec<usize>,
    before: Vec<Latency>,
}

impl<'g> Slowest<'g> {
    fn of(graph: &'g Graph) -> Self {
        let count = graph.nodes.node_count();
        Self {
            graph,
            places: vec![0; count],
            before: vec![Latency::default(); count],
        }
    }

    /// The ends of ways from `source`, in the order of the graph's nodes, each with its delay.
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
                // A loop through rings is followed once: what leads back in it ends there.
                if self.places[target.index()] > place {
                    let arrival = sum(here, graph.crossing(*node, target, edge.weight()));
                    let known = &mut self.before[target.index()];
                    if total(&arrival) > total(known) {
                        *known = arrival;
                    }
                }
            }
            if *node != source && graph.ends_ways(*node) {
                ends.push((*node, here));
            }
        }
        ends.sort_unstable_by_key(|(node, _)| *node);
        ends
    }

    /// What the source reaches, every node after those that lead to it but for loops.
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

/// Is it no declared feedback?
fn leads_on(edge: EdgeReference<'_, Edge>) -> bool {
    !matches!(edge.weight().bridge, Bridge::Delay { .. })
}

fn total(latency: &Latency) -> f64 {
    latency.transport_s + latency.group_delay_s
}

fn sum(a: Latency, b: Latency) -> Latency {
    Latency {
        transport_s: a.transport_s + b.transport_s,
        group_delay_s: a.group_delay_s + b.group_delay_s,
    }
}
