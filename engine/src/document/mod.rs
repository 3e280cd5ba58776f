//! Documents: graph files as parsed, every value with its place, before any check.

mod builder;
mod dependence;
pub mod library;
mod load;
pub(crate) mod text;
pub mod value;
mod write;

use crate::diagnostic::{Diagnostic, Diagnostics, Source, SourceId, Sources, Span};
use crate::settings::Settings;
use haptograph_signal::files::MAX_GRAPH_BYTES;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use value::{Name, Value};

pub(crate) use load::refused_name;

pub use builder::{Builder, Part, Wire, Written, average, delay, hold, linear, resample, ring, through};

/// A parsed graph file with the files that it includes.
///
/// Loading fails only if the text is not RON or not a graph. Other errors of structure are kept, and
/// [`check`](crate::graph::check) reports them together with its own.
#[derive(Debug, Clone)]
pub struct Document {
    pub(crate) sources: Sources,
    /// Place of the word `Graph`.
    pub(crate) span: Span,
    pub(crate) about: String,
    pub(crate) seed: u64,
    pub(crate) parameters: Vec<(Name, Value)>,
    /// Other defaults of parameters, by set of endpoints.
    pub(crate) defaults: Vec<(Name, Vec<(Name, Value)>)>,
    pub(crate) clocks: Vec<(Name, Value)>,
    pub(crate) nodes: Vec<(Name, Value)>,
    pub(crate) endpoints: Vec<(Name, Vec<(Name, Value)>)>,
    pub(crate) templates: Vec<Template>,
    /// Included parts of the registry's library, `std/...`.
    pub(crate) library: Vec<Name>,
    pub(crate) findings: Vec<Diagnostic>,
}

/// A template: named nodes that can be used as one node.
#[derive(Debug, Clone)]
pub(crate) struct Template {
    pub name: Name,
    pub about: String,
    pub inputs: Vec<Name>,
    pub settings: Vec<(Name, Value)>,
    pub nodes: Vec<(Name, Value)>,
    pub outputs: Vec<(Name, Value)>,
}

/// Options of loading.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct LoadOptions {
    /// Largest sum of a graph file and its included files, bytes.
    pub max_bytes: u64,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { max_bytes: MAX_GRAPH_BYTES }
    }
}

/// A file of settings that is no graph, such as a study.
#[derive(Debug, Clone)]
pub struct SettingsFile<S> {
    /// The file.
    pub sources: Sources,
    /// What it holds.
    pub content: S,
}

impl<S: Settings> SettingsFile<S> {
    /// Parses a text that holds one `S(format: 1, ...)`, as if it were the file `name`; `file` is what messages call such a
    /// file. Paths in it are relative to its folder.
    ///
    /// # Errors
    /// If the text is not RON, or a field is missing, unknown or wrong: all of them.
    pub fn parse(name: impl AsRef<Path>, text: &str, file: &str) -> Result<Self, Diagnostics> {
        load::settings(name.as_ref(), text.into(), file)
    }

    /// The text at a place of the file.
    pub fn text(&self, span: Span) -> &str {
        self.sources
            .get(span.source)
            .and_then(|source| source.text.get(span.start..span.end))
            .unwrap_or_default()
    }
}

impl Document {
    /// Loads a graph file and the files that it includes.
    ///
    /// # Errors
    /// If a file cannot be read, is not RON, or has no `Graph(...)`.
    pub fn load(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Self, Diagnostics> {
        load::file(path.as_ref(), options)
    }

    /// Parses a text as if it were the file `name`; included files are relative to it.
    ///
    /// # Errors
    /// As [`Document::load`].
    pub fn parse(name: impl AsRef<Path>, text: &str) -> Result<Self, Diagnostics> {
        load::text(name.as_ref(), text.into(), &LoadOptions::default())
    }

    /// The document with the parts of `library`, (name, text), that it includes.
    pub(crate) fn with_library(&self, library: &[(&'static str, &'static str)]) -> Cow<'_, Self> {
        match self.library.is_empty() {
            true => Cow::Borrowed(self),
            false => Cow::Owned(load::library(self.clone(), library)),
        }
    }

    /// The source files, the graph file first.
    pub fn sources(&self) -> &Sources {
        &self.sources
    }

    /// The parameters and their defaults as written.
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
    let parent = |source: &Source| match source.is_file {
        true => source.path.parent().map(Path::to_path_buf),
        false => None,
    };
    sources.get(id).and_then(parent).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The codes of what is wrong with a graph that includes files of these lengths, where all may have 2000 bytes.
    fn codes(lengths: [usize; 2]) -> Vec<&'static str> {
        let folder = std::env::temp_dir().join(format!(
            "haptograph-includes-{}-{}-{}",
            lengths[0],
            lengths[1],
            std::process::id()
        ));
        std::fs::create_dir_all(&folder).unwrap();
        let includes = r#"Graph(format: 1, include: ["a.ron", "b.ron"], clocks: {}, nodes: {})"#;
        for (name, length) in [("a.ron", lengths[0]), ("b.ron", lengths[1])] {
            let text = "Parts(format: 1, templates: {})".to_owned();
            let text = text.clone() + &" ".repeat(length - text.len());
            std::fs::write(folder.join(name), text).unwrap();
        }
        std::fs::write(folder.join("g.ron"), includes).unwrap();
        let options = LoadOptions { max_bytes: 2000 };
        let loaded = Document::load(folder.join("g.ron"), &options);
        std::fs::remove_dir_all(&folder).unwrap();
        let findings = match loaded {
            Ok(document) => document.findings,
            Err(wrong) => wrong.list,
        };
        findings.iter().map(|finding| finding.code).collect()
    }

    #[test]
    fn a_graph_and_all_that_it_includes_have_one_bound() {
        let graph = r#"Graph(format: 1, include: ["a.ron", "b.ron"], clocks: {}, nodes: {})"#.len();
        let left = 2000 - graph;
        assert_eq!(codes([left - 100, 100]), Vec::<&str>::new());
        // Each would fit alone.
        assert_eq!(codes([left - 100, 101]), ["E0108"]);
        assert_eq!(codes([left + 1, 100]), ["E0108"]);
    }
}
