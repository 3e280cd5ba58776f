use super::*;
use haptograph_learning::learn::{LearnSettings, learn};
use haptograph_learning::recording::{AnyRecording, Gesture, Signals};
use haptograph_signal::noise::Gaussian;
use haptograph_surfaces::{ArmaModel, ModelAt, Provenance, TextureModel};

/// Nine segments of different speeds and forces.
pub(crate) fn drag(person: u64, ring: f64) -> AnyRecording {
    let mut noise = Gaussian::new(person);
    let mut y = [0.0; 2];
    let mut signals = Signals { rate_hz: 10_000.0, force_tangential_n: Some(vec![]), ..Signals::default() };
    for i in 0..18_000 {
        let stretch = i / 2000;
        let (speed, force) = (0.05 + 0.05 * ((stretch * 2) % 3) as f64, 0.5 + 0.5 * (stretch / 3) as f64);
        let next = ring * y[0] - 0.8 * y[1] + 5.0 * speed * force * noise.next_sample();
        y = [next, y[0]];
        signals.acceleration_m_s2.push(next);
        signals.speed_m_s.push(speed);
        signals.force_normal_n.push(force);
        signals.force_tangential_n.as_mut().unwrap().push(0.4 * force + 0.01 * noise.next_sample());
    }
    let provenance = Provenance::new(Origin::Simulated, "made up <for> a test");
    AnyRecording::Processed(ProcessedRecording::new(signals, Gesture::Drag, provenance).unwrap())
}

pub(crate) fn learned(name: &str, ring: f64) -> (Surface, LearningReport) {
    learn(name, &[drag(1, ring)], &LearnSettings::default(), &|_| ()).unwrap()
}

#[test]
fn a_page_has_a_figure_for_each_part_and_says_what_is_simulated() {
    let (surface, report) = learned("felt & fur", 1.2);
    let page = page(&surface, &report);
    for shown in [
        "felt &amp; fur",
        "class=\"badge\">simulated",
        "made up &lt;for&gt; a test",
        "Models over speed and force",
        "line spectral frequencies",
        "Mean spectra",
        "mu = 0.4",
        "Where the conditions are on the map",
        "texture.method",
    ] {
        assert!(page.contains(shown), "{shown} is missing");
    }
    assert!(!page.contains("<h2>Taps</h2>") && !page.contains("<h2>Stiffness</h2>"));
    assert!(!page.contains("NaN") && !page.contains("src=\"http"));
}

#[test]
fn a_pair_marks_the_simulated_one_and_a_unit_that_is_not_known_is_not_called_another() {
    let (mut surface, report) = learned("felt", 1.2);
    let marks = |page: &str| {
        let note = |name: &str| page.contains(&format!("<b>{name}</b> <span class=\"note\">simulated"));
        [note("recorded"), note("synthesised"), page.contains("Vibration (m/s²)")]
    };
    assert_eq!(marks(&page(&surface, &report)), [true, false, true]);
    surface.provenance.origin = Origin::Measured;
    surface.provenance.settings.insert(format!("recording 1 {VIBRATION_UNIT}"), "not known".to_owned());
    assert_eq!(marks(&page(&surface, &report)), [false, false, false]);
}

/// Pairs of sharp resonances. The mean of the coefficients of two of them is unstable.
fn resonances() -> [ArmaModel; 3] {
    let resonance = |angles: [f64; 2]| {
        let lsf: Vec<f64> = angles.iter().flat_map(|angle| [angle - 0.001, angle + 0.001]).collect();
        ArmaModel::from_lsf(&lsf, &[], 1.0, 1.0).unwrap()
    };
    [[0.2, 1.0], [2.0, 2.9], [0.5, 2.5]].map(resonance)
}

#[test]
fn frequencies_keep_poles_inside_the_circle_where_coefficients_do_not() {
    let models = resonances();
    let models = [&models[0], &models[1], &models[2]];
    let [coefficients, frequencies] = crate::loci::both_loci(&models)
        .map(|path| path.iter().fold(0.0_f64, |most, (x, y)| most.max(x.hypot(*y))));
    assert!(coefficients > 1.0 && frequencies < 1.0, "{coefficients} {frequencies}");
}

/// A learned map with other models; silent where it is silent.
fn with_models(model: impl Fn(usize) -> ArmaModel) -> TextureModel {
    let texture = learned("felt", 1.2).0.texture.unwrap();
    let models = texture.models().iter().enumerate().map(|(vertex, at)| {
        let variance = at.model.variance();
        ModelAt { model: model(vertex).with_variance(variance).unwrap(), ..at.clone() }
    });
    TextureModel::new(texture.rate_hz(), models.collect(), texture.triangles().to_vec()).unwrap()
}

#[test]
fn poles_are_drawn_where_the_two_ways_differ_and_only_there() {
    let [one, ..] = resonances();
    let is_drawn = |texture: &TextureModel| crate::loci::section(texture).contains("<svg");
    assert!(is_drawn(&with_models(|vertex| resonances()[vertex % 3].clone())));
    // One model everywhere leaves nothing between models.
    assert!(!is_drawn(&with_models(|_| one.clone())));
}

/// The denominator of the filter is zero at its poles.
#[test]
fn poles_of_a_warped_model_are_those_of_its_filter() {
    use haptograph_signal::Complex64;
    let (ar, warping) = ([-0.9, 0.7, 0.2, -0.1], 0.8);
    let places = crate::loci::places(&ar, warping);
    assert_eq!(places.len(), 4);
    for (re, im) in places {
        let z = Complex64::new(re, im);
        let all_pass = (z.inv() - warping) / (-z.inv() * warping + 1.0);
        let denominator = ar.iter().rev().fold(Complex64::ZERO, |sum, a| (sum + a) * all_pass) + 1.0;
        assert!(z.norm() < 1.0 && denominator.norm() < 1e-9, "{denominator}");
    }
}
