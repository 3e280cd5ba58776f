//! Supervision of a live run: settings, saved files, swaps, silences and the report. It prints nothing: it
//! takes [`Request`]s and returns [`Event`]s.

mod event;
mod history;
mod inbox;
mod latency;
mod live_settings;
mod loading;
mod network_value;
pub mod replay;
mod report;
mod requests;
mod silence;
mod start;
mod status;
mod streams;
mod swap;

pub use event::{DeviceUse, Event, Origin, Request};
pub use inbox::{MAX_QUEUED, RequestSender, SendError};
pub use latency::Measured;
pub use live_settings::{SettingError, SettingHandle};
pub use loading::{GraphSource, Job, LoadFn, LoadOutcome, load};
pub use report::{
    CardReport, InputReport, LatencyPart, LatencyReport, PacketReport, QuantilesMs, QuantilesUs, RunReport,
    SavedGraph, SilenceReport, SilencedActuator, TimingReport, TransportMs, XrunReport,
};
pub use silence::received;
pub use start::{Accept, ConnectedRun, PreparedRun, RunOptions, StartError};
pub use status::{InputNow, Status};
pub use swap::CHANGES;

use crate::SettingValue;
use crate::backend::{BackendError, Connected};
use crate::drivers::Drivers;
use crate::osc::OscControl;
use crate::protected::Protected;
use crate::watch::FileWatch;
use haptograph_engine::graph::Graph;
use haptograph_engine::run::{RingReport, Session, SessionOutcome};
use history::{History, Notes};
use inbox::{Inbox, Ordered};
use live_settings::LiveSettings;
use loading::{KnownDocument, Loader, Loading, ParameterDefaults};
use requests::PendingChange;
use silence::SilenceMonitor;
use std::collections::VecDeque;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Polling period.
const PERIOD: Duration = Duration::from_millis(50);
/// Polling period while a graph loads.
const LOADING_PERIOD: Duration = Duration::from_millis(5);

/// Maximum number of requests handled between two checks of the stop flag.
const MAX_HANDLED: usize = 64;

/// A supervised live run.
///
/// Call [`wait`](Self::wait) and [`poll`](Self::poll) until [`is_finished`](Self::is_finished), then [`finish`](Self::finish).
/// Dropping it stops the actuators and leaves the files as they are.
///
/// ```
/// use haptograph_live::supervisor::{RunOptions, Supervisor};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("g.ron");
/// std::fs::write(&path, r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) },
///     nodes: {
///         "one": Constant(clock: "servo", value: 1, quantity: "current"),
///         "out": ActuatorSink(current: "one", endpoint: "coil", limit: (peak_a: 1.5, continuous_a: 1.5)),
///     },
///     endpoints: { "simulated": { "coil": SimulatedHaptuator() } })"#)?;
/// let mut options = RunOptions::of(&path);
/// options.seconds = Some(0.1);
/// let mut run = Supervisor::start(options, &haptograph_nodes::registry(), None)?;
/// let gain = run.setting("out.gain")?;
/// gain.set(0.5)?;
/// while !run.is_finished() {
///     run.wait();
///     for event in run.poll() {
///         println!("{event}");
///     }
/// }
/// assert_eq!(run.finish()?.report.driver_frames, 100);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Supervisor {
    /// The graph that ran first.
    graph: Arc<Graph>,
    folder: Option<PathBuf>,
    /// Before the session, so that a drop ends them first.
    drivers: Drivers,
    session: Session,
    stop: Arc<AtomicBool>,
    parameters: RunParameters,
    edits: Edits,
    requests: RequestQueue,
    record: RunRecord,
    events: Vec<Event>,
}

/// The graph that runs, by its file and its parameters.
struct RunParameters {
    /// The file, with the present parameters.
    source: GraphSource,
    /// The parameters that the run began with.
    given: Vec<(String, String)>,
    /// The parameters set since.
    typed: ParameterDefaults,
    /// The parameters of the running graph, with their defaults.
    known: ParameterDefaults,
}

/// Changes of the graph: what brings them, and what the running graph is compared with.
struct Edits {
    watch: Option<FileWatch>,
    accept: Accept,
    protected: Protected,
    /// Texts of the running graph's files.
    texts: Vec<String>,
    known: Option<KnownDocument>,
    loader: Loader,
    loading: Option<(PendingChange, Loading)>,
    waiting: VecDeque<PendingChange>,
}

/// The requests to a run, from every origin.
struct RequestQueue {
    osc: Option<OscControl>,
    settings: LiveSettings,
    inbox: Inbox,
    /// Those that a wait received or the program queued.
    queued: Vec<Ordered<Request>>,
    /// Names whose OSC messages were refused; each is reported once.
    refused: Vec<String>,
}

/// What the report of a run contains.
struct RunRecord {
    start: Instant,
    refused_at_start: Vec<String>,
    unrested: Vec<String>,
    silence: SilenceMonitor,
    notes: Notes,
    /// The devices of all graphs that ran.
    devices: Vec<DeviceUse>,
    /// Number of changed graphs, and of those that differed in more than live settings.
    changes: u32,
    swaps: u32,
    saved: Vec<SavedGraph>,
    history: History,
}

/// A run that has ended.
#[derive(Debug)]
#[non_exhaustive]
pub struct Ended {
    /// The outcome, as of any run.
    pub outcome: SessionOutcome,
    /// The report.
    pub report: RunReport,
    /// Warnings and notes, one sentence each.
    pub warnings: Vec<String>,
    /// Measured latencies.
    pub latencies: Vec<Measured>,
    /// The devices of all graphs that ran.
    pub devices: Vec<DeviceUse>,
    /// Duration by the clock of the computer, s.
    pub took_s: f64,
}

impl Supervisor {
    /// Queues a request for the next [`poll`](Self::poll).
    ///
    /// If a program requests one name several times, the latest value counts.
    pub fn request(&mut self, request: Request) {
        if request.origin == Origin::Program {
            let same = |known: &Request| known.origin == Origin::Program && known.name == request.name;
            self.requests.queued.retain(|known| !same(&known.asked));
        }
        self.requests.queued.push(self.requests.inbox.sender().ordered(request));
    }

    /// Queues a new value of a parameter or live setting, from the embedding program.
    ///
    /// A live setting (`out.gain`) takes a number, with exactly its bits. For a parameter (`gain`) the graph is loaded
    /// again, on another thread.
    pub fn set(&mut self, name: &str, value: impl Into<SettingValue>) {
        self.request(Request::new(name, value));
    }

    /// A handle that sets one live setting (`out.gain`) from any thread: the name is looked up here, once.
    ///
    /// # Errors
    /// [`SettingError`] if no live setting of the running graph has the name.
    pub fn setting(&mut self, name: &str) -> Result<SettingHandle, SettingError> {
        if let Some(handle) = self.requests.settings.handle(name, self.requests.inbox.sender()) {
            return Ok(handle);
        }
        match self.parameters.known.iter().any(|(known, _)| known == name) {
            true => Err(SettingError::Parameter(name.to_owned())),
            false => Err(self.session.unknown_setting(name).into()),
        }
    }

    /// Sends requests from another thread, and ends [`wait`](Self::wait).
    pub fn sender(&self) -> RequestSender {
        self.requests.inbox.sender().clone()
    }

    /// Maximum number of requests for the next [`poll`](Self::poll), so that a stop is not held up.
    pub fn room(&self) -> usize {
        MAX_HANDLED.min(MAX_QUEUED.saturating_sub(self.edits.waiting.len()))
    }

    /// Ramps the actuators to zero and ends the run.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Stops all drivers and waits until none drives any device. For use after a panic of the caller.
    pub fn stop_now(&mut self) {
        self.drivers.stop();
    }

    /// True if the run is over: every actuator is at zero, or nothing drives it any more.
    pub fn is_finished(&self) -> bool {
        self.drivers.is_finished(self.stop.load(Ordering::Relaxed))
    }

    /// Waits until the next [`poll`](Self::poll) is due: for a request or a [`wake`](RequestSender::wake), at most 50 ms.
    pub fn wait(&mut self) {
        self.wait_at_most(match self.edits.loading.is_some() {
            true => LOADING_PERIOD,
            false => PERIOD,
        });
    }

    /// Waits for a request or a [`wake`](RequestSender::wake). Until the next [`poll`](Self::poll) nothing reports a lost
    /// device or a silence, and no graph is swapped in.
    pub fn wait_at_most(&mut self, longest: Duration) {
        if self.requests.queued.is_empty() {
            self.requests.queued.extend(self.requests.inbox.wait(longest));
        }
    }

    /// Does all work that is due, without waiting: polls devices and files, handles requests, loads and swaps graphs.
    pub fn poll(&mut self) -> Vec<Event> {
        for event in self.drivers.poll() {
            self.events.extend(self.record.notes.add(event).map(Event::Device));
        }
        let inputs = self.session.live_inputs();
        // The final warnings summarise these notes, one line per input.
        let silences = self.record.silence.poll(Instant::now(), &inputs, &self.drivers);
        self.events.extend(silences.into_iter().map(Event::Silence));
        self.events.extend(self.session.failing_files().map(Event::FileFailed));
        self.session.poll();
        if self.drivers.is_partly_finished() {
            self.stop();
        }
        let stopping = self.stop.load(Ordering::Relaxed);
        self.handle_requests();
        if self.edits.watch.as_mut().is_some_and(FileWatch::has_changed)
            && !self.edits.waiting.iter().any(|change| matches!(change, PendingChange::Saved))
        {
            self.edits.waiting.push_back(PendingChange::Saved);
        }
        if !stopping {
            self.load_next();
        }
        std::mem::take(&mut self.events)
    }

    /// Completes the files and returns the outcome of the run. A run that is not [finished](Self::is_finished) is
    /// stopped first.
    ///
    /// # Errors
    /// [`BackendError::Lost`] if a driver's thread panicked.
    pub fn finish(mut self) -> Result<Ended, BackendError> {
        self.requests.settings.end();
        if !self.is_finished() {
            self.stop_now();
        }
        let mut warnings = self.record.refused_at_start;
        warnings.extend(self.record.notes.counted());
        warnings.extend(streams::warnings(&self.drivers));
        let inputs = self.session.live_inputs();
        warnings.extend(self.record.silence.warnings(Instant::now(), &inputs, &self.drivers));
        let mut report = RunReport {
            changes: self.record.changes,
            swaps: self.record.swaps,
            saved_while_running: self.record.saved,
            unrested: self.record.unrested,
            silences: self.record.silence.into_events(),
            set_while_running: self.record.history.all(),
            osc_malformed: self.requests.osc.as_ref().map(OscControl::malformed),
            ..RunReport::default()
        };
        let heard: Vec<RingReport> = self.drivers.rings().collect();
        let output_latency = streams::output_latency(&self.drivers);
        report.add_connections(&self.drivers);
        let lives = self.drivers.join()?;
        // Disconnects the devices, after a last zero to each.
        drop(self.drivers);
        let mut outcome = self.session.finish_all(lives);
        outcome.outcome.rings.extend(heard);
        let took_s = self.record.start.elapsed().as_secs_f64();
        // Computed after the files are complete, since it takes long for a large graph.
        let latencies = latency::measured(&self.graph, output_latency.as_ref());
        report.add_outcome(&self.graph, took_s, &outcome, &latencies);
        warnings.extend(report::warnings_of(&outcome, &report.timing.stalled_at_s));
        Ok(Ended { outcome, report, warnings, latencies, devices: self.record.devices, took_s })
    }

    /// Description of the drivers of the run.
    pub fn description(&self) -> String {
        streams::description(&self.drivers)
    }

    /// All connections to devices, and drivers.
    pub fn connections(&self) -> Vec<Connected> {
        self.drivers.status()
    }

    /// Privileges that the system refused at the start, and how to grant them, one sentence each.
    pub fn refused_at_start(&self) -> &[String] {
        &self.record.refused_at_start
    }

    /// Sinks whose actuators began as warm as their limits allow, since their temperature is unknown.
    pub fn unrested(&self) -> &[String] {
        &self.record.unrested
    }

    /// Address at which settings are received by Open Sound Control.
    pub fn osc_address(&self) -> Option<SocketAddr> {
        self.requests.osc.as_ref().map(OscControl::address)
    }

    /// The parameters, with the text of their values, and the live settings with their numbers.
    pub fn settings(&self) -> Vec<(String, Option<SettingValue>)> {
        let parameter = |(name, default): &(String, Option<String>)| {
            let set = self.parameters.source.set.iter().find(|(known, _)| known == name);
            let value = set.map(|(_, value)| value.clone()).or(default.clone());
            (name.clone(), value.map(SettingValue::Text))
        };
        let live = self.session.settings();
        let live = live.map(|live| (live.name(), Some(SettingValue::Number(live.value))));
        self.parameters.known.iter().map(parameter).chain(live).collect()
    }

    /// The changes of settings, each with its time and origin, one line each.
    pub fn history(&self) -> String {
        self.record.history.lines()
    }
}
