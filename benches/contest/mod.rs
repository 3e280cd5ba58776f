//! Contenders for the same work, timed in turns: what else the machine does falls on all of them alike. Part of the benches of
//! several crates, which include it by its path.

use std::time::Instant;

/// What the contenders do.
#[derive(Debug, Clone, Copy)]
pub struct Work<'a> {
    /// For the heading.
    pub title: &'a str,
    /// What times are given for, such as `sample`.
    pub unit: &'a str,
    /// How many of these one run does.
    pub units: usize,
    /// Runs of each contender; the median counts.
    pub turns: usize,
}

/// Prints the time a unit takes and how many times faster each contender is than the first. Gives the times, ns.
#[expect(clippy::print_stdout, reason = "a bench reports")]
pub fn compare(work: Work, contenders: &mut [(&str, &mut dyn FnMut())]) -> Vec<f64> {
    let mut times = vec![Vec::with_capacity(work.turns); contenders.len()];
    for _ in 0..work.turns {
        for ((_, run), times) in contenders.iter_mut().zip(&mut times) {
            let start = Instant::now();
            run();
            times.push(start.elapsed().as_secs_f64() * 1e9 / work.units as f64);
        }
    }
    let median = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[work.turns / 2]
    };
    let medians: Vec<f64> = times.iter_mut().map(median).collect();
    println!("{}", work.title);
    for ((name, _), ns) in contenders.iter().zip(&medians) {
        let (value, prefix) = match *ns {
            ns if ns < 1e4 => (ns, "ns"),
            ns if ns < 1e7 => (ns / 1e3, "us"),
            ns => (ns / 1e6, "ms"),
        };
        let ratio = medians[0] / ns;
        println!("  {name:44} {value:10.3} {prefix} a {}   {ratio:7.2} x", work.unit);
    }
    medians
}
