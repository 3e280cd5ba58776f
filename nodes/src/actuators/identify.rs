//! Fits a voice-coil actuator on its tool to a recorded sweep of current and felt acceleration.
//!
//! The recorded response A/I is estimated in narrow bands and matched by g s^4 / D(s) and a delay: first by a linear
//! fit (Sanathanan and Koerner 1963), then by least squares of the acceleration's error (Levenberg and Marquardt),
//! which is maximum likelihood when the accelerometer's noise is white.
//!
//! A sweep determines five numbers: g and the four of D. The two masses have seven parameters, of which one
//! scale (all of them together with K_f) is not observable; so one known mass does not suffice: six unknown ratios
//! stand against five numbers. Two must be known, the magnet's mass and either the body's mass or the force per current
//! ([`Known`]); with nothing known the resonances, their quality and the gain remain.

use super::two_mass::{Mode, Response, TwoMass};
use haptograph_signal::{Complex64, fft};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;
use std::ops::Range;

/// Known parameters of the actuator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Known {
    /// Nothing.
    Nothing,
    /// Both masses, kg.
    Masses {
        /// The magnet's.
        magnet_kg: f64,
        /// The body's with tool and hand.
        body_kg: f64,
    },
    /// The magnet's mass, kg, and the force per current, N/A (from its data sheet).
    MagnetAndForce {
        /// The magnet's mass.
        magnet_kg: f64,
        /// K_f.
        force_n_per_a: f64,
    },
}

/// Largest plausible current of a voice coil.
const MAX_CURRENT_A: f64 = 1e6;
/// Largest plausible acceleration.
const MAX_ACCELERATION_M_S2: f64 = 1e9;

/// A recording of a sweep.
#[derive(Debug, Clone, Copy)]
pub struct Sweep<'a> {
    /// Current, A. It should begin and end at rest (`sweep_current`).
    pub current_a: &'a [f64],
    /// Felt acceleration, m/s2, at the same times.
    pub acceleration_m_s2: &'a [f64],
    /// Samples per second.
    pub rate_hz: f64,
    /// Band that the sweep covers, Hz.
    pub band_hz: [f64; 2],
}

/// An actuator fitted to a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Identified {
    /// Acceleration per current.
    pub response: Response,
    /// The resonances, the higher first.
    pub modes: [Mode; 2],
    /// Delay of the recording (converters, held current), s.
    pub delay_s: f64,
    /// The masses, springs and dampers, if enough is known. The higher resonance is assumed to be the magnet's.
    pub parameters: Option<TwoMass>,
    /// Fraction of the acceleration's power within the band that the fit does not explain.
    pub unexplained: f64,
    /// The recording and the fit in narrow bands, by rising frequency.
    pub bands: Vec<BandAnswer>,
}

/// Acceleration by current in a narrow band, m/s2 per A, without the whole samples of the recording's delay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandAnswer {
    /// Middle of the band, by the current's power.
    pub frequency_hz: f64,
    /// The recorded response.
    pub measured: Complex64,
    /// The fitted response.
    pub fitted: Complex64,
}

/// Error of the fit of an actuator.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    /// The signals differ in length or are too short.
    #[error("{}", fault_of_lengths(*current, *acceleration))]
    Lengths {
        /// Samples of current.
        current: usize,
        /// Samples of acceleration.
        acceleration: usize,
    },
    /// The band is not within the rate.
    #[error("{}", fault_of_band([*low_hz, *high_hz], *rate_hz))]
    Band {
        /// Lower end.
        low_hz: f64,
        /// Upper end.
        high_hz: f64,
        /// Samples per second.
        rate_hz: f64,
    },
    /// A sample that is not finite.
    #[error("sample {index} of the recording is not a finite number")]
    NotFinite {
        /// Index of the sample.
        index: usize,
    },
    /// A sample is so large that sums of powers lose all others.
    #[error("the recording's {what} reaches {largest:e} {unit}: check the units and look for a wrong sample")]
    OutOfScale {
        /// Current or acceleration.
        what: &'static str,
        /// Largest absolute sample.
        largest: f64,
        /// The unit.
        unit: &'static str,
    },
    /// The recording has no current in the band.
    #[error("the recording has no current in the band: record a sweep over it")]
    NoSignal,
    /// No actuator fits the recording.
    #[error(
        "no actuator explains the recording: {unexplained:.0} % of the acceleration's power remains unexplained; check the units, the band and that the sensor was on the tool"
    )]
    NoFit {
        /// Percent.
        unexplained: f64,
    },
    /// The known parameters contradict the recording.
    #[error(
        "no springs and dampers above zero give the recorded resonances with the known parameters: check the masses"
    )]
    Contradiction,
}

/// Fewest samples of a sweep.
const MIN_SAMPLES: usize = 1000;

fn fault_of_lengths(current: usize, acceleration: usize) -> String {
    match current == acceleration {
        true => format!("the recording has {current} samples; at least {MIN_SAMPLES} are needed"),
        false => {
            format!(
                "the current has {current} samples and the acceleration {acceleration}; give as many of both"
            )
        }
    }
}

fn fault_of_band([low_hz, high_hz]: [f64; 2], rate_hz: f64) -> String {
    if low_hz <= 0.0 {
        return format!("the band begins at {low_hz} Hz; it has to begin above 0 Hz");
    }
    match low_hz < high_hz {
        true => format!(
            "the band ends at {high_hz} Hz; at a rate of {rate_hz} Hz it has to end below a quarter of that, {} Hz",
            rate_hz / 4.0
        ),
        false => format!("the band begins at {low_hz} Hz and ends at {high_hz} Hz; it has to rise"),
    }
}

/// A sweep of current, its frequency rising by equal factors in equal times, that starts and ends at rest (5 % of the
/// time each to fade in and out).
pub(crate) fn sweep_current(peak_a: f64, band_hz: [f64; 2], duration_s: f64, rate_hz: f64) -> Vec<f64> {
    let count = (duration_s * rate_hz) as usize;
    let growth = (band_hz[1] / band_hz[0]).ln();
    let fade = |u: f64| 0.5 - 0.5 * (std::f64::consts::PI * (u / 0.05).clamp(0.0, 1.0)).cos();
    let sample = |k: usize| {
        let u = k as f64 / count as f64;
        let phase = TAU * band_hz[0] * duration_s / growth * ((growth * u).exp() - 1.0);
        peak_a * fade(u) * fade(1.0 - u) * phase.sin()
    };
    (0..count).map(sample).collect()
}

/// Fits an actuator to a recorded sweep.
pub fn identify(sweep: &Sweep, known: Known) -> Result<Identified, IdentifyError> {
    let (bands, early) = measure(sweep)?;
    let fit =
        Fit::start(&bands, sweep.rate_hz).ok_or(IdentifyError::NoFit { unexplained: 100.0 })?.refine(&bands);
    let unexplained = fit.error(&bands) / bands.iter().map(|b| b.weight * b.answer.norm_sqr()).sum::<f64>();
    let response = fit.response();
    let modes = response.modes().filter(|_| unexplained < 0.5);
    let modes = modes.ok_or(IdentifyError::NoFit { unexplained: 100.0 * unexplained })?;
    let parameters = match known {
        Known::Nothing => None,
        _ => Some(parameters(&response, known).ok_or(IdentifyError::Contradiction)?),
    };
    Ok(Identified {
        response,
        modes,
        delay_s: fit.delay_s() + early as f64 / sweep.rate_hz,
        parameters,
        unexplained,
        bands: bands.iter().map(|band| fit.answer(band)).collect(),
    })
}

/// The measured response in one band.
#[derive(Debug, Clone, Copy)]
struct Band {
    omega: f64,
    answer: Complex64,
    /// Power of the current in the band: the inverse of the response's variance under white noise.
    weight: f64,
}

/// The bands, and by how many samples the acceleration was advanced for them.
fn measure(sweep: &Sweep) -> Result<(Vec<Band>, usize), IdentifyError> {
    const PER_OCTAVE: f64 = 32.0;
    let (current, acceleration) = (sweep.current_a.len(), sweep.acceleration_m_s2.len());
    if current != acceleration || current < MIN_SAMPLES {
        return Err(IdentifyError::Lengths { current, acceleration });
    }
    let ([low_hz, high_hz], rate_hz) = (sweep.band_hz, sweep.rate_hz);
    if !(0.0 < low_hz && low_hz < high_hz && high_hz < rate_hz / 4.0) {
        return Err(IdentifyError::Band { low_hz, high_hz, rate_hz });
    }
    let bad = |x: &[f64]| x.iter().position(|v| !v.is_finite());
    if let Some(index) = bad(sweep.current_a).or(bad(sweep.acceleration_m_s2)) {
        return Err(IdentifyError::NotFinite { index });
    }
    for (what, unit, x, most) in [
        ("current", "A", sweep.current_a, MAX_CURRENT_A),
        ("acceleration", "m/s2", sweep.acceleration_m_s2, MAX_ACCELERATION_M_S2),
    ] {
        let largest = x.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
        if largest > most {
            return Err(IdentifyError::OutOfScale { what, largest, unit });
        }
    }
    let (current, acceleration) = (spectrum(sweep.current_a), spectrum(sweep.acceleration_m_s2));
    let bin_hz = rate_hz / sweep.current_a.len() as f64;
    let within = (low_hz / bin_hz).ceil() as usize..(high_hz / bin_hz).ceil() as usize;
    let early = whole_delay(&current, &acceleration, within, rate_hz);
    let mut bands = Vec::new();
    let mut edge_hz = low_hz;
    while edge_hz < high_hz {
        let next_hz = (edge_hz * 2_f64.powf(1.0 / PER_OCTAVE)).min(high_hz);
        let bins = (edge_hz / bin_hz).ceil() as usize..(next_hz / bin_hz).ceil() as usize;
        edge_hz = next_hz;
        let (mut cross, mut power, mut middle) = (Complex64::ZERO, 0.0, 0.0);
        for bin in bins {
            let turn = Complex64::from_polar(1.0, TAU * (bin * early) as f64 / current.len() as f64);
            cross += acceleration[bin] * turn * current[bin].conj();
            power += current[bin].norm_sqr();
            middle += current[bin].norm_sqr() * bin as f64 * bin_hz;
        }
        if power > 0.0 {
            bands.push(Band { omega: TAU * middle / power, answer: cross / power, weight: power });
        }
    }
    if bands.len() < 10 { Err(IdentifyError::NoSignal) } else { Ok((bands, early)) }
}

/// Samples by which to advance the acceleration, so that a delay of a few samples remains. A soundcard's buffers
/// are milliseconds, which rotate the phase of the response within a band. The impulse response starts at its largest peak: above its
/// resonances the acceleration follows the current.
fn whole_delay(
    current: &[Complex64],
    acceleration: &[Complex64],
    within: Range<usize>,
    rate_hz: f64,
) -> usize {
    const LONGEST_S: f64 = 1.0;
    /// Fraction of the strongest bin's power below which a bin is mostly noise.
    const LEAST_POWER: f64 = 1e-4;
    /// Samples of delay left for the fit to determine.
    const LEFT: usize = 5;
    let strongest = within.clone().map(|bin| current[bin].norm_sqr()).fold(0.0, f64::max);
    let mut answer = vec![Complex64::ZERO; current.len()];
    for bin in within {
        let power = current[bin].norm_sqr();
        if power > LEAST_POWER * strongest {
            answer[bin] = acceleration[bin] * current[bin].conj() / power;
        }
    }
    fft::inverse(answer.len()).process(&mut answer);
    let longest = ((LONGEST_S * rate_hz) as usize).min(answer.len() / 2);
    let peak = (0..longest).max_by(|a, b| answer[*a].norm_sqr().total_cmp(&answer[*b].norm_sqr()));
    match peak.unwrap_or(0) {
        // The fit has known so much all along.
        0..=10 => 0,
        peak => peak - LEFT,
    }
}

fn spectrum(x: &[f64]) -> Vec<Complex64> {
    let mut bins: Vec<Complex64> = x.iter().map(|&v| Complex64::from(v)).collect();
    fft::forward(bins.len()).process(&mut bins);
    bins
}

/// g s^4 e^(-s delay) / [(s^2 + a_1 s + b_1)(s^2 + a_2 s + b_2)] in a form that stays a stable actuator: the
/// logarithms of a and b, gain and delay relative to the start's.
#[derive(Debug, Clone)]
struct Fit {
    /// ln a_1, ln b_1, ln a_2, ln b_2, g / scale, delay in samples.
    values: [f64; 6],
    gain_scale: f64,
    rate_hz: f64,
}

impl Fit {
    fn start(bands: &[Band], rate_hz: f64) -> Option<Self> {
        let candidates = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0].iter().filter_map(|&delay| {
            let response = linear_fit(bands, delay / rate_hz)?;
            let [first, second] = response.modes()?.map(|mode| {
                let omega = TAU * mode.frequency_hz;
                [(omega / mode.q).ln(), (omega * omega).ln()]
            });
            let values = [first[0], first[1], second[0], second[1], 1.0, delay];
            Some(Self { values, gain_scale: response.gain, rate_hz })
        });
        candidates.min_by(|a, b| a.error(bands).total_cmp(&b.error(bands)))
    }

    fn at(&self, omega: f64) -> Complex64 {
        let [a1, b1, a2, b2, gain, delay] = self.values;
        let s = Complex64::new(0.0, omega);
        let quadratic = |a: f64, b: f64| (s + a.exp()) * s + b.exp();
        let turn = Complex64::from_polar(1.0, -omega * delay / self.rate_hz);
        s.powi(4) * turn * gain * self.gain_scale / (quadratic(a1, b1) * quadratic(a2, b2))
    }

    fn answer(&self, band: &Band) -> BandAnswer {
        BandAnswer { frequency_hz: band.omega / TAU, measured: band.answer, fitted: self.at(band.omega) }
    }

    fn error(&self, bands: &[Band]) -> f64 {
        bands.iter().map(|b| b.weight * (b.answer - self.at(b.omega)).norm_sqr()).sum()
    }

    fn residuals(&self, bands: &[Band]) -> DVector<f64> {
        let parts = bands.iter().flat_map(|b| {
            let error = (b.answer - self.at(b.omega)) * b.weight.sqrt();
            [error.re, error.im]
        });
        DVector::from_iterator(2 * bands.len(), parts)
    }

    /// Levenberg-Marquardt with a numerical Jacobian.
    fn refine(mut self, bands: &[Band]) -> Self {
        let mut damping = 1e-3;
        for _ in 0..100 {
            let residuals = self.residuals(bands);
            let mut jacobian = DMatrix::zeros(residuals.len(), 6);
            for column in 0..6 {
                let mut moved = self.clone();
                moved.values[column] += 1e-6;
                jacobian.set_column(column, &((moved.residuals(bands) - &residuals) / 1e-6));
            }
            let mut normal = jacobian.transpose() * &jacobian;
            (0..6).for_each(|i| normal[(i, i)] *= 1.0 + damping);
            let Some(step) = normal.lu().solve(&(jacobian.transpose() * &residuals)) else {
                break;
            };
            let mut moved = self.clone();
            moved.values.iter_mut().zip(step.iter()).for_each(|(value, step)| *value -= step);
            if moved.error(bands) < self.error(bands) {
                let done = step.amax() < 1e-10;
                self = moved;
                damping *= 0.3;
                if done {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e9 {
                    break;
                }
            }
        }
        self
    }

    fn response(&self) -> Response {
        let [a1, b1, a2, b2, gain, _] = self.values;
        let [a1, b1, a2, b2] = [a1, b1, a2, b2].map(f64::exp);
        Response {
            gain: gain * self.gain_scale,
            denominator: [a1 + a2, b1 + b2 + a1 * a2, a1 * b2 + a2 * b1, b1 * b2],
        }
    }

    fn delay_s(&self) -> f64 {
        self.values[5] / self.rate_hz
    }
}

/// Many times what a matrix of five columns takes.
const SVD_ITERATIONS: usize = 1000;

/// Sanathanan and Koerner: g s^4 - H (c_3 s^3 + ... + c_0) = H s^4, reweighted by the last denominator.
fn linear_fit(bands: &[Band], delay_s: f64) -> Option<Response> {
    let unit = TAU * 100.0;
    let mut denominator = [0.0; 4];
    let mut gain = 0.0;
    for round in 0..20 {
        let mut rows = DMatrix::zeros(2 * bands.len(), 5);
        let mut right = DVector::zeros(2 * bands.len());
        for (k, band) in bands.iter().enumerate() {
            let s = Complex64::new(0.0, band.omega / unit);
            let answer = band.answer * Complex64::from_polar(1.0, band.omega * delay_s);
            let [c3, c2, c1, c0] = denominator;
            let last = if round == 0 { s.powi(4) } else { (((s + c3) * s + c2) * s + c1) * s + c0 };
            let weight = band.weight.sqrt() / last.norm();
            let columns = [s.powi(4), -answer * s.powi(3), -answer * s.powi(2), -answer * s, -answer];
            for (j, column) in columns.iter().enumerate() {
                rows[(2 * k, j)] = column.re * weight;
                rows[(2 * k + 1, j)] = column.im * weight;
            }
            let b = answer * s.powi(4) * weight;
            right[2 * k] = b.re;
            right[2 * k + 1] = b.im;
        }
        // The decomposition does not terminate on NaN.
        if !rows.iter().chain(&right).all(|x| x.is_finite()) {
            return None;
        }
        let solution = rows.try_svd(true, true, f64::EPSILON, SVD_ITERATIONS)?.solve(&right, 1e-12).ok()?;
        gain = solution[0];
        denominator = [solution[1], solution[2], solution[3], solution[4]];
    }
    let powers = [unit, unit.powi(2), unit.powi(3), unit.powi(4)];
    let denominator = std::array::from_fn(|i| denominator[i] * powers[i]);
    Some(Response { gain, denominator })
}

/// The springs and dampers that make this response with known masses.
fn parameters(response: &Response, known: Known) -> Option<TwoMass> {
    let (magnet_kg, body_kg, force_n_per_a) = match known {
        Known::Nothing => return None,
        Known::Masses { magnet_kg, body_kg } => (magnet_kg, body_kg, response.gain.abs() * body_kg),
        Known::MagnetAndForce { magnet_kg, force_n_per_a } => {
            (magnet_kg, force_n_per_a / response.gain.abs(), force_n_per_a)
        }
    };
    let [c3, c2, c1, c0] = response.denominator;
    let ratio = 1.0 + magnet_kg / body_kg;
    // With the magnet's own frequency squared w given, three of the four equations give the rest; the fourth is left.
    let rest = |w: f64| {
        let grip = c0 / w;
        let beta = (c1 - c3 * w) / (grip - ratio * w);
        let grip_beta = c3 - beta * ratio;
        ([grip, beta, grip_beta], w * ratio + grip + beta * grip_beta - c2)
    };
    let good = |w: f64| rest(w).0.iter().all(|x| *x > 0.0);
    let steps = 4000;
    let grid = |k: i32| c2 * 10_f64.powf(-6.0 * f64::from(k) / f64::from(steps));
    for k in 0..steps {
        let (mut high, mut low) = (grid(k), grid(k + 1));
        if !(good(high) && good(low)) || rest(high).1 * rest(low).1 > 0.0 {
            continue;
        }
        for _ in 0..100 {
            let middle = 0.5 * (high + low);
            if rest(middle).1 * rest(high).1 > 0.0 { high = middle } else { low = middle }
        }
        let [grip, beta, grip_beta] = rest(low).0;
        let found = TwoMass {
            force_n_per_a,
            magnet_kg,
            suspension_n_per_m: low * magnet_kg,
            suspension_n_s_per_m: beta * magnet_kg,
            body_kg,
            hand_n_per_m: grip * body_kg,
            hand_n_s_per_m: grip_beta * body_kg,
        };
        return found.checked().ok();
    }
    None
}

#[cfg(test)]
mod tests;
