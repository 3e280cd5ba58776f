use super::curves::{at_samples, linear};
use super::*;
use haptograph_signal::noise::Gaussian;
use serde_json::json;
use std::f64::consts::{PI, TAU};

const RATE_HZ: f64 = 4000.0;

fn seconds(count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(|n| n as f64 / RATE_HZ)
}

/// A tone of 150 Hz and an amplitude of 2.
fn tone() -> Vec<f64> {
    seconds(8000).map(|t| 2.0 * (TAU * 150.0 * t).sin()).collect()
}

/// Noise through a resonance at `hz`, with a level over time.
fn noise(seed: u64, hz: f64, level: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut white = Gaussian::new(seed);
    let (radius, mut last) = (0.97, [0.0; 2]);
    let mut next = |t: f64| {
        let y = white.next_sample() + 2.0 * radius * (TAU * hz / RATE_HZ).cos() * last[0]
            - radius * radius * last[1];
        last = [y, last[0]];
        level(t) * y
    };
    seconds(12_000).map(&mut next).collect()
}

/// Strokes that begin and end.
fn strokes() -> Vec<f64> {
    noise(1, 180.0, |t| (PI * t).sin().abs() + 0.02)
}

/// Bursts of 20 ms at 0.5 and 1.5 s over faint noise.
fn tapping() -> Vec<f64> {
    let mut signal = noise(2, 120.0, |_| 0.001);
    for begin in [2000, 6000] {
        for n in 0..80 {
            let t = n as f64 / RATE_HZ;
            signal[begin + n] += (TAU * 220.0 * t).sin() * (-t / 0.005).exp();
        }
    }
    signal
}

fn loss(signal: &[f64], format: Format) -> Loss {
    encode(signal, RATE_HZ, "m/s2", format).unwrap().loss
}

fn file(signal: &[f64], format: Format) -> Value {
    serde_json::from_str(&encode(signal, RATE_HZ, "m/s2", format).unwrap().text).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn list(value: &Value) -> &Vec<Value> {
    value.as_array().unwrap_or_else(|| panic!("{value} is no list"))
}

fn all() -> [Vec<f64>; 4] {
    [tone(), strokes(), tapping(), noise(3, 40.0, |t| 1.0 + (TAU * t).sin())]
}

#[test]
fn a_steady_tone_keeps_its_level_in_its_third_octave() {
    for format in Format::ALL {
        let loss = loss(&tone(), format);
        assert!(loss.envelope_db < 0.3, "{loss:?}");
        let band = loss.bands.iter().find(|band| (band.centre_hz - 158.5).abs() < 1.0).unwrap();
        // An amplitude of 2 has a power of 2.
        for db in [band.before_db, band.after_db] {
            assert!((db.unwrap() - 3.01).abs() < 0.3, "{format:?}: {band:?}");
        }
        assert_eq!(loss.taps, 0);
    }
    // Its amplitude, and the largest sample.
    for format in Format::ALL {
        assert!((loss(&tone(), format).full_scale - 2.0).abs() < 0.05, "{format:?}");
    }
}

#[test]
fn a_file_of_bands_loses_less_of_noise_than_one_sine() {
    for signal in [strokes(), noise(3, 40.0, |_| 1.0)] {
        let [ahap, haptic, hjif] = Format::ALL.map(|format| loss(&signal, format));
        assert!(hjif.lsd_db < ahap.lsd_db && hjif.lsd_db < haptic.lsd_db, "{ahap:?}\n{haptic:?}\n{hjif:?}");
    }
}

/// The plain way: the RMS of the signal around even times, as many as the curve has points.
fn plain(signal: &[f64], points: usize, full_scale: f64) -> Vec<curves::Point> {
    let step = signal.len() as f64 / (points - 1) as f64;
    let rms = |from: f64, to: f64| {
        let part = &signal[from.max(0.0) as usize..(to as usize).min(signal.len())];
        (part.iter().map(|x| x * x).sum::<f64>() / part.len() as f64).sqrt()
    };
    let point = |k: usize| {
        let place = k as f64 * step;
        let amplitude = 2f64.sqrt() * rms(place - step / 2.0, place + step / 2.0) / full_scale;
        [place / RATE_HZ, amplitude.min(1.0)]
    };
    (0..points).map(point).collect()
}

#[test]
fn curves_lose_no_more_than_levels_at_even_times() {
    let sudden =
        noise(4, 150.0, |t| if (0.7..0.9).contains(&t) || (1.9..2.6).contains(&t) { 1.0 } else { 0.05 });
    let (mut own_db, mut other_db) = (0.0, 0.0);
    for signal in [strokes(), sudden, noise(5, 60.0, |t| 0.05 + t * t), noise(6, 300.0, |_| 1.0)] {
        let Pattern { text, loss } = encode(&signal, RATE_HZ, "m/s2", Format::Haptic).unwrap();
        let mut other: Value = serde_json::from_str(&text).unwrap();
        let curve = &mut other["signals"]["continuous"]["envelopes"]["amplitude"];
        let points = plain(&signal, list(curve).len(), loss.full_scale);
        *curve =
            points.iter().map(|[time, amplitude]| json!({ "time": time, "amplitude": amplitude })).collect();
        let mut decoded = haptic::read(&other, RATE_HZ, signal.len());
        decoded.iter_mut().for_each(|y| *y *= loss.full_scale);
        let plain_db = envelope_error_db(&levels_db(&decoded, RATE_HZ), &levels_db(&signal, RATE_HZ));
        // The phase of a sine of 60 Hz decides on a tenth of a decibel over 50 ms.
        assert!(loss.envelope_db < plain_db + 0.1, "{} against {plain_db} dB", loss.envelope_db);
        (own_db, other_db) = (own_db + loss.envelope_db, other_db + plain_db);
    }
    assert!(own_db < 0.85 * other_db, "{own_db} against {other_db} dB");
}

#[test]
fn fewer_points_than_the_budget_where_few_are_enough() {
    let ramp: Vec<f64> = seconds(8000).map(|t| t * (TAU * 150.0 * t).sin()).collect();
    assert!(loss(&ramp, Format::Haptic).points <= 16, "{:?}", loss(&ramp, Format::Haptic));
    let busy = noise(6, 300.0, |_| 1.0);
    assert!(loss(&busy, Format::Ahap).points <= 2 * (3 * 60 + 2));
}

#[test]
fn bursts_are_taps_and_noise_has_none() {
    for format in Format::ALL {
        assert_eq!(loss(&tapping(), format).taps, 2, "{format:?}");
        for seed in 0..20 {
            assert_eq!(loss(&noise(seed, 120.0, |_| 1.0), format).taps, 0, "{format:?}, seed {seed}");
        }
    }
    let file = file(&tapping(), Format::Haptic);
    let points = list(&file["signals"]["continuous"]["envelopes"]["amplitude"]);
    let times: Vec<f64> = { points.iter() }
        .filter(|point| !point["emphasis"].is_null())
        .map(|point| number(&point["time"]))
        .collect();
    assert!(
        times.len() == 2 && (times[0] - 0.5).abs() < 0.004 && (times[1] - 1.5).abs() < 0.004,
        "{times:?}"
    );
    // A tap has its energy: 50 ms that hold it have its level.
    for format in Format::ALL {
        let Pattern { text, loss } = encode(&tapping(), RATE_HZ, "m/s2", format).unwrap();
        let level = |signal: &[f64]| levels_db(&signal[1960..2160], RATE_HZ)[0];
        let decoded = decode(&text, format, RATE_HZ, 12_000);
        let decoded: Vec<f64> = decoded.iter().map(|y| y * loss.full_scale).collect();
        let apart = level(&decoded) - level(&tapping());
        assert!(apart.abs() < 1.0, "{format:?}: {apart} dB");
    }
}

/// "Representing haptic patterns in AHAP files", the pages of its keys, and 16 points a curve.
#[test]
fn ahap_has_the_keys_and_ranges_that_apple_states() {
    let long: Vec<f64> = (0..65_000).map(|n| (TAU * 0.1 * f64::from(n)).sin()).collect();
    let long: Value = serde_json::from_str(&encode(&long, 1000.0, "A", Format::Ahap).unwrap().text).unwrap();
    for file in all().iter().map(|signal| file(signal, Format::Ahap)).chain([long]) {
        assert_eq!(file["Version"], 1.0);
        let mut ends = [0.0, 0.0];
        for item in list(&file["Pattern"]) {
            assert_eq!(item.as_object().unwrap().len(), 1);
            if let Some(event) = item.get("Event") {
                let kind = event["EventType"].as_str().unwrap();
                assert!(
                    ["HapticContinuous", "HapticTransient"].contains(&kind) && number(&event["Time"]) >= 0.0
                );
                let duration = event.get("EventDuration").map(number);
                assert_eq!(duration.is_some(), kind == "HapticContinuous");
                assert!(duration.is_none_or(|duration| duration > 0.0 && duration <= 30.0), "{event}");
                for parameter in list(&event["EventParameters"]) {
                    let id = parameter["ParameterID"].as_str().unwrap();
                    assert!(["HapticIntensity", "HapticSharpness"].contains(&id));
                    assert!((0.0..=1.0).contains(&number(&parameter["ParameterValue"])), "{event}");
                }
                continue;
            }
            let curve = &item["ParameterCurve"];
            let which = ["HapticIntensityControl", "HapticSharpnessControl"];
            let which = which.iter().position(|id| curve["ParameterID"] == *id).unwrap();
            let points = list(&curve["ParameterCurveControlPoints"]);
            assert!((2..=16).contains(&points.len()), "{curve}");
            // A curve begins where the one before ended.
            let begin = number(&curve["Time"]);
            assert!((begin - ends[which]).abs() < 1e-6, "{begin} after {}", ends[which]);
            assert_eq!(number(&points[0]["Time"]), 0.0);
            assert!(
                points.windows(2).all(|two| number(&two[0]["Time"]) < number(&two[1]["Time"])),
                "{curve}"
            );
            assert!(points.iter().all(|point| (0.0..=1.0).contains(&number(&point["ParameterValue"]))));
            ends[which] = begin + number(&points[points.len() - 1]["Time"]);
        }
        assert!(ends[0] >= 2.0 && (ends[0] - ends[1]).abs() < 1e-6);
    }
}

#[test]
fn a_tap_is_alone_in_its_gap_where_the_control_of_the_intensity_is_one() {
    let file = file(&tapping(), Format::Ahap);
    let items = list(&file["Pattern"]);
    let events: Vec<&Value> = items.iter().filter_map(|item| item.get("Event")).collect();
    let taps = events.iter().filter(|event| event["EventType"] == "HapticTransient");
    let times: Vec<f64> = taps.map(|event| number(&event["Time"])).collect();
    assert_eq!(times.len(), 2);
    for event in events.iter().filter(|event| event["EventType"] == "HapticContinuous") {
        let begin = number(&event["Time"]);
        let end = begin + number(&event["EventDuration"]);
        assert!(times.iter().all(|time| end <= time + 1e-9 || begin >= time + 0.0219), "{event}");
    }
    let curves = items.iter().map(|item| &item["ParameterCurve"]);
    let curves = curves.filter(|curve| curve["ParameterID"] == "HapticIntensityControl");
    let points: Vec<[f64; 2]> = curves
        .flat_map(|curve| {
            let points = list(&curve["ParameterCurveControlPoints"]).iter();
            points.map(|point| {
                [number(&curve["Time"]) + number(&point["Time"]), number(&point["ParameterValue"])]
            })
        })
        .collect();
    let near = |time: f64| points.iter().any(|point| (point[0] - time).abs() < 1e-6 && point[1] == 1.0);
    assert!(times.iter().all(|time| near(*time)), "{times:?}, {points:?}");
}

/// The rules of `HapticData::validate` in Meta's `haptic_data`, strict.
#[test]
fn haptic_has_the_fields_and_keeps_the_rules_of_metas_data_model() {
    for file in all().iter().map(|signal| file(signal, Format::Haptic)) {
        assert_eq!(file["version"], json!({ "major": 1, "minor": 0, "patch": 0 }));
        for text in ["editor", "author", "source", "project", "description"] {
            assert!(file["metadata"][text].is_string(), "{text}");
        }
        assert!(file["metadata"]["tags"].is_array());
        let envelopes = &file["signals"]["continuous"]["envelopes"];
        let (amplitude, frequency) = (list(&envelopes["amplitude"]), list(&envelopes["frequency"]));
        let in_range = |value: &Value| (0.0..=1.0).contains(&number(value));
        assert!(amplitude.len() >= 2 && amplitude.iter().all(|point| in_range(&point["amplitude"])));
        assert!(frequency.iter().all(|point| in_range(&point["frequency"])));
        for points in [amplitude, frequency] {
            assert!(points.windows(2).all(|two| number(&two[0]["time"]) <= number(&two[1]["time"])));
            assert!(number(&points[0]["time"]) >= 0.0);
        }
        let times = [&amplitude[0], &amplitude[amplitude.len() - 1]].map(|point| number(&point["time"]));
        assert!(times[1] > times[0]);
        assert!(frequency.iter().all(|point| (times[0]..=times[1]).contains(&number(&point["time"]))));
        for point in amplitude.iter().filter(|point| point.get("emphasis").is_some()) {
            let emphasis = &point["emphasis"];
            assert!(in_range(&emphasis["amplitude"]) && in_range(&emphasis["frequency"]));
            assert!(number(&emphasis["amplitude"]) >= number(&point["amplitude"]), "{point}");
        }
    }
}

/// The fields that `IOJson` of MPEG's reference software requires, and its checks of conformance.
#[test]
fn hjif_has_the_fields_and_keeps_the_limits_of_the_reference_software() {
    for file in all().iter().map(|signal| file(signal, Format::Hjif)) {
        assert_eq!(
            (&file["version"], &file["profile"], &file["level"]),
            (&json!("2023"), &json!("Simple Parametric"), &json!(1))
        );
        assert!(
            file["date"].as_str().is_some_and(|date| date.len() == 4 && date.parse::<u16>().is_ok()),
            "{}",
            file["date"]
        );
        assert_eq!(
            (&file["timescale"], &file["avatars"], &file["syncs"]),
            (&json!(1000), &json!([]), &json!([]))
        );
        assert!(file["description"].is_string());
        let [perception] = &list(&file["perceptions"])[..] else { panic!("{file}") };
        assert_eq!((&perception["id"], &perception["avatar_id"]), (&json!(0), &json!(0)));
        assert_eq!(perception["perception_modality"], "Vibrotactile");
        assert!(perception["description"].is_string() && perception["effect_library"].is_array());
        let [channel] = &list(&perception["channels"])[..] else { panic!("{perception}") };
        assert!(
            channel["id"].is_u64()
                && channel["description"].is_string()
                && channel["body_part_mask"].is_u64()
        );
        assert!(channel["gain"].is_number() && channel["mixing_coefficient"].is_number());
        let bands = list(&channel["bands"]);
        assert!((1..=7).contains(&bands.len()), "{} bands", bands.len());
        for band in bands {
            let kind = band["band_type"].as_str().unwrap();
            assert!(["Curve", "VectorialWave", "Transient"].contains(&kind));
            assert_eq!(band.get("curve_type").is_some(), kind == "Curve");
            let limits =
                ["lower_frequency_limit", "upper_frequency_limit"].map(|limit| band[limit].as_u64().unwrap());
            assert!(limits[0] < limits[1]);
            let [effect] = &list(&band["effects"])[..] else { panic!("{band}") };
            assert_eq!((&effect["effect_type"], &effect["position"]), (&json!("Basis"), &json!(0)));
            let keyframes = list(&effect["keyframes"]);
            // `EvaluationBand` adds a curve of two keyframes to nothing.
            assert!(kind != "Curve" || keyframes.len() > 2);
            let positions = keyframes.iter().map(|keyframe| keyframe["relative_position"].as_u64().unwrap());
            assert!(positions.collect::<Vec<_>>().is_sorted_by(|a, b| a < b));
            for keyframe in keyframes {
                let amplitude = keyframe.get("amplitude_modulation").map(number);
                assert!(amplitude.is_none_or(|amplitude| amplitude.abs() <= 1.0));
                let frequency = keyframe.get("frequency_modulation").map(|hz| hz.as_u64().unwrap());
                assert!(frequency.is_none_or(|hz| limits[0] <= hz && hz <= limits[1]), "{keyframe}");
                assert!(amplitude.is_some() || frequency.is_some());
            }
        }
    }
}

/// `Effect::EvaluateVectorial` of the reference software, which adds up the phase from keyframe to keyframe.
fn vectorial(keyframes: &[Value], milliseconds: f64) -> f64 {
    let points = |name: &str| -> Vec<[f64; 2]> {
        let with = keyframes.iter().filter(|keyframe| keyframe.get(name).is_some());
        with.map(|keyframe| [number(&keyframe["relative_position"]), number(&keyframe[name])]).collect()
    };
    let amplitude = at_samples(&points("amplitude_modulation"), 1.0 / milliseconds, 2, linear)[1];
    let mut phase = 0.0;
    for two in points("frequency_modulation").windows(2) {
        let [[t0, f0], [t1, f1]] = [two[0], two[1]];
        if milliseconds <= t1 {
            let passed = milliseconds - t0;
            let mean = f0 + (f1 - f0) / (t1 - t0) / 2.0 * passed;
            return amplitude * (TAU * mean * passed / 1000.0 + phase).sin();
        }
        phase += PI * (t1 - t0) / 1000.0 * (f0 + f1);
    }
    panic!("no keyframe after {milliseconds} ms");
}

#[test]
fn hjif_is_decoded_as_by_the_reference_software() {
    let signal = noise(3, 200.0, |t| 1.0 + (TAU * t).sin());
    let mut file = file(&signal, Format::Hjif);
    let bands = file["perceptions"][0]["channels"][0]["bands"].as_array_mut().unwrap();
    bands.retain(|band| band["band_type"] == "VectorialWave");
    assert!(bands.len() > 2);
    let decoded = hjif::read(&file, 96_000.0, 288_000);
    let bands = list(&file["perceptions"][0]["channels"][0]["bands"]);
    for at in (1..288_000).step_by(7919) {
        let wanted: f64 = bands
            .iter()
            .map(|band| vectorial(list(&band["effects"][0]["keyframes"]), at as f64 / 96.0))
            .sum();
        assert!((decoded[at] - wanted).abs() < 0.02, "{} for {wanted} at {at}", decoded[at]);
    }
}

#[test]
fn samples_that_make_no_file_are_refused() {
    let refusal = |samples: &[f64], rate_hz: f64| encode(samples, rate_hz, "m/s2", Format::Ahap).unwrap_err();
    let mut broken = tone();
    broken[7] = f64::NAN;
    assert_eq!(refusal(&broken, RATE_HZ), PatternError::NotFinite { sample: 7 });
    assert_eq!(refusal(&[0.0; 4000], RATE_HZ), PatternError::Silent);
    assert!(matches!(refusal(&[], RATE_HZ), PatternError::Length { .. }));
    assert!(matches!(refusal(&[1.0; 199], RATE_HZ), PatternError::Length { .. }));
    for rate_hz in [0.0, 499.0, 1e6, f64::NAN, f64::INFINITY] {
        assert!(matches!(refusal(&tone(), rate_hz), PatternError::Rate { .. }));
    }
    assert_eq!(Format::of(Path::new("x.wav")), Err(PatternError::Extension));
    assert_eq!(Format::of(Path::new("x.AHAP")), Ok(Format::Ahap));
}

#[test]
fn the_shortest_and_the_strangest_vibrations_have_files() {
    let click: Vec<f64> = (0..200).map(|n| if n == 100 { 1.0 } else { 0.0 }).collect();
    let late: Vec<f64> = (0..4000).map(|n| if n == 3999 { 1e200 } else { 0.0 }).collect();
    let early: Vec<f64> = (0..4000).map(|n| if n == 0 { 1e-300 } else { 0.0 }).collect();
    for signal in
        [click, late, early, vec![1.0; 300], (0..4000).map(|n| f64::from(1 - 2 * (n % 2))).collect()]
    {
        for format in Format::ALL {
            for rate_hz in [500.0, RATE_HZ] {
                let Pattern { text, loss } = encode(&signal, rate_hz, "A", format).unwrap();
                assert!(loss.envelope_db.is_finite() && loss.full_scale > 0.0, "{format:?}: {loss:?}");
                assert!(decode(&text, format, rate_hz, signal.len()).iter().all(|y| y.is_finite()));
            }
        }
    }
}
