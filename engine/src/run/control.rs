//! The control side of a live run.

use super::meter::{Meters, Wake};
use super::player::Progress;
use super::ramp::{PARAM_RAMP_S, ParamRamp};
use super::rings::TapRings;
use super::swap::{Change, PlanSwap};
use crate::node_id::NodeId;
use crate::plan::Plan;
use crate::settings::{LiveSetting, SettingId};
use rtrb::{Consumer, Producer};
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Capacity of the command ring.
pub(super) const COMMANDS: usize = 4096;
/// Cost of a plan frame by frame, as in a cross-fade, relative to blocks of 64: the largest ratio of the shipped graphs
/// (`haptograph bench --block 1` against `--block 64`). All steps count as equal.
const FRAME_BY_FRAME: f64 = 6.5;

/// A command to the real-time side.
pub(super) enum Command {
    Set(ParamRamp),
    Swap(Box<PlanSwap>),
}

/// A report of the real-time side.
pub(super) enum Report {
    Wake(Wake),
    /// An old plan, for the control side to free.
    Old(Box<PlanSwap>),
}

/// The control side of a live run.
pub struct Control {
    stop: Arc<AtomicBool>,
    commands: Producer<Command>,
    reports: Consumer<Report>,
    progress: Arc<Progress>,
    /// The running plan, or the one that will run after the last swap.
    plan: Arc<Plan>,
    /// The live settings with their last set values.
    settings: Vec<LiveSetting>,
    meters: Meters,
    /// Replaced plans that have not been returned yet: they may still drive their actuators.
    leaving: VecDeque<Arc<Plan>>,
    /// Number of replaced plans that have been freed.
    freed: u64,
}

/// Reason why a command was not sent.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ControlError {
    /// The command ring is full.
    #[error("the real-time side does not read its commands: {COMMANDS} are waiting")]
    Full,
    /// The new graph has another driver rate.
    #[error("the rate of the driver changed; start a new run")]
    OtherRate,
    /// The node does not have the setting, or it is not live.
    #[error("the node has no such live setting")]
    NotLive,
    /// The value is out of the setting's range.
    #[error("choose a value from {0} to {1}")]
    OutOfRange(f64, f64),
    /// The value is NaN or infinite.
    #[error("choose a finite number")]
    NotFinite,
}

/// No live setting of the running graph has the name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no live setting is called `{name}`{help}")]
pub struct UnknownSetting {
    /// The name.
    pub name: String,
    /// The closest name, or all names, as text.
    pub help: String,
}

/// Reason why a setting was not set by its name.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SetError {
    /// No live setting has the name.
    #[error(transparent)]
    Unknown(#[from] UnknownSetting),
    /// The value was not sent.
    #[error(transparent)]
    Control(#[from] ControlError),
}

/// A plan that is ready to replace the running one.
pub(super) struct Prepared {
    pub next: Box<PlanSwap>,
    plan: Arc<Plan>,
    /// The live settings after the swap, and those that ramp: index and new value.
    settings: Vec<LiveSetting>,
    changes: Vec<(usize, f64)>,
}

impl Control {
    pub(super) fn new(
        plan: Arc<Plan>,
        stop: Arc<AtomicBool>,
        (commands, reports): (Producer<Command>, Consumer<Report>),
        progress: Arc<Progress>,
    ) -> Self {
        Self {
            stop,
            commands,
            reports,
            progress,
            settings: plan.live.clone(),
            plan,
            meters: Meters::default(),
            leaving: VecDeque::new(),
            freed: 0,
        }
    }

    /// Sets a live setting of a node; it ramps to the value within [`PARAM_RAMP_S`].
    ///
    /// # Errors
    /// [`ControlError`] if the setting is not live, the value is invalid, or the command ring is full.
    pub fn set(&mut self, node: NodeId, setting: SettingId, value: f64) -> Result<(), ControlError> {
        let place = self.settings.iter().position(|live| (live.node, live.setting) == (node, setting));
        self.set_at(place.ok_or(ControlError::NotLive)?, value)
    }

    /// The live settings of the running graph with their last set values.
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

    /// Fades out and stops, also during a swap.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Replaces the running plan.
    ///
    /// A plan of the same graph continues without changing a bit; live settings that differ ramp to their new values.
    /// A plan of another graph cross-fades with the old one, or fades through zero if they cannot run together; nodes
    /// that both have keep their state. Settings that were changed live keep their values unless the file changes
    /// them too.
    ///
    /// # Errors
    /// [`ControlError`] if the driver's rate differs or the command ring is full.
    pub fn swap(&mut self, plan: Arc<Plan>) -> Result<Change, ControlError> {
        let prepared = self.prepare(plan, TapRings::default())?;
        self.put(prepared)
    }

    /// Prepares a swap without starting it. [`Control::put`] finds room for its commands unless others are sent before.
    pub(super) fn prepare(&self, plan: Arc<Plan>, rings: TapRings) -> Result<Prepared, ControlError> {
        if plan.driver_rate() != self.plan.driver_rate() {
            return Err(ControlError::OtherRate);
        }
        let mut settings = plan.live.clone();
        let mut changes = Vec::new();
        // The value set last, and the value in the old file.
        let both = self.settings.iter().zip(&self.plan.live);
        let known: HashMap<_, _> = both.map(|(was, written)| (was.name(), (was, written))).collect();
        for (place, live) in settings.iter_mut().enumerate() {
            let Some((was, written)) = known.get(&live.name()) else {
                continue;
            };
            let by_file = written.value.to_bits() != live.value.to_bits();
            // On a slower clock a frequency's range can end below the value set last.
            let start = match live.range {
                Some((_, high)) if was.value > high => high,
                Some((low, _)) if was.value < low => low,
                _ => was.value,
            };
            let wanted = if by_file || start != was.value { live.value } else { was.value };
            let in_new_plan = std::mem::replace(&mut live.value, start);
            if wanted.to_bits() != start.to_bits() || wanted.to_bits() != in_new_plan.to_bits() {
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
        // The new plan starts with the values set last; values that the file changes ramp from there.
        for (place, live) in settings.iter().enumerate() {
            next.run.set_live(place, live.value);
        }
        Ok(Prepared { next, plan, settings, changes })
    }

    /// Starts a prepared swap.
    pub(super) fn put(&mut self, prepared: Prepared) -> Result<Change, ControlError> {
        let Prepared { next, plan, settings, changes } = prepared;
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

    /// The running plan, or the one that will run after the last swap.
    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// The plans that may drive actuators now: [`plan`](Self::plan) and those not returned yet.
    pub(super) fn plans(&self) -> impl Iterator<Item = &Plan> {
        std::iter::once(&self.plan).chain(&self.leaving).map(|plan| &**plan)
    }

    /// Receives the reports of the real-time side, frees replaced plans and returns the meters.
    pub fn poll(&mut self) -> &Meters {
        while let Ok(report) = self.reports.pop() {
            match report {
                Report::Wake(wake) => self.meters.record(&wake),
                Report::Old(old) => {
                    drop(old);
                    // Plans return in the order in which they were replaced.
                    self.leaving.pop_front();
                    self.freed += 1;
                }
            }
        }
        &self.meters
    }

    /// The meters as of the last [`Control::poll`].
    pub fn meters(&self) -> &Meters {
        &self.meters
    }

    /// What the real-time side has done by now.
    pub(super) fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Number of replaced plans that have been freed.
    pub fn freed(&self) -> u64 {
        self.freed
    }

    fn send(&mut self, command: Command) -> Result<(), ControlError> {
        self.commands.push(command).map_err(|_| ControlError::Full)
    }
}
