//! The sub-commands, and what they share: how graphs are loaded, how results and failures are said.

pub mod bench;
pub mod check;
pub mod compare;
pub mod devices;
pub mod doctor;
pub mod draw;
pub mod evaluate;
pub mod fault;
pub mod identify;
mod import;
pub mod learn;
pub mod new;
pub mod nodes;
mod output;
mod progress;
mod recording;
pub mod recover;
pub mod run;
pub mod segment;
pub mod simulate_recording;
mod snippet;
pub mod surface;
pub mod sweep;
mod table;
mod written;

use clap::Args;
use haptograph::engine::diagnostic::{Diagnostics, render};
use haptograph::engine::document::{Document, LoadOptions};
use haptograph::engine::graph::{CheckOptions, Graph, check};
use haptograph::signal::files;
use std::collections::HashSet;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
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
}

impl Failure {
    /// A failure to do something with a file.
    pub fn file(doing: &str, path: &Path, error: &dyn std::fmt::Display) -> Self {
        Self::Message(format!("cannot {doing} {}: {error}", path.display()))
    }

    /// Says it on standard error, and gives the code to exit with.
    pub fn report(self) -> ExitCode {
        if let Self::Usage(error) = self {
            // As `Parser::parse` does it, with its colours and code.
            let _ = error.print();
            return ExitCode::from(2);
        }
        let text = match &self {
            Self::Graph(diagnostics) => render(diagnostics, std::io::stderr().is_terminal()),
            Self::Message(text) => format!("error: {text}\n"),
            Self::Usage(error) => error.to_string(),
            Self::Shown(text) => text.clone(),
            Self::Reported | Self::BrokenPipe => String::new(),
        };
        // Where standard error is closed there is nobody left to tell.
        let _ = std::io::stderr().write_all(text.as_bytes());
        match self {
            Self::BrokenPipe => ExitCode::SUCCESS,
            _ => ExitCode::FAILURE,
        }
    }
}

/// Writes to standard output; a reader that has gone away ends the command quietly.
pub fn say(text: &str) -> Result<(), Failure> {
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

/// Says something on standard error that is no failure.
pub fn remark(text: &str) {
    // A remark that nobody can read is no reason to stop.
    let _ = std::io::stderr().write_all(text.as_bytes());
}

/// Which graph, and with what in place of its defaults.
#[derive(Debug, Clone, Args)]
pub struct GraphArguments {
    /// The graph file
    pub graph: PathBuf,
    /// Give a parameter of the graph another value; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    pub set: Vec<(String, String)>,
    /// The set of endpoints that the graph's devices are taken from: `simulated` where it is not given, or for
    /// `run --live` `live` where the graph has that
    #[arg(long, value_name = "SET")]
    pub endpoints: Option<String>,
}

fn assignment(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("write it as NAME=VALUE")?;
    if name.is_empty() {
        return Err("the name is missing: write it as NAME=VALUE".to_owned());
    }
    Ok((name.to_owned(), value.to_owned()))
}

/// Refuses to be told a thing twice: one of the two would be meant.
pub fn refuse_repeated<'a>(flag: &str, names: impl IntoIterator<Item = &'a str>) -> Result<(), Failure> {
    let mut seen = HashSet::new();
    match names.into_iter().find(|name| !seen.insert(*name)) {
        None => Ok(()),
        Some(name) => Err(Failure::Message(format!(
            "{flag} gives `{name}` twice; give it once"
        ))),
    }
}

impl GraphArguments {
    /// Refuses a parameter that is set twice.
    pub fn refuse_repeated(&self) -> Result<(), Failure> {
        refuse_repeated("--set", self.set.iter().map(|(name, _)| name.as_str()))
    }

    /// The graph, proved sound.
    pub fn load(&self, seed: Option<u64>) -> Result<Graph, Diagnostics> {
        let document = Document::load(&self.graph, &LoadOptions::default())?;
        let options = CheckOptions {
            set: self.set.clone(),
            endpoints: self.endpoints().to_owned(),
            seed,
            ..CheckOptions::default()
        };
        check(&document, &haptograph::nodes::registry(), &options)
    }

    /// The set of endpoints to bind to.
    pub fn endpoints(&self) -> &str {
        self.endpoints.as_deref().unwrap_or("simulated")
    }

    /// The same for a live run: with the live endpoints, where the graph has them and no others were asked for.
    pub fn for_live(&self) -> Result<Self, Failure> {
        let mut live = self.clone();
        if live.endpoints.is_none() {
            let document = Document::load(&self.graph, &LoadOptions::default()).map_err(Failure::Graph)?;
            live.endpoints = document.endpoints().find(|set| *set == "live").map(str::to_owned);
        }
        Ok(live)
    }

    /// The graph, its warnings said on standard error.
    pub fn load_and_warn(&self, seed: Option<u64>) -> Result<Graph, Failure> {
        let graph = self.load(seed).map_err(Failure::Graph)?;
        warn(&graph);
        Ok(graph)
    }

    /// Refuses to write over a file that the graph is read from.
    pub fn spare_inputs(&self, graph: &Graph, output: &Path) -> Result<(), Failure> {
        let read = graph.nodes().node_weights().flat_map(|node| &node.files);
        spare(read.chain([&self.graph]), output)
    }

    /// The file's name without its extension.
    pub fn name(&self) -> String {
        self.graph
            .file_stem()
            .map_or_else(|| "graph".to_owned(), |stem| stem.to_string_lossy().into_owned())
    }
}

/// Says what a sound graph is warned about.
pub fn warn(graph: &Graph) {
    if !graph.warnings().is_empty() {
        remark(&render(&warnings(graph), std::io::stderr().is_terminal()));
    }
}

/// What a sound graph was warned about.
pub fn warnings(graph: &Graph) -> Diagnostics {
    Diagnostics {
        sources: graph.sources().clone(),
        list: graph.warnings().to_vec(),
    }
}

/// All bytes of a file.
pub fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    files::read(path, files::MAX_RECORDING_BYTES).map_err(|error| Failure::file("read", path, &error))
}

/// Refuses an output that is one of the inputs.
pub fn spare(inputs: impl IntoIterator<Item: AsRef<Path>>, output: &Path) -> Result<(), Failure> {
    // What cannot be resolved does not exist yet.
    let Ok(target) = output.canonicalize() else {
        return Ok(());
    };
    let is_target = |input: &Path| input.canonicalize().is_ok_and(|input| input == target);
    match inputs.into_iter().any(|input| is_target(input.as_ref())) {
        false => Ok(()),
        true => Err(Failure::Message(format!(
            "{} is read by this command and would be written over; give another file",
            output.display()
        ))),
    }
}

/// The folder of a file that is to be written: before the work, so that none is lost for a name.
pub fn folder_of(path: &Path) -> Result<&Path, Failure> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if folder.is_dir() {
        return Ok(folder);
    }
    let (file, folder) = (path.display(), folder.display());
    Err(Failure::Message(format!(
        "cannot write {file}: there is no folder {folder}; make it first"
    )))
}

/// Writes a file whole or not at all, into a folder that is there.
fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut file = tempfile::NamedTempFile::new_in(folder.unwrap_or(Path::new(".")))?;
    file.write_all(bytes)?;
    make_readable(file.path())?;
    file.persist(path).map(|_| ()).map_err(|error| error.error)
}

/// Temporary files are private; results are as readable as other files.
#[cfg(unix)]
fn make_readable(path: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn make_readable(_: &Path) -> std::io::Result<()> {
    Ok(())
}
