//! Intersection of a line with a convex mesh, at bounded cost for any line.
//!
//! The hierarchy is searched first, at most [`HIERARCHY_VISITS`] nodes each for the hit and for the nearest point of a line
//! that misses. If that does not suffice (a line within a fan of thousands of triangles), the whole mesh is searched once
//! instead: a convex solid is the intersection of its half spaces, so every plane clips the line, and its nearest edge
//! is one of all edges. Both give the same point, to rounding.

use super::index::{Segment, crossing, gap_to_line};
use super::{NONE, TriangleMesh};
use crate::vector::{Vec3, add_scaled, distance, dot, norm, reject, sub};

/// Sine of the angle below which a line runs along a plane: across the whole mesh it does not leave it by the slack.
const ALONG: f64 = 1e-9;

/// Nodes of the hierarchy visited for a hit, and as many for a miss.
pub(super) const HIERARCHY_VISITS: usize = 2048;

/// The point where a line enters a convex mesh, or its nearest point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineMeeting {
    /// The point of the surface, m: where the line enters, or the nearest to it; of several, the first along the line.
    pub position_m: Vec3,
    /// The triangle; at an edge the one that the line runs against most.
    pub triangle: u32,
    /// Distance by which the line misses, m; 0 if it hits.
    pub miss_m: f64,
    /// Visited nodes and triangles.
    pub visits: usize,
}

/// A line by a point and a unit vector, its tolerance, and the number of visits.
struct Line {
    foot_m: Vec3,
    along: Vec3,
    slack_m: f64,
    visits: usize,
}

/// A candidate: a point where the line enters, or is near.
#[derive(Clone, Copy)]
struct Place {
    position_m: Vec3,
    triangle: u32,
    /// Distance from the line, m.
    gap_m: f64,
    /// Distance along the line, m.
    at_m: f64,
    /// Cosine between its normal and the line: -1 where it is met head on.
    facing: f64,
}

impl TriangleMesh {
    /// Finds the point where a line along a unit vector enters a convex mesh, or the nearest of its points. Allocates
    /// nothing, and visits at most twice `HIERARCHY_VISITS` and twice the triangles.
    pub fn meet_line(&self, foot_m: Vec3, along: Vec3) -> LineMeeting {
        // Relative to the line's point nearest to the mesh's middle, numbers are smallest.
        let foot_m = add_scaled(foot_m, along, dot(sub(self.centre_m, foot_m), along));
        let mut line = Line { foot_m, along, slack_m: 1e-9 * self.diagonal_m, visits: 0 };
        let hit = self.hit_by_hierarchy(&mut line).unwrap_or_else(|| self.clip(&mut line));
        if let Some(place) = hit {
            return line.meeting(&Place { gap_m: 0.0, ..place });
        }
        let beside = self.beside_by_hierarchy(&mut line);
        let beside = beside.unwrap_or_else(|| self.beside(&mut line));
        line.meeting(&beside)
    }

    /// The point where the line enters, if it does; `None` if the hierarchy takes too many visits.
    fn hit_by_hierarchy(&self, line: &mut Line) -> Option<Option<Place>> {
        let reach_m = self.diagonal_m;
        let (from_m, to_m) = (line.point(-reach_m), line.point(reach_m));
        let (segment, end) = (Segment::new(from_m, to_m), line.visits + HIERARCHY_VISITS);
        let mut first: Option<Place> = None;
        let complete = self.index.walk(
            &mut (line, &mut first),
            |(line, _), node| line.looks_at(end, segment.touches(node)),
            |(line, first), triangle| {
                line.visits += 1;
                // The line enters through faces that face it.
                if self.facing(line, triangle) < 0.0
                    && let Some(fraction) = crossing(self.corners(triangle), from_m, to_m)
                {
                    let position_m = add_scaled(from_m, sub(to_m, from_m), fraction);
                    let place = self.place(line, position_m, triangle, 0.0);
                    place.replace_worse(first, line.slack_m);
                }
            },
        );
        complete.then_some(first)
    }

    /// The entry of the line, by the planes of all triangles.
    fn clip(&self, line: &mut Line) -> Option<Place> {
        let (mut enters_m, mut leaves_m) = (f64::NEG_INFINITY, f64::INFINITY);
        for triangle in 0..self.triangles.len() as u32 {
            line.visits += 1;
            let (facing, height_m) = self.against(line, triangle);
            if facing < 0.0 {
                enters_m = enters_m.max(height_m / -facing);
            } else if facing > 0.0 {
                leaves_m = leaves_m.min(-height_m / facing);
            } else if height_m > 0.0 {
                return None;
            }
        }
        // A line that overflows does not enter; others enter through a triangle below.
        if !enters_m.is_finite() || enters_m > leaves_m {
            return None;
        }
        let position_m = line.point(enters_m);
        // Of the triangles of that plane, the one that the point is on.
        let mut best = None;
        for triangle in 0..self.triangles.len() as u32 {
            line.visits += 1;
            let (facing, height_m) = self.against(line, triangle);
            if facing < 0.0 && (height_m / -facing - enters_m).abs() <= line.slack_m {
                let on_m = super::closest_on_triangle(position_m, self.corners(triangle));
                let place = self.place(line, position_m, triangle, distance(on_m, position_m));
                place.replace_worse(&mut best, line.slack_m);
            }
        }
        best
    }

    /// Cosine between a triangle's normal and the line; 0 where the line runs along it.
    fn facing(&self, line: &Line, triangle: u32) -> f64 {
        let facing = dot(self.normal(triangle), line.along);
        if facing.abs() > ALONG { facing } else { 0.0 }
    }

    /// The cosine between a triangle's normal and the line, and the distance of the line's foot outside of its plane,
    /// m.
    fn against(&self, line: &Line, triangle: u32) -> (f64, f64) {
        let corner_m = self.vertices[self.triangles[triangle as usize][0] as usize];
        let height_m = dot(self.normal(triangle), sub(line.foot_m, corner_m));
        (self.facing(line, triangle), height_m)
    }

    /// The nearest point to a line that misses; none if the hierarchy takes too many visits.
    fn beside_by_hierarchy(&self, line: &mut Line) -> Option<Place> {
        let end = line.visits + HIERARCHY_VISITS;
        let mut best: Option<Place> = None;
        let complete = self.index.walk(
            &mut (line, &mut best),
            |(line, best), node| {
                let gap_m = gap_to_line(node, line.foot_m, line.along);
                line.looks_at(end, best.is_none_or(|best| gap_m <= best.gap_m + line.slack_m))
            },
            |(line, best), triangle| {
                line.visits += 1;
                self.note_nearest(line, best, triangle);
            },
        );
        best.filter(|_| complete)
    }

    /// The nearest point, by all triangles.
    fn beside(&self, line: &mut Line) -> Place {
        let mut best = None;
        for triangle in 0..self.triangles.len() as u32 {
            line.visits += 1;
            self.note_nearest(line, &mut best, triangle);
        }
        let first = self.corners(0)[0];
        best.unwrap_or_else(|| self.place(line, first, 0, line.gap_m(first)))
    }

    /// The nearest point of a triangle's rim, if it is better than the best so far. Only edges count at which the mesh turns
    /// away from the line: what the line sees of it ends there, and of what is as near they come first.
    fn note_nearest(&self, line: &Line, best: &mut Option<Place>, triangle: u32) {
        if self.facing(line, triangle) >= 0.0 {
            return;
        }
        let [a, b, c] = self.corners(triangle);
        let edges = [(a, b), (b, c), (c, a)].into_iter().zip(self.neighbours(triangle));
        for ((from_m, to_m), other) in edges {
            if other != NONE && self.facing(line, other) < 0.0 {
                continue;
            }
            let position_m = line.nearest_of(from_m, to_m);
            let place = self.place(line, position_m, triangle, line.gap_m(position_m));
            place.replace_worse(best, line.slack_m);
        }
    }

    fn place(&self, line: &Line, position_m: Vec3, triangle: u32, gap_m: f64) -> Place {
        Place {
            position_m,
            triangle,
            gap_m,
            at_m: dot(sub(position_m, line.foot_m), line.along),
            facing: self.facing(line, triangle),
        }
    }
}

impl Place {
    /// Replaces a worse candidate.
    fn replace_worse(self, best: &mut Option<Self>, slack_m: f64) {
        if best.is_none_or(|best| self.is_before(&best, slack_m)) {
            *best = Some(self);
        }
    }

    /// True if the place is nearer, or as near and earlier, or equal and more opposed to the line.
    fn is_before(&self, other: &Self, slack_m: f64) -> bool {
        let (nearer_m, earlier_m) = (other.gap_m - self.gap_m, other.at_m - self.at_m);
        if nearer_m.abs() > slack_m {
            nearer_m > 0.0
        } else if earlier_m.abs() > slack_m {
            earlier_m > 0.0
        } else {
            self.facing < other.facing
        }
    }
}

impl Line {
    fn point(&self, at_m: f64) -> Vec3 {
        add_scaled(self.foot_m, self.along, at_m)
    }

    fn gap_m(&self, point_m: Vec3) -> f64 {
        norm(reject(sub(point_m, self.foot_m), self.along))
    }

    /// The point of an edge that is nearest to the line, the earlier end where they are parallel.
    fn nearest_of(&self, from_m: Vec3, to_m: Vec3) -> Vec3 {
        let (start, way) =
            (reject(sub(from_m, self.foot_m), self.along), reject(sub(to_m, from_m), self.along));
        let square = dot(way, way);
        if square <= self.slack_m * self.slack_m {
            let is_forward = dot(sub(to_m, from_m), self.along) >= 0.0;
            return if is_forward { from_m } else { to_m };
        }
        let fraction = (-dot(start, way) / square).clamp(0.0, 1.0);
        add_scaled(from_m, sub(to_m, from_m), fraction)
    }

    /// Counts a visit, and returns whether to descend into the box; none if the visits are used up.
    fn looks_at(&mut self, end: usize, into: bool) -> Option<bool> {
        let has_time = self.visits + 2 <= end;
        self.visits += usize::from(has_time);
        has_time.then_some(into)
    }

    fn meeting(&self, place: &Place) -> LineMeeting {
        LineMeeting {
            position_m: place.position_m,
            triangle: place.triangle,
            miss_m: place.gap_m,
            visits: self.visits,
        }
    }
}

#[cfg(test)]
mod tests;
