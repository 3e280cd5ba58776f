//! Placing of what a command writes. No file is replaced but by its own successor: one that haptograph wrote and nobody
//! changed since, which a list of hashes shows.
//!
//! A file or a folder is written beside its target and renamed into place. A [`Manifest`] lists what was written: that of
//! a run is part of its folder, that of single files lies beside them, since their folder is the user's. Before a rename
//! the list or the plan of the move announces it, so that a kill at any step loses nothing.

mod commit;
mod file;
mod folder;
mod manifest;

pub(super) use commit::{MOVES, files_in};
pub(super) use file::{Force, Output, replaceable};
pub(super) use folder::{
    MARK, MARKER, PROBES, REPLACED, RunFolder, complete_move, dead_in, lock, rename_recovered,
};
pub(super) use manifest::MANIFEST;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Moves that succeed together: after an error [`undo`](Self::undo) takes them back.
#[derive(Debug, Default)]
struct Transaction {
    done: Vec<(PathBuf, PathBuf)>,
}

impl Transaction {
    /// Moves a file to a free path and creates the folders for it.
    fn rename(&mut self, from: &Path, to: &Path) -> io::Result<()> {
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder)?;
        }
        if fs::symlink_metadata(to).is_ok() {
            let message = format!("{} was created during the move", to.display());
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, message));
        }
        step();
        fs::rename(from, to)?;
        self.done.push((from.to_owned(), to.to_owned()));
        Ok(())
    }

    fn undo(&self) {
        for (from, to) in self.done.iter().rev() {
            // Report the first error only; a file that cannot be moved back stays at its new path.
            let _ = fs::rename(to, from);
        }
    }
}

/// The path itself if it is free, otherwise with the first free number: `x-1.wav`.
fn free_beside(path: &Path) -> PathBuf {
    let mut free = path.to_owned();
    for number in 1_u64.. {
        if fs::symlink_metadata(&free).is_err() {
            break;
        }
        let mut name = path.file_stem().unwrap_or_default().to_owned();
        name.push(format!("-{number}"));
        if let Some(extension) = path.extension() {
            name.push(".");
            name.push(extension);
        }
        free = path.with_file_name(name);
    }
    free
}

/// Hook for tests that interrupt a move.
#[cfg(not(test))]
fn step() {}

#[cfg(test)]
std::thread_local! {
    /// Steps until the simulated kill, in this thread.
    static STEPS_LEFT: std::cell::Cell<Option<u32>> = const { std::cell::Cell::new(None) };
}

#[cfg(test)]
fn step() {
    match STEPS_LEFT.get() {
        Some(0) => panic!("killed on purpose"),
        left => STEPS_LEFT.set(left.map(|left| left - 1)),
    }
}

#[cfg(test)]
mod tests;
