//! The folder of a run: filled beside its target and put in its place when the run is complete. Whatever fails, what was
//! recorded stays: in a folder `NAME.partial-1` beside the target, with a marker that tells dead runs from running ones.

use super::super::{Failure, remark};
use super::placing::{self, MOVES, MovePlan, Placed};
use crate::signal::files;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The facts of a run, in its folder.
pub const MARK: &str = "run.json";
/// The longest file of facts that is read, bytes.
pub const MAX_FACTS_BYTES: u64 = 64 << 20;
/// The list of a run's files and their hashes, in its folder: see [`Written`](super::super::written::Written).
pub const MANIFEST: &str = "manifest.json";
/// Marks the folder of a run that is not in its place. JSON with `target`, `pid` and `haptograph`; locked while the run lives.
pub const MARKER: &str = ".haptograph-partial";
/// Stands between the target's name and a number in the name of such a folder: `identify.partial-1`.
pub const PARTIAL: &str = ".partial-";
/// Where probes wait in such a folder, one folder each.
pub const PROBES: &str = ".probes";
/// Where an earlier run's files wait in such a folder while it is put in its place.
pub const REPLACED: &str = ".replaced";

/// A folder that is being filled.
#[derive(Debug)]
pub struct RunFolder {
    content: PathBuf,
    /// As it was given.
    target: PathBuf,
    /// The same without links: a link stays one.
    place: PathBuf,
    /// Holds the marker's lock.
    _marker: File,
    has_begun: bool,
}

impl RunFolder {
    /// An empty folder for a run that is to be put at `target`, which must be free, empty or left by an earlier run.
    pub fn beside(target: &Path) -> Result<Self, Failure> {
        let place = resolved(target)?;
        complete_moves(&place)?;
        placing::refuse_foreign(target, &place)?;
        let folder = Self::make(target, place)?;
        for leftover in leftovers_of(&folder.place) {
            if leftover == folder.content {
                continue;
            }
            if is_alive(&leftover) {
                let (target, other) = (target.display(), leftover.display());
                let message = format!(
                    "another run is being written for {target} now, in {other}; give another folder by --out"
                );
                return Err(Failure::Message(message));
            }
            remark(&format!("note: {}\n", about(&leftover)));
        }
        Ok(folder)
    }

    fn make(target: &Path, place: PathBuf) -> Result<Self, Failure> {
        let failed = |error: &dyn std::fmt::Display| Failure::file("make a folder beside", target, error);
        let mut made = None;
        for near in homes(&place) {
            fs::create_dir_all(&near).map_err(|error| failed(&error))?;
            made = Some(made_in(&near, &place));
            if made.as_ref().is_some_and(Result::is_ok) {
                break;
            }
        }
        let content = made
            .unwrap_or_else(|| Err(io::ErrorKind::NotFound.into()))
            .map_err(|error| failed(&error))?;
        let marker = mark(&content, &place).map_err(|error| failed(&error))?;
        Ok(Self {
            content,
            target: target.to_owned(),
            place,
            _marker: marker,
            has_begun: false,
        })
    }

    /// Where the run's files go.
    pub fn path(&self) -> &Path {
        &self.content
    }

    /// From here on something is recorded: it is kept whatever happens.
    pub fn begin(&mut self) {
        self.has_begun = true;
    }

    /// Where probes wait until the run is complete; one folder each.
    pub fn probe(&self, number: usize) -> Result<PathBuf, Failure> {
        let path = self.content.join(PROBES).join(number.to_string());
        fs::create_dir_all(&path).map_err(|error| Failure::file("make the folder", &path, &error))?;
        Ok(path)
    }

    /// Adds a file.
    pub fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        let path = self.content.join(name);
        fs::write(&path, text).map_err(|error| Failure::file("write", &path, &error))
    }

    /// The run is complete: from here on what a kill interrupts is completed by the next run.
    pub fn seal(&self, probes: &[PathBuf]) -> Result<(), Failure> {
        let plan = MovePlan::of(&self.content, &self.place);
        let saved = plan.save(&self.content, probes);
        saved.map_err(|error| Failure::file("write", &self.content.join(MOVES), &error))
    }

    /// It is not moved after all.
    pub fn unseal(&self) {
        // Where it stays, the next run tries again.
        let _ = fs::remove_file(self.content.join(MOVES));
    }

    /// Puts the files in their place. What an earlier run wrote there and nobody changed is replaced, all else is kept.
    pub fn put_in_place(mut self) -> Result<Placed, Failure> {
        self.has_begun = true;
        let placed = self.try_to_place().inspect_err(|_| self.unseal())?;
        // It holds nothing any more that is not in its place.
        self.has_begun = false;
        Ok(placed)
    }

    fn try_to_place(&self) -> Result<Placed, Failure> {
        placing::refuse_foreign(&self.target, &self.place)?;
        let plan = MovePlan::read(&self.content);
        let plan = plan.unwrap_or_else(|| MovePlan::of(&self.content, &self.place));
        placing::place(&self.content, &self.place, &plan)
            .map_err(|error| Failure::file("put the run in place at", &self.target, &error))
    }
}

/// Goes on with the moves to `place` that were interrupted.
fn complete_moves(place: &Path) -> Result<(), Failure> {
    for leftover in leftovers_of(place) {
        if let Some(plan) = MovePlan::read(&leftover)
            && plan.place(&leftover).as_deref() == Some(place)
            && let Some(_lock) = lock_dead(&leftover)
        {
            placing::resume(&leftover, place, &plan)?;
            let (leftover, place) = (leftover.display(), place.display());
            remark(&format!(
                "note: the run in {leftover} was complete, and its move to {place} was interrupted; it is there now\n"
            ));
        }
    }
    Ok(())
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        if self.has_begun {
            let (content, target) = (self.content.display(), self.target.display());
            remark(&format!(
                "note: the run is not at {target}; what it recorded stays in {content}\n"
            ));
        } else {
            // Nothing was recorded; what cannot be removed is named by the next run.
            let _ = fs::remove_dir_all(&self.content);
        }
    }
}

/// The folder that a path means, without links; it need not exist.
fn resolved(target: &Path) -> Result<PathBuf, Failure> {
    if let Ok(place) = target.canonicalize() {
        return Ok(place);
    }
    if fs::symlink_metadata(target).is_ok() {
        let message =
            "it is a link that leads nowhere; make the folder it leads to, or give another one by --out";
        return Err(Failure::file("write into", target, &message));
    }
    let named = std::path::absolute(target).map_err(|error| Failure::file("write into", target, &error))?;
    if named.file_name().is_none() {
        let message = "it names no folder; give another one by --out";
        return Err(Failure::file("write into", target, &message));
    }
    Ok(named)
}

/// Where the folder can wait so that its files are moved and not copied: beside the place, or in it where that lies on another
/// file system or nothing may be written beside it.
fn homes(place: &Path) -> Vec<PathBuf> {
    let parent = place.parent();
    let inside = place.is_dir().then(|| place.to_owned());
    let near = parent.filter(|parent| inside.is_none() || are_on_one_file_system(parent, place));
    near.map(Path::to_owned).into_iter().chain(inside).collect()
}

#[cfg(unix)]
fn are_on_one_file_system(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let device = |path: &Path| fs::metadata(path).map(|found| found.dev());
    matches!((device(a), device(b)), (Ok(a), Ok(b)) if a == b)
}

#[cfg(not(unix))]
fn are_on_one_file_system(_: &Path, _: &Path) -> bool {
    true
}

/// The beginning of the names of folders that wait for `place`.
fn prefix(place: &Path) -> OsString {
    let mut name = place.file_name().unwrap_or("run".as_ref()).to_owned();
    name.push(PARTIAL);
    name
}

/// The first such folder that is free.
fn made_in(near: &Path, place: &Path) -> io::Result<PathBuf> {
    let mut number = 0_u64;
    loop {
        number += 1;
        let mut name = prefix(place);
        name.push(number.to_string());
        let path = near.join(name);
        match fs::create_dir(&path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            made => return made.map(|()| path),
        }
    }
}

fn mark(content: &Path, place: &Path) -> io::Result<File> {
    let mut marker = File::create_new(content.join(MARKER))?;
    // Where files cannot be locked, a leftover is never taken for a running one; nothing is ever removed for that.
    let _ = marker.try_lock();
    let facts = json!({
        "target": place.to_string_lossy(),
        "pid": std::process::id(),
        "haptograph": env!("CARGO_PKG_VERSION"),
    });
    writeln!(marker, "{facts:#}")?;
    Ok(marker)
}

/// Is the run of such a folder still going on?
fn is_alive(leftover: &Path) -> bool {
    let marker = files::open(&leftover.join(MARKER), MAX_FACTS_BYTES);
    let locked = marker.map(|marker| marker.as_file().try_lock());
    matches!(locked, Ok(Err(TryLockError::WouldBlock)))
}

/// The lock of a folder whose run is dead.
fn lock_dead(leftover: &Path) -> Option<files::Bounded> {
    let marker = files::open(&leftover.join(MARKER), MAX_FACTS_BYTES).ok()?;
    let is_locked = matches!(marker.as_file().try_lock(), Err(TryLockError::WouldBlock));
    (!is_locked).then_some(marker)
}

/// What runs left that wait for `place`, dead and running.
fn leftovers_of(place: &Path) -> Vec<PathBuf> {
    let prefix = prefix(place);
    let is_its = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default();
        name.as_encoded_bytes().starts_with(prefix.as_encoded_bytes())
    };
    let near = place.parent().into_iter().chain([place]);
    near.flat_map(leftovers_in).filter(is_its).collect()
}

/// All folders of runs that are not in their places.
fn leftovers_in(folder: &Path) -> Vec<PathBuf> {
    let entries = files::entries(folder).into_iter().flatten().flatten();
    let paths = entries.map(|entry| entry.path());
    let mut found: Vec<PathBuf> = paths.filter(|path| path.join(MARKER).is_file()).collect();
    found.sort();
    found
}

/// The folders in `folder` that dead runs left.
pub fn dead_in(folder: &Path) -> Vec<PathBuf> {
    let mut found = leftovers_in(folder);
    found.retain(|path| !is_alive(path));
    found
}

/// What is said of a folder that a dead run left.
fn about(leftover: &Path) -> String {
    let facts = files::read_text(&leftover.join(MARKER), MAX_FACTS_BYTES).unwrap_or_default();
    let facts: Value = serde_json::from_str(&facts).unwrap_or_default();
    let process = facts["pid"].as_u64();
    let process = process.map_or_else(String::new, |id| format!(" (process {id})"));
    let leftover = leftover.display();
    format!(
        "{leftover} is left of a run that did not end{process}; `haptograph recover {leftover}` makes its files whole"
    )
}

#[cfg(test)]
mod tests;
