//! Devices of the selected endpoints, and the nodes that read and drive them.

use super::check::{CheckOptions, Hosted};
use super::clocks::Clocks;
use super::draft::{Context, Draft, DraftNode, Type};
use super::expand::parts;
use super::values::{Parameters, Place, in_order, suggest};
use crate::device::{Channel, DeviceEntry};
use crate::diagnostic::{Diagnostic, Span};
use crate::document::Document;
use crate::document::value::{Body, Name, Shape, Tagged, Value};
use crate::node::{KindRule, QuantityRule};
use crate::registry::Registry;
use crate::settings::{Fields, Setting};
use haptograph_signal::quantity::Quantity;
use std::collections::HashMap;

/// A device as declared.
pub(super) struct DraftDevice {
    pub name: String,
    pub span: Span,
    pub entry: DeviceEntry,
    pub fields: Fields,
    pub uses: Vec<(Span, Span)>,
    /// Channels that nodes can read and drive; for a host endpoint those that they use.
    pub senses: Vec<Channel>,
    pub drives: Vec<Channel>,
    pub clock: Option<usize>,
    /// True if a node is bound to it.
    pub bound: bool,
    pub broken: bool,
}

/// The devices of the selected set.
#[derive(Default)]
pub(super) struct Devices {
    pub list: Vec<DraftDevice>,
    /// Index by name; `None` after a reported error.
    names: HashMap<String, Option<usize>>,
    set: String,
    hosted: Hosted,
}

/// Reads the devices of the set that the options name.
pub(super) fn read(
    cx: &mut Context<'_>,
    parameters: &mut Parameters,
    draft: &Draft,
    options: &CheckOptions,
) -> Option<Devices> {
    let document = cx.document;
    let set = options.endpoints.as_str();
    let mut devices = Devices { set: set.to_owned(), hosted: options.hosted.clone(), ..Devices::default() };
    let Some((_, declared)) = document.endpoints.iter().find(|(name, _)| name.text == set) else {
        let needed = draft.nodes.iter().find(|node| node.entry.has_endpoint());
        let declared = document.endpoints.iter().map(|(name, _)| name.text.as_str());
        if needed.is_none() && document.endpoints.is_empty() {
            return Some(devices);
        }
        if document.endpoints.is_empty() || options.hosted == Hosted::All {
            return Some(devices); // Every node that needs a device reports it.
        }
        let diagnostic =
            Diagnostic::error("E0210", Span::default(), format!("the graph has no set of endpoints `{set}`"))
                .of_no_place();
        let diagnostic = suggest(cx, diagnostic, set, declared, "its sets are", "");
        cx.report(diagnostic);
        return None;
    };
    // A parameter that another set uses is not unused.
    for (_, others) in document.endpoints.iter().filter(|(name, _)| name.text != set) {
        for (_, value) in others {
            parameters.replace(cx, value, Place::Graph, &mut Vec::new());
        }
    }
    for (name, value) in declared {
        let device = match options.hosted.has(&name.text) {
            true => {
                // The declaration is ignored except for its parameters.
                parameters.replace(cx, value, Place::Graph, &mut Vec::new());
                Some(hosted(cx, &name.text, name.span))
            }
            false => device(cx, parameters, name, value),
        };
        let place = device.map(|device| {
            devices.list.push(device);
            devices.list.len() - 1
        });
        devices.names.insert(name.text.clone(), place);
    }
    Some(devices)
}

/// A device as a set of endpoints declares it, with its parameters' values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeclaredDevice {
    /// Name of the endpoint.
    pub endpoint: String,
    /// Declaration as one line of RON, settings sorted by name.
    pub written: String,
    /// True if its kind is a simulation. An unregistered kind counts as real.
    pub is_simulated: bool,
    /// True if the device is an endpoint of the calling program.
    pub is_host: bool,
}

/// The devices of the set that the options select, whether or not this build has their kinds.
pub fn declared_devices(
    document: &Document,
    registry: &Registry,
    options: &CheckOptions,
) -> Vec<DeclaredDevice> {
    let mut cx = Context {
        document,
        registry,
        sources: document.sources.clone(),
        diagnostics: Vec::new(),
        files: Vec::new(),
    };
    let mut parameters = Parameters::read(&mut cx, options);
    let mut sets = document.endpoints.iter();
    let set = sets.find(|(name, _)| name.text == options.endpoints);
    let devices = set.map(|(_, devices)| devices.as_slice()).unwrap_or_default();
    let declared = devices.iter().map(|(name, value)| {
        // A value that cannot be replaced is kept; the check reports it.
        let replaced = parameters.replace(&mut cx, value, Place::Graph, &mut Vec::new());
        let value = replaced.as_ref().unwrap_or(value);
        let kind = match &value.shape {
            Shape::Tagged(tagged) => tagged.name.as_ref(),
            _ => None,
        };
        let entry = kind.and_then(|kind| registry.device(&kind.text));
        DeclaredDevice {
            endpoint: name.text.clone(),
            written: written(value),
            is_simulated: entry.is_some_and(|entry| entry.spec.simulated),
            is_host: entry.is_some_and(|entry| entry.is_host()),
        }
    });
    declared.collect()
}

/// A value as normalised RON.
fn written(value: &Value) -> String {
    let all = |values: &[Value]| values.iter().map(written).collect::<Vec<_>>().join(", ");
    match &value.shape {
        Shape::Unit => "()".to_owned(),
        Shape::Bool(flag) => flag.to_string(),
        Shape::Number(number, _) => number.to_string(),
        Shape::String(text) => format!("{text:?}"),
        Shape::List(values) => format!("[{}]", all(values)),
        Shape::Map(pairs) => {
            let pairs = pairs.iter();
            let mut pairs: Vec<String> =
                pairs.map(|(key, value)| format!("{}: {}", written(key), written(value))).collect();
            pairs.sort();
            format!("{{ {} }}", pairs.join(", "))
        }
        Shape::Tagged(Tagged { name, body }) => {
            let name = name.as_ref().map_or("", |name| &name.text);
            match body {
                Body::Bare => name.to_owned(),
                Body::Tuple(values) => format!("{name}({})", all(values)),
                Body::Fields(fields) => {
                    let fields = fields.iter();
                    let mut fields: Vec<String> =
                        fields.map(|(name, value)| format!("{}: {}", name.text, written(value))).collect();
                    fields.sort();
                    format!("{name}({})", fields.join(", "))
                }
            }
        }
    }
}

/// Makes an endpoint of the calling program.
fn hosted(cx: &mut Context<'_>, name: &str, span: Span) -> DraftDevice {
    let fields = cx.reading(|reading| Fields::new("`Host`".to_owned(), span, Vec::new(), reading));
    draft_device(name, span, DeviceEntry::host(), fields, Vec::new())
}

fn draft_device(
    name: &str,
    span: Span,
    entry: DeviceEntry,
    fields: Fields,
    uses: Vec<(Span, Span)>,
) -> DraftDevice {
    DraftDevice {
        name: name.to_owned(),
        span,
        entry,
        fields,
        uses,
        senses: entry.spec.senses.to_vec(),
        drives: entry.spec.drives.to_vec(),
        clock: None,
        bound: false,
        broken: false,
    }
}

fn device(
    cx: &mut Context<'_>,
    parameters: &mut Parameters,
    name: &Name,
    value: &Value,
) -> Option<DraftDevice> {
    let mut uses = Vec::new();
    let value = parameters.replace(cx, value, Place::Graph, &mut uses)?;
    let (kind, entries) = parts(cx, &value, "a device, `Kind(field: value)`")?;
    let Some(entry) = cx.registry.device(&kind.text) else {
        let message = format!("there is no kind of device `{}`", kind.text);
        let diagnostic = Diagnostic::error("E0208", kind.span, message).label("unknown kind of device");
        let known = cx.registry.devices().iter().map(|entry| entry.spec.name);
        let diagnostic =
            suggest(cx, diagnostic, &kind.text, known, "there are", "no kinds of devices are registered");
        cx.report(diagnostic);
        return None;
    };
    let owner = format!("`{}`", kind.text);
    let fields = cx.reading(|reading| Fields::new(owner, kind.span, entries.to_vec(), reading));
    Some(draft_device(&name.text, name.span, entry, fields, uses))
}

/// Finds the device of every node that needs one.
pub(super) fn bind(cx: &mut Context<'_>, draft: &mut Draft, devices: &mut Option<Devices>) {
    for node in 0..draft.nodes.len() {
        if !draft.nodes[node].entry.has_endpoint() || draft.nodes[node].is_left_out {
            continue;
        }
        let given = draft.nodes[node].fields.take("endpoint");
        let device = device_of(cx, draft, node, given.as_ref(), devices.as_mut());
        draft.nodes[node].device = device;
        draft.nodes[node].broken |= device.is_none();
        if let (Some(device), Some(devices)) = (device, devices.as_mut()) {
            devices.list[device].bound = true;
            take_on_types(&mut draft.nodes[node], &devices.list[device]);
        }
    }
}

/// Sets the undetermined types of a source's outputs from the device's channels.
fn take_on_types(node: &mut DraftNode, device: &DraftDevice) {
    if node.entry.is_actuator() {
        return;
    }
    for (port, output) in node.entry.spec.outputs.iter().zip(&mut node.outputs) {
        let channel = device.senses.iter().find(|channel| channel.name == port.name);
        if let (Some(channel), KindRule::Linear | KindRule::Any) = (channel, port.kind) {
            output.kind = Some(channel.kind);
        }
        if let (Some(channel), QuantityRule::Any) = (channel, port.quantity) {
            output.quantity = Some(channel.quantity);
        }
    }
}

/// True if the device has the channels of the node.
fn fits(node: &DraftNode, device: &DraftDevice) -> bool {
    let has = |channels: &[Channel], name: &str| channels.iter().any(|channel| channel.name == name);
    let spec = node.entry.spec;
    device.entry.is_host()
        || match node.entry.is_actuator() {
            true => spec.inputs.iter().all(|port| has(&device.drives, port.name)),
            false => spec.outputs.iter().all(|port| has(&device.senses, port.name)),
        }
}

fn device_of(
    cx: &mut Context<'_>,
    draft: &Draft,
    node: usize,
    given: Option<&Value>,
    devices: Option<&mut Devices>,
) -> Option<usize> {
    let target = &draft.nodes[node];
    let kind = target.entry.spec.name;
    let Some(value) = given else {
        if target.fields.is_reported("endpoint") {
            return None;
        }
        let does = if target.entry.is_actuator() { "drives" } else { "reads" };
        let message = format!("`{kind}` needs the device that it {does}");
        let diagnostic =
            Diagnostic::error("E0601", target.fields.span, message).label("`endpoint` is missing");
        let fitting = devices.iter().flat_map(|devices| &devices.list).filter(|device| fits(target, device));
        let names: Vec<&str> = fitting.map(|device| device.name.as_str()).collect();
        let help = match names.as_slice() {
            [] => "add `endpoint: \"name\"`, and declare the device under `endpoints`".to_owned(),
            names => format!("add `endpoint: \"...\"`, one of {}", names.join(", ")),
        };
        let diagnostic = draft.in_use(node, diagnostic.help(help), cx);
        cx.report(diagnostic);
        return None;
    };
    let name = cx.reading(|reading| String::read(value, reading))?;
    let devices = devices?;
    if let Some(found) = devices.names.get(&name) {
        return *found;
    }
    if devices.hosted.has(&name) {
        let place = devices.list.len();
        devices.list.push(hosted(cx, &name, value.span));
        devices.names.insert(name, Some(place));
        return Some(place);
    }
    let message = format!("there is no device `{name}` among the {} endpoints", devices.set);
    let diagnostic = Diagnostic::error("E0207", value.span, message).label("unknown device");
    let known = in_order(cx, &devices.names);
    let none = format!("declare it: `endpoints: {{ \"{}\": {{ \"{name}\": ... }} }}`", devices.set);
    let diagnostic = suggest(cx, diagnostic, &name, known.into_iter(), "the devices are", &none);
    let diagnostic = draft.in_use(node, diagnostic, cx);
    cx.report(diagnostic);
    None
}

/// Checks that ports and channels agree, that all nodes of a device share its clock, and that no channel is driven
/// twice.
pub(super) fn check(cx: &mut Context<'_>, draft: &mut Draft, clocks: &Clocks, devices: &mut Devices) {
    let mut drivers: HashMap<(usize, &'static str), Span> = HashMap::new();
    let mut first: HashMap<usize, usize> = HashMap::new();
    for node in 0..draft.nodes.len() {
        let Some(index) = draft.nodes[node].device else {
            continue;
        };
        let device = &mut devices.list[index];
        if device.entry.is_host() {
            adopt_channels(&draft.nodes[node], draft, device);
        }
        for diagnostic in channels(draft, node, device) {
            draft.nodes[node].broken = true;
            let diagnostic = draft.in_use(node, diagnostic, cx);
            cx.report(diagnostic);
        }
        let target = &draft.nodes[node];
        if let (Some(clock), Some(other)) = (target.clock, first.get(&index)) {
            if let Some(known) = device.clock.filter(|known| *known != clock) {
                let message = format!(
                    "the nodes of device `{}` run on different clocks, `{}` and `{}`",
                    device.name, clocks.list[known].name, clocks.list[clock].name
                );
                let diagnostic = Diagnostic::error("E0603", target.fields.span, message)
                    .label(format!("this one runs on `{}`", clocks.list[clock].name))
                    .also(
                        draft.nodes[*other].fields.span,
                        format!("this one on `{}`", clocks.list[known].name),
                    )
                    .help("a device ticks on one clock: give both the same, and bridge the connections");
                device.broken = true;
                cx.report(diagnostic);
            }
        } else if let Some(clock) = target.clock {
            device.clock = Some(clock);
            first.insert(index, node);
        }
        let target = &draft.nodes[node];
        if let (true, Some(port)) = (target.entry.is_actuator(), target.entry.spec.inputs.first()) {
            if let Some(before) = drivers.get(&(index, port.name)) {
                let message = format!("`{}` of device `{}` is driven twice", port.name, device.name);
                cx.report(
                    Diagnostic::error("E0604", target.fields.span, message)
                        .label("driven again here")
                        .also(*before, "first driven here")
                        .help("add the two signals in front of one sink"),
                );
            } else {
                drivers.insert((index, port.name), target.fields.span);
            }
        }
    }
}

/// A host endpoint has the channels that its nodes ask for.
fn adopt_channels(target: &DraftNode, draft: &Draft, device: &mut DraftDevice) {
    let spec = target.entry.spec;
    let channel =
        |name, doc, port: Type| Some(Channel { name, doc, kind: port.kind?, quantity: port.quantity? });
    if target.entry.is_actuator() {
        let Some(port) = spec.inputs.first() else { return };
        let wire = target.wires().next().map(|(_, wire)| wire);
        let carried = wire.map(|wire| draft.nodes[wire.from].outputs[wire.output]);
        if !device.drives.iter().any(|known| known.name == port.name) {
            device.drives.extend(channel(port.name, port.doc, type_of(port.kind, port.quantity, carried)));
        }
        return;
    }
    for (port, carried) in spec.outputs.iter().zip(&target.outputs) {
        if !device.senses.iter().any(|known| known.name == port.name) {
            device.senses.extend(channel(
                port.name,
                port.doc,
                type_of(port.kind, port.quantity, Some(*carried)),
            ));
        }
    }
}

/// The type of a port; a port of any type takes on the type of its signal.
fn type_of(kind: KindRule, quantity: QuantityRule, carried: Option<Type>) -> Type {
    Type {
        kind: match kind {
            KindRule::Is(kind) => Some(kind),
            _ => carried.and_then(|carried| carried.kind),
        },
        quantity: match quantity {
            QuantityRule::Is(quantity) => Some(quantity),
            _ => carried.and_then(|carried| carried.quantity),
        },
    }
}

/// The mismatches between a node's ports and its device's channels.
fn channels(draft: &Draft, node: usize, device: &DraftDevice) -> Vec<Diagnostic> {
    let target = &draft.nodes[node];
    let spec = device.entry.spec;
    let kind = target.entry.spec.name;
    let names = |channels: &[Channel]| match channels {
        [] => "nothing".to_owned(),
        channels => channels.iter().map(|channel| channel.name).collect::<Vec<_>>().join(", "),
    };
    let mut found = Vec::new();
    if target.entry.is_actuator() {
        let Some(port) = target.entry.spec.inputs.first() else {
            return found;
        };
        match device.drives.iter().find(|channel| channel.name == port.name) {
            None => found.push(
                Diagnostic::error(
                    "E0602",
                    target.fields.span,
                    format!("device `{}` cannot be driven by `{kind}`", device.name),
                )
                .label(format!("drives `{}`", port.name))
                .also(device.span, format!("`{}` is driven by {}", spec.name, names(&device.drives))),
            ),
            Some(channel) => {
                let wire = target.wires().next().map(|(_, wire)| wire);
                let carried = wire.map(|wire| draft.nodes[wire.from].outputs[wire.output]);
                found.extend(channel_mismatch(
                    target,
                    type_of(port.kind, port.quantity, carried),
                    channel,
                    device,
                ));
            }
        }
        return found;
    }
    for (port, carried) in target.entry.spec.outputs.iter().zip(&target.outputs) {
        match device.senses.iter().find(|channel| channel.name == port.name) {
            None => {
                found.push(
                    Diagnostic::error(
                        "E0602",
                        target.fields.span,
                        format!("device `{}` cannot be read by `{kind}`", device.name),
                    )
                    .label(format!("reads `{}`", port.name))
                    .also(device.span, format!("`{}` senses {}", spec.name, names(&device.senses))),
                );
                break;
            }
            Some(channel) => {
                let mut carried = type_of(port.kind, port.quantity, Some(*carried));
                // What a bare number stands for is said by the node.
                if channel.quantity == Quantity::NUMBER && matches!(port.quantity, QuantityRule::Setting(_)) {
                    carried.quantity = None;
                }
                found.extend(channel_mismatch(target, carried, channel, device));
            }
        }
    }
    found
}

fn channel_mismatch(
    target: &DraftNode,
    port: Type,
    channel: &Channel,
    device: &DraftDevice,
) -> Option<Diagnostic> {
    let (name, kind) = (channel.name, target.entry.spec.name);
    let body = device.entry.spec.name;
    let message = match (port.kind, port.quantity) {
        (Some(found), _) if found != channel.kind => {
            format!("`{name}` of `{kind}` is {found}, but `{name}` of `{body}` is {}", channel.kind)
        }
        (_, Some(found)) if found != channel.quantity => {
            format!("`{name}` of `{kind}` is {found}, but `{name}` of `{body}` is {}", channel.quantity)
        }
        _ => return None,
    };
    let diagnostic = Diagnostic::error("E0602", target.fields.span, message)
        .label("does not match the device")
        .also(device.span, "the device");
    Some(diagnostic)
}

/// Reports devices that no node is bound to.
pub(super) fn warn_unused(cx: &mut Context<'_>, devices: &Devices) {
    for device in devices.list.iter().filter(|device| !device.bound) {
        let message = format!("device `{}` is never used", device.name);
        cx.report(
            Diagnostic::warning("W0104", device.span, message)
                .label("no node is bound to it")
                .help(format!("bind a source or sink to it: `endpoint: \"{}\"`", device.name)),
        );
    }
}
