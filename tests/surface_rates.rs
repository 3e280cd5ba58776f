//! Surfaces of 1 kHz in graphs that synthesise at 10 kHz: `--set surface=` is all it takes.
#![allow(clippy::unwrap_used)]

use haptograph::engine::diagnostic::Diagnostics;
use haptograph::engine::document::Document;
use haptograph::engine::graph::{CheckOptions, Graph, check};
use haptograph::engine::run::{FileSinks, Session, SessionOptions};
use haptograph::signal::spectrum::{arma_density, welch};
use haptograph::signal::window::Window;
use haptograph::surfaces::files::{load, native, read_surface, save};
use haptograph::surfaces::resampling::{Method, resample_surface};
use haptograph::surfaces::{Coefficients, Interpolator};
use std::fs;
use std::path::{Path, PathBuf};

fn graphs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs")
}

/// A surface of the thesis's method at 1 kHz in a file of either format.
fn slow(folder: &Path, method: Method, file: &str) -> PathBuf {
    let surface = load(&graphs().join("../tests/data/canvas-thesis.ron")).unwrap();
    let (mut slow, _) = resample_surface(&surface, 1000.0, method).unwrap();
    slow.taps = None;
    let path = folder.join(file);
    match path.extension() {
        Some(extension) if extension == "ron" => fs::write(&path, native::write(&slow)).unwrap(),
        _ => drop(save(&slow, &path).unwrap()),
    }
    path
}

fn checked(graph: &str, text: &str, surface: &Path) -> Result<Graph, Diagnostics> {
    let options = CheckOptions::default().set("surface", format!("{:?}", surface.to_str().unwrap()));
    let document = Document::parse(graphs().join(graph), text)?;
    check(&document, &haptograph::nodes::registry(), &options)
}

#[test]
fn every_shipped_graph_takes_a_surface_of_1_khz() {
    let folder = tempfile::tempdir().unwrap();
    let files = [
        slow(folder.path(), Method::Zoh, "arma.ron"),
        slow(folder.path(), Method::Zoh, "arma.xml"),
        slow(folder.path(), Method::Spectral, "ar.xml"),
    ];
    for graph in ["texturepad.ron", "omni.ron", "omni-coil.ron", "ar-pen.ron", "two-drivers.ron"] {
        let text = fs::read_to_string(graphs().join(graph)).unwrap();
        for file in &files {
            let graph_of = checked(graph, &text, file).unwrap();
            let noted = graph_of.warnings().iter().filter(|warning| warning.code == "W0107");
            // The rate, and with an arm that there are no taps.
            let expected = if graph.starts_with("omni") { 2 } else { 1 };
            assert_eq!(noted.count(), expected, "{graph}, {}", file.display());
        }
    }
}

const STEADY: &str = r#"Graph(
    format: 1, seed: 3,
    parameters: { "surface": "surfaces/t2-canvas.ron" },
    include: ["std/texture.ron"],
    clocks: { "synth": Driver(rate_hz: 10000), "control": Derived(of: "synth", rate_hz: 250) },
    nodes: {
        "speed": Constant(clock: "control", value: 0.09, quantity: "speed"),
        "force": Constant(clock: "control", value: 1.1, quantity: "force"),
        "texture": Texture(surface: Param("surface"), speed: "speed", force: "force"),
        "file": CsvSink(inputs: ["texture"], file: "texture.csv"),
    },
)"#;

/// The vibration of a hand that moves steadily, at 10 kHz.
fn rendered(surface: &Path, seconds: f64) -> Vec<f64> {
    let graph = checked("steady.ron", STEADY, surface).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut outlets = FileSinks::new(&graph);
    outlets.open_files(folder.path()).unwrap();
    Session::run_offline(outlets, &SessionOptions::default().block(0).seconds(seconds), &mut |_| {}).unwrap();
    let text = fs::read_to_string(folder.path().join("texture.csv")).unwrap();
    let last = |line: &str| line.rsplit(',').next().unwrap().parse().unwrap();
    text.lines().skip(1).map(last).collect()
}

#[test]
fn power_and_spectrum_below_500_hz_are_those_of_the_models() {
    let folder = tempfile::tempdir().unwrap();
    for method in [Method::Zoh, Method::Spectral] {
        let file = slow(folder.path(), method, "slow.ron");
        let texture = read_surface(&fs::read(&file).unwrap()).unwrap().texture.unwrap();
        let mut mix = Coefficients::SILENCE;
        Interpolator::new(&texture).interpolate(0.09, 1.1, &mut mix);
        let variance = mix.variance * mix.gain * mix.gain;
        let density = |f_hz: f64| arma_density(mix.ar(), mix.ma(), variance, 1000.0, f_hz);
        let y = rendered(&file, 40.0);
        let found = welch(&y[2000..], 10_000.0, 4096, 2048, Window::Hann).unwrap();
        let step_hz = found.frequency_hz[1];
        let power = |low_hz: f64, high_hz: f64| {
            let bins = found.frequency_hz.iter().zip(&found.density);
            let within = bins.filter(|(f_hz, _)| (low_hz..high_hz).contains(*f_hz));
            within.fold((0.0, 0.0), |(is, should), (f_hz, d)| {
                (is + d * step_hz, should + density(*f_hz) * step_hz)
            })
        };
        for (low_hz, high_hz) in
            [(10.0, 60.0), (60.0, 120.0), (120.0, 200.0), (200.0, 300.0), (300.0, 400.0), (400.0, 480.0)]
        {
            let (is, should) = power(low_hz, high_hz);
            let db = 10.0 * (is / should).log10();
            assert!(db.abs() < 0.6, "{}: {db} dB from {low_hz} to {high_hz} Hz", method.name());
        }
        let (is, should) = power(10.0, 480.0);
        assert!((is / should - 1.0).abs() < 0.06, "{}: {is} for {should}", method.name());
        let above = found.power_between(550.0, 5000.0);
        assert!(above < 1e-5 * is, "{}: {above} above 550 Hz", method.name());
    }
}
