//! Whatever a source does (stick, jump, shake, overflow, stop being a number), no actuator gets more than its sink states.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use haptograph_engine::document::Document;
use haptograph_engine::frame::{AnyKind, Scalar, Vector};
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, NodeEntry, NodeKind, Output, Port, Processor, Tick,
};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::run::{Change, PlayerState, Run, player};
use haptograph_engine::settings::LiveId;
use haptograph_signal::quantity::Quantity;
use rand::seq::IndexedRandom;
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

impl<K: EvilKind> Processor<K> for Evil {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, K>) {
        for component in io.write(K::OUTPUT) {
            *component = self.next();
        }
    }
}

/// A kind of node whose processor is an [`Evil`].
trait EvilKind: NodeKind {
    const OUTPUT: Output<Self, AnyKind>;
}

macro_rules! evil {
    ($kind:ident, $frame:ty, $quantity:expr) => {
        haptograph_engine::node! {
            /// Everything that a source should not do.
            struct $kind(NoSettings) in "tests";
            example: "";
            out OUTPUT: $frame = Port::of($quantity, "Anything.");
        }
        impl NodeKind for $kind {
            fn build(_: NoSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
                Ok(Built::new(Evil {
                    random: Xoshiro256PlusPlus::seed_from_u64(cx.seed),
                    habit: 0,
                    left: 0,
                    held: 0.0,
                }))
            }
        }
        impl EvilKind for $kind {
            const OUTPUT: Output<Self, AnyKind> = Self::OUTPUT.any();
        }
    };
}

evil!(EvilCurrent, Scalar, Quantity::CURRENT);
evil!(EvilVoltage, Scalar, Quantity::VOLTAGE);
evil!(EvilForce, Vector, Quantity::FORCE);

/// What every sink of this test states, in the unit of its drive.
const PEAK: f64 = 2.0;
const CONTINUOUS: f64 = 0.5;
const WINDOW_S: f64 = 0.2;
const SLEW_PER_S: f64 = 400.0;

type Sink = (&'static str, &'static str, &'static str, &'static str, &'static str, u32);

/// Kind of the sink and its port, the source that plagues it, its unit, the device that it drives and the device's rate.
const SINKS: [Sink; 4] = [
    ("ActuatorSink", "current", "EvilCurrent", "a", "SimulatedHaptuator()", 10_000),
    ("SoundcardSink", "voltage", "EvilVoltage", "v", "SoundcardVoltage(volts_full_scale: 2)", 48_000),
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

/// The source has a name, from which its randomness comes.
fn graph((sink, port, source, unit, device, rate_hz): Sink, name: &str, seed: u64) -> Graph {
    let text = format!(
        r#"Graph(format: 1, seed: {seed}, clocks: {{ "c": Driver(rate_hz: {rate_hz}) }},
        nodes: {{
            "{name}": {source}(clock: "c"),
            "out": {sink}({port}: "{name}", endpoint: "device", limit: (
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

/// Whether an actuator gets what its sink states, frame by frame.
struct Judge {
    sink: &'static str,
    rate_hz: f64,
    before: Vec<f64>,
    heat: f64,
    strongest: f64,
    faults: u64,
}

impl Judge {
    fn hear(&mut self, run: &Run) {
        let norm = |lanes: &[f64]| lanes.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (sink, weight) = (self.sink, -(-1.0 / (WINDOW_S * self.rate_hz)).exp_m1());
        self.faults = run.faults().ticks;
        for frame in run.tap(0).chunks(self.before.len()) {
            let now = norm(frame);
            assert!(now.is_finite() && now <= PEAK * (1.0 + 1e-12), "{sink}: {frame:?}");
            let change: Vec<f64> = frame.iter().zip(&self.before).map(|(a, b)| a - b).collect();
            let step = norm(&change) * self.rate_hz;
            assert!(step <= SLEW_PER_S * (1.0 + 1e-9), "{sink}: {:?} to {frame:?}", self.before);
            self.heat += weight * (now * now - self.heat);
            let most = CONTINUOUS * CONTINUOUS * (1.0 + 1e-9);
            assert!(self.heat <= most, "{sink}: {}", self.heat);
            self.before.copy_from_slice(frame);
            self.strongest = self.strongest.max(now);
        }
    }
}

/// Runs each sink for so many ticks, and puts one graph in the place of another all the time: faded into each other, at
/// the zero of a fade where the simulated device is another one, and while one of the two is going on.
fn plague(ticks: impl Fn(&str) -> u64) {
    let mut met = Vec::new();
    for declared in SINKS {
        let (sink, _, source, _, _, rate_hz) = declared;
        let graphs = [("evil", 3), ("worse", 3), ("evil", 4)].map(|(name, seed)| graph(declared, name, seed));
        let plans = graphs.each_ref().map(|graph| {
            let out = graph.nodes().find("out");
            let taps = vec![(out.unwrap(), 0)];
            Arc::new(Plan::of(graph, &PlanOptions::default().block(64).taps(taps)).remove(0))
        });
        let mut judge = Judge {
            sink,
            rate_hz: f64::from(rate_hz),
            before: vec![0.0; if source == "EvilForce" { 3 } else { 1 }],
            heat: 0.0,
            strongest: 0.0,
            faults: 0,
        };
        let (mut live, mut control) = player(Arc::clone(&plans[0]));
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        let (mut faded, mut through_zero) = (0, 0);
        while live.frames() < ticks(sink) {
            match control.swap(Arc::clone(plans.choose(&mut random).unwrap())) {
                Ok(Change::CrossFade) => faded += 1,
                Ok(Change::FadeThroughZero(_)) => through_zero += 1,
                other => assert_eq!(other, Ok(Change::Settings(0)), "{sink}"),
            }
            live.process_with(random.random_range(1..1500), |run, _| judge.hear(run));
            control.poll();
        }
        assert_eq!(live.state(), PlayerState::Running, "{sink}");
        assert!(
            judge.strongest > CONTINUOUS && judge.faults > 0,
            "{sink}: {}, {} faults",
            judge.strongest,
            judge.faults
        );
        assert!(faded > 2, "{sink}: {faded} cross-fades, {through_zero} swaps at zero");
        let origin = live.faults().origin;
        assert!(matches!(origin.as_deref(), Some("evil" | "worse")), "{sink}: {origin:?}");
        met.push(sink);
    }
    let registry = haptograph_nodes::registry();
    let mut sinks: Vec<&str> =
        registry.nodes().iter().filter(|entry| entry.is_actuator()).map(|entry| entry.spec.name).collect();
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
fn a_limit_above_what_the_device_can_give_is_lowered_and_said() {
    let limited = |full_scale_a: f64| {
        let text = format!(
            r#"Graph(format: 1, clocks: {{ "c": Driver(rate_hz: 48000) }},
            nodes: {{
                "push": Constant(clock: "c", value: 1, quantity: "current"),
                "out": ActuatorSink(current: "push", endpoint: "coil", limit: (peak_a: 0.5, continuous_a: 0.2)),
            }},
            endpoints: {{ "live": {{ "coil": Soundcard(amperes_full_scale: {full_scale_a}) }} }})"#
        );
        let options = CheckOptions::default().endpoints("live");
        let document = Document::parse("weak.ron", &text).unwrap_or_else(|wrong| panic!("{wrong}"));
        let graph = check(&document, &haptograph_nodes::registry(), &options);
        graph.unwrap_or_else(|wrong| panic!("{wrong}"))
    };
    for (full_scale_a, peak, continuous, said) in
        [(1.0, 0.5, 0.2, false), (0.3, 0.3, 0.2, true), (0.1, 0.1, 0.1, true)]
    {
        let graph = limited(full_scale_a);
        let (_, limit) = graph.limits().next().unwrap();
        assert_eq!((limit.peak, limit.continuous), (peak, continuous));
        assert_eq!(graph.warnings().iter().any(|warning| warning.code == "W0108"), said);
        // What is delivered is what the card plays.
        let taps = vec![(graph.nodes().find("out").unwrap(), 0)];
        let mut run =
            Run::new(Arc::new(Plan::of(&graph, &PlanOptions::default().block(64).taps(taps)).remove(0)));
        run.advance(64);
        assert!((run.tap(0)[63] - peak).abs() < 1e-12);
    }
}

/// Of a sink that drove another device until now only the name is known here.
#[test]
fn a_device_that_was_not_driven_rises_from_zero_whatever_its_sink_was_called() {
    let graph = |sinks: &str| {
        let text = format!(
            r#"Graph(format: 1, clocks: {{ "c": Driver(rate_hz: 10000) }},
            nodes: {{ "push": Constant(clock: "c", value: 1, quantity: "current"), {sinks} }},
            endpoints: {{ "simulated": {{ "left": SimulatedHaptuator(), "right": SimulatedHaptuator() }} }})"#
        );
        Document::parse("renamed.ron", &text)
            .and_then(|document| check(&document, &haptograph_nodes::registry(), &CheckOptions::default()))
            .unwrap_or_else(|wrong| panic!("{wrong}"))
    };
    let sink = |name: &str, endpoint: &str| {
        let limit = "limit: (peak_a: 2, continuous_a: 2, window_s: 1)";
        format!(r#""{name}": ActuatorSink(current: "push", endpoint: "{endpoint}", {limit}),"#)
    };
    let plan = |graph: &Graph, heard: &str| {
        let taps = vec![(graph.nodes().find(heard).unwrap(), 0)];
        Arc::new(Plan::of(graph, &PlanOptions::default().block(64).taps(taps)).remove(0))
    };
    let old = graph(&sink("out", "left"));
    let new = graph(&(sink("out", "right") + &sink("more", "left")));
    for (heard, from) in [("out", 0.0), ("more", 1.0)] {
        let (mut live, mut control) = player(plan(&old, "out"));
        live.process(1000);
        assert_eq!(control.swap(plan(&new, heard)), Ok(Change::CrossFade));
        let mut given = Vec::new();
        live.process_with(200, |run, _| given.extend_from_slice(run.tap(0)));
        for (frame, given) in given.iter().enumerate() {
            let expected = f64::max(from, (frame as f64 / 100.0).min(1.0));
            assert!((given - expected).abs() < 1e-12, "{heard}: {given} at {frame}");
        }
    }
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
    let out = graph.nodes().find("out");
    for phase in 0..10 {
        let taps = vec![(out.unwrap(), 0)];
        let plan = Arc::new(Plan::of(&graph, &PlanOptions::default().block(1).taps(taps)).remove(0));
        let (mut live, control) = player(plan);
        let mut delivered = Vec::new();
        live.process_with(1000 + phase, |run, _| delivered.extend_from_slice(run.tap(0)));
        assert_eq!(delivered.last(), Some(&1.5));
        control.stop();
        live.process_with(10_000, |run, _| delivered.extend_from_slice(run.tap(0)));
        assert_eq!(live.state(), PlayerState::Stopped);
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
        let plan = Arc::new(Plan::of(&graph, &PlanOptions::default()).remove(0));
        let (mut live, _control) = player(plan);
        live.end_after(1000 + phase);
        let mut wakes = 0;
        while !live.is_idle() {
            live.process(16);
            wakes += 1;
            assert!(wakes < 200, "phase {phase}");
        }
        // It was at rest because the actuator was, not because time was over.
        assert!(live.run().is_idle(), "phase {phase}");
    }
}

haptograph_engine::settings! {
    /// Settings of [`Told`].
    pub struct ToldSettings {
        /// What it puts out.
        [live, below_nyquist] cutoff_hz: f64, in 1.0..=1e6;
    }
}

haptograph_engine::node! {
    /// Puts out its setting.
    pub struct Told(ToldSettings) in "test";
    example: "";
    out OUTPUT: Scalar = Port::any("The setting.");
}

impl NodeKind for Told {
    fn build(settings: ToldSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Telling(settings.cutoff_hz)))
    }
}

#[derive(Clone)]
struct Telling(f64);

impl Processor<Told> for Telling {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Told>) {
        io.write(Told::OUTPUT).fill(self.0);
    }

    fn set(&mut self, _: LiveId<ToldSettings>, value: f64) {
        self.0 = value;
    }
}

#[test]
fn a_frequency_stays_below_half_the_rate_when_its_node_goes_to_a_slower_clock() {
    let mut registry = haptograph_nodes::registry();
    registry.add(NodeEntry::processor::<Told>());
    let plan = |clock: &str, cutoff_hz: f64| {
        let text = format!(
            r#"Graph(format: 1,
                clocks: {{ "fast": Driver(rate_hz: 10000), "slow": Derived(of: "fast", rate_hz: 1000) }},
                nodes: {{ "told": Told(clock: "{clock}", cutoff_hz: {cutoff_hz}) }})"#
        );
        let graph = Document::parse("slower.ron", &text)
            .and_then(|document| check(&document, &registry, &CheckOptions::default()))
            .unwrap_or_else(|wrong| panic!("{wrong}"));
        let taps = vec![(graph.nodes().find("told").unwrap(), 0)];
        Arc::new(Plan::of(&graph, &PlanOptions::default().block(16).taps(taps)).remove(0))
    };
    // The file changes the value too, or it was set while the graph ran.
    for (written_hz, set_hz) in [(3000.0, None), (400.0, Some(4000.0))] {
        let (mut live, mut control) = player(plan("fast", written_hz));
        if let Some(hz) = set_hz {
            let (node, setting) = (control.settings()[0].node, control.settings()[0].setting);
            control.set(node, setting, hz).unwrap();
        }
        live.process(2000);
        control.swap(plan("slow", 400.0)).unwrap();
        let mut heard = Vec::new();
        for _ in 0..20 {
            live.process_with(500, |run, _| heard.extend_from_slice(run.tap(0)));
        }
        assert!(heard.iter().all(|hz| (1.0..500.0).contains(hz)), "{heard:?}");
        assert!(heard[0] > 400.0, "it ramps from the end of the range: {heard:?}");
        assert_eq!(heard.last(), Some(&400.0));
    }
}
