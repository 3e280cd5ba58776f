//! Data-driven haptic surfaces: their files, interpolation, resampling and rendering, and the files that a recording tool
//! writes. The crate depends on neither graphs nor learning.
//!
//! A [`Surface`] has friction, taps, texture and stiffness with [`Provenance`]. Its texture is a [`TextureModel`]: a
//! triangulated map over (speed, force) of autoregressive models, each an [`ArmaModel`]. Values in memory are SI
//! (m/s, N, m/s²); files use mm/s and N. The constructor of each type checks its values.

#![cfg_attr(not(test), warn(unreachable_pub))]

pub mod bounds;
pub mod coverage;
pub mod files;
pub mod hull;
pub mod interpolation;
pub mod layers;
pub mod lsf;
pub mod model;
#[cfg(not(target_family = "wasm"))]
pub mod npy;
#[cfg(not(target_family = "wasm"))]
pub mod npz;
pub mod provenance;
pub mod recorder;
pub mod rendering;
pub mod resampling;
pub mod surface;
pub mod taps;
pub mod texture;
pub mod triangulation;

pub use haptograph_signal::statistics::Line;
pub use interpolation::{Coefficients, Interpolator, Spot};
pub use layers::{Grain, SpatialLine};
pub use model::{ArmaModel, MAX_ORDER, ModelError};
pub use provenance::{Origin, Provenance};
pub use surface::{Friction, StaticPeak, Stiffness, Surface, SurfaceError};
pub use taps::{Tap, Taps};
pub use texture::{ModelAt, Recorded, TextureError, TextureModel, VertexKind};
