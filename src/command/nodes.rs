//! `haptograph nodes`: every kind's ports, settings and example, from the specifications that graphs are checked by.

use super::{Failure, say};
use haptograph_engine::device::{Channel, DeviceEntry};
use haptograph_engine::node::{Flow, KindRule, NodeEntry, Presence, QuantityRule};
use haptograph_engine::registry::Registry;
use haptograph_engine::settings::{SettingSpec, closest};
use std::fmt::Write;

#[derive(clap::Args)]
pub(crate) struct NodesArgs {
    /// A node or device kind
    name: Option<String>,
    /// All of them, as a page in Markdown
    #[arg(long, conflicts_with = "name")]
    markdown: bool,
}

pub(crate) fn nodes(args: &NodesArgs) -> Result<(), Failure> {
    let registry = haptograph_nodes::registry();
    match &args.name {
        _ if args.markdown => say(&page(&registry)),
        None => say(&list(&registry)),
        Some(name) => {
            let node = registry.node(name).map(|entry| node_text(&entry));
            let text = node.or_else(|| registry.device(name).map(|entry| device_text(&entry)));
            say(&text.ok_or_else(|| unknown(&registry, name))?)
        }
    }
}

fn unknown(registry: &Registry, name: &str) -> Failure {
    let names = registry.nodes().iter().map(|entry| entry.spec.name);
    let names = names.chain(registry.devices().iter().map(|entry| entry.spec.name));
    Failure::new(match closest(name, names) {
        Some(near) => format!("there is no node `{name}`; did you mean `{near}`?"),
        None => format!("there is no node `{name}`; `haptograph nodes` lists them all"),
    })
}

fn list(registry: &Registry) -> String {
    let mut text = String::new();
    let mut groups: Vec<&str> = Vec::new();
    for entry in registry.nodes() {
        if !groups.contains(&entry.spec.group) {
            groups.push(entry.spec.group);
        }
    }
    for group in groups {
        let _ = writeln!(text, "{group}");
        for entry in registry.nodes().iter().filter(|entry| entry.spec.group == group) {
            let _ = writeln!(text, "  {:26} {}", entry.spec.name, summary(entry.spec.doc));
        }
    }
    text.push_str("devices\n");
    for entry in registry.devices() {
        let _ = writeln!(text, "  {:26} {}", entry.spec.name, summary(entry.spec.doc));
    }
    text
}

/// All kinds as a page of the book.
pub(crate) fn page(registry: &Registry) -> String {
    let mut text =
        String::from("# Nodes and devices\n\nMade by `haptograph nodes --markdown`; do not edit.\n");
    for entry in registry.nodes() {
        let _ = write!(
            text,
            "\n## {}\n\n```text\n{}```\n",
            entry.spec.name,
            node_text(entry)
        );
    }
    for entry in registry.devices() {
        let _ = write!(
            text,
            "\n## {}\n\n```text\n{}```\n",
            entry.spec.name,
            device_text(entry)
        );
    }
    text
}

fn summary(doc: &str) -> &str {
    doc.split_once(". ")
        .map_or(doc, |(first, _)| first)
        .trim_end_matches('.')
}

fn node_text(entry: &NodeEntry) -> String {
    let spec = entry.spec;
    let mut text = format!("{} ({})\n{}\n", spec.name, spec.group, spec.doc);
    if !spec.source.is_empty() {
        let _ = writeln!(text, "Source: {}", spec.source);
    }
    if !spec.inputs.is_empty() {
        text.push_str("\ninputs\n");
    }
    for input in spec.inputs {
        let presence = match input.presence {
            Presence::Required => "",
            Presence::Optional => ", optional",
            Presence::Many => ", a list",
        };
        let held = if input.flow == Flow::Held { ", held" } else { "" };
        let carries = carries(input.kind, input.quantity);
        let _ = writeln!(text, "  {:22} {carries}{presence}{held}", input.name);
        let _ = writeln!(text, "  {:22}   {}", "", input.doc);
    }
    if !spec.outputs.is_empty() {
        text.push_str("\noutputs\n");
    }
    for output in spec.outputs {
        let _ = writeln!(
            text,
            "  {:22} {}",
            output.name,
            carries(output.kind, output.quantity)
        );
        let _ = writeln!(text, "  {:22}   {}", "", output.doc);
    }
    if entry.has_endpoint() {
        let endpoint = if entry.is_actuator() {
            "the device it drives"
        } else {
            "the device it reads"
        };
        let _ = write!(
            text,
            "\nendpoint: {endpoint}, by its name among the graph's endpoints\n"
        );
    }
    settings_text(&entry.settings(), &mut text);
    example_text(spec.example, &mut text);
    text
}

fn device_text(entry: &DeviceEntry) -> String {
    let spec = entry.spec;
    let simulated = if spec.simulated {
        "simulated device"
    } else {
        "device"
    };
    let mut text = format!("{} ({simulated})\n{}\n", spec.name, spec.doc);
    if !spec.source.is_empty() {
        let _ = writeln!(text, "Source: {}", spec.source);
    }
    for (title, channels) in [("senses", spec.senses), ("is driven by", spec.drives)] {
        channels_text(title, channels, &mut text);
    }
    settings_text(&entry.settings(), &mut text);
    example_text(spec.example, &mut text);
    text
}

fn channels_text(title: &str, channels: &[Channel], text: &mut String) {
    if channels.is_empty() {
        return;
    }
    let _ = write!(text, "\n{title}\n");
    for channel in channels {
        let _ = writeln!(
            text,
            "  {:22} {} {}",
            channel.name, channel.kind, channel.quantity
        );
        let _ = writeln!(text, "  {:22}   {}", "", channel.doc);
    }
}

fn settings_text(settings: &[SettingSpec], text: &mut String) {
    if !settings.is_empty() {
        text.push_str("\nsettings\n");
    }
    for setting in settings {
        let default = match &setting.default {
            Some(default) => format!(" = {default}"),
            None => ", required".to_owned(),
        };
        let range = setting
            .range
            .map_or_else(String::new, |(low, high)| format!(", from {low} to {high}"));
        let live = if setting.live { ", live" } else { "" };
        let _ = writeln!(
            text,
            "  {:22} {}{default}{range}{live}",
            setting.name, setting.expected
        );
        let _ = writeln!(text, "  {:22}   {}", "", setting.doc);
    }
}

fn example_text(example: &str, text: &mut String) {
    if !example.is_empty() {
        let _ = write!(text, "\nexample\n  {example}\n");
    }
}

fn carries(kind: KindRule, quantity: QuantityRule) -> String {
    let kind = match kind {
        KindRule::Is(kind) => kind.to_string(),
        KindRule::Linear => "scalar, 3-vector or wrench".into(),
        KindRule::Any => "any kind".into(),
        KindRule::Same(input) => format!("kind of `{input}`"),
    };
    let quantity = match quantity {
        QuantityRule::Is(quantity) => quantity.to_string(),
        QuantityRule::Any => "any quantity".into(),
        QuantityRule::Same(input) => format!("quantity of `{input}`"),
        QuantityRule::Product(a, b) => format!("`{a}` times `{b}`"),
        QuantityRule::Quotient(a, b) => format!("`{a}` per `{b}`"),
        QuantityRule::PerSecond(input) => format!("`{input}` per second"),
        QuantityRule::TimesSeconds(input) => format!("`{input}` times seconds"),
        QuantityRule::Setting(name) => format!("as `{name}` says"),
    };
    format!("{kind}, {quantity}")
}
