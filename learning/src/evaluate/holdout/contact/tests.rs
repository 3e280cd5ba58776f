use super::super::super::RecordingName;
use super::*;
use crate::recording::tests::synthetic::{Moment, drag, raw};

fn take(recording: AnyRecording, number: u64) -> Take {
    let name = RecordingName { material: "m".into(), person: "p".into(), take: number.to_string() };
    Take { name, recording }
}

fn held_out(recordings: Vec<AnyRecording>) -> Vec<ContactResult> {
    let takes: Vec<Take> =
        recordings.into_iter().zip(0..).map(|(recording, number)| take(recording, number)).collect();
    hold_out_contact(&takes, &ProcessingSettings::default())
}

/// The mean errors by method.
fn errors(found: &[ContactResult], contact: Contact, split: &str) -> Vec<f64> {
    let result = found
        .iter()
        .find(|result| (result.contact, result.split) == (contact, split))
        .expect("there is such a result");
    assert_eq!(result.materials, ["m"]);
    assert_eq!(result.loses, result.means[contact.plain()].iter().any(|m| m.mean < result.means[0].mean));
    result.means.iter().map(|m| m.mean).collect()
}

#[test]
fn friction_that_is_a_coefficient_is_told_and_one_that_is_not_is_seen() {
    let steps: Vec<_> =
        (0..16).map(|i| (0.1, 0.05 + 0.02 * f64::from(i % 4), 0.4 + 0.1 * f64::from(i))).collect();
    let coulomb = AnyRecording::Processed(drag(&steps, 0.3, 1, |_, _| (vec![], 1.0)));
    let found = held_out(vec![coulomb]);
    for split in ["harder", "lighter", "faster", "slower"] {
        for error in errors(&found, Contact::DragFriction, split) {
            assert!(error < 1e-6, "{split}: {error}");
        }
    }
    // Tangential force grows more slowly than normal force: low forces overestimate high ones.
    let moment = |normal_n: f64| Sliding { normal_n, tangential_n: 0.3 * normal_n.powf(0.8), speed_m_s: 0.1 };
    let part =
        |from: u32| -> Vec<Sliding> { (from..from + 20).map(|i| moment(0.1 * f64::from(i))).collect() };
    let found = friction_errors(&part(1), &part(21), &[FrictionFit::ThroughOrigin]).expect("it is fitted");
    // 0.3 f^0.8 over 0.3 f: a coefficient learned up to 2 N, tested at 3 N.
    assert!(found.iter().all(|error| (5.0..60.0).contains(error)), "{found:?}");
    assert!(found[0] < found[1], "large forces count in a line: {found:?}");
}

/// Taps of one shape, their amplitude a power of the speed.
fn growing(power: f64, speeds_m_s: &[f64]) -> Vec<Tap> {
    let tap = |&speed_m_s: &f64| Tap {
        speed_m_s,
        acceleration_m_s2: (0..50)
            .map(|k| speed_m_s.powf(power) * (0.8 * f64::from(k)).sin() * (-0.1 * f64::from(k)).exp())
            .collect(),
        peak_force_n: None,
    };
    speeds_m_s.iter().map(tap).collect()
}

#[test]
fn taps_that_grow_as_a_method_says_are_told_and_others_are_off_by_what_they_grow() {
    let train = |power: f64| Taps::new(1000.0, growing(power, &[0.1, 0.2])).expect("taps");
    let db = |ratio: f64| 20.0 * ratio.log10().abs();
    // Proportional to speed: exact between and below, and for the nearest tap scaled by speed.
    for speed in [0.15, 0.05] {
        let (shape, level) = tap_errors(&train(1.0), &growing(1.0, &[speed]));
        for errors in [shape, level] {
            assert!(errors[0] < 1e-9 && errors[1] < 1e-9, "{speed}: {errors:?}");
        }
    }
    // As speed^0.7: exact above, where the nearest tap scaled by speed is too loud.
    let (shape, level) = tap_errors(&train(0.7), &growing(0.7, &[0.4]));
    let excess = 2_f64.powf(0.3);
    assert!(shape[0] < 1e-9 && level[0] < 1e-9, "{shape:?} {level:?}");
    assert!((shape[1] - 100.0 * (excess - 1.0)).abs() < 1e-9, "{shape:?}");
    assert!((level[1] - db(excess)).abs() < 1e-9, "{level:?}");
    // The mean of both recorded taps is the same at any speed.
    let mean = f64::midpoint(0.25_f64.powf(0.7), 0.5_f64.powf(0.7));
    assert!((shape[2] - 100.0 * (1.0 - mean)).abs() < 1e-9, "{shape:?}");
    assert!((level[2] - db(mean)).abs() < 1e-9, "{level:?}");
    // For several tested taps the mean error counts.
    let (_, both) = tap_errors(&train(0.7), &growing(0.7, &[0.4, 0.8]));
    let (_, further) = tap_errors(&train(0.7), &growing(0.7, &[0.8]));
    assert!((both[0] - 0.5 * further[0]).abs() < 1e-9 && further[0] > 0.1, "{both:?}");
}

#[test]
fn a_spring_is_told_whole_and_a_stiffening_contact_is_seen_beyond_what_was_learned() {
    let press = |power: f64| {
        AnyRecording::Raw(raw(10.0, Gesture::Press, 60.0, |t| {
            let push_n = if t < 5.0 { t } else { 10.0 - t };
            Moment {
                place_m: [0.0, 0.0, -1e-4 * push_n.powf(power)],
                push_n,
                friction_n: [0.0; 2],
                vibration_m_s2: [0.0; 3],
            }
        }))
    };
    let spring = held_out(vec![press(1.0)]);
    for split in ["harder", "lighter"] {
        for error in errors(&spring, Contact::Stiffness, split) {
            assert!(error < 0.5, "{split}: {error}");
        }
    }
    assert!(spring.iter().all(|result| result.split != "another"), "one press has no other");
    // Force as depth^1.5: softer below, stiffer above.
    let hertz = held_out(vec![press(2.0 / 3.0), press(2.0 / 3.0)]);
    let harder = errors(&hertz, Contact::Stiffness, "harder");
    assert!((10.0..40.0).contains(&harder[0]) && harder[0] < harder[1], "{harder:?}");
    let another = errors(&hertz, Contact::Stiffness, "another");
    assert!(another[1] <= another[0], "the line through all is the least one: {another:?}");
}

#[test]
fn recordings_that_nothing_can_be_learned_from_have_no_result() {
    let in_air = AnyRecording::Processed(drag(&[(1.0, 0.1, 0.01)], 0.3, 1, |_, _| (vec![], 1.0)));
    assert!(held_out(vec![in_air]).is_empty());
    assert!(hold_out_contact(&[], &ProcessingSettings::default()).is_empty());
}
