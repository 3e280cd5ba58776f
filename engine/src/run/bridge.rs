//! Bridges between clocks of one driver, and delays. Alignment is exact: a reader's tick at time t reads the writer's
//! frames with time <= t, by integer arithmetic, so that the result does not depend on the block size.

use super::window::Window;
use crate::io::touched;
use crate::joining::resampler;
use crate::plan::{BridgeKind, BridgePlan, DelayPlan};
use haptograph_signal::resample::Resampler;
use haptograph_signal::time::Rate;

/// State of a bridge.
#[derive(Debug, Clone)]
pub(crate) struct BridgeState {
    kind: BridgeKind,
    width: usize,
    /// The last frame; for linear interpolation the last two, older first.
    held: Vec<f64>,
    /// Sum of the frames since the last mean.
    sum: Vec<f64>,
    /// Number of frames in the sum.
    summed: u32,
    resamplers: Vec<Resampler>,
    gathered: Vec<f64>,
    resampled: Vec<f64>,
}

/// Both ends of a bridge in the present window.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ends {
    pub from: Window,
    pub from_period: u64,
    pub to: Window,
    pub to_period: u64,
}

impl Ends {
    /// Index in the present window of the reader's first tick at or after the writer's frame `k`.
    fn reader_at(&self, k: u64) -> usize {
        let tick = (k * self.from_period).div_ceil(self.to_period);
        (tick.saturating_sub(self.to.first) as usize).min(self.to.count)
    }

    /// Number of the writer's latest frame at the reader's tick `j` of this window.
    fn writer_at(&self, j: usize) -> u64 {
        (self.to.first + j as u64) * self.to_period / self.from_period
    }
}

impl BridgeState {
    pub(crate) fn new(plan: &BridgePlan, from: Rate, to: Rate) -> Self {
        let width = plan.width;
        let resamplers = match plan.kind {
            // The check refuses rates that cannot be resampled.
            BridgeKind::Resample => (0..width).filter_map(|_| resampler(from, to).ok()).collect(),
            _ => Vec::new(),
        };
        let (gathered, resampled) = if resamplers.is_empty() {
            (0, 0)
        } else {
            (plan.max_from, plan.max_to)
        };
        Self {
            kind: plan.kind,
            width,
            held: vec![0.0; 2 * width],
            sum: vec![0.0; width],
            summed: 0,
            resamplers,
            gathered: vec![0.0; gathered],
            resampled: vec![0.0; resampled],
        }
    }

    /// Copies the state of a bridge of the same kind, width and rates.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        self.held.copy_from_slice(&other.held);
        self.sum.copy_from_slice(&other.sum);
        self.summed = other.summed;
        for (resampler, other) in self.resamplers.iter_mut().zip(&other.resamplers) {
            resampler.copy_state_from(other);
        }
    }

    /// Converts the frames `x` of the writer's window to the frames `y` of the reader's; for runs, `y` is the whole
    /// list.
    pub(crate) fn cross(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
        match self.kind {
            BridgeKind::Hold => self.hold(ends, x, y),
            BridgeKind::HoldRuns => self.hold_runs(ends, x, y),
            BridgeKind::Linear => self.linear(ends, x, y),
            BridgeKind::Average => self.average(ends, x, y),
            BridgeKind::Resample => self.resample(x, y),
            BridgeKind::Delay(_) => {}
        }
    }

    fn hold(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
        let width = self.width;
        if ends.from_period < ends.to_period {
            for (j, out) in y.chunks_exact_mut(width).enumerate() {
                let k = ends.writer_at(j).checked_sub(ends.from.first);
                let frame = k.and_then(|k| x.chunks_exact(width).nth(k as usize));
                out.copy_from_slice(frame.unwrap_or(&self.held[..width]));
            }
        } else {
            let first = ends.reader_at(ends.from.first);
            fill(&mut y[..first * width], &self.held[..width]);
            let mut begin = first;
            for (k, frame) in x.chunks_exact(width).enumerate() {
                let end = ends.reader_at(ends.from.first + k as u64 + 1);
                fill(&mut y[begin * width..end * width], frame);
                begin = end;
            }
        }
        self.keep_last(x);
    }

    fn hold_runs(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
        let width = self.width;
        let stride = width + 1;
        let mut runs = 0;
        let mut begin = 0;
        let mut put = |begin: usize, frame: &[f64]| {
            let run = &mut y[1 + runs * stride..][..stride];
            run[0] = begin as f64;
            run[1..].copy_from_slice(frame);
            runs += 1;
        };
        let first = ends.reader_at(ends.from.first);
        if first > 0 {
            put(0, &self.held[..width]);
            begin = first;
        }
        for (k, frame) in x.chunks_exact(width).enumerate() {
            let end = ends.reader_at(ends.from.first + k as u64 + 1);
            if end > begin {
                put(begin, frame);
                begin = end;
            }
        }
        y[0] = runs as f64;
        self.keep_last(x);
    }

    fn linear(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
        let width = self.width;
        // Frame `k`, from this window or the two frames before it. Before the start, frame -1 equals frame 0.
        let frame = |held: &[f64], component: usize, k: i64| -> f64 {
            let local = k - ends.from.first as i64;
            match local {
                0.. => x[local as usize * width + component],
                _ if ends.from.first == 0 => x.get(component).copied().unwrap_or(0.0),
                -1 => held[width + component],
                _ => held[component],
            }
        };
        for (j, out) in y.chunks_exact_mut(width).enumerate() {
            let k = ends.writer_at(j);
            let since = (ends.to.first + j as u64) * ends.to_period - k * ends.from_period;
            let fraction = since as f64 / ends.from_period as f64;
            for (component, out) in out.iter_mut().enumerate() {
                let (a, b) = (
                    frame(&self.held, component, k as i64 - 1),
                    frame(&self.held, component, k as i64),
                );
                *out = a + (b - a) * fraction;
            }
        }
        let frames = x.len() / width;
        if frames == 1 {
            self.held.copy_within(width.., 0);
            self.held[width..].copy_from_slice(x);
            if ends.from.first == 0 {
                self.held[..width].copy_from_slice(x);
            }
        } else if frames > 1 {
            self.held.copy_from_slice(&x[(frames - 2) * width..]);
        }
    }

    fn average(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
        let width = self.width;
        let mut frames = x.chunks_exact(width).enumerate().peekable();
        for (j, out) in y.chunks_exact_mut(width).enumerate() {
            let latest = ends.writer_at(j);
            while let Some((_, frame)) = frames.next_if(|(k, _)| ends.from.first + *k as u64 <= latest) {
                self.add(frame);
            }
            if self.summed > 0 {
                for (held, sum) in self.held.iter_mut().zip(&mut self.sum) {
                    *held = *sum / f64::from(self.summed);
                    *sum = 0.0;
                }
                self.summed = 0;
            }
            out.copy_from_slice(&self.held[..width]);
        }
        for (_, frame) in frames {
            self.add(frame);
        }
    }

    fn add(&mut self, frame: &[f64]) {
        for (sum, x) in self.sum.iter_mut().zip(frame) {
            *sum += x;
        }
        self.summed += 1;
    }

    fn resample(&mut self, x: &[f64], y: &mut [f64]) {
        let width = self.width;
        if width == 1 {
            if let Some(resampler) = self.resamplers.first_mut() {
                resampler.process(x, y);
            }
            return;
        }
        let (frames_in, frames_out) = (x.len() / width, y.len() / width);
        for (component, resampler) in self.resamplers.iter_mut().enumerate() {
            for (gathered, frame) in self.gathered.iter_mut().zip(x.chunks_exact(width)) {
                *gathered = frame[component];
            }
            resampler.process(&self.gathered[..frames_in], &mut self.resampled[..frames_out]);
            for (resampled, frame) in self.resampled.iter().zip(y.chunks_exact_mut(width)) {
                frame[component] = *resampled;
            }
        }
    }

    fn keep_last(&mut self, x: &[f64]) {
        if let Some(last) = x.chunks_exact(self.width).last() {
            self.held[..self.width].copy_from_slice(last);
        }
    }
}

fn fill(frames: &mut [f64], frame: &[f64]) {
    match frame {
        [value] => frames.fill(*value),
        _ => frames
            .chunks_exact_mut(frame.len())
            .for_each(|out| out.copy_from_slice(frame)),
    }
}

/// A declared delay: a ring buffer of its length.
#[derive(Debug, Clone)]
pub(crate) struct DelayState {
    pub(super) ring: Vec<f64>,
    width: usize,
    frames: u64,
}

impl DelayState {
    pub(crate) fn new(plan: &DelayPlan) -> Self {
        let components = usize::try_from(plan.frames)
            .unwrap_or(usize::MAX)
            .saturating_mul(plan.width);
        Self {
            ring: touched(vec![plan.initial; components]),
            width: plan.width,
            frames: plan.frames,
        }
    }

    /// Copies the state of a delay of the same length and width.
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
        for (j, (frame, out)) in x
            .chunks_exact(self.width)
            .zip(y.chunks_exact_mut(self.width))
            .enumerate()
        {
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
