//! The studio as its page meets it: by HTTP and WebSocket. What takes time is waited for, however long a machine needs.

mod common;

use common::{PATIENCE, Page};
use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, NodeEntry, NodeKind, Port, Processor, Tick,
};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::quantity::Quantity;
use haptograph_studio::{Options, Studio};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};
use tungstenite::Message;
use tungstenite::stream::MaybeTlsStream;

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(name)
}

fn open(graph: &Path) -> Studio {
    open_with(graph, &std::env::temp_dir().join("haptograph-no-recordings"))
}

fn open_with(graph: &Path, out: &Path) -> Studio {
    Studio::open(&options(graph, out), &haptograph_nodes::registry()).expect("a studio")
}

fn options(graph: &Path, out: &Path) -> Options {
    Options {
        graph: graph.to_owned(),
        set: Vec::new(),
        endpoints: None,
        port: 0,
        out: out.to_owned(),
        surfaces: Vec::new(),
        lan: None,
        learner: Some(common::learner),
    }
}

/// A copy of the TexturePad that tests may write to.
fn copied() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["texturepad.ron", "surfaces/t2-canvas.ron", "surfaces/t3-tile.ron"] {
        let to = folder.path().join(name);
        std::fs::create_dir_all(to.parent().expect("a folder")).expect("made");
        std::fs::copy(shipped(name), to).expect("copied");
    }
    let graph = folder.path().join("texturepad.ron");
    (folder, graph)
}

#[test]
fn learns_in_a_process_of_its_own() {
    common::learn_here();
}

/// The one of a list that has this name.
fn named<'a>(list: &'a Value, name: &str) -> &'a Value {
    let mut all = list.as_array().expect("a list").iter();
    all.find(|each| each["name"] == name).unwrap_or_else(|| panic!("no {name}"))
}

#[test]
fn the_page_is_told_units_quantities_and_nested_settings_and_what_each_parameter_feeds() {
    let (_folder, path) = copied();
    let text = std::fs::read_to_string(&path).expect("it is there");
    let text = text.replace("parameters: {", "parameters: { \"soft_hz\": 20.0,");
    let text = text.replace("cutoff_hz: 20", "cutoff_hz: Param(\"soft_hz\")");
    std::fs::write(&path, text).expect("written");
    let studio = open(&path);
    let page = Page::of(&studio);
    let kinds = &page.hello["kinds"];
    let limit = named(&named(kinds, "ActuatorSink")["settings"], "limit");
    let peak = named(&limit["parts"][0]["fields"], "peak_a");
    assert_eq!((&peak["unit"], &peak["required"]), (&json!("A"), &json!(true)));
    let stroke = named(&named(kinds, "SimulatedTablet")["settings"], "stroke");
    let parts = stroke["parts"].as_array().expect("a list");
    let circles = parts.iter().find(|part| part["choice"] == "Circles").expect("a choice");
    assert_eq!(named(&circles["fields"], "radius_mm")["unit"], "mm");
    let tablet = &named(kinds, "Tablet")["outputs"];
    let units = ["force", "touching"].map(|name| named(tablet, name)["unit"].clone());
    assert_eq!(units, [json!("N"), json!("")]);
    assert_eq!(named(&named(kinds, "SpeedEstimator")["inputs"], "position")["unit"], "m");
    assert_eq!(named(&page.hello["quantities"], "angular speed")["unit"], "rad/s");
    let wav = &named(kinds, "WavSource")["settings"];
    let are = ["quantity", "file"].map(|name| named(wav, name)["is_quantity"].clone());
    assert_eq!(are, [json!(true), json!(false)]);

    let parameters = &page.graph["parameters"];
    for (parameter, kind, setting) in
        [("soft_hz", "SpeedEstimator", "cutoff_hz"), ("gain", "ActuatorSink", "gain")]
    {
        let (fed, setting) = (named(parameters, parameter), named(&named(kinds, kind)["settings"], setting));
        for fact in ["unit", "min", "max", "doc"] {
            assert_eq!(fed[fact], setting[fact], "{fact} of {parameter}");
        }
        assert_ne!(fed["doc"], "");
    }
    let soft = named(parameters, "soft_hz");
    assert!(soft["max"].is_number() && soft["unit"] == "Hz" && soft["whole"] == false, "{soft}");
    // A set of endpoints each.
    assert_eq!(named(parameters, "hand")["doc"], "");
    assert_eq!(page.graph["pads"][0]["most_force_n"], 20.0);
}

/// The names of a list of keys in the page's own table.
fn keys_of(table: &str) -> Vec<String> {
    let text = include_str!("../page/keys.js");
    let after = text.split_once(&format!("export const {table} = {{")).expect("a table").1;
    let lines = after.split_once("\n};").expect("its end").0.lines();
    let names = lines.filter_map(|line| line.trim().split_once(": \""));
    let mut names: Vec<String> = names.map(|(name, _)| name.to_owned()).collect();
    names.sort();
    names
}

#[test]
fn the_keys_that_the_page_completes_are_those_that_the_engine_reads() {
    let studio = open(&shipped("texturepad.ron"));
    let mut page = Page::of(&studio);
    for (table, text) in [
        ("GRAPH", "Graph(format: 1, qqqqqqqq: 1, clocks: {}, nodes: {})"),
        ("DRIVER", "Graph(format: 1, clocks: { \"a\": Driver(rate_hz: 1, qqqqqqqq: 1) }, nodes: {})"),
        (
            "DERIVED",
            "Graph(format: 1, clocks: { \"b\": Driver(rate_hz: 2), \"a\": Derived(of: \"b\", rate_hz: 1, qqqqqqqq: 1) }, nodes: {})",
        ),
    ] {
        let reply = page.request(json!({ "type": "check", "text": text }));
        let diagnostics = reply["diagnostics"].as_array().expect("a list");
        let unknown = diagnostics.iter().find(|each| each["code"] == "E0204");
        let help = unknown.expect("an unknown field")["help"][0].as_str().expect("a text");
        let mut read: Vec<String> = help.split('`').skip(1).step_by(2).map(str::to_owned).collect();
        read.sort();
        assert_eq!(read, keys_of(table), "{help}");
    }
}

fn rms(samples: &[f32]) -> f64 {
    (samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / samples.len() as f64).sqrt()
}

const VIBRATION: &str = "texture/filter.acceleration";

#[test]
fn a_stroke_on_the_page_vibrates_as_the_model_says_and_a_lifted_hand_does_not() {
    let studio = open(&shipped("texturepad.ron"));
    let mut page = Page::of(&studio);
    assert_eq!(page.graph["pads"][0]["endpoint"], "stylus");
    assert!(page.graph["drawing"].as_str().expect("a drawing").contains("data-node=\"texture/filter\""));
    assert_eq!(page.graph["maps"][0]["speed_port"], "speed.speed");
    page.say(&json!({ "type": "scope", "ports": [{ "name": VIBRATION, "raw": true }] }));
    page.stroke(100.0, 1.0, 0.7);
    let felt = rms(&page.stroke(100.0, 1.0, 2.0));
    let texture =
        haptograph_surfaces::files::load(&shipped("surfaces/t2-canvas.ron")).expect("it ships").texture;
    let texture = texture.expect("a texture");
    let near = |at: &&haptograph_surfaces::ModelAt| (at.speed_m_s / 0.1).ln().abs() + at.force_n.ln().abs();
    let models = texture.models().iter().filter(|at| at.speed_m_s > 0.0 && at.force_n > 0.0);
    let model = models.min_by(|a, b| near(a).total_cmp(&near(b))).expect("a model");
    let expected = model.model.power().sqrt();
    // On a loaded machine the hand of this test is not even.
    assert!((0.4..2.5).contains(&(felt / expected)), "{felt} and {expected} m/s²");
    let lifted = page.stroke(0.0, 0.0, 1.0);
    assert!(rms(&lifted[lifted.len() / 2..]) < 0.01 * expected);
}

#[test]
fn a_page_that_sees_the_drawing_is_told_what_every_port_and_node_does() {
    let studio = open(&shipped("texturepad.ron"));
    let mut page = Page::of(&studio);
    let described = page.graph["levels"].as_array().expect("a list").clone();
    let is_described = |name: &str| described.iter().any(|port| port["name"] == name);
    assert!(is_described(VIBRATION) && is_described("texture/locate.weights"));
    assert!(
        page.graph["ports"]
            .as_array()
            .is_some_and(|ports| { ports.iter().all(|port| port["name"] != "texture/locate.weights") })
    );
    page.say(&json!({ "type": "levels", "on": true }));
    page.say(&json!({ "type": "scope", "ports": [{ "name": VIBRATION }] }));
    page.stroke(100.0, 1.0, 1.0);
    let levels = page.wait(|said| said["type"] == "levels" && !said["costs"].is_null());
    assert!(levels["ports"][VIBRATION][1].as_f64() > Some(0.0), "{levels}");
    assert!(levels["ports"]["texture/locate.weights"][1].as_f64() > Some(0.3), "{levels}");
    let costs = levels["costs"].as_object().expect("parts");
    assert!(costs.values().all(|part| part.as_f64().is_some_and(|part| (0.0..=1.0).contains(&part))));
    assert_eq!((&levels["not_finite"], &levels["origin"]), (&json!({}), &Value::Null));
}

#[test]
fn a_graph_is_described_with_its_plots_what_its_hand_touches_and_what_was_recorded() {
    let studio = open(&shipped("omni.ron"));
    let page = Page::of(&studio);
    let (plots, scene) = (&page.graph["plots"], &page.graph["pads"][0]["scene"]);
    assert_eq!((&plots[0]["name"], &plots[0]["form"]), (&json!("Where it touched"), &json!("path")));
    let contact = &plots[0]["signals"][0];
    assert_eq!((&contact["kind"], &contact["lanes"][10]), (&json!("contact"), &json!("penetration m")));
    assert_eq!(page.graph["contacts"][0]["name"], contact["name"]);
    let against = plots.as_array().and_then(|plots| plots.iter().find(|plot| plot["form"] == "xy"));
    let signals = &against.expect("a plot against a signal")["signals"];
    assert_eq!((&signals[0]["name"], &signals[0]["unit"]), (&json!("depth.penetration"), &json!("m")));
    assert_eq!((&signals[1]["label"], &signals[1]["quantity"]), (&json!("normal.load"), &json!("force")));
    let ball = json!({ "form": "sphere", "centre_mm": [0.0, 0.0, 0.0], "diameter_mm": 100.0 });
    assert_eq!(scene, &json!({ "tool_mm": 3.2, "shapes": [ball] }));
    let (kinds, points) = (&page.graph["maps"][0]["kinds"], &page.graph["maps"][0]["points"]);
    assert_eq!(kinds.as_array().map(Vec::len), points.as_array().map(Vec::len));
    assert!(
        ["fitted", "edge"].iter().all(|kind| kinds.as_array().is_some_and(|all| all.contains(&json!(kind))))
    );
}

#[test]
fn edits_take_over_and_wrong_ones_say_where_and_change_nothing() {
    let (_folder, path) = copied();
    let studio = open(&path);
    let mut page = Page::of(&studio);
    let text = page.graph["text"].as_str().expect("a text").to_owned();
    let wrong =
        page.request(json!({ "type": "apply", "text": text.replace("SpeedEstimator", "SpedEstimator") }));
    assert_eq!((&wrong["ok"], &wrong["diagnostics"][0]["code"]), (&json!(false), &json!("E0201")));
    assert!(wrong["diagnostics"][0]["line"].as_u64().is_some_and(|line| line > 10), "{wrong}");
    let edited = text.replace("nodes: {", "nodes: { \"twice\": Gain(input: \"texture\", gain: 2),");
    assert_eq!(page.request(json!({ "type": "check", "text": edited }))["ok"], true);
    assert_eq!(page.request(json!({ "type": "apply", "text": edited }))["ok"], true);
    page.say(&json!({ "type": "scope", "ports": [{ "name": "twice.output", "raw": true }] }));
    assert!(rms(&page.stroke(100.0, 1.0, 2.0)) > 0.5, "the new node is heard");
    page.say(&json!({ "type": "set", "name": "twice.gain", "value": 0.0 }));
    page.stroke(100.0, 1.0, 0.5);
    assert!(rms(&page.stroke(100.0, 1.0, 0.5)) < 1e-6, "a turn arrives");
    let tile =
        page.request(json!({ "type": "parameter", "name": "surface", "value": "\"surfaces/t3-tile.ron\"" }));
    assert_eq!(tile["ok"], true, "{tile}");
    assert_eq!(page.request(json!({ "type": "save", "text": edited }))["ok"], true);
    assert_eq!(std::fs::read_to_string(&path).expect("it is there"), edited);
    std::fs::write(&path, "somebody else's").expect("written");
    assert_eq!(page.request(json!({ "type": "save", "text": text }))["ok"], false);
    assert_eq!(std::fs::read_to_string(&path).expect("it is there"), "somebody else's");
}

/// A table of drags over something rough: so many seconds at 2 kHz.
fn drags(seconds: usize) -> String {
    let (mut table, mut seed) = ("time_s,accel_m_s2,force_normal_n,speed_mm_s\n".to_owned(), 1_u64);
    for row in 0..seconds * 2000 {
        let at_s = row as f64 / 2000.0;
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let (speed, force) = (110.0 + 80.0 * (1.3 * at_s).sin(), 1.2 + 0.8 * (2.1 * at_s).sin());
        let accel = ((seed >> 40) as f64 / f64::from(1_u32 << 24) - 0.5) * 0.05 * speed * force;
        let _ = writeln!(table, "{at_s:.4},{accel:.5},{force:.4},{speed:.3}");
    }
    table
}

#[test]
fn a_page_stops_the_run_while_its_recording_is_learned_and_strokes_the_surface_afterwards() {
    let (folder, path) = copied();
    let out = folder.path().join("out");
    let studio = open_with(&path, &out);
    let mut page = Page::of(&studio);
    for request in [1, 2] {
        // A long message says first what it is.
        let csv = json!(drags(60));
        let learn = format!(r#"{{"type":"learn","request":{request},"name":"../my felt.csv","csv":{csv}}}"#);
        page.socket.send(Message::text(learn)).expect("sent");
    }
    page.say(&json!({ "type": "stop" }));
    let (mut seen, mut report) = (Vec::new(), String::new());
    while seen.len() < 3 {
        let said = page
            .wait(|said| said["type"] == "reply" || said["type"] == "status" && said["state"] == "stopped");
        match said["type"] == "reply" {
            true if said["request"] == 1 => {
                assert_eq!(
                    (&said["ok"], &said["change"]),
                    (&json!(true), &json!("\"surfaces/my-felt.ron\"")),
                    "{said}"
                );
                said["report"].as_str().unwrap_or_default().clone_into(&mut report);
                seen.push("learned");
            }
            true => {
                assert_eq!(said["ok"], false, "one at a time: {said}");
                seen.push("refused");
            }
            false if !seen.contains(&"stopped") => seen.push("stopped"),
            false => {}
        }
    }
    assert_eq!(seen, ["refused", "stopped", "learned"]);
    assert!(folder.path().join("surfaces/my-felt.ron").is_file());
    assert!(out.join(&report).join("report.html").is_file());
    let (host, token) = (studio.address(), studio.token());
    for (path, status) in [
        (format!("{report}?token={token}"), "200"),
        (report.clone(), "403"),
        (format!("..%2F..?token={token}"), "404"),
        (format!("none?token={token}"), "404"),
    ] {
        let answer = asked(&studio, &format!("GET /report/{path} HTTP/1.1\r\nHost: {host}"));
        assert!(answer.lines().next().is_some_and(|first| first.contains(status)), "{path}: {answer}");
    }
    assert_eq!(page.graph["devices"][0]["simulated"], true, "{}", page.graph["devices"]);
    page.say(&json!({ "type": "resume" }));
    let value = json!({ "type": "parameter", "name": "surface", "value": "\"surfaces/my-felt.ron\"" });
    let chosen = page.request(value);
    assert_eq!(chosen["ok"], true, "{chosen}");
    page.say(&json!({ "type": "scope", "ports": [{ "name": VIBRATION, "raw": true }] }));
    assert!(rms(&page.stroke(100.0, 1.0, 2.0)) > 0.1);
}

/// The names in the folder of surfaces.
fn surfaces_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder.join("surfaces")).expect("a folder");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn what_fails_while_it_is_learned_or_is_cancelled_ends_nothing_and_leaves_nothing() {
    let (folder, path) = copied();
    let studio = open_with(&path, &folder.path().join("out"));
    let mut page = Page::of(&studio);
    let before = surfaces_in(folder.path());
    let learn =
        |request: u64, csv: &str| json!({ "type": "learn", "request": request, "name": "x.csv", "csv": csv });
    let reply_to = |page: &mut Page, request: u64| {
        let reply = page.wait(|said| said["type"] == "reply" && said["request"] == request);
        assert_eq!(reply["ok"], false, "{reply}");
        reply["error"].as_str().expect("a text").to_owned()
    };
    page.say(&learn(1, "abort"));
    let why = reply_to(&mut page, 1);
    assert!(why.contains("memory") && !why.contains('\n'), "{why}");
    page.say(&learn(2, "a,b\n1,2\n"));
    let why = reply_to(&mut page, 2);
    assert!(why.contains("x.csv") && !why.contains("/tmp"), "{why}");
    // Of another page, and of another request, is not this one.
    page.say(&learn(3, "wait"));
    Page::of(&studio).say(&json!({ "type": "cancel", "request": 3 }));
    page.say(&json!({ "type": "cancel", "request": 2 }));
    page.say(&learn(4, "wait"));
    assert!(reply_to(&mut page, 4).contains("another recording"));
    page.say(&json!({ "type": "cancel", "request": 3 }));
    assert!(reply_to(&mut page, 3).contains("cancelled"));
    page.say(&learn(5, "wait"));
    drop(page);
    // The learning of a page that is gone is over, and the next one may begin.
    let mut page = Page::of(&studio);
    page.wait(|said| said["type"] == "status" && said["state"] == "running" && said["pages"] == 1);
    page.say(&json!({ "type": "own" }));
    let (asked, csv) = (Instant::now(), drags(5));
    let reply = (6..).find_map(|request| {
        page.say(&learn(request, &csv));
        let reply = page.wait(|said| said["type"] == "reply" && said["request"] == request);
        let waits = reply["error"].as_str().is_some_and(|why| why.contains("another recording"));
        (!waits || asked.elapsed() > PATIENCE).then_some(reply)
    });
    assert_eq!(reply.map(|reply| reply["change"].clone()), Some(json!("\"surfaces/x.ron\"")));
    let mut after = before;
    after.push("x.ron".to_owned());
    assert_eq!(surfaces_in(folder.path()), after);
}

#[test]
fn surfaces_that_cannot_be_read_are_named_with_their_error_and_disturb_nothing() {
    let (folder, path) = copied();
    let text = std::fs::read_to_string(folder.path().join("surfaces/t3-tile.ron")).expect("it is there");
    let cut = &text[..text.len() / 2];
    for (name, text) in [("cut.ron", cut), ("not-a-surface.ron", "Graph(format: 1)")] {
        std::fs::write(folder.path().join("surfaces").join(name), text).expect("written");
    }
    for _ in 0..2 {
        let studio = open(&path);
        let mut page = Page::of(&studio);
        let listed = page.graph["surfaces"].as_array().expect("a list").clone();
        let is_read = |surface: &Value| {
            (surface["path"].clone(), surface["error"].is_null(), surface["swatch"].is_null())
        };
        let listed_as: Vec<_> = listed.iter().map(is_read).collect();
        let named = |name: &str, is_read: bool| (json!(format!("\"surfaces/{name}\"")), is_read, !is_read);
        assert_eq!(
            listed_as,
            [named("cut.ron", false), named("t2-canvas.ron", true), named("t3-tile.ron", true)]
        );
        assert_eq!(listed[0]["name"], "cut");
        let value = json!({ "type": "parameter", "name": "surface", "value": "\"surfaces/t3-tile.ron\"" });
        assert_eq!(page.request(value)["ok"], true);
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("surfaces/cut.ron")).expect("it is there"), cut);
}

#[test]
fn what_a_studio_was_recording_when_it_was_killed_is_replayed() {
    let (folder, path) = copied();
    let studio = open_with(&path, &folder.path().join("out"));
    let mut page = Page::of(&studio);
    page.say(&json!({ "type": "scope", "ports": [{ "name": "out.delivered", "raw": true }] }));
    page.say(&json!({ "type": "record", "on": true }));
    page.wait(|said| said["type"] == "graph");
    page.stroke(100.0, 1.0, 0.5);
    page.say(&json!({ "type": "set", "name": "out.gain", "value": 0.1 }));
    page.stroke(100.0, 1.0, 0.5);
    // As after a kill: what is on the disk so far, cut in the middle of a line.
    let kept =
        std::fs::read(folder.path().join("out/texturepad-strokes-1/strokes.part")).expect("it is there");
    let killed = tempfile::tempdir().expect("a folder");
    std::fs::write(killed.path().join("strokes.part"), &kept[..kept.len() - 3]).expect("written");
    assert!(haptograph_studio::recover(killed.path()).expect("a recording") > 0.5);
    assert!(haptograph_studio::recover(killed.path()).is_err(), "it is kept");
    let read = std::fs::read(killed.path().join("strokes.json")).expect("it is there");
    let recovered: Value = serde_json::from_slice(&read).expect("JSON");
    page.say(&json!({ "type": "record", "on": false }));
    let whole = page.wait(|said| said["type"] == "recording")["recording"].clone();
    assert!(!folder.path().join("out/texturepad-strokes-1/strokes.part").exists());
    let moves = recovered["moves"].as_array().expect("a list");
    assert!(moves.len() > 10 && whole["moves"].as_array().expect("a list").starts_with(moves));
    assert_eq!((&recovered["turns"], &recovered["text"]), (&whole["turns"], &whole["text"]));
    page.wait(|said| said["type"] == "status" && said["state"] == "running" && said["recording_s"].is_null());
    let reply = page.request(json!({ "type": "replay", "recording": recovered }));
    assert_eq!(reply["ok"], true, "{reply}");
}

#[test]
fn no_recording_and_no_replay_ends_a_stop() {
    let studio = open(&shipped("texturepad.ron"));
    let mut page = Page::of(&studio);
    let stopped = |said: &Value| said["type"] == "status" && said["state"] == "stopped";
    page.say(&json!({ "type": "stop" }));
    page.wait(stopped);
    for on in [true, false] {
        page.say(&json!({ "type": "record", "on": on }));
        page.wait(|said| said["type"] == "refused");
    }
    let rate_hz = 48_000.0;
    let recording = json!({ "format": 1, "haptograph": "", "graph": "", "text": "", "set": [], "rate_hz": rate_hz,
        "frames": 9, "moves": [], "turns": [] });
    let reply = page.request(json!({ "type": "replay", "recording": recording }));
    assert!(reply["ok"] == false && reply["error"].to_string().contains("resume"), "{reply}");
    page.wait(stopped);
    page.say(&json!({ "type": "resume" }));
    page.wait(|said| said["type"] == "status" && said["state"] == "running");
}

#[test]
fn what_is_asked_of_a_recording_while_the_run_falls_to_zero_counts() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("slow.ron");
    let graph = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) }, nodes: {
        "half": Constant(clock: "servo", value: 0.5, quantity: "current"),
        "out": ActuatorSink(clock: "servo", endpoint: "coil", current: "half",
                            limit: (peak_a: 1, continuous_a: 1, slew_a_per_s: 0.5)),
    }, endpoints: { "simulated": { "coil": SimulatedHaptuator() } })"#;
    std::fs::write(&path, graph).expect("written");
    let studio = open_with(&path, &folder.path().join("out"));
    let mut page = Page::of(&studio);
    let time_s = |said: &Value| said["time_s"].as_f64().unwrap_or(0.0);
    // The current has risen, and takes as long to fall.
    page.wait(|said| said["type"] == "status" && time_s(said) > 1.2);
    for on in [true, false] {
        page.say(&json!({ "type": "record", "on": on }));
    }
    page.wait(|said| said["type"] == "status" && time_s(said) < 1.0);
    let status = page.wait(|said| said["type"] == "status" && time_s(said) > 1.2);
    assert!(status["recording_s"].is_null(), "it was ended before it began: {status}");
    page.say(&json!({ "type": "record", "on": true }));
    page.wait(|said| said["type"] == "status" && said["recording_s"].as_f64() > Some(1.2));
    for on in [false, true] {
        page.say(&json!({ "type": "record", "on": on }));
    }
    page.wait(|said| said["type"] == "recording");
    page.wait(|said| said["type"] == "status" && time_s(said) > 0.2 && said["state"] == "running");
    let status = page.wait(|said| said["type"] == "status" && (0.2..1.0).contains(&time_s(said)));
    assert!(status["recording_s"].is_number(), "the next one was asked for: {status}");
}

#[test]
fn connections_without_a_token_are_bounded_and_lock_nobody_out() {
    let studio = open(&shipped("texturepad.ron"));
    let mut page = Page::of(&studio);
    let idle = |_| {
        let mut stream = TcpStream::connect(studio.address()).expect("it listens");
        let _ = write!(stream, "GET / HTTP/1.1\r\nHost: ");
        stream
    };
    let mut all: Vec<TcpStream> = (0..200).map(idle).collect();
    // The first ones are ended, and a page comes in.
    all[0].set_read_timeout(Some(PATIENCE)).expect("a timeout");
    assert!(!matches!(all[0].read(&mut [0; 99]), Ok(1..)));
    Page::of(&studio);
    page.wait(|said| said["type"] == "status" && said["state"] == "running");
    let open = all.iter().filter(|stream| {
        stream.set_nonblocking(true).expect("set");
        matches!(stream.peek(&mut [0]), Err(error) if error.kind() == std::io::ErrorKind::WouldBlock)
    });
    assert!(open.count() <= 64);
}

#[test]
fn of_all_pages_one_at_a_time_sends_a_long_message() {
    let studio = open(&shipped("texturepad.ron"));
    let (mut first, mut second, mut third) = (Page::of(&studio), Page::of(&studio), Page::of(&studio));
    let long = format!(r#"{{"type":"replay","request":1,"recording":"{}"}}"#, "x".repeat(8 << 20));
    // Part of a masked text of 16 MiB.
    let MaybeTlsStream::Plain(stream) = first.socket.get_mut() else {
        panic!("it is not encrypted");
    };
    let header = [&[0x81, 0xff][..], &(16_u64 << 20).to_be_bytes(), &[0; 4]].concat();
    stream.write_all(&header).expect("sent");
    stream.write_all(&long.as_bytes()[..6 << 20]).expect("sent");
    let (done, heard) = std::sync::mpsc::channel();
    let waits = std::thread::spawn(move || {
        second.socket.send(Message::text(long)).expect("sent");
        second.wait(|said| said["type"] == "refused");
        done.send(()).expect("it is heard");
    });
    for _ in 0..100 {
        third.request(json!({ "type": "check", "text": "" }));
    }
    assert!(heard.try_recv().is_err(), "it waits for the first");
    drop(first);
    heard.recv_timeout(PATIENCE).expect("its turn comes");
    waits.join().expect("no panic");
}

/// Set in a process that may open few files.
const FEW_FILES: &str = "HAPTOGRAPH_FEW_FILES";

#[cfg(unix)]
#[test]
fn too_many_open_files_are_said_to_be_that_and_pages_come_in_afterwards() {
    if std::env::var(FEW_FILES).is_err() {
        let program = std::env::current_exe().expect("a path");
        let mut few = std::process::Command::new("sh");
        few.args(["-c", r#"ulimit -n 40; exec "$0" "$@""#]).arg(program).env(FEW_FILES, "");
        few.args(["too_many_open_files_are_said_to_be_that_and_pages_come_in_afterwards", "--exact"]);
        let ended = few.output().expect("it runs");
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stdout));
        return;
    }
    let studio = open(&shipped("texturepad.ron"));
    let connect = |_| TcpStream::connect(studio.address()).ok();
    // Each takes a file at both ends.
    let all: Vec<TcpStream> = (0..40).map_while(connect).collect();
    let begun = Instant::now();
    let trouble = std::iter::repeat_with(|| studio.trouble()).find_map(|trouble| {
        assert!(begun.elapsed() < PATIENCE, "it says nothing");
        trouble
    });
    assert!(trouble.is_some_and(|trouble| trouble.contains("open files")));
    drop(all);
    Page::of(&studio);
    // One that was ended meanwhile may still have held its file.
    while studio.trouble().is_some() {
        assert!(begun.elapsed() < 2 * PATIENCE, "nobody comes in");
        connect(0);
        // Without a pause, closed connections alone take all files again.
        std::thread::sleep(Duration::from_millis(50));
    }
}

haptograph_engine::node! {
    /// Passes its input on, later than real time.
    pub struct Sleeping(NoSettings) in "mine";
    example: r#""late": Sleeping(input: "texture")"#;
    in INPUT: Scalar = Port::of(Quantity::ACCELERATION, "Of the texture.");
    out OUTPUT: Scalar = Port::of(Quantity::ACCELERATION, "The same.");
}

impl NodeKind for Sleeping {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Passing))
    }
}

#[derive(Clone)]
struct Passing;

impl Processor<Sleeping> for Passing {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Sleeping>) {
        std::thread::sleep(Duration::from_millis(3));
        let input = io.read(Sleeping::INPUT);
        io.write(Sleeping::OUTPUT).copy_from_slice(input);
    }
}

#[test]
fn a_stop_is_heard_by_a_run_that_never_keeps_up_while_another_page_floods_it() {
    let (folder, _) = copied();
    let path = folder.path().join("late.ron");
    let text = std::fs::read_to_string(shipped("texturepad.ron")).expect("it is there");
    let late = r#"DynamicCompensator(acceleration: "late"), "late": Sleeping(input: "texture")"#;
    let text = text.replace(r#"DynamicCompensator(acceleration: "texture")"#, late);
    std::fs::write(&path, text).expect("written");
    let mut registry = haptograph_nodes::registry();
    registry.add(NodeEntry::processor::<Sleeping>());
    let studio = Studio::open(&options(&path, folder.path()), &registry).expect("it is right");
    let (mut owner, mut flood) = (Page::of(&studio), Page::of(&studio));
    flood.say(&json!({ "type": "own" }));
    owner.wait(|said| said["type"] == "status" && said["behind_ms"].as_f64().is_some_and(|late| late > 2.0));
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let begun = Instant::now();
            while !done.load(Relaxed) && begun.elapsed() < PATIENCE {
                flood.point(1.0, 2.0, 0.5);
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        owner.say(&json!({ "type": "stop" }));
        owner.wait(|said| said["type"] == "status" && said["state"] == "stopped");
        done.store(true, Relaxed);
    });
}

/// Late wake-ups so far.
fn late_wakes(page: &mut Page) -> u64 {
    page.wait(|said| said["type"] == "status")["late"].as_u64().expect("a number")
}

/// Records a stroke and replays it: the first sample that differs.
fn differs_when_replayed(page: &mut Page, graph: &str) -> Option<usize> {
    page.say(&json!({ "type": "record", "on": true }));
    page.wait(|said| said["type"] == "graph");
    let felt = page.stroke(100.0, 1.0, 1.5);
    page.say(&json!({ "type": "record", "on": false }));
    let kept = page.wait(|said| said["type"] == "recording");
    page.wait(|said| said["type"] == "graph");
    let folder = PathBuf::from(kept["saved"].as_str().expect("it is saved"));
    assert!(folder.join("report.html").is_file() && rms(&felt) > 1e-3, "{graph}: {}", rms(&felt));
    page.say(&json!({ "type": "replay", "request": 0, "recording": kept["recording"] }));
    page.wait(|said| said["type"] == "graph");
    let count = felt.len() - 4800;
    let again = page.stroke(0.0, 0.0, count as f64 / 48e3);
    let differs = (0..count.min(again.len())).find(|at| felt[*at].to_bits() != again[*at].to_bits());
    page.wait(|said| said["type"] == "status" && said["replay"].is_null() && said["state"] == "running");
    differs
}

#[test]
fn graphs_of_two_drivers_run_on_one_clock_are_stroked_replayed_and_stopped() {
    for (graph, ports) in [
        ("two-drivers.ron", ["stylus.force", "moving.output", "out.delivered"]),
        ("omni-coil.ron", ["normal.load", "moving.output", "coil.delivered"]),
    ] {
        let out = tempfile::tempdir().expect("a folder");
        let studio = open_with(&shipped(graph), out.path());
        let mut page = Page::of(&studio);
        let drivers = page.graph["drivers"].as_array().expect("a list").clone();
        assert!(
            drivers.len() == 2 && drivers.iter().all(|driver| driver["simulated"] == true),
            "{drivers:?}"
        );
        assert_eq!(named(&page.graph["ports"], ports[0])["driver"], "servo");
        assert_eq!(named(&page.graph["ports"], ports[2])["driver"], "audio");
        // Of each side the last look at it, and all of what the coil is driven by.
        for port in &ports[..2] {
            page.say(&json!({ "type": "scope", "ports": [{ "name": port, "raw": true }] }));
            assert!(rms(&page.stroke(100.0, 1.0, 1.5)) > 1e-3, "{graph}: {port}");
        }
        page.say(&json!({ "type": "scope", "ports": [{ "name": ports[2], "raw": true }] }));
        // A wake-up that is late may skip frames: then once more.
        let in_time = (0..8).find_map(|_| {
            let late = late_wakes(&mut page);
            let differs = differs_when_replayed(&mut page, graph);
            (late_wakes(&mut page) == late).then_some(differs)
        });
        assert_eq!(in_time, Some(None), "{graph}: bit for bit");
        page.stroke(100.0, 1.0, 0.5);
        let fall = [page.stroke(100.0, 1.0, 0.1), {
            page.say(&json!({ "type": "stop" }));
            page.wait(|said| said["type"] == "status" && said["state"] == "stopped");
            Vec::new()
        }];
        assert!(rms(&fall[0]) > 1e-3, "{graph}");
        let levels = page.wait(|said| said["type"] == "status");
        let actuators = levels["actuators"].as_array().expect("a list");
        assert!(actuators.iter().all(|actuator| actuator["rms"] == 0.0), "{actuators:?}");
    }
}

#[test]
fn pointers_that_were_made_for_another_graph_reach_no_input_of_this_one() {
    let studio = open(&shipped("two-drivers.ron"));
    let mut page = Page::of(&studio);
    let before = page.graph["number"].as_u64().expect("a number") as u16;
    page.say(&json!({ "type": "scope", "ports": [{ "name": "stylus.force" }] }));
    page.made_for = before;
    assert!(rms(&page.stroke(100.0, 1.0, 1.0)) > 0.1);
    let edited = page.graph["text"].as_str().expect("a text").replace("cutoff_hz: 20", "cutoff_hz: 21");
    assert_eq!(page.request(json!({ "type": "apply", "text": edited }))["ok"], true);
    page.point(0.0, 0.0, 0.0);
    let after = page.heard.iter().rev().find(|text| text.contains(r#""type":"graph""#)).expect("it is told");
    let after: Value = serde_json::from_str(after).expect("JSON");
    assert_eq!(after["number"].as_u64(), Some(u64::from(before) + 1));
    // What was on its way meanwhile, after a last state that the stage drops, too.
    page.stroke(0.0, 0.0, 0.5);
    let stale = page.stroke(100.0, 2.0, 0.5);
    assert!(stale.iter().all(|force| *force < 1.5), "{stale:?}");
    page.made_for = before + 1;
    assert!(page.stroke(100.0, 2.0, 1.0).iter().any(|force| *force > 1.5));
}

#[test]
fn what_one_page_asks_for_is_done_in_its_order() {
    let (_folder, path) = copied();
    let studio = open(&path);
    let mut page = Page::of(&studio);
    for (request, name, value) in
        [(1, "gain", "0.5"), (2, "surface", "\"surfaces/t3-tile.ron\""), (3, "gain", "0.25")]
    {
        page.say(&json!({ "type": "parameter", "request": request, "name": name, "value": value }));
    }
    for request in 1..=3 {
        let reply = page.wait(|said| said["type"] == "reply");
        assert_eq!((&reply["request"], &reply["ok"]), (&json!(request), &json!(true)), "{reply}");
    }
    let mut next = Page::of(&studio);
    let value = |name: &str| {
        let parameters = next.graph["parameters"].as_array().expect("a list");
        let known = parameters.iter().find(|known| known["name"] == name).expect("there is one");
        known["value"].as_str().expect("a text").to_owned()
    };
    assert_eq!((value("gain"), value("surface")), ("0.25".to_owned(), "\"surfaces/t3-tile.ron\"".to_owned()));
    // More than can wait is refused, and nothing is lost of what is not.
    for request in 0..100 {
        next.say(&json!({ "type": "check", "request": request, "text": "" }));
    }
    let mut answered: Vec<u64> = Vec::new();
    while answered.len() < 100 {
        let reply = next.wait(|said| said["type"] == "reply");
        assert_eq!(reply["ok"], false);
        answered.extend(reply["request"].as_u64());
    }
    answered.sort_unstable();
    assert!(answered.into_iter().eq(0..100));
}

#[test]
fn what_exceeds_a_limit_runs_once_the_terminal_has_confirmed_it() {
    let (_folder, path) = copied();
    let studio = open(&path);
    let mut page = Page::of(&studio);
    let text = page.graph["text"].as_str().expect("a text").to_owned();
    let raised = |peak: &str| text.replace("peak_a: 0.5", &format!("peak_a: {peak}"));
    assert!(studio.proposal().is_none() && studio.confirm(1).is_err());
    let mut apply = |peak: &str| page.request(json!({ "type": "apply", "text": raised(peak) }))["ok"] == true;
    assert!(!apply("0.6"));
    let (number, beyond) = studio.proposal().expect("it was proposed");
    assert!(beyond.iter().all(|excess| excess.contains("0.6 A")), "{beyond:?}");
    // Another edit does not slip in under its number.
    assert!(!apply("0.7"));
    assert!(studio.confirm(number).is_err());
    assert!(!apply("0.7"));
    assert!(!apply("0.6"));
    let (number, _) = studio.proposal().expect("it was proposed");
    studio.confirm(number).expect("it is the latest");
    assert!(studio.proposal().is_none());
    assert!(apply("0.6"));
    assert!(!apply("0.7"));
    let saved = page.request(json!({ "type": "save", "text": raised("0.6") }));
    assert_eq!(saved["ok"], true, "{saved}");
}

#[test]
fn no_edit_from_the_page_raises_a_limit_or_changes_a_device() {
    let (_folder, path) = copied();
    let studio = open(&path);
    let mut page = Page::of(&studio);
    let text = page.graph["text"].as_str().expect("a text").to_owned();
    for (from, to) in [
        ("peak_a: 0.5", "peak_a: 0.6"),
        (
            "\"out\": ActuatorSink(",
            "\"too\": ActuatorSink(endpoint: \"haptuator\", current: Resample(\"drive\"), limit: (peak_a: 0.1, continuous_a: 0.1)), \"out\": ActuatorSink(",
        ),
        ("amperes_full_scale: 1.0", "amperes_full_scale: 0.2"),
        ("\"haptuator\": SimulatedHaptuator()", "\"haptuator\": UdpDevice(listen: \"127.0.0.1:0\")"),
        ("\"/dev/input/by-id/usb-Tablet-event-mouse\"", "\"/dev/input/event0\""),
    ] {
        assert!(text.contains(from), "{from}");
        let edited = text.replace(from, to);
        for way in ["apply", "save"] {
            let refused = page.request(json!({ "type": way, "text": edited }));
            // What has errors is refused for these.
            let is_shown = !refused["beyond"].as_array().expect("a list").is_empty()
                || !refused["diagnostics"].as_array().expect("a list").is_empty();
            assert!(refused["ok"] == false && is_shown, "{way} {to}: {refused}");
        }
    }
    let hand = page.request(json!({ "type": "parameter", "name": "hand", "value": "\"/dev/input/event0\"" }));
    assert_eq!(
        (&hand["ok"], hand["beyond"].as_array().map(|beyond| beyond.is_empty())),
        (&json!(false), Some(false))
    );
    let wrong = page.request(json!({ "type": "save", "text": text.replace("ActuatorSink", "Sink") }));
    assert_eq!((&wrong["ok"], &wrong["diagnostics"][0]["code"]), (&json!(false), &json!("E0201")));
    assert_eq!(std::fs::read_to_string(&path).expect("it is there"), text);
    // Down, and up again as far as it was.
    for lower in [text.replace("peak_a: 0.5", "peak_a: 0.3"), text] {
        for way in ["apply", "save"] {
            let reply = page.request(json!({ "type": way, "text": lower }));
            assert_eq!(reply["ok"], true, "{way}: {reply}");
        }
    }
}

#[test]
fn a_recorded_stroke_is_done_again_with_the_same_samples() {
    let out = tempfile::tempdir().expect("a folder");
    let studio = open_with(&shipped("texturepad.ron"), out.path());
    let mut page = Page::of(&studio);
    page.say(&json!({ "type": "scope", "ports": [{ "name": "out.delivered", "raw": true }] }));
    page.say(&json!({ "type": "record", "on": true }));
    page.wait(|said| said["type"] == "graph");
    let mut felt = page.stroke(100.0, 1.0, 1.0);
    page.say(&json!({ "type": "set", "name": "out.gain", "value": 0.1 }));
    felt.extend(page.stroke(150.0, 0.5, 0.5));
    page.say(&json!({ "type": "record", "on": false }));
    let kept = page.wait(|said| said["type"] == "recording");
    let rate_hz = kept["recording"]["rate_hz"].as_f64().expect("a rate");
    let frames = kept["recording"]["frames"].as_u64().expect("a number") as usize;
    assert!(frames as f64 > rate_hz && rms(&felt) > 1e-3);
    let folder = PathBuf::from(kept["saved"].as_str().expect("it is saved"));
    for name in ["strokes.json", "texture.wav", "current.wav", "report.html"] {
        assert!(folder.join(name).metadata().is_ok_and(|file| file.len() > 1000), "{name}");
    }
    let facts = std::fs::read(folder.join("run.json")).expect("it is there");
    let facts: Value = serde_json::from_slice(&facts).expect("JSON");
    assert!(facts["driver_frames"].as_u64().is_some_and(|run| run >= frames as u64), "{facts}");
    let shown = std::fs::read_to_string(folder.join("report.html")).expect("it is there");
    // As of any run: signals, files, the sound of the actuator, the plot that the graph asks for, the strokes on the map.
    for part in ["texture/filter.acceleration", "texture.wav", "<audio", "texture/locate.weights"] {
        assert!(shown.contains(part), "{part}");
    }
    page.say(&json!({ "type": "replay", "request": 0, "recording": kept["recording"] }));
    page.wait(|said| said["type"] == "graph");
    let reply = page.wait(|said| said["type"] == "reply");
    assert_eq!(reply["ok"], true, "{reply}");
    let count = frames.min(felt.len());
    let again = page.stroke(0.0, 0.0, count as f64 / rate_hz);
    let differs = (0..count).find(|at| felt[*at] != again[*at]);
    assert_eq!(differs, None, "of {count} samples, bit for bit");
    page.wait(|said| said["type"] == "status" && said["replay"].is_null() && said["state"] == "running");
    let mut damaged = kept["recording"].clone();
    damaged["moves"][3][4] = json!(1_000_000_000);
    assert_eq!(page.request(json!({ "type": "replay", "recording": damaged }))["ok"], false);
}

#[test]
fn a_stop_is_heard_from_any_page_and_only_the_owner_moves_anything() {
    let studio = open(&shipped("texturepad.ron"));
    let (mut owner, mut guest) = (Page::of(&studio), Page::of(&studio));
    guest.say(&json!({ "type": "scope", "ports": [{ "name": "out.delivered", "raw": true }] }));
    assert!(rms(&guest.stroke(100.0, 1.0, 1.0)) < 1e-9, "a guest moves nothing");
    assert_eq!(guest.request(json!({ "type": "apply", "text": "" }))["ok"], false);
    guest.say(&json!({ "type": "set", "name": "out.gain", "value": 0.5 }));
    guest.wait(|said| said["type"] == "refused");
    guest.say(&json!({ "type": "stop" }));
    owner.wait(|said| said["type"] == "status" && said["state"] == "stopped");
    owner.say(&json!({ "type": "resume" }));
    owner.wait(|said| said["type"] == "status" && said["state"] == "running");
    guest.say(&json!({ "type": "own" }));
    guest.wait(|said| said["type"] == "status" && said["owner"] == true);
    assert!(rms(&guest.stroke(100.0, 1.0, 2.0)) > 1e-3);
}

#[test]
fn a_page_that_sends_much_in_turn_stays_connected() {
    let studio = open(&shipped("texturepad.ron"));
    let mut page = Page::of(&studio);
    // Together more than may be queued.
    for _ in 0..110 {
        let reply = page.request(json!({ "type": "check", "text": "x".repeat(1_000_000) }));
        assert_eq!(reply["ok"], false);
    }
}

#[test]
fn a_stop_is_heard_from_a_page_that_does_not_read() {
    let studio = open(&shipped("texturepad.ron"));
    let (mut deaf, mut owner) = (Page::of(&studio), Page::of(&studio));
    // More than a socket holds: every edit sends the graph to all pages.
    deaf.say(&json!({ "type": "own" }));
    let text = deaf.graph["text"].as_str().expect("a text").to_owned();
    let long = format!("{text}\n//{}", "x".repeat(300_000));
    for request in 0..30 {
        deaf.say(&json!({ "type": "apply", "request": request, "text": long }));
        owner.wait(|said| said["type"] == "graph");
    }
    deaf.say(&json!({ "type": "stop" }));
    owner.wait(|said| said["type"] == "status" && said["state"] == "stopped");
    // It was indeed too full to write to, so that it is let go.
    owner.wait(|said| said["type"] == "status" && said["pages"] == 1);
}

#[test]
fn a_message_of_any_length_is_refused_by_its_header() {
    let studio = open(&shipped("texturepad.ron"));
    let (mut long, mut owner) = (Page::of(&studio), Page::of(&studio));
    let MaybeTlsStream::Plain(stream) = long.socket.get_mut() else {
        panic!("it is not encrypted");
    };
    // A masked text of a terabyte.
    let header = [&[0x81, 0xff][..], &(1_u64 << 40).to_be_bytes(), &[0; 4]].concat();
    stream.write_all(&header).expect("sent");
    owner.wait(|said| said["type"] == "status" && said["pages"] == 1 && said["state"] == "running");
}

#[test]
fn a_page_that_goes_is_a_silence() {
    let studio = open(&shipped("texturepad.ron"));
    let mut first = Page::of(&studio);
    first.say(&json!({ "type": "scope", "ports": [{ "name": "out.delivered", "raw": true }] }));
    assert!(rms(&first.stroke(100.0, 1.0, 1.5)) > 1e-3);
    drop(first);
    let mut next = Page::of(&studio);
    let silent = next.wait(|said| said["type"] == "status" && said["silent"][0]["input"] == "stylus");
    next.wait(|said| said["type"] == "status" && said["actuators"][0]["peak"] == 0.0);
    assert_eq!(silent["state"], "running");
}

/// The status line and the headers of a plain request.
fn asked(studio: &Studio, head: &str) -> String {
    let mut stream = TcpStream::connect(studio.address()).expect("it listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
    write!(stream, "{head}\r\nConnection: close\r\n\r\n").expect("sent");
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    let answer = String::from_utf8_lossy(&answer);
    answer.split("\r\n\r\n").next().unwrap_or_default().to_owned()
}

#[test]
fn only_its_own_page_with_the_token_is_let_in() {
    let studio = open(&shipped("texturepad.ron"));
    let (host, token) = (studio.address(), studio.token());
    let page = format!("GET /?token={token} HTTP/1.1\r\nHost: ");
    let live = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==";
    for (head, status) in [
        (format!("{page}{host}"), "200"),
        (format!("{page}evil.example"), "403"),
        (format!("{page}evil.example:{}", host.port()), "403"),
        (format!("{page}{host}\r\nHost: evil.example"), "403"),
        (format!("{page}evil.example\r\nHost: {host}"), "403"),
        (format!("{page}{host}\r\nHost: {host}"), "403"),
        (format!("{page}{host}\r\nOrigin: http://evil.example"), "403"),
        (format!("{page}{host}\r\nOrigin: null"), "403"),
        (format!("GET / HTTP/1.1\r\nHost: {host}"), "403"),
        (format!("GET /?token={token}0 HTTP/1.1\r\nHost: {host}"), "403"),
        (format!("GET /?token= HTTP/1.1\r\nHost: {host}"), "403"),
        (format!("GET /../../../etc/passwd HTTP/1.1\r\nHost: {host}"), "404"),
        (
            format!(
                "GET /live?token={token} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://evil.example\r\n{live}"
            ),
            "403",
        ),
        (format!("GET /live?token={token} HTTP/1.1\r\nHost: {host}\r\n{live}"), "403"),
        (format!("GET /live?token=x HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n{live}"), "403"),
    ] {
        let answer = asked(&studio, &head);
        let first = answer.lines().next().unwrap_or_default();
        assert!(first.contains(status), "{head}: {answer}");
        // No page of this server calls another.
        let policy = answer.lines().find_map(|line| line.strip_prefix("content-security-policy: "));
        let mut policy: Vec<&str> = policy.unwrap_or_default().split("; ").collect();
        policy.sort_unstable();
        let port = host.port();
        let calls = format!("connect-src 'self' ws://127.0.0.1:{port} ws://localhost:{port}");
        let wanted = [
            "base-uri 'none'",
            &calls,
            "default-src 'self'",
            "form-action 'none'",
            "frame-ancestors 'none'",
            "img-src 'self' data: blob:",
            "style-src 'self' 'unsafe-inline'",
        ];
        assert_eq!(policy, wanted, "{answer}");
    }
}

#[test]
fn ten_thousand_hostile_messages_move_nothing_and_end_nothing() {
    let (folder, path) = copied();
    let before = std::fs::read_to_string(&path).expect("it is there");
    let studio = open(&path);
    let mut watching = Page::of(&studio);
    // It is the first: the others own what they attack.
    common::attack(&studio);
    let status = watching.wait(|said| {
        let few = said["pages"].as_u64().is_some_and(|pages| pages <= 2);
        said["type"] == "status" && few && said["state"] == "running"
    });
    assert_eq!(status["actuators"][0]["delivered_peak"], 0.0);
    assert_eq!(std::fs::read_to_string(&path).expect("it is there"), before);
    let surfaces = std::fs::read_dir(folder.path().join("surfaces")).expect("a folder");
    assert_eq!(surfaces.count(), 2, "nothing was learned");
}

const FADER: &str = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) }, nodes: {
    "level": LiveInput(clock: "servo", endpoint: "level", quantity: "current"),
    "out": ActuatorSink(current: "level", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
}, endpoints: { "simulated": { "level": SimulatedInput(to: [0, 0.5], period_s: 0.5), "coil": SimulatedHaptuator() } })"#;

/// Samples of the first scope that come within `PATIENCE`, until one is as wanted.
fn comes(page: &mut Page, is_wanted: impl Fn(f32) -> bool) -> bool {
    let asked = Instant::now();
    while asked.elapsed() < PATIENCE {
        if let Message::Binary(bytes) = page.socket.read().expect("it goes on")
            && bytes[0] == 2
            && bytes[24..]
                .chunks_exact(4)
                .any(|four| is_wanted(f32::from_le_bytes(four.try_into().expect("four"))))
        {
            return true;
        }
    }
    false
}

#[test]
fn a_page_moves_a_fader_hands_it_back_and_replays_both() {
    let out = tempfile::tempdir().expect("a folder");
    let path = out.path().join("fader.ron");
    std::fs::write(&path, FADER).expect("written");
    let studio = open_with(&path, out.path());
    let mut page = Page::of(&studio);
    let input =
        json!({ "endpoint": "level", "channel": "value", "port": "level.value", "min": 0.0, "max": 0.5 });
    assert_eq!((&page.graph["inputs"], &page.graph["others"]), (&json!([input]), &json!([])));
    page.say(&json!({ "type": "scope", "ports": [{ "name": "out.delivered", "raw": true }] }));
    page.say(&json!({ "type": "record", "on": true }));
    page.wait(|said| said["type"] == "graph");
    // The graph's own: up to half an ampere. Then circles of 30 of 100 mm about the middle; then the graph's own again.
    assert!(comes(&mut page, |current| current > 0.49));
    let mut felt = page.stroke(200.0, 1.0, 1.5);
    let held = &felt[felt.len() / 2..];
    assert!(held.iter().all(|current| (0.17..0.33).contains(current)), "{held:?}");
    page.point(0.0, 0.0, 0.0);
    assert!(comes(&mut page, |current| current > 0.49));
    // What is held falls silent.
    page.point(0.0, 0.0, 1.0);
    assert!(comes(&mut page, |current| current == 0.0));
    page.say(&json!({ "type": "record", "on": false }));
    let kept = page.wait(|said| said["type"] == "recording")["recording"].clone();
    page.wait(|said| said["type"] == "status" && said["recording_s"].is_null() && said["state"] == "running");
    // A wake-up that is late may skip frames: then once more.
    let mut runs = (0..8).filter_map(|_| {
        let late = late_wakes(&mut page);
        page.say(&json!({ "type": "replay", "request": 0, "recording": kept }));
        page.wait(|said| said["type"] == "graph");
        let frames = kept["frames"].as_f64().expect("a number");
        let run = page.stroke(0.0, 0.0, frames / 1e3);
        page.wait(|said| said["type"] == "status" && said["replay"].is_null() && said["state"] == "running");
        (late_wakes(&mut page) == late).then_some(run)
    });
    let (one, other) = (runs.next().expect("a run in time"), runs.next().expect("a run in time"));
    assert!(one.iter().zip(&other).all(|(a, b)| a == b), "two replays differ");
    // What was felt is in it, bit for bit.
    felt.drain(..felt.len() / 2);
    assert!(one.windows(felt.len()).any(|part| part == felt), "it is not what was felt");
}
