//! The real-time half of a session: a plan that runs against a clock and can be changed while it runs.
//!
//! A clock calls [`Player::process`] with the frames that are due: a driver, the caller, or virtual time. The half that may
//! block is [`Session`](super::Session). Rings connect them: commands one way; reports and plans to be freed the other.
//! Invariant: a call does not allocate, free or lock.

use super::arrivals::ArrivalLog;
use super::control::{COMMANDS, Command, Control, Report};
use super::cost::CostSampler;
use super::fade::FADE_S;
use super::meter::Wake;
use super::ramp::{ParamRamp, ParamRamps};
use super::rings::TapRings;
use super::swap::{PlanSwap, SwapMode};
use super::{ActuatorReport, Faults, Run};
use crate::device::Device;
use crate::limiter::Hottest;
use crate::plan::Plan;
use rtrb::{Consumer, Producer, RingBuffer};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

const REPORTS: usize = 4096;
/// Places among them for replaced plans, which must not be lost.
const OLD_PLANS: usize = 64;

/// The real-time half of a session: it runs the plan of one driver.
pub struct Player {
    run: Run,
    state: PlayerState,
    /// Driver frames run by the plan.
    frames: u64,
    ending: Ending,
    /// Interval in driver frames at which it checks whether its live inputs are silent; 0: in every call.
    follows_every: u64,
    ramps: ParamRamps,
    swaps: Swaps,
    listeners: Listeners,
    link: Link,
    _claim: Option<Arc<Claim>>,
}

/// State of a player.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlayerState {
    /// Running.
    Running,
    /// Stopped after the fade-out.
    Stopped,
    /// The duration is over; the actuators ramp to zero and stay there.
    Finished,
    /// A node panicked; the actuators ramp to zero and stay there.
    Panicked,
}

/// When the run ends.
struct Ending {
    /// Polled in every call, so that a stop takes effect at once.
    stop: Arc<AtomicBool>,
    is_stopping: bool,
    after_frames: Option<u64>,
}

/// The plans that take over.
#[derive(Default)]
struct Swaps {
    /// The next plan. It takes over when no setting ramps, or when the fade has reached zero.
    next: Option<Box<PlanSwap>>,
    /// The former plan during a cross-fade.
    former: Option<Box<PlanSwap>>,
    /// Heat of the actuators that left the run.
    hottest: Arc<Hottest>,
}

/// What listens to the blocks.
#[derive(Default)]
struct Listeners {
    taps: TapRings,
    log: Option<ArrivalLog>,
    /// Selection of the blocks that are timed; `None` if none is.
    sampler: Option<CostSampler>,
}

/// The ends of the rings to the session.
struct Link {
    commands: Consumer<Command>,
    reports: Producer<Report>,
    unreported: u64,
    progress: Arc<Progress>,
}

/// What the session may read at any moment.
#[derive(Default)]
pub(super) struct Progress {
    frames: AtomicU64,
    fault_ticks: AtomicU64,
    fault_origin: OnceLock<Arc<str>>,
}

impl Progress {
    fn publish(&self, frames: u64, faults: &Faults) {
        self.frames.store(frames, Ordering::Relaxed);
        self.fault_ticks.store(faults.ticks, Ordering::Relaxed);
        if let Some(origin) = faults.origin.as_ref().filter(|_| self.fault_origin.get().is_none()) {
            // No other thread sets it.
            let _ = self.fault_origin.set(Arc::clone(origin));
        }
    }

    /// Driver frames run.
    pub(super) fn frames(&self) -> u64 {
        self.frames.load(Ordering::Relaxed)
    }

    /// NaN and infinity at actuators so far.
    pub(super) fn faults(&self) -> Faults {
        Faults {
            ticks: self.fault_ticks.load(Ordering::Relaxed),
            origin: self.fault_origin.get().cloned(),
            tracing: false,
        }
    }
}

/// Flags that are cleared when the player is dropped.
#[derive(Default)]
pub(crate) struct Claim(Mutex<Vec<Arc<AtomicBool>>>);

impl Claim {
    fn flags(&self) -> MutexGuard<'_, Vec<Arc<AtomicBool>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets a flag and keeps it. Returns whether that was possible: nobody else has set it.
    pub(crate) fn take(&self, flag: Arc<AtomicBool>) -> bool {
        let is_free = !flag.swap(true, Ordering::AcqRel);
        if is_free {
            self.flags().push(flag);
        }
        is_free
    }

    pub(crate) fn has(&self, flag: &Arc<AtomicBool>) -> bool {
        self.flags().iter().any(|known| Arc::ptr_eq(known, flag))
    }

    /// Keeps the flags of another claim as well.
    pub(crate) fn add(&self, other: &Self) {
        self.flags().append(&mut other.flags());
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.flags().iter().for_each(|flag| flag.store(false, Ordering::Release));
    }
}

/// Makes both halves of a run of `plan`, without files. It starts without a fade, so that its samples equal an offline
/// run's.
pub fn player(plan: Arc<Plan>) -> (Player, Control) {
    player_until(plan, Arc::default())
}

/// As [`player`], with the flag that stops it.
pub(super) fn player_until(plan: Arc<Plan>, stop: Arc<AtomicBool>) -> (Player, Control) {
    let (command_in, commands) = RingBuffer::new(COMMANDS);
    let (reports, report_out) = RingBuffer::new(REPORTS);
    let progress = Arc::<Progress>::default();
    let player = Player {
        run: Run::new(Arc::clone(&plan)),
        state: PlayerState::Running,
        frames: 0,
        ending: Ending { stop: Arc::clone(&stop), is_stopping: false, after_frames: None },
        follows_every: 0,
        ramps: ParamRamps::with_room_for(COMMANDS),
        swaps: Swaps::default(),
        listeners: Listeners::default(),
        link: Link { commands, reports, unreported: 0, progress: Arc::clone(&progress) },
        _claim: None,
    };
    let control = Control::new(plan, stop, (command_in, report_out), progress);
    (player, control)
}

impl Player {
    /// Runs `frames` frames of the driver. Real-time code: it does not allocate, lock, make system calls or panic.
    /// Queued inputs are taken at the ticks at which they are due; outputs and probes have their frames afterwards.
    ///
    /// Catches a panic of a node: the engine then ramps the actuators to zero, outside the plan. A device that panics
    /// during this ramp receives no further output.
    pub fn process(&mut self, frames: usize) {
        self.process_with(frames, |_, _| {});
    }

    /// As [`process`](Self::process), in blocks of at most the plan's block; calls `each` after every block.
    pub fn process_with(&mut self, frames: usize, mut each: impl FnMut(&mut Run, usize)) {
        self.begin();
        self.process_in_quantum(frames, &mut each);
    }

    /// Runs frames after [`begin`](Self::begin): the frames that other drivers send meanwhile count later.
    pub(super) fn process_in_quantum(&mut self, frames: usize, each: &mut impl FnMut(&mut Run, usize)) {
        let mut left = frames;
        loop {
            let part = match self.follows_every {
                0 => left,
                every => left.min((every - self.frames % every) as usize),
            };
            self.guarded(|player| {
                player.obey();
                player.hear();
            });
            self.run_due(part, each);
            left -= part;
            if left == 0 {
                break;
            }
        }
    }

    /// Catches a panic. It can leave the plan's state inconsistent: the plan does not run again.
    fn guarded(&mut self, work: impl FnOnce(&mut Self)) {
        if catch_unwind(AssertUnwindSafe(|| work(self))).is_err() {
            self.state = PlayerState::Panicked;
        }
    }

    /// Takes the commands, and the frames that other drivers have sent by now.
    pub(super) fn begin(&mut self) {
        self.guarded(|player| {
            player.obey();
            if player.state == PlayerState::Running {
                player.run.poll_rings();
            }
        });
    }

    /// Takes the commands.
    fn obey(&mut self) {
        self.take_commands();
        if !self.ending.is_stopping && self.ending.stop.load(Ordering::Relaxed) {
            self.run.fade_out(FADE_S);
            self.ending.is_stopping = true;
        }
    }

    /// Takes what live inputs have delivered by now.
    fn hear(&mut self) {
        if self.state != PlayerState::Running {
            return;
        }
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
    }

    /// Runs the frames that are due after [`begin`](Self::begin).
    pub(super) fn run_due(&mut self, frames: usize, each: &mut impl FnMut(&mut Run, usize)) {
        let done = self.frames;
        self.guarded(|player| player.run_plan(frames, each));
        let left = frames - (self.frames - done) as usize;
        match self.state {
            PlayerState::Panicked | PlayerState::Finished => self.run.ramp_down(left, FADE_S),
            // It stopped within this call: the rest is zeros, so that the frame count stays right.
            PlayerState::Stopped if self.frames > done => self.run.ramp_down(left, FADE_S),
            PlayerState::Stopped | PlayerState::Running => {}
        }
        self.run.publish_delivered();
        self.link.progress.publish(self.frames, &self.run.state.faults.counts);
    }

    fn run_plan(&mut self, frames: usize, each: &mut impl FnMut(&mut Run, usize)) {
        if self.state != PlayerState::Running {
            return;
        }
        let mut left = frames;
        while left > 0 && self.state == PlayerState::Running {
            self.change_over();
            let block = left.min(self.block_now());
            if self.state != PlayerState::Running || block == 0 {
                break;
            }
            let block = self.advance(block);
            self.frames += block as u64;
            self.listeners.taps.send(&self.run);
            each(&mut self.run, block);
            left -= block;
        }
        if let Some(log) = &mut self.listeners.log {
            log.note(&self.run, frames - left, self.ending.is_stopping);
        }
    }

    /// Polls the devices. The frames until the next poll use the data that have arrived by `now`.
    #[cfg(not(target_family = "wasm"))]
    fn poll_devices(&mut self, now: std::time::Instant) {
        for device in 0..self.run.state.devices.len() {
            if self.run.poll_device(device, now) {
                self.run.restart_device(device, FADE_S);
                if let Some(log) = &mut self.listeners.log {
                    log.resume(device + 1);
                }
            }
        }
    }

    /// Runs up to `block` frames and returns how many.
    fn advance(&mut self, block: usize) -> usize {
        let Some(former) = &mut self.swaps.former else {
            match self.listeners.sampler.as_mut().is_some_and(CostSampler::is_due) {
                true => self.run.advance_timed(block),
                false => self.run.advance(block),
            }
            return block;
        };
        if former.run_together(&mut self.run)
            && let Some(former) = self.swaps.former.take()
        {
            self.retire(former);
        }
        1
    }

    /// Frames that may run now; 0 at the end of the run.
    fn block_now(&mut self) -> usize {
        let rate_hz = self.run.plan.driver_rate().hz();
        let block = self.run.plan.block.min(self.ramps.step(&mut self.run, rate_hz));
        let left = self.ending.after_frames.map_or(u64::MAX, |end| end.saturating_sub(self.frames));
        if left == 0 {
            self.state = PlayerState::Finished;
        }
        block.min(usize::try_from(left).unwrap_or(usize::MAX))
    }

    /// Checks for silent live inputs at multiples of `frames` driver frames instead of in every callback.
    pub(crate) fn follow_inputs_every(&mut self, frames: u64) {
        self.follows_every = frames;
    }

    /// Times some of its blocks from now on, step by step.
    pub(crate) fn sample_costs(&mut self) {
        self.listeners.sampler = Some(CostSampler::new());
    }

    /// Sets the end of the run, in driver frames from the start.
    pub fn end_after(&mut self, frames: u64) {
        self.ending.after_frames = Some(frames);
    }

    /// Ends the run after `seconds` of its driver's time.
    pub(super) fn end_after_seconds(&mut self, seconds: f64) {
        self.end_after((seconds * self.run.rate_hz()).round().max(0.0) as u64);
    }

    /// Frames of the plan after which the run ends; `None` if it has no end of its own.
    pub(super) fn end(&self) -> Option<u64> {
        self.ending.after_frames
    }

    /// Keeps a claim until it is dropped.
    pub(crate) fn hold(&mut self, claim: Arc<Claim>) {
        self._claim = Some(claim);
    }

    /// Starts a ramp of a setting at the next frame.
    pub(super) fn start_ramp(&mut self, ramp: ParamRamp) {
        self.ramps.start(ramp, &mut self.run);
    }

    /// Shares the heat of removed actuators with the other drivers: an actuator can move between drivers.
    pub(super) fn share_heat(&mut self, hottest: Arc<Hottest>) {
        self.swaps.hottest = hottest;
    }

    pub(super) fn send_taps_through(&mut self, rings: TapRings) {
        self.listeners.taps = rings;
    }

    pub(super) fn log_through(&mut self, log: ArrivalLog) {
        self.listeners.log = Some(log);
    }

    /// Callbacks missing at the end of the replay log.
    pub(super) fn lost_arrivals(&self) -> u64 {
        self.listeners.log.as_ref().map_or(0, ArrivalLog::lost)
    }

    pub(super) fn run_mut(&mut self) -> &mut Run {
        &mut self.run
    }

    /// Numbers of tapped outputs lost because their rings were full.
    pub(super) fn lost_numbers(&self) -> u64 {
        self.listeners.taps.lost()
    }

    /// Driver frames that the plan has run.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// True if the run has ended and every actuator is at zero.
    pub fn is_idle(&self) -> bool {
        match self.state {
            PlayerState::Running => false,
            PlayerState::Stopped => true,
            PlayerState::Finished | PlayerState::Panicked => self.run.is_ramped_down(FADE_S),
        }
    }

    /// Reports a wake-up; counts it as unreported if only the places of replaced plans are free.
    pub fn report(&mut self, wake: Wake) {
        let has_room = self.link.reports.slots() > OLD_PLANS;
        self.link.unreported += u64::from(!has_room || self.link.reports.push(Report::Wake(wake)).is_err());
    }

    /// State of the run.
    pub fn state(&self) -> PlayerState {
        self.state
    }

    /// Number of reports lost because the ring was full.
    pub fn unreported(&self) -> u64 {
        self.link.unreported
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
        if self.state == PlayerState::Running {
            self.run.restart_from_zero(FADE_S);
            if let Some(log) = &mut self.listeners.log {
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
        while self.swaps.next.is_none() {
            if self.swaps.former.is_some() && matches!(self.link.commands.peek(), Ok(Command::Swap(_))) {
                break;
            }
            match self.link.commands.pop() {
                Ok(Command::Set(ramp)) => {
                    if let Some(log) = &mut self.listeners.log {
                        log.set(self.run.driver_frames(), &ramp);
                    }
                    self.start_ramp(ramp);
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
                next.rings.take_over(&mut self.listeners.taps);
                self.retire(next);
                return;
            }
            SwapMode::CrossFade => {}
            SwapMode::FadeThroughZero(_) => self.run.fade_out(FADE_S),
        }
        if let Some(log) = &mut self.listeners.log {
            log.end();
        }
        self.swaps.next = Some(next);
    }

    /// Starts the pending swap or stops, when the present ramps and fades have ended.
    fn change_over(&mut self) {
        if !self.ending.is_stopping
            && self.ramps.are_over(self.run.driver_frames())
            && let Some(mut next) = self.swaps.next.take_if(|next| next.mode == SwapMode::CrossFade)
        {
            self.ramps.finish(&mut self.run);
            next.cross_fade(&mut self.run, FADE_S, &self.swaps.hottest);
            next.rings.take_over(&mut self.listeners.taps);
            self.swaps.former = Some(next);
        }
        if !self.run.is_silent() {
            return;
        }
        if self.ending.is_stopping {
            self.state = PlayerState::Stopped;
        } else if let Some(mut next) = self.swaps.next.take() {
            self.ramps.finish(&mut self.run);
            next.take_over(&mut self.run, &self.swaps.hottest);
            next.rings.take_over(&mut self.listeners.taps);
            self.run.fade_in(FADE_S);
            self.retire(next);
        }
    }

    /// Returns an old plan to the control side, which frees it. The ring has room for more than can be pending.
    fn retire(&mut self, old: Box<PlanSwap>) {
        if let Err(rtrb::PushError::Full(Report::Old(old))) = self.link.reports.push(Report::Old(old)) {
            // This thread must not free: the plan is leaked and counted.
            std::mem::forget(old);
            self.link.unreported += 1;
        }
    }
}
