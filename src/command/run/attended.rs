//! A live run that is looked after: what is typed, told and saved while it runs.

use super::super::{GraphArguments, remark, warnings};
use super::console::{Asked, HELP, Typed};
use super::drivers::Drivers;
use super::guards::Guards;
use super::history::{History, Notes};
use super::watch::Watch;
use super::{Arguments, spare_own_files};
use haptograph::engine::diagnostic::{Diagnostics, render};
use haptograph::engine::document::{Document, LoadOptions};
use haptograph::engine::graph::Graph;
use haptograph::engine::run::{Change, Changed, RingReport, Session};
use haptograph::engine::settings::closest;
use haptograph::nodes::network::{Connections, Told};
use haptograph::nodes::soundcard::{CardNote, wanted};
use serde_json::{Value, json};
use std::fs;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

/// Where graphs that were saved while it ran are kept, in the run's folder.
pub const CHANGES: &str = "changes";
/// How often the run is looked after, and how often its status is shown.
const PAUSE: Duration = Duration::from_millis(50);
const STATUS: Duration = Duration::from_secs(1);

/// Wishes that wait, and those that are heard between two looks at whether the run should stop.
pub const MOST_ASKED: usize = 1024;
const MOST_HEARD: usize = 64;

/// How much is said of a change. A fader is moved a hundred times a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Says {
    Nothing,
    /// Why it is refused.
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

/// A run and what may happen to it.
pub struct Attended {
    /// With the parameters as they are now.
    arguments: GraphArguments,
    /// Parameters as the command line gave them.
    given: Vec<(String, String)>,
    /// Parameters that were typed or told since, with the default that the file had for each.
    typed: Vec<(String, Option<String>)>,
    seed: Option<u64>,
    record: bool,
    folder: PathBuf,
    watch: Option<Watch>,
    pub session: Session,
    pub network: Connections,
    start: Instant,
    /// Graphs that were put in place, and those of them that differed in more than live settings.
    pub changes: u32,
    pub swaps: u32,
    /// Of those that were saved: when, what came of it, and where its files are kept.
    pub saved: Vec<Value>,
    pub history: History,
    /// Names that were told by Open Sound Control and refused; said once each.
    refused: Vec<String>,
    guards: Guards,
    /// Texts of the files of the graph that runs.
    texts: Vec<String>,
}

impl Attended {
    /// A run of `graph` that begins now.
    pub fn begin(
        arguments: &Arguments,
        graph: &Graph,
        folder: &Path,
        watch: Option<Watch>,
        session: Session,
        network: Connections,
    ) -> Self {
        Self {
            given: arguments.graph.set.clone(),
            typed: Vec::new(),
            arguments: arguments.graph.clone(),
            seed: arguments.seed,
            record: arguments.record,
            folder: folder.to_owned(),
            watch,
            session,
            network,
            start: Instant::now(),
            changes: 0,
            swaps: 0,
            saved: Vec::new(),
            history: History::default(),
            refused: Vec::new(),
            guards: Guards::of(graph),
            texts: texts(graph),
        }
    }

    /// Looks after the run until it is over. Returns what the driver had to say.
    pub fn attend(
        &mut self,
        driver: &mut Drivers,
        asked: &Receiver<Asked>,
        stop: &AtomicBool,
    ) -> Vec<String> {
        let start = self.start;
        let (mut shown, mut stopping, mut notes) = (start, false, Notes::default());
        while !driver.is_finished(stopping) {
            let first = asked.recv_timeout(PAUSE).ok();
            for note in driver.tend() {
                match note {
                    CardNote::Turn(note) => notes.turn(note),
                    CardNote::Complaint(note) => notes.complaint(note),
                }
            }
            self.network.tend().into_iter().for_each(|note| notes.turn(note));
            let status = status(&mut self.session, driver.rings());
            if shown.elapsed() >= STATUS {
                shown += STATUS;
                let seconds = start.elapsed().as_secs_f64();
                let (driver, network) = (driver.status(), self.network.status());
                remark(&format!("{seconds:.0} s: {status}{driver}{network}\n"));
            }
            if driver.is_torn() {
                stop.store(true, Ordering::Relaxed);
            }
            if stop.load(Ordering::Relaxed) && !stopping {
                // Asked again where the real-time side has not read its commands for a while.
                stopping = self.session.stop().is_ok();
            }
            let mut told = Vec::new();
            for asked in first.into_iter().chain(asked.try_iter()).take(MOST_HEARD) {
                match asked {
                    Asked::Typed(Typed::Set { name, value }) => {
                        if self.set(driver, &name, &value, Says::Everything) {
                            self.history
                                .note(start.elapsed().as_secs_f64(), &name, &value, "typed");
                        }
                    }
                    Asked::Typed(Typed::List) => self.list(),
                    Asked::Typed(Typed::Stop) => stop.store(true, Ordering::Relaxed),
                    Asked::Typed(Typed::Unknown(line)) => {
                        remark(&format!("`{line}` is not known; type {HELP}\n"));
                    }
                    Asked::Told(Told { name, value }) => {
                        // A fader that moves fast is where it is now.
                        told.retain(|(known, _)| *known != name);
                        told.push((name, value));
                    }
                }
            }
            for (name, value) in told {
                let full = self.refused.len() >= History::MOST;
                if full && !name.contains('.') && !self.arguments.set.iter().any(|(known, _)| *known == name)
                {
                    // To see whether there is such a parameter the graph would be loaded, each time.
                    continue;
                }
                let known = full || self.refused.contains(&name);
                let says = if known { Says::Nothing } else { Says::Refusals };
                if self.set(driver, &name, &value, says) {
                    self.history
                        .note(start.elapsed().as_secs_f64(), &name, &value, "OSC");
                } else if !known {
                    self.refused.push(name);
                }
            }
            if self.watch.as_mut().is_some_and(Watch::has_changed) {
                self.reload_saved(driver);
            }
        }
        notes.counted()
    }

    /// A parameter of the graph, or a live setting of a node. Was it set?
    fn set(&mut self, driver: &Drivers, name: &str, value: &str, says: Says) -> bool {
        if name.contains('.') {
            return self.set_directly(name, value, says);
        }
        let before = self.arguments.set.clone();
        self.arguments.set.retain(|(known, _)| known != name);
        self.arguments.set.push((name.to_owned(), value.to_owned()));
        let Some(taken) = self.reload(driver, says) else {
            self.arguments.set = before;
            return false;
        };
        self.typed.retain(|(known, _)| known != name);
        self.typed.push((name.to_owned(), self.default_of(name)));
        // A file that was saved just before is still seen by the watch, for what else follows from that; it may find
        // that this graph runs already.
        if let Some(watch) = &mut self.watch {
            watch.also(&taken.graph);
        }
        if taken.is_saved || !matches!(taken.change, Change::Settings(_)) {
            self.keep(&taken.graph, taken.change);
        }
        true
    }

    /// The default that the file has for a parameter now, as it is written.
    fn default_of(&self, name: &str) -> Option<String> {
        let document = Document::load(&self.arguments.graph, &LoadOptions::default()).ok()?;
        let mut parameters = document.parameters();
        parameters
            .find(|(known, _)| *known == name)
            .map(|(_, text)| text.to_owned())
    }

    /// After a save: a parameter whose default is another now is the file's again, whatever was typed before.
    fn reload_saved(&mut self, driver: &Drivers) {
        let before = self.arguments.set.clone();
        let (same, other): (Vec<_>, Vec<_>) = std::mem::take(&mut self.typed)
            .into_iter()
            .partition(|(name, default)| self.default_of(name) == *default);
        for (name, _) in &other {
            self.arguments.set.retain(|(known, _)| known != name);
            let given = self.given.iter().find(|(known, _)| known == name);
            self.arguments.set.extend(given.cloned());
        }
        self.typed = same;
        match self.reload(driver, Says::Everything) {
            None => {
                self.arguments.set = before;
                self.typed.extend(other);
            }
            Some(taken) => {
                // A changed graph may read other files.
                self.watch = taken.watch;
                if taken.change != Change::Settings(0) {
                    self.keep(&taken.graph, taken.change);
                }
            }
        }
    }

    /// Keeps the files of a graph that was saved, so that the run can be understood.
    fn keep(&mut self, graph: &Graph, change: Change) {
        // A fader may change the graph a hundred times a second.
        if self.saved.len() >= History::MOST {
            return;
        }
        let place = Path::new(CHANGES).join((self.saved.len() + 1).to_string());
        let folder = self.folder.join(&place);
        let written = fs::create_dir_all(&folder).and_then(|()| {
            for (number, source) in graph.sources().iter().enumerate() {
                let name = source.path.file_name().unwrap_or_default().to_string_lossy();
                let file = match folder.join(&*name) {
                    file if file.exists() => folder.join(format!("{number}-{name}")),
                    file => file,
                };
                fs::write(file, source.text.as_bytes())?;
            }
            Ok(())
        });
        if let Err(error) = written {
            remark(&format!(
                "the saved graph is not kept in {}: {error}\n",
                place.display()
            ));
        }
        let at_s = (self.start.elapsed().as_secs_f64() * 100.0).round() / 100.0;
        self.saved
            .push(json!({ "at_s": at_s, "what": what(change), "graph": place.to_string_lossy() }));
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
                let near = closest(name, names.iter().map(String::as_str));
                let help = near
                    .filter(|near| *near != name)
                    .map(|near| format!("; did you mean `{near}`?"));
                says.refusal(&format!("`{name}` stays: {error}{}\n", help.unwrap_or_default()));
                false
            }
        }
    }

    fn list(&mut self) {
        for live in self.session.settings() {
            remark(&format!("{} = {}\n", live.name(), live.value));
        }
    }

    /// Loads the graph again and puts it in place of the one that runs; a wrong one is shown and changes nothing.
    fn reload(&mut self, driver: &Drivers, says: Says) -> Option<Taken> {
        let began = Instant::now();
        let graph = match self.arguments.load(self.seed) {
            Ok(graph) => graph,
            Err(wrong) => {
                show(&wrong, says);
                says.refusal("the graph stays as it was\n");
                return None;
            }
        };
        let watch = self.watch.as_ref().map(|_| Watch::of(&graph));
        if says == Says::Everything {
            show(&warnings(&graph), says);
        }
        let lack = match wanted(&graph) {
            Ok(wanted) => driver
                .lack(&wanted)
                .map(|what| format!("it asks for {what} now, and that needs a new run")),
            Err(error) => Some(error.to_string()),
        };
        if let Some(lack) = lack {
            says.refusal(&format!("the graph stays as it was: {lack}\n"));
            return None;
        }
        if let Err(own) = spare_own_files(&graph, self.record) {
            says.refusal(&format!("the graph stays as it was: {own}\n"));
            return None;
        }
        let guards = Guards::of(&graph);
        if says < Says::Everything && guards != self.guards {
            says.refusal(
                "the graph stays as it was: an actuator's limit or device would change, and that is not done from afar\n",
            );
            return None;
        }
        let connected = match self.network.connect(&graph) {
            Ok(connected) => connected,
            Err(error) => {
                says.refusal(&format!("the graph stays as it was: {error}\n"));
                return None;
            }
        };
        match self.session.change(&graph, &self.folder) {
            Ok(changed) => {
                self.network.miss_only_those_of(&graph);
                self.changes += 1;
                self.swaps += u32::from(!matches!(changed.change, Change::Settings(_)));
                // The file may have been edited meanwhile, so another graph is always told of.
                if says == Says::Everything || !matches!(changed.change, Change::Settings(_)) {
                    remark(&told(&changed, began.elapsed()));
                }
                for change in guards.changes(&self.guards) {
                    remark(&format!("{change}\n"));
                }
                self.guards = guards;
                let before = std::mem::replace(&mut self.texts, texts(&graph));
                Some(Taken {
                    is_saved: before != self.texts,
                    graph,
                    change: changed.change,
                    watch,
                })
            }
            Err(error) => {
                self.network.let_go(connected);
                says.refusal(&format!("the graph stays as it was: {error}\n"));
                None
            }
        }
    }
}

/// A graph that took over.
struct Taken {
    graph: Graph,
    change: Change,
    /// Of its files, as they were when it was loaded.
    watch: Option<Watch>,
    /// Are its texts others than those of the graph before?
    is_saved: bool,
}

/// The texts of a graph's files; what was given on the command line has no file.
fn texts(graph: &Graph) -> Vec<String> {
    let sources = graph.sources().iter();
    let files = sources.filter(|source| source.path != Path::new("--set"));
    files.map(|source| source.text.to_string()).collect()
}

/// How time is kept, by driver where there are several, and how the rings between them are.
fn status(session: &mut Session, heard: impl Iterator<Item = RingReport>) -> String {
    let mut parts: Vec<String> = match &session.poll()[..] {
        [(_, meters)] => vec![meters.to_string()],
        several => several
            .iter()
            .map(|(name, meters)| format!("{name}: {meters}"))
            .collect(),
    };
    parts.extend(session.rings().chain(heard).map(|ring| {
        let counts = ring.counts;
        let fill = counts
            .fill_s
            .map_or_else(|| "empty".to_owned(), |fill_s| format!("{:.2} ms", fill_s * 1e3));
        format!(
            "ring {}: {fill}, {:+.0} ppm, {} underruns, {} overruns",
            ring.name, counts.correction_ppm, counts.underruns, counts.overruns
        )
    }));
    parts.join("; ")
}

fn show(findings: &Diagnostics, says: Says) {
    if !findings.list.is_empty() {
        says.refusal(&render(findings, std::io::stderr().is_terminal()));
    }
}

fn told(changed: &Changed, took: Duration) -> String {
    let mut text = what(changed.change);
    for (paths, what) in [
        (&changed.begun, "begins"),
        (&changed.ended, "is complete"),
        (&changed.left_out, "holds other signals and is not begun again"),
    ] {
        for path in paths {
            let name = path.file_name().unwrap_or(path.as_os_str()).display();
            text += &format!("; {name} {what}");
        }
    }
    text + &format!(" ({:.0} ms)\n", took.as_secs_f64() * 1e3)
}

fn what(change: Change) -> String {
    match change {
        Change::Settings(0) => "nothing changed".to_owned(),
        Change::Settings(1) => "a setting changed".to_owned(),
        Change::Settings(count) => format!("{count} settings changed"),
        Change::CrossFade => "the graph changed, cross-faded".to_owned(),
        Change::AtOnce => "the graph changed".to_owned(),
        Change::AtZero(reason) => format!("the graph changed, through zero as {reason}"),
    }
}
