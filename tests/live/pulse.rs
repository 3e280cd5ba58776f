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

struct Daemon(Child, tempfile::TempDir);

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn in_home(command: &mut Command, home: &Path) {
    command
        .envs([("HOME", home), ("XDG_RUNTIME_DIR", home)])
        .env("PULSE_SERVER", format!("unix:{}", home.join("native").display()))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
}

/// None where the daemon is not installed.
fn daemon() -> Option<Daemon> {
    let home = tempfile::tempdir().unwrap();
    let socket = home.path().join("native");
    let mut command = Command::new("pulseaudio");
    in_home(&mut command, home.path());
    let child = command
        .args(["-n", "--daemonize=no", "--use-pid-file=no", "--exit-idle-time=-1"])
        .args(["--disable-shm=yes", "--realtime=no", "--high-priority=no", "-L"])
        .arg(format!(
            "module-native-protocol-unix socket={} auth-anonymous=1",
            socket.display()
        ))
        .args([
            "-L",
            "module-null-sink sink_name=hap norewinds=1 rate=48000 channels=2 format=float32le",
        ])
        .spawn()
        .ok()?;
    let daemon = Daemon(child, home);
    let start = Instant::now();
    while !socket.exists() {
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "the sound daemon does not answer"
        );
        std::thread::sleep(Duration::from_millis(50));
    }
    Some(daemon)
}

/// How often `heard` leaves `played` and comes back to it, both from the first sample that is not zero on.
fn gaps(heard: &[f32], played: &[f32]) -> usize {
    const WORD: usize = 64;
    let sounds = |x: &f32| *x != 0.0;
    let (Some(mut at), Some(mut wanted)) =
        (heard.iter().position(sounds), played.iter().position(sounds))
    else {
        panic!("nothing was heard or nothing was played");
    };
    let mut gaps = 0;
    loop {
        let same = heard[at..]
            .iter()
            .zip(&played[wanted..])
            .take_while(|(a, b)| a == b)
            .count();
        (at, wanted) = (at + same, wanted + same);
        if at + WORD > heard.len() || wanted + WORD > played.len() {
            return gaps;
        }
        gaps += 1;
        // The next word that is not silence, where it is in what was played from here on.
        let back = heard[at..].windows(WORD).enumerate().find_map(|(skipped, word)| {
            let here = played[wanted..].windows(WORD).take(96_000);
            let found = || here.clone().position(|there| there == word);
            word.iter()
                .all(sounds)
                .then(found)
                .flatten()
                .map(|lost| (skipped, lost))
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
    let heard = [
        &silence[..],
        &played[..2000],
        &silence,
        &played[2100..6000],
        &played[6500..],
        &silence,
    ]
    .concat();
    assert_eq!(gaps(&[&silence[..], &played].concat(), &played), 0);
    assert_eq!(gaps(&heard, &played), 2);
}

fn play(seconds: u32) {
    let Some(daemon) = daemon() else {
        println!("skipped: there is no pulseaudio here");
        return;
    };
    let home = daemon.1.path();
    let heard_in = home.join("heard.raw");
    let mut recorder = Command::new("parec");
    in_home(&mut recorder, home);
    recorder
        .args([
            "--device=hap.monitor",
            "--format=float32le",
            "--rate=48000",
            "--channels=2",
        ])
        .args(["--raw", "--latency-msec=20"])
        .stdout(fs::File::create(&heard_in).unwrap());
    let Ok(recorder) = recorder.spawn() else {
        println!("skipped: there is no parec here");
        return;
    };
    let recorder = Daemon(recorder, tempfile::tempdir().unwrap());
    let begun = Instant::now();
    while fs::metadata(&heard_in).unwrap().len() == 0 {
        assert!(begun.elapsed() < Duration::from_secs(60), "nothing is recorded");
        std::thread::sleep(Duration::from_millis(50));
    }
    let config = home.join("asound.conf");
    fs::write(&config, "pcm.!default { type pulse }\n").unwrap();
    fs::write(home.join("noise.ron"), NOISE).unwrap();
    let seconds = seconds.to_string();
    let arguments = ["run", "noise.ron", "--live", "--for", &seconds, "--out", "out"];
    let mut run = command(home, &arguments);
    in_home(&mut run, home);
    let output = run
        .env("ALSA_CONFIG_PATH", &config)
        .stderr(Stdio::piped())
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    if told.contains("Cannot open shared library") || told.contains("no such soundcard") {
        println!("skipped: ALSA's plug-in for the daemon is not here: {told}");
        return;
    }
    assert!(output.status.success(), "{told}");
    // What is on its way through the daemon.
    std::thread::sleep(Duration::from_secs(2));
    drop(recorder);
    let heard: Vec<f32> = fs::read(&heard_in)
        .unwrap()
        .as_chunks()
        .0
        .iter()
        .map(|frame: &[u8; 8]| f32::from_le_bytes([frame[0], frame[1], frame[2], frame[3]]))
        .collect();
    let played = samples(&home.join("out/haptuator.soundcard.wav"));
    let facts = facts(&home.join("out"));
    let counted = |value: &serde_json::Value| value.as_u64().unwrap();
    let reported =
        counted(&facts["xruns"]["count"]) + counted(&facts["overruns"]) + counted(&facts["stalls"]);
    let gaps = gaps(&heard, &played) as u64;
    // All of it was heard, but for gaps.
    assert!(
        heard.len() >= played.len() / 10 * 9,
        "{} of {} samples",
        heard.len(),
        played.len()
    );
    // A callback that came so late says that the machine stood still, and the daemon with it.
    let late_ms = facts["late_us"]["max"].as_f64().unwrap() / 1e3;
    let count = played.len();
    println!("{count} samples played, {gaps} gaps, {reported} reported, {late_ms} ms late at most");
    assert!(gaps <= reported || late_ms > 40.0, "{gaps} gaps: {facts:#}");
}

#[test]
fn for_a_minute_a_daemon_hears_what_is_played_but_for_gaps_that_are_reported() {
    play(60);
}

#[test]
#[ignore = "takes ten minutes"]
fn for_ten_minutes_a_daemon_hears_what_is_played_but_for_gaps_that_are_reported() {
    play(600);
}
