//! Settings that can only be changed in the file or from the terminal, not by network.

use haptograph_engine::graph::Graph;
use haptograph_engine::node::Limit;

/// The protected settings: the limits of all actuators, and the settings of all output devices.
#[derive(Debug, PartialEq)]
pub(super) struct ProtectedSettings {
    /// Path, unit and limit of each sink.
    limits: Vec<(String, String, Limit)>,
    driven: Vec<(String, u64)>,
}

impl ProtectedSettings {
    pub fn of(graph: &Graph) -> Self {
        let unit = |sink: &str| {
            let mut nodes = graph.nodes().iter();
            let node = nodes.find(|node| node.path == sink);
            let output = node.and_then(|node| node.outputs.first());
            output.map_or_else(String::new, |output| output.quantity.unit())
        };
        let limits = graph.limits().map(|(sink, limit)| (sink.to_owned(), unit(sink), limit));
        let driven = graph.driven_devices();
        Self {
            limits: limits.collect(),
            driven: driven.map(|device| (device.name.clone(), device.fingerprint)).collect(),
        }
    }

    /// Describes the limits that differ from those of `before`.
    pub fn changes(&self, before: &Self) -> Vec<String> {
        let mut changes = Vec::new();
        for (sink, unit, now) in &self.limits {
            let mut known = before.limits.iter();
            let Some((.., was)) = known.find(|(known, ..)| known == sink) else {
                continue;
            };
            let slew = |limit: &Limit| limit.slew_per_s.unwrap_or(f64::INFINITY);
            for (name, unit, was, now) in [
                ("peak", unit.clone(), was.peak, now.peak),
                ("continuous", unit.clone(), was.continuous, now.continuous),
                ("window", "s".to_owned(), was.window_s, now.window_s),
                ("slew", format!("{unit}/s"), slew(was), slew(now)),
            ] {
                if was != now {
                    changes.push(format!("limit of `{sink}`: {name} {was} -> {now} {unit}"));
                }
            }
        }
        changes
    }
}
