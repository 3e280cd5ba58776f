//! The sink that drives an arm.

use super::drive::keepable;
use haptograph_engine::frame::Kind;
use haptograph_engine::node::{ActuatorKind, BuildError, Limit, NodeSpec, input, output};
use haptograph_signal::quantity::Quantity;

haptograph_engine::settings! {
    /// What an arm may be given; lengths of vectors count.
    pub struct ForceLimitSettings {
        /// Largest force at any time, N.
        peak_n: f64, in 1e-9..=1e6;
        /// Largest root mean square over the window, N.
        continuous_n: f64, in 1e-9..=1e6;
        /// Time constant of the motors' heat, s.
        window_s: f64 = 10.0, in 1e-3..=1e6;
        /// Largest rate of change, N/s; none: not limited.
        slew_n_per_s: Option<f64> = None, in 1e-6..=1e12;
    }
}

haptograph_engine::settings! {
    /// Settings of [`ForceSink`].
    pub struct ForceSinkSettings {
        /// A plain factor on the force, before the limit.
        [live] gain: f64 = 1.0;
        /// What the arm may be given. Peak and window express a short overload, as the thesis's taps need.
        limit: ForceLimitSettings;
    }
}

/// Drives an arm by force.
pub struct ForceSink;

impl ActuatorKind for ForceSink {
    type Settings = ForceSinkSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "ForceSink",
        group: "sinks",
        doc: "Drives an arm by force, within limits that it has to state. What is not a number becomes no force.",
        source: "4.3",
        inputs: &[input(
            "force",
            Kind::Vector,
            Quantity::FORCE,
            "Force on the hand that is asked for, N.",
        )],
        outputs: &[output(
            "delivered",
            Kind::Vector,
            Quantity::FORCE,
            "Force that the arm was given, N.",
        )],
        example: r#""push": ForceSink(force: "total.output", endpoint: "arm", limit: (peak_n: 3.3, continuous_n: 0.88))"#,
    };

    fn limit(settings: &ForceSinkSettings) -> Result<(f64, Limit), BuildError> {
        let limit = Limit {
            peak: settings.limit.peak_n,
            continuous: settings.limit.continuous_n,
            window_s: settings.limit.window_s,
            slew_per_s: settings.limit.slew_n_per_s,
        };
        keepable(&limit)?;
        Ok((settings.gain, limit))
    }
}
