//! 3-vectors and wrenches: length, products, components.

use haptograph_engine::frame::{Kind, Scalar, Vector, Wrench};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Input, InputSpec, Io, KindRule, NodeKind, NodeSpec, Output, OutputCount,
    OutputRole, OutputSpec, Processor, QuantityRule, Tick, any_input, input, output,
};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::quantity::Quantity;

use crate::vector::{cross, dot};

const fn vector_input(name: &'static str, doc: &'static str) -> InputSpec {
    InputSpec { kind: KindRule::Is(Kind::VECTOR), ..any_input(name, doc) }
}

const fn scalar_of(name: &'static str, like: &'static str, doc: &'static str) -> OutputSpec {
    OutputSpec {
        name,
        kind: KindRule::Is(Kind::SCALAR),
        quantity: QuantityRule::Same(like),
        role: OutputRole::Plain,
        count: OutputCount::One,
        doc,
    }
}

/// The length of a vector.
#[derive(Debug, Clone, Copy)]
pub struct Magnitude;

impl NodeKind for Magnitude {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Magnitude",
        group: "math",
        doc: "The length of a 3-vector.",
        source: "",
        inputs: &[vector_input("input", "The vector.")],
        outputs: &[scalar_of("output", "input", "Its length.")],
        example: r#""pull": Magnitude(input: "arm.force")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Magnitude))
    }
}

impl Magnitude {
    const INPUT: Input<Self, Vector> = Input::named("input");
    const OUTPUT: Output<Self, Scalar> = Output::named("output");
}

impl Processor<Magnitude> for Magnitude {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Magnitude>) {
        let x = io.read(Magnitude::INPUT);
        for (y, [a, b, c]) in io.write(Magnitude::OUTPUT).iter_mut().zip(x) {
            *y = (a * a + b * b + c * c).sqrt();
        }
    }
}

/// The scalar product.
#[derive(Debug, Clone, Copy)]
pub struct Dot;

impl NodeKind for Dot {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Dot",
        group: "math",
        doc: "The scalar product of two 3-vectors: force and velocity give power.",
        source: "",
        inputs: &[vector_input("a", "The first vector."), vector_input("b", "The second vector.")],
        outputs: &[OutputSpec {
            name: "output",
            kind: KindRule::Is(Kind::SCALAR),
            quantity: QuantityRule::Product("a", "b"),
            role: OutputRole::Plain,
            count: OutputCount::One,
            doc: "a . b",
        }],
        example: r#""power": Dot(a: "arm.force", b: "arm.velocity")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Dot))
    }
}

impl Dot {
    const A: Input<Self, Vector> = Input::named("a");
    const B: Input<Self, Vector> = Input::named("b");
    const OUTPUT: Output<Self, Scalar> = Output::named("output");
}

impl Processor<Dot> for Dot {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Dot>) {
        let (a, b) = (io.read(Dot::A), io.read(Dot::B));
        for ((y, a), b) in io.write(Dot::OUTPUT).iter_mut().zip(a).zip(b) {
            *y = dot(*a, *b);
        }
    }
}

/// The vector product.
#[derive(Debug, Clone, Copy)]
pub struct Cross;

impl NodeKind for Cross {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Cross",
        group: "math",
        doc: "The vector product of two 3-vectors: lever arm and force give torque.",
        source: "",
        inputs: &[vector_input("a", "The first vector."), vector_input("b", "The second vector.")],
        outputs: &[OutputSpec {
            name: "output",
            kind: KindRule::Is(Kind::VECTOR),
            quantity: QuantityRule::Product("a", "b"),
            role: OutputRole::Plain,
            count: OutputCount::One,
            doc: "a x b",
        }],
        example: r#""torque": Cross(a: "arm.position", b: "arm.force")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Cross))
    }
}

impl Cross {
    const A: Input<Self, Vector> = Input::named("a");
    const B: Input<Self, Vector> = Input::named("b");
    const OUTPUT: Output<Self, Vector> = Output::named("output");
}

impl Processor<Cross> for Cross {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Cross>) {
        let (a, b) = (io.read(Cross::A), io.read(Cross::B));
        for ((y, a), b) in io.write(Cross::OUTPUT).iter_mut().zip(a).zip(b) {
            *y = cross(*a, *b);
        }
    }
}

/// The components of a vector.
#[derive(Debug, Clone, Copy)]
pub struct Components;

impl NodeKind for Components {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Components",
        group: "math",
        doc: "The three components of a 3-vector as scalars.",
        source: "",
        inputs: &[vector_input("input", "The vector.")],
        outputs: &[
            scalar_of("x", "input", "Along x."),
            scalar_of("y", "input", "Along y."),
            scalar_of("z", "input", "Along z."),
        ],
        example: r#""tip": Components(input: "stylus.position")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Components))
    }
}

impl Components {
    const INPUT: Input<Self, Vector> = Input::named("input");
    const X: Output<Self, Scalar> = Output::named("x");
    const Y: Output<Self, Scalar> = Output::named("y");
    const Z: Output<Self, Scalar> = Output::named("z");
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

/// A vector from three scalars.
#[derive(Debug, Clone, Copy)]
pub struct Pack;

impl NodeKind for Pack {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Pack",
        group: "math",
        doc: "Makes a 3-vector from three scalars of one quantity.",
        source: "",
        inputs: &[
            InputSpec { kind: KindRule::Is(Kind::SCALAR), ..any_input("x", "Along x.") },
            InputSpec {
                kind: KindRule::Is(Kind::SCALAR),
                quantity: QuantityRule::Same("x"),
                ..any_input("y", "Along y.")
            },
            InputSpec {
                kind: KindRule::Is(Kind::SCALAR),
                quantity: QuantityRule::Same("x"),
                ..any_input("z", "Along z.")
            },
        ],
        outputs: &[OutputSpec {
            name: "output",
            kind: KindRule::Is(Kind::VECTOR),
            quantity: QuantityRule::Same("x"),
            role: OutputRole::Plain,
            count: OutputCount::One,
            doc: "The vector.",
        }],
        example: r#""path": Pack(x: "east.output", y: "north.output", z: "up.output")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Pack))
    }
}

impl Pack {
    const X: Input<Self, Scalar> = Input::named("x");
    const Y: Input<Self, Scalar> = Input::named("y");
    const Z: Input<Self, Scalar> = Input::named("z");
    const OUTPUT: Output<Self, Vector> = Output::named("output");
}

impl Processor<Pack> for Pack {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Pack>) {
        let (x, y, z) = (io.read(Pack::X), io.read(Pack::Y), io.read(Pack::Z));
        for (((vector, x), y), z) in io.write(Pack::OUTPUT).iter_mut().zip(x).zip(y).zip(z) {
            *vector = [*x, *y, *z];
        }
    }
}

/// Force and torque of a wrench.
#[derive(Debug, Clone, Copy)]
pub struct WrenchParts;

impl NodeKind for WrenchParts {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "WrenchParts",
        group: "math",
        doc: "The force and the torque of a wrench.",
        source: "",
        inputs: &[InputSpec { kind: KindRule::Is(Kind::WRENCH), ..any_input("input", "The wrench.") }],
        outputs: &[
            output("force", Kind::VECTOR, Quantity::FORCE, "Its force, N."),
            output("torque", Kind::VECTOR, Quantity::TORQUE, "Its torque, N m."),
        ],
        example: r#""parts": WrenchParts(input: "sensor.wrench")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(WrenchParts))
    }
}

impl WrenchParts {
    const INPUT: Input<Self, Wrench> = Input::named("input");
    const FORCE: Output<Self, Vector> = Output::named("force");
    const TORQUE: Output<Self, Vector> = Output::named("torque");
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

/// A wrench from a force and a torque.
#[derive(Debug, Clone, Copy)]
pub struct MakeWrench;

impl NodeKind for MakeWrench {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "MakeWrench",
        group: "math",
        doc: "Makes a wrench from a force and a torque about the origin.",
        source: "",
        inputs: &[
            input("force", Kind::VECTOR, Quantity::FORCE, "The force, N."),
            input("torque", Kind::VECTOR, Quantity::TORQUE, "The torque, N m."),
        ],
        outputs: &[output("output", Kind::WRENCH, Quantity::FORCE, "The wrench.")],
        example: r#""load": MakeWrench(force: "arm.force", torque: "torque.output")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(MakeWrench))
    }
}

impl MakeWrench {
    const FORCE: Input<Self, Vector> = Input::named("force");
    const TORQUE: Input<Self, Vector> = Input::named("torque");
    const OUTPUT: Output<Self, Wrench> = Output::named("output");
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
