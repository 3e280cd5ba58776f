//! Filters as cascades of second-order sections: what they are, how they answer, and how they run.

mod design;
mod lanes;

pub use design::{
    Cascade, DesignError, MAX_ORDER, Prototype, bessel_lowpass, butterworth_bandpass, butterworth_highpass,
    butterworth_lowpass, double_pole,
};
pub use lanes::SectionLanes;

use crate::Complex64;

/// Samples between looks at whether a recursive state has died away.
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
    /// Passes the signal as it is.
    pub const IDENTITY: Self = Self {
        b: [1.0, 0.0, 0.0],
        a: [0.0, 0.0],
    };

    /// Whether both poles lie inside the unit circle.
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

    /// Group delay in samples: that of the numerator less that of the denominator, each `Re(sum k c_k z^-k / sum c_k z^-k)`.
    fn group_delay(&self, inverse_z: Complex64) -> f64 {
        let numerator = self.numerator(inverse_z);
        let zeros = if numerator.norm() <= 1e-9 * self.b.iter().map(|b| b.abs()).sum::<f64>() {
            // On a zero of the unit circle there is nothing to delay; its neighbours are delayed by half a sample a zero.
            if self.b[2] == 0.0 { 0.5 } else { 1.0 }
        } else {
            ((inverse_z * (2.0 * self.b[2]) + self.b[1]) * inverse_z / numerator).re
        };
        let poles =
            ((inverse_z * (2.0 * self.a[1]) + self.a[0]) * inverse_z / self.denominator(inverse_z)).re;
        zeros - poles
    }

    /// The rows by which the state of the direct form follows from what two trapezoidal integrators hold that make the same
    /// section (Zavalishin). What the integrators hold means the same at any frequency; the state of the direct form does not.
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
        // Both integrators, left alone for a sample: what each gives, of what each holds.
        let given = [
            [loop_gain, -g * loop_gain],
            [g * loop_gain, 1.0 - g * g * loop_gain],
        ];
        let mixed = |[first, second]: [f64; 2]| -> [f64; 2] {
            std::array::from_fn(|i| first * given[0][i] + second * given[1][i])
        };
        let next = mixed([band - high * damping, low - high]);
        // They then hold twice that less what they held.
        let after = mixed(next);
        [
            next,
            std::array::from_fn(|i| 2.0 * after[i] + (a1 - 1.0) * next[i]),
        ]
    }
}

/// A filter: second-order sections one after the other.
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

    /// Group delay at a frequency, in seconds.
    pub fn group_delay_s(&self, frequency_hz: f64, rate_hz: f64) -> f64 {
        let inverse_z = on_circle(frequency_hz, rate_hz);
        let samples: f64 = self.sections.iter().map(|s| s.group_delay(inverse_z)).sum();
        samples / rate_hz
    }

    /// Whether every pole lies inside the unit circle.
    pub fn is_stable(&self) -> bool {
        self.sections.iter().all(Biquad::is_stable)
    }
}

fn on_circle(frequency_hz: f64, rate_hz: f64) -> Complex64 {
    Complex64::from_polar(1.0, -std::f64::consts::TAU * frequency_hz / rate_hz)
}

/// [`Sections`] at work, in transposed direct form II. The output does not depend on how the input is cut into blocks.
///
/// What is left of the state below 1e-30 is cleared every 64 samples, so that silence in becomes exactly silence out.
/// A state that is no longer finite is cleared at the same points: a bad sample never sticks.
#[derive(Debug, Clone)]
pub struct SectionsState {
    sections: Box<[Running]>,
    /// Samples since the state was last looked at.
    since_settled: usize,
}

#[derive(Debug, Clone, Copy)]
struct Running {
    biquad: Biquad,
    state: [f64; 2],
}

impl SectionsState {
    /// The filter at rest. Allocates here and never again.
    pub fn new(filter: &Sections) -> Self {
        let at_rest = |biquad: &Biquad| Running {
            biquad: *biquad,
            state: [0.0; 2],
        };
        Self {
            sections: filter.sections.iter().map(at_rest).collect(),
            since_settled: 0,
        }
    }

    /// Filters `x` into `y`, up to the shorter of the two.
    pub fn process(&mut self, x: &[f64], y: &mut [f64]) {
        let length = x.len().min(y.len());
        let (mut x, mut y) = (&x[..length], &mut y[..length]);
        let Some((first, later)) = self.sections.split_first_mut() else {
            y.copy_from_slice(x);
            return;
        };
        // Without a copy first: its wide loads would stall on samples that were stored one by one just before.
        while !x.is_empty() {
            let (now, later_x) = x.split_at(x.len().min(SETTLE - self.since_settled));
            let (block, later_y) = y.split_at_mut(now.len());
            first.process(now.iter().copied().zip(&mut *block));
            for section in &mut *later {
                section.process_in_place(block);
            }
            self.since_settled += now.len();
            if self.since_settled == SETTLE {
                self.since_settled = 0;
                first.settle();
                later.iter_mut().for_each(Running::settle);
            }
            (x, y) = (later_x, later_y);
        }
    }

    /// Filters `y` in place.
    pub fn process_in_place(&mut self, y: &mut [f64]) {
        let mut rest = y;
        while !rest.is_empty() {
            let (block, later) = rest.split_at_mut(rest.len().min(SETTLE - self.since_settled));
            for section in &mut self.sections {
                section.process_in_place(block);
            }
            self.since_settled += block.len();
            if self.since_settled == SETTLE {
                self.since_settled = 0;
                self.sections.iter_mut().for_each(Running::settle);
            }
            rest = later;
        }
    }

    /// Puts the filter into the state it reaches after a constant input of this value, so that it starts without a jump.
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

    /// Goes on from the state of another filter of as many sections.
    pub fn copy_state_from(&mut self, other: &Self) {
        if self.sections.len() == other.sections.len() {
            self.since_settled = other.since_settled;
            for (section, other) in self.sections.iter_mut().zip(&other.sections) {
                section.state = other.state;
            }
        }
    }

    /// Goes on with other coefficients, of as many sections. What the state stands for is kept: a constant that has passed
    /// stays a constant, and nothing leaps.
    pub fn turn(&mut self, sections: &[Biquad]) {
        for (running, biquad) in self.sections.iter_mut().zip(sections) {
            let ([[m11, m12], [m21, m22]], [s1, s2]) = (running.biquad.integrators_to_state(), running.state);
            let determinant = m11 * m22 - m12 * m21;
            let held = [
                (m22 * s1 - m12 * s2) / determinant,
                (m11 * s2 - m21 * s1) / determinant,
            ];
            let state = biquad
                .integrators_to_state()
                .map(|row| row[0] * held[0] + row[1] * held[1]);
            running.biquad = *biquad;
            // Beyond what numbers can hold there is nothing to keep.
            running.state = if state.iter().all(|s| s.is_finite()) {
                state
            } else {
                [0.0; 2]
            };
        }
    }

    /// Goes on as another filter of as many sections does: its coefficients and its state.
    pub fn take_over(&mut self, other: &Self) {
        if self.sections.len() == other.sections.len() {
            self.since_settled = other.since_settled;
            self.sections.copy_from_slice(&other.sections);
        }
    }

    /// Puts the filter to rest.
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

    fn settle(&mut self) {
        let [s1, s2] = self.state;
        let silent = s1.abs() < SILENCE && s2.abs() < SILENCE;
        if silent || !(s1.is_finite() && s2.is_finite()) {
            self.state = [0.0; 2];
        }
    }
}

/// Filters forward and backward: no phase shift, the magnitude response squared. For recordings, not for live signals.
///
/// The signal is continued at both ends by its point reflection (odd extension), as far as the filter remembers and the
/// signal reaches, and the filter starts settled at the first value, so that constants and slopes come out undisturbed.
pub fn filtfilt(filter: &Sections, x: &[f64]) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (x.first(), x.last()) else {
        return Vec::new();
    };
    let pad = memory(filter).min(x.len() - 1);
    let mut extended = Vec::with_capacity(x.len() + 2 * pad);
    extended.extend(x[1..=pad].iter().rev().map(|v| 2.0 * first - v));
    extended.extend_from_slice(x);
    extended.extend(
        x[x.len() - 1 - pad..x.len() - 1]
            .iter()
            .rev()
            .map(|v| 2.0 * last - v),
    );
    let mut state = SectionsState::new(filter);
    for _ in 0..2 {
        state.reset();
        state.settle_at(extended[0]);
        state.process_in_place(&mut extended);
        extended.reverse();
    }
    extended[pad..pad + x.len()].to_vec()
}

/// Samples until the slowest pole has decayed to a millionth.
fn memory(filter: &Sections) -> usize {
    let radius = filter.sections.iter().map(slowest_pole).fold(0.0, f64::max);
    let samples = if radius > 0.0 {
        (1e-6_f64.ln() / radius.ln()).abs()
    } else {
        0.0
    };
    3 * filter.sections.len() + samples.min(1e9) as usize
}

/// Radius of the pole farther from the origin.
fn slowest_pole(section: &Biquad) -> f64 {
    let [a1, a2] = section.a;
    let discriminant = a1 * a1 / 4.0 - a2;
    if discriminant < 0.0 {
        a2.sqrt()
    } else {
        a1.abs() / 2.0 + discriminant.sqrt()
    }
}

#[cfg(test)]
mod tests;
