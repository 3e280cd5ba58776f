//! What a stimulus gains and measures at ports of the graph while it is felt: for conditions and `measures`.

use crate::document::{Gate, Phase, Study};
use haptograph_engine::document::value::Name;

/// The conditions and measures of one stimulus in a trial, over all runs in which it is felt.
#[derive(Debug, Clone)]
pub struct Tally {
    gates: Vec<(Name, Gate)>,
    measures: Vec<String>,
    ports: Vec<Port>,
}

/// The frames of a port so far; of a vector its length.
#[derive(Debug, Clone, Default)]
struct Port {
    name: String,
    unit: String,
    first: Option<f64>,
    last: f64,
    /// Gained in earlier runs.
    before: f64,
    count: f64,
    mean: f64,
    /// Sum of squared distances from the mean (Welford).
    spread: f64,
    largest: f64,
}

impl Port {
    fn gained(&self) -> f64 {
        self.before + self.last - self.first.unwrap_or(self.last)
    }

    fn take(&mut self, value: f64) {
        self.first.get_or_insert(value);
        self.last = value;
        self.count += 1.0;
        let from_mean = value - self.mean;
        self.mean += from_mean / self.count;
        self.spread += from_mean * (value - self.mean);
        self.largest = self.largest.max(value.abs());
    }
}

impl Tally {
    /// Of a stimulus of a phase, before its first run.
    pub fn new(study: &Study, phase: &Phase) -> Self {
        let gates = phase.facts().gates.to_vec();
        let measures: Vec<String> = study.measures.iter().map(|name| name.text.clone()).collect();
        let mut names: Vec<&String> =
            gates.iter().map(|(_, gate)| &gate.port.text).chain(&measures).collect();
        names.sort();
        names.dedup();
        let port = |name: &String| Port { name: name.clone(), ..Port::default() };
        let ports = names.into_iter().map(port).collect();
        Self { gates, measures, ports }
    }

    /// The ports whose frames are needed, as the study names them.
    pub fn ports(&self) -> impl Iterator<Item = &str> {
        self.ports.iter().map(|port| port.name.as_str())
    }

    /// Begins a run: its graph counts from zero.
    pub fn begin_run(&mut self) {
        for port in &mut self.ports {
            port.before = port.gained();
            (port.first, port.last) = (None, 0.0);
        }
    }

    /// Takes frames of a port, their components one after the other, in its SI unit.
    pub fn take(&mut self, port: &str, (width, unit): (usize, &str), frames: &[f64]) {
        let Some(port) = self.ports.iter_mut().find(|known| known.name == port) else { return };
        if port.unit != unit {
            unit.clone_into(&mut port.unit);
        }
        for frame in frames.chunks_exact(width.max(1)) {
            port.take(if frame.len() == 1 {
                frame[0]
            } else {
                frame.iter().map(|x| x * x).sum::<f64>().sqrt()
            });
        }
    }

    fn port(&self, name: &str) -> Option<&Port> {
        self.ports.iter().find(|port| port.name == name)
    }

    /// Each condition by its name, and the part of it that is reached, 0 to 1.
    pub fn reached(&self) -> impl Iterator<Item = (&str, f64)> {
        self.gates.iter().map(|(name, gate)| {
            let gained = self.port(&gate.port.text).map_or(0.0, Port::gained);
            let part = if gained >= gate.at_least { 1.0 } else { (gained / gate.at_least).clamp(0.0, 0.999) };
            (name.text.as_str(), part)
        })
    }

    /// True if all conditions are reached.
    pub fn is_open(&self) -> bool {
        self.reached().all(|(_, part)| part >= 1.0)
    }

    /// The numbers that are kept: names, values, units.
    pub fn measures(&self, prefix: &str) -> Vec<(String, f64, String)> {
        let mut all = Vec::new();
        for (name, gate) in &self.gates {
            let gained = self.port(&gate.port.text).map_or(0.0, Port::gained);
            all.push((format!("{prefix}{}", name.text), gained, gate.quantity.unit()));
        }
        for name in &self.measures {
            let Some(port) = self.port(name).filter(|port| port.count > 0.0) else { continue };
            let sd = (port.spread / (port.count - 1.0).max(1.0)).sqrt();
            for (what, value) in [("mean", port.mean), ("sd", sd), ("largest", port.largest)] {
                all.push((format!("{prefix}{name} {what}"), value, port.unit.clone()));
            }
        }
        all
    }
}
