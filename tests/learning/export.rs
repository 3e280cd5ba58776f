//! Vibrations as files of phones and controllers.

use super::{column, fail, json, noise, succeed, wav};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

fn canvas() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/surfaces/t2-canvas.ron").display().to_string()
}

fn read(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn one_vibration_becomes_files_of_three_formats_and_what_each_loses() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    wav(&folder.join("tone.wav"), 8000, (0..8000).map(|n| 0.5 * (TAU * 0.02 * f64::from(n)).sin()));
    fs::write(folder.join("tone.wav.ron"), "Recording(unit: \"A\", full_scale: 4.0, simulated: true)")
        .unwrap();
    let call = ["export", "tone.wav", "tone.ahap", "tone.haptic", "tone.hjif"];
    let found = json(folder, &[&call[..], &["--json"]].concat());
    assert_eq!((&found["rate_hz"], &found["seconds"]), (&8000.0.into(), &1.0.into()));
    let files = found["files"].as_array().unwrap();
    for (file, name) in files.iter().zip(&call[2..]) {
        assert_eq!((&file["written"], &file["unit"]), (&(*name).into(), &"A".into()));
        let bytes = fs::read(folder.join(name)).unwrap();
        assert_eq!(file["bytes"].as_u64(), Some(bytes.len() as u64));
        // 160 Hz of 2 A.
        assert!((file["full_scale"].as_f64().unwrap() - 2.0).abs() < 0.05, "{file}");
        let bands = file["bands"].as_array().unwrap();
        let loudest = |key: &str| {
            let level = |band: &&Value| band[key].as_f64().unwrap_or(f64::NEG_INFINITY);
            bands
                .iter()
                .max_by(|a, b| level(a).total_cmp(&level(b)))
                .map(|band| band["centre_hz"].as_f64().unwrap())
                .unwrap()
        };
        assert!(
            (loudest("before_db") - 158.5).abs() < 1.0 && (loudest("after_db") - 158.5).abs() < 1.0,
            "{file}"
        );
        assert!(file["envelope_db"].as_f64().unwrap() < 0.3 && !file["lost"].as_str().unwrap().is_empty());
    }
    let ahap = read(&folder.join("tone.ahap"));
    assert_eq!(ahap["Version"], 1.0);
    assert!(ahap["Metadata"]["Description"].as_str().unwrap().ends_with(" A"), "{}", ahap["Metadata"]);
    // The same call replaces its own files with the same ones, and no others.
    let before = fs::read(folder.join("tone.hjif")).unwrap();
    let text = succeed(folder, &call);
    assert_eq!(fs::read(folder.join("tone.hjif")).unwrap(), before);
    assert!(files.iter().all(|file| text.contains(file["lost"].as_str().unwrap())), "{text}");
    fs::write(folder.join("tone.ahap"), "mine").unwrap();
    fail(folder, &call);
    assert_eq!(fs::read(folder.join("tone.ahap")).unwrap(), b"mine");
}

#[test]
fn a_surface_is_exported_at_a_force_and_speed_or_along_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let canvas = canvas();
    let at = |out: &str, more: &[&str]| json(folder, &[&["export", &canvas, out, "--json"], more].concat());
    let steady = at("a.haptic", &["--force-n", "1", "--speed-mm-s", "100"]);
    assert_eq!((&steady["seconds"], &steady["files"][0]["unit"]), (&2.0.into(), &"m/s2".into()));
    let again = at("b.haptic", &["--force-n", "1", "--speed-mm-s", "100"]);
    assert_eq!(steady["files"][0]["bands"], again["files"][0]["bands"]);
    let other = at("c.haptic", &["--force-n", "1", "--speed-mm-s", "100", "--seed", "2", "--seconds", "1"]);
    assert!(other["files"][0]["bands"] != steady["files"][0]["bands"] && other["seconds"] == 1.0);
    succeed(
        folder,
        &["simulate-recording", "--material", "T2", "--motion", "drag", "--seconds", "3", "-o", "take.npz"],
    );
    let along = at("d.hjif", &["--along", "take.npz"]);
    assert!((along["seconds"].as_f64().unwrap() - 3.0).abs() < 0.2, "{}", along["seconds"]);
    // The recording itself is a vibration, too.
    let own = json(folder, &["export", "take.npz", "e.hjif", "--json"]);
    assert_eq!(own["files"][0]["unit"], "m/s2");
    assert!(fail(folder, &["export", &canvas, "f.ahap"]).contains("--force-n"));
    assert!(fail(folder, &["export", "take.npz", "f.ahap", "--along", "take.npz"]).contains("no surface"));
}

#[test]
fn what_cannot_be_exported_says_what_to_do_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    column(&folder.join("noise.csv"), "accel_m_s2", &noise(4000, 1));
    column(&folder.join("silence.csv"), "accel_m_s2", &vec![0.0; 4000]);
    let rate = ["--sample-rate", "2000"];
    for (call, said) in [
        (vec!["export", "noise.csv", "x.wav"], ".haptic"),
        (vec!["export", "noise.csv", "x.ahap"], "--sample-rate"),
        (vec!["export", "noise.csv", "x.ahap", "--sample-rate", "100"], "from 500"),
        (vec!["export", "none.csv", "x.ahap"], "none.csv"),
        (vec!["export", "noise.csv", "none/x.ahap"], "none"),
        ([&["export", "silence.csv", "x.ahap"][..], &rate].concat(), "silent"),
    ] {
        let told = fail(folder, &call);
        assert!(told.contains(said) && told.matches("error").count() == 1, "{call:?}: {told}");
    }
    let names: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
}
