//! Why commands fail, and how they say that and what they found.

use super::interrupt::INTERRUPTED;
use super::remarks::{self, remark};
use super::terminal::is_coloured;
use crate::engine::diagnostic::{Diagnostics, render, to_json};
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// What is wrong with a graph.
    #[error("{0}")]
    Graph(Diagnostics),
    /// The command line asks for what does not go together.
    #[error("{0}")]
    Usage(clap::Error),
    /// The failure was reported already, as JSON.
    #[error("")]
    Reported,
    /// Anything else, in words for the user.
    #[error("{0}")]
    Message(String),
    /// An error shown at its place in a text.
    #[error("{0}")]
    Shown(String),
    /// Nobody reads what is written any more.
    #[error("")]
    BrokenPipe,
    /// Ctrl-C cut it short; what there is was written, and that was said.
    #[error("")]
    Interrupted,
}

/// In which form a failure is said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorForm {
    Text,
    Json,
}

impl Failure {
    /// A failure to do something with a file.
    pub fn file(doing: &str, path: &Path, error: &dyn std::fmt::Display) -> Self {
        Self::Message(format!("cannot {doing} {}: {error}", path.display()))
    }

    /// The same where the command has printed its facts: with `--json` they are all that standard output gets.
    pub fn after_facts(self, json: bool) -> Self {
        if !json || matches!(self, Self::BrokenPipe | Self::Interrupted) {
            return self;
        }
        remark(&self.text());
        Self::Reported
    }

    /// Says it, and gives the code to exit with.
    pub fn report(self, form: ErrorForm) -> ExitCode {
        if let Self::Usage(error) = &self {
            refuse_usage(error);
        }
        match form {
            ErrorForm::Text => remark(&self.text()),
            // Where nobody reads, nobody is told.
            ErrorForm::Json => drop(self.to_json().map_or(Ok(()), |error| say_json(&error))),
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
            Self::Shown(text) => text.clone(),
            Self::Reported | Self::BrokenPipe | Self::Interrupted => String::new(),
        }
    }

    /// What is wrong, and of a graph every finding; nothing where it was said already.
    fn to_json(&self) -> Option<serde_json::Value> {
        match self {
            Self::Graph(diagnostics) => {
                let first = diagnostics
                    .list
                    .first()
                    .map_or("", |finding| finding.message.as_str());
                Some(serde_json::json!({ "error": first, "findings": findings_json(diagnostics) }))
            }
            Self::Message(text) | Self::Shown(text) => {
                let text = text.trim_start_matches("error: ").trim_end();
                Some(serde_json::json!({ "error": text }))
            }
            Self::Usage(_) | Self::Reported | Self::BrokenPipe | Self::Interrupted => None,
        }
    }
}

/// Findings about a graph, for programs.
pub fn findings_json(findings: &Diagnostics) -> serde_json::Value {
    serde_json::from_str(&to_json(findings)).unwrap_or_default()
}

/// Writes to standard output; a reader that has gone away ends the command quietly.
pub fn say(text: &str) -> Result<(), Failure> {
    // In the order in which it was said, where both go to one place.
    remarks::settle();
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())
        .and_then(|()| out.flush())
        .map_err(|error| match error.kind() {
            std::io::ErrorKind::BrokenPipe => Failure::BrokenPipe,
            _ => Failure::Message(format!("cannot write to standard output: {error}")),
        })
}

/// One line of JSON on standard output.
pub fn say_json(value: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string(value)
        .map_err(|error| Failure::Message(format!("cannot say it as JSON: {error}")))?;
    say(&(text + "\n"))
}

/// Usage errors, `--help` and `--version`, in clap's words; exits with 2 or 0.
pub fn refuse_usage(error: &clap::Error) -> ! {
    if error.use_stderr() && std::env::args_os().any(|argument| argument == "--json") {
        let text = error.to_string();
        let told = serde_json::json!({ "error": text.trim_start_matches("error: ").trim_end() });
        // Nobody is left to be told of a failure of this.
        let _ = say_json(&told);
        std::process::exit(2);
    }
    error.exit()
}
