//! Renders a batch, or a shard of it, into a folder.

use super::chunk::{Chunk, file_name, verify};
use super::folder::{Claim, FolderError};
use super::manifest::Manifest;
use super::plan::Batch;
use crate::shard::Shard;
use haptograph_surfaces::rendering::SynthesisError;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

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
        Self { shard: None, threads: std::thread::available_parallelism().map_or(1, usize::from) }
    }
}

/// The result of a run.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Rendered {
    /// Chunks of the requested shard.
    pub chunks: u64,
    /// Chunks rendered in this run.
    pub rendered: u64,
    /// Chunks that already existed.
    pub kept: u64,
    /// Damaged files and the reasons; they were rendered again.
    pub replaced: Vec<(PathBuf, String)>,
    /// True if the folder now has every chunk of the whole batch.
    pub is_complete: bool,
    /// True if the run was stopped before its end.
    pub was_stopped: bool,
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

/// The outcome for a chunk.
enum Outcome {
    Reused(String),
    Rendered(String, Option<String>),
    /// The chunk is neither in the shard nor in the folder.
    Absent,
    Stopped,
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
    let work = Work {
        batch,
        folder,
        shard: settings.shard,
        progress,
        stop,
        next: AtomicU64::new(0),
        ended: AtomicU64::new(0),
        state: Mutex::default(),
    };
    std::thread::scope(|scope| {
        let threads = (settings.threads.max(1) as u64).min(batch.chunks());
        for _ in 0..threads {
            scope.spawn(|| work.run());
        }
    });
    let State { failure, outcomes } = work.state.into_inner().unwrap_or_else(PoisonError::into_inner);
    if let Some(error) = failure {
        return Err(error);
    }
    let (mut rendered, found) = summary(batch, folder, settings.shard, outcomes);
    rendered.was_stopped = rendered.kept + rendered.rendered < rendered.chunks;
    let manifest = Manifest::of(batch, &found);
    rendered.is_complete = manifest.complete;
    let path = folder.join(super::MANIFEST);
    if rendered.was_stopped && rendered.rendered == 0 && path.is_file() {
        // Nothing is new, and the existing manifest is more complete than an interrupted scan.
        return Ok(rendered);
    }
    manifest.write(folder).map_err(|source| RenderError::Io { path, source })?;
    Ok(rendered)
}

/// The state shared by the threads.
struct Work<'a> {
    batch: &'a Batch,
    folder: &'a Path,
    shard: Option<Shard>,
    progress: &'a (dyn Fn(f64) + Sync),
    stop: &'a AtomicBool,
    next: AtomicU64,
    ended: AtomicU64,
    state: Mutex<State>,
}

/// The results so far.
#[derive(Default)]
struct State {
    failure: Option<RenderError>,
    outcomes: BTreeMap<u64, Outcome>,
}

impl Work<'_> {
    /// Processes chunks until none is left or one fails.
    fn run(&self) {
        let chunks = self.batch.chunks();
        loop {
            let chunk = self.next.fetch_add(1, Ordering::Relaxed);
            if chunk >= chunks || self.stop.load(Ordering::Relaxed) || self.state().failure.is_some() {
                return;
            }
            let taken = self.take(chunk);
            let mut state = self.state();
            match taken {
                Ok(outcome) => {
                    state.outcomes.insert(chunk, outcome);
                }
                Err(error) => {
                    state.failure.get_or_insert(error);
                }
            }
            drop(state);
            let ended = self.ended.fetch_add(1, Ordering::Relaxed) + 1;
            (self.progress)(ended as f64 / chunks as f64);
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Verifies a chunk, and renders it if it is missing or damaged and in this shard.
    fn take(&self, chunk: u64) -> Result<Outcome, RenderError> {
        let path = self.folder.join(file_name(chunk));
        let mut broken = None;
        if path.symlink_metadata().is_ok() {
            match verify(&path, self.batch.identity(), chunk) {
                Ok(hash) => return Ok(Outcome::Reused(hash)),
                Err(why) => broken = Some(why),
            }
        }
        if !self.shard.is_none_or(|shard| shard.has(chunk)) {
            return Ok(Outcome::Absent);
        }
        let rendered = Chunk::render(self.batch, chunk, self.stop);
        let Some(rendered) = rendered.map_err(|(job, source)| RenderError::Job { job, source })? else {
            return Ok(Outcome::Stopped);
        };
        let written = rendered.write(self.batch, &path);
        let hash = written.map_err(|source| RenderError::Io { path, source })?;
        Ok(Outcome::Rendered(hash, broken))
    }
}

/// The result, and the chunks in the folder.
fn summary(
    batch: &Batch,
    folder: &Path,
    shard: Option<Shard>,
    outcomes: BTreeMap<u64, Outcome>,
) -> (Rendered, BTreeMap<u64, String>) {
    let is_own = |chunk: u64| shard.is_none_or(|shard| shard.has(chunk));
    let mut done = Rendered {
        chunks: (0..batch.chunks()).filter(|chunk| is_own(*chunk)).count() as u64,
        ..Rendered::default()
    };
    let mut found = BTreeMap::new();
    for (chunk, outcome) in outcomes {
        match outcome {
            Outcome::Reused(hash) => {
                done.kept += u64::from(is_own(chunk));
                found.insert(chunk, hash);
            }
            Outcome::Rendered(hash, broken) => {
                done.rendered += 1;
                done.replaced.extend(broken.map(|why| (folder.join(file_name(chunk)), why)));
                found.insert(chunk, hash);
            }
            Outcome::Absent | Outcome::Stopped => {}
        }
    }
    (done, found)
}
