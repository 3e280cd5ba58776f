//! Finds the sample at which a tool touches the surface: roughly by force, then exactly by acceleration.
//!
//! A hand slows its tool down before it strikes, and the high-passed, combined vibration contains that deceleration
//! before the contact. Force does not, but its sensor can be filtered and late. So the contact lies within
//! [`FORCE_OFF_S`] of the sample at which the force leaves its noise: at the sample at which the acceleration leaves
//! its line before contact.

use crate::recording::Signals;
use haptograph_signal::statistics::{Line, median};
use std::ops::Range;

/// Largest lag or lead of the force relative to the acceleration, s.
const FORCE_OFF_S: f64 = 0.005;
/// Duration in the air for estimating the noise of the force; it ends [`FORCE_OFF_S`] before contact.
const AIR_S: f64 = 0.025;
/// Duration of the line fit to the acceleration before contact; it ends [`FORCE_OFF_S`] before the force rises.
const APPROACH_S: f64 = 0.01;
/// The force leaves its noise at this many standard deviations, or at this fraction of the contact force.
const FORCE_DEVIATIONS: f64 = 5.0;
const FORCE_PART: f64 = 0.1;
/// The acceleration leaves its line at this multiple of its deviation before contact.
const ACCELERATION_DEVIATIONS: f64 = 4.0;
/// Standard deviation of a Gaussian over its median absolute deviation.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;

/// Samples at which `force` rises above `contact` after at least `air` samples below half of it, and the number of samples below.
pub(super) fn rises(force: &[f64], air: usize, contact: f64) -> Vec<(usize, usize)> {
    let mut rises = vec![];
    let (mut in_air, mut touching) = (0, true);
    for (i, &f) in force.iter().enumerate() {
        if touching {
            in_air = if f < contact / 2.0 { in_air + 1 } else { 0 };
            touching = in_air < air.max(1);
        } else if f > contact {
            rises.push((i, in_air));
            (in_air, touching) = (0, true);
        } else {
            in_air += 1;
        }
    }
    rises
}

/// The sample of the contact whose force is above `contact_n` at sample `rise`. From the largest deviation of the acceleration back to
/// where it first had `part` of it without a break, or stood out from its noise if that is more.
pub(super) fn contact(signals: &Signals, rise: usize, contact_n: f64, part: f64) -> usize {
    let samples = |seconds: f64| (seconds * signals.rate_hz).round() as usize;
    let off = samples(FORCE_OFF_S).max(1);
    let touched = force_onset(signals, rise, contact_n);
    let from = touched.saturating_sub(off);
    let approach = from.saturating_sub(samples(APPROACH_S))..from;
    let end = (touched + off).min(signals.acceleration_m_s2.len());
    let deviations = deviations(signals, approach.clone(), end);
    let (before, after) = deviations.split_at(approach.len());
    let noise = (before.iter().map(|d| d * d).sum::<f64>() / before.len().max(1) as f64).sqrt();
    let peak = (0..after.len()).max_by(|&i, &j| after[i].total_cmp(&after[j]));
    let Some(peak) = peak else { return touched };
    let stands_out = (part * after[peak]).max(ACCELERATION_DEVIATIONS * noise);
    let quiet = after[..peak].iter().rposition(|d| *d < stands_out);
    from + quiet.map_or(0, |quiet| quiet + 1)
}

/// The sample at which the force, in contact at sample `rise`, left its noise in the air.
fn force_onset(signals: &Signals, rise: usize, contact_n: f64) -> usize {
    let samples = |seconds: f64| (seconds * signals.rate_hz).round() as usize;
    let force = &signals.force_normal_n;
    let off = samples(FORCE_OFF_S);
    let air = &force[rise.saturating_sub(off + samples(AIR_S))..rise.saturating_sub(off)];
    if air.is_empty() {
        return rise;
    }
    let rest_n = median(air);
    let spread: Vec<f64> = air.iter().map(|f| (f - rest_n).abs()).collect();
    let noise_n = DEVIATION_OF_MEDIAN * median(&spread);
    let shows_n = rest_n + (FORCE_DEVIATIONS * noise_n).max(FORCE_PART * contact_n);
    let quiet = force[..rise].iter().rposition(|f| *f <= shows_n);
    quiet.map_or(rise, |quiet| quiet + 1)
}

/// Distance of the acceleration, from the end of `approach` to `end`, from its line during `approach`, m/s². Over the
/// three axes if they were kept, as no filter has spread the impact over the time before it.
fn deviations(signals: &Signals, approach: Range<usize>, end: usize) -> Vec<f64> {
    let mut squares = vec![0.0; end.saturating_sub(approach.start)];
    let mut add = |acceleration: &dyn Fn(usize) -> f64| {
        let since = |i: usize| (i - approach.start) as f64;
        let points: Vec<(f64, f64)> = approach.clone().map(|i| (since(i), acceleration(i))).collect();
        let line = Line::fit(&points);
        for (k, square) in squares.iter_mut().enumerate() {
            let i = approach.start + k;
            let expected = line.as_ref().map_or(0.0, |line| line.at(since(i)));
            *square += (acceleration(i) - expected).powi(2);
        }
    };
    match &signals.axes_m_s2 {
        Some(axes) => (0..3).for_each(|axis| add(&|i| axes[i][axis])),
        None => add(&|i| signals.acceleration_m_s2[i]),
    }
    squares.into_iter().map(f64::sqrt).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 10_000.0;
    /// The sample of contact.
    const AT: usize = 3000;

    /// A tool that brakes from 30 ms before contact on, at a quarter of the blow's peak, strikes and rings; the force shows `lag` samples
    /// after the contact.
    fn strike(lag: usize, kept_axes: bool, offset_n: f64) -> Signals {
        let noise =
            |i: usize, k: u64| ((i as f64 * 12.9898 + k as f64 * 78.233).sin() * 43_758.545_3).fract();
        let blow = |i: usize| {
            let braking = if i < AT { (i as f64 - (AT as f64 - 300.0)).max(0.0) / 300.0 * 8.0 } else { 8.0 };
            let t = (i as f64 - AT as f64) / RATE_HZ;
            let ring = if t > 0.0 {
                40.0 * (-t / 0.01).exp() * (std::f64::consts::TAU * 250.0 * t).sin()
            } else {
                0.0
            };
            braking + ring
        };
        let acceleration: Vec<f64> = (0..4500).map(|i| blow(i) + 0.1 * noise(i, 1)).collect();
        let force = |i: usize| {
            let t = i.saturating_sub(AT + lag) as f64 / RATE_HZ;
            offset_n + 4.0 * (30.0 * t).min(1.0) + 0.01 * noise(i, 2)
        };
        Signals {
            rate_hz: RATE_HZ,
            force_normal_n: (0..4500).map(force).collect(),
            force_tangential_n: None,
            speed_m_s: vec![0.1; 4500],
            axes_m_s2: kept_axes.then(|| {
                let axis =
                    |(i, a): (usize, &f64)| [0.3 * a, 0.4 * a + 1.0, 0.866 * a - 9.81 + 0.1 * noise(i, 3)];
                acceleration.iter().enumerate().map(axis).collect()
            }),
            acceleration_m_s2: acceleration,
        }
    }

    #[test]
    fn a_contact_is_found_within_a_third_of_a_millisecond_however_the_tool_brakes_and_the_force_lags() {
        for lag in [0, 10, 30] {
            for (kept_axes, offset_n) in [(true, 0.0), (false, 0.0), (true, -0.05)] {
                let signals = strike(lag, kept_axes, offset_n);
                let found = rises(&signals.force_normal_n, 300, 0.2);
                assert_eq!(found.len(), 1);
                let at = contact(&signals, found[0].0, 0.2, 0.1);
                assert!((AT..=AT + 3).contains(&at), "lag {lag}: {at}");
            }
        }
    }

    #[test]
    fn without_a_blow_in_the_acceleration_the_contact_stays_near_the_force() {
        let mut signals = strike(0, true, 0.0);
        signals.axes_m_s2 = Some(vec![[0.0, 0.0, -9.81]; 4500]);
        let at = contact(&signals, AT + 60, 0.2, 0.1);
        assert!(at.abs_diff(AT) <= 60, "{at}");
    }

    #[test]
    fn a_contact_at_the_very_start_is_no_panic() {
        let signals = strike(0, true, 0.0);
        for rise in [0, 1, 40, 4499] {
            assert!(contact(&signals, rise, 0.2, 0.1) <= 4499);
        }
    }

    #[test]
    fn a_rise_needs_air_before_it() {
        let force: Vec<f64> =
            (0..1000).map(|i| if matches!(i, 100..150 | 200..230 | 400..450) { 1.0 } else { 0.0 }).collect();
        assert_eq!(rises(&force, 40, 0.2), [(100, 100), (200, 50), (400, 170)]);
        assert_eq!(
            rises(&force, 60, 0.2),
            [(100, 100), (400, 170)],
            "50 samples in the air are too few before 200"
        );
        assert_eq!(rises(&[1.0; 100], 10, 0.2), [], "a recording that starts in contact starts with no tap");
    }
}
