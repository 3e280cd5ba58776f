//! Errors of commands, and printing to standard output as text or JSON.

use super::interrupt::INTERRUPTED;
use super::stderr::{self, eprint};
use super::terminal::is_coloured;
use crate::engine::diagnostic::{Diagnostics, render, to_json};
use std::fmt::Display;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

/// Error of a command.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// The graph failed its checks.
    #[error("{0}")]
    Graph(Diagnostics),
    /// Conflicting arguments, in clap's words.
    #[error("{0}")]
    Usage(clap::Error),
    /// The failure was already reported as JSON.
    #[error("")]
    Reported,
    /// Any other error, as a message for the user.
    #[error("{0}")]
    Message(String),
    /// An error already rendered with its place in a text.
    #[error("{0}")]
    Rendered(String),
    /// The reader of standard output has gone away.
    #[error("")]
    BrokenPipe,
    /// Ctrl-C ended the command early; its partial output was written and announced.
    #[error("")]
    Interrupted,
}

/// Output format of failures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ErrorForm {
    Text,
    Json,
}

impl Failure {
    /// An error in its own words.
    pub(crate) fn message(error: impl Display) -> Self {
        Self::Message(error.to_string())
    }

    /// Error of an operation on a file.
    pub(crate) fn file(doing: &str, path: &Path, error: &dyn Display) -> Self {
        Self::Message(format!("cannot {doing} {}: {error}", path.display()))
    }

    /// The same for the error of a result.
    pub(crate) fn doing<E: Display>(doing: &str, path: &Path) -> impl FnOnce(E) -> Self {
        move |error| Self::file(doing, path, &error)
    }

    /// For a failure after the command has printed its facts: with `--json` standard output holds nothing but
    /// the facts.
    pub(crate) fn after_facts(self, json: bool) -> Self {
        if !json || matches!(self, Self::BrokenPipe | Self::Interrupted) {
            return self;
        }
        eprint(&self.text());
        Self::Reported
    }

    /// Prints the failure and returns the exit code.
    pub(crate) fn report(self, form: ErrorForm) -> ExitCode {
        if let Self::Usage(error) = &self {
            refuse_usage(error);
        }
        match form {
            ErrorForm::Text => eprint(&self.text()),
            // A failure to print the failure cannot be reported.
            ErrorForm::Json => drop(self.to_json().map_or(Ok(()), |error| print_json(&error))),
        }
        match self {
            Self::BrokenPipe => ExitCode::SUCCESS,
            Self::Interrupted => ExitCode::from(INTERRUPTED),
            _ => ExitCode::FAILURE,
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Graph(diagnostics) => render(diagnostics, is_coloured(&std::io::stderr())),
            Self::Message(text) => format!("error: {text}\n"),
            Self::Usage(error) => error.to_string(),
            Self::Rendered(text) => text.clone(),
            Self::Reported | Self::BrokenPipe | Self::Interrupted => String::new(),
        }
    }

    /// JSON with the message and, for a graph, every finding; `None` if it was already reported.
    fn to_json(&self) -> Option<serde_json::Value> {
        match self {
            Self::Graph(diagnostics) => {
                let first = diagnostics.list.first().map_or("", |finding| finding.message.as_str());
                Some(serde_json::json!({ "error": first, "findings": findings_json(diagnostics) }))
            }
            Self::Message(text) | Self::Rendered(text) => {
                let text = text.trim_start_matches("error: ").trim_end();
                Some(serde_json::json!({ "error": text }))
            }
            Self::Usage(_) | Self::Reported | Self::BrokenPipe | Self::Interrupted => None,
        }
    }
}

/// Findings about a graph as JSON.
pub(super) fn findings_json(findings: &Diagnostics) -> serde_json::Value {
    serde_json::from_str(&to_json(findings)).unwrap_or_default()
}

/// Prints to standard output. A closed pipe ends the command without a message.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    // Keeps the order of messages if both streams go to one place.
    stderr::flush();
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|error| match error.kind() {
        std::io::ErrorKind::BrokenPipe => Failure::BrokenPipe,
        _ => Failure::Message(format!("cannot write to standard output: {error}")),
    })
}

/// Prints a value to standard output as one line of JSON.
pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string(value)
        .map_err(|error| Failure::Message(format!("cannot write the result as JSON: {error}")))?;
    print(&(text + "\n"))
}

/// Prints usage errors, `--help` and `--version` in clap's words; exits with 2 or 0.
pub(super) fn refuse_usage(error: &clap::Error) -> ! {
    if error.use_stderr() && std::env::args_os().any(|argument| argument == "--json") {
        let text = error.to_string();
        let object = serde_json::json!({ "error": text.trim_start_matches("error: ").trim_end() });
        // A failure to print the failure cannot be reported.
        let _ = print_json(&object);
        std::process::exit(2);
    }
    error.exit()
}
