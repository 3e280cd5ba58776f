//! Diagnostics as a person reads them, and as an editor does.

use super::{Diagnostic, Diagnostics, Label, Severity, SourceId, Sources, Span, floor_boundary};
use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use serde_json::{Value, json};

/// The findings as rustc would show them: message, source lines with carets, help; then how many there are.
pub fn render(diagnostics: &Diagnostics, colour: bool) -> String {
    let renderer = if colour {
        Renderer::styled()
    } else {
        Renderer::plain()
    };
    let renderer = renderer.decor_style(DecorStyle::Ascii);
    let sources = &diagnostics.sources;
    let mut text = String::new();
    for diagnostic in &diagnostics.list {
        text += &renderer.render(&[group(diagnostic, sources)]);
        text += "\n\n";
    }
    text + &summary(&diagnostics.list)
}

fn summary(list: &[Diagnostic]) -> String {
    let count = |severity| list.iter().filter(|d| d.severity == severity).count();
    let counted = |n: usize, what: &str| match n {
        0 => None,
        1 => Some(format!("1 {what}")),
        n => Some(format!("{n} {what}s")),
    };
    let parts = [
        counted(count(Severity::Error), "error"),
        counted(count(Severity::Warning), "warning"),
    ];
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
    let title = level
        .primary_title(diagnostic.message.as_str())
        .id(diagnostic.code);
    let mut group = Group::with_title(title);
    let mut files: Vec<SourceId> = Vec::new();
    let labels = || diagnostic.primary.iter().chain(&diagnostic.secondary);
    for label in labels() {
        if !files.contains(&label.span.source) {
            files.push(label.span.source);
        }
    }
    for file in files {
        let Some(source) = sources.get(file) else { continue };
        let mut snippet =
            Snippet::source(source.text.as_ref()).path(source.path.to_string_lossy().into_owned());
        let primary = diagnostic
            .primary
            .iter()
            .map(|label| (AnnotationKind::Primary, label));
        let secondary = diagnostic
            .secondary
            .iter()
            .map(|label| (AnnotationKind::Context, label));
        for (kind, label) in primary
            .chain(secondary)
            .filter(|(_, label)| label.span.source == file)
        {
            let annotation = kind.span(within(&source.text, label.span));
            snippet = snippet.annotation(match label.text.as_str() {
                "" => annotation,
                text => annotation.label(text),
            });
        }
        group = group.element(snippet);
    }
    group.elements(
        diagnostic
            .help
            .iter()
            .map(|help| Level::HELP.message(help.as_str())),
    )
}

/// The range as it lies in the text, on the boundaries of letters.
fn within(text: &str, span: Span) -> std::ops::Range<usize> {
    let start = floor_boundary(text, span.start);
    start..floor_boundary(text, span.end).max(start)
}

/// The findings for editors: an array of objects, one each.
///
/// ```text
/// {"code": "E0404", "severity": "error", "message": "...", "path": "a.ron", "line": 3, "column": 7,
///  "end_line": 3, "end_column": 12, "start": 40, "end": 45, "label": "...", "related": [{...}], "help": ["..."]}
/// ```
/// Lines and columns count from 1, columns in characters; `start` and `end` are bytes. A finding about no place in
/// a file has no `path` and what follows from it.
pub fn to_json(diagnostics: &Diagnostics) -> String {
    let sources = &diagnostics.sources;
    let list: Vec<Value> = diagnostics.list.iter().map(|d| finding(d, sources)).collect();
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
    if let Some(primary) = &diagnostic.primary
        && let (Some(object), Value::Object(place)) = (object.as_object_mut(), place(primary, sources))
    {
        object.extend(place);
    }
    object
}

fn place(label: &Label, sources: &Sources) -> Value {
    let span = label.span;
    let (line, column) = sources.line_column(span);
    let end = Span {
        start: span.end.max(span.start),
        ..span
    };
    let (end_line, end_column) = sources.line_column(end);
    json!({
        "path": sources.get(span.source).map(|source| source.path.to_string_lossy()),
        "line": line, "column": column, "end_line": end_line, "end_column": end_column,
        "start": span.start, "end": span.end,
        "label": label.text,
    })
}
