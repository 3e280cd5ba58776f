//! haptograph: a dataflow signal-processing graph engine that renders the feel of real surfaces.
//!
//! Facade of the workspace: it re-exports the engine, the nodes, live runs, the reports, the signal library, the
//! surfaces and learning, and holds the command line. A program that embeds graphs needs no command line:
//! `default-features = false`.
//!
//! # Features
//!
//! | feature | adds |
//! |---|---|
//! | `command` | [`cli`]: the command line and its server; on by default |
//! | `live` | [`live`]: live runs with their devices; the other features have it |
//! | `soundcard` | soundcards; on Linux this needs the headers of ALSA |
//! | `evdev` | tablets and mice, on Linux |
//! | `midi` | MIDI; on Linux this needs the headers of ALSA |
//! | `midi-jack` | MIDI by JACK or PipeWire in place of ALSA's sequencer; the headers of ALSA are needed too |
//! | `serial` | serial ports, on Linux and macOS |
//! | `haply` | Haply's arms, through the service of their manufacturer; on by default |

#![cfg_attr(not(test), warn(unreachable_pub))]

#[cfg(feature = "command")]
pub mod cli;
pub mod recorder;

pub use haptograph_engine as engine;
pub use haptograph_learning as learning;
#[cfg(feature = "live")]
pub use haptograph_live as live;
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
/// An embedding program passes [`CheckOptions::hosted`] and then reads and writes the graph's endpoints
/// itself: see [`engine::host`].
///
/// ```
/// use haptograph::engine::graph::CheckOptions;
/// use haptograph::engine::host::Scalar;
/// use haptograph::engine::run::{Player, SessionOptions};
///
/// let graph = haptograph::open("graphs/texturepad.ron", &CheckOptions::hosted())?;
/// let mut force_n = graph.input::<Scalar>("stylus.force")?;
/// let mut current_a = graph.output::<Scalar>("haptuator.current")?;
/// let (mut player, session) = Player::open(&graph, &SessionOptions::default())?;
/// force_n.set(1.0)?;
/// player.process(480);
/// assert_eq!(current_a.waiting(), 480);
/// let outcome = session.finish(player);
/// assert_eq!(outcome.outcome.driver_frames, 480);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Diagnostics`] with every error in the file and in the files it includes.
pub fn open(path: impl AsRef<Path>, options: &CheckOptions) -> Result<Graph, Diagnostics> {
    let document = Document::load(path.as_ref(), &LoadOptions::default())?;
    check(&document, &nodes::registry(), options)
}
