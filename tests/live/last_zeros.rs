//! What a device is sent last, however the program ends.

use super::*;
use haptograph::live::udp::protocol::{Command as Driven, State};
use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// A port of this machine that is free.
fn free() -> SocketAddr {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap()
}

/// A graph that drives an arm steadily, and what else its endpoint is.
fn graph(endpoint: &str) -> String {
    format!(
        r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 1000) }}, nodes: {{
            "arm": Arm(clock: "servo", endpoint: "arm"),
            "half": Constant(clock: "servo", value: 0.5, quantity: "current"),
            "out": ActuatorSink(clock: "servo", endpoint: "arm", current: "half",
                                limit: (peak_a: 1, continuous_a: 1, slew_a_per_s: 0.5)),
        }}, endpoints: {{ "live": {{ "arm": {endpoint} }} }})"#
    )
}

fn start(folder: &Path, out: &str) -> Running {
    Running::start(folder, &["run", "g.ron", "--live", "--rested", "--out", out])
}

/// A device that asks all the time and keeps what it is told to drive.
struct Device {
    heard: Arc<Mutex<Vec<Driven>>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Device {
    fn at(address: SocketAddr) -> Self {
        let (heard, stop) = (Arc::<Mutex<Vec<Driven>>>::default(), Arc::<AtomicBool>::default());
        let (kept, ends) = (Arc::clone(&heard), Arc::clone(&stop));
        let thread = std::thread::spawn(move || {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            socket.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
            let (mut state, mut bytes) = (State::default(), [0; 100]);
            while !ends.load(Ordering::Relaxed) {
                state.sequence += 1;
                let _ = socket.send_to(&state.to_bytes(), address);
                while let Ok((length, _)) = socket.recv_from(&mut bytes) {
                    kept.lock().unwrap().push(Driven::from_bytes(&bytes[..length]).unwrap());
                }
            }
        });
        let thread = Some(thread);
        Self { heard, stop, thread }
    }

    fn heard(&self) -> Vec<Driven> {
        self.heard.lock().unwrap().clone()
    }

    /// Waits until a command is of some current.
    fn wait_for_current(&self) {
        let start = Instant::now();
        while self.heard().last().is_none_or(|last| last.current_a < 0.4) {
            assert!(start.elapsed() < Duration::from_secs(60), "nothing is driven");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Waits until nothing has come for a while, and returns the last.
    fn last(&self) -> Driven {
        let mut before = 0;
        loop {
            std::thread::sleep(Duration::from_millis(400));
            let heard = self.heard();
            if heard.len() == before {
                return *heard.last().unwrap();
            }
            before = heard.len();
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().unwrap().join();
    }
}

fn signal(name: &str, process: u32) {
    let process = process.to_string();
    assert!(Command::new("kill").args([name, &process]).status().unwrap().success());
}

/// The guards of a run: its only child processes.
fn guards(run: &Running) -> Vec<u32> {
    let tasks = fs::read_dir(format!("/proc/{}/task", run.child.id())).unwrap();
    let children = tasks.map(|task| fs::read_to_string(task.unwrap().path().join("children")).unwrap());
    children
        .flat_map(|ids| ids.split_whitespace().map(|id| id.parse().unwrap()).collect::<Vec<_>>())
        .collect()
}

fn with_device() -> (tempfile::TempDir, SocketAddr, Device) {
    let (folder, address) = (tempfile::tempdir().unwrap(), free());
    let endpoint = format!(r#"UdpDevice(listen: "{address}", timeout_ms: 5000)"#);
    fs::write(folder.path().join("g.ron"), graph(&endpoint)).unwrap();
    (folder, address, Device::at(address))
}

fn is_last_zero(driven: &Driven) -> bool {
    !driven.running && driven.current_a == 0.0
}

#[test]
fn a_device_of_a_killed_run_is_sent_zeros_and_the_next_run_is_not_disturbed() {
    let (folder, _, device) = with_device();
    let mut run = start(folder.path(), "first");
    device.wait_for_current();
    signal("-KILL", run.child.id());
    run.child.wait().unwrap();
    assert!(is_last_zero(&device.last()));

    let mut run = start(folder.path(), "second");
    device.wait_for_current();
    signal("-KILL", run.child.id());
    // At once, while the guard still has the port.
    let next = start(folder.path(), "third");
    run.child.wait().unwrap();
    let before = device.heard().len();
    device.wait_for_current();
    while device.heard().len() < before + 300 {
        std::thread::sleep(Duration::from_millis(5));
    }
    let heard = device.heard();
    let begin = heard.iter().rposition(is_last_zero).unwrap();
    assert!(begin < before, "zeros of the guard among commands of the next run");
    assert!(heard[begin + 1..].iter().all(|driven| driven.running));
    next.stop();
}

#[test]
fn a_run_that_aborts_or_is_interrupted_twice_sends_the_zeros_itself() {
    let (folder, _, device) = with_device();
    for (out, signals) in [("aborted", &["-ABRT"][..]), ("interrupted", &["-INT", "-INT"])] {
        let mut run = start(folder.path(), out);
        device.wait_for_current();
        // Without its guard.
        let guards = guards(&run);
        assert_eq!(guards.len(), 1);
        signal("-KILL", guards[0]);
        for name in signals {
            signal(name, run.child.id());
            // Signals closer together than 0.3 s count as one; the fall takes 0.8 s at least.
            std::thread::sleep(Duration::from_millis(400));
        }
        run.child.wait().unwrap();
        assert!(is_last_zero(&device.last()), "{out}");
    }
}

#[test]
fn the_guard_ends_with_the_run_and_hears_no_key_of_the_terminal() {
    let (folder, address, device) = with_device();
    let run = start(folder.path(), "out");
    device.wait_for_current();
    let guard = guards(&run)[0];
    for name in ["-INT", "-TERM", "-HUP"] {
        signal(name, guard);
    }
    let status = fs::read_to_string(format!("/proc/{guard}/stat")).unwrap();
    let group = status.rsplit(')').next().unwrap().split_whitespace().nth(2).unwrap();
    assert_eq!(group, guard.to_string(), "in a group of its own");
    run.stop();
    assert!(!Path::new(&format!("/proc/{guard}")).exists());
    assert!(UdpSocket::bind(address).is_ok());
}

#[test]
fn a_receiver_of_open_sound_control_is_sent_zeros_too() {
    let (folder, listen) = (tempfile::tempdir().unwrap(), free());
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(500))).unwrap();
    let to = socket.local_addr().unwrap();
    let endpoint = format!(r#"OscDevice(listen: "{listen}", send_to: "{to}", on_silence: Hold)"#);
    fs::write(folder.path().join("g.ron"), graph(&endpoint)).unwrap();
    let mut run = start(folder.path(), "out");
    let mut bytes = [0; 100];
    let mut next = || {
        // Something has to be heard before anything is driven.
        let _ = socket.send_to(&osc("/force", 1.0), listen);
        let length = socket.recv(&mut bytes).ok()?;
        let current = bytes[..length].strip_prefix(b"/current\0\0\0\0,f\0\0");
        Some(current.map(|number| f32::from_be_bytes(number.try_into().unwrap())))
    };
    while next().flatten().is_none_or(|current| current < 0.1) {}
    signal("-KILL", run.child.id());
    run.child.wait().unwrap();
    let mut last = None;
    while let Some(current) = next() {
        last = current.or(last);
    }
    assert_eq!(last, Some(0.0));
}
