//! A graph as a run knows it.

use super::{Plan, PlanOptions};
use crate::graph::fingerprint::of_graph;
use crate::graph::{Graph, GraphDevice, Work};
use crate::node::{FileSink, OfflineOnly, Stream};
use crate::node_id::NodeId;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A node and the index of one of its outputs.
type Port = (NodeId, usize);

/// A checked graph, as it is handed to a run: the run plans it, with the outputs that it taps, and asks for the files and
/// signals of its nodes. Made from a reference to the graph.
#[derive(Debug, Clone, Copy)]
pub struct Planner<'g>(&'g Graph);

impl<'g> From<&'g Graph> for Planner<'g> {
    fn from(graph: &'g Graph) -> Self {
        Self(graph)
    }
}

impl<'g> From<&'g Arc<Graph>> for Planner<'g> {
    fn from(graph: &'g Arc<Graph>) -> Self {
        Self(graph)
    }
}

impl<'g> Planner<'g> {
    /// At least one plan, one for each driver.
    pub(crate) fn plans(self, options: &PlanOptions) -> Vec<Plan> {
        Plan::of(self.0, options)
    }

    /// The devices of the graph.
    pub(crate) fn devices(self) -> &'g [GraphDevice] {
        self.0.devices()
    }

    /// Returns an error if the graph has a scripted node.
    pub(crate) fn refuse_scripts(self) -> Result<(), OfflineOnly> {
        self.0.refuse_scripts()
    }

    /// The file sinks, in file order.
    pub(crate) fn file_sinks(self) -> impl Iterator<Item = (NodeId, &'g dyn FileSink)> {
        let nodes = self.0.nodes();
        nodes.ids().filter_map(move |id| match &nodes.get(id)?.work {
            Work::File(sink) => Some((id, &**sink)),
            _ => None,
        })
    }

    /// The outputs that a node reads, in the order of its inputs.
    pub(crate) fn read_by(self, node: NodeId) -> Vec<Port> {
        let connections = self.0.nodes().incoming(node).into_iter();
        connections.map(|read| (read.from, read.edge.output)).collect()
    }

    /// The outputs of all nodes, in file order.
    pub(crate) fn outputs(self) -> impl Iterator<Item = Port> {
        let nodes = self.0.nodes();
        nodes.ids().flat_map(move |id| (0..nodes[id].outputs.len()).map(move |output| (id, output)))
    }

    /// Description of an output's signal.
    pub(crate) fn stream(self, (node, output): Port) -> Stream {
        self.0.stream(node, output)
    }

    /// Name of the driver of a node's clock; `None` for a file sink.
    pub(crate) fn driver_name(self, node: NodeId) -> Option<&'g str> {
        let driver = self.0.driver_of(node)?;
        Some(&self.0.clocks()[driver].name)
    }

    /// For every node, by index: whether connections lead from it to this one.
    pub(crate) fn leading_to(self, to: NodeId) -> Vec<bool> {
        self.0.leading_to(to)
    }

    /// Hashes by name of everything that determines the graph's samples.
    pub(crate) fn fingerprints(self) -> BTreeMap<String, u64> {
        of_graph(self.0)
    }
}
