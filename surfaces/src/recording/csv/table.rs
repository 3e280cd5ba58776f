//! Rows and columns, with every cell's place for those who have to mend it.

use super::super::{ReadError, Series};
use super::units::{Scale, parse_name};
use crate::files::decimal::parse_thousandth;
use csv::{ByteRecord, ReaderBuilder, Trim};
use std::collections::BTreeMap;

/// The columns that are understood, in SI; cells that were empty are NaN.
pub(in crate::recording) struct Table {
    pub(super) header_line: u64,
    pub(super) notes: BTreeMap<String, String>,
    columns: Vec<(String, Vec<f64>)>,
    /// Line of each row.
    lines: Vec<u64>,
}

pub(in crate::recording) fn reader(bytes: &[u8]) -> csv::Reader<&[u8]> {
    ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(Trim::All)
        .delimiter(delimiter(bytes))
        .from_reader(bytes)
}

/// What stands between the cells: whichever the header has most of.
fn delimiter(bytes: &[u8]) -> u8 {
    let header = bytes
        .split(|&b| b == b'\n')
        .find(|line| !line.starts_with(b"#") && !line.trim_ascii().is_empty());
    let count = |delimiter: u8| header.map_or(0, |line| line.iter().filter(|&&b| b == delimiter).count());
    [b',', b';', b'\t']
        .into_iter()
        .max_by_key(|&d| (count(d), d == b','))
        .unwrap_or(b',')
}

/// The names of the columns and the line they stand on. Bytes that are no UTF-8, as in Latin-1 files, may stand in names that nobody asks
/// for. No name may be there twice.
pub(in crate::recording) fn header(bytes: &[u8]) -> Result<(Vec<String>, u64), ReadError> {
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(ReadError::Csv {
            line: 1,
            message: "this is UTF-16 text; save it as UTF-8".to_owned(),
        });
    }
    let mut reader = reader(bytes);
    let header = reader.byte_headers().map_err(|e| csv_error(&e))?;
    let line = line_of(bytes, header.position());
    let names: Vec<String> = header
        .iter()
        .map(|name| unquoted(&String::from_utf8_lossy(name)).to_owned())
        .collect();
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
    Ok((names, line))
}

/// Where the cell `column` (from 1) of a line begins, in characters from 1.
pub(in crate::recording) fn cell_start(bytes: &[u8], line: &[u8], column: usize) -> usize {
    let delimiter = char::from(delimiter(without_mark(bytes)));
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

impl Table {
    /// Times alone, of a file whose other columns are not ours.
    pub(in crate::recording) fn of_times(
        times: Vec<f64>,
        notes: BTreeMap<String, String>,
        lines: Vec<u64>,
    ) -> Self {
        Self {
            header_line: 1,
            notes,
            columns: vec![("time".to_owned(), times)],
            lines,
        }
    }

    pub(in crate::recording) fn read(bytes: &[u8]) -> Result<Self, ReadError> {
        let (header, header_line) = header(bytes)?;
        let mut reader = reader(bytes);
        let mut wanted = vec![];
        let mut columns: Vec<(String, Vec<f64>)> = vec![];
        for (index, name) in header.iter().enumerate() {
            let Some(parsed) = parse_name(&name.to_ascii_lowercase()) else {
                continue;
            };
            let wrong = |message| ReadError::CsvCell {
                line: header_line,
                column: index + 1,
                message,
            };
            let (plain, scale) = parsed.map_err(wrong)?;
            if columns.iter().any(|(known, _)| *known == plain) {
                return Err(wrong(format!("this is a second column of {plain}")));
            }
            wanted.push((index, scale));
            columns.push((plain, vec![]));
        }
        let mut table = Self {
            header_line,
            notes: notes(bytes),
            columns,
            lines: vec![],
        };
        let mut record = ByteRecord::new();
        while reader.read_byte_record(&mut record).map_err(|e| csv_error(&e))? {
            let line = line_of(bytes, record.position());
            table.lines.push(line);
            for (&(index, scale), (name, values)) in wanted.iter().zip(&mut table.columns) {
                let cell = record.get(index).unwrap_or_default();
                values.push(match cell {
                    b"" => f64::NAN,
                    cell => number(cell, scale).ok_or_else(|| not_a_number(line, index, name, cell))?,
                });
            }
        }
        Ok(table)
    }

    pub(super) fn error(&self, line: u64, message: impl ToString) -> ReadError {
        ReadError::Csv {
            line,
            message: message.to_string(),
        }
    }

    pub(super) fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns
            .iter()
            .find(|(known, _)| known == name)
            .map(|(_, values)| &values[..])
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.column(name).is_some()
    }

    pub(super) fn needed(&self, name: &str) -> Result<&[f64], ReadError> {
        self.column(name).ok_or_else(|| {
            let known: Vec<_> = self.columns.iter().map(|(name, _)| &name[..]).collect();
            self.error(
                self.header_line,
                format!(
                    "a column of {name} is missing; understood were: {}",
                    known.join(", ")
                ),
            )
        })
    }

    /// A column without empty cells.
    pub(super) fn full(&self, name: &str) -> Result<Vec<f64>, ReadError> {
        let values = self.needed(name)?;
        match values.iter().position(|x| x.is_nan()) {
            Some(row) => Err(self.error(self.lines[row], format!("{name} is missing"))),
            None => Ok(values.to_vec()),
        }
    }

    pub(super) fn noted_rate_hz(&self) -> Result<Option<f64>, ReadError> {
        let Some(text) = self.notes.get("rate_hz") else {
            return Ok(None);
        };
        match text.parse::<f64>() {
            Ok(rate) if rate.is_finite() && rate > 0.0 => Ok(Some(rate)),
            _ => Err(self.error(1, format!("the rate {text:?} is no number above 0"))),
        }
    }

    pub(in crate::recording) fn rate_hz(&self) -> Result<f64, ReadError> {
        match self.noted_rate_hz()? {
            Some(rate_hz) => Ok(rate_hz),
            None => self
                .timing(&(0..self.lines.len()).collect::<Vec<_>>())
                .map(|(rate_hz, _)| rate_hz),
        }
    }

    /// The rate and start of the samples in these rows.
    pub(super) fn timing(&self, rows: &[usize]) -> Result<(f64, f64), ReadError> {
        let times = self.needed("time")?;
        let (Some(&first), Some(&last)) = (rows.first(), rows.last()) else {
            return Err(self.error(self.header_line, "there are no samples"));
        };
        if let Some(&row) = rows.iter().find(|&&row| times[row].is_nan()) {
            return Err(self.error(self.lines[row], "time is missing"));
        }
        let start = times[first];
        let rate = (rows.len() - 1) as f64 / (times[last] - start);
        if !(rate.is_finite() && rate > 0.0) {
            return Err(self.error(
                self.lines[last],
                "time must ascend, and there must be two samples at least",
            ));
        }
        // Times are rounded when written, rates are round numbers.
        let round = rate.round();
        let rate = if round > 0.0 && (rate / round - 1.0).abs() < 1e-5 {
            round
        } else {
            rate
        };
        for (i, &row) in rows.iter().enumerate() {
            let expected = start + i as f64 / rate;
            if (times[row] - expected).abs() > 0.25 / rate {
                let message = format!(
                    "time jumps: {} s where {expected} s is expected at an even rate of {rate} Hz",
                    times[row]
                );
                return Err(self.error(self.lines[row], message));
            }
        }
        Ok((rate, start))
    }

    /// Samples of columns that belong together, from the rows where they are not empty.
    pub(super) fn sensor(&self, names: &[&str]) -> Result<Series<Vec<f64>>, ReadError> {
        let columns: Vec<&[f64]> = names
            .iter()
            .map(|name| self.needed(name))
            .collect::<Result<_, _>>()?;
        let mut rows = vec![];
        for row in 0..self.lines.len() {
            let there = columns.iter().filter(|column| !column[row].is_nan()).count();
            if there == names.len() {
                rows.push(row);
            } else if there > 0 {
                let message = format!("{} must all be there or all be empty", names.join(", "));
                return Err(self.error(self.lines[row], message));
            }
        }
        let (rate_hz, start_s) = match self.noted_rate_hz()? {
            Some(rate_hz) if !self.has("time") => (rate_hz, 0.0),
            _ => self.timing(&rows)?,
        };
        let samples = rows
            .iter()
            .map(|&row| columns.iter().map(|column| column[row]).collect())
            .collect();
        Ok(Series {
            rate_hz,
            start_s,
            samples,
        })
    }
}

/// Lines `# key: value`.
pub(in crate::recording) fn notes(bytes: &[u8]) -> BTreeMap<String, String> {
    let lines = bytes
        .split(|&b| b == b'\n')
        .take_while(|line| line.starts_with(b"#"));
    lines
        .filter_map(|line| {
            let text = String::from_utf8_lossy(&line[1..]);
            let (key, value) = text.split_once(':')?;
            Some((key.trim().to_owned(), value.trim().to_owned()))
        })
        .collect()
}

/// The number in a cell. Quotes behind a space are none to the parser of rows, and are taken off here.
pub(in crate::recording) fn number(cell: &[u8], scale: Scale) -> Option<f64> {
    let text = unquoted(std::str::from_utf8(cell).ok()?);
    let value = match scale {
        Scale::One => text.parse().ok()?,
        Scale::Thousandth => parse_thousandth(text)?,
        Scale::StandardGravity => text.parse::<f64>().ok()? * 9.80665,
    };
    value.is_finite().then_some(value)
}

/// The line that a row stands on. The parser's own count is of where it began to look: before the line feed of a Windows line end, empty
/// lines and comments.
pub(in crate::recording) fn line_of(bytes: &[u8], position: Option<&csv::Position>) -> u64 {
    let Some(position) = position else { return 1 };
    let start = usize::try_from(position.byte()).unwrap_or(usize::MAX);
    let mut rest = bytes.get(start..).unwrap_or_default();
    let mut line = position.line();
    loop {
        let end = rest.iter().position(|&byte| byte == b'\n');
        let passed_over = |row: &[u8]| row.starts_with(b"#") || row.trim_ascii().is_empty();
        match end.filter(|&end| passed_over(&rest[..end])) {
            Some(end) => {
                rest = &rest[end + 1..];
                line += 1;
            }
            None => return line,
        }
    }
}

/// A name or number without the quotes around it.
pub(in crate::recording) fn unquoted(text: &str) -> &str {
    let inner = text.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
    inner.unwrap_or(text).trim()
}

/// Text without the byte order mark that Windows programs put first.
pub(in crate::recording) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// `column` counts from 0.
pub(in crate::recording) fn not_a_number(line: u64, column: usize, name: &str, cell: &[u8]) -> ReadError {
    let start: String = String::from_utf8_lossy(cell).chars().take(20).collect();
    let message = match start.is_empty() {
        true => format!("the cell of {name} is empty"),
        false => format!("{start:?} in {name} is no finite number"),
    };
    ReadError::CsvCell {
        line,
        column: column + 1,
        message,
    }
}

pub(in crate::recording) fn csv_error(error: &csv::Error) -> ReadError {
    ReadError::Csv {
        line: error.position().map_or(1, csv::Position::line),
        message: match error.kind() {
            csv::ErrorKind::UnequalLengths {
                expected_len, len, ..
            } => {
                format!("the row has {len} cells where the header has {expected_len}")
            }
            _ => error.to_string(),
        },
    }
}
