//! Reads the lines of a log one by one in constant memory.
//!
//! This is not the reader of tables, [`haptograph_signal::csv`]: only a run writes logs, so a line of another dialect, a remark or an
//! empty line is damage here. A header must be that of the graph to the letter, and the last cell of a setting's change is a name
//! that may contain commas.

use super::ReplayError;
use haptograph_signal::files::{self, MAX_LINE_BYTES, MAX_RECORDING_BYTES};
use std::io::{self, BufReader};
use std::path::PathBuf;

/// A log behind its header.
pub(super) struct Lines {
    path: PathBuf,
    lines: Box<dyn Iterator<Item = io::Result<Vec<u8>>> + Send + Sync>,
    /// Number of the last line read, from 1.
    number: usize,
}

impl Lines {
    /// Opens a log that must begin with this header.
    pub(super) fn open(path: PathBuf, wanted: &str) -> Result<Self, ReplayError> {
        let file = match files::open(&path, MAX_RECORDING_BYTES) {
            Ok(file) => file,
            Err(error) => return Err(ReplayError::Read { path, error }),
        };
        let lines = Box::new(files::lines(BufReader::new(file), MAX_LINE_BYTES));
        let mut log = Self { path, lines, number: 0 };
        let found = log.next()?.unwrap_or_default();
        if found != wanted {
            const SHOWN: usize = 200;
            return Err(ReplayError::OtherGraph {
                path: log.path,
                found: found.chars().take(SHOWN).collect(),
                wanted: wanted.to_owned(),
            });
        }
        Ok(log)
    }

    /// The next line.
    pub(super) fn next(&mut self) -> Result<Option<String>, ReplayError> {
        let Some(line) = self.lines.next() else {
            return Ok(None);
        };
        self.number += 1;
        let error = match line.map(String::from_utf8) {
            Ok(Ok(text)) => return Ok(Some(text)),
            Ok(Err(_)) => return Err(self.implausible("it is not UTF-8 text")),
            Err(error) => error,
        };
        if files::Refusal::of(&error).is_some() {
            return Err(self.implausible(error));
        }
        let path = self.path.clone();
        Err(ReplayError::Read { path, error })
    }

    /// Path, and number of the last line read, from 1.
    pub(super) fn place(&self) -> (PathBuf, usize) {
        (self.path.clone(), self.number)
    }

    /// Error: a run cannot have written the last line read.
    pub(super) fn implausible(&self, why: impl ToString) -> ReplayError {
        let (path, line) = self.place();
        ReplayError::Implausible { path, line, why: why.to_string() }
    }

    /// Error: the last line read does not have this many numbers.
    pub(super) fn malformed(&self, columns: usize) -> ReplayError {
        let (path, line) = self.place();
        ReplayError::Line { path, line, columns }
    }
}
