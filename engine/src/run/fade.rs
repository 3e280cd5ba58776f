//! The fade gate in front of the limiters: linear fades between 0 and 1.

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
