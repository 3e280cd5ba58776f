//! Builds processed recordings from one table, or from several that share a clock: one has the vibration, others slower signals.

use super::super::{ImportSettings, ProcessedRecording, ReadError, Series, Signals};
use super::table::{Even, Fault, Table, Taken};
use super::{Gesture, refuse_missing};
use crate::processing::{self, ProcessingSettings};
use crate::recording::import::{Finding, shown};
use haptograph_surfaces::Provenance;
use std::collections::BTreeMap;

/// The quantities besides the vibration.
const SLOW: [&str; 3] = ["force_normal", "speed", "force_tangential"];
/// The axes of the vibration.
const ACCELERATIONS: [&str; 3] = ["accel_x", "accel_y", "accel_z"];

/// Counts the times of all tables from the first of their origins.
pub(super) fn share_clock(tables: &mut [Table]) {
    let origins = tables.iter().filter_map(Table::origin_s);
    let first = origins.fold(f64::INFINITY, f64::min);
    tables.iter_mut().for_each(|table| table.count_from(first));
}

/// Adds quantities that did not change, to one table each, whatever the order of the files: raw ones to that of their sensor, all others to
/// that of the vibration.
pub(super) fn set_constants(tables: &mut [Table], constants: &BTreeMap<String, f64>, is_raw: bool) {
    let first_word = |name: &str| name.split('_').next().unwrap_or_default().to_owned();
    for (name, value) in constants {
        let sensor: &[&str] = match &*first_word(name) {
            _ if !is_raw => &["accel", "accel_x"],
            "position" | "orientation" => &["position_x", "orientation_w"],
            "force" | "torque" => &["force_x"],
            _ => &["accel_x"],
        };
        tables.iter_mut().for_each(|table| table.remove(name));
        let own = |table: &Table| sensor.iter().any(|column| table.has(column));
        let place = tables.iter().position(own).unwrap_or(0);
        if let Some(table) = tables.get_mut(place) {
            table.set_constant(name, *value);
        }
    }
}

/// A signal that is not in the table of the vibration, and its file.
struct Slow {
    name: &'static str,
    file: String,
    series: Series<f64>,
}

pub(super) fn processed(
    tables: &mut [Table],
    import: &ImportSettings,
    gesture: Gesture,
    provenance: Provenance,
) -> Result<ProcessedRecording, Fault> {
    let positions = place_of_positions(tables);
    refuse_missing(tables, needed(tables, positions.is_some()))?;
    let first = place_of_vibration(tables)?;
    let speed = positions.map(|place| speed_of_position(&mut tables[place], import)).transpose()?;
    tables.swap(0, first);
    let Some((vibration, others)) = tables.split_first_mut() else {
        return Err(ReadError::Io("there are no tables".to_owned()).into());
    };
    let mut names = vec![];
    if vibration.has("accel") || !has_axes(vibration) {
        names.push("accel");
    }
    if has_axes(vibration) {
        names.extend(ACCELERATIONS);
    }
    let (here, there): (Vec<&'static str>, Vec<_>) = { SLOW.into_iter() }
        .filter(|name| *name != "speed" || speed.is_none())
        .partition(|name| vibration.has(name));
    names.extend(here);
    let mut taken = vibration.conform(&names, Taken::All)?;
    // Nothing more is taken from it.
    vibration.remove("time");
    let mut slow = vec![];
    for name in there {
        if let Some(table) = others.iter_mut().find(|table| table.has(name)) {
            let one = table.conform(&[name], Taken::All)?;
            slow.push(Slow { name, file: table.label.clone(), series: one.series(|i| one.columns[0][i]) });
        }
    }
    slow.extend(speed);
    vibration.findings.extend(cuts(&taken, &vibration.label, &slow));
    cut_to_common_time(&mut taken, &slow)
        .map_err(|message| vibration.fault(vibration.header_line, message))?;
    Ok(ProcessedRecording::new(signals(vibration, taken, &names, &slow, import)?, gesture, provenance)?)
}

/// The columns that some table must have.
fn needed(tables: &[Table], has_positions: bool) -> Vec<String> {
    let mut needed = vec!["force_normal"];
    if !has_positions {
        needed.push("speed");
    }
    match tables.iter().any(has_axes) && !tables.iter().any(|table| table.has("accel")) {
        true => needed.extend(ACCELERATIONS),
        false => needed.insert(0, "accel"),
    }
    needed.into_iter().map(str::to_owned).collect()
}

fn has_axes(table: &Table) -> bool {
    ACCELERATIONS.iter().all(|axis| table.has(axis))
}

/// The only table with the vibration.
fn place_of_vibration(tables: &[Table]) -> Result<usize, Fault> {
    let vibrating = |table: &&Table| table.has("accel") || has_axes(table);
    let mut all = tables.iter().filter(vibrating);
    if let (Some(one), Some(other)) = (all.next(), all.next()) {
        let message = format!(
            "{} and {} both have an acceleration; leave one out, or put the axes into one file",
            one.label, other.label
        );
        return Err(other.fault(other.header_line, message));
    }
    Ok(tables.iter().position(|table| vibrating(&table)).unwrap_or(0))
}

/// The signals at the times of the vibration, whose columns have these names.
fn signals(
    vibration: &mut Table,
    taken: Even,
    names: &[&'static str],
    slow: &[Slow],
    import: &ImportSettings,
) -> Result<Signals, Fault> {
    let (start_s, rate_hz, samples) = (taken.start_s, taken.rate_hz, taken.samples());
    let mut signals = Signals { rate_hz, ..Signals::default() };
    let (mut acceleration, mut axes) = (None, vec![]);
    for (name, values) in names.iter().zip(taken.columns) {
        match *name {
            "accel" => acceleration = Some(values),
            axis if axis.starts_with("accel") => axes.push(values),
            name => put(&mut signals, name, values),
        }
    }
    signals.axes_m_s2 = <[Vec<f64>; 3]>::try_from(axes).ok().map(zipped);
    signals.acceleration_m_s2 = match acceleration {
        Some(mut values) => {
            let has_unit = import.units.get("accel").is_none_or(|unit| unit != "1");
            if !import.keeps_offset {
                let taken = vibration.take_offset("accel", has_unit, &mut values, rate_hz);
                taken.map_err(|error| vibration.at_fault(error))?;
            }
            values
        }
        None => combined(&signals).map_err(|message| vibration.fault(vibration.header_line, message))?,
    };
    for Slow { name, series, .. } in slow {
        let values = (0..samples).map(|i| series.at(start_s + i as f64 / rate_hz)).collect();
        put(&mut signals, name, values);
    }
    Ok(signals)
}

/// The table from whose positions the speed is derived, if no table has a speed.
fn place_of_positions(tables: &mut [Table]) -> Option<usize> {
    let has_speed = tables.iter().any(|table| table.has("speed"));
    let place = tables.iter().position(|table| !table.columns_of(&POSITIONS).is_empty())?;
    if !has_speed {
        return Some(place);
    }
    for table in tables.iter_mut() {
        let columns = table.columns_of(&POSITIONS);
        let columns: Vec<String> = columns.iter().map(|(_, header)| header.clone()).collect();
        if !columns.is_empty() {
            table.findings.push(Finding::NotUsed { columns });
        }
    }
    None
}

const POSITIONS: [&str; 3] = ["position_x", "position_y", "position_z"];

/// The speed from the positions of a table, computed as for raw recordings.
fn speed_of_position(table: &mut Table, import: &ImportSettings) -> Result<Slow, Fault> {
    let columns = table.columns_of(&POSITIONS);
    let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let even = table.conform(&names, Taken::All)?;
    let tip = |i: usize| -> [f64; 3] {
        std::array::from_fn(|axis| even.columns.get(axis).map_or(0.0, |column| column[i]))
    };
    let tips: Vec<[f64; 3]> = (0..even.samples()).map(tip).collect();
    let usual = ProcessingSettings::default();
    let settings = ProcessingSettings {
        velocity_lowpass_hz: import.velocity_lowpass_hz.unwrap_or(usual.velocity_lowpass_hz),
        ..usual
    };
    let speeds = processing::speeds(&tips, even.rate_hz, &settings);
    let samples = speeds.map_err(|error| table.fault(table.header_line, error))?;
    table.findings.push(Finding::SpeedOfPosition {
        columns: columns.into_iter().map(|(_, header)| header).collect(),
        cutoff_hz: settings.velocity_lowpass_hz.min(0.45 * even.rate_hz),
    });
    let series = Series { rate_hz: even.rate_hz, start_s: even.start_s, samples };
    Ok(Slow { name: "speed", file: table.label.clone(), series })
}

fn put(signals: &mut Signals, name: &str, values: Vec<f64>) {
    match name {
        "force_normal" => signals.force_normal_n = values,
        "speed" => signals.speed_m_s = values,
        _ => signals.force_tangential_n = Some(values),
    }
}

fn combined(signals: &Signals) -> Result<Vec<f64>, String> {
    let axes = signals.axes_m_s2.as_deref().unwrap_or_default();
    processing::combined(axes, signals.rate_hz, &Default::default()).map_err(|error| error.to_string())
}

fn zipped([x, y, z]: [Vec<f64>; 3]) -> Vec<[f64; 3]> {
    x.into_iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z]).collect()
}

/// Shorter unused parts are not reported, s.
const UNUSED_S: f64 = 0.1;

/// Findings for files of one take that begin or end at different times: the unused part of the longest.
fn cuts(taken: &Even, own: &str, slow: &[Slow]) -> Vec<Finding> {
    let others = slow.iter().map(|Slow { file, series, .. }| (&**file, series.start_s, series.end_s()));
    let spans: Vec<(&str, f64, f64)> =
        std::iter::once((own, taken.start_s, taken.end_s())).chain(others).collect();
    let extremes = |begins: bool| {
        let at = |&(file, begin, end): &(&str, f64, f64)| (file.to_owned(), if begins { begin } else { end });
        let all = spans.iter().map(at);
        let by_time = |a: &(String, f64), b: &(String, f64)| a.1.total_cmp(&b.1);
        let (first, last) = (all.clone().min_by(by_time)?, all.max_by(by_time)?);
        // The one that begins last, or ends first, is the shorter.
        let ((short, short_s), (long, long_s)) = if begins { (last, first) } else { (first, last) };
        ((long_s - short_s).abs() > UNUSED_S && short != long).then_some(Finding::Cut {
            begins,
            short,
            short_s,
            long,
            long_s,
        })
    };
    [true, false].into_iter().filter_map(extremes).collect()
}

/// Keeps the samples that lie in the time of all series.
fn cut_to_common_time(taken: &mut Even, slow: &[Slow]) -> Result<(), String> {
    let begin = slow.iter().map(|slow| slow.series.start_s).fold(taken.start_s, f64::max);
    let end = slow.iter().map(|slow| slow.series.end_s()).fold(taken.end_s(), f64::min);
    if begin >= end {
        return Err(format!(
            "the files do not overlap in time: the last begins at {} s, the first ends at {} s",
            shown(begin),
            shown(end)
        ));
    }
    let place = |time: f64| (time - taken.start_s) * taken.rate_hz;
    let first = (place(begin) - 1e-6).ceil().max(0.0) as usize;
    let past = ((place(end) + 1e-6).floor() as usize + 1).min(taken.samples());
    for column in &mut taken.columns {
        column.truncate(past);
        column.drain(..first);
    }
    taken.start_s += first as f64 / taken.rate_hz;
    Ok(())
}
