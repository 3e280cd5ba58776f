//! People made so exactly that the thesis's printed numbers have to come out.

use crate::people::{columns_of, normal, orthonormal, residuals, rows_of};
use haptograph_signal::statistics::Line;
use haptograph_study::statistics::anova::{OneWay, centred_by_person, columns, one_way, two_way};
use haptograph_study::statistics::regression::{correlation_matrix, pearson, regress};
use haptograph_study::statistics::studentized_range::quantile;
use nalgebra::{DMatrix, DVector};
use serde_json::Value;

fn thesis() -> Value {
    serde_json::from_str(include_str!("../../src/thesis-tables.json")).unwrap()
}

/// A number as printed: its value, and half a unit of its last digit.
fn printed(value: &Value) -> (f64, f64) {
    let text = value.to_string();
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let decimals = digits.split_once('.').map_or(0, |(_, after)| after.len()) as i32;
    let exponent: i32 = exponent.parse().unwrap();
    (value.as_f64().unwrap(), 0.5 * 10_f64.powi(exponent - decimals))
}

/// Asserts that a number rounds to the printed one ("<0.001": that it lies below).
#[track_caller]
fn prints_as(what: &str, found: f64, value: &Value) {
    if let Some(bound) = value.as_str().and_then(|text| text.strip_prefix('<')) {
        assert!(found < bound.parse().unwrap(), "{what}: {found}, printed {value}");
    } else {
        let (expected, half) = printed(value);
        assert!((found - expected).abs() <= half * (1.0 + 1e-9), "{what}: {found}, printed {value}");
    }
}

/// The one-way analysis as in the thesis of 15 people who rated four versions of a surface, where the last three lie
/// `differences` residual deviations of a mean below the first.
fn rated(differences: [f64; 3], seed: u64) -> OneWay {
    let mut table = residuals(15, 4, 56.0, seed);
    for (version, q) in (1..).zip(differences) {
        table.column_mut(version).add_scalar_mut(-q / 15_f64.sqrt());
    }
    let biases = normal(15, 1, seed + 1);
    let rows: Vec<Vec<f64>> = rows_of(&(table * 0.08))
        .iter()
        .zip(&biases)
        .map(|(row, bias)| row.iter().map(|x| 0.5 + 0.1 * bias + x).collect())
        .collect();
    one_way(&columns(&centred_by_person(&rows))).unwrap()
}

/// Rates every surface so that the printed p against the first version have to come out; counts them. A version without a
/// printed p lies where it is not significant.
fn recovered(tables: [&Value; 3]) -> usize {
    let mut count = 0;
    for (seed, surface) in (1..).zip(tables[0].as_object().unwrap().keys()) {
        let of = |table: &Value| table[surface].as_f64().map_or(0.5, |p| quantile(p, 4, 56.0));
        let found = rated(tables.map(of), 10 * seed);
        assert_eq!((found.effect.df, found.residual.df), (3.0, 56.0));
        for (pair, table) in found.tukey(0.95).unwrap().iter().zip(tables) {
            if table[surface].is_null() {
                assert!(pair.p > 0.05, "{surface}: {}", pair.p);
            } else {
                prints_as(surface, pair.p, &table[surface]);
                assert!(pair.high < 0.0, "the interval excludes zero just where p is below 0.05");
                count += 1;
            }
        }
    }
    count
}

#[test]
fn all_printed_p_of_responsiveness_come_out() {
    let study = &thesis()["studies"]["4.5"];
    assert_eq!(
        recovered([&study["p_F_against_FS"], &study["p_S_against_FS"], &study["p_phi_against_FS"]]),
        22
    );
}

#[test]
fn all_printed_p_of_friction_taps_and_texture_come_out() {
    let study = &thesis()["studies"]["4.6"];
    let tables = ["p_without_friction", "p_without_taps", "p_without_texture"];
    assert_eq!(recovered(tables.map(|name| &study[name])), 16);
}

/// q of the printed p of ABS Plastic: 1.768 and 1.730 residual deviations below the first condition.
#[test]
fn the_first_surface_lies_where_arithmetic_puts_it() {
    for (p, deviations) in [(6.12e-5, 1.768), (8.75e-5, 1.730)] {
        assert!((quantile(p, 4, 56.0) / 15_f64.sqrt() - deviations).abs() < 5e-4);
    }
}

#[test]
fn all_printed_f_of_textures_real_and_virtual_come_out() {
    let anova = &thesis()["studies"]["3.3"]["anova"];
    let mut count = 0;
    for (measure, replicates) in [
        ("power", 30),
        ("spectral_centroid", 30),
        ("speed", 30),
        ("force", 30),
        ("roughness", 10),
        ("hardness", 10),
        ("slipperiness", 10),
        ("fineness", 10),
    ] {
        let printed = [&anova[measure]["texture"], &anova[measure]["real_virtual"]];
        for with_interaction in [true, false] {
            let parameters = if with_interaction { 10 } else { 6 };
            let df = 10 * replicates - parameters;
            let observations =
                two_way_people(printed.map(|term| term["F"].as_f64().unwrap()), replicates, df);
            let found = two_way(&observations, with_interaction).unwrap();
            assert_eq!(found.residual.df, df as f64);
            for (term, printed) in [found.a, found.b].iter().zip(printed) {
                prints_as(measure, term.f, &printed["F"]);
                prints_as(measure, term.p, &printed["p"]);
                count += 1;
            }
            assert!(found.interaction.is_none_or(|term| term.f < 1e-9));
        }
    }
    assert_eq!(count, 2 * 16, "with and without interaction");
}

/// Answers on five textures, real and virtual, with the given F of both and no interaction, at an error mean square of 1.
fn two_way_people(f: [f64; 2], replicates: usize, df: usize) -> Vec<(usize, usize, f64)> {
    let mut table = residuals(replicates, 10, df as f64, 5);
    let texture = orthonormal(5, 1, 6) * (4.0 * f[0] / (2 * replicates) as f64).sqrt();
    let kind = (f[1] / (10 * replicates) as f64).sqrt();
    for cell in 0..10 {
        let sign = if cell % 2 == 0 { 1.0 } else { -1.0 };
        table.column_mut(cell).add_scalar_mut(texture[cell / 2] + sign * kind);
    }
    let place = |(i, &x)| (i / replicates / 2, i / replicates % 2, x);
    table.as_slice().iter().enumerate().map(place).collect()
}

/// Columns whose correlations are the given ones exactly.
fn correlated(matrix: &DMatrix<f64>, count: usize) -> Vec<Vec<f64>> {
    let factor = matrix.clone().cholesky().expect("positive definite").l();
    columns_of(&(orthonormal(count, matrix.nrows(), 7) * factor.transpose()))
}

#[test]
fn all_printed_correlations_come_out() {
    let tables = &thesis()["tables"];
    for (name, count) in [("3.2", 10), ("4.3", 15), ("4.4", 15)] {
        let values = &tables[name]["values"];
        let size = values.as_array().unwrap().len();
        // Table 4.4 prints two numbers for one correlation: either is recovered.
        for upper in [true, false] {
            let pick = |a: usize, b: usize| if upper == (a < b) { &values[a][b] } else { &values[b][a] };
            let matrix = DMatrix::from_fn(size, size, |a, b| pick(a.min(b), a.max(b)).as_f64().unwrap());
            let found = correlation_matrix(&correlated(&matrix, count), 0.95).unwrap();
            for (a, b) in (0..size).flat_map(|a| (0..a).map(move |b| (a, b))) {
                prints_as(name, found[a][b].r.value, if upper { &values[b][a] } else { &values[a][b] });
                assert_eq!(found[a][b], found[b][a]);
            }
        }
    }
}

/// Significance of Tables 3.2, 4.3 and 4.4: every printed p lies between those of the ends of its printed correlation.
#[test]
fn printed_p_of_correlations_follow_from_them() {
    let tables = &thesis()["tables"];
    let p = |r: f64, count: usize| {
        let columns = correlated(&DMatrix::from_row_slice(2, 2, &[1.0, r, r, 1.0]), count);
        pearson(&columns[0], &columns[1], 0.95).unwrap().p
    };
    for (name, place, count) in [("4.3", (2, 0), 15), ("4.4", (2, 0), 15)] {
        let (r, half) = printed(&tables[name]["values"][place.0][place.1]);
        let (expected, rounding) = printed(&tables[name]["p"]["roughness_slipperiness"]);
        assert!(
            p(r.abs() + half, count) - rounding < expected && expected < p(r.abs() - half, count) + rounding
        );
    }
    for (r, bound) in [(0.81, 0.005), (0.83, 0.005), (0.98, 0.005)] {
        assert!(p(r, 10) < bound);
    }
    assert!(p(0.25, 10) > 0.05 && p(0.26, 15) > 0.05 && p(0.43, 15) > 0.05);
}

/// x and y at the given squared correlation over `count` surfaces, y rising by `slope`.
fn on_a_line(r2: f64, slope: f64, count: usize) -> (Vec<f64>, Vec<f64>) {
    let pair = orthonormal(count, 2, 8);
    let spread = (1.0 / r2 - 1.0).sqrt();
    let y = slope * (pair.column(0) + pair.column(1) * spread);
    (pair.column(0).iter().copied().collect(), y.iter().map(|y| 3.0 + y).collect())
}

#[test]
fn all_printed_slopes_of_table_4_2_come_out() {
    let rows = &thesis()["tables"]["4.2"]["rows"];
    for row in rows.as_array().unwrap() {
        for at in [1, 3, 5] {
            let (x, y) = on_a_line(row[at + 1].as_f64().unwrap(), row[at].as_f64().unwrap(), 15);
            let found = regress(&[&x], &y, true).unwrap();
            prints_as("slope", found.coefficients[0].estimate.value, &row[at]);
            prints_as("R2", found.r_squared, &row[at + 1]);
            let line = Line::fit(&x.iter().copied().zip(y).collect::<Vec<_>>()).unwrap();
            assert!((line.slope / found.coefficients[0].estimate.value - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn printed_p_of_regressions_lie_within_the_rounding_of_r2() {
    let regressions = &thesis()["studies"]["4.6"]["regressions"];
    let nested = regressions["real_on_virtual"].as_object().unwrap().values();
    let all: Vec<&Value> =
        regressions.as_object().unwrap().values().chain(nested).filter(|r| r["r2"].is_number()).collect();
    assert_eq!(all.len(), 13);
    let p = |r2: f64| {
        let (x, y) = on_a_line(r2, 1.0, 15);
        regress(&[&x], &y, true).unwrap().coefficients[0].p
    };
    for regression in all {
        let ((r2, half), (expected, rounding)) = (printed(&regression["r2"]), printed(&regression["p"]));
        let (low, high) = (p(r2 + half) - rounding, p(r2 - half) + rounding);
        assert!((low..=high).contains(&expected), "{regression}: {low:e} to {high:e}");
    }
}

#[test]
fn equation_3_3_1_comes_out_of_absolute_differences() {
    let printed = &thesis()["studies"]["3.3"]["regression"];
    let ratings = normal(10, 4, 9);
    let pairs: Vec<(usize, usize)> = (0..10).flat_map(|a| (a + 1..10).map(move |b| (a, b))).collect();
    let differences = DMatrix::from_fn(45, 4, |row, scale| {
        (ratings[(pairs[row].0, scale)] - ratings[(pairs[row].1, scale)]).abs()
    });
    let b: Vec<f64> =
        printed["coefficients"].as_array().unwrap().iter().map(|b| b.as_f64().unwrap()).collect();
    for with_intercept in [true, false] {
        let intercept = if with_intercept { 0.4 } else { 0.0 };
        let y = dissimilarities(&differences, &b, intercept, printed["r2"].as_f64().unwrap());
        let found = regress(&columns_of(&differences), y.as_slice(), with_intercept).unwrap();
        for (coefficient, printed) in
            found.coefficients.iter().zip(printed["coefficients"].as_array().unwrap())
        {
            prints_as("b", coefficient.estimate.value, printed);
        }
        prints_as("R2", found.r_squared, &printed["r2"]);
        assert!(found.intercept.is_none_or(|b| (b.estimate.value - intercept).abs() < 1e-9));
    }
}

/// A value a pair: a plane over the differences, and residuals at right angles to it and to the mean, of which R2 is `r2`.
fn dissimilarities(differences: &DMatrix<f64>, b: &[f64], intercept: f64, r2: f64) -> DVector<f64> {
    let plane = differences * DVector::from_row_slice(b);
    let mut all = differences.clone().insert_column(0, 1.0).insert_column(5, 0.0);
    all.set_column(5, &normal(45, 1, 10).column(0));
    let residual = all.qr().q().column(5).into_owned();
    let centre = if intercept == 0.0 { 0.0 } else { plane.mean() };
    let explained: f64 = plane.iter().map(|y| (y - centre).powi(2)).sum();
    (plane + residual * (explained * (1.0 / r2 - 1.0)).sqrt()).add_scalar(intercept)
}
