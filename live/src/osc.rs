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
    device::{Addresses, OscSender},
    packet::{decode, each_message},
};

use crate::backend::BackendEntry;

/// Inputs by Open Sound Control. Devices by Open Sound Control belong to the backend of UDP, which has their sockets.
pub const BACKEND: BackendEntry = BackendEntry {
    what: "Open Sound Control",
    feature: "osc",
    kinds: &["OscInput"],
    is_built: cfg!(feature = "osc"),
    drives: false,
    #[cfg(feature = "osc")]
    new: Some(crate::hub::Hubs::<input::OscPort>::boxed),
    #[cfg(not(feature = "osc"))]
    new: None,
};
