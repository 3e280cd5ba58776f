//! `haptograph run`: a graph runs as fast as the processor allows and leaves a folder: the files of its sinks, a
//! page to look at, and `run.json`.

mod folder;
mod outputs;
mod summary;

use super::{Failure, GraphArguments, remark, say};
use folder::RunFolder;
use haptograph::engine::graph::Graph;
use haptograph::engine::run::{Offline, Probe};
use haptograph::report::record::{Record, recorder, watched};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use summary::Summary;

/// Run a graph and write what its sinks receive, with a page to look at
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    pub graph: GraphArguments,
    /// How long the graph runs, in its own time
    #[arg(long = "for", value_name = "SECONDS", default_value_t = 10.0, value_parser = seconds)]
    pub duration_s: f64,
    /// The seed of all random streams, in place of the graph's own
    #[arg(long)]
    pub seed: Option<u64>,
    /// The folder to write; `out/GRAPH` where it is not given
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Driver frames computed at a time; the samples do not depend on it
    #[arg(long, value_name = "FRAMES", default_value_t = 64, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub block: u16,
    /// Threads to use; the samples do not depend on it
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub threads: u16,
    /// Also write the signal of an output, as .wav or .csv; can be repeated
    #[arg(long, value_name = "NODE.PORT=FILE", value_parser = outputs::probe_argument)]
    pub probe: Vec<outputs::ProbeArgument>,
    /// Also write every signal, into the folder `record`
    #[arg(long)]
    pub record: bool,
    /// Print the facts of the run as JSON
    #[arg(long)]
    pub json: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 1e7 => Ok(value),
        _ => Err("give a number of seconds above 0, at most 10000000".to_owned()),
    }
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let graph = arguments.graph.load_and_warn(arguments.seed)?;
    let target = arguments
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from("out").join(arguments.graph.name()));
    let folder = RunFolder::beside(&target)?;
    let mut offline =
        Offline::new(&graph, usize::from(arguments.block)).threads(usize::from(arguments.threads));
    offline.open_files(folder.path()).map_err(message)?;
    let probes = outputs::open_probes(&graph, &arguments.probe, &folder, &mut offline)?;
    if arguments.record {
        outputs::record_all(&graph, &folder, &mut offline)?;
    }
    let records = watch(&graph, &mut offline);
    let stop = stop_on_interrupt()?;
    let bar = progress_bar(arguments.duration_s);
    let start = Instant::now();
    let outcome = offline
        .run(arguments.duration_s, &stop, &mut |done_s| {
            bar.set_position((done_s * 1e3) as u64)
        })
        .map_err(message)?;
    let took_s = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let summary = Summary::of(arguments, &graph, &outcome, took_s);
    folder.write("run.json", &summary.to_json())?;
    folder.write("report.html", &summary.page(&graph, &records))?;
    folder.write(
        "graph.svg",
        &haptograph::report::drawing::standalone_svg(&graph, &arguments.graph.name()),
    )?;
    outputs::place_probes(&folder, &probes)?;
    folder.put_in_place(&target)?;
    summary
        .warnings()
        .iter()
        .for_each(|warning| remark(&format!("warning: {warning}\n")));
    if arguments.json {
        say(&summary.to_json())
    } else {
        say(&summary.sentence(&target))
    }
}

fn message(error: impl std::fmt::Display) -> Failure {
    Failure::Message(error.to_string())
}

/// Records what the page will show.
fn watch(graph: &Graph, offline: &mut Offline<'_>) -> Vec<Record> {
    let watches = watched(graph).into_iter();
    watches
        .map(|watch| {
            let (writer, record) = recorder(watch.stream);
            offline.probe(Probe {
                node: watch.node,
                output: watch.output,
                writer: Box::new(writer),
            });
            record
        })
        .collect()
}

/// The first ctrl-C ends the run with complete files, the second ends the program.
pub fn stop_on_interrupt() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .map_err(|error| Failure::Message(format!("cannot listen for ctrl-C: {error}")))?;
    Ok(stop)
}

/// Shown on terminals only.
pub fn progress_bar(duration_s: f64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(
        Some((duration_s * 1e3) as u64),
        ProgressDrawTarget::stderr_with_hz(10),
    );
    let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {eta} left");
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
