use super::super::ground::Ground;
use super::super::material::MaterialName;
use super::super::script::Action;
use super::super::stroke::{StrokeSettings, StrokeShape};
use super::super::terrain::Relief;
use super::*;
use crate::vector::dot;
use haptograph_signal::spectrum::welch;
use haptograph_signal::window::Window;

fn script(actions: Vec<Action>) -> ScriptSettings {
    ScriptSettings { ground: Ground::TABLE, actions, hover_m: 0.01, gives_n_per_m: f64::INFINITY }
}

fn circles(force_n: f64, period_s: f64) -> ScriptSettings {
    let shape = StrokeShape::Circles { radius_m: 0.02, period_s };
    script(vec![Action::Draw { stroke: StrokeSettings::exact(shape, force_n), duration_s: 100.0 }])
}

fn drag(name: MaterialName, script: &ScriptSettings, substeps: u32, seconds: f64) -> Vec<ToolReading> {
    drag_over(&Material::of(name), script, substeps, seconds)
}

fn drag_over(material: &Material, script: &ScriptSettings, substeps: u32, seconds: f64) -> Vec<ToolReading> {
    let mut tool = SimulatedTool::new(material, ToolGrip::of_person(1), script, substeps, 1).unwrap();
    let ticks = (seconds * TOOL_RATE_HZ) as usize;
    let readings = (0..ticks + 10_000).map(|_| {
        tool.advance();
        tool.read()
    });
    readings.skip(10_000).collect()
}

fn vibration(readings: &[ToolReading]) -> Vec<f64> {
    readings.iter().map(|r| r.specific_m_s2[2]).collect()
}

/// Root mean square above 20 Hz.
fn power(readings: &[ToolReading]) -> f64 {
    let spectrum = welch(&vibration(readings), TOOL_RATE_HZ, 4096, 2048, Window::Hann).unwrap();
    spectrum.power_between(20.0, 1000.0).sqrt()
}

#[test]
fn the_mean_forces_are_the_hands_and_the_materials() {
    for name in MaterialName::ALL {
        let readings = drag(name, &circles(1.5, 1.2), SUBSTEPS, 4.0);
        let mean_n = readings.iter().map(|r| r.force_n[2]).sum::<f64>() / readings.len() as f64;
        assert!((mean_n - 1.5).abs() < 0.15, "{name:?}: {mean_n} N");
        let dragged: f64 = readings
            .iter()
            .map(|r| {
                let [u, v, _] = r.velocity_m_s;
                -dot([r.force_n[0], r.force_n[1]], [u, v]) / norm([u, v])
            })
            .sum();
        let friction = dragged / readings.iter().map(|r| r.force_n[2]).sum::<f64>();
        assert!((friction - Material::of(name).friction).abs() < 0.03, "{name:?}: {friction}");
    }
}

#[test]
fn vibrations_grow_with_speed_and_with_force_and_with_roughness() {
    let at = |name, force_n, period_s| power(&drag(name, &circles(force_n, period_s), SUBSTEPS, 4.0));
    let (slow, fast) = (at(MaterialName::T2, 1.0, 3.0), at(MaterialName::T2, 1.0, 0.8));
    assert!(fast > 1.5 * slow, "{slow} then {fast} m/s2");
    let (light, hard) = (at(MaterialName::T2, 0.5, 1.0), at(MaterialName::T2, 2.5, 1.0));
    assert!(hard > 1.1 * light, "{light} then {hard} m/s2");
    let canvas = Material::of(MaterialName::T2);
    let rough = Material { relief: Relief { rms_m: 2.0 * canvas.relief.rms_m, ..canvas.relief }, ..canvas };
    let (smooth, rough) = (&canvas, &rough);
    let [smooth, rough] =
        [smooth, rough].map(|material| power(&drag_over(material, &circles(1.0, 1.0), SUBSTEPS, 4.0)));
    assert!(rough > 1.3 * smooth, "{smooth} and {rough} m/s2");
    for name in MaterialName::ALL {
        let rms = at(name, 1.2, 1.0);
        assert!((0.3..30.0).contains(&rms), "{name:?}: {rms} m/s2");
    }
}

#[test]
fn halving_the_step_changes_no_third_of_an_octave_by_half_a_decibel() {
    let half = 10_f64.powf(0.05);
    let centres_hz = (-40..=60).map(|k| 1000.0 * 10_f64.powf(f64::from(k) / 10.0));
    let centres_hz: Vec<f64> = centres_hz.filter(|hz| hz / half > 19.0 && hz * half < 1100.0).collect();
    for name in [MaterialName::T1, MaterialName::T3] {
        let bands = |substeps| {
            let readings = drag(name, &circles(1.2, 0.9), substeps, 8.0);
            let spectrum = welch(&vibration(&readings), TOOL_RATE_HZ, 8192, 4096, Window::Hann).unwrap();
            centres_hz.iter().map(|hz| spectrum.power_between(hz / half, hz * half)).collect::<Vec<_>>()
        };
        let (coarse, fine) = (bands(SUBSTEPS), bands(2 * SUBSTEPS));
        for ((a, b), hz) in coarse.iter().zip(&fine).zip(&centres_hz) {
            let change_db = 10.0 * (a / b).log10();
            assert!(change_db.abs() < 0.5, "{name:?}: {change_db} dB at {hz} Hz");
        }
    }
}

#[test]
fn a_lifted_tool_feels_gravity_only() {
    let hover = script(vec![Action::Hover { duration_s: 10.0 }]);
    let readings = drag(MaterialName::T1, &hover, SUBSTEPS, 0.5);
    for r in &readings {
        assert_eq!(r.force_n, ZERO);
        assert!((norm(r.specific_m_s2) - GRAVITY_M_S2).abs() < 1.5, "{:?}", r.specific_m_s2);
        assert!((r.orientation.iter().map(|q| q * q).sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn harder_materials_ring_faster_when_tapped() {
    let taps = script(vec![Action::Taps {
        count: 20,
        slowest_m_s: 0.15,
        fastest_m_s: 0.25,
        interval_s: 0.6,
        force_n: 0.5,
    }]);
    let ring_hz = |name| {
        let readings = drag(name, &taps, SUBSTEPS, 5.0);
        let spectrum = welch(&vibration(&readings), TOOL_RATE_HZ, 4096, 2048, Window::Hann).unwrap();
        let low = spectrum.frequency_hz.iter().position(|f| *f > 20.0).unwrap();
        haptograph_signal::spectrum::spectral_centroid(
            &spectrum.frequency_hz[low..400],
            &spectrum.density[low..400],
        )
    };
    let (hard, soft) = (ring_hz(MaterialName::T1), ring_hz(MaterialName::T3));
    assert!(hard > 1.2 * soft, "{hard} Hz and {soft} Hz");
}

#[test]
fn the_same_seed_is_the_same_recording() {
    let run = || drag(MaterialName::T5, &circles(1.0, 1.0), SUBSTEPS, 0.2)[1999];
    assert_eq!(run(), run());
}
