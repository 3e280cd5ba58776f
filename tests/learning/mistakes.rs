//! What users got wrong, and what they are told.

use super::{column, fail, haptograph, noise, told_by, workshop};
use serde_json::Value;
use std::fs;

#[test]
fn what_a_user_got_wrong_is_said_before_the_work() {
    let folder = workshop();
    fs::write(folder.join("file"), "").unwrap();
    fs::write(folder.join("empty.csv"), "").unwrap();
    for (arguments, said) in [
        (
            &["learn", "tap.npz", "-o", "x.ron", "--report", "file"][..],
            "file is a file; give a folder",
        ),
        (
            &["learn", "tap.npz", "-o", "nowhere/x.ron"],
            "there is no folder nowhere",
        ),
        (&["learn", "tap.npz", "-o", "x.txt"], ".ron"),
        (
            &["learn", "tap.npz", "./tap.npz", "-o", "x.ron"],
            "are the same recording",
        ),
        (
            &["surface", "convert", "t1.ron", "t1.ron"],
            "would be written over",
        ),
        (
            &[
                "learn",
                "tap.npz",
                "study/T1.anna.1.npz",
                "-o",
                "x.ron",
                "--rate",
                "1",
            ],
            "study/T1.anna.1.npz cannot be processed",
        ),
        (&["segment", "empty.csv", "--column", "x"], "the file is empty"),
        (&["learn", "empty.csv", "-o", "x.ron"], "the file is empty"),
        (
            &[
                "surface", "resample", "t1.ron", "--rate", "45", "--method", "spectral", "-o", "x.ron",
            ],
            "give more than 50 Hz",
        ),
    ] {
        let error = fail(folder, arguments);
        assert!(error.contains(said), "{arguments:?}: {error}");
    }
    for (arguments, said) in [
        (
            &["learn", "tap.npz", "-o", "x.ron", "--name", " "][..],
            "needs a name",
        ),
        (
            &[
                "simulate-recording",
                "--material",
                "T1",
                "--motion",
                "tap",
                "-o",
                "x.wav",
            ],
            ".npz",
        ),
        (
            &[
                "simulate-recording",
                "--material",
                "T1",
                "--motion",
                "tap",
                "--seconds",
                "-5",
                "-o",
                "x.npz",
            ],
            "from 0.1 to 3600",
        ),
        (
            &["segment", "x.csv", "--column", "x", "--seed", "3"],
            "--seed is for --method genetic",
        ),
        (
            &["segment", "x.csv", "--column", "x", "--time-limit", "3"],
            "--time-limit is for --method genetic",
        ),
    ] {
        let output = haptograph(folder, arguments, "");
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains(said), "{arguments:?}: {error}");
    }
    assert!(!folder.join("x.ron").exists());
}

#[test]
fn what_is_passed_over_or_overruled_is_said() {
    let folder = workshop();
    let forced = haptograph(
        folder,
        &[
            "learn",
            "study/T1.anna.1.npz",
            "--circle",
            "tap.npz",
            "-o",
            "forced.ron",
        ],
        "",
    );
    let warned = String::from_utf8_lossy(&forced.stderr);
    assert!(
        warned.contains("tap.npz says of itself that it is a tap; it is taken as a circle"),
        "{warned}"
    );

    let rows: String = noise(3000, 1).iter().map(|a| format!("{a},1,2,60\n")).collect();
    let header = "# rate_hz: 10000\naccel_m_s2,force_nromal_n,force_normal_n,speed_mm_s\n";
    fs::write(
        folder.join("typo.csv"),
        format!("{}{rows}", header.replace("force_nromal", "forc_normal")),
    )
    .unwrap();
    let learned = haptograph(folder, &["learn", "typo.csv", "-o", "typo.ron"], "");
    let warned = String::from_utf8_lossy(&learned.stderr);
    assert!(
        warned.contains("column \"forc_normal_n\" is not understood")
            && warned.contains("did you mean force_normal_n?"),
        "{warned}"
    );
}

#[test]
fn a_column_that_is_there_twice_is_shown_at_its_place() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("twice.csv"), "x,y,x\n1,2,3\n").unwrap();
    for arguments in [
        &["segment", "twice.csv", "--column", "x"][..],
        &["compare", "twice.csv", "twice.csv", "--column", "y"],
        &["learn", "twice.csv", "-o", "x.ron"],
    ] {
        let error = fail(folder.path(), arguments);
        for part in ["x is there twice", "twice.csv:1:5", "x,y,x", "^"] {
            assert!(error.contains(part), "{arguments:?}: {part} is missing: {error}");
        }
    }
}

#[test]
fn surfaces_of_one_name_are_not_merged_in_silence() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.ron", "b.ron"] {
        fs::copy(workshop().join("t1.ron"), folder.path().join(name)).unwrap();
    }
    let selected = haptograph(
        folder.path(),
        &["surface", "select", ".", "--count", "1", "--json"],
        "",
    );
    let warned = String::from_utf8_lossy(&selected.stderr);
    assert!(
        warned.contains("under one name") && warned.contains("a.ron") && warned.contains("b.ron"),
        "{warned}"
    );
}

#[test]
fn comparisons_without_a_number_say_why() {
    let folder = tempfile::tempdir().unwrap();
    let signal = noise(3000, 1);
    let scaled = |factor: f64| signal.iter().map(|x| factor * x).collect::<Vec<_>>();
    for (file, name, factor) in [
        ("a.csv", "accel_m_s2", 1.0),
        ("louder.csv", "accel_m_s2", 3.0),
        ("huge.csv", "accel_m_s2", 1e300),
        ("force.csv", "force_normal_n", 2.0),
        ("plain.csv", "level", 2.0),
    ] {
        column(&folder.path().join(file), name, &scaled(factor));
    }
    let compare = |b: &str| {
        haptograph(
            folder.path(),
            &["compare", "a.csv", b, "--rate", "10000", "--json"],
            "",
        )
    };
    let output = compare("louder.csv");
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(found["SD"].is_null() && found["reason"].as_str().unwrap().contains("--deviations"));
    assert!(output.stderr.is_empty());
    let said = |b: &str| told_by(&compare(b));
    assert!(
        said("huge.csv").contains("check the units"),
        "{}",
        said("huge.csv")
    );
    assert!(
        said("force.csv").contains("is in m/s2") && said("force.csv").contains("in N"),
        "{}",
        said("force.csv")
    );
    assert!(
        said("plain.csv").contains("plain.csv does not say its unit"),
        "{}",
        said("plain.csv")
    );

    let mut whole = std::io::Cursor::new(vec![]);
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 10_000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::new(&mut whole, spec).unwrap();
    signal
        .iter()
        .for_each(|&x| writer.write_sample(x as f32).unwrap());
    writer.finalize().unwrap();
    let whole = whole.into_inner();
    for (bytes, said) in [(20, "within its header"), (5000, "announces 3000 frames")] {
        fs::write(folder.path().join("short.wav"), &whole[..bytes]).unwrap();
        let error = fail(folder.path(), &["compare", "short.wav", "a.csv"]);
        assert!(error.contains(said), "{error}");
    }
}

#[test]
fn what_is_wrong_in_a_surface_file_is_shown_at_its_place() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("bad.xml"),
        "<modelSet>\n  <mu>slippery</mu>\n</modelSet>\n",
    )
    .unwrap();
    let told = fail(folder.path(), &["surface", "show", "bad.xml"]);
    assert!(told.contains("bad.xml:2:") && told.contains("slippery"), "{told}");
    assert!(fail(folder.path(), &["surface", "show", "none.ron"]).contains("none.ron"));
}
