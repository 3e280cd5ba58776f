//! The draft: a graph during the check.

use super::Bridge;
use crate::diagnostic::{Diagnostic, MAX_SHOWN, Severity, Sources, Span};
use crate::document::value::{Name, Value};
use crate::document::{Document, folder};
use crate::frame::Kind;
use crate::node::NodeEntry;
use crate::registry::Registry;
use crate::settings::{Fields, Reading};
use haptograph_signal::quantity::Quantity;
use std::collections::HashMap;
use std::path::PathBuf;

/// Context of all checks.
pub(super) struct Context<'a> {
    pub document: &'a Document,
    pub registry: &'a Registry,
    /// The files of the document, then the texts of the command line.
    pub sources: Sources,
    pub diagnostics: Vec<Diagnostic>,
    /// Paths in the settings read so far.
    pub files: Vec<PathBuf>,
}

impl Context<'_> {
    pub fn report(&mut self, diagnostic: Diagnostic) {
        self.diagnostics.push(diagnostic);
    }

    /// True if the next error will be shown, so that a search for suggestions is worthwhile.
    pub fn is_suggesting(&self) -> bool {
        let errors = self.diagnostics.iter().filter(|d| d.severity == Severity::Error);
        errors.take(MAX_SHOWN).count() < MAX_SHOWN
    }

    /// Calls `read` with a reader of settings that reports to this context.
    pub fn reading<T>(&mut self, read: impl FnOnce(&mut Reading<'_>) -> T) -> T {
        let Self { document, sources, diagnostics, files, .. } = self;
        let from_files = document.sources.iter().count();
        read(&mut Reading {
            diagnostics,
            // Paths on the command line are relative to the working directory.
            folder: &|span| match (span.source.0 as usize) < from_files {
                true => folder(sources, span.source),
                false => PathBuf::new(),
            },
            files,
            setting: None,
            first_given: u32::try_from(from_files).unwrap_or(u32::MAX),
        })
    }
}

/// All nodes, templates expanded, and the scopes of their names.
pub(super) struct Draft {
    pub nodes: Vec<DraftNode>,
    /// The graph itself first, then every use of a template.
    pub scopes: Vec<Scope>,
    /// There are too many nodes: the rest is missing, and later checks do not run.
    pub cut: bool,
}

/// A node of a known kind.
pub(super) struct DraftNode {
    /// `texture/filter`
    pub path: String,
    /// Place of its name.
    pub name: Span,
    pub entry: NodeEntry,
    pub fields: Fields,
    /// Index of its scope.
    pub scope: usize,
    /// Values of parameters and settings: (place of the value, place of its use).
    pub uses: Vec<(Span, Span)>,
    pub inputs: Vec<Slot>,
    /// Types of the outputs; the members of the family of outputs follow one another in the place of it.
    pub outputs: Vec<Type>,
    /// Names of the members of the family; `None` after an error of the settings that name them. Then one output stands
    /// for all of them.
    pub members: Option<Vec<String>>,
    pub clock: Option<usize>,
    /// Index of its device in the selected endpoints.
    pub device: Option<usize>,
    /// True if `only` leaves it out with the selected endpoints.
    pub is_left_out: bool,
    /// True if an error of it was reported. Errors that follow from it are not reported.
    pub broken: bool,
}

/// Type of an output, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Type {
    pub kind: Option<Kind>,
    pub quantity: Option<Quantity>,
}

/// An input of the processor; each connection of a port that takes several is one.
pub(super) struct Slot {
    /// Index of the input in the spec.
    pub port: usize,
    /// Name of the connection in a map.
    pub name: Option<Name>,
    pub wire: Option<Wire>,
    /// True if an error of it was reported.
    pub broken: bool,
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

impl DraftNode {
    /// Name of an output in messages: `tone.out`.
    pub fn output_name(&self, output: usize) -> String {
        match self.port_name(output) {
            Some(port) => format!("{}.{port}", self.path),
            None => self.path.clone(),
        }
    }

    /// Name of an output in the graph file.
    pub fn port_name(&self, output: usize) -> Option<&str> {
        let spec = self.entry.spec;
        match (spec.family(), &self.members) {
            (Some(family), Some(members)) if output >= family => {
                members.get(output - family).map(String::as_str)
            }
            _ => spec.output(output).map(|port| port.name),
        }
    }

    /// Names of the outputs in the graph file.
    pub fn port_names(&self) -> impl Iterator<Item = &str> {
        (0..self.outputs.len()).filter_map(|output| self.port_name(output))
    }

    /// True if an input of it has a reported error.
    pub fn has_broken_input(&self) -> bool {
        self.inputs.iter().any(|slot| slot.broken)
    }

    /// The connections.
    pub fn wires(&self) -> impl Iterator<Item = (usize, &Wire)> {
        let slots = self.inputs.iter().enumerate();
        slots.filter_map(|(i, slot)| Some((i, slot.wire.as_ref()?)))
    }

    /// Slots of the input called `name`.
    pub fn slots_of(&self, name: &str) -> impl Iterator<Item = &Slot> {
        let spec = self.entry.spec;
        self.inputs.iter().filter(move |slot| spec.inputs[slot.port].name == name)
    }

    /// True if the slot is a connection of a list or map.
    pub fn is_many(&self, slot: &Slot) -> bool {
        self.entry.spec.inputs[slot.port].presence.is_several()
    }
}

impl Draft {
    /// For each node the nodes that read it by connections for which `follows` holds.
    pub fn readers(&self, follows: impl Fn(&Wire) -> bool) -> Vec<Vec<usize>> {
        let mut readers: Vec<Vec<usize>> = vec![Vec::new(); self.nodes.len()];
        for (to, node) in self.nodes.iter().enumerate() {
            for (_, wire) in node.wires().filter(|(_, wire)| follows(wire)) {
                readers[wire.from].push(to);
            }
        }
        readers
    }

    /// Adds the place of the template's use to a diagnostic of a node inside one.
    pub fn in_use(&self, node: usize, diagnostic: Diagnostic, cx: &Context<'_>) -> Diagnostic {
        match self.scopes[self.nodes[node].scope].template {
            Some((template, span)) => {
                let name = &cx.document.templates[template].name.text;
                diagnostic.also(span, format!("in this use of `{name}`"))
            }
            None => diagnostic,
        }
    }
}
