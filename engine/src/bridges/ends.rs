//! The frames of a writer that a reader's tick reads.

/// Both ends of a bridge in the present window of time. Frames and ticks are numbered from the start of the run.
#[derive(Debug, Clone, Copy)]
pub struct Ends {
    pub(crate) from: Ticks,
    pub(crate) to: Ticks,
}

/// The ticks of one end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ticks {
    /// Number of the first tick in the window.
    pub first: u64,
    /// Number of ticks in the window.
    pub count: usize,
    /// Period, in units of the time base.
    pub period: u64,
}

impl Ends {
    /// Number of the writer's first frame in this window.
    #[inline]
    pub(crate) fn first_written(&self) -> u64 {
        self.from.first
    }

    /// Number of the writer's latest frame at the reader's tick `j` of this window.
    #[inline]
    pub(crate) fn latest_at(&self, j: usize) -> u64 {
        (self.to.first + j as u64) * self.to.period / self.from.period
    }

    /// Time from the writer's latest frame to the reader's tick `j` of this window, in periods of the writer: 0 to 1.
    #[inline]
    pub(crate) fn since_latest(&self, j: usize) -> f64 {
        let since = (self.to.first + j as u64) * self.to.period - self.latest_at(j) * self.from.period;
        since as f64 / self.from.period as f64
    }

    /// Index in this window of the reader's first tick at or after the writer's frame `k`.
    #[inline]
    pub(crate) fn reader_at(&self, k: u64) -> usize {
        let tick = (k * self.from.period).div_ceil(self.to.period);
        (tick.saturating_sub(self.to.first) as usize).min(self.to.count)
    }

    /// True if the writer is the faster one.
    #[inline]
    pub(crate) fn goes_slower(&self) -> bool {
        self.from.period < self.to.period
    }
}
