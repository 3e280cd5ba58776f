//! Vibrations as files of phones and controllers.

use crate::errors::Failure;
use crate::work::apart;
use haptograph::learning::pattern::{BandLevels, Format, Loss, Pattern, encode};
use haptograph::signal::files::write_atomically;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Writes a vibration as a file, and says what is lost.
#[pyfunction]
pub(crate) fn export<'py>(
    py: Python<'py>,
    samples: PyReadonlyArray1<'_, f64>,
    rate: f64,
    unit: String,
    path: PathBuf,
) -> PyResult<Bound<'py, PyDict>> {
    let samples = samples.as_array().to_vec();
    let written = apart(py, (None, true), move |_| {
        let unwritten = |error| Failure::of(format!("cannot write {}: {error}", path.display()));
        let format = Format::of(&path).map_err(unwritten)?;
        let unsaid = |error| Failure::of(format!("the vibration cannot be exported: {error}"));
        let Pattern { text, loss } = encode(&samples, rate, &unit, format).map_err(unsaid)?;
        Ok(write_atomically(&path, text.as_bytes()).map(|()| loss))
    })?;
    let Loss { format, bytes, points, taps, full_scale, unit, envelope_db, lsd_db, bands, lost } = written?;
    let level = |db: Option<f64>| db.unwrap_or(f64::NEG_INFINITY);
    let row = |band: &BandLevels| (band.centre_hz, level(band.before_db), level(band.after_db));
    let bands: Vec<_> = bands.iter().map(row).collect();
    Ok(
        dict!(py; format: format, bytes: bytes, points: points, taps: taps, full_scale: full_scale, unit: unit,
        envelope: envelope_db, lsd: lsd_db, lost: lost, bands: bands),
    )
}
