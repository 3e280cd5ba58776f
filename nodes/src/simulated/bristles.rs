//! Friction of a tip that sticks and slips: bristles after LuGre (Canudas de Wit, Olsson, Åström and Lischinsky 1995), whose strength
//! ages while they hold (Dieterich 1979; Ruina 1983) and is lost over a distance of slip.
//!
//! The stretch z follows dz/dt = v - |v| z / z_max, the age dT/dt = 1 - |v| T / D, and friction by normal force is
//! mu (z + t dz/dt) / z_0, with z_max = z_0 (1 + (r - 1) ln(1 + T / T_0) / ln(1 + 1 s / T_0)): r after 1 s at rest.

use super::material::Material;
use crate::vector::norm;

/// Stretch at kinetic friction z_0, m.
const STRETCH_M: f64 = 1e-5;
/// Slip that renews the contact D, m.
const SLIP_M: f64 = 3e-5;
/// Age from which the strength grows T_0, s.
const YOUNG_S: f64 = 5e-3;
/// Damping of the bristles t, s: about a fifth of critical under the tool of the recordings at 1 N.
const DAMPING_S: f64 = 2e-4;

/// The bristles under one tip.
#[derive(Debug, Clone)]
pub(super) struct Bristles {
    friction: f64,
    static_ratio: f64,
    stretch_m: [f64; 2],
    age_s: f64,
}

impl Bristles {
    /// Of a material, at rest and young.
    pub(super) fn new(material: &Material) -> Self {
        Self {
            friction: material.friction,
            static_ratio: material.static_ratio,
            stretch_m: [0.0; 2],
            age_s: 0.0,
        }
    }

    /// Lets the tip go.
    pub(super) fn lift(&mut self) {
        (self.stretch_m, self.age_s) = ([0.0; 2], 0.0);
    }

    /// Friction along x and y by normal force, against the motion, after a step at a velocity (implicit Euler).
    pub(super) fn step(&mut self, velocity_m_s: [f64; 2], step_s: f64) -> [f64; 2] {
        let way_m = norm(velocity_m_s) * step_s;
        self.age_s = (self.age_s + step_s) / (1.0 + way_m / SLIP_M);
        let aged = (self.age_s / YOUNG_S).ln_1p() / (1.0 / YOUNG_S).ln_1p();
        let most_m = STRETCH_M * (1.0 + (self.static_ratio - 1.0) * aged);
        let before_m = self.stretch_m;
        self.stretch_m =
            std::array::from_fn(|i| (before_m[i] + velocity_m_s[i] * step_s) / (1.0 + way_m / most_m));
        std::array::from_fn(|i| {
            let rate_m_s = (self.stretch_m[i] - before_m[i]) / step_s;
            -self.friction * (self.stretch_m[i] + DAMPING_S * rate_m_s) / STRETCH_M
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulated::material::MaterialName;

    /// Peak and last friction while the tip is pulled at a speed after a rest.
    fn pulled(rest_s: f64, speed_m_s: f64) -> (f64, f64) {
        let mut bristles = Bristles::new(&Material::of(MaterialName::T5));
        let step_s = 1e-5;
        (0..(rest_s / step_s) as u32).for_each(|_| _ = bristles.step([0.0; 2], step_s));
        let friction = |_| -bristles.step([speed_m_s, 0.0], step_s)[0];
        let all: Vec<f64> = (0..(2e-3 / speed_m_s / step_s) as u32).map(friction).collect();
        (all.iter().copied().fold(0.0, f64::max), all[all.len() - 1])
    }

    #[test]
    fn friction_peaks_at_break_away_the_higher_the_longer_it_stuck_and_falls_with_speed() {
        let material = Material::of(MaterialName::T5);
        let ((short, slow), (long, same)) = (pulled(0.1, 0.01), pulled(1.0, 0.01));
        assert!(short > 1.2 * material.friction && long > 1.1 * short, "{short} {long}");
        assert!(long < 1.1 * material.friction * material.static_ratio, "{long}");
        let fast = pulled(1.0, 0.2).1;
        assert!((slow / same - 1.0).abs() < 1e-3 && slow > 1.05 * fast, "{slow} {same} {fast}");
        assert!((fast / material.friction - 1.0).abs() < 0.1, "{fast}");
    }
}
