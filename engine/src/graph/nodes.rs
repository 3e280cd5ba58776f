//! Public access to nodes and connections, without petgraph.

use super::{Edge, Graph, Node};
use crate::node_id::NodeId;
use petgraph::Direction;
use petgraph::graph::{DiGraph, EdgeReference, NodeIndex};
use petgraph::visit::EdgeRef;
use std::ops::Index;

/// The identifier of a node of the graph library.
pub(crate) fn id_of(node: NodeIndex) -> NodeId {
    NodeId::new(node.index())
}

/// The node of the graph library with this identifier.
pub(crate) fn index_of(id: NodeId) -> NodeIndex {
    NodeIndex::new(id.index())
}

/// The nodes of a graph and the connections between them.
#[derive(Clone, Copy)]
pub struct Nodes<'a>(&'a DiGraph<Node, Edge>);

/// A connection and the nodes at its ends.
#[derive(Clone, Copy)]
pub struct Connection<'a> {
    /// The node whose output it reads.
    pub from: NodeId,
    /// The node whose input it feeds.
    pub to: NodeId,
    /// Output, input and bridge.
    pub edge: &'a Edge,
}

/// An output of a use of a template, and the output of a node that it stands for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TemplateOutput {
    /// The use: `texture`.
    pub path: String,
    /// Name of the template's output.
    pub port: String,
    /// The node inside.
    pub node: NodeId,
    /// Index among its outputs.
    pub output: usize,
}

impl TemplateOutput {
    /// As an input names it: `texture.acceleration`.
    pub fn name(&self) -> String {
        format!("{}.{}", self.path, self.port)
    }
}

impl Graph {
    /// The nodes and connections.
    pub fn nodes(&self) -> Nodes<'_> {
        Nodes(&self.nodes)
    }

    /// The outputs of uses of templates.
    pub fn template_outputs(&self) -> &[TemplateOutput] {
        &self.template_outputs
    }

    /// The output with the name that an input of the graph would use: `node.port`, or `node` if it has one output;
    /// `node` may be the use of a template. `None` if no output or several have that name.
    pub(crate) fn output_called(&self, written: &str) -> Option<(NodeId, usize)> {
        let (path, port) = match written.split_once('.') {
            Some((path, port)) => (path, Some(port)),
            None => (written, None),
        };
        if let Some(id) = self.nodes().find(path) {
            let outputs = &self.nodes()[id].outputs;
            return match port {
                Some(port) => Some((id, outputs.iter().position(|output| output.name == port)?)),
                None => (outputs.len() == 1).then_some((id, 0)),
            };
        }
        let of_use = self.template_outputs.iter().filter(|known| known.path == path);
        let mut fitting = of_use.filter(|known| port.is_none_or(|port| known.port == port));
        match (fitting.next(), fitting.next()) {
            (Some(only), None) => Some((only.node, only.output)),
            _ => None,
        }
    }
}

impl<'a> Nodes<'a> {
    /// Number of nodes.
    pub fn len(self) -> usize {
        self.0.node_count()
    }

    /// True if there are no nodes.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// All nodes, in file order.
    pub fn iter(self) -> impl Iterator<Item = &'a Node> {
        self.0.node_weights()
    }

    /// The identifiers of all nodes, in file order.
    pub fn ids(self) -> impl Iterator<Item = NodeId> + 'a {
        self.0.node_indices().map(id_of)
    }

    /// The node with this identifier, if it exists.
    pub fn get(self, id: NodeId) -> Option<&'a Node> {
        self.0.node_weight(index_of(id))
    }

    /// The node with this path.
    pub fn find(self, path: &str) -> Option<NodeId> {
        self.ids().find(|id| self.0[index_of(*id)].path == path)
    }

    /// All connections.
    pub fn connections(self) -> impl Iterator<Item = Connection<'a>> {
        self.0.edge_references().map(Connection::of)
    }

    /// The connections to a node, in the order of its inputs.
    pub fn incoming(self, id: NodeId) -> Vec<Connection<'a>> {
        let edges = self.0.edges_directed(index_of(id), Direction::Incoming);
        let mut all: Vec<_> = edges.map(Connection::of).collect();
        all.sort_by_key(|connection| connection.edge.input);
        all
    }
}

impl Index<NodeId> for Nodes<'_> {
    type Output = Node;

    fn index(&self, id: NodeId) -> &Node {
        &self.0[index_of(id)]
    }
}

impl<'a> Connection<'a> {
    fn of(edge: EdgeReference<'a, Edge>) -> Self {
        Self { from: id_of(edge.source()), to: id_of(edge.target()), edge: edge.weight() }
    }
}
