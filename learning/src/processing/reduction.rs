//! Reduces three axes of vibration to one. People do not feel its direction, but they can distinguish some of these reductions
//! from the original, and the best one is disputed; so all common ones are available.

use haptograph_signal::{Complex64, fft};
use nalgebra::{Matrix3, SymmetricEigen};
use std::f64::consts::PI;

/// A reduction of three axes to one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AxisReduction {
    /// The spectral magnitude is the root of the sum of squares over the axes, the phase that of their sum: energy and timing of all three
    /// (Landin, Romano, McMahan and Kuchenbecker 2010). The thesis's.
    #[default]
    Dft321,
    /// The sum of the axes.
    Sum,
    /// One axis: 0, 1 or 2.
    SingleAxis(usize),
    /// The projection on the direction of greatest variance.
    PrincipalComponent,
    /// The length of the vector at each moment.
    VectorMagnitude,
}

impl AxisReduction {
    /// The name in files and messages, such as `dft321`.
    pub fn as_str(self) -> &'static str {
        match self {
            AxisReduction::Dft321 => "dft321",
            AxisReduction::Sum => "sum",
            AxisReduction::SingleAxis(0) => "axis-x",
            AxisReduction::SingleAxis(1) => "axis-y",
            AxisReduction::SingleAxis(_) => "axis-z",
            AxisReduction::PrincipalComponent => "principal-component",
            AxisReduction::VectorMagnitude => "vector-magnitude",
        }
    }
}

/// Reduces three axes of equal length to one. `None` if lengths differ or the axis does not exist.
pub fn reduce(axes: &[Vec<f64>; 3], reduction: AxisReduction) -> Option<Vec<f64>> {
    let are_equal = axes.iter().all(|axis| axis.len() == axes[0].len());
    are_equal.then(|| reduce_by(|axis| axes.get(axis).cloned(), reduction))?
}

/// The same of axes that are made one at a time.
pub(super) fn reduce_by(
    axis: impl Fn(usize) -> Option<Vec<f64>>,
    reduction: AxisReduction,
) -> Option<Vec<f64>> {
    let added = |of: fn(f64) -> f64| {
        let mut sums: Vec<f64> = axis(0)?.into_iter().map(of).collect();
        for number in [1, 2] {
            sums.iter_mut().zip(axis(number)?).for_each(|(sum, x)| *sum += of(x));
        }
        Some(sums)
    };
    Some(match reduction {
        AxisReduction::Dft321 => return dft321(axis, BLOCK),
        AxisReduction::Sum => added(|x| x)?,
        AxisReduction::SingleAxis(number) => axis(number)?,
        AxisReduction::PrincipalComponent => {
            let [x, y, z] = [axis(0)?, axis(1)?, axis(2)?];
            let samples = || x.iter().zip(&y).zip(&z).map(|((&x, &y), &z)| [x, y, z]);
            let direction = principal_direction(samples());
            samples().map(|a| a.iter().zip(direction).map(|(a, d)| a * d).sum()).collect()
        }
        AxisReduction::VectorMagnitude => added(|x| x * x)?.into_iter().map(f64::sqrt).collect(),
    })
}

/// `block` is the length of the longest signal that is transformed at once.
fn dft321(axis: impl Fn(usize) -> Option<Vec<f64>>, block: usize) -> Option<Vec<f64>> {
    let (mut sums, mut squares, mut n) = (vec![], vec![], 0);
    for number in 0..3 {
        let x = axis(number)?;
        n = x.len();
        if n == 0 {
            return Some(x);
        }
        sums.resize(n / 2 + 1, Complex64::default());
        squares.resize(n / 2 + 1, 0.0);
        let bins = sums.iter_mut().zip(&mut squares);
        transform(
            [n, n, block],
            |j| Complex64::new(x[j], 0.0),
            bins,
            |(sum, square), bin| {
                *sum += bin;
                *square += bin.norm_sqr();
            },
        );
    }
    for (sum, square) in sums.iter_mut().zip(squares) {
        // If the axes cancel, the phase is undefined, and any phase is correct.
        let phase = if sum.norm() > 0.0 { *sum / sum.norm() } else { Complex64::new(1.0, 0.0) };
        *sum = square.sqrt() * phase;
    }
    // The other half mirrors it, or the result would not be real; its part in the real result is that of the first.
    let (inputs, twice) = if n <= block { (n, 1.0) } else { (n / 2 + 1, 2.0) };
    let mut combined = vec![0.0; n];
    let bin = |k: usize| match k {
        _ if k == 0 || 2 * k == n => sums[k],
        _ if 2 * k < n => sums[k].conj() * twice,
        _ => sums[n - k],
    };
    transform([n, inputs, block], bin, combined.iter_mut(), |y, sum| *y = sum.re / n as f64);
    Some(combined)
}

/// Length of the longest signal that is transformed at once, and of the blocks of others.
const BLOCK: usize = 3 << 18;

/// Gives the sums of `input(j) e^(-2 pi i j k / n)` over the inputs j to `output`, for k from 0 to the number of places.
///
/// Those of long signals are convolutions with a chirp, whatever their length (Bluestein 1970), `block` by block: a transform
/// at once takes several times the memory of the signal.
fn transform<P>(
    [n, inputs, block]: [usize; 3],
    input: impl Fn(usize) -> Complex64,
    mut places: impl ExactSizeIterator<Item = P>,
    mut output: impl FnMut(P, Complex64),
) {
    if n <= block {
        let mut all: Vec<_> = (0..inputs).map(input).collect();
        fft::forward(n).process(&mut all);
        return places.zip(all).for_each(|(place, sum)| output(place, sum));
    }
    let plan = fft::forward(2 * block);
    let [mut given, mut chirps, mut sums] = [(); 3].map(|()| vec![Complex64::default(); 2 * block]);
    let mut scratch = vec![Complex64::default(); plan.get_inplace_scratch_len()];
    for first in (0..places.len() as i64).step_by(block) {
        sums.fill(Complex64::default());
        for begin in (0..inputs).step_by(block) {
            // j k = (j^2 + k^2 - (k - j)^2) / 2.
            chirp(n, begin as i64, &mut chirps[..block]);
            given.fill(Complex64::default());
            let places = given.iter_mut().zip(&chirps).zip(begin..inputs.min(begin + block));
            places.for_each(|((place, chirp), j)| *place = input(j) * chirp.conj());
            plan.process_with_scratch(&mut given, &mut scratch);
            let apart = first - begin as i64;
            chirp(n, apart, &mut chirps[..block]);
            chirp(n, apart - block as i64, &mut chirps[block..]);
            plan.process_with_scratch(&mut chirps, &mut scratch);
            let products = given.iter().zip(&chirps).map(|(given, chirp)| (given * chirp).conj());
            sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        }
        // The inverse, as the conjugate of the transform of the conjugate.
        plan.process_with_scratch(&mut sums, &mut scratch);
        chirp(n, first, &mut chirps[..block]);
        for ((sum, chirp), place) in sums.iter().zip(&chirps[..block]).zip(&mut places) {
            output(place, (sum * chirp).conj() / (2 * block) as f64);
        }
    }
}

/// `e^(pi i m^2 / n)` from this `m` on.
fn chirp(n: usize, from: i64, chirps: &mut [Complex64]) {
    let turn = |half_turns: i64| Complex64::cis(PI * half_turns.rem_euclid(2 * n as i64) as f64 / n as f64);
    // Products over a few steps are as exact as the sums that they are for.
    let growth = turn(2);
    for (chirps, m) in chirps.chunks_mut(64).zip((from..).step_by(64)) {
        let (mut now, mut step) = (turn(m * m), turn(2 * m + 1));
        for value in chirps {
            *value = now;
            now *= step;
            step *= growth;
        }
    }
}

/// The eigenvector of the greatest variance, its largest component positive.
fn principal_direction(samples: impl Iterator<Item = [f64; 3]>) -> [f64; 3] {
    let mut products = Matrix3::<f64>::zeros();
    for a in samples {
        for i in 0..3 {
            for j in 0..3 {
                products[(i, j)] += a[i] * a[j];
            }
        }
    }
    let eigen = SymmetricEigen::new(products);
    let direction = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    let sign = direction[direction.iamax()].signum();
    std::array::from_fn(|axis| sign * direction[axis])
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;

    #[test]
    fn a_long_signal_is_reduced_block_by_block_as_at_once() {
        for n in [1000, 1001] {
            let axis = |number: usize| {
                let mut axis = vec![0.0; n];
                Gaussian::new(number as u64).fill(&mut axis);
                Some(axis)
            };
            let (at_once, by_blocks) = (dft321(axis, n).unwrap(), dft321(axis, 64).unwrap());
            let off = at_once.iter().zip(&by_blocks).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-11 && at_once.len() == by_blocks.len(), "{n}: {off}");
        }
    }
}
