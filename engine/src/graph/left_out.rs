//! Nodes left out by `only`, and the nodes that depend on them.

use super::NodeId;
use super::context::Context;
use super::declared::{Connected, Declared, Target, Wire};
use super::wires::Wired;
use crate::diagnostic::Diagnostic;

/// Removes the nodes that are left out and the nodes that read them. A file sink keeps the remaining inputs of a list.
/// Warns of an actuator sink that is removed without an `only` of its own.
pub(super) fn remove(cx: &mut Context<'_>, graph: Wired) -> Wired {
    // (node, node whose `only` removes it)
    let marked = (0..graph.nodes.len()).filter(|node| graph.nodes[*node].is_left_out);
    let mut found: Vec<(usize, usize)> = marked.map(|node| (node, node)).collect();
    if found.is_empty() {
        return graph;
    }
    let readers = graph.readers(|_, _| true);
    let mut gone = vec![false; graph.nodes.len()];
    while let Some((node, cause)) = found.pop() {
        if std::mem::replace(&mut gone[node], true) {
            continue;
        }
        let left = &graph.nodes[node];
        if left.entry.is_actuator() && !left.is_left_out {
            cx.report_of(left, left_out(left, &graph.nodes[cause]));
        }
        let reading = readers[node].iter().copied();
        let reading = reading.filter(|reader| !goes_on(&graph.nodes[*reader], &gone));
        found.extend(reading.map(|reader| (reader, cause)));
    }
    without(graph, &gone)
}

fn left_out(actuator: &Declared, cause: &Declared) -> Diagnostic {
    let message = format!(
        "actuator `{}` is left out with these endpoints: it depends on `{}`",
        actuator.path, cause.path
    );
    Diagnostic::warning("W0109", actuator.name, message)
        .label("nothing drives its device")
        .also(cause.name, "left out by `only`")
        .help("if that is intended, write the same `only` on the actuator sink; else connect it to another node")
}

/// True if a node is kept without the removed nodes.
fn goes_on(node: &Connected, gone: &[bool]) -> bool {
    let is_there = |wire: &Wire| !gone[wire.from];
    let (listed, single): (Vec<_>, Vec<_>) =
        node.wires().partition(|(slot, _)| node.is_many(&node.inputs[*slot]));
    node.entry.is_file()
        && single.iter().all(|(_, wire)| is_there(wire))
        && (listed.is_empty() || listed.iter().any(|(_, wire)| is_there(wire)))
}

/// The graph without some nodes, the others renumbered.
fn without(mut graph: Wired, gone: &[bool]) -> Wired {
    let mut next = 0;
    let numbers: Vec<Option<usize>> = gone
        .iter()
        .map(|gone| {
            next += usize::from(!gone);
            (!gone).then(|| next - 1)
        })
        .collect();
    let mut is_gone = gone.iter();
    graph.nodes.retain(|_| !is_gone.next().copied().unwrap_or(false));
    for node in &mut graph.nodes {
        node.inputs.retain_mut(|slot| match &mut slot.wire {
            None => true,
            Some(wire) => {
                let number = numbers[wire.from];
                wire.from = number.unwrap_or_default();
                number.is_some()
            }
        });
    }
    graph.template_outputs.retain_mut(|output| {
        let number = numbers[output.node.index()];
        output.node = NodeId::new(number.unwrap_or_default());
        number.is_some()
    });
    for target in graph.scopes.iter_mut().flat_map(|scope| scope.names.values_mut()) {
        if let Target::Node(node) = *target {
            *target = numbers[node].map_or(Target::Broken, Target::Node);
        }
    }
    graph
}
