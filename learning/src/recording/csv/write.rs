//! Recordings written as CSV.

use super::super::{AnyRecording, ProcessedRecording, Recording};
use haptograph_signal::units::decimal::format_thousandfold;
use haptograph_surfaces::recorder::{Clock, RawTable, origin_lines};
use std::io::Write;

/// Writes a recording as CSV. A raw recording is written calibrated: acceleration in m/s², forces in the tool's frame,
/// positions of the tip.
pub fn write_csv(recording: &AnyRecording) -> std::io::Result<Vec<u8>> {
    let mut bytes = origin_lines(recording.gesture(), recording.provenance()).into_bytes();
    match recording {
        AnyRecording::Processed(processed) => write_processed(processed, &mut bytes)?,
        AnyRecording::Raw(raw) => write_raw(raw, &mut bytes)?,
    }
    Ok(bytes)
}

fn write_processed(processed: &ProcessedRecording, writer: &mut Vec<u8>) -> std::io::Result<()> {
    let signals = processed.signals();
    let mut header = vec!["time_s", "accel_m_s2"];
    if signals.axes_m_s2.is_some() {
        header.extend(["accel_x_m_s2", "accel_y_m_s2", "accel_z_m_s2"]);
    }
    header.push("force_normal_n");
    if signals.force_tangential_n.is_some() {
        header.push("force_tangential_n");
    }
    header.push("speed_mm_s");
    writeln!(writer, "{}", header.join(","))?;
    for i in 0..processed.samples() {
        write!(writer, "{},{:?}", i as f64 / signals.rate_hz, signals.acceleration_m_s2[i])?;
        for value in signals.axes_m_s2.iter().flat_map(|axes| axes[i]) {
            write!(writer, ",{value:?}")?;
        }
        write!(writer, ",{:?}", signals.force_normal_n[i])?;
        if let Some(tangential) = &signals.force_tangential_n {
            write!(writer, ",{:?}", tangential[i])?;
        }
        writeln!(writer, ",{}", format_thousandfold(signals.speed_m_s[i]))?;
    }
    Ok(())
}

fn write_raw(raw: &Recording, bytes: &mut Vec<u8>) -> std::io::Result<()> {
    let (acceleration, wrench, motion) = (raw.acceleration_v(), raw.wrench(), raw.motion());
    let clocks = [
        (acceleration.rate_hz, acceleration.start_s),
        (wrench.rate_hz, wrench.start_s),
        (motion.rate_hz, motion.start_s),
    ];
    let clocks = clocks.map(|(rate_hz, start_s)| Clock { rate_hz, start_s });
    let mut table = RawTable::over(bytes, raw.calibration(), clocks)?;
    acceleration.iter().for_each(|volts| table.push_acceleration(&volts));
    wrench.iter().for_each(|load| table.push_load(&load));
    motion.samples.iter().for_each(|pose| table.push_pose(pose));
    table.finish().map(|_| ())
}
