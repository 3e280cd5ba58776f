//! Data-driven haptic surfaces: their files, interpolation and resampling, learning from recordings, and measures of how
//! well a virtual surface matches a real one. The crate does not depend on graphs.
//!
//! A [`Surface`] has friction, taps, texture and stiffness with [`Provenance`]. Its texture is a [`TextureModel`]: a
//! triangulated map over (speed, force) of autoregressive models, each an [`ArmaModel`]. Values in memory are SI
//! (m/s, N, m/s²); files use mm/s and N. The constructor of each type checks its values.
//!
//! # Features
//!
//! | feature | default | adds |
//! |---|---|---|
//! | `spreadsheets` | yes | recordings in XLSX files |
//! | `genetic` | | the island genetic algorithm of the thesis for segmentation, slower and never better than the exact search |

#[cfg(not(target_family = "wasm"))]
pub mod batch;
pub mod bounds;
pub mod crackle;
pub mod evaluate;
pub mod files;
pub mod hull;
pub mod interpolation;
pub mod learning;
pub mod lines;
pub mod lsf;
pub mod metrics;
pub mod model;
#[cfg(not(target_family = "wasm"))]
mod npy;
#[cfg(not(target_family = "wasm"))]
mod npz;
pub mod provenance;
pub mod recording;
pub mod resampling;
pub mod select;
pub mod shard;
mod statistics;
pub mod surface;
pub mod taps;
pub mod texture;
pub mod triangulation;

pub use crackle::Crackle;
pub use interpolation::{Coefficients, Interpolator, Spot};
pub use lines::SpatialLine;
pub use model::{ArmaModel, MAX_ORDER, ModelError};
pub use provenance::{Origin, Provenance};
pub use statistics::Line;
pub use surface::{Friction, Stiffness, Surface, SurfaceError};
pub use taps::{Tap, Taps};
pub use texture::{ModelAt, TextureError, TextureModel, VertexKind};
