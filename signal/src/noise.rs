//! Seeded random numbers: streams named by a graph's seed and a node's path, uniform and normal samples.
//!
//! The generator is Xoshiro256PlusPlus. 32 of them run side by side in SIMD lanes, so that filling a buffer
//! costs under a nanosecond a sample. Every operation is an exactly rounded one (no fused multiply-add, no libm), so
//! a seed gives the same bits on every processor.

use crate::instructions::arch;
use pulp::{Arch, Simd, WithSimd};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// Independent generators side by side.
const LANES: usize = 32;
/// Samples computed at a time.
const BATCH: usize = 2 * LANES;

/// The seed of a node's random stream: a hash of the graph's seed and the node's full path that never changes.
///
/// FNV-1a (64 bits) over the eight little-endian bytes of `graph_seed` and then the UTF-8 bytes of `path`,
/// finished by the mixer of SplitMix64, because FNV alone leaves similar paths with similar high bits.
pub fn stream_seed(graph_seed: u64, path: &str) -> u64 {
    let bytes = graph_seed.to_le_bytes().into_iter().chain(path.bytes());
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    let hash = (hash ^ (hash >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let hash = (hash ^ (hash >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    hash ^ (hash >> 31)
}

/// Normal samples of mean 0 and variance 1, by Box and Muller's transform (computed to 1e-11, tails to 7.2).
///
/// The sequence depends on the seed only, not on the sizes of the requests. Never allocates.
#[derive(Debug, Clone)]
pub struct Gaussian {
    source: Batched,
}

impl Gaussian {
    /// A stream; see [`stream_seed`].
    pub fn new(seed: u64) -> Self {
        Self { source: Batched::new(seed, normal_batch) }
    }

    /// The next sample.
    #[inline]
    pub fn next_sample(&mut self) -> f64 {
        self.source.next_sample()
    }

    /// The next `out.len()` samples.
    pub fn fill(&mut self, out: &mut [f64]) {
        self.source.fill(out);
    }
}

/// Samples uniform in [0, 1), multiples of 2^-52.
///
/// The sequence depends on the seed only, not on the sizes of the requests. Never allocates.
#[derive(Debug, Clone)]
pub struct Uniform {
    source: Batched,
}

impl Uniform {
    /// A stream; see [`stream_seed`].
    pub fn new(seed: u64) -> Self {
        Self { source: Batched::new(seed, uniform_batch) }
    }

    /// The next `out.len()` samples.
    pub fn fill(&mut self, out: &mut [f64]) {
        self.source.fill(out);
    }
}

/// Conversion of the generators' words into a batch of samples.
type MakeBatch = fn(Arch, &mut Lanes, &mut [f64; BATCH]);

/// A stream that is computed in batches and read in any portions.
#[derive(Debug, Clone)]
struct Batched {
    lanes: Lanes,
    make: MakeBatch,
    arch: Arch,
    batch: [f64; BATCH],
    /// Index in `batch` of the next sample.
    next: usize,
}

impl Batched {
    fn new(seed: u64, make: MakeBatch) -> Self {
        Self { lanes: Lanes::new(seed), make, arch: arch(), batch: [0.0; BATCH], next: BATCH }
    }

    #[inline]
    fn next_sample(&mut self) -> f64 {
        if self.next == BATCH {
            (self.make)(self.arch, &mut self.lanes, &mut self.batch);
            self.next = 0;
        }
        let sample = self.batch[self.next];
        self.next += 1;
        sample
    }

    fn fill(&mut self, out: &mut [f64]) {
        let left = (BATCH - self.next).min(out.len());
        let (head, tail) = out.split_at_mut(left);
        head.copy_from_slice(&self.batch[self.next..self.next + left]);
        self.next += left;
        let (whole, rest) = tail.as_chunks_mut::<BATCH>();
        for batch in whole {
            (self.make)(self.arch, &mut self.lanes, batch);
        }
        if !rest.is_empty() {
            (self.make)(self.arch, &mut self.lanes, &mut self.batch);
            self.next = rest.len();
            rest.copy_from_slice(&self.batch[..self.next]);
        }
    }
}

/// Xoshiro256PlusPlus, [`LANES`] times: word w of lane l is `words[w][l]`.
///
/// The 4 x `LANES` words of state are the first outputs of SplitMix64 from the seed, lane by lane: lane 0 is what
/// `Xoshiro256PlusPlus::seed_from_u64` gives, the others are as far from it as from any other seed's.
#[derive(Debug, Clone)]
struct Lanes {
    words: [[u64; LANES]; 4],
}

impl Lanes {
    fn new(seed: u64) -> Self {
        let mut seeds = SplitMix64::seed_from_u64(seed);
        let mut words = [[0; LANES]; 4];
        for lane in 0..LANES {
            for word in &mut words {
                word[lane] = seeds.next_u64();
            }
        }
        Self { words }
    }

    /// One output of every lane.
    #[inline(always)]
    fn next(&mut self) -> [u64; LANES] {
        let [s0, s1, s2, s3] = &mut self.words;
        let mut out = [0; LANES];
        for l in 0..LANES {
            out[l] = s0[l].wrapping_add(s3[l]).rotate_left(23).wrapping_add(s0[l]);
            let shifted = s1[l] << 17;
            s2[l] ^= s0[l];
            s3[l] ^= s1[l];
            s1[l] ^= s2[l];
            s0[l] ^= s3[l];
            s2[l] ^= shifted;
            s3[l] = s3[l].rotate_left(45);
        }
        out
    }
}

/// A batch of uniform samples. A struct because only its method, not a closure, is sure to be compiled for the
/// instruction set it is dispatched to; likewise below.
struct UniformBatch<'a>(&'a mut Lanes, &'a mut [f64; BATCH]);

impl WithSimd for UniformBatch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self(lanes, batch) = self;
        for samples in batch.as_chunks_mut::<LANES>().0 {
            let words = lanes.next();
            for l in 0..LANES {
                samples[l] = unit_interval(words[l]) - 1.0;
            }
        }
    }
}

/// A batch of normal samples.
struct NormalBatch<'a>(&'a mut Lanes, &'a mut [f64; BATCH]);

impl WithSimd for NormalBatch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self(lanes, batch) = self;
        let words = lanes.next();
        let (x, y) = batch.split_at_mut(LANES);
        // Two short loops keep more iterations in flight than one long one.
        let mut lengths = [0.0; LANES];
        for l in 0..LANES {
            lengths[l] = length(words[l]);
        }
        for l in 0..LANES {
            let (cosine, sine) = direction(words[l]);
            (x[l], y[l]) = (lengths[l] * cosine, lengths[l] * sine);
        }
    }
}

fn uniform_batch(arch: Arch, lanes: &mut Lanes, batch: &mut [f64; BATCH]) {
    arch.dispatch(UniformBatch(lanes, batch));
}

fn normal_batch(arch: Arch, lanes: &mut Lanes, batch: &mut [f64; BATCH]) {
    arch.dispatch(NormalBatch(lanes, batch));
}

/// The upper 52 bits as a number in [1, 2).
#[inline(always)]
fn unit_interval(word: u64) -> f64 {
    f64::from_bits(0x3ff0_0000_0000_0000 | (word >> 12))
}

/// The length of a pair of independent normal samples from the upper 38 bits of a word (Box and Muller 1958).
#[inline(always)]
fn length(word: u64) -> f64 {
    let one_to_two = f64::from_bits(0x3ff0_0000_0000_0000 | (word >> 12 & !0x3fff));
    (-2.0 * ln(2.0 - one_to_two)).sqrt() // ln of a number in (0, 1]
}

/// The direction of the pair, from the lower 26 bits.
#[inline(always)]
fn direction(word: u64) -> (f64, f64) {
    // 24 bits make an angle in one quarter of the circle; the last two choose the quarter, as a swap of cosine and sine
    // and a sign.
    let two_to_four = f64::from_bits(0x4000_0000_0000_0000 | (word << 26 & 0x000f_ffff_f000_0000));
    let (cosine, sine) = quarter_circle(two_to_four - 3.0);
    let (x, y) = if word & 1 == 0 { (cosine, sine) } else { (sine, cosine) };
    let signed = |v: f64| f64::from_bits(v.to_bits() ^ (word << 62 & 1 << 63));
    (signed(x), signed(y))
}

/// Natural logarithm of a normal positive number, relative error below 5e-12.
#[inline(always)]
fn ln(x: f64) -> f64 {
    const TWO_TO_52: f64 = 4_503_599_627_370_496.0;
    // x = 2^exponent * m with m in [sqrt(1/2), sqrt(2)): the offset moves the carry into the exponent to sqrt(2).
    let biased = (x.to_bits() + (0x3ff0_0000_0000_0000 - 0x3fe6_a09e_667f_3bcd)) >> 52;
    let exponent = f64::from_bits(TWO_TO_52.to_bits() | biased) - (TWO_TO_52 + 1023.0);
    let m = f64::from_bits(x.to_bits().wrapping_sub(biased.wrapping_sub(1023) << 52));
    // ln m = 2 artanh s; the polynomial is minimax in s^2 (Chebyshev nodes).
    let s = (m - 1.0) / (m + 1.0);
    let t = s * s;
    let p = 0.236_163_590_991_459_85;
    let p = p * t + 0.285_350_510_378_163_1;
    let p = p * t + 0.400_003_846_723_751_9;
    let p = p * t + 0.666_666_652_474_875_2;
    let p = p * t + 2.000_000_000_008_359_5;
    exponent * std::f64::consts::LN_2 + s * p
}

/// Cosine and sine of pi/4 t for t in [-1, 1], error below 5e-12.
#[inline(always)]
fn quarter_circle(t: f64) -> (f64, f64) {
    let u = t * t;
    let c = -2.426_851_890_411_488e-8;
    let c = c * u + 3.590_475_534_976_395_5e-6;
    let c = c * u - 0.000_325_991_687_535_072_6;
    let c = c * u + 0.015_854_344_197_106_52;
    let c = c * u - 0.308_425_137_530_039_8;
    let c = c * u + 0.999_999_999_999_944_4;
    let s = 3.089_966_867_337_448e-7;
    let s = s * u - 0.000_036_572_392_630_673_79;
    let s = s * u + 0.002_490_393_210_175_957;
    let s = s * u - 0.080_745_512_018_349_42;
    let s = s * u + 0.785_398_163_394_049_9;
    (c, t * s)
}

#[cfg(test)]
mod tests;
