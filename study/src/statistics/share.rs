//! Shares with their intervals.

use serde::Serialize;

/// The normal deviate of an interval of 95 %.
const Z: f64 = 1.959_963_984_540_054;

/// A share, with its 95 % interval (Wilson 1927).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct Share {
    pub found: usize,
    pub share: f64,
    pub low: f64,
    pub high: f64,
}

impl Share {
    /// Of so many.
    pub fn of(found: usize, all: usize) -> Self {
        let (n, share) = (all as f64, found as f64 / all as f64);
        let shrink = 1.0 + Z * Z / n;
        let middle = (share + Z * Z / (2.0 * n)) / shrink;
        let half = Z / shrink * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
        Self { found, share, low: (middle - half).max(0.0), high: (middle + half).min(1.0) }
    }
}
