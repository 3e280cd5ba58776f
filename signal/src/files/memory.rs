//! In-memory files for WebAssembly, which has no file system. The host provides them.

use std::collections::BTreeMap;
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
