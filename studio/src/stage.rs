//! A graph that runs, the pages that are connected to it, and what they may do.

use super::actuators::{Actuator, Sound, driven};
use super::again::After;
use super::drive::{Drive, DrivenBy, Timing};
use super::envelope::Confirmed;
use super::levels::Costs;
use super::load::{Loaded, Source};
use super::pads::Pad;
use super::pages::Page;
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

/// What the host of an engine can do besides running it.
#[derive(Debug, Clone, Copy)]
pub struct Host {
    /// As `hello` says it.
    pub name: &'static str,
    pub driven_by: DrivenBy,
    pub can_save: bool,
    pub can_learn: bool,
    /// Real devices, where the graph has them.
    pub can_drive: bool,
}

/// Why an edit or a start came to nothing.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The graph is wrong.
    #[error("the graph has errors")]
    Graph(Diagnostics),
    /// It permits what the file did not permit when the studio was opened: one sentence for each.
    #[error(
        "limits cannot be raised, nor actuators added or devices changed, from the page: {}; nothing is changed. Edit \
         the file itself, with an editor on the machine of the studio, and open the studio again",
        .0.join("; ")
    )]
    Beyond(Vec<String>),
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
    pub host: Host,
    pub source: Source,
    pub loaded: Loaded,
    /// The text of the file as it was read or saved last.
    pub on_disk: String,
    /// What no edit may go beyond; none where nothing real can be reached.
    pub confirmed: Option<Arc<Confirmed>>,
    pub state: State,
    pub session: Option<Session>,
    pub drive: Option<Drive>,
    /// Arms the real actuators of this run.
    pub switch: Arc<ArmSwitch>,
    /// The real devices of other programs, the soundcards that are listened to, and what was asked of soundcards.
    pub network: Connections,
    pub inputs: Inputs,
    wanted: Option<Wanted>,
    /// What became of a soundcard.
    pub note: Option<String>,
    pub pads: Vec<Pad>,
    pub scopes: Vec<Scope>,
    pub costs: Costs,
    pub actuators: Vec<Actuator>,
    pub sound: Option<Sound>,
    pub pages: Vec<Page>,
    /// The page that moves the pads and the settings.
    pub owner: Option<u64>,
    /// Live inputs that are silent, and since when, s of the run.
    pub silent: Vec<(String, f64)>,
    /// Where the folders of recorded runs are made, and the one of this run.
    pub out: Option<PathBuf>,
    pub folder: Option<PathBuf>,
    pub recorder: Option<Recording>,
    /// What the page in that folder will show.
    kept: Vec<Kept>,
    /// Why that page is not there.
    pub page_error: Option<String>,
    pub replay: Option<Replay>,
    /// How it goes on after the run.
    pub after: After,
    /// Time that is still to be run where a recording is done again, s.
    pub owed_s: f64,
    /// Times from a pointer's arrival to its tick, s.
    latencies_s: Vec<f64>,
    rate_hz: f64,
    pub next_page: u64,
}

impl Stage {
    /// Runs the graph of a file.
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

    /// Begins to run under the hand.
    pub fn start(&mut self) -> Result<(), StageError> {
        self.start_as(After::Live)
    }

    /// Begins to run. What is not simulated begins as warm as its limit allows, as nobody knows how long it has rested.
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
        // Queues of endpoints are for one run.
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
        // What is driven of a pad's endpoint is driven nowhere.
        let mut devices = graph.devices().iter();
        options.live.rested =
            devices.all(|device| device.entry.spec.simulated || self.loaded.is_pad(&device.name));
        // Whoever armed the run before did not arm this one.
        self.switch = Arc::default();
        options.live.arm = Some(Arc::clone(&self.switch));
        let is_live = self.host.can_drive && !matches!(how, After::Replay(_));
        if self.host.can_drive {
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
                // Without a folder nobody reads it.
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

    /// Falls to zero and stops; where the caller drives, in what it runs next.
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
        if !self.kept.is_empty() {
            self.look_at_scopes(now_s);
        }
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

    /// Lets go of the real devices; each is told a last zero.
    fn release(&mut self) {
        (self.network, self.inputs, self.note) = (Connections::default(), Inputs::default(), None);
    }

    /// Time of the run, s.
    pub fn now_s(&self) -> f64 {
        let frames = self.drive.as_ref().map_or(0, |drive| drive.pace.frames());
        frames as f64 / self.rate_hz
    }

    /// Frames of the driver in a second, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Where the caller drives: how much time passed since this was called last, and how much of it the graph took.
    pub fn keep_time(&mut self, passed: Duration, busy: Duration) {
        if let Some(drive) = &mut self.drive {
            drive.keep_time(passed, busy, self.rate_hz);
        }
    }

    /// Takes in what the run did since.
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
        self.look_at_scopes(now_s);
        for actuator in &mut self.actuators {
            let port = format!("{}.delivered", actuator.name);
            if let Some(scope) = self.scopes.iter().find(|scope| scope.port.name == port) {
                actuator.delivered.take(scope, actuator.window_s);
            }
        }
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
    }

    /// Runs so many frames where the caller drives, and returns what is played of them, 1 being the peak limit. Real-time
    /// code: it does not allocate where [`look`](Self::look) is called often enough.
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

    /// Pointers of a page on a pad; those of pages that do not own the pads move nothing, nor those during a replay.
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
                // What is done is what is kept.
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

    /// From pointers' arrival to their ticks since this was asked last.
    pub fn pointer_latency(&mut self) -> Value {
        let mut all = std::mem::take(&mut self.latencies_s);
        all.sort_by(f64::total_cmp);
        let middle = all.get(all.len() / 2).copied().unwrap_or(0.0);
        let most = all.last().copied().unwrap_or(0.0);
        json!({ "count": all.len(), "p50_ms": middle * 1e3, "max_ms": most * 1e3 })
    }

    /// Turns a live setting.
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
        // Their channels are the same.
        for (pad, spec) in self.pads.iter_mut().zip(&self.loaded.pads) {
            pad.lay_on(spec);
        }
        self.describe_actuators();
        Ok(changed.change.to_string())
    }

    /// Why a graph needs a new run.
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
    /// Ends the run with whole files.
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
