//! A graph file as written: RON in, every value with its place, nothing yet known of its meaning.

mod builder;
mod load;
pub(crate) mod text;
pub mod value;

use crate::diagnostic::{Diagnostic, Diagnostics, Source, SourceId, Sources, Span};
use std::path::{Path, PathBuf};
use value::{Name, Value};

pub use builder::{Builder, Part, Wire, Written, average, delay, hold, linear, resample, ring};

/// A graph file and the files it includes, as written.
///
/// Only text that is not RON at all, or no graph, prevents a document. Other errors of its structure are kept and
/// reported by [`check`](crate::graph::check) together with the rest, so that all are seen at once.
#[derive(Debug, Clone)]
pub struct Document {
    pub(crate) sources: Sources,
    /// Of the word `Graph`.
    pub(crate) span: Span,
    pub(crate) about: String,
    pub(crate) seed: u64,
    pub(crate) parameters: Vec<(Name, Value)>,
    pub(crate) clocks: Vec<(Name, Value)>,
    pub(crate) nodes: Vec<(Name, Value)>,
    pub(crate) endpoints: Vec<(Name, Vec<(Name, Value)>)>,
    pub(crate) templates: Vec<Template>,
    pub(crate) findings: Vec<Diagnostic>,
}

/// Nodes with a name, to be used as if they were one.
#[derive(Debug, Clone)]
pub(crate) struct Template {
    pub name: Name,
    pub inputs: Vec<Name>,
    pub settings: Vec<(Name, Value)>,
    pub nodes: Vec<(Name, Value)>,
    pub outputs: Vec<(Name, Value)>,
}

/// How documents are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LoadOptions {
    /// What a graph file and all that it includes may have together, bytes.
    pub max_bytes: u64,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { max_bytes: 16 << 20 }
    }
}

impl Document {
    /// Reads the file and all that it includes.
    ///
    /// # Errors
    /// Files that cannot be read, are not RON, or hold no `Graph(...)`.
    pub fn load(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Self, Diagnostics> {
        load::file(path.as_ref(), options)
    }

    /// Reads a text as if it stood in a file called `name`; what it includes is looked for beside that file.
    ///
    /// # Errors
    /// As [`Document::load`].
    pub fn parse(name: impl AsRef<Path>, text: &str) -> Result<Self, Diagnostics> {
        load::text(name.as_ref(), text, &LoadOptions::default())
    }

    /// What the graph is about, as the file tells it.
    pub fn about(&self) -> &str {
        &self.about
    }

    /// The files it was read from, the graph file first.
    pub fn sources(&self) -> &Sources {
        &self.sources
    }

    /// Its parameters and their defaults as written.
    pub fn parameters(&self) -> impl Iterator<Item = (&str, &str)> {
        let text = |span: Span| {
            let source = self.sources.get(span.source)?;
            source.text.get(span.start..span.end)
        };
        self.parameters
            .iter()
            .map(move |(name, value)| (name.text.as_str(), text(value.span).unwrap_or_default()))
    }

    /// Names of the sets of endpoints: `simulated`, `live`.
    pub fn endpoints(&self) -> impl Iterator<Item = &str> {
        self.endpoints.iter().map(|(name, _)| name.text.as_str())
    }
}

/// The folder that paths written in a file are relative to.
pub(crate) fn folder(sources: &Sources, id: SourceId) -> PathBuf {
    let parent = |source: &Source| source.path.parent().map(Path::to_path_buf);
    sources.get(id).and_then(parent).unwrap_or_default()
}
