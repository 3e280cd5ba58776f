//! The engine beside other graph engines and a loop written by hand, on the same work.
//!
//! `cargo run --release --manifest-path benches/peers/Cargo.toml [-- --strict] [--without-avx512] [CASE..]`
//!
//! Outputs are compared before anything is timed. Then the contestants run in turn, round after round, and the
//! median of the rounds' processor times is shown, a node and a sample. Times move with the machine; the ratios
//! hardly do. With `--strict` a missed bar makes the program fail. Faust's compiled code takes part where `faust` and `gcc` are
//! installed; as it is compiled for this processor, `--without-avx512` compiles it for one with AVX2 too.

mod dasp;
mod faust;
mod net;
mod ours;
mod plain;
mod work;

use cpu_time::ThreadTime;
use faust::Rounding;
use std::process::ExitCode;
use std::time::Duration;
use work::{Contestant, SAMPLES, Work, noise};

const ROUNDS: usize = 31;
/// A contestant's least share of a round, so that the clock's own cost does not count.
const SHARE: Duration = Duration::from_millis(4);

struct Case {
    name: &'static str,
    what: &'static str,
    work: Work,
    /// The most that ours may cost, in terms of fundsp's `Net`.
    bar: f64,
    /// How far outputs in f32 may be from ours, in terms of the largest sample.
    tolerance: f64,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let strict = arguments.iter().any(|argument| argument == "--strict");
    let wanted: Vec<&String> = arguments.iter().filter(|argument| !argument.starts_with("--")).collect();
    let without_avx512 = arguments.iter().any(|argument| argument == "--without-avx512");
    if without_avx512 {
        haptograph_signal::instructions::turn_avx512_off();
    }
    let mut kept = true;
    println!(
        "CPU time in ns a node and a sample, median of {ROUNDS} interleaved rounds; ours and Faust's in f64, the others' as they are (f32)."
    );
    for case in cases() {
        if wanted.is_empty() || wanted.iter().any(|name| *name == case.name) {
            kept &= compare(&case, without_avx512);
        }
    }
    if wanted.is_empty() {
        kept &= set_up();
    }
    if strict && !kept { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

fn cases() -> [Case; 4] {
    [
        Case {
            name: "A",
            what: "chain of 100 gains and offsets, block 64",
            work: Work::gains_and_offsets(100, 64),
            bar: 0.25,
            tolerance: 1e-4,
        },
        Case {
            name: "B",
            what: "chain of 100 biquads, block 64",
            work: Work::biquads(100, 64),
            bar: 0.35,
            tolerance: 1e-3,
        },
        Case {
            name: "C",
            what: "random graph of 1000 gains, block 64",
            work: Work::random_gains(1000, 64, 7),
            bar: 0.28,
            tolerance: 1e-4,
        },
        Case {
            name: "D",
            what: "chain of 10 gains and offsets, block 1",
            work: Work::gains_and_offsets(10, 1),
            bar: 0.5,
            tolerance: 1e-4,
        },
    ]
}

/// Compares outputs, then times; is the bar kept?
fn compare(case: &Case, without_avx512: bool) -> bool {
    let input = noise(SAMPLES);
    let mut contestants: Vec<Box<dyn Contestant>> = vec![
        Box::new(ours::Ours::new(&case.work)),
        Box::new(net::InNet::new(&case.work, &input)),
        Box::new(plain::ByHand::new(&case.work, &input)),
    ];
    if let Some(dasp) = dasp::InDasp::new(&case.work, &input) {
        contestants.push(Box::new(dasp));
    }
    for rounding in [Rounding::Strict, Rounding::Fast] {
        if let Some(faust) = faust::InFaust::new(&case.work, &input, rounding, without_avx512) {
            contestants.push(Box::new(faust));
        }
    }
    println!("\n{}  {}, {} edges", case.name, case.what, case.work.edges());
    if !agree(&mut contestants, case.tolerance) {
        return false;
    }
    let per_run = (case.work.nodes.len() * SAMPLES) as f64;
    let times_ns: Vec<f64> = medians(&mut contestants).iter().map(|time| time / per_run).collect();
    for (contestant, time_ns) in contestants.iter().zip(&times_ns) {
        let ratio = times_ns[0] / time_ns;
        println!("   {:<12} {time_ns:7.3} ns   haptograph / it {ratio:6.3}", contestant.name());
    }
    let ratio = times_ns[0] / times_ns[1];
    let verdict = if ratio <= case.bar { "PASS" } else { "MISSED" };
    println!("   {verdict}: {ratio:.3} of fundsp Net, bar {}", case.bar);
    ratio <= case.bar
}

/// Times what happens once, before a run: reading and checking a file, planning. Are the bars kept?
fn set_up() -> bool {
    let work = Work::random_gains(1000, 64, 7);
    let text = ours::text(&work);
    let graph = ours::load(&text);
    println!(
        "\nGraph of {} nodes and {} edges, CPU time in ms, median of {ROUNDS}",
        work.nodes.len(),
        work.edges()
    );
    let planned = median_ms("plan", 0.8, || drop(ours::plan(&graph, &work)));
    let loaded = median_ms("load and check", 5.0, || drop(ours::load(&text)));
    planned && loaded
}

fn median_ms(what: &str, bar_ms: f64, mut task: impl FnMut()) -> bool {
    let mut times_ms: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let start = ThreadTime::now();
            task();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times_ms.sort_by(f64::total_cmp);
    let time_ms = times_ms[ROUNDS / 2];
    let verdict = if time_ms <= bar_ms { "PASS" } else { "MISSED" };
    println!("   {verdict}: {what:<15} {time_ms:7.3} ms, bar {bar_ms} ms");
    time_ms <= bar_ms
}

/// Runs all twice, so that states are compared too.
fn agree(contestants: &mut [Box<dyn Contestant>], tolerance: f64) -> bool {
    for contestant in contestants.iter_mut() {
        contestant.run();
        contestant.run();
    }
    let reference = contestants[0].output();
    let peak = reference.iter().fold(0.0_f64, |peak, y| peak.max(y.abs()));
    let mut same = peak.is_finite() && peak > 1e-3;
    for contestant in &contestants[1..] {
        let output = contestant.output();
        let worst = output.iter().zip(&reference).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
        // NaN agrees with nothing.
        if output.iter().any(|y| y.is_nan()) || worst > tolerance * peak {
            println!(
                "   {} puts out something else: {worst:.3e} off, at a peak of {peak:.3e}",
                contestant.name()
            );
            same = false;
        }
    }
    same
}

/// Median CPU time of a run of each, ns.
fn medians(contestants: &mut [Box<dyn Contestant>]) -> Vec<f64> {
    let repeats: Vec<u32> = contestants.iter_mut().map(|contestant| repeats(&mut **contestant)).collect();
    let mut times = vec![Vec::new(); contestants.len()];
    for _ in 0..ROUNDS {
        for (index, contestant) in contestants.iter_mut().enumerate() {
            times[index]
                .push(time(&mut **contestant, repeats[index]).as_nanos() as f64 / f64::from(repeats[index]));
        }
    }
    times
        .iter_mut()
        .map(|times| {
            times.sort_by(f64::total_cmp);
            times[ROUNDS / 2]
        })
        .collect()
}

fn time(contestant: &mut dyn Contestant, repeats: u32) -> Duration {
    let start = ThreadTime::now();
    for _ in 0..repeats {
        contestant.run();
    }
    start.elapsed()
}

fn repeats(contestant: &mut dyn Contestant) -> u32 {
    let mut repeats = 1;
    while time(contestant, repeats) < SHARE {
        repeats *= 2;
    }
    repeats
}
