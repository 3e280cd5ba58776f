//! No input panics, and no result that is returned as good holds NaN.

use haptograph_study::statistics::StatisticsError;
use haptograph_study::statistics::anova::{self, centred_by_person, columns};
use haptograph_study::statistics::effect::{equivalence, paired_effect};
use haptograph_study::statistics::psychometric::{Block, FitSettings, Shape, fit};
use haptograph_study::statistics::ranks::{friedman, holm, ranks, wilcoxon, wilcoxon_pairs};
use haptograph_study::statistics::regression::{correlation_matrix, pearson, regress};
use haptograph_study::statistics::repeated;
use haptograph_study::statistics::space::perceptual_space;
use haptograph_study::statistics::studentized_range::{quantile, survival};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;

const ODD: [f64; 14] = [
    0.0,
    -0.0,
    1.0,
    0.5,
    -1.0,
    1e-300,
    5e-324,
    1e154,
    -1e300,
    f64::MAX,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    0.5000000000000001,
];

/// Errors are fine; what is returned has to be numbers throughout.
#[track_caller]
fn checked<T: Serialize + std::fmt::Debug>(what: &str, result: Result<T, StatisticsError>) -> bool {
    match result {
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
        Ok(found) => {
            let text = format!("{found:?}");
            assert!(!text.contains("NaN") && !text.contains("inf"), "{what}: {text}");
            true
        }
    }
}

/// Runs every test of rows of people; returns how many gave a result.
fn run(rows: &[Vec<f64>]) -> usize {
    let by_condition = columns(rows);
    let cells: Vec<(usize, usize, f64)> =
        rows.iter().flatten().enumerate().map(|(i, &x)| (i % 2, i / 2 % 2, x)).collect();
    let (first, rest) = by_condition.split_first().map_or((&[][..], &[][..]), |(f, r)| (&f[..], r));
    let second = rest.first().map_or(&[][..], |r| &r[..]);
    let results = [
        checked("one-way", anova::one_way(&by_condition)),
        checked("centred", anova::one_way(&columns(&centred_by_person(rows)))),
        checked("two-way", anova::two_way(&cells, true)),
        checked("additive", anova::two_way(&cells, false)),
        checked("tukey", anova::one_way(&by_condition).and_then(|found| found.tukey(0.95))),
        checked("within", repeated::one_way(rows)),
        checked("within tukey", repeated::one_way(rows).and_then(|found| found.tukey(0.95))),
        checked("two within", repeated::two_way(rows, 2, 2)),
        checked("friedman", friedman(rows)),
        checked("wilcoxon", wilcoxon(first)),
        checked("pairs", wilcoxon_pairs(rows)),
        checked("regress", regress(rest, first, true)),
        checked("regress 0", regress(rest, first, false)),
        first.len() == 3 || checked("pearson", pearson(first, second, 0.95)),
        rows.len() == 3 || checked("matrix", correlation_matrix(&by_condition, 0.95)),
        checked("effect", paired_effect(first, second, 0.95)),
        checked("equivalence", equivalence(first, (-1.0, 1.0), 0.05)),
        checked("space", perceptual_space(first, 4, 2, 3)),
    ];
    assert_eq!((ranks(first).len(), holm(first).len()), (first.len(), first.len()));
    results.iter().filter(|&&given| given).count()
}

#[test]
fn empty_single_and_constant_tables_are_errors_or_numbers() {
    assert_eq!(run(&[]), 0);
    assert_eq!(run(&[vec![]]), 0);
    run(&[vec![0.1, 0.2, 0.3, 0.4]]);
    run(&[vec![0.1], vec![0.2]]);
    run(&[vec![0.1, 0.2], vec![0.3]]);
    for constant in ODD {
        run(&vec![vec![constant; 4]; 6]);
        run(&vec![vec![0.1, 0.2, 0.3, constant]; 6]);
    }
}

#[test]
fn random_tables_with_odd_values_do_not_panic() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
    let mut given = 0;
    for round in 0..80 {
        let (people, conditions) = (random.random_range(0..9), random.random_range(0..6));
        let odd = if round % 2 == 0 { 0.0 } else { random.random_range(0.0..1.0_f64).powi(3) };
        let mut value = || {
            let x: f64 = random.random_range(0.0..1.0);
            if random.random::<f64>() < odd {
                ODD[random.random_range(0..ODD.len())]
            } else {
                (x * 10.0).round() / 10.0
            }
        };
        let rows: Vec<Vec<f64>> = (0..people).map(|_| (0..conditions).map(|_| value()).collect()).collect();
        given += run(&rows);
    }
    assert!(given > 100, "{given} results");
}

#[test]
fn odd_arguments_of_functions_do_not_panic() {
    for a in ODD {
        for b in ODD {
            for groups in [0, 1, 2, 7, usize::MAX] {
                let p = survival(a, groups, b);
                assert!(p.is_nan() || (0.0..=1.0).contains(&p), "{a} {groups} {b}: {p}");
            }
            let q = quantile(a, 3, b);
            assert!(q.is_nan() || q >= 0.0);
            let values = [0.1, 0.4, 0.2, 0.9];
            let _ = (pearson(&values, &[1.0, a, b, 2.0], a), equivalence(&values, (a, b), 0.05));
            let _ = (equivalence(&values, (-1.0, 1.0), a), paired_effect(&values, &[a, b, 0.3, 0.1], b));
            let _ = (perceptual_space(&[a, b, 0.5], 3, 2, 2), perceptual_space(&[a], usize::MAX, 2, 2));
            let _ = (holm(&[a, b, 0.1]), anova::two_way(&[(usize::MAX, 1, a), (0, 2, b)], true));
            for shape in [Shape::Logistic, Shape::Weibull] {
                let block = |level, positive| Block { level, trials: 10, positive };
                let blocks = [block(a, 0), block(b, 7), block(1.0, 10), block(2.0, 11)];
                let settings = FitSettings { shape, guess: 0.0, resamples: 3, ..FitSettings::default() };
                let _ = (fit(&blocks, &settings), fit(&blocks[..2], &settings), fit(&blocks[..3], &settings));
                let _ = fit(&blocks[1..3], &FitSettings { guess: a, largest_lapse: b, ..settings });
            }
        }
    }
    assert!(regress(&[[1.0, 2.0, 3.0, 4.0], [2.0, 4.0, 6.0, 8.0]], &[1.0, 0.0, 2.0, 5.0], true).is_err());
}
