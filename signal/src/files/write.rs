//! Atomic writing of files.

use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// The ending of temporary files; a killed process leaves one.
pub const TEMPORARY: &str = ".tmp";

/// True for the path of a temporary file: `NAME.PROCESS-NUMBER.tmp`.
pub fn is_temporary(path: &Path) -> bool {
    let name = path.to_string_lossy();
    let numbers = name.strip_suffix(TEMPORARY).and_then(|rest| rest.rsplit_once('.'));
    let numbers = numbers.and_then(|(_, numbers)| numbers.split_once('-'));
    numbers.is_some_and(|(process, number)| [process, number].iter().all(|part| part.parse::<u64>().is_ok()))
}

/// Writes `bytes` to `path` atomically: through a temporary file in the same folder.
///
/// # Errors
/// Those of the file system; the file is then unchanged.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_atomically_by(path, |file| file.write_all(bytes))
}

/// Cuts a file to its first `length` bytes and adds `bytes`: on disk when this returns. A missing file is made.
///
/// # Errors
/// Those of the file system.
pub fn append_at(path: &Path, length: u64, bytes: &[u8]) -> io::Result<()> {
    let mut file = OpenOptions::new().write(true).create(true).truncate(false).open(path)?;
    file.set_len(length)?;
    file.seek(SeekFrom::End(0))?;
    file.write_all(bytes)?;
    file.sync_data()
}

/// Removes a file, or a folder with all that is in it; a missing one is no error.
///
/// # Errors
/// Those of the file system.
pub fn remove(path: &Path) -> io::Result<()> {
    let removed = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
    removed.or_else(|error| if error.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(error) })
}

/// A lock against other processes, for as long as it lives.
pub type Lock = File;

/// Locks by a file, which is made; waits for others, or fails if it is theirs.
///
/// # Errors
/// Those of the file system; [`io::ErrorKind::WouldBlock`] if another process has it.
pub fn lock(path: &Path, waits: bool) -> io::Result<Lock> {
    let file = OpenOptions::new().write(true).create(true).truncate(false).open(path)?;
    if waits {
        file.lock()?
    } else {
        file.try_lock()?
    }
    Ok(file)
}

/// Writes a file atomically, with the content that `fill` writes.
///
/// # Errors
/// As [`write_atomically`], and those of `fill`.
pub fn write_atomically_by<T>(path: &Path, fill: impl FnOnce(&mut File) -> io::Result<T>) -> io::Result<T> {
    static WRITES: AtomicU64 = AtomicU64::new(0);
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the path has no file name"))?;
    let mut temporary = name.to_owned();
    temporary.push(format!(".{}-{}{TEMPORARY}", std::process::id(), WRITES.fetch_add(1, Ordering::Relaxed)));
    let temporary = path.with_file_name(temporary);
    let file = OpenOptions::new().read(true).write(true).create_new(true).open(&temporary);
    let written = file.and_then(|mut file| {
        let filled = fill(&mut file)?;
        file.sync_all()?;
        Ok(filled)
    });
    let moved = written.and_then(|filled| std::fs::rename(&temporary, path).map(|()| filled));
    if moved.is_err() {
        // The first error is the one to report.
        let _ = std::fs::remove_file(&temporary);
    }
    moved
}

/// Copies a file of any length atomically.
///
/// # Errors
/// As [`write_atomically`], and those of [`open`](super::open).
pub fn copy_atomically(from: &Path, to: &Path) -> io::Result<()> {
    let mut source = super::open(from, u64::MAX)?;
    write_atomically_by(to, |target| io::copy(&mut source, target).map(drop))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_old_file_is_replaced_and_nothing_is_left_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("surface.ron");
        write_atomically(&path, b"first").unwrap();
        write_atomically(&path, b"second").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        let nowhere = folder.path().join("missing").join("surface.ron");
        assert!(write_atomically(&nowhere, b"x").is_err());
        assert!(write_atomically(folder.path(), b"x").is_err(), "a folder is not overwritten");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
