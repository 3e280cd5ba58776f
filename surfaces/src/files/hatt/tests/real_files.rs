//! The toolkit's own files, which may not be redistributed: read where `HATT_DIR` names the folder they are in.

use crate::files::{load, read_surface};
use crate::lsf;
use crate::triangulation::delaunay;
use crate::{Surface, TextureModel, VertexKind};

#[path = "../../../../../tests/skip/hatt.rs"]
mod toolkit;

pub(crate) use toolkit::{AT_1_KHZ, AT_10_KHZ, hatt_files};

fn textures(folder: &str) -> Vec<TextureModel> {
    hatt_files(folder).iter().map(|file| load(file).unwrap().texture.unwrap()).collect()
}

#[derive(Debug, PartialEq)]
struct Range {
    min: f64,
    median: f64,
    max: f64,
}

fn range(values: impl Iterator<Item = f64>) -> Range {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    Range {
        min: values[0],
        median: 0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2]),
        max: values[values.len() - 1],
    }
}

fn three(min: f64, median: f64, max: f64) -> Range {
    Range { min, median, max }
}

#[test]
fn the_models_are_as_documented() {
    for (folder, rate_hz) in [(AT_10_KHZ, 10_000.0), (AT_1_KHZ, 1000.0)] {
        let textures = textures(folder);
        if textures.is_empty() {
            return;
        }
        assert!(textures.iter().all(|texture| texture.rate_hz() == rate_hz));
        let count = |texture: &TextureModel, kind: VertexKind| {
            texture.models().iter().filter(|at| at.kind == kind).count() as f64
        };
        assert_eq!(range(textures.iter().map(|t| t.models().len() as f64)), three(25.0, 34.0, 57.0));
        let edges = range(textures.iter().map(|t| count(t, VertexKind::Edge)));
        assert_eq!((edges.min, edges.max), (18.0, 26.0));
        assert_eq!(range(textures.iter().map(|t| t.triangles().len() as f64)), three(28.0, 43.0, 88.0));
        assert_eq!(textures.iter().map(|t| t.models().len()).sum::<usize>(), 3537);
        assert_eq!(textures.iter().map(|t| t.triangles().len()).sum::<usize>(), 4570);
        assert_eq!(range(textures.iter().map(|t| t.ar_order() as f64)), three(14.0, 19.0, 20.0));
        let ma_order = |texture: &TextureModel| {
            if rate_hz == 1000.0 { texture.ar_order() - 2 } else { 0 }
        };
        assert!(textures.iter().all(|texture| texture.ma_order() == ma_order(texture)));
        let speeds = range(textures.iter().map(|t| (1000.0 * t.max_speed_m_s()).round()));
        assert_eq!((speeds.min, speeds.max), (133.0, 336.0));
        let forces = range(textures.iter().map(|t| t.max_force_n()));
        assert_eq!(((forces.min * 100.0).round(), (forces.max * 100.0).round()), (126.0, 842.0));
    }
}

#[test]
fn every_triangulation_is_delaunay_among_z_scores() {
    for texture in textures(AT_10_KHZ) {
        let points: Vec<_> = texture.models().iter().map(|at| (at.speed_m_s, at.force_n)).collect();
        let sorted = |triangles: &[[u32; 3]]| {
            let mut triangles = triangles.to_vec();
            triangles.iter_mut().for_each(|triangle| triangle.sort_unstable());
            triangles.sort_unstable();
            triangles
        };
        assert_eq!(sorted(&delaunay(&points).unwrap()), sorted(texture.triangles()));
    }
}

#[test]
fn frequencies_and_coefficients_agree_both_ways() {
    let (mut worst_ar, mut worst_lsf, mut smallest_gap) = (0.0_f64, 0.0_f64, f64::INFINITY);
    for texture in textures(AT_10_KHZ) {
        for at in texture.models() {
            let (ar, stored) = (at.model.ar(), at.model.ar_lsf());
            let mut frequencies = vec![0.0; ar.len()];
            lsf::ar_to_lsf(ar, &mut frequencies).unwrap();
            worst_lsf = stored.iter().zip(&frequencies).map(|(a, b)| (a - b).abs()).fold(worst_lsf, f64::max);
            let mut back = vec![0.0; ar.len()];
            lsf::lsf_into_ar(&frequencies, &mut back);
            worst_ar = ar.iter().zip(&back).map(|(a, b)| (a - b).abs()).fold(worst_ar, f64::max);
            smallest_gap = stored.windows(2).map(|pair| pair[1] - pair[0]).fold(smallest_gap, f64::min);
        }
    }
    if smallest_gap.is_finite() {
        assert!(worst_ar < 1e-11, "{worst_ar:e}");
        // Six decimals in the file.
        assert!(worst_lsf < 0.6e-6, "{worst_lsf:e}");
        assert!((smallest_gap - 0.0086).abs() < 1e-4);
    }
}

#[test]
fn the_largest_pole_radius_is_as_documented() {
    let textures = textures(AT_10_KHZ);
    let radius = textures
        .iter()
        .flat_map(|texture| texture.models())
        .flat_map(|at| crate::resampling::roots::of_monic(at.model.ar()).unwrap())
        .map(|root| root.norm());
    if !textures.is_empty() {
        assert!((radius.fold(0.0, f64::max) - 0.9986).abs() < 5e-5);
    }
}

#[test]
fn the_taps_are_as_documented() {
    let surfaces: Vec<Surface> = hatt_files("Taps").iter().map(|file| load(file).unwrap()).collect();
    if surfaces.is_empty() {
        return;
    }
    let taps: Vec<_> = surfaces.iter().map(|surface| surface.taps.as_ref().unwrap()).collect();
    assert!(taps.iter().all(|taps| taps.length() == 100));
    let counts = range(taps.iter().map(|taps| taps.taps().len() as f64));
    assert_eq!((counts.min, counts.max), (9.0, 15.0));
    let speeds = range(taps.iter().flat_map(|taps| taps.taps()).map(|tap| 1000.0 * tap.speed_m_s));
    assert_eq!(((speeds.min * 100.0).round(), speeds.max.round()), (97.0, 510.0));
    let peak = |taps: &crate::Taps| {
        let samples = taps.taps().iter().flat_map(|tap| &tap.acceleration_m_s2);
        samples.fold(0.0_f64, |peak, a| peak.max(a.abs()))
    };
    let peaks = range(taps.iter().map(|taps| peak(taps).round()));
    assert_eq!((peaks.min, peaks.max), (37.0, 194.0));
}

#[test]
fn written_again_they_are_the_same_surface() {
    for file in hatt_files(AT_10_KHZ).iter().chain(&hatt_files(AT_1_KHZ)) {
        let surface = load(file).unwrap();
        let mut again = read_surface(super::write_models(&surface).unwrap().as_bytes()).unwrap();
        assert_eq!(again, surface);
        again = read_surface(crate::files::native::write(&surface).as_bytes()).unwrap();
        assert_eq!(again, surface);
    }
    for file in hatt_files("Taps") {
        let surface = load(&file).unwrap();
        let again = read_surface(super::write_taps(&surface).unwrap().as_bytes()).unwrap();
        assert_eq!(again.taps, surface.taps);
    }
}
