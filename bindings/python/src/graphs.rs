//! Graphs: read and checked once, and checked again with the parameters of a run.

use crate::errors::{Failure, diagnostics};
use crate::players::Player;
use crate::prototypes::{NodeClass, Scripts, checked};
use crate::runs::{self, Signal, Told};
use crate::work::{apart, apart_with};
use haptograph::engine::diagnostic::Diagnostics;
use haptograph::engine::document::{Document, LoadOptions};
use haptograph::engine::graph::{self as engine, CheckOptions, Hosted};
use haptograph::engine::node::NodeEntry;
use haptograph::report::drawing::standalone_svg;
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A checked graph.
#[pyclass(frozen, module = "haptograph._native")]
pub struct Graph {
    document: Arc<Document>,
    options: CheckOptions,
    graph: Arc<engine::Graph>,
    name: String,
    /// Kinds of nodes in Python.
    nodes: Vec<NodeEntry>,
}

/// Options of checking a graph.
#[derive(FromPyObject, Clone)]
pub(crate) struct Checking {
    #[pyo3(item)]
    set: Vec<(String, String)>,
    #[pyo3(item)]
    seed: Option<u64>,
    #[pyo3(item)]
    endpoints: Option<String>,
}

/// Options of a run.
#[derive(FromPyObject)]
pub(crate) struct RunRequest<'py> {
    #[pyo3(item)]
    seconds: Option<f64>,
    #[pyo3(item)]
    inputs: Vec<(String, PyReadonlyArray2<'py, f64>, bool)>,
    #[pyo3(item)]
    probes: Option<Vec<String>>,
    #[pyo3(item)]
    folder: Option<PathBuf>,
}

impl Checking {
    /// The options of a graph, overridden by these.
    fn over(&self, usual: &CheckOptions) -> Result<CheckOptions, Failure> {
        let mut options = usual.clone();
        for (number, (name, _)) in self.set.iter().enumerate() {
            if self.set[..number].iter().any(|(known, _)| known == name) {
                return Err(Failure::Message(format!("`{name}` is set twice")));
            }
            options.set.retain(|(known, _)| known != name);
        }
        options.set.extend(self.set.iter().cloned());
        options.seed = self.seed.or(options.seed);
        if let Some(endpoints) = &self.endpoints {
            options.endpoints.clone_from(endpoints);
        }
        Ok(options)
    }
}

impl Graph {
    fn new(
        py: Python<'_>,
        (document, path): (Document, &Path),
        checking: &Checking,
        nodes: &[Py<NodeClass>],
    ) -> PyResult<Self> {
        let nodes: Vec<NodeEntry> = nodes.iter().map(|node| node.get().entry).collect();
        let options = checking.over(&CheckOptions::default());
        let options = options.map_err(|failure| failure.raise(py))?;
        let document = Arc::new(document);
        // Nodes in Python are built on the caller's thread, where they hear ctrl-C.
        let graph = match nodes.is_empty() {
            true => {
                let (document, options) = (Arc::clone(&document), options.clone());
                apart(py, (None, false), move |_| Ok(checked(&document, &[], &options)?.0))?
            }
            false => {
                let checked = py.detach(|| checked(&document, &nodes, &options));
                checked.map_err(|failure| failure.raise(py))?.0
            }
        };
        Ok(Self {
            document,
            options,
            graph: Arc::new(graph),
            name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            nodes,
        })
    }

    /// The graph of a run, and its nodes in Python.
    fn again(
        &self,
        py: Python<'_>,
        checking: &Checking,
        hosted: Hosted,
    ) -> PyResult<(engine::Graph, Scripts)> {
        let made = || -> Result<_, Failure> {
            let mut options = checking.over(&self.options)?;
            options.hosted = hosted;
            let (graph, scripts) = checked(&self.document, &self.nodes, &options)?;
            has_endpoints(&graph, &options.hosted)?;
            Ok((graph, scripts))
        };
        py.detach(made).map_err(|failure| failure.raise(py))
    }
}

fn has_endpoints(graph: &engine::Graph, hosted: &Hosted) -> Result<(), Failure> {
    let Hosted::Also(names) = hosted else {
        return Ok(());
    };
    let known: Vec<&str> = graph.devices().iter().map(|device| device.name.as_str()).collect();
    match names.iter().find(|name| !known.contains(&name.as_str())) {
        None => Ok(()),
        Some(name) => {
            Err(Failure::Message(format!("the graph has no endpoint `{name}`: it has {}", known.join(", "))))
        }
    }
}

/// Endpoints of channels: `stylus` of `stylus.force`.
fn endpoints<'a>(channels: impl Iterator<Item = &'a str>) -> Hosted {
    let endpoint = |name: &str| name.split('.').next().unwrap_or_default().to_owned();
    let mut names: Vec<String> = channels.map(endpoint).collect();
    names.dedup();
    Hosted::Also(names)
}

#[pymethods]
impl Graph {
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, checking: Checking, nodes: Vec<Py<NodeClass>>) -> PyResult<Self> {
        let from = path.clone();
        let document =
            apart(py, (None, false), move |_| Ok(Document::load(&from, &LoadOptions::default())?))?;
        Self::new(py, (document, &path), &checking, &nodes)
    }

    #[staticmethod]
    fn parse(
        py: Python<'_>,
        text: String,
        path: PathBuf,
        checking: Checking,
        nodes: Vec<Py<NodeClass>>,
    ) -> PyResult<Self> {
        let from = path.clone();
        let document = apart(py, (None, false), move |_| Ok(Document::parse(&from, &text)?))?;
        Self::new(py, (document, &path), &checking, &nodes)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// The text of its file, without the files that it includes.
    #[getter]
    fn text(&self) -> &str {
        self.document.sources().iter().next().map_or("", |source| &source.text)
    }

    #[getter]
    fn about(&self) -> &str {
        self.graph.about()
    }

    #[getter]
    fn seed(&self) -> u64 {
        self.graph.seed()
    }

    /// Parameters and their defaults as written.
    fn parameters(&self) -> Vec<(String, String)> {
        let own = |(name, value): (&str, &str)| (name.to_owned(), value.to_owned());
        self.document.parameters().map(own).collect()
    }

    /// Clocks and their rates.
    fn clocks(&self) -> Vec<(String, f64)> {
        let clocks = self.graph.clocks().iter();
        clocks.map(|clock| (clock.name.clone(), clock.rate.hz())).collect()
    }

    /// Outputs: name, kind of node, shape, unit, rate.
    fn outputs(&self) -> Vec<(String, &'static str, String, String, f64)> {
        let nodes = self.graph.nodes();
        let mut all = Vec::new();
        for node in nodes.iter() {
            let rate = node.clock.map_or(0.0, |clock| self.graph.clocks()[clock].rate.hz());
            for port in &node.outputs {
                let name = format!("{}.{}", node.path, port.name);
                let (kind, unit) = (port.kind.to_string(), port.quantity.unit());
                all.push((name, node.entry.spec.name, kind, unit, rate));
            }
        }
        all
    }

    /// Live settings: name, value, smallest, largest.
    fn settings(&self) -> Vec<(String, f64, Option<f64>, Option<f64>)> {
        let settings = self.graph.live_settings();
        let shown = |one: &engine::LiveSetting| {
            let (low, high) = one.range.unzip();
            (one.name(), one.value, low, high)
        };
        settings.iter().map(shown).collect()
    }

    /// Channels that the caller can feed, and channels that it can read: name, components, unit.
    fn channels(&self, py: Python<'_>) -> PyResult<(Vec<runs::Channel>, Vec<runs::Channel>)> {
        let nothing = Checking { set: Vec::new(), seed: None, endpoints: None };
        let (graph, _) = self.again(py, &nothing, Hosted::All)?;
        Ok((
            graph.host_inputs().map(runs::channel).collect(),
            graph.host_outputs().map(runs::channel).collect(),
        ))
    }

    /// The warnings as text for the terminal, and as a list.
    fn warnings<'py>(&self, py: Python<'py>) -> PyResult<(String, Bound<'py, PyList>)> {
        let found =
            Diagnostics { sources: self.graph.sources().clone(), list: self.graph.warnings().to_vec() };
        let text = match found.list.is_empty() {
            true => String::new(),
            false => found.to_string(),
        };
        Ok((text, diagnostics(py, &found)?))
    }

    /// The graph as SVG.
    fn svg(&self) -> String {
        standalone_svg(&self.graph, &self.name)
    }

    /// Runs the graph; returns its signals and the outcome.
    fn run<'py>(
        &self,
        py: Python<'py>,
        checking: Checking,
        request: RunRequest<'py>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Bound<'py, PyList>, Bound<'py, PyDict>)> {
        let feeds: Vec<runs::Feed> = request.inputs.iter().map(runs::Feed::of).collect();
        let hosted = endpoints(feeds.iter().map(|feed| feed.name.as_str()));
        let hosted = if feeds.is_empty() { Hosted::AsWritten } else { hosted };
        let (graph, scripts) = self.again(py, &checking, hosted)?;
        let wanted =
            runs::Wanted { seconds: request.seconds, probes: request.probes, folder: request.folder };
        let running = scripts.clone();
        let done = apart_with(py, (progress, true), &scripts, move |progress| {
            runs::run((&graph, &running), &feeds, &wanted, progress)
        })?;
        let signals = PyList::empty(py);
        for signal in done.signals {
            signals.append(Signal::into_python(signal, py)?)?;
        }
        let told = done.outcome.into_python(py)?;
        told.set_item("python_nodes", scripts.named(py)?)?;
        Ok((signals, told))
    }

    /// A run of the graph in blocks.
    fn player(
        &self,
        py: Python<'_>,
        checking: Checking,
        hosted: Option<Vec<String>>,
        probes: Vec<String>,
        folder: Option<PathBuf>,
        rested: bool,
    ) -> PyResult<Player> {
        let hosted = hosted.map_or(Hosted::All, Hosted::Also);
        let (graph, _) = self.again(py, &checking, hosted)?;
        let made = Player::open(&graph, &probes, folder, rested);
        made.map_err(|failure| failure.raise(py))
    }
}
