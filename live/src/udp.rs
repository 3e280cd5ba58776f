//! Devices of other programs over UDP, by haptograph's own protocol or by Open Sound Control.

#[cfg(feature = "udp")]
mod exchange;
pub mod protocol;
#[cfg(feature = "udp")]
mod sockets;

use crate::backend::BackendEntry;
use haptograph_engine::device::DeviceKind;
use haptograph_nodes::network::{OscDevice, UdpDevice};
#[cfg(feature = "osc")]
pub(crate) use protocol::are_in_range;

/// Refuses two devices at one port.
#[cfg(feature = "udp")]
pub(crate) fn refuse_conflicts(graph: &haptograph_engine::graph::Graph) -> Result<(), crate::BackendError> {
    sockets::configs(graph).map(drop)
}

/// Longest wait of a thread before it checks for a stop or a new command.
#[cfg(feature = "udp")]
pub(crate) const WAIT: std::time::Duration = std::time::Duration::from_millis(5);

/// Devices with a socket of their own.
pub const BACKEND: BackendEntry = BackendEntry {
    what: "devices over UDP",
    feature: "udp",
    kinds: &[UdpDevice::SPEC.name, OscDevice::SPEC.name],
    is_built: cfg!(feature = "udp"),
    drives: false,
    drives_any_clock: false,
    #[cfg(feature = "udp")]
    new: Some(|| Box::new(sockets::Sockets::default())),
    #[cfg(not(feature = "udp"))]
    new: None,
};
