//! The sink that drives an arm.

use super::limit::ForceLimitSettings;
use haptograph_engine::frame::Vector;
use haptograph_engine::node::{ActuatorKind, BuildError, Limit, Port};
use haptograph_signal::quantity::Quantity;

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
