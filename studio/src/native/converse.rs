//! Connection to one page.

use super::learn::{Learner, Learning, Turn};
use super::save::{copy, save};
use super::server::Shared;
use super::visits::Pass;
use super::{blocking, lock, with_stage};
use crate::describe;
use crate::error::{StageError, other};
use crate::learn::{Compared, Dropped};
use crate::listen;
use crate::pages::{Line, LineError, Page, Reach};
use crate::run_page::REPORT;
use crate::stage::Stage;
use crate::talk::{self, Incoming, Response, Work};
use crate::wire::text;
use crate::wire::{self, MAX_BYTES, MAX_LEARNED_BYTES, Message, WireError};
use axum::extract::ws::{self, WebSocket};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use haptograph_engine::run::ArmSwitch;
use serde_json::Value;
use std::io::Write as _;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::sync::mpsc::error::TrySendError;
use tokio::sync::mpsc::{Receiver, Sender, channel};
use tokio::sync::{Mutex as AsyncMutex, OwnedSemaphorePermit};

/// Number of invalid messages after which a page is disconnected.
const MAX_REFUSED: u32 = 100;
/// Maximum number of queued messages to a page that does not read, and from a page that the stage does not keep up with.
const MAX_QUEUED: usize = 512;
/// Maximum length of the queued messages from a page, beyond the longest that it may send, bytes.
const MAX_QUEUED_BYTES: usize = 8 << 20;
/// Maximum number of queued requests of a page.
const MAX_REQUESTS: usize = 32;
/// Maximum time in which a page takes a message.
const SENDING: Duration = Duration::from_secs(5);
/// Refusal of a second recording.
const BUSY: &str = "another recording is being learned; retry when it is done";
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
pub(super) struct ExclusiveWork {
    /// Swapping the graph or writing the file.
    edit: Arc<AsyncMutex<()>>,
    pub learning: Learning,
}

/// A connection as seen by its tasks.
#[derive(Clone)]
struct Connection {
    stage: Arc<Mutex<Stage>>,
    page: u64,
    exclusive: ExclusiveWork,
    learner: Option<Learner>,
    /// Answers to messages, and replies to requests.
    answers: Sender<Value>,
}

/// A message that was read from the socket.
enum Received {
    Parsed(Result<Incoming, WireError>),
    /// A text that takes a while to parse.
    Long(Message),
}

/// A queued message with its length, bytes, and its turn if it is long.
type Queued = ((usize, Option<OwnedSemaphorePermit>), Received);

/// The sending half of the queue of a page's messages, bounded in number and in length.
struct Inbox {
    queue: Sender<Queued>,
    /// Length of the queued messages, bytes.
    queued: Arc<AtomicUsize>,
    max_bytes: usize,
}

impl Inbox {
    /// Queues a message; false if there is no room.
    fn put(&self, (length, turn): (usize, Option<OwnedSemaphorePermit>), message: Received) -> bool {
        let queued = self.queued.fetch_add(length, Relaxed) + length;
        let is_put = queued <= self.max_bytes && self.queue.try_send(((length, turn), message)).is_ok();
        if !is_put {
            self.queued.fetch_sub(length, Relaxed);
        }
        is_put
    }
}

/// Serves a page until either end closes. The task that reads the socket waits neither for the stage, which another
/// thread may hold, nor for a page that does not read, so that a STOP takes effect at once.
pub(super) async fn run(socket: WebSocket, shared: Shared, pass: Pass) {
    pass.let_in();
    let max_pages = shared.max_pages();
    let Shared { stage, exclusive, reach, learner, .. } = shared;
    let (line, out) = channel(MAX_QUEUED);
    let greeted = with_stage(&stage, move |stage| {
        // Several may have been let in at once.
        (stage.pages.list.len() < max_pages).then(|| {
            let greeted = talk::greet(stage, Box::new(line), reach);
            (greeted, Arc::clone(&stage.devices.switch))
        })
    });
    let Some(((page, first), switch)) = greeted.await.flatten() else {
        return;
    };
    let (answers, answered) = channel(MAX_REQUESTS);
    let (queue, messages) = channel(MAX_QUEUED);
    let queued = Arc::<AtomicUsize>::default();
    let inbox = Inbox { queue, queued: Arc::clone(&queued), max_bytes: longest(reach) + MAX_QUEUED_BYTES };
    let connection = Connection { stage, page, exclusive, learner, answers };
    let (sink, stream) = socket.split();
    tokio::spawn(act_in_order(connection.clone(), messages, queued));
    tokio::select! {
        () = read(stream, (&switch, &pass), inbox) => {}
        () = write(sink, first, out, answered) => {}
    }
    with_stage(&connection.stage, move |stage| stage.leave(page)).await;
    // A turn that begins from here on finds that the page has left.
    connection.exclusive.learning.cancel(page, None);
}

/// Reads messages until the page closes, or sends more than the stage keeps up with.
async fn read(mut stream: SplitStream<WebSocket>, (switch, pass): (&ArmSwitch, &Pass), inbox: Inbox) {
    while let Some(Ok(message)) = stream.next().await {
        let turn = pass.heard();
        if let Some(message) = unframed(message)
            && !inbox.put((message.length(), turn), receive(switch, message))
        {
            break;
        }
    }
}

/// Length of the longest message that a page may send, bytes: pages of the network send no recordings.
pub(super) fn longest(reach: Reach) -> usize {
    match reach {
        Reach::Machine => MAX_LEARNED_BYTES,
        Reach::Network | Reach::Participant => MAX_BYTES,
    }
}

/// Sends messages until the page closes or does not read for [`SENDING`].
async fn write(
    mut sink: SplitSink<WebSocket, ws::Message>,
    first: Vec<Message>,
    mut out: Receiver<Message>,
    mut answered: Receiver<Value>,
) {
    let mut first = first.into_iter();
    loop {
        let message = match first.next() {
            Some(message) => message,
            None => tokio::select! {
                // What a request causes is sent before its answer.
                biased;
                message = out.recv() => match message {
                    Some(message) => message,
                    None => break,
                },
                Some(answer) = answered.recv() => text(&answer),
            },
        };
        let sent = tokio::time::timeout(SENDING, sink.send(framed(message))).await;
        if !matches!(sent, Ok(Ok(()))) {
            break;
        }
    }
}

/// Parses a message unless that takes a while. A STOP disarms here: it does not wait for the stage.
fn receive(switch: &ArmSwitch, message: Message) -> Received {
    match &message {
        Message::Text(text) if text.len() > LONG_BYTES => match wire::check_length(text) {
            Ok(()) => Received::Long(message),
            Err(error) => Received::Parsed(Err(error)),
        },
        _ => {
            let incoming = talk::read(&message);
            if talk::disarms(&incoming) {
                switch.disarm();
            }
            Received::Parsed(incoming)
        }
    }
}

/// Handles the messages of a page in order. Requests that take long are queued once more.
async fn act_in_order(connection: Connection, mut messages: Receiver<Queued>, queued: Arc<AtomicUsize>) {
    let (queue, requests) = channel(MAX_REQUESTS);
    tokio::spawn(work_in_order(connection.clone(), requests));
    let mut refused = 0;
    while let Some(((length, _turn), received)) = messages.recv().await {
        // One that is handled is no longer queued: a page may send the next while a long one is parsed.
        queued.fetch_sub(length, Relaxed);
        let incoming = match received {
            Received::Parsed(incoming) => incoming,
            Received::Long(message) => {
                blocking(move || talk::read(&message)).await.unwrap_or(Ok(Incoming::Json(None)))
            }
        };
        let page = connection.page;
        let acted = with_stage(&connection.stage, move |stage| {
            let response = talk::act_on(stage, page, incoming);
            let Response::Answer(answer) = response else {
                return (response, false);
            };
            // With the stage held: after what the message caused, and before any new sample.
            stage.page_of(page, |page| page.tell(text(&answer)));
            (Response::None, answer["type"] == "refused")
        });
        let Some((response, is_refused)) = acted.await else {
            continue;
        };
        refused += u32::from(is_refused);
        // The next message ends the connection.
        if refused == MAX_REFUSED {
            break;
        }
        if let Some(answer) = answer_to(&connection, &queue, response)
            && connection.answers.send(answer).await.is_err()
        {
            break;
        }
    }
}

/// Queues the work that a message asks for; returns an immediate answer.
fn answer_to(connection: &Connection, queue: &Sender<(u64, Work)>, response: Response) -> Option<Value> {
    match response {
        Response::None => None,
        Response::Answer(answer) => Some(answer),
        Response::Work { request, work } => queue.try_send((request, work)).err().map(|_| {
            let why =
                format!("{MAX_REQUESTS} requests of this page are queued already; wait for their replies");
            talk::reply(request, Err(StageError::Other(why)))
        }),
        Response::Cancel { request } => {
            connection.exclusive.learning.cancel(connection.page, Some(request));
            None
        }
        Response::Learn { request, dropped } => learn(connection, request, dropped),
        Response::Listen { request, compared } => {
            alone(connection, request, move |stage| heard(stage, request, &compared))
        }
        Response::Export { request, kept } => {
            alone(connection, request, move |_| talk::exported(request, &kept))
        }
    }
}

/// Begins work that one page does at a time, and that ends with a reply; returns an immediate answer.
fn alone(
    connection: &Connection,
    request: u64,
    work: impl FnOnce(&Mutex<Stage>) -> Value + Send + 'static,
) -> Option<Value> {
    let Some(turn) = connection.exclusive.learning.begin(connection.page, request) else {
        return Some(talk::reply(request, Err(other(BUSY))));
    };
    let connection = connection.clone();
    tokio::spawn(async move {
        let stage = Arc::clone(&connection.stage);
        let done = blocking(move || {
            let _turn = turn;
            work(&stage)
        });
        let answer = done.await.unwrap_or_else(|| talk::reply(request, failed()));
        let _ = connection.answers.send(answer).await;
    });
    None
}

/// The reply to a page that listens; the recording is in a file while it is read.
fn heard(stage: &Mutex<Stage>, request: u64, compared: &Compared) -> Value {
    let source = lock(stage).source.clone();
    let stored = |error: std::io::Error| other(format_args!("cannot store the recording: {error}"));
    let begin = || {
        listen::check_size(compared)?;
        let mut file = tempfile::Builder::new().suffix(".csv").tempfile().map_err(stored)?;
        file.write_all(compared.dropped.csv.as_bytes()).map_err(stored)?;
        Ok(file)
    };
    match begin() {
        Ok(file) => listen::reply(request, file.path(), compared, &source),
        Err(error) => talk::reply(request, Err(error)),
    }
}

/// Begins to learn a recording, or to read it only; returns an immediate answer.
fn learn(connection: &Connection, request: u64, dropped: Dropped) -> Option<Value> {
    let refused = |why: &str| Some(talk::reply(request, Err(StageError::Other(why.to_owned()))));
    let Some(learner) = connection.learner else {
        return refused("this studio cannot learn surfaces");
    };
    let Some(turn) = connection.exclusive.learning.begin(connection.page, request) else {
        return refused(BUSY);
    };
    let connection = connection.clone();
    tokio::spawn(async move {
        let (stage, page) = (Arc::clone(&connection.stage), connection.page);
        let work = move || match dropped.reads {
            true => {
                turn.reading(&dropped).map(|read| ("read", read, String::new())).map_err(StageError::Other)
            }
            false => learned(&stage, page, (turn, learner), &dropped)
                .map(|(path, report)| ("report", report.into(), path)),
        };
        let answer = match blocking(work).await.unwrap_or_else(failed) {
            Ok((name, value, change)) => {
                let mut answer = talk::reply(request, Ok(change));
                answer[name] = value;
                answer
            }
            Err(error) => talk::reply(request, Err(error)),
        };
        // A closed page needs no answer.
        let _ = connection.answers.send(answer).await;
    });
    None
}

/// Processes the requests of a page in order.
async fn work_in_order(connection: Connection, mut requests: Receiver<(u64, Work)>) {
    while let Some((request, work)) = requests.recv().await {
        let answer = match work {
            Work::Check(_) => check(&connection, request, work).await,
            Work::Files => {
                let stage = Arc::clone(&connection.stage);
                let collected = blocking(move || {
                    let (source, text) = work.graph(&lock(&stage));
                    talk::files(request, &source, &text)
                });
                collected.await.unwrap_or_else(|| talk::reply(request, failed()))
            }
            Work::Apply(_) | Work::Parameter(..) | Work::Save(_) => {
                let turn = connection.exclusive.edit.lock().await;
                let (stage, page) = (Arc::clone(&connection.stage), connection.page);
                let done = blocking(move || edit(&stage, page, work)).await;
                drop(turn);
                talk::reply(request, done.unwrap_or_else(failed))
            }
        };
        if connection.answers.send(answer).await.is_err() {
            break;
        }
    }
}

async fn check(connection: &Connection, request: u64, work: Work) -> Value {
    let begun = Instant::now();
    let stage = Arc::clone(&connection.stage);
    let checked = blocking(move || {
        let (source, text) = work.graph(&lock(&stage));
        source.load(&text).err()
    });
    match checked.await {
        Some(wrong) => talk::checked(request, wrong.as_ref(), Some(begun.elapsed())),
        None => talk::reply(request, failed()),
    }
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
        (stage.permitted.confirmed.clone(), work.graph(&stage))
    };
    // The limits of a text with errors are unknown, so it is not saved either.
    let loaded = source.load(&text)?;
    let permitted = confirmed.map_or(Ok(()), |confirmed| match saves {
        true => confirmed.permits_save(&source, &text),
        false => confirmed.permits_run(&source, &text),
    });
    talk::is_owner(&lock(stage), page)?;
    if let Err(StageError::Beyond(beyond)) = &permitted {
        let mut stage = lock(stage);
        // Whoever listens to the network could ask for it.
        let is_far = |known: &Page| known.id == page && known.reach == Reach::Network;
        if stage.pages.list.iter().any(is_far) {
            let why = format!("a page on the network cannot change limits or devices: {}", beyond.join("; "));
            return Err(StageError::Other(why));
        }
        stage.propose(source.clone(), text.clone(), beyond.clone());
    }
    permitted?;
    if saves {
        return save(stage, &text, &loaded.graph);
    }
    let mut stage = lock(stage);
    talk::put(&mut stage, source, loaded)
}

/// Learns a surface from a recording into the graph's folder; returns its path as a parameter, and the folder
/// of its report.
fn learned(
    stage: &Mutex<Stage>,
    page: u64,
    (turn, learner): (Turn, Learner),
    dropped: &Dropped,
) -> Result<(String, Option<String>), StageError> {
    let (graph, copies) = {
        let stage = lock(stage);
        if !stage.pages.list.iter().any(|known| known.id == page) {
            return failed();
        }
        (stage.source.folder().to_owned(), stage.source.copies.clone())
    };
    let learned = turn.surface(learner, dropped, &describe::surface_folder(&graph));
    drop(turn);
    let (path, report) = learned.map_err(StageError::Other)?;
    // What lies with the program's own graphs ends with it.
    let kept = copies.map_or(Ok(()), |copies| copy(&copies, &path));
    kept.map_err(|error| StageError::Other(format!("cannot keep {}: {error}", path.display())))?;
    // Draws the swatch before the stage is locked.
    let _ = describe::surface(&path, &graph);
    let name = format!("{}-learned", path.file_stem().unwrap_or_default().to_string_lossy());
    let folder = lock(stage).new_folder(&name);
    // A failed report does not invalidate the surface.
    let folder = folder
        .ok()
        .flatten()
        .filter(|folder| haptograph_signal::files::write_atomically(&folder.join(REPORT), &report).is_ok());
    let folder = folder.and_then(|folder| Some(folder.file_name()?.to_string_lossy().into_owned()));
    talk::tell_graph(&mut lock(stage));
    Ok((describe::from_graph(&path, &graph), folder))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::native::{Options, Studio};
    use std::path::Path;
    use tungstenite::client::IntoClientRequest;
    use tungstenite::connect;

    fn request(studio: &Studio) -> tungstenite::handshake::client::Request {
        let address = studio.address();
        let url = format!("ws://{address}/live?token={}", studio.token());
        let mut request = url.into_client_request().expect("a request");
        let origin = format!("http://{address}").parse().expect("a header");
        request.headers_mut().insert("origin", origin);
        request
    }

    #[test]
    fn a_stop_disarms_while_another_thread_holds_the_stage() {
        let options = Options {
            graph: Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/texturepad.ron"),
            set: Vec::new(),
            endpoints: None,
            port: 0,
            out: std::env::temp_dir().join("haptograph-no-recordings"),
            surfaces: Vec::new(),
            lan: None,
            learner: None,
        };
        let studio = Studio::open(&options, &haptograph_nodes::registry()).expect("a studio");
        let (mut page, _) = connect(request(&studio)).expect("it is let in");
        page.read().expect("it is greeted");
        let stage = lock(&studio.stage);
        stage.devices.switch.arm(0.1);
        // What waits for the stage: a message of the page, and another page.
        let text = |text: &str| tungstenite::Message::text(text.to_owned());
        page.send(text(r#"{"type":"set","name":"out.gain","value":0.5}"#)).expect("sent");
        let another = request(&studio);
        let another = std::thread::spawn(move || connect(another).is_ok());
        std::thread::sleep(Duration::from_millis(50));
        page.send(text(r#"{"type":"stop"}"#)).expect("sent");
        let sent = Instant::now();
        while stage.devices.switch.is_armed() && sent.elapsed() < Duration::from_secs(60) {
            std::thread::yield_now();
        }
        assert!(!stage.devices.switch.is_armed());
        drop(stage);
        assert!(another.join().expect("no panic"));
    }

    #[test]
    fn what_a_page_has_queued_is_bounded_in_bytes() {
        let (queue, mut messages) = channel(MAX_QUEUED);
        let queued = Arc::<AtomicUsize>::default();
        let inbox = Inbox {
            queue,
            queued: Arc::clone(&queued),
            max_bytes: longest(Reach::Network) + MAX_QUEUED_BYTES,
        };
        let switch = ArmSwitch::default();
        let text = |length: usize| Message::Text(format!(r#"{{"type":"{}"}}"#, "x".repeat(length)));
        let put = |message: Message| inbox.put((message.length(), None), receive(&switch, message));
        let taken = (0..100).take_while(|_| put(text(MAX_BYTES - 100))).count();
        assert_eq!(taken, 9, "of 1 MiB each");
        // A text that is too long is refused before it is queued, and what is handled makes room.
        assert!(matches!(receive(&switch, text(MAX_BYTES)), Received::Parsed(Err(WireError::Long(_)))));
        let ((length, _), _) = messages.try_recv().expect("it is queued");
        queued.fetch_sub(length, Relaxed);
        assert!(put(text(MAX_BYTES - 100)) && !put(text(MAX_BYTES - 100)));
    }
}
