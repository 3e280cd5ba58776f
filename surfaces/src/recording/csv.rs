//! Recordings as CSV: a header that names quantity and unit, one row a moment.
//!
//! | columns | kind |
//! |---|---|
//! | `time_s` (or `time_ms`), or a line `# rate_hz: 10000` above the header | either |
//! | `accel_m_s2`, or `accel_x_m_s2`, `accel_y_m_s2`, `accel_z_m_s2` (or `_g`) | either |
//! | `force_normal_n`, `force_tangential_n` (optional), `speed_mm_s` (or `_m_s`) | processed |
//! | `force_x_n` .. `force_z_n`, `torque_x_n_m` .. (or `_n_mm`; optional), `position_x_mm` .. (or `_m`), `orientation_w`, `_x`, `_y`, `_z` | raw |
//!
//! Raw forces act on the tool, in the tool's frame; positions are the tip's. Cells are empty where a slower sensor had no sample.
//! Lines `# gesture: tap`, `# origin: simulated`, `# source: ...` above the header say what the columns cannot. Other columns are ignored; [`csv_head`] tells which.

mod table;
mod units;
mod write;

pub(super) use table::{
    Table, cell_start, csv_error, header, line_of, not_a_number, notes, number, reader, without_mark,
};
pub(super) use units::{Scale, parse_name, si_unit};
pub use write::{RawTable, write_csv};

use super::ReadError;
use super::{
    AnyRecording, Calibration, Gesture, Pose, ProcessedRecording, Recording, Series, Signals, Wrench,
};
use crate::files::Place;
use crate::learning::processing;
use crate::{Origin, Provenance};

const AXES: [&str; 3] = ["x", "y", "z"];

/// The columns that are understood, by the unit that they are written with.
pub const COLUMNS: [&str; 21] = [
    "time_s",
    "accel_m_s2",
    "force_normal_n",
    "force_tangential_n",
    "speed_mm_s",
    "accel_x_m_s2",
    "accel_y_m_s2",
    "accel_z_m_s2",
    "force_x_n",
    "force_y_n",
    "force_z_n",
    "torque_x_n_mm",
    "torque_y_n_mm",
    "torque_z_n_mm",
    "position_x_mm",
    "position_y_mm",
    "position_z_mm",
    "orientation_w",
    "orientation_x",
    "orientation_y",
    "orientation_z",
];

/// What a CSV file says before its rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CsvHead {
    /// Names of the columns that are none of ours, and passed over.
    pub ignored: Vec<String>,
    /// Whether a line `# gesture: ...` says what the hand did.
    pub says_gesture: bool,
    /// Where it comes from, by a line `# origin: ...`.
    pub origin: Option<Origin>,
}

/// The head of a file from its first bytes; `None` where these are no CSV's.
pub fn csv_head(bytes: &[u8]) -> Option<CsvHead> {
    let bytes = without_mark(bytes);
    if bytes.starts_with(b"PK") || bytes.trim_ascii_start().starts_with(b"<") {
        return None;
    }
    let (names, _) = header(bytes).ok()?;
    let unknown = |name: &&String| !name.is_empty() && parse_name(&name.to_ascii_lowercase()).is_none();
    let notes = notes(bytes);
    Some(CsvHead {
        ignored: names.iter().filter(unknown).cloned().collect(),
        says_gesture: notes.contains_key("gesture"),
        origin: notes.get("origin").and_then(|word| Origin::from_word(word)),
    })
}

/// A recording from the bytes of a CSV file; `source` is where they came from, unless they say so themselves.
pub fn read_csv(bytes: &[u8], source: &str) -> Result<AnyRecording, ReadError> {
    let table = Table::read(without_mark(bytes))?;
    let notes = &table.notes;
    let gesture = match notes.get("gesture") {
        Some(word) => Gesture::from_word(word).ok_or_else(|| {
            table.error(
                1,
                format!("gesture {word:?} is unknown; known are drag, circle, tap, press"),
            )
        })?,
        None => Gesture::Drag,
    };
    let origin = match notes.get("origin") {
        Some(word) => {
            Origin::from_word(word).ok_or_else(|| table.error(1, format!("origin {word:?} is unknown")))?
        }
        None => Origin::Imported,
    };
    let provenance = Provenance::new(origin, notes.get("source").map_or(source, String::as_str));
    if table.has("force_x") || table.has("position_x") {
        raw(&table, gesture, provenance).map(AnyRecording::Raw)
    } else {
        processed(&table, gesture, provenance).map(AnyRecording::Processed)
    }
}

fn processed(
    table: &Table,
    gesture: Gesture,
    provenance: Provenance,
) -> Result<ProcessedRecording, ReadError> {
    let axes = AXES.iter().all(|axis| table.has(&format!("accel_{axis}")));
    let (names, rate_hz) = (
        ["accel", "force_normal", "force_tangential", "speed"],
        table.rate_hz()?,
    );
    let [combined, normal, tangential, speed] = names.map(|name| table.full(name));
    let axes: Option<Vec<[f64; 3]>> = match axes {
        true => Some(columns(
            ["accel_x", "accel_y", "accel_z"].map(|name| table.full(name)),
        )?),
        false => None,
    };
    let acceleration_m_s2 = match &axes {
        Some(axes) if !table.has("accel") => processing::combined(axes, rate_hz, &Default::default())
            .map_err(|e| table.error(table.header_line, e))?,
        _ => combined?,
    };
    let force_tangential_n = table.has("force_tangential").then_some(tangential).transpose()?;
    let signals = Signals {
        rate_hz,
        acceleration_m_s2,
        force_normal_n: normal?,
        force_tangential_n,
        speed_m_s: speed?,
        axes_m_s2: axes,
    };
    Ok(ProcessedRecording::new(signals, gesture, provenance)?)
}

fn raw(table: &Table, gesture: Gesture, provenance: Provenance) -> Result<Recording, ReadError> {
    let acceleration = table.sensor(&["accel_x", "accel_y", "accel_z"])?;
    let poses = table.sensor(&[
        "position_x",
        "position_y",
        "position_z",
        "orientation_w",
        "orientation_x",
        "orientation_y",
        "orientation_z",
    ])?;
    let mut load = vec!["force_x", "force_y", "force_z"];
    if table.has("torque_x") {
        load.extend(["torque_x", "torque_y", "torque_z"]);
    }
    let load = table.sensor(&load)?;
    let three = |row: &[f64], from: usize| std::array::from_fn(|i| row.get(from + i).copied().unwrap_or(0.0));
    let pose = |row: &Vec<f64>| Pose {
        position_m: three(row, 0),
        orientation: std::array::from_fn(|i| row[3 + i]),
    };
    let wrench = |row: &Vec<f64>| Wrench {
        force_n: three(row, 0),
        torque_n_m: three(row, 3),
    };
    Ok(Recording::new(
        series(&poses, pose),
        series(&load, wrench),
        series(&acceleration, |row| three(row, 0)),
        Calibration::default(),
        gesture,
        provenance,
    )?)
}

fn series<T>(rows: &Series<Vec<f64>>, make: impl Fn(&Vec<f64>) -> T) -> Series<T> {
    Series {
        rate_hz: rows.rate_hz,
        start_s: rows.start_s,
        samples: rows.samples.iter().map(make).collect(),
    }
}

fn columns(columns: [Result<Vec<f64>, ReadError>; 3]) -> Result<Vec<[f64; 3]>, ReadError> {
    let [x, y, z] = columns;
    Ok(x?
        .into_iter()
        .zip(y?)
        .zip(z?)
        .map(|((x, y), z)| [x, y, z])
        .collect())
}

impl ReadError {
    /// Where in the bytes of a CSV file the error is.
    pub fn place(&self, bytes: &[u8]) -> Option<Place> {
        let (line, cell) = match self {
            ReadError::Csv { line, .. } => (*line, 1),
            ReadError::CsvCell { line, column, .. } => (*line, *column),
            _ => return None,
        };
        let line = usize::try_from(line).ok()?.max(1);
        let text = bytes.split(|&byte| byte == b'\n').nth(line - 1)?;
        Some(Place {
            line,
            column: cell_start(bytes, text, cell),
        })
    }
}
