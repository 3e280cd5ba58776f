//! The studio on this machine: server, clock, and files.

mod assets;
mod converse;
mod docs;
mod export;
mod gallery;
mod learn;
mod listen;
mod pump;
mod save;
mod server;
mod visits;

pub use export::{Export, Exported, export, export_study};
pub use gallery::shipped;
pub use learn::Learner;
pub use listen::lan_address;
pub use server::{Options, Studio, StudioError};

use crate::stage::Stage;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Locks a stage even after a panic: each of its parts stays consistent.
fn lock(stage: &Mutex<Stage>) -> MutexGuard<'_, Stage> {
    stage.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs `work` on a blocking thread; `None` if it panicked.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    tokio::task::spawn_blocking(work).await.ok()
}

/// Calls `work` with the stage; `None` if it panicked. The server's one thread never waits for the stage: a thread that
/// reopens a soundcard or swaps a graph may hold it for seconds.
async fn with_stage<T: Send + 'static>(
    stage: &Arc<Mutex<Stage>>,
    work: impl FnOnce(&mut Stage) -> T + Send + 'static,
) -> Option<T> {
    let stage = Arc::clone(stage);
    blocking(move || work(&mut lock(&stage))).await
}
