use super::*;
use crate::parts::PartsError;
use haptograph_signal::noise::stream_seed;
use haptograph_surfaces::files::save;
use haptograph_surfaces::hull::Hull;
use haptograph_surfaces::rendering::{RandomWalk, SynthesisSettings, Voice, synthesise_many};
use haptograph_surfaces::{ArmaModel, ModelAt, Origin, Provenance, Surface, TextureModel, VertexKind};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;

const PLAN: &str = r#"Batch(
    surfaces: ["surfaces/*.ron"],
    motions: {
        "still": Constant(seconds: 0.05, speed_mm_s: 80, force_n: 1),
        "walk": RandomWalk(seconds: 0.1, speed_mm_s: (5, 170), force_n: (0.1, 2.0), cutoff_hz: 10),
    },
    jobs: Product(seeds: (1, 5)),
    jobs_per_chunk: 3,
)"#;

/// The plan in both formats, with the extension of its chunks.
fn plans() -> [(String, &'static str); 2] {
    let parquet = PLAN.replace("jobs_per_chunk", "format: Parquet, jobs_per_chunk");
    [(PLAN.to_owned(), "npz"), (parquet, "parquet")]
}

fn texture(pitch: f64) -> TextureModel {
    let at = |(speed_m_s, force_n): (f64, f64)| ModelAt {
        speed_m_s,
        force_n,
        model: ArmaModel::warped_from_lsf(&[pitch, 1.0, 1.5, 2.5], 0.8, speed_m_s * force_n).unwrap(),
        kind: VertexKind::Measured,
    };
    let places = [(0.05, 0.5), (0.2, 0.5), (0.05, 2.0), (0.2, 2.0)];
    TextureModel::from_measured(2000.0, places.map(at).to_vec(), &Hull::default()).unwrap()
}

/// A folder with a plan and two surfaces.
fn with_plan(plan: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("surfaces")).unwrap();
    for (name, pitch) in [("cork", 0.3), ("tile", 0.7)] {
        let mut surface = Surface::new(name.to_owned(), Provenance::new(Origin::Procedural, "a test"));
        surface.texture = Some(texture(pitch));
        save(&surface, &folder.path().join(format!("surfaces/{name}.ron"))).unwrap();
    }
    fs::write(folder.path().join("plan.ron"), plan).unwrap();
    folder
}

fn load(folder: &TempDir) -> Result<Batch, PlanError> {
    Batch::load(&folder.path().join("plan.ron"))
}

fn render_to(batch: &Batch, folder: &Path, shard: Option<&str>, threads: usize) -> Rendered {
    let shard = shard.map(|shard| shard.parse().unwrap());
    let settings = RenderSettings { shard, threads };
    render(batch, folder, &settings, &|_| (), &AtomicBool::new(false)).unwrap()
}

/// A merge of parts that were rendered here.
fn merge(parts: &[PathBuf], into: &Path, progress: &dyn Fn(f64)) -> Result<Merged, MergeError> {
    super::merge(parts, into, Processors::OneFamily, progress)
}

/// All files of a folder but its mark.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let named = entries.map(|entry| (entry.file_name().into_string().unwrap(), entry.path()));
    let visible = named.filter(|(name, _)| !name.starts_with('.'));
    visible.map(|(name, path)| (name, fs::read(path).unwrap())).collect()
}

#[test]
fn parts_in_any_number_merge_to_the_bytes_of_one_run() {
    for (plan, _) in plans() {
        merge_any_number(&with_plan(&plan));
    }
}

fn merge_any_number(folder: &TempDir) {
    let batch = load(folder).unwrap();
    assert_eq!((batch.jobs(), batch.chunks()), (20, 7));
    let at = |name: &str| folder.path().join(name);
    let whole = render_to(&batch, &at("whole"), None, 2);
    assert!(whole.is_complete && whole.rendered == 7 && whole.kept == 0);
    for of in [2_u64, 3, 9] {
        let parts: Vec<PathBuf> = (1..=of).map(|k| at(&format!("part-{k}-of-{of}"))).collect();
        for (k, part) in (1..=of).zip(&parts) {
            let shard = format!("{k}/{of}");
            render_to(&batch, part, Some(&shard), 1);
        }
        let merged = at(&format!("merged-{of}"));
        assert_eq!(merge(&parts, &merged, &|_| ()).unwrap().chunks, 7);
        assert_eq!(content(&merged), content(&at("whole")));
        // Again: nothing to do.
        merge(&parts, &merged, &|_| ()).unwrap();
        assert!(matches!(
            merge(&parts[1..], &at("less"), &|_| ()),
            Err(MergeError::Parts(PartsError::Missing { .. }))
        ));
        let twice = [&parts[..1], &parts[..]].concat();
        assert!(matches!(
            merge(&twice, &at("less"), &|_| ()),
            Err(MergeError::Parts(PartsError::Twice { .. }))
        ));
        assert!(!at("less").exists());
    }
}

#[test]
fn a_second_run_renders_only_what_is_missing_or_broken() {
    for (plan, extension) in plans() {
        repair(&with_plan(&plan), extension);
    }
}

fn repair(folder: &TempDir, extension: &str) {
    let batch = load(folder).unwrap();
    let chunk = |number: u64| format!("chunk-{number:06}.{extension}");
    let data = folder.path().join("data");
    render_to(&batch, &data, None, 2);
    let whole = content(&data);
    fs::remove_file(data.join(chunk(2))).unwrap();
    let mut broken = whole[&chunk(4)].clone();
    // In the middle of the numbers.
    let place = broken.len() / 2;
    broken[place] ^= 1;
    fs::write(data.join(chunk(4)), &broken).unwrap();
    fs::write(data.join(chunk(5)), &broken[..place]).unwrap();
    fs::write(data.join(format!("{}.99-0.tmp", chunk(6))), "half").unwrap();
    fs::copy(data.join(chunk(0)), data.join(chunk(1))).unwrap();
    let again = render_to(&batch, &data, None, 1);
    assert_eq!((again.rendered, again.kept, again.replaced.len()), (4, 3, 3));
    assert!(again.is_complete);
    assert_eq!(content(&data), whole);
    let settings = RenderSettings::default();
    let no_progress = |part| panic!("{part} of nothing is done");
    let stop = AtomicBool::new(true);
    let stopped = render(&batch, &folder.path().join("none"), &settings, &no_progress, &stop).unwrap();
    assert!(stopped.was_stopped && stopped.rendered == 0 && !stopped.is_complete);
}

#[test]
fn a_job_is_what_the_library_gives_by_itself() {
    let folder = with_plan(&PLAN.replace("jobs_per_chunk: 3", "jobs_per_chunk: 100, samples: Float64"));
    let batch = load(&folder).unwrap();
    render_to(&batch, &folder.path().join("data"), None, 1);
    let job = (0..batch.jobs()).find(|job| {
        let Job { surface, motion, seed, .. } = batch.job(*job);
        (surface, motion, seed) == (1, 1, 4)
    });
    let walk = RandomWalk {
        seconds: 0.1,
        rate_hz: 2000.0,
        speed_m_s: (0.005, 0.17),
        force_n: (0.1, 2.0),
        cutoff_hz: 10.0,
        seed: stream_seed(4, "motion"),
    };
    let (texture, trajectory) = (texture(0.7), walk.trajectory());
    let settings = SynthesisSettings { seed: 4, lines_seed: 4, ..SynthesisSettings::default() };
    let voice = Voice { texture: &texture, trajectory: &trajectory, settings };
    let wanted = synthesise_many(&[voice], 1).unwrap().remove(0);
    let bytes = fs::read(folder.path().join("data/chunk-000000.npz")).unwrap();
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let mut array = Vec::new();
    let mut member = archive.by_name("vibration_m_s2.npy").unwrap();
    std::io::Read::read_to_end(&mut member, &mut array).unwrap();
    let stored = haptograph_surfaces::npy::doubles(&array, &[200]).unwrap();
    let start = job.unwrap() as usize * 200;
    assert_eq!(stored.len(), 20 * 200);
    assert_eq!(&stored[start..start + 200], wanted);
    assert_eq!(vibration(&batch, batch.job(job.unwrap())).unwrap(), wanted);
}

#[test]
fn another_plan_another_folder() {
    let folder = with_plan(PLAN);
    let batch = load(&folder).unwrap();
    let (data, part) = (folder.path().join("data"), folder.path().join("part"));
    render_to(&batch, &data, Some("1/2"), 1);
    let surface = folder.path().join("surfaces/tile.ron");
    fs::write(&surface, fs::read_to_string(&surface).unwrap() + "// changed\n").unwrap();
    let changed = load(&folder).unwrap();
    assert_ne!(batch.identity(), changed.identity());
    let settings = RenderSettings::default();
    let refused =
        |folder: &Path| render(&changed, folder, &settings, &|_| (), &AtomicBool::new(false)).unwrap_err();
    assert!(matches!(refused(&data), RenderError::Folder(FolderError::Other { .. })));
    render_to(&changed, &part, Some("2/2"), 1);
    let parts = [data.clone(), part.clone()];
    assert!(matches!(
        merge(&parts, &folder.path().join("all"), &|_| ()),
        Err(MergeError::Parts(PartsError::Different { .. }))
    ));
    let foreign = folder.path().join("surfaces");
    assert!(matches!(refused(&foreign), RenderError::Folder(FolderError::Foreign { .. })));
    assert_eq!(fs::read_dir(foreign).unwrap().count(), 2);
    let nothing = merge(&[folder.path().join("never")], &data, &|_| ());
    assert!(matches!(nothing, Err(MergeError::NoManifest { .. })));
}

#[test]
fn a_broken_part_is_not_merged() {
    let folder = with_plan(PLAN);
    let batch = load(&folder).unwrap();
    let parts = ["a", "b"].map(|name| folder.path().join(name));
    render_to(&batch, &parts[0], Some("1/2"), 1);
    render_to(&batch, &parts[1], Some("2/2"), 1);
    let chunk = parts[1].join("chunk-000003.npz");
    let mut bytes = fs::read(&chunk).unwrap();
    let place = bytes.len() / 2;
    bytes[place] ^= 1;
    fs::write(&chunk, bytes).unwrap();
    let refused = merge(&parts, &folder.path().join("all"), &|_| ());
    assert!(matches!(refused, Err(MergeError::Broken { path, .. }) if path == chunk));
    assert!(!folder.path().join("all").join(MANIFEST).exists());
    render_to(&batch, &parts[1], Some("2/2"), 1);
    merge(&parts, &folder.path().join("all"), &|_| ()).unwrap();
}

#[test]
fn a_manifest_that_no_run_wrote_is_not_merged() {
    let folder = with_plan(PLAN);
    let batch = load(&folder).unwrap();
    let part = folder.path().join("part");
    render_to(&batch, &part, None, 1);
    let path = part.join(MANIFEST);
    let sound: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let huge = serde_json::json!(u64::MAX);
    for (at, value) in [
        ("/jobs", huge.clone()),
        ("/jobs", 0.into()),
        ("/jobs", 21.into()),
        ("/jobs_per_chunk", 0.into()),
        ("/jobs_per_chunk", 1.into()),
        ("/chunks/2/chunk", 7.into()),
        ("/chunks/2/chunk", huge),
        ("/chunks/2/file", "../../elsewhere.npz".into()),
        ("/chunks/2/file", "chunk-000001.npz".into()),
        ("/chunks/2/jobs", serde_json::json!([0, 3])),
        ("/batch", "../x".into()),
        ("/haptograph", "0.0.0".into()),
        ("/plan", "".into()),
        ("/inputs/0/sha256", "0".into()),
        ("/surfaces", serde_json::json!(["cork"])),
        ("/format", "Parquet".into()),
    ] {
        let mut wrong = sound.clone();
        *wrong.pointer_mut(at).unwrap() = value;
        fs::write(&path, wrong.to_string()).unwrap();
        let refused = merge(std::slice::from_ref(&part), &folder.path().join("all"), &|_| ());
        assert!(matches!(refused, Err(MergeError::Manifest { .. })), "{at}: {refused:?}");
        assert!(!folder.path().join("all").exists());
    }
    fs::write(&path, sound.to_string()).unwrap();
    merge(&[part], &folder.path().join("all"), &|_| ()).unwrap();
}

#[test]
fn parts_of_different_processors_are_merged_when_asked() {
    let folder = with_plan(PLAN);
    let batch = load(&folder).unwrap();
    let parts = ["a", "b"].map(|name| folder.path().join(name));
    let own = render_to(&batch, &parts[0], Some("1/2"), 1).processors;
    assert_eq!(render_to(&batch, &parts[1], Some("2/2"), 1).processors, own);
    let manifest = parts[1].join(MANIFEST);
    let sound = fs::read_to_string(&manifest).unwrap();
    let own = own.first().unwrap();
    fs::write(&manifest, sound.replace(own, "z80-cpm")).unwrap();
    let all = folder.path().join("all");
    let refused = merge(&parts, &all, &|_| ());
    assert!(matches!(refused, Err(MergeError::Processors { processors }) if processors == [own, "z80-cpm"]));
    assert!(!all.exists());
    let merged = super::merge(&parts, &all, Processors::Any, &|_| ()).unwrap();
    assert_eq!(merged.processors.iter().collect::<Vec<_>>(), [own, "z80-cpm"]);
    assert!(read_manifest(&all).unwrap().contains("z80-cpm"));
    // A manifest that says nothing of the processor of its chunks is not theirs.
    let refused = super::merge(&parts[1..], &all, Processors::Any, &|_| ());
    assert!(matches!(refused, Err(MergeError::Parts(PartsError::Missing { .. }))));
    for part in &parts {
        let path = part.join(MANIFEST);
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replace(own, "z80-cpm")).unwrap();
    }
    assert!(matches!(merge(&parts, &folder.path().join("none"), &|_| ()), Err(MergeError::Broken { .. })));
}

#[test]
fn jobs_have_gains_and_update_rates_of_their_own() {
    let folder =
        with_plan(&PLAN.replace("Product(seeds: (1, 5))", "Table(\"jobs.csv\"), update_hz: 100, gain: 2"));
    let rows = "surface;motion;seed;gain;update_hz\ntile;walk;1;;\ntile;walk;1;-0,5;\ntile;walk;1;1;500\n";
    fs::write(folder.path().join("jobs.csv"), rows).unwrap();
    let batch = load(&folder).unwrap();
    let jobs = [0, 1, 2].map(|job| batch.job(job));
    assert_eq!(jobs.map(|job| job.gain), [2.0, -0.5, 1.0]);
    assert_eq!(jobs.map(|job| job.update_hz), [100.0, 100.0, 500.0]);
    let [usual, turned, quick] = jobs.map(|job| vibration(&batch, job).unwrap());
    let ratio: Vec<f64> = turned.iter().map(|sample| sample * -4.0).collect();
    assert_eq!(ratio, usual);
    assert!(usual.iter().zip(&quick).any(|(usual, quick)| *usual != 2.0 * quick));
    // In the same chunk as others a job has its own settings too.
    render_to(&batch, &folder.path().join("data"), None, 1);
    let bytes = fs::read(folder.path().join("data/chunk-000000.npz")).unwrap();
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let mut array = Vec::new();
    let mut member = archive.by_name("vibration_m_s2.npy").unwrap();
    std::io::Read::read_to_end(&mut member, &mut array).unwrap();
    let stored = haptograph_surfaces::npy::doubles(&array, &[usual.len() as u64]).unwrap();
    let wanted: Vec<f64> =
        [usual, turned, quick].concat().iter().map(|sample| f64::from(*sample as f32)).collect();
    assert_eq!(stored, wanted);
}

#[test]
fn a_table_names_each_job() {
    let plan = PLAN.replace("Product(seeds: (1, 5))", "Table(\"jobs.csv\")");
    let folder = with_plan(&plan);
    let table = folder.path().join("jobs.csv");
    fs::write(&table, "# mine\nseed,surface,motion\n7, tile, walk\n18446744073709551615,cork,still\n")
        .unwrap();
    let batch = load(&folder).unwrap();
    assert_eq!(batch.jobs(), 2);
    assert_eq!(batch.job(0), Job { surface: 1, motion: 1, seed: 7, gain: 1.0, update_hz: 240.0 });
    assert_eq!(batch.job(1), Job { surface: 0, motion: 0, seed: u64::MAX, gain: 1.0, update_hz: 240.0 });
    for (rows, line) in [
        ("surface,motion,seed\ntile,walk,1\ncloth,walk,1\n", Some(3)),
        ("surface,motion,seed\ntile,run,1\n", Some(2)),
        ("surface,motion,seed\ntile,walk,-1\n", Some(2)),
        ("surface,motion,seed\ntile,walk\n", Some(2)),
        ("surface,motion\ntile,walk\n", Some(1)),
        ("surface,motion,seed,gain\ntile,walk,1,NaN\n", Some(2)),
        ("surface,motion,seed,gain\ntile,walk,1,1e10\n", Some(2)),
        ("surface,motion,seed,update_hz\ntile,walk,1,\ntile,walk,1,0\n", Some(3)),
        ("surface,motion,seed,loudness\ntile,walk,1,1\n", Some(1)),
    ] {
        fs::write(&table, rows).unwrap();
        let error = load(&folder).unwrap_err();
        assert_eq!((error.place.map(|place| place.line), &error.path), (line, &table), "{rows}: {error}");
    }
    fs::write(&table, "surface,motion,seed\n").unwrap();
    assert!(matches!(load(&folder).unwrap_err().problem, PlanProblem::Nothing { what: "jobs" }));
}

#[test]
fn what_is_wrong_with_a_plan_is_shown_at_its_place() {
    for (from, to, line) in [
        ("jobs_per_chunk", "jobs_per_junk", 8),
        ("\"surfaces/*.ron\"", "\"surfaces/*.xml\"", 2),
        ("\"surfaces/*.ron\"", "\"none.ron\"", 2),
        ("\"surfaces/*.ron\"", "\"surfaces/*.ron\", \"surfaces/tile.ron\"", 2),
        ("speed_mm_s: 80", "speed_mm_s: -80", 4),
        ("speed_mm_s: (5, 170)", "speed_mm_s: (170, 5)", 5),
        ("seconds: 0.1", "seconds: 0", 5),
        ("seconds: 0.1", "seconds: 1e9", 5),
        ("cutoff_hz: 10", "cutoff_hz: 60", 5),
        ("Constant(seconds: 0.05, speed_mm_s: 80, force_n: 1)", "Recording(\"take.csv\")", 4),
        ("(1, 5)", "(5, 1)", 7),
        ("(1, 5)", "(0, 18446744073709551615)", 7),
        ("seconds: 0.1", "seconds: 3600", 7),
        ("jobs_per_chunk: 3", "jobs_per_chunk: 0", 8),
        ("jobs_per_chunk: 3", "write: [Speed, Speed]", 8),
        ("jobs_per_chunk: 3", "write: []", 8),
        ("jobs_per_chunk: 3", "update_hz: 0.1", 8),
        ("jobs_per_chunk: 3", "gain: 1e300", 8),
    ] {
        let mut plan = PLAN.replace(from, to);
        if to == "seconds: 3600" {
            plan = plan.replace("jobs_per_chunk: 3", "jobs_per_chunk: 60").replace("(1, 5)", "(1, 500)");
        }
        let folder = with_plan(&plan);
        let error = load(&folder).unwrap_err();
        assert_eq!(error.place.map(|place| place.line), Some(line), "{to}: {error}");
    }
}

#[test]
fn shards_are_written_as_k_of_n() {
    let numbers = |shard: &str| {
        let shard: Shard = shard.parse().unwrap();
        (0..7).filter(|item| shard.has(*item)).collect::<Vec<u64>>()
    };
    assert_eq!(numbers("1/3"), [0, 3, 6]);
    assert_eq!(numbers("3/3"), [2, 5]);
    for wrong in ["0/3", "4/3", "1", "a/b", "1/0", "-1/3", ""] {
        assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
    }
}

mod parquet;
