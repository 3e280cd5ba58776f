//! Apple's AHAP. Fields and ranges: Apple, "Representing haptic patterns in AHAP files"; a continuous event lasts at most 30 s
//! (`CHHapticEvent.duration`), `HapticIntensityControl` multiplies and `HapticSharpnessControl` is added
//! (`CHHapticDynamicParameter.value`), and both act on all events (`CHHapticParameterCurve`). Apple states neither amplitudes nor
//! frequencies: intensity is the root of amplitude, and a curve has at most 16 points, as in Meta's converter
//! (github.com/facebook/meta-haptics-sdk, `core/haptic_data/src/ahap.rs`, MIT); sharpness from 0 to 1 is 65 to 300 Hz, as in MPEG's
//! (github.com/MPEGGroup/HapticReferenceSoftware, `AhapEncoder`).

use super::analysis::{Analysis, TAP_S, Tap, Written, add_sine, add_taps};
use super::curves::{self, Point, at, at_samples, linear, rounded};
use serde_json::{Value, json};

const SHARPNESS_HZ: [f64; 2] = [65.0, 300.0];
const POINTS_PER_CURVE: usize = 16;
const LONGEST_S: f64 = 30.0;
/// Before and after a tap the control of the intensity takes this long to 1 and back, s.
const RAMP_S: f64 = 0.001;
const INTENSITY: &str = "HapticIntensityControl";
const SHARPNESS: &str = "HapticSharpnessControl";

pub(super) fn write(vibration: &Analysis, most: usize) -> Written {
    let (track, full_scale) = vibration.whole();
    let roots: Vec<f64> = track.amplitude.iter().map(|amplitude| amplitude.sqrt()).collect();
    let sharp = |hz: &f64| ((hz - SHARPNESS_HZ[0]) / (SHARPNESS_HZ[1] - SHARPNESS_HZ[0])).clamp(0.0, 1.0);
    let sharpness: Vec<f64> = track.frequency_hz.iter().map(sharp).collect();
    let mut intensity = curves::amplitude(&roots, 4, most);
    let sharpness = curves::frequency(&sharpness, &track.amplitude, most);
    let end_s = intensity.last().map_or(0.0, |point| point[0]);
    let (mut events, mut begin_s) = (vec![], 0.0);
    for tap in &vibration.taps {
        let from_s = rounded(tap.time_s, 1e3);
        let gap_s = [from_s, rounded(from_s + TAP_S, 1e3).min(end_s).max(from_s + 2.0 * RAMP_S)];
        open(&mut intensity, gap_s);
        events.extend(continuous(begin_s, gap_s[0]));
        events.push(transient(tap, gap_s[0], full_scale, sharp(&tap.frequency_hz), &sharpness));
        begin_s = gap_s[1];
    }
    events.extend(continuous(begin_s, end_s));
    let points = intensity.len() + sharpness.len();
    events.extend(parameter(INTENSITY, &intensity).chain(parameter(SHARPNESS, &sharpness)));
    let about = json!({ "Project": "haptograph", "Description": vibration.note(full_scale) });
    Written { file: json!({ "Version": 1.0, "Metadata": about, "Pattern": events }), full_scale, points }
}

/// Raises the control of the intensity to 1 in a gap between continuous events: it acts on taps, too.
fn open(intensity: &mut Vec<Point>, [from_s, to_s]: [f64; 2]) {
    let (before_s, after_s) = (from_s - RAMP_S, to_s - RAMP_S);
    let outside = |point: &Point| point[0] < before_s - 0.5 * RAMP_S || point[0] > to_s + 0.5 * RAMP_S;
    let level = |time_s| at(intensity, time_s, linear);
    let gap = [[before_s, level(before_s)], [from_s, 1.0], [after_s, 1.0], [to_s, level(to_s)]];
    let mut points: Vec<Point> = intensity.iter().copied().filter(outside).collect();
    points.extend(gap.into_iter().filter(|point| point[0] >= 0.0));
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    *intensity = points;
}

/// Continuous events from one time to another.
fn continuous(from_s: f64, to_s: f64) -> impl Iterator<Item = Value> {
    // The ends are whole milliseconds.
    let count = ((to_s - from_s - 1e-6) / LONGEST_S).ceil() as usize;
    (0..count).map(move |index| {
        let begin_s = from_s + LONGEST_S * index as f64;
        json!({ "Event": {
            "Time": rounded(begin_s, 1e3), "EventType": "HapticContinuous",
            "EventDuration": rounded((to_s - begin_s).min(LONGEST_S), 1e3), "EventParameters": parameters(1.0, 0.0),
        } })
    })
}

fn transient(tap: &Tap, time_s: f64, full_scale: f64, sharp: f64, control: &[Point]) -> Value {
    // What is added at this time.
    let added = at(control, time_s, linear);
    let intensity = (tap.amplitude / full_scale).sqrt().min(1.0);
    json!({ "Event": {
        "Time": time_s, "EventType": "HapticTransient", "EventParameters": parameters(intensity, (sharp - added).max(0.0)),
    } })
}

fn parameters(intensity: f64, sharpness: f64) -> Value {
    let parameter =
        |name: &str, value: f64| json!({ "ParameterID": name, "ParameterValue": rounded(value, 1e4) });
    json!([parameter("HapticIntensity", intensity), parameter("HapticSharpness", sharpness)])
}

/// A control as curves, each of which begins where the one before ends.
fn parameter(name: &'static str, points: &[Point]) -> impl Iterator<Item = Value> {
    let step = POINTS_PER_CURVE - 1;
    (0..points.len().saturating_sub(1)).step_by(step).map(move |first| {
        let curve = &points[first..points.len().min(first + POINTS_PER_CURVE)];
        let point = |[time_s, value]: &Point| {
            json!({ "Time": rounded(time_s - curve[0][0], 1e3), "ParameterValue": rounded(*value, 1e4) })
        };
        json!({ "ParameterCurve": {
            "ParameterID": name, "Time": rounded(curve[0][0], 1e3),
            "ParameterCurveControlPoints": curve.iter().map(point).collect::<Vec<_>>(),
        } })
    })
}

/// The vibration that a file stands for.
pub(super) fn read(file: &Value, rate_hz: f64, samples: usize) -> Vec<f64> {
    let number = |value: &Value| value.as_f64().unwrap_or(0.0);
    let all = |key: &'static str| {
        { file["Pattern"].as_array().into_iter().flatten() }
            .map(move |item| &item[key])
            .filter(|item| item.is_object())
    };
    let control = |name: &str| {
        let curves = all("ParameterCurve").filter(|curve| curve["ParameterID"] == name);
        let points = curves.flat_map(|curve| {
            let points = curve["ParameterCurveControlPoints"].as_array().into_iter().flatten();
            points.map(|point| {
                [number(&curve["Time"]) + number(&point["Time"]), number(&point["ParameterValue"])]
            })
        });
        at_samples(&points.collect::<Vec<Point>>(), rate_hz, samples, linear)
    };
    let (intensity, sharpness) = (control(INTENSITY), control(SHARPNESS));
    let (mut amplitude, mut taps) = (vec![0.0; samples], vec![]);
    for event in all("Event") {
        let of_event = number(&event["EventParameters"][0]["ParameterValue"]);
        let place = |time_s: f64| ((time_s * rate_hz).max(0.0).ceil() as usize).min(samples);
        let begin = number(&event["Time"]);
        let at = |n: usize| (of_event * intensity[n]).clamp(0.0, 1.0).powi(2);
        match event["EventType"] == "HapticTransient" {
            true => taps.extend((place(begin) < samples).then(|| [begin, at(place(begin))])),
            false => (place(begin)..place(begin + number(&event["EventDuration"])))
                .for_each(|n| amplitude[n] = at(n)),
        }
    }
    let [low_hz, high_hz] = SHARPNESS_HZ;
    let frequency_hz: Vec<f64> =
        { sharpness.iter() }.map(|s| low_hz + s.clamp(0.0, 1.0) * (high_hz - low_hz)).collect();
    let mut signal = vec![0.0; samples];
    add_sine(&mut signal, &amplitude, &frequency_hz, rate_hz);
    add_taps(&mut signal, taps, rate_hz);
    signal
}
