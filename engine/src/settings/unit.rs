//! Units of settings: types whose numbers are converted to SI, and the names that they demand.

use super::Setting;
use haptograph_signal::units::{self, Unit};

/// What the numbers of a setting's type are in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// It has none, or converts them itself.
    Other,
    /// They are in SI, or have no unit.
    Plain,
    /// They are in a unit that a factor converts.
    Unit {
        /// End of the setting's name.
        suffix: &'static str,
        /// SI per unit.
        si: f64,
    },
}

impl Scale {
    /// SI per unit; 1 without a unit.
    pub const fn si_per_unit(self) -> f64 {
        match self {
            Self::Unit { si, .. } => si,
            Self::Other | Self::Plain => 1.0,
        }
    }

    /// The unit of the setting `name`.
    pub(super) fn unit(self, name: &str) -> Option<Unit> {
        match self {
            Self::Unit { suffix, .. } => units::of_name(suffix),
            Self::Other | Self::Plain => units::of_name(name),
        }
    }
}

/// Checks that the name of a setting of type `T` ends with the unit of the type, and that a plain number is in SI.
/// [`settings!`](crate::settings!) does it at compile time.
///
/// # Panics
/// If they contradict each other.
pub const fn check_unit<T: Setting>(name: &str) {
    match (T::SCALE, units::at_end_of(name)) {
        (Scale::Unit { suffix, si }, Some((length, si_of_name))) => assert!(
            suffix.len() == length && si == si_of_name,
            "the unit at the end of this setting's name is not that of its type"
        ),
        (Scale::Unit { .. }, None) => {
            panic!(
                "the name of this setting has to end with the unit of its type, as `radius_mm: Millimetres` does"
            )
        }
        (Scale::Plain, Some((_, si))) => assert!(
            si == 1.0,
            "this setting is a plain number, but its name ends with a unit that is not SI: declare it with the type of \
             the unit, as in `radius_mm: Millimetres`"
        ),
        (Scale::Plain, None) | (Scale::Other, _) => {}
    }
}

/// Makes types of units, as [`haptograph_signal::unit_types!`] declares them, types of settings.
///
/// ```
/// haptograph_signal::unit_types! {
///     /// Millivolts per newton.
///     pub struct MillivoltsPerNewton("_mv_per_n");
/// }
/// haptograph_engine::unit_settings!(MillivoltsPerNewton);
///
/// haptograph_engine::settings! {
///     /// Settings of a force sensor.
///     pub struct SensorSettings {
///         /// Voltage per force.
///         sensitivity_mv_per_n: MillivoltsPerNewton = MillivoltsPerNewton(2.0), in 0.0..=1000.0;
///     }
/// }
/// ```
#[macro_export]
macro_rules! unit_settings {
    ($($unit:ty),* $(,)?) => {$(
        impl $crate::settings::Setting for $unit {
            const SCALE: $crate::settings::Scale = $crate::settings::Scale::Unit {
                suffix: <$unit>::SUFFIX,
                si: <$unit>::SI_PER_UNIT,
            };
            fn expected() -> $crate::settings::Expected {
                <f64 as $crate::settings::Setting>::expected()
            }
            fn read(
                value: &$crate::document::value::Value,
                reading: &mut $crate::settings::Reading<'_>,
            ) -> Option<Self> {
                <f64 as $crate::settings::Setting>::read(value, reading).map(Self)
            }
            fn value(&self) -> $crate::document::value::Value {
                $crate::settings::Setting::value(&self.0)
            }
            fn numbers(&self) -> Vec<f64> {
                vec![self.0]
            }
        }
    )*};
}

unit_settings!(
    units::Millimetres,
    units::Centimetres,
    units::Micrometres,
    units::Grams,
    units::Milliseconds,
    units::Milliamperes,
    units::Degrees,
    units::MillimetresPerSecond,
    units::MillimetresPerSecondSquared,
    units::Millinewtons,
    units::NewtonMillimetres,
    units::Millivolts,
    units::Kilohertz,
    units::NewtonsPerMillimetre,
    units::SecondsPerMillimetre,
    units::PerMillimetre,
);
