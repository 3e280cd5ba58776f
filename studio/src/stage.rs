//! A graph that runs, the pages that are connected to it, and what they may do.

use super::drive::Drive;
use super::load::{Loaded, Source};
use super::pads::{Pad, PageClock};
use super::pump::Delivered;
use super::scope::{self, Port, Scope};
use super::wire::{MOST_SCOPES, Pointer, Wanted};
use axum::extract::ws::Message;
use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::frame::Kind;
use haptograph_engine::host::{PlayOptions, Player};
use haptograph_engine::run::Session;
use haptograph_signal::quantity::Quantity;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use tokio::sync::mpsc::Sender;

/// Messages that wait for a page which does not read.
pub const MOST_WAITING: usize = 512;
/// How long a run may take to fall to zero.
const STOPPING: Duration = Duration::from_secs(2);

/// What the run is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    Running,
    /// By the page's STOP: drives are at zero.
    Stopped,
    /// A node panicked: drives are at zero.
    Failed,
}

/// A page that is connected.
#[derive(Debug)]
pub struct Page {
    pub id: u64,
    pub to_page: Sender<Message>,
    pub wanted: Vec<Wanted>,
    pub hears: bool,
    pub lost: u64,
    pub is_gone: bool,
    clock: PageClock,
}

/// An actuator, and what it was given.
#[derive(Debug)]
pub struct Actuator {
    pub name: String,
    pub unit: String,
    pub peak: f64,
    pub continuous: f64,
    window_s: f64,
    pub rate_hz: f64,
    pub delivered: Delivered,
}

/// What the page plays.
#[derive(Debug)]
pub struct Sound {
    pub port: String,
    pub peak: f64,
    pub rate_hz: f64,
}

/// Why an edit or a start came to nothing.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The graph is wrong.
    #[error("the graph has errors")]
    Graph(Diagnostics),
    /// It cannot be played or put in place.
    #[error("{0}")]
    Other(String),
}

impl From<Diagnostics> for StageError {
    fn from(wrong: Diagnostics) -> Self {
        Self::Graph(wrong)
    }
}

fn other(error: impl std::fmt::Display) -> StageError {
    StageError::Other(error.to_string())
}

/// The graph that runs and whoever looks at it.
pub struct Stage {
    pub source: Source,
    pub loaded: Loaded,
    /// The text of the file as it was read or saved last.
    pub on_disk: String,
    pub state: State,
    pub session: Option<Session>,
    pub drive: Option<Drive>,
    pub pads: Vec<Pad>,
    pub scopes: Vec<Scope>,
    pub actuators: Vec<Actuator>,
    pub sound: Option<Sound>,
    pub pages: Vec<Page>,
    /// The page that moves the pads and the settings.
    pub owner: Option<u64>,
    /// Live inputs that are silent, and since when.
    pub silent: Vec<(String, Instant)>,
    /// Times from a pointer's arrival to its tick, s.
    latencies_s: Vec<f64>,
    rate_hz: f64,
    next_page: u64,
}

impl Stage {
    /// Runs the graph of a file.
    pub fn open(source: Source) -> Result<Self, StageError> {
        let text = source
            .read()
            .map_err(|error| other(format!("cannot read {}: {error}", source.path.display())))?;
        let loaded = source.load(&text)?;
        let mut stage = Self {
            source,
            loaded,
            on_disk: text,
            state: State::Stopped,
            session: None,
            drive: None,
            pads: Vec::new(),
            scopes: Vec::new(),
            actuators: Vec::new(),
            sound: None,
            pages: Vec::new(),
            owner: None,
            silent: Vec::new(),
            latencies_s: Vec::new(),
            rate_hz: 1.0,
            next_page: 0,
        };
        stage.start()?;
        Ok(stage)
    }

    /// Begins to run. What is not simulated begins as warm as its limit allows, as nobody knows how long it has rested.
    pub fn start(&mut self) -> Result<(), StageError> {
        if self.state == State::Running {
            return Ok(());
        }
        // Queues of endpoints are for one run.
        self.loaded = self.source.load(&self.loaded.text)?;
        let graph = &self.loaded.graph;
        let ports = scope::ports(graph);
        let mut options = PlayOptions::default();
        options.probes = ports.iter().map(|port| port.name.clone()).collect();
        let (mut player, session) = Player::open(graph, &options).map_err(other)?;
        let pads = self.loaded.pads.iter().map(|pad| Pad::of(graph, pad));
        self.pads = pads.collect::<Result<_, _>>().map_err(other)?;
        let scope = |port: Port| player.any_probe(&port.name).map(|frames| Scope::of(port, frames));
        self.scopes = ports
            .into_iter()
            .map(scope)
            .collect::<Result<_, _>>()
            .map_err(other)?;
        let driver = graph
            .drivers()
            .first()
            .map(|driver| graph.clocks()[*driver].rate.hz());
        self.rate_hz = driver.unwrap_or(1.0);
        self.drive = Some(Drive::start(player, self.rate_hz).map_err(other)?);
        self.session = Some(session);
        self.state = State::Running;
        self.describe_actuators();
        Ok(())
    }

    /// Falls to zero and stops.
    pub fn stop(&mut self) {
        let (Some(session), Some(drive)) = (self.session.take(), self.drive.take()) else {
            return;
        };
        session.stop();
        let asked = Instant::now();
        while !drive.pace.is_over() && asked.elapsed() < STOPPING {
            std::thread::sleep(Duration::from_millis(2));
        }
        let ended = drive.join().map(|player| player.finish(session));
        let failed = ended.is_none_or(|ended| ended.panicked);
        self.state = if failed { State::Failed } else { State::Stopped };
        self.pads.clear();
        self.silent.clear();
    }

    /// What the sinks drive, and what is played.
    fn describe_actuators(&mut self) {
        let graph = &self.loaded.graph;
        let known: Vec<Actuator> = std::mem::take(&mut self.actuators);
        let delivered = |sink: &str| {
            self.scopes
                .iter()
                .find(|scope| scope.port.name == format!("{sink}.delivered"))
        };
        let actuator = |(sink, limit): (&str, haptograph_engine::node::Limit)| {
            let port = &delivered(sink)?.port;
            let before = known.iter().find(|known| known.name == sink);
            Some(Actuator {
                name: sink.to_owned(),
                unit: port.quantity.unit(),
                peak: limit.peak,
                continuous: limit.continuous,
                window_s: limit.window_s,
                rate_hz: port.rate_hz,
                delivered: before.map(|known| known.delivered.clone()).unwrap_or_default(),
            })
        };
        self.actuators = graph.limits().filter_map(actuator).collect();
        let is_coil = |port: &Port| {
            port.kind == Kind::Scalar && port.quantity == Quantity::CURRENT && port.rate_hz >= 1000.0
        };
        let played = self.actuators.iter().find_map(|actuator| {
            let port = &delivered(&actuator.name)?.port;
            is_coil(port).then(|| Sound {
                port: port.name.clone(),
                peak: actuator.peak,
                rate_hz: port.rate_hz,
            })
        });
        self.sound = played;
    }

    /// Time of the run, s.
    pub fn now_s(&self) -> f64 {
        let frames = self.drive.as_ref().map_or(0, |drive| drive.pace.frames());
        frames as f64 / self.rate_hz
    }

    /// Takes in what the run did since.
    pub fn look(&mut self) {
        let now_s = self.now_s();
        if let Some(session) = &mut self.session {
            session.poll();
        }
        for scope in &mut self.scopes {
            scope.look(now_s);
        }
        for actuator in &mut self.actuators {
            let port = format!("{}.delivered", actuator.name);
            if let Some(scope) = self.scopes.iter().find(|scope| scope.port.name == port) {
                actuator.delivered.take(scope, actuator.window_s);
            }
        }
        if self.state == State::Running && self.drive.as_ref().is_some_and(|drive| drive.pace.is_over()) {
            self.stop();
        }
    }

    /// Pointers of a page on a pad; those of pages that do not own the pads move nothing.
    pub fn point(&mut self, page: u64, pad: usize, points: &[Pointer]) {
        let now_s = self.now_s();
        if self.owner != Some(page) {
            return;
        }
        let page = self.pages.iter_mut().find(|known| known.id == page);
        let (Some(page), Some(pad)) = (page, self.pads.get_mut(pad)) else {
            return;
        };
        for point in points {
            let due_s = page.clock.due_s(point.at_s, now_s);
            pad.move_to(due_s, point);
            self.latencies_s.push((due_s - now_s).max(0.0));
        }
        let most = self.latencies_s.len().saturating_sub(1000);
        self.latencies_s.drain(..most);
    }

    /// From pointers' arrival to their ticks since this was asked last.
    pub fn pointer_latency(&mut self) -> Value {
        let mut all = std::mem::take(&mut self.latencies_s);
        all.sort_by(f64::total_cmp);
        let middle = all.get(all.len() / 2).copied().unwrap_or(0.0);
        let most = all.last().copied().unwrap_or(0.0);
        json!({ "count": all.len(), "p50_ms": middle * 1e3, "max_ms": most * 1e3 })
    }

    /// A page that came; the first is the owner.
    pub fn join(&mut self, to_page: Sender<Message>) -> u64 {
        let id = self.next_page;
        self.next_page += 1;
        self.pages.push(Page {
            id,
            to_page,
            wanted: Vec::new(),
            hears: false,
            lost: 0,
            is_gone: false,
            clock: PageClock::default(),
        });
        self.owner.get_or_insert(id);
        id
    }

    /// A page that went. What it held falls silent by itself.
    pub fn leave(&mut self, page: u64) {
        self.pages.retain(|known| known.id != page);
        if self.owner == Some(page) {
            self.owner = self.pages.first().map(|known| known.id);
        }
    }

    /// The ports that a page wants to see.
    pub fn scope(&mut self, page: u64, mut ports: Vec<Wanted>) {
        ports.truncate(MOST_SCOPES);
        if let Some(page) = self.pages.iter_mut().find(|known| known.id == page) {
            page.wanted = ports;
        }
    }

    /// Turns a live setting.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), StageError> {
        let session = self.session.as_mut().ok_or_else(|| other("the run is stopped"))?;
        session.set_by_name(name, value).map_err(other)
    }

    /// Another graph takes over; says what that was.
    pub fn take(&mut self, source: Source, next: Loaded) -> Result<String, StageError> {
        if self.session.is_none() {
            (self.loaded, self.source) = (next, source);
            self.describe_actuators();
            return Ok("it is taken over when the run goes on".to_owned());
        }
        if let Some(why) = self.obstacle(&next) {
            return Err(other(why));
        }
        let ports = scope::ports(&next.graph);
        let names: Vec<String> = ports.iter().map(|port| port.name.clone()).collect();
        let Some(session) = self.session.as_mut() else {
            return Err(other("the run is stopped"));
        };
        let (changed, mut probes) = session
            .change_and_probe(&next.graph, None, &names)
            .map_err(other)?;
        self.scopes.retain(|scope| ports.contains(&scope.port));
        for port in ports {
            if !self.scopes.iter().any(|scope| scope.port == port) {
                let frames = probes.take_any(&port.name);
                self.scopes.extend(frames.map(|frames| Scope::of(port, frames)));
            }
        }
        (self.loaded, self.source) = (next, source);
        self.describe_actuators();
        Ok(changed.change.to_string())
    }

    /// Why a graph needs a new run.
    fn obstacle(&self, next: &Loaded) -> Option<String> {
        let channels = |loaded: &Loaded| -> Vec<String> {
            let channels = loaded.graph.host_inputs().chain(loaded.graph.host_outputs());
            channels.map(|(name, _)| name).collect()
        };
        let (before, after) = (channels(&self.loaded), channels(next));
        (before != after).then(|| {
            format!(
                "the pads' channels would be {} instead of {}; stop, apply, and go on",
                list(&after),
                list(&before)
            )
        })
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        self.stop();
    }
}

fn list(names: &[String]) -> String {
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}
