//! Fourier transforms of any length by `rustfft`, in one place.
//!
//! Every processor uses the scalar transforms, so that results have the same bits: the vector ones round differently.
//! One module also avoids compiling the transforms into every crate.

use rustfft::{Fft, FftDirection};
use std::cell::RefCell;
use std::sync::Arc;

/// A planned transform of complex values in place, not scaled.
pub type Transform = Arc<dyn Fft<f64>>;

/// The forward transform of this length: `X_k = sum x_n e^(-2 pi i k n / length)`.
pub fn forward(length: usize) -> Transform {
    planned(length, FftDirection::Forward)
}

/// The inverse of [`forward`] times the length.
pub fn inverse(length: usize) -> Transform {
    planned(length, FftDirection::Inverse)
}

#[cfg(target_family = "wasm")]
use planned_for_pages as planned;

/// Plans live as long as the thread.
#[cfg(not(target_family = "wasm"))]
fn planned(length: usize, direction: FftDirection) -> Transform {
    thread_local! {
        static PLANNER: RefCell<rustfft::FftPlannerScalar<f64>> = RefCell::new(rustfft::FftPlannerScalar::new());
    }
    PLANNER.with_borrow_mut(|planner| planner.plan_fft(length, direction))
}

/// With two algorithms in place of all those of the planner, which are most of what a page would load of them. Lengths that are no
/// powers of two take longer.
#[cfg(any(test, target_family = "wasm"))]
fn planned_for_pages(length: usize, direction: FftDirection) -> Transform {
    use rustfft::algorithm::{BluesteinsAlgorithm, Radix4};
    thread_local! {
        static PLANS: RefCell<std::collections::BTreeMap<(usize, bool), Transform>> = RefCell::default();
    }
    let key = (length, direction == FftDirection::Inverse);
    if let Some(plan) = PLANS.with_borrow(|plans| plans.get(&key).cloned()) {
        return plan;
    }
    let plan: Transform = match length {
        0 | 1 => Arc::new(rustfft::algorithm::Dft::new(length, direction)),
        length if length.is_power_of_two() => Arc::new(Radix4::new(length, direction)),
        length => {
            let inner = planned_for_pages((2 * length - 1).next_power_of_two(), direction);
            Arc::new(BluesteinsAlgorithm::new(length, inner))
        }
    };
    PLANS.with_borrow_mut(|plans| plans.insert(key, Arc::clone(&plan)));
    plan
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Complex64;
    use std::f64::consts::TAU;

    #[test]
    fn they_are_the_sums_of_the_definition() {
        for planned in [planned, planned_for_pages] {
            assert_sums(planned);
        }
    }

    fn assert_sums(planned: fn(usize, FftDirection) -> Transform) {
        for length in [1, 2, 12, 17, 64, 100] {
            let x: Vec<Complex64> =
                (0..length).map(|n| Complex64::new((n as f64).sin(), (n * n % 7) as f64)).collect();
            let mut y = x.clone();
            planned(length, FftDirection::Forward).process(&mut y);
            for (k, y) in y.iter().enumerate() {
                let turn = |n: usize| Complex64::cis(-TAU * (k * n) as f64 / length as f64);
                let sum: Complex64 = x.iter().enumerate().map(|(n, x)| x * turn(n)).sum();
                assert!((y - sum).norm() < 1e-10, "{length}: {k}");
            }
            planned(length, FftDirection::Inverse).process(&mut y);
            for (x, y) in x.iter().zip(&y) {
                assert!((x * length as f64 - y).norm() < 1e-10, "{length}");
            }
        }
    }
}
