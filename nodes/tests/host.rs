//! Graphs inside another program: fed and heard by their caller, with the bits of a run of the command.

#![expect(unsafe_code, reason = "an allocator that counts can only be written so")]

mod realtime;

use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::document::{Builder, Document, LoadOptions, Part, hold};
use haptograph_engine::frame::Kind;
use haptograph_engine::graph::{CheckOptions, Graph, Hosted, NodeId, check};
use haptograph_engine::host::{Full, HostError, Scalar, Vector, Wrench};
use haptograph_engine::node::LiveId;
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::run::{
    Change, ChangeError, ControlError, Player, Run, Session, SessionOptions, SetError, VirtualClock,
};
use haptograph_engine::settings::MAX_LIVE_ITEMS;
use haptograph_nodes::filters::classical::BandPassSettings;
use haptograph_nodes::texture::Model;
use realtime::allocations;
use std::path::Path;
use std::sync::Arc;

fn shipped(name: &str, options: &CheckOptions) -> Graph {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(name);
    let document = Document::load(path, &LoadOptions::default()).unwrap_or_else(|wrong| panic!("{wrong}"));
    check(&document, &haptograph_nodes::registry(), options).unwrap_or_else(|wrong| panic!("{wrong}"))
}

fn tap(graph: &Graph, name: &str) -> (NodeId, usize) {
    let (path, port) = name.rsplit_once('.').expect("a node and its output");
    let nodes = graph.nodes();
    let node = nodes.find(path).expect(path);
    let output = nodes[node].outputs.iter().position(|output| output.name == port);
    (node, output.expect(port))
}

/// What an offline run of the graph with its simulated endpoints has at these outputs.
fn simulated(name: &str, outputs: &[&str], frames: usize) -> Vec<Vec<f64>> {
    let graph = shipped(name, &CheckOptions::default());
    let taps = outputs.iter().map(|output| tap(&graph, output));
    let plan = Plan::of(&graph, &PlanOptions::default().block(480).taps(taps)).remove(0);
    let mut run = Run::new(Arc::new(plan));
    let mut all = vec![Vec::new(); outputs.len()];
    for _ in 0..frames / 480 {
        run.advance(480);
        for (place, frames) in all.iter_mut().enumerate() {
            frames.extend_from_slice(run.tap(place));
        }
    }
    all
}

/// Lengths of calls that fit nothing.
fn irregular(total: usize) -> impl Iterator<Item = usize> {
    let (mut left, mut k) = (total, 0_usize);
    std::iter::from_fn(move || {
        k += 1;
        let next = (1 + (k * 7919) % 911).min(left);
        left -= next;
        (next > 0).then_some(next)
    })
}

#[test]
fn a_hand_of_the_callers_feels_what_the_simulated_one_does_to_the_bit() {
    let frames = 24_000;
    let outputs = [
        "stylus.position",
        "stylus.force",
        "stylus.touching",
        "texture/filter.acceleration",
        "out.delivered",
    ];
    let felt = simulated("texturepad.ron", &outputs, frames);
    let graph = shipped("texturepad.ron", &CheckOptions::hosted());
    let mut position = graph.input::<Vector>("stylus.position").expect("a position");
    let mut force = graph.input::<Scalar>("stylus.force").expect("a force");
    let mut touching = graph.input::<Scalar>("stylus.touching").expect("a touch");
    let mut current = graph.output::<Scalar>("haptuator").expect("a current");
    let options = SessionOptions::default().rested().probe("texture/filter.acceleration");
    let (mut player, mut session) = Player::open(&graph, &options).expect("plays");
    let mut vibration = session.probe::<Scalar>("texture/filter.acceleration").expect("a probe");
    for (at, newton) in felt[1].iter().enumerate() {
        position.push([felt[0][3 * at], felt[0][3 * at + 1], felt[0][3 * at + 2]]).expect("room");
        force.push(*newton).expect("room");
        touching.push(felt[2][at]).expect("room");
    }
    for call in irregular(frames) {
        player.process(call);
    }
    let mut got = vec![0.0; felt[3].len()];
    assert_eq!(vibration.read(&mut got), got.len());
    assert!(got == felt[3], "the vibration");
    let mut got = vec![0.0; frames];
    assert_eq!(current.read(&mut got), frames);
    assert!(got.iter().any(|ampere| *ampere != 0.0));
    assert!(got == felt[4], "the current");
    assert_eq!(session.finish(player).outcome.driver_frames, 24_000);
}

/// What the simulated endpoints of a graph with several drivers give, and these outputs, by name, of an offline run.
fn simulated_by_all(graph: &Graph, names: &[&str], seconds: f64) -> Vec<Vec<f64>> {
    let taps = names.iter().map(|name| tap(graph, name));
    let plans: Vec<Arc<Plan>> =
        Plan::of(graph, &PlanOptions::default().taps(taps)).into_iter().map(Arc::new).collect();
    let mut clock = VirtualClock::of(&plans).ending_after(seconds);
    let mut all = vec![Vec::new(); names.len()];
    while !clock.is_over() {
        clock.run_quantum(|driver, run| {
            for (local, stream) in plans[driver].tap_streams().enumerate() {
                let place = names.iter().position(|name| *name == stream.name).expect("it is tapped");
                all[place].extend_from_slice(run.tap(local));
            }
        });
    }
    all
}

#[test]
fn a_hand_of_the_callers_feels_on_one_clock_what_an_offline_run_of_two_drivers_does_to_the_bit() {
    let cases: [(&str, usize, &[&str]); 2] = [
        (
            "two-drivers.ron",
            3,
            &[
                "stylus.position",
                "stylus.force",
                "stylus.touching",
                "moving.output",
                "texture/filter.acceleration",
                "out.delivered",
            ],
        ),
        ("omni-coil.ron", 1, &["arm.position", "moving.output", "push.delivered", "coil.delivered"]),
    ];
    for (name, channels, outputs) in cases {
        let felt = simulated_by_all(&shipped(name, &CheckOptions::default()), outputs, 0.9);
        let graph = shipped(name, &CheckOptions::hosted());
        let options = outputs.iter().fold(SessionOptions::default().rested(), |all, name| all.probe(name));
        let (players, mut session) = Player::open_all(&graph, &options).expect("plays");
        let mut clock = VirtualClock::running(players, &session);
        for (output, values) in outputs.iter().zip(&felt).take(channels) {
            let mut input = graph.any_input(output).expect(output);
            for frame in values.chunks_exact(input.kind().width()) {
                input.push(frame).expect("room");
            }
        }
        let rate_hz = graph.clocks()[graph.drivers()[0]].rate.hz();
        let mut allocated = 0;
        for call in irregular((0.9 * rate_hz) as usize) {
            allocated += allocations(|| clock.process(call));
        }
        assert_eq!(allocated, 0, "{name}");
        for (output, felt) in outputs.iter().zip(&felt) {
            let mut probe = session.any_probe(output).expect(output);
            let mut got = vec![0.0; felt.len()];
            got.chunks_exact_mut(probe.kind().width())
                .for_each(|frame| assert!(probe.take(frame), "{output}"));
            assert!(got.iter().any(|x| *x != 0.0), "{name}: {output}");
            let differs = (0..got.len()).find(|at| got[*at].to_bits() != felt[*at].to_bits());
            assert_eq!(differs, None, "{name}: {output}");
        }
        session.stop();
        clock.process((0.1 * rate_hz) as usize);
        assert!(clock.is_idle() && !clock.is_partly_idle(), "{name}");
        assert!(!session.finish_all(clock.into_players()).panicked);
    }
}

/// The force of a stylus on a clock of 1 kHz, at 48 kHz.
fn servo() -> Graph {
    let document = Builder::new("A force at 1 kHz, held at 48 kHz.")
        .driver("audio", 48_000.0)
        .derived("servo", "audio", 1000.0)
        .node("stylus", Part::new("Tablet").on("servo").set("endpoint", "hand"))
        .node("level", Part::new("Gain").on("audio").wire("input", hold("stylus.force")).set("gain", 1.0))
        .build()
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    check(&document, &haptograph_nodes::registry(), &CheckOptions::hosted())
        .unwrap_or_else(|wrong| panic!("{wrong}"))
}

#[test]
fn a_channel_at_a_thousand_hertz_takes_its_times_whatever_the_calls() {
    let play = |calls: &mut dyn Iterator<Item = usize>| {
        let graph = servo();
        let mut force = graph.input::<Scalar>("hand.force").expect("a force");
        let options = SessionOptions::default().probe("level.output");
        let (mut player, mut session) = Player::open(&graph, &options).expect("plays");
        let mut level = session.probe::<Scalar>("level.output").expect("a probe");
        // Every 1.7 ms, between ticks: as a device reports that has a clock of its own.
        for k in 0..500_u32 {
            force.set_at(f64::from(k) * 1.7e-3, f64::from(k)).expect("room");
        }
        calls.for_each(|frames| player.process(frames));
        let mut got = vec![0.0; 40_000];
        assert_eq!(level.read(&mut got), got.len());
        got
    };
    let whole = play(&mut std::iter::once(40_000));
    assert!(whole == play(&mut irregular(40_000)));
    assert!(whole == play(&mut std::iter::repeat_n(1, 40_000)));
    // The tick at t has the last value set for a time up to t.
    for (frame, value) in whole.iter().enumerate().step_by(48) {
        let ms = (frame / 48) as f64;
        assert_eq!(*value, ((ms + 1e-9) / 1.7).floor(), "at {ms} ms");
    }
}

#[test]
fn a_hand_that_falls_silent_takes_the_current_to_zero_and_back_when_it_is_heard_again() {
    let samples = fallen_silent(0);
    assert!([7, 100, 480].into_iter().all(|block| samples == fallen_silent(block)), "the block is heard");
}

/// The current of a hand that falls silent and is heard again.
fn fallen_silent(block: usize) -> Vec<f64> {
    let graph = shipped("texturepad.ron", &CheckOptions::hosted());
    let mut position = graph.input::<Vector>("stylus.position").expect("a position");
    let mut force = graph.input::<Scalar>("stylus.force").expect("a force");
    let mut touching = graph.input::<Scalar>("stylus.touching").expect("a touch");
    let mut current = graph.output::<Scalar>("haptuator.current").expect("a current");
    let options = SessionOptions::default().rested().block(block);
    let (mut player, session) = Player::open(&graph, &options).expect("plays");
    let mut all = Vec::new();
    let mut loudest = |player: &mut Player, heard: bool, at: &mut f64| {
        let mut most = 0.0_f64;
        for _ in 0..25 {
            if heard {
                *at += 0.05;
                position.set([0.03 * at.cos(), 0.03 * at.sin(), 0.0]).expect("room");
                force.set(1.0).expect("room");
                touching.set(1.0).expect("room");
            }
            player.process(480);
            while let Some(ampere) = current.take() {
                most = most.max(ampere.abs());
                all.push(ampere);
            }
        }
        most
    };
    let mut at = 0.0;
    assert!(loudest(&mut player, true, &mut at) > 0.01);
    loudest(&mut player, false, &mut at);
    assert_eq!(loudest(&mut player, false, &mut at), 0.0, "a quarter of a second later");
    assert_eq!(session.live_inputs()[0].device, "stylus");
    assert!(session.live_inputs()[0].actuators.iter().all(|actuator| actuator.at_zero));
    assert!(loudest(&mut player, true, &mut at) > 0.01);
    all
}

#[test]
fn an_edit_keeps_the_callers_handles_and_gives_probes_of_what_is_new() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/texturepad.ron");
    let text = std::fs::read_to_string(&path).expect("it ships");
    let graph = |text: &str| {
        let document = Document::parse(&path, text);
        let document = document.unwrap_or_else(|wrong| panic!("{wrong}"));
        check(&document, &haptograph_nodes::registry(), &CheckOptions::hosted())
            .unwrap_or_else(|wrong| panic!("{wrong}"))
    };
    let first = graph(&text);
    let mut force = first.input::<Scalar>("stylus.force").expect("a force");
    let mut position = first.input::<Vector>("stylus.position").expect("a position");
    let mut touching = first.input::<Scalar>("stylus.touching").expect("a touch");
    let mut current = first.output::<Scalar>("haptuator").expect("a current");
    let options = SessionOptions::default().rested().probe("texture/filter.acceleration");
    let (mut player, mut session) = Player::open(&first, &options).expect("plays");
    let mut vibration = session.probe::<Scalar>("texture/filter.acceleration").expect("a probe");
    let mut play = |player: &mut Player, calls: std::ops::Range<u32>| {
        for call in calls {
            let angle = 0.05 * f64::from(call);
            position.set([0.03 * angle.cos(), 0.03 * angle.sin(), 0.0]).expect("room");
            force.set(1.0).and(touching.set(1.0)).expect("room");
            player.process(480);
        }
    };
    play(&mut player, 0..50);
    while vibration.take().is_some() {}
    let second = graph(&text.replace("nodes: {", r#"nodes: { "twice": Gain(input: "texture", gain: 2),"#));
    let probes = ["texture/filter.acceleration", "twice.output"].map(str::to_owned);
    let changed = session.change_and_probe(&second, None, &probes).expect("it takes over");
    assert_eq!((changed.begun.len(), changed.ended.len()), (0, 0));
    assert!(session.probe::<Scalar>("texture/filter.acceleration").is_err(), "it is read already");
    let mut twice = session.probe::<Scalar>("twice.output").expect("it is new");
    while current.take().is_some() {}
    play(&mut player, 50..100);
    let mut both = Vec::new();
    while let Some(value) = vibration.take() {
        both.push(value);
    }
    let mut doubled = Vec::new();
    while let Some(value) = twice.take() {
        doubled.push(value);
    }
    let late = &both[both.len() - doubled.len()..];
    assert!(doubled.len() > 4000 && late.iter().zip(&doubled).all(|(one, two)| 2.0 * one == *two));
    assert!(late.iter().any(|a| a.abs() > 0.1), "the hand is still felt");
    let mut driven = [0.0; 20_000];
    assert!(current.read(&mut driven) == 20_000 && driven.iter().any(|a| a.abs() > 1e-3));
    // What is not named any more ends.
    session.change_and_probe(&second, None, &probes[1..]).expect("it takes over");
    play(&mut player, 100..110);
    assert!(session.probe::<Scalar>("twice.output").is_err());
    while vibration.take().is_some() {}
    play(&mut player, 110..120);
    assert!(vibration.take().is_none() && twice.take().is_some());
}

/// A force at 1 kHz on endpoint `hand`, held at 48 kHz, and these arms, each on an endpoint of its name.
fn with_arms(arms: &[&str]) -> Graph {
    let has_hand = !arms.contains(&"hand");
    let mut graph =
        Builder::new("A force, and arms.").driver("audio", 48_000.0).derived("servo", "audio", 1000.0);
    if has_hand {
        graph = graph.node("stylus", Part::new("Tablet").on("servo").set("endpoint", "hand")).node(
            "level",
            Part::new("Gain").on("audio").wire("input", hold("stylus.force")).set("gain", 1.0),
        );
    }
    for arm in arms {
        graph = graph.node(&format!("of {arm}"), Part::new("Arm").on("servo").set("endpoint", *arm));
    }
    let document = graph.build().unwrap_or_else(|wrong| panic!("{wrong}"));
    check(&document, &haptograph_nodes::registry(), &CheckOptions::hosted())
        .unwrap_or_else(|wrong| panic!("{wrong}"))
}

#[test]
fn an_endpoint_that_both_graphs_have_is_one_and_any_other_is_the_new_graphs() {
    let (first, more, other) = (with_arms(&[]), with_arms(&["arm"]), with_arms(&["hand"]));
    let mut force = first.input::<Scalar>("hand.force").expect("a force");
    let options = SessionOptions::default().probe("level.output");
    let (mut player, mut session) = Player::open(&first, &options).expect("plays");
    let mut level = session.probe::<Scalar>("level.output").expect("a probe");
    let mut last = |player: &mut Player| {
        player.process(480);
        std::iter::from_fn(|| level.take()).last()
    };
    force.set(1.0).expect("room");
    assert_eq!(last(&mut player), Some(1.0));

    // Two handles for one channel: the change is refused, and the run goes on.
    let twice = more.input::<Scalar>("hand.force").expect("it is free");
    let probes = ["level.output", "of arm.position"].map(str::to_owned);
    let refused = session.change_and_probe(&more, None, &probes).err();
    assert!(
        matches!(&refused, Some(ChangeError::Taken { channel }) if channel == "hand.force"),
        "{refused:?}"
    );
    drop(twice);
    force.set(2.0).expect("room");
    assert_eq!(last(&mut player), Some(2.0));

    session.change_and_probe(&more, None, &probes).expect("it takes over");
    force.set(3.0).expect("room");
    assert_eq!(last(&mut player), Some(3.0));
    assert!(matches!(more.input::<Scalar>("hand.force"), Err(HostError::Taken { .. })));
    drop(force);
    let mut force = more.input::<Scalar>("hand.force").expect("it was let go");
    force.set(4.0).expect("room");
    let mut arm = more.input::<Vector>("arm.position").expect("it is new");
    arm.set([0.1, 0.2, 0.3]).expect("room");
    assert_eq!(last(&mut player), Some(4.0));
    let mut at = session.probe::<Vector>("of arm.position").expect("it is new");
    assert_eq!(std::iter::from_fn(|| at.take()).last(), Some([0.1, 0.2, 0.3]));
    for graph in [&first, &more] {
        let taken = Player::open(graph, &SessionOptions::default()).err();
        assert!(matches!(taken, Some(HostError::Playing { .. })), "{taken:?}");
    }

    // The same name with other channels is another endpoint.
    session.change_and_probe(&other, None, &["of hand.position".to_owned()]).expect("it takes over");
    let mut hand = other.input::<Vector>("hand.position").expect("its own");
    hand.set([0.3, 0.2, 0.1]).expect("room");
    // Meanwhile the graphs fade.
    player.process(960);
    force.set(5.0).expect("a queue that nobody reads");
    player.process(480);
    let mut at = session.probe::<Vector>("of hand.position").expect("a probe");
    assert_eq!(std::iter::from_fn(|| at.take()).last(), Some([0.3, 0.2, 0.1]));
    assert_eq!(force.waiting(), 1);

    // A player of its own, after all: of the endpoint that both have there is one.
    session.finish(player);
    let (mut player, mut session) = Player::open(&more, &options).expect("nobody plays it");
    assert!(matches!(Player::open(&first, &options), Err(HostError::Playing { .. })));
    let mut level = session.probe::<Scalar>("level.output").expect("a probe");
    force.set(6.0).expect("room");
    player.process(480);
    assert_eq!(std::iter::from_fn(|| level.take()).last(), Some(6.0));
    drop((player, session));
    assert!(Player::open(&first, &options).is_ok());
}

#[test]
fn an_endpoint_that_comes_back_forgets_what_was_queued_meanwhile() {
    let (first, other) = (with_arms(&[]), with_arms(&["hand"]));
    let mut force = first.input::<Scalar>("hand.force").expect("a force");
    let options = SessionOptions::default().probe("level.output");
    let (mut player, mut session) = Player::open(&first, &options).expect("plays");
    force.set(1.0).expect("room");
    player.process(480);
    session.change_and_probe(&other, None, &[]).expect("it takes over");
    player.process(4800);
    force.set(5.0).expect("room");
    player.process(480);
    session.change_and_probe(&first, None, &["level.output".to_owned()]).expect("it takes over");
    player.process(4800);
    assert_eq!(force.waiting(), 0);
    let mut level = session.probe::<Scalar>("level.output").expect("a probe");
    assert!(std::iter::from_fn(|| level.take()).all(|force_n| force_n != 5.0));
    force.set(2.0).expect("room");
    player.process(480);
    assert_eq!(std::iter::from_fn(|| level.take()).last(), Some(2.0));
}

#[test]
fn a_channel_of_another_quantity_is_another_endpoint() {
    let graph = |quantity: &str| {
        let vector = Part::new("LiveVector").on("servo").set("endpoint", "tip").set("quantity", quantity);
        let document = Builder::new("").driver("servo", 1000.0).node("tip", vector).build();
        let document = document.unwrap_or_else(|wrong| panic!("{wrong}"));
        check(&document, &haptograph_nodes::registry(), &CheckOptions::hosted())
            .unwrap_or_else(|wrong| panic!("{wrong}"))
    };
    let (length, force) = (graph("length"), graph("force"));
    let mut metres = length.input::<Vector>("tip").expect("a vector");
    let (mut player, mut session) = Player::open(&length, &SessionOptions::default()).expect("plays");
    metres.set([1.0; 3]).expect("room");
    player.process(10);
    session.change_and_probe(&force, None, &["tip.value".to_owned()]).expect("it takes over");
    metres.set([2.0; 3]).expect("a queue that nobody reads");
    player.process(100);
    let mut tip = session.probe::<Vector>("tip.value").expect("a probe");
    assert!(std::iter::from_fn(|| tip.take()).all(|newtons| newtons == [0.0; 3]));
    let mut newtons = force.input::<Vector>("tip").expect("its own");
    newtons.set([3.0; 3]).expect("room");
    player.process(10);
    assert_eq!(std::iter::from_fn(|| tip.take()).last(), Some([3.0; 3]));
}

#[test]
fn a_change_to_what_another_player_runs_is_refused() {
    let (first, second) = (servo(), servo());
    let (mut player, mut session) = Player::open(&first, &SessionOptions::default()).expect("plays");
    let other = Player::open(&second, &SessionOptions::default()).expect("plays");
    let refused = session.change_without_files(&second).err();
    assert!(matches!(&refused, Some(ChangeError::Playing { endpoint }) if endpoint == "hand"), "{refused:?}");
    player.process(480);
    drop(other);
    session.change_without_files(&second).expect("it is free");
    player.process(480);
    assert_eq!(player.frames(), 960);
}

/// Numbers and vectors in, limited currents and forces out.
fn plain() -> Graph {
    let limit =
        |unit: &str| Part::group().set(&format!("peak_{unit}"), 0.5).set(&format!("continuous_{unit}"), 0.25);
    let document = Builder::new("")
        .driver("servo", 1000.0)
        .node("level", Part::new("LiveInput").on("servo").set("endpoint", "level").set("quantity", "current"))
        .node("pull", Part::new("LiveVector").on("servo").set("endpoint", "pull").set("quantity", "force"))
        .node(
            "coil",
            Part::new("ActuatorSink")
                .set("endpoint", "coil")
                .wire("current", "level")
                .set("limit", limit("a")),
        )
        .node(
            "arm",
            Part::new("ForceSink").set("endpoint", "arm").wire("force", "pull").set("limit", limit("n")),
        )
        .build()
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    check(&document, &haptograph_nodes::registry(), &CheckOptions::hosted())
        .unwrap_or_else(|wrong| panic!("{wrong}"))
}

#[test]
fn numbers_and_vectors_come_in_and_go_out_within_limits() {
    let graph = plain();
    let mut level = graph.input::<Scalar>("level").expect("a number");
    let mut pull = graph.input::<Vector>("pull").expect("a vector");
    let mut current = graph.output::<Scalar>("coil").expect("a current");
    let mut force = graph.output::<Vector>("arm").expect("a force");
    let (mut player, _session) = Player::open(&graph, &SessionOptions::default().rested()).expect("plays");
    for k in 0..40 {
        level.push(if k < 20 { 0.1 } else { 9.0 }).expect("room");
        pull.push([0.1, 0.0, -0.2]).expect("room");
        player.process(1);
    }
    let (mut currents, mut forces) = ([0.0; 40], [[0.0; 3]; 40]);
    assert_eq!((current.read(&mut currents), force.read(&mut forces)), (40, 40));
    assert!(currents[19] == 0.1 && currents[39] <= 0.5 && currents[39] > 0.499, "{}", currents[39]);
    assert_eq!(forces[39], [0.1, 0.0, -0.2]);
}

#[test]
fn a_model_that_a_program_gives_steers_the_filter_and_allocates_nothing() {
    let document = Builder::new("")
        .driver("synth", 10_000.0)
        .derived("control", "synth", 500.0)
        .node("network", Part::new("LiveModel").on("control").set("endpoint", "network"))
        .node(
            "steer",
            Part::new("SteeredModel")
                .wire("model", "network")
                .set("form", Part::new("Ar"))
                .set("warping", 0.0),
        )
        .node("excite", Part::new("Excitation").on("synth").wire("coefficients", hold("steer.coefficients")))
        .node(
            "filter",
            Part::new("ArmaFilter")
                .wire("coefficients", hold("steer.coefficients"))
                .wire("excitation", "excite"),
        )
        .build()
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    let graph = check(&document, &haptograph_nodes::registry(), &CheckOptions::hosted())
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    let mut network = graph.input::<Model>("network").expect("a model");
    let names = ["filter", "steer.corrected"];
    let options = names.iter().fold(SessionOptions::default(), |options, name| options.probe(name));
    let (mut player, mut session) = Player::open(&graph, &options).expect("plays");
    let [mut felt, mut corrected] = names.map(|name| session.probe::<Scalar>(name).expect("a probe"));
    let (mut vibration, mut counts) = ([0.0; 500], [0.0; 25]);
    let power = |of: &[f64]| of.iter().map(|x| x * x).sum::<f64>() / of.len() as f64;
    // Silence, noise of one pole, and one that is not stable.
    for (model, wanted) in [
        (Model::default(), 0.0..1e-9),
        (Model::new(0.75, &[-0.5]).expect("short"), 0.7..1.4),
        (Model::new(0.75, &[-1.5]).expect("short"), 1.4..f64::MAX),
    ] {
        network.set(model).expect("room");
        player.process(500);
        assert_eq!(allocations(|| player.process(500)), 0);
        felt.read(&mut vibration);
        assert_eq!(felt.read(&mut vibration), 500);
        let power = power(&vibration);
        assert!(wanted.contains(&power), "{power}");
        corrected.read(&mut counts);
        corrected.read(&mut counts);
    }
    assert_eq!(counts[24], 1.0);
}

#[test]
fn nothing_drives_before_the_first_word() {
    let graph = shipped("texturepad.ron", &CheckOptions::hosted());
    let mut current = graph.output::<Scalar>("haptuator.current").expect("a current");
    let (mut player, _session) = Player::open(&graph, &SessionOptions::default()).expect("plays");
    player.process(4800);
    assert_eq!(current.waiting(), 4800);
    assert!(std::iter::from_fn(|| current.take()).all(|ampere| ampere == 0.0));
}

#[test]
fn what_cannot_be_had_is_an_error_that_says_what_can() {
    let graph = shipped("texturepad.ron", &CheckOptions::hosted());
    let unknown = graph.input::<Scalar>("stylus.forse").err();
    assert!(
        matches!(&unknown, Some(HostError::Unknown { known, .. }) if known.contains("stylus.force")),
        "{unknown:?}"
    );
    assert!(matches!(graph.input::<Scalar>("haptuator.current"), Err(HostError::Unknown { .. })));
    assert!(matches!(graph.input::<Wrench>("stylus.position"), Err(HostError::Kind { .. })));
    assert!(matches!(graph.input::<Vector>("stylus"), Err(HostError::Several { .. })));
    let mut force = graph.input::<Scalar>("stylus.force").expect("a force");
    assert!(matches!(graph.input::<Scalar>("stylus.force"), Err(HostError::Taken { .. })));
    assert_eq!(force.set(f64::NAN), Err(Full::NotFinite));
    assert_eq!(force.set_at(f64::NAN, 1.0), Err(Full::NotFinite));
    assert_eq!(force.set_at(f64::INFINITY, 1.0), Err(Full::NotFinite));
    assert_eq!(force.waiting(), 0);
    drop(force);
    let mut force = graph.input::<Scalar>("stylus.force").expect("it was let go");
    let wrong = Player::open(&graph, &SessionOptions::default().probe("texture/filter.sound")).err();
    assert!(matches!(wrong, Some(HostError::Unknown { .. })), "{wrong:?}");
    let (player, session) = Player::open(&graph, &SessionOptions::default()).expect("plays");
    assert!(matches!(Player::open(&graph, &SessionOptions::default()), Err(HostError::Playing { .. })));
    let mut position = graph.any_input("stylus.position").expect("a position");
    assert_eq!((position.kind(), position.name()), (Kind::VECTOR, "stylus.position"));
    assert_eq!(position.set(&[1.0]), Err(Full::Shape));
    assert_eq!(position.push(&[0.0; 6]), Err(Full::Shape));
    assert_eq!(position.set(&[0.0, f64::NAN, 0.0]), Err(Full::NotFinite));
    assert_eq!((position.set(&[0.0; 3]), position.waiting()), (Ok(()), 1));
    let mut current = graph.any_output("haptuator").expect("a current");
    assert!(!current.take(&mut [0.0]) && !current.take(&mut []));
    assert_eq!(current.kind(), Kind::SCALAR);
    assert_eq!(graph.find_output("out"), graph.find_output("out.delivered"));
    while force.push(1.0).is_ok() {}
    assert_eq!(force.push(1.0), Err(Full::Full));
    session.finish(player);
    assert!(Player::open(&graph, &SessionOptions::default()).is_ok());
    let two = shipped("two-drivers.ron", &CheckOptions::hosted());
    let refused = Player::open(&two, &SessionOptions::default()).err();
    assert!(matches!(refused, Some(HostError::Drivers { count: 2, .. })), "{refused:?}");
}

#[test]
fn every_shipped_graph_can_be_hosted_whole_or_in_part() {
    for name in ["texturepad.ron", "omni.ron", "ar-pen.ron", "recorder.ron"] {
        let graph = shipped(name, &CheckOptions::hosted());
        assert!(graph.host_inputs().next().is_some(), "{name}");
        let (mut player, _session) = Player::open(&graph, &SessionOptions::default()).expect(name);
        player.process(500);
    }
    let hosted = Hosted::Also(vec!["stylus".into()]);
    let mut options = CheckOptions::default();
    options.hosted = hosted;
    let part = shipped("texturepad.ron", &options);
    assert_eq!((part.host_inputs().count(), part.host_outputs().count()), (3, 0));
}

#[test]
fn playing_allocates_nothing() {
    let graph = shipped("texturepad.ron", &CheckOptions::hosted());
    let mut force = graph.input::<Scalar>("stylus.force").expect("a force");
    let mut current = graph.output::<Scalar>("haptuator.current").expect("a current");
    let options = SessionOptions::default().probe("texture/filter.acceleration");
    let (mut player, mut session) = Player::open(&graph, &options).expect("plays");
    let gain = session.settings().find(|live| live.name() == "out.gain").cloned();
    let gain = gain.expect("a live gain");
    let mut vibration = session.probe::<Scalar>("texture/filter.acceleration").expect("a probe");
    let mut frames = [0.0; 480];
    let count = allocations(|| {
        for k in 0..50 {
            let _ = force.set(f64::from(k % 7));
            let _ = session.set(gain.node, gain.setting, f64::from(k % 3) / 2.0);
            player.process(480);
            current.read(&mut frames);
            vibration.read(&mut frames);
        }
    });
    assert_eq!(count, 0);
    let set = session.settings().find(|live| live.name() == "out.gain");
    assert_eq!(set.map(|live| live.value), Some(0.5));
    // A setting of another kind, at a place where the sink has none.
    let foreign = LiveId::<BandPassSettings>::named("high_hz").into();
    let unknown = session.set(gain.node, foreign, 0.5);
    assert_eq!(unknown, Err(ControlError::NotLive));
}

/// A gain is computed inline where the engine has a single frame: its number follows the setting there too, also after a swap.
#[test]
fn a_gain_that_is_turned_has_the_same_samples_whatever_the_block() {
    let text = |more: &str| {
        format!(
            r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 1000) }}, nodes: {{
                "tone": Sine(clock: "servo", frequency_hz: 30),
                "scaled": Gain(input: "tone", gain: 2),
                "moved": Offset(input: "scaled", offset: 1),
                {more}
            }})"#
        )
    };
    let graphs = ["", r#""more": Gain(input: "moved", gain: 3)"#].map(|more| {
        let document = Document::parse("gain.ron", &text(more)).expect("it is a graph");
        check(&document, &haptograph_nodes::registry(), &CheckOptions::default()).expect("it is sound")
    });
    let samples = |block: usize| {
        let options = SessionOptions::default().probe("moved");
        let (mut player, mut session) = Player::open(&graphs[0], &options).expect("plays");
        let mut probe = session.probe::<Scalar>("moved").expect("a probe");
        let mut heard = Vec::new();
        let mut play = |player: &mut Player| {
            let mut frames = [0.0; 128];
            (0..128 / block).for_each(|_| player.process(block));
            assert_eq!(probe.read(&mut frames), 128);
            heard.extend(frames.map(f64::to_bits));
        };
        play(&mut player);
        session.set_by_name("scaled.gain", 0.5).expect("it is live");
        play(&mut player);
        session.set_by_name("moved.offset", -4.0).expect("it is live");
        session.change_without_files(&graphs[1]).expect("it is swapped");
        play(&mut player);
        session.set_by_name("scaled.gain", 1.5).expect("it is live");
        play(&mut player);
        session.finish(player);
        heard
    };
    let whole = samples(128);
    let distinct: std::collections::HashSet<u64> = whole.iter().copied().collect();
    assert!(distinct.len() > 100);
    for block in [1, 2, 32] {
        assert!(samples(block) == whole, "blocks of {block}");
    }
}

#[test]
fn a_live_setting_is_set_in_the_unit_of_its_name_and_means_the_same_as_when_it_is_written() {
    let graph = |constant_mm_s: f64| {
        let text = format!(
            r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 1000) }}, nodes: {{
                "v": Constant(clock: "servo", value: 0.1, quantity: "speed"),
                "n": Constant(clock: "servo", value: 1, quantity: "force"),
                "felt": Responsiveness(speed: "v", force: "n", condition: Force, constant_mm_s: {constant_mm_s}),
            }})"#
        );
        let document = Document::parse("felt.ron", &text).expect("it is a graph");
        check(&document, &haptograph_nodes::registry(), &CheckOptions::default()).expect("it is sound")
    };
    let (before, after) = (graph(130.0), graph(31.7));
    let last = |graph: &Graph, change: &mut dyn FnMut(&mut Session)| {
        let options = SessionOptions::default().probe("felt.speed");
        let (mut player, mut session) = Player::open(graph, &options).expect("plays");
        let mut probe = session.probe::<Scalar>("felt.speed").expect("a probe");
        player.process(10);
        change(&mut session);
        player.process(90);
        let mut frames = [0.0; 100];
        assert_eq!(probe.read(&mut frames), 100);
        session.finish(player);
        frames[99].to_bits()
    };
    let written = last(&after, &mut |_| {});
    assert_eq!(written, (31.7 * 1e-3_f64).to_bits());
    let set = last(&before, &mut |session| {
        session.set_by_name("felt.constant_mm_s", 31.7).expect("it is live");
        let live = session.settings().find(|live| live.name() == "felt.constant_mm_s");
        assert_eq!(live.map(|live| (live.value, live.si_per_unit)), Some((31.7, 1e-3)));
    });
    let reloaded = last(&before, &mut |session| {
        let changed = session.change_without_files(&after).expect("it is swapped");
        assert_eq!(changed.change, Change::Settings(1));
    });
    assert_eq!([set, reloaded], [written; 2]);
}

/// A mixer of a sine and a constant vector's x.
fn mixer(gains: &str, more: &str) -> Result<Graph, Diagnostics> {
    let text = format!(
        r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 1000) }}, nodes: {{
            "tone": Sine(clock: "servo", frequency_hz: 30),
            "wind": ConstantVector(clock: "servo", value: [1, 2, 3]),
            "x": Components(input: "wind"),
            "mix": Mixer(inputs: ["tone", "x.x"{more}], gains: {gains}),
        }})"#
    );
    let document = Document::parse("mix.ron", &text)?;
    check(&document, &haptograph_nodes::registry(), &CheckOptions::default())
}

#[test]
fn the_numbers_of_a_live_list_are_set_one_by_one() {
    let graph = mixer("[1, 0.5]", "").expect("it is sound");
    let names: Vec<String> = graph.live_settings().iter().map(|live| live.name()).collect();
    for name in ["mix.gains[0]", "mix.gains[1]", "mix.master", "wind.value[2]"] {
        assert!(names.iter().any(|known| known == name), "{name}: {names:?}");
    }
    let samples = |block: usize| {
        let options = SessionOptions::default().probe("mix");
        let (mut player, mut session) = Player::open(&graph, &options).expect("plays");
        let mut probe = session.probe::<Scalar>("mix").expect("a probe");
        let mut heard = Vec::new();
        let mut play = |player: &mut Player| {
            let mut frames = [0.0; 128];
            (0..128 / block).for_each(|_| player.process(block));
            assert_eq!(probe.read(&mut frames), 128);
            heard.extend(frames);
        };
        play(&mut player);
        session.set_by_name("mix.gains[0]", 0.0).expect("it is live");
        session.set_by_name("mix.gains[1]", 2.0).expect("it is live");
        session.set_by_name("wind.value[0]", 10.0).expect("it is live");
        play(&mut player);
        for unknown in ["mix.gains", "mix.gains[2]", "mix.gains[-1]", "mix.gains[]", "wind.value[3]"] {
            let refused = session.set_by_name(unknown, 1.0);
            assert!(matches!(refused, Err(SetError::Unknown(_))), "{unknown}");
        }
        session.finish(player);
        heard
    };
    let whole = samples(128);
    assert_eq!((whole[0], whole[255]), (0.5, 20.0));
    // It ramps within 20 ms.
    let rising = whole[128..148].windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(rising > 10 && whole[148..].iter().all(|y| *y == 20.0), "{rising}");
    let bits = |samples: &[f64]| -> Vec<u64> { samples.iter().map(|x| x.to_bits()).collect() };
    for block in [1, 2, 32] {
        assert!(bits(&samples(block)) == bits(&whole), "blocks of {block}");
    }
}

#[test]
fn another_number_in_a_list_is_set_in_place_and_another_length_is_another_node() {
    let graph = mixer("[1, 0.5]", "").expect("it is sound");
    let changes = |after: &Graph| {
        let (mut player, mut session) = Player::open(&graph, &SessionOptions::default()).expect("plays");
        player.process(100);
        let change = session.change_without_files(after).expect("it is swapped").change;
        player.process(100);
        let set = session.settings().find(|live| live.name() == "mix.gains[1]");
        let value = set.map(|live| live.value);
        session.finish(player);
        (change, value)
    };
    let turned = mixer("[1, 0.25]", "").expect("it is sound");
    assert_eq!(changes(&turned), (Change::Settings(1), Some(0.25)));
    let longer = mixer("[1, 0.25, 1]", ", \"x.y\"").expect("it is sound");
    let (change, value) = changes(&longer);
    assert!(!matches!(change, Change::Settings(_)), "{change:?}");
    assert_eq!(value, Some(0.25));
    assert_ne!(fingerprint(&graph), fingerprint(&longer));
    assert_eq!(fingerprint(&graph), fingerprint(&turned));
}

fn fingerprint(graph: &Graph) -> u64 {
    let mix = graph.nodes().iter().find(|node| node.path == "mix");
    mix.expect("the mixer").fingerprint
}

#[test]
fn a_list_of_many_numbers_is_not_live() {
    let names = |count: usize| {
        let more = ", \"x.x\"".repeat(count - 2);
        let graph = mixer(&format!("{:?}", vec![0.5; count]), &more).expect("it is sound");
        let live = graph.live_settings();
        live.iter().filter(|live| live.field == "gains").count()
    };
    assert_eq!([names(MAX_LIVE_ITEMS), names(MAX_LIVE_ITEMS + 1)], [MAX_LIVE_ITEMS, 0]);
}

#[test]
fn an_optional_live_setting_is_set_in_place_however_it_is_written() {
    let graph = |leak: &str| {
        let text = format!(
            r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 1000) }}, nodes: {{
                "load": Constant(clock: "servo", value: 1, quantity: "force"),
                "sum": Integrator(input: "load"{leak}),
            }})"#
        );
        let document = Document::parse("sum.ron", &text).expect("RON");
        check(&document, &haptograph_nodes::registry(), &CheckOptions::default()).expect("it is sound")
    };
    let change = |before: &str, after: &str| {
        let (mut player, mut session) =
            Player::open(&graph(before), &SessionOptions::default()).expect("plays");
        player.process(10);
        let change = session.change_without_files(&graph(after)).expect("it is swapped").change;
        session.finish(player);
        change
    };
    let [bare, some, other] = [", leak_s: 10", ", leak_s: Some(10)", ", leak_s: Some(20)"];
    assert_eq!(change(bare, some), Change::Settings(0));
    assert_eq!(change(some, other), Change::Settings(1));
    for none in ["", ", leak_s: None"] {
        assert_eq!(change(none, some), Change::AtOnce);
        assert_eq!(change(some, none), Change::AtOnce);
    }
}
