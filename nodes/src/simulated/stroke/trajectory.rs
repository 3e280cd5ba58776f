//! Recorded paths.

use super::StrokePoint;
use haptograph_signal::csv::{CsvError, CsvTable};
use haptograph_surfaces::bounds::{MAX_FORCE_N, MAX_POSITION_M, MAX_TIME_S};
use std::io::BufReader;

/// The columns of a file.
const COLUMNS: [&str; 4] = ["time_s", "x_mm", "y_mm", "force_n"];

/// A path of the tip: positions and forces at increasing times, joined by cubic splines (Catmull and Rom).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Trajectory {
    time_s: Vec<f64>,
    /// x and y in m, force in N.
    values: Vec<[f64; 3]>,
}

/// Error of a recorded path.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum TrajectoryError {
    /// Fewer than two points.
    #[error("a trajectory needs at least two points, this one has {points}")]
    TooShort {
        /// Number of points.
        points: usize,
    },
    /// A point that is not later than the one before it, or not a number.
    #[error("point {index} of the trajectory (counted from 0) {problem}")]
    BadPoint {
        /// Index of the point.
        index: usize,
        /// Description of the error.
        problem: &'static str,
    },
    /// The file is not the expected CSV file.
    #[error("{0} (the file needs the columns time_s, x_mm, y_mm and force_n)")]
    BadTable(#[from] CsvError),
}

impl Trajectory {
    /// A path through points of (time in s, x in m, y in m, force in N); the first time is taken as zero.
    pub(crate) fn new(points: &[[f64; 4]]) -> Result<Self, TrajectoryError> {
        if points.len() < 2 {
            return Err(TrajectoryError::TooShort { points: points.len() });
        }
        for (index, point) in points.iter().enumerate() {
            let most = [MAX_TIME_S, MAX_POSITION_M, MAX_POSITION_M, MAX_FORCE_N];
            let problem = if !point.iter().zip(most).all(|(x, most)| x.abs() <= most) {
                "has a value that is not a number or far beyond what a hand reaches"
            } else if point[3] < 0.0 {
                "has a negative force"
            } else if index > 0 && point[0] <= points[index - 1][0] {
                "is not later than the one before it"
            } else {
                continue;
            };
            return Err(TrajectoryError::BadPoint { index, problem });
        }
        Ok(Self {
            time_s: points.iter().map(|p| p[0] - points[0][0]).collect(),
            values: points.iter().map(|p| [p[1], p[2], p[3]]).collect(),
        })
    }

    /// Reads a CSV table with a header that holds `time_s`, `x_mm`, `y_mm` and `force_n`, in any order.
    pub(crate) fn from_csv(source: impl std::io::Read) -> Result<Self, TrajectoryError> {
        let mut table = CsvTable::new(BufReader::new(source), &COLUMNS)?;
        let mut columns = [0; 4];
        for (column, name) in columns.iter_mut().zip(COLUMNS) {
            *column = table.find(name).ok_or_else(|| CsvError::Row {
                line: table.head().line,
                message: format!("there is no column {name}"),
            })?;
        }
        let mut points = Vec::new();
        while let Some(row) = table.next_row()? {
            let mut point = [0.0; 4];
            for (value, column) in point.iter_mut().zip(columns) {
                *value = row.number(column)?;
            }
            points.push([point[0], point[1] / 1000.0, point[2] / 1000.0, point[3]]);
        }
        Self::new(&points)
    }

    /// The path at a time; before it the first point, after it the last one, lifted.
    pub(crate) fn at(&self, time_s: f64) -> StrokePoint {
        let last = self.values.len() - 1;
        let next = self.time_s.partition_point(|&t| t <= time_s);
        let [x, y, force_n] = match next {
            0 => self.values[0],
            next if next > last => [self.values[last][0], self.values[last][1], 0.0],
            next => self.between(next - 1, time_s),
        };
        StrokePoint {
            position_m: [x, y],
            force_n: force_n.max(0.0),
            lifted: if next > last { 1.0 } else { 0.0 },
        }
    }

    /// Cubic Hermite interpolation from point i to the next one.
    fn between(&self, i: usize, time_s: f64) -> [f64; 3] {
        let width_s = self.time_s[i + 1] - self.time_s[i];
        let u = (time_s - self.time_s[i]) / width_s;
        let (v, w) = (1.0 - u, u * u * (3.0 - 2.0 * u));
        let (slope, next_slope) = (self.slope(i), self.slope(i + 1));
        std::array::from_fn(|c| {
            let (a, b) = (self.values[i][c], self.values[i + 1][c]);
            a + w * (b - a) + width_s * u * v * (v * slope[c] - u * next_slope[c])
        })
    }

    fn slope(&self, i: usize) -> [f64; 3] {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(self.values.len() - 1));
        let span_s = self.time_s[after] - self.time_s[before];
        std::array::from_fn(|c| (self.values[after][c] - self.values[before][c]) / span_s)
    }
}
