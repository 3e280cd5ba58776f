//! The result of a command: one value that standard output shows as text or as JSON.

use super::{Failure, print, print_json};
use serde::Serialize;
use std::path::PathBuf;

/// A result. Its fields are the keys of its JSON, in alphabetical order.
pub(super) trait CommandResult: Serialize {
    /// True if its JSON has a line for each value.
    const INDENTED: bool = false;

    /// The text for a terminal.
    fn text(&self) -> String;
}

/// Prints a result as text, or with `--json` as JSON.
pub(super) fn show<R: CommandResult>(result: &R, json: bool) -> Result<(), Failure> {
    match json {
        true if R::INDENTED => print(&indented(result)),
        true => print_json(result),
        false => print(&result.text()),
    }
}

/// JSON with a line for each value.
pub(super) fn indented(result: &impl Serialize) -> String {
    // No result has keys that are not text.
    serde_json::to_string_pretty(result).unwrap_or_default() + "\n"
}

/// The last line of a result with a page.
pub(super) fn look_at(page: Option<&PathBuf>) -> String {
    page.map_or_else(String::new, |page| format!("look at {}\n", page.display()))
}

/// The files that a command wrote.
#[derive(Debug, Serialize)]
pub(super) struct Written {
    written: Vec<PathBuf>,
    /// What the text says of them.
    #[serde(skip)]
    text: String,
}

impl Written {
    /// One file, and what can be done with it.
    pub(super) fn new(path: PathBuf, advice: &str) -> Self {
        Self { text: format!("wrote {}\n{advice}", path.display()), written: vec![path] }
    }

    pub(super) fn several(written: Vec<PathBuf>, text: String) -> Self {
        Self { written, text }
    }
}

impl CommandResult for Written {
    fn text(&self) -> String {
        self.text.clone()
    }
}
