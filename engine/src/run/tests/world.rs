//! Random graphs of simple nodes over several clocks, with bridges, delays and a body in a loop.

use crate::bridges::{Average, BridgeEntry, Hold, Linear, least_ring_latency_s};
use crate::device::{Channel, Device, DeviceEntry, DeviceSpec};
use crate::diagnostic::{Sources, Span};
use crate::frame::{AnyKind, Kind};
use crate::graph::{Bridge, Clock, Edge, Graph, GraphDevice, Input, Node, Output, Work};
use crate::node::{
    BuildContext, BuildError, Built, Io, Limit, LiveId, NodeEntry, NodeKind, Of, Processor, SettingId, Tick,
};
use crate::settings::NoSettings;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::{Rate, TimeBase};
use petgraph::graph::{DiGraph, NodeIndex};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::any::Any;
use std::sync::Arc;

pub const HOLD: Bridge = Bridge::Between(BridgeEntry::of::<Hold>());
pub const LINEAR: Bridge = Bridge::Between(BridgeEntry::of::<Linear>());
pub const AVERAGE: Bridge = Bridge::Between(BridgeEntry::of::<Average>());

/// A leaky sum of its inputs, with its own tick number mixed in: it notices any frame too many, too few or late.
#[derive(Clone)]
pub struct Leaky {
    pub kept: f64,
    pub weight: f64,
    /// Reads runs where the input is held.
    pub held: Vec<bool>,
}

impl Leaky {
    pub fn next(&mut self, tick: u64, inputs: impl Iterator<Item = f64>) -> f64 {
        let sum: f64 = inputs.sum();
        self.kept = self.weight * self.kept + 0.3 * sum + (tick % 97) as f64;
        self.kept
    }
}

impl Processor<Nothing> for Leaky {
    fn set(&mut self, _: LiveId<LeakySettings>, weight: f64) {
        self.weight = weight;
    }

    fn set_item(&mut self, _: LiveId<LeakySettings>, item: usize, value: f64) {
        self.weight = value / (1.0 + item as f64);
    }

    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Nothing>) {
        let mut at: Vec<Vec<f64>> = Vec::new();
        for (input, held) in self.held.iter().enumerate() {
            let mut frames = vec![f64::NAN; tick.frames];
            if *held {
                for (range, lanes) in io.ports.runs::<AnyKind>(input) {
                    frames[range].fill(lanes[0]);
                }
            } else {
                frames.copy_from_slice(io.ports.components(input));
            }
            at.push(frames);
        }
        for (j, out) in io.ports.out(0).iter_mut().enumerate() {
            *out = self.next(tick.first + j as u64, at.iter().map(|frames| frames[j]));
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.kept = self.kept;
    }
}

/// The work of a node that runs this processor.
pub fn process(processor: impl Processor<Nothing>) -> Work {
    Work::Process(Built::new(processor).into_processor())
}

/// The processor of this work, if it is a leaky one.
pub fn as_leaky(work: &mut Work) -> Option<&mut Leaky> {
    let Work::Process(processor) = work else {
        return None;
    };
    let leaky = (&mut **processor as &mut dyn Any).downcast_mut::<Of<Nothing, Leaky>>();
    leaky.map(|of| &mut of.processor)
}

/// A body that sums what drives it.
#[derive(Clone)]
pub struct Body {
    pub position: f64,
    pub drive: f64,
}

impl Device for Body {
    fn advance(&mut self) {
        self.position = 0.9 * self.position + self.drive + 1.0;
    }
    fn read(&mut self, _: usize, frame: &mut [f64]) {
        frame[0] = self.position;
    }
    fn write(&mut self, _: usize, frame: &[f64]) {
        self.drive = frame[0];
    }
}

crate::settings! {
    /// Settings of a leaky node or sink.
    pub struct LeakySettings {
        /// A sink's gain, or what a leaky node keeps.
        [live] gain: f64 = 1.0;
    }
}

crate::node! {
    /// The kind of all nodes of these graphs.
    pub struct Nothing as "Leaky"(LeakySettings) in "test";
    example: "";
}

impl NodeKind for Nothing {
    fn build(_: LeakySettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Err(BuildError::at("none", "built by hand"))
    }
}

struct NoBody;
impl crate::device::DeviceKind for NoBody {
    type Settings = NoSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "Body",
        doc: "",
        source: "",
        simulated: true,
        senses: &[Channel::new("x", Kind::SCALAR, Quantity::NUMBER, "")],
        drives: &[Channel::new("x", Kind::SCALAR, Quantity::NUMBER, "")],
        example: "",
    };
    fn build(_: NoSettings, _: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        Err(BuildError::at("none", "built by hand"))
    }
}

pub const LIMIT: Limit = Limit { peak: 50.0, continuous: 50.0, window_s: 1.0, slew_per_s: None };

struct World {
    random: Xoshiro256PlusPlus,
    rates: Vec<Rate>,
    /// Of each clock.
    drivers: Vec<usize>,
    base: TimeBase,
    /// Told apart in swaps by this.
    fingerprint: u64,
    nodes: Vec<Node>,
    edges: Vec<(usize, usize, Edge)>,
}

/// A graph from `seed`, its nodes added in an order from `shuffle`.
pub fn random_graph(seed: u64, shuffle: u64) -> Graph {
    let (world, device_clock) = random_world(seed, 1);
    let order = world.order(shuffle);
    world.finish(&order, device_clock)
}

/// A graph whose clocks hang from up to three drivers, in an order from the seed.
pub fn random_graph_with_drivers(seed: u64) -> Graph {
    let (world, device_clock) = random_world(seed, 3);
    let order = world.order(seed);
    world.finish(&order, device_clock)
}

/// The same with a node more, ahead of all others: on a clock of this driver, from nowhere to nowhere.
pub fn with_a_node_more(seed: u64, driver: usize) -> Graph {
    let (mut world, device_clock) = random_world(seed, 3);
    let mut order = world.order(seed);
    let work = process(Leaky { kept: 0.0, weight: 0.7, held: Vec::new() });
    order.insert(0, world.node(driver, work));
    world.finish(&order, device_clock)
}

/// The same with two nodes more, in another order: from any other node a ring leads to the first, from there one to the
/// second, if there are drivers for that.
pub fn with_rings_more(seed: u64) -> Option<Graph> {
    let (mut world, device_clock) = random_world(seed, 3);
    let mut from = 0;
    for _ in 0..2 {
        let own = world.drivers[world.nodes[from].clock?];
        let used = |driver: usize| {
            let mut clocks = world.nodes.iter().filter_map(|node| node.clock);
            clocks.any(|clock| world.drivers[clock] == driver)
        };
        let to = (0..world.rates.len()).find(|clock| {
            let driver = world.drivers[*clock];
            driver != own && used(driver)
        })?;
        let work = process(Leaky { kept: 0.0, weight: 0.7, held: Vec::new() });
        let node = world.node(to, work);
        let ring = world.ring(world.nodes[from].clock?, to);
        world.connect(from, node, ring, false);
        from = node;
    }
    let order = world.order(seed + 1);
    Some(world.finish(&order, device_clock))
}

fn random_world(seed: u64, most_drivers: usize) -> (World, Option<usize>) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut rates: Vec<Rate> = vec![Rate::from_hz(1000).unwrap()];
    let choices = [(1000, 3), (240, 1), (125, 1), (10_000, 1), (1000, 1), (48, 1), (2500, 7), (441, 1)];
    for _ in 0..random.random_range(0..4) {
        let (n, d) = *choices.choose(&mut random).unwrap();
        rates.push(Rate::new(n, d).unwrap());
    }
    let base = TimeBase::new(&rates).unwrap();
    let mut drivers: Vec<usize> = Vec::new();
    for clock in 0..rates.len() {
        // A driver, while there may be more of them, or a clock of any of those before.
        let known = (0..clock).filter(|known| drivers[*known] == *known).count();
        drivers.push(match clock {
            0 => 0,
            _ if most_drivers == 1 => 0,
            _ if known < most_drivers && random.random_bool(0.6) => clock,
            _ => drivers[random.random_range(0..clock)],
        });
    }
    let mut world =
        World { fingerprint: seed, drivers, random, rates, base, nodes: Vec::new(), edges: Vec::new() };
    for _ in 0..world.random.random_range(2..14) {
        world.leaky();
    }
    let device_clock = world.loops();
    (world, device_clock)
}

impl World {
    fn at_1_khz() -> Self {
        let rates = vec![Rate::from_hz(1000).unwrap()];
        Self {
            random: Xoshiro256PlusPlus::seed_from_u64(0),
            drivers: vec![0],
            base: TimeBase::new(&rates).unwrap(),
            rates,
            fingerprint: 0,
            nodes: Vec::new(),
            edges: Vec::new(),
        }
    }

    fn node(&mut self, clock: usize, work: Work) -> usize {
        let output = Output { name: "out".into(), kind: Kind::SCALAR, quantity: Quantity::NUMBER };
        self.nodes.push(Node {
            // Not alphabetical in the order of creation.
            path: format!("n{:02}", (self.nodes.len() * 37) % 100),
            entry: NodeEntry::processor::<Nothing>(),
            clock: Some(clock),
            inputs: Vec::new(),
            outputs: vec![output],
            work,
            span: Span::default(),
            simulated: false,
            fingerprint: self.fingerprint,
            live: Vec::new(),
            given: Arc::default(),
            files: Vec::new(),
        });
        self.nodes.len() - 1
    }

    fn connect(&mut self, from: usize, to: usize, bridge: Bridge, held: bool) {
        let input = self.nodes[to].inputs.len();
        self.edges.push((from, to, Edge { output: 0, input, bridge, span: Span::default() }));
        let quantity = Quantity::NUMBER;
        self.nodes[to].inputs.push(Input {
            name: "in",
            label: None,
            kind: Kind::SCALAR,
            quantity,
            connected: true,
            held,
        });
        if let Work::Process(_) = self.nodes[to].work {
            let held = self.nodes[to].inputs.iter().map(|input| input.held).collect();
            self.nodes[to].work = process(Leaky { kept: 0.0, weight: 0.7, held });
        }
    }

    fn leaky(&mut self) {
        let clock = self.random.random_range(0..self.rates.len());
        let earlier = self.nodes.len();
        let work = process(Leaky { kept: 0.0, weight: 0.7, held: Vec::new() });
        let node = self.node(clock, work);
        for _ in 0..self.random.random_range(0..4) {
            if earlier > 0 {
                let from = self.random.random_range(0..earlier);
                let bridge = self.any_bridge(from, clock);
                let held = [HOLD, Bridge::Direct].contains(&bridge) && self.random.random_bool(0.5);
                self.connect(from, node, bridge, held);
            }
        }
    }

    fn any_bridge(&mut self, from: usize, clock: usize) -> Bridge {
        let from_clock = self.nodes[from].clock.unwrap();
        if self.drivers[from_clock] != self.drivers[clock] {
            return self.ring(from_clock, clock);
        }
        let (slow, fast) = (self.base.period(from_clock), self.base.period(clock));
        if from_clock == clock {
            let frames = self.random.random_range(1..200);
            let delay = Bridge::Delay { frames, initial: Some(0.5) };
            return *[Bridge::Direct, Bridge::Direct, delay].choose(&mut self.random).unwrap();
        }
        let other = if slow > fast { LINEAR } else { AVERAGE };
        *[HOLD, other].choose(&mut self.random).unwrap()
    }

    fn ring(&mut self, from: usize, to: usize) -> Bridge {
        let least_s = least_ring_latency_s(self.rates[from], self.rates[to]).unwrap();
        let latency_s = least_s + self.random.random_range(0.002..0.02);
        Bridge::Ring { latency_s }
    }

    /// Feedback by delay between nodes of one clock, and sometimes a body driven by what it causes.
    fn loops(&mut self) -> Option<usize> {
        let count = self.nodes.len();
        for _ in 0..self.random.random_range(0..3) {
            let (from, to) = (self.random.random_range(0..count), self.random.random_range(0..count));
            let (a, b) = (self.nodes[from].clock.unwrap(), self.nodes[to].clock.unwrap());
            if self.drivers[a] != self.drivers[b] {
                let bridge = self.ring(a, b);
                self.connect(from, to, bridge, false);
            } else if a == b {
                let frames = self.random.random_range(1..40);
                self.connect(from, to, Bridge::Delay { frames, initial: Some(0.25) }, false);
            }
        }
        if self.random.random_bool(0.4) {
            return None;
        }
        let (from, to) = (self.random.random_range(0..count), self.random.random_range(0..count));
        let (low, high) = (from.min(to), from.max(to));
        let clock = self.nodes[low].clock.unwrap();
        let source = self.node(clock, Work::Source { device: 0, channels: vec![0] });
        self.connect(source, low, Bridge::Direct, false);
        let sink = self.node(clock, Work::Actuator { device: 0, channel: 0, gain: 0.1, limit: LIMIT });
        let bridge = match self.nodes[high].clock.unwrap() {
            same if same == clock => Bridge::Direct,
            other if self.drivers[other] != self.drivers[clock] => self.ring(other, clock),
            _ => HOLD,
        };
        self.connect(high, sink, bridge, false);
        Some(clock)
    }

    fn order(&self, shuffle: u64) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.nodes.len()).collect();
        order.shuffle(&mut Xoshiro256PlusPlus::seed_from_u64(shuffle));
        order
    }

    fn finish(self, order: &[usize], device_clock: Option<usize>) -> Graph {
        let mut nodes = DiGraph::new();
        let mut placed = vec![NodeIndex::new(0); order.len()];
        let mut taken: Vec<Option<Node>> = self.nodes.into_iter().map(Some).collect();
        for old in order {
            placed[*old] = nodes.add_node(taken[*old].take().unwrap());
        }
        for (from, to, edge) in self.edges {
            nodes.add_edge(placed[from], placed[to], edge);
        }
        let devices = device_clock.map(|clock| GraphDevice {
            senses: Vec::new(),
            name: "body".into(),
            entry: DeviceEntry::of::<NoBody>(),
            clock,
            settings: Arc::new(()),
            device: Box::new(Body { position: 0.0, drive: 0.0 }),
            span: Span::default(),
            fingerprint: self.fingerprint,
        });
        let clock =
            |(i, rate): (usize, &Rate)| Clock { name: format!("c{i}"), rate: *rate, driver: self.drivers[i] };
        Graph {
            about: String::new(),
            seed: 0,
            clocks: self.rates.iter().enumerate().map(clock).collect(),
            base: self.base,
            nodes,
            devices: devices.into_iter().collect(),
            sources: Sources::default(),
            warnings: Vec::new(),
            template_outputs: Vec::new(),
        }
    }
}

/// A processor without inputs, at 1 kHz, driving a body with a gain of a tenth: the graph, the node and the sink.
pub fn with_processor(processor: impl Processor<Nothing>) -> (Graph, NodeIndex, NodeIndex) {
    let mut world = World::at_1_khz();
    let node = world.node(0, process(processor));
    let sink = world.node(0, Work::Actuator { device: 0, channel: 0, gain: 0.1, limit: LIMIT });
    world.nodes[sink].live.push((SettingId::at(0), 0.1));
    let input = Input {
        name: "in",
        label: None,
        kind: Kind::SCALAR,
        quantity: Quantity::NUMBER,
        connected: true,
        held: false,
    };
    world.nodes[sink].inputs.push(input);
    world.edges.push((
        node,
        sink,
        Edge { output: 0, input: 0, bridge: Bridge::Direct, span: Span::default() },
    ));
    let paths: Vec<String> = world.nodes.iter().map(|node| node.path.clone()).collect();
    let order = world.order(0);
    let graph = world.finish(&order, Some(0));
    let find = |path: &String| graph.nodes.node_indices().find(|i| graph.nodes[*i].path == *path).unwrap();
    let (node, sink) = (find(&paths[node]), find(&paths[sink]));
    (graph, node, sink)
}

/// A processor without inputs, at 1 kHz, that so many others read, each through a delay of `frames`.
pub fn with_delays(processor: impl Processor<Nothing>, readers: usize, frames: u64) -> Graph {
    let mut world = World::at_1_khz();
    let node = world.node(0, process(processor));
    for _ in 0..readers {
        let (kept, weight, held) = (0.0, 0.5, Vec::new());
        let reader = world.node(0, process(Leaky { kept, weight, held }));
        world.connect(node, reader, Bridge::Delay { frames, initial: None }, false);
    }
    let order: Vec<usize> = (0..world.nodes.len()).collect();
    world.finish(&order, None)
}

/// What drives an actuator in [`with_drives`].
pub struct TestDrive {
    pub work: Work,
    pub fingerprint: u64,
    /// The driver: 0 of 1000 Hz, 1 of 2000 Hz.
    pub driver: usize,
    pub sink: String,
    pub limit: Limit,
    pub endpoint: String,
    pub device: Box<dyn Device>,
    pub device_fingerprint: u64,
}

/// Two drivers, each with a node that drives nothing; and these drives, with a gain of a tenth that is a live setting.
pub fn with_drives(drives: Vec<TestDrive>) -> Graph {
    let rates = vec![Rate::from_hz(1000).unwrap(), Rate::from_hz(2000).unwrap()];
    let base = TimeBase::new(&rates).unwrap();
    let mut world = World {
        random: Xoshiro256PlusPlus::seed_from_u64(0),
        rates,
        drivers: vec![0, 1],
        base,
        fingerprint: 0,
        nodes: Vec::new(),
        edges: Vec::new(),
    };
    let mut devices = Vec::new();
    for driver in 0..2 {
        let (kept, weight, held) = (0.0, 0.5, Vec::new());
        world.node(driver, process(Leaky { kept, weight, held }));
    }
    for drive in drives {
        let node = world.node(drive.driver, drive.work);
        world.nodes[node].path = format!("asks of {}", drive.sink);
        world.nodes[node].fingerprint = drive.fingerprint;
        let (device, channel, gain, limit) = (devices.len(), 0, 0.1, drive.limit);
        let sink = world.node(drive.driver, Work::Actuator { device, channel, gain, limit });
        world.nodes[sink].path = drive.sink;
        world.nodes[sink].live.push((SettingId::at(0), gain));
        world.connect(node, sink, Bridge::Direct, false);
        devices.push(GraphDevice {
            senses: Vec::new(),
            name: drive.endpoint,
            entry: DeviceEntry::of::<NoBody>(),
            clock: drive.driver,
            device: drive.device,
            settings: Arc::new(()),
            span: Span::default(),
            fingerprint: drive.device_fingerprint,
        });
    }
    let order: Vec<usize> = (0..world.nodes.len()).collect();
    let mut graph = world.finish(&order, None);
    graph.devices = devices;
    graph
}
