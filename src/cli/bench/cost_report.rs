//! The measured cost of a graph, as text, JSON and SVG.

use crate::cli::Failure;
use crate::engine::graph::{Graph, NodeId};
use crate::engine::plan::Plan;
use crate::engine::run::{Profile, StepCost};
use crate::report::plot::{Axis, Mark, Plot, Style};
use crate::report::scale::plain;
use crate::report::theme::Ink;
use crate::signal::files;
use crate::signal::statistics::median;
use serde_json::json;
use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

/// Durations of the runs, one per turn, in seconds per round.
#[derive(Debug, Default)]
pub struct Timings {
    pub measured_s: Vec<f64>,
    pub plain_s: Vec<f64>,
    /// Per driver; empty for a single driver.
    pub by_driver_s: Vec<Vec<f64>>,
}

/// The cost of a graph. A load is the processor time per second of the graph's time: the share of one core
/// that it needs.
#[derive(Debug)]
pub struct CostReport {
    /// Load of all drivers together on one core.
    load: f64,
    /// Relative overhead of timing every step.
    overhead: f64,
    timed_rounds: u64,
    every: u64,
    rows: Vec<Row>,
    clocks: Vec<ClockLoad>,
    drivers: Vec<DriverLoad>,
    peak_bytes: Option<u64>,
    simulated: bool,
}

/// A step of a plan and its cost.
#[derive(Debug)]
struct Row {
    label: String,
    driver: usize,
    clock: String,
    median_ns: f64,
    p99_ns: f64,
    worst_ns: f64,
    samples: usize,
    load: f64,
}

#[derive(Debug)]
struct ClockLoad {
    name: String,
    driver: String,
    rate: String,
    period_ns: f64,
    load: f64,
}

#[derive(Debug)]
struct DriverLoad {
    name: String,
    rate_hz: f64,
    /// Maximum block length, frames.
    block: usize,
    load: f64,
    /// The same load, summed over the timed steps.
    timed_load: f64,
    /// The chain of dependent nodes with the highest cost, and its load.
    critical: (Vec<String>, f64),
    buffer_bytes: usize,
}

impl CostReport {
    pub fn new(graph: &Graph, plans: &[Arc<Plan>], profile: &Profile, turns: &Timings) -> Self {
        let pairs = turns.measured_s.iter().zip(&turns.plain_s);
        let ratios: Vec<f64> = pairs.map(|(measured, plain)| measured / plain).collect();
        let round_s = profile.runner().quantum_s();
        let load = median(&turns.plain_s) / round_s;
        let (mut rows, mut drivers) = (Vec::new(), Vec::new());
        for (driver, plan) in plans.iter().enumerate() {
            let own = rows_of(graph, driver, &profile.costs(driver));
            let round_frames = (round_s * plan.driver_rate().hz()).round().max(1.0) as usize;
            let of_driver: Vec<f64> = turns.by_driver_s.iter().map(|turn| turn[driver]).collect();
            drivers.push(DriverLoad {
                name: plan.driver_name().to_owned(),
                rate_hz: plan.driver_rate().hz(),
                block: plan.block().min(round_frames),
                load: match plans {
                    [_] => load,
                    _ => median(&of_driver) / round_s,
                },
                timed_load: own.iter().map(|(_, row)| row.load).sum(),
                critical: critical_path(graph, &own),
                buffer_bytes: plan.buffer_bytes(),
            });
            rows.extend(own.into_iter().map(|(_, row)| row));
        }
        rows.sort_by(|a, b| b.load.total_cmp(&a.load));
        let clocks = graph.clocks().iter().map(|clock| ClockLoad {
            name: clock.name.clone(),
            driver: graph.clocks()[clock.driver].name.clone(),
            rate: clock.rate.to_string(),
            period_ns: clock.rate.period_s() * 1e9,
            load: rows.iter().filter(|row| row.clock == clock.name).map(|row| row.load).sum(),
        });
        Self {
            load,
            overhead: median(&ratios) - 1.0,
            timed_rounds: profile.timed_quanta(),
            every: profile.every(),
            clocks: clocks.collect(),
            rows,
            drivers,
            peak_bytes: peak_bytes(),
            simulated: graph.devices().iter().any(|device| device.entry.spec.simulated),
        }
    }

    fn timed_load(&self) -> f64 {
        self.rows.iter().map(|row| row.load).sum()
    }

    fn buffer_bytes(&self) -> usize {
        self.drivers.iter().map(|driver| driver.buffer_bytes).sum()
    }

    pub fn to_text(&self) -> String {
        let mut text = String::new();
        let wide = self.rows.iter().map(|row| row.label.chars().count()).max().unwrap_or(0).max(4);
        let clock_wide = self.rows.iter().map(|row| row.clock.chars().count()).max().unwrap_or(0).max(5);
        let all = self.timed_load();
        let _ = writeln!(
            text,
            "{:wide$}  {:clock_wide$}  ns a tick        p99      worst   share",
            "step", "clock"
        );
        for row in &self.rows {
            let share = row.load / all;
            let _ = writeln!(
                text,
                "{:wide$}  {:clock_wide$}  {:9.1}  {:9.1}  {:9.0}  {:5.1} %  {}",
                row.label,
                row.clock,
                row.median_ns,
                row.p99_ns,
                row.worst_ns,
                100.0 * share,
                "#".repeat((30.0 * share).round() as usize),
            );
        }
        let _ = writeln!(text);
        for clock in &self.clocks {
            let _ = writeln!(
                text,
                "clock {:clock_wide$}  {:>10}  {:8.4} % of its period",
                clock.name,
                clock.rate,
                100.0 * clock.load
            );
        }
        let simulated = if self.simulated { ", devices simulated" } else { "" };
        let _ = writeln!(text);
        match &self.drivers[..] {
            [alone] => {
                let _ = writeln!(
                    text,
                    "whole graph    {:.3} % of one core at its own rate, in blocks of {} frames of `{}`{simulated}",
                    100.0 * self.load,
                    alone.block,
                    alone.name,
                );
                text += &alone.to_text();
            }
            several => {
                for driver in several {
                    let _ = writeln!(
                        text,
                        "driver {:7} {:.3} % of one core at its own rate, in blocks of at most {}; {} of signal buffers",
                        driver.name,
                        100.0 * driver.load,
                        driver.block,
                        bytes(driver.buffer_bytes as u64),
                    );
                    text += &driver.to_text();
                }
                let _ = writeln!(
                    text,
                    "\nwhole graph    {:.3} % of one core, if all drivers shared it{simulated}",
                    100.0 * self.load,
                );
            }
        }
        let _ = writeln!(
            text,
            "memory         {} of signal buffers{}\n\
             measuring      overhead {:.1} %: one round in {} timed step by step, {} in all; medians; `worst` includes \
             interruptions by the system",
            bytes(self.buffer_bytes() as u64),
            self.peak_bytes
                .map_or_else(String::new, |peak| format!(", {} the whole process at its peak", bytes(peak))),
            100.0 * self.overhead,
            self.every,
            self.timed_rounds,
        );
        text
    }

    pub fn to_json(&self) -> Result<String, Failure> {
        let all = self.timed_load();
        let steps: Vec<_> = self
            .rows
            .iter()
            .map(|row| {
                json!({
                    "step": row.label, "driver": self.drivers[row.driver].name, "clock": row.clock,
                    "ns_per_tick": row.median_ns, "p99_ns": row.p99_ns, "worst_ns": row.worst_ns,
                    "samples": row.samples, "core_share": row.load, "share": row.load / all,
                })
            })
            .collect();
        let clocks: Vec<_> = self
            .clocks
            .iter()
            .map(|clock| {
                json!({
                    "clock": clock.name, "driver": clock.driver, "rate": clock.rate, "period_ns": clock.period_ns,
                    "load_percent": 100.0 * clock.load,
                })
            })
            .collect();
        let drivers: Vec<_> = self
            .drivers
            .iter()
            .map(|driver| {
                json!({
                    "driver": driver.name,
                    "rate_hz": driver.rate_hz,
                    "block": driver.block,
                    "load_percent": 100.0 * driver.load,
                    "highest_rate_hz": driver.rate_hz / driver.load,
                    "critical_path": {"nodes": driver.critical.0, "share": driver.critical.1 / driver.timed_load},
                    "buffer_bytes": driver.buffer_bytes,
                })
            })
            .collect();
        let value = json!({
            "simulated": self.simulated,
            "load_percent": 100.0 * self.load,
            "drivers": drivers,
            "buffer_bytes": self.buffer_bytes(),
            "process_peak_bytes": self.peak_bytes,
            "measuring": {"cost_percent": 100.0 * self.overhead, "one_round_in": self.every, "timed_rounds": self.timed_rounds},
            "clocks": clocks,
            "steps": steps,
        });
        serde_json::to_string_pretty(&value)
            .map(|text| text + "\n")
            .map_err(|error| Failure::Message(format!("cannot write JSON: {error}")))
    }

    /// The steps with the highest cost as bars.
    pub fn to_svg(&self, name: &str) -> String {
        let shown = &self.rows[..self.rows.len().min(30)];
        let all = self.timed_load();
        let place = |number: usize| (shown.len() - number) as f64;
        let bar = |(number, row): (usize, &Row)| {
            let (right, y) = (100.0 * row.load / all, place(number));
            vec![(0.0, y - 0.35), (right, y - 0.35), (right, y + 0.35), (0.0, y + 0.35)]
        };
        let bars = |(number, driver): (usize, &DriverLoad)| {
            let own = shown.iter().enumerate().filter(|(_, row)| row.driver == number);
            let name = match &self.drivers[..] {
                [_] => String::new(),
                _ => format!("{}, {:.3} %", driver.name, 100.0 * driver.load),
            };
            let ink = Ink::CYCLE[number % Ink::CYCLE.len()];
            Mark::Areas(Style::named(ink, name), own.map(bar).collect())
        };
        let names = shown.iter().enumerate().map(|(number, row)| {
            let label = format!("{}, {} a tick of {}", row.label, duration(row.median_ns), row.clock);
            (place(number), label)
        });
        let of_shown: f64 = shown.iter().map(|row| row.load).sum();
        let steps = match self.rows.len() {
            all if all == shown.len() => format!("all {all} steps"),
            of => format!("{} of {of} steps, {:.0} % of the cost", shown.len(), 100.0 * of_shown / all),
        };
        let simulated = if self.simulated { "devices simulated, " } else { "" };
        Plot {
            title: format!("Cost of {name}, step by step"),
            note: format!("{steps}; {simulated}{:.3} % of one core at its own rate", 100.0 * self.load),
            x: Axis::of("Share of the cost (%)")
                .over(0.0, 105.0 * shown.first().map_or(1.0, |row| row.load / all)),
            y: Axis::default().over(0.4, shown.len() as f64 + 0.6).named(names),
            marks: self.drivers.iter().enumerate().map(bars).collect(),
            size: (900.0, 80.0 + 20.0 * shown.len() as f64),
            ..Plot::default()
        }
        .to_standalone_svg()
    }
}

impl DriverLoad {
    /// The highest rate of the driver and its critical path.
    fn to_text(&self) -> String {
        let (path, load) = &self.critical;
        format!(
            "highest rate   {:.0} times real time: `{}` at {:.3} MHz would fill one core\n\
             critical path  {:.0} % of the cost: {}\n",
            1.0 / self.load,
            self.name,
            self.rate_hz / self.load * 1e-6,
            100.0 * load / self.timed_load,
            path.join(" > "),
        )
    }
}

/// The steps of a driver with their nodes, in execution order.
fn rows_of(graph: &Graph, driver: usize, costs: &[StepCost]) -> Vec<(NodeId, Row)> {
    let row = |cost: &StepCost| Row {
        label: cost.label.clone(),
        driver,
        clock: graph.clocks()[cost.clock].name.clone(),
        median_ns: cost.median_ns,
        p99_ns: cost.p99_ns,
        worst_ns: cost.worst_ns,
        samples: cost.samples,
        load: cost.median_ns * 1e-9 * graph.clocks()[cost.clock].rate.hz(),
    };
    costs.iter().map(|cost| (cost.node, row(cost))).collect()
}

/// The chain of dependent nodes of a driver with the highest total cost; edges cut by a delay do not count.
fn critical_path(graph: &Graph, rows: &[(NodeId, Row)]) -> (Vec<String>, f64) {
    let mut order: Vec<NodeId> = Vec::new();
    let mut loads: HashMap<NodeId, f64> = HashMap::new();
    for (node, row) in rows {
        if !order.contains(node) {
            order.push(*node);
        }
        *loads.entry(*node).or_default() += row.load;
    }
    let mut best: HashMap<NodeId, (f64, Option<NodeId>)> = HashMap::new();
    for node in order {
        // Nodes of other drivers are absent from `rows`: this driver does not wait for them.
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
    let mut path = Vec::new();
    while let Some(node) = at {
        path.push(graph.nodes()[node].path.clone());
        at = best.get(&node).and_then(|(_, before)| *before);
    }
    path.reverse();
    (path, sum)
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
pub fn bytes(count: u64) -> String {
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
