//! Recordings and columns as commands read them: what is wrong is shown at its place, what is passed over is said.

use super::{Failure, remark, snippet};
use crate::engine::settings::closest;
use crate::signal::files::{self, MAX_RECORDING_BYTES};
use crate::surfaces::Origin;
use crate::surfaces::recording::{
    self, AnyRecording, COLUMNS, CsvHead, ImportSettings, LoadError, ReadError, csv_head,
};
use ron::extensions::Extensions;
use serde::Deserialize;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The longest header that columns are looked for in, bytes.
const HEAD_BYTES: u64 = 1 << 16;
/// The longest note beside a file, bytes.
const MAX_NOTE_BYTES: u64 = 1 << 20;

/// A recording from a file.
#[derive(Debug)]
pub struct Loaded {
    /// The recording.
    pub recording: AnyRecording,
    /// Whether the file itself says what the hand did.
    pub says_gesture: bool,
}

/// Reads a recording in which nothing has to be repaired, and warns of columns that nothing is learned from.
pub fn load(path: &Path) -> Result<Loaded, Failure> {
    load_with(path, &ImportSettings::strict())
}

/// Reads a recording, of several files where their names are joined by `+`, and warns of what was repaired and of columns that nothing is
/// learned from.
pub fn load_with(path: &Path, import: &ImportSettings) -> Result<Loaded, Failure> {
    let paths = parts(path);
    let head = head(&paths[0]);
    for (path, head) in paths.iter().map(|path| (path, self::head(path))) {
        warn_of_ignored(path, head.as_ref(), import);
    }
    let mut import = import.clone();
    if import.full_scale_m_s2.is_none() {
        import.full_scale_m_s2 = paths.iter().find_map(|path| note(path).ok()?.full_scale);
    }
    let (recording, findings) = recording::load_with(&paths, &import).map_err(|error| match &error {
        LoadError::Read { path, source } => match files::read(path, MAX_RECORDING_BYTES) {
            Ok(bytes) if !bytes.iter().take(512).any(|byte| *byte == 0) => {
                wrong(path, &bytes, source, &error.to_string())
            }
            _ => Failure::Message(error.to_string()),
        },
        _ => Failure::Message(error.to_string()),
    })?;
    for finding in findings {
        remark(&format!("warning: {}: {finding}\n", path.display()));
    }
    Ok(Loaded {
        recording,
        says_gesture: head.is_none_or(|head| head.says_gesture),
    })
}

/// The files of a take: one, or several joined by `+`.
pub fn parts(path: &Path) -> Vec<PathBuf> {
    match path.to_str() {
        Some(text) if text.contains('+') && !path.exists() => text.split('+').map(PathBuf::from).collect(),
        _ => vec![path.to_owned()],
    }
}

fn warn_of_ignored(path: &Path, head: Option<&CsvHead>, import: &ImportSettings) {
    let is_mapped = |name: &&String| import.columns.values().any(|column| column == *name);
    let ignored = head.iter().flat_map(|head| &head.ignored);
    let (mut alike, mut others) = (vec![], vec![]);
    for name in ignored.filter(|name| !is_mapped(name)) {
        match closest(name, COLUMNS) {
            Some(meant) => alike.push((name, meant)),
            None => others.push(format!("{name:?}")),
        }
    }
    for (name, meant) in alike {
        remark(&format!(
            "warning: {}: column {name:?} is not understood and passed over; did you mean {meant}?\n",
            path.display()
        ));
    }
    if !others.is_empty() {
        let (columns, are) = match others.len() {
            1 => ("column", "is"),
            _ => ("columns", "are"),
        };
        remark(&format!(
            "warning: {}: {columns} {} {are} not understood and passed over; known are {}\n",
            path.display(),
            others.join(", "),
            COLUMNS.join(", ")
        ));
    }
}

/// What a CSV file says before its rows; `None` for other kinds of files.
fn head(path: &Path) -> Option<CsvHead> {
    let mut bytes = vec![];
    files::open(path, MAX_RECORDING_BYTES)
        .ok()?
        .take(HEAD_BYTES)
        .read_to_end(&mut bytes)
        .ok()?;
    csv_head(&bytes)
}

/// What a run writes beside a WAV or CSV file.
#[derive(Debug, Default, Deserialize)]
#[serde(rename = "Recording", default)]
pub struct Note {
    /// What a sample of 1.0 in a WAV file stands for.
    pub full_scale: Option<f64>,
    /// Unit of a WAV file.
    pub unit: Option<String>,
    /// Did simulated devices have a part in it?
    pub simulated: bool,
}

/// The note beside a file; says nothing where there is none.
pub fn note(path: &Path) -> Result<Note, Failure> {
    let mut note = path.as_os_str().to_owned();
    note.push(".ron");
    let note = PathBuf::from(note);
    let options = ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME);
    match files::read_text(&note, MAX_NOTE_BYTES) {
        Ok(text) => options
            .from_str(&text)
            .map_err(|error| Failure::file("read", &note, &error)),
        Err(_) => Ok(Note::default()),
    }
}

/// Whether a table is known to be simulated: by a line above its header, or by the note beside it.
pub fn is_simulated(path: &Path) -> Result<bool, Failure> {
    let origin = head(path).and_then(|head| head.origin);
    Ok(origin == Some(Origin::Simulated) || note(path)?.simulated)
}

/// The failure to read a signal from a CSV file.
pub fn unreadable(path: &Path, bytes: &[u8], error: &ReadError) -> Failure {
    wrong(
        path,
        bytes,
        error,
        &format!("cannot read {}: {error}", path.display()),
    )
}

fn wrong(path: &Path, bytes: &[u8], error: &ReadError, message: &str) -> Failure {
    let shown = error.place(bytes).and_then(|place| {
        let line = bytes.split(|&byte| byte == b'\n').nth(place.line - 1)?;
        let line = String::from_utf8_lossy(line);
        let name = path.display().to_string();
        Some(snippet::at(
            &name,
            line.trim_end(),
            place.line,
            place.column,
            message,
        ))
    });
    shown.map_or_else(|| Failure::Message(message.to_owned()), Failure::Shown)
}
