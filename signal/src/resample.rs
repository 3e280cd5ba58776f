//! Changing a signal's rate: exactly, between clocks that are rationals of one another, or steered, between clocks that
//! drift.
//!
//! Both are interpolation by a windowed sinc. Output k lies at the time k / output rate, and shows the input as it was
//! one [latency](Resampler::latency_s) before. It is a fixed sum over fixed inputs, so the samples do not depend on how
//! the signals are cut into blocks.

mod kernel;
mod polyphase;
mod steered;

pub use polyphase::{Resampler, resample_whole};
pub use steered::{MAX_CORRECTION_PPM, SteeredResampler};

use crate::time::Rate;
use thiserror::Error;

/// What a resampler keeps and what it removes. Frequencies are fractions of the lower of the two Nyquist frequencies.
///
/// A stop band that begins above 1 lets what lies between `2 - stopband` and 1 fold onto itself, for half the latency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Upper end of the pass band.
    pub passband: f64,
    /// Lower end of the stop band.
    pub stopband: f64,
    /// How far the stop band lies below the pass band, which is flat to the same measure.
    pub attenuation_db: f64,
}

impl Quality {
    /// Flat to half of Nyquist, 100 dB from 1.5: delays by 7 samples of the lower rate.
    pub const LOW_LATENCY: Self = Self {
        passband: 0.5,
        stopband: 1.5,
        attenuation_db: 100.0,
    };
    /// Flat to 0.8 of Nyquist, 100 dB from 1.2: delays by 17 samples of the lower rate.
    pub const STANDARD: Self = Self {
        passband: 0.8,
        stopband: 1.2,
        attenuation_db: 100.0,
    };
    /// Flat to 0.9 of Nyquist, 120 dB from 1.0: delays by 79 samples of the lower rate. For recordings.
    pub const FINE: Self = Self {
        passband: 0.9,
        stopband: 1.0,
        attenuation_db: 120.0,
    };
}

/// How far a call came. Fewer inputs consumed than given: the outputs had no more room. Fewer outputs produced than there
/// was room for: the inputs ran out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Inputs taken; the rest must be given again.
    pub consumed: usize,
    /// Outputs written.
    pub produced: usize,
}

/// Why a resampler cannot be made.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ResampleError {
    /// A pass band that does not end before the stop band, or numbers that make no filter.
    #[error(
        "a resampler needs 0 < passband < stopband <= 2 and an attenuation of 20 to 180 dB, not {passband}, {stopband} and \
         {attenuation_db} dB"
    )]
    Quality {
        /// The pass band's end.
        passband: f64,
        /// The stop band's start.
        stopband: f64,
        /// The attenuation.
        attenuation_db: f64,
    },
    /// Rates whose ratio needs too large a table.
    #[error(
        "the ratio of {output} to {input} needs a table of {taps} coefficients, more than {most}; use rates of a simpler ratio"
    )]
    RatioTooFine {
        /// Rate of the input.
        input: Rate,
        /// Rate of the output.
        output: Rate,
        /// Coefficients needed.
        taps: u64,
        /// Coefficients allowed.
        most: u64,
    },
}

#[cfg(test)]
mod tests;
