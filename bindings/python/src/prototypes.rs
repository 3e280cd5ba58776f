//! Kinds of nodes that are Python classes. They are registered like all kinds, but as scripts, which run offline only.

mod running;
mod settings;

use crate::errors::Failure;
use haptograph::engine::diagnostic::Diagnostics;
use haptograph::engine::document::Document;
use haptograph::engine::frame::Kind;
use haptograph::engine::graph::{CheckOptions, Graph, check};
use haptograph::engine::node::{
    BuildError, Flow, InputSpec, KindRule, NodeEntry, NodeSpec, OutputCount, OutputRole, OutputSpec,
    Presence, QuantityRule, ScriptBuild, ScriptedKind,
};
use haptograph::engine::settings::{Fields, Reading, SettingSpec};
use haptograph::signal::quantity::Quantity;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use running::{Fault, Making};
use settings::{Declared, GivenSetting};
use std::cell::RefCell;
use std::sync::Arc;

/// A class as a kind of node.
#[pyclass(frozen, module = "haptograph._native")]
pub struct NodeClass {
    pub entry: NodeEntry,
}

/// Name, quantity, kind, whether it is optional, documentation.
type GivenPort = (String, String, String, bool, String);

/// The kind of a class. Like all kinds of nodes it lives as long as the program.
struct PythonKind {
    class: Py<PyAny>,
    spec: NodeSpec,
    settings: Vec<Declared>,
}

#[pymethods]
impl NodeClass {
    #[new]
    fn new(
        py: Python<'_>,
        node: Py<PyAny>,
        name: String,
        doc: String,
        inputs: Vec<GivenPort>,
        outputs: Vec<GivenPort>,
        settings: Vec<GivenSetting>,
    ) -> PyResult<Self> {
        let inputs: Result<Vec<InputSpec>, Failure> = inputs.into_iter().map(input).collect();
        let outputs: Result<Vec<OutputSpec>, Failure> = outputs.into_iter().map(output).collect();
        let ports = inputs.and_then(|inputs| Ok((inputs, outputs?)));
        let (inputs, outputs) = ports.map_err(|failure| failure.raise(py))?;
        let spec = NodeSpec {
            name: name.leak(),
            group: "python",
            doc: doc.leak(),
            source: "",
            inputs: inputs.leak(),
            outputs: outputs.leak(),
            example: "",
        };
        let settings = settings.into_iter().map(Declared::of).collect();
        let kind: &'static PythonKind = Box::leak(Box::new(PythonKind { class: node, spec, settings }));
        Ok(Self { entry: NodeEntry::scripted(kind) })
    }
}

fn input((name, quantity, kind, is_optional, doc): GivenPort) -> Result<InputSpec, Failure> {
    Ok(InputSpec {
        kind: KindRule::Is(kind_of(&name, &kind)?),
        quantity: QuantityRule::Is(quantity_of(&name, &quantity)?),
        flow: Flow::Sampled,
        presence: if is_optional { Presence::Optional } else { Presence::Required },
        doc: doc.leak(),
        name: name.leak(),
    })
}

fn output((name, quantity, kind, _, doc): GivenPort) -> Result<OutputSpec, Failure> {
    Ok(OutputSpec {
        kind: KindRule::Is(kind_of(&name, &kind)?),
        quantity: QuantityRule::Is(quantity_of(&name, &quantity)?),
        role: OutputRole::Plain,
        count: OutputCount::One,
        doc: doc.leak(),
        name: name.leak(),
    })
}

fn kind_of(port: &str, name: &str) -> Result<Kind, Failure> {
    let shipped = haptograph::nodes::registry();
    let names = || shipped.kinds().iter().map(ToString::to_string).collect::<Vec<_>>();
    shipped.kind(name).ok_or_else(|| unknown(port, "kind", name, &names()))
}

fn quantity_of(port: &str, name: &str) -> Result<Quantity, Failure> {
    let known = || Quantity::NAMED.iter().map(|(_, name, _)| *name);
    let found = Quantity::by_name(name);
    found.ok_or_else(|| unknown(port, "quantity", name, &known().map(str::to_owned).collect::<Vec<_>>()))
}

fn unknown(port: &str, what: &str, name: &str, known: &[String]) -> Failure {
    let known = known.join(", ");
    Failure::Message(format!("the {what} of `{port}` is {name:?}: expected one of {known}"))
}

impl ScriptedKind for PythonKind {
    fn spec(&'static self) -> &'static NodeSpec {
        &self.spec
    }

    fn settings(&self) -> Vec<SettingSpec> {
        self.settings.iter().map(Declared::spec).collect()
    }

    fn read(&'static self, fields: &mut Fields, reading: &mut Reading<'_>) -> Option<ScriptBuild> {
        // All are read before the first that is wrong ends it, so that all errors are reported.
        let read: Vec<_> = self.settings.iter().map(|one| one.take(fields, reading)).collect();
        let settings = read.into_iter().collect::<Option<Vec<_>>>()?;
        Some(Box::new(move |cx| {
            let making = Making::new(self, cx, settings);
            let fault = making.fault();
            let made =
                Python::try_attach(|py| making.processor(py).map_err(|error| refused(py, self, error)));
            BUILT.with_borrow_mut(|built| built.scripts.0.push((cx.path.clone(), self.spec.name, fault)));
            made.unwrap_or_else(|| Err(BuildError::of_node("Python is shutting down")))
        }))
    }
}

/// Results of building a graph, beside the graph itself.
#[derive(Default)]
struct Built {
    scripts: Scripts,
    raised: Option<PyErr>,
}

thread_local! {
    /// Results of the graph that this thread checks. One thread builds all nodes of a graph, and the engine cannot
    /// store Python's part of them.
    static BUILT: RefCell<Built> = RefCell::default();
}

/// An exception of `start`, as the build error of the node.
fn refused(py: Python<'_>, kind: &PythonKind, error: PyErr) -> BuildError {
    let (line, traceback) = told(py, &error);
    BUILT.with_borrow_mut(|built| {
        built.raised.get_or_insert(error);
    });
    BuildError::of_node(format!("`{}` raised {line}", kind.spec.name)).help(traceback)
}

/// An exception as one line, and its traceback.
fn told(py: Python<'_>, error: &PyErr) -> (String, String) {
    let module = py.import("haptograph._node");
    // Before Python 3.12 a value has its traceback only from here on.
    let value = error.clone_ref(py).into_value(py);
    let told = module.and_then(|module| module.call_method1("told", (value,))?.extract());
    told.unwrap_or_else(|_| (error.to_string(), String::new()))
}

/// Checks a graph that may have nodes in Python. They are built on this thread.
pub(crate) fn checked(
    document: &Document,
    nodes: &[NodeEntry],
    options: &CheckOptions,
) -> Result<(Graph, Scripts), Failure> {
    let mut registry = haptograph::nodes::registry();
    for entry in nodes {
        registry.add(*entry);
    }
    // A node may check a graph when it is built.
    let outer = BUILT.take();
    let checked = check(document, &registry, options);
    let Built { scripts, raised } = BUILT.replace(outer);
    match (checked, raised) {
        (Ok(graph), _) => Ok((graph, scripts)),
        (Err(found), None) => Err(found.into()),
        (Err(found), Some(cause)) => Err(Failure::Raised(Box::new(found), cause)),
    }
}

/// The nodes of a graph that are in Python: path, class, and fault of each.
#[derive(Clone, Default)]
pub(crate) struct Scripts(Vec<(String, &'static str, Arc<Fault>)>);

impl Scripts {
    /// True if a node raised an exception.
    pub(crate) fn have_failed(&self) -> bool {
        self.0.iter().any(|(.., fault)| fault.has_failed())
    }

    /// The exception of the first node in the graph that raised one.
    pub(crate) fn failure(&self, graph: &Graph) -> Option<Failure> {
        let (path, _, error) =
            self.0.iter().find_map(|(path, class, fault)| Some((path, class, fault.take()?)))?;
        let node = graph.scripted_nodes().find(|node| node.path == *path)?;
        let told = Python::try_attach(|py| told(py, &error));
        let (line, traceback) = told.unwrap_or_else(|| (error.to_string(), String::new()));
        let found =
            Diagnostics { sources: graph.sources().clone(), list: vec![node.raised(&line, &traceback)] };
        Some(Failure::Raised(Box::new(found), error))
    }

    /// Interrupts the nodes that are running.
    pub(crate) fn interrupt(&self, py: Python<'_>) {
        for (.., fault) in &self.0 {
            fault.interrupt(py);
        }
    }

    /// The classes of the nodes by their paths.
    pub(crate) fn named<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let named = PyDict::new(py);
        for (path, class, _) in &self.0 {
            named.set_item(path, class)?;
        }
        Ok(named)
    }
}
