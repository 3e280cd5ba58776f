//! The sink that drives an arm.

use super::limit::ForceLimitSettings;
use haptograph_engine::frame::Kind;
use haptograph_engine::node::{ActuatorKind, BuildError, Limit, NodeSpec, input, output};
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

/// Drives an arm by force.
pub struct ForceSink;

impl ActuatorKind for ForceSink {
    type Settings = ForceSinkSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "ForceSink",
        group: "sinks",
        doc: "Drives an arm by force, within limits that the graph has to state. NaN and infinity become zero.",
        source: "4.3",
        inputs: &[input("force", Kind::VECTOR, Quantity::FORCE, "Requested force on the hand, N.")],
        outputs: &[output("delivered", Kind::VECTOR, Quantity::FORCE, "Force after the limit, N.")],
        example: r#""push": ForceSink(force: "total.output", endpoint: "arm", limit: (peak_n: 3.3, continuous_n: 0.88))"#,
    };

    fn limit(settings: &ForceSinkSettings) -> Result<(f64, Limit), BuildError> {
        Ok((settings.gain, settings.limit.limit()?))
    }
}
