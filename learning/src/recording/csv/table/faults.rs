//! Errors with their place in the file.

use super::Table;
use crate::recording::csv::hints::hints;
use crate::recording::error::listed;
use crate::recording::import::ImportSettings;
use crate::recording::{ReadError, RecordingError};
use haptograph_signal::csv::decimal;

/// An error, with the index of the file in the take.
#[derive(Debug)]
pub(in crate::recording) struct Fault {
    pub file: usize,
    pub error: ReadError,
}

/// An error of a whole take is reported for its first file.
impl From<ReadError> for Fault {
    fn from(error: ReadError) -> Self {
        Self { file: 0, error }
    }
}

impl From<RecordingError> for Fault {
    fn from(error: RecordingError) -> Self {
        ReadError::from(error).into()
    }
}

impl Table {
    pub(super) fn error(&self, line: u64, message: impl ToString) -> ReadError {
        let message = message.to_string();
        match self.has_lines {
            true => ReadError::Csv { line, message },
            false if line == self.header_line => ReadError::Io(message),
            false => ReadError::Io(format!("sample {line} (from 1): {message}")),
        }
    }

    /// `column` counts from 1.
    pub(super) fn cell_error(&self, line: u64, column: usize, message: String) -> ReadError {
        match self.has_lines {
            true => ReadError::CsvCell { line, column, message },
            false => self.error(line, message),
        }
    }

    pub(in crate::recording) fn fault(&self, line: u64, message: impl ToString) -> Fault {
        self.at_fault(self.error(line, message))
    }

    pub(in crate::recording) fn at_fault(&self, error: ReadError) -> Fault {
        Fault { file: self.file, error }
    }
}

/// The error for missing columns; it lists the columns of the file.
pub(in crate::recording) fn missing_columns(tables: &[&Table], missing: Vec<String>) -> ReadError {
    let is_number = |name: &String| decimal(name.as_bytes()).is_some_and(|text| text.parse::<f64>().is_ok());
    let lacks_header = |table: &&&Table| table.has_lines && table.names.iter().all(is_number);
    if let Some(table) = tables.iter().find(lacks_header) {
        let message = "the first row has numbers only, so the table has no header; name its columns in a row above it, such as \
                       time_s,accel_m_s2,force_normal_n,speed_mm_s";
        return table.error(table.header_line, message);
    }
    let names = tables.iter().flat_map(|table| &table.names).cloned();
    ReadError::Missing {
        hints: hints(tables, &missing),
        missing,
        columns: names.filter(|name| !name.is_empty()).collect(),
    }
}

/// Checks that each column in the settings exists in one of the tables.
pub(in crate::recording) fn check_mapping(
    tables: &[Table],
    import: &ImportSettings,
) -> Result<(), ReadError> {
    let names: Vec<String> = tables.iter().flat_map(|table| table.names.clone()).collect();
    match (import.columns.values().find(|column| !names.contains(column)), tables) {
        (Some(column), [first, ..]) => {
            let message = format!("there is no column {column:?}; the columns are {}", listed(&names));
            Err(first.error(first.header_line, message))
        }
        _ => Ok(()),
    }
}

/// The error for a row of words below the header that are no units.
pub(in crate::recording) fn words_without_units(line: u64, cells: &[String]) -> ReadError {
    ReadError::Csv {
        line,
        message: format!(
            "the row below the header contains neither numbers nor units: {}; remove it, and give units with --unit",
            listed(cells)
        ),
    }
}
