//! Resolution of one connection to the output of a node.

use super::Bridge;
use super::context::{Context, Entries};
use super::declared::{Target, Wire};
use super::expand::Expanded;
use crate::diagnostic::{Diagnostic, Span};
use crate::document::value::{Body, Name, Shape, Tagged, Value};
use crate::registry::RESERVED;
use crate::settings::{Fields, Reading, Setting, closest};
use haptograph_signal::units::Milliseconds;

/// Largest delay in frames: 100 s at 10 kHz, 0.5 GB for the widest frames.
const MAX_DELAY_FRAMES: f64 = 1e6;
/// Largest latency of a ring, ms.
const MAX_RING_LATENCY_MS: f64 = 1000.0;
/// Largest nesting of templates in a connection.
const MAX_HANDED_ON: usize = 200;

const WRITE_DELAY: &str = "write `Delay(from: \"node.output\", frames: 1)`";
const WRITE_RING: &str = "write `Ring(from: \"node.output\", latency_ms: 10)`";

/// Where a connection stands: its scope, and the number of templates that hand it on.
#[derive(Clone, Copy)]
pub(super) struct At {
    pub scope: usize,
    pub depth: usize,
}

impl At {
    fn inner(self, scope: usize) -> Self {
        Self { scope, depth: self.depth + 1 }
    }
}

/// Resolves a connection to an output; `None` after a reported error.
pub(super) fn resolve(cx: &mut Context<'_>, graph: &Expanded, value: &Value, at: At) -> Option<Wire> {
    if at.depth > MAX_HANDED_ON {
        let message = "this template output leads back to the template's own input, through no node";
        return cx.fail(
            Diagnostic::error("E0408", value.span, message)
                .label("passed from template to template")
                .help("connect the output to a node inside the template: \"node.output\""),
        );
    }
    match &value.shape {
        Shape::String(written) => named(cx, graph, value.span, written, at),
        Shape::Tagged(Tagged { name: Some(form), body }) => match (form.text.as_str(), body) {
            ("Delay", Body::Fields(fields)) => {
                let (from, bridge) = delay(cx, form, fields);
                let wire = resolve(cx, graph, &from?, at.inner(at.scope))?;
                bridged(cx, graph, wire, bridge?, (form.span, value.span), at)
            }
            ("Ring", Body::Fields(fields)) => {
                let (from, bridge) = ring(cx, form, fields);
                let wire = resolve(cx, graph, &from?, at.inner(at.scope))?;
                bridged(cx, graph, wire, bridge?, (form.span, value.span), at)
            }
            ("Input", Body::Tuple(inner)) => match inner.as_slice() {
                [Value { shape: Shape::String(input), .. }] => handed_in(cx, graph, value.span, input, at),
                _ => not_a_connection(cx, value),
            },
            (name, Body::Tuple(inner)) => match (cx.registry.bridge(name), inner.as_slice()) {
                (Some(bridge), [inner]) => {
                    let wire = resolve(cx, graph, inner, at.inner(at.scope))?;
                    bridged(cx, graph, wire, Bridge::Between(bridge), (form.span, value.span), at)
                }
                _ => not_a_connection(cx, value),
            },
            _ => not_a_connection(cx, value),
        },
        _ => not_a_connection(cx, value),
    }
}

fn not_a_connection<T>(cx: &mut Context<'_>, value: &Value) -> Option<T> {
    let (found, span) = match &value.shape {
        Shape::Tagged(Tagged { name: Some(name), .. }) => (format!("`{}`", name.text), name.span),
        _ => (value.describe().to_owned(), value.span),
    };
    let message = format!("expected a connection, found {found}");
    let diagnostic = Diagnostic::error("E0411", span, message).label("expected \"node.output\"");
    let help = match &value.shape {
        Shape::Tagged(Tagged { name: Some(name), .. }) => connection_meant(cx, value, &name.text),
        Shape::Number(_, number) if cx.registry.node("Constant").is_some() => format!(
            "a signal that stays the same is a node: add `\"offset\": Constant(value: {number}, quantity: \"...\")`, with \
             the quantity of this input, to `nodes`, and write `\"offset\"` here"
        ),
        Shape::Number(..) => "a constant signal comes from a node of its own".to_owned(),
        _ => return cx.fail(diagnostic),
    };
    cx.fail(diagnostic.help(help))
}

/// Help for a structure that is no connection.
fn connection_meant(cx: &Context<'_>, value: &Value, name: &str) -> String {
    let bridges = || cx.registry.bridges().iter().map(|bridge| bridge.spec.name);
    match name {
        "Delay" => WRITE_DELAY.to_owned(),
        "Ring" => WRITE_RING.to_owned(),
        "Input" => "write `Input(\"name\")`".to_owned(),
        known if bridges().any(|bridge| bridge == known) => format!("write `{known}(\"node.output\")`"),
        node if value.bare_name().is_some() => {
            format!("the name of a node is written in quotes: `\"{node}\"`")
        }
        unknown => match closest(unknown, bridges().chain(RESERVED)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => {
                let bridges: Vec<&str> = bridges().collect();
                format!("a connection is a name in quotes, or one in {}, Ring or Delay", bridges.join(", "))
            }
        },
    }
}

fn named(cx: &mut Context<'_>, graph: &Expanded, span: Span, written: &str, at: At) -> Option<Wire> {
    let (node, port) = match written.split_once('.') {
        Some((node, port)) => (node, Some(port)),
        None => (written, None),
    };
    match graph.scopes[at.scope].names.get(node) {
        Some(Target::Node(from)) => {
            let source = &graph.nodes[*from];
            let names = || (0..source.output_count()).filter_map(|output| source.port_name(output));
            let known = port.and_then(|port| names().position(|name| name == port));
            let output = match (known, &source.members, source.entry.spec.family()) {
                (Some(known), ..) => known,
                // Any name may be that of a member: the error of the settings is reported.
                (None, None, Some(family)) => family,
                _ => choose(cx, span, (node, source.entry.spec.name), port, &names().collect::<Vec<_>>())?,
            };
            Some(Wire { from: *from, output, bridge: None, general: false, span, via: None })
        }
        Some(Target::Instance(inner)) => {
            let (template, _) = graph.scopes[*inner].template?;
            let document = cx.document;
            let template = &document.templates[template];
            let names: Vec<&str> = template.outputs.iter().map(|(name, _)| name.text.as_str()).collect();
            let output = choose(cx, span, (node, &template.name.text), port, &names)?;
            let wire = resolve(cx, graph, &template.outputs[output].1, at.inner(*inner))?;
            Some(Wire { via: Some(wire.span), span, ..wire })
        }
        Some(Target::Broken) => None,
        None => {
            let diagnostic = unknown_node(cx, graph, span, node, at.scope);
            cx.fail(diagnostic)
        }
    }
}

/// Index of the named output of a node of some kind, or of the only one.
fn choose(
    cx: &mut Context<'_>,
    span: Span,
    (node, kind): (&str, &str),
    port: Option<&str>,
    outputs: &[&str],
) -> Option<usize> {
    let diagnostic = match (port, outputs) {
        (None, [_]) => return Some(0),
        (_, []) => Diagnostic::error("E0203", span, format!("`{node}` has no outputs"))
            .label(format!("`{kind}` has inputs only")),
        (None, several) => {
            let message = format!("`{node}` has {} outputs; name one", several.len());
            let list: Vec<String> = several.iter().map(|output| format!("\"{node}.{output}\"")).collect();
            Diagnostic::error("E0410", span, message)
                .label(format!("which output of this `{kind}`?"))
                .help(format!("write {}", list.join(" or ")))
        }
        (Some(port), outputs) => {
            if let Some(found) = outputs.iter().position(|output| *output == port) {
                return Some(found);
            }
            let diagnostic = Diagnostic::error("E0203", span, format!("`{node}` has no output `{port}`"))
                .label(format!("no such output of `{kind}`"));
            cx.suggest(diagnostic, port, outputs.iter().copied(), "its outputs are", "")
        }
    };
    cx.fail(diagnostic)
}

fn unknown_node(cx: &Context<'_>, graph: &Expanded, span: Span, node: &str, scope: usize) -> Diagnostic {
    let place = &graph.scopes[scope];
    let message = match place.template {
        Some((template, _)) => {
            let template = &cx.document.templates[template].name.text;
            format!("there is no node `{node}` in template `{template}`")
        }
        None => format!("there is no node `{node}`"),
    };
    let diagnostic = Diagnostic::error("E0202", span, message).label("unknown node");
    if place.inputs.contains_key(node) {
        diagnostic.help(format!("`{node}` is an input of the template: write `Input(\"{node}\")`"))
    } else if node.contains('/') {
        diagnostic.help("nodes inside a template can be reached only through its outputs")
    } else {
        cx.suggest(diagnostic, node, cx.in_order(&place.names), "there are", "there are no nodes")
    }
}

fn handed_in(cx: &mut Context<'_>, graph: &Expanded, span: Span, input: &str, at: At) -> Option<Wire> {
    let place = &graph.scopes[at.scope];
    let Some((template, _)) = place.template else {
        return cx.fail(
            Diagnostic::error("E0704", span, "`Input` can only be used inside a template")
                .label("not in a template")
                .help("connect to a node: \"node.output\""),
        );
    };
    match place.inputs.get(input) {
        Some(Some(value)) => {
            let wire = resolve(cx, graph, value, at.inner(place.outer))?;
            Some(Wire { via: Some(span), ..wire })
        }
        Some(None) => None,
        None => {
            let template = &cx.document.templates[template];
            let message = format!("template `{}` has no input `{input}`", template.name.text);
            let diagnostic = Diagnostic::error("E0209", span, message).label("unknown input");
            let known = template.inputs.iter().map(|name| name.text.as_str());
            let none = format!("declare it: `inputs: [\"{input}\"]`");
            cx.fail(cx.suggest(diagnostic, input, known, "its inputs are", &none))
        }
    }
}

/// Adds a bridge to a connection: places of its name and of the whole.
fn bridged(
    cx: &mut Context<'_>,
    graph: &Expanded,
    wire: Wire,
    bridge: Bridge,
    (form, span): (Span, Span),
    at: At,
) -> Option<Wire> {
    if let Some((first, inner)) = wire.bridge {
        let message =
            format!("this connection is bridged twice, by `{}` and `{}`", first.name(), bridge.name());
        return cx.fail(
            Diagnostic::error("E0407", form, message)
                .label("the second bridge")
                .also(inner, "the first bridge")
                .help("keep one of them; for two steps put a node between"),
        );
    }
    // A connection passed into a template is shown where it is given, unless the bridge is inside.
    let general = graph.scopes[at.scope].template.is_some();
    Some(Wire { bridge: Some((bridge, form)), general, span, ..wire })
}

/// Takes a field of a bridge; reports that it is missing.
fn needed(
    fields: &mut Fields,
    name: &'static str,
    form: &Name,
    help: &'static str,
    reading: &mut Reading<'_>,
) -> Option<Value> {
    let given = fields.take(name);
    if given.is_none() {
        let diagnostic = Diagnostic::missing(form.span, &format!("`{}`", form.text), name, help);
        reading.diagnostics.push(diagnostic);
    }
    given
}

/// What a `Delay` is written around, and its bridge.
fn delay(cx: &mut Context<'_>, form: &Name, fields: &Entries) -> (Option<Value>, Option<Bridge>) {
    let mut fields = cx.fields(form, Entries::clone(fields));
    cx.reading(|reading| {
        let from = needed(&mut fields, "from", form, WRITE_DELAY, reading);
        let frames =
            needed(&mut fields, "frames", form, "add `frames: 1`, the delay in frames of the clock", reading);
        let frames = frames.and_then(|value| delay_frames(&value, reading));
        let initial = fields.setting("initial", Some(None), None, reading);
        fields.finish(reading);
        let bridge = frames.zip(initial);
        (from, bridge.map(|(frames, initial)| Bridge::Delay { frames: u64::from(frames), initial }))
    })
}

fn delay_frames(value: &Value, reading: &mut Reading<'_>) -> Option<u32> {
    let (message, label, help) = match value.shape {
        Shape::Number(number, _) if number < 1.0 => (
            "a delay has at least 1 frame".to_owned(),
            "must be 1 or more",
            "one frame is the shortest delay that can close a loop",
        ),
        Shape::Number(number, _) if number > MAX_DELAY_FRAMES => (
            format!("a delay has at most {MAX_DELAY_FRAMES} frames"),
            "more than can be kept in memory",
            "give frames of the clock: a second is as many as its rate",
        ),
        _ => return u32::read(value, reading),
    };
    reading.diagnostics.push(Diagnostic::error("E0412", value.span, message).label(label).help(help));
    None
}

/// What a `Ring` is written around, and its bridge.
fn ring(cx: &mut Context<'_>, form: &Name, fields: &Entries) -> (Option<Value>, Option<Bridge>) {
    let mut fields = cx.fields(form, Entries::clone(fields));
    cx.reading(|reading| {
        let from = needed(&mut fields, "from", form, WRITE_RING, reading);
        let range = Some((0.0, MAX_RING_LATENCY_MS));
        let latency_ms = fields.setting::<Milliseconds>("latency_ms", None, range, reading);
        fields.finish(reading);
        (from, latency_ms.map(|latency_ms| Bridge::Ring { latency_s: latency_ms.si() }))
    })
}
