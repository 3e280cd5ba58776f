//! The normal force of a surface, and whether a sampled loop renders it passively.

use super::Contact;
use crate::vector::{Vec3, dot};

/// A wall: Hooke's law along the normal, with optional damping. It pushes and never pulls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wall {
    /// Stiffness K, N/m. The thesis: 250 (4.3) and 500 (A.3.2).
    pub stiffness_n_per_m: f64,
    /// Damping B of the motion along the normal, N s/m. The thesis has none.
    pub damping_n_s_per_m: f64,
}

impl Wall {
    /// Magnitude of the normal force on the tool, N, moving at `velocity_m_s`.
    #[inline]
    pub(crate) fn force_n(&self, contact: &Contact, velocity_m_s: Vec3) -> f64 {
        if !contact.touching {
            return 0.0;
        }
        let leaving_m_s = dot(velocity_m_s, contact.normal);
        let force_n = self.stiffness_n_per_m * contact.penetration_m - self.damping_n_s_per_m * leaving_m_s;
        force_n.max(0.0)
    }

    /// Passivity of the wall rendered by a device of this viscous damping at this sample rate.
    pub(crate) fn passivity(&self, device_n_s_per_m: f64, rate_hz: f64) -> Passivity {
        // b > K T / 2 + |B|
        let needed_n_s_per_m = 0.5 * self.stiffness_n_per_m / rate_hz + self.damping_n_s_per_m.abs();
        let room = device_n_s_per_m - self.damping_n_s_per_m.abs();
        Passivity {
            passive: device_n_s_per_m > needed_n_s_per_m,
            needed_n_s_per_m,
            most_stiffness_n_per_m: (2.0 * rate_hz * room).max(0.0),
        }
    }
}

/// Colgate's passivity bound of a wall on a device.
///
/// A sampled wall (position sampled, backward difference for the velocity, force held) coupled to a device of viscous
/// damping b is passive for any hand if and only if b > K T / 2 + |B| (Colgate and Schenkel 1997, "Passivity of a class of
/// sampled-data systems"; the case of the general condition
/// b > T/2 / (1 - cos wT) Re[(1 - exp(-jwT)) H(exp(jwT))] for H(z) = K + B (z - 1)/(T z)). We have not seen the paper itself;
/// the general condition is quoted in Brown's thesis of the same group (1995), and the tests here evaluate it on all
/// frequencies and find the same bound. It holds for damping of the device alone: dry friction and position steps are not
/// in it (Abbott and Okamura 2005), nor is the hand's own damping, which helps. A wall beyond the bound gives a warning; it is no
/// proof of trouble.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Passivity {
    /// True if the bound holds.
    pub passive: bool,
    /// Device damping above which it does, N s/m.
    pub needed_n_s_per_m: f64,
    /// Stiffness below which it does with this damping, N/m.
    pub most_stiffness_n_per_m: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::Complex64;

    fn contact(penetration_m: f64) -> Contact {
        Contact { touching: true, penetration_m, normal: [0.0, 0.0, 1.0], ..Contact::free([0.0; 3]) }
    }

    #[test]
    fn a_wall_pushes_by_hookes_law_and_never_pulls() {
        let wall = Wall { stiffness_n_per_m: 250.0, damping_n_s_per_m: 2.0 };
        assert_eq!(wall.force_n(&contact(0.004), [0.0; 3]), 1.0);
        assert_eq!(wall.force_n(&contact(0.004), [9.0, 0.0, -0.1]), 1.2);
        assert_eq!(wall.force_n(&contact(0.004), [0.0, 0.0, 1.0]), 0.0);
        assert_eq!(wall.force_n(&Contact::free([0.0; 3]), [0.0, 0.0, -1.0]), 0.0);
    }

    /// The general condition, by looking at every frequency.
    fn least_damping(wall: &Wall, rate_hz: f64) -> f64 {
        let period_s = 1.0 / rate_hz;
        (1..100_000)
            .map(|k| std::f64::consts::PI * f64::from(k) / 100_000.0)
            .map(|angle| {
                let z = Complex64::from_polar(1.0, angle);
                let wall_at = (z - 1.0) / z * (wall.damping_n_s_per_m / period_s) + wall.stiffness_n_per_m;
                0.5 * period_s / (1.0 - angle.cos()) * ((Complex64::from(1.0) - z.inv()) * wall_at).re
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn the_bound_is_the_worst_case_of_the_general_condition() {
        for (stiffness_n_per_m, damping_n_s_per_m) in [(250.0, 0.0), (500.0, 1.0), (2300.0, -0.5), (0.0, 2.0)]
        {
            let wall = Wall { stiffness_n_per_m, damping_n_s_per_m };
            let needed = wall.passivity(0.0, 1000.0).needed_n_s_per_m;
            let looked_up = least_damping(&wall, 1000.0);
            assert!((needed - looked_up).abs() < 1e-6 * needed, "{wall:?}: {needed} {looked_up}");
        }
    }

    /// A mass on the wall, sampled and held, stepped exactly between ticks: does its oscillation die or grow?
    fn oscillation_grows(wall: &Wall, device_n_s_per_m: f64, mass_kg: f64) -> bool {
        let (period_s, decay) = (1e-3, device_n_s_per_m / mass_kg);
        let keep = (-decay * period_s).exp();
        let (mut x, mut v) = (1e-3, 0.0);
        let mut peaks = [0.0_f64; 2];
        for tick in 0..40_000 {
            // Two-sided, so that the mass stays on it; the bound's linear case.
            let settled = -wall.stiffness_n_per_m * x / device_n_s_per_m;
            x += settled * period_s + (v - settled) * (1.0 - keep) / decay;
            v = settled + (v - settled) * keep;
            let half = &mut peaks[usize::from(tick >= 20_000)];
            *half = half.max(x.abs());
        }
        peaks[1] > peaks[0]
    }

    #[test]
    fn inside_the_bound_nothing_grows_and_far_outside_a_free_device_does() {
        let wall = Wall { stiffness_n_per_m: 500.0, damping_n_s_per_m: 0.0 };
        for mass_kg in [0.01, 0.045, 0.1, 1.0] {
            assert!(wall.passivity(0.26, 1000.0).passive);
            assert!(!oscillation_grows(&wall, 0.26, mass_kg));
            assert!(!wall.passivity(0.2, 1000.0).passive);
            assert!(oscillation_grows(&wall, 0.2, mass_kg), "{mass_kg} kg");
        }
    }

    #[test]
    fn the_bound_names_the_stiffness_that_could_be_had() {
        let wall = Wall { stiffness_n_per_m: 500.0, damping_n_s_per_m: 0.0 };
        let verdict = wall.passivity(0.1, 1000.0);
        assert!(!verdict.passive);
        assert_eq!((verdict.needed_n_s_per_m, verdict.most_stiffness_n_per_m), (0.25, 200.0));
    }
}
