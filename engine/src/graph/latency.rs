//! How late what a source senses reaches a sink, from the graph alone.

use super::{Bridge, Edge, Graph, Work};
use crate::device::DeviceLatency;
use crate::node::Latency;
use crate::run::resampler;
use petgraph::graph::NodeIndex;
use petgraph::visit::EdgeRef;
use std::collections::BTreeMap;

/// The delay from a node without inputs to a node that nothing reads, along the slowest way.
#[derive(Debug, Clone, PartialEq)]
pub struct PathLatency {
    /// Path of the source.
    pub source: String,
    /// Path of the sink.
    pub sink: String,
    /// Both nodes.
    pub ends: [NodeIndex; 2],
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
        for source in self.nodes.externals(petgraph::Incoming) {
            let mut reached: BTreeMap<NodeIndex, Latency> = BTreeMap::new();
            self.follow(source, self.filtered(source), &mut reached, &mut Vec::new());
            let sensing_s = self.buffers_of(source).sensing_s;
            for (sink, latency) in reached {
                let ends = self.nodes.edges(sink).next().is_none();
                let drives = matches!(self.nodes[sink].work, Work::Actuator { .. });
                if sink != source && (ends || drives) {
                    let driving_s = self.buffers_of(sink).driving_s;
                    found.push(PathLatency {
                        source: self.nodes[source].path.clone(),
                        sink: self.nodes[sink].path.clone(),
                        ends: [source, sink],
                        transport_s: sensing_s + latency.transport_s + driving_s,
                        held_s: latency.transport_s,
                        group_delay_s: latency.group_delay_s,
                    });
                }
            }
        }
        found
    }

    /// Goes on from a node that is reached after `before`, where that is later than known.
    fn follow(
        &self,
        node: NodeIndex,
        before: Latency,
        reached: &mut BTreeMap<NodeIndex, Latency>,
        way: &mut Vec<NodeIndex>,
    ) {
        let own = match &self.nodes[node].work {
            Work::Process(processor) => processor.latency(),
            _ => Latency::default(),
        };
        let here = sum(before, own);
        let total = |latency: &Latency| latency.transport_s + latency.group_delay_s;
        // A loop through rings is followed once.
        if way.contains(&node)
            || reached
                .get(&node)
                .is_some_and(|known| total(known) >= total(&here))
        {
            return;
        }
        reached.insert(node, here);
        way.push(node);
        for edge in self.nodes.edges(node) {
            if !matches!(edge.weight().bridge, Bridge::Delay { .. }) {
                let crossing = self.crossing(node, edge.target(), edge.weight());
                self.follow(edge.target(), sum(here, crossing), reached, way);
            }
        }
        way.pop();
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

fn sum(a: Latency, b: Latency) -> Latency {
    Latency {
        transport_s: a.transport_s + b.transport_s,
        group_delay_s: a.group_delay_s + b.group_delay_s,
    }
}
