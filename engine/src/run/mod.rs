//! A plan that runs. [`Run::advance`] is real-time code: it does not allocate, lock, call the system or panic.

mod arrivals;
mod bridge;
mod drive;
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
mod swap;
mod timer;
mod window;

pub use arrivals::{ARRIVALS, ReplayError};
pub use bridge::resampler;
pub use fleet::Fleet;
pub use glide::GLIDE_S;
pub use link::{DRY_FADE_S, RingCounts, RingMeter, least_ring_latency_s};
pub use live::{Change, Control, ControlError, FADE_S, Live, LiveState, live};
pub use meter::{Histogram, Meters, Wake};
pub use offline::{Offline, OfflineError, Outcome, RingReport};
pub use outlets::{Outlets, Probe, WriteError};
pub use profile::{Profile, StepCost};
pub use session::{ChangeError, Changed, LiveOptions, LiveOutcome, Session};
pub use timer::{Timer, TimerNotes, TimerThread};

use crate::device::Device;
use crate::io::{Form, Io, Memory, Placing, Wire};
use crate::limiter::{ClipCounts, Limiter};
use crate::node::{Processor, Tick};
use crate::plan::{ActuatorPlan, BridgeKind, Plan, StepWork};
use bridge::{BridgeState, DelayState, Ends};
use drive::Drive;
use link::{LinkReader, LinkWriter};
use petgraph::graph::NodeIndex;
use profile::{Unwatched, Watch};
use program::{Line, Program, SingleStep};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use window::{Window, Windows};

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
    struck: Option<NodeIndex>,
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

struct DeviceState {
    device: Box<dyn Device>,
    started: bool,
    /// What each of the plan's writes gave it last.
    written: Vec<[f64; 6]>,
    /// It panicked on the way down, and is driven no more.
    lost: bool,
}

/// A gain and the limiter that every drive of a device goes through.
struct ActuatorState {
    gain: f64,
    limiter: AnyLimiter,
}

enum AnyLimiter {
    One(Limiter<1>),
    Three(Limiter<3>),
    Six(Limiter<6>),
    /// A limit that could not be made: nothing passes.
    Closed,
}

/// What was seen of signals that are not numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults {
    /// Ticks at which an actuator was given NaN or infinity, and got zero instead.
    pub ticks: u64,
    /// The first node found to put one out.
    pub origin: Option<NodeIndex>,
    /// The next steps are watched to find the origin.
    watching: bool,
}

/// What an actuator sink held back.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuatorReport {
    /// Path of the sink.
    pub path: String,
    /// How often each limit held something back.
    pub clipped: ClipCounts,
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
            devices: plan
                .devices
                .iter()
                .map(|device| DeviceState {
                    device: device.device.clone_box(),
                    started: false,
                    written: vec![[0.0; 6]; device.writes.len()],
                    lost: false,
                })
                .collect(),
            actuators: plan
                .actuators
                .iter()
                .map(|plan| ActuatorState {
                    gain: plan.gain,
                    limiter: AnyLimiter::new(plan),
                })
                .collect(),
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
        Self { plan, program, state }
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

    /// The same, every step by itself, each told to `watch`.
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

    /// Sets a live setting of a node, by the setting's place in the node's list.
    pub fn set(&mut self, node: NodeIndex, setting: usize, value: f64) {
        let plan = &self.plan;
        for step in plan.steps.iter().filter(|step| step.node == node) {
            match step.work {
                StepWork::Process(index) => {
                    self.state.processors[index as usize].set(setting, value);
                    self.state.renew_single(index as usize);
                }
                StepWork::Actuator(index) if value.is_finite() => {
                    self.state.actuators[index as usize].gain = value;
                }
                _ => {}
            }
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
                        let width = state.actuators[*actuator].limiter.ramp(factor, &mut frame);
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
    fn struck(&self) -> Option<NodeIndex> {
        self.state.struck
    }

    /// What was seen of signals that are not numbers.
    pub fn faults(&self) -> Faults {
        self.state.faults
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

impl State {
    /// After a processor was changed or replaced by another of its kind.
    fn renew_single(&mut self, processor: usize) {
        if let Some(single) = self.processors[processor].single() {
            self.singles[processor].single = single;
        }
    }

    fn steps<W: Watch>(&mut self, plan: &Plan, program: &Program, range: Range<usize>, watch: &mut W) {
        let mut number = range.start;
        while number < range.end {
            let line = &program.lines[number];
            let count = match line.work {
                StepWork::Process(first) => {
                    let first = first as usize;
                    let most = if W::APART { 1 } else { range.end - number };
                    let (count, offset) = self.windows.frames(line.clock);
                    if count == 1 && line.singles > 0 && !self.faults.watching {
                        let singles = (line.singles as usize).min(most);
                        self.without_ports(first..first + singles, offset);
                        singles
                    } else {
                        let streak = (line.streak as usize).min(most);
                        let period_s = program.periods_s[line.clock as usize];
                        self.with_ports(&program.lines[number..number + streak], first, period_s)
                    }
                }
                StepWork::Island {
                    steps,
                    first_pacing,
                    pacings,
                } => {
                    let steps = steps as usize;
                    let pacings = &plan.pacings[first_pacing as usize..][..pacings as usize];
                    self.island(plan, program, number + 1..number + 1 + steps, pacings, watch);
                    1 + steps
                }
                _ => {
                    self.step(plan, program, line);
                    1
                }
            };
            if W::APART {
                watch.done(number, self.windows.of(line.clock).count);
            }
            number += count;
        }
    }

    /// Runs the steps of an island over the block, window by window.
    #[inline(never)]
    fn island<W: Watch>(
        &mut self,
        plan: &Plan,
        program: &Program,
        range: Range<usize>,
        pacings: &[u64],
        watch: &mut W,
    ) {
        self.whole.copy_from_slice(self.windows.all());
        self.windows.rewind();
        let (mut begin, end) = self.windows.block();
        while begin < end {
            begin = self.windows.boundary_after(begin, pacings);
            self.windows.narrow_to(begin);
            self.steps(plan, program, range.clone(), watch);
        }
        self.windows.restore(&self.whole);
    }

    /// Runs processors for one frame, at `offset` in their buffers, without ports.
    #[inline(never)]
    fn without_ports(&mut self, range: Range<usize>, offset: usize) {
        let memory = &mut self.memory.all_mut()[offset..];
        let processors = &mut self.processors[range.clone()];
        let (mut latest, mut latest_at) = (0.0, u32::MAX);
        for (step, processor) in self.singles[range].iter().zip(processors) {
            // In a chain the frame stays in a register: a load has to wait for the store before it.
            let x = match step.from == latest_at {
                true => latest,
                false => memory[step.from as usize],
            };
            latest = step.single.of(x, &mut **processor);
            latest_at = step.to;
            memory[step.to as usize] = latest;
        }
    }

    /// Runs processors that follow one another at one clock, up to one that can do without ports in this window;
    /// returns how many.
    #[inline(never)]
    fn with_ports(&mut self, lines: &[Line], first: usize, period_s: f64) -> usize {
        let window = self.windows.of(lines[0].clock);
        if window.count == 0 {
            return lines.len();
        }
        let tick = Tick {
            first: window.first,
            frames: window.count,
            period_s,
        };
        let watching = self.faults.watching;
        let single = window.count == 1 && !watching;
        let memory = self.memory.all_mut();
        for (done, (line, processor)) in lines.iter().zip(&mut self.processors[first..]).enumerate() {
            if single && line.singles > 0 {
                return done;
            }
            let (before, out, behind) = line.out.split(memory);
            let mut io = Io {
                frames: window.count,
                offset: window.offset,
                inputs: &line.inputs,
                outputs: &line.outputs,
                before,
                out,
                behind,
            };
            processor.process(&tick, &mut io);
            if watching
                && self
                    .suspects
                    .get(line.node.index())
                    .is_none_or(|suspect| *suspect)
            {
                self.faults.watch(line, out, window);
            }
        }
        lines.len()
    }

    #[inline(never)]
    fn step(&mut self, plan: &Plan, program: &Program, line: &Line) {
        let window = self.windows.of(line.clock);
        let (before, out, behind) = line.out.split(self.memory.all_mut());
        let around = [before, behind];
        match line.work {
            StepWork::Bridge(index) => {
                let bridge = &plan.bridges[index as usize];
                let ends = Ends {
                    from: self.windows.of(bridge.from),
                    from_period: self.windows.period(bridge.from),
                    to: window,
                    to_period: self.windows.period(line.clock),
                };
                let x = input(around, &line.inputs[0], ends.from);
                match bridge.kind {
                    BridgeKind::HoldRuns => {
                        let y = &mut out[line.outputs[0].start as usize..];
                        self.bridges[index as usize].cross(&ends, x, y);
                    }
                    BridgeKind::Delay(delay) => {
                        self.delays[delay as usize].pass(window, x, output(out, line, window));
                    }
                    _ => self.bridges[index as usize].cross(&ends, x, output(out, line, window)),
                }
            }
            StepWork::Actuator(index) => {
                let x = input(around, &line.inputs[0], window);
                let actuator = &mut self.actuators[index as usize];
                let asked = Asked {
                    gain: actuator.gain,
                    drive: self.drive,
                    first: window.first,
                    period: self.windows.period(line.clock),
                };
                let faults = actuator.limiter.apply(&asked, x, output(out, line, window));
                if faults > 0 {
                    self.faults.ticks += faults;
                    self.struck = self.struck.or(Some(line.node));
                    self.faults.watching = self.faults.origin.is_none();
                }
            }
            StepWork::DelayRead(index) => {
                self.delays[index as usize].read(window, output(out, line, window));
            }
            StepWork::DelayWrite(index) => {
                let x = input(around, &line.inputs[0], window);
                self.delays[index as usize].write(window, x);
            }
            StepWork::RingRead(index) => {
                let y = output(out, line, window);
                match &mut self.links.readers[index as usize] {
                    Some(reader) => reader.read(y),
                    None => y.fill(0.0),
                }
            }
            StepWork::RingWrite(index) => {
                let x = input(around, &line.inputs[0], window);
                if let Some(writer) = &mut self.links.writers[index as usize] {
                    writer.write(x);
                }
            }
            StepWork::DeviceRead(index) => self.device_read(plan, program, index as usize, window),
            StepWork::DeviceWrite(index) => self.device_write(plan, program, index as usize, window),
            StepWork::Process(_) | StepWork::Island { .. } => {}
        }
    }

    fn device_read(&mut self, plan: &Plan, program: &Program, index: usize, window: Window) {
        let state = &mut self.devices[index];
        for frame in 0..window.count {
            state.advance();
            for (slot, placing, channel) in &plan.devices[index].reads {
                let range = range_of(placing.start, placing.width, window.one(frame));
                let buffer = &mut self.memory.all_mut()[program.range(*slot)];
                state.device.read(*channel, &mut buffer[range]);
            }
        }
    }

    fn device_write(&mut self, plan: &Plan, program: &Program, index: usize, window: Window) {
        let device = &plan.devices[index];
        let state = &mut self.devices[index];
        for frame in 0..window.count {
            if device.reads.is_empty() {
                state.advance();
            }
            for (slot, placing, channel) in &device.writes {
                let range = range_of(placing.start, placing.width, window.one(frame));
                let buffer = &self.memory.all()[program.range(*slot)];
                state.device.write(*channel, &buffer[range]);
            }
        }
        if window.count > 0 {
            for ((slot, placing, _), written) in device.writes.iter().zip(&mut state.written) {
                let last = &self.memory.all()[program.range(*slot)];
                let last = &last[range_of(placing.start, placing.width, window.one(window.count - 1))];
                written[..last.len()].copy_from_slice(last);
            }
        }
    }
}

impl Faults {
    /// Of several drivers.
    fn of(all: impl Iterator<Item = Self>) -> Self {
        all.fold(Self::default(), |sum, one| Self {
            ticks: sum.ticks + one.ticks,
            origin: sum.origin.or(one.origin),
            watching: false,
        })
    }

    /// After an actuator was given something that is not a number: is this step where it comes from?
    fn watch(&mut self, line: &Line, out: &[f64], window: Window) {
        let bad = |placing: &Placing| {
            !out[range_of(placing.start, placing.width, window)]
                .iter()
                .all(|x| x.is_finite())
        };
        if self.origin.is_none() && line.outputs.iter().any(bad) {
            self.origin = Some(line.node);
            self.watching = false;
        }
    }
}

impl DeviceState {
    /// Moves the body to the next tick; at tick 0 it is where it was built.
    fn advance(&mut self) {
        if self.started {
            self.device.advance();
        }
        self.started = true;
    }

    /// Does something with the device, outside the plan, unless it has panicked at that.
    fn unless_lost(&mut self, work: impl FnOnce(&mut Self)) {
        if !self.lost {
            self.lost = catch_unwind(AssertUnwindSafe(|| work(self))).is_err();
        }
    }
}

fn range_of(start: u32, width: u32, window: Window) -> Range<usize> {
    let begin = start as usize + window.offset * width as usize;
    begin..begin + window.count * width as usize
}

/// The frames of a sampled input in the memory before and behind the step's own buffer.
fn input<'a>([before, behind]: [&'a [f64]; 2], wire: &Wire, window: Window) -> &'a [f64] {
    match wire.form {
        Form::Sampled => {
            let side = if wire.behind { behind } else { before };
            &side[range_of(wire.at, wire.width, window)]
        }
        _ => &[],
    }
}

/// The frames of the first output.
fn output<'a>(out: &'a mut [f64], line: &Line, window: Window) -> &'a mut [f64] {
    &mut out[range_of(line.outputs[0].start, line.outputs[0].width, window)]
}

impl AnyLimiter {
    fn new(plan: &ActuatorPlan) -> Self {
        let rate_hz = plan.rate.hz();
        match plan.width {
            1 => Limiter::new(&plan.limit, rate_hz).map(Self::One),
            3 => Limiter::new(&plan.limit, rate_hz).map(Self::Three),
            6 => Limiter::new(&plan.limit, rate_hz).map(Self::Six),
            _ => return Self::Closed,
        }
        .unwrap_or(Self::Closed)
    }

    /// Frames of a drive to frames that keep the limit. How many of them were no numbers?
    fn apply(&mut self, asked: &Asked, x: &[f64], y: &mut [f64]) -> u64 {
        let faults = self.counts().fault;
        match self {
            Self::One(limiter) => limit_frames(limiter, asked, x, y),
            Self::Three(limiter) => limit_frames(limiter, asked, x, y),
            Self::Six(limiter) => limit_frames(limiter, asked, x, y),
            Self::Closed => y.fill(0.0),
        }
        self.counts().fault - faults
    }

    /// Goes on for another limiter of the same actuator.
    fn go_on_for(&mut self, other: &Self) {
        match (self, other) {
            (Self::One(this), Self::One(other)) => this.go_on_for(other),
            (Self::Three(this), Self::Three(other)) => this.go_on_for(other),
            (Self::Six(this), Self::Six(other)) => this.go_on_for(other),
            // A channel of a device has one kind.
            _ => {}
        }
    }

    fn rests(&self) -> bool {
        match self {
            Self::One(limiter) => limiter.output() == [0.0],
            Self::Three(limiter) => limiter.output() == [0.0; 3],
            Self::Six(limiter) => limiter.output() == [0.0; 6],
            Self::Closed => true,
        }
    }

    /// Begins as warm as the limit allows.
    fn begin_spent(&mut self) {
        match self {
            Self::One(limiter) => limiter.begin_spent(),
            Self::Three(limiter) => limiter.begin_spent(),
            Self::Six(limiter) => limiter.begin_spent(),
            Self::Closed => {}
        }
    }

    /// Begins from what the actuator was really given last.
    fn begin_from(&mut self, given: &[f64; 6]) {
        fn first<const N: usize>(given: &[f64; 6]) -> [f64; N] {
            std::array::from_fn(|i| given[i])
        }
        match self {
            Self::One(limiter) => limiter.begin_from(first(given)),
            Self::Three(limiter) => limiter.begin_from(first(given)),
            Self::Six(limiter) => limiter.begin_from(first(given)),
            Self::Closed => {}
        }
    }

    /// The next frame of the way from the latest output down to zero, by a factor on it.
    fn ramp(&mut self, factor: f64, frame: &mut [f64; 6]) -> usize {
        let mut put = |lanes: &[f64]| {
            frame[..lanes.len()].copy_from_slice(lanes);
            lanes.len()
        };
        match self {
            Self::One(limiter) => put(&limiter.apply(limiter.output().map(|x| x * factor))),
            Self::Three(limiter) => put(&limiter.apply(limiter.output().map(|x| x * factor))),
            Self::Six(limiter) => put(&limiter.apply(limiter.output().map(|x| x * factor))),
            Self::Closed => 0,
        }
    }

    fn counts(&self) -> ClipCounts {
        match self {
            Self::One(limiter) => limiter.counts(),
            Self::Three(limiter) => limiter.counts(),
            Self::Six(limiter) => limiter.counts(),
            Self::Closed => ClipCounts::default(),
        }
    }
}

/// How a sink's request becomes a drive: its gain, and the fade at the time of each frame.
struct Asked {
    gain: f64,
    drive: Drive,
    first: u64,
    period: u64,
}

fn limit_frames<const N: usize>(limiter: &mut Limiter<N>, asked: &Asked, x: &[f64], y: &mut [f64]) {
    for (j, (x, y)) in x
        .as_chunks::<N>()
        .0
        .iter()
        .zip(y.as_chunks_mut::<N>().0)
        .enumerate()
    {
        let factor = asked.gain * asked.drive.factor((asked.first + j as u64) * asked.period);
        *y = limiter.apply(x.map(|x| x * factor));
    }
}
