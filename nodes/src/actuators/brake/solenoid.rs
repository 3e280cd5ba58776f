//! The solenoid and its plunger (5.5.3, 5.5.4): force by current, the experimental line, the working range.

/// Largest continuous current, A.
pub const MAX_CURRENT_A: f64 = 0.3;
/// Friction of the free pen with the plunger's weight on the ball: the smallest measured.
pub(crate) const LEAST_FRICTION: f64 = 0.20;
/// Largest measured friction.
pub(crate) const MAX_FRICTION: f64 = 0.52;

/// Constants of a pen's brake, as measured on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solenoid {
    /// Slope of the experimental line: plunger force by normal force, per coefficient of friction. Eq. 5.5.12
    pub line_slope: f64,
    /// The experimental line at a coefficient of zero. Eq. 5.5.12
    pub line_offset: f64,
    /// Force by current squared, N/A2. Eq. 5.5.10
    pub force_n_per_a2: f64,
    /// Weight of the plunger, the least force on the ball, N.
    pub plunger_n: f64,
}

impl Solenoid {
    /// The pen of the thesis.
    pub const THESIS: Self =
        Self { line_slope: 2.92, line_offset: -0.56, force_n_per_a2: 27.8, plunger_n: 0.042 };

    /// Plunger force by normal force for an effective friction, as measured on the pen. Eq. 5.5.12
    pub(crate) fn experimental_phi(&self, mu: f64) -> f64 {
        self.line_slope * mu + self.line_offset
    }

    /// The smallest and the largest friction on the experimental line: no force on the plunger, and as much as presses the
    /// pen itself. Eq. 5.5.12
    pub(crate) fn friction_range(&self) -> [f64; 2] {
        [0.0, 1.0].map(|phi| (phi - self.line_offset) / self.line_slope)
    }

    /// Current for a plunger force, A, without a limit; zero below the plunger's weight. Eq. 5.5.10
    pub fn current_a(&self, plunger_n: f64) -> f64 {
        ((plunger_n - self.plunger_n).max(0.0) / self.force_n_per_a2).sqrt()
    }

    /// Plunger force at a current, N.
    pub(crate) fn plunger_n(&self, current_a: f64) -> f64 {
        self.force_n_per_a2 * current_a * current_a + self.plunger_n
    }

    /// Largest normal force at which a friction can be rendered, N: the current's limit (Fig. 5.22). Infinite if no
    /// current is needed.
    pub fn most_normal_force_n(&self, mu: f64, most_current_a: f64) -> f64 {
        let phi = self.experimental_phi(mu);
        if phi > 0.0 { self.plunger_n(most_current_a) / phi } else { f64::INFINITY }
    }

    /// Largest friction that can be rendered at a normal force (Fig. 5.23), between the free pen's and the largest measured.
    pub fn most_friction_at(&self, normal_n: f64, most_current_a: f64) -> f64 {
        let phi = self.plunger_n(most_current_a) / normal_n;
        ((phi - self.line_offset) / self.line_slope).clamp(LEAST_FRICTION, MAX_FRICTION)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PEN: Solenoid = Solenoid::THESIS;
    /// Magnetic permeability of free space, V s/(A m).
    const PERMEABILITY: f64 = 4e-7 * std::f64::consts::PI;

    /// Field at the open end of a coil, T. Eq. 5.5.6
    fn field_t(current_a: f64, turns_per_m: f64, length_m: f64, radius_m: f64) -> f64 {
        0.5 * PERMEABILITY * current_a * turns_per_m * length_m / length_m.hypot(radius_m)
    }

    /// Holding force of a plunger that fills the coil, N. Eq. 5.5.7, 5.5.8
    fn holding_force_n(field_t: f64, radius_m: f64, relative_permeability: f64) -> f64 {
        let area_m2 = std::f64::consts::PI * radius_m * radius_m;
        area_m2 * field_t * field_t / (2.0 * PERMEABILITY) * (relative_permeability - 1.0)
    }

    fn close(a: f64, b: f64, within: f64) {
        assert!((a - b).abs() < within, "{a} is not {b}");
    }

    #[test]
    fn current_and_force_are_each_others_inverse_above_the_plungers_weight() {
        for force_n in [0.05, 0.5, 1.73, 2.5] {
            close(PEN.plunger_n(PEN.current_a(force_n)), force_n, 1e-14);
        }
        assert_eq!((PEN.current_a(0.042), PEN.current_a(0.01), PEN.current_a(-1.0)), (0.0, 0.0, 0.0));
        close(PEN.plunger_n(MAX_CURRENT_A), 2.544, 1e-12);
    }

    #[test]
    fn the_operating_range_is_that_of_figures_5_22_and_5_23() {
        for (mu, newtons) in [(0.40, 4.18), (0.45, 3.37), (0.50, 2.83), (0.52, 2.65)] {
            close(PEN.most_normal_force_n(mu, MAX_CURRENT_A), newtons, 0.01);
            close(PEN.most_friction_at(PEN.most_normal_force_n(mu, MAX_CURRENT_A), MAX_CURRENT_A), mu, 1e-12);
        }
        close(PEN.most_friction_at(5.0, MAX_CURRENT_A), 0.366, 5e-4);
        assert_eq!(PEN.most_normal_force_n(0.19, MAX_CURRENT_A), f64::INFINITY);
        assert_eq!(PEN.most_friction_at(0.5, MAX_CURRENT_A), MAX_FRICTION);
    }

    #[test]
    fn the_line_of_the_experiment_runs_from_0_192_to_0_534() {
        close((0.0 + 0.56) / 2.92, 0.192, 5e-4);
        close(PEN.experimental_phi(0.534), 1.0, 1e-3);
    }

    #[test]
    fn the_measured_constant_is_a_coil_that_could_be_wound() {
        // 27.8 N/A2 with a permeability of 2780 asks for radius x turns = 142.4, e.g. 2 mm and 71 200 turns/m.
        let field = field_t(1.0, 71_200.0, 1.0, 0.002);
        close(holding_force_n(field, 0.002, 2780.0), PEN.force_n_per_a2, 0.05);
        let short = field_t(1.0, 71_200.0, 0.002, 0.002);
        close(short / field, 0.5_f64.sqrt(), 1e-5);
    }
}
