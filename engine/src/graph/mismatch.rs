//! Kinds and quantities: check of inputs.

use super::context::Context;
use super::declared::{Connected, Slot, Wire};
use super::types::{Type, Typed};
use crate::diagnostic::Diagnostic;
use crate::frame::Kind;
use crate::node::{InputSpec, KindRule, Presence, QuantityRule};
use haptograph_signal::quantity::Quantity;

/// Checks every connection.
pub(super) fn check(cx: &mut Context<'_>, graph: &Typed) {
    for (node, target) in graph.nodes.iter().enumerate() {
        for slot in &target.inputs {
            let Some(wire) = &slot.wire else { continue };
            if let Some(diagnostic) = Arrival::of(graph, node, slot, wire).mismatch(cx) {
                cx.refuse(target, wire.via(diagnostic));
            }
        }
    }
    report_unknown(cx, graph);
}

/// A connection to a slot, and what it carries.
struct Arrival<'g> {
    graph: &'g Typed,
    node: usize,
    slot: &'g Slot,
    port: &'static InputSpec,
    wire: &'g Wire,
    carried: Type,
    /// Type of the first connection of a list or map whose connections need one type.
    first: Option<Type>,
}

impl<'g> Arrival<'g> {
    fn of(graph: &'g Typed, node: usize, slot: &'g Slot, wire: &'g Wire) -> Self {
        let target = &graph.nodes[node];
        let port = &target.entry.spec.inputs[slot.port];
        let first = (target.is_many(slot) && list_is_uniform(target, port.name))
            .then(|| target.slots_of(port.name).find_map(|other| graph.arriving(other)))
            .flatten();
        Self { graph, node, slot, port, wire, carried: graph.carried(wire), first }
    }

    /// The type error, if any.
    fn mismatch(&self, cx: &Context<'_>) -> Option<Diagnostic> {
        if let Some(kind) = self.carried.kind
            && let Some(accepted) = self.accepted_kind(cx, kind)?
        {
            return Some(self.wrong_kind(cx, kind, &accepted));
        }
        self.wrong_quantity(cx)
    }

    fn from(&self) -> String {
        self.graph.source_name(self.wire)
    }

    fn to(&self) -> String {
        format!("`{}` of `{}`", self.port.name, self.graph.nodes[self.node].entry.spec.name)
    }

    /// What the input takes instead of this kind; inside `None` if it takes it, and `None` if that is not known.
    fn accepted_kind(&self, cx: &Context<'_>, kind: Kind) -> Option<Option<String>> {
        let takes = |accepted: Kind, text: String| (kind != accepted).then_some(text);
        Some(match self.port.kind {
            KindRule::Is(accepted) => takes(accepted, format!("takes {}", accepted.spec().one)),
            KindRule::Linear if !kind.is_linear() => {
                let linear = cx.registry.kinds().iter().filter(|kind| kind.is_linear());
                let names: Vec<&str> = linear.map(|kind| kind.spec().name).collect();
                Some(format!("takes linear frames ({})", names.join(", ")))
            }
            KindRule::Same(other) if other != self.port.name => {
                let accepted = self.graph.kind_of(self.node, self.port.kind)?;
                takes(accepted, format!("takes {}, like `{other}`", accepted.spec().one))
            }
            _ => self.first.and_then(|first| first.kind).and_then(|first| {
                takes(first, format!("takes signals of one kind, and the first is {}", first.spec().one))
            }),
        })
    }

    fn wrong_kind(&self, cx: &Context<'_>, kind: Kind, accepted: &str) -> Diagnostic {
        let one = kind.spec().one;
        let message = format!("{} {accepted}, but `{}` is {one}", self.to(), self.from());
        let diagnostic = Diagnostic::error("E0403", self.wire.span, message).label(format!("this is {one}"));
        let KindRule::Is(accepted) = self.port.kind else { return diagnostic };
        let quantity = self.graph.quantity_of(self.node, self.port.quantity);
        let swapped = self.swapped(Type { kind: Some(accepted), quantity });
        let made = || {
            let list = converters(cx, |input, output| {
                input.kind == KindRule::Is(kind) && output.0 == KindRule::Is(accepted)
            });
            list.map(|list| format!("{list} makes one from the other"))
        };
        match swapped.or_else(made) {
            Some(help) => diagnostic.help(help),
            None => diagnostic,
        }
    }

    fn wrong_quantity(&self, cx: &Context<'_>) -> Option<Diagnostic> {
        let quantity = self.carried.quantity?;
        let accepted = match self.port.quantity {
            QuantityRule::Any => self.first?.quantity?,
            QuantityRule::Same(other) if other == self.port.name => self.first?.quantity?,
            rule => self.graph.quantity_of(self.node, rule)?,
        };
        if quantity == accepted {
            return None;
        }
        let takes = match self.first {
            Some(_) if !matches!(self.port.quantity, QuantityRule::Is(_)) => {
                format!("takes signals of one quantity, and the first is {accepted}")
            }
            _ => format!("takes {accepted}"),
        };
        let message = format!("{} {takes}, but `{}` is {quantity}", self.to(), self.from());
        let help = self
            .stated(quantity, accepted)
            .or_else(|| self.swapped(Type { kind: self.carried.kind, quantity: Some(accepted) }))
            .or_else(|| self.restated(quantity, accepted))
            .unwrap_or_else(|| conversion(cx, quantity, accepted));
        let diagnostic = Diagnostic::error("E0404", self.wire.span, message);
        Some(diagnostic.label(format!("this is {quantity}")).help(help))
    }

    /// Help for a plain number whose source can state what it is.
    fn stated(&self, quantity: Quantity, accepted: Quantity) -> Option<String> {
        let (source, setting) = stated_by(self.graph, self.wire).filter(|_| quantity == Quantity::NUMBER)?;
        let name = accepted.name()?;
        Some(format!(
            "`{}` makes a plain number: if it is {name}, write `{setting}: \"{name}\"`",
            source.path
        ))
    }

    /// Help for a node that states which quantity it takes.
    fn restated(&self, quantity: Quantity, accepted: Quantity) -> Option<String> {
        let QuantityRule::Setting(setting) = self.port.quantity else { return None };
        let name = quantity.name()?;
        let other = word(accepted);
        Some(format!("write `{setting}: \"{name}\"` if that is intended, or connect {other}"))
    }

    /// Help for two swapped inputs: another input has the type that this one needs, and needs the type that this one has.
    fn swapped(&self, accepted: Type) -> Option<String> {
        let target = &self.graph.nodes[self.node];
        let ports = target.entry.spec.inputs;
        let takes = |port: &InputSpec| {
            let of_kind = match port.kind {
                KindRule::Is(kind) => self.carried.kind == Some(kind),
                _ => true,
            };
            of_kind && self.graph.quantity_of(self.node, port.quantity) == self.carried.quantity
        };
        let other = target.inputs.iter().find(|other| {
            other.port != self.slot.port
                && self.graph.arriving(other) == Some(accepted)
                && takes(&ports[other.port])
        })?;
        Some(format!("did you swap `{}` and `{}`?", self.port.name, ports[other.port].name))
    }
}

/// True if the connections of this list need one type, because an output or another input depends on it.
fn list_is_uniform(node: &Connected, name: &str) -> bool {
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

/// The node whose setting states the quantity of a signal, and that setting. Follows nodes that pass on the quantity of an
/// input.
fn stated_by<'d>(graph: &'d Typed, wire: &'d Wire) -> Option<(&'d Connected, &'static str)> {
    let mut wire = wire;
    // No chain is longer than the graph; one that closes on itself ends here too.
    for _ in 0..graph.nodes.len() {
        let source = graph.nodes.get(wire.from)?;
        let passed_on = match source.entry.spec.output(wire.output)?.quantity {
            QuantityRule::Setting(setting) => return Some((source, setting)),
            QuantityRule::Same(input) => input,
            _ => return None,
        };
        wire = source.slots_of(passed_on).next()?.wire.as_ref()?;
    }
    None
}

fn word(quantity: Quantity) -> String {
    quantity.name().map_or_else(|| quantity.unit(), str::to_owned)
}

/// Help for converting one quantity into the other.
fn conversion(cx: &Context<'_>, from: Quantity, to: Quantity) -> String {
    let (had, needed) = (word(from), word(to));
    let direct = converters(cx, |input, output| {
        input.quantity == QuantityRule::Is(from) && output.1 == QuantityRule::Is(to)
    });
    if let Some(list) = direct {
        return format!("{list} turns {had} into {needed}");
    }
    let by_time = |does: &str, rule: fn(&'static str) -> QuantityRule, how: &str| {
        let list = converters(cx, |input, output| output.1 == rule(input.name))?;
        Some(format!("{needed} is {had} {how}: {list} {does}"))
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
        Some(format!("{list} turns {had} into {needed} by a factor that you state"))
    };
    over_time.or_else(stated).unwrap_or_else(|| format!("put a node between that turns {had} into {needed}"))
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
fn report_unknown(cx: &mut Context<'_>, graph: &Typed) {
    let unsettled = |node: usize| {
        graph.types[node].iter().position(|output| output.kind.is_none() || output.quantity.is_none())
    };
    // Nodes that depend on a reported one are not at fault.
    let is_reported = |node: &Connected| cx.is_faulty(node) || node.has_broken_input();
    let mut excused: Vec<bool> = graph.nodes.iter().map(is_reported).collect();
    let mut queue: Vec<usize> = (0..graph.nodes.len()).filter(|i| excused[*i]).collect();
    while let Some(node) = queue.pop() {
        for &reader in &graph.readers[node] {
            if !std::mem::replace(&mut excused[reader], true) {
                queue.push(reader);
            }
        }
    }
    let found = (0..graph.nodes.len()).find_map(|i| Some((i, unsettled(i)?)).filter(|_| !excused[i]));
    if let Some((node, output)) = found {
        let node = &graph.nodes[node];
        let message = format!("cannot infer what `{}` carries", node.output_name(output));
        let diagnostic = Diagnostic::error("E0409", node.fields.span, message)
            .label("its output depends on itself")
            .help("feed the loop from a node whose output has a fixed kind and quantity");
        cx.report_of(node, diagnostic);
    }
    for node in (0..graph.nodes.len()).filter(|node| unsettled(*node).is_some()) {
        cx.blame(&graph.nodes[node]);
    }
}
