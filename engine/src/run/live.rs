//! A plan that runs against a clock, and is changed while it runs.
//!
//! The real-time side is [`Live`]: a driver calls [`Live::callback`] with the frames that are due. The other side is
//! [`Control`]. Between them are rings only: commands one way, reports and what is to be freed the other. Architecture
//! invariant: nothing is allocated, freed or locked in a callback.

use super::arrivals::ArrivalLog;
use super::control::{COMMANDS, Command, Control, Report};
use super::cost::CostSampler;
use super::drive::Drive;
use super::glide::Glides;
use super::meter::Wake;
use super::rings::TapRings;
use super::swap::{Next, SwapMode};
use super::{ActuatorReport, Faults, Run};
use crate::device::Device;
use crate::limiter::Hottest;
use crate::plan::Plan;
use rtrb::{Consumer, Producer, RingBuffer};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// How long outputs take from nothing to everything and back, unless told otherwise.
pub const FADE_S: f64 = 0.01;
const REPORTS: usize = 4096;
/// The real-time side of a live run.
pub struct Live {
    run: Run,
    /// Takes over when no setting is on its way, or when the fade has reached zero.
    next: Option<Box<Next>>,
    /// The plan before, while this one rises over it.
    former: Option<Box<Next>>,
    /// Looked at in every callback: a stop waits for nobody.
    stop: Arc<AtomicBool>,
    stopping: bool,
    state: LiveState,
    /// Driver frames run by the plan, and after how many it ends.
    frames: u64,
    ends_after: Option<u64>,
    /// Of those, after how many it looks again whether its live inputs are heard; 0: in every callback.
    follows_every: u64,
    glides: Glides,
    rings: TapRings,
    /// Where what it sees of its rings is kept.
    log: Option<ArrivalLog>,
    commands: Consumer<Command>,
    reports: Producer<Report>,
    unreported: u64,
    /// Which blocks are timed; none unless that was asked for.
    sampler: Option<CostSampler>,
    /// What the actuators that left the run were given.
    hottest: Arc<Hottest>,
}

/// What a live run is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LiveState {
    /// Running.
    Running,
    /// Faded out after a stop; nothing more will come.
    Stopped,
    /// Its time is over; the actuators were taken to zero and stay there.
    Finished,
    /// A node panicked; the actuators were taken to zero and stay there.
    Panicked,
}

/// Both sides of a live run of `plan`. It begins as it does offline, so that the samples are the same.
pub fn live(plan: Arc<Plan>) -> (Live, Control) {
    live_until(plan, Arc::default())
}

/// The same, with the flag that stops it.
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
        glides: Glides::with_room_for(COMMANDS),
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
    /// Runs `frames` driver frames, in blocks of at most the plan's; `each` sees every block when it is done.
    ///
    /// A panic in a node ends here, in whatever it was asked to do: the actuators are taken to zero by the engine
    /// itself, outside the plan. A device that panics even then is driven no more.
    pub fn callback(&mut self, frames: usize, mut each: impl FnMut(&mut Run, usize)) {
        let done = self.frames;
        // The plan's state may be half-way through a tick afterwards; it is never run again.
        if catch_unwind(AssertUnwindSafe(|| self.run_plan(frames, &mut each))).is_err() {
            self.state = LiveState::Panicked;
        }
        if matches!(self.state, LiveState::Panicked | LiveState::Finished) {
            let left = frames - (self.frames - done) as usize;
            self.run.ramp_down(left, FADE_S);
        } else if self.state == LiveState::Stopped && self.frames > done {
            // It stopped within this callback: the rest of it is zeros, so that nothing is shifted.
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
        self.run.look();
        // A page has neither devices of a system nor its clock.
        #[cfg(not(target_family = "wasm"))]
        self.run.look_at_devices(std::time::Instant::now());
        if self.frames == 0 {
            self.run.begin_devices();
            // What was heard before the first frame is let through at once.
            self.run.meet_inputs();
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

    /// Runs up to `block` frames, and says how many.
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

    /// Frames that may be run now; none when the time is over.
    fn block_now(&mut self) -> usize {
        let rate_hz = self.run.plan.driver_rate().hz();
        let block = self.run.plan.block.min(self.glides.step(&mut self.run, rate_hz));
        let left = self
            .ends_after
            .map_or(u64::MAX, |end| end.saturating_sub(self.frames));
        if left == 0 {
            self.state = LiveState::Finished;
        }
        block.min(usize::try_from(left).unwrap_or(usize::MAX))
    }

    /// Looks whether its live inputs are heard at every multiple of so many driver frames, not in every callback.
    pub(crate) fn follow_inputs_every(&mut self, frames: u64) {
        self.follows_every = frames;
    }

    /// Times some of its blocks from now on, step by step.
    pub(crate) fn sample_costs(&mut self) {
        self.sampler = Some(CostSampler::default());
    }

    /// Ends after so many driver frames from the start.
    pub fn end_after(&mut self, frames: u64) {
        self.ends_after = Some(frames);
    }

    /// Of several drivers: an actuator may leave one and come to another.
    pub(super) fn share_heat(&mut self, hottest: Arc<Hottest>) {
        self.hottest = hottest;
    }

    pub(super) fn send_taps_through(&mut self, rings: TapRings) {
        self.rings = rings;
    }

    pub(super) fn log_through(&mut self, log: ArrivalLog) {
        self.log = Some(log);
    }

    /// Callbacks at the end that are missing in what a replay goes by.
    pub fn lost_arrivals(&self) -> u64 {
        self.log.as_ref().map_or(0, ArrivalLog::lost)
    }

    pub(super) fn run_mut(&mut self) -> &mut Run {
        &mut self.run
    }

    /// Numbers of tapped outputs that found no room on their way to the files.
    pub fn lost_numbers(&self) -> u64 {
        self.rings.lost()
    }

    /// Driver frames that the plan has run.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Has everything ended, and is nothing driven any more?
    pub fn is_at_rest(&self) -> bool {
        match self.state {
            LiveState::Running => false,
            LiveState::Stopped => true,
            LiveState::Finished | LiveState::Panicked => self.run.is_ramped_down(FADE_S),
        }
    }

    /// Reports a wake-up; what finds no room is counted.
    pub fn report(&mut self, wake: Wake) {
        self.unreported += u64::from(self.reports.push(Report::Wake(wake)).is_err());
    }

    /// What the run is doing.
    pub fn state(&self) -> LiveState {
        self.state
    }

    /// Reports that found no room.
    pub fn unreported(&self) -> u64 {
        self.unreported
    }

    /// Driver frames of the longest block.
    pub fn block(&self) -> usize {
        self.run.plan.block
    }

    /// The devices, for the driver that some of them belong to.
    pub fn devices_mut(&mut self) -> impl Iterator<Item = &mut (dyn Device + 'static)> {
        self.run.devices_mut()
    }

    /// Lets the outputs rise from nothing again: time stood still, as the driver was away.
    pub fn resume(&mut self) {
        if self.state == LiveState::Running {
            self.run.go_on_from_nothing(FADE_S);
        }
    }

    /// The run, for what is asked when it is over.
    pub fn run(&self) -> &Run {
        &self.run
    }

    /// What was seen of signals that are not numbers.
    pub fn faults(&self) -> Faults {
        self.run.faults()
    }

    /// What each actuator sink held back.
    pub fn actuators(&self) -> impl Iterator<Item = ActuatorReport> {
        self.run.actuators()
    }

    fn take_commands(&mut self) {
        // A swap waits for the one before it, and so do the commands after it.
        while self.next.is_none() {
            if self.former.is_some() && matches!(self.commands.peek(), Ok(Command::Swap(_))) {
                break;
            }
            match self.commands.pop() {
                Ok(Command::Set(glide)) => {
                    if let Some(log) = &mut self.log {
                        log.set(self.run.driver_frames(), &glide);
                    }
                    self.glides.start(glide, &mut self.run);
                }
                Ok(Command::Swap(mut next)) if next.mode == SwapMode::InPlace => {
                    next.take_over_everything(&mut self.run);
                    next.rings.take_over(&mut self.rings);
                    self.retire(next);
                }
                Ok(Command::Swap(next)) => {
                    if let Some(log) = &mut self.log {
                        log.end();
                    }
                    if next.mode != SwapMode::CrossFade {
                        self.run.fade_out(FADE_S);
                    }
                    self.next = Some(next);
                }
                Err(_) => break,
            }
        }
    }

    /// Puts the next plan in the place of this one, or stops, when it is time to.
    fn change_over(&mut self) {
        if !self.stopping
            && self.glides.is_empty()
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
            self.glides.arrive(&mut self.run);
            next.take_over(&mut self.run, &self.hottest);
            next.rings.take_over(&mut self.rings);
            self.run.fade_in(FADE_S);
            self.retire(next);
        }
    }

    /// Sends an old plan home. The ring has room for many more than can be under way.
    fn retire(&mut self, old: Box<Next>) {
        if let Err(rtrb::PushError::Full(Report::Old(old))) = self.reports.push(Report::Old(old)) {
            // Not freed here: freeing is not for this thread. It is leaked, once, and counted.
            std::mem::forget(old);
            self.unreported += 1;
        }
    }
}

impl Run {
    /// Lets the outputs rise from nothing, from now on.
    pub(crate) fn fade_in(&mut self, seconds: f64) {
        let (begin, end) = self.fade_span(seconds);
        self.state.drive = Drive::Rising { begin, end };
    }

    /// Lets the outputs fall to nothing, from now on and from where they are.
    pub(crate) fn fade_out(&mut self, seconds: f64) {
        if !matches!(self.state.drive, Drive::Falling { .. }) {
            let (begin, end) = self.fade_span(seconds);
            let from = self.state.drive.factor(begin);
            self.state.drive = Drive::Falling { begin, end, from };
        }
    }

    /// After time stood still and nothing was driven: the outputs rise again, or stay at nothing if they were falling.
    pub(crate) fn go_on_from_nothing(&mut self, seconds: f64) {
        self.begin_at_rest();
        if let Drive::Falling { .. } = self.state.drive {
            let (begin, end) = self.fade_span(0.0);
            self.state.drive = Drive::Falling {
                begin,
                end,
                from: 0.0,
            };
        } else {
            self.fade_in(seconds);
        }
    }

    /// Has a fade-out come to its end, as fast as the limits let it?
    pub(crate) fn is_silent(&self) -> bool {
        self.state.drive.is_zero_from(self.state.windows.block().1) && self.rests()
    }

    pub(super) fn fade_span(&self, seconds: f64) -> (u64, u64) {
        let begin = self.state.windows.block().1;
        let units = (seconds * self.plan.base.units_per_second()).round().max(1.0) as u64;
        (begin, begin.saturating_add(units))
    }
}
