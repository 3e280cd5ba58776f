//! Errors that nodes and devices report about their settings, with their places in the file.

use super::context::Context;
use crate::diagnostic::{Diagnostic, SourceId, Sources, Span};
use crate::document::folder;
use crate::document::value::{Body, Name, Shape, Value};
use crate::node::BuildError;
use crate::settings::Fields;
use haptograph_signal::files;
use std::path::Path;

/// Places of the fields of a node or device.
pub(super) struct Places {
    owner: Span,
    fields: Vec<(String, Span)>,
    /// Structures in fields, alone or in a list.
    structures: Vec<Structure>,
    /// The input of each connection, and the place of its name, or of itself.
    connections: Vec<(&'static str, Span)>,
}

struct Structure {
    field: String,
    place: usize,
    span: Span,
    fields: Vec<(String, Span)>,
}

/// The structures that a field is or lists.
fn structures(field: &Name, value: &Value) -> Vec<Structure> {
    let elements = match &value.shape {
        Shape::List(elements) => &elements[..],
        _ => std::slice::from_ref(value),
    };
    let elements = elements.iter().enumerate();
    let structure = |(place, value): (usize, &Value)| match &value.shape {
        Shape::Tagged(tagged) => Some(Structure {
            field: field.text.clone(),
            place,
            span: value.span,
            fields: match &tagged.body {
                Body::Fields(fields) => spans(fields),
                _ => Vec::new(),
            },
        }),
        _ => None,
    };
    elements.filter_map(structure).collect()
}

fn spans(fields: &[(Name, Value)]) -> Vec<(String, Span)> {
    let fields = fields.iter();
    fields.map(|(name, value)| (name.text.clone(), value.span)).collect()
}

impl Places {
    pub(super) fn of(fields: &Fields) -> Self {
        let written = fields.remaining();
        let structures = written.iter().flat_map(|(name, value)| structures(name, value));
        Self {
            owner: fields.span,
            fields: spans(written),
            structures: structures.collect(),
            connections: Vec::new(),
        }
    }

    /// Inputs are where their first connection is: name of the port, place of the connection, and that of its name.
    pub(super) fn and_inputs(
        mut self,
        connections: impl Iterator<Item = (&'static str, Span, Span)>,
    ) -> Self {
        for (port, span, name) in connections {
            self.fields.push((port.to_owned(), span));
            self.connections.push((port, name));
        }
        self
    }

    pub(super) fn or_report<T>(&self, cx: &mut Context<'_>, built: Result<T, BuildError>) -> Option<T> {
        match built {
            Ok(built) => Some(built),
            Err(error) => {
                let make = |span, message| Diagnostic::error("E0304", span, message);
                let is_part = error.part.is_some();
                let mut diagnostic = self.finding(&cx.sources, error, make);
                let parameter = || parameter_in_text(cx, &diagnostic).filter(|_| is_part);
                if let Some(help) = not_there(cx, &diagnostic).or_else(parameter) {
                    diagnostic.help = vec![help];
                }
                cx.report(diagnostic);
                None
            }
        }
    }

    pub(super) fn warn(&self, cx: &mut Context<'_>, doubt: BuildError) {
        let make = |span, message| Diagnostic::warning("W0107", span, message);
        let diagnostic = self.finding(&cx.sources, doubt, make);
        cx.report(diagnostic);
    }

    /// An error that a node reports about itself, at the setting that it concerns.
    fn finding(
        &self,
        sources: &Sources,
        error: BuildError,
        make: impl FnOnce(Span, String) -> Diagnostic,
    ) -> Diagnostic {
        let structure = error.inside.and_then(|(field, place)| {
            let mut structures = self.structures.iter();
            structures.find(|structure| structure.field == field && structure.place == place)
        });
        let (owner, fields) =
            structure.map_or((self.owner, &self.fields), |structure| (structure.span, &structure.fields));
        let written = fields.iter().find(|(name, _)| Some(name.as_str()) == error.field);
        let span = written.map_or(owner, |(_, span)| *span);
        let connection = error.connection.and_then(|connection| {
            let of_input = self.connections.iter().filter(|(input, _)| Some(*input) == error.field);
            of_input.map(|(_, span)| *span).nth(connection as usize)
        });
        let part = error.part.and_then(|part| part_of_text(sources, span, part));
        let mut diagnostic = make(part.or(connection).unwrap_or(span), error.message);
        if let (Some(field), None) = (error.field, written) {
            diagnostic = diagnostic.label(format!("by the default of `{field}`"));
        }
        if let Some(help) = error.help {
            diagnostic = diagnostic.help(help);
        }
        diagnostic
    }
}

/// Help for a word in a text, such as a formula, that is the name of a parameter.
fn parameter_in_text(cx: &Context<'_>, diagnostic: &Diagnostic) -> Option<String> {
    let span = diagnostic.primary.as_ref()?.span;
    let word = cx.sources.get(span.source)?.text.get(span.start..span.end)?;
    cx.document.parameters().find(|(name, _)| *name == word)?;
    Some(format!(
        "`{word}` is a parameter of the graph, and this text can use only the node's inputs: multiply by `Gain(gain: \
         Param(\"{word}\"))`, or make it an input, `Constant(value: Param(\"{word}\"))`"
    ))
}

/// Help for a path that leads to no file: the folder from which a path of a given value, or of a running graph, is
/// resolved.
fn not_there(cx: &Context<'_>, diagnostic: &Diagnostic) -> Option<String> {
    let span = diagnostic.primary.as_ref()?.span;
    let is_given = span.source.0 as usize >= cx.document.sources.iter().count();
    let written = cx.sources.get(span.source)?.text.get(span.start..span.end)?;
    let written = Path::new(written.trim_matches('"'));
    let is_there = |path: &Path| path.exists() || files::similar(path).is_some();
    if !is_given || !cx.files.iter().any(|file| file == written) || is_there(written) {
        return None;
    }
    let beside = folder(&cx.sources, SourceId::default()).join(written);
    let found = match files::is_file(&beside) {
        true => format!("; there is {}", beside.display()),
        false => String::new(),
    };
    Some(format!("a path in the value given for a parameter is relative to the working directory{found}"))
}

/// The place of some characters of a text that is written in plain quotes, without escapes.
pub(super) fn part_of_text(sources: &Sources, span: Span, (first, end): (usize, usize)) -> Option<Span> {
    let written = sources.get(span.source)?.text.get(span.start..span.end)?;
    let text = written.strip_prefix('"')?.strip_suffix('"')?;
    if text.contains('\\') {
        return None;
    }
    let byte = |characters: usize| text.char_indices().nth(characters).map_or(text.len(), |(at, _)| at);
    let (start, end) = (span.start + 1 + byte(first), span.start + 1 + byte(end));
    (start < end).then_some(Span { start, end, ..span })
}
