//! The registry of node and device kinds.

use crate::device::DeviceEntry;
use crate::node::NodeEntry;

/// Node kinds, device kinds and library templates of a program. `haptograph_nodes::registry()` has the shipped ones.
#[derive(Debug, Clone, Default)]
pub struct Registry {
    nodes: Vec<NodeEntry>,
    devices: Vec<DeviceEntry>,
    library: Vec<(&'static str, &'static str)>,
}

impl Registry {
    /// Makes an empty registry.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a node kind. With two kinds of one name no graph passes [`check`](crate::graph::check): the error is
    /// `E0212`.
    pub fn add(&mut self, entry: NodeEntry) -> &mut Self {
        self.nodes.push(entry);
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

    /// The names registered more than once: of node kinds, then of device kinds.
    pub(crate) fn twice(&self) -> impl Iterator<Item = &'static str> {
        let nodes = self.nodes.iter().map(|entry| entry.spec.name).collect();
        let devices = self.devices.iter().map(|entry| entry.spec.name).collect();
        repeated(nodes).chain(repeated(devices))
    }

    /// The node kind of this name.
    pub fn node(&self, name: &str) -> Option<NodeEntry> {
        self.nodes.iter().find(|entry| entry.spec.name == name).copied()
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

fn repeated(mut names: Vec<&'static str>) -> impl Iterator<Item = &'static str> {
    names.sort_unstable();
    let chunks: Vec<_> = names
        .chunk_by(|a, b| a == b)
        .filter(|same| same.len() > 1)
        .map(|same| same[0])
        .collect();
    chunks.into_iter()
}
