//! A page as the studio meets it, by WebSocket. What takes time is waited for, however long a machine needs.
#![allow(dead_code, reason = "each file of tests uses a part")]

use haptograph_engine::registry::Registry;
use haptograph_studio::{Options, Studio, page::learn_recording};
use haptograph_study::check::Checked;
use haptograph_study::conduct::Conductor;
use haptograph_study::data::Folder;
use serde_json::{Value, json};
use std::io;
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

pub const PATIENCE: Duration = Duration::from_secs(60);

const TO_LEARN: &str = "HAPTOGRAPH_TO_LEARN";

/// Learns in a process of the tests' own program.
pub fn learner(table: &Path, surface: &Path, report: &Path) -> io::Result<Command> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args(["learns_in_a_process_of_its_own", "--exact", "--nocapture"]);
    command.env(TO_LEARN, json!([table, surface, report]).to_string());
    Ok(command)
}

/// What that process does. A recording that begins with `abort` ends it, one that begins with `wait` never ends.
#[expect(clippy::print_stderr, reason = "a process says so why it fails")]
pub fn learn_here() {
    let Ok(asked) = std::env::var(TO_LEARN) else {
        return;
    };
    let [table, surface, report]: [PathBuf; 3] = serde_json::from_str(&asked).expect("three paths");
    let text = std::fs::read_to_string(&table).expect("it is there");
    if text.starts_with("abort") {
        eprintln!("memory allocation of 64000000000000 bytes failed");
        std::process::abort();
    }
    while text.starts_with("wait") {
        std::thread::park();
    }
    match learn_recording(&table, &Default::default()) {
        Ok([_, text, page]) => {
            std::fs::write(surface, text).expect("written");
            std::fs::create_dir(&report).expect("made");
            std::fs::write(report.join("report.html"), page).expect("written");
        }
        Err(error) => {
            eprintln!("error: {error}");
            std::process::exit(1);
        }
    }
}

/// A page's end of the conversation.
pub struct Page {
    pub socket: WebSocket<MaybeTlsStream<TcpStream>>,
    pub hello: Value,
    pub graph: Value,
    /// The texts that it was waiting for something in.
    pub heard: Vec<String>,
    /// Number of the graph that its pointers are made for; 0 for any.
    pub made_for: u16,
    begun: Instant,
    requests: u64,
}

impl Page {
    pub fn of(studio: &Studio) -> Self {
        Self::at(studio, studio.address())
    }

    pub fn at(studio: &Studio, address: SocketAddr) -> Self {
        let mut page = Self::let_in(address, studio.token());
        assert_eq!(page.hello["version"], 1);
        page.graph = page.wait(|said| said["type"] == "graph");
        page
    }

    /// A page that is greeted; that of a study gets no graph.
    pub fn let_in(address: SocketAddr, token: &str) -> Self {
        let url = format!("ws://{address}/live?token={token}");
        let mut request = url.into_client_request().expect("a request");
        let origin = format!("http://{address}").parse().expect("a header");
        request.headers_mut().insert("origin", origin);
        let protocol = "haptograph.studio.1".parse().expect("a header");
        request.headers_mut().insert("sec-websocket-protocol", protocol);
        let (socket, _) = tungstenite::connect(request).expect("it is let in");
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        }
        let (hello, graph) = (Value::Null, Value::Null);
        let (heard, begun) = (Vec::new(), Instant::now());
        let mut page = Self { socket, hello, graph, heard, made_for: 0, begun, requests: 0 };
        page.hello = page.wait(|said| said["type"] == "hello");
        page
    }

    pub fn say(&mut self, value: &Value) {
        let text = Message::text(value.to_string());
        self.socket.send(text).expect("it is heard");
    }

    /// The first text that is wanted.
    pub fn wait(&mut self, is_wanted: impl Fn(&Value) -> bool) -> Value {
        let asked = Instant::now();
        while asked.elapsed() < PATIENCE {
            if let Message::Text(text) = self.socket.read().expect("it goes on") {
                let said: Value = serde_json::from_str(&text).expect("JSON");
                self.heard.push(text.to_string());
                if is_wanted(&said) {
                    return said;
                }
            }
        }
        panic!("it was never said");
    }

    pub fn request(&mut self, mut value: Value) -> Value {
        self.requests += 1;
        let request = json!(self.requests);
        value["request"] = request.clone();
        self.say(&value);
        self.wait(|said| said["type"] == "reply" && said["request"] == request)
    }

    pub fn point(&mut self, x_mm: f32, y_mm: f32, force_n: f32) {
        let mut bytes = vec![1, 0, 1, 0, 0, 0];
        bytes.extend(self.made_for.to_le_bytes());
        bytes.extend((self.begun.elapsed().as_secs_f64() * 1e3).to_le_bytes());
        for value in [x_mm, y_mm, force_n, 0.0, 0.0] {
            bytes.extend(value.to_le_bytes());
        }
        self.socket.send(Message::binary(bytes)).expect("it is heard");
    }

    /// Strokes circles of 30 mm at so many mm/s until as many seconds of the first scope came; its samples.
    pub fn stroke(&mut self, speed_mm_s: f64, force_n: f32, seconds: f64) -> Vec<f32> {
        let (mut samples, mut covered_s) = (Vec::new(), 0.0);
        let asked = Instant::now();
        while covered_s < seconds && asked.elapsed() < PATIENCE {
            let angle = self.begun.elapsed().as_secs_f64() * speed_mm_s / 30.0;
            self.point(30.0 * angle.cos() as f32, 30.0 * angle.sin() as f32, force_n);
            if let Message::Binary(bytes) = self.socket.read().expect("it goes on")
                && bytes[0] == 2
            {
                let interval_s = f64::from_le_bytes(bytes[16..24].try_into().expect("eight"));
                let values = bytes[24..].chunks_exact(4);
                let values: Vec<f32> =
                    values.map(|four| f32::from_le_bytes(four.try_into().expect("four"))).collect();
                covered_s += values.len() as f64 * interval_s;
                samples.extend(values);
            }
        }
        samples
    }
}

/// A studio that conducts the study of a file.
pub fn study(path: &Path, data: &Path, registry: &Registry) -> Studio {
    let checked = Checked::load(path, None).expect("right");
    checked.check_graph(registry).expect("right");
    let folder = Folder::open(data, &checked.identity(None)).expect("a folder");
    let (graph, set) = Conductor::first(&checked, registry).expect("a graph");
    let options = Options {
        graph: checked.study.graph.clone(),
        set,
        endpoints: Some(checked.study.endpoints.clone()),
        port: 0,
        out: data.to_owned(),
        surfaces: Vec::new(),
        lan: None,
        learner: None,
    };
    let conductor = Conductor::open(checked, folder, &graph).expect("a conductor");
    Studio::conduct(&options, registry, conductor).expect("a studio")
}

/// The token of its participant's page.
pub fn participant_token(studio: &Studio) -> String {
    let url = studio.participant_url().expect("a study has one");
    url.rsplit('=').next().expect("its end").to_owned()
}

/// A message that only the owner may send, damaged in what it carries.
fn owners_attack(next: &mut impl FnMut(usize) -> usize, request: usize) -> Value {
    let text =
        ["", "Graph(format: 1)", "Graph(format: 1, nodes: { \"a\": Sine(", "((((((((", "\u{0}"][next(5)];
    let far = [i64::MAX, -1, 0, 4_000_000_000][next(4)];
    let no_switch = [json!("yes"), json!(false), json!(1)][next(3)].clone();
    match next(9) {
        0 => json!({ "type": "apply", "request": request, "text": text }),
        1 => json!({ "type": "save", "request": request, "text": text }),
        2 => {
            json!({ "type": "parameter", "request": request, "name": "surface", "value": "\"/etc/passwd\"" })
        }
        3 => json!({ "type": "parameter", "request": request, "name": "gain", "value": text }),
        4 => json!({ "type": "learn", "request": request, "name": "../../x.csv", "csv": text }),
        5 => json!({ "type": "record", "on": no_switch }),
        6 if request % 1000 < 20 => json!({ "type": "record", "on": true }),
        7 => [
            json!({ "type": "hold" }),
            json!({ "type": "gain", "gain": 1 }),
            json!({ "type": "gain", "gain": far }),
        ][next(3)]
        .clone(),
        _ => json!({ "type": "replay", "request": request, "recording": {
            "format": 1, "haptograph": "", "graph": "", "text": text, "set": [], "rate_hz": 48000.0, "frames": 9,
            "moves": [[9, next(9), far.unsigned_abs(), [far, far], 1_000_000]], "turns": [[9, "out.gain", far]],
        } }),
    }
}

/// Sends ten thousand hostile messages, most of them as the owner.
pub fn attack(studio: &Studio) {
    let words = [
        "{",
        "\"type\"",
        ":",
        "\"set\"",
        "\"scope\"",
        "[",
        "]",
        "}",
        ",",
        "null",
        "1e999",
        "\u{202e}",
        "\"ports\"",
    ];
    let (mut seed, mut sent) = (7_u64, 0);
    let mut next = |bound: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % bound
    };
    while sent < 10_000 {
        let mut hostile = Page::of(studio);
        // The first is the guest of the page that was there before, the others own what they attack.
        if sent > 0 {
            hostile.say(&json!({ "type": "own" }));
        }
        // Fewer than what ends a connection.
        for _ in 0..90 {
            let message = match next(4) {
                3 => Message::text(owners_attack(&mut next, sent).to_string()),
                0 => Message::text((0..next(12)).map(|_| words[next(words.len())]).collect::<String>()),
                1 => Message::binary((0..next(80)).map(|_| next(256) as u8).collect::<Vec<u8>>()),
                _ => Message::text(
                    json!({ "type": "set", "name": "out.gain", "value": "x".repeat(next(50)) }).to_string(),
                ),
            };
            sent += 1;
            hostile.socket.send(message).expect("it is heard");
        }
        // Messages are handled in order: the last reply says that all were.
        hostile.say(&json!({ "type": "check", "request": u32::MAX, "text": "" }));
        hostile.wait(|said| said["type"] == "reply" && said["request"] == u32::MAX);
    }
}
