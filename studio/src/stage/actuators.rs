//! The actuators and the sound of the running graph.

use super::super::actuators::{Actuator, Sound, is_real};
use super::super::scope::Port;
use super::Stage;
use haptograph_engine::frame::Kind;
use haptograph_engine::graph::{GraphDevice, Node};
use haptograph_engine::node::Limit;
use haptograph_signal::quantity::Quantity;

impl Stage {
    /// Finds the actuators and the sound of the graph.
    pub(crate) fn describe_actuators(&mut self) {
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
                rate_hz: port.rate_hz,
                peak_ever: before.map_or(0.0, |known| known.peak_ever),
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
