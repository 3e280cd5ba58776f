//! The nodes that depend on a live input.

use super::Graph;

/// The nodes that depend on a live input, by index.
pub(crate) struct Reach {
    pub device: usize,
    pub nodes: Vec<bool>,
}

impl Graph {
    /// The nodes that depend on each live input, through connections and through the bodies that sinks drive.
    pub(crate) fn reaches_of_inputs(&self) -> Vec<Reach> {
        let inputs = self.devices.iter().enumerate();
        let inputs = inputs.filter(|(_, known)| known.device.live_input().is_some());
        inputs.map(|(device, _)| self.reach_of(device)).collect()
    }

    fn reach_of(&self, device: usize) -> Reach {
        let reads = |wanted: usize| {
            let nodes = self.nodes.node_indices();
            nodes.filter(move |node| self.nodes[*node].work.source_device() == Some(wanted))
        };
        let mut nodes = vec![false; self.nodes.node_count()];
        let mut open: Vec<_> = reads(device).collect();
        while let Some(node) = open.pop() {
            if std::mem::replace(&mut nodes[node.index()], true) {
                continue;
            }
            open.extend(self.nodes.neighbors(node));
            if let Some(driven) = self.nodes[node].work.sink_device() {
                open.extend(reads(driven));
            }
        }
        // Actuators of the device itself depend on it, connected or not.
        for node in self.nodes.node_indices() {
            nodes[node.index()] |= self.nodes[node].work.sink_device() == Some(device);
        }
        Reach { device, nodes }
    }
}
