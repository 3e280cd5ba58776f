//! How many instructions a block of 64 driver frames of each pipeline takes, beside what it took when that was last
//! looked at. Counted by valgrind's callgrind, so that a busy machine changes nothing.
//!
//! `cargo run --release -p haptograph-instructions` fails where a graph got dearer by more than a tenth; `-- --keep` writes down the
//! counts as they are now.

use haptograph::engine::document::{Document, LoadOptions};
use haptograph::engine::graph::{CheckOptions, check};
use haptograph::engine::plan::{Plan, PlanOptions};
use haptograph::engine::run::Run;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::Arc;

const GRAPHS: [&str; 3] = ["texturepad", "omni", "ar-pen"];
const FRAMES: usize = 64;
/// Loading takes part in the counts of both; their difference is blocks alone.
const BLOCKS: [u64; 2] = [20, 220];
/// What another compiler or another processor's vector instructions may change.
const TOLERANCE: f64 = 0.1;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|argument| argument == "--run") {
        return match (arguments.get(at + 1), arguments.get(at + 2).and_then(|count| count.parse().ok())) {
            (Some(graph), Some(blocks)) => run(graph, blocks),
            _ => ExitCode::FAILURE,
        };
    }
    if Command::new("valgrind").arg("--version").output().is_err() {
        say(
            "skipped: instructions are counted by valgrind, and it is not here; install the package `valgrind`",
        );
        return ExitCode::SUCCESS;
    }
    compare(arguments.iter().any(|argument| argument == "--keep"))
}

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[expect(clippy::print_stdout, reason = "a bench reports")]
fn say(line: &str) {
    println!("{line}");
}

/// What is counted: a graph is loaded and runs for so many blocks.
fn run(graph: &str, blocks: u64) -> ExitCode {
    let path = here().join("../../graphs").join(graph).with_extension("ron");
    let graph = Document::load(&path, &LoadOptions::default())
        .and_then(|document| check(&document, &haptograph::nodes::registry(), &CheckOptions::default()))
        .expect("shipped graphs are sound");
    let options = PlanOptions::default().block(FRAMES);
    let mut run = Run::new(Arc::new(Plan::of(&graph, &options).remove(0)));
    (0..blocks).for_each(|_| run.advance(FRAMES));
    ExitCode::SUCCESS
}

fn compare(keep: bool) -> ExitCode {
    let kept_in: PathBuf = here().join("counts.json");
    let text = std::fs::read_to_string(&kept_in).unwrap_or_default();
    let kept: Value = serde_json::from_str(&text).unwrap_or_default();
    let mut counted = Map::new();
    let mut dearer = false;
    say("instructions of a block of 64 driver frames");
    for graph in GRAPHS {
        let [few, many] = BLOCKS.map(|blocks| count(graph, blocks));
        let (Some(few), Some(many)) = (few, many) else {
            say("valgrind counted nothing; does it run on this machine?");
            return ExitCode::FAILURE;
        };
        let now = many.saturating_sub(few) / (BLOCKS[1] - BLOCKS[0]);
        let ratio = kept[graph].as_f64().map(|kept| now as f64 / kept);
        let verdict = match ratio {
            None => "not kept yet".to_owned(),
            Some(ratio) if ratio > 1.0 + TOLERANCE => format!("{ratio:.3} of what is kept: DEARER"),
            Some(ratio) => format!("{ratio:.3} of what is kept"),
        };
        dearer |= ratio.is_none_or(|ratio| ratio > 1.0 + TOLERANCE);
        say(&format!("  {graph:12} {now:>10}   {verdict}"));
        counted.insert(graph.to_owned(), json!(now));
    }
    if keep {
        let text = format!("{:#}\n", Value::Object(counted));
        std::fs::write(&kept_in, text).expect("the repository can be written");
        say("kept");
        return ExitCode::SUCCESS;
    }
    if dearer {
        say(
            "where that is meant, `cargo run --release -p haptograph-instructions -- --keep` keeps the new counts",
        );
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

/// The instructions of a whole process that runs `graph`.
fn count(graph: &str, blocks: u64) -> Option<u64> {
    let this = std::env::current_exe().ok()?;
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(this)
        .args(["--run", graph, &blocks.to_string()])
        .output()
        .ok()?;
    let told = String::from_utf8_lossy(&output.stderr);
    let line = told.lines().find(|line| line.contains("Collected :"))?;
    output.status.success().then_some(())?;
    line.rsplit(' ').next()?.parse().ok()
}
