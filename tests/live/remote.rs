//! Settings by Open Sound Control while a graph runs, and stops that nothing delays.

use super::*;

/// How long a run may go on after a stop, by its own frames, s: a stop is acted on in its next callback.
#[cfg(unix)]
const MAX_RUN_ON_S: f64 = 2.0;

/// Sends packets to where a run listens for settings.
fn osc_sender(run: &Running) -> impl Fn(&[u8]) + use<> {
    let said = run.said();
    let (_, rest) = said.split_once("Open Sound Control at ").unwrap();
    let address = rest.lines().next().unwrap().to_owned();
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    move |bytes| assert_eq!(socket.send_to(bytes, &address).unwrap(), bytes.len())
}

#[test]
fn settings_are_changed_by_open_sound_control() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tone.ron"), TONE).unwrap();
    let arguments = ["run", "tone.ron", "--live", "--osc", "127.0.0.1:0", "--out", "out"];
    let mut run = Running::start(folder.path(), &arguments);
    run.wait_for("Open Sound Control at 127.0.0.1:");
    let send = osc_sender(&run);
    send(&osc("/loud/gain", 0.5));
    send(b"nonsense");
    for _ in 0..3 {
        send(&osc("/loud/gian", 1.0));
    }
    run.wait_for("did you mean `loud.gain`");
    send(&osc("/loudness", 0.75));
    send(&osc("/nobody", 0.75));
    run.wait_for("no parameter `nobody`");
    run.wait_for_rows("seen.csv", 0.75, 1);
    let told = run.stop();
    assert_eq!(told.matches("did you mean").count(), 1, "{told}");
    let out = folder.path().join("out");
    let facts = facts(&out);
    let set: Vec<&str> =
        facts["set_while_running"].as_array().unwrap().iter().filter_map(|set| set.as_str()).collect();
    assert!(set[0].ends_with("loud.gain=0.5 (OSC)") && set[1].ends_with("loudness=0.75 (OSC)"), "{set:?}");
    assert_eq!((set.len(), &facts["osc_malformed"]), (2, &serde_json::json!(1)));
    assert_eq!(samples(&out.join("loud.wav")).last(), Some(&0.75));
}

#[test]
fn no_limit_is_changed_by_network() {
    let folder = tempfile::tempdir().unwrap();
    let graph = r#"Graph(format: 1, parameters: { "most": 0.5, "strong": 2.9 }, clocks: { "audio": Driver(rate_hz: 10000) },
        nodes: {
            "two": Constant(clock: "audio", value: 2, quantity: "current"),
            "out": ActuatorSink(current: "two", endpoint: "a", limit: (peak_a: Param("most"), continuous_a: Param("most"))),
            "file": CsvSink(inputs: ["out.delivered"], file: "given.csv"),
        },
        endpoints: { "simulated": { "a": SimulatedHaptuator(force_n_per_a: Param("strong")) } })"#;
    fs::write(folder.path().join("g.ron"), graph).unwrap();
    let arguments = ["run", "g.ron", "--live", "--osc", "127.0.0.1:0", "--out", "out"];
    let mut run = Running::start(folder.path(), &arguments);
    run.wait_for("Open Sound Control at 127.0.0.1:");
    osc_sender(&run)(&osc("/most", 2.0));
    run.wait_for("limits and devices can only be changed");
    // The settings of the device scale its signal: the full scale of an amplifier, here the force of a coil per ampere.
    osc_sender(&run)(&osc("/strong", 29.0));
    run.wait_for_times("limits and devices can only be changed", 2);
    // At the terminal it is allowed, and reported.
    run.type_line("set most=0.4");
    run.wait_for("limit of `out`: peak 0.5 -> 0.4 A");
    run.stop();
    let given = fs::read_to_string(folder.path().join("out/given.csv")).unwrap();
    let most = given.lines().skip(1).filter_map(|line| line.rsplit(',').next()?.parse::<f64>().ok());
    assert!(most.fold(0.0, f64::max) <= 0.5);
}

/// An OSC message with a text.
fn osc_text(address: &str, text: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    for text in [address, ",s", text] {
        bytes.extend(text.bytes());
        bytes.resize(bytes.len() / 4 * 4 + 4, 0);
    }
    bytes
}

/// A ctrl-C, and how long the run goes on after it, by its own frames, s. Machines stall; what is allowed for that is
/// little beside what a load takes that holds up a stop.
#[cfg(unix)]
fn interrupt(mut run: Running, out: &Path) -> (String, f64) {
    let before_s = run.started.elapsed().as_secs_f64();
    let pid = run.child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    assert!(run.child.wait().unwrap().success(), "{}", run.said());
    let ran_on_s = facts(out)["seconds"].as_f64().unwrap() - before_s;
    (run.said(), ran_on_s)
}

#[cfg(unix)]
#[test]
fn a_surface_that_cannot_be_read_delays_no_stop_and_none_is_named_by_network() {
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("fifo");
    assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let (graph, fifo) = (shipped("texturepad.ron"), fifo.display().to_string());
    let arguments = ["run", &graph, "--live", "--endpoints", "simulated"];
    let more = ["--osc", "127.0.0.1:0", "--out", "out"];
    let mut run = Running::start(folder.path(), &[&arguments[..], &more].concat());
    run.wait_for("Open Sound Control at 127.0.0.1:");
    let send = osc_sender(&run);
    for path in [&fifo, "fifo", "/dev/zero", "/dev/stdin", "../fifo", "\"fifo\""] {
        send(&osc_text("/surface", path));
    }
    run.wait_for("`surface` was not changed: ");
    run.type_line("set surface=/dev/stdin");
    run.type_line(&format!("set surface={fifo}"));
    std::thread::sleep(Duration::from_millis(200));
    let out = folder.path().join("out");
    let (said, ran_on_s) = interrupt(run, &out);
    assert!(ran_on_s < MAX_RUN_ON_S, "{ran_on_s} s: {said}");
    let facts = facts(&out);
    assert_eq!((&facts["changes"], &facts["stopped"]), (&0.into(), &true.into()));
}

#[cfg(unix)]
#[test]
fn an_unknown_name_does_not_load_the_graph() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tone.ron"), TONE).unwrap();
    let arguments = ["run", "tone.ron", "--live", "--osc", "127.0.0.1:0", "--out", "out"];
    let mut run = Running::start(folder.path(), &arguments);
    run.wait_for("Open Sound Control at 127.0.0.1:");
    let send = osc_sender(&run);
    // Loading it would report an error.
    fs::write(folder.path().join("tone.ron"), "Graph(").unwrap();
    for number in 0..400 {
        send(&osc(&format!("/p{number}"), 1.0));
    }
    for hostile in ["(((((((", "[1", "Param(\"loudness\")", "1), gain: (9", "\u{202e}x"] {
        send(&osc_text("/loudness", hostile));
    }
    for number in [f32::NAN, f32::INFINITY, -1e30] {
        send(&osc("/loud/gain", number));
    }
    run.wait_for("no parameter `p");
    let (said, ran_on_s) = interrupt(run, &folder.path().join("out"));
    assert!(ran_on_s < MAX_RUN_ON_S, "{ran_on_s} s: {said}");
    assert!(!said.contains("E01"), "{said}");
    assert_eq!(facts(&folder.path().join("out"))["changes"], 0);
}
