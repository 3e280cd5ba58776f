//! Live inputs: the state of external devices.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

crate::choices! {
    /// Effect of the silence of a live input on every actuator that depends on it.
    pub enum OnSilence {
        /// The actuators ramp to zero through their limiters, and back through a ramp when data arrive again.
        Zero,
        /// The actuators go on: position and force hold their last values, a soundcard's signal reads zero. Until the
        /// first data arrive, its actuators are at zero.
        Hold,
    }
}

/// State of a live input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum InputState {
    /// No data yet; the state in offline runs.
    #[default]
    Never,
    /// The last data are fresh.
    Heard,
    /// The last data are older than the timeout.
    Silent,
    /// The data moved faster than a hand can: the device's own actuators are at zero for a while.
    Jumped,
}

impl InputState {
    /// True if the device sends, also where its data move too fast.
    pub fn is_heard(self) -> bool {
        matches!(self, Self::Heard | Self::Jumped)
    }
}

/// The state of a live input, shared between the driver of the device and all users.
#[derive(Debug, Default)]
pub struct InputCell(AtomicU8);

impl InputCell {
    /// Sets the state. Only the driver of the device calls it.
    pub fn set(&self, state: InputState) {
        self.0.store(state as u8, Relaxed);
    }

    /// The state.
    pub fn get(&self) -> InputState {
        match self.0.load(Relaxed) {
            1 => InputState::Heard,
            2 => InputState::Silent,
            3 => InputState::Jumped,
            _ => InputState::Never,
        }
    }
}

/// Live input of a device. Copies of the device share its cell.
#[derive(Debug, Clone)]
pub struct LiveInput {
    /// The state.
    pub cell: Arc<InputCell>,
    /// True if the actuators that depend on it continue while it is silent.
    pub holds: bool,
    /// Time without new data after which it is silent, s.
    pub timeout_s: f64,
}

impl LiveInput {
    /// True if an actuator that depends on it is enabled. An actuator of the device itself (`own`) is disabled while
    /// the device is silent or jumps.
    pub(crate) fn lets_through(&self, own: bool) -> bool {
        match self.cell.get() {
            InputState::Never => false,
            InputState::Heard => true,
            InputState::Silent => self.holds && !own,
            InputState::Jumped => !own,
        }
    }
}
