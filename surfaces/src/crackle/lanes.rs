//! The crackle of several voices in SIMD lanes.

use super::CrackleSource;
use haptograph_signal::noise::Gaussian;

/// One [`CrackleSource`] per lane: the same random streams, with an exponential that differs only by
/// rounding.
#[derive(Debug, Clone)]
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
        let mut all = Self {
            noise: vec![],
            z,
            kept,
            fresh,
            half_depth,
        };
        for (l, source) in sources.into_iter().take(L).enumerate() {
            (all.z[l], all.kept[l]) = (source.z, source.kept);
            (all.fresh[l], all.half_depth[l]) = (source.fresh, source.half_depth);
            all.noise.push(source.noise);
        }
        all
    }

    /// Draws the next samples of each lane's stream into its row.
    pub fn draw<const N: usize>(&mut self, samples: usize, into: &mut [[f64; N]]) {
        for (noise, row) in self.noise.iter_mut().zip(into) {
            noise.fill(&mut row[..samples]);
        }
    }

    /// Multiplies a frame of white excitation by the square root of the fluctuation, which consumes a frame
    /// of the streams.
    #[inline(always)]
    pub fn modulate(&mut self, excitation: &mut [f64; L], drawn: &[f64; L]) {
        for l in 0..L {
            self.z[l] = self.kept[l] * self.z[l] + self.fresh[l] * drawn[l];
            excitation[l] *= exp(self.half_depth[l] * (self.z[l] - self.half_depth[l]));
        }
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
    let rest = (x - halvings * LN_2_HIGH) - halvings * LN_2_LOW;
    let mut sum = SERIES[13];
    for &term in SERIES[..13].iter().rev() {
        sum = sum * rest + term;
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
        lanes.draw(50, &mut drawn);
        let mut alone = [[1.0; 50]; 3];
        (0..3)
            .zip(&mut alone)
            .for_each(|(lane, out)| source(lane).modulate(out));
        for n in 0..50 {
            let mut frame = [1.0; 4];
            lanes.modulate(&mut frame, &std::array::from_fn(|l| drawn[l][n]));
            for l in 0..3 {
                assert!((frame[l] / alone[l][n] - 1.0).abs() < 1e-14);
            }
            assert_eq!(frame[3], 1.0);
        }
    }
}
