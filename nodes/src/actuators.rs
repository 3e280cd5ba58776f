//! Actuators and what stands before them: limits, the voice-coil model, its compensation.

pub mod compensator;
pub mod identify;
pub mod limit;
pub mod two_mass;
