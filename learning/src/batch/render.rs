//! Renders a batch, or a shard of it, into a folder.

use super::chunk::{About, Chunk, file_name, verify};
use super::folder::{Claim, FolderError};
use super::manifest::Manifest;
use super::plan::Batch;
use crate::parts::{self, Outcome, Shard};
use haptograph_signal::parallel;
use haptograph_surfaces::rendering::SynthesisError;
use serde::{Serialize, Serializer};
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Settings for rendering a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RenderSettings {
    /// The shard to render; `None` for the whole batch.
    pub shard: Option<Shard>,
    /// Number of chunks rendered in parallel. Each needs its own memory.
    pub threads: usize,
}

impl Default for RenderSettings {
    /// The whole batch, on all cores.
    fn default() -> Self {
        Self { shard: None, threads: parallel::cores() }
    }
}

/// The result of a run.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Rendered {
    /// Chunks of the requested shard.
    pub chunks: u64,
    /// True if the folder now has every chunk of the whole batch.
    #[serde(rename = "complete")]
    pub is_complete: bool,
    /// The folder.
    pub folder: PathBuf,
    /// Chunks that already existed.
    pub kept: u64,
    /// The families of processors that rendered the chunks in the folder.
    pub processors: BTreeSet<String>,
    /// Chunks rendered in this run.
    pub rendered: u64,
    /// Damaged files and the reasons; they were rendered again.
    #[serde(serialize_with = "paths")]
    pub replaced: Vec<(PathBuf, String)>,
    /// True if the run was stopped before its end.
    #[serde(rename = "stopped")]
    pub was_stopped: bool,
}

fn paths<S: Serializer>(replaced: &[(PathBuf, String)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(replaced.iter().map(|(path, _)| path))
}

/// An error of rendering a batch.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum RenderError {
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error("cannot render job {job}: {source}")]
    Job { job: u64, source: SynthesisError },
    #[error("cannot write {}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
}

/// Renders the missing chunks of a batch, or of a shard of it, into a folder, and writes the manifest.
///
/// Existing chunks are read and their hashes compared; damaged ones are rendered again. A kill loses at most the chunks in
/// progress. `progress` receives the fraction done, 0 to 1, from any thread. Memory is one chunk for each thread.
///
/// # Errors
/// [`RenderError`]. Chunks rendered before remain.
pub fn render(
    batch: &Batch,
    folder: &Path,
    settings: &RenderSettings,
    progress: &(dyn Fn(f64) + Sync),
    stop: &AtomicBool,
) -> Result<Rendered, RenderError> {
    let _claim = Claim::of(folder, batch.identity())?;
    let work = (settings.threads, batch.chunks(), settings.shard);
    let find = |chunk| find(batch, folder, chunk);
    let outcomes = parts::resume(work, (progress, stop), find, |chunk| compute(batch, folder, chunk, stop))?;
    let (mut rendered, found) = summary(batch, folder, settings.shard, outcomes);
    rendered.was_stopped = rendered.kept + rendered.rendered < rendered.chunks;
    let manifest = Manifest::of(batch, &found);
    rendered.is_complete = manifest.complete;
    rendered.processors = manifest.processors.clone();
    let path = folder.join(super::MANIFEST);
    if rendered.was_stopped && rendered.rendered == 0 && path.is_file() {
        // Nothing is new, and the existing manifest is more complete than an interrupted scan.
        return Ok(rendered);
    }
    manifest.write(folder).map_err(|source| RenderError::Io { path, source })?;
    Ok(rendered)
}

/// A chunk in the folder, or the damage of it.
fn find(batch: &Batch, folder: &Path, chunk: u64) -> Result<Option<About>, String> {
    let path = folder.join(file_name(chunk, batch.format()));
    match path.symlink_metadata() {
        Ok(_) => verify(&path, batch.format(), batch.identity(), chunk).map(Some),
        Err(_) => Ok(None),
    }
}

/// Renders a chunk into the folder; `None` if it was stopped.
fn compute(
    batch: &Batch,
    folder: &Path,
    chunk: u64,
    stop: &AtomicBool,
) -> Result<Option<About>, RenderError> {
    let path = folder.join(file_name(chunk, batch.format()));
    let rendered = Chunk::render(batch, chunk, stop);
    let rendered = rendered.map_err(|(job, source)| RenderError::Job { job, source })?;
    let written = rendered.map(|rendered| rendered.write(batch, &path)).transpose();
    written.map_err(|source| RenderError::Io { path, source })
}

/// The result, and the chunks in the folder.
fn summary(
    batch: &Batch,
    folder: &Path,
    shard: Option<Shard>,
    outcomes: Vec<Outcome<About>>,
) -> (Rendered, BTreeMap<u64, About>) {
    let is_own = |chunk: u64| shard.is_none_or(|shard| shard.has(chunk));
    let mut done = Rendered {
        chunks: (0..batch.chunks()).filter(|chunk| is_own(*chunk)).count() as u64,
        folder: folder.to_owned(),
        ..Rendered::default()
    };
    let mut found = BTreeMap::new();
    for (chunk, outcome) in (0..).zip(outcomes) {
        match outcome {
            Outcome::Kept(about) => {
                done.kept += u64::from(is_own(chunk));
                found.insert(chunk, about);
            }
            Outcome::Computed(about, broken) => {
                done.rendered += 1;
                done.replaced.extend(broken.map(|why| (folder.join(file_name(chunk, batch.format())), why)));
                found.insert(chunk, about);
            }
            Outcome::Absent => {}
        }
    }
    (done, found)
}
