//! Devices beyond a network: a program that owns a real arm, sensor or tablet sends what it senses and gets back what
//! to drive, by haptograph's own protocol ([`protocol`]) or by Open Sound Control; and inputs of one number each
//! ([`inputs`]).
//!
//! A thread of its own talks to the network; ticks see its latest news through a cell without locks.

mod conditioner;
mod control;
mod evdev;
pub mod inputs;
mod link;
mod osc;
pub mod protocol;
mod remote;
mod socket;

pub use control::{OscControl, Told, understand};
pub use evdev::{EvdevDevice, EvdevDeviceSettings};
pub use link::Counts;
pub use osc::{OscDevice, OscDeviceSettings};
pub use remote::{UdpDevice, UdpDeviceSettings};
pub use socket::{Connected, Connections};

use std::net::SocketAddr;
use std::path::PathBuf;

/// Why a device beyond the network cannot be reached.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// Its address is not to be had.
    #[error("device `{device}` cannot listen at {address}: {error}")]
    Bind {
        /// Name of the endpoint.
        device: String,
        /// Where it should listen.
        address: SocketAddr,
        /// What the system says.
        error: std::io::Error,
    },
    /// It cannot be read.
    #[error("device `{device}` cannot be read from {}: {error}", path.display())]
    Input {
        /// Name of the endpoint.
        device: String,
        /// The event device.
        path: PathBuf,
        /// What is wrong.
        error: std::io::Error,
    },
    /// An input cannot be heard.
    #[error("input `{device}` cannot be heard at {place}: {error}")]
    Place {
        /// Name of the endpoint.
        device: String,
        /// An address, a serial port or a MIDI port.
        place: String,
        /// What is wrong.
        error: std::io::Error,
    },
    /// An input at a serial port that is read at another rate.
    #[error("input `{0}` reads {1} at another rate than others do; give all of them the same `baud`")]
    Differ(String, String),
    /// Two endpoints would listen at the same place.
    #[error("devices `{0}` and `{1}` both listen at {2}; give each a port of its own")]
    Shared(String, String, SocketAddr),
}

/// News of a device, as its thread would tell them: the tip at rest, pressed with a force (N).
#[cfg(test)]
pub(crate) fn told_by_hand(place: &str, force_n: f64) {
    let mut sensed = [0.0; link::SENSED];
    sensed[8] = force_n;
    remote::link_at(place).tell(&sensed);
}
