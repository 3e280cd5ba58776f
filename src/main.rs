//! The `haptograph` command: arguments in, one library call, a result or one clear message out.

mod command;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use command::{
    bench, check, compare, devices, doctor, draw, evaluate, identify, learn, new, nodes, recover, run,
    segment, simulate_recording, surface, sweep,
};
use std::process::ExitCode;

/// Runs graphs that render the feel of real surfaces.
#[derive(Debug, Parser)]
#[command(version, about, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(run::Arguments),
    Check(check::Arguments),
    Recover(recover::Arguments),
    Sweep(sweep::Arguments),
    Bench(bench::Arguments),
    Identify(identify::Arguments),
    Draw(draw::Arguments),
    Nodes(nodes::Arguments),
    New(new::Arguments),
    SimulateRecording(simulate_recording::Arguments),
    Devices(devices::Arguments),
    Doctor(doctor::Arguments),
    Learn(learn::Arguments),
    Segment(segment::Arguments),
    Surface(surface::Arguments),
    Compare(compare::Arguments),
    Evaluate(evaluate::Arguments),
}

fn main() -> ExitCode {
    command::fault::listen();
    // Usage errors, `--help` and `--version` are clap's: it writes them and exits with 2 or 0.
    let matches = with_negative_numbers(Arguments::command()).get_matches();
    let arguments = Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let result = match arguments.command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Recover(arguments) => recover::run(&arguments),
        Command::Sweep(arguments) => sweep::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
        Command::Identify(arguments) => identify::run(&arguments),
        Command::Draw(arguments) => draw::run(&arguments),
        Command::Nodes(arguments) => nodes::run(&arguments),
        Command::New(arguments) => new::run(&arguments),
        Command::SimulateRecording(arguments) => simulate_recording::run(&arguments),
        Command::Devices(arguments) => devices::run(&arguments),
        Command::Doctor(arguments) => doctor::run(&arguments),
        Command::Learn(arguments) => learn::run(&arguments),
        Command::Segment(arguments) => segment::run(&arguments),
        Command::Surface(arguments) => surface::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

/// `--seconds -5` is a number that is out of range, not a flag called `-5`.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    command
        .allow_negative_numbers(true)
        .mut_subcommands(with_negative_numbers)
}
