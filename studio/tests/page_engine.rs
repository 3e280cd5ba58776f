//! The engine of a page, as the page's audio thread runs it.

#![expect(unsafe_code, reason = "an allocator that counts can only be written so")]

#[path = "../../nodes/tests/realtime/mod.rs"]
mod realtime;

use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, check};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::run::VirtualClock;
use haptograph_studio::page::{Engine, Message, Opened};
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Frames of a callback of a browser.
const BLOCK: usize = 128;

fn engine(graph: &str) -> Engine {
    let opened =
        Opened { file: Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(graph), set: Vec::new() };
    Engine::open(opened, &haptograph_nodes::registry()).expect("it ships")
}

/// A pen on a circle of 20 mm, pressed with 1 N.
fn pointer(time_s: f64) -> Message {
    let mut bytes = vec![1, 0, 1, 0, 0, 0, 0, 0];
    bytes.extend((time_s * 1e3).to_le_bytes());
    let angle = TAU * time_s;
    for value in [20.0 * angle.cos(), 20.0 * angle.sin(), 1.0, 0.0, 0.0] {
        bytes.extend((value as f32).to_le_bytes());
    }
    Message::Binary(bytes)
}

/// Strokes for some time, and looks at each callback, which runs so many frames of the driver.
fn stroke(engine: &mut Engine, seconds: f64, mut callback: impl FnMut(&mut Engine, usize)) {
    let frames = (BLOCK as f64 * engine.driver_hz() / 48e3).ceil();
    let block_s = frames / engine.driver_hz();
    for block in 0..(seconds / block_s) as u64 {
        // Pointers come every 8 ms, new data are sent every 11 ms.
        if block % 3 == 0 {
            engine.hear(0, &pointer(block as f64 * block_s));
        }
        callback(engine, frames as usize);
        if block % 4 == 0 {
            let passed = Duration::from_secs_f64(4.0 * block_s);
            engine.publish(passed, Duration::ZERO);
            while engine.next_message(0).is_some() {}
        }
    }
}

#[test]
fn a_steady_run_does_not_allocate_in_the_callback() {
    for graph in ["texturepad.ron", "omni.ron", "ar-pen.ron", "two-drivers.ron", "omni-coil.ron"] {
        let mut engine = engine(graph);
        let scopes =
            r#"{"type":"scope","ports":[{"name":"out.delivered","raw":true},{"name":"coil.delivered"}]}"#;
        engine.hear(0, &Message::Text(scopes.to_owned()));
        stroke(&mut engine, 0.5, |engine, frames| {
            engine.process(frames);
        });
        let mut allocations = 0;
        stroke(&mut engine, 2.0, |engine, frames| {
            allocations += realtime::allocations(|| {
                engine.process(frames);
            });
        });
        assert_eq!(allocations, 0, "{graph}");
    }
}

/// A current that crosses from one driver to another.
fn crossing(drivers: &str) -> String {
    format!(
        r#"Graph(format: 1, seed: 3, clocks: {{ {drivers} }}, nodes: {{
            "slow": Sine(clock: "servo", frequency_hz: 7, amplitude: 0.2, quantity: "current"),
            "noise": Noise(clock: "servo", variance: 4e-4, quantity: "current"),
            "sum": Add(inputs: ["slow", "noise"]),
            "out": ActuatorSink(
                clock: "audio", endpoint: "coil", current: Ring(from: "sum", latency_ms: 12),
                limit: (peak_a: 0.5, continuous_a: 0.25, window_s: 10),
            ),
        }}, endpoints: {{ "simulated": {{ "coil": SimulatedHaptuator() }} }})"#
    )
}

/// What an offline run of a graph has at an output, as a page gets it.
fn offline(path: &Path, (node, output): (&str, usize), seconds: f64) -> Vec<f32> {
    let document = Document::load(path, &LoadOptions::default()).expect("RON");
    let graph = check(&document, &haptograph_nodes::registry(), &CheckOptions::default()).expect("right");
    let node = graph.nodes().find(node).expect("it is there");
    let plans = Plan::of(&graph, &PlanOptions::default().tap(node, output)).into_iter().map(Arc::new);
    let plans: Vec<Arc<Plan>> = plans.collect();
    let mut clock = VirtualClock::of(&plans).ending_after(seconds);
    let mut all = Vec::new();
    while !clock.is_over() {
        clock.run_quantum(|driver, run| {
            let taps = 0..plans[driver].tap_streams().count();
            taps.for_each(|tap| all.extend(run.tap(tap).iter().map(|x| *x as f32)));
        });
    }
    all
}

#[test]
fn two_drivers_in_a_page_give_the_bits_of_an_offline_run_however_the_page_cuts_the_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("crossing.ron");
    let drivers = [r#""audio": Driver(rate_hz: 48000)"#, r#""servo": Driver(rate_hz: 1000)"#];
    for drivers in [drivers.join(", "), [drivers[1], drivers[0]].join(", ")] {
        std::fs::write(&path, crossing(&drivers)).expect("written");
        let known = offline(&path, ("out", 0), 1.5);
        let opened = Opened { file: path.clone(), set: Vec::new() };
        let mut engine = Engine::open(opened, &haptograph_nodes::registry()).expect("it runs");
        let first = std::iter::from_fn(|| engine.next_message(0)).filter_map(|message| match message {
            Message::Text(text) => serde_json::from_str::<serde_json::Value>(&text).ok(),
            Message::Binary(_) => None,
        });
        let graph = first.last().expect("it is told");
        let told = graph["drivers"].as_array().expect("a list");
        assert!(told.len() == 2 && told.iter().all(|driver| driver["simulated"] == true), "{told:?}");
        let scopes = r#"{"type":"scope","ports":[{"name":"out.delivered","raw":true}]}"#;
        engine.hear(0, &Message::Text(scopes.to_owned()));
        let (mut samples, mut at_s, mut call) = (Vec::<f32>::new(), Vec::new(), 0);
        while samples.len() < known.len() {
            call += 1;
            engine.process((1 + call * 37 % 127) * engine.driver_hz() as usize / 48_000 + 1);
            engine.publish(Duration::from_millis(2), Duration::ZERO);
            while let Some(message) = engine.next_message(0) {
                let Message::Binary(bytes) = message else { continue };
                let (begin_s, _) = bytes[8..].split_first_chunk().expect("a time");
                at_s.push((samples.len(), f64::from_le_bytes(*begin_s)));
                let values = bytes[24..].chunks_exact(4);
                samples.extend(values.map(|four| f32::from_le_bytes(four.try_into().expect("four"))));
            }
        }
        let differs = (0..known.len()).find(|at| samples[*at].to_bits() != known[*at].to_bits());
        assert!(differs.is_none() && known.iter().any(|x| x.abs() > 0.1), "{differs:?}");
        for (count, begin_s) in at_s {
            assert!((begin_s - count as f64 / 48e3).abs() < 1e-9, "frame {count} at {begin_s} s");
        }
    }
}

/// Resident memory of this process, bytes.
#[cfg(target_os = "linux")]
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux has it");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kib = line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
    kib.expect("a number") * 1024
}

#[test]
#[cfg(target_os = "linux")]
#[ignore = "it strokes for an hour of virtual time, which takes minutes"]
fn memory_is_flat_over_an_hour_of_stroking() {
    let mut engine = engine("texturepad.ron");
    let mut run = |seconds| {
        stroke(&mut engine, seconds, |engine, frames| {
            engine.process(frames);
        });
        resident_bytes()
    };
    let after_a_minute = run(60.0);
    let after_an_hour = run(3540.0);
    let grown = after_an_hour.saturating_sub(after_a_minute);
    assert!(grown < 1 << 20, "{grown} bytes more than {after_a_minute} after a minute");
}
