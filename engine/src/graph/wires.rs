//! Inputs and their connections: the second form of a graph.

use super::connection::{At, resolve};
use super::context::Context;
use super::declared::{Connected, Declared, Scope, Slot, Wire};
use super::expand::{Expanded, missing_input};
use super::given::{self, Given};
use super::{NodeId, TemplateOutput};
use crate::document::value::{Name, Shape, Value};
use crate::node::{InputSpec, Presence};
use std::ops::Index;

/// All nodes with their connections.
pub(super) struct Wired {
    pub nodes: Vec<Connected>,
    pub scopes: Vec<Scope>,
    /// The outputs of nodes to which the outputs of templates lead.
    pub template_outputs: Vec<TemplateOutput>,
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

/// Takes the field of an input.
fn take_input(node: &mut Declared, input: &InputSpec) -> Option<Value> {
    let Declared { entry, fields, .. } = node;
    let given = fields.take(input.name);
    if given.is_none() && input.presence != Presence::Optional && !fields.is_reported(input.name) {
        let kind = Name { span: fields.span, text: entry.spec.name.to_owned() };
        fields.miss(input.name, missing_input(&kind, input.name, input.presence));
    }
    given
}

/// Resolves every input of every node, and takes the other fields that are no settings.
pub(super) fn connect(cx: &mut Context<'_>, mut graph: Expanded) -> Wired {
    for index in 0..graph.nodes.len() {
        let entry = graph.nodes[index].entry;
        let mut inputs = Vec::new();
        for (port, input) in entry.spec.inputs.iter().enumerate() {
            let given = take_input(&mut graph.nodes[index].node, input);
            let mut slots = slots_of(cx, &graph, &graph.nodes[index], port, given);
            match inputs.is_empty() {
                true => inputs = slots,
                false => inputs.append(&mut slots),
            }
        }
        let node = &mut graph.nodes[index];
        node.inputs = inputs;
        node.endpoint =
            entry.has_endpoint().then(|| node.node.fields.take("endpoint")).flatten().map(Box::new);
        node.clock = node.node.fields.take("clock").map(Box::new);
    }
    let template_outputs = template_outputs(cx, &graph);
    let Expanded { nodes, scopes } = graph;
    Wired { nodes, scopes, template_outputs }
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
        Slot { port, name: name.map(Box::new), broken: wire.is_none(), wire }
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
