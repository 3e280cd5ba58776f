//! A cascade of sections skewed across vector lanes: while a section filters one sample, the next section filters the sample
//! before. From one sample to the next a section waits for a product and a sum; so do sixteen side by side.
//!
//! Each section computes what [`Running::process`] does, with the same bits.

use super::{Running, SETTLE};
use pulp::{Arch, Simd, WithSimd};

/// Maximum number of sections side by side.
pub(super) const WIDEST: usize = 16;
/// With fewer sections, or for fewer samples, each section filters by itself.
pub(super) const NARROWEST: usize = 4;
pub(super) const SHORTEST: usize = WIDEST;

/// Filters a block of [`SHORTEST`] to [`SETTLE`] samples in place by one section after the other.
pub(super) fn process<'a>(
    arch: Arch,
    mut sections: impl Iterator<Item = &'a mut Running>,
    block: &mut [f64],
) {
    loop {
        let mut group: Group<'_> = std::array::from_fn(|_| sections.next());
        match group.iter().flatten().count() {
            0 => return,
            count if count < NARROWEST => one_by_one(&mut group, block),
            count => arch.dispatch(Wavefront { count, group: &mut group, block }),
        }
    }
}

/// Successive sections.
type Group<'a> = [Option<&'a mut Running>; WIDEST];

fn one_by_one(sections: &mut [Option<&mut Running>], block: &mut [f64]) {
    sections.iter_mut().flatten().for_each(|section| section.process_in_place(block));
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
        let Self { count, group, block } = self;
        if S::F64_LANES < 4 {
            return one_by_one(group, block);
        }
        // The states of two vectors, with what a step computes, stay in registers.
        for sections in group[..count].chunks_mut(2 * S::F64_LANES) {
            if sections.len() > S::F64_LANES {
                // The first one has to be a lane of the first vector.
                let (even, odd) = sections.split_at_mut(sections.len() & !1);
                run::<S, 2>(simd, even, block);
                one_by_one(odd, block);
            } else {
                run::<S, 1>(simd, sections, block);
            }
        }
    }
}

/// Part of a block: while the wave enters, and while it leaves, some sections have no sample.
const ENTERS: u8 = 0;
const INSIDE: u8 = 1;
const LEAVES: u8 = 2;

/// Filters a block by all these sections.
#[inline(always)]
fn run<S: Simd, const V: usize>(simd: S, sections: &mut [Option<&mut Running>], block: &mut [f64]) {
    let unused = V * S::F64_LANES - sections.len();
    let (samples, last) = (block.len(), delay::<V>(unused, sections.len() - 1));
    if samples <= last {
        return one_by_one(sections, block);
    }
    let (lanes, mut state) = Lanes::<S, V>::of(simd, unused, sections);
    let mut out = [0.0; SETTLE + LANES];
    let (entering, inside) = block.split_at(last);
    for (t, x) in entering.iter().enumerate() {
        lanes.step::<ENTERS>(simd, &mut state, *x, t as f64);
    }
    // The output is in the first lane; what is behind it is overwritten.
    for (n, x) in inside.iter().enumerate() {
        lanes.step::<INSIDE>(simd, &mut state, *x, 0.0);
        store::<S>(state.moved, &mut out[n..]);
    }
    for t in 0..last {
        lanes.step::<LEAVES>(simd, &mut state, 0.0, t as f64);
        store::<S>(state.moved, &mut out[samples - last + t..]);
    }
    block.copy_from_slice(&out[..samples]);
    state.write(lanes.unused, sections);
}

/// The sections: number `s` is lane `s / V` of vector `s % V`, so that only the outputs of the last vector change lanes. Unused
/// ones come first.
struct Lanes<S: Simd, const V: usize> {
    vectors: [Vectors<S>; V],
    /// The lane of the first section in the first vector.
    is_first: S::m64s,
    unused: usize,
}

/// A section in each lane.
#[derive(Clone, Copy)]
struct Vectors<S: Simd> {
    /// `b_0`, `b_1 - a_1 b_0`, `b_2 - a_2 b_0`.
    b: [S::f64s; 3],
    a: [S::f64s; 2],
    /// As [`delay`].
    delay: S::f64s,
}

/// Steps by which section `number` is later than the first one: one from vector to vector, and one more from lane to lane.
fn delay<const V: usize>(unused: usize, number: usize) -> usize {
    number + (unused + number) / V - unused / V
}

/// What changes from step to step.
struct State<S: Simd, const V: usize> {
    s1: [S::f64s; V],
    s2: [S::f64s; V],
    y: [S::f64s; V],
    /// The last vector's outputs moved by a lane: the output of the cascade comes first.
    moved: S::f64s,
    /// The same a step before: what the first vector filters, so that nothing waits for the move.
    moved_before: S::f64s,
}

/// Numbers of the sections by lane.
type Row = [f64; LANES];

/// The most lanes of a vector.
const LANES: usize = 8;

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
    fn of(simd: S, unused: usize, group: &[Option<&mut Running>]) -> (Self, State<S, V>) {
        let mut rows: [[Row; 7]; V] = [[[0.0; LANES]; 7]; V];
        let mut delays = [[f64::NEG_INFINITY; LANES]; V];
        for (number, section) in group.iter().flatten().enumerate() {
            let (v, lane) = ((unused + number) % V, (unused + number) / V);
            let Running { biquad, state: [s1, s2] } = **section;
            let ([b0, b1, b2], [a1, a2]) = (biquad.b, biquad.a);
            let numbers = [b0, b1 - a1 * b0, b2 - a2 * b0, a1, a2, s1, s2];
            rows[v].iter_mut().zip(numbers).for_each(|(row, number)| row[lane] = number);
            delays[v][lane] = delay::<V>(unused, number) as f64;
        }
        let nothing = simd.splat_f64s(0.0);
        let none = Vectors { b: [nothing; 3], a: [nothing; 2], delay: nothing };
        let is_first = simd.equal_f64s(load::<S>(&delays[0]), nothing);
        let mut lanes = Self { vectors: [none; V], is_first, unused };
        let mut state = State {
            s1: [nothing; V],
            s2: [nothing; V],
            y: [nothing; V],
            moved: nothing,
            moved_before: nothing,
        };
        for v in 0..V {
            let [b0, c1, c2, a1, a2, s1, s2] = &rows[v];
            lanes.vectors[v] = Vectors {
                b: [load::<S>(b0), load::<S>(c1), load::<S>(c2)],
                a: [load::<S>(a1), load::<S>(a2)],
                delay: load::<S>(&delays[v]),
            };
            (state.s1[v], state.s2[v]) = (load::<S>(s1), load::<S>(s2));
        }
        (lanes, state)
    }

    /// Lets each section filter a sample: the first one `x`, the others the outputs of the step before. Step `t` of those in
    /// which the wave enters or leaves has sections without a sample, which keep their states.
    #[inline(always)]
    fn step<const PART: u8>(&self, simd: S, state: &mut State<S, V>, x: f64, t: f64) {
        for v in (0..V).rev() {
            let Vectors { b: [b0, c1, c2], a: [a1, a2], delay } = self.vectors[v];
            let (s1, s2) = (state.s1[v], state.s2[v]);
            let x = match v {
                0 => simd.select_f64s(self.is_first, simd.splat_f64s(x), state.moved_before),
                _ => state.y[v - 1],
            };
            state.y[v] = simd.add_f64s(simd.mul_f64s(b0, x), s1);
            let next1 = simd.sub_f64s(simd.add_f64s(simd.mul_f64s(c1, x), s2), simd.mul_f64s(a1, s1));
            let next2 = simd.sub_f64s(simd.mul_f64s(c2, x), simd.mul_f64s(a2, s1));
            (state.s1[v], state.s2[v]) = (next1, next2);
            if PART != INSIDE {
                let has_come = simd.less_than_or_equal_f64s(delay, simd.splat_f64s(t));
                let [early, late] = if PART == ENTERS { [s1, next1] } else { [next1, s1] };
                state.s1[v] = simd.select_f64s(has_come, late, early);
                let [early, late] = if PART == ENTERS { [s2, next2] } else { [next2, s2] };
                state.s2[v] = simd.select_f64s(has_come, late, early);
            }
        }
        state.moved_before = state.moved;
        state.moved = simd.rotate_right_f64s(state.y[V - 1], 1);
    }
}

impl<S: Simd, const V: usize> State<S, V> {
    #[inline(always)]
    fn write(&self, unused: usize, group: &mut [Option<&mut Running>]) {
        let mut rows: [[Row; 2]; V] = [[[0.0; LANES]; 2]; V];
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
