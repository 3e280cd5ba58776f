//! Rows of a CSV file, one at a time: files of any length are read in the memory of one line.

use super::ReadError;
use super::csv::{Scale, is_unit, number};
use haptograph_signal::files::MAX_LINE_BYTES;
use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::io::{BufRead, Read};
use std::ops::Range;

/// Number of rows that are searched for the header; loggers write a preamble above it.
pub(super) const HEADER_WITHIN: usize = 20;

/// Reads rows. It skips empty lines and lines that begin with `#`.
pub(super) struct Rows<R> {
    source: R,
    delimiter: u8,
    line: u64,
    text: Vec<u8>,
    cells: Vec<Range<usize>>,
    /// Lines that were read to find the header, with their numbers.
    ahead: VecDeque<(u64, Vec<u8>)>,
}

/// The lines before the first row of data.
pub(super) struct Head {
    /// Names of the columns.
    pub names: Vec<String>,
    /// Units in the row below the header; empty if there is no such row.
    pub units: Vec<String>,
    /// Line of the header, from 1.
    pub line: u64,
    /// Lines `# key: value` above the header.
    pub notes: BTreeMap<String, String>,
}

/// A row.
pub(super) struct Row<'a> {
    /// The line in the file, from 1.
    pub line: u64,
    text: &'a [u8],
    cells: &'a [Range<usize>],
}

impl Row<'_> {
    /// The cell in a column (from 0), without quotes and surrounding spaces; empty if the row is too short.
    pub fn cell(&self, column: usize) -> &[u8] {
        self.cells
            .get(column)
            .map_or(&[], |range| &self.text[range.clone()])
    }

    pub fn cells(&self) -> usize {
        self.cells.len()
    }

    fn texts(&self) -> Vec<String> {
        (0..self.cells())
            .map(|column| String::from_utf8_lossy(self.cell(column)).into_owned())
            .collect()
    }
}

impl<R: BufRead> Rows<R> {
    /// Reads the header and a row of units below it. The header is the line with most of the wanted columns, else the line
    /// above the first numbers. Column names must be unique. Lines that are not UTF-8 are read as Latin-1.
    pub fn new(source: R, is_wanted: &dyn Fn(&str) -> bool) -> Result<(Self, Head), ReadError> {
        let mut rows = Self {
            source,
            delimiter: b',',
            line: 0,
            text: vec![],
            cells: vec![],
            ahead: VecDeque::new(),
        };
        let mut seen = vec![];
        let is_row = |(_, text): &&(u64, Vec<u8>)| !text.starts_with(b"#");
        while seen.iter().filter(is_row).count() < HEADER_WITHIN && rows.read_line()? {
            if !rows.text.is_empty() {
                if rows.text.iter().any(|byte| is_control(*byte)) {
                    return Err(rows.error("the file is not text, so it is not a CSV table".to_owned()));
                }
                seen.push((rows.line, rows.text.clone()));
            }
        }
        let candidates: Vec<&(u64, Vec<u8>)> = seen.iter().filter(is_row).collect();
        let delimiters: Vec<u8> = candidates.iter().map(|(_, text)| delimiter(text)).collect();
        let split = |row: usize, header: usize| texts(&candidates[row].1, delimiters[header]);
        let header = header_of(candidates.len(), &split, is_wanted).map_err(|(first, second)| {
            let (first, second) = (candidates[first].0, candidates[second].0);
            rows.error_at(
                first,
                format!("lines {first} and {second} could both be the header; remove the one that does not belong to the table"),
            )
        })?;
        let Some(&(line, _)) = candidates.get(header).copied() else {
            rows.text.clear();
            check_names(&[String::new()], rows.line.max(1))?;
            return Err(rows.error("the table has no header".to_owned()));
        };
        let mut notes = BTreeMap::new();
        for (_, text) in seen.iter().take_while(|(at, _)| *at < line) {
            if let Some(note) = text.strip_prefix(b"#")
                && let Some((key, value)) = String::from_utf8_lossy(note).split_once(':')
            {
                notes.insert(key.trim().to_owned(), value.trim().to_owned());
            }
        }
        rows.delimiter = delimiters[header];
        rows.ahead = seen.into_iter().skip_while(|(at, _)| *at < line).collect();
        rows.read_line()?;
        rows.split()?;
        let names = rows.row().texts();
        check_names(&names, line)?;
        let units = rows.units_row()?;
        Ok((
            rows,
            Head {
                names,
                units,
                line,
                notes,
            },
        ))
    }

    /// Takes the row of units below the header, if there is one.
    fn units_row(&mut self) -> Result<Vec<String>, ReadError> {
        let place = self.ahead.iter().position(|(_, text)| !text.starts_with(b"#"));
        let Some((line, text)) = place.and_then(|place| self.ahead.get(place)) else {
            return Ok(vec![]);
        };
        let cells = texts(text, self.delimiter);
        if !is_without_numbers(&cells) {
            return Ok(vec![]);
        }
        if !cells.iter().any(|cell| is_unit(cell)) {
            let message = format!(
                "the row below the header contains neither numbers nor units: {}; remove it, and give units with --unit",
                listed(&cells)
            );
            return Err(self.error_at(*line, message));
        }
        // Skips an empty line.
        if let Some((_, text)) = place.and_then(|place| self.ahead.get_mut(place)) {
            text.clear();
        }
        Ok(cells)
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
        if let Some((line, text)) = self.ahead.pop_front() {
            (self.line, self.text) = (line, text);
            return Ok(true);
        }
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
                "the line is longer than {MAX_LINE_BYTES} bytes; check that the file is a table"
            )));
        }
        if self.line == 1 {
            if self.text.starts_with(b"\xff\xfe") || self.text.starts_with(b"\xfe\xff") {
                return Err(self.error("the file is UTF-16 text; save it as UTF-8".to_owned()));
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
        if let Cow::Owned(text) = decoded(&self.text) {
            self.text = text.into_bytes();
        }
        Ok(true)
    }

    fn split(&mut self) -> Result<(), ReadError> {
        match split(&self.text, self.delimiter, &mut self.cells) {
            true => Ok(()),
            false => Err(self.error("a quoted cell has no closing quote on its line".to_owned())),
        }
    }

    fn error(&self, message: String) -> ReadError {
        self.error_at(self.line, message)
    }

    fn error_at(&self, line: u64, message: String) -> ReadError {
        ReadError::Csv { line, message }
    }
}

/// Splits a line into cells; false if a quote is not closed.
fn split(text: &[u8], delimiter: u8, cells: &mut Vec<Range<usize>>) -> bool {
    cells.clear();
    let (mut start, mut quoted) = (0, false);
    for (index, &byte) in text.iter().enumerate() {
        if byte == delimiter && !quoted {
            cells.push(trimmed(text, start..index));
            start = index + 1;
        }
        quoted ^= byte == b'"';
    }
    cells.push(trimmed(text, start..text.len()));
    !quoted
}

/// The cells of a line as texts.
fn texts(text: &[u8], delimiter: u8) -> Vec<String> {
    let mut cells = vec![];
    split(text, delimiter, &mut cells);
    let text = |cell: Range<usize>| String::from_utf8_lossy(&text[cell]).into_owned();
    cells.into_iter().map(text).collect()
}

/// Decodes a line as UTF-8, else as Latin-1 with the extra characters of Windows-1252.
pub fn decoded(line: &[u8]) -> Cow<'_, str> {
    /// The characters in tables among the 32 in which Windows-1252 differs from Latin-1.
    fn character(byte: u8) -> char {
        match byte {
            0x80 => '€',
            0x91 | 0x92 => '\'',
            0x93 | 0x94 => '"',
            0x96 | 0x97 => '–',
            byte => char::from(byte),
        }
    }
    match std::str::from_utf8(line) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(line.iter().map(|byte| character(*byte)).collect()),
    }
}

fn is_control(byte: u8) -> bool {
    byte < 0x20 && !byte.is_ascii_whitespace() && byte != 0x0b
}

/// Finds the header among the first rows: the row with most of the wanted columns. If no row has any, it is the row above
/// the first numbers that has as many cells, else the first row. `split` splits a row into cells as the header is split.
///
/// # Errors
/// Two rows that could both be the header.
pub(super) fn header_of(
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
    number(cell.as_bytes(), Scale::One).is_some() || cell.parse::<f64>().is_ok()
}

/// True if most cells contain text and none contains a number.
pub(super) fn is_without_numbers(cells: &[String]) -> bool {
    let filled = cells.iter().filter(|cell| !cell.is_empty()).count();
    let is_word = |cell: &&String| {
        let marks_nothing = ["na", "n/a", "null", "none"].contains(&&*cell.to_lowercase());
        cell.chars().any(char::is_alphabetic) && !marks_nothing
    };
    let words = cells.iter().filter(is_word).count();
    2 * filled > cells.len() && 2 * words > filled && !cells.iter().any(|cell| is_number(cell))
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

/// The cell separator: the candidate that occurs most often in the header.
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
            message: "the file is empty".to_owned(),
        });
    }
    for (index, name) in names.iter().enumerate() {
        let first = names[..index].iter().position(|earlier| earlier == name);
        if let Some(first) = first.filter(|_| !name.is_empty()) {
            return Err(ReadError::CsvCell {
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

/// The first character (from 1) of cell `column` (from 1) of a line.
pub(super) fn cell_start(line: &[u8], column: usize) -> usize {
    let count = |delimiter: u8| line.iter().filter(|&&byte| byte == delimiter).count();
    // With another separator, commas are decimal points.
    let other = [b';', b'\t']
        .into_iter()
        .find(|&d| count(d) > 0 && 2 * count(d) >= count(b','));
    let delimiter = char::from(other.unwrap_or(b','));
    let (mut cell, mut quoted) = (1, false);
    let line = decoded(line);
    for (index, character) in line.chars().enumerate() {
        if cell == column && !character.is_whitespace() {
            return index + 1;
        }
        quoted ^= character == '"';
        cell += usize::from(character == delimiter && !quoted);
    }
    line.chars().count().max(1)
}
