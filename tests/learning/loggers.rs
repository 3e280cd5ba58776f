//! Studies of files that other people's loggers wrote.

use super::{fail, haptograph, json, noise};
use std::fs;
use std::path::Path;

const RATE_HZ: usize = 2000;

/// Vibration, m/s², force, N, and speed, mm/s, of a drag: noise above 20 Hz that grows with speed and force.
fn drag(seconds: usize, seed: u64) -> Vec<(f64, f64, f64)> {
    let noise = noise(seconds * RATE_HZ + 2, seed);
    let row = |i: usize| {
        let time = i as f64 / RATE_HZ as f64;
        let (force, speed) = (1.2 + 0.7 * (time * 2.0).sin(), 110.0 + 70.0 * (time * 3.1).sin());
        // The second difference is small at low frequencies.
        let bright = noise[i] - 1.6 * noise[i + 1] + 0.64 * noise[i + 2];
        (bright * force.sqrt() * speed / 100.0, force, speed)
    };
    (0..seconds * RATE_HZ).map(row).collect()
}

fn table(folder: &Path, name: &str, rows: &[(f64, f64, f64)], offset: f64) {
    let lines: String = { rows.iter() }.map(|(a, f, v)| format!("{},{f},{v}\n", a + offset)).collect();
    let head = format!("# rate_hz: {RATE_HZ}\naccel_m_s2,force_normal_n,speed_mm_s\n");
    fs::write(folder.join(name), head + &lines).unwrap();
}

/// A vibration with an offset, m/s², of which 1.0 in the file is 50.
fn wav(folder: &Path, name: &str, rows: &[(f64, f64, f64)], offset: f64) {
    let samples = rows.iter().map(|row| (row.0 + offset) / 50.0);
    super::wav(&folder.join(name), RATE_HZ as u32, samples);
    let note = folder.join(format!("{name}.ron"));
    fs::write(note, "Recording(full_scale: 50.0)").unwrap();
}

/// The held-out distance, dB, of the first method of each split.
fn held_out(folder: &Path, study: &str) -> Vec<f64> {
    let found = json(folder, &["evaluate", study, "--holdout", "--json"]);
    let splits = found["splits"].as_array().unwrap();
    let distance = |split: &serde_json::Value| split["methods"][0]["lsd_db"]["mean"].as_f64().unwrap();
    splits.iter().map(distance).collect()
}

#[test]
fn gravity_changes_no_held_out_figure() {
    let folder = tempfile::tempdir().unwrap();
    for (study, offset) in [("clean", 0.0), ("heavy", 9.81)] {
        fs::create_dir(folder.path().join(study)).unwrap();
        table(folder.path(), &format!("{study}/oak.me.1.csv"), &drag(6, 1), offset);
    }
    let heavy = haptograph(folder.path(), &["learn", "heavy/oak.me.1.csv", "-o", "heavy.ron"], "");
    let said = String::from_utf8_lossy(&heavy.stderr);
    assert!(said.contains("9.81 m/s²") && said.contains("high-passed at 20 Hz"), "{said}");
    let (clean, heavy) = (held_out(folder.path(), "clean"), held_out(folder.path(), "heavy"));
    assert!(!clean.is_empty() && clean.len() == heavy.len());
    for (clean, heavy) in clean.iter().zip(&heavy) {
        assert!((clean - heavy).abs() < 0.2, "{clean} dB, {heavy} dB with gravity");
    }
}

#[test]
fn gravity_in_a_wav_file_changes_no_comparison() {
    let folder = tempfile::tempdir().unwrap();
    let rows = drag(3, 3);
    table(folder.path(), "clean.csv", &rows, 0.0);
    for (name, offset) in [("clean.wav", 0.0), ("heavy.wav", 9.81)] {
        wav(folder.path(), name, &rows, offset);
    }
    let figure =
        |wav: &str| json(folder.path(), &["compare", "clean.csv", wav, "--json"])["lsd_db"].as_f64().unwrap();
    let (clean, heavy) = (figure("clean.wav"), figure("heavy.wav"));
    assert!(clean < 0.01 && heavy < 1.0, "{clean} dB, {heavy} dB");
    let error = fail(folder.path(), &["compare", "clean.csv", "heavy.wav", "--strict"]);
    assert!(error.contains("--strict"), "{error}");
}

#[test]
fn files_of_one_take_are_one_recording_of_a_study() {
    let folder = tempfile::tempdir().unwrap();
    let rows = drag(6, 2);
    for study in ["whole", "wav", "two", "half"] {
        fs::create_dir(folder.path().join(study)).unwrap();
    }
    table(folder.path(), "whole/brick.me.1.csv", &rows, 0.0);
    let column = |name: &str, head: &str, line: &dyn Fn(&(f64, f64, f64)) -> String| {
        let lines: String = rows.iter().map(line).collect();
        fs::write(folder.path().join(name), format!("# rate_hz: {RATE_HZ}\n{head}\n{lines}")).unwrap();
    };
    let motion = |row: &(f64, f64, f64)| format!("{},{}\n", row.1, row.2);
    let accel = |row: &(f64, f64, f64)| format!("{}\n", row.0);
    column("wav/brick.me.1.csv", "force_normal_n,speed_mm_s", &motion);
    column("two/brick.me.1.motion.csv", "force_normal_n,speed_mm_s", &motion);
    column("two/brick.me.1.csv", "accel_m_s2", &accel);
    column("half/brick.me.1.csv", "accel_m_s2", &accel);
    wav(folder.path(), "wav/brick.me.1.wav", &rows, 0.0);
    let whole = held_out(folder.path(), "whole");
    for study in ["two", "wav"] {
        let joined = held_out(folder.path(), study);
        assert_eq!(joined.len(), whole.len(), "{study}");
        for (joined, whole) in joined.iter().zip(&whole) {
            assert!((joined - whole).abs() < 1e-3, "{study}: {joined} dB of {whole} dB");
        }
    }
    let error = fail(folder.path(), &["evaluate", "half", "--holdout"]);
    assert!(error.contains("brick.me.1.motion.csv"), "{error}");
}

/// What a person types first is refused with what to type, and that is read: three axes, one normal force and a position.
#[test]
fn a_table_of_three_axes_a_normal_force_and_a_position_is_learned_from() {
    let folder = tempfile::tempdir().unwrap();
    let mut way_mm = 0.0;
    let rows = drag(6, 3);
    let lines: String = { rows.iter().enumerate() }
        .map(|(i, (a, f, v))| {
            way_mm += v / RATE_HZ as f64;
            let (time_s, g) = (i as f64 / RATE_HZ as f64, a / 9.80665);
            format!("{time_s},{},{},{},{f},{way_mm}\n", 0.6 * g, 0.8 * g, 1.0)
        })
        .collect();
    let head = "Zeit [s],ax [g],ay [g],az [g],Fz [N],pos_x [mm]\n";
    fs::write(folder.path().join("log.csv"), head.to_owned() + &lines).unwrap();
    let learn = ["learn", "log.csv", "-o", "felt.ron"];
    let told = fail(folder.path(), &learn);
    let flags = [r#"--column force_normal="Fz [N]""#, r#"--column time="Zeit [s]""#];
    assert!(
        told.contains("missing columns: force_normal, time. ")
            && flags.iter().all(|flag| told.contains(flag)),
        "{told}"
    );
    let named = ["--column", "force_normal=Fz [N]", "--column", "time=Zeit [s]"];
    let output = haptograph(folder.path(), &[&learn[..], &named].concat(), "");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    for part in ["ax [g]", "ay [g]", "az [g]", "pos_x"] {
        assert!(told.contains(part), "{told}");
    }
    let learned = String::from_utf8_lossy(&output.stdout);
    assert!(learned.contains("texture   a law"), "{learned}");
}
