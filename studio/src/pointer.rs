//! Pointer events of pads.

/// Bounds of a pointer.
pub(crate) const MAX_M: f64 = 1.0;
pub(crate) const MAX_N: f64 = 20.0;
/// 0 for an upright pen, 90 for a horizontal one.
pub(crate) const MAX_DEG: f64 = 90.0;

/// A pointer event.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pointer {
    /// Time by the clock of the page, s.
    pub at_s: f64,
    pub position_m: [f64; 2],
    pub force_n: f64,
    /// Tilt of the upper end to the right, and towards the person who holds it, degrees.
    pub tilt_deg: [f64; 2],
}

impl Pointer {
    /// Linear interpolation towards another pointer event.
    pub(crate) fn towards(&self, to: &Self, part: f64) -> Self {
        let between = |a: f64, b: f64| a + part * (b - a);
        let both = |a: [f64; 2], b: [f64; 2]| [between(a[0], b[0]), between(a[1], b[1])];
        Self {
            at_s: between(self.at_s, to.at_s),
            position_m: both(self.position_m, to.position_m),
            force_n: between(self.force_n, to.force_n),
            tilt_deg: both(self.tilt_deg, to.tilt_deg),
        }
    }
}
