//! Move of a complete run to its place. Unchanged files of an earlier run are removed, all other files are
//! kept; if a step fails, all earlier steps are undone.
//!
//! A kill in between leaves files in two places. A plan of the move is stored in the folder until the move is
//! complete, so that the next run or `haptograph recover` completes it: see [`MovePlan`].

use super::super::Failure;
use super::super::output::{self, Force};
use super::super::written::{FileManifest, free_beside};
use super::folder::{MANIFEST, MARK, MARKER, PROBES, REPLACED};
use crate::signal::files;
use crate::signal::files::{is_temporary, write_atomically};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The files that were kept when a run was moved to its place.
#[derive(Debug, Default, PartialEq)]
pub struct Placed {
    /// New path of an earlier run that cannot be repeated.
    pub earlier: Option<PathBuf>,
    /// Foreign or changed files that stayed where they were.
    pub left: Vec<PathBuf>,
    /// Foreign or changed files in the way of a new one: their former and new paths.
    pub moved: Vec<(PathBuf, PathBuf)>,
}

/// Maximum number of files named in one line.
const MAX_NAMED: usize = 5;

impl Placed {
    /// A line for each kept item.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if let Some(earlier) = &self.earlier {
            lines.push(format!("the earlier live run is kept as {}", earlier.display()));
        }
        for (from, to) in &self.moved {
            let (from, to) = (from.display(), to.display());
            lines.push(format!("{from} was changed since a run wrote it; it is kept as {to}"));
        }
        if !self.left.is_empty() {
            let named = self.left.iter().take(MAX_NAMED);
            let named: Vec<String> = named.map(|path| path.display().to_string()).collect();
            let more = self.left.len() - named.len();
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            lines.push(format!("kept files that are not part of this run: {}{more}", named.join(", ")));
        }
        lines
    }
}

/// Refuses a place that is not a folder, or a folder with files but without a run's manifest.
pub fn refuse_foreign(target: &Path, place: &Path) -> Result<(), Failure> {
    let shown = target.display();
    let is_empty = match files::entries(place) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => true,
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
            return Err(Failure::Message(format!("{shown} is not a folder; give another one by --out")));
        }
        Err(error) => return Err(Failure::file("read the folder", target, &error)),
        Ok(mut entries) => entries.all(|entry| entry.is_ok_and(|entry| entry.path().join(MARKER).exists())),
    };
    if is_empty || FileManifest::read(&place.join(MANIFEST)).is_some() {
        return Ok(());
    }
    Err(Failure::Message(format!(
        "{shown} holds files but no {MANIFEST} of a run; give another folder by --out (runs of earlier versions \
         have none: rename their folders)"
    )))
}

/// File with the plan of a move, present from before the first move until after the last.
pub const MOVES: &str = ".haptograph-moves";

/// Decisions that cannot be reconstructed after the first move. JSON.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct MovePlan {
    /// True if the temporary folder is inside the place and not beside it.
    inside: bool,
    /// New name, beside the place, of an earlier run that cannot be repeated.
    earlier: Option<String>,
    /// Absolute paths of the probes' files, by number.
    probes: Vec<String>,
}

impl MovePlan {
    /// Plans the move of a run from `content` to `place`.
    pub fn of(content: &Path, place: &Path) -> Self {
        let earlier = holds_what_cannot_be_repeated(place).then(|| free_beside(place));
        let name = |path: PathBuf| Some(path.file_name()?.to_string_lossy().into_owned());
        Self { inside: content.parent() == Some(place), earlier: earlier.and_then(name), probes: Vec::new() }
    }

    /// Writes the plan, after which an interrupted move can be completed. Paths that are not Unicode cannot
    /// be stored: then nothing is written, and a killed move stays incomplete.
    pub fn save(mut self, content: &Path, probes: &[PathBuf]) -> io::Result<()> {
        for probe in probes {
            let Some(path) = std::path::absolute(probe)?.to_str().map(str::to_owned) else {
                return Ok(());
            };
            self.probes.push(path);
        }
        let text = serde_json::to_string_pretty(&self)? + "\n";
        write_atomically(&content.join(MOVES), text.as_bytes())
    }

    /// Reads the plan of an interrupted move.
    pub fn read(content: &Path) -> Option<Self> {
        let text = files::read_text(&content.join(MOVES), files::MAX_REPORT_BYTES).ok()?;
        serde_json::from_str(&text).ok()
    }

    /// Target of the move of `content`; `None` if its name does not state it.
    pub fn place(&self, content: &Path) -> Option<PathBuf> {
        let near = content.parent()?;
        let name = content.file_name()?.to_str()?;
        let (name, _) = name.rsplit_once(super::folder::PARTIAL)?;
        Some(if self.inside { near.to_owned() } else { near.join(name) })
    }
}

/// Completes an interrupted move. A plan can be forged, so only files written by haptograph are replaced.
pub fn resume(content: &Path, place: &Path, plan: &MovePlan) -> Result<(), Failure> {
    for (number, probe) in plan.probes.iter().enumerate() {
        let waiting = content.join(PROBES).join(number.to_string());
        let probe = Path::new(probe);
        let is_signal = probe.extension().is_some_and(|ending| ending == "wav" || ending == "csv");
        let names = [probe.to_owned(), super::outputs::note_of(probe)];
        for target in names.iter().filter(|_| is_signal) {
            let from = waiting.join(target.file_name().unwrap_or_default());
            if from.is_file() {
                output::place(&from, target, Force::default())?;
            }
        }
    }
    let failed = |error| Failure::file("complete the move of", content, &error);
    // The facts are moved last but one, the manifest last.
    if [MARK, MANIFEST].iter().any(|name| content.join(name).is_file()) {
        self::place(content, place, plan).map_err(failed)?;
    }
    remove(content);
    Ok(())
}

/// Moves all files of `content` to `place` and removes `content`.
pub fn place(content: &Path, place: &Path, plan: &MovePlan) -> io::Result<Placed> {
    let new = files_in(content, &[MARKER, PROBES, REPLACED, MOVES, MANIFEST])?;
    let new_manifest = content.join(MANIFEST);
    // The manifest of an interrupted move also lists the files already moved.
    if FileManifest::read(&new_manifest).is_none() {
        let mut manifest = FileManifest::default();
        new.iter().try_for_each(|name| manifest.note(content, name))?;
        manifest.save(&new_manifest)?;
    }
    let mut moves = Moves::default();
    let placed = clear((content, place), &new, plan, &mut moves).and_then(|placed| {
        // The facts last but one, so that a folder with new facts is complete.
        let (facts, files): (Vec<_>, Vec<_>) = new.iter().partition(|name| *name == Path::new(MARK));
        let last = PathBuf::from(MANIFEST);
        for name in files.into_iter().chain(facts).chain([&last]) {
            moves.of(&content.join(name), &place.join(name))?;
        }
        Ok(placed)
    });
    let placed = placed.inspect_err(|_| moves.take_back())?;
    remove_empty(place, &moves.left);
    remove(content);
    Ok(placed)
}

/// Removes the temporary folder of a moved run; the marker that identifies it goes last.
fn remove(content: &Path) {
    step();
    // The next run reports a folder that cannot be removed.
    for name in [REPLACED, PROBES] {
        let _ = fs::remove_dir_all(content.join(name));
    }
    step();
    let _ = fs::remove_dir_all(content);
}

/// Clears `place`: moves away the files of an earlier run, and anything in the way.
fn clear(
    (content, place): (&Path, &Path),
    new: &[PathBuf],
    plan: &MovePlan,
    moves: &mut Moves,
) -> io::Result<Placed> {
    let mut placed = Placed::default();
    let list = place.join(MANIFEST);
    let old = FileManifest::read(&list).unwrap_or_default();
    let mut names: Vec<PathBuf> = old.names().filter(|name| place.join(name).is_file()).collect();
    // Only a file name, since a plan can be forged.
    let kept = plan.earlier.as_ref().and_then(|name| Path::new(name).file_name());
    let kept = kept.map(|name| place.with_file_name(name));
    // A kept earlier run keeps all files that it has now.
    let is_kept = kept.is_some();
    names.retain(|name| is_kept || old.is_unchanged(place, name));
    let aside = kept.clone().unwrap_or_else(|| content.join(REPLACED));
    for name in names.iter().map(PathBuf::as_path).chain([Path::new(MANIFEST)]) {
        if fs::symlink_metadata(place.join(name)).is_ok() {
            moves.of(&place.join(name), &aside.join(name))?;
        }
    }
    placed.earlier = kept;
    for name in new {
        if let Some(taken) = in_the_way(place, name) {
            let free = free_beside(&taken);
            moves.of(&taken, &free)?;
            placed.moved.push((taken, free));
        }
    }
    placed.left = left(place, &names, new, &placed.moved);
    Ok(placed)
}

/// The existing entry at the path of a new file or of one of its folders.
fn in_the_way(place: &Path, name: &Path) -> Option<PathBuf> {
    let mut path = place.to_owned();
    let mut parts = name.components().peekable();
    while let Some(part) = parts.next() {
        path.push(part);
        let found = fs::symlink_metadata(&path).ok()?;
        // Links are not followed: their targets are not the run's.
        if parts.peek().is_none() || !found.is_dir() {
            return Some(path);
        }
    }
    None
}

/// Foreign files in the folders of the runs.
fn left(place: &Path, old: &[PathBuf], new: &[PathBuf], moved: &[(PathBuf, PathBuf)]) -> Vec<PathBuf> {
    let folders: BTreeSet<&Path> = old.iter().chain(new).filter_map(|name| name.parent()).collect();
    let mut found = Vec::new();
    for folder in &folders {
        let entries = files::entries(&place.join(folder)).into_iter().flatten().flatten();
        for path in entries.map(|entry| entry.path()) {
            let is_runs = path.join(MARKER).exists() || moved.iter().any(|(_, to)| *to == path);
            let name = path.strip_prefix(place).unwrap_or(&path);
            let leads_to_runs = folders.iter().any(|folder| folder.starts_with(name));
            if !is_runs && !leads_to_runs {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// All files below a folder, as relative paths, without some of its entries and what an interrupted write left.
fn files_in(folder: &Path, but: &[&str]) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in files::entries(&next)? {
            let entry = entry?;
            let path = entry.path();
            let name = path.strip_prefix(folder).unwrap_or(&path);
            if but.iter().any(|but| name == Path::new(but)) || is_temporary(name) {
                continue;
            }
            if entry.file_type()?.is_dir() {
                folders.push(path);
            } else {
                found.push(name.to_owned());
            }
        }
    }
    found.sort();
    Ok(found)
}

/// Removes emptied source folders.
fn remove_empty(place: &Path, left: &BTreeSet<PathBuf>) {
    for folder in left.iter().rev() {
        let mut folder = folder.as_path();
        // `remove_dir` keeps a folder that is not empty.
        while folder != place && folder.starts_with(place) && fs::remove_dir(folder).is_ok() {
            let Some(parent) = folder.parent() else { break };
            folder = parent;
        }
    }
}

/// The moves done so far, which can be undone.
#[derive(Debug, Default)]
struct Moves {
    done: Vec<(PathBuf, PathBuf)>,
    /// Folders that files were moved out of.
    left: BTreeSet<PathBuf>,
}

impl Moves {
    /// Moves a file to a free path and creates the folders for it.
    fn of(&mut self, from: &Path, to: &Path) -> io::Result<()> {
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder)?;
        }
        if fs::symlink_metadata(to).is_ok() {
            let message = format!("{} was created during the move", to.display());
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, message));
        }
        step();
        fs::rename(from, to)?;
        self.left.extend(from.parent().map(Path::to_owned));
        self.done.push((from.to_owned(), to.to_owned()));
        Ok(())
    }

    fn take_back(&self) {
        for (from, to) in self.done.iter().rev() {
            // Report the first error only; a file that cannot be moved back stays at its new path.
            let _ = fs::rename(to, from);
        }
    }
}

/// Hook for tests that interrupt a move.
#[cfg(not(test))]
fn step() {}

#[cfg(test)]
std::thread_local! {
    /// Steps until the simulated kill, in this thread.
    pub static STEPS_LEFT: std::cell::Cell<Option<u32>> = const { std::cell::Cell::new(None) };
}

#[cfg(test)]
fn step() {
    match STEPS_LEFT.get() {
        Some(0) => panic!("killed on purpose"),
        left => STEPS_LEFT.set(left.map(|left| left - 1)),
    }
}

/// True if the folder holds a live run of real devices, which may be an hour of someone's work.
fn holds_what_cannot_be_repeated(place: &Path) -> bool {
    let facts = files::read_text(&place.join(MARK), files::MAX_REPORT_BYTES).ok();
    let facts = facts.and_then(|text| serde_json::from_str::<serde_json::Value>(&text).ok());
    match facts {
        Some(facts) => facts["live"] == true && facts["real_devices"] == true,
        // A damaged run could be one of these.
        None => place.join(MANIFEST).exists() || place.join(MARK).exists(),
    }
}
