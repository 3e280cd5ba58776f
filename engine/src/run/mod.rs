//! A plan that runs. [`Run::advance`] is real-time code: it does not allocate, lock, call the system or panic.

mod actuator;
mod arrivals;
mod bridge;
mod control;
mod cost;
mod crossfade;
mod device;
mod drive;
mod fault;
mod files;
mod fleet;
mod glide;
mod link;
mod live;
mod meter;
mod offline;
mod outlets;
mod profile;
mod program;
mod rings;
mod session;
mod silence;
mod swap;
mod timer;
mod walk;
mod window;

pub use crate::histogram::{AgeMeter, Histogram, SharedHistogram};
pub use crate::joining::least_ring_latency_s;
pub use crate::plan::RingSpec;
pub use actuator::ActuatorReport;
pub use arrivals::{ARRIVALS, ReplayBounds, ReplayError};
pub use control::{Control, ControlError};
pub use fault::Faults;
pub use fleet::Fleet;
pub use glide::GLIDE_S;
pub use link::{DRY_FADE_S, LinkReader, LinkWriter, RingCounts, RingMeter, link};
pub use live::{FADE_S, Live, LiveState, live};
pub use meter::{Meters, Wake};
pub use offline::{Offline, OfflineError, Outcome, RingReport};
pub use outlets::{Outlets, Probe, WriteError};
pub use profile::{Profile, StepCost};
pub use session::{ChangeError, Changed, LiveOptions, LiveOutcome, Session};
pub use silence::{ActuatorLevel, ActuatorStatus, InputStatus};
pub use swap::{Change, NoCrossFade};
pub use timer::{Timer, TimerNotes, TimerThread};

use crate::device::Device;
use crate::graph::NodeId;
use crate::io::Memory;
use crate::node::Processor;
use crate::plan::{Plan, StepWork};
use actuator::ActuatorState;
use bridge::{BridgeState, DelayState};
use device::DeviceState;
use drive::Drive;
use profile::{Unwatched, Watch};
use program::{Program, SingleStep};
use std::ops::Range;
use std::sync::Arc;
#[cfg(not(target_family = "wasm"))]
use std::time::Instant;
use window::{Window, Windows, range_of};

#[cfg(test)]
mod tests;

/// The state of a running plan.
pub struct Run {
    plan: Arc<Plan>,
    program: Program,
    state: State,
}

/// Everything that moves; apart from the program, so that steps can borrow both.
struct State {
    windows: Windows,
    /// The block's windows while an island narrows them.
    whole: Vec<Window>,
    memory: Memory,
    processors: Vec<Box<dyn Processor>>,
    /// Of each processor, with its present settings.
    singles: Vec<SingleStep>,
    devices: Vec<DeviceState>,
    actuators: Vec<ActuatorState>,
    bridges: Vec<BridgeState>,
    delays: Vec<DelayState>,
    links: Links,
    faults: Faults,
    /// The sink that was given no number first.
    struck: Option<NodeId>,
    /// Which nodes may be blamed for that, by their indices; any, if it is empty.
    suspects: Vec<bool>,
    drive: Drive,
    /// Driver frames since a panic, for the ramp to zero.
    ramped: u64,
}

/// This run's ends of the rings that join it to others; none before they are joined.
#[derive(Default)]
struct Links {
    writers: Vec<Option<LinkWriter>>,
    readers: Vec<Option<LinkReader>>,
}

impl Run {
    /// Clones the plan's pristine state and allocates everything that running needs.
    pub fn new(plan: Arc<Plan>) -> Self {
        let program = Program::new(&plan);
        let rate = |clock: u32| plan.rates[clock as usize];
        let mut bridges: Vec<BridgeState> = Vec::with_capacity(plan.bridges.len());
        for step in &plan.steps {
            if let StepWork::Bridge(index) = step.work {
                let bridge = &plan.bridges[index as usize];
                bridges.push(BridgeState::new(bridge, rate(bridge.from), rate(step.clock)));
            }
        }
        let state = State {
            windows: Windows::new(&plan),
            whole: vec![Window::default(); plan.rates.len()],
            memory: Memory::new(program.len),
            processors: plan
                .processors
                .iter()
                .map(|processor| processor.clone_box())
                .collect(),
            singles: program.singles.clone(),
            devices: plan.devices.iter().map(DeviceState::new).collect(),
            actuators: plan.actuators.iter().map(ActuatorState::new).collect(),
            bridges,
            delays: plan.delays.iter().map(DelayState::new).collect(),
            links: Links {
                writers: plan.ring_writes.iter().map(|_| None).collect(),
                readers: plan.ring_reads.iter().map(|_| None).collect(),
            },
            faults: Faults::default(),
            struck: None,
            suspects: Vec::new(),
            drive: Drive::Full,
            ramped: 0,
        };
        let mut run = Self { plan, program, state };
        run.meet_inputs();
        run
    }

    /// Runs `frames` driver frames, at most the plan's block.
    pub fn advance(&mut self, frames: usize) {
        self.state.windows.next_block(frames.min(self.plan.block));
        self.steps(0..self.plan.steps.len());
    }

    /// Looks at its rings: what has arrived by now is what the frames until the next look go by, however they are cut into
    /// blocks.
    pub fn look(&mut self) {
        for writer in self.state.links.writers.iter_mut().flatten() {
            writer.look();
        }
        for reader in self.state.links.readers.iter_mut().flatten() {
            reader.look(reader.arrivals());
        }
    }

    /// Lets its devices take what was queued for them before the first frame.
    pub(crate) fn begin_devices(&mut self) {
        for device in self.devices_mut() {
            device.begin();
        }
    }

    /// Lets its devices look at what has arrived for them by `now`, which the frames until the next look go by.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn look_at_devices(&mut self, now: Instant) {
        for device in self.devices_mut() {
            device.look(now);
        }
    }

    /// The same as [`advance`](Self::advance), every step by itself, each told to `watch`.
    fn advance_watched(&mut self, frames: usize, watch: &mut impl Watch) {
        self.state.windows.next_block(frames.min(self.plan.block));
        self.state
            .steps(&self.plan, &self.program, 0..self.plan.steps.len(), watch);
    }

    fn steps(&mut self, range: Range<usize>) {
        self.state.steps(&self.plan, &self.program, range, &mut Unwatched);
    }

    /// Driver frames run so far.
    pub fn driver_frames(&self) -> u64 {
        self.state.windows.driver_frames()
    }

    /// The frames of tap `index` in the block that was run last, lane by lane.
    pub fn tap(&self, index: usize) -> &[f64] {
        let Some(tap) = self.program.taps.get(index) else {
            return &[];
        };
        let window = self.state.windows.of(tap.clock);
        &self.state.memory.all()[range_of(tap.start, tap.width, window)]
    }

    /// The content of a slot.
    fn buffer(&self, slot: u32) -> &[f64] {
        &self.state.memory.all()[self.program.range(slot)]
    }

    fn buffer_mut(&mut self, slot: u32) -> &mut [f64] {
        &mut self.state.memory.all_mut()[self.program.range(slot)]
    }

    /// Sets one of the plan's live settings, by its place among them.
    fn set_live(&mut self, place: usize, value: f64) {
        let (Some(live), Some(works)) = (self.plan.live.get(place), self.program.of_live.get(place)) else {
            return;
        };
        for work in works {
            self.state.set(*work, live.setting, value);
        }
    }

    /// Sets a live setting of a node, by the setting's place in the node's list.
    pub fn set(&mut self, node: NodeId, setting: usize, value: f64) {
        for step in self.plan.steps.iter().filter(|step| step.node == node) {
            self.state.set(step.work, setting, value);
        }
    }

    /// After a panic in a node: takes every actuator from what it was given last to zero within `seconds`, through its
    /// limiter, without the plan. A device that panics now is driven no more; the others are.
    pub(crate) fn ramp_down(&mut self, frames: usize, seconds: f64) {
        let Self { plan, state, .. } = self;
        if state.ramped == 0 {
            // The block that was not finished got as far as the limiters, perhaps, but not to the device.
            for (plan_device, device) in plan.devices.iter().zip(&state.devices) {
                for ((.., channel), written) in plan_device.writes.iter().zip(&device.written) {
                    let mut sinks = plan_device.driven_by.iter();
                    if let Some((actuator, ..)) = sinks.find(|(_, driven, _)| driven == channel) {
                        state.actuators[*actuator].limiter.begin_from(written);
                    }
                }
            }
        }
        let ramp_frames = (seconds * plan.driver_rate().hz()).max(1.0);
        for _ in 0..frames {
            state.windows.next_block(1);
            state.ramped += 1;
            let left = (ramp_frames - state.ramped as f64).max(0.0);
            for (plan_device, device) in plan.devices.iter().zip(&mut state.devices) {
                let Some((_, _, clock)) = plan_device.driven_by.first() else {
                    continue;
                };
                // Each tick takes the same part of what is left, and the last one before the end all of it.
                let tick_frames =
                    state.windows.period(*clock) as f64 / state.windows.period(plan.driver as u32) as f64;
                let factor = if left < tick_frames {
                    0.0
                } else {
                    left / (left + tick_frames)
                };
                for _ in 0..state.windows.of(*clock).count {
                    for (actuator, channel, _) in &plan_device.driven_by {
                        let mut frame = [0.0; 6];
                        let actuator = &mut state.actuators[*actuator];
                        let width = actuator.limiter.ramp(factor, &mut frame);
                        actuator.level.take(&frame[..width], width);
                        device.unless_lost(|device| device.device.write(*channel, &frame[..width]));
                    }
                    device.unless_lost(DeviceState::advance);
                }
            }
        }
    }

    /// The devices that panicked when they were taken to zero.
    pub fn lost_devices(&self) -> impl Iterator<Item = &str> {
        let devices = self.plan.devices.iter().zip(&self.state.devices);
        devices
            .filter(|(_, state)| state.lost)
            .map(|(device, _)| &*device.name)
    }

    /// Has that ramp come to its end, as fast as the limits let it?
    pub(crate) fn is_ramped_down(&self, seconds: f64) -> bool {
        self.state.ramped as f64 >= seconds * self.plan.driver_rate().hz() && self.rests()
    }

    /// Was every actuator given zero last?
    pub fn rests(&self) -> bool {
        self.state
            .actuators
            .iter()
            .all(|actuator| actuator.limiter.rests())
    }

    /// Lets the limiters of real actuators begin as warm as they allow: what drove these before is not known.
    pub(crate) fn begin_unrested(&mut self) {
        let actuators = self.plan.actuators.iter().zip(&mut self.state.actuators);
        for (_, actuator) in actuators.filter(|(plan, _)| !plan.simulated) {
            actuator.limiter.begin_unrested();
        }
    }

    /// Paths of the actuator sinks that count a time of which nobody knows what drove their actuators.
    pub fn unrested(&self) -> impl Iterator<Item = &str> {
        let actuators = self.plan.actuators.iter().zip(&self.state.actuators);
        let unrested = actuators.filter(|(_, actuator)| actuator.limiter.is_unrested());
        unrested.map(|(plan, _)| &*plan.path)
    }

    /// Lets every limiter begin from zero, as nothing is driven.
    pub(crate) fn begin_at_rest(&mut self) {
        for actuator in &mut self.state.actuators {
            actuator.limiter.begin_from(&[0.0; 6]);
        }
    }

    /// The devices, in the order of the graph's.
    pub fn devices_mut(&mut self) -> impl Iterator<Item = &mut (dyn Device + 'static)> {
        self.state.devices.iter_mut().map(|state| state.device.as_mut())
    }

    /// Watches the processors of these nodes from now on for an output that is no number.
    fn watch(&mut self, suspects: &[bool]) {
        self.state.suspects = suspects.to_vec();
        self.state.faults.watching = true;
    }

    /// The actuator sink that was given no number first.
    fn struck(&self) -> Option<NodeId> {
        self.state.struck
    }

    /// What was seen of signals that are not numbers.
    pub fn faults(&self) -> Faults {
        self.state.faults.clone()
    }

    /// What each actuator sink held back so far.
    pub fn actuators(&self) -> impl Iterator<Item = ActuatorReport> {
        self.plan
            .actuators
            .iter()
            .zip(&self.state.actuators)
            .map(|(plan, state)| ActuatorReport {
                path: plan.path.clone(),
                clipped: state.limiter.counts(),
            })
    }
}
