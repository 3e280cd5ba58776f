//! Recordings written as CSV.

use super::super::{AnyRecording, ProcessedRecording, Recording};
use super::AXES;
use crate::files::decimal::format_thousandfold;
use crate::learning::processing;

/// The bytes of a CSV file. A raw recording comes out calibrated: acceleration in m/s² and forces in the tool's frame, positions of
/// the tip.
pub fn write_csv(recording: &AnyRecording) -> std::io::Result<Vec<u8>> {
    let provenance = recording.provenance();
    let one_line = |text: &str| text.replace(['\n', '\r'], " ");
    let mut bytes = format!(
        "# gesture: {}\n# origin: {}\n# source: {}\n",
        recording.gesture().word(),
        provenance.origin.word(),
        one_line(&provenance.source)
    )
    .into_bytes();
    let mut writer = csv::Writer::from_writer(&mut bytes);
    match recording {
        AnyRecording::Processed(processed) => write_processed(processed, &mut writer)?,
        AnyRecording::Raw(raw) => write_raw(raw, &mut writer)?,
    }
    writer.flush()?;
    drop(writer);
    Ok(bytes)
}

type Writer<'a> = csv::Writer<&'a mut Vec<u8>>;

fn write_processed(processed: &ProcessedRecording, writer: &mut Writer) -> std::io::Result<()> {
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
    writer.write_record(&header)?;
    for i in 0..processed.samples() {
        writer.write_field(format!("{}", i as f64 / signals.rate_hz))?;
        writer.write_field(format!("{:?}", signals.acceleration_m_s2[i]))?;
        for value in signals.axes_m_s2.iter().flat_map(|axes| axes[i]) {
            writer.write_field(format!("{value:?}"))?;
        }
        writer.write_field(format!("{:?}", signals.force_normal_n[i]))?;
        if let Some(tangential) = &signals.force_tangential_n {
            writer.write_field(format!("{:?}", tangential[i]))?;
        }
        writer.write_field(format_thousandfold(signals.speed_m_s[i]))?;
        writer.write_record(None::<&[u8]>)?;
    }
    Ok(())
}

fn write_raw(raw: &Recording, writer: &mut Writer) -> std::io::Result<()> {
    let mut header = vec!["time_s".to_owned()];
    header.extend(AXES.map(|axis| format!("accel_{axis}_m_s2")));
    header.extend(AXES.map(|axis| format!("force_{axis}_n")));
    header.extend(AXES.map(|axis| format!("torque_{axis}_n_mm")));
    header.extend(AXES.map(|axis| format!("position_{axis}_mm")));
    header.extend(["w", "x", "y", "z"].map(|part| format!("orientation_{part}")));
    writer.write_record(&header)?;
    let plain = |value: f64| format!("{value:?}");
    let acceleration = processing::acceleration_axes(raw);
    let load = processing::tool_wrench(raw);
    let tips = processing::tip_positions(raw);
    let mut next = [0; 3];
    loop {
        let times = [
            (next[0] < acceleration.len()).then(|| raw.acceleration_v().time_s(next[0])),
            (next[1] < load.len()).then(|| raw.wrench().time_s(next[1])),
            (next[2] < tips.len()).then(|| raw.motion().time_s(next[2])),
        ];
        let Some(now) = times.into_iter().flatten().min_by(f64::total_cmp) else {
            return Ok(());
        };
        let due = times.map(|time| time == Some(now));
        let mut row = vec![format!("{now}")];
        let mut put = |due: bool, width: usize, cells: &mut dyn Iterator<Item = String>| {
            if due {
                row.extend(cells);
            } else {
                row.extend(std::iter::repeat_n(String::new(), width));
            }
        };
        put(
            due[0],
            3,
            &mut acceleration.get(next[0]).into_iter().flatten().map(|&a| plain(a)),
        );
        put(
            due[1],
            3,
            &mut load.get(next[1]).into_iter().flat_map(|w| w.force_n).map(plain),
        );
        put(
            due[1],
            3,
            &mut load
                .get(next[1])
                .into_iter()
                .flat_map(|w| w.torque_n_m)
                .map(format_thousandfold),
        );
        put(
            due[2],
            3,
            &mut tips
                .get(next[2])
                .into_iter()
                .flatten()
                .map(|&p| format_thousandfold(p)),
        );
        let pose = raw.motion().samples.get(next[2]);
        put(
            due[2],
            4,
            &mut pose.into_iter().flat_map(|pose| pose.orientation).map(plain),
        );
        writer.write_record(&row)?;
        for (next, due) in next.iter_mut().zip(due) {
            *next += usize::from(due);
        }
    }
}
