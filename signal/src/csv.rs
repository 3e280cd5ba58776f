//! Tables of text: the one reader of CSV files, for recordings, signals, points and lists.
//!
//! Cells are separated by commas, semicolons or tabs: by what gives most of the wanted names, then by what the header has most
//! of; tabs beside the others and at a line's ends align cells. A number may have a comma for its point
//! where no comma separates the cells. A cell may stand in quotes, in which a doubled quote is one; it ends on its line. A quote
//! further on in a cell is text. Empty lines and lines that begin with `#` are skipped, and so is a preamble above the header. Text is UTF-8, with or without a byte order mark,
//! or else Latin-1. Files of any length are read in the memory of one line.

mod header;
mod rows;

pub use header::{HEADER_WITHIN, header_of, is_without_numbers};
pub use rows::{Head, Row, Rows, cell_start, decoded};

use std::borrow::Cow;
use std::io::BufRead;

/// Why a table cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum CsvError {
    #[error("{0}")]
    Io(String),
    #[error("line {line}: {message}")]
    Row { line: u64, message: String },
    #[error("line {line}, column {column}: {message}")]
    Cell { line: u64, column: usize, message: String },
}

impl CsvError {
    /// The line, from 1.
    pub fn line(&self) -> Option<u64> {
        match self {
            Self::Io(_) => None,
            Self::Row { line, .. } | Self::Cell { line, .. } => Some(*line),
        }
    }

    /// The message without the place.
    pub fn into_message(self) -> String {
        match self {
            Self::Io(message) | Self::Row { message, .. } | Self::Cell { message, .. } => message,
        }
    }
}

/// The text of the number in a cell, with a point for a decimal comma. The text may be that of no number.
pub fn decimal(cell: &[u8]) -> Option<Cow<'_, str>> {
    let text = std::str::from_utf8(cell).ok()?;
    match text.bytes().filter(|&byte| byte == b',').count() {
        0 => Some(Cow::Borrowed(text)),
        1 if !text.contains('.') => Some(Cow::Owned(text.replace(',', "."))),
        _ => None,
    }
}

/// The finite number in a cell.
pub fn number(cell: &[u8]) -> Option<f64> {
    let number = decimal(cell)?.parse::<f64>().ok()?;
    number.is_finite().then_some(number)
}

/// A table with a header, read row by row. Each row has as many cells as the header.
///
/// ```
/// use haptograph_signal::csv::CsvTable;
///
/// let mut table = CsvTable::new(&b"time_s;force_n\n0;1,5\n"[..], &["force_n"])?;
/// let force = table.find("force_n").unwrap();
/// while let Some(row) = table.next_row()? {
///     assert_eq!(row.number(force)?, 1.5);
/// }
/// # Ok::<(), haptograph_signal::csv::CsvError>(())
/// ```
pub struct CsvTable<R> {
    rows: Rows<R>,
    head: Head,
}

/// A row of a [`CsvTable`]. Columns count from 0.
pub struct TableRow<'t> {
    row: Row<'t>,
    names: &'t [String],
    has_decimal_commas: bool,
}

impl<R: BufRead> CsvTable<R> {
    /// Reads the header, which is the line with most of the `wanted` names.
    ///
    /// # Errors
    /// As [`Rows::new`].
    pub fn new(source: R, wanted: &[&str]) -> Result<Self, CsvError> {
        let (rows, head) = Rows::open(source, &|name| wanted.contains(&name), true)?;
        Ok(Self { rows, head })
    }

    /// The header.
    pub fn head(&self) -> &Head {
        &self.head
    }

    /// The column of this name, if there is one.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.head.names.iter().position(|known| known == name)
    }

    /// The next row.
    ///
    /// # Errors
    /// A line that cannot be read, or has another number of cells than the header.
    pub fn next_row(&mut self) -> Result<Option<TableRow<'_>>, CsvError> {
        let (names, has_decimal_commas) = (&self.head.names[..], self.rows.delimiter != b',');
        let Some(row) = self.rows.next()? else {
            return Ok(None);
        };
        match row.cells() == names.len() {
            true => Ok(Some(TableRow { row, names, has_decimal_commas })),
            false => Err(row.of_other_length(names.len())),
        }
    }
}

impl TableRow<'_> {
    /// Its line in the file, from 1.
    pub fn line(&self) -> u64 {
        self.row.line
    }

    /// The text of a cell.
    pub fn text(&self, column: usize) -> Cow<'_, str> {
        self.row.text(column)
    }

    /// True if a cell is empty.
    pub fn is_empty_at(&self, column: usize) -> bool {
        self.row.cell(column).is_empty()
    }

    /// The finite number in a cell. A comma is a decimal point only between digits, and where it does not separate cells.
    ///
    /// # Errors
    /// The cell holds anything else; the message has its place.
    pub fn number(&self, column: usize) -> Result<f64, CsvError> {
        let cell = self.row.cell(column);
        let is_decimal = |at: usize| {
            let is_digit = |at: Option<usize>| at.and_then(|at| cell.get(at)).is_some_and(u8::is_ascii_digit);
            self.has_decimal_commas && is_digit(at.checked_sub(1)) && is_digit(Some(at + 1))
        };
        let has_sound_comma = cell.iter().position(|&byte| byte == b',').is_none_or(is_decimal);
        has_sound_comma
            .then(|| number(cell))
            .flatten()
            .ok_or_else(|| self.unreadable(column, "a finite number"))
    }

    /// An error about this row.
    pub fn error(&self, message: impl ToString) -> CsvError {
        self.row.error(message)
    }

    /// The error of a cell that is not what it has to be.
    pub fn unreadable(&self, column: usize, expected: &str) -> CsvError {
        const SHOWN: usize = 40;
        let name = self.names.get(column).map_or("", String::as_str);
        let text: String = self.text(column).chars().take(SHOWN).collect();
        let message = match &*text {
            "" => format!("the cell of {name} is empty"),
            text => format!("{text:?} in {name} is not {expected}"),
        };
        CsvError::Cell { line: self.row.line, column: column + 1, message }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &[u8]) -> Result<Vec<f64>, CsvError> {
        let mut table = CsvTable::new(text, &["b"])?;
        let column = table.find("b").expect("the header has it");
        let mut numbers = Vec::new();
        while let Some(row) = table.next_row()? {
            numbers.push(row.number(column)?);
        }
        Ok(numbers)
    }

    #[test]
    fn numbers_are_read_in_every_dialect() {
        for text in [
            "a,b\n1,1.5\n2,-2\n",
            "a;b\r\n1;1,5\r\n2;-2\r\n",
            "\u{feff}a\tb\n1\t1,5\n\n# remark\n2\t-2\n",
            "Logger 7\nof Tuesday, at noon\n\"a\",\"b\"\n1,\"1.5\"\n2, -2 \n",
        ] {
            assert_eq!(read(text.as_bytes()), Ok(vec![1.5, -2.0]), "{text}");
        }
    }

    #[test]
    fn what_cannot_be_read_has_its_place() {
        for (text, place) in [
            (&b""[..], (1, None)),
            (b"a,b\n1,2\n3\n", (3, None)),
            (b"a,b\n1,2\n# remark\n\n3,4,5\n", (5, None)),
            (b"a,b\n1,\"2\n", (2, None)),
            (b"a,b\n1,\n", (2, Some(2))),
            (b"# remark\na,b\n1,inf\n", (3, Some(2))),
            (b"a,b\n1,\xb5\n", (2, Some(2))),
            (b"a;b\n1;1.000,5\n", (2, Some(2))),
            (b"a;b\n1;5,\n", (2, Some(2))),
            (b"a;b\n1;,5\n", (2, Some(2))),
            (b"a,b\n1,\"1,500\"\n", (2, Some(2))),
            (b"a,b,b\n1,2,3\n", (1, Some(3))),
        ] {
            let found = match read(text) {
                Err(CsvError::Row { line, .. }) => (line, None),
                Err(CsvError::Cell { line, column, .. }) => (line, Some(column)),
                other => panic!("{other:?}"),
            };
            assert_eq!(found, place, "{}", String::from_utf8_lossy(text));
        }
    }

    fn header(text: &str, wanted: &[&str]) -> Vec<String> {
        CsvTable::new(text.as_bytes(), wanted).unwrap().head().names.clone()
    }

    #[test]
    fn tabs_that_align_cells_do_not_separate_them() {
        for text in ["a,\t\tb", "\ta,\tb", "a,b\t", "a;\tb", "a\t;\tb", "\ta\t,\t\tb\t", "a\tb"] {
            for wanted in [&["a", "b"][..], &["b"], &[]] {
                assert_eq!(header(text, wanted), ["a", "b"], "{text:?} {wanted:?}");
            }
        }
        assert_eq!(header("\ta", &["a"]), ["", "a"]);
        assert_eq!(header("a\t\t", &["a"]), ["a", "", ""]);
        assert_eq!(header("\"a,\",b", &[]), ["a,", "b"]);
        let names = ["a, s", "b, N", "c, m"];
        assert_eq!(header("a, s\tb, N\tc, m", &names[..1]), names);
    }

    #[test]
    fn a_line_of_blanks_is_a_row_of_empty_cells() {
        for (text, lines) in [
            (" \nb\n  \r\n\n1\n\t\n", vec![3, 5, 6]),
            ("a\tb\n\t\n \t \n\n1\t2\n", vec![2, 3, 5]),
            ("b\n\t", vec![2]),
        ] {
            let mut table = CsvTable::new(text.as_bytes(), &["b"]).unwrap();
            let mut found = vec![];
            while let Some(row) = table.next_row().unwrap() {
                found.push(row.line());
            }
            assert_eq!(found, lines, "{text:?}");
            let (mut rows, _) = Rows::new(text.as_bytes(), &|name| name == "b").unwrap();
            let numbers = std::iter::from_fn(|| rows.next().unwrap().map(|row| row.line));
            assert!(numbers.eq(lines.into_iter().filter(|&line| line == 5)), "{text:?}");
        }
    }

    #[test]
    fn a_line_of_blanks_in_a_table_of_commas_is_none() {
        assert_eq!(read(b"a,b\n1,2\n  \n1,3\n\t\n"), Ok(vec![2.0, 3.0]));
    }

    #[test]
    fn comments_beyond_a_bound_are_skipped() {
        let mut text = "# first: 1\n".to_owned();
        (0..2000).for_each(|_| text += "#\n");
        text += "# last: 2\na,b\n# x\n1,2\n";
        assert_eq!(read(text.as_bytes()), Ok(vec![2.0]));
        let table = CsvTable::new(text.as_bytes(), &["b"]).unwrap();
        assert!(table.head().notes.keys().eq(["first"]));
        assert_eq!(table.head().line, 2003);
        let long = "x".repeat(60_000);
        let notes: String = (0..20).map(|key| format!("#{key}: {long}\n")).collect();
        let text = notes + "a,b\n";
        let table = CsvTable::new(text.as_bytes(), &["b"]).unwrap();
        assert_eq!(table.head().notes.len(), 17, "a MiB");
    }

    #[test]
    fn a_quote_within_a_cell_is_text() {
        let text = b"a,b,c\n5\" pipe,2, \"x,\"\"y\"\n";
        let mut table = CsvTable::new(&text[..], &["b"]).unwrap();
        let row = table.next_row().unwrap().expect("a row");
        assert_eq!([0, 1, 2].map(|column| row.text(column)), ["5\" pipe", "2", "x,\"y"]);
        assert_eq!(cell_start(b"5\" pipe,2,x", 3), 11);
    }

    #[test]
    fn a_doubled_quote_in_a_name_or_a_cell_is_one() {
        let text = b"\"the \"\"b\"\"\",c\n\"say \"\"no\"\", twice\",1\n";
        let mut table = CsvTable::new(&text[..], &["the \"b\""]).unwrap();
        assert_eq!(table.find("the \"b\""), Some(0));
        let row = table.next_row().unwrap().expect("a row");
        assert_eq!(row.text(0), "say \"no\", twice");
    }

    #[test]
    fn the_first_character_of_a_cell_is_found() {
        assert_eq!(cell_start(b"1,22, \"3,3\"", 3), 7);
        assert_eq!(cell_start("1,5;µ;x".as_bytes(), 3), 7);
        assert_eq!(cell_start(b"1", 4), 1);
    }
}
