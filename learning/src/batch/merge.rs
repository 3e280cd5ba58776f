//! Merges the parts of a batch.

use super::chunk::verify;
use super::folder::{Claim, FolderError};
use super::manifest::{ChunkEntry, Manifest};
use haptograph_signal::files;
use haptograph_signal::files::write_atomically_by;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// An error of merging parts.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum MergeError {
    #[error("there is nothing to merge; name the folders of the parts")]
    Nothing,
    #[error(
        "{} is not the folder of a completely rendered part: cannot read its manifest ({source}); render the part again, \
         which goes on where it stopped",
        path.display()
    )]
    NoManifest { path: PathBuf, source: io::Error },
    #[error("the manifest in {} is invalid: {why}; render its part again into a new folder", path.display())]
    Manifest { path: PathBuf, why: String },
    #[error("{} and {} are not parts of one batch: their plans, files or versions differ", first.display(), second.display())]
    Different { first: PathBuf, second: PathBuf },
    #[error("chunk {chunk} is in both {} and {}; name only one of them", first.display(), second.display())]
    Twice { chunk: u64, first: PathBuf, second: PathBuf },
    #[error("{missing} of {whole} chunks are missing, the first is chunk {first}; render the missing shards")]
    Missing { missing: u64, whole: u64, first: u64 },
    #[error("{} is damaged: {why}; render its part again to repair it", path.display())]
    Broken { path: PathBuf, why: String },
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error("cannot write {}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
}

/// The result of a merge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Merged {
    /// Chunks of the whole.
    pub chunks: u64,
    /// Jobs of the whole.
    pub jobs: u64,
}

/// Merges the parts of a batch into one folder, by links if the file system supports them. The result is bitwise equal to that of
/// a single run.
///
/// Reads every chunk and compares its hash. Resumes an interrupted merge.
///
/// # Errors
/// [`MergeError`] if a chunk is missing, duplicate, damaged or of another batch; the target then has no complete manifest.
pub fn merge(folders: &[PathBuf], into: &Path, progress: &dyn Fn(f64)) -> Result<Merged, MergeError> {
    let parts = read(folders)?;
    let Some((_, first)) = parts.first() else {
        return Err(MergeError::Nothing);
    };
    let chunks = whole(&parts)?;
    let _claim = Claim::of(into, &first.batch)?;
    for (number, (from, entry)) in chunks.values().enumerate() {
        take(from, into, entry, &first.batch)?;
        progress((number + 1) as f64 / chunks.len() as f64);
    }
    let merged = Manifest {
        complete: true,
        chunks: chunks.values().map(|(_, entry)| (*entry).clone()).collect(),
        ..first.clone()
    };
    let path = into.join(super::MANIFEST);
    merged.write(into).map_err(|source| MergeError::Io { path, source })?;
    Ok(Merged { chunks: merged.whole(), jobs: merged.jobs })
}

/// The manifests of all parts, of one batch.
fn read(folders: &[PathBuf]) -> Result<Vec<(PathBuf, Manifest)>, MergeError> {
    let mut parts: Vec<(PathBuf, Manifest)> = vec![];
    for path in folders {
        let manifest = Manifest::read(path);
        let manifest = manifest.map_err(|source| MergeError::NoManifest { path: path.clone(), source })?;
        manifest.check().map_err(|why| MergeError::Manifest { path: path.clone(), why })?;
        if let Some((first, other)) = parts.first() {
            let without_chunks = |of: &Manifest| Manifest { complete: false, chunks: vec![], ..of.clone() };
            if without_chunks(other) != without_chunks(&manifest) {
                let (first, second) = (first.clone(), path.clone());
                return Err(MergeError::Different { first, second });
            }
        }
        parts.push((path.clone(), manifest));
    }
    Ok(parts)
}

/// Every chunk of the batch once, with the folder that it is in.
fn whole(parts: &[(PathBuf, Manifest)]) -> Result<BTreeMap<u64, (&Path, &ChunkEntry)>, MergeError> {
    let mut chunks: BTreeMap<u64, (&Path, &ChunkEntry)> = BTreeMap::new();
    for (folder, manifest) in parts {
        for entry in &manifest.chunks {
            if let Some((first, _)) = chunks.insert(entry.chunk, (folder, entry)) {
                let (first, second) = (first.to_owned(), folder.clone());
                return Err(MergeError::Twice { chunk: entry.chunk, first, second });
            }
        }
    }
    let whole = parts.first().map_or(0, |(_, manifest)| manifest.whole());
    let mut missing = (0..whole).filter(|chunk| !chunks.contains_key(chunk));
    match missing.next() {
        None => Ok(chunks),
        Some(first) => Err(MergeError::Missing { missing: 1 + missing.count() as u64, whole, first }),
    }
}

/// Copies or links a chunk into the folder, unless it is already there, and verifies it.
fn take(from: &Path, into: &Path, entry: &ChunkEntry, identity: &str) -> Result<(), MergeError> {
    let name = super::chunk::file_name(entry.chunk);
    let (source, target) = (from.join(&name), into.join(&name));
    let is_whole = |path: &Path| match verify(path, identity, entry.chunk) {
        Ok(hash) if hash == entry.sha256 => Ok(()),
        Ok(_) => Err("its content does not match its manifest".to_owned()),
        Err(why) => Err(why),
    };
    if target.symlink_metadata().is_ok() && is_whole(&target).is_ok() {
        return Ok(());
    }
    let broken = |why| MergeError::Broken { path: source.clone(), why };
    is_whole(&source).map_err(broken)?;
    let _ = fs::remove_file(&target);
    // The target of a link, not the link.
    let linked = source.canonicalize().and_then(|file| fs::hard_link(file, &target));
    let placed = linked.or_else(|_| copy(&source, &target));
    placed.map_err(|error| MergeError::Io { path: target.clone(), source: error })?;
    Ok(())
}

/// Copies the file if links are not supported.
fn copy(from: &Path, to: &Path) -> io::Result<()> {
    let mut source = files::open(from, u64::MAX)?;
    write_atomically_by(to, |target| io::copy(&mut source, target).map(drop))
}
