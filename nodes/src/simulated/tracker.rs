//! A simulated magnetic tracker (2.2.1): quantised position and orientation.

use super::orientation::{angles, from_angles};
use super::tablet::quantise;
use crate::vector::Vec3;
use std::f64::consts::PI;

/// Properties of the tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TrackerSettings {
    /// Step of the position, m.
    pub step_m: f64,
    /// Step of the angles, rad.
    pub step_rad: f64,
}

impl Default for TrackerSettings {
    /// A TrakSTAR: 0.5 mm, 0.1 degrees.
    fn default() -> Self {
        Self { step_m: 0.5e-3, step_rad: 0.1 * PI / 180.0 }
    }
}

impl TrackerSettings {
    /// The reading of a position, m, and a unit quaternion w, x, y, z: stepped in position and in yaw, pitch and roll.
    pub(crate) fn sample(&self, position_m: Vec3, orientation: [f64; 4]) -> (Vec3, [f64; 4]) {
        let angles = angles(orientation).map(|a| quantise(a, self.step_rad));
        (position_m.map(|x| quantise(x, self.step_m)), from_angles(angles))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_within_half_a_step() {
        let tracker = TrackerSettings::default();
        let true_angles = [0.31, -0.23, 0.047];
        let (position, orientation) = tracker.sample([0.01234, -0.0003, 0.0], from_angles(true_angles));
        assert_eq!(position, [0.0125, -0.0005, 0.0]);
        for (seen, truth) in angles(orientation).iter().zip(true_angles) {
            assert!((seen - truth).abs() <= 0.5001 * tracker.step_rad);
            let steps = seen / tracker.step_rad;
            assert!((steps - steps.round()).abs() < 1e-9);
        }
        assert!((orientation.iter().map(|q| q * q).sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
