//! Live runs: plans that run against a clock and can be changed while they run.
//!
//! The real-time side is [`Live`]: a driver calls [`Live::callback`] with the frames that are due. The other side is
//! [`Control`]. Rings connect them: commands one way; reports and plans to be freed the other. Invariant: a callback
//! does not allocate, free or lock.

use super::arrivals::ArrivalLog;
use super::control::{COMMANDS, Command, Control, Report};
use super::cost::CostSampler;
use super::fade::FadeGate;
use super::meter::Wake;
use super::ramp::ParamRamps;
use super::rings::TapRings;
use super::swap::{PlanSwap, SwapMode};
use super::{ActuatorReport, Faults, Run};
use crate::device::Device;
use crate::limiter::Hottest;
use crate::plan::Plan;
use rtrb::{Consumer, Producer, RingBuffer};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Duration of a fade in or out, s.
pub const FADE_S: f64 = 0.01;
const REPORTS: usize = 4096;
/// Places among them for replaced plans, which must not be lost.
const OLD_PLANS: usize = 64;
/// The real-time side of a live run.
pub struct Live {
    run: Run,
    /// The next plan. It takes over when no setting ramps, or when the fade has reached zero.
    next: Option<Box<PlanSwap>>,
    /// The former plan during a cross-fade.
    former: Option<Box<PlanSwap>>,
    /// Polled in every callback, so that a stop takes effect at once.
    stop: Arc<AtomicBool>,
    stopping: bool,
    state: LiveState,
    /// Driver frames run by the plan, and after how many it ends.
    frames: u64,
    ends_after: Option<u64>,
    /// Interval in driver frames at which it checks whether its live inputs are silent; 0: in every callback.
    follows_every: u64,
    ramps: ParamRamps,
    rings: TapRings,
    /// Replay log of the callbacks.
    log: Option<ArrivalLog>,
    commands: Consumer<Command>,
    reports: Producer<Report>,
    unreported: u64,
    /// Selection of the blocks that are timed; `None` if none is.
    sampler: Option<CostSampler>,
    /// Heat of the actuators that left the run.
    hottest: Arc<Hottest>,
}

/// State of a live run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LiveState {
    /// Running.
    Running,
    /// Stopped after the fade-out.
    Stopped,
    /// The duration is over; the actuators ramp to zero and stay there.
    Finished,
    /// A node panicked; the actuators ramp to zero and stay there.
    Panicked,
}

/// The object that a driver runs: a live run, or a wrapper of one that uses its frames.
pub trait Driven: Send + 'static {
    /// Rate of the driver, Hz.
    fn rate_hz(&self) -> f64;
    /// Runs `frames` frames of the driver. Real-time code.
    fn run_frames(&mut self, frames: usize);
    /// Largest number of frames that it runs at once.
    fn block(&self) -> usize;
    /// True if the run has ended and every actuator is at zero.
    fn is_idle(&self) -> bool;
    /// The devices, for the driver that owns some of them.
    fn devices_mut(&mut self) -> impl Iterator<Item = &mut (dyn Device + 'static)>;
    /// Reports a wake-up.
    fn report(&mut self, wake: Wake);
    /// Fades in again after an interruption of the driver.
    fn resume(&mut self);
}

impl Driven for Live {
    fn rate_hz(&self) -> f64 {
        self.run.rate_hz()
    }
    fn run_frames(&mut self, frames: usize) {
        self.callback(frames, |_, _| {});
    }
    fn block(&self) -> usize {
        self.block()
    }
    fn is_idle(&self) -> bool {
        self.is_idle()
    }
    fn devices_mut(&mut self) -> impl Iterator<Item = &mut (dyn Device + 'static)> {
        self.devices_mut()
    }
    fn report(&mut self, wake: Wake) {
        self.report(wake);
    }
    fn resume(&mut self) {
        self.resume();
    }
}

/// Makes both sides of a live run of `plan`. It starts without a fade, so that its samples equal an offline run's.
pub fn live(plan: Arc<Plan>) -> (Live, Control) {
    live_until(plan, Arc::default())
}

/// As [`live`], with the flag that stops it.
pub(super) fn live_until(plan: Arc<Plan>, stop: Arc<AtomicBool>) -> (Live, Control) {
    let (command_in, command_out) = RingBuffer::new(COMMANDS);
    let (report_in, report_out) = RingBuffer::new(REPORTS);
    let live = Live {
        run: Run::new(Arc::clone(&plan)),
        next: None,
        former: None,
        stop: Arc::clone(&stop),
        stopping: false,
        state: LiveState::Running,
        frames: 0,
        ends_after: None,
        follows_every: 0,
        ramps: ParamRamps::with_room_for(COMMANDS),
        rings: TapRings::default(),
        log: None,
        commands: command_out,
        reports: report_in,
        unreported: 0,
        sampler: None,
        hottest: Arc::default(),
    };
    let control = Control::new(plan, stop, command_in, report_out);
    (live, control)
}

impl Live {
    /// Runs `frames` driver frames in blocks of at most the plan's block; calls `each` after every block.
    ///
    /// Catches a panic of a node: the engine then ramps the actuators to zero, outside the plan. A device that panics
    /// during this ramp receives no further output.
    pub fn callback(&mut self, frames: usize, mut each: impl FnMut(&mut Run, usize)) {
        let mut left = frames;
        loop {
            let part = match self.follows_every {
                0 => left,
                every => left.min((every - self.frames % every) as usize),
            };
            self.run_part(part, &mut each);
            left -= part;
            if left == 0 {
                break;
            }
        }
    }

    /// Runs the frames of a callback up to the next check for silent live inputs.
    fn run_part(&mut self, frames: usize, each: &mut impl FnMut(&mut Run, usize)) {
        let done = self.frames;
        // A panic can leave the plan's state inconsistent: the plan does not run again.
        if catch_unwind(AssertUnwindSafe(|| self.run_plan(frames, each))).is_err() {
            self.state = LiveState::Panicked;
        }
        if matches!(self.state, LiveState::Panicked | LiveState::Finished) {
            let left = frames - (self.frames - done) as usize;
            self.run.ramp_down(left, FADE_S);
        } else if self.state == LiveState::Stopped && self.frames > done {
            // It stopped within this callback: the rest is zeros, so that the frame count stays right.
            self.run.ramp_down(frames - (self.frames - done) as usize, FADE_S);
        }
        self.run.publish_delivered();
    }

    fn run_plan(&mut self, frames: usize, each: &mut impl FnMut(&mut Run, usize)) {
        self.take_commands();
        if !self.stopping && self.stop.load(Ordering::Relaxed) {
            self.run.fade_out(FADE_S);
            self.stopping = true;
        }
        if self.state != LiveState::Running {
            return;
        }
        self.run.poll_rings();
        // WebAssembly has neither system devices nor a system clock.
        #[cfg(not(target_family = "wasm"))]
        self.poll_devices(std::time::Instant::now());
        if self.frames == 0 {
            self.run.begin_devices();
            // Inputs heard before the first frame open their gates at once.
            self.run.init_gates();
        }
        if self.follows_every == 0 || self.frames.is_multiple_of(self.follows_every) {
            self.run.follow_inputs(FADE_S);
        }
        let mut left = frames;
        while left > 0 && self.state == LiveState::Running {
            self.change_over();
            let block = left.min(self.block_now());
            if self.state != LiveState::Running || block == 0 {
                break;
            }
            let block = self.advance(block);
            self.frames += block as u64;
            self.rings.send(&self.run);
            each(&mut self.run, block);
            left -= block;
        }
        if let Some(log) = &mut self.log {
            log.note(&self.run, frames - left, self.stopping);
        }
    }

    /// Polls the devices. The frames until the next poll use the data that have arrived by `now`.
    #[cfg(not(target_family = "wasm"))]
    fn poll_devices(&mut self, now: std::time::Instant) {
        for device in 0..self.run.state.devices.len() {
            if self.run.poll_device(device, now) {
                self.run.restart_device(device, FADE_S);
                if let Some(log) = &mut self.log {
                    log.resume(device + 1);
                }
            }
        }
    }

    /// Runs up to `block` frames and returns how many.
    fn advance(&mut self, block: usize) -> usize {
        let Some(former) = &mut self.former else {
            match self.sampler.as_mut().is_some_and(CostSampler::is_due) {
                true => self.run.advance_timed(block),
                false => self.run.advance(block),
            }
            return block;
        };
        if former.run_together(&mut self.run)
            && let Some(former) = self.former.take()
        {
            self.retire(former);
        }
        1
    }

    /// Frames that may run now; 0 at the end of the run.
    fn block_now(&mut self) -> usize {
        let rate_hz = self.run.plan.driver_rate().hz();
        let block = self.run.plan.block.min(self.ramps.step(&mut self.run, rate_hz));
        let left = self.ends_after.map_or(u64::MAX, |end| end.saturating_sub(self.frames));
        if left == 0 {
            self.state = LiveState::Finished;
        }
        block.min(usize::try_from(left).unwrap_or(usize::MAX))
    }

    /// Checks for silent live inputs at multiples of `frames` driver frames instead of in every callback.
    pub(crate) fn follow_inputs_every(&mut self, frames: u64) {
        self.follows_every = frames;
    }

    /// Times some of its blocks from now on, step by step.
    pub(crate) fn sample_costs(&mut self) {
        self.sampler = Some(CostSampler::default());
    }

    /// Sets the end of the run, in driver frames from the start.
    pub fn end_after(&mut self, frames: u64) {
        self.ends_after = Some(frames);
    }

    /// Shares the heat of removed actuators with the other drivers: an actuator can move between drivers.
    pub(super) fn share_heat(&mut self, hottest: Arc<Hottest>) {
        self.hottest = hottest;
    }

    pub(super) fn send_taps_through(&mut self, rings: TapRings) {
        self.rings = rings;
    }

    pub(super) fn log_through(&mut self, log: ArrivalLog) {
        self.log = Some(log);
    }

    /// Callbacks missing at the end of the replay log.
    pub fn lost_arrivals(&self) -> u64 {
        self.log.as_ref().map_or(0, ArrivalLog::lost)
    }

    pub(super) fn run_mut(&mut self) -> &mut Run {
        &mut self.run
    }

    /// Numbers of tapped outputs lost because their rings were full.
    pub fn lost_numbers(&self) -> u64 {
        self.rings.lost()
    }

    /// Driver frames that the plan has run.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// True if the run has ended and every actuator is at zero.
    pub fn is_idle(&self) -> bool {
        match self.state {
            LiveState::Running => false,
            LiveState::Stopped => true,
            LiveState::Finished | LiveState::Panicked => self.run.is_ramped_down(FADE_S),
        }
    }

    /// Reports a wake-up; counts it as unreported if only the places of replaced plans are free.
    pub fn report(&mut self, wake: Wake) {
        let has_room = self.reports.slots() > OLD_PLANS;
        self.unreported += u64::from(!has_room || self.reports.push(Report::Wake(wake)).is_err());
    }

    /// State of the run.
    pub fn state(&self) -> LiveState {
        self.state
    }

    /// Number of reports lost because the ring was full.
    pub fn unreported(&self) -> u64 {
        self.unreported
    }

    /// Length of the longest block in driver frames.
    pub fn block(&self) -> usize {
        self.run.plan.block
    }

    /// The devices, for the driver that owns some of them.
    pub fn devices_mut(&mut self) -> impl Iterator<Item = &mut (dyn Device + 'static)> {
        self.run.devices_mut()
    }

    /// Fades in again after an interruption of the driver, during which time stood still.
    pub fn resume(&mut self) {
        if self.state == LiveState::Running {
            self.run.restart_from_zero(FADE_S);
            if let Some(log) = &mut self.log {
                log.resume(0);
            }
        }
    }

    /// The run.
    pub fn run(&self) -> &Run {
        &self.run
    }

    /// NaN and infinity at actuators so far.
    pub fn faults(&self) -> Faults {
        self.run.faults()
    }

    /// Limiter counts of each actuator sink.
    pub fn actuators(&self) -> impl Iterator<Item = ActuatorReport> {
        self.run.actuators()
    }

    fn take_commands(&mut self) {
        // A swap and the commands after it wait for the swap before.
        while self.next.is_none() {
            if self.former.is_some() && matches!(self.commands.peek(), Ok(Command::Swap(_))) {
                break;
            }
            match self.commands.pop() {
                Ok(Command::Set(ramp)) => {
                    if let Some(log) = &mut self.log {
                        log.set(self.run.driver_frames(), &ramp);
                    }
                    self.ramps.start(ramp, &mut self.run);
                }
                Ok(Command::Swap(next)) => self.begin_swap(next),
                Err(_) => break,
            }
        }
    }

    fn begin_swap(&mut self, mut next: Box<PlanSwap>) {
        match next.mode {
            SwapMode::InPlace => {
                next.take_over_in_place(&mut self.run);
                next.rings.take_over(&mut self.rings);
                self.retire(next);
                return;
            }
            SwapMode::CrossFade => {}
            SwapMode::FadeThroughZero(_) => self.run.fade_out(FADE_S),
        }
        if let Some(log) = &mut self.log {
            log.end();
        }
        self.next = Some(next);
    }

    /// Starts the pending swap or stops, when the present ramps and fades have ended.
    fn change_over(&mut self) {
        if !self.stopping
            && self.ramps.is_empty()
            && let Some(mut next) = self.next.take_if(|next| next.mode == SwapMode::CrossFade)
        {
            next.cross_fade(&mut self.run, FADE_S, &self.hottest);
            next.rings.take_over(&mut self.rings);
            self.former = Some(next);
        }
        if !self.run.is_silent() {
            return;
        }
        if self.stopping {
            self.state = LiveState::Stopped;
        } else if let Some(mut next) = self.next.take() {
            self.ramps.finish(&mut self.run);
            next.take_over(&mut self.run, &self.hottest);
            next.rings.take_over(&mut self.rings);
            self.run.fade_in(FADE_S);
            self.retire(next);
        }
    }

    /// Returns an old plan to the control side, which frees it. The ring has room for more than can be pending.
    fn retire(&mut self, old: Box<PlanSwap>) {
        if let Err(rtrb::PushError::Full(Report::Old(old))) = self.reports.push(Report::Old(old)) {
            // This thread must not free: the plan is leaked and counted.
            std::mem::forget(old);
            self.unreported += 1;
        }
    }
}

impl Run {
    /// Starts a fade-in from zero.
    pub(crate) fn fade_in(&mut self, seconds: f64) {
        let (begin, end) = self.fade_span(seconds);
        self.state.fade = FadeGate::Rising { begin, end };
    }

    /// Starts a fade-out from the present factor.
    pub(crate) fn fade_out(&mut self, seconds: f64) {
        if !matches!(self.state.fade, FadeGate::Falling { .. }) {
            let (begin, end) = self.fade_span(seconds);
            let from = self.state.fade.factor(begin);
            self.state.fade = FadeGate::Falling { begin, end, from };
        }
    }

    /// Fades in after an interruption without output; if the outputs were fading out, they stay at zero.
    pub(crate) fn restart_from_zero(&mut self, seconds: f64) {
        self.reset_limiters();
        // Whatever is there now is not what was armed.
        for device in &mut self.state.devices {
            if let Some(gate) = &mut device.gate {
                gate.close();
            }
        }
        if let FadeGate::Falling { .. } = self.state.fade {
            let (begin, end) = self.fade_span(0.0);
            self.state.fade = FadeGate::Falling { begin, end, from: 0.0 };
        } else {
            self.fade_in(seconds);
        }
    }

    /// Lets the actuators of a device rise from zero, and disarms them: its hardware was given zeros meanwhile.
    pub(crate) fn restart_device(&mut self, device: usize, seconds: f64) {
        let span = self.fade_span(seconds);
        for (actuator, ..) in &self.plan.devices[device].driven_by {
            let actuator = &mut self.state.actuators[*actuator];
            actuator.limiter.begin_from(&[0.0; 6]);
            actuator.gate.begin_from_zero(span);
        }
        if let Some(gate) = &mut self.state.devices[device].gate {
            gate.close();
        }
    }

    /// True if a fade-out has ended. The limits may make it longer.
    pub(crate) fn is_silent(&self) -> bool {
        self.state.fade.is_zero_from(self.state.windows.block().1) && self.is_idle()
    }

    pub(super) fn fade_span(&self, seconds: f64) -> (u64, u64) {
        let begin = self.state.windows.block().1;
        let units = (seconds * self.plan.base.units_per_second()).round().max(1.0) as u64;
        (begin, begin.saturating_add(units))
    }
}
