//! What is counted.

use crate::ours::{self, Ours};
use crate::work::{Contestant as _, Work};
use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::run::{FileSinks, Run, Session, SessionOptions};
use haptograph_learning::learn::{LearnSettings, learn};
use haptograph_learning::recording::{AnyRecording, Gesture, ProcessedRecording, Signals};
use haptograph_surfaces::rendering::{
    RandomWalk, SynthesisSettings, Trajectory, Voice, synthesise, synthesise_many,
};
use haptograph_surfaces::{
    ArmaModel, Coefficients, Interpolator, ModelAt, Origin, Provenance, TextureModel, files,
};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

/// Driver frames of a block.
const FRAMES: usize = 64;
/// Blocks before the counted ones, and counted ones.
const BLOCKS: [usize; 2] = [20, 100];
/// Points of a stroke at which models are interpolated.
const UPDATES: usize = 500;
const VOICES: usize = 64;

/// Work that is counted.
pub struct Counted {
    pub name: &'static str,
    /// True if misses of the caches are counted too.
    pub has_misses: bool,
    run: fn(),
}

const fn counts(name: &'static str, run: fn()) -> Counted {
    Counted { name, has_misses: false, run }
}

const fn counts_misses(name: &'static str, run: fn()) -> Counted {
    Counted { name, has_misses: true, run }
}

/// 100 blocks of pipelines; 1024 samples of the graphs of `benches/peers`; one plan, load or swap of the random one; 500 updates; a tenth of
/// a second of 64 voices at 10 kHz; a surface from 10 s.
pub const WORKS: [Counted; 19] = [
    counts("texturepad", || pipeline("texturepad")),
    counts("omni", || pipeline("omni")),
    counts("ar-pen", || pipeline("ar-pen")),
    counts("recorder", || pipeline("recorder")),
    counts("A, block 64", || peers(&Work::gains_and_offsets(100, 64))),
    counts("A, block 1", || peers(&Work::gains_and_offsets(100, 1))),
    counts("B, block 64", || peers(&Work::biquads(100, 64))),
    counts("B, block 1", || peers(&Work::biquads(100, 1))),
    counts_misses("C, block 64", || peers(&random())),
    counts("C, block 1", || peers(&Work { block: 1, ..random() })),
    counts("D, block 64", || peers(&Work::gains_and_offsets(10, 64))),
    counts("D, block 1", || peers(&Work::gains_and_offsets(10, 1))),
    counts_misses("plan", plan),
    counts("load and check", load),
    counts("swap", swap),
    counts("updates, warped", || updates(&warped())),
    counts("updates, plain", || updates(&plain(&warped()))),
    counts("voices", voices),
    counts("learn", learning),
];

/// Runs a work; what it passes to `counted` is counted.
pub fn run(name: &str) -> ExitCode {
    match WORKS.iter().find(|work| work.name == name) {
        Some(work) => {
            (work.run)();
            ExitCode::SUCCESS
        }
        None => ExitCode::FAILURE,
    }
}

/// Valgrind counts what happens in here.
#[inline(never)]
fn counted(work: &mut dyn FnMut()) {
    work();
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn pipeline(name: &str) {
    let path = repository().join("graphs").join(name).with_extension("ron");
    let document = Document::load(&path, &LoadOptions::default()).expect("shipped graphs can be read");
    let graph = check(&document, &haptograph_nodes::registry(), &CheckOptions::default());
    let graph = graph.expect("shipped graphs are valid");
    let mut run = Run::new(Arc::new(Plan::of(&graph, &PlanOptions::default().block(FRAMES)).remove(0)));
    let [before, blocks] = BLOCKS;
    (0..before).for_each(|_| run.advance(FRAMES));
    counted(&mut || (0..blocks).for_each(|_| run.advance(FRAMES)));
}

fn peers(work: &Work) {
    let mut ours = Ours::new(work);
    ours.run();
    counted(&mut || ours.run());
}

fn random() -> Work {
    Work::random_gains(1000, FRAMES, 7)
}

fn plan() {
    let work = random();
    let graph = ours::load(&ours::text(&work));
    counted(&mut || drop(black_box(ours::plan(&graph, &work))));
}

fn load() {
    let text = ours::text(&random());
    counted(&mut || drop(black_box(ours::load(&text))));
}

/// The change to a graph that differs in every node, until it has taken over.
fn swap() {
    let other = |seed: u64| -> Graph { ours::load(&ours::text(&Work::random_gains(1000, FRAMES, seed))) };
    let (before, after) = (other(7), other(8));
    let opened = Session::open(FileSinks::new(&before), &SessionOptions::default());
    let (mut player, mut session) = opened.expect("the graph runs");
    player.process(FRAMES);
    counted(&mut || {
        session.change_without_files(&after).expect("the graph can take over");
        player.process(FRAMES);
        session.poll();
    });
}

/// The shipped canvas, as it is learned by default.
fn warped() -> TextureModel {
    let surface = files::load(&repository().join("graphs/surfaces/t2-canvas.ron"));
    surface.expect("the shipped surface").texture.expect("it has a texture")
}

/// The same map with the line spectral frequencies of its models on the plain axis.
fn plain(texture: &TextureModel) -> TextureModel {
    let models = texture.models().iter().map(|at| {
        let model = ArmaModel::from_lsf(at.model.ar_lsf(), &[], 1.0, at.model.variance());
        ModelAt { model: model.expect("ascending frequencies are stable"), ..at.clone() }
    });
    let triangles = texture.triangles().to_vec();
    TextureModel::new(texture.rate_hz(), models.collect(), triangles).expect("the same map")
}

fn walk(seed: u64, seconds: f64) -> Trajectory {
    RandomWalk { seconds, seed, ..RandomWalk::default() }.trajectory()
}

fn updates(texture: &TextureModel) {
    let mut interpolator = Interpolator::new(texture);
    let stroke = walk(1, 3.0);
    // As at a servo rate of 1 kHz.
    let points = stroke.speed_m_s.iter().zip(&stroke.force_n).step_by((stroke.rate_hz * 1e-3) as usize);
    let points: Vec<(f64, f64)> = points.map(|(speed, force)| (*speed, *force)).take(UPDATES).collect();
    assert_eq!(points.len(), UPDATES);
    let mut into = Coefficients::SILENCE;
    counted(&mut || {
        for (speed_m_s, force_n) in &points {
            interpolator.interpolate(*speed_m_s, *force_n, &mut into);
            black_box(&into);
        }
    });
}

fn voices() {
    let texture = warped();
    let walks: Vec<Trajectory> = (0..VOICES as u64).map(|seed| walk(seed, 0.1)).collect();
    let settings = |seed: u64| SynthesisSettings { seed, ..SynthesisSettings::default() };
    let voice = |(trajectory, seed)| Voice { texture: &texture, trajectory, settings: settings(seed) };
    let voices: Vec<Voice<'_>> = walks.iter().zip(0..).map(voice).collect();
    counted(&mut || {
        let _ = black_box(synthesise_many(&voices, 1));
    });
}

fn learning() {
    let texture = warped();
    let walk = walk(3, 10.0);
    let rate_hz = walk.rate_hz;
    let acceleration = synthesise(&texture, &walk, &SynthesisSettings::default());
    let signals = Signals {
        rate_hz,
        acceleration_m_s2: acceleration.expect("the walk is on the map"),
        force_normal_n: walk.force_n,
        speed_m_s: walk.speed_m_s,
        ..Signals::default()
    };
    let recording =
        ProcessedRecording::new(signals, Gesture::Drag, Provenance::new(Origin::Procedural, "a bench"));
    let recordings = [AnyRecording::Processed(recording.expect("its signals are valid"))];
    counted(&mut || {
        let learned = learn("canvas", &recordings, &LearnSettings::default(), &|_| ());
        black_box(learned.expect("ten seconds are enough"));
    });
}
