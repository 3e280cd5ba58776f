//! The thread that communicates with a device: accepts valid, new states, and answers with commands.

use super::NetworkError;
use super::evdev::{self, Input};
use super::inputs::{Hub, NumberInput};
use super::link::{Count, Counts, DRIVEN, Link, SENSED};
use super::osc::{Addresses, Teller, decode, each_message};
use super::protocol::{Command, PacketError, State};
use super::remote::{Remote, Way};
use haptograph_engine::graph::Graph;
use rosc::OscMessage;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Socket settings of a device: addresses, timeout and protocol.
#[derive(Debug, Clone)]
pub(super) struct Plug {
    pub link: Arc<Link>,
    pub listen: SocketAddr,
    pub only: Option<SocketAddr>,
    /// Silence after which the device counts as gone.
    pub timeout: Duration,
    pub codec: Codec,
}

impl Plug {
    /// Whether a conversation can continue with the other settings unchanged.
    fn says_the_same(&self, other: &Self) -> bool {
        (self.only, self.timeout, &self.codec) == (other.only, other.timeout, &other.codec)
    }

    /// Whether both listen at the same address. At port 0 each has its own free port.
    fn shares_with(&self, link: &Arc<Link>, listen: SocketAddr) -> bool {
        Arc::ptr_eq(&self.link, link) || self.listen == listen && listen.port() != 0
    }
}

/// Protocol of a device.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Codec {
    /// The device protocol.
    Protocol,
    /// Open Sound Control.
    Osc(Arc<Addresses>),
}

impl Codec {
    fn teller(&self) -> Option<Teller> {
        match self {
            Self::Protocol => None,
            Self::Osc(addresses) => addresses.teller(),
        }
    }
}

/// Longest wait of the thread before it checks for a stop or a new command.
pub(super) const WAIT: Duration = Duration::from_millis(5);
/// Size of the largest datagram.
const MAX_BYTES: usize = 65_536;

/// The connected network devices of a live run. Dropping it disconnects them.
#[derive(Debug, Default)]
pub struct Connections {
    list: Vec<Connection>,
    inputs: Vec<Reading>,
    hubs: Vec<Hub>,
    /// Threads of the connected devices and inputs.
    heard: Vec<Listening>,
}

/// A connected device.
#[derive(Debug)]
struct Listening {
    device: String,
    /// Address, with the port that the system chose for port 0, or path.
    place: String,
    link: Arc<Link>,
}

/// An open event device.
#[derive(Debug)]
struct Reading {
    input: Arc<Input>,
    /// Whether the device reports its counts per millimetre.
    states_scale: bool,
    /// Sends new settings to the thread.
    edits: Sender<Arc<Input>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Connection {
    /// Address as the graph states it.
    plug: Plug,
    /// Sends new settings to the thread.
    edits: Sender<Plug>,
    /// Address with the port that the system chose for port 0.
    bound: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// Numbers of connections of each kind.
#[derive(Debug, Clone, Copy)]
pub struct Connected {
    list: usize,
    inputs: usize,
    hubs: usize,
    heard: usize,
}

impl Connections {
    /// Connects the network devices of a graph that are not connected yet. Returns the previous numbers, for
    /// [`Self::let_go`] if the graph is not run after all.
    ///
    /// # Errors
    /// [`NetworkError`]; earlier connections remain, and no new one is made.
    pub fn connect(&mut self, graph: &Graph) -> Result<Connected, NetworkError> {
        let before = Connected {
            list: self.list.len(),
            inputs: self.inputs.len(),
            hubs: self.hubs.len(),
            heard: self.heard.len(),
        };
        if let Err(error) = self.open(graph) {
            self.let_go(before);
            return Err(error);
        }
        Ok(before)
    }

    /// Disconnects what was connected since.
    pub fn let_go(&mut self, before: Connected) {
        self.list.truncate(before.list);
        self.inputs.truncate(before.inputs);
        self.hubs.truncate(before.hubs);
        self.heard.truncate(before.heard);
        for hub in &self.hubs {
            hub.retain(|link| self.heard.iter().any(|known| Arc::ptr_eq(&known.link, link)));
        }
    }

    /// Takes over the names and settings of the running graph's devices. Packets of devices that it does
    /// not have are still counted, for a later graph that has them again.
    pub fn follow(&mut self, graph: &Graph) {
        for (device, way) in remotes(graph) {
            let link = match way {
                Way::Socket(plug) => {
                    let same =
                        |known: &&mut Connection| plug.shares_with(&known.plug.link, known.plug.listen);
                    if let Some(known) = self.list.iter_mut().find(same) {
                        known.follow(plug);
                    }
                    &plug.link
                }
                Way::Input(input) => {
                    let same = |known: &&mut Reading| Arc::ptr_eq(&known.input.link, &input.link);
                    if let Some(known) = self.inputs.iter_mut().find(same) {
                        known.follow(input);
                    }
                    &input.link
                }
            };
            self.rename(device, link);
        }
        for (device, input) in number_inputs(graph) {
            self.rename(device, &input.route.link);
        }
    }

    fn rename(&mut self, device: &str, link: &Arc<Link>) {
        if let Some(known) = self.heard.iter_mut().find(|known| Arc::ptr_eq(&known.link, link)) {
            device.clone_into(&mut known.device);
        }
    }

    fn open(&mut self, graph: &Graph) -> Result<(), NetworkError> {
        let mut plugs: Vec<(&str, &Plug)> = Vec::new();
        for (device, way) in remotes(graph) {
            match way {
                Way::Socket(plug) => {
                    let shared = |(_, known): &&(&str, &Plug)| known.shares_with(&plug.link, plug.listen);
                    if let Some((other, _)) = plugs.iter().find(shared) {
                        let (one, two) = ((*other).to_owned(), device.to_owned());
                        return Err(NetworkError::Shared(one, two, plug.listen));
                    }
                    plugs.push((device, plug));
                }
                Way::Input(input) => {
                    // An open event device continues for every holder of its link.
                    let same = |known: &&Reading| Arc::ptr_eq(&known.input.link, &input.link);
                    if let Some(known) = self.inputs.iter().find(same) {
                        known.understands(device, input)?;
                    } else {
                        self.inputs.push(Reading::begin(device, input)?);
                        let place = input.path.display().to_string();
                        self.listen(device, place, &input.link);
                    }
                }
            }
        }
        for (device, plug) in plugs {
            let is_it = |known: &Connection| plug.shares_with(&known.plug.link, known.plug.listen);
            if !self.list.iter().any(is_it) {
                let connection = Connection::open(device, plug)?;
                let place = connection.bound.to_string();
                self.list.push(connection);
                self.listen(device, place, &plug.link);
            }
        }
        number_inputs(graph).try_for_each(|(device, input)| self.open_input(device, input))
    }

    fn open_input(&mut self, device: &str, input: &NumberInput) -> Result<(), NetworkError> {
        let (place, route) = (&input.place, &input.route);
        let device = || device.to_owned();
        let hub = match self.hubs.iter().position(|hub| hub.is_at(place)) {
            Some(known) if self.hubs[known].is_as(place) => known,
            Some(_) => return Err(NetworkError::Differ(device(), place.to_string())),
            None => {
                let failed = |error| NetworkError::Place {
                    device: device(),
                    place: place.to_string(),
                    error,
                };
                self.hubs.push(Hub::open(place).map_err(failed)?);
                self.hubs.len() - 1
            }
        };
        if self.hubs[hub].add(route) {
            self.listen(&device(), format!("{place} {}", route.selector), &route.link);
        }
        Ok(())
    }

    /// Counts of each device's packets, or of its Linux events.
    pub fn counts(&self) -> impl Iterator<Item = (&str, Counts)> {
        self.heard
            .iter()
            .map(|known| (known.device.as_str(), known.link.counts()))
    }

    /// The OSC addresses at a device's port to which messages came that no device listens to, and how many.
    pub fn unclaimed(&self, device: &str) -> Vec<(String, u64)> {
        let known = self.heard.iter().find(|known| known.device == device);
        known.map_or_else(Vec::new, |known| known.link.unclaimed.list())
    }

    /// Each device, and where it is listened to or read from.
    pub fn places(&self) -> impl Iterator<Item = (&str, &str)> {
        self.heard
            .iter()
            .map(|known| (known.device.as_str(), known.place.as_str()))
    }

    fn listen(&mut self, device: &str, place: String, link: &Arc<Link>) {
        self.heard.push(Listening {
            device: device.to_owned(),
            place,
            link: Arc::clone(link),
        });
    }
}

/// The devices of a graph that other programs own.
fn remotes(graph: &Graph) -> impl Iterator<Item = (&str, &Way)> {
    let devices = graph.devices().iter();
    devices.filter_map(|device| {
        let remote = device.device().as_any().downcast_ref::<Remote>()?;
        Some((&*device.name, &remote.way))
    })
}

/// The live inputs of a graph.
fn number_inputs(graph: &Graph) -> impl Iterator<Item = (&str, &NumberInput)> {
    let devices = graph.devices().iter();
    devices.filter_map(|device| Some((&*device.name, device.device().as_any().downcast_ref()?)))
}

impl Reading {
    fn begin(device: &str, input: &Arc<Input>) -> Result<Self, NetworkError> {
        let stop = Arc::new(AtomicBool::new(false));
        let (edits, edited) = channel();
        let begun = evdev::begin(device, input, edited, &stop);
        let (thread, states_scale) = begun.map_err(|error| failed(device, input, error))?;
        Ok(Self {
            input: Arc::clone(input),
            states_scale,
            edits,
            stop,
            thread: Some(thread),
        })
    }

    /// Whether the device can be read with these settings.
    fn understands(&self, device: &str, input: &Input) -> Result<(), NetworkError> {
        match input.counts_per_mm.is_some() || self.states_scale {
            true => Ok(()),
            false => Err(failed(device, input, evdev::unknown_scale())),
        }
    }

    fn follow(&mut self, input: &Arc<Input>) {
        if *self.input != **input {
            self.input = Arc::clone(input);
            // The thread may have ended.
            let _ = self.edits.send(Arc::clone(input));
        }
    }
}

fn failed(device: &str, input: &Input, error: std::io::Error) -> NetworkError {
    NetworkError::Input {
        device: device.to_owned(),
        path: input.path.clone(),
        error,
    }
}

impl Drop for Reading {
    fn drop(&mut self) {
        end(&self.stop, &mut self.thread);
    }
}

/// Waits for a thread to end.
pub(super) fn end(stop: &AtomicBool, thread: &mut Option<JoinHandle<()>>) {
    stop.store(true, Ordering::Relaxed);
    if let Some(thread) = thread.take() {
        // A panic does not matter here: the thread's resources are released either way.
        let _ = thread.join();
    }
}

impl Connection {
    fn open(device: &str, plug: &Plug) -> Result<Self, NetworkError> {
        let failed = |error| NetworkError::Bind {
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
            plug: plug.clone(),
            edits,
            bound,
            stop,
            thread: Some(thread),
        })
    }

    fn follow(&mut self, plug: &Plug) {
        if !self.plug.says_the_same(plug) {
            self.plug = plug.clone();
            // The thread may have ended.
            let _ = self.edits.send(plug.clone());
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        end(&self.stop, &mut self.thread);
    }
}

struct Conversation<'a> {
    plug: Plug,
    socket: &'a UdpSocket,
    device: Option<SocketAddr>,
    /// Time of the last packet.
    heard: Option<Instant>,
    /// Sequence number and timestamp of its latest state.
    latest: (u32, u64),
    sensed: [f64; SENSED],
    driven: [f64; DRIVEN],
    /// Version of the command, and when it was first seen.
    driven_version: (u64, Option<Instant>),
    told: u32,
    teller: Option<Teller>,
}

impl<'a> Conversation<'a> {
    /// A conversation in which a command counts that is newer than `version`.
    fn new(plug: Plug, socket: &'a UdpSocket, version: u64) -> Self {
        Self {
            device: plug.only,
            teller: plug.codec.teller(),
            plug,
            socket,
            heard: None,
            latest: (0, 0),
            sensed: [0.0; SENSED],
            driven: [0.0; DRIVEN],
            driven_version: (version, None),
            told: 0,
        }
    }

    fn hold(mut self, edits: &Receiver<Plug>, stop: &AtomicBool) {
        let mut bytes = vec![0; MAX_BYTES];
        while !stop.load(Ordering::Relaxed) {
            if let Some(plug) = edits.try_iter().last() {
                self.follow(plug);
            }
            match self.socket.recv_from(&mut bytes) {
                Ok((length, from)) => self.hear(&bytes[..length], from),
                Err(error) if is_passing(&error) => {}
                // An unknown error: do not spin.
                Err(_) => std::thread::sleep(WAIT),
            }
            self.tell();
        }
        self.release();
    }

    /// Sends the device a last command with zeros.
    fn release(&mut self) {
        self.driven = [0.0; DRIVEN];
        if let Some(teller) = &self.teller {
            // Repeated, because packets may be lost.
            (0..3).for_each(|_| teller.tell(self.socket, &self.driven));
        }
        if let (Codec::Protocol, Some(device)) = (&self.plug.codec, self.device) {
            // If none arrives, the device's own watchdog acts.
            let _ = self.socket.send_to(&self.command(false).to_bytes(), device);
        }
    }

    /// Applies new settings. A peer that is no longer driven gets a last command; a peer that is no longer accepted is forgotten.
    fn follow(&mut self, plug: Plug) {
        if plug.codec != self.plug.codec || plug.only != self.plug.only {
            self.release();
            (self.device, self.heard) = (plug.only, None);
            self.teller = plug.codec.teller();
        }
        self.plug = plug;
    }

    fn is_silent(&self) -> bool {
        self.heard.is_none_or(|heard| heard.elapsed() > self.plug.timeout)
    }

    fn hear(&mut self, bytes: &[u8], from: SocketAddr) {
        let silent = self.is_silent();
        if self.device.is_some_and(|device| device != from) && (self.plug.only.is_some() || !silent) {
            self.plug.link.count(Count::Strangers, 1);
            return;
        }
        match &self.plug.codec {
            Codec::Protocol => match State::from_bytes(bytes) {
                Ok(state) => self.take_state(&state, from, silent),
                Err(PacketError::NotFinite) => self.plug.link.count(Count::NotNumbers, 1),
                Err(PacketError::TooLarge) => self.plug.link.count(Count::TooLarge, 1),
                Err(_) => self.plug.link.count(Count::Malformed, 1),
            },
            Codec::Osc(addresses) => match addresses.understand(bytes, &mut self.sensed) {
                Ok(true) => self.accept(from),
                Ok(false) => {
                    // It was understood as a packet a moment ago.
                    if let Ok(packet) = decode(bytes) {
                        each_message(&packet, &mut |message: &OscMessage| {
                            self.plug.link.leave(&message.addr)
                        });
                    }
                }
                Err(what) => self.plug.link.count(what, 1),
            },
        }
    }

    fn take_state(&mut self, state: &State, from: SocketAddr, silent: bool) {
        // After silence the device may have restarted, with any sequence number.
        if !silent {
            match ahead(state.sequence, self.latest.0) {
                None => {
                    self.plug.link.count(Count::Outdated, 1);
                    return;
                }
                Some(ahead) => self.plug.link.count(Count::Missing, u64::from(ahead - 1)),
            }
        }
        self.latest = (state.sequence, state.timestamp_ns);
        let parts = [
            state.position_m,
            state.orientation_rad,
            state.force_n,
            state.torque_n_m,
        ];
        self.sensed.copy_from_slice(parts.as_flattened());
        self.accept(from);
        self.look_at_drives();
        // The next answer makes up for a lost one.
        let _ = self.socket.send_to(&self.command(true).to_bytes(), from);
    }

    fn accept(&mut self, from: SocketAddr) {
        self.device = Some(from);
        self.heard = Some(Instant::now());
        self.plug.link.tell(&self.sensed);
    }

    /// The latest command; zeros if the ticks that compute it have stopped.
    fn look_at_drives(&mut self) {
        if let Some((version, driven)) = self.plug.link.driven.look() {
            let (known, _) = self.driven_version;
            if version != known {
                self.driven_version = (version, Some(Instant::now()));
            }
            self.driven = driven;
        }
        let (_, since) = self.driven_version;
        if since.is_none_or(|since| since.elapsed() > self.plug.timeout) {
            self.driven = [0.0; DRIVEN];
        }
    }

    fn command(&mut self, running: bool) -> Command {
        self.told = self.told.wrapping_add(1);
        let [x, y, z, current_a, brake_a] = self.driven;
        Command {
            sequence: self.told,
            answers: self.latest.0,
            timestamp_ns: self.latest.1,
            force_n: [x, y, z],
            current_a,
            brake_a,
            running,
        }
    }

    /// By Open Sound Control commands are sent at their own rate.
    fn tell(&mut self) {
        if self.teller.as_mut().is_some_and(Teller::is_due) {
            self.look_at_drives();
            if let Some(teller) = &self.teller {
                teller.tell(self.socket, &self.driven);
            }
        }
    }
}

/// How far a sequence number is ahead of another, modulo its range; none if it is not ahead.
fn ahead(new: u32, old: u32) -> Option<u32> {
    let ahead = new.wrapping_sub(old);
    (1..=u32::MAX / 2).contains(&ahead).then_some(ahead)
}

/// Errors that do not affect a socket: a timeout, or an answer that reached no receiver.
fn is_passing(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{ConnectionRefused, ConnectionReset, Interrupted, TimedOut, WouldBlock};
    matches!(
        error.kind(),
        WouldBlock | TimedOut | Interrupted | ConnectionReset | ConnectionRefused
    )
}

#[cfg(test)]
mod tests;
