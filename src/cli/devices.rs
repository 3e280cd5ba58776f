//! `haptograph devices`: the soundcards of this machine.

use super::{Failure, say, say_json};
use crate::engine::registry::Registry;
use crate::nodes::soundcard::{Ability, Listed, list};
use serde_json::{Value, json};
use std::fmt::Write;

/// List the soundcards of this machine
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
    if found.is_empty() {
        return Err(Failure::Message(
            "there is no soundcard; `haptograph doctor` says what this machine has".to_owned(),
        ));
    }
    if arguments.json {
        return say_json(&found.iter().map(as_json).collect::<Vec<_>>());
    }
    let text: String = found.iter().map(|card| shown(card, arguments.formats)).collect();
    say(&text)
}

fn as_json(card: &Listed) -> Value {
    let ability = |ability: &Option<Ability>| {
        let ability = ability.as_ref();
        ability.map(|ability| json!({ "default": ability.default, "formats": ability.formats }))
    };
    json!({ "name": card.name, "about": card.about, "plays": ability(&card.plays), "listens": ability(&card.listens) })
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
