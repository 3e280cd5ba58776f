//! Keeps pieces of the whitened recording that can stand for its noise.

use super::cells::CELLS;
use super::grain::Middle;
use super::whitening::Whitened;
use crate::recording::{ProcessedRecording, clipped};
use haptograph_signal::warped::unwarp;
use haptograph_signal::{Complex64, fft};
use haptograph_surfaces::TextureModel;
use haptograph_surfaces::layers::clips::{Clips, MAX_SAMPLES};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Least and most that is kept, s.
const LEAST_S: f64 = 4.0;
const MOST_S: f64 = 20.0;
/// Shortest and longest piece, s.
const SHORTEST_S: f64 = 0.3;
const LONGEST_S: f64 = 2.0;
/// Begin and end of a stroke that are left out, s.
const EDGE_S: f64 = 0.1;
/// Windows whose power must exceed that at rest by a factor (6 dB), s.
const FAINT_S: f64 = 0.2;
const OVER_REST: f64 = 4.0;
/// Largest amplification of what the high-pass took away: 12 dB.
const MOST_GAIN: f64 = 4.0;

/// Clips of whitened recordings; `None` if too little of them is neither an edge of a stroke, clipped, nor hidden in the noise of
/// the sensor.
pub(super) fn find_clips(
    recordings: &[ProcessedRecording],
    whitened: &[Whitened<'_>],
    texture: &TextureModel,
    middle: &Middle,
) -> Option<Clips> {
    let rate_hz = texture.rate_hz();
    let samples = |seconds: f64| ((seconds * rate_hz) as usize).max(1);
    let most = samples(MOST_S).min(MAX_SAMPLES);
    let longest = samples(LONGEST_S).min(most / 4);
    let mut pieces: Vec<(&Whitened<'_>, Range<usize>)> = vec![];
    for (recording, whitened) in recordings.iter().zip(whitened) {
        for run in usable(recording, &whitened.runs()) {
            let starts = run.clone().step_by(longest);
            let piece = starts.map(|start| start..run.end.min(start + longest));
            let long = piece.filter(|piece| piece.len() >= samples(SHORTEST_S));
            pieces.extend(long.map(|piece| (whitened, piece)));
        }
    }
    let all: usize = pieces.iter().map(|(_, piece)| piece.len()).sum();
    if all < samples(LEAST_S) {
        return None;
    }
    let (mut kept, mut seen) = (vec![], 0);
    for (whitened, piece) in pieces {
        // As much of the beginning as of the end.
        let is_due = kept.len() as f64 <= (seen as f64 / all as f64) * most as f64;
        seen += piece.len();
        if is_due && kept.len() + piece.len() <= most {
            let piece = whitened.samples(piece);
            let level = level(&piece, middle);
            kept.extend(piece.iter().map(|e| e / level));
        }
    }
    if kept.len() < samples(LEAST_S) {
        return None;
    }
    Clips::new(&flattened(&kept, texture.warping())).ok()
}

/// What is left of strokes without their edges, clipped samples, and windows as faint as the sensor's noise.
fn usable(recording: &ProcessedRecording, strokes: &[Range<usize>]) -> Vec<Range<usize>> {
    let samples = |seconds: f64| ((seconds * recording.rate_hz()) as usize).max(1);
    let acceleration = recording.vibration_m_s2();
    let is_at_rest = |window: &Range<usize>| {
        let next = strokes.partition_point(|stroke| stroke.end <= window.start);
        strokes.get(next).is_none_or(|stroke| stroke.start >= window.end)
    };
    let powered = |start: usize| {
        let window = start..acceleration.len().min(start + samples(FAINT_S));
        let power = acceleration[window.clone()].iter().map(|a| a * a).sum::<f64>() / window.len() as f64;
        (window, power)
    };
    let windows = || (0..acceleration.len()).step_by(samples(FAINT_S)).map(powered);
    let at_rest = windows().filter(|(window, _)| is_at_rest(window));
    let mut rest: Vec<f64> = at_rest.map(|(_, power)| power).collect();
    rest.sort_by(f64::total_cmp);
    let faintest = rest.get(rest.len() / 2).map_or(0.0, |rest| OVER_REST * rest);
    let faint = windows().filter(|(_, power)| *power < faintest).map(|(window, _)| window);
    let mut cuts: Vec<Range<usize>> =
        clipped(acceleration).into_iter().map(|sample| sample..sample + 1).chain(faint).collect();
    cuts.sort_unstable_by_key(|cut| cut.start);
    let edge = samples(EDGE_S);
    strokes
        .iter()
        .flat_map(|stroke| without(stroke.start + edge..stroke.end.saturating_sub(edge), &cuts))
        .collect()
}

/// What sorted cuts leave of a run.
fn without(run: Range<usize>, cuts: &[Range<usize>]) -> Vec<Range<usize>> {
    let (mut left, mut from) = (vec![], run.start);
    for cut in cuts.iter().skip_while(|cut| cut.end <= run.start).take_while(|cut| cut.start < run.end) {
        left.push(from..cut.start);
        from = from.max(cut.end);
    }
    left.push(from..run.end);
    left.retain(|part| !part.is_empty());
    left
}

/// The level that is left of the map's errors in a whitened piece, as the law's filter passes it: what carries little of the
/// vibration counts little.
fn level(piece: &[f64], middle: &Middle) -> f64 {
    let length = piece.len();
    let spectrum = spectrum_of(piece);
    let powers = spectrum.iter().enumerate().take(length / 2).map(|(bin, x)| {
        let [law, whole] = middle.response(bin as f64 * middle.rate_hz / length as f64);
        (law.norm_sqr() * x.norm_sqr() / length as f64, whole.norm_sqr())
    });
    let [piece, noise] = powers.fold([0.0, 0.0], |[piece, noise], (a, b)| [piece + a, noise + b]);
    (piece / noise).sqrt().max(f64::MIN_POSITIVE)
}

/// Divides by the mean spectrum, so that the law alone sets it; what the high-pass took away is amplified by 12 dB at most.
fn flattened(samples: &[f64], warping: f64) -> Vec<f64> {
    let length = samples.len();
    let mut spectrum = spectrum_of(samples);
    let cells = (0..=length / 2).map(|bin| {
        let turn = unwarp(TAU * bin as f64 / length as f64, -warping);
        ((turn / PI * CELLS as f64) as usize).min(CELLS - 1)
    });
    let cells: Vec<usize> = cells.collect();
    let cell = |bin: usize| cells[bin.min(length - bin)];
    let (mut powers, mut counts) = ([0.0; CELLS], [0.0; CELLS]);
    for (bin, x) in spectrum.iter().enumerate() {
        powers[cell(bin)] += x.norm_sqr();
        counts[cell(bin)] += 1.0;
    }
    let mean = powers.iter().sum::<f64>() / length as f64;
    for (bin, x) in spectrum.iter_mut().enumerate() {
        let power = powers[cell(bin)] / counts[cell(bin)] / mean;
        *x *= MOST_GAIN.min(1.0 / power.sqrt().max(f64::MIN_POSITIVE)) / length as f64;
    }
    fft::inverse(length).process(&mut spectrum);
    spectrum.iter().map(|e| e.re).collect()
}

fn spectrum_of(samples: &[f64]) -> Vec<Complex64> {
    let mut spectrum: Vec<Complex64> = samples.iter().map(|e| Complex64::from(*e)).collect();
    fft::forward(samples.len()).process(&mut spectrum);
    spectrum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::tests::synthetic::provenance;
    use crate::recording::{Gesture, Signals};
    use haptograph_signal::noise::Gaussian;

    const RATE_HZ: usize = 1_000;

    /// A second of rest in faint noise, 2 s of a stroke, of which the last half is as faint, clipped once.
    fn stroke() -> ProcessedRecording {
        let mut acceleration_m_s2 = vec![0.0; 3 * RATE_HZ];
        Gaussian::new(1).fill(&mut acceleration_m_s2);
        acceleration_m_s2[RATE_HZ..2 * RATE_HZ].iter_mut().for_each(|a| *a *= 5.0);
        acceleration_m_s2[1_500..1_520].fill(30.0);
        let signals = Signals {
            rate_hz: RATE_HZ as f64,
            speed_m_s: vec![0.1; acceleration_m_s2.len()],
            force_normal_n: vec![1.0; acceleration_m_s2.len()],
            acceleration_m_s2,
            ..Signals::default()
        };
        ProcessedRecording::new(signals, Gesture::Drag, provenance()).expect("a recording")
    }

    #[test]
    fn edges_of_strokes_clipped_samples_and_what_the_sensor_hides_are_left_out() {
        let dragged = RATE_HZ..3 * RATE_HZ;
        assert_eq!(usable(&stroke(), &[dragged]), [1_100..1_500, 1_520..2_000]);
    }

    #[test]
    fn what_is_flattened_is_white_and_keeps_its_course() {
        let mut samples = vec![0.0; 20_000];
        Gaussian::new(2).fill(&mut samples);
        // Coloured by a pole, and loud in every second tenth of a second.
        let mut last = 0.0;
        for (n, e) in samples.iter_mut().enumerate() {
            *e = *e * (if n / 100 % 2 == 0 { 2.0 } else { 0.5 }) + 0.5 * last;
            last = *e;
        }
        let flat = flattened(&samples, 0.5);
        let correlation =
            flat.windows(2).map(|e| e[0] * e[1]).sum::<f64>() / flat.iter().map(|e| e * e).sum::<f64>();
        assert!(correlation.abs() < 0.02, "{correlation}");
        let power =
            |loud: usize| flat.chunks(100).skip(loud).step_by(2).flatten().map(|e| e * e).sum::<f64>();
        assert!((power(0) / power(1)).log2() > 3.5);
    }
}
