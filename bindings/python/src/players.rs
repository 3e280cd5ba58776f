//! Runs in blocks, from the caller's loop.

use crate::errors::Failure;
use crate::runs::{Told, drain};
use haptograph::engine::graph::Graph;
use haptograph::engine::host::{AnyInput, AnyOutput, Full, HostFrame};
use haptograph::engine::node::OfflineOnly;
use haptograph::engine::run::{Player as Engine, PlayerState, Session, SessionOptions};
use haptograph::nodes::texture::Model;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// A run that is driven by its caller.
#[pyclass(frozen, module = "haptograph._native")]
pub struct Player {
    inside: Mutex<Option<Inside>>,
    rate_hz: f64,
}

struct Inside {
    player: Engine,
    session: Session,
    inputs: Vec<AnyInput>,
    outputs: Vec<AnyOutput>,
}

/// Duration of the parts after which the outputs are read, s.
const PART_S: f64 = 0.25;
/// Frames that one call processes at most.
const MAX_FRAMES: usize = 1 << 25;

impl Player {
    pub fn open(
        graph: &Graph,
        probes: &[String],
        folder: Option<PathBuf>,
        rested: bool,
    ) -> Result<Self, Failure> {
        if let Some(script) = graph.scripted_nodes().next() {
            let (node, kind) = (script.path.clone(), script.entry.spec.name);
            return Err(Failure::of(OfflineOnly { node, kind }));
        }
        let mut options = SessionOptions::default();
        options.probes = probes.to_vec();
        options.folder = folder;
        options.offline = true;
        options.rested = rested;
        let (player, mut session) = Engine::open(graph, &options).map_err(Failure::of)?;
        let inputs = graph.host_inputs().map(|(name, _)| graph.any_input(&name));
        let inputs = inputs.collect::<Result<Vec<_>, _>>().map_err(Failure::of)?;
        let outputs = graph.host_outputs().map(|(name, _)| graph.any_output(&name));
        let mut outputs = outputs.collect::<Result<Vec<_>, _>>().map_err(Failure::of)?;
        for probe in probes {
            outputs.push(session.any_probe(probe).map_err(Failure::of)?);
        }
        let driver = graph.drivers().first().copied().unwrap_or_default();
        let rate_hz = graph.clocks()[driver].rate.hz();
        let inside = Inside { player, session, inputs, outputs };
        Ok(Self { inside: Mutex::new(Some(inside)), rate_hz })
    }

    /// Calls `work` with the run while other Python threads continue.
    fn with<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Inside) -> Result<R, Failure> + Send,
    ) -> PyResult<R> {
        let done = py.detach(|| {
            let mut inside = self.inside.lock().unwrap_or_else(PoisonError::into_inner);
            let over = || Failure::Message("the player has finished".to_owned());
            work(inside.as_mut().ok_or_else(over)?)
        });
        done.map_err(|failure| failure.raise(py))
    }
}

impl Inside {
    fn input(&mut self, name: &str) -> Result<&mut AnyInput, Failure> {
        let Some(place) = self.inputs.iter().position(|input| input.name() == name) else {
            let known: Vec<&str> = self.inputs.iter().map(AnyInput::name).collect();
            let known = known.join(", ");
            return Err(Failure::Message(format!("there is no input `{name}`: there are {known}")));
        };
        Ok(&mut self.inputs[place])
    }

    /// Sets the frame of an input from the next tick or from a time on.
    fn set(&mut self, name: &str, frame: &[f64], at: Option<f64>) -> Result<(), Failure> {
        let input = self.input(name)?;
        let done = put(input, frame, |input, frame| match at {
            Some(seconds) => input.set_at(seconds, frame),
            None => input.set(frame),
        });
        done.map_err(|error| refused(input, error))
    }
}

/// True if a frame of `width` numbers is a model, which has as many coefficients as its program gives.
pub(crate) fn is_model(input: &AnyInput, width: usize) -> bool {
    input.kind() == <Model as HostFrame>::KIND && (1..=Model::WIDTH).contains(&width)
}

/// Gives a frame to an input by `give`; the coefficients that a model does not have are 0.
pub(crate) fn put(
    input: &mut AnyInput,
    frame: &[f64],
    give: impl FnOnce(&mut AnyInput, &[f64]) -> Result<(), Full>,
) -> Result<(), Full> {
    if !is_model(input, frame.len()) {
        return give(input, frame);
    }
    let mut model = [0.0; Model::WIDTH];
    model[..frame.len()].copy_from_slice(frame);
    give(input, &model)
}

fn refused(input: &AnyInput, error: Full) -> Failure {
    let name = input.name();
    Failure::Message(match error {
        Full::Shape if input.kind() == <Model as HostFrame>::KIND => {
            format!("a model of `{name}` is its variance and at most {} coefficients", Model::WIDTH - 1)
        }
        Full::Shape => format!("a frame of `{name}` has {} components", input.kind().width()),
        error => format!("`{name}`: {error}"),
    })
}

#[pymethods]
impl Player {
    /// Rate of the driver, Hz.
    #[getter]
    fn rate(&self) -> f64 {
        self.rate_hz
    }

    /// Inputs: name, components, unit, rate.
    fn inputs(&self, py: Python<'_>) -> PyResult<Vec<(String, usize, String, f64)>> {
        self.with(py, |inside| {
            let shown = |input: &AnyInput| {
                let (width, unit) = (input.kind().width(), input.quantity().unit());
                (input.name().to_owned(), width, unit, input.rate().hz())
            };
            Ok(inside.inputs.iter().map(shown).collect())
        })
    }

    /// Outputs and probes: name, components, unit, rate.
    fn outputs(&self, py: Python<'_>) -> PyResult<Vec<(String, usize, String, f64)>> {
        self.with(py, |inside| {
            let shown = |output: &AnyOutput| {
                let (width, unit) = (output.kind().width(), output.quantity().unit());
                (output.name().to_owned(), width, unit, output.rate().hz())
            };
            Ok(inside.outputs.iter().map(shown).collect())
        })
    }

    /// Sets the frame of an input from the next tick or from a time on.
    fn set(&self, py: Python<'_>, name: &str, frame: Vec<f64>, at: Option<f64>) -> PyResult<()> {
        self.with(py, move |inside| inside.set(name, &frame, at))
    }

    /// Queues frames for the next ticks; returns the number of frames queued.
    fn push(&self, py: Python<'_>, name: &str, frames: PyReadonlyArray2<'_, f64>) -> PyResult<usize> {
        let frames = frames.as_array().to_owned();
        self.with(py, move |inside| {
            let input = inside.input(name)?;
            for (number, frame) in frames.rows().into_iter().enumerate() {
                let frame: Vec<f64> = frame.iter().copied().collect();
                match put(input, &frame, AnyInput::push) {
                    Ok(()) => {}
                    Err(Full::Full) => return Ok(number),
                    Err(error) => return Err(refused(input, error)),
                }
            }
            Ok(frames.nrows())
        })
    }

    /// Sets frames of inputs and runs the next frames; returns the new frames of every output and probe.
    fn process<'py>(
        &self,
        py: Python<'py>,
        frames: usize,
        inputs: Vec<(String, Vec<f64>)>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let part = ((PART_S * self.rate_hz) as usize).max(1);
        let read = self.with(py, |inside| {
            inputs.iter().try_for_each(|(name, frame)| inside.set(name, frame, None))?;
            if frames > MAX_FRAMES {
                let message = format!("{frames} frames at once: process at most {MAX_FRAMES}");
                return Err(Failure::Message(message));
            }
            let mut read: Vec<Vec<f64>> = vec![Vec::new(); inside.outputs.len()];
            let mut left = frames;
            // What nobody takes for a second is lost.
            while left > 0 {
                let part = left.min(part);
                inside.player.process(part);
                let outputs = inside.outputs.iter_mut().zip(&mut read);
                outputs.for_each(|(output, lanes)| drain(output, lanes));
                left -= part;
            }
            let named = inside.outputs.iter().zip(read);
            let named = named.map(|(output, lanes)| (output.name().to_owned(), output.kind().width(), lanes));
            Ok(named.collect::<Vec<_>>())
        })?;
        let found = PyDict::new(py);
        for (name, width, lanes) in read {
            let frames = lanes.len() / width;
            let values = PyArray1::from_vec(py, lanes);
            match width {
                1 => found.set_item(name, values)?,
                _ => found.set_item(name, values.reshape([frames, width])?)?,
            }
        }
        Ok(found)
    }

    /// Sets a live setting.
    fn turn(&self, py: Python<'_>, name: &str, value: f64) -> PyResult<()> {
        self.with(py, |inside| {
            let turned = inside.session.set_by_name(name, value);
            turned.map_err(|error| Failure::Message(format!("`{name}` was not changed: {error}")))
        })
    }

    /// The state of the run, and the number of frames.
    fn state(&self, py: Python<'_>) -> PyResult<(&'static str, u64)> {
        self.with(py, |inside| {
            let state = match inside.player.state() {
                PlayerState::Running => "running",
                PlayerState::Stopped => "stopped",
                PlayerState::Finished => "finished",
                PlayerState::Panicked => "panicked",
            };
            Ok((state, inside.player.frames()))
        })
    }

    /// Fades the outputs out, which ends the run.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |inside| {
            inside.session.stop();
            Ok(())
        })
    }

    /// Ends the run and completes its files; returns the outcome.
    fn finish<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let done = py.detach(|| {
            let mut inside = self.inside.lock().unwrap_or_else(PoisonError::into_inner);
            let inside = inside.take();
            inside.map(|inside| inside.session.finish(inside.player))
        });
        let Some(done) = done else { return Ok(None) };
        if let Some(failed) = done.failed.first() {
            return Err(Failure::of(failed).raise(py));
        }
        let panicked = done.panicked;
        let told = done.outcome.into_python(py)?;
        told.set_item("panicked", panicked)?;
        Ok(Some(told))
    }
}
