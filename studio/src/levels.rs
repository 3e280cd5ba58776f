//! Live values of the drawing: the level of every port, the cost of each node, and the places where limits
//! acted or NaN appeared.

use super::scope::Port;
use haptograph_engine::frame::Kind;
use haptograph_engine::graph::Graph;
use haptograph_engine::run::Session;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Weight of a new value in the mean cost; messages come ten times per second.
const RENEWED: f64 = 0.05;
/// Upper bound of a squared level, so that sums stay finite.
const MOST: f64 = 1e290;
/// Number of messages without a frame after which a port has no level.
const MAX_IDLE: u32 = 20;
/// Significant digits of a sent level.
const DIGITS: i32 = 3;

/// Level of a port since the last message.
#[derive(Debug, Clone, Default)]
pub(crate) struct Level {
    square: f64,
    count: u64,
    peak: f64,
    /// The latest snapshot, and the number of snapshots since then without a frame.
    latest: [f64; 2],
    idle: u32,
    /// Number of frames with NaN or infinity since the start of the run.
    pub not_finite: u64,
}

impl Level {
    /// Adds frames of a port.
    pub(crate) fn take(&mut self, kind: Kind, frames: &[f64]) {
        for frame in frames.chunks_exact(kind.width()) {
            if !frame.iter().all(|x| x.is_finite()) {
                self.not_finite += 1;
                continue;
            }
            let square = (kind.spec().level.square)(frame).min(MOST);
            self.square += square;
            self.count += 1;
            self.peak = self.peak.max(square);
        }
    }

    /// RMS and peak since the last snapshot, or the previous values if a slow port had no frame since; `None`
    /// after a long time without frames.
    pub(crate) fn snapshot(&mut self) -> Option<[f64; 2]> {
        self.idle = if self.count > 0 { 0 } else { self.idle + 1 };
        if self.count > 0 {
            self.latest = [(self.square / self.count as f64).sqrt(), self.peak.sqrt()];
            (self.square, self.count, self.peak) = (0.0, 0, 0.0);
        }
        (self.idle < MAX_IDLE).then_some(self.latest)
    }
}

/// The ports that have a level, with label and unit.
pub(crate) fn described(ports: &[Port]) -> Vec<Value> {
    let port = |port: &Port| {
        let level = port.kind.spec().level;
        let unit = level.unit.map_or_else(|| port.quantity.unit(), str::to_owned);
        json!({ "name": port.name, "what": level.name, "unit": unit })
    };
    ports.iter().map(port).collect()
}

/// Costs of the nodes: the sums at the last update, and means of the increments.
#[derive(Debug, Default)]
pub(crate) struct Costs {
    sums: BTreeMap<String, f64>,
    means: BTreeMap<String, f64>,
}

impl Costs {
    /// Updates from the session; returns each node's share of the total.
    pub(crate) fn update(&mut self, session: &Session, graph: &Graph) -> BTreeMap<String, f64> {
        let nodes = graph.nodes();
        let paths = session.node_costs().into_iter();
        self.take(paths.map(|(node, ns)| (nodes[node].path.clone(), ns)).collect())
    }

    fn take(&mut self, sums: BTreeMap<String, f64>) -> BTreeMap<String, f64> {
        self.means.retain(|path, _| sums.contains_key(path));
        for (path, sum) in &sums {
            // After a swap of the graph the sums restart.
            let before = self.sums.get(path).filter(|before| *before <= sum);
            let mean = self.means.entry(path.clone()).or_default();
            *mean += RENEWED * (sum - before.unwrap_or(&0.0) - *mean);
        }
        self.sums = sums;
        let whole: f64 = self.means.values().sum();
        let parts = self.means.iter().filter(|_| whole > 0.0);
        parts.map(|(path, mean)| (path.clone(), mean / whole)).collect()
    }
}

/// Rounds a number to few digits, so that it is short as text.
pub(crate) fn short(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return 0.0;
    }
    let scale = 10_f64.powi(DIGITS - 1 - value.abs().log10().floor() as i32);
    match (value * scale).round() / scale {
        rounded if rounded.is_finite() => rounded,
        _ => value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_is_of_what_came_since_and_counts_nan_apart() {
        let mut level = Level::default();
        level.take(Kind::SCALAR, &[3.0, -4.0, f64::NAN, f64::INFINITY]);
        assert_eq!(level.snapshot(), Some([12.5_f64.sqrt(), 4.0]));
        assert_eq!((level.snapshot(), level.not_finite), (Some([12.5_f64.sqrt(), 4.0]), 2));
        level.take(Kind::VECTOR, &[3.0, 0.0, 4.0, 0.0, 0.0, 0.0]);
        assert_eq!(level.snapshot(), Some([12.5_f64.sqrt(), 5.0]));
        level.take(Kind::WRENCH, &[0.0, 2.0, 0.0, 9.0, 9.0, 9.0]);
        assert_eq!(level.snapshot(), Some([2.0, 2.0]));
        assert!((0..MAX_IDLE).all(|turn| level.snapshot().is_some() == (turn + 1 < MAX_IDLE)));
    }

    #[test]
    fn parts_are_of_what_was_measured_since_and_begin_anew_with_another_graph() {
        let sums = |of: &[(&str, f64)]| of.iter().map(|(path, ns)| ((*path).to_owned(), *ns)).collect();
        let mut costs = Costs::default();
        assert!(costs.take(sums(&[])).is_empty());
        let parts = costs.take(sums(&[("a", 100.0), ("b", 300.0)]));
        assert_eq!((parts["a"], parts["b"]), (0.25, 0.75));
        for turn in 1..200 {
            costs.take(sums(&[("a", 100.0 + 60.0 * f64::from(turn)), ("b", 300.0 + 20.0 * f64::from(turn))]));
        }
        let parts = costs.take(sums(&[("a", 60.0), ("c", 0.0)]));
        assert!(!parts.contains_key("b") && parts["a"] > 0.999, "{parts:?}");
    }

    #[test]
    fn numbers_are_sent_with_three_digits() {
        let sent = [0.0123456, -98765.0, 1e-9, 5e-310, f64::NAN].map(short);
        assert_eq!(sent, [0.0123, -98800.0, 1e-9, 5e-310, 0.0]);
    }
}
