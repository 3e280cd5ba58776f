//! Open Sound Control: devices and inputs of other programs, and settings.

#[cfg(feature = "osc")]
mod control;
#[cfg(feature = "osc")]
mod device;
#[cfg(feature = "osc")]
mod input;
#[cfg(feature = "osc")]
mod packet;

#[cfg(feature = "osc")]
pub use control::{OscControl, SetRequest, parse_settings};
#[cfg(feature = "osc")]
pub(crate) use {
    device::{Addresses, OscSender, send_driven},
    packet::{decode, each_message},
};

use crate::backend::BackendEntry;
use haptograph_engine::device::DeviceKind;
use haptograph_nodes::network::inputs::OscInput;

/// Inputs by Open Sound Control. Devices by Open Sound Control belong to the backend of UDP, which has their sockets.
pub const BACKEND: BackendEntry = BackendEntry {
    what: "Open Sound Control",
    feature: "osc",
    kinds: &[OscInput::SPEC.name],
    is_built: cfg!(feature = "osc"),
    drives: false,
    drives_any_clock: false,
    #[cfg(feature = "osc")]
    new: Some(crate::numbers::Listeners::<input::OscPort>::boxed),
    #[cfg(not(feature = "osc"))]
    new: None,
};
