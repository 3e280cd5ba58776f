//! A graph that runs live with a device in another process: the C client, compiled and run, and the one in Python.

#![allow(clippy::unwrap_used)]

#[path = "network/inputs.rs"]
mod inputs;
#[path = "network/shipped.rs"]
mod shipped;
mod skip;

use skip::skip;
use std::fs;
use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const GRAPH: &str = r#"Graph(
    format: 1,
    clocks: { "servo": Driver(rate_hz: 1000) },
    nodes: {
        "arm":    Tablet(clock: "servo", endpoint: "arm"),
        "felt":   Calibrate(input: "arm.force", from: "force", to: "current", factor: 0.25),
        "out":    ActuatorSink(current: "felt", endpoint: "arm", limit: (peak_a: 0.2, continuous_a: 0.2)),
        "path":   CsvSink(inputs: ["arm.position"], file: "path.csv"),
    },
    endpoints: { "live": { "arm": UdpDevice(listen: "ADDRESS", timeout_ms: 2000) } },
)"#;

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(name)
}

#[test]
fn the_c_client_is_felt_by_a_live_graph_and_driven_within_its_limit() {
    let folder = tempfile::tempdir().unwrap();
    let client = folder.path().join("client");
    let compiled = Command::new("cc")
        .args(["-O2", "-std=c99", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&client)
        .arg(example("c/device_client.c"))
        .arg("-lm")
        .status()
        .expect("a C compiler");
    assert!(compiled.success());
    is_felt_and_driven(&mut Command::new(&client));
}

#[test]
fn the_python_client_is_felt_by_a_live_graph_and_driven_within_its_limit() {
    let is_new = "import sys; sys.exit(sys.version_info < (3, 10))";
    let python = Command::new("python3").args(["-c", is_new]).status();
    if !python.is_ok_and(|status| status.success()) {
        skip("there is no python3 of version 3.10 or later");
        return;
    }
    is_felt_and_driven(Command::new("python3").arg(example("python/device_client.py")));
}

/// A graph runs live with the client that the command is, for which address, port and seconds are still to be given.
fn is_felt_and_driven(client: &mut Command) {
    let folder = tempfile::tempdir().unwrap();
    let address = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    fs::write(folder.path().join("graph.ron"), GRAPH.replace("ADDRESS", &address.to_string())).unwrap();
    let graph = Command::new(env!("CARGO_BIN_EXE_haptograph"))
        .args(["run", "graph.ron", "--live", "--for", "3"])
        .current_dir(&folder)
        .stdin(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Until the graph listens, nobody answers: the client goes on asking, and ends with the graph.
    let port = address.port().to_string();
    let client = client.args(["127.0.0.1", &port, "60"]).output().unwrap();
    let graph = graph.wait_with_output().unwrap();
    assert!(graph.status.success(), "{}", String::from_utf8_lossy(&graph.stderr));
    let said = String::from_utf8_lossy(&client.stdout).into_owned();
    let complained = String::from_utf8_lossy(&client.stderr);
    assert!(client.status.success(), "{said}{complained}");
    let largest: f64 = said.trim().rsplit(' ').next().unwrap().parse().unwrap();
    assert!(largest > 0.0 && largest <= 0.2, "{said}");

    let path = fs::read_to_string(folder.path().join("out/graph/path.csv")).unwrap();
    let furthest = path.lines().skip(1).filter_map(|line| line.split(',').nth(1)?.parse::<f64>().ok());
    let furthest = furthest.fold(0.0, f64::max);
    assert!(furthest > 0.0, "the tool was seen to move: {furthest}");
    let facts: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("out/graph/run.json")).unwrap()).unwrap();
    assert!(facts["packets"]["arm"]["accepted"].as_u64().unwrap() > 10, "{facts}");
    assert_eq!(facts["simulated_devices"], false);
    let latency = &facts["latencies_ms"]["arm to out"];
    let age_ms = latency["age_when_read"]["p50"].as_f64().unwrap();
    // Older than 2 s it counts as gone. How long the device takes to be driven is not known here.
    assert!(age_ms < 2000.0 && latency["until_played"].is_null(), "{latency:#}");
    assert!(latency["transport"]["max"].as_f64().unwrap() >= age_ms);
}

const STEERED: &str = r#"Graph(
    format: 1,
    clocks: { "servo": Driver(rate_hz: 1000) },
    nodes: {
        "stylus": Tablet(clock: "servo", endpoint: "stylus"),
        "bias":   Constant(clock: "servo", value: 0.4, quantity: "current"),
        "felt":   Calibrate(input: "stylus.force", from: "force", to: "current", factor: 0.1),
        "sum":    Add(inputs: ["felt", "bias"]),
        "out":    ActuatorSink(current: "sum", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
        "kept":   CsvSink(inputs: ["out.delivered"], file: "kept.csv"),
    },
    endpoints: { "live": {
        "stylus": OscDevice(listen: "127.0.0.1:0", timeout_ms: 500), "coil": SimulatedHaptuator(),
    } },
)"#;

/// `/force 1.0` of Open Sound Control.
const FORCE: &[u8] = b"/force\0\0,f\0\0\x3f\x80\0\0";

/// A sender at the port that the system chose speaks for a while and stops: what is said of the actuator is what it was
/// delivered.
#[test]
fn the_message_of_a_silent_sender_says_what_its_actuator_was_delivered() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("graph.ron"), STEERED).unwrap();
    let mut graph = Command::new(env!("CARGO_BIN_EXE_haptograph"))
        .args(["run", "graph.ron", "--live", "--for", "5"])
        .current_dir(&folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(graph.stderr.take().unwrap()).lines();
    let place = said.by_ref().map_while(Result::ok).find_map(|line| {
        let place = line.strip_prefix("listening for `stylus` at ")?;
        Some(place.to_owned())
    });
    let place = place.expect("where it listens");
    assert!(!place.ends_with(":0"), "{place}");
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    let start = Instant::now();
    while start.elapsed() < Duration::from_millis(1500) {
        sender.send_to(FORCE, &place).unwrap();
        std::thread::sleep(Duration::from_millis(10));
    }
    let said: Vec<String> = said.map_while(Result::ok).collect();
    let output = graph.wait_with_output().unwrap();
    assert!(output.status.success(), "{said:#?}");
    let silent = said.iter().any(|line| {
        line.contains("`stylus` has been silent for")
            && line.contains("actuator `out`")
            && line.contains("0.000 A")
    });
    assert!(silent, "{said:#?}");

    let out = folder.path().join("out/graph");
    let kept = fs::read_to_string(out.join("kept.csv")).unwrap();
    let delivered: Vec<f64> = kept.lines().filter_map(|line| line.split(',').nth(1)?.parse().ok()).collect();
    let largest = delivered.iter().copied().fold(0.0, f64::max);
    assert!((largest - 0.5).abs() < 1e-9, "{largest}");
    assert!(delivered.iter().rev().take(1000).all(|x| *x == 0.0));
    let facts: serde_json::Value = serde_json::from_slice(&fs::read(out.join("run.json")).unwrap()).unwrap();
    let silence = &facts["silences"][0];
    assert_eq!((&silence["input"], &silence["actuators"][0]["at_zero"]), (&"stylus".into(), &true.into()));
    let simulated = |name: &str| {
        let devices = facts["devices"].as_array().unwrap();
        let device = devices.iter().find(|device| device["name"] == name).unwrap();
        device["simulated"].as_bool().unwrap()
    };
    assert_eq!((simulated("stylus"), simulated("coil")), (false, true));
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(told.contains("simulated: output `coil`; real: input `stylus`"), "{told}");
}
