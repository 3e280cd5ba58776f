//! Resamplers between clocks, and their delay. The check uses them to validate rates, the run to convert.

use haptograph_signal::resample::{Quality, ResampleError, Resampler, SteeredResampler};
use haptograph_signal::time::Rate;

/// Makes the resampler of a component between clocks of one driver.
pub(crate) fn resampler(from: Rate, to: Rate) -> Result<Resampler, ResampleError> {
    Resampler::new(from, to, Quality::LOW_LATENCY)
}

/// Makes the resampler of a component between drivers, whose ratio is corrected while it runs.
pub(crate) fn steered(from: Rate, to: Rate) -> Result<SteeredResampler, ResampleError> {
    SteeredResampler::new(from, to, Quality::LOW_LATENCY)
}

/// Smallest latency of a ring, s: the delay of the resampler and two periods of the slower clock.
///
/// # Errors
/// [`ResampleError`] if the rates cannot be resampled.
pub fn least_ring_latency_s(from: Rate, to: Rate) -> Result<f64, ResampleError> {
    Ok(steered(from, to)?.latency_s() + 2.0 * from.period_s().max(to.period_s()))
}
