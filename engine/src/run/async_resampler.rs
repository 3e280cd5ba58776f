//! How a signal goes from one clock to another: a ring, and a resampler at its far end that is steered by how full it
//! is. Bridges between drivers are such rings, and so is what comes from hardware with a clock of its own.
//!
//! Neither end knows the other's clock. The reader looks at the ring before it runs (once a callback), takes the fill
//! for the delay, and corrects its ratio by a slow delay-locked loop. Everything after that look depends on the counts
//! seen alone: the same counts give the same bits, which is what replays rest on.
//!
//! **Fill** is counted from the newest frame that has arrived to the one that the next output shows, so that the
//! resampler's own delay is part of it, and the target is the whole of the declared latency.

mod meter;

pub use meter::{RingCounts, RingMeter};

use crate::io::touched_ring;
use crate::joining::steered;
use crate::plan::RingSpec;
use haptograph_signal::resample::{MAX_CORRECTION_PPM, SteeredResampler};
use rtrb::{Consumer, Producer};
use std::sync::Arc;

/// How long a signal takes to nothing when the ring has run dry, and back from it.
pub const DRY_FADE_S: f64 = 0.005;
/// What the ring holds beyond twice its target: the longest callbacks and stalls that are caught up with.
const SPARE_S: f64 = 0.1;
/// A drift of 500 ppm that begins at once moves the fill by 0.46 of the reserve: MAX / (e wn), for a damping of 1.
const NATURAL_FREQUENCY: f64 = 4e-4;
/// The pole that takes the steps of both sides' callbacks out of the fill, as a multiple of the natural frequency.
const SMOOTHING: f64 = 10.0;
const MAX_CORRECTION: f64 = MAX_CORRECTION_PPM * 1e-6;
/// Lanes of a wrench, the widest frame that can be resampled.
const MAX_WIDTH: usize = 6;

/// What a ring's latency leaves beyond the resampler's, s.
pub(super) fn reserve_s(plan: &RingSpec) -> f64 {
    let kernel_s = steered(plan.from, plan.to).map_or(0.0, |one| one.latency_s());
    (plan.latency_s - kernel_s).max(plan.from.period_s())
}

/// Both ends of a ring. Allocates here and never again.
pub fn async_resampler(plan: &RingSpec) -> (AsyncResamplerWriter, AsyncResamplerReader) {
    let spare = SPARE_S * plan.from.hz();
    let frames = (2.0 * plan.latency_s * plan.from.hz() + spare).ceil() as usize + 64;
    let (into, out) = touched_ring(frames * plan.width);
    let meter = Arc::new(RingMeter::new(plan));
    let writer = AsyncResamplerWriter {
        ring: into,
        width: plan.width,
        // All of it, for the end that is first looked at after it was written.
        room: frames as u64,
        accepted: 0,
        meter: Arc::clone(&meter),
    };
    (writer, AsyncResamplerReader::new(plan, out, meter))
}

/// The end that a producer fills.
pub struct AsyncResamplerWriter {
    ring: Producer<f64>,
    width: usize,
    /// Frames that may be pushed before the next look.
    room: u64,
    /// Frames pushed since the last look.
    accepted: u64,
    meter: Arc<RingMeter>,
}

impl AsyncResamplerWriter {
    /// Finds out how many frames there is room for, to stay with that until the next look.
    pub fn poll(&mut self) {
        self.poll_as(self.free());
    }

    /// Goes by room for so many frames until the next look.
    pub fn poll_as(&mut self, room: u64) {
        self.room = room;
        self.accepted = 0;
    }

    /// Frames there is room for now.
    pub fn free(&self) -> u64 {
        (self.ring.slots() / self.width) as u64
    }

    /// Frames pushed since the last look.
    pub fn accepted(&self) -> u64 {
        self.accepted
    }

    /// Sends frames; those without room are lost and counted.
    pub fn write(&mut self, x: &[f64]) {
        let frames = (x.len() / self.width) as u64;
        let fitting = frames.min(self.room);
        let lanes = fitting as usize * self.width;
        let sent = match self.ring.push_entire_slice(&x[..lanes]) {
            Ok(()) => fitting,
            Err(_) => 0,
        };
        self.room -= sent;
        self.accepted += sent;
        // What comes before the other end first looks was never wanted.
        if sent < frames && self.meter.is_read() {
            self.meter.lose(frames - sent);
        }
    }

    /// What is counted of the ring.
    pub fn meter(&self) -> &Arc<RingMeter> {
        &self.meter
    }
}

/// The end that a consumer reads, at its own rate.
pub struct AsyncResamplerReader {
    ring: Consumer<f64>,
    width: usize,
    resamplers: Vec<SteeredResampler>,
    /// One lane of what is taken at once, and of what is made of it.
    gathered: Vec<f64>,
    taken_frames: Vec<f64>,
    resampled: Vec<f64>,
    /// Frames that had arrived when it looked last, and frames taken, both since the beginning.
    arrived: u64,
    taken: u64,
    flow: Flow,
    /// Until the resampler has seen nothing but what has arrived since it began, and then until nothing is faded.
    quiet_ticks: u32,
    fade_ticks: u32,
    /// The frame put out last.
    latest: [f64; MAX_WIDTH],
    steering: Steering,
    /// Ticks read since the last look.
    ticks: u64,
    meter: Arc<RingMeter>,
}

/// What the reader is doing.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Flow {
    /// Silent, until as much has arrived as it aims at.
    Waiting,
    /// Running, for so many ticks, of which the first are silent and the next rise from nothing.
    Running(u32),
    /// The latest frame falls to nothing, for so many ticks so far.
    Falling(u32),
}

/// A delay-locked loop of second order, with one more pole to smooth what it sees.
#[derive(Debug, Clone, Copy)]
struct Steering {
    /// Frames a second of the input, and seconds a tick of the output.
    rate_hz: f64,
    period_s: f64,
    /// Frames that the fill should be, and how many of them are the resampler's.
    target: f64,
    half_width: f64,
    /// rad/s
    natural: f64,
    /// What it sees, smoothed, s; and the drift that it has learnt.
    error_s: f64,
    drift: f64,
}

impl AsyncResamplerReader {
    fn new(plan: &RingSpec, ring: Consumer<f64>, meter: Arc<RingMeter>) -> Self {
        // A checked graph has no rates that cannot be joined.
        let resamplers: Vec<SteeredResampler> = steered(plan.from, plan.to)
            .map(|one| vec![one; plan.width])
            .unwrap_or_default();
        let kernel_s = resamplers.first().map_or(0.0, SteeredResampler::latency_s);
        let ratio = plan.from.hz() / plan.to.hz();
        let at_once = (plan.max_to as f64 * ratio * (1.0 + MAX_CORRECTION)).ceil() as usize + 2;
        Self {
            ring,
            width: plan.width,
            resamplers,
            gathered: vec![0.0; at_once],
            taken_frames: vec![0.0; at_once * plan.width],
            resampled: vec![0.0; plan.max_to],
            arrived: 0,
            taken: 0,
            flow: Flow::Waiting,
            quiet_ticks: (2.0 * kernel_s * plan.to.hz()).ceil() as u32,
            fade_ticks: (DRY_FADE_S * plan.to.hz()).ceil() as u32,
            latest: [0.0; MAX_WIDTH],
            steering: Steering {
                rate_hz: plan.from.hz(),
                period_s: plan.to.period_s(),
                target: plan.latency_s * plan.from.hz(),
                half_width: kernel_s * plan.from.hz(),
                natural: NATURAL_FREQUENCY / reserve_s(plan),
                error_s: 0.0,
                drift: 0.0,
            },
            ticks: 0,
            meter,
        }
    }

    /// How many frames have arrived since the beginning.
    pub fn arrivals(&self) -> u64 {
        self.taken + (self.ring.slots() / self.width) as u64
    }

    /// How many of them it goes by.
    pub fn arrived(&self) -> u64 {
        self.arrived
    }

    /// Goes by `arrived` frames until the next look.
    pub fn poll(&mut self, arrived: u64) {
        // What the last callback left, as a late one finds more, and takes more.
        let left = self.fill();
        self.arrived = arrived.max(self.arrived);
        let elapsed_s = self.ticks as f64 * self.steering.period_s;
        self.ticks = 0;
        match self.flow {
            Flow::Waiting => self.begin_where_it_can(),
            Flow::Running(_) => {
                let fill = self.fill();
                let correction = self.steering.steer(fill, elapsed_s);
                for resampler in &mut self.resamplers {
                    resampler.set_correction_ppm(correction * 1e6);
                }
                self.meter.saw(fill / self.steering.rate_hz, correction * 1e6);
                if left > 2.0 * self.steering.target {
                    self.meter.count_overrun();
                    self.flow = Flow::Falling(0);
                }
            }
            Flow::Falling(_) => {}
        }
    }

    /// Does what has arrived come out, be it still rising from nothing?
    pub fn is_running(&self) -> bool {
        matches!(self.flow, Flow::Running(_))
    }

    /// How old what the next output shows is by the newest frame that has arrived, s.
    pub fn fill_s(&self) -> f64 {
        self.fill() / self.steering.rate_hz
    }

    /// Frames from the newest one that has arrived to the one that the next output shows. On average a frame arrives
    /// half a period after its time has come.
    fn fill(&self) -> f64 {
        let ahead = self.resamplers.first().map_or(1.0, SteeredResampler::ahead);
        (self.arrived - self.taken) as f64 + 0.5 - ahead + self.steering.half_width
    }

    fn begin_where_it_can(&mut self) {
        for resampler in &mut self.resamplers {
            resampler.reset();
        }
        let beyond = self.fill() - self.steering.target;
        if beyond < 0.0 || self.resamplers.is_empty() {
            return;
        }
        let skipped = (beyond as u64).min(self.arrived - self.taken);
        self.drop_frames(skipped);
        // What came before it first ran was never wanted.
        if self.meter.counts().fill_s.is_some() {
            self.meter.lose(skipped);
        }
        self.steering.error_s = 0.0;
        self.flow = Flow::Running(0);
    }

    fn drop_frames(&mut self, frames: u64) {
        if let Ok(chunk) = self.ring.read_chunk(frames as usize * self.width) {
            chunk.commit_all();
            self.taken += frames;
        }
    }

    /// The frames of the ticks that come next.
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
            self.fall(frame);
        }
    }

    /// How many of the next `ticks` outputs what has arrived is enough for.
    fn ticks_within_reach(&self, ticks: usize) -> usize {
        let Some(resampler) = self.resamplers.first() else {
            return 0;
        };
        let waiting = (self.arrived - self.taken) as usize;
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

    /// Frames that what has arrived is enough for.
    fn resample(&mut self, y: &mut [f64]) {
        let (width, ticks) = (self.width, y.len() / self.width);
        let needed = self.resamplers.first().map_or(0, |one| one.inputs_needed(ticks));
        let Self {
            ring,
            resamplers,
            gathered,
            taken_frames,
            resampled,
            ..
        } = self;
        let frames = &mut taken_frames[..needed * width];
        if ring.pop_entire_slice(frames).is_err() {
            // Never so: what has arrived stays until it is taken.
            frames.fill(0.0);
        }
        self.taken += needed as u64;
        for (lane, resampler) in resamplers.iter_mut().enumerate() {
            for (gathered, frame) in gathered.iter_mut().zip(frames.chunks_exact(width)) {
                *gathered = frame[lane];
            }
            resampler.process(&gathered[..needed], &mut resampled[..ticks]);
            for (resampled, frame) in resampled.iter().zip(y.chunks_exact_mut(width)) {
                frame[lane] = *resampled;
            }
        }
        self.rise(y);
        if let Some(last) = y.chunks_exact(width).last() {
            self.latest[..width].copy_from_slice(last);
        }
    }

    /// The first ticks rise from nothing.
    fn rise(&mut self, y: &mut [f64]) {
        let Flow::Running(risen) = &mut self.flow else {
            return;
        };
        for frame in y.chunks_exact_mut(self.width) {
            if *risen >= self.quiet_ticks + self.fade_ticks {
                return;
            }
            let factor = f64::from(risen.saturating_sub(self.quiet_ticks)) / f64::from(self.fade_ticks);
            frame.iter_mut().for_each(|x| *x *= factor);
            *risen += 1;
        }
    }

    /// A frame of the way to nothing, and then of nothing.
    fn fall(&mut self, frame: &mut [f64]) {
        let Flow::Falling(fallen) = self.flow else {
            frame.fill(0.0);
            return;
        };
        let fallen = fallen + 1;
        let factor = 1.0 - f64::from(fallen) / f64::from(self.fade_ticks.max(1));
        for (x, latest) in frame.iter_mut().zip(&self.latest) {
            *x = latest * factor.max(0.0);
        }
        self.flow = match fallen >= self.fade_ticks {
            true => Flow::Waiting,
            false => Flow::Falling(fallen),
        };
    }
}

impl Steering {
    /// The correction of the ratio for a fill in frames, seen `elapsed_s` after the last one.
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
