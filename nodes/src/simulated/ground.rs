//! Sheets laid over surfaces: a stroke's flat coordinates become points and outward normals in space.

use crate::vector::{Vec3, add_scaled, direction, sub, tangents};

/// The surface that a hand means to touch.
#[derive(Debug, Clone, PartialEq)]
pub enum Ground {
    /// A plane.
    Plane {
        /// A point of the plane, the origin of strokes, m.
        origin_m: Vec3,
        /// Outward direction, of any length.
        normal: Vec3,
    },
    /// A sphere from outside. The sheet touches it at its top and is projected from the centre.
    Sphere {
        /// Centre, m.
        centre_m: Vec3,
        /// Radius at which contact is felt (with a proxy sphere, the sum of both radii), m.
        radius_m: f64,
        /// Direction from the centre to the origin of strokes, of any length.
        up: Vec3,
    },
}

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundPoint {
    /// Position, m.
    pub position_m: Vec3,
    /// Outward unit normal.
    pub normal: Vec3,
}

impl Ground {
    /// The horizontal plane through the origin, outside above.
    pub const TABLE: Self = Self::Plane {
        origin_m: [0.0; 3],
        normal: [0.0, 0.0, 1.0],
    };

    /// The surface point of a stroke's coordinates.
    pub fn at(&self, [u, v]: [f64; 2]) -> GroundPoint {
        match *self {
            Self::Plane { origin_m, normal } => {
                let normal = direction(normal).unwrap_or([0.0, 0.0, 1.0]);
                let [e_u, e_v] = tangents(normal);
                GroundPoint {
                    position_m: add_scaled(add_scaled(origin_m, e_u, u), e_v, v),
                    normal,
                }
            }
            Self::Sphere {
                centre_m,
                radius_m,
                up,
            } => {
                let up = direction(up).unwrap_or([0.0, 0.0, 1.0]);
                let [e_u, e_v] = tangents(up);
                let sheet_m = add_scaled(add_scaled(add_scaled(centre_m, up, radius_m), e_u, u), e_v, v);
                let normal = direction(sub(sheet_m, centre_m)).unwrap_or(up);
                GroundPoint {
                    position_m: add_scaled(centre_m, normal, radius_m),
                    normal,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::distance;

    #[test]
    fn a_plane_keeps_lengths_and_a_sphere_keeps_its_radius() {
        let slope = Ground::Plane {
            origin_m: [0.1, 0.0, 0.0],
            normal: [0.0, 3.0, 4.0],
        };
        let way_m = distance(slope.at([0.03, 0.0]).position_m, slope.at([0.0, 0.04]).position_m);
        assert!((way_m - 0.05).abs() < 1e-15);
        let ball = Ground::Sphere {
            centre_m: [0.0, 0.0, -0.05],
            radius_m: 0.05,
            up: [0.0, 0.0, 1.0],
        };
        assert!(distance(ball.at([0.0, 0.0]).position_m, [0.0; 3]) < 1e-15);
        let far = ball.at([0.2, -0.1]);
        assert!((distance(far.position_m, [0.0, 0.0, -0.05]) - 0.05).abs() < 1e-15);
    }
}
