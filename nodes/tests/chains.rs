//! Chains of nodes that compute by laws, in registers: the same bits as node by node.

#![allow(missing_docs)]

use haptograph_engine::document::Document;
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::run::{Player, Run, SessionOptions};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::fmt::Write;
use std::sync::Arc;

/// Nodes of a chain; the last three have no law and divide it.
const KINDS: [&str; 13] = [
    r#"Gain(input: "A", gain: -1.7)"#,
    r#"Offset(input: "A", offset: 0.3)"#,
    r#"Calibrate(input: "A", from: "number", to: "number", factor: 0.9)"#,
    r#"Clamp(input: "A", lowest: -0.8, highest: 0.9)"#,
    r#"Abs(input: "A")"#,
    r#"Add(inputs: ["A", "B"])"#,
    r#"Subtract(input: "B", less: "A")"#,
    r#"Multiply(input: "A", by: "B")"#,
    r#"Divide(input: "B", by: "A")"#,
    r#"Mixer(inputs: ["B", "A"], gains: [0.4, -0.7], master: 1.5)"#,
    r#"SoftClip(input: "A", limit: 0.7)"#,
    r#"LowPass(input: "A", cutoff_hz: 300)"#,
    r#"Add(inputs: ["A", "B", "A"])"#,
];
/// Filters, alone or divided by others.
const FILTERS: [&str; 7] = [
    r#"LowPass(input: "A", cutoff_hz: 900)"#,
    r#"LowPass(input: "A", cutoff_hz: 2000, order: 5)"#,
    r#"HighPass(input: "A", cutoff_hz: 3, order: 1)"#,
    r#"HighPass(input: "A", cutoff_hz: 40, order: 12)"#,
    r#"BandPass(input: "A", low_hz: 20, high_hz: 3500)"#,
    r#"DoublePole(input: "A")"#,
    r#"Gain(input: "A", gain: 1.7)"#,
];
const FIXED: &str = r#"Expression(inputs: {"x": "A"}, formula: "0.5 * x", quantity: "number")"#;
const NODES: usize = 24;
const FRAMES: usize = 333;

/// A chain whose nodes read the one before and any earlier one; every other one also goes through a loop of one frame.
fn text(seed: u64, kinds: &[&str]) -> String {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut text = String::from(
        r#"Graph(format: 1, clocks: { "audio": Driver(rate_hz: 8000) }, nodes: { "n0": Sine(clock: "audio", frequency_hz: 440, amplitude: 1, quantity: "number"),"#,
    );
    let is_loop = seed.is_multiple_of(2);
    for number in 1..=NODES {
        let earlier = random.random_range(0..number);
        let kind = kinds[random.random_range(0..kinds.len())];
        // A loop needs a node of a fixed quantity.
        let kind = if is_loop && number == NODES - 2 { FIXED } else { kind };
        let before = match is_loop && number == 3 {
            true => format!(r#"Delay(from: "n{}", frames: 1)"#, NODES - 2),
            false => format!(r#""n{}""#, number - 1),
        };
        let kind = kind.replace(r#""A""#, &before).replace(r#""B""#, &format!(r#""n{earlier}""#));
        let _ = write!(text, r#""n{number}": {kind},"#);
    }
    text + "} )"
}

fn graph(text: &str) -> Graph {
    let document = Document::parse("chain.ron", text).expect("it is RON");
    let checked = check(&document, &haptograph_nodes::registry(), &CheckOptions::default());
    checked.unwrap_or_else(|wrong| panic!("{wrong}\n{text}"))
}

/// The bits of the last node, run in these blocks with so many of the nodes tapped.
fn bits(graph: &Graph, blocks: &[usize], taps: usize) -> Vec<u64> {
    let outputs = (0..taps).map(|back| graph.find_output(&format!("n{}.output", NODES - back)));
    let outputs = outputs.map(|output| output.expect("it has one output"));
    let options = PlanOptions::default().block(64).taps(outputs);
    let mut run = Run::new(Arc::new(Plan::of(graph, &options).remove(0)));
    let mut all = Vec::new();
    for block in blocks.iter().cycle() {
        if all.len() >= FRAMES {
            break;
        }
        run.advance(*block.min(&(FRAMES - all.len())));
        // The bits of NaN are the hardware's.
        all.extend(run.tap(0).iter().map(|x| if x.is_nan() { 1 } else { x.to_bits() }));
    }
    all
}

#[test]
fn chains_have_the_same_bits_in_any_block_and_whoever_reads_an_inner_wire() {
    for seed in 0..60 {
        let kinds = if seed < 40 { &KINDS[..] } else { &FILTERS };
        let graph = graph(&text(seed, kinds));
        let frame_by_frame = bits(&graph, &[1], 1);
        assert!(frame_by_frame.iter().any(|bits| *bits != frame_by_frame[0]) || seed > 3, "{seed}");
        for (blocks, taps) in [(&[64][..], 1), (&[64][..], NODES), (&[1][..], NODES), (&[7, 1, 48, 3][..], 4)]
        {
            assert_eq!(bits(&graph, blocks, taps), frame_by_frame, "seed {seed}, {blocks:?}, {taps} taps");
        }
    }
}

#[test]
fn a_setting_that_changes_within_a_chain_ramps_in_it() {
    let text = r#"Graph(format: 1, clocks: { "audio": Driver(rate_hz: 1000) }, nodes: {
        "one": Constant(clock: "audio", value: 1, quantity: "number"),
        "a": Gain(input: "one", gain: 2), "b": Offset(input: "a", offset: 1), "c": Gain(input: "b", gain: 3), "d": Abs(input: "c") })"#;
    let document = Document::parse("g.ron", text).expect("it is RON");
    let graph =
        check(&document, &haptograph_nodes::registry(), &CheckOptions::default()).expect("it is valid");
    let run = |block: usize| -> Vec<u64> {
        let options = SessionOptions::default().block(64).probe("d.output");
        let (mut player, mut session) = Player::open(&graph, &options).expect("it runs");
        let mut probe = session.probe::<f64>("d.output").expect("it is handed over");
        let mut all: Vec<f64> = Vec::new();
        for call in 0..200 / block {
            if call == 40 / block {
                session.set_by_name("b.offset", -4.0).expect("it is live");
                session.set_by_name("c.gain", 0.5).expect("it is live");
            }
            player.process(block);
            let mut frames = [0.0; 64];
            let count = probe.read(&mut frames);
            all.extend(&frames[..count]);
        }
        assert_eq!((all[39], all[199]), (9.0, 1.0));
        all.into_iter().map(f64::to_bits).collect()
    };
    assert_eq!(run(1), run(40));
}

#[test]
fn a_changed_graph_takes_over_at_the_frame_at_which_a_ramp_ends_in_any_block() {
    let graph = |more: &str, last: &str| {
        graph(&format!(
            r#"Graph(format: 1, clocks: {{ "audio": Driver(rate_hz: 8000) }}, nodes: {{
                "n": Sine(clock: "audio", frequency_hz: 440, amplitude: 1, quantity: "number"),
                "a": Gain(input: "n", gain: 1), {more} "z": LowPass(input: "{last}", cutoff_hz: 900) }})"#
        ))
    };
    let (before, after) = (graph("", "a"), graph(r#""b": HighPass(input: "a", cutoff_hz: 30),"#, "b"));
    let run = |block: usize| -> Vec<u64> {
        let (mut player, mut session) =
            Player::open(&before, &SessionOptions::default().block(64).probe("z.output")).expect("it runs");
        let mut probe = session.probe::<f64>("z.output").expect("it is handed over");
        let mut all: Vec<f64> = Vec::new();
        for done in (0..720).step_by(block) {
            if done == 240 {
                session.set_by_name("a.gain", 0.5).expect("it is live");
            }
            if done == 360 {
                session.change_without_files(&after).expect("it can take over");
                if let Ok(next) = session.probe::<f64>("z.output") {
                    probe = next;
                }
            }
            player.process(block);
            let mut frames = [0.0; 256];
            let count = probe.read(&mut frames);
            all.extend(&frames[..count]);
        }
        all.into_iter().map(f64::to_bits).collect()
    };
    let frame_by_frame = run(1);
    for block in [2, 24, 40, 60] {
        assert!(run(block) == frame_by_frame, "blocks of {block}");
    }
}
