//! What makes two nodes the same but for their path: what a running node's state can be handed over by, and what a
//! replay knows the graph by.

use super::clocks::Clocks;
use super::devices::DraftDevice;
use super::draft::{Context, Draft};
use super::{Graph, Work};
use crate::document::folder;
use crate::document::value::{Body, Shape, Tagged, Value};
use crate::frame::Kind;
use crate::settings::Fields;
use haptograph_signal::files;
use petgraph::graph::NodeIndex;
use petgraph::visit::EdgeRef;
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

/// Of a node's kind, settings but for those that may change while it runs, rate, and the frames it is given.
pub(super) fn of_node(cx: &Context<'_>, draft: &Draft, clocks: &Clocks, node: usize) -> u64 {
    let target = &draft.nodes[node];
    let mut state = DefaultHasher::new();
    target.entry.spec.name.hash(&mut state);
    let live: Vec<&str> = target
        .entry
        .settings()
        .iter()
        .filter(|setting| setting.live)
        .map(|setting| setting.name)
        .collect();
    fields(cx, &target.fields, &live, &mut state);
    target.clock.map(|clock| clocks.list[clock].rate).hash(&mut state);
    for slot in &target.inputs {
        let carried = slot
            .wire
            .as_ref()
            .map(|wire| draft.nodes[wire.from].outputs[wire.output]);
        carried
            .and_then(|carried| carried.kind)
            .map(Kind::width)
            .hash(&mut state);
    }
    state.finish()
}

/// Of a device's kind, settings and rate.
pub(super) fn of_device(cx: &Context<'_>, clocks: &Clocks, device: &DraftDevice) -> u64 {
    let mut state = DefaultHasher::new();
    device.entry.spec.name.hash(&mut state);
    fields(cx, &device.fields, &[], &mut state);
    device.clock.map(|clock| clocks.list[clock].rate).hash(&mut state);
    state.finish()
}

/// Fields in any order: writing them in another one changes nothing.
fn fields(cx: &Context<'_>, fields: &Fields, but: &[&str], state: &mut DefaultHasher) {
    let counted = fields
        .remaining()
        .iter()
        .filter(|(name, _)| !but.contains(&name.text.as_str()));
    let each = counted.map(|(name, given)| {
        let mut state = DefaultHasher::new();
        name.text.hash(&mut state);
        value(cx, given, &mut state);
        state.finish()
    });
    each.fold(0_u64, u64::wrapping_add).hash(state);
}

/// The meaning of a value, not its place; of a string that names a file what that holds.
fn value(cx: &Context<'_>, given: &Value, state: &mut DefaultHasher) {
    std::mem::discriminant(&given.shape).hash(state);
    match &given.shape {
        Shape::Unit => {}
        Shape::Bool(flag) => flag.hash(state),
        Shape::Number(number, _) => number.to_bits().hash(state),
        Shape::String(text) => {
            text.hash(state);
            file(&folder(&cx.sources, given.span.source).join(text), state);
        }
        Shape::List(values) => values.iter().for_each(|inner| value(cx, inner, state)),
        Shape::Map(pairs) => {
            for (key, inner) in pairs {
                value(cx, key, state);
                value(cx, inner, state);
            }
        }
        Shape::Tagged(Tagged { name, body }) => {
            name.as_ref().map(|name| &name.text).hash(state);
            match body {
                Body::Bare => {}
                Body::Tuple(values) => values.iter().for_each(|inner| value(cx, inner, state)),
                Body::Fields(fields) => {
                    for (name, inner) in fields {
                        name.text.hash(state);
                        value(cx, inner, state);
                    }
                }
            }
        }
    }
}

/// If there is such a file: what is in it, as what a node reads from a file is part of what the node is. Where it lies
/// is not, nor when it was written.
fn file(path: &Path, state: &mut DefaultHasher) {
    if !path.is_file() {
        return;
    }
    // One that cannot be read is refused by the node that needs it.
    files::read(path, files::MAX_RECORDING_BYTES)
        .unwrap_or_default()
        .hash(state);
}

/// Of everything that a graph's samples come from, live settings included, by what it is called. Nodes that only
/// write files are left out.
pub(crate) fn of_graph(graph: &Graph) -> BTreeMap<String, u64> {
    let samples = |node: &NodeIndex| !matches!(graph.nodes[*node].work, Work::File(_));
    let clocks = graph.clocks.iter().map(|clock| {
        (
            format!("clock {}", clock.name),
            hash_of((clock.rate, clock.driver)),
        )
    });
    let devices = graph
        .devices
        .iter()
        .map(|device| (format!("endpoint {}", device.name), device.fingerprint));
    let nodes = graph.nodes.node_indices().filter(samples).map(|index| {
        let node = &graph.nodes[index];
        let live: Vec<(usize, u64)> = node
            .live
            .iter()
            .map(|(at, value)| (*at, value.to_bits()))
            .collect();
        let hash = hash_of((node.entry.spec.name, node.fingerprint, node.clock, live));
        (format!("node {}", node.path), hash)
    });
    let edges = graph
        .nodes
        .edge_references()
        .filter(|edge| samples(&edge.target()));
    let edges = edges.map(|edge| {
        let (from, to, edge) = (
            &graph.nodes[edge.source()],
            &graph.nodes[edge.target()],
            edge.weight(),
        );
        let (output, input) = (from.outputs[edge.output].name, to.inputs[edge.input].name);
        let name = format!("connection {}.{output} to {}.{input}", from.path, to.path);
        // As text the bridge's numbers are exact.
        (
            name,
            hash_of((edge.output, edge.input, format!("{:?}", edge.bridge))),
        )
    });
    let mut all = BTreeMap::from([(String::from("seed"), graph.seed)]);
    for (name, hash) in clocks.chain(devices).chain(nodes).chain(edges) {
        // Several connections may share a name.
        let sum = all.entry(name).or_insert(0);
        *sum = sum.wrapping_add(hash);
    }
    all
}

fn hash_of(value: impl Hash) -> u64 {
    let mut state = DefaultHasher::new();
    value.hash(&mut state);
    state.finish()
}
