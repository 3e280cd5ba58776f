//! The engine in a page: its audio thread runs [`Engine`], and a worker beside it has a [`Checker`] for edits.

use super::drive::DrivenBy;
use super::load::Source;
use super::pages::{Line, LineError, Reach};
use super::publish::Publisher;
use super::stage::{Host, Stage, StageError};
use super::talk::{self, Next, Work};
use super::wire::{self, Said};
use haptograph_engine::registry::Registry;
use serde::Deserialize;
use serde_json::Value;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

pub use super::wire::Message;

/// The engine of a page.
pub(crate) const HOST: Host = Host {
    name: "page",
    driven_by: DrivenBy::Caller,
    can_save: false,
    can_learn: false,
    can_drive: false,
};
/// Room for what is played in one call without allocating, samples.
const ROOM: usize = 1 << 14;

/// What is run.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Opened {
    /// The graph's file.
    pub graph: PathBuf,
    /// Parameters in place of its defaults, as RON.
    #[serde(default)]
    pub set: Vec<(String, String)>,
}

impl Opened {
    fn source(self, registry: &Registry) -> Source {
        Source::new(self.graph, registry, self.set)
    }
}

fn no_disk() -> StageError {
    StageError::Other("an engine in a page has no disk".to_owned())
}

impl Line for Sender<Message> {
    fn send(&mut self, message: Message) -> Result<(), LineError> {
        Sender::send(self, message).map_err(|_| LineError::Gone)
    }
}

/// A graph that runs as its caller says, and the page that it talks to.
pub struct Engine {
    stage: Stage,
    page: u64,
    line: Sender<Message>,
    out: Receiver<Message>,
    publisher: Publisher,
    /// What was played of the latest frames.
    played: Vec<f64>,
}

impl Engine {
    /// Begins to run a graph; its first messages wait.
    ///
    /// # Errors
    /// What is wrong with the graph, as a person reads it.
    pub fn open(opened: Opened, registry: &Registry) -> Result<Self, String> {
        let mut stage = Stage::open(opened.source(registry), HOST).map_err(|error| match error {
            StageError::Graph(wrong) => haptograph_engine::diagnostic::render(&wrong, false),
            error => error.to_string(),
        })?;
        let (line, out) = channel();
        let (page, first) = talk::greet(&mut stage, Box::new(line.clone()), Reach::Machine);
        let mut engine = Self {
            stage,
            page,
            line,
            out,
            publisher: Publisher::default(),
            played: Vec::with_capacity(ROOM),
        };
        first.into_iter().for_each(|message| engine.say(message));
        Ok(engine)
    }

    fn say(&mut self, message: Message) {
        // This end listens as long as it lives.
        let _ = self.line.send(message);
    }

    /// Takes a message of the page, and does at once what it asks for.
    pub fn hear(&mut self, message: &Message) {
        let answer = match talk::hear(&mut self.stage, self.page, message) {
            Next::Nothing => return,
            Next::Say(answer) => answer,
            Next::Do { request, work } => self.work(request, work),
            Next::Learn { request, .. } => talk::reply(request, Err(no_disk())),
        };
        self.say(super::publish::text(&answer));
    }

    fn work(&mut self, request: u64, work: Work) -> Value {
        if matches!(work, Work::Save(_)) {
            return talk::reply(request, Err(no_disk()));
        }
        let applies = !matches!(work, Work::Check(_));
        let (source, text) = work.graph(&self.stage);
        let loaded = source.load(&text);
        if !applies {
            return talk::checked(request, loaded.err().as_ref(), None);
        }
        let loaded = loaded.map_err(StageError::Graph);
        let put = loaded.and_then(|loaded| talk::put(&mut self.stage, source, loaded));
        talk::reply(request, put)
    }

    /// Runs so many frames of the driver, and returns what is played of them at [`sound_hz`](Self::sound_hz), 1 being the
    /// peak limit of the actuator. Real-time code: it does not allocate where [`publish`](Self::publish) is called often
    /// enough.
    pub fn process(&mut self, frames: usize) -> &[f64] {
        self.played.clear();
        let played = self.stage.process(frames).take(ROOM);
        self.played.extend(played);
        &self.played
    }

    /// What was played in the latest call.
    pub fn played(&self) -> &[f64] {
        &self.played
    }

    /// Makes messages of what came, to be called about a hundred times a second: the last time was `passed` ago by the
    /// clock on the wall, of which [`process`](Self::process) took `busy`.
    pub fn publish(&mut self, passed: Duration, busy: Duration) {
        self.stage.keep_time(passed, busy);
        self.publisher.publish(&mut self.stage, passed);
    }

    /// The next message to the page.
    pub fn next_message(&mut self) -> Option<Message> {
        self.out.try_recv().ok()
    }

    /// Frames of the driver in a second, Hz.
    pub fn driver_hz(&self) -> f64 {
        self.stage.rate_hz()
    }

    /// Samples that are played in a second, Hz; none where the graph drives nothing that could be heard.
    pub fn sound_hz(&self) -> Option<f64> {
        self.stage.sound.as_ref().map(|sound| sound.rate_hz)
    }
}

/// Loads what an engine is going to be told to, so that this loads nothing that is wrong.
pub struct Checker {
    source: Source,
    /// The text that runs.
    text: String,
}

impl Checker {
    /// For an engine that was opened so.
    ///
    /// # Errors
    /// What the graph's file cannot be read for.
    pub fn open(opened: Opened, registry: &Registry) -> Result<Self, String> {
        let source = opened.source(registry);
        let text = source.read().map_err(|error| error.to_string())?;
        Ok(Self { source, text })
    }

    /// The answer to a message that asks for a check, or for an edit that is wrong; none where the engine has to answer.
    pub fn answer(&mut self, message: &str) -> Option<Message> {
        let wrong = |source: &Source, text: &str| source.load(text).err();
        let answer = match wire::said(message).ok()?? {
            Said::Check { request, text } => {
                talk::checked(request, wrong(&self.source, &text).as_ref(), None)
            }
            Said::Apply { request, text } => match wrong(&self.source, &text) {
                Some(wrong) => talk::reply(request, Err(StageError::Graph(wrong))),
                None => {
                    self.text = text;
                    return None;
                }
            },
            Said::Parameter { request, name, value } => {
                let source = self.source.with(name, value);
                match wrong(&source, &self.text) {
                    Some(wrong) => talk::reply(request, Err(StageError::Graph(wrong))),
                    None => {
                        self.source = source;
                        return None;
                    }
                }
            }
            _ => return None,
        };
        Some(super::publish::text(&answer))
    }
}

#[cfg(test)]
mod tests;
