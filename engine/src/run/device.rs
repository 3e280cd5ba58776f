//! The devices of a running plan.

use super::arm::ArmGate;
use super::arrivals::{InputLog, InputScript};
use crate::device::Device;
use crate::plan::DevicePlan;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// State of a device in a run.
pub(super) struct DeviceState {
    pub device: Box<dyn Device>,
    started: bool,
    /// Gate between the limiters and the device, if it is to be armed.
    pub gate: Option<ArmGate>,
    /// Last frame of each of the plan's writes, before the gate.
    pub written: Vec<[f64; 6]>,
    /// True if the device panicked during the ramp to zero. It then receives no further output.
    pub lost: bool,
    pub ownership: Ownership,
    /// Frame of each of the plan's reads at this tick, while two plans share the device.
    sensed: Vec<Box<[f64]>>,
    /// Replay log of a live input.
    pub log: Option<InputLog>,
    /// Replayed values of a live input.
    pub script: Option<InputScript>,
}

/// The plan that owns a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ownership {
    /// This plan, which is the only one.
    Exclusive,
    /// This plan, which shares the sensed values with another plan.
    Primary,
    /// Another plan: this one reads the shared values and does not drive the device.
    Shadow,
}

impl DeviceState {
    pub(super) fn new(plan: &DevicePlan) -> Self {
        Self {
            device: plan.device.clone_box(),
            started: false,
            gate: None,
            written: vec![[0.0; 6]; plan.writes.len()],
            lost: false,
            ownership: Ownership::Exclusive,
            sensed: plan.reads.iter().map(|(place, _)| vec![0.0; place.width as usize].into()).collect(),
            log: None,
            script: None,
        }
    }

    /// Takes over the device and its last frames, matched by channel.
    pub(super) fn take_over(&mut self, other: &mut Self, other_plan: &DevicePlan, plan: &DevicePlan) {
        std::mem::swap(&mut self.device, &mut other.device);
        (self.started, self.lost) = (other.started, other.lost);
        match (&mut self.gate, &mut other.gate) {
            (Some(gate), Some(other)) => gate.continue_from(other),
            (gate @ None, other) => std::mem::swap(gate, other),
            (Some(_), None) => {}
        }
        for ((.., channel), written) in plan.writes.iter().zip(&mut self.written) {
            let mut known = other_plan.writes.iter().zip(&other.written);
            if let Some((_, last)) = known.find(|((.., was), _)| was == channel) {
                *written = *last;
            }
        }
    }

    /// Advances the device by a tick and reads it for this plan and for the shadow plan.
    pub(super) fn sense_for_both(&mut self, plan: &DevicePlan, shadow: &mut Self, shadow_plan: &DevicePlan) {
        self.advance();
        for ((.., channel), components) in plan.reads.iter().zip(&mut self.sensed) {
            self.device.read(*channel, components);
        }
        for ((.., channel), components) in shadow_plan.reads.iter().zip(&mut shadow.sensed) {
            match plan.reads.iter().position(|(.., known)| known == channel) {
                // Read once: reading can consume a value.
                Some(known) => components.copy_from_slice(&self.sensed[known]),
                None => self.device.read(*channel, components),
            }
        }
    }

    /// Fills a frame of the plan's read number `read`, of `channel`.
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

    /// Ends the reads of a tick.
    pub(super) fn end_tick(&mut self) {
        if let Some(log) = &mut self.log {
            log.end_tick();
        }
    }

    /// Passes a limited frame to the device, times the gain of the arm gate. Nothing else writes to a device.
    pub(super) fn write(&mut self, channel: usize, frame: &[f64]) {
        match &mut self.gate {
            Some(gate) => {
                let gated = gate.pass(channel, frame);
                self.device.write(channel, &gated[..frame.len()]);
            }
            None => self.device.write(channel, frame),
        }
    }

    /// Advances the device by a tick, unless two plans share it.
    pub(super) fn advance_unless_shared(&mut self) {
        if self.ownership == Ownership::Exclusive {
            self.advance();
        }
    }

    /// Advances the device by a tick; the first call leaves it in its initial state.
    pub(super) fn advance(&mut self) {
        if let Some(gate) = &mut self.gate {
            gate.advance();
        }
        match &mut self.script {
            Some(script) => script.advance(),
            None if self.started => self.device.advance(),
            None => {}
        }
        self.started = true;
    }

    /// Calls `work` with the device and catches panics; skips a lost device.
    pub(super) fn unless_lost(&mut self, work: impl FnOnce(&mut Self)) {
        if !self.lost {
            self.lost = catch_unwind(AssertUnwindSafe(|| work(self))).is_err();
        }
    }
}
