//! The engine of a page, as the page's audio thread runs it.

#![expect(unsafe_code, reason = "an allocator that counts can only be written so")]

#[path = "../../nodes/tests/realtime/mod.rs"]
mod realtime;

use haptograph_studio::page::{Engine, Message, Opened};
use std::f64::consts::TAU;
use std::path::Path;
use std::time::Duration;

/// Frames of a callback of a browser.
const BLOCK: usize = 128;

fn engine(graph: &str) -> Engine {
    let opened = Opened {
        graph: Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(graph),
        set: Vec::new(),
        study: None,
    };
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

/// Strokes for some time, and looks at each callback.
fn stroke(engine: &mut Engine, seconds: f64, mut callback: impl FnMut(&mut Engine)) {
    let block_s = BLOCK as f64 / engine.driver_hz();
    for block in 0..(seconds / block_s) as u64 {
        // Pointers come every 8 ms, new data are sent every 11 ms.
        if block % 3 == 0 {
            engine.hear(0, &pointer(block as f64 * block_s));
        }
        callback(engine);
        if block % 4 == 0 {
            let passed = Duration::from_secs_f64(4.0 * block_s);
            engine.publish(passed, Duration::ZERO);
            while engine.next_message(0).is_some() {}
        }
    }
}

#[test]
fn a_steady_run_does_not_allocate_in_the_callback() {
    for graph in ["texturepad.ron", "omni.ron", "ar-pen.ron"] {
        let mut engine = engine(graph);
        let scopes = r#"{"type":"scope","ports":[{"name":"out.delivered","raw":true}]}"#;
        engine.hear(0, &Message::Text(scopes.to_owned()));
        stroke(&mut engine, 0.5, |engine| {
            engine.process(BLOCK);
        });
        let mut allocations = 0;
        stroke(&mut engine, 2.0, |engine| {
            allocations += realtime::allocations(|| {
                engine.process(BLOCK);
            });
        });
        assert_eq!(allocations, 0, "{graph}");
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
        stroke(&mut engine, seconds, |engine| {
            engine.process(BLOCK);
        });
        resident_bytes()
    };
    let after_a_minute = run(60.0);
    let after_an_hour = run(3540.0);
    let grown = after_an_hour.saturating_sub(after_a_minute);
    assert!(grown < 1 << 20, "{grown} bytes more than {after_a_minute} after a minute");
}
