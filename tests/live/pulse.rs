//! A sound daemon with a sink that plays to nobody in real time; what it plays is heard at its monitor.

use super::*;

/// No two stretches of it are the same. The buffers outlast the daemon's own pauses, which a run cannot know of.
const NOISE: &str = r#"Graph(format: 1, clocks: { "audio": Driver(rate_hz: 48000) },
    nodes: {
        "noise": Noise(clock: "audio", variance: 0.04, quantity: "current"),
        "out": ActuatorSink(current: "noise", endpoint: "haptuator", limit: (peak_a: 1, continuous_a: 1)),
    },
    endpoints: {
        "simulated": { "haptuator": SimulatedHaptuator() },
        "live": { "haptuator": Soundcard(amperes_full_scale: 1.0, buffer_frames: 2048) },
    })"#;

/// A process that ends with the test.
struct Ours(Child);

impl Drop for Ours {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A home with a sound daemon, and ALSA's way to it.
struct Home {
    daemon: Option<Ours>,
    folder: tempfile::TempDir,
}

impl Home {
    /// None where the daemon is not installed.
    fn new() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mut home = Self { daemon: None, folder };
        home.open_the_way();
        let there = home.start_daemon();
        if !there {
            skip("there is no pulseaudio here");
        }
        there.then_some(home)
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    fn config(&self) -> PathBuf {
        self.path().join("asound.conf")
    }

    /// Lets ALSA find the daemon.
    fn open_the_way(&self) {
        fs::write(self.config(), "pcm.!default { type pulse }\n").unwrap();
    }

    /// A program that finds the daemon.
    fn program(&self, name: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new(name);
        command
            .envs([("HOME", self.path()), ("XDG_RUNTIME_DIR", self.path())])
            .env("PULSE_SERVER", format!("unix:{}", self.path().join("native").display()))
            .env("ALSA_CONFIG_PATH", self.config())
            .current_dir(self.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        command
    }

    fn haptograph(&self, arguments: &[&str]) -> Command {
        let mut command = self.program(env!("CARGO_BIN_EXE_haptograph"));
        command.args(arguments);
        command
    }

    /// What a run told that went well; none where it could not reach the daemon.
    fn run(&self, arguments: &[&str]) -> Option<String> {
        let mut command = self.haptograph(arguments);
        let output = command.stderr(Stdio::piped()).output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        if is_without_plug(&told) {
            return None;
        }
        assert!(output.status.success(), "{told}");
        Some(told)
    }

    /// False where it is not installed.
    fn start_daemon(&mut self) -> bool {
        let socket = self.path().join("native");
        let _ = fs::remove_file(&socket);
        let child = self
            .program("pulseaudio")
            .args(["-n", "--daemonize=no", "--use-pid-file=no", "--exit-idle-time=-1"])
            .args(["--disable-shm=yes", "--realtime=no", "--high-priority=no", "-L"])
            .arg(format!("module-native-protocol-unix socket={} auth-anonymous=1", socket.display()))
            .args(["-L", "module-null-sink sink_name=hap norewinds=1 rate=48000 channels=2 format=float32le"])
            .spawn();
        self.daemon = child.ok().map(Ours);
        let start = Instant::now();
        while self.daemon.is_some() && !socket.exists() {
            assert!(start.elapsed() < Duration::from_secs(60), "the sound daemon does not answer");
            std::thread::sleep(Duration::from_millis(50));
        }
        self.daemon.is_some()
    }

    /// Records what the daemon plays, from now on.
    fn record(&self) -> Recorder {
        let file = self.path().join("heard.raw");
        let recorder = self
            .program("parec")
            .args(["--device=hap.monitor", "--format=float32le", "--rate=48000", "--channels=2"])
            .args(["--raw", "--latency-msec=20"])
            .stdout(fs::File::create(&file).unwrap())
            .spawn();
        // It comes with the daemon.
        let recorder = Recorder { _process: Ours(recorder.unwrap()), file };
        let begun = Instant::now();
        while fs::metadata(&recorder.file).unwrap().len() == 0 {
            assert!(begun.elapsed() < Duration::from_secs(60), "nothing is recorded");
            std::thread::sleep(Duration::from_millis(50));
        }
        recorder
    }
}

struct Recorder {
    _process: Ours,
    file: PathBuf,
}

impl Recorder {
    /// The first channel so far.
    fn heard(&self) -> Vec<f32> {
        let first = |frame: &[u8; 8]| f32::from_le_bytes([frame[0], frame[1], frame[2], frame[3]]);
        fs::read(&self.file).unwrap().as_chunks().0.iter().map(first).collect()
    }

    /// Waits until what was recorded is as it should be.
    fn wait_until(&self, is_it: impl Fn(&[f32]) -> bool) {
        let start = Instant::now();
        while !is_it(&self.heard()) {
            assert!(start.elapsed() < Duration::from_secs(60), "it is not recorded");
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Waits until this many samples are no silence.
    fn wait_for_sound(&self, count: usize) {
        self.wait_until(|heard| heard.iter().filter(|x| **x != 0.0).count() >= count);
    }

    /// The first channel, with what was still on its way through the daemon: until it has played nothing for a second.
    fn finish(self) -> Vec<f32> {
        let at_least = self.heard().len() + 48_000;
        self.wait_until(|heard| {
            heard.len() >= at_least && heard.iter().rev().take(48_000).all(|x| *x == 0.0)
        });
        self.heard()
    }
}

/// Whether ALSA's plug-in for the daemon is missing.
fn is_without_plug(told: &str) -> bool {
    let missing = told.contains("Cannot open shared library") || told.contains("no such soundcard");
    if missing {
        skip(&format!("ALSA's plug-in for the daemon is not here: {told}"));
    }
    missing
}

/// How often `heard` leaves `played` and comes back to it, both from the first sample that is not zero on.
fn gaps(heard: &[f32], played: &[f32]) -> usize {
    const WORD: usize = 64;
    let sounds = |x: &f32| *x != 0.0;
    let (Some(mut at), Some(mut wanted)) = (heard.iter().position(sounds), played.iter().position(sounds))
    else {
        panic!("nothing was heard or nothing was played");
    };
    let mut gaps = 0;
    loop {
        let same = heard[at..].iter().zip(&played[wanted..]).take_while(|(a, b)| a == b).count();
        (at, wanted) = (at + same, wanted + same);
        if at + WORD > heard.len() || wanted + WORD > played.len() {
            return gaps;
        }
        gaps += 1;
        // The next word that is not silence, where it is in what was played from here on.
        let back = heard[at..].windows(WORD).enumerate().find_map(|(skipped, word)| {
            let here = played[wanted..].windows(WORD).take(96_000);
            let found = || here.clone().position(|there| there == word);
            word.iter().all(sounds).then(found).flatten().map(|lost| (skipped, lost))
        });
        let Some((skipped, lost)) = back else {
            return gaps + 1;
        };
        (at, wanted) = (at + skipped, wanted + lost);
    }
}

#[test]
fn gaps_are_counted() {
    let played: Vec<f32> = (1..10_000).map(|k| ((k * k) % 7919 + 1) as f32).collect();
    let silence = vec![0.0; 300];
    let heard =
        [&silence[..], &played[..2000], &silence, &played[2100..6000], &played[6500..], &silence].concat();
    assert_eq!(gaps(&[&silence[..], &played].concat(), &played), 0);
    assert_eq!(gaps(&heard, &played), 2);
}

/// The machine stands still, and the daemon with it: it runs dry, and who records it misses some.
const GAPS_OF_A_STALL: u64 = 2;

/// Callbacks that came nearly a buffer late, at most: that is how a run reports that the machine stood still.
fn late_callbacks(facts: &serde_json::Value) -> u64 {
    let late = &facts["late_us"];
    let is_late = |quantile: &str| late[quantile].as_f64().unwrap() > 40_000.0;
    let wakes = facts["wakes"].as_u64().unwrap();
    let beyond = [("p50", 1), ("p99", 2), ("p99.9", 100), ("max", 1000)];
    let first = beyond.into_iter().find(|(quantile, _)| is_late(quantile));
    first.map_or(0, |(_, part)| wakes.div_ceil(part))
}

#[test]
fn late_callbacks_are_bounded() {
    let of = |p99: f64, max: f64| {
        let late = serde_json::json!({ "p50": 10.0, "p99": p99, "p99.9": p99, "max": max });
        late_callbacks(&serde_json::json!({ "wakes": 1406, "late_us": late }))
    };
    assert_eq!([of(20.0, 30.0), of(20.0, 50_000.0), of(41_000.0, 50_000.0)], [0, 2, 703]);
}

fn play(seconds: u32) {
    let Some(home) = Home::new() else { return };
    let recorder = home.record();
    fs::write(home.path().join("noise.ron"), NOISE).unwrap();
    let seconds = seconds.to_string();
    let arguments = ["run", "noise.ron", "--live", "--for", &seconds, "--out", "out"];
    if home.run(&arguments).is_none() {
        return;
    }
    let (heard, home) = (recorder.finish(), home.path());
    let played = samples(&home.join("out/haptuator.soundcard.wav"));
    let facts = facts(&home.join("out"));
    let counted = |value: &serde_json::Value| value.as_u64().unwrap();
    let reported =
        counted(&facts["xruns"]["count"]) + counted(&facts["overruns"]) + counted(&facts["stalls"]);
    let gaps = gaps(&heard, &played) as u64;
    // All of it was heard, but for gaps.
    assert!(heard.len() >= played.len() / 10 * 9, "{} of {} samples", heard.len(), played.len());
    let stood_still = late_callbacks(&facts);
    let count = played.len();
    println!(
        "{count} samples played, {gaps} gaps, {reported} reported, at most {stood_still} callbacks late"
    );
    assert!(gaps <= reported + GAPS_OF_A_STALL * stood_still, "{gaps} gaps: {facts:#}");
}

#[test]
#[ignore = "a busy machine lets the daemon run dry, which only the daemon knows"]
fn for_a_minute_a_daemon_hears_what_is_played_but_for_gaps_that_are_reported() {
    play(60);
}

#[test]
#[ignore = "takes ten minutes"]
fn for_ten_minutes_a_daemon_hears_what_is_played_but_for_gaps_that_are_reported() {
    play(600);
}

/// What a sine of `tone_hz` in samples at 48 kHz is: its amplitude, and what is left without it (root mean square).
fn sine_in(samples: &[f32], tone_hz: f64) -> (f64, f64) {
    let turned = |k: usize| std::f64::consts::TAU * tone_hz * k as f64 / 48_000.0;
    let share = 2.0 / samples.len() as f64;
    let all = || samples.iter().enumerate().map(|(k, x)| (turned(k), f64::from(*x)));
    let s: f64 = all().map(|(turned, x)| share * x * turned.sin()).sum();
    let c: f64 = all().map(|(turned, x)| share * x * turned.cos()).sum();
    let left = all().map(|(turned, x)| (x - s * turned.sin() - c * turned.cos()).powi(2));
    (s.hypot(c), (left.sum::<f64>() * share / 2.0).sqrt())
}

/// A tone that goes out by one endpoint and comes back by another: an accelerometer that is the amplifier itself.
const LOOP: &str = r#"Graph(format: 1, clocks: { "audio": Driver(rate_hz: 48000) },
    nodes: {
        "tone": Sine(clock: "audio", frequency_hz: 200, amplitude: 0.6, quantity: "current"),
        "out": ActuatorSink(current: "tone", endpoint: "haptuator", limit: (peak_a: 1, continuous_a: 1)),
        "felt": Accelerometer(clock: "audio", endpoint: "haptuator"),
        "kept": WavSink(input: "felt", file: "felt.wav", full_scale: 1),
        "echo": Calibrate(input: "felt", from: "acceleration", to: "current", factor: 0.01),
        "shake": ActuatorSink(current: "echo", endpoint: "shaker", limit: (peak_a: 1, continuous_a: 1)),
    },
    endpoints: {
        "simulated": { "haptuator": SimulatedHaptuator(), "shaker": SimulatedHaptuator() },
        "live": {
            "haptuator": SoundcardHaptuator(
                amperes_full_scale: 2.0, buffer_frames: 2048, channels: [2],
                accelerometer: (m_s2_full_scale: 50.0, buffer_frames: 2048, channel: 2, latency_ms: 200),
            ),
            "shaker": Soundcard(amperes_full_scale: 2.0, buffer_frames: 2048, channels: [1]),
        },
    })"#;

#[test]
fn what_one_endpoint_plays_another_hears() {
    let Some(home) = Home::new() else { return };
    fs::write(home.path().join("loop.ron"), LOOP).unwrap();
    // The same graph without hardware.
    let simulated = home.haptograph(&["run", "loop.ron", "--for", "0.1", "--out", "simulated"]).status();
    assert!(simulated.unwrap().success());
    let arguments = ["run", "loop.ron", "--live", "--for", "6", "--out", "out"];
    let Some(told) = home.run(&arguments) else { return };
    assert!(told.contains("listening to `haptuator` by soundcard"), "{told}");
    let facts = facts(&home.path().join("out"));
    let ring = &facts["rings"]["soundcard to haptuator"];
    assert!(ring["latency_ms"] == 200.0 && ring["fill_ms"].is_number(), "{facts:#}");
    assert!(told.contains("latency felt -> shake: transport "), "{told}");
    let latency = &facts["latencies_ms"]["felt to shake"];
    let at = |part: &str, quantile: &str| latency[part][quantile].as_f64().unwrap();
    assert!(at("age_when_read", "p50") > 20.0 && latency["held_by_the_graph"] == 0.0, "{latency:#}");
    assert!(at("transport", "p99") >= at("age_when_read", "p99") + at("until_played", "p50") - 0.01);
    let heard = samples(&home.path().join("out/felt.wav"));
    // 0.6 A of 2 A at full scale, of 50 m/s2 at full scale; not where the daemon or the machine stood still.
    let right = heard.chunks_exact(4800).filter(|part| {
        let (amplitude, left) = sine_in(part, 200.0);
        (amplitude / 15.0 - 1.0).abs() < 1e-3 && left < 0.015
    });
    let (right, all) = (right.count(), heard.len() / 4800);
    println!("{right} of {all} tenths of a second are the tone that was played");
    assert!(right >= all / 3, "{right} of {all}: {facts:#}");
}

/// Where the parts of a sound begin that are heard whole, of 50 ms each.
fn parts_heard(heard: &[f32], page: &[f32]) -> Vec<Option<usize>> {
    let parts = page.chunks_exact(2400);
    parts.map(|part| { heard.windows(2400) }.position(|heard| is_as_on_page(heard, part))).collect()
}

#[test]
fn a_daemon_hears_all_that_play_plays() {
    let Some(home) = Home::new() else { return };
    let recorder = home.record();
    let graph = shipped("texturepad.ron");
    let Some(told) = home.run(&["run", &graph, "--for", "3", "--out", "out", "--play"]) else {
        return;
    };
    assert!(told.contains("playing 3.0 s of out.delivered"), "{told}");
    let heard = recorder.finish();
    let page = sound_of_page(&home.path().join("out"));
    let parts = parts_heard(&heard, &page);
    // The first and the last are neither late nor cut off; between them a busy machine may let the daemon run dry.
    let (first, last) = (parts[0], *parts.last().unwrap());
    let whole = parts.iter().flatten().count();
    println!("{whole} of {} parts of 50 ms are what the page plays", parts.len());
    assert!(first.is_some() && last.is_some(), "{parts:?}");
    assert!(whole >= parts.len() / 3, "{parts:?}");
}

#[test]
fn a_sound_that_is_stopped_by_ctrl_c_ends_soon_and_without_a_click() {
    let Some(home) = Home::new() else { return };
    let recorder = home.record();
    let graph = shipped("texturepad.ron");
    let said = home.path().join("said");
    let mut command = home.haptograph(&["run", &graph, "--for", "10", "--out", "out", "--play"]);
    let playing = command.stderr(fs::File::create(&said).unwrap()).spawn();
    let mut playing = Ours(playing.unwrap());
    let start = Instant::now();
    while !fs::read_to_string(&said).unwrap().contains("playing 10.0 s") {
        let ended = playing.0.try_wait().unwrap().is_some();
        let told = fs::read_to_string(&said).unwrap();
        if ended && is_without_plug(&told) {
            return;
        }
        assert!(!ended && start.elapsed() < Duration::from_secs(60), "{told}");
        std::thread::sleep(Duration::from_millis(20));
    }
    recorder.wait_for_sound(48_000);
    let interrupt = Command::new("kill").arg("-INT").arg(playing.0.id().to_string()).status();
    assert!(interrupt.unwrap().success());
    assert!(playing.0.wait().unwrap().success());
    let heard = recorder.finish();
    let last = heard.iter().rposition(|x| *x != 0.0).unwrap();
    let first = heard.iter().position(|x| *x != 0.0).unwrap();
    assert!(last - first < 6 * 48_000, "{} samples of 10 s", last - first);
    // A fade of 10 ms, whose last samples are nearly nothing.
    let end = heard[last - 48..=last].iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    assert!(end < 0.02, "it ends at {end}");
}

/// A current that does not change.
const STEADY: &str = r#"Graph(format: 1, clocks: { "audio": Driver(rate_hz: 48000) },
    nodes: {
        "half": Constant(clock: "audio", value: 0.5, quantity: "current"),
        "out": ActuatorSink(current: "half", endpoint: "haptuator", limit: (peak_a: 1, continuous_a: 1)),
    },
    endpoints: { "live": { "haptuator": Soundcard(amperes_full_scale: 1.0, buffer_frames: 2048) } })"#;

#[test]
fn a_card_that_vanishes_is_waited_for_and_its_actuator_rises_from_nothing() {
    let Some(mut home) = Home::new() else { return };
    fs::write(home.path().join("steady.ron"), STEADY).unwrap();
    let mut run = Running::of(home.haptograph(&["run", "steady.ron", "--live", "--out", "out"]), home.path());
    if is_without_plug(&run.said()) {
        return;
    }
    run.wait_for("1 s: late");
    // Nobody finds the daemon again before what it plays is recorded.
    fs::remove_file(home.config()).unwrap();
    home.daemon = None;
    run.wait_for("soundcard default is gone; the run waits until it is back");
    assert!(home.start_daemon());
    let recorder = home.record();
    home.open_the_way();
    run.wait_for("soundcard default is back");
    recorder.wait_for_sound(4800);
    run.stop();
    let heard = recorder.finish();
    let first = heard.iter().position(|x| *x != 0.0).unwrap();
    let risen = first + 480;
    let rise = heard[first - 1..risen].windows(2);
    assert!(
        rise.into_iter().all(|pair| (0.0..0.5 / 480.0 * 1.01).contains(&(pair[1] - pair[0]))),
        "{:?}",
        &heard[first..risen]
    );
    assert_eq!(heard[risen], 0.5);
    assert!(facts(&home.path().join("out"))["vanished"].as_u64().unwrap() >= 1);
}

/// What a sensor says, kept by a timer.
const KEPT: &str = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 8000) },
    nodes: {
        "line": SoundcardSource(clock: "servo", endpoint: "line"),
        "kept": WavSink(input: "line", file: "line.wav", full_scale: 1),
        "seen": CsvSink(inputs: ["line"], file: "seen.csv"),
    },
    endpoints: { "live": {
        "line": SoundcardInput(volts_full_scale: 4.0, rate_hz: 48000, buffer_frames: 1024, latency_ms: 100),
    } })"#;

#[test]
fn an_input_that_vanishes_is_nothing_until_it_is_back() {
    let Some(mut home) = Home::new() else { return };
    fs::write(home.path().join("kept.ron"), KEPT).unwrap();
    let half = 0.5_f32.to_le_bytes();
    fs::write(home.path().join("half.raw"), half.repeat(48_000 * 60)).unwrap();
    let play = |home: &Home| {
        let arguments = ["--raw", "--format=float32le", "--rate=48000", "--channels=1", "half.raw"];
        Ours(home.program("pacat").args(arguments).spawn().unwrap())
    };
    let playing = play(&home);
    let mut run = Running::of(home.haptograph(&["run", "kept.ron", "--live", "--out", "out"]), home.path());
    if is_without_plug(&run.said()) {
        return;
    }
    // A tenth of a second in which each level is asserted below.
    run.wait_for_rows("seen.csv", 2.0, 1600);
    drop(playing);
    home.daemon = None;
    run.wait_for("soundcard default is gone; its inputs are silent until it is back");
    run.wait_for_rows("seen.csv", 0.0, 1600);
    assert!(home.start_daemon());
    let playing = play(&home);
    run.wait_for("soundcard default is back");
    run.wait_for_rows("seen.csv", 2.0, 1600);
    run.stop();
    drop(playing);
    let line = samples(&home.path().join("out/line.wav"));
    // 2 V, nothing, 2 V again: no other level for long.
    let mut levels: Vec<f32> = Vec::new();
    for part in line.chunks_exact(800) {
        let level = part[0];
        if part.iter().all(|x| (x - level).abs() < 1e-3)
            && levels.last().is_none_or(|last| (last - level).abs() > 0.1)
        {
            levels.push((level * 100.0).round() / 100.0);
        }
    }
    assert!(levels.windows(3).any(|three| three == [2.0, 0.0, 2.0]), "{levels:?}");
    let facts = facts(&home.path().join("out"));
    // More often where the machine is too busy for the daemon.
    assert!(facts["inputs"]["line"]["vanished"].as_u64().unwrap() >= 1);
    assert!(facts["rings"]["soundcard to line"]["underruns"].as_u64().unwrap() >= 1);
}
