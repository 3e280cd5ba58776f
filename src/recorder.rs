//! Simulated recordings of surfaces, rendered by the graph `graphs/recorder.ron`.

use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::document::Document;
use haptograph_engine::graph::{CheckOptions, check};
use haptograph_engine::run::{self, FileSinks, OfflineError, SessionOptions};
use haptograph_learning::recording::{AnyRecording, Gesture, LoadError, load};
use haptograph_nodes::simulated::material::MaterialName;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Source text of the recording graph.
pub const GRAPH: &str = include_str!("../graphs/recorder.ron");
/// File that the graph's sink writes.
const FILE: &str = "recording.npz";

/// Settings of a simulated recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedTake {
    /// The simulated material.
    pub material: MaterialName,
    /// Movement of the tool.
    pub gesture: Gesture,
    /// The material sticks and slips, and the strokes of a drag begin from rest.
    pub from_rest: bool,
    /// Number of the simulated person; each number has its own hand, posture and habits.
    pub person: u64,
    /// Duration, s.
    pub seconds: f64,
    /// Seed of the material sample and of the take.
    pub seed: u64,
}

/// Error of [`record`].
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The graph failed its checks.
    #[error("{0}")]
    Graph(#[from] Diagnostics),
    /// The graph did not run to the end.
    #[error(transparent)]
    Run(#[from] OfflineError),
    /// The temporary folder for the sink's file could not be created.
    #[error("cannot make a temporary folder: {0}")]
    Folder(#[from] std::io::Error),
    /// The sink's file is not a readable recording.
    #[error(transparent)]
    Load(#[from] LoadError),
}

/// Simulates a recording and marks it as simulated. Equal sessions give equal bits.
///
/// Setting `stop` ends the recording early; the part recorded so far is complete. `progress` receives the
/// seconds done.
///
/// # Errors
/// [`RecordError`]; a take shorter than 0.01 s is too short for a recording.
pub fn record(
    take: &SimulatedTake,
    stop: &Arc<AtomicBool>,
    progress: &mut dyn FnMut(f64),
) -> Result<AnyRecording, RecordError> {
    let motion = match take.gesture {
        Gesture::Drag => "Drag",
        Gesture::Circle => "Circle",
        Gesture::Tap => "Tap",
        Gesture::Press => "Press",
    };
    let set = [
        ("material", take.material.as_str().to_owned()),
        ("motion", motion.to_owned()),
        ("from_rest", take.from_rest.to_string()),
        ("person", take.person.to_string()),
    ];
    let options = CheckOptions::default().seed(take.seed);
    let options = set.into_iter().fold(options, |options, (name, value)| options.set(name, value));
    let document = Document::parse("recorder.ron", GRAPH)?;
    let graph = check(&document, &haptograph_nodes::registry(), &options)?;
    let folder = tempfile::tempdir()?;
    let mut file_sinks = FileSinks::new(&graph);
    file_sinks.open_files(folder.path()).map_err(OfflineError::from)?;
    let mut options = SessionOptions::default().seconds(take.seconds);
    options.stop = Arc::clone(stop);
    run::Session::run_offline(file_sinks, &options, progress)?;
    Ok(load(&folder.path().join(FILE))?)
}
