//! Agreement with R on ratings.csv (see data/reference.R).

use haptograph_learning::evaluate::hierarchical;
use haptograph_study::statistics::anova::{OneWay, Term, one_way, two_way};
use haptograph_study::statistics::effect::{equivalence, paired_effect};
use haptograph_study::statistics::psychometric::{Block, FitSettings, Shape, fit};
use haptograph_study::statistics::ranks::{friedman, holm, wilcoxon};
use haptograph_study::statistics::regression::{correlation_matrix, pearson, regress};
use haptograph_study::statistics::repeated::{self, WithinTerm};
use haptograph_study::statistics::share::{abx_d_prime, abx_share};
use haptograph_study::statistics::space::perceptual_space;
use haptograph_study::statistics::{studentized_range, tukey};
use std::collections::HashMap;

struct Reference(HashMap<&'static str, f64>);

impl Reference {
    fn new() -> Self {
        let lines = include_str!("../data/reference.csv").lines().map(|line| line.split_once(',').unwrap());
        Self(lines.map(|(name, value)| (name, value.parse().unwrap())).collect())
    }

    fn get(&self, name: &str) -> f64 {
        *self.0.get(name).unwrap_or_else(|| panic!("{name}"))
    }

    /// Asserts that a value is R's to a part in `1 / tolerance`.
    #[track_caller]
    fn within(&self, name: &str, value: f64, tolerance: f64) {
        let expected = self.get(name);
        let error = (value - expected).abs() / expected.abs().max(1e-6);
        assert!(error <= tolerance, "{name}: {value}, R {expected}, {error:e} apart");
    }

    #[track_caller]
    fn same(&self, name: &str, value: f64) {
        self.within(name, value, 1e-6);
    }

    #[track_caller]
    fn same_term(&self, name: &str, term: &Term) {
        self.same(&format!("{name}.ss"), term.ss);
        self.same(&format!("{name}.f"), term.f);
        self.same(&format!("{name}.p"), term.p);
    }
}

/// (person, surface, condition, rating), numbered in order of appearance.
fn ratings() -> Vec<(usize, usize, usize, f64)> {
    let rows = include_str!("../data/ratings.csv").lines().skip(1).enumerate();
    let number = |(i, line): (usize, &str)| {
        (i / 12, i / 4 % 3, i % 4, line.rsplit(',').next().unwrap().parse().unwrap())
    };
    rows.map(number).collect()
}

/// A row a person: surfaces, and conditions in each.
fn wide() -> Vec<Vec<f64>> {
    ratings().chunks(12).map(|person| person.iter().map(|r| r.3).collect()).collect()
}

fn column(rows: &[Vec<f64>], column: usize) -> Vec<f64> {
    rows.iter().map(|row| row[column]).collect()
}

fn silk() -> Vec<Vec<f64>> {
    wide().iter().map(|row| row[4..8].to_vec()).collect()
}

/// The first 50 ratings of cork.
fn cork() -> OneWay {
    let mut groups = vec![vec![]; 4];
    for (_, _, condition, rating) in ratings().into_iter().filter(|r| r.1 == 0).take(50) {
        groups[condition].push(rating);
    }
    one_way(&groups).unwrap()
}

#[test]
fn one_way_and_tukey_are_those_of_aov() {
    let (r, found) = (Reference::new(), cork());
    r.same_term("one_way", &found.effect);
    r.same("one_way.error_ss", found.residual.ss);
    let (low, high) = found.effect.partial_eta_squared_90.unwrap();
    r.same("one_way.eta_ends.0", low);
    r.same("one_way.eta_ends.1", high);
    for (i, pair) in found.tukey(0.95).unwrap().iter().enumerate() {
        r.same(&format!("tukey.difference.{i}"), pair.difference);
        r.same(&format!("tukey.low.{i}"), pair.low);
        r.same(&format!("tukey.high.{i}"), pair.high);
        r.same(&format!("tukey.p.{i}"), pair.p);
    }
}

#[test]
fn two_way_is_that_of_lm_balanced_or_not() {
    let r = Reference::new();
    let all: Vec<_> = ratings().iter().map(|r| (r.1, r.2, r.3)).collect();
    let uneven: Vec<_> = all.iter().enumerate().filter(|(i, _)| i % 7 != 0).map(|(_, &o)| o).collect();
    for (name, observations, with) in [
        ("two_way", &all, true),
        ("additive", &all, false),
        ("uneven", &uneven, true),
        ("uneven_additive", &uneven, false),
    ] {
        let found = two_way(observations, with).unwrap();
        r.same_term(&format!("{name}.a"), &found.a);
        r.same_term(&format!("{name}.b"), &found.b);
        r.same(&format!("{name}.error_df"), found.residual.df);
        assert_eq!(found.interaction.is_some(), with);
        if let Some(interaction) = &found.interaction {
            r.same_term(&format!("{name}.interaction"), interaction);
        }
    }
    r.same_term("two_way.aov", &two_way(&all, true).unwrap().a);
}

#[track_caller]
fn same_within(r: &Reference, name: &str, term: &WithinTerm) {
    r.same_term(name, &term.effect);
    r.same(&format!("{name}.epsilon"), term.epsilon);
    r.same(&format!("{name}.gg_p"), term.p_corrected);
}

#[test]
fn repeated_measures_are_those_of_aov_and_anova_mlm() {
    let r = Reference::new();
    let one = repeated::one_way(&silk()).unwrap();
    same_within(&r, "within", &one.term);
    let two = repeated::two_way(&wide(), 3, 4).unwrap();
    same_within(&r, "within.a", &two.a);
    same_within(&r, "within.b", &two.b);
    same_within(&r, "within.interaction", &two.interaction);
    assert_eq!((one.people, two.people), (15, 15));
}

#[test]
fn people_with_a_missing_cell_are_left_out() {
    let mut rows = silk();
    rows[3][1] = f64::NAN;
    let found = repeated::one_way(&rows).unwrap();
    assert_eq!(found.people, 14);
    rows.remove(3);
    assert_eq!(repeated::one_way(&rows).unwrap().term, found.term);
    let pairs = found.tukey(0.95).unwrap();
    assert_eq!(pairs.len(), 6);
    assert_eq!(pairs, tukey::tukey(&found.means, &[14; 4], &found.term.error, 0.95).unwrap());
}

#[test]
fn the_studentized_range_is_rs() {
    let r = Reference::new();
    for (name, &value) in &r.0 {
        let fields: Vec<&str> = name.split('.').collect();
        let last = |i: usize| fields[fields.len() - i].parse::<usize>().unwrap();
        if fields[0] == "ptukey" {
            let q: f64 = fields[1..fields.len() - 2].join(".").parse().unwrap();
            let found = 1.0 - studentized_range::survival(q, last(2), last(1) as f64);
            assert!((found - value).abs() < 1e-9, "{name}: {found}, R {value}");
        } else if fields[0] == "qtukey" {
            r.same(name, studentized_range::quantile(0.05, last(2), last(1) as f64));
        }
    }
    // Two groups are a t test, which for two degrees of freedom is algebra: R 4.2's `ptukey` is 7e-6 off here.
    let t = 0.5 / 2_f64.sqrt();
    assert!((1.0 - studentized_range::survival(0.5, 2, 2.0) - t / (2.0 + t * t).sqrt()).abs() < 1e-10);
}

/// Against quadrature of the same integrals in numbers of 20 digits (mpmath 1.3).
#[test]
fn tails_of_the_studentized_range_keep_their_digits() {
    for (q, groups, df, expected) in [
        (3.5, 4, 56.0, 0.075_030_241_894_794_63),
        (6.0, 10, 14.0, 0.019_745_107_849_708_55),
        (9.5, 4, 42.0, 2.179_302_105_614_600_7e-7),
        (9.5, 4, 56.0, 6.024_218_594_756_451e-8),
        (15.0, 10, 56.0, 2.319_481_412_429_94e-13),
    ] {
        let found = studentized_range::survival(q, groups, df);
        assert!((found / expected - 1.0).abs() < 1e-10, "{q}, {groups}, {df}: {found:e}, {expected:e}");
        let back = studentized_range::quantile(found, groups, df);
        assert!((back / q - 1.0).abs() < 1e-12, "{back}");
    }
}

#[test]
fn tests_on_ranks_are_rs() {
    let r = Reference::new();
    let found = friedman(&silk()).unwrap();
    r.same("friedman.0", found.chi_squared);
    r.same("friedman.1", found.p);
    let (before, after) = (column(&wide(), 4), column(&wide(), 5));
    let differences: Vec<f64> = after.iter().zip(&before).map(|(a, b)| a - b).collect();
    let untied: Vec<f64> = (1..).zip(&differences).map(|(i, d)| d + f64::from(i) / 1000.0 + 0.0003).collect();
    // Subtraction of decimals would break ties, in R too.
    let tied: Vec<f64> = differences.iter().map(|d| (d * 100.0).round()).collect();
    for (name, values, exact) in [("ties", &tied, false), ("exact", &untied, true)] {
        let found = wilcoxon(values).unwrap();
        assert_eq!(found.exact, exact);
        r.same(&format!("wilcoxon.{name}.0"), found.positive_ranks);
        r.same(&format!("wilcoxon.{name}.1"), found.p);
    }
    for (i, p) in holm(&[0.01, 0.04, 0.03, 0.2, 0.005]).into_iter().enumerate() {
        r.same(&format!("holm.{i}"), p);
    }
}

#[test]
fn regression_and_correlation_are_rs() {
    let (r, wide) = (Reference::new(), wide());
    let columns: Vec<Vec<f64>> = (0..4).map(|i| column(&wide, i)).collect();
    for (name, with) in [("lm", true), ("lm0", false)] {
        let found = regress(&columns[..3], &columns[3], with).unwrap();
        for (i, b) in found.intercept.iter().chain(&found.coefficients).enumerate() {
            r.same(&format!("{name}.b.{i}"), b.estimate.value);
            r.same(&format!("{name}.se.{i}"), b.standard_error);
            r.same(&format!("{name}.p.{i}"), b.p);
            r.same(&format!("{name}.low.{i}"), b.estimate.low);
        }
        for (i, value) in [(0, found.r_squared), (2, found.f), (3, found.p)] {
            r.same(&format!("{name}.{i}"), value);
        }
    }
    let found = pearson(&columns[0], &columns[3], 0.95).unwrap();
    r.same("pearson.0", found.r.value);
    r.same("pearson.1", found.p);
    r.same("pearson.interval.0", found.r.low);
    r.same("pearson.interval.1", found.r.high);
    assert_eq!(correlation_matrix(&columns, 0.95).unwrap()[0][3], found);
}

#[test]
fn effects_and_equivalence_are_rs() {
    let (r, wide) = (Reference::new(), wide());
    let (before, after) = (column(&wide, 4), column(&wide, 5));
    let found = paired_effect(&before, &after, 0.95).unwrap();
    r.same("dz.0", found.d_z.value);
    r.same("dz.1", found.d_z.low);
    r.same("dz.2", found.d_z.high);
    let differences: Vec<f64> = after.iter().zip(&before).map(|(a, b)| a - b).collect();
    let found = equivalence(&differences, (-0.25, 0.25), 0.05).unwrap();
    r.same("tost.low", found.p_low);
    r.same("tost.high", found.p_high);
    r.same("tost.interval.0", found.mean.low);
    r.same("tost.interval.1", found.mean.high);
    assert!(found.equivalent);
    assert!(!equivalence(&differences, (-0.1, 0.25), 0.05).unwrap().equivalent);
}

#[test]
fn scaling_and_the_tree_are_rs() {
    let r = Reference::new();
    let places: Vec<Vec<f64>> =
        (0..10).map(|i| (0..3).map(|j| r.get(&format!("points.{}", 3 * i + j))).collect()).collect();
    let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let distances: Vec<f64> = (0..10)
        .flat_map(|a| (a + 1..10).map(move |b| (a, b)))
        .map(|(a, b)| distance(&places[a], &places[b]))
        .collect();
    for (i, merge) in hierarchical(&distances, 10).iter().enumerate() {
        r.same(&format!("ward.{i}"), merge.distance);
    }
    let given: Vec<f64> = distances.iter().map(|d| d.powf(1.7) + 0.02).collect();
    let found = perceptual_space(&given, 10, 3, 3).unwrap();
    // Both stop near an optimum, each by its own rule.
    let stress = |k: usize| r.get(&format!("isoMDS.{k}"));
    r.within("isoMDS.1", found.stress[0], 1e-5);
    assert!(found.stress[1] < 1.1 * stress(2) && found.stress[2] < stress(3), "{:?}", found.stress);
}

#[test]
fn a_logistic_function_without_lapses_is_a_logistic_regression() {
    let r = Reference::new();
    let block = |(level, positive)| Block { level, trials: 20, positive };
    let levels = (1..).map(f64::from).zip([2, 5, 11, 15, 18, 20]);
    let blocks: Vec<Block> = levels.map(block).collect();
    let settings = FitSettings { guess: 0.0, largest_lapse: 0.0, resamples: 0, ..FitSettings::default() };
    let found = fit(&blocks, &FitSettings { shape: Shape::Logistic, ..settings }).unwrap();
    r.within("glm.0", -found.threshold.value * found.slope.value, 1e-5);
    r.within("glm.1", found.slope.value, 1e-5);
    r.same("glm.2", found.deviance);
}

#[test]
fn sign_tests_are_those_of_binom_test_and_their_intervals_those_of_prop_test() {
    // R 4.2.2: binom.test(x, n)$p.value and prop.test(x, n, correct = FALSE)$conf.int.
    for (count, all, p, low, high) in [
        (14, 20, 0.115_318_298_34, 0.481_027_181_646, 0.854_522_755_132),
        (1, 8, 0.070_312_5, 0.022_417_491_450_1, 0.470_888_182_213),
        (5, 10, 1.0, 0.236_593_090_513, 0.763_406_909_487),
        (0, 5, 0.062_5, 0.0, 0.434_482_464_783),
        (61, 100, 0.035_200_200_217_7, 0.512_030_170_458, 0.699_831_259_936),
    ] {
        let share = haptograph_study::statistics::share::Share::of(count, all);
        assert!((haptograph_study::statistics::ranks::sign_test(count as u64, all as u64) - p).abs() < 1e-9);
        assert!((share.low - low).abs() < 1e-6 && (share.high - high).abs() < 1e-6, "{share:?}");
    }
    assert_eq!(haptograph_study::statistics::ranks::sign_test(0, 0), 1.0);
}

#[test]
fn d_prime_of_abx_is_that_of_the_differencing_model() {
    // R 4.2.2: uniroot of pnorm(d / sqrt(2)) * pnorm(d / sqrt(6)) + pnorm(-d / sqrt(2)) * pnorm(-d / sqrt(6)) - share, as dprime.ABX of
    // psyphy 0.3; its example has hits 0.75 and false alarms 0.3. To two digits Table A5.3 of Macmillan and Creelman.
    let known = [
        (0.55, 0.761_412_170),
        (0.75, 2.020_039_193),
        (0.725_561_963, 1.868_676_586),
        (0.95, 4.072_401_973),
        (0.99, 5.700_868_248),
    ];
    for (share, d_prime) in known {
        let found = abx_d_prime(share).expect("defined");
        assert!((found - d_prime).abs() < 3e-6, "{share}: {found}, {d_prime}");
        assert!((abx_share(found) - share).abs() < 1e-12, "{share}");
    }
    assert_eq!(abx_d_prime(0.5), Some(0.0));
    for share in [0.0, 0.499, 1.0, f64::NAN] {
        assert_eq!(abx_d_prime(share), None, "{share}");
    }
}
