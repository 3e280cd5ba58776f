//! The ends of rings, by which a plan receives from other drivers and sends to them.

use super::Builder;
use crate::graph::{Bridge, Input, Node};
use crate::io::Form;
use crate::plan::RingSpec;
use crate::plan::order::Group;
use crate::plan::{RingPlan, StepWork};
use petgraph::graph::{EdgeIndex, NodeIndex};
use petgraph::visit::EdgeRef;

impl Builder<'_> {
    /// Reads the rings from other drivers ahead of the group, so that an island has a whole block.
    pub(super) fn ring_reads(&mut self, group: &Group) {
        for member in &group.members {
            for (edge, plan) in self.rings_of(*member, petgraph::Incoming) {
                let clock = self.graph.nodes[*member].clock.unwrap_or(0);
                let (label, width) = (format!("ring {}", plan.ring.name), plan.ring.kind.width());
                self.plan.ring_reads.push(plan);
                let work = StepWork::RingRead(self.plan.ring_reads.len() as u32 - 1);
                let step = self.step(work, clock, *member, label);
                let ports = self.allot(step, clock, [width].into_iter());
                self.rings.insert(edge, ports[0]);
            }
        }
    }

    /// Writes the rings to other drivers after the group.
    pub(super) fn ring_writes(&mut self, group: &Group) {
        for member in &group.members {
            for (edge, plan) in self.rings_of(*member, petgraph::Outgoing) {
                let port = self.ports[member.index()][self.graph.nodes[edge].output];
                let label = format!("send {}", plan.ring.name);
                self.plan.ring_writes.push(plan);
                let work = StepWork::RingWrite(self.plan.ring_writes.len() as u32 - 1);
                let step = self.step(work, port.clock as usize, *member, label);
                self.bind(step, port, Form::Sampled);
            }
        }
    }

    /// The rings at one side of a node, in an order that does not depend on the file's.
    fn rings_of(&self, node: NodeIndex, side: petgraph::Direction) -> Vec<(EdgeIndex, RingPlan)> {
        let graph = self.graph;
        let rate = |node: NodeIndex| {
            let clock = graph.nodes[node].clock.unwrap_or(0);
            (clock, graph.clocks[clock].rate)
        };
        let mut rings = Vec::new();
        for edge in graph.nodes.edges_directed(node, side) {
            let Bridge::Ring { latency_s } = edge.weight().bridge else {
                continue;
            };
            let (from, to) = (edge.source(), edge.target());
            let output = &graph.nodes[from].outputs[edge.weight().output];
            let ((_, from_rate), (to_clock, to_rate)) = (rate(from), rate(to));
            let ring = RingSpec {
                name: format!(
                    "{}.{} to {}",
                    graph.nodes[from].path,
                    output.name,
                    input_name(&graph.nodes[to], edge.weight().input)
                ),
                kind: output.kind,
                from: from_rate,
                to: to_rate,
                latency_s,
                max_to: self.most_frames(to_clock),
            };
            let plan = RingPlan { edge: edge.id(), ring };
            rings.push((edge.weight().input, plan.edge, plan));
        }
        rings.sort_by(|a, b| (&a.2.ring.name, a.0).cmp(&(&b.2.ring.name, b.0)));
        rings.into_iter().map(|(_, edge, plan)| (edge, plan)).collect()
    }
}

/// `drive.force`; for an input with several connections also the name or number of the connection: `mix.inputs hum`,
/// `mix.inputs 2`.
fn input_name(node: &Node, input: usize) -> String {
    let Input { name, label, .. } = &node.inputs[input];
    if let Some(label) = label {
        return format!("{}.{name} {label}", node.path);
    }
    let alike = |inputs: &[Input]| inputs.iter().filter(|other| other.name == *name).count();
    match alike(&node.inputs) {
        1 => format!("{}.{name}", node.path),
        _ => format!("{}.{name} {}", node.path, alike(&node.inputs[..=input])),
    }
}
