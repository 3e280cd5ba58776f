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
    for graph in ["omni.ron"] {
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
