//! Finds lines fixed in space by order tracking: spatial periods in the whitened recording.
//!
//! ```text
//! whitened ─► windows of distance ─► spectrum over cycles/m ─► peaks that slow and fast windows share
//!                                                                    │  higher than in every surrogate?
//!                                                        tracking ◄──┘  power by speed and force, coherence over distance
//! ```
//!
//! A surrogate is the same recording with its speed shifted in time: a line fixed in frequency does not change, a line fixed
//! in space is smeared.

mod orders;
mod removal;
mod tracking;

pub(super) use removal::without_lines;
pub(super) use tracking::FoundLine;

use super::whitening::Whitened;
use crate::recording::ProcessedRecording;
use haptograph_surfaces::layers::lines::MAX_LINES;
use haptograph_surfaces::{SpatialLine, TextureError, TextureModel};
use std::ops::Range;

/// Distance of a window, m: its inverse is the resolution in cycles per metre.
const WINDOW_M: f64 = 0.06;

/// A stretch of a recording during which the tool was dragged.
struct Stretch {
    recording: usize,
    samples: Range<usize>,
}

/// Finds the lines in the recordings of `texture`, strongest first; none if their speeds vary by less than 1.5 to 1.
pub(super) fn find_lines(
    recordings: &[ProcessedRecording],
    whitened: &[Whitened<'_>],
    texture: &TextureModel,
) -> Vec<FoundLine> {
    let stretches = stretches(recordings, whitened);
    let orders = orders::found(recordings, whitened, &stretches, texture.rate_hz());
    let mut lines: Vec<FoundLine> = vec![];
    for cycles_per_m in orders.into_iter().take(MAX_LINES) {
        let line = tracking::track(cycles_per_m, recordings, whitened, &stretches, texture);
        // Two peaks may turn out to be one line.
        let is_another = |line: &FoundLine| {
            let apart = |other: &FoundLine| (line.cycles_per_m - other.cycles_per_m).abs() * WINDOW_M >= 1.0;
            lines.iter().all(apart)
        };
        if let Some(line) = line.filter(is_another) {
            lines.push(line);
        }
    }
    lines
}

/// `texture` with these lines, whose powers are evaluated at its models.
pub(super) fn with_lines(texture: TextureModel, found: &[FoundLine]) -> Result<TextureModel, TextureError> {
    let lines = found.iter().map(|line| {
        let powers = texture.models().iter().map(|at| line.power_at(at.speed_m_s, at.force_n));
        SpatialLine::new(line.cycles_per_m, line.diffusion_rad2_per_m, powers.collect())
    });
    let lines = lines.collect::<Result<Vec<_>, _>>()?;
    texture.with_lines(lines)
}

/// Stretches of at least half a window's distance.
fn stretches(recordings: &[ProcessedRecording], whitened: &[Whitened<'_>]) -> Vec<Stretch> {
    let mut all = vec![];
    for (recording, (signals, whitened)) in recordings.iter().map(|r| r.signals()).zip(whitened).enumerate() {
        for samples in whitened.runs() {
            let way_m = signals.speed_m_s[samples.clone()].iter().sum::<f64>() / signals.rate_hz;
            if way_m >= 0.5 * WINDOW_M {
                all.push(Stretch { recording, samples });
            }
        }
    }
    all
}

/// Divides a distance, given its `samples` steps in m, into equal windows; returns the samples of each.
fn windows(steps_m: impl Iterator<Item = f64> + Clone, samples: usize) -> Vec<Range<usize>> {
    let total: f64 = steps_m.clone().take(samples).sum();
    // A window has at least one step.
    let count = ((total / WINDOW_M).round() as usize).min(samples);
    let (mut windows, mut start, mut way) = (Vec::with_capacity(count), 0, 0.0);
    for (n, step) in steps_m.take(samples).enumerate() {
        way += step;
        let is_last = n + 1 == samples;
        if windows.len() < count && (way >= total * (windows.len() + 1) as f64 / count as f64 || is_last) {
            windows.push(start..n + 1);
            start = n + 1;
        }
    }
    windows
}

#[cfg(test)]
mod tests;
