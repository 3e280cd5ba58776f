//! The arm gate: a gain between the limiters and a real device. It is zero until the device is armed, and again when it
//! is no longer held armed.

use super::Run;
use crate::plan::{DevicePlan, Plan};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

/// Time in which the gain of the gate rises from 0 to 1, s.
pub const ARM_RISE_S: f64 = 1.0;
/// Time in which the gain of the gate falls from 1 to 0, s. A slew limit can make the output slower.
pub const ARM_FALL_S: f64 = 0.02;
/// Time without [`ArmSwitch::hold`] after which the real-time side disarms, s.
pub const ARM_HOLD_S: f64 = 0.3;

/// Switch that arms the real devices of a run. Any thread arms, holds and disarms; the real-time threads poll it
/// ([`SessionOptions::arm`](super::SessionOptions::arm)). It starts disarmed.
#[derive(Debug, Default)]
pub struct ArmSwitch {
    /// Bits of the gain; 0 while disarmed.
    gain: AtomicU64,
    /// Number of times that it was armed or held.
    holds: AtomicU32,
}

impl ArmSwitch {
    /// Arms with a gain behind the limiters, 0 to 1. NaN, zero and negative gains disarm.
    pub fn arm(&self, gain: f64) {
        self.hold();
        self.gain.store(bounded(gain).to_bits(), Relaxed);
    }

    /// Changes the gain. Does nothing while disarmed.
    pub fn set_gain(&self, gain: f64) {
        let (gain, is_armed) = (bounded(gain).to_bits(), |bits: u64| bits != 0);
        // An error means that it is disarmed.
        let _ = self.gain.fetch_update(Relaxed, Relaxed, |now| is_armed(now).then_some(gain));
    }

    /// Keeps it armed for another [`ARM_HOLD_S`]. Does nothing while disarmed.
    pub fn hold(&self) {
        self.holds.fetch_add(1, Relaxed);
    }

    /// Disarms: the devices ramp to zero, until [`arm`](Self::arm) is called.
    pub fn disarm(&self) {
        self.gain.store(0, Relaxed);
    }

    /// The gain; 0 while disarmed, also after [`ARM_HOLD_S`] without [`hold`](Self::hold).
    pub fn gain(&self) -> f64 {
        f64::from_bits(self.gain.load(Relaxed))
    }

    /// True if the actuators are armed.
    pub fn is_armed(&self) -> bool {
        self.gain() > 0.0
    }
}

fn bounded(gain: f64) -> f64 {
    if gain > 0.0 { gain.min(1.0) } else { 0.0 }
}

impl Run {
    /// Puts a closed gate before each device that is not simulated.
    pub(super) fn arm_by(&mut self, switch: &Arc<ArmSwitch>) {
        for (device, state) in self.plan.devices.iter().zip(&mut self.state.devices) {
            let mut driven_by = device.driven_by.iter();
            if driven_by.any(|(actuator, ..)| !self.plan.actuators[*actuator].simulated) {
                state.gate = Some(ArmGate::new(&self.plan, device, Arc::clone(switch)));
            }
        }
    }
}

/// Arm gate of a device. A swap moves it to the new plan with the device. A new gate is closed.
pub(super) struct ArmGate {
    switch: Arc<ArmSwitch>,
    level: f64,
    /// Largest steps of the level in a tick.
    rise: f64,
    fall: f64,
    /// The last number of holds, ticks since it changed, and the maximum of those ticks.
    holds: u32,
    unheld: u64,
    max_unheld: u64,
    channels: Vec<Gated>,
}

/// A driven channel.
struct Gated {
    channel: usize,
    /// Maximum step of the output in a tick: the slew limit.
    max_step: f64,
    output: [f64; 6],
}

impl ArmGate {
    fn new(plan: &Plan, device: &DevicePlan, switch: Arc<ArmSwitch>) -> Self {
        let rate_hz = plan.rates[device.clock].hz();
        let gated = |(actuator, channel, _): &(usize, usize, u32)| {
            let slew_per_s = plan.actuators[*actuator].limit.slew_per_s;
            Gated {
                channel: *channel,
                max_step: slew_per_s.map_or(f64::INFINITY, |slew| slew / rate_hz),
                output: [0.0; 6],
            }
        };
        Self {
            switch,
            level: 0.0,
            rise: 1.0 / (ARM_RISE_S * rate_hz),
            fall: 1.0 / (ARM_FALL_S * rate_hz),
            holds: 0,
            unheld: 0,
            max_unheld: (ARM_HOLD_S * rate_hz) as u64,
            channels: device.driven_by.iter().map(gated).collect(),
        }
    }

    /// Continues the gate of the same device in another plan.
    pub(super) fn continue_from(&mut self, other: &Self) {
        (self.level, self.holds, self.unheld) = (other.level, other.holds, other.unheld);
        for gated in &mut self.channels {
            let mut known = other.channels.iter();
            if let Some(known) = known.find(|known| known.channel == gated.channel) {
                gated.output = known.output;
            }
        }
    }

    /// Closes the gate at once and disarms, after an interruption without output.
    pub(super) fn close(&mut self) {
        self.switch.disarm();
        self.level = 0.0;
        for gated in &mut self.channels {
            gated.output = [0.0; 6];
        }
    }

    /// Advances by a tick of the device.
    pub(super) fn advance(&mut self) {
        let armed = self.switch.gain.load(Relaxed);
        let holds = self.switch.holds.load(Relaxed);
        self.unheld = match holds == self.holds {
            true => self.unheld.saturating_add(1),
            false => 0,
        };
        self.holds = holds;
        if self.unheld > self.max_unheld {
            // An error means that it was armed again meanwhile.
            let _ = self.switch.gain.compare_exchange(armed, 0, Relaxed, Relaxed);
        }
        let by = self.switch.gain() - self.level;
        self.level = (self.level + by.clamp(-self.fall, self.rise)).clamp(0.0, 1.0);
    }

    /// The frame that a channel receives in place of `frame`.
    pub(super) fn pass(&mut self, channel: usize, frame: &[f64]) -> [f64; 6] {
        let mut target = [0.0; 6];
        if self.level > 0.0 {
            let level = self.level;
            target.iter_mut().zip(frame).for_each(|(to, x)| *to = x * level);
        }
        let Some(gated) = self.channels.iter_mut().find(|gated| gated.channel == channel) else {
            // Unreachable: every written channel is driven by an actuator.
            return [0.0; 6];
        };
        let steps = target.iter().zip(&gated.output);
        let squares = steps.map(|(to, from): (&f64, &f64)| (to - from).powi(2));
        let step = squares.sum::<f64>().sqrt();
        if step > gated.max_step {
            let part = gated.max_step / step;
            let outputs = gated.output.iter_mut().zip(&target);
            outputs.for_each(|(from, to)| *from += part * (to - *from));
        } else {
            gated.output = target;
        }
        gated.output
    }
}
