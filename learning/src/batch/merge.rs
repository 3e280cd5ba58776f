//! Merges the parts of a batch.

use super::chunk::verify;
use super::folder::{Claim, FolderError};
use super::manifest::{ChunkEntry, Manifest};
use crate::parts::{PartsError, whole};
use haptograph_signal::files::copy_atomically;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// An error of merging parts.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum MergeError {
    #[error(
        "{} is not the folder of a data set or of a rendered part: cannot read its manifest ({source}); render it again, \
         which goes on where it stopped",
        path.display()
    )]
    NoManifest { path: PathBuf, source: io::Error },
    #[error("the manifest in {} is invalid: {why}; render its part again into a new folder", path.display())]
    Manifest { path: PathBuf, why: String },
    #[error(transparent)]
    Parts(#[from] PartsError),
    #[error(
        "the parts were rendered by different processors ({}), which may round differently; render all parts on machines of \
         one of them, or allow any processor when merging",
        processors.join(", ")
    )]
    Processors { processors: Vec<String> },
    #[error("{} is damaged: {why}; render its part again to repair it", path.display())]
    Broken { path: PathBuf, why: String },
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error("cannot write {}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
}

/// The processors that may have rendered the parts of a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Processors {
    /// Those of one family.
    OneFamily,
    /// Those of any families; the manifest lists them.
    Any,
}

/// The result of a merge.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Merged {
    /// Chunks of the whole.
    pub chunks: u64,
    /// The folder of the whole.
    pub folder: PathBuf,
    /// Jobs of the whole.
    pub jobs: u64,
    /// The families of processors that rendered the chunks.
    pub processors: BTreeSet<String>,
}

/// Merges the parts of a batch into one folder, by links if the file system supports them. The result is bitwise equal to that of
/// a single run.
///
/// Reads every chunk and compares its hash. Resumes an interrupted merge.
///
/// # Errors
/// [`MergeError`] if a chunk is missing, duplicate, damaged, of another batch or of another family of processors; the target then
/// has no complete manifest.
pub fn merge(
    folders: &[PathBuf],
    into: &Path,
    allowed: Processors,
    progress: &dyn Fn(f64),
) -> Result<Merged, MergeError> {
    let manifests = folders.iter().map(|folder| read(folder)).collect::<Result<Vec<_>, _>>()?;
    let first = manifests.first().ok_or(PartsError::Nothing)?;
    let parts: Vec<_> =
        { folders.iter().zip(&manifests) }.map(|(folder, manifest)| manifest.part(folder)).collect();
    let chunks = whole(&parts, first.whole(), |entry: &ChunkEntry| format!("chunk {}", entry.chunk))?;
    let merged = Manifest {
        complete: true,
        chunks: chunks.iter().map(|(_, entry)| (*entry).clone()).collect(),
        processors: manifests.iter().flat_map(|manifest| manifest.processors.clone()).collect(),
        ..first.clone()
    };
    if allowed == Processors::OneFamily && merged.processors.len() > 1 {
        return Err(MergeError::Processors { processors: merged.processors.into_iter().collect() });
    }
    let _claim = Claim::of(into, &merged.batch)?;
    for (number, (from, entry)) in chunks.iter().enumerate() {
        take(from, into, entry, &merged)?;
        progress((number + 1) as f64 / chunks.len() as f64);
    }
    let path = into.join(super::MANIFEST);
    merged.write(into).map_err(|source| MergeError::Io { path, source })?;
    Ok(Merged {
        chunks: merged.whole(),
        folder: into.to_owned(),
        jobs: merged.jobs,
        processors: merged.processors,
    })
}

/// The manifest of a folder as JSON, after the checks of a merge.
///
/// # Errors
/// [`MergeError::NoManifest`], [`MergeError::Manifest`].
pub fn read_manifest(folder: &Path) -> Result<String, MergeError> {
    let path = folder.to_owned();
    let text = serde_json::to_string(&read(folder)?);
    text.map_err(|error| MergeError::Manifest { path, why: error.to_string() })
}

/// The manifest of a part.
fn read(folder: &Path) -> Result<Manifest, MergeError> {
    let path = folder.to_owned();
    match Manifest::read(folder) {
        Ok(manifest) => match manifest.check() {
            Ok(()) => Ok(manifest),
            Err(why) => Err(MergeError::Manifest { path, why }),
        },
        Err(source) => Err(MergeError::NoManifest { path, source }),
    }
}

/// Copies or links a chunk into the folder, unless it is already there, and verifies it.
fn take(from: &Path, into: &Path, entry: &ChunkEntry, whole: &Manifest) -> Result<(), MergeError> {
    let (source, target) = (from.join(&entry.file), into.join(&entry.file));
    let is_whole = |path: &Path| {
        let about = verify(path, whole.format, &whole.batch, entry.chunk)?;
        match about.sha256 == entry.sha256 && whole.processors.contains(&about.processor) {
            true => Ok(()),
            false => Err("its content does not match its manifest".to_owned()),
        }
    };
    if target.symlink_metadata().is_ok() && is_whole(&target).is_ok() {
        return Ok(());
    }
    let broken = |why| MergeError::Broken { path: source.clone(), why };
    is_whole(&source).map_err(broken)?;
    let _ = fs::remove_file(&target);
    // The target of a link, not the link.
    let linked = source.canonicalize().and_then(|file| fs::hard_link(file, &target));
    let placed = linked.or_else(|_| copy_atomically(&source, &target));
    placed.map_err(|source| MergeError::Io { path: target, source })
}
