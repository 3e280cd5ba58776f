//! The conversation with one page.

use super::{learn, lock, save::save};
use crate::describe;
use crate::pages::{Line, LineError};
use crate::stage::{Stage, StageError};
use crate::talk::{self, Next};
use crate::wire::Message;
use axum::extract::ws::{self, WebSocket};
use serde_json::Value;
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::mpsc::error::TrySendError;
use tokio::sync::mpsc::{Sender, channel};

/// Wrong messages after which a page is let go of.
const MOST_REFUSED: u32 = 100;
/// Messages that wait for a page which does not read.
const MOST_WAITING: usize = 512;

impl Line for Sender<Message> {
    fn send(&mut self, message: Message) -> Result<(), LineError> {
        self.try_send(message).map_err(|error| match error {
            TrySendError::Full(_) => LineError::Full,
            TrySendError::Closed(_) => LineError::Gone,
        })
    }
}

fn framed(message: Message) -> ws::Message {
    match message {
        Message::Text(text) => ws::Message::Text(text.into()),
        Message::Binary(bytes) => ws::Message::Binary(bytes.into()),
    }
}

fn unframed(message: ws::Message) -> Option<Message> {
    match message {
        ws::Message::Text(text) => Some(Message::Text(text.as_str().to_owned())),
        ws::Message::Binary(bytes) => Some(Message::Binary(bytes.into())),
        _ => None,
    }
}

/// Talks to a page until one of both is gone.
pub async fn run(mut socket: WebSocket, stage: Arc<Mutex<Stage>>) {
    let (line, mut out) = channel(MOST_WAITING);
    let (page, first) = talk::greet(&mut lock(&stage), Box::new(line));
    let mut refused = 0;
    for message in first {
        if socket.send(framed(message)).await.is_err() {
            refused = MOST_REFUSED;
        }
    }
    while refused < MOST_REFUSED {
        let answer = tokio::select! {
            message = out.recv() => match message {
                Some(message) => socket.send(framed(message)).await.map_err(|_| ()),
                None => break,
            },
            message = socket.recv() => match message {
                Some(Ok(message)) => {
                    let answer = answer(&stage, page, message).await;
                    refused += u32::from(answer.as_ref().is_some_and(|answer| answer["type"] == "refused"));
                    match answer {
                        Some(answer) => socket.send(ws::Message::Text(answer.to_string().into())).await.map_err(|_| ()),
                        None => Ok(()),
                    }
                }
                _ => break,
            },
        };
        if answer.is_err() {
            break;
        }
    }
    lock(&stage).leave(page);
}

/// Does what a message asks for; what is answered.
async fn answer(stage: &Arc<Mutex<Stage>>, page: u64, message: ws::Message) -> Option<Value> {
    let message = unframed(message)?;
    let next = talk::hear(&mut lock(stage), page, &message);
    match next {
        Next::Nothing => None,
        Next::Say(answer) => Some(answer),
        Next::Load {
            request,
            source,
            text,
            applies,
        } => {
            let begun = Instant::now();
            let loading = source.clone();
            let loaded = blocking(move || loading.load(&text)).await;
            let Some(loaded) = loaded else {
                let why = "loading failed: this is a fault of haptograph".to_owned();
                return Some(talk::reply(request, Err(StageError::Other(why))));
            };
            Some(match applies {
                true => talk::put(
                    &mut lock(stage),
                    request,
                    source,
                    loaded.map_err(StageError::Graph),
                ),
                false => talk::checked(request, loaded.err().as_ref(), Some(begun.elapsed())),
            })
        }
        Next::Save { request, text } => {
            let mut stage = lock(stage);
            let saved = save(&mut stage, &text);
            talk::tell_graph(&mut stage);
            Some(talk::reply(request, saved))
        }
        Next::Learn { request, name, csv } => Some(talk::reply(request, learned(stage, name, csv).await)),
    }
}

/// Does what takes long elsewhere; none where that panicked.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    tokio::task::spawn_blocking(work).await.ok()
}

/// A recording becomes a surface in the graph's folder; says its path as a parameter wants it.
async fn learned(shared: &Arc<Mutex<Stage>>, name: String, csv: String) -> Result<String, StageError> {
    let folder = describe::surface_folder(lock(shared).source.folder());
    let made = blocking(move || learn::surface(&name, csv.as_bytes(), &folder)).await;
    let made = made.unwrap_or_else(|| Err("learning failed: this is a fault of haptograph".to_owned()));
    let path = made.map_err(StageError::Other)?;
    let mut stage = lock(shared);
    let from_graph = path.strip_prefix(stage.source.folder()).unwrap_or(&path);
    let path = format!("{:?}", from_graph.to_string_lossy());
    talk::tell_graph(&mut stage);
    Ok(path)
}
