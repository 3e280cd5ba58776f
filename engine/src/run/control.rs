//! The side of a live run from which it is changed.

use super::meter::{Meters, Wake};
use super::ramp::{PARAM_RAMP_S, ParamRamp};
use super::rings::TapRings;
use super::swap::{Change, PlanSwap};
use crate::graph::{LiveSetting, NodeId};
use crate::plan::Plan;
use rtrb::{Consumer, Producer};
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Commands that may wait for the real-time side.
pub(super) const COMMANDS: usize = 4096;
/// How much more work a plan is frame by frame, as two run together, than in blocks of 64: the most of the shipped graphs
/// (`haptograph bench --block 1` against `--block 64`). Steps count as alike.
const FRAME_BY_FRAME: f64 = 6.5;

/// What the real-time side is told.
pub(super) enum Command {
    Set(ParamRamp),
    Swap(Box<PlanSwap>),
}

/// What the real-time side sends back.
pub(super) enum Report {
    Wake(Wake),
    /// An old plan, to be freed where freeing is allowed.
    Old(Box<PlanSwap>),
}

/// The other side of a live run.
pub struct Control {
    stop: Arc<AtomicBool>,
    commands: Producer<Command>,
    reports: Consumer<Report>,
    /// The plan that runs, or will when the last swap is done.
    plan: Arc<Plan>,
    /// Its live settings as they were set last.
    settings: Vec<LiveSetting>,
    meters: Meters,
    /// The plans that were put out of their places, and are not home yet: they may still drive what they drove.
    leaving: VecDeque<Arc<Plan>>,
    /// Old plans that came home.
    freed: u64,
}

/// Why a command was not sent.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ControlError {
    /// The real-time side has not read its commands for a while.
    #[error("the real-time side does not take commands: {COMMANDS} are waiting")]
    Full,
    /// The new graph has another driver rate.
    #[error("the driver's rate changed; that needs a restart of the run")]
    OtherRate,
    /// The node has no such setting, or it cannot change while the graph runs.
    #[error("there is no live setting of that name")]
    NotLive,
    /// The value is not one that the setting can have.
    #[error("choose a value from {0} to {1}")]
    OutOfRange(f64, f64),
    /// It is NaN or infinite.
    #[error("choose a finite number")]
    NotFinite,
}

/// A plan that is ready to take over.
pub(super) struct Prepared {
    pub next: Box<PlanSwap>,
    plan: Arc<Plan>,
    /// Its live settings as they will be, and those that ramp there: their places, and where to.
    settings: Vec<LiveSetting>,
    changes: Vec<(usize, f64)>,
}

impl Control {
    pub(super) fn new(
        plan: Arc<Plan>,
        stop: Arc<AtomicBool>,
        commands: Producer<Command>,
        reports: Consumer<Report>,
    ) -> Self {
        Self {
            stop,
            commands,
            reports,
            settings: plan.live.clone(),
            plan,
            meters: Meters::default(),
            leaving: VecDeque::new(),
            freed: 0,
        }
    }

    /// Sets a live setting of a node; it glides there within [`PARAM_RAMP_S`].
    ///
    /// # Errors
    /// [`ControlError`] if it is no live setting, cannot have that value, or the real-time side does not read.
    pub fn set(&mut self, node: NodeId, setting: usize, value: f64) -> Result<(), ControlError> {
        let place = self
            .settings
            .iter()
            .position(|live| (live.node, live.setting) == (node, setting));
        self.set_at(place.ok_or(ControlError::NotLive)?, value)
    }

    /// Sets a live setting by its name: `out.gain`.
    ///
    /// # Errors
    /// As [`Control::set`].
    pub fn set_by_name(&mut self, name: &str, value: f64) -> Result<(), ControlError> {
        let place = self.settings.iter().position(|live| live.name() == name);
        self.set_at(place.ok_or(ControlError::NotLive)?, value)
    }

    /// The live settings of the graph that runs, as they were set last.
    pub fn settings(&self) -> &[LiveSetting] {
        &self.settings
    }

    fn set_at(&mut self, place: usize, value: f64) -> Result<(), ControlError> {
        let live = &self.settings[place];
        if !value.is_finite() {
            return Err(ControlError::NotFinite);
        }
        if let Some((low, high)) = live.range
            && !(low..=high).contains(&value)
        {
            return Err(ControlError::OutOfRange(low, high));
        }
        let ramp_s = if live.whole { 0.0 } else { PARAM_RAMP_S };
        let ramp = ParamRamp {
            place,
            from: live.value,
            to: value,
            begin: 0,
            frames: (ramp_s * self.plan.driver_rate().hz()).round() as u64,
        };
        self.send(Command::Set(ramp))?;
        self.settings[place].value = value;
        Ok(())
    }

    /// Fades out and stops, whatever else is under way.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Puts a new plan in the place of the one that runs. The same graph goes on without changing a bit, and where
    /// only live settings differ they ramp to their new values. Into another graph it fades while both run, or where
    /// they cannot, it falls to zero and the other rises from there; the state of the nodes that stayed is carried over.
    /// What was set by hand stays set where the file still says the same.
    ///
    /// # Errors
    /// [`ControlError`] if the driver's rate differs or the real-time side does not read.
    pub fn swap(&mut self, plan: Arc<Plan>) -> Result<Change, ControlError> {
        let prepared = self.prepare(plan, TapRings::default())?;
        self.put(prepared)
    }

    /// Lays out how a plan takes over. Nothing that runs knows of it yet; until something else is sent, [`Control::put`]
    /// finds room for it.
    pub(super) fn prepare(&self, plan: Arc<Plan>, rings: TapRings) -> Result<Prepared, ControlError> {
        if plan.driver_rate() != self.plan.driver_rate() {
            return Err(ControlError::OtherRate);
        }
        let mut settings = plan.live.clone();
        let mut changes = Vec::new();
        let name = |live: &LiveSetting| (live.path.clone(), live.field);
        // As they were set, and as the file said before.
        let both = self.settings.iter().zip(&self.plan.live);
        let known: HashMap<_, _> = both.map(|(was, written)| (name(was), (was, written))).collect();
        for (place, live) in settings.iter_mut().enumerate() {
            let Some((was, written)) = known.get(&name(live)) else {
                continue;
            };
            let by_file = written.value.to_bits() != live.value.to_bits();
            let possible = live
                .range
                .is_none_or(|(low, high)| (low..=high).contains(&was.value));
            let wanted = if by_file || !possible {
                live.value
            } else {
                was.value
            };
            let in_new_plan = std::mem::replace(&mut live.value, was.value);
            if wanted.to_bits() != was.value.to_bits() || wanted.to_bits() != in_new_plan.to_bits() {
                changes.push((place, wanted));
            }
        }
        if self.commands.slots() <= changes.len() {
            return Err(ControlError::Full);
        }
        let load = self.meters.load(plan.driver_rate().hz());
        let more = plan.step_count() as f64 / self.plan.step_count().max(1) as f64;
        let has_time = FRAME_BY_FRAME * load * (1.0 + more) <= 1.0;
        let mut next = Box::new(PlanSwap::new(&self.plan, Arc::clone(&plan), rings, has_time));
        // It begins with what was set by hand, and what the file says otherwise glides from there.
        for (place, live) in settings.iter().enumerate() {
            next.run.set_live(place, live.value);
        }
        Ok(Prepared {
            next,
            plan,
            settings,
            changes,
        })
    }

    /// Puts what was prepared in the place of the plan that runs.
    pub(super) fn put(&mut self, prepared: Prepared) -> Result<Change, ControlError> {
        let Prepared {
            next,
            plan,
            settings,
            changes,
        } = prepared;
        let mode = next.mode;
        let drives = |plan: &Plan| !plan.actuators.is_empty();
        let drives = drives(&self.plan) || drives(&plan);
        self.send(Command::Swap(next))?;
        self.leaving.push_back(std::mem::replace(&mut self.plan, plan));
        self.settings = settings;
        for (place, wanted) in &changes {
            self.set_at(*place, *wanted)?;
        }
        Ok(Change::of(mode, changes.len(), drives))
    }

    /// The plan that runs, or will when the last swap is done.
    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// The plans that may drive something now: the one that runs, or will, and those on their way out.
    pub(super) fn plans(&self) -> impl Iterator<Item = &Plan> {
        std::iter::once(&self.plan)
            .chain(&self.leaving)
            .map(|plan| &**plan)
    }

    /// Takes in what the real-time side reported since, frees what came home, and returns what was counted so far.
    pub fn poll(&mut self) -> &Meters {
        while let Ok(report) = self.reports.pop() {
            match report {
                Report::Wake(wake) => self.meters.record(&wake),
                Report::Old(old) => {
                    drop(old);
                    // They come in the order in which they were put out of their places.
                    self.leaving.pop_front();
                    self.freed += 1;
                }
            }
        }
        &self.meters
    }

    /// What was counted by the last [`Control::poll`].
    pub fn meters(&self) -> &Meters {
        &self.meters
    }

    /// Old plans that came home to be freed.
    pub fn freed(&self) -> u64 {
        self.freed
    }

    fn send(&mut self, command: Command) -> Result<(), ControlError> {
        self.commands.push(command).map_err(|_| ControlError::Full)
    }
}
