//! The first sheet of a spreadsheet, laid out as a CSV file would be.

use super::super::csv::{Cells, Table, number_of};
use super::super::{ImportSettings, ReadError};
use calamine::{Cell, Data, DataRef, Range, Reader, Sheets, Xlsx, open_workbook_auto_from_rs};
use std::collections::BTreeMap;
use std::io::{Cursor, Read, Seek};

/// Reads rows below a header; lines `# key: value` above it are in the first column.
pub(in crate::recording) fn spreadsheet(bytes: &[u8], import: &ImportSettings) -> Result<Table, ReadError> {
    let wrong = |message: String| ReadError::Io(message);
    let mut book = open_workbook_auto_from_rs(Cursor::new(bytes))
        .map_err(|e| wrong(format!("the spreadsheet is damaged: {e}")))?;
    let sheet = match &mut book {
        Sheets::Xlsx(book) => first_sheet(book),
        Sheets::Xlsb(_) => Err("it is a binary workbook; save it as .xlsx".to_owned()),
        other => other
            .worksheet_range_at(0)
            .unwrap_or_else(|| Ok(Range::empty()))
            .map_err(|e| e.to_string()),
    };
    let sheet = sheet.map_err(|why| wrong(format!("the first sheet cannot be read: {why}")))?;
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

/// Cells of a sheet at most.
const MOST_CELLS: usize = 1 << 24;
/// Places of a sheet at most, for each cell in it and besides: all places within its extent take memory.
const MOST_PLACES: [u64; 2] = [64, 1 << 20];

/// The cells of the first sheet, bounded before memory is taken for its extent.
fn first_sheet(book: &mut Xlsx<impl Read + Seek>) -> Result<Range<Data>, String> {
    let name = book.sheet_names().into_iter().next().ok_or("there is none")?;
    let mut reader = book.worksheet_cells_reader(&name).map_err(|e| e.to_string())?;
    let (mut cells, mut rows, mut columns) = (vec![], 0, 0);
    while let Some(cell) = reader.next_cell().map_err(|e| e.to_string())? {
        if matches!(cell.get_value(), DataRef::Empty) {
            continue;
        }
        let (row, column) = cell.get_position();
        (rows, columns) = (rows.max(u64::from(row) + 1), columns.max(u64::from(column) + 1));
        cells.push(Cell::new((row, column), Data::from(cell.get_value().clone())));
        if cells.len() > MOST_CELLS {
            return Err(format!("it has more than {MOST_CELLS} cells"));
        }
    }
    let [of_each, besides] = MOST_PLACES;
    if rows * columns > of_each * cells.len() as u64 + besides {
        return Err(format!(
            "its {} cells lie in {rows} rows and {columns} columns",
            cells.len()
        ));
    }
    Ok(Range::from_sparse(cells))
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
