//! The program as its users run it.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn haptograph(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_haptograph"));
    command.args(arguments).current_dir(folder).output().expect("the program starts")
}

fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let output = haptograph(folder, arguments);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {told}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn fail(folder: &Path, arguments: &[&str], code: i32) -> String {
    let output = haptograph(folder, arguments);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn texturepad_graph() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/texturepad.ron").display().to_string()
}

/// Runs the TexturePad for a while with more arguments; returns its folder.
fn texturepad(folder: &Path, name: &str, arguments: &[&str]) -> PathBuf {
    let out = folder.join(name);
    let (graph, shown) = (texturepad_graph(), out.display().to_string());
    let mut all = vec!["run", &graph, "--for", "0.7", "--out", &shown];
    all.extend(arguments);
    succeed(folder, &all);
    out
}

#[test]
fn a_sink_does_not_write_what_every_run_writes() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["report.html.csv", "changes/x.csv"] {
        let text = format!(
            r#"Graph(format: 1, clocks: {{ "c": Driver(rate_hz: 1000) }}, nodes: {{
                "x": Constant(clock: "c", value: 1), "file": CsvSink(inputs: ["x"], file: "{name}") }})"#
        );
        fs::write(folder.path().join("g.ron"), text).unwrap();
        let output = haptograph(folder.path(), &["run", "g.ron", "--for", "0.1", "--out", "out"]);
        let told = String::from_utf8_lossy(&output.stderr);
        let own = name == "changes/x.csv";
        assert_eq!(output.status.code(), Some(i32::from(own)), "{told}");
        assert!(!own || told.contains("the sink `file` writes changes/x.csv"), "{told}");
    }
}

#[test]
fn the_texturepad_leaves_sound_facts_and_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let out = texturepad(folder.path(), "run", &[]);
    let wav = fs::read(out.join("texture.wav")).unwrap();
    assert_eq!(&wav[..4], b"RIFF");
    // 0.7 s at 10 kHz in 4-byte floats, and a header.
    assert!((28_000..28_200).contains(&wav.len()), "{} bytes", wav.len());
    assert!(wav[100..].iter().any(|byte| *byte != 0), "silence");
    let facts: serde_json::Value = serde_json::from_slice(&fs::read(out.join("run.json")).unwrap()).unwrap();
    assert_eq!((&facts["seconds"], &facts["simulated_devices"]), (&0.7.into(), &true.into()));
}

#[test]
fn blocks_change_no_sample_and_a_seed_does() {
    let folder = tempfile::tempdir().unwrap();
    let samples = |name: &str, arguments: &[&str]| {
        let out = texturepad(folder.path(), name, arguments);
        (fs::read(out.join("texture.wav")).unwrap(), fs::read(out.join("current.wav")).unwrap())
    };
    let plain = samples("plain", &[]);
    for (name, arguments) in [
        ("again", &[][..]),
        ("one", &["--block", "1"]),
        ("long", &["--block", "1024"]),
        ("odd", &["--block", "77"]),
    ] {
        assert!(samples(name, arguments) == plain, "{name}");
    }
    assert!(samples("seed", &["--seed", "8"]) != plain);
}

#[test]
fn a_probe_writes_any_port_and_names_the_unit() {
    let folder = tempfile::tempdir().unwrap();
    let probes = [
        "--probe",
        "speed.speed=speed.csv",
        "--probe",
        "texture/filter.acceleration=a.wav",
        "--probe",
        "texture=template.csv",
    ];
    texturepad(folder.path(), "run", &probes);
    let table = fs::read_to_string(folder.path().join("speed.csv")).unwrap();
    assert!(table.lines().next().unwrap().contains("m_s"), "{table}");
    // 125 Hz for 0.7 s.
    assert_eq!(table.lines().count(), 1 + 88);
    assert!(folder.path().join("a.wav").exists() && folder.path().join("template.csv").exists());
    for note in ["speed.csv.ron", "a.wav.ron", "run/hand.csv.ron"] {
        let note = fs::read_to_string(folder.path().join(note)).unwrap();
        assert!(note.contains("    simulated: true,\n"), "{note}");
    }
}

#[test]
fn a_wrong_probe_says_what_was_meant_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let probe = ["run", &texturepad_graph(), "--out", "o", "--probe", "sped.speed=x.csv"];
    let told = fail(folder.path(), &probe, 1);
    assert!(told.contains("did you mean `speed.speed`"), "{told}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn probes_of_one_file_or_in_the_runs_folder_are_refused_before_it_runs() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("sub")).unwrap();
    let graph = texturepad_graph();
    let run = ["run", &graph, "--for", "0.1", "--out", "o"];
    for probes in [
        &["speed.speed=q.csv", "drive.current=./q.csv"][..],
        &["speed.speed=q.csv", "drive.current=sub/../q.csv"],
        &["speed.speed=o/q.csv"],
        &["speed.speed=sub/../o/deep/q.csv"],
    ] {
        let given = probes.iter().flat_map(|probe| ["--probe", probe]);
        let arguments: Vec<&str> = run.iter().copied().chain(given).collect();
        fail(folder.path(), &arguments, 1);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "{probes:?}");
    }
}

#[test]
fn a_starter_runs_as_it_stands_and_is_never_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &["new", "mine.ron"]);
    succeed(folder.path(), &["check", "mine.ron"]);
    let said = succeed(folder.path(), &["run", "mine.ron", "--for", "0.1"]);
    assert!(folder.path().join("out/mine/tone.wav").exists());
    assert!(said.contains("listen to `out.output`"), "{said}");
    let told = fail(folder.path(), &["new", "mine.ron"], 1);
    assert!(told.contains("exists already"), "{told}");
}

#[test]
fn all_errors_of_a_graph_are_shown_with_their_places() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &["new", "wrong.ron"]);
    let text = fs::read_to_string(folder.path().join("wrong.ron")).unwrap();
    let text =
        text.replace("Hold(\"swell\")", "Hold(\"swel\")").replace("frequency_hz: 150", "frequenzy_hz: 150");
    fs::write(folder.path().join("wrong.ron"), text).unwrap();
    let told = fail(folder.path(), &["check", "wrong.ron"], 1);
    assert!(told.contains("did you mean `swell`") && told.contains("`frequency_hz`"), "{told}");
    assert!(told.contains("wrong.ron:"), "{told}");
    let output = haptograph(folder.path(), &["check", "wrong.ron", "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["findings"].as_array().unwrap().len() == 2, "{json}");
}

#[test]
fn a_graph_of_nothing_is_told_so_by_every_command() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("none.ron"), "Graph(format: 1, nodes: {})").unwrap();
    for command in [&["check"][..], &["run"], &["run", "--live"], &["bench"], &["draw"]] {
        let told = fail(folder.path(), &[command, &["none.ron"]].concat(), 1);
        assert!(told.contains("E0506"), "{command:?}: {told}");
    }
}

#[test]
fn a_folder_that_no_run_left_is_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &["new", "mine.ron"]);
    fs::create_dir(folder.path().join("precious")).unwrap();
    fs::write(folder.path().join("precious/data"), "years of work").unwrap();
    fail(folder.path(), &["run", "mine.ron", "--for", "0.1", "--out", "precious"], 1);
    assert_eq!(fs::read_to_string(folder.path().join("precious/data")).unwrap(), "years of work");
}

#[test]
fn every_node_kind_is_told_about() {
    let folder = tempfile::tempdir().unwrap();
    let page = succeed(folder.path(), &["nodes", "--markdown"]);
    for entry in haptograph::nodes::registry().nodes() {
        assert!(page.contains(&format!("## {}\n", entry.spec.name)));
        assert!(!entry.spec.doc.is_empty() && !entry.spec.example.is_empty(), "{}", entry.spec.name);
    }
    assert!(succeed(folder.path(), &["nodes", "Gain"]).contains("Inputs:"));
    let told = fail(folder.path(), &["nodes", "Gian"], 1);
    assert!(told.contains("did you mean `Gain`"), "{told}");
}

#[test]
fn what_cannot_be_meant_is_refused_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let graph = texturepad_graph();
    let rates = r#"Graph(format: 1, clocks: { "a": Driver(rate_hz: 1000), "b": Derived(of: "a", rate_hz: 500) }, nodes: {
        "x": Sine(clock: "a", frequency_hz: 5), "y": Sine(clock: "b", frequency_hz: 5),
        "file": CsvSink(inputs: ["x", "y"], file: "x.csv") })"#;
    fs::write(folder.path().join("rates.ron"), rates).unwrap();
    for (arguments, told) in [
        (&["run", &graph, "--for", "1e-9"][..], "shorter than one frame of `audio`"),
        (&["run", &graph, "--set", "surface="], "the path is empty"),
        (&["run", &graph, "--set", "gain=1", "--set", "gain=2"], "--set gives `gain` twice"),
        (&["sweep", &graph, "--over", "gain=1,2,1"], "gives `1` twice"),
        (&["sweep", &graph, "--over", "gain=1,2", "--over", "gain=3"], "--over gives `gain` twice"),
        (&["draw", &graph, "-o", "no/such.svg"], "cannot write no/such.svg"),
        (&["check", "rates.ron"], "all columns of a CSV file need one rate"),
        (&["bench", &graph, "--svg", "no/such.svg"], "cannot write no/such.svg"),
    ] {
        let said = fail(folder.path(), arguments, 1);
        assert!(said.contains(told), "{arguments:?}: {said}");
    }
    let said = fail(folder.path(), &["check", "rates.ron"], 1);
    assert!(!said.contains("by the default"), "inputs were given: {said}");
    fs::remove_file(folder.path().join("rates.ron")).unwrap();
    let many: Vec<String> = (0..15).map(|value| value.to_string()).collect();
    let over = |name: &str| format!("{name}={}", many.join(","));
    let said = fail(folder.path(), &["sweep", &graph, "--over", &over("gain"), "--over", &over("seed")], 1);
    assert!(said.contains("more than 200 combinations"), "{said}");
    assert_eq!(folder.path().read_dir().unwrap().count(), 0);
}

#[test]
fn a_drawing_is_written_as_its_name_ends() {
    let folder = tempfile::tempdir().unwrap();
    let graph = texturepad_graph();
    for (file, begins) in [("x.svg", "<svg"), ("x.dot", "digraph {"), ("x.mmd", "---\n")] {
        succeed(folder.path(), &["draw", &graph, "-o", file]);
        let text = fs::read_to_string(folder.path().join(file)).unwrap();
        assert!(text.starts_with(begins), "{file}: {text}");
    }
}

#[test]
fn a_wrong_command_line_ends_with_2() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in
        [&["run"][..], &["dance"], &["run", "x.ron", "--block", "0"], &["run", "x.ron", "--for", "nan"]]
    {
        fail(folder.path(), arguments, 2);
    }
    for (address, help) in [
        ("localhost", "`--osc localhost:9000`"),
        (":9000", "`--osc 127.0.0.1:9000`"),
        ("localhost:osc", "`--osc localhost:9000`"),
    ] {
        let told = fail(folder.path(), &["run", "x.ron", "--live", "--osc", address], 2);
        assert!(told.contains(help), "{told}");
    }
    let told = fail(folder.path(), &["draw", "x.ron", "-o", "x.png"], 2);
    assert!(told.contains("rsvg-convert x.svg -o x.png"), "{told}");
    assert!(told.contains(".dot") && told.contains(".mmd"), "{told}");
    let told = fail(folder.path(), &["sweep", "x.ron"], 2);
    assert!(told.contains("--over") && told.contains("--case"), "{told}");
    let told = fail(folder.path(), &["run", "missing.ron"], 1);
    assert!(told.contains("missing.ron"), "{told}");
}

#[test]
fn the_graph_of_the_readme_is_sound_and_runs() {
    let readme = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap();
    let graph = readme.split("```ron\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scratch.ron"), graph).unwrap();
    succeed(folder.path(), &["run", "scratch.ron", "--for", "0.2"]);
    assert!(folder.path().join("out/scratch/scratch.wav").exists());
}

#[test]
fn a_simulated_recording_is_the_one_the_recorder_graph_makes() {
    let folder = tempfile::tempdir().unwrap();
    let simulate = ["simulate-recording", "--material", "T5", "--motion"];
    let rest = ["--person", "2", "--seconds", "0.5", "--seed", "3", "-o"];
    for (motion, file) in [("circle", "circle.npz"), ("tap", "tap.csv"), ("circle", "again.npz")] {
        let told = succeed(folder.path(), &[&simulate[..], &[motion], &rest[..], &[file]].concat());
        assert!(told.contains("simulated"), "{told}");
    }
    let bytes = fs::read(folder.path().join("circle.npz")).unwrap();
    assert!(bytes == fs::read(folder.path().join("again.npz")).unwrap());
    let graph = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/recorder.ron").display().to_string();
    let set = ["--set", "material=T5", "--set", "motion=Circle", "--set", "person=2"];
    let run = ["run", &graph, "--for", "0.5", "--seed", "3", "--out", "run"];
    succeed(folder.path(), &[&run[..], &set[..]].concat());
    assert!(bytes == fs::read(folder.path().join("run/recording.npz")).unwrap());
    let table = fs::read_to_string(folder.path().join("tap.csv")).unwrap();
    assert!(table.contains("simulated") && table.contains("_m_s2"), "{}", &table[..300]);
    // Nothing is left beside them but the list of what was written.
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 5);
    let told =
        fail(folder.path(), &["simulate-recording", "--material", "T7", "--motion", "drag", "-o", "x"], 2);
    assert!(told.contains("T1"), "{told}");
}

#[test]
fn a_bench_tells_what_every_step_costs() {
    let folder = tempfile::tempdir().unwrap();
    let graph = texturepad_graph();
    let told = succeed(folder.path(), &["bench", &graph, "--for", "0.1", "--json", "--svg", "cost.svg"]);
    let figures: serde_json::Value = serde_json::from_str(&told).unwrap();
    let steps = figures["steps"].as_array().unwrap();
    let shares: f64 = steps.iter().map(|step| step["share"].as_f64().unwrap()).sum();
    assert!((shares - 1.0).abs() < 1e-9, "{shares}");
    assert!(steps.iter().any(|step| step["step"] == "texture/filter"));
    let path = figures["drivers"][0]["critical_path"]["nodes"].as_array().unwrap();
    let at = |name: &str| path.iter().position(|node| node == name);
    assert!(at("texture/filter") < at("out"), "{path:?}");
    assert_eq!(figures["simulated"], true);
    assert!(fs::read_to_string(folder.path().join("cost.svg")).unwrap().contains("texture/filter"));
    let shown = succeed(folder.path(), &["bench", &graph, "--for", "0.1"]);
    assert!(shown.contains("% of one core") && shown.contains("critical path"), "{shown}");
}

#[test]
fn a_bench_tells_what_each_of_several_drivers_costs() {
    let folder = tempfile::tempdir().unwrap();
    let graph = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/two-drivers.ron");
    let graph = graph.display().to_string();
    let common = ["bench", &graph, "--for", "0.3"];
    let told = succeed(folder.path(), &[&common[..], &["--json", "--svg", "cost.svg"]].concat());
    let figures: serde_json::Value = serde_json::from_str(&told).unwrap();
    let drivers = figures["drivers"].as_array().unwrap();
    let names: Vec<&str> = drivers.iter().map(|one| one["driver"].as_str().unwrap()).collect();
    assert_eq!(names, ["audio", "servo"]);
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    for driver in drivers {
        let (load, rate_hz) = (number(&driver["load_percent"]), number(&driver["rate_hz"]));
        let full = number(&driver["highest_rate_hz"]) * load / 100.0;
        assert!(load > 0.0 && (full / rate_hz - 1.0).abs() < 1e-9, "{driver}");
        assert!(number(&driver["critical_path"]["share"]) <= 1.0, "{driver}");
    }
    let of_both = number(&drivers[0]["load_percent"]) + number(&drivers[1]["load_percent"]);
    let whole = number(&figures["load_percent"]);
    assert!((0.5..2.0).contains(&(of_both / whole)), "{of_both} of {whole}");
    let path = |driver: usize| drivers[driver]["critical_path"]["nodes"].as_array().unwrap();
    assert!(path(0).iter().any(|node| node == "out"), "{figures}");
    assert!(path(1).iter().any(|node| node == "stylus"), "{figures}");
    let steps = figures["steps"].as_array().unwrap();
    for (step, driver) in
        [("ring moves.output to moving.input", "audio"), ("send moves.output to moving.input", "servo")]
    {
        let found = steps.iter().find(|known| known["step"] == step).unwrap();
        assert_eq!(found["driver"], driver);
    }
    let picture = fs::read_to_string(folder.path().join("cost.svg")).unwrap();
    assert!(picture.contains("audio, ") && picture.contains("servo, "));
    let shown = succeed(folder.path(), &common);
    for words in ["driver audio", "driver servo", "measuring      overhead"] {
        assert!(shown.contains(words), "no `{words}` in {shown}");
    }
    assert_eq!(shown.matches("critical path").count(), 2, "{shown}");
}

#[test]
fn a_replay_into_the_folder_it_repeats_is_refused_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let graph = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/two-drivers.ron");
    let graph = graph.display().to_string();
    let common = ["run", &graph, "--endpoints", "simulated"];
    let live = [&common[..], &["--live", "--for", "0.1", "--out", "live"]].concat();
    succeed(folder.path(), &live);
    let arrivals = || fs::read(folder.path().join("live/arrivals/0.csv")).unwrap();
    let before = arrivals();
    for out in ["live", "./live/arrivals/.."] {
        let told = fail(folder.path(), &[&common[..], &["--replay", "live", "--out", out]].concat(), 1);
        assert!(told.contains("would be replaced"), "{told}");
        assert!(arrivals() == before);
    }
}

#[test]
fn a_replay_knows_a_moved_graph_again_and_refuses_a_changed_one() {
    const FILES: [&str; 2] = ["two-drivers.ron", "surfaces/t2-canvas.ron"];
    let folder = tempfile::tempdir().unwrap();
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs");
    for (place, file) in ["then", "now"].iter().flat_map(|place| FILES.map(|file| (place, file))) {
        let to = folder.path().join(place).join(file);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::write(to, fs::read(shipped.join(file)).unwrap()).unwrap();
    }
    let run = |graph, more: &[&'static str]| [&["run", graph, "--endpoints", "simulated"], more].concat();
    let live = ["--live", "--for", "0.1", "--out", "live"];
    succeed(folder.path(), &run("then/two-drivers.ron", &live));
    let replay = run("now/two-drivers.ron", &["--replay", "live", "--out", "again"]);
    succeed(folder.path(), &replay);
    for (file, old, new, named) in [
        (
            FILES[0],
            "\"latency_ms\": 12.0",
            "\"latency_ms\": 13.0",
            "`connection moves.output to moving.input`",
        ),
        (FILES[0], "gain: 1)", "gain: 1.5)", "`node moves`"),
        (FILES[1], "mu: 0.3", "mu: 0.4", "`node "),
    ] {
        let path = folder.path().join("now").join(file);
        let right = fs::read_to_string(&path).unwrap();
        let wrong = right.replacen(old, new, 1);
        assert_ne!(right, wrong);
        fs::write(&path, wrong).unwrap();
        let told = fail(folder.path(), &replay, 1);
        assert!(told.contains(named) && told.contains("differs"), "{told}");
        fs::write(&path, right).unwrap();
    }
    succeed(folder.path(), &replay);
    fs::write(folder.path().join("live/run.json"), "").unwrap();
    let told = fail(folder.path(), &replay, 1);
    assert!(told.contains("run.json is empty"), "{told}");
    // What was refused leaves nothing.
    let left = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
    let mut left: Vec<_> = left.collect();
    left.sort();
    assert_eq!(left, ["again", "live", "now", "then"]);
}

#[test]
fn a_file_that_no_setting_reads_is_no_part_of_a_graph() {
    let folder = tempfile::tempdir().unwrap();
    let graph = r#"Graph(format: 1, clocks: { "c": Driver(rate_hz: 1000) }, nodes: {
        "pressed": Constant(clock: "c", value: 1, quantity: "force"),
        "felt": CsvSink(inputs: ["pressed"], file: "felt.csv") })"#;
    fs::write(folder.path().join("g.ron"), graph).unwrap();
    succeed(folder.path(), &["run", "g.ron", "--live", "--for", "0.1", "--out", "live"]);
    fs::write(folder.path().join("force"), "notes").unwrap();
    succeed(folder.path(), &["run", "g.ron", "--replay", "live", "--out", "again"]);
}

#[test]
fn check_refuses_what_a_live_run_refuses_before_it_reaches_a_device() {
    let folder = tempfile::tempdir().unwrap();
    let graph = |one: &str, other: &str| {
        let text = format!(
            r#"Graph(format: 1, clocks: {{ "c": Driver(rate_hz: 48000) }}, nodes: {{
                "one": Constant(clock: "c", value: 1, quantity: "current"),
                "a": ActuatorSink(current: "one", endpoint: "a", limit: (peak_a: 1, continuous_a: 1)),
                "b": ActuatorSink(current: "one", endpoint: "b", limit: (peak_a: 1, continuous_a: 1)) }},
                endpoints: {{ "live": {{ "a": {one}, "b": {other} }} }})"#
        );
        fs::write(folder.path().join("g.ron"), text).unwrap();
    };
    let check = ["check", "g.ron", "--endpoints", "live"];
    let card = |channel: u8| format!("Soundcard(amperes_full_scale: 1, channels: [{channel}])");
    graph(&card(1), &card(2));
    succeed(folder.path(), &check);
    graph(&card(1), &card(1));
    for arguments in [&check[..], &[&check[..], &["--json"]].concat()] {
        let output = haptograph(folder.path(), arguments);
        let told = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        assert!(output.status.code() == Some(1) && told.contains("both drive channel 1"), "{told}");
    }
    let device = r#"UdpDevice(listen: "127.0.0.1:9750")"#;
    graph(device, device);
    let told = fail(folder.path(), &check, 1);
    assert!(told.contains("both listen at 127.0.0.1:9750"), "{told}");
}

#[test]
fn a_run_ends_by_saying_what_to_look_at_and_what_to_listen_to() {
    let folder = tempfile::tempdir().unwrap();
    let graph = texturepad_graph();
    let said = succeed(folder.path(), &["run", &graph, "--for", "0.7", "--out", "out"]);
    let last = said.lines().last().unwrap();
    for part in ["out/report.html", "`out.delivered`", "--play"] {
        assert!(last.contains(part), "{last}");
    }
    let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    let (_, sound) = page.split_once("src=\"data:audio/wav;base64,").unwrap();
    let (sound, _) = sound.split_once('"').unwrap();
    // 0.7 s of 48 000 samples of two bytes, four letters for three bytes.
    assert!((89_600..89_800).contains(&sound.len()), "{}", sound.len());
    assert!(page.contains("href=\"./texture.wav\"") && page.contains("of out.delivered"), "no link or label");
}

#[test]
fn where_a_limit_struck_the_largest_request_stands_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let graph = |amplitude: &str| {
        format!(
            r#"Graph(format: 1, clocks: {{ "audio": Driver(rate_hz: 10000) }}, nodes: {{
                "tone": Sine(clock: "audio", frequency_hz: 100, amplitude: {amplitude}, quantity: "current"),
                "out": ActuatorSink(current: "tone", endpoint: "coil", limit: (peak_a: 0.5, continuous_a: 0.4)),
            }}, endpoints: {{ "simulated": {{ "coil": SimulatedHaptuator() }} }})"#
        )
    };
    let run = |amplitude: &str| {
        fs::write(folder.path().join("g.ron"), graph(amplitude)).unwrap();
        let output = haptograph(folder.path(), &["run", "g.ron", "--for", "0.2", "--out", "out"]);
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{told}");
        let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
        let facts = fs::read_to_string(folder.path().join("out/run.json")).unwrap();
        let facts: serde_json::Value = serde_json::from_str(&facts).unwrap();
        (told, page, facts["limits"].clone())
    };
    let (told, page, limits) = run("0.8");
    assert!(
        told.contains("the peak limit reduced ")
            && told.contains(": the largest request was 0.8 A, the limit is 0.5 A; lower the signal"),
        "{told}"
    );
    assert!(
        page.contains("<span>Largest request</span><b>0.8 A</b>")
            && page.contains("0.5 A peak, 0.4 A continuous"),
        "no headline"
    );
    assert!((limits[0]["largest_request"].as_f64().unwrap() - 0.8).abs() < 1e-12);
    assert_eq!(
        (&limits[0]["actuator"], &limits[0]["unit"], &limits[0]["peak"]),
        (&"out".into(), &"A".into(), &0.5.into())
    );
    let (told, page, limits) = run("0.3");
    assert!(!told.contains("limit") && !page.contains("Largest request"), "{told}");
    assert_eq!(limits, serde_json::json!([]));
}

#[test]
fn a_run_that_cannot_be_played_is_refused_before_it_starts() {
    if cfg!(feature = "soundcard") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let graph = texturepad_graph();
    let run = ["run", &graph, "--for", "0.2", "--play", "--out", "out"];
    let told = fail(folder.path(), &run, 1);
    assert!(told.contains("--features soundcard"), "{told}");
    assert!(!folder.path().join("out").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn the_page_is_opened_by_the_desktop_where_there_is_one() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let (opener, seen) = (folder.path().join("xdg-open"), folder.path().join("seen"));
    fs::write(&opener, format!("#!/bin/sh\nprintf %s \"$1\" >'{}'\n", seen.display())).unwrap();
    fs::set_permissions(&opener, fs::Permissions::from_mode(0o755)).unwrap();
    let graph = texturepad_graph();
    let run = |display: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_haptograph"));
        command
            .args(["run", &graph, "--for", "0.2", "--out", "out", "--open"])
            .env("DISPLAY", display)
            .env_remove("WAYLAND_DISPLAY")
            .env("PATH", format!("{}:/usr/bin:/bin", folder.path().display()))
            .current_dir(folder.path());
        let output = command.output().unwrap();
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let told = run("");
    assert!(told.contains("no desktop") && !seen.exists(), "{told}");
    let told = run(":9");
    assert!(!told.contains("cannot open"), "{told}");
    let expected = folder.path().canonicalize().unwrap().join("out/report.html");
    // The opener is another process, for which nobody waits.
    let opened = (0..500).find_map(|_| {
        std::thread::sleep(std::time::Duration::from_millis(10));
        fs::read_to_string(&seen).ok().filter(|path| !path.is_empty())
    });
    assert_eq!(opened.as_deref(), expected.to_str());
}

#[test]
fn failures_are_json_where_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("g.ron"),
        "Graph(format: 1, clocks: { \"c\": Driver(rate_hz: 1000) }, nodes: { \"a\": Sinus() })",
    )
    .unwrap();
    let told = |arguments: &[&str], code: i32| -> serde_json::Value {
        let output = haptograph(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
        assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let graph = told(&["run", "g.ron", "--json"], 1);
    assert_eq!(graph["findings"][0]["code"], "E0201", "{graph}");
    assert_eq!(told(&["check", "g.ron", "--json"], 1), graph);
    let nothing = told(&["check", "nope.ron", "--json"], 1);
    assert_eq!(nothing["findings"][0]["path"], "nope.ron", "{nothing}");
    fs::write(
        folder.path().join("sound.ron"),
        "Graph(format: 1, clocks: { \"c\": Driver(rate_hz: 1000) }, nodes: {
            \"a\": Constant(clock: \"c\", value: 1), \"file\": CsvSink(inputs: [\"a\"], file: \"a.csv\") })",
    )
    .unwrap();
    let sound = told(&["check", "sound.ron", "--json"], 0);
    assert_eq!(sound, serde_json::json!({ "findings": [] }));
    assert!(told(&["nodes", "NoSuchKind", "--json"], 1)["error"].is_string());
    assert!(told(&["nodes", "--no-such-flag", "--json"], 2)["error"].is_string());
    let kinds = told(&["nodes", "--find", "envelope", "--json"], 0);
    assert!(kinds.as_array().unwrap().iter().any(|kind| kind["name"] == "Adsr"), "{kinds}");
}

#[test]
fn shells_and_manuals_know_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let completions = succeed(folder.path(), &["completions", "bash"]);
    succeed(folder.path(), &["man", "--out", "man1"]);
    for command in ["run", "sweep", "identify", "lsp", "surface-show", "batch-merge"] {
        let first = command.split('-').next().unwrap();
        assert!(completions.contains(first), "{command}");
        let page = fs::read_to_string(folder.path().join(format!("man1/haptograph-{command}.1"))).unwrap();
        assert!(page.contains("SYNOPSIS") && page.contains("Examples"), "{page}");
    }
    assert!(folder.path().join("man1/haptograph.1").is_file());
    let page = succeed(folder.path(), &["man", "surface", "show"]);
    assert!(page.contains("haptograph\\-surface\\-show"), "{page}");
    let told = fail(folder.path(), &["man", "surface", "shov"], 1);
    assert!(told.contains("did you mean `show`"), "{told}");
    assert_eq!(succeed(folder.path(), &["help", "--help"]), succeed(folder.path(), &["help"]));
}

#[test]
fn a_build_says_what_it_lacks_and_what_does_without() {
    let folder = tempfile::tempdir().unwrap();
    let listed = succeed(folder.path(), &["devices"]);
    for what in ["soundcards", "tablets and mice", "serial ports", "MIDI ports", "Haply arms"] {
        let of_kind = listed.lines().filter(|line| line.starts_with(what));
        assert_eq!(of_kind.count(), 1, "{what}: {listed}");
    }
    if cfg!(any(feature = "soundcard", feature = "evdev", target_os = "macos", windows)) {
        return;
    }
    assert!(
        listed.contains(
            "soundcards: not in this build; build with `cargo build --release --features soundcard`"
        ),
        "{listed}"
    );
    let told = fail(folder.path(), &["run", &texturepad_graph(), "--live"], 1);
    for part in ["`haptuator`", "`stylus`", "--features soundcard,evdev", "--endpoints simulated"] {
        assert!(told.contains(part), "{told}");
    }
    assert_eq!(folder.path().read_dir().unwrap().count(), 0);
}

#[test]
fn a_sweep_counts_its_cases_beside_the_graph_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &["new", "mine.ron"]);
    let sweep = ["sweep", "mine.ron", "--for", "0.05", "--case", "gain=0.5", "--case", "gain=0.2"];
    let said = succeed(folder.path(), &sweep);
    assert!(said.contains("ran mine as it is + 2 cases\n"), "{said}");
}

#[test]
fn what_is_wrong_with_settings_is_said_in_the_words_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let told = |nodes: &str| {
        let text = format!(
            r#"Graph(format: 1, clocks: {{ "c": Driver(rate_hz: 1000) }}, nodes: {{
                "pull": Constant(clock: "c", value: 1, quantity: "force"), {nodes} }},
                endpoints: {{ "simulated": {{ "a": SimulatedHaptuator() }} }})"#
        );
        fs::write(folder.path().join("g.ron"), text).unwrap();
        fail(folder.path(), &["check", "g.ron"], 1)
    };
    let said = told(r#""b": Calibrate(input: "pull", factor: 1)"#);
    for field in ["from", "to"] {
        let whole = format!("`Calibrate` needs `{field}`");
        let help = format!("add `{field}: \"...\"`, the name of a quantity, one of number, length");
        assert!(said.contains(&whole) && said.contains(&help), "{said}");
    }
    let said = told(r#""b": Calibrate(input: "pull", from: "speed", to: "number", factor: 1)"#);
    assert!(said.contains("E0404") && said.contains("write `from: \"force\"`"), "{said}");
    let said = told(r#""b": ActuatorSink(current: "pull", endpoint: "a", limit: (peak: 1))"#);
    assert!(said.contains("`limit` has no field `peak`") && !said.contains("Settings"), "{said}");
}

#[test]
fn a_study_is_simulated_and_analysed_to_known_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let graphs = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs").display().to_string();
    let study = r#"Study(format: 1, graph: "GRAPHS/texturepad.ron", seed: 9,
        surfaces: { "silk": (file: "GRAPHS/surfaces/t4-silk.ron"), "tile": (file: "GRAPHS/surfaces/t3-tile.ron"), "vinyl": (file: "GRAPHS/surfaces/t5-vinyl.ron") },
        versions: { "a": {}, "b": { "gain": 0.5 } },
        scales: { "rough": (ask: "?", from: "a", to: "b"), "smooth": (ask: "?", from: "a", to: "b") },
        phases: { "rated": Rate(stimuli: [Virtual(version: "a")]), "x": TwoAlternative(abx: true, ask: "?", surfaces: ["tile"], repeats: 2) })"#;
    fs::write(folder.path().join("s.ron"), study.replace("GRAPHS", &graphs)).unwrap();
    // People without noise: what they answer is what they feel.
    let people = r#"People(format: 1, bias_sd: 0.0, noise_sd: 0.0, values: { "rough": { "tile": -0.2, "silk": 0.3 },
        "smooth": { "tile": 0.2, "silk": -0.3 }, "x": { "b": 0.4 } })"#;
    fs::write(folder.path().join("p.ron"), people).unwrap();
    let simulate =
        ["study", "simulate", "s.ron", "--people", "5", "--model", "p.ron", "--without-motion", "-o", "data"];
    succeed(folder.path(), &simulate);
    let told = succeed(folder.path(), &["study", "analyse", "data", "--json"]);
    let found: serde_json::Value = serde_json::from_str(&told).unwrap();
    let near = |value: &serde_json::Value, known: f64| (value.as_f64().unwrap() - known).abs() < 1e-12;
    let means: Vec<_> = found["means"].as_array().unwrap().iter().collect();
    let known = [
        ("rough", "silk", 0.8),
        ("rough", "tile", 0.3),
        ("rough", "vinyl", 0.5),
        ("smooth", "silk", 0.2),
        ("smooth", "tile", 0.7),
        ("smooth", "vinyl", 0.5),
    ];
    assert_eq!(means.len(), known.len());
    for (scale, surface, mean) in known {
        let is_it = |row: &&&serde_json::Value| row["scale"] == scale && row["surface"] == surface;
        let row = means.iter().find(is_it).unwrap();
        assert!(near(&row["mean"], mean) && near(&row["sd"], 0.0) && row["people"] == 5, "{row}");
    }
    // What one scale gains the other loses.
    assert!(near(&found["relations"][0]["value"], -1.0) && found["relations"][0]["count"] == 3);
    let abx = found["abx"].as_array().unwrap();
    assert_eq!(abx.len(), 5 + 1);
    assert!(near(&abx[0]["p"], 0.5) && abx[0]["answers"] == 2, "{}", abx[0]);
    assert!(near(&abx[5]["p"], 2.0 / 1024.0) && near(&abx[5]["p_of_people"], 2.0 / 32.0), "{}", abx[5]);
    assert!(near(&abx[5]["share_right"], 1.0) && abx[5]["d_prime"].is_null() && found["simulated"] == true);
    // The tables have the same numbers.
    let analysis = folder.path().join("data/analysis");
    let table = fs::read_to_string(analysis.join("means.csv")).unwrap();
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let at = header.iter().position(|name| *name == "mean").unwrap();
    let in_table: Vec<f64> = lines.map(|line| line[at].parse().unwrap()).collect();
    assert_eq!(in_table, means.iter().map(|row| row["mean"].as_f64().unwrap()).collect::<Vec<_>>());
    for name in ["abx.csv", "analysis.R", "analysis.html"] {
        assert!(analysis.join(name).is_file(), "{name}");
    }
}

#[cfg(unix)]
#[test]
fn a_script_gets_the_help_and_a_person_the_gallery() {
    use std::io::{BufRead, BufReader};
    let folder = tempfile::tempdir().unwrap();
    assert!(fail(folder.path(), &[], 2).contains("Usage"));
    fail(folder.path(), &["studio", "--set", "gain=1"], 2);
    fail(folder.path(), &["studio", "--live"], 1);
    let mut command = Command::new(env!("CARGO_BIN_EXE_haptograph"));
    command
        .args(["studio", "--no-open"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::piped());
    let mut studio = command.spawn().unwrap();
    let lines = BufReader::new(studio.stdout.take().unwrap()).lines().map_while(Result::ok);
    let address = { lines }.find_map(|line| line.trim().strip_prefix("http://").map(str::to_owned)).unwrap();
    let (host, path) = address.split_once('/').unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    write!(stream, "GET /{path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
    let mut page = String::new();
    let _ = stream.read_to_string(&mut page);
    Command::new("kill").args(["-INT", &studio.id().to_string()]).status().unwrap();
    assert!(studio.wait().unwrap().success());
    assert!(page.contains("gallery.js"), "{page}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}
