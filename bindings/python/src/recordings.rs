//! Recordings: from files and from arrays, and access to their signals.

use crate::errors::Failure;
use crate::work::apart;
use haptograph::engine::frame::Kind;
use haptograph::engine::node::Stream;
use haptograph::learning::processing::{ProcessingSettings, processed};
use haptograph::learning::recording::{
    self as library, AnyRecording, Gesture, ImportSettings, ProcessedRecording, Signals,
};
use haptograph::report::figures::over_time;
use haptograph::report::record::{Recorded, Reduction};
use haptograph::report::theme::Ink;
use haptograph::signal::quantity::Quantity;
use haptograph::signal::time::Rate;
use haptograph::surfaces::{Origin, Provenance};
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::PathBuf;
use std::sync::Arc;

/// A recording of a tool.
#[pyclass(frozen, module = "haptograph._native")]
pub struct Recording {
    pub recording: Arc<AnyRecording>,
    findings: Vec<String>,
}

/// Facts that a file does not state about itself.
#[derive(FromPyObject)]
pub(crate) struct Import {
    #[pyo3(item)]
    columns: Vec<(String, String)>,
    #[pyo3(item)]
    units: Vec<(String, String)>,
    #[pyo3(item)]
    constants: Vec<(String, String)>,
    #[pyo3(item)]
    rate: Option<f64>,
    #[pyo3(item)]
    full_scale: Option<f64>,
    #[pyo3(item)]
    strict: bool,
    #[pyo3(item)]
    gesture: Option<String>,
}

impl Import {
    pub(crate) fn settings(&self) -> Result<ImportSettings, Failure> {
        let mut settings = ImportSettings {
            rate_hz: self.rate,
            full_scale_m_s2: self.full_scale,
            strict: self.strict,
            ..ImportSettings::default()
        };
        for (quantity, column) in &self.columns {
            settings = settings.with_column(quantity, column).map_err(Failure::Message)?;
        }
        for (quantity, unit) in &self.units {
            settings = settings.with_unit(quantity, unit).map_err(Failure::Message)?;
        }
        for (name, value) in &self.constants {
            settings = settings.with_constant(name, value).map_err(Failure::Message)?;
        }
        Ok(settings)
    }
}

fn gesture(text: &str) -> Result<Gesture, Failure> {
    text.parse::<Gesture>().map_err(Failure::Message)
}

/// Reads a recording of one file, or of several that share a clock.
#[pyfunction]
pub(crate) fn read(py: Python<'_>, paths: Vec<PathBuf>, settings: Import) -> PyResult<Recording> {
    let import = settings.settings().map_err(|failure| failure.raise(py))?;
    let gesture = settings.gesture.as_deref().map(gesture).transpose();
    let gesture = gesture.map_err(|failure| failure.raise(py))?;
    let (recording, findings) =
        apart(py, (None, false), move |_| library::load_with(&paths, &import).map_err(Failure::of))?;
    let recording = match gesture {
        Some(gesture) => recording.with_gesture(gesture),
        None => recording,
    };
    Ok(Recording {
        recording: Arc::new(recording),
        findings: { findings.iter() }
            .map(|(path, finding)| format!("{}: {finding}", path.display()))
            .collect(),
    })
}

/// Arrays of a recording, all at one rate.
#[derive(FromPyObject)]
pub(crate) struct Arrays<'py> {
    #[pyo3(item)]
    acceleration: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    force: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    speed: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    tangential: Option<PyReadonlyArray1<'py, f64>>,
    #[pyo3(item)]
    rate: f64,
}

/// A recording of arrays.
#[pyfunction]
pub(crate) fn recording(
    py: Python<'_>,
    arrays: Arrays<'_>,
    gesture: &str,
    source: &str,
) -> PyResult<Recording> {
    let mut acceleration_m_s2 = arrays.acceleration.as_array().to_vec();
    let found = library::remove_offset("acceleration", true, &mut acceleration_m_s2, arrays.rate);
    let signals = Signals {
        rate_hz: arrays.rate,
        acceleration_m_s2,
        force_normal_n: arrays.force.as_array().to_vec(),
        force_tangential_n: arrays.tangential.map(|values| values.as_array().to_vec()),
        speed_m_s: arrays.speed.as_array().to_vec(),
        axes_m_s2: None,
    };
    let made = self::gesture(gesture).and_then(|gesture| {
        let provenance = Provenance::new(Origin::Imported, source);
        ProcessedRecording::new(signals, gesture, provenance).map_err(Failure::of)
    });
    let made = made.map_err(|failure| failure.raise(py))?;
    Ok(Recording {
        recording: Arc::new(AnyRecording::Processed(made)),
        findings: found.iter().map(ToString::to_string).collect(),
    })
}

impl Recording {
    fn signals(&self, py: Python<'_>) -> PyResult<&Signals> {
        match &*self.recording {
            AnyRecording::Processed(recording) => Ok(recording.signals()),
            AnyRecording::Raw(_) => Err(Failure::of(
                "this recording has sensor readings: `processed()` converts them to accelerations, forces and speeds",
            )
            .raise(py)),
        }
    }
}

#[pymethods]
impl Recording {
    #[getter]
    fn is_processed(&self) -> bool {
        matches!(&*self.recording, AnyRecording::Processed(_))
    }

    #[getter]
    fn gesture(&self) -> &'static str {
        self.recording.gesture().as_str()
    }

    #[getter]
    fn origin(&self) -> &'static str {
        self.recording.provenance().origin.as_str()
    }

    #[getter]
    fn source(&self) -> &str {
        &self.recording.provenance().source
    }

    #[getter]
    fn findings(&self) -> Vec<String> {
        self.findings.clone()
    }

    #[getter]
    fn rate(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.signals(py)?.rate_hz)
    }

    #[getter]
    fn samples(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.signals(py)?.acceleration_m_s2.len())
    }

    fn acceleration<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_slice(py, &self.signals(py)?.acceleration_m_s2))
    }

    fn force<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_slice(py, &self.signals(py)?.force_normal_n))
    }

    fn speed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_slice(py, &self.signals(py)?.speed_m_s))
    }

    fn tangential<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let values = self.signals(py)?.force_tangential_n.as_ref();
        Ok(values.map(|values| PyArray1::from_slice(py, values)))
    }

    /// The processed recording, from which models are learned.
    fn processed(&self, py: Python<'_>, rate: Option<f64>) -> PyResult<Self> {
        let recording = Arc::clone(&self.recording);
        let made = apart(py, (None, false), move |_| {
            let settings = ProcessingSettings { rate_hz: rate, ..ProcessingSettings::default() };
            processed(&recording, &settings).map_err(Failure::of)
        })?;
        Ok(Self { recording: Arc::new(AnyRecording::Processed(made)), findings: self.findings.clone() })
    }

    /// Reads the bytes of an archive.
    #[staticmethod]
    fn parse(py: Python<'_>, file: Vec<u8>, findings: Vec<String>) -> PyResult<Self> {
        let made = apart(py, (None, false), move |_| library::read_archive(&file).map_err(Failure::of))?;
        Ok(Self { recording: Arc::new(made), findings })
    }

    /// The bytes of its archive.
    fn dump<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &py.detach(|| library::write_archive(&self.recording))?))
    }

    /// The samples from one to before another.
    fn part(&self, py: Python<'_>, begin: usize, end: usize) -> PyResult<Self> {
        let signals = self.signals(py)?;
        let cut = |values: &Vec<f64>| values.get(begin..end).unwrap_or_default().to_vec();
        let signals = Signals {
            rate_hz: signals.rate_hz,
            acceleration_m_s2: cut(&signals.acceleration_m_s2),
            force_normal_n: cut(&signals.force_normal_n),
            force_tangential_n: signals.force_tangential_n.as_ref().map(cut),
            speed_m_s: cut(&signals.speed_m_s),
            axes_m_s2: signals
                .axes_m_s2
                .as_ref()
                .map(|axes| axes.get(begin..end).unwrap_or_default().to_vec()),
        };
        let (gesture, provenance) = (self.recording.gesture(), self.recording.provenance().clone());
        let made = ProcessedRecording::new(signals, gesture, provenance);
        let made = made.map_err(|error| Failure::of(error).raise(py))?;
        Ok(Self { recording: Arc::new(AnyRecording::Processed(made)), findings: self.findings.clone() })
    }

    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let recording = Arc::clone(&self.recording);
        apart(py, (None, true), move |_| Ok(library::save(&recording, &path)))?.map_err(PyErr::from)
    }

    /// The signals over time, each as SVG.
    fn figures(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let signals = self.signals(py)?;
        let simulated = self.recording.provenance().origin == Origin::Simulated;
        let shown = [
            ("acceleration", Quantity::ACCELERATION, &signals.acceleration_m_s2),
            ("normal force", Quantity::FORCE, &signals.force_normal_n),
            ("speed", Quantity::SPEED, &signals.speed_m_s),
        ];
        let figures = shown.map(|(name, quantity, samples)| {
            figure(name, (Kind::SCALAR, quantity), signals.rate_hz, samples, simulated)
        });
        Ok(figures.into_iter().flatten().collect())
    }
}

/// A signal over time as SVG.
pub(crate) fn figure(
    name: &str,
    (kind, quantity): (Kind, Quantity),
    rate_hz: f64,
    frames: &[f64],
    simulated: bool,
) -> Vec<String> {
    let Ok(rate) = Rate::parse(&rate_hz.to_string()) else {
        return Vec::new();
    };
    let stream = Stream { name: name.to_owned(), kind, quantity, rate, simulated };
    let mut recorded = Recorded::of(stream);
    recorded.extend(frames);
    let plots = over_time(&recorded, Ink::number(0));
    plots.iter().map(|plot| plot.to_standalone_svg()).collect()
}

/// The plots of a signal of a run over time, each as SVG; none for kinds that cannot be plotted over time.
#[pyfunction]
pub(crate) fn figures(
    name: &str,
    quantity: Option<&str>,
    rate: f64,
    values: PyReadonlyArray2<'_, f64>,
    simulated: bool,
) -> Vec<String> {
    let values = values.as_array();
    let linear = [Kind::SCALAR, Kind::VECTOR, Kind::WRENCH];
    let Some(kind) = linear.into_iter().find(|kind| kind.width() == values.ncols()) else {
        return Vec::new();
    };
    let quantity = quantity.and_then(Quantity::by_name).unwrap_or(Quantity::NUMBER);
    let frames: Vec<f64> = values.iter().copied().collect();
    figure(name, (kind, quantity), rate, &frames, simulated)
}
