//! What is fuzzed: each target takes any bytes, panics where something is wrong with the program, and says whether the
//! bytes were accepted. `tests/seeds.rs` of the workspace runs the same code on the seeds.

use haptograph_engine::diagnostic::{render, to_json};
use haptograph_engine::document::Document;
use haptograph_engine::document::value::{Body, Shape, Tagged, Value};
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::registry::Registry;
use haptograph_engine::run::{ARRIVALS, FileSinks, ReplayBounds, Session, SessionOptions};
use haptograph_learning::learn::{LearnSettings, learn};
use haptograph_learning::recording::{self, AnyRecording, ImportSettings};
use haptograph_live::osc::parse_settings;
use haptograph_live::udp::protocol::{Command, State};
use haptograph_nodes::actuators::identify::{Known, Sweep, identify};
use haptograph_nodes::contact::mesh::{MeshFormat, TriangleMesh};
use haptograph_nodes::wav::{self, Repair};
use haptograph_report::learning::page;
use haptograph_report::swatch;
use haptograph_surfaces::files::{native, read_surface};
use std::fmt::Display;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// A target by its name.
pub type Target = (&'static str, fn(&[u8]) -> bool);

/// All targets.
pub const TARGETS: [Target; 11] = [
    ("graph", graph),
    ("learn", learn_table),
    ("mesh", mesh),
    ("packet", packet),
    ("recording", recording),
    ("replay", replay),
    ("ron", ron),
    ("surface", surface),
    ("sweep", sweep),
    ("table", table),
    ("wav", wav),
];

/// The value, if there is one; an error has to say why not.
fn accepted<T, E: Display>(result: Result<T, E>) -> Option<T> {
    result.map_err(|error| assert!(!error.to_string().is_empty())).ok()
}

/// A folder with a file of these bytes, for what is read from files only.
fn in_a_file(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("fuzzed");
    std::fs::write(&path, bytes).expect("it can be written");
    (folder, path)
}

static REGISTRY: LazyLock<Registry> = LazyLock::new(haptograph_nodes::registry);

/// Any text is a graph or at least one finding that can be shown; a sound graph can be planned and run.
pub fn graph(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return false;
    };
    let found = Document::parse("graphs/fuzzed.ron", text)
        .and_then(|document| check(&document, &REGISTRY, &CheckOptions::default()));
    match found {
        Ok(graph) => {
            let options = SessionOptions::default().seconds(0.002);
            let _ = Session::run_offline(FileSinks::new(&graph), &options, &mut |_| {});
            true
        }
        Err(diagnostics) => {
            assert!(!diagnostics.list.is_empty());
            assert!(!render(&diagnostics, false).is_empty());
            assert!(to_json(&diagnostics).starts_with('['));
            false
        }
    }
}

/// What RON has and graphs have no use for; texts with any of it may be refused.
const NOT_OF_GRAPHS: [&str; 21] = [
    "'", "b\"", "br", "..", "r#", "#!", "inff", "NaNf", "i8", "i16", "i32", "i64", "i128", "u8", "u16",
    "u32", "u64", "u128", "f32", "f64", "\u{feff}",
];

/// Our reader and the `ron` crate take the same texts for the same values.
pub fn ron(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return false;
    };
    let ours = Value::parse(text);
    if NOT_OF_GRAPHS.iter().any(|part| text.contains(part)) {
        return ours.is_ok();
    }
    match (&ours, ron::from_str::<ron::Value>(text)) {
        (Ok(ours), Ok(theirs)) => assert_eq!(plain(ours), plain_of_ron(theirs), "{text:?}"),
        // `Some` without a value is a name like any other to us.
        (Ok(_), Err(error)) => assert!(text.contains("Some"), "ron refuses {text:?}: {error}"),
        (Err(findings), Ok(_)) => {
            // The depth of brackets is bounded; a structure's fields are names.
            let bounded = |code: &str| ["E0104"].contains(&code);
            assert!(findings.list.iter().any(|one| bounded(one.code)), "{text:?}: {findings}");
        }
        (Err(_), Err(_)) => {}
    }
    ours.is_ok()
}

/// A value without its places, as `ron` has it; numbers are all of one type.
fn plain(value: &Value) -> ron::Value {
    match &value.shape {
        Shape::Unit => nothing(),
        Shape::Bool(is) => ron::Value::Bool(*is),
        Shape::Number(number, _) => number_of(*number),
        Shape::String(text) => ron::Value::String(text.clone()),
        Shape::List(items) => ron::Value::Seq(items.iter().map(plain).collect()),
        Shape::Map(pairs) => pairs.iter().map(|(key, value)| (plain(key), plain(value))).collect(),
        Shape::Tagged(Tagged { name, body }) => match (name.as_ref().map(|name| name.text.as_str()), body) {
            (Some("None"), Body::Bare) => ron::Value::Option(None),
            (Some("Some"), Body::Tuple(items)) if items.len() == 1 => {
                ron::Value::Option(Some(Box::new(plain(&items[0]))))
            }
            (_, Body::Bare) => nothing(),
            (_, Body::Tuple(items)) => ron::Value::Seq(items.iter().map(plain).collect()),
            (_, Body::Fields(fields)) => {
                { fields.iter() }.map(|(name, value)| (name.text.clone(), plain(value))).collect()
            }
        },
    }
}

/// `()` and `( )` alike, of which `ron` makes a unit and an empty tuple.
fn nothing() -> ron::Value {
    ron::Value::Seq(Vec::new())
}

/// `-0` has a sign to us, and is an integer to `ron`.
fn number_of(number: f64) -> ron::Value {
    ron::Value::Number(ron::value::Number::F64((number + 0.0).into()))
}

fn plain_of_ron(value: ron::Value) -> ron::Value {
    match value {
        ron::Value::Unit => nothing(),
        ron::Value::Number(number) => number_of(number.into_f64()),
        ron::Value::Seq(items) => ron::Value::Seq(items.into_iter().map(plain_of_ron).collect()),
        ron::Value::Option(inner) => ron::Value::Option(inner.map(|inner| Box::new(plain_of_ron(*inner)))),
        ron::Value::Map(pairs) => {
            { pairs.into_iter() }.map(|(key, value)| (plain_of_ron(key), plain_of_ron(value))).collect()
        }
        other => other,
    }
}

/// Any bytes are a surface or an error; a surface is the same after it was written and read again.
pub fn surface(bytes: &[u8]) -> bool {
    let Some(surface) = accepted(read_surface(bytes)) else {
        return false;
    };
    assert_eq!(read_surface(native::write(&surface).as_bytes()), Ok(surface));
    true
}

/// Any bytes are a recording or an error, in haptograph's formats; a recording can be written.
pub fn recording(bytes: &[u8]) -> bool {
    let _ = accepted(recording::read_column(bytes, "x"));
    let _ = recording::read_signal(bytes, None);
    let read = [recording::read_csv(bytes, "fuzzed"), recording::read_archive(bytes)];
    let recordings: Vec<AnyRecording> = read.into_iter().filter_map(accepted).collect();
    for recording in &recordings {
        assert!(recording::write_archive(recording).is_ok());
        assert!(recording::write_csv(recording).is_ok());
    }
    !recordings.is_empty()
}

/// Any file is a recording or an error: tables of loggers as CSV, spreadsheets, MATLAB's and WAV files.
pub fn table(bytes: &[u8]) -> bool {
    let (_folder, path) = in_a_file(bytes);
    let lenient =
        ImportSettings { rate_hz: Some(1000.0), full_scale_m_s2: Some(20.0), ..ImportSettings::default() };
    let known = { lenient.clone().with_constant("force_normal_n", "1") }
        .and_then(|import| import.with_constant("speed_mm_s", "50"))
        .expect("known quantities");
    let by_its_own_times = ImportSettings { rate_hz: None, ..lenient.clone() };
    let imports = [ImportSettings::strict(), by_its_own_times, lenient, known];
    let _ = recording::load_column(&path, "x");
    for import in &imports {
        let _ = recording::load_signal(&path, None, import);
    }
    let read = imports.map(|import| accepted(recording::load_with(std::slice::from_ref(&path), &import)));
    for (recording, findings) in read.iter().flatten() {
        assert!(recording::write_archive(recording).is_ok());
        assert!(findings.iter().all(|(_, finding)| !finding.to_string().is_empty()));
    }
    read.iter().any(Option::is_some)
}

/// Any table is a surface with its page, or an error of reading or of learning.
pub fn learn_table(bytes: &[u8]) -> bool {
    let (_folder, path) = in_a_file(bytes);
    let Some((recording, _)) = accepted(recording::load_with(&[path], &ImportSettings::default())) else {
        return false;
    };
    let settings = LearnSettings { accept_rate: true, ..LearnSettings::default() };
    let Some((surface, report)) = accepted(learn("fuzzed", &[recording], &settings, &|_| ())) else {
        return false;
    };
    assert!(!page(&surface, &report).is_empty());
    if let Some(texture) = &surface.texture {
        let _ = swatch(texture);
    }
    assert_eq!(read_surface(native::write(&surface).as_bytes()), Ok(surface));
    true
}

/// Any bytes are a WAV file or an error; one whose header is not true is whole after it was repaired.
pub fn wav(bytes: &[u8]) -> bool {
    let read = accepted(wav::read_layout(&mut Cursor::new(bytes)));
    if let Some(layout) = &read {
        for channel in 0..layout.channels.min(3) {
            let samples = accepted(wav::read_channel(&mut Cursor::new(bytes), layout, channel.into()));
            assert!(samples.is_none_or(|all| all.len() as u64 == layout.frames()));
        }
    }
    let mut file = Cursor::new(bytes.to_vec());
    match accepted(wav::repair(&mut file)) {
        Some(Repair::Whole | Repair::TooLarge) => assert_eq!(file.get_ref(), bytes),
        Some(_) => assert_eq!(wav::repair(&mut file).ok(), Some(Repair::Whole)),
        None => {}
    }
    read.is_some()
}

/// Any bytes are a mesh or an error, in either format; every point has a nearest one on a mesh.
pub fn mesh(bytes: &[u8]) -> bool {
    let read = [MeshFormat::Stl, MeshFormat::Obj]
        .map(|format| accepted(TriangleMesh::from_bytes(bytes, format, 1e-3)));
    for mesh in read.iter().flatten() {
        let (nearest, triangle) = mesh.closest([1e-3, -2e-3, 3e-3]);
        assert!(nearest.iter().all(|x| x.is_finite()) && (triangle as usize) < mesh.triangles().len());
        let _ = mesh.first_hit([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
        let _ = mesh.meet_line([0.0; 3], [0.0, 0.6, 0.8]);
        let _ = mesh.check_convex();
    }
    read.iter().any(Option::is_some)
}

/// Any packet is settings that can be shown on one line, news of a device or a command; or none of these.
pub fn packet(bytes: &[u8]) -> bool {
    let parsed = parse_settings(bytes);
    for setting in parsed.iter().flatten() {
        assert!(!setting.name.is_empty());
        for text in [&setting.name, &setting.value.to_string()] {
            assert!(text.len() <= 200 && !text.chars().any(char::is_control), "{setting:?}");
        }
    }
    let state = accepted(State::from_bytes(bytes));
    if let Some(state) = &state {
        let numbers = [state.position_m, state.orientation_rad, state.force_n, state.torque_n_m];
        assert!(numbers.as_flattened().iter().all(|x| x.abs() <= 1e6));
        assert_eq!(State::from_bytes(&state.to_bytes()).as_ref(), Ok(state));
    }
    let command = accepted(Command::from_bytes(bytes));
    if let Some(command) = &command {
        assert_eq!(Command::from_bytes(&command.to_bytes()).as_ref(), Ok(command));
    }
    parsed.is_some() || state.is_some() || command.is_some()
}

/// A recorded sweep is identified or refused.
pub fn sweep(bytes: &[u8]) -> bool {
    let (_folder, path) = in_a_file(bytes);
    let Some((file, _)) = accepted(recording::load_sweep(&path, &ImportSettings::default())) else {
        return false;
    };
    let sweep = Sweep {
        current_a: &file.current_a,
        acceleration_m_s2: &file.acceleration_m_s2,
        rate_hz: file.rate_hz,
        band_hz: [20.0, 400.0],
    };
    accepted(identify(&sweep, Known::Nothing)).is_some()
}

/// Two drivers, a ring between them, a live input and an actuator.
const LIVE: &str = r#"Graph(format: 1,
    clocks: { "servo": Driver(rate_hz: 1000), "far": Driver(rate_hz: 500) },
    nodes: {
        "arm": Arm(clock: "servo", endpoint: "arm"),
        "place": Components(input: "arm.position"),
        "push": Calibrate(input: "place.x", from: "length", to: "current", factor: 10),
        "out": ActuatorSink(endpoint: "arm", current: "push", limit: (peak_a: 0.5, continuous_a: 0.25)),
        "there": Gain(clock: "far", input: Ring(from: "push", latency_ms: 30), gain: 1),
    },
    endpoints: { "live": { "arm": UdpDevice(listen: "127.0.0.1:9750") } })"#;

static LIVE_GRAPH: LazyLock<Graph> = LazyLock::new(|| {
    let document = Document::parse("live.ron", LIVE).expect("it is RON");
    let options = CheckOptions::default().endpoints("live");
    check(&document, &REGISTRY, &options).expect("it is sound")
});

/// The logs of a short live run, with its graph.
fn live_run() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let options = SessionOptions::default().rested();
    let opened = Session::open_all(FileSinks::new(&*LIVE_GRAPH), &options, Some(folder.path()));
    let (mut lives, session) = opened.expect("threads and files");
    for _ in 0..10 {
        lives[1].process(4);
        lives[0].process(8);
    }
    session.finish_all(lives);
    folder
}

/// Between the files in a seed, each of which begins with its name on a line.
const NEXT_FILE: &str = "==== ";

/// Logs of a live run are repeated or refused. The bytes are files that replace those of a run, the first line the run's
/// length in seconds and in frames.
pub fn replay(bytes: &[u8]) -> bool {
    static RUN: LazyLock<tempfile::TempDir> = LazyLock::new(live_run);
    let text = String::from_utf8_lossy(bytes);
    let mut parts = text.split(NEXT_FILE);
    let mut length = parts.next().unwrap_or_default().split_whitespace();
    let longest_s = length.next().and_then(|text| text.parse().ok());
    let frames = length.next().and_then(|text| text.parse().ok());
    let mut bounds = ReplayBounds::new(longest_s.unwrap_or(1.0_f64).clamp(0.0, 10.0));
    bounds.frames = frames.map(|frames: u64| (frames, length.next() == Some("whole")));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let logs = folder.path().join(ARRIVALS);
    std::fs::create_dir(&logs).expect("a folder");
    for entry in std::fs::read_dir(RUN.path().join(ARRIVALS)).expect("the run's logs") {
        let entry = entry.expect("a file");
        std::fs::copy(entry.path(), logs.join(entry.file_name())).expect("it can be copied");
    }
    for part in parts {
        let (name, content) = part.split_once('\n').unwrap_or((part, ""));
        if Path::new(name).file_name().is_some_and(|own| own == name) && logs.join(name).exists() {
            std::fs::write(logs.join(name), content).expect("it can be written");
        }
    }
    let (sinks, log) = (FileSinks::new(&*LIVE_GRAPH), (folder.path(), &bounds));
    accepted(Session::replay(sinks, log, &SessionOptions::default(), &mut |_| {})).is_some()
}
