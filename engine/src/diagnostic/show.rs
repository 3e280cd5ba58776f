//! Diagnostics as text for people and as JSON for editors.

use super::{Diagnostic, Diagnostics, Label, Severity, SourceId, Sources, Span, floor_boundary};
use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use serde_json::{Value, json};

/// The findings in the form of rustc: message, source lines with carets, and help; then their number.
pub fn render(diagnostics: &Diagnostics, colour: bool) -> String {
    let renderer = if colour { Renderer::styled() } else { Renderer::plain() };
    let renderer = renderer.decor_style(DecorStyle::Ascii);
    let sources = &diagnostics.sources;
    let mut text = String::new();
    let shown = shown(&diagnostics.list);
    for diagnostic in shown.clone() {
        text += &renderer.render(&[group(diagnostic, sources)]);
        // Below no lines of a file, help would hang from an empty one.
        let alone = diagnostic.help.iter().filter(|_| has_no_place(diagnostic));
        for help in alone {
            let title = Level::HELP.primary_title(help.as_str());
            text += "\n";
            text += &renderer.render(&[Group::with_title(title)]);
        }
        text += "\n\n";
    }
    let more = diagnostics.list.len() - shown.count();
    if more > 0 {
        text += &format!("{more} more are not shown; fix these first\n");
    }
    text + &summary(&diagnostics.list)
}

/// Largest number of findings that are shown.
pub(crate) const MAX_SHOWN: usize = 100;

/// The findings that are shown, in their order: errors come before warnings where there is no room for all.
fn shown(list: &[Diagnostic]) -> impl Iterator<Item = &Diagnostic> + Clone {
    let errors = list.iter().filter(|d| d.severity == Severity::Error).count();
    let (mut errors, mut warnings) = (errors.min(MAX_SHOWN), MAX_SHOWN.saturating_sub(errors));
    list.iter().filter(move |diagnostic| {
        let left = match diagnostic.severity {
            Severity::Error => &mut errors,
            Severity::Warning => &mut warnings,
        };
        let fits = *left > 0;
        *left -= usize::from(fits);
        fits
    })
}

fn summary(list: &[Diagnostic]) -> String {
    let count = |severity| list.iter().filter(|d| d.severity == severity).count();
    let counted = |n: usize, what: &str| match n {
        0 => None,
        1 => Some(format!("1 {what}")),
        n => Some(format!("{n} {what}s")),
    };
    let parts = [counted(count(Severity::Error), "error"), counted(count(Severity::Warning), "warning")];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    match parts.is_empty() {
        true => String::new(),
        false => parts.join(", ") + "\n",
    }
}

fn group<'a>(diagnostic: &'a Diagnostic, sources: &'a Sources) -> Group<'a> {
    let level = match diagnostic.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let title = level.primary_title(diagnostic.message.as_str()).id(diagnostic.code);
    let mut group = Group::with_title(title);
    let primary = diagnostic.primary.iter().map(|label| (AnnotationKind::Primary, label));
    let secondary = diagnostic.secondary.iter().map(|label| (AnnotationKind::Context, label));
    // Labels of one file share a snippet, unless a line is so long that only what is around a label can be shown.
    type Labels<'a> = Vec<(AnnotationKind, &'a Label)>;
    let mut snippets: Vec<(SourceId, bool, Labels<'_>)> = Vec::new();
    for (kind, label) in primary.chain(secondary) {
        let Some(source) = sources.get(label.span.source) else {
            continue;
        };
        let file = label.span.source;
        let long = lines_around(&source.text, label.span).len() > LONG_LINES;
        match snippets.iter_mut().find(|(of, apart, _)| *of == file && !apart && !long) {
            Some((.., labels)) => labels.push((kind, label)),
            None => snippets.push((file, long, vec![(kind, label)])),
        }
    }
    for (file, long, labels) in snippets {
        let Some(source) = sources.get(file) else { continue };
        let path = source.path.to_string_lossy().into_owned();
        let (from, text, line) = match (long, labels.first()) {
            (true, Some((_, label))) => around(&source.text, label.span),
            _ => (0, source.text.as_ref(), 1),
        };
        let mut snippet = Snippet::source(text).path(path).line_start(line);
        for (kind, label) in labels {
            let span = within(&source.text, label.span);
            let end = span.end.saturating_sub(from).min(text.len());
            let annotation = kind.span(span.start.saturating_sub(from).min(end)..end);
            snippet = snippet.annotation(match label.text.as_str() {
                "" => annotation,
                text => annotation.label(text),
            });
        }
        group = group.element(snippet);
    }
    let beneath = diagnostic.help.iter().filter(|_| !has_no_place(diagnostic));
    group.elements(beneath.map(|help| Level::HELP.message(help.as_str())))
}

fn has_no_place(diagnostic: &Diagnostic) -> bool {
    diagnostic.primary.is_none() && diagnostic.secondary.is_empty()
}

/// Largest length of a labelled line that is shown whole, bytes.
const LONG_LINES: usize = 4096;
/// Characters shown before and after the span's start in a longer line.
const AROUND: usize = 60;

/// The lines that a label is on.
fn lines_around(text: &str, span: Span) -> std::ops::Range<usize> {
    let span = within(text, span);
    let start = text[..span.start].rfind('\n').map_or(0, |at| at + 1);
    let end = text[span.end..].find('\n').map_or(text.len(), |at| span.end + at);
    start..end
}

/// The text around the start of a label in its line, with the position where it begins and the number of the line.
fn around(text: &str, span: Span) -> (usize, &str, usize) {
    let start = within(text, span).start;
    let line = lines_around(text, Span { end: start, ..span });
    let from = floor_boundary(text, start.saturating_sub(AROUND)).max(line.start);
    let to = floor_boundary(text, start + AROUND).min(line.end);
    let number = 1 + text[..start].bytes().filter(|byte| *byte == b'\n').count();
    (from, &text[from..to], number)
}

/// The range as it lies in the text, on the boundaries of letters.
fn within(text: &str, span: Span) -> std::ops::Range<usize> {
    let start = floor_boundary(text, span.start);
    start..floor_boundary(text, span.end).max(start)
}

/// The findings for editors: an array with an object for each.
///
/// ```text
/// {"code": "E0404", "severity": "error", "message": "...", "path": "a.ron", "line": 3, "column": 7,
///  "end_line": 3, "end_column": 12, "start": 40, "end": 45, "label": "...", "related": [{...}], "help": ["..."]}
/// ```
/// Lines and columns count from 1, columns in characters; `start` and `end` are bytes. A finding without a place in a
/// file has only the graph's `path`. If there are more than a hundred findings, the last object, of severity `note` and
/// without a code, states how many are left out.
pub fn to_json(diagnostics: &Diagnostics) -> String {
    let sources = &diagnostics.sources;
    let mut list: Vec<Value> = shown(&diagnostics.list).map(|d| finding(d, sources)).collect();
    let more = diagnostics.list.len() - list.len();
    if more > 0 {
        list.push(json!({ "severity": "note", "message": format!("{more} more are not shown"), "help": [], "related": [] }));
    }
    Value::Array(list).to_string()
}

fn finding(diagnostic: &Diagnostic, sources: &Sources) -> Value {
    let mut object = json!({
        "code": diagnostic.code,
        "severity": match diagnostic.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        },
        "message": diagnostic.message,
        "related": diagnostic.secondary.iter().map(|label| place(label, sources)).collect::<Vec<_>>(),
        "help": diagnostic.help,
    });
    let place = match &diagnostic.primary {
        Some(primary) => place(primary, sources),
        None => sources
            .get(SourceId::default())
            .map_or(Value::Null, |graph| json!({ "path": graph.path.to_string_lossy() })),
    };
    if let (Some(object), Value::Object(place)) = (object.as_object_mut(), place) {
        object.extend(place);
    }
    object
}

fn place(label: &Label, sources: &Sources) -> Value {
    let span = label.span;
    let (line, column) = sources.line_column(span);
    let end = Span { start: span.end.max(span.start), ..span };
    let (end_line, end_column) = sources.line_column(end);
    json!({
        "path": sources.get(span.source).map(|source| source.path.to_string_lossy()),
        "line": line, "column": column, "end_line": end_line, "end_column": end_column,
        "start": span.start, "end": span.end,
        "label": label.text,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    /// As many findings as numbers, each about one letter of a text.
    fn findings(text: &str, places: impl Iterator<Item = usize>) -> Diagnostics {
        let mut sources = Sources::default();
        let source = sources.add("g.ron".into(), Arc::from(text));
        let span = |start| Span { source, start, end: start + 1 };
        let finding =
            |place| Diagnostic::error("E0105", span(place), "twice").label("again").also(span(0), "first");
        Diagnostics { list: places.map(finding).collect(), sources }
    }

    #[test]
    fn at_most_a_hundred_are_shown_and_the_rest_counted() {
        let many = findings(&"x\n".repeat(300), (0..300).map(|k| 2 * k));
        let text = render(&many, false);
        assert_eq!(text.matches("error[E0105]").count(), MAX_SHOWN);
        assert!(text.contains("200 more") && text.ends_with("300 errors\n"), "{text}");
        let json: Vec<Value> = serde_json::from_str(&to_json(&many)).unwrap();
        assert_eq!((json.len(), &json[MAX_SHOWN]["severity"]), (MAX_SHOWN + 1, &json!("note")));
    }

    #[test]
    fn errors_come_before_warnings_where_not_all_are_shown() {
        let mut many = findings(&"x\n".repeat(150), (0..150).map(|k| 2 * k));
        many.list[..80].iter_mut().for_each(|d| d.severity = Severity::Warning);
        let text = render(&many, false);
        assert_eq!(text.matches("error[").count(), 70);
        assert_eq!(text.matches("warning[").count(), 30);
    }

    #[test]
    fn of_a_long_line_only_what_is_around_a_label_is_shown() {
        let text = format!("a\n{}", "x".repeat(100_000));
        let shown = render(&findings(&text, [50_000].into_iter()), false);
        assert!(shown.len() < 2000, "{} bytes", shown.len());
        assert!(shown.contains("g.ron:2"), "{shown}");
    }
}
