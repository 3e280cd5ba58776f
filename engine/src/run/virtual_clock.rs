//! Virtual time: runs the players of all drivers as fast as the processor allows, connected by the same rings as live.
//!
//! Time advances in quanta of at most a millisecond, as the wake-ups of timers do. In each quantum every driver first
//! polls its rings and then runs the frames that are due; so the samples depend neither on the order of the drivers nor
//! on the block size, nor on how a caller cuts the time. A quantum of a single driver is a whole block. Nothing real is heard.

use super::async_resampler::{AsyncResamplerReader, RingMeter};
use super::player::{Player, PlayerState, player};
use super::ring_edges::connect;
use super::{Faults, Run, Session};
use crate::plan::{MAX_BLOCK, Plan, Planner};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const QUANTUM_S: f64 = 1e-3;
/// A quantum takes at most this part of a ring's reserve.
const PART_OF_RESERVE: f64 = 0.25;
const BILLION: u128 = 1_000_000_000;

/// The clock of players that nothing real drives.
pub struct VirtualClock {
    players: Vec<Player>,
    rings: Vec<Arc<RingMeter>>,
    /// Driver frames of each player so far.
    done: Vec<u64>,
    /// Length of a frame of each driver, in units of a common time base, of which a second has `units_per_second`. They hold
    /// for every graph that takes over.
    periods: Vec<u128>,
    units_per_second: f64,
    /// Time up to which the players have run, and the end of the present quantum.
    now: u128,
    end: u128,
    /// Deviation of each driver from its nominal rate, in parts per 10^9.
    drifts: Vec<i64>,
    /// Largest block in driver frames.
    longest: usize,
    /// Frames of each driver in the present quantum.
    due: Vec<usize>,
}

impl VirtualClock {
    /// Makes connected players of the plans of [`Plan::of`], without a session.
    pub fn of(plans: &[Arc<Plan>]) -> Self {
        let mut players: Vec<Player> = plans.iter().map(|plan| player(Arc::clone(plan)).0).collect();
        let rings = connect(&mut players.iter_mut().map(Player::run_mut).collect::<Vec<_>>());
        Self::new(players, rings)
    }

    /// The clock of the players of a session, in the order of the graph.
    pub fn running(players: Vec<Player>, session: &Session) -> Self {
        Self::new(players, session.ring_meters())
    }

    fn new(players: Vec<Player>, rings: Vec<Arc<RingMeter>>) -> Self {
        let period = |player: &Player| {
            let plan = &player.run().plan;
            u128::from(plan.base.period(plan.driver))
        };
        let periods = players.iter().map(period).collect();
        let units = players.first().map_or(1.0, |player| player.run().plan.base.units_per_second());
        let count = players.len();
        let (done, drifts, due) = (vec![0; count], vec![0; count], vec![0; count]);
        let (units_per_second, longest) = (units, MAX_BLOCK);
        Self { players, rings, done, periods, units_per_second, now: 0, end: 0, drifts, longest, due }
    }

    /// Makes each driver faster than nominal by `ppm` parts per million, to test drift.
    #[must_use]
    pub fn drifting(mut self, ppm: &[f64]) -> Self {
        for (drift, ppm) in self.drifts.iter_mut().zip(ppm) {
            *drift = (ppm * 1e3).round() as i64;
        }
        self
    }

    /// Ends each driver after `seconds` of its own time.
    #[must_use]
    pub fn ending_after(mut self, seconds: f64) -> Self {
        self.players.iter_mut().for_each(|player| player.end_after_seconds(seconds));
        self
    }

    /// Runs a quantum and calls `each` after every block of every driver. Real-time code, like [`Player::process`].
    pub fn run_quantum(&mut self, mut each: impl FnMut(usize, &Run)) {
        let longest = self.longest;
        self.run_quantum_by(|driver, player, mut left| {
            while left > 0 {
                let part = left.min(longest);
                player.run_due(part, &mut |run, _| each(driver, run));
                left -= part;
            }
        });
    }

    /// Runs a quantum in which `by` runs the frames of each player.
    pub(super) fn run_quantum_by(&mut self, mut by: impl FnMut(usize, &mut Player, usize)) {
        self.begin_quantum();
        self.now = self.end;
        for driver in 0..self.players.len() {
            let most =
                self.players[driver].end().map_or(u64::MAX, |end| end.saturating_sub(self.done[driver]));
            self.due[driver] = self.due(driver).min(most) as usize;
        }
        for (driver, (player, frames)) in self.players.iter_mut().zip(&self.due).enumerate() {
            self.done[driver] += *frames as u64;
            by(driver, player, *frames);
        }
    }

    /// Runs `frames` frames of the first driver, and of the others those that are due by then. Commands take effect before
    /// them. Real-time code, like [`Player::process`].
    pub fn process(&mut self, frames: usize) {
        let until = self.now + self.periods.first().map_or(0, |period| period * frames as u128);
        while self.now < until {
            if self.now == self.end {
                self.begin_quantum();
            }
            self.now = until.min(self.end);
            for driver in 0..self.players.len() {
                let due = self.due(driver);
                if due > 0 {
                    self.done[driver] += due;
                    self.players[driver].process_in_quantum(due as usize, &mut |_, _| {});
                }
            }
        }
    }

    fn begin_quantum(&mut self) {
        self.end = self.now + self.quantum();
        self.players.iter_mut().for_each(Player::begin);
    }

    /// Length of a quantum of the present plans, in units.
    fn quantum(&self) -> u128 {
        if let [alone] = &self.players[..] {
            return self.periods[0] * alone.block() as u128;
        }
        let readers = self.runs().flat_map(|run| run.state.ring_ends.readers.iter().flatten());
        let quantum_s = readers
            .map(AsyncResamplerReader::reserve_s)
            .fold(QUANTUM_S, |quantum_s, reserve_s| quantum_s.min(PART_OF_RESERVE * reserve_s));
        ((quantum_s * self.units_per_second) as u128).max(1)
    }

    /// Length of a quantum, s.
    pub fn quantum_s(&self) -> f64 {
        self.quantum() as f64 / self.units_per_second
    }

    /// Frames of a driver that are due by now.
    fn due(&self, driver: usize) -> u64 {
        let speed = BILLION.saturating_add_signed(self.drifts[driver].into());
        let frames = (self.now * speed).div_ceil(self.periods[driver] * BILLION);
        u64::try_from(frames).unwrap_or(u64::MAX).saturating_sub(self.done[driver])
    }

    /// True if all drivers have ended.
    pub fn is_over(&self) -> bool {
        self.players.iter().all(|player| player.end().is_some_and(|end| player.run().driver_frames() >= end))
    }

    /// Frames that the first driver has run.
    pub fn frames(&self) -> u64 {
        self.players.first().map_or(0, Player::frames)
    }

    /// Length of the longest block in frames of the first driver.
    pub fn block(&self) -> usize {
        self.players.first().map_or(1, Player::block)
    }

    /// True if every run has ended and every actuator is at zero.
    pub fn is_idle(&self) -> bool {
        self.players.iter().all(Player::is_idle)
    }

    /// True if a player has ended while others run; they must then be stopped.
    pub fn is_partly_idle(&self) -> bool {
        !self.is_idle() && self.players.iter().any(Player::is_idle)
    }

    /// True if a node panicked.
    pub(super) fn has_panicked(&self) -> bool {
        self.players.iter().any(|player| player.state() == PlayerState::Panicked)
    }

    /// Path of the first node upstream of the first faulted sink whose output is NaN or infinite; `None` when stopped.
    ///
    /// Repeats the run frame by frame, so that the result does not depend on the block size.
    pub(super) fn origin(
        planner: Planner<'_>,
        plans: &[Arc<Plan>],
        seconds: f64,
        stop: &AtomicBool,
    ) -> Option<Arc<str>> {
        let fresh = || Self::of(plans).ending_after(seconds);
        let faulted = fresh().until_a_fault(stop)?;
        let sink = faulted.runs().find_map(Run::first_faulted_sink)?;
        let upstream_candidates = planner.leading_to(sink);
        let mut clock = fresh();
        clock.players.iter_mut().for_each(|player| player.run_mut().trace_fault(&upstream_candidates));
        let watched = clock.until_a_fault(stop)?;
        Faults::of(watched.runs().map(Run::faults)).origin
    }

    /// Runs to the quantum in which an actuator first receives NaN or infinity; `None` when stopped.
    fn until_a_fault(mut self, stop: &AtomicBool) -> Option<Self> {
        self.longest = 1;
        while !self.is_over() && self.runs().all(|run| run.faults().ticks == 0) {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            self.run_quantum(|_, _| {});
        }
        Some(self)
    }

    /// The runs, in the order of the graph's drivers.
    pub fn runs(&self) -> impl Iterator<Item = &Run> {
        self.players.iter().map(Player::run)
    }

    pub(super) fn players_mut(&mut self) -> &mut [Player] {
        &mut self.players
    }

    /// Ends the clock.
    pub fn into_players(self) -> Vec<Player> {
        self.players
    }

    /// Meters of the rings between the drivers.
    pub fn rings(&self) -> &[Arc<RingMeter>] {
        &self.rings
    }
}
