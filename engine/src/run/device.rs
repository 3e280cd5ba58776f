//! The devices of a running plan.

use super::arrivals::{InputLog, InputScript};
use crate::device::Device;
use crate::plan::DevicePlan;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A device as it is, and what it was given.
pub(super) struct DeviceState {
    pub device: Box<dyn Device>,
    started: bool,
    /// What each of the plan's writes gave it last.
    pub written: Vec<[f64; 6]>,
    /// It panicked on the way down, and is driven no more.
    pub lost: bool,
    pub ownership: Ownership,
    /// What each of the plan's reads is given at this tick, where the device is not this plan's alone.
    sensed: Vec<Box<[f64]>>,
    /// Where what it senses is kept, of a live input.
    pub log: Option<InputLog>,
    /// What it senses in its place, in a replay.
    pub script: Option<InputScript>,
}

/// Whose the device is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ownership {
    /// Its one plan's.
    Exclusive,
    /// This plan's, but it was moved and read beforehand, for another plan too.
    Primary,
    /// Another plan's: this one is given what it senses, and does not drive it.
    Shadow,
}

impl DeviceState {
    pub(super) fn new(plan: &DevicePlan) -> Self {
        Self {
            device: plan.device.clone_box(),
            started: false,
            written: vec![[0.0; 6]; plan.writes.len()],
            lost: false,
            ownership: Ownership::Exclusive,
            sensed: plan
                .reads
                .iter()
                .map(|(_, placing, _)| vec![0.0; placing.width as usize].into())
                .collect(),
            log: None,
            script: None,
        }
    }

    /// The device goes on here, with what it was given last. Which place is which channel's is the plan's.
    pub(super) fn take_over(&mut self, other: &mut Self, other_plan: &DevicePlan, plan: &DevicePlan) {
        std::mem::swap(&mut self.device, &mut other.device);
        (self.started, self.lost) = (other.started, other.lost);
        for ((.., channel), written) in plan.writes.iter().zip(&mut self.written) {
            let mut known = other_plan.writes.iter().zip(&other.written);
            if let Some((_, last)) = known.find(|((.., was), _)| was == channel) {
                *written = *last;
            }
        }
    }

    /// Moves the device to its next tick and keeps what it senses, for this plan and for the one that follows.
    pub(super) fn sense_for_both(
        &mut self,
        plan: &DevicePlan,
        follower: &mut Self,
        follower_plan: &DevicePlan,
    ) {
        self.advance();
        for ((.., channel), lanes) in plan.reads.iter().zip(&mut self.sensed) {
            self.device.read(*channel, lanes);
        }
        for ((.., channel), lanes) in follower_plan.reads.iter().zip(&mut follower.sensed) {
            match plan.reads.iter().position(|(.., known)| known == channel) {
                // Read once: to read may be to take.
                Some(known) => lanes.copy_from_slice(&self.sensed[known]),
                None => self.device.read(*channel, lanes),
            }
        }
    }

    /// Fills one frame of the plan's read number `read`, of `channel`.
    pub(super) fn read(&mut self, read: usize, channel: usize, frame: &mut [f64]) {
        match (&mut self.script, self.ownership) {
            (Some(script), _) => script.read(frame),
            (None, Ownership::Exclusive) => self.device.read(channel, frame),
            (None, Ownership::Primary | Ownership::Shadow) => frame.copy_from_slice(&self.sensed[read]),
        }
        if let Some(log) = &mut self.log {
            log.note(frame);
        }
    }

    /// All that the plan reads at this tick was read.
    pub(super) fn end_tick(&mut self) {
        if let Some(log) = &mut self.log {
            log.end_tick();
        }
    }

    /// Moves the body to the plan's next tick, if nobody else did.
    pub(super) fn advance_unless_shared(&mut self) {
        if self.ownership == Ownership::Exclusive {
            self.advance();
        }
    }

    /// Moves the body to the next tick; at tick 0 it is where it was built.
    pub(super) fn advance(&mut self) {
        match &mut self.script {
            Some(script) => script.advance(),
            None if self.started => self.device.advance(),
            None => {}
        }
        self.started = true;
    }

    /// Does something with the device, outside the plan, unless it has panicked at that.
    pub(super) fn unless_lost(&mut self, work: impl FnOnce(&mut Self)) {
        if !self.lost {
            self.lost = catch_unwind(AssertUnwindSafe(|| work(self))).is_err();
        }
    }
}
