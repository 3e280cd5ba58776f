//! The conversation with one page.

use super::{learn, lock, save::save};
use crate::describe;
use crate::pages::{Line, LineError, Reach};
use crate::publish::text;
use crate::run_page::REPORT;
use crate::stage::{Stage, StageError};
use crate::talk::{self, Heard, Next, Work};
use crate::wire::Message;
use axum::extract::ws::{self, WebSocket};
use serde_json::Value;
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::Mutex as Turn;
use tokio::sync::mpsc::error::TrySendError;
use tokio::sync::mpsc::{Receiver, Sender, channel};

/// Wrong messages after which a page is let go of.
const MOST_REFUSED: u32 = 100;
/// Messages that wait for a page which does not read.
const MOST_WAITING: usize = 512;
/// Requests of a page that wait for their turn.
const MOST_REQUESTS: usize = 32;
/// A text that is longer is read elsewhere, bytes.
const LONG_BYTES: usize = 1 << 16;

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

/// What is done by one at a time, whichever page asks for it.
#[derive(Debug, Clone, Default)]
pub struct Turns {
    /// To put another graph in place, or to write the file.
    edit: Arc<Turn<()>>,
    learn: Arc<Turn<()>>,
}

/// A page's end of the conversation, as its work needs it.
#[derive(Clone)]
struct Desk {
    stage: Arc<Mutex<Stage>>,
    page: u64,
    turns: Turns,
    replies: Sender<Value>,
}

/// Talks to a page until one of both is gone. What takes long is done elsewhere, so that a STOP is heard meanwhile.
pub async fn run(mut socket: WebSocket, reach: Reach, stage: Arc<Mutex<Stage>>, turns: Turns) {
    let (line, mut out) = channel(MOST_WAITING);
    let (page, first) = talk::greet(&mut lock(&stage), Box::new(line), reach);
    let (replies, mut answers) = channel(MOST_REQUESTS);
    let (queue, requests) = channel(MOST_REQUESTS);
    let desk = Desk {
        stage,
        page,
        turns,
        replies,
    };
    tokio::spawn(in_order(desk.clone(), requests));
    let mut refused = 0;
    for message in first {
        if socket.send(framed(message)).await.is_err() {
            refused = MOST_REFUSED;
        }
    }
    while refused < MOST_REFUSED {
        let sent = tokio::select! {
            message = out.recv() => match message {
                Some(message) => socket.send(framed(message)).await,
                None => break,
            },
            Some(answer) = answers.recv() => socket.send(framed(text(&answer))).await,
            message = socket.recv() => match message {
                Some(Ok(message)) => match hear(&desk, &queue, message).await {
                    Some(answer) => {
                        refused += u32::from(answer["type"] == "refused");
                        socket.send(framed(text(&answer))).await
                    }
                    None => Ok(()),
                },
                _ => break,
            },
        };
        if sent.is_err() {
            break;
        }
    }
    lock(&desk.stage).leave(page);
}

/// Does what a message asks for, or has it done; what is answered at once.
async fn hear(desk: &Desk, queue: &Sender<(u64, Work)>, message: ws::Message) -> Option<Value> {
    let message = unframed(message)?;
    let heard = match &message {
        Message::Text(text) if text.len() > LONG_BYTES => blocking(move || talk::read(&message))
            .await
            .unwrap_or(Ok(Heard::Said(None))),
        _ => talk::read(&message),
    };
    let next = talk::act_on(&mut lock(&desk.stage), desk.page, heard);
    match next {
        Next::Nothing => None,
        Next::Say(answer) => Some(answer),
        Next::Do { request, work } => queue.try_send((request, work)).err().map(|_| {
            let why = format!("{MOST_REQUESTS} requests of this page wait already; send fewer at a time");
            talk::reply(request, Err(StageError::Other(why)))
        }),
        Next::Learn { request, name, csv } => {
            let Ok(turn) = Arc::clone(&desk.turns.learn).try_lock_owned() else {
                let why = "another recording is being learned; drop this one when that is done";
                return Some(talk::reply(request, Err(StageError::Other(why.to_owned()))));
            };
            let desk = desk.clone();
            tokio::spawn(async move {
                let stage = Arc::clone(&desk.stage);
                let learned = blocking(move || learned(&stage, &name, &csv)).await;
                drop(turn);
                let answer = match learned.unwrap_or_else(failed) {
                    Ok((path, report)) => {
                        let mut answer = talk::reply(request, Ok(path));
                        answer["report"] = report.into();
                        answer
                    }
                    Err(error) => talk::reply(request, Err(error)),
                };
                // A page that is gone hears nothing.
                let _ = desk.replies.send(answer).await;
            });
            None
        }
    }
}

/// Does what a page asks for, in the order in which it asked.
async fn in_order(desk: Desk, mut requests: Receiver<(u64, Work)>) {
    while let Some((request, work)) = requests.recv().await {
        let answer = match work {
            Work::Check(_) => check(&desk, request, work).await,
            Work::Apply(_) | Work::Parameter(..) | Work::Save(_) => {
                let turn = desk.turns.edit.lock().await;
                let (stage, page) = (Arc::clone(&desk.stage), desk.page);
                let done = blocking(move || edit(&stage, page, work)).await;
                drop(turn);
                talk::reply(request, done.unwrap_or_else(failed))
            }
        };
        if desk.replies.send(answer).await.is_err() {
            break;
        }
    }
}

async fn check(desk: &Desk, request: u64, work: Work) -> Value {
    let begun = Instant::now();
    let (source, text) = work.graph(&lock(&desk.stage));
    match blocking(move || source.load(&text).err()).await {
        Some(wrong) => talk::checked(request, wrong.as_ref(), Some(begun.elapsed())),
        None => talk::reply(request, failed()),
    }
}

/// Does what takes long elsewhere; none where that panicked.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    tokio::task::spawn_blocking(work).await.ok()
}

fn failed<T>() -> Result<T, StageError> {
    let why = "it failed: this is a fault of haptograph; the terminal says more";
    Err(StageError::Other(why.to_owned()))
}

/// Puts a graph in place, or writes the file.
fn edit(stage: &Mutex<Stage>, page: u64, work: Work) -> Result<String, StageError> {
    let saves = matches!(work, Work::Save(_));
    let (confirmed, (source, text)) = {
        let stage = lock(stage);
        talk::is_owner(&stage, page)?;
        (stage.confirmed.clone(), work.graph(&stage))
    };
    // A text that has errors shows no limits, so it is not saved either.
    let loaded = source.load(&text)?;
    if let Some(confirmed) = confirmed {
        match saves {
            true => confirmed.permits_save(&source, &text)?,
            false => confirmed.permits_run(&source, &text)?,
        }
    }
    talk::is_owner(&lock(stage), page)?;
    if saves {
        return save(stage, &text);
    }
    let mut stage = lock(stage);
    talk::put(&mut stage, source, loaded)
}

/// A recording becomes a surface in the graph's folder: its path as a parameter wants it, and the folder of its report.
fn learned(stage: &Mutex<Stage>, name: &str, csv: &str) -> Result<(String, Option<String>), StageError> {
    let graph = lock(stage).source.folder().to_owned();
    let learned = learn::surface(name, csv.as_bytes(), &describe::surface_folder(&graph));
    let learn::Learned { path, report } = learned.map_err(StageError::Other)?;
    // Drawn before the stage is held.
    let _ = describe::surface(&path, &graph);
    let name = format!(
        "{}-learned",
        path.file_stem().unwrap_or_default().to_string_lossy()
    );
    let folder = lock(stage).new_folder(&name);
    // The surface is there; without its report it is worth as much.
    let folder = folder.ok().flatten().filter(|folder| {
        haptograph_surfaces::files::write_atomically(&folder.join(REPORT), report.as_bytes()).is_ok()
    });
    let folder = folder.and_then(|folder| Some(folder.file_name()?.to_string_lossy().into_owned()));
    talk::tell_graph(&mut lock(stage));
    Ok((describe::from_graph(&path, &graph), folder))
}
