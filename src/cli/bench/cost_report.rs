//! The measured cost of a graph, as text, JSON and SVG.

use crate::cli::result::CommandResult;
use crate::engine::graph::{Graph, NodeId};
use crate::engine::plan::Plan;
use crate::engine::run::{Profile, StepCost};
use crate::report::plot::{Axis, Mark, Plot, Style};
use crate::report::scale::plain;
use crate::report::theme::Ink;
use crate::signal::files;
use crate::signal::statistics::median;
use serde::Serialize;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Durations of the runs, one per turn, in seconds per round.
#[derive(Debug, Default)]
pub(super) struct Timings {
    pub measured_s: Vec<f64>,
    pub plain_s: Vec<f64>,
    /// Per driver; empty for a single driver.
    pub by_driver_s: Vec<Vec<f64>>,
}

/// The cost of a graph. A load is the processor time per second of the graph's time: the share of one core
/// that it needs.
#[derive(Debug, Serialize)]
pub(super) struct CostReport {
    buffer_bytes: usize,
    clocks: Vec<ClockLoad>,
    drivers: Vec<DriverLoad>,
    /// Of all drivers together on one core.
    load_percent: f64,
    measuring: Measuring,
    process_peak_bytes: Option<u64>,
    simulated: bool,
    /// By falling load.
    steps: Vec<Step>,
}

#[derive(Debug, Serialize)]
struct Measuring {
    /// Relative overhead of timing every step.
    cost_percent: f64,
    one_round_in: u64,
    timed_rounds: u64,
}

/// A step of a plan and its cost.
#[derive(Debug, Serialize)]
struct Step {
    clock: String,
    /// Load.
    core_share: f64,
    driver: String,
    /// Median.
    ns_per_tick: f64,
    p99_ns: f64,
    samples: usize,
    /// Part of the load of all steps.
    share: f64,
    step: String,
    worst_ns: f64,
}

#[derive(Debug, Serialize)]
struct ClockLoad {
    clock: String,
    driver: String,
    load_percent: f64,
    period_ns: f64,
    rate: String,
}

#[derive(Debug, Serialize)]
struct DriverLoad {
    /// Maximum block length, frames.
    block: usize,
    buffer_bytes: usize,
    critical_path: CriticalPath,
    driver: String,
    /// The rate at which the driver would fill one core.
    highest_rate_hz: f64,
    load_percent: f64,
    rate_hz: f64,
}

/// The chain of dependent nodes with the highest cost, and its part of the load of all timed steps.
#[derive(Debug, Serialize)]
struct CriticalPath {
    nodes: Vec<String>,
    share: f64,
}

impl CostReport {
    pub(super) fn new(graph: &Graph, plans: &[Arc<Plan>], profile: &Profile, turns: &Timings) -> Self {
        let pairs = turns.measured_s.iter().zip(&turns.plain_s);
        let ratios: Vec<f64> = pairs.map(|(measured, plain)| measured / plain).collect();
        let round_s = profile.clock().quantum_s();
        let load = median(&turns.plain_s) / round_s;
        let (mut steps, mut drivers) = (Vec::new(), Vec::new());
        for (driver, plan) in plans.iter().enumerate() {
            let own = steps_of(graph, plan.driver_name(), &profile.costs(driver));
            let (rate_hz, of_driver) = (plan.driver_rate().hz(), turns.by_driver_s.iter());
            let round_frames = (round_s * rate_hz).round().max(1.0) as usize;
            let load = match plans {
                [_] => load,
                _ => median(&of_driver.map(|turn| turn[driver]).collect::<Vec<_>>()) / round_s,
            };
            drivers.push(DriverLoad {
                block: plan.block().min(round_frames),
                buffer_bytes: plan.buffer_bytes(),
                critical_path: critical_path(graph, &own),
                driver: plan.driver_name().to_owned(),
                highest_rate_hz: rate_hz / load,
                load_percent: 100.0 * load,
                rate_hz,
            });
            steps.extend(own.into_iter().map(|(_, step)| step));
        }
        steps.sort_by(|a, b| b.core_share.total_cmp(&a.core_share));
        let all: f64 = steps.iter().map(|step| step.core_share).sum();
        steps.iter_mut().for_each(|step| step.share = step.core_share / all);
        let clocks = graph.clocks().iter().map(|clock| {
            let own = steps.iter().filter(|step| step.clock == clock.name);
            ClockLoad {
                clock: clock.name.clone(),
                driver: graph.clocks()[clock.driver].name.clone(),
                load_percent: 100.0 * own.map(|step| step.core_share).sum::<f64>(),
                period_ns: clock.rate.period_s() * 1e9,
                rate: clock.rate.to_string(),
            }
        });
        Self {
            buffer_bytes: drivers.iter().map(|driver| driver.buffer_bytes).sum(),
            clocks: clocks.collect(),
            drivers,
            load_percent: 100.0 * load,
            measuring: Measuring {
                cost_percent: 100.0 * (median(&ratios) - 1.0),
                one_round_in: profile.every(),
                timed_rounds: profile.timed_quanta(),
            },
            process_peak_bytes: peak_bytes(),
            simulated: graph.devices().iter().any(|device| device.entry.spec.simulated),
            steps,
        }
    }

    /// The steps with the highest cost as bars.
    pub(super) fn to_svg(&self, name: &str) -> String {
        let shown = &self.steps[..self.steps.len().min(30)];
        let place = |number: usize| (shown.len() - number) as f64;
        let bar = |(number, step): (usize, &Step)| {
            let (right, y) = (100.0 * step.share, place(number));
            vec![(0.0, y - 0.35), (right, y - 0.35), (right, y + 0.35), (0.0, y + 0.35)]
        };
        let bars = |(number, driver): (usize, &DriverLoad)| {
            let own = shown.iter().enumerate().filter(|(_, step)| step.driver == driver.driver);
            let name = match &self.drivers[..] {
                [_] => String::new(),
                _ => format!("{}, {:.3} %", driver.driver, driver.load_percent),
            };
            let ink = Ink::CYCLE[number % Ink::CYCLE.len()];
            Mark::Areas(Style::named(ink, name), own.map(bar).collect())
        };
        let names = shown.iter().enumerate().map(|(number, step)| {
            let label = format!("{}, {} a tick of {}", step.step, duration(step.ns_per_tick), step.clock);
            (place(number), label)
        });
        let of_shown: f64 = shown.iter().map(|step| step.share).sum();
        let steps = match self.steps.len() {
            all if all == shown.len() => format!("all {all} steps"),
            of => format!("{} of {of} steps, {:.0} % of the cost", shown.len(), 100.0 * of_shown),
        };
        let simulated = if self.simulated { "devices simulated, " } else { "" };
        Plot {
            title: format!("Cost of {name}, step by step"),
            note: format!("{steps}; {simulated}{:.3} % of one core at its own rate", self.load_percent),
            x: Axis::of("Share of the cost (%)")
                .over(0.0, 105.0 * shown.first().map_or(1.0, |step| step.share)),
            y: Axis::default().over(0.4, shown.len() as f64 + 0.6).named(names),
            marks: self.drivers.iter().enumerate().map(bars).collect(),
            size: (900.0, 80.0 + 20.0 * shown.len() as f64),
            ..Plot::default()
        }
        .to_standalone_svg()
    }

    /// A line for each step, with a bar.
    fn table(&self) -> String {
        let width =
            |name: fn(&Step) -> &String| self.steps.iter().map(|step| name(step).chars().count()).max();
        let wide = width(|step| &step.step).unwrap_or(0).max(4);
        let clock_wide = width(|step| &step.clock).unwrap_or(0).max(5);
        let mut text =
            format!("{:wide$}  {:clock_wide$}  ns a tick        p99      worst   share\n", "step", "clock");
        for Step { step, clock, ns_per_tick, p99_ns, worst_ns, share, .. } in &self.steps {
            let (percent, bar) = (100.0 * share, "#".repeat((30.0 * share).round() as usize));
            text += &format!(
                "{step:wide$}  {clock:clock_wide$}  {ns_per_tick:9.1}  {p99_ns:9.1}  {worst_ns:9.0}  {percent:5.1} %  {bar}\n"
            );
        }
        text += "\n";
        for ClockLoad { clock, rate, load_percent, .. } in &self.clocks {
            text += &format!("clock {clock:clock_wide$}  {rate:>10}  {load_percent:8.4} % of its period\n");
        }
        text
    }
}

impl CommandResult for CostReport {
    const INDENTED: bool = true;

    fn text(&self) -> String {
        let simulated = if self.simulated { ", devices simulated" } else { "" };
        let (load, mut text) = (self.load_percent, self.table() + "\n");
        match &self.drivers[..] {
            [alone @ DriverLoad { block, driver, .. }] => {
                text += &format!(
                    "whole graph    {load:.3} % of one core at its own rate, in blocks of {block} frames of `{driver}`{simulated}\n{}",
                    alone.to_text()
                );
            }
            several => {
                for one @ DriverLoad { block, driver, load_percent, .. } in several {
                    let (buffers, text_of) = (bytes(one.buffer_bytes as u64), one.to_text());
                    text += &format!(
                        "driver {driver:7} {load_percent:.3} % of one core at its own rate, in blocks of at most {block}; {buffers} of signal buffers\n{text_of}"
                    );
                }
                text += &format!(
                    "\nwhole graph    {load:.3} % of one core, if all drivers shared it{simulated}\n"
                );
            }
        }
        let Measuring { cost_percent, one_round_in, timed_rounds } = &self.measuring;
        let peak = self.process_peak_bytes;
        let peak =
            peak.map_or_else(String::new, |peak| format!(", {} the whole process at its peak", bytes(peak)));
        text + &format!(
            "memory         {} of signal buffers{peak}\n\
             measuring      overhead {cost_percent:.1} %: one round in {one_round_in} timed step by step, {timed_rounds} in all; \
             medians; `worst` includes interruptions by the system\n",
            bytes(self.buffer_bytes as u64),
        )
    }
}

impl DriverLoad {
    /// The highest rate of the driver and its critical path.
    fn to_text(&self) -> String {
        let Self { critical_path: CriticalPath { nodes, share }, driver, .. } = self;
        let (times, mhz) = (100.0 / self.load_percent, self.highest_rate_hz * 1e-6);
        let (percent, nodes) = (100.0 * share, nodes.join(" > "));
        format!(
            "highest rate   {times:.0} times real time: `{driver}` at {mhz:.3} MHz would fill one core\n\
             critical path  {percent:.0} % of the cost: {nodes}\n"
        )
    }
}

/// The steps of a driver with their nodes, in execution order.
fn steps_of(graph: &Graph, driver: &str, costs: &[StepCost]) -> Vec<(NodeId, Step)> {
    let step = |cost: &StepCost| Step {
        clock: graph.clocks()[cost.clock].name.clone(),
        core_share: cost.median_ns * 1e-9 * graph.clocks()[cost.clock].rate.hz(),
        driver: driver.to_owned(),
        ns_per_tick: cost.median_ns,
        p99_ns: cost.p99_ns,
        samples: cost.samples,
        share: 0.0,
        step: cost.label.clone(),
        worst_ns: cost.worst_ns,
    };
    costs.iter().map(|cost| (cost.node, step(cost))).collect()
}

/// The chain of dependent nodes of a driver with the highest total cost; edges cut by a delay do not count.
fn critical_path(graph: &Graph, steps: &[(NodeId, Step)]) -> CriticalPath {
    let mut order: Vec<NodeId> = Vec::new();
    let mut loads: HashMap<NodeId, f64> = HashMap::new();
    for (node, step) in steps {
        if !order.contains(node) {
            order.push(*node);
        }
        *loads.entry(*node).or_default() += step.core_share;
    }
    let mut best: HashMap<NodeId, (f64, Option<NodeId>)> = HashMap::new();
    for node in order {
        // Nodes of other drivers are absent from `steps`: this driver does not wait for them.
        let before = graph
            .nodes()
            .incoming(node)
            .into_iter()
            .filter_map(|read| best.get(&read.from).map(|(sum, _)| (*sum, Some(read.from))))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((0.0, None));
        best.insert(node, (before.0 + loads[&node], before.1));
    }
    let last = best.iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
    let (mut at, sum) = last.map_or((None, 0.0), |(node, (sum, _))| (Some(*node), *sum));
    let mut nodes = Vec::new();
    while let Some(node) = at {
        nodes.push(graph.nodes()[node].path.clone());
        at = best.get(&node).and_then(|(_, before)| *before);
    }
    nodes.reverse();
    let all: f64 = steps.iter().map(|(_, step)| step.core_share).sum();
    CriticalPath { nodes, share: sum / all }
}

/// A duration with its unit and three digits: `1.7 µs`.
fn duration(ns: f64) -> String {
    let (value, unit) = match ns {
        ..1e3 => (ns, "ns"),
        ..1e6 => (ns * 1e-3, "µs"),
        _ => (ns * 1e-6, "ms"),
    };
    format!("{} {unit}", plain(value))
}

/// A number of bytes with its unit and two digits at least: `1.2 MiB`.
pub(crate) fn bytes(count: u64) -> String {
    match count {
        0..=9_999 => format!("{count} B"),
        10_000..=9_999_999 => format!("{:.1} KiB", count as f64 / 1024.0),
        _ => format!("{:.1} MiB", count as f64 / (1024.0 * 1024.0)),
    }
}

/// Peak memory of this process, if the system reports it.
fn peak_bytes() -> Option<u64> {
    let status = files::read_text(Path::new("/proc/self/status"), files::MAX_NOTE_BYTES).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_three_digits_and_their_unit() {
        let shown = [12.34, 1_712.0, 2_500_000.0].map(duration);
        assert_eq!(shown, ["12.3 ns", "1.71 µs", "2.5 ms"]);
    }
}
