//! Actuators: the voice-coil model, its identification, its dynamic compensation, brakes and sinks.

pub mod brake;
pub mod brake_node;
pub mod compensator;
pub mod drive;
pub mod force_sink;
pub mod identify;
pub mod limit;
pub mod two_mass;
