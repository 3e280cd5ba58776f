//! A simulated magnetic tracker (2.2.1): position and orientation in steps, 240 times a second.

use super::tablet::quantise;
use crate::vector::Vec3;
use std::f64::consts::PI;

/// Properties of the tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackerSettings {
    /// Readings per second.
    pub rate_hz: f64,
    /// Step of the position, m.
    pub step_m: f64,
    /// Step of the angles, rad.
    pub step_rad: f64,
}

impl Default for TrackerSettings {
    /// A TrakSTAR: 240 Hz, 0.5 mm, 0.1 degrees.
    fn default() -> Self {
        Self { rate_hz: 240.0, step_m: 0.5e-3, step_rad: 0.1 * PI / 180.0 }
    }
}

impl TrackerSettings {
    /// The reading of a position, m, and a unit quaternion w, x, y, z: stepped in position and in yaw, pitch and roll.
    pub fn sample(&self, position_m: Vec3, orientation: [f64; 4]) -> (Vec3, [f64; 4]) {
        let angles = angles(orientation).map(|a| quantise(a, self.step_rad));
        (position_m.map(|x| quantise(x, self.step_m)), quaternion(angles))
    }
}

/// Yaw, pitch and roll (z, y', x'') of a unit quaternion, rad.
fn angles([w, x, y, z]: [f64; 4]) -> Vec3 {
    [
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)),
        (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin(),
        (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)),
    ]
}

fn quaternion(angles: Vec3) -> [f64; 4] {
    let [(sz, cz), (sy, cy), (sx, cx)] = angles.map(|a| (0.5 * a).sin_cos());
    [
        cz * cy * cx + sz * sy * sx,
        cz * cy * sx - sz * sy * cx,
        cz * sy * cx + sz * cy * sx,
        sz * cy * cx - cz * sy * sx,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_quaternions_are_each_others_inverse() {
        for angles_in in [[0.3, -0.5, 1.2], [-2.0, 0.1, 0.4], [0.0; 3]] {
            let back = angles(quaternion(angles_in));
            assert!(back.iter().zip(angles_in).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    #[test]
    fn readings_are_within_half_a_step() {
        let tracker = TrackerSettings::default();
        let true_angles = [0.31, -0.23, 0.047];
        let (position, orientation) = tracker.sample([0.01234, -0.0003, 0.0], quaternion(true_angles));
        assert_eq!(position, [0.0125, -0.0005, 0.0]);
        for (seen, truth) in angles(orientation).iter().zip(true_angles) {
            assert!((seen - truth).abs() <= 0.5001 * tracker.step_rad);
            let steps = seen / tracker.step_rad;
            assert!((steps - steps.round()).abs() < 1e-9);
        }
        assert!((orientation.iter().map(|q| q * q).sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
