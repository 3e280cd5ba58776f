//! Location of the point where a tool touches an object on a force/torque sensor (5.2): the line of action of the
//! measured force meets the object's surface. Any tool works if it touches in one point and the object is convex.

mod path;

pub(crate) use path::{LEASH, SurfacePath};

use super::mesh::{NotConvex, TriangleMesh};
use crate::vector::{Vec3, ZERO, add_scaled, cross, dot, norm, scale};
use std::sync::Arc;

/// Settings of contact location.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct WrenchSettings {
    /// Force at which contact begins, N.
    pub threshold_n: f64,
    /// Uncertainty of the measured force, N.
    pub force_step_n: f64,
    /// Uncertainty of the measured torque, N m.
    pub torque_step_n_m: f64,
}

impl Default for WrenchSettings {
    /// 0.08 N; the steps of a Nano17 SI-25-0.25: 1/160 N and 1/32 N mm.
    fn default() -> Self {
        Self { threshold_n: 0.08, force_step_n: 1.0 / 160.0, torque_step_n_m: 1e-3 / 32.0 }
    }
}

/// A contact located from a wrench, in the sensor's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct WrenchContact {
    /// True if the force is above the threshold.
    pub touching: bool,
    /// Point of contact on the surface, m; it holds its last value in free space.
    pub position_m: Vec3,
    /// Outward unit normal there.
    pub normal: Vec3,
    /// Triangle of the mesh.
    pub face: u32,
    /// Normal force on the tool, N (positive when pressed).
    pub normal_force_n: f64,
    /// Tangential force on the tool, N: F - (F . n) n.
    pub friction_n: Vec3,
    /// |F . M| / |F|^2, m: zero for a single point of contact, a moment about the force's own line otherwise.
    pub residual_m: f64,
    /// Uncertainty of the position across the line of action, m (Eq. 5.2.4).
    pub uncertainty_m: f64,
    /// Uncertainty of the point itself, m: as Eq. 5.2.4, with the whole lever from the sensor to the point. Where the force
    /// runs through the sensor there is no torque, but its direction is as uncertain as ever.
    pub point_uncertainty_m: f64,
    /// Distance by which the line of action misses the object, m (0 if it hits). If it misses, the nearest point of the surface
    /// is taken.
    pub miss_m: f64,
}

/// Locates contacts on one object. Never allocates.
#[derive(Debug, Clone)]
pub(crate) struct WrenchLocator {
    object: Arc<TriangleMesh>,
    settings: WrenchSettings,
    last: WrenchContact,
}

impl WrenchLocator {
    /// A locator for a convex object, given in the sensor's frame. A concave object is an error: a line could enter
    /// it more than once.
    pub(crate) fn new(object: Arc<TriangleMesh>, settings: WrenchSettings) -> Result<Self, NotConvex> {
        object.check_convex()?;
        let last = WrenchContact {
            touching: false,
            position_m: object.corners(0)[0],
            normal: object.normal(0),
            face: 0,
            normal_force_n: 0.0,
            friction_n: ZERO,
            residual_m: 0.0,
            uncertainty_m: 0.0,
            point_uncertainty_m: 0.0,
            miss_m: 0.0,
        };
        Ok(Self { object, settings, last })
    }

    /// The settings, which may change from tick to tick.
    pub(crate) fn settings_mut(&mut self) -> &mut WrenchSettings {
        &mut self.settings
    }

    /// Takes over the last contact of another locator.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        self.last = other.last;
    }

    /// Advances one tick: the contact that causes the force and the torque on the object, N and N m. A wrench that is not finite, or whose
    /// line of action overflows, gives no contact. The cost is bounded by that of [`TriangleMesh::meet_line`].
    pub(crate) fn update(&mut self, force_on_object_n: Vec3, torque_on_object_n_m: Vec3) -> WrenchContact {
        let (force_n, torque_n_m) = (force_on_object_n, torque_on_object_n_m);
        let size_n = norm(force_n);
        // Written so that a NaN force gives no contact.
        let touching =
            size_n >= self.settings.threshold_n && size_n.is_finite() && norm(torque_n_m).is_finite();
        if !touching {
            return self.let_go();
        }
        // r* = F x M / |F|^2. Eq. 5.2.3
        let foot_m = scale(cross(force_n, torque_n_m), 1.0 / (size_n * size_n));
        let along = scale(force_n, 1.0 / size_n);
        let met = self.object.meet_line(foot_m, along);
        if !met.miss_m.is_finite() {
            // The torque is so large that the line of action overflows.
            return self.let_go();
        }
        // Where the line enters, the force is compressive.
        let (position_m, face, miss_m) = (met.position_m, met.triangle, met.miss_m);
        let normal = self.object.normal(face);
        // The force on the tool is the opposite of the force on the object.
        let normal_force_n = -dot(force_n, normal);
        self.last = WrenchContact {
            touching: true,
            position_m,
            normal,
            face,
            normal_force_n,
            friction_n: scale(add_scaled(force_n, normal, normal_force_n), -1.0),
            residual_m: dot(force_n, torque_n_m).abs() / (size_n * size_n),
            uncertainty_m: self.uncertainty_m(size_n, norm(torque_n_m)),
            point_uncertainty_m: self.uncertainty_m(size_n, size_n * norm(position_m)),
            miss_m,
        };
        self.last
    }

    fn let_go(&mut self) -> WrenchContact {
        self.last = WrenchContact { touching: false, normal_force_n: 0.0, friction_n: ZERO, ..self.last };
        self.last
    }

    /// Uncertainty across the line of action for sizes of force and torque, N and N m. Eq. 5.2.4, written so that it is finite
    /// without torque.
    pub(crate) fn uncertainty_m(&self, force_n: f64, torque_n_m: f64) -> f64 {
        let by_torque = self.settings.torque_step_n_m / force_n;
        let by_force = torque_n_m * self.settings.force_step_n / (force_n * force_n);
        by_torque.hypot(by_force)
    }
}

#[cfg(test)]
mod tests;
