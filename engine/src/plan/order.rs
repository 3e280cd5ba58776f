//! The order in which nodes run, and the islands that run in sub-windows.

use crate::graph::{Bridge, Edge, Graph};
use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};
use petgraph::visit::EdgeRef;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Nodes that run together: one node, or an island closed by delays or by a device.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Group {
    /// In the order in which they run.
    pub members: Vec<NodeIndex>,
    /// The longest windows, in time units, that the island may run at once; empty for a single node.
    pub pacing: Vec<u64>,
}

/// All nodes in groups, every group after the groups that it reads. Ties are broken by path, so that the order in the
/// file does not matter.
pub(crate) fn order(graph: &Graph) -> Vec<Group> {
    let links = with_device_links(graph);
    let path = |node: NodeIndex| graph.nodes[node].path.as_str();
    let sequence = topological(&links, path);
    if sequence.len() == graph.nodes.node_count() {
        let alone = |node| Group { members: vec![node], pacing: Vec::new() };
        return sequence.into_iter().map(alone).collect();
    }
    let mut group_of = vec![0_usize; graph.nodes.node_count()];
    // Iterative, unlike Tarjan's as petgraph has it: a long chain must not overflow the stack.
    let mut groups: Vec<Vec<NodeIndex>> = kosaraju_scc(&links);
    for (number, members) in groups.iter_mut().enumerate() {
        members.sort_by_key(|node| path(*node));
        for member in members {
            group_of[member.index()] = number;
        }
    }
    let mut between = DiGraph::<usize, ()>::new();
    let numbers: Vec<NodeIndex> = (0..groups.len()).map(|number| between.add_node(number)).collect();
    for edge in links.edge_references() {
        let (from, to) = (group_of[edge.source().index()], group_of[edge.target().index()]);
        if from != to {
            between.add_edge(numbers[from], numbers[to], ());
        }
    }
    let first_path = |group: NodeIndex| graph.nodes[groups[group.index()][0]].path.as_str();
    let sequence = topological(&between, first_path);
    debug_assert_eq!(sequence.len(), groups.len(), "groups have no circle between them");
    sequence
        .into_iter()
        .map(|group| {
            let inside = |node: NodeIndex| group_of[node.index()] == group.index();
            island(graph, &links, &groups[group.index()], inside)
        })
        .collect()
}

/// The connections, and for every device with sources and sinks an arrow both ways between them: its sinks act on
/// its sources one tick later, and its sources are read before its sinks are written.
fn with_device_links(graph: &Graph) -> DiGraph<NodeIndex, ()> {
    let mut links = DiGraph::with_capacity(graph.nodes.node_count(), graph.nodes.edge_count());
    for node in graph.nodes.node_indices() {
        links.add_node(node);
    }
    for edge in graph.nodes.edge_references() {
        // What a ring carries has no order: its ends belong to different plans.
        if !matches!(edge.weight().bridge, Bridge::Ring { .. }) {
            links.add_edge(edge.source(), edge.target(), ());
        }
    }
    let mut bound = vec![(Vec::new(), Vec::new()); graph.devices.len()];
    for node in graph.nodes.node_indices() {
        let work = &graph.nodes[node].work;
        work.source_device().into_iter().for_each(|device| bound[device].0.push(node));
        work.sink_device().into_iter().for_each(|device| bound[device].1.push(node));
    }
    for (sources, sinks) in bound {
        for (source, sink) in sources.iter().flat_map(|source| sinks.iter().map(move |sink| (*source, *sink)))
        {
            links.add_edge(sink, source, ());
            links.add_edge(source, sink, ());
        }
    }
    links
}

/// The members in the order in which they run; `inside` is true for members.
fn island(
    graph: &Graph,
    links: &DiGraph<NodeIndex, ()>,
    members: &[NodeIndex],
    inside: impl Fn(NodeIndex) -> bool,
) -> Group {
    let looped = members.len() > 1 || links.find_edge(members[0], members[0]).is_some();
    if !looped {
        return Group { members: members.to_vec(), pacing: Vec::new() };
    }
    let mut local = DiGraph::<NodeIndex, ()>::new();
    let numbers: Vec<NodeIndex> = members.iter().map(|node| local.add_node(*node)).collect();
    // Members are sorted by path.
    let path = |node: NodeIndex| graph.nodes[node].path.as_str();
    let number = |node: NodeIndex| {
        let place = members.binary_search_by(|member| path(*member).cmp(path(node)));
        place.ok().map(|place| numbers[place])
    };
    let mut pacing = Vec::new();
    for edge in
        members.iter().flat_map(|member| graph.nodes.edges(*member)).filter(|edge| inside(edge.target()))
    {
        if let Some(frames) = delay_frames(edge.weight()) {
            let clock = graph.nodes[edge.target()].clock.unwrap_or(0);
            pacing.push(graph.base.period(clock).saturating_mul(frames));
        } else if let (Some(from), Some(to)) = (number(edge.source()), number(edge.target())) {
            local.add_edge(from, to, ());
        }
    }
    let read =
        |device: &usize| members.iter().any(|node| graph.nodes[*node].work.source_device() == Some(*device));
    for device in members.iter().filter_map(|node| graph.nodes[*node].work.sink_device()).filter(read) {
        pacing.push(graph.base.period(graph.devices[device].clock));
        // A device is read before it is written, whatever the alphabet says.
        for (source, sink) in members
            .iter()
            .zip(&numbers)
            .flat_map(|source| members.iter().zip(&numbers).map(move |sink| (source, sink)))
        {
            let reads = graph.nodes[*source.0].work.source_device() == Some(device);
            if reads && graph.nodes[*sink.0].work.sink_device() == Some(device) {
                local.add_edge(*source.1, *sink.1, ());
            }
        }
    }
    pacing.sort_unstable();
    pacing.dedup();
    let sequence = topological(&local, |node| path(local[node]));
    debug_assert_eq!(sequence.len(), local.node_count(), "a checked graph has no circle through wires");
    let members = sequence.into_iter().map(|node| local[node]).collect();
    Group { members, pacing }
}

pub(crate) fn delay_frames(edge: &Edge) -> Option<u64> {
    if let Bridge::Delay { frames, .. } = edge.bridge { Some(frames) } else { None }
}

/// Kahn's algorithm, the alphabetically first ready node first; without the nodes of circles and those behind them.
fn topological<'a, N>(graph: &DiGraph<N, ()>, key: impl Fn(NodeIndex) -> &'a str) -> Vec<NodeIndex> {
    let mut waiting: Vec<usize> =
        graph.node_indices().map(|node| graph.edges_directed(node, petgraph::Incoming).count()).collect();
    let entry = |node: NodeIndex| Reverse((beginning(key(node)), key(node), node.index()));
    let mut ready: BinaryHeap<Reverse<(u64, &str, usize)>> =
        graph.node_indices().filter(|node| waiting[node.index()] == 0).map(entry).collect();
    let mut sequence = Vec::with_capacity(graph.node_count());
    while let Some(Reverse((.., index))) = ready.pop() {
        let node = NodeIndex::new(index);
        sequence.push(node);
        for next in graph.neighbors(node) {
            waiting[next.index()] -= 1;
            if waiting[next.index()] == 0 {
                ready.push(entry(next));
            }
        }
    }
    sequence
}

/// The first bytes of a text, in whose order it is: most comparisons need no more.
fn beginning(text: &str) -> u64 {
    let mut first = [0; 8];
    let length = text.len().min(first.len());
    first[..length].copy_from_slice(&text.as_bytes()[..length]);
    u64::from_be_bytes(first)
}
