//! Reads jobs from a table: a CSV file with the columns `surface`, `motion` and `seed`, and optionally `gain` and `update_hz`.

use super::plan::{Batch, Job, check_gain, check_update_hz};
use super::problem::{PlanError, PlanProblem};
use haptograph_signal::csv::{CsvError, CsvTable, TableRow};
use haptograph_signal::files;
use haptograph_surfaces::files::Place;
use std::path::Path;

const COLUMNS: [&str; 5] = ["surface", "motion", "seed", "gain", "update_hz"];
/// The first of them, which every table has.
const NEEDED: usize = 3;

/// Reads the jobs of a table; returns them with the table's bytes.
pub(super) fn read(path: &Path, batch: &Batch) -> Result<(Vec<Job>, Vec<u8>), PlanError> {
    let failed = |line: Option<u64>, problem| PlanError {
        path: path.to_owned(),
        place: line.map(|line| Place { line: line as usize, column: 1 }),
        problem,
    };
    let unreadable = |error: CsvError| {
        let line = error.line();
        failed(line, PlanProblem::Table(error.into_message()))
    };
    let bytes = files::read(path, files::MAX_JOBS_BYTES).map_err(|error| failed(None, error.into()))?;
    let mut table = CsvTable::new(&bytes[..], &COLUMNS).map_err(unreadable)?;
    let columns = COLUMNS.map(|name| table.find(name));
    if let Some(message) = other_columns(&table.head().names, &columns) {
        return Err(failed(Some(table.head().line), PlanProblem::Table(message)));
    }
    let mut jobs = vec![];
    while let Some(row) = table.next_row().map_err(unreadable)? {
        let numbers = Numbers::read(&row, columns).map_err(unreadable)?;
        let [surface, motion, ..] = columns.map(|column| row.text(column.unwrap_or_default()));
        let job = job(batch, [&surface, &motion], &numbers);
        jobs.push(job.map_err(|problem| failed(Some(row.line()), problem))?);
    }
    Ok((jobs, bytes))
}

/// What is wrong with the columns of a table.
fn other_columns(names: &[String], columns: &[Option<usize>]) -> Option<String> {
    let unknown = names.iter().find(|name| !COLUMNS.contains(&name.as_str()));
    let missing = COLUMNS.iter().zip(columns).take(NEEDED).find(|(_, column)| column.is_none());
    let wrong = match (missing, unknown) {
        (Some((missing, _)), _) => format!("there is no column `{missing}`"),
        (None, Some(unknown)) => format!("there is a column `{unknown}`"),
        (None, None) => return None,
    };
    Some(format!(
        "{wrong}; a table of jobs has the columns surface, motion and seed, and optionally gain and update_hz"
    ))
}

/// The numbers of a row; those that it does not give are the plan's.
struct Numbers {
    seed: u64,
    gain: Option<f64>,
    update_hz: Option<f64>,
}

impl Numbers {
    fn read(row: &TableRow<'_>, [_, _, seed, gain, update_hz]: [Option<usize>; 5]) -> Result<Self, CsvError> {
        let given = |column: Option<usize>| {
            let column = column.filter(|column| !row.is_empty_at(*column));
            column.map(|column| row.number(column)).transpose()
        };
        let seed = seed.unwrap_or_default();
        Ok(Self {
            // Not every seed is a number of double precision.
            seed: { row.text(seed).parse() }
                .map_err(|_| row.unreadable(seed, "a whole number from 0 to 2^64 - 1"))?,
            gain: given(gain)?,
            update_hz: given(update_hz)?,
        })
    }
}

fn job(batch: &Batch, [surface, motion]: [&str; 2], numbers: &Numbers) -> Result<Job, PlanProblem> {
    let job = Job {
        surface: batch.surface_of(surface)?,
        motion: batch.motion_of(motion)?,
        seed: numbers.seed,
        gain: numbers.gain.unwrap_or(batch.gain()),
        update_hz: numbers.update_hz.unwrap_or(batch.update_hz()),
    };
    check_gain(job.gain)?;
    check_update_hz(job.update_hz)?;
    Ok(job)
}
