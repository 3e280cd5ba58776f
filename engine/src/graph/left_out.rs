//! Nodes left out by `only`, and the nodes that depend on them.

use super::draft::{Context, Draft, Target, Wire};
use crate::diagnostic::Diagnostic;

/// Removes the nodes that are left out and the nodes that read them. A file sink keeps the remaining inputs of a list.
/// Warns of an actuator sink that is removed without an `only` of its own.
pub(super) fn remove(cx: &mut Context<'_>, draft: &mut Draft) {
    // (node, node whose `only` removes it)
    let marked = (0..draft.nodes.len()).filter(|node| draft.nodes[*node].is_left_out);
    let mut found: Vec<(usize, usize)> = marked.map(|node| (node, node)).collect();
    if found.is_empty() {
        return;
    }
    let readers = draft.readers(|_| true);
    let mut gone = vec![false; draft.nodes.len()];
    while let Some((node, cause)) = found.pop() {
        if std::mem::replace(&mut gone[node], true) {
            continue;
        }
        if draft.nodes[node].entry.is_actuator() && !draft.nodes[node].is_left_out {
            let warning = left_out(draft, node, cause);
            let warning = draft.in_use(node, warning, cx);
            cx.report(warning);
        }
        let reading = readers[node].iter().copied();
        let reading = reading.filter(|reader| !goes_on(draft, *reader, &gone));
        found.extend(reading.map(|reader| (reader, cause)));
    }
    keep(draft, &gone);
}

fn left_out(draft: &Draft, actuator: usize, cause: usize) -> Diagnostic {
    let (actuator, cause) = (&draft.nodes[actuator], &draft.nodes[cause]);
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
fn goes_on(draft: &Draft, node: usize, gone: &[bool]) -> bool {
    let target = &draft.nodes[node];
    let is_there = |wire: &Wire| !gone[wire.from];
    let (listed, single): (Vec<_>, Vec<_>) =
        target.wires().partition(|(slot, _)| target.is_many(&target.inputs[*slot]));
    target.entry.is_file()
        && single.iter().all(|(_, wire)| is_there(wire))
        && (listed.is_empty() || listed.iter().any(|(_, wire)| is_there(wire)))
}

/// Removes the nodes and renumbers the others.
fn keep(draft: &mut Draft, gone: &[bool]) {
    let mut next = 0;
    let numbers: Vec<Option<usize>> = gone
        .iter()
        .map(|gone| {
            next += usize::from(!gone);
            (!gone).then(|| next - 1)
        })
        .collect();
    let mut is_gone = gone.iter();
    draft.nodes.retain(|_| !is_gone.next().copied().unwrap_or(false));
    for node in &mut draft.nodes {
        node.inputs.retain_mut(|slot| match &mut slot.wire {
            None => true,
            Some(wire) => match numbers[wire.from] {
                Some(number) => {
                    wire.from = number;
                    true
                }
                None => false,
            },
        });
    }
    for target in draft.scopes.iter_mut().flat_map(|scope| scope.names.values_mut()) {
        if let Target::Node(node) = *target {
            *target = numbers[node].map_or(Target::Broken, Target::Node);
        }
    }
}
