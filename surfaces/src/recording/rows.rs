//! Rows of a CSV file, one at a time: files of any length are read in the memory of one line.

use super::ReadError;
use haptograph_signal::files::MAX_LINE_BYTES;
use std::collections::BTreeMap;
use std::io::{BufRead, Read};
use std::ops::Range;

/// Reads rows. Empty lines and those that begin with `#` are passed over.
pub(super) struct Rows<R> {
    source: R,
    delimiter: u8,
    line: u64,
    text: Vec<u8>,
    cells: Vec<Range<usize>>,
}

/// What stands before the rows.
pub(super) struct Head {
    /// Names of the columns.
    pub names: Vec<String>,
    /// Line of the header, from 1.
    pub line: u64,
    /// Lines `# key: value` above the header.
    pub notes: BTreeMap<String, String>,
}

/// A row.
pub(super) struct Row<'a> {
    /// Its line in the file, from 1.
    pub line: u64,
    text: &'a [u8],
    cells: &'a [Range<usize>],
}

impl Row<'_> {
    /// The cell in a column (from 0), without quotes and surrounding spaces; empty where the row is too short.
    pub fn cell(&self, column: usize) -> &[u8] {
        self.cells
            .get(column)
            .map_or(&[], |range| &self.text[range.clone()])
    }

    pub fn cells(&self) -> usize {
        self.cells.len()
    }
}

impl<R: BufRead> Rows<R> {
    /// Reads up to the header. No name may be there twice; bytes that are no UTF-8, as in Latin-1 files, may stand in names that nobody
    /// asks for.
    pub fn new(source: R) -> Result<(Self, Head), ReadError> {
        let mut rows = Self {
            source,
            delimiter: b',',
            line: 0,
            text: vec![],
            cells: vec![],
        };
        let mut notes = BTreeMap::new();
        while rows.read_line()? {
            if let Some(note) = rows.text.strip_prefix(b"#") {
                let text = String::from_utf8_lossy(note);
                if let Some((key, value)) = text.split_once(':') {
                    notes.insert(key.trim().to_owned(), value.trim().to_owned());
                }
            } else if !rows.text.is_empty() {
                break;
            }
        }
        rows.delimiter = delimiter(&rows.text);
        rows.split()?;
        let line = rows.line.max(1);
        let row = rows.row();
        let names: Vec<String> = (0..row.cells())
            .map(|column| String::from_utf8_lossy(row.cell(column)).into_owned())
            .collect();
        check_names(&names, line)?;
        Ok((rows, Head { names, line, notes }))
    }

    /// The next row.
    pub fn next(&mut self) -> Result<Option<Row<'_>>, ReadError> {
        while self.read_line()? {
            if !self.text.is_empty() && !self.text.starts_with(b"#") {
                self.split()?;
                return Ok(Some(self.row()));
            }
        }
        Ok(None)
    }

    fn row(&self) -> Row<'_> {
        Row {
            line: self.line,
            text: &self.text,
            cells: &self.cells,
        }
    }

    /// The next line, without spaces around it; false at the end.
    fn read_line(&mut self) -> Result<bool, ReadError> {
        self.text.clear();
        let mut line = (&mut self.source).take(MAX_LINE_BYTES as u64 + 1);
        let read = line
            .read_until(b'\n', &mut self.text)
            .map_err(|e| ReadError::Io(e.to_string()))?;
        if read == 0 {
            return Ok(false);
        }
        self.line += 1;
        if read > MAX_LINE_BYTES {
            return Err(self.error(format!(
                "the line is longer than {MAX_LINE_BYTES} bytes: is this a table?"
            )));
        }
        if self.line == 1 {
            if self.text.starts_with(b"\xff\xfe") || self.text.starts_with(b"\xfe\xff") {
                return Err(self.error("this is UTF-16 text; save it as UTF-8".to_owned()));
            }
            if self.text.starts_with(b"\xef\xbb\xbf") {
                self.text.drain(..3);
            }
        }
        // Tabs at the end may be empty cells.
        while self
            .text
            .last()
            .is_some_and(|byte| matches!(byte, b'\r' | b'\n' | b' '))
        {
            self.text.pop();
        }
        if self.text.iter().all(u8::is_ascii_whitespace) {
            self.text.clear();
        }
        Ok(true)
    }

    fn split(&mut self) -> Result<(), ReadError> {
        self.cells.clear();
        let (mut start, mut quoted) = (0, false);
        for (index, &byte) in self.text.iter().enumerate() {
            if byte == self.delimiter && !quoted {
                self.cells.push(trimmed(&self.text, start..index));
                start = index + 1;
            }
            quoted ^= byte == b'"';
        }
        if quoted {
            return Err(self.error("a quoted cell is not closed on its line".to_owned()));
        }
        self.cells.push(trimmed(&self.text, start..self.text.len()));
        Ok(())
    }

    fn error(&self, message: String) -> ReadError {
        ReadError::Csv {
            line: self.line,
            message,
        }
    }
}

/// A cell without spaces and quotes around it.
fn trimmed(text: &[u8], cell: Range<usize>) -> Range<usize> {
    let spaces = |range: Range<usize>| {
        let left = text[range.clone()]
            .iter()
            .take_while(|b| b.is_ascii_whitespace())
            .count();
        let start = range.start + left;
        let right = text[start..range.end]
            .iter()
            .rev()
            .take_while(|b| b.is_ascii_whitespace())
            .count();
        start..range.end - right
    };
    let bare = spaces(cell);
    match &text[bare.clone()] {
        [b'"', .., b'"'] => spaces(bare.start + 1..bare.end - 1),
        _ => bare,
    }
}

/// What stands between the cells: whichever the header has most of.
fn delimiter(header: &[u8]) -> u8 {
    let count = |delimiter: u8| header.iter().filter(|&&byte| byte == delimiter).count();
    [b',', b';', b'\t']
        .into_iter()
        .max_by_key(|&d| (count(d), d == b','))
        .unwrap_or(b',')
}

fn check_names(names: &[String], line: u64) -> Result<(), ReadError> {
    if names.iter().all(String::is_empty) {
        return Err(ReadError::Csv {
            line,
            message: "there is no header: the file is empty".to_owned(),
        });
    }
    for (index, name) in names.iter().enumerate() {
        let first = names[..index].iter().position(|earlier| earlier == name);
        if let Some(first) = first.filter(|_| !name.is_empty()) {
            return Err(ReadError::CsvCell {
                line,
                column: index + 1,
                message: format!(
                    "{name} is there twice, in columns {} and {}; rename or remove one",
                    first + 1,
                    index + 1
                ),
            });
        }
    }
    Ok(())
}

/// Where the cell `column` (from 1) of a line begins, in characters from 1.
pub(super) fn cell_start(bytes: &[u8], line: &[u8], column: usize) -> usize {
    let header = bytes
        .split(|&b| b == b'\n')
        .find(|line| !line.starts_with(b"#") && !line.trim_ascii().is_empty());
    let delimiter = char::from(delimiter(header.unwrap_or_default()));
    let (mut cell, mut quoted) = (1, false);
    let line = String::from_utf8_lossy(line);
    for (index, character) in line.chars().enumerate() {
        if cell == column && !character.is_whitespace() {
            return index + 1;
        }
        quoted ^= character == '"';
        cell += usize::from(character == delimiter && !quoted);
    }
    line.chars().count().max(1)
}
