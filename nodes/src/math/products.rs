//! Products and quotients of signals; the quantity of the result is that of the product or quotient.

use haptograph_engine::frame::{Linear, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, Law, NodeKind, Port, Processor, QuantityRule, Tick,
};
use haptograph_engine::settings::NoSettings;

haptograph_engine::node! {
    /// Multiplies every component of a signal by a scalar signal.
    pub struct Multiply(NoSettings) in "math";
    example: r#""power": Multiply(input: "stylus.force", by: "speed.speed")"#;
    in INPUT: Linear = Port::any("The signal.");
    in BY: Scalar = Port::any("The factor.");
    out OUTPUT: Linear =
        Port::like("input", "The product, of the product's quantity.")
            .carrying(QuantityRule::Product("input", "by"));
}

impl NodeKind for Multiply {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Multiply))
    }
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

    fn law(&self) -> Option<Law> {
        Some(Law::Product)
    }
}

haptograph_engine::node! {
    /// Divides every component of a signal by a scalar signal. If the divisor is zero the quotient is zero, which suits a
    /// ratio of forces without contact.
    pub struct Divide(NoSettings) in "math";
    example: r#""mu": Divide(input: "friction.magnitude", by: "normal.magnitude")"#;
    in INPUT: Linear = Port::any("The dividend.");
    in BY: Scalar = Port::any("The divisor.");
    out OUTPUT: Linear =
        Port::like("input", "The quotient, of the quotient's quantity.")
            .carrying(QuantityRule::Quotient("input", "by"));
}

impl NodeKind for Divide {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Divide))
    }
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

    fn law(&self) -> Option<Law> {
        Some(Law::Quotient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
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
