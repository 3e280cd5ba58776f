//! `haptograph run`: runs a graph as fast as the processor allows and leaves a folder.

use super::writers::probe_writer;
use super::{Failure, GraphArgs, load, say, tell};
use haptograph_engine::graph::Graph;
use haptograph_engine::node::Stream;
use haptograph_engine::run::{Offline, Outcome, Probe};
use indicatif::{ProgressBar, ProgressStyle};
use petgraph::graph::NodeIndex;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

#[derive(clap::Args)]
pub(crate) struct RunArgs {
    #[command(flatten)]
    graph: GraphArgs,
    /// How long, in seconds of the graph's own time
    #[arg(long = "for", value_name = "SECONDS", default_value_t = 10.0, value_parser = seconds)]
    seconds: f64,
    /// The folder to leave everything in; out/<graph> unless told otherwise
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Driver frames of a block, 1 to 1024; changes no sample
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u16).range(1..=1024))]
    block: u16,
    /// Threads to spread the graph over; changes no sample
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: u16,
    /// Also write a port's signal to a .csv or .wav file; may be repeated
    #[arg(long = "probe", value_name = "NODE.PORT=FILE")]
    probes: Vec<String>,
    /// Write every port's signal, a .csv a port, to the folder `record`
    #[arg(long)]
    record: bool,
    /// Facts of the run as JSON on standard output
    #[arg(long)]
    json: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "write a number of seconds".to_owned())?;
    if (0.0..=1e6).contains(&seconds) {
        Ok(seconds)
    } else {
        Err("from 0 to 1000000 seconds".into())
    }
}

pub(crate) fn run(args: &RunArgs) -> Result<(), Failure> {
    let graph = load(&args.graph)?;
    let folder = args
        .out
        .clone()
        .unwrap_or_else(|| default_folder(&args.graph.graph));
    let draft = Draft::new(&folder)?;
    let mut offline = Offline::new(&graph, usize::from(args.block)).threads(usize::from(args.threads));
    offline.open_files(draft.path())?;
    let mut files = Vec::new();
    for probe in &args.probes {
        files.push(add_probe(&graph, probe, &mut offline)?);
    }
    if args.record {
        record(&graph, &draft.path().join("record"), &mut offline)?;
    }
    let stop = stop_on_interrupt();
    let began = Instant::now();
    let bar = progress_bar(args.seconds);
    let outcome = offline.run(args.seconds, &stop, &mut |done| {
        bar.set_position((done * 1e3) as u64)
    })?;
    bar.finish_and_clear();
    let wall_s = began.elapsed().as_secs_f64();
    for file in files {
        file.complete()?;
    }
    let facts = facts(args, &graph, &outcome, wall_s);
    let text = serde_json::to_string_pretty(&facts).unwrap_or_default() + "\n";
    std::fs::write(draft.path().join("facts.json"), &text)
        .map_err(|error| Failure::new(format!("cannot write facts.json: {error}")))?;
    draft.complete()?;
    if args.json {
        return say(&text);
    }
    say(&summary(&graph, &outcome, wall_s, &folder))
}

fn default_folder(graph: &Path) -> PathBuf {
    let name = graph
        .file_stem()
        .map_or_else(|| "graph".into(), |stem| stem.to_string_lossy().into_owned());
    Path::new("out").join(name)
}

/// A folder that is put in its place when it is complete, and removed when it is not.
struct Draft {
    working: PathBuf,
    wanted: PathBuf,
    complete: bool,
}

const MARK: &str = "facts.json";

impl Draft {
    fn new(wanted: &Path) -> Result<Self, Failure> {
        let shown = wanted.display();
        // Only a folder that a run left is ever replaced.
        if wanted.exists() && !wanted.join(MARK).is_file() && !is_empty(wanted) {
            return Err(Failure::new(format!(
                "{shown} holds something that no run left there; choose another --out or remove it"
            )));
        }
        let name = wanted
            .file_name()
            .ok_or_else(|| Failure::new(format!("{shown} is no folder to write to")))?;
        let working =
            wanted.with_file_name(format!(".{}.{}.part", name.to_string_lossy(), std::process::id()));
        std::fs::create_dir_all(&working).map_err(|error| {
            Failure::new(format!("cannot make the folder {}: {error}", working.display()))
        })?;
        Ok(Self {
            working,
            wanted: wanted.to_owned(),
            complete: false,
        })
    }

    fn path(&self) -> &Path {
        &self.working
    }

    fn complete(mut self) -> Result<(), Failure> {
        let failed = |error: std::io::Error| {
            Failure::new(format!(
                "cannot put the results in {}: {error}",
                self.wanted.display()
            ))
        };
        if self.wanted.exists() {
            std::fs::remove_dir_all(&self.wanted).map_err(failed)?;
        }
        std::fs::rename(&self.working, &self.wanted).map_err(failed)?;
        self.complete = true;
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if !self.complete {
            let _ = std::fs::remove_dir_all(&self.working);
        }
    }
}

fn is_empty(folder: &Path) -> bool {
    std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none())
}

/// A file that gets its name when it is complete.
struct ProbeFile {
    working: PathBuf,
    wanted: PathBuf,
}

impl ProbeFile {
    fn complete(self) -> Result<(), Failure> {
        let renamed = std::fs::rename(&self.working, &self.wanted);
        renamed.map_err(|error| Failure::new(format!("cannot write {}: {error}", self.wanted.display())))
    }
}

fn add_probe(graph: &Graph, text: &str, offline: &mut Offline<'_>) -> Result<ProbeFile, Failure> {
    let (port, file) = text
        .split_once('=')
        .ok_or_else(|| Failure::new(format!("--probe {text}: write NODE.PORT=FILE")))?;
    let (node, output) = find_port(graph, port)?;
    let wanted = PathBuf::from(file);
    let name = wanted.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = name.ok_or_else(|| Failure::new(format!("--probe {text}: {file} is no file to write to")))?;
    let working = wanted.with_file_name(format!(".{}.part.{name}", std::process::id()));
    let writer = probe_writer(&working, &stream(graph, node, output))?;
    offline.probe(Probe { node, output, writer });
    Ok(ProbeFile { working, wanted })
}

fn find_port(graph: &Graph, port: &str) -> Result<(NodeIndex, usize), Failure> {
    let nodes = graph.nodes();
    let ports = nodes.node_indices().flat_map(|node| {
        nodes[node]
            .outputs
            .iter()
            .enumerate()
            .map(move |(at, output)| (format!("{}.{}", nodes[node].path, output.name), (node, at)))
    });
    let ports: Vec<(String, (NodeIndex, usize))> = ports.collect();
    if let Some((_, found)) = ports.iter().find(|(name, _)| name == port) {
        return Ok(*found);
    }
    let near = haptograph_engine::settings::closest(port, ports.iter().map(|(name, _)| name.as_str()));
    Err(Failure::new(match near {
        Some(near) => format!("--probe: the graph has no port `{port}`; did you mean `{near}`?"),
        None => format!("--probe: the graph has no port `{port}`; its ports are {}", {
            ports
                .iter()
                .map(|(name, _)| name.as_str())
                .collect::<Vec<_>>()
                .join(", ")
        }),
    }))
}

fn stream(graph: &Graph, node: NodeIndex, output: usize) -> Stream {
    let at = &graph.nodes()[node];
    let port = &at.outputs[output];
    Stream {
        name: format!("{}.{}", at.path, port.name),
        kind: port.kind,
        quantity: port.quantity,
        rate: graph.clocks()[at.clock.unwrap_or(0)].rate,
        simulated: at.simulated,
    }
}

fn record(graph: &Graph, folder: &Path, offline: &mut Offline<'_>) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::new(format!("cannot make the folder {}: {error}", folder.display())))?;
    for node in graph.nodes().node_indices() {
        for output in 0..graph.nodes()[node].outputs.len() {
            let stream = stream(graph, node, output);
            let file = folder.join(format!("{}.csv", stream.name.replace('/', "-")));
            offline.probe(Probe {
                node,
                output,
                writer: probe_writer(&file, &stream)?,
            });
        }
    }
    Ok(())
}

/// Set by ctrl-C; a second one ends the program at once.
fn stop_on_interrupt() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    let set = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
    if let Err(error) = set {
        tell(&format!("note: ctrl-C will not stop cleanly: {error}\n"));
    }
    stop
}

fn progress_bar(seconds: f64) -> ProgressBar {
    let bar = ProgressBar::new((seconds * 1e3) as u64);
    let style = ProgressStyle::with_template("{bar:40.cyan/blue} {percent:>3} %  {msg}{eta} left");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

fn facts(args: &RunArgs, graph: &Graph, outcome: &Outcome, wall_s: f64) -> serde_json::Value {
    let simulated = graph.devices().iter().any(|device| device.entry.spec.simulated);
    let clipped: Vec<serde_json::Value> = outcome
        .actuators
        .iter()
        .map(|actuator| {
            serde_json::json!({
                "sink": actuator.path, "ticks": actuator.clipped.ticks, "peak": actuator.clipped.peak,
                "continuous": actuator.clipped.continuous, "slew": actuator.clipped.slew,
                "not_a_number": actuator.clipped.fault,
            })
        })
        .collect();
    serde_json::json!({
        "haptograph": env!("CARGO_PKG_VERSION"),
        "graph": args.graph.graph.display().to_string(),
        "about": graph.about(),
        "simulated": simulated,
        "seed": graph.seed(),
        "set": args.graph.set.iter().map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>(),
        "clocks_hz": graph.clocks().iter().map(|c| (c.name.clone(), c.rate.hz().into()))
            .collect::<serde_json::Map<String, serde_json::Value>>(),
        "block_frames": args.block,
        "threads": args.threads,
        "seconds": outcome.seconds,
        "stopped_early": outcome.stopped,
        "wall_s": wall_s,
        "real_time_factor": outcome.seconds / wall_s,
        "faults": outcome.faults.ticks,
        "limited": clipped,
    })
}

fn summary(graph: &Graph, outcome: &Outcome, wall_s: f64, folder: &Path) -> String {
    let mut text = format!(
        "{:.3} s in {:.3} s ({:.0} times real time){}\n",
        outcome.seconds,
        wall_s,
        outcome.seconds / wall_s,
        if outcome.stopped { ", stopped early" } else { "" }
    );
    if graph.devices().iter().any(|device| device.entry.spec.simulated) {
        text += "simulated: no hardware was driven\n";
    }
    for actuator in &outcome.actuators {
        let c = actuator.clipped;
        if c.peak + c.continuous + c.slew > 0 {
            text += &format!(
                "{}: limited at {} of {} ticks (peak {}, continuous {}, slew {})\n",
                actuator.path,
                c.peak.max(c.continuous).max(c.slew),
                c.ticks,
                c.peak,
                c.continuous,
                c.slew
            );
        }
    }
    if outcome.faults.ticks > 0 {
        let origin = outcome
            .faults
            .origin
            .map_or("an unknown node", |node| graph.nodes()[node].path.as_str());
        text += &format!(
            "not a number {} times at an actuator, first from {origin}\n",
            outcome.faults.ticks
        );
    }
    text + &format!("{}\n", folder.display())
}
