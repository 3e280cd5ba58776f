//! Methods of a hold-out evaluation: the floor, ways to learn a texture, and plain baselines.

use super::baselines::Plain;
use crate::learn::TextureMethod;
use crate::learn::texture::LearnTextureError;
use crate::recording::ProcessedRecording;
use haptograph_signal::arma::{ArmaFilter, Form};
use haptograph_signal::noise::Gaussian;
use haptograph_signal::prediction::burg;
use haptograph_signal::statistics::{mean, median, standard_deviation};
use haptograph_surfaces::rendering::{SynthesisError, SynthesisSettings, Trajectory, updates};
use haptograph_surfaces::rendering::{Voice, synthesise_many};
use haptograph_surfaces::{ArmaModel, TextureModel};

/// Order of the baselines' models.
const PLAIN_ORDER: usize = 20;
/// Length of the fixed windows, s.
const WINDOW_S: f64 = 0.2;

/// A method that predicts the vibration of one part of a recording from another part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// The spectrum of the training part itself; a method that uses only the material cannot be much better.
    Floor,
    /// The default method of `learn`.
    Default,
    /// The thesis's method.
    Thesis,
    /// One autoregressive model of order 20 for the whole part, independent of force and speed.
    OneModel,
    /// One autoregressive model of order 20 per 0.2 s; the nearest one in force and speed is rendered.
    Windows,
    /// One warped autoregressive model of order 12 at a factor of 0.8 for the whole part.
    OneWarped,
    /// Short-time spectra with random phases; the level of each bin is a plane over the logarithms of speed and force.
    Phases,
    /// Clips of 0.3 s of the part, drawn from the three nearest in force and speed, and cross-faded.
    Granular,
}

/// The plain baselines.
pub const BASELINES: [Method; 5] =
    [Method::OneModel, Method::Windows, Method::OneWarped, Method::Phases, Method::Granular];

impl Method {
    /// All methods, the floor first.
    pub(crate) const ALL: [Self; 8] = [
        Self::Floor,
        Self::Default,
        Self::Thesis,
        Self::OneModel,
        Self::Windows,
        Self::OneWarped,
        Self::Phases,
        Self::Granular,
    ];

    /// Name in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Floor => "floor",
            Self::Default => "default",
            Self::Thesis => "thesis",
            Self::OneModel => "one_model",
            Self::Windows => "windows",
            Self::OneWarped => "one_warped",
            Self::Phases => "phases",
            Self::Granular => "granular",
        }
    }

    /// Title in tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::Floor => "floor: the training part's spectrum",
            Self::Default => "default",
            Self::Thesis => "thesis's",
            Self::OneModel => "plain: one model of order 20",
            Self::Windows => "plain: windows of 0.2 s, nearest",
            Self::OneWarped => "plain: warped model of order 12",
            Self::Phases => "plain: spectra, random phases",
            Self::Granular => "plain: granular, clips of 0.3 s",
        }
    }
}

/// A learned method, ready to render.
#[derive(Debug, Clone)]
pub(super) enum Player {
    /// A surface's texture, rendered as in a graph.
    Texture(Box<TextureModel>),
    /// Models at points of speed and force; the nearest one is rendered.
    Nearest {
        /// Speed, force and model.
        models: Vec<([f64; 2], ArmaModel)>,
        /// Inverse standard deviations of speed and force.
        scales: [f64; 2],
    },
    /// A baseline without a map of models.
    Plain(Plain),
}

impl Player {
    /// Learns from parts of a recording; `None` for the floor, which renders nothing.
    ///
    /// # Errors
    /// [`LearnTextureError`].
    pub(super) fn learned(
        method: Method,
        parts: &[ProcessedRecording],
        usual: &TextureMethod,
    ) -> Result<Option<Self>, LearnTextureError> {
        let texture = |method: &TextureMethod| {
            let (texture, _) = method.learn(parts, &|_| ())?;
            Ok(Some(Self::Texture(Box::new(texture))))
        };
        let plain = |found: Option<Plain>| {
            let reason =
                || LearnTextureError::NoModels { reason: "the part is too short or silent".to_owned() };
            found.map(|found| Some(Self::Plain(found))).ok_or_else(reason)
        };
        match method {
            Method::Floor => Ok(None),
            Method::Default => texture(usual),
            Method::Thesis => texture(&TextureMethod::thesis()),
            Method::OneModel => nearest(parts, usize::MAX).map(Some),
            Method::Windows => {
                let rate_hz = parts.first().map_or(0.0, ProcessedRecording::rate_hz);
                nearest(parts, (WINDOW_S * rate_hz) as usize).map(Some)
            }
            Method::OneWarped => plain(Plain::warped(parts)),
            Method::Phases => plain(Plain::phases(parts)),
            Method::Granular => plain(Plain::granular(parts)),
        }
    }

    /// The vibrations along trajectories, each with its seed.
    ///
    /// # Errors
    /// [`SynthesisError`].
    pub(super) fn play(&self, along: &[(&Trajectory, u64)]) -> Result<Vec<Vec<f64>>, SynthesisError> {
        let settings =
            |seed: u64| SynthesisSettings { seed, lines_seed: seed, ..SynthesisSettings::default() };
        match self {
            Self::Texture(texture) => {
                let voices: Vec<Voice<'_>> = along
                    .iter()
                    .map(|(trajectory, seed)| Voice { texture, trajectory, settings: settings(*seed) })
                    .collect();
                synthesise_many(&voices, 1).map_err(|error| error.source)
            }
            Self::Nearest { models, scales } => along
                .iter()
                .map(|(along, seed)| play_nearest(models, *scales, along, &settings(*seed)))
                .collect(),
            Self::Plain(plain) => Ok(along.iter().map(|(along, seed)| plain.play(along, *seed)).collect()),
        }
    }
}

/// One model per window of all parts, or per part if it is shorter than a window.
fn nearest(parts: &[ProcessedRecording], window: usize) -> Result<Player, LearnTextureError> {
    let mut models = vec![];
    for part in parts {
        let signals = part.signals();
        let span = window.min(part.samples()).max(1);
        for start in (0..=part.samples() - span).step_by(span) {
            let samples = start..start + span;
            let fitted = burg(&signals.acceleration_m_s2[samples.clone()], PLAIN_ORDER);
            let model = fitted
                .map_err(|error| error.to_string())
                .and_then(|fit| ArmaModel::from_ar(&fit.ar, fit.variance).map_err(|error| error.to_string()));
            if let Ok(model) = model {
                let place =
                    [&signals.speed_m_s, &signals.force_normal_n].map(|x| median(&x[samples.clone()]));
                models.push((place, model));
            }
        }
    }
    if models.is_empty() {
        return Err(LearnTextureError::NoModels { reason: "no segment has a model of order 20".to_owned() });
    }
    let scale = |axis: usize| {
        let values: Vec<f64> = models.iter().map(|(place, _)| place[axis]).collect();
        let spread = standard_deviation(&values);
        // With a single model the scale is arbitrary.
        if spread > 0.0 { 1.0 / spread } else { 1.0 / mean(&values).max(1e-6) }
    };
    Ok(Player::Nearest { scales: [scale(0), scale(1)], models })
}

fn play_nearest(
    models: &[([f64; 2], ArmaModel)],
    scales: [f64; 2],
    along: &Trajectory,
    settings: &SynthesisSettings,
) -> Result<Vec<f64>, SynthesisError> {
    let mut filter = ArmaFilter::new(Form::Lattice);
    let mut noise = Gaussian::new(settings.seed);
    let mut excitation = vec![];
    let mut vibration = vec![0.0; along.speed_m_s.len()];
    for (place, samples) in updates(along.rate_hz, settings.update_hz, vibration.len()) {
        let here = [along.speed_m_s[place], along.force_n[place]];
        let away = |at: &[f64; 2]| {
            let off = |axis: usize| ((at[axis] - here[axis]) * scales[axis]).powi(2);
            off(0) + off(1)
        };
        let Some((_, model)) = models.iter().min_by(|(a, _), (b, _)| away(a).total_cmp(&away(b))) else {
            continue;
        };
        filter.set_coefficients(model.ar(), model.ma(), model.gain())?;
        excitation.resize(samples.len(), 0.0);
        noise.fill(&mut excitation);
        let deviation = model.variance().sqrt();
        excitation.iter_mut().for_each(|e| *e *= deviation);
        filter.process(&excitation, &mut vibration[samples]);
    }
    Ok(vibration)
}
