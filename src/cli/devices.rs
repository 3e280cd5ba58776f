//! `haptograph devices`: what of this machine a graph can be connected to.

use super::{Failure, say, say_json};
use crate::engine::registry::Registry;
use crate::nodes::network::inputs::midi_ports;
use crate::nodes::soundcard::{Ability, Listed, list};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// List the soundcards, tablets, mice, serial ports and MIDI ports of this machine
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Also say in which forms of samples each plays and listens
    #[arg(long)]
    formats: bool,
    /// Print the list as JSON
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let found = list().map_err(|error| Failure::Message(error.to_string()))?;
    let pointers = paths("/dev/input/by-id", "-event-mouse");
    let (serial, midi) = (paths("/dev/serial/by-id", ""), midi_ports());
    if arguments.json {
        let soundcards: Vec<Value> = found.iter().map(as_json).collect();
        return say_json(
            &json!({ "soundcards": soundcards, "pointers": pointers, "serial": serial, "midi": midi }),
        );
    }
    let others = [
        ("tablets and mice, for `EvdevDevice`", pointers),
        ("serial ports, for `SerialInput`", serial),
        ("MIDI ports, for `MidiInput`", midi),
    ];
    let mut text: String = found.iter().map(|card| shown(card, arguments.formats)).collect();
    for (what, names) in others.iter().filter(|(_, names)| !names.is_empty()) {
        let _ = writeln!(text, "{what}:\n  {}", names.join("\n  "));
    }
    if found.is_empty() {
        say(&text)?;
        return Err(Failure::Message(
            "there is no soundcard; `haptograph doctor` says what this machine has".to_owned(),
        ));
    }
    say(&text)
}

fn as_json(card: &Listed) -> Value {
    let ability = |ability: &Option<Ability>| {
        let ability = ability.as_ref();
        ability.map(|ability| json!({ "default": ability.default, "formats": ability.formats }))
    };
    json!({ "name": card.name, "about": card.about, "plays": ability(&card.plays), "listens": ability(&card.listens) })
}

/// What a folder of device links holds, where there is one.
fn paths(folder: &str, ending: &str) -> Vec<String> {
    let entries = std::fs::read_dir(Path::new(folder))
        .into_iter()
        .flatten()
        .flatten();
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
    let able = || {
        ways.iter()
            .filter_map(|(does, ability)| Some((does, ability.as_ref()?)))
    };
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
