//! Begin and end of recordings.

use super::super::error::StageError;
use super::super::record::{APPENDED, Appended, MAX_EVENTS, Recorder, Recording, STROKES};
use super::super::run_cycle::NextRun;
use super::Stage;
use haptograph_signal::files;
use serde_json::json;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

/// Maximum number of folders with one name.
const MAX_FOLDERS: usize = 10_000;

impl Stage {
    /// Starts or ends a recording; either restarts the run.
    ///
    /// # Errors
    /// [`StageError`] after a STOP, which no recording ends.
    pub(crate) fn record(&mut self, on: bool) -> Result<(), StageError> {
        self.refuse_after_stop(if on { "record" } else { "end the recording" })?;
        if on != self.records() {
            self.close_recording();
            let next = if on { NextRun::Record } else { NextRun::Live };
            // The thread that serves the pages ends the run and writes its report, so that one arena of the system's allocator
            // keeps what that takes, and not one for each thread that hears a message.
            self.restart_within(Duration::ZERO, next);
        }
        Ok(())
    }

    /// True if a recording goes on, or begins once the run has fallen to zero.
    pub(crate) fn records(&self) -> bool {
        match self.cycle.is_stopping {
            true => matches!(self.cycle.next_run, NextRun::Record),
            false => self.recorder.recording.is_some(),
        }
    }

    /// Ends the recording at the present frame.
    pub(crate) fn close_recording(&mut self) {
        let frames = self.frames();
        if let Some(recording) = self.recorder.recording.as_mut().filter(|_| self.session.is_some()) {
            recording.frames = frames;
        }
    }

    /// What the files of the run have so far, such as how much of force and speed.
    pub(crate) fn recorded(&self) -> Vec<String> {
        let files = self.loaded.graph.file_progress().filter(|_| self.session.is_some());
        files.map(|(_, file)| file.lines().join("\n")).collect()
    }

    /// Begins to record a run, whose folder keeps what is recorded.
    pub(crate) fn begin_recording(&mut self) {
        let mut recording = Recording::begin(&self.source, &self.loaded.text, self.signals.rate_hz);
        if self.host.is_driven_by_caller {
            // A page's audio thread records without allocating. Elsewhere 32 MB that are freed after each recording would
            // let the system's allocator keep as much for each thread.
            recording.moves.reserve(MAX_EVENTS);
        }
        let folder = self.recorder.folder.as_deref();
        // The complete recording would meet the same error, and states it.
        self.recorder.appended = folder.and_then(|folder| Appended::begin(folder, &recording).ok());
        self.recorder.recording = Some(recording);
    }

    /// Appends what was recorded since the last call to the file of the run.
    pub(crate) fn append_recording(&mut self) {
        let frames = self.frames();
        let Recorder { recording, appended, .. } = &mut self.recorder;
        if let (Some(recording), Some(appended), true) = (recording, appended, self.session.is_some()) {
            // What could not be written, as on a full disk, is written with the next part.
            let _ = appended.append(recording, frames);
        }
    }

    /// Saves a recording if there is a folder for it, and sends it to the page that made it.
    pub(crate) fn deliver_recording(&mut self, recording: &Recording) {
        let page_error = self.recorder.page_error.take();
        let written = self.recorder.folder.take().map(|folder| {
            let path = folder.join(STROKES);
            let text = serde_json::to_vec(recording).map_err(io::Error::other);
            text.and_then(|text| files::write_atomically(&path, &text))?;
            // It is whole without it.
            let _ = std::fs::remove_file(folder.join(APPENDED));
            Ok::<_, io::Error>(folder)
        });
        self.recorder.appended = None;
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

    /// Creates a folder with this name and a number, where runs are stored.
    pub(crate) fn new_folder(&mut self, name: &str) -> io::Result<Option<PathBuf>> {
        let Some(out) = &self.recorder.out else { return Ok(None) };
        files::create_folder(out)?;
        for number in 1..MAX_FOLDERS {
            let folder = out.join(format!("{name}-{number}"));
            match files::create_new_folder(&folder) {
                Ok(()) => {
                    self.recorder.made.push(folder.clone());
                    return Ok(Some(folder));
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(io::Error::other(format!("there are ten thousand folders of `{name}`: remove some")))
    }
}
