//! `.haptic`, version 1 (Lofelt; Meta Haptics Studio). Fields and rules: github.com/facebook/meta-haptics-sdk,
//! `core/haptic_data/src/v1.rs`, MIT. A frequency from 0 to 1 is 30 to 600 Hz, as where Meta analyses sound
//! (`interfaces/studio/audio_analysis/src/frequency_analyzer.rs`); a player maps it to what its actuator can.

use super::analysis::{Analysis, Written, add_sine, add_taps};
use super::curves::{self, Point, at, at_samples, linear, rounded};
use serde_json::{Value, json};

const FREQUENCY_HZ: [f64; 2] = [30.0, 600.0];

pub(super) fn write(vibration: &Analysis, most: usize) -> Written {
    let (track, full_scale) = vibration.whole();
    let high = |hz: &f64| ((hz - FREQUENCY_HZ[0]) / (FREQUENCY_HZ[1] - FREQUENCY_HZ[0])).clamp(0.0, 1.0);
    let frequencies: Vec<f64> = track.frequency_hz.iter().map(high).collect();
    let amplitude = curves::amplitude(&track.amplitude, 2, most);
    let frequency = curves::frequency(&frequencies, &track.amplitude, most);
    let points = amplitude.len() + frequency.len();
    let point = |name: &str, [time_s, value]: &Point| json!({ "time": rounded(*time_s, 1e3), name: rounded(*value, 1e4) });
    let mut breakpoints: Vec<Value> = amplitude.iter().map(|of| point("amplitude", of)).collect();
    for tap in &vibration.taps {
        let time_s = rounded(tap.time_s, 1e3);
        let next =
            breakpoints.partition_point(|point| point["time"].as_f64().is_some_and(|time| time <= time_s));
        // An emphasis belongs to a breakpoint, and is not below it.
        let level = at(&amplitude, time_s, linear);
        let mut breakpoint = point("amplitude", &[time_s, level]);
        let emphasis = (tap.amplitude / full_scale).clamp(rounded(level, 1e4), 1.0);
        breakpoint["emphasis"] = json!({ "amplitude": rounded(emphasis, 1e4), "frequency": rounded(high(&tap.frequency_hz), 1e4) });
        breakpoints.insert(next, breakpoint);
    }
    let envelopes = json!({
        "amplitude": breakpoints, "frequency": frequency.iter().map(|of| point("frequency", of)).collect::<Vec<_>>(),
    });
    let about = json!({
        "editor": "haptograph", "author": "", "source": "", "project": "", "tags": [], "description": vibration.note(full_scale),
    });
    let version = json!({ "major": 1, "minor": 0, "patch": 0 });
    let signals = json!({ "continuous": { "envelopes": envelopes } });
    Written { file: json!({ "version": version, "metadata": about, "signals": signals }), full_scale, points }
}

/// The vibration that a file stands for.
pub(super) fn read(file: &Value, rate_hz: f64, samples: usize) -> Vec<f64> {
    let number = |value: &Value| value.as_f64().unwrap_or(0.0);
    let envelopes = &file["signals"]["continuous"]["envelopes"];
    let of = |name: &'static str| envelopes[name].as_array().into_iter().flatten();
    let curve = |name: &'static str| {
        let points = of(name).map(|point| [number(&point["time"]), number(&point[name])]);
        at_samples(&points.collect::<Vec<Point>>(), rate_hz, samples, linear)
    };
    let [low_hz, high_hz] = FREQUENCY_HZ;
    let frequency_hz: Vec<f64> =
        curve("frequency").into_iter().map(|part| low_hz + part * (high_hz - low_hz)).collect();
    let mut signal = vec![0.0; samples];
    add_sine(&mut signal, &curve("amplitude"), &frequency_hz, rate_hz);
    let taps = of("amplitude").filter(|point| point["emphasis"].is_object());
    add_taps(
        &mut signal,
        taps.map(|point| [number(&point["time"]), number(&point["emphasis"]["amplitude"])]),
        rate_hz,
    );
    signal
}
