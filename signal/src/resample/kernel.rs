//! The windowed sinc and the sums over it.

use super::{Quality, ResampleError};
use crate::time::Rate;
use std::f64::consts::PI;

/// Lanes of the dot product; part of the order of its sum.
const LANES: usize = 8;

/// Coefficients a table may have: 32 MB of them.
const MAX_TAPS: u64 = 1 << 22;

/// A low-pass interpolation kernel under a Kaiser window, its time in input samples.
pub(super) struct Kernel {
    /// Half its length, a whole number of input samples.
    pub half_width: usize,
    /// Cut-off in cycles an input sample.
    cutoff: f64,
    /// Kaiser's shape parameter.
    beta: f64,
}

impl Kernel {
    pub(super) fn new(input: Rate, output: Rate, quality: Quality) -> Result<Self, ResampleError> {
        let Quality { passband, stopband, attenuation_db } = quality;
        let sound = 0.0 < passband && passband < stopband && stopband <= 2.0;
        if !(sound && (20.0..=180.0).contains(&attenuation_db)) {
            return Err(ResampleError::Quality { passband, stopband, attenuation_db });
        }
        // The lower Nyquist frequency, in cycles an input sample.
        let nyquist = 0.5 * (output.hz() / input.hz()).min(1.0);
        let transition = (stopband - passband) * nyquist;
        // Kaiser 1974: length for an attenuation and a transition width, and the shape that gives it.
        let length = (attenuation_db - 7.95) / (2.285 * 2.0 * PI * transition);
        let beta = if attenuation_db > 50.0 {
            0.1102 * (attenuation_db - 8.7)
        } else {
            0.5842 * (attenuation_db - 21.0).max(0.0).powf(0.4) + 0.078_86 * (attenuation_db - 21.0).max(0.0)
        };
        Ok(Self {
            half_width: ((length / 2.0).ceil() as usize).max(1),
            cutoff: 0.5 * (passband + stopband) * nyquist,
            beta,
        })
    }

    /// Refuses a table of taps for so many positions if it would be too large.
    pub(super) fn check_table(&self, phases: u64, input: Rate, output: Rate) -> Result<(), ResampleError> {
        let (taps, most) = (phases.saturating_mul(self.width() as u64), MAX_TAPS);
        if taps <= most {
            return Ok(());
        }
        Err(ResampleError::RatioTooFine { input, output, taps, most })
    }

    /// Inputs each output depends on.
    pub(super) fn width(&self) -> usize {
        2 * self.half_width
    }

    /// The taps of an output that lies `fraction` (0 to 1) of an input sample after the newest input, oldest input
    /// first, scaled so that constants pass unchanged.
    pub(super) fn taps(&self, fraction: f64) -> Vec<f64> {
        let width = self.width();
        let time = |i: usize| fraction + (width - 1 - i) as f64 - self.half_width as f64;
        let taps: Vec<f64> = (0..width).map(|i| self.at(time(i))).collect();
        let sum: f64 = taps.iter().sum();
        taps.into_iter().map(|tap| tap / sum).collect()
    }

    fn at(&self, time: f64) -> f64 {
        let inside = 1.0 - (time / self.half_width as f64).powi(2);
        if inside <= 0.0 {
            return 0.0;
        }
        let angle = 2.0 * PI * self.cutoff * time;
        let sinc = if angle == 0.0 { 1.0 } else { angle.sin() / angle };
        sinc * bessel_i0(self.beta * inside.sqrt())
    }
}

/// Modified Bessel function of the first kind and order 0, by its power series.
fn bessel_i0(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut term, mut sum, mut k) = (1.0, 1.0, 1.0);
    while term > 1e-17 * sum {
        term *= quarter / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

/// `sum a_i b_i` in an order that depends on the length alone.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    for (a, b) in a.iter().zip(b) {
        for l in 0..LANES {
            lanes[l] += a[l] * b[l];
        }
    }
    for (lane, (a, b)) in lanes.iter_mut().zip(a_rest.iter().zip(b_rest)) {
        *lane += a * b;
    }
    sum(lanes)
}

/// `sum_i b_i sum_r w_r a_ri` over four rows `a` of the length of `b`, in an order that depends on the length alone.
pub(super) fn mixed_dot(weights: [f64; 4], rows: &[f64], b: &[f64]) -> f64 {
    let [w0, w1, w2, w3] = weights;
    let mut lanes = [0.0; LANES];
    let (pairs, last) = rows.split_at(2 * b.len());
    let ((a0, a1), (a2, a3)) = (pairs.split_at(b.len()), last.split_at(b.len()));
    let rows = [a0, a1, a2, a3].map(|row| row.as_chunks::<LANES>());
    let (b, b_rest) = b.as_chunks::<LANES>();
    let [a0, a1, a2, a3] = rows.map(|(whole, _)| whole.iter());
    for ((((a0, a1), a2), a3), b) in a0.zip(a1).zip(a2).zip(a3).zip(b) {
        for l in 0..LANES {
            lanes[l] += ((w0 * a0[l] + w1 * a1[l]) + (w2 * a2[l] + w3 * a3[l])) * b[l];
        }
    }
    let [a0, a1, a2, a3] = rows.map(|(_, rest)| rest);
    for (l, (lane, b)) in lanes.iter_mut().zip(b_rest).enumerate() {
        *lane += ((w0 * a0[l] + w1 * a1[l]) + (w2 * a2[l] + w3 * a3[l])) * b;
    }
    sum(lanes)
}

fn sum([a, b, c, d, e, f, g, h]: [f64; LANES]) -> f64 {
    ((a + e) + (b + f)) + ((c + g) + (d + h))
}

/// The last inputs, contiguous, with room to append before they have to be moved.
#[derive(Debug, Clone)]
pub(super) struct History {
    samples: Box<[f64]>,
    width: usize,
    /// One past the newest input.
    end: usize,
}

impl History {
    /// All zero. Allocates here only.
    pub(super) fn new(width: usize) -> Self {
        Self { samples: vec![0.0; width + width.max(512)].into_boxed_slice(), width, end: width }
    }

    pub(super) fn push(&mut self, x: &[f64]) {
        for x in x.chunks(self.samples.len() - self.width) {
            if self.end + x.len() > self.samples.len() {
                self.samples.copy_within(self.end - self.width..self.end, 0);
                self.end = self.width;
            }
            self.samples[self.end..self.end + x.len()].copy_from_slice(x);
            self.end += x.len();
        }
    }

    /// The last `width` inputs, oldest first.
    pub(super) fn window(&self) -> &[f64] {
        &self.samples[self.end - self.width..self.end]
    }

    /// Copies the history of another one, which has the same width.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.samples.copy_from_slice(&other.samples);
        self.end = other.end;
    }

    pub(super) fn clear(&mut self) {
        self.samples.fill(0.0);
        self.end = self.width;
    }
}
