//! Actuators: the voice-coil model, its identification, its dynamic compensation, brakes and sinks.

pub mod brake;
pub(crate) mod brake_node;
pub(crate) mod compensator;
pub(crate) mod drive;
pub(crate) mod force_sink;
pub mod identify;
pub(crate) mod limit;
pub(crate) mod two_mass;
