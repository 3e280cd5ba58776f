//! Driver of the graph: a real-time thread, or the caller, such as a page's audio thread.

use haptograph_engine::host::Player;
use haptograph_engine::run::LiveState;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Wake-up period of the thread.
const STEP: Duration = Duration::from_millis(2);
/// Maximum delay that the thread catches up, s; a longer delay is dropped.
const MOST_BEHIND_S: f64 = 0.1;
/// Delay above which a wake-up counts as late, s.
const LATE_S: f64 = 0.02;

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

    /// Number of ticks in which an actuator was given NaN or infinity.
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
    gate: Arc<Mutex<()>>,
    runner: Runner,
    /// Number of frames at the last call of [`Drive::keep_time`].
    kept_at: u64,
}

enum Runner {
    Thread(Option<JoinHandle<Player>>),
    Caller(Box<Player>),
}

/// Who drives the player.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DrivenBy {
    /// A thread of its own, at the rate of the graph's driver clock.
    Thread,
    /// The caller, by [`Drive::process`].
    Caller,
}

impl Drive {
    /// Starts a player at the rate of its driver clock.
    pub fn start(player: Player, by: DrivenBy, rate_hz: f64) -> std::io::Result<Self> {
        let (pace, gate) = (Arc::new(Pace::default()), Arc::new(Mutex::new(())));
        let runner = match by {
            DrivenBy::Caller => Runner::Caller(Box::new(player)),
            DrivenBy::Thread => {
                let theirs = (Arc::clone(&pace), Arc::clone(&gate));
                let thread = std::thread::Builder::new().name("studio driver".to_owned());
                Runner::Thread(Some(
                    thread.spawn(move || run(player, rate_hz, (&theirs.0, &theirs.1)))?,
                ))
            }
        };
        Ok(Self {
            pace,
            gate,
            runner,
            kept_at: 0,
        })
    }

    /// True if the caller drives the player.
    pub fn is_the_callers(&self) -> bool {
        matches!(self.runner, Runner::Caller(_))
    }

    /// Calls `work` between two frames with the number of the second.
    pub fn between_frames<T>(&self, work: impl FnOnce(u64) -> T) -> T {
        let _held = self.gate.lock().unwrap_or_else(PoisonError::into_inner);
        work(self.pace.frames())
    }

    /// Runs `frames` frames if the caller drives the player. Real-time code.
    pub fn process(&mut self, frames: usize) {
        if let Runner::Caller(player) = &mut self.runner {
            player.process(frames);
            self.pace.update(player);
            self.pace
                .is_over
                .store(player.state() != LiveState::Running, Relaxed);
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

    /// Waits until a run driven by a thread is over; false if `longest` has passed.
    pub fn is_done_within(&self, longest: Duration) -> bool {
        if self.is_the_callers() {
            return self.pace.is_over();
        }
        let asked = Instant::now();
        while !self.pace.is_over() && asked.elapsed() < longest {
            std::thread::sleep(STEP);
        }
        true
    }

    /// Ends the thread; returns the player unless it panicked.
    pub fn join(mut self) -> Option<Player> {
        self.pace.end.store(true, Relaxed);
        match std::mem::replace(&mut self.runner, Runner::Thread(None)) {
            Runner::Thread(thread) => thread?.join().ok(),
            Runner::Caller(player) => Some(*player),
        }
    }
}

impl Drop for Drive {
    fn drop(&mut self) {
        self.pace.end.store(true, Relaxed);
    }
}

fn run(mut player: Player, rate_hz: f64, (pace, gate): (&Pace, &Mutex<()>)) -> Player {
    let most = (MOST_BEHIND_S * rate_hz) as u64;
    let (mut origin, mut done) = (Instant::now(), 0_u64);
    while !pace.end.load(Relaxed) && player.state() == LiveState::Running {
        let due = (origin.elapsed().as_secs_f64() * rate_hz) as u64;
        let mut behind = due.saturating_sub(done);
        let late_s = behind as f64 / rate_hz - STEP.as_secs_f64();
        pace.behind_us.store((late_s.max(0.0) * 1e6) as u64, Relaxed);
        pace.late.fetch_add(u64::from(late_s > LATE_S), Relaxed);
        if behind > most {
            origin += Duration::from_secs_f64((behind - most) as f64 / rate_hz);
            behind = most;
        }
        let begun = Instant::now();
        let held = gate.lock().unwrap_or_else(PoisonError::into_inner);
        player.process(behind as usize);
        done += behind;
        pace.busy_ns.fetch_add(begun.elapsed().as_nanos() as u64, Relaxed);
        pace.update(&player);
        drop(held);
        std::thread::sleep(STEP);
    }
    pace.is_over.store(true, Relaxed);
    player
}
