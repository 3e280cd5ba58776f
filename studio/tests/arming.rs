//! What a real device gets of a graph that runs in the studio. It is a program at the other end of the device protocol; how
//! fast it is driven and let go is tested in the engine, where time is virtual.

mod common;

use common::{PATIENCE, Page};
use haptograph_live::udp::protocol::{Command, State};
use haptograph_studio::{Options, Studio};
use serde_json::{Value, json};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const ASKED_A: f64 = 0.5;
/// Commands that are looked at where nothing is to move.
const ENOUGH: usize = 100;

/// A coil that another program owns: it senses nothing, and notes what it is driven by.
struct Coil {
    currents: Arc<Mutex<Vec<f64>>>,
    end: Arc<AtomicBool>,
    /// While it is set nothing is sent, as if the program had ended.
    quiet: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    place: SocketAddr,
}

impl Coil {
    fn new() -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
        socket.set_read_timeout(Some(Duration::from_millis(2))).expect("a timeout");
        // A run that follows another listens there again.
        let free = UdpSocket::bind("127.0.0.1:0").expect("a port");
        let place = free.local_addr().expect("an address");
        let (currents, end) = (Arc::<Mutex<Vec<f64>>>::default(), Arc::<AtomicBool>::default());
        let quiet = Arc::<AtomicBool>::default();
        let theirs = (Arc::clone(&currents), Arc::clone(&end), Arc::clone(&quiet));
        let thread = std::thread::spawn(move || {
            let (begun, mut sequence, mut bytes) = (Instant::now(), 0, [0; 256]);
            while !theirs.1.load(Ordering::Relaxed) {
                if theirs.2.load(Ordering::Relaxed) {
                    std::thread::sleep(Duration::from_millis(1));
                    continue;
                }
                let state =
                    State { sequence, timestamp_ns: begun.elapsed().as_nanos() as u64, ..State::default() };
                sequence += 1;
                // Nobody listens between two runs.
                let _ = socket.send_to(&state.to_bytes(), place);
                if let Ok((length, _)) = socket.recv_from(&mut bytes)
                    && let Ok(command) = Command::from_bytes(&bytes[..length])
                {
                    theirs.0.lock().expect("whole").push(command.current_a);
                }
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        Self { currents, end, quiet, thread: Some(thread), place }
    }

    /// What it was driven by since this was asked last.
    fn take(&self) -> Vec<f64> {
        std::mem::take(&mut *self.currents.lock().expect("whole"))
    }
}

impl Drop for Coil {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

struct Rig {
    coil: Coil,
    studio: Studio,
    folder: tempfile::TempDir,
}

const GRAPH: &str = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) }, nodes: {
    "one": Constant(clock: "servo", value: 0.5, quantity: "current"),
    "out": ActuatorSink(current: "one", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
}, endpoints: {
    "simulated": { "coil": SimulatedHaptuator() },
    "live": { "coil": UdpDevice(listen: "PLACE", timeout_ms: 1000) },
})"#;

/// The same between two drivers.
const OF_TWO: &str = r#"Graph(format: 1, clocks: { "audio": Driver(rate_hz: 8000), "servo": Driver(rate_hz: 1000) }, nodes: {
    "one": Constant(clock: "audio", value: 0.5, quantity: "current"),
    "out": ActuatorSink(
        clock: "servo", current: Ring(from: "one", latency_ms: 20), endpoint: "coil", limit: (peak_a: 1, continuous_a: 1),
    ),
}, endpoints: {
    "simulated": { "coil": SimulatedHaptuator() },
    "live": { "coil": UdpDevice(listen: "PLACE", timeout_ms: 1000) },
})"#;

impl Rig {
    fn new(endpoints: Option<&str>) -> Self {
        Self::of(GRAPH, endpoints)
    }

    fn of(graph: &str, endpoints: Option<&str>) -> Self {
        let (coil, folder) = (Coil::new(), tempfile::tempdir().expect("a folder"));
        let text = graph.replace("PLACE", &coil.place.to_string());
        std::fs::write(folder.path().join("g.ron"), text).expect("written");
        let studio = open(folder.path(), endpoints).expect("a studio");
        Self { coil, studio, folder }
    }

    fn page(&self) -> Page {
        Page::at(&self.studio, self.studio.address())
    }

    /// Holds it armed until it is driven as wanted; what it was driven by meanwhile.
    fn hold_until(&self, page: &mut Page, is_wanted: impl Fn(f64) -> bool) -> Vec<f64> {
        let (asked, mut all) = (Instant::now(), Vec::new());
        while asked.elapsed() < PATIENCE {
            page.say(&json!({ "type": "hold" }));
            std::thread::sleep(Duration::from_millis(10));
            all.extend(self.coil.take());
            if all.last().is_some_and(|current| is_wanted(*current)) {
                return all;
            }
        }
        panic!("it never was: {:?}", &all[all.len().saturating_sub(20)..]);
    }

    /// It is armed, and driven by the least that arming gives.
    fn arm(&self, page: &mut Page) {
        self.coil.take();
        page.say(&json!({ "type": "arm" }));
        let rise = self.hold_until(page, |current| (current - 0.1 * ASKED_A).abs() < 1e-9);
        let most = rise.iter().fold(0.0, |most: f64, current| most.max(*current));
        assert!(most <= 0.1 * ASKED_A + 1e-9, "{most}");
        // From zero, in steps.
        assert!(rise.iter().any(|current| *current > 0.0 && *current < 0.05 * ASKED_A));
    }

    /// It falls to zero and stays there, though a page says that somebody is there.
    fn assert_silent(&self, page: &mut Page) {
        self.hold_until(page, |current| current == 0.0);
        let mut count = 0;
        while count < ENOUGH {
            let driven = self.hold_until(page, |_| true);
            assert!(driven.iter().all(|current| *current == 0.0), "{driven:?}");
            count += driven.len();
        }
        let status = fresh_status(page);
        assert_eq!((&status["armed_gain"], &status["actuators"][0]["armed"]), (&json!(0.0), &json!(false)));
    }
}

fn open(folder: &Path, endpoints: Option<&str>) -> Result<Studio, haptograph_studio::StudioError> {
    let options = Options {
        graph: folder.join("g.ron"),
        set: Vec::new(),
        endpoints: endpoints.map(str::to_owned),
        port: 0,
        out: folder.join("out"),
        surfaces: Vec::new(),
        lan: Some(IpAddr::V4(Ipv4Addr::new(127, 0, 0, 2))),
        learner: None,
    };
    Studio::open(&options, &haptograph_nodes::registry())
}

/// A status that did not lie unread.
fn fresh_status(page: &mut Page) -> Value {
    loop {
        let asked = Instant::now();
        let status = page.wait(|said| said["type"] == "status");
        // They come ten times a second.
        if asked.elapsed() > Duration::from_millis(20) {
            return status;
        }
    }
}

fn refusal(page: &mut Page, said: &Value) -> String {
    page.say(said);
    let refused = page.wait(|said| said["type"] == "refused");
    refused["error"].as_str().expect("a text").to_owned()
}

#[test]
fn a_real_actuator_is_silent_until_the_owner_arms_it_and_after_everything_that_disarms() {
    let rig = Rig::new(Some("live"));
    let mut page = rig.page();
    assert_eq!(page.hello["can"]["arm"], true);
    let device = &page.graph["devices"][0];
    assert_eq!(
        (&device["name"], &device["simulated"], &device["at"]),
        (&json!("coil"), &json!(false), &json!(rig.coil.place.to_string()))
    );
    // Nobody knows how warm it is: its limiter has no reserve, and the page shows it.
    let heat = fresh_status(&mut page)["actuators"][0]["heat"].as_f64();
    assert!(heat > Some(0.5), "{heat:?}");
    // The graph asks for it all the while, behind the limits.
    page.wait(|said| said["actuators"][0]["rms"].as_f64() > Some(0.4));
    rig.assert_silent(&mut page);

    rig.arm(&mut page);
    page.say(&json!({ "type": "gain", "gain": 7 }));
    rig.hold_until(&mut page, |current| (current - ASKED_A).abs() < 1e-9);
    page.say(&json!({ "type": "disarm" }));
    // The slider was still moving.
    page.say(&json!({ "type": "gain", "gain": 1 }));
    rig.assert_silent(&mut page);

    // An edit that goes on with the device keeps it armed.
    rig.arm(&mut page);
    let text = page.graph["text"].as_str().expect("a text").replace("0.5", "0.4");
    page.say(&json!({ "type": "apply", "request": 1, "text": text }));
    rig.hold_until(&mut page, |current| (current - 0.04).abs() < 1e-9);
    let text = text.replace("0.4", "0.5");
    page.say(&json!({ "type": "apply", "request": 2, "text": text }));
    rig.hold_until(&mut page, |current| (current - 0.05).abs() < 1e-9);

    page.say(&json!({ "type": "stop" }));
    let stopped = page.wait(|said| said["state"] == "stopped");
    assert_eq!(stopped["armed_gain"], 0.0);
    assert!(refusal(&mut page, &json!({ "type": "arm" })).contains("stopped"));
    rig.coil.take();
    page.say(&json!({ "type": "resume" }));
    page.wait(|said| said["state"] == "running");
    assert!(rig.coil.take().iter().all(|current| *current == 0.0), "from the first command on");
    rig.assert_silent(&mut page);

    rig.arm(&mut page);
    page.say(&json!({ "type": "record", "on": true }));
    page.wait(|said| said["recording_s"].is_number());
    rig.assert_silent(&mut page);
    page.say(&json!({ "type": "record", "on": false }));
    page.wait(|said| said["type"] == "status" && said["recording_s"].is_null());
    rig.assert_silent(&mut page);
    assert!(rig.folder.path().join("out/g-strokes-1/strokes.json").is_file());
}

#[test]
fn two_drivers_of_a_real_actuator_run_by_their_own_time_and_a_stop_ends_both() {
    let rig = Rig::of(OF_TWO, Some("live"));
    let mut page = rig.page();
    let drivers = page.graph["drivers"].as_array().expect("a list").clone();
    assert!(drivers.len() == 2 && drivers.iter().all(|driver| driver["simulated"] == false), "{drivers:?}");
    rig.coil.take();
    page.say(&json!({ "type": "arm" }));
    rig.hold_until(&mut page, |current| (current - 0.1 * ASKED_A).abs() < 1e-3);
    // Each port has the time of its own driver.
    for port in ["one.output", "out.delivered"] {
        page.say(&json!({ "type": "scope", "ports": [{ "name": port, "raw": true }] }));
        let samples = page.stroke(0.0, 0.0, 0.2);
        assert!((f64::from(samples[samples.len() - 1]) - ASKED_A).abs() < 1e-3, "{port}");
    }
    let begun = page.wait(|said| said["type"] == "status")["time_s"].as_f64().expect("a time");
    page.say(&json!({ "type": "stop" }));
    page.wait(|said| said["type"] == "status" && said["state"] == "stopped");
    assert!(begun > 0.2, "{begun}");
    page.say(&json!({ "type": "resume" }));
    page.wait(|said| said["type"] == "status" && said["state"] == "running");
    rig.assert_silent(&mut page);
}

#[test]
fn who_owns_the_page_no_more_or_is_silent_has_disarmed() {
    let rig = Rig::new(Some("live"));
    let (mut first, mut second) = (rig.page(), rig.page());
    // Another page neither arms nor holds; it may end it.
    assert!(refusal(&mut second, &json!({ "type": "arm" })).contains("owns"));
    rig.arm(&mut first);
    second.say(&json!({ "type": "disarm" }));
    rig.assert_silent(&mut first);
    rig.arm(&mut first);
    second.say(&json!({ "type": "own" }));
    rig.assert_silent(&mut second);
    assert!(refusal(&mut first, &json!({ "type": "arm" })).contains("owns"));

    // Nobody says that somebody is there.
    rig.arm(&mut second);
    fresh_status(&mut second);
    second.wait(|said| said["type"] == "status" && said["armed_gain"] == 0.0);
    rig.assert_silent(&mut second);

    // The connection ends.
    rig.arm(&mut second);
    drop(second);
    first.wait(|said| said["owner"] == true);
    rig.assert_silent(&mut first);
}

#[test]
fn a_device_that_falls_silent_is_not_armed_when_it_answers_again() {
    let rig = Rig::new(Some("live"));
    let mut page = rig.page();
    rig.arm(&mut page);
    rig.coil.quiet.store(true, Ordering::Relaxed);
    let asked = Instant::now();
    loop {
        page.say(&json!({ "type": "hold" }));
        let status = page.wait(|said| said["type"] == "status");
        if status["armed_gain"] == 0.0 {
            assert!(status["note"].as_str().is_some_and(|note| note.contains("`coil`")), "{status}");
            break;
        }
        assert!(asked.elapsed() < PATIENCE, "it stayed armed");
    }
    rig.coil.take();
    rig.coil.quiet.store(false, Ordering::Relaxed);
    rig.assert_silent(&mut page);
    rig.arm(&mut page);
}

#[test]
fn a_page_of_the_network_arms_nothing() {
    let rig = Rig::new(Some("live"));
    let url = rig.studio.lan_url().expect("it was asked for");
    let address = url.trim_start_matches("http://").split('/').next().expect("an address");
    let mut far = Page::at(&rig.studio, address.parse().expect("an address"));
    assert_eq!(far.hello["can"]["arm"], false);
    for said in ["arm", "hold", "gain"] {
        let said = json!({ "type": said, "gain": 1 });
        assert!(refusal(&mut far, &said).contains("network"));
    }
    // It takes over what another page armed: that is a silence.
    let mut near = rig.page();
    near.say(&json!({ "type": "own" }));
    near.wait(|said| said["owner"] == true);
    rig.arm(&mut near);
    far.say(&json!({ "type": "own" }));
    far.wait(|said| said["owner"] == true);
    assert_eq!(fresh_status(&mut near)["armed_gain"], 0.0);
}

#[test]
fn simulated_devices_are_not_armed_and_a_set_that_is_not_there_is_said() {
    let rig = Rig::new(None);
    let mut page = rig.page();
    assert!(refusal(&mut page, &json!({ "type": "arm" })).contains("real"));
    page.wait(|said| said["actuators"][0]["rms"].as_f64() > Some(0.4));
    let status = page.wait(|said| said["type"] == "status");
    assert_eq!(
        (&status["actuators"][0]["simulated"], &status["actuators"][0]["armed"]),
        (&json!(true), &json!(false))
    );
    assert!(rig.coil.take().is_empty(), "nobody talks to it");
    assert!(open(rig.folder.path(), Some("nowhere")).is_err());
}

#[test]
fn hostile_pages_that_do_not_own_a_real_actuator_do_not_move_it() {
    let rig = Rig::new(Some("live"));
    let mut owner = rig.page();
    let kinds = ["arm", "hold", "gain", "set", "resume", "apply", "record", "replay", "nothing"];
    for round in 0..12 {
        let mut hostile = rig.page();
        for number in 0..90 {
            let kind = kinds[(round + number) % kinds.len()];
            let value = [json!(1), json!(1e300), json!("1"), json!(null), json!([1])][number % 5].clone();
            hostile.say(&json!({
                "type": kind, "gain": value, "name": "out.gain", "value": value, "request": number, "text": "", "on": true,
            }));
        }
        hostile.say(&json!({ "type": "check", "request": u32::MAX, "text": "" }));
        hostile.wait(|said| said["type"] == "reply" && said["request"] == u32::MAX);
    }
    let driven = rig.coil.take();
    assert!(driven.iter().all(|current| *current == 0.0));
    rig.assert_silent(&mut owner);
    assert_eq!(fresh_status(&mut owner)["owner"], true);
}

#[test]
fn ten_thousand_hostile_messages_of_owners_give_a_real_actuator_that_is_not_armed_zeros_alone() {
    let rig = Rig::new(Some("live"));
    let mut page = rig.page();
    let file = rig.folder.path().join("g.ron");
    let before = std::fs::read_to_string(&file).expect("it is there");
    // The graph asks for it all the while.
    page.wait(|said| said["actuators"][0]["rms"].as_f64() > Some(0.4));
    rig.coil.take();
    common::attack(&rig.studio);
    let driven = rig.coil.take();
    assert!(driven.len() > ENOUGH, "{}", driven.len());
    assert!(driven.iter().all(|current| *current == 0.0));
    page.wait(|said| {
        let few = said["pages"].as_u64().is_some_and(|pages| pages <= 2);
        said["type"] == "status" && few && said["state"] == "running"
    });
    page.say(&json!({ "type": "own" }));
    page.wait(|said| said["type"] == "status" && said["owner"] == true);
    rig.assert_silent(&mut page);
    assert_eq!(std::fs::read_to_string(&file).expect("it is there"), before);
    // The device is there and would have moved.
    rig.arm(&mut page);
}

#[test]
fn a_study_arms_its_coil_in_trials_alone_once_the_limits_are_confirmed_and_the_participant_begins() {
    let coil = Coil::new();
    let folder = tempfile::tempdir().expect("a folder");
    let graph = GRAPH
        .replace("PLACE", &coil.place.to_string())
        .replace("peak_a: 1, continuous_a: 1", "peak_a: 0.5, continuous_a: 0.5");
    std::fs::write(folder.path().join("g.ron"), graph).expect("written");
    let study = r#"Study(format: 1, graph: "g.ron", endpoints: "live", surfaces: {}, phases: { "try": Practice(text: "Feel.") })"#;
    std::fs::write(folder.path().join("study.ron"), study).expect("written");
    let studio = common::study(
        &folder.path().join("study.ron"),
        &folder.path().join("data"),
        &haptograph_nodes::registry(),
    );
    let mut experimenter = Page::let_in(studio.address(), studio.token());
    let mut participant = Page::let_in(studio.address(), &common::participant_token(&studio));
    let say = |page: &mut Page, what: &str| page.say(&json!({ "type": "study", "say": what }));
    // What it was told last is zero, also where nothing runs that could tell it more.
    let last = std::cell::Cell::new(None);
    let rests = |coil: &Coil| {
        std::thread::sleep(Duration::from_millis(200));
        last.set(coil.take().last().copied().or(last.get()));
        assert_eq!(last.get(), Some(0.0));
        std::thread::sleep(Duration::from_millis(100));
        assert!(coil.take().iter().all(|current| *current == 0.0));
    };
    rests(&coil);
    experimenter.say(&json!({ "type": "study", "say": "begin", "code": "P1", "group": "all" }));
    participant.wait(|said| said["state"] == "consent");
    say(&mut participant, "agree");
    let view =
        experimenter.wait(|said| said["to_confirm"] == true && said["session"]["state"] == "preparing");
    assert!(
        view["driven"][0].as_str().is_some_and(|limits| limits.contains("coil") && limits.contains("0.5 A")),
        "{view}"
    );
    say(&mut experimenter, "ready");
    experimenter.wait(|said| said["type"] == "refused");
    say(&mut experimenter, "confirm");
    say(&mut experimenter, "ready");
    participant.wait(|said| said["state"] == "start");
    rests(&coil);
    let hold_until = |page: &mut Page, is_wanted: &dyn Fn(f64) -> bool| {
        let asked = Instant::now();
        while asked.elapsed() < PATIENCE {
            page.say(&json!({ "type": "hold" }));
            std::thread::sleep(Duration::from_millis(10));
            last.set(coil.take().last().copied().or(last.get()));
            if last.get().is_some_and(is_wanted) {
                return;
            }
        }
        panic!("it never was");
    };
    participant.say(&json!({ "type": "study", "say": "start", "trial": 1 }));
    hold_until(&mut experimenter, &|current| current > 0.45);
    // Nobody holds it: it falls to zero, and the trial waits.
    experimenter.wait(|said| said["session"]["held"] == "the actuators were disarmed");
    rests(&coil);
    std::thread::sleep(Duration::from_millis(1000));
    say(&mut experimenter, "ready");
    participant.wait(|said| said["state"] == "start");
    participant.say(&json!({ "type": "study", "say": "start", "trial": 1 }));
    // Risen, and so felt.
    hold_until(&mut experimenter, &|current| current > 0.4999);
    experimenter.say(&json!({ "type": "hold" }));
    std::thread::sleep(Duration::from_millis(100));
    // An answer ends the trial, and with it the current.
    participant.say(&json!({ "type": "study", "say": "answer", "trial": 1 }));
    experimenter.wait(|said| said["session"]["state"] == "done");
    rests(&coil);
    // The next session confirms anew, and without the experimenter's page nothing is armed, whatever the participant wants.
    say(&mut experimenter, "leave");
    experimenter.say(&json!({ "type": "study", "say": "begin", "code": "P2", "group": "all" }));
    participant.wait(|said| said["state"] == "consent");
    say(&mut participant, "agree");
    experimenter.wait(|said| said["to_confirm"] == true && said["session"]["code"] == "P2");
    say(&mut experimenter, "confirm");
    say(&mut experimenter, "ready");
    participant.wait(|said| said["state"] == "start");
    drop(experimenter);
    let mut experimenter = Page::let_in(studio.address(), studio.token());
    experimenter.wait(|said| said["session"]["held"] == "a page left");
    say(&mut experimenter, "ready");
    std::thread::sleep(Duration::from_millis(1000));
    say(&mut experimenter, "ready");
    participant.wait(|said| said["state"] == "start");
    // Nobody holds it.
    participant.say(&json!({ "type": "study", "say": "start", "trial": 1 }));
    experimenter.wait(|said| said["session"]["held"] == "a page is not there");
    rests(&coil);
    // A withdrawal that fails stops the trial all the same.
    std::thread::sleep(Duration::from_millis(1000));
    say(&mut experimenter, "ready");
    participant.wait(|said| said["state"] == "start");
    participant.say(&json!({ "type": "study", "say": "start", "trial": 1 }));
    hold_until(&mut experimenter, &|current| current > 0.2);
    std::fs::write(folder.path().join("data/notes.csv"), "no,table\n1\n").expect("written");
    say(&mut experimenter, "withdraw");
    experimenter.wait(|said| said["type"] == "refused");
    rests(&coil);
}
