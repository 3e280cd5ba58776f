//! The real-time kernels of a texture beside the plain way to do the same: outputs compared, then timed in turns,
//! medians of each.
//!
//! `cargo bench -p haptograph-surfaces --bench models`; with `-- --ratios` the comparisons alone.

#[path = "../../benches/contest/mod.rs"]
mod contest;

use contest::Work;
use criterion::{Criterion, Throughput};
use haptograph_signal::Complex64;
use haptograph_signal::warped::power_gain;
use haptograph_surfaces::hull::Hull;
use haptograph_surfaces::lsf::{ar_to_lsf, lsf_to_ar};
use haptograph_surfaces::{
    ArmaModel, Coefficients, Interpolator, ModelAt, ModelError, TextureModel, VertexKind,
};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use spade::{DelaunayTriangulation, HasPosition, Point2, PositionInTriangulation, Triangulation};
use std::f64::consts::{PI, TAU};
use std::hint::black_box;

const ORDER: usize = 20;
/// Points of a stroke, a call works on all.
const POINTS: usize = 2000;
/// Turns each contender gets.
const TURNS: usize = 51;

fn main() {
    ratios();
    if std::env::args().any(|arg| arg == "--ratios") {
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    regressions(&mut criterion);
    criterion.final_summary();
}

fn calls(title: &str, units: usize) -> Work<'_> {
    Work { title, unit: "call", units, turns: TURNS }
}

fn ratios() {
    let texture = texture();
    for (name, path) in [("along a smooth stroke", stroke()), ("jumping about", jumps())] {
        locate(name, &texture, &path);
        update(name, &texture, &path);
    }
    warped_update();
    to_ar();
    to_lsf();
}

/// A map of 34 models of order 20 and about 44 triangles, the toolkit's median.
fn texture() -> TextureModel {
    texture_of(|lsf, variance| ArmaModel::from_lsf(lsf, &[], 1.0, variance))
}

fn texture_of(model: impl Fn(&[f64], f64) -> Result<ArmaModel, ModelError>) -> TextureModel {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let measured = (0..14)
        .map(|_| ModelAt {
            speed_m_s: random.random_range(0.01..0.24),
            force_n: random.random_range(0.1..3.9),
            model: model(&frequencies(&mut random), random.random_range(0.01..1.0))
                .expect("ascending frequencies are a model"),
            kind: VertexKind::Measured,
        })
        .collect();
    TextureModel::from_measured(10_000.0, measured, &Hull::default()).expect("these models make a map")
}

fn frequencies(random: &mut Xoshiro256PlusPlus) -> Vec<f64> {
    let step = PI / (ORDER as f64 + 1.0);
    (1..=ORDER).map(|k| step * (k as f64 + random.random_range(-0.4..0.4))).collect()
}

/// Circles of a hand: speed and force at 240 Hz.
fn stroke() -> Vec<(f64, f64)> {
    let at = |k: usize| {
        let time_s = k as f64 / 240.0;
        (0.12 + 0.1 * (TAU * 1.3 * time_s).sin(), 1.9 + 1.5 * (TAU * 0.7 * time_s).cos())
    };
    (0..POINTS).map(at).collect()
}

fn jumps() -> Vec<(f64, f64)> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
    (0..POINTS).map(|_| (random.random_range(0.001..0.2), random.random_range(0.01..3.0))).collect()
}

/// The map as spade has it.
struct Plain {
    mesh: DelaunayTriangulation<Vertex>,
    scale: (f64, f64),
    hint: spade::handles::FixedVertexHandle,
}

struct Vertex {
    position: Point2<f64>,
    number: usize,
}

impl HasPosition for Vertex {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

impl Plain {
    fn new(texture: &TextureModel) -> Self {
        let deviation = |value: fn(&ModelAt) -> f64| {
            let values: Vec<f64> = texture.models().iter().map(value).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64).sqrt()
        };
        let scale = (1.0 / deviation(|at| at.speed_m_s), 1.0 / deviation(|at| at.force_n));
        let mut mesh = DelaunayTriangulation::new();
        let mut hint = None;
        for (number, at) in texture.models().iter().enumerate() {
            let position = Point2::new(at.speed_m_s * scale.0, at.force_n * scale.1);
            hint = mesh.insert(Vertex { position, number }).ok();
        }
        Plain { mesh, scale, hint: hint.expect("the map has vertices") }
    }

    fn locate(&mut self, speed: f64, force: f64) -> [(usize, f64); 3] {
        let point = Point2::new(speed * self.scale.0, force * self.scale.1);
        let face = match self.mesh.locate_with_hint(point, self.hint) {
            PositionInTriangulation::OnFace(face) => self.mesh.face(face),
            PositionInTriangulation::OnEdge(edge) => {
                let edge = self.mesh.directed_edge(edge);
                edge.face().as_inner().or_else(|| edge.rev().face().as_inner()).expect("an edge has a face")
            }
            PositionInTriangulation::OnVertex(vertex) => {
                let mut edges = self.mesh.vertex(vertex).out_edges();
                edges.find_map(|edge| edge.face().as_inner()).expect("a vertex has a face")
            }
            _ => panic!("the point is outside of the map"),
        };
        let vertices = face.vertices();
        self.hint = vertices[0].fix();
        let weights = face.barycentric_interpolation(point);
        std::array::from_fn(|i| (vertices[i].data().number, weights[i]))
    }
}

fn locate(name: &str, texture: &TextureModel, path: &[(f64, f64)]) {
    let (mut plain, mut ours) = (Plain::new(texture), Interpolator::new(texture));
    for &(speed, force) in path {
        let spot = ours.locate(speed, force);
        for (number, weight) in plain.locate(speed, force) {
            let own = (0..3).find(|&i| spot.vertices[i] as usize == number).map_or(0.0, |i| spot.weights[i]);
            assert!((own - weight).abs() < 1e-9);
        }
    }
    let mut spade = || {
        path.iter().for_each(|&(s, f)| {
            black_box(plain.locate(black_box(s), f));
        })
    };
    let mut walk = || {
        path.iter().for_each(|&(s, f)| {
            black_box(ours.locate(black_box(s), f));
        })
    };
    contest::compare(
        calls(&format!("locate {name}"), POINTS),
        &mut [("spade, with hint", &mut spade), ("walk from the last triangle", &mut walk)],
    );
}

fn update(name: &str, texture: &TextureModel, path: &[(f64, f64)]) {
    let (mut plain, mut ours) = (Plain::new(texture), Interpolator::new(texture));
    let mut plainly = |speed: f64, force: f64| -> ([f64; ORDER], f64) {
        let mut lsf = [0.0; ORDER];
        let mut variance = 0.0;
        for (number, weight) in plain.locate(speed, force) {
            let model = &texture.models()[number].model;
            lsf.iter_mut().zip(model.ar_lsf()).for_each(|(mean, w)| *mean += weight * w);
            variance += weight * model.variance();
        }
        (by_complex_products(&lsf), variance)
    };
    let mut into = Coefficients::SILENCE;
    for &(speed, force) in path {
        ours.interpolate(speed, force, &mut into);
        let (ar, variance) = plainly(speed, force);
        assert!(into.ar().iter().zip(&ar).all(|(a, b)| (a - b).abs() < 1e-9));
        assert!((into.variance - variance).abs() < 1e-9);
    }
    let mut naive = || {
        path.iter().for_each(|&(s, f)| {
            black_box(plainly(black_box(s), f));
        })
    };
    let mut kernel = || {
        for &(speed, force) in path {
            ours.interpolate(black_box(speed), force, &mut into);
            black_box(&into);
        }
    };
    contest::compare(
        calls(&format!("a whole update of AR({ORDER}) coefficients, {name}"), POINTS),
        &mut [("spade, means, complex products", &mut naive), ("Interpolator", &mut kernel)],
    );
}

/// Warped models beside plain ones, and what their power costs by reflection coefficients.
fn warped_update() {
    const WARPING: f64 = 0.8;
    let warped = texture_of(|lsf, power| ArmaModel::warped_from_lsf(lsf, WARPING, power));
    let path = stroke();
    let (mut plain, mut ours) = (Interpolator::new(&texture()), Interpolator::new(&warped));
    let (mut into, mut other) = (Coefficients::SILENCE, Coefficients::SILENCE);
    let mut run_plain = || {
        for &(speed, force) in &path {
            plain.interpolate(black_box(speed), force, &mut other);
            black_box(&other);
        }
    };
    let mut models = vec![Coefficients::SILENCE; POINTS];
    models.iter_mut().zip(&path).for_each(|(into, &(speed, force))| _ = ours.interpolate(speed, force, into));
    let mut run_warped = || {
        for &(speed, force) in &path {
            ours.interpolate(black_box(speed), force, &mut into);
            black_box(&into);
        }
    };
    let mut by_reflection = || models.iter().for_each(|at| _ = black_box(power_gain(at.ar(), WARPING)));
    contest::compare(
        calls(&format!("a whole update of warped AR({ORDER}) coefficients, along a smooth stroke"), POINTS),
        &mut [
            ("plain", &mut run_plain),
            ("warped", &mut run_warped),
            ("power_gain alone, by reflection coefficients", &mut by_reflection),
        ],
    );
}

/// Both polynomials from their zeros on the circle, one by one, with the system's cosines.
fn by_complex_products(lsf: &[f64]) -> [f64; ORDER] {
    let zero = Complex64::new(0.0, 0.0);
    // [sum, difference], begun with the zeros at -1 and 1 of an even order.
    let mut halves = [[zero; ORDER + 2]; 2];
    for (half, sign) in halves.iter_mut().zip([1.0, -1.0]) {
        half[0] = Complex64::new(1.0, 0.0);
        half[1] = Complex64::new(sign, 0.0);
    }
    let mut degree = [1, 1];
    for (index, &frequency) in lsf.iter().enumerate() {
        let root = Complex64::new(frequency.cos(), frequency.sin());
        let (half, degree) = (&mut halves[index % 2], &mut degree[index % 2]);
        for root in [root, root.conj()] {
            *degree += 1;
            for k in (1..=*degree).rev() {
                let shifted = half[k - 1] * root;
                half[k] -= shifted;
            }
        }
    }
    std::array::from_fn(|k| 0.5 * (halves[0][k + 1] + halves[1][k + 1]).re)
}

/// Fifty spectra.
fn spectra() -> Vec<Vec<f64>> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
    (0..50).map(|_| frequencies(&mut random)).collect()
}

fn to_ar() {
    let spectra = spectra();
    let mut ar = [0.0; ORDER];
    for lsf in &spectra {
        lsf_to_ar(lsf, &mut ar).expect("one order");
        assert!(ar.iter().zip(by_complex_products(lsf)).all(|(a, b)| (a - b).abs() < 1e-10));
    }
    let mut naive = || {
        spectra.iter().for_each(|lsf| {
            black_box(by_complex_products(black_box(lsf)));
        })
    };
    let mut plain = || {
        spectra.iter().for_each(|lsf| {
            black_box(by_real_products(black_box(lsf)));
        })
    };
    let mut kernel = || {
        for lsf in &spectra {
            let _ = lsf_to_ar(black_box(lsf), &mut ar);
            black_box(&ar);
        }
    };
    contest::compare(
        calls(&format!("LSF to AR({ORDER})"), spectra.len()),
        &mut [
            ("complex products", &mut naive),
            ("quadratic factors, libm cosines", &mut plain),
            ("lsf_to_ar", &mut kernel),
        ],
    );
}

/// As [`by_complex_products`], by real quadratic factors and without allocation: what a careful C programmer writes.
fn by_real_products(lsf: &[f64]) -> [f64; ORDER] {
    let mut halves = [[0.0; ORDER + 2]; 2];
    halves.iter_mut().for_each(|half| half[0] = 1.0);
    for (index, &frequency) in lsf.iter().enumerate() {
        let half = &mut halves[index % 2];
        let b = -2.0 * frequency.cos();
        for k in (2..=ORDER + 1).rev() {
            half[k] += b * half[k - 1] + half[k - 2];
        }
        half[1] += b;
    }
    for k in (1..=ORDER + 1).rev() {
        halves[0][k] += halves[0][k - 1];
        halves[1][k] -= halves[1][k - 1];
    }
    std::array::from_fn(|k| 0.5 * (halves[0][k + 1] + halves[1][k + 1]))
}

fn to_lsf() {
    let models: Vec<Vec<f64>> = spectra()
        .iter()
        .map(|lsf| {
            let mut ar = vec![0.0; ORDER];
            lsf_to_ar(lsf, &mut ar).expect("one order");
            ar
        })
        .collect();
    let mut lsf = [0.0; ORDER];
    for ar in &models {
        ar_to_lsf(ar, &mut lsf).expect("these models are stable");
        assert!(lsf.iter().zip(by_eigenvalues(ar)).all(|(a, b)| (a - b).abs() < 1e-9));
        assert!(lsf.iter().zip(by_bisection(ar)).all(|(a, b)| (a - b).abs() < 1e-9));
    }
    let mut eigenvalues = || {
        for ar in &models {
            black_box(by_eigenvalues(black_box(ar)));
        }
    };
    let mut bisection = || {
        for ar in &models {
            black_box(by_bisection(black_box(ar)));
        }
    };
    let mut kernel = || {
        for ar in &models {
            let _ = ar_to_lsf(black_box(ar), &mut lsf);
            black_box(&lsf);
        }
    };
    contest::compare(
        calls(&format!("AR({ORDER}) to LSF"), models.len()),
        &mut [
            ("grid of 256 and bisection", &mut bisection),
            ("eigenvalues of the companion matrices", &mut eigenvalues),
            ("ar_to_lsf", &mut kernel),
        ],
    );
}

/// The sum and difference polynomials, rid of their zeros at -1 and 1.
fn palindromes(ar: &[f64]) -> [Vec<f64>; 2] {
    let a = |k: usize| {
        if k == 0 { 1.0 } else { ar.get(k - 1).copied().unwrap_or(0.0) }
    };
    [1.0, -1.0].map(|sign| {
        let mut half = vec![0.0; ORDER + 1];
        for k in 0..=ORDER {
            half[k] = a(k) + sign * a(ORDER + 1 - k) - if k > 0 { sign * half[k - 1] } else { 0.0 };
        }
        half
    })
}

fn by_eigenvalues(ar: &[f64]) -> Vec<f64> {
    let mut lsf: Vec<f64> = palindromes(ar)
        .iter()
        .flat_map(|half| {
            let companion = nalgebra::DMatrix::from_fn(ORDER, ORDER, |i, j| match i {
                0 => -half[j + 1],
                _ => f64::from(u8::from(i == j + 1)),
            });
            companion.complex_eigenvalues().iter().map(|z| z.arg()).filter(|w| *w > 0.0).collect::<Vec<_>>()
        })
        .collect();
    lsf.sort_by(f64::total_cmp);
    lsf
}

fn by_bisection(ar: &[f64]) -> Vec<f64> {
    const GRID: usize = 256;
    let mut lsf: Vec<f64> = palindromes(ar)
        .iter()
        .flat_map(|half| {
            let middle = ORDER / 2;
            let value = |w: f64| {
                half[middle]
                    + 2.0 * (1..=middle).map(|k| half[middle - k] * (w * k as f64).cos()).sum::<f64>()
            };
            let values: Vec<f64> = (0..=GRID).map(|i| value(PI * i as f64 / GRID as f64)).collect();
            let mut zeros = Vec::new();
            for i in (0..GRID).filter(|&i| (values[i] > 0.0) != (values[i + 1] > 0.0)) {
                let (mut low, mut high) = (PI * i as f64 / GRID as f64, PI * (i + 1) as f64 / GRID as f64);
                while high - low > 1e-12 {
                    let middle = 0.5 * (low + high);
                    if (value(middle) > 0.0) == (values[i] > 0.0) { low = middle } else { high = middle }
                }
                zeros.push(0.5 * (low + high));
            }
            zeros
        })
        .collect();
    lsf.sort_by(f64::total_cmp);
    lsf
}

/// Our kernels alone, for comparison with an earlier commit.
fn regressions(criterion: &mut Criterion) {
    let texture = texture();
    let mut group = criterion.benchmark_group("models");
    group.throughput(Throughput::Elements(POINTS as u64));
    let path = stroke();
    let mut interpolator = Interpolator::new(&texture);
    let mut into = Coefficients::SILENCE;
    group.bench_function("interpolate", |bencher| {
        bencher.iter(|| {
            for &(speed, force) in &path {
                interpolator.interpolate(black_box(speed), force, &mut into);
            }
            into.variance
        });
    });
    let spectra = spectra();
    group.throughput(Throughput::Elements(spectra.len() as u64));
    let mut ar = [0.0; ORDER];
    group.bench_function("lsf_to_ar", |bencher| {
        bencher.iter(|| spectra.iter().filter(|lsf| lsf_to_ar(black_box(*lsf), &mut ar).is_ok()).count());
    });
    let mut lsf = [0.0; ORDER];
    let models: Vec<[f64; ORDER]> = spectra
        .iter()
        .map(|lsf| {
            lsf_to_ar(lsf, &mut ar).expect("one order");
            ar
        })
        .collect();
    group.bench_function("ar_to_lsf", |bencher| {
        bencher.iter(|| models.iter().filter(|ar| ar_to_lsf(black_box(*ar), &mut lsf).is_ok()).count());
    });
    group.finish();
}
