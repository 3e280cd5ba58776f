//! Supervision of a live run: typed commands, settings by Open Sound Control, saved files, status and
//! warnings.

mod swap;

pub use swap::settings_text;

use super::super::terminal::is_coloured;
use super::super::{GraphArguments, eprint, panic_hook};
use super::Arguments;
use super::console::{ConsoleCommand, HELP, HELP_LINES, RunRequest};
use super::drivers::Drivers;
use super::endpoints::Endpoints;
use super::history::{History, Notes};
use super::loading::{self, Job, Loader, Loading, SavedOverrides, texts};
use super::network_value;
use super::protected::ProtectedSettings;
use super::silence::SilenceMonitor;
use super::status::{self, Status};
use super::watch::FileWatch;
use crate::engine::diagnostic::{Diagnostics, render};
use crate::engine::graph::Graph;
use crate::engine::run::Session;
use crate::engine::settings::closest;
use crate::live::osc::SetRequest;
use crate::live::{BackendEvent, Connections};
use serde_json::Value;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

/// Subfolder of the run's folder for graphs saved during the run.
pub const CHANGES: &str = "changes";
/// Polling period.
const PERIOD: Duration = Duration::from_millis(50);
/// Polling period while a graph loads.
const LOADING_PERIOD: Duration = Duration::from_millis(5);

/// Maximum number of queued requests, and of requests handled between two checks of the stop flag.
pub const MAX_QUEUED: usize = 1024;
const MAX_HANDLED: usize = 64;

/// Which messages about a change are printed. A fader is moved a hundred times per second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Verbosity {
    Silent,
    /// Only the reasons of refusals.
    Refusals,
    All,
}

impl Verbosity {
    fn refusal(self, text: &str) {
        if self >= Self::Refusals {
            eprint(text);
        }
    }

    fn success(self, text: &str) {
        if self >= Self::All {
            eprint(text);
        }
    }
}

/// Origin of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Origin {
    Keyboard,
    Osc,
}

/// A change that needs the graph to be loaded again.
#[derive(Debug)]
enum PendingChange {
    Set {
        name: String,
        value: String,
        origin: Origin,
    },
    /// A file of the graph was saved.
    Saved,
}

/// Supervisor of a live run.
pub struct Supervisor {
    /// The arguments with the present parameters.
    arguments: GraphArguments,
    /// The parameters given on the command line.
    given: Vec<(String, String)>,
    /// The parameters set since.
    typed: loading::ParameterDefaults,
    /// The parameters of the running graph, with their defaults.
    parameters: loading::ParameterDefaults,
    seed: Option<u64>,
    record: bool,
    folder: PathBuf,
    watch: Option<FileWatch>,
    pub session: Session,
    pub network: Connections,
    pub silence: SilenceMonitor,
    status: Status,
    start: Instant,
    /// Number of changed graphs, and of those that differed in more than live settings.
    pub changes: u32,
    pub swaps: u32,
    /// The devices of all graphs that ran.
    pub endpoints: Endpoints,
    /// For each saved graph: time, effect, and folder of its files.
    pub saved: Vec<Value>,
    pub history: History,
    /// Names whose OSC messages were refused; each is reported once.
    refused: Vec<String>,
    protected: ProtectedSettings,
    /// Texts of the running graph's files.
    texts: Vec<String>,
    loader: Loader,
    loading: Option<(PendingChange, Loading)>,
    waiting: VecDeque<PendingChange>,
    known: Option<loading::KnownDocument>,
    /// Panics reported so far.
    pub panics: Vec<String>,
}

impl Supervisor {
    /// Starts the supervision of a run of `graph`.
    pub fn begin(
        arguments: &Arguments,
        graph: &Graph,
        folder: &Path,
        (session, network): (Session, Connections),
        (watch, parameters, loader): (Option<FileWatch>, loading::ParameterDefaults, Loader),
        keys: bool,
    ) -> Self {
        let progress = graph
            .file_progress()
            .map(|(sink, progress)| (sink.to_owned(), progress));
        Self {
            status: Status::new(Instant::now(), progress.collect(), keys),
            given: arguments.graph.set.clone(),
            typed: Vec::new(),
            parameters,
            arguments: arguments.graph.clone(),
            seed: arguments.seed,
            record: arguments.record,
            folder: folder.to_owned(),
            watch,
            session,
            network,
            silence: SilenceMonitor::new(Instant::now()),
            start: Instant::now(),
            changes: 0,
            swaps: 0,
            endpoints: Endpoints::of(graph, true),
            saved: Vec::new(),
            history: History::default(),
            refused: Vec::new(),
            protected: ProtectedSettings::of(graph),
            texts: texts(graph),
            loader,
            loading: None,
            waiting: VecDeque::new(),
            known: None,
            panics: Vec::new(),
        }
    }

    /// Supervises the run to its end and calls `each` in every round. Returns the counted notes about
    /// soundcards.
    pub fn run(
        &mut self,
        driver: &mut Drivers,
        requests: &Receiver<RunRequest>,
        (stop, each): (&AtomicBool, fn()),
    ) -> Vec<String> {
        let (mut stopping, mut notes) = (false, Notes::default());
        while !driver.is_finished(stopping) {
            each();
            let pause = if self.loading.is_some() {
                LOADING_PERIOD
            } else {
                PERIOD
            };
            let first = requests.recv_timeout(pause).ok();
            self.report_panics();
            for note in driver.poll() {
                match note {
                    BackendEvent::Changed(note) => notes.turn(note),
                    BackendEvent::Failed(note) => notes.complaint(note),
                }
            }
            let inputs = self.session.live_inputs();
            // The final warnings summarise these notes, one line per input.
            for note in self.silence.poll(Instant::now(), &inputs, &self.network) {
                eprint(&format!("note: {note}\n"));
            }
            for failed in self.session.failing_files() {
                eprint(&format!(
                    "warning: {failed}; the file is complete up to here, and the run continues without it\n"
                ));
            }
            self.show_status(driver);
            if driver.is_partly_finished() {
                stop.store(true, Ordering::Relaxed);
            }
            stopping = stop.load(Ordering::Relaxed);
            let room = MAX_HANDLED.min(MAX_QUEUED.saturating_sub(self.waiting.len()));
            self.handle(first.into_iter().chain(requests.try_iter().take(room)));
            if self.watch.as_mut().is_some_and(FileWatch::has_changed)
                && !self
                    .waiting
                    .iter()
                    .any(|change| matches!(change, PendingChange::Saved))
            {
                self.waiting.push_back(PendingChange::Saved);
            }
            if !stopping {
                self.load_next(driver);
            }
        }
        self.report_panics();
        notes.counted()
    }

    /// Displays the status when it is due.
    fn show_status(&mut self, drivers: &Drivers) {
        let facts = status::Facts {
            session: &mut self.session,
            drivers,
            network: &self.network,
            silence: &self.silence,
            set: self.history.last().map(str::to_owned),
        };
        self.status.show(facts);
    }

    /// Reports panics since the last call.
    pub fn report_panics(&mut self) {
        for text in panic_hook::take_unreported() {
            eprint(&text);
            self.panics.push(text);
        }
    }

    /// Handles requests: those that need a loaded graph are queued, all others are done at once.
    fn handle(&mut self, requests: impl Iterator<Item = RunRequest>) {
        let mut settings = Vec::new();
        for request in requests {
            match request {
                RunRequest::Console(ConsoleCommand::Set { name, value }) => {
                    self.request_change(name, value, Origin::Keyboard)
                }
                RunRequest::Console(ConsoleCommand::List) => self.list(),
                RunRequest::Console(ConsoleCommand::History) => eprint(&self.history.lines()),
                RunRequest::Console(ConsoleCommand::Help) => eprint(HELP_LINES),
                // The reading thread has already set the stop flag.
                RunRequest::Console(ConsoleCommand::Stop) => {}
                RunRequest::Console(ConsoleCommand::Unknown(line)) => {
                    let help = ConsoleCommand::suggestion(&line).map_or_else(
                        || format!("type {HELP}"),
                        |near| format!("did you mean `{near}`?"),
                    );
                    eprint(&format!("unknown command `{line}`; {help}\n"));
                }
                RunRequest::Osc(SetRequest { name, value }) => {
                    // Only the latest value of a fader counts.
                    settings.retain(|(known, _)| *known != name);
                    settings.push((name, value));
                }
            }
        }
        for (name, value) in settings {
            self.request_change(name, value, Origin::Osc);
        }
    }

    /// Sets a live setting of a node at once. A parameter is queued until the graph is loaded with it.
    fn request_change(&mut self, name: String, value: String, origin: Origin) {
        let verbosity = self.verbosity(&name, origin);
        if name.contains('.') {
            let was_set = self.set_directly(&name, &value, verbosity);
            return self.note(was_set, name, &value, origin);
        }
        if !self.parameters.iter().any(|(known, _)| *known == name) {
            let names = self.parameters.iter().map(|(known, _)| known.as_str());
            let help = choices(&name, &names.collect::<Vec<_>>(), "its parameters are");
            verbosity.refusal(&format!("the graph has no parameter `{name}`{help}\n"));
            return self.note(false, name, &value, origin);
        }
        if origin == Origin::Osc {
            if let Some(refusal) = network_value::refusal(&value, &self.arguments.graph) {
                verbosity.refusal(&format!("`{name}` was not changed: {refusal}\n"));
                return self.note(false, name, &value, origin);
            }
            let same = |change: &PendingChange| matches!(change, PendingChange::Set { name: known, origin: Origin::Osc, .. } if *known == name);
            self.waiting.retain(|change| !same(change));
        }
        self.waiting.push_back(PendingChange::Set { name, value, origin });
    }

    /// Which messages about a request are printed.
    fn verbosity(&self, name: &str, origin: Origin) -> Verbosity {
        let full = self.refused.len() >= History::MAX;
        match origin {
            Origin::Keyboard => Verbosity::All,
            Origin::Osc if full || self.refused.iter().any(|known| known == name) => Verbosity::Silent,
            Origin::Osc => Verbosity::Refusals,
        }
    }

    /// Records the outcome of a request.
    fn note(&mut self, was_set: bool, name: String, value: &str, origin: Origin) {
        if was_set {
            let by = if origin == Origin::Keyboard {
                "typed"
            } else {
                "OSC"
            };
            self.history
                .note(self.start.elapsed().as_secs_f64(), &name, value, by);
        } else if self.verbosity(&name, origin) == Verbosity::Refusals {
            self.refused.push(name);
        }
    }

    /// Polls the loader; when it is free, starts the next queued change.
    fn load_next(&mut self, driver: &Drivers) {
        if let Some((change, loading)) = self.loading.take() {
            let verbosity = match &change {
                PendingChange::Set { name, origin, .. } => self.verbosity(name, *origin),
                PendingChange::Saved => Verbosity::All,
            };
            match loading.poll() {
                Some(loaded) => self.swap_loaded(driver, change, loaded, &loading, verbosity),
                None if loading.elapsed() < loading::BUDGET => {
                    self.loading = Some((change, loading));
                    return;
                }
                None => {
                    let budget_s = loading::BUDGET.as_secs();
                    verbosity.refusal(&format!(
                        "the running graph is unchanged: the new one did not load within {budget_s} s\n"
                    ));
                    self.reject(change);
                }
            }
        }
        if let Some(change) = self.waiting.pop_front() {
            let job = self.job(&change);
            match self.loader.begin(job) {
                Ok(loading) => self.loading = Some((change, loading)),
                Err(why) => {
                    eprint(&format!("the running graph is unchanged: {why}\n"));
                    self.reject(change);
                }
            }
        }
    }

    fn reject(&mut self, change: PendingChange) {
        if let PendingChange::Set { name, value, origin } = change {
            self.note(false, name, &value, origin);
        }
    }

    fn job(&mut self, change: &PendingChange) -> Job {
        let mut arguments = self.arguments.clone();
        let saved = match change {
            PendingChange::Set { name, value, .. } => {
                arguments.set.retain(|(known, _)| known != name);
                arguments.set.push((name.clone(), value.clone()));
                None
            }
            PendingChange::Saved => Some(SavedOverrides {
                given: self.given.clone(),
                typed: self.typed.clone(),
            }),
        };
        Job {
            arguments,
            seed: self.seed,
            record: self.record,
            saved,
            known: self.known.take(),
        }
    }

    fn set_directly(&mut self, name: &str, value: &str, verbosity: Verbosity) -> bool {
        let Ok(number) = value.parse::<f64>() else {
            verbosity.refusal(&format!("`{value}` is not a number\n"));
            return false;
        };
        match self.session.set_by_name(name, number) {
            Ok(()) => {
                verbosity.success(&format!("{name} is {number}\n"));
                true
            }
            Err(error) => {
                let names: Vec<String> = self.session.settings().map(|live| live.name()).collect();
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                let help = match names.contains(&name) {
                    true => String::new(),
                    false => choices(name, &names, "the live settings are"),
                };
                verbosity.refusal(&format!("`{name}` was not changed: {error}{help}\n"));
                false
            }
        }
    }

    fn list(&mut self) {
        for (name, default) in &self.parameters {
            let set = self.arguments.set.iter().find(|(known, _)| known == name);
            let value = set.map(|(_, value)| value).or(default.as_ref());
            eprint(&format!("{name} = {}\n", value.map_or("?", String::as_str)));
        }
        for live in self.session.settings() {
            eprint(&format!("{} = {}\n", live.name(), live.value));
        }
    }
}

/// Advice about an unknown name.
fn choices(name: &str, known: &[&str], are: &str) -> String {
    const SHOWN: usize = 12;
    match (closest(name, known.iter().copied()), known.len()) {
        (Some(near), _) => format!("; did you mean `{near}`?"),
        (None, 0) => "; `list` shows what can be set".to_owned(),
        (None, 1..=SHOWN) => format!("; {are} {}", known.join(", ")),
        (None, _) => format!(
            "; {are} {} and others, which `list` shows",
            known[..SHOWN].join(", ")
        ),
    }
}

fn show(findings: &Diagnostics, verbosity: Verbosity) {
    if !findings.list.is_empty() {
        verbosity.refusal(&render(findings, is_coloured(&std::io::stderr())));
    }
}
