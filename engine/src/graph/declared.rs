//! Nodes as declared, and the scopes of their names.

use super::Bridge;
use crate::diagnostic::{Diagnostic, Span};
use crate::document::value::{Name, Value};
use crate::node::NodeEntry;
use crate::settings::Fields;
use std::collections::HashMap;
use std::ops::Deref;

/// A node of a known kind, as declared.
pub(super) struct Declared {
    /// `texture/filter`
    pub path: String,
    /// Place of its name.
    pub name: Span,
    pub entry: NodeEntry,
    pub fields: Fields,
    /// Index of its scope.
    pub scope: usize,
    /// The use of the template that it is inside of: index of the template, and place of the use.
    pub template: Option<(usize, Span)>,
    /// Values of parameters and settings: (place of the value, place of its use).
    pub uses: Vec<(Span, Span)>,
    /// Names of the members of its family of outputs; `None` after an error of the settings that name them. Then one output
    /// stands for all of them.
    pub members: Option<Vec<String>>,
    /// True if `only` leaves it out with the selected endpoints.
    pub is_left_out: bool,
}

impl Declared {
    /// Number of outputs; the members of the family of outputs follow one another in the place of it.
    pub(super) fn output_count(&self) -> usize {
        match (self.entry.spec.family(), &self.members) {
            (Some(family), Some(members)) => family + members.len(),
            _ => self.entry.spec.outputs.len(),
        }
    }

    /// Name of an output in messages: `tone.out`.
    pub(super) fn output_name(&self, output: usize) -> String {
        match self.port_name(output) {
            Some(port) => format!("{}.{port}", self.path),
            None => self.path.clone(),
        }
    }

    /// Name of an output in the graph file.
    pub(super) fn port_name(&self, output: usize) -> Option<&str> {
        let spec = self.entry.spec;
        match (spec.family(), &self.members) {
            (Some(family), Some(members)) if output >= family => {
                members.get(output - family).map(String::as_str)
            }
            _ => spec.output(output).map(|port| port.name),
        }
    }
}

/// A node with its connections.
pub(super) struct Connected {
    pub node: Declared,
    pub inputs: Vec<Slot>,
    /// Its device and its clock, as written.
    pub endpoint: Option<Box<Value>>,
    pub clock: Option<Box<Value>>,
}

/// An input of the processor; each connection of a port that takes several is one.
pub(super) struct Slot {
    /// Index of the input in the spec.
    pub port: usize,
    /// Name of the connection in a map.
    pub name: Option<Box<Name>>,
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

impl From<Declared> for Connected {
    /// A node whose connections are not resolved yet.
    fn from(node: Declared) -> Self {
        let (endpoint, clock) = (None, None);
        Self { node, inputs: Vec::new(), endpoint, clock }
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

/// A connection, resolved through inputs and outputs of templates to its source node.
#[derive(Debug, Clone)]
pub(super) struct Wire {
    pub from: usize,
    pub output: usize,
    pub bridge: Option<(Bridge, Span)>,
    /// True if the bridge is inside a template, which can be used with any clocks.
    pub general: bool,
    /// Place of the connection.
    pub span: Span,
    /// Place where a template passes it on.
    pub via: Option<Span>,
}

impl Wire {
    /// Adds the place where a template passes the connection on.
    pub(super) fn via(&self, diagnostic: Diagnostic) -> Diagnostic {
        match self.via {
            Some(span) if span != self.span => diagnostic.also(span, "passed on here"),
            _ => diagnostic,
        }
    }

    /// True if a loop through the connection has no declared delay.
    pub(super) fn is_immediate(&self) -> bool {
        !matches!(self.bridge, Some((Bridge::Delay { .. } | Bridge::Ring { .. }, _)))
    }

    /// True if both ends are on one clock.
    pub(super) fn keeps_clock(&self) -> bool {
        matches!(self.bridge, None | Some((Bridge::Delay { .. }, _)))
    }
}

/// A scope of node names: the graph, or one use of a template.
#[derive(Default)]
pub(super) struct Scope {
    /// `texture/`, or empty for the graph.
    pub prefix: String,
    pub names: HashMap<String, Target>,
    /// Index of the template in the document, and the place of its use.
    pub template: Option<(usize, Span)>,
    /// The scope of its use.
    pub outer: usize,
    /// Connections given to the template's inputs, to be resolved in the outer scope; `None` where reported.
    pub inputs: HashMap<String, Option<Value>>,
    /// Values of the template's settings; `None` where reported.
    pub settings: HashMap<String, Option<Value>>,
    /// True if `only` leaves its nodes out with the selected endpoints.
    pub is_left_out: bool,
}

/// Target of a name.
#[derive(Debug, Clone, Copy)]
pub(super) enum Target {
    Node(usize),
    /// A use of a template, by its scope.
    Instance(usize),
    /// Declared, but reported.
    Broken,
}
