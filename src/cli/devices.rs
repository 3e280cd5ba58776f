//! `haptograph devices`: the hardware of this machine that a graph can use.

use super::Failure;
use super::built::how_to_build;
use super::result::{CommandResult, show};
use crate::engine::registry::Registry;
use crate::live::midi::{self, midi_ports};
use crate::live::soundcard::{self, Listed, SoundcardError, list};
use crate::live::{BackendEntry, evdev, haply, serial};
use crate::signal::files;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;

/// List the soundcards, tablets, mice, serial ports, MIDI ports and Haply arms of this machine
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Also list the sample formats of each soundcard for playback and capture
    #[arg(long)]
    formats: bool,
    /// Print the list as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let found = match list() {
        Err(SoundcardError::NotBuilt) => Vec::new(),
        found => found.map_err(Failure::message)?,
    };
    let found = Found {
        // None where no service answers.
        arms: haply::list().unwrap_or_default(),
        formats: arguments.formats,
        midi: midi_ports(),
        missing_features: BACKENDS.iter().filter(|of| !of.is_built).map(|of| of.feature).collect(),
        pointers: paths("/dev/input/by-id", "-event-mouse"),
        serial: paths("/dev/serial/by-id", ""),
        soundcards: found,
    };
    show(&found, arguments.json)
}

/// The backends whose devices are listed.
const BACKENDS: [BackendEntry; 5] =
    [soundcard::BACKEND, evdev::BACKEND, serial::BACKEND, midi::BACKEND, haply::BACKEND];

/// The devices of this machine.
#[derive(Serialize)]
struct Found {
    arms: Vec<String>,
    #[serde(skip)]
    formats: bool,
    midi: Vec<String>,
    missing_features: Vec<&'static str>,
    pointers: Vec<String>,
    serial: Vec<String>,
    soundcards: Vec<Listed>,
}

impl CommandResult for Found {
    fn text(&self) -> String {
        let cards: Vec<String> = self.soundcards.iter().map(|card| shown(card, self.formats)).collect();
        let sections = [
            ("`Soundcard`, `SoundcardAccelerometer` and others", &cards),
            ("`EvdevDevice`", &self.pointers),
            ("`SerialInput`", &self.serial),
            ("`MidiInput`", &self.midi),
            ("`HaplyInverse3`", &self.arms),
        ];
        let sections = BACKENDS.into_iter().zip(sections);
        sections.map(|(backend, (kinds, names))| section(backend, kinds, names)).collect()
    }
}

/// A section of the list: the names of the devices, or one line that says why there are none.
fn section(backend: BackendEntry, kinds: &str, names: &[String]) -> String {
    let BackendEntry { what, feature, .. } = backend;
    match (backend.is_built, names) {
        (false, _) => format!("{what}: not in this build; {}\n", how_to_build(&[feature])),
        (true, []) => format!("{what}: none found\n"),
        (true, names) => {
            let lines = names.iter().flat_map(|name| name.lines());
            let lines: String = lines.map(|line| format!("  {line}\n")).collect();
            format!("{what}, for {kinds}:\n{lines}")
        }
    }
}

/// The entries of a folder of device links whose names end in `ending`; empty if the folder does not exist.
fn paths(folder: &str, ending: &str) -> Vec<String> {
    let entries = files::entries(Path::new(folder)).into_iter().flatten().flatten();
    let paths = entries.map(|entry| entry.path().display().to_string());
    let mut paths: Vec<String> = paths.filter(|path| path.ends_with(ending)).collect();
    paths.sort();
    paths
}

fn shown(card: &Listed, formats: bool) -> String {
    let mut text = card.name.clone();
    if !card.about.is_empty() && card.about != card.name {
        // Some systems describe a card in several lines.
        let about = card.about.lines().collect::<Vec<_>>().join(", ");
        let _ = write!(text, "  ({about})");
    }
    let ways = [("plays", &card.plays), ("listens", &card.listens)];
    let able = || ways.iter().filter_map(|(does, ability)| Some((does, ability.as_ref()?)));
    let does = able().map(|(does, ability)| match ability.default {
        true => format!("{does} by default"),
        false => (*does).to_owned(),
    });
    let _ = writeln!(text, "  {}", does.collect::<Vec<_>>().join(", "));
    for (does, ability) in able().filter(|_| formats) {
        for format in &ability.formats {
            let _ = writeln!(text, "    {does}: {format}");
        }
    }
    text
}
