//! Inputs of one number each, over loopback.

use std::fs;
use std::net::UdpSocket;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const GRAPH: &str = r#"Graph(
    format: 1,
    clocks: { "servo": Driver(rate_hz: 1000) },
    nodes: {
        "squeeze": LiveInput(clock: "servo", endpoint: "squeeze", quantity: "current"),
        "turn":    LiveInput(clock: "servo", endpoint: "turn", quantity: "current"),
        "sum":     Add(inputs: ["squeeze", "turn"]),
        "out":     ActuatorSink(current: "sum", endpoint: "coil", limit: (peak_a: 2, continuous_a: 2)),
        "kept":    CsvSink(inputs: ["squeeze", "turn", "out.delivered"], file: "kept.csv"),
    },
    endpoints: { "live": {
        "squeeze": OscInput(listen: "ADDRESS", address: "/hand", argument: 2, from: (0, 1023), to: (0, 0.5)),
        "turn":    OscInput(listen: "ADDRESS", address: "/fader", to: (0.1, 0.2), on_silence: Hold),
        "coil":    SimulatedHaptuator(),
    } },
)"#;

/// `/hand 7 x` and `/fader y`.
fn packets(x: f32, y: f32) -> [Vec<u8>; 2] {
    let hand = [&b"/hand\0\0\0,ff\0"[..], &7.0_f32.to_be_bytes(), &x.to_be_bytes()].concat();
    [hand, [&b"/fader\0\0,f\0\0"[..], &y.to_be_bytes()].concat()]
}

#[test]
fn two_faders_at_one_address_drive_within_their_ranges_whatever_is_sent() {
    let folder = tempfile::tempdir().unwrap();
    let address = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let text = GRAPH.replace("ADDRESS", &address.to_string());
    fs::write(folder.path().join("graph.ron"), text).unwrap();
    let mut graph = Command::new(env!("CARGO_BIN_EXE_haptograph"))
        .args(["run", "graph.ron", "--live", "--for", "3"])
        .current_dir(&folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let (sender, start) = (UdpSocket::bind("127.0.0.1:0").unwrap(), Instant::now());
    let hostile = [f32::NAN, f32::INFINITY, -1e30, 1e30, f32::MIN_POSITIVE];
    for round in 0.. {
        let wild = hostile[round % hostile.len()];
        let [hand, fader] = packets(511.5, 1.0);
        let [wild_hand, wild_fader] = packets(wild, wild);
        for packet in [hand, fader, wild_hand, wild_fader, b"/hand\0\0\0,f".to_vec()] {
            let _ = sender.send_to(&packet, address);
        }
        std::thread::sleep(Duration::from_millis(3));
        if graph.try_wait().unwrap().is_some() {
            break;
        }
        assert!(start.elapsed() < Duration::from_secs(120), "the graph does not end");
    }
    assert!(graph.wait().unwrap().success());

    let kept = fs::read_to_string(folder.path().join("out/graph/kept.csv")).unwrap();
    let rows: Vec<Vec<f64>> = kept
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    let numbers = |column: usize| rows.iter().map(move |row| row[column]);
    assert!(numbers(1).all(|x| (0.0..=0.5).contains(&x)) && numbers(2).all(|x| (0.1..=0.2).contains(&x)));
    assert!(numbers(1).any(|x| (x - 0.25).abs() < 1e-9), "half of the way");
    assert!(numbers(3).any(|x| x > 0.3) && numbers(3).all(|x| x.abs() <= 0.7));
    let facts: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("out/graph/run.json")).unwrap()).unwrap();
    let packets = &facts["packets"]["squeeze"];
    assert!(
        packets["accepted"].as_u64() > Some(10) && packets["not_numbers"].as_u64() > Some(0),
        "{packets}"
    );
    assert!(packets["malformed"].as_u64() > Some(0), "{packets}");
}
