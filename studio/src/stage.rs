//! A running graph with its connected pages, and the actions that these may take.

use super::actuators::{Actuator, Sound, driven};
use super::again::After;
use super::drive::{Drive, DrivenBy, Timing};
use super::envelope::Confirmed;
use super::levels::Costs;
use super::load::{Loaded, Source};
use super::pads::Pad;
use super::pages::Page;
use super::publish::send_samples;
use super::record::{Recording, Replay, meant, moved};
use super::run_page::{self, Kept};
use super::scope::{self, Port, Scope};
use super::wire::Pointer;
use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::host::{PlayOptions, Player};
use haptograph_engine::run::{ArmSwitch, Session};
use haptograph_nodes::network::Connections;
use haptograph_nodes::soundcard::{CardNote, Inputs, Wanted, wanted};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Maximum duration of the fall to zero.
const STOPPING: Duration = Duration::from_secs(2);

/// State of the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    Running,
    /// Stopped by a page: actuators are at zero.
    Stopped,
    /// A node panicked: actuators are at zero.
    Failed,
}

/// Abilities of the host of an engine.
#[derive(Debug, Clone, Copy)]
pub struct Host {
    /// Name in the message `hello`.
    pub name: &'static str,
    pub driven_by: DrivenBy,
    pub can_save: bool,
    pub can_learn: bool,
    /// Real devices, where the graph has them.
    pub can_drive: bool,
}

/// Error of an edit or a start.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The graph has errors.
    #[error("the graph has errors")]
    Graph(Diagnostics),
    /// The graph exceeds the limits and devices of the file when the studio was opened, one sentence each.
    #[error(
        "limits cannot be raised, nor actuators added or devices changed, from the page: {}; nothing is changed. Edit \
         the file itself, with an editor on the machine of the studio, and open the studio again",
        .0.join("; ")
    )]
    Beyond(Vec<String>),
    /// The graph cannot run or cannot be swapped in.
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

/// The running graph and its pages.
pub struct Stage {
    pub host: Host,
    pub source: Source,
    pub loaded: Loaded,
    /// The text of the file when it was last read or saved.
    pub on_disk: String,
    /// Limits and devices that no edit may exceed; `None` if no real device can be reached.
    pub confirmed: Option<Arc<Confirmed>>,
    pub state: State,
    pub session: Option<Session>,
    pub drive: Option<Drive>,
    /// Arms the real actuators; the same for all runs.
    pub switch: Arc<ArmSwitch>,
    /// The driven devices that were heard at the last look.
    pub heard: Vec<String>,
    /// The real devices of other programs, the soundcards that are listened to, and what was asked of soundcards.
    pub network: Connections,
    pub inputs: Inputs,
    wanted: Option<Wanted>,
    /// The latest event of a real device.
    pub note: Option<String>,
    pub pads: Vec<Pad>,
    pub scopes: Vec<Scope>,
    pub costs: Costs,
    pub actuators: Vec<Actuator>,
    pub sound: Option<Sound>,
    pub pages: Vec<Page>,
    /// The page that controls the pads and the settings.
    pub owner: Option<u64>,
    /// Silent live inputs, with the time of the run since which they are silent, s.
    pub silent: Vec<(String, f64)>,
    /// The folder for recorded runs, and the folder of this run.
    pub out: Option<PathBuf>,
    pub folder: Option<PathBuf>,
    pub recorder: Option<Recording>,
    /// Signals recorded for the page in that folder.
    kept: Vec<Kept>,
    /// Error of writing that page.
    pub page_error: Option<String>,
    pub replay: Option<Replay>,
    /// What follows this run.
    pub after: After,
    /// Time still to be run in a replay, s.
    pub owed_s: f64,
    /// Delays from the arrival of pointers to their ticks, s.
    latencies_s: Vec<f64>,
    rate_hz: f64,
    pub next_page: u64,
}

impl Stage {
    /// Opens and runs the graph of a file.
    pub fn open(source: Source, host: Host) -> Result<Self, StageError> {
        let text = source
            .read()
            .map_err(|error| other(format!("cannot read {}: {error}", source.path.display())))?;
        let loaded = source.load(&text)?;
        let mut stage = Self {
            host,
            source,
            loaded,
            on_disk: text,
            confirmed: None,
            state: State::Stopped,
            session: None,
            drive: None,
            switch: Arc::default(),
            heard: Vec::new(),
            network: Connections::default(),
            inputs: Inputs::default(),
            wanted: None,
            note: None,
            pads: Vec::new(),
            scopes: Vec::new(),
            costs: Costs::default(),
            actuators: Vec::new(),
            sound: None,
            pages: Vec::new(),
            owner: None,
            silent: Vec::new(),
            out: None,
            folder: None,
            recorder: None,
            kept: Vec::new(),
            page_error: None,
            replay: None,
            after: After::Nothing,
            owed_s: 0.0,
            latencies_s: Vec::new(),
            rate_hz: 1.0,
            next_page: 0,
        };
        stage.start()?;
        Ok(stage)
    }

    /// Starts a live run.
    pub fn start(&mut self) -> Result<(), StageError> {
        self.start_as(After::Live)
    }

    /// Starts a run. Real actuators start as warm as their limits allow, since their temperature is unknown.
    pub fn start_as(&mut self, how: After) -> Result<(), StageError> {
        if self.state == State::Running {
            return Ok(());
        }
        let begun = self.begin(how);
        if begun.is_err() {
            self.release();
        }
        begun
    }

    fn begin(&mut self, how: After) -> Result<(), StageError> {
        // The queues of endpoints serve one run only.
        self.loaded = self.source.load(&self.loaded.text)?;
        let graph = &self.loaded.graph;
        let ports = scope::ports(graph);
        let mut options = PlayOptions::default();
        options.sample_costs = true;
        options.probes = ports.iter().map(|port| port.name.clone()).collect();
        if matches!(how, After::Record) {
            let failed = |error| other(format!("there is no folder to record to: {error}"));
            let name = format!("{}-strokes", self.source.name());
            self.folder = self.new_folder(&name).map_err(failed)?;
            options.folder = self.folder.clone();
        }
        self.costs = Costs::default();
        // Outputs of a pad's endpoint are not connected.
        let mut devices = graph.devices().iter();
        options.live.rested =
            devices.all(|device| device.entry.spec.simulated || self.loaded.is_pad(&device.name));
        // A new run begins disarmed.
        self.switch.disarm();
        options.live.arm = Some(Arc::clone(&self.switch));
        let is_live = self.host.can_drive && !matches!(how, After::Replay(_));
        // A replay drives nothing real, and hears nothing that was not recorded.
        if is_live {
            self.wanted = Some(wanted(graph).map_err(other)?);
            self.network.connect(graph).map_err(other)?;
        }
        let (mut player, session) = Player::open(graph, &options).map_err(other)?;
        if is_live {
            let live = std::slice::from_mut(player.live_mut());
            self.inputs = Inputs::open(graph, live).map_err(other)?;
        }
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
        let timing = match self.host.can_drive && !driven(graph).is_empty() {
            true => Timing::STRICT,
            false => Timing::EASY,
        };
        let driven_by = match how {
            After::Replay(_) => DrivenBy::Caller,
            _ => self.host.driven_by,
        };
        match how {
            After::Record => {
                self.recorder = Some(Recording::begin(&self.source, &self.loaded.text, self.rate_hz));
                // Without a folder there is no page.
                self.kept = match self.folder {
                    Some(_) => Kept::of(graph),
                    None => Vec::new(),
                };
            }
            After::Replay(recording) => self.replay = Some(Replay::of(*recording)),
            After::Nothing | After::Live => {}
        }
        let card = self.wanted.as_ref().filter(|_| is_live);
        self.drive = Some(match card.and_then(|wanted| wanted.output.clone()) {
            Some(request) => Drive::start_by_card(player, request).map_err(other)?,
            None => Drive::start(player, driven_by, (self.rate_hz, timing)).map_err(other)?,
        });
        self.session = Some(session);
        self.state = State::Running;
        self.describe_actuators();
        Ok(())
    }

    /// Lets the outputs fall to zero and stops; if the caller drives, within its next frames.
    pub fn stop(&mut self) {
        self.disarm();
        let (Some(session), Some(drive)) = (&self.session, &mut self.drive) else {
            return;
        };
        session.stop();
        if drive.is_done_within(STOPPING) {
            self.end();
        }
    }

    fn end(&mut self) {
        if self
            .recorder
            .as_ref()
            .is_some_and(|recording| recording.frames == 0)
        {
            self.close_recording();
        }
        let now_s = self.now_s();
        let (Some(session), Some(drive)) = (self.session.take(), self.drive.take()) else {
            return;
        };
        self.disarm();
        let ended = drive.join().map(|player| player.finish(session));
        self.release();
        // The last frames: what begins next has scopes of its own.
        self.look_at_scopes(now_s);
        send_samples(self);
        let kept = std::mem::take(&mut self.kept);
        if let (Some(folder), Some(ended), true) = (&self.folder, &ended, self.recorder.is_some()) {
            let (graph, outcome) = (&self.loaded.graph, &ended.outcome);
            let written = run_page::write(folder, &self.source, graph, outcome, &kept);
            self.page_error = written.err().map(|error| error.to_string());
        }
        let failed = ended.is_none_or(|ended| ended.panicked);
        self.state = if failed { State::Failed } else { State::Stopped };
        self.pads.clear();
        self.silent.clear();
        self.go_on();
    }

    /// Disconnects the real devices, after a last zero to each.
    fn release(&mut self) {
        (self.network, self.inputs, self.note) = (Connections::default(), Inputs::default(), None);
        self.heard.clear();
    }

    /// Time of the run, s.
    pub fn now_s(&self) -> f64 {
        let frames = self.drive.as_ref().map_or(0, |drive| drive.pace.frames());
        frames as f64 / self.rate_hz
    }

    /// Rate of the driver, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Updates the timing if the caller drives: wall-clock time and computing time since the last call.
    pub fn keep_time(&mut self, passed: Duration, busy: Duration) {
        if let Some(drive) = &mut self.drive {
            drive.keep_time(passed, busy, self.rate_hz);
        }
    }

    /// Collects the new data of the run.
    pub fn look(&mut self) {
        let now_s = self.now_s();
        let notes = self.drive.as_mut().map(Drive::poll).unwrap_or_default();
        for note in notes.into_iter().chain(self.inputs.poll()) {
            if let CardNote::Turn(note) = note {
                // What is plugged in anew is not what was armed.
                self.disarm();
                self.note = Some(note);
            }
        }
        if let Some(session) = &mut self.session {
            session.poll();
        }
        self.disarm_if_silent();
        self.look_at_scopes(now_s);
    }

    /// Ends what is over, once the pages have been sent what was seen of it.
    pub fn end_what_is_over(&mut self) {
        if self.state == State::Running && self.drive.as_ref().is_some_and(|drive| drive.pace.is_over()) {
            self.end();
        }
        if self.recorder.as_ref().is_some_and(Recording::is_full) {
            self.record(false);
        }
    }

    fn look_at_scopes(&mut self, now_s: f64) {
        for scope in &mut self.scopes {
            scope.look(now_s);
        }
        for kept in &mut self.kept {
            kept.take(&self.scopes);
        }
        for actuator in &mut self.actuators {
            let port = format!("{}.delivered", actuator.name);
            if let Some(scope) = self.scopes.iter().find(|scope| scope.port.name == port) {
                actuator.delivered.take(scope, actuator.window_s);
            }
        }
    }

    /// Runs `frames` frames if the caller drives; returns the samples to play, where 1 is the peak limit.
    /// Real-time code: it does not allocate if [`look`](Self::look) is called often enough.
    pub fn process(&mut self, frames: usize) -> impl Iterator<Item = f64> {
        self.run(frames);
        let scopes = &mut self.scopes;
        let played = self.sound.as_ref().and_then(|sound| {
            let scope = scopes.iter_mut().find(|scope| scope.port.name == sound.port)?;
            Some((scope.take_in(), sound.peak))
        });
        let (values, peak) = played.unwrap_or((&[], 1.0));
        values.iter().map(move |value| value / peak)
    }

    /// Applies pointer events of a page to a pad; ignored for pages that do not own the pads, and during a
    /// replay.
    pub fn point(&mut self, page: u64, number: usize, points: &[Pointer]) {
        if self.owner != Some(page) || self.replay.is_some() {
            return;
        }
        let page = self.pages.iter_mut().find(|known| known.id == page);
        let (Some(page), Some(pad), Some(drive)) = (page, self.pads.get_mut(number), &self.drive) else {
            return;
        };
        drive.between_frames(|frame| {
            let now_s = frame as f64 / self.rate_hz;
            for point in points {
                let due_s = page.clock.due_s(point.at_s, now_s);
                // The recorded event is the one that is applied.
                let made = moved(frame, number, due_s, point);
                let (due_s, point) = meant(&made);
                pad.move_to(due_s, &point);
                self.latencies_s.push((due_s - now_s).max(0.0));
                if let Some(recording) = &mut self.recorder {
                    recording.moves.push(made);
                }
            }
        });
        let most = self.latencies_s.len().saturating_sub(1000);
        self.latencies_s.drain(..most);
    }

    /// Statistics of the delays from pointer arrival to tick since the last call.
    pub fn pointer_latency(&mut self) -> Value {
        let mut all = std::mem::take(&mut self.latencies_s);
        all.sort_by(f64::total_cmp);
        let middle = all.get(all.len() / 2).copied().unwrap_or(0.0);
        let most = all.last().copied().unwrap_or(0.0);
        json!({ "count": all.len(), "p50_ms": middle * 1e3, "max_ms": most * 1e3 })
    }

    /// Sets a live setting.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), StageError> {
        let (Some(session), Some(drive)) = (&mut self.session, &self.drive) else {
            return Err(other("the run is stopped"));
        };
        if self.replay.is_some() {
            return Err(other("a recording is done again; stop it first"));
        }
        drive.between_frames(|frame| {
            session.set_by_name(name, value).map_err(other)?;
            if let Some(recording) = &mut self.recorder {
                recording.turned(frame, name, value);
            }
            Ok(())
        })
    }

    /// Swaps the graph; returns a description of the change.
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
        let connected = match self.host.can_drive {
            true => Some(self.network.connect(&next.graph).map_err(other)?),
            false => None,
        };
        self.disarm_unless_same(&next);
        let Some(session) = self.session.as_mut() else {
            return Err(other("the run is stopped"));
        };
        let changed = session.change_and_probe(&next.graph, None, &names);
        let (changed, mut probes) = changed.map_err(|error| {
            connected
                .into_iter()
                .for_each(|before| self.network.let_go(before));
            other(error)
        })?;
        self.network.follow(&next.graph);
        self.scopes.retain(|scope| ports.contains(&scope.port));
        for port in ports {
            if !self.scopes.iter().any(|scope| scope.port == port) {
                let frames = probes.take_any(&port.name);
                self.scopes.extend(frames.map(|frames| Scope::of(port, frames)));
            }
        }
        (self.loaded, self.source) = (next, source);
        // The new pads have the same channels.
        for (pad, spec) in self.pads.iter_mut().zip(&self.loaded.pads) {
            pad.lay_on(spec);
        }
        self.describe_actuators();
        Ok(changed.change.to_string())
    }

    /// Why a graph cannot be swapped in without a new run.
    fn obstacle(&self, next: &Loaded) -> Option<String> {
        if self.recorder.is_some() || self.replay.is_some() {
            return Some("a recording is of one graph: end it first".to_owned());
        }
        if self.wanted.is_some() && self.wanted != wanted(&next.graph).ok() {
            return Some("it asks for another soundcard: stop, apply, and go on".to_owned());
        }
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

impl Stage {
    /// Ends the run with complete files.
    pub fn close(&mut self) {
        self.halt();
        self.end();
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        self.close();
    }
}

fn list(names: &[String]) -> String {
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}
