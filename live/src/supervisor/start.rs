//! The start of a live run: load, connect, start.

use super::inbox::{Inbox, RequestSender};
use super::live_settings::LiveSettings;
use super::loading::{self, GraphSource, Job, LoadFn, LoadedGraph, Loader, ParameterDefaults};
use super::silence::SilenceMonitor;
use super::{
    DeviceUse, Edits, History, Notes, Origin, Request, RequestQueue, RunParameters, RunRecord, Supervisor,
};
use crate::backend::BackendError;
use crate::connections::Connections;
use crate::drivers::Drivers;
use crate::osc::OscControl;
use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::graph::Graph;
use haptograph_engine::registry::Registry;
use haptograph_engine::run::{FileSinks, Session, SessionOptions, WriteError};
use std::collections::VecDeque;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Refuses graphs that the embedding program cannot run, with the reason.
pub type Accept = Arc<dyn Fn(&Graph) -> Result<(), String> + Send + Sync>;

/// Options of a live run.
#[derive(Clone)]
#[non_exhaustive]
pub struct RunOptions {
    /// The graph.
    pub source: GraphSource,
    /// True if changes of its files are applied while it runs.
    pub watch: bool,
    /// Duration, s; `None` runs until it is stopped.
    pub seconds: Option<f64>,
    /// Largest block in driver frames; 0 means the default.
    pub block: usize,
    /// True if the actuators are known to be cold. Otherwise real actuators start without heat reserve.
    pub rested: bool,
    /// Address at which settings are received by Open Sound Control; `None` receives none.
    pub osc: Option<SocketAddr>,
    /// Refuses changed graphs, before they run.
    pub accept: Accept,
    /// Loads changed graphs.
    pub load: LoadFn,
}

impl RunOptions {
    /// Options that run a graph with its defaults and its live endpoints until it is stopped.
    pub fn of(graph: impl Into<PathBuf>) -> Self {
        Self {
            source: GraphSource::of(graph),
            watch: false,
            seconds: None,
            block: 0,
            rested: false,
            osc: None,
            accept: Arc::new(|_| Ok(())),
            load: loading::load,
        }
    }
}

/// Error of starting a live run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StartError {
    /// The graph has errors.
    #[error("{0}")]
    Graph(Diagnostics),
    /// A device cannot be reached, or a driver cannot be started.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The address for settings cannot be bound.
    #[error("cannot listen for settings at {0}: {1}")]
    Osc(SocketAddr, std::io::Error),
    /// A file or thread cannot be made.
    #[error(transparent)]
    System(#[from] std::io::Error),
    /// A file of the graph cannot be written.
    #[error(transparent)]
    File(#[from] WriteError),
}

/// A graph that is loaded for a live run.
pub struct PreparedRun {
    options: RunOptions,
    loaded: LoadedGraph,
    parameters: ParameterDefaults,
    loader: Loader,
    connections: Connections,
}

impl PreparedRun {
    /// Loads and checks the graph.
    ///
    /// # Errors
    /// [`Diagnostics`] with every error in the file and in the files it includes.
    pub fn load(mut options: RunOptions, registry: &Registry) -> Result<Self, Diagnostics> {
        let first = loading::load(Job::first(&options.source), registry);
        // For the whole run: a saved file that gains a set must not move real devices.
        options.source.endpoints = first.endpoints;
        Ok(Self {
            loaded: first.result?,
            parameters: first.parameters,
            loader: Loader::new(options.load, registry),
            connections: Connections::with_drivers(registry),
            options,
        })
    }

    /// The graph.
    pub fn graph(&self) -> &Graph {
        &self.loaded.graph
    }

    /// Connects the devices of the graph, and receives settings if the options say so.
    ///
    /// # Errors
    /// [`StartError`] if a device cannot be reached.
    pub fn connect(mut self) -> Result<ConnectedRun, StartError> {
        self.connections.connect(&mut self.loaded.graph)?;
        let inbox = Inbox::new();
        let osc = listen_for_settings(self.options.osc, inbox.sender())?;
        let LoadedGraph { graph, watch, protected, texts } = self.loaded;
        let RunOptions { source, watch: is_watched, accept, .. } = self.options.clone();
        Ok(ConnectedRun {
            graph: Arc::new(graph),
            connections: self.connections,
            parameters: RunParameters {
                given: source.set.clone(),
                source,
                typed: Vec::new(),
                known: self.parameters,
            },
            edits: Edits {
                watch: is_watched.then_some(watch),
                accept,
                protected,
                texts,
                known: None,
                loader: self.loader,
                loading: None,
                waiting: VecDeque::new(),
            },
            osc,
            inbox,
            options: self.options,
        })
    }
}

/// Receives settings, on a thread of its own.
fn listen_for_settings(
    address: Option<SocketAddr>,
    sender: &RequestSender,
) -> Result<Option<OscControl>, StartError> {
    let Some(address) = address else {
        return Ok(None);
    };
    let sender = sender.clone();
    let listening = OscControl::listen(address, move |setting| {
        // A full queue drops the value: faders repeat theirs. A closed queue belongs to a finished run.
        let _ = sender.try_send(Request::from_origin(Origin::Osc, setting.name, setting.value));
    });
    listening.map(Some).map_err(|error| StartError::Osc(address, error))
}

/// A graph whose devices are connected.
pub struct ConnectedRun {
    options: RunOptions,
    graph: Arc<Graph>,
    connections: Connections,
    parameters: RunParameters,
    edits: Edits,
    osc: Option<OscControl>,
    inbox: Inbox,
}

impl ConnectedRun {
    /// The graph.
    pub fn graph(&self) -> &Arc<Graph> {
        &self.graph
    }

    /// Starts the drivers: the actuators move from here on. The run writes its record for a replay and the files of graphs
    /// that are saved meanwhile into `folder`; `stop` ends it.
    ///
    /// # Errors
    /// [`StartError`] if a file cannot be made or a driver cannot be started.
    pub fn start(
        self,
        sinks: FileSinks<'_>,
        folder: Option<&Path>,
        stop: Arc<AtomicBool>,
    ) -> Result<Supervisor, StartError> {
        let mut options = SessionOptions::default().block(self.options.block);
        options.seconds = self.options.seconds;
        options.rested = self.options.rested;
        options.stop = Arc::clone(&stop);
        let (lives, session) = Session::open_all(sinks, &options, folder)?;
        let unrested = lives.iter().flat_map(|live| live.run().unrested().map(str::to_owned)).collect();
        let start = Instant::now();
        let mut drivers = Drivers::start(self.connections, &self.graph, lives, &stop)?;
        drivers.keep(&self.graph);
        Ok(Supervisor {
            requests: RequestQueue {
                osc: self.osc,
                settings: LiveSettings::of(session.settings()),
                inbox: self.inbox,
                queued: Vec::new(),
                refused: Vec::new(),
            },
            record: RunRecord {
                start,
                refused_at_start: drivers.notes(),
                unrested,
                silence: SilenceMonitor::new(Instant::now()),
                notes: Notes::default(),
                devices: DeviceUse::of(&self.graph),
                changes: 0,
                swaps: 0,
                saved: Vec::new(),
                history: History::default(),
            },
            graph: self.graph,
            folder: folder.map(Path::to_owned),
            drivers,
            session,
            stop,
            parameters: self.parameters,
            edits: self.edits,
            events: Vec::new(),
        })
    }
}

impl Supervisor {
    /// Loads a graph, connects its devices and starts it. The files of its sinks go to `folder`, if there is one.
    ///
    /// # Errors
    /// [`StartError`] if the graph has errors, a device cannot be reached, or a file cannot be written.
    pub fn start(
        options: RunOptions,
        registry: &Registry,
        folder: Option<&Path>,
    ) -> Result<Self, StartError> {
        let run = PreparedRun::load(options, registry).map_err(StartError::Graph)?;
        let run = run.connect()?;
        let graph = Arc::clone(run.graph());
        let mut sinks = FileSinks::new(&graph);
        if let Some(folder) = folder {
            sinks.open_files(folder)?;
        }
        run.start(sinks, folder, Arc::default())
    }
}
