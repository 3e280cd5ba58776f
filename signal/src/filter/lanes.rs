//! Filters of many voices, side by side in SIMD lanes.

use super::{Biquad, SETTLE, SILENCE, Sections};
use crate::instructions::arch;
use pulp::{Arch, Simd, WithSimd};

/// [`SectionsState`](super::SectionsState)s of as many voices as there are lanes, with the same bits.
#[derive(Debug, Clone)]
pub struct SectionLanes<const L: usize> {
    sections: Vec<Running<L>>,
    since_settled: usize,
    arch: Arch,
}

/// A section of each voice, on whole cache lines.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct Running<const L: usize> {
    /// `b_0`, `b_1 - a_1 b_0`, `b_2 - a_2 b_0`.
    b: [[f64; L]; 3],
    a: [[f64; L]; 2],
    state: [[f64; L]; 2],
}

impl<const L: usize> SectionLanes<L> {
    /// Makes one filter per lane, with zero state; lanes without a filter are silent. All filters should have the same
    /// number of sections: a missing section passes the signal. Allocates here only.
    pub fn new(filters: &[Sections]) -> Self {
        let sections = filters.iter().map(|filter| filter.sections.len()).max();
        let running = |number: usize| {
            let (mut b, mut a) = ([[0.0; L]; 3], [[0.0; L]; 2]);
            for (l, filter) in filters.iter().take(L).enumerate() {
                let section = filter.sections.get(number).unwrap_or(&Biquad::IDENTITY);
                let ([b0, b1, b2], [a1, a2]) = (section.b, section.a);
                (b[0][l], b[1][l], b[2][l]) = (b0, b1 - a1 * b0, b2 - a2 * b0);
                (a[0][l], a[1][l]) = (a1, a2);
            }
            let state = [[0.0; L]; 2];
            Running { b, a, state }
        };
        Self { sections: (0..sections.unwrap_or(0)).map(running).collect(), since_settled: 0, arch: arch() }
    }

    /// Filters frames of one sample a lane in place.
    pub fn process_in_place(&mut self, frames: &mut [[f64; L]]) {
        let mut rest = frames;
        while !rest.is_empty() {
            let (block, later) = rest.split_at_mut(rest.len().min(SETTLE - self.since_settled));
            for section in &mut self.sections {
                self.arch.dispatch(Run { section, block });
            }
            self.since_settled += block.len();
            if self.since_settled == SETTLE {
                self.since_settled = 0;
                self.sections.iter_mut().for_each(Running::settle);
            }
            rest = later;
        }
    }
}

impl<const L: usize> Running<L> {
    /// Clears lanes that are silent, NaN or infinite.
    fn settle(&mut self) {
        for l in 0..L {
            let [s1, s2] = [self.state[0][l], self.state[1][l]];
            let silent = s1.abs() < SILENCE && s2.abs() < SILENCE;
            if silent || !(s1.is_finite() && s2.is_finite()) {
                (self.state[0][l], self.state[1][l]) = (0.0, 0.0);
            }
        }
    }
}

/// Filters frames by one section.
struct Run<'a, const L: usize> {
    section: &'a mut Running<L>,
    block: &'a mut [[f64; L]],
}

impl<const L: usize> WithSimd for Run<'_, L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { section, block } = self;
        // A vector of lanes at a time, so that its states stay in registers.
        if L.is_multiple_of(8) {
            for part in 0..L / 8 {
                section.run::<8>(part, block);
            }
        } else {
            for part in 0..L {
                section.run::<1>(part, block);
            }
        }
    }
}

impl<const L: usize> Running<L> {
    /// Filters the `W` lanes with the number `part`.
    #[inline(always)]
    fn run<const W: usize>(&mut self, part: usize, block: &mut [[f64; L]]) {
        let ([b0, b1, b2], [a1, a2], [s1, s2]) = (&self.b, &self.a, &mut self.state);
        let [b0, b1, b2] = [b0, b1, b2].map(|row| row.as_chunks::<W>().0[part]);
        let [a1, a2] = [a1, a2].map(|row| row.as_chunks::<W>().0[part]);
        let [kept1, kept2] = [s1, s2].map(|row| &mut row.as_chunks_mut::<W>().0[part]);
        let (mut s1, mut s2) = (*kept1, *kept2);
        for frame in block {
            let frame = &mut frame.as_chunks_mut::<W>().0[part];
            for l in 0..W {
                let x = frame[l];
                let before = s1[l];
                frame[l] = b0[l] * x + before;
                s1[l] = (b1[l] * x + s2[l]) - a1[l] * before;
                s2[l] = b2[l] * x - a2[l] * before;
            }
        }
        (*kept1, *kept2) = (s1, s2);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{SectionsState, butterworth_highpass};
    use super::*;
    use crate::noise::Gaussian;

    #[test]
    fn each_lane_has_the_bits_of_its_filter_alone() {
        let filters: Vec<Sections> =
            (1..=3).map(|k| butterworth_highpass(4, 20.0 * f64::from(k), 10_000.0).unwrap()).collect();
        let mut frames = vec![[0.0; 4]; 500];
        Gaussian::new(1).fill(frames[..200].as_flattened_mut());
        frames[7][1] = f64::NAN;
        let given = frames.clone();
        let mut lanes = SectionLanes::<4>::new(&filters);
        let (first, rest) = frames.split_at_mut(41);
        lanes.process_in_place(first);
        lanes.process_in_place(rest);
        for (l, filter) in filters.iter().enumerate() {
            let mut alone: Vec<f64> = given.iter().map(|frame| frame[l]).collect();
            SectionsState::new(filter).process_in_place(&mut alone);
            let same = |x: f64, y: f64| x.to_bits() == y.to_bits() || x.is_nan() && y.is_nan();
            assert!(frames.iter().zip(&alone).all(|(frame, y)| same(frame[l], *y)));
        }
    }
}
