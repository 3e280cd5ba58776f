//! The parts of a graph that are drawn: boxes with named ports, labelled wires, and clocks.

use haptograph_engine::frame::Kind;
use haptograph_engine::graph::{Bridge, Graph, Node};
use haptograph_nodes::sinks::plots::GROUP as PLOTS;
use haptograph_signal::quantity::Quantity;

/// Content of a drawing.
#[derive(Debug, Clone, Default)]
pub(super) struct Sketch {
    pub boxes: Vec<NodeBox>,
    pub wires: Vec<WireLine>,
    /// Names and rates.
    pub clocks: Vec<(String, String)>,
}

/// A node, or the body of a device.
#[derive(Debug, Clone, Default)]
pub(super) struct NodeBox {
    /// `texture/filter`; the name of a body.
    pub path: String,
    /// The last part of the path.
    pub name: String,
    pub kind: String,
    pub role: Role,
    pub clock: Option<usize>,
    pub inputs: Vec<Port>,
    pub outputs: Vec<Port>,
    /// The main settings, one per line.
    pub settings: Vec<String>,
    /// Text of the tooltip.
    pub doc: String,
    /// True if it is drawn by its name only.
    pub is_name: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Role {
    #[default]
    Process,
    Source,
    Actuator,
    File,
    Body,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Port {
    pub name: String,
    pub connected: bool,
}

/// A wire: (box, port) at both ends.
#[derive(Debug, Clone)]
pub(super) struct WireLine {
    pub from: (usize, usize),
    pub to: (usize, usize),
    /// Label at its end if it crosses rates or time.
    pub bridge: String,
    /// Label at its start.
    pub unit: String,
    /// Source node and output: `texture/filter.acceleration`.
    pub port: String,
    /// What it carries, for the tooltip: `speed to locate.speed`.
    pub about: String,
    pub stroke: Stroke,
    pub closes_loop: bool,
}

/// Line style of a wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stroke {
    /// A scalar.
    Thin,
    /// A vector or a wrench.
    Thick,
    /// A mechanical link between a body and its nodes.
    Touch,
}

impl Sketch {
    pub(super) fn of(graph: &Graph) -> Self {
        let clocks = graph.clocks().iter().map(|clock| (clock.name.clone(), rate_text(clock.rate.hz())));
        let mut sketch = Self { clocks: clocks.collect(), ..Self::default() };
        let nodes = graph.nodes();
        // Plots appear on the page of a run; in a drawing they would hide the signal path.
        let mut place: Vec<Option<usize>> = Vec::new();
        for node in nodes.iter() {
            let drawn = node.entry.spec.group != PLOTS;
            place.push(drawn.then_some(sketch.boxes.len()));
            sketch.boxes.extend(drawn.then(|| node_box(node)));
        }
        for wire in nodes.connections() {
            let edge = wire.edge;
            let (source, target) = (&nodes[wire.from], &nodes[wire.to]);
            let (Some(output), Some(_)) = (source.outputs.get(edge.output), target.inputs.get(edge.input))
            else {
                continue;
            };
            let [Some(from), Some(to)] = [wire.from, wire.to].map(|end| place[end.index()]) else { continue };
            let from = (from, edge.output);
            // One label is enough for an output with several readers.
            let named = sketch.wires.iter().any(|wire| wire.from == from);
            sketch.wires.push(WireLine {
                from,
                to: (to, edge.input),
                bridge: bridge_text(edge.bridge),
                unit: if named { String::new() } else { unit_text(output.kind, output.quantity) },
                port: format!("{}.{}", source.path, output.name),
                about: format!(
                    "{}.{} to {}.{}",
                    source.path,
                    output.name,
                    target.path,
                    target.inputs[edge.input].shown()
                ),
                stroke: if output.kind == Kind::SCALAR { Stroke::Thin } else { Stroke::Thick },
                closes_loop: match edge.bridge {
                    Bridge::Delay { .. } => true,
                    Bridge::Ring { .. } => graph.reaches(wire.to, wire.from),
                    _ => false,
                },
            });
        }
        sketch.add_bodies(graph, &place);
        sketch
    }

    /// Adds the bodies of devices, linked to the nodes that read or drive them.
    fn add_bodies(&mut self, graph: &Graph, place: &[Option<usize>]) {
        let nodes = graph.nodes();
        for (number, device) in graph.devices().iter().enumerate() {
            let spec = device.entry.spec;
            let body = self.boxes.len();
            self.boxes.push(NodeBox {
                path: device.name.clone(),
                name: device.name.clone(),
                kind: spec.name.to_owned(),
                role: Role::Body,
                clock: Some(device.clock),
                doc: first_sentence(spec.doc),
                ..NodeBox::default()
            });
            let bound = nodes.ids().filter(|n| nodes[*n].device() == Some(number));
            for node in bound {
                let drives = nodes[node].entry.is_actuator();
                if let Some(place) = place[node.index()] {
                    self.touch(place, body, drives);
                }
            }
        }
    }

    /// The names alone: no files, and one wire from a box to another, named by all of its ports. Templates are boxes if they `collapse`.
    pub(super) fn overview(&self, collapse: bool) -> Self {
        let mut all = Self { clocks: self.clocks.clone(), ..Self::default() };
        let mut place: Vec<Option<usize>> = Vec::new();
        for node in &self.boxes {
            let template = node.path.split_once('/').filter(|_| collapse && node.role != Role::Body);
            let path = template.map_or(&*node.path, |(template, _)| template);
            let known = template.and_then(|_| all.boxes.iter().position(|known| known.path == path));
            let (is_file, new) = (node.role == Role::File, all.boxes.len());
            place.push((!is_file).then_some(known.unwrap_or(new)));
            if is_file || known.is_some() {
                continue;
            }
            let mut small = NodeBox { is_name: true, settings: Vec::new(), ..node.clone() };
            if template.is_some() {
                (small.name, small.path) = (path.to_owned(), path.to_owned());
                (small.kind, small.role, small.doc) = ("template".to_owned(), Role::Process, String::new());
            }
            small.inputs.truncate(1);
            small.outputs.truncate(1);
            all.boxes.push(small);
        }
        for wire in &self.wires {
            let (Some(from), Some(to)) = (place[wire.from.0], place[wire.to.0]) else { continue };
            let same = |known: &&mut WireLine| (known.from.0, known.to.0) == (from, to);
            match all.wires.iter_mut().find(same) {
                Some(known) => known.about = format!("{}, {}", known.about, wire.about),
                None if from == to && collapse => {}
                None => all.wires.push(WireLine {
                    from: (from, 0),
                    to: (to, 0),
                    bridge: String::new(),
                    unit: String::new(),
                    ..wire.clone()
                }),
            }
        }
        all
    }

    /// Links a node to the body that it reads or drives.
    fn touch(&mut self, node: usize, body: usize, drives: bool) {
        let port = |name: &str| Port { name: name.to_owned(), connected: true };
        let (source, target) = if drives { (node, body) } else { (body, node) };
        let port_name = |here: usize, there: &str| {
            if here == body { there.to_owned() } else { String::new() }
        };
        let node_name = self.boxes[node].name.clone();
        self.boxes[source].outputs.push(port(&port_name(source, &node_name)));
        self.boxes[target].inputs.push(port(&port_name(target, &node_name)));
        self.wires.push(WireLine {
            from: (source, self.boxes[source].outputs.len() - 1),
            to: (target, self.boxes[target].inputs.len() - 1),
            bridge: String::new(),
            unit: String::new(),
            port: String::new(),
            about: String::new(),
            stroke: Stroke::Touch,
            closes_loop: drives && self.boxes[body].outputs.iter().any(|_| true),
        });
    }
}

fn node_box(node: &Node) -> NodeBox {
    let role = if node.entry.is_file() {
        Role::File
    } else if node.entry.is_actuator() {
        Role::Actuator
    } else if node.entry.has_endpoint() {
        Role::Source
    } else {
        Role::Process
    };
    let inputs = node.inputs.iter().map(|i| Port { name: i.shown().to_owned(), connected: i.connected });
    let outputs = node.outputs.iter().map(|o| Port { name: o.name.to_string(), connected: true });
    NodeBox {
        name: node.path.rsplit('/').next().unwrap_or_default().to_owned(),
        path: node.path.clone(),
        kind: node.entry.spec.name.to_owned(),
        role,
        clock: node.clock,
        inputs: inputs.collect(),
        outputs: outputs.collect(),
        settings: settings(node),
        doc: first_sentence(node.entry.spec.doc),
        is_name: false,
    }
}

/// Maximum number of settings in a box, and of characters in each.
const MAX_SETTINGS: usize = 3;
const MAX_CHARACTERS: usize = 30;

/// The settings of a node as written in the graph.
fn settings(node: &Node) -> Vec<String> {
    let lines = node.written().into_iter().map(|(name, value)| {
        let line = format!("{name}: {value}");
        match line.char_indices().nth(MAX_CHARACTERS) {
            Some((end, _)) => format!("{}\u{2026}", &line[..end]),
            None => line,
        }
    });
    lines.take(MAX_SETTINGS).collect()
}

fn first_sentence(doc: &str) -> String {
    let doc = doc.trim();
    doc.split_once(". ").map_or_else(|| doc.to_owned(), |(first, _)| format!("{first}."))
}

fn unit_text(kind: Kind, quantity: Quantity) -> String {
    let unit = quantity.unit().replace("s2", "s²");
    match kind.width() {
        _ if kind == Kind::WRENCH => "N, N m".to_owned(),
        _ if !kind.is_linear() => kind.to_string(),
        _ if quantity == Quantity::NUMBER => String::new(),
        1 => unit,
        width => format!("{unit} ×{width}"),
    }
}

fn bridge_text(bridge: Bridge) -> String {
    match bridge {
        Bridge::Direct => String::new(),
        Bridge::Between(bridge) => bridge.spec.name.to_lowercase(),
        Bridge::Ring { latency_s } => format!("ring {} ms", latency_s * 1e3),
        Bridge::Delay { frames, .. } => format!("delay {frames}"),
    }
}

fn rate_text(hz: f64) -> String {
    if hz >= 1000.0 {
        format!("{} kHz", super::super::svg::num(hz / 1000.0))
    } else {
        format!("{} Hz", super::super::svg::num(hz))
    }
}
