//! Builds processed recordings from one table, or from several that share a clock: one has the vibration, others slower signals.

use super::super::{ProcessedRecording, ReadError, Series, Signals};
use super::table::{Even, Fault, Table};
use super::{AXES, Gesture, refuse_missing};
use crate::Provenance;
use crate::learning::processing;
use crate::recording::import::{Finding, shown};

/// The quantities besides the vibration.
const SLOW: [&str; 3] = ["force_normal", "speed", "force_tangential"];

pub(super) fn processed(
    tables: &mut [Table],
    gesture: Gesture,
    provenance: Provenance,
) -> Result<ProcessedRecording, Fault> {
    let has_axes = |table: &Table| AXES.iter().all(|axis| table.has(&format!("accel_{axis}")));
    let has_axes_somewhere = tables.iter().any(has_axes);
    let mut wanted: Vec<String> = ["force_normal", "speed"].map(str::to_owned).to_vec();
    match has_axes_somewhere && !tables.iter().any(|table| table.has("accel")) {
        true => wanted.extend(AXES.map(|axis| format!("accel_{axis}"))),
        false => wanted.insert(0, "accel".to_owned()),
    }
    refuse_missing(tables, wanted)?;
    let has_vibration = |table: &Table| table.has("accel") || has_axes(table);
    let first = tables.iter().position(has_vibration).unwrap_or(0);
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
            Some(table) if !vibration.has(name) => there.push((name, table)),
            _ if name == "force_tangential" && !vibration.has(name) => {}
            _ => here.push(name),
        }
    }
    names.extend(&here);
    let mut taken = vibration.take(&names)?;
    let mut slow = vec![];
    for (name, table) in there {
        let one = others[table].take(&[name])?;
        files.push(names_of_files[table + 1].as_str());
        slow.push((
            name,
            Series {
                rate_hz: one.rate_hz,
                start_s: one.start_s,
                samples: one.columns.into_iter().next().unwrap_or_default(),
            },
        ));
    }
    let cuts = cuts(&taken, &slow, &names_of_files[0], &files);
    vibration.findings.extend(cuts);
    cut_to_common_time(&mut taken, &slow).map_err(|message| vibration.fault(header_line, message))?;
    let mut columns = taken.columns.into_iter();
    let acceleration = names
        .contains(&"accel")
        .then(|| columns.next().unwrap_or_default());
    let axes_m_s2 = axes.then(|| zipped(std::array::from_fn(|_| columns.next().unwrap_or_default())));
    let mut signals = Signals {
        rate_hz: taken.rate_hz,
        axes_m_s2,
        ..Signals::default()
    };
    for (name, values) in here.into_iter().zip(columns) {
        put(&mut signals, name, values);
    }
    let acceleration = acceleration.map_or_else(|| combined(&signals), Ok);
    signals.acceleration_m_s2 = acceleration.map_err(|message| vibration.fault(header_line, message))?;
    for (name, series) in slow {
        let time = |i: usize| taken.start_s + i as f64 / taken.rate_hz;
        let values = (0..signals.acceleration_m_s2.len())
            .map(|i| series.at(time(i)))
            .collect();
        put(&mut signals, name, values);
    }
    Ok(ProcessedRecording::new(signals, gesture, provenance)?)
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
    let samples = taken.columns.first().map_or(0, Vec::len);
    let own_end = taken.start_s + samples.saturating_sub(1) as f64 / taken.rate_hz;
    let spans: Vec<(&str, f64, f64)> = std::iter::once((own, taken.start_s, own_end))
        .chain(
            series
                .iter()
                .zip(files)
                .map(|((_, s), file)| (*file, s.start_s, s.end_s())),
        )
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
    let samples = taken.columns.first().map_or(0, Vec::len);
    let begin = series
        .iter()
        .map(|(_, s)| s.start_s)
        .fold(taken.start_s, f64::max);
    let own_end = taken.start_s + samples.saturating_sub(1) as f64 / taken.rate_hz;
    let end = series.iter().map(|(_, s)| s.end_s()).fold(own_end, f64::min);
    if begin >= end {
        return Err(format!(
            "the files do not overlap in time: the last begins at {} s, the first ends at {} s",
            shown(begin),
            shown(end)
        ));
    }
    let place = |time: f64| (time - taken.start_s) * taken.rate_hz;
    let first = (place(begin) - 1e-6).ceil().max(0.0) as usize;
    let past = ((place(end) + 1e-6).floor() as usize + 1).min(samples);
    for column in &mut taken.columns {
        column.truncate(past);
        column.drain(..first);
    }
    taken.start_s += first as f64 / taken.rate_hz;
    Ok(())
}
