//! Players: the real-time half of a run, and the half that may wait, behind one handle.

use crate::border::{Outcome, State, Status};
use crate::channels;
use crate::failure::Failure;
use crate::table::{self, Entry, held};
use haptograph_engine::graph::{Graph, NodeId};
use haptograph_engine::host::{AnyOutput, PlayOptions, Player};
use haptograph_engine::run::{LiveState, Session};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// What one call may be asked to process: 11 minutes at 48 kHz. More is taken for a mistake.
const MOST_FRAMES: usize = 1 << 25;
/// Live settings that a message lists at most.
const MOST_LISTED: usize = 20;

/// How a graph is to be played.
pub struct Wanted<'a> {
    pub rested: bool,
    pub folder: Option<PathBuf>,
    pub probes: Vec<&'a str>,
    pub block: usize,
    pub seconds: f64,
}

/// A run. Its halves exclude only those who want the same half.
pub struct PlayerEntry {
    player: Mutex<Player>,
    session: Mutex<Session>,
    /// As after the last call of `process`, for any thread.
    state: AtomicU32,
    frames: AtomicU64,
    stop: Arc<AtomicBool>,
}

/// A live setting of a player.
pub struct Setting {
    player: u64,
    node: NodeId,
    setting: usize,
}

/// Opens a player of a graph; its handle.
pub fn open(graph: &Graph, wanted: Wanted<'_>) -> Result<u64, Failure> {
    if !wanted.seconds.is_finite() || wanted.seconds < 0.0 {
        let message = "`seconds` is how long the run lasts, or 0 for as long as it is processed";
        return Err(Failure::new(Status::Argument, message));
    }
    if wanted.block > 1 << 16 {
        let message = "`block` is the driver frames of a block, at most 65536, or 0";
        return Err(Failure::new(Status::Argument, message));
    }
    let mut options = PlayOptions::default();
    options.probes = wanted.probes.iter().map(|name| (*name).to_owned()).collect();
    options.folder = wanted.folder;
    options.live.rested = wanted.rested;
    options.live.block = wanted.block;
    options.live.seconds = (wanted.seconds > 0.0).then_some(wanted.seconds);
    let stop = Arc::clone(&options.live.stop);
    let (player, session) = Player::open(graph, &options)?;
    let entry = PlayerEntry {
        player: Mutex::new(player),
        session: Mutex::new(session),
        state: AtomicU32::new(State::Running as u32),
        frames: AtomicU64::new(0),
        stop,
    };
    // Some systems make a lock when it is first taken.
    drop((entry.player.lock(), entry.session.lock()));
    Ok(table::insert(Entry::Player(Box::new(entry)))?)
}

impl PlayerEntry {
    /// Runs it on. Real-time.
    pub fn process(&self, frames: usize) -> Result<(), Status> {
        if frames > MOST_FRAMES {
            return Err(Status::Argument);
        }
        let mut player = held(&self.player)?;
        player.process(frames);
        self.frames.store(player.frames(), Ordering::Relaxed);
        let state = match player.state() {
            LiveState::Running => State::Running,
            LiveState::Stopped => State::Stopped,
            LiveState::Finished => State::Finished,
            LiveState::Panicked => State::Panicked,
        };
        self.state.store(state as u32, Ordering::Relaxed);
        match state {
            State::Running => Ok(()),
            _ => Err(Status::Ended),
        }
    }

    /// What it was doing after the last call of `process`. Real-time.
    pub fn state(&self) -> State {
        [State::Running, State::Stopped, State::Finished]
            .into_iter()
            .find(|state| *state as u32 == self.state.load(Ordering::Relaxed))
            .unwrap_or(State::Panicked)
    }

    /// Driver frames run so far. Real-time.
    pub fn frames(&self) -> u64 {
        self.frames.load(Ordering::Relaxed)
    }

    /// Fades out from the next call of `process` on. Real-time.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// The frames of a probe.
    pub fn probe(&self, name: &str, components: u32) -> Result<AnyOutput, Failure> {
        channels::probe(&mut *held(&self.player)?, name, components)
    }

    /// Where the live setting of this name is.
    pub fn setting(&self, player: u64, name: &str) -> Result<Setting, Failure> {
        let session = held(&self.session)?;
        let found = session.settings().find(|live| live.name() == name);
        let Some(live) = found else {
            let names: Vec<String> = session.settings().map(|live| live.name()).collect();
            let more = if names.len() > MOST_LISTED { ", ..." } else { "" };
            let names = names[..names.len().min(MOST_LISTED)].join(", ");
            let message = format_args!("the graph has no live setting `{name}`: it has {names}{more}");
            return Err(Failure::new(Status::Name, message));
        };
        Ok(Setting {
            player,
            node: live.node,
            setting: live.setting,
        })
    }

    /// Sets a live setting by its name.
    pub fn set(&self, name: &str, value: f64) -> Result<(), Failure> {
        let setting = self.setting(0, name)?;
        held(&self.session)?
            .set(setting.node, setting.setting, value)
            .map_err(|error| Failure::new(error.into(), format_args!("`{name}`: {error}")))
    }

    /// Ends the run and completes its files.
    pub fn finish(self) -> (Outcome, Result<(), Failure>) {
        let player = self.player.into_inner().unwrap_or_else(PoisonError::into_inner);
        let session = self.session.into_inner().unwrap_or_else(PoisonError::into_inner);
        let done = player.finish(session);
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
    /// Sets it. Real-time.
    pub fn set(&self, value: f64) -> Result<(), Status> {
        table::player(self.player, |player| {
            held(&player.session)?
                .set(self.node, self.setting, value)
                .map_err(Status::from)
        })
    }
}
