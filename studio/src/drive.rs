//! Driver of the graph: a real-time thread, or the caller, such as a page's audio thread.

use haptograph_engine::device::Device;
use haptograph_engine::host::Player;
use haptograph_engine::run::{Driven, LiveState, Wake};
use haptograph_live::BackendEvent;
use haptograph_live::soundcard::{CardDriver, Request, SoundcardError};
#[cfg(not(target_family = "wasm"))]
use haptograph_live::timer::Timer;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Polling period while a run ends.
const STEP: Duration = Duration::from_millis(2);
/// Delay above which a wake-up counts as late, s.
const LATE_S: f64 = 0.02;

/// Timing of a driver thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Timing {
    /// Wake-up period.
    step: Duration,
    /// Maximum delay that is caught up; a longer delay is dropped.
    max_behind: Duration,
    is_real_time: bool,
}

impl Timing {
    /// For a run without real devices.
    pub const EASY: Self =
        Self { step: Duration::from_millis(2), max_behind: Duration::from_millis(100), is_real_time: false };
    /// For real devices: like the timer of a live run, without a burst after a stall.
    pub const STRICT: Self =
        Self { step: Duration::from_millis(1), max_behind: Duration::from_millis(20), is_real_time: true };
}

/// State of the driver during a run.
#[derive(Debug, Default)]
pub struct Pace {
    end: AtomicBool,
    is_over: AtomicBool,
    frames: AtomicU64,
    behind_us: AtomicU64,
    late: AtomicU64,
    busy_ns: AtomicU64,
    faults: AtomicU64,
    origin: OnceLock<Arc<str>>,
}

impl Pace {
    /// Number of driver frames.
    pub fn frames(&self) -> u64 {
        self.frames.load(Relaxed)
    }

    /// Delay of the latest wake-up, ms.
    pub fn behind_ms(&self) -> f64 {
        self.behind_us.load(Relaxed) as f64 * 1e-3
    }

    /// Number of late wake-ups.
    pub fn late(&self) -> u64 {
        self.late.load(Relaxed)
    }

    /// Number of ticks in which an actuator received NaN or infinity.
    pub fn faults(&self) -> u64 {
        self.faults.load(Relaxed)
    }

    /// Path of the first node found to output NaN or infinity.
    pub fn origin(&self) -> Option<&str> {
        self.origin.get().map(|origin| &**origin)
    }

    /// Takes the computing time since the last call.
    pub fn take_busy(&self) -> Duration {
        Duration::from_nanos(self.busy_ns.swap(0, Relaxed))
    }

    fn update(&self, player: &Player) {
        self.frames.store(player.frames(), Relaxed);
        let faults = player.faults();
        self.faults.store(faults.ticks, Relaxed);
        if let Some(origin) = faults.origin.filter(|_| self.origin.get().is_none()) {
            let _ = self.origin.set(origin);
        }
    }

    /// True if the run has ended.
    pub fn is_over(&self) -> bool {
        self.is_over.load(Relaxed)
    }
}

/// A driven player.
pub struct Drive {
    pub pace: Arc<Pace>,
    /// Locked while frames are computed.
    frame_lock: Arc<Mutex<()>>,
    runner: Runner,
    /// Number of frames at the last call of [`Drive::keep_time`].
    kept_at: u64,
}

enum Runner {
    Thread(Option<JoinHandle<Player>>),
    Caller(Box<Player>),
    Card(Box<CardDriver<Paced>>),
}

/// A player driven by a soundcard, with its state. Its callback takes no lock.
struct Paced {
    player: Player,
    pace: Arc<Pace>,
}

impl Driven for Paced {
    fn run_frames(&mut self, frames: usize) {
        self.player.process(frames);
        self.pace.update(&self.player);
    }
    fn block(&self) -> usize {
        Driven::block(&self.player)
    }
    fn is_idle(&self) -> bool {
        self.player.is_idle()
    }
    fn devices_mut(&mut self) -> impl Iterator<Item = &mut (dyn Device + 'static)> {
        self.player.devices_mut()
    }
    fn report(&mut self, wake: Wake) {
        self.pace.behind_us.store(wake.late_ns / 1000, Relaxed);
        let is_late = wake.late_ns as f64 > LATE_S * 1e9;
        self.pace.late.fetch_add(u64::from(is_late), Relaxed);
        self.pace.busy_ns.fetch_add(wake.work_ns, Relaxed);
        self.player.report(wake);
    }
    fn resume(&mut self) {
        self.player.resume();
    }
}

/// The driver of a player.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DrivenBy {
    /// A thread of its own, at the rate of the graph's driver clock.
    Thread,
    /// The caller, by [`Drive::process`].
    Caller,
}

impl Drive {
    /// Starts a player at the rate of its driver clock.
    pub fn start(player: Player, by: DrivenBy, (rate_hz, timing): (f64, Timing)) -> std::io::Result<Self> {
        let (pace, frame_lock) = (Arc::new(Pace::default()), Arc::new(Mutex::new(())));
        let runner = match by {
            DrivenBy::Caller => Runner::Caller(Box::new(player)),
            DrivenBy::Thread => {
                let theirs = (Arc::clone(&pace), Arc::clone(&frame_lock));
                let thread = std::thread::Builder::new().name("studio driver".to_owned());
                Runner::Thread(Some(
                    thread.spawn(move || run(player, (rate_hz, timing), (&theirs.0, &theirs.1)))?,
                ))
            }
        };
        Ok(Self { pace, frame_lock, runner, kept_at: 0 })
    }

    /// Opens a soundcard, whose callback runs the player.
    ///
    /// # Errors
    /// [`SoundcardError`] if there is no such card.
    pub fn start_by_card(player: Player, request: Request) -> Result<Self, SoundcardError> {
        let pace = Arc::new(Pace::default());
        let paced = Paced { player, pace: Arc::clone(&pace) };
        Ok(Self {
            pace,
            frame_lock: Arc::default(),
            runner: Runner::Card(Box::new(CardDriver::start(request, paced)?)),
            kept_at: 0,
        })
    }

    /// Polls the soundcard that drives the player; returns its notes.
    pub fn poll(&mut self) -> Vec<BackendEvent> {
        let Runner::Card(card) = &mut self.runner else {
            return Vec::new();
        };
        let notes = card.poll();
        self.pace.is_over.store(card.is_finished(), Relaxed);
        notes
    }

    /// True if the soundcard that drives the player is gone and may come back.
    pub fn is_waiting(&self) -> bool {
        matches!(&self.runner, Runner::Card(card) if card.is_waiting())
    }

    /// Name of the soundcard that drives the player.
    pub fn card(&self) -> Option<&str> {
        match &self.runner {
            Runner::Card(card) => Some(&card.got().card),
            _ => None,
        }
    }

    /// Number of under- and overruns of the soundcard that drives the player.
    pub fn xruns(&self) -> Option<u64> {
        match &self.runner {
            Runner::Card(card) => Some(card.counts().xruns),
            _ => None,
        }
    }

    /// True if the caller drives the player.
    pub fn is_the_callers(&self) -> bool {
        matches!(self.runner, Runner::Caller(_))
    }

    /// Calls `work` between two frames with the number of the second. A thread or card that drives a real device does
    /// not wait for it: frames may be computed meanwhile, and the number is exact to within a block.
    pub fn between_frames<T>(&self, work: impl FnOnce(u64) -> T) -> T {
        let _held = self.frame_lock.lock().unwrap_or_else(PoisonError::into_inner);
        work(self.pace.frames())
    }

    /// Runs `frames` frames if the caller drives the player. Real-time code.
    pub fn process(&mut self, frames: usize) {
        if let Runner::Caller(player) = &mut self.runner {
            player.process(frames);
            self.pace.update(player);
            self.pace.is_over.store(player.state() != LiveState::Running, Relaxed);
        }
    }

    /// Updates the timing if the caller drives: wall-clock time and computing time since the last call.
    pub fn keep_time(&mut self, passed: Duration, busy: Duration, rate_hz: f64) {
        let frames = self.pace.frames();
        let run_s = (frames - self.kept_at) as f64 / rate_hz;
        self.kept_at = frames;
        let late_s = (passed.as_secs_f64() - run_s).max(0.0);
        self.pace.behind_us.store((late_s * 1e6) as u64, Relaxed);
        self.pace.late.fetch_add(u64::from(late_s > LATE_S), Relaxed);
        self.pace.busy_ns.fetch_add(busy.as_nanos() as u64, Relaxed);
    }

    /// Waits until a run driven by a thread or a soundcard is over; false if `longest` has passed.
    pub fn is_done_within(&mut self, longest: Duration) -> bool {
        if self.is_the_callers() {
            return self.pace.is_over();
        }
        let asked = Instant::now();
        while !self.pace.is_over() && asked.elapsed() < longest {
            // A card that is gone ends nothing.
            if self.is_waiting() {
                break;
            }
            std::thread::sleep(STEP);
            self.poll();
        }
        self.pace.is_over() || self.is_waiting()
    }

    /// Ends the thread; returns the player unless it panicked.
    pub fn join(mut self) -> Option<Player> {
        self.pace.end.store(true, Relaxed);
        match std::mem::replace(&mut self.runner, Runner::Thread(None)) {
            Runner::Thread(thread) => thread?.join().ok(),
            Runner::Caller(player) => Some(*player),
            Runner::Card(card) => Some(card.join()?.player),
        }
    }
}

impl Drop for Drive {
    fn drop(&mut self) {
        self.pace.end.store(true, Relaxed);
    }
}

fn run(
    mut player: Player,
    (rate_hz, timing): (f64, Timing),
    (pace, frame_lock): (&Pace, &Mutex<()>),
) -> Player {
    #[cfg(not(target_family = "wasm"))]
    if timing.is_real_time {
        // What the system refuses costs evenness only.
        let _ = Timer::default().prepare_thread();
    }
    let most = (timing.max_behind.as_secs_f64() * rate_hz) as u64;
    let (mut origin, mut done) = (Instant::now(), 0_u64);
    while !pace.end.load(Relaxed) && !player.is_idle() {
        let due = (origin.elapsed().as_secs_f64() * rate_hz) as u64;
        let mut behind = due.saturating_sub(done);
        let late_s = behind as f64 / rate_hz - timing.step.as_secs_f64();
        pace.behind_us.store((late_s.max(0.0) * 1e6) as u64, Relaxed);
        pace.late.fetch_add(u64::from(late_s > LATE_S), Relaxed);
        if behind > most {
            origin += Duration::from_secs_f64((behind - most) as f64 / rate_hz);
            behind = most;
        }
        let begun = Instant::now();
        // A real-time thread waits for no other: see `between_frames`.
        let held = (!timing.is_real_time).then(|| frame_lock.lock().unwrap_or_else(PoisonError::into_inner));
        player.process(behind as usize);
        done += behind;
        pace.busy_ns.fetch_add(begun.elapsed().as_nanos() as u64, Relaxed);
        pace.update(&player);
        drop(held);
        std::thread::sleep(timing.step);
    }
    pace.is_over.store(true, Relaxed);
    player
}
