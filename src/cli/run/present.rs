//! What follows a run: its page is opened, its sound is played, where that was asked for.

use super::super::built::cannot_play;
use super::super::{Failure, remark};
use crate::nodes::soundcard::{play_once, ready_to_play};
use crate::report::sound::{self, Sound};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// What is done with the page and the sound of a run.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub struct Present {
    /// Play the vibration on the default soundcard when the run is done, at a safe level; ctrl-C stops it
    #[arg(long, conflicts_with = "live")]
    pub play: bool,
    /// Open the page in the browser when the run is done
    #[arg(long)]
    pub open: bool,
}

impl Present {
    /// Refuses to play where this build or this machine cannot, before anything runs.
    pub fn refuse_silent(self) -> Result<(), Failure> {
        match self.play {
            true => ready_to_play().map_err(|error| cannot_play(&error, "leave it out")),
            false => Ok(()),
        }
    }

    /// Opens the page. A machine without a desktop is no failure of the run.
    pub fn open_page(self, page: &Path) {
        if self.open
            && let Err(why) = open(page)
        {
            remark(&format!("warning: cannot open {}: {why}\n", page.display()));
        }
    }

    /// Plays the sound, until its end or ctrl-C.
    pub fn play_sound(self, sound: Option<Sound>, stop: &AtomicBool) -> Result<(), Failure> {
        if !self.play || stop.load(Ordering::Relaxed) {
            return Ok(());
        }
        let Some(sound) = sound else {
            remark("warning: nothing to play: no actuator or file of this graph gets a vibration\n");
            return Ok(());
        };
        remark(&format!(
            "playing {:.1} s of {}, its highest peak at {} dBFS; ctrl-C stops it\n",
            sound.duration_s(),
            sound.stream.name,
            sound::PEAK_DBFS
        ));
        play_once(sound.samples, sound::RATE_HZ, stop)
            .map_err(|error| cannot_play(&error, "the run is complete"))
    }
}

/// Opens a file with the program that the desktop has for it.
fn open(page: &Path) -> Result<(), String> {
    const OPENER: &str = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        "xdg-open"
    };
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    if OPENER == "xdg-open" && !is_set("DISPLAY") && !is_set("WAYLAND_DISPLAY") {
        return Err(
            "there is no desktop here (neither DISPLAY nor WAYLAND_DISPLAY is set); open it in a browser yourself".to_owned(),
        );
    }
    // As an absolute path, no name is taken for an option.
    let page = page.canonicalize().map_err(|error| error.to_string())?;
    let mut command = Command::new(OPENER);
    command
        .arg(page)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
        .spawn()
        .map(drop)
        .map_err(|error| format!("`{OPENER}` does not start: {error}; open it in a browser yourself"))
}
