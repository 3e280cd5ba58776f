//! Descriptions of the node kinds and of the running graph for the page.

use super::channels::{InputPad, PadSpec};
use super::fed;
use super::levels;
use super::load::Source;
use super::pads::FULL_N;
use super::pages::Reach;
use super::pointer::MAX_N;
use super::scene;
use super::scope::{self, Port};
use super::stage::{Host, Stage};
use super::wire::VERSION;
use haptograph_engine::frame::OneKind;
use haptograph_engine::graph::{Graph, NodeId};
use haptograph_engine::node::{InputSpec, NodeEntry, OutputSpec, Presence, QuantityRule};
use haptograph_engine::registry::Registry;
use haptograph_engine::settings::{Part, SettingSpec};
use haptograph_nodes::contact::Contact;
use haptograph_report::{drawing, swatch};
use haptograph_signal::files::{MAX_SURFACE_BYTES, is_file, is_folder, list, read_text};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::Unit;
use haptograph_surfaces::VertexKind;
use haptograph_surfaces::files::{self, FileError, Malformed, Problem, ReadError};
use serde_json::{Value, json};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::SystemTime;

/// Maximum number of listed surfaces.
const MAX_SURFACES: usize = 100;
/// The description of each file, `None` for a file that is not a surface, and the file's modification time, if
/// known.
type Swatches = HashMap<PathBuf, (Option<SystemTime>, Option<Value>)>;
static SWATCHES: LazyLock<Mutex<Swatches>> = LazyLock::new(Mutex::default);
/// The kind of node that looks up a texture's models.
const LOCATOR: &str = "TriangleLocator";

/// The first message to a page.
pub(crate) fn hello(registry: &Registry, host: &Host, reach: Reach) -> Value {
    let nodes = registry.nodes().iter().map(node);
    let devices = registry.devices().iter().map(|entry| {
        let settings: Vec<Value> = entry.settings().iter().map(setting).collect();
        let spec = entry.spec;
        json!({ "name": spec.name, "group": "devices", "doc": spec.doc, "inputs": [], "outputs": [], "settings": settings })
    });
    let bridges = registry.bridges().iter();
    let bridges = bridges.map(|entry| json!({ "name": entry.spec.name, "gives": entry.spec.gives }));
    let quantities = Quantity::NAMED.iter();
    let quantities =
        quantities.map(|(quantity, name, _)| json!({ "name": name, "unit": printed_unit(*quantity) }));
    let is_here = reach == Reach::Machine;
    json!({
        "type": "hello", "version": VERSION, "haptograph": env!("CARGO_PKG_VERSION"), "host": host.name,
        "from": if is_here { "machine" } else { "network" },
        "can": {
            "edit": is_here, "save": host.can_save && is_here, "record": is_here,
            "surfaces": host.can_learn && is_here, "parameters": true, "arm": host.can_drive && is_here,
        },
        "kinds": nodes.chain(devices).collect::<Vec<_>>(),
        "bridges": bridges.collect::<Vec<_>>(),
        "quantities": quantities.collect::<Vec<_>>(),
    })
}

fn node(entry: &NodeEntry) -> Value {
    let spec = entry.spec;
    let input = |port: &InputSpec| {
        json!({
            "name": port.name, "doc": port.doc, "unit": unit_by(port.quantity),
            "named": port.presence == Presence::Named, "several": port.presence.is_several(),
        })
    };
    let output = |port: &OutputSpec| {
        json!({
            "name": port.name, "doc": port.doc, "unit": unit_by(port.quantity),
            "named_by": port.count.named_by(),
        })
    };
    let rules = spec.inputs.iter().map(|port| port.quantity);
    let rules = rules.chain(spec.outputs.iter().map(|port| port.quantity));
    let quantities: Vec<&str> = rules
        .filter_map(|rule| match rule {
            QuantityRule::Setting(name) => Some(name),
            _ => None,
        })
        .collect();
    let settings = entry.settings();
    let settings = settings.iter().map(|spec| {
        let mut described = setting(spec);
        described["is_quantity"] = json!(quantities.contains(&spec.name));
        described
    });
    json!({
        "name": spec.name, "group": spec.group, "doc": spec.doc,
        "inputs": spec.inputs.iter().map(input).collect::<Vec<_>>(),
        "outputs": spec.outputs.iter().map(output).collect::<Vec<_>>(),
        "settings": settings.collect::<Vec<_>>(),
    })
}

fn setting(spec: &SettingSpec) -> Value {
    let choices: Vec<&str> = spec.parts.iter().filter_map(|part| part.choice).collect();
    let part = |part: &Part| {
        let fields: Vec<Value> = part.fields.iter().map(setting).collect();
        json!({ "choice": part.choice, "doc": part.doc, "fields": fields })
    };
    json!({
        "name": spec.name, "doc": spec.doc, "unit": symbol(spec.unit.as_ref()), "default": spec.default,
        "required": spec.default.is_none(), "live": spec.live,
        "min": spec.range.map(|range| range.0), "max": spec.range.map(|range| range.1), "choices": choices,
        "parts": spec.parts.iter().map(part).collect::<Vec<_>>(),
    })
}

/// The SI unit of a port, if neither its node's settings nor its connections decide it.
fn unit_by(rule: QuantityRule) -> String {
    match rule {
        QuantityRule::Is(quantity) => printed_unit(quantity),
        _ => String::new(),
    }
}

/// The SI unit; none for a plain number.
fn printed_unit(quantity: Quantity) -> String {
    match quantity == Quantity::NUMBER {
        true => String::new(),
        false => quantity.unit(),
    }
}

/// The symbol of a setting's unit, empty for a plain number.
fn symbol(unit: Option<&Unit>) -> &str {
    unit.map_or("", |unit| &*unit.symbol)
}

/// The running graph, as far as its page may see it.
pub(crate) fn graph(stage: &Stage) -> Value {
    stage.source.confined(|| shown(stage))
}

fn shown(stage: &Stage) -> Value {
    let graph = &stage.loaded.graph;
    let name = stage.source.name();
    let actuators = stage.signals.actuators.iter().map(|actuator| {
        json!({
            "name": actuator.name, "unit": actuator.unit, "peak": actuator.peak,
            "continuous": actuator.continuous, "rate_hz": actuator.rate_hz, "endpoint": actuator.endpoint,
        })
    });
    let ports = scope::ports(graph);
    let outputs = graph.template_outputs().iter().filter_map(|output| {
        let node = &graph.nodes()[output.node];
        let port = format!("{}.{}", node.path, node.outputs.get(output.output)?.name);
        Some(json!({ "name": output.name(), "port": port }))
    });
    let sound = stage.signals.sound.as_ref();
    let drivers = graph.drivers().into_iter().map(|driver| {
        let clock = &graph.clocks()[driver];
        json!({ "name": clock.name, "rate_hz": clock.rate.hz(), "simulated": !stage.has_drivers() })
    });
    let devices = graph.devices().iter();
    let devices = devices.filter(|device| !stage.loaded.is_pad(&device.name));
    let devices = devices.map(|device| {
        let spec = device.entry.spec;
        json!({
            "name": device.name, "kind": spec.name, "simulated": spec.simulated, "at": stage.place_of(&device.name),
        })
    });
    json!({
        "type": "graph", "number": stage.signals.graph,
        "name": name, "about": graph.about(), "path": stage.source.saved().display().to_string(),
        "text": stage.loaded.text, "saved": stage.loaded.text == stage.on_disk,
        "drawing": drawing::standalone_svg(graph, &name),
        "overview": drawing::overview_svg(graph, &name),
        "pads": stage.loaded.pads.iter().map(pad).collect::<Vec<_>>(),
        "inputs": stage.loaded.inputs.iter().map(input).collect::<Vec<_>>(),
        "others": stage.loaded.others,
        "ports": ports.iter().filter(|port| port.is_shown()).map(port).collect::<Vec<_>>(),
        "template_outputs": outputs.collect::<Vec<_>>(), "endpoints": stage.source.endpoints,
        "levels": levels::described(&ports),
        "settings": settings(stage),
        "parameters": parameters(stage),
        "plots": scene::plots(graph),
        "maps": maps(graph),
        "contacts": ports.iter().filter(|port| port.kind == Contact::KIND).map(port).collect::<Vec<_>>(),
        "actuators": actuators.collect::<Vec<_>>(),
        "devices": devices.collect::<Vec<_>>(),
        "drivers": drivers.collect::<Vec<_>>(),
        "sound": sound.map(|sound| json!({ "rate_hz": sound.rate_hz, "what": sound.port })),
        "surfaces": surfaces(stage),
    })
}

fn pad(pad: &PadSpec) -> Value {
    let names = pad.channels.iter().map(|(name, _)| *name);
    // JSON has no infinity: a rigid surface is null.
    let gives_n_per_m = pad.on.as_ref().map(|on| on.gives_n_per_m);
    json!({
        "endpoint": pad.endpoint, "width_mm": pad.size_mm.0, "height_mm": pad.size_mm.1, "force_n": FULL_N, "most_force_n": MAX_N,
        "channels": names.collect::<Vec<_>>(), "is_laid": pad.on.is_some(),
        "gives_n_per_mm": gives_n_per_m.filter(|gives| gives.is_finite()).map(|gives| gives * 1e-3),
        "scene": pad.on.as_ref().map(scene::scene),
    })
}

fn input(input: &InputPad) -> Value {
    let InputPad { pad, port, range: [min, max] } = input;
    json!({ "endpoint": pad.endpoint, "channel": pad.channels[0].0, "port": port, "min": min, "max": max })
}

fn port(port: &Port) -> Value {
    json!({
        "name": port.name, "node": port.node, "kind": port.kind.to_string(),
        "quantity": port.quantity.name(), "unit": port.quantity.unit(), "rate_hz": port.rate_hz,
        "lanes": scope::components(port.kind), "driver": port.driver,
    })
}

fn settings(stage: &Stage) -> Vec<Value> {
    let Some(session) = &stage.session else {
        return Vec::new();
    };
    let graph = &stage.loaded.graph;
    let live = session.settings().map(|live| {
        let node = graph.nodes().iter().find(|node| node.path == live.path);
        let specs = node.map(|node| node.entry.settings()).unwrap_or_default();
        let spec = specs.iter().find(|spec| spec.name == live.field);
        json!({
            "name": live.name(), "node": live.path, "field": live.label(), "value": live.value,
            "unit": live.unit, "doc": spec.map_or("", |spec| spec.doc.as_str()),
            "min": live.range.map(|range| range.0), "max": live.range.map(|range| range.1), "whole": live.whole,
        })
    });
    live.collect()
}

fn parameters(stage: &Stage) -> Vec<Value> {
    let is_surface = |name: &str, value: &str| {
        let path = value.trim_matches('"');
        name.contains("surface") || is_file(&stage.source.folder().join(path)) && path.ends_with(".ron")
    };
    let fed = fed::settings(&stage.loaded.text, &stage.source.registry);
    let each = stage.loaded.parameters.iter();
    let each = each.map(|(name, value, default)| {
        let spec = fed.get(name);
        let range = spec.and_then(|spec| spec.range);
        json!({
            "name": name, "value": value, "default": default, "is_surface": is_surface(name, value),
            "unit": symbol(spec.and_then(|spec| spec.unit.as_ref())), "doc": spec.map_or("", |spec| &spec.doc),
            "min": range.map(|range| range.0), "max": range.map(|range| range.1),
            "whole": spec.is_some_and(|spec| spec.whole), "choices": spec.map(fed::choices).unwrap_or_default(),
        })
    });
    each.collect()
}

/// The map of each texture, and the ports with the position of the hand on it.
fn maps(graph: &Graph) -> Vec<Value> {
    let nodes = graph.nodes();
    let locators = nodes.ids().filter(|index| nodes[*index].entry.spec.name == LOCATOR);
    let map = |index: NodeId| {
        let node = &nodes[index];
        let from = |input: &str| {
            let place = node.inputs.iter().position(|known| known.name == input)?;
            let read = nodes.incoming(index).into_iter().find(|read| read.edge.input == place)?;
            let source = &nodes[read.from];
            Some(format!("{}.{}", source.path, source.outputs.get(read.edge.output)?.name))
        };
        let path = node.files.first()?;
        let texture = files::load(path).ok()?.texture?;
        let points: Vec<[f64; 2]> = texture.models().iter().map(|at| [at.speed_m_s, at.force_n]).collect();
        let of = |kind: VertexKind| match kind {
            VertexKind::Measured => "measured",
            VertexKind::Fitted => "fitted",
            VertexKind::Edge => "edge",
        };
        let kinds: Vec<&str> = texture.models().iter().map(|at| of(at.kind)).collect();
        Some(json!({
            "node": node.path, "surface": path.display().to_string(),
            "speed_port": from("speed"), "force_port": from("force"),
            "points": points, "kinds": kinds, "triangles": texture.triangles(),
        }))
    };
    locators.filter_map(map).collect()
}

/// The surfaces in the graph's own folder, by their paths from the graph, and those in other folders.
fn surfaces(stage: &Stage) -> Vec<Value> {
    let folder = stage.source.folder();
    let shown = listed(&stage.source).into_iter().filter_map(|path| surface(&path, folder));
    shown.take(MAX_SURFACES).collect()
}

/// The files that can be surfaces for a graph, each once.
pub(crate) fn listed(source: &Source) -> Vec<PathBuf> {
    let others = source.surfaces.iter().flat_map(|folder| ron_files(folder));
    let paths = surface_files(source.folder()).into_iter().chain(others);
    let mut seen = HashSet::new();
    paths.filter(|path| seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone()))).collect()
}

/// The description of a surface, or of the error in its file; its swatch is drawn once, which takes a while. `None` if the
/// file is something else.
pub(crate) fn surface(path: &Path, graph: &Path) -> Option<Value> {
    let known = || SWATCHES.lock().unwrap_or_else(PoisonError::into_inner);
    let written = path.metadata().and_then(|found| found.modified()).ok();
    if let Some((_, shown)) = known().get(path).filter(|(then, _)| *then == written) {
        return shown.clone();
    }
    let named = |name: &str, swatch: Option<String>, error: Option<String>| json!({ "path": from_graph(path, graph), "name": name, "swatch": swatch, "error": error });
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let shown = match files::load(path) {
        Ok(surface) => surface.texture.as_ref().map(|texture| match swatch(texture) {
            Ok(swatch) => named(&surface.name, Some(swatch), None),
            Err(error) => named(&surface.name, None, Some(error.to_string())),
        }),
        Err(FileError::Io { source, .. }) => {
            Some(named(&stem, None, Some(format!("the file cannot be read: {source}"))))
        }
        Err(FileError::Recording { .. }) => None,
        Err(FileError::Read { error, .. }) => {
            is_meant(path, graph, &error).then(|| named(&stem, None, Some(error.to_string())))
        }
    };
    let mut known = known();
    if known.len() >= MAX_SURFACES {
        known.clear();
    }
    known.insert(path.to_owned(), (written, shown.clone()));
    shown
}

/// True if a file that is not read was meant as a surface: beside a graph lie other graphs and lists.
fn is_meant(path: &Path, graph: &Path, error: &ReadError) -> bool {
    let begins = || read_text(path, MAX_SURFACE_BYTES).is_ok_and(|text| text.contains("Surface("));
    let is_graph =
        matches!(&error.problem, Problem::Malformed(Malformed::OtherKind { found, .. }) if found == "Graph");
    !is_graph && (path.parent() != Some(graph) || begins())
}

/// A path relative to the graph's folder, in the form of a parameter.
pub(crate) fn from_graph(path: &Path, graph: &Path) -> String {
    format!("{:?}", path.strip_prefix(graph).unwrap_or(path).to_string_lossy())
}

/// The files beside a graph that can be surfaces.
pub(crate) fn surface_files(graph: &Path) -> Vec<PathBuf> {
    ron_files(&surface_folder(graph))
}

fn ron_files(folder: &Path) -> Vec<PathBuf> {
    let mut paths = list(folder);
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "ron"));
    paths.sort();
    paths.truncate(MAX_SURFACES);
    paths
}

/// The folder of surfaces beside a graph.
pub(crate) fn surface_folder(graph: &Path) -> PathBuf {
    let inner = graph.join("surfaces");
    if is_folder(&inner) { inner } else { graph.to_owned() }
}
