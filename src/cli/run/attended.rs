//! Supervision of a live run: typed commands, settings by Open Sound Control, saved files, status and
//! warnings.

mod change;

pub use change::shown;

use super::super::terminal::is_coloured;
use super::super::{GraphArguments, fault, remark};
use super::Arguments;
use super::afar;
use super::console::{Asked, HELP, HELP_LINES, Typed};
use super::drivers::Drivers;
use super::endpoints::Endpoints;
use super::guards::Guards;
use super::history::{History, Notes};
use super::loading::{self, Job, Loader, Loading, Saved, texts};
use super::silence::SilenceMonitor;
use super::status::{self, Status};
use super::watch::Watch;
use crate::engine::diagnostic::{Diagnostics, render};
use crate::engine::graph::Graph;
use crate::engine::run::Session;
use crate::engine::settings::closest;
use crate::nodes::network::{Connections, Told};
use crate::nodes::soundcard::CardNote;
use serde_json::Value;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

/// Subfolder of the run's folder for graphs saved during the run.
pub const CHANGES: &str = "changes";
/// Polling period.
const PAUSE: Duration = Duration::from_millis(50);
/// Polling period while a graph loads.
const LOOK: Duration = Duration::from_millis(5);

/// Maximum number of queued requests, and of requests handled between two checks of the stop flag.
pub const MOST_ASKED: usize = 1024;
const MOST_HEARD: usize = 64;

/// Which messages about a change are printed. A fader is moved a hundred times per second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Says {
    Nothing,
    /// Only the reasons of refusals.
    Refusals,
    Everything,
}

impl Says {
    fn refusal(self, text: &str) {
        if self >= Self::Refusals {
            remark(text);
        }
    }

    fn success(self, text: &str) {
        if self >= Self::Everything {
            remark(text);
        }
    }
}

/// Origin of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum By {
    Keyboard,
    Osc,
}

/// A change that needs the graph to be loaded again.
#[derive(Debug)]
enum Wish {
    Set {
        name: String,
        value: String,
        by: By,
    },
    /// A file of the graph was saved.
    Saved,
}

/// Supervisor of a live run.
pub struct Attended {
    /// The arguments with the present parameters.
    arguments: GraphArguments,
    /// The parameters given on the command line.
    given: Vec<(String, String)>,
    /// The parameters set since.
    typed: loading::Typed,
    /// The parameters of the running graph, with their defaults.
    parameters: loading::Typed,
    seed: Option<u64>,
    record: bool,
    folder: PathBuf,
    watch: Option<Watch>,
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
    guards: Guards,
    /// Texts of the running graph's files.
    texts: Vec<String>,
    loader: Loader,
    loading: Option<(Wish, Loading)>,
    waiting: VecDeque<Wish>,
    known: Option<loading::Known>,
    /// Panics reported so far.
    pub panics: Vec<String>,
}

impl Attended {
    /// Starts the supervision of a run of `graph`.
    pub fn begin(
        arguments: &Arguments,
        graph: &Graph,
        folder: &Path,
        (session, network): (Session, Connections),
        (watch, parameters, loader): (Option<Watch>, loading::Typed, Loader),
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
            guards: Guards::of(graph),
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
    pub fn attend(
        &mut self,
        driver: &mut Drivers,
        asked: &Receiver<Asked>,
        (stop, each): (&AtomicBool, fn()),
    ) -> Vec<String> {
        let (mut stopping, mut notes) = (false, Notes::default());
        while !driver.is_finished(stopping) {
            each();
            let pause = if self.loading.is_some() { LOOK } else { PAUSE };
            let first = asked.recv_timeout(pause).ok();
            self.tell_panics();
            for note in driver.tend() {
                match note {
                    CardNote::Turn(note) => notes.turn(note),
                    CardNote::Complaint(note) => notes.complaint(note),
                }
            }
            let inputs = self.session.live_inputs();
            // The final warnings summarise these notes, one line per input.
            for note in self.silence.poll(Instant::now(), &inputs, &self.network) {
                remark(&format!("note: {note}\n"));
            }
            for failed in self.session.failing_files() {
                remark(&format!(
                    "warning: {failed}; the file is complete up to here, and the run continues without it\n"
                ));
            }
            self.show_status(driver);
            if driver.is_torn() {
                stop.store(true, Ordering::Relaxed);
            }
            stopping = stop.load(Ordering::Relaxed);
            let room = MOST_HEARD.min(MOST_ASKED.saturating_sub(self.waiting.len()));
            self.hear(first.into_iter().chain(asked.try_iter().take(room)));
            if self.watch.as_mut().is_some_and(Watch::has_changed)
                && !self.waiting.iter().any(|wish| matches!(wish, Wish::Saved))
            {
                self.waiting.push_back(Wish::Saved);
            }
            if !stopping {
                self.go_on(driver);
            }
        }
        self.tell_panics();
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
    pub fn tell_panics(&mut self) {
        for text in fault::untold() {
            remark(&text);
            self.panics.push(text);
        }
    }

    /// Handles requests: those that need a loaded graph are queued, all others are done at once.
    fn hear(&mut self, asked: impl Iterator<Item = Asked>) {
        let mut told = Vec::new();
        for asked in asked {
            match asked {
                Asked::Typed(Typed::Set { name, value }) => self.wish(name, value, By::Keyboard),
                Asked::Typed(Typed::List) => self.list(),
                Asked::Typed(Typed::History) => remark(&self.history.lines()),
                Asked::Typed(Typed::Help) => remark(HELP_LINES),
                // The reading thread has already set the stop flag.
                Asked::Typed(Typed::Stop) => {}
                Asked::Typed(Typed::Unknown(line)) => {
                    let help = Typed::meant(&line).map_or_else(
                        || format!("type {HELP}"),
                        |meant| format!("did you mean `{meant}`?"),
                    );
                    remark(&format!("unknown command `{line}`; {help}\n"));
                }
                Asked::Told(Told { name, value }) => {
                    // Only the latest value of a fader counts.
                    told.retain(|(known, _)| *known != name);
                    told.push((name, value));
                }
            }
        }
        for (name, value) in told {
            self.wish(name, value, By::Osc);
        }
    }

    /// Sets a live setting of a node at once. A parameter is queued until the graph is loaded with it.
    fn wish(&mut self, name: String, value: String, by: By) {
        let says = self.says(&name, by);
        if name.contains('.') {
            let was_set = self.set_directly(&name, &value, says);
            return self.note(was_set, name, &value, by);
        }
        if !self.parameters.iter().any(|(known, _)| *known == name) {
            let names = self.parameters.iter().map(|(known, _)| known.as_str());
            let help = choices(&name, &names.collect::<Vec<_>>(), "its parameters are");
            says.refusal(&format!("the graph has no parameter `{name}`{help}\n"));
            return self.note(false, name, &value, by);
        }
        if by == By::Osc {
            if let Some(refusal) = afar::refusal(&value, &self.arguments.graph) {
                says.refusal(&format!("`{name}` was not changed: {refusal}\n"));
                return self.note(false, name, &value, by);
            }
            let same =
                |wish: &Wish| matches!(wish, Wish::Set { name: known, by: By::Osc, .. } if *known == name);
            self.waiting.retain(|wish| !same(wish));
        }
        self.waiting.push_back(Wish::Set { name, value, by });
    }

    /// Which messages about a request are printed.
    fn says(&self, name: &str, by: By) -> Says {
        let full = self.refused.len() >= History::MOST;
        match by {
            By::Keyboard => Says::Everything,
            By::Osc if full || self.refused.iter().any(|known| known == name) => Says::Nothing,
            By::Osc => Says::Refusals,
        }
    }

    /// Records the outcome of a request.
    fn note(&mut self, was_set: bool, name: String, value: &str, by: By) {
        if was_set {
            let by = if by == By::Keyboard { "typed" } else { "OSC" };
            self.history
                .note(self.start.elapsed().as_secs_f64(), &name, value, by);
        } else if self.says(&name, by) == Says::Refusals {
            self.refused.push(name);
        }
    }

    /// Polls the loader; when it is free, starts the next queued change.
    fn go_on(&mut self, driver: &Drivers) {
        if let Some((wish, loading)) = self.loading.take() {
            let says = match &wish {
                Wish::Set { name, by, .. } => self.says(name, *by),
                Wish::Saved => Says::Everything,
            };
            match loading.look() {
                Some(loaded) => self.take(driver, wish, loaded, &loading, says),
                None if loading.took() < loading::BUDGET => {
                    self.loading = Some((wish, loading));
                    return;
                }
                None => {
                    let budget_s = loading::BUDGET.as_secs();
                    says.refusal(&format!(
                        "the running graph is unchanged: the new one did not load within {budget_s} s\n"
                    ));
                    self.give_up(wish);
                }
            }
        }
        if let Some(wish) = self.waiting.pop_front() {
            let job = self.job(&wish);
            match self.loader.begin(job) {
                Ok(loading) => self.loading = Some((wish, loading)),
                Err(why) => {
                    remark(&format!("the running graph is unchanged: {why}\n"));
                    self.give_up(wish);
                }
            }
        }
    }

    fn give_up(&mut self, wish: Wish) {
        if let Wish::Set { name, value, by } = wish {
            self.note(false, name, &value, by);
        }
    }

    fn job(&mut self, wish: &Wish) -> Job {
        let mut arguments = self.arguments.clone();
        let saved = match wish {
            Wish::Set { name, value, .. } => {
                arguments.set.retain(|(known, _)| known != name);
                arguments.set.push((name.clone(), value.clone()));
                None
            }
            Wish::Saved => Some(Saved {
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

    fn set_directly(&mut self, name: &str, value: &str, says: Says) -> bool {
        let Ok(number) = value.parse::<f64>() else {
            says.refusal(&format!("`{value}` is not a number\n"));
            return false;
        };
        match self.session.set_by_name(name, number) {
            Ok(()) => {
                says.success(&format!("{name} is {number}\n"));
                true
            }
            Err(error) => {
                let names: Vec<String> = self.session.settings().map(|live| live.name()).collect();
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                let help = match names.contains(&name) {
                    true => String::new(),
                    false => choices(name, &names, "the live settings are"),
                };
                says.refusal(&format!("`{name}` was not changed: {error}{help}\n"));
                false
            }
        }
    }

    fn list(&mut self) {
        for (name, default) in &self.parameters {
            let set = self.arguments.set.iter().find(|(known, _)| known == name);
            let value = set.map(|(_, value)| value).or(default.as_ref());
            remark(&format!("{name} = {}\n", value.map_or("?", String::as_str)));
        }
        for live in self.session.settings() {
            remark(&format!("{} = {}\n", live.name(), live.value));
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

fn show(findings: &Diagnostics, says: Says) {
    if !findings.list.is_empty() {
        says.refusal(&render(findings, is_coloured(&std::io::stderr())));
    }
}
