//! Lines that are there are found, and no others.

use super::*;
use crate::learn::law::{LawSettings, fit_law};
use crate::recording::tests::synthetic::{drag, provenance};
use crate::recording::{Gesture, Signals};
use haptograph_signal::spectrum::welch;
use haptograph_signal::window::Window as Taper;
use haptograph_surfaces::layers::lines::SpatialLine;
use haptograph_surfaces::rendering::{SynthesisSettings, synthesise};
use std::f64::consts::TAU;

const RATE_HZ: f64 = 10_000.0;

fn settings() -> LawSettings {
    LawSettings { highpass_hz: None, ..LawSettings::default() }
}

/// Ten seconds of a hand that goes faster and slower, by `ratio` from end to end, and presses more and less.
fn path(ratio: f64) -> (Vec<f64>, Vec<f64>) {
    let at = |n: usize, turns_hz: f64| (TAU * turns_hz * n as f64 / RATE_HZ).sin();
    let speed = |n: usize| 0.1 * ratio.powf(0.5 * (0.7 * at(n, 0.31) + 0.3 * at(n, 0.83)));
    let force = |n: usize| 1.0 + 0.5 * at(n, 0.23);
    (0..100_000).map(|n| (speed(n), force(n))).unzip()
}

/// Noise that grows with speed and force, less below 300 Hz than about it.
fn noise(seed: u64, speeds: &[f64], forces: &[f64]) -> Vec<f64> {
    let white = drag(&[(10.0, 0.1, 1.0)], 0.3, seed, |_, _| (vec![-1.72, 0.81], 1.0));
    let level = speeds.iter().zip(forces).map(|(v, f)| 20.0 * v * f.sqrt());
    let white = &white.signals().acceleration_m_s2;
    white.iter().zip(level).map(|(e, level)| e * level).collect()
}

fn recording(
    acceleration_m_s2: Vec<f64>,
    speed_m_s: Vec<f64>,
    force_normal_n: Vec<f64>,
) -> ProcessedRecording {
    let signals =
        Signals { rate_hz: RATE_HZ, acceleration_m_s2, force_normal_n, speed_m_s, ..Signals::default() };
    ProcessedRecording::new(signals, Gesture::Drag, provenance()).expect("a recording")
}

/// Noise and sines: of a number of cycles a metre, or of a frequency.
fn made(seed: u64, ratio: f64, per_m: &[f64], fixed_hz: &[f64]) -> ProcessedRecording {
    let (speeds, forces) = path(ratio);
    let mut y = noise(seed, &speeds, &forces);
    let mut way = 0.0;
    for (n, (y, speed)) in y.iter_mut().zip(&speeds).enumerate() {
        way += speed / RATE_HZ;
        let in_space: f64 = per_m.iter().map(|k| (TAU * k * way).sin()).sum();
        let in_time: f64 = fixed_hz.iter().map(|f| (TAU * f * n as f64 / RATE_HZ).sin()).sum();
        *y += 20.0 * speed * in_space + 3.0 * in_time;
    }
    recording(y, speeds, forces)
}

/// A correction would follow the lines.
fn uncorrected(recordings: &[ProcessedRecording], settings: &LawSettings) -> TextureModel {
    let (fitted, _) = fit_law(recordings, settings, &|_| ()).expect("a law");
    fitted.texture().expect("a map")
}

fn found(recording: &ProcessedRecording) -> Vec<FoundLine> {
    let recordings = std::slice::from_ref(recording);
    let texture = uncorrected(recordings, &settings());
    let whitened = [Whitened::new(recording, &texture, 0.005, 0.05)];
    find_lines(recordings, &whitened, &texture)
}

#[test]
fn lines_in_space_are_found_with_their_power() {
    let lines = found(&made(1, 4.0, &[900.0, 2300.0], &[]));
    for wanted in [900.0, 2300.0] {
        let line = lines.iter().find(|line| (line.cycles_per_m - wanted).abs() < 0.5 / WINDOW_M);
        let line = line.unwrap_or_else(|| panic!("{wanted} is not among {lines:?}"));
        for speed_m_s in [0.06, 0.1, 0.18] {
            let off = 10.0 * (line.power_at(speed_m_s, 1.0) / (0.5 * (20.0 * speed_m_s).powi(2))).log10();
            assert!(off.abs() < 2.0, "{off} dB at {speed_m_s} m/s of {line:?}");
        }
        // A period that is exact keeps its phase over a window at least.
        assert!(line.diffusion_rad2_per_m < 2.0 / WINDOW_M, "{line:?}");
    }
    assert!(lines.len() <= 3);
}

#[test]
fn a_line_fixed_in_frequency_is_none_in_space() {
    assert!(found(&made(2, 4.0, &[], &[120.0])).is_empty());
}

#[test]
fn noise_has_no_lines_and_one_speed_tells_of_none() {
    let false_alarms = (0..4).filter(|seed| !found(&made(10 + seed, 4.0, &[], &[])).is_empty());
    assert!(false_alarms.count() <= 1);
    assert!(found(&made(3, 1.2, &[900.0], &[])).is_empty());
}

#[test]
#[ignore = "forty seeds, to be read and not only passed"]
#[expect(clippy::print_stdout, reason = "it is there to be read")]
fn of_forty_recordings_without_lines_one_at_most_has_one() {
    for fixed_hz in [&[][..], &[120.0], &[35.0]] {
        let with_lines = (0..40).filter(|seed| {
            let lines = found(&made(100 + seed, 4.0, &[], fixed_hz));
            if !lines.is_empty() {
                println!("seed {seed}: {lines:?}");
            }
            !lines.is_empty()
        });
        let count = with_lines.count();
        println!("beside {fixed_hz:?} Hz: {count} of 40");
        // Under 5 %.
        assert!(count <= 1);
    }
}

/// Coherence of a walking phase: of its variance, and what is played of it is found again.
#[test]
fn what_is_rendered_of_a_line_is_learned_again() {
    let (speed_m_s, force_n) = path(4.0);
    let plain = recording(noise(5, &speed_m_s, &force_n), speed_m_s, force_n);
    let texture = uncorrected(std::slice::from_ref(&plain), &settings());
    let powers = texture.models().iter().map(|at| {
        let rests = at.speed_m_s == 0.0 || at.force_n == 0.0;
        if rests { 0.0 } else { 0.5 * (30.0 * at.speed_m_s).powi(2) * at.force_n }
    });
    let line = SpatialLine::new(1500.0, 20.0, powers.collect()).expect("sound");
    let texture = texture.with_lines(vec![line]).expect("one line");
    let trajectory = plain.trajectory();
    let played = synthesise(&texture, &trajectory, &SynthesisSettings::default()).expect("one rate");
    let again = recording(played, trajectory.speed_m_s, trajectory.force_n);
    let lines = found(&again);
    let line = lines.first().expect("a line");
    assert!((line.cycles_per_m / 1500.0 - 1.0).abs() < 0.01, "{line:?}");
    assert!((5.0..60.0).contains(&line.diffusion_rad2_per_m), "{line:?}");
    let off = 10.0 * (line.power_at(0.1, 1.0) / 4.5).log10();
    assert!(off.abs() < 2.0, "{off} dB of {line:?}");
}

#[test]
fn removal_leaves_the_noise() {
    // Five of one place in a row: a line that is four times as strong as the noise around it.
    let whole = made(6, 4.0, &[900.0; 5], &[]);
    let (speeds, forces) = path(4.0);
    let noise = recording(noise(6, &speeds, &forces), speeds, forces);
    let texture = uncorrected(std::slice::from_ref(&whole), &settings());
    let whitened = [Whitened::new(&whole, &texture, 0.005, 0.05)];
    let lines = find_lines(std::slice::from_ref(&whole), &whitened, &texture);
    let cleaned = without_lines(std::slice::from_ref(&whole), &whitened, &lines);
    let power = |recording: &ProcessedRecording, low: f64, high: f64| {
        let y = &recording.vibration_m_s2();
        welch(y, RATE_HZ, 2000, 1000, Taper::Hann).expect("long enough").power_between(low, high)
    };
    for (low, high) in [(20.0, 45.0), (45.0, 90.0), (90.0, 180.0), (180.0, 400.0), (400.0, 900.0)] {
        let db = |recording: &ProcessedRecording| {
            10.0 * (power(recording, low, high) / power(&noise, low, high)).log10()
        };
        let (before, after) = (db(&whole), db(&cleaned[0]));
        assert!(after.abs() < 1.0f64.max(0.25 * before), "{low} to {high} Hz: {before} then {after} dB");
    }
    assert!(power(&whole, 45.0, 180.0) > 3.0 * power(&noise, 45.0, 180.0));
}

/// Pressures of a robot's finger on fabrics (FabricSlide, Wang and others 2022; `FABRIC_DIR` names its folder of one fabric's
/// CSV files' parent).
#[test]
#[ignore = "needs the data set and a minute"]
#[expect(clippy::print_stdout, reason = "it is there to be read")]
fn the_fabrics_lines_are_found() {
    let Some(folder) = std::env::var_os("FABRIC_DIR") else {
        println!("FABRIC_DIR is not set");
        return;
    };
    let law = LawSettings { highpass_hz: Some(2.0), min_force_n: 0.01, ..LawSettings::default() };
    for (fabric, wanted_per_m) in [("Canvas", 340.0), ("WovenFabric", 920.0)] {
        let recordings = fabric_slides(std::path::Path::new(&folder), fabric);
        let texture = uncorrected(&recordings, &law);
        let whitened: Vec<_> = recordings.iter().map(|r| Whitened::new(r, &texture, 0.005, 0.01)).collect();
        let lines = find_lines(&recordings, &whitened, &texture);
        for line in &lines {
            println!("{fabric}: {:.1} cycles/m, {:.1} rad2/m", line.cycles_per_m, line.diffusion_rad2_per_m);
        }
        let is_found = lines.iter().any(|line| (line.cycles_per_m - wanted_per_m).abs() < 15.0);
        assert!(is_found, "{fabric}");
    }
}

/// A take for each taxel of each slide, its level and drift taken out, at 356 Hz; the force is nominal.
fn fabric_slides(folder: &std::path::Path, fabric: &str) -> Vec<ProcessedRecording> {
    let mut files: Vec<_> =
        std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").path()).collect();
    files.sort();
    let mut takes = vec![];
    for file in files {
        let name = file.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let parts: Vec<&str> = name.split('_').collect();
        let [material, force, speed, _] = parts[..] else {
            continue;
        };
        if material != fabric {
            continue;
        }
        let force_n: f64 = force.trim_start_matches('F').parse::<f64>().expect("a force") / 100.0;
        let speed: f64 = speed.trim_start_matches('V').trim_end_matches("mmps").parse().expect("a speed");
        let text = std::fs::read_to_string(&file).expect("text");
        let rows: Vec<Vec<f64>> = text
            .lines()
            .skip(1)
            .map(|line| line.split(',').filter_map(|cell| cell.trim().parse().ok()).collect())
            .collect();
        let rows = &rows[rows.len() * 6 / 100..rows.len() * 97 / 100];
        for taxel in 3..19 {
            let values: Vec<f64> = rows.iter().map(|row| row[taxel]).collect();
            let highpass = haptograph_signal::filter::butterworth_highpass(2, 2.0, 356.0).expect("a filter");
            let mean = haptograph_signal::statistics::mean(&values);
            let level: Vec<f64> = values.iter().map(|x| x - mean).collect();
            let signals = Signals {
                rate_hz: 356.0,
                acceleration_m_s2: haptograph_signal::filter::filtfilt(&highpass, level),
                force_normal_n: vec![force_n; rows.len()],
                speed_m_s: vec![speed.abs() / 1000.0; rows.len()],
                ..Signals::default()
            };
            takes.extend(ProcessedRecording::new(signals, Gesture::Drag, provenance()));
        }
    }
    takes
}
