//! The friction brake of the augmented-reality pen (5.3, 5.5): a solenoid presses a plunger on the rolling ball, so that the
//! pen drags as if it slid on a surface of higher friction.

mod control;
pub mod solenoid;
mod thermal;

pub use control::{Brake, BrakeCommand, BrakeSettings, Dragging, Reach};
pub use solenoid::Solenoid;
pub use thermal::{CoilSettings, CoilThermal};
