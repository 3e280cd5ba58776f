//! Coulomb friction with a viscous region around rest, the law of the public toolkit (A.3.2).
//!
//! F = F_n min(b v, mu) against the motion: viscous below v_th = mu / b (Eq. A.3.1), Coulomb above. The toolkit's code
//! multiplies the viscous branch by mu once more, which makes the force jump by the factor mu at v_th; this is the law of
//! the text, without the jump. Rough surfaces stay viscous up to high speeds: mu = 1.39 slides only above 347 mm/s.

use crate::vector::{Vec3, ZERO, norm, reject, scale};

/// The law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ViscousCoulomb {
    /// Slope b of the viscous region by normal force, s/m.
    pub slope_s_per_m: f64,
}

impl Default for ViscousCoulomb {
    /// b = 0.004 s/mm
    fn default() -> Self {
        Self { slope_s_per_m: 4.0 }
    }
}

impl ViscousCoulomb {
    /// Friction on the tool, N, at a velocity (its normal component is ignored), a normal force and a coefficient of
    /// friction. It is zero if one of them is not finite.
    #[inline]
    pub(crate) fn force_n(&self, velocity_m_s: Vec3, normal: Vec3, load_n: f64, mu: f64) -> Vec3 {
        let along = reject(velocity_m_s, normal);
        let speed_m_s = norm(along);
        let size_n = load_n.max(0.0) * (self.slope_s_per_m * speed_m_s).min(mu);
        if speed_m_s > 0.0 && size_n.is_finite() { scale(along, -size_n / speed_m_s) } else { ZERO }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: Vec3 = [0.0, 0.0, 1.0];

    #[test]
    fn thresholds_are_those_of_the_thesis() {
        let law = ViscousCoulomb::default();
        assert!((0.17 / law.slope_s_per_m - 0.0425).abs() < 1e-15);
        assert!((1.39 / law.slope_s_per_m - 0.3475).abs() < 1e-15);
    }

    #[test]
    fn viscous_below_coulomb_above_and_no_jump_between() {
        let law = ViscousCoulomb::default();
        let at = |v: f64| law.force_n([v, 0.0, -3.0], UP, 2.0, 0.3)[0];
        assert_eq!(at(0.0), 0.0);
        assert!((at(0.01) + 2.0 * 4.0 * 0.01).abs() < 1e-15);
        assert!((at(0.5) + 0.6).abs() < 1e-15 && (at(-0.5) - 0.6).abs() < 1e-15);
        let threshold = 0.3 / law.slope_s_per_m;
        assert!((at(threshold * (1.0 - 1e-9)) - at(threshold * (1.0 + 1e-9))).abs() < 1e-8);
    }

    #[test]
    fn friction_opposes_motion_within_mu_and_takes_energy() {
        let law = ViscousCoulomb::default();
        for k in 0..1000 {
            let angle = f64::from(k) * 0.1;
            let velocity = [0.3 * angle.sin(), 0.2 * (1.7 * angle).cos(), 0.1];
            let force = law.force_n(velocity, UP, 1.5, 0.5);
            assert!(norm(force) <= 0.75 * (1.0 + 1e-12) && force[2] == 0.0);
            assert!(crate::vector::dot(force, velocity) <= 0.0);
        }
    }

    #[test]
    fn a_fault_gives_no_force() {
        let law = ViscousCoulomb::default();
        assert_eq!(law.force_n([f64::NAN, 0.0, 0.0], UP, 1.0, 0.5), ZERO);
        assert_eq!(law.force_n([0.1, 0.0, 0.0], UP, f64::INFINITY, 0.5), ZERO);
        assert_eq!(law.force_n([0.1, 0.0, 0.0], UP, -1.0, 0.5), ZERO);
    }
}
