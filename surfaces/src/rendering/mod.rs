//! The vibration of textures along trajectories of speed and force, offline.
//!
//! - [`synthesis`]: of one texture.
//! - [`voices`]: of many textures at once.

pub mod synthesis;
pub mod voices;

pub use synthesis::{
    RandomWalk, SynthesisError, SynthesisSettings, Trajectory, UpdatePoints, synthesise, synthesise_with,
    update_samples, updates,
};
pub use voices::{Voice, VoiceError, VoiceInto, synthesise_into, synthesise_many, synthesise_many_with};
