//! Onset: the burst of a tool that breaks away after it stuck, at the start of a stroke and at a reversal.
//!
//! Where the tool held still on the surface and then moves, white noise of an amplitude that decays is added through three
//! band-passes. The power of each grows with the force and with the time that the tool stuck. At contact the surface's taps answer.

use super::{Layer, LayerError, LayerKind, LayerVoice, RenderRates, Stage, parse};
use crate::Spot;
use crate::files::native::{Bounded, Thousandths, write_numbers};
use haptograph_signal::filter::{SectionsState, butterworth_bandpass};
use haptograph_signal::noise::Gaussian;
use haptograph_signal::units::decimal::{format_shifted, significant};
use serde::Deserialize;
use serde_json::{Value, json};
use std::fmt::Write;

/// Edges of the bands, Hz.
pub const BANDS_HZ: [[f64; 2]; 3] = [[20.0, 60.0], [60.0, 150.0], [150.0, 350.0]];
/// Time that a tool must stick before it can break away, s: at most 20 onsets a second.
pub const ARMED_AFTER_S: f64 = 0.05;
/// Longest time that counts, s.
pub const LONGEST_S: f64 = 2.0;
/// Largest force that counts, as a multiple of the one for which the powers are.
const REACH: f64 = 3.0;
/// Bounds of decay, s, exponents and powers, (m/s²)².
const DECAY_S: [f64; 2] = [0.002, 0.2];
const MOST_EXPONENTS: [f64; 2] = [2.0, 1.0];
const MOST_POWER_M2_S4: f64 = 1e6;
/// Order of the band-passes' prototype.
const ORDER: usize = 3;
/// An envelope that counts as silent: -100 dB.
const SILENT: f64 = 1e-5;
/// The band-passes ring on for this long, s: the lowest falls to 1/e in 0.03 s.
const RINGS_S: f64 = 0.35;
/// Decay of the envelope in the air, s.
const LIFTED_S: f64 = 0.005;

/// Detects that a tool breaks away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BreakAway {
    rest_m_s: f64,
    slide_m_s: f64,
    stuck_s: f64,
}

impl BreakAway {
    /// Of a tool that sticks below one speed in contact, and breaks away beyond the other. Speeds between them change nothing.
    pub fn new(rest_m_s: f64, slide_m_s: f64) -> Self {
        Self { rest_m_s, slide_m_s, stuck_s: 0.0 }
    }

    /// Advances by a time: the time that the tool stuck, s, if it breaks away now. Without force, or with a speed or force that is not
    /// a number, it is in the air, and must stick anew.
    pub fn update(&mut self, speed_m_s: f64, force_n: f64, step_s: f64) -> Option<f64> {
        if !(force_n > 0.0 && speed_m_s.is_finite()) {
            self.stuck_s = 0.0;
        } else if speed_m_s < self.rest_m_s {
            self.stuck_s += step_s;
        } else if speed_m_s > self.slide_m_s {
            return Some(std::mem::take(&mut self.stuck_s)).filter(|stuck_s| *stuck_s >= ARMED_AFTER_S);
        }
        None
    }
}

/// The onset of a texture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Onset {
    /// Where it comes from.
    pub origin: OnsetOrigin,
    /// Power of the noise in each of [`BANDS_HZ`] at the release, (m/s²)², at `force_n` after `stuck_s`.
    pub powers_m2_s4: [f64; 3],
    /// Time in which the amplitude falls to 1/e, s.
    pub decay_s: f64,
    /// The force for which the powers are, N.
    pub force_n: f64,
    /// Exponent of the force in the powers.
    pub force_exponent: f64,
    /// The time at rest for which the powers are, s.
    pub stuck_s: f64,
    /// Exponent of the time at rest in the powers.
    pub stuck_exponent: f64,
    /// A tool in contact that is slower than this sticks, m/s.
    pub rest_m_s: f64,
    /// A tool that stuck and becomes faster than this breaks away, m/s.
    pub slide_m_s: f64,
}

/// Where an onset comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnsetOrigin {
    /// Learned from so many strokes.
    Learned(u32),
    /// An example that was chosen by name.
    Example(OnsetExample),
}

/// Examples of onsets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OnsetExample {
    /// Learned from the simulated material T6, coarse and sticky.
    Coarse,
}

impl OnsetExample {
    /// What it was learned from.
    const SOURCE: &str = "simulated material T6, two takes of 40 s from rest";

    fn onset(self) -> Onset {
        Onset {
            origin: OnsetOrigin::Example(self),
            powers_m2_s4: [138.0, 6.0, 25.0],
            decay_s: 0.01,
            force_n: 1.33,
            force_exponent: 1.4,
            stuck_s: 0.34,
            stuck_exponent: 0.6,
            rest_m_s: 0.01,
            slide_m_s: 0.025,
        }
    }
}

/// Onset out of range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the onset's {what} is {value}, out of range: three powers from 0 to {MOST_POWER_M2_S4} (m/s²)², a decay of 2 to 200 ms, speeds of rest and slide above 0 and ascending, force above 0, a \
     time of {ARMED_AFTER_S} to {LONGEST_S} s, exponents from 0 to {} of force and to {} of time", MOST_EXPONENTS[0], MOST_EXPONENTS[1]
)]
pub(crate) struct OnsetError {
    what: &'static str,
    value: f64,
}

impl Onset {
    /// Checks the numbers.
    ///
    /// # Errors
    /// A number out of range.
    pub fn checked(self) -> Result<Self, LayerError> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let bad = |power: &&f64| !(0.0..=MOST_POWER_M2_S4).contains(*power);
        let power = self.powers_m2_s4.iter().find(bad);
        let exponents = [self.force_exponent, self.stuck_exponent];
        let problem = match self {
            _ if power.is_some() => ("power", power.copied().unwrap_or(f64::NAN)),
            _ if !(DECAY_S[0]..=DECAY_S[1]).contains(&self.decay_s) => ("decay in s", self.decay_s),
            _ if !positive(self.force_n) => ("force in N", self.force_n),
            _ if !(ARMED_AFTER_S..=LONGEST_S).contains(&self.stuck_s) => ("time at rest in s", self.stuck_s),
            _ if !positive(self.rest_m_s) => ("speed at rest in m/s", self.rest_m_s),
            _ if !(self.rest_m_s..=1.0).contains(&self.slide_m_s) => {
                ("speed of a slide in m/s", self.slide_m_s)
            }
            _ if !(0.0..=MOST_EXPONENTS[0]).contains(&exponents[0]) => ("exponent of force", exponents[0]),
            _ if !(0.0..=MOST_EXPONENTS[1]).contains(&exponents[1]) => ("exponent of time", exponents[1]),
            _ => return Ok(self),
        };
        Err(LayerError::new(OnsetError { what: problem.0, value: problem.1 }))
    }

    /// Factor of the powers at a force after a time at rest; bounded.
    pub fn growth(&self, force_n: f64, stuck_s: f64) -> f64 {
        let force = (force_n / self.force_n).clamp(0.0, REACH);
        let stuck = stuck_s.clamp(ARMED_AFTER_S, LONGEST_S) / self.stuck_s;
        // Without force there is nothing, whatever the exponent.
        force.powf(self.force_exponent).min(10.0 * force) * stuck.powf(self.stuck_exponent)
    }

    fn of_document(document: OnsetDocument) -> Result<Option<Self>, LayerError> {
        let onset = match document {
            OnsetDocument::Example(example) => example.onset(),
            OnsetDocument::Learned {
                strokes,
                band_powers_m2_s4,
                decay_ms,
                force_n,
                force_exponent,
                stuck_s,
                stuck_exponent,
                rest_mm_s,
                slide_mm_s,
            } => {
                // Too few numbers are refused as a power that is not one.
                let power = |band| band_powers_m2_s4.0.get(band).copied().unwrap_or(f64::NAN);
                Self {
                    origin: OnsetOrigin::Learned(strokes),
                    powers_m2_s4: [0, 1, 2].map(power),
                    decay_s: decay_ms.si,
                    force_n,
                    force_exponent,
                    stuck_s,
                    stuck_exponent,
                    rest_m_s: rest_mm_s.si,
                    slide_m_s: slide_mm_s.si,
                }
            }
        };
        onset.checked().map(Some)
    }
}

/// An onset in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum OnsetDocument {
    Learned {
        strokes: u32,
        band_powers_m2_s4: Bounded<f64, 3>,
        decay_ms: Thousandths,
        force_n: f64,
        force_exponent: f64,
        stuck_s: f64,
        stuck_exponent: f64,
        rest_mm_s: Thousandths,
        slide_mm_s: Thousandths,
    },
    Example(OnsetExample),
}

/// The layer's type.
pub(super) const KIND: LayerKind = LayerKind {
    name: "onset",
    title: "onset",
    stage: Stage::Output,
    components: &["onset_force_n"],
    parse: |text| parse(text, Onset::of_document),
    absent: || Value::Null,
};

impl Layer for Onset {
    fn kind(&self) -> &'static LayerKind {
        &KIND
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let OnsetOrigin::Learned(strokes) = self.origin else {
            return writeln!(out, "        onset: Example(coarse),");
        };
        writeln!(out, "        onset: Learned(")?;
        writeln!(out, "            strokes: {strokes},")?;
        write_numbers(out, "            band_powers_m2_s4: ", &self.powers_m2_s4)?;
        writeln!(out, "            decay_ms: {},", format_shifted(self.decay_s, 3))?;
        for (name, value) in [
            ("force_n", self.force_n),
            ("force_exponent", self.force_exponent),
            ("stuck_s", self.stuck_s),
            ("stuck_exponent", self.stuck_exponent),
        ] {
            writeln!(out, "            {name}: {value:?},")?;
        }
        writeln!(out, "            rest_mm_s: {},", format_shifted(self.rest_m_s, 3))?;
        writeln!(out, "            slide_mm_s: {},", format_shifted(self.slide_m_s, 3))?;
        writeln!(out, "        ),")
    }

    fn interpolate(&self, spot: &Spot, into: &mut [f64]) {
        into.iter_mut().for_each(|force_n| *force_n = spot.force_n);
    }

    fn voice(&self, rates: RenderRates, seed: u64) -> Box<dyn LayerVoice> {
        Box::new(OnsetVoice::new(*self, rates.rate_hz, seed))
    }

    fn json(&self) -> Value {
        let (strokes, example) = match self.origin {
            OnsetOrigin::Learned(strokes) => (Some(strokes), None),
            OnsetOrigin::Example(_) => (None, Some(OnsetExample::SOURCE)),
        };
        json!({
            "band_powers_m2_s4": self.powers_m2_s4, "decay_ms": 1000.0 * self.decay_s, "example": example,
            "force_exponent": self.force_exponent, "force_n": self.force_n, "strokes": strokes,
            "rest_mm_s": 1000.0 * self.rest_m_s, "slide_mm_s": 1000.0 * self.slide_m_s,
            "stuck_exponent": self.stuck_exponent, "stuck_s": self.stuck_s,
        })
    }

    fn summary(&self, _: f64) -> String {
        let from = match self.origin {
            OnsetOrigin::Learned(strokes) => format!("of {strokes} strokes"),
            OnsetOrigin::Example(_) => format!("of an example ({})", OnsetExample::SOURCE),
        };
        format!("an onset {from}, {} ms", significant(1000.0 * self.decay_s, 2))
    }
}

/// Renders an onset in real time. It does not allocate, and draws noise only while it sounds.
#[derive(Debug, Clone)]
struct OnsetVoice {
    onset: Onset,
    step_s: f64,
    /// Factors of the envelope from one sample to the next, in contact and in the air.
    falls: [f64; 2],
    break_away: BreakAway,
    speed_m_s: f64,
    force_n: f64,
    envelope: f64,
    /// Samples for which the filters ring once the envelope is silent, and those left.
    rings: u32,
    left: u32,
    noise: Gaussian,
    bands: Vec<Band>,
}

/// The noise of one band.
#[derive(Debug, Clone)]
struct Band {
    number: usize,
    filter: SectionsState,
    /// Amplitude of its white noise for a power of 1 within the band.
    unit: f64,
    amplitude: f64,
}

impl OnsetVoice {
    fn new(onset: Onset, rate_hz: f64, seed: u64) -> Self {
        let band = |(number, [low_hz, high_hz]): (usize, [f64; 2])| {
            // A band beyond what the rate holds is left out.
            let filter = butterworth_bandpass(ORDER, low_hz, high_hz, rate_hz).ok()?;
            let unit = (0.5 * rate_hz / (high_hz - low_hz)).sqrt();
            Some(Band { number, filter: SectionsState::new(&filter), unit, amplitude: 0.0 })
        };
        Self {
            onset,
            step_s: 1.0 / rate_hz,
            falls: [onset.decay_s, onset.decay_s.min(LIFTED_S)]
                .map(|decay_s| (-1.0 / (decay_s * rate_hz)).exp()),
            rings: (RINGS_S * rate_hz).ceil() as u32,
            left: 0,
            break_away: BreakAway::new(onset.rest_m_s, onset.slide_m_s),
            speed_m_s: 0.0,
            force_n: 0.0,
            envelope: 0.0,
            noise: Gaussian::new(seed),
            bands: BANDS_HZ.into_iter().enumerate().filter_map(band).collect(),
        }
    }
}

impl LayerVoice for OnsetVoice {
    fn set(&mut self, speed_m_s: f64, components: &[f64]) {
        (self.speed_m_s, self.force_n) = (speed_m_s, components.first().copied().unwrap_or(0.0));
    }

    fn process(&mut self, out: &mut [f64]) {
        for y in out {
            if let Some(stuck_s) = self.break_away.update(self.speed_m_s, self.force_n, self.step_s) {
                // A new onset takes the place of one that still sounds.
                let growth = self.onset.growth(self.force_n, stuck_s);
                (self.envelope, self.left) = (1.0, self.rings);
                for band in &mut self.bands {
                    band.amplitude = band.unit * (growth * self.onset.powers_m2_s4[band.number]).sqrt();
                }
            }
            if self.left == 0 {
                continue;
            }
            let noise = if self.envelope > 0.0 { self.envelope * self.noise.next_sample() } else { 0.0 };
            for band in &mut self.bands {
                *y += band.filter.sample(band.amplitude * noise);
            }
            self.envelope *= self.falls[usize::from(self.force_n <= 0.0)];
            if self.envelope >= SILENT {
                continue;
            }
            (self.envelope, self.left) = (0.0, self.left - 1);
            if self.left == 0 {
                self.bands.iter_mut().for_each(|band| band.filter.reset());
            }
        }
    }

    fn copy_state_from(&mut self, other: &dyn LayerVoice) {
        let Some(other) = other.downcast_ref::<Self>() else { return };
        self.noise.clone_from(&other.noise);
        (self.break_away.stuck_s, self.envelope) = (other.break_away.stuck_s, other.envelope);
        self.left = other.left.min(self.rings);
        (self.speed_m_s, self.force_n) = (other.speed_m_s, other.force_n);
        for (new, old) in self.bands.iter_mut().zip(&other.bands) {
            new.filter.copy_state_from(&old.filter);
            new.amplitude = old.amplitude;
        }
    }

    fn boxed_clone(&self) -> Box<dyn LayerVoice> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 1000.0;
    const ONSET: Onset = Onset {
        origin: OnsetOrigin::Learned(40),
        powers_m2_s4: [60.0, 15.0, 20.0],
        decay_s: 0.04,
        force_n: 1.0,
        force_exponent: 1.5,
        stuck_s: 0.3,
        stuck_exponent: 0.2,
        rest_m_s: 0.01,
        slide_m_s: 0.025,
    };

    fn voice() -> OnsetVoice {
        OnsetVoice::new(ONSET, RATE_HZ, 1)
    }

    /// Samples along speeds and forces, of which each holds for 4 ms, in blocks of some length.
    fn played(voice: &mut OnsetVoice, path: &[(f64, f64)], block: usize) -> Vec<f64> {
        let hold = |(speed_m_s, force_n): &(f64, f64)| {
            let mut out = [0.0; 4];
            for part in out.chunks_mut(block) {
                voice.set(*speed_m_s, &[*force_n]);
                voice.process(part);
            }
            out
        };
        path.iter().flat_map(hold).collect()
    }

    fn energy(samples: &[f64]) -> f64 {
        samples.iter().map(|y| y * y).sum::<f64>() / RATE_HZ
    }

    /// A rest, and a slide of 1 s.
    fn stroke(rest_s: f64, force_n: f64) -> Vec<(f64, f64)> {
        let rest = (rest_s / 0.004) as usize;
        (0..rest + 250).map(|k| (if k < rest { 0.0 } else { 0.1 }, force_n)).collect()
    }

    #[test]
    fn a_stroke_from_rest_begins_with_a_burst_that_dies_away_and_goes_on_after_a_swap() {
        let path = stroke(0.3, 1.0);
        let whole = played(&mut voice(), &path, 4);
        assert!(whole[..300].iter().all(|y| *y == 0.0) && whole[1150..].iter().all(|y| *y == 0.0));
        assert!(energy(&whole[300..400]) > 100.0 * energy(&whole[500..600]));
        for block in [1, 3] {
            assert_eq!(played(&mut voice(), &path, block), whole);
        }
        let (mut old, mut new) = (voice(), voice());
        let mut parts = played(&mut old, &path[..80], 4);
        new.copy_state_from(&old);
        parts.extend(played(&mut new, &path[80..], 4));
        assert_eq!(parts, whole);
    }

    #[test]
    fn powers_are_those_of_the_bands_and_grow_with_force_and_time() {
        let mean = |rest_s: f64, force_n: f64| {
            let of = |seed| {
                let mut voice = OnsetVoice::new(ONSET, RATE_HZ, seed);
                energy(&played(&mut voice, &stroke(rest_s, force_n), 4))
            };
            (0..100).map(of).sum::<f64>() / 100.0
        };
        // The envelope's square holds for half its decay.
        let wanted = 95.0 * 0.5 * 0.04;
        assert!((mean(0.3, 1.0) / wanted - 1.0).abs() < 0.15, "{}", mean(0.3, 1.0));
        assert!((mean(0.3, 2.0) / mean(0.3, 1.0) / 2_f64.powf(1.5) - 1.0).abs() < 0.01);
        assert!((mean(1.2, 1.0) / mean(0.3, 1.0) / 4_f64.powf(0.2) - 1.0).abs() < 0.01);
    }

    #[test]
    fn jitter_around_zero_and_moves_without_rest_or_force_are_silent() {
        let mut noise = Gaussian::new(3);
        // Below the speed of a slide, between the thresholds and back, for 40 s.
        let jitter: Vec<_> =
            (0..10_000).map(|_| ((0.006 * noise.next_sample()).abs().min(0.0249), 1.0)).collect();
        // Above it, but never at rest for long; a rest in the air; numbers that are none.
        let restless: Vec<_> = (0..2000).map(|k| (if k % 12 < 11 { 0.0 } else { 0.1 }, 1.0)).collect();
        let in_air: Vec<_> =
            (0..400).map(|k| (if k < 200 { 0.0 } else { 0.1 }, f64::from(u8::from(k > 199)))).collect();
        let faults = [(0.0, f64::NAN), (f64::NAN, 1.0), (f64::INFINITY, 1.0), (0.1, -1.0)].repeat(50);
        for path in [jitter, restless, in_air, faults] {
            assert!(played(&mut voice(), &path, 4).iter().all(|y| *y == 0.0));
        }
    }

    #[test]
    fn onsets_a_second_and_their_energy_are_bounded_whatever_the_hand_does() {
        let most = ONSET.growth(REACH * ONSET.force_n, LONGEST_S);
        assert_eq!(ONSET.growth(1e9, 1e9), most);
        assert_eq!(ONSET.growth(0.0, 1.0), 0.0);
        // The worst: still for as long as it must be, at once fast, with a force beyond all bounds.
        let path: Vec<_> = (0..2500).map(|k| (if k % 14 < 13 { 0.0 } else { 1.0 }, 1e6)).collect();
        let mut detector = BreakAway::new(ONSET.rest_m_s, ONSET.slide_m_s);
        let fired = path
            .iter()
            .flat_map(|step| [step; 4])
            .filter(|(speed, force)| detector.update(*speed, *force, 1e-3).is_some());
        assert!((150..=200).contains(&fired.count()), "10 s");
        let whole = energy(&played(&mut voice(), &path, 4));
        let bound = 200.0 * most * ONSET.powers_m2_s4.iter().sum::<f64>() * 0.5 * ONSET.decay_s;
        assert!(whole < bound, "{whole} of {bound}");
    }

    #[test]
    fn the_shortest_burst_rings_out_and_one_in_the_air_ends() {
        let largest = |samples: &[f64]| samples.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        let mut short = OnsetVoice::new(Onset { decay_s: DECAY_S[0], ..ONSET }, RATE_HZ, 1);
        let burst = played(&mut short, &stroke(0.3, 1.0), 4);
        let last = burst.iter().rposition(|y| *y != 0.0).expect("it sounds");
        assert!(last + 1 < burst.len() && burst[last].abs() < 1e-3 * largest(&burst), "{}", burst[last]);
        let mut lifted = stroke(0.3, 1.0);
        lifted[78..].iter_mut().for_each(|(_, force_n)| *force_n = 0.0);
        let [whole, lifted] = [stroke(0.3, 1.0), lifted].map(|path| played(&mut voice(), &path, 4));
        let after = |burst: &[f64]| energy(&burst[4 * 78 + 50..]);
        assert!(after(&lifted) < 0.2 * after(&whole), "{} of {}", after(&lifted), after(&whole));
    }

    #[test]
    fn numbers_out_of_range_are_refused() {
        assert!(ONSET.checked().is_ok() && OnsetExample::Coarse.onset().checked().is_ok());
        for bad in [
            Onset { powers_m2_s4: [0.0, f64::NAN, 0.0], ..ONSET },
            Onset { decay_s: 1.0, ..ONSET },
            Onset { force_n: 0.0, ..ONSET },
            Onset { stuck_s: f64::INFINITY, ..ONSET },
            Onset { force_exponent: 2.1, ..ONSET },
            Onset { stuck_exponent: -0.1, ..ONSET },
            Onset { rest_m_s: 0.0, ..ONSET },
            Onset { slide_m_s: 0.009, ..ONSET },
        ] {
            let error = bad.checked().unwrap_err();
            assert!(error.downcast_ref::<OnsetError>().is_some());
        }
    }
}
