//! Live inputs: whether a device that this program does not own is still heard, and what its silence does to actuators.

use crate::graph::Graph;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

crate::choices! {
    /// What the silence of a live input does to every actuator that depends on it.
    pub enum OnSilence {
        /// The actuators ramp to zero through their limiters, and back through a ramp when the input is heard again.
        Zero,
        /// The actuators go on: position and force hold their last values, a soundcard's signal reads zero. Until the
        /// input is heard for the first time its actuators are at zero.
        Hold,
    }
}

/// Whether a live input is heard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum InputState {
    /// Nothing has arrived yet: so it stays in an offline run.
    #[default]
    Never,
    /// What it senses is fresh.
    Heard,
    /// What it sensed last is older than its timeout.
    Silent,
    /// It is heard, but moved faster than a hand: its own drives are held back for a while.
    Jumped,
}

/// The state of a live input, shared between the driver that reads it and all that depend on it.
#[derive(Debug, Default)]
pub struct InputCell(AtomicU8);

impl InputCell {
    /// Sets the state; only called by the driver that the device ticks on.
    pub fn set(&self, state: InputState) {
        self.0.store(state as u8, Relaxed);
    }

    /// The state that was set last.
    pub fn get(&self) -> InputState {
        match self.0.load(Relaxed) {
            1 => InputState::Heard,
            2 => InputState::Silent,
            3 => InputState::Jumped,
            _ => InputState::Never,
        }
    }
}

/// A device as a live input. Copies of the device share its cell.
#[derive(Debug, Clone)]
pub struct LiveInput {
    /// Its state.
    pub cell: Arc<InputCell>,
    /// Do the actuators that depend on it go on while it is silent?
    pub holds: bool,
    /// Silence after which it counts as gone, s.
    pub timeout_s: f64,
}

impl LiveInput {
    /// May an actuator that depends on it be driven? An actuator of the device itself (`own`) never is while the device
    /// is silent or jumps.
    pub(crate) fn lets_through(&self, own: bool) -> bool {
        match self.cell.get() {
            InputState::Never => false,
            InputState::Heard => true,
            InputState::Silent => self.holds && !own,
            InputState::Jumped => !own,
        }
    }
}

/// The nodes that depend on a live input, by their indices.
pub(crate) struct Reach {
    pub device: usize,
    pub nodes: Vec<bool>,
}

impl Graph {
    /// How far each live input reaches: along connections of every kind, and through the bodies that sinks drive.
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
        // What drives the device itself depends on it, whatever the graph does with what it senses.
        for node in self.nodes.node_indices() {
            nodes[node.index()] |= self.nodes[node].work.sink_device() == Some(device);
        }
        Reach { device, nodes }
    }
}
