//! Diagnostics: the form in which every stage reports errors and warnings.

mod show;

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

pub(crate) use show::MAX_SHOWN;
pub use show::{render, to_json};

/// A source file of a graph: the graph file itself or an included one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Path as shown to the user; `<graph>` for a graph built in code.
    pub path: PathBuf,
    /// The whole text.
    pub text: Arc<str>,
    /// True if the source was read from a file, not given on the command line, built in code or taken from the template
    /// library.
    pub is_file: bool,
}

/// Index of a [`Source`] in [`Sources`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct SourceId(pub u32);

/// All sources of a graph.
#[derive(Debug, Clone, Default)]
pub struct Sources {
    files: Vec<Source>,
}

impl Sources {
    /// Adds a file and returns its number.
    pub fn add(&mut self, path: PathBuf, text: Arc<str>) -> SourceId {
        self.put(path, text, true)
    }

    /// Adds a text without a file, shown by this name.
    pub(crate) fn add_text(&mut self, name: &str, text: Arc<str>) -> SourceId {
        self.put(name.into(), text, false)
    }

    fn put(&mut self, path: PathBuf, text: Arc<str>, is_file: bool) -> SourceId {
        self.files.push(Source { path, text, is_file });
        SourceId(u32::try_from(self.files.len() - 1).unwrap_or(u32::MAX))
    }

    /// The source with this number, if it exists.
    pub fn get(&self, id: SourceId) -> Option<&Source> {
        self.files.get(id.0 as usize)
    }

    /// All files, the graph file first.
    pub fn iter(&self) -> impl Iterator<Item = &Source> {
        self.files.iter()
    }

    /// 1-based line and column (in characters) of a byte offset.
    pub fn line_column(&self, span: Span) -> (usize, usize) {
        let Some(source) = self.get(span.source) else {
            return (1, 1);
        };
        let before = &source.text[..floor_boundary(&source.text, span.start)];
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

fn floor_boundary(text: &str, offset: usize) -> usize {
    let mut offset = offset.min(text.len());
    while !text.is_char_boundary(offset) {
        offset -= 1;
    }
    offset
}

/// Diagnostics and the sources that they refer to.
#[derive(Debug, Clone, Default)]
pub struct Diagnostics {
    /// The files.
    pub sources: Sources,
    /// All diagnostics, errors and warnings.
    pub list: Vec<Diagnostic>,
}

impl fmt::Display for Diagnostics {
    /// As [`render`], without colour.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&render(self, false))
    }
}

impl std::error::Error for Diagnostics {}

/// A range of bytes in a source file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Span {
    /// The file.
    pub source: SourceId,
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

/// Severity of a diagnostic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The graph does not run.
    Error,
    /// The graph runs but is probably not as intended.
    Warning,
}

/// A span with a label.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    /// Place.
    pub span: Span,
    /// Text; may be empty.
    pub text: String,
}

/// A diagnostic: the error, its place, the reason and the remedy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// A stable code, `E0102` or `W0003`; `docs/diagnostics.md` lists them.
    pub code: &'static str,
    /// Error or warning.
    pub severity: Severity,
    /// The error in one sentence.
    pub message: String,
    /// The value at fault; `None` if it has no text.
    pub primary: Option<Label>,
    /// Related places, labelled `opened here` or `first given here`.
    pub secondary: Vec<Label>,
    /// Remedies, one line each.
    pub help: Vec<String>,
}

impl Diagnostic {
    /// An error at `span`.
    pub fn error(code: &'static str, span: Span, message: impl Into<String>) -> Self {
        Self::new(code, Severity::Error, span, message)
    }

    /// A warning at `span`.
    pub(crate) fn warning(code: &'static str, span: Span, message: impl Into<String>) -> Self {
        Self::new(code, Severity::Warning, span, message)
    }

    /// A field that `owner`, as messages name it, needs; `help` says how to add it.
    pub(crate) fn missing(span: Span, owner: &str, field: &str, help: impl Into<String>) -> Self {
        let message = format!("{owner} needs `{field}`");
        Self::error("E0205", span, message).label(format!("`{field}` is missing")).help(help)
    }

    /// A name that is declared again, with its first place.
    pub(crate) fn declared_twice(span: Span, message: String, first: Span) -> Self {
        Self::error("E0105", span, message).label("declared again here").also(first, "first declared here")
    }

    /// Removes the place.
    #[must_use]
    pub(crate) fn of_no_place(mut self) -> Self {
        self.primary = None;
        self
    }

    fn new(code: &'static str, severity: Severity, span: Span, message: impl Into<String>) -> Self {
        let primary = Some(Label { span, text: String::new() });
        Self { code, severity, message: message.into(), primary, secondary: Vec::new(), help: Vec::new() }
    }

    /// Sets the label of the primary span.
    #[must_use]
    pub fn label(mut self, text: impl Into<String>) -> Self {
        if let Some(primary) = &mut self.primary {
            primary.text = text.into();
        }
        self
    }

    /// Adds a related place.
    #[must_use]
    pub(crate) fn also(mut self, span: Span, text: impl Into<String>) -> Self {
        self.secondary.push(Label { span, text: text.into() });
        self
    }

    /// Adds a remedy.
    #[must_use]
    pub fn help(mut self, text: impl Into<String>) -> Self {
        self.help.push(text.into());
        self
    }
}

impl fmt::Display for Diagnostic {
    /// One line, without the source: `error[E0102]: message`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        write!(f, "{severity}[{}]: {}", self.code, self.message)
    }
}
