//! The timer driver: a thread that wakes at absolute deadlines and runs the driver frames that are due.
//!
//! Deadlines are computed from the start, so that they do not drift. The thread sleeps until shortly before a deadline
//! and spins for the rest. After a stall of the machine the lost frames are counted and time continues from there: to
//! catch up in a burst would run a force loop through many ticks with the same hand position. A device that was
//! given zeros meanwhile begins from zero.

use haptograph_engine::run::{Player, Wake};
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Wake-ups per second; a faster driver runs several frames at a time.
const WAKES_HZ: f64 = 1000.0;
/// Time before a deadline at which sleeping ends and spinning begins.
const SPIN: Duration = Duration::from_micros(200);
/// A delay beyond this is a stall of the machine: its frames are skipped.
const STALL: Duration = Duration::from_millis(20);

/// A thread that drives a live run.
pub struct TimerThread {
    /// The real-time privileges that the system refused, and how to grant them, one sentence each.
    pub refused: Vec<String>,
    thread: JoinHandle<Player>,
}

impl TimerThread {
    /// Starts a thread that runs until the run is over.
    ///
    /// # Errors
    /// System errors if no thread can be started.
    pub fn start(mut player: Player) -> std::io::Result<Self> {
        let (refused_in, refused) = channel();
        let thread = std::thread::Builder::new().name("haptograph-timer".into()).spawn(move || {
            // The receiver may be gone.
            let _ = refused_in.send(prepare_thread());
            run(&mut player);
            player
        })?;
        let refused = refused.recv().unwrap_or_default();
        Ok(Self { refused, thread })
    }

    /// True if the run is over.
    pub fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits for the end of the run; `None` if the thread panicked.
    pub fn join(self) -> Option<Player> {
        self.thread.join().ok()
    }
}

/// Requests real-time scheduling and locked memory for the calling thread. Returns what the system refused.
pub(crate) fn prepare_thread() -> Vec<String> {
    let mut refused = Vec::new();
    #[cfg(not(target_os = "linux"))]
    refused.push(
        "no real-time scheduling (haptograph supports it on Linux only): expect jitter while the machine is busy"
            .to_owned(),
    );
    #[cfg(target_os = "linux")]
    {
        use nix::sys::mman::{MlockAllFlags, mlockall};
        use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit};
        use thread_priority::{
            RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy,
            set_thread_priority_and_policy, thread_native_id,
        };
        let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
        let priority = ThreadPriority::try_from(60_u8).unwrap_or(ThreadPriority::Max);
        if let Err(error) = set_thread_priority_and_policy(thread_native_id(), priority, fifo) {
            refused.push(format!(
                "no real-time scheduling ({error:?}): expect jitter; allow it with `rtprio 95` for your user in \
                 /etc/security/limits.d/"
            ));
        }
        // With a finite limit, locking future memory would make later allocations fail.
        let unlimited = getrlimit(Resource::RLIMIT_MEMLOCK).is_ok_and(|(soft, _)| soft == RLIM_INFINITY);
        let flags = match unlimited {
            true => MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE,
            false => MlockAllFlags::MCL_CURRENT,
        };
        if let Err(error) = mlockall(flags) {
            refused.push(format!(
                "memory is not locked ({error}): page faults may cause jitter; allow it with `memlock unlimited` \
                 in /etc/security/limits.d/"
            ));
        }
    }
    refused
}

/// Runs on the calling thread until the run is over and every actuator is at zero.
fn run(player: &mut Player) {
    let rate_hz = player.run().rate_hz();
    let mut start = Instant::now();
    let period = Duration::from_secs_f64(1.0 / WAKES_HZ);
    let (mut wake, mut done, mut lost) = (0_u64, 0_u64, 0_u32);
    while !player.is_idle() {
        wake += 1;
        let deadline = start + Duration::from_secs_f64(wake as f64 / WAKES_HZ);
        let due = (wake as f64 / WAKES_HZ * rate_hz).floor() as u64;
        wait_until(deadline);
        let is_stalled = deadline.elapsed() > STALL;
        if is_stalled {
            // Frames that always take too long would otherwise keep a core from all other threads.
            std::thread::sleep(period);
        }
        let began = Instant::now();
        let late = began.saturating_duration_since(deadline);
        if is_stalled {
            // Skip the time of the stall.
            start += late;
            lost = (late.as_secs_f64() * WAKES_HZ) as u32;
        }
        let frames = due.saturating_sub(done);
        player.process(frames as usize);
        done = due;
        let work = began.elapsed();
        player.report(Wake {
            late_ns: late.as_nanos() as u64,
            work_ns: work.as_nanos() as u64,
            frames: frames as u32,
            lost,
            overrun: work > period,
        });
        lost = 0;
    }
}

fn wait_until(deadline: Instant) {
    let sleep = deadline.saturating_duration_since(Instant::now()).saturating_sub(SPIN);
    if !sleep.is_zero() {
        std::thread::sleep(sleep);
    }
    while Instant::now() < deadline {
        std::hint::spin_loop();
    }
}
