//! The god-object on a mesh (Zilles and Salisbury 1995): a point that follows the device but stays on the free side of
//! the surface, as near to the device as a hard surface lets it.
//!
//! One rule makes it safe: the proxy moves only along a segment that, by exact predicates, touches no
//! triangle. It does not rely on a closed mesh, on orientation, or on the sliding below. The felt side
//! is the proxy's side; a tool that starts inside feels the inside.

use super::Contact;
use super::mesh::TriangleMesh;
use crate::vector::{Vec3, add_scaled, cross, direction, distance, dot, norm, scale, sub};
use std::sync::Arc;

/// The proxy of one tool on one mesh. Never allocates.
#[derive(Debug, Clone)]
pub(crate) struct MeshProxy {
    mesh: Arc<TriangleMesh>,
    proxy_m: Vec3,
    /// Distance that the proxy keeps from the surface: a millionth of the mesh, far below any device's step.
    skin_m: f64,
}

/// A plane that the proxy must stay above: normal . x >= offset.
#[derive(Debug, Clone, Copy)]
struct Plane {
    normal: Vec3,
    offset: f64,
    face: u32,
}

/// Planes that can hold the proxy at once: three fix a point; the fourth lets one of them be exchanged.
const MAX_PLANES: usize = 4;
/// Largest number of sliding steps per tick. Smooth surfaces take two to four; the rest follows in the next tick.
const MAX_ROUNDS: usize = 12;

impl MeshProxy {
    /// A proxy at a point in free space, on the side of the surface that the tool feels.
    pub(crate) fn new(mesh: Arc<TriangleMesh>, start_m: Vec3) -> Self {
        let skin_m = 1e-6 * mesh.diagonal_m();
        Self { mesh, proxy_m: start_m, skin_m }
    }

    /// A proxy outside the mesh, above it along z.
    pub(crate) fn outside(mesh: Arc<TriangleMesh>) -> Self {
        let start_m = add_scaled(mesh.centre_m(), [0.0, 0.0, 1.0], mesh.diagonal_m());
        Self::new(mesh, start_m)
    }

    /// Takes over the position of another proxy, on the same or a similar mesh.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        self.proxy_m = other.proxy_m;
    }

    /// Advances one tick with the device at `hip_m`. A position that is not finite gives no contact and does not move the proxy.
    pub(crate) fn update(&mut self, hip_m: Vec3) -> Contact {
        if !hip_m.iter().all(|x| x.is_finite()) {
            return Contact::free(hip_m);
        }
        let mut touched = None;
        for _ in 0..MAX_ROUNDS {
            let before_m = self.proxy_m;
            let Some(face) = self.slide(hip_m) else {
                return Contact::free(hip_m);
            };
            touched = Some(face);
            if distance(before_m, self.proxy_m) < 0.01 * self.skin_m {
                break;
            }
        }
        touched.map_or(Contact::free(hip_m), |face| self.contact(hip_m, face))
    }

    fn contact(&self, hip_m: Vec3, plane: Plane) -> Contact {
        let stretch = sub(self.proxy_m, hip_m);
        // Near the surface the direction is within rounding; use the face's normal.
        let deep = norm(stretch) > 10.0 * self.skin_m;
        let normal = direction(stretch).filter(|_| deep).unwrap_or(plane.normal);
        Contact {
            touching: true,
            hip_m,
            ihip_m: self.proxy_m,
            penetration_m: norm(stretch),
            normal,
            face: plane.face,
        }
    }

    /// One sliding step: straight towards the device until a triangle stops the proxy, then along the planes met towards the point
    /// nearest to the device. Returns the plane that stops the proxy, if any.
    fn slide(&mut self, hip_m: Vec3) -> Option<Plane> {
        let first = self.advance(hip_m)?;
        let mut planes = [first; MAX_PLANES];
        for count in 1..=MAX_PLANES {
            let Some(goal_m) = nearest_above(&planes[..count], hip_m, self.skin_m) else {
                break;
            };
            if distance(goal_m, self.proxy_m) < 0.01 * self.skin_m {
                break;
            }
            match self.advance(goal_m) {
                Some(plane) if count < MAX_PLANES => planes[count] = plane,
                _ => break,
            }
        }
        Some(first)
    }

    /// Moves towards a goal as far as the mesh allows; returns the plane that stopped it, if any.
    fn advance(&mut self, goal_m: Vec3) -> Option<Plane> {
        let Some(hit) = self.mesh.first_hit(self.proxy_m, goal_m) else {
            self.proxy_m = goal_m;
            return None;
        };
        let way = sub(goal_m, self.proxy_m);
        let corner = self.mesh.corners(hit.triangle)[0];
        let outward = self.mesh.normal(hit.triangle);
        let height_m = dot(outward, sub(self.proxy_m, corner));
        let normal = if height_m < 0.0 { scale(outward, -1.0) } else { outward };
        let plane = Plane { normal, offset: dot(normal, corner) + self.skin_m, face: hit.triangle };
        // Stop a skin above the triangle. The way there is part of a way already seen, but its end is rounded: look again.
        let sink_m = -dot(normal, way);
        let back = if sink_m > 0.0 { self.skin_m / sink_m } else { 1.0 };
        let fraction = hit.fraction - back;
        if fraction > 0.0 {
            let stop_m = add_scaled(self.proxy_m, way, fraction);
            if self.mesh.first_hit(self.proxy_m, stop_m).is_none() {
                self.proxy_m = stop_m;
            }
        }
        Some(plane)
    }
}

/// The point nearest to `target` that is above all planes, if rounding lets it be found: the least over the points fixed
/// by up to three of the planes that are above the rest.
fn nearest_above(planes: &[Plane], target: Vec3, slack: f64) -> Option<Vec3> {
    let above = |x: Vec3| planes.iter().all(|p| dot(p.normal, x) >= p.offset - 1e-3 * slack);
    let mut nearest: Option<(f64, Vec3)> = None;
    let mut offer = |candidate: Option<Vec3>| {
        if let Some(x) = candidate.filter(|x| above(*x)) {
            let away = distance(x, target);
            if nearest.is_none_or(|(least, _)| away < least) {
                nearest = Some((away, x));
            }
        }
    };
    offer(Some(target));
    for (i, a) in planes.iter().enumerate() {
        offer(Some(onto_plane(a, target)));
        for (j, b) in planes.iter().enumerate().skip(i + 1) {
            offer(onto_line(a, b, target));
            for c in planes.iter().skip(j + 1) {
                offer(corner_of(a, b, c));
            }
        }
    }
    nearest.map(|(_, x)| x)
}

fn onto_plane(a: &Plane, x: Vec3) -> Vec3 {
    add_scaled(x, a.normal, a.offset - dot(a.normal, x))
}

fn onto_line(a: &Plane, b: &Plane, x: Vec3) -> Option<Vec3> {
    let cos = dot(a.normal, b.normal);
    let sin_square = 1.0 - cos * cos;
    let (miss_a, miss_b) = (a.offset - dot(a.normal, x), b.offset - dot(b.normal, x));
    let (u, v) = ((miss_a - cos * miss_b) / sin_square, (miss_b - cos * miss_a) / sin_square);
    (sin_square > 1e-12).then(|| add_scaled(add_scaled(x, a.normal, u), b.normal, v))
}

fn corner_of(a: &Plane, b: &Plane, c: &Plane) -> Option<Vec3> {
    let (bc, ca, ab) = (cross(b.normal, c.normal), cross(c.normal, a.normal), cross(a.normal, b.normal));
    let volume = dot(a.normal, bc);
    let sum = add_scaled(add_scaled(scale(bc, a.offset), ca, b.offset), ab, c.offset);
    (volume.abs() > 1e-9).then(|| scale(sum, 1.0 / volume))
}

#[cfg(test)]
mod tests;
