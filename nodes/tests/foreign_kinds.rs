//! Kinds of frames that a program registers: nodes, bridges, rings, delays and swaps treat them by their kind.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

// The example names the crates as a program does that depends on `haptograph`.
extern crate self as haptograph;
use haptograph_engine as engine;
use haptograph_nodes as nodes;
use haptograph_signal as signal;

mod cli {
    pub fn main(_: &haptograph_engine::registry::Registry) -> std::process::ExitCode {
        std::process::ExitCode::SUCCESS
    }
}

#[allow(dead_code)]
#[path = "../../examples/custom_kind.rs"]
mod custom_kind;

use haptograph_engine::document::Document;
use haptograph_engine::frame::{Kind, KindSpec, Level, OneKind, Scalar};
use haptograph_engine::graph::{CheckOptions, Graph, NodeId, check};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, FrameWriter, Io, NodeEntry, NodeKind, Port, Processor, Tick,
};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::registry::Registry;
use haptograph_engine::run::{FileSinks, Probe, Session, SessionOptions, player};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::quantity::Quantity;
use std::sync::{Arc, Mutex};

const TINT_SPEC: KindSpec = KindSpec {
    name: "tint",
    one: "a tint",
    components: &["red", "green", "blue"],
    neutral: &NEUTRAL,
    is_linear: true,
    bridges: &[],
    level: Level::norm("brightness"),
};
const NEUTRAL: [f64; 3] = [0.5, -0.25, 0.0];

/// A linear kind of three components with a neutral frame of its own.
struct Tint;
impl OneKind for Tint {
    const KIND: Kind = Kind::new(&TINT_SPEC);
    type Array = [f64; 3];
}

/// A kind of the same frames by another name.
struct Hue;
impl OneKind for Hue {
    const KIND: Kind = Kind::new(&KindSpec { name: "hue", one: "a hue", ..TINT_SPEC });
    type Array = [f64; 3];
}

/// Nodes that make a frame of three scalars.
macro_rules! painter {
    ($node:ident, $kind:ty) => {
        haptograph_engine::node! {
            /// Joins three scalars.
            struct $node(NoSettings) in "test";
            example: "";
            in RED: Scalar = Port::of(Quantity::NUMBER, "First.");
            in GREEN: Scalar = Port::of(Quantity::NUMBER, "Second.");
            in BLUE: Scalar = Port::of(Quantity::NUMBER, "Third.");
            out OUTPUT: $kind = Port::of(Quantity::NUMBER, "All three.");
        }
        impl NodeKind for $node {
            fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
                Ok(Built::new($node))
            }
        }
        impl Processor<$node> for $node {
            fn process(&mut self, _: &Tick, io: &mut Io<'_, $node>) {
                let parts = [$node::RED, $node::GREEN, $node::BLUE].map(|part| io.read(part));
                for (n, frame) in io.write($node::OUTPUT).iter_mut().enumerate() {
                    *frame = parts.map(|part| part[n]);
                }
            }
        }
    };
}

painter!(MakeTint, Tint);
painter!(MakeHue, Hue);

fn registry() -> Registry {
    let mut registry = custom_kind::registry();
    registry
        .add_kind(Tint::KIND)
        .add_kind(Hue::KIND)
        .add(NodeEntry::processor::<MakeTint>())
        .add(NodeEntry::processor::<MakeHue>());
    registry
}

/// Clocks of one driver, `fast` and `slow`, and of another one, `other`; what the sources give, and these nodes.
fn graph(nodes: &str) -> Graph {
    let text = format!(
        r#"Graph(
            format: 1,
            clocks: {{
                "fast": Driver(rate_hz: 6000), "slow": Derived(of: "fast", rate_hz: 1000),
                "other": Driver(rate_hz: 4000),
            }},
            nodes: {{
                "red": Sine(clock: "fast", frequency_hz: 70, phase_deg: 30),
                "green": Sine(clock: "fast", frequency_hz: 110, phase_deg: 60),
                "blue": Noise(clock: "fast"),
                {nodes}
            }},
        )"#
    );
    let document = Document::parse("foreign.ron", &text).unwrap_or_else(|wrong| panic!("{wrong}"));
    check(&document, &registry(), &CheckOptions::default()).unwrap_or_else(|wrong| panic!("{wrong}"))
}

/// The source of tints.
const TINT: &str = r#""tint": MakeTint(red: "red", green: "green", blue: "blue"),"#;
/// Something on the other driver, so that each graph has it.
const OTHER: &str = r#""idle": Constant(clock: "other", value: 0),"#;

fn id(graph: &Graph, path: &str) -> NodeId {
    let mut ids = graph.nodes().ids();
    ids.find(|id| graph.nodes()[*id].path == path).unwrap_or_else(|| panic!("no {path}"))
}

#[derive(Clone, Default)]
struct Heard(Arc<Mutex<Vec<f64>>>);

impl FrameWriter for Heard {
    fn write(&mut self, _: usize, frames: &[f64]) -> std::io::Result<()> {
        self.0.lock().unwrap().extend_from_slice(frames);
        Ok(())
    }
    fn finish(self: Box<Self>) -> std::io::Result<()> {
        Ok(())
    }
}

/// The components of the first outputs of these nodes over 0.3 s.
fn play<const N: usize>(graph: &Graph, paths: [&str; N]) -> [Vec<f64>; N] {
    let mut sinks = FileSinks::new(graph);
    let heard = paths.map(|path| {
        let heard = Heard::default();
        sinks.probe(Probe { node: id(graph, path), output: 0, writer: Box::new(heard.clone()) });
        heard
    });
    Session::run_offline(sinks, &SessionOptions::default().block(64).seconds(0.3), &mut |_| {}).unwrap();
    heard.map(|heard| std::mem::take(&mut *heard.0.lock().unwrap()))
}

fn component(frames: &[f64], component: usize) -> Vec<u64> {
    frames.iter().skip(component).step_by(3).map(|x| x.to_bits()).collect()
}

fn bits(frames: &[f64]) -> Vec<u64> {
    frames.iter().map(|x| x.to_bits()).collect()
}

/// The graph of a signal that takes a way as a tint and, component by component, as three scalars.
fn both_ways(way: &str) -> [Vec<f64>; 4] {
    let node =
        |name: &str, from: &str| format!("\"{name}\": {},", way.replace("FROM", &format!("\"{from}\"")));
    let ends =
        [("a", "tint"), ("b", "red"), ("c", "green"), ("d", "blue")].map(|(name, from)| node(name, from));
    play(&graph(&format!("{TINT} {OTHER} {}", ends.concat())), ["a", "b", "c", "d"])
}

#[test]
fn what_treats_linear_frames_treats_each_component_of_a_foreign_kind_as_a_scalar() {
    let ways = [
        "Gain(input: FROM, gain: -0.7)",
        "Add(inputs: [FROM, FROM])",
        "Mixer(inputs: [FROM, FROM], gains: [0.3, 2])",
        "Subtract(input: FROM, less: FROM)",
        "LowPass(input: FROM, cutoff_hz: 90)",
        "HighPass(input: FROM, cutoff_hz: 90, order: 3)",
        "Biquad(input: FROM, shape: BandPass, frequency_hz: 80, q: 3)",
        "Derivative(input: FROM)",
        "Switch(inputs: [FROM, FROM], select: 1)",
        r#"Gain(clock: "slow", input: Hold(FROM), gain: 1)"#,
        r#"Gain(clock: "slow", input: Average(FROM), gain: 1)"#,
    ];
    for way in ways {
        let [tint, scalars @ ..] = both_ways(way);
        for (number, scalar) in scalars.iter().enumerate() {
            assert!(scalar.len() >= 300, "{way}");
            assert!(component(&tint, number) == bits(scalar), "{way}, component {number}");
        }
    }
}

#[test]
fn a_resampled_signal_begins_at_the_neutral_frame() {
    let [tint, scalars @ ..] = both_ways(r#"Gain(clock: "slow", input: Resample(FROM), gain: 1)"#);
    let one = r#""one": Constant(clock: "fast", value: 1), "step": Gain(clock: "slow", input: Resample("one"), gain: 1),"#;
    let [step] = play(&graph(&format!("{OTHER} {one}")), ["step"]);
    assert_eq!(tint[..3], NEUTRAL, "before anything has come through");
    for (number, (scalar, neutral)) in scalars.iter().zip(NEUTRAL).enumerate() {
        let tint = tint.iter().skip(number).step_by(3);
        for ((tint, scalar), step) in tint.zip(scalar).zip(&step) {
            assert!((tint - (neutral + scalar - neutral * step)).abs() < 1e-12);
        }
    }
    assert!(component(&tint, 2) == bits(&scalars[2]), "where neutral is zero no bit differs");
}

#[test]
fn a_ring_rises_from_the_neutral_frame() {
    let [tint, scalars @ ..] =
        both_ways(r#"Gain(clock: "other", input: Ring(from: FROM, latency_ms: 12), gain: 1)"#);
    for (number, (scalar, neutral)) in scalars.iter().zip(NEUTRAL).enumerate() {
        let tint: Vec<f64> = tint.iter().skip(number).step_by(3).copied().collect();
        // Full after 12 ms, of which 5 ms and the length of the resampler go to the rise.
        let (begun, risen) = (40, 120);
        assert_eq!(tint[..begun], vec![neutral; begun], "component {number}");
        assert!(bits(&tint[risen..]) == bits(&scalar[risen..]), "component {number}");
        assert!(scalar[risen..].iter().any(|x| x.abs() > 0.1));
    }
    assert!(component(&tint, 2) == bits(&scalars[2]), "where neutral is zero no bit differs");
}

#[test]
fn a_delay_gives_the_neutral_frame_until_a_frame_has_passed() {
    let nodes = r#"
        "bridged": Switch(inputs: [Delay(from: "tint", frames: 5)]),
        "given": Switch(inputs: [Delay(from: "tint", frames: 5, initial: 2)]),
        "noded": Delay(input: "tint", frames: 5),
        "loop": Add(inputs: ["tint", Delay(from: "loop", frames: 5)]),
        "turn": Turn(angle: "angle"), "angle": Sine(clock: "fast", frequency_hz: 20, phase_deg: 90, quantity: "angle"),
        "turned": Switch(inputs: [Delay(from: "turn", frames: 5)]),"#;
    let paths = ["tint", "bridged", "given", "noded", "loop", "turn", "turned"];
    let [tint, bridged, given, noded, looped, turn, turned] =
        play(&graph(&format!("{TINT} {OTHER} {nodes}")), paths);
    let later = tint.len() - 15;
    for (delayed, first) in [(&bridged, NEUTRAL), (&noded, NEUTRAL), (&given, [2.0; 3])] {
        assert_eq!(delayed[..15], first.repeat(5));
        assert!(bits(&delayed[15..]) == bits(&tint[..later]));
    }
    let first = tint.iter().zip(NEUTRAL.repeat(5)).map(|(x, neutral)| x + neutral);
    assert!(looped.iter().copied().zip(first).all(|(y, x)| y.to_bits() == x.to_bits()));
    assert_eq!(turned[..20], [1.0, 0.0, 0.0, 0.0].repeat(5));
    assert!(bits(&turned[20..]) == bits(&turn[..turn.len() - 20]) && turn[0] < 1.0);
}

/// The first output of `out` in a run of `old`, in whose place `new` is put after 64 frames of 200, if there is one.
fn swapped(old: &Graph, new: Option<&Graph>) -> Vec<f64> {
    let plan = |graph: &Graph| {
        let options = PlanOptions::default().block(16).tap(id(graph, "out"), 0);
        Arc::new(Plan::of(graph, &options).remove(0))
    };
    let (mut live, mut control) = player(plan(old));
    let mut heard = Vec::new();
    for part in [64, 136] {
        if let Some(new) = new.filter(|_| part > 64) {
            control.swap(plan(new)).unwrap();
        }
        live.process_with(part, |run, _| heard.extend_from_slice(run.tap(0)));
    }
    heard
}

/// A node that makes two graphs different.
const MORE: &str = r#""more": Constant(clock: "fast", value: 1),"#;

#[test]
fn state_of_a_foreign_kind_goes_on_in_a_swap() {
    let out = |way: &str| format!("{TINT} {OTHER} \"out\": {way},");
    let turn =
        r#""turn": Turn(angle: "angle"), "angle": Sine(clock: "slow", frequency_hz: 20, quantity: "angle"),"#;
    let ways = [
        out(r#"LowPass(input: "tint", cutoff_hz: 90)"#),
        out(r#"Delay(input: "tint", frames: 30)"#),
        out(r#"Switch(inputs: [Delay(from: "tint", frames: 30)])"#),
        out(r#"Add(inputs: ["tint", Delay(from: "out", frames: 30)])"#),
        out(r#"Gain(clock: "slow", input: Average("tint"), gain: 1)"#),
        out(r#"Gain(clock: "slow", input: Resample("tint"), gain: 1)"#),
        format!(r#"{OTHER} {turn} "out": Switch(clock: "fast", inputs: [Slerp("turn")]),"#),
        format!(r#"{OTHER} {turn} "out": Switch(clock: "fast", inputs: [Hold("turn")]),"#),
        format!(r#"{OTHER} {turn} "out": Switch(inputs: [Delay(from: "turn", frames: 8)]),"#),
    ];
    for way in ways {
        let (old, new) = (graph(&way), graph(&format!("{way} {MORE}")));
        let (alone, heard) = (swapped(&old, None), swapped(&old, Some(&new)));
        assert!(alone.len() > 30 && bits(&alone) == bits(&heard), "{way}");
    }
}

#[test]
fn a_delay_line_does_not_go_on_as_one_of_another_kind_of_the_same_width() {
    for (way, width) in [
        (r#"Switch(inputs: [Delay(from: "tint", frames: 30)])"#, 3),
        (r#"Delay(input: "tint", frames: 30)"#, 3),
    ] {
        let tint = format!("{TINT} {OTHER} \"out\": {way},");
        let hue = graph(&tint.replace("MakeTint", "MakeHue"));
        let heard = swapped(&graph(&tint), Some(&hue));
        let from = 64 * width;
        assert_eq!(heard[from..from + 30 * width], NEUTRAL.repeat(30), "{way}");
    }
}

#[test]
fn a_ring_does_not_go_on_as_one_of_another_kind_of_the_same_width() {
    let tint =
        format!(r#"{TINT} "out": Gain(clock: "other", input: Ring(from: "tint", latency_ms: 12), gain: 1),"#);
    for (next, goes_on) in [(format!("{tint} {MORE}"), true), (tint.replace("MakeTint", "MakeHue"), false)] {
        let old = graph(&tint);
        let options = SessionOptions::default();
        let (mut lives, mut session) = Session::open_all(FileSinks::new(&old), &options, None).unwrap();
        for part in 0..200 {
            if part == 100 {
                let filled = session.rings().all(|ring| ring.counts.fill_s.is_some());
                assert!(filled);
                session.change_without_files(&graph(&next)).unwrap();
                let filled = session.rings().all(|ring| ring.counts.fill_s.is_some());
                assert_eq!(filled, goes_on);
            }
            for live in &mut lives {
                let frames = live.run().rate_hz() / 1000.0;
                live.process(frames as usize);
            }
        }
        session.finish_all(lives);
    }
}

#[test]
fn the_fingerprint_of_a_node_has_the_kinds_of_its_inputs() {
    let tint = format!("{TINT} {OTHER} \"out\": Gain(input: \"tint\", gain: 1),");
    let fingerprint = |text: &str| {
        let graph = graph(text);
        graph.nodes()[id(&graph, "out")].fingerprint
    };
    assert_eq!(fingerprint(&tint), fingerprint(&tint));
    assert_ne!(fingerprint(&tint), fingerprint(&tint.replace("MakeTint", "MakeHue")));
}
