//! The registry of the kinds of nodes, devices and frames, and of the types of bridges.

use crate::bridges::BridgeEntry;
use crate::device::DeviceEntry;
use crate::frame::Kind;
use crate::limiter::LIMITED_WIDTHS;
use crate::node::{KindRule, NodeEntry};
use crate::settings::{Fields, Reading};
use std::any::{Any, TypeId};
use std::collections::HashMap;
use std::sync::Arc;

/// Forms of a connection that are no registered bridges.
pub(crate) const RESERVED: [&str; 3] = ["Ring", "Delay", "Input"];

/// A former name of a node kind, which graph files may still use.
#[derive(Debug, Clone, Copy)]
pub struct Alias {
    /// The former name.
    pub former: &'static str,
    /// The name of the kind.
    pub kind: &'static str,
    /// Converts the fields of the former kind to those of the kind; messages still name the former kind.
    pub(crate) rewrite: fn(&mut Fields, &mut Reading<'_>),
}

impl Alias {
    /// Makes an alias, with the function that converts the fields of the former kind to those of the kind.
    pub const fn new(
        former: &'static str,
        kind: &'static str,
        rewrite: fn(&mut Fields, &mut Reading<'_>),
    ) -> Self {
        Self { former, kind, rewrite }
    }
}

/// Kinds of nodes, devices and frames, types of bridges, and library templates of a program.
/// `haptograph_nodes::registry()` has the shipped ones.
///
/// ```
/// use haptograph_engine::document::Document;
/// use haptograph_engine::graph::{CheckOptions, check};
/// use haptograph_engine::registry::Registry;
/// # use haptograph_engine::frame::Scalar;
/// # use haptograph_engine::node::*;
/// # use haptograph_signal::quantity::Quantity;
/// # haptograph_engine::settings! { /** Settings of the example. */ pub struct LevelSettings { /** What it gives. */ [live] value: f64 = 1.0; } }
/// # haptograph_engine::node! {
/// #     /// Gives a number.
/// #     struct Level(LevelSettings) in "mine";
/// #     example: "";
/// #     out OUTPUT: Scalar = Port::of(Quantity::NUMBER, "The number.");
/// # }
/// # #[derive(Clone)] struct Given(f64);
/// # impl NodeKind for Level {
/// #     fn build(settings: LevelSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { Ok(Built::new(Given(settings.value))) }
/// # }
/// # impl Processor<Level> for Given {
/// #     fn process(&mut self, _: &Tick, io: &mut Io<'_, Level>) { io.write(Level::OUTPUT).fill(self.0); }
/// #     fn set(&mut self, _: LiveId<LevelSettings>, value: f64) { self.0 = value; }
/// # }
///
/// let mut registry = Registry::new();
/// registry.add(NodeEntry::processor::<Level>());
/// assert!(registry.node("Level").is_some() && registry.kind("wrench").is_some());
///
/// let document = Document::parse("level.ron", r#"Graph(
///     format: 1,
///     clocks: { "servo": Driver(rate_hz: 1000) },
///     nodes: { "level": Level(clock: "servo", value: 0.5) },
/// )"#)?;
/// let graph = check(&document, &registry, &CheckOptions::default())?;
/// assert_eq!(graph.live_settings()[0].name(), "level.value");
/// # Ok::<(), haptograph_engine::diagnostic::Diagnostics>(())
/// ```
#[derive(Debug, Clone)]
pub struct Registry {
    kinds: Vec<Kind>,
    bridges: Vec<BridgeEntry>,
    nodes: Vec<NodeEntry>,
    aliases: Vec<Alias>,
    devices: Vec<DeviceEntry>,
    library: Vec<(&'static str, &'static str)>,
    /// One of each type.
    attached: HashMap<TypeId, Arc<dyn Any + Send + Sync>>,
}

impl Registry {
    /// Makes a registry of the engine's own kinds of frames and bridges, without nodes and devices.
    pub fn new() -> Self {
        Self {
            kinds: Kind::ENGINE.to_vec(),
            bridges: BridgeEntry::ENGINE.to_vec(),
            nodes: Vec::new(),
            aliases: Vec::new(),
            devices: Vec::new(),
            library: Vec::new(),
            attached: HashMap::new(),
        }
    }

    /// Attaches a value in which a crate above the engine keeps what belongs to these kinds, such as the backends of devices.
    /// Replaces the one of the same type.
    pub fn attach<T: Any + Send + Sync>(&mut self, value: T) -> &mut Self {
        self.attached.insert(TypeId::of::<T>(), Arc::new(value));
        self
    }

    /// The attached value of this type.
    pub fn attached<T: Any + Send + Sync>(&self) -> Option<&T> {
        self.attached.get(&TypeId::of::<T>())?.downcast_ref()
    }

    /// Adds a kind of frames. Ports of nodes and devices carry kinds that are registered: with others, or with two
    /// kinds of one name, no graph passes [`check`](crate::graph::check), whose errors are `E0213` and `E0212`.
    pub fn add_kind(&mut self, kind: Kind) -> &mut Self {
        self.kinds.push(kind);
        self
    }

    /// Adds a type of bridge. With two of one name no graph passes [`check`](crate::graph::check): the error is `E0212`.
    pub fn add_bridge(&mut self, entry: BridgeEntry) -> &mut Self {
        self.bridges.push(entry);
        self
    }

    /// Adds a node kind. With two kinds of one name no graph passes [`check`](crate::graph::check): the error is
    /// `E0212`.
    pub fn add(&mut self, entry: NodeEntry) -> &mut Self {
        self.nodes.push(entry);
        self
    }

    /// Adds a former name of a node kind. A kind or template of that name takes precedence.
    pub fn add_alias(&mut self, alias: Alias) -> &mut Self {
        self.aliases.push(alias);
        self
    }

    /// Adds a device kind. With two kinds of one name no graph passes [`check`](crate::graph::check): the error is
    /// `E0212`.
    pub fn add_device(&mut self, entry: DeviceEntry) -> &mut Self {
        self.devices.push(entry);
        self
    }

    /// Adds library templates that a graph can include by `include: ["std/NAME.ron"]`. `name` is `std/NAME.ron`,
    /// `text` a `Parts(...)`. Replaces parts of the same name.
    pub fn add_parts(&mut self, name: &'static str, text: &'static str) -> &mut Self {
        self.library.retain(|(known, _)| *known != name);
        self.library.push((name, text));
        self
    }

    /// The library of templates: names and texts.
    pub fn library(&self) -> &[(&'static str, &'static str)] {
        &self.library
    }

    /// Adds a node kind and removes any other of the same name.
    pub fn replace(&mut self, entry: NodeEntry) -> &mut Self {
        self.nodes.retain(|known| known.spec.name != entry.spec.name);
        self.add(entry)
    }

    /// Adds a device kind and removes any other of the same name.
    pub fn replace_device(&mut self, entry: DeviceEntry) -> &mut Self {
        self.devices.retain(|known| known.spec.name != entry.spec.name);
        self.add_device(entry)
    }

    /// The names registered more than once, and the bridges with the name of another form of a connection.
    pub(crate) fn twice(&self) -> impl Iterator<Item = (&'static str, Namespace)> {
        let nodes = self.nodes.iter().map(|entry| entry.spec.name).collect();
        let devices = self.devices.iter().map(|entry| entry.spec.name).collect();
        let kinds = self.kinds.iter().map(|kind| kind.spec().name).collect();
        let bridges = self.bridges.iter().map(|entry| entry.spec.name);
        let bridges = bridges.chain(RESERVED).collect();
        let all = [
            (nodes, Namespace::Nodes),
            (devices, Namespace::Devices),
            (kinds, Namespace::Kinds),
            (bridges, Namespace::Bridges),
        ];
        all.into_iter().flat_map(|(names, of)| repeated(names).map(move |name| (name, of)))
    }

    /// The ports whose kind of frames is not registered: the kind of node or device, the port, and the kind.
    pub(crate) fn unregistered_kinds(&self) -> impl Iterator<Item = (&'static str, &'static str, Kind)> {
        let of_node = |entry: &NodeEntry| {
            let inputs = entry.spec.inputs.iter().map(|port| (port.name, port.kind));
            let outputs = entry.spec.outputs.iter().map(|port| (port.name, port.kind));
            let name = entry.spec.name;
            inputs.chain(outputs).filter_map(move |(port, rule)| match rule {
                KindRule::Is(kind) => Some((name, port, kind)),
                _ => None,
            })
        };
        let of_device = |entry: &DeviceEntry| {
            let channels = entry.spec.senses.iter().chain(entry.spec.drives);
            let name = entry.spec.name;
            channels.map(move |channel| (name, channel.name, channel.kind))
        };
        let nodes = self.nodes.iter().flat_map(of_node);
        let ports = nodes.chain(self.devices.iter().flat_map(of_device));
        ports.filter(|(_, _, kind)| !self.kinds.iter().any(|known| known.agrees_with(*kind)))
    }

    /// The driven channels whose frames no limiter takes: the kind of device, the channel, and its kind.
    pub(crate) fn unlimited(&self) -> impl Iterator<Item = (&'static str, &'static str, Kind)> {
        let drives = |entry: &DeviceEntry| {
            let name = entry.spec.name;
            let drives = entry.spec.drives.iter();
            drives.map(move |channel| (name, channel.name, channel.kind))
        };
        let drives = self.devices.iter().flat_map(drives);
        drives.filter(|(_, _, kind)| !LIMITED_WIDTHS.contains(&kind.width()))
    }

    /// The kind of frames of this name.
    pub fn kind(&self, name: &str) -> Option<Kind> {
        self.kinds.iter().find(|kind| kind.spec().name == name).copied()
    }

    /// The type of bridge of this name.
    pub fn bridge(&self, name: &str) -> Option<BridgeEntry> {
        self.bridges.iter().find(|entry| entry.spec.name == name).copied()
    }

    /// All types of bridges between clocks of one driver, the engine's own first, then in the order of registration.
    pub fn bridges(&self) -> &[BridgeEntry] {
        &self.bridges
    }

    /// All kinds of frames, the engine's own first, then in the order of registration.
    pub fn kinds(&self) -> &[Kind] {
        &self.kinds
    }

    /// The node kind of this name.
    pub fn node(&self, name: &str) -> Option<NodeEntry> {
        self.nodes.iter().find(|entry| entry.spec.name == name).copied()
    }

    /// The alias of this former name.
    pub fn alias(&self, former: &str) -> Option<Alias> {
        self.aliases.iter().find(|alias| alias.former == former).copied()
    }

    /// The node kind of this name or former name.
    pub fn node_meant(&self, name: &str) -> Option<NodeEntry> {
        let alias = || self.node(self.alias(name)?.kind);
        self.node(name).or_else(alias)
    }

    /// All former names of node kinds.
    pub fn aliases(&self) -> &[Alias] {
        &self.aliases
    }

    /// The device kind of this name.
    pub fn device(&self, name: &str) -> Option<DeviceEntry> {
        self.devices.iter().find(|entry| entry.spec.name == name).copied()
    }

    /// All node kinds, in the order of registration.
    pub fn nodes(&self) -> &[NodeEntry] {
        &self.nodes
    }

    /// All device kinds, in the order of registration.
    pub fn devices(&self) -> &[DeviceEntry] {
        &self.devices
    }
}

/// The namespaces of a registry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Namespace {
    Nodes,
    Devices,
    /// Kinds of frames.
    Kinds,
    Bridges,
}

impl Default for Registry {
    fn default() -> Self {
        Self::new()
    }
}

fn repeated(mut names: Vec<&'static str>) -> impl Iterator<Item = &'static str> {
    names.sort_unstable();
    let chunks: Vec<_> =
        names.chunk_by(|a, b| a == b).filter(|same| same.len() > 1).map(|same| same[0]).collect();
    chunks.into_iter()
}
