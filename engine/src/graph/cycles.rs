//! Feedback: every loop needs a declared delay.

use super::context::Context;
use super::declared::Wire;
use super::devices::Bound;
use crate::diagnostic::Diagnostic;
use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};
use std::collections::VecDeque;

/// Largest number of nodes shown of a loop.
const SHOWN: usize = 12;

/// Reports one loop of every group of nodes that reach each other without a delay. Devices delay by a tick, so
/// loops through them are sound.
pub(super) fn check(cx: &mut Context<'_>, bound: &Bound) {
    if has_no_loop(bound) {
        return;
    }
    let mut graph: DiGraph<(), ()> = DiGraph::with_capacity(bound.nodes.len(), bound.nodes.len());
    for _ in &bound.nodes {
        graph.add_node(());
    }
    for (to, node) in bound.nodes.iter().enumerate() {
        for (_, wire) in node.wires().filter(|(_, wire)| wire.is_immediate()) {
            graph.add_edge(NodeIndex::new(wire.from), NodeIndex::new(to), ());
        }
    }
    // Iterative, unlike Tarjan's as petgraph has it: a long chain must not overflow the stack.
    let mut loops: Vec<Vec<usize>> = kosaraju_scc(&graph)
        .into_iter()
        .map(|group| group.into_iter().map(NodeIndex::index).collect())
        .collect();
    for group in &mut loops {
        group.sort_unstable();
    }
    loops.sort_unstable();
    for group in loops {
        let first = group[0];
        let itself = bound.nodes[first].wires().any(|(_, wire)| wire.from == first && wire.is_immediate());
        if group.len() == 1 && !itself {
            continue;
        }
        let way = shortest_loop(bound, &group, first);
        report(cx, bound, &way);
        for step in way {
            cx.blame(&bound.nodes[step.node]);
        }
    }
}

/// True if every node can come after all that it reads without a delay.
fn has_no_loop(bound: &Bound) -> bool {
    let immediate = |node: usize| bound.nodes[node].wires().filter(|(_, wire)| wire.is_immediate());
    let readers = bound.readers(|_, wire| wire.is_immediate());
    let mut waiting: Vec<usize> = (0..bound.nodes.len()).map(|node| immediate(node).count()).collect();
    let mut ready: Vec<usize> = (0..bound.nodes.len()).filter(|node| waiting[*node] == 0).collect();
    let mut passed = 0;
    while let Some(node) = ready.pop() {
        passed += 1;
        for &reader in &readers[node] {
            waiting[reader] -= 1;
            if waiting[reader] == 0 {
                ready.push(reader);
            }
        }
    }
    passed == bound.nodes.len()
}

/// A connection of a loop, and the node that it leads to.
#[derive(Clone, Copy)]
struct Step<'g> {
    node: usize,
    wire: &'g Wire,
}

/// The connections of a shortest loop through `first`, in the order of flow.
fn shortest_loop<'g>(graph: &'g Bound, group: &[usize], first: usize) -> Vec<Step<'g>> {
    let inside = |node: usize| group.binary_search(&node);
    // Backwards from `first`, so that a node's inputs are all that is needed.
    let mut next: Vec<Option<Step<'_>>> = vec![None; group.len()];
    let mut queue = VecDeque::from([first]);
    while let Some(node) = queue.pop_front() {
        for (_, wire) in graph.nodes[node].wires().filter(|(_, wire)| wire.is_immediate()) {
            let Ok(place) = inside(wire.from) else { continue };
            if next[place].is_none() {
                next[place] = Some(Step { node, wire });
                queue.push_back(wire.from);
            }
        }
    }
    let mut way = Vec::new();
    let mut at = first;
    while let Some(step) = inside(at).ok().and_then(|place| next[place]) {
        way.push(step);
        at = step.node;
        if at == first || way.len() > group.len() {
            break;
        }
    }
    way
}

fn report(cx: &mut Context<'_>, graph: &Bound, way: &[Step<'_>]) {
    let Some((closing, others)) = way.split_last() else { return };
    let mut names: Vec<&str> =
        way.iter().take(SHOWN).map(|step| &*graph.nodes[step.wire.from].path).collect();
    if way.len() > SHOWN {
        names.push("...");
    }
    names.push(&graph.nodes[closing.node].path);
    let back = closing.wire;
    let message = format!("a loop without delay: {}", names.join(" -> "));
    let mut diagnostic = Diagnostic::error("E0408", back.span, message).label("the loop closes here");
    for step in others.iter().take(SHOWN).filter(|step| step.wire.span != back.span) {
        diagnostic = diagnostic.also(step.wire.span, format!("to `{}`", graph.nodes[step.node].path));
    }
    let from = graph.source_name(back);
    cx.report(diagnostic.help(format!(
        "feedback needs a declared delay: `Delay(from: \"{from}\", frames: 1)` on one of these"
    )));
}
