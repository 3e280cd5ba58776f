//! The shipped TexturePad, as its users run it: graphs/texturepad.ron.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::run::{FileSinks, Session, SessionOptions};
use std::path::{Path, PathBuf};

fn graphs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs")
}

fn texturepad(set: &[(&str, &str)]) -> Graph {
    let document = Document::load(graphs().join("texturepad.ron"), &LoadOptions::default())
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    let options = CheckOptions::default();
    let options = set.iter().fold(options, |options, (name, value)| options.set(*name, *value));
    check(&document, &haptograph_nodes::registry(), &options).unwrap_or_else(|wrong| panic!("{wrong}"))
}

/// Samples of `texture.wav` and `current.wav`.
fn render(graph: &Graph, seconds: f64, block: usize) -> [Vec<f32>; 2] {
    let folder = tempfile::tempdir().unwrap();
    let mut outlets = FileSinks::new(graph);
    outlets.open_files(folder.path()).unwrap();
    let options = SessionOptions::default().block(block).seconds(seconds);
    let outcome = Session::run_offline(outlets, &options, &mut |_| {}).unwrap();
    assert_eq!(outcome.faults.ticks, 0);
    ["texture.wav", "current.wav"].map(|file| {
        let mut reader = hound::WavReader::open(folder.path().join(file)).unwrap();
        reader.samples::<f32>().map(Result::unwrap).collect()
    })
}

#[test]
fn it_is_sound_and_renders_vibration() {
    let graph = texturepad(&[]);
    assert!(graph.warnings().is_empty(), "{:?}", graph.warnings());
    let [vibration, current] = render(&graph, 1.0, 0);
    assert_eq!((vibration.len(), current.len()), (10_000, 48_000));
    assert!(vibration.iter().any(|a| a.abs() > 1e-3), "there is something to feel");
    assert!(current.iter().any(|i| i.abs() > 1e-3));
    assert!(current.iter().all(|i| i.abs() <= 0.5), "the limit holds");
}

#[test]
fn the_same_bits_for_any_block() {
    let graph = texturepad(&[]);
    let whole = render(&graph, 0.5, 0);
    for block in [1, 17, 1024] {
        let cut = render(&graph, 0.5, block);
        assert!(whole == cut, "block {block}");
    }
}

#[test]
fn gain_zero_is_no_current() {
    let [_, current] = render(&texturepad(&[("gain", "0.0")]), 0.2, 0);
    assert!(current.iter().all(|i| *i == 0.0));
}

#[test]
fn a_node_is_another_one_once_its_file_has_changed() {
    let folder = tempfile::tempdir().unwrap();
    let surface = folder.path().join("surface.ron");
    std::fs::copy(graphs().join("surfaces/t3-tile.ron"), &surface).unwrap();
    let fingerprints = || {
        let graph = texturepad(&[("surface", surface.to_str().unwrap())]);
        graph.nodes().iter().map(|node| node.fingerprint).collect::<Vec<_>>()
    };
    let before = fingerprints();
    assert_eq!(before, fingerprints());
    let text = std::fs::read_to_string(&surface).unwrap();
    std::fs::write(&surface, format!("// Saved again.\n{text}")).unwrap();
    let after = fingerprints();
    assert!(before.iter().zip(&after).any(|(before, after)| before != after));
    assert!(before.iter().zip(&after).any(|(before, after)| before == after), "the tablet is the same");
}
