//! The actuators of a graph, and the sound played by the page.

use super::scope::Scope;
use haptograph_engine::graph::{Graph, GraphDevice};
use serde_json::{Value, json};

/// An actuator with the values delivered to it.
#[derive(Debug)]
pub(crate) struct Actuator {
    pub name: String,
    /// The endpoint that the actuator drives, and whether that endpoint is a real device: neither simulated nor a pad.
    pub endpoint: String,
    pub is_real: bool,
    pub unit: String,
    pub peak: f64,
    pub continuous: f64,
    pub window_s: f64,
    pub rate_hz: f64,
    pub delivered: Delivered,
}

/// Values delivered to an actuator since the last status.
#[derive(Debug, Clone, Default)]
pub(crate) struct Delivered {
    square: f64,
    count: u64,
    peak: f64,
    peak_ever: f64,
    /// Weighted mean square, as in the thermal limit.
    heat: f64,
}

impl Delivered {
    /// Adds frames of an actuator with the thermal window `window_s`.
    pub(crate) fn take(&mut self, scope: &Scope, window_s: f64) {
        let part = 1.0 / (window_s * scope.port.rate_hz);
        for frame in scope.fresh().chunks_exact(scope.lanes()) {
            let square: f64 = frame.iter().map(|x| x * x).sum();
            self.square += square;
            self.count += 1;
            self.peak = self.peak.max(square.sqrt());
            self.heat += (square - self.heat) * part;
        }
        self.peak_ever = self.peak_ever.max(self.peak);
    }

    /// The status, and the start of the next.
    pub(crate) fn status(&mut self, name: &str, continuous: f64, (is_real, is_armed): (bool, bool)) -> Value {
        let rms = (self.square / self.count.max(1) as f64).sqrt();
        let status = json!({
            "name": name, "rms": rms, "peak": self.peak, "delivered_peak": self.peak_ever,
            "heat": self.heat / (continuous * continuous), "simulated": !is_real, "armed": is_real && is_armed,
        });
        (self.square, self.count, self.peak) = (0.0, 0, 0.0);
        status
    }
}

/// True for a device that is neither simulated nor the page's.
pub(crate) fn is_real(device: &GraphDevice) -> bool {
    !device.entry.spec.simulated && !device.entry.is_host()
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
