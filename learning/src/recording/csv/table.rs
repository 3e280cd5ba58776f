//! Tables of rows and columns. Each cell keeps its location in the file for error messages.

mod cells;
mod faults;
mod samples;
mod selection;

use super::super::ReadError;
use super::super::import::{BadCell, Finding, ImportSettings};
use super::clock::Clock;
use super::units::is_unit;
pub(in crate::recording) use cells::{Cells, Lines, number};
pub(in crate::recording) use faults::{Fault, check_mapping, missing_columns, words_without_units};
use haptograph_signal::csv::{Head, Rows};
use haptograph_signal::units::Scale;
pub(in crate::recording) use samples::{Even, SignalColumns, Taken};
use selection::Chosen;
pub(in crate::recording) use selection::{ColumnSelection, is_wanted};
use std::collections::BTreeMap;
use std::io::BufRead;

/// A larger fraction of unreadable cells in a column is an error.
const MAX_UNREADABLE: f64 = 0.01;
/// Tables of at most this many rows may always have one unreadable cell.
const FEW_ROWS: usize = 100;

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
    /// Cells of the row below the header; may be empty.
    pub(super) units: Vec<String>,
    /// True if the file has lines (or rows of a sheet) that a message can name.
    has_lines: bool,
    columns: Vec<Column>,
    lines: Lines,
    strict: bool,
    /// True if the unit of the acceleration is known.
    knows_unit: bool,
    given_rate_hz: Option<f64>,
    clock: Clock,
    time_scale: Scale,
    /// Message about the unit of the times, if they are plain numbers.
    time_without_unit: Option<String>,
    /// Time from the origin that all files of a take share to this one's, s.
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

/// Seconds of each row.
const TIME: &str = "time";
/// Internal name of a signal's column.
const SIGNAL: &str = "signal";

fn is_vibration(name: &str) -> bool {
    name.starts_with("accel") || name == SIGNAL
}

impl Table {
    pub(in crate::recording) fn read(
        source: impl BufRead,
        import: &ImportSettings,
        wanted: ColumnSelection<'_>,
    ) -> Result<Self, ReadError> {
        let (mut rows, head) = Rows::new(source, &|name| is_wanted(name, import, wanted))?;
        let units = units_below(&mut rows)?;
        let (chosen, mut table) = Self::empty((head, units), import, wanted)?;
        while let Some(row) = rows.next()? {
            let line = row.line;
            let columns = table.names.len();
            if row.cells() > columns || (row.cells() < columns && import.strict) {
                return Err(row.of_other_length(columns).into());
            }
            table.lines.push(line);
            for (&(index, scale), column) in chosen.iter().zip(&mut table.columns) {
                let cell = row.cell(index);
                let value = match (cell, &*column.name) {
                    (b"", _) => Some(f64::NAN),
                    (cell, TIME) => table.clock.seconds(cell, scale),
                    (cell, _) => number(cell, scale),
                };
                if value.is_none() {
                    let text = || String::from_utf8_lossy(cell).chars().take(20).collect();
                    column.note_unreadable(|| (line, Some(text())));
                }
                column.values.push(value.unwrap_or(f64::INFINITY));
            }
        }
        table.checked(import)
    }

    /// No rows yet.
    fn empty(
        (head, units): (Head, Vec<String>),
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
            units,
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
        let head = Head { line: cells.header_line, names: cells.names, notes: cells.notes };
        if let Some((name, length)) = cells.others.iter().find(|(name, _)| is_wanted(name, import, wanted)) {
            let longest = head.names.iter().find(|name| is_wanted(name, import, wanted));
            let longest = longest.or(head.names.first()).map_or("another", String::as_str);
            return Err(ReadError::Io(format!(
                "variable {name} has {length} values, {longest} has {}; all need the same length",
                cells.lines.rows()
            )));
        }
        let (chosen, mut table) = Self::empty((head, cells.units), import, wanted)?;
        let others = cells.others.into_iter();
        table.names.extend(others.map(|(name, length)| format!("{name} ({length} values)")));
        table.lines = cells.lines;
        for (&(index, scale), column) in chosen.iter().zip(&mut table.columns) {
            column.values = std::mem::take(&mut cells.columns[index]);
            for row in 0..column.values.len() {
                if column.values[row].is_infinite() {
                    column.note_unreadable(|| (table.lines.of(row), None));
                }
                column.values[row] = scale.si(column.values[row]);
            }
        }
        table.checked(import)
    }

    /// Returns the table, unless it has no rows or too many cells are unreadable.
    fn checked(mut self, import: &ImportSettings) -> Result<Self, ReadError> {
        if self.lines.rows() == 0 {
            return Err(self.error(
                self.header_line,
                match self.has_lines {
                    true => "there is a header, but no row below it; was the recording stopped at once?",
                    false => "there are no samples; was the recording stopped at once?",
                },
            ));
        }
        if let Some(message) = self.time_without_unit.take().filter(|_| !self.clock.is_calendar()) {
            let number =
                { self.columns.iter() }.find(|column| column.name == TIME).map_or(1, |column| column.number);
            return Err(self.cell_error(self.header_line, number, message));
        }
        let rows = self.lines.rows();
        let allowed =
            ((rows as f64 * MAX_UNREADABLE) as usize).max(usize::from(rows > 1 && rows <= FEW_ROWS));
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

    /// True if the unit of the acceleration is known; `--unit accel=1` marks it as unknown.
    pub(in crate::recording) fn knows_unit(&self) -> bool {
        self.knows_unit
    }

    /// Origin of the times, s; `None` if there are no times, or no samples at them.
    pub(super) fn origin_s(&self) -> Option<f64> {
        let counts = self.has(TIME) && self.columns.len() > 1 && self.lines.rows() > 0;
        counts.then(|| self.clock.origin_s(self.time_scale))
    }

    /// Counts the times from an origin of several tables.
    pub(super) fn count_from(&mut self, origin_s: f64) {
        self.since_s = self.origin_s().map_or(0.0, |own| own - origin_s);
    }

    pub(in crate::recording) fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|column| column.name == name)
    }

    /// The name of a column in the file.
    pub(super) fn header_of(&self, name: &str) -> Option<&str> {
        let found = self.columns.iter().find(|column| column.name == name);
        found.map(|column| &*column.header)
    }

    /// Existing columns among `names`, with their header text.
    pub(super) fn columns_of(&self, names: &[&'static str]) -> Vec<(&'static str, String)> {
        let header = |name: &&'static str| Some((*name, self.header_of(name)?.to_owned()));
        names.iter().filter_map(header).collect()
    }

    fn needed(&self, name: &str) -> Result<usize, ReadError> {
        let found = self.columns.iter().position(|column| column.name == name);
        found.ok_or_else(|| missing_columns(&[self], vec![name.to_owned()]))
    }

    /// True if neither times nor a rate are known.
    pub(super) fn lacks_rate(&self) -> bool {
        !self.has("time") && self.given_rate_hz.is_none() && !self.notes.contains_key("rate_hz")
    }

    /// The columns that are not read, each with its cell in the row of units.
    pub(super) fn unread(&self) -> impl Iterator<Item = (&str, &str)> {
        let is_read = |index: usize| self.columns.iter().any(|column| column.number == index + 1);
        let unread = self.names.iter().enumerate();
        let below = |index: usize| self.units.get(index).map_or("", String::as_str);
        unread
            .filter(move |(index, name)| !name.is_empty() && !is_read(*index))
            .map(move |(index, name)| (name.as_str(), below(index)))
    }
}

/// Takes the row of units below the header, if there is one.
fn units_below(rows: &mut Rows<impl BufRead>) -> Result<Vec<String>, ReadError> {
    let Some((line, cells)) = rows.words_below() else {
        return Ok(vec![]);
    };
    if !cells.iter().any(|cell| is_unit(cell)) {
        return Err(words_without_units(line, &cells));
    }
    rows.next()?;
    Ok(cells)
}

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

    /// Counts a cell; keeps line and text of the first.
    fn note_unreadable(&mut self, cell: impl FnOnce() -> (u64, Option<String>)) {
        self.unreadable += 1;
        if self.first_unreadable.is_none() {
            let (line, text) = cell();
            let column = self.number;
            self.first_unreadable = Some(BadCell { line, column, text });
        }
    }
}
