//! The arms of a live run.

use super::exchange::{ArmConfig, Exchange};
use super::service::Service;
use crate::backend::{Backend, BackendError, BackendEvent, Connected, Counts};
use crate::numbers::{cell, packets};
use haptograph_engine::graph::{Graph, GraphDevice};
use haptograph_engine::node::BuildError;
use haptograph_nodes::network::{HaplyInverse3, Remote};
use std::io::{Error, ErrorKind};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::thread::JoinHandle;

/// Events that are kept until they are polled.
const EVENTS: usize = 16;

/// The connected arms.
#[derive(Debug, Default)]
pub(super) struct Arms(Vec<Connection>);

/// A connected arm.
#[derive(Debug)]
struct Connection {
    /// Name of the endpoint.
    device: String,
    config: ArmConfig,
    /// Identifier of the arm.
    arm: String,
    /// Sends new settings to the thread.
    edits: Sender<ArmConfig>,
    events: Receiver<BackendEvent>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// True if the arm was added by the last open.
    is_new: bool,
}

impl Connection {
    fn open(device: &str, config: &ArmConfig) -> Result<Self, BackendError> {
        let failed = |error| failed(device, config, error);
        let (service, state) = Service::connect(config.service).map_err(failed)?;
        let arm = choose(config.arm.as_deref(), &state.ids()).map_err(failed)?;
        let ((edits, edited), (sender, events)) = (channel(), sync_channel(EVENTS));
        let stop = Arc::new(AtomicBool::new(false));
        let (flag, exchange) =
            (Arc::clone(&stop), Exchange::new(config.clone(), arm.clone(), (service, state), sender));
        let thread = std::thread::Builder::new()
            .name(format!("arm {device}"))
            .spawn(move || exchange.run(&edited, &flag))
            .map_err(failed)?;
        Ok(Self {
            device: device.to_owned(),
            config: config.clone(),
            arm,
            edits,
            events,
            stop,
            thread: Some(thread),
            is_new: true,
        })
    }

    fn configure(&mut self, device: &str, config: ArmConfig) {
        device.clone_into(&mut self.device);
        if !self.config.has_same_settings(&config) {
            let link = Arc::clone(&self.config.link);
            self.config = ArmConfig { link, ..config };
            // The thread may have ended.
            let _ = self.edits.send(self.config.clone());
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        crate::end(&self.stop, &mut self.thread);
    }
}

fn failed(device: &str, config: &ArmConfig, error: Error) -> BackendError {
    BackendError::Place { device: device.to_owned(), place: config.service.to_string(), error }
}

/// The arm of this identifier, or the only one.
fn choose(wanted: Option<&str>, arms: &[String]) -> Result<String, Error> {
    let listed = if arms.is_empty() { "none".to_owned() } else { arms.join(", ") };
    match (wanted, arms) {
        (Some(wanted), arms) if arms.iter().any(|arm| arm == wanted) => Ok(wanted.to_owned()),
        (None, [arm]) => Ok(arm.clone()),
        (Some(wanted), _) => Err(Error::new(
            ErrorKind::NotFound,
            format!("the service has no arm `{wanted}`; it has: {listed}; connect it, or change `device`"),
        )),
        (None, []) => {
            Err(Error::new(ErrorKind::NotFound, "the service has no arm; connect one, and its power supply"))
        }
        (None, _) => Err(Error::new(
            ErrorKind::InvalidInput,
            format!("the service has several arms: {listed}; choose one by `device`"),
        )),
    }
}

/// The settings of an arm, with a link of its own; `None` for a device of another kind.
fn config(device: &GraphDevice) -> Option<Result<ArmConfig, BuildError>> {
    let settings = device.settings::<HaplyInverse3>()?;
    Some(settings.service().map(|service| ArmConfig {
        link: Arc::default(),
        service,
        arm: settings.device.clone(),
        grip: settings.grip.clone(),
        preset: settings.preset.name(),
        timeout: settings.timeout(),
    }))
}

/// The arms that a graph needs: index and name of each endpoint, and its settings.
pub(super) fn configs(graph: &Graph) -> Result<Vec<(usize, String, ArmConfig)>, BackendError> {
    let mut found: Vec<(usize, String, ArmConfig)> = Vec::new();
    for (index, device) in graph.devices().iter().enumerate() {
        let Some(config) = config(device) else { continue };
        let config = config.map_err(|error| BackendError::Place {
            device: device.name.clone(),
            place: "its address".to_owned(),
            error: Error::other(error),
        })?;
        let is_shared = |(.., known): &&(usize, String, ArmConfig)| {
            let may_be_one = known.arm.is_none() || config.arm.is_none() || known.arm == config.arm;
            known.service == config.service && may_be_one
        };
        if let Some((_, other, _)) = found.iter().find(is_shared) {
            let message = format!("`{other}` may be the same arm; give each a `device` of its own");
            return Err(failed(&device.name, &config, Error::new(ErrorKind::InvalidInput, message)));
        }
        found.push((index, device.name.clone(), config));
    }
    Ok(found)
}

impl Arms {
    /// The link of an arm that is connected.
    fn known(&self, config: &ArmConfig) -> Option<&Connection> {
        let mut there = self.0.iter().filter(|known| {
            known.config.service == config.service && config.arm.as_ref().is_none_or(|arm| *arm == known.arm)
        });
        // Where there are several, the service is asked, and refuses.
        there.next().filter(|_| there.next().is_none())
    }
}

impl Backend for Arms {
    fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        self.0.iter_mut().for_each(|known| known.is_new = false);
        for (index, name, config) in configs(graph)? {
            let link = match self.known(&config) {
                Some(known) => Arc::clone(&known.config.link),
                None => {
                    self.0.push(Connection::open(&name, &config)?);
                    config.link
                }
            };
            if let Some(body) = graph.body_mut::<Remote>(index) {
                body.attach(&link);
            }
        }
        Ok(())
    }

    fn undo(&mut self) {
        self.0.retain(|connection| !connection.is_new);
    }

    fn keep(&mut self, graph: &Graph) {
        for (device, cell) in graph.devices().iter().filter_map(cell) {
            let is_it = |known: &&mut Connection| Arc::ptr_eq(&known.config.link.input, &cell);
            if let (Some(known), Some(Ok(config))) = (self.0.iter_mut().find(is_it), config(device)) {
                known.configure(&device.name, config);
            }
        }
    }

    fn poll(&mut self) -> Vec<BackendEvent> {
        self.0.iter().flat_map(|known| known.events.try_iter()).collect()
    }

    fn status(&self) -> Vec<Connected> {
        let link = |known: &Connection| {
            Connected::link(&known.device, format!("Haply arm {} at {}", known.arm, known.config.service))
        };
        self.0.iter().map(link).collect()
    }

    fn counts(&self) -> Vec<Counts> {
        self.0.iter().map(|known| packets(&known.config.link)).collect()
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
