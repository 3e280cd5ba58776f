//! Actuators and what stands before them: the voice-coil model, its identification and its compensation.

pub mod brake;
pub mod brake_node;
pub mod compensator;
pub mod drive;
pub mod force_sink;
pub mod identify;
pub mod limit;
pub mod two_mass;
