//! Rows of a CSV file, one at a time: files of any length are read in the memory of one line.

use super::header::{check_names, header_of};
use super::{CsvError, HEADER_WITHIN, is_without_numbers};
use crate::files::MAX_LINE_BYTES;
use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::io::{BufRead, Read};
use std::ops::Range;

/// Comment lines that are kept as metadata; later ones are skipped.
const MAX_NOTES: usize = 1000;
/// Their bytes.
const MAX_NOTE_BYTES: usize = 1 << 20;

/// Reads rows. It skips empty lines, lines of spaces and tabs unless they are rows, and lines that begin with `#`.
pub struct Rows<R> {
    source: R,
    pub(super) delimiter: u8,
    line: u64,
    keeps_blank: bool,
    /// Of the header; 1 until it is known.
    columns: usize,
    text: Vec<u8>,
    cells: Vec<Range<usize>>,
    /// Lines that were read to find the header, with their numbers.
    ahead: VecDeque<(u64, Vec<u8>)>,
}

/// The lines before the first row of data.
pub struct Head {
    /// Names of the columns.
    pub names: Vec<String>,
    /// Line of the header, from 1.
    pub line: u64,
    /// Lines `# key: value` among the first thousand comments above the header.
    pub notes: BTreeMap<String, String>,
}

/// A row.
pub struct Row<'a> {
    /// Its line in the file, from 1.
    pub line: u64,
    text: &'a [u8],
    cells: &'a [Range<usize>],
}

impl Row<'_> {
    /// The cell in a column (from 0), without quotes and surrounding spaces; empty if the row is too short.
    pub fn cell(&self, column: usize) -> &[u8] {
        self.cells.get(column).map_or(&[], |range| &self.text[range.clone()])
    }

    /// The number of its cells.
    pub fn cells(&self) -> usize {
        self.cells.len()
    }

    /// The text of the cell in a column.
    pub fn text(&self, column: usize) -> Cow<'_, str> {
        unquoted(self.cell(column))
    }

    /// An error about this row.
    pub fn error(&self, message: impl ToString) -> CsvError {
        let (line, message) = (self.line, message.to_string());
        CsvError::Row { line, message }
    }

    /// The error of a row with another number of cells than the header.
    pub fn of_other_length(&self, header: usize) -> CsvError {
        let (cells, plural) = (self.cells(), if self.cells() == 1 { "" } else { "s" });
        self.error(format_args!("the row has {cells} cell{plural} where the header has {header}"))
    }
}

impl<R: BufRead> Rows<R> {
    /// Reads the header. It is the line with most of the wanted columns, else the line above the first numbers.
    ///
    /// # Errors
    /// Those of the file system, text that is no table, two lines that could be the header, and a name that is there twice.
    pub fn new(source: R, is_wanted: &dyn Fn(&str) -> bool) -> Result<(Self, Head), CsvError> {
        Self::open(source, is_wanted, false)
    }

    /// [`Rows::new`]; where `keeps_blank`, a line of spaces and tabs below the first line is a row of empty cells.
    pub(super) fn open(
        source: R,
        is_wanted: &dyn Fn(&str) -> bool,
        keeps_blank: bool,
    ) -> Result<(Self, Head), CsvError> {
        let mut rows = Self {
            source,
            delimiter: b',',
            line: 0,
            keeps_blank,
            columns: 1,
            text: vec![],
            cells: vec![],
            ahead: VecDeque::new(),
        };
        let mut seen: Vec<(u64, Vec<u8>)> = vec![];
        let (mut notes, mut note_bytes) = (vec![], 0);
        while seen.len() < HEADER_WITHIN && rows.read_line()? {
            if rows.text.iter().any(|byte| is_control(*byte)) {
                return Err(rows.error("the file is not text, so it is not a CSV table".to_owned()));
            }
            if let Some(note) = rows.text.strip_prefix(b"#") {
                note_bytes += note.len();
                if notes.len() < MAX_NOTES && note_bytes <= MAX_NOTE_BYTES {
                    notes.push((rows.line, String::from_utf8_lossy(note).into_owned()));
                }
            }
            let is_blank_preamble = seen.is_empty() && is_blank(&rows.text);
            if !(rows.is_skipped() || is_blank_preamble) {
                seen.push((rows.line, rows.text.clone()));
            }
        }
        let candidates: Vec<&(u64, Vec<u8>)> = seen.iter().filter(|(_, text)| !is_blank(text)).collect();
        let delimiters: Vec<u8> = { candidates.iter() }.map(|(_, text)| delimiter(text, is_wanted)).collect();
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
        let notes = { notes.iter().take_while(|(at, _)| *at < line) }
            .filter_map(|(_, note)| note.split_once(':'))
            .map(|(key, value)| (key.trim().to_owned(), value.trim().to_owned()))
            .collect();
        rows.delimiter = delimiters[header];
        rows.ahead = seen.into_iter().skip_while(|(at, _)| *at < line).collect();
        rows.read_line()?;
        rows.split()?;
        let names = texts(&rows.text, rows.delimiter);
        check_names(&names, line)?;
        rows.columns = names.len();
        Ok((rows, Head { names, line, notes }))
    }

    /// The row below the header with its line, if it holds words and no numbers: that of the units, before [`Rows::next`].
    pub fn words_below(&self) -> Option<(u64, Vec<String>)> {
        let (line, text) = self.ahead.front()?;
        let cells = texts(text, self.delimiter);
        is_without_numbers(&cells).then_some((*line, cells))
    }

    /// The next row.
    ///
    /// # Errors
    /// Those of the file system, a line that is too long, and a quote without its partner.
    #[allow(clippy::should_implement_trait, reason = "a row borrows the reader's memory")]
    pub fn next(&mut self) -> Result<Option<Row<'_>>, CsvError> {
        while self.read_line()? {
            if !self.is_skipped() {
                self.split()?;
                return Ok(Some(self.row()));
            }
        }
        Ok(None)
    }

    /// True if a line of blanks can be a row: of empty cells between tabs, or of the one column.
    fn may_be_blank(&self) -> bool {
        self.delimiter == b'\t' || self.columns == 1
    }

    /// True if the line is not a row.
    fn is_skipped(&self) -> bool {
        self.text.is_empty()
            || self.text.starts_with(b"#")
            || is_blank(&self.text) && !(self.keeps_blank && self.may_be_blank())
    }

    fn row(&self) -> Row<'_> {
        Row { line: self.line, text: &self.text, cells: &self.cells }
    }

    /// The next line, without its end; false after the last.
    fn read_line(&mut self) -> Result<bool, CsvError> {
        if let Some((line, text)) = self.ahead.pop_front() {
            (self.line, self.text) = (line, text);
            return Ok(true);
        }
        self.text.clear();
        let mut line = (&mut self.source).take(MAX_LINE_BYTES as u64 + 1);
        let read = line.read_until(b'\n', &mut self.text).map_err(|e| CsvError::Io(e.to_string()))?;
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
        while let Some(b'\r' | b'\n') = self.text.last() {
            self.text.pop();
        }
        if let Cow::Owned(text) = decoded(&self.text) {
            self.text = text.into_bytes();
        }
        Ok(true)
    }

    fn split(&mut self) -> Result<(), CsvError> {
        match split(&self.text, self.delimiter, &mut self.cells) {
            true => Ok(()),
            false => Err(self.error("a quoted cell has no closing quote on its line".to_owned())),
        }
    }

    fn error(&self, message: String) -> CsvError {
        self.error_at(self.line, message)
    }

    fn error_at(&self, line: u64, message: String) -> CsvError {
        CsvError::Row { line, message }
    }
}

/// Splits a line into cells; false if a quote is not closed.
fn split(text: &[u8], delimiter: u8, cells: &mut Vec<Range<usize>>) -> bool {
    cells.clear();
    let (mut start, mut quotes) = (0, Quotes::default());
    for (index, &byte) in text.iter().enumerate() {
        if quotes.separates(byte.into(), delimiter.into()) {
            cells.push(trimmed(text, start..index));
            start = index + 1;
        }
    }
    cells.push(trimmed(text, start..text.len()));
    !quotes.is_open
}

/// The quotes of a line, character by character. A quote opens only at the start of a cell; any other is text.
#[derive(Default)]
struct Quotes {
    is_open: bool,
    /// The last character closed a quote, so that another one continues it.
    has_closed: bool,
    /// The cell has begun.
    has_begun: bool,
}

impl Quotes {
    /// Takes a character; true if it separates two cells.
    fn separates(&mut self, character: char, delimiter: char) -> bool {
        if character == delimiter && !self.is_open {
            *self = Self::default();
            return true;
        }
        let opens = !self.has_begun || self.has_closed;
        self.has_closed = character == '"' && self.is_open;
        if character == '"' {
            self.is_open = !self.is_open && opens;
        }
        self.has_begun |= !character.is_ascii_whitespace();
        false
    }
}

/// The cells of a line as texts.
fn texts(text: &[u8], delimiter: u8) -> Vec<String> {
    let mut cells = vec![];
    split(text, delimiter, &mut cells);
    let text = |cell: Range<usize>| unquoted(&text[cell]).into_owned();
    cells.into_iter().map(text).collect()
}

/// A cell in which a doubled quote is one.
fn unquoted(cell: &[u8]) -> Cow<'_, str> {
    let text = String::from_utf8_lossy(cell);
    match text.contains("\"\"") {
        true => Cow::Owned(text.replace("\"\"", "\"")),
        false => text,
    }
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

/// True if a line consists of spaces and tabs.
fn is_blank(line: &[u8]) -> bool {
    line.iter().all(u8::is_ascii_whitespace)
}

fn is_control(byte: u8) -> bool {
    byte < 0x20 && !byte.is_ascii_whitespace() && byte != 0x0b
}

/// A cell without spaces and quotes around it.
fn trimmed(text: &[u8], cell: Range<usize>) -> Range<usize> {
    let spaces = |range: Range<usize>| {
        let left = text[range.clone()].iter().take_while(|b| b.is_ascii_whitespace()).count();
        let start = range.start + left;
        let right = text[start..range.end].iter().rev().take_while(|b| b.is_ascii_whitespace()).count();
        start..range.end - right
    };
    let bare = spaces(cell);
    match &text[bare.clone()] {
        [b'"', .., b'"'] => spaces(bare.start + 1..bare.end - 1),
        _ => bare,
    }
}

/// The cell separator: the candidate that gives most of the wanted names, no name that ends in a comma or semicolon, and
/// most cells. Tabs beside commas and semicolons and at the line's ends align cells, so they count last.
fn delimiter(header: &[u8], is_wanted: &dyn Fn(&str) -> bool) -> u8 {
    let rank = |delimiter: u8| {
        let mut cells = vec![];
        split(header, delimiter, &mut cells);
        let separators = cells.len() - 1;
        let is_mark = |at: usize| matches!(header.get(at), Some(b',' | b';'));
        let ends_in_mark = |cell: &Range<usize>| is_mark(cell.end - 1) && header.get(cell.end) != Some(&b'"');
        let filled: Vec<_> = cells.iter().enumerate().filter(|(_, cell)| !cell.is_empty()).collect();
        let wanted =
            { filled.iter() }.filter(|(_, cell)| is_wanted(&unquoted(&header[(*cell).clone()]))).count();
        let are_names = !filled.iter().any(|(_, cell)| ends_in_mark(cell));
        let tabs = { filled.windows(2) }
            .filter(|pair| !ends_in_mark(pair[0].1) && !is_mark(pair[1].1.start))
            .map(|pair| pair[1].0 - pair[0].0)
            .sum();
        let counted = if delimiter == b'\t' { tabs } else { separators };
        (wanted, are_names, counted, separators, delimiter == b',')
    };
    [b',', b';', b'\t'].into_iter().max_by_key(|&d| rank(d)).unwrap_or(b',')
}

/// The first character (from 1) of cell `column` (from 1) of a line.
pub fn cell_start(line: &[u8], column: usize) -> usize {
    let count = |delimiter: u8| line.iter().filter(|&&byte| byte == delimiter).count();
    // With another separator, commas are decimal points.
    let other = [b';', b'\t'].into_iter().find(|&d| count(d) > 0 && 2 * count(d) >= count(b','));
    let delimiter = char::from(other.unwrap_or(b','));
    let (mut cell, mut quotes) = (1, Quotes::default());
    let line = decoded(line);
    for (index, character) in line.chars().enumerate() {
        if cell == column && !character.is_whitespace() {
            return index + 1;
        }
        cell += usize::from(quotes.separates(character, delimiter));
    }
    line.chars().count().max(1)
}
