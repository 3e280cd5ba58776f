//! Nodes as declared, and the scopes of their names.

use crate::diagnostic::Span;
use crate::document::value::Value;
use crate::node::NodeEntry;
use crate::settings::Fields;
use std::collections::HashMap;

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
