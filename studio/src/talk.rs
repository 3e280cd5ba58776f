//! What a page says and what is answered, whoever carries the messages.

use super::describe;
use super::load::{Loaded, Source};
use super::pages::Line;
use super::publish::text;
use super::stage::{Stage, StageError};
use super::wire::{self, Message, Said};
use haptograph_engine::diagnostic::{Diagnostics, to_json};
use serde_json::{Value, json};
use std::time::Duration;

/// What is to be done about a message.
pub enum Next {
    /// Nothing more.
    Nothing,
    /// It is answered.
    Say(Value),
    /// A text is to be loaded, which takes a while; then [`checked`] or [`put`].
    Load {
        request: u64,
        source: Source,
        text: String,
        /// Does it take over?
        applies: bool,
    },
    /// A text is to be written to the graph's file; then [`reply`].
    Save { request: u64, text: String },
    /// A recording is to become a surface, which takes long; then [`learned`].
    Learn { request: u64, name: String, csv: String },
}

/// A page comes: its number, and what it is told first.
pub fn greet(stage: &mut Stage, line: Box<dyn Line>) -> (u64, [Message; 2]) {
    let hello = describe::hello(&stage.source.registry, &stage.host);
    let graph = describe::graph(stage);
    (stage.join(line), [text(&hello), text(&graph)])
}

/// Does what a message asks for, as far as that is quick.
pub fn hear(stage: &mut Stage, page: u64, message: &Message) -> Next {
    match message {
        Message::Binary(bytes) => match wire::pointers(bytes) {
            Ok((pad, points)) => {
                stage.point(page, pad, &points);
                Next::Nothing
            }
            Err(error) => refused(&error),
        },
        Message::Text(said) => match wire::said(said) {
            Ok(Some(said)) => act(stage, page, said),
            Ok(None) => Next::Nothing,
            Err(error) => refused(&error),
        },
    }
}

fn refused(error: &dyn std::fmt::Display) -> Next {
    Next::Say(json!({ "type": "refused", "error": error.to_string() }))
}

fn act(stage: &mut Stage, page: u64, said: Said) -> Next {
    match said {
        Said::Scope { ports } => stage.scope(page, ports),
        Said::Sound { on } => {
            if let Some(page) = stage.pages.iter_mut().find(|known| known.id == page) {
                page.hears = on;
            }
        }
        // Whoever sees that something goes wrong may stop it.
        Said::Stop => stage.halt(),
        Said::Own => stage.owner = Some(page),
        Said::Check { request, text } => {
            let source = stage.source.clone();
            return Next::Load {
                request,
                source,
                text,
                applies: false,
            };
        }
        said if stage.owner == Some(page) => return act_as_owner(stage, page, said),
        said => return refused_to_guest(&said),
    }
    Next::Nothing
}

fn refused_to_guest(said: &Said) -> Next {
    let why = "another page owns the pads and the graph; take over first";
    match said.request() {
        Some(request) => Next::Say(reply(request, Err(StageError::Other(why.to_owned())))),
        None => refused(&why),
    }
}

/// What only the page may that owns the pads.
fn act_as_owner(stage: &mut Stage, page: u64, said: Said) -> Next {
    match said {
        Said::Resume => match stage.start() {
            Ok(()) => tell_graph(stage),
            Err(error) => return refused(&error),
        },
        Said::Set { name, value } => {
            if let Err(error) = stage.set(&name, value) {
                return refused(&format_args!("`{name}` stays: {error}"));
            }
            let changed = json!({ "type": "settings", "settings": [{ "name": name, "value": value }] });
            tell_others(stage, page, &changed);
        }
        Said::Apply { request, text } => {
            let source = stage.source.clone();
            return Next::Load {
                request,
                source,
                text,
                applies: true,
            };
        }
        Said::Parameter { request, name, value } => {
            return Next::Load {
                request,
                source: stage.source.with(name, value),
                text: stage.loaded.text.clone(),
                applies: true,
            };
        }
        Said::Record { on } => stage.record(on),
        Said::Replay { request, recording } => {
            let begun = stage.do_again(recording);
            return Next::Say(reply(request, begun));
        }
        Said::Save { request, text } => return Next::Save { request, text },
        Said::Learn { request, name, csv } => return Next::Learn { request, name, csv },
        _ => {}
    }
    Next::Nothing
}

/// Puts what was loaded in place of the graph that runs; what is answered.
pub fn put(stage: &mut Stage, request: u64, source: Source, loaded: Result<Loaded, StageError>) -> Value {
    let taken = loaded.and_then(|loaded| stage.take(source, loaded));
    if taken.is_ok() {
        tell_graph(stage);
    }
    reply(request, taken)
}

/// What is answered where a text was only checked, which took so long, where that is known.
pub fn checked(request: u64, wrong: Option<&Diagnostics>, took: Option<Duration>) -> Value {
    let diagnostics = wrong.map_or(Value::Array(Vec::new()), listed);
    let ms = took.map(|took| took.as_secs_f64() * 1e3);
    json!({ "type": "reply", "request": request, "ok": wrong.is_none(), "diagnostics": diagnostics, "ms": ms })
}

/// What is answered where something was done, or not.
pub fn reply(request: u64, result: Result<String, StageError>) -> Value {
    let (error, diagnostics, change) = match result {
        Ok(change) => (None, Value::Array(Vec::new()), Some(change)),
        Err(StageError::Graph(wrong)) => (
            Some("the graph has errors; what ran goes on".to_owned()),
            listed(&wrong),
            None,
        ),
        Err(StageError::Other(why)) => (Some(why), Value::Array(Vec::new()), None),
    };
    json!({
        "type": "reply", "request": request, "ok": error.is_none(), "error": error,
        "diagnostics": diagnostics, "change": change,
    })
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
