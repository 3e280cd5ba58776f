//! CSV files of numbers with a header, read row by row. Errors name the file, the line and the column.

use crate::units;
use haptograph_engine::node::BuildError;
use haptograph_signal::files::{self, Bounded, MAX_RECORDING_BYTES};
use haptograph_signal::quantity::Quantity;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// A CSV file whose header was read. Lines that begin with `#` are skipped.
pub(crate) struct CsvTable<'p> {
    path: &'p Path,
    headers: csv::StringRecord,
    reader: csv::Reader<Bounded>,
}

/// A row of a table.
pub(crate) struct Row<'t> {
    path: &'t Path,
    headers: &'t csv::StringRecord,
    cells: csv::StringRecord,
}

impl<'p> CsvTable<'p> {
    /// Opens a file and reads its header.
    ///
    /// # Errors
    /// An error at the setting `file`, if it cannot be read or has no header.
    pub fn open(path: &'p Path) -> Result<Self, BuildError> {
        let source = files::open(path, MAX_RECORDING_BYTES).map_err(|error| {
            BuildError::at("file", format!("cannot read {}: {error}", path.display()))
                .help("give the path of a CSV file, relative to the graph file")
        })?;
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(source);
        let headers = reader
            .headers()
            .map_err(|error| at_file(path, wrong(&error, path)))?
            .clone();
        match units::no_header(&headers) {
            Some(problem) => Err(at_file(path, problem)),
            None => Ok(Self {
                path,
                headers,
                reader,
            }),
        }
    }

    /// Index of the column with this header, if there is one.
    pub fn find(&self, header: &str) -> Option<usize> {
        self.headers.iter().position(|known| known == header)
    }

    /// Index of the column with this header, which a setting names.
    pub fn column(&self, setting: &'static str, header: &str) -> Result<usize, BuildError> {
        self.find(header).ok_or_else(|| {
            let message = format!("{} has no column `{header}`", self.path.display());
            let known: Vec<&str> = self.headers.iter().collect();
            BuildError::at(setting, message).help(format!("its columns are {}", known.join(", ")))
        })
    }

    /// The header of a column.
    pub fn header(&self, column: usize) -> &str {
        self.headers.get(column).unwrap_or_default()
    }

    /// The rows below the header.
    pub fn rows(&mut self) -> impl Iterator<Item = Result<Row<'_>, BuildError>> {
        let (path, headers) = (self.path, &self.headers);
        self.reader.records().map(move |cells| match cells {
            Ok(cells) => Ok(Row { path, headers, cells }),
            Err(error) => Err(at_file(path, wrong(&error, path))),
        })
    }
}

impl Row<'_> {
    /// True if the cell of a column is empty.
    pub fn is_empty_at(&self, column: usize) -> bool {
        self.cells.get(column) == Some("")
    }

    /// The finite number in the cell of a column.
    pub fn number(&self, column: usize) -> Result<f64, BuildError> {
        let text = self.cells.get(column).unwrap_or_default();
        let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| {
            let name = self.headers.get(column).unwrap_or_default();
            let (line, cell) = (self.line(), column + 1);
            let problem = match text {
                "" => format!("line {line}, column {cell}: the cell of {name} is empty"),
                _ => format!("line {line}, column {cell}: '{text}' in {name} is not a finite number"),
            };
            at_file(self.path, problem)
        })
    }

    /// An error about this row.
    pub fn wrong(&self, problem: impl std::fmt::Display) -> BuildError {
        at_file(self.path, format!("line {}: {problem}", self.line()))
    }

    fn line(&self) -> u64 {
        line_of(self.cells.position(), self.path)
    }
}

/// An error about a file, at the setting `file`.
pub(crate) fn at_file(path: &Path, problem: impl std::fmt::Display) -> BuildError {
    BuildError::at("file", format!("{}: {problem}", path.display()))
}

/// Factor from the unit at the end of a header to SI. The unit has to be one of the quantity that the setting
/// `quantity` names.
pub(crate) fn si_of_column(header: &str, quantity: &str) -> Result<f64, BuildError> {
    let (unit, scale) = units::of_header(header);
    let Some(wanted) = Quantity::by_name(quantity) else {
        return Err(BuildError::at("quantity", format!("unknown quantity {quantity}")));
    };
    if unit == wanted {
        return Ok(scale);
    }
    if let Some(scale) = units::of_header_as(header, wanted) {
        return Ok(scale);
    }
    let message = format!("the name of column {header} has unit {unit}; {wanted} was expected");
    let help = format!(
        "set `quantity` to what the column is, or rename it: ..{}",
        units::suffix(wanted)
    );
    Err(BuildError::at("quantity", message).help(help))
}

/// Description of the error in a line.
fn wrong(error: &csv::Error, file: &Path) -> String {
    let line = line_of(error.position(), file);
    match error.kind() {
        csv::ErrorKind::Io(error) => error.to_string(),
        csv::ErrorKind::Utf8 { err, .. } => {
            let column = err.field() + 1;
            format!("line {line}, column {column}: the text is not UTF-8; save the file as UTF-8")
        }
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => format!(
            "line {line} has {len} {}, the header {expected_len}",
            if *len == 1 { "cell" } else { "cells" }
        ),
        _ => format!("line {line} is not a row of the table"),
    }
}

/// The line of a row. The reader's position is that of the remarks and empty lines above it, or of the end of the row before.
fn line_of(position: Option<&csv::Position>, file: &Path) -> u64 {
    let (Some(position), Ok(opened)) = (position, files::open(file, MAX_RECORDING_BYTES)) else {
        return 1;
    };
    let mut opened = BufReader::new(opened);
    let read = opened.by_ref().take(position.byte());
    let above = read.bytes().map_while(Result::ok).filter(|byte| *byte == b'\n');
    let above = above.count();
    let is_skipped = |line: &Vec<u8>| matches!(&line[..], [] | [b'\r'] | [b'#', ..]);
    let lines = opened.split(b'\n').map_while(Result::ok);
    let skipped = lines.take_while(is_skipped).count();
    (above + skipped) as u64 + 1
}
