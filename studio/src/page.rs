//! The engine in a page: [`Engine`] for its audio thread, and [`Checker`] for edits, in a worker.

use super::describe;
use super::error::StageError;
use super::learn;
use super::listen;
use super::load::Source;
use super::pages::{Line, LineError, Reach};
use super::publish::Publisher;
use super::stage::{Host, Stage};
use super::talk::{self, Response, Work};
use super::wire::{self, ClientMessage};
use haptograph_engine::registry::Registry;
use haptograph_signal::files::is_file;
use haptograph_study::check::{Checked, StudyError};
use haptograph_study::conduct::Conductor;
use haptograph_study::data::{DataError, Folder};
use serde::Deserialize;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

pub use super::learn::Mapping;
pub use super::wire::Message;

/// The host of an engine in a page.
pub(crate) const HOST: Host = Host {
    name: "page",
    is_driven_by_caller: true,
    can_save: false,
    // The page does it, beside the engine.
    can_learn: true,
    can_drive: false,
};
/// Folder of a study's data.
const DATA: &str = "data";
/// Buffer size for the samples played in one call without allocation.
const ROOM: usize = 1 << 14;

/// The graph or the study to run.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Opened {
    /// The file of the graph, or of the study, whose data are the files in the folder `data`.
    pub file: PathBuf,
    /// Parameters that override the defaults, as RON.
    #[serde(default)]
    pub set: Vec<(String, String)>,
}

impl Opened {
    fn source(self, registry: &Registry) -> Source {
        Source::new(self.file, registry, self.set)
    }
}

fn readable(error: StageError) -> String {
    match error {
        StageError::Graph(wrong) => haptograph_engine::diagnostic::render(&wrong, false),
        error => error.to_string(),
    }
}

fn no_disk() -> StageError {
    StageError::Other("an engine in a page has no disk".to_owned())
}

fn elsewhere() -> StageError {
    StageError::Other("an audio thread does not learn: the page does, beside it".to_owned())
}

impl Line for Sender<Message> {
    fn send(&mut self, message: Message) -> Result<(), LineError> {
        Sender::send(self, message).map_err(|_| LineError::Gone)
    }
}

/// A graph driven by its caller, with its page; with two of a study.
pub struct Engine {
    stage: Stage,
    /// The page; of a study the experimenter's, then the participant's.
    pages: Vec<Connected>,
    publisher: Publisher,
    /// Samples played by the latest call.
    played: Vec<f64>,
}

/// Opens a study in a page, whose data are its own.
///
/// # Errors
/// As readable text.
fn open_study(path: &Path, registry: &Registry) -> Result<(Source, Conductor), String> {
    let checked = Checked::load(path, None).map_err(|error| error.to_string())?;
    let folder = Folder::open(Path::new(DATA), &checked.identity(None)).map_err(|error| match error {
        DataError::OtherStudy { .. } => {
            "This browser has data of another version of the study. Download them, then remove them from this browser.".to_owned()
        }
        error => error.to_string(),
    })?;
    conduct(checked, folder, registry).map_err(|error| error.to_string())
}

fn conduct(checked: Checked, folder: Folder, registry: &Registry) -> Result<(Source, Conductor), StudyError> {
    let (graph, set) = Conductor::first(&checked, registry)?;
    let source = Source::new(checked.study.graph.clone(), registry, set);
    Ok((source, Conductor::open(checked, folder, &graph)?))
}

/// A page with the messages to it.
struct Connected {
    id: u64,
    line: Sender<Message>,
    out: Receiver<Message>,
}

impl Connected {
    fn say(&self, message: Message) {
        // The receiver exists as long as the page.
        let _ = self.line.send(message);
    }
}

impl Engine {
    /// Starts a study, as [`open`](Self::open) a graph.
    ///
    /// # Errors
    /// The errors of the study as readable text.
    pub fn open_study(opened: &Opened, registry: &Registry) -> Result<Self, String> {
        let (source, conductor) = open_study(&opened.file, registry)?;
        let mut stage = Stage::open(source, HOST).map_err(readable)?;
        stage.begin_study(conductor);
        Ok(Self::of(stage))
    }

    /// Starts a graph; its first messages are queued.
    ///
    /// # Errors
    /// The errors of the graph as readable text.
    pub fn open(opened: Opened, registry: &Registry) -> Result<Self, String> {
        Ok(Self::of(Stage::open(opened.source(registry), HOST).map_err(readable)?))
    }

    fn of(stage: Stage) -> Self {
        let mut engine = Self {
            stage,
            pages: Vec::new(),
            publisher: Publisher::default(),
            played: Vec::with_capacity(ROOM),
        };
        engine.connect(Reach::Machine);
        engine
    }

    fn connect(&mut self, reach: Reach) {
        let (line, out) = channel();
        let (id, first) = talk::greet(&mut self.stage, Box::new(line.clone()), reach);
        let page = Connected { id, line, out };
        first.into_iter().for_each(|message| page.say(message));
        self.pages.push(page);
    }

    /// Lets the participant's page of a study in, as page 1, in place of the one before; its first messages are queued.
    pub fn let_in(&mut self) {
        self.let_out();
        self.connect(Reach::Participant);
    }

    /// Says that the participant's page of a study is gone.
    pub fn let_out(&mut self) {
        for page in self.pages.drain(1..) {
            self.stage.leave(page.id);
        }
    }

    /// Handles a message of a page: 0, or 1 for the participant's of a study.
    pub fn hear(&mut self, page: usize, message: &Message) {
        let Some(id) = self.pages.get(page).map(|page| page.id) else { return };
        let answer = match talk::hear(&mut self.stage, id, message) {
            // The page learns, and cancels that itself.
            Response::None | Response::Cancel { .. } => return,
            Response::Answer(answer) => answer,
            Response::Work { request, work } => self.work(request, work),
            Response::Learn { request, .. }
            | Response::Listen { request, .. }
            | Response::Export { request, .. } => talk::reply(request, Err(elsewhere())),
        };
        self.pages[page].say(wire::text(&answer));
    }

    fn work(&mut self, request: u64, work: Work) -> Value {
        let (checks, collects) = (matches!(work, Work::Check(_)), matches!(work, Work::Files));
        if matches!(work, Work::Save(_)) {
            return talk::reply(request, Err(no_disk()));
        }
        let (source, text) = work.graph(&self.stage);
        if collects {
            return talk::files(request, &source, &text);
        }
        let loaded = source.load(&text);
        if checks {
            return talk::checked(request, loaded.err().as_ref(), None);
        }
        let loaded = loaded.map_err(StageError::Graph);
        let put = loaded.and_then(|loaded| talk::put(&mut self.stage, source, loaded));
        talk::reply(request, put)
    }

    /// The file for a new surface of this name, beside the others of the graph; `None` if a thousand exist.
    pub fn surface_file(&self, name: &str) -> Option<PathBuf> {
        free_file(&self.stage.source, name)
    }

    /// Queues the graph's description anew, with the surfaces that are in its folder now.
    pub fn tell_graph(&mut self) {
        talk::tell_graph(&mut self.stage);
    }

    /// Runs `frames` frames of the driver; returns the samples to play at [`sound_hz`](Self::sound_hz), where
    /// 1 is the peak limit of the actuator. Real-time code: it does not allocate if
    /// [`publish`](Self::publish) is called often enough.
    pub fn process(&mut self, frames: usize) -> &[f64] {
        self.played.clear();
        let played = self.stage.process(frames).take(ROOM);
        self.played.extend(played);
        &self.played
    }

    /// The samples played by the latest call.
    pub fn played(&self) -> &[f64] {
        &self.played
    }

    /// Queues messages with new data; call it about a hundred times per second. `passed` is the wall-clock
    /// time since the last call, `busy` the time that [`process`](Self::process) took of it.
    pub fn publish(&mut self, passed: Duration, busy: Duration) {
        self.stage.keep_time(passed, busy);
        self.publisher.publish(&mut self.stage);
    }

    /// The next message to a page.
    pub fn next_message(&mut self, page: usize) -> Option<Message> {
        self.pages.get(page)?.out.try_recv().ok()
    }

    /// Rate of the driver, Hz.
    pub fn driver_hz(&self) -> f64 {
        self.stage.signals.rate_hz
    }

    /// Rate of the played samples, Hz; `None` if the graph drives nothing audible.
    pub fn sound_hz(&self) -> Option<f64> {
        self.stage.signals.sound.as_ref().map(|sound| sound.rate_hz)
    }
}

/// Checks edits before they reach an engine, so that the engine loads correct graphs only. [`follow`](Self::follow)
/// keeps it in step with the engine.
pub struct Checker {
    source: Source,
    /// The running text.
    text: String,
}

impl Checker {
    /// A checker for an engine opened with the same arguments.
    ///
    /// # Errors
    /// The error of reading the graph's file.
    pub fn open(opened: Opened, registry: &Registry) -> Result<Self, String> {
        let source = opened.source(registry);
        let text = source.read().map_err(|error| error.to_string())?;
        Ok(Self { source, text })
    }

    /// The answer to a check, or to an edit with errors; `None` if the engine has to answer.
    pub fn answer(&self, message: &str) -> Option<Message> {
        let wrong = |source: &Source, text: &str| source.load(text).err();
        let refused = |request, wrong| talk::reply(request, Err(StageError::Graph(wrong)));
        let answer = match wire::parse_text(message).ok()?? {
            ClientMessage::Check { request, text } => {
                talk::checked(request, wrong(&self.source, &text).as_ref(), None)
            }
            ClientMessage::Apply { request, text } => refused(request, wrong(&self.source, &text)?),
            ClientMessage::Parameter { request, name, value } => {
                refused(request, wrong(&self.source.with(name, value), &self.text)?)
            }
            _ => return None,
        };
        Some(wire::text(&answer))
    }

    /// The answer to a page that listens; the recording is a file here. `None` for another message.
    pub fn listen(&self, message: &str) -> Option<Message> {
        match wire::parse_text(message).ok()?? {
            ClientMessage::Listen { request, compared } => {
                let table = Path::new(&compared.dropped.name);
                Some(wire::text(&listen::reply(request, table, &compared, &self.source)))
            }
            _ => None,
        }
    }

    /// The file for a new surface of this name, beside the others of the graph, and its path as a parameter; `None` if a
    /// thousand exist.
    pub fn surface_file(&self, name: &str) -> Option<(PathBuf, String)> {
        let path = free_file(&self.source, name)?;
        let parameter = describe::from_graph(&path, self.source.folder());
        Some((path, parameter))
    }

    /// Checks against another graph from now on: the engine's message of type `graph`. Others are ignored.
    pub fn follow(&mut self, message: &str) {
        if let Ok(Running::Graph { text, parameters }) = serde_json::from_str(message) {
            self.text = text;
            let changed = parameters.into_iter().filter(|each| each.value != each.default);
            self.source.set = changed.map(|each| (each.name, each.value)).collect();
        }
    }
}

fn free_file(source: &Source, name: &str) -> Option<PathBuf> {
    let folder = describe::surface_folder(source.folder());
    learn::paths(&folder, &learn::stem(name)).find(|path| !is_file(path))
}

/// Learns the surface of a recording in a file: its name, the text of its file, and the report as HTML.
///
/// # Errors
/// A description of the error in the recording.
pub fn learn_recording(recording: &Path, mapping: &Mapping) -> Result<[String; 3], String> {
    let stem = learn::stem(&recording.to_string_lossy());
    let learned = learn::learn_table(&stem, recording, mapping)?;
    Ok([stem, learned.text(), learned.page()])
}

/// The answer to a page that exports its sound; `None` for another message.
pub fn export(message: &str) -> Option<Message> {
    match wire::parse_text(message).ok()?? {
        ClientMessage::Export { request, kept } => Some(wire::text(&talk::exported(request, &kept))),
        _ => None,
    }
}

/// What reading a recording in a file finds, as in the reply to `learn` with `reads`.
pub fn read_recording(recording: &Path, mapping: &Mapping) -> serde_json::Value {
    learn::reading(recording, mapping)
}

/// The parts of the engine's messages that a checker needs.
#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum Running {
    Graph { text: String, parameters: Vec<RunningParameter> },
}

#[derive(Deserialize)]
struct RunningParameter {
    name: String,
    value: String,
    default: String,
}

#[cfg(test)]
mod tests;
