//! The plan of a graph: a flat list of steps over a few reused buffers, with no name left to look up.
//!
//! A plan is pure data and pristine state; [`Run`](crate::run::Run) clones what moves. Time is cut into windows of
//! whole driver frames; every clock fires the ticks that fall into the window, so that samples do not depend on how
//! it is cut. Loops closed by a delay or a device are **islands**: their steps run in sub-windows that begin at the
//! loop's own ticks.

mod build;
mod order;
mod show;
mod slots;

use crate::device::Device;
use crate::graph::{Graph, LiveSetting, NodeId};
use crate::io::{Binding, Placing};
use crate::limiter::ClipCounts;
use crate::node::{Limit, Processor, Stream};
use crate::silence::LiveInput;
use haptograph_signal::time::{Rate, TimeBase};
use petgraph::graph::EdgeIndex;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

/// The longest block, in driver frames.
pub const MAX_BLOCK: usize = 1024;

/// How a graph is planned.
#[derive(Debug, Clone, Default)]
pub struct PlanOptions {
    /// Driver frames of a block, cut to 1 ..= [`MAX_BLOCK`]; 0 stands for 64.
    pub block: usize,
    /// Outputs whose frames are wanted after every block.
    pub taps: Vec<(NodeId, usize)>,
}

/// A graph laid out to run, or of a graph with several drivers what hangs from one of them.
pub struct Plan {
    pub(crate) block: usize,
    /// The clock whose frames a block counts.
    pub(crate) driver: usize,
    pub(crate) base: TimeBase,
    pub(crate) rates: Vec<Rate>,
    pub(crate) clock_names: Vec<String>,
    pub(crate) steps: Vec<Step>,
    pub(crate) bindings: Vec<Binding>,
    pub(crate) placings: Vec<Placing>,
    /// f64s of each buffer.
    pub(crate) slots: Vec<usize>,
    pub(crate) pacings: Vec<u64>,
    pub(crate) processors: Vec<Box<dyn Processor>>,
    /// What each processor is, to find it again in another plan.
    pub(crate) processor_keys: Vec<NodeKey>,
    pub(crate) devices: Vec<DevicePlan>,
    pub(crate) actuators: Vec<ActuatorPlan>,
    /// What each actuator is given while the plan runs, for whoever asks.
    pub(crate) delivered: Arc<[Delivered]>,
    /// What each step took while the plan ran, in the blocks that were timed.
    pub(crate) times: Arc<[StepTime]>,
    pub(crate) bridges: Vec<BridgePlan>,
    pub(crate) delays: Vec<DelayPlan>,
    pub(crate) taps: Vec<Tap>,
    /// Which of the outputs asked for each tap is; the others belong to other drivers.
    pub(crate) tap_places: Vec<usize>,
    /// What leaves for other drivers, and what comes from them.
    pub(crate) ring_writes: Vec<RingPlan>,
    pub(crate) ring_reads: Vec<RingPlan>,
    /// First and last step that need each slot's present content, by step: what lives across a cut of the list.
    pub(crate) lives: Vec<Life>,
    /// The settings that may change while it runs.
    pub(crate) live: Vec<LiveSetting>,
}

/// One line of the plan.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Step {
    pub work: StepWork,
    /// Clock whose ticks it runs at.
    pub clock: u32,
    /// Buffer it writes, `u32::MAX` for none.
    pub out: u32,
    pub inputs: Range<u32>,
    pub outputs: Range<u32>,
    /// The node it belongs to.
    pub node: NodeId,
    /// For people: `speed`, `hold stylus.force`.
    pub label: Arc<str>,
}

impl Step {
    /// Does it do the same to the same, whatever its node's number is?
    fn is_same_as(&self, other: &Self) -> bool {
        let node = other.node;
        Self { node, ..self.clone() } == *other
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StepWork {
    /// Runs a processor.
    Process(u32),
    /// Limits what a device will be given.
    Actuator(u32),
    /// Advances a device and fills its sources.
    DeviceRead(u32),
    /// Hands a device what its sinks delivered.
    DeviceWrite(u32),
    /// Crosses a rate, or delays outside of any loop.
    Bridge(u32),
    /// Gives what a loop's delay held back.
    DelayRead(u32),
    /// Takes what a loop's delay will hold back.
    DelayWrite(u32),
    /// Gives what another driver sent.
    RingRead(u32),
    /// Sends to another driver.
    RingWrite(u32),
    /// The next `steps` steps run in windows that end at multiples of the pacings.
    Island {
        steps: u32,
        first_pacing: u32,
        pacings: u32,
    },
}

/// What makes a node of one plan the same as a node of another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct NodeKey {
    pub path: Arc<str>,
    pub kind: &'static str,
    /// Of its settings, rate and connected widths.
    pub fingerprint: u64,
}

/// A device in a plan. Only `DeviceRead` moves a device that has sources; else `DeviceWrite` does.
pub(crate) struct DevicePlan {
    pub name: String,
    pub key: NodeKey,
    /// The clock it ticks on.
    pub clock: usize,
    pub device: Box<dyn Device>,
    /// Of a device that can fall silent; shared by the plans of all drivers.
    pub input: Option<LiveInput>,
    /// (actuator, channel, clock) of its sinks.
    pub driven_by: Vec<(usize, usize, u32)>,
    /// (buffer, placing, channel)
    pub reads: Vec<(u32, Placing, usize)>,
    pub writes: Vec<(u32, Placing, usize)>,
}

/// An actuator sink in a plan.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ActuatorPlan {
    pub path: String,
    pub gain: f64,
    pub limit: Limit,
    pub width: usize,
    pub rate: Rate,
    /// Does it drive a body that begins as it is built?
    pub simulated: bool,
    /// Unit of what it is given.
    pub unit: String,
    /// The live inputs that it depends on: their places among the devices, and whether it is a drive of that device.
    pub silenced_by: Vec<(usize, bool)>,
}

impl ActuatorPlan {
    /// Is every live input that it depends on heard, or held?
    pub(crate) fn is_let_through(&self, input: impl Fn(usize) -> Option<LiveInput>) -> bool {
        let mut inputs = self
            .silenced_by
            .iter()
            .map(|(device, own)| (input(*device), *own));
        inputs.all(|(input, own)| input.is_none_or(|input| input.lets_through(own)))
    }

    /// Is it the same but for its gain, which is a live setting?
    fn is_same_as(&self, other: &Self) -> bool {
        let gain = other.gain;
        Self { gain, ..self.clone() } == *other
    }
}

/// What an actuator was given last, written by the driver and read by whoever says so.
#[derive(Debug, Default)]
pub(crate) struct Delivered {
    largest: AtomicU64,
    at_zero: AtomicBool,
    level: AtomicU64,
    peak: AtomicU64,
    /// Ticks in all, and those that the peak, the heat, the slew and a fault held back.
    clipped: [AtomicU64; 5],
}

impl Delivered {
    /// Writes how often each limit held something back since the run began.
    pub fn put_clipped(&self, counts: ClipCounts) {
        let ClipCounts {
            ticks,
            peak,
            continuous,
            slew,
            fault,
        } = counts;
        let counts = [ticks, peak, continuous, slew, fault];
        for (to, count) in self.clipped.iter().zip(counts) {
            to.store(count, Relaxed);
        }
    }

    /// What was written last.
    pub fn clipped(&self) -> ClipCounts {
        let [ticks, peak, continuous, slew, fault] = self.clipped.each_ref().map(|count| count.load(Relaxed));
        ClipCounts {
            ticks,
            peak,
            continuous,
            slew,
            fault,
        }
    }

    /// Writes the largest magnitude over the axes, and whether a silent input keeps it at zero.
    pub fn put(&self, largest: f64, at_zero: bool) {
        self.largest.store(largest.to_bits(), Relaxed);
        self.at_zero.store(at_zero, Relaxed);
    }

    /// What was written last.
    pub fn get(&self) -> (f64, bool) {
        let largest = f64::from_bits(self.largest.load(Relaxed));
        (largest, self.at_zero.load(Relaxed))
    }

    /// Writes the present level, and the largest magnitude since it was written before.
    pub fn put_level(&self, level: f64, peak: f64) {
        self.level.store(level.to_bits(), Relaxed);
        // Numbers that are not negative are in the order of their bits.
        self.peak.fetch_max(peak.to_bits(), Relaxed);
    }

    /// The present level, and the largest magnitude since this was asked before.
    pub fn take_level(&self) -> (f64, f64) {
        let level = f64::from_bits(self.level.load(Relaxed));
        (level, f64::from_bits(self.peak.swap(0, Relaxed)))
    }
}

/// What a step took in the blocks that were timed, written by the driver alone and read by whoever asks.
#[derive(Debug, Default)]
pub(crate) struct StepTime {
    ns: AtomicU64,
    looks: AtomicU64,
}

impl StepTime {
    /// Adds what lay between two looks at the clock, ns.
    pub fn add(&self, ns: u64) {
        self.ns.store(self.ns.load(Relaxed).wrapping_add(ns), Relaxed);
        self.looks
            .store(self.looks.load(Relaxed).wrapping_add(1), Relaxed);
    }

    /// The sum, ns, and of how many.
    pub fn get(&self) -> (u64, u64) {
        (self.ns.load(Relaxed), self.looks.load(Relaxed))
    }
}

/// A crossing of rates in a plan; the reader's clock is its step's.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BridgePlan {
    pub kind: BridgeKind,
    /// Clock it reads.
    pub from: u32,
    pub width: usize,
    /// Most frames of its two clocks in a block.
    pub max_from: usize,
    pub max_to: usize,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum BridgeKind {
    Hold,
    HoldRuns,
    Linear,
    Average,
    Resample,
    /// Index among the delays.
    Delay(u32),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DelayPlan {
    pub frames: u64,
    pub initial: f64,
    pub width: usize,
}

/// What a ring joins.
#[derive(Debug, Clone, PartialEq)]
pub struct RingSpec {
    /// For people: `force.output to drive.current`.
    pub name: String,
    /// Lanes of a frame, at most those of a wrench.
    pub width: usize,
    /// Frames a second at the end that is written.
    pub from: Rate,
    /// And at the end that is read.
    pub to: Rate,
    /// What the delay is kept at, s.
    pub latency_s: f64,
    /// Most frames that are read at once.
    pub max_to: usize,
}

/// An end of a connection between two drivers.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RingPlan {
    /// The connection: both ends have it in common.
    pub edge: EdgeIndex,
    pub ring: RingSpec,
}

/// Where the frames of a tapped output lie.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tap {
    pub slot: u32,
    pub placing: Placing,
    pub clock: u32,
    pub stream: Stream,
}

/// A buffer's content: written at step `from`, last needed at step `to`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Life {
    pub slot: u32,
    pub from: usize,
    pub to: usize,
}

impl Plan {
    /// Lays out a graph: a plan for each driver, in the order of [`Graph::drivers`]; there is at least one.
    pub fn of(graph: &Graph, options: &PlanOptions) -> Vec<Self> {
        let drivers = graph.drivers().into_iter();
        drivers
            .map(|driver| build::build(graph, driver, options))
            .collect()
    }

    /// Name of the driver whose frames a block counts.
    pub fn driver_name(&self) -> &str {
        &self.clock_names[self.driver]
    }

    /// Driver frames of a block.
    pub fn block(&self) -> usize {
        self.block
    }

    /// Rate of the driver whose frames a block counts.
    pub fn driver_rate(&self) -> Rate {
        self.rates[self.driver]
    }

    /// Is the other plan of the same graph but for live settings, laid out in the same way? Nodes and connections may have
    /// other numbers, as such of other drivers come and go.
    pub(crate) fn is_same_as(&self, other: &Self) -> bool {
        let rings = |plans: &[RingPlan], others: &[RingPlan]| {
            plans.len() == others.len() && plans.iter().zip(others).all(|(a, b)| a.ring == b.ring)
        };
        let mut steps = self.steps.iter().zip(&other.steps);
        let mut settings = self.live.iter().zip(&other.live);
        let device_keys = |plan: &Self| {
            plan.devices
                .iter()
                .map(|device| device.key.clone())
                .collect::<Vec<_>>()
        };
        self.block == other.block
            && self.driver == other.driver
            && self.rates == other.rates
            && self.steps.len() == other.steps.len()
            && steps.all(|(a, b)| a.is_same_as(b))
            && self.live.len() == other.live.len()
            && settings.all(|(a, b)| a.is_same_as(b))
            && self.bindings == other.bindings
            && self.placings == other.placings
            && self.pacings == other.pacings
            && self.bridges == other.bridges
            && self.delays == other.delays
            && rings(&self.ring_writes, &other.ring_writes)
            && rings(&self.ring_reads, &other.ring_reads)
            && self.processor_keys == other.processor_keys
            && self.actuators.len() == other.actuators.len()
            && self
                .actuators
                .iter()
                .zip(&other.actuators)
                .all(|(a, b)| a.is_same_as(b))
            && self.taps == other.taps
            && device_keys(self) == device_keys(other)
    }

    /// Devices that go on keep the cells that they are known to be heard by.
    pub(crate) fn keep_inputs(&mut self, running: &Self) {
        for device in &mut self.devices {
            let known = running.devices.iter().find(|known| known.key == device.key);
            if let Some(input) = known.and_then(|known| known.input.clone()) {
                device.input = Some(input);
            }
        }
    }

    /// The devices that its nodes read or drive; it lists those of all drivers.
    pub(crate) fn used_devices(&self) -> impl Iterator<Item = &str> {
        let used = |device: &&DevicePlan| !device.reads.is_empty() || !device.driven_by.is_empty();
        self.devices.iter().filter(used).map(|device| &*device.name)
    }

    /// A device that it drives and another plan does not.
    pub(crate) fn drives_beyond(&self, other: &Self) -> Option<&str> {
        let driven = |plan: &Self, key: &NodeKey| {
            let mut devices = plan.devices.iter();
            devices.any(|device| device.key == *key && !device.driven_by.is_empty())
        };
        let mut own = self.devices.iter().filter(|device| driven(self, &device.key));
        own.find(|device| !driven(other, &device.key))
            .map(|device| &*device.name)
    }

    pub(crate) fn inputs(&self, step: &Step) -> &[Binding] {
        &self.bindings[step.inputs.start as usize..step.inputs.end as usize]
    }

    pub(crate) fn outputs(&self, step: &Step) -> &[Placing] {
        &self.placings[step.outputs.start as usize..step.outputs.end as usize]
    }

    /// Number of steps.
    pub fn step_count(&self) -> usize {
        self.steps.len()
    }

    /// Bytes of all signal buffers.
    pub fn buffer_bytes(&self) -> usize {
        self.slots.iter().sum::<usize>() * size_of::<f64>()
    }

    /// What each tap carries, in the order asked for.
    pub fn tap_streams(&self) -> impl Iterator<Item = &Stream> {
        self.taps.iter().map(|tap| &tap.stream)
    }
}
