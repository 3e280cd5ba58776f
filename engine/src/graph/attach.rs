//! The check of nodes against their devices: the seventh form of a graph.

use super::bridges::Crossed;
use super::context::Context;
use super::devices::Device;
use super::types::Type;
use crate::device::Channel;
use crate::diagnostic::{Diagnostic, Span};
use crate::node::{KindRule, QuantityRule};
use haptograph_signal::quantity::Quantity;
use std::collections::HashMap;
use std::ops::Deref;

/// A graph whose devices have their clocks and channels.
pub(super) struct Attached {
    graph: Crossed,
    /// In the order of the devices.
    pub attachments: Vec<Attachment>,
}

/// What a device shares with its nodes.
pub(super) struct Attachment {
    /// `None` if no node has a clock, or after a reported error.
    pub clock: Option<usize>,
    /// Channels that nodes can read and drive; for a host endpoint those that they use.
    pub senses: Vec<Channel>,
    pub drives: Vec<Channel>,
}

impl Deref for Attached {
    type Target = Crossed;

    fn deref(&self) -> &Crossed {
        &self.graph
    }
}

/// A port of a source or sink, which is a channel of its device.
struct Port {
    name: &'static str,
    doc: &'static str,
    carries: Type,
    /// True if the node says what a bare number of the device stands for.
    states_quantity: bool,
}

impl Port {
    fn channel(&self) -> Option<Channel> {
        let Type { kind, quantity } = self.carries;
        Some(Channel { name: self.name, doc: self.doc, kind: kind?, quantity: quantity? })
    }
}

/// Checks that ports and channels agree, that all nodes of a device share its clock, and that no channel is driven
/// twice.
pub(super) fn attach(cx: &mut Context<'_>, graph: Crossed) -> Attached {
    let channels = graph.devices.list.iter().map(|device| device.entry.spec);
    let mut attachments: Vec<Attachment> = channels
        .map(|spec| Attachment { clock: None, senses: spec.senses.to_vec(), drives: spec.drives.to_vec() })
        .collect();
    // By device.
    let mut first: Vec<Option<(usize, usize)>> = vec![None; attachments.len()];
    let mut disagreeing = vec![false; attachments.len()];
    let mut driven: HashMap<(usize, &'static str), Span> = HashMap::new();
    for (node, target) in graph.nodes.iter().enumerate() {
        let Some(index) = graph.device_of[node] else { continue };
        let (device, ports) = (&graph.devices.list[index], ports(&graph, node));
        let Attachment { senses, drives, .. } = &mut attachments[index];
        let channels = if target.entry.is_actuator() { drives } else { senses };
        if device.entry.is_host() {
            let is_new = |port: &&Port| channels.iter().all(|known| known.name != port.name);
            let new: Vec<Channel> = ports.iter().filter(is_new).filter_map(Port::channel).collect();
            channels.extend(new);
        }
        for diagnostic in mismatches(&graph, node, &ports, device, channels) {
            cx.refuse(target, diagnostic);
        }
        if let Some(clock) = graph.clock_of[node] {
            match first[index] {
                None => first[index] = Some((node, clock)),
                Some((_, known)) if known == clock => {}
                Some(known) => {
                    disagreeing[index] = true;
                    cx.report(two_clocks(&graph, device, known, (node, clock)));
                }
            }
        }
        if let (true, Some(port)) = (target.entry.is_actuator(), ports.first()) {
            let here = target.fields.span;
            match driven.get(&(index, port.name)) {
                Some(before) => cx.report(driven_twice(port.name, &device.name, here, *before)),
                None => {
                    driven.insert((index, port.name), here);
                }
            }
        }
    }
    for ((attachment, first), disagrees) in attachments.iter_mut().zip(first).zip(disagreeing) {
        attachment.clock = first.map(|(_, clock)| clock).filter(|_| !disagrees);
    }
    Attached { graph, attachments }
}

fn driven_twice(port: &str, device: &str, here: Span, before: Span) -> Diagnostic {
    Diagnostic::error("E0604", here, format!("`{port}` of device `{device}` is driven twice"))
        .label("driven again here")
        .also(before, "first driven here")
        .help("add the two signals in front of one sink")
}

/// The error of two nodes, each with its clock, of one device.
fn two_clocks(graph: &Crossed, device: &Device, first: (usize, usize), other: (usize, usize)) -> Diagnostic {
    let name = |(_, clock): (usize, usize)| &graph.clocks.list[clock].name;
    let span = |(node, _): (usize, usize)| graph.nodes[node].fields.span;
    let message = format!(
        "the nodes of device `{}` run on different clocks, `{}` and `{}`",
        device.name,
        name(first),
        name(other)
    );
    Diagnostic::error("E0603", span(other), message)
        .label(format!("this one runs on `{}`", name(other)))
        .also(span(first), format!("this one on `{}`", name(first)))
        .help("a device ticks on one clock: give both the same, and bridge the connections")
}

/// The ports of a node that are channels of its device: the input of an actuator sink, the outputs of a source.
fn ports(graph: &Crossed, node: usize) -> Vec<Port> {
    let target = &graph.nodes[node];
    let spec = target.entry.spec;
    if target.entry.is_actuator() {
        let carried = target.wires().next().map(|(_, wire)| graph.carried(wire)).unwrap_or_default();
        let port = spec.inputs.first().map(|port| Port {
            name: port.name,
            doc: port.doc,
            carries: type_of(port.kind, port.quantity, carried),
            states_quantity: false,
        });
        return port.into_iter().collect();
    }
    let outputs = spec.outputs.iter().zip(&graph.types[node]);
    let port = |(port, carried): (&crate::node::OutputSpec, &Type)| Port {
        name: port.name,
        doc: port.doc,
        carries: type_of(port.kind, port.quantity, *carried),
        states_quantity: matches!(port.quantity, QuantityRule::Setting(_)),
    };
    outputs.map(port).collect()
}

/// The type of a port; a port of any type takes on the type of its signal.
fn type_of(kind: KindRule, quantity: QuantityRule, carried: Type) -> Type {
    Type {
        kind: match kind {
            KindRule::Is(kind) => Some(kind),
            _ => carried.kind,
        },
        quantity: match quantity {
            QuantityRule::Is(quantity) => Some(quantity),
            _ => carried.quantity,
        },
    }
}

/// The mismatches between a node's ports and its device's channels, up to the first channel that the device does not have.
fn mismatches(
    graph: &Crossed,
    node: usize,
    ports: &[Port],
    device: &Device,
    channels: &[Channel],
) -> Vec<Diagnostic> {
    let target = &graph.nodes[node];
    let (kind, at) = (target.entry.spec.name, target.fields.span);
    let mut found = Vec::new();
    for port in ports {
        let Some(channel) = channels.iter().find(|channel| channel.name == port.name) else {
            let (does, done, has) = match target.entry.is_actuator() {
                true => ("drives", "driven", "is driven by"),
                false => ("reads", "read", "senses"),
            };
            let names: Vec<&str> = channels.iter().map(|channel| channel.name).collect();
            let names = if names.is_empty() { "nothing".to_owned() } else { names.join(", ") };
            let message = format!("device `{}` cannot be {done} by `{kind}`", device.name);
            let diagnostic = Diagnostic::error("E0602", at, message).label(format!("{does} `{}`", port.name));
            found.push(diagnostic.also(device.span, format!("`{}` {has} {names}", device.entry.spec.name)));
            break;
        };
        let is_bare = channel.quantity == Quantity::NUMBER && port.states_quantity;
        let (carried, expected) = match (port.carries.kind, port.carries.quantity.filter(|_| !is_bare)) {
            (Some(carried), _) if carried != channel.kind => (carried.to_string(), channel.kind.to_string()),
            (_, Some(carried)) if carried != channel.quantity => {
                (carried.to_string(), channel.quantity.to_string())
            }
            _ => continue,
        };
        let (name, body) = (channel.name, device.entry.spec.name);
        let message = format!("`{name}` of `{kind}` is {carried}, but `{name}` of `{body}` is {expected}");
        let diagnostic = Diagnostic::error("E0602", at, message).label("does not match the device");
        found.push(diagnostic.also(device.span, "the device"));
    }
    found
}
