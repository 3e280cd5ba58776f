//! The server: the page, one WebSocket a page, and recordings that are dropped on it.

use super::describe;
use super::learn;
use super::load::Source;
use super::pump::{self, lock, text};
use super::stage::{MOST_WAITING, Stage, StageError};
use super::wire::{self, MOST_LEARNED_BYTES, SUBPROTOCOL, Said};
use axum::Router;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use haptograph_engine::diagnostic::{Diagnostics, to_json};
use haptograph_engine::registry::Registry;
use include_dir::{Dir, include_dir};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::mpsc::channel;
use tokio::sync::oneshot;

static PAGE: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/page");
/// Wrong messages after which a page is let go of.
const MOST_REFUSED: u32 = 100;
/// Pages at once.
const MOST_PAGES: usize = 16;
/// What the page may load: its own files only.
const POLICY: &str = "default-src 'self'; connect-src 'self' ws:; img-src 'self' data: blob:; \
                      style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// What is served.
#[derive(Debug, Clone)]
pub struct Options {
    /// The graph's file.
    pub graph: PathBuf,
    /// Parameters in place of its defaults.
    pub set: Vec<(String, String)>,
    /// The port of the loopback address; 0 is a free one.
    pub port: u16,
}

/// Why there is no studio.
#[derive(Debug, thiserror::Error)]
pub enum StudioError {
    /// The graph is wrong.
    #[error("the graph has errors")]
    Graph(Diagnostics),
    /// It cannot be played, or nothing can be served.
    #[error("{0}")]
    Other(String),
}

fn other(error: impl std::fmt::Display) -> StudioError {
    StudioError::Other(error.to_string())
}

/// A page that is served, with the graph that runs behind it, until this is dropped.
#[derive(Debug)]
pub struct Studio {
    address: SocketAddr,
    token: String,
    end: Option<oneshot::Sender<()>>,
    thread: Option<std::thread::JoinHandle<()>>,
}

/// What every request sees.
#[derive(Clone)]
struct Shared {
    stage: Arc<Mutex<Stage>>,
    token: Arc<str>,
    port: u16,
}

impl Studio {
    /// Runs a graph and serves its page on the loopback address.
    ///
    /// # Errors
    /// [`StudioError`]: the graph is wrong or has several drivers, or the port is taken.
    pub fn open(options: &Options, registry: &Registry) -> Result<Self, StudioError> {
        let source = Source {
            path: options.graph.clone(),
            registry: registry.clone(),
            set: options.set.clone(),
        };
        let stage = Stage::open(source).map_err(|error| match error {
            StageError::Graph(wrong) => StudioError::Graph(wrong),
            StageError::Other(why) => StudioError::Other(why),
        })?;
        let token = token().map_err(other)?;
        let listener = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, options.port));
        let listener = listener.map_err(|error| {
            other(format!(
                "cannot listen at 127.0.0.1:{}: {error}; give another --port",
                options.port
            ))
        })?;
        listener.set_nonblocking(true).map_err(other)?;
        let address = listener.local_addr().map_err(other)?;
        let stage = Arc::new(Mutex::new(stage));
        let watched = Arc::downgrade(&stage);
        std::thread::Builder::new()
            .name("studio pump".to_owned())
            .spawn(move || pump::run(&watched))
            .map_err(other)?;
        let shared = Shared {
            stage,
            token: token.as_str().into(),
            port: address.port(),
        };
        let (end, ended) = oneshot::channel();
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(other)?;
        let thread = std::thread::Builder::new()
            .name("studio server".to_owned())
            .spawn(move || {
                runtime.block_on(async move {
                    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else {
                        return;
                    };
                    let served = axum::serve(listener, router(shared));
                    tokio::select! {
                        _ = served => {}
                        _ = ended => {}
                    }
                });
                // Connections that are open hold up no end.
                runtime.shutdown_background();
            });
        let thread = Some(thread.map_err(other)?);
        Ok(Self {
            address,
            token,
            end: Some(end),
            thread,
        })
    }

    /// The address to open in a browser. Its token lets nobody else in.
    pub fn url(&self) -> String {
        format!("http://{}/?token={}", self.address, self.token)
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What has to be given to get in.
    pub fn token(&self) -> &str {
        &self.token
    }
}

impl Drop for Studio {
    fn drop(&mut self) {
        if let Some(end) = self.end.take() {
            let _ = end.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// 128 bits that nobody can guess, in hexadecimal digits.
fn token() -> Result<String, getrandom::Error> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    }))
}

fn router(shared: Shared) -> Router {
    Router::new()
        .route("/", get(index))
        .route("/live", get(live))
        .route("/{*path}", get(asset))
        .layer(middleware::from_fn_with_state(shared.clone(), guard))
        .with_state(shared)
}

/// Does a request come from a page of this server, under its own name? One from elsewhere must not move anything.
fn is_own(headers: &HeaderMap, port: u16) -> bool {
    let own = ["127.0.0.1", "localhost"].map(|host| format!("{host}:{port}"));
    let said = |name| {
        headers
            .get(name)
            .map(|value: &HeaderValue| value.to_str().unwrap_or("?"))
    };
    said(header::HOST).is_some_and(|host| own.iter().any(|own| own == host))
        && said(header::ORIGIN).is_none_or(|origin| own.iter().any(|own| origin == format!("http://{own}")))
}

async fn guard(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let mut response = match is_own(request.headers(), shared.port) {
        true => next.run(request).await,
        false => (StatusCode::FORBIDDEN, "this studio serves its own page only").into_response(),
    };
    let headers = response.headers_mut();
    for (name, value) in [
        ("content-security-policy", POLICY),
        ("x-content-type-options", "nosniff"),
        ("referrer-policy", "no-referrer"),
        ("cache-control", "no-store"),
        ("cross-origin-resource-policy", "same-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn is_let_in(shared: &Shared, query: &HashMap<String, String>) -> bool {
    let given = query.get("token").map(String::as_bytes).unwrap_or_default();
    let token = shared.token.as_bytes();
    // As long whatever is given.
    let differs = token.iter().enumerate().fold(0, |differs, (at, byte)| {
        differs | (byte ^ given.get(at).unwrap_or(&0))
    });
    differs == 0 && given.len() == token.len()
}

const LOCKED: &str = "<!doctype html><title>haptograph studio</title><p>This address lacks its token. Open the whole \
                      address that <code>haptograph studio</code> printed.";

async fn index(State(shared): State<Shared>, Query(query): Query<HashMap<String, String>>) -> Response {
    match is_let_in(&shared, &query) {
        true => asset(Path("index.html".to_owned())).await,
        false => (StatusCode::FORBIDDEN, Html(LOCKED)).into_response(),
    }
}

async fn asset(Path(path): Path<String>) -> Response {
    let kind = match path.rsplit_once('.').map(|(_, ending)| ending) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        _ => "text/plain; charset=utf-8",
    };
    match PAGE.get_file(&path) {
        Some(file) => ([(header::CONTENT_TYPE, kind)], file.contents()).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn live(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    // A browser always says where it comes from.
    let has_origin = headers.contains_key(header::ORIGIN);
    if !is_let_in(&shared, &query) || !has_origin {
        return StatusCode::FORBIDDEN.into_response();
    }
    if lock(&shared.stage).pages.len() >= MOST_PAGES {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many pages").into_response();
    }
    let upgrade = upgrade
        .protocols([SUBPROTOCOL])
        .max_message_size(MOST_LEARNED_BYTES)
        .max_frame_size(MOST_LEARNED_BYTES);
    upgrade.on_upgrade(move |socket| converse(socket, shared.stage))
}

/// Talks to a page until one of both is gone.
async fn converse(mut socket: WebSocket, stage: Arc<Mutex<Stage>>) {
    let (to_page, mut out) = channel(MOST_WAITING);
    let (page, first) = {
        let mut stage = lock(&stage);
        let hello = describe::hello(&stage.source.registry, true);
        let graph = describe::graph(&stage);
        (stage.join(to_page), [text(&hello), text(&graph)])
    };
    let mut refused = 0;
    for message in first {
        if socket.send(message).await.is_err() {
            refused = MOST_REFUSED;
        }
    }
    while refused < MOST_REFUSED {
        let answer = tokio::select! {
            message = out.recv() => match message {
                Some(message) => socket.send(message).await.map_err(|_| ()),
                None => break,
            },
            message = socket.recv() => match message {
                Some(Ok(message)) => {
                    let answer = heard(&stage, page, message).await;
                    refused += u32::from(answer.as_ref().is_some_and(|answer| answer["type"] == "refused"));
                    match answer {
                        Some(answer) => socket.send(text(&answer)).await.map_err(|_| ()),
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
async fn heard(stage: &Arc<Mutex<Stage>>, page: u64, message: Message) -> Option<Value> {
    let refused =
        |error: &dyn std::fmt::Display| Some(json!({ "type": "refused", "error": error.to_string() }));
    match message {
        Message::Binary(bytes) => match wire::pointers(&bytes) {
            Ok((pad, points)) => {
                lock(stage).point(page, pad, &points);
                None
            }
            Err(error) => refused(&error),
        },
        Message::Text(said) => match wire::said(&said) {
            Ok(Some(said)) => act(stage, page, said).await,
            Ok(None) => None,
            Err(error) => refused(&error),
        },
        _ => None,
    }
}

async fn act(shared: &Arc<Mutex<Stage>>, page: u64, said: Said) -> Option<Value> {
    let owns = lock(shared).owner == Some(page);
    let reply = |request: u64, result: Result<String, StageError>| Some(reply(request, result));
    let not_owner =
        || StageError::Other("another page owns the pads and the graph; take over first".to_owned());
    match said {
        Said::Scope { ports } => lock(shared).scope(page, ports),
        Said::Sound { on } => {
            if let Some(page) = lock(shared).pages.iter_mut().find(|known| known.id == page) {
                page.hears = on;
            }
        }
        // Whoever sees that something goes wrong may stop it.
        Said::Stop => lock(shared).stop(),
        Said::Own => lock(shared).owner = Some(page),
        Said::Check { request, text } => {
            let source = lock(shared).source.clone();
            let begun = Instant::now();
            let found = blocking(move || source.load(&text).err()).await;
            return Some(checked(request, found.flatten(), begun));
        }
        Said::Resume if owns => {
            let mut stage = lock(shared);
            if let Err(error) = stage.start() {
                return Some(json!({ "type": "refused", "error": error.to_string() }));
            }
            tell_graph(&mut stage);
        }
        Said::Set { name, value } if owns => {
            let mut stage = lock(shared);
            if let Err(error) = stage.set(&name, value) {
                return Some(json!({ "type": "refused", "error": format!("`{name}` stays: {error}") }));
            }
            tell_others(
                &mut stage,
                page,
                &json!({ "type": "settings", "settings": [{ "name": name, "value": value }] }),
            );
        }
        Said::Apply { request, text } if owns => {
            let source = lock(shared).source.clone();
            return reply(request, put(shared, source, text).await);
        }
        Said::Parameter { request, name, value } if owns => {
            let (mut source, text) = {
                let stage = lock(shared);
                (stage.source.clone(), stage.loaded.text.clone())
            };
            source.set.retain(|(known, _)| *known != name);
            source.set.push((name, value));
            return reply(request, put(shared, source, text).await);
        }
        Said::Save { request, text } if owns => {
            let mut stage = lock(shared);
            let saved = save(&mut stage, &text);
            tell_graph(&mut stage);
            return reply(request, saved);
        }
        Said::Learn { request, name, csv } if owns => {
            return reply(request, learned(shared, name, csv).await);
        }
        Said::Learn { request, .. }
        | Said::Apply { request, .. }
        | Said::Parameter { request, .. }
        | Said::Save { request, .. } => {
            return reply(request, Err(not_owner()));
        }
        Said::Set { .. } | Said::Resume => {
            return Some(json!({ "type": "refused", "error": not_owner().to_string() }));
        }
    }
    None
}

/// Does what takes long elsewhere; none where that panicked.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    tokio::task::spawn_blocking(work).await.ok()
}

/// Loads a text and puts it in place of the graph that runs.
async fn put(shared: &Arc<Mutex<Stage>>, source: Source, text: String) -> Result<String, StageError> {
    let loading = source.clone();
    let loaded = blocking(move || loading.load(&text)).await;
    let loaded = loaded
        .ok_or_else(|| StageError::Other("loading failed: this is a fault of haptograph".to_owned()))?;
    let mut stage = lock(shared);
    let change = stage.take(source, loaded?)?;
    tell_graph(&mut stage);
    Ok(change)
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
    tell_graph(&mut stage);
    Ok(path)
}

/// Writes a text to the graph's file, unless somebody else did since it was read.
fn save(stage: &mut Stage, text: &str) -> Result<String, StageError> {
    let path = stage.source.path.clone();
    let failed =
        |error: std::io::Error| StageError::Other(format!("cannot write {}: {error}", path.display()));
    if stage.source.read().map_err(failed)? != stage.on_disk {
        let why = format!(
            "{} was changed since it was read; nothing is written",
            path.display()
        );
        return Err(StageError::Other(why));
    }
    let written = || {
        let mut file = tempfile::NamedTempFile::new_in(stage.source.folder())?;
        std::io::Write::write_all(&mut file, text.as_bytes())?;
        file.as_file()
            .set_permissions(std::fs::metadata(&path)?.permissions())?;
        // A link stays one.
        file.persist(path.canonicalize()?).map_err(|error| error.error)
    };
    written().map_err(failed)?;
    text.clone_into(&mut stage.on_disk);
    Ok("saved".to_owned())
}

fn tell_graph(stage: &mut Stage) {
    let message = text(&describe::graph(stage));
    stage.pages.iter_mut().for_each(|page| page.send(message.clone()));
}

fn tell_others(stage: &mut Stage, page: u64, value: &Value) {
    let others = stage.pages.iter_mut().filter(|known| known.id != page);
    others.for_each(|page| page.send(text(value)));
}

fn reply(request: u64, result: Result<String, StageError>) -> Value {
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

fn checked(request: u64, wrong: Option<Diagnostics>, begun: Instant) -> Value {
    let ms = begun.elapsed().as_secs_f64() * 1e3;
    let diagnostics = wrong.as_ref().map_or(Value::Array(Vec::new()), listed);
    json!({ "type": "reply", "request": request, "ok": wrong.is_none(), "diagnostics": diagnostics, "ms": ms })
}

fn listed(wrong: &Diagnostics) -> Value {
    serde_json::from_str(&to_json(wrong)).unwrap_or_default()
}
