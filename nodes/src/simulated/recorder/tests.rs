use super::*;
use crate::vector::norm;
use haptograph_surfaces::learning::processing::{ProcessingSettings, process};

fn session(material: MaterialName, gesture: Gesture) -> Session {
    Session { material, gesture, person: 1, seconds: 6.0, seed: 1 }
}

#[test]
fn a_recording_has_its_rates_and_says_that_it_is_simulated() {
    let recording = record(&session(MaterialName::T2, Gesture::Drag)).unwrap();
    assert_eq!(recording.acceleration_v().samples.len(), 60_000);
    assert_eq!(recording.wrench().samples.len(), 60_000);
    assert_eq!(recording.motion().samples.len(), 1440);
    assert_eq!(recording.provenance().origin, Origin::Simulated);
    assert_eq!(recording.provenance().settings["material"], "T2");
}

#[test]
fn processed_it_shows_the_forces_speeds_and_frictions_that_were_simulated() {
    for name in [MaterialName::T1, MaterialName::T5] {
        let recording = record(&session(name, Gesture::Circle)).unwrap();
        let processed = process(&recording, &ProcessingSettings::default()).unwrap();
        let signals = processed.signals();
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        let (normal_n, speed_m_s) = (mean(&signals.force_normal_n), mean(&signals.speed_m_s));
        assert!((0.6..2.0).contains(&normal_n), "{normal_n} N");
        assert!((0.05..0.3).contains(&speed_m_s), "{speed_m_s} m/s");
        let friction = mean(signals.force_tangential_n.as_ref().unwrap()) / normal_n;
        assert!((friction - Material::of(name).friction).abs() < 0.05, "{name:?}: {friction}");
    }
}

#[test]
fn free_exploration_covers_speeds_and_forces() {
    let processed =
        process(&record(&session(MaterialName::T4, Gesture::Drag)).unwrap(), &ProcessingSettings::default()).unwrap();
    let spread = |x: &[f64]| {
        let mut x = x.to_vec();
        x.sort_by(f64::total_cmp);
        (x[x.len() / 20], x[x.len() * 19 / 20])
    };
    let (slow, fast) = spread(&processed.signals().speed_m_s);
    let (light, hard) = spread(&processed.signals().force_normal_n);
    assert!(slow < 0.05 && fast > 0.12, "{slow} to {fast} m/s");
    assert!(light < 0.8 && hard > 1.6, "{light} to {hard} N");
}

#[test]
fn taps_and_presses_touch_as_asked() {
    let forces = |gesture| -> Vec<f64> {
        let recording = record(&session(MaterialName::T1, gesture)).unwrap();
        recording.wrench().samples.iter().map(|w| norm(w.force_n)).collect()
    };
    let taps = forces(Gesture::Tap).windows(2).filter(|w| w[0] < 0.15 && w[1] >= 0.15).count();
    assert!((6..60).contains(&taps), "{taps} onsets in 6 s");
    let press = forces(Gesture::Press).into_iter().fold(0.0, f64::max);
    assert!(press > 3.5, "{press} N");
}

#[test]
fn people_differ_and_a_session_repeats_to_the_bit() {
    let short = Session { seconds: 0.5, ..session(MaterialName::T3, Gesture::Drag) };
    let once = record(&short).unwrap();
    assert_eq!(once, record(&short).unwrap());
    assert_ne!(once, record(&Session { person: 2, ..short }).unwrap());
    assert_ne!(once, record(&Session { seed: 2, ..short }).unwrap());
}

#[test]
#[ignore = "prints the time of a minute of recording"]
fn a_minute_is_recorded_in_seconds() {
    let start = std::time::Instant::now();
    record(&Session { seconds: 60.0, ..session(MaterialName::T1, Gesture::Drag) }).unwrap();
    #[allow(clippy::print_stderr)]
    {
        eprintln!("a minute recorded in {:.2} s", start.elapsed().as_secs_f64());
    }
}

#[test]
fn a_session_without_time_is_refused() {
    let none = Session { seconds: 0.0, ..session(MaterialName::T1, Gesture::Drag) };
    assert!(matches!(record(&none), Err(SessionError::Length { .. })));
}
