//! The graph from its last form, without errors.

use super::attach::Attached;
use super::build::Built;
use super::context::Context;
use super::declared::{Connected, Slot};
use super::live::{self, LiveValue};
use super::{Edge, Graph, GraphDevice, Input, Node, Output, Work, fingerprint};
use crate::device::BuiltDevice;
use crate::diagnostic::Diagnostic;
use crate::frame::Kind;
use crate::node::{Flow, KindRule, QuantityRule, SettingId};
use crate::settings::SettingRole;
use haptograph_signal::quantity::Quantity;
use petgraph::graph::{DiGraph, NodeIndex};

/// Makes the graph, after a check without errors; `None` if something is missing after all.
pub(super) fn assemble(cx: &mut Context<'_>, built: Built, seed: u64) -> Option<Graph> {
    let Built { graph, works, files, devices: bodies, simulated } = built;
    let bodies = bodies.into_iter().enumerate();
    let devices = bodies.map(|(index, body)| device(cx, &graph, index, body?)).collect::<Vec<_>>();
    // Only devices that nodes are bound to are part of the graph.
    let mut count = 0;
    let kept: Vec<Option<usize>> = devices
        .iter()
        .map(|device| {
            count += usize::from(device.is_some());
            device.is_some().then(|| count - 1)
        })
        .collect();
    let devices: Vec<GraphDevice> = devices.into_iter().flatten().collect();
    let wires = graph.nodes.iter().map(|node| node.wires().count()).sum();
    let mut nodes = DiGraph::with_capacity(graph.nodes.len(), wires);
    for (index, (work, files)) in works.into_iter().zip(files).enumerate() {
        let node = &graph.nodes[index];
        let mut work = work?;
        if let Work::Source { device, .. } | Work::Actuator { device, .. } = &mut work {
            *device = kept.get(*device).copied()??;
        }
        if let Some(doubt) = within_the_device(&mut work, node, &devices) {
            cx.report(doubt);
        }
        nodes.add_node(Node {
            path: node.path.clone(),
            entry: node.entry,
            clock: graph.clock_of[index],
            inputs: node.inputs.iter().map(|slot| input(&graph, node, slot)).collect(),
            outputs: outputs(&graph, index)?,
            work,
            span: node.name,
            simulated: simulated[index],
            fingerprint: fingerprint::of_node((cx, &files), &graph, index),
            live: live_values(node),
            given: node.fields.shared(),
            files,
        });
    }
    for (to, node) in graph.nodes.iter().enumerate() {
        for (input, wire) in node.wires() {
            let edge = Edge { output: wire.output, input, bridge: graph.bridges[to][input], span: wire.span };
            nodes.add_edge(NodeIndex::new(wire.from), NodeIndex::new(to), edge);
        }
    }
    Some(Graph {
        about: cx.document.about.clone(),
        seed,
        clocks: graph.clocks.list.clone(),
        base: graph.clocks.base.clone()?,
        nodes,
        template_outputs: graph.template_outputs.clone(),
        devices,
        sources: std::mem::take(&mut cx.sources),
        warnings: std::mem::take(&mut cx.diagnostics),
    })
}

/// A device that nodes are bound to.
fn device(cx: &Context<'_>, graph: &Attached, index: usize, built: BuiltDevice) -> Option<GraphDevice> {
    let (device, attachment) = (&graph.devices.list[index], &graph.attachments[index]);
    Some(GraphDevice {
        entry: device.entry,
        clock: attachment.clock?,
        fingerprint: fingerprint::of_device((cx, &cx.files), graph, index),
        name: device.name.clone(),
        device: built.body,
        settings: built.settings,
        senses: attachment.senses.clone(),
        span: device.span,
    })
}

/// Lowers the limit of a sink to the largest output of its device, so that `delivered` is right; returns a warning.
fn within_the_device(work: &mut Work, node: &Connected, devices: &[GraphDevice]) -> Option<Diagnostic> {
    let Work::Actuator { device, channel, limit, .. } = work else {
        return None;
    };
    let device = devices.get(*device)?;
    let most = device.device.max_output_bound(*channel).filter(|most| *most < limit.peak)?;
    let message = format!(
        "the peak limit of `{}` is {}, but `{}` can give at most {most}; the limit is lowered to {most}",
        node.path, limit.peak, device.name
    );
    limit.peak = most;
    limit.continuous = limit.continuous.min(most);
    let written = node.entry.setting_for(SettingRole::Limit);
    let written = written.and_then(|limit| node.fields.given(limit.name));
    let span = written.map_or(node.fields.span, |value| value.span);
    let warning = Diagnostic::warning("W0108", span, message);
    Some(warning.also(device.span, "the device").help("lower the limit, or correct what the device states"))
}

/// The live settings of a node with their values or defaults, each number of a list by itself.
fn live_values(node: &Connected) -> Vec<(SettingId, f64)> {
    let specs = node.entry.specs();
    let live = specs.iter().enumerate().filter(|(_, spec)| spec.live);
    let mut found = Vec::with_capacity(live.clone().count());
    for (place, spec) in live {
        let setting = SettingId::at(place);
        match live::value(&node.fields, spec) {
            Some(LiveValue::Number(number)) => found.push((setting, number)),
            Some(LiveValue::Items(items)) => {
                let items = items.into_iter().enumerate();
                found.extend(items.map(|(item, number)| (setting.with_item(item), number)));
            }
            None => {}
        }
    }
    found
}

fn input(graph: &Attached, node: &Connected, slot: &Slot) -> Input {
    let port = &node.entry.spec.inputs[slot.port];
    let carried = graph.arriving(slot).unwrap_or_default();
    Input {
        name: port.name,
        label: slot.name.as_ref().map(|name| name.text.clone()),
        kind: carried.kind.unwrap_or(match port.kind {
            KindRule::Is(kind) => kind,
            _ => Kind::SCALAR,
        }),
        quantity: carried.quantity.unwrap_or(match port.quantity {
            QuantityRule::Is(quantity) => quantity,
            _ => Quantity::NUMBER,
        }),
        connected: slot.wire.is_some(),
        held: port.flow == Flow::Held,
    }
}

fn outputs(graph: &Attached, node: usize) -> Option<Vec<Output>> {
    let (node, types) = (&graph.nodes[node], &graph.types[node]);
    let family = node.entry.spec.family();
    let mut outputs = Vec::with_capacity(types.len());
    for (place, carried) in types.iter().enumerate() {
        let name = match family.is_some_and(|family| place >= family) {
            true => node.port_name(place)?.to_owned().into(),
            false => node.entry.spec.output(place)?.name.into(),
        };
        outputs.push(Output { name, kind: carried.kind?, quantity: carried.quantity? });
    }
    Some(outputs)
}
