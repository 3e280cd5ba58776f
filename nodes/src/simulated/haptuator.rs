//! The voice-coil actuator as a device of graphs, and the source that reads the accelerometer on it.

use crate::actuators::two_mass::{TwoMass, TwoMassMachine};
use haptograph_engine::device::{Channel, Device, DeviceKind, DeviceSpec};
use haptograph_engine::document::value::Value;
use haptograph_engine::frame::{Kind, Scalar};
use haptograph_engine::node::{BuildContext, BuildError, Port};
use haptograph_engine::settings::{DeclaredField, EachField, NoSettings, SettingSpec, Settings};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Grams, NewtonsPerMillimetre};
use std::sync::LazyLock;

haptograph_engine::node! {
    /// Reads the acceleration of a tool along its actuator, which the hand feels.
    pub struct AccelerometerSource as "Accelerometer"(NoSettings) in "sources";
    source: "3.1.2";
    example: r#""felt": Accelerometer(clock: "audio", endpoint: "haptuator")"#;
    out ACCELERATION: Scalar = Port::of(Quantity::ACCELERATION, "Acceleration of the tool, m/s2.");
}

haptograph_engine::settings! {
    /// The masses, springs and dampers of a voice-coil actuator on a tool in a hand. The defaults are placeholders,
    /// not measurements: replace them by a fit to your own actuator.
    pub struct TwoMassSettings {
        /// Force per current, N/A.
        force_n_per_a: f64 = TwoMass::PLACEHOLDER.force_n_per_a, in 1e-6..=1e6;
        /// Mass of the magnet, g.
        magnet_g: Grams = Grams::of_si(TwoMass::PLACEHOLDER.magnet_kg), in 1e-6..=1e6;
        /// Stiffness of the magnet's suspension, N/mm.
        suspension_n_per_mm: NewtonsPerMillimetre = NewtonsPerMillimetre::of_si(TwoMass::PLACEHOLDER.suspension_n_per_m), in 1e-9..=1e6;
        /// Damping of the magnet's suspension, N s/m.
        suspension_n_s_per_m: f64 = TwoMass::PLACEHOLDER.suspension_n_s_per_m, in 1e-9..=1e6;
        /// Mass of the actuator's body, the tool and the part of the hand that moves with them, g.
        body_g: Grams = Grams::of_si(TwoMass::PLACEHOLDER.body_kg), in 1e-6..=1e6;
        /// Stiffness of the grip, N/mm.
        hand_n_per_mm: NewtonsPerMillimetre = NewtonsPerMillimetre::of_si(TwoMass::PLACEHOLDER.hand_n_per_m), in 1e-9..=1e6;
        /// Damping of the grip, N s/m.
        hand_n_s_per_m: f64 = TwoMass::PLACEHOLDER.hand_n_s_per_m, in 1e-9..=1e6;
    }
}

impl TwoMassSettings {
    /// The placeholders.
    pub(crate) fn placeholder() -> Self {
        Self::from(TwoMass::PLACEHOLDER)
    }

    /// The model in SI.
    pub(crate) fn to_two_mass(&self) -> TwoMass {
        TwoMass {
            force_n_per_a: self.force_n_per_a,
            magnet_kg: self.magnet_g.si(),
            suspension_n_per_m: self.suspension_n_per_mm.si(),
            suspension_n_s_per_m: self.suspension_n_s_per_m,
            body_kg: self.body_g.si(),
            hand_n_per_m: self.hand_n_per_mm.si(),
            hand_n_s_per_m: self.hand_n_s_per_m,
        }
    }
}

impl From<TwoMass> for TwoMassSettings {
    fn from(model: TwoMass) -> Self {
        Self {
            force_n_per_a: model.force_n_per_a,
            magnet_g: Grams::of_si(model.magnet_kg),
            suspension_n_per_mm: NewtonsPerMillimetre::of_si(model.suspension_n_per_m),
            suspension_n_s_per_m: model.suspension_n_s_per_m,
            body_g: Grams::of_si(model.body_kg),
            hand_n_per_mm: NewtonsPerMillimetre::of_si(model.hand_n_per_m),
            hand_n_s_per_m: model.hand_n_s_per_m,
        }
    }
}

/// Default tolerance of each parameter of a simulated actuator: the compensator does not know the actual
/// parameters.
pub const TOLERANCE: f64 = 0.1;

haptograph_engine::settings! {
    /// Deviation of a simulated actuator from its stated parameters.
    pub struct ToleranceSettings {
        /// Tolerance of each parameter, as a fraction; the seed of the run draws the actuator. 0: as stated.
        tolerance: f64 = TOLERANCE, in 0.0..=0.5;
    }
}

/// Settings of [`SimulatedHaptuator`]: those of the model, and the tolerance.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedHaptuatorSettings {
    /// The stated parameters.
    pub model: TwoMassSettings,
    /// The tolerance of the actual parameters.
    pub tolerance: ToleranceSettings,
}

impl Settings for SimulatedHaptuatorSettings {
    const NAME: &'static str = "SimulatedHaptuatorSettings";
    const DOC: &'static str = "Settings of a simulated actuator.";
    /// No setting of a device is live.
    const FIELDS: &'static [DeclaredField] = &[];

    fn each<V: EachField>(visitor: &mut V) -> Option<Self> {
        // Both are visited before the first `?`, so that all errors are reported.
        let (model, tolerance) = (TwoMassSettings::each(visitor), ToleranceSettings::each(visitor));
        Some(Self { model: model?, tolerance: tolerance? })
    }

    fn specs() -> &'static [SettingSpec] {
        static SPECS: LazyLock<Vec<SettingSpec>> = LazyLock::new(SimulatedHaptuatorSettings::list);
        &SPECS
    }

    fn fields(&self) -> Vec<(&'static str, Value)> {
        [self.model.fields(), self.tolerance.fields()].concat()
    }
}

/// A voice-coil actuator on a tool in a hand.
pub struct SimulatedHaptuator;

impl DeviceKind for SimulatedHaptuator {
    type Settings = SimulatedHaptuatorSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "SimulatedHaptuator",
        doc: "A voice-coil actuator on a tool in a hand: two masses driven by current. Its parameters are placeholders \
              unless you set them. Each deviates by up to `tolerance`, drawn by the seed of the run, so that the \
              parameters of a compensator differ from those of the actuator; `haptograph identify` finds them.",
        source: "3.1.2; McMahan and Kuchenbecker 2014",
        simulated: true,
        senses: &[
            Channel::new(
                "acceleration",
                Kind::SCALAR,
                Quantity::ACCELERATION,
                "Acceleration of the tool, m/s2.",
            ),
            Channel::new(
                "stroke",
                Kind::SCALAR,
                Quantity::LENGTH,
                "Displacement of the magnet in its housing, m.",
            ),
        ],
        drives: &[Channel::new("current", Kind::SCALAR, Quantity::CURRENT, "Current through the coil, A.")],
        example: r#""haptuator": SimulatedHaptuator()"#,
    };

    fn build(settings: SimulatedHaptuatorSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        let checked = settings.model.to_two_mass().checked();
        let stated = checked.map_err(|error| BuildError::at("force_n_per_a", error.to_string()))?;
        let model = stated.of_seed(settings.tolerance.tolerance, cx.seed);
        Ok(Box::new(Coil { machine: model.machine(cx.rate.hz()), current_a: 0.0 }))
    }
}

#[derive(Debug, Clone)]
struct Coil {
    machine: TwoMassMachine,
    current_a: f64,
}

impl Device for Coil {
    fn advance(&mut self) {
        self.machine.advance(self.current_a, 0.0);
    }

    fn read(&mut self, channel: usize, frame: &mut [f64]) {
        let reading = self.machine.read();
        frame.fill(if channel == 0 { reading.acceleration_m_s2 } else { reading.stroke_m });
    }

    fn write(&mut self, _: usize, frame: &[f64]) {
        if let [current_a] = frame {
            self.current_a = *current_a;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_settings_are_the_placeholder() {
        let (a, b) = (TwoMassSettings::placeholder().to_two_mass(), TwoMass::PLACEHOLDER);
        assert!((a.magnet_kg - b.magnet_kg).abs() < 1e-15);
        assert!((a.body_kg - b.body_kg).abs() < 1e-15);
        assert!((a.suspension_n_per_m - b.suspension_n_per_m).abs() < 1e-9);
        assert!((a.hand_n_per_m - b.hand_n_per_m).abs() < 1e-9);
    }

    #[test]
    fn an_actuator_is_within_its_tolerance_and_another_for_each_seed() {
        let stated = TwoMass::PLACEHOLDER;
        assert_eq!(stated.of_seed(0.0, 3), stated);
        assert_eq!(stated.of_seed(0.1, 3), stated.of_seed(0.1, 3));
        assert_ne!(stated.of_seed(0.1, 3), stated.of_seed(0.1, 4));
        let ratios = (0..100).flat_map(|seed| {
            let p = stated.of_seed(0.1, seed);
            [
                p.force_n_per_a / stated.force_n_per_a,
                p.magnet_kg / stated.magnet_kg,
                p.suspension_n_per_m / stated.suspension_n_per_m,
                p.suspension_n_s_per_m / stated.suspension_n_s_per_m,
                p.body_kg / stated.body_kg,
                p.hand_n_per_m / stated.hand_n_per_m,
                p.hand_n_s_per_m / stated.hand_n_s_per_m,
            ]
        });
        let (least, most) = ratios.fold((f64::MAX, f64::MIN), |(l, m), x| (l.min(x), m.max(x)));
        assert!((0.9..0.91).contains(&least) && (1.09..1.1).contains(&most), "{least} {most}");
    }
}
