//! The resampler of a ring between drivers, and its delay. The check uses it to validate rates, the run to convert.

use haptograph_signal::resample::{Quality, ResampleError, SteeredResampler};
use haptograph_signal::time::Rate;

/// Makes the resampler of a component between drivers, whose ratio is corrected while it runs.
pub(crate) fn steered(from: Rate, to: Rate) -> Result<SteeredResampler, ResampleError> {
    SteeredResampler::new(from, to, Quality::LOW_LATENCY)
}

/// Smallest latency of a ring, s: the delay of the resampler and two periods of the slower clock.
///
/// # Errors
/// [`ResampleError`] if the rates cannot be resampled.
pub fn least_ring_latency_s(from: Rate, to: Rate) -> Result<f64, ResampleError> {
    Ok(steered(from, to)?.latency_s() + 2.0 * super::slow_s(from, to))
}
