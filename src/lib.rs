//! haptograph: a dataflow signal-processing graph engine that renders the feel of real surfaces.
//!
//! This crate is the face of the workspace; the work is done in the rooms below it.

pub mod cli;
pub mod recorder;

pub use haptograph_engine as engine;
pub use haptograph_nodes as nodes;
pub use haptograph_report as report;
pub use haptograph_signal as signal;
pub use haptograph_surfaces as surfaces;

use engine::diagnostic::Diagnostics;
use engine::document::{Document, LoadOptions};
use engine::graph::{CheckOptions, Graph, check};
use std::path::Path;

/// Reads and checks a graph file with all node and device kinds that haptograph has.
///
/// A program that embeds it gives [`CheckOptions::hosted`], and then feeds and hears the graph's endpoints itself: see
/// [`engine::host`].
///
/// ```
/// use haptograph::engine::graph::CheckOptions;
/// use haptograph::engine::host::{PlayOptions, Player, Scalar};
///
/// let graph = haptograph::open("graphs/texturepad.ron", &CheckOptions::hosted())?;
/// let mut force_n = graph.input::<Scalar>("stylus.force")?;
/// let mut current_a = graph.output::<Scalar>("haptuator.current")?;
/// let (mut player, session) = Player::open(&graph, &PlayOptions::default())?;
/// force_n.set(1.0)?;
/// player.process(480);
/// assert_eq!(current_a.waiting(), 480);
/// let outcome = player.finish(session);
/// assert_eq!(outcome.outcome.driver_frames, 480);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// All that is wrong with the file and those that it includes.
pub fn open(path: impl AsRef<Path>, options: &CheckOptions) -> Result<Graph, Diagnostics> {
    let document = Document::load(path.as_ref(), &LoadOptions::default())?;
    check(&document, &nodes::registry(), options)
}
