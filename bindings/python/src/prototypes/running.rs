//! Nodes in Python while they run.

use super::PythonKind;
use super::settings::Value;
use haptograph::engine::node::{BuildContext, Built, Io, KindRule, Processor, Scripted, Tick};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The exception of a node, and the thread that runs it.
#[derive(Default)]
pub(super) struct Fault {
    has_failed: AtomicBool,
    raised: Mutex<Option<PyErr>>,
    /// Python's number of the thread that is running the node's Python code. Changed only with Python's lock held.
    thread: Mutex<Option<u64>>,
}

impl Fault {
    pub(super) fn has_failed(&self) -> bool {
        self.has_failed.load(Ordering::Acquire)
    }

    /// The first exception.
    pub(super) fn take(&self) -> Option<PyErr> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn keep(&self, error: PyErr) {
        let mut raised = self.raised.lock().unwrap_or_else(PoisonError::into_inner);
        raised.get_or_insert(error);
        self.has_failed.store(true, Ordering::Release);
    }

    /// Raises `KeyboardInterrupt` in the thread that runs the node.
    pub(super) fn interrupt(&self, py: Python<'_>) {
        let thread = *self.thread.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(thread) = thread {
            // Where that fails, the node goes on to the end of its block.
            let _ =
                py.import("haptograph._node").and_then(|module| module.call_method1("interrupt", (thread,)));
        }
    }

    fn at_work(&self, thread: Option<u64>) {
        *self.thread.lock().unwrap_or_else(PoisonError::into_inner) = thread;
    }
}

/// The arguments from which a node is made.
pub(super) struct Making {
    kind: &'static PythonKind,
    path: String,
    rate_hz: f64,
    seed: u64,
    settings: Vec<Value>,
    /// The object that was made when the graph was checked, until a run takes it.
    first: Mutex<Option<Py<PyAny>>>,
    fault: Arc<Fault>,
}

/// A node at run time. Plans copy nodes that have not run; each copy makes its own object.
struct Running {
    making: Arc<Making>,
    object: Option<Py<PyAny>>,
}

impl Clone for Running {
    fn clone(&self) -> Self {
        Self { making: Arc::clone(&self.making), object: None }
    }
}

impl Making {
    pub(super) fn new(kind: &'static PythonKind, cx: &BuildContext, settings: Vec<Value>) -> Self {
        Self {
            kind,
            path: cx.path.clone(),
            rate_hz: cx.rate.hz(),
            seed: cx.seed,
            settings,
            first: Mutex::default(),
            fault: Arc::default(),
        }
    }

    pub(super) fn fault(&self) -> Arc<Fault> {
        Arc::clone(&self.fault)
    }

    /// The processor. Its object is made at once, so that an invalid setting is reported when the graph is checked.
    pub(super) fn processor(self, py: Python<'_>) -> PyResult<Built<Scripted>> {
        let first = self.object(py)?;
        Ok(Built::new(Running {
            making: Arc::new(Self { first: Mutex::new(Some(first)), ..self }),
            object: None,
        }))
    }

    fn object(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let settings = PyDict::new(py);
        for (declared, value) in self.kind.settings.iter().zip(&self.settings) {
            settings.set_item(declared.name, value.clone())?;
        }
        let of = (&self.kind.class, &self.path, self.rate_hz, self.seed, settings);
        let made = py.import("haptograph._node")?.call_method1("make", of)?;
        Ok(made.unbind())
    }

    /// The object for a new run.
    fn begin(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let first = self.first.lock().unwrap_or_else(PoisonError::into_inner).take();
        first.map_or_else(|| self.object(py), Ok)
    }
}

impl Running {
    fn block(&mut self, py: Python<'_>, tick: &Tick, io: &mut Io<'_, Scripted>) -> PyResult<()> {
        let object = match &self.object {
            Some(object) => object.clone_ref(py),
            None => self.making.begin(py)?,
        };
        self.object = Some(object.clone_ref(py));
        let spec = &self.making.kind.spec;
        let inputs = PyDict::new(py);
        for (port, input) in spec.any_inputs() {
            match io.read(input) {
                Some(components) => inputs.set_item(port.name, array(py, components, io.width(input))?)?,
                None => inputs.set_item(port.name, py.None())?,
            }
        }
        let times = PyArray1::from_iter(py, (0..tick.frames).map(|frame| tick.time_s(frame)));
        let widths: Vec<usize> = spec.outputs.iter().map(|port| width(port.kind)).collect();
        let module = py.import("haptograph._node")?;
        let found = module.call_method1("block", (object, widths, times, inputs))?;
        let found: Vec<PyReadonlyArray1<'_, f64>> = found.extract()?;
        for ((_, output), values) in spec.any_outputs().zip(&found) {
            for (to, from) in io.write(output).iter_mut().zip(values.as_array()) {
                *to = *from;
            }
        }
        Ok(())
    }

    /// Processes a block so that it can be interrupted.
    fn interruptible_block(
        &mut self,
        py: Python<'_>,
        tick: &Tick,
        io: &mut Io<'_, Scripted>,
    ) -> PyResult<()> {
        let fault = self.making.fault();
        let thread: u64 = py.import("threading")?.call_method0("get_ident")?.extract()?;
        fault.at_work(Some(thread));
        let done = self.block(py, tick, io);
        fault.at_work(None);
        done
    }
}

fn width(kind: KindRule) -> usize {
    match kind {
        KindRule::Is(kind) => kind.width(),
        _ => 1,
    }
}

/// Frames as an array of shape (frames, components), or (frames,) for scalars.
fn array<'py>(py: Python<'py>, lanes: &[f64], width: usize) -> PyResult<Bound<'py, PyAny>> {
    let line = PyArray1::from_slice(py, lanes);
    match width {
        0 | 1 => Ok(line.into_any()),
        _ => Ok(line.reshape([lanes.len() / width, width])?.into_any()),
    }
}

impl Processor<Scripted> for Running {
    /// Runs the script, which may allocate, lock and take any time. After an exception its outputs are zero.
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Scripted>) {
        if !self.making.fault.has_failed() {
            match Python::try_attach(|py| self.interruptible_block(py, tick, io)) {
                Some(Ok(())) => return,
                Some(Err(error)) => self.making.fault.keep(error),
                // Python is shutting down: nobody waits for the samples any more.
                None => {}
            }
        }
        for (_, output) in self.making.kind.spec.any_outputs() {
            io.write(output).fill(0.0);
        }
    }
}
