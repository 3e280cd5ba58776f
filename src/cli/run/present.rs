//! Opens the page and plays the sound after a run, if requested.

use super::super::built::cannot_play;
use super::super::{Failure, eprint};
use crate::live::soundcard::{play_once, ready_to_play};
use crate::report::sound::{self, Sound};
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// Flags for the page and the sound of a run.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub(crate) struct Present {
    /// Play the vibration on the default soundcard when the run is done, at a safe level; ctrl-C stops it
    #[arg(long, conflicts_with = "live")]
    pub play: bool,
    /// Open the page in the browser when the run is done
    #[arg(long)]
    pub open: bool,
}

impl Present {
    /// Refuses to play where this build or this machine cannot, before anything runs.
    pub(crate) fn refuse_silent(self) -> Result<(), Failure> {
        match self.play {
            true => ready_to_play().map_err(|error| cannot_play(&error, "leave it out")),
            false => Ok(()),
        }
    }

    /// Opens the page. A failure, for example without a desktop, does not fail the run.
    pub(crate) fn open_page(self, page: &Path) {
        if self.open
            // An absolute path is never read as an option.
            && let Err(why) = page.canonicalize().map_err(|error| error.to_string()).and_then(|page| open(page.as_ref()))
        {
            eprint(&format!("warning: cannot open {}: {why}\n", page.display()));
        }
    }

    /// Plays the sound to its end or until ctrl-C.
    pub(crate) fn play_sound(self, sound: Option<Sound>, stop: &AtomicBool) -> Result<(), Failure> {
        if !self.play || stop.load(Ordering::Relaxed) {
            return Ok(());
        }
        let Some(sound) = sound else {
            eprint("warning: nothing to play: no actuator or file of this graph receives a vibration\n");
            return Ok(());
        };
        eprint(&format!(
            "playing {:.1} s of {}, its highest peak at {} dBFS; ctrl-C stops it\n",
            sound.duration_s(),
            sound.stream.name,
            sound::PEAK_DBFS
        ));
        play_once(sound.samples, sound::RATE_HZ, stop)
            .map_err(|error| cannot_play(&error, "the run is complete"))
    }
}

/// Opens a file or an address with the desktop's program for it.
pub(crate) fn open(page: &OsStr) -> Result<(), String> {
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
            "no desktop found (neither DISPLAY nor WAYLAND_DISPLAY is set); open the page in a browser yourself".to_owned(),
        );
    }
    let mut command = Command::new(OPENER);
    command.arg(page).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
        .spawn()
        .map(drop)
        .map_err(|error| format!("cannot start `{OPENER}`: {error}; open the page in a browser yourself"))
}
