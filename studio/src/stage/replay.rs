//! Replays on the running graph.

use super::super::clock::Clock;
use super::super::error::StageError;
use super::super::record::Recording;
use super::super::replay::ReplayStep;
use super::super::run_cycle::NextRun;
use super::Stage;

impl Stage {
    /// Replays a recording on the running graph; the message says whether it was made with this graph.
    pub(crate) fn start_replay(&mut self, recording: Box<Recording>) -> Result<String, StageError> {
        let other = |error: &dyn std::fmt::Display| {
            StageError::Other(format!("cannot replay the recording: {error}"))
        };
        if self.records() {
            return Err(other(&"a recording is running; end it first"));
        }
        self.refuse_after_stop("replay the recording")?;
        recording.check(self.signals.rate_hz).map_err(|error| other(&error))?;
        let same = recording.is_of(&self.source, &self.loaded.text);
        let is_exact = same && !self.clock.as_ref().is_some_and(Clock::has_drivers);
        self.restart(NextRun::Replay(recording));
        Ok(match (same, is_exact) {
            (true, true) => "of this graph: the same samples".to_owned(),
            // See `frames`.
            (true, false) => {
                "of this graph, recorded with real devices: the same strokes, the samples may differ"
                    .to_owned()
            }
            (false, _) => {
                "of another graph, text or parameters: the same strokes, rendered by the graph that runs now"
                    .to_owned()
            }
        })
    }

    /// Runs `frames` frames, unless drivers do, with the replayed events due before each.
    pub(crate) fn run(&mut self, frames: usize) {
        let mut left = frames as u64;
        while left > 0 {
            let part = left.min(self.replay_due_events());
            if let Some(clock) = &mut self.clock {
                clock.process(part as usize);
            }
            left -= part;
        }
    }

    /// Replays the events that are due; returns the number of frames until the next one.
    fn replay_due_events(&mut self) -> u64 {
        let frame = self.frames();
        while let Some(replay) = &mut self.cycle.replay {
            match replay.next(frame) {
                ReplayStep::Move(made) => {
                    // A replay runs on one clock.
                    let made = *made;
                    self.apply(&made, 0.0);
                }
                ReplayStep::Setting((_, name, value)) => {
                    if let Some(session) = &mut self.session {
                        // A setting that the graph no longer has is skipped.
                        let _ = session.set_by_name(name, *value);
                    }
                }
                ReplayStep::Until(next) => return next - frame,
                ReplayStep::Over => {
                    (self.cycle.replay, self.cycle.next_run) = (None, NextRun::Live);
                    if let Some(session) = &self.session {
                        session.stop();
                    }
                }
            }
        }
        u64::MAX
    }
}
