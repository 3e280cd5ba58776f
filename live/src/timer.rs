//! Timers, which drive the clocks that no soundcard drives.

#[cfg(feature = "timer")]
mod drivers;
#[cfg(any(feature = "timer", target_os = "macos", windows))]
mod thread;

use crate::backend::BackendEntry;
#[cfg(any(feature = "timer", target_os = "macos", windows))]
pub use thread::TimerThread;
#[cfg(any(feature = "soundcard", target_os = "macos", windows))]
pub(crate) use thread::prepare_thread;

/// A timer for each driver clock without a soundcard.
pub const BACKEND: BackendEntry = BackendEntry {
    what: "timers",
    feature: "timer",
    kinds: &[],
    is_built: cfg!(feature = "timer"),
    drives: true,
    drives_any_clock: true,
    #[cfg(feature = "timer")]
    new: Some(|| Box::new(drivers::Timers::default())),
    #[cfg(not(feature = "timer"))]
    new: None,
};
