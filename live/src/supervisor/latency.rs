//! Measured latencies of a live run, from sources to actuators.

use super::report::{LatencyPart, LatencyReport, QuantilesMs, TransportMs, ms};
use crate::soundcard::output_sinks;
use haptograph_engine::graph::{Graph, PathLatency};
use haptograph_engine::run::Histogram;

/// The latency from a source that reads a device to a sink that drives one.
#[derive(Debug)]
pub struct Measured {
    planned: PathLatency,
    /// Age of the data when they were read.
    age: Part,
    /// Output latency stated by the system; unknown for a device on the network.
    leaving: Part,
}

/// The latency at one end of the path.
#[derive(Debug)]
enum Part {
    Simulated,
    Known(Histogram),
    Unknown,
}

/// The latencies of all source-sink pairs of a graph; `output_latency` is the one stated by the system for
/// the soundcard.
pub(super) fn measured(graph: &Graph, output_latency: Option<&Histogram>) -> Vec<Measured> {
    let cards: Vec<_> = output_sinks(graph).iter().map(|output| output.sink).collect();
    let pairs = graph.latencies().into_iter().filter_map(|planned| {
        let [source, sink] = planned.ends.map(|node| {
            let device = graph.nodes()[node].device()?;
            Some(&graph.devices()[device])
        });
        let ages = source?.device().ages().map(|meter| meter.ages());
        let leaving = output_latency.filter(|_| cards.contains(&planned.ends[1]));
        Some(Measured {
            age: Part::of(source?.entry.spec.simulated, ages),
            leaving: Part::of(sink?.entry.spec.simulated, leaving.cloned()),
            planned,
        })
    });
    pairs.collect()
}

impl Part {
    fn of(simulated: bool, seen: Option<Histogram>) -> Self {
        match seen.filter(|histogram| histogram.total() > 0) {
            _ if simulated => Self::Simulated,
            Some(histogram) => Self::Known(histogram),
            None => Self::Unknown,
        }
    }

    fn at_ms(&self, fraction: f64) -> Option<f64> {
        match self {
            Self::Simulated => Some(0.0),
            Self::Known(histogram) => Some(ms(histogram.quantile_ns(fraction))),
            Self::Unknown => None,
        }
    }

    fn shown(&self) -> String {
        match self {
            Self::Simulated => "0 (simulated)".to_owned(),
            Self::Known(histogram) => {
                let at = |fraction: f64| histogram.quantile_ns(fraction) as f64 / 1e6;
                format!("{:.2}/{:.2}/{:.2}", at(0.5), at(0.99), at(1.0))
            }
            Self::Unknown => "not known".to_owned(),
        }
    }

    fn report(&self) -> LatencyPart {
        match self {
            Self::Simulated => LatencyPart::Simulated("simulated".to_owned()),
            Self::Known(histogram) => LatencyPart::Measured(QuantilesMs::of(histogram)),
            Self::Unknown => LatencyPart::Unknown,
        }
    }
}

impl Measured {
    /// Sum of all known parts except group delays; `None` if nothing was read.
    fn transport_ms(&self, fraction: f64) -> Option<f64> {
        Some(
            self.age.at_ms(fraction)?
                + 1e3 * self.planned.held_s
                + self.leaving.at_ms(fraction).unwrap_or(0.0),
        )
    }

    /// One line of text.
    fn shown(&self) -> String {
        let PathLatency { source, sink, .. } = &self.planned;
        let all = [0.5, 0.99, 1.0].map(|fraction| self.transport_ms(fraction));
        let transport = match all {
            [Some(half), Some(most), Some(longest)] => {
                format!("transport {half:.2} ms p50, {most:.2} p99, {longest:.2} max")
            }
            _ => "no input was read".to_owned(),
        };
        format!(
            "latency {source} -> {sink}: {transport} (age when read {}, in the graph {:.2}, output as stated by the \
             system {}); group delay {:.2} ms",
            self.age.shown(),
            1e3 * self.planned.held_s,
            self.leaving.shown(),
            1e3 * self.planned.group_delay_s
        )
    }

    /// The name and the numbers of a latency.
    pub(super) fn report(&self) -> (String, LatencyReport) {
        let round = |seconds: f64| (seconds * 1e6).round() / 1e3;
        let at = |fraction: f64| self.transport_ms(fraction).map(|ms| (ms * 1e3).round() / 1e3);
        let planned = &self.planned;
        let report = LatencyReport {
            transport: TransportMs { p50: at(0.5), p99: at(0.99), max: at(1.0) },
            age_when_read: self.age.report(),
            held_by_the_graph: round(planned.held_s),
            until_played: self.leaving.report(),
            computed_transport: round(planned.transport_s),
            group_delay: round(planned.group_delay_s),
        };
        (format!("{} to {}", planned.source, planned.sink), report)
    }
}

impl std::fmt::Display for Measured {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.shown())
    }
}
