//! `.hjif` of ISO/IEC 23090-31, profile "Simple Parametric", level 1. Fields, limits and decoding are those of MPEG's reference
//! software (github.com/MPEGGroup/HapticReferenceSoftware, BSD licence: `IOJson`, `Band`, `Effect`): as in its encoder of samples, what
//! is below 72.5 Hz is a curve through its extrema; above, where that has wavelets, which the profile excludes, are sines with
//! keyframes as in its encoder of AHAP.

use super::analysis::{Analysis, Spectrum, Tap, Written, add_sine, add_taps};
use super::curves::{self, Point, at_samples, linear, rounded};
use haptograph_signal::time::since_1970;
use haptograph_surfaces::bounds::carried_hz;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Edges of the bands of sines, Hz: with a curve and taps there are seven bands, the most of level 1.
const EDGES_HZ: [f64; 6] = [72.5, 122.5, 207.0, 350.0, 592.0, 1000.0];
/// Limits of the band of taps, Hz: those of MPEG's encoder of AHAP.
const TAPS_HZ: [f64; 2] = [65.0, 300.0];
/// Ticks per second; the profile has no other.
const TICKS: f64 = 1000.0;
/// Change from one extremum to the next below which the next is left out, relative to the largest magnitude.
const LEAST_CHANGE: f64 = 0.005;

pub(super) fn write(vibration: &Analysis, most: usize) -> Written {
    let mut bands = vec![curve(&vibration.rest, vibration.rate_hz)];
    for edges in EDGES_HZ.windows(2).filter(|edges| edges[0] < carried_hz(vibration.rate_hz)) {
        bands.extend(wave(&vibration.rest, [edges[0], edges[1]], most / 2));
    }
    if !vibration.taps.is_empty() {
        let tap = |tap: &Tap| {
            json!({
                "relative_position": (TICKS * tap.time_s).round() as u64,
                "amplitude_modulation": rounded(tap.amplitude.min(1.0), 1e4),
                "frequency_modulation": tap.frequency_hz.clamp(TAPS_HZ[0], TAPS_HZ[1]).round() as u64,
            })
        };
        bands.push(band("Transient", TAPS_HZ, vibration.taps.iter().map(tap).collect()));
    }
    let points = bands.iter().filter(|band| band["band_type"] != "Transient");
    let points = points.map(|band| keyframes(band).count()).sum();
    let note = vibration.note(1.0);
    let channel = json!({
        "id": 0, "description": note, "gain": 1.0, "mixing_coefficient": 1.0, "body_part_mask": 0,
        "frequency_sampling": vibration.rate_hz.round() as u64, "sample_count": vibration.rest.samples, "bands": bands,
    });
    let perception = json!({
        "id": 0, "avatar_id": 0, "description": note, "perception_modality": "Vibrotactile", "reference_devices": [],
        "effect_library": [], "channels": [channel],
    });
    // The year alone, so that a vibration has one file.
    let year = 1970 + since_1970().as_secs() / 31_556_952;
    let file = json!({
        "version": "2023", "profile": "Simple Parametric", "level": 1, "date": year.to_string(), "description": note,
        "timescale": TICKS as u64, "avatars": [], "perceptions": [perception], "syncs": [],
    });
    Written { file, full_scale: 1.0, points }
}

fn band(kind: &str, [low_hz, high_hz]: [f64; 2], keyframes: Vec<Value>) -> Value {
    let mut effect = json!({ "effect_type": "Basis", "position": 0, "keyframes": keyframes });
    let mut band = json!({
        "band_type": kind, "lower_frequency_limit": low_hz.floor() as u64, "upper_frequency_limit": high_hz.ceil() as u64,
    });
    match kind {
        "Curve" => band["curve_type"] = json!("Cubic"),
        _ => (effect["phase"], effect["base_signal"]) = (json!(0.0), json!("Sine")),
    }
    band["effects"] = json!([effect]);
    band
}

/// What is below the sines: its extrema.
fn curve(rest: &Spectrum, rate_hz: f64) -> Value {
    let part: Vec<f64> = rest.between([0.0, EDGES_HZ[0]]).iter().map(|z| z.re).collect();
    let is_extremum = |n: &usize| (part[*n] - part[n - 1]) * (part[n + 1] - part[*n]) <= 0.0;
    let inner = (1..part.len() - 1).filter(is_extremum);
    let mut ticks = BTreeMap::from([(0, part[0])]);
    let mut last = part[0];
    for n in inner {
        if (part[n] - last).abs() >= LEAST_CHANGE {
            last = part[n];
            ticks.insert((TICKS * n as f64 / rate_hz).round() as u64, last);
        }
    }
    let end = (TICKS * part.len() as f64 / rate_hz).ceil() as u64;
    // The reference software leaves out a curve of two points.
    if ticks.len() == 1 {
        ticks.insert(end / 2, last);
    }
    ticks.insert(end, part[part.len() - 1]);
    let keyframe = |(tick, value): (u64, f64)| json!({ "relative_position": tick, "amplitude_modulation": rounded(value.clamp(-1.0, 1.0), 1e4) });
    band("Curve", [0.0, EDGES_HZ[0]], ticks.into_iter().map(keyframe).collect())
}

/// The sine of a band; none if it is silent.
fn wave(rest: &Spectrum, limits_hz: [f64; 2], most: usize) -> Option<Value> {
    let mut track = rest.track(limits_hz);
    let largest = track.amplitude.iter().copied().fold(0.0, f64::max);
    if largest < LEAST_CHANGE {
        return None;
    }
    track.amplitude.iter_mut().for_each(|amplitude| *amplitude /= largest);
    let [low_hz, high_hz] = limits_hz;
    let high = |hz: &f64| ((hz - low_hz) / (high_hz - low_hz)).clamp(0.0, 1.0);
    let frequencies: Vec<f64> = track.frequency_hz.iter().map(high).collect();
    let tick = |time_s: f64| (TICKS * time_s).round() as u64;
    let mut keyframes = BTreeMap::<u64, Value>::new();
    for [time_s, amplitude] in curves::amplitude(&track.amplitude, 2, most) {
        let value = rounded((amplitude * largest).min(1.0), 1e4);
        keyframes.entry(tick(time_s)).or_default()["amplitude_modulation"] = json!(value);
    }
    for [time_s, part] in curves::frequency(&frequencies, &track.amplitude, most) {
        let hz = (low_hz + part * (high_hz - low_hz)).round().clamp(low_hz.floor(), high_hz.ceil());
        keyframes.entry(tick(time_s)).or_default()["frequency_modulation"] = json!(hz as u64);
    }
    keyframes.iter_mut().for_each(|(tick, keyframe)| keyframe["relative_position"] = json!(tick));
    Some(band("VectorialWave", limits_hz, keyframes.into_values().collect()))
}

/// The keyframes of a band: the file has one effect in each.
fn keyframes(band: &Value) -> impl Iterator<Item = &Value> {
    band["effects"][0]["keyframes"].as_array().into_iter().flatten()
}

/// The vibration that a file stands for.
pub(super) fn read(file: &Value, rate_hz: f64, samples: usize) -> Vec<f64> {
    let bands = file["perceptions"][0]["channels"][0]["bands"].as_array();
    let smooth = |part: f64| part * part * (3.0 - 2.0 * part);
    let mut signal = vec![0.0; samples];
    for band in bands.into_iter().flatten() {
        let points = |name: &'static str| -> Vec<Point> {
            let value = |keyframe: &Value| {
                Some([keyframe["relative_position"].as_f64()? / TICKS, keyframe[name].as_f64()?])
            };
            keyframes(band).filter_map(value).collect()
        };
        let amplitude = points("amplitude_modulation");
        match band["band_type"].as_str() {
            Some("Curve") => {
                let curve = at_samples(&amplitude, rate_hz, samples, smooth);
                signal.iter_mut().zip(curve).for_each(|(y, value)| *y += value);
            }
            Some("Transient") => add_taps(&mut signal, amplitude, rate_hz),
            _ => {
                let [amplitude, frequency_hz] = [amplitude, points("frequency_modulation")]
                    .map(|points| at_samples(&points, rate_hz, samples, linear));
                add_sine(&mut signal, &amplitude, &frequency_hz, rate_hz);
            }
        }
    }
    signal
}
