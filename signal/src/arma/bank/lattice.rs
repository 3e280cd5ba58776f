//! Lattices in lanes.

use super::{Frames, Group, LATTICES as LANES, UNDER_WAY, vectors, vectors_mut};
use crate::arma::lattice::Coefficients;
use crate::arma::{ArmaError, MAX_ORDER, is_over};
use crate::elementwise::CacheLines;
use crate::prediction::ladder_lanes;
use crate::warped::first_error;
use pulp::{Arch, Simd, WithSimd};

type Lanes = [f64; LANES];

/// As many [`Lattice`](crate::arma::Lattice)s as there are lanes.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct LatticeGroup {
    /// Rotations by stage, from stage 1; missing stages turn by 0 and change nothing.
    sine: [Lanes; MAX_ORDER],
    cosine: [Lanes; MAX_ORDER],
    taps: [Lanes; MAX_ORDER + 1],
    backward: [Lanes; MAX_ORDER + 1],
    order: [usize; LANES],
    has_ladder: [bool; LANES],
}

impl Group for LatticeGroup {
    const LANES: usize = LANES;

    fn new() -> Self {
        let mut taps = [[0.0; LANES]; MAX_ORDER + 1];
        taps[0] = [1.0; LANES];
        Self {
            sine: [[0.0; LANES]; MAX_ORDER],
            cosine: [[1.0; LANES]; MAX_ORDER],
            taps,
            order: [0; LANES],
            has_ladder: [false; LANES],
            backward: [[0.0; LANES]; MAX_ORDER + 1],
        }
    }

    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, frames: Frames<'_>) {
        if self.has_ladder.contains(&true) {
            self.run_with::<S, true>(simd, frames);
        } else {
            self.run_with::<S, false>(simd, frames);
        }
    }

    fn settle(&mut self) {
        for lane in 0..LANES {
            let column: [f64; MAX_ORDER] = std::array::from_fn(|m| self.backward[m][lane]);
            if is_over(&[], &column[..self.order[lane]]) {
                for row in &mut self.backward {
                    row[lane] = 0.0;
                }
            }
        }
    }
}

impl LatticeGroup {
    /// See [`VoiceBank::set_coefficients`](super::VoiceBank::set_coefficients).
    pub(super) fn set_coefficients(
        &mut self,
        lane: usize,
        ar: &[f64],
        ma: &[f64],
        gain: f64,
    ) -> Result<(), ArmaError> {
        let coefficients = Coefficients::new(ar, ma, gain)?;
        let old = self.order[lane];
        let order = coefficients.order;
        for m in 0..order.max(old) {
            self.sine[m][lane] = coefficients.sine[m];
            self.cosine[m][lane] = coefficients.cosine[m];
        }
        for m in 0..=order.max(old) {
            self.taps[m][lane] = coefficients.taps[m];
        }
        for row in &mut self.backward[order.min(old)..] {
            row[lane] = 0.0;
        }
        (self.order[lane], self.has_ladder[lane]) = (order, coefficients.has_ladder);
        Ok(())
    }

    /// See [`VoiceBank::set_group`](super::VoiceBank::set_group).
    pub(super) fn set_all(
        &mut self,
        arch: Arch,
        ar: &[Lanes],
        ma: &[Lanes],
        gain: &Lanes,
    ) -> Result<(), (usize, ArmaError)> {
        let group = self;
        let is_set = arch.dispatch(SetAll { group, ar, ma, gain });
        let wrong = |lane: usize, ar: &[f64]| {
            let ma: Vec<f64> = ma.iter().map(|row| row[lane]).collect();
            Coefficients::new(ar, &ma, gain[lane]).map(drop)
        };
        is_set.then_some(()).ok_or_else(|| first_error(ar, wrong))
    }

    /// Takes all voices to one order: stages that are gone pass on, and their signals must not come back with them.
    fn begin(&mut self, order: usize) {
        for m in order..self.order.into_iter().fold(order, usize::max) {
            (self.sine[m], self.cosine[m], self.taps[m + 1]) = ([0.0; LANES], [1.0; LANES], [0.0; LANES]);
        }
        for lane in 0..LANES {
            for row in &mut self.backward[order.min(self.order[lane])..] {
                row[lane] = 0.0;
            }
        }
        self.order = [order; LANES];
    }

    #[inline(always)]
    fn run_with<S: Simd, const LADDER: bool>(&mut self, simd: S, mut frames: Frames<'_>) {
        let order = self.order.into_iter().fold(0, usize::max).min(MAX_ORDER);
        for n in 0..frames.count() {
            let mut samples = CacheLines([frames.excitation(n)]);
            for (part, samples) in vectors_mut::<S>(&mut samples.0).iter_mut().enumerate() {
                self.step::<S, LADDER>(simd, part, order, samples);
            }
            frames.put(n, &samples.0[0]);
        }
    }

    /// Takes the samples of some voices through all stages.
    #[inline(always)]
    fn step<S: Simd, const LADDER: bool>(
        &mut self,
        simd: S,
        part: usize,
        order: usize,
        samples: &mut [S::f64s; UNDER_WAY],
    ) {
        let parts = LANES / S::F64_LANES / UNDER_WAY;
        let (sine, cosine) = (vectors::<S>(&self.sine), vectors::<S>(&self.cosine));
        let (taps, state) = (vectors::<S>(&self.taps), vectors_mut::<S>(&mut self.backward));
        let (mut forward, mut out) = (*samples, [simd.splat_f64s(0.0); UNDER_WAY]);
        for m in (0..order).rev() {
            let at = m * parts + part;
            let (sine, cosine, tap, delayed) = (&sine[at], &cosine[at], &taps[at + parts], state[at]);
            for i in 0..UNDER_WAY {
                let (sine, cosine) = (sine[i], cosine[i]);
                let backward =
                    simd.add_f64s(simd.mul_f64s(sine, forward[i]), simd.mul_f64s(cosine, delayed[i]));
                forward[i] =
                    simd.sub_f64s(simd.mul_f64s(cosine, forward[i]), simd.mul_f64s(sine, delayed[i]));
                if LADDER {
                    out[i] = simd.add_f64s(out[i], simd.mul_f64s(tap[i], backward));
                }
                state[at + parts][i] = backward;
            }
        }
        state[part] = forward;
        for i in 0..UNDER_WAY {
            samples[i] = simd.add_f64s(out[i], simd.mul_f64s(taps[part][i], forward[i]));
        }
    }
}

/// Gives a group new coefficients; whether it has taken them.
struct SetAll<'a> {
    group: &'a mut LatticeGroup,
    ar: &'a [Lanes],
    ma: &'a [Lanes],
    gain: &'a Lanes,
}

impl WithSimd for SetAll<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        let Self { group, ar, ma, gain } = self;
        let (order, has_ladder) = (ar.len().max(ma.len()), !ma.is_empty());
        if order > MAX_ORDER {
            return false;
        }
        // Nothing is kept before all are found to be sound.
        let [mut sine, mut cosine] = [CacheLines([[0.0; LANES]; MAX_ORDER]); 2];
        let mut taps = CacheLines([[0.0; LANES]; MAX_ORDER + 1]);
        let (sine, cosine, taps) = (&mut sine.0[..order], &mut cosine.0[..order], &mut taps.0[..=order]);
        sine[..ar.len()].copy_from_slice(ar);
        taps[0] = [1.0; LANES];
        taps[1..=ma.len()].copy_from_slice(ma);
        let is_sound = ladder_lanes(has_ladder, sine, cosine, taps);
        let mut sum = [0.0; LANES];
        for tap in &mut *taps {
            for l in 0..LANES {
                tap[l] *= gain[l];
                // Nothing times those is nothing; times the others it is not a number.
                sum[l] += tap[l] * 0.0;
            }
        }
        if !is_sound || sum != [0.0; LANES] {
            return false;
        }
        if group.order != [order; LANES] {
            group.begin(order);
        }
        group.has_ladder = [has_ladder; LANES];
        group.sine[..order].copy_from_slice(sine);
        group.cosine[..order].copy_from_slice(cosine);
        group.taps[..=order].copy_from_slice(taps);
        true
    }
}
