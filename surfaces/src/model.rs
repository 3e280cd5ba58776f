//! One autoregressive (AR) or autoregressive moving-average (ARMA) model of a texture's vibration.

use crate::lsf;
use haptograph_signal::prediction::{ar_to_reflection, levinson};
use haptograph_signal::warped::{self, MAX_WARPING};
use std::f64::consts::PI;
use std::sync::Arc;

pub use crate::lsf::MAX_ORDER;

/// Least gap between line spectral frequencies (and to 0 and π), radians. Poles within about a millionth of the unit circle
/// have smaller gaps; their direct-form coefficients cannot keep the filter stable in double precision. Interpolation
/// between sets never makes a smaller gap.
pub(crate) const MIN_LSF_GAP_RAD: f64 = 1e-6;

/// Largest difference between stored coefficients and those of the stored line spectral frequencies, relative to the
/// largest coefficient (or 1). The toolkit's files have frequencies of six decimals, which leave 2e-5.
pub(crate) const STORED_LSF_TOLERANCE: f64 = 1e-3;

/// The warping factor at which models of any rate resolve low frequencies as those of 0.85 do at 10 kHz: an order of 20 has
/// a resolution of 20 Hz at the bottom of the band.
pub fn warping_for(rate_hz: f64) -> f64 {
    const SLOPE_AT_10_KHZ: f64 = (1.0 + 0.85) / (1.0 - 0.85);
    // The slope of the warped axis at zero frequency is (1 + l) / (1 - l).
    let slope = SLOPE_AT_10_KHZ * rate_hz / 10_000.0;
    ((slope - 1.0) / (slope + 1.0)).clamp(0.05, MAX_WARPING)
}

/// A stable and minimum-phase filter, excited by white noise:
///
/// y\[n\] = −Σ a_k y\[n−k\] + gain · (e\[n\] + Σ b_k e\[n−k\]), with e of the model's variance.
///
/// With a warping factor above 0 the AR polynomial is in the all-pass of [`haptograph_signal::warped`] instead of the unit
/// delay, there is no MA part, and the model stores the **power** of the vibration, from which the variance follows.
///
/// The model stores both coefficients and line spectral frequencies (LSFs) as given. **The LSFs take precedence**:
/// rendering uses them at and between models. Operations on a single model (spectra, resampling) use the coefficients,
/// which have more digits than the LSFs of a toolkit file.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmaModel {
    filter: Arc<Filter>,
    /// Variance of the excitation; for a warped filter, power of the vibration.
    level: f64,
}

/// Shared, because the border of a map repeats the filters of its interior.
#[derive(Debug, PartialEq)]
struct Filter {
    ar: Vec<f64>,
    ar_lsf: Vec<f64>,
    ma: Vec<f64>,
    ma_lsf: Vec<f64>,
    gain: f64,
    warping: f64,
    /// Power of the vibration over the variance of the excitation; 1 (unused) if the filter is not warped.
    power_gain: f64,
}

/// The numbers of a model as stored in a file, not yet checked.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StoredModel {
    /// a_1..a_p.
    pub ar: Vec<f64>,
    /// LSFs of the AR polynomial, radians.
    pub ar_lsf: Vec<f64>,
    /// b_1..b_q of the monic MA polynomial.
    pub ma: Vec<f64>,
    /// LSFs of the MA polynomial, radians.
    pub ma_lsf: Vec<f64>,
    /// Multiplies the whole MA polynomial.
    pub gain: f64,
    /// Variance of the excitation, (m/s²)².
    pub variance: f64,
}

impl ArmaModel {
    /// An AR model of coefficients a_1..a_p and innovation variance in (m/s²)² at the model's own rate.
    pub fn from_ar(ar: &[f64], variance: f64) -> Result<Self, ModelError> {
        Self::from_arma(ar, &[], 1.0, variance)
    }

    /// An ARMA model of coefficients a_1..a_p, b_1..b_q, gain, and excitation variance in (m/s²)².
    pub fn from_arma(ar: &[f64], ma: &[f64], gain: f64, variance: f64) -> Result<Self, ModelError> {
        Self::from_stored(StoredModel {
            ar_lsf: lsf_of(Polynomial::Ar, ar)?,
            ma_lsf: lsf_of(Polynomial::Ma, ma)?,
            ar: ar.to_vec(),
            ma: ma.to_vec(),
            gain,
            variance,
        })
    }

    /// A model of line spectral frequencies in radians, ascending.
    pub fn from_lsf(ar_lsf: &[f64], ma_lsf: &[f64], gain: f64, variance: f64) -> Result<Self, ModelError> {
        Self::from_stored(StoredModel {
            ar: coefficients_of(Polynomial::Ar, ar_lsf)?,
            ma: coefficients_of(Polynomial::Ma, ma_lsf)?,
            ar_lsf: ar_lsf.to_vec(),
            ma_lsf: ma_lsf.to_vec(),
            gain,
            variance,
        })
    }

    /// A model exactly as stored, with coefficients and LSFs, which are checked against each other.
    pub(crate) fn from_stored(stored: StoredModel) -> Result<Self, ModelError> {
        let StoredModel { ar, ar_lsf, ma, ma_lsf, gain, variance } = stored;
        check_polynomial(Polynomial::Ar, &ar, &ar_lsf)?;
        check_polynomial(Polynomial::Ma, &ma, &ma_lsf)?;
        if !(gain.is_finite() && gain > 0.0) {
            return Err(ModelError::Gain { gain });
        }
        ArmaModel {
            filter: Arc::new(Filter { ar, ar_lsf, ma, ma_lsf, gain, warping: 0.0, power_gain: 1.0 }),
            level: 0.0,
        }
        .with_variance(variance)
    }

    /// A warped model of its line spectral frequencies on the warped axis (radians, ascending), the warping factor in
    /// (0, [`MAX_WARPING`]], and the power of its vibration in (m/s²)².
    pub fn warped_from_lsf(ar_lsf: &[f64], warping: f64, power: f64) -> Result<Self, ModelError> {
        let ar = coefficients_of(Polynomial::Ar, ar_lsf)?;
        Self::warped(ar, ar_lsf.to_vec(), warping, power)
    }

    /// A silent warped model exactly as stored, coefficients and LSFs checked one against the other.
    pub(crate) fn warped_from_stored(
        ar: Vec<f64>,
        ar_lsf: Vec<f64>,
        warping: f64,
    ) -> Result<Self, ModelError> {
        Self::warped(ar, ar_lsf, warping, 0.0)
    }

    /// A warped model of coefficients a_1..a_p, the warping factor, and the variance of its excitation in (m/s²)².
    pub fn warped_from_ar(ar: &[f64], warping: f64, variance: f64) -> Result<Self, ModelError> {
        // The LSFs take precedence, so that a file needs only them.
        Self::warped_from_lsf(&lsf_of(Polynomial::Ar, ar)?, warping, 0.0)?.with_variance(variance)
    }

    /// A warped model of this order for a one-sided density in (m/s²)²/Hz, given as means over equal cells of the warped axis from 0 to
    /// half of the rate.
    ///
    /// # Errors
    /// [`ModelError::Unstable`] for cells that are no density (zero, negative or not finite), and those of
    /// [`warped_from_ar`](Self::warped_from_ar).
    pub fn warped_from_cells(
        cells: &[f64],
        warping: f64,
        rate_hz: f64,
        order: usize,
    ) -> Result<Self, ModelError> {
        // One-sided density to power a sample: half the rate.
        let powers: Vec<f64> = cells.iter().map(|density| density * (0.5 * rate_hz)).collect();
        let fitted = levinson(&warped::cell_autocovariance(&powers, order), order);
        let fitted = fitted.map_err(|_| ModelError::Unstable { polynomial: Polynomial::Ar })?;
        Self::warped_from_ar(&fitted.ar, warping, fitted.variance)
    }

    fn warped(ar: Vec<f64>, ar_lsf: Vec<f64>, warping: f64, power: f64) -> Result<Self, ModelError> {
        check_polynomial(Polynomial::Ar, &ar, &ar_lsf)?;
        if !(warping > 0.0 && warping <= MAX_WARPING) || ar.is_empty() {
            return Err(ModelError::Warping { warping });
        }
        if !(power.is_finite() && power >= 0.0) {
            return Err(ModelError::Power { power });
        }
        let unstable = |_| ModelError::Unstable { polynomial: Polynomial::Ar };
        let power_gain = warped::power_gain(&ar, warping).map_err(unstable)?;
        if !(power_gain.is_finite() && power_gain > 0.0) {
            return Err(ModelError::Warping { warping });
        }
        let filter =
            Filter { ar, ar_lsf, ma: Vec::new(), ma_lsf: Vec::new(), gain: 1.0, warping, power_gain };
        Ok(ArmaModel { filter: Arc::new(filter), level: power })
    }

    /// The same filter with another excitation variance, (m/s²)².
    pub fn with_variance(mut self, variance: f64) -> Result<Self, ModelError> {
        if !(variance.is_finite() && variance >= 0.0) {
            return Err(ModelError::Variance { variance });
        }
        self.level = variance * self.filter.power_gain;
        Ok(self)
    }

    /// The same filter with another power of the vibration, (m/s²)².
    pub fn with_power(mut self, power: f64) -> Result<Self, ModelError> {
        if !(power.is_finite() && power >= 0.0) {
            return Err(ModelError::Power { power });
        }
        if self.warping() > 0.0 {
            self.level = power;
            return Ok(self);
        }
        let unit = self.clone().with_variance(1.0)?.power();
        self.with_variance(power / unit)
    }

    /// a_1..a_p of A(z) = 1 + Σ a_k z⁻ᵏ.
    pub fn ar(&self) -> &[f64] {
        &self.filter.ar
    }

    /// LSFs of A(z), radians, ascending; rendering uses them.
    pub fn ar_lsf(&self) -> &[f64] {
        &self.filter.ar_lsf
    }

    /// b_1..b_q of the monic MA polynomial; empty for an AR model.
    pub fn ma(&self) -> &[f64] {
        &self.filter.ma
    }

    /// LSFs of the MA polynomial, radians, ascending; empty for an AR model.
    pub fn ma_lsf(&self) -> &[f64] {
        &self.filter.ma_lsf
    }

    /// Multiplies the whole MA polynomial; 1 for an AR model.
    pub fn gain(&self) -> f64 {
        self.filter.gain
    }

    /// Variance of the excitation, (m/s²)², at the model's own rate.
    pub fn variance(&self) -> f64 {
        self.level / self.filter.power_gain
    }

    /// The warping factor of the frequency axis; 0 for an unwarped model.
    pub fn warping(&self) -> f64 {
        self.filter.warping
    }

    /// Power of the vibration, (m/s²)²: stored by a warped model, computed for others.
    pub fn power(&self) -> f64 {
        let Filter { ar, ma, gain, warping, .. } = self.filter.as_ref();
        if *warping > 0.0 {
            return self.level;
        }
        // A constructed model is stable.
        let filter = haptograph_signal::prediction::power_gain(ar, ma).unwrap_or(1.0);
        self.level * gain * gain * filter
    }

    /// Squared magnitude of the filter's response at `frequency_rad` (radians a sample), excitation left out.
    pub fn power_gain_at(&self, frequency_rad: f64) -> f64 {
        let Filter { ar, ma, gain, warping, .. } = self.filter.as_ref();
        if *warping > 0.0 {
            return warped::squared_response(ar, *warping, frequency_rad);
        }
        gain * gain * squared_magnitude(ma, frequency_rad) / squared_magnitude(ar, frequency_rad)
    }

    /// True if two models have bitwise equal filters, regardless of variance.
    pub(crate) fn same_filter(&self, other: &ArmaModel) -> bool {
        Arc::ptr_eq(&self.filter, &other.filter) || self.filter == other.filter
    }
}

/// |1 + Σ c_k e^(-jwk)|².
fn squared_magnitude(coefficients: &[f64], frequency_rad: f64) -> f64 {
    // Horner in e^(-jw): one sine and cosine for all powers.
    let (sin, cos) = frequency_rad.sin_cos();
    let (mut re, mut im) = (0.0, 0.0);
    for &c in coefficients.iter().rev() {
        (re, im) = ((re + c) * cos + im * sin, im * cos - (re + c) * sin);
    }
    (1.0 + re) * (1.0 + re) + im * im
}

fn lsf_of(polynomial: Polynomial, coefficients: &[f64]) -> Result<Vec<f64>, ModelError> {
    check_order(polynomial, coefficients.len())?;
    let mut frequencies = vec![0.0; coefficients.len()];
    lsf::ar_to_lsf(coefficients, &mut frequencies).map_err(|_| ModelError::Unstable { polynomial })?;
    Ok(frequencies)
}

fn coefficients_of(polynomial: Polynomial, frequencies: &[f64]) -> Result<Vec<f64>, ModelError> {
    check_order(polynomial, frequencies.len())?;
    let mut coefficients = vec![0.0; frequencies.len()];
    lsf::lsf_into_ar(frequencies, &mut coefficients);
    Ok(coefficients)
}

fn check_order(polynomial: Polynomial, order: usize) -> Result<(), ModelError> {
    if order > MAX_ORDER { Err(ModelError::Order { polynomial, order }) } else { Ok(()) }
}

fn check_polynomial(
    polynomial: Polynomial,
    coefficients: &[f64],
    frequencies: &[f64],
) -> Result<(), ModelError> {
    check_order(polynomial, coefficients.len())?;
    if coefficients.len() != frequencies.len() {
        return Err(ModelError::Lengths {
            polynomial,
            coefficients: coefficients.len(),
            lsf: frequencies.len(),
        });
    }
    let mut below = 0.0;
    for (index, &frequency) in frequencies.iter().chain(&[PI]).enumerate() {
        // NaN fails this comparison.
        if !(frequency - below >= MIN_LSF_GAP_RAD && frequency <= PI) {
            return Err(ModelError::LsfOrder { polynomial, index });
        }
        below = frequency;
    }
    let unstable = |_| ModelError::Unstable { polynomial };
    ar_to_reflection(coefficients).map_err(unstable)?;
    let mut from_lsf = vec![0.0; frequencies.len()];
    lsf::lsf_into_ar(frequencies, &mut from_lsf);
    ar_to_reflection(&from_lsf).map_err(unstable)?;
    let scale = coefficients.iter().fold(1.0_f64, |scale, c| scale.max(c.abs()));
    for (index, (stored, implied)) in coefficients.iter().zip(from_lsf.iter()).enumerate() {
        if (stored - implied).abs() > STORED_LSF_TOLERANCE * scale {
            return Err(ModelError::Disagree {
                polynomial,
                index: index + 1,
                stored: *stored,
                implied: *implied,
            });
        }
    }
    Ok(())
}

/// The polynomial of a model that an error concerns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Polynomial {
    /// The autoregressive denominator.
    Ar,
    /// The moving-average numerator.
    Ma,
}

impl std::fmt::Display for Polynomial {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Polynomial::Ar => "AR",
            Polynomial::Ma => "MA",
        })
    }
}

/// An error in the numbers of a model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The order is too high.
    #[error("the {polynomial} polynomial has order {order}; at most {MAX_ORDER} is supported")]
    Order {
        /// The polynomial.
        polynomial: Polynomial,
        /// The order.
        order: usize,
    },
    /// A different number of coefficients and LSFs.
    #[error(
        "the {polynomial} polynomial has {coefficients} coefficients (without the leading 1) but {lsf} LSFs"
    )]
    Lengths {
        /// The polynomial.
        polynomial: Polynomial,
        /// Number of coefficients.
        coefficients: usize,
        /// Number of LSFs.
        lsf: usize,
    },
    /// The polynomial has a root on or outside the unit circle.
    #[error(
        "the {polynomial} polynomial has a root on or outside the unit circle (or a coefficient that is not finite)"
    )]
    Unstable {
        /// The polynomial.
        polynomial: Polynomial,
    },
    /// LSFs must ascend strictly within (0, π).
    #[error(
        "the {polynomial} LSFs must ascend within (0, pi), at least {MIN_LSF_GAP_RAD} rad apart; number {index} (from 0; the last is pi itself) does not"
    )]
    LsfOrder {
        /// The polynomial.
        polynomial: Polynomial,
        /// The first that breaks the order; the number of LSFs if the last is too close to π.
        index: usize,
    },
    /// Coefficients and LSFs are not of the same polynomial.
    #[error(
        "the {polynomial} LSFs do not belong to the coefficients: coefficient {index} is {stored}, but the LSFs give {implied}"
    )]
    Disagree {
        /// The polynomial.
        polynomial: Polynomial,
        /// The coefficient's number, from 1.
        index: usize,
        /// The stored coefficient.
        stored: f64,
        /// The coefficient that follows from the LSFs.
        implied: f64,
    },
    /// The gain is not positive.
    #[error("the gain is {gain}; it must be a finite number above 0")]
    Gain {
        /// The value given.
        gain: f64,
    },
    /// The warping factor is out of its range, or leaves no power.
    #[error(
        "the warping factor is {warping}; it must lie above 0 and be at most {MAX_WARPING}, with at least one coefficient"
    )]
    Warping {
        /// The value given.
        warping: f64,
    },
    /// A vertex has both a variance and a power, or neither.
    #[error("a vertex needs either `variance` or `power_m2_s4`, not both")]
    Level,
    /// A moving average on a warped axis.
    #[error("a warped filter has no `ma`, `ma_lsf` or `gain`")]
    WarpedMovingAverage,
    /// The power is negative or not finite.
    #[error("the power is {power} (m/s2)^2; it must be a finite number of at least 0")]
    Power {
        /// The value given.
        power: f64,
    },
    /// The variance is negative or not finite.
    #[error("the variance is {variance}; it must be a finite number of at least 0")]
    Variance {
        /// The value given.
        variance: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resonance_has_its_closed_form_response() {
        let (radius, angle) = (0.95_f64, 0.7_f64);
        let ar = [-2.0 * radius * angle.cos(), radius * radius];
        let model = ArmaModel::from_arma(&ar, &[0.5], 3.0, 0.2).unwrap();
        for w in [0.0_f64, 0.3, 0.7, 2.0, PI] {
            let pole = |sign: f64| 1.0 + radius * radius - 2.0 * radius * (w - sign * angle).cos();
            let expected = 9.0 * (1.25 + w.cos()) / (pole(1.0) * pole(-1.0));
            assert!((model.power_gain_at(w) / expected - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn unsound_models_are_refused_with_the_reason() {
        assert!(matches!(ArmaModel::from_ar(&[0.0, 1.0], 1.0), Err(ModelError::Unstable { .. })));
        assert!(matches!(ArmaModel::from_ar(&[0.5], -1.0), Err(ModelError::Variance { .. })));
        assert!(matches!(ArmaModel::from_ar(&[0.5], f64::NAN), Err(ModelError::Variance { .. })));
        assert!(matches!(ArmaModel::from_arma(&[0.5], &[2.0], 1.0, 1.0), Err(ModelError::Unstable { .. })));
        assert!(matches!(ArmaModel::from_arma(&[0.5], &[0.2], 0.0, 1.0), Err(ModelError::Gain { .. })));
        assert!(matches!(ArmaModel::from_ar(&[0.0; 33], 1.0), Err(ModelError::Order { .. })));
        let swapped = ArmaModel::from_lsf(&[1.0, 0.5], &[], 1.0, 1.0);
        assert!(matches!(swapped, Err(ModelError::LsfOrder { index: 1, .. })));
        assert!(matches!(
            ArmaModel::from_lsf(&[PI], &[], 1.0, 1.0),
            Err(ModelError::LsfOrder { index: 1, .. })
        ));
        let strange = StoredModel {
            ar: vec![0.5],
            ar_lsf: vec![0.5],
            ma: vec![],
            ma_lsf: vec![],
            gain: 1.0,
            variance: 1.0,
        };
        assert!(matches!(ArmaModel::from_stored(strange), Err(ModelError::Disagree { index: 1, .. })));
    }

    #[test]
    fn a_warped_model_keeps_its_power_and_resolves_low_frequencies() {
        let lsf: Vec<f64> =
            (1..=6).map(|k| PI * f64::from(k) / 7.0 - if k == 2 { 0.3 } else { 0.0 }).collect();
        let model = ArmaModel::warped_from_lsf(&lsf, 0.8, 2.5).unwrap();
        assert_eq!((model.power(), model.warping()), (2.5, 0.8));
        let again = ArmaModel::warped_from_ar(model.ar(), 0.8, model.variance()).unwrap();
        assert!((again.power() / 2.5 - 1.0).abs() < 1e-9);
        // The mean of the density over the plain axis is the power.
        let mean =
            (0..100_000).map(|k| model.power_gain_at(PI * (f64::from(k) + 0.5) / 100_000.0)).sum::<f64>()
                * model.variance()
                / 100_000.0;
        assert!((mean / 2.5 - 1.0).abs() < 1e-6, "{mean}");
        for (warping, power) in [(0.0, 1.0), (0.99, 1.0), (f64::NAN, 1.0), (0.8, -1.0), (0.8, f64::NAN)] {
            assert!(ArmaModel::warped_from_lsf(&lsf, warping, power).is_err());
        }
    }

    #[test]
    fn order_zero_is_white_noise() {
        let white = ArmaModel::from_ar(&[], 2.0).unwrap();
        assert_eq!(white.power_gain_at(1.0), 1.0);
    }
}
