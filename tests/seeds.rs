//! The seeds of all fuzz targets, inputs that once broke something among them, run as the fuzzer runs them; and a bounded
//! share of inputs that are seeds with changes, made blindly.
#![allow(clippy::print_stdout)] // Which input it was, if one fails.

// What is fuzzed is no member of the workspace, as it needs a fuzzer.
#[path = "../fuzz/src/lib.rs"]
mod fuzz;

use std::fs;
use std::ops::Range;
use std::panic::catch_unwind;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// By their names, in order.
fn seeds(target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds").join(target);
    let files = fs::read_dir(folder).unwrap_or_else(|error| panic!("{target}: {error}"));
    let seed = |file: std::io::Result<fs::DirEntry>| {
        let path = file.expect("a file").path();
        let bytes = fs::read(&path).expect("it can be read");
        (path.display().to_string(), bytes)
    };
    let mut seeds: Vec<_> = files.map(seed).collect();
    seeds.sort();
    seeds
}

#[test]
fn every_fuzz_target_stands_its_seeds_and_accepts_and_refuses_some() {
    for (name, target) in fuzz::TARGETS {
        let is_accepted = |(path, bytes): (String, Vec<u8>)| {
            println!("{path}");
            let is_accepted = target(&bytes);
            println!("accepted: {is_accepted}");
            is_accepted
        };
        let accepted: Vec<bool> = seeds(name).into_iter().map(is_accepted).collect();
        assert!(accepted.contains(&true) && accepted.contains(&false), "{name}: {accepted:?}");
    }
}

/// Numbers below some bound, one after the other.
struct Dice(u64);

impl Dice {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = (self.0.wrapping_mul(6_364_136_223_846_793_005)).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % bound.max(1)
    }
}

const WORDS: [&[u8]; 12] = [
    b"0",
    b"-1",
    b"1e308",
    b"NaN",
    b"\xff\xff\xff\xff",
    b"\0\0\0\x80",
    b"(",
    b"}",
    b",",
    b"\"",
    b"\n",
    b"18446744073709551616",
];

/// Finite numbers far beyond what a file may hold, as a dictionary of the fuzzer: one in quotes on each line.
const EXTREMES: &str = include_str!("../fuzz/extremes.dict");

/// The place of a number at or after `at`, and an extreme one for it; among bytes that are no text, the extreme as a double.
fn extreme(bytes: &[u8], at: usize, dice: &mut Dice) -> (Range<usize>, Vec<u8>) {
    let extremes: Vec<&str> =
        EXTREMES.lines().filter_map(|line| line.strip_prefix('"')?.strip_suffix('"')).collect();
    let extreme = extremes[dice.below(extremes.len())];
    if bytes.contains(&0) && dice.below(2) == 0 {
        let number = extreme.parse::<f64>().expect("a number");
        return (at..(at + 8).min(bytes.len()), number.to_le_bytes().to_vec());
    }
    let is_part = |byte: &u8| byte.is_ascii_digit() || b".-e".contains(byte);
    let Some(digit) = bytes[at..].iter().position(u8::is_ascii_digit) else {
        return (at..at, Vec::new());
    };
    let before = bytes[..at + digit].iter().rev().take_while(|byte| is_part(byte)).count();
    let after = bytes[at + digit..].iter().take_while(|byte| is_part(byte)).count();
    (at + digit - before..at + digit + after, extreme.as_bytes().to_vec())
}

/// A seed with one to four changes: digits, numbers, bytes, words and passages.
fn mutated(seeds: &[(String, Vec<u8>)], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = seeds[dice.below(seeds.len())].1.clone();
    for _ in 0..=dice.below(4) {
        let at = dice.below(bytes.len());
        let end = (at + dice.below(40)).min(bytes.len());
        let other = &seeds[dice.below(seeds.len())].1;
        let from = dice.below(other.len());
        let (replaced, with) = match dice.below(8) {
            7 => extreme(&bytes, at, dice),
            6 => match bytes[at..].iter().position(u8::is_ascii_digit) {
                Some(digit) => (at + digit..at + digit + 1, vec![b'0' + dice.below(10) as u8]),
                None => (at..at, Vec::new()),
            },
            0 => (at..(at + 1).min(bytes.len()), vec![dice.below(256) as u8]),
            1 => (at..end, Vec::new()),
            2 => (at..bytes.len(), Vec::new()),
            3 => (at..at, bytes[at..end].to_vec()),
            4 => (at..end, other[from..(from + end - at).min(other.len())].to_vec()),
            _ => (at..end.min(at + 4), WORDS[dice.below(WORDS.len())].to_vec()),
        };
        bytes.splice(replaced, with).for_each(drop);
    }
    bytes
}

/// How long a target is given changed seeds.
#[derive(Clone, Copy)]
enum Turn {
    Inputs(usize),
    Seconds(f64),
}

/// Gives a target changed seeds. What it accepts is changed further, so that changes add up.
fn mutate((name, target): fuzz::Target, turn: Turn, seed: u64) {
    let (mut pool, mut dice) = (seeds(name), Dice(seed));
    let (given, begun) = (pool.len(), Instant::now());
    let (mut inputs, mut accepted) = (0, 0);
    let goes_on = |inputs| match turn {
        Turn::Inputs(most) => inputs < most,
        Turn::Seconds(most) => begun.elapsed().as_secs_f64() < most,
    };
    while goes_on(inputs) {
        let input = mutated(&pool, &mut dice);
        let is_accepted = catch_unwind(|| target(&input)).unwrap_or_else(|_| {
            panic!("{name}, seed {seed}, input {inputs}: \"{}\"", input.escape_ascii());
        });
        inputs += 1;
        if is_accepted && input.len() <= 100_000 {
            accepted += 1;
            match pool.len() < given + 1000 {
                true => pool.push((String::new(), input)),
                false => pool[given + dice.below(1000)].1 = input,
            }
        }
    }
    let took_s = begun.elapsed().as_secs_f64();
    println!("{name}: {accepted} of {inputs} accepted, {took_s:.1} s");
}

/// All targets, two at a time.
fn mutate_all(turn: Turn, seed: u64) {
    let next = AtomicUsize::new(0);
    let work = || {
        while let Some(target) = fuzz::TARGETS.get(next.fetch_add(1, Ordering::Relaxed)) {
            mutate(*target, turn, seed);
        }
    };
    std::thread::scope(|scope| {
        let other = scope.spawn(work);
        work();
        other.join().expect("it stood all");
    });
}

#[test]
fn every_fuzz_target_stands_seeds_with_changes() {
    mutate_all(Turn::Inputs(300), 1);
}

/// `FUZZ_SECONDS` (10) is how long each target is fuzzed, and `FUZZ_SEED` (2) decides about the changes.
#[test]
#[ignore = "as long as it is told to, by default a minute"]
fn every_fuzz_target_stands_changes_for_long() {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse().expect(name));
    let seconds = number("FUZZ_SECONDS").unwrap_or(10);
    mutate_all(Turn::Seconds(seconds as f64), number("FUZZ_SEED").unwrap_or(2));
}
