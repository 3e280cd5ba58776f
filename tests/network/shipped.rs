//! The shipped graphs with their live endpoints: sound, and felt by a device over loopback where none is here.

use haptograph::engine::document::{Document, LoadOptions};
use haptograph::engine::graph::{CheckOptions, check};
use haptograph::live::udp::protocol::{Command as Driven, State};
use std::f64::consts::TAU;
use std::fs;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn graphs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs")
}

#[test]
fn every_set_of_endpoints_of_every_shipped_graph_is_sound_and_without_warnings() {
    let mut live = 0;
    for folder in [graphs(), graphs().join("cookbook")] {
        let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        for file in files.filter(|file| file.extension().is_some_and(|ending| ending == "ron")) {
            let document =
                Document::load(&file, &LoadOptions::default()).unwrap_or_else(|wrong| panic!("{wrong}"));
            for set in document.endpoints() {
                let options = CheckOptions::default().endpoints(set);
                let graph = check(&document, &haptograph::nodes::registry(), &options)
                    .unwrap_or_else(|wrong| panic!("{} with its {set} endpoints: {wrong}", file.display()));
                assert!(graph.warnings().is_empty(), "{} with its {set} endpoints", file.display());
                live += u32::from(set == "live");
            }
        }
    }
    assert!(live >= 6, "{live}");
}

/// A shipped graph with some of its text replaced, running live.
fn run(folder: &Path, graph: &str, replaced: &[(&str, &str)], more: &[&str]) -> Child {
    let text = fs::read_to_string(graphs().join(graph)).unwrap();
    let text = replaced.iter().fold(text, |text, (shipped, here)| {
        assert!(text.contains(shipped), "{graph} has no {shipped}");
        text.replace(shipped, here)
    });
    let shipped = graphs().display().to_string();
    let text = text.replace("\"surfaces/", &format!("\"{shipped}/surfaces/"));
    fs::write(folder.join("graph.ron"), text).unwrap();
    Command::new(env!("CARGO_BIN_EXE_haptograph"))
        .args(["run", "graph.ron", "--live"])
        .args(more)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(fs::File::create(folder.join("said")).unwrap())
        .spawn()
        .unwrap()
}

/// At a port of the test's own.
fn at(port: u16) -> String {
    format!("127.0.0.1:{port}")
}

fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Plays a device until the graph has ended: what it senses at each time since it was first answered. Returns the largest of
/// each of what it was told to drive: force (N), actuator and brake (A).
fn play(graph: &mut Child, port: u16, sensed: impl Fn(f64) -> State) -> [f64; 3] {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.connect(("127.0.0.1", port)).unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(5))).unwrap();
    let (mut largest, mut start) = ([0.0_f64; 3], None::<Instant>);
    let begun = Instant::now();
    for sequence in 0.. {
        let time_s = start.map_or(0.0, |start| start.elapsed().as_secs_f64());
        let state = State { sequence, ..sensed(time_s) };
        // Until the graph listens, nobody answers.
        let _ = socket.send(&state.to_bytes());
        let mut answer = [0; 100];
        if let Ok(length) = socket.recv(&mut answer)
            && let Ok(driven) = Driven::from_bytes(&answer[..length])
        {
            start.get_or_insert_with(Instant::now);
            let force = driven.force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
            for (largest, now) in
                largest.iter_mut().zip([force, driven.current_a.abs(), driven.brake_a.abs()])
            {
                *largest = largest.max(now);
            }
        }
        std::thread::sleep(Duration::from_millis(1));
        if graph.try_wait().unwrap().is_some() {
            break;
        }
        assert!(begun.elapsed() < Duration::from_secs(120), "the graph does not end");
    }
    largest
}

/// The greatest number in a column of a table.
fn largest_in(table: &Path, column: &str) -> f64 {
    let text = fs::read_to_string(table).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let place = names.iter().position(|name| name.contains(column)).unwrap_or_else(|| panic!("{names:?}"));
    let cells = lines.filter_map(|line| line.split(',').nth(place)?.parse::<f64>().ok());
    cells.fold(0.0, f64::max)
}

#[test]
fn the_pen_stands_with_a_real_sensor_that_has_an_offset() {
    let (folder, port) = (tempfile::tempdir().unwrap(), free_port());
    let folder = folder.path();
    let here = at(port);
    let mut graph = run(folder, "ar-pen.ron", &[("127.0.0.1:9750", &here)], &["--for", "6"]);
    // The object weighs on the sensor, which is off besides. From 2.5 s on the pen strokes its top with 1 N.
    let largest = play(&mut graph, port, |time_s| {
        let (offset, weight) = ([0.3, -0.2, 0.4], [0.0, 0.0, -1.7]);
        let x = 0.008 * (TAU * time_s).sin();
        let press = if time_s > 2.5 { 1.0 } else { 0.0 };
        State {
            force_n: [offset[0], offset[1], offset[2] + weight[2] - press],
            torque_n_m: [0.01, x * press, 0.0],
            ..State::default()
        }
    });
    let said = fs::read_to_string(folder.join("said")).unwrap();
    assert!(graph.wait().unwrap().success(), "{said}");
    let [_, current_a, _] = largest;
    assert!(current_a > 0.01 && current_a <= 0.5, "{current_a} A; {said}");
    let load = largest_in(&folder.join("out/graph/touch.csv"), "touch.load");
    assert!(load > 0.9 && load < 1.2, "the weight is taken off: {load} N");
}

#[test]
fn the_omni_pushes_back_at_a_real_arm() {
    let (folder, port) = (tempfile::tempdir().unwrap(), free_port());
    let folder = folder.path();
    let here = at(port);
    let mut graph = run(folder, "omni.ron", &[("127.0.0.1:9750", &here)], &["--for", "2"]);
    // The tip goes round on the sphere of 50 mm, 4 mm under its surface.
    let [force_n, ..] = play(&mut graph, port, |time_s| {
        let (sin, cos) = (0.5 * (TAU * time_s).sin()).sin_cos();
        State { position_m: [0.0476 * sin, 0.0, 0.0476 * cos], ..State::default() }
    });
    let said = fs::read_to_string(folder.join("said")).unwrap();
    assert!(graph.wait().unwrap().success(), "{said}");
    assert!(force_n > 0.3 && force_n < 3.301, "{force_n} N; {said}");
}

/// `/position x y` and `/force n` of Open Sound Control.
fn osc(x_mm: f32, force_n: f32) -> [Vec<u8>; 2] {
    let place = [&b"/position\0\0\0,ff\0"[..], &x_mm.to_be_bytes(), &[0; 4]].concat();
    [place, [&b"/force\0\0,f\0\0"[..], &force_n.to_be_bytes()].concat()]
}

#[test]
fn the_texture_is_stroked_over_open_sound_control() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, port) = (folder.path(), free_port());
    // Everything is the shipped graph's but for the soundcard, which is not here.
    let card = "Soundcard(amperes_full_scale: 1.0, buffer_frames: 64)";
    let here = at(port);
    let replaced = [("127.0.0.1:9751", &*here), (card, "SimulatedHaptuator()")];
    let mut graph = run(folder, "texturepad.ron", &replaced, &["--endpoints", "osc", "--for", "3"]);
    let (sender, start) = (UdpSocket::bind("127.0.0.1:0").unwrap(), Instant::now());
    while graph.try_wait().unwrap().is_none() {
        let time_s = start.elapsed().as_secs_f64();
        for packet in osc((20.0 * (TAU * time_s).sin()) as f32, 1.0) {
            let _ = sender.send_to(&packet, ("127.0.0.1", port));
        }
        std::thread::sleep(Duration::from_millis(5));
        assert!(time_s < 120.0, "the graph does not end");
    }
    assert!(graph.wait().unwrap().success());
    let wav = hound::WavReader::open(folder.join("out/graph/current.wav")).unwrap();
    let samples = wav.into_samples::<f32>().map(|sample| sample.unwrap().abs());
    let largest = samples.fold(0.0, f32::max);
    assert!(largest > 0.01 && largest <= 0.5, "{largest} A");
}
