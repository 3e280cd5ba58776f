//! Filters as cascades of second-order sections: coefficients, responses, and running state.
//!
//! ```
//! use haptograph_signal::filter::{SectionsState, butterworth_lowpass};
//!
//! let filter = butterworth_lowpass(2, 20.0, 1000.0)?;
//! assert!((filter.response(20.0, 1000.0).norm() - 0.5_f64.sqrt()).abs() < 1e-9);
//!
//! let mut state = SectionsState::new(&filter);
//! let mut step = [1.0; 500];
//! state.process_in_place(&mut step);
//! assert!(step[0] < 0.01 && (step[499] - 1.0).abs() < 1e-6);
//! # Ok::<(), haptograph_signal::filter::DesignError>(())
//! ```

mod design;
mod lanes;
mod wavefront;

pub use design::{
    Cascade, DesignError, MAX_ORDER, Prototype, bessel_lowpass, butterworth_bandpass, butterworth_highpass,
    butterworth_lowpass, double_pole,
};
pub use lanes::SectionLanes;

use crate::Complex64;
use crate::instructions::arch;
use pulp::Arch;
use wavefront::{NARROWEST, SHORTEST, WIDEST};

/// Interval in samples at which a recursive state is checked for silence.
const SETTLE: usize = 64;
/// States below this, in the signal's unit, count as silence: far below any sensor's noise, far above denormals.
const SILENCE: f64 = 1e-30;

/// A second-order section, `(b_0 + b_1 z^-1 + b_2 z^-2) / (1 + a_1 z^-1 + a_2 z^-2)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Biquad {
    /// `[b_0, b_1, b_2]`.
    pub b: [f64; 3],
    /// `[a_1, a_2]`.
    pub a: [f64; 2],
}

impl Biquad {
    /// The section that passes the signal unchanged.
    pub(crate) const IDENTITY: Self = Self { b: [1.0, 0.0, 0.0], a: [0.0, 0.0] };

    /// True if both poles lie inside the unit circle.
    pub fn is_stable(&self) -> bool {
        let [a1, a2] = self.a;
        a2.abs() < 1.0 && a1.abs() < 1.0 + a2
    }

    /// Complex gain at `z^-1`.
    fn gain_at(&self, inverse_z: Complex64) -> Complex64 {
        self.numerator(inverse_z) / self.denominator(inverse_z)
    }

    fn numerator(&self, inverse_z: Complex64) -> Complex64 {
        (inverse_z * self.b[2] + self.b[1]) * inverse_z + self.b[0]
    }

    fn denominator(&self, inverse_z: Complex64) -> Complex64 {
        (inverse_z * self.a[1] + self.a[0]) * inverse_z + 1.0
    }

    /// Group delay in samples: that of the numerator less that of the denominator, each `Re(sum k c_k z^-k / sum c_k
    /// z^-k)`.
    fn group_delay(&self, inverse_z: Complex64) -> f64 {
        let numerator = self.numerator(inverse_z);
        let zeros = if numerator.norm() <= 1e-9 * self.b.iter().map(|b| b.abs()).sum::<f64>() {
            // At a zero on the unit circle the delay is that of its neighbourhood: half a sample per zero.
            if self.b[2] == 0.0 { 0.5 } else { 1.0 }
        } else {
            ((inverse_z * (2.0 * self.b[2]) + self.b[1]) * inverse_z / numerator).re
        };
        let poles =
            ((inverse_z * (2.0 * self.a[1]) + self.a[0]) * inverse_z / self.denominator(inverse_z)).re;
        zeros - poles
    }

    /// Matrix from the states of two trapezoidal integrators that form this section (Zavalishin) to its direct-form
    /// state. The meaning of the integrator states does not depend on the coefficients; that of the direct-form state
    /// does.
    fn integrators_to_state(&self) -> [[f64; 2]; 2] {
        let ([b0, b1, b2], [a1, a2]) = (self.b, self.a);
        if a2 == 0.0 && b2 == 0.0 {
            // One pole, and one integrator.
            let (low, high) = ((b0 + b1) / (1.0 + a1), (b0 - b1) / (1.0 - a1));
            return [[0.5 * (low - high) * (1.0 - a1), 0.0], [0.0, 1.0]];
        }
        let (loop_gain, g) = (0.25 * (1.0 - a1 + a2), ((1.0 + a1 + a2) / (1.0 - a1 + a2)).sqrt());
        let damping = 0.5 * (1.0 - a2) / (g * loop_gain);
        let high = 0.25 * (b0 - b1 + b2) / loop_gain;
        let band = 0.5 * (b0 - b2) / (g * loop_gain);
        let low = 0.25 * (b0 + b1 + b2) / (g * g * loop_gain);
        // Outputs of both integrators for a sample without input, by their states.
        let given = [[loop_gain, -g * loop_gain], [g * loop_gain, 1.0 - g * g * loop_gain]];
        let mixed = |[first, second]: [f64; 2]| -> [f64; 2] {
            std::array::from_fn(|i| first * given[0][i] + second * given[1][i])
        };
        let next = mixed([band - high * damping, low - high]);
        // Their next states: twice the output minus the state.
        let after = mixed(next);
        [next, std::array::from_fn(|i| 2.0 * after[i] + (a1 - 1.0) * next[i])]
    }
}

/// A filter: a cascade of second-order sections.
#[derive(Debug, Clone, PartialEq)]
pub struct Sections {
    /// The sections in the order in which they run.
    pub sections: Vec<Biquad>,
}

impl Sections {
    /// Complex gain at a frequency.
    pub fn response(&self, frequency_hz: f64, rate_hz: f64) -> Complex64 {
        let inverse_z = on_circle(frequency_hz, rate_hz);
        self.sections.iter().map(|s| s.gain_at(inverse_z)).product()
    }

    /// Group delay at a frequency, s.
    pub fn group_delay_s(&self, frequency_hz: f64, rate_hz: f64) -> f64 {
        let inverse_z = on_circle(frequency_hz, rate_hz);
        let samples: f64 = self.sections.iter().map(|s| s.group_delay(inverse_z)).sum();
        samples / rate_hz
    }
}

fn on_circle(frequency_hz: f64, rate_hz: f64) -> Complex64 {
    Complex64::from_polar(1.0, -std::f64::consts::TAU * frequency_hz / rate_hz)
}

/// Running state of [`Sections`], in transposed direct form II. The output does not depend on the block size.
///
/// Every 64 samples a state below 1e-30 is cleared, so that silence becomes exact, and so is a state that is NaN or
/// infinite, so that the filter recovers from a bad sample.
#[derive(Debug, Clone)]
pub struct SectionsState {
    sections: Box<[Running]>,
    /// Samples since the last check of the state.
    since_settled: usize,
}

#[derive(Debug, Clone, Copy)]
struct Running {
    biquad: Biquad,
    state: [f64; 2],
}

impl SectionsState {
    /// Makes a filter with zero state. Allocates here only.
    pub fn new(filter: &Sections) -> Self {
        let at_rest = |biquad: &Biquad| Running { biquad: *biquad, state: [0.0; 2] };
        Self { sections: filter.sections.iter().map(at_rest).collect(), since_settled: 0 }
    }

    /// Filters `x` into `y`, up to the shorter of the two.
    pub fn process(&mut self, x: &[f64], y: &mut [f64]) {
        let length = x.len().min(y.len());
        let (mut x, mut y) = (&x[..length], &mut y[..length]);
        if self.sections.is_empty() || self.sections.len() >= NARROWEST {
            y.copy_from_slice(x);
            return self.process_in_place(y);
        }
        // Without a copy first: its wide loads would stall on samples that were stored one by one just before.
        while !x.is_empty() {
            let (now, later_x) = x.split_at(x.len().min(SETTLE - self.since_settled));
            let (block, later_y) = y.split_at_mut(now.len());
            if let Some((first, later)) = self.sections.split_first_mut() {
                first.process(now.iter().copied().zip(&mut *block));
                later.iter_mut().for_each(|section| section.process_in_place(block));
            }
            self.since_settled += now.len();
            self.settle_in_time();
            (x, y) = (later_x, later_y);
        }
    }

    /// Filters `y` in place.
    pub fn process_in_place(&mut self, y: &mut [f64]) {
        Self::process_together(arch(), &mut [Some(self)], y);
    }

    /// The output for one sample.
    #[inline]
    pub fn sample(&mut self, x: f64) -> f64 {
        let y = self.sections.iter_mut().fold(x, |x, section| section.sample(x));
        self.since_settled += 1;
        self.settle_in_time();
        y
    }

    /// Filters `y` in place by one filter after the other, with the bits of each by itself, but sections of several side by
    /// side. Real-time code.
    pub fn process_chain<'a>(chain: impl Iterator<Item = &'a mut Self>, y: &mut [f64]) {
        Self::process_chain_by(arch(), chain, y);
    }

    fn process_chain_by<'a>(arch: Arch, chain: impl Iterator<Item = &'a mut Self>, y: &mut [f64]) {
        let mut chain = chain.fuse();
        loop {
            let mut group: [Option<&mut Self>; WIDEST] = std::array::from_fn(|_| chain.next());
            if group[0].is_none() {
                break;
            }
            Self::process_together(arch, &mut group, y);
        }
    }

    fn process_together(arch: Arch, group: &mut [Option<&mut Self>], y: &mut [f64]) {
        let sections: usize = group.iter().flatten().map(|filter| filter.sections.len()).sum();
        let mut rest = y;
        while !rest.is_empty() {
            let until_settled = group.iter().flatten().map(|filter| SETTLE - filter.since_settled).min();
            let (block, later) = rest.split_at_mut(rest.len().min(until_settled.unwrap_or(SETTLE)));
            let mut chain = group.iter_mut().flatten().flat_map(|filter| &mut *filter.sections);
            match sections < NARROWEST || block.len() < SHORTEST {
                true => chain.for_each(|section| section.process_in_place(block)),
                false => wavefront::process(arch, &mut chain, block),
            }
            for filter in group.iter_mut().flatten() {
                filter.since_settled += block.len();
                filter.settle_in_time();
            }
            rest = later;
        }
    }

    fn settle_in_time(&mut self) {
        if self.since_settled == SETTLE {
            self.since_settled = 0;
            self.sections.iter_mut().for_each(Running::settle);
        }
    }

    /// Sets the steady state for a constant input of this value, so that the filter starts without a transient.
    pub fn settle_at(&mut self, value: f64) {
        let mut input = value;
        for Running { biquad, state } in &mut self.sections {
            let [b0, b1, b2] = biquad.b;
            let [a1, a2] = biquad.a;
            let output = input * (b0 + b1 + b2) / (1.0 + a1 + a2);
            state[1] = b2 * input - a2 * output;
            state[0] = b1 * input - a1 * output + state[1];
            input = output;
        }
    }

    /// Copies the state of another filter with the same number of sections.
    pub fn copy_state_from(&mut self, other: &Self) {
        if self.sections.len() == other.sections.len() {
            self.since_settled = other.since_settled;
            for (section, other) in self.sections.iter_mut().zip(&other.sections) {
                section.state = other.state;
            }
        }
    }

    /// Sets new coefficients for the same number of sections and converts the state: a settled constant stays
    /// constant and the output does not jump.
    pub fn turn(&mut self, sections: &[Biquad]) {
        for (running, biquad) in self.sections.iter_mut().zip(sections) {
            let ([[m11, m12], [m21, m22]], [s1, s2]) = (running.biquad.integrators_to_state(), running.state);
            let determinant = m11 * m22 - m12 * m21;
            let held = [(m22 * s1 - m12 * s2) / determinant, (m11 * s2 - m21 * s1) / determinant];
            let state = biquad.integrators_to_state().map(|row| row[0] * held[0] + row[1] * held[1]);
            running.biquad = *biquad;
            // The state overflowed.
            running.state = if state.iter().all(|s| s.is_finite()) { state } else { [0.0; 2] };
        }
    }

    /// Copies the coefficients and the state of another filter with the same number of sections.
    pub fn take_over(&mut self, other: &Self) {
        if self.sections.len() == other.sections.len() {
            self.since_settled = other.since_settled;
            self.sections.copy_from_slice(&other.sections);
        }
    }

    /// Clears the state.
    pub fn reset(&mut self) {
        for section in &mut self.sections {
            section.state = [0.0; 2];
        }
        self.since_settled = 0;
    }
}

impl Running {
    #[inline]
    fn process_in_place(&mut self, block: &mut [f64]) {
        self.process(block.iter_mut().map(|sample| (*sample, sample)));
    }

    /// Transposed direct form II with the output eliminated from the states: from one sample to the next a state goes
    /// through one product and one sum, where the usual form has a sum more.
    ///
    /// The second state is computed when the next sample needs it: side by side the compiler would put both into one
    /// register, and the shuffles between would be on the way from sample to sample.
    #[inline(always)]
    fn process<'a>(&mut self, mut samples: impl Iterator<Item = (f64, &'a mut f64)>) {
        let [b0, b1, b2] = self.biquad.b;
        let [a1, a2] = self.biquad.a;
        let (c1, c2) = (b1 - a1 * b0, b2 - a2 * b0);
        let [s1, s2] = self.state;
        let Some((x, y)) = samples.next() else { return };
        *y = b0 * x + s1;
        let (mut older_x, mut older, mut s1) = (x, s1, (c1 * x + s2) - a1 * s1);
        for (x, y) in samples {
            let s2 = c2 * older_x - a2 * older;
            *y = b0 * x + s1;
            (older_x, older, s1) = (x, s1, (c1 * x + s2) - a1 * s1);
        }
        self.state = [s1, c2 * older_x - a2 * older];
    }

    #[inline]
    fn sample(&mut self, x: f64) -> f64 {
        let Biquad { b: [b0, b1, b2], a: [a1, a2] } = self.biquad;
        let [s1, s2] = self.state;
        self.state = [((b1 - a1 * b0) * x + s2) - a1 * s1, (b2 - a2 * b0) * x - a2 * s1];
        b0 * x + s1
    }

    fn settle(&mut self) {
        let [s1, s2] = self.state;
        let silent = s1.abs() < SILENCE && s2.abs() < SILENCE;
        if silent || !(s1.is_finite() && s2.is_finite()) {
            self.state = [0.0; 2];
        }
    }
}

/// Filters forward and backward, in place: no phase shift, the magnitude response squared. For recordings, not for live signals.
///
/// Both ends are extended by point reflection (odd extension), up to the filter's memory and the signal's length. The
/// filter starts in its steady state for the first value, so that constants and slopes pass unchanged.
pub fn filtfilt(filter: &Sections, mut x: Vec<f64>) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (x.first(), x.last()) else {
        return x;
    };
    let pad = memory(filter).min(x.len() - 1);
    let mut before: Vec<f64> = x[1..=pad].iter().rev().map(|v| 2.0 * first - v).collect();
    let end = &x[x.len() - 1 - pad..x.len() - 1];
    let mut after: Vec<f64> = end.iter().rev().map(|v| 2.0 * last - v).collect();
    let mut state = SectionsState::new(filter);
    for _ in 0..2 {
        state.reset();
        state.settle_at(before.first().map_or(x[0], |value| *value));
        for part in [&mut before, &mut x, &mut after] {
            state.process_in_place(part);
            part.reverse();
        }
        std::mem::swap(&mut before, &mut after);
    }
    x
}

/// Samples until the slowest pole has decayed to a millionth.
fn memory(filter: &Sections) -> usize {
    let radius = filter.sections.iter().map(slowest_pole).fold(0.0, f64::max);
    let samples = if radius > 0.0 { (1e-6_f64.ln() / radius.ln()).abs() } else { 0.0 };
    3 * filter.sections.len() + samples.min(1e9) as usize
}

/// Radius of the pole that is farther from the origin.
fn slowest_pole(section: &Biquad) -> f64 {
    let [a1, a2] = section.a;
    let discriminant = a1 * a1 / 4.0 - a2;
    if discriminant < 0.0 { a2.sqrt() } else { a1.abs() / 2.0 + discriminant.sqrt() }
}

#[cfg(test)]
mod tests;
