//! Whatever a source does (stick, jump, shake, overflow, stop being a number), no actuator gets more than its sink states.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use haptograph_engine::document::Document;
use haptograph_engine::frame::Kind;
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::node::{
    BuildContext, BuildError, Io, NodeEntry, NodeKind, NodeSpec, Processor, Tick, output,
};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::run::{LiveState, Run, live};
use haptograph_signal::quantity::Quantity;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::sync::Arc;

haptograph_engine::settings! {
    /// None.
    pub struct NoSettings {}
}

/// A source that does everything that a source should not.
#[derive(Clone)]
struct Evil {
    random: Xoshiro256PlusPlus,
    habit: u32,
    left: u32,
    held: f64,
}

impl Evil {
    fn next(&mut self) -> f64 {
        if self.left == 0 {
            self.habit = self.random.random_range(0..8);
            self.left = self.random.random_range(1..3000);
            self.held = self.random.random_range(-20.0..20.0);
        }
        self.left -= 1;
        let shaking = self.random.random_range(-1.0..1.0);
        match self.habit {
            // Sticks, at rest or hard against an end.
            0 => 0.0,
            1 => self.held,
            // Shakes, also from end to end at every tick.
            2 => shaking,
            3 => 1e3 * f64::signum(shaking),
            // Jumps once in a while.
            4 if self.random.random_bool(0.01) => 1e308,
            // Is no number, always or now and then.
            5 => [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][self.random.random_range(0..3)],
            6 if self.random.random_bool(0.05) => f64::NAN,
            7 => 5e-324,
            _ => self.held + shaking,
        }
    }
}

impl Processor for Evil {
    fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
        for lane in io.out(0) {
            *lane = self.next();
        }
    }
}

macro_rules! evil {
    ($kind:ident, $frame:expr, $quantity:expr) => {
        struct $kind;
        impl NodeKind for $kind {
            type Settings = NoSettings;
            const SPEC: NodeSpec = NodeSpec {
                name: stringify!($kind),
                group: "tests",
                doc: "Everything that a source should not do.",
                source: "",
                inputs: &[],
                outputs: &[output("output", $frame, $quantity, "Anything.")],
                example: "",
            };
            fn build(_: NoSettings, cx: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
                Ok(Box::new(Evil {
                    random: Xoshiro256PlusPlus::seed_from_u64(cx.seed),
                    habit: 0,
                    left: 0,
                    held: 0.0,
                }))
            }
        }
    };
}

evil!(EvilCurrent, Kind::Scalar, Quantity::CURRENT);
evil!(EvilVoltage, Kind::Scalar, Quantity::VOLTAGE);
evil!(EvilForce, Kind::Vector, Quantity::FORCE);

/// What every sink of this test states, in the unit of its drive.
const PEAK: f64 = 2.0;
const CONTINUOUS: f64 = 0.5;
const WINDOW_S: f64 = 0.2;
const SLEW_PER_S: f64 = 400.0;

/// Kind of the sink and its port, the source that plagues it, its unit, the device that it drives and the device's rate.
const SINKS: [(&str, &str, &str, &str, &str, u32); 4] = [
    (
        "ActuatorSink",
        "current",
        "EvilCurrent",
        "a",
        "SimulatedHaptuator()",
        10_000,
    ),
    (
        "SoundcardSink",
        "voltage",
        "EvilVoltage",
        "v",
        "SoundcardVoltage(volts_full_scale: 2)",
        48_000,
    ),
    (
        "ForceSink",
        "force",
        "EvilForce",
        "n",
        "SimulatedOmni(scene: [Sphere(diameter_mm: 100)], does: [Press(force_n: 1)])",
        1000,
    ),
    (
        "BrakeSink",
        "brake",
        "EvilCurrent",
        "a",
        "SimulatedPenAndObject(object: Cube(edge_mm: 25.4), does: [Press(force_n: 1)])",
        1000,
    ),
];

fn graph(sink: &str, port: &str, source: &str, unit: &str, device: &str, rate_hz: u32) -> Graph {
    let text = format!(
        r#"Graph(format: 1, seed: 3, clocks: {{ "c": Driver(rate_hz: {rate_hz}) }},
        nodes: {{
            "evil": {source}(clock: "c"),
            "out": {sink}({port}: "evil", endpoint: "device", limit: (
                peak_{unit}: {PEAK}, continuous_{unit}: {CONTINUOUS}, window_s: {WINDOW_S}, slew_{unit}_per_s: {SLEW_PER_S},
            )),
        }},
        endpoints: {{ "simulated": {{ "device": {device} }} }})"#
    );
    let mut registry = haptograph_nodes::registry();
    registry
        .add(NodeEntry::processor::<EvilCurrent>())
        .add(NodeEntry::processor::<EvilVoltage>())
        .add(NodeEntry::processor::<EvilForce>());
    Document::parse("faults.ron", &text)
        .and_then(|document| check(&document, &registry, &CheckOptions::default()))
        .unwrap_or_else(|wrong| panic!("{wrong}"))
}

/// Runs each sink for so many ticks.
fn plague(ticks: impl Fn(&str) -> u64) {
    let mut met = Vec::new();
    for (sink, port, source, unit, device, rate_hz) in SINKS {
        let graph = graph(sink, port, source, unit, device, rate_hz);
        let out = graph
            .nodes()
            .node_indices()
            .find(|node| graph.nodes()[*node].path == "out");
        let taps = vec![(out.unwrap(), 0)];
        let mut run = Run::new(Arc::new(Plan::new(&graph, &PlanOptions { block: 64, taps })));
        let width = if source == "EvilForce" { 3 } else { 1 };
        let rate_hz = f64::from(rate_hz);
        let (mut before, mut heat, mut strongest) = (vec![0.0; width], 0.0, 0.0_f64);
        let (mut faults, weight) = (0, -(-1.0 / (WINDOW_S * rate_hz)).exp_m1());
        while run.driver_frames() < ticks(sink) {
            run.advance(64);
            let silenced = run.faults().ticks > faults;
            faults = run.faults().ticks;
            for frame in run.tap(0).chunks(width) {
                let norm = |lanes: &[f64]| lanes.iter().map(|x| x * x).sum::<f64>().sqrt();
                let now = norm(frame);
                assert!(
                    now.is_finite() && now <= PEAK * (1.0 + 1e-12),
                    "{sink}: {frame:?}"
                );
                let change: Vec<f64> = frame.iter().zip(&before).map(|(a, b)| a - b).collect();
                // What is no number becomes zero at once: there the slew yields.
                let falls = silenced && now == 0.0;
                let step = norm(&change) * rate_hz;
                assert!(
                    falls || step <= SLEW_PER_S * (1.0 + 1e-9),
                    "{sink}: {before:?} to {frame:?}"
                );
                heat += weight * (now * now - heat);
                assert!(heat <= CONTINUOUS * CONTINUOUS * (1.0 + 1e-9), "{sink}: {heat}");
                before.copy_from_slice(frame);
                strongest = strongest.max(now);
            }
        }
        assert!(
            strongest > CONTINUOUS && faults > 0,
            "{sink}: {strongest}, {faults} faults"
        );
        let node = run.faults().origin.map(|node| graph.nodes()[node].path.clone());
        assert_eq!(node.as_deref(), Some("evil"), "{sink}");
        met.push(sink);
    }
    let registry = haptograph_nodes::registry();
    let mut sinks: Vec<&str> = registry
        .nodes()
        .iter()
        .filter(|entry| entry.is_actuator())
        .map(|entry| entry.spec.name)
        .collect();
    sinks.sort_unstable();
    met.sort_unstable();
    assert_eq!(met, sinks, "a new kind of sink has to be plagued too");
}

#[test]
fn no_sink_exceeds_what_it_states() {
    plague(|sink| if sink == "BrakeSink" { 20_000 } else { 100_000 });
}

#[test]
#[ignore = "ten million ticks: minutes"]
fn no_sink_exceeds_what_it_states_in_ten_million_ticks() {
    plague(|sink| if sink == "BrakeSink" { 1_000_000 } else { 3_000_000 });
}

#[test]
fn a_stop_takes_a_sink_slower_than_its_driver_to_zero_within_its_slew() {
    let text = r#"Graph(format: 1,
        clocks: { "c": Driver(rate_hz: 10000), "slow": Derived(of: "c", rate_hz: 1000) },
        nodes: {
            "push": Constant(clock: "slow", value: 1.5, quantity: "current"),
            "out": ActuatorSink(current: "push", endpoint: "device", limit: (
                peak_a: 2, continuous_a: 2, window_s: 1, slew_a_per_s: 50,
            )),
        },
        endpoints: { "simulated": { "device": SimulatedHaptuator() } })"#;
    let graph = Document::parse("slow.ron", text)
        .and_then(|document| check(&document, &haptograph_nodes::registry(), &CheckOptions::default()))
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    let out = graph
        .nodes()
        .node_indices()
        .find(|node| graph.nodes()[*node].path == "out");
    for phase in 0..10 {
        let taps = vec![(out.unwrap(), 0)];
        let plan = Arc::new(Plan::new(&graph, &PlanOptions { block: 1, taps }));
        let (mut live, mut control) = live(plan);
        let mut delivered = Vec::new();
        live.callback(1000 + phase, |run, _| delivered.extend_from_slice(run.tap(0)));
        assert_eq!(delivered.last(), Some(&1.5));
        control.stop().unwrap();
        live.callback(10_000, |run, _| delivered.extend_from_slice(run.tap(0)));
        assert_eq!(live.state(), LiveState::Stopped);
        assert_eq!(delivered.last(), Some(&0.0), "phase {phase}");
        let steps = delivered.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        assert!(steps.fold(0.0, f64::max) <= 0.05 + 1e-12, "phase {phase}");
        // 1.5 A at 50 A/s take 30 ms, and the fade begins to ask for less at once.
        assert!(delivered.len() < 100 + 45, "phase {phase}: {}", delivered.len());
    }
}

#[test]
fn the_end_takes_a_sink_slower_than_its_driver_to_zero_too() {
    let text = r#"Graph(format: 1,
        clocks: { "c": Driver(rate_hz: 10000), "servo": Derived(of: "c", rate_hz: 1000) },
        nodes: {
            "push": ConstantVector(clock: "servo", value: (0, 0, 1.5), quantity: "force"),
            "out": ForceSink(force: "push", endpoint: "device", limit: (peak_n: 3.3, continuous_n: 3)),
        },
        endpoints: { "simulated": { "device": SimulatedOmni(
            scene: [Sphere(diameter_mm: 100)], does: [Press(force_n: 1)],
        ) } })"#;
    let graph = Document::parse("end.ron", text)
        .and_then(|document| check(&document, &haptograph_nodes::registry(), &CheckOptions::default()))
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    for phase in 0..10 {
        let plan = Arc::new(Plan::new(&graph, &PlanOptions::default()));
        let (mut live, _control) = live(plan);
        live.end_after(1000 + phase);
        let mut wakes = 0;
        while !live.is_at_rest() {
            live.callback(16, |_, _| {});
            wakes += 1;
            assert!(wakes < 200, "phase {phase}");
        }
        // It was at rest because the actuator was, not because time was over.
        assert!(live.run().rests(), "phase {phase}");
    }
}
