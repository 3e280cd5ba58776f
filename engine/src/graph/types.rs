//! Kinds and quantities: inference for outputs, check of inputs.

use super::bridges::via;
use super::draft::{Context, Draft, DraftNode, Slot, Type, Wire};
use crate::diagnostic::Diagnostic;
use crate::document::value::{Shape, Value};
use crate::frame::Kind;
use crate::node::{InputSpec, KindRule, Presence, QuantityRule};
use crate::settings::unknown_choice;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::si_per;
use std::collections::hash_map::Entry;
use std::collections::{HashMap, VecDeque};

/// Quantities that settings name, by node and setting; `None` after a reported error.
type Named = HashMap<(usize, &'static str), Option<Quantity>>;

/// Infers the type of every output and checks every connection.
pub(super) fn check(cx: &mut Context<'_>, draft: &mut Draft) {
    let named = quantities_by_name(cx, draft);
    infer(draft, &named);
    for node in 0..draft.nodes.len() {
        for slot in 0..draft.nodes[node].inputs.len() {
            if let Some(diagnostic) = mismatch(cx, draft, &named, node, slot) {
                draft.nodes[node].broken = true;
                let diagnostic = draft.in_use(node, diagnostic, cx);
                cx.report(diagnostic);
            }
        }
    }
    report_unknown(cx, draft);
}

fn quantities_by_name(cx: &mut Context<'_>, draft: &mut Draft) -> Named {
    let mut named = Named::new();
    for (i, node) in draft.nodes.iter_mut().enumerate() {
        let spec = node.entry.spec;
        let rules = spec.inputs.iter().map(|port| port.quantity);
        for rule in rules.chain(spec.outputs.iter().map(|port| port.quantity)) {
            let QuantityRule::Setting(setting) = rule else {
                continue;
            };
            if let Entry::Vacant(place) = named.entry((i, setting)) {
                let found = quantity_by_name(cx, node, setting);
                node.broken |= found.is_none();
                place.insert(found);
            }
        }
    }
    named
}

fn quantity_by_name(cx: &mut Context<'_>, node: &mut DraftNode, setting: &'static str) -> Option<Quantity> {
    let names = || -> Vec<&'static str> { Quantity::NAMED.iter().map(|(_, name, _)| *name).collect() };
    let given = node.fields.remaining().iter().find(|(name, _)| name.text == setting);
    let (name, span) = match given {
        Some((_, Value { span, shape: Shape::String(name) })) => (name.clone(), *span),
        Some(_) => return None, // Reported when the settings are read.
        None => {
            let specs = node.entry.settings();
            let spec = specs.into_iter().find(|spec| spec.name == setting)?;
            let Some(default) = spec.default else {
                let kind = node.entry.spec.name;
                let message = format!("`{kind}` needs `{setting}`");
                let missing = Diagnostic::error("E0205", node.fields.span, message)
                    .label(format!("`{setting}` is missing"))
                    .help(format!(
                        "add `{setting}: \"...\"`, the name of a quantity, one of {}",
                        names().join(", ")
                    ));
                node.fields.if_missing(setting, Some(missing));
                return None;
            };
            (default.trim_matches('"').to_owned(), node.fields.span)
        }
    };
    let found = Quantity::by_name(&name);
    if found.is_none() {
        let before = cx.diagnostics.len();
        cx.reading(|reading| {
            reading.setting = Some(setting);
            unknown_choice(&name, &names(), span, reading);
        });
        if let (Some(meant), Some(finding)) = (quantity_by_unit(&name), cx.diagnostics.get_mut(before)) {
            finding.help = vec![format!("did you mean `{meant}`? Quantities are written by their names")];
        }
    }
    found
}

/// The name of the quantity whose unit was written in its place: `m/s2`, `m/s²`.
fn quantity_by_unit(unit: &str) -> Option<&'static str> {
    let mut named = Quantity::NAMED.iter();
    let (_, name, _) = named.find(|(quantity, ..)| si_per(unit, *quantity).is_some())?;
    Some(name)
}

/// Infers the types of outputs in the order of their dependencies.
fn infer(draft: &mut Draft, named: &Named) {
    let readers = draft.readers(|_| true);
    let mut queue: VecDeque<usize> = (0..draft.nodes.len()).collect();
    while let Some(node) = queue.pop_front() {
        let mut changed = false;
        for output in 0..draft.nodes[node].outputs.len() {
            let Some(port) = draft.nodes[node].entry.spec.output(output) else {
                continue;
            };
            let known = draft.nodes[node].outputs[output];
            let found = Type {
                kind: known.kind.or_else(|| kind_of(draft, node, port.kind)),
                quantity: known.quantity.or_else(|| quantity_of(draft, named, node, port.quantity)),
            };
            changed |= found != known;
            draft.nodes[node].outputs[output] = found;
        }
        if changed {
            queue.extend(&readers[node]);
        }
    }
}

/// Type of the output that is connected to a slot.
fn arriving(draft: &Draft, slot: &Slot) -> Option<Type> {
    let wire = slot.wire.as_ref()?;
    Some(draft.nodes[wire.from].outputs[wire.output])
}

/// The kind that a rule of `node` stands for, as far as it is known.
fn kind_of(draft: &Draft, node: usize, rule: KindRule) -> Option<Kind> {
    let target = &draft.nodes[node];
    match rule {
        KindRule::Is(kind) => Some(kind),
        // An output without a rule carries scalars.
        KindRule::Linear | KindRule::Any => Some(Kind::SCALAR),
        KindRule::Same(input) => {
            let connected = target.slots_of(input).any(|slot| slot.wire.is_some() || slot.broken);
            if !connected {
                return match port(target, input)?.kind {
                    KindRule::Is(kind) => Some(kind),
                    _ => Some(Kind::SCALAR),
                };
            }
            target.slots_of(input).find_map(|slot| arriving(draft, slot)?.kind)
        }
    }
}

/// The quantity that a rule of `node` stands for, as far as it is known.
fn quantity_of(draft: &Draft, named: &Named, node: usize, rule: QuantityRule) -> Option<Quantity> {
    let target = &draft.nodes[node];
    let of = |input: &'static str| {
        let connected = target.slots_of(input).any(|slot| slot.wire.is_some() || slot.broken);
        if !connected {
            return match port(target, input)?.quantity {
                QuantityRule::Is(quantity) => Some(quantity),
                _ => Some(Quantity::NUMBER),
            };
        }
        target.slots_of(input).find_map(|slot| arriving(draft, slot)?.quantity)
    };
    match rule {
        QuantityRule::Is(quantity) => Some(quantity),
        QuantityRule::Any => Some(Quantity::NUMBER),
        QuantityRule::Same(input) => of(input),
        QuantityRule::Product(a, b) => Some(of(a)?.times(of(b)?)),
        QuantityRule::Quotient(a, b) => Some(of(a)?.per(of(b)?)),
        QuantityRule::PerSecond(input) => Some(of(input)?.per(Quantity::TIME)),
        QuantityRule::TimesSeconds(input) => Some(of(input)?.times(Quantity::TIME)),
        QuantityRule::Setting(setting) => named.get(&(node, setting)).copied().flatten(),
    }
}

fn port<'d>(node: &'d DraftNode, input: &str) -> Option<&'d InputSpec> {
    node.entry.spec.inputs.iter().find(|port| port.name == input)
}

/// True if the connections of this list need one type, because an output or another input depends on it.
fn list_is_uniform(node: &DraftNode, name: &str) -> bool {
    let spec = node.entry.spec;
    let inputs = spec.inputs.iter().map(|port| (port.kind, port.quantity));
    let outputs = spec.outputs.iter().map(|port| (port.kind, port.quantity));
    inputs.chain(outputs).any(|(kind, quantity)| {
        let by_kind = matches!(kind, KindRule::Same(other) if other == name);
        let by_quantity = match quantity {
            QuantityRule::Same(a) | QuantityRule::PerSecond(a) | QuantityRule::TimesSeconds(a) => a == name,
            QuantityRule::Product(a, b) | QuantityRule::Quotient(a, b) => a == name || b == name,
            _ => false,
        };
        by_kind || by_quantity
    })
}

/// The type error of a slot, if any.
fn mismatch(cx: &Context<'_>, draft: &Draft, named: &Named, node: usize, slot: usize) -> Option<Diagnostic> {
    let target = &draft.nodes[node];
    let slot = &target.inputs[slot];
    let port = &target.entry.spec.inputs[slot.port];
    let wire = slot.wire.as_ref()?;
    let carried = draft.nodes[wire.from].outputs[wire.output];
    let from = draft.nodes[wire.from].output_name(wire.output);
    let to = format!("`{}` of `{}`", port.name, target.entry.spec.name);
    let first_in_list = (target.is_many(slot) && list_is_uniform(target, port.name))
        .then(|| target.slots_of(port.name).find_map(|other| arriving(draft, other)))
        .flatten();
    if let Some(kind) = carried.kind {
        let (fits, wanted) = match port.kind {
            KindRule::Is(wanted) => (kind == wanted, format!("takes {}", wanted.spec().one)),
            KindRule::Linear if !kind.is_linear() => {
                let linear = cx.registry.kinds().iter().filter(|kind| kind.is_linear());
                let names: Vec<&str> = linear.map(|kind| kind.spec().name).collect();
                (false, format!("takes linear frames ({})", names.join(", ")))
            }
            KindRule::Same(other) if other != port.name => {
                let wanted = kind_of(draft, node, port.kind)?;
                (kind == wanted, format!("takes {}, like `{other}`", wanted.spec().one))
            }
            _ => match first_in_list.and_then(|first| first.kind) {
                Some(first) => (
                    kind == first,
                    format!("takes signals of one kind, and the first is {}", first.spec().one),
                ),
                None => (true, String::new()),
            },
        };
        if !fits {
            let message = format!("{to} {wanted}, but `{from}` is {}", kind.spec().one);
            let diagnostic =
                Diagnostic::error("E0403", wire.span, message).label(format!("this is {}", kind.spec().one));
            let wanted = match port.kind {
                KindRule::Is(wanted) => Some(wanted),
                _ => None,
            };
            let converters = converters(cx, |input, output| {
                input.kind == KindRule::Is(kind)
                    && wanted.is_some_and(|wanted| output.0 == KindRule::Is(wanted))
            });
            let swapped = wanted.and_then(|wanted| {
                let wanted =
                    Type { kind: Some(wanted), quantity: quantity_of(draft, named, node, port.quantity) };
                swapped(draft, named, node, slot, (carried, wanted))
            });
            let made = || converters.map(|list| format!("{list} makes one from the other"));
            let diagnostic = match swapped.or_else(made) {
                Some(help) => diagnostic.help(help),
                None => diagnostic,
            };
            return Some(via(diagnostic, wire));
        }
    }
    let quantity = carried.quantity?;
    let wanted = match port.quantity {
        QuantityRule::Any => first_in_list?.quantity?,
        QuantityRule::Same(other) if other == port.name => first_in_list?.quantity?,
        rule => quantity_of(draft, named, node, rule)?,
    };
    if quantity == wanted {
        return None;
    }
    let message = match first_in_list {
        Some(_) if !matches!(port.quantity, QuantityRule::Is(_)) => {
            format!(
                "{to} takes signals of one quantity, and the first is {wanted}, but `{from}` is {quantity}"
            )
        }
        _ => format!("{to} takes {wanted}, but `{from}` is {quantity}"),
    };
    let diagnostic = Diagnostic::error("E0404", wire.span, message).label(format!("this is {quantity}"));
    let stated = || {
        let (source, setting) = stated_by(draft, wire).filter(|_| quantity == Quantity::NUMBER)?;
        let name = wanted.name()?;
        Some(format!(
            "`{}` makes a plain number: if it is {name}, write `{setting}: \"{name}\"`",
            source.path
        ))
    };
    let swapped = || {
        let wanted = Type { kind: carried.kind, quantity: Some(wanted) };
        swapped(draft, named, node, slot, (carried, wanted))
    };
    // The node states which quantity it takes.
    let restated = || match (port.quantity, quantity.name()) {
        (QuantityRule::Setting(setting), Some(name)) => {
            Some(format!("write `{setting}: \"{name}\"` if that is intended, or connect {}", word(wanted)))
        }
        _ => None,
    };
    let help =
        stated().or_else(swapped).or_else(restated).unwrap_or_else(|| conversion(cx, quantity, wanted));
    Some(via(diagnostic.help(help), wire))
}

/// The node whose setting states the quantity of a signal, and that setting. Follows nodes that pass on the quantity of an
/// input.
fn stated_by<'d>(draft: &'d Draft, wire: &'d Wire) -> Option<(&'d DraftNode, &'static str)> {
    let mut wire = wire;
    // No chain is longer than the graph; one that closes on itself ends here too.
    for _ in 0..draft.nodes.len() {
        let source = draft.nodes.get(wire.from)?;
        let passed_on = match source.entry.spec.output(wire.output)?.quantity {
            QuantityRule::Setting(setting) => return Some((source, setting)),
            QuantityRule::Same(input) => input,
            _ => return None,
        };
        let inputs = source.entry.spec.inputs;
        let of_input = |slot: &&Slot| inputs[slot.port].name == passed_on;
        wire = source.inputs.iter().find(of_input)?.wire.as_ref()?;
    }
    None
}

/// Help for two swapped inputs: another input has the type that this one needs, and needs the type that this one has.
fn swapped(
    draft: &Draft,
    named: &Named,
    node: usize,
    slot: &Slot,
    (got, wanted): (Type, Type),
) -> Option<String> {
    let target = &draft.nodes[node];
    let ports = target.entry.spec.inputs;
    let takes = |port: &InputSpec| {
        let of_kind = match port.kind {
            KindRule::Is(kind) => got.kind == Some(kind),
            _ => true,
        };
        of_kind && quantity_of(draft, named, node, port.quantity) == got.quantity
    };
    let other = target.inputs.iter().find(|other| {
        other.port != slot.port && arriving(draft, other) == Some(wanted) && takes(&ports[other.port])
    })?;
    Some(format!("did you swap `{}` and `{}`?", ports[slot.port].name, ports[other.port].name))
}

fn word(quantity: Quantity) -> String {
    quantity.name().map_or_else(|| quantity.unit(), str::to_owned)
}

/// Help for converting one quantity into the other.
fn conversion(cx: &Context<'_>, from: Quantity, to: Quantity) -> String {
    let (had, wanted) = (word(from), word(to));
    let direct = converters(cx, |input, output| {
        input.quantity == QuantityRule::Is(from) && output.1 == QuantityRule::Is(to)
    });
    if let Some(list) = direct {
        return format!("{list} turns {had} into {wanted}");
    }
    let by_time = |does: &str, rule: fn(&'static str) -> QuantityRule, how: &str| {
        let list = converters(cx, |input, output| output.1 == rule(input.name))?;
        Some(format!("{wanted} is {had} {how}: {list} {does}"))
    };
    let over_time = match () {
        // Every quantity per second is made of some number per second, which says nothing.
        () if from == Quantity::NUMBER => None,
        () if to == from.per(Quantity::TIME) => {
            by_time("differentiates", QuantityRule::PerSecond, "per second")
        }
        () if to == from.times(Quantity::TIME) => {
            by_time("integrates", QuantityRule::TimesSeconds, "times seconds")
        }
        () => None,
    };
    let stated = || {
        let is_stated = |rule| matches!(rule, QuantityRule::Setting(_));
        let list = converters(cx, |input, output| is_stated(input.quantity) && is_stated(output.1))?;
        Some(format!("{list} turns {had} into {wanted} by a factor that you state"))
    };
    over_time.or_else(stated).unwrap_or_else(|| format!("put a node between that turns {had} into {wanted}"))
}

/// Names of kinds with one required input for which `fits` holds.
fn converters(
    cx: &Context<'_>,
    fits: impl Fn(&InputSpec, (KindRule, QuantityRule)) -> bool,
) -> Option<String> {
    const SHOWN: usize = 3;
    let nodes = cx.registry.nodes().iter().filter(|entry| !entry.has_endpoint());
    let names: Vec<String> = nodes
        .filter(|entry| {
            let mut needed = entry.spec.inputs.iter().filter(|input| input.presence != Presence::Optional);
            let mut outputs = entry.spec.outputs.iter();
            match (needed.next(), needed.next()) {
                (Some(input), None) => outputs.any(|output| fits(input, (output.kind, output.quantity))),
                _ => false,
            }
        })
        .map(|entry| format!("`{}`", entry.spec.name))
        .take(SHOWN)
        .collect();
    (!names.is_empty()).then(|| names.join(" or "))
}

/// Reports the first output whose type cannot be inferred: a loop without input.
fn report_unknown(cx: &mut Context<'_>, draft: &mut Draft) {
    let unsettled = |node: &DraftNode| {
        node.outputs.iter().position(|output| output.kind.is_none() || output.quantity.is_none())
    };
    // Nodes that depend on a reported one are not at fault.
    let mut excused: Vec<bool> =
        draft.nodes.iter().map(|node| node.broken || node.has_broken_input()).collect();
    let readers = draft.readers(|_| true);
    let mut queue: Vec<usize> = (0..draft.nodes.len()).filter(|i| excused[*i]).collect();
    while let Some(node) = queue.pop() {
        for &reader in &readers[node] {
            if !std::mem::replace(&mut excused[reader], true) {
                queue.push(reader);
            }
        }
    }
    let found =
        (0..draft.nodes.len()).find_map(|i| Some((i, unsettled(&draft.nodes[i])?)).filter(|_| !excused[i]));
    if let Some((node, output)) = found {
        let target = &draft.nodes[node];
        let message = format!("cannot infer what `{}` carries", target.output_name(output));
        let diagnostic = Diagnostic::error("E0409", target.fields.span, message)
            .label("its output depends on itself")
            .help("feed the loop from a node whose output has a fixed kind and quantity");
        let diagnostic = draft.in_use(node, diagnostic, cx);
        cx.report(diagnostic);
    }
    for node in &mut draft.nodes {
        node.broken |= unsettled(node).is_some();
    }
}
