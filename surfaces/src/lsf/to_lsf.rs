//! From coefficients to line spectral frequencies.
//!
//! On the unit circle the sum and the difference polynomial are Chebyshev series in x = cos(frequency), whose zeros
//! alternate. A grid finds them by their changes of sign, and all are refined side by side. Where a cell of the grid
//! hides several zeros of one polynomial, those of the other separate them; where it hides several of both, the phase
//! of the lattice does, which no cluster can confuse. The result is converted back, compared, and corrected
//! by the remainder.

use super::{LsfError, MAX_ORDER, check_lengths, lsf_into_ar};
use haptograph_signal::prediction::ar_to_reflection;
use std::f64::consts::PI;
use std::sync::LazyLock;

const MAX_ZEROS: usize = MAX_ORDER / 2;
/// Cells of the grid, even.
const CELLS: usize = 64;

/// LSFs (radians, strictly ascending in (0, π)) of the polynomial 1 + Σ a_k z⁻ᵏ, into `lsf` of equal length.
///
/// # Errors
/// [`LsfError`] for a polynomial that is not stable, and if the slices' lengths differ or exceed [`MAX_ORDER`].
pub fn ar_to_lsf(ar: &[f64], lsf: &mut [f64]) -> Result<(), LsfError> {
    check_lengths(ar.len(), lsf.len())?;
    let (sum, difference) = series(1.0, ar);
    let scale = ar.iter().fold(1.0_f64, |scale, a| scale.max(a.abs()));
    // Ascending alternate zeros on the circle are those of a stable polynomial and of no other.
    if from_grid(&sum, &difference, lsf) && is_ascending(lsf) && correct(ar, lsf) <= GOOD_ENOUGH * scale {
        return Ok(());
    }
    let reflection = ar_to_reflection(ar).map_err(|_| LsfError::NotStable)?;
    for (index, frequency) in lsf.iter_mut().enumerate() {
        *frequency = by_phase(&reflection, index + 1);
    }
    if !is_ascending(lsf) {
        return Err(LsfError::NotStable);
    }
    correct(ar, lsf);
    Ok(())
}

/// Corrections stop once the coefficients come back this well, relative to the largest.
const EXACT: f64 = 1e-13;
/// Largest error; with a larger one, the zeros are found by the phase instead.
const GOOD_ENOUGH: f64 = 1e-10;

/// Converts ascending `lsf` back and corrects them by the remainder of `ar`, to first order, as long as that
/// helps. Each zero found alone carries the rounding error of its polynomial's value, which close neighbours
/// amplify; the value of the remainder carries hardly any. Returns the largest remaining difference of
/// coefficients.
fn correct(ar: &[f64], lsf: &mut [f64]) -> f64 {
    let order = ar.len();
    let scale = ar.iter().fold(1.0_f64, |scale, a| scale.max(a.abs()));
    let mut back = [0.0; MAX_ORDER];
    let mut moved = [0.0; MAX_ORDER];
    let (back, moved) = (&mut back[..order], &mut moved[..order]);
    let mut left = remainder(ar, lsf, back);
    for _ in 0..3 {
        if left <= EXACT * scale {
            break;
        }
        moved.copy_from_slice(lsf);
        shift(back, moved);
        if !is_ascending(moved) {
            break;
        }
        let now = remainder(ar, moved, back);
        if now.is_nan() || now >= left {
            break;
        }
        left = now;
        lsf.copy_from_slice(moved);
    }
    left
}

/// The remainder of `ar` after subtraction of the polynomial of `lsf`, by coefficient, and its largest
/// magnitude.
fn remainder(ar: &[f64], lsf: &[f64], left: &mut [f64]) -> f64 {
    lsf_into_ar(lsf, left);
    for (left, a) in left.iter_mut().zip(ar) {
        *left = a - *left;
    }
    left.iter().fold(0.0, |largest: f64, left| largest.max(left.abs()))
}

/// Moves each zero by -value/slope, the value being the remainder's and the slope that of the product of the zeros.
fn shift(left: &[f64], lsf: &mut [f64]) {
    let x: [f64; MAX_ORDER] = std::array::from_fn(|i| lsf.get(i).map_or(0.0, |w| w.cos()));
    let (sum, difference) = series(0.0, left);
    for (index, frequency) in lsf.iter_mut().enumerate() {
        let series = if index % 2 == 0 { &sum } else { &difference };
        // The leading coefficient is 2^degree.
        let mut slope = 2.0;
        for other in (index % 2..left.len()).step_by(2).filter(|&other| other != index) {
            slope *= 2.0 * (x[index] - x[other]);
        }
        // x falls as the frequency rises.
        *frequency += series.at(&[x[index]])[0] / (slope * frequency.sin());
    }
}

fn is_ascending(lsf: &[f64]) -> bool {
    lsf.windows(2).all(|pair| pair[0] < pair[1]) && lsf.iter().all(|&w| w > 0.0 && w < PI)
}

/// Chebyshev series with as many zeros in (-1, 1) as its degree.
struct Series {
    coefficients: [f64; MAX_ZEROS + 1],
    degree: usize,
}

/// The sum and difference polynomials of `leading` + Σ a_k z⁻ᵏ, rid of their zeros at z = 1 and z = -1, as series in x.
fn series(leading: f64, ar: &[f64]) -> (Series, Series) {
    let order = ar.len();
    let coefficient = |k: usize| {
        if k == 0 {
            leading
        } else if k <= order {
            ar[k - 1]
        } else {
            0.0
        }
    };
    // First halves of the palindromes.
    let mut sum = [0.0; MAX_ZEROS + 1];
    let mut difference = [0.0; MAX_ZEROS + 1];
    for k in 0..=order.div_ceil(2) {
        let p = coefficient(k) + coefficient(order + 1 - k);
        let q = coefficient(k) - coefficient(order + 1 - k);
        if order.is_multiple_of(2) {
            sum[k] = p - if k >= 1 { sum[k - 1] } else { 0.0 };
            difference[k] = q + if k >= 1 { difference[k - 1] } else { 0.0 };
        } else {
            sum[k] = p;
            difference[k] = q + if k >= 2 { difference[k - 2] } else { 0.0 };
        }
    }
    (from_palindrome(&sum, order.div_ceil(2)), from_palindrome(&difference, order / 2))
}

/// f_0..f_m of a palindrome of degree 2m is f_m + 2 Σ f_(m-k) T_k(x), apart from a phase.
fn from_palindrome(half: &[f64; MAX_ZEROS + 1], degree: usize) -> Series {
    let mut coefficients = [0.0; MAX_ZEROS + 1];
    coefficients[0] = half[degree];
    for k in 1..=degree {
        coefficients[k] = 2.0 * half[degree - k];
    }
    Series { coefficients, degree }
}

impl Series {
    /// Values at all of `x`: Clenshaw's recurrence, across the lanes.
    #[inline]
    fn at<const N: usize>(&self, x: &[f64; N]) -> [f64; N] {
        let mut one_up = [0.0; N];
        let mut two_up = [0.0; N];
        for &c in self.coefficients[1..=self.degree].iter().rev() {
            let here: [f64; N] = std::array::from_fn(|i| 2.0 * x[i] * one_up[i] - two_up[i] + c);
            two_up = one_up;
            one_up = here;
        }
        std::array::from_fn(|i| x[i] * one_up[i] - two_up[i] + self.coefficients[0])
    }

    /// Values at the grid's points x_0 = 1 down to x_CELLS = -1. Even and odd terms apart give x and -x at once.
    fn on_grid(&self, grid: &Grid) -> [f64; CELLS + 1] {
        const HALF: usize = CELLS / 2;
        let c = &self.coefficients;
        let mut values = [0.0; CELLS + 1];
        let (mut even, mut even_up) = ([0.0; HALF], [0.0; HALF]);
        let (mut odd, mut odd_up) = ([0.0; HALF], [0.0; HALF]);
        // Even and odd Chebyshev polynomials each follow one recurrence in T_2(x).
        for k in (1..=self.degree / 2).rev() {
            let c_odd = if 2 * k < self.degree { c[2 * k + 1] } else { 0.0 };
            for i in 0..HALF {
                let twice = grid.twice_second[i];
                (even[i], even_up[i]) = (twice * even[i] - even_up[i] + c[2 * k], even[i]);
                (odd[i], odd_up[i]) = (twice * odd[i] - odd_up[i] + c_odd, odd[i]);
            }
        }
        let c_odd = if self.degree >= 1 { c[1] } else { 0.0 };
        for i in 0..HALF {
            let twice = grid.twice_second[i];
            let even = 0.5 * twice * even[i] - even_up[i] + c[0];
            let odd = grid.x[i] * ((twice * odd[i] - odd_up[i] + c_odd) - odd[i]);
            values[i] = even + odd;
            values[CELLS - i] = even - odd;
        }
        // At x = 0 only the even terms remain, with alternate signs.
        values[HALF] = (0..=self.degree / 2).map(|k| if k % 2 == 0 { c[2 * k] } else { -c[2 * k] }).sum();
        values
    }
}

/// Frequencies evenly spaced on [0, π].
struct Grid {
    /// cos at the points.
    x: [f64; CELLS + 1],
    /// 2 T_2(x) of the first half.
    twice_second: [f64; CELLS / 2],
    /// Frequency, cosine and sine at the cells' middles.
    middle: [(f64, f64, f64); CELLS],
}

static GRID: LazyLock<Grid> = LazyLock::new(|| {
    let step = PI / CELLS as f64;
    let x = std::array::from_fn(|i| (step * i as f64).cos());
    let twice_second = std::array::from_fn(|i| 2.0 * (2.0 * step * i as f64).cos());
    let middle = std::array::from_fn(|i| {
        let frequency = step * (i as f64 + 0.5);
        (frequency, frequency.cos(), frequency.sin())
    });
    Grid { x, twice_second, middle }
});

/// Finds all zeros from the changes of sign on the grid. If one of the polynomials shows all of its own, they separate
/// those of the other, however close. False if both hide some.
fn from_grid(sum: &Series, difference: &Series, lsf: &mut [f64]) -> bool {
    match (alone(sum, 0, lsf), alone(difference, 1, lsf)) {
        (true, true) => true,
        (true, false) => between(difference, 1, lsf),
        (false, true) => between(sum, 0, lsf),
        (false, false) => false,
    }
}

/// Finds the zeros of one polynomial, every second LSF from `first`; false if a cell hides more than one.
fn alone(series: &Series, first: usize, lsf: &mut [f64]) -> bool {
    let grid: &Grid = &GRID;
    let values = series.on_grid(grid);
    let mut cells = [0; MAX_ZEROS];
    let mut found = 0;
    for cell in 0..CELLS {
        if (values[cell] > 0.0) != (values[cell + 1] > 0.0) && found < MAX_ZEROS {
            cells[found] = cell;
            found += 1;
        }
    }
    if found != series.degree {
        return false;
    }
    // Lanes come in groups of four.
    match series.degree {
        0 => {}
        1..=4 => refine::<4>(series, grid, &cells, &values, first, lsf),
        5..=8 => refine::<8>(series, grid, &cells, &values, first, lsf),
        9..=12 => refine::<12>(series, grid, &cells, &values, first, lsf),
        _ => refine::<16>(series, grid, &cells, &values, first, lsf),
    }
    true
}

/// Finds the zeros of one polynomial between those of the other, which stand in `lsf`.
fn between(series: &Series, first: usize, lsf: &mut [f64]) -> bool {
    for index in (first..lsf.len()).step_by(2) {
        let low = if index == 0 { 0.0 } else { lsf[index - 1] };
        let high = lsf.get(index + 1).copied().unwrap_or(PI);
        let Some(frequency) = within(series, low, high) else {
            return false;
        };
        lsf[index] = frequency;
    }
    true
}

/// Refines the zeros in `cells` side by side and writes them to every second place of `lsf`, from `first`.
fn refine<const N: usize>(
    series: &Series,
    grid: &Grid,
    cells: &[usize; MAX_ZEROS],
    values: &[f64; CELLS + 1],
    first: usize,
    lsf: &mut [f64],
) {
    // Lanes beyond the last zero repeat it.
    let cell: [usize; N] = std::array::from_fn(|i| cells[i.min(series.degree - 1)]);
    let (high, low) = (cell.map(|cell| grid.x[cell]), cell.map(|cell| grid.x[cell + 1]));
    // Inverse quadratic interpolation through the latest three points: one evaluation a step, order 1.84.
    let mut x = [high, low];
    let mut y = [cell.map(|cell| values[cell]), cell.map(|cell| values[cell + 1])];
    let mut next: [f64; N] =
        std::array::from_fn(|i| x[0][i] + y[0][i] / (y[0][i] - y[1][i]) * (x[1][i] - x[0][i]));
    let mut step = [0.0; N];
    for _ in 0..STEPS {
        let here = (next, series.at(&next));
        for i in 0..N {
            let (x, y) = ([x[0][i], x[1][i], here.0[i]], [y[0][i], y[1][i], here.1[i]]);
            let (to, last) = (inverse_quadratic(x, y), x[2] - x[1]);
            // A longer step than the last one is rounding if the last was short, and divergence otherwise.
            let shrinks = (to - x[2]).abs() < last.abs();
            next[i] = if shrinks { to } else { x[2] };
            step[i] = if shrinks {
                to - x[2]
            } else if last != 0.0 {
                last
            } else {
                step[i]
            };
        }
        (x, y) = ([x[1], here.0], [y[1], here.1]);
    }
    for i in 0..series.degree {
        let settled = next[i] >= low[i] && next[i] <= high[i] && step[i].abs() < SETTLED * (high[i] - low[i]);
        let settled = if settled { Some(frequency(grid.middle[cell[i]], next[i])) } else { None };
        let step = PI / CELLS as f64;
        let slowly = || within(series, cell[i] as f64 * step, (cell[i] + 1) as f64 * step);
        // Neither fails if the sign changes; the caller checks the order of the values.
        lsf[first + 2 * i] = settled.or_else(slowly).unwrap_or(0.0);
    }
}

/// Evaluations in [`refine`].
const STEPS: usize = 4;
/// The last step, as a part of the cell, from which the next would be lost in rounding.
const SETTLED: f64 = 1e-8;

/// The only zero of a series between two frequencies; none if the sign is the same at both.
fn within(series: &Series, low: f64, high: f64) -> Option<f64> {
    ridders(|frequency| series.at(&[frequency.cos()])[0], low, high)
}

/// The zero of a continuous function between `low` and `high`, where its signs differ, by Ridders' method.
fn ridders(value: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> Option<f64> {
    let (mut at_low, mut at_high) = (value(low), value(high));
    if at_low.is_nan() || at_high.is_nan() || (at_low > 0.0) == (at_high > 0.0) {
        return None;
    }
    let mut last = f64::INFINITY;
    // Each turn halves the bracket at least.
    for _ in 0..64 {
        let middle = 0.5 * (low + high);
        let at_middle = value(middle);
        let slope = (at_middle * at_middle - at_low * at_high).sqrt();
        let x = middle + (middle - low) * at_low.signum() * at_middle / slope;
        if !x.is_finite() || middle <= low || middle >= high {
            return Some(middle);
        }
        let at_x = value(x);
        if at_x == 0.0 || (x - last).abs() <= 1e-16 {
            return Some(x);
        }
        last = x;
        for (x, at_x) in [(middle, at_middle), (x, at_x)] {
            if x <= low || x >= high {
                continue;
            }
            if (at_x > 0.0) == (at_low > 0.0) {
                (low, at_low) = (x, at_x)
            } else {
                (high, at_high) = (x, at_x)
            }
        }
    }
    Some(0.5 * (low + high))
}

/// Zero of the parabola x(y) through three points.
#[inline]
fn inverse_quadratic(x: [f64; 3], y: [f64; 3]) -> f64 {
    let slope_01 = (x[1] - x[0]) / (y[1] - y[0]);
    let slope_12 = (x[2] - x[1]) / (y[2] - y[1]);
    let bend = (slope_12 - slope_01) / (y[2] - y[0]);
    x[2] - y[2] * (slope_12 - y[1] * bend)
}

/// The arc cosine of `x` near the middle of a cell: sin(w - middle) is small, and so is what is left of its series.
#[inline]
fn frequency((middle, cos, sin): (f64, f64, f64), x: f64) -> f64 {
    let s = ((1.0 - x) * (1.0 + x)).sqrt() * cos - x * sin;
    let t = s * s;
    middle + s * (1.0 + t * (1.0 / 6.0 + t * (3.0 / 40.0 + t * (15.0 / 336.0 + t * (105.0 / 3456.0)))))
}

/// The `number`-th LSF (from 1), where the phase of the all-pass z^-(p+1) A(1/z) / A(z), built stage by stage of
/// the lattice and so without ambiguity, has fallen to -number π. It falls strictly, through any cluster.
fn by_phase(reflection: &[f64], number: usize) -> f64 {
    let target = -(number as f64) * PI;
    ridders(|frequency| all_pass_phase(reflection, frequency) - target, 0.0, PI).unwrap_or(0.0)
}

fn all_pass_phase(reflection: &[f64], frequency: f64) -> f64 {
    let mut phase = -frequency;
    for &k in reflection {
        let (sin, cos) = phase.sin_cos();
        phase -= 2.0 * (k * sin).atan2(1.0 + k * cos) + frequency;
    }
    phase
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lsf::lsf_into_ar;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    fn from_poles(pairs: &[(f64, f64)]) -> Vec<f64> {
        let mut product = vec![1.0];
        for (radius, angle) in pairs {
            let factor = [1.0, -2.0 * radius * angle.cos(), radius * radius];
            let mut next = vec![0.0; product.len() + 2];
            for (i, a) in product.iter().enumerate() {
                for (j, b) in factor.iter().enumerate() {
                    next[i + j] += a * b;
                }
            }
            product = next;
        }
        product[1..].to_vec()
    }

    /// The largest difference after going there and back, relative to the largest coefficient.
    fn round_trip(ar: &[f64]) -> f64 {
        let mut lsf = vec![0.0; ar.len()];
        ar_to_lsf(ar, &mut lsf).unwrap();
        let scale = ar.iter().fold(1.0_f64, |scale, a| scale.max(a.abs()));
        let mut left = vec![0.0; ar.len()];
        remainder(ar, &lsf, &mut left) / scale
    }

    #[test]
    fn well_separated_frequencies_come_back() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        for _ in 0..2000 {
            let order = random.random_range(1..=24_usize);
            let step = PI / (order as f64 + 1.0);
            let lsf: Vec<f64> =
                (0..order).map(|k| step * (k as f64 + 1.0 + random.random_range(-0.35..0.35))).collect();
            let (mut ar, mut back) = (vec![0.0; order], vec![0.0; order]);
            lsf_into_ar(&lsf, &mut ar);
            ar_to_lsf(&ar, &mut back).unwrap();
            assert!(lsf.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    #[test]
    fn any_stable_polynomial_comes_back() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
        for (pairs, radius) in
            [(5, 0.8..0.97), (10, 0.8..0.97), (10, 0.9..0.9995), (10, 0.999..0.9995), (16, 0.8..0.97)]
        {
            for _ in 0..200 {
                let mut pole = || (random.random_range(radius.clone()), random.random_range(0.05..3.1));
                let ar = from_poles(&(0..pairs).map(|_| pole()).collect::<Vec<_>>());
                // The product of that many poles that close may round to an unstable polynomial.
                if ar_to_reflection(&ar).is_ok() {
                    assert!(round_trip(&ar) < 1e-9, "{ar:?}");
                }
            }
        }
    }

    #[test]
    fn clusters_within_one_cell_of_the_grid_come_apart() {
        for spread in [1e-2, 1e-3, 1e-4, 0.0] {
            for angle in [0.1, 1.0, 2.5] {
                let poles = [
                    (0.9995, angle),
                    (0.9990, angle + spread),
                    (0.9993, angle + 1.7 * spread),
                    (0.7, 0.5),
                    (0.8, 2.0),
                ];
                assert!(round_trip(&from_poles(&poles)) < 1e-9, "{spread} {angle}");
            }
        }
    }
}
