//! The studio on this machine: its server, its clock, and what it writes.

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

/// A stage, also where somebody panicked with it: each of its parts is whole by itself.
fn lock(stage: &Mutex<Stage>) -> MutexGuard<'_, Stage> {
    stage.lock().unwrap_or_else(PoisonError::into_inner)
}
