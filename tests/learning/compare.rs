//! Vibrations beside each other.

use super::{column, fail, haptograph, json, noise, succeed, wav, workshop};
use serde_json::Value;
use std::fs;

#[test]
fn vibrations_are_compared_whatever_they_are_kept_in() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (noise(20_000, 1), noise(20_000, 2));
    column(&folder.path().join("a.csv"), "accel_m_s2", &a);
    column(&folder.path().join("b.csv"), "accel_m_s2", &b);
    let same = json(
        folder.path(),
        &["compare", "a.csv", "a.csv", "--rate", "10000", "--deviations", "0.01,0.3", "--json"],
    );
    for measure in ["NSE", "PE", "SD", "lsd_db", "lsd_pacinian_db", "error_total_db"] {
        assert_eq!(same[measure], 0.0, "{measure}");
    }
    assert!(same["fluctuation"].as_object().unwrap().values().all(|error| error == 0.0), "{same}");
    // A column has no force and speed, beside which levels could be read.
    assert!(same["envelope_db"].is_null() && same["envelope_reason"].is_string());
    assert_eq!(same["simulated"], false);
    let other = json(folder.path(), &["compare", "a.csv", "b.csv", "--rate", "10000", "--json"]);
    for measure in ["NSE", "PE", "lsd_db", "absolute_db"] {
        assert!(other[measure].as_f64().unwrap() > 0.0);
    }
    // Of one pair alone there is no deviation to count in. Two seconds tell 20 to 40 Hz as one band.
    assert!(other["SD"].is_null() && other["reason"].is_string());
    assert_eq!(other["bands"].as_array().unwrap().len(), 15);
    let misused = haptograph(folder.path(), &["compare", "a.csv", "b.csv", "--deviations", "0.1"], "");
    assert_eq!(misused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&misused.stderr).contains("--deviations"));
    assert!(fail(folder.path(), &["compare", "a.csv", "b.csv"]).contains("--rate"));

    wav(&folder.path().join("a.wav"), 10_000, a.iter().map(|sample| sample / 8.0));
    fs::write(folder.path().join("a.wav.ron"), "Recording(unit: \"m/s2\", full_scale: 8.0, simulated: true)")
        .unwrap();
    let kept = json(folder.path(), &["compare", "a.wav", "a.csv", "--rate", "10000", "--json"]);
    assert!(kept["NSE"].as_f64().unwrap() < 1e-6 && kept["PE"].as_f64().unwrap() < 1e-5, "{kept}");
    assert_eq!(kept["simulated"], true);
    let text = succeed(folder.path(), &["compare", "a.csv", "a.wav", "--rate", "10000"]);
    assert!(text.contains("simulated                             a.wav"), "{text}");
    // Both are brought down to a tenth of the rate, with the same windows of the same moments.
    let slow = json(folder.path(), &["compare", "a.wav", "a.wav", "--rate", "1000", "--json"]);
    assert_eq!((&slow["NSE"], &slow["windows"]), (&0.0.into(), &152.into()));
    assert!(fail(folder.path(), &["compare", "a.wav", "a.wav", "--rate", "20000"]).contains("at most"));
}

#[test]
fn levels_are_compared_beside_what_force_and_speed_tell_of_them() {
    let folder = workshop();
    let [a, b] = ["study/T1.anna.1.npz", "study/T1.anna.2.npz"];
    let db = |found: &serde_json::Value, name: &str| found[name].as_f64().unwrap();
    let found = json(folder, &["compare", a, b, "--json"]);
    assert!(found["envelope_reason"].is_null());
    assert!(db(&found, "envelope_db") > db(&found, "envelope_between_seeds_db"));
    assert!(db(&found, "envelope_between_seeds_db") > 0.1 && db(&found, "unexplained_level_db") > 0.1);
    // The references are those of the second file, and of the first where the second has no force and speed.
    let same = json(folder, &["compare", b, b, "--json"]);
    assert_eq!(db(&same, "envelope_db"), 0.0);
    assert_eq!(same["unexplained_level_db"], found["unexplained_level_db"]);
    let elsewhere = tempfile::tempdir().unwrap();
    column(&elsewhere.path().join("c.csv"), "accel_m_s2", &noise(60_000, 2));
    let other = elsewhere.path().join("c.csv").display().to_string();
    let mixed = json(folder, &["compare", b, &other, "--rate", "10000", "--json"]);
    assert_eq!(mixed["unexplained_level_db"], same["unexplained_level_db"]);
    assert!(succeed(folder, &["compare", a, b]).contains("force and speed leave"));
    // The page has both in one player.
    let page = elsewhere.path().join("page").display().to_string();
    let report = ["compare", a, b, "--report", &page, "--json"];
    let written = json(folder, &report)["page"].as_str().unwrap().to_owned();
    let html = fs::read_to_string(&written).unwrap();
    assert_eq!(html.matches("<audio").count(), 1);
    assert!(html.contains("T1.anna.1.npz") && html.contains("aria-pressed"));
}

/// An RF64 file (EBU Tech 3306) of 32-bit floats that announces so many frames, and holds these.
fn rf64(frames: u64, samples: &[f64]) -> Vec<u8> {
    let mut bytes = b"RF64\xff\xff\xff\xffWAVEds64\x1c\0\0\0".to_vec();
    for size in [4 * frames + 72, 4 * frames, frames] {
        bytes.extend(size.to_le_bytes());
    }
    bytes.extend(0_u32.to_le_bytes());
    bytes.extend(b"fmt \x10\0\0\0\x03\0\x01\0");
    for rate in [10_000_u32, 40_000] {
        bytes.extend(rate.to_le_bytes());
    }
    bytes.extend(b"\x04\0\x20\0data\xff\xff\xff\xff");
    for sample in samples {
        bytes.extend((*sample as f32).to_le_bytes());
    }
    bytes
}

#[test]
fn files_beyond_four_gibibytes_are_compared_too_and_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let a = noise(20_000, 1);
    column(&folder.path().join("a.csv"), "accel_m_s2", &a);
    let large = folder.path().join("large.wav");
    fs::write(&large, rf64(20_000, &a)).unwrap();
    let arguments = ["compare", "large.wav", "a.csv", "--rate", "10000", "--json"];
    let same = json(folder.path(), &arguments);
    assert!(same["NSE"].as_f64().unwrap() < 1e-6 && same["PE"].as_f64().unwrap() < 1e-5, "{same}");
    // A hole in the file: it takes no room on the disk, and none of it is read.
    fs::write(&large, rf64(2_000_000_000, &a)).unwrap();
    let file = fs::OpenOptions::new().write(true).open(&large).unwrap();
    file.set_len(8_000_000_080).unwrap();
    assert!(fail(folder.path(), &arguments).contains("2000000000 frames"));
    fs::write(&large, rf64(20_001, &a)).unwrap();
    assert!(fail(folder.path(), &arguments).contains("20000"));
}

/// Measures of single seeds.
const SINGLE_SEEDS: [&str; 9] = [
    "seed_lsd_db",
    "modulation_db",
    "autocorrelation",
    "level_quantiles_db",
    "kurtosis_octaves",
    "crest_db",
    "band_correlation",
    "level_deviation_5_ms_db",
    "level_deviation_50_ms_db",
];

#[test]
fn parts_that_were_not_learned_from_are_compared_with_floors_and_baselines() {
    let folder = workshop();
    let found = json(folder, &["evaluate", "study", "--holdout", "--json", "--report", "held-out"]);
    assert_eq!((&found["simulated"], &found["seeds"]), (&true.into(), &16.into()));
    let splits = found["splits"].as_array().unwrap();
    assert_eq!(splits.len(), 3);
    for split in splits {
        let methods = split["methods"].as_array().unwrap();
        assert_eq!(methods.len(), 8);
        for method in methods {
            let lsd = method["lsd_db"]["mean"].as_f64().unwrap();
            assert!(lsd > 0.0 && lsd < 20.0, "{method}");
            for measure in [
                "lsd_by_material_db",
                "lsd_100_500_by_material_db",
                "error_20_40_by_material_db",
                "error_total_by_material_db",
            ] {
                assert_eq!(method[measure].as_array().unwrap().len(), 2, "{measure}");
            }
            for measure in SINGLE_SEEDS {
                assert!(method[measure]["mean"].as_f64().unwrap() > 0.0, "{measure} of {method}");
                let over_seeds = method[measure]["standard_deviation_over_seeds"].as_f64();
                assert_eq!(over_seeds.is_some_and(|db| db > 0.0), method["method"] != "floor", "{method}");
            }
            for band in method["signed_error_db"].as_array().unwrap() {
                let db = |name: &str| band[name].as_f64().unwrap();
                assert!(db("absolute_db") + 1e-9 >= db("db").abs(), "{band}");
            }
        }
    }
    // Drags alone tell friction, and neither taps nor stiffness.
    let contact = found["contact"].as_array().unwrap();
    assert_eq!(contact.len(), 4);
    for result in contact {
        assert_eq!(result["error"], "drag_friction_percent");
        for method in result["methods"].as_array().unwrap() {
            let error = method["mean"]["mean"].as_f64().unwrap();
            assert!(error > 0.0 && error < 100.0, "{result}");
        }
    }
    let text = succeed(folder, &["evaluate", "study", "--holdout"]);
    for shown in [
        "over the best plain",
        "100-500 Hz",
        "20-40 Hz",
        "total",
        "felt",
        "absolute",
        "misplaced %",
        "kurtosis",
        "envelope (its seeds)",
        "NSE",
        "PE",
        "100-500 Hz, dB",
        "20-40 Hz, dB",
        "total, dB",
        "modulation",
        "spread 50 ms",
    ] {
        let heads = text.lines().filter(|line| line.contains(shown));
        assert!(heads.count() >= 3, "{shown} of each split");
    }
    let tables = text.lines().filter(|line| line.starts_with("  "));
    assert!(tables.map(|line| line.chars().count()).max() <= Some(100), "{text}");
    let page = fs::read_to_string(folder.join("held-out/report.html")).unwrap();
    for shown in [
        "simulated",
        "Log-spectral distance by material",
        "Best plain baseline",
        "over the best plain",
        "misplaced %",
        "modulation",
        "spread 50 ms",
        "recorded levels over 50 ms unexplained",
        "friction, drags (%)",
    ] {
        assert!(page.contains(shown), "{shown} is missing");
    }
    let mut methods = splits.iter().flat_map(|split| split["methods"].as_array().unwrap());
    let one_loses = methods.any(|method| method["loses"] == true);
    assert_eq!(one_loses, page.contains(" *</td>"), "marks of the terminal");
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
    let found = json(folder, &["evaluate", "study", "--json", "--pooling", "pair", "--report", "evaluation"]);
    assert_eq!((&found["expert"], &found["simulated"]), (&"anna".into(), &true.into()));
    let cells = found["table"]["sd"].as_array().unwrap();
    assert!(cells.len() == 2 && cells.iter().all(|row| row.as_array().unwrap().len() == 2));
    let row = &found["people_table"]["sd"][0];
    assert_eq!((&row[0], &row[1]), (&cells[0][0], &cells[1][1]), "the expert's row is the diagonal");
    assert!(found["map"]["places"].as_array().unwrap().len() == 4);
    let r_squared = found["map"]["r_squared"].as_array().unwrap();
    assert_eq!(r_squared.len(), found["map"]["stress"].as_array().unwrap().len());
    assert!(r_squared.iter().all(|value| (0.0..=1.0 + 1e-9).contains(&value.as_f64().unwrap())));
    let losses = found["losses"].as_array().unwrap();
    let of = |loss: &Value| format!("{} {}", loss["condition"], loss["texture"]).replace('"', "");
    let named: Vec<String> = losses.iter().map(of).collect();
    assert_eq!(named, ["F T1", "F T3", "S T1", "S T3", "ϕ T1", "ϕ T3"]);
    for loss in losses {
        for key in ["power_m2_s4", "spectral_centroid_hz", "sd_x"] {
            assert!(loss[key].is_number(), "{key} of {loss}");
        }
    }
    assert!(found["centre"].is_null(), "a law has no measured models");
    assert!(text.contains("R² of the distances") && text.contains("SD_x"), "{text}");
    let thesis = json(folder, &["evaluate", "study", "--json", "--method", "thesis"]);
    let centre = ["speed_mm_s", "force_n"].map(|key| thesis["centre"][key].as_f64().unwrap());
    assert!((20.0..350.0).contains(&centre[0]) && (0.2..2.75).contains(&centre[1]), "{centre:?}");
    assert!(fs::read_to_string(folder.join("evaluation/report.html")).unwrap().contains("simulated"));
    fs::create_dir_all(folder.join("empty")).unwrap();
    assert!(fail(folder, &["evaluate", "empty"]).contains("<material>.<person>.<take>"));
}
