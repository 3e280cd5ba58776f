//! Why bytes give no recording.

use super::RecordingError;
use super::csv::example_unit;
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
    #[error("missing: {}. Columns here: {}. {}", missing.join(", "), listed(columns), advice(missing))]
    Missing {
        missing: Vec<String>,
        columns: Vec<String>,
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
fn advice(missing: &[String]) -> String {
    let Some(first) = missing.iter().find(|name| *name != "time") else {
        return "Give the rate (--sample-rate HZ), say which column is the time (--column time=\"…\" --unit time=ms), or put a number fs \
                into a MATLAB file"
            .to_owned();
    };
    let rate = match missing.len() > 1 && missing.iter().any(|name| name == "time") {
        true => "; rows that follow evenly need no time but --sample-rate HZ",
        false => "",
    };
    let unit = example_unit(first);
    format!("Say which is which: --column {first}=\"…\" --unit {first}={unit}{rate}")
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
