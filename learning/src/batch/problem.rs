//! Problems of a plan.

use crate::processing::ProcessingError;
use crate::recording::LoadError;
use haptograph_surfaces::files::{FileError, Malformed, Place};
use std::path::PathBuf;

/// A problem of a plan, with its location.
#[derive(Debug)]
pub struct PlanError {
    /// The plan, or the table of jobs that it names.
    pub path: PathBuf,
    /// The location in the file.
    pub place: Option<Place>,
    /// The problem.
    pub problem: PlanProblem,
}

impl std::fmt::Display for PlanError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let path = self.path.display();
        match self.place {
            Some(place) => write!(f, "{path}: {place}: {}", self.problem),
            None => write!(f, "{path}: {}", self.problem),
        }
    }
}

impl std::error::Error for PlanError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.problem)
    }
}

/// A problem of a plan.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // see the messages
pub enum PlanProblem {
    #[error("cannot read it: {0}")]
    Io(#[from] std::io::Error),
    #[error(transparent)]
    Malformed(#[from] Malformed),
    #[error("{0}")]
    Table(String),
    #[error(
        "no file matches {pattern:?} (paths are relative to the plan's folder; `*` matches any part of a file name)"
    )]
    NoMatch { pattern: String },
    #[error("the plan has no {what}; name at least one")]
    Nothing { what: &'static str },
    #[error(transparent)]
    Surface(Box<FileError>),
    #[error("{file} has no texture, so it cannot be rendered; remove it from the plan")]
    NoTexture { file: String },
    #[error("two surfaces are named {name:?}: {files}; rename one of the files, or list it only once")]
    SameName { name: String, files: String },
    #[error(transparent)]
    Recording(Box<LoadError>),
    #[error("cannot get speed and force from the recording: {0}")]
    Processing(Box<ProcessingError>),
    #[error("{what} is {value}; it must be {expected}")]
    Range { what: &'static str, value: String, expected: &'static str },
    #[error(
        "{range} is missing, and there is no range that all surfaces recorded; write it, such as {range}: (from, to), or learn the \
         surfaces again: their files then hold what was recorded"
    )]
    NoRange { range: &'static str },
    #[error("seeds run from the first to the last, and {from} is above {to}; write ({to}, {from})")]
    Seeds { from: u64, to: u64 },
    #[error("there is no {what} {name:?}; the plan has {known}")]
    Unknown { what: &'static str, name: String, known: String },
    #[error("{jobs} jobs in chunks of {jobs_per_chunk} are more than {most} chunks; raise jobs_per_chunk")]
    TooManyChunks { jobs: u64, jobs_per_chunk: u64, most: u64 },
    #[error(
        "a chunk of {jobs} jobs of up to {samples} samples would take {mebibytes} MiB of memory; the limit is {most} MiB; \
         lower jobs_per_chunk, or the seconds of motions"
    )]
    TooLarge { jobs: u64, samples: u64, mebibytes: u64, most: u64 },
}

impl From<FileError> for PlanProblem {
    fn from(error: FileError) -> Self {
        Self::Surface(Box::new(error))
    }
}

impl From<LoadError> for PlanProblem {
    fn from(error: LoadError) -> Self {
        Self::Recording(Box::new(error))
    }
}

impl From<ProcessingError> for PlanProblem {
    fn from(error: ProcessingError) -> Self {
        Self::Processing(Box::new(error))
    }
}

/// The index of a name in a list.
pub(super) fn find<'a>(
    what: &'static str,
    names: impl Iterator<Item = &'a str> + Clone,
    name: &str,
) -> Result<usize, PlanProblem> {
    names.clone().position(|other| other == name).ok_or_else(|| PlanProblem::Unknown {
        what,
        name: name.to_owned(),
        known: names.take(20).collect::<Vec<_>>().join(", "),
    })
}
