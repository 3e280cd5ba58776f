//! The sockets of a live run, one for each device.

use super::WAIT;
use super::exchange::{Codec, Exchange, SocketConfig};
use crate::backend::{Backend, BackendError, Connected, Counts};
use crate::guard::{GUARDED, Guard};
use crate::numbers::{cell, packets};
#[cfg(feature = "osc")]
use crate::osc::Addresses;
use haptograph_engine::graph::{Graph, GraphDevice};
use haptograph_engine::node::BuildError;
#[cfg(feature = "osc")]
use haptograph_nodes::network::OscDevice;
use haptograph_nodes::network::{Remote, UdpDevice};
use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::Instant;

/// The connected devices.
#[derive(Debug, Default)]
pub(super) struct Sockets(Vec<Connection>);

/// A connected device.
#[derive(Debug)]
struct Connection {
    /// Name of the endpoint.
    device: String,
    /// The settings; the address is as the graph states it.
    config: SocketConfig,
    /// Sends new settings to the thread.
    edits: Sender<SocketConfig>,
    /// Address with the port that the system chose for port 0.
    bound: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// The reason why the socket has no guard.
    unguarded: Option<String>,
    /// True if the socket was added by the last open.
    is_new: bool,
}

impl Connection {
    fn open(device: &str, config: &SocketConfig) -> Result<Self, BackendError> {
        let failed = |error| BackendError::Bind { device: device.to_owned(), address: config.listen, error };
        let socket = bind(config.listen).map_err(failed)?;
        socket.set_read_timeout(Some(WAIT)).map_err(failed)?;
        let bound = socket.local_addr().map_err(failed)?;
        let stop = Arc::new(AtomicBool::new(false));
        let (flag, theirs) = (Arc::clone(&stop), config.clone());
        let (edits, edited) = channel();
        let (guard, unguarded) = match Guard::start(&socket) {
            Ok(guard) => (guard, None),
            Err(error) => (
                None,
                Some(format!(
                    "`{device}` has no guard ({error}): if this program is killed, the device keeps its last command until its own watchdog acts"
                )),
            ),
        };
        // The link may hold the last command of an earlier run.
        let version = config.link.driven_version();
        let thread = std::thread::Builder::new()
            .name(format!("network {device}"))
            .spawn(move || Exchange::new(theirs, &socket, guard, version).run(&edited, &flag))
            .map_err(failed)?;
        Ok(Self {
            device: device.to_owned(),
            config: config.clone(),
            edits,
            bound,
            stop,
            thread: Some(thread),
            unguarded,
            is_new: true,
        })
    }

    fn configure(&mut self, device: &str, config: SocketConfig) {
        device.clone_into(&mut self.device);
        if !self.config.has_same_settings(&config) {
            let link = Arc::clone(&self.config.link);
            self.config = SocketConfig { link, ..config };
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

/// Opens a socket. A run that was killed leaves its guard there for a moment.
fn bind(listen: SocketAddr) -> std::io::Result<UdpSocket> {
    let start = Instant::now();
    loop {
        match UdpSocket::bind(listen) {
            Err(error) if error.kind() == ErrorKind::AddrInUse && start.elapsed() < 3 * GUARDED => {
                std::thread::sleep(WAIT);
            }
            bound => return bound,
        }
    }
}

/// The socket settings of a device, with a link of its own; `None` for a device of another kind.
fn config(device: &GraphDevice) -> Option<Result<SocketConfig, BuildError>> {
    if let Some(settings) = device.settings::<UdpDevice>() {
        return Some(settings.listen().and_then(|listen| {
            Ok(SocketConfig {
                link: Arc::default(),
                listen,
                only: settings.only()?,
                timeout: settings.timeout(),
                codec: Codec::Protocol,
            })
        }));
    }
    #[cfg(feature = "osc")]
    if let Some(settings) = device.settings::<OscDevice>() {
        return Some(settings.listen().and_then(|listen| {
            Ok(SocketConfig {
                link: Arc::default(),
                listen,
                only: None,
                timeout: settings.timeout(),
                codec: Codec::Osc(Arc::new(Addresses::new(settings, settings.send_to()?))),
            })
        }));
    }
    None
}

/// The sockets that a graph needs: index and name of each device, and its settings.
pub(super) fn configs(graph: &Graph) -> Result<Vec<(usize, String, SocketConfig)>, BackendError> {
    let mut found: Vec<(usize, String, SocketConfig)> = Vec::new();
    for (index, device) in graph.devices().iter().enumerate() {
        let Some(config) = config(device) else { continue };
        let config = config.map_err(|error| BackendError::Place {
            device: device.name.clone(),
            place: "its address".to_owned(),
            error: std::io::Error::other(error),
        })?;
        // At port 0 each has its own free port.
        let shared = |(.., known): &&(usize, String, SocketConfig)| {
            known.listen == config.listen && config.listen.port() != 0
        };
        if let Some((_, other, _)) = found.iter().find(shared) {
            return Err(BackendError::Shared(other.clone(), device.name.clone(), config.listen));
        }
        found.push((index, device.name.clone(), config));
    }
    Ok(found)
}

impl Backend for Sockets {
    fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        self.0.iter_mut().for_each(|known| known.is_new = false);
        for (index, name, config) in configs(graph)? {
            let is_it = |known: &&Connection| {
                known.config.listen == config.listen && (config.listen.port() != 0 || known.device == name)
            };
            let link = match self.0.iter().find(is_it) {
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

    fn status(&self) -> Vec<Connected> {
        let link = |known: &Connection| Connected {
            refused: known.unguarded.iter().cloned().collect(),
            ..Connected::link(&known.device, known.bound.to_string())
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
