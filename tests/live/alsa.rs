//! ALSA's file plug-in: what a card would get, and give, in files.

use super::*;

fn config(folder: &Path) -> PathBuf {
    let (config, raw) = (folder.join("asound.conf"), folder.join("heard.raw"));
    let text = format!(
        "pcm.!default {{ type file slave.pcm {{ type null }} file \"{}\" format raw perm 0644 }}\n",
        raw.display()
    );
    fs::write(&config, text).unwrap();
    config
}

fn live(folder: &Path, name: &str, more: &[&str]) -> Option<String> {
    let graph = shipped("texturepad.ron");
    let common = ["run", &graph, "--live", "--endpoints", "soundcard", "--for", "0.5", "--out", name];
    let arguments = [&common[..], more].concat();
    let output = command(folder, &arguments).env("ALSA_CONFIG_PATH", config(folder)).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    if told.contains("there is no soundcard") || told.contains("Unknown PCM") {
        skip(&format!("ALSA's file plug-in is not there: {told}"));
        return None;
    }
    assert!(output.status.success(), "{told}");
    Some(told)
}

#[test]
fn what_arrives_equals_the_offline_rendering() {
    let folder = tempfile::tempdir().unwrap();
    let Some(told) = live(folder.path(), "live", &[]) else {
        return;
    };
    assert!(told.contains("buffers of 64 frames (64 requested)"), "{told}");
    let graph = shipped("texturepad.ron");
    let offline = ["run", &graph, "--for", "0.5", "--endpoints", "soundcard", "--out", "offline"];
    succeed(folder.path(), &offline);
    let rendered = samples(&folder.path().join("offline/haptuator.soundcard.wav"));
    assert_eq!(rendered.len(), 24_000);
    assert!(rendered.iter().any(|x| x.abs() > 1e-3), "silence");
    let facts = facts(&folder.path().join("live"));
    assert_eq!((&facts["xruns"]["count"], &facts["driver_frames"]), (&0.into(), &24_000.into()));
    let raw = fs::read(folder.path().join("heard.raw")).unwrap();
    let channels = raw_channels(&told);
    let heard = raw.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
    let heard: Vec<f32> = heard.step_by(channels).collect();
    // The plug-in has no buffer of its own: the declared latency is all in the card that is not there.
    assert!(heard[..24_000] == rendered[..], "not what was rendered");
    // After the end a ramp of 10 ms, and silence.
    let ramp: Vec<f32> = heard[24_000..24_480].iter().map(|x| x.abs()).collect();
    assert!(ramp.windows(2).all(|pair| pair[1] <= pair[0]), "{ramp:?}");
    assert!(heard[24_480..].iter().all(|x| *x == 0.0));
}

#[test]
fn play_plays_the_sound_of_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let graph = shipped("texturepad.ron");
    let run = ["run", &graph, "--for", "0.5", "--out", "out", "--play"];
    let output =
        command(folder.path(), &run).env("ALSA_CONFIG_PATH", config(folder.path())).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    if told.contains("there is no soundcard") || told.contains("Unknown PCM") {
        return skip(&format!("ALSA's file plug-in is not there: {told}"));
    }
    assert!(output.status.success(), "{told}");
    assert!(told.contains("playing 0.5 s of out.delivered, its highest peak at -12 dBFS"), "{told}");
    let page = sound_of_page(&folder.path().join("out"));
    assert_eq!(page.len(), 24_000);
    let raw = fs::read(folder.path().join("heard.raw")).unwrap();
    // One channel is enough, and the plug-in has it.
    let heard: Vec<f32> = { raw.as_chunks().0.iter() }.map(|bytes| f32::from_le_bytes(*bytes)).collect();
    assert!(is_as_on_page(&heard[..24_000], &page), "not what the page plays");
    let peak = heard.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
    assert!((20.0 * peak.log10() + 12.0).abs() < 0.001, "{peak}");
    assert!(heard[24_000..].iter().all(|x| *x == 0.0), "it goes on");
}

fn raw_channels(told: &str) -> usize {
    let before = told.split(" channels").next().unwrap();
    before.rsplit(' ').next().unwrap().parse().unwrap()
}

/// Nothing paces the plug-in, so that the card runs far ahead of the timer: the worst that can come of two clocks.
#[test]
fn a_card_and_a_timer_are_repeated_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let graph = shipped("two-drivers.ron");
    let common = ["run", &graph, "--endpoints", "soundcard"];
    let arguments = [&common[..], &["--live", "--for", "0.5", "--out", "live"]].concat();
    let output =
        command(folder.path(), &arguments).env("ALSA_CONFIG_PATH", config(folder.path())).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    if told.contains("there is no soundcard") || told.contains("Unknown PCM") {
        skip(&format!("ALSA's file plug-in is not there: {told}"));
        return;
    }
    assert!(output.status.success(), "{told}");
    assert!(told.contains("audio by soundcard") && told.contains("servo by a timer"), "{told}");
    succeed(folder.path(), &[&common[..], &["--replay", "live", "--out", "replay"]].concat());
    for file in ["texture.wav", "hand.csv", "crossed.csv", "haptuator.soundcard.wav"] {
        let of = |run: &str| fs::read(folder.path().join(run).join(file)).unwrap();
        assert!(of("live") == of("replay"), "{file}");
    }
}

#[test]
fn a_card_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let graph = fs::read_to_string(shipped("texturepad.ron")).unwrap();
    let graph = graph
        .replace("amperes_full_scale: 1.0", "amperes_full_scale: 1.0, device: \"nosuch\"")
        .replace("\"surfaces/", &format!("\"{}/", shipped("surfaces")));
    fs::write(folder.path().join("g.ron"), graph).unwrap();
    let run = ["run", "g.ron", "--live", "--endpoints", "soundcard", "--for", "0.1"];
    let output =
        command(folder.path(), &run).env("ALSA_CONFIG_PATH", config(folder.path())).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("there is no soundcard `nosuch`"), "{told}");
}

/// A graph that keeps what is on the second channel of a card whose samples have one form.
fn listening(format: &str) -> String {
    let graph = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 48000) },
        nodes: {
            "felt": Accelerometer(clock: "servo", endpoint: "tool"),
            "kept": WavSink(input: "felt", file: "felt.wav", full_scale: 1),
        },
        endpoints: { "live": { "tool": SoundcardAccelerometer(
            m_s2_full_scale: 50.0, channel: 2, buffer_frames: 256, format: FORM, latency_ms: 100,
        ) } })"#;
    graph.replace("FORM", format)
}

/// Feeds a pipe with frames of two samples, a quarter and half of full scale, as fast as a card at 48 kHz would, until
/// nobody reads them.
fn feed(pipe: PathBuf, quarter_and_half: [Vec<u8>; 2]) -> std::thread::JoinHandle<()> {
    std::thread::spawn(move || {
        let mut file = fs::File::options().write(true).open(pipe).unwrap();
        let buffer = quarter_and_half.concat().repeat(480);
        let start = Instant::now();
        for ten_ms in 1.. {
            if file.write_all(&buffer).is_err() {
                return;
            }
            // In the time of a card.
            let due = Duration::from_millis(10) * ten_ms;
            std::thread::sleep(due.saturating_sub(start.elapsed()));
        }
    })
}

#[test]
fn every_form_of_samples_is_heard_calibrated() {
    let of = |sample: fn(f64) -> Vec<u8>| [sample(0.25), sample(0.5)];
    let forms = [
        ("Float", of(|x| (x as f32).to_le_bytes().into())),
        ("Bits32", of(|x| ((x * 2.0_f64.powi(31)) as i32).to_le_bytes().into())),
        // In four bytes each.
        ("Bits24", of(|x| ((x * 2.0_f64.powi(23)) as i32).to_le_bytes().into())),
        ("Bits16", of(|x| ((x * 2.0_f64.powi(15)) as i16).to_le_bytes().into())),
    ];
    for (form, samples_of) in forms {
        let folder = tempfile::tempdir().unwrap();
        let (config, pipe) = (folder.path().join("asound.conf"), folder.path().join("pipe"));
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let text = format!(
            "pcm.!default {{ type file slave.pcm {{ type null }} file \"/dev/null\" infile \"{}\" format raw }}\n",
            pipe.display()
        );
        fs::write(&config, text).unwrap();
        fs::write(folder.path().join("g.ron"), listening(form)).unwrap();
        let feeding = feed(pipe.clone(), samples_of);
        let output = command(folder.path(), &["run", "g.ron", "--live", "--for", "0.6", "--out", "out"])
            .env("ALSA_CONFIG_PATH", config)
            .output()
            .unwrap();
        // Where the card was never opened, the pipe still waits for a reader.
        drop(fs::File::options().read(true).write(true).open(&pipe));
        feeding.join().unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        if told.contains("there is no soundcard") || told.contains("Unknown PCM") {
            skip(&format!("ALSA's file plug-in is not there: {told}"));
            return;
        }
        assert!(output.status.success(), "{form}: {told}");
        assert!(told.contains("2 channels"), "{told}");
        let heard = samples(&folder.path().join("out/felt.wav"));
        let highest = heard.iter().fold(0.0_f32, |most, x| most.max(*x));
        let settled = heard.iter().filter(|x| (**x - 25.0).abs() < 0.01).count();
        assert!((highest - 25.0).abs() < 0.01 && settled > 2400, "{form}: {highest}, {settled}");
    }
}

/// Nobody arms it: a card that the studio drives plays zeros, whatever the graph asks for.
#[test]
fn a_card_of_the_studio_is_silent_until_it_is_armed() {
    let folder = tempfile::tempdir().unwrap();
    let graph = r#"Graph(format: 1, clocks: { "audio": Driver(rate_hz: 48000) }, nodes: {
        "one": Constant(clock: "audio", value: 0.5, quantity: "current"),
        "out": ActuatorSink(current: "one", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
    }, endpoints: { "live": { "coil": Soundcard(amperes_full_scale: 1.0, buffer_frames: 64) } })"#;
    fs::write(folder.path().join("g.ron"), graph).unwrap();
    let (said, warned) = (folder.path().join("said"), folder.path().join("warned"));
    let mut child = command(folder.path(), &["studio", "g.ron", "--live", "--no-open"])
        .env("ALSA_CONFIG_PATH", config(folder.path()))
        .stdout(fs::File::create(&said).unwrap())
        .stderr(fs::File::create(&warned).unwrap())
        .spawn()
        .unwrap();
    let raw = folder.path().join("heard.raw");
    let start = Instant::now();
    // A second of two channels at least, and what it says after it has opened the card.
    let says = || fs::read_to_string(&said).unwrap().contains("until armed on the page: `coil`");
    while fs::metadata(&raw).map_or(0, |raw| raw.len()) < 400_000 || !says() {
        if child.try_wait().unwrap().is_some() {
            let told = fs::read_to_string(&warned).unwrap();
            assert!(told.contains("there is no soundcard") || told.contains("Unknown PCM"), "{told}");
            return skip(&format!("ALSA's file plug-in is not there: {told}"));
        }
        assert!(start.elapsed() < Duration::from_secs(60), "it plays nothing");
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(fs::read(&raw).unwrap().iter().all(|byte| *byte == 0));
}
