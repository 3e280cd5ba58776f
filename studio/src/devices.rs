//! The real devices of the run.

use haptograph_engine::run::ArmSwitch;
use std::sync::Arc;

/// The real devices of the run.
#[derive(Default)]
pub(crate) struct Devices {
    /// Arms the real actuators; the same for all runs.
    pub switch: Arc<ArmSwitch>,
    /// The driven devices that sent data at the last poll.
    pub heard: Vec<String>,
    /// The latest event of a device.
    pub note: Option<String>,
}

impl Devices {
    /// Forgets what was said of the devices of a run.
    pub(crate) fn release(&mut self) {
        self.note = None;
        self.heard.clear();
    }
}
