//! The plan of a graph: a flat list of steps over a few reused buffers, every input and output resolved to its place in
//! memory.
//!
//! A plan has the initial state; [`Run`](crate::run::Run) clones it. Time is divided into windows of whole driver
//! frames, and every clock runs the ticks of the window, so that samples do not depend on the block size. Loops
//! closed by a delay or a device are **islands**: their steps run in sub-windows that begin at the loop's own ticks.

mod build;
mod order;
mod planner;
mod resolve;
mod show;
mod slots;

use crate::bridges::BridgeEntry;
use crate::device::{Channel, Device};
use crate::frame::Kind;
use crate::graph::Graph;
pub(crate) use crate::graph::fingerprint::{
    VERSION as FINGERPRINTS_VERSION, VERSION_NAME as FINGERPRINTS_NAME,
};
use crate::io::{Extent, Placing, Wires};
use crate::limiter::ClipCounts;
pub use crate::node::MAX_BLOCK;
use crate::node::{AnyProcessor, Limit, Stream};
use crate::node_id::NodeId;
use crate::settings::LiveSetting;
use crate::silence::LiveInput;
use haptograph_signal::laws::LawStep;
use haptograph_signal::time::{Rate, TimeBase};
use petgraph::graph::EdgeIndex;
pub use planner::Planner;
pub(crate) use resolve::without_ports;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

/// Options of planning: `PlanOptions::default().block(64).tap(node, 0)`.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct PlanOptions {
    /// Block length in driver frames, clamped to 1 ..= [`MAX_BLOCK`]; 0 means 64.
    pub block: usize,
    /// Outputs whose frames are read after every block.
    pub taps: Vec<(NodeId, usize)>,
}

impl PlanOptions {
    /// Sets the block length in driver frames.
    #[must_use]
    pub fn block(mut self, frames: usize) -> Self {
        self.block = frames;
        self
    }

    /// Adds an output whose frames are read after every block: a node and the index of one of its outputs.
    #[must_use]
    pub fn tap(mut self, node: NodeId, output: usize) -> Self {
        self.taps.push((node, output));
        self
    }

    /// Adds several outputs whose frames are read after every block.
    #[must_use]
    pub fn taps(mut self, taps: impl IntoIterator<Item = (NodeId, usize)>) -> Self {
        self.taps.extend(taps);
        self
    }
}

/// The execution plan of a graph, or of one driver of a graph with several.
///
/// ```
/// use haptograph_engine::document::Document;
/// use haptograph_engine::graph::{CheckOptions, check};
/// use haptograph_engine::plan::{Plan, PlanOptions};
/// use haptograph_engine::registry::Registry;
/// use haptograph_engine::run::Run;
/// use std::sync::Arc;
/// # use haptograph_engine::frame::Scalar;
/// # use haptograph_engine::node::*;
/// # use haptograph_signal::quantity::Quantity;
/// # haptograph_engine::settings! { /** Settings of the example. */ pub struct LevelSettings { /** What it gives. */ [live] value: f64 = 1.0; } }
/// # haptograph_engine::node! {
/// #     /// Gives a number.
/// #     struct Level(LevelSettings) in "mine";
/// #     example: "";
/// #     out OUTPUT: Scalar = Port::of(Quantity::NUMBER, "The number.");
/// # }
/// # #[derive(Clone)] struct Given(f64);
/// # impl NodeKind for Level {
/// #     fn build(settings: LevelSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { Ok(Built::new(Given(settings.value))) }
/// # }
/// # impl Processor<Level> for Given {
/// #     fn process(&mut self, _: &Tick, io: &mut Io<'_, Level>) { io.write(Level::OUTPUT).fill(self.0); }
/// #     fn set(&mut self, _: LiveId<LevelSettings>, value: f64) { self.0 = value; }
/// # }
/// # let mut registry = Registry::new();
/// # registry.add(NodeEntry::processor::<Level>());
/// # let text = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) }, nodes: { "level": Level(clock: "servo", value: 0.5) })"#;
/// # let graph = check(&Document::parse("level.ron", text)?, &registry, &CheckOptions::default())?;
///
/// let (node, output) = graph.find_output("level.output").expect("the node has it");
/// let options = PlanOptions::default().block(16).tap(node, output);
/// let mut plans = Plan::of(&graph, &options); // One for each driver.
/// let mut run = Run::new(Arc::new(plans.remove(0)));
/// run.advance(3);
/// assert_eq!(run.tap(0), [0.5; 3]);
/// # Ok::<(), haptograph_engine::diagnostic::Diagnostics>(())
/// ```
pub struct Plan {
    pub(crate) block: usize,
    /// Index of the driver's clock.
    pub(crate) driver: usize,
    pub(crate) base: TimeBase,
    pub(crate) rates: Vec<Rate>,
    /// Period of each clock, s.
    pub(crate) periods_s: Vec<f64>,
    pub(crate) clock_names: Vec<String>,
    pub(crate) steps: Vec<Step>,
    /// The buffers, one behind the other from the beginning of the memory.
    pub(crate) slots: Vec<Extent>,
    pub(crate) pacings: Vec<u64>,
    pub(crate) processors: Vec<Box<dyn AnyProcessor>>,
    /// One for each processor, valid if its step has `singles`. A run updates the laws of its own copy when settings change.
    pub(crate) laws: Vec<LawStep>,
    /// The chains of factors and offsets among them, by their first processors.
    pub(crate) chains: Vec<Range<usize>>,
    /// Key of each processor, to match it with another plan.
    pub(crate) processor_keys: Vec<NodeKey>,
    pub(crate) devices: Vec<DevicePlan>,
    pub(crate) actuators: Vec<ActuatorPlan>,
    /// Published output of each actuator.
    pub(crate) delivered: Arc<[Delivered]>,
    /// Time of each step, in the blocks that were timed.
    pub(crate) times: Arc<[StepTime]>,
    pub(crate) bridges: Vec<BridgePlan>,
    pub(crate) delays: Vec<DelayPlan>,
    pub(crate) taps: Vec<Tap>,
    /// Index of each tap in the requested taps; the others belong to other drivers.
    pub(crate) tap_places: Vec<usize>,
    /// Rings to other drivers.
    pub(crate) ring_writes: Vec<RingPlan>,
    /// Rings from other drivers.
    pub(crate) ring_reads: Vec<RingPlan>,
    /// The live settings.
    pub(crate) live: Vec<LiveSetting>,
    /// Works of the node of each live setting.
    pub(crate) live_works: Vec<Box<[StepWork]>>,
    /// Driver frames after which the first source of the graph that ends the run has no more data.
    pub(crate) data_frames: Option<u64>,
}

/// A step of the plan.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Step {
    pub work: StepWork,
    /// Clock whose ticks it runs at.
    pub clock: u32,
    /// Number of successive processors of this clock from here on; they share one lookup of the window.
    pub streak: u32,
    /// Number of them, from this one on, that compute single frames of a scalar without ports.
    pub singles: u32,
    /// Number of them, from this one on, that compute blocks by their laws.
    pub lawful: u32,
    /// Number of them, from this one on, that filter a scalar by a cascade, each the output of the one before.
    pub cascades: u32,
    /// True if only the next step reads its output.
    pub is_inner: bool,
    pub wires: Wires,
    /// The node it belongs to.
    pub node: NodeId,
    /// Label for display: `speed`, `hold stylus.force`. A processor's is the path of its node.
    pub label: Arc<str>,
}

impl Step {
    /// True if the processor computes this many frames without ports, by itself or with those behind it.
    pub(crate) fn runs_without_ports(&self, frames: usize) -> bool {
        if frames == 1 { self.singles > 0 } else { self.lawful > 0 || self.is_cascade(frames) }
    }

    /// True if it filters this many frames together with those behind it: fewer filters, or frames, run faster one by one.
    pub(crate) fn is_cascade(&self, frames: usize) -> bool {
        self.cascades >= 4 && frames >= 32
    }

    /// True if the steps are equal except for the node's number.
    fn is_same_as(&self, other: &Self) -> bool {
        let node = other.node;
        Self { node, ..self.clone() } == *other
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StepWork {
    /// Runs a processor.
    Process(u32),
    /// Runs an actuator sink.
    Actuator(u32),
    /// Advances a device and fills its sources.
    DeviceRead(u32),
    /// Writes the outputs of a device's sinks to the device.
    DeviceWrite(u32),
    /// Runs a bridge, or a delay outside of any loop.
    Bridge(u32),
    /// Reads the delay of a loop.
    DelayRead(u32),
    /// Writes the delay of a loop.
    DelayWrite(u32),
    /// Reads a ring from another driver.
    RingRead(u32),
    /// Writes a ring to another driver.
    RingWrite(u32),
    /// Runs the next `steps` steps in windows that end at multiples of the pacings.
    Island { steps: u32, first_pacing: u32, pacings: u32 },
}

/// Identity of a node across plans.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct NodeKey {
    pub path: Arc<str>,
    pub kind: &'static str,
    /// Hash of its settings, rate and connected kinds.
    pub fingerprint: u64,
}

/// A device in a plan. `DeviceRead` advances a device with sources, `DeviceWrite` any other.
pub(crate) struct DevicePlan {
    pub name: String,
    pub key: NodeKey,
    /// The clock it ticks on.
    pub clock: usize,
    /// Channels that nodes can read; a channel's index is its number.
    pub senses: Vec<Channel>,
    pub device: Box<dyn Device>,
    /// Live input of a device that can fall silent; shared by the plans of all drivers.
    pub input: Option<LiveInput>,
    /// (actuator, channel, clock) of its sinks.
    pub driven_by: Vec<(usize, usize, u32)>,
    /// Places in memory of its sources and sinks, and their channels.
    pub reads: Vec<(Placing, usize)>,
    pub writes: Vec<(Placing, usize)>,
}

/// An actuator sink in a plan.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ActuatorPlan {
    pub path: String,
    pub gain: f64,
    pub limit: Limit,
    pub width: usize,
    pub rate: Rate,
    /// True if its device is simulated.
    pub simulated: bool,
    /// Unit of its output.
    pub unit: String,
    /// The live inputs that it depends on: (device, whether the actuator belongs to that device).
    pub silenced_by: Vec<(usize, bool)>,
}

impl ActuatorPlan {
    /// True if every live input that it depends on delivers data or is held.
    pub(crate) fn is_let_through(&self, input: impl Fn(usize) -> Option<LiveInput>) -> bool {
        let mut inputs = self.silenced_by.iter().map(|(device, own)| (input(*device), *own));
        inputs.all(|(input, own)| input.is_none_or(|input| input.lets_through(own)))
    }

    /// True if the actuators are equal except for the gain, which is a live setting.
    fn is_same_as(&self, other: &Self) -> bool {
        let gain = other.gain;
        Self { gain, ..self.clone() } == *other
    }
}

/// Published output of an actuator: the driver writes it, any thread reads it.
#[derive(Debug, Default)]
pub(crate) struct Delivered {
    largest: AtomicU64,
    at_zero: AtomicBool,
    level: AtomicU64,
    peak: AtomicU64,
    heat: AtomicU64,
    /// Number of all ticks, and of those that the peak, the heat, the slew and a fault limited.
    clipped: [AtomicU64; 5],
}

impl Delivered {
    /// Writes the number of ticks in which each limit acted since the run began.
    pub(crate) fn put_clipped(&self, counts: ClipCounts) {
        let ClipCounts { ticks, peak, continuous, slew, fault } = counts;
        let counts = [ticks, peak, continuous, slew, fault];
        for (to, count) in self.clipped.iter().zip(counts) {
            to.store(count, Relaxed);
        }
    }

    /// The counts that were written last.
    pub(crate) fn clipped(&self) -> ClipCounts {
        let [ticks, peak, continuous, slew, fault] = self.clipped.each_ref().map(|count| count.load(Relaxed));
        ClipCounts { ticks, peak, continuous, slew, fault }
    }

    /// Writes the largest magnitude over the axes, and whether a silent input keeps it at zero.
    pub(crate) fn put(&self, largest: f64, at_zero: bool) {
        self.largest.store(largest.to_bits(), Relaxed);
        self.at_zero.store(at_zero, Relaxed);
    }

    /// Reads the largest magnitude and whether it is kept at zero.
    pub(crate) fn get(&self) -> (f64, bool) {
        let largest = f64::from_bits(self.largest.load(Relaxed));
        (largest, self.at_zero.load(Relaxed))
    }

    /// Writes the present level, the largest magnitude since the last write, and the used part of the continuous limit.
    pub(crate) fn put_level(&self, level: f64, peak: f64, heat: f64) {
        self.level.store(level.to_bits(), Relaxed);
        self.heat.store(heat.to_bits(), Relaxed);
        // Non-negative numbers have the order of their bits.
        self.peak.fetch_max(peak.to_bits(), Relaxed);
    }

    /// Reads the present level, the largest magnitude since the last call, and the used part of the continuous limit.
    pub(crate) fn take_level(&self) -> (f64, f64, f64) {
        let level = f64::from_bits(self.level.load(Relaxed));
        (level, f64::from_bits(self.peak.swap(0, Relaxed)), f64::from_bits(self.heat.load(Relaxed)))
    }
}

/// Time of a step in the blocks that were timed. The driver writes it; any thread may read it.
#[derive(Debug, Default)]
pub(crate) struct StepTime {
    ns: AtomicU64,
    looks: AtomicU64,
}

impl StepTime {
    /// Adds the time between two clock reads, ns.
    pub(crate) fn add(&self, ns: u64) {
        self.ns.store(self.ns.load(Relaxed).wrapping_add(ns), Relaxed);
        self.looks.store(self.looks.load(Relaxed).wrapping_add(1), Relaxed);
    }

    /// Returns the sum, ns, and the number of samples.
    pub(crate) fn get(&self) -> (u64, u64) {
        (self.ns.load(Relaxed), self.looks.load(Relaxed))
    }
}

/// A bridge in a plan; the reader's clock is that of its step.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BridgePlan {
    pub work: BridgeWork,
    /// Clock of the writer.
    pub from: u32,
    /// Kind of the frames.
    pub kind: Kind,
    /// Largest number of the writer's frames in a block.
    pub max_from: usize,
    /// Largest number of the reader's frames in a block.
    pub max_to: usize,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum BridgeWork {
    /// From frames to frames.
    Frames(BridgeEntry),
    /// From frames to runs of held ones.
    Runs,
    /// Index among the delays.
    Delay(u32),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DelayPlan {
    pub frames: u64,
    /// Value of every component until the first frame arrives; `None` for the neutral frame.
    pub initial: Option<f64>,
    pub kind: Kind,
}

/// Specification of a ring.
#[derive(Debug, Clone, PartialEq)]
pub struct RingSpec {
    /// Name for display: `force.output to drive.current`.
    pub name: String,
    /// Kind of the frames.
    pub kind: Kind,
    /// Rate of the writer.
    pub from: Rate,
    /// Rate of the reader.
    pub to: Rate,
    /// Target of the delay, s.
    pub latency_s: f64,
    /// Largest number of frames read at once.
    pub max_to: usize,
}

/// An end of a connection between two drivers.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RingPlan {
    /// The connection, the same at both ends.
    pub edge: EdgeIndex,
    pub ring: RingSpec,
}

/// Place of a tapped output's frames.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tap {
    pub place: Placing,
    pub clock: u32,
    pub stream: Stream,
}

impl Plan {
    /// Plans a graph: at least one plan, one for each driver in the order of [`Graph::drivers`].
    pub fn of(graph: &Graph, options: &PlanOptions) -> Vec<Self> {
        let drivers = graph.drivers().into_iter();
        drivers.map(|driver| build::build(graph, driver, options)).collect()
    }

    /// Name of the driver.
    pub fn driver_name(&self) -> &str {
        &self.clock_names[self.driver]
    }

    /// Block length in driver frames.
    pub fn block(&self) -> usize {
        self.block
    }

    /// Rate of the driver.
    pub fn driver_rate(&self) -> Rate {
        self.rates[self.driver]
    }

    /// True if both plans are of the same graph except for live settings. Nodes and connections may have other numbers,
    /// because those of other drivers can change.
    pub(crate) fn is_same_as(&self, other: &Self) -> bool {
        let rings = |plans: &[RingPlan], others: &[RingPlan]| {
            plans.len() == others.len() && plans.iter().zip(others).all(|(a, b)| a.ring == b.ring)
        };
        let mut steps = self.steps.iter().zip(&other.steps);
        let mut settings = self.live.iter().zip(&other.live);
        let device_keys =
            |plan: &Self| plan.devices.iter().map(|device| device.key.clone()).collect::<Vec<_>>();
        self.block == other.block
            && self.driver == other.driver
            && self.rates == other.rates
            && self.steps.len() == other.steps.len()
            && steps.all(|(a, b)| a.is_same_as(b))
            && self.live.len() == other.live.len()
            && settings.all(|(a, b)| a.is_same_as(b))
            && self.pacings == other.pacings
            && self.bridges == other.bridges
            && self.delays == other.delays
            && rings(&self.ring_writes, &other.ring_writes)
            && rings(&self.ring_reads, &other.ring_reads)
            && self.processor_keys == other.processor_keys
            && self.actuators.len() == other.actuators.len()
            && self.actuators.iter().zip(&other.actuators).all(|(a, b)| a.is_same_as(b))
            && self.taps == other.taps
            && device_keys(self) == device_keys(other)
    }

    /// Shares the live inputs of devices that continue.
    pub(crate) fn keep_inputs(&mut self, running: &Self) {
        for device in &mut self.devices {
            let known = running.devices.iter().find(|known| known.key == device.key);
            if let Some(input) = known.and_then(|known| known.input.clone()) {
                device.input = Some(input);
            }
        }
    }

    /// Names of the devices that its nodes read or drive. `devices` lists those of all drivers.
    pub(crate) fn used_devices(&self) -> impl Iterator<Item = &str> {
        self.devices.iter().filter(|device| device.is_used()).map(|device| &*device.name)
    }

    /// Name of a device that this plan drives and `other` does not.
    pub(crate) fn drives_beyond(&self, other: &Self) -> Option<&str> {
        let driven = |plan: &Self, key: &NodeKey| {
            let mut devices = plan.devices.iter();
            devices.any(|device| device.key == *key && !device.driven_by.is_empty())
        };
        let mut own = self.devices.iter().filter(|device| driven(self, &device.key));
        own.find(|device| !driven(other, &device.key)).map(|device| &*device.name)
    }

    /// Length of all buffers in f64.
    pub(crate) fn memory_len(&self) -> usize {
        self.slots.last().map_or(0, |last| last.end() as usize)
    }

    /// Number of the buffer that has this place of the memory.
    fn slot_at(&self, place: u32) -> usize {
        self.slots.partition_point(|slot| slot.end() <= place)
    }

    /// Number of steps.
    pub(crate) fn step_count(&self) -> usize {
        self.steps.len()
    }

    /// Bytes of all signal buffers.
    pub fn buffer_bytes(&self) -> usize {
        self.memory_len() * size_of::<f64>()
    }

    /// Description of each tap's signal, in the order of the taps.
    pub fn tap_streams(&self) -> impl Iterator<Item = &Stream> {
        self.taps.iter().map(|tap| &tap.stream)
    }
}
