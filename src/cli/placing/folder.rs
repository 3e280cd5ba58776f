//! The output folder of a run. It is filled beside its target and moved there when the run is complete. After
//! a failure the recorded data stay in a folder `NAME.partial-1` beside the target; a locked marker
//! distinguishes running runs from crashed ones.

use super::commit::{self, MOVES, MovePlan, Placed, place_probe};
use super::file::Force;
use crate::cli::{Failure, eprint, make_folder};
use crate::signal::files;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::fmt::Display;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The facts of a run, in its folder.
pub(crate) const MARK: &str = "run.json";
/// Marks the folder of a run that is not in its place. JSON with `target`, `pid` and `haptograph`; locked
/// during the run.
pub(crate) const MARKER: &str = ".haptograph-partial";
/// Infix of the names of such folders: `identify.partial-1`.
pub(super) const PARTIAL: &str = ".partial-";
/// Subfolder for the files of probes, one folder each, until they are moved.
pub(crate) const PROBES: &str = ".probes";
/// Subfolder for the files of the run that is replaced, during the move.
pub(crate) const REPLACED: &str = ".replaced";

/// A folder that is being filled.
#[derive(Debug)]
pub(crate) struct RunFolder {
    content: PathBuf,
    /// As given by the user.
    target: PathBuf,
    /// The same with links resolved, so that a link stays a link.
    place: PathBuf,
    /// Holds the marker's lock.
    _marker: File,
    has_begun: bool,
}

impl RunFolder {
    /// Creates an empty folder for a run at `target`, which must be free, empty or the folder of an earlier
    /// run.
    pub(crate) fn beside(target: &Path) -> Result<Self, Failure> {
        let place = resolved(target)?;
        complete_moves(&place)?;
        commit::refuse_foreign(target, &place)?;
        let folder = Self::make(target, place)?;
        for leftover in leftovers_of(&folder.place) {
            if leftover == folder.content {
                continue;
            }
            if is_alive(&leftover) {
                let (target, other) = (target.display(), leftover.display());
                let message = format!(
                    "another run is writing to {target} now, in {other}; give another folder by --out"
                );
                return Err(Failure::Message(message));
            }
            eprint(&format!("note: {}\n", about(&leftover)));
        }
        Ok(folder)
    }

    fn make(target: &Path, place: PathBuf) -> Result<Self, Failure> {
        let failed = |error| Failure::file("make a folder beside", target, &error);
        let mut made = Err(io::ErrorKind::NotFound.into());
        for near in homes(&place) {
            fs::create_dir_all(&near).map_err(failed)?;
            made = made_in(&near, &place);
            if made.is_ok() {
                break;
            }
        }
        let content = made.map_err(failed)?;
        let marker = mark(&content, &place).map_err(failed)?;
        Ok(Self { content, target: target.to_owned(), place, _marker: marker, has_begun: false })
    }

    /// The folder to write files into.
    pub(crate) fn path(&self) -> &Path {
        &self.content
    }

    /// From here on the folder holds data and is kept whatever happens.
    pub(crate) fn begin(&mut self) {
        self.has_begun = true;
    }

    /// Creates the folder of a probe, whose files stay there until the run is complete.
    pub(crate) fn probe(&self, number: usize) -> Result<PathBuf, Failure> {
        let path = self.content.join(PROBES).join(number.to_string());
        make_folder(&path)?;
        Ok(path)
    }

    /// Adds a whole file or none.
    pub(crate) fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        let path = self.content.join(name);
        files::write_atomically(&path, text.as_bytes()).map_err(Failure::doing("write", &path))
    }

    /// Moves the files to their place, and those of probes to theirs: all or none of the run's. Unchanged files of an
    /// earlier run are replaced; all other files are kept. Also returns the probes that are at the requested paths.
    pub(crate) fn commit(
        mut self,
        probes: &[PathBuf],
        force: Force,
    ) -> Result<(Placed, Vec<PathBuf>), Failure> {
        self.has_begun = true;
        let done = self.try_to_commit(probes, force).inspect_err(|_| {
            // If the plan remains, the next run completes the move.
            let _ = fs::remove_file(self.content.join(MOVES));
        })?;
        // The folder holds nothing any more that must be kept.
        self.has_begun = false;
        Ok(done)
    }

    fn try_to_commit(&self, probes: &[PathBuf], force: Force) -> Result<(Placed, Vec<PathBuf>), Failure> {
        let plan = MovePlan::begin(&self.content, &self.place, probes)
            .map_err(Failure::doing("write", &self.content.join(MOVES)))?;
        let mut there = Vec::new();
        for (number, probe) in probes.iter().enumerate() {
            if place_probe(&self.content, number, probe, force)? {
                there.push(probe.clone());
            }
        }
        commit::refuse_foreign(&self.target, &self.place)?;
        let placed = commit::place(&self.content, &self.place, &plan)
            .map_err(Failure::doing("put the run in place at", &self.target))?;
        Ok((placed, there))
    }
}

/// Completes interrupted moves to `place`.
fn complete_moves(place: &Path) -> Result<(), Failure> {
    for leftover in leftovers_of(place) {
        let plan = MovePlan::read(&leftover);
        let Some(plan) = plan.filter(|plan| plan.place(&leftover).as_deref() == Some(place)) else {
            continue;
        };
        let lock = lock(&leftover.join(MARKER));
        if matches!(lock, Err(TryLockError::WouldBlock)) {
            continue;
        }
        commit::resume(&leftover, place, &plan)?;
        let (leftover, place) = (leftover.display(), place.display());
        eprint(&format!("note: completed the interrupted move of the run in {leftover} to {place}\n"));
    }
    Ok(())
}

/// Completes the interrupted move of a complete run and returns its place; `None` if the folder has no plan of a move.
pub(crate) fn complete_move(content: &Path) -> Option<Result<PathBuf, Failure>> {
    let plan = MovePlan::read(content)?;
    let complete = || {
        let failed = |error: &dyn Display| Failure::file("complete the move of", content, error);
        let content = content.canonicalize().map_err(|error| failed(&error))?;
        let place = plan.place(&content);
        let place = place.ok_or_else(|| failed(&"its name does not state the target of the move"))?;
        commit::resume(&content, &place, &plan).map(|()| place)
    };
    Some(complete())
}

/// Renames the folder of a crashed run to `NAME-recovered`, or to the first free name with a number.
pub(crate) fn rename_recovered(leftover: &Path) -> Result<PathBuf, Failure> {
    let failed = |error: &dyn Display| Failure::file("rename", leftover, error);
    let name = leftover.file_name().unwrap_or_default().to_string_lossy();
    let name = name.split(PARTIAL).next().unwrap_or("run");
    let numbers = std::iter::once(String::new()).chain((2..10_000).map(|number| format!("-{number}")));
    let mut names = numbers.map(|number| leftover.with_file_name(format!("{name}-recovered{number}")));
    let target = names.find(|path| fs::symlink_metadata(path).is_err());
    let target = target.ok_or_else(|| failed(&"every name is taken"))?;
    fs::rename(leftover, &target).map_err(|error| failed(&error))?;
    // A visible name for the probes; on failure they keep their hidden name.
    if fs::symlink_metadata(target.join("probes")).is_err() {
        let _ = fs::rename(target.join(PROBES), target.join("probes"));
    }
    // The folder is no leftover any more; if this fails, only its marker remains.
    let _ = fs::remove_file(target.join(MARKER));
    Ok(target)
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        if self.has_begun {
            let (content, target) = (self.content.display(), self.target.display());
            eprint(&format!("note: the run was not moved to {target}; its data are in {content}\n"));
        } else {
            // Nothing was recorded. The next run reports a folder that cannot be removed.
            let _ = fs::remove_dir_all(&self.content);
        }
    }
}

/// The path of a folder with links resolved; it need not exist.
fn resolved(target: &Path) -> Result<PathBuf, Failure> {
    if let Ok(place) = target.canonicalize() {
        return Ok(place);
    }
    if fs::symlink_metadata(target).is_ok() {
        let message = "it is a broken link; create its target folder, or give another folder by --out";
        return Err(Failure::file("write into", target, &message));
    }
    let named = std::path::absolute(target).map_err(Failure::doing("write into", target))?;
    if named.file_name().is_none() {
        let message = "it does not name a folder; give another one by --out";
        return Err(Failure::file("write into", target, &message));
    }
    Ok(named)
}

/// Parents for the temporary folder from which files can be moved instead of copied: beside the place, or
/// inside it if the parent is on another file system or not writable.
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

/// Prefix of the names of temporary folders for `place`.
fn prefix(place: &Path) -> OsString {
    let mut name = place.file_name().unwrap_or("run".as_ref()).to_owned();
    name.push(PARTIAL);
    name
}

/// Creates the first such folder with a free name.
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
    // Without file locks no leftover counts as running; nothing is removed on account of that.
    let _ = marker.try_lock();
    let facts = json!({
        "target": place.to_string_lossy(), "pid": std::process::id(), "haptograph": env!("CARGO_PKG_VERSION"),
    });
    writeln!(marker, "{facts:#}")?;
    Ok(marker)
}

/// Locks the marker of a folder, unless a running process holds the lock.
pub(crate) fn lock(marker: &Path) -> Result<files::Bounded, TryLockError> {
    let marker = files::open(marker, u64::MAX).map_err(TryLockError::Error)?;
    marker.as_file().try_lock().map(|()| marker)
}

/// True if the run of such a folder is still going on.
fn is_alive(leftover: &Path) -> bool {
    matches!(lock(&leftover.join(MARKER)), Err(TryLockError::WouldBlock))
}

/// All temporary folders for `place`, of crashed and running runs.
fn leftovers_of(place: &Path) -> Vec<PathBuf> {
    let prefix = prefix(place);
    let is_its = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default();
        name.as_encoded_bytes().starts_with(prefix.as_encoded_bytes())
    };
    let near = place.parent().into_iter().chain([place]);
    near.flat_map(leftovers_in).filter(is_its).collect()
}

/// All temporary folders of runs in `folder`.
fn leftovers_in(folder: &Path) -> Vec<PathBuf> {
    let entries = files::entries(folder).into_iter().flatten().flatten();
    let paths = entries.map(|entry| entry.path());
    let mut found: Vec<PathBuf> = paths.filter(|path| path.join(MARKER).is_file()).collect();
    found.sort();
    found
}

/// The folders of crashed runs in `folder`.
pub(crate) fn dead_in(folder: &Path) -> Vec<PathBuf> {
    let mut found = leftovers_in(folder);
    found.retain(|path| !is_alive(path));
    found
}

/// Message about the folder of a crashed run.
fn about(leftover: &Path) -> String {
    let facts = files::read_text(&leftover.join(MARKER), files::MAX_REPORT_BYTES).unwrap_or_default();
    let facts: Value = serde_json::from_str(&facts).unwrap_or_default();
    let process = facts["pid"].as_u64();
    let process = process.map_or_else(String::new, |id| format!(" (process {id})"));
    let leftover = leftover.display();
    format!(
        "{leftover} holds the data of a crashed run{process}; `haptograph recover {leftover}` repairs its files"
    )
}
