//! Numbers by serial port: lines of text with columns of numbers, as an Arduino prints them.

#[cfg(any(test, all(feature = "serial", unix)))]
mod lines;
#[cfg(all(feature = "serial", unix))]
mod port;

use crate::backend::BackendEntry;
use haptograph_engine::device::DeviceKind;
use haptograph_nodes::network::inputs::SerialInput;

/// Serial ports.
pub const BACKEND: BackendEntry = BackendEntry {
    what: "serial ports",
    feature: "serial",
    kinds: &[SerialInput::SPEC.name],
    is_built: cfg!(all(feature = "serial", unix)),
    drives: false,
    drives_any_clock: false,
    #[cfg(all(feature = "serial", unix))]
    new: Some(crate::numbers::Listeners::<port::SerialPort>::boxed),
    #[cfg(not(all(feature = "serial", unix)))]
    new: None,
};
