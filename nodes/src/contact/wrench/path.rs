//! The path of a contact point along a surface, and its speed.
//!
//! Points are joined along the surface: two points on faces that meet at an angle are as far apart as they are when the faces
//! are laid flat. The path is expressed in a tangent frame that is carried along, so that the filter does not depend on
//! edges. A leash removes the jitter of the measured point: the followed point moves when the measured one pulls it
//! beyond the leash's length, and otherwise drifts after it, so a still pen has no speed and a moving one keeps its speed.

use super::super::wrench::WrenchContact;
use crate::sensing::speed::{SpeedEstimator, SpeedFilter};
use crate::vector::{
    Vec3, ZERO, add_scaled, cross, direction, distance, dot, norm, reject, scale, sub, tangents,
};
use haptograph_signal::filter::DesignError;

/// Leash that gives a still pen zero speed: behind a 20 Hz filter five to six standard deviations of a Nano17's
/// noise.
pub(crate) const LEASH: f64 = 1.2;

/// Time in which the followed point drifts to the middle of the jitter, s, so that the leash need not pull it there.
const DRIFT_S: f64 = 0.8;

/// A point this far from the last one, a tick ago, is another contact, m.
const LEAP_M: f64 = 0.1;

/// Follows one contact. Allocates only when made.
#[derive(Debug, Clone)]
pub(crate) struct SurfacePath {
    estimator: SpeedEstimator<2>,
    /// Length of the leash as a multiple of the point's uncertainty.
    leash: f64,
    /// Fraction of the remaining distance that the followed point drifts per tick.
    drift: f64,
    at: Option<At>,
    way_m: f64,
}

#[derive(Debug, Clone, Copy)]
struct At {
    position_m: Vec3,
    normal: Vec3,
    frame: [Vec3; 2],
    /// The measured point less the followed one, in the frame.
    ahead_m: [f64; 2],
    /// The followed point on the sheet that the surface is rolled out on.
    sheet_m: [f64; 2],
}

impl SurfacePath {
    /// A path of contacts sampled at `rate_hz`, on a leash of a multiple of the point's uncertainty ([`LEASH`]).
    pub(crate) fn new(filter: SpeedFilter, leash: f64, rate_hz: f64) -> Result<Self, DesignError> {
        Ok(Self {
            estimator: SpeedEstimator::new(filter, rate_hz)?,
            leash: leash.max(0.0),
            drift: 1.0 / (DRIFT_S * rate_hz),
            at: None,
            way_m: 0.0,
        })
    }

    /// Tunes the speed's filter to another cut-off, as [`SpeedEstimator::turn`].
    pub(crate) fn turn(&mut self, frequency: f64) {
        self.estimator.turn(frequency);
    }

    /// Sets the length of the leash, as a multiple of the point's uncertainty.
    pub(crate) fn set_leash(&mut self, leash: f64) {
        let leash = leash.max(0.0);
        // On a shorter leash the followed point comes nearer without a way: a pen that rests stays without speed.
        if let Some(at) = self.at.as_mut().filter(|_| leash < self.leash) {
            at.ahead_m = scale(at.ahead_m, leash / self.leash);
        }
        self.leash = leash;
    }

    /// Takes over the state of another path.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        self.estimator.copy_state_from(&other.estimator);
        (self.at, self.way_m) = (other.at, other.way_m);
    }

    /// Advances one tick: the velocity along the surface in its tangent plane, m/s; zero in free space.
    pub(crate) fn update(&mut self, contact: &WrenchContact) -> Vec3 {
        if !contact.touching {
            self.at = None;
            self.estimator.lift();
            return ZERO;
        }
        let (position_m, normal) = (contact.position_m, contact.normal);
        let near = |at: &At| distance(at.position_m, position_m) < LEAP_M;
        if self.at.is_some() && !self.at.as_ref().is_some_and(near) {
            self.at = None;
            self.estimator.lift();
        }
        let mut at = self.at.unwrap_or_else(|| At {
            position_m,
            normal,
            frame: tangents(normal),
            ahead_m: [0.0; 2],
            sheet_m: [0.0; 2],
        });
        let step = along_surface(at.position_m, at.normal, position_m, normal);
        at.frame = carried(at.frame, at.normal, normal);
        let pulled: [f64; 2] = std::array::from_fn(|i| at.ahead_m[i] + dot(step, at.frame[i]));
        let (length_m, leash_m) = (norm(pulled), self.leash * contact.point_uncertainty_m);
        let kept = (1.0 - self.drift) * if length_m > leash_m { leash_m / length_m } else { 1.0 };
        at.ahead_m = scale(pulled, kept);
        let followed = scale(pulled, 1.0 - kept);
        at.sheet_m = add_scaled(at.sheet_m, followed, 1.0);
        (at.position_m, at.normal) = (position_m, normal);
        self.at = Some(at);
        self.way_m += norm(followed);
        let [u, v] = self.estimator.update(at.sheet_m);
        add_scaled(scale(at.frame[0], u), at.frame[1], v)
    }

    /// Delay of slow changes of speed, s.
    pub(crate) fn delay_s(&self) -> f64 {
        self.estimator.delay_s()
    }

    /// Length of the path so far, m.
    pub(crate) fn way_m(&self) -> f64 {
        self.way_m
    }
}

/// The step from one point of a surface to the next, laid into the second point's tangent plane: its length is that of the
/// way over the edge between the two planes.
fn along_surface(from_m: Vec3, from_normal: Vec3, to_m: Vec3, to_normal: Vec3) -> Vec3 {
    let chord = sub(to_m, from_m);
    let axis = cross(from_normal, to_normal);
    let Some(edge) = direction(axis).filter(|_| norm(axis) > 1e-6) else {
        return reject(chord, to_normal);
    };
    // Across the edge, each plane away from the edge.
    let (into_from, into_to) = (cross(edge, from_normal), cross(edge, to_normal));
    // The chord is d_from * into_from + d_to * into_to + along: two equations in the plane across the edge.
    let cos = dot(into_from, into_to);
    let (a, b) = (dot(chord, into_from), dot(chord, into_to));
    let sin_square = 1.0 - cos * cos;
    let (d_from, d_to) = ((a - cos * b) / sin_square, (b - cos * a) / sin_square);
    let straight = add_scaled(scale(edge, dot(chord, edge)), into_to, d_from + d_to);
    // Only where the edge lies between the points does the way lead over it; else the planes are only nearly one.
    let between = d_from * d_to >= -1e-6 * dot(chord, chord);
    if between { straight } else { reject(chord, to_normal) }
}

/// A tangent frame carried over an edge: turned with the normal by the smallest rotation.
fn carried(frame: [Vec3; 2], from_normal: Vec3, to_normal: Vec3) -> [Vec3; 2] {
    let (axis, cos) = (cross(from_normal, to_normal), dot(from_normal, to_normal));
    if cos < -0.999 {
        return tangents(to_normal);
    }
    let turned =
        add_scaled(add_scaled(cross(axis, frame[0]), frame[0], cos), axis, dot(axis, frame[0]) / (1.0 + cos));
    let first = direction(reject(turned, to_normal)).unwrap_or(tangents(to_normal)[0]);
    [first, cross(to_normal, first)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILTER: SpeedFilter = SpeedFilter::Butterworth { order: 2, cutoff_hz: 20.0 };

    fn contact(position_m: Vec3, normal: Vec3) -> WrenchContact {
        WrenchContact {
            touching: true,
            position_m,
            normal,
            face: 0,
            normal_force_n: 1.0,
            friction_n: ZERO,
            residual_m: 0.0,
            uncertainty_m: 2e-4,
            point_uncertainty_m: 2e-4,
            miss_m: 0.0,
        }
    }

    /// A point that goes over the top of a cube and down its side at an angle to the edge.
    fn over_the_edge(s_m: f64) -> WrenchContact {
        let (across, along) = (0.8 * s_m, 0.6 * s_m);
        let half_m = 0.0127;
        if across < half_m {
            contact([across, along, half_m], [0.0, 0.0, 1.0])
        } else {
            contact([half_m, along, half_m - (across - half_m)], [1.0, 0.0, 0.0])
        }
    }

    #[test]
    fn the_speed_over_an_edge_is_the_speed_on_the_face() {
        let mut path = SurfacePath::new(FILTER, 0.0, 1000.0).unwrap();
        for k in 0..500 {
            let velocity = path.update(&over_the_edge(f64::from(k) * 5e-5));
            if k > 150 {
                assert!(
                    (path.estimator.speed_m_s() - 0.05).abs() < 2e-4,
                    "tick {k}: {} m/s",
                    path.estimator.speed_m_s()
                );
                assert!((norm(velocity) - path.estimator.speed_m_s()).abs() < 1e-12);
            }
        }
        assert!((path.way_m() - 499.0 * 5e-5).abs() < 1e-9);
    }

    #[test]
    fn round_a_cylinder_the_way_is_the_perimeter() {
        let mut path = SurfacePath::new(FILTER, 0.0, 1000.0).unwrap();
        let sides = 24.0;
        let apothem_m = 0.012 * (std::f64::consts::PI / sides).cos();
        for k in 0..=4000 {
            let angle = std::f64::consts::TAU * f64::from(k) / 4000.0;
            let middle =
                ((angle / std::f64::consts::TAU * sides).floor() + 0.5) / sides * std::f64::consts::TAU;
            let radius_m = apothem_m / (angle - middle).cos();
            path.update(&contact(
                [radius_m * angle.cos(), radius_m * angle.sin(), 0.0],
                [middle.cos(), middle.sin(), 0.0],
            ));
        }
        let perimeter_m = 2.0 * sides * apothem_m * (std::f64::consts::PI / sides).tan();
        assert!((path.way_m() / perimeter_m - 1.0).abs() < 1e-6, "{} of {perimeter_m}", path.way_m());
    }

    #[test]
    fn a_leash_holds_a_jittering_point_still_and_costs_a_moving_one_nothing() {
        let mut path = SurfacePath::new(FILTER, 0.5, 1000.0).unwrap();
        for k in 0..2000 {
            let jitter = 4e-5 * (f64::from(k) * 0.7).sin();
            path.update(&contact([jitter, -jitter, 0.0], [0.0, 0.0, 1.0]));
            assert!(path.estimator.speed_m_s() < 3e-4, "{}", path.estimator.speed_m_s());
        }
        for k in 0..500 {
            path.update(&contact([f64::from(k) * 4e-5, 0.0, 0.0], [0.0, 0.0, 1.0]));
        }
        assert!((path.estimator.speed_m_s() - 0.04).abs() < 1e-5);
    }

    #[test]
    fn a_shorter_leash_moves_no_pen_that_rests() {
        let mut path = SurfacePath::new(FILTER, 100.0, 1000.0).unwrap();
        let rests = |path: &mut SurfacePath, ticks| {
            (0..ticks).for_each(|_| {
                path.update(&contact([4e-4, 0.0, 0.0], [0.0, 0.0, 1.0]));
            });
            path.estimator.speed_m_s()
        };
        path.update(&contact([0.0; 3], [0.0, 0.0, 1.0]));
        let before_m_s = rests(&mut path, 300);
        path.set_leash(0.5);
        let after_m_s = (0..50).map(|_| rests(&mut path, 1)).fold(0.0, f64::max);
        assert!(after_m_s <= before_m_s, "{after_m_s} m/s, {before_m_s} m/s before");
    }

    #[test]
    fn lifting_the_tool_ends_the_motion() {
        let mut path = SurfacePath::new(FILTER, 0.0, 1000.0).unwrap();
        (0..100).for_each(|k| {
            path.update(&over_the_edge(f64::from(k) * 5e-5));
        });
        let free = WrenchContact { touching: false, ..over_the_edge(0.0) };
        assert_eq!(path.update(&free), ZERO);
        assert_eq!(path.update(&over_the_edge(0.02)), ZERO, "put down elsewhere");
    }
}
