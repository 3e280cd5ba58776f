//! The course of the runs of a stage.

use super::record::Recording;
use super::replay::Replay;

/// State of the run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum State {
    Running,
    /// Stopped by a page: actuators are at zero.
    #[default]
    Stopped,
    /// A node panicked: actuators are at zero.
    Failed,
}

/// State of the run, and what follows it.
#[derive(Debug, Default)]
pub(crate) struct RunCycle {
    pub state: State,
    /// True from a stop until the next run begins.
    pub is_stopping: bool,
    /// The run that follows this one.
    pub next_run: NextRun,
    pub replay: Option<Replay>,
}

/// The run that follows when the outputs of the present one have fallen to zero.
#[derive(Debug, Default)]
pub(crate) enum NextRun {
    /// No run.
    #[default]
    None,
    /// A live run.
    Live,
    /// A live run that is recorded.
    Record,
    /// The replay of a recording.
    Replay(Box<Recording>),
}
