//! `haptograph nodes`: reference of nodes, devices, bridges and templates, from the declarations that graphs
//! are checked against.

use super::{Failure, print, print_json};
use crate::engine::device::{Channel, DeviceEntry};
use crate::engine::document::library::{LibraryTemplate, templates};
use crate::engine::node::{InputSpec, NodeEntry, OutputSpec, Presence};
use crate::engine::registry::Registry;
use crate::engine::settings::{Part, SettingSpec, closest};
use crate::report::reference::{self, Filter, Listed};
use serde_json::{Value, json};

/// List the kinds of nodes, devices and bridges and the library's templates, or describe one of them
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// A kind of node or device, a template, or a bridge
    name: Option<String>,
    /// List the kinds of this group only
    #[arg(long, conflicts_with_all = ["name", "markdown"])]
    group: Option<String>,
    /// List the kinds with a word that begins like this in their name, group, description or settings; can be
    /// repeated
    #[arg(long, value_name = "WORD", conflicts_with_all = ["name", "markdown"])]
    find: Vec<String>,
    /// Print the whole reference as Markdown
    #[arg(long, conflicts_with = "name")]
    markdown: bool,
    /// Print kinds with their ports and settings as JSON
    #[arg(long, conflicts_with = "markdown")]
    json: bool,
}

/// Line width in characters if the terminal does not report its own.
const WIDTH: usize = 100;

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    let filter = Filter { group: arguments.group.clone(), words: arguments.find.clone() };
    match &arguments.name {
        None if arguments.markdown => print(&reference::book(registry)),
        None if arguments.json => print_json(&kinds(registry, &|kind| filter.takes(kind))),
        None => print(&listed(registry, &filter)?),
        Some(name) => match reference::kind(registry, name) {
            Some(text) if arguments.json => match kinds(registry, &|kind| kind.name == *name).first() {
                Some(named) => print_json(named),
                None => print_json(&json!({ "name": name, "group": reference::BRIDGES, "doc": text })),
            },
            Some(text) => print(&text),
            None => Err(unknown(registry, name)),
        },
    }
}

/// The list, or an error with advice if it is empty.
fn listed(registry: &Registry, filter: &Filter) -> Result<String, Failure> {
    let groups = reference::all_groups(registry);
    if let Some(group) = &filter.group
        && !groups.iter().any(|known| known.eq_ignore_ascii_case(group))
    {
        let help = closest(group, groups.iter().copied()).map_or_else(
            || format!("the groups are {}", groups.join(", ")),
            |near| format!("did you mean `{near}`?"),
        );
        return Err(Failure::Message(format!("unknown group `{group}`; {help}")));
    }
    let width = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
    match reference::list(registry, filter, width.unwrap_or(WIDTH)) {
        text if text.is_empty() => {
            Err(Failure::Message(format!("no kind contains all of these words: {}", filter.words.join(", "))))
        }
        text => Ok(text),
    }
}

/// The selected kinds of nodes, then templates and devices.
fn kinds(registry: &Registry, takes: &dyn Fn(&Listed) -> bool) -> Vec<Value> {
    let nodes = registry.nodes().iter().filter(|entry| takes(&Listed::from(*entry))).map(node);
    let templates = templates(registry.library()).into_iter();
    let templates = templates.filter(|one| takes(&Listed::from(one))).map(template);
    let devices = registry.devices().iter().filter(|entry| takes(&Listed::from(*entry))).map(device);
    nodes.chain(templates).chain(devices).collect()
}

fn node(entry: &NodeEntry) -> Value {
    let spec = entry.spec;
    let input = |port: &InputSpec| {
        json!({
            "name": port.name, "kind": reference::kind_rule(port.kind),
            "quantity": reference::quantity_rule(port.quantity), "doc": port.doc,
            "required": port.presence != Presence::Optional, "list": port.presence.is_several(),
            "named": port.presence == Presence::Named,
        })
    };
    let output = |port: &OutputSpec| {
        json!({
            "name": port.name, "kind": reference::kind_rule(port.kind),
            "quantity": reference::quantity_rule(port.quantity), "doc": port.doc,
            "named_by": port.count.named_by(),
        })
    };
    json!({
        "name": spec.name, "group": spec.group, "doc": spec.doc, "source": spec.source, "example": spec.example,
        "inputs": list(spec.inputs, input), "outputs": list(spec.outputs, output),
        "settings": list(&entry.settings(), setting),
    })
}

fn device(entry: &DeviceEntry) -> Value {
    let spec = entry.spec;
    let channel = |channel: &Channel| {
        json!({
            "name": channel.name, "kind": channel.kind.to_string(),
            "quantity": channel.quantity.to_string(), "doc": channel.doc,
        })
    };
    json!({
        "name": spec.name, "group": reference::DEVICES, "doc": spec.doc, "source": spec.source,
        "simulated": spec.simulated, "senses": list(spec.senses, channel), "drives": list(spec.drives, channel),
        "settings": list(&entry.settings(), setting),
    })
}

fn template(template: LibraryTemplate) -> Value {
    let named = |name: &String| json!({ "name": name });
    json!({
        "name": template.name, "group": reference::TEMPLATES, "doc": template.about, "include": template.file,
        "inputs": list(&template.inputs, named), "outputs": list(&template.outputs, named),
        "settings": list(&template.settings, |(name, default)| json!({ "name": name, "default": default })),
    })
}

fn list<T>(items: &[T], shown: impl Fn(&T) -> Value) -> Vec<Value> {
    items.iter().map(shown).collect()
}

fn setting(spec: &SettingSpec) -> Value {
    let part = |part: &Part| json!({ "choice": part.choice, "doc": part.doc, "fields": list(&part.fields, setting) });
    json!({
        "name": spec.name, "doc": spec.doc, "expected": spec.expected.to_string(), "default": spec.default,
        "unit": spec.unit.as_ref().map(|unit| &unit.symbol),
        "si_per_unit": spec.unit.as_ref().and_then(|unit| Some(unit.scale?.1)),
        "min": spec.range.map(|range| range.0), "max": spec.range.map(|range| range.1), "live": spec.live,
        "parts": list(&spec.parts, part),
    })
}

fn unknown(registry: &Registry, name: &str) -> Failure {
    if let [(kind, setting), more @ ..] = &reference::choosing(registry, name)[..] {
        let others = match more.len() {
            0 => String::new(),
            others => format!(" and of {others} more"),
        };
        return Failure::Message(format!(
            "`{name}` is not a kind but a value of the setting `{setting}` of `{kind}`{others}; `haptograph \
             nodes {kind}` describes it"
        ));
    }
    let known = reference::all(registry);
    let near = closest(name, known.iter().map(|kind| kind.name.as_str()));
    let help = near.map_or_else(
        || format!("`haptograph nodes --find {name}` searches the descriptions"),
        |near| format!("did you mean `{near}`?"),
    );
    Failure::Message(format!("unknown kind `{name}`; {help}"))
}
