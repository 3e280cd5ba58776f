//! Tablets and mice that Linux reads.

#[cfg(all(feature = "evdev", target_os = "linux"))]
mod devices;
#[cfg(all(feature = "evdev", target_os = "linux"))]
mod reading;

use crate::backend::BackendEntry;
use haptograph_engine::device::DeviceKind;
use haptograph_nodes::network::EvdevDevice;

/// Linux's event devices.
pub const BACKEND: BackendEntry = BackendEntry {
    what: "tablets and mice",
    feature: "evdev",
    kinds: &[EvdevDevice::SPEC.name],
    is_built: cfg!(all(feature = "evdev", target_os = "linux")),
    drives: false,
    drives_any_clock: false,
    #[cfg(all(feature = "evdev", target_os = "linux"))]
    new: Some(|| Box::new(devices::EventDevices::default())),
    #[cfg(not(all(feature = "evdev", target_os = "linux")))]
    new: None,
};
