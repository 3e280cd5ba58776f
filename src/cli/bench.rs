//! `haptograph bench`: the cost of a graph on this machine, node by node.

mod cost_report;

use super::import::number;
use super::placing::{Force, Output};
use super::progress::Progress;
use super::result::show;
use super::{Failure, GraphArguments};
use crate::engine::plan::{Plan, PlanOptions};
use crate::engine::registry::Registry;
use crate::engine::run::{Profile, VirtualClock};
pub(super) use cost_report::bytes;
use cost_report::{CostReport, Timings};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Measure the cost of each node of a graph on this machine
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    graph: GraphArguments,
    /// Duration of the measurement
    #[arg(long = "for", value_name = "SECONDS", default_value_t = 2.0, value_parser = seconds)]
    seconds: f64,
    /// Driver frames to compute at a time
    #[arg(long, value_name = "FRAMES", default_value_t = 64, value_parser = clap::value_parser!(u16).range(1..=1024))]
    block: u16,
    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
    /// Also draw the figures
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

fn seconds(text: &str) -> Result<f64, String> {
    number(text, 0.01..=3600.0, "give a number of seconds from 0.01 to 3600")
}

/// Number of turns that the measuring time is divided into. The kinds of runs alternate, so that a
/// disturbance of the machine affects all of them; with many short turns most are undisturbed, and medians
/// discard the rest.
const TURNS: u32 = 200;

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    arguments.graph.refuse_repeated()?;
    let graph = arguments.graph.load_and_warn(registry, None)?;
    let claim = |path: &PathBuf| {
        arguments.graph.refuse_inputs(&graph, path)?;
        Output::claim(path, arguments.force)
    };
    let svg = arguments.svg.as_ref().map(claim).transpose()?;
    let options = PlanOptions::default().block(arguments.block.into());
    let plans: Vec<Arc<Plan>> = Plan::of(&graph, &options).into_iter().map(Arc::new).collect();
    let mut profile = Profile::new(&plans);
    let turns = measure(&plans, &mut profile, arguments.seconds);
    let report = CostReport::new(&graph, &plans, &profile, &turns);
    if let Some(svg) = &svg {
        svg.write(report.to_svg(&arguments.graph.name()))?;
    }
    show(&report, arguments.json)
}

/// Alternates three kinds of runs: plain, with every step timed, and, with several drivers, timed driver by
/// driver.
fn measure(plans: &[Arc<Plan>], profile: &mut Profile, seconds: f64) -> Timings {
    let mut plain = VirtualClock::of(plans);
    let mut plain_round = || plain.run_quantum(|_, _| {});
    let progress = Progress::of("measuring");
    let kinds = if plans.len() > 1 { 3 } else { 2 };
    let turn = Duration::from_secs_f64(seconds / f64::from(kinds * TURNS));
    // The first turn of the timed run sets the number of rounds of all turns.
    let mut rounds = 0_u32;
    let begun = Instant::now();
    while begun.elapsed() < turn || rounds == 0 {
        profile.run_quantum();
        rounds += 1;
    }
    let mut turns = Timings::default();
    for number in 0.. {
        let done_s = begun.elapsed().as_secs_f64();
        progress.at(done_s / seconds);
        // By then each kind of run has had one turn.
        if number > 0 && done_s >= seconds {
            break;
        }
        // The order of the kinds alternates too.
        if number % 2 == 0 {
            turns.measured_s.push(a_round_of(rounds, || profile.run_quantum()));
        }
        turns.plain_s.push(a_round_of(rounds, &mut plain_round));
        if number % 2 == 1 {
            turns.measured_s.push(a_round_of(rounds, || profile.run_quantum()));
        }
        if plans.len() > 1 {
            let mut took_ns = vec![0.0; plans.len()];
            (0..rounds).for_each(|_| profile.run_quantum_by_driver(&mut took_ns));
            let took_s = took_ns.iter().map(|ns| ns * 1e-9 / f64::from(rounds));
            turns.by_driver_s.push(took_s.collect());
        }
    }
    turns
}

/// Duration of one of `rounds` rounds, s.
fn a_round_of(rounds: u32, mut round: impl FnMut()) -> f64 {
    let begun = Instant::now();
    (0..rounds).for_each(|_| round());
    begun.elapsed().as_secs_f64() / f64::from(rounds)
}
