//! Loading of a graph whose tablets are replaced by pads.

use super::channels::{self, InputPad, PadSpec};
use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, Graph, Hosted, check, declared_devices};
use haptograph_engine::registry::Registry;
use haptograph_signal::files::{self, Roots};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The set of endpoints that is used unless another is named.
pub(crate) const SIMULATED: &str = "simulated";

/// Inputs of a load besides the text.
#[derive(Debug, Clone)]
pub(crate) struct Source {
    pub path: PathBuf,
    pub registry: Registry,
    /// Parameters that override the defaults.
    pub set: Vec<(String, String)>,
    /// Seed in place of the graph's own.
    pub seed: Option<u64>,
    /// The set of endpoints that supplies the devices other than pads.
    pub endpoints: String,
    /// Folders of surfaces, besides the graph's own.
    pub surfaces: Vec<PathBuf>,
    /// Folders whose files a text may name; `None` if only the user writes the text.
    pub roots: Option<Arc<Roots>>,
    /// Where a changed text is written, if not into the graph's file.
    pub copies: Option<Copies>,
}

/// A folder whose files stay as they are, and the one that gets copies of those that are saved.
#[derive(Debug, Clone)]
pub(crate) struct Copies {
    pub from: PathBuf,
    pub to: PathBuf,
}

impl Copies {
    /// The place of the copy of a file.
    pub(crate) fn place(&self, path: &Path) -> PathBuf {
        path.strip_prefix(&self.from).map_or_else(|_| path.to_owned(), |inside| self.to.join(inside))
    }
}

/// A checked graph.
pub(crate) struct Loaded {
    pub graph: Graph,
    /// Its own text.
    pub text: String,
    /// The endpoints represented by pointers.
    pub pads: Vec<PadSpec>,
    /// The channels of other endpoints that pages can move.
    pub inputs: Vec<InputPad>,
    /// The endpoints that nodes read and that no page can move.
    pub others: Vec<String>,
    /// Names, values and defaults, as RON.
    pub parameters: Vec<(String, String, String)>,
}

impl Loaded {
    /// True if pointers represent this endpoint.
    pub(crate) fn is_pad(&self, endpoint: &str) -> bool {
        self.pads.iter().any(|pad| pad.endpoint == endpoint)
    }
}

impl Source {
    /// The source of a graph's file, with parameters that override the defaults.
    pub(crate) fn new(path: PathBuf, registry: &Registry, set: Vec<(String, String)>) -> Self {
        Self {
            path,
            registry: registry.clone(),
            set,
            seed: None,
            endpoints: SIMULATED.to_owned(),
            surfaces: Vec::new(),
            roots: None,
            copies: None,
        }
    }

    /// The file that gets a saved text.
    pub(crate) fn saved(&self) -> PathBuf {
        self.copies.as_ref().map_or_else(|| self.path.clone(), |copies| copies.place(&self.path))
    }

    /// Runs `work` with file access restricted to the folders that a text may name.
    pub(crate) fn confined<T>(&self, work: impl FnOnce() -> T) -> T {
        match &self.roots {
            Some(roots) => roots.confine(work),
            None => work(),
        }
    }

    /// Reads the text of the graph's file.
    pub(crate) fn read(&self) -> std::io::Result<String> {
        files::read_text(&self.path, LoadOptions::default().max_bytes)
    }

    /// The same source with another value of a parameter.
    pub(crate) fn with(&self, name: String, value: String) -> Self {
        let mut with = self.clone();
        with.set.retain(|(known, _)| *known != name);
        with.set.push((name, value));
        with
    }

    /// The same source with other parameters.
    pub(crate) fn with_set(&self, set: Vec<(String, String)>) -> Self {
        Self { set, ..self.clone() }
    }

    /// Loads a text in place of the file. Parameters that it does not have are ignored.
    pub(crate) fn load(&self, text: &str) -> Result<Loaded, Diagnostics> {
        self.confined(|| self.load_confined(text))
    }

    fn load_confined(&self, text: &str) -> Result<Loaded, Diagnostics> {
        let document = Document::parse(&self.path, text)?;
        let mut options = self.options(&document);
        options.hosted = Hosted::All;
        let hosted = check(&document, &self.registry, &options)?;
        options.hosted = Hosted::AsWritten;
        let real = declared_devices(&document, &self.registry, &options).into_iter();
        let real: Vec<String> = real
            .filter(|device| !device.is_simulated && !device.is_host)
            .map(|device| device.endpoint)
            .collect();
        // What drives a hand that is real cannot drive a pointer.
        let is_real = |endpoint: &str| real.iter().any(|real| real == endpoint);
        let is_driven = |endpoint: &str| hosted.driven_devices().any(|driven| driven.name == endpoint);
        let stays = |endpoint: &str| is_real(endpoint) && is_driven(endpoint);
        let (pads, others) =
            channels::sort(&hosted, stays, || check(&document, &self.registry, &options).ok());
        // What an actuator answers, and what a real device senses, no page replaces.
        let is_lent = |endpoint: &String| !is_driven(endpoint) && !is_real(endpoint);
        let (lent, others): (Vec<_>, Vec<_>) = others.into_iter().partition(is_lent);
        options.hosted = Hosted::Also(pads.iter().map(|pad| pad.endpoint.clone()).collect());
        options.lent = lent;
        let value = |name: &str, default: &str| {
            let set = self.set.iter().rev().find(|(known, _)| known == name);
            set.map_or_else(|| default.to_owned(), |(_, value)| value.clone())
        };
        let parameters = document.parameters();
        let parameters =
            parameters.map(|(name, default)| (name.to_owned(), value(name, default), default.to_owned()));
        let parameters = parameters.collect();
        let graph = check(&document, &self.registry, &options)?;
        let inputs = channels::inputs(&graph, &options.lent);
        Ok(Loaded { graph, text: text.to_owned(), pads, inputs, others, parameters })
    }

    /// Options to check a document, with those of the parameters that it has.
    pub(crate) fn options(&self, document: &Document) -> CheckOptions {
        let set = self.set.iter();
        let set = set.filter(|(name, _)| document.parameters().any(|(known, _)| known == name));
        let mut options = CheckOptions::default().endpoints(&self.endpoints);
        options.seed = self.seed;
        let default_of = |name: &str| {
            let mut parameters = document.parameters();
            parameters.find(|(known, _)| *known == name).map_or("", |(_, default)| default)
        };
        set.fold(options, |options, (name, value)| options.set(name, self.resolved(value, default_of(name))))
    }

    /// Paths in override values are relative to the working directory, paths from the page to the graph's
    /// folder. A missing file in place of one that is there by default is missing in the latter.
    fn resolved(&self, value: &str, default: &str) -> String {
        let beside = |text: &str| {
            let quoted = text.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
            self.folder().join(quoted.unwrap_or(text))
        };
        let is_missing =
            || !files::is_file(Path::new(value.trim_matches('"'))) && files::is_file(&beside(default));
        let path = Some(beside(value)).filter(|path| files::is_file(path) || is_missing());
        let path =
            path.map(|path| path.canonicalize().or_else(|_| std::path::absolute(&path)).unwrap_or(path));
        path.map_or_else(|| value.to_owned(), |path| format!("{:?}", path.to_string_lossy()))
    }

    /// The name of the file without its extension.
    pub(crate) fn name(&self) -> String {
        let stem = self.path.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    }

    /// The folder to which paths in the graph are relative.
    pub(crate) fn folder(&self) -> &Path {
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        folder.unwrap_or(Path::new("."))
    }
}
