//! Which of the first rows of a table is its header. Spreadsheets are searched by the same rules.

use super::{CsvError, number};

/// Number of rows that are searched for the header; loggers write a preamble above it.
pub const HEADER_WITHIN: usize = 20;

/// Finds the header among the first rows: the row with most of the wanted columns. If no row has any, it is the row above
/// the first numbers that has as many cells, else the first row. `split` splits a row into cells as the header is split.
///
/// # Errors
/// Two rows that could both be the header.
pub fn header_of(
    rows: usize,
    split: &dyn Fn(usize, usize) -> Vec<String>,
    is_wanted: &dyn Fn(&str) -> bool,
) -> Result<usize, (usize, usize)> {
    let wanted = |row: usize| {
        let cells = split(row, row);
        cells.iter().filter(|cell| is_wanted(cell)).count()
    };
    let counts: Vec<usize> = (0..rows).map(wanted).collect();
    let most = counts.iter().copied().max().unwrap_or(0);
    if most == 0 {
        return Ok(above_numbers(rows, split).unwrap_or(0));
    }
    let mut alike = (0..rows).filter(|row| counts[*row] == most);
    match (alike.next(), alike.next()) {
        (Some(first), Some(second)) => Err((first, second)),
        (first, _) => Ok(first.unwrap_or(0)),
    }
}

/// The row above the first row of numbers, or above a row of units there.
fn above_numbers(rows: usize, split: &dyn Fn(usize, usize) -> Vec<String>) -> Option<usize> {
    let width = |cells: &[String]| {
        let last = cells.iter().rposition(|cell| !cell.is_empty());
        last.map_or(0, |last| last + 1)
    };
    let fits = |header: usize, row: usize| {
        let (names, between) = (split(header, header), split(row - 1, header));
        let numbers = split(row, header);
        let filled = numbers.iter().filter(|cell| !cell.is_empty());
        let is_numbers = filled.clone().count() > 1 && filled.clone().all(|cell| is_number(cell));
        is_numbers
            && width(&numbers) <= width(&names)
            && is_without_numbers(&names)
            && (header + 1 == row || width(&between) <= width(&names) && is_without_numbers(&between))
    };
    (1..rows).find_map(|row| (row.saturating_sub(2)..row).find(|header| fits(*header, row)))
}

fn is_number(cell: &str) -> bool {
    number(cell.as_bytes()).is_some() || cell.parse::<f64>().is_ok()
}

/// True if most cells contain text and none contains a number.
pub fn is_without_numbers(cells: &[String]) -> bool {
    let filled = cells.iter().filter(|cell| !cell.is_empty()).count();
    let is_word = |cell: &&String| {
        let marks_nothing = ["na", "n/a", "null", "none"].contains(&&*cell.to_lowercase());
        cell.chars().any(char::is_alphabetic) && !marks_nothing
    };
    let words = cells.iter().filter(is_word).count();
    2 * filled > cells.len() && 2 * words > filled && !cells.iter().any(|cell| is_number(cell))
}

pub(super) fn check_names(names: &[String], line: u64) -> Result<(), CsvError> {
    if names.iter().all(String::is_empty) {
        return Err(CsvError::Row {
            line,
            message: "the file is empty: it needs a header, and rows below it".to_owned(),
        });
    }
    for (index, name) in names.iter().enumerate() {
        let first = names[..index].iter().position(|earlier| earlier == name);
        if let Some(first) = first.filter(|_| !name.is_empty()) {
            return Err(CsvError::Cell {
                line,
                column: index + 1,
                message: format!(
                    "column name {name} occurs twice, in columns {} and {}; rename or remove one",
                    first + 1,
                    index + 1
                ),
            });
        }
    }
    Ok(())
}
