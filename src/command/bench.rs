//! `haptograph bench`: what a graph costs on this machine, node by node.

mod account;

use super::run::progress_bar;
use super::{Failure, GraphArguments, folder_of, say, write_file};
use account::Account;
use haptograph::engine::plan::{Plan, PlanOptions};
use haptograph::engine::run::{Profile, Run};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Measure what each node of a graph costs on this machine
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    graph: GraphArguments,
    /// How long to measure
    #[arg(long = "for", value_name = "SECONDS", default_value_t = 2.0, value_parser = seconds)]
    seconds: f64,
    /// Driver frames computed at a time
    #[arg(long, value_name = "FRAMES", default_value_t = 64, value_parser = clap::value_parser!(u16).range(1..=1024))]
    block: u16,
    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
    /// Also draw them
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.01..=3600.0).contains(&value) => Ok(value),
        _ => Err("give a number of seconds from 0.01 to 3600".to_owned()),
    }
}

/// Turns that the measured and the plain run take, so that what disturbs the machine disturbs both.
const TURNS: usize = 40;

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    arguments.graph.refuse_repeated()?;
    let graph = arguments.graph.load_and_warn(None)?;
    if let Some(path) = &arguments.svg {
        folder_of(path)?;
        arguments.graph.spare_inputs(&graph, path)?;
    }
    let drivers = graph.drivers();
    if let [_, _, ..] = drivers[..] {
        let names = drivers.iter().map(|driver| graph.clocks()[*driver].name.as_str());
        return Err(Failure::Message(format!(
            "bench measures graphs with one driver, and this one has {}",
            names.collect::<Vec<_>>().join(" and ")
        )));
    }
    let options = PlanOptions {
        block: arguments.block.into(),
        taps: Vec::new(),
    };
    let plan = Arc::new(Plan::new(&graph, &options));
    let mut profile = Profile::new(&plan);
    let mut plain = Run::new(Arc::clone(&plan));
    let progress = progress_bar(arguments.seconds);
    let turn = Duration::from_secs_f64(arguments.seconds / (2 * TURNS) as f64);
    // One turn of the measured run sets how many blocks all turns have.
    let mut blocks = 0_u64;
    let (mut measured_s, mut plain_s) = (Vec::new(), Vec::new());
    for number in 0..TURNS {
        let begun = Instant::now();
        if number == 0 {
            while begun.elapsed() < turn || blocks == 0 {
                profile.advance(plan.block());
                blocks += 1;
            }
        } else {
            (0..blocks).for_each(|_| profile.advance(plan.block()));
        }
        measured_s.push(begun.elapsed().as_secs_f64() / blocks as f64);
        let begun = Instant::now();
        (0..blocks).for_each(|_| plain.advance(plan.block()));
        plain_s.push(begun.elapsed().as_secs_f64() / blocks as f64);
        progress.set_position((1000.0 * arguments.seconds * (number + 1) as f64 / TURNS as f64) as u64);
    }
    progress.finish_and_clear();
    let account = Account::new(&graph, &plan, &profile, &measured_s, &plain_s);
    if let Some(path) = &arguments.svg {
        write_file(path, &account.to_svg(&arguments.graph.name()))?;
    }
    say(&if arguments.json {
        account.to_json()?
    } else {
        account.to_text()
    })
}
