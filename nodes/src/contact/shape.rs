//! Contact with simple shapes in closed form, and scenes of several.
//!
//! The tool is a small sphere, the proxy. It touches a shape where its centre would touch the shape grown by its radius;
//! HIP and IHIP are both positions of that centre. (A grown box keeps its sharp edges.)

use super::Contact;
use super::mesh::TriangleMesh;
use super::proxy::MeshProxy;
use crate::vector::{Vec3, add, add_scaled, direction, distance, dot, norm, sub};
use std::sync::Arc;

/// A surface that a tool can touch.
#[derive(Debug, Clone)]
pub enum Shape {
    /// A half space.
    Plane {
        /// A point of its surface, m.
        origin_m: Vec3,
        /// Outward direction, of any length.
        normal: Vec3,
    },
    /// A sphere.
    Sphere {
        /// Centre, m.
        centre_m: Vec3,
        /// Diameter, m.
        diameter_m: f64,
    },
    /// A box with edges along the axes, touched from outside.
    Box {
        /// Centre, m.
        centre_m: Vec3,
        /// Extents, m.
        size_m: Vec3,
    },
    /// A room: a box with edges along the axes, touched from inside.
    Room {
        /// Centre, m.
        centre_m: Vec3,
        /// Extents, m.
        size_m: Vec3,
    },
    /// A mesh, touched by a point (the proxy's diameter is ignored), from outside unless the tool starts inside.
    Mesh {
        /// The mesh.
        mesh: Arc<TriangleMesh>,
        /// A point in free space on the side that the tool feels, m; none: above the mesh.
        start_m: Option<Vec3>,
    },
}

/// Error of a shape.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(crate) enum ShapeError {
    /// A setting is out of range.
    #[error("the shape's {name} is {value}: give {range}")]
    OutOfRange {
        /// The setting.
        name: &'static str,
        /// The value.
        value: f64,
        /// The allowed range.
        range: &'static str,
    },
}

/// A tool and a shape. Allocates only when made.
#[derive(Debug, Clone)]
pub(crate) struct Touch {
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    Plane { origin_m: Vec3, normal: Vec3 },
    Sphere { centre_m: Vec3, radius_m: f64, last_normal: Vec3 },
    Box { centre_m: Vec3, half_m: Vec3, proxy_m: Option<Vec3> },
    Room { centre_m: Vec3, half_m: Vec3 },
    Mesh(MeshProxy),
}

impl Touch {
    /// A tool whose tip is a sphere of this diameter, m (0: a point).
    pub(crate) fn new(shape: &Shape, proxy_diameter_m: f64) -> Result<Self, ShapeError> {
        let radius_m = 0.5 * proxy_diameter_m;
        if !(radius_m >= 0.0 && radius_m.is_finite()) {
            let range = "a finite length in m, zero or more";
            return Err(ShapeError::OutOfRange { name: "proxy_diameter_m", value: proxy_diameter_m, range });
        }
        let half = |name: &'static str, size_m: Vec3, grow_m: f64| -> Result<Vec3, ShapeError> {
            let half_m = size_m.map(|s| 0.5 * s + grow_m);
            match half_m.into_iter().zip(size_m).find(|(h, s)| !(*h > 0.0 && *s > 0.0 && s.is_finite())) {
                Some((_, value)) => {
                    let range = "extents in m larger than the proxy";
                    Err(ShapeError::OutOfRange { name, value, range })
                }
                None => Ok(half_m),
            }
        };
        let kind = match shape {
            Shape::Plane { origin_m, normal } => {
                let range = "a direction other than zero";
                let normal =
                    direction(*normal).ok_or(ShapeError::OutOfRange { name: "normal", value: 0.0, range })?;
                Kind::Plane { origin_m: add_scaled(*origin_m, normal, radius_m), normal }
            }
            Shape::Sphere { centre_m, diameter_m } => {
                let grown_m = half("diameter_m", [*diameter_m; 3], radius_m)?[0];
                Kind::Sphere { centre_m: *centre_m, radius_m: grown_m, last_normal: [0.0, 0.0, 1.0] }
            }
            Shape::Box { centre_m, size_m } => {
                Kind::Box { centre_m: *centre_m, half_m: half("size_m", *size_m, radius_m)?, proxy_m: None }
            }
            Shape::Room { centre_m, size_m } => {
                Kind::Room { centre_m: *centre_m, half_m: half("size_m", *size_m, -radius_m)? }
            }
            Shape::Mesh { mesh, start_m } => Kind::Mesh(match start_m {
                Some(start_m) => MeshProxy::new(mesh.clone(), *start_m),
                None => MeshProxy::outside(mesh.clone()),
            }),
        };
        Ok(Self { kind })
    }

    /// Takes over the state of another tool on a shape of the same kind.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        match (&mut self.kind, &other.kind) {
            (Kind::Sphere { last_normal, .. }, Kind::Sphere { last_normal: other, .. }) => {
                *last_normal = *other
            }
            (Kind::Box { proxy_m, .. }, Kind::Box { proxy_m: other, .. }) => *proxy_m = *other,
            (Kind::Mesh(proxy), Kind::Mesh(other)) => proxy.copy_state_from(other),
            _ => {}
        }
    }

    /// Advances one tick with the device at `hip_m`. A position that is not finite gives no contact.
    pub(crate) fn update(&mut self, hip_m: Vec3) -> Contact {
        if !hip_m.iter().all(|x| x.is_finite()) {
            return Contact::free(hip_m);
        }
        match &mut self.kind {
            Kind::Plane { origin_m, normal } => {
                let depth_m = dot(sub(*origin_m, hip_m), *normal);
                pushed(hip_m, *normal, depth_m, 0)
            }
            Kind::Sphere { centre_m, radius_m, last_normal } => {
                let away = sub(hip_m, *centre_m);
                let normal = direction(away).unwrap_or(*last_normal);
                *last_normal = normal;
                pushed(hip_m, normal, *radius_m - norm(away), 0)
            }
            Kind::Box { centre_m, half_m, proxy_m } => {
                let local_m = sub(hip_m, *centre_m);
                let (next_m, side) = around_box(*half_m, proxy_m.unwrap_or(local_m), local_m);
                *proxy_m = Some(next_m);
                side.map_or(Contact::free(hip_m), |side| {
                    let (axis, sign) = (side as usize / 2, if side % 2 == 1 { 1.0 } else { -1.0 });
                    let mut normal = [0.0; 3];
                    normal[axis] = sign;
                    pushed_to(hip_m, add(next_m, *centre_m), normal, side)
                })
            }
            Kind::Room { centre_m, half_m } => {
                let local_m = sub(hip_m, *centre_m);
                let proxy_m: Vec3 = std::array::from_fn(|i| local_m[i].clamp(-half_m[i], half_m[i]));
                let outside = (0..3).fold(0, |deepest, i| {
                    let depth = |i: usize| local_m[i].abs() - half_m[i];
                    if depth(i) > depth(deepest) { i } else { deepest }
                });
                match direction(sub(proxy_m, local_m)) {
                    Some(normal) => {
                        let side = 2 * outside as u32 + u32::from(local_m[outside] > 0.0);
                        pushed_to(hip_m, add(proxy_m, *centre_m), normal, side)
                    }
                    None => Contact::free(hip_m),
                }
            }
            Kind::Mesh(proxy) => proxy.update(hip_m),
        }
    }
}

/// Contact at a depth below a surface with this normal; free above it.
fn pushed(hip_m: Vec3, normal: Vec3, depth_m: f64, face: u32) -> Contact {
    if depth_m <= 0.0 {
        return Contact::free(hip_m);
    }
    let ihip_m = add_scaled(hip_m, normal, depth_m);
    Contact { touching: true, hip_m, ihip_m, penetration_m: depth_m, normal, face }
}

fn pushed_to(hip_m: Vec3, ihip_m: Vec3, normal: Vec3, face: u32) -> Contact {
    Contact { touching: true, hip_m, ihip_m, penetration_m: distance(hip_m, ihip_m), normal, face }
}

/// The god-object around a box at the origin: from where the proxy was towards the device, stopped at a side, along that
/// side. Which side holds it: 0 to 5, none when free.
fn around_box(half_m: Vec3, proxy_m: Vec3, hip_m: Vec3) -> (Vec3, Option<u32>) {
    let inside = |x: Vec3| (0..3).all(|i| x[i].abs() < half_m[i]);
    // The first position is inside the box: use the nearest side.
    let start_m = if inside(proxy_m) { lift_out(half_m, proxy_m) } else { proxy_m };
    let Some((axis, sign)) = entry(half_m, start_m, hip_m) else {
        return (hip_m, None);
    };
    let mut next_m = hip_m;
    next_m[axis] = sign * half_m[axis];
    let beyond = (0..3).any(|i| i != axis && next_m[i].abs() > half_m[i]);
    // Beyond the side's edge nothing holds the proxy any more, unless the way round is through another side.
    if beyond {
        return match entry(half_m, next_m, hip_m) {
            None => (hip_m, None),
            Some((axis, sign)) => {
                let mut around_m = hip_m;
                around_m[axis] = sign * half_m[axis];
                (around_m, Some(2 * axis as u32 + u32::from(sign > 0.0)))
            }
        };
    }
    (next_m, Some(2 * axis as u32 + u32::from(sign > 0.0)))
}

fn lift_out(half_m: Vec3, x: Vec3) -> Vec3 {
    let depth = |i: usize| half_m[i] - x[i].abs();
    let axis = (0..3).fold(0, |best, i| if depth(i) < depth(best) { i } else { best });
    let mut out = x;
    out[axis] = half_m[axis].copysign(x[axis]);
    out
}

/// The side (axis, sign) through which the way from a point outside enters the box, if it does.
fn entry(half_m: Vec3, from_m: Vec3, to_m: Vec3) -> Option<(usize, f64)> {
    let mut enter: (f64, Option<(usize, f64)>) = (f64::NEG_INFINITY, None);
    let mut leave = f64::INFINITY;
    for axis in 0..3 {
        let (from, way, half) = (from_m[axis], to_m[axis] - from_m[axis], half_m[axis]);
        if way == 0.0 {
            if from.abs() >= half {
                return None;
            }
            continue;
        }
        let sign = -way.signum();
        let (first, last) = ((sign * half - from) / way, (-sign * half - from) / way);
        if first > enter.0 {
            enter = (first, Some((axis, sign)));
        }
        leave = leave.min(last);
    }
    enter.1.filter(|_| (0.0..1.0).contains(&enter.0) && enter.0 < leave)
}

/// Several shapes at once; the deepest contact applies.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    touches: Vec<Touch>,
}

impl Scene {
    /// A tool whose tip is a sphere of this diameter, m, among shapes.
    pub(crate) fn new(shapes: &[Shape], proxy_diameter_m: f64) -> Result<Self, ShapeError> {
        let touches =
            shapes.iter().map(|shape| Touch::new(shape, proxy_diameter_m)).collect::<Result<_, _>>()?;
        Ok(Self { touches })
    }

    /// Takes over the state of another tool among shapes of the same kinds.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        for (touch, other) in self.touches.iter_mut().zip(&other.touches) {
            touch.copy_state_from(other);
        }
    }

    /// Advances one tick; returns the deepest contact and the index of its shape.
    pub(crate) fn update(&mut self, hip_m: Vec3) -> (Contact, usize) {
        let free = (Contact::free(hip_m), 0);
        self.touches.iter_mut().map(|touch| touch.update(hip_m)).enumerate().fold(
            free,
            |deepest, (i, contact)| {
                if contact.penetration_m > deepest.0.penetration_m { (contact, i) } else { deepest }
            },
        )
    }
}

#[cfg(test)]
mod tests;
