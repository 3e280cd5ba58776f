//! Tests: what the silence of each kind of live input does to actuators, by the signal that they are delivered and by the
//! status that is read from the run.

mod tests;

use haptograph_engine::document::Document;
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::node::FrameWriter;
use haptograph_engine::run::{FileSinks, InputStatus, Player, Probe, Session, SessionOptions};
use haptograph_engine::silence::InputState::{Heard, Never, Silent};
use haptograph_nodes::network::Remote;
use haptograph_nodes::network::link::{Link, SENSED};
use std::sync::Arc;

/// The link of a network device.
fn link(graph: &Graph, device: &str) -> Arc<Link> {
    let known = graph.devices().iter().find(|known| known.name == device);
    Arc::clone(known.unwrap().body::<Remote>().unwrap().link())
}

/// Publishes an update of a device, as its thread would: the tip at rest, pressed with a force (N).
fn press(link: &Link, force_n: f64) {
    let mut sensed = [0.0; SENSED];
    sensed[8] = force_n;
    link.publish(&sensed);
}

/// A live run in virtual time, with the delivered signal of the sink `out`.
pub(crate) struct Rig {
    pub lives: Vec<Player>,
    session: Session,
    /// The delivered signal of `out`.
    pub signal: Vec<f64>,
}

struct Nowhere;

impl FrameWriter for Nowhere {
    fn write(&mut self, _: usize, _: &[f64]) -> std::io::Result<()> {
        Ok(())
    }
    fn finish(self: Box<Self>) -> std::io::Result<()> {
        Ok(())
    }
}

impl Rig {
    pub fn new(text: &str, open: impl FnOnce(&Graph, &mut [Player])) -> Self {
        let document = Document::parse("g.ron", text).unwrap();
        let graph = check(&document, &haptograph_nodes::registry(), &CheckOptions::default())
            .unwrap_or_else(|wrong| panic!("{wrong}"));
        let nodes = graph.nodes();
        let out = nodes.find("out");
        let mut outlets = FileSinks::new(&graph);
        outlets.probe(Probe { node: out.unwrap(), output: 0, writer: Box::new(Nowhere) });
        let (mut lives, session) = Session::open_all(outlets, &SessionOptions::default(), None).unwrap();
        open(&graph, &mut lives);
        Self { lives, session, signal: Vec::new() }
    }

    /// With the link of a device.
    pub fn with(text: &str, device: &str) -> (Self, Arc<Link>) {
        let mut found = None;
        let rig = Self::new(text, |graph, _| found = Some(link(graph, device)));
        (rig, found.unwrap())
    }

    /// So many milliseconds pass, with `before` ahead of each; returns the last frame that `out` delivered.
    pub fn pass(&mut self, ms: usize, mut before: impl FnMut()) -> f64 {
        for _ in 0..ms {
            before();
            for live in &mut self.lives {
                let frames = (live.run().rate_hz() / 1000.0).round() as usize;
                let mut done = 0;
                live.process_with(frames, |run, block| {
                    self.signal.extend_from_slice(run.tap(0));
                    done += block;
                });
                assert_eq!(done, frames);
            }
        }
        *self.signal.last().unwrap()
    }

    pub fn status(&self, device: &str) -> InputStatus {
        let mut inputs = self.session.live_inputs().into_iter();
        inputs.find(|input| input.device == device).unwrap()
    }

    /// That the status of the input's only actuator is that of the signal; returns what was delivered.
    pub fn assert_true_status(&self, device: &str, at_zero: bool) -> f64 {
        let status = self.status(device);
        let [actuator] = &status.actuators[..] else { panic!("{status:?}") };
        let delivered = self.signal.last().unwrap().abs();
        assert_eq!((&*actuator.path, &*actuator.unit), ("out", "A"));
        assert_eq!((actuator.delivered, actuator.at_zero), (delivered, at_zero));
        delivered
    }

    /// The largest step of the signal from frame `from` on.
    pub fn leap(&self, from: usize) -> f64 {
        let steps = self.signal[from..].windows(2).map(|pair| (pair[1] - pair[0]).abs());
        steps.fold(0.0, f64::max)
    }
}

/// A bias of 0.4 A beside 0.1 A per newton: without the policy the bias would stay.
fn graph(device: &str) -> String {
    format!(
        r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 1000) }},
        nodes: {{
            "stylus": Tablet(clock: "servo", endpoint: "stylus"),
            "felt": Calibrate(input: "stylus.force", from: "force", to: "current", factor: 0.1),
            "bias": Constant(clock: "servo", value: 0.4, quantity: "current"),
            "sum": Add(inputs: ["felt", "bias"]),
            "out": ActuatorSink(current: "sum", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
            "apart": ActuatorSink(current: "bias", endpoint: "other", limit: (peak_a: 1, continuous_a: 1)),
        }},
        endpoints: {{ "simulated": {{
            "stylus": {device}, "coil": SimulatedHaptuator(), "other": SimulatedHaptuator(),
        }} }})"#
    )
}

/// Of a device that counts as gone after 20 to 50 ms.
fn falls_silent_and_comes_back(device: &str) {
    for holds in [false, true] {
        let settings = if holds { ", on_silence: Hold)" } else { ")" };
        let (mut rig, stylus) = Rig::with(&graph(&device.replace(')', settings)), "stylus");
        let speaks = || press(&stylus, 1.0);
        assert_eq!(rig.pass(50, || {}), 0.0);
        assert_eq!(rig.status("stylus").state, Never, "nothing was heard yet");
        rig.assert_true_status("stylus", true);
        let spoken = rig.pass(100, speaks);
        assert!((spoken - 0.5).abs() < 1e-9, "{spoken}");
        assert_eq!(rig.status("stylus").state, Heard);
        rig.assert_true_status("stylus", false);
        let (before, frames) = (rig.leap(0), rig.signal.len());
        let silent = rig.pass(100, || {});
        assert_eq!(rig.status("stylus").state, Silent);
        let delivered = rig.assert_true_status("stylus", !holds);
        assert_eq!(silent, if holds { spoken } else { 0.0 });
        assert_eq!(delivered, silent);
        let back = rig.pass(100, speaks);
        assert!((back - 0.5).abs() < 1e-9, "{back}");
        rig.assert_true_status("stylus", false);
        // Ramps of 10 ms down and up, of two factors where the force falls too.
        assert!(rig.leap(frames) <= 0.11 && before <= 0.11, "no leap: {}", rig.leap(0));
    }
}

#[test]
fn an_actuator_follows_the_silence_of_a_udp_device() {
    falls_silent_and_comes_back("UdpDevice(timeout_ms: 20)");
}

#[test]
fn an_actuator_follows_the_silence_of_an_osc_sender() {
    falls_silent_and_comes_back("OscDevice(timeout_ms: 20)");
}

#[test]
fn an_actuator_follows_the_absence_of_an_event_device() {
    falls_silent_and_comes_back("EvdevDevice(path: \"/dev/input/made-up\")");
}

/// Stylus, force on a simulated arm, position of the arm, ring to another driver, actuator.
#[test]
fn silence_reaches_through_bodies_and_rings() {
    let text = r#"Graph(format: 1,
        clocks: { "servo": Driver(rate_hz: 1000), "audio": Driver(rate_hz: 8000) },
        nodes: {
            "stylus": Tablet(clock: "servo", endpoint: "stylus"),
            "push": Pack(x: "stylus.force", y: "stylus.force", z: "stylus.force"),
            "on_arm": ForceSink(force: "push", endpoint: "arm", limit: (peak_n: 1, continuous_n: 1)),
            "arm": Arm(clock: "servo", endpoint: "arm"),
            "far": Magnitude(input: "arm.position"),
            "here": Calibrate(input: "far", from: "length", to: "current", factor: 1e-6),
            "there": Gain(clock: "audio", input: Ring(from: "here", latency_ms: 40), gain: 1),
            "bias": Constant(clock: "audio", value: 0.4, quantity: "current"),
            "sum": Add(inputs: ["there", "bias"]),
            "out": ActuatorSink(current: "sum", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
        },
        endpoints: { "simulated": {
            "stylus": UdpDevice(listen: "127.0.0.1:61752"), "arm": SimulatedOmni(), "coil": SimulatedHaptuator(),
        } })"#;
    let (mut rig, stylus) = Rig::with(text, "stylus");
    let speaks = || press(&stylus, 1.0);
    assert_eq!(rig.pass(50, || {}), 0.0);
    assert!((rig.pass(200, speaks) - 0.4).abs() < 0.01);
    assert_eq!(rig.pass(100, || {}), 0.0);
    let status = rig.status("stylus");
    let zeros: Vec<(&str, f64, bool)> =
        status.actuators.iter().map(|a| (&*a.path, a.delivered, a.at_zero)).collect();
    assert_eq!(zeros.len(), 2);
    assert!(zeros.contains(&("out", 0.0, true)) && zeros.contains(&("on_arm", 0.0, true)));
}

#[test]
fn a_device_is_never_driven_while_it_is_silent_itself() {
    let text = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) },
        nodes: {
            "bias": Constant(clock: "servo", value: 0.4, quantity: "current"),
            "out": ActuatorSink(current: "bias", endpoint: "arm", limit: (peak_a: 1, continuous_a: 1)),
        },
        endpoints: { "simulated": { "arm": UdpDevice(listen: "127.0.0.1:61753", on_silence: Hold) } })"#;
    let (mut rig, arm) = Rig::with(text, "arm");
    let speaks = || press(&arm, 1.0);
    assert!((rig.pass(100, speaks) - 0.4).abs() < 1e-12);
    assert_eq!(rig.pass(100, || {}), 0.0);
    rig.assert_true_status("arm", true);
}

/// Reports of silences do not make the callbacks of a live run allocate.
#[test]
fn gates_do_not_allocate() {
    let (mut rig, stylus) = Rig::with(&graph("UdpDevice()"), "stylus");
    rig.signal.reserve(10_000);
    rig.pass(10, || press(&stylus, 1.0));
    let allocated = crate::realtime::allocations(|| {
        for _ in 0..3 {
            rig.pass(100, || press(&stylus, 1.0));
            rig.pass(100, || {});
        }
    });
    assert_eq!(allocated, 0);
}
