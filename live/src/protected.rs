//! What is protected in a graph: its actuators with their limits, and the devices that it drives.
//!
//! One list for every way in which a running graph is changed: a value from the network may change nothing of it, a page may not
//! exceed what a person has confirmed, and a change from the terminal or the file is reported.

use haptograph_engine::graph::Graph;
use haptograph_engine::node::Limit;

/// An actuator with its limit and its device.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ProtectedActuator {
    /// Path of the sink.
    pub sink: String,
    /// Kind of the sink.
    pub kind: &'static str,
    /// Unit of the limit.
    pub unit: String,
    /// Name of the device.
    pub endpoint: String,
    /// The limit.
    pub limit: Limit,
}

/// A part of a limit that differs from an earlier one.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LimitChange {
    /// `peak`, `continuous`, `window` or `slew`.
    pub part: &'static str,
    /// The earlier value; infinite if there was no limit.
    pub was: f64,
    /// The present value; infinite if there is no limit.
    pub now: f64,
    /// Unit of both.
    pub unit: String,
}

impl ProtectedActuator {
    /// The actuators of a graph.
    pub fn all(graph: &Graph) -> Vec<Self> {
        let each = graph.actuators().map(|(node, device, limit)| Self {
            sink: node.path.clone(),
            kind: node.entry.spec.name,
            unit: node.outputs.first().map_or_else(String::new, |output| output.quantity.unit()),
            endpoint: device.name.clone(),
            limit,
        });
        each.collect()
    }

    /// The parts of the limit that differ from those of `before`.
    pub fn limit_changes(&self, before: &Self) -> impl Iterator<Item = LimitChange> {
        let slew = |limit: &Limit| limit.slew_per_s.unwrap_or(f64::INFINITY);
        let (was, now, unit) = (&before.limit, &self.limit, &self.unit);
        let parts = [
            ("peak", was.peak, now.peak, unit.clone()),
            ("continuous", was.continuous, now.continuous, unit.clone()),
            ("window", was.window_s, now.window_s, "s".to_owned()),
            ("slew", slew(was), slew(now), format!("{unit}/s")),
        ];
        let changed = parts.into_iter().filter(|(_, was, now, _)| was != now);
        changed.map(|(part, was, now, unit)| LimitChange { part, was, now, unit })
    }
}

/// The protected part of a graph. Two that are equal differ in no limit and no driven device.
#[cfg(feature = "supervisor")]
#[derive(Debug, PartialEq)]
pub(crate) struct Protected {
    actuators: Vec<ProtectedActuator>,
    driven: Vec<(String, u64)>,
}

#[cfg(feature = "supervisor")]
impl Protected {
    pub(crate) fn of(graph: &Graph) -> Self {
        let driven = graph.driven_devices();
        Self {
            actuators: ProtectedActuator::all(graph),
            driven: driven.map(|device| (device.name.clone(), device.fingerprint)).collect(),
        }
    }

    /// Describes the limits that differ from those of `before`.
    pub(crate) fn changes(&self, before: &Self) -> Vec<String> {
        let mut changes = Vec::new();
        for actuator in &self.actuators {
            let sink = &actuator.sink;
            let was = before.actuators.iter().find(|known| known.sink == *sink);
            for LimitChange { part, was, now, unit } in
                was.into_iter().flat_map(|was| actuator.limit_changes(was))
            {
                changes.push(format!("limit of `{sink}`: {part} {was} -> {now} {unit}"));
            }
        }
        changes
    }
}
