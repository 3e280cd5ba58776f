//! Files as other people's loggers write them.

mod columns;
mod formats;
mod repair;
mod takes;

use super::*;
use std::path::PathBuf;

pub(super) struct Folder(tempfile::TempDir);

impl Folder {
    pub(super) fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    pub(super) fn with(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).expect("a file");
        path
    }

    /// A WAV file at 1 kHz.
    pub(super) fn wav(&self, name: &str, samples: impl Iterator<Item = f64>) -> PathBuf {
        let path = self.0.path().join(name);
        let spec = hound::WavSpec {
            channels: 1,
            sample_rate: 1000,
            bits_per_sample: 32,
            sample_format: hound::SampleFormat::Float,
        };
        let mut writer = hound::WavWriter::create(&path, spec).expect("a file");
        for sample in samples {
            writer.write_sample(sample as f32).expect("a sample");
        }
        writer.finalize().expect("a file");
        path
    }
}

pub(super) fn read(
    paths: &[PathBuf],
    import: &ImportSettings,
) -> Result<(ProcessedRecording, Vec<Finding>), LoadError> {
    load_with(paths, import).map(|(recording, findings)| match recording {
        AnyRecording::Processed(processed) => {
            (processed, findings.into_iter().map(|(_, finding)| finding).collect())
        }
        AnyRecording::Raw(_) => panic!("a raw recording"),
    })
}

pub(super) fn line_of(error: LoadError) -> (u64, usize) {
    match error {
        LoadError::Read { source: ReadError::CsvCell { line, column, .. }, .. } => (line, column),
        LoadError::Read { source: ReadError::Csv { line, .. }, .. } => (line, 0),
        error => panic!("{error}"),
    }
}

/// Rows of a drag at 1 kHz, as (time s, vibration m/s², force N, speed mm/s).
pub(super) fn rows(count: usize) -> impl Iterator<Item = (f64, f64, f64, f64)> {
    (0..count).map(|i| (i as f64 / 1000.0, (i as f64 * 0.7).sin(), 1.0 + (i as f64 * 0.01).sin() * 0.1, 80.0))
}

const HEAD: &str = "time_s,accel_m_s2,force_normal_n,speed_mm_s\n";

fn table(count: usize) -> Vec<String> {
    rows(count).map(|(t, a, f, v)| format!("{t:.4},{a},{f},{v}\n")).collect()
}

pub(super) fn import(columns: &[(&str, &str)], units: &[(&str, &str)]) -> ImportSettings {
    let import = columns.iter().fold(ImportSettings::default(), |import, (quantity, column)| {
        import.with_column(quantity, column).expect("a quantity")
    });
    units.iter().fold(import, |import, (quantity, unit)| import.with_unit(quantity, unit).expect("a unit"))
}
