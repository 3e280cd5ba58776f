//! What actuators are given while limits, sinks and devices change, against the definition of the limit in force.

use super::player::plan;
use super::world::{Nothing, with_processor};
use crate::device::{Device, DeviceEntry, DeviceKind, DeviceSpec};
use crate::graph::{Graph, Work};
use crate::node::{BuildContext, BuildError, Io, Limit, Processor, Tick};
use crate::run::{Change, FileSinks, Player, ReplayBounds, Session, SessionOptions, player};
use crate::settings::NoSettings;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

const RATE_HZ: f64 = 1000.0;

/// An actuator that can be looked at; nobody drives it where it is in no graph.
#[derive(Clone, Default)]
pub struct Coil(Arc<AtomicU64>, Arc<AtomicBool>);

impl Coil {
    pub fn given(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Relaxed))
    }

    /// Its hardware was given zeros meanwhile.
    pub fn interrupt(&self) {
        self.1.store(true, Ordering::Relaxed);
    }
}

impl Device for Coil {
    fn advance(&mut self) {}
    fn read(&mut self, _: usize, _: &mut [f64]) {}
    fn write(&mut self, _: usize, frame: &[f64]) {
        self.0.store(frame[0].to_bits(), Ordering::Relaxed);
    }
    fn take_interruption(&mut self) -> bool {
        self.1.swap(false, Ordering::Relaxed)
    }
}

/// Asks for this much.
#[derive(Clone)]
pub struct Asks(pub f64);

impl Processor<Nothing> for Asks {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Nothing>) {
        io.ports.out(0).fill(self.0);
    }
}

/// A graph that drives a coil, known by its number, by a sink and an endpoint of some names.
fn driving(coils: &[Coil], coil: usize, names: (usize, usize), limit: Limit, ask: f64) -> Graph {
    let (mut graph, node, sink) = with_processor(Asks(ask * 10.0));
    graph.nodes[node].fingerprint = ask.to_bits();
    graph.nodes[sink].path = format!("sink {}", names.0);
    if let Work::Actuator { limit: to, .. } = &mut graph.nodes[sink].work {
        *to = limit;
    }
    let device = &mut graph.devices[0];
    device.name = format!("endpoint {}", names.1);
    device.fingerprint = coil as u64;
    device.device = Box::new(coils[coil].clone());
    graph
}

/// One that drives nothing.
fn driving_nothing() -> Graph {
    let (mut graph, _, sink) = with_processor(Asks(0.0));
    graph.nodes.remove_node(sink);
    graph.devices.clear();
    graph
}

/// What the coils were given, and the mean square over the windows of the limits that may be in force.
struct Judge {
    coils: Vec<Coil>,
    windows_s: Vec<f64>,
    /// By coil and window.
    means: Vec<Vec<f64>>,
    hot: usize,
    in_debt: usize,
}

impl Judge {
    /// A tick is done, in which this limit held for this coil.
    fn watch(&mut self, live: &Player, limits: &[Limit], tick: usize) {
        let running = &live.run().plan;
        for (number, coil) in self.coils.iter().enumerate() {
            let drives = running.devices.iter().any(|device| device.key.fingerprint == number as u64);
            let given = if drives { coil.given() } else { 0.0 };
            for (window_s, mean) in self.windows_s.iter().zip(&mut self.means[number]) {
                let keep = (-1.0 / (window_s * RATE_HZ)).exp();
                let before = *mean;
                *mean = keep * before + (1.0 - keep) * given * given;
                let in_force = running.actuators.first().map(|actuator| actuator.limit);
                let Some(limit) = in_force.filter(|limit| drives && limit.window_s == *window_s) else {
                    continue;
                };
                assert!(limits.contains(&limit) && given.abs() <= limit.peak, "tick {tick}");
                let most = limit.continuous * limit.continuous;
                let allowed = keep * (before - most).max(0.0) + 1e-12 * most;
                assert!(*mean - most <= allowed, "tick {tick}: {limit:?}, {mean} of {most}");
                self.hot += usize::from(*mean > 0.9 * most);
                self.in_debt += usize::from(*mean > most);
            }
        }
    }
}

fn any_limit(random: &mut Xoshiro256PlusPlus, windows_s: &[f64]) -> Limit {
    let mut one_of = |choices: &[f64]| choices[random.random_range(0..choices.len())];
    Limit {
        peak: one_of(&[0.4, 0.5, 1.0]),
        continuous: one_of(&[0.02, 0.2, 0.25]),
        window_s: one_of(windows_s),
        slew_per_s: Some(one_of(&[50.0, 100.0, 1e9])),
    }
}

/// Limits change, plans fade into each other, endpoints go and come back, sinks and devices change their names.
#[test]
fn no_sequence_of_edits_lets_an_actuator_become_hotter_than_the_limit_in_force() {
    let windows_s = vec![0.01, 0.05, 0.3, 0.5];
    let (mut hot, mut in_debt, mut faded) = (0, 0, 0);
    for seed in 0..12 {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let coils = vec![Coil::default(), Coil::default()];
        let mut limit = any_limit(&mut random, &windows_s);
        let mut limits = vec![limit];
        let (mut coil, mut names) = (0, (0, 0));
        let (mut live, mut control) = player(plan(&driving(&coils, coil, names, limit, 1.0), 8));
        let mut judge = Judge {
            means: vec![vec![0.0; windows_s.len()]; coils.len()],
            coils: coils.clone(),
            windows_s: windows_s.clone(),
            hot: 0,
            in_debt: 0,
        };
        let mut tick = 0;
        for _ in 0..40 {
            for _ in 0..random.random_range(15..700) {
                live.process(1);
                judge.watch(&live, &limits, tick);
                tick += 1;
            }
            control.poll();
            let mut gone = false;
            match random.random_range(0..8) {
                0 => names.0 = random.random_range(0..3),
                1 => (coil, names.1) = (random.random_range(0..2), random.random_range(0..2)),
                2 => gone = true,
                3 => {}
                _ => limit = any_limit(&mut random, &windows_s),
            }
            limits.push(limit);
            let graph = match gone {
                true => driving_nothing(),
                false => driving(&coils, coil, names, limit, random.random_range(0.0..1.5)),
            };
            let change = control.swap(plan(&graph, 8)).unwrap();
            faded += usize::from(change == Change::CrossFade);
        }
        hot += judge.hot;
        in_debt += judge.in_debt;
    }
    assert!(hot > 20_000 && in_debt > 2000 && faded > 30, "{hot}, {in_debt}, {faded}");
}

/// An endpoint of a real device.
pub struct RealCoil;
impl DeviceKind for RealCoil {
    type Settings = NoSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "RealCoil",
        doc: "",
        source: "",
        simulated: false,
        senses: &[],
        drives: &[],
        example: "",
    };
    fn build(_: NoSettings, _: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        Err(BuildError::at("none", "built by hand"))
    }
}

/// The largest of what a run of half a second gives.
fn largest_given(real: bool, rested: bool) -> (f64, Vec<String>) {
    let coils = [Coil::default()];
    let limit = Limit { peak: 1.0, continuous: 0.25, window_s: 0.3, slew_per_s: None };
    let mut graph = driving(&coils, 0, (0, 0), limit, 0.8);
    if real {
        graph.devices[0].entry = DeviceEntry::of::<RealCoil>();
    }
    let options = SessionOptions { rested, ..SessionOptions::default() };
    let (mut live, session) = Session::open(FileSinks::new(&graph), &options).unwrap();
    let unrested = live.run().unrested().map(str::to_owned).collect();
    let mut largest = 0.0_f64;
    for _ in 0..500 {
        live.process(1);
        largest = largest.max(coils[0].given());
    }
    session.finish(live);
    (largest, unrested)
}

#[test]
fn a_real_actuator_begins_with_its_heat_spent_unless_it_is_known_to_be_cold() {
    let (largest, unrested) = largest_given(true, false);
    assert!(largest <= 0.25 && largest > 0.2499, "{largest}");
    assert_eq!(unrested, ["sink 0"]);
    for (real, rested) in [(true, true), (false, false), (false, true)] {
        assert_eq!(largest_given(real, rested), (0.8, Vec::new()));
    }
}

#[test]
fn a_replay_begins_as_warm_as_its_run_did() {
    let coils = [Coil::default()];
    let limit = Limit { peak: 1.0, continuous: 0.25, window_s: 0.3, slew_per_s: None };
    let mut graph = driving(&coils, 0, (0, 0), limit, 0.8);
    graph.devices[0].entry = DeviceEntry::of::<RealCoil>();
    for rested in [false, true] {
        let folder = std::env::temp_dir().join(format!("haptograph-heat-{}-{rested}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        let options = SessionOptions { rested, ..SessionOptions::default() };
        let (mut lives, session) =
            Session::open_all(FileSinks::new(&graph), &options, Some(&folder)).unwrap();
        lives[0].process(20);
        let given = coils[0].given();
        session.finish_all(lives);
        coils[0].clone().write(0, &[0.0]);
        let (sinks, log) = (FileSinks::new(&graph), (&*folder, &ReplayBounds::default()));
        Session::replay(sinks, log, &SessionOptions::default().block(64), &mut |_| {}).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(coils[0].given(), given);
        assert_eq!(given > 0.25, rested);
    }
}
