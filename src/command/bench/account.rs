//! The figures of a measured graph, and the forms in which they are shown.

use crate::command::Failure;
use haptograph::engine::graph::Graph;
use haptograph::engine::plan::Plan;
use haptograph::engine::run::Profile;
use haptograph::report::plot::{Axis, Mark, Plot, Style};
use haptograph::report::theme::Ink;
use haptograph::signal::statistics::median;
use petgraph::graph::NodeIndex;
use petgraph::visit::EdgeRef;
use serde_json::json;
use std::collections::HashMap;
use std::fmt::Write;

/// What a graph costs.
#[derive(Debug)]
pub struct Account {
    block: usize,
    driver: String,
    driver_rate_hz: f64,
    /// Seconds of work a second of the graph's time: the part of one core that it needs.
    load: f64,
    /// How much more the measured run took, as a part.
    price: f64,
    timed_blocks: u64,
    every: u64,
    rows: Vec<Row>,
    clocks: Vec<ClockLoad>,
    /// Nodes that wait for one another and cost most, and their part of one core.
    critical: (Vec<String>, f64),
    buffer_bytes: usize,
    peak_bytes: Option<u64>,
    simulated: bool,
}

/// A step of the plan.
#[derive(Debug)]
struct Row {
    label: String,
    clock: String,
    median_ns: f64,
    p99_ns: f64,
    worst_ns: f64,
    samples: usize,
    /// Part of one core.
    load: f64,
}

#[derive(Debug)]
struct ClockLoad {
    name: String,
    rate: String,
    period_ns: f64,
    load: f64,
}

impl Account {
    pub fn new(graph: &Graph, plan: &Plan, profile: &Profile, measured_s: &[f64], plain_s: &[f64]) -> Self {
        let ratios: Vec<f64> = measured_s.iter().zip(plain_s).map(|(m, p)| m / p).collect();
        let costs = profile.costs();
        let rate_hz = |clock: usize| graph.clocks()[clock].rate.hz();
        let load = |cost: &haptograph::engine::run::StepCost| cost.median_ns * 1e-9 * rate_hz(cost.clock);
        let mut node_load: HashMap<NodeIndex, f64> = HashMap::new();
        for cost in &costs {
            *node_load.entry(cost.node).or_default() += load(cost);
        }
        let mut order: Vec<NodeIndex> = Vec::new();
        for cost in &costs {
            if !order.contains(&cost.node) {
                order.push(cost.node);
            }
        }
        let clocks = graph.clocks().iter().enumerate().map(|(index, clock)| ClockLoad {
            name: clock.name.clone(),
            rate: clock.rate.to_string(),
            period_ns: clock.rate.period_s() * 1e9,
            load: costs.iter().filter(|cost| cost.clock == index).map(load).sum(),
        });
        let mut rows: Vec<Row> = costs
            .iter()
            .map(|cost| Row {
                label: cost.label.clone(),
                clock: graph.clocks()[cost.clock].name.clone(),
                median_ns: cost.median_ns,
                p99_ns: cost.p99_ns,
                worst_ns: cost.worst_ns,
                samples: cost.samples,
                load: load(cost),
            })
            .collect();
        rows.sort_by(|a, b| b.load.total_cmp(&a.load));
        let driver = plan.driver_rate();
        let block_s = plan.block() as f64 / driver.hz();
        Self {
            block: plan.block(),
            driver: graph
                .clocks()
                .iter()
                .find(|clock| clock.rate == driver)
                .map_or_else(String::new, |clock| clock.name.clone()),
            driver_rate_hz: driver.hz(),
            load: median(plain_s) / block_s,
            price: median(&ratios) - 1.0,
            timed_blocks: profile.timed_blocks(),
            every: profile.every(),
            rows,
            clocks: clocks.collect(),
            critical: critical_path(graph, &order, &node_load),
            buffer_bytes: plan.buffer_bytes(),
            peak_bytes: peak_bytes(),
            simulated: graph.devices().iter().any(|device| device.entry.spec.simulated),
        }
    }

    fn highest_rate_hz(&self) -> f64 {
        self.driver_rate_hz / self.load
    }

    fn timed_load(&self) -> f64 {
        self.rows.iter().map(|row| row.load).sum()
    }

    pub fn to_text(&self) -> String {
        let mut text = String::new();
        let wide = self
            .rows
            .iter()
            .map(|row| row.label.chars().count())
            .max()
            .unwrap_or(0)
            .max(4);
        let clock_wide = self
            .rows
            .iter()
            .map(|row| row.clock.chars().count())
            .max()
            .unwrap_or(0)
            .max(5);
        let all = self.timed_load();
        let simulated = if self.simulated { ", devices simulated" } else { "" };
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
        let (path, load) = &self.critical;
        let _ = writeln!(
            text,
            "\nwhole graph    {:.3} % of one core at its own rate, in blocks of {} frames of `{}`{simulated}\n\
             highest rate   {:.0} times real time: `{}` at {:.3} MHz would fill one core\n\
             critical path  {:.0} % of the cost: {}\n\
             memory         {} of signal buffers{}\n\
             measuring      cost {:.1} %: one block in {} timed step by step, {} in all; medians, and the system's \
             interruptions in `worst`",
            100.0 * self.load,
            self.block,
            self.driver,
            1.0 / self.load,
            self.driver,
            self.highest_rate_hz() * 1e-6,
            100.0 * load / all,
            path.join(" > "),
            bytes(self.buffer_bytes as u64),
            self.peak_bytes.map_or_else(String::new, |peak| format!(
                ", {} the whole process at its peak",
                bytes(peak)
            )),
            100.0 * self.price,
            self.every,
            self.timed_blocks,
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
                    "step": row.label, "clock": row.clock, "ns_per_tick": row.median_ns, "p99_ns": row.p99_ns,
                    "worst_ns": row.worst_ns, "samples": row.samples, "core_share": row.load, "share": row.load / all,
                })
            })
            .collect();
        let clocks: Vec<_> = self
            .clocks
            .iter()
            .map(|clock| {
                json!({
                    "clock": clock.name, "rate": clock.rate, "period_ns": clock.period_ns,
                    "load_percent": 100.0 * clock.load,
                })
            })
            .collect();
        let value = json!({
            "block": self.block,
            "driver": self.driver,
            "driver_rate_hz": self.driver_rate_hz,
            "simulated": self.simulated,
            "load_percent": 100.0 * self.load,
            "highest_rate_hz": self.highest_rate_hz(),
            "critical_path": {"nodes": self.critical.0, "share": self.critical.1 / all},
            "buffer_bytes": self.buffer_bytes,
            "process_peak_bytes": self.peak_bytes,
            "measuring": {"cost_percent": 100.0 * self.price, "one_block_in": self.every, "timed_blocks": self.timed_blocks},
            "clocks": clocks,
            "steps": steps,
        });
        serde_json::to_string_pretty(&value)
            .map(|text| text + "\n")
            .map_err(|error| Failure::Message(format!("cannot write JSON: {error}")))
    }

    /// The steps that cost most, as bars.
    pub fn to_svg(&self, name: &str) -> String {
        let shown = &self.rows[..self.rows.len().min(30)];
        let all = self.timed_load();
        let place = |number: usize| (shown.len() - number) as f64;
        let bar = |(number, row): (usize, &Row)| {
            let (right, y) = (100.0 * row.load / all, place(number));
            vec![
                (0.0, y - 0.35),
                (right, y - 0.35),
                (right, y + 0.35),
                (0.0, y + 0.35),
            ]
        };
        let bars = shown.iter().enumerate().map(bar).collect();
        let names = shown.iter().enumerate().map(|(number, row)| {
            let label = format!("{}, {:.1} ns", row.label, row.median_ns);
            (place(number), label)
        });
        let simulated = if self.simulated { "devices simulated, " } else { "" };
        Plot {
            title: format!("Cost of {name}, step by step"),
            note: format!(
                "{simulated}{:.3} % of one core at its own rate",
                100.0 * self.load
            ),
            x: Axis::of("Share of the cost (%)")
                .over(0.0, 105.0 * shown.first().map_or(1.0, |row| row.load / all)),
            y: Axis::default().over(0.4, shown.len() as f64 + 0.6).named(names),
            marks: vec![Mark::Areas(Style::of(Ink::Blue), bars)],
            size: (760.0, 80.0 + 20.0 * shown.len() as f64),
        }
        .to_standalone_svg()
    }
}

/// The most costly chain of nodes of which each waits for the one before, without what a delay cuts.
fn critical_path(graph: &Graph, order: &[NodeIndex], load: &HashMap<NodeIndex, f64>) -> (Vec<String>, f64) {
    let mut best: HashMap<NodeIndex, (f64, Option<NodeIndex>)> = HashMap::new();
    for node in order {
        let before = graph
            .nodes()
            .edges_directed(*node, petgraph::Incoming)
            .filter_map(|edge| {
                best.get(&edge.source())
                    .map(|(sum, _)| (*sum, Some(edge.source())))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((0.0, None));
        let own = load.get(node).copied().unwrap_or(0.0);
        best.insert(*node, (before.0 + own, before.1));
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

fn bytes(count: u64) -> String {
    match count {
        0..=9_999 => format!("{count} B"),
        10_000..=9_999_999 => format!("{:.1} KiB", count as f64 / 1024.0),
        _ => format!("{:.1} MiB", count as f64 / (1024.0 * 1024.0)),
    }
}

/// The most memory that this process has had, where the system tells.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
