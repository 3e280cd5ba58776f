//! Errors that nodes and devices report about their settings, with their places in the file.

use super::context::Context;
use crate::diagnostic::{Diagnostic, SourceId, Sources, Span};
use crate::document::folder;
use crate::document::value::{Body, Name, Shape, Tagged, Value};
use crate::node::BuildError;
use crate::settings::Fields;
use haptograph_signal::files;
use std::path::Path;

/// Places of the fields of a node or device; looked for only after an error.
pub(super) struct Places<'f> {
    fields: &'f Fields,
    /// Inputs are where their first connection is: name of the port, place of the connection, and that of its name.
    inputs: &'f dyn Fn() -> Vec<(&'static str, Span, Span)>,
}

/// The structure that a value is, or the one at this place of a list: its place and its fields.
fn structure(value: &Value, place: usize) -> Option<(Span, &[(Name, Value)])> {
    let elements = match &value.shape {
        Shape::List(elements) => &elements[..],
        _ => std::slice::from_ref(value),
    };
    let element = elements.get(place)?;
    match &element.shape {
        Shape::Tagged(Tagged { body: Body::Fields(fields), .. }) => Some((element.span, fields)),
        Shape::Tagged(_) => Some((element.span, &[])),
        _ => None,
    }
}

impl<'f> Places<'f> {
    pub(super) fn of(fields: &'f Fields) -> Self {
        Self { fields, inputs: &Vec::new }
    }

    pub(super) fn and_inputs(self, inputs: &'f dyn Fn() -> Vec<(&'static str, Span, Span)>) -> Self {
        Self { inputs, ..self }
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
        let inside = error.inside.and_then(|(field, place)| structure(self.fields.given(field)?, place));
        let inputs = (self.inputs)();
        let connections = || inputs.iter().filter(|(input, ..)| Some(*input) == error.field);
        let owner = inside.map_or(self.fields.span, |(owner, _)| owner);
        let written = match inside {
            Some((_, fields)) => fields.iter().find(|(name, _)| Some(name.text.as_str()) == error.field),
            None => self.fields.remaining().find(|(name, _)| Some(name.text.as_str()) == error.field),
        };
        let input = || connections().map(|(_, span, _)| *span).next().filter(|_| inside.is_none());
        let written = written.map(|(_, value)| value.span).or_else(input);
        let span = written.unwrap_or(owner);
        let connection = error
            .connection
            .and_then(|connection| connections().nth(connection as usize))
            .map(|(.., name)| *name);
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
