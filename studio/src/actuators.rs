//! The actuators of a graph, and the sound played by the page.

use super::publish::Delivered;
use super::scope::Port;
use super::stage::Stage;
use haptograph_engine::frame::Kind;
use haptograph_engine::graph::{Graph, GraphDevice, Node};
use haptograph_engine::node::Limit;
use haptograph_signal::quantity::Quantity;

/// An actuator with the values delivered to it.
#[derive(Debug)]
pub struct Actuator {
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

/// True for a device that is neither simulated nor the page's.
fn is_real(device: &GraphDevice) -> bool {
    !device.entry.spec.simulated && !device.entry.is_host()
}

/// The real devices that a graph drives, with the fingerprints of their settings.
pub fn driven(graph: &Graph) -> Vec<(&str, u64)> {
    let devices = graph.driven_devices().filter(|device| is_real(device));
    devices.map(|device| (&*device.name, device.fingerprint)).collect()
}

/// The sound that the page plays.
#[derive(Debug)]
pub struct Sound {
    pub port: String,
    pub peak: f64,
    pub rate_hz: f64,
}

impl Stage {
    /// Finds the actuators and the sound of the graph.
    pub fn describe_actuators(&mut self) {
        let graph = &self.loaded.graph;
        let known: Vec<Actuator> = std::mem::take(&mut self.signals.actuators);
        let delivered = |sink: &str| {
            self.signals.scopes.iter().find(|scope| scope.port.name == format!("{sink}.delivered"))
        };
        let actuator = |(sink, device, limit): (&Node, &GraphDevice, Limit)| {
            let port = &delivered(&sink.path)?.port;
            let before = known.iter().find(|known| known.name == sink.path);
            Some(Actuator {
                name: sink.path.clone(),
                endpoint: device.name.clone(),
                is_real: is_real(device),
                unit: port.quantity.unit(),
                peak: limit.peak,
                continuous: limit.continuous,
                window_s: limit.window_s,
                rate_hz: port.rate_hz,
                delivered: before.map(|known| known.delivered.clone()).unwrap_or_default(),
            })
        };
        self.signals.actuators = graph.actuators().filter_map(actuator).collect();
        let is_coil = |port: &Port| {
            port.kind == Kind::SCALAR && port.quantity == Quantity::CURRENT && port.rate_hz >= 1000.0
        };
        let played = self.signals.actuators.iter().find_map(|actuator| {
            let port = &delivered(&actuator.name)?.port;
            is_coil(port).then(|| Sound {
                port: port.name.clone(),
                peak: actuator.peak,
                rate_hz: port.rate_hz,
            })
        });
        self.signals.sound = played;
    }
}
