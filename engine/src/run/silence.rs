//! Silence of live inputs: the gate in front of each limiter, and its status.

use super::Run;
use super::device::DeviceState;
use crate::limiter::{ClipCounts, Limit};
use crate::plan::{ActuatorPlan, Plan};
use crate::silence::InputState;

/// Factor on an actuator's request: a linear ramp to 0 or 1 from its value when the inputs changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SilenceGate {
    from: f64,
    is_open: bool,
    begin: u64,
    end: u64,
}

impl SilenceGate {
    pub(super) fn new(is_open: bool) -> Self {
        Self { from: f64::from(u8::from(is_open)), is_open, begin: 0, end: 0 }
    }

    /// Opens or closes between two times, from the present factor.
    pub(super) fn turn(&mut self, open: bool, (begin, end): (u64, u64)) {
        if open != self.is_open {
            self.from = self.factor(begin);
            (self.is_open, self.begin, self.end) = (open, begin, end);
        }
    }

    /// Begins at zero between two times, and opens if it is open.
    pub(super) fn begin_from_zero(&mut self, (begin, end): (u64, u64)) {
        (self.from, self.begin, self.end) = (0.0, begin, end);
    }

    #[inline]
    pub(super) fn factor(self, time: u64) -> f64 {
        let to = f64::from(u8::from(self.is_open));
        if time >= self.end {
            return to;
        }
        let along = time.saturating_sub(self.begin) as f64 / (self.end - self.begin) as f64;
        self.from + (to - self.from) * along
    }

    /// True if the gate is open or opening.
    pub(super) fn is_open(&self) -> bool {
        self.is_open
    }

    /// True if the factor is 0 from `time` until an input changes.
    fn is_closed_from(self, time: u64) -> bool {
        !self.is_open && time >= self.end
    }
}

/// Status of a live input.
#[derive(Debug, Clone, PartialEq)]
pub struct InputStatus {
    /// Name of the endpoint.
    pub device: String,
    /// The state.
    pub state: InputState,
    /// True if its actuators continue while it is silent.
    pub holds: bool,
    /// Time without new data after which it is silent, s.
    pub timeout_s: f64,
    /// The actuators that depend on it.
    pub actuators: Vec<ActuatorStatus>,
}

/// Status of an actuator.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuatorStatus {
    /// Path of the sink.
    pub path: String,
    /// Largest magnitude over the axes of its last output.
    pub delivered: f64,
    /// Unit of `delivered` and of the limit.
    pub unit: String,
    /// The limit of its magnitude.
    pub limit: Limit,
    /// True if a silent input closes its gate.
    pub is_closed: bool,
    /// True if its gate is closed and its output is zero.
    pub at_zero: bool,
}

/// Level of an actuator's output, and its limit.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuatorLevel {
    /// Path of the sink.
    pub path: String,
    /// Unit of the level and of the limit.
    pub unit: String,
    /// Moving root mean square of the magnitude, time constant 0.3 s.
    pub rms: f64,
    /// Largest magnitude since the last call.
    pub peak: f64,
    /// Used part of the continuous limit, as the limiter counts it: output of an unknown past counts as that limit.
    pub heat: f64,
    /// The limit.
    pub limit: Limit,
    /// Number of ticks in which each limit acted since the run began.
    pub clipped: ClipCounts,
}

pub(super) fn levels(plan: &Plan) -> impl Iterator<Item = ActuatorLevel> {
    let actuators = plan.actuators.iter().zip(&*plan.delivered);
    actuators.map(|(actuator, delivered)| {
        let (rms, peak, heat) = delivered.take_level();
        ActuatorLevel {
            path: actuator.path.clone(),
            unit: actuator.unit.clone(),
            rms,
            peak,
            heat,
            limit: actuator.limit,
            clipped: delivered.clipped(),
        }
    })
}

/// The live inputs of the plans of a graph's drivers.
pub(super) fn statuses<'p>(plans: impl Iterator<Item = &'p Plan> + Clone) -> Vec<InputStatus> {
    let Some(first) = plans.clone().next() else {
        return Vec::new();
    };
    let inputs = first.devices.iter().enumerate();
    inputs
        .filter_map(|(place, device)| Some((place, device, device.input.as_ref()?)))
        .map(|(place, device, input)| InputStatus {
            device: device.name.clone(),
            state: input.cell.get(),
            holds: input.holds,
            timeout_s: input.timeout_s,
            actuators: plans.clone().flat_map(|plan| silenced(plan, place)).collect(),
        })
        .collect()
}

fn silenced(plan: &Plan, device: usize) -> impl Iterator<Item = ActuatorStatus> {
    let actuators = plan.actuators.iter().zip(&*plan.delivered);
    let depends = move |by: &[(usize, bool)]| by.iter().any(|(known, _)| *known == device);
    let actuators = actuators.filter(move |(actuator, _)| depends(&actuator.silenced_by));
    actuators.map(|(actuator, delivered)| {
        let (delivered, at_zero) = delivered.get();
        ActuatorStatus {
            path: actuator.path.clone(),
            delivered,
            unit: actuator.unit.clone(),
            limit: actuator.limit,
            is_closed: !actuator.is_let_through(|device| plan.devices.get(device)?.input.clone()),
            at_zero,
        }
    })
}

/// True if every live input upstream of an actuator delivers data or is held, by the state of the devices.
fn lets_through(plan: &ActuatorPlan, devices: &[DeviceState]) -> bool {
    plan.is_let_through(|device| devices.get(device)?.device.live_input())
}

impl Run {
    /// Closes the gates of actuators whose live inputs are silent and opens the others, within `seconds`.
    /// The gates do not change until the next call, for any block size.
    pub(crate) fn follow_inputs(&mut self, seconds: f64) {
        let span = self.fade_span(seconds);
        let (devices, actuators) = (&self.state.devices, &mut self.state.actuators);
        let actuators = self.plan.actuators.iter().zip(actuators);
        for (plan, actuator) in actuators.filter(|(plan, _)| !plan.silenced_by.is_empty()) {
            actuator.gate.turn(lets_through(plan, devices), span);
        }
    }

    /// Sets the gates at once by the present state of the devices.
    pub(super) fn init_gates(&mut self) {
        for (plan, actuator) in self.plan.actuators.iter().zip(&mut self.state.actuators) {
            actuator.gate = SilenceGate::new(lets_through(plan, &self.state.devices));
        }
    }

    /// Replays a change of an actuator's gate.
    pub(super) fn turn_gate(&mut self, actuator: usize, open: bool, seconds: f64) {
        let span = self.fade_span(seconds);
        let gate = &mut self.state.actuators[actuator].gate;
        match span.0 {
            // Inputs heard before the first frame opened the gate at once.
            0 => *gate = SilenceGate::new(open),
            _ => gate.turn(open, span),
        }
    }

    /// Publishes the level and the last output of each actuator.
    pub(crate) fn publish_delivered(&mut self) {
        let time = self.state.windows.block().1;
        for (actuator, delivered) in self.state.actuators.iter_mut().zip(&*self.plan.delivered) {
            let (level, peak) = actuator.level.read();
            delivered.put_level(level, peak, actuator.limiter.used_heat());
            delivered.put_clipped(actuator.limiter.counts());
            let output = actuator.limiter.output();
            let largest = output.iter().fold(0.0_f64, |largest, y| largest.max(y.abs()));
            delivered.put(largest, largest == 0.0 && actuator.gate.is_closed_from(time));
        }
    }
}
