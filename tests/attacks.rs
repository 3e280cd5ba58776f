//! Paths that are no files, and signals at any moment: every command ends by itself and leaves nothing half-written.
#![cfg(unix)]

use std::fs::{self, File};
#[cfg(target_os = "linux")]
use std::io::Write;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Far longer than any of these takes; a command that waits for ever is ended then.
const PATIENCE: Duration = Duration::from_secs(60);

/// Starts the command in a folder; what it says on standard error goes to a file.
fn start(folder: &Path, arguments: &[&str], said: &Path) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_haptograph"));
    command.args(arguments).current_dir(folder);
    command.stdin(Stdio::null()).stdout(Stdio::null());
    command.stderr(File::create(said).expect("a file for what is said"));
    command.spawn().expect("the program starts")
}

/// How a command ended, or nothing where it had to be killed.
fn end(child: &mut Child) -> Option<ExitStatus> {
    let begun = Instant::now();
    while begun.elapsed() < PATIENCE {
        if let Some(status) = child.try_wait().expect("a child to wait for") {
            return Some(status);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().expect("a child to kill");
    child.wait().expect("a child to wait for");
    None
}

/// The names of what is in a folder, in order.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let name = |entry: std::io::Result<fs::DirEntry>| entry.expect("an entry").file_name();
    let mut names: Vec<_> = entries.map(|entry| name(entry).to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// One path of each kind that is no file.
fn hostile(folder: &Path) -> Vec<String> {
    let at = |name: &str| folder.join(name);
    fs::create_dir(at("folder.ron")).expect("a folder");
    let made = Command::new("mkfifo").arg(at("pipe.csv")).status();
    assert!(made.expect("mkfifo").success());
    symlink("nowhere", at("dangling.ron")).expect("a link");
    symlink("loop.csv", at("loop.csv")).expect("a link");
    symlink("/dev/zero", at("zero.wav")).expect("a link");
    let made = ["folder.ron", "pipe.csv", "dangling.ron", "loop.csv", "zero.wav"].map(at);
    let all = made.into_iter().chain([PathBuf::from("/dev/zero")]);
    all.map(|path| path.display().to_string()).collect()
}

/// Every command that reads a file, reading this one.
fn readers(path: &str) -> Vec<Vec<String>> {
    let graph = format!("{}/graphs/texturepad.ron", env!("CARGO_MANIFEST_DIR"));
    let surface = format!("surface={path}");
    let commands: [&[&str]; 9] = [
        &["check", path],
        &["run", path, "--out", "out"],
        &["run", &graph, "--for", "0.1", "--set", &surface, "--out", "out"],
        &["run", &graph, "--replay", path, "--out", "out"],
        &["learn", path, "-o", "learned.ron"],
        &["segment", path, "--column", "x"],
        &["compare", path, path],
        &["identify", path],
        &["surface", "show", path],
    ];
    let owned = |words: &&[&str]| words.iter().map(|word| (*word).to_owned()).collect();
    commands.iter().map(owned).collect()
}

#[test]
fn a_path_that_is_no_file_is_one_error_and_leaves_nothing() {
    let outside = tempfile::tempdir().unwrap();
    let paths = hostile(outside.path());
    let there = names(outside.path());
    std::thread::scope(|scope| {
        for path in &paths {
            scope.spawn(move || {
                let folder = tempfile::tempdir().unwrap();
                let kept = tempfile::NamedTempFile::new().unwrap();
                for words in readers(path) {
                    let words: Vec<&str> = words.iter().map(String::as_str).collect();
                    let status = end(&mut start(folder.path(), &words, kept.path()));
                    let said = fs::read_to_string(kept.path()).unwrap();
                    assert_eq!(status.and_then(|it| it.code()), Some(1), "{words:?}: {said}");
                    let errors = said.lines().filter(|line| line.starts_with("error"));
                    assert_eq!(errors.count(), 1, "{words:?}: {said}");
                    assert_eq!(names(folder.path()), [""; 0], "{words:?}");
                }
            });
        }
    });
    assert_eq!(names(outside.path()), there);
}

/// Long enough to be interrupted.
const GRAPH: &str = r#"Graph(format: 1, clocks: { "c": Driver(rate_hz: 1000) }, nodes: {
    "s": Sine(clock: "c", frequency_hz: 5), "f": CsvSink(inputs: ["s"], file: "x.csv") })"#;

/// Whether a folder holds all that a run writes, and as many rows as the run says it had frames.
fn is_complete(run: &Path) -> bool {
    let Ok(text) = fs::read_to_string(run.join("run.json")) else {
        return false;
    };
    let facts: serde_json::Value = serde_json::from_str(&text).expect("facts of a run");
    let rows = fs::read_to_string(run.join("x.csv")).map_or(0, |text| text.lines().count());
    let others = ["report.html", "manifest.json"];
    others.iter().all(|name| run.join(name).is_file())
        && facts["driver_frames"].as_u64() == Some(rows as u64 - 1)
}

/// Runs the graph, sends the signal after the delay, and looks at what is left.
fn strike(folder: &Path, signal: &str, delay: Duration) {
    let said = folder.join("said");
    let arguments = ["run", "g.ron", "--for", "60", "--out", "out"];
    let mut run = start(folder, &arguments, &said);
    std::thread::sleep(delay);
    let pid = run.id().to_string();
    let sent = Command::new("kill").args(["-s", signal, &pid]).status();
    assert!(sent.expect("kill").success());
    let status = end(&mut run).expect("a signal ends the run");
    let said = fs::read_to_string(said).expect("what it said");
    let case = format!("{signal} after {delay:?}, {status}: {said}");
    for left in names(folder) {
        match left.as_str() {
            "g.ron" | "said" => {}
            "out" => assert!(is_complete(&folder.join("out")), "{case}"),
            left => {
                assert!(left.starts_with("out.partial-"), "{left}: {case}");
                assert!(!status.success() && said.contains(left), "{left}: {case}");
            }
        }
    }
    assert!(!status.success() || folder.join("out").is_dir(), "{case}");
}

#[test]
fn a_signal_at_any_moment_leaves_a_whole_run_or_a_named_one_or_none() {
    let whole = tempfile::tempdir().unwrap();
    fs::write(whole.path().join("g.ron"), GRAPH).unwrap();
    let arguments = ["run", "g.ron", "--for", "60", "--out", "out"];
    let begun = Instant::now();
    let status = end(&mut start(whole.path(), &arguments, &whole.path().join("said")));
    let took = begun.elapsed();
    assert!(status.is_some_and(|it| it.success()) && is_complete(&whole.path().join("out")));
    let mut seed = 18_u64;
    for number in 0..24 {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("g.ron"), GRAPH).unwrap();
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        // A share of the time that the run takes, up to a little more than all of it.
        let share = f64::from((seed >> 33) as u32) / f64::from(1_u32 << 31) * 1.1;
        strike(folder.path(), ["INT", "TERM"][number % 2], took.mul_f64(share));
    }
}

/// Waits until a command hears ctrl-C, and says it to it.
#[cfg(target_os = "linux")]
fn interrupt_when_heard(child: &Child) {
    let status = format!("/proc/{}/status", child.id());
    let hears = || {
        let status = fs::read_to_string(&status).expect("the child's status");
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        let caught = u64::from_str_radix(caught.unwrap_or("0").trim(), 16).expect("a mask");
        // SIGINT is 2, whose bit is the second. With the thread that hears it and the one that writes remarks the command has begun.
        let threads = fs::read_dir(format!("/proc/{}/task", child.id())).map_or(0, Iterator::count);
        caught & 2 != 0 && threads >= 3
    };
    let begun = Instant::now();
    while !hears() {
        assert!(begun.elapsed() < PATIENCE, "it never hears ctrl-C");
        std::thread::sleep(Duration::from_millis(1));
    }
    let sent = Command::new("kill").args(["-s", "INT", &child.id().to_string()]).status();
    assert!(sent.expect("kill").success());
}

#[cfg(target_os = "linux")]
#[test]
fn a_stop_waits_for_nobody_who_should_read_what_is_said() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("g.ron"), GRAPH).unwrap();
    let fifo = folder.path().join("fifo");
    assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    // A pipe that holds as much as it can.
    let mut full = fs::OpenOptions::new().read(true).write(true).open(&fifo).unwrap();
    full.write_all(&vec![b' '; 65_536]).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_haptograph"));
    command.args(["run", "g.ron", "--live", "--out", "out"]).current_dir(folder.path());
    command.stdin(Stdio::null()).stdout(Stdio::null());
    let mut run = command.stderr(full.try_clone().unwrap()).spawn().unwrap();
    interrupt_when_heard(&run);
    let status = end(&mut run);
    assert!(status.is_some_and(|it| it.success()), "{status:?}");
    assert!(is_complete(&folder.path().join("out")));
    assert_eq!(names(folder.path()), ["fifo", "g.ron", "out"]);
}

#[cfg(target_os = "linux")]
#[test]
fn what_ctrl_c_cut_short_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let swept = GRAPH.replace("frequency_hz: 5", r#"frequency_hz: Param("f")"#);
    let swept = swept.replace("format: 1,", r#"format: 1, parameters: { "f": 5.0 },"#);
    fs::write(folder.path().join("g.ron"), swept).unwrap();
    let values: Vec<String> = (1..=200).map(|f| f.to_string()).collect();
    let over = format!("f={}", values.join(","));
    let sweep = ["sweep", "g.ron", "--over", &over, "--for", "600", "--out", "swept"];
    let simulate =
        ["simulate-recording", "--material", "T2", "--motion", "drag", "--seconds", "3600", "-o", "take.npz"];
    let interrupted = |arguments: &[&str]| {
        let said = folder.path().join("said");
        let mut run = start(folder.path(), arguments, &said);
        interrupt_when_heard(&run);
        let status = end(&mut run);
        (status.and_then(|it| it.code()), fs::read_to_string(said).unwrap())
    };
    let (code, said) = interrupted(&sweep);
    assert!(said.contains("warning: stopped after"), "{said}");
    assert_eq!(code, Some(130), "{said}");
    assert!(folder.path().join("swept/run.json").is_file());
    // A recording may have too little to keep yet: then the command failed.
    let (code, said) = interrupted(&simulate);
    assert!(said.contains("stopped after"), "{said}");
    let expected = if folder.path().join("take.npz").is_file() { 130 } else { 1 };
    assert_eq!(code, Some(expected), "{said}");
}
