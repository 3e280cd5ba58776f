//! haptograph's surface format: RON, readable and editable by hand.
//!
//! ```ron
//! Surface(
//!     format: 1,
//!     name: "canvas",
//!     provenance: (
//!         origin: procedural,              // or simulated, measured, imported
//!         source: "an example",
//!         made_by: "haptograph 0.1.0",
//!         settings: { "seed": "7" },
//!     ),
//!     friction: (mu: 0.35, r_squared: 0.86),
//!     stiffness: (n_per_mm: 10.81),
//!     taps: (rate_hz: 1000, taps: [
//!         (speed_mm_s: 100, peak_force_n: 2.5, acceleration_m_s2: [80, -40, 10]),
//!     ]),
//!     texture: (
//!         rate_hz: 10000,
//!         filters: [                       // A(z) = 1 + sum of a_k z^-k; `ar` or `ar_lsf` or both
//!             (ar: [-0.9, 0.2]),
//!         ],
//!         vertices: [                      // of the map; `filter` counts from 0, variance is in (m/s2)^2
//!             (speed_mm_s: 0, force_n: 0, filter: 0, variance: 0, kind: edge),
//!             (speed_mm_s: 200, force_n: 0, filter: 0, variance: 0, kind: edge),
//!             (speed_mm_s: 200, force_n: 3, filter: 0, variance: 0.5, kind: measured),
//!             (speed_mm_s: 0, force_n: 3, filter: 0, variance: 0, kind: edge),
//!         ],
//!         triangles: [(0, 1, 2), (0, 2, 3)], // left out: Delaunay of the z-scored vertices
//!     ),
//! )
//! ```
//!
//! Friction, stiffness, taps and texture are optional. So is the peak normal force of a tap. A filter can also have `ma`
//! (and `ma_lsf`) and `gain`.
//!
//! Further optional fields of a texture: `warping`, the factor of the models' frequency axis (vertices then have
//! `power_m2_s4`, the power of the vibration, instead of `variance`); `highpass_hz`, the high-pass that the models
//! leave to the renderer; `grain: (octave_shares: [...], gain_db: [...])`, how the level of the excitation fluctuates
//! ([`crate::Grain`]; `crackle: (depth: 0.6, time_constant_ms: 8)` of earlier files is read as such); and at most three
//! `lines: [(cycles_per_mm: 0.34, diffusion_rad2_per_mm: 0.02, powers_m2_s4: [...])]`, each with a power for every
//! vertex, 0 at rest ([`crate::SpatialLine`]). The version stays 1, because they do not change the meaning of a file
//! without them; a program that does not support one of them refuses the file.
//!
//! LSFs are in radians. If a filter has coefficients and LSFs, both are stored and the LSFs take precedence
//! ([`crate::ArmaModel`]). Unknown fields and duplicate keys are errors. Numbers, speeds included, are written as the
//! shortest decimal that reads back to the same bits.

mod document;
mod read;
mod write;

pub(crate) use document::{Bounded, PerMm, Thousandths};
pub(crate) use read::options;
pub use read::{read, read_with};
pub use write::write;
pub(crate) use write::write_numbers;

/// The version of the format, in each file's `format` field.
pub(crate) const FORMAT: u64 = 1;

#[cfg(test)]
mod tests;
