//! Reduces three axes of vibration to one. People do not feel its direction, but they can distinguish some of these reductions
//! from the original, and the best one is disputed; so all common ones are available.

use haptograph_signal::{Complex64, fft};
use nalgebra::{Matrix3, SymmetricEigen};

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
    let [x, y, z] = axes;
    if x.len() != y.len() || x.len() != z.len() {
        return None;
    }
    let samples = || x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z]);
    Some(match reduction {
        AxisReduction::Dft321 => dft321(axes),
        AxisReduction::Sum => samples().map(|[x, y, z]| x + y + z).collect(),
        AxisReduction::SingleAxis(axis) => axes.get(axis)?.clone(),
        AxisReduction::PrincipalComponent => {
            let direction = principal_direction(samples());
            samples().map(|a| a.iter().zip(direction).map(|(a, d)| a * d).sum()).collect()
        }
        AxisReduction::VectorMagnitude => samples().map(|[x, y, z]| (x * x + y * y + z * z).sqrt()).collect(),
    })
}

fn dft321(axes: &[Vec<f64>; 3]) -> Vec<f64> {
    let n = axes[0].len();
    if n == 0 {
        return vec![];
    }
    let forward = fft::forward(n);
    let spectra = axes.each_ref().map(|axis| {
        let mut spectrum: Vec<Complex64> = axis.iter().map(|&x| Complex64::new(x, 0.0)).collect();
        forward.process(&mut spectrum);
        spectrum
    });
    let [x, y, z] = &spectra;
    let mut combined = vec![Complex64::default(); n];
    for k in 0..=n / 2 {
        let sum = x[k] + y[k] + z[k];
        let magnitude = (x[k].norm_sqr() + y[k].norm_sqr() + z[k].norm_sqr()).sqrt();
        // If the axes cancel, the phase is undefined, and any phase is correct.
        let phase = if sum.norm() > 0.0 { sum / sum.norm() } else { Complex64::new(1.0, 0.0) };
        combined[k] = magnitude * phase;
        // The other half mirrors it, or the result would not be real.
        combined[(n - k) % n] = combined[k].conj();
    }
    fft::inverse(n).process(&mut combined);
    combined.iter().map(|c| c.re / n as f64).collect()
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
