//! Reference of node and device kinds, generated from the declarations that graphs are checked against.

use haptograph_engine::device::{Channel, DeviceEntry};
use haptograph_engine::document::library::{LibraryTemplate, templates};
use haptograph_engine::node::{Flow, KindRule, NodeEntry, OutputRole, Presence, QuantityRule};
use haptograph_engine::registry::Registry;
use haptograph_engine::settings::{Expected, MAX_LIVE_ITEMS, SettingSpec};
use std::fmt::Write as _;

/// Selection of kinds.
#[derive(Debug, Clone, Default)]
pub struct Filter {
    /// Group; `devices`, `bridges` and `templates` are groups too.
    pub group: Option<String>,
    /// Words that must all occur in the name, group, description or settings.
    pub words: Vec<String>,
}

/// The group of the devices.
pub const DEVICES: &str = "devices";

/// The group of the bridges, which are written around a connection.
pub const BRIDGES: &str = "bridges";

/// The bridges that have settings, with their descriptions.
const WITH_SETTINGS: [(&str, &str); 2] = [
    (
        "Ring",
        "Band-limited interpolation between two drivers, `latency_ms` late: `Ring(from: \"a.b\", latency_ms: 12)`.",
    ),
    ("Delay", "The frame n ticks earlier, on one clock: `Delay(from: \"a.b\", frames: 1)`."),
];

/// The group of the templates, which are used like kinds of nodes once their file is included.
pub const TEMPLATES: &str = "templates";

/// The bridges: their names and descriptions.
pub fn bridges(registry: &Registry) -> impl Iterator<Item = (&'static str, String)> {
    let registered = registry.bridges().iter().map(|entry| {
        let (name, doc) = (entry.spec.name, entry.spec.doc);
        (name, format!("{doc}: `{name}(\"a.b\")`."))
    });
    registered.chain(WITH_SETTINGS.map(|(name, doc)| (name, doc.to_owned())))
}

/// A kind of node or device, a template or a bridge, as a list shows it.
#[derive(Debug, Clone)]
pub struct Listed {
    /// Name.
    pub name: String,
    /// Group.
    pub group: &'static str,
    /// Description.
    pub doc: String,
    /// Settings; empty for templates and bridges.
    pub settings: Vec<SettingSpec>,
}

impl Listed {
    fn new(name: &str, group: &'static str, doc: &str, settings: Vec<SettingSpec>) -> Self {
        Self { name: name.to_owned(), group, doc: doc.to_owned(), settings }
    }
}

impl From<&NodeEntry> for Listed {
    fn from(entry: &NodeEntry) -> Self {
        Self::new(entry.spec.name, entry.spec.group, entry.spec.doc, entry.settings())
    }
}

impl From<&DeviceEntry> for Listed {
    fn from(entry: &DeviceEntry) -> Self {
        Self::new(entry.spec.name, DEVICES, entry.spec.doc, entry.settings())
    }
}

impl From<&LibraryTemplate> for Listed {
    fn from(template: &LibraryTemplate) -> Self {
        Self::new(&template.name, TEMPLATES, &template.about, Vec::new())
    }
}

/// All kinds of nodes, then the templates, the kinds of devices and the bridges.
pub fn all(registry: &Registry) -> Vec<Listed> {
    let templates = templates(registry.library());
    let nodes = registry.nodes().iter().map(Listed::from);
    let nodes = nodes.chain(templates.iter().map(Listed::from));
    let devices = registry.devices().iter().map(Listed::from);
    let bridges = bridges(registry).map(|(name, doc)| Listed::new(name, BRIDGES, &doc, Vec::new()));
    nodes.chain(devices).chain(bridges).collect()
}

impl Filter {
    /// True if a kind is selected.
    pub fn takes(&self, kind: &Listed) -> bool {
        let mut text = format!("{} {} {}", kind.name, kind.group, kind.doc);
        if !self.words.is_empty() {
            add_words(&mut text, &kind.settings);
        }
        self.group.as_deref().is_none_or(|group| group.eq_ignore_ascii_case(kind.group))
            && self.words.iter().all(|word| has_word(&text, word))
    }
}

/// True if a word of the text begins with `beginning`. A name in camel case has several words: `LowPass`.
fn has_word(text: &str, beginning: &str) -> bool {
    let text: Vec<char> = text.chars().collect();
    let wanted: Vec<char> = beginning.to_lowercase().chars().collect();
    let begins = |at: usize| match at.checked_sub(1).map(|before| text[before]) {
        Some(before) => !before.is_alphanumeric() || before.is_lowercase() && text[at].is_uppercase(),
        None => true,
    };
    (0..text.len()).filter(|at| begins(*at)).any(|at| {
        let found = text[at..].iter().flat_map(|c| c.to_lowercase());
        found.take(wanted.len()).eq(wanted.iter().copied())
    })
}

/// Appends names and descriptions of settings to a searched text.
fn add_words(text: &mut String, settings: &[SettingSpec]) {
    for setting in settings {
        *text += &format!(" {} {}", setting.name, setting.doc);
        for part in &setting.parts {
            *text += &format!(" {} {}", part.choice.unwrap_or_default(), part.doc);
            add_words(text, &part.fields);
        }
    }
}

/// A line per kind, by group, wrapped at `width` characters; empty if the filter selects nothing.
pub fn list(registry: &Registry, filter: &Filter, width: usize) -> String {
    let mut found = all(registry);
    found.retain(|kind| filter.takes(kind));
    let names = found.iter().map(|kind| kind.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for group in all_groups(registry) {
        let mut of_group = found.iter().filter(|kind| kind.group == group).peekable();
        if of_group.peek().is_none() {
            continue;
        }
        if !text.is_empty() {
            text.push('\n');
        }
        text += match group {
            DEVICES => "devices (under `endpoints`)",
            BRIDGES => "bridges (around a connection to another clock)",
            TEMPLATES => "templates (of the library, by `include`)",
            group => group,
        };
        text.push('\n');
        for Listed { name, doc, .. } in of_group {
            let indent = names + 4;
            let lines = wrapped(&first_sentence(doc), width.saturating_sub(indent).max(20));
            let _ = writeln!(text, "  {name:names$}  {}", lines.join(&format!("\n{:indent$}", "")));
        }
    }
    text
}

/// Lines of at most `width` characters; a longer word has its own line.
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

/// The groups of nodes in the order of the reference, then templates, devices and bridges.
pub fn all_groups(registry: &Registry) -> Vec<&'static str> {
    let nodes = groups(registry).into_iter();
    nodes.chain([TEMPLATES, DEVICES, BRIDGES]).collect()
}

/// The description of the node, template, device or bridge of this name.
pub fn kind(registry: &Registry, name: &str) -> Option<String> {
    let node = registry.node_meant(name).map(|entry| node_text(&entry));
    node.or_else(|| registry.device(name).map(|entry| device_text(&entry)))
        .or_else(|| template_text(registry, name))
        .or_else(|| bridge_text(registry, name))
}

fn template_text(registry: &Registry, name: &str) -> Option<String> {
    let templates = templates(registry.library());
    let template = templates.iter().find(|template| template.name == name)?;
    Some(format!("{name} ({TEMPLATES})\n\n{}", body_of_template(template)))
}

fn body_of_template(template: &LibraryTemplate) -> String {
    let mut text = format!(
        "{} A template of the library, available by `include: [\"{}\"]`.\n",
        one_line(&template.about),
        template.file
    );
    for (title, names) in [("Inputs", &template.inputs), ("Outputs", &template.outputs)] {
        text += &format!("\n{title}:\n\n");
        names.iter().for_each(|name| text += &format!("- `{name}`\n"));
    }
    text += "\nSettings:\n\n";
    for (name, default) in &template.settings {
        let default = default.as_ref();
        let default = default.map_or_else(|| "required".to_owned(), |text| format!("default `{text}`"));
        text += &format!("- `{name}` ({default})\n");
    }
    let given = template.settings.iter().filter(|(_, default)| default.is_none());
    let given = given.map(|(name, _)| format!("{name}: ..."));
    let connected = template.inputs.iter().map(|name| format!("{name}: \"node.output\""));
    let fields: Vec<String> = given.chain(connected).collect();
    text + &format!("\nExample:\n\n```text\n\"name\": {}({})\n```\n", template.name, fields.join(", "))
}

fn bridge_text(registry: &Registry, name: &str) -> Option<String> {
    let (_, doc) = bridges(registry).find(|(known, _)| *known == name)?;
    Some(format!(
        "{name} (a bridge between clocks, written around a connection)\n\n{doc}\n\nSee docs/format.md.\n"
    ))
}

/// The settings with a choice of this name, each with its kind.
pub fn choosing(registry: &Registry, name: &str) -> Vec<(String, &'static str)> {
    let mut found = Vec::new();
    for kind in all(registry) {
        let has_choice = |setting: &&SettingSpec| setting.parts.iter().any(|part| part.choice == Some(name));
        let settings = kind.settings.iter().filter(has_choice);
        found.extend(settings.map(|setting| (kind.name.clone(), setting.name)));
    }
    found
}

/// The whole reference in Markdown.
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
    text += &format!("\n## {TEMPLATES}\n");
    for template in templates(registry.library()) {
        text += &format!("\n### {}\n\n{}", template.name, body_of_template(&template));
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
    format!("{} ({})\n\n{}", entry.spec.name, entry.spec.group, body_of_node(entry))
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
            Presence::Named => ", a map from names or a list",
        };
        notes += if port.flow == Flow::Held { ", held" } else { "" };
        (port.name, notes, port.doc)
    });
    ports(&mut text, "Inputs", inputs);
    let outputs = spec.outputs.iter().map(|port| {
        let mut notes = format!("{}, {}", kind_rule(port.kind), quantity_rule(port.quantity));
        if let Some(setting) = port.count.named_by() {
            notes += &format!(", one for each of `{setting}`");
        }
        if let OutputRole::Shortfall(reasons) = port.role {
            let reasons = reasons.iter().enumerate();
            reasons.for_each(|(index, reason)| notes += &format!("; {}: {reason}", index + 1));
        }
        (port.name, notes, port.doc)
    });
    ports(&mut text, "Outputs", outputs);
    settings(&mut text, &entry.settings());
    example(&mut text, spec.example);
    text
}

fn body_of_device(entry: &DeviceEntry) -> String {
    let spec = entry.spec;
    let mut text = format!("{}{}\n", one_line(spec.doc), if spec.simulated { " Simulated." } else { "" });
    source(&mut text, spec.source);
    let channel = |c: &'static Channel| (c.name, format!("{}, {}", c.kind, c.quantity), c.doc);
    ports(&mut text, "Read by sources", spec.senses.iter().map(channel));
    ports(&mut text, "Driven by sinks", spec.drives.iter().map(channel));
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
        let default =
            setting.default.as_ref().map_or_else(|| "required".to_owned(), |d| format!("default `{d}`"));
        let range = setting
            .range
            .map_or_else(String::new, |(low, high)| format!(", {} to {}", shortly(low), shortly(high)));
        let rate = if setting.below_nyquist { ", below half the rate" } else { "" };
        let live = match (setting.live, &setting.expected) {
            (false, _) => "".to_owned(),
            (true, Expected::List(_)) => {
                format!(", each can be changed while running if there are at most {MAX_LIVE_ITEMS}")
            }
            (true, Expected::Array(..)) => ", each can be changed while running".to_owned(),
            (true, _) => ", can be changed while running".to_owned(),
        };
        let unit = setting.unit.as_ref();
        let unit = unit.map_or_else(String::new, |unit| format!(", in {}", unit.symbol));
        let (name, expected, doc) = (setting.name, &setting.expected, one_line(&setting.doc));
        let _ = writeln!(text, "{indent}- `{name}` ({expected}{unit}{range}{rate}, {default}{live}): {doc}");
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

/// A number in the fewest characters: `16`, `0.01`, `1e6`.
fn shortly(number: f64) -> String {
    let (plain, short) = (number.to_string(), format!("{number:e}"));
    match short.len() < plain.len() && !(1e-3..1e6).contains(&number.abs()) {
        true => short,
        false => plain,
    }
}

fn example(text: &mut String, example: &str) {
    if !example.is_empty() {
        *text += &format!("\nExample:\n\n```ron\n{example}\n```\n");
    }
}

/// The signal kind of a port, in words.
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
    fn numbers_are_as_short_as_they_can_be() {
        let shown = [1.0, 16.0, 0.01, 20_000.0, 1e6, -1e9, 1e-6, 0.0].map(shortly);
        assert_eq!(shown, ["1", "16", "0.01", "20000", "1e6", "-1e9", "1e-6", "0"]);
    }

    #[test]
    fn bridges_and_choices_are_known_by_their_names() {
        let registry = haptograph_nodes::registry();
        assert!(kind(&registry, "Linear").is_some_and(|text| text.contains("docs/format.md")));
        assert!(kind(&registry, "Texture").is_some_and(|text| text.contains("std/texture.ron") && text.contains("`surface` (required)")));
        assert!(choosing(&registry, "ZigZag").contains(&("SimulatedTablet".to_owned(), "stroke")));
        assert_eq!(choosing(&registry, "NoSuchChoice"), []);
    }

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
        // By a setting, and by what is no kind of node.
        assert!(found(None, &["cutoff_hz"]).contains("SpeedEstimator"));
        assert!(found(None, &["straight", "line"]).contains("Linear"));
        assert_eq!(found(None, &["no such thing at all"]), "");
        // Where a word begins, and by words that people search for.
        assert!(!found(None, &["lfo"]).contains("NormalForce") && found(None, &["lfo"]).contains("Sine"));
        let by_word = [
            ("oscillator", "Phase"),
            ("maximum", "Expression"),
            ("lookup", "Curve"),
            ("cut-off", "Biquad"),
            ("random", "Noise"),
            ("pass", "LowPass"),
            ("texture", "Texture "),
            // By their names in other programs.
            ("Lag", "LowPass"),
            ("Latch", "SampleHold"),
            ("LFNoise", "Noise"),
            ("sah", "SampleHold"),
            ("tapper", "Tapping"),
        ];
        for (word, kind) in by_word {
            assert!(found(None, &[word]).contains(kind), "{word}");
        }
        assert!(found(None, &[]).lines().all(|line| line.chars().count() <= 60));
    }
}
