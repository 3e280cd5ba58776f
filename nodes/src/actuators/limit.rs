//! Limits of an actuator, in the unit of its input: settings that every actuator sink has to state.

use haptograph_engine::limiter::Limiter;
use haptograph_engine::node::{BuildError, Limit};

/// Declares the settings of a limit, whose fields and docs name the unit.
macro_rules! limit_settings {
    (
        $(#[doc = $summary:expr])*
        $name:ident: $peak:ident $peak_doc:literal, $continuous:ident, $slew:ident $slew_doc:literal, heat $heat_doc:literal
    ) => {
        haptograph_engine::settings! {
            $(#[doc = $summary])*
            pub struct $name {
                #[doc = $peak_doc]
                $peak: f64, in 1e-9..=1e6;
                /// Largest continuous RMS value, exponentially weighted over the window, in the same unit.
                $continuous: f64, in 1e-9..=1e6;
                #[doc = $heat_doc]
                window_s: f64 = 10.0, in 1e-3..=1e6;
                #[doc = $slew_doc]
                $slew: Option<f64> = None, in 1e-6..=1e12;
            }
        }

        impl $name {
            /// The limit, if it holds at every rate of an actuator.
            pub(crate) fn limit(&self) -> Result<Limit, BuildError> {
                keepable(Limit {
                    peak: self.$peak,
                    continuous: self.$continuous,
                    window_s: self.window_s,
                    slew_per_s: self.$slew,
                })
            }
        }
    };
}

limit_settings! {
    /// Limit of a coil.
    CurrentLimitSettings:
    peak_a "Largest current at any time, A.",
    continuous_a,
    slew_a_per_s "Largest rate of change, A/s; none: no limit.",
    heat "Time constant of the coil's heat, s."
}

#[cfg(feature = "touch")]
limit_settings! {
    /// Limit of an actuator.
    VoltageLimitSettings:
    peak_v "Largest voltage at any time, V.",
    continuous_v,
    slew_v_per_s "Largest rate of change, V/s; none: no limit.",
    heat "Time constant of the coil's heat, s."
}

limit_settings! {
    /// Limit of an arm; it applies to the length of the force.
    ForceLimitSettings:
    peak_n "Largest force at any time, N.",
    continuous_n,
    slew_n_per_s "Largest rate of change, N/s; none: no limit.",
    heat "Time constant of the motors' heat, s."
}

fn keepable(limit: Limit) -> Result<Limit, BuildError> {
    /// Rates from virtual servo ticks to the fastest converters.
    const RATES_HZ: [f64; 2] = [1.0, 192_000.0];
    for rate_hz in RATES_HZ {
        Limiter::<1>::new(&limit, rate_hz).map_err(|error| BuildError::at("limit", error.to_string()))?;
    }
    Ok(limit)
}
