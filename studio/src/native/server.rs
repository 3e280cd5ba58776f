//! The web server: the page, and one WebSocket per page.

use super::assets::PAGE;
use super::converse::{self, ExclusiveWork};
use super::gallery::Gallery;
use super::learn::Learner;
use super::visits::{Pass, Reception, Visits};
use super::{blocking, listen, lock, pump, with_stage};
use crate::envelope::Confirmed;
use crate::error::StageError;
use crate::load::{Copies, Source};
use crate::pages::Reach;
use crate::run_page::REPORT;
use crate::stage::{Host, Stage};
use crate::wire::SUBPROTOCOL;
use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{ConnectInfo, Path, Query, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::registry::Registry;
use haptograph_signal::files::{self, Roots};
use haptograph_study::conduct::Conductor;
use std::collections::HashMap;
use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use tokio::sync::oneshot;

/// Maximum number of connected pages.
const MAX_PAGES: usize = 16;
/// Length of the token.
const TOKEN_LETTERS: usize = 32;
/// The host of an engine on this machine.
const HOST: Host =
    Host { name: "native", is_driven_by_caller: false, can_save: true, can_learn: true, can_drive: true };
/// Content security policy of the page: its own files only, besides the WebSocket of its own server.
const POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; \
                      frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// Content security policy of a report: its own script in an opaque origin, without access to the studio.
const REPORT_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; \
                             media-src data:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'; sandbox allow-scripts";

/// The policy of a server with these names. It lists the WebSocket addresses for browsers that do not include
/// them in `'self'`.
fn policy(hosts: &[String]) -> HeaderValue {
    let own: Vec<String> = hosts.iter().map(|host| format!("ws://{host}")).collect();
    let own = own.join(" ");
    let policy = format!("{POLICY}; connect-src 'self' {own}");
    HeaderValue::from_str(&policy).unwrap_or(HeaderValue::from_static(POLICY))
}

/// Options of the server.
#[derive(Debug, Clone)]
pub struct Options {
    /// The graph's file.
    pub graph: PathBuf,
    /// Parameters that override the defaults.
    pub set: Vec<(String, String)>,
    /// The set of endpoints to open; `simulated` if `None`.
    pub endpoints: Option<String>,
    /// The port of the loopback address; 0 selects a free one.
    pub port: u16,
    /// Folder in which recorded runs are created.
    pub out: PathBuf,
    /// Folders of surfaces besides the graph's own, whose files the page can name.
    pub surfaces: Vec<PathBuf>,
    /// Network address for pages of other machines; `None` restricts the studio to this machine.
    pub lan: Option<IpAddr>,
    /// Starts the process that learns a recording that is dropped on the page; `None` if the page cannot learn.
    pub learner: Option<Learner>,
}

/// Error of opening a studio.
#[derive(Debug, thiserror::Error)]
pub enum StudioError {
    /// The graph has errors.
    #[error("the graph has errors")]
    Graph(Diagnostics),
    /// The graph cannot run, or the server cannot start.
    #[error("{0}")]
    Other(String),
}

impl From<StageError> for StudioError {
    fn from(error: StageError) -> Self {
        match error {
            StageError::Graph(wrong) => Self::Graph(wrong),
            error => Self::Other(error.to_string()),
        }
    }
}

fn other(error: impl std::fmt::Display) -> StudioError {
    StudioError::Other(error.to_string())
}

/// A served page with its running graph; dropping it ends both.
pub struct Studio {
    pub(super) stage: Arc<Mutex<Stage>>,
    address: SocketAddr,
    lan: Option<SocketAddr>,
    token: String,
    /// The token of a study's participant.
    participant: Option<String>,
    exclusive: ExclusiveWork,
    visits: Visits,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// State shared by all requests.
#[derive(Clone)]
pub(super) struct Shared {
    pub stage: Arc<Mutex<Stage>>,
    pub exclusive: ExclusiveWork,
    pub learner: Option<Learner>,
    token: Arc<str>,
    participant: Option<Arc<str>>,
    /// The host names of this server.
    hosts: Arc<[String]>,
    pub reach: Reach,
    gallery: Option<Arc<Gallery>>,
}

impl Shared {
    /// Maximum number of pages with which another may come: those of the network leave some for this machine.
    pub(super) fn max_pages(&self) -> usize {
        match self.reach {
            Reach::Machine => MAX_PAGES,
            Reach::Network | Reach::Participant => MAX_PAGES / 2,
        }
    }
}

impl Studio {
    /// Runs a graph and serves its page on the loopback address and optionally on a network address.
    ///
    /// # Errors
    /// [`StudioError`] if the graph has errors, or if the port is taken.
    pub fn open(options: &Options, registry: &Registry) -> Result<Self, StudioError> {
        Self::serve(set_up(options, registry)?, options, None, None)
    }

    /// Serves a gallery of the graphs in the folder of `options.graph`, which is not changed: what is saved and learned goes to the
    /// folder `saved`. The graph that a page of this machine chooses takes the place of the one that runs.
    ///
    /// # Errors
    /// As [`open`](Self::open), for the first graph.
    pub fn open_gallery(options: &Options, registry: &Registry, saved: PathBuf) -> Result<Self, StudioError> {
        let copies = Copies { from: options.graph.clone(), to: saved };
        let (gallery, stage) = Gallery::open(options, registry, copies)?;
        Self::serve(stage, options, None, Some(gallery))
    }

    /// Serves the two pages of a study, whose graph runs in trials only.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn conduct(options: &Options, registry: &Registry, study: Conductor) -> Result<Self, StudioError> {
        let mut stage = set_up(options, registry)?;
        // No page names a file.
        stage.source.roots = None;
        stage.begin_study(study);
        let participant = token().map_err(other)?;
        Self::serve(stage, options, Some(participant), None)
    }

    fn serve(
        stage: Stage,
        options: &Options,
        participant: Option<String>,
        gallery: Option<Gallery>,
    ) -> Result<Self, StudioError> {
        let token = token().map_err(other)?;
        let doors = listen::doors(options.port, options.lan).map_err(other)?;
        let address = doors.here.address;
        let lan = doors.lan.as_ref().map(|door| door.address);
        let stage = Arc::new(Mutex::new(stage));
        let watched = Arc::downgrade(&stage);
        std::thread::Builder::new()
            .name("studio pump".to_owned())
            .spawn(move || pump::run(&watched))
            .map_err(other)?;
        let (exclusive, known): (_, Arc<str>) = (ExclusiveWork::default(), token.as_str().into());
        let (visits, gallery) = (Visits::default(), gallery.map(Arc::new));
        if let Some(gallery) = gallery.clone() {
            // Before a page asks.
            std::thread::spawn(move || _ = gallery.listing());
        }
        let served = doors.all().map(|door| {
            let shared = Shared {
                stage: Arc::clone(&stage),
                exclusive: exclusive.clone(),
                learner: options.learner,
                token: Arc::clone(&known),
                participant: participant.as_deref().map(Arc::from),
                hosts: door.hosts.into(),
                reach: door.reach,
                gallery: gallery.clone(),
            };
            (door.listener, shared)
        });
        let (end, ended) = oneshot::channel();
        let thread = Some(serve(served.collect(), &visits, ended).map_err(other)?);
        Ok(Self { stage, address, lan, token, participant, exclusive, visits, end: Some(end), thread })
    }

    /// The URL to open in a browser. Its token grants access.
    pub fn url(&self) -> String {
        format!("http://{}/?token={}", self.address, self.token)
    }

    /// The URL for other machines, if the studio listens for them; of a study the participant's.
    pub fn lan_url(&self) -> Option<String> {
        let lan = self.lan?;
        Some(format!("http://{lan}/?token={}", self.participant.as_ref().unwrap_or(&self.token)))
    }

    /// The URL of a study's participant on this machine.
    pub fn participant_url(&self) -> Option<String> {
        let token = self.participant.as_ref()?;
        Some(format!("http://{}/?token={token}", self.address))
    }

    /// The listening address for pages of this machine.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The real devices that the graph drives once they are armed.
    pub fn driven(&self) -> Vec<String> {
        let stage = lock(&self.stage);
        let driven = crate::actuators::driven(&stage.loaded.graph).into_iter();
        driven.map(|(name, _)| name.to_owned()).collect()
    }

    /// The latest edit of a page that was refused since it raises or removes a limit, adds an actuator or changes a device:
    /// its number, and each excess in one sentence. The sentences quote the edit, control characters included.
    pub fn proposal(&self) -> Option<(u64, Vec<String>)> {
        let stage = lock(&self.stage);
        let proposal = stage.permitted.proposal.as_ref()?;
        Some((proposal.number, proposal.beyond.clone()))
    }

    /// Confirms the limits and devices of such an edit: the page may then repeat it. Call it only if the person at this
    /// machine has agreed.
    ///
    /// # Errors
    /// [`StudioError`] if the edit was replaced by another one.
    pub fn confirm(&self, number: u64) -> Result<(), StudioError> {
        lock(&self.stage).confirm(number).map_err(StudioError::from)
    }

    /// The system's reason why no page can connect at present, such as too many open files; `None` if pages can.
    pub fn trouble(&self) -> Option<String> {
        let trouble = self.visits.trouble.lock();
        trouble.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The access token.
    pub fn token(&self) -> &str {
        &self.token
    }
}

impl std::fmt::Debug for Studio {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Studio").field("address", &self.address).finish_non_exhaustive()
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
        self.exclusive.learning.cancel_all();
        // Pending loading holds the stage: its run ends now nevertheless, with complete files.
        lock(&self.stage).close();
        // Only then is there time to wait for a process that learns.
        self.exclusive.learning.close();
    }
}

/// Loads and starts a graph with the restrictions of its pages: the limits and devices of its file, and the files that
/// can be named.
pub(super) fn set_up(options: &Options, registry: &Registry) -> Result<Stage, StudioError> {
    let opened = || {
        let mut source = Source::new(options.graph.clone(), registry, options.set.clone());
        if let Some(endpoints) = &options.endpoints {
            source.endpoints.clone_from(endpoints);
        }
        let can_learn = options.learner.is_some();
        let stage = Stage::open(source, Host { can_learn, ..HOST })?;
        let confirmed = Confirmed::of(&stage.source, &stage.loaded.text).map_err(StudioError::Graph)?;
        Ok::<_, StudioError>((stage, confirmed))
    };
    // The files named by the opened graph are permitted.
    let (opened, named) = files::noting_files(opened);
    let (mut stage, confirmed) = opened?;
    let folders = std::iter::once(stage.source.folder()).chain(options.surfaces.iter().map(PathBuf::as_path));
    let roots = Roots::of(folders)
        .map_err(|(folder, error)| other(format!("cannot read the folder {}: {error}", folder.display())))?;
    // The graph's own folder comes first.
    stage.source.surfaces = roots.folders().iter().skip(1).cloned().collect();
    stage.source.roots = Some(Arc::new(roots.and_files(named)));
    stage.permitted.confirmed = Some(Arc::new(confirmed));
    stage.recorder.out = Some(options.out.clone());
    // Draws the swatches, which takes a while, before any page waits for them.
    let _ = crate::describe::graph(&stage);
    Ok(stage)
}

/// Serves all sockets until `ended` receives a message or is closed.
fn serve(
    served: Vec<(TcpListener, Shared)>,
    visits: &Visits,
    ended: oneshot::Receiver<()>,
) -> io::Result<JoinHandle<()>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let inside = runtime.enter();
    let served = served
        .into_iter()
        .map(|(listener, shared)| {
            let listener = tokio::net::TcpListener::from_std(listener)?;
            Ok((Reception::of(listener, visits.clone()), shared))
        })
        .collect::<io::Result<Vec<_>>>()?;
    drop(inside);
    let thread = std::thread::Builder::new().name("studio server".to_owned());
    thread.spawn(move || {
        runtime.block_on(async move {
            for (reception, shared) in served {
                let service = router(shared).into_make_service_with_connect_info::<Pass>();
                tokio::spawn(axum::serve(reception, service).into_future());
            }
            let _ = ended.await;
        });
        // Open connections do not delay the end.
        runtime.shutdown_background();
    })
}

/// 128 random bits in hexadecimal digits.
fn token() -> Result<String, getrandom::Error> {
    let mut bytes = [0_u8; TOKEN_LETTERS / 2];
    getrandom::fill(&mut bytes)?;
    Ok(files::hex(&bytes))
}

fn router(shared: Shared) -> Router {
    Router::new()
        .route("/", get(index))
        .route("/studio.html", get(studio))
        .route("/gallery.json", get(cards))
        .route("/pictures/{name}", get(picture))
        .route("/live", get(live))
        .route("/report/{folder}", get(report))
        .route("/{*path}", get(asset))
        .layer(middleware::from_fn_with_state(shared.clone(), guard))
        .with_state(shared)
}

/// True if a request comes from a page of this server under its own name; foreign pages must not control
/// anything.
fn is_own(headers: &HeaderMap, own: &[String]) -> bool {
    // Of several the server and a proxy may read different ones.
    let said = |name| {
        let mut values = headers.get_all(name).iter();
        let value = values.next().map(|value| value.to_str().unwrap_or("?"));
        if values.next().is_some() { Some("?") } else { value }
    };
    said(header::HOST).is_some_and(|host| own.iter().any(|own| own == host))
        && said(header::ORIGIN).is_none_or(|origin| own.iter().any(|own| origin == format!("http://{own}")))
}

async fn guard(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let mut response = match is_own(request.headers(), &shared.hosts) {
        true => next.run(request).await,
        false => (StatusCode::FORBIDDEN, "this studio serves its own page only").into_response(),
    };
    let headers = response.headers_mut();
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert_with(|| policy(&shared.hosts));
    for (name, value) in [
        ("x-content-type-options", "nosniff"),
        ("referrer-policy", "no-referrer"),
        ("cache-control", "no-store"),
        ("cross-origin-resource-policy", "same-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

/// Who comes with this query, if it has a token.
fn let_in(shared: &Shared, query: &HashMap<String, String>) -> Option<Reach> {
    let given = query.get("token").map(String::as_bytes).unwrap_or_default();
    match &shared.participant {
        Some(participant) if is_same(given, participant.as_bytes()) => Some(Reach::Participant),
        // The experimenter is at this machine.
        Some(_) if shared.reach == Reach::Network => None,
        _ => is_same(given, shared.token.as_bytes()).then_some(shared.reach),
    }
}

fn is_same(given: &[u8], token: &[u8]) -> bool {
    // Takes constant time for any token.
    let differs = token
        .iter()
        .enumerate()
        .fold(0, |differs, (at, byte)| differs | (byte ^ given.get(at).unwrap_or(&0)));
    differs == 0 && given.len() == token.len()
}

const LOCKED: &str = "<!doctype html><title>haptograph studio</title><p>This address lacks its token. Open the whole \
                      address that <code>haptograph studio</code> printed.";
const RESTARTED: &str = "<!doctype html><title>haptograph studio</title><p>This is the address of a studio that was \
                         closed. Another one runs here now: open the address that <code>haptograph studio</code> printed last.";

/// The answer to a request without the token of this studio.
fn locked(query: &HashMap<String, String>) -> Response {
    let why = match query.get("token").is_some_and(|token| token.len() == TOKEN_LETTERS) {
        true => RESTARTED,
        false => LOCKED,
    };
    (StatusCode::FORBIDDEN, Html(why)).into_response()
}

async fn index(State(shared): State<Shared>, Query(query): Query<HashMap<String, String>>) -> Response {
    let page = match let_in(&shared, &query) {
        None => return locked(&query),
        Some(Reach::Participant) => "participant.html",
        Some(_) if shared.participant.is_some() => "experimenter.html",
        Some(Reach::Machine) if shared.gallery.is_some() && !query.contains_key("graph") => "gallery.html",
        Some(_) => return studio(State(shared), Query(query)).await,
    };
    asset(Path(page.to_owned())).await
}

/// The page of the studio, whose graph a page of this machine may choose from the gallery.
async fn studio(State(shared): State<Shared>, Query(query): Query<HashMap<String, String>>) -> Response {
    let reach = let_in(&shared, &query);
    if reach.is_none() || shared.participant.is_some() {
        return locked(&query);
    }
    let chosen = query.get("graph").cloned().filter(|_| reach == Some(Reach::Machine));
    if let Some((gallery, name)) = shared.gallery.zip(chosen) {
        let stage = shared.stage;
        let chosen = blocking(move || gallery.choose(&stage, &name).map_err(|error| error.to_string())).await;
        if let Some(Err(why)) = chosen {
            return (StatusCode::CONFLICT, why).into_response();
        }
    }
    asset(Path("index.html".to_owned())).await
}

/// The cards of the gallery; none if the studio has none.
async fn cards(State(shared): State<Shared>) -> Response {
    let cards = blocking(move || shared.gallery.map(|gallery| gallery.listing().to_string())).await.flatten();
    let none = || r#"{ "cards": [] }"#.to_owned();
    ([(header::CONTENT_TYPE, "application/json")], cards.unwrap_or_else(none)).into_response()
}

/// The picture of a graph of the gallery.
async fn picture(State(shared): State<Shared>, Path(name): Path<String>) -> Response {
    let drawn = blocking(move || shared.gallery?.picture(name.strip_suffix(".svg")?)).await.flatten();
    match drawn {
        Some(picture) => ([(header::CONTENT_TYPE, "image/svg+xml")], picture).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

/// The page in a folder that this studio has made: of a run, or of a learned surface.
async fn report(
    State(shared): State<Shared>,
    Path(folder): Path<String>,
    Query(query): Query<HashMap<String, String>>,
) -> Response {
    if let_in(&shared, &query).is_none_or(|reach| reach == Reach::Participant) {
        return locked(&query);
    }
    let made = with_stage(&shared.stage, move |stage| {
        let made = stage.recorder.made.iter();
        { made }.find(|made| made.file_name().is_some_and(|name| *name == *folder)).cloned()
    });
    let made = made.await.flatten();
    let page = blocking(move || {
        let folder = made?;
        let path = folder.join(REPORT);
        // What lies elsewhere is not of this studio.
        let is_link = [&folder, &path].into_iter().any(|path| path.is_symlink());
        files::read(&path, files::MAX_REPORT_BYTES).ok().filter(|_| !is_link)
    });
    match page.await.flatten() {
        Some(page) => {
            let kind = (header::CONTENT_TYPE, "text/html; charset=utf-8");
            ([kind, (header::CONTENT_SECURITY_POLICY, REPORT_POLICY)], page).into_response()
        }
        None => StatusCode::NOT_FOUND.into_response(),
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
    ConnectInfo(pass): ConnectInfo<Pass>,
    Query(query): Query<HashMap<String, String>>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    // Browsers always send their origin.
    let has_origin = headers.contains_key(header::ORIGIN);
    let Some(reach) = let_in(&shared, &query).filter(|_| has_origin) else {
        return StatusCode::FORBIDDEN.into_response();
    };
    let shared = Shared { reach, ..shared };
    pass.know();
    let max_bytes = converse::longest(shared.reach);
    let pages = with_stage(&shared.stage, |stage| stage.pages.list.len()).await;
    if pages.is_none_or(|pages| pages >= shared.max_pages()) {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many pages").into_response();
    }
    let upgrade = upgrade.protocols([SUBPROTOCOL]).max_message_size(max_bytes).max_frame_size(max_bytes);
    upgrade.on_upgrade(move |socket| converse::run(socket, shared, pass))
}
