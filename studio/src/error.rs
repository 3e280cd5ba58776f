//! Errors of edits and starts.

use haptograph_engine::diagnostic::Diagnostics;

/// Error of an edit or a start.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The graph has errors.
    #[error("the graph has errors")]
    Graph(Diagnostics),
    /// The graph exceeds the limits and devices of the file when the studio was opened, one sentence each.
    #[error(
        "nothing was changed: a page alone cannot raise limits, add actuators or change devices. Confirm this at the \
         terminal of the studio, then repeat it here: {}",
        .0.join("; ")
    )]
    Beyond(Vec<String>),
    /// The graph cannot run or cannot be swapped in.
    #[error("{0}")]
    Other(String),
}

impl From<Diagnostics> for StageError {
    fn from(wrong: Diagnostics) -> Self {
        Self::Graph(wrong)
    }
}

pub(crate) fn other(error: impl std::fmt::Display) -> StageError {
    StageError::Other(error.to_string())
}
