//! Products and quotients of signals; the quantity of the result is that of the product or quotient.

use haptograph_engine::frame::{Kind, Linear, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Input, InputSpec, Io, KindRule, NodeKind, NodeSpec, Output, OutputCount,
    OutputRole, OutputSpec, Processor, QuantityRule, Tick, any_input,
};
use haptograph_engine::settings::NoSettings;

const fn scalar_input(name: &'static str, doc: &'static str) -> InputSpec {
    InputSpec { kind: KindRule::Is(Kind::SCALAR), ..any_input(name, doc) }
}

/// Multiplies a signal by a scalar signal.
#[derive(Debug, Clone, Copy)]
pub struct Multiply;

impl NodeKind for Multiply {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Multiply",
        group: "math",
        doc: "Multiplies every component of a signal by a scalar signal.",
        source: "",
        inputs: &[any_input("input", "The signal."), scalar_input("by", "The factor.")],
        outputs: &[OutputSpec {
            name: "output",
            kind: KindRule::Same("input"),
            quantity: QuantityRule::Product("input", "by"),
            role: OutputRole::Plain,
            count: OutputCount::One,
            doc: "The product, of the product's quantity.",
        }],
        example: r#""power": Multiply(input: "stylus.force", by: "speed.speed")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Multiply))
    }
}

impl Multiply {
    const INPUT: Input<Self, Linear> = Input::named("input");
    const BY: Input<Self, Scalar> = Input::named("by");
    const OUTPUT: Output<Self, Linear> = Output::named("output");
}

impl Processor<Multiply> for Multiply {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Multiply>) {
        let (width, x, by) = (io.width(Multiply::INPUT), io.read(Multiply::INPUT), io.read(Multiply::BY));
        if width == 1 {
            for ((y, x), by) in io.write(Multiply::OUTPUT).iter_mut().zip(x).zip(by) {
                *y = x * by;
            }
            return;
        }
        let frames = io.write(Multiply::OUTPUT).chunks_exact_mut(width);
        for ((y, x), by) in frames.zip(x.chunks_exact(width)).zip(by) {
            for (y, x) in y.iter_mut().zip(x) {
                *y = x * by;
            }
        }
    }
}

/// Divides a signal by a scalar signal.
#[derive(Debug, Clone, Copy)]
pub struct Divide;

impl NodeKind for Divide {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Divide",
        group: "math",
        doc: "Divides every component of a signal by a scalar signal. If the divisor is zero the quotient is zero, \
              which suits a ratio of forces without contact.",
        source: "",
        inputs: &[any_input("input", "The dividend."), scalar_input("by", "The divisor.")],
        outputs: &[OutputSpec {
            name: "output",
            kind: KindRule::Same("input"),
            quantity: QuantityRule::Quotient("input", "by"),
            role: OutputRole::Plain,
            count: OutputCount::One,
            doc: "The quotient, of the quotient's quantity.",
        }],
        example: r#""mu": Divide(input: "friction.magnitude", by: "normal.magnitude")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Divide))
    }
}

impl Divide {
    const INPUT: Input<Self, Linear> = Input::named("input");
    const BY: Input<Self, Scalar> = Input::named("by");
    const OUTPUT: Output<Self, Linear> = Output::named("output");
}

impl Processor<Divide> for Divide {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Divide>) {
        let (width, x, by) = (io.width(Divide::INPUT), io.read(Divide::INPUT), io.read(Divide::BY));
        let frames = io.write(Divide::OUTPUT).chunks_exact_mut(width);
        for ((y, x), by) in frames.zip(x.chunks_exact(width)).zip(by) {
            for (y, x) in y.iter_mut().zip(x) {
                *y = if *by == 0.0 { 0.0 } else { x / by };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;

    #[test]
    fn every_lane_is_multiplied_and_divided() {
        let x = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let mut bench = Bench::new::<Multiply>(NoSettings {}, 1.0, &[Kind::VECTOR, Kind::SCALAR]).unwrap();
        assert_eq!(bench.run(&[&x, &[2.0, -1.0]]), [[2.0, 4.0, 6.0, -4.0, -5.0, -6.0]]);
        let mut bench = Bench::new::<Divide>(NoSettings {}, 1.0, &[Kind::VECTOR, Kind::SCALAR]).unwrap();
        assert_eq!(bench.run(&[&x, &[2.0, 0.0]]), [[0.5, 1.0, 1.5, 0.0, 0.0, 0.0]]);
    }
}
