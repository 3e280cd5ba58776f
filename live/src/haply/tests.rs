//! A simulated Inverse Service, which speaks the messages of the real one, and arms at it.

use super::*;
use crate::connections::Connections;
use haptograph_engine::document::Document;
use haptograph_engine::graph::{CheckOptions, check};
use haptograph_engine::run::{FileSinks, Player, Session, SessionOptions};
use haptograph_engine::silence::InputState;
use haptograph_nodes::network::link::Link;
use serde_json::{Value, json};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::Ordering;
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};
use tungstenite::{Error as SocketError, Message, WebSocket};

/// What the service does, and what it was sent.
#[derive(Default)]
struct Shared {
    /// Identifier and position (m) of each arm.
    arms: Vec<(&'static str, [f64; 3])>,
    calibrated: bool,
    /// The answer to each command, in place of a state.
    answer: Option<String>,
    /// True while the service is gone.
    is_away: bool,
    /// True while the service answers no command and takes no connection.
    stalls: bool,
    commands: Vec<Value>,
}

impl Shared {
    fn state(&self) -> String {
        let vector = |[x, y, z]: [f64; 3]| json!({ "x": x, "y": y, "z": z });
        let arm = |(id, position): &(&'static str, [f64; 3])| {
            json!({
                "device_id": id,
                "state": { "cursor_position": vector(*position), "cursor_velocity": vector([0.25, 0.0, 0.0]), "mode": "idle" },
                "status": { "calibrated": self.calibrated, "ready": true, "in_use": false },
            })
        };
        let grip = json!({ "device_id": "1102", "state": { "buttons": { "b": true }, "hall": 3 } });
        json!({ "session_id": 7, "inverse3": self.arms.iter().map(arm).collect::<Vec<_>>(), "wireless_verse_grip": [grip] }).to_string()
    }

    /// The forces that were set of an arm, N.
    fn forces(&self, arm: &str) -> Vec<[f64; 3]> {
        let commands = self.commands.iter().flat_map(|command| command["inverse3"].as_array().unwrap());
        let own = commands.filter(|command| command["device_id"] == arm);
        let vectors = own.map(|command| &command["commands"]["set_cursor_force"]["vector"]);
        vectors.map(|vector| ["x", "y", "z"].map(|axis| vector[axis].as_f64().unwrap())).collect()
    }

    fn last_n(&self, arm: &str) -> f64 {
        self.forces(arm).last().map_or(0.0, |[x, ..]| *x)
    }
}

/// The simulated service.
struct Simulated {
    address: SocketAddr,
    shared: Arc<Mutex<Shared>>,
    stop: Arc<AtomicBool>,
}

impl Simulated {
    fn new(arms: &[(&'static str, [f64; 3])]) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        listener.set_nonblocking(true).unwrap();
        let address = listener.local_addr().unwrap();
        let shared = Shared { arms: arms.to_vec(), calibrated: true, ..Shared::default() };
        let (shared, stop) = (Arc::new(Mutex::new(shared)), Arc::<AtomicBool>::default());
        let (known, flag) = (Arc::clone(&shared), Arc::clone(&stop));
        std::thread::spawn(move || {
            while !flag.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok((stream, _)) => {
                        let (known, flag) = (Arc::clone(&known), Arc::clone(&flag));
                        std::thread::spawn(move || serve(stream, &known, &flag));
                    }
                    Err(_) => std::thread::sleep(Duration::from_millis(1)),
                }
            }
        });
        Self { address, shared, stop }
    }

    fn with<T>(&self, of: impl FnOnce(&mut Shared) -> T) -> T {
        of(&mut lock(&self.shared))
    }

    /// An endpoint at it.
    fn endpoint(&self, more: &str) -> String {
        format!(r#"HaplyInverse3(service: "{}"{more})"#, self.address)
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Answers each command with a state, after one of everything.
fn serve(stream: TcpStream, shared: &Mutex<Shared>, stop: &AtomicBool) {
    if lock(shared).is_away || lock(shared).stalls {
        return;
    }
    stream.set_nonblocking(false).unwrap();
    let Ok(mut socket) = tungstenite::accept(stream) else { return };
    let state = lock(shared).state();
    let mut is_open = socket.send(Message::text(state)).is_ok();
    socket.get_ref().set_read_timeout(Some(Duration::from_millis(5))).unwrap();
    while is_open && !stop.load(Ordering::Relaxed) && !lock(shared).is_away {
        is_open = answer(&mut socket, shared);
    }
}

fn answer(socket: &mut WebSocket<TcpStream>, shared: &Mutex<Shared>) -> bool {
    let text = match socket.read() {
        Ok(Message::Text(text)) => text,
        Ok(_) => return true,
        Err(SocketError::Io(error)) => {
            return matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut);
        }
        Err(_) => return false,
    };
    let answer = {
        let mut shared = lock(shared);
        shared.commands.push(serde_json::from_str(&text).unwrap());
        if shared.stalls {
            return true;
        }
        shared.answer.clone().unwrap_or_else(|| shared.state())
    };
    socket.send(Message::text(answer)).is_ok()
}

/// A graph that pushes with 10 N at each of its arms, limited to 1.5 N.
fn graph_of(endpoints: &[(&str, String)]) -> Graph {
    let nodes = |(name, _): &(&str, String)| {
        format!(
            r#""{name} tip": Arm(clock: "servo", endpoint: "{name}"), "{name} grip": ArmGrip(clock: "servo", endpoint: "{name}"),
            "{name} out": ForceSink(force: "push", endpoint: "{name}", limit: (peak_n: 1.5, continuous_n: 1.5)), "#
        )
    };
    let nodes: String = endpoints.iter().map(nodes).collect();
    let endpoints: String =
        endpoints.iter().map(|(name, written)| format!(r#""{name}": {written}, "#)).collect();
    let text = format!(
        r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 1000) }},
        nodes: {{ "push": ConstantVector(clock: "servo", value: (10, 0, 0), quantity: "force"), {nodes} }},
        endpoints: {{ "simulated": {{ {endpoints} }} }})"#
    );
    let document = Document::parse("g.ron", &text).unwrap();
    check(&document, &haptograph_nodes::registry(), &CheckOptions::default())
        .unwrap_or_else(|wrong| panic!("{wrong}"))
}

/// A live run of such a graph that the test drives.
struct Run {
    connections: Connections,
    player: Player,
    session: Session,
    links: Vec<Arc<Link>>,
}

impl Run {
    fn new(endpoints: &[(&str, String)]) -> Self {
        let mut graph = graph_of(endpoints);
        let mut connections = Connections::new(&haptograph_nodes::registry());
        connections.connect(&mut graph).unwrap_or_else(|error| panic!("{error}"));
        connections.keep(&graph);
        let options = SessionOptions::default().rested();
        let (player, session) = Session::open(FileSinks::new(&graph), &options).unwrap();
        let link = |device: &GraphDevice| Arc::clone(device.body::<Remote>().unwrap().link());
        let links = graph.devices().iter().map(link).collect();
        Self { connections, player, session, links }
    }

    /// Ticks until something holds.
    fn until(&mut self, what: &str, mut holds: impl FnMut(&mut Self) -> bool) {
        let start = Instant::now();
        while !holds(self) {
            self.player.process(1);
            std::thread::sleep(Duration::from_millis(1));
            assert!(start.elapsed() < Duration::from_secs(60), "{what}");
        }
    }

    fn state(&self) -> InputState {
        self.session.live_inputs()[0].state
    }

    fn is_at_zero(&self) -> bool {
        self.session.live_inputs()[0]
            .actuators
            .iter()
            .all(|actuator| actuator.at_zero && actuator.delivered == 0.0)
    }
}

/// Silence that no loaded machine makes by itself within these tests.
const PATIENT: &str = ", timeout_ms: 10000, fastest_mm_s: 1e6";
const ARM: (&str, [f64; 3]) = ("049D", [0.01, -0.02, 0.03]);

#[test]
fn a_position_arrives_and_a_force_goes_out_within_its_limit() {
    let service = Simulated::new(&[ARM]);
    let mut run = Run::new(&[("arm", service.endpoint(PATIENT))]);
    run.until("it pushes", |_| service.with(|shared| shared.last_n("049D") > 1.4));
    let (_, sensed) = run.links[0].sensed.look().unwrap();
    assert_eq!(sensed[..3], ARM.1);
    assert_eq!(sensed[6..], [0.25, 0.0, 0.0, 0.0, 1.0, 0.0], "velocity and buttons");
    assert_eq!(run.state(), InputState::Heard);
    drop(run.player);
    drop(run.session);
    let forces = service.with(|shared| shared.forces("049D"));
    assert!(forces.iter().all(|[x, y, z]| (0.0..=1.5 + 1e-9).contains(x) && [*y, *z] == [0.0; 2]));
    assert_eq!(forces[0], [0.0; 3], "nothing is driven before the arm is heard");
    let first = service.with(|shared| shared.commands[0].clone());
    assert_eq!(first["inverse3"][0]["configure"]["preset"]["preset"], "arm_front_centered");
    assert!(service.with(|shared| shared.commands[1].get("session").is_none()));
    drop(run.connections);
    let start = Instant::now();
    while service.with(|shared| shared.last_n("049D")) != 0.0 {
        assert!(start.elapsed() < Duration::from_secs(60), "the last command is of zeros");
    }
}

#[test]
fn ticks_that_stop_leave_no_force() {
    let service = Simulated::new(&[ARM]);
    let mut run = Run::new(&[("arm", service.endpoint(", timeout_ms: 500"))]);
    run.until("it pushes", |_| service.with(|shared| shared.last_n("049D") > 1.4));
    let start = Instant::now();
    while service.with(|shared| shared.last_n("049D")) != 0.0 {
        std::thread::sleep(Duration::from_millis(1));
        assert!(start.elapsed() < Duration::from_secs(60));
    }
    assert!(run.links[0].is_interrupted());
    run.until("it pushes again", |_| service.with(|shared| shared.last_n("049D") > 1.4));
}

#[test]
fn a_service_that_goes_leaves_the_arm_silent_and_is_found_again() {
    let service = Simulated::new(&[ARM]);
    let mut run = Run::new(&[("arm", service.endpoint(", timeout_ms: 200"))]);
    run.until("it pushes", |_| service.with(|shared| shared.last_n("049D") > 1.4));
    service.with(|shared| shared.is_away = true);
    run.until("it is silent", |run| run.state() == InputState::Silent && run.is_at_zero());
    assert!(run.connections.poll().len() == 1);
    service.with(|shared| (shared.is_away, shared.commands) = (false, Vec::new()));
    run.until("it pushes again", |_| service.with(|shared| shared.last_n("049D") > 1.4));
    let forces = service.with(|shared| shared.forces("049D"));
    assert!(forces[0] == [0.0; 3] && forces.iter().all(|[x, ..]| *x <= 1.5 + 1e-9));
}

#[test]
fn a_service_that_is_late_gets_a_force_of_zero_on_the_same_connection() {
    let service = Simulated::new(&[ARM]);
    let mut run = Run::new(&[("arm", service.endpoint(", timeout_ms: 200"))]);
    run.until("it pushes", |_| service.with(|shared| shared.last_n("049D") > 1.4));
    service.with(|shared| shared.stalls = true);
    run.until("it lets go", |_| service.with(|shared| shared.last_n("049D") == 0.0));
    service.with(|shared| shared.stalls = false);
    run.until("it pushes again", |_| service.with(|shared| shared.last_n("049D") > 1.4));
}

#[test]
fn an_arm_that_goes_or_is_not_calibrated_is_silent() {
    let service = Simulated::new(&[ARM]);
    let mut run = Run::new(&[("arm", service.endpoint(", timeout_ms: 200"))]);
    let gone: fn(&mut Shared) = |shared| shared.arms.clear();
    let uncalibrated: fn(&mut Shared) = |shared| shared.calibrated = false;
    for change in [gone, uncalibrated] {
        run.until("it pushes", |_| service.with(|shared| shared.last_n("049D") > 1.4));
        service.with(change);
        run.until("it is silent", |run| run.state() == InputState::Silent && run.is_at_zero());
        run.until("it lets go", |_| service.with(|shared| shared.last_n("049D") == 0.0));
        service.with(|shared| (shared.arms, shared.calibrated) = (vec![ARM], true));
    }
}

/// One of the counts of a link.
type Counted = fn(&Link) -> u64;

#[test]
fn messages_that_are_none_are_counted_and_change_nothing() {
    let service = Simulated::new(&[ARM]);
    let mut run = Run::new(&[("arm", service.endpoint(PATIENT))]);
    let place = |x: &str| {
        format!(
            r#"{{"inverse3": [{{"device_id": "049D", "state": {{"cursor_position": {{"x": {x}, "y": 0, "z": 0}}}}}}]}}"#
        )
    };
    let cases: [(String, Counted); 5] = [
        ("{".to_owned(), |link| link.counts().malformed),
        (place("NaN"), |link| link.counts().malformed),
        (place("null"), |link| link.counts().not_numbers),
        (place("1e300"), |link| link.counts().too_large),
        // Beyond the largest message, with which the connection ends.
        ("[".repeat(200_000), |link| link.counts().too_large),
    ];
    for (text, count) in cases {
        let accepted = run.links[0].counts().accepted;
        run.until("it is heard", |run| run.links[0].counts().accepted > accepted);
        let before = count(&run.links[0]);
        service.with(|shared| shared.answer = Some(text));
        run.until("it is counted", |run| count(&run.links[0]) > before);
        assert_eq!(run.links[0].sensed.look().unwrap().1[..3], ARM.1);
        service.with(|shared| shared.answer = None);
    }
}

#[test]
fn two_arms_are_reached_by_their_identifiers() {
    let service = Simulated::new(&[ARM, ("04BA", [0.0, 0.0, 0.5])]);
    let endpoint = |arm: &str| service.endpoint(&format!(r#", device: "{arm}"{PATIENT}"#));
    let mut run = Run::new(&[("right", endpoint("04BA")), ("left", endpoint("049D"))]);
    run.until("both push", |_| {
        service.with(|shared| shared.last_n("049D") > 1.4 && shared.last_n("04BA") > 1.4)
    });
    let z_m = |link: &Arc<Link>| link.sensed.look().unwrap().1[2];
    assert_eq!(run.links.iter().map(z_m).collect::<Vec<_>>(), [0.5, 0.03]);
    assert_eq!(run.connections.status().len(), 2);
}

#[test]
fn other_axes_hold_from_the_edit_on_with_the_same_connection() {
    let service = Simulated::new(&[ARM]);
    let mut run = Run::new(&[("arm", service.endpoint(PATIENT))]);
    let more = format!(r#", device: "049D", preset: LedFront{PATIENT}"#);
    let mut after = graph_of(&[("arm", service.endpoint(&more))]);
    run.connections.connect(&mut after).unwrap_or_else(|error| panic!("{error}"));
    run.connections.keep(&after);
    let is_set = |command: &Value| command["inverse3"][0]["configure"]["preset"]["preset"] == "led_front";
    run.until("it is set", |_| service.with(|shared| shared.commands.iter().any(is_set)));
    assert_eq!(run.connections.status().len(), 1);
}

/// The error of connecting these endpoints: whose, and its kind.
fn refused(endpoints: &[(&str, String)]) -> (String, ErrorKind) {
    let mut connections = Connections::new(&haptograph_nodes::registry());
    match connections.connect(&mut graph_of(endpoints)) {
        Err(BackendError::Place { device, error, .. }) => (device, error.kind()),
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_cannot_be_reached_is_refused() {
    let nowhere = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let endpoint = |address: SocketAddr| format!(r#"HaplyInverse3(service: "{address}")"#);
    assert_eq!(refused(&[("arm", endpoint(nowhere))]), ("arm".to_owned(), ErrorKind::ConnectionRefused));
    let none = Simulated::new(&[]);
    assert_eq!(refused(&[("arm", none.endpoint(""))]).1, ErrorKind::NotFound);
    let two = Simulated::new(&[ARM, ("04BA", [0.0; 3])]);
    assert_eq!(refused(&[("arm", two.endpoint(r#", device: "1""#))]).1, ErrorKind::NotFound);
    assert_eq!(refused(&[("arm", two.endpoint(""))]).1, ErrorKind::InvalidInput);
    let both = [("one", two.endpoint("")), ("other", two.endpoint(r#", device: "04BA""#))];
    assert_eq!(refused(&both), ("other".to_owned(), ErrorKind::InvalidInput));
    // Something else that listens there.
    let other = Simulated::new(&[ARM]);
    other.with(|shared| shared.is_away = true);
    assert_eq!(refused(&[("arm", other.endpoint(""))]).1, ErrorKind::InvalidData);
}
