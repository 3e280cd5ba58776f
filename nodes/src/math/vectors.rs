//! 3-vectors and wrenches: length, products, components.

use haptograph_engine::frame::{Scalar, Vector, Wrench};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, NodeKind, Port, Processor, QuantityRule, Tick,
};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::quantity::Quantity;

use crate::vector::{cross, dot};

haptograph_engine::node! {
    /// The length of a 3-vector.
    /// Elsewhere: norm, hypot.
    pub struct Magnitude(NoSettings) in "math";
    example: r#""pull": Magnitude(input: "arm.force")"#;
    in INPUT: Vector = Port::any("The vector.");
    out OUTPUT: Scalar = Port::any("Its length.").carrying(QuantityRule::Same("input"));
}

impl NodeKind for Magnitude {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Magnitude))
    }
}

impl Processor<Magnitude> for Magnitude {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Magnitude>) {
        let x = io.read(Magnitude::INPUT);
        for (y, [a, b, c]) in io.write(Magnitude::OUTPUT).iter_mut().zip(x) {
            *y = (a * a + b * b + c * c).sqrt();
        }
    }
}

haptograph_engine::node! {
    /// The scalar product of two 3-vectors: force and velocity give power.
    pub struct Dot(NoSettings) in "math";
    example: r#""power": Dot(a: "arm.force", b: "arm.velocity")"#;
    in A: Vector = Port::any("The first vector.");
    in B: Vector = Port::any("The second vector.");
    out OUTPUT: Scalar = Port::any("a . b").carrying(QuantityRule::Product("a", "b"));
}

impl NodeKind for Dot {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Dot))
    }
}

impl Processor<Dot> for Dot {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Dot>) {
        let (a, b) = (io.read(Dot::A), io.read(Dot::B));
        for ((y, a), b) in io.write(Dot::OUTPUT).iter_mut().zip(a).zip(b) {
            *y = dot(*a, *b);
        }
    }
}

haptograph_engine::node! {
    /// The vector product of two 3-vectors: lever arm and force give torque.
    pub struct Cross(NoSettings) in "math";
    example: r#""torque": Cross(a: "arm.position", b: "arm.force")"#;
    in A: Vector = Port::any("The first vector.");
    in B: Vector = Port::any("The second vector.");
    out OUTPUT: Vector = Port::any("a x b").carrying(QuantityRule::Product("a", "b"));
}

impl NodeKind for Cross {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Cross))
    }
}

impl Processor<Cross> for Cross {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Cross>) {
        let (a, b) = (io.read(Cross::A), io.read(Cross::B));
        for ((y, a), b) in io.write(Cross::OUTPUT).iter_mut().zip(a).zip(b) {
            *y = cross(*a, *b);
        }
    }
}

haptograph_engine::node! {
    /// The three components of a 3-vector as scalars.
    /// Elsewhere: unpack, demux.
    pub struct Components(NoSettings) in "math";
    example: r#""tip": Components(input: "stylus.position")"#;
    in INPUT: Vector = Port::any("The vector.");
    out X: Scalar = Port::any("Along x.").carrying(QuantityRule::Same("input"));
    out Y: Scalar = Port::any("Along y.").carrying(QuantityRule::Same("input"));
    out Z: Scalar = Port::any("Along z.").carrying(QuantityRule::Same("input"));
}

impl NodeKind for Components {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Components))
    }
}

impl Processor<Components> for Components {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Components>) {
        let vectors = io.read(Components::INPUT);
        let (x, y, z) = io.write_all((Components::X, Components::Y, Components::Z));
        for (((x, y), z), vector) in x.iter_mut().zip(y).zip(z).zip(vectors) {
            [*x, *y, *z] = *vector;
        }
    }
}

haptograph_engine::node! {
    /// Makes a 3-vector from three scalars of one quantity.
    /// Elsewhere: pack, mux.
    pub struct Pack(NoSettings) in "math";
    example: r#""path": Pack(x: "east.output", y: "north.output", z: "up.output")"#;
    in X: Scalar = Port::any("Along x.");
    in Y: Scalar = Port::any("Along y.").carrying(QuantityRule::Same("x"));
    in Z: Scalar = Port::any("Along z.").carrying(QuantityRule::Same("x"));
    out OUTPUT: Vector = Port::any("The vector.").carrying(QuantityRule::Same("x"));
}

impl NodeKind for Pack {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Pack))
    }
}

impl Processor<Pack> for Pack {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Pack>) {
        let (x, y, z) = (io.read(Pack::X), io.read(Pack::Y), io.read(Pack::Z));
        for (((vector, x), y), z) in io.write(Pack::OUTPUT).iter_mut().zip(x).zip(y).zip(z) {
            *vector = [*x, *y, *z];
        }
    }
}

haptograph_engine::node! {
    /// The force and the torque of a wrench.
    pub struct WrenchParts(NoSettings) in "math";
    example: r#""parts": WrenchParts(input: "sensor.wrench")"#;
    in INPUT: Wrench = Port::any("The wrench.");
    out FORCE: Vector = Port::of(Quantity::FORCE, "Its force, N.");
    out TORQUE: Vector = Port::of(Quantity::TORQUE, "Its torque, N m.");
}

impl NodeKind for WrenchParts {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(WrenchParts))
    }
}

impl Processor<WrenchParts> for WrenchParts {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, WrenchParts>) {
        let wrenches = io.read(WrenchParts::INPUT);
        let (force, torque) = io.write_all((WrenchParts::FORCE, WrenchParts::TORQUE));
        let parts = force.iter_mut().zip(torque);
        for ((force, torque), [fx, fy, fz, tx, ty, tz]) in parts.zip(wrenches) {
            *force = [*fx, *fy, *fz];
            *torque = [*tx, *ty, *tz];
        }
    }
}

haptograph_engine::node! {
    /// Makes a wrench from a force and a torque about the origin.
    pub struct MakeWrench(NoSettings) in "math";
    example: r#""load": MakeWrench(force: "arm.force", torque: "torque.output")"#;
    in FORCE: Vector = Port::of(Quantity::FORCE, "The force, N.");
    in TORQUE: Vector = Port::of(Quantity::TORQUE, "The torque, N m.");
    out OUTPUT: Wrench = Port::of(Quantity::FORCE, "The wrench.");
}

impl NodeKind for MakeWrench {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(MakeWrench))
    }
}

impl Processor<MakeWrench> for MakeWrench {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, MakeWrench>) {
        let (force, torque) = (io.read(MakeWrench::FORCE), io.read(MakeWrench::TORQUE));
        let wrenches = io.write(MakeWrench::OUTPUT).iter_mut();
        for ((wrench, force), torque) in wrenches.zip(force).zip(torque) {
            wrench[..3].copy_from_slice(force);
            wrench[3..].copy_from_slice(torque);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    const A: [f64; 3] = [1.0, 2.0, -2.0];
    const B: [f64; 3] = [0.0, 3.0, 4.0];

    fn run<K: NodeKind<Settings = NoSettings>>(kinds: &[Kind], inputs: &[&[f64]]) -> Vec<Vec<f64>> {
        Bench::new::<K>(NoSettings {}, 1.0, kinds).unwrap().run(inputs)
    }

    #[test]
    fn lengths_and_products() {
        assert_eq!(run::<Magnitude>(&[Kind::VECTOR], &[&A]), [[3.0]]);
        assert_eq!(run::<Dot>(&[Kind::VECTOR; 2], &[&A, &B]), [[-2.0]]);
        assert_eq!(run::<Cross>(&[Kind::VECTOR; 2], &[&A, &B]), [[14.0, -4.0, 3.0]]);
    }

    #[test]
    fn taken_apart_and_put_together_again() {
        let parts = run::<Components>(&[Kind::VECTOR], &[&[A, B].concat()]);
        assert_eq!(parts, [[1.0, 0.0], [2.0, 3.0], [-2.0, 4.0]]);
        let parts: Vec<&[f64]> = parts.iter().map(|x| &x[..]).collect();
        assert_eq!(run::<Pack>(&[Kind::SCALAR; 3], &parts), [[A, B].concat()]);
        let wrench = run::<MakeWrench>(&[Kind::VECTOR; 2], &[&A, &B]);
        assert_eq!(wrench, [[A, B].concat()]);
        assert_eq!(run::<WrenchParts>(&[Kind::WRENCH], &[&wrench[0]]), [A, B]);
    }
}
