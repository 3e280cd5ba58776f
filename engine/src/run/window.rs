//! Windows: the ticks of every clock in an interval of time.

use crate::bridges::Ticks;
use crate::plan::Plan;
use haptograph_signal::time::{TimeBase, ticks_before};
use std::ops::Range;

/// The ticks of a clock in the present interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Window {
    /// Number of the first tick.
    pub first: u64,
    /// Number of ticks.
    pub count: usize,
    /// Index of the first tick in the block's buffers.
    pub offset: usize,
}

impl Window {
    /// One frame of it.
    pub(crate) fn one(self, frame: usize) -> Self {
        Self { first: self.first + frame as u64, count: 1, offset: self.offset + frame }
    }

    /// The ticks, of a clock of this period.
    pub(crate) fn ticks(self, period: u64) -> Ticks {
        Ticks { first: self.first, count: self.count, period }
    }

    /// Moves on to the following ticks before the time `end`.
    #[inline]
    fn go_on(&mut self, period: u64, end: u64) {
        self.first += self.count as u64;
        let next = self.first.saturating_mul(period);
        // A slow clock mostly has no tick: avoid the division.
        self.count = if next < end { (end - next).div_ceil(period) as usize } else { 0 };
    }
}

/// The windows of all clocks: those of the block, and those of the island's present sub-window.
#[derive(Debug, Clone)]
pub(crate) struct Windows {
    base: TimeBase,
    driver: usize,
    /// Start of the present block, in units of the time base.
    begin: u64,
    /// The end.
    end: u64,
    clocks: Vec<Window>,
    /// The block's windows while an island narrows them.
    whole: Vec<Window>,
}

impl Windows {
    pub(crate) fn new(plan: &Plan) -> Self {
        let clocks = vec![Window::default(); plan.rates.len()];
        Self { base: plan.base.clone(), driver: plan.driver, begin: 0, end: 0, whole: clocks.clone(), clocks }
    }

    #[inline]
    pub(crate) fn of(&self, clock: u32) -> Window {
        self.clocks[clock as usize]
    }

    pub(crate) fn period(&self, clock: u32) -> u64 {
        self.base.period(clock as usize)
    }

    /// Moves on to a block of `frames` driver frames.
    pub(crate) fn next_block(&mut self, frames: usize) {
        self.begin = self.end;
        self.end = self.begin.saturating_add(self.base.period(self.driver).saturating_mul(frames as u64));
        for (clock, window) in self.clocks.iter_mut().enumerate() {
            window.offset = 0;
            if clock != self.driver {
                window.go_on(self.base.period(clock), self.end);
            }
        }
        let driver = &mut self.clocks[self.driver];
        driver.first += driver.count as u64;
        driver.count = frames;
    }

    /// Sets the time to that after `frames` driver frames.
    pub(crate) fn start_at(&mut self, frames: u64) {
        self.end = frames.saturating_mul(self.base.period(self.driver));
        self.begin = self.end;
        for (clock, window) in self.clocks.iter_mut().enumerate() {
            *window = Window { first: ticks_before(self.end, self.base.period(clock)), count: 0, offset: 0 };
        }
    }

    /// The driver frame at which the present block ends.
    pub(crate) fn driver_frames(&self) -> u64 {
        self.end / self.base.period(self.driver)
    }

    /// Start and end of the block, in units of the time base.
    pub(crate) fn block(&self) -> (u64, u64) {
        (self.begin, self.end)
    }

    /// The next boundary of a sub-window after `time`, at most the end of the block.
    pub(crate) fn boundary_after(&self, time: u64, pacings: &[u64]) -> u64 {
        let next = |pacing: &u64| (time / pacing + 1).saturating_mul(*pacing);
        pacings.iter().map(next).min().unwrap_or(self.end).min(self.end)
    }

    /// Narrows every window to an empty one at the start of the block.
    pub(crate) fn rewind(&mut self) {
        for window in &mut self.clocks {
            window.count = 0;
        }
    }

    /// Narrows every window to the ticks that follow its present ones, before the time `end`.
    pub(crate) fn narrow_to(&mut self, end: u64) {
        for (clock, window) in self.clocks.iter_mut().enumerate() {
            window.offset += window.count;
            window.go_on(self.base.period(clock), end);
        }
    }

    /// Keeps the block's windows while an island narrows them.
    pub(crate) fn save(&mut self) {
        self.whole.copy_from_slice(&self.clocks);
    }

    pub(crate) fn restore(&mut self) {
        self.clocks.copy_from_slice(&self.whole);
    }
}

/// Range of a window's components in a buffer that begins at `start`.
pub(crate) fn range_of(start: u32, width: u32, window: Window) -> Range<usize> {
    let begin = start as usize + window.offset * width as usize;
    begin..begin + window.count * width as usize
}
