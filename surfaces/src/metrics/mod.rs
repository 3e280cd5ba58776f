//! Measures of how alike two vibrations are, how a vibration responds to force and speed, and how rough a surface looks.
//!
//! - [`spectral`]: normalized spectral error, power error and spectral difference of thesis section 2.5.1; windowed power and spectral
//!   centroid.
//! - [`responsiveness`]: the changes in their variation of section 4.5.3.
//! - [`image`]: roughness and fineness of a photograph, section 3.2.

pub mod image;
mod pairs;
pub mod responsiveness;
pub mod spectral;

pub use image::{GrayImage, fineness_per_mm, roughness};
pub use pairs::{all_pairs, pair_index};
pub use spectral::{
    Deviations, ErrorStatistics, MetricError, PairErrors, Pooling, WindowSettings, WindowedSpectra, compare,
};
