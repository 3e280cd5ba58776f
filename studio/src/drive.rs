//! Driver of the graph: a timer, a soundcard, or the caller, such as a page's audio thread.

use haptograph_engine::device::Device;
use haptograph_engine::run::{Driven, Player, PlayerState, Wake};
use haptograph_live::BackendEvent;
use haptograph_live::soundcard::{CardDriver, Request, SoundcardError};
#[cfg(not(target_family = "wasm"))]
use haptograph_live::timer::{Timer, TimerThread};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Polling period while a run ends.
const STEP: Duration = Duration::from_millis(2);
/// Delay above which a wake-up counts as late, s.
const LATE_S: f64 = 0.02;

/// State of the driver during a run.
#[derive(Debug, Default)]
pub(crate) struct Pace {
    end: AtomicBool,
    frames: AtomicU64,
    behind_us: AtomicU64,
    late: AtomicU64,
    busy_ns: AtomicU64,
    faults: AtomicU64,
    origin: OnceLock<Arc<str>>,
}

impl Pace {
    /// Number of driver frames.
    pub(crate) fn frames(&self) -> u64 {
        self.frames.load(Relaxed)
    }

    /// Delay of the latest wake-up, ms.
    pub(crate) fn behind_ms(&self) -> f64 {
        self.behind_us.load(Relaxed) as f64 * 1e-3
    }

    /// Number of late wake-ups.
    pub(crate) fn late(&self) -> u64 {
        self.late.load(Relaxed)
    }

    /// Number of ticks in which an actuator received NaN or infinity.
    pub(crate) fn faults(&self) -> u64 {
        self.faults.load(Relaxed)
    }

    /// Path of the first node found to output NaN or infinity.
    pub(crate) fn origin(&self) -> Option<&str> {
        self.origin.get().map(|origin| &**origin)
    }

    /// Takes the computing time since the last call.
    pub(crate) fn take_busy(&self) -> Duration {
        Duration::from_nanos(self.busy_ns.swap(0, Relaxed))
    }

    /// Notes the delay and the computing time of a wake-up.
    fn note(&self, wake: &Wake) {
        self.behind_us.store(wake.late_ns / 1000, Relaxed);
        let is_late = wake.late_ns as f64 > LATE_S * 1e9;
        self.late.fetch_add(u64::from(is_late), Relaxed);
        self.busy_ns.fetch_add(wake.work_ns, Relaxed);
    }

    fn update(&self, player: &Player) {
        self.frames.store(player.frames(), Relaxed);
        let faults = player.faults();
        self.faults.store(faults.ticks, Relaxed);
        if let Some(origin) = faults.origin.filter(|_| self.origin.get().is_none()) {
            let _ = self.origin.set(origin);
        }
    }
}

/// A driven player.
pub(crate) struct Drive {
    pub pace: Arc<Pace>,
    /// Locked while a timer that drives no real device computes frames.
    frame_lock: Arc<Mutex<()>>,
    /// `None` after the end.
    driver: Option<Driver>,
    /// Number of frames at the last call of [`Drive::keep_time`].
    kept_at: u64,
}

enum Driver {
    Caller(Box<Paced>),
    #[cfg(not(target_family = "wasm"))]
    Timer(TimerThread<Paced>),
    Card(Box<CardDriver<Paced>>),
}

/// A player with its pace.
struct Paced {
    player: Player,
    pace: Arc<Pace>,
    /// `Some` for a timer that drives no real device: every other driver waits for no other thread.
    frame_lock: Option<Arc<Mutex<()>>>,
}

impl Driven for Paced {
    fn rate_hz(&self) -> f64 {
        Driven::rate_hz(&self.player)
    }
    fn run_frames(&mut self, frames: usize) {
        let held = self.frame_lock.as_ref().map(|lock| lock.lock().unwrap_or_else(PoisonError::into_inner));
        self.player.process(frames);
        self.pace.update(&self.player);
        drop(held);
    }
    fn block(&self) -> usize {
        self.player.block()
    }
    fn is_idle(&self) -> bool {
        self.pace.end.load(Relaxed) || self.player.is_idle()
    }
    fn devices_mut(&mut self) -> impl Iterator<Item = &mut (dyn Device + 'static)> {
        self.player.devices_mut()
    }
    fn report(&mut self, wake: Wake) {
        self.pace.note(&wake);
        match self.frame_lock {
            None => self.player.report(wake),
            // A mutex is not fair: a page's command gets the lock only while this thread sleeps, and a timer that is
            // behind does not sleep by itself.
            Some(_) if u128::from(wake.late_ns) + u128::from(wake.work_ns) >= STEP.as_nanos() => {
                std::thread::sleep(STEP / 4);
            }
            // Without a real device, a cross-fade may take longer than real time.
            Some(_) => {}
        }
    }
    fn resume(&mut self) {
        self.player.resume();
    }
}

/// The driver of a player.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DrivenBy {
    /// A timer, at the rate of the graph's driver clock.
    Timer {
        /// True if the graph drives a real device.
        is_real: bool,
    },
    /// The caller, by [`Drive::process`].
    Caller,
}

/// The timer of a run without real devices: it wakes less often, and catches up after longer stalls.
#[cfg(not(target_family = "wasm"))]
fn easy_timer() -> Timer {
    let mut timer = Timer::default();
    (timer.wakes_hz, timer.spin) = (500.0, Duration::ZERO);
    (timer.stall, timer.is_real_time) = (Duration::from_millis(100), false);
    timer
}

impl Drive {
    /// Starts a player at the rate of its driver clock.
    pub(crate) fn start(player: Player, by: DrivenBy) -> std::io::Result<Self> {
        let (pace, frame_lock) = (Arc::new(Pace::default()), Arc::default());
        let is_locked = by == DrivenBy::Timer { is_real: false };
        let paced =
            Paced { player, pace: Arc::clone(&pace), frame_lock: is_locked.then(|| Arc::clone(&frame_lock)) };
        let driver = match by {
            DrivenBy::Caller => Driver::Caller(Box::new(paced)),
            #[cfg(target_family = "wasm")]
            DrivenBy::Timer { .. } => return Err(std::io::ErrorKind::Unsupported.into()),
            #[cfg(not(target_family = "wasm"))]
            DrivenBy::Timer { is_real } => {
                let timer = if is_real { Timer::default() } else { easy_timer() };
                Driver::Timer(timer.start(paced)?)
            }
        };
        Ok(Self { pace, frame_lock, driver: Some(driver), kept_at: 0 })
    }

    /// Opens a soundcard, whose callback runs the player.
    ///
    /// # Errors
    /// [`SoundcardError`] if there is no such card.
    pub(crate) fn start_by_card(player: Player, request: Request) -> Result<Self, SoundcardError> {
        let pace = Arc::new(Pace::default());
        let paced = Paced { player, pace: Arc::clone(&pace), frame_lock: None };
        let card = Driver::Card(Box::new(CardDriver::start(request, paced)?));
        Ok(Self { pace, frame_lock: Arc::default(), driver: Some(card), kept_at: 0 })
    }

    /// Polls the soundcard that drives the player; returns its notes.
    pub(crate) fn poll(&mut self) -> Vec<BackendEvent> {
        match &mut self.driver {
            Some(Driver::Card(card)) => card.poll(),
            _ => Vec::new(),
        }
    }

    /// What the system refused the timer that drives a real device, and how to grant it, one sentence each.
    pub(crate) fn refused(&self) -> &[String] {
        match &self.driver {
            #[cfg(not(target_family = "wasm"))]
            Some(Driver::Timer(thread)) => &thread.notes.refused,
            _ => &[],
        }
    }

    fn driving_card(&self) -> Option<&CardDriver<Paced>> {
        match &self.driver {
            Some(Driver::Card(card)) => Some(card),
            _ => None,
        }
    }

    /// True if the run has ended.
    pub(crate) fn is_over(&self) -> bool {
        match &self.driver {
            Some(Driver::Caller(paced)) => paced.player.state() != PlayerState::Running,
            #[cfg(not(target_family = "wasm"))]
            Some(Driver::Timer(thread)) => thread.is_finished(),
            Some(Driver::Card(card)) => card.is_finished(),
            None => true,
        }
    }

    /// True if the soundcard that drives the player is gone and may come back.
    pub(crate) fn is_waiting(&self) -> bool {
        self.driving_card().is_some_and(CardDriver::is_waiting)
    }

    /// Name of the soundcard that drives the player.
    pub(crate) fn card(&self) -> Option<&str> {
        self.driving_card().map(|card| &*card.got().card)
    }

    /// Number of under- and overruns of the soundcard that drives the player.
    pub(crate) fn xruns(&self) -> Option<u64> {
        self.driving_card().map(|card| card.counts().xruns)
    }

    /// True if the caller drives the player.
    pub(crate) fn is_the_callers(&self) -> bool {
        matches!(self.driver, Some(Driver::Caller(_)))
    }

    /// Calls `work` between two frames with the number of the second. A timer or card that drives a real device does
    /// not wait for it: frames may be computed meanwhile, and the number is exact to within a block.
    pub(crate) fn between_frames<T>(&self, work: impl FnOnce(u64) -> T) -> T {
        let _held = self.frame_lock.lock().unwrap_or_else(PoisonError::into_inner);
        work(self.pace.frames())
    }

    /// Runs `frames` frames if the caller drives the player. Real-time code.
    pub(crate) fn process(&mut self, frames: usize) {
        if let Some(Driver::Caller(paced)) = &mut self.driver {
            paced.run_frames(frames);
        }
    }

    /// Updates the timing if the caller drives: wall-clock time and computing time since the last call.
    pub(crate) fn keep_time(&mut self, passed: Duration, busy: Duration, rate_hz: f64) {
        let frames = self.pace.frames() - self.kept_at;
        self.kept_at += frames;
        let late_s = (passed.as_secs_f64() - frames as f64 / rate_hz).max(0.0);
        self.pace.note(&Wake {
            late_ns: (late_s * 1e9) as u64,
            work_ns: busy.as_nanos() as u64,
            frames: frames as u32,
            lost: 0,
            overrun: busy > passed,
        });
    }

    /// Waits until a run driven by a timer or a soundcard is over; false if `longest` has passed.
    pub(crate) fn is_done_within(&mut self, longest: Duration) -> bool {
        // A page has no clock to wait by.
        if self.is_the_callers() {
            return self.is_over();
        }
        let asked = Instant::now();
        // A card that is gone ends nothing.
        while !self.is_over() && !self.is_waiting() && asked.elapsed() < longest {
            std::thread::sleep(STEP);
            self.poll();
        }
        self.is_over() || self.is_waiting()
    }

    /// Ends the driver; returns the player unless its thread panicked.
    pub(crate) fn join(mut self) -> Option<Player> {
        self.pace.end.store(true, Relaxed);
        let paced = match self.driver.take()? {
            Driver::Caller(paced) => Some(*paced),
            #[cfg(not(target_family = "wasm"))]
            Driver::Timer(thread) => thread.join(),
            Driver::Card(card) => card.join(),
        };
        Some(paced?.player)
    }
}

impl Drop for Drive {
    fn drop(&mut self) {
        self.pace.end.store(true, Relaxed);
    }
}
