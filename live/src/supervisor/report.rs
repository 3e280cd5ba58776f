//! The report of a live run, as data.

use super::latency::Measured;
use crate::backend::{Counts, Role};
use crate::connections::Connections;
use crate::soundcard::CardCounts;
use haptograph_engine::graph::Graph;
use haptograph_engine::run::{Histogram, MAX_STALLS, Meters, SessionOutcome};
use haptograph_nodes::network::link::Counts as PacketCounts;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Report of a live run. Its serialised fields are those of `run.json`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RunReport {
    /// Description of the drivers.
    pub driver: String,
    /// The soundcard that drove the run.
    #[serde(flatten)]
    pub card: Option<CardReport>,
    /// Inputs of soundcards, by their endpoints.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub inputs: BTreeMap<String, InputReport>,
    /// Measured latencies, by `SOURCE to SINK`.
    pub latencies_ms: BTreeMap<String, LatencyReport>,
    /// Number of changed graphs, and of those that differed in more than live settings.
    pub changes: u32,
    /// Number of graphs that were swapped in.
    pub swaps: u32,
    /// The graphs that were saved during the run.
    pub saved_while_running: Vec<SavedGraph>,
    /// Sinks whose actuators began as warm as their limits allow.
    pub unrested: Vec<String>,
    /// Packets of each network device.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub packets: BTreeMap<String, PacketReport>,
    /// Live inputs that fell silent.
    pub silences: Vec<SilenceReport>,
    /// The changes of settings, each with its time and origin.
    pub set_while_running: Vec<String>,
    /// OSC packets that set nothing; `None` without settings by Open Sound Control.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub osc_malformed: Option<u64>,
    /// Always true: the report is that of a live run.
    pub live: bool,
    /// The clocks of the graph, each with its rate. These and the next three bound a [`replay`](super::replay::bounds).
    #[serde(default)]
    pub clocks: Vec<String>,
    /// Duration by the first driver, s.
    #[serde(default)]
    pub seconds: f64,
    /// Frames of the first driver.
    #[serde(default)]
    pub driver_frames: u64,
    /// Duration by the clock of the computer, s.
    #[serde(default)]
    pub took_s: f64,
    /// Timing of all drivers together.
    #[serde(flatten)]
    pub timing: TimingReport,
    /// Values lost on the way to files.
    pub lost_numbers: u64,
    /// Callbacks missing from the replay record.
    pub lost_callbacks: u64,
    /// Timing of each driver, if there are several.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub drivers: BTreeMap<String, TimingReport>,
    /// Panics, with their messages.
    pub panics: Vec<String>,
}

/// Counts of the stream that drove a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CardReport {
    /// Under- and overruns.
    pub xruns: XrunReport,
    /// Samples beyond full scale.
    pub clipped_samples: u64,
    /// Times that the card was gone.
    pub vanished: u64,
    /// Output latency that the system stated, ms.
    pub output_latency_ms: QuantilesMs,
}

/// Counts of a stream of inputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InputReport {
    /// The stream as it was opened.
    pub stream: String,
    /// Under- and overruns.
    pub xruns: XrunReport,
    /// Samples at or beyond full scale.
    pub clipped_samples: u64,
    /// Times that the card was gone.
    pub vanished: u64,
    /// Input latency that the system stated, ms.
    pub input_latency_ms: QuantilesMs,
}

/// Interruptions of a stream.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct XrunReport {
    /// Number of interruptions.
    pub count: u64,
    /// Longest delay of a callback after one, ms.
    pub longest_ms: f64,
    /// Time of the last one, ms from the start.
    pub last_at_ms: f64,
}

/// Quantiles, ms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QuantilesMs {
    /// Median.
    pub p50: f64,
    /// 99 %.
    pub p99: f64,
    /// Maximum.
    pub max: f64,
}

/// Quantiles, us.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct QuantilesUs {
    /// Median.
    pub p50: f64,
    /// 99 %.
    pub p99: f64,
    /// 99.9 %.
    #[serde(rename = "p99.9")]
    pub p999: f64,
    /// Maximum.
    pub max: f64,
}

/// The latency from a source to a sink, ms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LatencyReport {
    /// Without group delays; `None` if nothing was read.
    pub transport: TransportMs,
    /// Age of the data when they were read.
    pub age_when_read: LatencyPart,
    /// Time within the graph.
    pub held_by_the_graph: f64,
    /// Output latency.
    pub until_played: LatencyPart,
    /// Transport as the check computed it.
    pub computed_transport: f64,
    /// Group delay of the filters on the way.
    pub group_delay: f64,
}

/// Quantiles of a latency, ms; `None` if nothing was read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TransportMs {
    /// Median.
    pub p50: Option<f64>,
    /// 99 %.
    pub p99: Option<f64>,
    /// Maximum.
    pub max: Option<f64>,
}

/// A latency at one end of a path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum LatencyPart {
    /// A measured latency.
    Measured(QuantilesMs),
    /// `"simulated"`: there is none.
    Simulated(String),
    /// Nothing states it.
    Unknown,
}

/// A graph that was saved during a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedGraph {
    /// Time of the run, s.
    pub at_s: f64,
    /// Description of the change.
    pub what: String,
    /// How the graph took over, as [`Change::code`](haptograph_engine::run::Change::code) names it.
    #[serde(default)]
    pub change: String,
    /// Live settings with new values, `NAME=VALUE`.
    pub set: Vec<String>,
    /// Folder of its files, in that of the run.
    pub graph: String,
}

/// Packets of a device.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PacketReport {
    /// Numbers of accepted, lost and refused packets.
    #[serde(flatten)]
    pub counts: PacketCounts,
    /// OSC addresses that no device listens to, with the number of their messages.
    pub unclaimed_addresses: BTreeMap<String, u64>,
}

/// A silence of a live input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SilenceReport {
    /// Name of the endpoint.
    pub input: String,
    /// When it was reported, s.
    pub at_s: f64,
    /// True if the input had never delivered data.
    pub never_heard: bool,
    /// The silence policy of the input.
    pub on_silence: String,
    /// The actuators that depend on it.
    pub actuators: Vec<SilencedActuator>,
}

/// An actuator that depends on a silent input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SilencedActuator {
    /// Path of its sink.
    pub actuator: String,
    /// The value that was delivered to it.
    pub delivered: f64,
    /// Unit of that value.
    pub unit: String,
    /// True if the delivered value was zero.
    pub at_zero: bool,
}

/// Timing of a driver.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct TimingReport {
    /// Lateness.
    pub late_us: QuantilesUs,
    /// Execution time.
    pub work_us: QuantilesUs,
    /// Wake-ups.
    pub wakes: u64,
    /// Wake-ups that took longer than their period.
    pub overruns: u64,
    /// Stalls of the machine.
    pub stalls: u64,
    /// Wake-ups lost in stalls.
    pub lost_wakes: u64,
    /// Times of the first 100 stalls in the run's files, s: time stood still there, so that recorded signals jump.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stalled_at_s: Vec<f64>,
}

impl RunReport {
    /// Adds what the connections counted.
    pub(super) fn add_connections(&mut self, connections: &Connections) {
        self.driver = super::streams::description(connections);
        for (_, counts) in connections.counted(Role::Driver) {
            if let Counts::Stream(counts) = counts {
                self.card = Some(CardReport {
                    xruns: XrunReport::of(&counts),
                    clipped_samples: counts.clipped,
                    vanished: counts.vanished,
                    output_latency_ms: QuantilesMs::of(&counts.latency),
                });
            }
        }
        for (input, counts) in connections.counted(Role::Input) {
            if let Counts::Stream(counts) = counts {
                let report = InputReport {
                    stream: input.place,
                    xruns: XrunReport::of(&counts),
                    clipped_samples: counts.clipped,
                    vanished: counts.vanished,
                    input_latency_ms: QuantilesMs::of(&counts.latency),
                };
                self.inputs.insert(input.names.join(", "), report);
            }
        }
        for (device, counts, unclaimed) in connections.packets() {
            let report = PacketReport { counts, unclaimed_addresses: unclaimed.into_iter().collect() };
            self.packets.insert(device, report);
        }
    }

    /// Adds the outcome of a run that began with a graph.
    pub(super) fn add_outcome(
        &mut self,
        graph: &Graph,
        took_s: f64,
        ended: &SessionOutcome,
        latencies: &[Measured],
    ) {
        self.live = true;
        self.clocks = super::replay::clocks(graph);
        self.seconds = ended.outcome.seconds;
        self.driver_frames = ended.outcome.driver_frames;
        self.took_s = (took_s * 1e4).round() / 1e4;
        self.timing = TimingReport::of(&ended.meters);
        let timed = |(name, meters): &(String, Meters)| {
            let clock = graph.clocks().iter().find(|clock| clock.name == *name);
            let rate_hz = clock.map_or(f64::INFINITY, |clock| clock.rate.hz());
            let stalled_at_s = meters.stalled_at.iter().map(|frames| *frames as f64 / rate_hz);
            (name.clone(), TimingReport { stalled_at_s: stalled_at_s.collect(), ..TimingReport::of(meters) })
        };
        let drivers: Vec<(String, TimingReport)> = ended.drivers.iter().map(timed).collect();
        let stalls = drivers.iter().flat_map(|(_, timing)| timing.stalled_at_s.iter().copied());
        self.timing.stalled_at_s = stalls.collect();
        // Those of the first driver come first.
        self.timing.stalled_at_s.sort_by(f64::total_cmp);
        self.timing.stalled_at_s.truncate(MAX_STALLS);
        (self.lost_numbers, self.lost_callbacks) = (ended.lost_numbers, ended.lost_arrivals);
        if let [_, _, ..] = drivers[..] {
            self.drivers = drivers.into_iter().collect();
        }
        self.latencies_ms = latencies.iter().map(Measured::report).collect();
        if ended.panicked {
            self.panics = vec!["a real-time thread panicked".to_owned()];
        }
    }
}

impl TimingReport {
    fn of(meters: &Meters) -> Self {
        Self {
            late_us: QuantilesUs::of(&meters.lateness),
            work_us: QuantilesUs::of(&meters.work),
            wakes: meters.wakes,
            overruns: meters.overruns,
            stalls: meters.stalls,
            lost_wakes: meters.lost_wakes,
            stalled_at_s: Vec::new(),
        }
    }
}

impl XrunReport {
    fn of(counts: &CardCounts) -> Self {
        Self {
            count: counts.xruns,
            longest_ms: ms(counts.xrun_delay_max_ns),
            last_at_ms: ms(counts.xrun_last_ns),
        }
    }
}

impl QuantilesMs {
    /// Those of a histogram.
    pub(super) fn of(histogram: &Histogram) -> Self {
        let at = |fraction: f64| ms(histogram.quantile_ns(fraction));
        Self { p50: at(0.5), p99: at(0.99), max: ms(histogram.max_ns()) }
    }
}

impl QuantilesUs {
    fn of(histogram: &Histogram) -> Self {
        let us = |ns: u64| (ns as f64 / 100.0).round() / 10.0;
        let at = |fraction: f64| us(histogram.quantile_ns(fraction));
        Self { p50: at(0.5), p99: at(0.99), p999: at(0.999), max: us(histogram.max_ns()) }
    }
}

/// Nanoseconds to milliseconds.
pub(super) fn ms(ns: u64) -> f64 {
    (ns as f64 / 1e3).round() / 1e3
}

/// Stalls that a warning names.
const NAMED_STALLS: usize = 5;

/// Warnings about an outcome, whose machine stalled at some times, s.
pub(super) fn warnings_of(ended: &SessionOutcome, stalled_at_s: &[f64]) -> Vec<String> {
    let Meters { overruns, stalls, lost_wakes, .. } = ended.meters;
    let mut list = Vec::new();
    if ended.panicked {
        list.push("a node panicked; the actuators were ramped to zero and the run ended".to_owned());
    }
    for device in &ended.lost_devices {
        list.push(format!(
            "`{device}` panicked during its ramp to zero and keeps its last value: switch it off"
        ));
    }
    if overruns > 0 {
        list.push(format!("{overruns} ticks took longer than their period"));
    }
    if stalls > 0 {
        let at = stalled_at_s.iter().take(NAMED_STALLS).map(|at_s| format!("{at_s:.3} s"));
        let at: Vec<String> = at.collect();
        let more = if stalled_at_s.len() > at.len() { " and later" } else { "" };
        list.push(format!(
            "the machine stalled {stalls} times and lost {lost_wakes} wake-ups; the run continued from there, and recorded \
             signals jump at {}{more}",
            at.join(", ")
        ));
    }
    if ended.lost_numbers > 0 {
        list.push(format!(
            "{} values were lost on the way to the files, which have gaps",
            ended.lost_numbers
        ));
    }
    if ended.lost_arrivals > 0 {
        list.push(format!(
            "a replay will end {} callbacks early: the disk was too slow for its record",
            ended.lost_arrivals
        ));
    }
    list.extend(ended.failed.iter().map(ToString::to_string));
    list
}
