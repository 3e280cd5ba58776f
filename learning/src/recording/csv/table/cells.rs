//! Cells as they stand in a file, and the lines that they stand on.

use haptograph_signal::csv::decimal;
use haptograph_signal::units::Scale;
use std::collections::BTreeMap;

/// The line of each row; stores only the rows whose line does not follow the previous one.
#[derive(Default)]
pub(in crate::recording) struct Lines {
    rows: usize,
    /// (row, line) where a run of consecutive lines begins.
    jumps: Vec<(usize, u64)>,
}

impl Lines {
    pub(crate) fn push(&mut self, line: u64) {
        let follows = self.jumps.last().is_some_and(|(row, first)| first + (self.rows - row) as u64 == line);
        if !follows {
            self.jumps.push((self.rows, line));
        }
        self.rows += 1;
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn of(&self, row: usize) -> u64 {
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

/// The finite number in a cell, in SI.
pub(in crate::recording) fn number(cell: &[u8], scale: Scale) -> Option<f64> {
    let value = scale.read(&decimal(cell)?)?;
    value.is_finite().then_some(value)
}
