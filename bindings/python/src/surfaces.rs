//! Surfaces: learning, files, models and rendering; and the comparison of two vibrations.

use crate::errors::Failure;
use crate::recordings::Recording;
use crate::work::{apart, apart_within};
use haptograph::learning::learn::law::LawSettings;
use haptograph::learning::learn::texture::{Fate, TextureSettings};
use haptograph::learning::learn::{
    self as library, LearnError, LearnSettings, LearningReport, TextureMethod,
};
use haptograph::learning::metrics::{self, BandErrors, Bands, WindowSettings};
use haptograph::learning::processing::ProcessingSettings;
use haptograph::learning::recording::{AnyRecording, remove_offset};
use haptograph::report::figures::triangulation;
use haptograph::report::learning::page;
use haptograph::report::plot::{Axis, Plot};
use haptograph::signal::resample::{Quality, resample_whole};
use haptograph::signal::time::Rate;
use haptograph::surfaces::files::{self, native, read_surface};
use haptograph::surfaces::rendering::{
    SynthesisSettings, Trajectory, UpdatePoints, VoiceInto, synthesise_into, synthesise_with,
};
use haptograph::surfaces::resampling::{Method, resample_surface};
use haptograph::surfaces::{ArmaModel, Coefficients, Interpolator, Origin, Recorded, TextureModel};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::fmt::Display;
use std::path::PathBuf;
use std::sync::Arc;

/// A surface: friction, taps, texture and stiffness of one material.
#[pyclass(frozen, module = "haptograph._native")]
pub struct Surface {
    surface: Arc<haptograph::surfaces::Surface>,
    report: Option<Arc<LearningReport>>,
}

/// Options of learning.
#[derive(FromPyObject)]
pub(crate) struct Learning {
    #[pyo3(item)]
    method: String,
    #[pyo3(item)]
    order: Option<usize>,
    #[pyo3(item)]
    rate: Option<f64>,
    #[pyo3(item)]
    accept_rate: bool,
    #[pyo3(item)]
    clips: bool,
}

impl Learning {
    fn settings(&self) -> Result<LearnSettings, Failure> {
        let texture = match self.method.as_str() {
            "law" => {
                let usual = LawSettings::default();
                let order = self.order.unwrap_or(usual.order);
                TextureMethod::Law(LawSettings { order, clips: self.clips, ..usual })
            }
            "thesis" => {
                TextureMethod::Thesis(TextureSettings { order: self.order, ..TextureSettings::default() })
            }
            other => {
                let message = format!("there is no method {other:?}: choose of law, thesis");
                return Err(Failure::Message(message));
            }
        };
        let processing = ProcessingSettings { rate_hz: self.rate, ..ProcessingSettings::default() };
        Ok(LearnSettings { processing, texture, accept_rate: self.accept_rate, ..LearnSettings::default() })
    }
}

/// Learns a surface from recordings.
#[pyfunction]
pub(crate) fn learn(
    py: Python<'_>,
    name: String,
    recordings: Vec<PyRef<'_, Recording>>,
    settings: Learning,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Surface> {
    let settings = settings.settings().map_err(|failure| failure.raise(py))?;
    let recordings: Vec<Arc<AnyRecording>> =
        recordings.iter().map(|one| Arc::clone(&one.recording)).collect();
    let (surface, report) = apart(py, (progress, false), move |progress| {
        let recordings: Vec<AnyRecording> = recordings.iter().map(|one| (**one).clone()).collect();
        let learned = library::learn(&name, &recordings, &settings, &|part| progress.at_or_end(part));
        learned.map_err(|error| match error {
            LearnError::Slow { .. } => {
                Failure::of(format!("{error}; `accept_rate=True` learns from it as it is"))
            }
            error => Failure::of(error),
        })
    })?;
    Ok(Surface { surface: Arc::new(surface), report: Some(Arc::new(report)) })
}

impl Surface {
    pub(crate) fn of(surface: haptograph::surfaces::Surface) -> Self {
        Self { surface: Arc::new(surface), report: None }
    }

    pub(crate) fn texture(&self, py: Python<'_>) -> PyResult<&TextureModel> {
        let none =
            || Failure::Message(format!("the surface {:?} has no texture", self.surface.name)).raise(py);
        self.surface.texture.as_ref().ok_or_else(none)
    }
}

#[pymethods]
impl Surface {
    /// Reads a surface file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let surface = apart(py, (None, false), move |_| files::load(&path).map_err(Failure::of))?;
        Ok(Self::of(surface))
    }

    /// Writes a surface file; returns the parts that its format cannot store.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<Vec<&'static str>> {
        let surface = Arc::clone(&self.surface);
        apart(py, (None, true), move |_| files::save(&surface, &path).map_err(Failure::of))
    }

    /// Reads the bytes of a surface file.
    #[staticmethod]
    fn parse(py: Python<'_>, file: Vec<u8>) -> PyResult<Self> {
        let surface = apart(py, (None, false), move |_| read_surface(&file).map_err(Failure::of))?;
        Ok(Self::of(surface))
    }

    /// The bytes of its file.
    fn dump<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, py.detach(|| native::write(&self.surface)).as_bytes())
    }

    #[getter]
    fn name(&self) -> &str {
        &self.surface.name
    }

    #[getter]
    fn origin(&self) -> &'static str {
        self.surface.provenance.origin.as_str()
    }

    /// Friction coefficient.
    #[getter]
    fn friction(&self) -> Option<f64> {
        self.surface.friction.map(|friction| friction.mu())
    }

    /// Stiffness, N/m.
    #[getter]
    fn stiffness(&self) -> Option<f64> {
        self.surface.stiffness.map(|stiffness| stiffness.n_per_m())
    }

    /// Number of recorded taps.
    #[getter]
    fn taps(&self) -> usize {
        self.surface.taps.as_ref().map_or(0, |taps| taps.taps().len())
    }

    /// Parts that could not be learned, with the reasons: of the report, or of the file.
    #[getter]
    fn missing(&self) -> Vec<String> {
        if let Some(report) = &self.report {
            return report.missing.iter().map(ToString::to_string).collect();
        }
        let settings = self.surface.provenance.settings.iter();
        let missing =
            settings.filter_map(|(name, reason)| Some((name.strip_prefix("not learned: ")?, reason)));
        missing.map(|(part, reason)| format!("{reason}; the surface has no {part}")).collect()
    }

    /// What a texture was learned from: duration, segments, areas of the plane with enough of them, what to record next, and
    /// whether that is too little; with what the vibration lacks because of its rate. None if it was not learned here.
    fn learned<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let (Some(texture), Some(report)) = (&self.surface.texture, &self.report) else { return Ok(None) };
        let segments = report.texture.iter().flat_map(|texture| &texture.segments);
        let segments: Vec<_> = segments.filter(|segment| segment.fate == Fate::Kept).cloned().collect();
        let covered = library::coverage(&segments, texture.rate_hz());
        let (areas, band) = (9 - covered.missing().len(), report.band.map(|band| band.to_string()));
        Ok(Some(dict!(py; seconds: covered.used_s, segments: covered.segments, areas: areas,
            record_next: covered.next_to_record(), is_short: covered.is_short(), narrow_band: band)))
    }

    /// Samples per second of the texture.
    #[getter]
    fn rate(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.texture(py)?.rate_hz())
    }

    /// The largest speed and force that it has models for.
    #[getter]
    fn range(&self, py: Python<'_>) -> PyResult<(f64, f64)> {
        let texture = self.texture(py)?;
        Ok((texture.max_speed_m_s(), texture.max_force_n()))
    }

    /// The models' speeds and forces.
    fn places(&self, py: Python<'_>) -> PyResult<Vec<(f64, f64)>> {
        let models = self.texture(py)?.models().iter();
        Ok(models.map(|model| (model.speed_m_s, model.force_n)).collect())
    }

    /// The ranges of speed and force that were recorded.
    fn recorded(&self) -> Option<((f64, f64), (f64, f64))> {
        let recorded = self.surface.texture.as_ref().and_then(TextureModel::recorded);
        recorded.map(|Recorded { speed_m_s, force_n }| (speed_m_s, force_n))
    }

    /// The cut-off of the high-pass that is applied to what is rendered, Hz.
    #[getter]
    fn highpass(&self) -> Option<f64> {
        self.surface.texture.as_ref().and_then(TextureModel::highpass_hz)
    }

    /// The model at a force and a speed.
    fn at<'py>(&self, py: Python<'py>, force: f64, speed: f64) -> PyResult<Bound<'py, PyDict>> {
        let texture = self.texture(py)?;
        let mut coefficients = Coefficients::SILENCE;
        let spot = Interpolator::new(texture).interpolate(speed, force, &mut coefficients);
        let [ar, ma] =
            [coefficients.ar(), coefficients.ma()].map(|numbers| PyArray1::from_slice(py, numbers));
        Ok(dict!(py; ar: ar, ma: ma, gain: coefficients.gain, variance: coefficients.variance,
            warping: coefficients.warping, speed: spot.speed_m_s, force: spot.force_n, rate: texture.rate_hz()))
    }

    /// The density of the model at a force and a speed at these frequencies, (m/s²)²/Hz.
    fn density<'py>(
        &self,
        py: Python<'py>,
        force: f64,
        speed: f64,
        frequencies: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let texture = self.texture(py)?;
        let mut at = Coefficients::SILENCE;
        Interpolator::new(texture).interpolate(speed, force, &mut at);
        let model = match at.warping > 0.0 {
            true => ArmaModel::warped_from_ar(at.ar(), at.warping, at.variance),
            false => ArmaModel::from_arma(at.ar(), at.ma(), at.gain, at.variance),
        };
        let model = model.map_err(|error| Failure::of(error).raise(py))?;
        let rate_hz = texture.rate_hz();
        let highpass = texture.output_highpass();
        let density = |hz: &f64| {
            let turn = std::f64::consts::TAU * hz / rate_hz;
            let passed = highpass.as_ref().map_or(1.0, |sections| sections.response(*hz, rate_hz).norm_sqr());
            2.0 / rate_hz * model.variance() * model.power_gain_at(turn) * passed
        };
        let values: Vec<f64> = frequencies.as_array().iter().map(density).collect();
        Ok(PyArray1::from_vec(py, values))
    }

    /// The vibration along a trajectory at the texture's rate.
    fn render<'py>(
        &self,
        py: Python<'py>,
        force: PyReadonlyArray1<'_, f64>,
        speed: PyReadonlyArray1<'_, f64>,
        seed: u64,
        update: f64,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let rate_hz = self.texture(py)?.rate_hz();
        let trajectory =
            Trajectory { rate_hz, speed_m_s: speed.as_array().to_vec(), force_n: force.as_array().to_vec() };
        let settings = SynthesisSettings { update_hz: update, seed, lines_seed: seed };
        let surface = Arc::clone(&self.surface);
        let vibration = apart(py, (progress, false), move |progress| match &surface.texture {
            Some(texture) => {
                let progress = |part| progress.goes_on(part);
                synthesise_with(texture, &trajectory, &settings, &progress).map_err(Failure::of)
            }
            None => Ok(Vec::new()),
        })?;
        Ok(PyArray1::from_vec(py, vibration))
    }

    /// The same surface with its texture at a lower rate.
    fn resampled(&self, py: Python<'_>, rate: f64) -> PyResult<Self> {
        let surface = Arc::clone(&self.surface);
        let (surface, _) = apart(py, (None, false), move |_| {
            resample_surface(&surface, rate, Method::Spectral).map_err(Failure::of)
        })?;
        Ok(Self::of(surface))
    }

    /// The map of its texture as SVG.
    fn figure(&self) -> Option<String> {
        let texture = self.surface.texture.as_ref()?;
        let simulated = matches!(self.surface.provenance.origin, Origin::Simulated | Origin::Procedural);
        let plot = Plot {
            title: format!("Texture of {}", self.surface.name),
            note: if simulated { "simulated" } else { "" }.to_owned(),
            x: Axis::of("Speed (mm/s)"),
            y: Axis::of("Normal force (N)"),
            marks: triangulation(texture),
            size: (0.0, 320.0),
            ..Plot::default()
        };
        Some(plot.to_standalone_svg())
    }

    /// The page of `learn --report`; none for a surface that was read.
    fn page(&self) -> Option<String> {
        self.report.as_ref().map(|report| page(&self.surface, report))
    }
}

/// Indices of the samples at which forces and speeds are read.
#[pyfunction]
pub(crate) fn update_samples(
    py: Python<'_>,
    rate: f64,
    update: f64,
    samples: usize,
) -> Bound<'_, PyArray1<i64>> {
    let places = haptograph::surfaces::rendering::update_samples(rate, update, samples);
    PyArray1::from_iter(py, places.map(|place| place as i64))
}

/// Resamples a vibration to a higher rate; returns `samples` samples.
#[pyfunction]
pub(crate) fn resample<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f64>,
    own: f64,
    wanted: f64,
    samples: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let values = values.as_slice()?.to_vec();
    let mut made = apart(py, (None, false), move |_| {
        let rate = |hz: f64| Rate::parse(&hz.to_string()).map_err(Failure::of);
        resample_whole(&values, rate(own)?, rate(wanted)?, Quality::FINE).map_err(Failure::of)
    })?;
    made.resize(samples, 0.0);
    Ok(PyArray1::from_vec(py, made))
}

/// Renders many vibrations at once into the rows of `out`. Each row has a surface, a seed, and forces and speeds at
/// [`update_samples`].
#[pyfunction]
#[allow(clippy::too_many_arguments)] // those of the package's own function
pub(crate) fn render(
    py: Python<'_>,
    surfaces: Vec<PyRef<'_, Surface>>,
    force: PyReadonlyArray2<'_, f64>,
    speed: PyReadonlyArray2<'_, f64>,
    seeds: Vec<u64>,
    update: f64,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
    out: &Bound<'_, PyArray2<f64>>,
) -> PyResult<()> {
    let wrong = |error: &dyn Display| Failure::of(format!("`out` cannot be written: {error}")).raise(py);
    let mut out = out.try_readwrite().map_err(|error| wrong(&error))?;
    let samples = out.shape()[1];
    let rates = surfaces.iter().map(|surface| Ok(surface.texture(py)?.rate_hz()));
    let rates = rates.collect::<PyResult<Vec<f64>>>()?;
    let (force, speed) = (force.as_array(), speed.as_array());
    let rows = force.rows().into_iter().zip(speed.rows()).zip(rates);
    let points = rows.map(|((force, speed), rate_hz)| UpdatePoints {
        rate_hz,
        update_hz: update,
        samples,
        speed_m_s: speed.to_vec(),
        force_n: force.to_vec(),
    });
    let points: Vec<UpdatePoints> = points.collect();
    let surfaces: Vec<_> = surfaces.iter().map(|one| Arc::clone(&one.surface)).collect();
    let out = out.as_slice_mut().map_err(|error| wrong(&error))?;
    // No rows of no samples.
    let rows = out.chunks_exact_mut(samples.max(1));
    let rows = rows.chain(std::iter::repeat_with(Default::default));
    let each = surfaces.iter().zip(&points).zip(seeds).zip(rows);
    let voices = each.filter_map(|(((surface, points), seed), out)| {
        Some(VoiceInto { texture: surface.texture.as_ref()?, points, seed, lines_seed: seed, out })
    });
    let voices: Vec<VoiceInto<'_>> = voices.collect();
    apart_within(py, progress, move |progress| {
        synthesise_into(voices, threads, &|part| progress.goes_on(part)).map_err(Failure::of)
    })
}

/// Compares two vibrations, over the time that both cover.
#[pyfunction]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    a: PyReadonlyArray1<'_, f64>,
    b: PyReadonlyArray1<'_, f64>,
    rate: f64,
    window: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (mut a, mut b) = (a.as_array().to_vec(), b.as_array().to_vec());
    let found = [("a", &mut a), ("b", &mut b)].map(|(name, values)| remove_offset(name, true, values, rate));
    let findings: Vec<String> = found.iter().flatten().map(ToString::to_string).collect();
    let (windows, bands) = apart(py, (progress, false), move |progress| {
        let usual = WindowSettings::comparison_at(rate);
        let samples = window.unwrap_or(usual.samples);
        let settings = WindowSettings { samples, overlap: samples / 2, ..usual };
        let windows = metrics::compare(&a, &b, rate, &settings).map_err(Failure::of)?;
        progress.at_or_end(0.5);
        let both = a.len().min(b.len());
        let counted = Bands::counted(both as f64 / rate, rate);
        let of_a = counted.of_signal([&a[..both]], rate);
        progress.at_or_end(0.75);
        let of_b = counted.of_signal([&b[..both]], rate);
        Ok((windows, BandErrors::new(&of_a, &of_b)))
    })?;
    let found = PyDict::new(py);
    put_bands(&found, &bands)?;
    found.set_item("nse", windows.nse)?;
    found.set_item("pe", windows.pe)?;
    found.set_item("windows", windows.windows)?;
    found.set_item("findings", findings)?;
    Ok(found)
}

/// Puts errors of bands into a dictionary.
pub(crate) fn put_bands(found: &Bound<'_, PyDict>, bands: &BandErrors) -> PyResult<()> {
    let any = |value: f64| (!bands.bands.is_empty()).then_some(value);
    found.set_item("lsd", any(bands.lsd_db))?;
    found.set_item("lsd_100_500", bands.middle_lsd_db)?;
    found.set_item("lsd_40_250", any(bands.pacinian_lsd_db))?;
    found.set_item("absolute", any(bands.absolute_db))?;
    found.set_item("low", bands.low_db)?;
    found.set_item("total", any(bands.total_db))?;
    found.set_item("misplaced", bands.misplaced)?;
    let edges = bands.bands.as_slice().iter().map(|band| (band.low_hz, band.high_hz));
    found.set_item("bands", edges.collect::<Vec<_>>())?;
    found.set_item("signed", PyArray1::from_slice(found.py(), &bands.signed_db))
}
