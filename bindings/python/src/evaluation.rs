//! The error of a surface along a recording, and the parameters of an actuator from its sweep.

use crate::errors::Failure;
use crate::recordings::{Import, Recording};
use crate::surfaces::{Surface, put_bands};
use crate::work::apart;
use haptograph::learning::evaluate::{HoldoutSettings, measure};
use haptograph::learning::recording::{AnyRecording, load_sweep};
use haptograph::nodes::actuators::identify::{Known, Sweep, identify as fit};
use haptograph::nodes::simulated::haptuator::TwoMassSettings;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// The errors of a surface, rendered along a processed recording of its rate from several seeds.
#[pyfunction]
pub(crate) fn evaluate<'py>(
    py: Python<'py>,
    surface: PyRef<'_, Surface>,
    recording: PyRef<'_, Recording>,
    seeds: u64,
    seed: u64,
) -> PyResult<Bound<'py, PyDict>> {
    let texture = surface.texture(py)?.clone();
    let recording = Arc::clone(&recording.recording);
    let (found, chance_db) = apart(py, (None, false), move |_| match &*recording {
        AnyRecording::Processed(recording) => {
            let settings = HoldoutSettings { seeds, seed, ..HoldoutSettings::default() };
            measure(&texture, recording, &settings).map_err(Failure::of)
        }
        AnyRecording::Raw(_) => Err(Failure::of("the recording has sensor readings: give `processed()`")),
    })?;
    let told = PyDict::new(py);
    put_bands(&told, &found.bands)?;
    told.set_item("chance_lsd", (!found.bands.bands.is_empty()).then_some(chance_db))?;
    told.set_item("kurtosis", found.kurtosis)?;
    told.set_item("envelope", found.envelope_db)?;
    told.set_item("envelope_seeds", found.envelope_floor_db)?;
    told.set_item("nse", found.nse_pe.map(|(nse, _)| nse))?;
    told.set_item("pe", found.nse_pe.map(|(_, pe)| pe))?;
    Ok(told)
}

/// Currents, accelerations and rate of the sweep in a file, and what was found and repaired.
type Swept<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, f64, Vec<String>);

/// Reads the sweep in a file.
#[pyfunction]
pub(crate) fn sweep(py: Python<'_>, path: PathBuf, settings: Import) -> PyResult<Swept<'_>> {
    let import = settings.settings().map_err(|failure| failure.raise(py))?;
    let (sweep, findings) =
        apart(py, (None, false), move |_| load_sweep(&path, &import).map_err(Failure::of))?;
    let array = |values| PyArray1::from_vec(py, values);
    let findings = findings.iter().map(ToString::to_string).collect();
    Ok((array(sweep.current_a), array(sweep.acceleration_m_s2), sweep.rate_hz, findings))
}

/// Fits an actuator to a sweep; `known` are the magnet's mass (kg), that of the body (kg), and the force per current (N/A).
#[pyfunction]
pub(crate) fn identify<'py>(
    py: Python<'py>,
    current: PyReadonlyArray1<'_, f64>,
    acceleration: PyReadonlyArray1<'_, f64>,
    rate: f64,
    band: [f64; 2],
    known: (Option<f64>, Option<f64>, Option<f64>),
) -> PyResult<Bound<'py, PyDict>> {
    let known = match known {
        (Some(magnet_kg), Some(body_kg), _) => Known::Masses { magnet_kg, body_kg },
        (Some(magnet_kg), None, Some(force_n_per_a)) => Known::MagnetAndForce { magnet_kg, force_n_per_a },
        _ => Known::Nothing,
    };
    let [current, acceleration] = [current, acceleration].map(|values| values.as_array().to_vec());
    let found = apart(py, (None, false), move |_| {
        let (current_a, acceleration_m_s2) = (&current, &acceleration);
        fit(&Sweep { current_a, acceleration_m_s2, rate_hz: rate, band_hz: band }, known).map_err(Failure::of)
    })?;
    let parameters = found.parameters.map(|model| {
        let model = TwoMassSettings::from(model);
        let named = [
            ("force_n_per_a", model.force_n_per_a),
            ("magnet_g", model.magnet_g.0),
            ("suspension_n_per_mm", model.suspension_n_per_mm.0),
            ("suspension_n_s_per_m", model.suspension_n_s_per_m),
            ("body_g", model.body_g.0),
            ("hand_n_per_mm", model.hand_n_per_mm.0),
            ("hand_n_s_per_m", model.hand_n_s_per_m),
        ];
        named.to_vec()
    });
    let resonances = found.modes.map(|mode| (mode.frequency_hz, mode.q)).to_vec();
    Ok(dict!(py; resonances: resonances, gain: found.response.gain, delay: found.delay_s,
        unexplained: found.unexplained, parameters: parameters))
}
