//! Why bytes give no recording.

use super::RecordingError;

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

#[cfg(not(target_family = "wasm"))]
impl ReadError {
    pub(super) fn member(name: &str, message: impl ToString) -> Self {
        ReadError::Member {
            name: name.to_owned(),
            message: message.to_string(),
        }
    }
}
