//! Data sets by the command: whole, in parts, and after kills.
#![allow(clippy::unwrap_used)]

use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_haptograph"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn haptograph(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().unwrap()
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = haptograph(folder, &[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A folder with a plan of shipped surfaces, in so many chunks of two jobs.
fn with_plan(chunks: u64, seconds: f64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let surfaces = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("graphs/surfaces");
    let plan = format!(
        r#"Batch(
    surfaces: ["{0}/t1-*.ron", "{0}/t2-canvas.ron"],
    motions: {{ "walk": RandomWalk(seconds: {seconds}, speed_mm_s: (5, 170), force_n: (0.1, 2.8)) }},
    jobs: Product(seeds: (1, {chunks})),
    jobs_per_chunk: 2,
)"#,
        surfaces.display()
    );
    fs::write(folder.path().join("plan.ron"), plan).unwrap();
    folder
}

fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let named = entries.map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), path));
    let visible = named.filter(|(name, _)| !name.starts_with('.'));
    visible.map(|(name, path)| (name, fs::read(path).unwrap())).collect()
}

#[test]
fn a_data_set_that_was_killed_again_and_again_is_that_of_one_run() {
    let folder = with_plan(8, 2.0);
    let folder = folder.path();
    let whole = json(folder, &["batch", "plan.ron", "-o", "whole"]);
    assert_eq!((&whole["rendered"], &whole["complete"]), (&8.into(), &true.into()));
    // Each time once another chunk is there, in the middle of the next.
    for wanted in [1, 2, 4] {
        let mut running =
            command(folder, &["batch", "plan.ron", "-o", "killed", "--threads", "1"]).spawn().unwrap();
        let is_chunk = |name: &String| name.starts_with("chunk-") && name.ends_with(".npz");
        let there = || {
            fs::read_dir(folder.join("killed")).map_or(0, |entries| {
                entries
                    .filter(|entry| {
                        is_chunk(&entry.as_ref().unwrap().file_name().to_string_lossy().into_owned())
                    })
                    .count()
            })
        };
        while there() < wanted && running.try_wait().unwrap().is_none() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        running.kill().unwrap();
        running.wait().unwrap();
    }
    let last = json(folder, &["batch", "plan.ron", "-o", "killed"]);
    assert!(last["kept"].as_u64().unwrap() >= 4 && last["complete"] == true, "{last}");
    assert_eq!(content(&folder.join("killed")), content(&folder.join("whole")));
    let again = json(folder, &["batch", "plan.ron", "-o", "killed"]);
    assert_eq!((&again["rendered"], &again["kept"]), (&0.into(), &8.into()));
}

#[test]
fn parts_merge_to_the_bytes_of_one_run() {
    let folder = with_plan(5, 0.2);
    let folder = folder.path();
    json(folder, &["batch", "plan.ron", "-o", "whole", "--threads", "2"]);
    for part in ["1", "2", "3"] {
        let done = json(folder, &["batch", "plan.ron", "-o", part, "--shard", &format!("{part}/3")]);
        assert_eq!(done["complete"], false);
    }
    let merged = json(folder, &["batch", "merge", "1", "2", "3", "-o", "data"]);
    assert_eq!((&merged["chunks"], &merged["jobs"]), (&5.into(), &10.into()));
    assert_eq!(content(&folder.join("data")), content(&folder.join("whole")));
    let manifest: Value = serde_json::from_slice(&content(&folder.join("data"))["manifest.json"]).unwrap();
    assert_eq!(manifest["surfaces"], serde_json::json!(["t1-plastic", "t2-canvas"]));
    assert_eq!(
        (&manifest["rendered"], &manifest["inputs"][0]["origin"]),
        (&true.into(), &"simulated".into())
    );
    assert!(!haptograph(folder, &["batch", "merge", "1", "3", "-o", "less"]).status.success());
}

/// The vibrations of a chunk, a job a row: numbers of an uncompressed member of its archive.
fn vibrations(chunk: &[u8], samples: usize) -> Vec<Vec<f32>> {
    let find = |from: usize, what: &[u8]| {
        let place = chunk[from..].windows(what.len()).position(|window| window == what);
        from + place.unwrap()
    };
    let array = find(find(0, b"vibration_m_s2.npy"), b"\x93NUMPY");
    let header = usize::from(u16::from_le_bytes([chunk[array + 8], chunk[array + 9]]));
    let numbers = chunk[array + 10 + header..].chunks_exact(4);
    let numbers: Vec<f32> =
        numbers.map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).take(2 * samples).collect();
    numbers.chunks(samples).map(<[f32]>::to_vec).collect()
}

#[test]
fn a_wav_file_of_a_job_has_the_bits_of_its_chunk() {
    let folder = with_plan(2, 0.2);
    let folder = folder.path();
    json(folder, &["batch", "plan.ron", "-o", "data"]);
    let wav = ["batch", "wav", "plan.ron", "2", "1", "-o", "wav"];
    let written = json(folder, &wav);
    assert_eq!(written["written"], serde_json::json!(["wav/job-2.wav", "wav/job-1.wav"]));
    for (chunk, row, job) in [(1, 0, 2), (0, 1, 1)] {
        let chunk = fs::read(folder.join(format!("data/chunk-{chunk:06}.npz"))).unwrap();
        let file = folder.join(format!("wav/job-{job}.wav"));
        let mut reader = hound::WavReader::open(&file).unwrap();
        assert_eq!((reader.spec().sample_rate, reader.len()), (10_000, 2000));
        let note = fs::read_to_string(folder.join(format!("wav/job-{job}.wav.ron"))).unwrap();
        let (_, full_scale) = note.split_once("full_scale: ").unwrap();
        let full_scale: f32 = full_scale.split([',', ')']).next().unwrap().parse().unwrap();
        assert!(note.contains("simulated: true"), "{note}");
        let samples: Vec<f32> = reader.samples::<f32>().map(|x| x.unwrap() * full_scale).collect();
        assert_eq!(samples, vibrations(&chunk, 2000)[row]);
    }
    // Again, and not where somebody changed one.
    json(folder, &wav);
    fs::write(folder.join("wav/job-1.wav"), "mine").unwrap();
    assert!(!haptograph(folder, &wav).status.success());
    assert_eq!(fs::read_to_string(folder.join("wav/job-1.wav")).unwrap(), "mine");
    let beyond = haptograph(folder, &["batch", "wav", "plan.ron", "4", "-o", "wav", "--json"]);
    let error: Value = serde_json::from_slice(&beyond.stdout).unwrap();
    assert!(error["error"].as_str().unwrap().contains("0 to 3"), "{error}");
}

#[test]
fn a_wrong_plan_is_shown_at_its_place() {
    let folder = with_plan(2, 0.1);
    let plan = fs::read_to_string(folder.path().join("plan.ron")).unwrap();
    fs::write(folder.path().join("plan.ron"), plan.replace("t2-canvas", "t2-velvet")).unwrap();
    let output = haptograph(folder.path(), &["batch", "plan.ron", "-o", "data"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && told.contains("plan.ron:2:"), "{told}");
    assert!(!folder.path().join("data").exists());
    for wrong in [&["batch"][..], &["batch", "plan.ron"], &["batch", "plan.ron", "-o", "d", "--shard", "3/2"]]
    {
        assert_eq!(haptograph(folder.path(), wrong).status.code(), Some(2));
    }
}

/// The plan in the book is one, whatever files it names.
#[test]
fn the_plan_in_the_book_is_sound() {
    let page = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/batch.md")).unwrap();
    let (_, block) = page.split_once("```ron\n").unwrap();
    let (plan, _) = block.split_once("```").unwrap();
    let surfaces = concat!(env!("CARGO_MANIFEST_DIR"), "/graphs/surfaces");
    let plan = plan
        .replace("surfaces/*.ron", &format!("{surfaces}/*.ron"))
        .replace("Recording(\"take.csv\")", "Constant(seconds: 1, speed_mm_s: 1, force_n: 1)");
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("plan.ron"), plan).unwrap();
    let found = json(folder.path(), &["batch", "plan.ron", "--check"]);
    assert_eq!((&found["jobs"], &found["chunks"]), (&1800.into(), &29.into()));
}
