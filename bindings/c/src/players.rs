//! Players: one handle for the real-time half of a run and the half that may block.

use crate::border::{self, Outcome, State, Status};
use crate::channels;
use crate::failure::Failure;
use crate::table::{self, Entry, try_lock};
use haptograph_engine::graph::Graph;
use haptograph_engine::host::AnyOutput;
use haptograph_engine::run::{Change, Player, PlayerState, Session, SessionOptions};
use haptograph_engine::settings::LiveSetting;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Most frames of one call: 11 minutes at 48 kHz. A larger number is an error.
const MAX_FRAMES: usize = 1 << 25;

/// The options of a run.
pub(crate) struct PlayRequest<'a> {
    pub rested: bool,
    pub folder: Option<PathBuf>,
    pub probes: Vec<&'a str>,
    pub block: usize,
    pub seconds: f64,
}

/// A run. Each half has its own lock.
pub(crate) struct PlayerEntry {
    player: Mutex<Player>,
    session: Mutex<Session>,
    /// The state after the last call of `process`, readable from any thread.
    state: AtomicU32,
    frames: AtomicU64,
    stop: Arc<AtomicBool>,
    /// The folder of its files.
    folder: Option<PathBuf>,
}

/// A live setting of a player, which a changed graph may have at another place.
pub(crate) struct Setting {
    player: u64,
    live: LiveSetting,
}

/// Opens a player of a graph and returns its handle.
pub(crate) fn open(graph: &Graph, request: PlayRequest<'_>) -> Result<u64, Failure> {
    if !request.seconds.is_finite() || request.seconds < 0.0 {
        let message = "`seconds` must be a finite duration of at least 0; 0 means no end";
        return Err(Failure::new(Status::Argument, message));
    }
    if request.block > 1 << 16 {
        let message = "`block` must be at most 65536 driver frames; 0 means the default";
        return Err(Failure::new(Status::Argument, message));
    }
    let mut options = SessionOptions::default();
    options.probes = request.probes.iter().map(|name| (*name).to_owned()).collect();
    options.folder.clone_from(&request.folder);
    options.rested = request.rested;
    options.block = request.block;
    options.seconds = (request.seconds > 0.0).then_some(request.seconds);
    let stop = Arc::clone(&options.stop);
    let (player, session) = Player::open(graph, &options)?;
    let entry = PlayerEntry {
        player: Mutex::new(player),
        session: Mutex::new(session),
        state: AtomicU32::new(State::Running as u32),
        frames: AtomicU64::new(0),
        stop,
        folder: request.folder,
    };
    // Some systems allocate a lock when it is first taken.
    drop((entry.player.lock(), entry.session.lock()));
    Ok(table::insert(Entry::Player(Box::new(entry)))?)
}

impl PlayerEntry {
    /// Runs the next frames. Real-time.
    pub(crate) fn process(&self, frames: usize) -> Result<(), Status> {
        if frames > MAX_FRAMES {
            return Err(Status::Argument);
        }
        let mut player = try_lock(&self.player)?;
        player.process(frames);
        self.frames.store(player.frames(), Ordering::Relaxed);
        let state = match player.state() {
            PlayerState::Running => State::Running,
            PlayerState::Stopped => State::Stopped,
            PlayerState::Finished => State::Finished,
            PlayerState::Panicked => State::Panicked,
        };
        self.state.store(state as u32, Ordering::Relaxed);
        match state {
            State::Running => Ok(()),
            _ => Err(Status::Ended),
        }
    }

    /// The state after the last call of `process`. Real-time.
    pub(crate) fn state(&self) -> State {
        [State::Running, State::Stopped, State::Finished]
            .into_iter()
            .find(|state| *state as u32 == self.state.load(Ordering::Relaxed))
            .unwrap_or(State::Panicked)
    }

    /// Driver frames run so far. Real-time.
    pub(crate) fn frames(&self) -> u64 {
        self.frames.load(Ordering::Relaxed)
    }

    /// Fades the outputs out from the next call of `process` on. Real-time.
    pub(crate) fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Opens the output of a probe.
    pub(crate) fn probe(&self, name: &str, components: u32) -> Result<AnyOutput, Failure> {
        channels::probe(&mut *try_lock(&self.session)?, name, components)
    }

    /// Finds the live setting of this name.
    pub(crate) fn setting(&self, player: u64, name: &str) -> Result<Setting, Failure> {
        let session = try_lock(&self.session)?;
        let found = session.settings().find(|live| live.name() == name).cloned();
        let live = found.ok_or_else(|| Failure::new(Status::Name, session.unknown_setting(name)))?;
        Ok(Setting { player, live })
    }

    /// Sets a live setting by its name.
    pub(crate) fn set(&self, name: &str, value: f64) -> Result<(), Failure> {
        let live = self.setting(0, name)?.live;
        try_lock(&self.session)?
            .set(live.node, live.setting, value)
            .map_err(|error| Failure::new(error.into(), format_args!("`{name}`: {error}")))
    }

    /// The live settings and their values.
    pub(crate) fn settings(&self) -> Result<Vec<border::LiveSetting>, Failure> {
        Ok(try_lock(&self.session)?.settings().map(border::LiveSetting::from).collect())
    }

    /// The live inputs and their effect.
    pub(crate) fn live_inputs(&self) -> Result<Vec<border::LiveInput>, Failure> {
        Ok(try_lock(&self.session)?.live_inputs().iter().map(border::LiveInput::from).collect())
    }

    /// The actuators that depend on a live input.
    pub(crate) fn actuators(&self, endpoint: &str) -> Result<Vec<border::Actuator>, Failure> {
        let inputs = try_lock(&self.session)?.live_inputs();
        let Some(input) = inputs.iter().find(|input| input.device == endpoint) else {
            let known: Vec<&str> = inputs.iter().map(|input| input.device.as_str()).collect();
            let known = known.join(", ");
            let message = format_args!("the graph has no live input `{endpoint}`; it has {known}");
            return Err(Failure::new(Status::Name, message));
        };
        Ok(input.actuators.iter().map(border::Actuator::from).collect())
    }

    /// Replaces the graph; the running one continues if that is not possible.
    pub(crate) fn change(&self, graph: &Graph, probes: &[&str]) -> Result<border::Change, Failure> {
        if self.state() != State::Running {
            return Err(Status::Ended.into());
        }
        for probe in probes {
            graph.find_output(probe)?;
        }
        let probes: Vec<String> = probes.iter().map(|name| (*name).to_owned()).collect();
        let mut session = try_lock(&self.session)?;
        // Frees what earlier changes replaced.
        session.poll();
        let changed = session.change_and_probe(graph, self.folder.as_deref(), &probes)?;
        Ok(match changed.change {
            Change::Settings(_) => border::Change::Settings,
            Change::CrossFade => border::Change::CrossFade,
            Change::FadeThroughZero(_) => border::Change::ThroughZero,
            Change::AtOnce => border::Change::AtOnce,
        })
    }

    /// Ends the run and completes its files.
    pub(crate) fn finish(self) -> (Outcome, Result<(), Failure>) {
        let player = self.player.into_inner().unwrap_or_else(PoisonError::into_inner);
        let session = self.session.into_inner().unwrap_or_else(PoisonError::into_inner);
        let done = session.finish(player);
        let outcome = Outcome {
            frames: done.outcome.driver_frames,
            seconds: done.outcome.seconds,
            not_finite_ticks: done.outcome.faults.ticks,
            lost_numbers: done.lost_numbers,
            failed_files: u32::try_from(done.failed.len()).unwrap_or(u32::MAX),
            panicked: u32::from(done.panicked),
        };
        let failed: Vec<String> = done.failed.iter().map(ToString::to_string).collect();
        let ended = match failed.is_empty() {
            true => Ok(()),
            false => Err(Failure::new(Status::System, failed.join("\n"))),
        };
        (outcome, ended)
    }
}

impl Setting {
    /// Sets the value. Real-time.
    pub(crate) fn set(&self, value: f64) -> Result<(), Status> {
        table::player(self.player, |player| {
            let mut session = try_lock(&player.session)?;
            let live = session.settings().find(|live| live.is_same_as(&self.live)).ok_or(Status::Name)?;
            let (node, setting) = (live.node, live.setting);
            session.set(node, setting, value).map_err(Status::from)
        })
    }

    /// The value set last, or that of the graph. Real-time.
    pub(crate) fn value(&self) -> Result<f64, Status> {
        table::player(self.player, |player| {
            let session = try_lock(&player.session)?;
            let mut all = session.settings();
            all.find(|live| live.is_same_as(&self.live)).map(|live| live.value).ok_or(Status::Name)
        })
    }
}
