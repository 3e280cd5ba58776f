//! Classical designs: analog prototype, frequency transform, bilinear transform with prewarping.

use super::{Biquad, Sections};
use crate::Complex64;
use std::f64::consts::PI;
use std::ops::Deref;
use thiserror::Error;

/// Highest prototype order a design accepts. Beyond it single sections get too resonant to be of use.
pub const MAX_ORDER: usize = 16;

/// Error of a filter design.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DesignError {
    /// Order 0 or too high.
    #[error("a filter of order {order} cannot be designed; orders 1 to {MAX_ORDER} can")]
    Order {
        /// The requested order.
        order: usize,
    },
    /// A sample rate that is not a positive number.
    #[error("the sample rate must be a positive number of hertz, not {rate_hz}")]
    Rate {
        /// The rate given.
        rate_hz: f64,
    },
    /// A cut-off at or below 0 or at or above half the sample rate.
    #[error("a cut-off of {cutoff_hz} Hz must lie above 0 and below half the sample rate, {nyquist_hz} Hz")]
    Cutoff {
        /// The cut-off given.
        cutoff_hz: f64,
        /// Half the sample rate.
        nyquist_hz: f64,
    },
    /// A frequency so close to 0 or to half the sample rate that the coefficients cannot represent it.
    #[error(
        "double precision cannot represent a filter at {frequency_hz} Hz for a sample rate of {rate_hz} Hz; keep it at least {lowest_hz:.3e} Hz above 0 and below half the rate"
    )]
    Extreme {
        /// The cut-off or edge given.
        frequency_hz: f64,
        /// The sample rate.
        rate_hz: f64,
        /// The lowest that can be designed.
        lowest_hz: f64,
    },
    /// A pass band so narrow that the coefficients cannot represent its width.
    #[error("the band from {low_hz} to {high_hz} Hz is too narrow for a filter; widen it")]
    NarrowBand {
        /// The lower edge given.
        low_hz: f64,
        /// The upper edge given.
        high_hz: f64,
    },
    /// A pass band whose lower edge is not below its upper edge.
    #[error("the band's lower edge, {low_hz} Hz, must be below its upper edge, {high_hz} Hz")]
    EmptyBand {
        /// The lower edge given.
        low_hz: f64,
        /// The upper edge given.
        high_hz: f64,
    },
}

/// A design without frequencies. [`at`](Self::at) computes its sections without allocating, so that a running filter
/// can be tuned.
#[derive(Debug, Clone, PartialEq)]
pub struct Prototype {
    /// Analog poles of a low-pass with its -3 dB point at 1 rad/s; none for the double pole.
    poles: [Complex64; MAX_ORDER],
    order: usize,
    band: Band,
}

/// Transform of the prototype.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Band {
    Low,
    High,
    Between,
    /// No transform of a prototype: two real poles by backward differences.
    DoublePole,
}

impl Prototype {
    /// The prototype of [`butterworth_lowpass`].
    ///
    /// # Errors
    /// [`DesignError::Order`].
    pub fn butterworth_lowpass(order: usize) -> Result<Self, DesignError> {
        Ok(Self::new(Band::Low, &butterworth_prototype(check(order)?)))
    }

    /// The prototype of [`butterworth_highpass`].
    ///
    /// # Errors
    /// [`DesignError::Order`].
    pub fn butterworth_highpass(order: usize) -> Result<Self, DesignError> {
        Ok(Self::new(Band::High, &butterworth_prototype(check(order)?)))
    }

    /// The prototype of [`butterworth_bandpass`].
    ///
    /// # Errors
    /// [`DesignError::Order`].
    pub fn butterworth_bandpass(order: usize) -> Result<Self, DesignError> {
        Ok(Self::new(Band::Between, &butterworth_prototype(check(order)?)))
    }

    /// The prototype of [`bessel_lowpass`].
    ///
    /// # Errors
    /// [`DesignError::Order`].
    pub fn bessel_lowpass(order: usize) -> Result<Self, DesignError> {
        Ok(Self::new(Band::Low, &bessel_prototype(check(order)?)))
    }

    /// The prototype of [`double_pole`].
    pub fn double_pole() -> Self {
        Self::new(Band::DoublePole, &[])
    }

    fn new(band: Band, poles: &[Complex64]) -> Self {
        let mut all = [Complex64::new(0.0, 0.0); MAX_ORDER];
        all.iter_mut().zip(poles).for_each(|(to, pole)| *to = *pole);
        Self { poles: all, order: poles.len(), band }
    }

    /// Computes the sections for a cut-off, Hz, the edges of a band, Hz, or poles at lambda, rad/s; a design with one
    /// frequency ignores the second. The number of sections does not depend on the frequencies.
    ///
    /// # Errors
    /// [`DesignError`] for an invalid rate or frequency.
    pub fn at(&self, [first, second]: [f64; 2], rate_hz: f64) -> Result<Cascade, DesignError> {
        let poles = self.poles[..self.order].iter();
        match self.band {
            Band::Low => {
                let cutoff = told(self.order, first, rate_hz)?;
                let poles = poles.map(|p| bilinear(p * cutoff));
                Ok(cascade(poles, Zeros::Nyquist, Complex64::new(1.0, 0.0)))
            }
            Band::High => {
                let cutoff = told(self.order, first, rate_hz)?;
                let poles = poles.map(|p| bilinear(cutoff / p));
                Ok(cascade(poles, Zeros::Dc, Complex64::new(-1.0, 0.0)))
            }
            Band::Between => self.between(first, second, rate_hz),
            Band::DoublePole => two_equal_poles(first, rate_hz),
        }
    }

    fn between(&self, low_hz: f64, high_hz: f64, rate_hz: f64) -> Result<Cascade, DesignError> {
        // There are two poles for each of the prototype.
        let edge = |hz| told(2 * self.order, hz, rate_hz);
        let (low, high) = (edge(low_hz)?, edge(high_hz)?);
        if low_hz >= high_hz {
            return Err(DesignError::EmptyBand { low_hz, high_hz });
        }
        let (width, centre_squared) = (high - low, low * high);
        if width < NARROWEST * (1.0 + centre_squared) {
            return Err(DesignError::NarrowBand { low_hz, high_hz });
        }
        let split = |p: &Complex64| {
            // s^2 - p width s + centre^2 = 0
            let half = p * (width / 2.0);
            let root = (half * half - centre_squared).sqrt();
            [half + root, half - root]
        };
        let poles = self.poles[..self.order].iter().flat_map(split).map(bilinear);
        let centre = bilinear(Complex64::new(0.0, centre_squared.sqrt()));
        Ok(cascade(poles, Zeros::DcAndNyquist, centre))
    }
}

/// The sections of a design, without allocation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cascade {
    sections: [Biquad; MAX_ORDER],
    count: usize,
}

impl Deref for Cascade {
    type Target = [Biquad];

    fn deref(&self) -> &[Biquad] {
        &self.sections[..self.count]
    }
}

impl From<Cascade> for Sections {
    fn from(cascade: Cascade) -> Self {
        Self { sections: cascade.to_vec() }
    }
}

/// Butterworth low-pass, -3 dB at `cutoff_hz`, unit gain at 0.
///
/// # Errors
/// [`DesignError`] for an invalid order, rate or cut-off.
pub fn butterworth_lowpass(order: usize, cutoff_hz: f64, rate_hz: f64) -> Result<Sections, DesignError> {
    designed(&Prototype::butterworth_lowpass(order)?, [cutoff_hz; 2], rate_hz)
}

/// Butterworth high-pass, -3 dB at `cutoff_hz`, unit gain at the Nyquist frequency.
///
/// # Errors
/// As [`butterworth_lowpass`].
pub fn butterworth_highpass(order: usize, cutoff_hz: f64, rate_hz: f64) -> Result<Sections, DesignError> {
    designed(&Prototype::butterworth_highpass(order)?, [cutoff_hz; 2], rate_hz)
}

/// Butterworth band-pass from a prototype of this order, so `2 order` poles; -3 dB at both edges, unit gain at the
/// centre.
///
/// # Errors
/// As [`butterworth_lowpass`], and [`DesignError::EmptyBand`].
pub fn butterworth_bandpass(
    order: usize,
    low_hz: f64,
    high_hz: f64,
    rate_hz: f64,
) -> Result<Sections, DesignError> {
    designed(&Prototype::butterworth_bandpass(order)?, [low_hz, high_hz], rate_hz)
}

/// Bessel low-pass (flattest group delay), -3 dB at `cutoff_hz`, unit gain at 0.
///
/// The bilinear transform keeps the magnitude and bends the delay: it is flat well below the Nyquist frequency only.
///
/// # Errors
/// As [`butterworth_lowpass`].
pub fn bessel_lowpass(order: usize, cutoff_hz: f64, rate_hz: f64) -> Result<Sections, DesignError> {
    designed(&Prototype::bessel_lowpass(order)?, [cutoff_hz; 2], rate_hz)
}

/// Two equal real poles at `lambda_rad_s`, by backward differences: `(lambda T)^2 / (1 + lambda T - z^-1)^2`.
///
/// The velocity filter of the public haptic texture toolkit, with lambda = 125 rad/s: -6 dB near lambda/2 pi, -3 dB
/// at 0.64 of that, delay 2/lambda.
///
/// # Errors
/// [`DesignError::Rate`]; [`DesignError::Cutoff`] unless lambda is positive.
pub fn double_pole(lambda_rad_s: f64, rate_hz: f64) -> Result<Sections, DesignError> {
    designed(&Prototype::double_pole(), [lambda_rad_s; 2], rate_hz)
}

fn designed(prototype: &Prototype, frequencies: [f64; 2], rate_hz: f64) -> Result<Sections, DesignError> {
    prototype.at(frequencies, rate_hz).map(Sections::from)
}

fn two_equal_poles(lambda_rad_s: f64, rate_hz: f64) -> Result<Cascade, DesignError> {
    let nyquist_hz = check_rate(rate_hz)? / 2.0;
    if !(lambda_rad_s.is_finite() && lambda_rad_s > 0.0) {
        let cutoff_hz = lambda_rad_s / (2.0 * PI);
        return Err(DesignError::Cutoff { cutoff_hz, nyquist_hz });
    }
    let step = lambda_rad_s / rate_hz;
    if step < 2.0 * LEAST_PAIR {
        return Err(DesignError::Extreme {
            frequency_hz: lambda_rad_s / (2.0 * PI),
            rate_hz,
            lowest_hz: LEAST_PAIR * rate_hz / PI,
        });
    }
    let (gain, pole) = (step / (1.0 + step), 1.0 / (1.0 + step));
    let mut sections = [Biquad::IDENTITY; MAX_ORDER];
    sections[0] = Biquad { b: [gain * gain, 0.0, 0.0], a: [-2.0 * pole, pole * pole] };
    Ok(Cascade { sections, count: 1 })
}

fn check(order: usize) -> Result<usize, DesignError> {
    if (1..=MAX_ORDER).contains(&order) { Ok(order) } else { Err(DesignError::Order { order }) }
}

fn check_rate(rate_hz: f64) -> Result<f64, DesignError> {
    if rate_hz.is_finite() && rate_hz > 0.0 { Ok(rate_hz) } else { Err(DesignError::Rate { rate_hz }) }
}

/// The analog frequency, in units of `2 rate`, that the bilinear transform carries to `cutoff_hz`.
fn prewarp(cutoff_hz: f64, rate_hz: f64) -> Result<f64, DesignError> {
    let nyquist_hz = check_rate(rate_hz)? / 2.0;
    if cutoff_hz > 0.0 && cutoff_hz < nyquist_hz {
        Ok((PI * cutoff_hz / rate_hz).tan())
    } else {
        Err(DesignError::Cutoff { cutoff_hz, nyquist_hz })
    }
}

/// A pair of poles at a distance of 2 w from z = 1 differs from a pair at z = 1 by 4 w^2 in its coefficients, which are
/// kept to 2e-16: at this w to a thousandth.
const LEAST_PAIR: f64 = 2.4e-7;
/// A single pole differs by 2 w.
const LEAST_SINGLE: f64 = 1e-12;
/// Poles within the unit circle by the band's width are likewise.
const NARROWEST: f64 = 1e-12;

/// As [`prewarp`], with an error for frequencies that the coefficients cannot represent.
fn told(order: usize, cutoff_hz: f64, rate_hz: f64) -> Result<f64, DesignError> {
    let cutoff = prewarp(cutoff_hz, rate_hz)?;
    let least = if order > 1 { LEAST_PAIR } else { LEAST_SINGLE };
    if (least..=1.0 / least).contains(&cutoff) {
        return Ok(cutoff);
    }
    Err(DesignError::Extreme { frequency_hz: cutoff_hz, rate_hz, lowest_hz: least.atan() * rate_hz / PI })
}

/// s, in units of `2 rate`, to z.
fn bilinear(s: Complex64) -> Complex64 {
    (1.0 + s) / (1.0 - s)
}

/// Poles of the order-n Butterworth filter with its -3 dB point at 1 rad/s.
fn butterworth_prototype(order: usize) -> Vec<Complex64> {
    let angle = |k: usize| PI * (2 * k + order + 1) as f64 / (2 * order) as f64;
    (0..order).map(|k| Complex64::from_polar(1.0, angle(k))).collect()
}

/// Poles of the order-n Bessel filter with its -3 dB point at 1 rad/s.
fn bessel_prototype(order: usize) -> Vec<Complex64> {
    // The reverse Bessel polynomial, normalised to a constant term of 1: c_k = c_{k-1} 2 (n-k+1) / (k (2n-k+1)).
    let mut coefficients = vec![1.0; order + 1];
    for k in 1..=order {
        let ratio = 2.0 * (order - k + 1) as f64 / (k * (2 * order - k + 1)) as f64;
        coefficients[k] = coefficients[k - 1] * ratio;
    }
    // This has unit delay; its -3 dB point, where |polynomial(jw)|^2 = 2, is found by bisection.
    let polynomial =
        |s: Complex64| coefficients.iter().rev().fold(Complex64::new(0.0, 0.0), |sum, c| sum * s + *c);
    let (mut low, mut high) = (0.1, 10.0 * order as f64);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if polynomial(Complex64::new(0.0, middle)).norm_sqr() < 2.0 { low = middle } else { high = middle }
    }
    roots(&coefficients).into_iter().map(|p| p / low).collect()
}

/// Roots of a polynomial with simple roots, by Aberth's simultaneous iteration; `coefficients[k]` belongs to s^k.
fn roots(coefficients: &[f64]) -> Vec<Complex64> {
    let order = coefficients.len() - 1;
    let evaluate = |s: Complex64| {
        let zero = Complex64::new(0.0, 0.0);
        coefficients.iter().rev().fold((zero, zero), |(p, d), c| (p * s + *c, d * s + p))
    };
    let radius = (coefficients[0] / coefficients[order]).powf(1.0 / order as f64);
    let mut roots: Vec<Complex64> = (0..order)
        .map(|k| Complex64::from_polar(radius, PI * (2 * k + order + 1) as f64 / (2 * order) as f64 + 0.1))
        .collect();
    for _ in 0..200 {
        let mut largest_step = 0.0_f64;
        for i in 0..order {
            let (p, d) = evaluate(roots[i]);
            if p.norm() == 0.0 {
                continue;
            }
            let newton = p / d;
            let repulsion: Complex64 =
                (0..order).filter(|j| *j != i).map(|j| (roots[i] - roots[j]).inv()).sum();
            let step = newton / (1.0 - newton * repulsion);
            roots[i] -= step;
            largest_step = largest_step.max(step.norm() / radius);
        }
        if largest_step < 1e-15 {
            break;
        }
    }
    roots
}

/// Position of a design's zeros: one for each pole, at z = -1, at z = 1, or shared evenly.
#[derive(Clone, Copy)]
enum Zeros {
    Nyquist,
    Dc,
    DcAndNyquist,
}

impl Zeros {
    fn pair(self) -> [f64; 3] {
        match self {
            Self::Nyquist => [1.0, 2.0, 1.0],
            Self::Dc => [1.0, -2.0, 1.0],
            Self::DcAndNyquist => [1.0, 0.0, -1.0],
        }
    }

    fn single(self) -> [f64; 3] {
        match self {
            Self::Nyquist => [1.0, 1.0, 0.0],
            Self::Dc => [1.0, -1.0, 0.0],
            Self::DcAndNyquist => [1.0, 0.0, 0.0],
        }
    }
}

/// Sections with these poles, each of unit gain at `reference`, the least resonant first so that none overflows the
/// next.
fn cascade(poles: impl Iterator<Item = Complex64>, zeros: Zeros, reference: Complex64) -> Cascade {
    let mut room = [[Complex64::new(0.0, 0.0); 2 * MAX_ORDER]; 2];
    let [real, complex] = &mut room;
    let (mut reals, mut pairs) = (0, 0);
    for pole in poles.take(2 * MAX_ORDER) {
        if pole.im.abs() < 1e-12 {
            real[reals] = pole;
            reals += 1;
        } else if pole.im > 0.0 {
            complex[pairs] = pole;
            pairs += 1;
        }
    }
    let (real, complex) = (&mut real[..reals], &mut complex[..pairs]);
    // Of so few elements neither allocates.
    complex.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
    real.sort_by(|a, b| a.re.total_cmp(&b.re));
    // Real poles come in pairs, the leftover of an odd order first.
    let (single, paired) = real.split_at(reals % 2);
    let single = single.iter().map(|p| (zeros.single(), [-p.re, 0.0]));
    let paired = paired.chunks_exact(2).map(|p| (zeros.pair(), [-(p[0].re + p[1].re), p[0].re * p[1].re]));
    let complex = complex.iter().map(|p| (zeros.pair(), [-2.0 * p.re, p.norm_sqr()]));
    let unit_gain = |(b, a): ([f64; 3], [f64; 2])| {
        let section = Biquad { b, a };
        let scale = 1.0 / section.gain_at(reference.inv()).norm();
        Biquad { b: b.map(|b| b * scale), a }
    };
    let mut sections = [Biquad::IDENTITY; MAX_ORDER];
    let mut count = 0;
    for (to, section) in sections.iter_mut().zip(single.chain(paired).chain(complex)) {
        *to = unit_gain(section);
        count += 1;
    }
    Cascade { sections, count }
}
