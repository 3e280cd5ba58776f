//! In-memory files for WebAssembly, which has no file system. The host provides them, and keeps what changes.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

static ALL: Mutex<BTreeMap<PathBuf, Arc<[u8]>>> = Mutex::new(BTreeMap::new());

fn all() -> MutexGuard<'static, BTreeMap<PathBuf, Arc<[u8]>>> {
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Adds a file, or replaces the one of that name.
pub fn put(path: &Path, bytes: &[u8]) {
    all().insert(plain(path), bytes.into());
}

/// Paths of files that were written or removed since the host asked.
static CHANGED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn changed() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    CHANGED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file that was written since the last call, or removed (`None`).
pub fn next_change() -> Option<(PathBuf, Option<Arc<[u8]>>)> {
    let path = changed().pop_first()?;
    let bytes = all().get(&path).cloned();
    Some((path, bytes))
}

/// Writes a file.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    put(path, bytes);
    changed().insert(plain(path));
    Ok(())
}

/// Cuts a file to its first `length` bytes and adds `bytes`. A missing file is made.
pub fn append_at(path: &Path, length: u64, bytes: &[u8]) -> io::Result<()> {
    let mut whole = all().get(&plain(path)).map_or_else(Vec::new, |known| known.to_vec());
    whole.resize(length as usize, 0);
    whole.extend_from_slice(bytes);
    write_atomically(path, &whole)
}

/// Removes a file, or a folder with all that is in it; a missing one is no error.
pub fn remove(path: &Path) -> io::Result<()> {
    let inside = plain(path);
    let (mut all, mut changed) = (all(), changed());
    changed.extend(all.keys().filter(|known| known.starts_with(&inside)).cloned());
    all.retain(|known, _| !known.starts_with(&inside));
    Ok(())
}

/// Does nothing: a folder is there with its first file.
pub fn create_folder(_: &Path) -> io::Result<()> {
    Ok(())
}

/// Checks that there is no such folder.
pub fn create_new_folder(path: &Path) -> io::Result<()> {
    if is_folder(path) { Err(io::ErrorKind::AlreadyExists.into()) } else { Ok(()) }
}

/// A lock against nobody: the host opens these files once.
pub type Lock = ();

/// Locks nothing.
pub fn lock(_: &Path, _: bool) -> io::Result<Lock> {
    Ok(())
}

/// A path without `.` and `..`, from the root.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::Normal(name) => plain.push(name),
            Component::ParentDir => {
                plain.pop();
            }
            _ => {}
        }
    }
    plain
}

/// An open file.
#[derive(Debug)]
pub struct File {
    bytes: Arc<[u8]>,
    at: AtomicU64,
}

impl File {
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let bytes = all().get(&plain(path)).map(Arc::clone);
        let none = || io::Error::new(io::ErrorKind::NotFound, "no such file is part of this page");
        let bytes = bytes.ok_or_else(none)?;
        let at = AtomicU64::new(0);
        Ok(Self { bytes, at })
    }

    pub(super) fn length(&self) -> io::Result<u64> {
        Ok(self.bytes.len() as u64)
    }
}

impl Read for &File {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let at = usize::try_from(self.at.load(Relaxed)).unwrap_or(usize::MAX);
        let mut left = self.bytes.get(at..).unwrap_or_default();
        let read = left.read(into)?;
        self.at.fetch_add(read as u64, Relaxed);
        Ok(read)
    }
}

impl Read for File {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        (&*self).read(into)
    }
}

impl Seek for &File {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let (from, by) = match to {
            SeekFrom::Start(at) => (at, 0),
            SeekFrom::End(by) => (self.bytes.len() as u64, by),
            SeekFrom::Current(by) => (self.at.load(Relaxed), by),
        };
        let at = from.checked_add_signed(by).ok_or(io::ErrorKind::InvalidInput)?;
        self.at.store(at, Relaxed);
        Ok(at)
    }
}

pub(super) fn is_file(path: &Path) -> bool {
    all().contains_key(&plain(path))
}

pub(super) fn is_folder(path: &Path) -> bool {
    let folder = plain(path);
    all().keys().any(|known| known.starts_with(&folder))
}

pub(super) fn list(folder: &Path) -> Vec<PathBuf> {
    let inside = plain(folder);
    let all = all();
    let names = all.keys().filter(|known| known.parent() == Some(&inside));
    names.filter_map(|known| Some(folder.join(known.file_name()?))).collect()
}

pub(super) fn folders(folder: &Path) -> Vec<PathBuf> {
    let inside = plain(folder);
    let all = all();
    let below = all.keys().filter_map(|known| known.strip_prefix(&inside).ok());
    let names: BTreeSet<_> = below.filter_map(|rest| rest.parent()?.components().next()).collect();
    names.into_iter().map(|name| folder.join(name)).collect()
}
