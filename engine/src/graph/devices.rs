//! Devices of the selected endpoints, and the nodes that read and drive them: the third form of a graph.

use super::context::{Context, Entries};
use super::declared::Connected;
use super::options::{CheckOptions, Hosted, SIMULATED};
use super::values::{Parameters, Place};
use super::wires::Wired;
use crate::device::{Channel, DeviceEntry};
use crate::diagnostic::{Diagnostic, Span};
use crate::document::value::{Name, Value};
use crate::settings::{Fields, Setting};
use std::collections::{HashMap, HashSet};
use std::ops::Deref;

/// A device as declared.
pub(super) struct Device {
    pub name: String,
    pub span: Span,
    pub entry: DeviceEntry,
    pub fields: Fields,
    pub uses: Vec<(Span, Span)>,
    /// True if the calling program may replace what it senses.
    pub is_lent: bool,
}

/// The devices of the selected set.
#[derive(Default)]
pub(super) struct Devices {
    pub list: Vec<Device>,
    /// Index by name; `None` after a reported error.
    names: HashMap<String, Option<usize>>,
    set: String,
    hosted: Hosted,
    /// True if the graph does not have the set, which was reported.
    is_unknown: bool,
}

/// Connected nodes, and the devices that they are bound to.
pub(super) struct Bound {
    graph: Wired,
    pub devices: Devices,
    /// The device of each node; `None` also after a reported error.
    pub device_of: Vec<Option<usize>>,
}

impl Deref for Bound {
    type Target = Wired;

    fn deref(&self) -> &Wired {
        &self.graph
    }
}

impl Bound {
    /// The channel of the device from which a source's output comes.
    pub(super) fn sensed(&self, node: usize, output: usize) -> Option<&'static Channel> {
        let entry = self.nodes[node].entry;
        let device = self.device_of[node].filter(|_| !entry.is_actuator())?;
        let name = entry.spec.output(output)?.name;
        self.devices.list[device].entry.spec.senses.iter().find(|channel| channel.name == name)
    }
}

/// Reads the devices of the set that the options name.
pub(super) fn read(cx: &mut Context<'_>, parameters: &mut Parameters, options: &CheckOptions) -> Devices {
    let document = cx.document;
    let set = options.endpoints.as_str();
    let mut devices = Devices { set: set.to_owned(), hosted: options.hosted.clone(), ..Devices::default() };
    let Some((_, declared)) = document.endpoints.iter().find(|(name, _)| name.text == set) else {
        // Without sets every node that needs a device reports it.
        let needs_none = document.endpoints.is_empty() || options.hosted == Hosted::All;
        if set != SIMULATED || !needs_none {
            cx.refuse_unknown_set(set, None);
            devices.is_unknown = true;
        }
        return devices;
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
            false => device(cx, parameters, name, value)
                .map(|device| Device { is_lent: options.lent.contains(&name.text), ..device }),
        };
        let place = device.map(|device| {
            devices.list.push(device);
            devices.list.len() - 1
        });
        devices.names.insert(name.text.clone(), place);
    }
    devices
}

/// Makes an endpoint of the calling program.
fn hosted(cx: &mut Context<'_>, name: &str, span: Span) -> Device {
    let fields = cx.fields(&Name { span, text: "Host".to_owned() }, Entries::default());
    Device {
        name: name.to_owned(),
        span,
        entry: DeviceEntry::host(),
        fields,
        uses: Vec::new(),
        is_lent: false,
    }
}

fn device(cx: &mut Context<'_>, parameters: &mut Parameters, name: &Name, value: &Value) -> Option<Device> {
    let mut uses = Vec::new();
    let value = parameters.replace(cx, value, Place::Graph, &mut uses)?;
    let (kind, entries) = cx.parts(&value, "a device, `Kind(field: value)`")?;
    let Some(entry) = cx.registry.device(&kind.text) else {
        let message = format!("there is no kind of device `{}`", kind.text);
        let diagnostic = Diagnostic::error("E0208", kind.span, message).label("unknown kind of device");
        let known = cx.registry.devices().iter().map(|entry| entry.spec.name);
        let none = "no kinds of devices are registered";
        return cx.fail(cx.suggest(diagnostic, &kind.text, known, "there are", none));
    };
    let fields = cx.fields(kind, entries);
    Some(Device { name: name.text.clone(), span: name.span, entry, fields, uses, is_lent: false })
}

/// Finds the device of every node that needs one.
pub(super) fn bind(cx: &mut Context<'_>, graph: Wired, mut devices: Devices) -> Bound {
    let device_of = graph.nodes.iter().map(|node| {
        if !node.entry.has_endpoint() {
            return None;
        }
        let device = device_of(cx, node, &mut devices);
        if device.is_none() {
            cx.blame(node);
        }
        device
    });
    let device_of = device_of.collect();
    Bound { graph, devices, device_of }
}

fn device_of(cx: &mut Context<'_>, node: &Connected, devices: &mut Devices) -> Option<usize> {
    let Some(value) = &node.endpoint else {
        if !node.fields.is_reported("endpoint") {
            cx.report_of(node, unbound(node, devices));
        }
        return None;
    };
    let name = cx.reading(|reading| String::read(value, reading))?;
    if devices.is_unknown {
        return None;
    }
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
    let none = format!("declare it: `endpoints: {{ \"{}\": {{ \"{name}\": ... }} }}`", devices.set);
    let diagnostic = cx.suggest(diagnostic, &name, cx.in_order(&devices.names), "the devices are", &none);
    cx.report_of(node, diagnostic);
    None
}

/// The error of a node without an endpoint.
fn unbound(node: &Connected, devices: &Devices) -> Diagnostic {
    let does = if node.entry.is_actuator() { "drives" } else { "reads" };
    let message = format!("`{}` needs the device that it {does}", node.entry.spec.name);
    let fitting = devices.list.iter().filter(|device| fits(node, device));
    let names: Vec<&str> = fitting.map(|device| device.name.as_str()).collect();
    let help = match names.as_slice() {
        [] => "add `endpoint: \"name\"`, and declare the device under `endpoints`".to_owned(),
        names => format!("add `endpoint: \"...\"`, one of {}", names.join(", ")),
    };
    Diagnostic::error("E0601", node.fields.span, message).label("`endpoint` is missing").help(help)
}

/// True if the device has the channels of the node.
fn fits(node: &Connected, device: &Device) -> bool {
    let has = |channels: &[Channel], name: &str| channels.iter().any(|channel| channel.name == name);
    let (spec, channels) = (node.entry.spec, device.entry.spec);
    device.entry.is_host()
        || match node.entry.is_actuator() {
            true => spec.inputs.iter().all(|port| has(channels.drives, port.name)),
            false => spec.outputs.iter().all(|port| has(channels.senses, port.name)),
        }
}

/// Reports devices that no node is bound to.
pub(super) fn warn_unused(cx: &mut Context<'_>, graph: &Bound) {
    let used: HashSet<usize> = graph.device_of.iter().flatten().copied().collect();
    for (index, device) in graph.devices.list.iter().enumerate() {
        if !used.contains(&index) {
            let message = format!("device `{}` is never used", device.name);
            cx.report(
                Diagnostic::warning("W0104", device.span, message)
                    .label("no node is bound to it")
                    .help(format!("bind a source or sink to it: `endpoint: \"{}\"`", device.name)),
            );
        }
    }
}
