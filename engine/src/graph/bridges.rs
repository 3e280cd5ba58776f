//! Check of bridges: a connection between clocks needs one.

use super::Bridge;
use super::clocks::Clocks;
use super::draft::{Context, Draft, DraftNode, Wire};
use super::wires::name_of;
use crate::diagnostic::{Diagnostic, Span};
use crate::joining::least_ring_latency_s;
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
    Finding::Error(Box::new(
        Diagnostic::error(code, span, message).label(label).help(help),
    ))
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
        let help = format!(
            "remove `{}(...)`: a file takes every signal at its own rate",
            name_of(bridge)
        );
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
        let choices = choices(draft, clocks, a, b, port.flow, wire);
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
        let help = format!(
            "send what it is computed from through the ring, and compute it on `{}`",
            target.name
        );
        return error("E0406", form, message, label, help);
    }
    if port.flow == Flow::Held && bridge != Bridge::Hold {
        let message = format!(
            "`{}` cannot feed `{}`, which reads a held signal",
            name_of(bridge),
            port.name
        );
        let help = "a held input reads frames unchanged: use Hold(...)";
        return error("E0406", form, message, "not a held signal", help);
    }
    let choices = || choices(draft, clocks, a, b, port.flow, wire);
    let ends = format!(
        "from {} on `{}` to {} on `{}`",
        source.rate, source.name, target.rate, target.name
    );
    match bridge {
        Bridge::Delay { .. } => error(
            "E0406",
            form,
            "`Delay` stays on one clock".into(),
            format!("this connection goes {ends}"),
            format!("{}; delay on one side of it", choices()),
        ),
        Bridge::Hold | Bridge::Linear | Bridge::Average | Bridge::Resample if two_drivers => error(
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
            Err(problem) => error(
                "E0406",
                form,
                "these rates cannot be resampled".into(),
                ends,
                problem.to_string(),
            ),
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
            Ok(_) => unmixable(
                from,
                wire,
                bridge,
                "send what it is computed from, or the components that you need",
            ),
        },
        Bridge::Linear if slow_to_fast != Ordering::Less => error(
            "E0406",
            form,
            "`Linear` goes from a slow clock to a faster one".into(),
            format!("this connection goes {ends}"),
            choices(),
        ),
        Bridge::Average if slow_to_fast != Ordering::Greater => error(
            "E0406",
            form,
            "`Average` goes from a fast clock to a slower one".into(),
            format!("this connection goes {ends}"),
            choices(),
        ),
        Bridge::Linear | Bridge::Average | Bridge::Resample => unmixable(
            from,
            wire,
            bridge,
            "use Hold(...), which passes frames as they are",
        ),
        Bridge::Hold | Bridge::Direct => Finding::Sound,
    }
}

/// Refuses interpolation of frames that are not linear.
fn unmixable(from: &DraftNode, wire: &Wire, bridge: Bridge, help: &str) -> Finding {
    match (from.outputs[wire.output].kind, wire.bridge) {
        (Some(kind), Some((_, form))) if !kind.is_linear() => error(
            "E0406",
            form,
            format!("`{}` cannot mix frames of {kind}", name_of(bridge)),
            format!("`{}` carries {kind}", from.output_name(wire.output)),
            help,
        ),
        _ => Finding::Sound,
    }
}

fn rate_order(clocks: &Clocks, a: usize, b: usize) -> Ordering {
    let (n, d) = clocks.list[a].rate.parts();
    let (m, e) = clocks.list[b].rate.parts();
    (u128::from(n) * u128::from(e)).cmp(&(u128::from(m) * u128::from(d)))
}

/// Help: the possible bridges and their descriptions.
fn choices(draft: &Draft, clocks: &Clocks, a: usize, b: usize, flow: Flow, wire: &Wire) -> String {
    let linear = draft.nodes[wire.from].outputs[wire.output]
        .kind
        .is_none_or(|kind| kind.is_linear());
    if clocks.list[a].driver != clocks.list[b].driver {
        let output = draft.nodes[wire.from].output_name(wire.output);
        return match (linear, flow) {
            (true, Flow::Sampled) => format!(
                "their drivers differ; bridge it: Ring(from: \"{output}\", latency_ms: ...), a ring and a resampler that \
                 follows both clocks"
            ),
            _ => "their drivers differ, and a ring carries sampled numbers, 3-vectors and wrenches only: send what it is \
                  computed from"
                .to_owned(),
        };
    }
    let mut bridges = vec!["Hold(...), the latest frame"];
    if linear && flow == Flow::Sampled {
        match rate_order(clocks, a, b) {
            Ordering::Less => {
                bridges.push("Linear(...), a straight line between frames, one slow frame late")
            }
            Ordering::Greater => bridges.push("Average(...), the mean of the frames since the last tick"),
            Ordering::Equal => {}
        }
        bridges.push("Resample(...), band-limited");
    }
    format!("bridge it: {}", bridges.join("; or "))
}
