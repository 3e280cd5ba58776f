//! The event devices of a live run.

use super::reading::{begin, unknown_scale};
use crate::backend::{Backend, BackendError, Connected, Counts};
use crate::numbers::{cell, packets};
use haptograph_engine::graph::{Graph, GraphDevice};
use haptograph_nodes::network::link::Link;
use haptograph_nodes::network::{EvdevDevice, Remote};
use haptograph_signal::units::PerMillimetre;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;

/// An event device with its scale.
#[derive(Debug, Clone)]
pub(super) struct Input {
    pub link: Arc<Link>,
    pub path: PathBuf,
    pub counts_per_mm: Option<PerMillimetre>,
    pub pressed_n: f64,
}

impl Input {
    /// The event device of an endpoint, with its own link; `None` for a device of another kind.
    fn of(device: &GraphDevice) -> Option<Self> {
        let settings = device.settings::<EvdevDevice>()?;
        Some(Self {
            link: Arc::default(),
            path: PathBuf::from(&settings.path),
            counts_per_mm: settings.counts_per_mm,
            pressed_n: settings.pressed_n,
        })
    }
}

/// Inputs are equal if device and scale are the same.
impl PartialEq for Input {
    fn eq(&self, other: &Self) -> bool {
        (&self.path, self.counts_per_mm, self.pressed_n)
            == (&other.path, other.counts_per_mm, other.pressed_n)
    }
}

/// Event devices, each open for all endpoints that name it.
#[derive(Debug, Default)]
pub(super) struct EventDevices(Vec<Reading>);

/// An open event device.
#[derive(Debug)]
struct Reading {
    /// Name of the endpoint.
    device: String,
    input: Input,
    /// True if the device reports its counts per millimetre.
    states_scale: bool,
    /// Sends new settings to the thread.
    edits: Sender<Input>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// True if the device was added by the last open.
    is_new: bool,
}

impl Reading {
    fn begin(device: &str, input: Input) -> Result<Self, BackendError> {
        let stop = Arc::new(AtomicBool::new(false));
        let (edits, edited) = channel();
        let begun = begin(device, &input, edited, &stop);
        let (thread, states_scale) = begun.map_err(|error| failed(device, &input, error))?;
        Ok(Self {
            device: device.to_owned(),
            input,
            states_scale,
            edits,
            stop,
            thread: Some(thread),
            is_new: true,
        })
    }

    /// Checks that the device can be read with these settings.
    fn check_scale(&self, device: &str, input: &Input) -> Result<(), BackendError> {
        match input.counts_per_mm.is_some() || self.states_scale {
            true => Ok(()),
            false => Err(failed(device, input, unknown_scale())),
        }
    }

    fn configure(&mut self, device: &str, input: Input) {
        device.clone_into(&mut self.device);
        if self.input != input {
            let link = Arc::clone(&self.input.link);
            self.input = Input { link, ..input };
            // The thread may have ended.
            let _ = self.edits.send(self.input.clone());
        }
    }
}

fn failed(device: &str, input: &Input, error: std::io::Error) -> BackendError {
    BackendError::Input { device: device.to_owned(), path: input.path.clone(), error }
}

impl Drop for Reading {
    fn drop(&mut self) {
        crate::end(&self.stop, &mut self.thread);
    }
}

impl Backend for EventDevices {
    fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        self.0.iter_mut().for_each(|known| known.is_new = false);
        for device in 0..graph.devices().len() {
            let name = graph.devices()[device].name.clone();
            let Some(input) = Input::of(&graph.devices()[device]) else {
                continue;
            };
            let link = match self.0.iter().find(|known| known.input.path == input.path) {
                Some(known) => {
                    known.check_scale(&name, &input)?;
                    Arc::clone(&known.input.link)
                }
                None => {
                    let link = Arc::clone(&input.link);
                    self.0.push(Reading::begin(&name, input)?);
                    link
                }
            };
            if let Some(body) = graph.body_mut::<Remote>(device) {
                body.attach(&link);
            }
        }
        Ok(())
    }

    fn undo(&mut self) {
        self.0.retain(|reading| !reading.is_new);
    }

    fn keep(&mut self, graph: &Graph) {
        for (device, cell) in graph.devices().iter().filter_map(cell) {
            let is_it = |known: &&mut Reading| Arc::ptr_eq(&known.input.link.input, &cell);
            if let (Some(known), Some(input)) = (self.0.iter_mut().find(is_it), Input::of(device)) {
                known.configure(&device.name, input);
            }
        }
    }

    fn status(&self) -> Vec<Connected> {
        let link = |known: &Reading| Connected::link(&known.device, known.input.path.display().to_string());
        self.0.iter().map(link).collect()
    }

    fn counts(&self) -> Vec<Counts> {
        self.0.iter().map(|known| packets(&known.input.link)).collect()
    }
}
