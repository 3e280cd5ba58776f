//! Live runs of haptograph: drivers, real devices, and their supervision.
//!
//! A graph names its devices; `haptograph-nodes` declares their ports and their bodies, which tick. This crate reaches the real
//! ones: a [`Backend`] for each sort of hardware, one folder and one feature each, in one table, [`BACKENDS`]; a program adds
//! its own by [`add_backend`]; inputs of one number need a [`NumberSource`] only. The core, without
//! any feature, has no threads, no files and no operating system, and builds for WebAssembly.
//!
//! # Features
//!
//! | feature | default | adds |
//! |---|---|---|
//! | `supervisor` | yes | supervision of a live run, with `timer` and `osc` |
//! | `timer` | with `supervisor` | timers, which drive the clocks that no soundcard drives |
//! | `udp` | with `osc` | devices of other programs, by the device protocol |
//! | `osc` | with `supervisor` | devices, inputs and settings by Open Sound Control, with `udp` |
//! | `soundcard` | | soundcards, with `timer`; on Linux this needs the headers of ALSA, on macOS and Windows they are always there |
//! | `evdev` | | tablets and mice, on Linux |
//! | `midi` | | MIDI; on Linux this needs the headers of ALSA |
//! | `midi-jack` | | MIDI by JACK or PipeWire in place of ALSA's sequencer; the headers of ALSA are needed too |
//! | `serial` | | serial ports, on Linux and macOS |
//! | `haply` | | Haply's arms, through the service of their manufacturer, with `udp` |

#![cfg_attr(not(test), warn(unreachable_pub))]

mod backend;
mod backends;
mod connections;
mod drivers;
pub mod evdev;
#[cfg(feature = "udp")]
pub mod guard;
pub mod haply;
#[cfg(feature = "udp")]
mod latest_command;
pub mod midi;
#[cfg_attr(not(feature = "osc"), allow(dead_code, reason = "only some backends use it"))]
mod numbers;
pub mod osc;
mod protected;
pub mod serial;
#[cfg(feature = "osc")]
mod setting_value;
pub mod soundcard;
#[cfg(feature = "supervisor")]
pub mod supervisor;
#[cfg(test)]
mod tests;
pub mod timer;
pub mod udp;
mod watch;

/// Counts allocations, which real-time code must not make.
#[cfg(test)]
#[expect(unsafe_code, reason = "an allocator that counts")]
#[path = "../../nodes/tests/realtime/mod.rs"]
mod realtime;

pub use backend::{Backend, BackendEntry, BackendError, BackendEvent, Connected, Counts, Lives, Role, State};
pub use backends::{BACKENDS, add_backend, refuse_conflicts};
pub use connections::Connections;
pub use drivers::Drivers;
pub use numbers::{NumberSource, Readers};
pub use protected::{LimitChange, ProtectedActuator};
#[cfg(feature = "osc")]
pub use setting_value::SettingValue;
pub use watch::FileWatch;

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Sets the stop flag of a thread and waits for its end.
#[cfg_attr(not(feature = "osc"), allow(dead_code, reason = "only some backends use it"))]
fn end(stop: &AtomicBool, thread: &mut Option<JoinHandle<()>>) {
    stop.store(true, Ordering::Relaxed);
    if let Some(thread) = thread.take() {
        // A panic does not matter here: the thread's resources are released either way.
        let _ = thread.join();
    }
}
