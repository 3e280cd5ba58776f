//! The thread that runs the graph against the clock.

use haptograph_engine::host::Player;
use haptograph_engine::run::LiveState;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Between two wake-ups.
const STEP: Duration = Duration::from_millis(2);
/// The longest time that is made up for, s; what is later than that is lost.
const MOST_BEHIND_S: f64 = 0.1;
/// Later than this a wake-up counts as late, s.
const LATE_S: f64 = 0.02;

/// What is known of the thread while it runs.
#[derive(Debug, Default)]
pub struct Pace {
    end: AtomicBool,
    is_over: AtomicBool,
    frames: AtomicU64,
    behind_us: AtomicU64,
    late: AtomicU64,
    busy_ns: AtomicU64,
    faults: AtomicU64,
}

impl Pace {
    /// Driver frames so far.
    pub fn frames(&self) -> u64 {
        self.frames.load(Relaxed)
    }

    /// How late the latest wake-up was, ms.
    pub fn behind_ms(&self) -> f64 {
        self.behind_us.load(Relaxed) as f64 * 1e-3
    }

    /// Wake-ups that were too late.
    pub fn late(&self) -> u64 {
        self.late.load(Relaxed)
    }

    /// Ticks so far at which an actuator was asked for NaN or infinity.
    pub fn faults(&self) -> u64 {
        self.faults.load(Relaxed)
    }

    /// Time that the graph took since this was asked last.
    pub fn take_busy(&self) -> Duration {
        Duration::from_nanos(self.busy_ns.swap(0, Relaxed))
    }

    /// Has the run come to its end?
    pub fn is_over(&self) -> bool {
        self.is_over.load(Relaxed)
    }
}

/// A player that is driven.
#[derive(Debug)]
pub struct Drive {
    pub pace: Arc<Pace>,
    thread: Option<JoinHandle<Player>>,
}

impl Drive {
    /// Runs a player at the rate of its driver.
    pub fn start(player: Player, rate_hz: f64) -> std::io::Result<Self> {
        let pace = Arc::new(Pace::default());
        let theirs = Arc::clone(&pace);
        let thread = std::thread::Builder::new()
            .name("studio driver".to_owned())
            .spawn(move || run(player, rate_hz, &theirs))?;
        Ok(Self {
            pace,
            thread: Some(thread),
        })
    }

    /// Ends the thread; the player comes back unless it panicked.
    pub fn join(mut self) -> Option<Player> {
        self.pace.end.store(true, Relaxed);
        self.thread.take()?.join().ok()
    }
}

impl Drop for Drive {
    fn drop(&mut self) {
        self.pace.end.store(true, Relaxed);
    }
}

fn run(mut player: Player, rate_hz: f64, pace: &Pace) -> Player {
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
        player.process(behind as usize);
        done += behind;
        pace.busy_ns.fetch_add(begun.elapsed().as_nanos() as u64, Relaxed);
        pace.frames.store(player.frames(), Relaxed);
        pace.faults.store(player.faults().ticks, Relaxed);
        std::thread::sleep(STEP);
    }
    pace.is_over.store(true, Relaxed);
    player
}
