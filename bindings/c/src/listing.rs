//! What lists of the engine become in C.

use crate::border::{Actuator, InputState, LiveInput, LiveSetting, fixed};
use haptograph_engine::run::{ActuatorStatus, InputStatus};
use haptograph_engine::silence;

impl From<&haptograph_engine::settings::LiveSetting> for LiveSetting {
    fn from(live: &haptograph_engine::settings::LiveSetting) -> Self {
        let (min, max) = live.range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        Self {
            name: fixed(&live.name()),
            unit: fixed(&live.unit),
            value: live.value,
            min,
            max,
            whole: u32::from(live.whole),
        }
    }
}

impl From<&InputStatus> for LiveInput {
    fn from(input: &InputStatus) -> Self {
        let count = |wanted: fn(&ActuatorStatus) -> bool| {
            u32::try_from(input.actuators.iter().filter(|one| wanted(one)).count()).unwrap_or(u32::MAX)
        };
        Self {
            endpoint: fixed(&input.device),
            state: match input.state {
                silence::InputState::Never => InputState::Never,
                silence::InputState::Heard => InputState::Heard,
                silence::InputState::Silent => InputState::Silent,
                silence::InputState::Jumped => InputState::Jumped,
            },
            holds: u32::from(input.holds),
            timeout_s: input.timeout_s,
            actuators: count(|_| true),
            closed: count(|actuator| actuator.is_closed),
        }
    }
}

impl From<&ActuatorStatus> for Actuator {
    fn from(actuator: &ActuatorStatus) -> Self {
        Self {
            name: fixed(&actuator.path),
            unit: fixed(&actuator.unit),
            delivered: actuator.delivered,
            peak: actuator.limit.peak,
            continuous: actuator.limit.continuous,
            closed: u32::from(actuator.is_closed),
            at_zero: u32::from(actuator.at_zero),
        }
    }
}
