//! Intersection of segments with triangles: a bounding volume hierarchy and exact predicates.
//!
//! The hierarchy is built by the crate `bvh` (surface area heuristic) and flattened with its own hook into nodes that
//! are walked front to back by index alone: no stack, no allocation, no depth limit, as a servo tick needs. Whether a segment
//! touches a triangle is decided by Shewchuk's exact orientation predicate (crate `robust`), so that neighbours agree
//! about the edge and the corner they share and nothing slips between them.

use super::Hit;
use crate::vector::{Vec3, add_scaled, direction, dot, norm, reject, sub};
use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use nalgebra::Point3;
use robust::{Coord3D, orient3d};

#[derive(Debug, Clone)]
pub(super) struct Index {
    nodes: Vec<Node>,
}

/// A box that contains all following nodes up to `exit`, or a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    centre: Vec3,
    /// Half the extent; a triangle's node has none of its own.
    half: Vec3,
    exit: u32,
    /// The triangle, or [`super::NONE`] for a box.
    triangle: u32,
}

struct Bounds {
    aabb: Aabb<f64, 3>,
    triangle: u32,
    node: usize,
}

/// A part of a triangle: the box of a long thin one, such as those of a fan, holds little of it, and many others.
struct Part {
    polygon: Vec<Vec3>,
    triangle: u32,
}

/// Length of a segment relative to the whole below which boxes are compared with its own box alone: what else that lets in is
/// sooner met by [`crossing`] than kept out.
const SHORT: f64 = 0.05;
/// Times that a triangle is halved at most.
const HALVINGS: usize = 5;
/// Number of parts from which on none is halved.
const MANY_PARTS: usize = 1 << 20;
/// Triangles are halved where that leaves at most this share of the surface of their box. Among those of good shape none
/// is below 0.7.
const WORTH_HALVING: f64 = 0.6;

impl Part {
    /// The two halves along the longest edge of the box, if their boxes are so much smaller.
    fn halves(&self) -> Option<[Self; 2]> {
        let (low, high) = super::bounds(&self.polygon);
        let size = sub(high, low);
        let axis = (0..3).max_by(|&i, &j| size[i].total_cmp(&size[j]))?;
        let middle = 0.5 * (low[axis] + high[axis]);
        let halves = [1.0, -1.0].map(|sign| self.beyond(axis, middle, sign));
        let surface = |part: &Self| {
            let (low, high) = super::bounds(&part.polygon);
            let [a, b, c] = sub(high, low);
            a * b + b * c + c * a
        };
        let left: f64 = halves.iter().map(surface).sum();
        (left <= WORTH_HALVING * surface(self)).then_some(halves)
    }

    /// The part above a plane across an axis, or below it for a negative sign.
    fn beyond(&self, axis: usize, middle: f64, sign: f64) -> Self {
        let height = |p: Vec3| sign * (p[axis] - middle);
        let ends = self.polygon.iter().zip(self.polygon.iter().cycle().skip(1));
        let mut polygon = Vec::with_capacity(self.polygon.len() + 1);
        for (&from, &to) in ends {
            let (rise, next) = (height(from), height(to));
            if rise >= 0.0 {
                polygon.push(from);
            }
            if rise * next < 0.0 {
                polygon.push(add_scaled(from, sub(to, from), rise / (rise - next)));
            }
        }
        Self { polygon, triangle: self.triangle }
    }

    fn of_triangles(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Self> {
        let whole = |(triangle, corners): (usize, &[u32; 3])| Self {
            polygon: corners.map(|i| vertices[i as usize]).to_vec(),
            triangle: triangle as u32,
        };
        let mut parts: Vec<Self> = triangles.iter().enumerate().map(whole).collect();
        for _ in 0..HALVINGS {
            if parts.len() >= MANY_PARTS {
                break;
            }
            let halved = parts.into_iter().flat_map(|part| match part.halves() {
                Some([lower, upper]) => [Some(lower), Some(upper)],
                None => [Some(part), None],
            });
            parts = halved.flatten().collect();
        }
        parts
    }
}

impl Bounded<f64, 3> for Bounds {
    fn aabb(&self) -> Aabb<f64, 3> {
        self.aabb
    }
}

impl BHShape<f64, 3> for Bounds {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Index {
    /// Boxes are widened by `slack_m`, so that rounding in the box test cannot hide a triangle.
    pub(super) fn build(vertices: &[Vec3], triangles: &[[u32; 3]], slack_m: f64) -> Self {
        let mut shapes: Vec<Bounds> = Part::of_triangles(vertices, triangles)
            .into_iter()
            .map(|part| {
                let (low, high) = super::bounds(&part.polygon);
                let corner = |at: Vec3, slack_m: f64| Point3::from(at.map(|x| x + slack_m));
                Bounds {
                    aabb: Aabb::with_bounds(corner(low, -slack_m), corner(high, slack_m)),
                    triangle: part.triangle,
                    node: 0,
                }
            })
            .collect();
        let bvh = Bvh::build(&mut shapes);
        let nodes = bvh.flatten_custom(&|aabb: &Aabb<f64, 3>, _enter, exit, shape| Node {
            centre: std::array::from_fn(|i| 0.5 * (aabb.min[i] + aabb.max[i])),
            half: std::array::from_fn(|i| 0.5 * (aabb.max[i] - aabb.min[i])),
            exit,
            triangle: shapes.get(shape as usize).map_or(super::NONE, |shape| shape.triangle),
        });
        Self { nodes }
    }

    /// Calls `visit` for each triangle that the closed segment from `a` to `b` touches, for a long thin one more than once.
    pub(super) fn hits(
        &self,
        vertices: &[Vec3],
        triangles: &[[u32; 3]],
        a: Vec3,
        b: Vec3,
        mut visit: impl FnMut(Hit),
    ) {
        let segment = Segment::new(a, b);
        let is_short = self.nodes.first().is_some_and(|all| norm(segment.half) < SHORT * norm(all.half));
        self.walk(
            &mut (),
            |(), node| Some(if is_short { segment.is_beside(node) } else { segment.touches(node) }),
            |(), triangle| {
                let corners = triangles[triangle as usize].map(|i| vertices[i as usize]);
                if let Some(fraction) = crossing(corners, a, b) {
                    visit(Hit { fraction, triangle });
                }
            },
        );
    }

    /// The closest point of all triangles, and its triangle.
    pub(super) fn closest(&self, vertices: &[Vec3], triangles: &[[u32; 3]], point: Vec3) -> (Vec3, u32) {
        let mut best = (f64::INFINITY, (point, 0));
        self.walk(
            &mut best,
            |best, node| Some(gap_square(node, point) < best.0),
            |best, triangle| {
                let corners = triangles[triangle as usize].map(|i| vertices[i as usize]);
                let candidate = super::closest_on_triangle(point, corners);
                let away = sub(candidate, point);
                if dot(away, away) < best.0 {
                    *best = (dot(away, away), (candidate, triangle));
                }
            },
        );
        best.1
    }

    /// Walks the hierarchy, each box and each part of a triangle at most once: `into` returns whether to descend into a box, or
    /// none to stop. Returns whether the walk reached the end.
    pub(super) fn walk<S>(
        &self,
        state: &mut S,
        mut into: impl FnMut(&mut S, &Node) -> Option<bool>,
        mut visit: impl FnMut(&mut S, u32),
    ) -> bool {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if node.triangle != super::NONE {
                visit(state, node.triangle);
                at = node.exit as usize;
                continue;
            }
            match into(state, node) {
                None => return false,
                Some(true) => at += 1,
                Some(false) => at = node.exit as usize,
            }
        }
        true
    }
}

/// Square of the distance from a point to a box.
#[inline]
fn gap_square(node: &Node, point: Vec3) -> f64 {
    (0..3).map(|i| ((point[i] - node.centre[i]).abs() - node.half[i]).max(0.0).powi(2)).sum()
}

/// Lower bound of the distance from a box to the line through `foot` along a unit vector: the distance by which a plane
/// along the line separates them.
#[inline]
pub(super) fn gap_to_line(node: &Node, foot: Vec3, along: Vec3) -> f64 {
    let away = reject(sub(node.centre, foot), along);
    let Some(across) = direction(away) else {
        return 0.0;
    };
    dot(away, across) - dot(node.half, across.map(f64::abs))
}

/// A segment between two points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    middle: Vec3,
    half: Vec3,
}

impl Segment {
    pub(super) fn new(a: Vec3, b: Vec3) -> Self {
        Self {
            middle: std::array::from_fn(|i| 0.5 * (a[i] + b[i])),
            half: std::array::from_fn(|i| 0.5 * (b[i] - a[i])),
        }
    }

    /// True if the box around the segment touches a box.
    #[inline]
    fn is_beside(&self, node: &Node) -> bool {
        !(0..3).any(|i| (self.middle[i] - node.centre[i]).abs() > node.half[i] + self.half[i].abs())
    }

    /// True if the segment touches a box (separating axes).
    #[inline]
    pub(super) fn touches(&self, node: &Node) -> bool {
        let (m, half) = (sub(self.middle, node.centre), self.half);
        let (e, d) = (node.half, half.map(f64::abs));
        let apart_across =
            |i: usize, j: usize| (m[i] * half[j] - m[j] * half[i]).abs() > e[i] * d[j] + e[j] * d[i];
        self.is_beside(node) && !(apart_across(1, 2) || apart_across(2, 0) || apart_across(0, 1))
    }
}

/// The fraction of the segment from a to b at which it touches the triangle, if it does. An edge or a corner counts.
pub(super) fn crossing([p, q, r]: [Vec3; 3], a: Vec3, b: Vec3) -> Option<f64> {
    let (above, below) = (side(p, q, r, a), side(p, q, r, b));
    if (above > 0.0 && below > 0.0) || (above < 0.0 && below < 0.0) {
        return None;
    }
    if above == 0.0 && below == 0.0 {
        // Within the plane: a segment into the triangle crosses its rim, where it touches the neighbours.
        return None;
    }
    // Sides in turn: most triangles are ruled out by one of the first two.
    let mut turns = [0.0_f64; 2];
    for (from, to) in [(p, q), (q, r), (r, p)] {
        let turn = side(a, b, from, to);
        if turn.is_nan() {
            return None;
        }
        turns = [turns[0].min(turn), turns[1].max(turn)];
        if turns[0] < 0.0 && turns[1] > 0.0 {
            return None;
        }
    }
    Some((above / (above - below)).clamp(0.0, 1.0))
}

/// Share of the terms of [`side`] that its rounding may reach, at most; Shewchuk's bound is 7 of these units.
const SIDE_SLACK: f64 = 8.0 * 0.5 * f64::EPSILON;

/// The orientation of a point seen from a triangle, with an exact sign. Nearly all are clear by the plain determinant, which is the
/// predicate's first stage, to the bit; only what is not pays for the predicate.
#[inline(always)]
fn side(p: Vec3, q: Vec3, r: Vec3, s: Vec3) -> f64 {
    let ([ax, ay, az], [bx, by, bz], [cx, cy, cz]) = (sub(p, s), sub(q, s), sub(r, s));
    let (bc, cb, ca, ac, ab, ba) = (bx * cy, cx * by, cx * ay, ax * cy, ax * by, bx * ay);
    let det = az * (bc - cb) + bz * (ca - ac) + cz * (ab - ba);
    let terms = (bc.abs() + cb.abs()) * az.abs()
        + (ca.abs() + ac.abs()) * bz.abs()
        + (ab.abs() + ba.abs()) * cz.abs();
    if det.abs() > SIDE_SLACK * terms { det } else { exact_side(p, q, r, s) }
}

#[cold]
fn exact_side(p: Vec3, q: Vec3, r: Vec3, s: Vec3) -> f64 {
    let coord = |[x, y, z]: Vec3| Coord3D { x, y, z };
    orient3d(coord(p), coord(q), coord(r), coord(s))
}
