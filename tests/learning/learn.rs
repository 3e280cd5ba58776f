//! Recordings become surfaces.

use super::{fail, haptograph, json, noise, succeed, told_by, workshop};
use std::fs;
use std::path::Path;
use std::process::Command;

#[test]
fn a_surface_is_learned_whole_and_again_to_the_bit() {
    let folder = workshop();
    let shown = json(folder, &["surface", "show", "t1.ron", "--json"]);
    for part in ["friction", "taps", "texture", "stiffness"] {
        assert!(shown[part].is_object(), "{part} is missing: {shown}");
    }
    assert_eq!(shown["provenance"]["origin"], "simulated");
    // The simulated material's own numbers: friction 0.18, stiffness 42.2 N/mm.
    assert!((shown["friction"]["mu"].as_f64().unwrap() - 0.18).abs() < 0.03, "{}", shown["friction"]);
    assert!(
        (shown["stiffness"]["n_per_mm"].as_f64().unwrap() / 42.2 - 1.0).abs() < 0.1,
        "{}",
        shown["stiffness"]
    );
    assert!(!shown["taps"]["speeds_mm_s"].as_array().unwrap().is_empty());
    let centroid_hz = shown["taps"]["spectral_centroid_hz"].as_f64().unwrap();
    let text = succeed(folder, &["surface", "show", "t1.ron"]);
    assert!((20.0..500.0).contains(&centroid_hz) && text.contains("spectral centroid"), "{text}");
    let again = [
        "learn",
        "study/T1.anna.1.npz",
        "circle.npz",
        "tap.npz",
        "press.npz",
        "-o",
        "again.ron",
        "--name",
        "t1",
    ];
    succeed(folder, &again);
    assert!(fs::read(folder.join("again.ron")).unwrap() == fs::read(folder.join("t1.ron")).unwrap());
    assert_eq!(shown["provenance"]["settings"]["recording 1 file"], "T1.anna.1.npz");
}

#[test]
fn what_touched_the_surface_and_the_low_pass_are_in_its_provenance() {
    let folder = workshop();
    let stated = ["--tip-diameter", "3.175", "--grip", "as a pen", "--touched-with", "tool"];
    succeed(folder, &[&["convert-recording", "study/T1.anna.1.npz", "touched.npz"], &stated[..]].concat());
    let learn = ["learn", "touched.npz", "-o", "touched.ron", "--velocity-lowpass", "60"];
    succeed(folder, &learn);
    let shown = json(folder, &["surface", "show", "touched.ron", "--json"]);
    let settings = &shown["provenance"]["settings"];
    for (name, value) in [
        ("tip_diameter_mm", "3.175"),
        ("grip", "as a pen"),
        ("touched_with", "tool"),
        ("processing.velocity_lowpass_hz", "60"),
    ] {
        assert_eq!(settings[name], value, "{settings}");
    }
    assert!(succeed(folder, &["surface", "show", "touched.ron"]).contains("as a pen"));
    // Of several recordings each has its own, unless all agree.
    let both = ["learn", "touched.npz", "circle.npz", "-o", "both.ron"];
    succeed(folder, &both);
    let shown = json(folder, &["surface", "show", "both.ron", "--json"]);
    assert_eq!(shown["provenance"]["settings"]["recording 1 grip"], "as a pen");
    let none = ["learn", "touched.npz", "-o", "none.ron", "--touched-with", "foot"];
    let output = haptograph(folder, &none, "");
    assert_eq!(output.status.code(), Some(2));
    assert!(!folder.join("none.ron").exists());
}

#[test]
fn a_recording_goes_through_the_toolkits_files() {
    let folder = workshop();
    let to = ["convert-recording", "study/T1.anna.1.npz", "Accel_T1.xml", "--json"];
    let written = json(folder, &to);
    let names = ["Accel_T1.xml", "Position_T1.xml", "Force_T1.xml"];
    assert_eq!(written["written"], serde_json::json!(names));
    succeed(folder, &["convert-recording", "Force_T1.xml", "back.npz"]);
    for (from, to) in [("study/T1.anna.1.npz", "straight.ron"), ("back.npz", "through.ron")] {
        succeed(folder, &["learn", from, "-o", to, "--name", "t1"]);
    }
    let shown = |name: &str| json(folder, &["surface", "show", name, "--json"]);
    let (straight, through) = (shown("straight.ron"), shown("through.ron"));
    let powers = |shown: &serde_json::Value| -> Vec<f64> {
        let models = shown["texture"]["models"].as_array().unwrap().iter();
        models.map(|model| model["power_m2_s4"].as_f64().unwrap()).collect()
    };
    // Speeds in mm/s may differ in their last bit.
    let (straight, back) = (powers(&straight), powers(&through));
    let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-6 * a.abs();
    assert!(straight.len() == back.len() && straight.iter().zip(&back).all(is_near));
    assert_eq!(through["provenance"]["origin"], "simulated");
    let circle = ["convert-recording", "circle.npz", "Accel_circle.xml"];
    assert!(told_by(&haptograph(folder, &circle, "")).contains("--circle"));
    assert!(fail(folder, &["convert-recording", "back.npz", "plain.xml"]).contains("Accel_<material>.xml"));
}

#[test]
fn a_processed_table_is_enough_to_learn_from() {
    let folder = tempfile::tempdir().unwrap();
    let excitation = noise(20_000, 1);
    let mut y = [0.0; 2];
    let mut text =
        "# rate_hz: 10000\naccel_m_s2, force_normal_n, force_tangential_n, speed_mm_s\r\n".to_owned();
    for (i, e) in excitation.iter().enumerate() {
        // Four stretches of other speeds and forces, each with a loudness of its own.
        let (speed, force) = [(60.0, 0.5), (150.0, 1.0), (90.0, 2.0), (200.0, 1.5)][i / 5000];
        let next = 1.2 * y[0] - 0.7 * y[1] + speed * force / 100.0 * e;
        y = [next, y[0]];
        text += &format!("{next}, {force}, {}, {speed}\r\n", 0.4 * force);
    }
    fs::write(folder.path().join("processed.csv"), text).unwrap();
    succeed(
        folder.path(),
        &["learn", "processed.csv", "-o", "surface.ron", "--method", "thesis", "--keep-outliers"],
    );
    let shown = json(folder.path(), &["surface", "show", "surface.ron", "--json"]);
    assert!((shown["friction"]["mu"].as_f64().unwrap() - 0.4).abs() < 1e-6);
    let measured =
        shown["texture"]["models"].as_array().unwrap().iter().filter(|model| model["kind"] == "measured");
    let ar = measured.map(|model| model["ar"][0].as_f64().unwrap()).collect::<Vec<_>>();
    assert!(ar.len() >= 4 && ar.iter().all(|a| (a + 1.2).abs() < 0.1), "{ar:?}");
}

#[test]
fn a_surface_without_friction_says_so_and_keeps_its_texture() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "# rate_hz: 10000\naccel_m_s2,force_normal_n,force_tangential_n,speed_mm_s\n".to_owned();
    for (i, a) in noise(8000, 1).iter().enumerate() {
        // The tool is pulled along: no friction does that.
        let (force, speed) = (1.0 + (i / 2000) as f64, 50.0 + 30.0 * (i / 2000 % 2) as f64);
        text += &format!("{a},{force},{},{speed}\n", -0.2 * force);
    }
    fs::write(folder.path().join("pulled.csv"), text).unwrap();
    let learned =
        haptograph(folder.path(), &["learn", "pulled.csv", "-o", "pulled.ron", "--report", "page"], "");
    let (said, warned) = (String::from_utf8_lossy(&learned.stdout), String::from_utf8_lossy(&learned.stderr));
    assert!(learned.status.success(), "{warned}");
    for part in ["the surface has no friction", "the friction coefficient would be", "--circle"] {
        assert!(warned.contains(part), "{part} is missing: {warned}");
    }
    assert!(said.contains("friction  none"), "{said}");
    let shown = json(folder.path(), &["surface", "show", "pulled.ron", "--json"]);
    assert!(shown["texture"].is_object() && shown["friction"].is_null());
    let settings = &shown["provenance"]["settings"];
    assert!(
        settings["not learned: friction"].as_str().unwrap().contains("friction coefficient"),
        "{settings}"
    );
    let page = fs::read_to_string(folder.path().join("page/report.html")).unwrap();
    assert!(page.contains("the surface has no friction"));
}

/// The shell blocks of a page of the book, run one after the other as they stand there; what they print, and the folder.
#[cfg(unix)]
fn run_chapter(page: &str) -> (String, String, tempfile::TempDir) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().unwrap();
    for shared in ["graphs", "examples"] {
        std::os::unix::fs::symlink(root.join(shared), folder.path().join(shared)).unwrap();
    }
    let program = Path::new(env!("CARGO_BIN_EXE_haptograph")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap_or_default());
    let chapter = fs::read_to_string(root.join("docs").join(page)).unwrap();
    let blocks: String = chapter
        .split("```sh\n")
        .skip(1)
        .filter_map(|rest| rest.split_once("```"))
        .map(|(block, _)| block)
        .collect();
    let output = Command::new("sh")
        .args(["-e", "-c", &blocks])
        .env("PATH", path)
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    (chapter, printed, folder)
}

/// Every command of the chapter runs as it stands there.
#[cfg(unix)]
#[test]
fn the_chapter_on_learning_is_true() {
    let (chapter, _, folder) = run_chapter("learning.md");
    assert!(chapter.matches("\nhaptograph ").count() > 15);
    for made in ["tile/report.html", "out/texturepad/report.html", "study-report/report.html", "tile.1k.ron"]
    {
        assert!(folder.path().join(made).is_file(), "{made} is missing");
    }
}

/// So do those of the chapter on recording, and they print what it shows.
#[cfg(unix)]
#[test]
fn the_chapter_on_recording_is_true() {
    let (chapter, printed, folder) = run_chapter("recording.md");
    for made in [
        "my-tile/report.html",
        "my-tile-held-out/report.html",
        "out/again/vibration.wav",
        "out/texturepad/report.html",
    ] {
        assert!(folder.path().join(made).is_file(), "{made} is missing");
    }
    let mut shown = 0;
    for start in ["wrote my-tile.ron\norigin ", "log-spectral distance"] {
        let begin = chapter.find(&format!("```text\n{start}")).unwrap() + "```text\n".len();
        let block = chapter[begin..].split("```").next().unwrap();
        for line in block.lines() {
            assert!(printed.contains(line), "not printed: {line}\n{printed}");
            shown += 1;
        }
    }
    assert!(shown > 8, "{shown}");
}
