//! The surface that the hand of a simulated device touches, for replacing that hand by another.

use super::ground::Ground;
use super::{arm, pen};
use crate::contact::shape::Shape;
use haptograph_engine::device::Device;

/// A surface in space, and its stiffness under a hand.
#[derive(Debug, Clone)]
pub struct Touchable {
    /// The surface. Flat coordinates are laid over it as a sheet.
    pub ground: Ground,
    /// Stiffness, N/m; infinite if the surface is rigid.
    pub gives_n_per_m: f64,
    /// Width of the surface, m; infinite for a plane.
    pub across_m: f64,
    /// The shapes that the device's tool can touch.
    pub scene: Vec<Shape>,
    /// Diameter of the ball at the tool's tip, m.
    pub tool_diameter_m: f64,
}

impl Touchable {
    /// Returns the part of a device whose simulated hand touches a surface in space: `SimulatedOmni` or
    /// `SimulatedPenAndObject`.
    pub fn of(device: &dyn Device) -> Option<&Self> {
        let device = device.as_any();
        arm::touchable(device).or_else(|| pen::touchable(device))
    }
}
