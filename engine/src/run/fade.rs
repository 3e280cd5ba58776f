//! How much of what a graph asks for reaches the actuators: nothing before the start, everything while running, and
//! straight lines between, ahead of the limiters.

/// The factor on every actuator's request as a function of time, in units of the plan's time base.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) enum FadeGate {
    /// All of it.
    #[default]
    Full,
    /// From nothing at `begin` to everything at `end`.
    Rising { begin: u64, end: u64 },
    /// From a part of it at `begin` to nothing at `end`, and nothing after.
    Falling { begin: u64, end: u64, from: f64 },
}

impl FadeGate {
    #[inline]
    pub(crate) fn factor(self, time: u64) -> f64 {
        let along = |begin: u64, end: u64| {
            if time >= end {
                1.0
            } else {
                time.saturating_sub(begin) as f64 / (end - begin) as f64
            }
        };
        match self {
            Self::Full => 1.0,
            Self::Rising { begin, end } => along(begin, end),
            Self::Falling { begin, end, from } => from * (1.0 - along(begin, end)),
        }
    }

    /// Is nothing let through at `time` and after?
    pub(crate) fn is_zero_from(self, time: u64) -> bool {
        matches!(self, Self::Falling { end, .. } if time >= end)
    }
}
