//! What the shipped surfaces render over the whole force-speed plane.

#![allow(clippy::unwrap_used)]

use haptograph_signal::warped::power_gain;
use haptograph_surfaces::interpolation::{Coefficients, Interpolator};
use haptograph_surfaces::{TextureModel, files};
use nalgebra::{DMatrix, DVector};
use std::path::Path;

fn rendered_power(map: &mut Interpolator, speed_m_s: f64, force_n: f64) -> f64 {
    let mut mix = Coefficients::SILENCE;
    map.interpolate(speed_m_s, force_n, &mut mix);
    mix.variance * power_gain(mix.ar(), mix.warping).unwrap()
}

/// The constant and the exponents of speed and force of the power law through a texture's models.
fn power_law(texture: &TextureModel) -> DVector<f64> {
    let moving = |at: &&haptograph_surfaces::ModelAt| at.speed_m_s > 0.005 && at.force_n > 0.1;
    let models: Vec<_> = texture.models().iter().filter(moving).collect();
    let rows = DMatrix::from_fn(models.len(), 3, |row, column| match column {
        0 => 1.0,
        1 => models[row].speed_m_s.ln(),
        _ => models[row].force_n.ln(),
    });
    let powers = DVector::from_fn(models.len(), |row, _| models[row].model.power().ln());
    rows.svd(true, true).solve(&powers, 1e-12).unwrap()
}

#[test]
fn no_moving_contact_is_twenty_decibels_below_the_law_of_a_shipped_surface() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/surfaces");
    let mut surfaces = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "ron") {
            continue;
        }
        surfaces += 1;
        let surface = files::load(&path).unwrap();
        let texture = surface.texture.unwrap();
        let law = power_law(&texture);
        let mut map = Interpolator::new(&texture);
        for k in 0..2500 {
            let (across, along) = (f64::from(k % 50) / 49.0, f64::from(k / 50) / 49.0);
            let speed_m_s = 0.0051 + across * (texture.max_speed_m_s() - 0.0051);
            let force_n = 0.101 + along * (texture.max_force_n() - 0.101);
            let expected = (law[0] + law[1] * speed_m_s.ln() + law[2] * force_n.ln()).exp();
            let power = rendered_power(&mut map, speed_m_s, force_n);
            assert!(
                power > 0.01 * expected,
                "{} at {speed_m_s} m/s and {force_n} N: {power} of {expected}",
                path.display()
            );
        }
    }
    assert_eq!(surfaces, 6);
}
