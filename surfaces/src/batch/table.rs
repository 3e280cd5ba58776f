//! Reads jobs from a table: a CSV file with the columns `surface`, `motion` and `seed`, and optionally `gain` and `update_hz`.

use super::plan::{Batch, Job, check_gain, check_update_hz};
use super::problem::{PlanError, PlanProblem};
use crate::files::Place;
use csv::{ReaderBuilder, Trim};
use haptograph_signal::files;
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row<'a> {
    surface: &'a str,
    motion: &'a str,
    seed: u64,
    gain: Option<f64>,
    update_hz: Option<f64>,
}

/// Reads the jobs of a table; returns them with the table's bytes.
pub fn read(path: &Path, batch: &Batch) -> Result<(Vec<Job>, Vec<u8>), PlanError> {
    let failed = |line: Option<u64>, problem| PlanError {
        path: path.to_owned(),
        place: line.map(|line| Place {
            line: line as usize,
            column: 1,
        }),
        problem,
    };
    let bytes = files::read(path, files::MAX_JOBS_BYTES).map_err(|error| failed(None, error.into()))?;
    let mut reader = ReaderBuilder::new()
        .trim(Trim::All)
        .comment(Some(b'#'))
        .from_reader(&bytes[..]);
    let unreadable = |error: csv::Error| {
        let line = error.position().map(csv::Position::line);
        failed(line, PlanProblem::Syntax(message(&error)))
    };
    let header = reader.headers().map_err(unreadable)?.clone();
    let (mut jobs, mut record) = (vec![], csv::StringRecord::new());
    while reader.read_record(&mut record).map_err(unreadable)? {
        let row: Row<'_> = record.deserialize(Some(&header)).map_err(unreadable)?;
        let line = record.position().map(csv::Position::line);
        let surface = batch
            .surface_of(row.surface)
            .map_err(|problem| failed(line, problem))?;
        let motion = batch
            .motion_of(row.motion)
            .map_err(|problem| failed(line, problem))?;
        let gain = row.gain.unwrap_or(batch.gain());
        let update_hz = row.update_hz.unwrap_or(batch.update_hz());
        check_gain(gain)
            .and_then(|()| check_update_hz(update_hz))
            .map_err(|problem| failed(line, problem))?;
        jobs.push(Job {
            surface,
            motion,
            seed: row.seed,
            gain,
            update_hz,
        });
    }
    Ok((jobs, bytes))
}

/// The parser's message without the location.
fn message(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::Deserialize { err, .. } => {
            format!(
                "{err}; a table of jobs has the columns surface, motion and seed, and optionally gain and update_hz"
            )
        }
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => {
            format!("this row has {len} cells, but the header has {expected_len}")
        }
        _ => error.to_string(),
    }
}
