//! Sheets laid over surfaces: a stroke's flat coordinates become points and outward normals in space.

use crate::contact::mesh::TriangleMesh;
use crate::vector::{Vec3, add_scaled, direction, dot, scale, sub, tangents};
use std::sync::Arc;

/// The surface that a hand aims at.
#[derive(Debug, Clone)]
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
    /// A convex solid from outside. The sheet touches its top (along z) and is projected from its centre, so that strokes
    /// wider than the top lead over the edges and down the sides.
    Solid {
        /// The solid.
        solid: Arc<TriangleMesh>,
        /// Height of the sheet above the centre, m.
        top_m: f64,
    },
    /// A relief from above (along z): the sheet is dropped onto it from over its middle.
    Relief(Arc<TriangleMesh>),
}

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundPoint {
    /// Position, m.
    pub position_m: Vec3,
    /// Outward unit normal.
    pub normal: Vec3,
    /// Displacement per height over the surface: along the normal, but without a jump at edges.
    pub lift: Vec3,
}

impl Ground {
    /// The horizontal plane through the origin, outside above.
    pub const TABLE: Self = Self::Plane { origin_m: [0.0; 3], normal: [0.0, 0.0, 1.0] };

    /// A convex solid; the sheet touches it over its centre.
    pub(crate) fn solid(solid: Arc<TriangleMesh>) -> Self {
        let top_m =
            cast(&solid, [0.0, 0.0, 1.0]).map_or(solid.diagonal_m(), |(top, _)| top[2] - solid.centre_m()[2]);
        Self::Solid { solid, top_m }
    }

    /// The surface point of a stroke's coordinates.
    pub fn at(&self, [u, v]: [f64; 2]) -> GroundPoint {
        match self {
            &Self::Plane { origin_m, normal } => {
                let normal = direction(normal).unwrap_or([0.0, 0.0, 1.0]);
                let [e_u, e_v] = tangents(normal);
                flat(add_scaled(add_scaled(origin_m, e_u, u), e_v, v), normal)
            }
            &Self::Sphere { centre_m, radius_m, up } => {
                let up = direction(up).unwrap_or([0.0, 0.0, 1.0]);
                let [e_u, e_v] = tangents(up);
                let sheet_m = add_scaled(add_scaled(add_scaled(centre_m, up, radius_m), e_u, u), e_v, v);
                let normal = direction(sub(sheet_m, centre_m)).unwrap_or(up);
                flat(add_scaled(centre_m, normal, radius_m), normal)
            }
            Self::Solid { solid, top_m } => projected(solid, [u, v, *top_m]),
            Self::Relief(relief) => dropped(relief, [u, v]),
        }
    }
}

/// A point whose height moves along its normal.
fn flat(position_m: Vec3, normal: Vec3) -> GroundPoint {
    GroundPoint { position_m, normal, lift: normal }
}

/// Exit point and face of a ray from a solid's centre.
fn cast(solid: &TriangleMesh, along: Vec3) -> Option<(Vec3, u32)> {
    let (centre_m, reach_m) = (solid.centre_m(), solid.diagonal_m());
    let hit = solid.first_hit(centre_m, add_scaled(centre_m, along, reach_m))?;
    Some((add_scaled(centre_m, along, hit.fraction * reach_m), hit.triangle))
}

/// A point of a sheet on top of a solid, seen from the solid's centre, projected to there.
fn projected(solid: &TriangleMesh, sheet_m: Vec3) -> GroundPoint {
    let up = [0.0, 0.0, 1.0];
    let along = direction(sheet_m).unwrap_or(up);
    match cast(solid, along) {
        Some((position_m, face)) => {
            let normal = solid.normal(face);
            GroundPoint { position_m, normal, lift: scale(along, 1.0 / dot(along, normal).max(0.1)) }
        }
        None => flat(solid.centre_m(), up),
    }
}

/// The highest point of a relief under a point of a sheet; beside the relief, a plane at the height of its middle.
fn dropped(relief: &TriangleMesh, [u, v]: [f64; 2]) -> GroundPoint {
    let (middle_m, reach_m) = (relief.centre_m(), relief.diagonal_m());
    let up = [0.0, 0.0, 1.0];
    let under_m = [middle_m[0] + u, middle_m[1] + v, middle_m[2]];
    let top_m = add_scaled(under_m, up, reach_m);
    match relief.first_hit(top_m, add_scaled(under_m, up, -reach_m)) {
        Some(hit) => {
            let normal = relief.normal(hit.triangle);
            let normal = if normal[2] < 0.0 { scale(normal, -1.0) } else { normal };
            GroundPoint { position_m: add_scaled(top_m, up, -2.0 * reach_m * hit.fraction), normal, lift: up }
        }
        None => flat(under_m, up),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::distance;

    #[test]
    fn a_plane_keeps_lengths_and_a_sphere_keeps_its_radius() {
        let slope = Ground::Plane { origin_m: [0.1, 0.0, 0.0], normal: [0.0, 3.0, 4.0] };
        let way_m = distance(slope.at([0.03, 0.0]).position_m, slope.at([0.0, 0.04]).position_m);
        assert!((way_m - 0.05).abs() < 1e-15);
        let ball = Ground::Sphere { centre_m: [0.0, 0.0, -0.05], radius_m: 0.05, up: [0.0, 0.0, 1.0] };
        assert!(distance(ball.at([0.0, 0.0]).position_m, [0.0; 3]) < 1e-15);
        let far = ball.at([0.2, -0.1]);
        assert!((distance(far.position_m, [0.0, 0.0, -0.05]) - 0.05).abs() < 1e-15);
    }

    #[test]
    fn a_relief_is_stroked_from_above() {
        let slope = TriangleMesh::new(
            &[[-0.1, -0.1, 0.0], [0.1, -0.1, 0.02], [0.1, 0.1, 0.02], [-0.1, 0.1, 0.0]],
            &[[0, 1, 2], [0, 2, 3]],
        );
        let ground = Ground::Relief(Arc::new(slope.unwrap()));
        let at = ground.at([0.05, 0.03]);
        assert!(distance(at.position_m, [0.05, 0.03, 0.015]) < 1e-12, "{at:?}");
        assert!(at.normal[0] < 0.0 && at.normal[2] > 0.9);
        assert_eq!(ground.at([0.5, 0.0]).normal, [0.0, 0.0, 1.0], "beside it");
    }

    #[test]
    fn on_a_cube_a_wide_stroke_leads_over_the_edge() {
        let cube = Arc::new(TriangleMesh::cuboid([0.02; 3]).unwrap());
        let ground = Ground::solid(cube);
        assert!(distance(ground.at([0.003, -0.004]).position_m, [0.003, -0.004, 0.01]) < 1e-12);
        let side = ground.at([0.02, 0.0]);
        assert!(distance(side.position_m, [0.01, 0.0, 0.005]) < 1e-12);
        assert_eq!(side.normal, [1.0, 0.0, 0.0]);
        let rim = [0.0099999, 0.0100001].map(|u| ground.at([u, 0.001]));
        assert!(rim[0].normal != rim[1].normal && distance(rim[0].lift, rim[1].lift) < 1e-4, "{rim:?}");
    }
}
