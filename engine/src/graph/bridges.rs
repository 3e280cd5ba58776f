//! Check of bridges: a connection between clocks needs one.

use super::Bridge;
use super::clocks::Clocks;
use super::draft::{Context, Draft, DraftNode, Wire};
use super::wires::name_of;
use crate::bridges::{BridgeEntry, Direction, Hold, least_ring_latency_s};
use crate::diagnostic::{Diagnostic, Span};
use crate::frame::Kind;
use crate::node::Flow;
use std::cmp::Ordering;

/// Largest ring in frames: 50 MB for wrenches.
const MAX_RING_FRAMES: f64 = 1e6;

/// Checks every bridge and removes unnecessary ones.
pub(super) fn check(cx: &mut Context<'_>, draft: &mut Draft, clocks: &Clocks) {
    for node in 0..draft.nodes.len() {
        for slot in 0..draft.nodes[node].inputs.len() {
            let Some(wire) = draft.nodes[node].inputs[slot].wire.clone() else {
                continue;
            };
            match crossing(cx, draft, clocks, node, slot, &wire) {
                Finding::Sound => {}
                Finding::Needless => {
                    if let Some(wire) = &mut draft.nodes[node].inputs[slot].wire {
                        wire.bridge = None;
                    }
                }
                Finding::Error(diagnostic) => {
                    draft.nodes[node].broken = true;
                    let diagnostic = via(*diagnostic, &wire);
                    let diagnostic = draft.in_use(node, diagnostic, cx);
                    cx.report(diagnostic);
                }
            }
        }
    }
}

enum Finding {
    Sound,
    Needless,
    Error(Box<Diagnostic>),
}

fn error(
    code: &'static str,
    span: Span,
    message: String,
    label: impl Into<String>,
    help: impl Into<String>,
) -> Finding {
    Finding::Error(Box::new(Diagnostic::error(code, span, message).label(label).help(help)))
}

/// Adds the place where a template passes the connection on.
pub(super) fn via(diagnostic: Diagnostic, wire: &Wire) -> Diagnostic {
    match wire.via {
        Some(span) if span != wire.span => diagnostic.also(span, "passed on here"),
        _ => diagnostic,
    }
}

fn crossing(
    cx: &mut Context<'_>,
    draft: &Draft,
    clocks: &Clocks,
    node: usize,
    slot: usize,
    wire: &Wire,
) -> Finding {
    let (from, to) = (&draft.nodes[wire.from], &draft.nodes[node]);
    let port = &to.entry.spec.inputs[to.inputs[slot].port];
    if to.entry.is_file() {
        let Some((bridge, form)) = wire.bridge else {
            return Finding::Sound;
        };
        let message = format!("`{}` takes no bridges", to.entry.spec.name);
        let label = "there is no clock to cross to";
        let help = format!("remove `{}(...)`: a file takes every signal at its own rate", name_of(bridge));
        return error("E0406", form, message, label, help);
    }
    let (Some(a), Some(b)) = (from.clock, to.clock) else {
        return Finding::Sound; // Reported with the clocks.
    };
    let (source, target) = (&clocks.list[a], &clocks.list[b]);
    let Some((bridge, form)) = wire.bridge else {
        if a == b {
            return Finding::Sound;
        }
        let message = format!(
            "`{}` ticks at {} on `{}`, but `{}` runs at {} on `{}`",
            from.output_name(wire.output),
            source.rate,
            source.name,
            to.path,
            target.rate,
            target.name
        );
        let choices = choices(cx, draft, clocks, (a, b), port.flow, wire);
        return error(
            "E0405",
            wire.span,
            message,
            "this connection crosses clocks without a bridge",
            choices,
        );
    };
    if a == b {
        if !matches!(bridge, Bridge::Delay { .. }) {
            if !wire.general {
                let message = format!(
                    "`{}` is unnecessary here: both ends run on clock `{}`",
                    name_of(bridge),
                    source.name
                );
                cx.report(
                    Diagnostic::warning("W0106", form, message)
                        .label("no clock is crossed")
                        .help("remove the bridge"),
                );
            }
            return Finding::Needless;
        }
        return Finding::Sound;
    }
    let slow_to_fast = rate_order(clocks, a, b);
    let two_drivers = source.driver != target.driver;
    if two_drivers && port.flow == Flow::Held {
        let message = format!("a ring cannot carry the held signal that `{}` reads", port.name);
        let label = format!("`{}` and `{}` have different drivers", source.name, target.name);
        let help = format!("send its inputs through the ring and compute it on `{}`", target.name);
        return error("E0406", form, message, label, help);
    }
    if port.flow == Flow::Held && bridge != Bridge::Between(BridgeEntry::of::<Hold>()) {
        let message = format!("`{}` cannot feed `{}`, which reads a held signal", name_of(bridge), port.name);
        let help = "a held input reads frames unchanged: use Hold(...)";
        return error("E0406", form, message, "not a held signal", help);
    }
    let choices = || choices(cx, draft, clocks, (a, b), port.flow, wire);
    let ends = format!("from {} on `{}` to {} on `{}`", source.rate, source.name, target.rate, target.name);
    match bridge {
        Bridge::Delay { .. } => error(
            "E0406",
            form,
            "`Delay` stays on one clock".into(),
            format!("this connection goes {ends}"),
            format!("{}; delay on one side of it", choices()),
        ),
        Bridge::Between(_) if two_drivers => error(
            "E0406",
            form,
            format!("`{}` works within one driver", name_of(bridge)),
            format!("`{}` and `{}` have different drivers", source.name, target.name),
            choices(),
        ),
        Bridge::Ring { .. } if !two_drivers => error(
            "E0406",
            form,
            "`Ring` goes from one driver to another".into(),
            format!("both ends have driver `{}`", clocks.list[source.driver].name),
            choices(),
        ),
        Bridge::Ring { latency_s } => match least_ring_latency_s(source.rate, target.rate) {
            Err(problem) => {
                error("E0406", form, "these rates cannot be resampled".into(), ends, problem.to_string())
            }
            Ok(least_s) if latency_s < least_s => error(
                "E0413",
                form,
                format!(
                    "a ring from {} to {} needs a latency of at least {:.3} ms",
                    source.rate,
                    target.rate,
                    least_s * 1e3
                ),
                format!("{} ms is too short", latency_s * 1e3),
                "most of it is the delay of the resampler; for live runs add the longest callbacks of both drivers",
            ),
            Ok(_) if latency_s * source.rate.hz() > MAX_RING_FRAMES => error(
                "E0413",
                form,
                format!("a ring holds at most {MAX_RING_FRAMES} frames"),
                format!("{} ms at {} is too long", latency_s * 1e3, source.rate),
                "choose a shorter latency",
            ),
            Ok(_) => carried(
                from,
                wire,
                Kind::is_linear,
                "send what it is computed from, or the components that you need",
            ),
        },
        Bridge::Between(between) if !between.spec.direction.leads(slow_to_fast) => error(
            "E0406",
            form,
            format!("`{}` goes from {}", between.spec.name, between.spec.direction),
            format!("this connection goes {ends}"),
            choices(),
        ),
        Bridge::Between(between) => {
            if let Err(problem) = between.check(source.rate, target.rate) {
                let message = format!("`{}` cannot connect these rates", between.spec.name);
                return error("E0406", form, message, ends, problem);
            }
            let kind = from.outputs[wire.output].kind;
            let help = match kind.is_some_and(|kind| !kind.spec().bridges.is_empty()) {
                true => choices(),
                false => "use Hold(...), which passes frames as they are".to_owned(),
            };
            carried(from, wire, |kind| between.carries(kind), help)
        }
        Bridge::Direct => Finding::Sound,
    }
}

/// Refuses frames of a kind that the bridge of a connection cannot carry.
fn carried(
    from: &DraftNode,
    wire: &Wire,
    carries: impl Fn(Kind) -> bool,
    help: impl Into<String>,
) -> Finding {
    match (from.outputs[wire.output].kind, wire.bridge) {
        (Some(kind), Some((bridge, form))) if !carries(kind) => error(
            "E0406",
            form,
            format!("`{}` cannot mix frames of {kind}", name_of(bridge)),
            format!("`{}` carries {kind}", from.output_name(wire.output)),
            help,
        ),
        _ => Finding::Sound,
    }
}

impl Direction {
    /// True if a bridge leads from a clock to another whose rates compare so.
    fn leads(self, rates: Ordering) -> bool {
        match self {
            Self::Any => true,
            Self::ToFaster => rates == Ordering::Less,
            Self::ToSlower => rates == Ordering::Greater,
        }
    }
}

fn rate_order(clocks: &Clocks, a: usize, b: usize) -> Ordering {
    let (n, d) = clocks.list[a].rate.parts();
    let (m, e) = clocks.list[b].rate.parts();
    (u128::from(n) * u128::from(e)).cmp(&(u128::from(m) * u128::from(d)))
}

/// Help: the possible bridges and their descriptions.
fn choices(
    cx: &Context<'_>,
    draft: &Draft,
    clocks: &Clocks,
    (a, b): (usize, usize),
    flow: Flow,
    wire: &Wire,
) -> String {
    let kind = draft.nodes[wire.from].outputs[wire.output].kind;
    let linear = kind.is_none_or(Kind::is_linear);
    if clocks.list[a].driver != clocks.list[b].driver {
        let output = draft.nodes[wire.from].output_name(wire.output);
        return match (linear, flow) {
            (true, Flow::Sampled) => format!(
                "their drivers differ; bridge it: Ring(from: \"{output}\", latency_ms: ...), a ring and a resampler that \
                 follows both clocks"
            ),
            _ => "their drivers differ, and a ring carries sampled frames of linear kinds only: send what it is \
                  computed from"
                .to_owned(),
        };
    }
    let hold = BridgeEntry::of::<Hold>();
    let fits = |bridge: &&BridgeEntry| {
        **bridge == hold
            || flow == Flow::Sampled
                && bridge.spec.direction.leads(rate_order(clocks, a, b))
                && kind.is_none_or(|kind| bridge.carries(kind))
    };
    let bridges = cx.registry.bridges().iter().filter(fits);
    let bridges: Vec<String> =
        bridges.map(|bridge| format!("{}(...), {}", bridge.spec.name, bridge.spec.gives)).collect();
    format!("bridge it: {}", bridges.join("; or "))
}
