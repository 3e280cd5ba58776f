//! Errors as exceptions of the package.

use haptograph::engine::diagnostic::{Diagnostics, Severity};
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::fmt::Display;

/// Error of a call.
#[derive(Debug)]
pub enum Failure {
    /// The errors of a graph, with their positions.
    Graph(Box<Diagnostics>),
    /// An exception of a node in Python: the diagnostics, and the exception.
    Raised(Box<Diagnostics>, PyErr),
    /// One sentence.
    Message(String),
}

impl Failure {
    /// The error of a library call, in one sentence.
    pub fn of(error: impl Display) -> Self {
        Self::Message(error.to_string())
    }
}

impl From<Diagnostics> for Failure {
    fn from(found: Diagnostics) -> Self {
        Self::Graph(Box::new(found))
    }
}

impl Failure {
    /// The Python exception for this error.
    pub fn raise(&self, py: Python<'_>) -> PyErr {
        self.exception(py).unwrap_or_else(|failed| failed)
    }

    fn exception(&self, py: Python<'_>) -> PyResult<PyErr> {
        let errors = py.import("haptograph._errors")?;
        match self {
            Self::Message(message) => {
                let raised = errors.getattr("Error")?.call1((message,))?;
                Ok(PyErr::from_value(raised))
            }
            Self::Graph(found) => graph_error(&errors, found),
            // Ctrl-C and the end of a program are no faults of the node that they came through.
            Self::Raised(_, cause) if !cause.is_instance_of::<PyException>(py) => Ok(cause.clone_ref(py)),
            Self::Raised(found, cause) => {
                let raised = graph_error(&errors, found)?;
                raised.set_cause(py, Some(cause.clone_ref(py)));
                Ok(raised)
            }
        }
    }
}

fn graph_error(errors: &Bound<'_, PyModule>, found: &Diagnostics) -> PyResult<PyErr> {
    let list = diagnostics(errors.py(), found)?;
    let raised = errors.getattr("GraphError")?.call1((found.to_string(), list))?;
    Ok(PyErr::from_value(raised))
}

/// All diagnostics as dictionaries.
pub(crate) fn diagnostics<'py>(py: Python<'py>, found: &Diagnostics) -> PyResult<Bound<'py, PyList>> {
    let list = PyList::empty(py);
    for one in &found.list {
        let shown = PyDict::new(py);
        let severity = match one.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        shown.set_item("code", one.code)?;
        shown.set_item("severity", severity)?;
        shown.set_item("message", &one.message)?;
        shown.set_item("help", &one.help)?;
        let span = one.primary.as_ref().map(|label| label.span);
        let file = span.and_then(|span| found.sources.get(span.source));
        shown.set_item("file", file.map(|source| source.path.display().to_string()))?;
        shown.set_item("span", span.map(|span| (span.start, span.end)))?;
        shown.set_item("line", span.map(|span| found.sources.line_column(span).0))?;
        shown.set_item("column", span.map(|span| found.sources.line_column(span).1))?;
        list.append(shown)?;
    }
    Ok(list)
}
