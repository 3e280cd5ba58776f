//! Procedural surfaces: a height field made of noise of a given spatial spectrum, smooth enough to roll a tool over.
//!
//! A square tile of random coefficients, shaped in the Fourier domain and repeated without seams, is the control net of a
//! cubic B-spline: height, slope and curvature are continuous. The field is the trace of the tool's tip,
//! with the tip's radius already included.

use crate::vector::add_scaled;
use haptograph_signal::noise::Gaussian;
use haptograph_signal::{Complex64, fft};
use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

/// Coefficients along each side of the tile.
const SIDE: usize = 1024;
/// Coefficients of a line: its first ones follow its last, so that any four neighbours lie together.
const LINE: usize = SIDE + 3;
/// Distance of neighbouring coefficients, m.
const CELL_M: f64 = 1e-4;

/// Roughness and fineness of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relief {
    /// Root mean square of the height, m.
    pub rms_m: f64,
    /// Mean spatial frequency of the height's power along any direction of travel, 1/m.
    pub fineness_per_m: f64,
    /// Width of the spectrum: standard deviation of the logarithm of spatial frequency.
    pub spread: f64,
    /// Share of the height's rms that is fine grain of all frequencies.
    pub grain: f64,
}

/// A height field over the plane.
#[derive(Debug, Clone)]
pub(crate) struct Terrain {
    coefficients: Arc<[f32]>,
    /// Upper bound of the height, m.
    pub highest_m: f64,
    /// Whole numbers below the last point's places, in cells: a tool stays over a cell for many steps.
    below: [f64; 2],
}

/// Height and slope at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spot {
    /// Height, m.
    pub height_m: f64,
    /// Slopes along x and y.
    pub slope: [f64; 2],
}

impl Terrain {
    /// A piece of a surface; the seed is the piece.
    pub(crate) fn new(relief: &Relief, seed: u64) -> Self {
        let mut field = white(seed);
        transform(&mut field, false);
        let densities = quarter(|row, column| density(relief, frequency(row, column)));
        let coarse: f64 = rows(&densities).flatten().sum();
        let count = (SIDE * SIDE) as f64;
        let (shaped, grain) = (1.0 - relief.grain.powi(2), relief.grain.powi(2));
        let shares: Vec<[f64; HALF + 1]> = densities
            .iter()
            .map(|row| row.map(|density| (shaped * density / coarse + grain / count).sqrt()))
            .collect();
        for (value, share) in field.iter_mut().zip(rows(&shares).flatten()) {
            *value *= share;
        }
        field[0] = Complex64::ZERO;
        let mean_square = field.iter().map(|v| v.norm_sqr()).sum::<f64>() / count;
        let scale = relief.rms_m / mean_square.sqrt() / count.sqrt();
        let responses: [f64; SIDE] = std::array::from_fn(response);
        for (line, across) in field.chunks_exact_mut(SIDE).zip(responses) {
            for (value, along) in line.iter_mut().zip(responses) {
                *value *= scale / (along * across);
            }
        }
        transform(&mut field, true);
        let coefficient = |place: usize| field[place / LINE * SIDE + place % LINE % SIDE].re as f32;
        let coefficients: Arc<[f32]> = (0..SIDE * LINE).map(coefficient).collect();
        let highest_m = coefficients.iter().fold(0.0_f32, |most, c| most.max(*c)).into();
        Self { coefficients, highest_m, below: [0.0; 2] }
    }

    /// Height and slope at a point in m.
    #[inline]
    pub(crate) fn at(&mut self, x_m: f64, y_m: f64) -> Spot {
        let (column, across) = spline(x_m / CELL_M, &mut self.below[0]);
        let (row, along) = spline(y_m / CELL_M, &mut self.below[1]);
        let (mut sums, mut slope) = ([0.0; 2], 0.0);
        for (j, [along, along_slope]) in along.into_iter().enumerate() {
            let first = ((row + j) & (SIDE - 1)) * LINE + column;
            let four = self.coefficients[first..first + 4].iter().zip(across);
            let line = four.fold([0.0; 2], |sums, (c, across)| add_scaled(sums, across, f64::from(*c)));
            sums = add_scaled(sums, line, along);
            slope += along_slope * line[0];
        }
        Spot { height_m: sums[0], slope: [sums[1], slope].map(|s| s / CELL_M) }
    }
}

/// A tile of white noise.
fn white(seed: u64) -> Vec<Complex64> {
    let (mut noise, mut line) = (Gaussian::new(seed), [0.0; SIDE]);
    let mut field = Vec::with_capacity(SIDE * SIDE);
    for _ in 0..SIDE {
        noise.fill(&mut line);
        field.extend(line.map(Complex64::from));
    }
    field
}

/// Highest spatial frequency of the tile along an axis, in cycles a tile.
const HALF: usize = SIDE / 2;

/// The values of a function of the spatial frequencies along and across the rows, in cycles a tile, that is the same with either sign
/// and the other way round.
fn quarter(value: impl Fn(usize, usize) -> f64) -> Vec<[f64; HALF + 1]> {
    let mut values = vec![[0.0; HALF + 1]; HALF + 1];
    for (row, column) in (0..=HALF).flat_map(|row| (0..=row).map(move |column| (row, column))) {
        let value = value(row, column);
        (values[row][column], values[column][row]) = (value, value);
    }
    values
}

/// The rows of the transform: the frequencies above half of a side are the negative ones.
fn rows(quarter: &[[f64; HALF + 1]]) -> impl Iterator<Item = impl Iterator<Item = f64>> {
    quarter
        .iter()
        .chain(quarter[1..HALF].iter().rev())
        .map(|row| row.iter().chain(row[1..HALF].iter().rev()).copied())
}

/// Power by spatial frequency in a cell of the Fourier plane: log-normal along the radius, spread over the circle.
fn density(relief: &Relief, frequency_per_m: f64) -> f64 {
    if frequency_per_m <= 0.0 {
        return 0.0;
    }
    // A straight way sees the plane's waves at an angle, 2/pi of their frequency on average; the mean of a log-normal law is
    // its median times exp(spread^2 / 2).
    let median_per_m = relief.fineness_per_m * FRAC_PI_2 * (-0.5 * relief.spread * relief.spread).exp();
    let away = (frequency_per_m / median_per_m).ln() / relief.spread;
    (-0.5 * away * away).exp() / (frequency_per_m * frequency_per_m)
}

/// Spatial frequency of a coefficient of the transform, 1/m, by its frequencies in cycles a tile.
fn frequency(row: usize, column: usize) -> f64 {
    (column as f64).hypot(row as f64) / (SIDE as f64 * CELL_M)
}

/// Response of the spline to a wave of coefficients, at their places: divided by it, the spline interpolates the field.
fn response(index: usize) -> f64 {
    (2.0 + (TAU * index as f64 / SIDE as f64).cos()) / 3.0
}

/// The two-dimensional Fourier transform, not scaled.
fn transform(field: &mut [Complex64], inverse: bool) {
    let fft = if inverse { fft::inverse(SIDE) } else { fft::forward(SIDE) };
    for _ in 0..2 {
        fft.process(field);
        transpose(field);
    }
}

/// Exchanges rows and columns, in squares that stay in the cache: a column's values lie whole pages apart.
fn transpose(field: &mut [Complex64]) {
    const SQUARE: usize = 16;
    for top in (0..SIDE).step_by(SQUARE) {
        for left in (top..SIDE).step_by(SQUARE) {
            for row in top..top + SQUARE {
                for column in left.max(row + 1)..left + SQUARE {
                    field.swap(row * SIDE + column, column * SIDE + row);
                }
            }
        }
    }
}

/// First of the four coefficients around a place, their weights and the weights' derivatives by the place. `below` is a guess of the
/// whole number below the place, and then is it.
#[inline]
fn spline(place: f64, below: &mut f64) -> (usize, [[f64; 2]; 4]) {
    // What depends on the whole number alone is known before the place is, where it is guessed right.
    if !(0.0..1.0).contains(&(place - *below)) {
        *below = place.floor();
    }
    let t = place - *below;
    let s = 1.0 - t;
    let weights = [
        [s * s * s / 6.0, -0.5 * s * s],
        [(4.0 - 3.0 * t * t * (2.0 - t)) / 6.0, -0.5 * t * (4.0 - 3.0 * t)],
        [(4.0 - 3.0 * s * s * (2.0 - s)) / 6.0, 0.5 * s * (4.0 - 3.0 * s)],
        [t * t * t / 6.0, 0.5 * t * t],
    ];
    // The tile repeats: whole numbers modulo its side, negative ones too.
    ((*below as i64).wrapping_sub(1) as usize & (SIDE - 1), weights)
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::spectrum::{spectral_centroid, welch};
    use haptograph_signal::window::Window;

    const RELIEF: Relief = Relief { rms_m: 1e-5, fineness_per_m: 1000.0, spread: 0.4, grain: 0.02 };

    #[test]
    fn heights_have_the_rms_and_the_slopes_are_their_derivative() {
        let mut terrain = Terrain::new(&RELIEF, 1);
        let mut square = 0.0;
        for k in 0..20_000 {
            let (x, y) = (f64::from(k) * 3.7e-5 - 0.3, f64::from(k) * 2.3e-6 + 0.01);
            let here = terrain.at(x, y);
            square += here.height_m.powi(2) / 20_000.0;
            let step_m = 1e-8;
            let slope = [
                (terrain.at(x + step_m, y).height_m - terrain.at(x - step_m, y).height_m) / (2.0 * step_m),
                (terrain.at(x, y + step_m).height_m - terrain.at(x, y - step_m).height_m) / (2.0 * step_m),
            ];
            assert!(slope.iter().zip(here.slope).all(|(a, b)| (a - b).abs() < 1e-6));
            assert!(here.height_m <= terrain.highest_m);
        }
        assert!((square.sqrt() / 1e-5 - 1.0).abs() < 0.03, "{}", square.sqrt());
    }

    #[test]
    fn the_tile_has_no_seam() {
        let mut terrain = Terrain::new(&RELIEF, 2);
        let period_m = SIDE as f64 * CELL_M;
        for (x, y) in [(0.0, 0.0), (1e-3, -2e-3), (-0.05, 0.03)] {
            let (a, b) = (terrain.at(x, y), terrain.at(x + period_m, y - period_m));
            assert!((a.height_m - b.height_m).abs() < 1e-14);
        }
        let (a, b) = (terrain.at(-1e-12, 0.0), terrain.at(1e-12, 0.0));
        assert!((a.height_m - b.height_m).abs() < 2e-12);
    }

    #[test]
    fn a_finer_relief_is_finer_along_any_way() {
        let centroid = |fineness_per_m: f64| {
            let mut terrain = Terrain::new(&Relief { fineness_per_m, grain: 0.0, ..RELIEF }, 3);
            let (sin, cos) = 0.63_f64.sin_cos();
            let profile: Vec<f64> = (0..65_536)
                .map(|k| f64::from(k) * 5e-5)
                .map(|s| terrain.at(s * cos, s * sin).height_m)
                .collect();
            let spectrum = welch(&profile, 1.0 / 5e-5, 4096, 2048, Window::Hann).unwrap();
            spectral_centroid(&spectrum.frequency_hz, &spectrum.density)
        };
        let (coarse, fine) = (centroid(700.0), centroid(1400.0));
        assert!((coarse / 700.0 - 1.0).abs() < 0.1, "{coarse}");
        assert!((fine / coarse - 2.0).abs() < 0.15, "{fine} against {coarse}");
    }
}
