//! A texture: models of sliding vibration over speed and force, triangulated.

use crate::bounds::{RATES, RATES_HZ, shown};
use crate::hull::{self, Hull};
use crate::layers::{Layer, LayerError};
use crate::model::{ArmaModel, ModelError};
use crate::triangulation::{self, Triangle, Triangulation, TriangulationError};
use haptograph_signal::filter::{Sections, butterworth_highpass};
use std::sync::Arc;

/// Order of the high-pass of processing, in each direction. The thesis does not state it.
pub const HIGHPASS_ORDER: usize = 2;

/// Models over (speed, force) at one rate, triangulated from rest to the largest modelled speed and force.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureModel {
    rate_hz: f64,
    models: Vec<ModelAt>,
    triangulation: Triangulation,
    highpass_hz: Option<f64>,
    /// As it was given.
    pub(crate) recorded: Option<Recorded>,
    /// In the order of their names, each once.
    pub(crate) layers: Vec<Arc<dyn Layer>>,
}

/// The ranges of speed and force that were recorded; beyond them a texture is extrapolated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recorded {
    /// Least and largest speed, m/s.
    pub speed_m_s: (f64, f64),
    /// Least and largest normal force, N.
    pub force_n: (f64, f64),
}

impl Recorded {
    /// The ranges of (speed, force) in m/s and N; `None` of no place.
    pub fn of(places: impl Iterator<Item = (f64, f64)>) -> Option<Self> {
        places.fold(None, |ranges, (speed_m_s, force_n)| {
            let Self { speed_m_s: (slow, fast), force_n: (light, firm) } =
                ranges.unwrap_or(Self { speed_m_s: (speed_m_s, speed_m_s), force_n: (force_n, force_n) });
            let speed_m_s = (slow.min(speed_m_s), fast.max(speed_m_s));
            Some(Self { speed_m_s, force_n: (light.min(force_n), firm.max(force_n)) })
        })
    }

    /// True if a speed and a force lie in the ranges.
    pub fn contains(&self, speed_m_s: f64, force_n: f64) -> bool {
        let is_in = |(least, most): (f64, f64), x: f64| least <= x && x <= most;
        is_in(self.speed_m_s, speed_m_s) && is_in(self.force_n, force_n)
    }
}

/// A model and its position on the map.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelAt {
    /// Tool speed, m/s.
    pub speed_m_s: f64,
    /// Normal force, N.
    pub force_n: f64,
    /// The model.
    pub model: ArmaModel,
    /// Source of the model.
    pub kind: VertexKind,
}

/// The source of a vertex of the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum VertexKind {
    /// The model was learned from data of this speed and force.
    Measured,
    /// The model comes from a law that was fitted to data around it.
    Fitted,
    /// A vertex on the border of the map, with the filter of a measured model.
    Edge,
}

impl TextureModel {
    /// A texture of `models` at `rate_hz` with the given triangles (vertex numbers from 0).
    ///
    /// Checks that the rate is positive, all models have the same order and warping factor, models at zero speed or force are
    /// silent, and the triangles tile the range from zero to the maximum.
    pub fn new(rate_hz: f64, models: Vec<ModelAt>, triangles: Vec<Triangle>) -> Result<Self, TextureError> {
        if !RATES_HZ.contains(&rate_hz) {
            return Err(TextureError::Rate { rate_hz });
        }
        let orders = |at: &ModelAt| (at.model.ar().len(), at.model.ma().len());
        let expected = models.first().map(orders).ok_or(TextureError::NoModels)?;
        let warping = models[0].model.warping();
        for (vertex, at) in models.iter().enumerate() {
            if at.model.warping() != warping {
                return Err(TextureError::Warpings {
                    vertex,
                    warping: at.model.warping(),
                    expected: warping,
                });
            }
            if orders(at) != expected {
                return Err(TextureError::Orders { vertex, orders: orders(at), expected });
            }
            if (at.speed_m_s == 0.0 || at.force_n == 0.0) && at.model.variance() != 0.0 {
                return Err(TextureError::LoudAtRest { vertex, variance: at.model.variance() });
            }
        }
        let triangulation = Triangulation::new(&positions(&models), triangles)?;
        Ok(TextureModel { rate_hz, models, triangulation, highpass_hz: None, recorded: None, layers: vec![] })
    }

    /// The same texture with a high-pass that the renderer applies at its output: see [`Self::highpass_hz`].
    pub fn with_highpass_hz(mut self, highpass_hz: Option<f64>) -> Result<Self, TextureError> {
        if let Some(cutoff_hz) = highpass_hz
            && !(cutoff_hz > 0.0 && cutoff_hz < 0.25 * self.rate_hz)
        {
            return Err(TextureError::Highpass { cutoff_hz, rate_hz: self.rate_hz });
        }
        self.highpass_hz = highpass_hz;
        Ok(self)
    }

    /// The same texture with the ranges that were recorded.
    ///
    /// # Errors
    /// [`TextureError::Recorded`] if one does not ascend from 0 or more.
    pub fn with_recorded(mut self, recorded: Option<Recorded>) -> Result<Self, TextureError> {
        let ascends = |(least, most): (f64, f64)| 0.0 <= least && least <= most && most.is_finite();
        if let Some(recorded) = recorded.filter(|given| !(ascends(given.speed_m_s) && ascends(given.force_n)))
        {
            return Err(TextureError::Recorded { recorded });
        }
        self.recorded = recorded;
        Ok(self)
    }

    /// The ranges that were recorded: as given, else of the models that were learned from data of their speed and force; `None` if
    /// neither is known.
    pub fn recorded(&self) -> Option<Recorded> {
        let measured = self.models.iter().filter(|at| at.kind == VertexKind::Measured);
        self.recorded.or_else(|| Recorded::of(measured.map(|at| (at.speed_m_s, at.force_n))))
    }

    /// The same models with the high-pass, the recorded ranges and the layers of `other`, resampled to their rate.
    pub(crate) fn with_extras_of(self, other: &Self) -> Result<Self, TextureError> {
        let mut texture = self.with_highpass_hz(other.highpass_hz)?.with_recorded(other.recorded)?;
        texture.layers.clear();
        for layer in &other.layers {
            let resampled = layer.resampled(other.rate_hz, texture.rate_hz);
            texture = texture.with_layer(resampled.unwrap_or_else(|| layer.clone()))?;
        }
        Ok(texture)
    }

    /// A texture of `models`, which include the border, with the Delaunay triangulation of their z-scores.
    pub(crate) fn triangulated(rate_hz: f64, models: Vec<ModelAt>) -> Result<Self, TextureError> {
        let triangles = triangulation::delaunay(&positions(&models))?;
        Self::new(rate_hz, models, triangles)
    }

    /// A texture of measured models: adds the border (`hull::extend`), then triangulates.
    pub fn from_measured(
        rate_hz: f64,
        mut measured: Vec<ModelAt>,
        hull: &Hull,
    ) -> Result<Self, TextureError> {
        let edges = hull::extend(&measured, hull)?;
        measured.extend(edges);
        Self::triangulated(rate_hz, measured)
    }

    /// Sample rate of the models, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Warping factor of the models' frequency axis; 0 if it is not warped.
    pub fn warping(&self) -> f64 {
        self.models[0].model.warping()
    }

    /// Corner frequency of the high-pass that was divided out of the recordings before the models were fitted, and that a
    /// renderer applies once, at its output; `None` if the models include it.
    ///
    /// It is the high-pass of processing: a Butterworth filter of order 2, forward and backward, so that its magnitude is squared.
    pub fn highpass_hz(&self) -> Option<f64> {
        self.highpass_hz
    }

    /// The filter of [`Self::highpass_hz`] for a renderer: causal, of the same magnitude.
    pub fn output_highpass(&self) -> Option<Sections> {
        let once = butterworth_highpass(HIGHPASS_ORDER, self.highpass_hz?, self.rate_hz).ok()?;
        let sections = once.sections.iter().chain(&once.sections).copied().collect();
        Some(Sections { sections })
    }

    /// The models, which are the vertices of the triangles.
    pub fn models(&self) -> &[ModelAt] {
        &self.models
    }

    /// The distinct filters, and the filter of each vertex.
    pub(crate) fn distinct_filters(&self) -> (Vec<&ArmaModel>, Vec<usize>) {
        let mut filters: Vec<&ArmaModel> = Vec::new();
        let mut filter_of = Vec::with_capacity(self.models.len());
        for at in &self.models {
            let known = filters.iter().position(|filter| filter.same_filter(&at.model));
            filter_of.push(known.unwrap_or(filters.len()));
            if known.is_none() {
                filters.push(&at.model);
            }
        }
        (filters, filter_of)
    }

    /// The triangles, as vertex numbers from 0.
    pub fn triangles(&self) -> &[Triangle] {
        self.triangulation.triangles()
    }

    /// The map.
    pub fn triangulation(&self) -> &Triangulation {
        &self.triangulation
    }

    /// Largest modelled speed, m/s.
    pub fn max_speed_m_s(&self) -> f64 {
        self.triangulation.max_speed_m_s()
    }

    /// Largest modelled force, N.
    pub fn max_force_n(&self) -> f64 {
        self.triangulation.max_force_n()
    }

    /// Order of the AR polynomial, the same for all models.
    pub fn ar_order(&self) -> usize {
        self.models[0].model.ar().len()
    }

    /// Order of the MA polynomial, the same for all models; 0 for AR models.
    pub fn ma_order(&self) -> usize {
        self.models[0].model.ma().len()
    }
}

fn positions(models: &[ModelAt]) -> Vec<(f64, f64)> {
    models.iter().map(|at| (at.speed_m_s, at.force_n)).collect()
}

/// An error in the models or the map of a texture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TextureError {
    /// The rate is not positive.
    #[error("the rate of the texture's models is {} Hz; it must be {RATES}", shown(*rate_hz))]
    Rate {
        /// The value given.
        rate_hz: f64,
    },
    /// No models at all.
    #[error("the texture has no models; leave the texture out if there is none")]
    NoModels,
    /// Models of different orders cannot be interpolated.
    #[error(
        "model {vertex} (from 0) has orders {orders:?} (AR, MA), but the first has {expected:?}; all models must have the same orders"
    )]
    Orders {
        /// The model's number, from 0.
        vertex: usize,
        /// The AR and MA orders.
        orders: (usize, usize),
        /// The first model's.
        expected: (usize, usize),
    },
    /// Models on different frequency axes cannot be interpolated.
    #[error(
        "model {vertex} (from 0) has the warping factor {warping}, but the first has {expected}; all models must have the same factor"
    )]
    Warpings {
        /// The model's number, from 0.
        vertex: usize,
        /// The warping factor.
        warping: f64,
        /// The first model's.
        expected: f64,
    },
    /// The high-pass is not positive, or too high.
    #[error(
        "the high-pass of {cutoff_hz} Hz must lie above 0 and below a quarter of the models' rate, {rate_hz} Hz"
    )]
    Highpass {
        /// The corner frequency given.
        cutoff_hz: f64,
        /// The models' rate.
        rate_hz: f64,
    },
    /// A recorded range that does not ascend from 0 or more.
    #[error(
        "the recorded ranges are {:?} mm/s and {:?} N; each must ascend from 0 or more",
        (1000.0 * recorded.speed_m_s.0, 1000.0 * recorded.speed_m_s.1), recorded.force_n
    )]
    Recorded {
        /// The ranges given.
        recorded: Recorded,
    },
    /// An invalid layer.
    #[error(transparent)]
    Layer(#[from] LayerError),
    /// A model with variance at zero speed or force.
    #[error(
        "model {vertex} (from 0) stands at zero speed or force with variance {variance}; it must be 0 there"
    )]
    LoudAtRest {
        /// The model's number, from 0.
        vertex: usize,
        /// The variance.
        variance: f64,
    },
    /// A measured model at zero speed or force.
    #[error(
        "measured model {vertex} (from 0) stands at {speed_m_s} m/s, {force_n} N; both must be finite and above 0"
    )]
    MeasuredAtRest {
        /// The model's number, from 0.
        vertex: usize,
        /// The speed.
        speed_m_s: f64,
        /// The force.
        force_n: f64,
    },
    /// The requested maximum is below a measured model.
    #[error(
        "the map's maximum of {max_speed_m_s} m/s, {max_force_n} N must be at least that of the measured models, and there must be at least one measured model"
    )]
    Hull {
        /// Maximum speed of the map.
        max_speed_m_s: f64,
        /// Maximum force of the map.
        max_force_n: f64,
    },
    /// An invalid model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// An invalid triangulation.
    #[error(transparent)]
    Triangulation(#[from] TriangulationError),
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(speed_m_s: f64, force_n: f64, order: usize, variance: f64) -> ModelAt {
        let model = ArmaModel::from_ar(&vec![0.0; order], variance).unwrap();
        ModelAt { speed_m_s, force_n, model, kind: VertexKind::Edge }
    }

    #[test]
    fn recorded_ranges_ascend_and_are_those_of_measured_models_if_none_were_given() {
        let mut models = vec![corner(0.0, 0.0, 2, 0.0), corner(0.2, 0.0, 2, 0.0), corner(0.0, 2.0, 2, 0.0)];
        models.extend([(0.1, 1.5), (0.2, 2.0)].map(|(speed_m_s, force_n)| ModelAt {
            kind: VertexKind::Measured,
            ..corner(speed_m_s, force_n, 2, 1.0)
        }));
        let texture = TextureModel::triangulated(1000.0, models).unwrap();
        let measured = Recorded { speed_m_s: (0.1, 0.2), force_n: (1.5, 2.0) };
        assert_eq!(texture.recorded(), Some(measured));
        assert!(
            measured.contains(0.15, 1.5) && !measured.contains(0.15, 1.4) && !measured.contains(0.21, 1.5)
        );
        let given = Recorded { speed_m_s: (0.05, 0.15), force_n: (0.2, 1.8) };
        assert_eq!(texture.clone().with_recorded(Some(given)).unwrap().recorded(), Some(given));
        for bad in [(-0.1, 0.1), (0.2, 0.1), (0.0, f64::INFINITY), (f64::NAN, 1.0)] {
            let refused = texture.clone().with_recorded(Some(Recorded { speed_m_s: bad, ..given }));
            assert!(matches!(refused, Err(TextureError::Recorded { .. })));
        }
    }

    #[test]
    fn a_texture_that_sounds_at_rest_is_refused() {
        let corners = |loud: f64, order: usize| {
            vec![
                corner(0.0, 0.0, 2, 0.0),
                corner(0.2, 0.0, 2, loud),
                corner(0.0, 2.0, order, 0.0),
                corner(0.2, 2.0, 2, 1.0),
            ]
        };
        assert!(TextureModel::triangulated(1000.0, corners(0.0, 2)).is_ok());
        assert!(matches!(
            TextureModel::triangulated(1000.0, corners(0.1, 2)),
            Err(TextureError::LoudAtRest { vertex: 1, .. })
        ));
        assert!(matches!(
            TextureModel::triangulated(1000.0, corners(0.0, 3)),
            Err(TextureError::Orders { vertex: 2, .. })
        ));
        assert!(matches!(TextureModel::triangulated(0.0, corners(0.0, 2)), Err(TextureError::Rate { .. })));
        assert!(matches!(TextureModel::new(1000.0, vec![], vec![]), Err(TextureError::NoModels)));
    }
}
