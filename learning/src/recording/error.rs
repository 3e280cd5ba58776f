//! Errors of reading a recording.

use super::RecordingError;
use haptograph_signal::csv::CsvError;

/// An error in the content of a recording's file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum ReadError {
    #[error("{0}")]
    Io(String),
    #[error("the file is empty: it has 0 bytes")]
    Empty,
    #[error("it is {found}, not a recording")]
    OtherDocument { found: &'static str },
    #[error(
        "the file begins as an archive (.npz, .xlsx), but its directory at the end is missing: it is cut off or damaged; copy it again"
    )]
    CutArchive,
    #[error("member {name} of the archive: {message}")]
    Member { name: String, message: String },
    #[error("line {line}: {message}")]
    Csv { line: u64, message: String },
    #[error("line {line}, column {column}: {message}")]
    CsvCell { line: u64, column: usize, message: String },
    #[error("sheet `{sheet}`{}: {message}", last_read(*after))]
    Sheet {
        sheet: String,
        /// Row and column of the last cell that could be read, from 1.
        after: Option<(u64, u64)>,
        message: String,
    },
    #[error("missing columns: {}. The file has: {}. {}", missing.join(", "), listed(columns), advice(missing, hints))]
    Missing {
        missing: Vec<String>,
        columns: Vec<String>,
        /// A flag for each quantity.
        hints: Vec<String>,
    },
    #[error(
        "no table beside the WAV file: put {} into {table}, or give constant quantities with --constant, such as --constant speed_mm_s=50",
        missing.join(" and ")
    )]
    NoTable { missing: Vec<String>, table: String },
    #[error(
        "the XML file is not named like the toolkit's recordings: Accel_<material>.xml, Position_<material>.xml or Force_<material>.xml"
    )]
    NotATriple,
    #[error("{file}, byte {byte}: {message}")]
    Xml { file: &'static str, byte: u64, message: String },
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

impl From<CsvError> for ReadError {
    fn from(error: CsvError) -> Self {
        match error {
            CsvError::Io(message) => Self::Io(message),
            CsvError::Row { line, message } => Self::Csv { line, message },
            CsvError::Cell { line, column, message } => Self::CsvCell { line, column, message },
        }
    }
}

fn last_read(after: Option<(u64, u64)>) -> String {
    after.map_or_else(String::new, |(row, column)| format!(", after row {row}, column {column}"))
}

/// Advice on how to name missing columns.
fn advice(missing: &[String], hints: &[String]) -> String {
    match missing {
        [time] if time == "time" => {
            format!("Name the column of the time, {}, or put a number fs into a MATLAB file", hints.join(" "))
        }
        _ => format!("Name the columns: {}", hints.join(" ")),
    }
}

/// Joins names for a message; limits their number and length.
pub(super) fn listed(names: &[String]) -> String {
    const MOST: usize = 30;
    let short = |name: &String| match name.chars().count() {
        0..=40 => name.clone(),
        _ => name.chars().take(39).chain(['…']).collect(),
    };
    let mut some: Vec<String> = names.iter().filter(|name| !name.is_empty()).map(short).collect();
    let more = some.len().saturating_sub(MOST);
    some.truncate(MOST);
    match (some.is_empty(), more) {
        (true, _) => "none".to_owned(),
        (_, 0) => some.join(", "),
        (_, more) => format!("{}, and {more} more", some.join(", ")),
    }
}

impl ReadError {
    /// The message without the location in the table.
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
        ReadError::Member { name: name.to_owned(), message: message.to_string() }
    }
}
