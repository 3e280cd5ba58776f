//! Runs the steps of a plan: real-time code.

use super::State;
use super::actuator::When;
use super::cost::StepObserver;
use super::device::Ownership;
use super::window::{Window, range_of};
use crate::bridges::Ends;
use crate::io::{Form, ResolvedInput};
use crate::node::{AnyProcessor, SettingId, Tick};
use crate::plan::{BridgeWork, Plan, Step, StepWork};
use haptograph_signal::filter::SectionsState;
use haptograph_signal::laws::{self, LawStep};
use std::ops::Range;

impl State {
    /// Updates the law of a processor after a change of its settings or state.
    pub(super) fn update_law(&mut self, processor: usize) {
        self.laws.update(processor, self.processors[processor].law());
    }

    /// Sets a live setting of the processor or actuator of this work.
    pub(super) fn set(&mut self, work: StepWork, setting: SettingId, value: f64) {
        match work {
            StepWork::Process(index) => {
                self.processors[index as usize].set(setting, value);
                self.update_law(index as usize);
            }
            StepWork::Actuator(index) if value.is_finite() => {
                self.actuators[index as usize].gain = value;
            }
            _ => {}
        }
    }

    pub(super) fn steps<W: StepObserver>(&mut self, plan: &Plan, range: Range<usize>, observer: &mut W) {
        let mut number = range.start;
        while number < range.end {
            let step = &plan.steps[number];
            let count = match step.work {
                StepWork::Process(first) => {
                    let first = first as usize;
                    let most = if W::STEPWISE { 1 } else { range.end - number };
                    let window = self.windows.of(step.clock);
                    let period_s = plan.periods_s[step.clock as usize];
                    let tracing = self.faults.counts.tracing;
                    if window.count == 1 && step.singles > 0 && !tracing {
                        let singles = (step.singles as usize).min(most);
                        self.without_ports(first..first + singles, window, period_s);
                        singles
                    } else if window.count > 1 && step.lawful > 0 && !tracing {
                        let lawful = (step.lawful as usize).min(range.end - number);
                        let memory = &mut self.memory.all_mut()[window.offset..];
                        laws::apply(&self.laws.steps[first..first + lawful], memory, window.count);
                        lawful
                    } else if step.is_cascade(window.count) && !tracing && !W::STEPWISE {
                        let cascades = (step.cascades as usize).min(range.end - number);
                        self.cascade(first..first + cascades, window);
                        cascades
                    } else {
                        let streak = (step.streak as usize).min(most);
                        self.with_ports(&plan.steps[number..number + streak], first, period_s)
                    }
                }
                StepWork::Island { steps, first_pacing, pacings } => {
                    let steps = steps as usize;
                    let pacings = &plan.pacings[first_pacing as usize..][..pacings as usize];
                    self.island(plan, number + 1..number + 1 + steps, pacings, observer);
                    1 + steps
                }
                _ => {
                    self.step(plan, step);
                    1
                }
            };
            if W::STEPWISE {
                // An island's steps have reported themselves.
                let own = if let StepWork::Island { .. } = step.work { 1 } else { count };
                observer.steps_done(number..number + own, self.windows.of(step.clock).count);
            }
            number += count;
        }
    }

    /// Runs the steps of an island over the block, window by window.
    #[inline(never)]
    fn island<W: StepObserver>(
        &mut self,
        plan: &Plan,
        range: Range<usize>,
        pacings: &[u64],
        observer: &mut W,
    ) {
        self.windows.save();
        self.windows.rewind();
        let (mut begin, end) = self.windows.block();
        while begin < end {
            begin = self.windows.boundary_after(begin, pacings);
            self.windows.narrow_to(begin);
            self.steps(plan, range.clone(), observer);
        }
        self.windows.restore();
    }

    /// Runs processors for one frame without ports: some by their laws, others by calls, in turns.
    #[inline(always)]
    fn without_ports(&mut self, range: Range<usize>, window: Window, period_s: f64) {
        let tick = tick(window, period_s);
        let Self { laws, processors, memory, .. } = self;
        let memory = &mut memory.all_mut()[window.offset..];
        let mut begin = range.start;
        while begin < range.end {
            begin = match laws.steps[begin].law {
                Some(_) => laws.apply_to_frame(begin..range.end, memory),
                None => call_with_frame(&laws.steps, processors, begin..range.end, (&tick, memory)),
            };
        }
    }

    /// Runs a chain of filters together. What only the next one reads is not written.
    #[inline(never)]
    fn cascade(&mut self, range: Range<usize>, window: Window) {
        let [first, last] = [range.start, range.end - 1].map(|number| self.laws.steps[number]);
        let memory = &mut self.memory.all_mut()[window.offset..];
        let (from, to) = (first.from as usize, last.to as usize);
        memory.copy_within(from..from + window.count, to);
        let chain = self.processors[range].iter_mut().filter_map(|processor| processor.cascade());
        SectionsState::process_chain(chain, &mut memory[to..to + window.count]);
    }

    /// Runs successive processors of a clock, up to one that needs no ports in this window. Returns how many.
    #[inline(never)]
    fn with_ports(&mut self, steps: &[Step], first: usize, period_s: f64) -> usize {
        let window = self.windows.of(steps[0].clock);
        if window.count == 0 {
            return steps.len();
        }
        let tick = tick(window, period_s);
        let tracing = self.faults.counts.tracing;
        let memory = self.memory.all_mut();
        for (done, (step, processor)) in steps.iter().zip(&mut self.processors[first..]).enumerate() {
            // Never the first one.
            if done > 0 && !tracing && step.runs_without_ports(window.count) {
                return done;
            }
            processor.process(&tick, window.offset, &step.wires, memory);
            if tracing
                && self
                    .faults
                    .upstream_candidates
                    .get(step.node.index())
                    .is_none_or(|is_candidate| *is_candidate)
            {
                let (_, out, _) = step.wires.out.split(memory);
                self.faults.counts.trace_origin(step, out, window);
            }
        }
        steps.len()
    }

    #[inline(never)]
    fn step(&mut self, plan: &Plan, step: &Step) {
        let window = self.windows.of(step.clock);
        let (before, out, behind) = step.wires.out.split(self.memory.all_mut());
        let around = [before, behind];
        match step.work {
            StepWork::Bridge(index) => {
                let bridge = &plan.bridges[index as usize];
                let from = self.windows.of(bridge.from);
                let ends = Ends {
                    from: from.ticks(self.windows.period(bridge.from)),
                    to: window.ticks(self.windows.period(step.clock)),
                };
                let x = input(around, &step.wires.inputs[0], from);
                let y = match bridge.work {
                    BridgeWork::Runs => &mut out[step.wires.outputs[0].start as usize..],
                    _ => output(out, step, window),
                };
                match (bridge.work, &mut self.bridges[index as usize]) {
                    (BridgeWork::Delay(delay), _) => self.delays[delay as usize].pass(window, x, y),
                    (_, Some(state)) => state.convert(&ends, x, y),
                    (_, None) => {}
                }
            }
            StepWork::Actuator(index) => {
                let x = input(around, &step.wires.inputs[0], window);
                let when =
                    When { fade: self.fade, first: window.first, period: self.windows.period(step.clock) };
                let faults = self.actuators[index as usize].apply(&when, x, output(out, step, window));
                if faults > 0 {
                    self.faults.counts.ticks += faults;
                    self.faults.first_sink = self.faults.first_sink.or(Some(step.node));
                    self.faults.counts.tracing = self.faults.counts.origin.is_none();
                }
            }
            StepWork::DelayRead(index) => {
                self.delays[index as usize].read(window, output(out, step, window));
            }
            StepWork::DelayWrite(index) => {
                let x = input(around, &step.wires.inputs[0], window);
                self.delays[index as usize].write(window, x);
            }
            StepWork::RingRead(index) => {
                let y = output(out, step, window);
                match &mut self.ring_ends.readers[index as usize] {
                    Some(reader) => reader.read(y),
                    None => plan.ring_reads[index as usize].ring.kind.fill_neutral(y),
                }
            }
            StepWork::RingWrite(index) => {
                let x = input(around, &step.wires.inputs[0], window);
                if let Some(writer) = &mut self.ring_ends.writers[index as usize] {
                    writer.write(x);
                }
            }
            StepWork::DeviceRead(index) => self.device_read(plan, index as usize, window),
            StepWork::DeviceWrite(index) => self.device_write(plan, index as usize, window),
            StepWork::Process(_) | StepWork::Island { .. } => {}
        }
    }

    fn device_read(&mut self, plan: &Plan, index: usize, window: Window) {
        let state = &mut self.devices[index];
        for frame in 0..window.count {
            state.advance_unless_shared();
            for (read, (place, channel)) in plan.devices[index].reads.iter().enumerate() {
                let range = range_of(place.start, place.width, window.one(frame));
                state.read(read, *channel, &mut self.memory.all_mut()[range]);
            }
            state.end_tick();
        }
    }

    fn device_write(&mut self, plan: &Plan, index: usize, window: Window) {
        let device = &plan.devices[index];
        let state = &mut self.devices[index];
        if state.ownership == Ownership::Shadow {
            return;
        }
        for frame in 0..window.count {
            if device.reads.is_empty() {
                state.advance_unless_shared();
            }
            for (place, channel) in &device.writes {
                let range = range_of(place.start, place.width, window.one(frame));
                state.write(*channel, &self.memory.all()[range]);
            }
        }
        if window.count > 0 {
            for ((place, _), written) in device.writes.iter().zip(&mut state.written) {
                let last = range_of(place.start, place.width, window.one(window.count - 1));
                let last = &self.memory.all()[last];
                written[..last.len()].copy_from_slice(last);
            }
        }
    }
}

/// Calls processors with one frame each, up to one that has a law; returns its number. The next one gets the frame from a
/// register: a load would wait for the store.
#[inline(never)]
fn call_with_frame(
    steps: &[LawStep],
    processors: &mut [Box<dyn AnyProcessor>],
    range: Range<usize>,
    (tick, memory): (&Tick, &mut [f64]),
) -> usize {
    let (mut latest, mut latest_at) = (0.0, u32::MAX);
    let list = steps[range.clone()].iter().zip(&mut processors[range.clone()]);
    let mut number = range.start;
    for (step, processor) in list {
        if step.law.is_some() {
            return number;
        }
        let x = if step.from == latest_at { latest } else { memory[step.from as usize] };
        latest = processor.frame(tick, x);
        latest_at = step.to;
        memory[step.to as usize] = latest;
        number += 1;
    }
    number
}

fn tick(window: Window, period_s: f64) -> Tick {
    Tick { first: window.first, frames: window.count, period_s }
}

/// The frames of a sampled input in the memory before and behind the step's own buffer.
fn input<'a>([before, behind]: [&'a [f64]; 2], wire: &ResolvedInput, window: Window) -> &'a [f64] {
    match wire.form {
        Form::Sampled => {
            let side = if wire.behind { behind } else { before };
            &side[range_of(wire.at, wire.width, window)]
        }
        _ => &[],
    }
}

/// The frames of the first output.
fn output<'a>(out: &'a mut [f64], step: &Step, window: Window) -> &'a mut [f64] {
    &mut out[range_of(step.wires.outputs[0].start, step.wires.outputs[0].width, window)]
}
