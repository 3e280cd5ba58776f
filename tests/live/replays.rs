//! Live runs again, bit for bit.

use super::*;

/// A position that steers an actuator, and another device beside it: both listen at a port that is free.
const STEERED: &str = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000), "audio": Driver(rate_hz: 8000) },
    nodes: {
        "stylus": Tablet(clock: "servo", endpoint: "stylus"),
        "other":  Tablet(clock: "servo", endpoint: "other"),
        "felt":   Calibrate(input: "stylus.force", from: "force", to: "current", factor: 0.1),
        "bias":   Constant(clock: "audio", value: 0.4, quantity: "current"),
        "sum":    Add(clock: "audio", inputs: [Ring(from: "felt", latency_ms: 20), "bias"]),
        "out":    ActuatorSink(current: "sum", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
        "kept":   CsvSink(inputs: ["out.delivered"], file: "kept.csv"),
        "sensed": CsvSink(inputs: ["stylus.force", "other.force"], file: "sensed.csv"),
    },
    endpoints: { "live": {
        "stylus": OscDevice(listen: "127.0.0.1:0", timeout_ms: 300),
        "other": OscDevice(listen: "127.0.0.1:0", timeout_ms: 300), "coil": SimulatedHaptuator(),
    } })"#;

#[test]
fn a_live_run_whose_input_fell_silent_is_repeated_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("g.ron"), STEERED).unwrap();
    let mut run = Running::start(folder.path(), &["run", "g.ron", "--live", "--out", "live"]);
    run.wait_for_times("listening for `", 2);
    let said = run.said();
    let places: Vec<&str> =
        said.lines().filter_map(|line| line.strip_prefix("listening for `")?.split(" at ").nth(1)).collect();
    assert!(places.len() == 2 && places[0] != places[1], "{places:?}");
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let speak = || {
        for step in 0..60_u8 {
            for place in &places {
                socket.send_to(&osc("/force", 1.0 + 0.01 * f32::from(step)), place).unwrap();
            }
            // The period of the device.
            std::thread::sleep(Duration::from_millis(8));
        }
    };
    speak();
    run.wait_for("`stylus` has been silent for");
    speak();
    run.stop();
    let replay =
        ["run", "g.ron", "--endpoints", "live", "--replay", "live", "--block", "17", "--out", "replay"];
    let told = succeed(folder.path(), &replay);
    let told = String::from_utf8_lossy(&told.stderr).into_owned();
    assert!(!told.contains("not repeated"), "{told}");
    let of = |run: &str, file: &str| fs::read(folder.path().join(run).join(file)).unwrap();
    for file in ["kept.csv", "sensed.csv"] {
        let (live, replayed) = (of("live", file), of("replay", file));
        assert!(live.len() > 4000, "{file}");
        let lines =
            |text: &[u8]| String::from_utf8_lossy(text).lines().map(str::to_owned).collect::<Vec<_>>();
        let (live, replayed) = (lines(&live), lines(&replayed));
        let differing = live.iter().zip(&replayed).position(|(a, b)| a != b);
        let shown = differing.map(|line| (line, &live[line], &replayed[line]));
        assert!(live == replayed, "{file}: {} and {} lines, {shown:?}", live.len(), replayed.len());
    }
    let kept = String::from_utf8(of("live", "kept.csv")).unwrap();
    let given: Vec<f64> =
        kept.lines().skip(1).filter_map(|line| line.rsplit(',').next()?.parse().ok()).collect();
    let driven = given.iter().position(|x| *x > 0.4).unwrap();
    let silent = given[driven..].iter().position(|x| *x == 0.0).unwrap() + driven;
    assert!(given[silent..].iter().any(|x| *x > 0.4), "it came back");
    // A forged log is refused with its place, and nothing is written.
    let path = folder.path().join("live/arrivals/1.csv");
    let right = fs::read_to_string(&path).unwrap();
    let mut lines: Vec<&str> = right.lines().collect();
    lines[4] = "4294967295,0,1,0,0";
    fs::write(&path, lines.join("\n") + "\n").unwrap();
    let forged = command(
        folder.path(),
        &["run", "g.ron", "--endpoints", "live", "--replay", "live", "--out", "forged"],
    );
    let output = { forged }.output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && told.contains("1.csv line 5"), "{told}");
    assert!(!folder.path().join("forged").exists());
}

#[test]
fn a_run_of_two_drivers_is_repeated_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let graph = shipped("two-drivers.ron");
    let common = ["run", &graph, "--endpoints", "simulated"];
    let live = [&common[..], &["--live", "--for", "0.5", "--out", "live"]].concat();
    succeed(folder.path(), &live);
    let kept = facts(&folder.path().join("live"));
    assert!(kept["drivers"]["servo"]["wakes"].is_number() && kept["drivers"]["audio"]["wakes"].is_number());
    let ring = &kept["rings"]["moves.output to moving.input"];
    assert!(ring["underruns"].is_number() && ring["latency_ms"] == 12.0, "{kept}");
    let replay = [&common[..], &["--replay", "live", "--block", "17"]].concat();
    succeed(folder.path(), &[&replay[..], &["--out", "replay"]].concat());
    for file in ["texture.wav", "hand.csv", "crossed.csv"] {
        let of = |run: &str| fs::read(folder.path().join(run).join(file)).unwrap();
        assert!(of("live").len() > 400, "{file}");
        assert!(of("live") == of("replay"), "{file}");
    }
    let wrong = [&replay[..], &["--seed", "8", "--out", "wrong"]].concat();
    let output = command(folder.path(), &wrong).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && told.contains("the seed differs: 7 in that run, 8 now"), "{told}");
}

/// One driver and two; a parameter, and settings of nodes.
#[test]
fn what_was_typed_while_it_ran_is_repeated_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tone.ron"), TONE).unwrap();
    let two = shipped("two-drivers.ron");
    for (graph, lines, seen, files) in [
        (
            "tone.ron",
            [
                ("set loudness=0.5", "set: loud.gain=0.5 (taken over in"),
                ("set loud.gain=0.75", "loud.gain is 0.75"),
            ],
            "seen.csv",
            &["loud.wav"][..],
        ),
        (
            &two,
            [("set moves.gain=0.3", "moves.gain is 0.3"), ("set pressing.gain=0.5", "pressing.gain is 0.5")],
            "crossed.csv",
            &["texture.wav", "hand.csv", "crossed.csv"],
        ),
    ] {
        let common = ["run", graph, "--endpoints", "simulated"];
        let mut run = Running::start(folder.path(), &[&common[..], &["--live", "--out", "live"]].concat());
        for (line, answer) in lines {
            run.type_line(line);
            run.wait_for(answer);
            run.wait_for_more_rows(seen);
        }
        run.stop();
        let replay = [&common[..], &["--replay", "live", "--block", "17", "--out", "replay"]];
        let told = succeed(folder.path(), &replay.concat());
        assert!(!String::from_utf8_lossy(&told.stderr).contains("not repeated"));
        for file in files {
            let of = |run: &str| fs::read(folder.path().join(run).join(file)).unwrap();
            assert!(of("live").len() > 400, "{file}");
            assert!(of("live") == of("replay"), "{file}");
        }
    }
    let kept = fs::read_to_string(folder.path().join("live/arrivals/1.settings.csv")).unwrap();
    assert!(kept.lines().last().unwrap().ends_with(",1,0.3,20,moves.gain"), "{kept}");
}
