//! Numbers by serial port: lines of text with columns of numbers, as an Arduino prints them.

#[cfg(any(test, all(feature = "serial", unix)))]
mod lines;
#[cfg(all(feature = "serial", unix))]
mod port;

use crate::backend::BackendEntry;

/// Serial ports.
pub const BACKEND: BackendEntry = BackendEntry {
    what: "serial ports",
    feature: "serial",
    kinds: &["SerialInput"],
    is_built: cfg!(all(feature = "serial", unix)),
    drives: false,
    #[cfg(all(feature = "serial", unix))]
    new: Some(crate::hub::Hubs::<port::SerialPort>::boxed),
    #[cfg(not(all(feature = "serial", unix)))]
    new: None,
};
