//! Actuators and what stands before them: limits, the voice-coil model, its compensation.

pub mod limit;
