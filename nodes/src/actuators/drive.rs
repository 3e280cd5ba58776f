//! The dynamic compensator of a voice-coil actuator.

use super::compensator::{CORNER_HZ, Compensator, CompensatorError, LEAST_CORNER_HZ, MOST_A_PER_M_S2};
use crate::simulated::haptuator::TwoMassSettings;
use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, Tick};
use haptograph_signal::quantity::Quantity;

haptograph_engine::settings! {
    /// Settings of [`DynamicCompensator`].
    pub struct DynamicCompensatorSettings {
        /// The actuator; the defaults are placeholders, not measurements.
        model: TwoMassSettings = TwoMassSettings::placeholder();
        /// Corner of the high-pass that commanded to felt acceleration follows.
        [live, below_nyquist] corner_hz: f64 = CORNER_HZ, in LEAST_CORNER_HZ..=10_000.0;
        /// Largest current per acceleration at any frequency, A/(m/s2); the corner moves up until this holds.
        most_a_per_m_s2: f64 = MOST_A_PER_M_S2, in 1e-6..=1e6;
    }
}

haptograph_engine::node! {
    /// Computes the current that makes the hand feel a requested acceleration: the inverse of a two-mass model of the
    /// voice-coil actuator, in series with a high-pass of fourth order.
    pub struct DynamicCompensator(DynamicCompensatorSettings) in "actuators";
    source: "3.1.2; McMahan and Kuchenbecker 2014";
    example: r#""drive": DynamicCompensator(acceleration: "texture.acceleration")"#;
    in ACCELERATION: Scalar = Port::of(Quantity::ACCELERATION, "Requested acceleration, m/s2.");
    out CURRENT: Scalar = Port::of(Quantity::CURRENT, "Current for the actuator, A.");
}

impl NodeKind for DynamicCompensator {
    fn build(settings: DynamicCompensatorSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let model = settings.model.to_two_mass();
        let model = model.checked().map_err(|error| BuildError::at("model", error.to_string()))?;
        let (corner_hz, most_a_per_m_s2) = (settings.corner_hz, settings.most_a_per_m_s2);
        let designed = Compensator::design(&model.response(), corner_hz, most_a_per_m_s2, cx.rate.hz());
        let compensator = designed.map_err(|error| {
            let field = match error {
                CompensatorError::NoActuator => "model",
                CompensatorError::Corner { .. } => "corner_hz",
                CompensatorError::Gain { .. } => "most_a_per_m_s2",
            };
            BuildError::at(field, error.to_string())
        })?;
        Ok(Built::new(Compensating { compensator }))
    }

    fn advice(_: &DynamicCompensatorSettings, cx: &BuildContext) -> Vec<BuildError> {
        let rate_hz = cx.rate.hz();
        if rate_hz >= 2.0 * FELT_TO_HZ {
            return Vec::new();
        }
        let message = format!(
            "a clock of {rate_hz} Hz renders nothing above {} Hz, but vibrations are felt up to {FELT_TO_HZ} Hz",
            0.5 * rate_hz
        );
        vec![BuildError {
            help: Some(format!(
                "run it on a clock of {} Hz or more, such as a soundcard's",
                2.0 * FELT_TO_HZ
            )),
            ..BuildError::of_node(message)
        }]
    }
}

/// Highest vibration that fingers feel, Hz.
const FELT_TO_HZ: f64 = 1000.0;

#[derive(Debug, Clone)]
struct Compensating {
    compensator: Compensator,
}

impl Processor<DynamicCompensator> for Compensating {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, DynamicCompensator>) {
        let acceleration = io.read(DynamicCompensator::ACCELERATION);
        let current = io.write(DynamicCompensator::CURRENT);
        current.copy_from_slice(acceleration);
        self.compensator.process(current);
    }

    fn set(&mut self, setting: LiveId<DynamicCompensatorSettings>, value: f64) {
        if setting == DynamicCompensatorSettings::corner_hz {
            self.compensator.turn(value);
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.compensator.copy_state_from(&self.compensator);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    #[test]
    fn a_tone_through_compensator_and_actuator_is_felt_as_commanded() {
        let settings = DynamicCompensatorSettings {
            model: TwoMassSettings::placeholder(),
            corner_hz: 20.0,
            most_a_per_m_s2: 0.5,
        };
        let mut bench = Bench::new::<DynamicCompensator>(settings, 10_000.0, &[Kind::SCALAR]).unwrap();
        let tone = |k: u32| (std::f64::consts::TAU * 95.0 * f64::from(k) / 10_000.0).sin();
        let wanted: Vec<f64> = (0..30_000).map(tone).collect();
        let current = bench.run_in_blocks(&[&wanted], &[1, 64]).remove(0);
        let mut machine = TwoMassSettings::placeholder().to_two_mass().machine(10_000.0);
        let mut power = 0.0;
        for (k, current_a) in current.iter().enumerate() {
            machine.advance(*current_a, 0.0);
            power += if k < 20_000 { 0.0 } else { machine.read().acceleration_m_s2.powi(2) / 10_000.0 };
        }
        assert!((power / 0.5 - 1.0).abs() < 0.01);
    }
}
