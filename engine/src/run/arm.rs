//! The arm gate: a gain between the limiters and a real device. It is zero until the device is armed, and again as
//! soon as nothing holds it armed.

use super::Run;
use crate::plan::{DevicePlan, Plan};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

/// Time in which the gain of the gate rises from 0 to 1, s.
pub const ARM_RISE_S: f64 = 1.0;
/// Time in which it falls from 1 to 0, s. A slew limit can make the output slower.
pub const ARM_FALL_S: f64 = 0.02;
/// Time without [`ArmSwitch::hold`] after which the real-time side disarms, s.
pub const ARM_HOLD_S: f64 = 0.3;

/// Whether the real devices of a run are armed. One thread arms, holds and disarms; the real-time sides poll it
/// ([`LiveOptions::arm`](super::LiveOptions::arm)). It begins disarmed.
#[derive(Debug, Default)]
pub struct ArmSwitch {
    /// Bits of the gain; 0 while disarmed.
    gain: AtomicU64,
    /// Number of times that it was armed or held.
    holds: AtomicU32,
}

impl ArmSwitch {
    /// Lets a part of what the limiters give through, 0 to 1. NaN and what is not above 0 disarm.
    pub fn arm(&self, gain: f64) {
        self.hold();
        self.gain.store(bounded(gain).to_bits(), Relaxed);
    }

    /// Changes the part that is let through while it is armed; does nothing while it is not.
    pub fn set_gain(&self, gain: f64) {
        let (gain, armed) = (bounded(gain).to_bits(), |bits: u64| bits != 0);
        // An error is what was disarmed meanwhile.
        let _ = self
            .gain
            .fetch_update(Relaxed, Relaxed, |now| armed(now).then_some(gain));
    }

    /// Keeps it armed for another [`ARM_HOLD_S`]. Does nothing while it is disarmed.
    pub fn hold(&self) {
        self.holds.fetch_add(1, Relaxed);
    }

    /// Takes the devices to zero. Only [`arm`](Self::arm) ends that.
    pub fn disarm(&self) {
        self.gain.store(0, Relaxed);
    }

    /// The part that is let through: 0 while disarmed, also where nobody held it armed.
    pub fn gain(&self) -> f64 {
        f64::from_bits(self.gain.load(Relaxed))
    }

    /// Whether it is armed.
    pub fn is_armed(&self) -> bool {
        self.gain() > 0.0
    }
}

fn bounded(gain: f64) -> f64 {
    if gain > 0.0 { gain.min(1.0) } else { 0.0 }
}

impl Run {
    /// Gates the devices that are not simulated by a switch, from zero.
    pub(super) fn arm_by(&mut self, switch: &Arc<ArmSwitch>) {
        for (device, state) in self.plan.devices.iter().zip(&mut self.state.devices) {
            let mut driven_by = device.driven_by.iter();
            if driven_by.any(|(actuator, ..)| !self.plan.actuators[*actuator].simulated) {
                state.gate = Some(ArmGate::new(&self.plan, device, Arc::clone(switch)));
            }
        }
    }
}

/// The gate of a device. It moves with the device from plan to plan; a new one is closed.
pub(super) struct ArmGate {
    switch: Arc<ArmSwitch>,
    level: f64,
    /// Largest steps of the level in a tick.
    rise: f64,
    fall: f64,
    /// Holds seen, and ticks since the last one.
    holds: u32,
    unheld: u64,
    most_unheld: u64,
    channels: Vec<Gated>,
}

/// A driven channel.
struct Gated {
    channel: usize,
    /// Largest step of its output in a tick, as its limit says.
    step: f64,
    output: [f64; 6],
}

impl ArmGate {
    fn new(plan: &Plan, device: &DevicePlan, switch: Arc<ArmSwitch>) -> Self {
        let rate_hz = plan.rates[device.clock].hz();
        let gated = |(actuator, channel, _): &(usize, usize, u32)| {
            let slew_per_s = plan.actuators[*actuator].limit.slew_per_s;
            Gated {
                channel: *channel,
                step: slew_per_s.map_or(f64::INFINITY, |slew| slew / rate_hz),
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
            most_unheld: (ARM_HOLD_S * rate_hz) as u64,
            channels: device.driven_by.iter().map(gated).collect(),
        }
    }

    /// Continues the gate of the same device in another plan.
    pub fn go_on_for(&mut self, other: &Self) {
        (self.level, self.holds, self.unheld) = (other.level, other.holds, other.unheld);
        for gated in &mut self.channels {
            let mut known = other.channels.iter();
            if let Some(known) = known.find(|known| known.channel == gated.channel) {
                gated.output = known.output;
            }
        }
    }

    /// Closes the gate at once and disarms, after an interruption without output.
    pub fn close(&mut self) {
        self.switch.disarm();
        self.level = 0.0;
        for gated in &mut self.channels {
            gated.output = [0.0; 6];
        }
    }

    /// Advances by a tick of the device.
    pub fn advance(&mut self) {
        let armed = self.switch.gain.load(Relaxed);
        let holds = self.switch.holds.load(Relaxed);
        self.unheld = match holds == self.holds {
            true => self.unheld.saturating_add(1),
            false => 0,
        };
        self.holds = holds;
        if self.unheld > self.most_unheld {
            // An error means that it was armed anew meanwhile.
            let _ = self.switch.gain.compare_exchange(armed, 0, Relaxed, Relaxed);
        }
        let by = self.switch.gain() - self.level;
        self.level = (self.level + by.clamp(-self.fall, self.rise)).clamp(0.0, 1.0);
    }

    /// The frame that a channel receives.
    pub fn pass(&mut self, channel: usize, frame: &[f64]) -> [f64; 6] {
        let mut wanted = [0.0; 6];
        if self.level > 0.0 {
            let level = self.level;
            wanted.iter_mut().zip(frame).for_each(|(to, x)| *to = x * level);
        }
        let Some(gated) = self.channels.iter_mut().find(|gated| gated.channel == channel) else {
            // Unreachable: what is written is driven by an actuator.
            return [0.0; 6];
        };
        let moved = wanted.iter().zip(&gated.output);
        let way = moved.map(|(to, from): (&f64, &f64)| (to - from).powi(2));
        let way = way.sum::<f64>().sqrt();
        if way > gated.step {
            let part = gated.step / way;
            let ways = gated.output.iter_mut().zip(&wanted);
            ways.for_each(|(from, to)| *from += part * (to - *from));
        } else {
            gated.output = wanted;
        }
        gated.output
    }
}
