//! Graphs against the clock, as their users run them. No test here asserts a wall-clock deadline: machines stall.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn shipped(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs").join(name);
    path.display().to_string()
}

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_haptograph"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null());
    command
}

fn succeed(folder: &Path, arguments: &[&str]) -> Output {
    let output = command(folder, arguments).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {told}");
    output
}

/// A run that is talked to while it runs. What it says is written to a file, to be read meanwhile.
struct Running {
    child: Child,
    said: PathBuf,
    /// When it was first seen to run.
    started: Instant,
}

/// How long a run may go on after a stop, by its own frames, s: a stop is acted on in its next callback.
#[cfg(unix)]
const MOST_RUN_ON_S: f64 = 2.0;

impl Running {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        Self::of(command(folder, arguments), folder)
    }

    fn of(mut command: Command, folder: &Path) -> Self {
        let said = folder.join("said");
        let child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(fs::File::create(&said).unwrap())
            .spawn()
            .unwrap();
        let started = Instant::now();
        let mut running = Self { child, said, started };
        running.wait_for("driven by");
        // Its frames are counted from about here.
        running.started = Instant::now();
        running
    }

    fn said(&self) -> String {
        fs::read_to_string(&self.said).unwrap()
    }

    fn wait_for(&mut self, words: &str) {
        self.wait_for_times(words, 1);
    }

    fn wait_for_times(&mut self, words: &str, times: usize) {
        let start = Instant::now();
        let is_said = |told: &str| told.matches(words).count() >= times;
        while !is_said(&self.said()) {
            let ended = self.child.try_wait().unwrap().is_some();
            let told = self.said();
            assert!(is_said(&told) || !ended, "it ended: {told}");
            assert!(
                start.elapsed() < Duration::from_secs(60),
                "no `{words}` in: {told}"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn type_line(&mut self, line: &str) {
        writeln!(self.child.stdin.as_mut().unwrap(), "{line}").unwrap();
    }

    fn stop(mut self) -> String {
        self.type_line("stop");
        assert!(self.child.wait().unwrap().success(), "{}", self.said());
        self.said()
    }
}

fn facts(run: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(run.join("run.json")).unwrap()).unwrap()
}

#[test]
fn live_and_offline_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let graph = shipped("texturepad.ron");
    let common = ["run", &graph, "--for", "0.3", "--endpoints", "simulated", "--out"];
    succeed(folder.path(), &[&common[..], &["offline"]].concat());
    succeed(folder.path(), &[&common[..], &["live", "--live"]].concat());
    let of = |run: &str, file: &str| fs::read(folder.path().join(run).join(file)).unwrap();
    for file in ["texture.wav", "current.wav", "hand.csv"] {
        assert!(of("offline", file).len() > 400, "{file}");
        assert!(of("offline", file) == of("live", file), "{file}");
    }
    let facts = facts(&folder.path().join("live"));
    assert_eq!(
        (&facts["driver_frames"], &facts["live"]),
        (&14_400.into(), &true.into())
    );
    assert!(facts["late_us"]["p99"].is_number() && facts["wakes"].as_u64().unwrap() >= 300);
}

const TONE: &str = r#"Graph(format: 1,
    parameters: { "loudness": 0.25 },
    clocks: { "servo": Driver(rate_hz: 1000) },
    nodes: {
        "one": Constant(clock: "servo", value: 1, quantity: "number"),
        "loud": Gain(input: "one", gain: Param("loudness")),
        "file": WavSink(input: "loud", file: "loud.wav"),
    })"#;

/// Samples of a mono WAV file of 32-bit floats.
fn samples(path: &Path) -> Vec<f32> {
    let bytes = fs::read(path).unwrap();
    let at = bytes.windows(4).position(|tag| tag == b"data").unwrap() + 8;
    bytes[at..]
        .as_chunks()
        .0
        .iter()
        .map(|bytes| f32::from_le_bytes(*bytes))
        .collect()
}

#[test]
fn a_setting_typed_while_it_runs_glides_and_a_stop_completes_the_files() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tone.ron"), TONE).unwrap();
    let mut run = Running::start(folder.path(), &["run", "tone.ron", "--live", "--out", "out"]);
    run.type_line("set loudness=0.5");
    run.wait_for("a setting changed");
    // It takes 20 ms to get there.
    std::thread::sleep(Duration::from_millis(300));
    run.type_line("set loud.gain=0.75");
    run.wait_for("loud.gain is 0.75");
    // A line that is too long is passed over as a whole, whatever stands at its end.
    let long = format!("{}\nset loud.gain=0.75", "stop ".repeat(20_000));
    for (wrong, told) in [
        (&*long, "it is longer than 65536 bytes"),
        ("set loudnes=1", "no parameter `loudnes`"),
        ("set loud.gian=1", "did you mean `loud.gain`"),
        ("dance", "`dance` is not known"),
    ] {
        run.type_line(wrong);
        run.wait_for(told);
    }
    std::thread::sleep(Duration::from_millis(300));
    run.stop();
    let heard = samples(&folder.path().join("out/loud.wav"));
    assert_eq!((heard[0], *heard.last().unwrap()), (0.25, 0.75));
    assert!(heard.contains(&0.5));
    // 20 ms for a quarter: 1/80 a frame.
    assert!(
        heard
            .windows(2)
            .all(|pair| (0.0..0.013).contains(&(pair[1] - pair[0]))),
        "a jump"
    );
}

/// An OSC message with one number.
fn osc(address: &str, number: f32) -> Vec<u8> {
    let mut bytes = Vec::new();
    for text in [address, ",f"] {
        bytes.extend(text.bytes());
        bytes.resize(bytes.len() / 4 * 4 + 4, 0);
    }
    bytes.extend(number.to_be_bytes());
    bytes
}

/// Sends packets to where a run listens for settings.
fn teller(run: &Running) -> impl Fn(&[u8]) + use<> {
    let said = run.said();
    let (_, rest) = said.split_once("Open Sound Control at ").unwrap();
    let address = rest.lines().next().unwrap().to_owned();
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    move |bytes| assert_eq!(socket.send_to(bytes, &address).unwrap(), bytes.len())
}

#[test]
fn settings_are_told_by_open_sound_control() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tone.ron"), TONE).unwrap();
    let arguments = [
        "run",
        "tone.ron",
        "--live",
        "--osc",
        "127.0.0.1:0",
        "--out",
        "out",
    ];
    let mut run = Running::start(folder.path(), &arguments);
    run.wait_for("Open Sound Control at 127.0.0.1:");
    let tell = teller(&run);
    tell(&osc("/loud/gain", 0.5));
    tell(b"nonsense");
    for _ in 0..3 {
        tell(&osc("/loud/gian", 1.0));
    }
    run.wait_for("did you mean `loud.gain`");
    tell(&osc("/loudness", 0.75));
    tell(&osc("/nobody", 0.75));
    run.wait_for("no parameter `nobody`");
    // The graph is loaded for the parameter, which then takes 20 ms to get there.
    std::thread::sleep(Duration::from_millis(300));
    let told = run.stop();
    assert_eq!(told.matches("did you mean").count(), 1, "{told}");
    let out = folder.path().join("out");
    let facts = facts(&out);
    let set: Vec<&str> = facts["set_while_running"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|set| set.as_str())
        .collect();
    assert!(
        set[0].ends_with("loud.gain=0.5 (OSC)") && set[1].ends_with("loudness=0.75 (OSC)"),
        "{set:?}"
    );
    assert_eq!((set.len(), &facts["osc_malformed"]), (2, &serde_json::json!(1)));
    assert_eq!(samples(&out.join("loud.wav")).last(), Some(&0.75));
}

#[test]
fn no_limit_is_changed_from_afar() {
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
    teller(&run)(&osc("/most", 2.0));
    run.wait_for("an actuator's limit or device would change");
    // What the device is set to says what its numbers mean: an amplifier's full scale, here what a coil does of a current.
    teller(&run)(&osc("/strong", 29.0));
    run.wait_for_times("an actuator's limit or device would change", 2);
    // Who sits there may, and is told.
    run.type_line("set most=0.4");
    run.wait_for("limit of `out`: peak 0.5 -> 0.4 A");
    run.stop();
    let given = fs::read_to_string(folder.path().join("out/given.csv")).unwrap();
    let most = given
        .lines()
        .skip(1)
        .filter_map(|line| line.rsplit(',').next()?.parse::<f64>().ok());
    assert!(most.fold(0.0, f64::max) <= 0.5);
}

/// A text that is told.
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
    assert!(
        Command::new("kill")
            .args(["-INT", &pid])
            .status()
            .unwrap()
            .success()
    );
    assert!(run.child.wait().unwrap().success(), "{}", run.said());
    let ran_on_s = facts(out)["seconds"].as_f64().unwrap() - before_s;
    (run.said(), ran_on_s)
}

#[cfg(unix)]
#[test]
fn a_surface_that_never_comes_holds_up_no_stop_and_none_is_named_from_afar() {
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("fifo");
    assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let (graph, fifo) = (shipped("texturepad.ron"), fifo.display().to_string());
    let arguments = ["run", &graph, "--live", "--endpoints", "simulated"];
    let more = ["--osc", "127.0.0.1:0", "--out", "out"];
    let mut run = Running::start(folder.path(), &[&arguments[..], &more].concat());
    run.wait_for("Open Sound Control at 127.0.0.1:");
    let tell = teller(&run);
    for path in [&fifo, "fifo", "/dev/zero", "/dev/stdin", "../fifo", "\"fifo\""] {
        tell(&osc_text("/surface", path));
    }
    run.wait_for("`surface` stays: from afar");
    run.type_line("set surface=/dev/stdin");
    run.type_line(&format!("set surface={fifo}"));
    std::thread::sleep(Duration::from_millis(200));
    let out = folder.path().join("out");
    let (said, ran_on_s) = interrupt(run, &out);
    assert!(ran_on_s < MOST_RUN_ON_S, "{ran_on_s} s: {said}");
    let facts = facts(&out);
    assert_eq!((&facts["changes"], &facts["stopped"]), (&0.into(), &true.into()));
}

#[cfg(unix)]
#[test]
fn what_the_graph_does_not_have_is_not_looked_for_in_its_file() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tone.ron"), TONE).unwrap();
    let arguments = [
        "run",
        "tone.ron",
        "--live",
        "--osc",
        "127.0.0.1:0",
        "--out",
        "out",
    ];
    let mut run = Running::start(folder.path(), &arguments);
    run.wait_for("Open Sound Control at 127.0.0.1:");
    let tell = teller(&run);
    // To look would be to find something wrong.
    fs::write(folder.path().join("tone.ron"), "Graph(").unwrap();
    for number in 0..400 {
        tell(&osc(&format!("/p{number}"), 1.0));
    }
    for hostile in [
        "(((((((",
        "[1",
        "Param(\"loudness\")",
        "1), gain: (9",
        "\u{202e}x",
    ] {
        tell(&osc_text("/loudness", hostile));
    }
    for number in [f32::NAN, f32::INFINITY, -1e30] {
        tell(&osc("/loud/gain", number));
    }
    run.wait_for("no parameter `p");
    let (said, ran_on_s) = interrupt(run, &folder.path().join("out"));
    assert!(ran_on_s < MOST_RUN_ON_S, "{ran_on_s} s: {said}");
    assert!(!said.contains("E01"), "{said}");
    assert_eq!(facts(&folder.path().join("out"))["changes"], 0);
}

#[test]
fn a_graph_of_nothing_is_refused_while_another_runs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tone.ron");
    fs::write(&path, TONE).unwrap();
    let arguments = ["run", "tone.ron", "--live", "--watch", "--out", "out"];
    let mut run = Running::start(folder.path(), &arguments);
    fs::write(&path, "Graph(format: 1, nodes: {})").unwrap();
    run.wait_for("E0506");
    run.wait_for("the graph stays as it was");
    run.stop();
    assert!(!samples(&folder.path().join("out/loud.wav")).is_empty());
}

#[cfg(unix)]
#[test]
fn a_graph_whose_name_is_no_text_leaves_its_files() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let name = std::ffi::OsStr::from_bytes(b"g\xff.ron");
    fs::write(folder.path().join(name), TONE).unwrap();
    let mut run = command(folder.path(), &["run", "--live", "--for", "0.1", "--out", "out"]);
    let output = run.arg(name).output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(facts(&folder.path().join("out"))["graph"], "g\u{fffd}.ron");
}

#[test]
fn a_saved_graph_takes_over_and_a_wrong_one_is_shown_and_left() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tone.ron");
    fs::write(&path, TONE).unwrap();
    let mut run = Running::start(
        folder.path(),
        &["run", "tone.ron", "--live", "--watch", "--out", "out"],
    );
    fs::write(&path, TONE.replace("Gain(", "Gian(")).unwrap();
    run.wait_for("the graph stays as it was");
    assert!(run.said().contains("did you mean `Gain`"), "{}", run.said());
    let more = r#""twice": Gain(input: "loud", gain: 2), "more": WavSink(input: "twice", file: "more.wav"),
        "file":"#;
    fs::write(&path, TONE.replace("\"file\":", more)).unwrap();
    run.wait_for("the graph changed; more.wav begins");
    // What was typed stays set through other changes.
    run.type_line("set loud.gain=0.5");
    run.wait_for("loud.gain is 0.5");
    fs::write(&path, TONE.replace("value: 1,", "value: 1, ")).unwrap();
    run.wait_for("more.wav is complete");
    std::thread::sleep(Duration::from_millis(300));
    let told = run.stop();
    let out = folder.path().join("out");
    let (all, some) = (samples(&out.join("loud.wav")), samples(&out.join("more.wav")));
    assert_eq!((all[0], *all.last().unwrap()), (0.25, 0.5), "{told}");
    assert!(
        !some.is_empty() && some.len() < all.len(),
        "{} of {}",
        some.len(),
        all.len()
    );
    assert!(some[0] == 0.5 && *some.last().unwrap() == 1.0);
    let facts = facts(&out);
    assert_eq!(facts["driver_frames"], all.len());
    // What ran when can be told afterwards.
    let saved = facts["saved_while_running"].as_array().unwrap();
    assert_eq!(
        (saved.len(), &saved[0]["graph"]),
        (2, &serde_json::json!("changes/1"))
    );
    assert_eq!(saved[0]["what"], "the graph changed");
    let kept = fs::read_to_string(out.join("changes/1/tone.ron")).unwrap();
    assert!(kept.contains("more.wav"), "{kept}");
}

#[test]
fn what_the_file_says_anew_counts_more_than_what_was_typed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tone.ron");
    fs::write(&path, TONE).unwrap();
    let arguments = ["run", "tone.ron", "--live", "--watch", "--out", "out"];
    let mut run = Running::start(folder.path(), &arguments);
    run.type_line("set loudness=0.75");
    run.wait_for("a setting changed");
    // It stays through other changes,
    fs::write(&path, format!("// Loud.\n{TONE}")).unwrap();
    run.wait_for("nothing changed");
    // and a value that no setting can have is no value.
    run.type_line("set loud.gain=NaN");
    run.wait_for("choose a finite number");
    fs::write(&path, TONE.replace("0.25", "0.5")).unwrap();
    run.wait_for_times("a setting changed", 2);
    std::thread::sleep(Duration::from_millis(300));
    run.stop();
    let heard = samples(&folder.path().join("out/loud.wav"));
    assert!(heard.contains(&0.75));
    assert_eq!(heard.last(), Some(&0.5));
}

#[test]
fn a_file_that_is_saved_just_before_something_is_typed_is_taken_over_as_a_save() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tone.ron");
    let file = r#""more": Gain(input: "loud", gain: Param("more")), "file": WavSink(input: "more""#;
    let graph = TONE
        .replace("\"loudness\": 0.25", "\"loudness\": 0.25, \"more\": 1")
        .replace(r#""file": WavSink(input: "loud""#, file);
    fs::write(&path, &graph).unwrap();
    let arguments = ["run", "tone.ron", "--live", "--watch", "--out", "out"];
    let mut run = Running::start(folder.path(), &arguments);
    run.type_line("set loudness=0.75");
    run.wait_for("a setting changed");
    fs::write(&path, graph.replace("0.25", "0.5")).unwrap();
    run.type_line("set more=2");
    run.wait_for_times("setting", 3);
    std::thread::sleep(Duration::from_millis(500));
    let told = run.stop();
    let out = folder.path().join("out");
    // The file's new default counts more than what was typed before; what was typed after it counts on.
    assert_eq!(samples(&out.join("loud.wav")).last(), Some(&1.0), "{told}");
    let kept = fs::read_to_string(out.join("changes/1/tone.ron")).unwrap();
    assert!(kept.contains("\"loudness\": 0.5"), "{kept}");
}

#[test]
fn no_graph_writes_what_its_run_writes_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tone.ron");
    let played = r#""amperes": Constant(clock: "audio", value: 0, quantity: "current"),
        "out": ActuatorSink(current: "amperes", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
        "file""#;
    let endpoint = r#"}, endpoints: { "simulated": { "coil": Soundcard(amperes_full_scale: 1) } })"#;
    let played = TONE
        .replace("servo", "audio")
        .replace("1000", "48000")
        .replace("\"file\"", played)
        .replace("})", endpoint);
    for (graph, file, more, words) in [
        (TONE, "run.json", None, "E0304"),
        (
            TONE,
            "record/loud.wav",
            Some("--record"),
            "which the run writes itself",
        ),
        (
            &*played,
            "coil.soundcard.wav",
            None,
            "which the run writes itself",
        ),
    ] {
        fs::write(&path, graph.replace("loud.wav", file)).unwrap();
        let run = ["run", "tone.ron", "--for", "0.1"];
        let told = command(folder.path(), &run).args(more).output().unwrap();
        let told = String::from_utf8_lossy(&told.stderr).into_owned();
        assert!(told.contains(words), "{file}: {told}");
    }
    // Nor one that is saved while it runs.
    fs::write(&path, TONE).unwrap();
    let mut run = Running::start(folder.path(), &["run", "tone.ron", "--live", "--watch"]);
    fs::write(&path, TONE.replace("loud.wav", "run.json")).unwrap();
    run.wait_for("E0304");
    run.wait_for("the graph stays as it was");
    run.stop();
    // Nor one whose name only this run takes.
    fs::write(&path, TONE).unwrap();
    let arguments = [
        "run", "tone.ron", "--live", "--watch", "--record", "--out", "kept",
    ];
    let mut run = Running::start(folder.path(), &arguments);
    fs::write(&path, TONE.replace("loud.wav", "record/loud.wav")).unwrap();
    run.wait_for("the graph stays as it was: the sink `file` writes record/loud.wav");
    run.stop();
    let out = folder.path().join("kept");
    assert_eq!(
        (&facts(&out)["changes"], &facts(&out)["swaps"]),
        (&0.into(), &0.into())
    );
    let recorded = samples(&out.join("record/loud.output.wav"));
    assert_eq!(facts(&out)["driver_frames"], recorded.len());
}

#[test]
fn a_live_run_ends_with_its_data() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..300).map(|row| format!("{row}\n")).collect();
    fs::write(folder.path().join("x.csv"), format!("x_n\n{rows}")).unwrap();
    let graph = r#"Graph(format: 1, clocks: { "c": Driver(rate_hz: 1000) }, nodes: {
        "felt": CsvSource(clock: "c", file: "x.csv", column: "x_n", quantity: "force", at_end: Stop),
        "file": CsvSink(inputs: ["felt"], file: "y.csv"),
    })"#;
    fs::write(folder.path().join("g.ron"), graph).unwrap();
    for more in [&[][..], &["--for", "0.4"]] {
        let run = ["run", "g.ron", "--live", "--out", "out"];
        let told = succeed(folder.path(), &[&run[..], more].concat());
        let told = String::from_utf8_lossy(&told.stderr).into_owned();
        let facts = facts(&folder.path().join("out"));
        assert_eq!(
            (&facts["driver_frames"], &facts["stopped"]),
            (&300.into(), &false.into())
        );
        let warnings = facts["warnings"].to_string();
        assert!(
            warnings.contains("`felt`") && told.contains("`felt`"),
            "{warnings}"
        );
        let kept = fs::read_to_string(folder.path().join("out/y.csv")).unwrap();
        let last = kept.lines().last().unwrap().rsplit(',').next().unwrap();
        assert_eq!((kept.lines().count(), last.parse::<f64>().unwrap()), (301, 299.0));
    }
}

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
    let places: Vec<&str> = said
        .lines()
        .filter_map(|line| line.strip_prefix("listening for `")?.split(" at ").nth(1))
        .collect();
    assert!(places.len() == 2 && places[0] != places[1], "{places:?}");
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let speak = || {
        for step in 0..60_u8 {
            for place in &places {
                socket
                    .send_to(&osc("/force", 1.0 + 0.01 * f32::from(step)), place)
                    .unwrap();
            }
            std::thread::sleep(Duration::from_millis(8));
        }
    };
    speak();
    run.wait_for("`stylus` has been silent for");
    speak();
    run.stop();
    let replay = [
        "run",
        "g.ron",
        "--endpoints",
        "live",
        "--replay",
        "live",
        "--block",
        "17",
        "--out",
        "replay",
    ];
    let told = succeed(folder.path(), &replay);
    let told = String::from_utf8_lossy(&told.stderr).into_owned();
    assert!(!told.contains("not repeated"), "{told}");
    let of = |run: &str, file: &str| fs::read(folder.path().join(run).join(file)).unwrap();
    for file in ["kept.csv", "sensed.csv"] {
        assert!(of("live", file).len() > 4000, "{file}");
        assert!(of("live", file) == of("replay", file), "{file}");
    }
    let kept = String::from_utf8(of("live", "kept.csv")).unwrap();
    let given: Vec<f64> = kept
        .lines()
        .skip(1)
        .filter_map(|line| line.rsplit(',').next()?.parse().ok())
        .collect();
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
        &[
            "run",
            "g.ron",
            "--endpoints",
            "live",
            "--replay",
            "live",
            "--out",
            "forged",
        ],
    );
    let output = { forged }.output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && told.contains("1.csv line 5"),
        "{told}"
    );
    assert!(!folder.path().join("forged").exists());
}

#[cfg(all(target_os = "linux", not(feature = "soundcard")))]
#[test]
fn without_soundcards_a_live_run_says_what_to_install() {
    let folder = tempfile::tempdir().unwrap();
    let graph = shipped("texturepad.ron");
    succeed(folder.path(), &["check", &graph, "--endpoints", "live"]);
    let arguments = ["run", &graph, "--live", "--for", "0.1", "--out", "o"];
    let output = command(folder.path(), &arguments).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && told.contains("libasound2-dev"),
        "{told}"
    );
    assert!(told.contains("--features soundcard"), "{told}");
    assert!(!folder.path().join("o").exists());
}

/// An accelerometer that a timer reads.
const FELT: &str = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 8000) },
    nodes: {
        "felt": Accelerometer(clock: "servo", endpoint: "tool"),
        "file": WavSink(input: "felt", file: "felt.wav", full_scale: 50),
    },
    endpoints: {
        "simulated": { "tool": SimulatedHaptuator() },
        "live": { "tool": SoundcardAccelerometer(m_s2_full_scale: 50.0, rate_hz: 48000, latency_ms: 5) },
    })"#;

#[test]
fn offline_nothing_is_heard_of_a_soundcard_and_check_counts_its_latency() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("felt.ron"), FELT).unwrap();
    let told = succeed(folder.path(), &["check", "felt.ron", "--endpoints", "live"]);
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    // A buffer of 64 frames at 48 kHz, and the 5 ms that the clocks are kept apart.
    assert!(told.contains("latency felt -> file: 6.33 ms transport"), "{told}");
    let offline = [
        "run",
        "felt.ron",
        "--endpoints",
        "live",
        "--for",
        "0.1",
        "--out",
        "o",
    ];
    let told = succeed(folder.path(), &offline);
    let told = String::from_utf8_lossy(&told.stderr).into_owned();
    assert!(
        told.contains("warning: `tool` is SoundcardAccelerometer"),
        "{told}"
    );
    let felt = samples(&folder.path().join("o/felt.wav"));
    assert!(felt.len() == 800 && felt.iter().all(|x| *x == 0.0));
}

#[test]
fn a_device_that_never_spoke_is_told_of_live_and_offline() {
    let folder = tempfile::tempdir().unwrap();
    let live = r#""live": { "tool": UdpDevice(listen: "127.0.0.1:0") }"#;
    let graph = FELT
        .replace("Accelerometer(clock", "Tablet(clock")
        .replace("felt\", file", "felt.force\", file")
        .replace("SimulatedHaptuator", "SimulatedTablet");
    let (before, _) = graph.split_once("\"live\"").unwrap();
    fs::write(folder.path().join("udp.ron"), format!("{before}{live} }})")).unwrap();
    for (way, words) in [
        (
            &["--endpoints", "live"][..],
            "`tool` is UdpDevice, which is reached by",
        ),
        (&["--live"][..], "sent nothing in this run"),
    ] {
        let run = ["run", "udp.ron", "--for", "0.1", "--out", "o"];
        let told = succeed(folder.path(), &[&run[..], way].concat());
        let told = String::from_utf8_lossy(&told.stderr).into_owned();
        let warned = |line: &str| line.starts_with("warning: `tool`") && line.contains(words);
        assert!(told.lines().any(warned), "{told}");
        let warnings = facts(&folder.path().join("o"))["warnings"].to_string();
        assert!(warnings.contains(words), "{warnings}");
    }
}

#[cfg(all(target_os = "linux", not(feature = "soundcard")))]
#[test]
fn without_soundcards_nothing_is_listened_to_and_the_run_says_what_to_install() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("felt.ron"), FELT).unwrap();
    let output = command(folder.path(), &["run", "felt.ron", "--live", "--for", "0.1"])
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && told.contains("libasound2-dev"),
        "{told}"
    );
}

#[test]
fn the_texturepad_by_soundcard_takes_less_than_ten_milliseconds() {
    let folder = tempfile::tempdir().unwrap();
    let graph = shipped("texturepad.ron");
    let told = succeed(folder.path(), &["check", &graph, "--endpoints", "live"]);
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    let line = told
        .lines()
        .find(|line| line.starts_with("latency stylus -> out:"))
        .unwrap();
    let transport = line.split_whitespace().nth(4).unwrap();
    let transport_ms: f64 = transport.parse().unwrap();
    // Two buffers of 64 frames at 48 kHz are 2.67 ms of it.
    assert!((2.67..10.0).contains(&transport_ms), "{line}");
}

#[cfg(all(target_os = "linux", feature = "soundcard"))]
#[path = "live/alsa.rs"]
mod alsa;
#[cfg(all(target_os = "linux", feature = "soundcard"))]
#[path = "live/pulse.rs"]
mod pulse;

/// Takes a minute of real time.
#[test]
#[ignore = "takes a minute"]
fn in_a_minute_no_time_is_lost_that_is_not_reported() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tone.ron"), TONE).unwrap();
    succeed(
        folder.path(),
        &["run", "tone.ron", "--live", "--for", "60", "--out", "out"],
    );
    let facts = facts(&folder.path().join("out"));
    assert_eq!(samples(&folder.path().join("out/loud.wav")).len(), 60_000);
    assert_eq!(facts["lost_numbers"], 0);
    let lost_s = facts["lost_wakes"].as_f64().unwrap() / 1000.0;
    let over_s = facts["took_s"].as_f64().unwrap() - 60.0;
    // Starting, stopping and completing the files take a while too.
    assert!(
        over_s - lost_s < 1.0,
        "{over_s} s too long, {lost_s} s of them reported"
    );
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
    assert!(
        ring["underruns"].is_number() && ring["latency_ms"] == 12.0,
        "{kept}"
    );
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
    assert!(
        !output.status.success() && told.contains("another value of the seed"),
        "{told}"
    );
}

/// One driver and two; a parameter, and settings of nodes.
#[test]
fn what_was_typed_while_it_ran_is_repeated_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tone.ron"), TONE).unwrap();
    let two = shipped("two-drivers.ron");
    for (graph, lines, files) in [
        (
            "tone.ron",
            ["set loudness=0.5", "set loud.gain=0.75"],
            &["loud.wav"][..],
        ),
        (
            &two,
            ["set moves.gain=0.3", "set pressing.gain=0.5"],
            &["texture.wav", "hand.csv", "crossed.csv"],
        ),
    ] {
        let common = ["run", graph, "--endpoints", "simulated"];
        let mut run = Running::start(
            folder.path(),
            &[&common[..], &["--live", "--out", "live"]].concat(),
        );
        for line in lines {
            std::thread::sleep(Duration::from_millis(100));
            run.type_line(line);
        }
        run.wait_for(if graph == "tone.ron" {
            "loud.gain is 0.75"
        } else {
            "pressing.gain is 0.5"
        });
        std::thread::sleep(Duration::from_millis(100));
        run.stop();
        let replay = [
            &common[..],
            &["--replay", "live", "--block", "17", "--out", "replay"],
        ];
        let told = succeed(folder.path(), &replay.concat());
        assert!(!String::from_utf8_lossy(&told.stderr).contains("not repeated"));
        for file in files {
            let of = |run: &str| fs::read(folder.path().join(run).join(file)).unwrap();
            assert!(of("live").len() > 400, "{file}");
            assert!(of("live") == of("replay"), "{file}");
        }
    }
    let kept = fs::read_to_string(folder.path().join("live/arrivals/1.settings.csv")).unwrap();
    assert!(
        kept.lines().last().unwrap().ends_with(",1,0.3,20,moves.gain"),
        "{kept}"
    );
}

#[test]
fn a_saved_graph_of_two_drivers_takes_over_with_other_rings_and_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.ron");
    let text = fs::read_to_string(shipped("two-drivers.ron"))
        .unwrap()
        .replace("\"parts/", &format!("\"{}/", shipped("parts")))
        .replace("\"surfaces/", &format!("\"{}/", shipped("surfaces")));
    let more = r#""further": Gain(clock: "hand", input: Ring(from: "moves", latency_ms: 14), gain: 2),
        "more": CsvSink(inputs: ["further"], file: "more.csv"),
        "crossed":"#;
    let further = text.replace("\"crossed\":", more);
    fs::write(&path, &text).unwrap();
    let common = ["run", "two.ron", "--endpoints", "simulated"];
    let live = [&common[..], &["--live", "--watch", "--out", "out"]].concat();
    let mut run = Running::start(folder.path(), &live);
    let renamed = further
        .replace("\"servo\"", "\"timer\"")
        .replace("more.csv", "never.csv");
    fs::write(&path, renamed).unwrap();
    run.wait_for("audio at 48000 Hz and timer at 1000 Hz now");
    assert!(run.said().contains("that needs a new run"), "{}", run.said());
    fs::write(&path, further).unwrap();
    run.wait_for("more.csv begins");
    std::thread::sleep(Duration::from_millis(300));
    fs::write(&path, &text).unwrap();
    run.wait_for("more.csv is complete");
    std::thread::sleep(Duration::from_millis(300));
    let told = run.stop();
    assert!(
        told.contains("the graph changed, through zero as there are several drivers"),
        "{told}"
    );
    let out = folder.path().join("out");
    assert!(!out.join("never.csv").exists());
    let facts = facts(&out);
    let audio_frames = facts["driver_frames"].as_u64().unwrap();
    let rows = |file: &str| fs::read_to_string(out.join(file)).unwrap().lines().count() as u64 - 1;
    assert_eq!(rows("crossed.csv"), audio_frames.div_ceil(48));
    assert_eq!(
        samples(&out.join("texture.wav")).len() as u64,
        (audio_frames * 10).div_ceil(48)
    );
    assert!((100..rows("crossed.csv")).contains(&rows("more.csv")), "{told}");
    assert_eq!(facts["rings"].as_object().unwrap().len(), 2);
    // It is repeated up to the first change.
    let replay = succeed(
        folder.path(),
        &[&common[..], &["--replay", "out", "--out", "replay"]].concat(),
    );
    let told = String::from_utf8_lossy(&replay.stderr);
    assert!(told.contains("took over while it ran, times: 2"), "{told}");
    for file in ["crossed.csv", "hand.csv"] {
        let of = |run: &str| fs::read(folder.path().join(run).join(file)).unwrap();
        assert!(
            of("replay").len() > 400 && of("out").starts_with(&of("replay")),
            "{file}"
        );
    }
}

#[test]
fn a_file_by_another_name_takes_over_from_the_one_before() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tone.ron");
    fs::write(&path, TONE).unwrap();
    let mut run = Running::start(
        folder.path(),
        &["run", "tone.ron", "--live", "--watch", "--out", "out"],
    );
    fs::write(&path, TONE.replace("loud.wav", "later.wav")).unwrap();
    run.wait_for("later.wav begins; loud.wav is complete");
    std::thread::sleep(Duration::from_millis(300));
    run.stop();
    let out = folder.path().join("out");
    let (before, after) = (samples(&out.join("loud.wav")), samples(&out.join("later.wav")));
    assert!(!before.is_empty() && after.len() > 100);
    // Not a frame is lost between them.
    assert_eq!(facts(&out)["driver_frames"], before.len() + after.len());
}

#[test]
fn a_device_stays_with_its_driver() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("g.ron");
    let graph = |driver: &str, other: &str| {
        format!(
            r#"Graph(format: 1, clocks: {{ "a": Driver(rate_hz: 1000), "b": Driver(rate_hz: 1000) }},
            nodes: {{
                "c": Constant(clock: "{driver}", value: 0.1, quantity: "current"),
                "out": ActuatorSink(current: "c", endpoint: "h", limit: (peak_a: 1, continuous_a: 1)),
                "d": Constant(clock: "{other}", value: 1, quantity: "number"),
            }},
            endpoints: {{ "simulated": {{ "h": SimulatedHaptuator() }} }})"#
        )
    };
    fs::write(&path, graph("a", "b")).unwrap();
    let mut run = Running::start(
        folder.path(),
        &["run", "g.ron", "--live", "--watch", "--out", "out"],
    );
    fs::write(&path, graph("b", "a")).unwrap();
    run.wait_for("`h` is driven by b now, and was not; that needs a new run");
    run.stop();
}
