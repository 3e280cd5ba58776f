use super::*;
use crate::recording::Gesture;
use crate::recording::tests::synthetic::{self, Moment, circle, normal};
use std::f64::consts::TAU;

/// The middle of a signal, away from its ends.
fn middle(signal: &[f64]) -> &[f64] {
    &signal[signal.len() / 5..signal.len() * 4 / 5]
}

fn assert_all_near(signal: &[f64], value: f64, tolerance: f64) {
    let worst = middle(signal).iter().map(|x| (x - value).abs()).fold(0.0, f64::max);
    assert!(worst <= tolerance, "off by {worst} from {value}");
}

#[test]
fn a_circle_has_its_push_friction_and_speed() {
    let recording = circle(2.0, 0.03, 0.8, 1.3, 0.35);
    let processed = process(&recording, &ProcessingSettings::default()).unwrap();
    let signals = processed.signals();
    assert_eq!(signals.rate_hz, 10_000.0);
    assert_all_near(&signals.force_normal_n, 1.3, 1e-3);
    assert_all_near(signals.force_tangential_n.as_ref().unwrap(), 0.35 * 1.3, 2e-3);
    assert_all_near(&signals.speed_m_s, TAU * 0.8 * 0.03, 2e-4);
}

#[test]
fn the_plane_and_the_mean_force_agree_on_the_normal() {
    let recording = circle(3.0, 0.03, 1.0, 2.0, 0.3);
    let (mut forces, tips) = (WorldForces::new(&recording), tip_positions(&recording));
    for source in
        [SurfaceNormal::PlaneFit, SurfaceNormal::ForceDirection, SurfaceNormal::Given(normal().into())]
    {
        let found = geometry::surface_normal(&recording, &mut forces, &tips, source).unwrap();
        let off = norm(along(found, -1.0, normal().into()));
        assert!(off < 1e-3, "{source:?} is off by {off}");
    }
}

#[test]
fn a_straight_stroke_has_no_plane_and_says_so() {
    let recording = synthetic::raw(1.0, Gesture::Drag, 240.0, |t| Moment {
        place_m: [0.05 * (TAU * t).sin(), 0.0, 0.0],
        push_n: 1.0,
        friction_n: [0.0; 2],
        vibration_m_s2: [0.0; 3],
    });
    let error = process(&recording, &ProcessingSettings::default()).unwrap_err();
    assert!(matches!(error, ProcessingError::NoPlane { .. }), "{error}");
    let settings = ProcessingSettings { normal: SurfaceNormal::ForceDirection, ..Default::default() };
    assert_all_near(&process(&recording, &settings).unwrap().signals().force_normal_n, 1.0, 1e-3);
}

#[test]
fn tracker_noise_does_not_count_as_speed() {
    let mut noise = haptograph_signal::noise::Gaussian::new(5);
    let jittery = synthetic::raw(3.0, Gesture::Drag, 240.0, |t| {
        let angle = TAU * 0.5 * t;
        let mut jitter = || 0.144e-3 * noise.next_sample();
        Moment {
            place_m: [0.03 * angle.cos() + jitter(), 0.03 * angle.sin() + jitter(), jitter()],
            push_n: 1.0,
            friction_n: [0.0; 2],
            vibration_m_s2: [0.0; 3],
        }
    });
    let mean_error = |velocity_lowpass_hz: f64| {
        let settings = ProcessingSettings { velocity_lowpass_hz, ..Default::default() };
        let processed = process(&jittery, &settings).unwrap();
        let speed = middle(&processed.signals().speed_m_s);
        speed.iter().sum::<f64>() / speed.len() as f64 - TAU * 0.5 * 0.03
    };
    assert!(mean_error(20.0).abs() < 1e-3, "{}", mean_error(20.0));
    let as_in_the_thesis = mean_error(100.0);
    assert!(as_in_the_thesis > 2e-3, "noise should count here: {as_in_the_thesis}");
}

#[test]
fn gravity_and_slow_motion_do_not_count_as_vibration() {
    let still = synthetic::raw(2.0, Gesture::Drag, 240.0, |t| Moment {
        place_m: [0.03 * (TAU * t).cos(), 0.03 * (TAU * t).sin(), 0.0],
        push_n: 1.0,
        friction_n: [0.0; 2],
        vibration_m_s2: [2.0 * (TAU * t).sin(), 0.0, 0.0],
    });
    let processed = process(&still, &ProcessingSettings::default()).unwrap();
    assert_all_near(&processed.signals().acceleration_m_s2, 0.0, 0.01);
}

fn tones() -> [Vec<f64>; 3] {
    let tone = |frequency: f64, amplitude: f64| {
        (0..4001).map(|i| amplitude * (TAU * frequency * i as f64).sin()).collect::<Vec<_>>()
    };
    [tone(0.01, 3.0), tone(0.037, 1.0), tone(0.01, -1.0)]
}

fn energy(signal: &[f64]) -> f64 {
    signal.iter().map(|x| x * x).sum()
}

#[test]
fn dft321_keeps_the_energy_of_all_axes() {
    let axes = tones();
    let all: f64 = axes.iter().map(|axis| energy(axis)).sum();
    // Odd and even lengths.
    for length in [4001, 4000, 2, 1] {
        let cut = axes.each_ref().map(|axis| axis[..length].to_vec());
        let all: f64 = cut.iter().map(|axis| energy(axis)).sum();
        let combined = reduce(&cut, AxisReduction::Dft321).unwrap();
        assert!((energy(&combined) - all).abs() <= 1e-9 * (1.0 + all), "{length}");
    }
    assert!(all > 0.0);
}

#[test]
fn dft321_of_one_axis_is_that_axis() {
    let [x, ..] = tones();
    let combined = reduce(&[x.clone(), vec![0.0; 4001], vec![0.0; 4001]], AxisReduction::Dft321).unwrap();
    assert!(combined.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-9));
}

#[test]
fn the_other_reductions_do_what_their_names_say() {
    let axes = tones();
    let [x, y, z] = &axes;
    let at = |reduction| reduce(&axes, reduction).unwrap()[33];
    assert!((at(AxisReduction::Sum) - (x[33] + y[33] + z[33])).abs() < 1e-12);
    assert_eq!(at(AxisReduction::SingleAxis(1)), y[33]);
    assert!(
        (at(AxisReduction::VectorMagnitude) - (x[33].powi(2) + y[33].powi(2) + z[33].powi(2)).sqrt()).abs()
            < 1e-12
    );
    // The x and z axes move together, 3 to -1: that line is the principal one.
    let principal = reduce(&axes, AxisReduction::PrincipalComponent).unwrap();
    let together = (energy(x) + energy(z)).sqrt();
    assert!((energy(&principal).sqrt() / together - 1.0).abs() < 1e-3);
    assert_eq!(reduce(&axes, AxisReduction::SingleAxis(3)), None);
    assert_eq!(reduce(&[vec![1.0], vec![], vec![]], AxisReduction::Sum), None);
}

#[test]
fn the_axes_of_a_recording_can_be_combined_in_another_way() {
    let processed = process(&circle(1.0, 0.03, 1.0, 1.0, 0.3), &ProcessingSettings::default()).unwrap();
    let signals = processed.signals();
    let axes = signals.axes_m_s2.as_ref().unwrap();
    for reduction in [AxisReduction::Sum, AxisReduction::PrincipalComponent, AxisReduction::VectorMagnitude] {
        let settings = ProcessingSettings { reduction, ..Default::default() };
        let other = combined(axes, signals.rate_hz, &settings).unwrap();
        assert_ne!(other, signals.acceleration_m_s2);
    }
    let settings = ProcessingSettings { reduction: AxisReduction::SingleAxis(5), ..Default::default() };
    assert_eq!(combined(axes, signals.rate_hz, &settings), Err(ProcessingError::Axis(5)));
}

#[test]
fn a_lower_rate_keeps_what_it_can_carry() {
    use crate::recording::tests::synthetic::drag;
    let steps = [(0.5, 0.05, 1.0), (0.5, 0.15, 2.0)];
    // A resonance at 100 Hz.
    let whole = drag(&steps, 0.3, 1, |_, _| (vec![-1.96, 0.9643], 0.1));
    let at = |rate_hz: f64| {
        let settings = ProcessingSettings { rate_hz: Some(rate_hz), ..Default::default() };
        processed(&AnyRecording::Processed(whole.clone()), &settings)
    };
    let slow = at(1000.0).unwrap();
    assert_eq!((slow.rate_hz(), slow.samples()), (1000.0, whole.samples() / 10));
    let power = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64;
    let ratio = power(&slow.signals().acceleration_m_s2) / power(&whole.signals().acceleration_m_s2);
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    let (fast, slow) = (whole.signals(), slow.signals());
    for k in 0..slow.speed_m_s.len() {
        assert!((slow.speed_m_s[k] - fast.speed_m_s[10 * k]).abs() < 1e-12);
        assert!((slow.force_normal_n[k] - fast.force_normal_n[10 * k]).abs() < 1e-12);
    }
    assert_eq!(at(10_000.0).unwrap(), whole);
    for rate_hz in [50.0, 20_000.0, f64::NAN] {
        assert!(matches!(at(rate_hz), Err(ProcessingError::Rate { .. })), "{rate_hz}");
    }
}
