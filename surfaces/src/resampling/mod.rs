//! Resampling of textures to a lower rate by one of three methods.
//!
//! * [`Method::Spectral`], the most accurate: fits an AR model to the spectrum below the new Nyquist
//!   frequency. Stable by construction, within a tenth of a decibel; any lower rate.
//! * [`Method::Zoh`], the thesis's method (4.2): an exact zero-order hold of the filter's input. Gives an
//!   ARMA model; zeros outside the unit circle are reflected into it, which preserves the spectrum. Hold and
//!   aliasing cost up to a decibel below 0.4 of the new rate. Integer ratios of rates.
//! * [`Method::Hatt`], the toolkit's method for its 1 kHz files: like `Zoh` on the delayed filter, with zeros
//!   pulled in rather than reflected, which costs 8 dB at 400 Hz. AR models only, integer ratios. For
//!   comparison.
//!
//! All methods scale the variance with the rate (Eq. 4.2.2), so that the spectral density is preserved.

mod deviation;
mod hatt;
pub(crate) mod roots;
mod spectral;
mod zoh;

pub use deviation::{Deviation, deviation_db};

use crate::model::{ArmaModel, ModelError};
use crate::{ModelAt, Surface, TextureError, TextureModel};

/// The poles of 1/A(z) from the coefficients a_1..a_p, stable or not. `None` in the rare case that they
/// cannot be found to 9 digits.
pub fn poles(ar: &[f64]) -> Option<Vec<haptograph_signal::Complex64>> {
    roots::of_monic(ar)
}

/// Resampling method. See the [module](self).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// Exact zero-order hold.
    Zoh,
    /// The toolkit's variant of the zero-order hold.
    Hatt,
    /// Refit of the band-limited spectrum.
    Spectral,
}

impl Method {
    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Method::Zoh => "zoh",
            Method::Hatt => "hatt",
            Method::Spectral => "spectral",
        }
    }
}

/// A resampled texture with its deviation from the original.
#[derive(Debug, Clone, PartialEq)]
pub struct Resampled {
    /// The same map at the new rate.
    pub texture: TextureModel,
    /// The largest difference of spectral density over all models, from 20 Hz to 0.4 of the new rate.
    pub worst: Deviation,
    /// Number of the model with that difference, from 0.
    pub worst_vertex: usize,
}

/// Resamples a texture to a lower rate.
pub fn resample(texture: &TextureModel, rate_hz: f64, method: Method) -> Result<Resampled, ResampleError> {
    let old_rate_hz = texture.rate_hz();
    if !(rate_hz.is_finite() && rate_hz > 0.0 && rate_hz < old_rate_hz) {
        return Err(ResampleError::NotLower { rate_hz, old_rate_hz });
    }
    if deviation::LOWEST_HZ >= deviation::HIGHEST_OF_RATE * rate_hz {
        return Err(ResampleError::EmptyBand { rate_hz });
    }
    // Border vertices share the filters of the interior.
    let (filters, filter_of) = texture.distinct_filters();
    let unit: Vec<ArmaModel> = filters
        .iter()
        .map(|filter| (*filter).clone().with_variance(1.0))
        .collect::<Result<_, _>>()
        .map_err(|error| ResampleError::Model { vertex: 0, error })?;
    let vertex_of = |filter: usize| filter_of.iter().position(|&of| of == filter).unwrap_or(0);
    if texture.warping() != 0.0 && method != Method::Spectral {
        return Err(ResampleError::Warped { method: method.name() });
    }
    let resampled = match method {
        Method::Spectral => spectral::resample_all(&unit, old_rate_hz, rate_hz),
        Method::Zoh | Method::Hatt => {
            let hold = if method == Method::Zoh { zoh::resample } else { hatt::resample };
            let ratio = whole_ratio(old_rate_hz, rate_hz, method)?;
            unit.iter()
                .enumerate()
                .map(|(filter, model)| hold(model, ratio).map_err(|error| (filter, error)))
                .collect()
        }
    };
    let resampled = resampled.map_err(|(filter, error)| error.at(vertex_of(filter)))?;
    let (worst_filter, worst) = unit
        .iter()
        .zip(&resampled)
        .map(|(old, new)| deviation_db(old, old_rate_hz, new, rate_hz))
        .enumerate()
        .max_by(|(_, a), (_, b)| a.db.abs().total_cmp(&b.db.abs()))
        .unwrap_or((0, Deviation { db: 0.0, frequency_hz: 0.0 }));
    let models = texture.models().iter().zip(&filter_of).enumerate().map(|(vertex, (at, &filter))| {
        let model = resampled[filter].clone();
        let variance = at.model.variance() * model.variance();
        let model = model.with_variance(variance).map_err(|error| ResampleError::Model { vertex, error })?;
        Ok(ModelAt { model, ..at.clone() })
    });
    let models = models.collect::<Result<Vec<_>, ResampleError>>()?;
    let texture =
        TextureModel::new(rate_hz, models, texture.triangles().to_vec())?.with_extras_of(texture)?;
    Ok(Resampled { texture, worst, worst_vertex: vertex_of(worst_filter) })
}

/// Resamples the texture of a surface and records it in the provenance.
pub fn resample_surface(
    surface: &Surface,
    rate_hz: f64,
    method: Method,
) -> Result<(Surface, Resampled), ResampleError> {
    let texture = surface.texture.as_ref().ok_or(ResampleError::NoTexture)?;
    let resampled = resample(texture, rate_hz, method)?;
    let mut surface = surface.clone();
    let how = format!("from {} Hz to {rate_hz} Hz by {}", texture.rate_hz(), method.name());
    let before = surface.provenance.settings.get("resampled").map(|before| format!("{before}, then "));
    let how = before.unwrap_or_default() + &how;
    surface.provenance = surface.provenance.with_setting("resampled", how);
    surface.texture = Some(resampled.texture.clone());
    Ok((surface, resampled))
}

fn whole_ratio(old_rate_hz: f64, rate_hz: f64, method: Method) -> Result<usize, ResampleError> {
    let ratio = old_rate_hz / rate_hz;
    let whole = ratio.round();
    if (ratio - whole).abs() > 1e-9 * whole {
        return Err(ResampleError::NotWhole {
            method: method.name(),
            old_rate_hz,
            rate_hz,
            below_hz: old_rate_hz / ratio.ceil(),
            above_hz: old_rate_hz / ratio.floor(),
        });
    }
    if whole > LARGEST_RATIO {
        return Err(ResampleError::RatioTooLarge { old_rate_hz, rate_hz });
    }
    Ok(whole as usize)
}

const LARGEST_RATIO: f64 = 1000.0;

/// Error of resampling a single filter.
#[derive(Debug)]
enum FilterError {
    Roots,
    HasMovingAverage,
    Vanishes,
    Model(ModelError),
}

impl From<ModelError> for FilterError {
    fn from(error: ModelError) -> Self {
        FilterError::Model(error)
    }
}

impl FilterError {
    fn at(self, vertex: usize) -> ResampleError {
        match self {
            FilterError::Roots => ResampleError::Roots { vertex },
            FilterError::HasMovingAverage => ResampleError::HasMovingAverage { vertex },
            FilterError::Vanishes => ResampleError::Vanishes { vertex },
            FilterError::Model(error) => ResampleError::Model { vertex, error },
        }
    }
}

/// Error of resampling a texture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ResampleError {
    /// The surface has no texture.
    #[error("the surface has no texture to resample")]
    NoTexture,
    /// A method for unwarped models only.
    #[error("the method {method} cannot resample a warped texture; use spectral")]
    Warped {
        /// The method.
        method: &'static str,
    },
    /// The new rate is not below the old one.
    #[error("the new rate of {rate_hz} Hz must be above 0 and below the models' own, {old_rate_hz} Hz")]
    NotLower {
        /// The requested rate.
        rate_hz: f64,
        /// The models' rate.
        old_rate_hz: f64,
    },
    /// Too little of the compared band is left.
    #[error(
        "at {rate_hz} Hz the band from 20 Hz to 0.4 of the rate, in which textures are compared, is empty; give a rate above 50 Hz"
    )]
    EmptyBand {
        /// The requested rate.
        rate_hz: f64,
    },
    /// The ratio of rates is not an integer.
    #[error(
        "{old_rate_hz} Hz is not a whole multiple of {rate_hz} Hz, which `{method}` needs; use `spectral`, or a rate such as {below_hz} or {above_hz} Hz"
    )]
    NotWhole {
        /// The requested method.
        method: &'static str,
        /// The models' rate.
        old_rate_hz: f64,
        /// The requested rate.
        rate_hz: f64,
        /// The next lower rate that works.
        below_hz: f64,
        /// The next higher rate that works (the models' own if there is none).
        above_hz: f64,
    },
    /// The ratio of rates is too large for a hold.
    #[error("from {old_rate_hz} Hz to {rate_hz} Hz is more than a thousandfold; use `spectral`")]
    RatioTooLarge {
        /// The models' rate.
        old_rate_hz: f64,
        /// The requested rate.
        rate_hz: f64,
    },
    /// The toolkit's method supports AR models only.
    #[error(
        "model {vertex} (from 0) has a moving-average part, which this method does not resample; use `spectral`"
    )]
    HasMovingAverage {
        /// The model's number, from 0.
        vertex: usize,
    },
    /// The roots of a polynomial could not be found.
    #[error("the roots of model {vertex} (from 0) could not be found to enough digits; use `spectral`")]
    Roots {
        /// The model's number, from 0.
        vertex: usize,
    },
    /// The response vanishes at the new rate.
    #[error("the response of model {vertex} (from 0) has died out before the first sample at the new rate")]
    Vanishes {
        /// The model's number, from 0.
        vertex: usize,
    },
    /// The resampled model is invalid.
    #[error("model {vertex} (from 0) at the new rate: {error}")]
    Model {
        /// The model's number, from 0.
        vertex: usize,
        /// The error.
        error: ModelError,
    },
    /// The resampled models do not form a texture.
    #[error(transparent)]
    Texture(#[from] TextureError),
}

#[cfg(test)]
mod tests;
