//! Replays on the running graph.

use super::super::actuators::driven;
use super::super::drive::Drive;
use super::super::error::StageError;
use super::super::record::Recording;
use super::super::replay::ReplayStep;
use super::super::run_cycle::NextRun;
use super::Stage;
use std::time::Duration;

/// Maximum duration that a replay advances in one call, s: the buffers of probes hold more.
const MAX_ADVANCE_S: f64 = 0.5;

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
        self.restart(NextRun::Replay(recording));
        let is_exact = same && driven(&self.loaded.graph).is_empty();
        Ok(match (same, is_exact) {
            (true, true) => "of this graph: the same samples".to_owned(),
            // See `between_frames`.
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

    /// Runs `frames` frames if the caller drives the run, with the replayed events due before each.
    pub(crate) fn run(&mut self, frames: usize) {
        let mut left = frames as u64;
        while left > 0 {
            let part = left.min(self.replay_due_events());
            if let Some(drive) = &mut self.drive {
                drive.process(part as usize);
            }
            left -= part;
        }
    }

    /// Replays the events that are due; returns the number of frames until the next one.
    fn replay_due_events(&mut self) -> u64 {
        while let (Some(replay), Some(drive)) = (&mut self.cycle.replay, &self.drive) {
            let frame = drive.pace.frames();
            match replay.next(frame) {
                ReplayStep::Move(made) => {
                    let (due_s, pointer) = made.pointer();
                    if let Some(pad) = self.signals.pads.get_mut(made.pad) {
                        pad.move_to(due_s, &pointer);
                    }
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

    /// If a thread drives the run: replays the events for the elapsed time `passed`.
    pub(crate) fn advance_replay(&mut self, passed: Duration) {
        let is_ours = self.drive.as_ref().is_some_and(Drive::is_the_callers);
        if self.host.is_driven_by_caller || !is_ours {
            self.cycle.pending_s = 0.0;
            return;
        }
        self.cycle.pending_s = (self.cycle.pending_s + passed.as_secs_f64()).min(MAX_ADVANCE_S);
        let frames = (self.cycle.pending_s * self.signals.rate_hz).floor();
        self.cycle.pending_s -= frames / self.signals.rate_hz;
        self.run(frames as usize);
    }
}
