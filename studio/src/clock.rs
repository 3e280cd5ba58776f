//! What runs the frames of a run: the stage itself, which runs the players of all drivers on one clock, or drivers.

use haptograph_engine::graph::Graph;
use haptograph_engine::run::{Player, Session, SessionOptions, VirtualClock};
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
    players: Box<VirtualClock>,
    /// Time to be run, s; `None` before the first frame.
    due_s: Option<f64>,
    timing: Timing,
}

/// Timing of a run so far.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Timing {
    pub frames: u64,
    /// Computing time, ns.
    pub work_ns: u64,
    /// Delay of the latest wake-up, ns.
    pub late_ns: u64,
    /// Number of late wake-ups.
    pub late: u64,
}

impl Timing {
    /// Notes the frames up to now, computed in this time, and the delay of the last of them.
    fn record(&mut self, frames: u64, work: Duration, late_s: f64) {
        self.frames = frames;
        self.work_ns += work.as_nanos() as u64;
        self.late_ns = (late_s * 1e9) as u64;
        self.late += u64::from(self.late_ns > LATE_NS);
    }
}

impl Clock {
    /// Starts the drivers of a graph, or the stage's own clock.
    ///
    /// # Errors
    /// [`BackendError`] if a driver cannot be started.
    pub(crate) fn start(
        (graph, connections): (&Graph, Connections),
        (players, session): (Vec<Player>, &Session),
        options: &SessionOptions,
        has_drivers: bool,
    ) -> Result<Self, BackendError> {
        let (lives, own) = match has_drivers {
            true => (players, None),
            false => (Vec::new(), Some(Box::new(VirtualClock::running(players, session)))),
        };
        let drivers = Drivers::start(connections, graph, lives, &options.stop)?;
        let own = own.map(|players| OwnClock { players, due_s: None, timing: Timing::default() });
        Ok(Self { drivers, own })
    }

    /// True if drivers run the frames.
    pub(crate) fn has_drivers(&self) -> bool {
        self.own.is_none()
    }

    /// True if the run is over or, while it is stopped, if its soundcard is gone.
    pub(crate) fn is_over(&self, is_stopping: bool) -> bool {
        match &self.own {
            Some(own) => own.players.is_idle(),
            None => self.drivers.is_finished(is_stopping),
        }
    }

    /// True if one driver has ended while others still run; they must then be stopped.
    pub(crate) fn is_partly_over(&mut self) -> bool {
        match &self.own {
            Some(own) => own.players.is_partly_idle(),
            None => self.drivers.is_partly_finished(),
        }
    }

    /// Number of under- and overruns of the soundcards that drive the run.
    pub(crate) fn xruns(&self) -> Option<u64> {
        let counted = self.drivers.counted(Role::Driver).filter_map(|(_, counts)| match counts {
            Counts::Stream(counts) => Some(counts.xruns),
            _ => None,
        });
        counted.reduce(|all, xruns| all + xruns)
    }

    /// Timing of the run so far.
    pub(crate) fn timing(&self, session: &mut Session) -> Timing {
        if let Some(own) = &self.own {
            return own.timing;
        }
        // Frames are those of the first driver; the work is that of all.
        session.poll().into_iter().rev().fold(Timing::default(), |all, (_, meters)| Timing {
            frames: meters.frames,
            work_ns: all.work_ns + meters.work_ns,
            late_ns: all.late_ns.max(meters.late_ns),
            late: all.late + meters.lateness.count_beyond(LATE_NS),
        })
    }

    /// Runs `frames` frames, unless drivers do. Real-time code.
    pub(crate) fn process(&mut self, frames: usize) {
        if let Some(own) = &mut self.own {
            own.players.process(frames);
        }
    }

    /// Largest number of frames to run at once: those of a period, or a block of the plan if it is shorter.
    pub(crate) fn part(&self, rate_hz: f64) -> u64 {
        let block = self.own.as_ref().map_or(1, |own| own.players.block());
        (PERIOD.as_secs_f64() * rate_hz).ceil().min(block as f64) as u64
    }

    /// Number of frames that are due after `passed` more time; 0 if drivers run them. What takes longer than real time is
    /// late, and then skipped.
    pub(crate) fn due(&mut self, passed: Duration, rate_hz: f64) -> u64 {
        let Some(own) = &mut self.own else { return 0 };
        // No run catches up with the time before it began.
        let due_s = own.due_s.map_or(0.0, |due_s| due_s + passed.as_secs_f64());
        // Also a slow clock has a tick.
        let due_s = due_s.min(MAX_DUE_S + 1.0 / rate_hz);
        own.due_s = Some(due_s);
        (due_s * rate_hz).floor() as u64
    }

    /// Notes that `frames` of the due frames were run in this time.
    pub(crate) fn ran(&mut self, frames: u64, work: Duration, rate_hz: f64) {
        let Some(own) = &mut self.own else { return };
        let due_s = own.due_s.unwrap_or_default() - frames as f64 / rate_hz;
        own.due_s = Some(due_s);
        own.timing.record(own.players.frames(), work, (due_s - 1.0 / rate_hz).max(0.0));
    }

    /// Updates the timing if a page's audio thread runs the frames: wall-clock time and computing time since the last
    /// call.
    pub(crate) fn keep_time(&mut self, passed: Duration, work: Duration, rate_hz: f64) {
        let Some(own) = &mut self.own else { return };
        let frames = own.players.frames();
        let run_s = (frames - own.timing.frames) as f64 / rate_hz;
        own.timing.record(frames, work, (passed.as_secs_f64() - run_s).max(0.0));
    }

    /// Waits until the drivers have ended the run, or `longest` has passed.
    pub(crate) fn wait(&mut self, longest: Duration) {
        let asked = Instant::now();
        while !self.is_over(true) && asked.elapsed() < longest {
            std::thread::sleep(PERIOD);
            self.drivers.poll();
        }
    }

    /// Ends the run and disconnects its devices, after a last zero to each. Returns the players unless a thread panicked,
    /// or is still on its way to zero: a slew limit can make that long.
    pub(crate) fn join(mut self) -> Option<Vec<Player>> {
        if let Some(own) = self.own {
            return Some(own.players.into_players());
        }
        self.drivers.stop();
        match self.drivers.is_finished(true) {
            true => self.drivers.join().ok(),
            false => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::document::Document;
    use haptograph_engine::graph::{CheckOptions, check};

    fn clock(rate_hz: f64) -> Clock {
        let text = format!(
            r#"Graph(format: 1, clocks: {{ "slow": Driver(rate_hz: {rate_hz:?}) }},
                nodes: {{ "one": Constant(clock: "slow", value: 1, quantity: "number") }})"#
        );
        let registry = haptograph_nodes::registry();
        let document = Document::parse("g.ron", &text).expect("it is RON");
        let graph = check(&document, &registry, &CheckOptions::default()).expect("it is valid");
        let options = SessionOptions::default();
        let (players, session) = Player::open_all(&graph, &options).expect("it runs");
        let connections = Connections::with_drivers(&registry);
        Clock::start((&graph, connections), (players, &session), &options, false).expect("it needs no driver")
    }

    #[test]
    fn also_a_clock_below_one_hertz_ticks() {
        let mut clock = clock(0.5);
        let second = Duration::from_secs(1);
        // The time before the first call is not caught up with.
        let due: Vec<u64> = (0..5)
            .map(|_| {
                let due = clock.due(second, 0.5);
                clock.process(due as usize);
                clock.ran(due, Duration::ZERO, 0.5);
                due
            })
            .collect();
        assert_eq!(due, [0, 0, 1, 0, 1]);
        assert_eq!((clock.part(0.5), clock.is_over(false)), (1, false));
    }

    #[test]
    fn what_cannot_keep_up_is_late_and_skips_frames() {
        let mut clock = clock(1000.0);
        clock.due(Duration::ZERO, 1000.0);
        for _ in 0..10 {
            assert!(clock.due(Duration::from_millis(100), 1000.0) <= 501);
            clock.process(50);
            clock.ran(50, Duration::from_millis(100), 1000.0);
        }
        let timing = clock.own.expect("no driver runs").timing;
        assert!(timing.late > 5 && timing.late_ns > 400_000_000, "{timing:?}");
        assert_eq!((timing.frames, timing.work_ns), (500, 1_000_000_000));
    }
}
