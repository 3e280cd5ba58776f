//! Graph files through the front door: right ones become graphs, wrong ones say what is wrong.
//!
//! Every `tests/wrong/*.ron` has beside it what is printed for it; `BLESS=1 cargo test` writes these anew, to be
//! read before they are committed. A first line `// --set a=1 --endpoints live` gives options.

mod common;

use haptograph_engine::diagnostic::{Diagnostics, render};
use haptograph_engine::document::{Builder, Document, LoadOptions, Part, delay, hold};
use haptograph_engine::graph::{Bridge, CheckOptions, Graph, check};
use std::path::{Path, PathBuf};

fn options_of(text: &str) -> CheckOptions {
    let mut options = CheckOptions::default();
    let line = text.lines().next().unwrap_or_default();
    let mut words = line.strip_prefix("// ").unwrap_or_default().split_whitespace();
    while let Some(word) = words.next() {
        let mut value = || words.next().expect("a value").to_owned();
        match word {
            "--set" => {
                let pair = value();
                let (name, value) = pair.split_once('=').expect("NAME=VALUE");
                options.set.push((name.into(), value.into()));
            }
            "--endpoints" => options.endpoints = value(),
            _ => break,
        }
    }
    options
}

fn load(path: &Path) -> Result<Graph, Diagnostics> {
    let options = std::fs::read_to_string(path)
        .map(|text| options_of(&text))
        .unwrap_or_default();
    let document = Document::load(path, &LoadOptions::default())?;
    check(&document, &common::registry(), &options)
}

fn files(folder: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect(folder);
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "ron"))
        .collect();
    files.sort();
    files
}

#[test]
fn right_graphs_are_sound_and_without_warnings() {
    for path in files("tests/right") {
        match load(&path) {
            Ok(graph) => assert!(
                graph.warnings().is_empty(),
                "{}: {:?}",
                path.display(),
                graph.warnings()
            ),
            Err(diagnostics) => panic!("{diagnostics}"),
        }
    }
}

#[test]
fn wrong_graphs_say_what_is_wrong() {
    let bless = std::env::var_os("BLESS").is_some();
    let mut differing = Vec::new();
    for path in files("tests/wrong") {
        let printed = match load(&path) {
            Err(diagnostics) => render(&diagnostics, false),
            Ok(graph) => {
                assert!(!graph.warnings().is_empty(), "{} is right", path.display());
                let list = graph.warnings().to_vec();
                let sources = graph.sources().clone();
                render(&Diagnostics { sources, list }, false)
            }
        };
        let kept = path.with_extension("stderr");
        if bless {
            std::fs::write(&kept, &printed).expect("writable");
        } else if std::fs::read_to_string(&kept).unwrap_or_default() != printed {
            differing.push(format!("{}:\n{printed}", path.display()));
        }
    }
    assert!(differing.is_empty(), "{}", differing.join("\n"));
}

#[test]
fn a_template_becomes_nodes_with_paths_and_everything_inferred() {
    let graph = load(Path::new("tests/right/texturepad.ron")).unwrap_or_else(|d| panic!("{d}"));
    let nodes = graph.nodes();
    let lines: Vec<String> = nodes
        .node_weights()
        .map(|node| {
            let clock = node
                .clock
                .map_or("-", |clock| graph.clocks()[clock].name.as_str());
            let outputs: Vec<String> = node
                .outputs
                .iter()
                .map(|o| format!("{} {} {}", o.name, o.kind, o.quantity))
                .collect();
            format!(
                "{} @{clock} sim={} [{}]",
                node.path,
                node.simulated,
                outputs.join("; ")
            )
        })
        .collect();
    assert_eq!(
        lines,
        [
            "stylus @tablet sim=true [position 3-vector length (m); force scalar force (N)]",
            "speed @tablet sim=true [speed scalar speed (m/s)]",
            "texture/locate @tablet sim=true [weights weights number (1)]",
            "texture/filter @synth sim=true [acceleration scalar acceleration (m/s2)]",
            "drive @synth sim=true [current scalar current (A)]",
            "out @audio sim=true [delivered scalar current (A)]",
            "file @- sim=true []",
            "pen @- sim=true []",
        ]
    );
    let bridges: Vec<Bridge> = nodes
        .edge_weights()
        .map(|edge| edge.bridge)
        .filter(|b| *b != Bridge::Direct)
        .collect();
    assert_eq!(bridges, [Bridge::Hold, Bridge::Resample]);
    assert_eq!(graph.devices().len(), 2);
    assert_eq!((graph.seed(), graph.about()), (7, "A tablet, a surface, a coil."));
}

#[test]
fn a_graph_can_be_built_in_code() {
    let document = Builder::new("A tone \"and\" its echo.\nTwo lines.")
        .seed(3)
        .driver("audio", 48_000.0)
        .derived("slow", "audio", 1000.0)
        .node("tone", Part::new("Sine").on("audio").set("quantity", "force"))
        .node(
            "slow",
            Part::new("Gain")
                .on("slow")
                .wire("input", hold("tone.output"))
                .set("gain", 0.5),
        )
        .node(
            "mix",
            Part::new("Sum").wires("inputs", ["tone.output".into(), delay("mix.output", 5)]),
        )
        .node(
            "file",
            Part::new("Wav").wires("inputs", ["slow"]).set("file", "a.wav"),
        )
        .node(
            "other",
            Part::new("Wav").wires("inputs", ["mix"]).set("file", "b.wav"),
        )
        .build()
        .unwrap_or_else(|d| panic!("{d}"));
    let graph =
        check(&document, &common::registry(), &CheckOptions::default()).unwrap_or_else(|d| panic!("{d}"));
    assert_eq!(graph.about(), "A tone \"and\" its echo.\nTwo lines.");
    assert_eq!(graph.nodes().node_count(), 5);
    assert!(graph.warnings().is_empty());
}
