//! Fingerprints of nodes and graphs. State transfer matches nodes by them, and a replay checks the graph by them. Files
//! contain them, so they are equal on all machines and in all program versions with the same [`VERSION`].
//!
//! Version 2 has the names of the kinds of frames that inputs receive; version 1 had their numbers of components.

use super::attach::Attached;
use super::context::Context;
use super::live::{self, LiveValue};
use super::{Bridge, Graph, Work};
use crate::document::folder;
use crate::document::value::{Body, Shape, Tagged, Value};
use crate::settings::Fields;
use haptograph_signal::files;
use haptograph_signal::time::Rate;
use petgraph::graph::NodeIndex;
use petgraph::visit::EdgeRef;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Version of the content and the algorithm of fingerprints.
pub(crate) const VERSION: u64 = 3;
/// Name of the entry of [`of_graph`] that has the version.
pub(crate) const VERSION_NAME: &str = "version of these fingerprints";

const FNV_PRIME: u64 = 0x0100_0000_01b3;

/// A 64-bit hash of a sequence of items: FNV-1a over the bytes of each item, preceded by their number; numbers are
/// eight bytes, little-endian.
struct Fingerprint(u64);

impl Fingerprint {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn bytes(&mut self, bytes: &[u8]) {
        match u8::try_from(bytes.len()) {
            // The other bytes of the number are 0, which multiply only.
            Ok(short) => {
                self.0 = (self.0 ^ u64::from(short)).wrapping_mul(const { FNV_PRIME.wrapping_pow(8) })
            }
            Err(_) => self.add(&(bytes.len() as u64).to_le_bytes()),
        }
        self.add(bytes);
    }

    fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(FNV_PRIME);
        }
    }

    fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }

    fn number(&mut self, number: u64) {
        self.bytes(&number.to_le_bytes());
    }

    fn maybe(&mut self, number: Option<u64>) {
        self.number(u64::from(number.is_some()));
        self.number(number.unwrap_or(0));
    }

    fn rate(&mut self, rate: Rate) {
        let (numerator, denominator) = rate.parts();
        self.number(numerator);
        self.number(denominator);
    }

    fn maybe_rate(&mut self, rate: Option<Rate>) {
        self.maybe(rate.map(|_| 1));
        rate.into_iter().for_each(|rate| self.rate(rate));
    }

    /// The hash of what `put` adds, mixed so that sums of hashes distinguish their parts.
    fn of(put: impl FnOnce(&mut Self)) -> u64 {
        let mut state = Self::new();
        put(&mut state);
        let mut mixed = state.0;
        for factor in [0xff51_afd7_ed55_8ccd_u64, 0xc4ce_b9fe_1a85_ec53] {
            mixed = (mixed ^ (mixed >> 33)).wrapping_mul(factor);
        }
        mixed ^ (mixed >> 33)
    }
}

/// Hash of a node's kind, non-live settings, the lengths of live lists, rate, and the names and kinds of frames of its inputs.
/// The content of `files`, the paths that its settings name, counts.
pub(super) fn of_node(files: Files<'_>, graph: &Attached, node: usize) -> u64 {
    let target = &graph.nodes[node];
    let (mut live, mut lengths, mut unset) = (Vec::new(), Vec::new(), Vec::new());
    for setting in target.entry.specs().iter().filter(|setting| setting.live) {
        match live::value(&target.fields, setting) {
            Some(LiveValue::Items(items)) => lengths.push((setting.name, items.len())),
            Some(LiveValue::Number(_)) => {}
            None => {
                unset.push(setting.name);
                continue;
            }
        }
        live.push(setting.name);
    }
    Fingerprint::of(|state| {
        state.text(target.entry.spec.name);
        state.number(fields(files, &target.fields, &live));
        for (name, length) in lengths {
            state.text(name);
            state.number(length as u64);
        }
        unset.into_iter().for_each(|name| state.text(name));
        state.maybe_rate(graph.rate_of(node));
        for slot in &target.inputs {
            // Only a map has names: what was a list before there were maps keeps its hash.
            if let Some(name) = &slot.name {
                state.text(&name.text);
            }
            let carried = graph.arriving(slot).and_then(|carried| carried.kind);
            state.text(carried.map_or("", |kind| kind.spec().name));
            state.number(carried.map_or(0, |kind| kind.width() as u64));
        }
    })
}

/// Hash of a device's kind, settings and rate, and of the channels of an endpoint of the calling program, which are those of its
/// nodes; the content of `files` as in [`of_node`].
pub(super) fn of_device(files: Files<'_>, graph: &Attached, device: usize) -> u64 {
    let attachment = &graph.attachments[device];
    let device = &graph.devices.list[device];
    Fingerprint::of(|state| {
        state.text(device.entry.spec.name);
        state.number(fields(files, &device.fields, &[]));
        state.maybe_rate(attachment.clock.map(|clock| graph.clocks.list[clock].rate));
        for channels in
            [&attachment.senses, &attachment.drives].into_iter().filter(|_| device.entry.is_host())
        {
            state.number(channels.len() as u64);
            for channel in channels {
                state.text(channel.name);
                state.text(channel.kind.spec().name);
                state.number(channel.kind.width() as u64);
                state.text(&channel.quantity.unit());
            }
        }
    })
}

/// The context, and the paths that settings name.
type Files<'a> = (&'a Context<'a>, &'a [PathBuf]);

/// Hash of fields, independent of their order.
fn fields(cx: Files<'_>, fields: &Fields, but: &[&str]) -> u64 {
    let counted = fields.remaining().filter(|(name, _)| !but.contains(&name.text.as_str()));
    let each = counted.map(|(name, given)| {
        Fingerprint::of(|state| {
            state.text(&name.text);
            value(cx, given, state);
        })
    });
    each.fold(0_u64, u64::wrapping_add)
}

/// Adds a value without its place; one of the paths adds the contents of its file.
fn value((cx, files): Files<'_>, given: &Value, state: &mut Fingerprint) {
    match &given.shape {
        Shape::Unit => state.number(0),
        Shape::Bool(flag) => {
            state.number(1);
            state.number(u64::from(*flag));
        }
        Shape::Number(number, _) => {
            state.number(2);
            state.number(number.to_bits());
        }
        Shape::String(text) => {
            state.number(3);
            state.text(text);
            let path = (!files.is_empty()).then(|| folder(&cx.sources, given.span.source).join(text));
            if let Some(path) = path.filter(|path| files.contains(path)) {
                file(&path, state);
            }
        }
        Shape::List(values) => {
            state.number(4);
            all((cx, files), values, state);
        }
        Shape::Map(pairs) => {
            state.number(5);
            state.number(pairs.len() as u64);
            for (key, inner) in pairs {
                value((cx, files), key, state);
                value((cx, files), inner, state);
            }
        }
        Shape::Tagged(Tagged { name, body }) => {
            state.number(6);
            state.text(name.as_ref().map_or("", |name| &name.text));
            match body {
                Body::Bare => state.number(0),
                Body::Tuple(values) => {
                    state.number(1);
                    all((cx, files), values, state);
                }
                Body::Fields(fields) => {
                    state.number(2);
                    state.number(fields.len() as u64);
                    for (name, inner) in fields.iter() {
                        state.text(&name.text);
                        value((cx, files), inner, state);
                    }
                }
            }
        }
    }
}

fn all(cx: Files<'_>, values: &[Value], state: &mut Fingerprint) {
    state.number(values.len() as u64);
    values.iter().for_each(|inner| value(cx, inner, state));
}

/// Adds the contents of a file, if it exists, without its path and times.
fn file(path: &Path, state: &mut Fingerprint) {
    if files::is_file(path) {
        // The node that needs the file reports read errors.
        state.bytes(&files::read(path, files::MAX_RECORDING_BYTES).unwrap_or_default());
    }
}

/// Hashes by name of everything that determines a graph's samples, live settings included, file sinks excluded.
pub(crate) fn of_graph(graph: &Graph) -> BTreeMap<String, u64> {
    let samples = |node: &NodeIndex| !matches!(graph.nodes[*node].work, Work::File(_));
    let clocks = graph.clocks.iter().map(|clock| {
        let hash = Fingerprint::of(|state| {
            state.rate(clock.rate);
            state.number(clock.driver as u64);
        });
        (format!("clock {}", clock.name), hash)
    });
    let devices =
        graph.devices.iter().map(|device| (format!("endpoint {}", device.name), device.fingerprint));
    let nodes = graph.nodes.node_indices().filter(samples).map(|index| {
        let node = &graph.nodes[index];
        let hash = Fingerprint::of(|state| {
            state.text(node.entry.spec.name);
            state.number(node.fingerprint);
            state.maybe(node.clock.map(|clock| clock as u64));
            for (setting, value) in &node.live {
                state.number(setting.index() as u64);
                setting.item().into_iter().for_each(|item| state.number(item as u64));
                state.number(value.to_bits());
            }
        });
        (format!("node {}", node.path), hash)
    });
    let edges = graph.nodes.edge_references().filter(|edge| samples(&edge.target()));
    let edges = edges.map(|edge| {
        let (from, to, edge) = (&graph.nodes[edge.source()], &graph.nodes[edge.target()], edge.weight());
        let (output, input) = (&from.outputs[edge.output].name, to.inputs[edge.input].name);
        let name = format!("connection {}.{output} to {}.{input}", from.path, to.path);
        let hash = Fingerprint::of(|state| {
            state.number(edge.output as u64);
            state.number(edge.input as u64);
            // The text has the exact numbers.
            state.text(&match edge.bridge {
                Bridge::Between(bridge) => bridge.spec.name.to_owned(),
                other => format!("{other:?}"),
            });
        });
        (name, hash)
    });
    let mut all = BTreeMap::from([(String::from("seed"), graph.seed), (String::from(VERSION_NAME), VERSION)]);
    for (name, hash) in clocks.chain(devices).chain(nodes).chain(edges) {
        // Several connections may share a name.
        let sum = all.entry(name).or_insert(0);
        *sum = sum.wrapping_add(hash);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the definition, worked out apart from this program: another result needs another version.
    #[test]
    fn fingerprints_do_not_change_from_one_program_to_the_next() {
        assert_eq!(VERSION, 3);
        let some = Fingerprint::of(|state| {
            state.text("Gain");
            state.number(7);
            state.maybe(None);
            state.rate(Rate::new(44_100, 7).unwrap());
        });
        assert_eq!(some, 0xdc5d_bef9_b15a_ece7);
    }
}
