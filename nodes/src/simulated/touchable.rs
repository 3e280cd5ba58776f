//! What the hand of a simulated device touches, for whoever puts another hand in its place.

use super::ground::Ground;
use super::{arm, pen};
use haptograph_engine::device::Device;

/// A surface in space, and how it gives under a hand.
#[derive(Debug, Clone)]
pub struct Touchable {
    /// The surface. Flat coordinates are laid over it as a sheet.
    pub ground: Ground,
    /// How deep a force goes in, N/m; infinite where the surface does not give.
    pub gives_n_per_m: f64,
    /// How far what is stroked reaches across, m; infinite for a plane.
    pub across_m: f64,
}

impl Touchable {
    /// Returns the part of a device whose simulated hand touches a surface in space: [`SimulatedOmni`](arm::SimulatedOmni) or
    /// [`SimulatedPenAndObject`](pen::SimulatedPenAndObject).
    pub fn of(device: &dyn Device) -> Option<&Self> {
        let device = device.as_any();
        arm::touchable(device).or_else(|| pen::touchable(device))
    }
}
