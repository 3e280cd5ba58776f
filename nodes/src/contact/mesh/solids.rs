//! Solids made from numbers, centred at the origin.

use super::{MeshError, TriangleMesh};
use crate::vector::{Vec3, add, direction, scale};
use std::collections::HashMap;
use std::f64::consts::TAU;

impl TriangleMesh {
    /// A box with its edges along the axes.
    pub(crate) fn cuboid(size_m: Vec3) -> Result<Self, MeshError> {
        let corner = |i: u32| -> Vec3 {
            std::array::from_fn(
                |axis| {
                    if i >> axis & 1 == 1 { 0.5 * size_m[axis] } else { -0.5 * size_m[axis] }
                },
            )
        };
        let corners: Vec<Vec3> = (0..8).map(corner).collect();
        let sides: [[u32; 4]; 6] =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles: Vec<[u32; 3]> =
            sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        Self::new(&corners, &triangles)
    }

    /// A cylinder standing on the z axis, its mantle of flat strips.
    pub(crate) fn cylinder(radius_m: f64, height_m: f64, strips: u32) -> Result<Self, MeshError> {
        let strips = strips.max(3);
        let ring = |z: f64| {
            (0..strips).map(move |k| {
                let (sin, cos) = (TAU * f64::from(k) / f64::from(strips)).sin_cos();
                [radius_m * cos, radius_m * sin, z]
            })
        };
        let mut corners: Vec<Vec3> = ring(-0.5 * height_m).chain(ring(0.5 * height_m)).collect();
        corners.extend([[0.0, 0.0, -0.5 * height_m], [0.0, 0.0, 0.5 * height_m]]);
        let (bottom, top) = (2 * strips, 2 * strips + 1);
        let triangles: Vec<[u32; 3]> = (0..strips)
            .flat_map(|k| {
                let (a, b) = (k, (k + 1) % strips);
                [
                    [a, b, strips + b],
                    [a, strips + b, strips + a],
                    [bottom, b, a],
                    [top, strips + a, strips + b],
                ]
            })
            .collect();
        Self::new(&corners, &triangles)
    }

    /// A sphere as an icosahedron whose triangles are split in four, `splits` times (20 x 4^splits triangles, at most
    /// 8 splits).
    pub(crate) fn sphere(radius_m: f64, splits: u32) -> Result<Self, MeshError> {
        let (mut corners, mut triangles) = icosahedron();
        for _ in 0..splits.min(8) {
            let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
            let mut middle = |a: u32, b: u32, corners: &mut Vec<Vec3>| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let sum = add(corners[a as usize], corners[b as usize]);
                    corners.push(direction(sum).unwrap_or(sum));
                    corners.len() as u32 - 1
                })
            };
            let split = triangles.iter().flat_map(|&[a, b, c]| {
                let (ab, bc, ca) =
                    (middle(a, b, &mut corners), middle(b, c, &mut corners), middle(c, a, &mut corners));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            });
            triangles = split.collect();
        }
        let corners: Vec<Vec3> = corners.into_iter().map(|c| scale(c, radius_m)).collect();
        Self::new(&corners, &triangles)
    }
}

fn icosahedron() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let corners = (0..12).map(|k| {
        let (one, other) = (if k & 1 == 1 { 1.0 } else { -1.0 }, if k & 2 == 2 { golden } else { -golden });
        let point = match k / 4 {
            0 => [one, other, 0.0],
            1 => [0.0, one, other],
            _ => [other, 0.0, one],
        };
        direction(point).unwrap_or(point)
    });
    let corners: Vec<Vec3> = corners.collect();
    // Faces are the triples of corners that are all neighbours, turned outwards when the mesh is closed.
    let near = |i: usize, j: usize| crate::vector::distance(corners[i], corners[j]) < 1.1;
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if near(i, j) && near(j, k) && near(k, i) {
                    let turn = crate::vector::dot(corners[i], crate::vector::cross(corners[j], corners[k]));
                    let [i, j, k] = [i as u32, j as u32, k as u32];
                    triangles.push(if turn > 0.0 { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    (corners, triangles)
}
