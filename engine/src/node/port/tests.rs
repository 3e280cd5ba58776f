//! Toy nodes that read and write ports of every form.

use super::*;
use crate::frame::{Event, Kind, KindSpec, Level, Linear, OneKind, Record, Scalar, Vector, Wrench};
use crate::node::{
    BuildContext, BuildError, Built, Family, Held, Io, Many, Named, NodeKind, Optional, Port, Processor, Tick,
};
use crate::settings::NoSettings;
use crate::testing::Bench;
use haptograph_signal::quantity::Quantity;

/// A frame of a kind that the engine does not have.
#[derive(Debug, Clone, Copy)]
struct Patch {
    face: u32,
    gain: f64,
}

impl OneKind for Patch {
    const KIND: Kind = Kind::new(&KindSpec {
        name: "patch",
        one: "a patch",
        components: &["face", "gain"],
        neutral: &[0.0, 1.0],
        is_linear: false,
        bridges: &[],
        level: Level::norm("size"),
    });
    type Array = [f64; Self::KIND.width()];
}

impl Record for Patch {
    fn from_components([face, gain]: &Self::Array) -> Self {
        Self { face: *face as u32, gain: *gain }
    }

    fn to_components(&self) -> Self::Array {
        [f64::from(self.face), self.gain]
    }
}

crate::node! {
    /// Has an input of every form.
    struct Every(NoSettings) in "toys";
    example: "";
    in SCALAR: Scalar = Port::of(Quantity::FORCE, "A number.");
    in VECTOR: Vector = Port::of(Quantity::FORCE, "Three of them.");
    in PATCH: Patch = Port::of(Quantity::NUMBER, "A record.");
    in HELD: Patch, Held = Port::of(Quantity::NUMBER, "Runs.");
    in EXTRA: Scalar, Optional = Port::of(Quantity::FORCE, "A number, perhaps.");
    in EXTRA_HELD: Vector, Optional<Held> = Port::of(Quantity::FORCE, "Runs, perhaps.");
    in MANY as "terms": Linear, Many = Port::any("What is added.");
    out SUM: Scalar = Port::of(Quantity::FORCE, "A number.");
    out TURNED: Vector = Port::of(Quantity::FORCE, "Three of them.");
    out TOTAL: Linear = Port::like("terms", "As wide as the terms.");
    out EVENT: Event = Port::of(Quantity::NUMBER, "A record.");
}

impl NodeKind for Every {
    fn build(_: NoSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        assert_eq!((cx.width(Every::VECTOR), cx.width(Every::HELD)), (3, Patch::KIND.width()));
        assert_eq!((cx.connections(Every::MANY), cx.width(Every::MANY)), (2, 3));
        let (extra, runs) = (cx.is_connected(Every::EXTRA), cx.is_connected(Every::EXTRA_HELD));
        assert_eq!(extra, runs);
        Ok(Built::new(Reader))
    }
}

#[derive(Clone)]
struct Reader;

impl Processor<Every> for Reader {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Every>) {
        let (scalars, vectors) = (io.read(Every::SCALAR), io.read(Every::VECTOR));
        let (extra, extra_runs) = (io.read(Every::EXTRA), io.read(Every::EXTRA_HELD));
        assert_eq!((scalars.len(), vectors.len()), (tick.frames, tick.frames));
        let (runs, patches) = (io.read(Every::HELD), io.decode(Every::PATCH));
        // Not in the order of the spec.
        let (turned, sum) = io.write_all((Every::TURNED, Every::SUM));
        for (((turned, sum), [x, y, z]), scalar) in turned.iter_mut().zip(&mut *sum).zip(vectors).zip(scalars)
        {
            (*turned, *sum) = ([*z, *x, *y], x + y + z + scalar);
        }
        for (sum, patch) in sum.iter_mut().zip(patches) {
            *sum += f64::from(patch.face);
        }
        for (frames, patch) in runs {
            let gain = Patch::from_components(patch).gain;
            sum[frames].iter_mut().for_each(|sum| *sum *= gain);
        }
        for (sum, extra) in sum.iter_mut().zip(extra.into_iter().flatten()) {
            *sum += extra;
        }
        for (frames, [_, _, z]) in extra_runs.into_iter().flatten() {
            sum[frames].iter_mut().for_each(|sum| *sum += z);
        }
        let (terms, width) = (io.read(Every::MANY), io.width(Every::MANY));
        assert_eq!((terms.len(), width), (2, 3));
        assert_eq!(terms.nth_or_last(7), terms.nth_or_last(1));
        let total = io.write(Every::TOTAL);
        total.fill(0.0);
        for term in terms.iter() {
            total.iter_mut().zip(term).for_each(|(total, term)| *total += term);
        }
        for event in io.write(Every::EVENT) {
            *event = Event::default().to_components();
        }
    }
}

fn run(with_extra: bool, blocks: &[usize]) -> Vec<Vec<f64>> {
    let extra = |kind| with_extra.then_some(kind);
    let kinds = [
        Some(Kind::SCALAR),
        Some(Kind::VECTOR),
        Some(Patch::KIND),
        Some(Patch::KIND),
        extra(Kind::SCALAR),
        extra(Kind::VECTOR),
        Some(Kind::VECTOR),
        Some(Kind::VECTOR),
    ];
    let mut bench = Bench::with_gaps::<Every>(NoSettings {}, 1000.0, &kinds).unwrap();
    let face = |face| Patch { face, gain: 1.0 }.to_components();
    let filter = |gain| Patch { face: 0, gain }.to_components();
    let inputs: [&[f64]; 8] = [
        &[1.0, 2.0, 3.0],
        &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
        &[face(10), face(20), face(30)].concat(),
        &[filter(2.0), filter(2.0), filter(1.0)].concat(),
        &[0.25, 0.5, 0.75],
        &[0.0, 0.0, 100.0, 0.0, 0.0, 100.0, 0.0, 0.0, 200.0],
        &[1.0; 9],
        &[2.0; 9],
    ];
    bench.run_frames(3, &inputs, blocks)
}

#[test]
fn ports_of_every_form_are_read_and_written_by_their_handles() {
    for blocks in [&[3][..], &[1], &[2, 1]] {
        let [sum, turned, total, event] = &run(false, blocks)[..] else { panic!("four outputs") };
        assert_eq!(sum, &[34.0, 74.0, 57.0]);
        assert_eq!(turned, &[3.0, 1.0, 2.0, 6.0, 4.0, 5.0, 9.0, 7.0, 8.0]);
        assert_eq!((&total[..], &event[..]), (&[3.0; 9][..], &[0.0; 6][..]));
        assert_eq!(run(true, blocks)[0], [134.25, 174.5, 257.75]);
    }
}

#[test]
fn a_kind_has_a_neutral_frame_as_wide_as_it_is() {
    assert_eq!(Patch::KIND.neutral().collect::<Vec<_>>(), [0.0, 1.0]);
    for kind in Kind::ENGINE {
        assert_eq!(kind.neutral().collect::<Vec<_>>(), vec![0.0; kind.width()], "{kind}");
    }
    const EMPTY: KindSpec = KindSpec { components: &[], ..*Kind::SCALAR.spec() };
    let message = refused(|| Kind::new(&EMPTY));
    assert_eq!(message, "a frame has at least one component");
}

#[test]
fn scripts_find_every_sampled_port() {
    let inputs = Every::SPEC.any_inputs();
    let inputs: Vec<(&str, usize)> = inputs.map(|(port, handle)| (port.name, handle.index())).collect();
    assert_eq!(inputs, [("scalar", 0), ("vector", 1), ("patch", 2), ("extra", 4)]);
    let outputs = Every::SPEC.any_outputs().map(|(port, _)| port.name);
    assert_eq!(outputs.collect::<Vec<_>>(), ["sum", "turned", "total", "event"]);
}

/// The message of the panic that is a compile error in a constant.
fn refused<T>(look_up: impl FnOnce() -> T + std::panic::UnwindSafe) -> String {
    let Err(panic) = std::panic::catch_unwind(look_up) else { panic!("it was found") };
    (*panic.downcast::<&str>().expect("a message")).to_owned()
}

#[test]
fn what_does_not_fit_the_declaration_is_refused() {
    let message = refused(|| Input::<Every, Vector>::declared(0, "scalar").check());
    assert_eq!(message, "the frames of this input are of another kind");
    let message = refused(|| Input::<Every, Scalar, Many>::declared(0, "scalar").check());
    assert_eq!(message, "an input of any number of connections comes last");
    let message = refused(|| Output::<Every, Wrench>::declared(1, "turned").check());
    assert_eq!(message, "the frames of this output are of another kind");
    let message = refused(|| Output::<Every, Linear>::declared(3, "event").check());
    assert_eq!(message, "the frames of this output are of another kind");
    let message = refused(|| Output::<Every, Event, Family>::declared(3, "event").check());
    assert!(message.contains("`.named_by(\"setting\")`"), "{message}");
    let message = refused(|| Output::<Each, Linear>::declared(1, "products").check());
    assert!(message.contains("`Family`"), "{message}");
}

#[test]
#[should_panic(expected = "requested twice")]
fn an_output_is_not_written_twice_at_once() {
    crate::node! {
        /// Writes an output twice.
        struct Twice(NoSettings) in "toys";
        example: "";
        out OUT: Scalar = Port::of(Quantity::NUMBER, "");
    }

    impl Processor<Twice> for Twice {
        fn process(&mut self, _: &Tick, io: &mut Io<'_, Twice>) {
            let _ = io.write_all((Twice::OUT, Twice::OUT));
        }
    }

    impl NodeKind for Twice {
        fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
            Ok(Built::new(Self))
        }
    }

    let mut bench = Bench::new::<Twice>(NoSettings {}, 1000.0, &[]).unwrap();
    bench.run_source(1);
}

crate::settings! {
    /// Factors of an [`Each`].
    struct EachSettings {
        /// One for each output.
        factors: Vec<f64> = vec![];
    }
}

crate::node! {
    /// Has an output for each factor.
    struct Each(EachSettings) in "toys";
    example: "";
    in FACTORED as "terms": Linear, Named = Port::any("What is added and multiplied.");
    out COUNT: Scalar = Port::of(Quantity::NUMBER, "How many products there are.");
    out PRODUCTS: Linear, Family = Port::like("terms", "A product.").named_by("factors");
}

impl NodeKind for Each {
    fn members(settings: &EachSettings) -> Result<Vec<String>, BuildError> {
        Ok(settings.factors.iter().map(|factor| format!("by {factor}")).collect())
    }

    fn build(settings: EachSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        assert_eq!((cx.names(Each::FACTORED).len(), cx.connections(Each::FACTORED)), (2, 2));
        Ok(Built::new(Factors(settings.factors)))
    }
}

#[derive(Clone)]
struct Factors(Vec<f64>);

impl Processor<Each> for Factors {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Each>) {
        let terms = io.read(Each::FACTORED);
        let members = io.members(Each::PRODUCTS);
        assert_eq!(members, self.0.len());
        assert!(members == 0 || io.member_width(Each::PRODUCTS) == io.width(Each::FACTORED));
        io.write(Each::COUNT).fill(members as f64);
        for (member, factor) in self.0.iter().enumerate() {
            let product = io.write_member(Each::PRODUCTS, member);
            product.fill(0.0);
            for term in terms.iter() {
                product.iter_mut().zip(term).for_each(|(y, x)| *y += factor * x);
            }
        }
    }
}

#[test]
fn a_family_of_outputs_is_as_large_as_the_settings_say() {
    let bench = |factors: &[f64]| {
        let settings = EachSettings { factors: factors.to_vec() };
        Bench::with_names::<Each>(settings, 10.0, &[Kind::VECTOR; 2], &["a", "b"]).unwrap()
    };
    let (x, y) = ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [10.0; 6]);
    let mut two = bench(&[1.0, -2.0]);
    assert_eq!(two.outputs(), ["count", "by 1", "by -2"]);
    let [count, once, twice] = two.run_in_blocks(&[&x, &y], &[1]).try_into().unwrap();
    assert_eq!(count, [2.0; 2]);
    assert_eq!(once, [11.0, 12.0, 13.0, 14.0, 15.0, 16.0]);
    assert_eq!(twice, once.iter().map(|y| -2.0 * y).collect::<Vec<_>>());
    assert_eq!(two.components("by -2"), &twice[3..]);
    assert_eq!(bench(&[]).run(&[&x, &y]), [[0.0; 2]]);
}

#[test]
#[should_panic(expected = "no member 1")]
fn a_member_that_does_not_exist_is_not_written() {
    let mut memory = [0.0; 1];
    let placing = [crate::io::Placing { start: 0, width: 1 }; 2];
    let ports = Ports {
        frames: 1,
        offset: 0,
        inputs: &[],
        outputs: &placing,
        before: &[],
        out: &mut memory,
        behind: &[],
    };
    Io::<Each>::new(ports).write_member(Each::PRODUCTS, 1);
}
