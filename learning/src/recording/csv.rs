//! Recordings as CSV: a header that names quantity and unit, and one row for each time.
//!
//! | columns | kind |
//! |---|---|
//! | `time_s` (or `time_ms`), or a line `# rate_hz: 10000` above the header | either |
//! | `accel_m_s2`, or `accel_x_m_s2`, `accel_y_m_s2`, `accel_z_m_s2` (or `_g`) | either |
//! | `force_normal_n`, `force_tangential_n` (optional), `speed_mm_s` (or `_m_s`) | processed |
//! | `force_x_n` .. `force_z_n`, `torque_x_n_m` .. (or `_n_mm`; optional), `position_x_mm` .. (or `_m`), `orientation_w`, `_x`, `_y`, `_z` | raw |
//!
//! Raw forces act on the tool, in the tool's frame; positions are the tip's. Cells are empty where a slower sensor has no
//! sample. Lines `# gesture: tap`, `# origin: simulated`, `# source: ...` and those of [`TOUCH`] above the header hold the
//! metadata. Other columns are not used and are reported as a finding. A preamble above the header and a row of units below it are allowed.

mod alias;
mod clock;
mod guess;
mod hints;
mod join;
mod table;
mod units;
mod write;

pub use guess::{LikelyColumn, units_of};
pub(super) use table::{
    Cells, ColumnSelection, Fault, SignalColumns, Table, Taken, check_mapping, missing_columns, number,
};
#[cfg(all(feature = "spreadsheets", not(target_family = "wasm")))]
pub(super) use table::{is_wanted, words_without_units};
pub use units::QUANTITIES;
#[cfg(all(feature = "spreadsheets", not(target_family = "wasm")))]
pub(super) use units::is_unit;
pub(super) use units::{parse_name, parse_unit};
pub use write::write_csv;

use super::import::{Finding, ImportSettings, plausibility};
use super::{AnyRecording, Calibration, Gesture, Pose, ReadError, Recording, Wrench};
use haptograph_signal::csv::{Rows, cell_start};
use haptograph_signal::files::MAX_LINE_BYTES;
use haptograph_surfaces::bounds::largest;
use haptograph_surfaces::files::Place;
use haptograph_surfaces::provenance::{TOUCH, VIBRATION_UNIT, check_touch};
use haptograph_surfaces::recorder::AXES;
use haptograph_surfaces::{Origin, Provenance};
use std::io::BufRead;

/// The supported columns, with the unit in which they are written.
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

/// The metadata above the rows of a CSV file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CsvHead {
    /// True if there is a line `# gesture: ...`.
    pub says_gesture: bool,
    /// The origin from a line `# origin: ...`.
    pub origin: Option<Origin>,
    /// The columns, and what they probably hold.
    pub columns: Vec<LikelyColumn>,
}

/// The head of a file from its first bytes; `None` if they are not CSV.
pub fn csv_head(bytes: &[u8]) -> Option<CsvHead> {
    let is_binary = bytes.iter().take(512).any(|byte| *byte == 0);
    if is_binary || bytes.trim_ascii_start().starts_with(b"<") {
        return None;
    }
    let is_ours = |name: &str| parse_name(&name.to_lowercase()).is_some() || alias::is_like_ours(name);
    let (_, head) = Rows::new(bytes, &is_ours).ok()?;
    Some(CsvHead {
        says_gesture: head.notes.contains_key("gesture"),
        origin: head.notes.get("origin").and_then(|text| text.parse().ok()),
        columns: guess::guessed(&head.names),
    })
}

/// Reads a recording from the bytes of a CSV file that needs no repair. `source` names their origin, unless the file has a
/// line `# source: ...`.
pub fn read_csv(bytes: &[u8], source: &str) -> Result<AnyRecording, ReadError> {
    let import = ImportSettings::strict();
    let table = Table::read(bytes, &import, ColumnSelection::Recording)?;
    let read = recording(&mut [table], source, &import).map_err(|fault| fault.error)?;
    Ok(read.0)
}

/// Builds a recording from one or several tables of the same time, and lists the findings.
pub(super) fn recording(
    tables: &mut [Table],
    source: &str,
    import: &ImportSettings,
) -> Result<(AnyRecording, Vec<(usize, Finding)>), Fault> {
    let gesture = match noted(tables, "gesture") {
        Some((table, text)) => text.parse::<Gesture>().map_err(|message| table.fault(1, message))?,
        None => Gesture::Drag,
    };
    let origin = match noted(tables, "origin") {
        Some((table, text)) => text.parse::<Origin>().map_err(|message| table.fault(1, message))?,
        None => Origin::Imported,
    };
    let source = noted(tables, "source").map_or(source, |(_, text)| text.as_str());
    let mut provenance = Provenance::new(origin, source);
    for name in TOUCH {
        if let Some((table, text)) = noted(tables, name) {
            check_touch(name, text).map_err(|message| table.fault(1, message))?;
            provenance = provenance.with_setting(name, text);
        }
    }
    let mut findings = vec![];
    if import.units.iter().any(|(quantity, unit)| quantity.starts_with("accel") && unit == "1") {
        findings.push((0, Finding::UnknownUnit));
        provenance = provenance.with_setting(VIBRATION_UNIT, "not known; not m/s2");
    }
    join::share_clock(tables);
    let is_raw = is_raw(tables, import);
    join::set_constants(tables, &import.constants, is_raw);
    let recording = match is_raw {
        true => raw(tables, gesture, provenance).map(AnyRecording::Raw)?,
        false => join::processed(tables, import, gesture, provenance).map(AnyRecording::Processed)?,
    };
    for table in tables.iter_mut() {
        findings.extend(std::mem::take(&mut table.findings).into_iter().map(|finding| (table.file, finding)));
    }
    if let AnyRecording::Processed(processed) = &recording {
        let signals = processed.signals();
        let columns = [
            ("accel", &signals.acceleration_m_s2),
            ("force_normal", &signals.force_normal_n),
            ("speed", &signals.speed_m_s),
        ];
        for (name, values) in columns {
            if import.units.get(name).is_some_and(|unit| unit == "1") {
                continue;
            }
            let place = |table: &Table| Some((table.file, table.header_of(name)?.to_owned()));
            let (file, column) = tables.iter().find_map(place).unwrap_or((0, name.to_owned()));
            findings.extend(plausibility(name, &column, values).map(|finding| (file, finding)));
        }
    }
    Ok((recording, findings))
}

/// True if tables hold sensor readings: forces by axis, or orientations without the force and the acceleration of
/// processed recordings. Positions alone may belong to a processed recording, whose speed is derived from them.
fn is_raw(tables: &[Table], import: &ImportSettings) -> bool {
    let has = |name: &str| import.constants.contains_key(name) || tables.iter().any(|table| table.has(name));
    has("force_x") || has("orientation_w") && !has("force_normal") && !has("accel")
}

/// The first table with such a note, and the note.
fn noted<'a>(tables: &'a [Table], key: &str) -> Option<(&'a Table, &'a String)> {
    tables.iter().find_map(|table| table.notes.get(key).map(|note| (table, note)))
}

/// A constant in SI by its name with unit, such as `speed_mm_s`.
pub(super) fn constant(name: &str, value: &str) -> Result<(String, f64), String> {
    let lower = name.to_ascii_lowercase();
    let (plain, scale) = parse_name(&lower).unwrap_or_else(|| {
        Err(format!(
            "unknown quantity {name}; expected a recording's quantity with its unit, such as speed_mm_s"
        ))
    })?;
    match number(value.as_bytes(), scale) {
        Some(si) if largest(&plain).is_some_and(|(most, _)| si.abs() > most) => {
            Err(format!("{name} is {value}; that is more than any sensor gives"))
        }
        Some(si) => Ok((plain, si)),
        None => Err(format!("{value:?} is not a finite number")),
    }
}

fn raw(tables: &mut [Table], gesture: Gesture, provenance: Provenance) -> Result<Recording, Fault> {
    // If no table has it, the error comes from the first.
    let place = |tables: &[Table], name: &str| tables.iter().position(|table| table.has(name)).unwrap_or(0);
    let all = ["accel", "position"].iter().flat_map(|quantity| AXES.map(|axis| format!("{quantity}_{axis}")));
    let all = all.chain(["w", "x", "y", "z"].map(|part| format!("orientation_{part}")));
    let all = all.chain(AXES.map(|axis| format!("force_{axis}")));
    refuse_missing(tables, all.collect())?;
    let mut sensor = |names: &[&str]| {
        let place = place(tables, names[0]);
        tables[place].conform(names, Taken::Filled)
    };
    let acceleration = {
        let axes = sensor(&["accel_x", "accel_y", "accel_z"])?;
        axes.series(|i| axes.at(i, 0))
    };
    let poses = sensor(&[
        "position_x",
        "position_y",
        "position_z",
        "orientation_w",
        "orientation_x",
        "orientation_y",
        "orientation_z",
    ])?;
    let mut load = vec!["force_x", "force_y", "force_z"];
    let forces = place(tables, "force_x");
    if tables[forces].has("torque_x") {
        load.extend(["torque_x", "torque_y", "torque_z"]);
    }
    let load = tables[forces].conform(&load, Taken::Filled)?;
    let has_torque = load.columns.len() > 3;
    let pose = |i: usize| Pose { position_m: poses.at(i, 0), orientation: poses.at(i, 3) };
    let wrench = |i: usize| Wrench {
        force_n: load.at(i, 0),
        torque_n_m: if has_torque { load.at(i, 3) } else { [0.0; 3] },
    };
    Ok(Recording::new(
        poses.series(pose),
        load.series(wrench),
        acceleration,
        Calibration::default(),
        gesture,
        provenance,
    )?)
}

/// Reports all missing columns at once; the time too if a table has no rate.
pub(super) fn refuse_missing(tables: &[Table], wanted: Vec<String>) -> Result<(), ReadError> {
    let is_used = |table: &&Table| wanted.iter().any(|name| table.has(name));
    let used: Vec<&Table> = tables.iter().filter(is_used).collect();
    let lacks_rate = used.is_empty() && tables.iter().all(Table::lacks_rate)
        || used.iter().any(|table| table.lacks_rate());
    let mut missing: Vec<String> =
        { wanted.iter() }.filter(|name| !tables.iter().any(|table| table.has(name))).cloned().collect();
    if lacks_rate {
        missing.push("time".to_owned());
    }
    match missing.is_empty() {
        true => Ok(()),
        false => Err(missing_columns(&tables.iter().collect::<Vec<_>>(), missing)),
    }
}

impl ReadError {
    /// The location of the error in a CSV file, and its line, up to which `source` is read.
    pub fn place(&self, mut source: impl BufRead) -> Option<(Place, Vec<u8>)> {
        let (line, cell) = match self {
            ReadError::Csv { line, .. } => (*line, 1),
            ReadError::CsvCell { line, column, .. } => (*line, *column),
            _ => return None,
        };
        let line = usize::try_from(line).ok()?.max(1);
        for _ in 1..line {
            source.skip_until(b'\n').ok()?;
        }
        let mut text = vec![];
        // The line may be the one that does not end.
        let mut rest = source.take(MAX_LINE_BYTES as u64);
        rest.read_until(b'\n', &mut text).ok()?;
        text.pop_if(|last| *last == b'\n');
        let column = cell_start(&text, cell);
        Some((Place { line, column }, text))
    }
}
