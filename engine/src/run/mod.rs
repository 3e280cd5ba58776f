//! Running plans. [`Run::advance`] is real-time code: it does not allocate, lock, make system calls or panic.

mod actuator;
mod arm;
mod arrivals;
mod async_resampler;
mod control;
mod cost;
mod crossfade;
mod delay;
mod device;
mod fade;
mod fault;
mod file_sinks;
mod laws;
mod meter;
mod offline;
mod player;
mod profile;
mod ramp;
mod ring_edges;
mod rings;
mod session;
mod silence;
mod swap;
mod virtual_clock;
mod walk;
mod window;

pub use crate::bridges::least_ring_latency_s;
pub use crate::histogram::{AgeMeter, Histogram, SharedHistogram};
pub use crate::plan::RingSpec;
pub use actuator::ActuatorReport;
pub use arm::{ARM_FALL_S, ARM_HOLD_S, ARM_RISE_S, ArmSwitch};
pub use arrivals::{ARRIVALS, ReplayBounds, ReplayError};
pub use async_resampler::{
    AsyncResamplerReader, AsyncResamplerWriter, DRY_FADE_S, RingCounts, RingMeter, async_resampler,
};
pub use control::{Control, ControlError, SetError, UnknownSetting};
pub use fade::FADE_S;
pub use fault::Faults;
pub use file_sinks::{FileSinks, Probe, WriteError};
pub use meter::{MAX_STALLS, Meters, Wake};
pub use offline::{OfflineError, Outcome, RingReport};
pub(crate) use player::Claim;
pub use player::{Player, PlayerState, player};
pub use profile::{Profile, StepCost};
pub use ramp::PARAM_RAMP_S;
pub(crate) use session::HandedProbe;
pub use session::{ChangeError, Changed, Session, SessionOptions, SessionOutcome};
pub use silence::{ActuatorLevel, ActuatorStatus, InputStatus};
pub use swap::{Change, NoCrossFade};
pub use virtual_clock::VirtualClock;

use crate::bridges::{BridgeContext, BridgeEntry, BridgeState, HoldRuns};
use crate::device::Device;
use crate::io::Memory;
use crate::node::{AnyProcessor, SettingId};
use crate::node_id::NodeId;
use crate::plan::{BridgeWork, Plan, StepWork};
use actuator::ActuatorState;
use cost::{NoObserver, StepObserver};
use delay::DelayState;
use device::DeviceState;
use fade::FadeGate;
use laws::Laws;
use std::ops::Range;
use std::sync::Arc;
#[cfg(not(target_family = "wasm"))]
use std::time::Instant;
use window::{Windows, range_of};

#[cfg(test)]
mod tests;

/// The state of a running plan.
pub struct Run {
    plan: Arc<Plan>,
    state: State,
}

/// The mutable state. It is separate from the plan so that steps can borrow both.
struct State {
    windows: Windows,
    memory: Memory,
    processors: Vec<Box<dyn AnyProcessor>>,
    /// How each processor computes scalars without ports, with its present settings.
    laws: Laws,
    devices: Vec<DeviceState>,
    actuators: Vec<ActuatorState>,
    /// `None` for a delay.
    bridges: Vec<Option<Box<dyn BridgeState>>>,
    delays: Vec<DelayState>,
    ring_ends: RingEnds,
    faults: FaultTrace,
    fade: FadeGate,
    /// Driver frames of the ramp to zero after a panic.
    ramped: u64,
}

/// NaN and infinity at actuators, and where they come from.
#[derive(Default)]
struct FaultTrace {
    counts: Faults,
    /// The first actuator sink that received one.
    first_sink: Option<NodeId>,
    /// True for each node, by index, that can be its origin; empty if all can.
    upstream_candidates: Vec<bool>,
}

/// This run's ends of the rings to other drivers; `None` until they are connected.
#[derive(Default)]
struct RingEnds {
    writers: Vec<Option<AsyncResamplerWriter>>,
    readers: Vec<Option<AsyncResamplerReader>>,
}

impl Run {
    /// Clones the plan's initial state and allocates all memory that running needs.
    pub fn new(plan: Arc<Plan>) -> Self {
        let rate = |clock: u32| plan.rates[clock as usize];
        let mut bridges = Vec::with_capacity(plan.bridges.len());
        for step in &plan.steps {
            if let StepWork::Bridge(index) = step.work {
                let bridge = &plan.bridges[index as usize];
                let entry = match bridge.work {
                    BridgeWork::Frames(entry) => Some(entry),
                    BridgeWork::Runs => Some(BridgeEntry::of::<HoldRuns>()),
                    BridgeWork::Delay(_) => None,
                };
                let cx = BridgeContext {
                    kind: bridge.kind,
                    from: rate(bridge.from),
                    to: rate(step.clock),
                    max_from: bridge.max_from,
                    max_to: bridge.max_to,
                };
                bridges.push(entry.map(|entry| entry.build(&cx)));
            }
        }
        let state = State {
            windows: Windows::new(&plan),
            memory: Memory::new(plan.memory_len()),
            processors: plan.processors.iter().map(|processor| processor.boxed_clone()).collect(),
            laws: Laws::new(&plan),
            devices: plan.devices.iter().map(DeviceState::new).collect(),
            actuators: plan.actuators.iter().map(ActuatorState::new).collect(),
            bridges,
            delays: plan.delays.iter().map(DelayState::new).collect(),
            ring_ends: RingEnds {
                writers: plan.ring_writes.iter().map(|_| None).collect(),
                readers: plan.ring_reads.iter().map(|_| None).collect(),
            },
            faults: FaultTrace::default(),
            fade: FadeGate::Full,
            ramped: 0,
        };
        let mut run = Self { plan, state };
        run.init_gates();
        run
    }

    /// Runs `frames` driver frames, at most the plan's block.
    pub fn advance(&mut self, frames: usize) {
        self.state.windows.next_block(frames.min(self.plan.block));
        self.steps(0..self.plan.steps.len());
    }

    /// Polls its rings. The frames until the next poll use the data that have arrived by now, for any block size.
    pub(crate) fn poll_rings(&mut self) {
        for writer in self.state.ring_ends.writers.iter_mut().flatten() {
            writer.poll();
        }
        for reader in self.state.ring_ends.readers.iter_mut().flatten() {
            reader.poll(reader.arrivals());
        }
    }

    /// Lets the devices read the values that were queued before the first frame. Those of other drivers are not used here: their
    /// values are not taken away.
    pub(crate) fn begin_devices(&mut self) {
        let devices = self.state.devices.iter_mut().zip(&self.plan.devices);
        for (state, _) in devices.filter(|(_, planned)| planned.is_used()) {
            state.device.begin();
        }
    }

    /// Polls a device; true if its hardware was given zeros meanwhile.
    #[cfg(not(target_family = "wasm"))]
    fn poll_device(&mut self, device: usize, now: Instant) -> bool {
        let device = self.state.devices[device].device.as_mut();
        device.poll(now);
        device.take_interruption()
    }

    /// As [`advance`](Self::advance), but runs every step by itself and reports it to `observer`.
    fn advance_observed(&mut self, frames: usize, observer: &mut impl StepObserver) {
        self.state.windows.next_block(frames.min(self.plan.block));
        self.state.steps(&self.plan, 0..self.plan.steps.len(), observer);
    }

    fn steps(&mut self, range: Range<usize>) {
        self.state.steps(&self.plan, range, &mut NoObserver);
    }

    /// Driver frames run so far.
    pub fn driver_frames(&self) -> u64 {
        self.state.windows.driver_frames()
    }

    /// The frames of tap `index` in the last block, components interleaved.
    pub fn tap(&self, index: usize) -> &[f64] {
        let Some(tap) = self.plan.taps.get(index) else {
            return &[];
        };
        let window = self.state.windows.of(tap.clock);
        &self.state.memory.all()[range_of(tap.place.start, tap.place.width, window)]
    }

    /// Sets a live setting by its index in the plan's list. The processor gets the value in SI.
    fn set_live(&mut self, place: usize, value: f64) {
        let (Some(live), Some(works)) = (self.plan.live.get(place), self.plan.live_works.get(place)) else {
            return;
        };
        for work in works {
            self.state.set(*work, live.setting, value * live.si_per_unit);
        }
    }

    /// Sets a live setting of a node, in SI.
    pub fn set(&mut self, node: NodeId, setting: SettingId, value: f64) {
        for step in self.plan.steps.iter().filter(|step| step.node == node) {
            self.state.set(step.work, setting, value);
        }
    }

    /// Ramps every actuator from its last output to zero within `seconds`, through its limiter and without the plan.
    ///
    /// Used after a panic in a node. A device that panics here receives no further output; the others do.
    pub(crate) fn ramp_down(&mut self, frames: usize, seconds: f64) {
        let Self { plan, state, .. } = self;
        if state.ramped == 0 {
            // The limiters may have run in the unfinished block, but the device did not receive their output.
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
                // A straight line: each tick takes an equal share, the last one all that is left.
                let tick_frames =
                    state.windows.period(*clock) as f64 / state.windows.period(plan.driver as u32) as f64;
                let factor = if left < tick_frames { 0.0 } else { left / (left + tick_frames) };
                for _ in 0..state.windows.of(*clock).count {
                    for (actuator, channel, _) in &plan_device.driven_by {
                        let mut frame = [0.0; 6];
                        let actuator = &mut state.actuators[*actuator];
                        let width = actuator.limiter.ramp(factor, &mut frame);
                        actuator.level.measure(&frame[..width], width);
                        device.unless_lost(|device| device.write(*channel, &frame[..width]));
                    }
                    device.unless_lost(DeviceState::advance);
                }
            }
        }
    }

    /// Names of the devices that panicked during the ramp to zero.
    pub fn lost_devices(&self) -> impl Iterator<Item = &str> {
        let devices = self.plan.devices.iter().zip(&self.state.devices);
        devices.filter(|(_, state)| state.lost).map(|(device, _)| &*device.name)
    }

    /// True if the ramp to zero has ended. The limits may make it longer.
    pub(crate) fn is_ramped_down(&self, seconds: f64) -> bool {
        self.state.ramped as f64 >= seconds * self.plan.driver_rate().hz() && self.is_idle()
    }

    /// True if the last output of every actuator was zero.
    pub fn is_idle(&self) -> bool {
        self.state.actuators.iter().all(|actuator| actuator.limiter.is_idle())
    }

    /// Starts the limiters of real actuators without heat reserve, because their earlier output is unknown.
    pub(crate) fn assume_thermally_saturated(&mut self) {
        let actuators = self.plan.actuators.iter().zip(&mut self.state.actuators);
        for (_, actuator) in actuators.filter(|(plan, _)| !plan.simulated) {
            actuator.limiter.assume_thermally_saturated();
        }
    }

    /// Paths of the actuator sinks whose heat includes a time before the run, of unknown output.
    pub fn unrested(&self) -> impl Iterator<Item = &str> {
        let actuators = self.plan.actuators.iter().zip(&self.state.actuators);
        let unrested = actuators.filter(|(_, actuator)| actuator.limiter.has_unknown_history());
        unrested.map(|(plan, _)| &*plan.path)
    }

    /// Sets the last output of every limiter to zero.
    pub(crate) fn reset_limiters(&mut self) {
        for actuator in &mut self.state.actuators {
            actuator.limiter.begin_from(&[0.0; 6]);
        }
    }

    /// The devices, in the order of the graph.
    pub fn devices_mut(&mut self) -> impl Iterator<Item = &mut (dyn Device + 'static)> {
        self.state.devices.iter_mut().map(|state| state.device.as_mut())
    }

    /// Checks the outputs of these nodes' processors for NaN and infinity from now on.
    fn trace_fault(&mut self, upstream_candidates: &[bool]) {
        self.state.faults.upstream_candidates = upstream_candidates.to_vec();
        self.state.faults.counts.tracing = true;
    }

    /// The first actuator sink that received NaN or infinity.
    fn first_faulted_sink(&self) -> Option<NodeId> {
        self.state.faults.first_sink
    }

    /// NaN and infinity at actuators so far.
    pub fn faults(&self) -> Faults {
        self.state.faults.counts.clone()
    }

    /// Limiter counts of each actuator sink so far.
    pub fn actuators(&self) -> impl Iterator<Item = ActuatorReport> {
        self.plan.actuators.iter().zip(&self.state.actuators).map(|(plan, state)| ActuatorReport {
            path: plan.path.clone(),
            clipped: state.limiter.counts(),
            largest_request: state.limiter.largest_request(),
            limit: plan.limit,
            unit: plan.unit.clone(),
        })
    }
}
