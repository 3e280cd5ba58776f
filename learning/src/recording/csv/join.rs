//! Builds processed recordings from one table, or from several that share a clock: one has the vibration, others slower signals.

use super::super::{ImportSettings, ProcessedRecording, ReadError, Series, Signals};
use super::table::{Even, Fault, Table, Taken};
use super::{AXES, Gesture, refuse_missing};
use crate::processing::{self, ProcessingSettings};
use crate::recording::import::{Finding, shown};
use haptograph_surfaces::Provenance;
use std::collections::BTreeMap;

/// The quantities besides the vibration.
const SLOW: [&str; 3] = ["force_normal", "speed", "force_tangential"];

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

pub(super) fn processed(
    tables: &mut [Table],
    import: &ImportSettings,
    gesture: Gesture,
    provenance: Provenance,
) -> Result<ProcessedRecording, Fault> {
    let has_axes = |table: &Table| AXES.iter().all(|axis| table.has(&format!("accel_{axis}")));
    let has_axes_somewhere = tables.iter().any(has_axes);
    let positions = place_of_positions(tables);
    let mut wanted = vec!["force_normal".to_owned()];
    if positions.is_none() {
        wanted.push("speed".to_owned());
    }
    match has_axes_somewhere && !tables.iter().any(|table| table.has("accel")) {
        true => wanted.extend(AXES.map(|axis| format!("accel_{axis}"))),
        false => wanted.insert(0, "accel".to_owned()),
    }
    refuse_missing(tables, wanted)?;
    let has_vibration = |table: &Table| table.has("accel") || has_axes(table);
    let mut vibrating = tables.iter().filter(|table| has_vibration(table));
    if let (Some(one), Some(other)) = (vibrating.next(), vibrating.next()) {
        let message = format!(
            "{} and {} both have an acceleration; leave one out, or put the axes into one file",
            one.label, other.label
        );
        return Err(other.fault(other.header_line, message));
    }
    let first = tables.iter().position(has_vibration).unwrap_or(0);
    let speed = positions.map(|place| speed_of_position(&mut tables[place], import)).transpose()?;
    tables.swap(0, first);
    let names_of_files: Vec<String> = tables.iter().map(|table| table.label.clone()).collect();
    let Some((vibration, others)) = tables.split_first_mut() else {
        return Err(ReadError::Io("there are no tables".to_owned()).into());
    };
    let (header_line, axes) = (vibration.header_line, has_axes(vibration));
    let mut names = vec![];
    if vibration.has("accel") || !axes {
        names.push("accel");
    }
    if axes {
        names.extend(["accel_x", "accel_y", "accel_z"]);
    }
    let elsewhere = |name: &str| others.iter().position(|table| table.has(name));
    let (mut here, mut there) = (vec![], vec![]);
    let mut files = vec![];
    for name in SLOW {
        match elsewhere(name) {
            _ if name == "speed" && speed.is_some() => {}
            Some(table) if !vibration.has(name) => there.push((name, table)),
            _ if name == "force_tangential" && !vibration.has(name) => {}
            _ => here.push(name),
        }
    }
    names.extend(&here);
    let mut taken = vibration.conform(&names, Taken::All)?;
    let mut slow = vec![];
    for (name, table) in there {
        let one = others[table].conform(&[name], Taken::All)?;
        files.push(names_of_files[table + 1].as_str());
        slow.push((name, one.series(|i| one.columns[0][i])));
    }
    if let Some((file, series)) = &speed {
        files.push(file);
        slow.push(("speed", series.clone()));
    }
    let cuts = cuts(&taken, &slow, &names_of_files[0], &files);
    vibration.findings.extend(cuts);
    cut_to_common_time(&mut taken, &slow).map_err(|message| vibration.fault(header_line, message))?;
    let mut columns = taken.columns.into_iter();
    let acceleration = names.contains(&"accel").then(|| columns.next().unwrap_or_default());
    let axes_m_s2 = axes.then(|| zipped(std::array::from_fn(|_| columns.next().unwrap_or_default())));
    let mut signals = Signals { rate_hz: taken.rate_hz, axes_m_s2, ..Signals::default() };
    for (name, values) in here.into_iter().zip(columns) {
        put(&mut signals, name, values);
    }
    signals.acceleration_m_s2 = match acceleration {
        Some(mut values) => {
            let has_unit = import.units.get("accel").is_none_or(|unit| unit != "1");
            if !import.keeps_offset {
                let taken = vibration.take_offset("accel", has_unit, &mut values, signals.rate_hz);
                taken.map_err(|error| vibration.at_fault(error))?;
            }
            values
        }
        None => combined(&signals).map_err(|message| vibration.fault(header_line, message))?,
    };
    for (name, series) in slow {
        let time = |i: usize| taken.start_s + i as f64 / taken.rate_hz;
        let values = (0..signals.acceleration_m_s2.len()).map(|i| series.at(time(i))).collect();
        put(&mut signals, name, values);
    }
    Ok(ProcessedRecording::new(signals, gesture, provenance)?)
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

/// The speed from the positions of a table, computed as for raw recordings, and the name of its file.
fn speed_of_position(table: &mut Table, import: &ImportSettings) -> Result<(String, Series<f64>), Fault> {
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
    Ok((table.label.clone(), series))
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
fn cuts(taken: &Even, series: &[(&str, Series<f64>)], own: &str, files: &[&str]) -> Vec<Finding> {
    let spans: Vec<(&str, f64, f64)> = std::iter::once((own, taken.start_s, taken.end_s()))
        .chain(series.iter().zip(files).map(|((_, s), file)| (*file, s.start_s, s.end_s())))
        .collect();
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
fn cut_to_common_time(taken: &mut Even, series: &[(&str, Series<f64>)]) -> Result<(), String> {
    let begin = series.iter().map(|(_, s)| s.start_s).fold(taken.start_s, f64::max);
    let end = series.iter().map(|(_, s)| s.end_s()).fold(taken.end_s(), f64::min);
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
