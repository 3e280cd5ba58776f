//! Removes lines from recordings, so that the remaining noise can be learned.

use super::super::whitening::Whitened;
use super::tracking::FoundLine;
use super::{Stretch, WINDOW_M, stretches};
use crate::recording::ProcessedRecording;
use haptograph_signal::Complex64;
use std::f64::consts::{PI, TAU};

/// The recordings without their lines; the noise around a line keeps its level.
pub(in super::super) fn without_lines(
    recordings: &[ProcessedRecording],
    whitened: &[Whitened<'_>],
    lines: &[FoundLine],
) -> Vec<ProcessedRecording> {
    let stretches = stretches(recordings, whitened);
    let mut noise: Vec<_> = recordings.iter().map(|r| r.vibration_m_s2().to_vec()).collect();
    for line in lines {
        for Stretch { recording, samples } in &stretches {
            let signals = recordings[*recording].signals();
            let ways_m = signals.speed_m_s[samples.clone()].iter().scan(0.0, |way, speed| {
                *way += speed / signals.rate_hz;
                Some(*way)
            });
            remove(&mut noise[*recording][samples.clone()], ways_m, line);
        }
    }
    noise.into_iter().zip(recordings).map(|(noise, recording)| recording.with_noise(noise)).collect()
}

/// Removes a line from a stretch, of whose samples the distances from its beginning are given, m.
fn remove(samples: &mut [f64], ways_m: impl Iterator<Item = f64> + Clone, line: &FoundLine) {
    let total_m = ways_m.clone().last().unwrap_or(0.0);
    // Where cells are without samples there is no line to remove.
    if samples.is_empty() || total_m / line.cell_m() > samples.len() as f64 {
        return;
    }
    let count = (total_m / line.cell_m()).ceil() as usize + 1;
    let amplitudes = amplitudes(samples, ways_m.clone(), line, count);
    let coherence_m = (2.0 / line.diffusion_rad2_per_m.max(1e-9)).min(WINDOW_M).max(2.0 * line.cell_m());
    let decay = (-line.cell_m() / coherence_m).exp();
    let (smooth, kept) = smoothed(&amplitudes, decay, line);
    // Amplitudes two cells apart have independent noise: their product is that of the line.
    let products = amplitudes.iter().zip(amplitudes.get(2..).unwrap_or_default());
    let count = products.len().max(1) as f64;
    let squared = products.map(|(a, b)| (b * a.conj()).re).sum::<f64>() / count;
    let squared = squared * (line.diffusion_rad2_per_m * line.cell_m()).exp();
    let all = smooth.iter().map(Complex64::norm_sqr).sum::<f64>() / smooth.len().max(1) as f64;
    if squared <= 0.0 || all <= 0.0 {
        return;
    }
    let noise = (all - squared * kept).max(0.0);
    let part = 1.0 - (noise / all).sqrt();
    for (y, way) in samples.iter_mut().zip(ways_m) {
        let place = way / line.cell_m();
        let before = (place as usize).min(smooth.len() - 1);
        let after = (before + 1).min(smooth.len() - 1);
        let amplitude = smooth[before] + (smooth[after] - smooth[before]) * (place - before as f64).min(1.0);
        *y -= part * (amplitude * Complex64::cis(TAU * line.cycles_per_m * way)).re;
    }
}

/// The line's complex amplitude around each cell's edge, tapered to a cell on each side.
fn amplitudes(
    samples: &[f64],
    ways_m: impl Iterator<Item = f64>,
    line: &FoundLine,
    count: usize,
) -> Vec<Complex64> {
    let mut sums = vec![(Complex64::new(0.0, 0.0), 0.0); count];
    for (y, way) in samples.iter().zip(ways_m) {
        let place = way / line.cell_m();
        let turned = Complex64::cis(-TAU * line.cycles_per_m * way) * (2.0 * y);
        let before = place as usize;
        for edge in [before, before + 1] {
            if let Some(sum) = sums.get_mut(edge) {
                let weight = (0.5 * PI * (place - edge as f64)).cos().powi(2);
                sum.0 += turned * weight;
                sum.1 += weight;
            }
        }
    }
    let mean = |(sum, weight): (Complex64, f64)| if weight > 0.0 { sum / weight } else { sum };
    sums.into_iter().map(mean).collect()
}

/// The amplitudes' mean over the coherence, and by how much it lowers the square of the line's.
fn smoothed(amplitudes: &[Complex64], decay: f64, line: &FoundLine) -> (Vec<Complex64>, f64) {
    let reach = ((0.05_f64.ln() / decay.ln()).ceil() as usize).clamp(1, 32);
    let weights: Vec<f64> = (0..=reach).map(|away| decay.powi(away as i32)).collect();
    let mean_at = |n: usize| {
        let near = n.saturating_sub(reach)..(n + reach + 1).min(amplitudes.len());
        let (sum, total) = near.fold((Complex64::new(0.0, 0.0), 0.0), |(sum, total), m| {
            let weight = weights[n.abs_diff(m)];
            (sum + amplitudes[m] * weight, total + weight)
        });
        sum / total
    };
    let smooth = (0..amplitudes.len()).map(mean_at).collect();
    let reach = reach as isize;
    let weight = |away: isize| weights[away.unsigned_abs()];
    let coherence =
        |away: isize| (-0.5 * line.diffusion_rad2_per_m * line.cell_m() * away.unsigned_abs() as f64).exp();
    let (mut kept, mut total) = (0.0, 0.0);
    for a in -reach..=reach {
        total += weight(a);
        kept += (-reach..=reach).map(|b| weight(a) * weight(b) * coherence(a - b)).sum::<f64>();
    }
    (smooth, kept / (total * total))
}
