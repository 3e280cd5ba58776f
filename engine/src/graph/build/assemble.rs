//! The graph from a draft without errors.

use super::Built;
use crate::diagnostic::Diagnostic;
use crate::frame::Kind;
use crate::graph::clocks::Clocks;
use crate::graph::devices::Devices;
use crate::graph::draft::{Context, Draft, DraftNode, Slot, Type};
use crate::graph::live::{self, LiveValue};
use crate::graph::{Bridge, Edge, Graph, GraphDevice, Input, Node, Output, Work, fingerprint, wires};
use crate::node::{Flow, KindRule, QuantityRule, SettingId};
use crate::settings::SettingRole;
use haptograph_signal::quantity::Quantity;
use petgraph::graph::{DiGraph, NodeIndex};

/// Makes the graph, after a check without errors.
pub(in crate::graph) fn assemble(
    mut cx: Context<'_>,
    draft: Draft,
    clocks: Clocks,
    devices: Option<Devices>,
    built: Built,
    seed: u64,
) -> Option<Graph> {
    let mut nodes = DiGraph::with_capacity(draft.nodes.len(), draft.nodes.len());
    let Built { works, files, devices: bodies, simulated } = built;
    // Only devices that nodes are bound to are part of the graph.
    let mut kept: Vec<Option<usize>> = Vec::new();
    let mut graph_devices = Vec::new();
    for (device, built) in devices.into_iter().flat_map(|devices| devices.list).zip(bodies) {
        kept.push(match (device.bound, device.clock, built) {
            (true, Some(clock), Some(built)) => {
                graph_devices.push(GraphDevice {
                    entry: device.entry,
                    clock,
                    fingerprint: fingerprint::of_device((&cx, &cx.files), &clocks, &device),
                    name: device.name,
                    device: built.body,
                    settings: built.settings,
                    senses: device.senses,
                    span: device.span,
                });
                Some(graph_devices.len() - 1)
            }
            _ => None,
        });
    }
    for (i, (work, simulated)) in works.into_iter().zip(simulated).enumerate() {
        let node = &draft.nodes[i];
        let files = files.get(i).map_or(&[][..], Vec::as_slice);
        let mut work = work?;
        if let Work::Source { device, .. } | Work::Actuator { device, .. } = &mut work {
            *device = kept.get(*device).copied()??;
        }
        if let Some(doubt) = within_the_device(&mut work, node, &graph_devices) {
            cx.report(doubt);
        }
        nodes.add_node(Node {
            path: node.path.clone(),
            entry: node.entry,
            clock: node.clock,
            inputs: node.inputs.iter().map(|slot| input(&draft, node, slot)).collect(),
            outputs: outputs(node)?,
            work,
            span: node.name,
            simulated,
            fingerprint: fingerprint::of_node((&cx, files), &draft, &clocks, i),
            live: live_values(node),
            written: written(node),
            files: files.to_vec(),
        });
    }
    for (to, node) in draft.nodes.iter().enumerate() {
        for (input, wire) in node.wires() {
            let edge = Edge {
                output: wire.output,
                input,
                bridge: wire.bridge.map_or(Bridge::Direct, |(bridge, _)| bridge),
                span: wire.span,
            };
            nodes.add_edge(NodeIndex::new(wire.from), NodeIndex::new(to), edge);
        }
    }
    let template_outputs = wires::template_outputs(&mut cx, &draft);
    Some(Graph {
        about: cx.document.about.clone(),
        seed,
        clocks: clocks.list,
        base: clocks.base?,
        nodes,
        template_outputs,
        devices: graph_devices,
        sources: cx.sources,
        warnings: cx.diagnostics,
    })
}

/// Lowers the limit of a sink to the largest output of its device, so that `delivered` is right; returns a warning.
fn within_the_device(work: &mut Work, node: &DraftNode, devices: &[GraphDevice]) -> Option<Diagnostic> {
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
fn live_values(node: &DraftNode) -> Vec<(SettingId, f64)> {
    let mut found = Vec::new();
    for (place, spec) in node.entry.settings().iter().enumerate() {
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

/// The given settings with computed values; paths without their folders.
fn written(node: &DraftNode) -> Vec<(String, String)> {
    let given = node.fields.remaining().iter();
    let is_setting = |name: &str| node.entry.settings().iter().any(|spec| spec.name == name);
    given
        .filter(|(name, _)| is_setting(&name.text))
        .map(|(name, value)| (name.text.clone(), value.brief()))
        .collect()
}

fn input(draft: &Draft, node: &DraftNode, slot: &Slot) -> Input {
    let port = &node.entry.spec.inputs[slot.port];
    let carried =
        slot.wire.as_ref().map(|wire| draft.nodes[wire.from].outputs[wire.output]).unwrap_or_default();
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

fn outputs(node: &DraftNode) -> Option<Vec<Output>> {
    let family = node.entry.spec.family();
    let output = |(place, carried): (usize, &Type)| {
        let name = match family.is_some_and(|family| place >= family) {
            true => node.port_name(place)?.to_owned().into(),
            false => node.entry.spec.output(place)?.name.into(),
        };
        Some(Output { name, kind: carried.kind?, quantity: carried.quantity? })
    };
    node.outputs.iter().enumerate().map(output).collect()
}
