//! A graph on its way to being proved sound.

use super::Bridge;
use crate::diagnostic::{Diagnostic, MAX_SHOWN, Severity, Sources, Span};
use crate::document::value::Value;
use crate::document::{Document, folder};
use crate::frame::Kind;
use crate::node::{NodeEntry, Presence};
use crate::registry::Registry;
use crate::settings::{Fields, Reading};
use haptograph_signal::quantity::Quantity;
use std::collections::HashMap;
use std::path::PathBuf;

/// What every check reads and reports to.
pub(super) struct Context<'a> {
    pub document: &'a Document,
    pub registry: &'a Registry,
    /// The files of the document, then the texts given on the command line.
    pub sources: Sources,
    pub diagnostics: Vec<Diagnostic>,
    /// Paths among the settings read so far.
    pub files: Vec<PathBuf>,
}

impl Context<'_> {
    pub fn report(&mut self, diagnostic: Diagnostic) {
        self.diagnostics.push(diagnostic);
    }

    /// Will what is found next be shown, and is it worth a search for what was meant?
    pub fn is_suggesting(&self) -> bool {
        let errors = self.diagnostics.iter().filter(|d| d.severity == Severity::Error);
        errors.take(MAX_SHOWN).count() < MAX_SHOWN
    }

    /// Does something with the reader of settings, which reports here.
    pub fn reading<T>(&mut self, read: impl FnOnce(&mut Reading<'_>) -> T) -> T {
        let Self {
            document,
            sources,
            diagnostics,
            files,
            ..
        } = self;
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

/// All nodes, templates expanded, and the scopes in which their names are looked up.
pub(super) struct Draft {
    pub nodes: Vec<DraftNode>,
    /// The graph itself first, then every use of a template.
    pub scopes: Vec<Scope>,
    /// There were too many nodes: the rest is missing, and nothing that follows can be believed.
    pub cut: bool,
}

/// A node of a known kind.
pub(super) struct DraftNode {
    /// `texture/filter`
    pub path: String,
    /// Its name in the file.
    pub name: Span,
    pub entry: NodeEntry,
    pub fields: Fields,
    /// Where it stands, as an index of the scopes.
    pub scope: usize,
    /// Values that came from elsewhere: their own place, and where they are used.
    pub uses: Vec<(Span, Span)>,
    pub inputs: Vec<Slot>,
    pub outputs: Vec<Type>,
    pub clock: Option<usize>,
    /// Among the devices of the selected endpoints.
    pub device: Option<usize>,
    /// It is there with another set of endpoints only.
    pub is_left_out: bool,
    /// Something about it was reported; what would follow from that is not.
    pub broken: bool,
}

/// What an output carries, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Type {
    pub kind: Option<Kind>,
    pub quantity: Option<Quantity>,
}

/// An input as the processor will see it: a connection of a `Many` port each.
pub(super) struct Slot {
    /// Index among the inputs of the spec.
    pub port: usize,
    pub wire: Option<Wire>,
    /// What was written there has been reported.
    pub broken: bool,
}

/// A connection, followed through inputs and outputs of templates to the node it comes from.
#[derive(Debug, Clone)]
pub(super) struct Wire {
    pub from: usize,
    pub output: usize,
    pub bridge: Option<(Bridge, Span)>,
    /// Was the bridge written inside a template, which cannot know the clocks it will be used with?
    pub general: bool,
    /// The written connection.
    pub span: Span,
    /// Where templates hand it on.
    pub via: Option<Span>,
}

/// Where names of nodes are looked up: the graph, or one use of a template.
#[derive(Default)]
pub(super) struct Scope {
    /// `texture/`, or empty for the graph.
    pub prefix: String,
    pub names: HashMap<String, Target>,
    /// Index of the template among the document's, and the place of its use.
    pub template: Option<(usize, Span)>,
    /// The scope in which it is used.
    pub outer: usize,
    /// Connections given to the template's inputs, to be resolved in the outer scope; `None` where reported.
    pub inputs: HashMap<String, Option<Value>>,
    /// Values of the template's settings; `None` where reported.
    pub settings: HashMap<String, Option<Value>>,
    /// Its nodes are there with another set of endpoints only.
    pub is_left_out: bool,
}

/// What a name stands for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Target {
    Node(usize),
    /// The scope of a use of a template.
    Instance(usize),
    /// Declared, but reported.
    Broken,
}

impl DraftNode {
    /// `` `out` of `tone` `` in messages: `tone.out`.
    pub fn output_name(&self, output: usize) -> String {
        match self.entry.spec.outputs.get(output) {
            Some(port) => format!("{}.{}", self.path, port.name),
            None => self.path.clone(),
        }
    }

    /// Has it an input that was written but could not be understood?
    pub fn has_broken_input(&self) -> bool {
        self.inputs.iter().any(|slot| slot.broken)
    }

    /// The connections that are there.
    pub fn wires(&self) -> impl Iterator<Item = (usize, &Wire)> {
        let slots = self.inputs.iter().enumerate();
        slots.filter_map(|(i, slot)| Some((i, slot.wire.as_ref()?)))
    }

    /// Slots of the input called `name`.
    pub fn slots_of(&self, name: &str) -> impl Iterator<Item = &Slot> {
        let spec = self.entry.spec;
        self.inputs
            .iter()
            .filter(move |slot| spec.inputs[slot.port].name == name)
    }

    /// Are these slots connections of one list?
    pub fn is_many(&self, slot: &Slot) -> bool {
        self.entry.spec.inputs[slot.port].presence == Presence::Many
    }
}

impl Draft {
    /// For each node the nodes that read it by a connection of which `follows` holds.
    pub fn readers(&self, follows: impl Fn(&Wire) -> bool) -> Vec<Vec<usize>> {
        let mut readers: Vec<Vec<usize>> = vec![Vec::new(); self.nodes.len()];
        for (to, node) in self.nodes.iter().enumerate() {
            for (_, wire) in node.wires().filter(|(_, wire)| follows(wire)) {
                readers[wire.from].push(to);
            }
        }
        readers
    }

    /// Adds where the template is used to a finding about a node inside one.
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
