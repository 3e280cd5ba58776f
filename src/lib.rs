//! haptograph: a dataflow signal-processing graph engine that renders the feel of real surfaces.
//!
//! This crate is the face of the workspace and what its command draws; the work is done in the rooms below it.

pub mod recorder;
pub mod report;

pub use haptograph_engine as engine;
pub use haptograph_nodes as nodes;
pub use haptograph_signal as signal;
pub use haptograph_surfaces as surfaces;
