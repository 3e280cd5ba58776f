//! The node kinds of haptograph: sensing, texture, friction, tapping, actuators, simulated bodies.

pub mod actuators;
pub mod contact;
pub mod friction;
pub mod sensing;
pub mod simulated;
pub mod tapping;

pub(crate) use haptograph_signal::vector;
