//! Shares with their intervals.

use super::distributions::{falling_root_from_zero, normal_cdf};
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

/// The share of right answers in ABX by an observer of this d' without bias, who takes X for the one from which it differs less
/// (Macmillan and Creelman 2005, chapter 9: the differencing model, for pairs that change from trial to trial).
pub fn abx_share(d_prime: f64) -> f64 {
    let (apart, near) = (normal_cdf(d_prime / 2_f64.sqrt()), normal_cdf(d_prime / 6_f64.sqrt()));
    apart * near + (1.0 - apart) * (1.0 - near)
}

/// The d' of that observer; `None` for a share below a half, or of 1, which no d' has.
pub fn abx_d_prime(share: f64) -> Option<f64> {
    let is_defined = (0.5..1.0).contains(&share);
    is_defined.then(|| falling_root_from_zero(|d_prime| share - abx_share(d_prime)))
}
