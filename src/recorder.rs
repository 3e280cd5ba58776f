//! Simulated recordings of surfaces: the graph `graphs/recorder.ron`, run in one call.

use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::document::Document;
use haptograph_engine::graph::{CheckOptions, check};
use haptograph_engine::run::{FileSinks, Offline, OfflineError};
use haptograph_nodes::simulated::material::MaterialName;
use haptograph_surfaces::recording::{AnyRecording, Gesture, LoadError, load};
use std::sync::atomic::AtomicBool;

/// The graph that is run, as shipped.
pub const GRAPH: &str = include_str!("../graphs/recorder.ron");
/// The file that its sink writes.
const FILE: &str = "recording.npz";

/// What is recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Session {
    /// The simulated material.
    pub material: MaterialName,
    /// What is done with the tool.
    pub gesture: Gesture,
    /// Who does it: another number is another hand, posture and habit.
    pub person: u64,
    /// Length, s.
    pub seconds: f64,
    /// The piece of the material and the attempt.
    pub seed: u64,
}

/// Why there is no recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The graph is not sound.
    #[error("{0}")]
    Graph(#[from] Diagnostics),
    /// The graph did not run to its end.
    #[error(transparent)]
    Run(#[from] OfflineError),
    /// There was no place for the sink's file.
    #[error("cannot make a temporary folder: {0}")]
    Folder(#[from] std::io::Error),
    /// The sink's file is no recording.
    #[error(transparent)]
    Load(#[from] LoadError),
}

/// Records a session. Everything in it is simulated, and the recording says so. The same session gives the same bits.
///
/// It ends early, its recording complete, when `stop` is set; `progress` is told the seconds done.
///
/// # Errors
/// [`RecordError`]; a session of less than a hundredth of a second is too short for a recording.
pub fn record(
    session: &Session,
    stop: &AtomicBool,
    progress: &mut dyn FnMut(f64),
) -> Result<AnyRecording, RecordError> {
    let motion = match session.gesture {
        Gesture::Drag => "Drag",
        Gesture::Circle => "Circle",
        Gesture::Tap => "Tap",
        Gesture::Press => "Press",
    };
    let set = [
        ("material", session.material.word().to_owned()),
        ("motion", motion.to_owned()),
        ("person", session.person.to_string()),
    ];
    let options = CheckOptions {
        set: set.map(|(name, value)| (name.to_owned(), value)).to_vec(),
        seed: Some(session.seed),
        ..CheckOptions::default()
    };
    let document = Document::parse("recorder.ron", GRAPH)?;
    let graph = check(&document, &haptograph_nodes::registry(), &options)?;
    let folder = tempfile::tempdir()?;
    let mut outlets = FileSinks::new(&graph);
    outlets.open_files(folder.path()).map_err(OfflineError::from)?;
    Offline::new(outlets, 0).run(session.seconds, stop, progress)?;
    Ok(load(&folder.path().join(FILE))?)
}
