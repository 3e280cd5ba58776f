//! Connection to one page.

use super::{learn, lock, save::save};
use crate::describe;
use crate::pages::{Line, LineError, Reach};
use crate::publish::text;
use crate::run_page::REPORT;
use crate::stage::{Stage, StageError};
use crate::talk::{self, Incoming, Response, Work};
use crate::wire::Message;
use axum::extract::ws::{self, WebSocket};
use haptograph_engine::run::ArmSwitch;
use serde_json::Value;
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::Mutex as Turn;
use tokio::sync::mpsc::error::TrySendError;
use tokio::sync::mpsc::{Receiver, Sender, channel};

/// Number of invalid messages after which a page is disconnected.
const MOST_REFUSED: u32 = 100;
/// Maximum number of queued messages for a page that does not read.
const MOST_WAITING: usize = 512;
/// Maximum number of queued requests of a page.
const MOST_REQUESTS: usize = 32;
/// Longer texts are parsed on another thread, bytes.
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

/// Work that only one page can do at a time.
#[derive(Debug, Clone, Default)]
pub struct ExclusiveWork {
    /// Swapping the graph or writing the file.
    edit: Arc<Turn<()>>,
    learn: Arc<Turn<()>>,
}

/// A connection as seen by its work.
#[derive(Clone)]
struct Connection {
    stage: Arc<Mutex<Stage>>,
    switch: Arc<ArmSwitch>,
    page: u64,
    turns: ExclusiveWork,
    replies: Sender<Value>,
}

/// Serves a page until either end closes. Long work runs on other threads, so that a STOP is handled
/// meanwhile.
pub async fn run(mut socket: WebSocket, reach: Reach, stage: Arc<Mutex<Stage>>, turns: ExclusiveWork) {
    let (line, mut out) = channel(MOST_WAITING);
    let (page, first) = talk::greet(&mut lock(&stage), Box::new(line), reach);
    let (replies, mut answers) = channel(MOST_REQUESTS);
    let (queue, requests) = channel(MOST_REQUESTS);
    let switch = Arc::clone(&lock(&stage).switch);
    let connection = Connection {
        stage,
        switch,
        page,
        turns,
        replies,
    };
    tokio::spawn(in_order(connection.clone(), requests));
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
                Some(Ok(message)) => match hear(&connection, &queue, message).await {
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
    lock(&connection.stage).leave(page);
}

/// Handles a message, or queues it; returns an immediate answer.
async fn hear(connection: &Connection, queue: &Sender<(u64, Work)>, message: ws::Message) -> Option<Value> {
    let message = unframed(message)?;
    let incoming = match &message {
        Message::Text(text) if text.len() > LONG_BYTES => blocking(move || talk::read(&message))
            .await
            .unwrap_or(Ok(Incoming::Json(None))),
        _ => talk::read(&message),
    };
    // A STOP does not wait for whoever holds the stage.
    if talk::disarms(&incoming) {
        connection.switch.disarm();
    }
    let next = talk::act_on(&mut lock(&connection.stage), connection.page, incoming);
    match next {
        Response::None => None,
        Response::Answer(answer) => Some(answer),
        Response::Work { request, work } => queue.try_send((request, work)).err().map(|_| {
            let why =
                format!("{MOST_REQUESTS} requests of this page are queued already; wait for their replies");
            talk::reply(request, Err(StageError::Other(why)))
        }),
        Response::Learn { request, name, csv } => {
            let Ok(turn) = Arc::clone(&connection.turns.learn).try_lock_owned() else {
                let why = "another recording is being learned; retry when it is done";
                return Some(talk::reply(request, Err(StageError::Other(why.to_owned()))));
            };
            let connection = connection.clone();
            tokio::spawn(async move {
                let stage = Arc::clone(&connection.stage);
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
                // A closed page needs no answer.
                let _ = connection.replies.send(answer).await;
            });
            None
        }
    }
}

/// Processes the requests of a page in order.
async fn in_order(connection: Connection, mut requests: Receiver<(u64, Work)>) {
    while let Some((request, work)) = requests.recv().await {
        let answer = match work {
            Work::Check(_) => check(&connection, request, work).await,
            Work::Apply(_) | Work::Parameter(..) | Work::Save(_) => {
                let turn = connection.turns.edit.lock().await;
                let (stage, page) = (Arc::clone(&connection.stage), connection.page);
                let done = blocking(move || edit(&stage, page, work)).await;
                drop(turn);
                talk::reply(request, done.unwrap_or_else(failed))
            }
        };
        if connection.replies.send(answer).await.is_err() {
            break;
        }
    }
}

async fn check(connection: &Connection, request: u64, work: Work) -> Value {
    let begun = Instant::now();
    let (source, text) = work.graph(&lock(&connection.stage));
    match blocking(move || source.load(&text).err()).await {
        Some(wrong) => talk::checked(request, wrong.as_ref(), Some(begun.elapsed())),
        None => talk::reply(request, failed()),
    }
}

/// Runs `work` on a blocking thread; `None` if it panicked.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    tokio::task::spawn_blocking(work).await.ok()
}

fn failed<T>() -> Result<T, StageError> {
    let why = "internal error: this is a bug in haptograph; see the messages in the terminal";
    Err(StageError::Other(why.to_owned()))
}

/// Swaps the graph, or writes the file.
fn edit(stage: &Mutex<Stage>, page: u64, work: Work) -> Result<String, StageError> {
    let saves = matches!(work, Work::Save(_));
    let (confirmed, (source, text)) = {
        let stage = lock(stage);
        talk::is_owner(&stage, page)?;
        (stage.confirmed.clone(), work.graph(&stage))
    };
    // The limits of a text with errors are unknown, so it is not saved either.
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

/// Learns a surface from a recording into the graph's folder; returns its path as a parameter, and the folder
/// of its report.
fn learned(stage: &Mutex<Stage>, name: &str, csv: &str) -> Result<(String, Option<String>), StageError> {
    let graph = lock(stage).source.folder().to_owned();
    let learned = learn::surface(name, csv.as_bytes(), &describe::surface_folder(&graph));
    let learn::Learned { path, report } = learned.map_err(StageError::Other)?;
    // Draws the swatch before the stage is locked.
    let _ = describe::surface(&path, &graph);
    let name = format!(
        "{}-learned",
        path.file_stem().unwrap_or_default().to_string_lossy()
    );
    let folder = lock(stage).new_folder(&name);
    // A failed report does not invalidate the surface.
    let folder = folder.ok().flatten().filter(|folder| {
        haptograph_surfaces::files::write_atomically(&folder.join(REPORT), report.as_bytes()).is_ok()
    });
    let folder = folder.and_then(|folder| Some(folder.file_name()?.to_string_lossy().into_owned()));
    talk::tell_graph(&mut lock(stage));
    Ok((describe::from_graph(&path, &graph), folder))
}
