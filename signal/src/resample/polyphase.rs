//! Exact resampling by a rational.

use super::kernel::{History, Kernel, dot};
use super::{Progress, Quality, ResampleError};
use crate::time::{Rate, gcd};

/// Resamples between two rates whose ratio is an exact rational.
///
/// Output k belongs to the time k / output rate and depends on the inputs up to that time. In a graph whose clocks
/// count in common units, the inputs before a moment are therefore always enough for the outputs before it, and
/// giving a call both gives [`Progress`] in full: `consumed == x.len()` and `produced == y.len()`.
#[derive(Debug, Clone)]
pub struct Resampler {
    /// `width` taps for each position between two inputs.
    phases: Box<[f64]>,
    width: usize,
    input: Rate,
    /// Positions between two inputs.
    up: u64,
    /// Positions from one output to the next.
    down: u64,
    history: History,
    /// Position of the next output, counted from the input after the newest; negative up to `-up` when that is enough
    /// for it.
    ahead: i64,
}

impl Resampler {
    /// Makes a resampler of a signal that is zero before its first sample. Allocates here only.
    ///
    /// # Errors
    /// [`ResampleError`] for an invalid quality, or a ratio that needs too large a table.
    pub fn new(input: Rate, output: Rate, quality: Quality) -> Result<Self, ResampleError> {
        let kernel = Kernel::new(input, output, quality)?;
        let (up, down) = ratio(input, output);
        kernel.check_table(up, input, output)?;
        let phases = (0..up).flat_map(|phase| kernel.taps(phase as f64 / up as f64)).collect();
        Ok(Self {
            phases,
            width: kernel.width(),
            input,
            up,
            down,
            history: History::new(kernel.width()),
            ahead: 0,
        })
    }

    /// Delay from input to output, s: half the filter's length, a whole number of input samples.
    pub fn latency_s(&self) -> f64 {
        self.latency_frames() as f64 * self.input.period_s()
    }

    /// Delay from input to output, in input samples.
    pub fn latency_frames(&self) -> usize {
        self.width / 2
    }

    /// Number of outputs before input number `inputs`, both counted from the beginning.
    pub(crate) fn outputs_before(&self, inputs: u64) -> u64 {
        let outputs = (u128::from(inputs) * u128::from(self.up)).div_ceil(u128::from(self.down));
        u64::try_from(outputs).unwrap_or(u64::MAX)
    }

    /// Takes inputs and writes outputs until an output needs an input not yet given, or the next input belongs to an
    /// output for which there is no room.
    pub fn process(&mut self, x: &[f64], y: &mut [f64]) -> Progress {
        let mut consumed = 0;
        let mut produced = 0;
        loop {
            let needed = self.inputs_needed();
            if needed > 0 {
                let taken = needed.min(x.len() - consumed);
                self.history.push(&x[consumed..consumed + taken]);
                consumed += taken;
                self.ahead -= taken as i64 * self.up as i64;
                if taken < needed {
                    break;
                }
            }
            let Some(out) = y.get_mut(produced) else { break };
            let phase = (self.ahead + self.up as i64) as usize;
            let taps = &self.phases[phase * self.width..(phase + 1) * self.width];
            *out = dot(taps, self.history.window());
            produced += 1;
            self.ahead += self.down as i64;
        }
        Progress { consumed, produced }
    }

    /// Copies the state of another resampler between the same rates and of the same quality. Does not allocate.
    pub fn copy_state_from(&mut self, other: &Self) {
        if (self.width, self.up, self.down) == (other.width, other.up, other.down) {
            self.history.copy_from(&other.history);
            self.ahead = other.ahead;
        }
    }

    /// Forgets the past and begins again at output 0.
    pub fn reset(&mut self) {
        self.history.clear();
        self.ahead = 0;
    }

    /// Inputs still missing for the next output.
    fn inputs_needed(&self) -> usize {
        if self.ahead < 0 { 0 } else { (self.ahead / self.up as i64) as usize + 1 }
    }
}

/// Resamples a whole signal without delay: sample k shows the input at the time k / output rate. The signal counts as
/// zero before its first and after its last sample.
///
/// # Errors
/// As [`Resampler::new`].
pub fn resample_whole(
    x: &[f64],
    input: Rate,
    output: Rate,
    quality: Quality,
) -> Result<Vec<f64>, ResampleError> {
    let mut resampler = Resampler::new(input, output, quality)?;
    let latency = resampler.latency_frames();
    // Zeros ahead, so that the delay is a whole number of outputs.
    let down = usize::try_from(resampler.down).unwrap_or(usize::MAX);
    let ahead = (down - latency % down) % down;
    let late = ((latency + ahead) as u64 / resampler.down * resampler.up) as usize;
    let samples = resampler.outputs_before(x.len() as u64) as usize;
    let mut y = vec![0.0; late + samples];
    let mut produced = resampler.process(&vec![0.0; ahead], &mut y).produced;
    produced += resampler.process(x, &mut y[produced..]).produced;
    resampler.process(&vec![0.0; latency + down], &mut y[produced..]);
    Ok(y.split_off(late))
}

/// `output / input` in lowest terms.
fn ratio(input: Rate, output: Rate) -> (u64, u64) {
    let ((ni, di), (no, d_o)) = (input.parts(), output.parts());
    let (a, b) = (gcd(no, ni), gcd(di, d_o));
    // Rates lie between 1 mHz and 100 MHz, but their parts may be long; a product too long is too fine a ratio anyway.
    ((no / a).saturating_mul(di / b), (ni / a).saturating_mul(d_o / b))
}
