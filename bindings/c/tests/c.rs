//! C programs with the library: what hostile ones get, and that the bits are those of the engine.
#![cfg(unix)]

use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, check};
use haptograph_engine::host::{Scalar, Vector};
use haptograph_engine::run::{Player, SessionOptions};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn here(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(file)
}

/// Compiles a program with the library that this test was built with, and runs it.
fn run(source: &str, arguments: &[&Path]) -> Output {
    let test = std::env::current_exe().expect("a test");
    let made = test.parent().expect("the folder of the library");
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("program");
    let compiled = Command::new("cc")
        .args(["-std=c11", "-O1", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&program)
        .arg(here(source))
        .arg("-I")
        .arg(here("include"))
        .arg(made.join("libhaptograph_c.a"))
        .args(["-lpthread", "-ldl", "-lm", "-lgcc_s"])
        .output()
        .expect("a C compiler");
    let said = String::from_utf8_lossy(&compiled.stderr).into_owned();
    assert!(compiled.status.success(), "{said}");
    let mut command = Command::new(&program);
    command.args(arguments).current_dir(folder.path());
    command.output().expect("a program that starts")
}

fn assert_success(ended: &Output) {
    let said = String::from_utf8_lossy(&ended.stdout).into_owned() + &String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{}: {said}", ended.status);
}

#[test]
fn hostile_calls_end_in_errors() {
    assert_success(&run("tests/hostile.c", &[&here("../../graphs/texturepad.ron")]));
}

#[test]
fn a_run_is_looked_at_and_its_graph_changed() {
    assert_success(&run("tests/live.c", &[&here("../../graphs/texturepad.ron")]));
}

/// The programs judge what came out.
#[test]
fn callbacks_in_the_style_of_others_render() {
    for (source, graph) in [("examples/hd.c", "omni"), ("examples/unity.c", "texturepad")] {
        assert_success(&run(source, &[&here(&format!("../../graphs/{graph}.ron"))]));
    }
}

/// What `examples/audio.c` does, by the engine itself.
fn texture() -> Vec<f32> {
    let document = Document::load(here("../../graphs/texturepad.ron"), &LoadOptions::default())
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    let mut options = CheckOptions::hosted();
    options.set = vec![("gain".to_owned(), "0.8".to_owned())];
    let graph =
        check(&document, &haptograph_nodes::registry(), &options).unwrap_or_else(|wrong| panic!("{wrong}"));
    let mut position = graph.input::<Vector>("stylus.position").expect("a position");
    let mut force = graph.input::<Scalar>("stylus.force").expect("a force");
    let mut touching = graph.input::<Scalar>("stylus.touching").expect("a touch");
    let mut current = graph.output::<Scalar>("haptuator").expect("a current");
    let (mut player, mut session) = Player::open(&graph, &SessionOptions::default().rested()).expect("plays");
    let mut all = Vec::new();
    for call in 0..375_u32 {
        if call == 375 / 2 {
            session.set_by_name("out.gain", 0.4).expect("a live gain");
        }
        let at = 5.2 * (f64::from(256 * call) / 48_000.0);
        position.set([0.03 * at.cos(), 0.03 * at.sin(), 0.0]).expect("room");
        force.set(1.0).expect("room");
        touching.set(1.0).expect("room");
        player.process(256);
        all.extend(std::iter::from_fn(|| current.take()).map(|ampere| ampere as f32));
    }
    all
}

#[test]
fn an_audio_callback_in_c_plays_the_bits_of_the_engine() {
    let folder = tempfile::tempdir().expect("a folder");
    let wav = folder.path().join("texture.wav");
    let ended = run("examples/audio.c", &[&here("../../graphs/texturepad.ron"), &wav]);
    assert_success(&ended);
    let bytes = std::fs::read(wav).expect("a WAV file");
    let samples =
        bytes[44..].chunks_exact(4).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]]));
    assert!(samples.eq(texture()), "other bits");
}
