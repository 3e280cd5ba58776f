//! The asynchronous resampler: a ring between two clocks, and a resampler at its read end whose ratio follows the fill.
//! Bridges between drivers and hardware with its own clock use it.
//!
//! Neither end has access to the other's clock. The reader polls the ring once per callback, uses the fill as a measure
//! of the delay, and corrects its ratio by a slow delay-locked loop. Its output depends only on the polled counts: a
//! replay with the same counts gives the same bits.
//!
//! **Fill** counts the frames from the newest one that has arrived to the one that the next output shows. It includes
//! the resampler's own delay, so that its target is the declared latency.

mod meter;

pub use meter::{RingCounts, RingMeter};

use crate::bridges::steered;
use crate::io::touched_ring;
use crate::plan::RingSpec;
use haptograph_signal::resample::{MAX_CORRECTION_PPM, SteeredResampler};
use rtrb::{Consumer, Producer};
use std::sync::Arc;

/// Duration of the fade-out when the ring runs dry, and of the fade-in after it, s.
pub const DRY_FADE_S: f64 = 0.005;
/// Capacity of the ring beyond twice its target, s: the longest callbacks and stalls that it absorbs.
const SPARE_S: f64 = 0.1;
/// Natural frequency of the loop times the reserve. A step of 500 ppm in drift then moves the fill by 0.46 of the
/// reserve: MAX / (e wn), for a damping of 1.
const NATURAL_FREQUENCY: f64 = 4e-4;
/// Pole that smooths the steps that callbacks cause in the fill, as a multiple of the natural frequency.
const SMOOTHING: f64 = 10.0;
const MAX_CORRECTION: f64 = MAX_CORRECTION_PPM * 1e-6;

/// Latency of a ring beyond the resampler's, s.
fn reserve_s(plan: &RingSpec) -> f64 {
    let kernel_s = steered(plan.from, plan.to).map_or(0.0, |one| one.latency_s());
    (plan.latency_s - kernel_s).max(plan.from.period_s())
}

/// Makes both ends of a ring. Allocates here only.
pub fn async_resampler(plan: &RingSpec) -> (AsyncResamplerWriter, AsyncResamplerReader) {
    let spare = SPARE_S * plan.from.hz();
    let frames = (2.0 * plan.latency_s * plan.from.hz() + spare).ceil() as usize + 64;
    let (into, out) = touched_ring(frames * plan.kind.width());
    let meter = Arc::new(RingMeter::new(plan));
    let writer = AsyncResamplerWriter {
        ring: into,
        width: plan.kind.width(),
        // The whole ring, for a writer that writes before its first poll.
        room: frames as u64,
        accepted: 0,
        meter: Arc::clone(&meter),
    };
    (writer, AsyncResamplerReader::new(plan, out, meter))
}

/// The write end.
pub struct AsyncResamplerWriter {
    ring: Producer<f64>,
    width: usize,
    /// Frames that may be pushed before the next poll.
    room: u64,
    /// Frames pushed since the last poll.
    accepted: u64,
    meter: Arc<RingMeter>,
}

impl AsyncResamplerWriter {
    /// Polls the free space, which holds until the next poll.
    pub fn poll(&mut self) {
        self.poll_as(self.free());
    }

    /// Sets the free space until the next poll, in frames; for replays.
    pub(crate) fn poll_as(&mut self, room: u64) {
        self.room = room;
        self.accepted = 0;
    }

    /// Free space now, in frames.
    pub fn free(&self) -> u64 {
        (self.ring.slots() / self.width) as u64
    }

    /// Frames pushed since the last poll.
    pub fn accepted(&self) -> u64 {
        self.accepted
    }

    /// Pushes frames; counts those that do not fit as lost.
    pub fn write(&mut self, x: &[f64]) {
        let frames = (x.len() / self.width) as u64;
        let fitting = frames.min(self.room);
        let components = fitting as usize * self.width;
        let sent = match self.ring.push_entire_slice(&x[..components]) {
            Ok(()) => fitting,
            Err(_) => 0,
        };
        self.room -= sent;
        self.accepted += sent;
        // Frames before the reader's first poll do not count as lost.
        if sent < frames && self.meter.is_read() {
            self.meter.lose(frames - sent);
        }
    }

    /// The ring's meter.
    pub fn meter(&self) -> &Arc<RingMeter> {
        &self.meter
    }
}

/// The read end, with the resampler.
pub struct AsyncResamplerReader {
    ring: Consumer<f64>,
    width: usize,
    resamplers: Vec<SteeredResampler>,
    scratch: Scratch,
    passed: Passed,
    flow: Flow,
    fades: Fades,
    /// The frame of silence.
    neutral: Box<[f64]>,
    /// The last output frame.
    latest: Box<[f64]>,
    steering: Steering,
    /// Ticks read since the last poll.
    ticks: u64,
    meter: Arc<RingMeter>,
}

/// Frames since the start.
#[derive(Default)]
struct Passed {
    /// By the last poll.
    arrived: u64,
    taken: u64,
}

/// Memory of a read.
struct Scratch {
    /// One component of the input frames.
    gathered: Vec<f64>,
    /// Input frames.
    frames: Vec<f64>,
    /// One component of the output frames.
    resampled: Vec<f64>,
}

/// Lengths in output ticks.
#[derive(Clone, Copy)]
struct Fades {
    /// Until the resampler contains only frames since its reset.
    quiet_ticks: u32,
    /// The fade-in after that, and a fade-out.
    fade_ticks: u32,
}

/// State of the reader.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Flow {
    /// Neutral until the fill has reached its target.
    Waiting,
    /// Running for this many ticks; the first are neutral, the next fade in.
    Running(u32),
    /// Fading out the latest frame for this many ticks so far.
    Falling(u32),
}

/// A delay-locked loop of second order, with a third pole that smooths the fill.
#[derive(Debug, Clone, Copy)]
struct Steering {
    /// Rate of the input.
    rate_hz: f64,
    /// Period of the output.
    period_s: f64,
    /// Target fill, frames.
    target: f64,
    /// Delay of the resampler, frames.
    half_width: f64,
    reserve_s: f64,
    /// Natural frequency, rad/s.
    natural: f64,
    /// Smoothed deviation of the fill, s.
    error_s: f64,
    /// Estimated drift.
    drift: f64,
}

impl AsyncResamplerReader {
    fn new(plan: &RingSpec, ring: Consumer<f64>, meter: Arc<RingMeter>) -> Self {
        let width = plan.kind.width();
        // The check refuses rates that cannot be resampled.
        let resamplers: Vec<SteeredResampler> =
            steered(plan.from, plan.to).map(|one| vec![one; width]).unwrap_or_default();
        let kernel_s = resamplers.first().map_or(0.0, SteeredResampler::latency_s);
        let reserve_s = reserve_s(plan);
        let ratio = plan.from.hz() / plan.to.hz();
        let at_once = (plan.max_to as f64 * ratio * (1.0 + MAX_CORRECTION)).ceil() as usize + 2;
        Self {
            ring,
            width,
            resamplers,
            scratch: Scratch {
                gathered: vec![0.0; at_once],
                frames: vec![0.0; at_once * width],
                resampled: vec![0.0; plan.max_to],
            },
            passed: Passed::default(),
            flow: Flow::Waiting,
            fades: Fades {
                quiet_ticks: (2.0 * kernel_s * plan.to.hz()).ceil() as u32,
                fade_ticks: (DRY_FADE_S * plan.to.hz()).ceil() as u32,
            },
            neutral: plan.kind.neutral().collect(),
            latest: plan.kind.neutral().collect(),
            steering: Steering {
                rate_hz: plan.from.hz(),
                period_s: plan.to.period_s(),
                target: plan.latency_s * plan.from.hz(),
                half_width: kernel_s * plan.from.hz(),
                reserve_s,
                natural: NATURAL_FREQUENCY / reserve_s,
                error_s: 0.0,
                drift: 0.0,
            },
            ticks: 0,
            meter,
        }
    }

    /// The part of its latency that bridges late frames, s.
    pub(super) fn reserve_s(&self) -> f64 {
        self.steering.reserve_s
    }

    /// Frames that have arrived since the start.
    pub fn arrivals(&self) -> u64 {
        self.passed.taken + (self.ring.slots() / self.width) as u64
    }

    /// Frames that had arrived by the last poll.
    pub fn arrived(&self) -> u64 {
        self.passed.arrived
    }

    /// Polls the ring: `arrived` frames count as arrived until the next poll.
    pub fn poll(&mut self, arrived: u64) {
        // Before new frames count: a late callback finds more, and takes more.
        let left = self.fill();
        self.passed.arrived = arrived.max(self.passed.arrived);
        let elapsed_s = self.ticks as f64 * self.steering.period_s;
        self.ticks = 0;
        match self.flow {
            Flow::Waiting => self.start_if_filled(),
            Flow::Running(_) => {
                let fill = self.fill();
                let correction = self.steering.steer(fill, elapsed_s);
                for resampler in &mut self.resamplers {
                    resampler.set_correction_ppm(correction * 1e6);
                }
                self.meter.record(fill / self.steering.rate_hz, correction * 1e6);
                if left > 2.0 * self.steering.target {
                    self.meter.count_overrun();
                    self.flow = Flow::Falling(0);
                }
            }
            Flow::Falling(_) => {}
        }
    }

    /// True if the output is the signal, the fade-in included.
    pub fn is_running(&self) -> bool {
        matches!(self.flow, Flow::Running(_))
    }

    /// Age of the next output relative to the newest frame that has arrived, s.
    pub fn fill_s(&self) -> f64 {
        self.fill() / self.steering.rate_hz
    }

    /// The fill in frames. On average a frame arrives half a period after its time.
    fn fill(&self) -> f64 {
        let ahead = self.resamplers.first().map_or(1.0, SteeredResampler::ahead);
        (self.passed.arrived - self.passed.taken) as f64 + 0.5 - ahead + self.steering.half_width
    }

    fn start_if_filled(&mut self) {
        for resampler in &mut self.resamplers {
            resampler.reset();
        }
        let beyond = self.fill() - self.steering.target;
        if beyond < 0.0 || self.resamplers.is_empty() {
            return;
        }
        let skipped = (beyond as u64).min(self.passed.arrived - self.passed.taken);
        self.drop_frames(skipped);
        // Frames before the first start do not count as lost.
        if self.meter.counts().fill_s.is_some() {
            self.meter.lose(skipped);
        }
        self.steering.error_s = 0.0;
        self.flow = Flow::Running(0);
    }

    fn drop_frames(&mut self, frames: u64) {
        if let Ok(chunk) = self.ring.read_chunk(frames as usize * self.width) {
            chunk.commit_all();
            self.passed.taken += frames;
        }
    }

    /// Gives the frames of the next ticks.
    pub fn read(&mut self, y: &mut [f64]) {
        self.ticks += (y.len() / self.width) as u64;
        let mut done = 0;
        if let Flow::Running(_) = self.flow {
            let ticks = self.ticks_within_reach(y.len() / self.width);
            done = ticks * self.width;
            self.resample(&mut y[..done]);
            if done < y.len() {
                self.meter.count_underrun();
                self.flow = Flow::Falling(0);
            }
        }
        for frame in y[done..].chunks_exact_mut(self.width) {
            self.fade_out(frame);
        }
    }

    /// Number of the next `ticks` outputs for which enough frames have arrived.
    fn ticks_within_reach(&self, ticks: usize) -> usize {
        let Some(resampler) = self.resamplers.first() else {
            return 0;
        };
        let waiting = (self.passed.arrived - self.passed.taken) as usize;
        if resampler.inputs_needed(ticks) <= waiting {
            return ticks;
        }
        let (mut enough, mut lacking) = (0, ticks);
        while lacking - enough > 1 {
            let middle = (enough + lacking) / 2;
            match resampler.inputs_needed(middle) <= waiting {
                true => enough = middle,
                false => lacking = middle,
            }
        }
        enough
    }

    /// Gives frames for which enough input has arrived.
    fn resample(&mut self, y: &mut [f64]) {
        let (width, ticks) = (self.width, y.len() / self.width);
        let needed = self.resamplers.first().map_or(0, |one| one.inputs_needed(ticks));
        let Self { ring, resamplers, scratch: Scratch { gathered, frames, resampled }, .. } = self;
        let frames = &mut frames[..needed * width];
        if ring.pop_entire_slice(frames).is_err() {
            // Unreachable: arrived frames stay in the ring until they are taken.
            frames.fill(0.0);
        }
        self.passed.taken += needed as u64;
        for (component, resampler) in resamplers.iter_mut().enumerate() {
            for (gathered, frame) in gathered.iter_mut().zip(frames.chunks_exact(width)) {
                *gathered = frame[component];
            }
            resampler.process(&gathered[..needed], &mut resampled[..ticks]);
            for (resampled, frame) in resampled.iter().zip(y.chunks_exact_mut(width)) {
                frame[component] = *resampled;
            }
        }
        self.fade_in(y);
        if let Some(last) = y.chunks_exact(width).last() {
            self.latest.copy_from_slice(last);
        }
    }

    /// Fades in the first ticks.
    fn fade_in(&mut self, y: &mut [f64]) {
        let Flow::Running(risen) = &mut self.flow else {
            return;
        };
        for frame in y.chunks_exact_mut(self.width) {
            if *risen >= self.fades.quiet_ticks + self.fades.fade_ticks {
                return;
            }
            let factor =
                f64::from(risen.saturating_sub(self.fades.quiet_ticks)) / f64::from(self.fades.fade_ticks);
            for (x, neutral) in frame.iter_mut().zip(&self.neutral) {
                *x = towards(*neutral, *x, factor);
            }
            *risen += 1;
        }
    }

    /// Gives a frame of the fade-out, and neutral ones after it.
    fn fade_out(&mut self, frame: &mut [f64]) {
        let Flow::Falling(fallen) = self.flow else {
            frame.copy_from_slice(&self.neutral);
            return;
        };
        let fallen = fallen + 1;
        let factor = 1.0 - f64::from(fallen) / f64::from(self.fades.fade_ticks.max(1));
        for ((x, latest), neutral) in frame.iter_mut().zip(&self.latest).zip(&self.neutral) {
            *x = towards(*neutral, *latest, factor.max(0.0));
        }
        self.flow = match fallen >= self.fades.fade_ticks {
            true => Flow::Waiting,
            false => Flow::Falling(fallen),
        };
    }
}

/// The number that lies this part of the way from a neutral one to another.
fn towards(neutral: f64, x: f64, part: f64) -> f64 {
    // The sum would lose the sign of a zero.
    if neutral == 0.0 {
        return x * part;
    }
    neutral + (x - neutral) * part
}

impl Steering {
    /// Correction of the ratio for a fill in frames, `elapsed_s` after the last one.
    fn steer(&mut self, fill: f64, elapsed_s: f64) -> f64 {
        let latency_s = self.target / self.rate_hz;
        let error_s = ((fill - self.target) / self.rate_hz).clamp(-latency_s, latency_s);
        let smoothing = SMOOTHING * self.natural * elapsed_s;
        self.error_s += (error_s - self.error_s) * smoothing / (1.0 + smoothing);
        self.drift += self.natural * self.natural * self.error_s * elapsed_s;
        self.drift = self.drift.clamp(-MAX_CORRECTION, MAX_CORRECTION);
        let correction = 2.0 * self.natural * self.error_s + self.drift;
        correction.clamp(-MAX_CORRECTION, MAX_CORRECTION)
    }
}

#[cfg(test)]
mod tests;
