//! The node and device kinds that graphs can use.

use crate::device::DeviceEntry;
use crate::node::NodeEntry;

/// The kinds known to a program. `haptograph_nodes::registry()` has the shipped ones; add your own to it.
#[derive(Debug, Clone, Default)]
pub struct Registry {
    nodes: Vec<NodeEntry>,
    devices: Vec<DeviceEntry>,
    library: Vec<(&'static str, &'static str)>,
}

impl Registry {
    /// None yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a node kind. With two kinds of one name no graph passes [`check`](crate::graph::check): the error is `E0212`.
    pub fn add(&mut self, entry: NodeEntry) -> &mut Self {
        self.nodes.push(entry);
        self
    }

    /// Adds a device kind. With two kinds of one name no graph passes [`check`](crate::graph::check): the error is `E0212`.
    pub fn add_device(&mut self, entry: DeviceEntry) -> &mut Self {
        self.devices.push(entry);
        self
    }

    /// Adds templates that any graph can include, `include: ["std/NAME.ron"]`: the name, `std/NAME.ron`, and a text `Parts(...)`.
    /// Parts of the same name are replaced.
    pub fn add_parts(&mut self, name: &'static str, text: &'static str) -> &mut Self {
        self.library.retain(|(known, _)| *known != name);
        self.library.push((name, text));
        self
    }

    /// The library of templates: names and texts.
    pub fn library(&self) -> &[(&'static str, &'static str)] {
        &self.library
    }

    /// Puts a node kind in the place of the one of the same name, if there is one.
    pub fn replace(&mut self, entry: NodeEntry) -> &mut Self {
        self.nodes.retain(|known| known.spec.name != entry.spec.name);
        self.add(entry)
    }

    /// Puts a device kind in the place of the one of the same name, if there is one.
    pub fn replace_device(&mut self, entry: DeviceEntry) -> &mut Self {
        self.devices.retain(|known| known.spec.name != entry.spec.name);
        self.add_device(entry)
    }

    /// The names that two kinds have, each once: of nodes, then of devices.
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
