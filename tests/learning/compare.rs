//! Vibrations beside each other.

use super::{column, fail, json, noise, succeed, workshop};
use std::fs;

#[test]
fn vibrations_are_compared_whatever_they_are_kept_in() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (noise(20_000, 1), noise(20_000, 2));
    column(&folder.path().join("a.csv"), "accel_m_s2", &a);
    column(&folder.path().join("b.csv"), "accel_m_s2", &b);
    let same = json(
        folder.path(),
        &["compare", "a.csv", "a.csv", "--rate", "10000", "--json"],
    );
    assert_eq!(
        (&same["NSE"], &same["PE"], &same["SD"]),
        (&0.0.into(), &0.0.into(), &0.0.into())
    );
    assert_eq!(same["simulated"], false);
    let other = json(
        folder.path(),
        &["compare", "a.csv", "b.csv", "--rate", "10000", "--json"],
    );
    for measure in ["NSE", "PE", "SD"] {
        assert!(other[measure].as_f64().unwrap() > 0.0);
    }
    assert!(fail(folder.path(), &["compare", "a.csv", "b.csv"]).contains("--rate"));

    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 10_000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(folder.path().join("a.wav"), spec).unwrap();
    a.iter()
        .for_each(|sample| writer.write_sample(*sample as f32 / 8.0).unwrap());
    writer.finalize().unwrap();
    fs::write(
        folder.path().join("a.wav.ron"),
        "Recording(unit: \"m/s2\", full_scale: 8.0, simulated: true)",
    )
    .unwrap();
    let kept = json(
        folder.path(),
        &["compare", "a.wav", "a.csv", "--rate", "10000", "--json"],
    );
    assert!(
        kept["NSE"].as_f64().unwrap() < 1e-6 && kept["PE"].as_f64().unwrap() < 1e-5,
        "{kept}"
    );
    assert_eq!(kept["simulated"], true);
    let text = succeed(folder.path(), &["compare", "a.csv", "a.wav", "--rate", "10000"]);
    assert!(text.contains("simulated                        a.wav"), "{text}");
    // Both are brought down to a tenth of the rate, with the same windows of the same moments.
    let slow = json(
        folder.path(),
        &["compare", "a.wav", "a.wav", "--rate", "1000", "--json"],
    );
    assert_eq!((&slow["SD"], &slow["windows"]), (&0.0.into(), &14.into()));
    assert!(fail(folder.path(), &["compare", "a.wav", "a.wav", "--rate", "20000"]).contains("at most"));
}

#[test]
fn an_evaluation_prints_the_tables_of_the_thesis() {
    let folder = workshop();
    let text = succeed(folder, &["evaluate", "study"]);
    assert!(
        text.contains("virtual T1")
            && text.contains("baseline")
            && text.contains("anna")
            && text.contains("ben")
            && text.contains("6 of 6 recordings are simulated"),
        "{text}"
    );
    let found = json(folder, &["evaluate", "study", "--json", "--report", "evaluation"]);
    assert_eq!(
        (&found["expert"], &found["simulated"]),
        (&"anna".into(), &true.into())
    );
    let cells = found["table"]["sd"].as_array().unwrap();
    assert!(cells.len() == 2 && cells.iter().all(|row| row.as_array().unwrap().len() == 2));
    let row = &found["people_table"]["sd"][0];
    assert_eq!(
        (&row[0], &row[1]),
        (&cells[0][0], &cells[1][1]),
        "the expert's row is the diagonal"
    );
    assert!(found["map"]["places"].as_array().unwrap().len() == 4);
    assert!(
        fs::read_to_string(folder.join("evaluation/report.html"))
            .unwrap()
            .contains("simulated")
    );
    fs::create_dir_all(folder.join("empty")).unwrap();
    assert!(fail(folder, &["evaluate", "empty"]).contains("<material>.<person>.<take>"));
}
