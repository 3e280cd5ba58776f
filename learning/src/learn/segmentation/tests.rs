use super::*;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

/// First sample, a_1, a_2, ... with A(z) = 1 + sum a_k z^-k, standard deviation of the innovations.
type Piece<'a> = (usize, &'a [f64], f64);

/// A piecewise autoregressive process, started at rest.
fn piecewise(samples: usize, pieces: &[Piece], seed: u64) -> Vec<f64> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut y: Vec<f64> = Vec::with_capacity(samples);
    for n in 0..samples {
        let (_, a, deviation) = pieces.iter().rev().find(|(first, ..)| *first <= n).unwrap();
        let noise: f64 = StandardNormal.sample(&mut random);
        let past: f64 = a.iter().enumerate().filter(|(k, _)| n > *k).map(|(k, a)| a * y[n - 1 - k]).sum();
        y.push(deviation * noise - past);
    }
    y
}

/// Davis, Lee and Rodriguez-Yam's process A: breaks at one half and three quarters.
fn process_a(seed: u64) -> Vec<f64> {
    piecewise(1024, &[(0, &[-0.9], 1.0), (512, &[-1.69, 0.81], 1.0), (768, &[-1.32, 0.81], 1.0)], seed)
}

/// Their process B: the coefficient of an AR(1) changes after 50 samples.
fn process_b(seed: u64) -> Vec<f64> {
    piecewise(1024, &[(0, &[-0.75], 1.0), (50, &[0.5], 1.0)], seed)
}

const ESTIMATES: [VarianceEstimate; 3] =
    [VarianceEstimate::ConditionalLeastSquares, VarianceEstimate::YuleWalker, VarianceEstimate::Burg];

fn with(
    variance: VarianceEstimate,
    min_span: usize,
    max_order: usize,
    grid: Option<usize>,
) -> SegmentationSettings {
    SegmentationSettings { min_span, max_order, variance, method: SegmentationMethod::Exact { grid } }
}

/// Counts the runs that have exactly the true number of segments, and averages their breaks as fractions of the length.
fn found(
    process: fn(u64) -> Vec<f64>,
    seeds: u64,
    settings: &SegmentationSettings,
    breaks: usize,
) -> (u64, Vec<f64>) {
    let mut right = 0;
    let mut mean = vec![0.0; breaks];
    for seed in 0..seeds {
        let signal = process(seed);
        let found = segment(&signal, settings).unwrap().breaks;
        if found.len() == breaks {
            right += 1;
            mean.iter_mut().zip(&found).for_each(|(mean, &b)| *mean += b as f64 / signal.len() as f64);
        }
    }
    (right, mean.iter().map(|sum| sum / right as f64).collect())
}

fn assert_published_processes_are_found(seeds: u64, settings: &SegmentationSettings) {
    let (right, breaks) = found(process_a, seeds, settings, 2);
    assert!(right * 100 >= seeds * 95, "process A: {right} of {seeds}");
    assert!((breaks[0] - 0.5).abs() < 0.005 && (breaks[1] - 0.75).abs() < 0.005, "process A: {breaks:?}");
    let (right, breaks) = found(process_b, seeds, settings, 1);
    assert!(right * 100 >= seeds * 99, "process B: {right} of {seeds}");
    assert!((breaks[0] - 50.0 / 1024.0).abs() < 0.005, "process B: {breaks:?}");
}

#[test]
fn breaks_of_published_processes_are_found() {
    assert_published_processes_are_found(40, &with(VarianceEstimate::default(), 50, 20, Some(16)));
}

#[test]
#[ignore = "200 runs on the finest affordable grid, with every estimate: half a minute in release"]
fn breaks_of_published_processes_are_found_in_200_runs() {
    for variance in ESTIMATES {
        assert_published_processes_are_found(200, &with(variance, 50, 20, None));
    }
}

/// The innovation variance at one order, straight from each estimate's definition.
fn defined_variance(
    signal: &[f64],
    start: usize,
    end: usize,
    order: usize,
    estimate: VarianceEstimate,
) -> f64 {
    let span = end - start;
    let x = |u: isize| if u < 0 { 0.0 } else { signal[u as usize] };
    match estimate {
        VarianceEstimate::ConditionalLeastSquares => {
            let past = DMatrix::from_fn(span, order, |row, k| x((start + row) as isize - 1 - k as isize));
            let target = DVector::from_row_slice(&signal[start..end]);
            let solution = past.clone().svd(true, true).solve(&target, 1e-12).unwrap();
            (target - past * solution).norm_squared() / span as f64
        }
        VarianceEstimate::YuleWalker => {
            let s = &signal[start..end];
            let r: Vec<f64> =
                (0..=order).map(|k| (k..span).map(|u| s[u] * s[u - k]).sum::<f64>() / span as f64).collect();
            let matrix = DMatrix::from_fn(order, order, |i, j| r[i.abs_diff(j)]);
            let right = DVector::from_row_slice(&r[1..]);
            r[0] - right.dot(&matrix.lu().solve(&right).unwrap())
        }
        VarianceEstimate::Burg => {
            let s = &signal[start..end];
            let (mut forward, mut backward) = (s.to_vec(), s.to_vec());
            let mut variance = s.iter().map(|x| x * x).sum::<f64>() / span as f64;
            for m in 1..=order {
                let (mut across, mut energy) = (0.0, 0.0);
                for n in m..span {
                    across += forward[n] * backward[n - 1];
                    energy += forward[n].powi(2) + backward[n - 1].powi(2);
                }
                let k = -2.0 * across / energy;
                for n in (m..span).rev() {
                    let (f, b) = (forward[n], backward[n - 1]);
                    (forward[n], backward[n]) = (f + k * b, b + k * f);
                }
                variance *= 1.0 - k * k;
            }
            variance
        }
    }
}

fn fast_variances<E: Estimator>(
    signal: &[f64],
    segments: &[(usize, usize)],
    max_order: usize,
    step: usize,
) -> Vec<Vec<f64>> {
    let moments = Moments::new(signal, max_order, step);
    let settings = with(VarianceEstimate::default(), 50, max_order, None);
    let mut all = vec![];
    Objective::<E>::new(&moments, &settings)
        .variances(segments, |_, _, variances| all.push(variances.to_vec()));
    all
}

#[test]
fn variances_from_moments_are_those_of_the_definitions() {
    let signal = process_a(7);
    let segments = [
        (0, 57),
        (3, 60),
        (500, 600),
        (511, 1024),
        (0, 1024),
        (970, 1024),
        (100, 150),
        (101, 777),
        (64, 128),
    ];
    for max_order in [1, 2, 5, 20] {
        for (estimate, fast) in [
            (ESTIMATES[0], fast_variances::<ConditionalLeastSquares>(&signal, &segments, max_order, 7)),
            (ESTIMATES[1], fast_variances::<YuleWalker>(&signal, &segments, max_order, 7)),
            (ESTIMATES[2], fast_variances::<Burg>(&signal, &segments, max_order, 7)),
        ] {
            for (&(start, end), variances) in segments.iter().zip(&fast) {
                for (order, &variance) in variances.iter().enumerate().skip(1) {
                    let defined = defined_variance(&signal, start, end, order, estimate);
                    assert!(
                        (variance / defined - 1.0).abs() < 1e-8,
                        "{estimate:?} {start}..{end} order {order}: {variance} but {defined}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_whisper_after_a_roar_keeps_its_digits() {
    let signal =
        piecewise(60_000, &[(0, &[-1.9, 0.95], 1e4), (50_000, &[], 0.0), (59_000, &[-1.2, 0.7], 1e-4)], 3);
    let fast = fast_variances::<YuleWalker>(&signal, &[(59_100, 59_300)], 20, 50);
    let defined = defined_variance(&signal, 59_100, 59_300, 20, VarianceEstimate::YuleWalker);
    assert!((fast[0][20] / defined - 1.0).abs() < 1e-9, "{} but {defined}", fast[0][20]);
}

/// The best breaks on a grid by the definition of the objective: every number of segments apart, every variance from scratch.
fn best_by_definition(signal: &[f64], settings: &SegmentationSettings, grid: usize) -> (f64, Vec<usize>) {
    let n = signal.len();
    let positions: Vec<usize> = (0..n).step_by(grid).chain([n]).collect();
    let (span, ln_n) = (settings.min_span, (n as f64).ln());
    let cost = |start: usize, end: usize| {
        let length = (end - start) as f64;
        (1..=settings.max_order.min((end - start) / 2))
            .map(|p| {
                let variance = defined_variance(signal, start, end, p, settings.variance);
                ln_n + (p as f64).ln()
                    + (p as f64 + 2.0) / 2.0 * length.ln()
                    + length / 2.0 * (TAU * variance).ln()
            })
            .fold(f64::INFINITY, f64::min)
    };
    let most = n / span;
    let mut best: Vec<Vec<(f64, Vec<usize>)>> =
        vec![vec![(f64::INFINITY, vec![]); positions.len()]; most + 1];
    best[0][0] = (0.0, vec![]);
    for to in 1..positions.len() {
        for from in (0..to).filter(|&from| positions[to] >= positions[from] + span) {
            let cost = cost(positions[from], positions[to]);
            for segments in 1..=most {
                let (before, breaks) = best[segments - 1][from].clone();
                if before + cost < best[segments][to].0 {
                    let breaks = breaks.into_iter().chain((from > 0).then_some(positions[from])).collect();
                    best[segments][to] = (before + cost, breaks);
                }
            }
        }
    }
    (1..=most)
        .map(|segments| {
            let (cost, breaks) = best[segments][positions.len() - 1].clone();
            (cost + ((segments - 1).max(1) as f64).ln(), breaks)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap()
}

fn best_on_grid<E: Estimator>(signal: &[f64], settings: &SegmentationSettings, grid: usize) -> Segmentation {
    let moments = Moments::new(signal, settings.max_order, grid);
    let mut objective = Objective::<E>::new(&moments, settings);
    let breaks = exact::best_on_grid(&objective);
    objective.rate(breaks)
}

#[test]
fn the_search_is_exact_on_its_grid() {
    let pieces: [Piece; 5] = [
        (0, &[-0.9], 1.0),
        (61, &[0.5], 1.0),
        (130, &[-0.9], 0.4),
        (200, &[-1.3, 0.8], 1.0),
        (262, &[], 0.7),
    ];
    for seed in 0..6 {
        // Neither the grid nor the minimum span divides the length.
        let signal = piecewise(323, &pieces, seed);
        for estimate in ESTIMATES {
            let settings = with(estimate, 30, 4, None);
            let (mdl, breaks) = best_by_definition(&signal, &settings, 10);
            let found = match estimate {
                VarianceEstimate::ConditionalLeastSquares => {
                    best_on_grid::<ConditionalLeastSquares>(&signal, &settings, 10)
                }
                VarianceEstimate::YuleWalker => best_on_grid::<YuleWalker>(&signal, &settings, 10),
                VarianceEstimate::Burg => best_on_grid::<Burg>(&signal, &settings, 10),
            };
            assert_eq!(found.breaks, breaks, "{estimate:?}, seed {seed}");
            assert!((found.mdl - mdl).abs() < 1e-7 * mdl.abs(), "{estimate:?}: {} but {mdl}", found.mdl);
        }
    }
}

/// Conditional least squares without the shortcuts it allows.
struct Unpruned;

impl Estimator for Unpruned {
    const SUPERADDITIVE: bool = false;

    fn describe_start(moments: &Moments, position: usize, out: &mut [f64]) {
        ConditionalLeastSquares::describe_start(moments, position, out);
    }

    fn estimate(
        starts: &[variance::Lanes],
        ends: &[variance::Lanes],
        spans: variance::Lanes,
        scratch: &mut variance::Scratch,
        variances: &mut [variance::Lanes],
    ) {
        ConditionalLeastSquares::estimate(starts, ends, spans, scratch, variances);
    }
}

#[test]
fn shortcuts_change_nothing() {
    let many: Vec<Piece> =
        (0..40).map(|i| (i * 211, if i % 2 == 0 { &[-1.3, 0.8][..] } else { &[-0.4] }, 1.0)).collect();
    let stationary: [Piece; 1] = [(0, &[-1.69, 0.81], 1.0)];
    let silence: [Piece; 3] = [(0, &[-0.9], 1.0), (2000, &[], 0.0), (3000, &[-0.9], 1.0)];
    // A faint change: one segment and two cost nearly the same.
    let faint = |more: f64| [(0, &[-0.9][..], 1.0), (400, &[-0.9], 1.0 + more), (800, &[-0.9], 1.0)];
    let faints: Vec<[Piece; 3]> = (0..40).map(|k| faint(0.02 * f64::from(k))).collect();
    for (i, pieces) in faints.iter().enumerate() {
        let signal = piecewise(1600, pieces, i as u64);
        let settings = with(VarianceEstimate::default(), 20, 4, None);
        assert_eq!(
            best_on_grid::<ConditionalLeastSquares>(&signal, &settings, 20),
            best_on_grid::<Unpruned>(&signal, &settings, 20),
            "{i}"
        );
    }
    for (i, pieces) in [&many[..], &stationary, &silence].into_iter().enumerate() {
        let signal = piecewise(8000 + i, pieces, 5);
        for (span, step) in [(50, 20), (20, 20), (100, 50)] {
            let settings = with(VarianceEstimate::default(), span, 10, None);
            assert_eq!(
                best_on_grid::<ConditionalLeastSquares>(&signal, &settings, step),
                best_on_grid::<Unpruned>(&signal, &settings, step),
            );
        }
    }
}

#[test]
fn refinement_lowers_the_objective_and_finds_breaks_between_grid_points() {
    let signal = piecewise(3000, &[(0, &[-0.9], 1.0), (1027, &[-0.9], 8.0), (2074, &[-0.2], 1.0)], 2);
    let settings = with(VarianceEstimate::default(), 50, 10, Some(50));
    let coarse = best_on_grid::<ConditionalLeastSquares>(&signal, &settings, 50);
    let fine = segment(&signal, &settings).unwrap();
    assert!(fine.mdl < coarse.mdl, "{} not below {}", fine.mdl, coarse.mdl);
    assert_eq!(fine.breaks.len(), 2);
    assert!(fine.breaks[0].abs_diff(1027) <= 3 && fine.breaks[1].abs_diff(2074) <= 12, "{:?}", fine.breaks);
}

#[test]
fn a_stationary_signal_is_one_segment_of_its_own_order() {
    let signal = piecewise(20_000, &[(0, &[-1.8, 1.6, -0.7], 2.0)], 9);
    let found = segment(&signal, &SegmentationSettings::default()).unwrap();
    assert_eq!((found.breaks, found.orders), (vec![], vec![3]));
}

#[test]
fn digital_silence_becomes_a_segment() {
    let signal = piecewise(4000, &[(0, &[-0.9], 1.0), (1000, &[], 0.0), (3000, &[-0.5], 1.0)], 4);
    let found = segment(&signal, &SegmentationSettings::default()).unwrap();
    assert_eq!(found.breaks, [1000, 3000]);
    assert!(found.mdl.is_finite());
}

#[test]
fn spans_are_respected_and_cover_the_signal() {
    for (samples, grid) in
        [(4, Some(3)), (5, None), (50, Some(1)), (99, Some(4)), (1013, Some(4)), (4999, None)]
    {
        let signal = piecewise(samples, &[(0, &[-0.9], 1.0), (samples / 3, &[0.5], 2.0)], samples as u64);
        for estimate in ESTIMATES {
            let found = segment(&signal, &with(estimate, 4, 6, grid)).unwrap();
            let segments: Vec<_> = found.segments(samples).collect();
            assert_eq!(segments.len(), found.orders.len());
            assert_eq!(segments.iter().map(|s| s.len()).sum::<usize>(), samples);
            for (segment, &order) in segments.iter().zip(&found.orders) {
                assert!(segment.len() >= 4 && order >= 1 && 2 * order <= segment.len());
            }
        }
    }
}

#[test]
fn the_objective_of_given_breaks_is_that_of_the_search() {
    let (signal, settings) = (process_a(1), SegmentationSettings::default());
    let found = segment(&signal, &settings).unwrap();
    assert_eq!(description_length(&signal, &found.breaks, &settings), Ok(Some(found)));
    for bad in [vec![10], vec![512, 530], vec![1000], vec![2000], vec![600, 300]] {
        assert_eq!(description_length(&signal, &bad, &settings), Ok(None));
    }
}

#[test]
#[cfg(feature = "genetic")]
fn the_genetic_algorithm_finds_no_better_and_repeats_itself() {
    let genetic = GeneticSettings { population: 20, generations: 40, ..Default::default() };
    for signal in [process_a(3), process_b(4)] {
        let settings = SegmentationSettings {
            method: SegmentationMethod::Genetic(genetic.clone()),
            ..Default::default()
        };
        let evolved = segment(&signal, &settings).unwrap();
        let exact = segment(&signal, &SegmentationSettings::default()).unwrap();
        assert!(exact.mdl <= evolved.mdl + 1e-9, "{} above {}", exact.mdl, evolved.mdl);
        assert!(
            evolved.mdl < exact.mdl + 20.0,
            "the genetic algorithm is lost: {} against {}",
            evolved.mdl,
            exact.mdl
        );
        assert_eq!(segment(&signal, &settings).unwrap(), evolved);
    }
}

#[test]
#[cfg(feature = "genetic")]
#[ignore = "gives the genetic algorithm a minute on each of three recordings' worth of signal"]
fn a_minute_of_evolution_is_not_enough() {
    let limit = Some(std::time::Duration::from_secs(60));
    let genetic = GeneticSettings {
        generations: usize::MAX,
        patience: usize::MAX,
        time_limit: limit,
        ..Default::default()
    };
    let nineteen: Vec<Piece> = (0..19)
        .map(|i| {
            (i * 5230, if i % 2 == 0 { &[-1.32, 0.81][..] } else { &[-1.2, 0.7] }, 1.0 + i as f64 / 10.0)
        })
        .collect();
    for signal in [process_a(3), process_b(4), piecewise(100_000, &nineteen, 1)] {
        let settings = SegmentationSettings {
            method: SegmentationMethod::Genetic(genetic.clone()),
            ..Default::default()
        };
        let evolved = segment(&signal, &settings).unwrap();
        let exact = segment(&signal, &SegmentationSettings::default()).unwrap();
        assert!(exact.mdl <= evolved.mdl + 1e-9, "{} above {}", exact.mdl, evolved.mdl);
    }
}

#[test]
fn unusable_signals_are_refused_with_the_reason() {
    let refused = |signal: &[f64], settings: &SegmentationSettings| segment(signal, settings).unwrap_err();
    let settings = SegmentationSettings::default();
    let mut broken = process_a(1);
    broken[77] = f64::NAN;
    assert!(matches!(refused(&broken, &settings), SegmentationError::NotFinite { index: 77, .. }));
    broken[77] = f64::INFINITY;
    assert!(matches!(refused(&broken, &settings), SegmentationError::NotFinite { index: 77, .. }));
    assert!(matches!(refused(&[], &settings), SegmentationError::TooShort { samples: 0, min_span: 50 }));
    assert!(matches!(refused(&[1.0, -1.0], &settings), SegmentationError::TooShort { .. }));
    assert_eq!(refused(&[0.0; 1000], &settings), SegmentationError::Constant { value: 0.0 });
    assert_eq!(refused(&[9.81; 1000], &settings), SegmentationError::Constant { value: 9.81 });
    let signal = process_a(1);
    for (settings, name) in [
        (with(ESTIMATES[0], 3, 20, None), "min_span"),
        (with(ESTIMATES[0], 50, 0, None), "max_order"),
        (with(ESTIMATES[0], 50, 33, None), "max_order"),
        (with(ESTIMATES[0], 50, 20, Some(0)), "grid"),
        (with(ESTIMATES[0], 50, 20, Some(51)), "grid"),
    ] {
        assert!(
            matches!(refused(&signal, &settings), SegmentationError::Setting { setting, .. } if setting == name)
        );
    }
}

#[test]
fn tiny_and_huge_amplitudes_are_segmented_alike() {
    let signal = process_a(12);
    let expected = segment(&signal, &SegmentationSettings::default()).unwrap();
    for scale in [1e-150, 1e150, 1e-290, 1e300, 2f64.powi(-400), 2f64.powi(300)] {
        let scaled: Vec<f64> = signal.iter().map(|x| x * scale).collect();
        let found = segment(&scaled, &SegmentationSettings::default()).unwrap();
        assert_eq!(
            (found.breaks, found.orders),
            (expected.breaks.clone(), expected.orders.clone()),
            "{scale:e}"
        );
        let shift = signal.len() as f64 * scale.ln();
        assert!((found.mdl - shift - expected.mdl).abs() < 1e-9 * shift.abs(), "{scale:e}");
    }
}
