//! Learns a surface from recordings (thesis 2.2.3, 2.3, 4.2).
//!
//! ```text
//! recordings ──► processing ─┬► windows ──► law, lines, clips, onset ────┐
//!                            └► segmentation ──► texture ────────────────┤   (the thesis's)
//!      circle or drag ──► friction ──────────────────────────────────────┤
//!                 tap ──► taps ──────────────────────────────────────────┼──► Surface
//!               press ──► stiffness ─────────────────────────────────────┘
//! ```
//!
//! [`learn`] runs all of it. The result depends only on recordings and settings, to the bit.

pub(crate) mod breakaway;
pub(crate) mod cells;
mod clips;
mod correction;
mod coverage;
pub mod friction;
mod grain;
pub mod law;
mod lines;
mod method;
mod onset;
pub(crate) mod outliers;
mod pipeline;
mod regression;
pub mod segmentation;
pub(crate) mod spectral_law;
pub mod stiffness;
pub mod taps;
pub mod texture;
mod whitening;

pub use breakaway::{NoOnset, OnsetShown};
pub use coverage::coverage;
pub use method::TextureMethod;
pub use pipeline::{LearnError, LearnSettings, LearningReport, NarrowBand, learn};
