//! Data sets: many vibrations of many surfaces along many motions, rendered chunk by chunk from a plan.
//!
//! A [`Batch`] is a plan with all that it names. Its jobs are numbered; a **chunk** is a fixed number of consecutive jobs, whose content
//! depends on the plan alone: not on how many threads, shards or attempts rendered it. A chunk is one file that carries the plan's identity and
//! the hash of its own content, so that [`render()`] renders what is missing or broken and nothing else, and [`merge()`] can prove that parts
//! are a whole.

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

pub use crate::shard::Shard;
pub use chunk::vibration;
pub use folder::FolderError;
pub use manifest::{ChunkEntry, MANIFEST};
pub use merge::{MergeError, Merged, merge};
pub use plan::{Batch, BatchSurface, Job};
pub use problem::{PlanError, PlanProblem};
pub use render::{RenderError, RenderSettings, Rendered, render};

use sha2::{Digest, Sha256};

/// A hash's hexadecimal digits.
fn hex(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The SHA-256 hash of some bytes.
fn hash(bytes: &[u8]) -> String {
    hex(Sha256::new().chain_update(bytes))
}

#[cfg(test)]
mod tests;
