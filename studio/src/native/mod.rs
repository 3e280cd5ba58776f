//! The studio on this machine: server, clock, and files.

mod assets;
mod converse;
mod export;
mod learn;
mod listen;
mod pump;
mod save;
mod server;

pub use export::{Export, Exported, export};
pub use listen::lan_address;
pub use server::{Options, Studio, StudioError};

use crate::stage::Stage;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks a stage even after a panic: each of its parts stays consistent.
fn lock(stage: &Mutex<Stage>) -> MutexGuard<'_, Stage> {
    stage.lock().unwrap_or_else(PoisonError::into_inner)
}
