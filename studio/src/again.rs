//! A run that begins anew, to record it from its first frame on or to do again what was recorded.

use super::drive::DrivenBy;
use super::publish::text;
use super::record::{Again, Recording, meant};
use super::stage::{Stage, StageError, State};
use serde_json::json;
use std::path::PathBuf;
use std::time::Duration;

/// The file in a run's folder that holds what was done.
pub const STROKES: &str = "strokes.json";
/// Folders of one name.
const MOST_FOLDERS: usize = 10_000;
/// The longest time that is run at once, s: what is probed has room for more.
const MOST_AT_ONCE_S: f64 = 0.5;

/// How a run goes on when it has fallen to zero.
#[derive(Debug, Default)]
pub enum After {
    /// Not at all.
    #[default]
    Nothing,
    /// Under the hand.
    Live,
    /// The same, and it is recorded.
    Record,
    /// As it was recorded.
    Replay(Box<Recording>),
}

impl Stage {
    /// Begins to record, or ends that; either begins a new run.
    pub fn record(&mut self, on: bool) {
        if on != self.recorder.is_some() {
            self.close_recording();
            self.begin_anew(if on { After::Record } else { After::Live });
        }
    }

    /// Does a recording again on the graph that runs; says whether it was made with it.
    pub fn do_again(&mut self, recording: Box<Recording>) -> Result<String, StageError> {
        let other = |error: &dyn std::fmt::Display| {
            StageError::Other(format!("the recording cannot be done again: {error}"))
        };
        if self.recorder.is_some() {
            return Err(other(&"another is being made; end that first"));
        }
        recording.check(self.rate_hz()).map_err(|error| other(&error))?;
        let same = recording.is_of(&self.source, &self.loaded.text);
        self.begin_anew(After::Replay(recording));
        Ok(match same {
            true => "of this graph: the same samples".to_owned(),
            false => "of another graph, text or parameters: the same hand on what runs now".to_owned(),
        })
    }

    /// Stops, and nothing begins by itself.
    pub fn halt(&mut self) {
        self.close_recording();
        (self.after, self.replay) = (After::Nothing, None);
        self.stop();
    }

    /// No frame after this belongs to the recording.
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

    /// The run is over: what was recorded is handed over, and what is to begin begins.
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

    /// Saves a recording where there is a folder for it, and sends it to the page that made it.
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

    /// A new folder of this name and a number, where runs are kept.
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

    /// Runs so many frames where the caller drives, with what is done again before each.
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

    /// Does again what is due; how many frames come until the next.
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
                        // A setting that the graph does not have any more stays away.
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

    /// Where a thread drives otherwise: runs what is done again for the time that passed.
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
