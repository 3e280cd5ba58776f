//! Spectra under several tapers.

use haptograph_signal::Complex64;
use haptograph_signal::fft::{self, Transform};

/// Tapers of signals of one length, and what transforms under them.
pub(crate) struct Multitaper {
    /// Two tapers per transform, as real and imaginary part.
    pairs: Vec<Vec<Complex64>>,
    transform: Transform,
    /// Zero beyond the length.
    buffer: Vec<Complex64>,
    transformed: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl Multitaper {
    /// Tapers of a length, transformed at a size not below it. `taper` has their values by order and sample, both from 1.
    pub(crate) fn new([length, size, count]: [usize; 3], taper: impl Fn(usize, usize) -> f64) -> Self {
        let transform = fft::forward(size);
        let value = |order: usize, n: usize| if order <= count { taper(order, n) } else { 0.0 };
        let pair =
            |order| (1..=length).map(|n| Complex64::new(value(order, n), value(order + 1, n))).collect();
        Self {
            pairs: (1..=count).step_by(2).map(pair).collect(),
            buffer: vec![Complex64::default(); size],
            transformed: vec![Complex64::default(); size],
            scratch: vec![Complex64::default(); transform.get_immutable_scratch_len()],
            transform,
        }
    }

    /// Sums over the tapers of the two-sided powers in the first `bins` of those from 0 to half the rate, not scaled.
    pub(crate) fn powers(&mut self, signal: &[f64], bins: usize) -> Vec<f64> {
        let mut powers = vec![0.0; bins];
        for pair in &self.pairs {
            for ((value, taper), x) in self.buffer.iter_mut().zip(pair).zip(signal) {
                *value = taper * x;
            }
            let Self { buffer, transformed, scratch, .. } = self;
            self.transform.process_immutable_with_scratch(buffer, transformed, scratch);
            // Powers of two real signals in one transform: those at a bin and at its mirror; the bin of 0 is its own.
            let mirrors = transformed[..1].iter().chain(transformed.iter().rev());
            for ((power, bin), mirror) in powers.iter_mut().zip(&*transformed).zip(mirrors) {
                *power += bin.norm_sqr() + mirror.norm_sqr();
            }
        }
        powers
    }
}
