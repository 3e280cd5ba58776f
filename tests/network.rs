//! A graph that runs live with a device in another process: the C client, compiled and run.

use std::fs;
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Command, Stdio};

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

#[test]
fn the_c_client_is_felt_by_a_live_graph_and_driven_within_its_limit() {
    let folder = tempfile::tempdir().unwrap();
    let client = folder.path().join("client");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/c/device_client.c");
    let compiled = Command::new("cc")
        .args(["-O2", "-std=c99", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&client)
        .arg(source)
        .arg("-lm")
        .status()
        .expect("a C compiler");
    assert!(compiled.success());

    let address = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    fs::write(
        folder.path().join("graph.ron"),
        GRAPH.replace("ADDRESS", &address.to_string()),
    )
    .unwrap();
    let graph = Command::new(env!("CARGO_BIN_EXE_haptograph"))
        .args(["run", "graph.ron", "--live", "--for", "3"])
        .current_dir(&folder)
        .stdin(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Until the graph listens, nobody answers: the client goes on asking, and ends with the graph.
    let port = address.port().to_string();
    let client = Command::new(&client)
        .args(["127.0.0.1", &port, "60"])
        .output()
        .unwrap();
    let graph = graph.wait_with_output().unwrap();
    assert!(
        graph.status.success(),
        "{}",
        String::from_utf8_lossy(&graph.stderr)
    );
    let said = String::from_utf8_lossy(&client.stdout).into_owned();
    assert!(client.status.success(), "{said}");
    let largest: f64 = said.trim().rsplit(' ').next().unwrap().parse().unwrap();
    assert!(largest > 0.0 && largest <= 0.2, "{said}");

    let path = fs::read_to_string(folder.path().join("out/graph/path.csv")).unwrap();
    let furthest = path
        .lines()
        .skip(1)
        .filter_map(|line| line.split(',').nth(1)?.parse::<f64>().ok());
    let furthest = furthest.fold(0.0, f64::max);
    assert!(furthest > 0.0, "the tool was seen to move: {furthest}");
    let facts: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("out/graph/run.json")).unwrap()).unwrap();
    assert!(
        facts["packets"]["arm"]["accepted"].as_u64().unwrap() > 10,
        "{facts}"
    );
    assert_eq!(facts["simulated"], false);
    let latency = &facts["latencies_ms"]["arm to out"];
    let age_ms = latency["age_when_read"]["p50"].as_f64().unwrap();
    // Older than 2 s it counts as gone. How long the device takes to be driven is not known here.
    assert!(
        age_ms < 2000.0 && latency["until_played"].is_null(),
        "{latency:#}"
    );
    assert!(latency["transport"]["max"].as_f64().unwrap() >= age_ms);
}
