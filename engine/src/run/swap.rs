//! Putting one plan in the place of another: the table of what is carried over is made beforehand, elsewhere; in the
//! real-time thread things only change places.

use super::Run;
use super::rings::TapRings;
use crate::plan::Plan;
use std::collections::HashMap;
use std::sync::Arc;

/// A plan ready to take over, and afterwards the old one on its way home.
pub(super) struct Next {
    run: Run,
    pub transfer: Transfer,
    /// Where its taps go.
    pub rings: TapRings,
    processors: Vec<(usize, usize, Carry)>,
    devices: Vec<(usize, usize)>,
    actuators: Vec<(usize, usize)>,
    /// Those of the new plan whose device the old one did not drive.
    strangers: Vec<usize>,
}

/// How much of the old plan goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Transfer {
    /// The graphs are the same: all state goes on, and no bit changes.
    Everything,
    /// Nodes, devices and limiters that are in both.
    Matching,
}

/// How a node's state is carried over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Carry {
    /// The node is the same: the processor itself changes places.
    Whole,
    /// The same kind with other settings: it copies what it can.
    Copied,
}

impl Next {
    pub(super) fn new(old: &Plan, plan: Arc<Plan>, rings: TapRings) -> Self {
        let same = old.is_same_as(&plan);
        let places = old.processor_keys.iter().enumerate();
        let places: HashMap<&str, usize> = places.map(|(at, key)| (&*key.path, at)).collect();
        let mut processors = Vec::new();
        for (new_at, key) in plan.processor_keys.iter().enumerate() {
            if let Some(&old_at) = places.get(&*key.path) {
                let was = &old.processor_keys[old_at];
                if was == key {
                    processors.push((old_at, new_at, Carry::Whole));
                } else if was.kind == key.kind {
                    processors.push((old_at, new_at, Carry::Copied));
                }
            }
        }
        let devices = plan.devices.iter().enumerate().filter_map(|(new_at, device)| {
            let old_at = old.devices.iter().position(|was| was.key == device.key)?;
            Some((old_at, new_at))
        });
        let actuators = plan
            .actuators
            .iter()
            .enumerate()
            .filter_map(|(new_at, actuator)| {
                // Heat is the device's, whatever the sink is called.
                let driven = driven_by(&plan, new_at);
                let same = |old_at: &usize| driven.is_some() && driven_by(old, *old_at) == driven;
                let by_name = || old.actuators.iter().position(|was| was.path == actuator.path);
                let old_at = (0..old.actuators.len()).find(same).or_else(by_name)?;
                Some((old_at, new_at))
            });
        let actuators: Vec<(usize, usize)> = actuators.collect();
        let known = |new_at: &usize| actuators.iter().any(|(_, known)| known == new_at);
        Self {
            devices: devices.collect(),
            strangers: (0..plan.actuators.len())
                .filter(|new_at| !known(new_at))
                .collect(),
            actuators,
            processors,
            rings,
            transfer: if same {
                Transfer::Everything
            } else {
                Transfer::Matching
            },
            run: Run::new(plan),
        }
    }

    /// The new plan's graph is the old one's: its state changes places with the old one's as a whole.
    pub(crate) fn take_over_everything(&mut self, running: &mut Run) {
        std::mem::swap(&mut self.run.state, &mut running.state);
        std::mem::swap(&mut self.run, running);
    }

    /// Carries over what matches, at the time that the old plan has reached, and changes places with it.
    pub(crate) fn take_over(&mut self, running: &mut Run) {
        let (old, new) = (&mut running.state, &mut self.run.state);
        for (from, to, carry) in &self.processors {
            match carry {
                Carry::Whole => std::mem::swap(&mut old.processors[*from], &mut new.processors[*to]),
                Carry::Copied => old.processors[*from].copy_state_into(new.processors[*to].as_mut()),
            }
            new.renew_single(*to);
        }
        for (from, to) in &self.devices {
            let (old, new) = (&mut old.devices[*from], &mut new.devices[*to]);
            std::mem::swap(old, new);
            // Which place is which channel's is the plan's, and all were given zero last.
            std::mem::swap(&mut old.written, &mut new.written);
        }
        for (from, to) in &self.actuators {
            new.actuators[*to]
                .limiter
                .go_on_for(&old.actuators[*from].limiter);
        }
        for new_at in &self.strangers {
            // A plan before the old one may have, or the device has another name now.
            new.actuators[*new_at].limiter.begin_spent();
        }
        let frames = old.windows.driver_frames();
        new.windows.start_at(frames);
        new.faults = old.faults;
        std::mem::swap(&mut self.run, running);
    }
}

/// The device that an actuator sink drives, and the channel.
fn driven_by(plan: &Plan, actuator: usize) -> Option<(&str, usize)> {
    plan.devices.iter().find_map(|device| {
        let mut sinks = device.driven_by.iter();
        let (_, channel, _) = sinks.find(|(sink, ..)| *sink == actuator)?;
        Some((device.name.as_str(), *channel))
    })
}
