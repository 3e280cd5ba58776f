//! Latency of the native studio in wall-clock time: from a pointer message of a page to the first command that it changes,
//! at a device that another program of this machine simulates. Run it on an idle machine:
//!
//! `cargo bench -p haptograph-studio --bench latency`

#![expect(clippy::print_stdout, reason = "a bench prints")]

use haptograph_live::udp::protocol::{Command, State};
use haptograph_studio::{Options, Studio};
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

const GRAPH: &str = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) }, nodes: {
    "pen": Tablet(clock: "servo", endpoint: "pen"),
    "current": Calibrate(input: "pen.force", from: "force", factor: 0.1, to: "current"),
    "out": ActuatorSink(current: "current", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
}, endpoints: {
    "simulated": { "pen": SimulatedTablet(), "coil": SimulatedHaptuator() },
    "live": { "pen": SimulatedTablet(), "coil": UdpDevice(listen: "PLACE", timeout_ms: 1000) },
})"#;

/// Number of measured changes for each interval of pointers.
const CHANGES: usize = 200;
/// Changes come after this many pointers, at least.
const BETWEEN: usize = 12;
/// Time in which an armed device is driven in full.
const ARMING: Duration = Duration::from_secs(2);
/// A lost change ends the bench.
const PATIENCE: Duration = Duration::from_secs(5);

fn main() {
    let coil = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let free = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let place = free.local_addr().expect("an address");
    drop(free);
    let folder = tempfile::tempdir().expect("a folder");
    let graph = folder.path().join("g.ron");
    std::fs::write(&graph, GRAPH.replace("PLACE", &place.to_string())).expect("written");
    let driven_by = simulate(coil, place);
    let options = Options {
        graph,
        set: Vec::new(),
        endpoints: Some("live".to_owned()),
        port: 0,
        out: folder.path().join("out"),
        surfaces: Vec::new(),
        lan: None,
        learner: None,
    };
    let studio = Studio::open(&options, &haptograph_nodes::registry()).expect("a studio");
    println!("pointer message to changed command, native, wall-clock time, {CHANGES} changes each:");
    for interval_ms in [4, 8, 16] {
        let mut page = Page::of(&studio);
        page.say(r#"{"type":"own"}"#);
        page.say(r#"{"type":"arm"}"#);
        page.say(r#"{"type":"gain","gain":1}"#);
        let mut latencies_ms = page.changes(&driven_by, Duration::from_millis(interval_ms));
        latencies_ms.sort_by(f64::total_cmp);
        let at = |part: f64| latencies_ms[((latencies_ms.len() - 1) as f64 * part) as usize];
        println!(
            "  pointers every {interval_ms:2} ms: median {:.1} ms, 5 % to 95 % {:.1} to {:.1} ms, maximum {:.1} ms",
            at(0.5),
            at(0.05),
            at(0.95),
            at(1.0)
        );
    }
}

/// Simulates the device until the process ends; the bits of the current that it received last.
fn simulate(coil: UdpSocket, place: SocketAddr) -> Arc<AtomicU64> {
    let current = Arc::<AtomicU64>::default();
    let (received, socket) = (Arc::clone(&current), coil.try_clone().expect("a socket"));
    std::thread::spawn(move || {
        let mut bytes = [0; 256];
        while let Ok(length) = socket.recv(&mut bytes) {
            if let Ok(command) = Command::from_bytes(&bytes[..length]) {
                received.store(command.current_a.to_bits(), Relaxed);
            }
        }
    });
    std::thread::spawn(move || {
        let begun = Instant::now();
        for sequence in 0.. {
            let timestamp_ns = begun.elapsed().as_nanos() as u64;
            let state = State { sequence, timestamp_ns, ..State::default() };
            // Nobody may listen yet.
            let _ = coil.send_to(&state.to_bytes(), place);
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    current
}

struct Page {
    socket: WebSocket<MaybeTlsStream<std::net::TcpStream>>,
    begun: Instant,
}

impl Page {
    fn of(studio: &Studio) -> Self {
        let address = studio.address();
        let url = format!("ws://{address}/live?token={}", studio.token());
        let mut request = url.into_client_request().expect("a request");
        let origin = format!("http://{address}").parse().expect("a header");
        request.headers_mut().insert("origin", origin);
        let (socket, _) = tungstenite::connect(request).expect("it is let in");
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_nodelay(true).expect("a socket");
            stream.set_nonblocking(true).expect("a socket");
        }
        let begun = Instant::now();
        Self { socket, begun }
    }

    fn say(&mut self, text: &str) {
        self.socket.send(Message::text(text.to_owned())).expect("it is heard");
    }

    fn point(&mut self, force_n: f32) {
        let mut bytes = vec![1, 0, 1, 0, 0, 0, 0, 0];
        bytes.extend((self.begun.elapsed().as_secs_f64() * 1e3).to_le_bytes());
        for value in [0.0, 0.0, force_n, 0.0, 0.0] {
            bytes.extend(value.to_le_bytes());
        }
        self.socket.send(Message::binary(bytes)).expect("it is heard");
        // What the studio says is read and dropped.
        while self.socket.read().is_ok() {}
    }

    /// Presses harder and softer in turn; how long each change took to reach the device, ms.
    fn changes(&mut self, driven_by: &AtomicU64, interval: Duration) -> Vec<f64> {
        let mut next = Instant::now();
        let mut latencies_ms = Vec::with_capacity(CHANGES);
        let mut force_n = 1.0;
        for change in 0..CHANGES {
            // The gain of a device that was armed rises for a second.
            let rising = if change == 0 { ARMING.div_duration_f64(interval) as usize } else { 0 };
            for pointer in 0..rising + BETWEEN + change % 5 {
                self.point(force_n);
                if pointer % 8 == 0 {
                    self.say(r#"{"type":"hold"}"#);
                }
                next += interval;
                std::thread::sleep(next.saturating_duration_since(Instant::now()));
            }
            force_n = 3.0 - force_n;
            let (before, sent) = (driven_by.load(Relaxed), Instant::now());
            self.point(force_n);
            // The pointers go on meanwhile: a hand does not wait.
            while driven_by.load(Relaxed) == before {
                assert!(sent.elapsed() < PATIENCE, "the change never arrived");
                if Instant::now() >= next + interval {
                    next += interval;
                    self.point(force_n);
                }
                std::thread::sleep(Duration::from_micros(50));
            }
            latencies_ms.push(sent.elapsed().as_secs_f64() * 1e3);
        }
        latencies_ms
    }
}
