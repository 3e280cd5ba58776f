//! Arming of the real devices, and what they were last found to do.

use haptograph_engine::run::ArmSwitch;
use std::sync::Arc;

/// Arming of the real devices, and what they were last found to do.
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
    pub(crate) fn forget(&mut self) {
        self.note = None;
        self.heard.clear();
    }
}
