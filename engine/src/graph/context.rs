//! What all steps of the check share: the document, the registry, and the findings so far.

use super::declared::Declared;
use crate::diagnostic::{Diagnostic, Diagnostics, MAX_SHOWN, Severity, Sources, Span};
use crate::document::value::{Body, Name, Shape, Tagged, Value};
use crate::document::{Document, folder};
use crate::registry::Registry;
use crate::settings::{Expected, Fields, Reading, closest};
use std::collections::{HashMap, HashSet};
use std::path::PathBuf;
use std::sync::Arc;

/// Largest number of names compared with an unknown one; with 20,000 of each it would take a minute.
const MAX_COMPARED_NAMES: usize = 500;

/// The fields of a structure, shared with the document.
pub(super) type Entries = Arc<[(Name, Value)]>;

/// Context of all steps.
pub(super) struct Context<'a> {
    pub document: &'a Document,
    pub registry: &'a Registry,
    /// The files of the document, then the texts of the command line.
    pub sources: Sources,
    pub diagnostics: Vec<Diagnostic>,
    /// Paths in the settings read so far.
    pub files: Vec<PathBuf>,
    /// Paths of nodes with a reported error. Errors that follow from it are not reported.
    faulty: HashSet<String>,
}

impl<'a> Context<'a> {
    pub(super) fn new(document: &'a Document, registry: &'a Registry) -> Self {
        let (sources, diagnostics) = (document.sources.clone(), Vec::new());
        Self { document, registry, sources, diagnostics, files: Vec::new(), faulty: HashSet::new() }
    }

    pub(super) fn report(&mut self, diagnostic: Diagnostic) {
        self.diagnostics.push(diagnostic);
    }

    /// Reports the error that leaves nothing to return.
    pub(super) fn fail<T>(&mut self, diagnostic: Diagnostic) -> Option<T> {
        self.report(diagnostic);
        None
    }

    /// Reports a diagnostic of a node, with the place of the template's use if it is inside one.
    pub(super) fn report_of(&mut self, node: &Declared, diagnostic: Diagnostic) {
        let diagnostic = self.in_use(node, diagnostic);
        self.report(diagnostic);
    }

    /// Reports an error of a node, after which errors that follow from it are not reported.
    pub(super) fn refuse(&mut self, node: &Declared, diagnostic: Diagnostic) {
        self.blame(node);
        self.report_of(node, diagnostic);
    }

    /// Notes that an error of the node was reported.
    pub(super) fn blame(&mut self, node: &Declared) {
        if !self.is_faulty(node) {
            self.faulty.insert(node.path.clone());
        }
    }

    pub(super) fn is_faulty(&self, node: &Declared) -> bool {
        self.faulty.contains(&node.path)
    }

    pub(super) fn has_errors(&self) -> bool {
        self.diagnostics.iter().any(|d| d.severity == Severity::Error)
    }

    fn in_use(&self, node: &Declared, diagnostic: Diagnostic) -> Diagnostic {
        match node.template {
            Some((template, span)) => {
                let name = &self.document.templates[template].name.text;
                diagnostic.also(span, format!("in this use of `{name}`"))
            }
            None => diagnostic,
        }
    }

    /// Adds the place of use to the diagnostics of values of parameters and settings, from the one with this index on.
    pub(super) fn explain(&mut self, from: usize, uses: &[(Span, Span)]) {
        for diagnostic in &mut self.diagnostics[from..] {
            let Some(at) = diagnostic.primary.as_ref().map(|label| label.span) else {
                continue;
            };
            let holds =
                |value: &Span| value.source == at.source && value.start <= at.start && at.end <= value.end;
            if let Some((_, place)) = uses.iter().find(|(value, _)| holds(value)) {
                *diagnostic = diagnostic.clone().also(*place, "used here");
            }
        }
    }

    /// The same for a node, with the place of the template's use if it is inside one.
    pub(super) fn explain_node(&mut self, from: usize, node: &Declared) {
        self.explain(from, &node.uses);
        for i in from..self.diagnostics.len() {
            self.diagnostics[i] = self.in_use(node, self.diagnostics[i].clone());
        }
    }

    /// Calls `read` with a reader of settings that reports to this context.
    pub(super) fn reading<T>(&mut self, read: impl FnOnce(&mut Reading<'_>) -> T) -> T {
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

    /// Reports a value that is not of the expected type.
    pub(crate) fn mismatch<T>(&mut self, value: &Value, expected: &Expected) -> Option<T> {
        self.reading(|reading| reading.mismatch(value, expected));
        None
    }

    /// The fields of a structure of this kind.
    pub(super) fn fields(&mut self, kind: &Name, entries: Entries) -> Fields {
        self.reading(|reading| Fields::new(["`", &kind.text, "`"].concat(), kind.span, entries, reading))
    }

    /// Name and fields of `Kind(field: value)`; reports any other value.
    pub(super) fn parts<'v>(
        &mut self,
        value: &'v Value,
        expected: &'static str,
    ) -> Option<(&'v Name, Entries)> {
        let Shape::Tagged(Tagged { name: Some(name), body }) = &value.shape else {
            return self.mismatch(value, &Expected::described(expected));
        };
        let at = match body {
            Body::Bare => return Some((name, Entries::default())),
            Body::Fields(fields) => return Some((name, Arc::clone(fields))),
            Body::Tuple(values) => match values.first() {
                None => return Some((name, Entries::default())),
                Some(first) => first,
            },
        };
        let expected = Expected::described(format!("fields of `{}`, `name: value`", name.text));
        let first = self.registry.node_meant(&name.text).and_then(|entry| entry.spec.inputs.first());
        let before = self.diagnostics.len();
        self.reading(|reading| reading.mismatch(at, &expected));
        if let (Some(input), Shape::String(node), Some(diagnostic)) =
            (first, &at.shape, self.diagnostics.get_mut(before))
        {
            let (open, close) = input.presence.brackets();
            diagnostic.help.push(format!("inputs are named: `{}: {open}\"{node}\"{close}`", input.name));
        }
        None
    }

    /// Reports a set of endpoints that the graph does not have.
    pub(super) fn refuse_unknown_set(&mut self, set: &str, written: Option<Span>) {
        let document = self.document;
        let declared = || document.endpoints.iter().map(|(name, _)| name.text.as_str());
        if declared().all(|known| known != set) {
            let message = format!("the graph has no set of endpoints `{set}`");
            let diagnostic = Diagnostic::error("E0210", written.unwrap_or_default(), message);
            let diagnostic = match written {
                Some(_) => diagnostic.label("unknown set of endpoints"),
                None => diagnostic.of_no_place(),
            };
            let diagnostic = self.suggest(diagnostic, set, declared(), "its sets are", "it has none");
            self.report(diagnostic);
        }
    }

    /// True if the next error will be shown, so that a search for suggestions is worthwhile.
    fn is_suggesting(&self) -> bool {
        let errors = self.diagnostics.iter().filter(|d| d.severity == Severity::Error);
        errors.take(MAX_SHOWN).count() < MAX_SHOWN
    }

    /// The names in order, as long as [`suggest`](Self::suggest) still needs them.
    pub(super) fn in_order<'n, T>(&self, known: &'n HashMap<String, T>) -> std::vec::IntoIter<&'n str> {
        let mut names: Vec<&str> = match self.is_suggesting() {
            true => known.keys().map(String::as_str).collect(),
            false => Vec::new(),
        };
        // Those behind them are only counted.
        let compared = names.len().min(MAX_COMPARED_NAMES);
        if compared < names.len() {
            names.select_nth_unstable(compared);
        }
        names[..compared].sort_unstable();
        names.into_iter()
    }

    /// Adds "did you mean", or what there is to choose from, to findings that can still be shown.
    pub(super) fn suggest<'n>(
        &self,
        diagnostic: Diagnostic,
        word: &str,
        known: impl Iterator<Item = &'n str> + Clone,
        choices: &str,
        none: &str,
    ) -> Diagnostic {
        const SHOWN: usize = 12;
        if !self.is_suggesting() {
            return diagnostic;
        }
        if let Some(near) = closest(word, known.clone().take(MAX_COMPARED_NAMES)) {
            return diagnostic.help(format!("did you mean `{near}`?"));
        }
        let total = known.clone().count();
        let list = known.take(SHOWN).collect::<Vec<_>>().join(", ");
        diagnostic.help(match total {
            0 => none.to_owned(),
            _ if total > SHOWN => format!("{choices} {list} and {} more", total - SHOWN),
            _ => format!("{choices} {list}"),
        })
    }

    /// Sorts the findings by place and removes duplicates: an error in a template is found in each of its uses.
    pub(super) fn put_in_order(&mut self) {
        let place = |d: &Diagnostic| d.primary.as_ref().map(|label| (label.span.source, label.span.start));
        self.diagnostics.sort_by_key(place);
        let mut seen = HashSet::new();
        // Missing fields share a place; their labels differ.
        self.diagnostics.retain(|d| match &d.primary {
            Some(label) => {
                seen.insert((d.code, label.span, label.text.clone(), d.severity == Severity::Error))
            }
            None => true,
        });
    }

    pub(super) fn into_diagnostics(self) -> Diagnostics {
        Diagnostics { sources: self.sources, list: self.diagnostics }
    }
}
