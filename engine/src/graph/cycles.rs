//! Feedback: every loop needs a declared delay.

use super::Bridge;
use super::draft::{Context, Draft, Wire};
use crate::diagnostic::Diagnostic;
use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};
use std::collections::VecDeque;

/// Largest number of nodes shown of a loop.
const SHOWN: usize = 12;

/// Reports one loop of every group of nodes that reach each other without a delay. Devices delay by a tick, so
/// loops through them are sound.
pub(super) fn check(cx: &mut Context<'_>, draft: &mut Draft) {
    let mut graph: DiGraph<(), ()> = DiGraph::with_capacity(draft.nodes.len(), draft.nodes.len());
    for _ in &draft.nodes {
        graph.add_node(());
    }
    for (to, node) in draft.nodes.iter().enumerate() {
        for (_, wire) in node.wires().filter(|(_, wire)| immediate(wire)) {
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
        let itself = draft.nodes[first].wires().any(|(_, wire)| wire.from == first && immediate(wire));
        if group.len() == 1 && !itself {
            continue;
        }
        let way = shortest_loop(draft, &group, first);
        report(cx, draft, &way);
    }
}

fn immediate(wire: &Wire) -> bool {
    !matches!(wire.bridge, Some((Bridge::Delay { .. } | Bridge::Ring { .. }, _)))
}

/// The connections of a shortest loop through `first`: (node, slot) of each reader, in the order of flow.
fn shortest_loop(draft: &Draft, group: &[usize], first: usize) -> Vec<(usize, usize)> {
    let inside = |node: usize| group.binary_search(&node);
    // Backwards from `first`, so that a node's inputs are all that is needed.
    let mut next: Vec<Option<(usize, usize)>> = vec![None; group.len()];
    let mut queue = VecDeque::from([first]);
    while let Some(node) = queue.pop_front() {
        for (slot, wire) in draft.nodes[node].wires().filter(|(_, wire)| immediate(wire)) {
            let Ok(place) = inside(wire.from) else { continue };
            if next[place].is_none() {
                next[place] = Some((node, slot));
                queue.push_back(wire.from);
            }
        }
    }
    let mut way = Vec::new();
    let mut at = first;
    while let Some(step) = inside(at).ok().and_then(|place| next[place]) {
        way.push(step);
        at = step.0;
        if at == first || way.len() > group.len() {
            break;
        }
    }
    way
}

fn report(cx: &mut Context<'_>, draft: &mut Draft, way: &[(usize, usize)]) {
    let wire = |(node, slot): (usize, usize)| draft.nodes[node].inputs[slot].wire.as_ref();
    let Some((closing, back)) = way.last().and_then(|step| Some((*step, wire(*step)?))) else {
        return;
    };
    let mut names: Vec<&str> = way
        .iter()
        .take(SHOWN)
        .filter_map(|step| Some(draft.nodes[wire(*step)?.from].path.as_str()))
        .collect();
    if way.len() > SHOWN {
        names.push("...");
    }
    names.push(&draft.nodes[closing.0].path);
    let message = format!("a loop without delay: {}", names.join(" -> "));
    let mut diagnostic = Diagnostic::error("E0408", back.span, message).label("the loop closes here");
    for step in way.iter().take(way.len() - 1).take(SHOWN) {
        if let Some(wire) = wire(*step).filter(|wire| wire.span != back.span) {
            let text = format!("to `{}`", draft.nodes[step.0].path);
            diagnostic = diagnostic.also(wire.span, text);
        }
    }
    let from = draft.nodes[back.from].output_name(back.output);
    let diagnostic = diagnostic.help(format!(
        "feedback needs a declared delay: `Delay(from: \"{from}\", frames: 1)` on one of these"
    ));
    cx.report(diagnostic);
    for step in way {
        draft.nodes[step.0].broken = true;
    }
}
