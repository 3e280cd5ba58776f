//! Grain: a texture's excitation whose level fluctuates faster than speed and force.
//!
//! The excitation is `G g` with white Gaussian `g`. The gain G follows a curve over a Gaussian process `z` of variance 1, the
//! sum of seven resonators at the octaves from 2 to 128 Hz with a quality factor of 2 (Zölzer, DAFX, 2nd ed., 2.4), computed
//! once a millisecond; between two ticks G is linear. The mean of G² is 1, so that power and spectrum stay those of the map;
//! only their course in time, and with it the distribution, changes.

use super::{Layer, LayerBank, LayerError, LayerKind, LayerVoice, RenderRates, Stage, parse};
use crate::TextureModel;
use crate::files::native::{Bounded, Thousandths, write_numbers};
use crate::rendering::{BLOCK, Block, LANES, Row};
use haptograph_signal::noise::Gaussian;
use haptograph_signal::units::decimal::significant;
use pulp::{Simd, WithSimd};
use serde::Deserialize;
use serde_json::{Value, json};
use std::f64::consts::{FRAC_2_PI, SQRT_2, TAU};
use std::fmt::Write;
use std::sync::Arc;

/// Middles of the octaves, Hz.
pub const OCTAVES_HZ: [f64; 7] = [2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0];
const OCTAVES: usize = OCTAVES_HZ.len();
/// Number of the points of `z` at which the gain is given, evenly from -2.6 to 2.6. It is constant beyond them.
pub const POINTS: usize = 16;
/// The highest of the points.
const HIGHEST: f64 = 2.6;
const SPACING: f64 = 2.0 * HIGHEST / (POINTS - 1) as f64;
/// Bounds of the gain, dB.
const LOWEST_DB: f64 = -80.0;
const HIGHEST_DB: f64 = 30.0;
/// How far the sum of the shares may be from 1.
const TOLERANCE: f64 = 1e-6;
/// Deepest crackle, and its longest time constant, s: the layer of earlier files.
const MAX_DEPTH: f64 = 2.0;
const MAX_TIME_CONSTANT_S: f64 = 1.0;
/// Interval of the ticks, s; a whole number of samples, at least one.
const TICK_S: f64 = 0.001;

/// How the level of a texture's excitation fluctuates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grain {
    octave_shares: [f64; OCTAVES],
    gain_db: [f64; POINTS],
}

impl Grain {
    /// Grain whose process has these shares of its variance in the octaves of [`OCTAVES_HZ`] (at least 0, their sum 1 within
    /// 1e-6), with the gain, dB, at the [`POINTS`] (-80 to 30, never falling). Only differences of gains count.
    ///
    /// # Errors
    /// [`GrainError`] for another number of values, or values out of these ranges.
    pub fn new(octave_shares: &[f64], gain_db: &[f64]) -> Result<Self, LayerError> {
        let (octaves, points) = (octave_shares.len(), gain_db.len());
        let (Ok(shares), Ok(gains)) = (<[f64; OCTAVES]>::try_from(octave_shares), gain_db.try_into()) else {
            return Err(LayerError::new(GrainError::Lengths { octaves, points }));
        };
        let grain = Self { octave_shares: shares, gain_db: gains };
        let sum: f64 = shares.iter().sum();
        if !((sum - 1.0).abs() <= TOLERANCE && shares.iter().all(|share| *share >= 0.0)) {
            return Err(LayerError::new(GrainError::Shares { sum }));
        }
        let within = |gain: &f64| (LOWEST_DB..=HIGHEST_DB).contains(gain);
        let sound = |pair: &[f64]| within(&pair[0]) && within(&pair[1]) && pair[0] <= pair[1];
        match grain.gain_db.windows(2).position(|pair| !sound(pair)) {
            Some(point) => Err(LayerError::new(GrainError::Gains { point: point + 1 })),
            None => Ok(grain),
        }
    }

    /// The grain nearest to crackle, the layer of earlier files: the logarithm of the power is a Gaussian process of the
    /// standard deviation `depth` (above 0, at most 2) whose correlation falls to 1/e in `time_constant_s` (above 0, at most 1).
    /// The shares are the powers of its spectrum in the octaves. The last gain is what keeps the kurtosis `3 exp(depth²)`,
    /// of which the gain between ticks loses up to 15 % where the time constant is a few milliseconds.
    ///
    /// # Errors
    /// [`GrainError::Crackle`] for values out of these ranges.
    pub fn of_crackle(depth: f64, time_constant_s: f64) -> Result<Self, LayerError> {
        let within = |x: f64, most: f64| x > 0.0 && x <= most;
        if !(within(depth, MAX_DEPTH) && within(time_constant_s, MAX_TIME_CONSTANT_S)) {
            return Err(LayerError::new(GrainError::Crackle { depth, time_constant_s }));
        }
        let below = |octave: usize| match OCTAVES_HZ.get(octave) {
            Some(_) if octave == 0 => 0.0,
            Some(middle_hz) => FRAC_2_PI * (TAU * time_constant_s * middle_hz / SQRT_2).atan(),
            None => 1.0,
        };
        let shares: [f64; OCTAVES] = std::array::from_fn(|octave| below(octave + 1) - below(octave));
        let gain = |point| (0.5 * depth * (SPACING * point as f64 - HIGHEST)).exp();
        let mut curve = Curve(std::array::from_fn(gain));
        // The gain is bounded: what lies beyond the last point must be made up for there.
        let (mut low, mut high) = (curve.0[POINTS - 1], curve.0[0] * amplitude(HIGHEST_DB - LOWEST_DB));
        for _ in 0..40 {
            curve.0[POINTS - 1] = 0.5 * (low + high);
            let [second, fourth] = [2, 4].map(|power| curve.mean(|gain| gain.powi(power)));
            let end = if fourth < (depth * depth).exp() * second * second { &mut low } else { &mut high };
            *end = curve.0[POINTS - 1];
        }
        let over_db = (decibels(curve.0[POINTS - 1]) - HIGHEST_DB).max(0.0);
        Self::new(&shares, &curve.0.map(|gain| (decibels(gain) - over_db).clamp(LOWEST_DB, HIGHEST_DB)))
    }

    /// Shares of the process's variance in the octaves.
    pub fn octave_shares(&self) -> &[f64] {
        &self.octave_shares
    }

    /// Gain at the points, dB.
    pub fn gain_db(&self) -> &[f64] {
        &self.gain_db
    }

    fn curve(&self) -> Curve {
        Curve(self.gain_db.map(amplitude))
    }
}

/// Grain out of range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum GrainError {
    #[error(
        "grain of {octaves} shares and {points} gains: it has {OCTAVES} octave shares and {POINTS} gains"
    )]
    Lengths { octaves: usize, points: usize },
    #[error(
        "grain with octave shares of the sum {sum}: each must be at least 0, their sum 1 within {TOLERANCE}"
    )]
    Shares { sum: f64 },
    #[error(
        "grain whose gain {point} (from 0) or the one before is out of bounds or falls: gains are {LOWEST_DB} to {HIGHEST_DB} dB and never fall"
    )]
    Gains { point: usize },
    #[error(
        "crackle of depth {depth} and time constant {time_constant_s} s: the depth must be above 0 and at most {MAX_DEPTH}, the time constant above 0 and at most {MAX_TIME_CONSTANT_S} s"
    )]
    Crackle { depth: f64, time_constant_s: f64 },
}

/// Grain in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GrainDocument {
    octave_shares: Bounded<f64, OCTAVES>,
    gain_db: Bounded<f64, POINTS>,
}

/// Crackle in an earlier file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EarlierCrackle {
    depth: f64,
    time_constant_ms: Thousandths,
}

/// The layer's type.
pub const KIND: LayerKind = LayerKind {
    name: "grain",
    title: "grain",
    stage: Stage::Excitation,
    components: &[],
    parse: |text| {
        parse(text, |document: GrainDocument| {
            Grain::new(&document.octave_shares.0, &document.gain_db.0).map(Some)
        })
    },
    absent: || Value::Null,
};

/// The field of earlier files, which is read as grain: for a [`LayerSet`](super::LayerSet) that reads them.
pub const CRACKLE: LayerKind = LayerKind {
    name: "crackle",
    parse: |text| {
        parse(text, |document: EarlierCrackle| {
            Grain::of_crackle(document.depth, document.time_constant_ms.si).map(Some)
        })
    },
    ..KIND
};

impl Layer for Grain {
    fn kind(&self) -> &'static LayerKind {
        &KIND
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        writeln!(out, "        grain: (")?;
        write_numbers(out, "            octave_shares: ", &self.octave_shares)?;
        write_numbers(out, "            gain_db: ", &self.gain_db)?;
        writeln!(out, "        ),")
    }

    fn voice(&self, rates: RenderRates, seed: u64) -> Box<dyn LayerVoice> {
        Box::new(GrainSource::at(self, rates, seed))
    }

    fn bank(&self, voices: Vec<Box<dyn LayerVoice>>) -> Box<dyn LayerBank> {
        let sources = voices.iter().filter_map(|voice| voice.downcast_ref::<GrainSource>().cloned());
        Box::new(GrainBank::new(sources.collect()))
    }

    fn json(&self) -> Value {
        json!({ "octave_shares": self.octave_shares, "gain_db": self.gain_db })
    }

    fn summary(&self, _: f64) -> String {
        let curve = self.curve();
        let [mean, square] = [1, 2].map(|power| curve.mean(|gain| decibels(gain).powi(power)));
        let deviation_db = (square - mean * mean).max(0.0).sqrt();
        let shares = self.octave_shares.iter().zip(OCTAVES_HZ);
        let fastest = shares.max_by(|(a, _), (b, _)| a.total_cmp(b)).map_or(0.0, |(_, middle_hz)| middle_hz);
        format!("grain of {} dB, most about {fastest} Hz", significant(deviation_db, 2))
    }
}

impl TextureModel {
    /// The fluctuation of the excitation's level; `None` for plain white noise.
    pub fn grain(&self) -> Option<Grain> {
        self.layer().copied()
    }

    /// The same texture with an excitation whose level fluctuates by `grain`.
    pub fn with_grain(self, grain: Option<Grain>) -> Self {
        match grain {
            Some(grain) => self.with_checked(Arc::new(grain)),
            None => self.without_layer(KIND.name),
        }
    }
}

fn amplitude(db: f64) -> f64 {
    10f64.powf(db / 20.0)
}

fn decibels(amplitude: f64) -> f64 {
    20.0 * amplitude.log10()
}

/// The gain at the points, linear between them.
#[derive(Debug, Clone, Copy)]
struct Curve([f64; POINTS]);

impl Curve {
    #[inline(always)]
    fn at(&self, z: f64) -> f64 {
        let place = ((z + HIGHEST) / SPACING).clamp(0.0, (POINTS - 1) as f64);
        let below = (place as usize).min(POINTS - 2);
        let [low, high] = [self.0[below], self.0[below + 1]];
        low + (place - below as f64) * (high - low)
    }

    /// Values of `z` to 6.9 deviations with their gains and weights, by the midpoint rule.
    fn nodes(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        const STEP: f64 = 0.5 * SPACING;
        (-40..40).map(|number| {
            let z = STEP * (f64::from(number) + 0.5);
            (z, self.at(z), STEP * (-0.5 * z * z).exp() / TAU.sqrt())
        })
    }

    /// The mean of a function of the gain.
    fn mean(&self, of: impl Fn(f64) -> f64) -> f64 {
        self.nodes().map(|(_, gain, weight)| weight * of(gain)).sum()
    }

    /// Divides by the root of the mean square of the gain, which is linear over `samples` from one tick to the next, where the
    /// process is correlated by `kept` from tick to tick.
    fn normalise(&mut self, samples: f64, kept: f64) {
        const ORDERS: usize = 24;
        const NODES: usize = 40;
        // Parts of the gain by Hermite polynomials of z, of which the one of order n is correlated by kept^n (Mehler 1866).
        // Those of even order are even: nodes above 0 stand for those below.
        let (mut parts, mut power) = ([0.0; ORDERS], 0.0);
        let (mut z, mut weighted) = ([0.0; NODES], [[0.0; NODES]; 2]);
        for (number, (at, gain, weight)) in self.nodes().enumerate() {
            let (node, sign) =
                if number < NODES { (NODES - 1 - number, -1.0) } else { (number - NODES, 1.0) };
            z[node] = at;
            weighted[0][node] += weight * gain;
            weighted[1][node] += sign * weight * gain;
            power += weight * gain * gain;
        }
        let (mut before, mut polynomial) = ([0.0; NODES], [1.0; NODES]);
        for (order, part) in parts.iter_mut().enumerate() {
            let (last, next) = ((order as f64).sqrt(), 1.0 / (order as f64 + 1.0).sqrt());
            for (node, weighted) in weighted[order % 2].iter().enumerate() {
                *part += weighted * polynomial[node];
                let above = (z[node] * polynomial[node] - last * before[node]) * next;
                (before[node], polynomial[node]) = (polynomial[node], above);
            }
        }
        let known: f64 = parts.iter().map(|part| part * part).sum();
        let orders = parts.iter().rev().fold(0.0, |sum, part| kept * sum + part * part);
        let common = orders + (power - known).max(0.0) * kept.powi(ORDERS as i32);
        // A mix of two ticks by f and 1 - f loses 2 f (1 - f) of what differs between them; this is its mean over the samples.
        let squared = samples * samples;
        power -= (squared - 1.0) / (3.0 * squared) * (power - common);
        self.0 = self.0.map(|gain| gain / power.sqrt());
    }
}

/// Factors of a resonator of variance 1: of its input, of its last sample, and of the one before.
type Factors = [f64; 3];

/// The resonators' factors at the ticks' rate.
fn factors(tick_hz: f64) -> [Factors; OCTAVES] {
    /// Highest middle of a resonator, of the ticks' rate.
    const HIGHEST_OF_RATE: f64 = 0.4;
    const QUALITY: f64 = 2.0;
    OCTAVES_HZ.map(|middle_hz| {
        let turn = TAU * middle_hz.min(HIGHEST_OF_RATE * tick_hz) / tick_hz;
        let g = 1.0 / (1.0 + (turn / (2.0 * QUALITY)).tan());
        [(1.0 - g).sqrt(), 2.0 * g * turn.cos(), 2.0 * g - 1.0]
    })
}

/// Two states of a resonator (transposed direct form) as if it had always run, from two normal samples.
fn settled([_, kept, before]: Factors, [one, other]: [f64; 2]) -> [f64; 2] {
    // Each has the variance g; their covariance is -g times the cosine of the resonator's turn from tick to tick.
    let g = 0.5 * (1.0 + before);
    let cos = 0.5 * kept / g;
    [g.sqrt() * one, g.sqrt() * ((1.0 - cos * cos).max(0.0).sqrt() * other - cos * one)]
}

/// The grain of voices side by side. No operation is fused, so that a voice has the same bits in any company.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct Grains<const L: usize> {
    /// Samples from one tick to the next, and of them those done.
    samples: u32,
    done: u32,
    factors: [Factors; OCTAVES],
    /// Roots of the shares.
    shares: [[f64; L]; OCTAVES],
    curves: [Curve; L],
    states: [[[f64; L]; OCTAVES]; 2],
    /// Gains at the last tick and the next.
    gains: [[f64; L]; 2],
}

impl<const L: usize> Grains<L> {
    /// Multiplies frames of one tick by the gain.
    #[inline(always)]
    fn modulate(&mut self, frames: &mut [[f64; L]]) {
        let [gain, next] = self.gains;
        let mut slope = [0.0; L];
        for l in 0..L {
            slope[l] = (next[l] - gain[l]) / f64::from(self.samples);
        }
        for (frame, n) in frames.iter_mut().zip(self.done..) {
            let (mut modulated, n) = (*frame, f64::from(n));
            for l in 0..L {
                modulated[l] *= gain[l] + slope[l] * n;
            }
            *frame = modulated;
        }
        self.done += frames.len() as u32;
    }

    /// The process at the next tick, from normal samples for its octaves.
    ///
    /// Loops go over copies: as short ones are made into vectors only where nothing can overlap.
    #[inline(always)]
    fn process(&mut self, drawn: &[[f64; L]]) -> [f64; L] {
        let mut z = [0.0; L];
        for (k, drawn) in drawn.iter().enumerate().take(OCTAVES) {
            let ([input, kept, before], drawn, shares) = (self.factors[k], *drawn, self.shares[k]);
            let (mut first, mut second) = (self.states[0][k], self.states[1][k]);
            for l in 0..L {
                let fresh = input * drawn[l];
                let sample = fresh + first[l];
                first[l] = kept * sample + second[l];
                second[l] = -fresh - before * sample;
                z[l] += shares[l] * sample;
            }
            (self.states[0][k], self.states[1][k]) = (first, second);
        }
        z
    }

    /// Begins a tick with normal samples for the octaves of the next one.
    #[inline(always)]
    fn tick(&mut self, drawn: &[[f64; L]]) {
        let z = self.process(drawn);
        let mut gains = [0.0; L];
        for l in 0..L {
            gains[l] = self.curves[l].at(z[l]);
        }
        (self.gains, self.done) = ([self.gains[1], gains], 0);
    }
}

/// Modulates white excitation with grain, in real time. It does not allocate; its output does not depend on block sizes.
#[derive(Debug, Clone)]
pub struct GrainSource {
    noise: Gaussian,
    grains: Grains<1>,
}

impl GrainSource {
    /// A source of `grain` at `rate_hz`; the same `seed` gives the same fluctuation.
    pub fn new(grain: &Grain, rate_hz: f64, seed: u64) -> Self {
        Self::at(grain, RenderRates { rate_hz, models_hz: rate_hz }, seed)
    }

    fn at(grain: &Grain, RenderRates { rate_hz, models_hz }: RenderRates, seed: u64) -> Self {
        let samples = (TICK_S * rate_hz).round().max(1.0) as u32;
        // Slower models take one sample in so many.
        let heard = (f64::from(samples) * (models_hz / rate_hz).min(1.0)).round().max(1.0);
        let factors = factors(rate_hz / f64::from(samples));
        // The correlation of a resonator's samples that follow each other is half the factor of the last one.
        let kept = grain.octave_shares.iter().zip(factors).map(|(share, [_, kept, _])| 0.5 * share * kept);
        let mut curve = grain.curve();
        curve.normalise(heard, kept.sum());
        let mut noise = Gaussian::new(seed);
        let mut drawn = [[0.0; OCTAVES]; 2];
        noise.fill(drawn.as_flattened_mut());
        let settled: [_; OCTAVES] = std::array::from_fn(|k| settled(factors[k], drawn.map(|drawn| drawn[k])));
        let grains = Grains {
            samples,
            done: 0,
            factors,
            shares: grain.octave_shares.map(|share| [share.sqrt()]),
            curves: [curve],
            states: [0, 1].map(|state| settled.map(|settled| [settled[state]])),
            gains: [[0.0]; 2],
        };
        let mut source = Self { noise, grains };
        (0..2).for_each(|_| source.tick());
        source
    }

    fn tick(&mut self) {
        let mut drawn = [[0.0]; OCTAVES];
        self.noise.fill(drawn.as_flattened_mut());
        self.grains.tick(&drawn);
    }
}

impl LayerVoice for GrainSource {
    /// Multiplies the next samples of the excitation by the gain.
    fn process(&mut self, excitation: &mut [f64]) {
        let (mut frames, _) = excitation.as_chunks_mut();
        while !frames.is_empty() {
            let count = ((self.grains.samples - self.grains.done) as usize).min(frames.len());
            let (now, later) = frames.split_at_mut(count);
            self.grains.modulate(now);
            if self.grains.done == self.grains.samples {
                self.tick();
            }
            frames = later;
        }
    }

    fn copy_state_from(&mut self, other: &dyn LayerVoice) {
        if let Some(other) = other.downcast_ref::<Self>() {
            self.noise.clone_from(&other.noise);
            let Grains { samples, done, states, gains, .. } = other.grains;
            // The curve and the shares take over from the tick after the next one on.
            (self.grains.states, self.grains.gains) = (states, gains);
            self.grains.done = done;
            if samples != self.grains.samples {
                let part = f64::from(done) / f64::from(samples);
                self.grains.gains[0][0] += part * (gains[1][0] - gains[0][0]);
                self.grains.done = 0;
            }
        }
    }

    fn boxed_clone(&self) -> Box<dyn LayerVoice> {
        Box::new(self.clone())
    }
}

/// One [`GrainSource`] per lane, all of one rate and at the beginning, with the same samples.
struct GrainBank {
    noise: Vec<Gaussian>,
    grains: Grains<LANES>,
    /// Normal samples of the ticks to come, and the number of those that were used.
    drawn: Box<[Row; BLOCK]>,
    used: usize,
}

/// Normal samples drawn at a time: those of whole ticks.
const DRAWN: usize = BLOCK / OCTAVES * OCTAVES;

impl GrainBank {
    fn new(sources: Vec<GrainSource>) -> Self {
        let source = |l: usize| sources.get(l).map(|source| &source.grains);
        let row = |of: &dyn Fn(&Grains<1>) -> [f64; 1]| -> Row {
            std::array::from_fn(|l| source(l).map_or(0.0, |grains| of(grains)[0]))
        };
        let grains = Grains {
            samples: source(0).map_or(1, |grains| grains.samples),
            done: 0,
            factors: source(0).map_or([[0.0; 3]; OCTAVES], |grains| grains.factors),
            shares: std::array::from_fn(|k| row(&|grains| grains.shares[k])),
            curves: std::array::from_fn(|l| {
                source(l).map_or(Curve([0.0; POINTS]), |grains| grains.curves[0])
            }),
            states: [0, 1].map(|state| std::array::from_fn(|k| row(&|grains| grains.states[state][k]))),
            gains: [0, 1].map(|end| row(&|grains| grains.gains[end])),
        };
        let noise = sources.into_iter().map(|source| source.noise).collect();
        Self { noise, grains, drawn: Box::new([[0.0; LANES]; BLOCK]), used: DRAWN }
    }
}

impl LayerBank for GrainBank {
    fn process(&mut self, block: &mut Block<'_>) {
        let mut done = 0;
        while done < BLOCK {
            if self.used == DRAWN {
                block.draw(&mut self.drawn, |first, drawn| {
                    let voices = self.noise.iter_mut().skip(first).zip(drawn);
                    voices.for_each(|(noise, drawn)| noise.fill(&mut drawn[..DRAWN]));
                });
                self.used = 0;
            }
            let end = BLOCK.min(done + (self.grains.samples - self.grains.done) as usize);
            let drawn = &self.drawn[self.used..self.used + OCTAVES];
            block.arch.dispatch(Advance {
                grains: &mut self.grains,
                frames: &mut block.frames[done..end],
                drawn,
            });
            done = end;
            self.used += if self.grains.done == 0 { OCTAVES } else { 0 };
        }
    }
}

/// Modulates frames of one tick and, at its end, begins the next.
struct Advance<'a> {
    grains: &'a mut Grains<LANES>,
    frames: &'a mut [Row],
    drawn: &'a [Row],
}

impl WithSimd for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.grains.modulate(self.frames);
        if self.grains.done == self.grains.samples {
            self.grains.tick(self.drawn);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 10_000.0;

    /// A roof tile's.
    fn tile() -> Grain {
        let shares = [0.131, 0.176, 0.058, 0.015, 0.019, 0.045, 0.556];
        let gain_db =
            [-34.1, -32.5, -31.9, -27.7, -18.1, -10.7, -5.7, -2.7, -0.7, 1.9, 2.1, 4.1, 4.4, 4.4, 5.8, 8.2];
        Grain::new(&shares, &gain_db).expect("in range")
    }

    /// The gain over so many samples.
    fn gains(grain: &Grain, rate_hz: f64, samples: usize) -> Vec<f64> {
        let mut gains = vec![1.0; samples];
        GrainSource::new(grain, rate_hz, 2).process(&mut gains);
        gains
    }

    fn moment(samples: &[f64], power: i32) -> f64 {
        samples.iter().map(|x| x.powi(power)).sum::<f64>() / samples.len() as f64
    }

    #[test]
    fn the_power_stays_at_any_rate() {
        // All of it fast: little of the loss between ticks is left to chance.
        let fast = Grain::new(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.2, 0.8], &tile().gain_db).expect("in range");
        for rate_hz in [300.0, 1000.0, 2200.0, RATE_HZ] {
            let power_db = 10.0 * moment(&gains(&fast, rate_hz, (300.0 * rate_hz) as usize), 2).log10();
            assert!(power_db.abs() < 0.05, "{power_db} dB at {rate_hz} Hz");
        }
        // Slower models take some of the samples.
        let step = Grain::new(&fast.octave_shares, &[[-40.0; POINTS / 2], [0.0; POINTS / 2]].concat());
        for (models_hz, every) in [(1000.0, 10), (2000.0, 5), (5000.0, 2)] {
            let rates = RenderRates { rate_hz: RATE_HZ, models_hz };
            let mut gains = vec![1.0; 3_000_000];
            GrainSource::at(step.as_ref().expect("in range"), rates, 2).process(&mut gains);
            let taken: Vec<f64> = gains.into_iter().step_by(every).collect();
            let power_db = 10.0 * moment(&taken, 2).log10();
            assert!(power_db.abs() < 0.05, "{power_db} dB for models at {models_hz} Hz");
        }
    }

    #[test]
    fn each_resonator_has_its_variance_its_octave_and_begins_with_them() {
        const SEEDS: u64 = 10_000;
        for (octave, [_, kept, before]) in factors(1000.0).into_iter().enumerate() {
            let mut shares = [0.0; OCTAVES];
            shares[octave] = 1.0;
            let alone = Grain::new(&shares, &[0.0; POINTS]).expect("in range");
            let mut sums = [0.0; 3];
            for seed in 0..SEEDS {
                let mut source = GrainSource::new(&alone, 1000.0, seed);
                let ticks: [f64; 3] = std::array::from_fn(|_| {
                    let drawn = [(); OCTAVES].map(|()| [source.noise.next_sample()]);
                    source.grains.process(&drawn)[0]
                });
                sums.iter_mut().zip(ticks).for_each(|(sum, tick)| *sum += ticks[0] * tick / SEEDS as f64);
            }
            // Yule and Walker's, with the two zeros of the input.
            let after = 0.5 * kept * kept - before - 0.5 * (1.0 - before);
            for (found, expected) in sums.into_iter().zip([1.0, 0.5 * kept, after]) {
                assert!((found - expected).abs() < 0.05, "{octave}: {found} for {expected}");
            }
        }
    }

    #[test]
    fn the_grouping_of_samples_changes_no_bit_and_a_successor_goes_on() {
        let whole = gains(&tile(), RATE_HZ, 1000);
        let mut parts = vec![1.0; 1000];
        let mut source = GrainSource::new(&tile(), RATE_HZ, 2);
        let (first, rest) = parts.split_at_mut(7);
        source.process(first);
        let (middle, last) = rest.split_at_mut(500);
        middle.chunks_mut(65).for_each(|chunk| source.process(chunk));
        let mut successor = GrainSource::new(&tile(), RATE_HZ, 9);
        successor.copy_state_from(&source);
        successor.process(last);
        assert_eq!(whole, parts);
    }

    #[test]
    fn what_is_out_of_range_is_refused() {
        let Grain { octave_shares: shares, gain_db: gains } = tile();
        let refused = |shares: &[f64], gains: &[f64]| {
            let error = Grain::new(shares, gains).expect_err("out of range");
            *error.downcast_ref::<GrainError>().expect("an error of grain")
        };
        assert_eq!(refused(&shares[1..], &gains), GrainError::Lengths { octaves: 6, points: 16 });
        assert_eq!(refused(&shares, &gains[..3]), GrainError::Lengths { octaves: 7, points: 3 });
        assert_eq!(refused(&[0.1; 7], &gains), GrainError::Shares { sum: [0.1; 7].iter().sum() });
        let with = |place: usize, value: f64| {
            let mut gains = gains;
            gains[place] = value;
            gains
        };
        let negative = [-0.5, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(refused(&negative, &gains), GrainError::Shares { sum: 1.0 });
        assert!(matches!(refused(&[f64::NAN; 7], &gains), GrainError::Shares { .. }));
        for (place, value, point) in [(0, -81.0, 1), (15, 31.0, 15), (4, 10.0, 5), (7, f64::NAN, 7)] {
            assert_eq!(refused(&shares, &with(place, value)), GrainError::Gains { point });
        }
        for (depth, time_constant_s) in [(0.0, 0.01), (2.1, 0.01), (f64::NAN, 0.01), (1.0, 0.0), (1.0, 2.0)] {
            let refused = Grain::of_crackle(depth, time_constant_s);
            assert!(refused.unwrap_err().downcast_ref::<GrainError>().is_some());
        }
    }

    #[test]
    fn crackle_of_earlier_files_keeps_its_power_and_its_kurtosis() {
        for (depth, time_constant_s) in [(0.3, 0.05), (0.6, 0.002), (0.6, 0.02), (0.9, 0.008), (0.9, 0.03)] {
            let grain = Grain::of_crackle(depth, time_constant_s).expect("in range");
            let gains = gains(&grain, 2000.0, 2_000_000);
            let power = moment(&gains, 2);
            let excess = 3.0 * (moment(&gains, 4) / (power * power) - 1.0);
            let expected = 3.0 * (depth * depth).exp_m1();
            assert!((10.0 * power.log10()).abs() < 0.2, "{power} at {depth}");
            assert!((excess / expected - 1.0).abs() < 0.2, "{excess} for {expected} in {time_constant_s} s");
        }
        // At the ticks, by quadrature.
        for depth in [1e-3, 0.5, 1.0, 1.5, MAX_DEPTH] {
            let curve = Grain::of_crackle(depth, 0.01).expect("in range").curve();
            let [second, fourth] = [2, 4].map(|power| curve.mean(|gain| gain.powi(power)));
            let expected = (depth * depth).exp();
            assert!((fourth / (second * second * expected) - 1.0).abs() < 0.01, "depth {depth}");
        }
        assert!(Grain::of_crackle(MAX_DEPTH, 1e-4).is_ok() && Grain::of_crackle(1e-3, 1.0).is_ok());
    }
}
