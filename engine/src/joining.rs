//! Resamplers between clocks: whether two rates can be joined, and by what delay. The graph asks before a run, the run
//! builds what was asked for.

use haptograph_signal::resample::{Quality, ResampleError, Resampler, SteeredResampler};
use haptograph_signal::time::Rate;

/// The resampling of one component between clocks of one driver; also tells beforehand whether two rates can be joined.
pub(crate) fn resampler(from: Rate, to: Rate) -> Result<Resampler, ResampleError> {
    Resampler::new(from, to, Quality::LOW_LATENCY)
}

/// The same between drivers, whose ratio is corrected while it runs.
pub(crate) fn steered(from: Rate, to: Rate) -> Result<SteeredResampler, ResampleError> {
    SteeredResampler::new(from, to, Quality::LOW_LATENCY)
}

/// The least latency that a ring can have, in seconds: what the resampler needs, and two periods of the slower clock.
///
/// # Errors
/// [`ResampleError`] where the rates cannot be joined.
pub fn least_ring_latency_s(from: Rate, to: Rate) -> Result<f64, ResampleError> {
    Ok(steered(from, to)?.latency_s() + 2.0 * from.period_s().max(to.period_s()))
}
