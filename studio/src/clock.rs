//! What runs the frames of a run: the stage itself, or drivers.

use haptograph_engine::graph::Graph;
use haptograph_engine::run::{Meters, Player, Session, SessionOptions, Wake};
use haptograph_live::{BackendError, Connections, Counts, Drivers, Role};
use std::time::{Duration, Instant};

/// Time between two calls of [`Stage::advance`](super::stage::Stage::advance).
pub(crate) const PERIOD: Duration = Duration::from_millis(2);
/// Maximum time that a stage catches up with after a stall, s: the buffers of probes hold more.
const MAX_DUE_S: f64 = 0.5;
/// Delay above which a wake-up counts as late, ns.
const LATE_NS: u64 = 20_000_000;

/// The clock of a run, with the connections to its devices.
pub(crate) struct Clock {
    pub drivers: Drivers,
    own: Option<OwnClock>,
}

/// Runs the frames on the thread that holds the stage: in a browser, in a replay, and where no device is real.
struct OwnClock {
    player: Box<Player>,
    /// Time to be run, s.
    due_s: f64,
    /// Number of frames at the last call of [`Clock::keep_time`].
    kept_at: u64,
    timing: Meters,
}

impl Clock {
    /// Starts the drivers of a graph, or the stage's own clock.
    ///
    /// # Errors
    /// [`BackendError`] if a driver cannot be started.
    pub(crate) fn start(
        (graph, connections): (&Graph, Connections),
        player: Player,
        options: &SessionOptions,
        has_drivers: bool,
    ) -> Result<Self, BackendError> {
        let (lives, own) = match has_drivers {
            true => (vec![player], None),
            false => (Vec::new(), Some(player)),
        };
        let mut drivers = Drivers::start(connections, graph, lives, &options.stop)?;
        drivers.keep(graph);
        let own = own.map(|player| OwnClock {
            player: Box::new(player),
            due_s: 0.0,
            kept_at: 0,
            timing: Meters::default(),
        });
        Ok(Self { drivers, own })
    }

    /// True if drivers run the frames.
    pub(crate) fn has_drivers(&self) -> bool {
        self.own.is_none()
    }

    /// True if the run is over or, while it is stopped, if its soundcard is gone.
    pub(crate) fn is_over(&self, is_stopping: bool) -> bool {
        match &self.own {
            Some(own) => own.player.is_idle(),
            None => self.drivers.is_finished(is_stopping),
        }
    }

    /// Number of under- and overruns of the soundcard that drives the run.
    pub(crate) fn xruns(&self) -> Option<u64> {
        self.drivers.counted(Role::Driver).find_map(|(_, counts)| match counts {
            Counts::Stream(counts) => Some(counts.xruns),
            _ => None,
        })
    }

    /// Timing of the run: its meters and the number of late wake-ups.
    pub(crate) fn timing(&self, session: &mut Session) -> (Meters, u64) {
        let meters = match &self.own {
            Some(own) => own.timing.clone(),
            None => session.poll().first().map(|(_, meters)| (*meters).clone()).unwrap_or_default(),
        };
        let late = meters.lateness.count_beyond(LATE_NS);
        (meters, late)
    }

    /// Runs `frames` frames, unless drivers do. Real-time code.
    pub(crate) fn process(&mut self, frames: usize) {
        if let Some(own) = &mut self.own {
            own.player.process(frames);
        }
    }

    /// Number of frames that are due after `passed` more time; 0 if drivers run them. What takes longer than real time is
    /// late, and then skipped.
    pub(crate) fn due(&mut self, passed: Duration, rate_hz: f64) -> u64 {
        let Some(own) = &mut self.own else { return 0 };
        own.due_s = (own.due_s + passed.as_secs_f64()).min(MAX_DUE_S);
        (own.due_s * rate_hz).floor() as u64
    }

    /// Notes that `frames` of the due frames were run in this time, `passed` after the ones before.
    pub(crate) fn ran(&mut self, frames: u64, (passed, work): (Duration, Duration), rate_hz: f64) {
        let Some(own) = &mut self.own else { return };
        own.due_s -= frames as f64 / rate_hz;
        let late = passed.saturating_sub(PERIOD);
        own.timing.record(&wake(frames, late, (passed, work)));
    }

    /// Updates the timing if a page's audio thread runs the frames: wall-clock time and computing time since the last
    /// call.
    pub(crate) fn keep_time(&mut self, passed: Duration, work: Duration, rate_hz: f64) {
        let Some(own) = &mut self.own else { return };
        let frames = own.player.frames() - own.kept_at;
        own.kept_at += frames;
        let late_s = (passed.as_secs_f64() - frames as f64 / rate_hz).max(0.0);
        own.timing.record(&wake(frames, Duration::from_secs_f64(late_s), (passed, work)));
    }

    /// Waits for drivers, until the run is over or `longest` has passed.
    pub(crate) fn wait(&mut self, longest: Duration) {
        if !self.has_drivers() {
            return;
        }
        let asked = Instant::now();
        while !self.is_over(true) && asked.elapsed() < longest {
            std::thread::sleep(PERIOD);
            self.drivers.poll();
        }
    }

    /// Ends the run and disconnects its devices, after a last zero to each. Returns the player unless its thread panicked.
    pub(crate) fn join(mut self) -> Option<Player> {
        if let Some(own) = self.own {
            return Some(*own.player);
        }
        self.drivers.stop();
        self.drivers.join().ok()?.pop()
    }
}

fn wake(frames: u64, late: Duration, (passed, work): (Duration, Duration)) -> Wake {
    Wake {
        late_ns: late.as_nanos() as u64,
        work_ns: work.as_nanos() as u64,
        frames: frames as u32,
        lost: 0,
        overrun: work > passed,
    }
}
