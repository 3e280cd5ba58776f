//! Toy nodes that read and write ports of every form.

use super::*;
use crate::frame::{Event, Kind, KindSpec, Level, Linear, OneKind, Record, Scalar, Vector, Wrench};
use crate::node::{
    BuildContext, BuildError, Built, Io, NodeKind, Processor, Tick, any_input, input, output, output_like,
};
use crate::settings::NoSettings;
use crate::testing::Bench;
use haptograph_signal::quantity::Quantity;

const TERMS: InputSpec = InputSpec { presence: Presence::Many, ..any_input("terms", "What is added.") };

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

/// One input of every form.
struct Every;

impl NodeKind for Every {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Every",
        group: "toys",
        doc: "Has an input of every form.",
        source: "",
        inputs: &[
            input("scalar", Kind::SCALAR, Quantity::FORCE, "A number."),
            input("vector", Kind::VECTOR, Quantity::FORCE, "Three of them."),
            input("patch", Patch::KIND, Quantity::NUMBER, "A record."),
            input("held", Patch::KIND, Quantity::NUMBER, "Runs.").held(),
            input("extra", Kind::SCALAR, Quantity::FORCE, "A number, perhaps.").optional(),
            input("extra_held", Kind::VECTOR, Quantity::FORCE, "Runs, perhaps.").optional().held(),
            TERMS,
        ],
        outputs: &[
            output("sum", Kind::SCALAR, Quantity::FORCE, "A number."),
            output("turned", Kind::VECTOR, Quantity::FORCE, "Three of them."),
            output_like("total", "terms", "As wide as the terms."),
            output("event", Kind::EVENT, Quantity::NUMBER, "A record."),
        ],
        example: "",
    };

    fn build(_: NoSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        assert_eq!((cx.width(VECTOR), cx.width(HELD)), (3, Patch::KIND.width()));
        assert_eq!((cx.connections(MANY), cx.width(MANY)), (2, 3));
        let (extra, runs) = (cx.is_connected(EXTRA), cx.is_connected(EXTRA_HELD));
        assert_eq!(extra, runs);
        Ok(Built::new(Reader))
    }
}

const SCALAR: Input<Every, Scalar> = Input::named("scalar");
const VECTOR: Input<Every, Vector> = Input::named("vector");
const PATCH: Input<Every, Patch> = Input::named("patch");
const HELD: Input<Every, Patch, Held> = Input::named("held");
const EXTRA: Input<Every, Scalar, Optional> = Input::named("extra");
const EXTRA_HELD: Input<Every, Vector, Optional<Held>> = Input::named("extra_held");
const MANY: Input<Every, Linear, Many> = Input::named("terms");
const SUM: Output<Every, Scalar> = Output::named("sum");
const TURNED: Output<Every, Vector> = Output::named("turned");
const TOTAL: Output<Every, Linear> = Output::named("total");
const EVENT: Output<Every, Event> = Output::named("event");

#[derive(Clone)]
struct Reader;

impl Processor<Every> for Reader {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Every>) {
        let (scalars, vectors) = (io.read(SCALAR), io.read(VECTOR));
        let (extra, extra_runs) = (io.read(EXTRA), io.read(EXTRA_HELD));
        assert_eq!((scalars.len(), vectors.len()), (tick.frames, tick.frames));
        let (runs, patches) = (io.read(HELD), io.decode(PATCH));
        // Not in the order of the spec.
        let (turned, sum) = io.write_all((TURNED, SUM));
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
        let (terms, width) = (io.read(MANY), io.width(MANY));
        assert_eq!((terms.len(), width), (2, 3));
        assert_eq!(terms.nth_or_last(7), terms.nth_or_last(1));
        let total = io.write(TOTAL);
        total.fill(0.0);
        for term in terms.iter() {
            total.iter_mut().zip(term).for_each(|(total, term)| *total += term);
        }
        for event in io.write(EVENT) {
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
fn what_does_not_fit_the_declaration_has_no_handle() {
    let message = refused(|| Input::<Every, Scalar, Sampled>::named("scalr"));
    assert_eq!(message, "no input has this name");
    let message = refused(|| Input::<Every, Scalar, Sampled>::named("vector"));
    assert_eq!(message, "the frames of this input are of another kind");
    let message = refused(|| Input::<Every, Scalar, Sampled>::named("extra"));
    assert!(message.contains("`Input<_, _, Optional>`"), "{message}");
    let message = refused(|| Input::<Every, Scalar, Optional>::named("scalar"));
    assert!(message.contains("always connected"), "{message}");
    let message = refused(|| Input::<Every, Linear, Sampled>::named("terms"));
    assert!(message.contains("`Input<_, _, Many>`"), "{message}");
    let message = refused(|| Input::<Every, Patch, Sampled>::named("held"));
    assert!(message.contains("runs"), "{message}");
    let message = refused(|| Input::<Every, Scalar, Held>::named("scalar"));
    assert!(message.contains("frame per tick"), "{message}");
    let message = refused(|| Output::<Every, Scalar>::named("turnd"));
    assert_eq!(message, "no output has this name");
    let message = refused(|| Output::<Every, Wrench>::named("turned"));
    assert_eq!(message, "the frames of this output are of another kind");
    let message = refused(|| Output::<Every, Linear>::named("event"));
    assert_eq!(message, "the frames of this output are of another kind");
}

#[test]
#[should_panic(expected = "requested twice")]
fn an_output_is_not_written_twice_at_once() {
    #[derive(Clone)]
    struct Twice;

    impl Processor<Twice> for Twice {
        fn process(&mut self, _: &Tick, io: &mut Io<'_, Twice>) {
            let _ = io.write_all((OUT, OUT));
        }
    }

    impl NodeKind for Twice {
        type Settings = NoSettings;
        const SPEC: NodeSpec = NodeSpec {
            name: "Twice",
            group: "toys",
            doc: "",
            source: "",
            inputs: &[],
            outputs: &[output("out", Kind::SCALAR, Quantity::NUMBER, "")],
            example: "",
        };

        fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
            Ok(Built::new(Self))
        }
    }

    const OUT: Output<Twice, Scalar> = Output::named("out");
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

/// As many outputs as factors, behind one that is always there.
struct Each;

impl NodeKind for Each {
    type Settings = EachSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Each",
        group: "toys",
        doc: "Has an output for each factor.",
        source: "",
        inputs: &[any_input("terms", "What is added and multiplied.").named()],
        outputs: &[
            output("count", Kind::SCALAR, Quantity::NUMBER, "How many products there are."),
            output_like("products", "terms", "A product.").named_by("factors"),
        ],
        example: "",
    };

    fn members(settings: &EachSettings) -> Result<Vec<String>, BuildError> {
        Ok(settings.factors.iter().map(|factor| format!("by {factor}")).collect())
    }

    fn build(settings: EachSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        assert_eq!((cx.names(FACTORED).len(), cx.connections(FACTORED)), (2, 2));
        Ok(Built::new(Factors(settings.factors)))
    }
}

const FACTORED: Input<Each, Linear, Named> = Input::named("terms");
const COUNT: Output<Each, Scalar> = Output::named("count");
const PRODUCTS: OutputFamily<Each, Linear> = OutputFamily::named("products");

#[derive(Clone)]
struct Factors(Vec<f64>);

impl Processor<Each> for Factors {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Each>) {
        let terms = io.read(FACTORED);
        let members = io.members(PRODUCTS);
        assert_eq!(members, self.0.len());
        assert!(members == 0 || io.member_width(PRODUCTS) == io.width(FACTORED));
        io.write(COUNT).fill(members as f64);
        for (member, factor) in self.0.iter().enumerate() {
            let product = io.write_member(PRODUCTS, member);
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
    Io::<Each>::new(ports).write_member(PRODUCTS, 1);
}
