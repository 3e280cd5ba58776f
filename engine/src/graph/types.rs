//! Kinds and quantities: inference for outputs, and the fifth form of a graph.

use super::clocks::Clocked;
use super::context::Context;
use super::declared::{Connected, Slot, Wire};
use super::wires::Readers;
use crate::diagnostic::Diagnostic;
use crate::document::value::{Shape, Value};
use crate::frame::Kind;
use crate::node::{InputSpec, KindRule, QuantityRule};
use crate::settings::unknown_choice;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::si_per;
use std::collections::hash_map::Entry;
use std::collections::{HashMap, VecDeque};
use std::ops::Deref;

/// Type of an output, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Type {
    pub kind: Option<Kind>,
    pub quantity: Option<Quantity>,
}

/// Clocked nodes with the types of their outputs.
pub(super) struct Typed {
    graph: Clocked,
    /// Types of the outputs of each node, complete unless an error was reported.
    pub types: Vec<Vec<Type>>,
    /// Quantities that settings name, by node and setting; `None` after a reported error.
    named: HashMap<(usize, &'static str), Option<Quantity>>,
    /// All readers of each node.
    pub readers: Readers,
}

impl Deref for Typed {
    type Target = Clocked;

    fn deref(&self) -> &Clocked {
        &self.graph
    }
}

/// Infers the type of every output.
pub(super) fn infer(cx: &mut Context<'_>, graph: Clocked) -> Typed {
    let types = (0..graph.nodes.len()).map(|node| sensed(&graph, node)).collect();
    let named = quantities_by_name(cx, &graph);
    let readers = graph.readers(|_, _| true);
    let mut graph = Typed { graph, types, named, readers };
    let mut found = Vec::new();
    // In the order of their dependencies.
    let mut queue: VecDeque<usize> = (0..graph.nodes.len()).collect();
    while let Some(node) = queue.pop_front() {
        found.clear();
        found.extend((0..graph.types[node].len()).map(|output| graph.output(node, output)));
        if found != graph.types[node] {
            graph.types[node].copy_from_slice(&found);
            queue.extend(&graph.readers[node]);
        }
    }
    graph
}

/// The types of outputs that come from the channels of a device.
fn sensed(graph: &Clocked, node: usize) -> Vec<Type> {
    let spec = graph.nodes[node].entry.spec;
    let output = |output| match (spec.output(output), graph.sensed(node, output)) {
        (Some(port), Some(channel)) => Type {
            kind: matches!(port.kind, KindRule::Linear | KindRule::Any).then_some(channel.kind),
            quantity: matches!(port.quantity, QuantityRule::Any).then_some(channel.quantity),
        },
        _ => Type::default(),
    };
    (0..graph.nodes[node].output_count()).map(output).collect()
}

impl Typed {
    /// Type of the output that a connection reads.
    pub(super) fn carried(&self, wire: &Wire) -> Type {
        self.types[wire.from][wire.output]
    }

    /// Type of the output that is connected to a slot.
    pub(super) fn arriving(&self, slot: &Slot) -> Option<Type> {
        slot.wire.as_ref().map(|wire| self.carried(wire))
    }

    /// Type of an output by its rules, as far as it is known.
    fn output(&self, node: usize, output: usize) -> Type {
        let known = self.types[node][output];
        match self.nodes[node].entry.spec.output(output) {
            Some(port) => Type {
                kind: known.kind.or_else(|| self.kind_of(node, port.kind)),
                quantity: known.quantity.or_else(|| self.quantity_of(node, port.quantity)),
            },
            None => known,
        }
    }

    /// The kind that a rule of `node` stands for, as far as it is known.
    pub(super) fn kind_of(&self, node: usize, rule: KindRule) -> Option<Kind> {
        match rule {
            KindRule::Is(kind) => Some(kind),
            // An output without a rule carries scalars.
            KindRule::Linear | KindRule::Any => Some(Kind::SCALAR),
            KindRule::Same(input) => match self.arriving_at(node, input, |carried| carried.kind) {
                Some(arriving) => arriving,
                None => match port(&self.nodes[node], input)?.kind {
                    KindRule::Is(kind) => Some(kind),
                    _ => Some(Kind::SCALAR),
                },
            },
        }
    }

    /// The quantity that a rule of `node` stands for, as far as it is known.
    pub(super) fn quantity_of(&self, node: usize, rule: QuantityRule) -> Option<Quantity> {
        let of = |input: &'static str| match self.arriving_at(node, input, |carried| carried.quantity) {
            Some(arriving) => arriving,
            None => match port(&self.nodes[node], input)?.quantity {
                QuantityRule::Is(quantity) => Some(quantity),
                _ => Some(Quantity::NUMBER),
            },
        };
        match rule {
            QuantityRule::Is(quantity) => Some(quantity),
            QuantityRule::Any => Some(Quantity::NUMBER),
            QuantityRule::Same(input) => of(input),
            QuantityRule::Product(a, b) => Some(of(a)?.times(of(b)?)),
            QuantityRule::Quotient(a, b) => Some(of(a)?.per(of(b)?)),
            QuantityRule::PerSecond(input) => Some(of(input)?.per(Quantity::TIME)),
            QuantityRule::TimesSeconds(input) => Some(of(input)?.times(Quantity::TIME)),
            QuantityRule::Setting(setting) => self.named.get(&(node, setting)).copied().flatten(),
        }
    }

    /// The first known part of the types that arrive at an input; `None` if it is not connected.
    fn arriving_at<T>(&self, node: usize, input: &str, part: fn(Type) -> Option<T>) -> Option<Option<T>> {
        let slots = || self.nodes[node].slots_of(input);
        let is_connected = slots().any(|slot| slot.wire.is_some() || slot.broken);
        is_connected.then(|| slots().filter_map(|slot| self.arriving(slot)).find_map(part))
    }
}

fn port<'d>(node: &'d Connected, input: &str) -> Option<&'d InputSpec> {
    node.entry.spec.inputs.iter().find(|port| port.name == input)
}

fn quantities_by_name(
    cx: &mut Context<'_>,
    graph: &Clocked,
) -> HashMap<(usize, &'static str), Option<Quantity>> {
    let mut named = HashMap::new();
    for (i, node) in graph.nodes.iter().enumerate() {
        let spec = node.entry.spec;
        let rules = spec.inputs.iter().map(|port| port.quantity);
        for rule in rules.chain(spec.outputs.iter().map(|port| port.quantity)) {
            let QuantityRule::Setting(setting) = rule else {
                continue;
            };
            if let Entry::Vacant(place) = named.entry((i, setting)) {
                let found = quantity_by_name(cx, node, setting);
                if found.is_none() {
                    cx.blame(node);
                }
                place.insert(found);
            }
        }
    }
    named
}

/// The quantity that a setting names, given or by default; a missing setting is reported when the settings are read.
fn quantity_by_name(cx: &mut Context<'_>, node: &Connected, setting: &'static str) -> Option<Quantity> {
    let (name, span) = match node.fields.given(setting) {
        Some(Value { span, shape: Shape::String(name) }) => (name.clone(), *span),
        Some(_) => return None, // Reported when the settings are read.
        None => {
            let specs = node.entry.specs();
            let default = specs.iter().find(|spec| spec.name == setting)?.default.as_ref()?;
            (default.trim_matches('"').to_owned(), node.fields.span)
        }
    };
    let found = Quantity::by_name(&name);
    if found.is_none() {
        let before = cx.diagnostics.len();
        cx.reading(|reading| {
            reading.setting = Some(setting);
            unknown_choice(&name, &quantity_names(), span, reading);
        });
        if let (Some(meant), Some(finding)) = (quantity_by_unit(&name), cx.diagnostics.get_mut(before)) {
            finding.help = vec![format!("did you mean `{meant}`? Write the quantity, not its unit")];
        }
    }
    found
}

fn quantity_names() -> Vec<&'static str> {
    Quantity::NAMED.iter().map(|(_, name, _)| *name).collect()
}

/// The settings that have to name a quantity, with the error of each that is missing.
pub(super) fn missing_quantities(node: &Connected) -> impl Iterator<Item = (&'static str, Diagnostic)> {
    let (spec, settings) = (node.entry.spec, node.entry.specs());
    let rules = spec.inputs.iter().map(|port| port.quantity);
    let rules = rules.chain(spec.outputs.iter().map(|port| port.quantity));
    rules.filter_map(move |rule| {
        let QuantityRule::Setting(name) = rule else { return None };
        settings.iter().find(|spec| spec.name == name && spec.default.is_none())?;
        let names = quantity_names().join(", ");
        let help = format!("add `{name}: \"...\"`, the name of a quantity, one of {names}");
        let missing = Diagnostic::missing(node.fields.span, &format!("`{}`", spec.name), name, help);
        Some((name, missing))
    })
}

/// The name of the quantity whose unit was written in its place: `m/s2`, `m/s²`.
fn quantity_by_unit(unit: &str) -> Option<&'static str> {
    let mut named = Quantity::NAMED.iter();
    let (_, name, _) = named.find(|(quantity, ..)| si_per(unit, *quantity).is_some())?;
    Some(name)
}
