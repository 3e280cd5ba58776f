//! `haptograph run`: runs a graph offline or in real time and writes a folder with the files of its sinks, a
//! page and `run.json`.

mod console;
mod endpoints;
mod facts;
mod live;
mod outputs;
pub(super) mod present;
mod replay;
mod status;
pub(super) mod summary;

use super::import::number;
use super::placing::{Force, MANIFEST, MARK, MARKER, MOVES, PROBES, REPLACED, RunFolder, replaceable};
use super::progress::Progress;
use super::{Failure, GraphArguments, eprint, interrupt, print, stderr};
use crate::engine::graph::{Graph, GraphDevice};
use crate::engine::registry::Registry;
use crate::engine::run::{ARRIVALS, FileSinks, Outcome, Probe, Session, SessionOptions};
use crate::live::supervisor::CHANGES;
use crate::report::plotted::PlottedSignals;
use crate::report::sound::Sound;
use present::Present;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;
use summary::Summary;

/// Run a graph and write the signals of its sinks, with a page to look at
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    pub graph: GraphArguments,
    /// Duration in the graph's own time; default: 10 s, or with --live until ctrl-C
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub duration_s: Option<f64>,
    /// Run in real time, with the live endpoints
    #[arg(long)]
    pub live: bool,
    /// Apply changes of the graph's files while it runs
    #[arg(long, requires = "live")]
    pub watch: bool,
    /// Also receive settings by Open Sound Control at this address: `/NODE/SETTING value`, `/PARAMETER value`
    #[arg(long, value_name = "ADDRESS:PORT", value_parser = socket, requires = "live")]
    pub osc: Option<SocketAddr>,
    /// Start with cold actuators; without this flag real actuators start as warm as their limits allow
    #[arg(long, requires = "live")]
    pub rested: bool,
    /// Repeat a live run bit for bit, including the settings changed during it, from its folder
    #[arg(long, value_name = "DIR", conflicts_with_all = ["live", "duration_s"])]
    pub replay: Option<PathBuf>,
    /// The seed of all random streams, in place of the graph's own
    #[arg(long, value_parser = super::seed)]
    pub seed: Option<u64>,
    /// The folder to write; default: `out/GRAPH`
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Driver frames to compute at a time; the samples do not depend on it
    #[arg(long, value_name = "FRAMES", default_value_t = 64, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub block: u16,
    /// Also write the signal of an output to a .wav or .csv file; a relative path starts at the current
    /// folder; can be repeated
    #[arg(long, value_name = "NODE.PORT=FILE", value_parser = outputs::probe_argument)]
    pub probe: Vec<outputs::ProbeArgument>,
    #[command(flatten)]
    pub force: Force,
    /// Also write every signal, into the folder `record`
    #[arg(long)]
    pub record: bool,
    /// Print the facts of the run as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub present: Present,
}

pub(super) fn seconds(text: &str) -> Result<f64, String> {
    number(text, f64::MIN_POSITIVE..=1e7, "give a number of seconds above 0, at most 10000000")
}

/// The address at which settings are received.
fn socket(text: &str) -> Result<SocketAddr, String> {
    let (host, port) = text.rsplit_once(':').unwrap_or((text, ""));
    if port.parse::<u16>().is_err() || host.is_empty() {
        let host = if host.is_empty() { "127.0.0.1" } else { host };
        return Err(format!(
            "it lacks an address or a port; haptograph listens there for settings: write `--osc {host}:9000`"
        ));
    }
    let found = text.to_socket_addrs().map_err(|error| error.to_string())?;
    // An IPv4 address first: that is where most senders send.
    let first = found.min_by_key(SocketAddr::is_ipv6);
    first.ok_or_else(|| "it has no address".to_owned())
}

/// Default duration of an offline run, s.
pub(super) const DURATION_S: f64 = 10.0;

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    arguments.graph.refuse_repeated()?;
    if arguments.live {
        return live::run(arguments, registry);
    }
    arguments.present.refuse_silent()?;
    if let Some(folder) = &arguments.replay {
        return replay::run(arguments, folder, registry);
    }
    let graph = arguments.graph.load_and_warn(registry, arguments.seed)?;
    lasts_a_frame(&graph, arguments.duration_s)?;
    let mut setup = RunSetup::begin(arguments, &graph)?;
    let stop = stop_on_interrupt()?;
    setup.completion.folder.begin();
    let duration_s = arguments.duration_s.unwrap_or(DURATION_S);
    let options = offline_options(arguments, duration_s, &stop);
    let (outcome, took_s) = timed(setup.file_sinks, &options)?;
    let mut summary = Summary::of(arguments, &graph, &outcome, took_s);
    summary.add(Vec::new(), unreached(&graph));
    let sound = setup.completion.complete(arguments, &graph, summary)?;
    let played = arguments.present.play_sound(sound, &stop);
    played.map_err(|failure| failure.after_facts(arguments.json))
}

/// Warnings about real input devices in an offline run, where they deliver nothing.
pub(super) fn unreached(graph: &Graph) -> Vec<String> {
    let silent = graph.read_devices().filter(|device| !device.entry.spec.simulated);
    let warning = |device: &GraphDevice| {
        let reached = match device.entry.is_host() {
            true => "delivers data only in a program that embeds the graph".to_owned(),
            false => format!("({}) delivers data only in `run --live`", device.entry.spec.name),
        };
        format!(
            "`{}` {reached}: here it delivered nothing, and the actuators that depend on it stayed at zero",
            device.name
        )
    };
    silent.map(warning).collect()
}

/// Refuses a duration shorter than one frame.
fn lasts_a_frame(graph: &Graph, duration_s: Option<f64>) -> Result<(), Failure> {
    let drivers = graph.drivers().into_iter().map(|driver| &graph.clocks()[driver]);
    let Some((driver, duration_s)) = drivers.zip(duration_s).find(|(driver, s)| s * driver.rate.hz() < 0.5)
    else {
        return Ok(());
    };
    Err(Failure::Message(format!(
        "{duration_s} s is shorter than one frame of `{}` ({}); give a longer time by --for",
        driver.name, driver.rate
    )))
}

/// The output folder of a run.
fn target(arguments: &Arguments) -> PathBuf {
    arguments.out.clone().unwrap_or_else(|| {
        // A replay does not overwrite the run that it repeats.
        let end = if arguments.replay.is_some() { "-replay" } else { "" };
        PathBuf::from("out").join(arguments.graph.name() + end)
    })
}

/// Names that every run writes into its folder.
const OWN_FILES: [&str; 10] =
    [MARK, MANIFEST, MARKER, PROBES, REPLACED, MOVES, PAGE, DRAWING, ARRIVALS, CHANGES];
const PAGE: &str = "report.html";
const DRAWING: &str = "graph.svg";

/// Refuses a graph with a sink that writes a file of the run itself.
pub(super) fn refuse_own_files(graph: &Graph, record: bool) -> Result<(), String> {
    let played = outputs::played_files(graph).into_iter().map(|(_, file)| file);
    let own = OWN_FILES.into_iter().chain(record.then_some(outputs::RECORD));
    let own: Vec<String> = own.map(str::to_owned).chain(played).collect();
    let is_own = |file: &Path| own.iter().any(|own| file.starts_with(own));
    match graph.written_files().find(|(_, file)| is_own(file)) {
        Some((node, file)) => Err(format!(
            "the sink `{}` writes {}, which the run writes itself; choose another name",
            graph.nodes()[node].path,
            file.display()
        )),
        None => Ok(()),
    }
}

/// False for a live run without a duration, which ends by ctrl-C.
fn has_end(arguments: &Arguments) -> bool {
    !arguments.live || arguments.duration_s.is_some()
}

/// A run before its start: its file sinks, and the data that complete it afterwards.
struct RunSetup<'a> {
    file_sinks: FileSinks<'a>,
    completion: Completion,
}

struct Completion {
    target: PathBuf,
    folder: RunFolder,
    probes: Vec<PathBuf>,
    plotted: PlottedSignals,
}

impl<'a> RunSetup<'a> {
    fn begin(arguments: &Arguments, graph: &'a Graph) -> Result<Self, Failure> {
        let target = target(arguments);
        refuse_own_files(graph, arguments.record).map_err(Failure::message)?;
        for (number, probe) in arguments.probe.iter().enumerate() {
            arguments.graph.refuse_inputs(graph, &probe.file)?;
            for file in [probe.file.clone(), probe.file.with_added_extension("ron")] {
                replaceable(&file, arguments.force)?;
            }
            let (place, file, run) = (place_of(&probe.file), probe.file.display(), target.display());
            if place.starts_with(place_of(&target)) {
                return Err(Failure::Message(format!(
                    "{file} lies in the folder of the run, which is written as a whole: give the probe a place outside of {run}"
                )));
            }
            if arguments.probe[..number].iter().any(|other| place_of(&other.file) == place) {
                let why = format!("two probes go to {file}; give each a file of its own");
                return Err(Failure::Message(why));
            }
        }
        let folder = RunFolder::beside(&target)?;
        let mut file_sinks = FileSinks::new(graph);
        file_sinks.open_files(folder.path()).map_err(Failure::message)?;
        outputs::keep_played(graph, folder.path(), &mut file_sinks)?;
        let probes = outputs::open_probes(graph, &arguments.probe, &folder, &mut file_sinks)?;
        if arguments.record {
            outputs::record_all(graph, &folder, &mut file_sinks)?;
        }
        let plotted = plotted_signals(graph, &mut file_sinks);
        let completion = Completion { target, folder, probes, plotted };
        Ok(Self { file_sinks, completion })
    }
}

/// The path of a file or folder that may not exist yet, the same for all ways to write it.
fn place_of(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    // `..` behind a folder that does not exist leads nowhere, and no file can be written there.
    let mut ancestors = absolute.ancestors();
    let existing = ancestors.find_map(|folder| Some((folder, folder.canonicalize().ok()?)));
    match existing {
        Some((folder, real)) => real.join(absolute.strip_prefix(folder).unwrap_or(Path::new(""))),
        None => absolute,
    }
}

/// Records the signals of a run's page.
pub(super) fn plotted_signals(graph: &Graph, file_sinks: &mut FileSinks<'_>) -> PlottedSignals {
    PlottedSignals::of(graph, |watch, writer| {
        file_sinks.probe(Probe { node: watch.node, output: watch.output, writer });
    })
}

impl Completion {
    /// Writes the page and the facts, moves the folder to its place, and prints the summary. Returns the
    /// sound to play.
    fn complete(
        self,
        arguments: &Arguments,
        graph: &Graph,
        mut summary: Summary,
    ) -> Result<Option<Sound>, Failure> {
        summary.add(Vec::new(), self.plotted.shortfalls());
        let sound = self.plotted.sound();
        self.folder.write(MARK, &summary.to_json())?;
        self.folder.write(PAGE, &summary.page(graph, &self.plotted, sound.as_ref()))?;
        self.folder
            .write(DRAWING, &crate::report::drawing::standalone_svg(graph, &arguments.graph.name()))?;
        let (placed, probes) = self.folder.commit(&self.probes, arguments.force)?;
        let notes = outputs::full_scales(&probes)?.into_iter().chain(placed.lines());
        notes.for_each(|line| eprint(&format!("note: {line}\n")));
        summary.warnings().iter().for_each(|warning| eprint(&format!("warning: {warning}\n")));
        print(&match arguments.json {
            true => summary.to_json(),
            false => summary.sentence(&self.target, graph, sound.as_ref()) + &outputs::beside(&self.probes),
        })?;
        arguments.present.open_page(&self.target.join(PAGE));
        match summary.was_stopped() && has_end(arguments) {
            true => Err(Failure::Interrupted),
            false => Ok(sound),
        }
    }
}

/// Options of an offline run.
pub(super) fn offline_options(
    arguments: &Arguments,
    duration_s: f64,
    stop: &Arc<AtomicBool>,
) -> SessionOptions {
    let mut options = SessionOptions::default().block(arguments.block.into()).seconds(duration_s);
    options.stop = Arc::clone(stop);
    options
}

/// Runs with a progress bar; returns the outcome and the elapsed time, s.
pub(super) fn timed(file_sinks: FileSinks<'_>, options: &SessionOptions) -> Result<(Outcome, f64), Failure> {
    let duration_s = options.seconds.unwrap_or(DURATION_S);
    let bar = Progress::of("running");
    let start = Instant::now();
    let progress = &mut |done_s: f64| bar.at(done_s / duration_s);
    let outcome = Session::run_offline(file_sinks, options, progress).map_err(Failure::message)?;
    let took_s = start.elapsed().as_secs_f64();
    Ok((outcome, took_s))
}

/// The first ctrl-C ends the run with complete files, the second ends the program.
pub(super) fn stop_on_interrupt() -> Result<Arc<AtomicBool>, Failure> {
    let stop = interrupt::flag()?;
    stderr::start_queue(&stop)
        .map_err(|error| Failure::Message(format!("cannot start a thread: {error}")))?;
    Ok(stop)
}
