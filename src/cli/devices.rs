//! `haptograph devices`: the hardware of this machine that a graph can use.

use super::built::how_to_build;
use super::{Failure, print, print_json};
use crate::engine::registry::Registry;
use crate::live::midi::{self, midi_ports};
use crate::live::soundcard::{self, Ability, Listed, SoundcardError, list};
use crate::live::{BackendEntry, evdev, serial};
use crate::signal::files;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// List the soundcards, tablets, mice, serial ports and MIDI ports of this machine
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Also list the sample formats of each soundcard for playback and capture
    #[arg(long)]
    formats: bool,
    /// Print the list as JSON
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let found = match list() {
        Err(SoundcardError::NotBuilt) => Vec::new(),
        found => found.map_err(|error| Failure::Message(error.to_string()))?,
    };
    let pointers = paths("/dev/input/by-id", "-event-mouse");
    let (serial_ports, ports) = (paths("/dev/serial/by-id", ""), midi_ports());
    if arguments.json {
        let soundcards: Vec<Value> = found.iter().map(as_json).collect();
        let all = [soundcard::BACKEND, evdev::BACKEND, serial::BACKEND, midi::BACKEND];
        let missing = all.iter().filter(|backend| !backend.is_built);
        let missing: Vec<&str> = missing.map(|backend| backend.feature).collect();
        return print_json(&json!({
            "soundcards": soundcards, "pointers": pointers, "serial": serial_ports, "midi": ports,
            "missing_features": missing,
        }));
    }
    let cards = found.iter().map(|card| shown(card, arguments.formats)).collect();
    let sections = [
        (soundcard::BACKEND, "`Soundcard`, `SoundcardAccelerometer` and others", cards),
        (evdev::BACKEND, "`EvdevDevice`", pointers),
        (serial::BACKEND, "`SerialInput`", serial_ports),
        (midi::BACKEND, "`MidiInput`", ports),
    ];
    let text: String =
        sections.iter().map(|(backend, kinds, names)| section(*backend, kinds, names)).collect();
    print(&text)
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

fn as_json(card: &Listed) -> Value {
    let ability = |ability: &Option<Ability>| {
        let ability = ability.as_ref();
        ability.map(|ability| json!({ "default": ability.default, "formats": ability.formats }))
    };
    json!({ "name": card.name, "about": card.about, "plays": ability(&card.plays), "listens": ability(&card.listens) })
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
