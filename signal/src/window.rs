//! Window functions.

use std::f64::consts::TAU;

/// Symmetry of a window: about its middle, or as one period of a periodic function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// First and last sample equal: for designing filters.
    Symmetric,
    /// One period of a periodic function: for spectra, where it makes overlapping windows add up evenly.
    Periodic,
}

/// A window by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Window {
    /// All ones.
    Rectangular,
    /// `0.54 - 0.46 cos(2 pi n / period)`.
    Hamming,
    /// `0.5 - 0.5 cos(2 pi n / period)`.
    Hann,
}

impl Window {
    /// `length` samples of the window.
    pub fn samples(self, length: usize, symmetry: Symmetry) -> Vec<f64> {
        match self {
            Self::Rectangular => vec![1.0; length],
            Self::Hamming => raised_cosine(length, symmetry, 0.54),
            Self::Hann => raised_cosine(length, symmetry, 0.5),
        }
    }
}

fn raised_cosine(length: usize, symmetry: Symmetry, mean: f64) -> Vec<f64> {
    if length == 1 {
        return vec![1.0];
    }
    let period = match symmetry {
        Symmetry::Symmetric => length.saturating_sub(1),
        Symmetry::Periodic => length,
    };
    (0..length).map(|n| mean - (1.0 - mean) * (TAU * n as f64 / period as f64).cos()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symmetric_windows_have_their_textbook_ends_and_middle() {
        let w = Window::Hamming.samples(9, Symmetry::Symmetric);
        assert!((w[0] - 0.08).abs() < 1e-15 && (w[8] - 0.08).abs() < 1e-15 && (w[4] - 1.0).abs() < 1e-15);
        let w = Window::Hann.samples(5, Symmetry::Symmetric);
        for (got, want) in w.iter().zip([0.0, 0.5, 1.0, 0.5, 0.0]) {
            assert!((got - want).abs() < 1e-15);
        }
    }

    #[test]
    fn periodic_windows_overlapping_by_half_add_up_to_a_constant() {
        for (window, total) in [(Window::Hamming, 1.08), (Window::Hann, 1.0)] {
            let w = window.samples(256, Symmetry::Periodic);
            for n in 0..128 {
                assert!((w[n] + w[n + 128] - total).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn short_windows_are_finite() {
        for window in [Window::Rectangular, Window::Hamming, Window::Hann] {
            for symmetry in [Symmetry::Symmetric, Symmetry::Periodic] {
                for length in 0..4 {
                    let w = window.samples(length, symmetry);
                    assert!(w.len() == length && w.iter().all(|x| x.is_finite()));
                }
            }
        }
    }
}
