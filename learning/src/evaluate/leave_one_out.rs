//! Leave-one-out comparison of maps on textures measured by others: each measured model is predicted from the
//! rest.
//!
//! Every kind of map predicts the spectrum at a point among the models (inside or outside of their hull), and
//! the spectra at speeds far from all of them if only a narrow third of the models is known.

use crate::learn::cells::Cells;
use crate::learn::spectral_law::{Axis, Exponents, Observation, SpectralLaw};
use crate::metrics::{Bands, log_spectral_distance};
use haptograph_signal::prediction::power_gain;
use haptograph_signal::spectrum::arma_density;
use haptograph_signal::statistics::mean;
use haptograph_signal::warped;
use haptograph_surfaces::hull::Hull;
use haptograph_surfaces::model::warping_for;
use haptograph_surfaces::{Coefficients, Interpolator, ModelAt, TextureModel, VertexKind};
use std::f64::consts::{PI, TAU};

mod exponents;
mod summary;

pub use exponents::PowerExponents;
pub use summary::Summary;

/// Minimum number of measured models of a texture, and of known models in the narrow third.
const LEAST_MODELS: usize = 3;
/// Order of the law's models, the default of `learn`.
const ORDER: usize = 20;
/// Power error of a predicted silence, dB.
const MAX_DB: f64 = 100.0;
/// Speeds beyond those of the narrow third by this factor count as far.
pub const FAR: f64 = 1.7;
/// Slower or lighter models carry no information about sliding and are excluded, as in learning a law.
const LEAST_M_S: f64 = 0.005;
const LEAST_N: f64 = 0.05;

/// A method that predicts the texture between and beyond known models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MapKind {
    /// The thesis's map: extended to rest and to the largest speed and force, triangulated, with interpolated
    /// line spectral frequencies.
    Triangulation,
    /// The nearest known model in speed and force, each in units of its standard deviation.
    Nearest,
    /// The law that `learn` fits by default, as rendered: on a grid of models, interpolated.
    Law,
    /// The law as fitted, without the grid and without the linear fade of its amplitude below the lightest known force.
    LawWithoutFade,
}

impl MapKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Triangulation, Self::Nearest, Self::Law, Self::LawWithoutFade];

    /// Name on the terminal and in JSON.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Triangulation => "triangulation",
            Self::Nearest => "nearest",
            Self::Law => "law",
            Self::LawWithoutFade => "law without fade",
        }
    }
}

/// The prediction of one model from others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Number of the texture in the given list.
    pub texture: usize,
    /// The vertex of its map that was left out.
    pub vertex: usize,
    /// The map used.
    pub map: MapKind,
    /// Log-spectral distance over the third octaves from 20 to 1000 Hz, dB.
    pub lsd_db: f64,
    /// Predicted power over left-out power in the whole band, dB.
    pub power_db: f64,
    /// True if the model lies inside the convex hull of the models it was predicted from.
    pub inside: bool,
}

/// All predictions.
#[derive(Debug, Clone, PartialEq)]
pub struct LeaveOneOut {
    /// Each measured model, predicted from all others of its texture.
    pub left_out: Vec<Prediction>,
    /// Models at speeds [`FAR`] times away from those of a narrow third, predicted from this third.
    pub far: Vec<Prediction>,
    /// Dependence of the power on speed and force over all textures.
    pub exponents: Option<PowerExponents>,
    /// Number of textures with enough models.
    pub textures: usize,
}

/// Error of a comparison.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LeaveOneOutError {
    /// No texture has enough measured models.
    #[error(
        "none of the {textures} textures has {LEAST_MODELS} measured models; use surfaces learned by the method of the thesis or the toolkit's files, since a law has no measured models"
    )]
    NoModels {
        /// Number of textures given.
        textures: usize,
    },
    /// No map could be built from the remaining models.
    #[error("cannot build the {} map of texture {texture} (from 0) without model {vertex}: {reason}", .map.as_str())]
    Map {
        /// The kind of map.
        map: MapKind,
        /// The texture's number, from 0.
        texture: usize,
        /// The vertex that was left out.
        vertex: usize,
        /// The reason.
        reason: String,
    },
}

/// Predicts every measured model of the textures by every kind of map from the others. `progress` is called
/// with the fraction done.
///
/// The prior of the law's exponents is recomputed from the other textures each time, unless there is only one
/// texture.
///
/// # Errors
/// [`LeaveOneOutError`].
pub fn leave_one_out(
    textures: &[&TextureModel],
    progress: &dyn Fn(f64),
) -> Result<LeaveOneOut, LeaveOneOutError> {
    let subjects: Vec<Subject> =
        textures.iter().enumerate().filter_map(|(number, texture)| Subject::new(number, texture)).collect();
    if subjects.is_empty() {
        return Err(LeaveOneOutError::NoModels { textures: textures.len() });
    }
    let moments: Vec<_> = subjects.iter().map(|one| exponents::Moments::of(&one.seen)).collect();
    let mut found = LeaveOneOut {
        left_out: vec![],
        far: vec![],
        exponents: PowerExponents::of(&moments),
        textures: subjects.len(),
    };
    for (number, subject) in subjects.iter().enumerate() {
        let slopes = exponents::without(&moments, number);
        for out in 0..subject.models.len() {
            let known: Vec<usize> = (0..subject.models.len()).filter(|&k| k != out).collect();
            found.left_out.extend(subject.predict_all(&known, &[out], slopes)?);
        }
        let (third, far) = subject.narrow_third();
        found.far.extend(subject.predict_all(&third, &far, slopes)?);
        progress((number + 1) as f64 / subjects.len() as f64);
    }
    Ok(found)
}

/// A texture whose models are left out.
struct Subject<'t> {
    number: usize,
    rate_hz: f64,
    /// The measured models with their vertices and their observations for a law.
    models: Vec<&'t ModelAt>,
    vertices: Vec<usize>,
    seen: Vec<Observation>,
    truths: Vec<Sound>,
    bands: Bands,
}

/// Predicts the sound at a point, of which only speed and force are used.
type Predictor<'s> = Box<dyn Fn(&ModelAt) -> Result<Sound, String> + 's>;

/// Powers in third octaves and in total, (m/s²)².
struct Sound {
    bands: Vec<f64>,
    power: f64,
}

impl<'t> Subject<'t> {
    fn new(number: usize, texture: &'t TextureModel) -> Option<Self> {
        let (vertices, models): (Vec<usize>, Vec<&ModelAt>) = texture
            .models()
            .iter()
            .enumerate()
            .filter(|(_, at)| at.kind == VertexKind::Measured && at.model.power() > 0.0)
            .unzip();
        if models.len() < LEAST_MODELS {
            return None;
        }
        let rate_hz = texture.rate_hz();
        let cells = Cells::new(rate_hz, warping_for(rate_hz));
        let bands = Bands::of_rate(rate_hz);
        let observe = |at: &&ModelAt| Observation::of_model(at, rate_hz, &cells);
        Some(Self {
            number,
            rate_hz,
            seen: models.iter().map(observe).collect(),
            truths: models.iter().map(|at| Sound::of_model(at, rate_hz, &bands)).collect(),
            models,
            vertices,
            bands,
        })
    }

    /// Predicts the models `out` from the models `known` by every kind of map.
    fn predict_all(
        &self,
        known: &[usize],
        out: &[usize],
        slopes: [f64; 2],
    ) -> Result<Vec<Prediction>, LeaveOneOutError> {
        let mut found = vec![];
        if out.is_empty() {
            return Ok(found);
        }
        for map in MapKind::ALL {
            let wrong = |reason: String| LeaveOneOutError::Map {
                map,
                texture: self.number,
                vertex: self.vertices[out[0]],
                reason,
            };
            let predictor = self.predictor(map, known, slopes).map_err(wrong)?;
            for &one in out {
                let (at, truth) = (self.models[one], &self.truths[one]);
                let sound = predictor(at).map_err(wrong)?;
                found.push(Prediction {
                    texture: self.number,
                    vertex: self.vertices[one],
                    map,
                    lsd_db: log_spectral_distance(&sound.bands, &truth.bands),
                    power_db: (10.0 * (sound.power / truth.power).log10()).clamp(-MAX_DB, MAX_DB),
                    inside: self.inside(known, at),
                });
            }
        }
        Ok(found)
    }

    fn predictor<'s>(
        &'s self,
        map: MapKind,
        known: &'s [usize],
        slopes: [f64; 2],
    ) -> Result<Predictor<'s>, String> {
        match map {
            MapKind::Triangulation => self.triangulation(known),
            MapKind::Nearest => Ok(Box::new(move |at: &ModelAt| {
                let model = self.models[self.nearest(known, at)];
                Ok(Sound::of_model(model, self.rate_hz, &self.bands))
            })),
            MapKind::Law => {
                let texture = self.fitted(known, slopes).on_grid(self.axis());
                Ok(self.rendered(&texture.map_err(|e| e.to_string())?))
            }
            MapKind::LawWithoutFade => Ok(self.law(self.fitted(known, slopes).without_fade())),
        }
    }

    /// The thesis's map of the known models, with its border at the largest speed and force of all models, as
    /// in the file.
    fn triangulation<'s>(&'s self, known: &[usize]) -> Result<Predictor<'s>, String> {
        let models = known.iter().map(|&one| self.models[one].clone()).collect();
        let largest = |value: fn(&ModelAt) -> f64| self.models.iter().map(|at| value(at)).fold(0.0, f64::max);
        let hull = Hull {
            max_speed_m_s: Some(largest(|at| at.speed_m_s)),
            max_force_n: Some(largest(|at| at.force_n)),
            ..Hull::default()
        };
        let texture = TextureModel::from_measured(self.rate_hz, models, &hull).map_err(|e| e.to_string())?;
        Ok(self.rendered(&texture))
    }

    /// The rendered sound of a texture.
    fn rendered<'s>(&'s self, texture: &TextureModel) -> Predictor<'s> {
        let interpolator = Interpolator::new(texture);
        Box::new(move |at: &ModelAt| {
            let mut mix = Coefficients::SILENCE;
            interpolator.clone().interpolate(at.speed_m_s, at.force_n, &mut mix);
            Sound::of_mix(&mix, self.rate_hz, &self.bands)
        })
    }

    fn fitted(&self, known: &[usize], slopes: [f64; 2]) -> SpectralLaw {
        let slides = |at: &&Observation| at.speed_m_s > LEAST_M_S && at.force_n > LEAST_N;
        let seen = || known.iter().map(|&one| &self.seen[one]);
        let mut sliding: Vec<Observation> = seen().filter(slides).cloned().collect();
        if sliding.is_empty() {
            sliding = seen().cloned().collect();
        }
        let exponents = Exponents { slopes, ..Exponents::ACCELERATION };
        SpectralLaw::fit(&sliding, exponents).corrected(&sliding)
    }

    fn axis(&self) -> Axis {
        Axis { rate_hz: self.rate_hz, warping: warping_for(self.rate_hz), order: ORDER }
    }

    fn law<'s>(&'s self, law: SpectralLaw) -> Predictor<'s> {
        let axis = self.axis();
        Box::new(move |at: &ModelAt| {
            let model = law.model(at.speed_m_s, at.force_n, axis).map_err(|e| e.to_string())?;
            let at = ModelAt { model, ..at.clone() };
            Ok(Sound::of_model(&at, self.rate_hz, &self.bands))
        })
    }

    fn nearest(&self, known: &[usize], at: &ModelAt) -> usize {
        let deviation = |value: fn(&ModelAt) -> f64| {
            let values: Vec<f64> = known.iter().map(|&one| value(self.models[one])).collect();
            let middle = mean(&values);
            let squares: f64 = values.iter().map(|x| (x - middle).powi(2)).sum();
            (squares / values.len() as f64).sqrt().max(f64::MIN_POSITIVE)
        };
        let (speed, force) = (deviation(|at| at.speed_m_s), deviation(|at| at.force_n));
        let distance = |one: usize| {
            let other = self.models[one];
            ((other.speed_m_s - at.speed_m_s) / speed).hypot((other.force_n - at.force_n) / force)
        };
        let first = known[0];
        known.iter().fold(first, |best, &one| if distance(one) < distance(best) { one } else { best })
    }

    /// True if no straight line separates a point from the known models.
    fn inside(&self, known: &[usize], at: &ModelAt) -> bool {
        let mut angles: Vec<f64> = known
            .iter()
            .map(|&one| &self.models[one])
            .map(|other| (other.force_n - at.force_n).atan2(1000.0 * (other.speed_m_s - at.speed_m_s)))
            .collect();
        angles.sort_by(f64::total_cmp);
        let around = angles.first().map_or(TAU, |first| first + TAU);
        let next = angles.iter().skip(1).copied().chain([around]);
        angles.iter().zip(next).all(|(angle, next)| next - angle <= PI)
    }

    /// A third of the models (at least three) with neighbouring speeds and the smallest ratio of speeds, and
    /// the models whose speeds lie beyond theirs by the factor [`FAR`].
    fn narrow_third(&self) -> (Vec<usize>, Vec<usize>) {
        let mut by_speed: Vec<usize> = (0..self.models.len()).collect();
        let speed = |one: usize| self.models[one].speed_m_s;
        by_speed.sort_by(|a, b| speed(*a).total_cmp(&speed(*b)));
        let count = (by_speed.len() / 3).max(LEAST_MODELS);
        let span = |part: &&[usize]| speed(part[count - 1]) / speed(part[0]);
        let third = by_speed.windows(count).min_by(|a, b| span(a).total_cmp(&span(b))).unwrap_or(&by_speed);
        let (low, high) = (speed(third[0]) / FAR, speed(third[third.len() - 1]) * FAR);
        let far = by_speed.iter().copied().filter(|&one| speed(one) <= low || speed(one) >= high);
        (third.to_vec(), far.collect())
    }
}

impl Sound {
    fn of_model(at: &ModelAt, rate_hz: f64, bands: &Bands) -> Self {
        let level = 2.0 / rate_hz * at.model.variance();
        let density = |frequency_hz: f64| level * at.model.power_gain_at(TAU * frequency_hz / rate_hz);
        Self { bands: bands.of_density(density).powers().to_vec(), power: at.model.power() }
    }

    fn of_mix(mix: &Coefficients, rate_hz: f64, bands: &Bands) -> Result<Self, String> {
        let level = mix.variance * mix.gain * mix.gain;
        let density = |frequency_hz: f64| {
            if mix.warping == 0.0 {
                return arma_density(mix.ar(), mix.ma(), level, rate_hz, frequency_hz);
            }
            let turn = TAU * frequency_hz / rate_hz;
            2.0 / rate_hz * level * warped::squared_response(mix.ar(), mix.warping, turn)
        };
        let gain = if mix.warping == 0.0 {
            power_gain(mix.ar(), mix.ma())
        } else {
            warped::power_gain(mix.ar(), mix.warping)
        };
        Ok(Self {
            bands: bands.of_density(density).powers().to_vec(),
            power: level * gain.map_err(|error| error.to_string())?,
        })
    }
}

#[cfg(test)]
mod tests;
