//! Vibrations in WAV files.

use super::super::csv::{Cells, ColumnSelection, Table};
use super::super::{ImportSettings, ReadError};
use hound::{SampleFormat, WavReader};

/// One channel is the acceleration, three are its axes; of any other number, one channel is selected by its number.
pub(in crate::recording) fn wav(
    bytes: &[u8],
    import: &ImportSettings,
    wanted: ColumnSelection<'_>,
) -> Result<Table, ReadError> {
    let wrong = |message: String| ReadError::Io(message);
    let mut reader = WavReader::new(bytes).map_err(|error| match error {
        hound::Error::IoError(_) => wrong("the WAV file ends within its header; copy it again".to_owned()),
        other => wrong(format!("the WAV file is damaged: {other}")),
    })?;
    let announced = reader.len();
    let spec = reader.spec();
    let full_scale = import.full_scale_m_s2.ok_or_else(|| {
        wrong(
            "a WAV file contains no unit; give the acceleration of its full scale 1.0 in m/s² with --full-scale"
                .to_owned(),
        )
    })?;
    let mut read = 0_u32;
    let count = |x: Result<f64, hound::Error>| x.inspect(|_| read += 1);
    let samples: Result<Vec<f64>, _> = match spec.sample_format {
        SampleFormat::Float => { reader.samples::<f32>() }.map(|x| x.map(f64::from)).map(count).collect(),
        SampleFormat::Int => {
            let unit = 2_f64.powi(i32::from(spec.bits_per_sample) - 1);
            reader.samples::<i32>().map(|x| x.map(|x| f64::from(x) / unit)).map(count).collect()
        }
    };
    let samples = samples.map_err(|error| match error {
        hound::Error::IoError(_) => wrong(format!(
            "the WAV file is cut off: its header announces {announced} samples, and {read} are there; \
             `haptograph recover` makes it readable up to its end"
        )),
        other => wrong(format!("the WAV file is damaged: {other}")),
    })?;
    let channels = usize::from(spec.channels);
    let names: Vec<String> = match channels {
        1 => vec!["accel_m_s2".to_owned()],
        3 => ["x", "y", "z"].map(|axis| format!("accel_{axis}_m_s2")).to_vec(),
        _ => (1..=channels).map(|channel| channel.to_string()).collect(),
    };
    let channel =
        |index: usize| samples.iter().skip(index).step_by(channels).map(|x| x * full_scale).collect();
    let mut cells = Cells { columns: (0..channels).map(channel).collect(), names, ..Cells::default() };
    for row in 0..samples.len() / channels.max(1) {
        cells.lines.push(row as u64 + 1);
    }
    let mut import = import.clone();
    // The full scale gives the unit.
    import.units.insert("accel".to_owned(), "m_s2".to_owned());
    import.rate_hz = Some(f64::from(spec.sample_rate));
    Table::of_cells(cells, &import, wanted)
}
