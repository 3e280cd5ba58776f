//! Players: one handle for the real-time half of a run and the half that may block.

use crate::border::{Outcome, State, Status};
use crate::channels;
use crate::failure::Failure;
use crate::table::{self, Entry, try_lock};
use haptograph_engine::graph::{Graph, NodeId};
use haptograph_engine::host::AnyOutput;
use haptograph_engine::node::SettingId;
use haptograph_engine::run::{Player, PlayerState, Session, SessionOptions};
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
}

/// A live setting of a player.
pub(crate) struct Setting {
    player: u64,
    node: NodeId,
    setting: SettingId,
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
    options.folder = request.folder;
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
        let found = session.find_setting(name);
        let (node, setting) = found.map_err(|unknown| Failure::new(Status::Name, unknown))?;
        Ok(Setting { player, node, setting })
    }

    /// Sets a live setting by its name.
    pub(crate) fn set(&self, name: &str, value: f64) -> Result<(), Failure> {
        let setting = self.setting(0, name)?;
        try_lock(&self.session)?
            .set(setting.node, setting.setting, value)
            .map_err(|error| Failure::new(error.into(), format_args!("`{name}`: {error}")))
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
            try_lock(&player.session)?.set(self.node, self.setting, value).map_err(Status::from)
        })
    }
}
