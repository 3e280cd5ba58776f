//! A study on its two pages, as browsers meet them: by messages.

mod common;

use common::{PATIENCE, Page, participant_token, study};
use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, NodeEntry, NodeKind, Port, Processor, Tick,
};
use haptograph_engine::registry::Registry;
use haptograph_engine::settings::NoSettings;
use haptograph_signal::quantity::Quantity;
use haptograph_studio::{Options, Studio};
use haptograph_study::data::{Folder, Row, Status};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

fn main_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().expect("it is there")
}

/// A study of two phases on the TexturePad, whose surfaces and versions have names that can be found in no other text.
fn text() -> String {
    let graphs = main_folder().join("graphs");
    let graphs = graphs.display();
    format!(
        r#"Study(
    format: 1,
    graph: "{graphs}/texturepad.ron",
    seed: 3,
    surfaces: {{
        "zircon": (file: "{graphs}/surfaces/t2-canvas.ron", sample: "tray zulu"),
        "wolfram": (file: "{graphs}/surfaces/t5-vinyl.ron"),
    }},
    versions: {{ "quokka": {{}}, "xylem": {{ "gain": 0.8125 }} }},
    scales: {{ "bogey": (ask: "How rough is it?", from: "smooth", to: "rough") }},
    measures: ["stylus.force"],
    phases: {{
        "marmot": Rate(stimuli: [Real, Virtual(version: "xylem")]),
        "jaguar": Pairs(scale: "bogey", surfaces: ["wolfram"], stimuli: [Virtual]),
        "yak": Questions(questions: {{ "vole": Choice(ask: "Which hand?", of: ["right", "left"]) }}),
    }},
)"#
    )
}

/// What no participant may read.
const SECRETS: [&str; 16] = [
    "zircon",
    "wolfram",
    "zulu",
    "quokka",
    "xylem",
    "0.8125",
    "bogey",
    "marmot",
    "jaguar",
    "vole",
    "canvas",
    "vinyl",
    ".ron",
    "gain",
    "texturepad",
    "stylus",
];

struct Session {
    _folder: tempfile::TempDir,
    data: PathBuf,
    studio: Studio,
    experimenter: Page,
    participant: Page,
}

fn registry() -> Registry {
    haptograph_nodes::registry()
}

fn session(text: &str) -> Session {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, data) = (folder.path().join("study.ron"), folder.path().join("data"));
    std::fs::write(&path, text).expect("written");
    let studio = study(&path, &data, &registry());
    let experimenter = Page::let_in(studio.address(), studio.token());
    let participant = Page::let_in(studio.address(), &participant_token(&studio));
    Session { _folder: folder, data, studio, experimenter, participant }
}

/// The status of the answer to a request.
fn status(address: SocketAddr, path: &str) -> u16 {
    let mut stream = TcpStream::connect(address).expect("it listens");
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").expect("sent");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("an answer");
    answer.split(' ').nth(1).and_then(|status| status.parse().ok()).expect("a status")
}

fn say(page: &mut Page, mut what: Value) {
    what["type"] = "study".into();
    page.say(&what);
}

fn rows(data: &Path) -> Vec<Row> {
    Folder::existing(data).expect("a folder").rows().expect("a table")
}

impl Session {
    fn begin(&mut self, code: &str) {
        say(&mut self.experimenter, json!({ "say": "begin", "code": code, "group": "all" }));
    }

    fn agree(&mut self) {
        self.participant.wait(|said| said["state"] == "consent");
        say(&mut self.participant, json!({ "say": "agree" }));
    }

    /// Waits until something can be felt or answered; the experimenter lays out what the page asks for.
    fn trial(&mut self) -> Value {
        let asked = Instant::now();
        while asked.elapsed() < PATIENCE {
            let view = self.participant.wait(|said| said["type"] == "participant");
            match (view["state"].as_str(), view["begins"].as_bool()) {
                (Some("done"), _) | (Some("trial"), Some(false)) => return view,
                (Some("wait" | "stopped"), _) => say(&mut self.experimenter, json!({ "say": "ready" })),
                _ => {}
            }
        }
        panic!("no trial came")
    }

    /// The first trial of a rendered surface.
    fn rendered_trial(&mut self) -> Value {
        loop {
            let view = self.trial();
            if view["pad"] == true {
                return view;
            }
            self.answer(&view, json!({ "rating": 0.5 }));
        }
    }

    /// Feels what there is, and answers.
    fn answer(&mut self, view: &Value, mut answer: Value) {
        if view["pad"] == true {
            self.stroke();
        }
        if view["turns"].is_object() {
            assert_eq!(view["open"], false, "only one of two was felt");
            say(&mut self.participant, json!({ "say": "feel", "place": 1 }));
            self.participant.wait(|said| said["turns"]["now"] == 1 && said["begins"] == false);
            self.stroke();
        }
        if view["open"] == false {
            let trial = view["trial"].clone();
            self.participant.wait(|said| said["trial"] == trial && said["open"] == true);
        }
        (answer["say"], answer["trial"]) = ("answer".into(), view["trial"].clone());
        say(&mut self.participant, answer);
    }

    /// Strokes on the pad.
    fn stroke(&mut self) {
        for step in 0..20_u8 {
            self.participant.point(f32::from(step), 0.0, 1.0);
            std::thread::sleep(Duration::from_millis(10));
        }
        self.participant.point(20.0, 0.0, 0.0);
    }
}

#[test]
fn a_session_keeps_each_answer_and_its_runs_and_no_name_reaches_the_participant() {
    let mut session = session(&text());
    session.begin("P07");
    assert!(!session.data.join("participants.csv").exists(), "kept before the participant agreed");
    session.agree();
    let mut strokes = 0;
    loop {
        let view = session.trial();
        if view["state"] == "done" {
            break;
        }
        strokes += u32::from(view["pad"] == true);
        match view["input"]["kind"].as_str() {
            Some("line") => session.answer(&view, json!({ "rating": 0.25 })),
            _ => session.answer(&view, json!({ "choice": 1 })),
        }
    }
    let rows = rows(&session.data);
    let of = |phase: &str| rows.iter().filter(|row| row.phase == phase).count();
    assert_eq!([of("marmot"), of("jaguar"), of("yak"), rows.len()], [3, 1, 1, 5]);
    assert!(rows.iter().all(|row| row.status == Status::Answered && !row.simulated && row.attempt == 1));
    assert!(rows.iter().filter(|row| row.phase != "yak").all(|row| row.rating == Some(0.25)));
    assert_eq!(rows.last().map(|row| row.choice.as_str()), Some("left"));
    assert_eq!(strokes, 3);
    // Of the real surface no run: all devices are simulated. Of the pair two.
    let runs = std::fs::read_dir(session.data.join("signals/P07")).expect("a folder").count();
    assert_eq!(runs, 4);
    let measured = Folder::existing(&session.data).expect("a folder").measures().expect("a table");
    let largest = measured.iter().filter(|of| of.name == "stylus.force largest");
    assert!(
        largest.clone().count() == 2 && largest.clone().all(|of| of.value > 0.9 && of.unit == "N"),
        "{measured:?}"
    );
    let heard = session.participant.heard.join("\n").to_lowercase();
    let found: Vec<&str> = SECRETS.into_iter().filter(|secret| heard.contains(secret)).collect();
    assert!(found.is_empty() && heard.len() > 1000, "{found:?} in {heard}");
    let kinds: Vec<Value> =
        session.participant.heard.iter().map(|text| serde_json::from_str(text).expect("JSON")).collect();
    assert!(kinds.iter().all(|said: &Value| said["type"] == "hello" || said["type"] == "participant"));
}

#[test]
fn each_page_can_only_do_what_is_its_own_and_nobody_comes_without_a_token() {
    let mut session = session(&text());
    let refused = |page: &mut Page, what: &Value| {
        page.say(what);
        page.wait(|said| said["type"] == "refused");
    };
    for what in [
        json!({ "type": "study", "say": "begin", "code": "P1", "group": "all" }),
        json!({ "type": "study", "say": "ready" }),
        json!({ "type": "study", "say": "skip" }),
        json!({ "type": "set", "name": "out.gain", "value": 0.5 }),
        json!({ "type": "scope", "ports": [{ "name": "out.delivered" }] }),
        json!({ "type": "levels", "on": true }),
        json!({ "type": "own" }),
        json!({ "type": "arm" }),
        json!({ "type": "hold" }),
        json!({ "type": "resume" }),
        json!({ "type": "parameter", "request": 1, "name": "gain", "value": "2" }),
        json!({ "type": "check", "request": 2, "text": "" }),
        json!({ "type": "apply", "request": 3, "text": "" }),
    ] {
        refused(&mut session.participant, &what);
    }
    for what in [
        json!({ "type": "study", "say": "agree" }),
        json!({ "type": "study", "say": "answer", "trial": 1, "rating": 0.5 }),
        json!({ "type": "own" }),
        json!({ "type": "arm" }),
        json!({ "type": "resume" }),
        json!({ "type": "set", "name": "out.gain", "value": 0.5 }),
    ] {
        refused(&mut session.experimenter, &what);
    }
    let address = session.studio.address();
    for token in ["", "0123456789abcdef0123456789abcdef"] {
        assert_eq!(status(address, &format!("/?token={token}")), 403);
    }
    assert_eq!(status(address, &format!("/report/any?token={}", participant_token(&session.studio))), 403);
}

#[test]
fn a_stop_of_the_participant_ends_the_run_and_the_trial_goes_on_afterwards() {
    let mut session = session(&text());
    session.begin("P07");
    session.agree();
    let view = session.rendered_trial();
    session.participant.say(&json!({ "type": "stop" }));
    session.participant.wait(|said| said["state"] == "stopped");
    let held = session.experimenter.wait(|said| said["session"]["held"] == "STOP of the participant");
    assert_eq!(held["session"]["state"], "preparing");
    // A press that came with the STOP does not undo it.
    say(&mut session.experimenter, json!({ "say": "ready" }));
    std::thread::sleep(Duration::from_millis(1100));
    say(&mut session.experimenter, json!({ "say": "ready" }));
    let again = session.trial();
    assert_eq!(again["trial"], view["trial"]);
    session.answer(&again, json!({ "rating": 0.5 }));
    session.trial();
    let rows = rows(&session.data);
    assert_eq!(rows.last().map(|row| (row.attempt, row.status)), Some((1, Status::Answered)));
    let notes = std::fs::read_to_string(session.data.join("notes.csv")).expect("a note");
    assert!(notes.contains(",STOP"), "{notes}");
}

#[test]
fn a_session_that_was_cut_goes_on_at_the_first_trial_without_an_answer() {
    let mut first = session(&text());
    first.begin("P07");
    first.agree();
    let view = first.trial();
    first.answer(&view, json!({ "rating": 0.5 }));
    let second = first.trial();
    let Session { _folder: folder, data, studio: served, .. } = first;
    drop(served);
    let studio = study(&folder.path().join("study.ron"), &data, &registry());
    let experimenter = Page::let_in(studio.address(), studio.token());
    let participant = Page::let_in(studio.address(), &participant_token(&studio));
    let mut again = Session { _folder: folder, data, studio, experimenter, participant };
    again.begin("P07");
    let view = again.trial();
    assert_eq!((view["trial"].as_u64(), &view["trial"]), (Some(2), &second["trial"]));
    again.answer(&view, json!({ "rating": 0.5 }));
    again.trial();
    let numbers: Vec<(u32, u32)> = rows(&again.data).iter().map(|row| (row.trial, row.attempt)).collect();
    assert_eq!(numbers, [(1, 1), (2, 1)]);
    // Who withdraws leaves a line.
    say(&mut again.experimenter, json!({ "say": "withdraw" }));
    again.experimenter.wait(|said| said["participants"][0]["withdrawn"] == true);
    assert!(rows(&again.data).is_empty() && !again.data.join("signals/P07").exists());
}

#[test]
fn takes_of_people_are_named_as_evaluate_reads_them() {
    let graph = main_folder().join("graphs/recorder.ron");
    let text = format!(
        r#"Study(format: 1, graph: "{}", surface_parameter: "material",
            surfaces: {{ "T1": (sample: "tray 1"), "T4": (sample: "tray 4") }},
            phases: {{ "takes": Record(seconds: 0.5, takes: 2) }})"#,
        graph.display()
    );
    let mut session = session(&text);
    session.begin("P03");
    session.agree();
    while session.trial()["state"] != "done" {}
    let mut takes: Vec<String> = haptograph_signal::files::list(&session.data.join("recordings"))
        .iter()
        .map(|path| path.file_name().expect("a name").to_string_lossy().into_owned())
        .collect();
    takes.sort();
    assert_eq!(takes, ["T1.P03.1.npz", "T1.P03.2.npz", "T4.P03.1.npz", "T4.P03.2.npz"]);
    assert!(rows(&session.data).iter().all(|row| row.exploration_s >= 0.5 && row.exploration_s < 60.0));
    say(&mut session.experimenter, json!({ "say": "withdraw" }));
    session.experimenter.wait(|said| said["participants"][0]["withdrawn"] == true);
    assert!(haptograph_signal::files::list(&session.data.join("recordings")).is_empty());
}

#[test]
fn the_run_of_a_trial_is_replayed_with_the_same_samples() {
    let mut session = session(&text());
    session.begin("P07");
    session.agree();
    let view = session.rendered_trial();
    session.answer(&view, json!({ "rating": 0.5 }));
    session.trial();
    let run = session.data.join(format!("signals/P07/{:03}-1-1", view["trial"].as_u64().expect("a number")));
    let recording: Value =
        serde_json::from_slice(&std::fs::read(run.join("strokes.json")).expect("kept")).expect("JSON");
    assert!(recording["seed"].is_u64(), "{recording}");
    let kept = std::fs::read(run.join("current.wav")).expect("kept");
    let kept: Vec<f32> = wav_samples(&kept);
    // The graph alone, with the parameters of the recording.
    let set = recording["set"].as_array().expect("a list").iter().map(|pair| {
        let [name, value] = [0, 1].map(|at| pair[at].as_str().expect("text").to_owned());
        (name, value)
    });
    let options = Options {
        graph: main_folder().join("graphs/texturepad.ron"),
        set: set.collect(),
        endpoints: None,
        port: 0,
        out: session.data.join("replays"),
        surfaces: Vec::new(),
        lan: None,
        learner: None,
    };
    let studio = Studio::open(&options, &registry()).expect("a studio");
    let mut page = Page::of(&studio);
    page.say(&json!({ "type": "scope", "ports": [{ "name": "out.delivered", "raw": true }] }));
    page.say(&json!({ "type": "replay", "request": 0, "recording": recording }));
    page.wait(|said| said["type"] == "graph");
    let reply = page.wait(|said| said["type"] == "reply");
    assert_eq!(reply["change"], "of this graph: the same samples", "{reply}");
    let frames = recording["frames"].as_u64().expect("a number") as usize;
    let again = page.stroke(0.0, 0.0, frames as f64 / 48_000.0);
    let largest = kept.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    assert!(frames > 4800 && kept.len() >= frames && largest > 1e-4, "{frames} frames, {largest}");
    let differs = (0..frames.min(again.len())).find(|at| kept[*at] != again[*at]);
    assert_eq!(differs, None, "of {frames} samples, bit for bit");
}

/// The samples of a WAV file of 32-bit floating point numbers.
fn wav_samples(file: &[u8]) -> Vec<f32> {
    let at = file.windows(4).position(|name| name == b"data").expect("its data") + 8;
    file[at..].chunks_exact(4).map(|four| f32::from_le_bytes(four.try_into().expect("four"))).collect()
}

haptograph_engine::node! {
    /// Panics while [`BREAKS`] is set.
    pub struct Broken(NoSettings) in "mine";
    example: r#""broken": Broken(input: "texture")"#;
    in INPUT: Scalar = Port::of(Quantity::ACCELERATION, "Of the texture.");
    out OUTPUT: Scalar = Port::of(Quantity::ACCELERATION, "The same.");
}

static BREAKS: AtomicBool = AtomicBool::new(false);

impl NodeKind for Broken {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Passing))
    }
}

#[derive(Clone)]
struct Passing;

impl Processor<Broken> for Passing {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Broken>) {
        assert!(!BREAKS.load(Ordering::Relaxed), "broken for the test");
        let input = io.read(Broken::INPUT);
        io.write(Broken::OUTPUT).copy_from_slice(input);
    }
}

#[test]
fn a_trial_whose_graph_panicked_is_tried_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = std::fs::read_to_string(main_folder().join("graphs/texturepad.ron")).expect("it is there");
    let broken = r#"DynamicCompensator(acceleration: "broken"), "broken": Broken(input: "texture")"#;
    let graph = graph.replace(r#"DynamicCompensator(acceleration: "texture")"#, broken);
    let graph = graph.replace(
        "surfaces/t2-canvas.ron",
        &format!("{}/graphs/surfaces/t2-canvas.ron", main_folder().display()),
    );
    std::fs::write(folder.path().join("g.ron"), graph).expect("written");
    let text =
        r#"Study(format: 1, graph: "g.ron", surfaces: {}, phases: { "try": Practice(text: "Feel.") })"#;
    std::fs::write(folder.path().join("study.ron"), text).expect("written");
    let mut registry = registry();
    registry.add(NodeEntry::processor::<Broken>());
    let data = folder.path().join("data");
    let studio = study(&folder.path().join("study.ron"), &data, &registry);
    let experimenter = Page::let_in(studio.address(), studio.token());
    let participant = Page::let_in(studio.address(), &participant_token(&studio));
    let mut session = Session { _folder: folder, data, studio, experimenter, participant };
    session.begin("P1");
    session.agree();
    session.trial();
    BREAKS.store(true, Ordering::Relaxed);
    session.experimenter.wait(|said| said["session"]["held"] == "the run ended");
    BREAKS.store(false, Ordering::Relaxed);
    std::thread::sleep(Duration::from_millis(1000));
    say(&mut session.experimenter, json!({ "say": "ready" }));
    session.participant.wait(|said| said["state"] == "trial" && said["begins"] == false);
}
