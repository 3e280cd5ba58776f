//! The real devices of the run.

use haptograph_engine::registry::Registry;
use haptograph_engine::run::ArmSwitch;
use haptograph_live::Connections;
use haptograph_live::soundcard::{CardRequests, Inputs};
use std::sync::Arc;

/// The real devices of the run.
pub(crate) struct Devices {
    /// Arms the real actuators; the same for all runs.
    pub switch: Arc<ArmSwitch>,
    /// The driven devices that sent data at the last poll.
    pub heard: Vec<String>,
    /// The devices of other programs, the soundcards that are listened to, and the streams requested of soundcards.
    pub network: Connections,
    pub inputs: Inputs,
    pub card_requests: Option<CardRequests>,
    /// The latest event of a device.
    pub note: Option<String>,
}

impl Devices {
    /// No connected device.
    pub(crate) fn new(registry: &Registry) -> Self {
        Self {
            switch: Arc::default(),
            heard: Vec::new(),
            network: Connections::new(registry),
            inputs: Inputs::default(),
            card_requests: None,
            note: None,
        }
    }

    /// Disconnects the devices, after a last zero to each.
    pub(crate) fn release(&mut self, registry: &Registry) {
        self.network = Connections::new(registry);
        (self.inputs, self.note) = (Inputs::default(), None);
        self.heard.clear();
    }
}
