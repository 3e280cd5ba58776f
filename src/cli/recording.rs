//! Reading recordings and tables for commands: errors are shown at their place in the file, findings are
//! printed as warnings.

use super::{Failure, eprint, snippet};
use crate::engine::settings::closest;
use crate::learning::recording::{
    self, AnyRecording, COLUMNS, CsvHead, Finding, ImportSettings, LoadError, ReadError, csv_head,
};
use crate::signal::csv::decoded;
use crate::signal::files::{self, MAX_NOTE_BYTES, MAX_RECORDING_BYTES};
use crate::surfaces::Origin;
use ron::extensions::Extensions;
use serde::Deserialize;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Maximum length of a CSV header, bytes.
const HEAD_BYTES: u64 = 1 << 16;

/// A recording read from a file.
#[derive(Debug)]
pub(super) struct Loaded {
    /// The recording.
    pub recording: AnyRecording,
    /// True if the file itself states the gesture.
    pub says_gesture: bool,
    /// Findings and repairs, as printed.
    pub warnings: Vec<String>,
    /// True if a quantity is outside the range of human hands.
    pub is_implausible: bool,
}

/// Reads a recording, from several files if their names are joined by `+`, and prints findings and repairs as
/// warnings.
pub(super) fn load_with(path: &Path, import: &ImportSettings) -> Result<Loaded, Failure> {
    let loaded = try_load(path, import).map_err(|error| failure(&error))?;
    loaded.warn();
    Ok(loaded)
}

impl Loaded {
    /// Prints the findings and repairs.
    pub(super) fn warn(&self) {
        self.warnings.iter().for_each(|warning| eprint(&format!("warning: {warning}\n")));
    }
}

/// The same without printing.
pub(super) fn try_load(path: &Path, import: &ImportSettings) -> Result<Loaded, LoadError> {
    let paths = parts(path);
    let head = head(&paths[0]);
    let import = with_full_scale(&paths, import);
    let (recording, findings) = recording::load_with(&paths, &import)?;
    Ok(Loaded {
        recording,
        says_gesture: head.is_none_or(|head| head.says_gesture),
        is_implausible: { findings.iter() }
            .any(|(_, finding)| matches!(finding, Finding::Implausible { .. })),
        warnings: findings.iter().map(|(path, finding)| said(path, finding)).collect(),
    })
}

/// The full scale from the note beside a WAV file, if no flag states it.
fn with_full_scale(paths: &[PathBuf], import: &ImportSettings) -> ImportSettings {
    let noted = || paths.iter().find_map(|path| note(path).ok()?.full_scale);
    ImportSettings { full_scale_m_s2: import.full_scale_m_s2.or_else(noted), ..import.clone() }
}

/// A finding with the name of its file; unused columns get the nearest quantity.
pub(super) fn said(path: &Path, finding: &Finding) -> String {
    let Finding::NotUsed { columns } = finding else {
        return format!("{}: {finding}", path.display());
    };
    let names = columns.iter().take(MAX_NAMED).map(|name| match closest(name, COLUMNS) {
        Some(near) => format!("{name:?} (did you mean {near}?)"),
        None => format!("{name:?}"),
    });
    let names = names.collect::<Vec<_>>().join(", ");
    match columns.len().saturating_sub(MAX_NAMED) {
        0 => format!("{}: unused columns: {names}", path.display()),
        more => format!("{}: unused columns: {names}, and {more} more", path.display()),
    }
}

/// Maximum number of columns in one message.
const MAX_NAMED: usize = 8;

/// The failure to read a file, shown at its place if the file is text.
pub(super) fn failure(error: &LoadError) -> Failure {
    match error {
        LoadError::Read { path, source } => {
            at_its_place(path, source).map_or_else(|| Failure::Message(error.to_string()), Failure::Rendered)
        }
        LoadError::Io { .. } => Failure::Message(error.to_string()),
    }
}

/// The error shown at its place, if that is known and the file is text.
fn at_its_place(path: &Path, error: &ReadError) -> Option<String> {
    let mut source = BufReader::new(files::open(path, MAX_RECORDING_BYTES).ok()?);
    if !is_text(source.fill_buf().ok()?) {
        return None;
    }
    let (place, line) = error.place(source)?;
    let name = path.display().to_string();
    let message = format!("cannot read {name}: {}", error.what());
    let line = decoded(&line);
    Some(snippet::at(&name, line.trim_end(), place.line, place.column, &message))
}

fn is_text(bytes: &[u8]) -> bool {
    let is_other = |byte: &u8| *byte < 0x20 && !byte.is_ascii_whitespace();
    !bytes.iter().take(4096).any(is_other) && !bytes.starts_with(b"PK") && !bytes.starts_with(b"MATLAB ")
}

/// The files of a take: one path, or several joined by `+`.
pub(super) fn parts(path: &Path) -> Vec<PathBuf> {
    match path.to_str() {
        Some(text) if text.contains('+') && !path.exists() => text.split('+').map(PathBuf::from).collect(),
        _ => vec![path.to_owned()],
    }
}

/// The header of a CSV file; `None` for other kinds of files.
fn head(path: &Path) -> Option<CsvHead> {
    let mut bytes = vec![];
    files::open(path, MAX_RECORDING_BYTES).ok()?.take(HEAD_BYTES).read_to_end(&mut bytes).ok()?;
    csv_head(&bytes)
}

/// Contents of the note that a run writes beside a WAV or CSV file.
#[derive(Debug, Default, Deserialize)]
#[serde(rename = "Recording", default)]
pub(super) struct Note {
    /// Physical value of a WAV sample of 1.0.
    pub full_scale: Option<f64>,
    /// Unit of that value.
    pub unit: Option<String>,
    /// True if the data depend on simulated devices.
    pub simulated: bool,
}

/// Reads the note beside a file; a missing note gives the defaults.
pub(super) fn note(path: &Path) -> Result<Note, Failure> {
    let note = path.with_added_extension("ron");
    let options = ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME);
    match files::read_text(&note, MAX_NOTE_BYTES) {
        Ok(text) => options.from_str(&text).map_err(Failure::doing("read", &note)),
        Err(_) => Ok(Note::default()),
    }
}

/// True if a table is marked as simulated, by a line above its header or by the note beside it.
pub(super) fn is_simulated(path: &Path) -> Result<bool, Failure> {
    let origin = head(path).and_then(|head| head.origin);
    Ok(origin == Some(Origin::Simulated) || note(path)?.simulated)
}
