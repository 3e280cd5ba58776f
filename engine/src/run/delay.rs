//! Declared delays on one clock.

use super::window::Window;
use crate::io::touched;
use crate::plan::DelayPlan;

/// A declared delay: a ring buffer of its length.
#[derive(Debug, Clone)]
pub(crate) struct DelayState {
    pub(super) ring: Vec<f64>,
    width: usize,
    frames: u64,
}

impl DelayState {
    pub(crate) fn new(plan: &DelayPlan) -> Self {
        let neutral = plan.kind.neutral();
        let first: Vec<f64> = neutral.map(|neutral| plan.initial.unwrap_or(neutral)).collect();
        Self {
            ring: touched(first.repeat(usize::try_from(plan.frames).unwrap_or(usize::MAX))),
            width: first.len(),
            frames: plan.frames,
        }
    }

    /// Copies the state of a delay of the same length and kind.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        self.ring.copy_from_slice(&other.ring);
    }

    /// Reads the delayed frames of `window`, at most the length of the delay.
    pub(crate) fn read(&self, window: Window, y: &mut [f64]) {
        for (j, out) in y.chunks_exact_mut(self.width).enumerate() {
            out.copy_from_slice(&self.ring[self.at(window.first + j as u64)..][..self.width]);
        }
    }

    /// Writes the frames of `window`.
    pub(crate) fn write(&mut self, window: Window, x: &[f64]) {
        for (j, frame) in x.chunks_exact(self.width).enumerate() {
            let at = self.at(window.first + j as u64);
            self.ring[at..at + self.width].copy_from_slice(frame);
        }
    }

    /// Reads and writes, for a delay outside of any loop and windows of any length.
    pub(crate) fn pass(&mut self, window: Window, x: &[f64], y: &mut [f64]) {
        for (j, (frame, out)) in x.chunks_exact(self.width).zip(y.chunks_exact_mut(self.width)).enumerate() {
            let at = self.at(window.first + j as u64);
            let kept = &mut self.ring[at..at + self.width];
            out.copy_from_slice(kept);
            kept.copy_from_slice(frame);
        }
    }

    fn at(&self, tick: u64) -> usize {
        (tick % self.frames) as usize * self.width
    }
}
