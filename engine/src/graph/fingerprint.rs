//! What makes two nodes the same but for their path: what a running node's state can be handed over by.

use super::clocks::Clocks;
use super::devices::DraftDevice;
use super::draft::{Context, Draft};
use crate::document::folder;
use crate::document::value::{Body, Shape, Tagged, Value};
use crate::frame::Kind;
use crate::settings::Fields;
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

/// The meaning of a value: not its place, but for strings the folder that a path would be relative to.
fn value(cx: &Context<'_>, given: &Value, state: &mut DefaultHasher) {
    std::mem::discriminant(&given.shape).hash(state);
    match &given.shape {
        Shape::Unit => {}
        Shape::Bool(flag) => flag.hash(state),
        Shape::Number(number, _) => number.to_bits().hash(state),
        Shape::String(text) => {
            text.hash(state);
            let folder = folder(&cx.sources, given.span.source);
            folder.hash(state);
            file(&folder.join(text), state);
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

/// If there is such a file: which version of it, as what a node reads from a file is part of what the node is.
fn file(path: &Path, state: &mut DefaultHasher) {
    let Ok(found) = path.metadata() else { return };
    if found.is_file() {
        found.len().hash(state);
        found.modified().ok().hash(state);
    }
}
