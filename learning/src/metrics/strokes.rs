//! Strokes from rest, and the level of their onset over that of their slide.

use haptograph_signal::filter::{butterworth_bandpass, filtfilt};
use haptograph_signal::statistics::mean;
use haptograph_surfaces::layers::onset::{BANDS_HZ, BreakAway};
use std::ops::Range;

/// The onset, from before the speed tells of the release (it is smoothed without delay), and its later half, s.
const ONSET_S: [f64; 3] = [-0.02, 0.03, 0.08];
/// Time after a release from which the tool slides, s.
const SETTLED_S: f64 = 0.2;

/// Bounds of the speed below which a tool is at rest, m/s; the faster one is for trackers that resolve half a millimetre.
const REST_M_S: [f64; 2] = [0.005, 0.025];
/// Where more than nine tenths of a recording are faster, the tool was never held still, m/s: it has slow places, and no rests.
const HELD_M_S: f64 = 0.01;
/// A slide is so much faster, m/s.
const ABOVE_REST_M_S: f64 = 0.015;

/// The speeds below which the tool of a recording is at rest and above which it slides, m/s: a still tool's speed is its tracker's
/// noise, of which a tenth of the samples of a recording with strokes from rest show the lower end. Nothing is below zero, without.
pub(crate) fn thresholds(speed_m_s: &[f64]) -> [f64; 2] {
    let tenth = speed_m_s.len() / 10;
    // Faster ones do not change the result.
    let mut slow: Vec<f64> = speed_m_s.iter().copied().filter(|speed| *speed <= HELD_M_S).collect();
    let rest_m_s = match slow.len() > tenth {
        true => (4.0 * *slow.select_nth_unstable_by(tenth, f64::total_cmp).1).clamp(REST_M_S[0], REST_M_S[1]),
        false if speed_m_s.is_empty() => REST_M_S[0],
        false => 0.0,
    };
    [rest_m_s, rest_m_s + ABOVE_REST_M_S]
}

/// A stroke that begins from rest.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stroke {
    /// The sample at which the tool breaks away.
    pub start: usize,
    /// Time that it stuck before, s.
    pub stuck_s: f64,
    /// Normal force then, N.
    pub force_n: f64,
}

/// Powers of an onset in its bands: of the last 30 ms at rest, of the first 100 ms, and of the later half of that.
pub(crate) type OnsetPowers = [[f64; 3]; 3];
/// Places in these.
pub(crate) const BEFORE: usize = 0;
pub(crate) const WHOLE: usize = 1;
pub(crate) const LATE: usize = 2;

/// The strokes from rest along speeds, m/s, and normal forces, N, sample by sample. The first 100 ms of each are covered.
pub(crate) fn strokes(speed_m_s: &[f64], force_n: &[f64], rate_hz: f64) -> Vec<Stroke> {
    let [rest_m_s, slide_m_s] = thresholds(speed_m_s);
    let mut detector = BreakAway::new(rest_m_s, slide_m_s);
    let mut found = vec![];
    for (start, (speed, force)) in speed_m_s.iter().zip(force_n).enumerate() {
        let Some(stuck_s) = detector.update(*speed, *force, 1.0 / rate_hz) else { continue };
        if span(start, [ONSET_S[0], ONSET_S[2]], rate_hz).is_some_and(|onset| onset.end <= force_n.len()) {
            found.push(Stroke { start, stuck_s, force_n: *force });
        }
    }
    found
}

/// The samples between two times after `start`; `None` if they begin before the first sample.
fn span(start: usize, between_s: [f64; 2], rate_hz: f64) -> Option<Range<usize>> {
    let [from, to] = between_s.map(|seconds| start.checked_add_signed((seconds * rate_hz).round() as isize));
    Some(from?..to?)
}

/// What `of` makes of the part of a vibration in each of [`BANDS_HZ`], one at a time; silent where the rate does not hold the band.
fn in_bands<T>(vibration: &[f64], rate_hz: f64, of: impl Fn(&[f64]) -> T) -> [T; 3] {
    BANDS_HZ.map(|[low_hz, high_hz]| {
        let filter = butterworth_bandpass(2, low_hz, high_hz, rate_hz);
        let silent = |_| vec![0.0; vibration.len()];
        of(&filter.map_or_else(silent, |filter| filtfilt(&filter, vibration.to_vec())))
    })
}

fn power(part: &[f64]) -> f64 {
    part.iter().map(|y| y * y).sum::<f64>() / part.len().max(1) as f64
}

/// The powers of a vibration after releases at these samples, and in each band where it slides, if anywhere.
pub(crate) fn powers(
    vibration: &[f64],
    starts: impl Iterator<Item = usize>,
    slides: &[bool],
    rate_hz: f64,
) -> (Vec<OnsetPowers>, [f64; 3]) {
    let starts: Vec<usize> = starts.collect();
    let [from_s, late_s, to_s] = ONSET_S;
    let parts_s = [[from_s - 0.03, from_s], [from_s, to_s], [late_s, to_s]];
    let bands = in_bands(vibration, rate_hz, |band| {
        let part = |start, part_s| span(start, part_s, rate_hz).and_then(|samples| band.get(samples));
        let onsets = starts.iter().map(|start| parts_s.map(|part_s| part(*start, part_s).map_or(0.0, power)));
        let sliding = band.iter().zip(slides).filter(|(_, slides)| **slides).map(|(y, _)| *y);
        (onsets.collect::<Vec<[f64; 3]>>(), power(&sliding.collect::<Vec<f64>>()))
    });
    let of = |stroke: usize| [0, 1, 2].map(|part| bands.each_ref().map(|(onsets, _)| onsets[stroke][part]));
    ((0..starts.len()).map(of).collect(), bands.each_ref().map(|(_, sliding)| *sliding))
}

/// False for the samples around a release: of its onset, and until the tool slides.
pub(crate) fn settled(speed_m_s: &[f64], force_n: &[f64], rate_hz: f64) -> Vec<bool> {
    let mut settled = vec![true; speed_m_s.len().min(force_n.len())];
    for stroke in strokes(speed_m_s, force_n, rate_hz) {
        let onset = span(stroke.start, [ONSET_S[0], SETTLED_S], rate_hz).unwrap_or_default();
        let samples = settled.len();
        settled[onset.start.min(samples)..onset.end.min(samples)].fill(false);
    }
    settled
}

/// True where the tool slides: settled, at the speed of a slide.
pub(crate) fn slides(speed_m_s: &[f64], force_n: &[f64], rate_hz: f64) -> Vec<bool> {
    let [_, slide_m_s] = thresholds(speed_m_s);
    let settled = settled(speed_m_s, force_n, rate_hz);
    settled.into_iter().zip(speed_m_s).map(|(settled, speed)| settled && *speed > slide_m_s).collect()
}

/// Number of strokes from rest along a motion, and the level of a vibration in the first 100 ms of these over that of its slides (at
/// the speed of one, 0.2 s after any release) in [`BANDS_HZ`], dB; `None` without strokes or slides, or where a band is silent.
pub fn onset_levels_db(
    vibration: &[f64],
    speed_m_s: &[f64],
    force_n: &[f64],
    rate_hz: f64,
) -> Option<(usize, [f64; 3])> {
    let strokes = strokes(speed_m_s, force_n, rate_hz);
    let starts = strokes.iter().map(|stroke| stroke.start);
    let (onsets, slide) = powers(vibration, starts, &slides(speed_m_s, force_n, rate_hz), rate_hz);
    let level_db = |band: usize| {
        let onset = mean(&onsets.iter().map(|onset| onset[WHOLE][band]).collect::<Vec<_>>());
        10.0 * (onset / slide[band]).log10()
    };
    Some((strokes.len(), [0, 1, 2].map(level_db))).filter(|(_, db)| db.iter().all(|db| db.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;

    #[test]
    fn a_louder_onset_is_seen_in_its_band_and_without_rest_there_is_none() {
        let rate_hz = 2000.0;
        let (mut speed, mut force, mut vibration) = (vec![], vec![], vec![]);
        let mut noise = Gaussian::new(1);
        for _ in 0..40 {
            for k in 0..rate_hz as usize {
                let t = k as f64 / rate_hz - 0.2;
                speed.push(if t < 0.0 { 0.001 } else { 0.08 });
                force.push(1.0);
                let hum = if (0.0..0.08).contains(&t) {
                    4.0 * (std::f64::consts::TAU * 35.0 * t).sin()
                } else {
                    0.0
                };
                vibration.push(noise.next_sample() + hum);
            }
        }
        let (count, [low, middle, high]) = onset_levels_db(&vibration, &speed, &force, rate_hz).unwrap();
        assert_eq!(count, 40);
        // 8 over the 100 ms, of which 80 sound, beside 0.04 of the noise.
        assert!((low - 22.0).abs() < 1.5 && middle < low - 6.0 && high.abs() < 1.5, "{low} {middle} {high}");
        assert_eq!(onset_levels_db(&vibration, &vec![0.1; vibration.len()], &force, rate_hz), None);
    }
}
