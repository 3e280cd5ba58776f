//! Replay of a recording on the running graph.

use super::record::{Move, Recording, SettingChange};

/// A replay in progress.
#[derive(Debug)]
pub(crate) struct Replay {
    recording: Recording,
    moves: usize,
    settings: usize,
}

/// The next step of a replay.
pub(crate) enum ReplayStep<'a> {
    Move(&'a Move),
    Setting(&'a SettingChange),
    /// Run up to this frame: no event comes before it.
    Until(u64),
    /// The replay is over.
    Over,
}

impl Replay {
    pub(crate) fn of(recording: Recording) -> Self {
        Self { recording, moves: 0, settings: 0 }
    }

    /// The next step before `frame` is run.
    pub(crate) fn next(&mut self, frame: u64) -> ReplayStep<'_> {
        let Recording { moves, settings, frames, .. } = &self.recording;
        let (next_move, next_setting) = (moves.get(self.moves), settings.get(self.settings));
        if let Some(made) = next_move.filter(|made| made.frame <= frame) {
            self.moves += 1;
            return ReplayStep::Move(made);
        }
        if let Some(made) = next_setting.filter(|made| made.0 <= frame) {
            self.settings += 1;
            return ReplayStep::Setting(made);
        }
        if frame >= *frames {
            return ReplayStep::Over;
        }
        let next = next_move.map(|made| made.frame).into_iter().chain(next_setting.map(|made| made.0));
        ReplayStep::Until(next.chain([*frames]).min().unwrap_or(*frames))
    }

    /// Fraction of the replay that is done, 0 to 1.
    pub(crate) fn part(&self, frame: u64) -> f64 {
        (frame as f64 / self.recording.frames.max(1) as f64).min(1.0)
    }
}
