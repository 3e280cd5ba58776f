//! Learns taps: the vibrations of a tool that strikes the surface, by impact speed (thesis 4.2.2 and 4.4.2).
//!
//! The thesis cut its recordings by hand. Here the normal force rises at a contact after a time in the air; force and
//! acceleration together give the start of the tap.

use super::onset::{contact, rises};
use crate::processing::{ProcessingError, ProcessingSettings, SurfaceNormal, process, tip_positions};
use crate::recording::{AnyRecording, ProcessedRecording, Recording};
use haptograph_signal::statistics::{Line, median};
use haptograph_surfaces::{SurfaceError, Tap, Taps};

/// Settings for learning taps.
#[derive(Debug, Clone, PartialEq)]
pub struct TapSettings {
    /// Force at which contact begins, N; contact ends at half of it.
    pub contact_n: f64,
    /// Least time in the air between two contacts, s.
    pub air_s: f64,
    /// Least time in the air before a tap, s. A shorter time means a bounce, whose speed cannot be estimated from its path.
    pub free_s: f64,
    /// Length of a tap after contact, s.
    pub length_s: f64,
    /// Fraction of the largest deviation from the acceleration before contact at which a tap begins.
    pub onset: f64,
    /// Duration of the path before contact whose slope is the impact speed, s.
    pub approach_s: f64,
    /// Least impact speed of a tap, m/s.
    pub min_speed_m_s: f64,
    /// Cut-off of the force's low-pass, higher than elsewhere, so that an impact of milliseconds keeps its peak.
    pub force_lowpass_hz: f64,
}

impl Default for TapSettings {
    fn default() -> Self {
        Self {
            contact_n: 0.2,
            air_s: 0.03,
            free_s: 0.1,
            length_s: 0.1,
            onset: 0.1,
            approach_s: 0.03,
            min_speed_m_s: 0.005,
            force_lowpass_hz: 1000.0,
        }
    }
}

/// A contact in a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// Index of its recording.
    pub recording: usize,
    /// Start of the tap after the start of the processed recording, s.
    pub time_s: f64,
    /// Incoming speed, m/s.
    pub speed_m_s: f64,
    /// Peak normal force within the tap, N.
    pub peak_force_n: f64,
    /// True if the surface was learned from this tap.
    pub used: bool,
}

/// The report of learning taps.
#[derive(Debug, Clone, PartialEq)]
pub struct TapReport {
    /// All contacts.
    pub contacts: Vec<Contact>,
    /// The taps' spectral centroid, Hz: [`Taps::spectral_centroid_hz`].
    pub spectral_centroid_hz: f64,
}

/// An error of learning taps.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum TapError {
    #[error(transparent)]
    Processing(#[from] ProcessingError),
    #[error(
        "no tap was found: the normal force never rises above {contact_n} N after {air_ms} ms in the air with {length_ms} ms recorded after it"
    )]
    NoTaps { contact_n: f64, air_ms: f64, length_ms: f64 },
    #[error(
        "recording {recording} (from 0) has a rate of {rate_hz} Hz, but the first has {expected_hz} Hz; all rates must be equal"
    )]
    Rates { recording: usize, rate_hz: f64, expected_hz: f64 },
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}

/// Learns taps from tapping recordings.
pub fn learn_taps(
    recordings: &[&AnyRecording],
    processing: &ProcessingSettings,
    settings: &TapSettings,
) -> Result<(Taps, TapReport), TapError> {
    let mut found = vec![];
    let mut rate_hz = 0.0;
    for (index, recording) in recordings.iter().enumerate() {
        let processed = processed_taps(recording, processing, settings)?;
        if index > 0 && processed.rate_hz() != rate_hz {
            return Err(TapError::Rates {
                recording: index,
                rate_hz: processed.rate_hz(),
                expected_hz: rate_hz,
            });
        }
        rate_hz = processed.rate_hz();
        let path = match recording {
            AnyRecording::Raw(raw) => Some(raw),
            AnyRecording::Processed(_) => None,
        };
        found.extend(cut(index, &processed, path, settings));
    }
    found.sort_by(|a, b| a.0.speed_m_s.total_cmp(&b.0.speed_m_s));
    let mut slower = settings.min_speed_m_s;
    for (contact, _) in &mut found {
        // Rendering needs taps at distinct speeds.
        contact.used = contact.speed_m_s > slower;
        slower = slower.max(contact.speed_m_s);
    }
    let used: Vec<Tap> =
        found.iter().filter(|(contact, _)| contact.used).map(|(_, tap)| tap.clone()).collect();
    if used.is_empty() {
        return Err(TapError::NoTaps {
            contact_n: settings.contact_n,
            air_ms: settings.free_s * 1000.0,
            length_ms: settings.length_s * 1000.0,
        });
    }
    let taps = Taps::new(rate_hz, used)?;
    let contacts: Vec<Contact> = found.into_iter().map(|(contact, _)| contact).collect();
    let report =
        TapReport { contacts, spectral_centroid_hz: taps.spectral_centroid_hz().unwrap_or_default() };
    Ok((taps, report))
}

fn processed_taps(
    recording: &AnyRecording,
    processing: &ProcessingSettings,
    settings: &TapSettings,
) -> Result<ProcessedRecording, ProcessingError> {
    match recording {
        AnyRecording::Processed(processed) => Ok(processed.clone()),
        AnyRecording::Raw(raw) => {
            let normal = match processing.normal {
                // The path of taps does not define a plane.
                SurfaceNormal::PlaneFit => SurfaceNormal::ForceDirection,
                other => other,
            };
            let lowpass_hz = settings.force_lowpass_hz;
            process(raw, &ProcessingSettings { normal, lowpass_hz, ..processing.clone() })
        }
    }
}

/// The contacts of a recording, each with its tap.
fn cut(
    recording: usize,
    processed: &ProcessedRecording,
    path: Option<&Recording>,
    settings: &TapSettings,
) -> Vec<(Contact, Tap)> {
    let signals = processed.signals();
    let samples = |seconds: f64| (seconds * signals.rate_hz).round() as usize;
    let length = samples(settings.length_s).max(1);
    let rises = rises(&signals.force_normal_n, samples(settings.air_s), settings.contact_n);
    let mut taps = vec![];
    for (i, &(rise, air)) in rises.iter().enumerate() {
        let begin = contact(signals, rise, settings.contact_n, settings.onset);
        let next = rises.get(i + 1).map_or(usize::MAX, |(next, _)| *next);
        // A bounce, a tap that bounced, or one without its full length is not a tap.
        if air < samples(settings.free_s) || begin + length > processed.samples() || next < begin + length {
            continue;
        }
        let speed_m_s = match path {
            Some(raw) => approach_speed(raw, begin as f64 / signals.rate_hz, settings.approach_s),
            None => {
                let end = begin.saturating_sub(samples(0.003));
                median(&signals.speed_m_s[end.saturating_sub(samples(0.01))..end.max(1)])
            }
        };
        let force = &signals.force_normal_n[begin..begin + length];
        let peak_force_n = force.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let tap = Tap {
            speed_m_s,
            acceleration_m_s2: signals.acceleration_m_s2[begin..begin + length].to_vec(),
            // A tap that is over before its force shows has none.
            peak_force_n: Some(peak_force_n).filter(|force| *force > 0.0),
        };
        let time_s = begin as f64 / signals.rate_hz;
        let contact = Contact { recording, time_s, speed_m_s, peak_force_n, used: false };
        taps.push((contact, tap));
    }
    taps
}

/// The tip's speed along its path over the last `seconds` before a moment: the slope of the least-squares line, which does not see
/// the blow.
fn approach_speed(raw: &Recording, time_s: f64, seconds: f64) -> f64 {
    let motion = raw.motion();
    // The processed recording starts where all sensors are on.
    let start = motion.start_s.max(raw.wrench().start_s).max(raw.acceleration_v().start_s);
    let contact = start + time_s;
    let tips = tip_positions(raw);
    let before = |i: &usize| motion.time_s(*i) < contact && motion.time_s(*i) >= contact - seconds;
    let rows: Vec<usize> = (0..tips.len()).filter(before).collect();
    let slope = |axis: usize| {
        let points: Vec<_> = rows.iter().map(|&i| (motion.time_s(i) - contact, tips[i][axis])).collect();
        Line::fit(&points).map_or(0.0, |line| line.slope)
    };
    (0..3).map(|axis| slope(axis).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Gesture;
    use crate::recording::tests::synthetic::{self, Moment, RATE_HZ};
    use std::f64::consts::TAU;

    /// Speeds of the taps below, one every 0.4 s, in the order in which they come.
    const SPEEDS: [f64; 6] = [0.10, 0.25, 0.05, 0.40, 0.15, 0.30];
    const RINGING_HZ: f64 = 300.0;

    /// A tool that comes down at each speed, strikes, rings and stays for 60 ms, and lifts off.
    fn tapping() -> Recording {
        synthetic::raw(0.4 * SPEEDS.len() as f64 + 0.2, Gesture::Tap, 240.0, |t| {
            let index = ((t / 0.4) as usize).min(SPEEDS.len() - 1);
            let (speed, since) = (SPEEDS[index], t - 0.4 * index as f64 - 0.2);
            let (height, push, ring) = if since < 0.0 {
                (-speed * since, 0.0, 0.0)
            } else if since < 0.06 {
                let ring = 200.0 * speed * (-since / 0.01).exp() * (TAU * RINGING_HZ * since).sin();
                (0.0, 40.0 * speed * (TAU * since / 0.12).sin(), ring)
            } else {
                (0.2 * (since - 0.06), 0.0, 0.0)
            };
            Moment {
                place_m: [0.0, 0.0, height],
                push_n: push,
                friction_n: [0.0; 2],
                vibration_m_s2: [0.0, 0.0, ring],
            }
        })
    }

    fn learned(recording: AnyRecording) -> (Taps, TapReport) {
        learn_taps(&[&recording], &ProcessingSettings::default(), &TapSettings::default()).unwrap()
    }

    #[test]
    fn taps_are_found_aligned_and_labelled_by_their_speed() {
        let (taps, report) = learned(AnyRecording::Raw(tapping()));
        let mut speeds = SPEEDS;
        speeds.sort_by(f64::total_cmp);
        assert_eq!(taps.taps().len(), speeds.len());
        assert_eq!((taps.rate_hz(), taps.length()), (RATE_HZ, 1000));
        for (tap, speed) in taps.taps().iter().zip(speeds) {
            assert!((tap.speed_m_s / speed - 1.0).abs() < 0.02, "{} for {speed}", tap.speed_m_s);
            // The ringing's first peak comes a quarter period after contact, less what the onset's threshold takes.
            let peak =
                |a: &Vec<f64>| (0..a.len()).max_by(|&i, &j| a[i].abs().total_cmp(&a[j].abs())).unwrap();
            let at_ms = peak(&tap.acceleration_m_s2) as f64 / 10.0;
            assert!((0.3..1.0).contains(&at_ms), "peak {at_ms} ms after the onset");
        }
        let times: Vec<f64> = report.contacts.iter().map(|c| c.time_s).collect();
        for (contact, time) in report.contacts.iter().zip(&times) {
            let index = SPEEDS.iter().position(|s| (s / contact.speed_m_s - 1.0).abs() < 0.1).unwrap();
            assert!((time - (0.4 * index as f64 + 0.2)).abs() < 5e-4, "{time}");
        }
    }

    #[test]
    fn the_response_factor_is_peak_force_over_speed() {
        let (taps, report) = learned(AnyRecording::Raw(tapping()));
        let line = taps.response().unwrap();
        assert!((line.slope / 40.0 - 1.0).abs() < 0.03, "{line:?}");
        assert!(line.r_squared > 0.99 && line.intercept.abs() < 0.2);
        let recorded = taps.taps().iter().filter_map(|tap| tap.peak_force_n);
        assert!(report.contacts.iter().map(|c| c.peak_force_n).eq(recorded));
    }

    #[test]
    fn a_ringing_of_300_hz_has_its_centroid_there() {
        let (_, report) = learned(AnyRecording::Raw(tapping()));
        assert!(
            (report.spectral_centroid_hz / RINGING_HZ - 1.0).abs() < 0.1,
            "{}",
            report.spectral_centroid_hz
        );
    }

    #[test]
    fn processed_recordings_will_do() {
        let processed = process(
            &tapping(),
            &ProcessingSettings { normal: SurfaceNormal::ForceDirection, ..Default::default() },
        );
        let (taps, _) = learned(AnyRecording::Processed(processed.unwrap()));
        assert_eq!(taps.taps().len(), SPEEDS.len());
    }

    #[test]
    fn a_bounce_is_no_tap_and_neither_is_a_tap_that_bounced() {
        // Every tap is followed 70 ms later by a second contact, after 40 ms in the air.
        let bouncing = synthetic::raw(2.2, Gesture::Tap, 240.0, |t| {
            let since = t - 0.6 * (t / 0.6).floor() - 0.3;
            let touching = (0.0..0.03).contains(&since) || (t > 0.6 && (0.07..0.1).contains(&since));
            let falling = if since < 0.0 { -0.2 * since } else { 0.0 };
            let ring = if touching { 20.0 * (TAU * RINGING_HZ * since).sin() } else { 0.0 };
            Moment {
                place_m: [0.0, 0.0, if touching { 0.0 } else { falling.max(0.001) }],
                push_n: if touching { 2.0 } else { 0.0 },
                friction_n: [0.0; 2],
                vibration_m_s2: [0.0, 0.0, ring],
            }
        });
        let (taps, report) = learned(AnyRecording::Raw(bouncing));
        assert_eq!((taps.taps().len(), report.contacts.len()), (1, 1), "{:?}", report.contacts);
        assert!((report.contacts[0].time_s - 0.3).abs() < 2e-3, "only the first did not bounce");
    }

    #[test]
    fn no_taps_no_surface() {
        let still = synthetic::circle(1.0, 0.03, 1.0, 1.0, 0.3);
        let error =
            learn_taps(&[&AnyRecording::Raw(still)], &ProcessingSettings::default(), &TapSettings::default());
        assert!(matches!(error, Err(TapError::NoTaps { .. })));
    }
}
