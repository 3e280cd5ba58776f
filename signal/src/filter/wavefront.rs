//! A cascade of sections skewed across vector lanes: while a section filters one sample, the next section filters the sample
//! before. From one sample to the next a section waits for a product and a sum; so do sixteen side by side.
//!
//! Each section computes what [`Running::process`] does, with the same bits.

use super::{Running, SETTLE};
use crate::instructions::arch;
use pulp::{Simd, WithSimd};

/// Maximum number of sections side by side.
pub(super) const WIDEST: usize = 16;
/// With fewer sections, or for fewer samples, each section filters by itself.
pub(super) const NARROWEST: usize = 4;
pub(super) const SHORTEST: usize = 12;

/// Filters a block of at most [`SETTLE`] samples in place by one section after the other.
pub(super) fn process<'a>(mut sections: impl Iterator<Item = &'a mut Running>, block: &mut [f64]) {
    loop {
        let mut group: Group<'_> = std::array::from_fn(|_| sections.next());
        match group.iter().flatten().count() {
            0 => return,
            count if count < NARROWEST => one_by_one(&mut group, block),
            count => arch().dispatch(Wavefront { count, group: &mut group, block }),
        }
    }
}

/// Successive sections.
type Group<'a> = [Option<&'a mut Running>; WIDEST];

fn one_by_one(group: &mut Group<'_>, block: &mut [f64]) {
    group.iter_mut().flatten().for_each(|section| section.process_in_place(block));
}

/// Filters a block by `count` sections.
struct Wavefront<'a, 'b> {
    count: usize,
    group: &'a mut Group<'b>,
    block: &'a mut [f64],
}

impl WithSimd for Wavefront<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match self.count.div_ceil(S::F64_LANES) {
            _ if S::F64_LANES < 4 => one_by_one(self.group, self.block),
            0 | 1 => self.run::<S, 1>(simd),
            2 => self.run::<S, 2>(simd),
            _ => self.run::<S, 4>(simd),
        }
    }
}

impl Wavefront<'_, '_> {
    #[inline(always)]
    fn run<S: Simd, const V: usize>(self, simd: S) {
        let Self { count, group, block } = self;
        let (samples, last) = (block.len(), count - 1);
        let (lanes, mut state) = Lanes::<S, V>::of(simd, V * S::F64_LANES - count, group);
        let mut out = [0.0; SETTLE + WIDEST];
        // While the wave enters and leaves, some sections have no sample.
        let (entering, inside) = block.split_at(last.min(samples));
        for (t, x) in entering.iter().enumerate() {
            lanes.step::<true>(simd, &mut state, *x, (t, samples));
        }
        for (t, x) in (last..).zip(inside) {
            lanes.step::<false>(simd, &mut state, *x, (t, samples));
            // The output is in the first lane; what is behind it is overwritten.
            store::<S>(state.moved, &mut out[t - last..]);
        }
        for t in samples..samples + last {
            lanes.step::<true>(simd, &mut state, 0.0, (t, samples));
            if t >= last {
                store::<S>(state.moved, &mut out[t - last..]);
            }
        }
        block.copy_from_slice(&out[..samples]);
        state.write(lanes.unused, group);
    }
}

/// The sections: number `s` is lane `s / V` of vector `s % V`, so that from one step to the next only the outputs of the last
/// vector change lanes. Unused ones come first.
struct Lanes<S: Simd, const V: usize> {
    vectors: [Vectors<S>; V],
    unused: usize,
}

/// A section in each lane.
#[derive(Clone, Copy)]
struct Vectors<S: Simd> {
    /// `b_0`, `b_1 - a_1 b_0`, `b_2 - a_2 b_0`.
    b: [S::f64s; 3],
    a: [S::f64s; 2],
    /// Steps by which a section is later than the first one in use.
    delay: S::f64s,
    is_first: S::m64s,
}

/// What changes from step to step.
struct State<S: Simd, const V: usize> {
    s1: [S::f64s; V],
    s2: [S::f64s; V],
    y: [S::f64s; V],
    /// The last vector's outputs moved by a lane: the output of the cascade comes first.
    moved: S::f64s,
}

/// Numbers of the sections by lane.
type Row = [f64; WIDEST];

// Loops instead of `map` and `from_fn` of arrays: where the compiler does not inline those, vectors pass through memory.
#[inline(always)]
fn load<S: Simd>(row: &Row) -> S::f64s {
    S::as_simd_f64s(&row[..S::F64_LANES]).0[0]
}

#[inline(always)]
fn store<S: Simd>(vector: S::f64s, out: &mut [f64]) {
    S::as_mut_simd_f64s(&mut out[..S::F64_LANES]).0[0] = vector;
}

impl<S: Simd, const V: usize> Lanes<S, V> {
    #[inline(always)]
    fn of(simd: S, unused: usize, group: &Group<'_>) -> (Self, State<S, V>) {
        let mut rows: [[Row; 7]; V] = [[[0.0; WIDEST]; 7]; V];
        let mut delays = [[f64::NEG_INFINITY; WIDEST]; V];
        for (number, section) in group.iter().flatten().enumerate() {
            let (v, lane) = ((unused + number) % V, (unused + number) / V);
            let Running { biquad, state: [s1, s2] } = **section;
            let ([b0, b1, b2], [a1, a2]) = (biquad.b, biquad.a);
            let numbers = [b0, b1 - a1 * b0, b2 - a2 * b0, a1, a2, s1, s2];
            rows[v].iter_mut().zip(numbers).for_each(|(row, number)| row[lane] = number);
            delays[v][lane] = number as f64;
        }
        let nothing = simd.splat_f64s(0.0);
        let none = Vectors {
            b: [nothing; 3],
            a: [nothing; 2],
            delay: nothing,
            is_first: simd.equal_f64s(nothing, nothing),
        };
        let mut lanes = Self { vectors: [none; V], unused };
        let mut state = State { s1: [nothing; V], s2: [nothing; V], y: [nothing; V], moved: nothing };
        for v in 0..V {
            let [b0, c1, c2, a1, a2, s1, s2] = &rows[v];
            let delay = load::<S>(&delays[v]);
            lanes.vectors[v] = Vectors {
                b: [load::<S>(b0), load::<S>(c1), load::<S>(c2)],
                a: [load::<S>(a1), load::<S>(a2)],
                delay,
                is_first: simd.equal_f64s(delay, nothing),
            };
            (state.s1[v], state.s2[v]) = (load::<S>(s1), load::<S>(s2));
        }
        (lanes, state)
    }

    /// Lets each section filter a sample: the first one `x`, the others the outputs of the step before. With `PARTLY`, sections
    /// that step `t` of a block of `samples` leaves without a sample keep their states.
    #[inline(always)]
    fn step<const PARTLY: bool>(
        &self,
        simd: S,
        state: &mut State<S, V>,
        x: f64,
        (t, samples): (usize, usize),
    ) {
        for v in (0..V).rev() {
            let Vectors { b: [b0, c1, c2], a: [a1, a2], delay, is_first } = self.vectors[v];
            let (s1, s2) = (state.s1[v], state.s2[v]);
            let before = if v == 0 { state.moved } else { state.y[v - 1] };
            let x = simd.select_f64s(is_first, simd.splat_f64s(x), before);
            state.y[v] = simd.add_f64s(simd.mul_f64s(b0, x), s1);
            let next1 = simd.sub_f64s(simd.add_f64s(simd.mul_f64s(c1, x), s2), simd.mul_f64s(a1, s1));
            let next2 = simd.sub_f64s(simd.mul_f64s(c2, x), simd.mul_f64s(a2, s1));
            (state.s1[v], state.s2[v]) = (next1, next2);
            if PARTLY {
                let is_early = simd.less_than_f64s(simd.splat_f64s(t as f64), delay);
                let since = simd.splat_f64s(t as f64 - samples as f64);
                let rests = simd.or_m64s(is_early, simd.greater_than_or_equal_f64s(since, delay));
                state.s1[v] = simd.select_f64s(rests, s1, next1);
                state.s2[v] = simd.select_f64s(rests, s2, next2);
            }
        }
        state.moved = simd.rotate_right_f64s(state.y[V - 1], 1);
    }
}

impl<S: Simd, const V: usize> State<S, V> {
    #[inline(always)]
    fn write(&self, unused: usize, group: &mut Group<'_>) {
        let mut rows = [[[0.0; WIDEST]; 2]; V];
        for (v, [s1, s2]) in rows.iter_mut().enumerate() {
            store::<S>(self.s1[v], s1);
            store::<S>(self.s2[v], s2);
        }
        for (number, section) in group.iter_mut().flatten().enumerate() {
            let [s1, s2] = &rows[(unused + number) % V];
            let lane = (unused + number) / V;
            section.state = [s1[lane], s2[lane]];
        }
    }
}
