//! Why bytes give no recording.

use super::RecordingError;
use super::rows::listed;

/// Why bytes give no recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum ReadError {
    #[error("{0}")]
    Io(String),
    #[error("the archive is damaged: {0}")]
    Archive(String),
    #[error("member {name} of the archive: {message}")]
    Member { name: String, message: String },
    #[error("line {line}: {message}")]
    Csv { line: u64, message: String },
    #[error("line {line}, column {column}: {message}")]
    CsvCell {
        line: u64,
        column: usize,
        message: String,
    },
    #[error("missing: {}. Columns here: {}. {}", missing.join(", "), listed(columns), advice(missing, hints))]
    Missing {
        missing: Vec<String>,
        columns: Vec<String>,
        /// A flag for each quantity.
        hints: Vec<String>,
    },
    #[error(
        "no table beside it: put {} into {table}, or say what did not change by --constant, as --constant speed_mm_s=50",
        missing.join(" and ")
    )]
    NoTable { missing: Vec<String>, table: String },
    #[error(
        "it is XML, but not named Accel_<material>.xml, Position_<material>.xml or Force_<material>.xml as the toolkit's recordings are"
    )]
    NotATriple,
    #[error("{file}, byte {byte}: {message}")]
    Xml {
        file: &'static str,
        byte: u64,
        message: String,
    },
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

/// How columns that are missing are named.
fn advice(missing: &[String], hints: &[String]) -> String {
    match missing {
        [time] if time == "time" => format!(
            "Say which column is the time, {}, or put a number fs into a MATLAB file",
            hints.join(" ")
        ),
        _ => format!("Say which is which: {}", hints.join(" ")),
    }
}

impl ReadError {
    /// What is wrong, without its place in the table.
    pub fn what(&self) -> String {
        match self {
            Self::Csv { message, .. } | Self::CsvCell { message, .. } => message.clone(),
            other => other.to_string(),
        }
    }
}

#[cfg(not(target_family = "wasm"))]
impl ReadError {
    pub(super) fn member(name: &str, message: impl ToString) -> Self {
        ReadError::Member {
            name: name.to_owned(),
            message: message.to_string(),
        }
    }
}
