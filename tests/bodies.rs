//! The graphs whose devices push back: closed loops through simulated bodies.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Runs a shipped graph with more arguments.
fn run(graph: &str, arguments: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let graph = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs").join(graph);
    let output = Command::new(env!("CARGO_BIN_EXE_haptograph"))
        .arg("run")
        .arg(graph)
        .args(["--out", "run"])
        .args(arguments)
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    folder
}

/// A file that a run leaves.
fn text_of(graph: &str, arguments: &[&str], file: &str) -> String {
    let folder = run(graph, arguments);
    fs::read_to_string(folder.path().join("run").join(file)).unwrap()
}

/// The bytes of every signal of a run by name.
fn signals(graph: &str, arguments: &[&str]) -> BTreeMap<String, Vec<u8>> {
    let folder = run(graph, &[arguments, &["--record"]].concat());
    let files = fs::read_dir(folder.path().join("run/record")).unwrap();
    files
        .map(|file| file.unwrap().path())
        .map(|path| {
            (
                path.file_name().unwrap().to_string_lossy().into_owned(),
                fs::read(path).unwrap(),
            )
        })
        .collect()
}

/// A loop through a body runs at the body's period, however time is cut.
#[test]
fn blocks_change_no_bit_of_a_closed_loop_and_a_seed_does() {
    for graph in ["omni.ron", "ar-pen.ron"] {
        let usual = signals(graph, &["--for", "1.5"]);
        assert!(usual.len() > 30, "{graph}: {} signals", usual.len());
        for cut in [["--block", "1"], ["--block", "640"]] {
            let other = signals(graph, &["--for", "1.5", cut[0], cut[1]]);
            for (name, bytes) in &usual {
                assert!(other.get(name) == Some(bytes), "{graph}, {cut:?}: {name}");
            }
        }
        assert!(
            signals(graph, &["--for", "1.5", "--seed", "8"]) != usual,
            "{graph}"
        );
    }
}

/// The four conditions of responsiveness, laid over each other by one command.
#[test]
fn a_sweep_leaves_a_page_and_a_folder_for_each_run() {
    let folder = tempfile::tempdir().unwrap();
    let graph = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/omni.ron");
    let output = Command::new(env!("CARGO_BIN_EXE_haptograph"))
        .arg("sweep")
        .arg(graph)
        .args(["--over", "condition=ForceAndSpeed,Force,Speed,Neither"])
        .args(["--for", "1", "--out", "sweep"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}");
    let page = fs::read_to_string(folder.path().join("sweep/report.html")).unwrap();
    for said in ["ForceAndSpeed", "Neither", "simulated"] {
        assert!(page.contains(said), "{said}");
    }
    let wav = |run: &str| fs::read(folder.path().join("sweep").join(run).join("texture.wav")).unwrap();
    assert!(wav("01") != wav("02") && wav("03") != wav("04"));
}

/// Whatever is put under the hand is touched, held within the arm's limits and slid over.
#[test]
fn the_omni_renders_any_scene() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("slope.stl");
    fs::write(
        &mesh,
        "solid s\nfacet normal 0 0 1\nouter loop\nvertex -60 -60 0\nvertex 60 -60 10\nvertex 0 80 5\nendloop\nendfacet\nendsolid s\n",
    )
    .unwrap();
    for scene in [
        "[Plane()]".to_owned(),
        "[Box(size_mm: (90, 90, 60))]".to_owned(),
        "[Room(size_mm: (180, 140, 120))]".to_owned(),
        "[Sphere(diameter_mm: 50), Box(size_mm: (40, 40, 40), centre_mm: (70, 0, 0)), Room(size_mm: (240, 140, 120))]".to_owned(),
        format!("[Mesh(file: {:?})]", mesh.display().to_string()),
    ] {
        let set = format!("scene={scene}");
        let table = text_of("omni.ron", &["--for", "2", "--set", &set], "touch.csv");
        let mut lines = table.lines();
        let header: Vec<&str> = lines.next().unwrap().split(',').collect();
        let rows: Vec<Vec<f64>> = lines
            .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
            .collect();
        let column = |name: &str| {
            let place = header.iter().position(|h| *h == name).unwrap();
            rows.iter().map(move |row| row[place]).collect::<Vec<f64>>()
        };
        let touching: f64 = column("touch.contact_touching").iter().sum();
        assert!(touching > 500.0, "{scene}: {touching} ticks");
        let most = |name: &str| column(name).into_iter().fold(0.0, f64::max);
        assert!((0.5..3.3).contains(&most("normal.load_n")), "{scene}");
        assert!((0.03..0.5).contains(&most("slide.speed_m_s")), "{scene}");
        let axes = ["x", "y", "z"].map(|axis| column(&format!("push.delivered_{axis}_n")));
        let largest = (0..rows.len()).map(|k| axes.iter().map(|a| a[k] * a[k]).sum::<f64>().sqrt());
        assert!(largest.fold(0.0, f64::max) < 3.3 + 1e-9, "{scene}");
    }
}

/// The fit of the simulated actuator's own sweep, noise and all.
#[test]
fn a_recorded_sweep_tells_the_actuator() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sweep.csv");
    fs::write(&file, text_of("identify.ron", &[], "sweep.csv")).unwrap();
    let identify = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_haptograph"))
            .args(["identify", "--json"])
            .arg(&file)
            .args(arguments)
            .output()
            .unwrap();
        assert!(output.status.success());
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    let plain = identify(&[]);
    assert!(plain["parameters"].is_null());
    assert!((plain["resonances"][0]["frequency_hz"].as_f64().unwrap() - 100.0).abs() < 2.0);
    let known = identify(&["--magnet-g", "6", "--force-n-per-a", "2.9"]);
    for (name, truth) in [
        ("body_g", 50.0),
        ("suspension_n_per_mm", 2.1),
        ("suspension_n_s_per_m", 0.85),
        ("hand_n_per_mm", 0.5),
        ("hand_n_s_per_m", 3.0),
    ] {
        let found = known["parameters"][name].as_f64().unwrap();
        assert!((found / truth - 1.0).abs() < 0.05, "{name}: {found}");
    }
}
