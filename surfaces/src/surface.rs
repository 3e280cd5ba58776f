//! A surface: the data with which a renderer reproduces one material. Each part is optional.

use crate::bounds::{MAX_ACCELERATION_M_S2, MAX_FORCE_N, MAX_SPEED_M_S, RATES, shown};
use crate::{Provenance, Taps, TextureModel};

/// Friction, taps, texture and stiffness of one material, with their provenance.
///
/// The constructor of each part checks it. A part that is `None` was not measured; a renderer omits it.
///
/// ```
/// use haptograph_surfaces::files::{native, read_surface};
/// use haptograph_surfaces::{Friction, Origin, Provenance, Surface};
///
/// let mut slate = Surface::new("slate", Provenance::new(Origin::Procedural, "an example"));
/// slate.friction = Some(Friction::new(0.35, None)?);
///
/// let file = native::write(&slate);
/// assert_eq!(read_surface(file.as_bytes())?, slate);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// Name of the material.
    pub name: String,
    /// Sliding friction.
    pub friction: Option<Friction>,
    /// Acceleration transients of taps by impact speed.
    pub taps: Option<Taps>,
    /// Vibration of sliding by speed and force.
    pub texture: Option<TextureModel>,
    /// Stiffness of the material when pressed.
    pub stiffness: Option<Stiffness>,
    /// The origin of the data.
    pub provenance: Provenance,
}

impl Surface {
    /// A surface without parts: set its public fields.
    pub fn new(name: impl Into<String>, provenance: Provenance) -> Self {
        Surface { name: name.into(), friction: None, taps: None, texture: None, stiffness: None, provenance }
    }
}

/// Coulomb friction of the recording tool on the material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    mu: f64,
    r_squared: Option<f64>,
    peak: Option<StaticPeak>,
}

/// How much larger friction is where the tool sticks: the factor `1 + (ratio - 1) exp(-(v / v_s)²)` on its coefficient at the speed v
/// (Stribeck's curve, as in Canudas de Wit and others 1995).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StaticPeak {
    ratio: f64,
    stribeck_m_s: f64,
}

impl StaticPeak {
    /// Largest ratio.
    pub(crate) const MOST: f64 = 10.0;

    /// Static over kinetic friction, from 1 to 10, and the Stribeck speed v_s, m/s, above 0.
    pub fn new(ratio: f64, stribeck_m_s: f64) -> Result<Self, SurfaceError> {
        let sound =
            (1.0..=Self::MOST).contains(&ratio) && stribeck_m_s > 0.0 && stribeck_m_s <= MAX_SPEED_M_S;
        if sound {
            Ok(Self { ratio, stribeck_m_s })
        } else {
            Err(SurfaceError::StaticPeak { ratio, stribeck_m_s })
        }
    }

    /// Static over kinetic friction.
    pub fn ratio(&self) -> f64 {
        self.ratio
    }

    /// The Stribeck speed, m/s.
    pub fn stribeck_m_s(&self) -> f64 {
        self.stribeck_m_s
    }

    /// The factor on the coefficient at a speed, m/s; 1 if that is not a number.
    pub fn factor(&self, speed_m_s: f64) -> f64 {
        let part = (-(speed_m_s / self.stribeck_m_s).powi(2)).exp();
        if part.is_finite() { 1.0 + (self.ratio - 1.0) * part } else { 1.0 }
    }
}

impl Friction {
    /// Friction coefficient `mu` (tangential force over normal force, at least 0), and how well a line through the
    /// recording fits, as R² (at most 1; negative if worse than a constant), if known.
    pub fn new(mu: f64, r_squared: Option<f64>) -> Result<Self, SurfaceError> {
        if !(mu.is_finite() && mu >= 0.0) {
            return Err(SurfaceError::FrictionCoefficient { mu });
        }
        match r_squared {
            Some(r_squared) if !(r_squared.is_finite() && r_squared <= 1.0) => {
                Err(SurfaceError::RSquared { what: "friction", r_squared })
            }
            _ => Ok(Friction { mu, r_squared, peak: None }),
        }
    }

    /// The same with a static peak.
    pub fn with_peak(self, peak: Option<StaticPeak>) -> Self {
        Self { peak, ..self }
    }

    /// How much larger it is where the tool sticks, if known.
    pub fn peak(&self) -> Option<StaticPeak> {
        self.peak
    }

    /// The friction coefficient.
    pub fn mu(&self) -> f64 {
        self.mu
    }

    /// R² of the line through the recording, if known.
    pub fn r_squared(&self) -> Option<f64> {
        self.r_squared
    }
}

/// Normal stiffness of the material under the recording tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stiffness {
    n_per_mm: f64,
    r_squared: Option<f64>,
}

impl Stiffness {
    /// Stiffness in N/mm (positive), and the R² of its line, if known.
    pub fn new(n_per_mm: f64, r_squared: Option<f64>) -> Result<Self, SurfaceError> {
        if !(n_per_mm.is_finite() && n_per_mm > 0.0) {
            return Err(SurfaceError::Stiffness { n_per_mm });
        }
        match r_squared {
            Some(r_squared) if !(r_squared.is_finite() && r_squared <= 1.0) => {
                Err(SurfaceError::RSquared { what: "stiffness", r_squared })
            }
            _ => Ok(Stiffness { n_per_mm, r_squared }),
        }
    }

    /// Stiffness in N/mm, as in tables.
    pub fn n_per_mm(&self) -> f64 {
        self.n_per_mm
    }

    /// Stiffness in N/m.
    pub fn n_per_m(&self) -> f64 {
        self.n_per_mm * 1000.0
    }

    /// R² of the line through the press recording, if known.
    pub fn r_squared(&self) -> Option<f64> {
        self.r_squared
    }
}

/// An error in the friction, taps or stiffness of a surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// The friction coefficient is negative or not finite.
    #[error("the friction coefficient mu is {mu}; it must be a finite number of at least 0")]
    FrictionCoefficient {
        /// The value given.
        mu: f64,
    },
    /// A static peak out of range.
    #[error(
        "the static friction is {ratio} of the kinetic, with a Stribeck speed of {} mm/s; the ratio must be from 1 to {}, the speed above 0", 1000.0 * stribeck_m_s, StaticPeak::MOST
    )]
    StaticPeak {
        /// Static over kinetic friction.
        ratio: f64,
        /// The Stribeck speed, m/s.
        stribeck_m_s: f64,
    },
    /// The stiffness is not positive or not finite.
    #[error("the stiffness is {n_per_mm} N/mm; it must be a finite number above 0 (leave it out if unknown)")]
    Stiffness {
        /// The value given.
        n_per_mm: f64,
    },
    /// An R² above one or not finite.
    #[error("R² of the {what} is {r_squared}; it must be a finite number of at most 1")]
    RSquared {
        /// The line that it belongs to.
        what: &'static str,
        /// The value given.
        r_squared: f64,
    },
    /// No taps at all.
    #[error("the list of taps is empty; leave the taps out if there are none")]
    NoTaps,
    /// The sample rate of the taps is out of its bounds.
    #[error("the taps' rate is {} Hz; it must be {RATES}", shown(*rate_hz))]
    TapRate {
        /// The value given.
        rate_hz: f64,
    },
    /// Taps that are too long at another rate.
    #[error(
        "each of the {taps} taps has {samples} samples at {rate_hz} Hz; at most {} in total are resampled: use a lower rate or fewer taps",
        crate::taps::MAX_RESAMPLED
    )]
    TapsTooLong {
        /// The number of taps.
        taps: usize,
        /// Samples of each at the other rate.
        samples: u64,
        /// The other rate.
        rate_hz: f64,
    },
    /// A rate to which taps cannot be resampled.
    #[error("the taps cannot be resampled: {0}")]
    TapRatio(haptograph_signal::resample::ResampleError),
    /// Impact speeds must be positive, strictly ascending, and within their bound.
    #[error(
        "tap {tap} (from 0) has impact speed {} m/s; speeds must be above 0, strictly ascending, and at most {MAX_SPEED_M_S} m/s", shown(*speed_m_s)
    )]
    TapSpeed {
        /// The tap's number, from 0.
        tap: usize,
        /// The speed.
        speed_m_s: f64,
    },
    /// All taps must have the same number of samples, at least one.
    #[error(
        "tap {tap} (from 0) has {length} samples, but the first tap has {expected}; all taps must have the same number"
    )]
    TapLength {
        /// The tap's number, from 0.
        tap: usize,
        /// The number of samples.
        length: usize,
        /// The first tap's (or 1, if that is empty).
        expected: usize,
    },
    /// A sample that is not a finite number, or too large.
    #[error(
        "sample {sample} of tap {tap} (both from 0) is not a number of at most {MAX_ACCELERATION_M_S2} m/s2"
    )]
    TapSample {
        /// The tap's number, from 0.
        tap: usize,
        /// The sample's number, from 0.
        sample: usize,
    },
    /// A tap that pulls the tool, or whose force is too large.
    #[error(
        "tap {tap} (from 0) has a peak force of {} N; it must be above 0 and at most {MAX_FORCE_N} N (leave it out if unknown)", shown(*peak_force_n)
    )]
    TapForce {
        /// The tap's number, from 0.
        tap: usize,
        /// The force given.
        peak_force_n: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_and_stiffness_refuse_what_is_not_physical() {
        assert!(Friction::new(0.0, Some(0.9)).is_ok());
        assert!(Friction::new(-0.1, None).is_err());
        assert!(Friction::new(f64::NAN, None).is_err());
        assert!(Friction::new(0.3, Some(1.1)).is_err());
        assert!(StaticPeak::new(0.9, 0.01).is_err() && StaticPeak::new(1.5, 0.0).is_err());
        assert!(StaticPeak::new(f64::NAN, 0.01).is_err());
        let peak = StaticPeak::new(1.5, 0.01).unwrap();
        assert!(peak.factor(0.0) == 1.5 && peak.factor(0.1) < 1.0001 && peak.factor(f64::NAN) == 1.0);
        assert!(Stiffness::new(0.0, None).is_err());
        assert!(Stiffness::new(f64::INFINITY, None).is_err());
        assert_eq!(Stiffness::new(42.2, Some(0.99)).unwrap().n_per_m(), 42_200.0);
    }
}
