//! Recorded sweeps of actuators as tables: a column of current, one of acceleration, and the time.

use super::identify::Sweep;
use crate::units;
use haptograph_signal::files::{self, MAX_RECORDING_BYTES};
use haptograph_signal::quantity::Quantity;
use std::path::{Path, PathBuf};

/// A sweep from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepFile {
    /// Current, A.
    pub current_a: Vec<f64>,
    /// Felt acceleration, m/s2.
    pub acceleration_m_s2: Vec<f64>,
    /// Samples per second.
    pub rate_hz: f64,
}

/// Why a file is no sweep.
#[derive(Debug, thiserror::Error)]
pub enum SweepFileError {
    /// It cannot be read as a table.
    #[error("{}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        error: csv::Error,
    },
    /// It has no header of a table.
    #[error("{}: {problem}", path.display())]
    NoHeader {
        /// The file.
        path: PathBuf,
        /// What there is instead.
        problem: &'static str,
    },
    /// There is not exactly one column of a quantity.
    #[error(
        "{} has {} of {quantity}; it needs one whose name ends in {ending}, such as `felt{ending}`", path.display(),
        match found { 0 => "no column".to_owned(), found => format!("{found} columns") }
    )]
    Column {
        /// The file.
        path: PathBuf,
        /// Columns found.
        found: usize,
        /// What they should be.
        quantity: &'static str,
        /// How their names end.
        ending: &'static str,
    },
    /// A cell that is no number.
    #[error("{}, line {line}: '{text}' is not a finite number", path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// What stands there.
        text: String,
    },
    /// The times do not follow each other evenly.
    #[error("{}, line {line}: the time is not one period of {period_s} s after the one before; record at one rate", path.display())]
    Uneven {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// The time from the first row to the second, s.
        period_s: f64,
    },
    /// Too few rows to tell a rate.
    #[error("{} has less than two rows", path.display())]
    Short {
        /// The file.
        path: PathBuf,
    },
}

impl SweepFile {
    /// Reads a CSV file with a column `time_s`, one whose name ends in `_a` (or `_ma`) and one in `_m_s2` (or `_mm_s2`).
    ///
    /// # Errors
    /// [`SweepFileError`] where it is no such table.
    pub fn read(path: &Path) -> Result<Self, SweepFileError> {
        let failed = |error| SweepFileError::Read {
            path: path.to_owned(),
            error,
        };
        let source = files::open(path, MAX_RECORDING_BYTES).map_err(|error| failed(error.into()))?;
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(source);
        let header = reader.headers().map_err(failed)?.clone();
        if let Some(problem) = units::no_header(&header) {
            let path = path.to_owned();
            return Err(SweepFileError::NoHeader { path, problem });
        }
        let column = |quantity: &'static str, of: Quantity, ending: &'static str| {
            let fitting = |name: &str| match ending {
                "time_s" => name == ending,
                _ => units::of_header(name).0 == of,
            };
            let found: Vec<usize> = (0..header.len()).filter(|i| fitting(&header[*i])).collect();
            match found.as_slice() {
                [one] => Ok((*one, units::of_header(&header[*one]).1)),
                many => Err(SweepFileError::Column {
                    path: path.to_owned(),
                    found: many.len(),
                    quantity,
                    ending,
                }),
            }
        };
        let columns = [
            column("time", Quantity::TIME, "time_s")?,
            column("current", Quantity::CURRENT, "_a")?,
            column("acceleration", Quantity::ACCELERATION, "_m_s2")?,
        ];
        let mut rows: Vec<[f64; 3]> = Vec::new();
        for record in reader.records() {
            let record = record.map_err(failed)?;
            let mut row = [0.0; 3];
            for (value, (place, scale)) in row.iter_mut().zip(columns) {
                let text = record.get(place).unwrap_or_default();
                let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
                *value = scale
                    * number.ok_or_else(|| SweepFileError::Cell {
                        path: path.to_owned(),
                        line: record.position().map_or(0, csv::Position::line),
                        text: text.to_owned(),
                    })?;
            }
            rows.push(row);
        }
        let rate_hz = rate_hz(path, &rows)?;
        Ok(Self {
            current_a: rows.iter().map(|row| row[1]).collect(),
            acceleration_m_s2: rows.iter().map(|row| row[2]).collect(),
            rate_hz,
        })
    }

    /// What can be fitted, over the band that the sweep covers, Hz.
    pub fn sweep(&self, band_hz: [f64; 2]) -> Sweep<'_> {
        Sweep {
            current_a: &self.current_a,
            acceleration_m_s2: &self.acceleration_m_s2,
            rate_hz: self.rate_hz,
            band_hz,
        }
    }
}

/// Of evenly spaced rows; times may be rounded to a tenth of a period.
fn rate_hz(path: &Path, rows: &[[f64; 3]]) -> Result<f64, SweepFileError> {
    let path = || path.to_owned();
    let [first, .., last] = rows else {
        return Err(SweepFileError::Short { path: path() });
    };
    let period_s = (last[0] - first[0]) / (rows.len() - 1) as f64;
    let uneven = |pair: &[[f64; 3]]| {
        let step_s = pair[1][0] - pair[0][0];
        step_s.is_nan() || step_s <= 0.0 || (step_s / period_s - 1.0).abs() > 0.2
    };
    match rows.windows(2).position(uneven) {
        // The header is line 1.
        Some(row) => Err(SweepFileError::Uneven {
            path: path(),
            line: row as u64 + 3,
            period_s,
        }),
        None => Ok(1.0 / period_s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<SweepFile, SweepFileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sweep.csv");
        std::fs::write(&path, text).unwrap();
        SweepFile::read(&path)
    }

    #[test]
    fn columns_are_found_by_their_units() {
        let found =
            read("time_s,felt_mm_s2,out.delivered_ma\n0,1000,250\n0.001,2000,500\n0.002,0,0\n").unwrap();
        assert_eq!(found.acceleration_m_s2, [1.0, 2.0, 0.0]);
        assert_eq!(found.current_a, [0.25, 0.5, 0.0]);
        assert!((found.rate_hz - 1000.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_no_sweep_is_refused_where_it_is() {
        let message = |text| read(text).unwrap_err().to_string();
        assert!(message("").contains("the file is empty") && message("\n\n").contains("the file is empty"));
        assert!(message("time_s;x_m_s2;i_a\n0;1;1\n").contains("semicolons"));
        assert!(message("time_s,x_m_s2\n0,1\n").contains("has no column of current"));
        assert!(message("time_s,x_m_s2,i_a\n0,1,1\n1,x,1\n").contains("line 3: 'x'"));
        assert!(message("time_s,x_m_s2,i_a\n0,1,1\n1,1,1\n5,1,1\n6,1,1\n").contains("line 3"));
        assert!(message("time_s,x_m_s2,i_a\n0,1,1\n").contains("less than two rows"));
    }
}
