//! The triangulated map over (speed, force), in flat arrays for searches in real time.
//!
//! Triangles come from the Delaunay triangulation of the z-scored vertices, or from a file. The constructor proves that
//! they tile the rectangle from (0, 0) to the maximum exactly.

use crate::bounds::{MAX_FORCE_N, MAX_SPEED_M_S, shown};
use spade::{DelaunayTriangulation, Point2, Triangulation as _};
use std::collections::HashMap;

/// A triangle by its three vertex numbers, from 0, in the order the file has them.
pub type Triangle = [u32; 3];

/// Triangles that tile `[0, max_speed] × [0, max_force]`, with precomputed data for the search.
#[derive(Debug, Clone, PartialEq)]
pub struct Triangulation {
    triangles: Vec<Triangle>,
    cells: Vec<Cell>,
    max_speed_m_s: f64,
    max_force_n: f64,
}

/// A point of the map in barycentric coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Location {
    /// The number of the triangle, from 0.
    pub triangle: u32,
    /// Weights of its three vertices, in the order of [`Triangulation::triangles`]; none negative, their sum 1.
    pub weights: [f64; 3],
}

const NONE: u32 = u32::MAX;

/// Precomputed sides of a triangle: side `i` lies opposite vertex `i`. A point is to the inner side of side `i` where
/// `(speed - origin_speed) * normal_speed + (force - origin_force) * normal_force` is positive, and that times
/// `inverse_height` is the weight of vertex `i`. Both triangles at a side compute it from the same origin with
/// opposite normals, so that rounding cannot put a point on both sides or on neither.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cell {
    origin_speed: [f64; 3],
    origin_force: [f64; 3],
    normal_speed: [f64; 3],
    normal_force: [f64; 3],
    inverse_height: [f64; 3],
    neighbour: [u32; 3],
}

impl Triangulation {
    /// The triangulation of `points` (speed m/s, force N) by `triangles`, proved to tile the rectangle from (0, 0) to
    /// the largest speed and force.
    pub fn new(points: &[(f64, f64)], triangles: Vec<Triangle>) -> Result<Self, TriangulationError> {
        let (max_speed_m_s, max_force_n) = check_points(points)?;
        let mut cells = triangles
            .iter()
            .enumerate()
            .map(|(number, triangle)| cell(points, number, *triangle, max_speed_m_s * max_force_n))
            .collect::<Result<Vec<_>, _>>()?;
        connect(points, &triangles, &mut cells, (max_speed_m_s, max_force_n))?;
        check_cover(points, &triangles, max_speed_m_s * max_force_n)?;
        Ok(Triangulation { triangles, cells, max_speed_m_s, max_force_n })
    }

    /// The triangles' vertex numbers, as given.
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Largest modelled speed, m/s.
    pub fn max_speed_m_s(&self) -> f64 {
        self.max_speed_m_s
    }

    /// Largest modelled force, N.
    pub fn max_force_n(&self) -> f64 {
        self.max_force_n
    }

    /// Clamps speed and force to the modelled range; NaN becomes 0, of the speed both: what is not known to rest is in the air.
    pub fn saturate(&self, speed_m_s: f64, force_n: f64) -> (f64, f64) {
        let force_n = if speed_m_s.is_nan() { 0.0 } else { force_n };
        // `max` and `min` return the other operand for NaN.
        (speed_m_s.max(0.0).min(self.max_speed_m_s), force_n.max(0.0).min(self.max_force_n))
    }

    /// Finds the triangle around a saturated point by a visibility walk (thesis 2.4.1) from triangle `start`, and its
    /// barycentric weights (Eq. 2.4.1).
    ///
    /// The result does not depend on `start`: on a shared side or vertex the triangle with the lowest number is found. The
    /// walk visits at most as many triangles as exist; then, and at a vertex, every triangle is tried.
    pub fn locate_from(&self, start: u32, speed_m_s: f64, force_n: f64) -> Location {
        let mut at = if (start as usize) < self.cells.len() { start } else { 0 };
        for _ in 0..self.cells.len() {
            let cell = &self.cells[at as usize];
            let sides = cell.sides(speed_m_s, force_n);
            match cell.next_step(&sides) {
                WalkStep::Into(neighbour) => at = neighbour,
                WalkStep::Inside => {
                    return Location { triangle: at, weights: cell.weights(&sides) };
                }
                WalkStep::OnSide(neighbour) => {
                    let other = &self.cells[neighbour as usize];
                    let others = other.sides(speed_m_s, force_n);
                    // At a vertex there may be more triangles.
                    if !(cell.is_within_a_side(&sides) && other.is_within_a_side(&others)) {
                        break;
                    }
                    let (triangle, cell, sides) = match at < neighbour {
                        true => (at, cell, sides),
                        false => (neighbour, other, others),
                    };
                    let weights = cell.weights(&sides);
                    return Location { triangle, weights };
                }
            }
        }
        self.locate_by_trying_all(speed_m_s, force_n)
    }

    /// The triangle with the lowest number that contains the point; the nearest one if rounding leaves none.
    fn locate_by_trying_all(&self, speed_m_s: f64, force_n: f64) -> Location {
        let mut best = (f64::NEG_INFINITY, 0, [1.0, 0.0, 0.0]);
        for (cell, number) in self.cells.iter().zip(0..) {
            let sides = cell.sides(speed_m_s, force_n);
            let inside = (0..3).all(|i| sides[i] >= 0.0 || cell.neighbour[i] == NONE);
            let least = if inside {
                0.0
            } else {
                (0..3).map(|i| sides[i] * cell.inverse_height[i]).fold(f64::INFINITY, f64::min)
            };
            if least > best.0 || (inside && best.0 < 0.0) {
                best = (least, number, cell.weights(&sides));
                if inside {
                    break;
                }
            }
        }
        Location { triangle: best.1, weights: best.2 }
    }
}

enum WalkStep {
    Inside,
    /// On the side of this neighbour.
    OnSide(u32),
    Into(u32),
}

impl Cell {
    #[inline]
    fn sides(&self, speed: f64, force: f64) -> [f64; 3] {
        std::array::from_fn(|i| {
            (speed - self.origin_speed[i]) * self.normal_speed[i]
                + (force - self.origin_force[i]) * self.normal_force[i]
        })
    }

    #[inline]
    fn next_step(&self, sides: &[f64; 3]) -> WalkStep {
        if sides[0] > 0.0 && sides[1] > 0.0 && sides[2] > 0.0 {
            return WalkStep::Inside;
        }
        // Beyond the border there is no triangle: a point that seems outside is on the border.
        let inner = |i: &usize| self.neighbour[*i] != NONE;
        if let Some(side) = (0..3).filter(inner).find(|&i| sides[i] < 0.0) {
            return WalkStep::Into(self.neighbour[side]);
        }
        match (0..3).filter(inner).find(|&i| sides[i] == 0.0) {
            Some(side) => WalkStep::OnSide(self.neighbour[side]),
            None => WalkStep::Inside,
        }
    }

    /// True if the point is on one side, and at none of its ends.
    fn is_within_a_side(&self, sides: &[f64; 3]) -> bool {
        sides.iter().filter(|side| **side > 0.0).count() == 2
    }

    /// Exactly 1 and 0 at a vertex, exactly 0 for the vertex opposite a side of the map that the point is on.
    #[inline]
    fn weights(&self, sides: &[f64; 3]) -> [f64; 3] {
        let raw: [f64; 3] = std::array::from_fn(|i| (sides[i] * self.inverse_height[i]).max(0.0));
        let sum = raw[0] + raw[1] + raw[2];
        raw.map(|weight| weight / sum)
    }
}

fn check_points(points: &[(f64, f64)]) -> Result<(f64, f64), TriangulationError> {
    let (mut max_speed, mut max_force) = (0.0_f64, 0.0_f64);
    let mut seen = HashMap::new();
    for (vertex, &(speed, force)) in points.iter().enumerate() {
        if !((0.0..=MAX_SPEED_M_S).contains(&speed) && (0.0..=MAX_FORCE_N).contains(&force)) {
            return Err(TriangulationError::Position { vertex, speed_m_s: speed, force_n: force });
        }
        // Adding zero makes one zero of both.
        if let Some(first) = seen.insert(((speed + 0.0).to_bits(), (force + 0.0).to_bits()), vertex) {
            return Err(TriangulationError::SamePlace { first, second: vertex });
        }
        max_speed = max_speed.max(speed);
        max_force = max_force.max(force);
    }
    let area = max_speed * max_force;
    if area > 1e-100 { Ok((max_speed, max_force)) } else { Err(TriangulationError::Flat) }
}

/// Twice the signed area of the triangle a, b, c.
fn doubled_area(a: (f64, f64), b: (f64, f64), c: (f64, f64)) -> f64 {
    (b.0 - a.0) * (c.1 - a.1) - (c.0 - a.0) * (b.1 - a.1)
}

/// Triangles thinner than this fraction of the map are refused: their weights would lose all precision.
const THINNEST: f64 = 1e-12;

fn cell(
    points: &[(f64, f64)],
    number: usize,
    triangle: Triangle,
    map_area: f64,
) -> Result<Cell, TriangulationError> {
    let mut corners = [(0.0, 0.0); 3];
    for (corner, vertex) in corners.iter_mut().zip(triangle) {
        *corner = *points.get(vertex as usize).ok_or(TriangulationError::NoSuchVertex {
            triangle: number,
            vertex,
            vertices: points.len(),
        })?;
    }
    if doubled_area(corners[0], corners[1], corners[2]).abs() <= THINNEST * map_area {
        return Err(TriangulationError::Degenerate { triangle: number });
    }
    let mut cell = Cell {
        origin_speed: [0.0; 3],
        origin_force: [0.0; 3],
        normal_speed: [0.0; 3],
        normal_force: [0.0; 3],
        inverse_height: [0.0; 3],
        neighbour: [NONE; 3],
    };
    for i in 0..3 {
        let (mut from, mut to) = ((i + 1) % 3, (i + 2) % 3);
        if triangle[from] > triangle[to] {
            std::mem::swap(&mut from, &mut to);
        }
        let (from, to) = (corners[from], corners[to]);
        let normal = (-(to.1 - from.1), to.0 - from.0);
        let height = (corners[i].0 - from.0) * normal.0 + (corners[i].1 - from.1) * normal.1;
        let sign = height.signum();
        cell.origin_speed[i] = from.0;
        cell.origin_force[i] = from.1;
        cell.normal_speed[i] = sign * normal.0;
        cell.normal_force[i] = sign * normal.1;
        cell.inverse_height[i] = 1.0 / height.abs();
    }
    Ok(cell)
}

/// Finds the neighbour at each side, and proves that a side has one triangle on each side or lies on the border.
fn connect(
    points: &[(f64, f64)],
    triangles: &[Triangle],
    cells: &mut [Cell],
    (max_speed, max_force): (f64, f64),
) -> Result<(), TriangulationError> {
    let mut open: HashMap<(u32, u32), (usize, usize)> = HashMap::new();
    let mut closed: HashMap<(u32, u32), usize> = HashMap::new();
    for (number, triangle) in triangles.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (triangle[(i + 1) % 3], triangle[(i + 2) % 3]);
            let side = (a.min(b), a.max(b));
            if let Some(&first) = closed.get(&side) {
                return Err(TriangulationError::Overlap { first, second: number });
            }
            let Some((other, j)) = open.remove(&side) else {
                open.insert(side, (number, i));
                continue;
            };
            let opposite = cells[other].normal_speed[j] == -cells[number].normal_speed[i]
                && cells[other].normal_force[j] == -cells[number].normal_force[i];
            if !opposite {
                return Err(TriangulationError::Overlap { first: other, second: number });
            }
            cells[other].neighbour[j] = number as u32;
            cells[number].neighbour[i] = other as u32;
            closed.insert(side, number);
        }
    }
    let mut loose: Vec<_> = open.into_iter().collect();
    loose.sort_unstable();
    for ((a, b), (triangle, _)) in loose {
        let ((speed_a, force_a), (speed_b, force_b)) = (points[a as usize], points[b as usize]);
        let on_border = (speed_a == speed_b && (speed_a == 0.0 || speed_a == max_speed))
            || (force_a == force_b && (force_a == 0.0 || force_a == max_force));
        if !on_border {
            return Err(TriangulationError::Gap { triangle, vertices: (a, b) });
        }
    }
    Ok(())
}

/// With every inner side between two triangles and every outer side on the border, the map is covered a whole number of
/// times: once if the areas agree.
fn check_cover(
    points: &[(f64, f64)],
    triangles: &[Triangle],
    map_area: f64,
) -> Result<(), TriangulationError> {
    let mut covered = 0.0;
    let mut used = vec![false; points.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| points[vertex as usize]);
        covered += 0.5 * doubled_area(a, b, c).abs() / map_area;
        triangle.iter().for_each(|&vertex| used[vertex as usize] = true);
    }
    if (covered - 1.0).abs() > 1e-9 {
        return Err(TriangulationError::Cover { covered });
    }
    match used.iter().position(|used| !used) {
        Some(vertex) => Err(TriangulationError::Unused { vertex }),
        None => Ok(()),
    }
}

/// Delaunay triangulation of the z-scored points (speed m/s, force N). Z-scores are the usual metric, since
/// speed and force have different units (thesis 2.3.4).
pub(crate) fn delaunay(points: &[(f64, f64)]) -> Result<Vec<Triangle>, TriangulationError> {
    check_points(points)?;
    let speeds = z_scores(points.iter().map(|point| point.0));
    let forces = z_scores(points.iter().map(|point| point.1));
    let mut mesh: DelaunayTriangulation<Point2<f64>> = DelaunayTriangulation::new();
    for (vertex, (&x, &y)) in speeds.iter().zip(&forces).enumerate() {
        // Values too small for spade's exact predicates count as zero among z-scores.
        let exact = |value: f64| if value.abs() < 1e-40 { 0.0 } else { value };
        let (speed_m_s, force_n) = points[vertex];
        let handle = mesh
            .insert(Point2::new(exact(x), exact(y)))
            .map_err(|_| TriangulationError::Position { vertex, speed_m_s, force_n })?;
        if handle.index() != vertex {
            return Err(TriangulationError::SamePlace { first: handle.index(), second: vertex });
        }
    }
    Ok(mesh.inner_faces().map(|face| face.vertices().map(|vertex| vertex.index() as u32)).collect())
}

fn z_scores(values: impl Iterator<Item = f64> + Clone) -> Vec<f64> {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    let variance = values.clone().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count;
    let deviation = if variance > 0.0 { variance.sqrt() } else { 1.0 };
    values.map(|value| (value - mean) / deviation).collect()
}

/// An error in the triangles of a map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TriangulationError {
    /// A vertex whose speed or force is out of its bounds.
    #[error(
        "vertex {vertex} (from 0) lies at {} m/s, {} N; the speed must be from 0 to {MAX_SPEED_M_S} m/s, the force from 0 to {MAX_FORCE_N} N", shown(*speed_m_s), shown(*force_n)
    )]
    Position {
        /// The number, from 0.
        vertex: usize,
        /// The speed.
        speed_m_s: f64,
        /// The force.
        force_n: f64,
    },
    /// Two vertices at the same speed and force.
    #[error("vertices {first} and {second} (from 0) lie at the same speed and force")]
    SamePlace {
        /// The one, from 0.
        first: usize,
        /// The other, from 0.
        second: usize,
    },
    /// All speeds or all forces are zero.
    #[error("the largest speed or the largest force is zero, so there is no map to triangulate")]
    Flat,
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {triangle} (from 0) names vertex {vertex}, but there are only {vertices} vertices, numbered from 0"
    )]
    NoSuchVertex {
        /// The triangle's number, from 0.
        triangle: usize,
        /// The vertex named, from 0.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A triangle without area.
    #[error("triangle {triangle} (from 0) has no area")]
    Degenerate {
        /// The triangle's number, from 0.
        triangle: usize,
    },
    /// Two triangles overlap.
    #[error("triangles {first} and {second} (from 0) overlap")]
    Overlap {
        /// The one, from 0.
        first: usize,
        /// The other, from 0.
        second: usize,
    },
    /// A side with a triangle on one side only, inside the map.
    #[error(
        "the triangles leave a gap beside triangle {triangle}: no triangle joins its side between vertices {} and {} (all from 0), which is inside the map; add one",
        vertices.0, vertices.1
    )]
    Gap {
        /// The triangle's number, from 0.
        triangle: usize,
        /// The side's ends, from 0.
        vertices: (u32, u32),
    },
    /// The triangles cover too little or too much.
    #[error(
        "the triangles cover {covered} times the range from zero to the maximum speed and force; they must cover it exactly once"
    )]
    Cover {
        /// The covered fraction; 1 is correct.
        covered: f64,
    },
    /// A vertex of no triangle.
    #[error("vertex {vertex} (from 0) belongs to no triangle")]
    Unused {
        /// The number, from 0.
        vertex: usize,
    },
}

#[cfg(test)]
mod tests;
