//! The crackle of several voices in SIMD lanes.

use super::CrackleSource;
use haptograph_signal::elementwise::mul_add;
use haptograph_signal::noise::Gaussian;

/// One [`CrackleSource`] per lane: the same random streams, with an exponential that differs only by
/// rounding.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(crate) struct CrackleLanes<const L: usize> {
    noise: Vec<Gaussian>,
    z: [f64; L],
    kept: [f64; L],
    fresh: [f64; L],
    half_depth: [f64; L],
}

impl<const L: usize> CrackleLanes<L> {
    /// Assigns one source per lane; lanes without a source stay unchanged.
    pub fn new(sources: impl IntoIterator<Item = CrackleSource>) -> Self {
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
    pub fn draw<const N: usize>(&mut self, first: usize, into: &mut [[f64; N]]) {
        for (noise, row) in self.noise.iter_mut().skip(first).zip(into) {
            noise.fill(row);
        }
    }

    /// Multiplies frames of white excitation by the square root of the fluctuation, which consumes as many frames of
    /// the streams.
    ///
    /// Made to be inlined where vector instructions are chosen.
    #[inline(always)]
    pub fn modulate(&mut self, excitation: &mut [[f64; L]], drawn: &[[f64; L]]) {
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
    use crate::Crackle;

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
        (0..3).zip(&mut alone).for_each(|(lane, out)| source(lane).modulate(out));
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
