//! Laws from one or two numbers to one, and lists of them over blocks of signals: a tile of samples stays in registers while a
//! list passes over it.
//!
//! Each sample is computed by the same operations in the same order as by [`Law::of`]. The bits therefore depend neither
//! on the instruction set nor on the block nor on how a list is divided; which NaN it is may.

use crate::instructions::arch;
use pulp::{Simd, WithSimd};

/// A law from one or two numbers to one.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Law {
    /// This factor times the input.
    Scale(f64),
    /// The input plus this offset.
    Offset(f64),
    /// The input, no less than the first bound and no more than the second. NaN passes.
    Clamp(f64, f64),
    /// The absolute value.
    Absolute,
    /// The sum of two inputs.
    Sum,
    /// The first input less the second.
    Difference,
    /// The product of two inputs.
    Product,
    /// The first input by the second; 0 if that is 0.
    Quotient,
    /// The sum of both inputs, each times its factor.
    Mix(f64, f64),
}

impl Law {
    /// Number of inputs.
    pub fn inputs(self) -> usize {
        match self {
            Self::Scale(_) | Self::Offset(_) | Self::Clamp(..) | Self::Absolute => 1,
            Self::Sum | Self::Difference | Self::Product | Self::Quotient | Self::Mix(..) => 2,
        }
    }

    /// The output for one number of each input; a law of one input ignores the second.
    #[inline]
    pub fn of(self, a: f64, b: f64) -> f64 {
        self.of_read(a, || b)
    }

    /// As [`of`](Self::of); the second input is read only by a law that has it.
    #[inline(always)]
    pub fn of_read(self, a: f64, b: impl FnOnce() -> f64) -> f64 {
        match self {
            Self::Scale(factor) => factor * a,
            Self::Offset(offset) => a + offset,
            Self::Clamp(lowest, highest) => {
                let above = if a < lowest { lowest } else { a };
                if above > highest { highest } else { above }
            }
            Self::Absolute => a.abs(),
            Self::Sum => a + b(),
            Self::Difference => a - b(),
            Self::Product => a * b(),
            Self::Quotient => match b() {
                0.0 => 0.0,
                b => a / b,
            },
            Self::Mix(first, second) => first * a + second * b(),
        }
    }

    /// The outputs of a law of one input for a tile.
    #[inline(always)]
    fn of_tile<S: Simd, const N: usize>(self, simd: S, x: [S::f64s; N]) -> [S::f64s; N] {
        match self {
            Self::Scale(factor) => {
                let factor = simd.splat_f64s(factor);
                of_each(x, x, |x, _| simd.mul_f64s(factor, x))
            }
            Self::Offset(offset) => {
                let offset = simd.splat_f64s(offset);
                of_each(x, x, |x, _| simd.add_f64s(x, offset))
            }
            Self::Clamp(lowest, highest) => {
                let (lowest, highest) = (simd.splat_f64s(lowest), simd.splat_f64s(highest));
                of_each(x, x, |x, _| {
                    let above = simd.select_f64s(simd.less_than_f64s(x, lowest), lowest, x);
                    simd.select_f64s(simd.greater_than_f64s(above, highest), highest, above)
                })
            }
            Self::Absolute => of_each(x, x, |x, _| simd.abs_f64s(x)),
            Self::Sum | Self::Difference | Self::Product | Self::Quotient | Self::Mix(..) => x,
        }
    }

    /// The same of a law of two inputs.
    #[inline(always)]
    fn of_tiles<S: Simd, const N: usize>(self, simd: S, a: [S::f64s; N], b: [S::f64s; N]) -> [S::f64s; N] {
        match self {
            Self::Sum => of_each(a, b, |a, b| simd.add_f64s(a, b)),
            Self::Difference => of_each(a, b, |a, b| simd.sub_f64s(a, b)),
            Self::Product => of_each(a, b, |a, b| simd.mul_f64s(a, b)),
            Self::Quotient => {
                let zero = simd.splat_f64s(0.0);
                of_each(a, b, |a, b| simd.select_f64s(simd.equal_f64s(b, zero), zero, simd.div_f64s(a, b)))
            }
            Self::Mix(first, second) => {
                let (first, second) = (simd.splat_f64s(first), simd.splat_f64s(second));
                of_each(a, b, |a, b| simd.add_f64s(simd.mul_f64s(first, a), simd.mul_f64s(second, b)))
            }
            Self::Scale(_) | Self::Offset(_) | Self::Clamp(..) | Self::Absolute => a,
        }
    }
}

/// As `map` of arrays, but always inlined: vectors that pass through memory between would take ten times as long.
#[inline(always)]
fn of_each<V: Copy, const N: usize>(mut a: [V; N], b: [V; N], law: impl Fn(V, V) -> V) -> [V; N] {
    for i in 0..N {
        a[i] = law(a[i], b[i]);
    }
    a
}

/// A law between places in a memory that holds signals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawStep {
    /// The law; a step without one is passed over.
    pub law: Option<Law>,
    /// First sample of the first input.
    pub from: u32,
    /// The same of the second input; of a law of one input the first again.
    pub with: u32,
    /// First sample of the output.
    pub to: u32,
    /// True if only the next step of a list reads the output, which is then not written.
    pub is_inner: bool,
}

impl LawStep {
    /// True if the step is affine: a factor or an offset.
    pub fn is_affine(&self) -> bool {
        matches!(self.law, Some(Law::Scale(_) | Law::Offset(_)))
    }
}

/// `factor x + offset`, rounded twice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    /// The factor.
    pub factor: f64,
    /// The offset; -0 leaves every product as it is, -0 too.
    pub offset: f64,
}

impl Affine {
    /// Neither the factor nor the offset changes a bit.
    pub const NONE: Self = Self { factor: 1.0, offset: -0.0 };

    /// Writes a chain of affine steps as products with a sum, with the same bits, into the first places of `chain`; returns how
    /// many they are, at most as many as the steps.
    pub fn join(steps: &[LawStep], chain: &mut [Self]) -> usize {
        let mut count = 0;
        let mut ends_with_factor = false;
        for step in steps {
            match step.law {
                Some(Law::Offset(offset)) if ends_with_factor => chain[count - 1].offset = offset,
                Some(Law::Offset(offset)) => {
                    chain[count] = Self { offset, ..Self::NONE };
                    count += 1;
                }
                Some(Law::Scale(factor)) => {
                    chain[count] = Self { factor, ..Self::NONE };
                    count += 1;
                }
                _ => {}
            }
            ends_with_factor = matches!(step.law, Some(Law::Scale(_)));
        }
        count
    }

    /// The output of a chain.
    #[inline]
    pub fn of_chain(chain: &[Self], x: f64) -> f64 {
        chain.iter().fold(x, |x, step| step.factor * x + step.offset)
    }
}

/// Applies a list of steps to `frames` samples, in order. Real-time code.
///
/// # Panics
/// If a place lies outside of the memory.
pub fn apply(steps: &[LawStep], memory: &mut [f64], frames: usize) {
    arch().dispatch(Apply { steps, memory, frames });
}

struct Apply<'a> {
    steps: &'a [LawStep],
    memory: &'a mut [f64],
    frames: usize,
}

impl WithSimd for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let mut at = 0;
        at = self.tiles::<S, 8>(simd, at);
        at = self.tiles::<S, 4>(simd, at);
        at = self.tiles::<S, 1>(simd, at);
        self.tiles::<pulp::Scalar, 1>(pulp::Scalar::new(), at);
    }
}

impl Apply<'_> {
    /// Applies the list to tiles of `N` vectors from sample `at` on; returns the first sample that is left.
    #[inline(always)]
    fn tiles<S: Simd, const N: usize>(&mut self, simd: S, mut at: usize) -> usize {
        let samples = N * S::F64_LANES;
        while at + samples <= self.frames {
            self.tile::<S, N>(simd, at);
            at += samples;
        }
        at
    }

    #[inline(always)]
    fn tile<S: Simd, const N: usize>(&mut self, simd: S, at: usize) {
        let samples = N * S::F64_LANES;
        let mut latest = [simd.splat_f64s(0.0); N];
        let mut latest_at = u32::MAX;
        let last = self.steps.len().wrapping_sub(1);
        for (number, step) in self.steps.iter().enumerate() {
            let Some(law) = step.law else { continue };
            let from = |place: u32| &self.memory[place as usize + at..];
            // A second tile takes registers, which a law of one input leaves to the first.
            if law.inputs() == 1 {
                if step.from != latest_at {
                    latest = tile::<S, N>(from(step.from), latest);
                }
                latest = law.of_tile(simd, latest);
            } else {
                let mut with = latest;
                if step.with != latest_at {
                    with = tile::<S, N>(from(step.with), latest);
                }
                if step.from != latest_at {
                    latest = tile::<S, N>(from(step.from), latest);
                }
                latest = law.of_tiles(simd, latest, with);
            }
            latest_at = step.to;
            if !step.is_inner || number == last {
                let place = &mut self.memory[step.to as usize + at..][..samples];
                if let Some(out) = S::as_mut_simd_f64s(place).0.first_chunk_mut() {
                    *out = latest;
                }
            }
        }
    }
}

/// The first `N` vectors of samples.
#[inline(always)]
fn tile<S: Simd, const N: usize>(samples: &[f64], otherwise: [S::f64s; N]) -> [S::f64s; N] {
    match S::as_simd_f64s(&samples[..N * S::F64_LANES]).0.first_chunk() {
        Some(vectors) => *vectors,
        None => otherwise,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAWS: [Law; 9] = [
        Law::Scale(-1.25),
        Law::Offset(0.1),
        Law::Clamp(-0.5, 0.75),
        Law::Absolute,
        Law::Sum,
        Law::Difference,
        Law::Product,
        Law::Quotient,
        Law::Mix(0.3, -0.7),
    ];
    /// Samples of a signal in the memory.
    const ROOM: usize = 160;

    /// Signals with what arithmetic treats specially.
    fn signals(count: usize) -> Vec<f64> {
        let special = [0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 5e-310, f64::MAX];
        let sample = |i: usize| match i % 11 {
            0 => special[i / 11 % special.len()],
            _ => (i as f64 * 0.7).sin(),
        };
        (0..count * ROOM).map(sample).collect()
    }

    /// Chains of all laws, in several orders: each step reads the one before, and the second input of some lies elsewhere.
    fn chain(turn: usize) -> Vec<LawStep> {
        let place = |signal: usize| (signal * ROOM) as u32;
        (0..LAWS.len())
            .map(|i| LawStep {
                law: Some(LAWS[(i * (turn + 1) + turn) % LAWS.len()]),
                from: place(if turn % 3 == 2 && i % 2 == 1 { 11 } else { i }),
                with: place(if turn.is_multiple_of(2) { i } else { 10 }),
                to: place(i + 1),
                is_inner: turn % 3 < 2,
            })
            .collect()
    }

    #[test]
    fn a_list_has_the_bits_of_its_laws_one_by_one_for_every_length() {
        for turn in 0..7 {
            let steps = chain(turn);
            for frames in 0..=ROOM {
                let (mut plain, mut tiled) = (signals(12), signals(12));
                for step in &steps {
                    for i in 0..frames {
                        let law = step.law.unwrap();
                        let [from, with, to] =
                            [step.from, step.with, step.to].map(|place| place as usize + i);
                        plain[to] = law.of(plain[from], plain[with]);
                    }
                }
                apply(&steps, &mut tiled, frames);
                let last = LAWS.len() * ROOM;
                let bits = |memory: &[f64]| -> Vec<u64> {
                    // Hardware may choose either payload of two NaN.
                    let bits = |x: &f64| if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() };
                    memory[last..last + ROOM].iter().map(bits).collect()
                };
                assert_eq!(bits(&tiled), bits(&plain), "turn {turn}, {frames} frames");
            }
        }
    }

    #[test]
    fn a_chain_of_factors_and_offsets_keeps_its_bits_where_it_is_joined() {
        let laws = [
            Law::Scale(-1.5),
            Law::Offset(0.1),
            Law::Offset(-0.0),
            Law::Scale(0.0),
            Law::Scale(3.0),
            Law::Offset(0.0),
        ];
        for turn in 0..laws.len() {
            let step = |i: usize| LawStep { law: Some(laws[(i + turn) % laws.len()]), ..chain(0)[0] };
            let steps: Vec<LawStep> = (0..4).map(step).collect();
            let mut joined = [Affine::NONE; 4];
            let count = Affine::join(&steps, &mut joined);
            assert!(count <= 4 && steps.iter().all(LawStep::is_affine));
            assert!(turn > 0 || count == 3, "a factor and the offset after it are one");
            for x in signals(1).into_iter().filter(|x| !x.is_nan()) {
                let plain = steps.iter().fold(x, |x, step| step.law.map_or(x, |law| law.of(x, x)));
                let is = Affine::of_chain(&joined[..count], x);
                assert!(is.to_bits() == plain.to_bits() || is.is_nan() && plain.is_nan(), "{turn}: {x:e}");
            }
        }
    }

    #[test]
    fn what_others_read_is_written_and_nothing_behind_the_frames_is() {
        let steps: Vec<LawStep> = chain(0)
            .into_iter()
            .map(|step| LawStep { is_inner: step.to != 3 * ROOM as u32, ..step })
            .collect();
        let (before, mut memory) = (signals(12), signals(12));
        apply(&steps, &mut memory, 37);
        for signal in 1..=LAWS.len() {
            let same = |range: std::ops::Range<usize>| {
                let pairs = memory[range.clone()].iter().zip(&before[range]);
                pairs.into_iter().all(|(a, b)| a.to_bits() == b.to_bits())
            };
            let start = signal * ROOM;
            assert!(same(start + 37..start + ROOM), "{signal}");
            assert_eq!(same(start..start + 37), ![3, LAWS.len()].contains(&signal), "{signal}");
        }
    }
}
