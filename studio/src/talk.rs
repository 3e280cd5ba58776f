//! What a page says and what is answered, whoever carries the messages.

use super::describe;
use super::load::{Loaded, Source};
use super::pages::{Line, Reach};
use super::publish::text;
use super::stage::{Stage, StageError};
use super::wire::{self, Message, Pointer, Said, WireError};
use haptograph_engine::diagnostic::{Diagnostics, to_json};
use serde_json::{Value, json};
use std::time::Duration;

/// What is to be done about a message.
pub enum Next {
    /// Nothing more.
    Nothing,
    /// It is answered.
    Say(Value),
    /// It takes a while; the answer is a reply to this request.
    Do { request: u64, work: Work },
    /// A recording is to become a surface, which takes long; then [`reply`].
    Learn { request: u64, name: String, csv: String },
}

/// What is done with the text of a graph. It is made of what runs when its turn comes.
pub enum Work {
    /// What is wrong with this text?
    Check(String),
    /// It takes over.
    Apply(String),
    /// Another value of a parameter.
    Parameter(String, String),
    /// The text is written to the graph's file.
    Save(String),
}

impl Work {
    /// The graph that is to be loaded: what it is made of, and its text.
    pub fn graph(self, stage: &Stage) -> (Source, String) {
        match self {
            Self::Check(text) | Self::Apply(text) | Self::Save(text) => (stage.source.clone(), text),
            Self::Parameter(name, value) => (stage.source.with(name, value), stage.loaded.text.clone()),
        }
    }
}

/// A message, understood.
pub enum Heard {
    /// Pointers on the pad of that number.
    Pointers(usize, Vec<Pointer>),
    /// What the page says; none of a kind that is not known.
    Said(Option<Said>),
}

/// A page comes: its number, and what it is told first.
pub fn greet(stage: &mut Stage, line: Box<dyn Line>, reach: Reach) -> (u64, [Message; 2]) {
    let hello = describe::hello(&stage.source.registry, &stage.host, reach);
    let graph = describe::graph(stage);
    (stage.join(line, reach), [text(&hello), text(&graph)])
}

/// Does what a message asks for, as far as that is quick.
pub fn hear(stage: &mut Stage, page: u64, message: &Message) -> Next {
    act_on(stage, page, read(message))
}

/// Reads a message, which takes a while where it is long.
pub fn read(message: &Message) -> Result<Heard, WireError> {
    match message {
        Message::Binary(bytes) => wire::pointers(bytes).map(|(pad, points)| Heard::Pointers(pad, points)),
        Message::Text(said) => wire::said(said).map(Heard::Said),
    }
}

/// Does what was read, as far as that is quick.
pub fn act_on(stage: &mut Stage, page: u64, heard: Result<Heard, WireError>) -> Next {
    match heard {
        Ok(Heard::Pointers(pad, points)) => {
            stage.point(page, pad, &points);
            Next::Nothing
        }
        Ok(Heard::Said(Some(said))) => act(stage, page, said),
        Ok(Heard::Said(None)) => Next::Nothing,
        Err(error) => refused(&error),
    }
}

fn refused(error: &dyn std::fmt::Display) -> Next {
    Next::Say(json!({ "type": "refused", "error": error.to_string() }))
}

fn act(stage: &mut Stage, page: u64, said: Said) -> Next {
    let of_page = stage.pages.iter().find(|known| known.id == page);
    if said.is_for_machine() && of_page.is_none_or(|page| page.reach != Reach::Machine) {
        return refused_because(&said, NOT_HERE);
    }
    match said {
        Said::Scope { ports } => stage.scope(page, ports),
        Said::Sound { on } => stage.page_of(page, |page| page.hears = on),
        Said::Levels { on } => stage.page_of(page, |page| page.sees_levels = on),
        // Whoever sees that something goes wrong may stop it.
        Said::Stop => stage.halt(),
        Said::Own => stage.give_to(page),
        Said::Disarm => stage.disarm(),
        Said::Check { request, text } => return done_later(request, Work::Check(text)),
        said if stage.owner == Some(page) => return act_as_owner(stage, page, said),
        said => return refused_because(&said, NOT_OWNER),
    }
    Next::Nothing
}

fn done_later(request: u64, work: Work) -> Next {
    Next::Do { request, work }
}

const NOT_OWNER: &str = "another page owns the pads and the graph; take over first";

/// What others could send who listen to the network: the pad and the settings, and nothing that lasts.
const NOT_HERE: &str = "a page that comes over the network moves the pad and the settings only; edit, save, record, \
                        learn, arm and resume on a page of the machine that runs the studio";

fn refused_because(said: &Said, why: &str) -> Next {
    match said.request() {
        Some(request) => Next::Say(reply(request, Err(StageError::Other(why.to_owned())))),
        None => refused(&why),
    }
}

/// Does a page still own the graph when the turn of what it asked for comes?
///
/// # Errors
/// [`StageError`]: it went, or another took over.
pub fn is_owner(stage: &Stage, page: u64) -> Result<(), StageError> {
    match stage.owner == Some(page) {
        true => Ok(()),
        false => Err(StageError::Other(NOT_OWNER.to_owned())),
    }
}

/// What only the page may that owns the pads.
fn act_as_owner(stage: &mut Stage, page: u64, said: Said) -> Next {
    match said {
        Said::Resume => match stage.start() {
            Ok(()) => tell_graph(stage),
            Err(error) => return refused(&error),
        },
        Said::Gain { gain } => stage.switch.set_gain(gain),
        Said::Arm => {
            if let Err(error) = stage.arm() {
                return refused(&error);
            }
        }
        Said::Hold => stage.switch.hold(),
        Said::Set { name, value } => {
            if let Err(error) = stage.set(&name, value) {
                return refused(&format_args!("`{name}` stays: {error}"));
            }
            let changed = json!({ "type": "settings", "settings": [{ "name": name, "value": value }] });
            tell_others(stage, page, &changed);
        }
        Said::Apply { request, text } => return done_later(request, Work::Apply(text)),
        Said::Parameter { request, name, value } => {
            return done_later(request, Work::Parameter(name, value));
        }
        Said::Record { on } => stage.record(on),
        Said::Replay { request, recording } => {
            let begun = stage.do_again(recording);
            return Next::Say(reply(request, begun));
        }
        Said::Save { request, text } => return done_later(request, Work::Save(text)),
        Said::Learn { request, name, csv } => return Next::Learn { request, name, csv },
        _ => {}
    }
    Next::Nothing
}

/// Puts what was loaded in place of the graph that runs.
///
/// # Errors
/// [`StageError`]: it cannot be put in place.
pub fn put(stage: &mut Stage, source: Source, loaded: Loaded) -> Result<String, StageError> {
    let change = stage.take(source, loaded)?;
    tell_graph(stage);
    Ok(change)
}

/// What is answered where a text was only checked, which took so long, where that is known.
pub fn checked(request: u64, wrong: Option<&Diagnostics>, took: Option<Duration>) -> Value {
    let diagnostics = wrong.map_or(Value::Array(Vec::new()), listed);
    let ms = took.map(|took| took.as_secs_f64() * 1e3);
    json!({ "type": "reply", "request": request, "ok": wrong.is_none(), "diagnostics": diagnostics, "ms": ms })
}

/// What is answered where something was done, or not.
pub fn reply(request: u64, result: Result<String, StageError>) -> Value {
    let mut reply = json!({
        "type": "reply", "request": request, "ok": result.is_ok(), "error": null, "diagnostics": [],
        "beyond": [], "change": null,
    });
    match result {
        Ok(change) => reply["change"] = change.into(),
        Err(StageError::Graph(wrong)) => {
            reply["error"] = "the graph has errors; nothing is changed".into();
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

/// Tells all pages of the graph that runs.
pub fn tell_graph(stage: &mut Stage) {
    let message = text(&describe::graph(stage));
    stage.pages.iter_mut().for_each(|page| page.send(message.clone()));
}

fn tell_others(stage: &mut Stage, page: u64, value: &Value) {
    let others = stage.pages.iter_mut().filter(|known| known.id != page);
    others.for_each(|page| page.send(text(value)));
}
