//! Orientations as unit quaternions w, x, y, z, and the two forms in which signals and sensors carry them: the rotation vector
//! (axis times angle, rad) and yaw, pitch and roll.

use crate::vector::{Vec3, ZERO, add, add_scaled, cross, norm, scale};
use haptograph_signal::units::Degrees;

/// A vector turned by a unit quaternion.
pub(crate) fn rotate([w, x, y, z]: [f64; 4], v: Vec3) -> Vec3 {
    let q = [x, y, z];
    let t = scale(cross(q, v), 2.0);
    add(add_scaled(v, t, w), cross(q, t))
}

/// The inverse of a unit quaternion.
pub(crate) fn conjugate([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [w, -x, -y, -z]
}

/// Tilted from upright by an angle towards a heading, without turning about its own axis.
pub(crate) fn tilted(tilt_rad: f64, heading_rad: f64) -> [f64; 4] {
    from_rotation_vector([-tilt_rad * heading_rad.sin(), tilt_rad * heading_rad.cos(), 0.0])
}

/// The rotation vector of a unit quaternion, rad, its length at most pi.
pub(crate) fn rotation_vector([w, x, y, z]: [f64; 4]) -> Vec3 {
    let (w, v) = if w < 0.0 { (-w, [-x, -y, -z]) } else { (w, [x, y, z]) };
    let sin = norm(v);
    if sin > 0.0 { scale(v, 2.0 * sin.atan2(w) / sin) } else { ZERO }
}

/// The unit quaternion of a rotation vector, rad.
pub(crate) fn from_rotation_vector(v: Vec3) -> [f64; 4] {
    let angle = norm(v);
    let (sin, cos) = (0.5 * angle).sin_cos();
    let [x, y, z] = if angle > 0.0 { scale(v, sin / angle) } else { ZERO };
    [cos, x, y, z]
}

/// The rotation matrix of a unit quaternion, by rows.
pub(crate) fn matrix(q: [f64; 4]) -> [Vec3; 3] {
    let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| rotate(q, axis));
    std::array::from_fn(|row| columns.map(|column| column[row]))
}

/// Yaw, pitch and roll (z, y', x'') of a unit quaternion, rad.
pub(crate) fn angles([w, x, y, z]: [f64; 4]) -> Vec3 {
    [
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)),
        (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin(),
        (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)),
    ]
}

/// The unit quaternion of yaw, pitch and roll, rad.
pub(crate) fn from_angles(angles: Vec3) -> [f64; 4] {
    let [(sz, cz), (sy, cy), (sx, cx)] = angles.map(|a| (0.5 * a).sin_cos());
    [
        cz * cy * cx + sz * sy * sx,
        cz * cy * sx - sz * sy * cx,
        cz * sy * cx + sz * cy * sx,
        sz * cy * cx - cz * sy * sx,
    ]
}

/// A rotation matrix by rows from axis times angle.
pub(crate) fn rotation_of(turn: [Degrees; 3]) -> [Vec3; 3] {
    matrix(from_rotation_vector(turn.map(Degrees::si)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{dot, sub};

    #[test]
    fn quaternions_turn_vectors_and_back() {
        let q = tilted(0.3, 0.7);
        let up = rotate(q, [0.0, 0.0, 1.0]);
        let wanted = [0.3_f64.sin() * 0.7_f64.cos(), 0.3_f64.sin() * 0.7_f64.sin(), 0.3_f64.cos()];
        assert!(norm(sub(up, wanted)) < 1e-15);
        let v = [0.1, -0.4, 0.8];
        assert!(norm(sub(rotate(conjugate(q), rotate(q, v)), v)) < 1e-15);
        let by_rows = matrix(q).map(|row| dot(row, v));
        assert!(norm(sub(by_rows, rotate(q, v))) < 1e-15);
    }

    #[test]
    fn every_form_leads_back_to_the_same_orientation() {
        for vector in [[0.3, -0.5, 1.2], [-2.0, 0.1, 0.4], ZERO, [1e-9, 0.0, -2e-9], [0.0, 3.1, 0.0]] {
            let q = from_rotation_vector(vector);
            assert!(norm(sub(rotation_vector(q), vector)) < 1e-12, "{vector:?}");
            assert!(norm(sub(rotation_vector(from_angles(angles(q))), vector)) < 1e-7, "{vector:?}");
            assert_eq!(rotation_vector(q), rotation_vector(q.map(|x| -x)));
        }
    }
}
