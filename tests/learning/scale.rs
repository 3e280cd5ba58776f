//! Many recordings, in parts.

use super::{fail, haptograph, json, succeed, told_by};
use haptograph::learning::recording::{AnyRecording, Gesture, ProcessedRecording, Signals, save};
use haptograph::surfaces::rendering::{RandomWalk, SynthesisSettings, synthesise};
use haptograph::surfaces::{Origin, Provenance, files};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Two materials, of each two takes of one person and one of another: short drags over shipped surfaces.
fn study(folder: &Path) {
    fs::create_dir(folder).unwrap();
    let surfaces = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/surfaces");
    for material in ["t2-canvas", "t1-plastic"] {
        let surface = files::load(&surfaces.join(format!("{material}.ron"))).unwrap();
        let texture = surface.texture.unwrap();
        for (person, take, seed) in [("anna", 1, 1), ("anna", 2, 2), ("ben", 1, 3)] {
            let walk = RandomWalk { seconds: 4.0, rate_hz: texture.rate_hz(), seed, ..RandomWalk::default() };
            let (along, settings) =
                (walk.trajectory(), SynthesisSettings { seed, ..SynthesisSettings::default() });
            let signals = Signals {
                rate_hz: along.rate_hz,
                acceleration_m_s2: synthesise(&texture, &along, &settings).unwrap(),
                force_tangential_n: None,
                axes_m_s2: None,
                force_normal_n: along.force_n,
                speed_m_s: along.speed_m_s,
            };
            let provenance = Provenance::new(Origin::Simulated, "a test");
            let recording = ProcessedRecording::new(signals, Gesture::Drag, provenance).unwrap();
            let path = folder.join(format!("{material}.{person}.{take}.npz"));
            save(&AnyRecording::Processed(recording), &path).unwrap();
        }
    }
}

/// All visible files of a folder.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let named = entries.map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), path));
    let visible = named.filter(|(name, _)| !name.starts_with('.'));
    visible.map(|(name, path)| (name, fs::read(path).unwrap())).collect()
}

#[test]
fn an_evaluation_in_parts_prints_the_tables_of_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    study(&folder.join("study"));
    fs::create_dir(folder.join("parts")).unwrap();
    let whole = ["", "--json"].map(|form| {
        let arguments = ["evaluate", "study", "--seed", "7", form];
        succeed(folder, if form.is_empty() { &arguments[..4] } else { &arguments })
    });
    let parts = ["1", "2", "3"].map(|part| format!("parts/{part}.ron"));
    for (number, part) in (1..=3).zip(&parts) {
        let shard = format!("{number}/3");
        let arguments = ["evaluate", "study", "--seed", "7", "--shard", &shard, "-o", part, "--json"];
        let done = json(folder, &arguments);
        // Four textures, dealt to three.
        let textures = if number == 1 { 2 } else { 1 };
        assert_eq!((&done["textures"], &done["of"]), (&textures.into(), &4.into()));
        assert_eq!(done["kept"], false);
        // Again, it is there.
        assert_eq!(json(folder, &arguments)["kept"], true);
    }
    let merge = ["evaluate", "merge", &parts[2], &parts[0], &parts[1]];
    assert_eq!(succeed(folder, &merge), whole[0]);
    assert_eq!(succeed(folder, &[&merge[..], &["--json"]].concat()), whole[1]);
    assert!(fail(folder, &merge[..4]).contains("1 of 4"));
    // Of other settings.
    let other = ["evaluate", "study", "--seed", "8", "--shard", "3/3", "-o", "other.ron"];
    succeed(folder, &other);
    assert!(fail(folder, &["evaluate", "merge", &parts[0], &parts[1], "other.ron"]).contains("other.ron"));
    assert!(fail(folder, &["evaluate", "merge", "study/t2-canvas.anna.1.npz"]).contains("t2-canvas"));
    for misused in [
        &["evaluate"][..],
        &["evaluate", "study", "--shard", "1/3"],
        &["evaluate", "study", "-o", "part.ron"],
        &["evaluate", "study", "--shard", "1/3", "-o", "p.ron", "--holdout"],
        &["evaluate", "merge"],
    ] {
        assert_eq!(haptograph(folder, misused, "").status.code(), Some(2), "{misused:?}");
    }
    fail(folder, &["evaluate", "study", "--shard", "1/3", "-o", "study/part.ron"]);
}

#[test]
fn a_folder_is_learned_in_parts_and_what_fails_is_listed_after_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    study(&folder.join("study"));
    fs::write(folder.join("study/broken.csv"), "accel_m_s2,speed_mm_s\n1,2\nx,3\n").unwrap();
    let learn = |output: &str, more: &[&str]| {
        let arguments = [&["learn", "study", "-o", output, "--json"], more].concat();
        let done = haptograph(folder, &arguments, "");
        let told: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        (done.status.code(), told)
    };
    let count = |told: &serde_json::Value, what: &str| told[what].as_array().unwrap().len();
    let (code, whole) = learn("whole", &[]);
    assert_eq!((code, count(&whole, "surfaces"), count(&whole, "failed")), (Some(1), 6, 1));
    assert_eq!(whole["failed"][0]["surface"], "broken");
    assert!(whole["failed"][0]["error"].as_str().unwrap().contains("broken.csv"), "{whole}");
    let surfaces: Vec<usize> = ["1/3", "2/3", "3/3"]
        .iter()
        .map(|shard| count(&learn("parts", &["--shard", shard]).1, "surfaces"))
        .collect();
    assert_eq!(surfaces.iter().sum::<usize>(), 6);
    assert_eq!(content(&folder.join("parts")), content(&folder.join("whole")));
    // All together keep what the parts left, and tell the same of it.
    let (code, again) = learn("parts", &[]);
    assert_eq!((code, &again["kept"]), (Some(1), &6.into()));
    assert_eq!((&again["surfaces"], &again["failed"]), (&whole["surfaces"], &whole["failed"]));
    let output = haptograph(folder, &["learn", "study", "-o", "parts"], "");
    let text = told_by(&output);
    assert!(text.contains("t1-plastic.ben.1") && text.contains("not learned"), "{text}");

    // A recording that changed is learned anew, the others are kept; mended, the last one too.
    fs::copy(folder.join("study/t2-canvas.ben.1.npz"), folder.join("study/t2-canvas.anna.2.npz")).unwrap();
    fs::remove_file(folder.join("study/broken.csv")).unwrap();
    let (code, mended) = learn("parts", &[]);
    assert_eq!((code, &mended["kept"]), (Some(0), &5.into()));
    let (_, slower) = learn("parts", &["--order", "10"]);
    assert_eq!(slower["kept"], 0);

    // What is of one surface is refused, and what is of folders too.
    for misused in [&["--name", "x"][..], &["--report", "page"]] {
        let arguments = [&["learn", "study", "-o", "x"], misused].concat();
        fail(folder, &arguments);
    }
    let one = "study/t2-canvas.anna.1.npz";
    fail(folder, &["learn", one, "-o", "x.ron", "--shard", "1/2"]);
}

#[test]
fn a_folder_is_learned_by_material() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    study(&folder.join("study"));
    let done = json(folder, &["learn", "study", "-o", "surfaces", "--by", "material", "--json"]);
    let names = |of: &serde_json::Value| of["surface"].as_str().unwrap().to_owned();
    let surfaces = done["surfaces"].as_array().unwrap();
    assert_eq!(surfaces.iter().map(names).collect::<Vec<_>>(), ["t1-plastic", "t2-canvas"]);
    assert_eq!(surfaces[0]["recordings"].as_array().unwrap().len(), 3);
    // What is learned of a folder is what is learned of its files.
    let files = ["anna.1", "anna.2", "ben.1"].map(|take| format!("study/t2-canvas.{take}.npz"));
    let alone = [&["learn", "-o", "t2-canvas.ron"], &files.each_ref().map(String::as_str)[..]].concat();
    succeed(folder, &alone);
    let [together, alone] = ["surfaces/t2-canvas.ron", "t2-canvas.ron"]
        .map(|path| haptograph::surfaces::files::load(&folder.join(path)).unwrap());
    assert_eq!(together.texture, alone.texture);
}
