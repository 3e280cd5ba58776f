//! The timer driver: a thread that wakes at absolute deadlines and runs the driver frames that are due.
//!
//! Deadlines are computed from the start, so that nothing drifts. The thread sleeps to shortly before a deadline and
//! spins the rest. A stall of the machine is not made up for by a burst: the frames lost in it are counted, and time
//! goes on from there; a burst would push a force loop through many ticks with the hand standing still.

use super::Run;
use super::live::{Live, LiveState};
use super::meter::Wake;
use haptograph_signal::time::Rate;
use std::time::{Duration, Instant};

/// How a timer wakes.
#[derive(Debug, Clone, Copy)]
pub struct Timer {
    /// Wake-ups a second; frames of faster drivers run several at a time.
    pub wakes_hz: f64,
    /// How long before a deadline sleeping ends and spinning begins.
    pub spin: Duration,
    /// A delay beyond this is a stall of the machine, not to be made up for.
    pub stall: Duration,
}

impl Default for Timer {
    fn default() -> Self {
        let (spin, stall) = (Duration::from_micros(200), Duration::from_millis(20));
        Self {
            wakes_hz: 1000.0,
            spin,
            stall,
        }
    }
}

/// What the system allowed the timer's thread.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TimerNotes {
    /// What was not allowed, and how to allow it; one sentence each.
    pub refused: Vec<String>,
}

impl Timer {
    /// Asks the system for real-time scheduling and locked memory for the calling thread.
    pub fn prepare_thread(&self) -> TimerNotes {
        let mut notes = TimerNotes::default();
        #[cfg(target_os = "linux")]
        {
            use nix::sys::mman::{MlockAllFlags, mlockall};
            use thread_priority::{
                RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy,
                set_thread_priority_and_policy, thread_native_id,
            };
            let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
            let priority = ThreadPriority::try_from(60_u8).unwrap_or(ThreadPriority::Max);
            if let Err(error) = set_thread_priority_and_policy(thread_native_id(), priority, fifo) {
                notes.refused.push(format!(
                    "no real-time scheduling ({error:?}): expect jitter; allow it with `rtprio 95` for your user in \
                     /etc/security/limits.d/"
                ));
            }
            if let Err(error) = mlockall(MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE) {
                notes.refused.push(format!(
                    "memory is not locked ({error}): page faults may cause jitter; allow it with `memlock unlimited` \
                     in /etc/security/limits.d/"
                ));
            }
        }
        notes
    }

    /// Runs until `seconds` of driver time have passed, the run stops, or a node panics. Runs on the calling thread.
    pub fn run(&self, live: &mut Live, rate: Rate, seconds: f64, mut each: impl FnMut(&Run, usize)) {
        let mut start = Instant::now();
        let total = (seconds * rate.hz()).round() as u64;
        let period = Duration::from_secs_f64(1.0 / self.wakes_hz);
        let (mut wake, mut done, mut lost) = (0_u64, 0_u64, 0_u32);
        while live.state() == LiveState::Running && done < total {
            wake += 1;
            let deadline = start + Duration::from_secs_f64(wake as f64 / self.wakes_hz);
            let due = ((wake as f64 / self.wakes_hz * rate.hz()).floor() as u64).min(total);
            self.wait_until(deadline);
            let began = Instant::now();
            let late = began.saturating_duration_since(deadline);
            if late > self.stall {
                // Time is moved on as if the stall had not been.
                start += late;
                lost = lost.saturating_add((late.as_secs_f64() * self.wakes_hz) as u32);
            }
            let frames = due.saturating_sub(done);
            live.callback(frames as usize, &mut each);
            done = due;
            let work = began.elapsed();
            live.report(Wake {
                late_ns: late.as_nanos() as u64,
                work_ns: work.as_nanos() as u64,
                frames: frames as u32,
                lost,
                overrun: work > period,
            });
            lost = 0;
        }
    }

    fn wait_until(&self, deadline: Instant) {
        let sleep = deadline
            .saturating_duration_since(Instant::now())
            .saturating_sub(self.spin);
        if !sleep.is_zero() {
            std::thread::sleep(sleep);
        }
        while Instant::now() < deadline {
            std::hint::spin_loop();
        }
    }
}
