//! `haptograph run`: a graph runs, as fast as the processor allows or against the clock, and leaves a folder: the
//! files of its sinks, a page to look at, and `run.json`.

mod afar;
mod attended;
mod console;
mod driver;
mod drivers;
mod endpoints;
mod facts;
pub mod folder;
mod guards;
mod history;
mod latency;
mod live;
mod loading;
mod outputs;
pub mod placing;
pub mod present;
mod replay;
mod shown;
mod silence;
mod status;
pub mod summary;
mod watch;

use super::output::{self, Force};
use super::terminal::is_animated;
use super::{Failure, GraphArguments, interrupt, remark, remarks, say};
use crate::engine::graph::{Graph, GraphDevice};
use crate::engine::registry::Registry;
use crate::engine::run::{ARRIVALS, FileSinks, Offline, Outcome};
use crate::report::sound::Sound;
use folder::RunFolder;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use present::Present;
pub use shown::Shown;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;
use summary::Summary;

/// Run a graph and write what its sinks receive, with a page to look at
#[derive(Debug, Clone, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    pub graph: GraphArguments,
    /// How long the graph runs, in its own time; 10 where it is not given, or live until ctrl-C
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub duration_s: Option<f64>,
    /// Run against the clock, with the live endpoints
    #[arg(long)]
    pub live: bool,
    /// Take over what changes in the graph's files while it runs
    #[arg(long, requires = "live")]
    pub watch: bool,
    /// Also take settings by Open Sound Control at this address: `/NODE/SETTING value`, `/PARAMETER value`
    #[arg(long, value_name = "ADDRESS:PORT", requires = "live")]
    pub osc: Option<SocketAddr>,
    /// The actuators are cold: unless this is said, real ones begin as warm as their limits allow
    #[arg(long, requires = "live")]
    pub rested: bool,
    /// Repeat a live run bit for bit, and what was set meanwhile, from the folder that it left
    #[arg(long, value_name = "DIR", conflicts_with_all = ["live", "duration_s"])]
    pub replay: Option<PathBuf>,
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
    /// Also write the signal of an output, as .wav or .csv, to a path from the folder you are in; can be repeated
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

pub fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 1e7 => Ok(value),
        _ => Err("give a number of seconds above 0, at most 10000000".to_owned()),
    }
}

/// How long an offline run takes in its own time, unless told otherwise.
pub const DURATION_S: f64 = 10.0;

pub fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
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
    let mut made = Making::begin(arguments, &graph)?;
    let stop = stop_on_interrupt()?;
    made.kept.folder.begin();
    let duration_s = arguments.duration_s.unwrap_or(DURATION_S);
    let offline =
        Offline::new(made.outlets, usize::from(arguments.block)).threads(usize::from(arguments.threads));
    let (outcome, took_s) = timed(offline, duration_s, &stop)?;
    let mut summary = Summary::of(arguments, &graph, &outcome, took_s);
    summary.add(Vec::new(), unreached(&graph));
    let sound = made.kept.complete(arguments, &graph, &summary)?;
    let played = arguments.present.play_sound(sound, &stop);
    played.map_err(|failure| failure.after_facts(arguments.json))
}

/// Warnings of devices that only a live run hears: offline they sense nothing. What soundcards play is kept.
pub fn unreached(graph: &Graph) -> Vec<String> {
    let silent = graph.read_devices().filter(|device| !device.entry.spec.simulated);
    let warning = |device: &GraphDevice| {
        let reached = match device.entry.is_host() {
            true => "is heard only where another program embeds the graph".to_owned(),
            false => format!(
                "is {}, which is reached by `run --live` only",
                device.entry.spec.name
            ),
        };
        format!(
            "`{}` {reached}: it sensed nothing, and the actuators that depend on it stayed at zero",
            device.name
        )
    };
    silent.map(warning).collect()
}

/// Refuses a run that ends before it begins.
fn lasts_a_frame(graph: &Graph, duration_s: Option<f64>) -> Result<(), Failure> {
    let drivers = graph.drivers().into_iter().map(|driver| &graph.clocks()[driver]);
    let Some((driver, duration_s)) = drivers
        .zip(duration_s)
        .find(|(driver, s)| s * driver.rate.hz() < 0.5)
    else {
        return Ok(());
    };
    Err(Failure::Message(format!(
        "{duration_s} s are less than a frame of `{}` ({}); give --for a longer time",
        driver.name, driver.rate
    )))
}

/// The folder that a run leaves.
fn target(arguments: &Arguments) -> PathBuf {
    arguments.out.clone().unwrap_or_else(|| {
        // What is repeated stays.
        let end = if arguments.replay.is_some() { "-replay" } else { "" };
        PathBuf::from("out").join(arguments.graph.name() + end)
    })
}

/// What a run leaves in its folder whatever the graph.
const OWN_FILES: [&str; 10] = [
    folder::MARK,
    folder::MANIFEST,
    folder::MARKER,
    folder::PROBES,
    folder::REPLACED,
    placing::MOVES,
    PAGE,
    DRAWING,
    ARRIVALS,
    attended::CHANGES,
];
const PAGE: &str = "report.html";
const DRAWING: &str = "graph.svg";

/// Refuses a graph with a sink that writes what the run writes itself.
pub fn spare_own_files(graph: &Graph, record: bool) -> Result<(), String> {
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

/// Has a run an end of its own? A live one without ends by ctrl-C.
fn has_end(arguments: &Arguments) -> bool {
    !arguments.live || arguments.duration_s.is_some()
}

/// A run that is being made: what it writes, and what is kept to complete it.
struct Making<'a> {
    outlets: FileSinks<'a>,
    kept: Kept,
}

struct Kept {
    target: PathBuf,
    folder: RunFolder,
    probes: Vec<PathBuf>,
    shown: Shown,
}

impl<'a> Making<'a> {
    fn begin(arguments: &Arguments, graph: &'a Graph) -> Result<Self, Failure> {
        let target = target(arguments);
        spare_own_files(graph, arguments.record).map_err(message)?;
        for (number, probe) in arguments.probe.iter().enumerate() {
            arguments.graph.spare_inputs(graph, &probe.file)?;
            for file in [probe.file.clone(), outputs::note_of(&probe.file)] {
                output::replaceable(&file, arguments.force)?;
            }
            if arguments.probe[..number]
                .iter()
                .any(|other| other.file == probe.file)
            {
                return Err(Failure::Message(format!(
                    "two probes go to {}; give each a file of its own",
                    probe.file.display()
                )));
            }
        }
        let folder = RunFolder::beside(&target)?;
        let mut outlets = FileSinks::new(graph);
        outlets.open_files(folder.path()).map_err(message)?;
        outputs::keep_played(graph, folder.path(), &mut outlets)?;
        let probes = outputs::open_probes(graph, &arguments.probe, &folder, &mut outlets)?;
        if arguments.record {
            outputs::record_all(graph, &folder, &mut outlets)?;
        }
        let shown = Shown::of(graph, &mut outlets);
        let kept = Kept {
            target,
            folder,
            probes,
            shown,
        };
        Ok(Self { outlets, kept })
    }
}

impl Kept {
    /// Writes the page and the facts, puts the folder in its place, and says so. Returns what there is to hear.
    fn complete(
        self,
        arguments: &Arguments,
        graph: &Graph,
        summary: &Summary,
    ) -> Result<Option<Sound>, Failure> {
        let sound = self.shown.sound();
        self.folder.write(folder::MARK, &summary.to_json())?;
        self.folder
            .write(PAGE, &summary.page(graph, &self.shown, sound.as_ref()))?;
        self.folder.write(
            DRAWING,
            &crate::report::drawing::standalone_svg(graph, &arguments.graph.name()),
        )?;
        self.folder.seal(&self.probes)?;
        let probes = outputs::place_probes(&self.folder, &self.probes, arguments.force)
            .inspect_err(|_| self.folder.unseal())?;
        for line in outputs::full_scales(&probes)? {
            remark(&format!("note: {line}\n"));
        }
        let placed = self.folder.put_in_place()?;
        placed
            .lines()
            .iter()
            .for_each(|line| remark(&format!("note: {line}\n")));
        summary
            .warnings()
            .iter()
            .for_each(|warning| remark(&format!("warning: {warning}\n")));
        say(&match arguments.json {
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

pub fn message(error: impl std::fmt::Display) -> Failure {
    Failure::Message(error.to_string())
}

/// Runs with a bar on the terminal; what happened, and how long it took in seconds.
pub fn timed(offline: Offline<'_>, duration_s: f64, stop: &AtomicBool) -> Result<(Outcome, f64), Failure> {
    let bar = progress_bar(duration_s);
    let start = Instant::now();
    let outcome = offline
        .run(duration_s, stop, &mut |done_s| {
            bar.set_position((done_s * 1e3) as u64)
        })
        .map_err(message)?;
    let took_s = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    Ok((outcome, took_s))
}

/// The first ctrl-C ends the run with complete files, the second ends the program.
pub fn stop_on_interrupt() -> Result<Arc<AtomicBool>, Failure> {
    let stop = interrupt::flag()?;
    remarks::queue(&stop).map_err(|error| Failure::Message(format!("cannot begin a thread: {error}")))?;
    Ok(stop)
}

/// Shown on terminals only.
pub fn progress_bar(duration_s: f64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(
        Some((duration_s * 1e3) as u64),
        match is_animated() {
            true => ProgressDrawTarget::stderr_with_hz(10),
            false => ProgressDrawTarget::hidden(),
        },
    );
    let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {eta} left");
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
