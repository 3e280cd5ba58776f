use super::super::exchange::ahead;
use super::super::protocol::{Command, State};
use super::*;
use crate::connections::Connections;
use haptograph_nodes::network::link::{Counts, Link};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A conversation over loopback, and the device's end of it.
struct Table {
    link: Arc<Link>,
    device: UdpSocket,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<()>,
    to: SocketAddr,
}

/// Silence that no loaded machine makes by itself within these tests.
const TIMEOUT: Duration = Duration::from_secs(60);

impl Table {
    fn new(timeout: Duration) -> Self {
        Self::of(timeout, Arc::new(Link::default()))
    }

    fn of(timeout: Duration, link: Arc<Link>) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_read_timeout(Some(WAIT)).unwrap();
        let to = socket.local_addr().unwrap();
        let config =
            SocketConfig { link: Arc::clone(&link), listen: to, only: None, timeout, codec: Codec::Protocol };
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let (_, edits) = channel();
        let version = link.driven_version();
        let thread =
            std::thread::spawn(move || Exchange::new(config, &socket, None, version).run(&edits, &flag));
        let device = UdpSocket::bind("127.0.0.1:0").unwrap();
        device.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        Self { link, device, stop, thread, to }
    }

    fn send(&self, sequence: u32, x_m: f64) {
        let state = State { sequence, position_m: [x_m, 0.0, 0.0], ..State::default() };
        self.device.send_to(&state.to_bytes(), self.to).unwrap();
    }

    fn answer(&self) -> Command {
        let mut bytes = [0; 200];
        let (length, _) = self.device.recv_from(&mut bytes).unwrap();
        Command::from_bytes(&bytes[..length]).unwrap()
    }

    /// Sends a state that is answered: everything sent before has been looked at then.
    fn settle(&self, sequence: u32) -> Counts {
        self.send(sequence, 0.25);
        while self.answer().answers != sequence {}
        self.link.counts()
    }

    fn end(self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap();
    }
}

#[test]
fn every_state_is_answered_with_the_latest_drives() {
    let table = Table::new(TIMEOUT);
    table.link.driven.put(&[1.0, 2.0, 3.0, 0.25, 0.1]);
    table.send(41, 0.01);
    let command = table.answer();
    assert_eq!((command.answers, command.running), (41, true));
    assert_eq!((command.force_n, command.current_a, command.brake_a), ([1.0, 2.0, 3.0], 0.25, 0.1));
    assert_eq!(table.link.sensed.look().unwrap().1[0], 0.01);
    let device = table.device.try_clone().unwrap();
    table.end();
    let mut bytes = [0; 200];
    let (length, _) = device.recv_from(&mut bytes).unwrap();
    let goodbye = Command::from_bytes(&bytes[..length]).unwrap();
    assert_eq!((goodbye.running, goodbye.force_n), (false, [0.0; 3]));
}

#[test]
fn the_last_command_of_an_earlier_run_is_not_sent() {
    let link = Arc::new(Link::default());
    link.driven.put(&[1.0, 2.0, 3.0, 0.25, 0.1]);
    let table = Table::of(TIMEOUT, Arc::clone(&link));
    table.send(1, 0.01);
    assert_eq!(table.answer().force_n, [0.0; 3]);
    link.driven.put(&[3.0, 0.0, 0.0, 0.0, 0.0]);
    table.send(2, 0.01);
    let mut command = table.answer();
    while command.answers != 2 {
        command = table.answer();
    }
    assert_eq!(command.force_n, [3.0, 0.0, 0.0]);
    table.end();
}

#[test]
fn missing_doubled_and_reordered_packets_are_counted_and_the_newest_stays() {
    let table = Table::new(TIMEOUT);
    for (sequence, x_m) in [(1, 0.1), (2, 0.2), (5, 0.5), (5, 0.9), (3, 0.9), (4, 0.9)] {
        table.send(sequence, x_m);
    }
    let counts = table.settle(6);
    assert_eq!((counts.accepted, counts.missing, counts.outdated), (4, 2, 3));
    table.end();
}

#[test]
fn numbers_go_on_round_the_largest() {
    assert_eq!(ahead(0, u32::MAX), Some(1));
    assert_eq!(ahead(u32::MAX, 0), None);
    assert_eq!(ahead(7, 7), None);
    assert_eq!(ahead(10, 7), Some(3));
}

#[test]
fn forged_sizes_foreign_packets_and_what_is_no_number_change_nothing() {
    let table = Table::new(TIMEOUT);
    table.settle(1);
    for length in [0, 1, 24, 119, 121, 1400, 9000] {
        table.device.send_to(&vec![0x48; length], table.to).unwrap();
    }
    let nan = State { sequence: 2, force_n: [0.0, f64::NAN, 0.0], ..State::default() };
    table.device.send_to(&nan.to_bytes(), table.to).unwrap();
    let far = State { sequence: 2, position_m: [0.0, 0.0, 1e308], ..State::default() };
    table.device.send_to(&far.to_bytes(), table.to).unwrap();
    let stranger = UdpSocket::bind("127.0.0.1:0").unwrap();
    let state = State { sequence: 2, position_m: [9.0; 3], ..State::default() };
    stranger.send_to(&state.to_bytes(), table.to).unwrap();
    let counts = table.settle(2);
    assert_eq!((counts.malformed, counts.not_numbers, counts.too_large), (7, 1, 1));
    assert_eq!(counts.rejected_packets, 1);
    assert_eq!((counts.accepted, counts.missing, counts.outdated), (2, 0, 0));
    assert_eq!(table.link.sensed.look().unwrap().1[0], 0.25);
    table.end();
}

#[test]
fn a_device_that_begins_anew_after_silence_is_heard() {
    let table = Table::new(Duration::from_millis(1));
    table.settle(1_000_000);
    std::thread::sleep(Duration::from_millis(20));
    assert_eq!(table.settle(0).accepted, 2);
    table.end();
}

#[test]
fn drives_that_nobody_renews_are_not_told_again() {
    let table = Table::new(Duration::from_millis(1));
    table.link.driven.put(&[1.0; 5]);
    table.settle(1);
    std::thread::sleep(Duration::from_millis(20));
    table.send(2, 0.0);
    let command = table.answer();
    assert_eq!((command.answers, command.force_n, command.current_a), (2, [0.0; 3], 0.0));
    table.end();
}

#[test]
fn after_zeros_a_device_gets_nothing_until_the_ticks_begin_from_zero() {
    let table = Table::new(Duration::from_millis(300));
    table.link.driven.put(&[1.0; 5]);
    table.settle(1);
    std::thread::sleep(Duration::from_millis(400));
    table.send(2, 0.0);
    assert_eq!(table.answer().force_n, [0.0; 3]);
    // A tick that had begun before the stall ends after it.
    table.link.driven.put(&[1.0; 5]);
    table.send(3, 0.0);
    assert_eq!(table.answer().force_n, [0.0; 3]);
    // A busy machine may be interrupted again.
    let begins = |sequence: &u32| {
        assert!(table.link.take_interruption() || *sequence > 4);
        table.link.driven.put(&[0.1; 5]);
        table.send(*sequence, 0.0);
        table.answer().force_n == [0.1; 3]
    };
    assert!((4..100).any(|sequence| begins(&sequence)));
    table.end();
}

/// A graph of tablets with these endpoints.
fn graph_of(endpoints: &[(&str, String)]) -> Graph {
    use haptograph_engine::document::Document;
    use haptograph_engine::graph::{CheckOptions, check};
    let tablet =
        |(name, _): &(&str, String)| format!(r#""{name}": Tablet(clock: "servo", endpoint: "{name}"), "#);
    let endpoint = |(name, written): &(&str, String)| format!(r#""{name}": {written}, "#);
    let nodes: String = endpoints.iter().map(tablet).collect();
    let endpoints: String = endpoints.iter().map(endpoint).collect();
    let text = format!(
        r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 1000) }}, nodes: {{ {nodes} }},
        endpoints: {{ "simulated": {{ {endpoints} }} }})"#
    );
    let document = Document::parse("g.ron", &text).unwrap();
    check(&document, &haptograph_nodes::registry(), &CheckOptions::default())
        .unwrap_or_else(|wrong| panic!("{wrong}"))
}

#[test]
fn other_settings_at_the_same_address_hold_from_the_edit_on() {
    let peer = UdpSocket::bind("127.0.0.1:0").unwrap();
    peer.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    let send_to = peer.local_addr().unwrap();
    let listen = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let osc = |rest: &str| graph_of(&[("pen", format!(r#"OscDevice(listen: "{listen}", {rest})"#))]);
    let mut before = osc(&format!(r#"position: "/old", send_to: "{send_to}""#));
    let mut connections = Connections::new(&haptograph_nodes::registry());
    connections.connect(&mut before).unwrap();
    let mut after = osc(r#"position: "/new""#);
    connections.connect(&mut after).unwrap();
    connections.keep(&after);
    // The two share a link.
    let link = Arc::clone(after.devices()[0].body::<Remote>().unwrap().link());
    let device = UdpSocket::bind("127.0.0.1:0").unwrap();
    let (start, mut heard) = (Instant::now(), None);
    while heard.is_none() && start.elapsed() < Duration::from_secs(30) {
        for (addr, x_mm) in [("/old", 10.0), ("/new", 20.0)] {
            let args = [x_mm, 0.0].map(rosc::OscType::Float).to_vec();
            let message = rosc::OscMessage { addr: addr.to_owned(), args };
            let bytes = rosc::encoder::encode(&rosc::OscPacket::Message(message)).unwrap();
            device.send_to(&bytes, listen).unwrap();
        }
        std::thread::sleep(WAIT);
        heard = link.sensed.look().map(|(_, sensed)| sensed[0]).filter(|x_m| *x_m > 0.015);
    }
    assert_eq!(heard, Some(0.02), "at the new address");
    assert_eq!(connections.status().len(), 1);
    // The peer that is driven no more got three last messages of zeros, after earlier ones.
    drop(connections);
    peer.set_nonblocking(true).unwrap();
    let (mut last, mut bytes) = (Vec::new(), [0; 100]);
    while let Ok((length, _)) = peer.recv_from(&mut bytes) {
        last = bytes[..length].to_vec();
    }
    assert!(last.starts_with(b"/brake"), "{last:?}");
}

#[test]
fn a_graph_that_is_not_run_after_all_leaves_no_socket_behind() {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let busy = socket.local_addr().unwrap();
    // The first is free as long as nobody else takes it.
    let free = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let graph = |names: &[(&'static str, SocketAddr)]| {
        let udp = |(name, listen): &(&'static str, SocketAddr)| {
            (*name, format!(r#"UdpDevice(listen: "{listen}")"#))
        };
        graph_of(&names.iter().map(udp).collect::<Vec<_>>())
    };
    let any = SocketAddr::from(([127, 0, 0, 1], 0));
    let mut connections = Connections::new(&haptograph_nodes::registry());
    connections.connect(&mut graph(&[("a", any)])).unwrap();
    let names = |connections: &Connections| {
        let links = connections.status().into_iter();
        links.map(|link| link.names.concat()).collect::<Vec<_>>()
    };
    assert!(connections.connect(&mut graph(&[("a", any), ("b", free), ("c", busy)])).is_err());
    assert_eq!(names(&connections), ["a"]);
    connections.connect(&mut graph(&[("a", any), ("b", free)])).unwrap();
    assert_eq!(names(&connections), ["a", "b"]);
    connections.undo();
    assert_eq!(names(&connections), ["a"]);
    assert!(UdpSocket::bind(free).is_ok(), "its address is free again");
}
