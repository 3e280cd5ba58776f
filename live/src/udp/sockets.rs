//! The sockets of a live run, one for each device.

use super::WAIT;
use super::conversation::{Codec, Conversation, Plug};
use crate::backend::{Backend, BackendError, Connected, Counts};
use crate::hub::{cell, packets};
#[cfg(feature = "osc")]
use crate::osc::Addresses;
use haptograph_engine::graph::{Graph, GraphDevice};
use haptograph_engine::node::BuildError;
#[cfg(feature = "osc")]
use haptograph_nodes::network::OscDevice;
use haptograph_nodes::network::{Remote, UdpDevice};
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;

/// The connected devices.
#[derive(Debug, Default)]
pub(super) struct Sockets(Vec<Connection>);

/// A connected device.
#[derive(Debug)]
struct Connection {
    /// Name of the endpoint.
    device: String,
    /// Address as the graph states it.
    plug: Plug,
    /// Sends new settings to the thread.
    edits: Sender<Plug>,
    /// Address with the port that the system chose for port 0.
    bound: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Whether it came with the last open.
    is_new: bool,
}

impl Connection {
    fn open(device: &str, plug: &Plug) -> Result<Self, BackendError> {
        let failed = |error| BackendError::Bind {
            device: device.to_owned(),
            address: plug.listen,
            error,
        };
        let socket = UdpSocket::bind(plug.listen).map_err(failed)?;
        socket.set_read_timeout(Some(WAIT)).map_err(failed)?;
        let bound = socket.local_addr().map_err(failed)?;
        let stop = Arc::new(AtomicBool::new(false));
        let (flag, theirs) = (Arc::clone(&stop), plug.clone());
        let (edits, edited) = channel();
        // The link may hold the last command of an earlier run.
        let version = plug.link.driven_version();
        let thread = std::thread::Builder::new()
            .name(format!("network {device}"))
            .spawn(move || Conversation::new(theirs, &socket, version).hold(&edited, &flag))
            .map_err(failed)?;
        Ok(Self {
            device: device.to_owned(),
            plug: plug.clone(),
            edits,
            bound,
            stop,
            thread: Some(thread),
            is_new: true,
        })
    }

    fn follow(&mut self, device: &str, plug: Plug) {
        device.clone_into(&mut self.device);
        if !self.plug.says_the_same(&plug) {
            let link = Arc::clone(&self.plug.link);
            self.plug = Plug { link, ..plug };
            // The thread may have ended.
            let _ = self.edits.send(self.plug.clone());
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        crate::end(&self.stop, &mut self.thread);
    }
}

/// The socket of a device, with a link of its own; `None` for a device of another kind.
fn plug(device: &GraphDevice) -> Option<Result<Plug, BuildError>> {
    if let Some(settings) = device.settings::<UdpDevice>() {
        return Some(settings.listen().and_then(|listen| {
            Ok(Plug {
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
            Ok(Plug {
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

/// The sockets that a graph needs: index of the device, its name, and the socket.
fn plugs(graph: &Graph) -> Result<Vec<(usize, String, Plug)>, BackendError> {
    let mut found: Vec<(usize, String, Plug)> = Vec::new();
    for (index, device) in graph.devices().iter().enumerate() {
        let Some(plug) = plug(device) else { continue };
        let plug = plug.map_err(|error| BackendError::Place {
            device: device.name.clone(),
            place: "its address".to_owned(),
            error: std::io::Error::other(error),
        })?;
        // At port 0 each has its own free port.
        let shared =
            |(.., known): &&(usize, String, Plug)| known.listen == plug.listen && plug.listen.port() != 0;
        if let Some((_, other, _)) = found.iter().find(shared) {
            return Err(BackendError::Shared(
                other.clone(),
                device.name.clone(),
                plug.listen,
            ));
        }
        found.push((index, device.name.clone(), plug));
    }
    Ok(found)
}

impl Backend for Sockets {
    fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        self.0.iter_mut().for_each(|known| known.is_new = false);
        for (index, name, plug) in plugs(graph)? {
            let is_it = |known: &&Connection| {
                known.plug.listen == plug.listen && (plug.listen.port() != 0 || known.device == name)
            };
            let link = match self.0.iter().find(is_it) {
                Some(known) => Arc::clone(&known.plug.link),
                None => {
                    self.0.push(Connection::open(&name, &plug)?);
                    plug.link
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
            let is_it = |known: &&mut Connection| Arc::ptr_eq(&known.plug.link.input, &cell);
            if let (Some(known), Some(Ok(plug))) = (self.0.iter_mut().find(is_it), plug(device)) {
                known.follow(&device.name, plug);
            }
        }
    }

    fn status(&self) -> Vec<Connected> {
        let link = |known: &Connection| Connected::link(&known.device, known.bound.to_string());
        self.0.iter().map(link).collect()
    }

    fn counts(&self) -> Vec<Counts> {
        self.0.iter().map(|known| packets(&known.plug.link)).collect()
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
