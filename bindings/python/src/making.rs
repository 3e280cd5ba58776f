//! Surfaces of models that come from elsewhere: coefficients, line spectral frequencies or spectra, made by a program.

use crate::errors::Failure;
use crate::surfaces::Surface;
use crate::work::apart;
use haptograph::signal::warped::unwarp;
use haptograph::surfaces::hull::Hull;
use haptograph::surfaces::layers::Clips;
use haptograph::surfaces::lsf::ar_to_lsf;
use haptograph::surfaces::model::warping_for;
use haptograph::surfaces::provenance::LICENCE;
use haptograph::surfaces::taps::Tap;
use haptograph::surfaces::texture::VertexKind;
use haptograph::surfaces::{
    ArmaModel, Friction, ModelAt, Origin, Provenance, Stiffness, Surface as Whole, Taps, TextureModel,
};
use numpy::PyArray1;
use pyo3::prelude::*;
use std::f64::consts::{PI, TAU};

/// The parts of a surface.
#[derive(FromPyObject)]
pub(crate) struct Parts {
    #[pyo3(item)]
    rate: f64,
    /// What the numbers of a model are: `ar`, `lsf` or `cells`.
    #[pyo3(item)]
    form: String,
    #[pyo3(item)]
    warping: f64,
    #[pyo3(item)]
    order: usize,
    /// Force, speed, numbers, and the variance of the excitation, which cells do not need.
    #[pyo3(item)]
    models: Vec<(f64, f64, Vec<f64>, f64)>,
    #[pyo3(item)]
    range: (Option<f64>, Option<f64>),
    #[pyo3(item)]
    highpass: Option<f64>,
    #[pyo3(item)]
    excitation: Option<Vec<f64>>,
    #[pyo3(item)]
    taps_rate: f64,
    /// Speed and acceleration of each.
    #[pyo3(item)]
    taps: Vec<(f64, Vec<f64>)>,
    /// Friction coefficient and stiffness, N/m.
    #[pyo3(item)]
    resistance: (Option<f64>, Option<f64>),
    /// Where the numbers are from, and the licence of a recording in them.
    #[pyo3(item)]
    origin: (String, Option<String>),
}

impl Parts {
    fn model(
        &self,
        (force_n, speed_m_s, numbers, variance): &(f64, f64, Vec<f64>, f64),
    ) -> Result<ModelAt, Failure> {
        let model = match (self.form.as_str(), self.warping > 0.0) {
            ("cells", _) => ArmaModel::warped_from_cells(numbers, self.warping, self.rate, self.order),
            ("lsf", false) => ArmaModel::from_lsf(numbers, &[], 1.0, *variance),
            ("lsf", true) => ArmaModel::warped_from_lsf(numbers, self.warping, 0.0)
                .and_then(|model| model.with_variance(*variance)),
            (_, false) => ArmaModel::from_ar(numbers, *variance),
            (_, true) => ArmaModel::warped_from_ar(numbers, self.warping, *variance),
        };
        let model = model.map_err(|error| {
            Failure::Message(format!("the model at {force_n} N and {speed_m_s} m/s: {error}"))
        })?;
        Ok(ModelAt { speed_m_s: *speed_m_s, force_n: *force_n, model, kind: VertexKind::Fitted })
    }

    fn texture(&self) -> Result<Option<TextureModel>, Failure> {
        if self.models.is_empty() {
            return Ok(None);
        }
        let models = self.models.iter().map(|model| self.model(model)).collect::<Result<_, _>>()?;
        let (max_force_n, max_speed_m_s) = self.range;
        let hull = Hull { max_speed_m_s, max_force_n, ..Hull::default() };
        let texture = TextureModel::from_measured(self.rate, models, &hull)
            .and_then(|texture| texture.with_highpass_hz(self.highpass))
            .map_err(Failure::of)?;
        let clips = self.excitation.as_deref().map(Clips::new).transpose().map_err(Failure::of)?;
        Ok(Some(texture.with_clips(clips)))
    }

    fn surface(self, name: String) -> Result<Whole, Failure> {
        let (source, licence) = &self.origin;
        let mut provenance = Provenance::new(Origin::Procedural, source.clone());
        if let Some(licence) = licence {
            provenance = provenance.with_setting(LICENCE, licence);
        }
        let mut surface = Whole::new(name, provenance);
        surface.texture = self.texture()?;
        let (friction, stiffness) = self.resistance;
        let friction = friction.map(|mu| Friction::new(mu, None));
        surface.friction = friction.transpose().map_err(Failure::of)?;
        let stiffness = stiffness.map(|n_per_m| Stiffness::new(n_per_m * 1e-3, None));
        surface.stiffness = stiffness.transpose().map_err(Failure::of)?;
        let tap = |(speed_m_s, acceleration_m_s2)| Tap { speed_m_s, acceleration_m_s2, peak_force_n: None };
        let taps: Vec<Tap> = self.taps.into_iter().map(tap).collect();
        let taps = (!taps.is_empty()).then(|| Taps::new(self.taps_rate, taps));
        surface.taps = taps.transpose().map_err(Failure::of)?;
        Ok(surface)
    }
}

/// Makes a surface, with the checks of its file.
#[pyfunction]
pub(crate) fn make(py: Python<'_>, name: String, parts: Parts) -> PyResult<Surface> {
    apart(py, (None, false), move |_| parts.surface(name)).map(Surface::of)
}

/// The line spectral frequencies of a stable polynomial, rad.
#[pyfunction]
pub(crate) fn lsf(py: Python<'_>, ar: Vec<f64>) -> PyResult<Bound<'_, PyArray1<f64>>> {
    let mut lsf = vec![0.0; ar.len()];
    ar_to_lsf(&ar, &mut lsf).map_err(|error| Failure::of(error).raise(py))?;
    Ok(PyArray1::from_vec(py, lsf))
}

/// The warping factor for a rate, and the edges of cells of the warped axis, Hz.
#[pyfunction]
pub(crate) fn warped_axis(py: Python<'_>, rate: f64, cells: usize) -> (f64, Bound<'_, PyArray1<f64>>) {
    let warping = warping_for(rate);
    let edge = |cell: usize| unwarp(cell as f64 * PI / cells as f64, warping) * rate / TAU;
    (warping, PyArray1::from_iter(py, (0..=cells).map(edge)))
}
