//! Graphs that are saved while they run.

use super::*;

#[test]
fn a_graph_of_nothing_is_refused_while_another_runs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tone.ron");
    fs::write(&path, TONE).unwrap();
    let arguments = ["run", "tone.ron", "--live", "--watch", "--out", "out"];
    let mut run = Running::start(folder.path(), &arguments);
    fs::write(&path, "Graph(format: 1, nodes: {})").unwrap();
    run.wait_for("E0506");
    run.wait_for("the running graph is unchanged");
    run.stop();
    assert!(!samples(&folder.path().join("out/loud.wav")).is_empty());
}

#[test]
fn a_saved_graph_takes_over_and_a_wrong_one_is_shown_and_left() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tone.ron");
    fs::write(&path, TONE).unwrap();
    let mut run = Running::start(folder.path(), &["run", "tone.ron", "--live", "--watch", "--out", "out"]);
    fs::write(&path, TONE.replace("Gain(", "Gian(")).unwrap();
    run.wait_for("the running graph is unchanged");
    assert!(run.said().contains("did you mean `Gain`"), "{}", run.said());
    let more = r#""twice": Gain(input: "loud", gain: 2), "more": WavSink(input: "twice", file: "more.wav"),
        "file":"#;
    fs::write(&path, TONE.replace("\"file\":", more)).unwrap();
    run.wait_for("the graph changed; more.wav begins");
    // What was typed stays set through other changes.
    run.type_line("set loud.gain=0.5");
    run.wait_for("loud.gain is 0.5");
    run.wait_for_rows("seen.csv", 0.5, 1);
    fs::write(&path, TONE.replace("value: 1,", "value: 1, ")).unwrap();
    run.wait_for("more.wav is complete");
    run.wait_for_more_rows("seen.csv");
    let told = run.stop();
    let out = folder.path().join("out");
    let (all, some) = (samples(&out.join("loud.wav")), samples(&out.join("more.wav")));
    assert_eq!((all[0], *all.last().unwrap()), (0.25, 0.5), "{told}");
    assert!(!some.is_empty() && some.len() < all.len(), "{} of {}", some.len(), all.len());
    assert!(some[0] == 0.5 && *some.last().unwrap() == 1.0);
    let facts = facts(&out);
    assert_eq!(facts["driver_frames"], all.len());
    // What ran when can be told afterwards.
    let saved = facts["saved_while_running"].as_array().unwrap();
    assert_eq!((saved.len(), &saved[0]["graph"]), (2, &serde_json::json!("changes/1")));
    assert_eq!(saved[0]["change"], "at-once");
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
    run.wait_for("set: loud.gain=0.75 (taken over in");
    run.wait_for_rows("seen.csv", 0.75, 1);
    // It stays through other changes,
    fs::write(&path, format!("// Loud.\n{TONE}")).unwrap();
    run.wait_for("nothing changed");
    // and a value that no setting can have is no value.
    run.type_line("set loud.gain=NaN");
    run.wait_for("choose a finite number");
    fs::write(&path, TONE.replace("0.25", "0.5")).unwrap();
    run.wait_for("saved: loud.gain=0.5 (taken over in");
    run.type_line("history");
    run.wait_for("s loud.gain=0.5 (saved)");
    run.wait_for_rows("seen.csv", 0.5, 1);
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
        .replace(r#""file": WavSink(input: "loud""#, file)
        .replace(r#"CsvSink(inputs: ["loud"]"#, r#"CsvSink(inputs: ["more"]"#);
    fs::write(&path, &graph).unwrap();
    let arguments = ["run", "tone.ron", "--live", "--watch", "--out", "out"];
    let mut run = Running::start(folder.path(), &arguments);
    run.type_line("set loudness=0.75");
    run.wait_for("set: loud.gain=0.75 (taken over in");
    fs::write(&path, graph.replace("0.25", "0.5")).unwrap();
    run.type_line("set more=2");
    run.wait_for_times("taken over in", 3);
    run.wait_for_rows("seen.csv", 1.0, 1);
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
        (TONE, "record/loud.wav", Some("--record"), "which the run writes itself"),
        (&*played, "coil.soundcard.wav", None, "which the run writes itself"),
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
    run.wait_for("the running graph is unchanged");
    run.stop();
    // Nor one whose name only this run takes.
    fs::write(&path, TONE).unwrap();
    let arguments = ["run", "tone.ron", "--live", "--watch", "--record", "--out", "kept"];
    let mut run = Running::start(folder.path(), &arguments);
    fs::write(&path, TONE.replace("loud.wav", "record/loud.wav")).unwrap();
    run.wait_for("the running graph is unchanged: the sink `file` writes record/loud.wav");
    run.stop();
    let out = folder.path().join("kept");
    assert_eq!((&facts(&out)["changes"], &facts(&out)["swaps"]), (&0.into(), &0.into()));
    let recorded = samples(&out.join("record/loud.output.wav"));
    assert_eq!(facts(&out)["driver_frames"], recorded.len());
}

#[test]
fn a_saved_graph_of_two_drivers_takes_over_with_other_rings_and_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.ron");
    let text = fs::read_to_string(shipped("two-drivers.ron"))
        .unwrap()
        .replace("\"surfaces/", &format!("\"{}/", shipped("surfaces")));
    let more = r#""further": Gain(clock: "hand", input: Ring(from: "moves", latency_ms: 14), gain: 2),
        "more": CsvSink(inputs: ["further"], file: "more.csv"),
        "crossed":"#;
    let further = text.replace("\"crossed\":", more);
    fs::write(&path, &text).unwrap();
    let common = ["run", "two.ron", "--endpoints", "simulated"];
    let live = [&common[..], &["--live", "--watch", "--out", "out"]].concat();
    let mut run = Running::start(folder.path(), &live);
    let renamed = further.replace("\"servo\"", "\"timer\"").replace("more.csv", "never.csv");
    fs::write(&path, renamed).unwrap();
    run.wait_for("the new graph needs audio at 48000 Hz and timer at 1000 Hz");
    assert!(run.said().contains("start a new run"), "{}", run.said());
    fs::write(&path, further).unwrap();
    run.wait_for("more.csv begins");
    run.wait_until("more.csv", |rows| rows.len() > 100);
    fs::write(&path, &text).unwrap();
    run.wait_for("more.csv is complete");
    run.wait_for_more_rows("crossed.csv");
    let told = run.stop();
    assert!(
        told.contains("the graph changed, faded through zero because there are several drivers"),
        "{told}"
    );
    let out = folder.path().join("out");
    assert!(!out.join("never.csv").exists());
    let facts = facts(&out);
    let audio_frames = facts["driver_frames"].as_u64().unwrap();
    let rows = |file: &str| fs::read_to_string(out.join(file)).unwrap().lines().count() as u64 - 1;
    assert_eq!(rows("crossed.csv"), audio_frames.div_ceil(48));
    assert_eq!(samples(&out.join("texture.wav")).len() as u64, (audio_frames * 10).div_ceil(48));
    assert!((100..rows("crossed.csv")).contains(&rows("more.csv")), "{told}");
    assert_eq!(facts["rings"].as_object().unwrap().len(), 2);
    // It is repeated up to the first change.
    let replay = succeed(folder.path(), &[&common[..], &["--replay", "out", "--out", "replay"]].concat());
    let told = String::from_utf8_lossy(&replay.stderr);
    assert!(told.contains("the graph was swapped 2 times during that run"), "{told}");
    for file in ["crossed.csv", "hand.csv"] {
        let of = |run: &str| fs::read(folder.path().join(run).join(file)).unwrap();
        assert!(of("replay").len() > 400 && of("out").starts_with(&of("replay")), "{file}");
    }
}

#[test]
fn a_file_by_another_name_takes_over_from_the_one_before() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tone.ron");
    fs::write(&path, TONE).unwrap();
    let mut run = Running::start(folder.path(), &["run", "tone.ron", "--live", "--watch", "--out", "out"]);
    fs::write(&path, TONE.replace("loud.wav", "later.wav").replace("0.25", "0.5")).unwrap();
    run.wait_for("later.wav begins; loud.wav is complete");
    run.wait_for_rows("seen.csv", 0.5, 100);
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
    let mut run = Running::start(folder.path(), &["run", "g.ron", "--live", "--watch", "--out", "out"]);
    fs::write(&path, graph("b", "a")).unwrap();
    run.wait_for("`h` moves to driver b, which a running graph cannot do; start a new run");
    run.stop();
}
