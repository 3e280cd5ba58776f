//! Taps: the acceleration transients of a tool that strikes the material, by impact speed.

use crate::SurfaceError;
use crate::bounds::{MAX_ACCELERATION_M_S2, MAX_FORCE_N, MAX_SPEED_M_S, RATES_HZ};
use haptograph_signal::resample::{Quality, Resampler};
use haptograph_signal::spectrum::spectral_centroid;
use haptograph_signal::statistics::{Line, mean};
use haptograph_signal::time::Rate;
use haptograph_signal::{Complex64, fft};

/// Tap transients in ascending impact speed, all at one rate and of one length.
#[derive(Debug, Clone, PartialEq)]
pub struct Taps {
    rate_hz: f64,
    taps: Vec<Tap>,
}

/// One recorded tap.
#[derive(Debug, Clone, PartialEq)]
pub struct Tap {
    /// Speed of the tool into the surface at contact, m/s.
    pub speed_m_s: f64,
    /// Acceleration of the tool after contact, m/s².
    pub acceleration_m_s2: Vec<f64>,
    /// Peak normal force of the recording, N, if the file has it.
    pub peak_force_n: Option<f64>,
}

/// Effective mass of the recording tool and the hand, kg. The force of a tap is this mass times its acceleration (thesis 4.3.2).
pub const EFFECTIVE_MASS_KG: f64 = 0.05;

impl Tap {
    /// Peak force of the rendered tap: [`EFFECTIVE_MASS_KG`] times its peak acceleration, N.
    pub(crate) fn rendered_peak_n(&self) -> f64 {
        let samples = self.acceleration_m_s2.iter();
        EFFECTIVE_MASS_KG * samples.fold(0.0_f64, |peak, a| peak.max(a.abs()))
    }
}

/// Exponent of the impact speed in the amplitude of real taps: the mean over 1,197 taps of HaTT's 100 materials, with a
/// standard deviation of 0.22.
const GROWTH: f64 = 0.70;
/// Amplitudes grow up to this multiple of the fastest recorded speed.
const GROWTH_REACH: f64 = 3.0;

/// Most samples of all taps together at another rate: 256 MiB.
pub(crate) const MAX_RESAMPLED: usize = 1 << 25;
/// Largest number of silent samples that is tried to make a resampler's delay a whole number of outputs.
const MAX_LEAD: usize = 10_000;

/// The two recorded taps that make the tap at a given speed, and their gains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TapMix {
    /// Number of the slower tap.
    pub lower: usize,
    /// Number of the faster tap (may equal `lower`).
    pub upper: usize,
    /// Gain on the slower tap.
    pub lower_gain: f64,
    /// Gain on the faster tap.
    pub upper_gain: f64,
}

impl Taps {
    /// Taps at `rate_hz`. Checks that speeds are positive and strictly ascending, lengths equal, samples finite, forces positive.
    pub fn new(rate_hz: f64, taps: Vec<Tap>) -> Result<Self, SurfaceError> {
        if !RATES_HZ.contains(&rate_hz) {
            return Err(SurfaceError::TapRate { rate_hz });
        }
        let expected = taps.first().ok_or(SurfaceError::NoTaps)?.acceleration_m_s2.len().max(1);
        let mut slower = 0.0;
        for (index, tap) in taps.iter().enumerate() {
            if !(tap.speed_m_s > slower && tap.speed_m_s <= MAX_SPEED_M_S) {
                return Err(SurfaceError::TapSpeed { tap: index, speed_m_s: tap.speed_m_s });
            }
            slower = tap.speed_m_s;
            let length = tap.acceleration_m_s2.len();
            if length != expected {
                return Err(SurfaceError::TapLength { tap: index, length, expected });
            }
            if let Some(peak_force_n) =
                tap.peak_force_n.filter(|force| !(*force > 0.0 && *force <= MAX_FORCE_N))
            {
                return Err(SurfaceError::TapForce { tap: index, peak_force_n });
            }
            let bound = -MAX_ACCELERATION_M_S2..=MAX_ACCELERATION_M_S2;
            if let Some(sample) = tap.acceleration_m_s2.iter().position(|a| !bound.contains(a)) {
                return Err(SurfaceError::TapSample { tap: index, sample });
            }
        }
        Ok(Taps { rate_hz, taps })
    }

    /// Samples per second.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// The recorded taps, slowest first.
    pub fn taps(&self) -> &[Tap] {
        &self.taps
    }

    /// Number of samples of each tap.
    pub fn length(&self) -> usize {
        self.taps[0].acceleration_m_s2.len()
    }

    /// True if the recorded peak force of every tap is known.
    pub fn has_forces(&self) -> bool {
        self.taps.iter().all(|tap| tap.peak_force_n.is_some())
    }

    /// The tap response: the line of peak normal force in N over impact speed in m/s. Its slope is the tap response factor
    /// (thesis 4.4.2), larger for harder surfaces. `None` for a single tap.
    ///
    /// Taps without recorded forces (such as those of the toolkit's files) use the forces of the rendered taps, which differ:
    /// do not compare the two ([`has_forces`](Self::has_forces)).
    pub fn response(&self) -> Option<Line> {
        let recorded = self.has_forces();
        let force_n = |tap: &Tap| match tap.peak_force_n {
            Some(force_n) if recorded => force_n,
            _ => tap.rendered_peak_n(),
        };
        let points: Vec<_> = self.taps.iter().map(|tap| (tap.speed_m_s, force_n(tap))).collect();
        Line::fit(&points)
    }

    /// The spectral centroid of the transients at impact speeds of 50, 60, ... 100 mm/s (Eq. 4.5.2 over each whole transient),
    /// averaged as in thesis 4.6.3, Hz: higher for harder surfaces. `None` for a transient of a single sample.
    pub fn spectral_centroid_hz(&self) -> Option<f64> {
        let length = self.length();
        if length < 2 {
            return None;
        }
        let fft = fft::forward(length);
        let bins = length / 2 + 1;
        let frequency_hz: Vec<f64> = (0..bins).map(|k| k as f64 * self.rate_hz / length as f64).collect();
        let centroid = |speed_mm_s: u32| {
            let mix = self.mix(f64::from(speed_mm_s) / 1000.0);
            let sample = |index| Complex64::new(self.sample(&mix, index), 0.0);
            let mut spectrum: Vec<Complex64> = (0..length).map(sample).collect();
            fft.process(&mut spectrum);
            let power: Vec<f64> = spectrum[..bins].iter().map(|y| y.norm_sqr()).collect();
            spectral_centroid(&frequency_hz, &power)
        };
        Some(mean(&(50..=100).step_by(10).map(centroid).collect::<Vec<_>>()))
    }

    /// The same taps at another rate, limited to the band of both rates, without ringing before the contact.
    ///
    /// # Errors
    /// [`SurfaceError::TapRate`] for an invalid rate, [`SurfaceError::TapRatio`] for a ratio that cannot be resampled.
    pub fn resampled(&self, rate_hz: f64) -> Result<Self, SurfaceError> {
        if rate_hz == self.rate_hz {
            return Ok(self.clone());
        }
        let rate =
            |rate_hz: f64| Rate::parse(&rate_hz.to_string()).map_err(|_| SurfaceError::TapRate { rate_hz });
        let (from, to) = (rate(self.rate_hz)?, rate(rate_hz)?);
        let samples = (self.length() as f64 * rate_hz / self.rate_hz).ceil();
        if samples * self.taps.len() as f64 > MAX_RESAMPLED as f64 {
            return Err(SurfaceError::TapsTooLong {
                taps: self.taps.len(),
                samples: samples as u64,
                rate_hz,
            });
        }
        let mut resampler = Resampler::new(from, to, Quality::STANDARD).map_err(SurfaceError::TapRatio)?;
        // Silence before the tap, so that its first sample falls on an output sample.
        let (latency, ratio) = (resampler.latency_frames(), rate_hz / self.rate_hz);
        let place = |lead: usize| (latency + lead) as f64 * ratio;
        let lead = (0..MAX_LEAD).find(|&lead| (place(lead) - place(lead).round()).abs() < 1e-9);
        let lead = lead.unwrap_or(0);
        let late = place(lead).round() as usize;
        let length = (self.length() as f64 * ratio).ceil() as usize;
        let mut output = vec![0.0; late + length];
        let mut input = vec![0.0; lead + latency + self.length() + ratio.recip().ceil() as usize];
        let taps = self.taps.iter().map(|tap| {
            input[lead..lead + tap.acceleration_m_s2.len()].copy_from_slice(&tap.acceleration_m_s2);
            resampler.reset();
            resampler.process(&input, &mut output);
            Tap {
                speed_m_s: tap.speed_m_s,
                acceleration_m_s2: output[late..].to_vec(),
                peak_force_n: tap.peak_force_n,
            }
        });
        Self::new(rate_hz, taps.collect())
    }

    /// The mix for a tap at `speed_m_s`: linear in speed between the bounding taps; below the slowest, the slowest
    /// scaled by the ratio of speeds (thesis 4.3.2); above the fastest, the fastest scaled by that ratio to the power of 0.70, as real
    /// taps grow, up to three times its speed (the thesis plays the fastest as it is: mix for its speed). A speed of zero or less (or not a number) is silent.
    pub fn mix(&self, speed_m_s: f64) -> TapMix {
        let last = self.taps.len() - 1;
        let slowest = self.taps[0].speed_m_s;
        if speed_m_s.is_nan() || speed_m_s <= 0.0 {
            return TapMix { lower: 0, upper: 0, lower_gain: 0.0, upper_gain: 0.0 };
        }
        if speed_m_s < slowest {
            return TapMix { lower: 0, upper: 0, lower_gain: speed_m_s / slowest, upper_gain: 0.0 };
        }
        let upper = self.taps.partition_point(|tap| tap.speed_m_s <= speed_m_s);
        if upper > last {
            let ratio = speed_m_s / self.taps[last].speed_m_s;
            return TapMix {
                lower: last,
                upper: last,
                lower_gain: ratio.min(GROWTH_REACH).powf(GROWTH),
                upper_gain: 0.0,
            };
        }
        let (below, above) = (self.taps[upper - 1].speed_m_s, self.taps[upper].speed_m_s);
        let upper_gain = (speed_m_s - below) / (above - below);
        TapMix { lower: upper - 1, upper, lower_gain: 1.0 - upper_gain, upper_gain }
    }

    /// Sample `index` of a mixed tap, m/s²; zero after its end.
    pub fn sample(&self, mix: &TapMix, index: usize) -> f64 {
        let at = |tap: usize| self.taps[tap].acceleration_m_s2.get(index).copied().unwrap_or(0.0);
        mix.lower_gain * at(mix.lower) + mix.upper_gain * at(mix.upper)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spectral_centroid_is_the_mean_over_the_speeds_of_the_thesis() {
        // Whole periods in 100 ms have one line each; they mix from one tap to the other.
        let tone =
            |hz: f64| (0..100).map(move |n| (std::f64::consts::TAU * hz * f64::from(n) / 1000.0).sin());
        let tap = |speed_m_s: f64, hz: f64| Tap {
            speed_m_s,
            acceleration_m_s2: tone(hz).collect(),
            peak_force_n: None,
        };
        let found = |taps: Vec<Tap>| Taps::new(1000.0, taps).unwrap().spectral_centroid_hz();
        assert!((found(vec![tap(0.2, 50.0)]).unwrap() - 50.0).abs() < 1e-9);
        let expected = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0_f64].map(|fast| {
            let (slow, fast) = ((1.0 - fast).powi(2), fast.powi(2));
            (40.0 * slow + 90.0 * fast) / (slow + fast)
        });
        let expected = expected.iter().sum::<f64>() / 6.0;
        let mixed = found(vec![tap(0.05, 40.0), tap(0.1, 90.0)]).unwrap();
        assert!((mixed - expected).abs() < 1e-9, "{mixed}, not {expected}");
        let single = Tap { acceleration_m_s2: vec![1.0], ..tap(0.1, 40.0) };
        assert_eq!(found(vec![single]), None);
    }

    /// A ringing at 90 Hz, the transient of a soft tap.
    fn ringing(rate_hz: f64) -> Taps {
        let at = |k: usize| {
            let t = k as f64 / rate_hz;
            // It starts as smoothly as a band-limited blow does.
            (1.0 - (-t / 0.004).exp()).powi(3) * (-t / 0.02).exp() * (565.5 * t).sin()
        };
        let samples = (rate_hz * 0.1) as usize;
        let tap = |speed_m_s| Tap {
            speed_m_s,
            acceleration_m_s2: (0..samples).map(at).collect(),
            peak_force_n: None,
        };
        Taps::new(rate_hz, vec![tap(0.1), tap(0.2)]).unwrap()
    }

    #[test]
    fn a_tap_at_another_rate_is_the_same_transient() {
        let (slow, fast) = (ringing(1000.0), ringing(10_000.0));
        for (found, wanted) in [(fast.resampled(1000.0), &slow), (slow.resampled(10_000.0), &fast)] {
            let found = found.unwrap();
            assert_eq!((found.rate_hz(), found.length()), (wanted.rate_hz(), wanted.length()));
            // The last milliseconds ring on into the silence after the cut.
            let kept = wanted.length() * 9 / 10;
            for (found, wanted) in found.taps().iter().zip(wanted.taps()) {
                assert_eq!(found.speed_m_s, wanted.speed_m_s);
                let samples = found.acceleration_m_s2.iter().zip(&wanted.acceleration_m_s2).take(kept);
                samples.for_each(|(a, b)| assert!((a - b).abs() < 2e-3, "{a} for {b}"));
            }
        }
        assert_eq!(slow.resampled(1000.0).unwrap(), slow);
        assert!(matches!(slow.resampled(-1.0), Err(SurfaceError::TapRate { .. })));
    }

    fn two_taps() -> Taps {
        let tap = |speed_m_s: f64, peak: f64| Tap {
            speed_m_s,
            acceleration_m_s2: vec![peak, -peak / 2.0],
            peak_force_n: None,
        };
        Taps::new(1000.0, vec![tap(0.1, 10.0), tap(0.3, 50.0)]).unwrap()
    }

    #[test]
    fn a_tap_between_two_is_linear_in_speed() {
        let taps = two_taps();
        let mix = taps.mix(0.25);
        assert!((taps.sample(&mix, 0) - 40.0).abs() < 1e-12);
        assert!((taps.sample(&mix, 1) + 20.0).abs() < 1e-12);
        assert_eq!(taps.sample(&mix, 2), 0.0);
    }

    #[test]
    fn slow_taps_scale_down_and_fast_taps_grow_within_bounds() {
        let taps = two_taps();
        assert!((taps.sample(&taps.mix(0.05), 0) - 5.0).abs() < 1e-12);
        assert_eq!(taps.sample(&taps.mix(0.1), 0), 10.0);
        assert_eq!(taps.sample(&taps.mix(0.3), 0), 50.0);
        let just_above = taps.sample(&taps.mix(0.3 + 1e-12), 0);
        assert!((just_above - 50.0).abs() < 1e-9, "no step: {just_above}");
        let twice = taps.sample(&taps.mix(0.6), 0) / 50.0;
        assert!((twice - 2_f64.powf(0.7)).abs() < 1e-12);
        let most = taps.sample(&taps.mix(0.9), 0);
        assert!((most / 50.0 - 3_f64.powf(0.7)).abs() < 1e-12);
        assert_eq!(taps.sample(&taps.mix(9.0), 0), most);
        assert_eq!(taps.sample(&taps.mix(f64::INFINITY), 0), most);
        assert_eq!(taps.sample(&taps.mix(0.0), 0), 0.0);
        assert_eq!(taps.sample(&taps.mix(-1.0), 0), 0.0);
        assert_eq!(taps.sample(&taps.mix(f64::NAN), 0), 0.0);
    }

    #[test]
    fn harder_surfaces_respond_more() {
        let taps = |per_s: f64, n_s_per_m: Option<f64>| {
            let tap = |speed_m_s: f64| Tap {
                speed_m_s,
                acceleration_m_s2: vec![0.0, -per_s * speed_m_s, 1.0],
                peak_force_n: n_s_per_m.map(|slope| slope * speed_m_s),
            };
            Taps::new(1000.0, [0.1, 0.2, 0.4].map(tap).to_vec()).unwrap()
        };
        let response = |taps: &Taps| taps.response().unwrap().slope;
        let rendered = taps(400.0, None);
        assert!((response(&rendered) - 20.0).abs() < 1e-9, "0.05 kg times 400 1/s");
        assert!(response(&rendered) > response(&taps(100.0, None)));
        assert!((response(&taps(400.0, Some(33.0))) - 33.0).abs() < 1e-9, "as recorded");
        let mut mixed = taps(400.0, Some(33.0)).taps().to_vec();
        mixed[1].peak_force_n = None;
        let mixed = Taps::new(1000.0, mixed).unwrap();
        assert_eq!(mixed.response(), rendered.response(), "all by the same measure");
        let single = Taps::new(1000.0, two_taps().taps()[..1].to_vec()).unwrap();
        assert_eq!(single.response(), None, "one tap has no slope");
    }

    #[test]
    fn unsound_taps_are_refused() {
        let tap = |speed_m_s: f64, samples: usize| Tap {
            speed_m_s,
            acceleration_m_s2: vec![0.5; samples],
            peak_force_n: None,
        };
        assert_eq!(Taps::new(1000.0, vec![]), Err(SurfaceError::NoTaps));
        assert!(Taps::new(0.0, vec![tap(0.1, 2)]).is_err());
        assert!(Taps::new(1000.0, vec![tap(0.1, 2), tap(0.1, 2)]).is_err());
        assert!(Taps::new(1000.0, vec![tap(0.1, 2), tap(0.2, 3)]).is_err());
        assert!(Taps::new(1000.0, vec![tap(0.1, 0)]).is_err());
        assert!(Taps::new(1000.0, vec![tap(f64::NAN, 2)]).is_err());
        let mut pulled = tap(0.1, 2);
        pulled.peak_force_n = Some(-1.0);
        assert!(matches!(Taps::new(1000.0, vec![pulled]), Err(SurfaceError::TapForce { tap: 0, .. })));
    }
}
