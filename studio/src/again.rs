//! Restart of a run, to record it from its first frame on or to replay a recording.

use super::drive::DrivenBy;
use super::publish::text;
use super::record::{Again, Recording, meant};
use super::stage::{Stage, StageError, State};
use serde_json::json;
use std::path::PathBuf;
use std::time::Duration;

/// File in a run's folder with the recording.
pub const STROKES: &str = "strokes.json";
/// Maximum number of folders with one name.
const MOST_FOLDERS: usize = 10_000;
/// Maximum duration run in one call, s: the buffers of probes hold more.
const MOST_AT_ONCE_S: f64 = 0.5;

/// What follows when a run has fallen to zero.
#[derive(Debug, Default)]
pub enum After {
    /// Nothing.
    #[default]
    Nothing,
    /// A live run.
    Live,
    /// A live run that is recorded.
    Record,
    /// The replay of a recording.
    Replay(Box<Recording>),
}

impl Stage {
    /// Starts or ends a recording; either restarts the run.
    pub fn record(&mut self, on: bool) {
        if on != self.recorder.is_some() {
            self.close_recording();
            self.begin_anew(if on { After::Record } else { After::Live });
        }
    }

    /// Replays a recording on the running graph; the message says whether it was made with this graph.
    pub fn do_again(&mut self, recording: Box<Recording>) -> Result<String, StageError> {
        let other = |error: &dyn std::fmt::Display| {
            StageError::Other(format!("the recording cannot be done again: {error}"))
        };
        if self.recorder.is_some() {
            return Err(other(&"another is being made; end that first"));
        }
        recording.check(self.rate_hz()).map_err(|error| other(&error))?;
        use super::actuators::driven;
        let same = recording.is_of(&self.source, &self.loaded.text);
        self.begin_anew(After::Replay(recording));
        let is_exact = same && driven(&self.loaded.graph).is_empty();
        Ok(match (same, is_exact) {
            (true, true) => "of this graph: the same samples".to_owned(),
            // See `between_frames`.
            (true, false) => {
                "of this graph, recorded with real devices: the same hand, and samples that differ".to_owned()
            }
            (false, _) => "of another graph, text or parameters: the same hand on what runs now".to_owned(),
        })
    }

    /// Stops the run without a successor.
    pub fn halt(&mut self) {
        self.close_recording();
        (self.after, self.replay) = (After::Nothing, None);
        self.stop();
    }

    /// Ends the recording at the present frame.
    pub fn close_recording(&mut self) {
        if let (Some(recording), Some(drive)) = (&mut self.recorder, &self.drive) {
            recording.frames = drive.between_frames(|frame| frame);
        }
    }

    fn begin_anew(&mut self, after: After) {
        (self.after, self.replay) = (after, None);
        match self.session {
            Some(_) => self.stop(),
            None => self.go_on(),
        }
    }

    /// Delivers the recording of the finished run and starts the next run.
    pub fn go_on(&mut self) {
        if let Some(recording) = self.recorder.take() {
            self.hand_over(&recording);
        }
        let after = std::mem::take(&mut self.after);
        if matches!(after, After::Nothing) || self.state == State::Failed {
            return;
        }
        match self.start_as(after) {
            Ok(()) => super::talk::tell_graph(self),
            Err(error) => self.tell_owner(&json!({ "type": "refused", "error": error.to_string() })),
        }
    }

    /// Saves a recording if there is a folder for it, and sends it to the page that made it.
    fn hand_over(&mut self, recording: &Recording) {
        let page_error = self.page_error.take();
        let written = self.folder.take().map(|folder| {
            let path = folder.join(STROKES);
            let text = serde_json::to_vec(recording).map_err(std::io::Error::other);
            text.and_then(|text| haptograph_surfaces::files::write_atomically(&path, &text))
                .map(|()| folder)
        });
        let (saved, error) = match written {
            None => (None, None),
            Some(Ok(folder)) => {
                let error =
                    page_error.map(|error| format!("the page about the recording is not on disk: {error}"));
                (Some(folder), error)
            }
            Some(Err(error)) => (None, Some(format!("the recording is not on disk: {error}"))),
        };
        let report = saved.as_ref().filter(|_| error.is_none());
        let report = report.and_then(|folder| Some(folder.file_name()?.to_string_lossy().into_owned()));
        self.tell_owner(&json!({
            "type": "recording", "name": format!("{}-{STROKES}", recording.graph), "seconds": recording.seconds(),
            "saved": saved.map(|folder| folder.display().to_string()), "report": report, "error": error,
            "recording": recording,
        }));
    }

    fn tell_owner(&mut self, value: &serde_json::Value) {
        let owner = self.owner;
        if let Some(page) = self.pages.iter_mut().find(|page| Some(page.id) == owner) {
            page.send(text(value));
        }
    }

    /// Creates a folder with this name and a number, where runs are stored.
    pub fn new_folder(&self, name: &str) -> std::io::Result<Option<PathBuf>> {
        let Some(out) = &self.out else { return Ok(None) };
        std::fs::create_dir_all(out)?;
        for number in 1..MOST_FOLDERS {
            let folder = out.join(format!("{name}-{number}"));
            match std::fs::create_dir(&folder) {
                Ok(()) => return Ok(Some(folder)),
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(std::io::Error::other(format!(
            "there are ten thousand folders of `{name}`: remove some"
        )))
    }

    /// Runs `frames` frames if the caller drives the run, with the replayed events due before each.
    pub fn run(&mut self, frames: usize) {
        let mut left = frames as u64;
        while left > 0 {
            let part = left.min(self.do_due());
            if let Some(drive) = &mut self.drive {
                drive.process(part as usize);
            }
            left -= part;
        }
    }

    /// Replays the events that are due; returns the number of frames until the next one.
    fn do_due(&mut self) -> u64 {
        while let (Some(replay), Some(drive)) = (&mut self.replay, &self.drive) {
            let frame = drive.pace.frames();
            match replay.next(frame) {
                Again::Move(made) => {
                    let (due_s, pointer) = meant(made);
                    if let Some(pad) = self.pads.get_mut(made.pad) {
                        pad.move_to(due_s, &pointer);
                    }
                }
                Again::Turn((_, name, value)) => {
                    if let Some(session) = &mut self.session {
                        // A setting that the graph no longer has is skipped.
                        let _ = session.set_by_name(name, *value);
                    }
                }
                Again::Until(next) => return next - frame,
                Again::Over => {
                    (self.replay, self.after) = (None, After::Live);
                    if let Some(session) = &self.session {
                        session.stop();
                    }
                }
            }
        }
        u64::MAX
    }

    /// If a thread drives the run: replays the events for the elapsed time `passed`.
    pub fn keep_up(&mut self, passed: Duration) {
        let is_ours = self
            .drive
            .as_ref()
            .is_some_and(super::drive::Drive::is_the_callers);
        if self.host.driven_by == DrivenBy::Caller || !is_ours {
            self.owed_s = 0.0;
            return;
        }
        self.owed_s = (self.owed_s + passed.as_secs_f64()).min(MOST_AT_ONCE_S);
        let frames = (self.owed_s * self.rate_hz()).floor();
        self.owed_s -= frames / self.rate_hz();
        self.run(frames as usize);
    }
}
