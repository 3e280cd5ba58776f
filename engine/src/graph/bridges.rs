//! Check of bridges, which a connection between clocks needs: the sixth form of a graph.

use super::Bridge;
use super::context::Context;
use super::declared::{Connected, Slot, Wire};
use super::types::Typed;
use crate::bridges::{Crossing, End};
use crate::diagnostic::Diagnostic;
use std::ops::Deref;

/// Typed nodes with the bridges of their connections.
pub(super) struct Crossed {
    graph: Typed,
    /// The bridge of each slot of each node: without the unnecessary ones of templates.
    pub bridges: Vec<Vec<Bridge>>,
}

impl Deref for Crossed {
    type Target = Typed;

    fn deref(&self) -> &Typed {
        &self.graph
    }
}

/// Checks every bridge and removes unnecessary ones.
pub(super) fn check(cx: &mut Context<'_>, graph: Typed) -> Crossed {
    let nodes = graph.nodes.iter().enumerate();
    let bridges = nodes.map(|(node, target)| {
        let slots = target.inputs.iter();
        slots.map(|slot| bridge(cx, &graph, (node, target), slot)).collect()
    });
    let bridges = bridges.collect();
    Crossed { graph, bridges }
}

/// The bridge of a slot.
fn bridge(cx: &mut Context<'_>, graph: &Typed, (node, target): (usize, &Connected), slot: &Slot) -> Bridge {
    let Some(wire) = &slot.wire else { return Bridge::Direct };
    let written = wire.bridge.map_or(Bridge::Direct, |(bridge, _)| bridge);
    let error = match (graph.clock_of[wire.from], graph.clock_of[node]) {
        _ if target.entry.is_file() => into_file(target, wire),
        // Reported with the clocks.
        (None, _) | (_, None) => None,
        (Some(a), Some(b)) if a == b => return on_one_clock(cx, graph, a, wire),
        (Some(a), Some(b)) => crossing(cx, graph, (a, b), target, slot, wire),
    };
    if let Some(error) = error {
        cx.refuse(target, wire.via(error));
    }
    written
}

fn into_file(target: &Connected, wire: &Wire) -> Option<Diagnostic> {
    let (bridge, form) = wire.bridge?;
    let message = format!("`{}` takes no bridges", target.entry.spec.name);
    let help = format!("remove `{}(...)`: a file takes every signal at its own rate", bridge.name());
    let diagnostic = Diagnostic::error("E0406", form, message);
    Some(diagnostic.label("there is no clock to cross to").help(help))
}

/// The bridge of a connection that crosses no clocks: a delay or none.
fn on_one_clock(cx: &mut Context<'_>, graph: &Typed, clock: usize, wire: &Wire) -> Bridge {
    let (bridge, form) = match wire.bridge {
        None => return Bridge::Direct,
        Some((delay @ Bridge::Delay { .. }, _)) => return delay,
        Some(needless) => needless,
    };
    if !wire.general {
        let clock = &graph.clocks.list[clock].name;
        let message = format!("`{}` is unnecessary here: both ends run on clock `{clock}`", bridge.name());
        let warning = Diagnostic::warning("W0106", form, message);
        cx.report(warning.label("no clock is crossed").help("remove the bridge"));
    }
    Bridge::Direct
}

/// The error of a connection from clock `a` to clock `b`.
fn crossing(
    cx: &Context<'_>,
    graph: &Typed,
    (a, b): (usize, usize),
    target: &Connected,
    slot: &Slot,
    wire: &Wire,
) -> Option<Diagnostic> {
    let clocks = &graph.clocks.list;
    let end = |clock: usize| End {
        clock: &clocks[clock].name,
        rate: clocks[clock].rate,
        driver: &clocks[clocks[clock].driver].name,
    };
    let port = &target.entry.spec.inputs[slot.port];
    let crossing = Crossing {
        from: end(a),
        to: end(b),
        output: graph.source_name(wire),
        kind: graph.carried(wire).kind,
        input: port.name,
        flow: port.flow,
        bridges: cx.registry.bridges(),
    };
    let (bridge, form) = match wire.bridge {
        Some(written) => written,
        None => {
            let Crossing { from, to, output, .. } = &crossing;
            let message = format!(
                "`{output}` ticks at {} on `{}`, but `{}` runs at {} on `{}`",
                from.rate, from.clock, target.path, to.rate, to.clock
            );
            let diagnostic = Diagnostic::error("E0405", wire.span, message);
            let label = "this connection crosses clocks without a bridge";
            return Some(diagnostic.label(label).help(crossing.choices()));
        }
    };
    let checked = match bridge {
        Bridge::Direct => Ok(()),
        Bridge::Delay { .. } => crossing.delay(),
        Bridge::Ring { latency_s } => crossing.ring(latency_s),
        Bridge::Between(between) => crossing.between(between),
    };
    let refusal = checked.err()?;
    Some(Diagnostic::error(refusal.code, form, refusal.message).label(refusal.label).help(refusal.help))
}
