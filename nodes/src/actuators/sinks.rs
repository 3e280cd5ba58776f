//! The sinks that drive actuators, within limits.

use super::limit::{CurrentLimitSettings, ForceLimitSettings};
use haptograph_engine::frame::{Scalar, Vector};
use haptograph_engine::node::{ActuatorKind, BuildError, Limit, Port};
use haptograph_signal::quantity::Quantity;

haptograph_engine::settings! {
    /// Settings of [`ActuatorSink`].
    pub struct ActuatorSinkSettings {
        /// Gain on the current, without unit, before the limit.
        [live] gain: f64 = 1.0;
        /// Limit of the actuator.
        [limit] limit: CurrentLimitSettings;
    }
}

haptograph_engine::node! {
    /// Drives a voice-coil actuator by current, within limits that the graph has to state. NaN and infinity become zero.
    pub struct ActuatorSink(ActuatorSinkSettings) in "sinks";
    source: "3.1.3";
    example: r#""out": ActuatorSink(current: "drive.current", endpoint: "haptuator", limit: (peak_a: 0.5, continuous_a: 0.25))"#;
    in CURRENT: Scalar = Port::of(Quantity::CURRENT, "Requested current, A.");
    out DELIVERED: Scalar = Port::of(Quantity::CURRENT, "Current after the limit, A.");
}

impl ActuatorKind for ActuatorSink {
    fn limit(settings: &ActuatorSinkSettings) -> Result<(f64, Limit), BuildError> {
        Ok((settings.gain, settings.limit.limit()?))
    }
}

haptograph_engine::settings! {
    /// Settings of [`ForceSink`].
    pub struct ForceSinkSettings {
        /// Gain on the force, without unit, before the limit.
        [live] gain: f64 = 1.0;
        /// Limit of the arm. Peak and window allow a short overload, which the thesis's taps need.
        [limit] limit: ForceLimitSettings;
    }
}

haptograph_engine::node! {
    /// Drives an arm by force, within limits that the graph has to state. NaN and infinity become zero.
    pub struct ForceSink(ForceSinkSettings) in "sinks";
    source: "4.3";
    example: r#""push": ForceSink(force: "total.output", endpoint: "arm", limit: (peak_n: 3.3, continuous_n: 0.88))"#;
    in FORCE: Vector = Port::of(Quantity::FORCE, "Requested force on the hand, N.");
    out DELIVERED: Vector = Port::of(Quantity::FORCE, "Force after the limit, N.");
}

impl ActuatorKind for ForceSink {
    fn limit(settings: &ForceSinkSettings) -> Result<(f64, Limit), BuildError> {
        Ok((settings.gain, settings.limit.limit()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_with_more_continuous_than_peak_is_refused() {
        let settings = |peak_a| ActuatorSinkSettings {
            gain: 1.0,
            limit: CurrentLimitSettings { peak_a, continuous_a: 0.25, window_s: 10.0, slew_a_per_s: None },
        };
        assert!(ActuatorSink::limit(&settings(0.5)).is_ok());
        assert_eq!(ActuatorSink::limit(&settings(0.2)).err().and_then(|e| e.field), Some("limit"));
    }
}
