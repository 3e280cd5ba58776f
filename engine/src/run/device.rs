//! The devices of a running plan.

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
}

impl DeviceState {
    pub(super) fn new(plan: &DevicePlan) -> Self {
        Self {
            device: plan.device.clone_box(),
            started: false,
            written: vec![[0.0; 6]; plan.writes.len()],
            lost: false,
        }
    }

    /// Moves the body to the next tick; at tick 0 it is where it was built.
    pub(super) fn advance(&mut self) {
        if self.started {
            self.device.advance();
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
