//! Tables of rows and columns. Each cell keeps its location in the file for error messages.

use super::super::import::{
    BadCell, Finding, ImportSettings, Timing, clipped, interpolate_missing, remove_offset, remove_outliers,
    resampled, timing,
};
use super::super::rows::{Head, Row, Rows, listed};
use super::super::{ReadError, RecordingError, Series};
use super::alias::{is_like_ours, taken_as};
use super::clock::Clock;
use super::hints::hints;
use super::units::{QUANTITIES, Scale, is_of, parse_unit, plain_name, unit_in_file, unit_of_column};
use crate::files::decimal::parse_thousandth;
use haptograph_signal::quantity::Quantity;
use std::collections::BTreeMap;
use std::io::BufRead;

/// Longest run of missing acceleration rows that is interpolated.
const LONGEST_REPAIR: usize = 5;
/// Longest run of missing values that is interpolated for slower quantities, s.
const LONGEST_SLOW_REPAIR_S: f64 = 0.05;
/// A larger fraction of unreadable cells in a column is an error.
const MOST_UNREADABLE: f64 = 0.01;
/// Tables of at most this many rows may always have one unreadable cell.
const FEW_ROWS: usize = 100;
/// Plausible rates of a vibration, Hz: outside them the time column has the wrong unit.
const RATES_HZ: [f64; 2] = [100.0, 1e6];

/// Which columns of a table are read.
#[derive(Debug, Clone, Copy)]
pub(in crate::recording) enum ColumnSelection<'a> {
    /// The columns of a recording.
    Recording,
    /// Time, and the column of this name; without a name, the acceleration or the only other column.
    Signal(Option<&'a str>),
    /// The column of this name, without unit conversion.
    Unscaled(&'a str),
    /// Time, current and acceleration of an actuator.
    Sweep,
}

/// The known columns, in SI. Empty cells are NaN; unreadable cells are infinite.
pub(in crate::recording) struct Table {
    /// Index of the file in the take.
    pub(in crate::recording) file: usize,
    /// The file's name.
    pub(in crate::recording) label: String,
    pub(super) header_line: u64,
    pub(super) notes: BTreeMap<String, String>,
    pub(in crate::recording) findings: Vec<Finding>,
    /// All columns of the file.
    pub(super) names: Vec<String>,
    /// Of the row below the header; may be empty.
    pub(super) units: Vec<String>,
    /// Whether the file has lines (or rows of a sheet) that a message can name.
    has_lines: bool,
    columns: Vec<Column>,
    lines: Lines,
    strict: bool,
    /// Whether the unit of the acceleration is known.
    knows_unit: bool,
    given_rate_hz: Option<f64>,
    clock: Clock,
    time_scale: Scale,
    /// What to say of the times where they turn out to be numbers.
    time_without_unit: Option<String>,
    /// From the origin that all files of a take share to this one's, s.
    since_s: f64,
}

struct Column {
    /// Name without unit.
    name: String,
    /// Name in the file.
    header: String,
    /// Number in the file, from 1.
    number: usize,
    /// SI unit of a column that is not a known quantity.
    unit: Option<&'static str>,
    values: Vec<f64>,
    unreadable: usize,
    first_unreadable: Option<BadCell>,
}

/// The line of each row; stores only the rows whose line does not follow the previous one.
#[derive(Default)]
pub(in crate::recording) struct Lines {
    rows: usize,
    /// (row, line) where a run of consecutive lines begins.
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

/// The cells of a table that is not text: NaN if empty, infinite if unreadable.
#[derive(Default)]
pub(in crate::recording) struct Cells {
    /// 0 if the table has no lines.
    pub header_line: u64,
    pub names: Vec<String>,
    /// Units in the row below the names; may be empty.
    pub units: Vec<String>,
    pub notes: BTreeMap<String, String>,
    pub columns: Vec<Vec<f64>>,
    pub lines: Lines,
    /// Columns of another length, with that length.
    pub others: Vec<(String, usize)>,
}

/// An error, with the index of the file in the take.
#[derive(Debug)]
pub(in crate::recording) struct Fault {
    pub file: usize,
    pub error: ReadError,
}

/// An error of a whole take is reported for its first file.
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
        wanted: ColumnSelection<'_>,
    ) -> Result<Self, ReadError> {
        let (mut rows, head) = Rows::new(source, &|name| is_wanted(name, import, wanted))?;
        let (chosen, mut table) = Self::empty(head, import, wanted)?;
        while let Some(row) = rows.next()? {
            let line = row.line;
            let columns = table.names.len();
            if row.cells() > columns || (row.cells() < columns && import.strict) {
                return Err(unequal(&row, columns));
            }
            table.lines.push(line);
            for (&(index, scale), column) in chosen.iter().zip(&mut table.columns) {
                let cell = row.cell(index);
                let value = match (cell, &*column.name) {
                    (b"", _) => Some(f64::NAN),
                    (cell, TIME) => table.clock.seconds(cell, scale),
                    (cell, _) => number(cell, scale),
                };
                column.values.push(value.unwrap_or_else(|| {
                    column.unreadable += 1;
                    column.first_unreadable.get_or_insert_with(|| BadCell {
                        line,
                        column: index + 1,
                        text: Some(String::from_utf8_lossy(cell).chars().take(20).collect()),
                    });
                    f64::INFINITY
                }));
            }
        }
        table.checked(import)
    }

    /// No rows yet.
    fn empty(
        head: Head,
        import: &ImportSettings,
        wanted: ColumnSelection<'_>,
    ) -> Result<(Vec<Chosen>, Self), ReadError> {
        let mut table = Self {
            file: 0,
            label: String::new(),
            header_line: head.line,
            has_lines: head.line > 0,
            notes: head.notes,
            names: head.names,
            units: head.units,
            findings: vec![],
            columns: vec![],
            lines: Lines::default(),
            strict: import.strict,
            knows_unit: import.units.get("accel").is_none_or(|unit| unit != "1"),
            given_rate_hz: import.rate_hz,
            clock: Clock::default(),
            time_scale: Scale::One,
            time_without_unit: None,
            since_s: 0.0,
        };
        let chosen = table.choose(import, wanted)?;
        Ok((chosen, table))
    }

    pub(in crate::recording) fn of_cells(
        mut cells: Cells,
        import: &ImportSettings,
        wanted: ColumnSelection<'_>,
    ) -> Result<Self, ReadError> {
        let head = Head {
            line: cells.header_line,
            names: cells.names,
            units: cells.units,
            notes: cells.notes,
        };
        if let Some((name, length)) = cells
            .others
            .iter()
            .find(|(name, _)| is_wanted(name, import, wanted))
        {
            let longest = head.names.iter().find(|name| is_wanted(name, import, wanted));
            let longest = longest.or(head.names.first()).map_or("another", String::as_str);
            return Err(ReadError::Io(format!(
                "variable {name} has {length} values, {longest} has {}; all need the same length",
                cells.lines.rows()
            )));
        }
        let (chosen, mut table) = Self::empty(head, import, wanted)?;
        let others = cells.others.into_iter();
        table
            .names
            .extend(others.map(|(name, length)| format!("{name} ({length} values)")));
        table.lines = cells.lines;
        for (&(index, scale), column) in chosen.iter().zip(&mut table.columns) {
            column.values = std::mem::take(&mut cells.columns[index]);
            for (row, value) in column.values.iter_mut().enumerate() {
                if value.is_infinite() {
                    column.unreadable += 1;
                    column.first_unreadable.get_or_insert_with(|| BadCell {
                        line: table.lines.of(row),
                        column: index + 1,
                        text: None,
                    });
                }
                *value = scale.si(*value);
            }
        }
        table.checked(import)
    }

    /// Returns the table, unless too many cells are unreadable.
    fn checked(mut self, import: &ImportSettings) -> Result<Self, ReadError> {
        if let Some(message) = self
            .time_without_unit
            .take()
            .filter(|_| !self.clock.is_calendar())
        {
            let number = { self.columns.iter() }
                .find(|column| column.name == TIME)
                .map_or(1, |column| column.number);
            return Err(self.cell_error(self.header_line, number, message));
        }
        let rows = self.lines.rows();
        let allowed =
            ((rows as f64 * MOST_UNREADABLE) as usize).max(usize::from(rows > 1 && rows <= FEW_ROWS));
        let refused = |column: &&Column| column.unreadable > if import.strict { 0 } else { allowed };
        if let Some(column) = self.columns.iter().find(refused)
            && let Some(cell) = &column.first_unreadable
        {
            let what = match &cell.text {
                Some(text) => format!("{text:?} in {} is not a finite number", column.header),
                None => format!("the cell of {} is not a number", column.header),
            };
            let message = match import.strict {
                true => what,
                false => format!(
                    "{what}; {} of {rows} cells of this column are unreadable; at most 1 in 100 may be",
                    column.unreadable
                ),
            };
            return Err(self.cell_error(cell.line, column.number, message));
        }
        Ok(self)
    }

    /// Adds a quantity that does not change, in the place of a column of that name.
    pub(super) fn set_constant(&mut self, name: &str, value: f64) {
        self.remove(name);
        self.columns.push(Column {
            values: vec![value; self.lines.rows()],
            // In no column of the file.
            number: 0,
            ..Column::new(name.to_owned(), name, 0)
        });
    }

    pub(super) fn remove(&mut self, name: &str) {
        self.columns.retain(|column| column.name != name);
    }

    /// Whether the unit of the acceleration is known: not where `--unit accel=1` says that it is not.
    pub(in crate::recording) fn knows_unit(&self) -> bool {
        self.knows_unit
    }

    /// Takes a vibration on one axis as unprocessed where it has a mean that no processed one has.
    pub(in crate::recording) fn take_offset(
        &mut self,
        column: &str,
        has_unit: bool,
        values: &mut Vec<f64>,
        rate_hz: f64,
    ) -> Result<(), ReadError> {
        let Some(found) = remove_offset(column, has_unit, values, rate_hz) else {
            return Ok(());
        };
        if self.strict {
            let message = format!("{found}, unless nothing may be repaired, as here (--strict)");
            return Err(self.error(self.header_line, message));
        }
        self.findings.push(found);
        Ok(())
    }

    /// Where the times count from, s; `None` where there are none, or nothing that they are the times of.
    pub(super) fn origin_s(&self) -> Option<f64> {
        let counts = self.has(TIME) && self.columns.len() > 1 && self.lines.rows() > 0;
        counts.then(|| self.clock.origin_s(self.time_scale))
    }

    /// Counts the times from an origin of several tables.
    pub(super) fn count_from(&mut self, origin_s: f64) {
        self.since_s = self.origin_s().map_or(0.0, |own| own - origin_s);
    }

    fn error(&self, line: u64, message: impl ToString) -> ReadError {
        let message = message.to_string();
        match self.has_lines {
            true => ReadError::Csv { line, message },
            false if line == self.header_line => ReadError::Io(message),
            false => ReadError::Io(format!("sample {line} (from 1): {message}")),
        }
    }

    /// `column` counts from 1.
    fn cell_error(&self, line: u64, column: usize, message: String) -> ReadError {
        match self.has_lines {
            true => ReadError::CsvCell {
                line,
                column,
                message,
            },
            false => self.error(line, message),
        }
    }

    pub(super) fn fault(&self, line: u64, message: impl ToString) -> Fault {
        self.at_fault(self.error(line, message))
    }

    pub(super) fn at_fault(&self, error: ReadError) -> Fault {
        Fault {
            file: self.file,
            error,
        }
    }

    pub(in crate::recording) fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|column| column.name == name)
    }

    /// The name of a column in the file.
    pub(super) fn header_of(&self, name: &str) -> Option<&str> {
        let found = self.columns.iter().find(|column| column.name == name);
        found.map(|column| &*column.header)
    }

    /// Those of these columns that there are, with what they are called in the file.
    pub(super) fn columns_of(&self, names: &[&'static str]) -> Vec<(&'static str, String)> {
        let header = |name: &&'static str| Some((*name, self.header_of(name)?.to_owned()));
        names.iter().filter_map(header).collect()
    }

    fn needed(&self, name: &str) -> Result<usize, ReadError> {
        let found = self.columns.iter().position(|column| column.name == name);
        found.ok_or_else(|| missing_columns(&[self], vec![name.to_owned()]))
    }

    /// Whether neither times nor a rate are known.
    pub(super) fn lacks_rate(&self) -> bool {
        !self.has("time") && self.given_rate_hz.is_none() && !self.notes.contains_key("rate_hz")
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
        let mut found =
            timing(&times, self.strict).map_err(|(index, message)| self.error(line(index), message))?;
        found.start_s += self.since_s;
        Ok((found, times))
    }

    /// The samples of columns without empty cells, which are taken out of the table.
    pub(in crate::recording) fn take(&mut self, names: &[&str]) -> Result<Even, Fault> {
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
            self.inspect(name, &values, &timing);
            self.repair(name, place, &mut values, timing.rate_hz)?;
            columns.push(match timing.is_uneven {
                true => resampled(&times, &values, &timing, is_vibration(name)),
                false => values,
            });
        }
        // Of several columns that are taken one after another.
        let found = timing.finding.filter(|finding| !self.findings.contains(finding));
        self.findings.extend(found);
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
            number,
            unreadable,
            ref first_unreadable,
            ..
        } = self.columns[place];
        let first = first_unreadable.clone().filter(|_| self.has_lines);
        let at = |row: usize, message: String| self.cell_error(self.lines.of(row), number, message);
        if self.strict {
            return match values.iter().position(|x| x.is_nan()) {
                Some(row) if name != SIGNAL => {
                    Err(self.error(self.lines.of(row), format!("{name} is missing")))
                }
                _ => self.refuse_empty(place, values),
            };
        }
        let longest = match is_vibration(name) {
            true => LONGEST_REPAIR,
            false => ((LONGEST_SLOW_REPAIR_S * rate_hz).ceil() as usize).max(LONGEST_REPAIR),
        };
        let of = values.len();
        let count = interpolate_missing(values, longest).map_err(|missing| {
            let rows = missing.len();
            at(
                missing.start,
                format!("{name} is missing in {rows} rows from here on; at most {longest} can be interpolated; cut the file here"),
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
                first,
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

    /// Adds findings about a vibration that no repair can correct.
    fn inspect(&mut self, name: &str, values: &[f64], timing: &Timing) {
        if !is_vibration(name) {
            return;
        }
        if self.given_rate_hz.is_none()
            && !self.clock.is_calendar()
            && let Some(time) = self.header_of("time")
            && !(RATES_HZ[0]..=RATES_HZ[1]).contains(&timing.rate_hz)
        {
            let finding = Finding::StrangeRate {
                column: time.to_owned(),
                rate_hz: timing.rate_hz,
            };
            if !self.findings.contains(&finding) {
                self.findings.push(finding);
            }
        }
        let count = clipped(values);
        if count > 0 {
            self.findings.push(Finding::Clipped {
                quantity: name.to_owned(),
                count,
                of: values.len(),
            });
        }
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
                let message = format!("{} must all have values or all be empty", names.join(", "));
                return Err(self.error(self.lines.of(row), message));
            }
        }
        let (timing, times) = self.timing(Some(&rows))?;
        let mut columns = vec![];
        for (name, &place) in names.iter().zip(&places) {
            let mut values: Vec<f64> = rows.iter().map(|&row| self.columns[place].values[row]).collect();
            self.inspect(name, &values, &timing);
            let unreadable = interpolate_missing(&mut values, LONGEST_REPAIR).map_err(|at| {
                let message = format!("{name} is unreadable in {} rows from here on", at.len());
                self.cell_error(self.lines.of(rows[at.start]), self.columns[place].number, message)
            })?;
            let quantity = (*name).to_owned();
            if unreadable > 0 {
                let (empty, of) = (0, values.len());
                self.findings.push(Finding::Interpolated {
                    quantity,
                    unreadable,
                    empty,
                    of,
                    first: self.columns[place]
                        .first_unreadable
                        .clone()
                        .filter(|_| self.has_lines),
                });
            }
            columns.push(match timing.is_uneven {
                true => resampled(&times, &values, &timing, is_vibration(name)),
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
type Chosen = (usize, Scale);

impl Column {
    fn new(name: String, header: &str, index: usize) -> Self {
        Self {
            name,
            header: header.to_owned(),
            number: index + 1,
            unit: None,
            values: vec![],
            unreadable: 0,
            first_unreadable: None,
        }
    }
}

/// Seconds of each row.
const TIME: &str = "time";
/// Internal name of a signal's column.
const SIGNAL: &str = "signal";

fn is_vibration(name: &str) -> bool {
    name.starts_with("accel") || name == SIGNAL
}

/// Whether a column of that name is read.
pub(in crate::recording) fn is_wanted(
    name: &str,
    import: &ImportSettings,
    wanted: ColumnSelection<'_>,
) -> bool {
    let is = |requested: &str| requested.trim().eq_ignore_ascii_case(name);
    match wanted {
        ColumnSelection::Unscaled(requested) => is(requested),
        ColumnSelection::Signal(Some(requested)) => {
            is(requested) || plain(name, import).is_some_and(|plain| plain == "time")
        }
        ColumnSelection::Recording | ColumnSelection::Signal(None) => {
            plain(name, import).is_some() || is_like_ours(name)
        }
        ColumnSelection::Sweep => plain(name, import).is_some() || is_of(name, "", Quantity::CURRENT),
    }
}

impl Table {
    /// Selects the columns to read, and records the others as a finding.
    fn choose(
        &mut self,
        import: &ImportSettings,
        wanted: ColumnSelection<'_>,
    ) -> Result<Vec<Chosen>, ReadError> {
        let names = std::mem::take(&mut self.names);
        let units = std::mem::take(&mut self.units);
        let chosen = match wanted {
            ColumnSelection::Unscaled(name) => self.find(&names, name).map(|index| {
                self.columns
                    .push(Column::new(SIGNAL.to_owned(), &names[index], index));
                vec![(index, Scale::One)]
            }),
            _ => self.chosen(&names, &units, import, wanted),
        };
        (self.names, self.units) = (names, units);
        let chosen = chosen?;
        if matches!(wanted, ColumnSelection::Recording) {
            let is_unused = |&(index, name): &(usize, &String)| {
                let is_said =
                    |finding: &Finding| matches!(finding, Finding::TimesNotUsed { column } if column == name);
                !name.is_empty()
                    && !chosen.iter().any(|(chosen, _)| *chosen == index)
                    && !self.findings.iter().any(is_said)
            };
            let unused = self.names.iter().enumerate().filter(is_unused);
            let columns: Vec<String> = unused.map(|(_, name)| name.clone()).collect();
            if !columns.is_empty() {
                self.findings.push(Finding::NotUsed { columns });
            }
        }
        Ok(chosen)
    }

    fn chosen(
        &mut self,
        names: &[String],
        units: &[String],
        import: &ImportSettings,
        wanted: ColumnSelection<'_>,
    ) -> Result<Vec<Chosen>, ReadError> {
        let below = |index: usize| units.get(index).map_or("", String::as_str);
        let mut plain: Vec<Option<String>> = names.iter().map(|name| self::plain(name, import)).collect();
        if matches!(wanted, ColumnSelection::Recording | ColumnSelection::Signal(None)) {
            let has_rate = import.rate_hz.is_some() || self.notes.contains_key("rate_hz");
            let is_signal = !matches!(wanted, ColumnSelection::Recording);
            let taken = taken_as(names, units, &mut plain, import, has_rate, is_signal).into_iter();
            let is_read = |finding: &Finding| match finding {
                Finding::TakenAs { quantity, .. } => is_vibration(quantity) || quantity == TIME,
                _ => true,
            };
            let is_all = matches!(wanted, ColumnSelection::Recording);
            self.findings
                .extend(taken.filter(|finding| is_all || is_read(finding)));
        }
        match wanted {
            ColumnSelection::Unscaled(_) | ColumnSelection::Recording => {}
            ColumnSelection::Sweep => self.choose_sweep(names, units, &mut plain)?,
            ColumnSelection::Signal(requested) => {
                let is = |plain: &Option<String>, wanted: &str| plain.as_deref() == Some(wanted);
                let has = |wanted: &str| plain.iter().any(|plain| is(plain, wanted));
                let signal = match requested {
                    Some(name) => Some(self.find(names, name)?),
                    None if has("accel")
                        || ["accel_x", "accel_y", "accel_z"].iter().all(|axis| has(axis)) =>
                    {
                        None
                    }
                    None => {
                        let others =
                            (0..names.len()).filter(|&i| !is(&plain[i], "time") && !names[i].is_empty());
                        match others.collect::<Vec<_>>()[..] {
                            [index] => Some(index),
                            _ => {
                                let message = format!(
                                    "cannot choose the signal; select a column with --column: {}",
                                    listed(names)
                                );
                                return Err(self.error(self.header_line, message));
                            }
                        }
                    }
                };
                let has_accel = has("accel");
                for (index, plain) in plain.iter_mut().enumerate() {
                    let is_kept = match (signal, plain.as_deref()) {
                        (_, Some("time")) => true,
                        (None, Some("accel")) => true,
                        (None, Some(axis)) => !has_accel && axis.starts_with("accel_"),
                        _ => false,
                    };
                    if signal == Some(index) {
                        *plain = Some(SIGNAL.to_owned());
                    } else if !is_kept {
                        *plain = None;
                    }
                }
            }
        }
        let mut chosen = vec![];
        for (index, (name, plain)) in names.iter().zip(plain).enumerate() {
            let Some(plain) = plain else { continue };
            if plain == TIME && import.rate_hz.is_some() {
                let column = name.clone();
                self.findings.push(Finding::TimesNotUsed { column });
                continue;
            }
            let wrong = |message| self.cell_error(self.header_line, index + 1, message);
            if self.has(&plain) {
                return Err(wrong(format!("this is a second column of {plain}")));
            }
            let mut column = Column::new(plain.clone(), name, index);
            let scale = match &*plain {
                SIGNAL => {
                    let given = import.units.get("accel").filter(|unit| *unit != "1");
                    let (scale, unit) = match given.map(|unit| parse_unit("accel", unit)).transpose() {
                        Ok(Some(scale)) => (scale, Some("m/s2")),
                        Ok(None) => match unit_of_column(name, below(index)) {
                            Some((scale, unit)) => (scale, Some(unit)),
                            None => (Scale::One, None),
                        },
                        Err(message) => return Err(wrong(message)),
                    };
                    column.unit = unit;
                    scale
                }
                // Times of a calendar have no unit: what they are is seen at the first row.
                TIME => {
                    let scale = scale(name, below(index), &plain, import);
                    let (scale, contradicted) = scale.unwrap_or_else(|message| {
                        self.time_without_unit = Some(message);
                        (Scale::One, None)
                    });
                    self.findings.extend(contradicted.map(|given| Finding::OtherUnit {
                        column: name.clone(),
                        given,
                    }));
                    self.time_scale = scale;
                    scale
                }
                _ => {
                    let (scale, contradicted) = scale(name, below(index), &plain, import).map_err(wrong)?;
                    if let Some(given) = contradicted {
                        self.findings.push(Finding::OtherUnit {
                            column: name.clone(),
                            given,
                        });
                    }
                    scale
                }
            };
            chosen.push((index, scale));
            self.columns.push(column);
        }
        Ok(chosen)
    }

    /// Finds the only columns of current and acceleration, unless the settings name them.
    fn choose_sweep(
        &self,
        names: &[String],
        units: &[String],
        plain: &mut [Option<String>],
    ) -> Result<(), ReadError> {
        for (quantity, wanted) in [(Quantity::CURRENT, "current"), (Quantity::ACCELERATION, "accel")] {
            if plain.iter().flatten().any(|plain| plain == wanted) {
                continue;
            }
            let below = |index: usize| units.get(index).map_or("", String::as_str);
            let fitting = (0..names.len()).filter(|&index| is_of(&names[index], below(index), quantity));
            match fitting.collect::<Vec<_>>()[..] {
                [] => {}
                [index] => plain[index] = Some(wanted.to_owned()),
                [first, ..] => {
                    let message = format!(
                        "several columns have a unit of {wanted}; select one, such as --column {wanted}={:?}",
                        names[first]
                    );
                    return Err(self.error(self.header_line, message));
                }
            }
        }
        for plain in plain.iter_mut() {
            let is_ours = |plain: &String| ["time", "current", "accel"].contains(&plain.as_str());
            *plain = plain.take().filter(is_ours);
        }
        Ok(())
    }

    /// Finds a column by name; ignores case if no name matches exactly.
    fn find(&self, names: &[String], requested: &str) -> Result<usize, ReadError> {
        let exact = names.iter().position(|known| known == requested.trim());
        let found = exact.or_else(|| {
            names
                .iter()
                .position(|known| known.eq_ignore_ascii_case(requested.trim()))
        });
        found.ok_or_else(|| {
            let message = format!(
                "there is no column {requested:?}; the columns are {}",
                listed(names)
            );
            self.error(self.header_line, message)
        })
    }

    /// The column that was selected as a signal, without unit conversion. In the table of a raw recording, where slower
    /// sensors leave cells empty, empty cells are skipped.
    pub(in crate::recording) fn unscaled(&mut self) -> Result<Vec<f64>, ReadError> {
        let place = self.needed(SIGNAL)?;
        let mut values = std::mem::take(&mut self.columns[place].values);
        match self.is_raw() {
            true => values.retain(|value| !value.is_nan()),
            false => self.refuse_empty(place, &values)?,
        }
        Ok(values)
    }

    fn refuse_empty(&self, place: usize, values: &[f64]) -> Result<(), ReadError> {
        let Column { number, header, .. } = &self.columns[place];
        match values.iter().position(|value| value.is_nan()) {
            Some(row) => {
                let message = format!("the cell of {header} is empty");
                Err(self.cell_error(self.lines.of(row), *number, message))
            }
            None => Ok(()),
        }
    }

    fn is_raw(&self) -> bool {
        let quantity = |name: &String| plain_name(&name.to_lowercase()).map(|(plain, _)| plain);
        let has = |wanted: &str| self.names.iter().filter_map(quantity).any(|name| name == wanted);
        has("accel_x") && (has("force_x") || has("position_x"))
    }

    /// The columns that were selected as a signal, their name and unit, and their rate if known.
    pub(in crate::recording) fn signal(&mut self) -> Result<SignalColumns, ReadError> {
        let is_signal = |column: &&Column| column.name != "time";
        let chosen: Vec<&Column> = self.columns.iter().filter(is_signal).collect();
        let names: Vec<String> = chosen.iter().map(|column| column.name.clone()).collect();
        let headers: Vec<&str> = chosen.iter().map(|column| &*column.header).collect();
        let name = headers.join(", ");
        let unit = match &chosen[..] {
            [column] if column.name == SIGNAL => column.unit,
            _ => self.knows_unit.then_some("m/s2"),
        };
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let has_rate = !self.lacks_rate();
        if !has_rate {
            self.given_rate_hz = Some(1.0);
        }
        let (rate_hz, values) = match self.is_raw() {
            true => {
                let series = self.sensed(&names)?;
                let column = |index: usize| series.samples.iter().map(|row| row[index]).collect();
                (series.rate_hz, (0..names.len()).map(column).collect())
            }
            false => {
                let even = self.taken(&names)?;
                (even.rate_hz, even.columns)
            }
        };
        Ok(SignalColumns {
            name,
            unit,
            rate_hz: has_rate.then_some(rate_hz),
            values,
        })
    }
}

/// One signal, or its three axes.
pub(in crate::recording) struct SignalColumns {
    pub name: String,
    pub unit: Option<&'static str>,
    pub rate_hz: Option<f64>,
    pub values: Vec<Vec<f64>>,
}

/// The quantity of a column, from the settings or else from its name.
fn plain(name: &str, import: &ImportSettings) -> Option<String> {
    if let Some((plain, _)) = import.columns.iter().find(|(_, column)| *column == name) {
        return Some(plain.clone());
    }
    let (plain, _) = plain_name(&name.to_lowercase())?;
    // A mapping in the settings overrides the column's name.
    let is_elsewhere = import.columns.contains_key(&plain) || import.constants.contains_key(&plain);
    (QUANTITIES.contains(&&*plain) && !is_elsewhere).then_some(plain)
}

/// The scale of a column, and the given unit if it contradicts the file's.
fn scale(
    name: &str,
    below: &str,
    plain: &str,
    import: &ImportSettings,
) -> Result<(Scale, Option<String>), String> {
    let is_mapped = import.columns.get(plain).is_some_and(|column| column == name);
    // The unit of `accel` is that of its axes too.
    let whole = plain.split('_').next().unwrap_or(plain);
    let given = import.units.get(plain).or_else(|| import.units.get(whole));
    let own = unit_in_file(name, below, plain, is_mapped);
    let Some(unit) = given else {
        return own.map(|scale| (scale, None));
    };
    let scale = parse_unit(plain, unit)?;
    let contradicts = unit.trim() != "1" && own.is_ok_and(|own| own != scale);
    Ok((scale, contradicts.then(|| format!("{plain}={unit}"))))
}

/// The error for missing columns; it lists the columns of the file.
pub(in crate::recording) fn missing_columns(tables: &[&Table], missing: Vec<String>) -> ReadError {
    let names = tables.iter().flat_map(|table| &table.names).cloned();
    ReadError::Missing {
        hints: hints(tables, &missing),
        missing,
        columns: names.filter(|name| !name.is_empty()).collect(),
    }
}

/// Checks that each column in the settings exists in one of the tables.
pub(in crate::recording) fn check_mapping(
    tables: &[Table],
    import: &ImportSettings,
) -> Result<(), ReadError> {
    let names: Vec<String> = tables.iter().flat_map(|table| table.names.clone()).collect();
    match (
        import.columns.values().find(|column| !names.contains(column)),
        tables,
    ) {
        (Some(column), [first, ..]) => {
            let message = format!(
                "there is no column {column:?}; the columns are {}",
                listed(&names)
            );
            Err(first.error(first.header_line, message))
        }
        _ => Ok(()),
    }
}

impl Table {
    /// The columns that nothing is read from, each with its cell in a row of units.
    pub(super) fn unread(&self) -> impl Iterator<Item = (&str, &str)> {
        let is_read = |index: usize| self.columns.iter().any(|column| column.number == index + 1);
        let unread = self.names.iter().enumerate();
        let below = |index: usize| self.units.get(index).map_or("", String::as_str);
        unread
            .filter(move |(index, name)| !name.is_empty() && !is_read(*index))
            .map(move |(index, name)| (name.as_str(), below(index)))
    }
}

/// The rate from a line `# rate_hz: ...`.
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
            message: format!("the rate {text:?} is not a number above 0"),
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

pub(in crate::recording) fn unequal(row: &Row<'_>, expected: usize) -> ReadError {
    ReadError::Csv {
        line: row.line,
        message: format!(
            "the row has {} cells where the header has {expected}",
            row.cells()
        ),
    }
}
