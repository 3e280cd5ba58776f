//! The actuators of a graph, and the sound played by the page.

use haptograph_engine::graph::{Graph, GraphDevice};
use haptograph_engine::run::ActuatorLevel;
use serde_json::{Value, json};

/// An actuator of the graph.
#[derive(Debug)]
pub(crate) struct Actuator {
    pub name: String,
    /// The endpoint that the actuator drives, and whether that endpoint is a real device: neither simulated nor a pad.
    pub endpoint: String,
    pub is_real: bool,
    pub unit: String,
    pub peak: f64,
    pub continuous: f64,
    pub rate_hz: f64,
    /// Largest magnitude delivered so far.
    pub peak_ever: f64,
}

impl Actuator {
    /// The status by the level of its sink; zeros without a run.
    pub(crate) fn status(&mut self, levels: &[ActuatorLevel], is_armed: bool) -> Value {
        let level = levels.iter().find(|level| level.path == self.name);
        let (rms, peak, heat) = level.map_or((0.0, 0.0, 0.0), |level| (level.rms, level.peak, level.heat));
        self.peak_ever = self.peak_ever.max(peak);
        json!({
            "name": self.name, "rms": rms, "peak": peak, "delivered_peak": self.peak_ever, "heat": heat,
            "simulated": !self.is_real, "armed": self.is_real && is_armed,
        })
    }
}

/// True for a device that is neither simulated nor the page's.
pub(crate) fn is_real(device: &GraphDevice) -> bool {
    !device.entry.spec.simulated && !device.entry.is_host()
}

/// True if a graph drives or reads a real device.
pub(crate) fn has_real(graph: &Graph) -> bool {
    graph.devices().iter().any(is_real)
}

/// The real devices that a graph drives, with the fingerprints of their settings.
pub(crate) fn driven(graph: &Graph) -> Vec<(&str, u64)> {
    let devices = graph.driven_devices().filter(|device| is_real(device));
    devices.map(|device| (&*device.name, device.fingerprint)).collect()
}

/// The sound that the page plays.
#[derive(Debug)]
pub(crate) struct Sound {
    pub port: String,
    pub peak: f64,
    pub rate_hz: f64,
}
