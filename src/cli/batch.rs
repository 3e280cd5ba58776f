//! `haptograph batch`: a data set of many vibrations, from a plan.

use super::progress::Progress;
use super::{Failure, read_file, remark, run, say, say_json, snippet};
use crate::engine::registry::Registry;
use crate::surfaces::batch::{self, Batch, PlanError, RenderSettings, Rendered, Shard};
use clap::{ArgAction, Subcommand};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Render a data set: many surfaces along many motions with many seeds
///
/// PLAN says what is rendered (docs/batch.md). The folder gets the data in chunks that NumPy reads, and a manifest. Run again, it renders what is
/// missing or broken and nothing else. `--shard 2/5` renders the second of five parts, anywhere; `haptograph batch merge` makes one folder of all.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Arguments {
    #[command(subcommand)]
    merge: Option<Merge>,
    /// The plan
    #[arg(required = true, value_name = "PLAN.ron")]
    plan: Option<PathBuf>,
    /// The folder to render into
    #[arg(short, long, value_name = "DIR", required_unless_present = "check")]
    output: Option<PathBuf>,
    /// Render one of several parts
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// Chunks that are rendered at a time; as many as there are cores where it is not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Only check the plan and say what it asks for
    #[arg(long, action = ArgAction::SetTrue, conflicts_with_all = ["output", "shard", "threads"])]
    check: bool,
    /// Print what was done as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Merge {
    /// Make one folder of the parts of a data set, the same as one run would have left
    ///
    /// Every chunk is read and compared with its hash. Files are linked where the file system can, and copied elsewhere.
    Merge {
        /// The folders of all parts
        #[arg(required = true, value_name = "PART")]
        parts: Vec<PathBuf>,
        /// The folder to put them into
        #[arg(short, long, value_name = "DIR")]
        output: PathBuf,
        /// Print what was done as JSON
        #[arg(long)]
        json: bool,
    },
}

pub fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    if let Some(Merge::Merge { parts, output, json }) = &arguments.merge {
        return merge(parts, output, *json);
    }
    let plan = arguments.plan.as_deref().unwrap_or(Path::new(""));
    let batch = Batch::load(plan).map_err(|error| shown(&error))?;
    match &arguments.output {
        Some(folder) if !arguments.check => render(arguments, &batch, folder),
        _ => describe(arguments, &batch),
    }
}

/// What a plan asks for.
fn describe(arguments: &Arguments, batch: &Batch) -> Result<(), Failure> {
    let (jobs, chunks) = (batch.jobs(), batch.chunks());
    let (surfaces, motions) = (batch.surfaces().len(), batch.motions().count());
    let (seconds, bytes) = (batch.seconds(), batch.bytes());
    if arguments.json {
        return say_json(&json!({
            "jobs": jobs, "chunks": chunks, "surfaces": surfaces, "motions": motions, "seconds": seconds, "bytes": bytes,
        }));
    }
    let mebibytes = bytes as f64 / f64::from(1 << 20);
    say(&format!(
        "{jobs} jobs in {chunks} chunks, of {surfaces} surfaces along {motions} motions: {seconds:.0} s of signals, {mebibytes:.1} MiB\n"
    ))
}

fn render(arguments: &Arguments, batch: &Batch, folder: &Path) -> Result<(), Failure> {
    let usual = RenderSettings::default();
    let settings = RenderSettings {
        shard: arguments.shard,
        threads: arguments.threads.map_or(usual.threads, usize::from),
    };
    let stop = run::stop_on_interrupt()?;
    let progress = Progress::of("rendering");
    let done = batch::render(batch, folder, &settings, &|part| progress.at(part), &stop);
    drop(progress);
    let done = done.map_err(|error| Failure::Message(error.to_string()))?;
    for (path, why) in &done.replaced {
        remark(&format!(
            "note: {} was broken and is rendered again: {why}\n",
            path.display()
        ));
    }
    if arguments.json {
        say_json(&facts(&done, folder))?;
    }
    let Rendered {
        chunks,
        rendered,
        kept,
        ..
    } = done;
    if done.was_stopped {
        let missing = chunks - rendered - kept;
        remark(&format!(
            "stopped with {missing} of {chunks} chunks missing; the same command goes on\n"
        ));
        return Err(Failure::Interrupted);
    }
    if arguments.json {
        return Ok(());
    }
    let there = match kept {
        0 => String::new(),
        kept => format!(", {kept} were there"),
    };
    let whole = match done.is_complete {
        true => "the data set is complete",
        false => "the other parts are missing",
    };
    say(&format!(
        "rendered {rendered} of {chunks} chunks{there}; {whole}: {}\n",
        folder.display()
    ))
}

fn facts(done: &Rendered, folder: &Path) -> serde_json::Value {
    json!({
        "chunks": done.chunks,
        "rendered": done.rendered,
        "kept": done.kept,
        "replaced": done.replaced.iter().map(|(path, _)| path).collect::<Vec<_>>(),
        "complete": done.is_complete,
        "stopped": done.was_stopped,
        "folder": folder,
    })
}

fn merge(parts: &[PathBuf], output: &Path, json: bool) -> Result<(), Failure> {
    let progress = Progress::of("merging");
    let merged = batch::merge(parts, output, &|part| progress.at(part));
    drop(progress);
    let merged = merged.map_err(|error| Failure::Message(error.to_string()))?;
    if json {
        return say_json(&json!({ "chunks": merged.chunks, "jobs": merged.jobs, "folder": output }));
    }
    let (parts, chunks, jobs) = (parts.len(), merged.chunks, merged.jobs);
    say(&format!(
        "merged {chunks} chunks, {jobs} jobs, of {parts} parts: {}\n",
        output.display()
    ))
}

/// What is wrong with a plan, at its place.
fn shown(error: &PlanError) -> Failure {
    let Some((place, bytes)) = error
        .place
        .and_then(|place| Some((place, read_file(&error.path).ok()?)))
    else {
        return Failure::Message(error.to_string());
    };
    let text = String::from_utf8_lossy(&bytes);
    let line = text.lines().nth(place.line - 1).unwrap_or_default();
    let (name, message) = (error.path.display().to_string(), error.problem.to_string());
    Failure::Shown(snippet::at(&name, line, place.line, place.column, &message))
}
