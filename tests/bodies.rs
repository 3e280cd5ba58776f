//! The graphs whose devices push back: closed loops through simulated bodies.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Runs a shipped graph with more arguments and gives the bytes of every signal of it by name.
fn signals(graph: &str, arguments: &[&str]) -> BTreeMap<String, Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let graph = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs").join(graph);
    let output = Command::new(env!("CARGO_BIN_EXE_haptograph"))
        .arg("run")
        .arg(graph)
        .args(["--record", "--out", "run"])
        .args(arguments)
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
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
