//! Actuators: the voice-coil model, its identification, its dynamic compensation, brakes and sinks.

#[cfg(feature = "touch")]
pub mod brake;
#[cfg(feature = "touch")]
pub(crate) mod brake_node;
#[cfg(feature = "touch")]
pub(crate) mod compensator;
#[cfg(feature = "touch")]
pub(crate) mod drive;
#[cfg(feature = "touch")]
pub mod identify;
pub(crate) mod limit;
pub(crate) mod sinks;
#[cfg(feature = "touch")]
pub(crate) mod two_mass;
