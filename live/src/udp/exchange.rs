//! The thread that communicates with a device: accepts valid, new states, and answers with commands.

use super::WAIT;
use super::protocol::{Command, PacketError, State};
use crate::guard::{self, Guard, Target};
use crate::latest_command::LatestCommand;
#[cfg(feature = "osc")]
use crate::osc::{Addresses, OscSender, decode, each_message};
use haptograph_nodes::network::link::{Count, DRIVEN, Link, SENSED};
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

/// Socket settings of a device: addresses, timeout and protocol.
#[derive(Debug, Clone)]
pub(super) struct SocketConfig {
    pub link: Arc<Link>,
    pub listen: SocketAddr,
    pub only: Option<SocketAddr>,
    /// Silence after which the device counts as gone.
    pub timeout: Duration,
    pub codec: Codec,
}

impl SocketConfig {
    /// True if peer, timeout and protocol are the same.
    pub(super) fn has_same_settings(&self, other: &Self) -> bool {
        (self.only, self.timeout, &self.codec) == (other.only, other.timeout, &other.codec)
    }
}

/// Protocol of a device.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Codec {
    /// The device protocol.
    Protocol,
    /// Open Sound Control.
    #[cfg(feature = "osc")]
    Osc(Arc<Addresses>),
}

impl Codec {
    /// Where a device gets its commands that sends from an address.
    fn target(&self, device: Option<SocketAddr>) -> Option<Target> {
        match self {
            Self::Protocol => device.map(Target::Protocol),
            #[cfg(feature = "osc")]
            Self::Osc(addresses) => addresses.send_to.map(Target::Osc),
        }
    }

    #[cfg(feature = "osc")]
    fn osc_sender(&self) -> Option<OscSender> {
        match self {
            Self::Protocol => None,
            Self::Osc(addresses) => addresses.sender(),
        }
    }
}

/// Size of the largest datagram.
const MAX_BYTES: usize = 65_536;

/// A device at a socket.
pub(super) struct Exchange<'a> {
    config: SocketConfig,
    socket: &'a UdpSocket,
    guard: Option<Guard>,
    device: Option<SocketAddr>,
    /// Time of the last packet.
    last_packet: Option<Instant>,
    /// Sequence number and timestamp of its latest state.
    latest: (u32, u64),
    sensed: [f64; SENSED],
    driven: LatestCommand,
    command_sequence: u32,
    #[cfg(feature = "osc")]
    osc_sender: Option<OscSender>,
}

impl<'a> Exchange<'a> {
    /// An exchange that sends commands newer than `version`.
    pub(super) fn new(
        config: SocketConfig,
        socket: &'a UdpSocket,
        guard: Option<Guard>,
        version: u64,
    ) -> Self {
        Self {
            device: config.only,
            #[cfg(feature = "osc")]
            osc_sender: config.codec.osc_sender(),
            config,
            socket,
            guard,
            last_packet: None,
            latest: (0, 0),
            sensed: [0.0; SENSED],
            driven: LatestCommand::after(version),
            command_sequence: 0,
        }
    }

    /// Runs until `stop`, with new settings from `edits`.
    pub(super) fn run(mut self, edits: &Receiver<SocketConfig>, stop: &AtomicBool) {
        let mut bytes = vec![0; MAX_BYTES];
        self.aim_guard();
        while !stop.load(Ordering::Relaxed) && !guard::ends() {
            if let Some(config) = edits.try_iter().last() {
                self.configure(config);
            }
            match self.socket.recv_from(&mut bytes) {
                Ok((length, from)) => self.receive(&bytes[..length], from),
                Err(error) if is_transient(&error) => {}
                // An unknown error: do not spin.
                Err(_) => std::thread::sleep(WAIT),
            }
            #[cfg(feature = "osc")]
            self.send_osc();
        }
        self.release();
        // Where the process ends by force, the guard takes over.
        if let Some(guard) = self.guard.take_if(|_| !guard::ends()) {
            guard.end();
        }
    }

    fn aim_guard(&mut self) {
        if let Some(guard) = &mut self.guard {
            guard.aim(self.config.codec.target(self.device));
        }
    }

    /// Sends the device a last command with zeros.
    fn release(&mut self) {
        self.driven.values = [0.0; DRIVEN];
        #[cfg(feature = "osc")]
        if let Some(sender) = &self.osc_sender {
            // Repeated, because packets may be lost.
            (0..3).for_each(|_| sender.send(self.socket, &self.driven.values));
        }
        if let (Codec::Protocol, Some(device)) = (&self.config.codec, self.device) {
            // If none arrives, the device's own watchdog acts.
            let _ = self.socket.send_to(&self.command(false).to_bytes(), device);
        }
    }

    /// Applies new settings. A peer that is no longer driven gets a last command; a peer that is no longer accepted is forgotten.
    fn configure(&mut self, config: SocketConfig) {
        if config.codec != self.config.codec || config.only != self.config.only {
            self.release();
            (self.device, self.last_packet) = (config.only, None);
            #[cfg(feature = "osc")]
            {
                self.osc_sender = config.codec.osc_sender();
            }
        }
        self.config = config;
        self.aim_guard();
    }

    fn is_silent(&self) -> bool {
        self.last_packet.is_none_or(|time| time.elapsed() > self.config.timeout)
    }

    fn receive(&mut self, bytes: &[u8], from: SocketAddr) {
        let silent = self.is_silent();
        if self.device.is_some_and(|device| device != from) && (self.config.only.is_some() || !silent) {
            self.config.link.count(Count::Rejected, 1);
            return;
        }
        match &self.config.codec {
            Codec::Protocol => match State::from_bytes(bytes) {
                Ok(state) => self.take_state(&state, from, silent),
                Err(PacketError::NotFinite) => self.config.link.count(Count::NotNumbers, 1),
                Err(PacketError::TooLarge) => self.config.link.count(Count::TooLarge, 1),
                Err(_) => self.config.link.count(Count::Malformed, 1),
            },
            #[cfg(feature = "osc")]
            Codec::Osc(addresses) => match addresses.read(bytes, &mut self.sensed) {
                Ok(true) => self.accept(from),
                Ok(false) => {
                    // It was decoded above.
                    if let Ok(packet) = decode(bytes) {
                        each_message(&packet, &mut |message| self.config.link.count_unclaimed(&message.addr));
                    }
                }
                Err(what) => self.config.link.count(what, 1),
            },
        }
    }

    fn take_state(&mut self, state: &State, from: SocketAddr, silent: bool) {
        // After silence the device may have restarted, with any sequence number.
        if !silent {
            match ahead(state.sequence, self.latest.0) {
                None => {
                    self.config.link.count(Count::Outdated, 1);
                    return;
                }
                Some(ahead) => self.config.link.count(Count::Missing, u64::from(ahead - 1)),
            }
        }
        self.latest = (state.sequence, state.timestamp_ns);
        let parts = [state.position_m, state.orientation_rad, state.force_n, state.torque_n_m];
        self.sensed.copy_from_slice(parts.as_flattened());
        self.accept(from);
        self.driven.update(&self.config.link, self.config.timeout);
        // The next answer makes up for a lost one.
        let _ = self.socket.send_to(&self.command(true).to_bytes(), from);
    }

    fn accept(&mut self, from: SocketAddr) {
        if self.device.replace(from) != Some(from) {
            self.aim_guard();
        }
        self.last_packet = Some(Instant::now());
        self.config.link.publish(&self.sensed);
    }

    fn command(&mut self, running: bool) -> Command {
        self.command_sequence = self.command_sequence.wrapping_add(1);
        let [x, y, z, current_a, brake_a] = self.driven.values;
        Command {
            sequence: self.command_sequence,
            answers: self.latest.0,
            timestamp_ns: self.latest.1,
            force_n: [x, y, z],
            current_a,
            brake_a,
            running,
        }
    }

    /// Sends commands by Open Sound Control, which have their own rate.
    #[cfg(feature = "osc")]
    fn send_osc(&mut self) {
        if self.osc_sender.as_mut().is_some_and(OscSender::is_due) {
            self.driven.update(&self.config.link, self.config.timeout);
            if let Some(sender) = &self.osc_sender {
                sender.send(self.socket, &self.driven.values);
            }
        }
    }
}

/// Difference between a sequence number and an earlier one, modulo its range; `None` if it is not ahead.
pub(super) fn ahead(new: u32, old: u32) -> Option<u32> {
    let ahead = new.wrapping_sub(old);
    (1..=u32::MAX / 2).contains(&ahead).then_some(ahead)
}

/// Errors that do not affect a socket: a timeout, or an answer that nothing received.
fn is_transient(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{ConnectionRefused, ConnectionReset, Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted | ConnectionReset | ConnectionRefused)
}
