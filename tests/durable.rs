//! What a run writes is usable whatever ends it, as its users see it.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use haptograph::nodes::wav::{Format, WavWriter};
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output};

fn haptograph(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_haptograph"));
    let command = command.args(arguments).current_dir(folder);
    command.output().expect("the program starts")
}

/// Runs the graph of these nodes on a clock `c` of 1 kHz; what it said on standard error.
fn run(folder: &Path, nodes: &str, arguments: &[&str]) -> (bool, String) {
    let graph =
        format!(r#"Graph(format: 1, clocks: {{ "c": Driver(rate_hz: 1000) }}, nodes: {{ {nodes} }})"#);
    fs::write(folder.join("g.ron"), graph).unwrap();
    let output = haptograph(folder, arguments);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.success(), told)
}

/// A file as a process leaves it that is killed half a second after the header was written last.
fn killed(path: &Path, frames: u16) {
    let format = Format { channels: 1, rate_hz: 1000 };
    let mut writer = WavWriter::new(File::create(path).unwrap(), format).unwrap();
    for frame in 0..frames {
        writer.write(&[frame.into()]).unwrap();
    }
    writer.finish().unwrap();
    let mut file = OpenOptions::new().append(true).open(path).unwrap();
    for frame in frames..frames + 500 {
        file.write_all(&f32::from(frame).to_le_bytes()).unwrap();
    }
}

fn frames(path: &Path) -> usize {
    hound::WavReader::open(path).unwrap().duration() as usize
}

#[test]
fn recover_makes_a_dead_runs_folder_whole_and_removes_nothing() {
    let parent = tempfile::tempdir().unwrap();
    let leftover = parent.path().join("out.partial-1");
    fs::create_dir_all(leftover.join("inner")).unwrap();
    fs::create_dir_all(leftover.join(".probes/0")).unwrap();
    fs::write(leftover.join(".haptograph-partial"), "{}").unwrap();
    fs::write(leftover.join("hand.csv"), "time_s,x_n\n0,1\n").unwrap();
    killed(&leftover.join("x.wav"), 2000);
    killed(&leftover.join("inner/y.wav"), 10);
    killed(&leftover.join(".probes/0/z.wav"), 10);
    fs::create_dir(parent.path().join("out-recovered")).unwrap();
    let output = haptograph(parent.path(), &["recover", "out.partial-1"]);
    assert!(output.status.success(), "{output:?}");
    assert!(!leftover.exists());
    let now = parent.path().join("out-recovered-2");
    assert_eq!(frames(&now.join("x.wav")), 2500);
    assert_eq!(frames(&now.join("inner/y.wav")), 510);
    assert_eq!(frames(&now.join("probes/0/z.wav")), 510);
    assert!(now.join("hand.csv").is_file() && !now.join(".haptograph-partial").exists());
}

#[test]
fn recover_completes_the_move_of_a_complete_run_and_replaces_nothing_of_others() {
    let parent = tempfile::tempdir().unwrap();
    let at = |name: &str| parent.path().join(name);
    let leftover = at("out.partial-1");
    fs::create_dir_all(leftover.join(".probes/0")).unwrap();
    let probe = at("elsewhere/x.csv");
    fs::create_dir(at("elsewhere")).unwrap();
    fs::write(&probe, "mine").unwrap();
    let moves = format!(r#"{{"inside": false, "earlier": null, "probes": [{probe:?}, "/etc/forged"]}}"#);
    for (name, text) in [
        (".haptograph-partial", "{}"),
        (".haptograph-moves", &moves),
        (".probes/0/x.csv", "time_s,x\n"),
        ("run.json", "{}"),
        ("hand.csv", "time_s,x_n\n"),
    ] {
        fs::write(leftover.join(name), text).unwrap();
    }
    fs::create_dir(at("out")).unwrap();
    fs::write(at("out/hand.csv"), "mine too").unwrap();
    let output = haptograph(parent.path(), &["recover", "out.partial-1"]);
    assert!(output.status.success(), "{output:?}");
    let read = |name: &str| fs::read_to_string(at(name)).unwrap();
    assert!(!leftover.exists() && at("out/manifest.json").is_file() && at("out/run.json").is_file());
    assert_eq!(
        (read("out/hand.csv"), read("out/hand-1.csv")),
        ("time_s,x_n\n".to_owned(), "mine too".to_owned())
    );
    assert_eq!(
        (read("elsewhere/x.csv"), read("elsewhere/x-1.csv")),
        ("mine".to_owned(), "time_s,x\n".to_owned())
    );
}

#[test]
fn recover_changes_no_wav_file_that_is_of_no_run() {
    let parent = tempfile::tempdir().unwrap();
    let at = |name: &str| parent.path().join(name);
    fs::create_dir_all(at("songs/out.partial-1")).unwrap();
    killed(&at("songs/mine.wav"), 10);
    killed(&at("songs/out.partial-1/x.wav"), 10);
    fs::write(at("songs/out.partial-1/.haptograph-partial"), "{}").unwrap();
    fs::create_dir(at("songs/now.partial-1")).unwrap();
    killed(&at("songs/now.partial-1/y.wav"), 10);
    let marker = File::create(at("songs/now.partial-1/.haptograph-partial")).unwrap();
    marker.lock().unwrap();
    assert!(haptograph(parent.path(), &["recover", "songs"]).status.success());
    assert_eq!(frames(&at("songs/mine.wav")), 10);
    assert_eq!(frames(&at("songs/now.partial-1/y.wav")), 10);
    assert_eq!(frames(&at("songs/out.partial-1/x.wav")), 510);
    assert!(haptograph(parent.path(), &["recover", "songs/mine.wav"]).status.success());
    assert_eq!(frames(&at("songs/mine.wav")), 510);
}

#[test]
fn recover_leaves_a_run_alone_that_is_still_writing() {
    let parent = tempfile::tempdir().unwrap();
    let leftover = parent.path().join("out.partial-1");
    fs::create_dir(&leftover).unwrap();
    killed(&leftover.join("x.wav"), 10);
    let marker = File::create(leftover.join(".haptograph-partial")).unwrap();
    marker.lock().unwrap();
    let output = haptograph(parent.path(), &["recover", "out.partial-1"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(frames(&leftover.join("x.wav")), 10);
}

#[test]
fn the_run_says_that_it_ended_with_its_data() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("x.csv"), "x_n\n1\n2\n3\n").unwrap();
    let source = |at_end: &str| {
        format!(
            r#""felt": CsvSource(clock: "c", file: "x.csv", column: "x_n", quantity: "force"{at_end}),
            "file": CsvSink(inputs: ["felt"], file: "y.csv")"#
        )
    };
    let arguments = ["run", "g.ron", "--for", "0.01", "--out", "out"];
    let rows = || fs::read_to_string(folder.path().join("out/y.csv")).unwrap().lines().count() - 1;
    let facts = || {
        let text = fs::read_to_string(folder.path().join("out/run.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()
    };
    let (done, told) = run(folder.path(), &source(""), &arguments);
    assert!(done && told.contains("`felt`"), "{told}");
    assert_eq!((rows(), &facts()["driver_frames"]), (3, &serde_json::json!(3)));
    let (done, told) = run(folder.path(), &source(", at_end: Hold"), &arguments);
    assert!(done && told.contains("`felt`"), "{told}");
    assert_eq!((rows(), facts()["warnings"].as_array().unwrap().len()), (10, 1));
}

#[test]
fn a_probe_chooses_a_full_scale_that_holds_the_signal_and_says_which() {
    let folder = tempfile::tempdir().unwrap();
    let tone = r#""tone": Sine(clock: "c", frequency_hz: 100, amplitude: 20, quantity: "acceleration")"#;
    let arguments = ["run", "g.ron", "--for", "0.1", "--probe", "tone.output=x.wav"];
    let (done, told) = run(folder.path(), tone, &arguments);
    assert!(done && told.contains("x.wav: a sample of 1.0 stands for 32 m/s2"), "{told}");
    let mut reader = hound::WavReader::open(folder.path().join("x.wav")).unwrap();
    assert!(reader.samples::<f32>().all(|sample| sample.unwrap().abs() <= 1.0));
}

#[test]
fn check_refuses_names_of_files_that_a_sink_does_not_write() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["x.mp3", "../x.wav", "nul.wav", ""] {
        let nodes =
            format!(r#""x": Constant(clock: "c", value: 1), "file": WavSink(input: "x", file: "{name}")"#);
        let (sound, told) = run(folder.path(), &nodes, &["check", "g.ron"]);
        assert!(!sound, "{name}: {told}");
    }
}

/// Runs the program where no file may be longer than some blocks of 512 bytes or 1 KiB.
#[cfg(unix)]
fn limited(folder: &Path, blocks: u32, arguments: &str) -> Output {
    let line = format!("ulimit -f {blocks}; exec {} {arguments}", env!("CARGO_BIN_EXE_haptograph"));
    let mut command = Command::new("sh");
    command.args(["-c", &line]).current_dir(folder).stdin(std::process::Stdio::null());
    command.output().unwrap()
}

#[cfg(unix)]
#[test]
fn a_limit_of_the_size_of_files_is_a_full_disk() {
    let folder = tempfile::tempdir().unwrap();
    let nodes = r#""s": Sine(clock: "c", frequency_hz: 5), "f": WavSink(input: "s", file: "x.wav")"#;
    let graph =
        format!(r#"Graph(format: 1, clocks: {{ "c": Driver(rate_hz: 48000) }}, nodes: {{ {nodes} }})"#);
    fs::write(folder.path().join("g.ron"), graph).unwrap();
    let live = limited(folder.path(), 300, "run g.ron --live --for 2 --out live");
    let told = String::from_utf8_lossy(&live.stderr);
    assert!(live.status.code().is_some() && told.contains("x.wav"), "{told}");
    assert!(folder.path().join("live/run.json").is_file(), "{told}");
    let offline = limited(folder.path(), 300, "run g.ron --for 10 --out offline");
    let told = String::from_utf8_lossy(&offline.stderr);
    assert!(offline.status.code() == Some(1) && told.contains("x.wav"), "{told}");
}

#[cfg(unix)]
#[test]
fn a_graph_that_cannot_be_written_whole_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let made = limited(folder.path(), 0, "new g.ron");
    let told = String::from_utf8_lossy(&made.stderr);
    assert!(made.status.code() == Some(1) && told.contains("g.ron"), "{told}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}
