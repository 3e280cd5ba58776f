//! No file of a user is lost, whatever is run where.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs long enough to be recorded, with a sink.
const GRAPH: &str = r#"Graph(format: 1, parameters: { "hz": 5.0 }, clocks: { "c": Driver(rate_hz: 1000) }, nodes: {
    "s": Sine(clock: "c", frequency_hz: Param("hz")), "f": CsvSink(inputs: ["s"], file: "x.csv") })"#;

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_haptograph"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null());
    command
}

fn haptograph(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().expect("the program starts")
}

fn succeeds(folder: &Path, arguments: &[&str]) -> bool {
    haptograph(folder, arguments).status.success()
}

/// A folder with a graph in it.
fn with_graph() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("g.ron"), GRAPH).expect("it can be written");
    folder
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

const RUN: [&str; 4] = ["run", "g.ron", "--for", "0.1"];

#[test]
fn a_run_replaces_only_what_runs_wrote() {
    let folder = with_graph();
    let folder = folder.path();
    assert!(succeeds(folder, &RUN));
    fs::write(folder.join("out/g/analysis.py"), "mine").unwrap();
    fs::write(folder.join("out/g/x.csv"), "edited").unwrap();
    let output = haptograph(folder, &RUN);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    assert!(told.contains("analysis.py") && told.contains("x-1.csv"), "{told}");
    assert_eq!(read(folder, "out/g/analysis.py"), "mine");
    assert_eq!(read(folder, "out/g/x-1.csv"), "edited");
    assert_eq!(read(folder, "out/g/x.csv").lines().count(), 101);
}

#[test]
fn a_folder_with_some_run_json_is_not_taken_for_a_runs() {
    let folder = with_graph();
    let project = folder.path().join("project");
    fs::create_dir(&project).unwrap();
    fs::write(project.join("run.json"), "{}").unwrap();
    fs::write(project.join("work"), "years").unwrap();
    let output = haptograph(folder.path(), &[&RUN[..], &["--out", "project"]].concat());
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(read(&project, "work") + &read(&project, "run.json"), "years{}");
    assert_eq!(fs::read_dir(&project).unwrap().count(), 2);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn a_run_can_go_into_the_folder_it_is_started_in() {
    let folder = with_graph();
    let here = folder.path().join("here");
    fs::create_dir(&here).unwrap();
    let run = ["run", "../g.ron", "--live", "--for", "0.1", "--out", "."];
    assert!(succeeds(&here, &run) && succeeds(&here, &run));
    assert!(here.join("run.json").exists() && here.join("manifest.json").exists());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn what_was_recorded_stays_where_the_target_fills_meanwhile() {
    let folder = with_graph();
    let folder = folder.path();
    let target = folder.join("t");
    let live = ["run", "g.ron", "--live", "--for", "2", "--out", "t"];
    let mut running = command(folder, &live).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    // As soon as the run waits beside its target.
    while !folder.join("t.partial-1/x.csv").exists() {
        assert!(running.try_wait().unwrap().is_none(), "it ended before it began");
        std::thread::yield_now();
    }
    fs::create_dir(&target).unwrap();
    fs::write(target.join("note"), "mine").unwrap();
    let second = haptograph(folder, &[&RUN[..], &["--out", "t"]].concat());
    assert_eq!(second.status.code(), Some(1), "it holds files");
    let output = running.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("t.partial-1"), "{told}");
    assert_eq!(read(&target, "note"), "mine");
    for name in ["x.csv", "run.json", "report.html"] {
        assert!(!read(&folder.join("t.partial-1"), name).is_empty());
    }
    fs::remove_dir_all(&target).unwrap();
    let next = haptograph(folder, &[&RUN[..], &["--out", "t"]].concat());
    assert!(next.status.success());
    assert!(String::from_utf8_lossy(&next.stderr).contains("t.partial-1"));
    let doctor = haptograph(folder, &["doctor"]);
    assert!(String::from_utf8_lossy(&doctor.stdout).contains("t.partial-1"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_graph_whose_name_is_no_unicode_keeps_its_recording() {
    use std::os::unix::ffi::OsStrExt;
    let folder = with_graph();
    let name = std::ffi::OsStr::from_bytes(b"g\xff.ron");
    fs::rename(folder.path().join("g.ron"), folder.path().join(name)).unwrap();
    let mut run = command(folder.path(), &["run", "--for", "0.1"]);
    assert!(run.arg(name).args(["--out", "o"]).status().unwrap().success());
    assert!(folder.path().join("o/x.csv").exists());
    let mut sweep = command(folder.path(), &["sweep", "--for", "0.1", "--over", "hz=5,6"]);
    assert!(sweep.arg(name).args(["--out", "s"]).status().unwrap().success());
    assert!(folder.path().join("s/02/x.csv").exists());
}

#[test]
fn outputs_of_others_are_replaced_by_force_only() {
    let folder = with_graph();
    let folder = folder.path();
    let surface = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/canvas-thesis.ron");
    let surface = surface.display().to_string();
    let probe = [&RUN[..], &["--probe", "s=file.csv"]].concat();
    let resample =
        ["surface", "resample", &surface, "--rate", "5000", "--method", "spectral", "-o", "file.ron"];
    let record =
        ["simulate-recording", "--material", "T5", "--motion", "drag", "--seconds", "0.1", "-o", "file.npz"];
    for (file, arguments) in [
        ("file.svg", &["draw", "g.ron", "-o", "file.svg"][..]),
        ("file.svg", &["bench", "g.ron", "--for", "0.01", "--svg", "file.svg"]),
        ("file.csv", &probe),
        ("file.xml", &["surface", "convert", &surface, "file.xml"]),
        ("file.ron", &resample),
        ("file.npz", &record),
    ] {
        fs::write(folder.join(file), "mine").unwrap();
        let refused = haptograph(folder, arguments);
        assert_eq!(refused.status.code(), Some(1), "{arguments:?}");
        let told = String::from_utf8_lossy(&refused.stderr);
        assert!(told.contains("--force"), "{arguments:?}: {told}");
        assert_eq!(read(folder, file), "mine", "{arguments:?}");
        assert!(succeeds(folder, &[arguments, &["--force"]].concat()), "{arguments:?}");
        assert!(fs::read(folder.join(file)).unwrap() != b"mine");
        assert!(succeeds(folder, arguments), "its own is replaced: {arguments:?}");
    }
}
