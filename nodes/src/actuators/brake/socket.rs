//! Statics of the ball in its socket, in two dimensions (5.3.4, 5.5.2), all forces by the user's normal force N.
//!
//! The printed second line of Eq. 5.5.5 has the sign of sqrt(2) mu_b wrong; here it is solved anew. The model is a test of
//! understanding only: above mu = 0.31 its second bearing would have to pull (see [`unloading`]), while the real pen, which
//! has four bearings and a wall around them, is linear up to 0.52. The brake is driven by the experimental line,
//! [`super::Solenoid::experimental_phi`].

use std::f64::consts::SQRT_2;

/// Loads in the socket, as fractions of the normal force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loads {
    /// Friction of the pen on the surface, F / N: the effective coefficient of friction.
    pub friction: f64,
    /// Load of the bearing ahead, N_b1 / N.
    pub bearing_1: f64,
    /// Load of the bearing behind, N_b2 / N; negative where it would have to pull.
    pub bearing_2: f64,
}

/// The balance of Eq. 5.5.1 to 5.5.3 (5.3.1 to 5.3.3 with phi = 0) for friction mu_b at the bearings, mu_s at the plunger and a
/// plunger force phi N.
pub fn loads(mu_b: f64, mu_s: f64, phi: f64) -> Loads {
    // The moments give F = mu_b (N_b1 + N_b2) + mu_s phi; it is put into the two force balances.
    let sin = 0.5 * SQRT_2;
    let (a1, a2, a) = ((1.0 - mu_b) * sin - mu_b, -(1.0 + mu_b) * sin - mu_b, 2.0 * mu_s * phi);
    let (c1, c2, c) = ((1.0 + mu_b) * sin, (1.0 - mu_b) * sin, 1.0 - phi);
    let determinant = a1 * c2 - a2 * c1;
    let bearing_1 = (a * c2 - a2 * c) / determinant;
    let bearing_2 = (a1 * c - a * c1) / determinant;
    Loads { friction: mu_b * (bearing_1 + bearing_2) + mu_s * phi, bearing_1, bearing_2 }
}

/// Friction of the free pen: the smallest that can be rendered.
pub fn free_friction(mu_b: f64) -> f64 {
    SQRT_2 * mu_b / (1.0 + (1.0 + SQRT_2) * mu_b * mu_b)
}

/// Friction at the bearings that makes a free pen's friction; none above 0.455, which no bearing can make. The thesis's
/// 0.17 gives 0.1247 (printed as 0.12).
pub fn bearing_friction(free_friction: f64) -> Option<f64> {
    let k = 1.0 + SQRT_2;
    let under_root = 2.0 - 4.0 * k * free_friction * free_friction;
    // The smaller root, in the form that does not cancel.
    (under_root >= 0.0).then(|| 2.0 * free_friction / (SQRT_2 + under_root.sqrt()))
}

/// Plunger force by normal force that makes an effective friction mu. Eq. 5.5.5, corrected
pub fn phi(mu: f64, mu_b: f64, mu_s: f64) -> f64 {
    let square = mu_b * mu_b;
    (mu * (square * (SQRT_2 + 1.0) + 1.0) - SQRT_2 * mu_b)
        / (mu_s - square * mu_s * (SQRT_2 - 1.0) - SQRT_2 * mu_b)
}

/// Friction with the plunger pressed as hard as the pen itself (phi = 1): the largest that can be rendered.
pub fn most_friction(mu_b: f64, mu_s: f64) -> f64 {
    let square = mu_b * mu_b;
    mu_s * (1.0 - (SQRT_2 - 1.0) * square) / (1.0 + (1.0 + SQRT_2) * square)
}

/// The point at which the rear bearing loses its load: (phi, mu). Beyond it the model is not physical.
pub fn unloading(mu_b: f64, mu_s: f64) -> (f64, f64) {
    // N_b2 is linear in phi.
    let (at_rest, at_full) = (loads(mu_b, mu_s, 0.0).bearing_2, loads(mu_b, mu_s, 1.0).bearing_2);
    let phi = at_rest / (at_rest - at_full);
    (phi, loads(mu_b, mu_s, phi).friction)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, within: f64) {
        assert!((a - b).abs() < within, "{a} is not {b}");
    }

    #[test]
    fn the_loads_balance() {
        for (mu_b, mu_s, phi) in [(0.12, 0.6, 0.0), (0.1247, 0.6, 0.3), (0.2, 0.4, 0.9)] {
            let Loads { friction, bearing_1, bearing_2 } = loads(mu_b, mu_s, phi);
            let sin = 0.5_f64.sqrt();
            let x = -friction - mu_b * bearing_1 * sin + bearing_1 * sin
                - mu_s * phi
                - mu_b * bearing_2 * sin
                - bearing_2 * sin;
            let y = 1.0 - mu_b * bearing_1 * sin - bearing_1 * sin - phi + mu_b * bearing_2 * sin
                - bearing_2 * sin;
            let moment = -friction + mu_b * (bearing_1 + bearing_2) + mu_s * phi;
            assert!(x.abs() < 1e-14 && y.abs() < 1e-14 && moment.abs() < 1e-14);
        }
    }

    #[test]
    fn closed_forms_are_the_balance() {
        for mu_b in [0.05, 0.12, 0.1247, 0.2] {
            close(free_friction(mu_b), loads(mu_b, 0.6, 0.0).friction, 1e-14);
            close(bearing_friction(free_friction(mu_b)).unwrap(), mu_b, 1e-14);
            close(most_friction(mu_b, 0.6), loads(mu_b, 0.6, 1.0).friction, 1e-14);
            for wanted in [0.1, 0.25, 0.4] {
                close(phi(loads(mu_b, 0.6, wanted).friction, mu_b, 0.6), wanted, 1e-13);
            }
        }
        assert_eq!(bearing_friction(0.5), None);
    }

    #[test]
    fn the_numbers_of_the_thesis_with_its_slips_put_right() {
        close(bearing_friction(0.17).unwrap(), 0.1247, 5e-5);
        close(free_friction(0.12), 0.164, 5e-4);
        // phi = 2.425 mu - 0.398 with the printed 0.12
        close(phi(1.0, 0.12, 0.6) - phi(0.0, 0.12, 0.6), 2.425, 5e-4);
        close(phi(0.0, 0.12, 0.6), -0.398, 5e-4);
        close(most_friction(0.12, 0.6), 0.5764, 5e-5);
        // phi = 2.472 mu - 0.420 with the exact root
        close(phi(1.0, 0.1247, 0.6) - phi(0.0, 0.1247, 0.6), 2.472, 1e-3);
        close(phi(0.0, 0.1247, 0.6), -0.420, 5e-4);
        close(most_friction(0.1247, 0.6), 0.5746, 5e-5);
    }

    #[test]
    fn the_second_bearing_unloads_at_the_force_that_the_thesis_prints() {
        let (phi, mu) = unloading(0.12, 0.6);
        close(mu, 0.3066, 5e-5);
        close(phi, 0.3458, 5e-5);
        close(5.0 * phi, 1.73, 2e-3);
        assert!(loads(0.12, 0.6, phi + 0.01).bearing_2 < 0.0);
    }

    #[test]
    fn theory_is_within_a_tenth_of_the_experiment_and_less_steep() {
        let experiment = |mu| super::super::Solenoid::THESIS.experimental_phi(mu);
        for k in 20..=52 {
            let mu = f64::from(k) / 100.0;
            close(phi(mu, 0.12, 0.6), experiment(mu), 0.1);
        }
        assert!(phi(1.0, 0.12, 0.6) - phi(0.0, 0.12, 0.6) < experiment(1.0) - experiment(0.0));
    }
}
