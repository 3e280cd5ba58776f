//! `haptograph recover`: repairs the files of a crashed run.
//!
//! No file is removed and no sample is changed. The headers of WAV files, of those that the command line names and of
//! those of crashed runs, are corrected to the length of the data; recordings are assembled from their parts, which are
//! kept; and the folder of a run gets its own name. A complete run that was killed during its move is moved to its place.

use super::placing::{MARKER, complete_move, lock, rename_recovered};
use super::{Failure, eprint, print, print_json};
use crate::engine::registry::Registry;
use crate::nodes::wav::{Repair, repair};
use crate::signal::files;
use crate::surfaces::recorder::assemble;
use serde::Serialize;
use std::fs::{self, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

/// Repair the files of a crashed run
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Folders NAME.partial-N of crashed runs, folders GRAPH-strokes-N of a crashed studio, or single WAV files and folders
    /// FILE.part of recordings
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// Maximum depth of nested folders.
const DEPTH: usize = 8;

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let mut repaired = Repaired { complete: true, done: Vec::new() };
    for path in &arguments.paths {
        for done in recover(path)? {
            match done {
                Ok(text) if arguments.json => repaired.done.push(text),
                Ok(text) => print(&(text + "\n"))?,
                Err(failure) => {
                    eprint(&format!("error: {failure}\n"));
                    repaired.complete = false;
                }
            }
        }
    }
    if arguments.json {
        print_json(&repaired)?;
    }
    if repaired.complete { Ok(()) } else { Err(Failure::Reported) }
}

/// What was repaired. As text each repair is printed when it is done.
#[derive(Serialize)]
struct Repaired {
    complete: bool,
    done: Vec<String>,
}

/// The change made to a file, or the reason of a failure.
type Done = Result<String, Failure>;

fn recover(path: &Path) -> Result<Vec<Done>, Failure> {
    let kind = fs::symlink_metadata(path).map_err(Failure::doing("read", path))?;
    if kind.is_symlink() {
        let message = "it is a symbolic link; give its target";
        return Err(Failure::file("recover", path, &message));
    }
    if !kind.is_dir() {
        return Ok(file(path, true).into_iter().collect());
    }
    if is_being_written(path)? {
        let message = "a run is writing there now";
        return Err(Failure::file("recover", path, &message));
    }
    if let Some(place) = complete_move(path) {
        let said =
            |place: PathBuf| format!("{}: completed the interrupted move of this run", place.display());
        return Ok(vec![place.map(said)]);
    }
    let mut done = Vec::new();
    folder(path, (DEPTH, false), &mut done);
    let is_whole = done.iter().all(Result::is_ok);
    if path.join(MARKER).is_file() && is_whole {
        let said = |target: PathBuf| format!("{}: renamed from {}", target.display(), path.display());
        done.push(rename_recovered(path).map(said));
    }
    if done.is_empty() {
        done.push(Ok(format!("{}: nothing to recover", path.display())));
    }
    Ok(done)
}

/// The files of a run that is not complete, locked while it goes on.
const LOCKED: [&str; 2] = [MARKER, haptograph_studio::APPENDED];

/// True if a running process holds the folder's lock.
fn is_being_written(folder: &Path) -> Result<bool, Failure> {
    for path in LOCKED.map(|name| folder.join(name)).iter().filter(|path| path.exists()) {
        match lock(path) {
            Ok(_) => {}
            Err(TryLockError::WouldBlock) => return Ok(true),
            Err(TryLockError::Error(error)) => return Err(Failure::file("lock", path, &error)),
        }
    }
    Ok(false)
}

/// Recovers all crashed runs and recordings in a folder, whose own WAV files are other people's if it is no run.
fn folder(path: &Path, (depth, is_of_a_run): (usize, bool), done: &mut Vec<Done>) {
    let is_of_a_run = is_of_a_run || LOCKED.iter().any(|name| path.join(name).is_file());
    match is_being_written(path) {
        Ok(false) => {}
        Ok(true) => return done.push(Ok(format!("{}: a run is writing there now", path.display()))),
        Err(failure) => return done.push(Err(failure)),
    }
    if is_spool(path) {
        done.push(recording(path));
        return;
    }
    if path.join(haptograph_studio::APPENDED).is_file() {
        done.push(strokes(path));
    }
    let entries: io::Result<Vec<_>> = files::entries(path).and_then(Iterator::collect);
    let mut entries = match entries {
        Ok(entries) => entries,
        Err(error) => return done.push(Err(Failure::file("read", path, &error))),
    };
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let (path, kind) = (entry.path(), entry.file_type());
        match kind {
            Ok(kind) if kind.is_dir() && depth > 0 => folder(&path, (depth - 1, is_of_a_run), done),
            Ok(kind) if kind.is_file() && is_of_a_run => done.extend(file(&path, false)),
            // Links are skipped: they may lead anywhere.
            _ => {}
        }
    }
}

/// Recovers a single file; `asked` if the command line names it.
fn file(path: &Path, asked: bool) -> Option<Done> {
    let is_wav = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("wav"));
    let shown = path.display();
    if !is_wav {
        let text = format!("{shown}: needs no recovery: it is usable up to its end");
        return asked.then_some(Ok(text));
    }
    let failed = |error: &dyn std::fmt::Display| Some(Err(Failure::file("recover", path, error)));
    let mut file = match files::open_to_change(path) {
        Ok(file) => file,
        Err(error) => return failed(&error),
    };
    match repair(&mut file) {
        Ok(Repair::Whole) => asked.then(|| Ok(format!("{shown}: complete"))),
        Ok(Repair::Mended { before, now }) => {
            Some(Ok(format!("{shown}: corrected the header from {before} to the {now} frames in the file")))
        }
        Ok(Repair::TooLarge) => failed(&"it holds more than 4 GiB, which its header cannot state"),
        Err(error) => failed(&error),
    }
}

fn is_spool(folder: &Path) -> bool {
    folder.extension().is_some_and(|ending| ending == "part") && folder.join("head.ron").is_file()
}

/// Assembles the recording of a folder `NAME.part` beside it.
fn recording(spool: &Path) -> Done {
    // A run that ends normally also makes its table from this archive.
    let path = spool.with_extension("").with_extension("npz");
    if fs::symlink_metadata(&path).is_ok() {
        return Ok(format!("{}: exists already and is kept", path.display()));
    }
    assemble(spool, &path).map_err(Failure::doing("make the recording of", spool))?;
    Ok(format!("{}: assembled from {}, which is kept", path.display(), spool.display()))
}

/// Makes the recording of a studio that was killed.
fn strokes(folder: &Path) -> Done {
    let shown = folder.display();
    match haptograph_studio::recover(folder) {
        Ok(seconds) => Ok(format!(
            "{shown}: made the recording of {seconds:.1} s; drop strokes.json on the page of its graph to replay it"
        )),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            Ok(format!("{shown}: the recording exists already and is kept"))
        }
        Err(error) => Err(Failure::file("make the recording of", folder, &error)),
    }
}
