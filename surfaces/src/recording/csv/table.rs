//! Rows and columns, with every cell's place for those who have to mend it.

use super::super::import::{
    Finding, ImportSettings, Timing, interpolate_missing, remove_outliers, resampled, timing,
};
use super::super::rows::{Head, Row, Rows};
use super::super::{ReadError, RecordingError, Series};
use super::units::{Scale, parse_name, parse_unit, plain_name, unit_at_end};
use crate::files::decimal::parse_thousandth;
use std::collections::BTreeMap;
use std::io::BufRead;

/// At most so many rows of acceleration in a stretch are interpolated, ...
const LONGEST_REPAIR: usize = 5;
/// ... of quantities that change more slowly, so long a stretch, s.
const LONGEST_SLOW_REPAIR_S: f64 = 0.05;
/// More unreadable cells than this part of a column are no accidents.
const MOST_UNREADABLE: f64 = 0.01;
/// Tables of this many rows or fewer may have one nevertheless.
const FEW_ROWS: usize = 100;

/// The columns that are understood, in SI. Cells that were empty are NaN, cells that could not be read infinite.
pub(in crate::recording) struct Table {
    /// Which of a take's files it is.
    pub(in crate::recording) file: usize,
    pub(super) header_line: u64,
    pub(super) notes: BTreeMap<String, String>,
    pub(super) findings: Vec<Finding>,
    /// All columns of the file.
    names: Vec<String>,
    columns: Vec<Column>,
    lines: Lines,
    strict: bool,
    given_rate_hz: Option<f64>,
}

struct Column {
    /// Without unit.
    name: String,
    /// In the file, from 1.
    number: usize,
    values: Vec<f64>,
    unreadable: usize,
}

/// The line of each row, kept where they do not simply follow.
#[derive(Default)]
pub(in crate::recording) struct Lines {
    rows: usize,
    /// (row, line) from which on lines follow.
    jumps: Vec<(usize, u64)>,
}

impl Lines {
    pub fn push(&mut self, line: u64) {
        let follows = self
            .jumps
            .last()
            .is_some_and(|(row, first)| first + (self.rows - row) as u64 == line);
        if !follows {
            self.jumps.push((self.rows, line));
        }
        self.rows += 1;
    }

    pub fn rows(&self) -> usize {
        self.rows
    }

    pub fn of(&self, row: usize) -> u64 {
        let after = self.jumps.partition_point(|(first, _)| *first <= row);
        let jump = after.checked_sub(1).and_then(|index| self.jumps.get(index));
        jump.map_or(1, |(first, line)| line + (row - first) as u64)
    }
}

/// A table that was not text: NaN for empty cells, infinite for unreadable ones.
#[derive(Default)]
pub(in crate::recording) struct Cells {
    pub header_line: u64,
    pub names: Vec<String>,
    pub notes: BTreeMap<String, String>,
    pub columns: Vec<Vec<f64>>,
    pub lines: Lines,
}

/// What is wrong, and with which of a take's files.
#[derive(Debug)]
pub(in crate::recording) struct Fault {
    pub file: usize,
    pub error: ReadError,
}

/// What is wrong with a take as a whole is told of its first file.
impl From<ReadError> for Fault {
    fn from(error: ReadError) -> Self {
        Self { file: 0, error }
    }
}

impl From<RecordingError> for Fault {
    fn from(error: RecordingError) -> Self {
        ReadError::from(error).into()
    }
}

/// Samples of several columns at an even rate.
pub(in crate::recording) struct Even {
    pub rate_hz: f64,
    pub start_s: f64,
    pub columns: Vec<Vec<f64>>,
}

impl Table {
    pub(in crate::recording) fn read(
        source: impl BufRead,
        import: &ImportSettings,
    ) -> Result<Self, ReadError> {
        let (mut rows, head) = Rows::new(source)?;
        let (wanted, mut table) = Self::empty(head, import)?;
        let mut first_unreadable = None;
        while let Some(row) = rows.next()? {
            let line = row.line;
            let columns = table.names.len();
            if row.cells() > columns || (row.cells() < columns && import.strict) {
                return Err(unequal(&row, columns));
            }
            table.lines.push(line);
            for (&(index, scale), column) in wanted.iter().zip(&mut table.columns) {
                let cell = row.cell(index);
                column.values.push(match cell {
                    b"" => f64::NAN,
                    cell => number(cell, scale).unwrap_or_else(|| {
                        column.unreadable += 1;
                        let error = not_a_number(line, index, &column.name, cell);
                        first_unreadable.get_or_insert(error);
                        f64::INFINITY
                    }),
                });
            }
        }
        table.checked(first_unreadable, import)
    }

    /// No rows yet.
    fn empty(head: Head, import: &ImportSettings) -> Result<(Vec<Wanted>, Self), ReadError> {
        let (wanted, columns) = choose(&head, import)?;
        let table = Self {
            file: 0,
            header_line: head.line,
            notes: head.notes,
            names: head.names,
            findings: vec![],
            columns,
            lines: Lines::default(),
            strict: import.strict,
            given_rate_hz: import.rate_hz,
        };
        Ok((wanted, table))
    }

    pub(in crate::recording) fn of_cells(
        mut cells: Cells,
        import: &ImportSettings,
    ) -> Result<Self, ReadError> {
        let head = Head {
            line: cells.header_line.max(1),
            names: cells.names,
            notes: cells.notes,
        };
        let (wanted, mut table) = Self::empty(head, import)?;
        table.lines = cells.lines;
        let mut first_unreadable = None;
        for (&(index, scale), column) in wanted.iter().zip(&mut table.columns) {
            column.values = std::mem::take(&mut cells.columns[index]);
            for (row, value) in column.values.iter_mut().enumerate() {
                if value.is_infinite() {
                    column.unreadable += 1;
                    let error = ReadError::CsvCell {
                        line: table.lines.of(row),
                        column: index + 1,
                        message: format!("the cell of {} holds no number", column.name),
                    };
                    first_unreadable.get_or_insert(error);
                }
                *value = scale.si(*value);
            }
        }
        table.checked(first_unreadable, import)
    }

    /// The table, unless more is unreadable than accidents explain.
    fn checked(
        mut self,
        first_unreadable: Option<ReadError>,
        import: &ImportSettings,
    ) -> Result<Self, ReadError> {
        let rows = self.lines.rows();
        let allowed =
            ((rows as f64 * MOST_UNREADABLE) as usize).max(usize::from(rows > 1 && rows <= FEW_ROWS));
        let too_many = self.columns.iter().any(|column| column.unreadable > allowed);
        match first_unreadable {
            Some(error) if import.strict || too_many => Err(error),
            _ => {
                self.fill_constants(&import.constants);
                Ok(self)
            }
        }
    }

    fn fill_constants(&mut self, constants: &BTreeMap<String, f64>) {
        for (name, &value) in constants {
            self.columns.retain(|column| column.name != *name);
            self.columns.push(Column {
                name: name.clone(),
                number: 1,
                values: vec![value; self.lines.rows()],
                unreadable: 0,
            });
        }
    }

    fn error(&self, line: u64, message: impl ToString) -> ReadError {
        ReadError::Csv {
            line,
            message: message.to_string(),
        }
    }

    pub(super) fn fault(&self, line: u64, message: impl ToString) -> Fault {
        self.at_fault(self.error(line, message))
    }

    fn at_fault(&self, error: ReadError) -> Fault {
        Fault {
            file: self.file,
            error,
        }
    }

    pub(in crate::recording) fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|column| column.name == name)
    }

    fn needed(&self, name: &str) -> Result<usize, ReadError> {
        let found = self.columns.iter().position(|column| column.name == name);
        found.ok_or_else(|| {
            let known: Vec<_> = self.columns.iter().map(|column| &column.name[..]).collect();
            let known = match known.is_empty() {
                true => "none".to_owned(),
                false => known.join(", "),
            };
            let message = match name {
                "time" => format!(
                    "nothing says how fast the samples follow one another; understood were: {known}; give the rate \
                     (--sample-rate HZ), a column time_s, or in a MATLAB file a number fs"
                ),
                _ => format!(
                    "a column of {name} is missing; understood were: {known}; rename the column, or say which it is (--column)"
                ),
            };
            self.error(self.header_line, message)
        })
    }

    fn rate_without_times(&self) -> Result<Option<f64>, ReadError> {
        match self.given_rate_hz {
            Some(rate_hz) => Ok(Some(rate_hz)),
            None if self.has("time") => Ok(None),
            None => noted_rate_hz(&self.notes),
        }
    }

    /// The rate and start of the samples in these rows, with their times.
    fn timing(&self, rows: Option<&[usize]>) -> Result<(Timing, Vec<f64>), ReadError> {
        if let Some(rate_hz) = self.rate_without_times()? {
            let timing = Timing {
                rate_hz,
                start_s: 0.0,
                is_uneven: false,
                finding: None,
            };
            return Ok((timing, vec![]));
        }
        let all = &self.columns[self.needed("time")?].values;
        let mut times = match rows {
            Some(rows) => rows.iter().map(|&row| all[row]).collect(),
            None => all.clone(),
        };
        let line = |index: usize| {
            self.lines
                .of(rows.map_or(index, |rows| rows.get(index).copied().unwrap_or(0)))
        };
        let longest = if self.strict { 0 } else { LONGEST_REPAIR };
        interpolate_missing(&mut times, longest)
            .map_err(|at| self.error(line(at.start), "time is missing"))?;
        let found =
            timing(&times, self.strict).map_err(|(index, message)| self.error(line(index), message))?;
        Ok((found, times))
    }

    /// The samples of columns without empty cells, which are taken out of the table.
    pub(super) fn take(&mut self, names: &[&str]) -> Result<Even, Fault> {
        self.taken(names).map_err(|error| self.at_fault(error))
    }

    fn taken(&mut self, names: &[&str]) -> Result<Even, ReadError> {
        let places: Vec<usize> = names
            .iter()
            .map(|name| self.needed(name))
            .collect::<Result<_, _>>()?;
        let (timing, times) = self.timing(None)?;
        let mut columns = vec![];
        for (name, place) in names.iter().zip(places) {
            let mut values = std::mem::take(&mut self.columns[place].values);
            self.repair(name, place, &mut values, timing.rate_hz)?;
            columns.push(match timing.is_uneven {
                true => resampled(&times, &values, &timing, name.starts_with("accel")),
                false => values,
            });
        }
        self.findings.extend(timing.finding);
        Ok(Even {
            rate_hz: timing.rate_hz,
            start_s: timing.start_s,
            columns,
        })
    }

    fn repair(
        &mut self,
        name: &str,
        place: usize,
        values: &mut [f64],
        rate_hz: f64,
    ) -> Result<(), ReadError> {
        let Column {
            number, unreadable, ..
        } = self.columns[place];
        let at = |row: usize, message: String| ReadError::CsvCell {
            line: self.lines.of(row),
            column: number,
            message,
        };
        if self.strict {
            return match values.iter().position(|x| x.is_nan()) {
                Some(row) => Err(self.error(self.lines.of(row), format!("{name} is missing"))),
                None => Ok(()),
            };
        }
        let longest = match name.starts_with("accel") {
            true => LONGEST_REPAIR,
            false => ((LONGEST_SLOW_REPAIR_S * rate_hz).ceil() as usize).max(LONGEST_REPAIR),
        };
        let of = values.len();
        let count = interpolate_missing(values, longest).map_err(|missing| {
            let rows = missing.len();
            at(
                missing.start,
                format!("{name} is missing in {rows} rows from here on; at most {longest} can be interpolated: cut the file here"),
            )
        })?;
        let outliers = remove_outliers(values).len();
        let quantity = name.to_owned();
        if count > 0 {
            let empty = count.saturating_sub(unreadable);
            self.findings.push(Finding::Interpolated {
                quantity: quantity.clone(),
                unreadable,
                empty,
                of,
            });
        }
        if outliers > 0 {
            self.findings.push(Finding::Outliers {
                quantity,
                count: outliers,
            });
        }
        Ok(())
    }

    /// Samples of columns that belong together, from the rows where they are not empty.
    pub(super) fn sensor(&mut self, names: &[&str]) -> Result<Series<Vec<f64>>, Fault> {
        self.sensed(names).map_err(|error| self.at_fault(error))
    }

    fn sensed(&mut self, names: &[&str]) -> Result<Series<Vec<f64>>, ReadError> {
        let places: Vec<usize> = names
            .iter()
            .map(|name| self.needed(name))
            .collect::<Result<_, _>>()?;
        let mut rows = vec![];
        for row in 0..self.lines.rows() {
            let there = places
                .iter()
                .filter(|&&place| !self.columns[place].values[row].is_nan())
                .count();
            if there == names.len() {
                rows.push(row);
            } else if there > 0 {
                let message = format!("{} must all be there or all be empty", names.join(", "));
                return Err(self.error(self.lines.of(row), message));
            }
        }
        let (timing, times) = self.timing(Some(&rows))?;
        let mut columns = vec![];
        for (name, &place) in names.iter().zip(&places) {
            let mut values: Vec<f64> = rows.iter().map(|&row| self.columns[place].values[row]).collect();
            let unreadable =
                interpolate_missing(&mut values, LONGEST_REPAIR).map_err(|at| ReadError::CsvCell {
                    line: self.lines.of(rows[at.start]),
                    column: self.columns[place].number,
                    message: format!("{name} cannot be read in {} rows from here on", at.len()),
                })?;
            let quantity = (*name).to_owned();
            if unreadable > 0 {
                let (empty, of) = (0, values.len());
                self.findings.push(Finding::Interpolated {
                    quantity,
                    unreadable,
                    empty,
                    of,
                });
            }
            columns.push(match timing.is_uneven {
                true => resampled(&times, &values, &timing, name.starts_with("accel")),
                false => values,
            });
        }
        self.findings.extend(timing.finding);
        let samples = columns.first().map_or(0, Vec::len);
        Ok(Series {
            rate_hz: timing.rate_hz,
            start_s: timing.start_s,
            samples: (0..samples)
                .map(|i| columns.iter().map(|column| column[i]).collect())
                .collect(),
        })
    }
}

/// Index and scale of a column to read.
type Wanted = (usize, Scale);

/// The columns to read: those that are mapped, and those whose names are ours.
fn choose(head: &Head, import: &ImportSettings) -> Result<(Vec<Wanted>, Vec<Column>), ReadError> {
    let mut wanted = vec![];
    let mut columns: Vec<Column> = vec![];
    for (index, name) in head.names.iter().enumerate() {
        let wrong = |message| ReadError::CsvCell {
            line: head.line,
            column: index + 1,
            message,
        };
        let Some((plain, scale)) = understood(name, import).transpose().map_err(wrong)? else {
            continue;
        };
        if columns.iter().any(|known| known.name == plain) {
            return Err(wrong(format!("this is a second column of {plain}")));
        }
        wanted.push((index, scale));
        columns.push(Column {
            name: plain,
            number: index + 1,
            values: vec![],
            unreadable: 0,
        });
    }
    Ok((wanted, columns))
}

/// Columns that are asked for have to be in one of the tables.
pub(in crate::recording) fn check_mapping(
    tables: &[Table],
    import: &ImportSettings,
) -> Result<(), ReadError> {
    let names: Vec<&str> = tables
        .iter()
        .flat_map(|table| &table.names)
        .map(String::as_str)
        .collect();
    match import
        .columns
        .values()
        .find(|column| !names.contains(&column.as_str()))
    {
        Some(column) => Err(ReadError::Csv {
            line: tables.first().map_or(1, |table| table.header_line),
            message: format!("there is no column {column:?}; there are {}", names.join(", ")),
        }),
        None => Ok(()),
    }
}

/// What a column is by the settings, or else by its name.
fn understood(name: &str, import: &ImportSettings) -> Option<Result<(String, Scale), String>> {
    let unit_of = |plain: &str| {
        // The unit of `accel` is that of its axes too.
        let whole = plain.split('_').next().unwrap_or(plain);
        import.units.get(plain).or_else(|| import.units.get(whole))
    };
    if let Some((plain, _)) = import.columns.iter().find(|(_, column)| *column == name) {
        let scale = match unit_of(plain) {
            Some(unit) => parse_unit(plain, unit),
            None => unit_at_end(name, plain).ok_or_else(|| {
                format!("the unit of {plain} in column {name:?} is not known; say it (--unit)")
            }),
        };
        return Some(scale.map(|scale| (plain.clone(), scale)));
    }
    let lower = name.to_ascii_lowercase();
    let (plain, _) = plain_name(&lower)?;
    // What is mapped elsewhere counts, and not what is called so.
    if import.columns.contains_key(&plain) || import.constants.contains_key(&plain) {
        return None;
    }
    match unit_of(&plain) {
        Some(unit) => Some(parse_unit(&plain, unit).map(|scale| (plain, scale))),
        None => parse_name(&lower),
    }
}

/// The rate of a line `# rate_hz: ...`.
pub(in crate::recording) fn noted_rate_hz(
    notes: &BTreeMap<String, String>,
) -> Result<Option<f64>, ReadError> {
    let Some(text) = notes.get("rate_hz") else {
        return Ok(None);
    };
    match text.parse::<f64>() {
        Ok(rate) if rate.is_finite() && rate > 0.0 => Ok(Some(rate)),
        _ => Err(ReadError::Csv {
            line: 1,
            message: format!("the rate {text:?} is no number above 0"),
        }),
    }
}

/// The number in a cell; with a comma for the point where no comma separates the cells.
pub(in crate::recording) fn number(cell: &[u8], scale: Scale) -> Option<f64> {
    let text = std::str::from_utf8(cell).ok()?;
    let value = match text.bytes().filter(|&byte| byte == b',').count() {
        0 => scaled(text, scale)?,
        1 if !text.contains('.') => scaled(&text.replace(',', "."), scale)?,
        _ => return None,
    };
    value.is_finite().then_some(value)
}

/// The number in a text, whatever its unit.
#[cfg(all(feature = "spreadsheets", not(target_family = "wasm")))]
pub(in crate::recording) fn number_of(text: &str) -> Option<f64> {
    number(text.trim().as_bytes(), Scale::One)
}

fn scaled(text: &str, scale: Scale) -> Option<f64> {
    match scale {
        Scale::One => text.parse().ok(),
        Scale::Thousandth => parse_thousandth(text),
        Scale::Factor(factor) => Some(text.parse::<f64>().ok()? * factor),
    }
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

pub(in crate::recording) fn unequal(row: &Row<'_>, expected: usize) -> ReadError {
    ReadError::Csv {
        line: row.line,
        message: format!(
            "the row has {} cells where the header has {expected}",
            row.cells()
        ),
    }
}
