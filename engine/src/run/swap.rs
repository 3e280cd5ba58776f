//! Swapping plans. The tables of state to transfer are made beforehand, outside the real-time thread, which only swaps
//! and copies. `decide.rs` chooses the mode of the swap.

mod decide;

pub use decide::{Change, NoCrossFade};

pub(super) use decide::SwapMode;

use super::Run;
use super::rings::TapRings;
use crate::frame::Kind;
use crate::limiter::Hottest;
use crate::plan::{BridgeWork, DelayPlan, NodeKey, Plan, Step, StepWork};
use decide::{Common, Facts, decide};
use haptograph_signal::time::Rate;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// A plan that is ready to replace the running one; after the swap it holds the old plan, to be freed.
pub(super) struct PlanSwap {
    pub(super) run: Run,
    pub mode: SwapMode,
    facts: Facts,
    /// Rings of its taps.
    pub rings: TapRings,
    pub transfers: Transfers,
}

/// What passes from the old plan to the new one: (old, new) indices.
pub(super) struct Transfers {
    processors: Vec<(usize, usize, StateTransfer)>,
    bridges: Vec<(usize, usize)>,
    delays: Vec<(usize, usize, StateTransfer)>,
    pub devices: Vec<(usize, usize)>,
    /// Actuators whose counts continue.
    actuators: Vec<(usize, usize)>,
    /// Those of them that drive the same channel of the same device: their heat continues too.
    pub drives: Vec<(usize, usize)>,
    /// Actuators of the old plan that the new one does not drive.
    removed_actuators: Vec<usize>,
    /// Actuators of the new plan that the old one did not drive.
    new_actuators: Vec<usize>,
    /// Ends of rings to other drivers that continue.
    pub readers: Vec<(usize, usize)>,
    pub writers: Vec<(usize, usize)>,
}

/// Transfer of state if the two plans do not run together. In a cross-fade all state is copied.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StateTransfer {
    /// Old and new state are swapped.
    Moved,
    /// The old state is copied: the settings differ, or several new states continue it.
    Copied,
}

impl PlanSwap {
    /// Prepares the swap. `has_time`: there is time for both plans to run in a tick.
    pub(super) fn new(old: &Plan, plan: Arc<Plan>, rings: TapRings, has_time: bool) -> Self {
        let places = old.processor_keys.iter().enumerate();
        let places: HashMap<&str, usize> = places.map(|(at, key)| (&*key.path, at)).collect();
        let mut processors = Vec::new();
        for (new_at, key) in plan.processor_keys.iter().enumerate() {
            if let Some(&old_at) = places.get(&*key.path) {
                let was = &old.processor_keys[old_at];
                if was == key {
                    processors.push((old_at, new_at, StateTransfer::Moved));
                } else if was.kind == key.kind {
                    processors.push((old_at, new_at, StateTransfer::Copied));
                }
            }
        }
        let devices = plan.devices.iter().enumerate().filter_map(|(new_at, device)| {
            let old_at = old.devices.iter().position(|was| was.key == device.key)?;
            Some((old_at, new_at))
        });
        let devices: Vec<(usize, usize)> = devices.collect();
        let gone = |old_at: &usize| {
            let driven = driven_by(old, *old_at);
            !(0..plan.actuators.len()).any(|new_at| driven_by(&plan, new_at) == driven)
        };
        let actuators = plan.actuators.iter().enumerate();
        let actuators = actuators.filter_map(|(new_at, actuator)| {
            // Matched by device and channel; by the sink's path only if the old device is gone.
            let driven = driven_by(&plan, new_at);
            let same = |old_at: &usize| driven.is_some() && driven_by(old, *old_at) == driven;
            let renamed = |old_at: &usize| old.actuators[*old_at].path == actuator.path && gone(old_at);
            let all = 0..old.actuators.len();
            let old_at = all.clone().find(same).or_else(|| all.clone().find(renamed))?;
            Some((old_at, new_at))
        });
        let actuators: Vec<(usize, usize)> = actuators.collect();
        let same_drive = |(from, to): &&(usize, usize)| {
            let driven = driven_by(old, *from);
            driven.is_some() && driven == driven_by(&plan, *to)
        };
        let drives: Vec<(usize, usize)> = actuators.iter().filter(same_drive).copied().collect();
        let leaves = |old_at: &usize| drives.iter().all(|(from, _)| from != old_at);
        let is_new = |new_at: &usize| drives.iter().all(|(_, to)| to != new_at);
        let delays = pairs(old, &plan, delay);
        let common = Common { devices: &devices, drives: &drives, delays: &delays };
        let facts = Facts::of(old, &plan, common, has_time);
        let mode = decide(&facts);
        let transfers = Transfers {
            removed_actuators: (0..old.actuators.len()).filter(leaves).collect(),
            new_actuators: (0..plan.actuators.len()).filter(is_new).collect(),
            bridges: pairs(old, &plan, bridge),
            delays: with_transfers(delays),
            devices,
            actuators,
            drives,
            processors,
            readers: Vec::new(),
            writers: Vec::new(),
        };
        Self { run: Run::new(plan), mode, facts, rings, transfers }
    }

    /// Notes that the new plan has ring ends that the old plan does not have.
    pub(super) fn add_new_rings(&mut self) {
        self.facts.gets_rings = true;
        self.mode = decide(&self.facts);
    }

    /// Takes over the whole state: both plans have the same graph.
    pub(super) fn take_over_in_place(&mut self, running: &mut Run) {
        std::mem::swap(&mut self.run.state, &mut running.state);
        std::mem::swap(&mut self.run, running);
    }

    /// Transfers matching state at the time that the old plan has reached, and swaps the plans.
    pub(super) fn take_over(&mut self, running: &mut Run, hottest: &Hottest) {
        let together = match self.mode {
            SwapMode::CrossFade => true,
            SwapMode::InPlace | SwapMode::FadeThroughZero(_) => false,
        };
        self.transfer_heat(running, hottest);
        let (old, new) = (&mut running.state, &mut self.run.state);
        for (from, to, transfer) in &self.transfers.processors {
            match transfer {
                StateTransfer::Moved if !together => {
                    std::mem::swap(&mut old.processors[*from], &mut new.processors[*to]);
                }
                _ => old.processors[*from].copy_state_into(new.processors[*to].as_mut()),
            }
            new.update_law(*to);
        }
        for (from, to) in &self.transfers.bridges {
            if let (Some(new), Some(old)) = (&mut new.bridges[*to], &old.bridges[*from]) {
                new.continue_from(&**old);
            }
        }
        for (from, to, transfer) in &self.transfers.delays {
            match transfer {
                StateTransfer::Moved if !together => {
                    std::mem::swap(&mut old.delays[*from], &mut new.delays[*to]);
                }
                _ => new.delays[*to].copy_state_from(&old.delays[*from]),
            }
        }
        for (from, to) in &self.transfers.devices {
            let (from_plan, to_plan) = (&running.plan.devices[*from], &self.run.plan.devices[*to]);
            new.devices[*to].take_over(&mut old.devices[*from], from_plan, to_plan);
        }
        for (from, to) in &self.transfers.readers {
            std::mem::swap(&mut old.ring_ends.readers[*from], &mut new.ring_ends.readers[*to]);
        }
        for (from, to) in &self.transfers.writers {
            std::mem::swap(&mut old.ring_ends.writers[*from], &mut new.ring_ends.writers[*to]);
        }
        self.run.init_gates();
        let (old, new) = (&mut running.state, &mut self.run.state);
        let frames = old.windows.driver_frames();
        new.windows.start_at(frames);
        new.faults.counts = std::mem::take(&mut old.faults.counts);
        std::mem::swap(&mut self.run, running);
    }
}

impl PlanSwap {
    /// Transfers limiter state. Heat belongs to the device: it continues for the same channel of the same device.
    fn transfer_heat(&mut self, running: &Run, hottest: &Hottest) {
        let (old, new) = (&running.state.actuators, &mut self.run.state.actuators);
        for (from, to) in &self.transfers.actuators {
            new[*to].limiter.count_on_from(&old[*from].limiter);
        }
        for (from, to) in &self.transfers.drives {
            new[*to].limiter.continue_from(&old[*from].limiter);
        }
        for old_at in &self.transfers.removed_actuators {
            old[*old_at].limiter.leave_to(hottest);
        }
        for new_at in &self.transfers.new_actuators {
            // It may be the same hardware as a removed actuator, under another name.
            new[*new_at].limiter.begin_as_any_of(hottest);
        }
    }
}

/// (old, new) indices of the items that `of` finds at matching steps of both plans.
fn pairs<K: PartialEq>(
    old: &Plan,
    new: &Plan,
    of: impl Fn(&Plan, &Step) -> Option<(usize, K)>,
) -> Vec<(usize, usize)> {
    let all = |plan: &Plan| -> HashMap<Arc<str>, Vec<(usize, K)>> {
        let mut all: HashMap<_, Vec<_>> = HashMap::new();
        for step in &plan.steps {
            if let Some(found) = of(plan, step) {
                all.entry(Arc::clone(&step.label)).or_default().push(found);
            }
        }
        all
    };
    let old = all(old);
    let mut pairs = Vec::new();
    for (label, found) in all(new) {
        for (to, key) in found {
            let mut same = old.get(&label).into_iter().flatten();
            // Several matches hold the same state.
            pairs.extend(same.find(|(_, was)| *was == key).map(|(from, _)| (*from, to)));
        }
    }
    pairs
}

/// Moves each old state to the last new state that continues it; the others get copies.
fn with_transfers(pairs: Vec<(usize, usize)>) -> Vec<(usize, usize, StateTransfer)> {
    let mut moved = HashSet::new();
    let transfer = |(from, to)| match moved.insert(from) {
        true => (from, to, StateTransfer::Moved),
        false => (from, to, StateTransfer::Copied),
    };
    let mut all: Vec<_> = pairs.into_iter().rev().map(transfer).collect();
    all.reverse();
    all
}

fn bridge(plan: &Plan, step: &Step) -> Option<(usize, (BridgeWork, Kind, Rate, Rate))> {
    let StepWork::Bridge(index) = step.work else {
        return None;
    };
    let bridge = &plan.bridges[index as usize];
    if let BridgeWork::Delay(_) = bridge.work {
        return None;
    }
    let rate = |clock: u32| plan.rates[clock as usize];
    let key = (bridge.work, bridge.kind, rate(bridge.from), rate(step.clock));
    Some((index as usize, key))
}

fn delay(plan: &Plan, step: &Step) -> Option<(usize, DelayPlan)> {
    let index = match step.work {
        StepWork::DelayRead(index) => index,
        StepWork::Bridge(index) => match plan.bridges[index as usize].work {
            BridgeWork::Delay(index) => index,
            _ => return None,
        },
        _ => return None,
    } as usize;
    Some((index, plan.delays[index]))
}

/// Key of the device that an actuator sink drives, and the channel.
fn driven_by(plan: &Plan, actuator: usize) -> Option<(&NodeKey, usize)> {
    plan.devices.iter().find_map(|device| {
        let mut sinks = device.driven_by.iter();
        let (_, channel, _) = sinks.find(|(sink, ..)| *sink == actuator)?;
        Some((&device.key, *channel))
    })
}
