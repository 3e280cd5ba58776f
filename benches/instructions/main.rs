//! How many instructions the engine's work takes, beside the counts that are kept: what costs more does not pass. Counted by valgrind's
//! callgrind, so that a busy machine changes nothing.
//!
//! `cargo run --release -p haptograph-instructions [-- WORK..]` fails where a count is above the kept one by more than 3 %; `-- --keep`
//! keeps the present ones. Counts belong to a compiler and an instruction set; for another one the bound is 10 %.

#[path = "../peers/src/ours.rs"]
#[allow(dead_code, reason = "shared with a bench that compares outputs")]
mod ours;
#[path = "../peers/src/work.rs"]
#[allow(dead_code, reason = "shared with a bench that compares outputs")]
mod work;
mod works;

use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use works::WORKS;

/// What a count may gain, by the same compiler for the same instruction set and by another.
const TOLERANCE: f64 = 0.03;
const TOLERANCE_ELSEWHERE: f64 = 0.1;
/// Misses depend on where the system places memory.
const TOLERANCE_MISSES: f64 = 0.1;
const NOISE_MISSES: f64 = 1000.0;
/// A cache of every machine: 32 KiB, 8 ways; 8 MiB, 16 ways; lines of 64 bytes.
const CACHES: [&str; 4] = ["--cache-sim=yes", "--I1=32768,8,64", "--D1=32768,8,64", "--LL=8388608,16,64"];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments[..] {
        [command, name] if command == "--run" => works::run(name),
        [command] if command == "--set" => {
            say(instruction_set());
            ExitCode::SUCCESS
        }
        _ if Command::new("valgrind").arg("--version").output().is_err() => {
            say(
                "skipped: instructions are counted by valgrind, and it is not here; install the package `valgrind`",
            );
            ExitCode::SUCCESS
        }
        _ => {
            let keep = arguments.iter().any(|argument| argument == "--keep");
            let wanted: Vec<&str> =
                arguments.iter().map(String::as_str).filter(|argument| !argument.starts_with("--")).collect();
            compare(&wanted, keep)
        }
    }
}

#[expect(clippy::print_stdout, reason = "a bench reports")]
fn say(line: &str) {
    println!("{line}");
}

/// The widest vector instructions, here of the processor that valgrind shows to a program.
fn instruction_set() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if std::arch::is_x86_feature_detected!("avx512f") {
            return "avx512";
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            return "avx2";
        }
    }
    std::env::consts::ARCH
}

fn compare(wanted: &[&str], keep: bool) -> ExitCode {
    let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("counts.json");
    let text = std::fs::read_to_string(&path).unwrap_or_default();
    let mut all: Map<String, Value> = serde_json::from_str(&text).unwrap_or_default();
    let Some(here) = here() else {
        say("valgrind runs nothing on this machine");
        return ExitCode::FAILURE;
    };
    let kept = all.get(&here).or_else(|| all.values().next()).and_then(Value::as_object).cloned();
    let tolerance = if all.contains_key(&here) { TOLERANCE } else { TOLERANCE_ELSEWHERE };
    say(&format!("instructions ({here})"));
    let mut counted = kept.clone().unwrap_or_default();
    let (mut dearer, mut failed) = (Vec::new(), false);
    for work in WORKS.iter().filter(|work| wanted.is_empty() || wanted.contains(&work.name)) {
        let Some(counts) = count(work.name, work.has_misses) else {
            say(&format!("  {:22} was not counted", work.name));
            failed = true;
            continue;
        };
        for (what, now) in ["", ", D1 misses", ", LL misses"].iter().zip(counts) {
            let name = format!("{}{what}", work.name);
            let (tolerance, noise) =
                if what.is_empty() { (tolerance, 0.0) } else { (TOLERANCE_MISSES, NOISE_MISSES) };
            let before = kept.as_ref().and_then(|kept| kept.get(&name)?.as_f64());
            let ratio = before.map(|before| (now as f64 + noise) / (before + noise));
            let is_dearer = ratio.is_none_or(|ratio| ratio > 1.0 + tolerance);
            let verdict = ratio
                .map_or_else(|| "not kept yet".to_owned(), |ratio| format!("{ratio:.3} of what is kept"));
            say(&format!("  {name:30} {now:>12}   {verdict}{}", if is_dearer { ": DEARER" } else { "" }));
            dearer.extend(is_dearer.then(|| name.clone()));
            counted.insert(name, json!(now));
        }
    }
    if keep {
        all.insert(here, Value::Object(counted));
        let text = format!("{:#}\n", Value::Object(all));
        std::fs::write(&path, text).expect("the repository can be written");
        say("kept");
    } else if !dearer.is_empty() {
        say(&format!("dearer by more than is allowed: {}", dearer.join("; ")));
        say(
            "where that is meant, `cargo run --release -p haptograph-instructions -- --keep` keeps the new counts",
        );
    }
    match failed || !(keep || dearer.is_empty()) {
        true => ExitCode::FAILURE,
        false => ExitCode::SUCCESS,
    }
}

/// The compiler of this program, and the instruction set under valgrind.
fn here() -> Option<String> {
    let output = Command::new("valgrind")
        .arg("--tool=none")
        .arg(std::env::current_exe().ok()?)
        .arg("--set")
        .output()
        .ok()?;
    let set = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    let compiler = Command::new(option_env!("RUSTC").unwrap_or("rustc")).arg("--version").output().ok()?;
    let compiler = String::from_utf8_lossy(&compiler.stdout).into_owned();
    Some(format!("rustc {} {set}", compiler.split_whitespace().nth(1)?))
}

/// The instructions within `works::counted`, and the misses of its data in both caches.
fn count(name: &str, has_misses: bool) -> Option<Vec<u64>> {
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--tool=callgrind", "--callgrind-out-file=/dev/null", "--toggle-collect=*works*counted*"]);
    if has_misses {
        valgrind.args(CACHES);
    }
    let output = valgrind.arg(std::env::current_exe().ok()?).args(["--run", name]).output().ok()?;
    output.status.success().then_some(())?;
    let report = String::from_utf8_lossy(&output.stderr);
    let line = report.lines().find_map(|line| line.split("Collected :").nth(1))?;
    let counts: Vec<u64> = line.split_whitespace().flat_map(str::parse).collect();
    let at = |place: usize| counts.get(place).copied().unwrap_or(0);
    // Ir Dr Dw I1mr D1mr D1mw ILmr DLmr DLmw; zeros at the end are left out.
    let misses = || [at(4) + at(5), at(7) + at(8)];
    (at(0) > 0).then(|| std::iter::once(at(0)).chain(has_misses.then(misses).into_iter().flatten()).collect())
}
