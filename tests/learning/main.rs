//! Recordings, surfaces and signals, as users of the program handle them.

#![allow(clippy::unwrap_used)] // in helpers, clippy does not see that these are tests

mod compare;
mod export;
mod learn;
mod loggers;
mod mistakes;
mod scale;
mod surfaces;

use serde_json::Value;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

/// Runs the program with something on its standard input.
fn haptograph(folder: &Path, arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_haptograph"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    // A program that fails early does not read.
    let _ = child.stdin.take().expect("it is piped").write_all(input.as_bytes());
    child.wait_with_output().expect("the program ends")
}

fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let output = haptograph(folder, arguments, "");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    serde_json::from_str(&succeed(folder, arguments)).expect("it is JSON")
}

fn fail(folder: &Path, arguments: &[&str]) -> String {
    let output = haptograph(folder, arguments, "");
    assert_eq!(output.status.code(), Some(1), "{arguments:?}");
    told_by(&output)
}

/// What a command says of its failure: on standard error, or as JSON on standard output.
fn told_by(output: &std::process::Output) -> String {
    let both = [&output.stderr[..], &output.stdout[..]].concat();
    String::from_utf8_lossy(&both).into_owned()
}

/// White noise, the same on every machine.
fn noise(samples: usize, seed: u64) -> Vec<f64> {
    let mut source = haptograph::signal::noise::Gaussian::new(seed);
    (0..samples).map(|_| source.next_sample()).collect()
}

/// A WAV file of one channel of floats, by another writer than ours.
fn wav(path: &Path, rate_hz: u32, samples: impl IntoIterator<Item = f64>) {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: rate_hz,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    for sample in samples {
        writer.write_sample(sample as f32).unwrap();
    }
    writer.finalize().unwrap();
}

/// A column of numbers as a CSV file.
fn column(path: &Path, name: &str, values: &[f64]) {
    let rows: String = values.iter().map(|value| format!("{value}\n")).collect();
    fs::write(path, format!("{name}\n{rows}")).unwrap();
}

/// A folder with simulated recordings of two materials and a surface learned from all gestures, made once.
fn workshop() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    FOLDER
        .get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            let simulate = |material: &str, motion: &str, person: &str, seed: &str, file: &str| {
                let arguments =
                    ["simulate-recording", "--material", material, "--motion", motion, "--person", person];
                // Taps are more than a second apart.
                let seconds = if motion == "tap" { "8" } else { "4" };
                let arguments =
                    [&arguments[..], &["--seconds", seconds, "--seed", seed, "-o", file]].concat();
                succeed(folder.path(), &arguments);
            };
            fs::create_dir(folder.path().join("study")).unwrap();
            for material in ["T1", "T3"] {
                for (take, seed) in [("1", "11"), ("2", "12")] {
                    simulate(material, "drag", "1", seed, &format!("study/{material}.anna.{take}.npz"));
                }
                simulate(material, "drag", "2", "13", &format!("study/{material}.ben.1.npz"));
            }
            for motion in ["circle", "tap", "press"] {
                simulate("T1", motion, "1", "11", &format!("{motion}.npz"));
            }
            let all = ["learn", "study/T1.anna.1.npz", "circle.npz", "tap.npz", "press.npz"];
            succeed(folder.path(), &[&all[..], &["-o", "t1.ron", "--report", "page"]].concat());
            folder
        })
        .path()
}
