//! Resolution of connections to outputs.

use super::draft::{Context, Draft, Slot, Target, Wire};
use super::expand::missing_input;
use super::given::{self, Given};
use super::values::{in_order, suggest};
use super::{Bridge, NodeId, TemplateOutput};
use crate::diagnostic::{Diagnostic, Span};
use crate::document::value::{Body, Name, Shape, Tagged, Value};
use crate::node::Presence;
use crate::registry::RESERVED;
use crate::settings::{Fields, Reading, Setting, closest};
use haptograph_signal::units::Milliseconds;

/// Largest delay in frames: 100 s at 10 kHz, 0.5 GB for the widest frames.
const MAX_DELAY_FRAMES: f64 = 1e6;

/// Largest latency of a ring, ms.
const MAX_RING_LATENCY_MS: f64 = 1000.0;
/// Largest nesting of templates in a connection.
const MAX_HANDED_ON: usize = 200;

/// Resolves every input of every node.
pub(super) fn connect(cx: &mut Context<'_>, draft: &mut Draft) {
    for node in 0..draft.nodes.len() {
        let spec = draft.nodes[node].entry.spec;
        for (port, input) in spec.inputs.iter().enumerate() {
            let given = draft.nodes[node].fields.take(input.name);
            let given = match given {
                Some(value) => given::connections(cx, draft, node, input, value),
                None if input.presence == Presence::Optional => {
                    draft.nodes[node].inputs.push(Slot { port, name: None, wire: None, broken: false });
                    continue;
                }
                None => {
                    if !draft.nodes[node].fields.is_reported(input.name) {
                        let fields = &draft.nodes[node].fields;
                        let kind = Name { span: fields.span, text: spec.name.to_owned() };
                        let mut diagnostic = missing_input(&kind, input.name, input.presence, kind.span);
                        diagnostic.secondary.clear();
                        draft.nodes[node].fields.miss(input.name, diagnostic);
                    }
                    vec![Given::default()]
                }
            };
            let scope = draft.nodes[node].scope;
            for Given { name, value } in given {
                let before = cx.diagnostics.len();
                let wire = value.as_ref().and_then(|value| resolve(cx, draft, scope, value, 0));
                // A number in place of a connection is most likely that of the setting of the same name with a unit.
                if let Some(Value { shape: Shape::Number(_, number), .. }) = &value
                    && let Some(setting) = draft.nodes[node].entry.settings().iter().find(|setting| {
                        let unit = setting.name.strip_prefix(input.name);
                        unit.is_some_and(|unit| unit.starts_with('_'))
                    })
                    && let Some(found) = cx.diagnostics.get_mut(before)
                {
                    found.help = vec![format!("did you mean `{}: {number}`?", setting.name)];
                }
                let broken = wire.is_none();
                draft.nodes[node].inputs.push(Slot { port, name, wire, broken });
            }
        }
    }
}

/// The outputs of nodes to which the outputs of templates are resolved.
pub(super) fn template_outputs(cx: &mut Context<'_>, draft: &Draft) -> Vec<TemplateOutput> {
    let (document, before) = (cx.document, cx.diagnostics.len());
    let mut found = Vec::new();
    for (scope, place) in draft.scopes.iter().enumerate() {
        let Some((template, _)) = place.template else {
            continue;
        };
        for (name, value) in &document.templates[template].outputs {
            // A bridge makes another signal of it.
            let wire = resolve(cx, draft, scope, value, 0).filter(|wire| wire.bridge.is_none());
            found.extend(wire.map(|wire| TemplateOutput {
                path: place.prefix.trim_end_matches('/').to_owned(),
                port: name.text.clone(),
                node: NodeId::new(wire.from),
                output: wire.output,
            }));
        }
    }
    // Outputs that lead nowhere and that nothing reads are no findings.
    cx.diagnostics.truncate(before);
    found
}

/// Resolves a connection to an output; `None` after a reported error.
fn resolve(cx: &mut Context<'_>, draft: &Draft, scope: usize, value: &Value, depth: usize) -> Option<Wire> {
    if depth > MAX_HANDED_ON {
        cx.report(
            Diagnostic::error(
                "E0408",
                value.span,
                "this connection leads back to itself and never reaches a node",
            )
            .label("passed from template to template")
            .help("an output of a template leads back to its own input"),
        );
        return None;
    }
    match &value.shape {
        Shape::String(written) => named(cx, draft, scope, value.span, written, depth),
        Shape::Tagged(Tagged { name: Some(form), body }) => match (form.text.as_str(), body) {
            ("Delay", Body::Fields(fields)) => delayed(cx, draft, scope, value, form, fields, depth),
            ("Ring", Body::Fields(fields)) => ringed(cx, draft, scope, value, form, fields, depth),
            ("Input", Body::Tuple(inner)) => match inner.as_slice() {
                [Value { shape: Shape::String(input), .. }] => {
                    handed_in(cx, draft, scope, value.span, input, depth)
                }
                _ => not_a_connection(cx, value),
            },
            (name, Body::Tuple(inner)) => match (cx.registry.bridge(name), inner.as_slice()) {
                (Some(bridge), [inner]) => {
                    let wire = resolve(cx, draft, scope, inner, depth + 1)?;
                    let bridge = Bridge::Between(bridge);
                    bridged(cx, draft, wire, bridge, form.span, value.span, scope)
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
    let mut diagnostic = Diagnostic::error("E0411", span, message).label("expected \"node.output\"");
    let bridges: Vec<&str> = cx.registry.bridges().iter().map(|bridge| bridge.spec.name).collect();
    if let Shape::Tagged(Tagged { name: Some(name), .. }) = &value.shape {
        diagnostic = match name.text.as_str() {
            "Delay" => diagnostic.help("write `Delay(from: \"node.output\", frames: 1)`"),
            "Ring" => diagnostic.help("write `Ring(from: \"node.output\", latency_ms: 10)`"),
            "Input" => diagnostic.help("write `Input(\"name\")`"),
            known if bridges.contains(&known) => diagnostic.help(format!("write `{known}(\"node.output\")`")),
            node if value.bare_name().is_some() => {
                diagnostic.help(format!("the name of a node is written in quotes: `\"{node}\"`"))
            }
            unknown => match closest(unknown, bridges.iter().copied().chain(RESERVED)) {
                Some(near) => diagnostic.help(format!("did you mean `{near}`?")),
                None => diagnostic.help(format!(
                    "a connection is a name in quotes, or one in {}, Ring or Delay",
                    bridges.join(", ")
                )),
            },
        };
    } else if let Shape::Number(_, number) = &value.shape {
        diagnostic = diagnostic.help(match cx.registry.node("Constant") {
            Some(_) => format!(
                "a signal that stays the same is a node: add `\"offset\": Constant(value: {number}, quantity: \"...\")`, with the quantity of this input, to `nodes`, and write `\"offset\"` here"
            ),
            None => "a constant signal comes from a node of its own".to_owned(),
        });
    }
    cx.report(diagnostic);
    None
}

fn named(
    cx: &mut Context<'_>,
    draft: &Draft,
    scope: usize,
    span: Span,
    written: &str,
    depth: usize,
) -> Option<Wire> {
    let (node, port) = match written.split_once('.') {
        Some((node, port)) => (node, Some(port)),
        None => (written, None),
    };
    match draft.scopes[scope].names.get(node) {
        Some(Target::Node(from)) => {
            let source = &draft.nodes[*from];
            let names: Vec<&str> = source.port_names().collect();
            let output = match (&source.members, source.entry.spec.family()) {
                // Any name may be that of a member: the error of the settings is reported.
                (None, Some(family)) => (names.iter().position(|name| Some(*name) == port)).unwrap_or(family),
                _ => choose(cx, span, node, source.entry.spec.name, port, &names)?,
            };
            Some(Wire { from: *from, output, bridge: None, general: false, span, via: None })
        }
        Some(Target::Instance(inner)) => {
            let (template, _) = draft.scopes[*inner].template?;
            let document = cx.document;
            let template = &document.templates[template];
            let names: Vec<&str> = template.outputs.iter().map(|(name, _)| name.text.as_str()).collect();
            let output = choose(cx, span, node, &template.name.text, port, &names)?;
            let value = &template.outputs[output].1;
            let wire = resolve(cx, draft, *inner, value, depth + 1)?;
            let via = Some(wire.span);
            Some(Wire { span, via, ..wire })
        }
        Some(Target::Broken) => None,
        None => {
            unknown_node(cx, draft, scope, span, node);
            None
        }
    }
}

/// Index of the named output, or of the only one.
fn choose(
    cx: &mut Context<'_>,
    span: Span,
    node: &str,
    kind: &str,
    port: Option<&str>,
    outputs: &[&str],
) -> Option<usize> {
    let diagnostic = match (port, outputs) {
        (None, [_]) => return Some(0),
        (_, []) => Diagnostic::error("E0203", span, format!("`{node}` has no outputs"))
            .label(format!("`{kind}` has inputs only")),
        (None, several) => {
            let diagnostic =
                Diagnostic::error("E0410", span, format!("`{node}` has {} outputs; name one", several.len()))
                    .label(format!("which output of this `{kind}`?"));
            let list: Vec<String> = several.iter().map(|output| format!("\"{node}.{output}\"")).collect();
            diagnostic.help(format!("write {}", list.join(" or ")))
        }
        (Some(port), outputs) => {
            if let Some(found) = outputs.iter().position(|output| *output == port) {
                return Some(found);
            }
            let diagnostic = Diagnostic::error("E0203", span, format!("`{node}` has no output `{port}`"))
                .label(format!("no such output of `{kind}`"));
            suggest(cx, diagnostic, port, outputs.iter().copied(), "its outputs are", "")
        }
    };
    cx.report(diagnostic);
    None
}

fn unknown_node(cx: &mut Context<'_>, draft: &Draft, scope: usize, span: Span, node: &str) {
    let place = &draft.scopes[scope];
    let message = match place.template {
        Some((template, _)) => {
            let template = &cx.document.templates[template].name.text;
            format!("there is no node `{node}` in template `{template}`")
        }
        None => format!("there is no node `{node}`"),
    };
    let diagnostic = Diagnostic::error("E0202", span, message).label("unknown node");
    let diagnostic = if place.inputs.contains_key(node) {
        diagnostic.help(format!("`{node}` is an input of the template: write `Input(\"{node}\")`"))
    } else if node.contains('/') {
        diagnostic.help("what is inside a template is reached through the template's outputs alone")
    } else {
        let known = in_order(cx, &place.names);
        suggest(cx, diagnostic, node, known.into_iter(), "there are", "there are no nodes")
    };
    cx.report(diagnostic);
}

fn handed_in(
    cx: &mut Context<'_>,
    draft: &Draft,
    scope: usize,
    span: Span,
    input: &str,
    depth: usize,
) -> Option<Wire> {
    let place = &draft.scopes[scope];
    let Some((template, _)) = place.template else {
        cx.report(
            Diagnostic::error("E0704", span, "`Input` can only be used inside a template")
                .label("not in a template")
                .help("connect to a node: \"node.output\""),
        );
        return None;
    };
    match place.inputs.get(input) {
        Some(Some(value)) => {
            let wire = resolve(cx, draft, place.outer, value, depth + 1)?;
            let via = Some(span);
            Some(Wire { via, ..wire })
        }
        Some(None) => None,
        None => {
            let template = &cx.document.templates[template];
            let message = format!("template `{}` has no input `{input}`", template.name.text);
            let diagnostic = Diagnostic::error("E0209", span, message).label("unknown input");
            let known = template.inputs.iter().map(|name| name.text.as_str());
            let none = format!("declare it: `inputs: [\"{input}\"]`");
            let diagnostic = suggest(cx, diagnostic, input, known, "its inputs are", &none);
            cx.report(diagnostic);
            None
        }
    }
}

fn bridged(
    cx: &mut Context<'_>,
    draft: &Draft,
    wire: Wire,
    bridge: Bridge,
    form: Span,
    span: Span,
    scope: usize,
) -> Option<Wire> {
    if let Some((first, inner)) = wire.bridge {
        let message =
            format!("this connection is bridged twice, by `{}` and `{}`", name_of(first), name_of(bridge));
        cx.report(
            Diagnostic::error("E0407", form, message)
                .label("the second bridge")
                .also(inner, "the first bridge")
                .help("keep one of them; for two steps put a node between"),
        );
        return None;
    }
    // A connection passed into a template is shown where it is given, unless the bridge is inside.
    let general = draft.scopes[scope].template.is_some();
    Some(Wire { bridge: Some((bridge, form)), general, span, ..wire })
}

/// Name of a bridge in graph files.
pub(super) fn name_of(bridge: Bridge) -> &'static str {
    match bridge {
        Bridge::Direct => "Direct",
        Bridge::Between(bridge) => bridge.spec.name,
        Bridge::Ring { .. } => "Ring",
        Bridge::Delay { .. } => "Delay",
    }
}

/// Takes the field `from` of a bridge.
fn take_from(
    fields: &mut Fields,
    form: &Name,
    example: &'static str,
    reading: &mut Reading<'_>,
) -> Option<Value> {
    let from = fields.take("from");
    if from.is_none() {
        let diagnostic = Diagnostic::error("E0205", form.span, format!("`{}` needs `from`", form.text))
            .label("`from` is missing")
            .help(example);
        reading.diagnostics.push(diagnostic);
    }
    from
}

fn delayed(
    cx: &mut Context<'_>,
    draft: &Draft,
    scope: usize,
    value: &Value,
    form: &Name,
    fields: &[(Name, Value)],
    depth: usize,
) -> Option<Wire> {
    let (from, frames, initial) = cx.reading(|reading| {
        let mut fields = Fields::new("`Delay`".into(), form.span, fields.to_vec(), reading);
        let from = take_from(&mut fields, form, "write `Delay(from: \"node.output\", frames: 1)`", reading);
        let frames = fields.take("frames");
        let initial = fields.setting("initial", Some(None), None, reading);
        let frames = match &frames {
            None => {
                let diagnostic = Diagnostic::error("E0205", form.span, "`Delay` needs `frames`")
                    .label("`frames` is missing")
                    .help("add `frames: 1`, the delay in frames of the clock");
                reading.diagnostics.push(diagnostic);
                None
            }
            Some(value) => match value.shape {
                Shape::Number(number, _) if number < 1.0 => {
                    let diagnostic = Diagnostic::error("E0412", value.span, "a delay has at least 1 frame")
                        .label("must be 1 or more")
                        .help("one frame is the shortest delay that can close a loop");
                    reading.diagnostics.push(diagnostic);
                    None
                }
                Shape::Number(number, _) if number > MAX_DELAY_FRAMES => {
                    let message = format!("a delay has at most {MAX_DELAY_FRAMES} frames");
                    let diagnostic = Diagnostic::error("E0412", value.span, message)
                        .label("more than can be kept in memory")
                        .help("give frames of the clock: a second is as many as its rate");
                    reading.diagnostics.push(diagnostic);
                    None
                }
                _ => u32::read(value, reading),
            },
        };
        fields.finish(reading);
        (from, frames, initial)
    });
    let wire = resolve(cx, draft, scope, &from?, depth + 1)?;
    // The neutral frame written out is the default.
    let kind = draft.nodes[wire.from].outputs[wire.output].kind;
    let is_neutral =
        |value: &f64| kind.is_some_and(|kind| kind.neutral().all(|x| x.to_bits() == value.to_bits()));
    let bridge =
        Bridge::Delay { frames: u64::from(frames?), initial: initial?.filter(|value| !is_neutral(value)) };
    bridged(cx, draft, wire, bridge, form.span, value.span, scope)
}

fn ringed(
    cx: &mut Context<'_>,
    draft: &Draft,
    scope: usize,
    value: &Value,
    form: &Name,
    fields: &[(Name, Value)],
    depth: usize,
) -> Option<Wire> {
    let (from, latency_ms) = cx.reading(|reading| {
        let mut fields = Fields::new("`Ring`".into(), form.span, fields.to_vec(), reading);
        let from =
            take_from(&mut fields, form, "write `Ring(from: \"node.output\", latency_ms: 10)`", reading);
        let range = Some((0.0, MAX_RING_LATENCY_MS));
        let latency_ms = fields.setting::<Milliseconds>("latency_ms", None, range, reading);
        fields.finish(reading);
        (from, latency_ms)
    });
    let wire = resolve(cx, draft, scope, &from?, depth + 1)?;
    let bridge = Bridge::Ring { latency_s: latency_ms?.si() };
    bridged(cx, draft, wire, bridge, form.span, value.span, scope)
}
