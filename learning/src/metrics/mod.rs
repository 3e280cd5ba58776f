//! Measures of the similarity of two vibrations, of the response of a vibration to force and speed, and of
//! the visual roughness of a surface.
//!
//! - [`spectral`]: normalized spectral error, power error and spectral difference of thesis section 2.5.1; windowed power and spectral
//!   centroid.
//! - `responsiveness`: the losses of their variation, section 4.5.3.
//! - `bands`: powers in third octaves from 20 to 1000 Hz and the log-spectral distance.
//! - [`level`]: kurtosis and levels over time.
//! - [`FluctuationErrors`]: modulation, quantiles of levels, kurtosis and correlation of bands of one rendering.
//! - `image`: roughness and fineness of a photograph, section 3.2.

pub(crate) mod bands;
pub(crate) mod fluctuation;
pub(crate) mod image;
pub mod level;
pub(crate) mod multitaper;
mod pairs;
pub(crate) mod responsiveness;
pub mod spectral;
pub(crate) mod strokes;

pub use bands::{Band, BandErrors, BandPowers, Bands, log_spectral_distance};
pub use fluctuation::{Fluctuation, FluctuationErrors};
pub use image::{GrayImage, fineness_per_mm, roughness};
pub use pairs::{all_pairs, pair_index};
pub use spectral::{
    Deviations, ErrorStatistics, MetricError, PairErrors, Pooling, WindowSettings, WindowedSpectra, compare,
};
pub use strokes::onset_levels_db;

#[cfg(test)]
mod tests;
