//! What the silence of live inputs does to actuators: the gate in front of each limiter, and what is known of it outside.

use super::Run;
use super::device::DeviceState;
use crate::limiter::{ClipCounts, Limit};
use crate::plan::{ActuatorPlan, Plan};
use crate::silence::InputState;

/// The factor on an actuator's request: a straight line from what it was when the inputs changed to 0 or 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SilenceGate {
    from: f64,
    is_open: bool,
    begin: u64,
    end: u64,
}

impl SilenceGate {
    pub fn new(is_open: bool) -> Self {
        Self {
            from: f64::from(u8::from(is_open)),
            is_open,
            begin: 0,
            end: 0,
        }
    }

    /// Opens or closes between two times, from where it is.
    pub fn turn(&mut self, open: bool, (begin, end): (u64, u64)) {
        if open != self.is_open {
            self.from = self.factor(begin);
            (self.is_open, self.begin, self.end) = (open, begin, end);
        }
    }

    #[inline]
    pub fn factor(self, time: u64) -> f64 {
        let to = f64::from(u8::from(self.is_open));
        if time >= self.end {
            return to;
        }
        let along = time.saturating_sub(self.begin) as f64 / (self.end - self.begin) as f64;
        self.from + (to - self.from) * along
    }

    /// Is it open, or opening?
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// Is nothing let through at `time` and after, until an input changes?
    fn is_closed_from(self, time: u64) -> bool {
        !self.is_open && time >= self.end
    }
}

/// A live input of a run, as it is now.
#[derive(Debug, Clone, PartialEq)]
pub struct InputStatus {
    /// Name of the endpoint.
    pub device: String,
    /// Is it heard?
    pub state: InputState,
    /// Do its actuators go on while it is silent?
    pub holds: bool,
    /// Silence after which it counts as gone, s.
    pub timeout_s: f64,
    /// The actuators that depend on it.
    pub actuators: Vec<ActuatorStatus>,
}

/// An actuator of a run, as it is now.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuatorStatus {
    /// Path of the sink.
    pub path: String,
    /// The largest magnitude over its axes that it was given last.
    pub delivered: f64,
    /// Unit of that.
    pub unit: String,
    /// Does a silent input close it?
    pub is_closed: bool,
    /// Is it closed, and has it come to zero?
    pub at_zero: bool,
}

/// How much an actuator of a run is given, beside its limit.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuatorLevel {
    /// Path of the sink.
    pub path: String,
    /// Unit of what follows.
    pub unit: String,
    /// Root mean square over the last third of a second or so; of a vector, of its length.
    pub rms: f64,
    /// The largest magnitude since this was asked before.
    pub peak: f64,
    /// What it is never given more than.
    pub limit: Limit,
    /// How often each limit held something back since the run began.
    pub clipped: ClipCounts,
}

pub(super) fn levels(plan: &Plan) -> impl Iterator<Item = ActuatorLevel> {
    let actuators = plan.actuators.iter().zip(&*plan.delivered);
    actuators.map(|(actuator, delivered)| {
        let (rms, peak) = delivered.take_level();
        ActuatorLevel {
            path: actuator.path.clone(),
            unit: actuator.unit.clone(),
            rms,
            peak,
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
            is_closed: !actuator.is_let_through(|device| plan.devices.get(device)?.input.clone()),
            at_zero,
        }
    })
}

/// Is every live input that an actuator depends on heard, or held? As the devices themselves say.
fn lets_through(plan: &ActuatorPlan, devices: &[DeviceState]) -> bool {
    plan.is_let_through(|device| devices.get(device)?.device.live_input())
}

impl Run {
    /// Closes the gates of actuators whose live inputs are silent, and opens them when these are heard, in `seconds`.
    /// The frames until the next call go by that, however they are cut into blocks.
    pub(crate) fn follow_inputs(&mut self, seconds: f64) {
        let span = self.fade_span(seconds);
        let (devices, actuators) = (&self.state.devices, &mut self.state.actuators);
        let actuators = self.plan.actuators.iter().zip(actuators);
        for (plan, actuator) in actuators.filter(|(plan, _)| !plan.silenced_by.is_empty()) {
            actuator.gate.turn(lets_through(plan, devices), span);
        }
    }

    /// Opens and closes the gates as the devices are that it has by now: those of another run, where they went on.
    pub(super) fn meet_inputs(&mut self) {
        for (plan, actuator) in self.plan.actuators.iter().zip(&mut self.state.actuators) {
            actuator.gate = SilenceGate::new(lets_through(plan, &self.state.devices));
        }
    }

    /// Does with an actuator's gate what a live run did at this point of time.
    pub(super) fn turn_gate(&mut self, actuator: usize, open: bool, seconds: f64) {
        let span = self.fade_span(seconds);
        let gate = &mut self.state.actuators[actuator].gate;
        match span.0 {
            // What was heard before the first frame was let through at once.
            0 => *gate = SilenceGate::new(open),
            _ => gate.turn(open, span),
        }
    }

    /// Lets others know what each actuator was given last.
    pub(crate) fn publish_delivered(&mut self) {
        let time = self.state.windows.block().1;
        for (actuator, delivered) in self.state.actuators.iter_mut().zip(&*self.plan.delivered) {
            let (level, peak) = actuator.level.read();
            delivered.put_level(level, peak);
            delivered.put_clipped(actuator.limiter.counts());
            let output = actuator.limiter.output();
            let largest = output.iter().fold(0.0_f64, |largest, y| largest.max(y.abs()));
            delivered.put(largest, largest == 0.0 && actuator.gate.is_closed_from(time));
        }
    }
}
