//! Inputs and their connections: the second form of a graph.

use super::connection::{At, Wire, resolve};
use super::context::Context;
use super::declared::{Declared, Scope};
use super::expand::{Expanded, missing_input};
use super::given::{self, Given};
use super::{NodeId, TemplateOutput};
use crate::diagnostic::Span;
use crate::document::value::{Name, Shape, Value};
use crate::node::Presence;
use std::ops::{Deref, Index};

/// All nodes with their connections.
pub(super) struct Wired {
    pub nodes: Vec<Connected>,
    pub scopes: Vec<Scope>,
    /// The outputs of nodes to which the outputs of templates lead.
    pub template_outputs: Vec<TemplateOutput>,
}

/// A node with its connections.
pub(super) struct Connected {
    node: Declared,
    pub inputs: Vec<Slot>,
    /// Its device and its clock, as written.
    pub endpoint: Option<Value>,
    pub clock: Option<Value>,
}

/// An input of the processor; each connection of a port that takes several is one.
pub(super) struct Slot {
    /// Index of the input in the spec.
    pub port: usize,
    /// Name of the connection in a map.
    pub name: Option<Name>,
    /// `None` if it is not connected, or an error of it was reported.
    pub wire: Option<Wire>,
    /// True if an error of it was reported.
    pub broken: bool,
}

impl Deref for Connected {
    type Target = Declared;

    fn deref(&self) -> &Declared {
        &self.node
    }
}

impl Connected {
    /// True if an input of it has a reported error.
    pub(super) fn has_broken_input(&self) -> bool {
        self.inputs.iter().any(|slot| slot.broken)
    }

    /// The connections, with the index of each slot.
    pub(super) fn wires(&self) -> impl Iterator<Item = (usize, &Wire)> {
        let slots = self.inputs.iter().enumerate();
        slots.filter_map(|(i, slot)| Some((i, slot.wire.as_ref()?)))
    }

    /// Slots of the input called `name`.
    pub(super) fn slots_of(&self, name: &str) -> impl Iterator<Item = &Slot> {
        let spec = self.entry.spec;
        self.inputs.iter().filter(move |slot| spec.inputs[slot.port].name == name)
    }

    /// True if the slot is a connection of a list or map.
    pub(super) fn is_many(&self, slot: &Slot) -> bool {
        self.entry.spec.inputs[slot.port].presence.is_several()
    }

    /// Name of the port of each connection, place of the connection, and that of its name.
    pub(super) fn places(&self) -> impl Iterator<Item = (&'static str, Span, Span)> {
        self.wires().map(|(slot, wire)| {
            let slot = &self.inputs[slot];
            let name = slot.name.as_ref().map_or(wire.span, |name| name.span);
            (self.entry.spec.inputs[slot.port].name, wire.span, name)
        })
    }

    /// The names that tell its connections apart.
    pub(super) fn connection_names(&self) -> Vec<String> {
        self.inputs.iter().filter_map(|slot| Some(slot.name.as_ref()?.text.clone())).collect()
    }
}

impl Wired {
    /// For each node the nodes that read it, by connections for which `follows` holds with the reader.
    pub(super) fn readers(&self, follows: impl Fn(usize, &Wire) -> bool) -> Readers {
        let visit = |visit: &mut dyn FnMut(usize, usize)| {
            for (to, node) in self.nodes.iter().enumerate() {
                node.wires().filter(|(_, wire)| follows(to, wire)).for_each(|(_, wire)| visit(wire.from, to));
            }
        };
        let mut ends = vec![0; self.nodes.len() + 1];
        visit(&mut |from, _| ends[from + 1] += 1);
        for node in 0..self.nodes.len() {
            ends[node + 1] += ends[node];
        }
        let mut list = vec![0; ends[self.nodes.len()]];
        // Each beginning moves to its end, which is the beginning of the next.
        visit(&mut |from, to| {
            list[ends[from]] = to;
            ends[from] += 1;
        });
        Readers { ends, list }
    }

    /// Name in messages of the output that a connection reads: `tone.out`.
    pub(super) fn source_name(&self, wire: &Wire) -> String {
        self.nodes[wire.from].output_name(wire.output)
    }
}

/// The readers of each node, by index.
pub(super) struct Readers {
    /// Where those of each node end in the list.
    ends: Vec<usize>,
    list: Vec<usize>,
}

impl Index<usize> for Readers {
    type Output = [usize];

    fn index(&self, node: usize) -> &[usize] {
        let start = node.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.list[start..self.ends[node]]
    }
}

/// Fields of a node as written.
struct Written {
    /// By index of the input.
    inputs: Vec<Option<Value>>,
    endpoint: Option<Value>,
    clock: Option<Value>,
}

/// Takes the fields of a node that are no settings.
fn take_fields(node: &mut Declared) -> Written {
    let Declared { entry, fields, .. } = node;
    let inputs = entry.spec.inputs.iter().map(|input| {
        let given = fields.take(input.name);
        if given.is_none() && input.presence != Presence::Optional && !fields.is_reported(input.name) {
            let kind = Name { span: fields.span, text: entry.spec.name.to_owned() };
            fields.miss(input.name, missing_input(&kind, input.name, input.presence));
        }
        given
    });
    Written {
        inputs: inputs.collect(),
        endpoint: entry.has_endpoint().then(|| node.fields.take("endpoint")).flatten(),
        clock: node.fields.take("clock"),
    }
}

/// Resolves every input of every node.
pub(super) fn connect(cx: &mut Context<'_>, mut graph: Expanded) -> Wired {
    let written: Vec<Written> = graph.nodes.iter_mut().map(take_fields).collect();
    let connected = graph.nodes.iter().zip(written).map(|(node, written)| {
        let slots = written.inputs.into_iter().enumerate();
        let inputs =
            slots.flat_map(|(port, given)| slots_of(cx, &graph, node, port, given)).collect::<Vec<Slot>>();
        (inputs, written.endpoint, written.clock)
    });
    let connected: Vec<_> = connected.collect();
    let template_outputs = template_outputs(cx, &graph);
    let Expanded { nodes, scopes } = graph;
    let nodes = nodes.into_iter().zip(connected);
    let nodes = nodes.map(|(node, (inputs, endpoint, clock))| Connected { node, inputs, endpoint, clock });
    Wired { nodes: nodes.collect(), scopes, template_outputs }
}

/// The slots of an input.
fn slots_of(
    cx: &mut Context<'_>,
    graph: &Expanded,
    node: &Declared,
    port: usize,
    given: Option<Value>,
) -> Vec<Slot> {
    let input = &node.entry.spec.inputs[port];
    let given = match given {
        Some(value) => given::connections(cx, node, input, value),
        None if input.presence == Presence::Optional => {
            return vec![Slot { port, name: None, wire: None, broken: false }];
        }
        None => vec![Given::default()],
    };
    let at = At { scope: node.scope, depth: 0 };
    let slot = |Given { name, value }: Given| {
        let before = cx.diagnostics.len();
        let wire = value.as_ref().and_then(|value| resolve(cx, graph, value, at));
        // A number in place of a connection is most likely that of the setting of the same name with a unit.
        if let Some(Value { shape: Shape::Number(_, number), .. }) = &value
            && let Some(setting) = node.entry.specs().iter().find(|setting| {
                let unit = setting.name.strip_prefix(input.name);
                unit.is_some_and(|unit| unit.starts_with('_'))
            })
            && let Some(found) = cx.diagnostics.get_mut(before)
        {
            found.help = vec![format!("did you mean `{}: {number}`?", setting.name)];
        }
        Slot { port, name, broken: wire.is_none(), wire }
    };
    given.into_iter().map(slot).collect()
}

/// The outputs of nodes to which the outputs of templates are resolved.
fn template_outputs(cx: &mut Context<'_>, graph: &Expanded) -> Vec<TemplateOutput> {
    let (document, before) = (cx.document, cx.diagnostics.len());
    let mut found = Vec::new();
    for (scope, place) in graph.scopes.iter().enumerate() {
        let Some((template, _)) = place.template else {
            continue;
        };
        for (name, value) in &document.templates[template].outputs {
            // A bridge makes another signal of it.
            let wire = resolve(cx, graph, value, At { scope, depth: 0 }).filter(|wire| wire.bridge.is_none());
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
