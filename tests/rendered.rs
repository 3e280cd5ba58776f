//! What evaluations play is what graphs render, to the bit.

use haptograph::engine::document::Document;
use haptograph::engine::graph::{CheckOptions, check};
use haptograph::engine::plan::{Plan, PlanOptions};
use haptograph::engine::run::Run;
use haptograph::signal::noise::stream_seed;
use haptograph::surfaces::rendering::{SynthesisSettings, Trajectory, synthesise};
use haptograph::surfaces::{SpatialLine, files};
use std::path::Path;
use std::sync::Arc;

const RATE_HZ: f64 = 10_000.0;
const SEED: u64 = 11;

/// The four nodes of the texture template behind a hand whose speed and force are sines.
fn graph(surface: &Path) -> String {
    format!(
        r#"Graph(
    format: 1,
    seed: {SEED},
    clocks: {{ "synth": Driver(rate_hz: 10000), "control": Derived(of: "synth", rate_hz: 240) }},
    nodes: {{
        "to and fro": Sine(clock: "synth", frequency_hz: 1.7, amplitude: 0.09, quantity: "speed"),
        "speed": Offset(input: "to and fro", offset: 0.1),
        "to and down": Sine(clock: "synth", frequency_hz: 1.1, amplitude: 0.8, phase_deg: 40, quantity: "force"),
        "force": Offset(input: "to and down", offset: 1.0),
        "locate": TriangleLocator(clock: "control", surface: {surface:?}, speed: Hold("speed"), force: Hold("force")),
        "interpolate": LsfInterpolator(surface: {surface:?}, weights: "locate"),
        "excite": Excitation(clock: "synth", surface: {surface:?}, coefficients: Hold("interpolate")),
        "filter": ArmaFilter(surface: {surface:?}, coefficients: Hold("interpolate"), excitation: "excite"),
    }},
)"#
    )
}

/// Speed, force and vibration of 2.56 s.
fn render(surface: &Path) -> [Vec<f64>; 3] {
    let document = Document::parse("rendered.ron", &graph(surface)).expect("the graph is well written");
    let registry = haptograph::nodes::registry();
    let graph =
        check(&document, &registry, &CheckOptions::default()).unwrap_or_else(|wrong| panic!("{wrong}"));
    let find = |name: &str| {
        let node = graph.nodes().find(name);
        (node.expect("the node is there"), 0)
    };
    let taps = ["speed", "force", "filter"].map(find).to_vec();
    let plans = Plan::of(&graph, &PlanOptions::default().block(64).taps(taps));
    let plan = plans.into_iter().next().expect("there is one driver");
    let mut run = Run::new(Arc::new(plan));
    let mut heard = [vec![], vec![], vec![]];
    for _ in 0..400 {
        run.advance(64);
        for (tap, heard) in heard.iter_mut().enumerate() {
            heard.extend_from_slice(run.tap(tap));
        }
    }
    heard
}

#[test]
fn an_evaluation_plays_what_a_graph_renders() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().expect("a folder");
    let with_lines = folder.path().join("lines.ron");
    let mut tile = files::load(&root.join("graphs/surfaces/t3-tile.ron")).expect("it is a surface");
    let texture = tile.texture.take().expect("it has a texture");
    let powers: Vec<f64> = texture.models().iter().map(|at| at.speed_m_s * at.force_n).collect();
    let line = |cycles_per_m| SpatialLine::new(cycles_per_m, 2.0, powers.clone()).expect("a line");
    let lines = vec![line(900.0), line(2300.0)];
    tile.texture = Some(texture.with_lines(lines).expect("a texture"));
    files::save(&tile, &with_lines).expect("it is written");
    for surface in
        [&root.join("graphs/surfaces/t3-tile.ron"), &root.join("tests/data/canvas-thesis.ron"), &with_lines]
    {
        let [speed_m_s, force_n, rendered] = render(surface);
        let texture = files::load(surface).expect("it is a surface").texture.expect("it has a texture");
        let along = Trajectory { rate_hz: RATE_HZ, speed_m_s, force_n };
        let settings = SynthesisSettings {
            seed: stream_seed(SEED, "excite"),
            lines_seed: stream_seed(SEED, "filter"),
            ..SynthesisSettings::default()
        };
        let played = synthesise(&texture, &along, &settings).expect("it can be played");
        assert_eq!(played.len(), rendered.len());
        let differ = played.iter().zip(&rendered).position(|(a, b)| a != b);
        assert_eq!(differ, None, "{}: {:?}", surface.display(), differ.map(|at| (played[at], rendered[at])));
        assert!(played.iter().any(|x| x.abs() > 0.1));
    }
}

/// Every 1,600th sample from the 800th on, m/s², that the version rendered which knew the thesis's kind of surface alone (7b0473e).
const AS_IT_WAS_M_S2: [f64; 16] = [
    4.213556930870205,
    2.195974051252042,
    5.596738902139859,
    -2.3419452435127326,
    4.480152632177196,
    3.415946965446556,
    0.5686783398682138,
    -2.1632473638784075,
    4.040305774561083,
    0.061329728028400546,
    -0.7048082418881363,
    1.777017411965245,
    1.3565684247328993,
    1.981351274996792,
    -0.30243649259800093,
    1.3182788398753467,
];

#[test]
fn a_surface_of_an_older_version_renders_what_it_did() {
    let surface = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/canvas-thesis.ron");
    let [_, _, rendered] = render(&surface);
    let now = rendered.iter().skip(799).step_by(1600);
    assert_eq!(now.len(), AS_IT_WAS_M_S2.len());
    // Other processors may round sines and exponentials otherwise.
    for (now, was) in now.zip(AS_IT_WAS_M_S2) {
        assert!((now - was).abs() < 1e-9, "{now} m/s² for {was}");
    }
}
