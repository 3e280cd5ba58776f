//! People made for tests: residuals whose sample moments are exact.

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Normal deviates (Box and Muller), seeded.
pub fn normal(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    DMatrix::from_fn(rows, columns, |_, _| {
        let (u, v) = (random.random_range(f64::MIN_POSITIVE..1.0), random.random_range(0.0..1.0));
        (-2.0 * f64::ln(u)).sqrt() * (std::f64::consts::TAU * v).cos()
    })
}

/// Rows of residuals whose row and column means are zero and whose sum of squares is `ss`.
pub fn residuals(rows: usize, columns: usize, ss: f64, seed: u64) -> DMatrix<f64> {
    let mut table = normal(rows, columns, seed);
    for mut row in table.row_iter_mut() {
        let mean = row.mean();
        row.add_scalar_mut(-mean);
    }
    for mut column in table.column_iter_mut() {
        let mean = column.mean();
        column.add_scalar_mut(-mean);
    }
    let scale = (ss / table.norm_squared()).sqrt();
    table * scale
}

/// Columns with mean zero, at right angles to each other, of length 1.
pub fn orthonormal(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
    let mut table = normal(rows, columns, seed);
    for mut column in table.column_iter_mut() {
        let mean = column.mean();
        column.add_scalar_mut(-mean);
    }
    table.qr().q()
}

pub fn rows_of(table: &DMatrix<f64>) -> Vec<Vec<f64>> {
    table.row_iter().map(|row| row.iter().copied().collect()).collect()
}

pub fn columns_of(table: &DMatrix<f64>) -> Vec<Vec<f64>> {
    table.column_iter().map(|column| column.iter().copied().collect()).collect()
}
