//! The voice-coil actuator on a tool, as two masses: the magnet (a) hangs by its suspension from the body (h), the
//! body is held by the hand. The current drives one against the other.
//!
//! m_a x_a'' = -k_a (x_a - x_h) - b_a (x_a' - x_h') + K_f i
//! m_h x_h'' =  k_a (x_a - x_h) + b_a (x_a' - x_h') - K_f i - k_h x_h - b_h x_h' + F
//!
//! so that the felt acceleration A = s^2 X_h responds to the current by
//!
//! A/I = -K_f m_a s^4 / [(m_a s^2 + b_a s + k_a)(m_h s^2 + b_h s + k_h) + (b_a s + k_a) m_a s^2]
//!
//! with four zeros at 0 Hz: no current causes a constant acceleration. (Form: McMahan and Kuchenbecker 2014.)

use haptograph_signal::Complex64;
use nalgebra::{Matrix4, Matrix6, Vector4};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Parameters of the two masses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoMass {
    /// Force per current K_f, N/A.
    pub force_n_per_a: f64,
    /// Mass of the magnet m_a, kg.
    pub magnet_kg: f64,
    /// Stiffness of its suspension k_a, N/m.
    pub suspension_n_per_m: f64,
    /// Damping of its suspension b_a, N s/m.
    pub suspension_n_s_per_m: f64,
    /// Mass of the actuator's body, the tool and the part of the hand that moves with them m_h, kg.
    pub body_kg: f64,
    /// Stiffness of the grip k_h, N/m.
    pub hand_n_per_m: f64,
    /// Damping of the grip b_h, N s/m.
    pub hand_n_s_per_m: f64,
}

/// Error of a set of parameters.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(crate) enum TwoMassError {
    /// A parameter is zero, negative or not finite.
    #[error("the actuator's {name} is {value}: give a finite number above zero")]
    NotPositive {
        /// The parameter.
        name: &'static str,
        /// The value.
        value: f64,
    },
}

/// A resonance of the actuator on its tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode {
    /// Undamped natural frequency, Hz.
    pub frequency_hz: f64,
    /// Quality factor; below 1/2 the mode is overdamped.
    pub q: f64,
}

/// Acceleration per current as `gain` s^4 / (s^4 + c_3 s^3 + c_2 s^2 + c_1 s + c_0): all that current and felt
/// acceleration determine of an actuator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Acceleration per current far above the resonances -K_f / m_h, m/s2/A.
    pub gain: f64,
    /// c_3, c_2, c_1, c_0.
    pub denominator: [f64; 4],
}

impl TwoMass {
    /// A Haptuator on a stylus. **Placeholders, not measurements**: the maker's force (about 2.9 N/A) with a magnet,
    /// a suspension and a grip chosen so that the mounted actuator resonates near 100 Hz with a quality near 4.
    /// Replace them by a fit to your own actuator ([`super::identify`]).
    pub(crate) const PLACEHOLDER: Self = Self {
        force_n_per_a: 2.9,
        magnet_kg: 0.006,
        suspension_n_per_m: 2100.0,
        suspension_n_s_per_m: 0.85,
        body_kg: 0.05,
        hand_n_per_m: 500.0,
        hand_n_s_per_m: 3.0,
    };

    /// The parameters, if all are finite and above zero.
    pub(crate) fn checked(self) -> Result<Self, TwoMassError> {
        let named = [
            ("force_n_per_a", self.force_n_per_a),
            ("magnet_kg", self.magnet_kg),
            ("suspension_n_per_m", self.suspension_n_per_m),
            ("suspension_n_s_per_m", self.suspension_n_s_per_m),
            ("body_kg", self.body_kg),
            ("hand_n_per_m", self.hand_n_per_m),
            ("hand_n_s_per_m", self.hand_n_s_per_m),
        ];
        match named.into_iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            Some((name, value)) => Err(TwoMassError::NotPositive { name, value }),
            None => Ok(self),
        }
    }

    /// One actuator of this kind: each parameter up to `tolerance` (a fraction below one) off, by seed.
    pub(crate) fn of_seed(&self, tolerance: f64, seed: u64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut around = |value: f64| value * (1.0 + tolerance * (2.0 * rng.random::<f64>() - 1.0));
        Self {
            force_n_per_a: around(self.force_n_per_a),
            magnet_kg: around(self.magnet_kg),
            suspension_n_per_m: around(self.suspension_n_per_m),
            suspension_n_s_per_m: around(self.suspension_n_s_per_m),
            body_kg: around(self.body_kg),
            hand_n_per_m: around(self.hand_n_per_m),
            hand_n_s_per_m: around(self.hand_n_s_per_m),
        }
    }

    /// The response of the felt acceleration to the current.
    pub fn response(&self) -> Response {
        let (mass_ratio, omega_a, beta_a) = (
            self.magnet_kg / self.body_kg,
            self.suspension_n_per_m / self.magnet_kg,
            self.suspension_n_s_per_m / self.magnet_kg,
        );
        let (omega_h, beta_h) = (self.hand_n_per_m / self.body_kg, self.hand_n_s_per_m / self.body_kg);
        Response {
            gain: -self.force_n_per_a / self.body_kg,
            denominator: [
                beta_a * (1.0 + mass_ratio) + beta_h,
                omega_a * (1.0 + mass_ratio) + omega_h + beta_a * beta_h,
                beta_a * omega_h + beta_h * omega_a,
                omega_a * omega_h,
            ],
        }
    }

    /// dx/dt = A x + B u of the state x = (x_a, x_a', x_h, x_h') and the inputs u = (current, force on the body).
    fn state_space(&self) -> (Matrix4<f64>, [[f64; 2]; 4]) {
        let (m, n) = (self.magnet_kg, self.body_kg);
        let (k, b) = (self.suspension_n_per_m, self.suspension_n_s_per_m);
        let (grip_k, grip_b) = (self.hand_n_per_m, self.hand_n_s_per_m);
        let a = Matrix4::new(
            0.0,
            1.0,
            0.0,
            0.0, //
            -k / m,
            -b / m,
            k / m,
            b / m, //
            0.0,
            0.0,
            0.0,
            1.0, //
            k / n,
            b / n,
            -(k + grip_k) / n,
            -(b + grip_b) / n,
        );
        let force = self.force_n_per_a;
        (a, [[0.0, 0.0], [force / m, 0.0], [0.0, 0.0], [-force / n, 1.0 / n]])
    }

    /// A machine with these parameters; its inputs hold over each tick of `rate_hz`.
    pub(crate) fn machine(&self, rate_hz: f64) -> TwoMassMachine {
        let (a, b) = self.state_space();
        // exp of [A B; 0 0] T holds the state's and the held inputs' transition, exactly.
        let mut block = Matrix6::zeros();
        block.fixed_view_mut::<4, 4>(0, 0).copy_from(&a);
        for (row, inputs) in b.iter().enumerate() {
            block[(row, 4)] = inputs[0];
            block[(row, 5)] = inputs[1];
        }
        let transition = (block / rate_hz).exp();
        TwoMassMachine {
            transition: std::array::from_fn(|j| std::array::from_fn(|i| transition[(i, j)])),
            rate_hz,
            state: [0.0; 4],
            acceleration_m_s2: 0.0,
        }
    }
}

impl Response {
    /// Acceleration per current at a frequency, m/s2/A.
    pub fn at(&self, frequency_hz: f64) -> Complex64 {
        let s = Complex64::new(0.0, std::f64::consts::TAU * frequency_hz);
        let [c3, c2, c1, c0] = self.denominator;
        s.powi(4) * self.gain / ((((s + c3) * s + c2) * s + c1) * s + c0)
    }

    /// The two quadratics s^2 + (w/q) s + w^2 whose product is the denominator, the higher frequency first.
    ///
    /// Returns none if the denominator is not a stable pair of modes.
    pub(crate) fn modes(&self) -> Option<[Mode; 2]> {
        let factors = quadratic_factors(self.denominator)?;
        let mut modes = factors.map(|[linear, constant]| Mode {
            frequency_hz: constant.sqrt() / std::f64::consts::TAU,
            q: constant.sqrt() / linear,
        });
        if !modes.iter().all(|mode| mode.frequency_hz.is_finite() && mode.q > 0.0) {
            return None;
        }
        modes.sort_by(|a, b| b.frequency_hz.total_cmp(&a.frequency_hz));
        Some(modes)
    }
}

/// s^4 + c_3 s^3 + c_2 s^2 + c_1 s + c_0 as the product of two real quadratics [linear, constant].
fn quadratic_factors([c3, c2, c1, c0]: [f64; 4]) -> Option<[[f64; 2]; 2]> {
    // Scaled to roots of about 1, so that the eigenvalues of the companion matrix are well conditioned.
    let unit = c0.abs().powf(0.25);
    if !(unit > 0.0 && unit.is_finite()) {
        return None;
    }
    let companion = Matrix4::new(
        -c3 / unit,
        -c2 / unit.powi(2),
        -c1 / unit.powi(3),
        -c0 / unit.powi(4), //
        1.0,
        0.0,
        0.0,
        0.0, //
        0.0,
        1.0,
        0.0,
        0.0, //
        0.0,
        0.0,
        1.0,
        0.0,
    );
    let roots = companion.complex_eigenvalues();
    let mut upper: Vec<Complex64> = roots.iter().copied().filter(|r| r.im > 0.0).collect();
    let mut real: Vec<f64> = roots.iter().filter(|r| r.im == 0.0).map(|r| r.re).collect();
    real.sort_by(f64::total_cmp);
    let mut factors = Vec::with_capacity(2);
    upper.drain(..).for_each(|r| factors.push([-2.0 * r.re * unit, r.norm_sqr() * unit * unit]));
    real.chunks_exact(2).for_each(|r| factors.push([-(r[0] + r[1]) * unit, r[0] * r[1] * unit * unit]));
    factors.try_into().ok()
}

/// Two masses in motion, stepped exactly for inputs held over each tick. It is labelled simulated wherever it is shown.
#[derive(Debug, Clone)]
pub(crate) struct TwoMassMachine {
    /// What each state and each input does to the next states: columns, so that the states are computed side by side.
    transition: [[f64; 4]; 6],
    rate_hz: f64,
    state: [f64; 4],
    acceleration_m_s2: f64,
}

/// Measurable state of a [`TwoMassMachine`] at a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TwoMassReading {
    /// Acceleration of the body, which the hand feels, m/s2: the mean over the last tick (an instantaneous value
    /// would alias the steps of the held current).
    pub acceleration_m_s2: f64,
    /// Displacement of the body, m.
    pub body_m: f64,
    /// Displacement of the magnet relative to the body, m: the stroke that the housing must allow.
    pub stroke_m: f64,
}

impl TwoMassMachine {
    /// Advances one tick under a current and an external force on the body, both held. NaN and infinity count as zero.
    pub(crate) fn advance(&mut self, current_a: f64, force_n: f64) {
        let [current_a, force_n] = [current_a, force_n].map(|u| if u.is_finite() { u } else { 0.0 });
        let [magnet_m, magnet_m_s, body_m, body_m_s] = self.state;
        let [a, b, c, d, e, f] = &self.transition;
        let mut next = [0.0; 4];
        for i in 0..4 {
            next[i] = a[i] * magnet_m
                + b[i] * magnet_m_s
                + c[i] * body_m
                + d[i] * body_m_s
                + e[i] * current_a
                + f[i] * force_n;
        }
        // Flush denormals, which are slow.
        self.state = if next.iter().all(|x| x.abs() < 1e-30) { [0.0; 4] } else { next };
        self.acceleration_m_s2 = (self.state[3] - body_m_s) * self.rate_hz;
    }

    /// The state at this tick.
    pub(crate) fn read(&self) -> TwoMassReading {
        TwoMassReading {
            acceleration_m_s2: self.acceleration_m_s2,
            body_m: self.state[2],
            stroke_m: self.state[0] - self.state[2],
        }
    }

    /// Acceleration per current of the machine at a frequency: current held over a tick, the tick's mean
    /// acceleration read at its end, m/s2/A.
    pub(crate) fn response_at(&self, frequency_hz: f64) -> Complex64 {
        let z = Complex64::from_polar(1.0, std::f64::consts::TAU * frequency_hz / self.rate_hz);
        let a = Matrix4::from_fn(|i, j| Complex64::from(self.transition[j][i]));
        let b = Vector4::from_fn(|i, _| Complex64::from(self.transition[4][i]));
        let state = (Matrix4::from_diagonal_element(z) - a).lu().solve(&b).unwrap_or_else(Vector4::zeros);
        state[3] * (Complex64::from(1.0) - z.inv()) * self.rate_hz
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 10_000.0;

    #[test]
    fn the_placeholder_resonates_near_100_hz_with_a_quality_near_4() {
        let [high, low] = TwoMass::PLACEHOLDER.response().modes().unwrap();
        assert!((high.frequency_hz - 100.0).abs() < 5.0 && (high.q - 4.0).abs() < 0.5, "{high:?}");
        assert!(low.frequency_hz < 20.0, "{low:?}");
    }

    #[test]
    fn the_response_is_the_one_of_the_state_space() {
        let actuator = TwoMass::PLACEHOLDER;
        let (a, b) = actuator.state_space();
        let response = actuator.response();
        for frequency_hz in [1.0, 20.0, 99.0, 104.0, 500.0, 3000.0] {
            let s = Complex64::new(0.0, std::f64::consts::TAU * frequency_hz);
            let input = Vector4::from_fn(|i, _| Complex64::from(b[i][0]));
            let state =
                (Matrix4::from_diagonal_element(s) - a.map(Complex64::from)).lu().solve(&input).unwrap();
            let direct = state[2] * s * s;
            assert!((direct - response.at(frequency_hz)).norm() < 1e-9 * direct.norm());
        }
    }

    #[test]
    fn a_current_step_leaves_no_lasting_acceleration() {
        let mut machine = TwoMass::PLACEHOLDER.machine(RATE_HZ);
        machine.advance(0.1, 0.0);
        let first = machine.read().acceleration_m_s2;
        assert!((first + 0.1 * 2.9 / 0.05).abs() < 0.2 * first.abs(), "recoil first: {first}");
        (0..20_000).for_each(|_| machine.advance(0.1, 0.0));
        assert!(machine.read().acceleration_m_s2.abs() < 1e-9);
        let stroke_m = machine.read().stroke_m;
        assert!((stroke_m - 0.29 / 2100.0).abs() < 1e-9, "the suspension carries the force: {stroke_m}");
    }

    #[test]
    fn the_machine_plays_the_response() {
        let actuator = TwoMass::PLACEHOLDER;
        for frequency_hz in [40.0, 100.0, 250.0, 500.0] {
            let mut machine = actuator.machine(RATE_HZ);
            let omega = std::f64::consts::TAU * frequency_hz / RATE_HZ;
            let (mut seen, mut sum) = (Complex64::new(0.0, 0.0), 0.0);
            for k in 0..40_000 {
                machine.advance((omega * f64::from(k)).cos(), 0.0);
                if k >= 20_000 {
                    // read() belongs to tick k + 1.
                    let turn = Complex64::from_polar(1.0, -omega * f64::from(k + 1));
                    seen += turn * machine.read().acceleration_m_s2 * 2.0;
                    sum += 1.0;
                }
            }
            let (seen, expected) = (seen / sum, machine.response_at(frequency_hz));
            assert!((seen - expected).norm() < 2e-3 * expected.norm(), "{seen} {expected}");
            let continuous = actuator.response().at(frequency_hz).norm();
            assert!((expected.norm() / continuous - 1.0).abs() < 0.02, "{frequency_hz} Hz");
        }
    }

    #[test]
    fn quartics_factor_into_what_they_were_made_of() {
        for [a, b] in [[[80.0, 4e5], [60.0, 1e4]], [[300.0, 1e4], [80.0, 4e5]], [[2000.0, 1e4], [900.0, 2e4]]]
        {
            let product = [a[0] + b[0], a[1] + b[1] + a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[1] * b[1]];
            let [f, g] = quadratic_factors(product).unwrap();
            let again = [f[0] + g[0], f[1] + g[1] + f[0] * g[0], f[0] * g[1] + f[1] * g[0], f[1] * g[1]];
            for (x, y) in product.iter().zip(&again) {
                assert!((x - y).abs() < 1e-9 * x);
            }
        }
    }

    #[test]
    fn parameters_that_are_no_actuator_are_refused() {
        let broken = TwoMass { magnet_kg: 0.0, ..TwoMass::PLACEHOLDER };
        assert_eq!(broken.checked(), Err(TwoMassError::NotPositive { name: "magnet_kg", value: 0.0 }));
    }
}
