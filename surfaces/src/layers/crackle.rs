//! Crackle: a texture's excitation whose level fluctuates faster than speed and force.
//!
//! The excitation is `sigma sqrt(v) g` with white Gaussian `g` and the fluctuation `v = exp(s z - s^2 / 2)`, where `z` is a
//! Gaussian process of variance 1 with exponential correlation. The mean of `v` is 1, so that power and spectrum stay those of
//! the map; only the distribution changes: its excess kurtosis is `3 (exp(s^2) - 1)`.

use super::{Layer, LayerBank, LayerError, LayerKind, LayerVoice, RenderRates, Stage, parse};
use crate::TextureModel;
use crate::files::native::Thousandths;
use crate::rendering::{Block, LANES, Row};
use haptograph_signal::elementwise::mul_add;
use haptograph_signal::noise::Gaussian;
use haptograph_signal::units::decimal::{format_thousandfold, significant};
use pulp::{Simd, WithSimd};
use serde::Deserialize;
use serde_json::{Value, json};
use std::fmt::Write;
use std::sync::Arc;

/// The strength and speed of the fluctuation of a texture's excitation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crackle {
    depth: f64,
    time_constant_s: f64,
}

/// Deepest crackle: an excess kurtosis of 160.
pub const MAX_DEPTH: f64 = 2.0;
/// Longest time constant, s: slower fluctuation follows from speed and force.
pub(crate) const MAX_TIME_CONSTANT_S: f64 = 1.0;

impl Crackle {
    /// Crackle of `depth`, the standard deviation of the power's natural logarithm (above 0, at most [`MAX_DEPTH`]), with the
    /// correlation time `time_constant_s` (above 0, at most `MAX_TIME_CONSTANT_S`).
    ///
    /// # Errors
    /// [`CrackleError`] for values out of these ranges.
    pub fn new(depth: f64, time_constant_s: f64) -> Result<Self, LayerError> {
        let within = |x: f64, most: f64| x > 0.0 && x <= most;
        if !(within(depth, MAX_DEPTH) && within(time_constant_s, MAX_TIME_CONSTANT_S)) {
            return Err(LayerError::new(CrackleError { depth, time_constant_s }));
        }
        Ok(Self { depth, time_constant_s })
    }

    /// Standard deviation of the natural logarithm of the excitation's power.
    pub fn depth(&self) -> f64 {
        self.depth
    }

    /// Time in which the fluctuation's correlation falls to 1/e, s.
    pub fn time_constant_s(&self) -> f64 {
        self.time_constant_s
    }
}

/// Crackle out of range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "crackle of depth {depth} and time constant {time_constant_s} s: the depth must be above 0 and at most {MAX_DEPTH}, the time constant above 0 and at most {MAX_TIME_CONSTANT_S} s"
)]
pub struct CrackleError {
    /// The depth given.
    pub depth: f64,
    /// The time constant given.
    pub time_constant_s: f64,
}

/// Crackle in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CrackleDocument {
    depth: f64,
    time_constant_ms: Thousandths,
}

/// The layer's type.
pub const KIND: LayerKind = LayerKind {
    name: "crackle",
    title: "crackle",
    stage: Stage::Excitation,
    components: &[],
    parse: |text| {
        parse(text, |document: CrackleDocument| {
            Crackle::new(document.depth, document.time_constant_ms.si).map(Some)
        })
    },
    absent: || Value::Null,
};

impl Layer for Crackle {
    fn kind(&self) -> &'static LayerKind {
        &KIND
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let time_constant_ms = format_thousandfold(self.time_constant_s);
        writeln!(out, "        crackle: (depth: {:?}, time_constant_ms: {time_constant_ms}),", self.depth)
    }

    fn voice(&self, rates: RenderRates, seed: u64) -> Box<dyn LayerVoice> {
        Box::new(CrackleSource::new(*self, rates.rate_hz, seed))
    }

    fn bank(&self, voices: Vec<Box<dyn LayerVoice>>) -> Box<dyn LayerBank> {
        let sources = voices.iter().filter_map(|voice| voice.downcast_ref::<CrackleSource>().cloned());
        Box::new(CrackleLanes::<LANES>::new(sources))
    }

    fn json(&self) -> Value {
        json!({ "depth": self.depth, "time_constant_ms": 1000.0 * self.time_constant_s })
    }

    fn summary(&self) -> String {
        let time_constant_ms = significant(1000.0 * self.time_constant_s, 2);
        format!("crackle of depth {} and {time_constant_ms} ms", significant(self.depth, 2))
    }
}

impl TextureModel {
    /// The fluctuation of the excitation's level; `None` for plain white noise.
    pub fn crackle(&self) -> Option<Crackle> {
        self.layer().copied()
    }

    /// The same texture with an excitation whose level fluctuates by `crackle`.
    pub fn with_crackle(self, crackle: Option<Crackle>) -> Self {
        match crackle {
            Some(crackle) => self.with_checked(Arc::new(crackle)),
            None => self.without_layer(KIND.name),
        }
    }
}

/// Samples modulated at a time.
const BATCH: usize = 64;

/// Modulates white excitation with crackle, in real time. It does not allocate; its output does not depend on block sizes.
#[derive(Debug, Clone)]
pub struct CrackleSource {
    noise: Gaussian,
    z: f64,
    kept: f64,
    fresh: f64,
    half_depth: f64,
}

impl CrackleSource {
    /// A source of `crackle` at `rate_hz`; the same `seed` gives the same fluctuation.
    pub fn new(crackle: Crackle, rate_hz: f64, seed: u64) -> Self {
        let mut noise = Gaussian::new(seed);
        let kept = (-1.0 / (crackle.time_constant_s * rate_hz)).exp();
        Self {
            z: noise.next_sample(),
            noise,
            kept,
            fresh: (1.0 - kept * kept).sqrt(),
            half_depth: 0.5 * crackle.depth,
        }
    }
}

impl LayerVoice for CrackleSource {
    /// Multiplies the next samples of the excitation by the square root of the fluctuation.
    fn process(&mut self, excitation: &mut [f64]) {
        let mut noise = [0.0; BATCH];
        for chunk in excitation.chunks_mut(BATCH) {
            let noise = &mut noise[..chunk.len()];
            self.noise.fill(noise);
            for (e, fresh) in chunk.iter_mut().zip(noise) {
                self.z = self.kept * self.z + self.fresh * *fresh;
                *e *= (self.half_depth * (self.z - self.half_depth)).exp();
            }
        }
    }

    fn copy_state_from(&mut self, other: &dyn LayerVoice) {
        if let Some(other) = other.downcast_ref::<Self>() {
            self.noise.clone_from(&other.noise);
            self.z = other.z;
        }
    }

    fn boxed_clone(&self) -> Box<dyn LayerVoice> {
        Box::new(self.clone())
    }
}

/// One [`CrackleSource`] per lane: the same random streams, with an exponential that differs only by
/// rounding.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct CrackleLanes<const L: usize> {
    noise: Vec<Gaussian>,
    z: [f64; L],
    kept: [f64; L],
    fresh: [f64; L],
    half_depth: [f64; L],
}

impl<const L: usize> CrackleLanes<L> {
    /// Assigns one source per lane; lanes without a source stay unchanged.
    fn new(sources: impl IntoIterator<Item = CrackleSource>) -> Self {
        let [z, kept, fresh, half_depth] = [[0.0; L]; 4];
        let mut all = Self { noise: vec![], z, kept, fresh, half_depth };
        for (l, source) in sources.into_iter().take(L).enumerate() {
            (all.z[l], all.kept[l]) = (source.z, source.kept);
            (all.fresh[l], all.half_depth[l]) = (source.fresh, source.half_depth);
            all.noise.push(source.noise);
        }
        all
    }

    /// Draws the next samples of the streams of the lanes from `first` on, one row a lane.
    fn draw<const N: usize>(&mut self, first: usize, into: &mut [[f64; N]]) {
        for (noise, row) in self.noise.iter_mut().skip(first).zip(into) {
            noise.fill(row);
        }
    }

    /// Multiplies frames of white excitation by the square root of the fluctuation, which consumes as many frames of
    /// the streams.
    ///
    /// Made to be inlined where vector instructions are chosen.
    #[inline(always)]
    fn modulate(&mut self, excitation: &mut [[f64; L]], drawn: &[[f64; L]]) {
        // A vector of lanes at a time, so that its numbers stay in registers.
        if L.is_multiple_of(8) {
            for part in 0..L / 8 {
                self.modulate_part::<8>(part, excitation, drawn);
            }
        } else {
            for part in 0..L {
                self.modulate_part::<1>(part, excitation, drawn);
            }
        }
    }

    /// Modulates the `W` lanes with the number `part`.
    #[inline(always)]
    fn modulate_part<const W: usize>(
        &mut self,
        part: usize,
        excitation: &mut [[f64; L]],
        drawn: &[[f64; L]],
    ) {
        let kept = self.kept.as_chunks::<W>().0[part];
        let fresh = self.fresh.as_chunks::<W>().0[part];
        let half_depth = self.half_depth.as_chunks::<W>().0[part];
        let mut z = self.z.as_chunks::<W>().0[part];
        for (excitation, drawn) in excitation.iter_mut().zip(drawn) {
            // Copies: as short a loop is made into vectors only where nothing can overlap.
            let excitation = &mut excitation.as_chunks_mut::<W>().0[part];
            let (mut modulated, drawn) = (*excitation, drawn.as_chunks::<W>().0[part]);
            for l in 0..W {
                z[l] = mul_add(kept[l], z[l], fresh[l] * drawn[l]);
                modulated[l] *= exp(half_depth[l] * (z[l] - half_depth[l]));
            }
            *excitation = modulated;
        }
        self.z.as_chunks_mut::<W>().0[part] = z;
    }
}

impl LayerBank for CrackleLanes<LANES> {
    fn process(&mut self, block: &mut Block<'_>) {
        block.draw(|first, drawn| self.draw(first, drawn));
        block.arch.dispatch(Modulate { crackle: self, excitation: block.frames, drawn: block.spare });
    }
}

/// Modulates a block of excitation with crackle.
struct Modulate<'a> {
    crackle: &'a mut CrackleLanes<LANES>,
    excitation: &'a mut [Row],
    drawn: &'a [Row],
}

impl WithSimd for Modulate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.crackle.modulate(self.excitation, self.drawn);
    }
}

/// The exponential of |x| up to 700, to within two units in the last place. It has no branches and no table,
/// so that it vectorises.
#[inline(always)]
fn exp(x: f64) -> f64 {
    use std::f64::consts::LOG2_E;
    // Adding and subtracting this constant rounds to the nearest integer, left in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    /// 1 / k!
    const SERIES: [f64; 14] = {
        let (mut series, mut k) = ([1.0; 14], 1);
        while k < 14 {
            series[k] = series[k - 1] / k as f64;
            k += 1;
        }
        series
    };
    let rounded = x * LOG2_E + ROUND;
    let halvings = rounded - ROUND;
    let rest = mul_add(halvings, -LN_2_LOW, x - halvings * LN_2_HIGH);
    let mut sum = SERIES[13];
    for &term in SERIES[..13].iter().rev() {
        sum = mul_add(sum, rest, term);
    }
    f64::from_bits(sum.to_bits().wrapping_add(rounded.to_bits() << 52))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crackling(depth: f64, time_constant_s: f64, samples: usize) -> Vec<f64> {
        let mut e = vec![0.0; samples];
        Gaussian::new(1).fill(&mut e);
        let crackle = Crackle::new(depth, time_constant_s).expect("in range");
        CrackleSource::new(crackle, 10_000.0, 2).process(&mut e);
        e
    }

    #[test]
    fn the_power_stays_and_the_kurtosis_is_the_depths() {
        let e = crackling(0.8, 0.003, 2_000_000);
        let moment = |k: i32| e.iter().map(|e| e.powi(k)).sum::<f64>() / e.len() as f64;
        let excess = moment(4) / moment(2).powi(2) - 3.0;
        let expected = 3.0 * (0.64_f64.exp() - 1.0);
        assert!((moment(2) - 1.0).abs() < 0.02, "{}", moment(2));
        assert!((excess / expected - 1.0).abs() < 0.2, "{excess} for {expected}");
    }

    #[test]
    fn the_grouping_of_samples_changes_no_bit() {
        let whole = crackling(0.8, 0.01, 1000);
        let mut parts = vec![0.0; 1000];
        Gaussian::new(1).fill(&mut parts);
        let mut source = CrackleSource::new(Crackle::new(0.8, 0.01).expect("in range"), 10_000.0, 2);
        let (first, rest) = parts.split_at_mut(7);
        source.process(first);
        rest.chunks_mut(65).for_each(|chunk| source.process(chunk));
        assert_eq!(whole, parts);
    }

    #[test]
    fn depths_and_times_out_of_range_are_refused() {
        for (depth, time_constant_s) in [(0.0, 0.01), (2.1, 0.01), (f64::NAN, 0.01), (1.0, 0.0), (1.0, 2.0)] {
            let refused = Crackle::new(depth, time_constant_s);
            assert!(refused.unwrap_err().downcast_ref::<CrackleError>().is_some());
        }
    }

    #[test]
    fn the_exponential_is_the_librarys() {
        for k in -70_000..=70_000 {
            let x = f64::from(k) / 100.1;
            let apart = (exp(x) / x.exp() - 1.0).abs();
            assert!(apart < 3.0 * f64::EPSILON, "{x}: {apart:e}");
        }
    }

    #[test]
    fn each_lane_fluctuates_as_its_source_alone() {
        let source = |lane: u16| {
            let crackle = Crackle::new(0.1 + 0.3 * f64::from(lane), 0.002).expect("in range");
            CrackleSource::new(crackle, 10_000.0, u64::from(lane))
        };
        let mut lanes = CrackleLanes::<4>::new((0..3).map(source));
        let mut drawn = [[0.0; 50]; 4];
        lanes.draw(0, &mut drawn[..2]);
        lanes.draw(2, &mut drawn[2..]);
        let mut alone = [[1.0; 50]; 3];
        (0..3).zip(&mut alone).for_each(|(lane, out)| source(lane).process(out));
        for n in 0..50 {
            let mut frames = [[1.0; 4]];
            lanes.modulate(&mut frames, &[std::array::from_fn(|l| drawn[l][n])]);
            let [frame] = frames;
            for l in 0..3 {
                assert!((frame[l] / alone[l][n] - 1.0).abs() < 1e-14);
            }
            assert_eq!(frame[3], 1.0);
        }
    }
}
