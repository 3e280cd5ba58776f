//! The folder of a batch: one process at a time writes to it, and only files of its batch.

use haptograph_signal::files::{self, TEMPORARY};
use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// The marker file with the identity of the batch; locked during writing.
const MARKER: &str = ".haptograph-batch";
/// Largest marker that is read, bytes.
const MAX_MARKER_BYTES: u64 = 1 << 12;

/// An error of writing to a folder.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum FolderError {
    #[error("cannot write to {}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    #[error("another process is rendering into {}; wait until it ends, or give another folder", path.display())]
    Busy { path: PathBuf },
    #[error("{} contains files that are not of a batch; give a new folder", path.display())]
    Foreign { path: PathBuf },
    #[error(
        "{} contains another batch: the plan, a file that it names, or the version of haptograph has changed; \
         give a new folder, or remove this one",
        path.display()
    )]
    Other { path: PathBuf },
}

/// A folder that is locked until this is dropped.
#[derive(Debug)]
pub(super) struct Claim {
    _marker: File,
}

impl Claim {
    /// Creates the folder if necessary. Removes incomplete files of a killed process.
    pub(super) fn of(folder: &Path, identity: &str) -> Result<Self, FolderError> {
        let failed = |source| FolderError::Io { path: folder.to_owned(), source };
        fs::create_dir_all(folder).map_err(failed)?;
        let path = folder.join(MARKER);
        // It may exist already.
        let _ = File::create_new(&path);
        let mut marker = files::open_to_change(&path).map_err(failed)?;
        // If the file system has no locks, other processes are not excluded.
        if matches!(marker.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(FolderError::Busy { path: folder.to_owned() });
        }
        let mut written = String::new();
        let read = (&marker).take(MAX_MARKER_BYTES).read_to_string(&mut written);
        read.map_err(failed)?;
        if written.is_empty() {
            // The marker is written before any chunk, so these files are not of a batch.
            if has_others(folder).map_err(failed)? {
                let _ = fs::remove_file(&path);
                return Err(FolderError::Foreign { path: folder.to_owned() });
            }
            marker.write_all(identity.as_bytes()).and_then(|()| marker.sync_all()).map_err(failed)?;
        } else if written != identity {
            return Err(FolderError::Other { path: folder.to_owned() });
        }
        remove_leftovers(folder).map_err(failed)?;
        Ok(Self { _marker: marker })
    }
}

fn has_others(folder: &Path) -> io::Result<bool> {
    let mut names = files::entries(folder)?.flatten().map(|entry| entry.file_name());
    Ok(names.any(|name| name != MARKER))
}

/// Removes the temporary files of chunks and manifests.
fn remove_leftovers(folder: &Path) -> io::Result<()> {
    for entry in files::entries(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let is_ours = name.starts_with("chunk-") || name.starts_with(super::MANIFEST);
        if is_ours && name.ends_with(TEMPORARY) {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}
