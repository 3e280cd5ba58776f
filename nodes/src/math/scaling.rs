//! Gain, offset, calibration and absolute value.

use haptograph_engine::frame::{Kind, Linear, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Flow, Input, InputSpec, Io, KindRule, Law, NodeKind, NodeSpec, Output,
    OutputCount, OutputRole, OutputSpec, Presence, Processor, QuantityRule, Tick, any_input, output_like,
};
use haptograph_engine::settings::NoSettings;

haptograph_engine::settings! {
    /// Settings of [`Gain`].
    pub struct GainSettings {
        /// The factor, without unit.
        [live] gain: f64 = 1.0, in -1e9..=1e9;
    }
}

/// Multiplies a signal by a number.
pub struct Gain;

impl NodeKind for Gain {
    type Settings = GainSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Gain",
        group: "math",
        doc: "Multiplies a signal by a number without unit. The quantity does not change; to convert it, use `Calibrate`.",
        source: "",
        inputs: &[any_input("input", "The signal.")],
        outputs: &[output_like("output", "input", "The signal times the gain.")],
        example: r#""louder": Gain(input: "texture.acceleration", gain: 2.0)"#,
    };

    fn build(settings: GainSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::law(Law::Scale(settings.gain), Self::INPUT, Self::OUTPUT))
    }
}

impl Gain {
    const INPUT: Input<Self, Linear> = Input::named("input");
    const OUTPUT: Output<Self, Linear> = Output::named("output");
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

/// Converts a quantity into another by a factor.
pub struct Calibrate;

impl NodeKind for Calibrate {
    type Settings = CalibrateSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Calibrate",
        group: "math",
        doc: "Converts a signal to another quantity by a factor: the sensitivity of a sensor, the constant of an \
              actuator, the gain of an amplifier.",
        source: "",
        inputs: &[InputSpec {
            name: "input",
            kind: KindRule::Linear,
            quantity: QuantityRule::Setting("from"),
            flow: Flow::Sampled,
            presence: Presence::Required,
            doc: "The signal, of the quantity that `from` names.",
        }],
        outputs: &[OutputSpec {
            name: "output",
            kind: KindRule::Same("input"),
            quantity: QuantityRule::Setting("to"),
            role: OutputRole::Plain,
            count: OutputCount::One,
            doc: "The signal times the factor, of the quantity that `to` names.",
        }],
        example: r#""drive": Calibrate(input: "texture.acceleration", from: "acceleration", to: "current", factor: 0.02)"#,
    };

    fn build(settings: CalibrateSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::law(Law::Scale(settings.factor), Self::INPUT, Self::OUTPUT))
    }
}

impl Calibrate {
    const INPUT: Input<Self, Linear> = Input::named("input");
    const OUTPUT: Output<Self, Linear> = Output::named("output");
}

haptograph_engine::settings! {
    /// Adds a number to a scalar.
    pub struct Offset {
        /// The offset, in the SI unit of the signal.
        [live] offset: f64 = 0.0;
    }
}

impl NodeKind for Offset {
    type Settings = Self;
    const SPEC: NodeSpec = NodeSpec {
        name: "Offset",
        group: "math",
        doc: "Adds a number to a scalar signal.",
        source: "",
        inputs: &[InputSpec { kind: KindRule::Is(Kind::SCALAR), ..any_input("input", "The signal.") }],
        outputs: &[output_like("output", "input", "The signal plus the offset.")],
        example: r#""zeroed": Offset(input: "stylus.force", offset: -0.02)"#,
    };

    fn build(settings: Self, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::law(Law::Offset(settings.offset), Self::INPUT, Self::OUTPUT))
    }
}

impl Offset {
    const INPUT: Input<Self, Scalar> = Input::named("input");
    const OUTPUT: Output<Self, Scalar> = Output::named("output");
}

/// The absolute value of every component.
#[derive(Debug, Clone, Copy)]
pub struct Abs;

impl NodeKind for Abs {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Abs",
        group: "math",
        doc: "The absolute value of every component. For the length of a vector use `Magnitude`.",
        source: "",
        inputs: &[any_input("input", "The signal.")],
        outputs: &[output_like("output", "input", "Its absolute value.")],
        example: r#""rectified": Abs(input: "texture.acceleration")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Abs))
    }
}

impl Abs {
    const INPUT: Input<Self, Linear> = Input::named("input");
    const OUTPUT: Output<Self, Linear> = Output::named("output");
}

impl Processor<Abs> for Abs {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Abs>) {
        let x = io.read(Abs::INPUT);
        for (y, x) in io.write(Abs::OUTPUT).iter_mut().zip(x) {
            *y = x.abs();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::node::LiveId;
    use haptograph_engine::testing::Bench;

    #[test]
    fn a_gain_multiplies_every_lane_and_can_be_turned() {
        let mut bench = Bench::new::<Gain>(GainSettings { gain: -2.0 }, 1000.0, &[Kind::VECTOR]).unwrap();
        assert_eq!(bench.run(&[&[1.0, 2.0, 3.0]]), [[-2.0, -4.0, -6.0]]);
        bench.set(LiveId::<Gain>::named("gain"), 0.5);
        assert_eq!(bench.run(&[&[1.0, 2.0, 3.0]]), [[0.5, 1.0, 1.5]]);
    }

    #[test]
    fn offset_and_absolute_value() {
        let mut bench = Bench::new::<Offset>(Offset { offset: 0.25 }, 1.0, &[Kind::SCALAR]).unwrap();
        assert_eq!(bench.run(&[&[-1.0, 2.0]]), [[-0.75, 2.25]]);
        let mut bench = Bench::new::<Abs>(NoSettings {}, 1.0, &[Kind::SCALAR]).unwrap();
        assert_eq!(bench.run(&[&[-1.0, 2.0]]), [[1.0, 2.0]]);
    }
}
