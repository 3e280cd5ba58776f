//! Triangle meshes: validated, welded, indexed for queries that allocate nothing.

mod index;
mod line;
mod load;
mod solids;

pub use line::LineMeeting;
pub use load::MeshFormat;

use crate::vector::{Vec3, add, cross, direction, distance, dot, norm, scale, sub};
use index::Index;
use std::collections::HashMap;

/// Valid diagonals of meshes, m: beyond them products of areas overflow or underflow.
const SIZES_M: std::ops::RangeInclusive<f64> = 1e-6..=1e6;
/// Largest distance of a mesh from the origin, in diagonals: corners differ by at least 1e-7 of one.
const FARTHEST: f64 = 1e6;

/// No triangle on the other side of an edge.
pub(crate) const NONE: u32 = u32::MAX;

/// A triangle mesh, in metres. Closed meshes are oriented so that their normals point outwards.
#[derive(Debug, Clone)]
pub struct TriangleMesh {
    vertices: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    normals: Vec<Vec3>,
    /// Neighbours of each triangle across its edges 0-1, 1-2 and 2-0, or [`NONE`].
    neighbours: Vec<[u32; 3]>,
    diagonal_m: f64,
    centre_m: Vec3,
    index: Index,
}

/// Error of a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The mesh has no area.
    #[error("the mesh has no triangle with an area; export it as triangles")]
    Empty,
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} of the mesh (counted from 0) is not finite")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A corner does not exist.
    #[error("triangle {triangle} of the mesh (counted from 0) has a corner that does not exist")]
    BadIndex {
        /// Index of the triangle.
        triangle: usize,
    },
    /// The unit is not a positive number.
    #[error("the mesh's unit is {unit_m} m: give a finite number above zero (0.001 for files in mm)")]
    BadUnit {
        /// Metres per unit of the file.
        unit_m: f64,
    },
    /// The size is out of range.
    #[error(
        "the mesh is {diagonal_m:.3e} m across and reaches to {far_m:.3e} m from the origin: its size lies from 1e-6 to 1e6 m, and it lies within a million times that of the origin; check its unit and its corners"
    )]
    OutOfScale {
        /// Diagonal of its bounding box, m.
        diagonal_m: f64,
        /// The largest coordinate, m.
        far_m: f64,
    },
    /// The file ends early.
    #[error("the {format} file is incomplete: it ends before its last triangle; export it again")]
    Incomplete {
        /// STL or OBJ.
        format: MeshFormat,
    },
    /// The file cannot be read.
    #[error("the {format} file cannot be read: {problem}")]
    Unreadable {
        /// STL or OBJ.
        format: MeshFormat,
        /// Error of the reader.
        problem: String,
    },
    /// There are too many triangles or vertices.
    #[error("the mesh has more than 4 000 000 000 triangles or vertices")]
    TooLarge,
}

/// The edge at which a mesh is not a convex solid.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the mesh is not a convex solid: at the edge from ({}) to ({}) mm {fault}", mm(.from_m), mm(.to_m))]
pub struct NotConvex {
    /// One end of the offending edge, m.
    pub from_m: Vec3,
    /// The other end, m.
    pub to_m: Vec3,
    /// The fault at the edge.
    pub fault: EdgeFault,
}

/// The fault of an edge.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum EdgeFault {
    /// The edge has one triangle, more than two, or two of opposite orientation.
    #[error("the surface is not closed")]
    Open,
    /// The faces bend towards the outside.
    #[error("the faces bend inwards by {degrees:.2} degrees")]
    Concave {
        /// The angle.
        degrees: f64,
    },
    /// The mesh is convex along all edges, but not one body without holes.
    #[error("a second body or a tunnel begins")]
    Apart,
}

fn mm(point: &Vec3) -> String {
    format!("{:.3}, {:.3}, {:.3}", point[0] * 1e3, point[1] * 1e3, point[2] * 1e3)
}

/// The first intersection of a segment with a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Fraction of the segment.
    pub fraction: f64,
    /// The triangle.
    pub triangle: u32,
}

impl TriangleMesh {
    /// A mesh from corners in m and triples of indices. Corners closer than 1e-7 of the mesh's size are welded and
    /// triangles without an area removed.
    pub fn new(corners: &[Vec3], triangles: &[[u32; 3]]) -> Result<Self, MeshError> {
        if let Some(vertex) = corners.iter().position(|c| !c.iter().all(|x| x.is_finite())) {
            return Err(MeshError::NotFinite { vertex });
        }
        if let Some(triangle) = triangles.iter().position(|t| t.iter().any(|&i| i as usize >= corners.len()))
        {
            return Err(MeshError::BadIndex { triangle });
        }
        if corners.len().max(triangles.len()) >= NONE as usize {
            return Err(MeshError::TooLarge);
        }
        let diagonal_m = diagonal(corners);
        let is_in_scale = SIZES_M.contains(&diagonal_m) && far_m(corners) <= FARTHEST * diagonal_m;
        // A mesh of the size of a point has no triangles, which is an error below.
        if diagonal_m > 0.0 && !is_in_scale {
            let far_m = far_m(corners);
            return Err(MeshError::OutOfScale { diagonal_m, far_m });
        }
        let (vertices, renamed) = weld(corners, 1e-7 * diagonal_m);
        let named: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|i| renamed[i as usize])).collect();
        let least_area = 1e-14 * diagonal_m * diagonal_m;
        let mut triangles: Vec<[u32; 3]> =
            named.iter().copied().filter(|t| norm(doubled_area(&vertices, *t)) > least_area).collect();
        if triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        let mut neighbours = neighbours(&triangles);
        let closed = neighbours.iter().flatten().all(|&n| n != NONE);
        if closed && volume(&vertices, &triangles) < 0.0 {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
            neighbours.iter_mut().for_each(|n| n.swap(0, 2));
        }
        let normals = triangles
            .iter()
            .map(|t| direction(doubled_area(&vertices, *t)).unwrap_or([0.0, 0.0, 1.0]))
            .collect();
        let (low, high) = bounds(&vertices);
        let index = Index::build(&vertices, &triangles, 1e-9 * diagonal_m);
        Ok(Self {
            vertices,
            triangles,
            normals,
            neighbours,
            diagonal_m,
            centre_m: std::array::from_fn(|i| 0.5 * (low[i] + high[i])),
            index,
        })
    }

    /// Corners, m.
    pub fn vertices(&self) -> &[Vec3] {
        &self.vertices
    }

    /// Corners of each triangle, counter-clockwise from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Diagonal of the bounding box, m.
    pub(crate) fn diagonal_m(&self) -> f64 {
        self.diagonal_m
    }

    /// Outward unit normal of a triangle.
    pub(crate) fn normal(&self, triangle: u32) -> Vec3 {
        self.normals[triangle as usize]
    }

    /// Corners of a triangle, m.
    pub(crate) fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].map(|i| self.vertices[i as usize])
    }

    /// The triangles across the edges 0-1, 1-2 and 2-0 of a triangle, or [`NONE`].
    pub(crate) fn neighbours(&self, triangle: u32) -> [u32; 3] {
        self.neighbours[triangle as usize]
    }

    /// Centre of the bounding box, m.
    pub(crate) fn centre_m(&self) -> Vec3 {
        self.centre_m
    }

    /// The first intersection of a segment with the mesh, from either side. It is exact: no segment passes between
    /// two triangles that share an edge or a corner. Allocates nothing.
    pub fn first_hit(&self, from_m: Vec3, to_m: Vec3) -> Option<Hit> {
        let mut first: Option<Hit> = None;
        self.index.hits(&self.vertices, &self.triangles, from_m, to_m, |hit| {
            if first.is_none_or(|f| hit.fraction < f.fraction) {
                first = Some(hit);
            }
        });
        first
    }

    /// The point of the surface that is closest to a point, and its triangle. Allocates nothing.
    pub fn closest(&self, point_m: Vec3) -> (Vec3, u32) {
        self.index.closest(&self.vertices, &self.triangles, point_m)
    }

    /// The same mesh, moved.
    pub(crate) fn moved(&self, by_m: Vec3) -> Result<Self, MeshError> {
        let corners: Vec<Vec3> = self.vertices.iter().map(|v| add(*v, by_m)).collect();
        Self::new(&corners, &self.triangles)
    }

    /// Checks that the mesh is one closed convex solid; the error names an edge that violates it.
    pub fn check_convex(&self) -> Result<(), NotConvex> {
        for (t, around) in self.neighbours.iter().enumerate() {
            for (edge, &other) in around.iter().enumerate() {
                if other == NONE {
                    return Err(self.not_convex(t, edge, EdgeFault::Open));
                }
                let corner = self.opposite(other, t as u32);
                let rise_m = dot(self.normals[t], sub(corner, self.corners(t as u32)[0]));
                if rise_m > 1e-6 * self.diagonal_m {
                    let cos = dot(self.normals[t], self.normal(other)).clamp(-1.0, 1.0);
                    return Err(self.not_convex(
                        t,
                        edge,
                        EdgeFault::Concave { degrees: cos.acos().to_degrees() },
                    ));
                }
            }
        }
        // Locally convex and closed is convex if it is also one sphere: connected, with Euler's characteristic of 2.
        let reached = self.reached_from_first();
        let euler = self.vertices_used() as i64 - (self.triangles.len() as i64) / 2;
        match reached.iter().position(|r| !r) {
            Some(t) => Err(self.not_convex(t, 0, EdgeFault::Apart)),
            None if euler != 2 => Err(self.not_convex(0, 0, EdgeFault::Apart)),
            None => Ok(()),
        }
    }

    fn not_convex(&self, triangle: usize, edge: usize, fault: EdgeFault) -> NotConvex {
        let corners = self.corners(triangle as u32);
        NotConvex { from_m: corners[edge], to_m: corners[(edge + 1) % 3], fault }
    }

    /// The corner of `triangle` that its neighbour does not share.
    fn opposite(&self, triangle: u32, neighbour: u32) -> Vec3 {
        let shared = self.triangles[neighbour as usize];
        let own = self.triangles[triangle as usize];
        let corner = own.into_iter().find(|i| !shared.contains(i)).unwrap_or(own[0]);
        self.vertices[corner as usize]
    }

    fn reached_from_first(&self) -> Vec<bool> {
        let mut reached = vec![false; self.triangles.len()];
        let mut open = vec![0_u32];
        while let Some(t) = open.pop() {
            if !std::mem::replace(&mut reached[t as usize], true) {
                open.extend(self.neighbours[t as usize].iter().filter(|&&n| n != NONE));
            }
        }
        reached
    }

    fn vertices_used(&self) -> usize {
        let mut used = vec![false; self.vertices.len()];
        self.triangles.iter().flatten().for_each(|&i| used[i as usize] = true);
        used.iter().filter(|u| **u).count()
    }
}

/// Normal times twice the area.
fn doubled_area(vertices: &[Vec3], triangle: [u32; 3]) -> Vec3 {
    let [a, b, c] = triangle.map(|i| vertices[i as usize]);
    cross(sub(b, a), sub(c, a))
}

fn bounds(points: &[Vec3]) -> (Vec3, Vec3) {
    let start = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    points.iter().fold(start, |(low, high), p| {
        (std::array::from_fn(|i| low[i].min(p[i])), std::array::from_fn(|i| high[i].max(p[i])))
    })
}

fn diagonal(points: &[Vec3]) -> f64 {
    let (low, high) = bounds(points);
    if points.is_empty() { 0.0 } else { distance(low, high) }
}

/// The largest coordinate.
fn far_m(points: &[Vec3]) -> f64 {
    points.iter().flatten().fold(0.0, |far, x| far.max(x.abs()))
}

/// Welds corners within `tolerance_m` of each other to the first of them.
fn weld(corners: &[Vec3], tolerance_m: f64) -> (Vec<Vec3>, Vec<u32>) {
    // Relative to the lowest corner, cell indices are small wherever the mesh lies.
    let (low, _) = bounds(corners);
    let cell_m = if tolerance_m > 0.0 { 2.0 * tolerance_m } else { 1.0 };
    let mut cells: HashMap<[i64; 3], u32> = HashMap::with_capacity(corners.len());
    let mut vertices: Vec<Vec3> = Vec::new();
    let mut renamed = Vec::with_capacity(corners.len());
    for corner in corners {
        let home = std::array::from_fn(|i| ((corner[i] - low[i]) / cell_m) as i64);
        let near = (0..27).map(|k| [home[0] + k % 3 - 1, home[1] + k / 3 % 3 - 1, home[2] + k / 9 - 1]);
        let known = near
            .filter_map(|cell| cells.get(&cell).copied())
            .find(|&v| distance(vertices[v as usize], *corner) <= tolerance_m);
        renamed.push(known.unwrap_or_else(|| {
            let name = vertices.len() as u32;
            vertices.push(*corner);
            cells.insert(home, name);
            name
        }));
    }
    (vertices, renamed)
}

/// Triangles across each edge; none if an edge does not belong to exactly two triangles of the same orientation.
fn neighbours(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut owners: HashMap<(u32, u32), u32> = HashMap::with_capacity(3 * triangles.len());
    for (t, corners) in triangles.iter().enumerate() {
        for edge in 0..3 {
            let key = (corners[edge], corners[(edge + 1) % 3]);
            owners.entry(key).and_modify(|owner| *owner = NONE).or_insert(t as u32);
        }
    }
    let across = |corners: &[u32; 3], edge: usize| {
        let (a, b) = (corners[edge], corners[(edge + 1) % 3]);
        let contested = owners.get(&(a, b)) == Some(&NONE);
        if contested { NONE } else { owners.get(&(b, a)).copied().unwrap_or(NONE) }
    };
    triangles.iter().map(|corners| [0, 1, 2].map(|edge| across(corners, edge))).collect()
}

/// Six times the enclosed volume, positive when normals point outwards.
fn volume(vertices: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    let origin = vertices[0];
    triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| sub(vertices[i as usize], origin));
            dot(a, cross(b, c))
        })
        .sum()
}

/// The point of a triangle closest to a point.
pub(crate) fn closest_on_triangle(point: Vec3, [a, b, c]: [Vec3; 3]) -> Vec3 {
    let normal = cross(sub(b, a), sub(c, a));
    let inside = |from: Vec3, to: Vec3| dot(cross(sub(to, from), sub(point, from)), normal) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        let height = dot(sub(point, a), normal) / dot(normal, normal);
        return sub(point, scale(normal, height));
    }
    [(a, b), (b, c), (c, a)]
        .map(|(from, to)| {
            let way = sub(to, from);
            let along = (dot(sub(point, from), way) / dot(way, way)).clamp(0.0, 1.0);
            crate::vector::add_scaled(from, way, along)
        })
        .into_iter()
        .min_by(|x, y| distance(*x, point).total_cmp(&distance(*y, point)))
        .unwrap_or(a)
}

#[cfg(test)]
mod tests;
