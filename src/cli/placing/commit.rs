//! The move of a complete run to its place. Unchanged files of an earlier run are removed, all other files are
//! kept; if a step fails, all earlier steps are undone.
//!
//! A kill in between leaves files in two places. A plan of the move is stored in the folder until the move is
//! complete, so that the next run or `haptograph recover` completes it: see [`MovePlan`].

use super::file::{Force, place_all};
use super::folder::{MARK, MARKER, PARTIAL, PROBES, REPLACED};
use super::manifest::{MANIFEST, Manifest};
use super::{Transaction, free_beside, step};
use crate::cli::Failure;
use crate::signal::files::{self, is_temporary, write_atomically};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The files that were kept when a run was moved to its place.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Placed {
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
    pub(crate) fn lines(&self) -> Vec<String> {
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
pub(super) fn refuse_foreign(target: &Path, place: &Path) -> Result<(), Failure> {
    let shown = target.display();
    let is_empty = match files::entries(place) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => true,
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
            return Err(Failure::Message(format!("{shown} is not a folder; give another one by --out")));
        }
        Err(error) => return Err(Failure::file("read the folder", target, &error)),
        Ok(mut entries) => entries.all(|entry| entry.is_ok_and(|entry| entry.path().join(MARKER).exists())),
    };
    if is_empty || Manifest::read(&place.join(MANIFEST)).is_some() {
        return Ok(());
    }
    Err(Failure::Message(format!(
        "{shown} holds files but no {MANIFEST} of a run; give another folder by --out (runs of earlier versions \
         have none: rename their folders)"
    )))
}

/// File with the plan of a move, present from before the first move until after the last.
pub(crate) const MOVES: &str = ".haptograph-moves";

/// Decisions that cannot be reconstructed after the first move. JSON.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct MovePlan {
    /// True if the temporary folder is inside the place and not beside it.
    inside: bool,
    /// New name, beside the place, of an earlier run that cannot be repeated.
    earlier: Option<String>,
    /// Absolute paths of the probes' files, by number.
    probes: Vec<String>,
}

impl MovePlan {
    /// Plans the move of a run from `content` to `place` and stores the plan, after which an interrupted move can be
    /// completed. Paths that are not Unicode cannot be stored: then a killed move stays incomplete.
    pub(super) fn begin(content: &Path, place: &Path, probes: &[PathBuf]) -> io::Result<Self> {
        let earlier = holds_what_cannot_be_repeated(place).then(|| free_beside(place));
        let name = |path: PathBuf| Some(path.file_name()?.to_string_lossy().into_owned());
        let probes = probes.iter().map(std::path::absolute).collect::<io::Result<Vec<_>>>()?;
        let probes = probes.iter().map(|path| path.to_str().map(str::to_owned)).collect::<Option<Vec<_>>>();
        let is_whole = probes.is_some();
        let inside = content.parent() == Some(place);
        let plan = Self { inside, earlier: earlier.and_then(name), probes: probes.unwrap_or_default() };
        if is_whole {
            let text = serde_json::to_string_pretty(&plan)? + "\n";
            write_atomically(&content.join(MOVES), text.as_bytes())?;
        }
        Ok(plan)
    }

    /// Reads the plan of an interrupted move.
    pub(super) fn read(content: &Path) -> Option<Self> {
        let text = files::read_text(&content.join(MOVES), files::MAX_REPORT_BYTES).ok()?;
        serde_json::from_str(&text).ok()
    }

    /// Target of the move of `content`; `None` if its name does not state it.
    pub(super) fn place(&self, content: &Path) -> Option<PathBuf> {
        let near = content.parent()?;
        let (name, _) = content.file_name()?.to_str()?.rsplit_once(PARTIAL)?;
        Some(if self.inside { near.to_owned() } else { near.join(name) })
    }

    /// The folder, beside the place, that keeps an earlier run.
    fn kept(&self, place: &Path) -> Option<PathBuf> {
        // Only a file name, since a plan can be forged.
        let name = Path::new(self.earlier.as_ref()?).file_name()?;
        Some(place.with_file_name(name))
    }
}

/// Completes an interrupted move. A plan can be forged, so only files written by haptograph are replaced.
pub(super) fn resume(content: &Path, place: &Path, plan: &MovePlan) -> Result<(), Failure> {
    for (number, probe) in plan.probes.iter().map(Path::new).enumerate() {
        if probe.extension().is_some_and(|ending| ending == "wav" || ending == "csv") {
            place_probe(content, number, probe, Force::default())?;
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

/// Moves the files of a probe to their places; true if all are at the requested paths.
pub(super) fn place_probe(content: &Path, number: usize, file: &Path, force: Force) -> Result<bool, Failure> {
    let folder = file.parent().map_or(Ok(()), fs::create_dir_all);
    folder.map_err(Failure::doing("write", file))?;
    let waiting = content.join(PROBES).join(number.to_string());
    let placed = place_all(&waiting, file, force)?;
    Ok(placed == [file.with_added_extension("ron"), file.to_owned()])
}

/// Moves all files of `content` to `place` and removes `content`.
pub(super) fn place(content: &Path, place: &Path, plan: &MovePlan) -> io::Result<Placed> {
    let new = files_in(content, &[MARKER, PROBES, REPLACED, MOVES, MANIFEST])?;
    let new_manifest = content.join(MANIFEST);
    // The manifest of an interrupted move also lists the files already moved.
    if Manifest::read(&new_manifest).is_none() {
        let mut manifest = Manifest::default();
        new.iter().try_for_each(|name| manifest.add(content, name))?;
        manifest.save(&new_manifest)?;
    }
    let mut moves = Transaction::default();
    let placed = clear((content, place), &new, plan, &mut moves).and_then(|placed| {
        // The facts last but one, so that a folder with new facts is complete.
        let (facts, files): (Vec<_>, Vec<_>) = new.iter().partition(|name| *name == Path::new(MARK));
        let last = PathBuf::from(MANIFEST);
        for name in files.into_iter().chain(facts).chain([&last]) {
            moves.rename(&content.join(name), &place.join(name))?;
        }
        Ok(placed)
    });
    let placed = placed.inspect_err(|_| moves.undo())?;
    remove_empty(place, &moves);
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
    moves: &mut Transaction,
) -> io::Result<Placed> {
    let old = Manifest::read(&place.join(MANIFEST)).unwrap_or_default();
    let earlier = plan.kept(place);
    // A kept earlier run keeps all files that it has now.
    let is_moved =
        |name: &PathBuf| place.join(name).is_file() && (earlier.is_some() || old.is_unchanged(place, name));
    let names: Vec<PathBuf> = old.names().filter(is_moved).collect();
    let aside = earlier.clone().unwrap_or_else(|| content.join(REPLACED));
    for name in names.iter().map(PathBuf::as_path).chain([Path::new(MANIFEST)]) {
        if fs::symlink_metadata(place.join(name)).is_ok() {
            moves.rename(&place.join(name), &aside.join(name))?;
        }
    }
    let mut moved = Vec::new();
    for taken in new.iter().filter_map(|name| in_the_way(place, name)) {
        let free = free_beside(&taken);
        moves.rename(&taken, &free)?;
        moved.push((taken, free));
    }
    let left = left(place, &names, new, &moved);
    Ok(Placed { earlier, left, moved })
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
pub(crate) fn files_in(folder: &Path, but: &[&str]) -> io::Result<Vec<PathBuf>> {
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

/// Removes the folders that files were moved out of, if they are empty.
fn remove_empty(place: &Path, moves: &Transaction) {
    let emptied: BTreeSet<&Path> = moves.done.iter().filter_map(|(from, _)| from.parent()).collect();
    for folder in emptied.iter().rev() {
        let within = folder.ancestors().take_while(|folder| *folder != place && folder.starts_with(place));
        // `remove_dir` keeps a folder that is not empty.
        let _ = { within }.try_for_each(fs::remove_dir);
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
