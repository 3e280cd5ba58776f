//! Network devices: another program owns a real arm, sensor or tablet, sends its measurements and receives commands
//! for its actuators, by haptograph's own protocol ([`protocol`]) or by Open Sound Control. Inputs of one number each are in
//! [`inputs`].
//!
//! A separate thread handles the network; ticks read the latest update through a lock-free cell.

mod conditioner;
mod control;
mod evdev;
pub mod inputs;
mod link;
mod osc;
pub mod protocol;
mod remote;
mod socket;

pub use control::{OscControl, SetRequest, parse_settings};
pub use evdev::{EvdevDevice, EvdevDeviceSettings};
pub use link::Counts;
pub use osc::{OscDevice, OscDeviceSettings};
pub use remote::{UdpDevice, UdpDeviceSettings};
pub use socket::{Connected, Connections};

use std::net::SocketAddr;
use std::path::PathBuf;

/// Error of a network device or live input.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// The address cannot be bound.
    #[error("device `{device}` cannot listen at {address}: {error}")]
    Bind {
        /// Name of the endpoint.
        device: String,
        /// The address.
        address: SocketAddr,
        /// Error of the system.
        error: std::io::Error,
    },
    /// The event device cannot be read.
    #[error("device `{device}` cannot be read from {}: {error}", path.display())]
    Input {
        /// Name of the endpoint.
        device: String,
        /// The event device.
        path: PathBuf,
        /// The error.
        error: std::io::Error,
    },
    /// An input cannot be opened.
    #[error("input `{device}` cannot be opened at {place}: {error}")]
    Place {
        /// Name of the endpoint.
        device: String,
        /// An address, a serial port or a MIDI port.
        place: String,
        /// The error.
        error: std::io::Error,
    },
    /// Inputs at one serial port differ in `baud`.
    #[error("input `{0}` reads {1} at another rate than other inputs: give all of them the same `baud`")]
    Differ(String, String),
    /// Two endpoints listen at the same address.
    #[error("devices `{0}` and `{1}` both listen at {2}; give each a port of its own")]
    Shared(String, String, SocketAddr),
}

/// Publishes an update of a device, as its thread would: the tip at rest, pressed with a force (N).
#[cfg(test)]
pub(crate) fn told_by_hand(place: &str, force_n: f64) {
    let mut sensed = [0.0; link::SENSED];
    sensed[8] = force_n;
    remote::link_at(place).tell(&sensed);
}
