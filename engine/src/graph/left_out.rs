//! Nodes that are there with another set of endpoints only, and what depends on them.

use super::draft::{Draft, Target, Wire};

/// Takes out the nodes that are left out, and those that read them. A file sink goes on with what is left of a list.
pub(super) fn remove(draft: &mut Draft) {
    let mut found: Vec<usize> = (0..draft.nodes.len())
        .filter(|node| draft.nodes[*node].is_left_out)
        .collect();
    if found.is_empty() {
        return;
    }
    let readers = draft.readers(|_| true);
    let mut gone = vec![false; draft.nodes.len()];
    while let Some(node) = found.pop() {
        if !std::mem::replace(&mut gone[node], true) {
            let reading = readers[node].iter().copied();
            found.extend(reading.filter(|reader| !goes_on(draft, *reader, &gone)));
        }
    }
    keep(draft, &gone);
}

/// Is a node still what was meant without the nodes that are gone?
fn goes_on(draft: &Draft, node: usize, gone: &[bool]) -> bool {
    let target = &draft.nodes[node];
    let is_there = |wire: &Wire| !gone[wire.from];
    let (listed, single): (Vec<_>, Vec<_>) = target
        .wires()
        .partition(|(slot, _)| target.is_many(&target.inputs[*slot]));
    target.entry.is_file()
        && single.iter().all(|(_, wire)| is_there(wire))
        && (listed.is_empty() || listed.iter().any(|(_, wire)| is_there(wire)))
}

/// Keeps the nodes that are not gone, under their new numbers.
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
