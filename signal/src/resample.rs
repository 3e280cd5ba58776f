//! Resampling: by an exact ratio between clocks with rational rates, or by a steered ratio between clocks that drift.
//!
//! Both interpolate with a windowed sinc. Output k is at the time k / output rate and shows the input one
//! [latency](Resampler::latency_s) before. It is a fixed sum over fixed inputs, so the samples do not depend on the
//! block size.

mod kernel;
mod polyphase;
mod steered;

pub use polyphase::{Resampler, resample_whole};
pub use steered::{MAX_CORRECTION_PPM, SteeredResampler};

use crate::time::Rate;
use thiserror::Error;

/// Quality of a resampler. Frequencies are fractions of the lower of the two Nyquist frequencies.
///
/// A stop band above 1 halves the latency, but the band from `2 - stopband` to 1 aliases onto itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Upper end of the pass band.
    pub passband: f64,
    /// Lower end of the stop band.
    pub stopband: f64,
    /// Attenuation of the stop band; the ripple of the pass band is as small.
    pub attenuation_db: f64,
}

impl Quality {
    /// Flat to half of Nyquist, 100 dB from 1.5: delays by 7 samples of the lower rate.
    pub const LOW_LATENCY: Self = Self { passband: 0.5, stopband: 1.5, attenuation_db: 100.0 };
    /// Flat to 0.8 of Nyquist, 100 dB from 1.2: delays by 17 samples of the lower rate.
    pub const STANDARD: Self = Self { passband: 0.8, stopband: 1.2, attenuation_db: 100.0 };
    /// Flat to 0.9 of Nyquist, 120 dB from 1.0: delays by 79 samples of the lower rate. For recordings.
    pub const FINE: Self = Self { passband: 0.9, stopband: 1.0, attenuation_db: 120.0 };
}

/// Progress of a call. It ends when the inputs run out or the outputs are full.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Number of inputs consumed; the caller passes the others again.
    pub consumed: usize,
    /// Number of outputs written.
    pub produced: usize,
}

/// Error of making a resampler.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ResampleError {
    /// Invalid bands or attenuation.
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
    /// A ratio of rates that needs too large a table.
    #[error(
        "the ratio of {output} to {input} needs a table of {taps} coefficients, more than {most}; use rates with a simpler ratio"
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
