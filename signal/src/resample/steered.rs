//! Resampling with a ratio that can be corrected at run time.

use super::kernel::{History, Kernel, mixed_dot};
use super::{Progress, Quality, ResampleError};
use crate::time::Rate;

/// Largest correction of the ratio, ppm in either direction.
pub const MAX_CORRECTION_PPM: f64 = 500.0;

/// Positions between two inputs for which taps are stored; between them they are interpolated by cubics (error -125
/// dB).
const PHASES: usize = 32;

/// Resamples between two clocks that drift: as [`Resampler`](super::Resampler), with a ratio that follows
/// [`set_correction_ppm`](Self::set_correction_ppm).
#[derive(Debug, Clone)]
pub struct SteeredResampler {
    /// Taps at positions -1/[`PHASES`] to 1 + 1/[`PHASES`], `width` each.
    phases: Box<[f64]>,
    width: usize,
    input: Rate,
    /// Inputs per output, without correction.
    nominal_step: f64,
    /// Inputs from one output to the next, in units of 2^-64.
    step: u128,
    /// Position of the next output after the newest input, in the same units.
    ahead: u128,
    history: History,
}

/// One input in units of 2^-64.
const ONE: u128 = 1 << 64;

impl SteeredResampler {
    /// Makes a resampler with a zero past. Allocates here only.
    ///
    /// # Errors
    /// [`ResampleError`] for an invalid quality, or rates too far apart for a table.
    pub fn new(input: Rate, output: Rate, quality: Quality) -> Result<Self, ResampleError> {
        let kernel = Kernel::new(input, output, quality)?;
        kernel.check_table(PHASES as u64 + 3, input, output)?;
        let position = |i: usize| (i as f64 - 1.0) / PHASES as f64;
        let phases = (0..PHASES + 3).flat_map(|i| kernel.taps(position(i))).collect();
        let mut resampler = Self {
            phases,
            width: kernel.width(),
            input,
            nominal_step: input.hz() / output.hz(),
            step: 0,
            ahead: ONE,
            history: History::new(kernel.width()),
        };
        resampler.set_correction_ppm(0.0);
        Ok(resampler)
    }

    /// Delay from input to output, s: half the filter's length, a whole number of input samples.
    pub fn latency_s(&self) -> f64 {
        self.width as f64 / 2.0 * self.input.period_s()
    }

    /// Sets the correction from the next output on: the additional input per output, ppm. Clamped to
    /// ±[`MAX_CORRECTION_PPM`]; NaN counts as 0.
    pub fn set_correction_ppm(&mut self, ppm: f64) {
        let ppm = if ppm.is_nan() { 0.0 } else { ppm.clamp(-MAX_CORRECTION_PPM, MAX_CORRECTION_PPM) };
        let step = self.nominal_step * (1.0 + ppm * 1e-6);
        // Integer and fractional part separately, so that only the rounding of `step` remains.
        self.step = ((step.trunc() as u128) << 64) + (step.fract() * ONE as f64) as u128;
    }

    /// Position of the next output after the newest consumed input, in inputs. The output shows the input half the
    /// filter's length earlier.
    pub fn ahead(&self) -> f64 {
        self.ahead as f64 / ONE as f64
    }

    /// Inputs needed before `outputs` more outputs can be written, at the present correction.
    pub fn inputs_needed(&self, outputs: usize) -> usize {
        if outputs == 0 {
            return 0;
        }
        let last = self.ahead + self.step * (outputs as u128 - 1);
        (last >> 64) as usize
    }

    /// Consumes inputs and writes outputs until one of the two is exhausted. Consumes no input before an output needs
    /// it.
    pub fn process(&mut self, x: &[f64], y: &mut [f64]) -> Progress {
        let mut consumed = 0;
        let mut produced = 0;
        while let Some(out) = y.get_mut(produced) {
            let needed = (self.ahead >> 64) as usize;
            let taken = needed.min(x.len() - consumed);
            self.history.push(&x[consumed..consumed + taken]);
            consumed += taken;
            self.ahead -= (taken as u128) << 64;
            if taken < needed {
                break;
            }
            *out = self.output(self.ahead as u64);
            produced += 1;
            self.ahead += self.step;
        }
        Progress { consumed, produced }
    }

    /// Clears the past; keeps the correction.
    pub fn reset(&mut self) {
        self.history.clear();
        self.ahead = ONE;
    }

    /// The output that lies `fraction` (in units of 2^-64) of an input after the newest.
    fn output(&self, fraction: u64) -> f64 {
        let position = fraction as f64 / ONE as f64 * PHASES as f64;
        let phase = (position as usize).min(PHASES - 1);
        let t = position - phase as f64;
        // Lagrange's cubic through the phases at -1, 0, 1 and 2.
        let weights = [
            -t * (t - 1.0) * (t - 2.0) / 6.0,
            (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
            -(t + 1.0) * t * (t - 2.0) / 2.0,
            (t + 1.0) * t * (t - 1.0) / 6.0,
        ];
        let rows = &self.phases[phase * self.width..][..4 * self.width];
        mixed_dot(weights, rows, self.history.window())
    }
}
