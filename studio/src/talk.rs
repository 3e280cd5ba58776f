//! Messages of a page and their answers, independent of the transport.

use super::bundle;
use super::describe;
use super::error::StageError;
use super::learn::{Compared, Dropped};
use super::load::{Loaded, Source};
use super::pages::{Line, Reach};
use super::pattern::Kept;
use super::stage::Stage;
use super::wire::text;
use super::wire::{self, ClientMessage, Message, Pointers, WireError};
use haptograph_engine::diagnostic::{Diagnostics, to_json};
use serde_json::{Value, json};
use std::time::Duration;

/// The action that a message requires.
pub(crate) enum Response {
    /// No action.
    None,
    /// Send this answer.
    Answer(Value),
    /// Do long work; its answer is a reply to this request.
    Work { request: u64, work: Work },
    /// Learn a surface from a recording, which takes long; then [`reply`].
    Learn { request: u64, dropped: Dropped },
    /// Listen to a recording and surfaces, which takes a while; then `listen::reply`.
    Listen { request: u64, compared: Compared },
    /// Make a file of kept sound, which takes a while; then [`exported`].
    Export { request: u64, kept: Kept },
    /// Cancel the learning of this request.
    Cancel { request: u64 },
}

/// Work on the text of a graph. It applies to the graph that runs when its turn comes.
pub(crate) enum Work {
    /// Check this text.
    Check(String),
    /// Swap this text in.
    Apply(String),
    /// Change a parameter.
    Parameter(String, String),
    /// Write this text to the graph's file.
    Save(String),
    /// Collect the running text and the files that it needs.
    Files,
}

impl Work {
    /// The source and text of the graph to load.
    pub(crate) fn graph(self, stage: &Stage) -> (Source, String) {
        match self {
            Self::Check(text) | Self::Apply(text) | Self::Save(text) => (stage.source.clone(), text),
            Self::Parameter(name, value) => (stage.source.with(name, value), stage.loaded.text.clone()),
            Self::Files => (stage.source.clone(), stage.loaded.text.clone()),
        }
    }
}

/// A parsed message.
pub(crate) enum Incoming {
    Pointers(Pointers),
    /// A JSON message; `None` if its type is unknown.
    Json(Option<ClientMessage>),
}

/// Adds a page; returns its number and the first messages to it.
pub(crate) fn greet(stage: &mut Stage, line: Box<dyn Line>, reach: Reach) -> (u64, Vec<Message>) {
    if let Some(hello) = stage.study_greeting(reach) {
        return (stage.join(line, reach), vec![text(&hello)]);
    }
    let hello = describe::hello(&stage.source.registry, &stage.host, reach);
    let graph = describe::graph(stage);
    let disk = stage.pages.disk.as_ref().filter(|_| reach == Reach::Machine);
    let disk = disk.map(|now| text(&json!({ "type": "disk", "text": now })));
    (stage.join(line, reach), [text(&hello), text(&graph)].into_iter().chain(disk).collect())
}

/// Handles a message, except for work that takes long.
pub(crate) fn hear(stage: &mut Stage, page: u64, message: &Message) -> Response {
    act_on(stage, page, read(message))
}

/// Parses a message, which takes a while for a long one.
pub(crate) fn read(message: &Message) -> Result<Incoming, WireError> {
    match message {
        Message::Binary(bytes) => wire::pointers(bytes).map(Incoming::Pointers),
        Message::Text(message) => wire::parse_text(message).map(Incoming::Json),
    }
}

/// True for a message that takes real actuators to zero, whoever sends it.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn disarms(incoming: &Result<Incoming, WireError>) -> bool {
    matches!(incoming, Ok(Incoming::Json(Some(ClientMessage::Stop | ClientMessage::Disarm))))
}

/// Handles a parsed message, except for work that takes long.
pub(crate) fn act_on(stage: &mut Stage, page: u64, incoming: Result<Incoming, WireError>) -> Response {
    match incoming {
        Ok(Incoming::Pointers(pointers)) => {
            stage.point(page, &pointers);
            Response::None
        }
        Ok(Incoming::Json(Some(message))) => act(stage, page, message),
        Ok(Incoming::Json(None)) => Response::None,
        Err(error) => refused(&error),
    }
}

fn refused(error: &dyn std::fmt::Display) -> Response {
    Response::Answer(json!({ "type": "refused", "error": error.to_string() }))
}

fn act(stage: &mut Stage, page: u64, message: ClientMessage) -> Response {
    if stage.pages.study.is_some() {
        return stage.hear_in_study(page, message);
    }
    let of_page = stage.pages.list.iter().find(|known| known.id == page);
    if message.is_for_machine() && of_page.is_none_or(|page| page.reach != Reach::Machine) {
        return refused_because(&message, NOT_HERE);
    }
    match message {
        ClientMessage::Scope { ports } => stage.scope(page, ports),
        ClientMessage::Sound { on } => stage.page_of(page, |page| page.hears = on),
        ClientMessage::Levels { on } => stage.page_of(page, |page| page.sees_levels = on),
        // Any page may stop the run.
        ClientMessage::Stop => stage.halt(),
        ClientMessage::Own => stage.give_to(page),
        ClientMessage::Disarm => stage.disarm(),
        ClientMessage::Check { request, text } => return done_later(request, Work::Check(text)),
        ClientMessage::Files { request } => return done_later(request, Work::Files),
        // Also of a page that is no longer the owner.
        ClientMessage::Cancel { request } => return Response::Cancel { request },
        ClientMessage::Listen { request, compared } => return Response::Listen { request, compared },
        ClientMessage::Export { request, kept } => return Response::Export { request, kept },
        message if stage.pages.owner == Some(page) => return act_as_owner(stage, page, message),
        // A page that was the owner until now.
        ClientMessage::Hold => {}
        message => return refused_because(&message, NOT_OWNER),
    }
    Response::None
}

fn done_later(request: u64, work: Work) -> Response {
    Response::Work { request, work }
}

const NOT_OWNER: &str = "another page owns the pads and the graph; take over first";

/// Pages over the network cannot be authenticated against eavesdroppers, so they get only the pad and the
/// settings.
const NOT_HERE: &str = "a page on the network controls the pad and the settings only; edit, save, record, \
                        learn, arm and resume on the machine that runs the studio";

fn refused_because(message: &ClientMessage, why: &str) -> Response {
    match message.request() {
        Some(request) => Response::Answer(reply(request, Err(StageError::Other(why.to_owned())))),
        None => refused(&why),
    }
}

/// Checks that a page still owns the graph when its request is processed.
///
/// # Errors
/// [`StageError`] if the page left or another page took over.
pub(crate) fn is_owner(stage: &Stage, page: u64) -> Result<(), StageError> {
    match stage.pages.owner == Some(page) {
        true => Ok(()),
        false => Err(StageError::Other(NOT_OWNER.to_owned())),
    }
}

/// Handles messages reserved for the owner.
fn act_as_owner(stage: &mut Stage, page: u64, message: ClientMessage) -> Response {
    match message {
        ClientMessage::Resume => match stage.start() {
            Ok(()) => tell_graph(stage),
            Err(error) => return refused(&error),
        },
        ClientMessage::Gain { gain } => stage.devices.switch.set_gain(gain),
        ClientMessage::Arm => {
            if let Err(error) = stage.arm() {
                return refused(&error);
            }
        }
        ClientMessage::Hold => stage.devices.switch.hold(),
        ClientMessage::Set { name, value } => {
            if let Err(error) = stage.set(&name, value) {
                return refused(&format_args!("`{name}` was not changed: {error}"));
            }
            let changed = json!({ "type": "settings", "settings": [{ "name": name, "value": value }] });
            tell_others(stage, page, &changed);
        }
        ClientMessage::Apply { request, text } => return done_later(request, Work::Apply(text)),
        ClientMessage::Parameter { request, name, value } => {
            return done_later(request, Work::Parameter(name, value));
        }
        ClientMessage::Record { on } => {
            if let Err(error) = stage.record(on) {
                return refused(&error);
            }
        }
        ClientMessage::Replay { request, recording } => {
            let begun = stage.start_replay(recording);
            return Response::Answer(reply(request, begun));
        }
        ClientMessage::Keep => {
            if let Some(disk) = stage.pages.disk.take() {
                stage.on_disk = disk;
            }
        }
        ClientMessage::Save { request, text } => return done_later(request, Work::Save(text)),
        ClientMessage::Learn { request, dropped } => return Response::Learn { request, dropped },
        _ => {}
    }
    Response::None
}

/// Swaps a loaded graph in.
///
/// # Errors
/// [`StageError`] if it cannot be swapped in.
pub(crate) fn put(stage: &mut Stage, source: Source, loaded: Loaded) -> Result<String, StageError> {
    let change = stage.swap(source, loaded)?;
    if let Some(disk) = stage.pages.disk.take_if(|disk| *disk == stage.loaded.text) {
        stage.on_disk = disk;
    }
    tell_graph(stage);
    Ok(change)
}

/// The answer to a check, with its duration, if known.
pub(crate) fn checked(request: u64, wrong: Option<&Diagnostics>, took: Option<Duration>) -> Value {
    let diagnostics = wrong.map_or(Value::Array(Vec::new()), listed);
    let ms = took.map(|took| took.as_secs_f64() * 1e3);
    json!({ "type": "reply", "request": request, "ok": wrong.is_none(), "diagnostics": diagnostics, "ms": ms })
}

/// The answer to a request of files.
pub(crate) fn files(request: u64, source: &Source, text: &str) -> Value {
    let loaded = source.load(text).map_err(StageError::Graph);
    reply_with(request, "bundle", loaded.and_then(|loaded| bundle::bundle(source, &loaded)))
}

/// The answer to a request of kept sound as a file.
pub(crate) fn exported(request: u64, kept: &Kept) -> Value {
    reply_with(request, "pattern", kept.pattern())
}

/// The reply to a request, with a value by its name.
fn reply_with(request: u64, name: &str, value: Result<Value, StageError>) -> Value {
    match value {
        Ok(value) => {
            let mut answer = reply(request, Ok(String::new()));
            answer[name] = value;
            answer
        }
        Err(error) => reply(request, Err(error)),
    }
}

/// The reply to a request, successful or not.
pub(crate) fn reply(request: u64, result: Result<String, StageError>) -> Value {
    let mut reply = json!({
        "type": "reply", "request": request, "ok": result.is_ok(), "error": null, "diagnostics": [],
        "beyond": [], "change": null,
    });
    match result {
        Ok(change) => reply["change"] = change.into(),
        Err(StageError::Graph(wrong)) => {
            reply["error"] = "the graph has errors; nothing was changed".into();
            reply["diagnostics"] = listed(&wrong);
        }
        Err(error) => {
            reply["error"] = error.to_string().into();
            if let StageError::Beyond(beyond) = error {
                reply["beyond"] = beyond.into();
            }
        }
    }
    reply
}

fn listed(wrong: &Diagnostics) -> Value {
    serde_json::from_str(&to_json(wrong)).unwrap_or_default()
}

/// Sends the running graph to all pages.
pub(crate) fn tell_graph(stage: &mut Stage) {
    if stage.pages.study.is_some() {
        return;
    }
    let message = text(&describe::graph(stage));
    stage.pages.list.iter_mut().for_each(|page| page.send(message.clone()));
}

fn tell_others(stage: &mut Stage, page: u64, value: &Value) {
    let others = stage.pages.list.iter_mut().filter(|known| known.id != page);
    others.for_each(|page| page.send(text(value)));
}
