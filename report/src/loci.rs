//! Loci of the poles of interpolated models (Fig. 2.9): with coefficients they may leave the unit circle,
//! with line spectral frequencies they cannot.

use super::page::figures_of;
use super::plot::{Axis, Mark, Plot, Style, Weight};
use super::scale::plain;
use super::theme::Ink;
use haptograph_surfaces::lsf::lsf_to_ar;
use haptograph_surfaces::resampling::poles;
use haptograph_surfaces::{ArmaModel, TextureModel, VertexKind};
use std::f64::consts::TAU;

/// Steps along each side of the triangle.
const STEPS: usize = 24;

/// Both loci around the triangle in which they differ most, or a sentence if they do not differ.
pub(super) fn section(texture: &TextureModel) -> String {
    let models = |triangle: &[u32; 3]| triangle.map(|vertex| &texture.models()[vertex as usize]);
    let inside = |triangle: &&[u32; 3]| models(triangle).iter().all(|at| at.kind != VertexKind::Edge);
    let of = |triangle: &[u32; 3]| {
        let models = models(triangle).map(|at| &at.model);
        let paths = both_loci(&models);
        (apart(&paths, models[0].ar().len()), models, paths)
    };
    let loci = texture.triangles().iter().filter(inside).map(of);
    let Some((apart, models, paths)) = loci.max_by(|a, b| a.0.total_cmp(&b.0)) else {
        return "<p>No triangle lies inside the map.</p>".to_owned();
    };
    if apart < SEEN {
        return format!(
            "<p>Between the models of this map, poles interpolated by coefficients and by line spectral frequencies are less than {SEEN} \
             apart: both ways give the same filters.</p>"
        );
    }
    let own: Vec<(f64, f64)> = models.iter().flat_map(|model| places(model.ar(), model.warping())).collect();
    let [by_coefficients, by_frequencies] = paths;
    let pair = [plot("Coefficients", &by_coefficients, &own), plot("Frequencies", &by_frequencies, &own)];
    let figures = figures_of(&pair);
    let axis = match texture.warping() {
        0.0 => String::new(),
        warping => format!(
            " The models' frequency axis is warped by {warping:.3}; the plotted poles are those of the filters on the unwarped \
             axis."
        ),
    };
    format!(
        "<p>Poles along the sides of the triangle in which the two methods differ most (by {}); the corners are models. They are \
         interpolated by their coefficients, which may leave the circle, and by their line spectral frequencies, which never do.{axis}</p>\
         <div class=\"pair\">{figures}</div>",
        plain(apart)
    )
}

/// Smallest visible distance between poles.
const SEEN: f64 = 0.02;

/// Largest distance of a pole of one method from the nearest pole of the other at the same position.
fn apart([a, b]: &[Vec<(f64, f64)>; 2], order: usize) -> f64 {
    let nearest = |(x, y): (f64, f64), others: &[(f64, f64)]| {
        let distances = others.iter().map(|other| (x - other.0).hypot(y - other.1));
        distances.fold(f64::INFINITY, f64::min)
    };
    let places = a.chunks(order.max(1)).zip(b.chunks(order.max(1)));
    places
        .flat_map(|(a, b)| a.iter().map(|pole| nearest(*pole, b)))
        .filter(|distance| distance.is_finite())
        .fold(0.0, f64::max)
}

#[derive(Debug, Clone, Copy)]
enum Interpolation {
    Coefficients,
    Frequencies,
}

/// Poles around the triangle by coefficients and by line spectral frequencies.
pub(super) fn both_loci(models: &[&ArmaModel; 3]) -> [Vec<(f64, f64)>; 2] {
    [Interpolation::Coefficients, Interpolation::Frequencies].map(|by| around(models, by))
}

/// Poles of the interpolated models along the three sides.
fn around(models: &[&ArmaModel; 3], by: Interpolation) -> Vec<(f64, f64)> {
    let mixes = (0..3).flat_map(|side| (0..STEPS).map(move |step| (side, step as f64 / STEPS as f64)));
    mixes
        .flat_map(|(side, part)| {
            let mixed = mix(models[side], models[(side + 1) % 3], part, by);
            places(&mixed, models[side].warping())
        })
        .collect()
}

fn mix(a: &ArmaModel, b: &ArmaModel, part: f64, by: Interpolation) -> Vec<f64> {
    let between =
        |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a + part * (b - a)).collect() };
    match by {
        Interpolation::Coefficients => between(a.ar(), b.ar()),
        Interpolation::Frequencies => {
            let mut ar = vec![0.0; a.ar().len()];
            let converted = lsf_to_ar(&between(a.ar_lsf(), b.ar_lsf()), &mut ar);
            converted.map_or_else(|_| Vec::new(), |()| ar)
        }
    }
}

/// The poles of `1 / A(D(z))` in z: the all-pass maps a root zeta of A to (zeta + l) / (1 + l zeta).
pub(super) fn places(ar: &[f64], warping: f64) -> Vec<(f64, f64)> {
    poles(ar)
        .unwrap_or_default()
        .iter()
        .map(|root| (root + warping) / (root * warping + 1.0))
        .map(|pole| (pole.re, pole.im))
        .collect()
}

fn radius(places: &[(f64, f64)]) -> f64 {
    places.iter().fold(0.0, |most, (x, y)| x.hypot(*y).max(most))
}

fn plot(title: &str, path: &[(f64, f64)], own: &[(f64, f64)]) -> Plot {
    let circle = (0..=180).map(|i| (TAU * f64::from(i) / 180.0).sin_cos()).collect();
    Plot {
        title: title.into(),
        note: format!("largest radius {:.4}", radius(path)),
        x: Axis::of("Real part (1)").over(-1.1, 1.1),
        y: Axis::of("Imaginary part (1)").over(-1.1, 1.1),
        marks: vec![
            Mark::Line(Style::named(Ink::Grey, "unit circle"), circle),
            Mark::Dots(Style::named(Ink::Orange, "between").weight(Weight::Hair), path.to_vec()),
            Mark::Dots(Style::named(Ink::Blue, "models"), own.to_vec()),
        ],
        size: (384.0, 378.0),
        aspect: Some(1.0),
        caption: "A pole outside of the circle makes the filter unstable.".to_owned(),
    }
}
