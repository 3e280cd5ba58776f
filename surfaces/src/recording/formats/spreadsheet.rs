//! The first sheet of a spreadsheet, laid out as a CSV file would be.

use super::super::csv::{Cells, Table, number_of};
use super::super::{ImportSettings, ReadError};
use calamine::{Data, Reader, open_workbook_auto_from_rs};
use std::collections::BTreeMap;
use std::io::Cursor;

/// Reads rows below a header; lines `# key: value` above it are in the first column.
pub(in crate::recording) fn spreadsheet(bytes: &[u8], import: &ImportSettings) -> Result<Table, ReadError> {
    let wrong = |message: String| ReadError::Io(message);
    let mut book = open_workbook_auto_from_rs(Cursor::new(bytes))
        .map_err(|e| wrong(format!("the spreadsheet is damaged: {e}")))?;
    let sheet = book
        .worksheet_range_at(0)
        .ok_or_else(|| wrong("the spreadsheet has no sheet".to_owned()))?;
    let sheet = sheet.map_err(|e| wrong(format!("the first sheet is damaged: {e}")))?;
    let first_row = sheet.start().map_or(0, |(row, _)| u64::from(row)) + 1;
    let mut cells = Cells::default();
    for (row, line) in sheet.rows().zip(first_row..) {
        let texts = || row.iter().map(|cell| cell.to_string().trim().to_owned());
        if let Some(note) = texts()
            .next()
            .and_then(|text| text.strip_prefix('#').map(str::to_owned))
        {
            note_of(&note, &mut cells.notes);
        } else if row.iter().all(|cell| matches!(cell, Data::Empty)) {
        } else if cells.names.is_empty() {
            cells.header_line = line;
            cells.names = texts().collect();
            cells.columns = vec![vec![]; row.len()];
        } else {
            cells.lines.push(line);
            for (column, cell) in cells.columns.iter_mut().zip(row) {
                column.push(value(cell));
            }
        }
    }
    Table::of_cells(cells, import)
}

fn note_of(text: &str, notes: &mut BTreeMap<String, String>) {
    if let Some((key, value)) = text.split_once(':') {
        notes.insert(key.trim().to_owned(), value.trim().to_owned());
    }
}

/// NaN for an empty cell, infinite for one that holds no number.
fn value(cell: &Data) -> f64 {
    match cell {
        Data::Float(value) => *value,
        Data::Int(value) => *value as f64,
        Data::Empty => f64::NAN,
        Data::String(text) if text.trim().is_empty() => f64::NAN,
        Data::String(text) => number_of(text).unwrap_or(f64::INFINITY),
        _ => f64::INFINITY,
    }
}
