//! Gain, offset, calibration and absolute value.

use haptograph_engine::frame::{Linear, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, Law, NodeKind, Port, Processor, QuantityRule, Tick,
};
use haptograph_engine::settings::NoSettings;

haptograph_engine::settings! {
    /// Settings of [`Gain`].
    pub struct GainSettings {
        /// The factor, without unit.
        [live] gain: f64 = 1.0, in -1e9..=1e9;
    }
}

haptograph_engine::node! {
    /// Multiplies a signal by a number without unit. The quantity does not change; to convert it, use `Calibrate`.
    /// Elsewhere: Amp, MulAdd, db2mag.
    pub struct Gain(GainSettings) in "math";
    example: r#""louder": Gain(input: "texture.acceleration", gain: 2.0)"#;
    in INPUT: Linear = Port::any("The signal.");
    out OUTPUT: Linear = Port::like("input", "The signal times the gain.");
}

impl NodeKind for Gain {
    fn build(settings: GainSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::law(Law::Scale(settings.gain), Self::INPUT, Self::OUTPUT))
    }
}

haptograph_engine::settings! {
    /// Settings of [`Calibrate`].
    pub struct CalibrateSettings {
        /// Output per input, both in SI units: A per m/s2, V per N.
        [live] factor: f64, in -1e9..=1e9;
        /// Quantity of the input, by name.
        from: String;
        /// Quantity of the output, by name.
        to: String;
    }
}

haptograph_engine::node! {
    /// Converts a signal to another quantity by a factor: the sensitivity of a sensor, the constant of an actuator, the
    /// gain of an amplifier.
    pub struct Calibrate(CalibrateSettings) in "math";
    example: r#""drive": Calibrate(input: "texture.acceleration", from: "acceleration", to: "current", factor: 0.02)"#;
    in INPUT: Linear = Port::of_setting("from", "The signal, of the quantity that `from` names.");
    out OUTPUT: Linear =
        Port::like("input", "The signal times the factor, of the quantity that `to` names.")
            .carrying(QuantityRule::Setting("to"));
}

impl NodeKind for Calibrate {
    fn build(settings: CalibrateSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::law(Law::Scale(settings.factor), Self::INPUT, Self::OUTPUT))
    }
}

haptograph_engine::settings! {
    /// Adds a number to a scalar.
    pub struct OffsetSettings {
        /// The offset, in the SI unit of the signal.
        [live] offset: f64 = 0.0;
    }
}

haptograph_engine::node! {
    /// Adds a number to a scalar signal.
    /// Elsewhere: Bias, MulAdd.
    pub struct Offset(OffsetSettings) in "math";
    example: r#""zeroed": Offset(input: "stylus.force", offset: -0.02)"#;
    in INPUT: Scalar = Port::any("The signal.");
    out OUTPUT: Scalar = Port::like("input", "The signal plus the offset.");
}

impl NodeKind for Offset {
    fn build(settings: OffsetSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::law(Law::Offset(settings.offset), Self::INPUT, Self::OUTPUT))
    }
}

haptograph_engine::node! {
    /// The absolute value of every component. For the length of a vector use `Magnitude`.
    /// Elsewhere: abs~, rectifier.
    pub struct Abs(NoSettings) in "math";
    example: r#""rectified": Abs(input: "texture.acceleration")"#;
    in INPUT: Linear = Port::any("The signal.");
    out OUTPUT: Linear = Port::like("input", "Its absolute value.");
}

impl NodeKind for Abs {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Abs))
    }
}

impl Processor<Abs> for Abs {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Abs>) {
        let x = io.read(Abs::INPUT);
        for (y, x) in io.write(Abs::OUTPUT).iter_mut().zip(x) {
            *y = x.abs();
        }
    }

    fn law(&self) -> Option<Law> {
        Some(Law::Absolute)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    #[test]
    fn a_gain_multiplies_every_lane_and_can_be_turned() {
        let mut bench = Bench::new::<Gain>(GainSettings { gain: -2.0 }, 1000.0, &[Kind::VECTOR]).unwrap();
        assert_eq!(bench.run(&[&[1.0, 2.0, 3.0]]), [[-2.0, -4.0, -6.0]]);
        bench.set(GainSettings::gain, 0.5);
        assert_eq!(bench.run(&[&[1.0, 2.0, 3.0]]), [[0.5, 1.0, 1.5]]);
    }

    #[test]
    fn offset_and_absolute_value() {
        let mut bench = Bench::new::<Offset>(OffsetSettings { offset: 0.25 }, 1.0, &[Kind::SCALAR]).unwrap();
        assert_eq!(bench.run(&[&[-1.0, 2.0]]), [[-0.75, 2.25]]);
        let mut bench = Bench::new::<Abs>(NoSettings {}, 1.0, &[Kind::SCALAR]).unwrap();
        assert_eq!(bench.run(&[&[-1.0, 2.0]]), [[1.0, 2.0]]);
    }
}
