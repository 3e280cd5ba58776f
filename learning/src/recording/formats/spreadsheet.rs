//! Reads the first sheet of a spreadsheet, which has the layout of a CSV file.

use super::super::csv::{Cells, ColumnSelection, Table, is_unit, is_wanted, words_without_units};
use super::super::{ImportSettings, ReadError};
use calamine::{Cell, Data, DataRef, Range, Reader, Xlsx, XlsxError};
use haptograph_signal::csv::{HEADER_WITHIN, header_of, is_without_numbers, number};
use std::collections::BTreeMap;
use std::io::{Cursor, Read, Seek, copy, sink};
use zip::ZipArchive;

/// Reads rows below a header; lines `# key: value` above it are in the first column.
pub(in crate::recording) fn spreadsheet(
    bytes: &[u8],
    import: &ImportSettings,
    wanted: ColumnSelection<'_>,
) -> Result<Table, ReadError> {
    bounded(bytes, MAX_INFLATED).map_err(ReadError::Io)?;
    let mut book = Xlsx::new(Cursor::new(bytes)).map_err(|error| ReadError::Io(unopened(&error)))?;
    let sheet = first_sheet(&mut book)?;
    let first_row = sheet.start().map_or(0, |(row, _)| u64::from(row)) + 1;
    let texts =
        |row: &[Data]| -> Vec<String> { row.iter().map(|cell| cell.to_string().trim().to_owned()).collect() };
    let note = |row: &[Data]| match row.first() {
        Some(Data::String(text)) => text.trim().strip_prefix('#').map(str::to_owned),
        _ => None,
    };
    let is_row = |(row, _): &(&[Data], u64)| {
        note(row).is_none() && !row.iter().all(|cell| matches!(cell, Data::Empty))
    };
    let mut rows = sheet.rows().zip(first_row..).filter(is_row);
    let first: Vec<Vec<String>> = rows.clone().take(HEADER_WITHIN).map(|(row, _)| texts(row)).collect();
    let line_of = |row: usize| rows.clone().nth(row).map_or(first_row, |(_, line)| line);
    let header =
        header_of(first.len(), &|row, _| first[row].clone(), &|name| is_wanted(name, import, wanted));
    let header = header.map_err(|(one, other)| {
        let (line, other) = (line_of(one), line_of(other));
        ReadError::Csv {
            line,
            message: format!(
                "rows {line} and {other} could both be the header; remove the one that does not belong to the table"
            ),
        }
    })?;
    let mut cells = Cells::default();
    if let Some((row, line)) = rows.nth(header) {
        cells.header_line = line;
        cells.names = texts(row);
        cells.columns = vec![vec![]; row.len()];
    }
    let above = sheet.rows().zip(first_row..).take_while(|(_, line)| *line < cells.header_line);
    above.filter_map(|(row, _)| note(row)).for_each(|text| note_of(&text, &mut cells.notes));
    let below = rows.clone().next().map(|(row, line)| (texts(row), line));
    if let Some((units, line)) = below.filter(|(below, _)| is_without_numbers(below)) {
        if !units.iter().any(|cell| is_unit(cell)) {
            return Err(words_without_units(line, &units));
        }
        cells.units = units;
        rows.next();
    }
    for (row, line) in rows {
        cells.lines.push(line);
        for (column, cell) in cells.columns.iter_mut().zip(row) {
            column.push(value(cell));
        }
    }
    Table::of_cells(cells, import, wanted)
}

/// Largest inflated size of a workbook, bytes: a few of the largest sheets that are read. All texts are in memory at once.
const MAX_INFLATED: u64 = 1 << 29;

/// Inflates the whole archive and discards it, because the length in an archive's header may be wrong.
fn bounded(bytes: &[u8], most: u64) -> Result<(), String> {
    let mut archive = ZipArchive::new(Cursor::new(bytes))
        .map_err(|_| format!("the spreadsheet is damaged or incomplete; {AGAIN}"))?;
    let mut left = most;
    for number in 0..archive.len() {
        let damaged = match archive.name_for_index(number) {
            Some(Ok(name)) => format!("`{name}` in the spreadsheet is damaged; {AGAIN}"),
            _ => format!("the spreadsheet is damaged; {AGAIN}"),
        };
        let member = archive.by_index(number).map_err(|_| damaged.clone())?;
        let inflated = copy(&mut member.take(left + 1), &mut sink()).map_err(|_| damaged)?;
        let room = left.checked_sub(inflated);
        left = room
            .ok_or_else(|| format!("the spreadsheet inflates to more than {most} bytes; save it as CSV"))?;
    }
    Ok(())
}

/// Largest number of cells of a sheet.
const MAX_CELLS: usize = 1 << 24;
/// Limits of a sheet's extent, per cell, besides and in total: every position within the extent takes memory.
const MAX_PLACES: [u64; 3] = [64, 1 << 20, 1 << 25];

/// Help for a damaged workbook.
const AGAIN: &str = "open it and save it again, or save it as CSV";

/// The reason why a workbook cannot be opened.
fn unopened(error: &XlsxError) -> String {
    match error {
        XlsxError::Password => "the spreadsheet has a password; save it without".to_owned(),
        XlsxError::FileNotFound(name) => format!("the spreadsheet has no `{name}`; {AGAIN}"),
        _ => {
            format!("the list of the sheets, the styles or the texts of the spreadsheet is damaged; {AGAIN}")
        }
    }
}

/// The cells of the first sheet, bounded before memory is taken for its extent.
fn first_sheet(book: &mut Xlsx<impl Read + Seek>) -> Result<Range<Data>, ReadError> {
    let sheets = book.sheet_names();
    let name = sheets.first().ok_or_else(|| ReadError::Io("the spreadsheet has no sheet".to_owned()))?;
    let wrong = |last: Option<(u32, u32)>, message: String| ReadError::Sheet {
        sheet: name.clone(),
        after: last.map(|(row, column)| (u64::from(row) + 1, u64::from(column) + 1)),
        message,
    };
    let damaged = |last| wrong(last, format!("the sheet is damaged; {AGAIN}"));
    let mut reader = book.worksheet_cells_reader(name).map_err(|error| match error {
        XlsxError::NotAWorksheet(_) => wrong(None, "it has no cells; put the table first".to_owned()),
        _ => damaged(None),
    })?;
    let (mut cells, mut rows, mut columns) = (vec![], 0, 0);
    let mut last = None;
    while let Some(cell) = reader.next_cell().map_err(|_| damaged(last))? {
        last = Some(cell.get_position());
        if matches!(cell.get_value(), DataRef::Empty) {
            continue;
        }
        let (row, column) = cell.get_position();
        (rows, columns) = (rows.max(u64::from(row) + 1), columns.max(u64::from(column) + 1));
        cells.push(Cell::new((row, column), Data::from(cell.get_value().clone())));
        if cells.len() > MAX_CELLS {
            return Err(wrong(last, format!("it has more than {MAX_CELLS} cells")));
        }
    }
    let [of_each, besides, at_all] = MAX_PLACES;
    if rows * columns > (of_each * cells.len() as u64 + besides).min(at_all) {
        let message = format!("its {} cells lie in {rows} rows and {columns} columns", cells.len());
        return Err(wrong(None, message));
    }
    Ok(Range::from_sparse(cells))
}

fn note_of(text: &str, notes: &mut BTreeMap<String, String>) {
    if let Some((key, value)) = text.split_once(':') {
        notes.insert(key.trim().to_owned(), value.trim().to_owned());
    }
}

/// NaN for an empty cell, infinity for a cell that is not a number.
fn value(cell: &Data) -> f64 {
    match cell {
        Data::Float(value) => *value,
        Data::Int(value) => *value as f64,
        Data::Empty => f64::NAN,
        Data::String(text) if text.trim().is_empty() => f64::NAN,
        Data::String(text) => number(text.trim().as_bytes()).unwrap_or(f64::INFINITY),
        _ => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn what_a_workbook_inflates_to_is_bounded() {
        let mut archive = zip::ZipWriter::new(Cursor::new(vec![]));
        for name in ["xl/workbook.xml", "xl/sharedStrings.xml"] {
            archive.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            archive.write_all(&[b' '; 500]).unwrap();
        }
        let bytes = archive.finish().unwrap().into_inner();
        assert_eq!(bounded(&bytes, 1000), Ok(()));
        assert!(bounded(&bytes, 999).is_err_and(|why| why.contains("999 bytes")));
        assert!(bounded(&bytes[..bytes.len() / 2], 1000).is_err());
    }
}
