//! Learning and measuring beside the plain way to do the same: outputs compared, then timed in turns, medians of each.
//!
//! `cargo bench -p haptograph-surfaces --bench learning`; with `-- --ratios` the comparisons alone.

#[path = "../../benches/contest/mod.rs"]
mod contest;

use contest::Work;
use criterion::{Criterion, Throughput};
use haptograph_learning::learn::segmentation::{
    Segmentation, SegmentationMethod, SegmentationSettings, VarianceEstimate, description_length, segment,
};
use haptograph_learning::learn::texture::{Fate, TextureReport, TextureSettings, learn_texture};
use haptograph_learning::learn::{LearnSettings, learn};
use haptograph_learning::metrics::spectral::Comparison;
use haptograph_learning::metrics::{WindowSettings, WindowedSpectra, all_pairs, compare};
use haptograph_learning::recording::{
    AnyRecording, Calibration, Gesture, Pose, ProcessedRecording, Recording, Series, Signals, Wrench,
};
use haptograph_signal::noise::Gaussian;
use haptograph_signal::prediction::{Prediction, autocovariance, levinson};
use haptograph_signal::{Complex64, fft};
use haptograph_surfaces::{Origin, Provenance, TextureModel};
use std::f64::consts::TAU;
use std::hint::black_box;

const RATE_HZ: f64 = 10_000.0;

fn main() {
    segmentation_beside_refitting("segmentation of 600 samples, breaks anywhere", 600, 1, 11);
    segmentation_beside_refitting("segmentation of 10 000 samples, breaks 50 apart", 10_000, 50, 5);
    long_segmentation();
    texture_beside_refitting();
    whole_recording();
    one_pair();
    every_pair();
    if std::env::args().any(|arg| arg == "--ratios") {
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    regressions(&mut criterion);
    criterion.final_summary();
}

/// A vibration that changes its character several times: resonances of two to ten poles.
fn vibration(samples: usize, seed: u64) -> Vec<f64> {
    let mut noise = Gaussian::new(seed);
    let mut signal: Vec<f64> = vec![];
    while signal.len() < samples {
        let piece = signal.len() * 7 / samples;
        let mut ar = vec![1.0];
        for pair in 0..=piece % 5 {
            let frequency = 0.03 + 0.09 * pair as f64 + 0.02 * (piece as f64).sin();
            let factor = [1.0, -1.8 * (TAU * frequency).cos(), 0.81];
            let mut product = vec![0.0; ar.len() + 2];
            for (i, x) in ar.iter().enumerate() {
                for (j, y) in factor.iter().enumerate() {
                    product[i + j] += x * y;
                }
            }
            ar = product;
        }
        let past: f64 = ar[1..].iter().zip(signal.iter().rev()).map(|(a, y)| a * y).sum();
        signal.push(noise.next_sample() - past);
    }
    signal
}

/// By the estimate that refitting knows; breaks at every `grid`-th sample first.
fn yule_walker(grid: usize, min_span: usize) -> SegmentationSettings {
    SegmentationSettings {
        min_span,
        variance: VarianceEstimate::YuleWalker,
        method: SegmentationMethod::Exact { grid: Some(grid) },
        ..SegmentationSettings::default()
    }
}

/// The best breaks at every `grid`-th sample, all spans fitted from their samples (Eq. 2.3.3).
fn refitted(signal: &[f64], grid: usize, settings: &SegmentationSettings) -> Vec<usize> {
    let ends: Vec<usize> = (0..signal.len()).step_by(grid).chain([signal.len()]).collect();
    // Cheapest cost of all segments up to each point, and where the last of them begins.
    let mut best: Vec<(f64, usize)> = vec![(0.0, 0)];
    for (point, &end) in ends.iter().enumerate().skip(1) {
        let mut cheapest = (f64::INFINITY, 0);
        for (from, &start) in ends[..point].iter().enumerate() {
            if end - start >= settings.min_span {
                let penalty = (signal.len() as f64).ln();
                let cost = best[from].0 + penalty + span_cost(&signal[start..end], settings.max_order);
                if cost < cheapest.0 {
                    cheapest = (cost, from);
                }
            }
        }
        best.push(cheapest);
    }
    let mut breaks = vec![];
    let mut point = best[ends.len() - 1].1;
    while point > 0 {
        breaks.insert(0, ends[point]);
        point = best[point].1;
    }
    breaks
}

fn span_cost(span: &[f64], max_order: usize) -> f64 {
    let highest = max_order.min(span.len() / 2);
    let lags = autocovariance(span, highest);
    let Ok(Prediction { reflection, .. }) = levinson(&lags, highest) else {
        return f64::INFINITY;
    };
    let samples = span.len() as f64;
    let mut variance = lags[0];
    let costs = reflection.iter().enumerate().map(|(index, k)| {
        variance *= 1.0 - k * k;
        let order = (index + 1) as f64;
        order.ln() + (order + 2.0) / 2.0 * samples.ln() + samples / 2.0 * (TAU * variance).ln()
    });
    costs.fold(f64::INFINITY, f64::min)
}

fn check_breaks(signal: &[f64], grid: usize, settings: &SegmentationSettings) -> Segmentation {
    let plain = refitted(signal, grid, settings);
    let plain = description_length(signal, &plain, settings)
        .expect("the signal is sound")
        .expect("its segments are long enough");
    let ours = segment(signal, settings).expect("the signal can be segmented");
    assert!(ours.mdl <= plain.mdl + 1e-6, "{} for {}", ours.mdl, plain.mdl);
    if grid == 1 {
        assert_eq!((&ours.breaks, &ours.orders), (&plain.breaks, &plain.orders));
    }
    ours
}

fn segmentation_beside_refitting(title: &str, samples: usize, grid: usize, turns: usize) {
    let signal = vibration(samples, 1);
    let settings = yule_walker(grid, 50);
    let usual =
        SegmentationSettings { variance: VarianceEstimate::ConditionalLeastSquares, ..settings.clone() };
    let found = check_breaks(&signal, grid, &settings);
    assert!(found.breaks.len() > 1, "the bench is of several segments");
    let mut plain = || {
        black_box(refitted(black_box(&signal), grid, &settings));
    };
    let mut ours = || {
        let _ = black_box(segment(black_box(&signal), &settings));
    };
    let mut ours_as_usual = || {
        let _ = black_box(segment(black_box(&signal), &usual));
    };
    contest::compare(
        Work { title, unit: "signal", units: 1, turns },
        &mut [
            ("Levinson anew for every span", &mut plain),
            ("segment, by Yule-Walker", &mut ours),
            ("segment, by conditional least squares", &mut ours_as_usual),
        ],
    );
}

fn long_segmentation() {
    let signal = vibration(100_000, 1);
    let mut ours = || {
        let _ = black_box(segment(black_box(&signal), &SegmentationSettings::default()));
    };
    contest::compare(
        Work {
            title: "segmentation of 100 000 samples, orders up to 20",
            unit: "signal",
            units: 1,
            turns: 11,
        },
        &mut [("segment", &mut ours)],
    );
}

/// Ten seconds of drawing circles that grow and shrink while pressing more and less.
fn recording() -> AnyRecording {
    let angle = |t: f64| TAU * 1.2 * t;
    let radius_m = |t: f64| 0.015 + 0.01 * (TAU * 0.11 * t).sin();
    let push_n = |t: f64| 1.2 + 0.8 * (TAU * 0.17 * t).cos();
    let pose = |i: usize| {
        let t = i as f64 / 240.0;
        Pose {
            position_m: [radius_m(t) * angle(t).cos(), radius_m(t) * angle(t).sin(), 0.0],
            orientation: [1.0, 0.0, 0.0, 0.0],
        }
    };
    let samples = 10 * RATE_HZ as usize;
    let wrench = |i: usize| {
        let t = i as f64 / RATE_HZ;
        let (friction, (sin, cos)) = (0.3 * push_n(t), angle(t).sin_cos());
        Wrench { force_n: [friction * sin, -friction * cos, push_n(t)], torque_n_m: [0.0; 3] }
    };
    let axes: [Vec<f64>; 3] = [1, 2, 3].map(|seed| vibration(samples, seed));
    let recording = Recording::new(
        Series::new(240.0, (0..2400).map(pose).collect()),
        Series::new(RATE_HZ, (0..samples).map(wrench).collect()),
        Series::new(RATE_HZ, (0..samples).map(|i| [axes[0][i], axes[1][i], axes[2][i]]).collect()),
        Calibration::default(),
        Gesture::Drag,
        Provenance::new(Origin::Procedural, "made up for a bench"),
    );
    AnyRecording::Raw(recording.expect("the recording is sound"))
}

/// Ten seconds at 1 kHz, processed, of steps in speed and force; refitting all spans of 10 kHz would take minutes.
fn drag() -> ProcessedRecording {
    let step = |i: usize| (i / 1000) as f64;
    let signals = Signals {
        rate_hz: 1000.0,
        acceleration_m_s2: vibration(10_000, 1),
        force_normal_n: (0..10_000).map(|i| 0.5 + 0.2 * (step(i) * 3.0 % 10.0)).collect(),
        force_tangential_n: None,
        speed_m_s: (0..10_000).map(|i| 0.02 + 0.01 * step(i)).collect(),
        axes_m_s2: None,
    };
    let provenance = Provenance::new(Origin::Procedural, "made up for a bench");
    ProcessedRecording::new(signals, Gesture::Drag, provenance).expect("the recording is sound")
}

/// The models of given segments, each by Levinson at the median of their orders.
fn refitted_models(signal: &[f64], breaks: &[usize]) -> Vec<Prediction> {
    let mut edges = vec![0];
    edges.extend(breaks);
    edges.push(signal.len());
    let spans = || edges.windows(2).map(|edge| &signal[edge[0]..edge[1]]);
    let mut orders: Vec<usize> = spans().map(best_order).collect();
    orders.sort_unstable();
    let middle = orders.len() / 2;
    let order = match orders.len() % 2 {
        0 => (orders[middle - 1] + orders[middle]).div_ceil(2),
        _ => orders[middle],
    };
    spans().filter_map(|span| levinson(&autocovariance(span, order), order).ok()).collect()
}

fn best_order(span: &[f64]) -> usize {
    let cost = |order: &usize| {
        let variance = levinson(&autocovariance(span, *order), *order).map_or(f64::INFINITY, |p| p.variance);
        let (order, samples) = (*order as f64, span.len() as f64);
        order.ln() + (order + 2.0) / 2.0 * samples.ln() + samples / 2.0 * (TAU * variance).ln()
    };
    (1..=20).min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or(1)
}

fn check_models(drag: &ProcessedRecording, texture: &TextureModel, report: &TextureReport) {
    let plain = refitted_models(&drag.signals().acceleration_m_s2, &report.segmentations[0].breaks);
    assert_eq!(plain.len(), report.segments.len());
    for (plain, segment) in plain.iter().zip(&report.segments) {
        assert_eq!(segment.fate, Fate::Kept);
        let at = |at: &&haptograph_surfaces::ModelAt| {
            (at.speed_m_s, at.force_n) == (segment.speed_m_s, segment.force_n)
        };
        let ours = texture.models().iter().find(at).expect("the segment became a model");
        assert_eq!(plain.ar.len(), ours.model.ar().len());
        let close = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9;
        assert!(plain.ar.iter().zip(ours.model.ar()).all(close));
    }
}

fn texture_beside_refitting() {
    const GRID: usize = 50;
    let settings = |variance| TextureSettings {
        segmentation: SegmentationSettings { variance, ..yule_walker(GRID, GRID) },
        outliers: None,
        ..TextureSettings::default()
    };
    let alike = settings(VarianceEstimate::YuleWalker);
    let usual = settings(VarianceEstimate::ConditionalLeastSquares);
    let drag = drag();
    let learned =
        |settings: &TextureSettings| learn_texture(std::slice::from_ref(black_box(&drag)), settings, &|_| ());
    let signal = &drag.signals().acceleration_m_s2;
    check_breaks(signal, GRID, &alike.segmentation);
    let (texture, report) = learned(&alike).expect("it has a texture");
    check_models(&drag, &texture, &report);
    let mut plain = || {
        let breaks = refitted(black_box(signal), GRID, &alike.segmentation);
        black_box(refitted_models(signal, &breaks));
    };
    contest::compare(
        Work { title: "a texture from 10 s at 1 kHz", unit: "texture", units: 1, turns: 5 },
        &mut [
            ("Levinson anew for every span, then models", &mut plain),
            ("learn_texture, by Yule-Walker", &mut || drop(black_box(learned(&alike)))),
            ("learn_texture, by conditional least squares", &mut || drop(black_box(learned(&usual)))),
        ],
    );
}

fn whole_recording() {
    let recordings = [recording()];
    let settings = LearnSettings::default();
    let mut ours = || {
        let _ = black_box(learn("bench", black_box(&recordings), &settings, &|_| ()));
    };
    contest::compare(
        Work {
            title: "a surface from 10 s of raw recording, segments of at least 50 samples",
            unit: "surface",
            units: 1,
            turns: 5,
        },
        &mut [("learn", &mut ours)],
    );
}

/// Windows of a signal: amplitudes over their root mean square, and power.
fn plain_windows(signal: &[f64]) -> Vec<(Vec<f64>, f64)> {
    const N: usize = 256;
    let transform = fft::forward(N);
    let taper: Vec<f64> = (0..N).map(|i| 0.54 - 0.46 * (TAU * i as f64 / (N - 1) as f64).cos()).collect();
    let energy: f64 = taper.iter().map(|w| w * w).sum();
    let windows = signal.windows(N).step_by(N / 2).map(|cut| {
        let mut bins: Vec<Complex64> =
            cut.iter().zip(&taper).map(|(x, w)| Complex64::new(x * w, 0.0)).collect();
        let power = bins.iter().map(|x| x.re * x.re).sum::<f64>() / energy;
        transform.process(&mut bins);
        let shape: Vec<f64> = bins[..=N / 2].iter().map(|y| y.norm()).collect();
        let scale = shape.iter().map(|a| a * a).sum::<f64>().sqrt();
        (shape.iter().map(|a| a / scale).collect(), power)
    });
    windows.collect()
}

/// Eq. 2.5.1 to 2.5.3 as they stand.
fn plainly_compared(a: &[f64], b: &[f64]) -> Comparison {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let deviation = |values: &[f64]| {
        let mean = mean(values);
        (values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (values.len() - 1) as f64).sqrt()
    };
    let (a, b) = (plain_windows(a), plain_windows(b));
    let (mut nse, mut pe) = (vec![], vec![]);
    for ((a, a_power), (b, b_power)) in a.iter().zip(&b) {
        nse.push(a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>() / a.len() as f64);
        pe.push((a_power - b_power).abs() / ((a_power + b_power) / 2.0));
    }
    Comparison {
        nse: mean(&nse),
        pe: mean(&pe),
        sd: mean(&nse) / deviation(&nse) + mean(&pe) / deviation(&pe),
        unvarying: (false, false),
        windows: nse.len(),
    }
}

fn ours_compared(a: &[f64], b: &[f64]) -> Comparison {
    compare(a, b, RATE_HZ, &WindowSettings::COMPARISON).expect("the signals are sound")
}

fn check_equal(ours: Comparison, plain: Comparison) {
    assert_eq!(ours.windows, plain.windows);
    for (ours, plain) in [(ours.nse, plain.nse), (ours.pe, plain.pe), (ours.sd, plain.sd)] {
        assert!((ours / plain - 1.0).abs() < 1e-9, "{ours} for {plain}");
    }
}

fn one_pair() {
    let (a, b) = (vibration(100_000, 1), vibration(100_000, 2));
    check_equal(ours_compared(&a, &b), plainly_compared(&a, &b));
    let mut plain = || {
        black_box(plainly_compared(black_box(&a), &b));
    };
    let mut ours = || {
        black_box(ours_compared(black_box(&a), &b));
    };
    contest::compare(
        Work { title: "NSE, PE and SD of two signals of 10 s", unit: "pair", units: 1, turns: 21 },
        &mut [("as the equations stand", &mut plain), ("compare", &mut ours)],
    );
}

/// Twenty signals of 3 s make 190 pairs.
fn signals() -> Vec<Vec<f64>> {
    (0..20).map(|seed| vibration(30_000, seed)).collect()
}

fn matrix(signals: &[Vec<f64>]) -> Vec<f64> {
    let spectra: Result<Vec<_>, _> = signals
        .iter()
        .map(|signal| WindowedSpectra::new(signal, RATE_HZ, &WindowSettings::COMPARISON))
        .collect();
    let errors = spectra.and_then(|spectra| all_pairs(&spectra, &|_| ()));
    errors
        .expect("the signals are sound")
        .iter()
        .map(|pair| pair.spectral_difference(&pair.deviations()))
        .collect()
}

fn matrix_by(signals: &[Vec<f64>], compare: fn(&[f64], &[f64]) -> Comparison) -> Vec<f64> {
    let mut differences = vec![];
    for (index, a) in signals.iter().enumerate() {
        differences.extend(signals[index + 1..].iter().map(|b| compare(a, b).sd));
    }
    differences
}

fn every_pair() {
    let signals = signals();
    let ours = matrix(&signals);
    assert_eq!(ours, matrix_by(&signals, ours_compared));
    let plain = matrix_by(&signals, plainly_compared);
    assert!(ours.iter().zip(&plain).all(|(a, b)| (a / b - 1.0).abs() < 1e-9));
    let mut plain = || {
        black_box(matrix_by(black_box(&signals), plainly_compared));
    };
    let mut one_by_one = || {
        black_box(matrix_by(black_box(&signals), ours_compared));
    };
    let mut ours = || {
        black_box(matrix(black_box(&signals)));
    };
    contest::compare(
        Work { title: "SD of all pairs of 20 signals of 3 s", unit: "pair", units: 190, turns: 5 },
        &mut [
            ("as the equations stand, pair by pair", &mut plain),
            ("compare, pair by pair", &mut one_by_one),
            ("spectra once, all_pairs", &mut ours),
        ],
    );
}

/// Ours alone, for comparison with an earlier commit.
fn regressions(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("learning");
    group.sample_size(10).throughput(Throughput::Elements(100_000));
    let signal = vibration(100_000, 1);
    group.bench_function("segment 100 000 samples", |bencher| {
        bencher.iter(|| segment(black_box(&signal), &SegmentationSettings::default()));
    });
    let recordings = [recording()];
    group.bench_function("learn 10 s", |bencher| {
        bencher.iter(|| learn("bench", black_box(&recordings), &LearnSettings::default(), &|_| ()));
    });
    let other = vibration(100_000, 2);
    group.bench_function("compare 10 s", |bencher| {
        bencher.iter(|| ours_compared(black_box(&signal), &other));
    });
    let signals = signals();
    group.bench_function("190 pairs of 3 s", |bencher| bencher.iter(|| matrix(black_box(&signals))));
    group.finish();
}
