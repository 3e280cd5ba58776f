//! The fade gate in front of the limiters: linear fades between 0 and 1.

use super::Run;

/// Duration of a fade in or out, s.
pub const FADE_S: f64 = 0.01;

/// Factor on every actuator's input as a function of time, in units of the plan's time base.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) enum FadeGate {
    /// Factor 1.
    #[default]
    Full,
    /// From 0 at `begin` to 1 at `end`.
    Rising { begin: u64, end: u64 },
    /// From `from` at `begin` to 0 at `end`, and 0 after.
    Falling { begin: u64, end: u64, from: f64 },
}

impl FadeGate {
    #[inline]
    pub(crate) fn factor(self, time: u64) -> f64 {
        let along = |begin: u64, end: u64| {
            if time >= end { 1.0 } else { time.saturating_sub(begin) as f64 / (end - begin) as f64 }
        };
        match self {
            Self::Full => 1.0,
            Self::Rising { begin, end } => along(begin, end),
            Self::Falling { begin, end, from } => from * (1.0 - along(begin, end)),
        }
    }

    /// True if the factor is 0 at `time` and after.
    pub(crate) fn is_zero_from(self, time: u64) -> bool {
        matches!(self, Self::Falling { end, .. } if time >= end)
    }
}

impl Run {
    /// Starts a fade-in from zero.
    pub(crate) fn fade_in(&mut self, seconds: f64) {
        let (begin, end) = self.fade_span(seconds);
        self.state.fade = FadeGate::Rising { begin, end };
    }

    /// Starts a fade-out from the present factor.
    pub(crate) fn fade_out(&mut self, seconds: f64) {
        if !matches!(self.state.fade, FadeGate::Falling { .. }) {
            let (begin, end) = self.fade_span(seconds);
            let from = self.state.fade.factor(begin);
            self.state.fade = FadeGate::Falling { begin, end, from };
        }
    }

    /// Fades in after an interruption without output; if the outputs were fading out, they stay at zero.
    pub(crate) fn restart_from_zero(&mut self, seconds: f64) {
        self.reset_limiters();
        // Whatever is there now is not what was armed.
        for device in &mut self.state.devices {
            if let Some(gate) = &mut device.gate {
                gate.close();
            }
        }
        if let FadeGate::Falling { .. } = self.state.fade {
            let (begin, end) = self.fade_span(0.0);
            self.state.fade = FadeGate::Falling { begin, end, from: 0.0 };
        } else {
            self.fade_in(seconds);
        }
    }

    /// Lets the actuators of a device rise from zero, and disarms them: its hardware was given zeros meanwhile.
    pub(crate) fn restart_device(&mut self, device: usize, seconds: f64) {
        let span = self.fade_span(seconds);
        for (actuator, ..) in &self.plan.devices[device].driven_by {
            let actuator = &mut self.state.actuators[*actuator];
            actuator.limiter.begin_from(&[0.0; 6]);
            actuator.gate.begin_from_zero(span);
        }
        if let Some(gate) = &mut self.state.devices[device].gate {
            gate.close();
        }
    }

    /// True if a fade-out has ended. The limits may make it longer.
    pub(crate) fn is_silent(&self) -> bool {
        self.state.fade.is_zero_from(self.state.windows.block().1) && self.is_idle()
    }

    pub(super) fn fade_span(&self, seconds: f64) -> (u64, u64) {
        let begin = self.state.windows.block().1;
        let units = (seconds * self.plan.base.units_per_second()).round().max(1.0) as u64;
        (begin, begin.saturating_add(units))
    }
}
