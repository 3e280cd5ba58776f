//! `haptograph batch`: a data set of many rendered vibrations, described by a plan.

use super::placing::{Force, Output, replaceable};
use super::progress::Progress;
use super::result::{CommandResult, Written, show};
use super::{Failure, eprint, make_folder, print_json, run, snippet};
use crate::engine::frame::Kind;
use crate::engine::node::Stream;
use crate::engine::registry::Registry;
use crate::learning::batch::{self, Batch, Merged, PlanError, Processors, RenderSettings, Rendered, Shard};
use crate::nodes::sinks::wav::open_to_fit;
use crate::signal::quantity::Quantity;
use crate::signal::time::Rate;
use clap::{ArgAction, Subcommand};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Render a data set: many surfaces along many motions with many seeds
///
/// PLAN describes the data set (docs/batch.md). The output folder gets the data in chunks, for NumPy or as
/// Parquet, and a manifest. A repeated run renders only chunks that are missing or broken. `--shard 2/5` renders the
/// second of five parts on any machine; `haptograph batch merge` joins all parts into one folder.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// The plan
    #[arg(required = true, value_name = "PLAN.ron")]
    plan: Option<PathBuf>,
    /// The folder to render into
    #[arg(short, long, value_name = "DIR", required_unless_present = "check")]
    output: Option<PathBuf>,
    /// Render one of several parts
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// Number of chunks to render at a time; default: the number of cores
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Only check the plan and print the number of jobs and the size of the data
    #[arg(long, action = ArgAction::SetTrue, conflicts_with_all = ["output", "shard", "threads"])]
    check: bool,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Join the parts of a data set into one folder, identical to that of one run
    ///
    /// Every chunk is read and checked against its hash. Files are hard-linked if the file system allows it,
    /// and copied otherwise.
    Merge {
        /// The folders of all parts
        #[arg(required = true, value_name = "PART")]
        parts: Vec<PathBuf>,
        /// The folder to write the data set into
        #[arg(short, long, value_name = "DIR")]
        output: PathBuf,
        /// Accept parts that were rendered by processors of different families, which may round differently
        #[arg(long)]
        any_processor: bool,
        /// Print the result as JSON
        #[arg(long)]
        json: bool,
    },
    /// Write the vibrations of single jobs as WAV files, `job-<number>.wav`
    ///
    /// The samples have the bits of the data set; the full scale is a power of two. The note beside each file
    /// states what a sample of 1.0 stands for.
    Wav {
        /// The plan
        #[arg(value_name = "PLAN.ron")]
        plan: PathBuf,
        /// Numbers of the jobs, from 0
        #[arg(required = true, value_name = "JOB")]
        jobs: Vec<u64>,
        /// The folder to write the files into
        #[arg(short, long, value_name = "DIR")]
        output: PathBuf,
        #[command(flatten)]
        force: Force,
        /// Print the written files as JSON
        #[arg(long)]
        json: bool,
    },
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    match &arguments.command {
        Some(Command::Merge { parts, output, any_processor, json }) => {
            let allowed = if *any_processor { Processors::Any } else { Processors::OneFamily };
            return merge(parts, output, allowed, *json);
        }
        Some(Command::Wav { plan, jobs, output, force, json }) => {
            return wav(plan, jobs, (output, *force), *json);
        }
        None => {}
    }
    let plan = arguments.plan.as_deref().unwrap_or(Path::new(""));
    let batch = Batch::load(plan).map_err(|error| shown(&error))?;
    match &arguments.output {
        Some(folder) if !arguments.check => render(arguments, &batch, folder),
        _ => {
            let (bytes, chunks, jobs) = (batch.bytes(), batch.chunks(), batch.jobs());
            let (motions, seconds, surfaces) =
                (batch.motions().count(), batch.seconds(), batch.surfaces().len());
            show(&Size { bytes, chunks, jobs, motions, seconds, surfaces }, arguments.json)
        }
    }
}

/// The size of the data set that a plan describes.
#[derive(Serialize)]
struct Size {
    bytes: u64,
    chunks: u64,
    jobs: u64,
    motions: usize,
    seconds: f64,
    surfaces: usize,
}

impl CommandResult for Size {
    fn text(&self) -> String {
        let Self { bytes, chunks, jobs, motions, seconds, surfaces } = self;
        let mebibytes = *bytes as f64 / f64::from(1 << 20);
        format!(
            "{jobs} jobs in {chunks} chunks, {surfaces} surfaces along {motions} motions: {seconds:.0} s of signals, {mebibytes:.1} MiB\n"
        )
    }
}

fn render(arguments: &Arguments, batch: &Batch, folder: &Path) -> Result<(), Failure> {
    let usual = RenderSettings::default();
    let settings = RenderSettings {
        shard: arguments.shard,
        threads: arguments.threads.map_or(usual.threads, usize::from),
    };
    let stop = run::stop_on_interrupt()?;
    let done = Progress::during("rendering", |at| batch::render(batch, folder, &settings, at, &stop));
    let done = done.map_err(Failure::message)?;
    for (path, why) in &done.replaced {
        eprint(&format!("note: chunk {} was broken and is rendered again: {why}\n", path.display()));
    }
    note_processors(&done.processors);
    if !done.was_stopped {
        return show(&done, arguments.json);
    }
    if arguments.json {
        print_json(&done)?;
    }
    let Rendered { chunks, rendered, kept, .. } = done;
    let missing = chunks - rendered - kept;
    eprint(&format!("stopped with {missing} of {chunks} chunks missing; repeat the command to continue\n"));
    Err(Failure::Interrupted)
}

impl CommandResult for Rendered {
    fn text(&self) -> String {
        let Self { chunks, rendered, kept, .. } = self;
        let there = match kept {
            0 => String::new(),
            kept => format!(", kept {kept} existing ones"),
        };
        let whole = match self.is_complete {
            true => "the data set is complete",
            false => "the other parts are missing",
        };
        format!("rendered {rendered} of {chunks} chunks{there}; {whole}: {}\n", self.folder.display())
    }
}

/// A data set that was joined from parts.
#[derive(Serialize)]
struct Joined {
    #[serde(flatten)]
    merged: Merged,
    #[serde(skip)]
    parts: usize,
}

impl CommandResult for Joined {
    fn text(&self) -> String {
        let Merged { chunks, folder, jobs, .. } = &self.merged;
        format!("merged {chunks} chunks, {jobs} jobs, of {} parts: {}\n", self.parts, folder.display())
    }
}

/// Notes on standard error that chunks were rendered by processors of several families.
fn note_processors(processors: &BTreeSet<String>) {
    if processors.len() > 1 {
        let all = processors.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
        eprint(&format!(
            "note: the chunks were rendered by different processors ({all}), which may round differently\n"
        ));
    }
}

fn merge(parts: &[PathBuf], output: &Path, allowed: Processors, json: bool) -> Result<(), Failure> {
    let merged = Progress::during("merging", |at| batch::merge(parts, output, allowed, at));
    let merged = merged.map_err(Failure::message)?;
    note_processors(&merged.processors);
    show(&Joined { merged, parts: parts.len() }, json)
}

fn wav(plan: &Path, jobs: &[u64], (folder, force): (&Path, Force), json: bool) -> Result<(), Failure> {
    let batch = Batch::load(plan).map_err(|error| shown(&error))?;
    let of = batch.jobs();
    if let Some(job) = jobs.iter().find(|job| **job >= of) {
        let (plan, last) = (plan.display(), of - 1);
        return Err(Failure::Message(format!("{plan} has no job {job}; its jobs are 0 to {last}")));
    }
    make_folder(folder)?;
    let stop = run::stop_on_interrupt()?;
    let progress = Progress::of("rendering");
    let mut written = vec![];
    for (done, job) in jobs.iter().enumerate() {
        if stop.load(Ordering::Relaxed) {
            return Err(Failure::Interrupted);
        }
        written.push(write_wav(&batch, *job, folder, force)?);
        progress.at((done + 1) as f64 / jobs.len() as f64);
    }
    drop(progress);
    let text = format!("wrote {} WAV files: {}\n", written.len(), folder.display());
    show(&Written::several(written, text), json)
}

/// Writes the vibration of a job and its note; returns the path of the WAV file.
fn write_wav(batch: &Batch, number: u64, folder: &Path, force: Force) -> Result<PathBuf, Failure> {
    let job = batch.job(number);
    let failed = |error: &dyn std::fmt::Display| Failure::Message(format!("job {number}: {error}"));
    let rate = Rate::parse(&batch.rate_hz(&job).to_string()).map_err(|error| failed(&error))?;
    let stream = Stream {
        name: format!("{}, seed {}", batch.surfaces()[job.surface].name, job.seed),
        kind: Kind::SCALAR,
        quantity: Quantity::ACCELERATION,
        rate,
        // Rendered from a model, not measured.
        simulated: true,
    };
    let path = folder.join(format!("job-{number}.wav"));
    let output = Output::claim(&path, force)?;
    replaceable(&path.with_added_extension("ron"), force)?;
    let vibration = batch::vibration(batch, job).map_err(|error| failed(&error))?;
    let write = |path: &Path| {
        let mut writer = open_to_fit(path, &stream)?;
        writer.write(0, &vibration)?;
        writer.finish()
    };
    Ok(output.write_by(write)?.0)
}

/// A plan error, shown at its place in the file.
fn shown(error: &PlanError) -> Failure {
    snippet::failure(&error.path, error.place, &error.problem.to_string(), error)
}
