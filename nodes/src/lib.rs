//! The node kinds of haptograph: sensing, texture, friction, tapping, actuators, simulated bodies.

pub mod actuators;
pub mod contact;
pub mod simulated;

pub(crate) use haptograph_signal::vector;
