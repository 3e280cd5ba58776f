//! Dynamic compensation of a voice-coil actuator (3.1.2): computes the current for a requested acceleration
//! by an inverse of the actuator's response.
//!
//! The response A/I = g s^4 / D(s) has four zeros at rest, so its inverse alone would have four integrators. In
//! cascade with a fourth-order Butterworth high-pass s^4 / B(s) they cancel: C(s) = D(s) / (g B(s)) is stable, of
//! bounded gain, and commanded to felt acceleration becomes the high-pass itself. Discretised by the bilinear rule
//! (+0.04 dB at 500 Hz and 10 kHz). Magnitudes only: the converters of the chain may invert or delay.

use super::two_mass::{Mode, Response};
use haptograph_signal::filter::{Biquad, Sections, SectionsState};
use std::f64::consts::TAU;

/// Default corner of the high-pass, Hz.
pub(crate) const CORNER_HZ: f64 = 20.0;
/// Default bound of the current per acceleration, A/(m/s2).
pub(crate) const MOST_A_PER_M_S2: f64 = 0.5;
/// Lowest corner, Hz.
pub(crate) const LEAST_CORNER_HZ: f64 = 0.1;

/// Error of the design of a compensator.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(crate) enum CompensatorError {
    /// The response is not that of a stable actuator.
    #[error("the actuator's response has no two stable modes: fit it again or check its parameters")]
    NoActuator,
    /// The corner is not between zero and half the rate.
    #[error("the corner {corner_hz} Hz must lie above zero and below half the rate {rate_hz} Hz")]
    Corner {
        /// The requested corner, or the last one of the search for a bounded gain.
        corner_hz: f64,
        /// The rate at which the compensator runs.
        rate_hz: f64,
    },
    /// More current is needed even far above the resonances.
    #[error(
        "the actuator needs {needed_a_per_m_s2:.3} A for 1 m/s2 even above its resonances: allow at least that current"
    )]
    Gain {
        /// 1/|g|.
        needed_a_per_m_s2: f64,
    },
}

/// Converts commanded acceleration into current. Allocates only when designed.
#[derive(Debug, Clone)]
pub(crate) struct Compensator {
    corner_hz: f64,
    /// The lowest corner at which the gain keeps its bound.
    least_corner_hz: f64,
    modes: [Mode; 2],
    gain: f64,
    rate_hz: f64,
    filter: Sections,
    state: SectionsState,
}

impl Compensator {
    /// The compensator for an actuator, run at `rate_hz` (10 kHz or more to hold its accuracy up to 500 Hz). Commanded to
    /// felt acceleration follows a high-pass with its corner at `corner_hz`. If the inverse there needs more current per
    /// acceleration than `most_a_per_m_s2` at any frequency, the corner moves up until it does not.
    pub(crate) fn design(
        actuator: &Response,
        corner_hz: f64,
        most_a_per_m_s2: f64,
        rate_hz: f64,
    ) -> Result<Self, CompensatorError> {
        let modes = actuator.modes().ok_or(CompensatorError::NoActuator)?;
        let needed_a_per_m_s2 = 1.0 / actuator.gain.abs();
        if needed_a_per_m_s2 > most_a_per_m_s2 {
            return Err(CompensatorError::Gain { needed_a_per_m_s2 });
        }
        let asked_hz = corner_hz;
        let mut corner_hz = corner_hz;
        while in_band(corner_hz, rate_hz) && most_gain(actuator, corner_hz) > most_a_per_m_s2 {
            corner_hz *= 1.01;
        }
        if !in_band(corner_hz, rate_hz) {
            return Err(CompensatorError::Corner { corner_hz, rate_hz });
        }
        let least_corner_hz = match corner_hz > asked_hz {
            true => corner_hz,
            false => least_corner_hz(actuator, most_a_per_m_s2, corner_hz),
        };
        let filter = Sections { sections: sections(modes, actuator.gain, corner_hz, rate_hz).into() };
        let state = SectionsState::new(&filter);
        Ok(Self { corner_hz, least_corner_hz, modes, gain: actuator.gain, rate_hz, filter, state })
    }

    /// Converts commanded accelerations, m/s2, into currents, A, in place.
    pub(crate) fn process(&mut self, samples: &mut [f64]) {
        self.state.process_in_place(samples);
    }

    /// Moves the corner of the high-pass, Hz, as far as the bound of the gain allows; the filter goes on from what it
    /// holds. Does not allocate.
    pub(crate) fn turn(&mut self, corner_hz: f64) {
        self.corner_hz = corner_hz.max(self.least_corner_hz);
        let sections = sections(self.modes, self.gain, self.corner_hz, self.rate_hz);
        self.filter.sections.copy_from_slice(&sections);
        self.state.turn(&sections);
    }

    /// Takes over the state of another compensator.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        self.state.copy_state_from(&other.state);
    }

    /// The actual corner of the high-pass, Hz.
    pub(crate) fn corner_hz(&self) -> f64 {
        self.corner_hz
    }

    /// The filter, A per m/s2.
    pub(crate) fn filter(&self) -> &Sections {
        &self.filter
    }
}

fn in_band(corner_hz: f64, rate_hz: f64) -> bool {
    corner_hz > 0.0 && corner_hz < rate_hz / 2.0
}

/// The lowest corner up to `corner_hz`, which is one, at which the gain keeps its bound: it falls as the corner rises.
fn least_corner_hz(actuator: &Response, most_a_per_m_s2: f64, corner_hz: f64) -> f64 {
    let (mut low_hz, mut high_hz) = (LEAST_CORNER_HZ.min(corner_hz), corner_hz);
    for _ in 0..16 {
        let middle_hz = (low_hz * high_hz).sqrt();
        match most_gain(actuator, middle_hz) > most_a_per_m_s2 {
            true => low_hz = middle_hz,
            false => high_hz = middle_hz,
        }
    }
    high_hz
}

/// The inverse in cascade with the high-pass.
fn sections(modes: [Mode; 2], gain: f64, corner_hz: f64, rate_hz: f64) -> [Biquad; 2] {
    let [low, high] = butterworth_4(corner_hz);
    let mut sections = [section(modes[0], low, rate_hz), section(modes[1], high, rate_hz)];
    sections[0].b = sections[0].b.map(|b| b / gain);
    sections
}

/// The two modes of a fourth-order Butterworth filter.
fn butterworth_4(corner_hz: f64) -> [Mode; 2] {
    [1.0, 3.0].map(|k| Mode { frequency_hz: corner_hz, q: 0.5 / (std::f64::consts::FRAC_PI_8 * k).cos() })
}

/// The largest current per acceleration of the inverse over all frequencies, A/(m/s2).
fn most_gain(actuator: &Response, corner_hz: f64) -> f64 {
    let [.., c0] = actuator.denominator;
    let at_rest = c0 / ((TAU * corner_hz).powi(4) * actuator.gain.abs());
    // s^4 / B(s) over g s^4 / D(s), from a hundredth of the corner to a hundred times it.
    let high_pass = |f_hz: f64| 1.0 / (1.0 + (corner_hz / f_hz).powi(8)).sqrt();
    (0..=400)
        .map(|k| corner_hz * 10_f64.powf(f64::from(k) / 100.0 - 2.0))
        .map(|f_hz| high_pass(f_hz) / actuator.at(f_hz).norm())
        .fold(at_rest, f64::max)
}

/// A quadratic over a quadratic, by the bilinear rule.
fn section(zeros: Mode, poles: Mode, rate_hz: f64) -> Biquad {
    let ([b0, b1, b2], [a0, a1, a2]) = (bilinear(zeros, rate_hz), bilinear(poles, rate_hz));
    Biquad { b: [b0 / a0, b1 / a0, b2 / a0], a: [a1 / a0, a2 / a0] }
}

/// s^2 + (w/q) s + w^2 at s = 2 rate (z - 1)/(z + 1), times (z + 1)^2: coefficients of z^2, z, 1.
fn bilinear(mode: Mode, rate_hz: f64) -> [f64; 3] {
    let (k, w) = (2.0 * rate_hz, TAU * mode.frequency_hz);
    let middle = w / mode.q * k;
    [k * k + middle + w * w, 2.0 * (w * w - k * k), k * k - middle + w * w]
}

#[cfg(test)]
mod tests {
    use super::super::two_mass::TwoMass;
    use super::*;

    const RATE_HZ: f64 = 10_000.0;

    fn design(actuator: &TwoMass) -> Compensator {
        Compensator::design(&actuator.response(), CORNER_HZ, MOST_A_PER_M_S2, RATE_HZ).unwrap()
    }

    /// Commanded to felt acceleration in dB, worst over 40 to 500 Hz.
    fn worst_db(compensator: &Compensator, actuator: &TwoMass) -> f64 {
        let machine = actuator.machine(RATE_HZ);
        (0..=200)
            .map(|k| 40.0 * 12.5_f64.powf(f64::from(k) / 200.0))
            .map(|f| compensator.filter().response(f, RATE_HZ) * machine.response_at(f))
            .map(|h| 20.0 * h.norm().log10().abs())
            .fold(0.0, f64::max)
    }

    fn scaled(by: [f64; 7]) -> TwoMass {
        let p = TwoMass::PLACEHOLDER;
        TwoMass {
            force_n_per_a: p.force_n_per_a * by[0],
            magnet_kg: p.magnet_kg * by[1],
            suspension_n_per_m: p.suspension_n_per_m * by[2],
            suspension_n_s_per_m: p.suspension_n_s_per_m * by[3],
            body_kg: p.body_kg * by[4],
            hand_n_per_m: p.hand_n_per_m * by[5],
            hand_n_s_per_m: p.hand_n_s_per_m * by[6],
        }
    }

    #[test]
    fn felt_is_commanded_within_3_db_from_40_to_500_hz() {
        let worst = worst_db(&design(&TwoMass::PLACEHOLDER), &TwoMass::PLACEHOLDER);
        assert!(worst < 0.3, "{worst} dB");
    }

    #[test]
    fn felt_is_commanded_within_4_db_when_a_parameter_is_10_percent_wrong() {
        let compensator = design(&TwoMass::PLACEHOLDER);
        for wrong in 0..7 {
            for factor in [0.9, 1.1] {
                let by = std::array::from_fn(|i| if i == wrong { factor } else { 1.0 });
                let db = worst_db(&compensator, &scaled(by));
                assert!(db < 4.0, "parameter {wrong} times {factor}: {db} dB");
            }
        }
    }

    /// All seven wrong at once, in the worst directions, cannot be had within 4 dB by any fixed compensator: where
    /// the actuators of the box differ most, half their spread is the least possible worst error.
    #[test]
    fn with_all_parameters_wrong_no_fixed_compensator_could_be_much_better() {
        let compensator = design(&TwoMass::PLACEHOLDER);
        let box_of_actuators: Vec<TwoMass> = (0..128)
            .map(|signs| scaled(std::array::from_fn(|i| if signs >> i & 1 == 1 { 1.1 } else { 0.9 })))
            .collect();
        let worst = box_of_actuators.iter().map(|a| worst_db(&compensator, a)).fold(0.0, f64::max);
        let half_spread_at = |f_hz: f64| {
            let db = box_of_actuators.iter().map(|a| 20.0 * a.response().at(f_hz).norm().log10());
            let (low, high) = db.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
            (high - low) / 2.0
        };
        let least = (40..500).map(|f| half_spread_at(f64::from(f))).fold(0.0, f64::max);
        assert!(least > 5.0 && worst < least + 0.5, "worst {worst} dB, least possible {least} dB");
    }

    #[test]
    fn the_target_is_a_20_hz_high_pass_of_fourth_order() {
        let actuator = TwoMass::PLACEHOLDER;
        let (compensator, machine) = (design(&actuator), actuator.machine(RATE_HZ));
        let db = |f: f64| {
            20.0 * (compensator.filter().response(f, RATE_HZ) * machine.response_at(f)).norm().log10()
        };
        assert_eq!(compensator.corner_hz(), 20.0);
        assert!((db(20.0) + 3.01).abs() < 0.05);
        assert!((db(5.0) - db(2.5) - 24.08).abs() < 0.1, "24 dB an octave");
    }

    #[test]
    fn played_through_the_actuator_a_tone_is_felt_as_commanded() {
        let mut compensator = design(&TwoMass::PLACEHOLDER);
        let mut machine = TwoMass::PLACEHOLDER.machine(RATE_HZ);
        let mut felt = 0.0;
        for k in 0..30_000 {
            let mut drive = [(TAU * 95.0 * f64::from(k) / RATE_HZ).sin()];
            compensator.process(&mut drive);
            machine.advance(drive[0], 0.0);
            if k >= 20_000 {
                felt += machine.read().acceleration_m_s2.powi(2) / 10_000.0;
            }
        }
        assert!((felt / 0.5 - 1.0).abs() < 0.01, "{felt}");
    }

    #[test]
    fn the_gain_is_bounded_by_raising_the_corner() {
        let actuator = TwoMass::PLACEHOLDER.response();
        let mut compensator = Compensator::design(&actuator, CORNER_HZ, 0.06, RATE_HZ).unwrap();
        assert!(compensator.corner_hz() > 25.0 && compensator.corner_hz() < 80.0);
        for k in 0..5000 {
            assert!(compensator.filter().response(f64::from(k), RATE_HZ).norm() < 0.0602);
        }
        let corner_hz = compensator.corner_hz();
        compensator.turn(0.5 * corner_hz);
        assert_eq!(compensator.corner_hz(), corner_hz, "not below the bound");
        compensator.turn(2.0 * corner_hz);
        let designed = Compensator::design(&actuator, 2.0 * corner_hz, 0.06, RATE_HZ).unwrap();
        assert_eq!(compensator.filter(), designed.filter());
        let refused = Compensator::design(&actuator, CORNER_HZ, 0.01, RATE_HZ).unwrap_err();
        assert!(matches!(refused, CompensatorError::Gain { .. }));
    }
}
