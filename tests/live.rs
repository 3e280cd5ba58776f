//! Graphs against the clock, as their users run them. No test here asserts a wall-clock deadline: machines stall.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use skip::skip;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

#[cfg(target_os = "linux")]
#[path = "live/last_zeros.rs"]
mod last_zeros;
#[path = "live/reloads.rs"]
mod reloads;
#[path = "live/remote.rs"]
mod remote;
#[path = "live/replays.rs"]
mod replays;
mod skip;
#[path = "live/terminal.rs"]
mod terminal;

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
            assert!(start.elapsed() < Duration::from_secs(60), "no `{words}` in: {told}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until the last `count` rows of a CSV sink end with a value within 0.001: what was set has arrived in the signal.
    /// No other output tells what a driver has computed. The sink writes its rows once a second.
    fn wait_for_rows(&mut self, file: &str, value: f64, count: usize) {
        self.wait_until(file, |rows| {
            let last = rows.iter().rev().take(count);
            rows.len() >= count && last.into_iter().all(|row| (row - value).abs() < 1e-3)
        });
    }

    /// Waits until a CSV sink has written rows of ticks that came after this call.
    fn wait_for_more_rows(&mut self, file: &str) {
        let before = self.last_cells(file).len();
        self.wait_until(file, |rows| rows.len() > before);
    }

    fn wait_until(&mut self, file: &str, is_it: impl Fn(&[f64]) -> bool) {
        let start = Instant::now();
        while !is_it(&self.last_cells(file)) {
            let told = self.said();
            assert!(self.child.try_wait().unwrap().is_none(), "it ended: {told}");
            assert!(start.elapsed() < Duration::from_secs(60), "not in {file}: {told}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// The last cell of each row of a file in the folder that the run fills.
    fn last_cells(&self, file: &str) -> Vec<f64> {
        let folders = fs::read_dir(self.said.parent().unwrap()).unwrap();
        let files = folders.filter_map(|folder| {
            let path = folder.ok()?.path().join(file);
            Some((fs::metadata(&path).ok()?.modified().ok()?, path))
        });
        let Some((_, newest)) = files.max() else {
            return Vec::new();
        };
        // It may have been moved to its place meanwhile.
        let text = fs::read_to_string(newest).unwrap_or_default();
        // The last line may be half written.
        let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
        let cells = whole.lines().skip(1).map(|line| line.rsplit(',').next());
        cells.filter_map(|cell| cell?.parse().ok()).collect()
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
    assert_eq!((&facts["driver_frames"], &facts["live"]), (&14_400.into(), &true.into()));
    assert!(facts["late_us"]["p99"].is_number() && facts["wakes"].as_u64().unwrap() >= 300);
}

const TONE: &str = r#"Graph(format: 1,
    parameters: { "loudness": 0.25 },
    clocks: { "servo": Driver(rate_hz: 1000) },
    nodes: {
        "one": Constant(clock: "servo", value: 1, quantity: "number"),
        "loud": Gain(input: "one", gain: Param("loudness")),
        "file": WavSink(input: "loud", file: "loud.wav"),
        "seen": CsvSink(inputs: ["loud"], file: "seen.csv"),
    })"#;

/// Samples of a mono WAV file of 32-bit floats.
fn samples(path: &Path) -> Vec<f32> {
    let bytes = fs::read(path).unwrap();
    let at = bytes.windows(4).position(|tag| tag == b"data").unwrap() + 8;
    bytes[at..].as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
}

#[test]
fn a_setting_typed_while_it_runs_glides_and_a_stop_completes_the_files() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tone.ron"), TONE).unwrap();
    let mut run = Running::start(folder.path(), &["run", "tone.ron", "--live", "--out", "out"]);
    run.type_line("set loudness=0.5");
    run.wait_for("set: loud.gain=0.5 (taken over in");
    run.wait_for_rows("seen.csv", 0.5, 1);
    run.type_line("set loud.gain=0.75");
    run.wait_for("loud.gain is 0.75");
    // A line that is too long is passed over as a whole, whatever stands at its end.
    let long = format!("{}\nset loud.gain=0.75", "stop ".repeat(20_000));
    for (wrong, told) in [
        (&*long, "it is longer than 65536 bytes"),
        ("set loudnes=1", "no parameter `loudnes`"),
        ("set loud.gian=1", "did you mean `loud.gain`"),
        ("dance", "unknown command `dance`"),
    ] {
        run.type_line(wrong);
        run.wait_for(told);
    }
    run.wait_for_rows("seen.csv", 0.75, 1);
    run.stop();
    let heard = samples(&folder.path().join("out/loud.wav"));
    assert_eq!((heard[0], *heard.last().unwrap()), (0.25, 0.75));
    assert!(heard.contains(&0.5));
    // 20 ms for a quarter: 1/80 a frame.
    assert!(heard.windows(2).all(|pair| (0.0..0.013).contains(&(pair[1] - pair[0]))), "a jump");
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

#[cfg(unix)]
#[test]
fn a_graph_whose_name_is_no_text_leaves_its_files() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let name = std::ffi::OsStr::from_bytes(b"g\xff.ron");
    fs::write(folder.path().join(name), TONE).unwrap();
    let mut run = command(folder.path(), &["run", "--live", "--for", "0.1", "--out", "out"]);
    let output = run.arg(name).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(facts(&folder.path().join("out"))["graph"], "g\u{fffd}.ron");
}

#[test]
fn what_is_said_of_signals_that_are_no_numbers_stands_in_the_facts_and_on_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let graph = r#"Graph(format: 1, clocks: { "c": Driver(rate_hz: 1000) }, nodes: {
        "large": Constant(clock: "c", value: 1e308, quantity: "current"),
        "larger": Gain(input: "large", gain: 1e9),
        "out": ActuatorSink(current: "larger", endpoint: "a", limit: (peak_a: 1, continuous_a: 1)),
    }, endpoints: { "simulated": { "a": SimulatedHaptuator() } })"#;
    fs::write(folder.path().join("g.ron"), graph).unwrap();
    for live in [&[][..], &["--live", "--endpoints", "simulated"]] {
        let run = ["run", "g.ron", "--for", "0.2", "--out", "out"];
        let told = succeed(folder.path(), &[&run[..], live].concat());
        let told = String::from_utf8_lossy(&told.stderr).into_owned();
        let faults = facts(&folder.path().join("out"))["faults"][0].clone();
        let ticks = faults["ticks"].as_u64().unwrap();
        assert!(ticks > 0 && told.contains(&format!("{ticks} ticks")), "{faults}, {told}");
        assert_eq!(faults["origin"], "larger");
        let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
        assert!(page.contains(&format!("origin larger, ticks {ticks}")));
    }
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
        assert_eq!((&facts["driver_frames"], &facts["stopped"]), (&300.into(), &false.into()));
        let warnings = facts["warnings"].to_string();
        assert!(warnings.contains("`felt`") && told.contains("`felt`"), "{warnings}");
        let kept = fs::read_to_string(folder.path().join("out/y.csv")).unwrap();
        let last = kept.lines().last().unwrap().rsplit(',').next().unwrap();
        assert_eq!((kept.lines().count(), last.parse::<f64>().unwrap()), (301, 299.0));
    }
}

#[cfg(all(target_os = "linux", not(feature = "soundcard")))]
#[test]
fn without_soundcards_a_live_run_says_what_to_install() {
    let folder = tempfile::tempdir().unwrap();
    let graph = shipped("texturepad.ron");
    let endpoints = ["--endpoints", "soundcard"];
    succeed(folder.path(), &[&["check", &graph], &endpoints[..]].concat());
    let arguments = [&["run", &graph, "--live", "--for", "0.1", "--out", "o"], &endpoints[..]].concat();
    let output = command(folder.path(), &arguments).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && told.contains("libasound2-dev"), "{told}");
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
    let offline = ["run", "felt.ron", "--endpoints", "live", "--for", "0.1", "--out", "o"];
    let told = succeed(folder.path(), &offline);
    let told = String::from_utf8_lossy(&told.stderr).into_owned();
    assert!(told.contains("warning: `tool` (SoundcardAccelerometer)"), "{told}");
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
        (&["--endpoints", "live"][..], "`tool` (UdpDevice) delivers data only in"),
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
    let output = command(folder.path(), &["run", "felt.ron", "--live", "--for", "0.1"]).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && told.contains("libasound2-dev"), "{told}");
}

#[test]
fn the_texturepad_by_soundcard_takes_less_than_ten_milliseconds() {
    let folder = tempfile::tempdir().unwrap();
    let graph = shipped("texturepad.ron");
    let told = succeed(folder.path(), &["check", &graph, "--endpoints", "live"]);
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    let line = told.lines().find(|line| line.starts_with("latency stylus -> out:")).unwrap();
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

/// The sound of a run's page, from -1 to 1: 16-bit samples in a WAV file in base 64.
#[cfg(all(target_os = "linux", feature = "soundcard"))]
fn sound_of_page(run: &Path) -> Vec<f32> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let page = fs::read_to_string(run.join("report.html")).unwrap();
    let (_, wav) = page.split_once("data:audio/wav;base64,").unwrap();
    let (wav, _) = wav.split_once('"').unwrap();
    let digit = |letter: u8| LETTERS.iter().position(|known| *known == letter).unwrap_or(0) as u32;
    let bytes: Vec<u8> = { wav.as_bytes().as_chunks().0.iter() }
        .map(|four: &[u8; 4]| four.iter().fold(0, |sum, letter| sum << 6 | digit(*letter)))
        .flat_map(|three| <[u8; 3]>::try_from(&three.to_be_bytes()[1..]).unwrap())
        .collect();
    let size = bytes[40..44].try_into().map(u32::from_le_bytes).unwrap() as usize;
    let samples = bytes[44..44 + size].as_chunks().0.iter();
    samples.map(|two| f32::from(i16::from_le_bytes(*two)) / 32767.0).collect()
}

/// Whether samples are those of a page, which are rounded to 16 bits.
#[cfg(all(target_os = "linux", feature = "soundcard"))]
fn is_as_on_page(heard: &[f32], page: &[f32]) -> bool {
    let is_near = |(heard, page): (&f32, &f32)| (heard - page).abs() < 0.51 / 32767.0;
    heard.len() == page.len() && heard.iter().zip(page).all(is_near)
}

/// Time stands still for the run in a stall; what is recorded jumps there.
#[cfg(unix)]
#[test]
fn a_stall_is_marked_where_it_stands_in_the_files() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tone.ron"), TONE).unwrap();
    let mut run = Running::start(folder.path(), &["run", "tone.ron", "--live", "--out", "out"]);
    run.wait_for_more_rows("seen.csv");
    let signal = |name: &str| {
        let id = run.child.id().to_string();
        assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
    };
    signal("-STOP");
    std::thread::sleep(Duration::from_millis(300));
    signal("-CONT");
    run.wait_for_more_rows("seen.csv");
    let told = run.stop();
    let facts = facts(&folder.path().join("out"));
    let at_s: Vec<f64> = serde_json::from_value(facts["stalled_at_s"].clone()).unwrap();
    let seconds = facts["seconds"].as_f64().unwrap();
    assert_eq!(at_s.len() as u64, facts["stalls"].as_u64().unwrap());
    assert!(at_s.iter().all(|at_s| (0.0..seconds).contains(at_s)), "{at_s:?} of {seconds} s");
    assert!(told.contains(&format!("jump at {:.3} s", at_s[0])), "{told}");
}

/// Takes a minute of real time.
#[test]
#[ignore = "takes a minute"]
fn in_a_minute_no_time_is_lost_that_is_not_reported() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tone.ron"), TONE).unwrap();
    succeed(folder.path(), &["run", "tone.ron", "--live", "--for", "60", "--out", "out"]);
    let facts = facts(&folder.path().join("out"));
    assert_eq!(samples(&folder.path().join("out/loud.wav")).len(), 60_000);
    assert_eq!(facts["lost_numbers"], 0);
    let lost_s = facts["lost_wakes"].as_f64().unwrap() / 1000.0;
    let over_s = facts["took_s"].as_f64().unwrap() - 60.0;
    // Starting, stopping and completing the files take a while too.
    assert!(over_s - lost_s < 1.0, "{over_s} s too long, {lost_s} s of them reported");
}
