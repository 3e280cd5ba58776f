//! The reference of node and device kinds, from the declarations that graphs are checked against, so that it cannot
//! be out of date.

use haptograph_engine::device::{Channel, DeviceEntry};
use haptograph_engine::node::{Flow, KindRule, NodeEntry, Presence, QuantityRule};
use haptograph_engine::registry::Registry;
use haptograph_engine::settings::SettingSpec;
use std::fmt::Write as _;

/// Which kinds are listed.
#[derive(Debug, Clone, Default)]
pub struct Filter {
    /// Those of this group; `devices` are a group of their own.
    pub group: Option<String>,
    /// Those with all of these words in their name, group or description.
    pub words: Vec<String>,
}

/// The group of the devices.
pub const DEVICES: &str = "devices";

impl Filter {
    /// Is a kind of this name, group and description listed?
    pub fn takes(&self, name: &str, group: &str, doc: &str) -> bool {
        let text = format!("{name} {group} {doc}").to_lowercase();
        self.group
            .as_deref()
            .is_none_or(|wanted| wanted.eq_ignore_ascii_case(group))
            && self.words.iter().all(|word| text.contains(&word.to_lowercase()))
    }
}

/// A line a kind, by group, wrapped at this width in characters; empty where nothing fits the filter.
pub fn list(registry: &Registry, filter: &Filter, width: usize) -> String {
    let entries = registry
        .nodes()
        .iter()
        .map(|entry| (entry.spec.group, entry.spec.name, entry.spec.doc));
    let devices = registry
        .devices()
        .iter()
        .map(|entry| (DEVICES, entry.spec.name, entry.spec.doc));
    let found: Vec<_> = entries
        .chain(devices)
        .filter(|(group, name, doc)| filter.takes(name, group, doc))
        .collect();
    let names = found.iter().map(|(_, name, _)| name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for group in all_groups(registry) {
        let mut of_group = found.iter().filter(|(of, ..)| *of == group).peekable();
        if of_group.peek().is_none() {
            continue;
        }
        if !text.is_empty() {
            text.push('\n');
        }
        text += if group == DEVICES {
            "devices (under `endpoints`)"
        } else {
            group
        };
        text.push('\n');
        for (_, name, doc) in of_group {
            let indent = names + 4;
            let lines = wrapped(&first_sentence(doc), width.saturating_sub(indent).max(20));
            let _ = writeln!(
                text,
                "  {name:names$}  {}",
                lines.join(&format!("\n{:indent$}", ""))
            );
        }
    }
    text
}

/// Lines of at most so many characters; a longer word has a line of its own.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = vec![String::new()];
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// The groups of nodes in the order of the reference, then the devices.
pub fn all_groups(registry: &Registry) -> Vec<&'static str> {
    groups(registry).into_iter().chain([DEVICES]).collect()
}

/// All about the node or device kind of this name.
pub fn kind(registry: &Registry, name: &str) -> Option<String> {
    let node = registry.node(name).map(|entry| node_text(&entry));
    node.or_else(|| registry.device(name).map(|entry| device_text(&entry)))
}

/// The whole reference, a chapter of the book.
pub fn book(registry: &Registry) -> String {
    let mut text =
        "# Nodes and devices\n\nMade by `haptograph nodes --markdown` from the code that runs them.\n"
            .to_owned();
    for group in groups(registry) {
        text += &format!("\n## {group}\n");
        for entry in registry.nodes().iter().filter(|entry| entry.spec.group == group) {
            text += &format!("\n### {}\n\n{}", entry.spec.name, body_of_node(entry));
        }
    }
    text += "\n## devices\n";
    for entry in registry.devices() {
        text += &format!("\n### {}\n\n{}", entry.spec.name, body_of_device(entry));
    }
    text
}

fn groups(registry: &Registry) -> Vec<&'static str> {
    let mut groups: Vec<&'static str> = Vec::new();
    for entry in registry.nodes() {
        if !groups.contains(&entry.spec.group) {
            groups.push(entry.spec.group);
        }
    }
    groups
}

fn node_text(entry: &NodeEntry) -> String {
    format!(
        "{} ({})\n\n{}",
        entry.spec.name,
        entry.spec.group,
        body_of_node(entry)
    )
}

fn device_text(entry: &DeviceEntry) -> String {
    format!("{} (device)\n\n{}", entry.spec.name, body_of_device(entry))
}

fn body_of_node(entry: &NodeEntry) -> String {
    let spec = entry.spec;
    let mut text = format!("{}\n", one_line(spec.doc));
    source(&mut text, spec.source);
    let inputs = spec.inputs.iter().map(|port| {
        let mut notes = format!("{}, {}", kind_rule(port.kind), quantity_rule(port.quantity));
        notes += match port.presence {
            Presence::Required => "",
            Presence::Optional => ", optional",
            Presence::Many => ", a list",
        };
        notes += if port.flow == Flow::Held { ", held" } else { "" };
        (port.name, notes, port.doc)
    });
    ports(&mut text, "Inputs", inputs);
    let outputs = spec.outputs.iter().map(|port| {
        (
            port.name,
            format!("{}, {}", kind_rule(port.kind), quantity_rule(port.quantity)),
            port.doc,
        )
    });
    ports(&mut text, "Outputs", outputs);
    settings(&mut text, &entry.settings());
    example(&mut text, spec.example);
    text
}

fn body_of_device(entry: &DeviceEntry) -> String {
    let spec = entry.spec;
    let mut text = format!(
        "{}{}\n",
        one_line(spec.doc),
        if spec.simulated { " Simulated." } else { "" }
    );
    source(&mut text, spec.source);
    let channel = |c: &'static Channel| (c.name, format!("{}, {}", c.kind, c.quantity), c.doc);
    ports(&mut text, "Senses", spec.senses.iter().map(channel));
    ports(&mut text, "Is driven by", spec.drives.iter().map(channel));
    settings(&mut text, &entry.settings());
    example(&mut text, spec.example);
    text
}

fn source(text: &mut String, source: &str) {
    if !source.is_empty() {
        *text += &format!("\nSource: {source}.\n");
    }
}

fn ports<'a>(text: &mut String, title: &str, list: impl Iterator<Item = (&'a str, String, &'a str)>) {
    let mut list = list.peekable();
    if list.peek().is_none() {
        return;
    }
    *text += &format!("\n{title}:\n\n");
    for (name, notes, doc) in list {
        // Writing into a string cannot fail.
        let _ = writeln!(text, "- `{name}` ({notes}): {}", one_line(doc));
    }
}

fn settings(text: &mut String, list: &[SettingSpec]) {
    if list.is_empty() {
        return;
    }
    *text += "\nSettings:\n\n";
    fields(text, list, 0);
}

fn fields(text: &mut String, list: &[SettingSpec], depth: usize) {
    let indent = "  ".repeat(depth);
    for setting in list {
        let default = setting
            .default
            .as_ref()
            .map_or_else(|| "required".to_owned(), |d| format!("default `{d}`"));
        let range = setting
            .range
            .map_or_else(String::new, |(low, high)| format!(", {low:?} to {high:?}"));
        let live = if setting.live {
            ", can be changed while running"
        } else {
            ""
        };
        let (name, expected, doc) = (setting.name, &setting.expected, one_line(&setting.doc));
        let _ = writeln!(
            text,
            "{indent}- `{name}` ({expected}{range}, {default}{live}): {doc}"
        );
        for part in &setting.parts {
            let Some(choice) = part.choice else {
                fields(text, &part.fields, depth + 1);
                continue;
            };
            let _ = writeln!(text, "{indent}  - `{choice}`: {}", one_line(&part.doc));
            fields(text, &part.fields, depth + 2);
        }
    }
}

fn example(text: &mut String, example: &str) {
    if !example.is_empty() {
        *text += &format!("\nExample:\n\n```ron\n{example}\n```\n");
    }
}

/// What a port takes or gives, in words.
pub fn kind_rule(rule: KindRule) -> String {
    match rule {
        KindRule::Is(kind) => kind.to_string(),
        KindRule::Linear => "scalar, 3-vector or wrench".to_owned(),
        KindRule::Any => "any kind".to_owned(),
        KindRule::Same(port) => format!("kind of `{port}`"),
    }
}

/// The quantity of a port, in words.
pub fn quantity_rule(rule: QuantityRule) -> String {
    match rule {
        QuantityRule::Is(quantity) => quantity.to_string(),
        QuantityRule::Any => "any quantity".to_owned(),
        QuantityRule::Same(port) => format!("quantity of `{port}`"),
        QuantityRule::Product(a, b) => format!("`{a}` times `{b}`"),
        QuantityRule::Quotient(a, b) => format!("`{a}` divided by `{b}`"),
        QuantityRule::PerSecond(port) => format!("`{port}` per second"),
        QuantityRule::TimesSeconds(port) => format!("`{port}` times seconds"),
        QuantityRule::Setting(name) => format!("as `{name}` says"),
    }
}

fn one_line(doc: &str) -> String {
    doc.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn first_sentence(doc: &str) -> String {
    let doc = one_line(doc);
    match doc.split_once(". ") {
        Some((first, _)) => format!("{first}."),
        None => doc,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_found_by_words_and_group() {
        let registry = haptograph_nodes::registry();
        let found = |group: Option<&str>, words: &[&str]| {
            let filter = Filter {
                group: group.map(str::to_owned),
                words: words.iter().map(|word| (*word).to_owned()).collect(),
            };
            list(&registry, &filter, 60)
        };
        assert!(found(None, &["ENVELOPE", "attack"]).contains("Adsr"));
        let filters = found(Some("filters"), &[]);
        assert!(filters.contains("LowPass") && !filters.contains("Adsr"));
        assert!(found(Some("devices"), &[]).contains("SimulatedHaptuator"));
        assert_eq!(found(None, &["no such thing at all"]), "");
        assert!(found(None, &[]).lines().all(|line| line.chars().count() <= 60));
    }
}
