//! The result of a command: one value that standard output shows as text or as JSON.

use super::{Failure, print, print_json};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// A result. Its fields are the keys of its JSON, in alphabetical order.
pub trait CommandResult: Serialize {
    /// The text for a terminal.
    fn text(&self) -> String;
}

/// Prints a result as text, or with `--json` as one line of JSON.
pub fn show(result: &impl CommandResult, json: bool) -> Result<(), Failure> {
    match json {
        true => print_json(result),
        false => print(&result.text()),
    }
}

/// The file that a command wrote.
#[derive(Debug, Serialize)]
pub struct Written {
    written: [PathBuf; 1],
    /// What can be done with it.
    #[serde(skip)]
    advice: String,
}

impl Written {
    pub fn new(path: &Path, advice: String) -> Self {
        Self { written: [path.to_owned()], advice }
    }
}

impl CommandResult for Written {
    fn text(&self) -> String {
        format!("wrote {}\n{}", self.written[0].display(), self.advice)
    }
}
