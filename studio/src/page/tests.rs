//! The engine of a page, run by the test.

use super::*;
use std::path::Path;

fn opened() -> Opened {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs");
    Opened { file: folder.join("texturepad.ron"), set: Vec::new() }
}

fn said(engine: &mut Engine, kind: &str) -> serde_json::Value {
    let texts = std::iter::from_fn(|| engine.next_message(0)).filter_map(|message| match message {
        Message::Text(text) => serde_json::from_str::<serde_json::Value>(&text).ok(),
        Message::Binary(_) => None,
    });
    texts.filter(|said| said["type"] == kind).last().unwrap_or_default()
}

fn run(engine: &mut Engine, seconds: f64) {
    for _ in 0..(seconds * 100.0) as usize {
        engine.process(480);
        engine.publish(Duration::from_millis(10), Duration::from_millis(1));
    }
}

#[test]
fn an_engine_that_its_caller_runs_tells_its_page_as_a_server_does() {
    let mut engine = Engine::open(opened(), &haptograph_nodes::registry()).expect("it is sound");
    assert_eq!((engine.driver_hz(), engine.sound_hz()), (48000.0, Some(48000.0)));
    assert_eq!(said(&mut engine, "hello")["host"], "page");
    run(&mut engine, 0.5);
    let status = said(&mut engine, "status");
    assert_eq!((&status["state"], &status["owner"]), (&"running".into(), &true.into()));
    assert!(status["cost"].as_f64().is_some_and(|cost| (cost - 0.1).abs() < 1e-6), "{status}");
    engine.hear(0, &Message::Text(r#"{"type":"stop"}"#.to_owned()));
    run(&mut engine, 0.2);
    assert_eq!(said(&mut engine, "status")["state"], "stopped");
    engine.hear(0, &Message::Text(r#"{"type":"resume"}"#.to_owned()));
    run(&mut engine, 0.2);
    assert_eq!(said(&mut engine, "status")["state"], "running");
}

#[test]
fn a_wrong_edit_is_answered_before_it_reaches_the_engine() {
    let checker = Checker::open(opened(), &haptograph_nodes::registry()).expect("it is there");
    let ask = |text: &str| serde_json::json!({ "type": "apply", "request": 7, "text": text }).to_string();
    let Some(Message::Text(wrong)) = checker.answer(&ask("Graph(format: 1, nodes: { \"a\": Sin() })")) else {
        panic!("it is wrong");
    };
    let wrong: serde_json::Value = serde_json::from_str(&wrong).expect("JSON");
    assert_eq!((&wrong["request"], &wrong["ok"]), (&7.into(), &false.into()));
    let text = std::fs::read_to_string(opened().file).expect("it ships");
    assert_eq!(checker.answer(&ask(&text)), None);
}

#[test]
fn edits_are_checked_against_what_the_engine_runs() {
    let mut checker = Checker::open(opened(), &haptograph_nodes::registry()).expect("it is there");
    // Wrong wherever there is such a parameter.
    let turn = r#"{"type":"parameter","request":1,"name":"gain","value":"\"loud\""}"#;
    let text = std::fs::read_to_string(opened().file).expect("it ships");
    let without = text.replace("\"gain\": 1.0,", "").replace("Param(\"gain\")", "1.0");
    assert_ne!(text, without);
    // A correct edit that the engine has not taken over changes nothing here.
    let apply = serde_json::json!({ "type": "apply", "request": 2, "text": without }).to_string();
    assert_eq!(checker.answer(&apply), None);
    assert!(checker.answer(turn).is_some());
    let runs = serde_json::json!({ "type": "graph", "text": without, "parameters": [] }).to_string();
    checker.follow(&runs);
    assert_eq!(checker.answer(turn), None);
    let mut engine = engine_of("texturepad.ron");
    checker.follow(&said(&mut engine, "graph").to_string());
    assert!(checker.answer(turn).is_some());
}

fn engine_of(graph: &str) -> Engine {
    let graph = opened().file.with_file_name(graph);
    let opened = Opened { file: graph, set: Vec::new() };
    let engine = Engine::open(opened, &haptograph_nodes::registry());
    engine.expect("it is sound")
}

/// Circles of `radius_mm` at 100 mm/s, pressed with 1 N by a pen; returns the latest levels.
fn stroke(engine: &mut Engine, radius_mm: f64, seconds: f64) -> serde_json::Value {
    engine.hear(0, &Message::Text(r#"{"type":"levels","on":true}"#.to_owned()));
    for turn in 0..(seconds * 100.0) as usize {
        let time_s = turn as f64 / 100.0;
        let angle = time_s * 100.0 / radius_mm;
        let mut bytes = vec![1, 0, 1, 0, 0, 0, 0, 0];
        bytes.extend((time_s * 1e3).to_le_bytes());
        for value in [radius_mm * angle.cos(), radius_mm * angle.sin(), 1.0, 0.0, 0.0] {
            bytes.extend((value as f32).to_le_bytes());
        }
        engine.hear(0, &Message::Binary(bytes));
        engine.process((engine.driver_hz() / 100.0) as usize);
        engine.publish(Duration::from_millis(10), Duration::from_millis(1));
    }
    said(engine, "levels")
}

fn rms(levels: &serde_json::Value, port: &str) -> f64 {
    let level = levels["ports"][port][0].as_f64();
    level.unwrap_or_else(|| panic!("{port}: {levels}"))
}

#[test]
fn an_arm_presses_into_the_surface_that_the_pad_is_laid_on() {
    let mut engine = engine_of("omni.ron");
    let pads = said(&mut engine, "graph")["pads"].clone();
    assert_eq!((&pads[0]["endpoint"], &pads[0]["is_laid"]), (&"arm".into(), &true.into()));
    assert_eq!((&pads[0]["gives_n_per_mm"], &pads[0]["height_mm"]), (&0.25.into(), &100.0.into()));
    let levels = stroke(&mut engine, 20.0, 1.5);
    // The damping of the wall adds to this.
    let load_n = rms(&levels, "normal.load");
    assert!((load_n - 1.0).abs() < 0.05, "{load_n} N");
    let depth_m = rms(&levels, "touch.contact");
    assert!((depth_m - 0.004).abs() < 2e-4, "{depth_m} m");
    // The offset surface over the ball is larger than the ball.
    let speed_m_s = rms(&levels, "slide.speed");
    assert!((0.08..0.102).contains(&speed_m_s), "{speed_m_s} m/s");
    assert!(rms(&levels, "coil.delivered") > 1e-4 && rms(&levels, "push.delivered") > 0.5, "{levels}");
}

#[test]
fn a_pen_on_an_object_is_located_by_the_wrench_of_the_pad() {
    let mut engine = engine_of("ar-pen.ron");
    let pads = said(&mut engine, "graph")["pads"].clone();
    assert_eq!((&pads[0]["endpoint"], &pads[1]), (&"pen".into(), &().into()));
    let height_mm = pads[0]["height_mm"].as_f64().expect("a number");
    assert!((height_mm - 25.4).abs() < 1e-9, "{height_mm} mm");
    let levels = stroke(&mut engine, 8.0, 1.5);
    assert!((rms(&levels, "touch.load") - 1.0).abs() < 0.01, "{levels}");
    let speed_m_s = rms(&levels, "slide.speed");
    assert!((speed_m_s - 0.1).abs() < 0.01, "{speed_m_s} m/s");
    // The point leads by the delay of a filter that the pad does not have: 11 ms at 100 mm/s.
    let error_m = rms(&levels, "error.output");
    assert!(error_m < 1.5e-3, "{error_m} m");
    assert!(rms(&levels, "coil.delivered") > 1e-4, "{levels}");
}

#[test]
fn levels_are_sent_while_the_drawing_is_seen_with_each_nodes_part_of_the_cost() {
    let mut engine = engine_of("texturepad.ron");
    run(&mut engine, 0.3);
    assert!(said(&mut engine, "levels").is_null(), "nobody asked");
    let levels = stroke(&mut engine, 30.0, 1.0);
    assert!((rms(&levels, "stylus.force") - 1.0).abs() < 1e-3, "{levels}");
    let costs = levels["costs"].as_object().expect("they are measured");
    let all: f64 = costs.values().filter_map(serde_json::Value::as_f64).sum();
    assert!((all - 1.0).abs() < 0.02 && costs.contains_key("texture/filter"), "{costs:?}");
    assert_eq!(
        (&levels["origin"], levels["not_finite"].as_object().map(|all| all.len())),
        (&().into(), Some(0))
    );
    assert!(levels["limits"]["out"]["ticks"].as_u64() > Some(40_000), "{levels}");
    engine.hear(0, &Message::Text(r#"{"type":"levels","on":false}"#.to_owned()));
    run(&mut engine, 0.3);
    assert!(said(&mut engine, "levels").is_null());
}

#[test]
fn where_a_limit_held_back_and_where_infinity_came_from_is_told() {
    let mut engine = engine_of("texturepad.ron");
    let text = std::fs::read_to_string(opened().file).expect("it ships");
    let apply = |edits: &[(&str, &str)]| {
        let text = edits.iter().fold(text.clone(), |text, (from, to)| {
            assert!(text.contains(from), "{from}");
            text.replace(from, to)
        });
        Message::Text(serde_json::json!({ "type": "apply", "request": 1, "text": text }).to_string())
    };
    engine.hear(0, &apply(&[("peak_a: 0.5, continuous_a: 0.25", "peak_a: 0.002, continuous_a: 0.001")]));
    assert_eq!(said(&mut engine, "reply")["ok"], true);
    let levels = stroke(&mut engine, 30.0, 1.0);
    let held = levels["limits"]["out"]["peak"].as_u64();
    assert!(held > Some(0) && levels["origin"].is_null(), "{levels}");
    let infinite = r#"nodes: {
        "large": Constant(clock: "synth", value: 1e200),
        "big": Multiply(input: "texture", by: "large"),
        "huge": Multiply(input: "big", by: "large"),"#;
    let reads = (r#"acceleration: "texture""#, r#"acceleration: "huge""#);
    engine.hear(0, &apply(&[("nodes: {", infinite), reads]));
    assert_eq!(said(&mut engine, "reply")["ok"], true);
    let levels = stroke(&mut engine, 30.0, 1.0);
    assert_eq!(levels["origin"], "huge", "{levels}");
    assert!(levels["not_finite"]["huge.output"].as_u64() > Some(0), "{levels}");
    assert!(levels["not_finite"]["big.output"].is_null(), "{levels}");
}

#[test]
fn a_late_look_still_sends_the_last_samples_of_a_run() {
    let mut engine = engine_of("texturepad.ron");
    let hear =
        |engine: &mut Engine, said: serde_json::Value| engine.hear(0, &Message::Text(said.to_string()));
    hear(
        &mut engine,
        serde_json::json!({ "type": "scope", "ports": [{ "name": "out.delivered", "raw": true }] }),
    );
    hear(&mut engine, serde_json::json!({ "type": "record", "on": true }));
    run(&mut engine, 0.2);
    while engine.next_message(0).is_some() {}
    stroke(&mut engine, 30.0, 0.5);
    hear(&mut engine, serde_json::json!({ "type": "record", "on": false }));
    run(&mut engine, 0.2);
    let kept = said(&mut engine, "recording")["recording"].clone();
    let frames = kept["frames"].as_u64().expect("it was recorded") as usize;
    let mut replay = |frames_between_looks: usize| {
        hear(&mut engine, serde_json::json!({ "type": "replay", "request": 3, "recording": kept }));
        let (mut samples, mut graphs) = (Vec::new(), 0);
        // Until the graph of the run after it is told.
        while graphs < 2 {
            engine.process(frames_between_looks);
            engine.publish(Duration::from_millis(10), Duration::from_millis(1));
            while let Some(message) = engine.next_message(0) {
                match message {
                    Message::Text(text) => graphs += usize::from(text.contains(r#""type":"graph""#)),
                    Message::Binary(bytes) if graphs == 1 && bytes[0] == 2 => {
                        samples.extend(bytes[24..].chunks_exact(4).map(<[u8]>::to_vec));
                    }
                    Message::Binary(_) => {}
                }
            }
        }
        samples
    };
    let (often, late) = (replay(480), replay(20_000));
    assert!(often[frames - 4800..frames].iter().any(|value| *value != often[0]));
    assert!(frames > 24_000 && late.len() >= frames, "{frames}, {}", late.len());
    assert_eq!((0..frames).find(|at| often[*at] != late[*at]), None, "of {frames} frames");
}

/// A folder with this graph and a surface beside it, and what the engine of the graph says to a request of its files.
fn files_of(edit: impl Fn(&std::path::Path, String) -> String) -> (tempfile::TempDir, serde_json::Value) {
    let folder = tempfile::tempdir().expect("a folder");
    let surfaces = folder.path().join("surfaces");
    std::fs::create_dir(&surfaces).expect("made");
    let shipped = opened().file.with_file_name("surfaces").join("t2-canvas.ron");
    std::fs::copy(shipped, surfaces.join("t2-canvas.ron")).expect("it ships");
    let text = std::fs::read_to_string(opened().file).expect("it ships");
    let file = folder.path().join("mine.ron");
    std::fs::write(&file, edit(folder.path(), text)).expect("written");
    let opened = Opened { file, set: Vec::new() };
    let mut engine = Engine::open(opened, &haptograph_nodes::registry()).expect("it is sound");
    engine.hear(0, &Message::Text(r#"{"type":"files","request":3}"#.to_owned()));
    let reply = said(&mut engine, "reply");
    (folder, reply)
}

#[test]
fn the_files_of_a_graph_have_paths_that_another_machine_has_too() {
    let (folder, reply) = files_of(|_, text| format!("// mine\n{text}"));
    assert_eq!(
        (&reply["request"], &reply["ok"], &reply["bundle"]["graph"]),
        (&3.into(), &true.into(), &"mine.ron".into())
    );
    let files = reply["bundle"]["files"].as_array().expect("a list");
    let paths: Vec<_> = files.iter().filter_map(|file| file["path"].as_str()).collect();
    assert_eq!(paths, ["mine.ron", "surfaces/t2-canvas.ron"]);
    assert!(!reply.to_string().contains(&*folder.path().to_string_lossy()));
    // A path of this machine in the text would open nothing there.
    let (_folder, reply) = files_of(|folder, text| {
        let surface = folder.join("surfaces/t2-canvas.ron");
        text.replace("surfaces/t2-canvas.ron", &surface.to_string_lossy())
    });
    assert_eq!((&reply["ok"], &reply["bundle"]), (&false.into(), &serde_json::Value::Null));
}

#[test]
fn kept_sound_becomes_a_file_in_the_unit_of_its_actuator() {
    use base64::Engine as _;
    let tone = (0..4800).map(|n| (std::f64::consts::TAU * 0.02 * f64::from(n)).sin() as f32 * 0.5);
    let bytes: Vec<u8> = tone.flat_map(f32::to_le_bytes).collect();
    let samples = base64::engine::general_purpose::STANDARD.encode(bytes);
    let asks = |format: &str, samples: &str| {
        let message = serde_json::json!({
            "type": "export", "request": 5, "format": format, "rate_hz": 8000.0, "full_scale": 4.0, "unit": "A", "samples": samples,
        });
        let Some(Message::Text(reply)) = super::export(&message.to_string()) else { panic!("no answer") };
        serde_json::from_str::<serde_json::Value>(&reply).expect("it is JSON")
    };
    for format in ["ahap", "haptic", "hjif"] {
        let reply = asks(format, &samples);
        assert_eq!((&reply["request"], &reply["ok"]), (&5.into(), &true.into()), "{reply}");
        let loss = &reply["pattern"]["loss"];
        assert!(
            (loss["full_scale"].as_f64().expect("a number") - 2.0).abs() < 0.05 && loss["unit"] == "A",
            "{loss}"
        );
        let text = reply["pattern"]["text"].as_str().expect("a text");
        assert!(serde_json::from_str::<serde_json::Value>(text).is_ok());
    }
    for (format, samples) in [("ahap", "AAAA"), ("ahap", "?"), ("ahap", "")] {
        let reply = asks(format, samples);
        assert_eq!((&reply["ok"], &reply["pattern"]), (&false.into(), &serde_json::Value::Null));
    }
    // The engine of a page leaves that to another module.
    let mut engine = Engine::open(opened(), &haptograph_nodes::registry()).expect("it is sound");
    let message = r#"{"type":"export","request":6,"format":"ahap","rate_hz":8000,"full_scale":1,"unit":"A","samples":""}"#;
    engine.hear(0, &Message::Text(message.to_owned()));
    assert_eq!(said(&mut engine, "reply")["ok"], false);
}
