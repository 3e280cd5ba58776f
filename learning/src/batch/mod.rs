//! Renders data sets: vibrations of many surfaces along many motions, in chunks, from a plan.
//!
//! A [`Batch`] is a plan with all files that it names. Its jobs are numbered; a **chunk** is a fixed number of consecutive
//! jobs. Its content depends only on the plan, not on the number of threads, shards or attempts. A chunk is one file with the
//! plan's identity and the hash of its content, so that [`render()`] renders only missing or damaged chunks, and [`merge()`]
//! can verify that the parts are complete.

mod chunk;
mod document;
mod folder;
mod manifest;
mod merge;
mod motion;
mod pattern;
mod plan;
mod problem;
mod render;
mod table;

pub use crate::parts::Shard;
pub use chunk::vibration;
pub use folder::FolderError;
pub use manifest::{ChunkEntry, MANIFEST};
pub use merge::{MergeError, Merged, Processors, merge, read_manifest};
pub use plan::{Batch, BatchSurface, Job};
pub use problem::{PlanError, PlanProblem};
pub use render::{RenderError, RenderSettings, Rendered, render};

use haptograph_signal::files::hex;
use sha2::{Digest, Sha256};

/// The SHA-256 hash of some bytes.
fn hash(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

#[cfg(test)]
mod tests;
