//! Virtual time: runs the players of all drivers as fast as the processor allows, connected by the same rings as live.
//!
//! Time advances in quanta of at most a millisecond, as the wake-ups of timers do. In each quantum every driver first
//! polls its rings and then runs the frames that are due; so the samples depend neither on the order of the drivers nor
//! on the block size. A quantum of a single driver is a whole block. Nothing real is heard.

use super::async_resampler::{RingMeter, reserve_s};
use super::player::{Player, PlayerState, player};
use super::ring_edges::connect;
use super::{Faults, Run};
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
    /// Length of a quantum in units of the common time base.
    quantum: u128,
    /// Number of quanta run.
    quanta: u128,
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

    /// The clock of these players, one for each driver of a graph, and of the rings between them.
    pub(super) fn new(players: Vec<Player>, rings: Vec<Arc<RingMeter>>) -> Self {
        let plans: Vec<&Plan> = players.iter().map(|player| &*player.run().plan).collect();
        let reserves = plans.iter().flat_map(|plan| &plan.ring_reads).map(|read| reserve_s(&read.ring));
        let quantum_s =
            reserves.fold(QUANTUM_S, |quantum_s, reserve_s| quantum_s.min(PART_OF_RESERVE * reserve_s));
        let quantum = match &plans[..] {
            [alone] => u128::from(alone.base.period(alone.driver)) * alone.block as u128,
            _ => {
                let units = plans.first().map_or(1.0, |plan| plan.base.units_per_second());
                ((quantum_s * units) as u128).max(1)
            }
        };
        let count = players.len();
        let (drifts, due) = (vec![0; count], vec![0; count]);
        Self { players, rings, quantum, quanta: 0, drifts, longest: MAX_BLOCK, due }
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
        self.quanta += 1;
        for driver in 0..self.players.len() {
            self.due[driver] = self.due(driver);
            self.players[driver].begin();
        }
        for (driver, (player, frames)) in self.players.iter_mut().zip(&self.due).enumerate() {
            by(driver, player, *frames);
        }
    }

    /// Length of a quantum, s.
    pub fn quantum_s(&self) -> f64 {
        let units = self.runs().next().map(|run| run.plan.base.units_per_second());
        self.quantum as f64 / units.unwrap_or(1.0)
    }

    /// Frames of a driver that are due before the end of this quantum.
    fn due(&self, driver: usize) -> usize {
        let player = &self.players[driver];
        let plan = &player.run().plan;
        let period = u128::from(plan.base.period(plan.driver));
        let speed = BILLION.saturating_add_signed(self.drifts[driver].into());
        let frames = (self.quanta * self.quantum * speed).div_ceil(period * BILLION);
        let frames = u64::try_from(frames).unwrap_or(u64::MAX).min(player.end().unwrap_or(u64::MAX));
        frames.saturating_sub(player.run().driver_frames()) as usize
    }

    /// True if all drivers have ended.
    pub fn is_over(&self) -> bool {
        self.players.iter().all(|player| player.end().is_some_and(|end| player.run().driver_frames() >= end))
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
    pub(super) fn into_players(self) -> Vec<Player> {
        self.players
    }

    /// Meters of the rings between the drivers.
    pub fn rings(&self) -> &[Arc<RingMeter>] {
        &self.rings
    }
}
