//! Clips: the whitened recording itself as a texture's excitation.
//!
//! The excitation is a recording divided by the spectrum and the level of its map, and so white; what it has beside them is its
//! course in time. Pieces of a second, drawn at random, follow each other, cross-faded at equal power. A place is drawn from the
//! voice's seed and the piece's number alone, so that the excitation depends on the time only.
//!
//! A sample is a byte: companding by the µ-law (ITU-T G.711, µ = 255, of the continuous curve) keeps the noise of rounding 38 dB
//! below the signal at any level.

use super::{Layer, LayerError, LayerKind, LayerVoice, RenderRates, Stage, parse};
use crate::provenance::{CLIPS_ORIGIN, LICENCE};
use crate::{Origin, Provenance, Surface, TextureModel};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use haptograph_signal::noise::stream_seed;
use haptograph_signal::units::decimal::significant;
use haptograph_signal::{Complex64, fft};
use serde::Deserialize;
use serde_json::{Value, json};
use std::f64::consts::FRAC_PI_2;
use std::fmt::Write;
use std::sync::Arc;

/// Largest number of samples: 400 kB in a file.
pub const MAX_SAMPLES: usize = 300_000;
/// Length of a piece and of a fade, s.
const PIECE_S: f64 = 1.0;
const FADE_S: f64 = 0.02;
/// A piece does not begin this near to where the one before ends, s.
const APART_S: f64 = 0.2;
/// Draws of a place.
const DRAWS: u64 = 8;
/// The strength of the companding.
const MU: f64 = 255.0;
/// Half of the largest code.
const MIDDLE: f64 = 127.5;
/// Characters of a line in a file.
const LINE: usize = 120;

/// A whitened recording as the excitation of a texture.
#[derive(Debug, Clone)]
pub struct Clips {
    codes: Arc<[u8]>,
    /// The sample of each code, of the deviation 1 over all samples.
    values: Arc<[f64; 256]>,
}

impl Clips {
    /// Clips of these samples, at the rate of the texture's models; their deviation is made 1.
    ///
    /// # Errors
    /// [`ClipsError`] if they are none, more than [`MAX_SAMPLES`], silent or not finite.
    pub fn new(samples: &[f64]) -> Result<Self, LayerError> {
        let peak = samples.iter().fold(0.0_f64, |peak, e| peak.max(e.abs()));
        if !(samples.iter().all(|e| e.is_finite()) && (peak > 0.0 || samples.is_empty())) {
            return Err(LayerError::new(ClipsError::Silent));
        }
        let code = |e: &f64| {
            let compressed = (MU * e.abs() / peak).ln_1p() / MU.ln_1p();
            (MIDDLE + MIDDLE * compressed.copysign(*e)).round() as u8
        };
        Self::of_codes(samples.iter().map(code).collect())
    }

    fn of_codes(codes: Arc<[u8]>) -> Result<Self, LayerError> {
        let samples = codes.len();
        if !(1..=MAX_SAMPLES).contains(&samples) {
            return Err(LayerError::new(ClipsError::Length { samples }));
        }
        let expanded = |code: usize| {
            let compressed = (code as f64 - MIDDLE) / MIDDLE;
            (((1.0 + MU).powf(compressed.abs()) - 1.0) / MU).copysign(compressed)
        };
        let mut values: [f64; 256] = std::array::from_fn(expanded);
        let square = codes.iter().map(|code| values[usize::from(*code)].powi(2)).sum::<f64>();
        let deviation = (square / samples as f64).sqrt();
        values.iter_mut().for_each(|value| *value /= deviation);
        Ok(Self { codes, values: Arc::new(values) })
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.codes.len()
    }

    fn at(&self, place: usize) -> f64 {
        self.values[usize::from(self.codes[place % self.codes.len()])]
    }
}

/// Clips that cannot be an excitation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum ClipsError {
    #[error("clips of {samples} samples: they have 1 to {MAX_SAMPLES}")]
    Length { samples: usize },
    #[error("clips that are silent or not finite: they are a recording divided by its map")]
    Silent,
    #[error(
        "clips whose text is damaged ({0}): take the surface's file from where it was learned, or learn it again"
    )]
    Text(#[from] base64::DecodeError),
}

/// Clips in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ClipsDocument {
    mu_law_base64: String,
}

/// The layer's type.
pub const KIND: LayerKind = LayerKind {
    name: "clips",
    title: "clips",
    stage: Stage::Excitation,
    components: &[],
    parse: |text| {
        parse(text, |document: ClipsDocument| {
            let mut text = document.mu_law_base64;
            text.retain(|letter| !letter.is_ascii_whitespace());
            let codes = STANDARD.decode(text).map_err(|error| LayerError::new(ClipsError::from(error)))?;
            Clips::of_codes(codes.into()).map(Some)
        })
    },
    absent: || Value::Null,
};

impl Layer for Clips {
    fn kind(&self) -> &'static LayerKind {
        &KIND
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        writeln!(out, "        clips: (mu_law_base64: \"")?;
        for line in STANDARD.encode(&self.codes).as_bytes().chunks(LINE) {
            writeln!(out, "{}", String::from_utf8_lossy(line))?;
        }
        writeln!(out, "        \"),")
    }

    /// Without the frequencies above the new rate's.
    fn resampled(&self, from_hz: f64, to_hz: f64) -> Option<Arc<dyn Layer>> {
        let length = self.samples();
        let new = (length as f64 * to_hz / from_hz).round().max(1.0) as usize;
        let mut spectrum: Vec<Complex64> = (0..length).map(|place| self.at(place).into()).collect();
        fft::forward(length).process(&mut spectrum);
        let mut kept = vec![Complex64::ZERO; new];
        for bin in 0..new.min(length).div_ceil(2) {
            kept[bin] = spectrum[bin];
            kept[(new - bin) % new] = spectrum[(length - bin) % length];
        }
        fft::inverse(new).process(&mut kept);
        let samples: Vec<f64> = kept.iter().map(|e| e.re).collect();
        Clips::new(&samples).ok().map(|clips| -> Arc<dyn Layer> { Arc::new(clips) })
    }

    fn voice(&self, rates: RenderRates, seed: u64) -> Box<dyn LayerVoice> {
        Box::new(ClipsVoice::new(self.clone(), rates, seed))
    }

    fn json(&self) -> Value {
        json!({ "samples": self.samples() })
    }

    fn summary(&self, rate_hz: f64) -> String {
        format!("clips of {} s", significant(self.samples() as f64 / rate_hz, 3))
    }
}

impl TextureModel {
    /// The recording that is the excitation; `None` for noise.
    pub fn clips(&self) -> Option<&Clips> {
        self.layer()
    }

    /// The same texture with these clips as its excitation.
    pub fn with_clips(self, clips: Option<Clips>) -> Self {
        match clips {
            Some(clips) => self.with_checked(Arc::new(clips)),
            None => self.without_layer(KIND.name),
        }
    }
}

impl Surface {
    /// True if it contains clips of a recording whose licence is not stated. Those of a simulated one need none.
    pub fn has_unlicensed_clips(&self) -> bool {
        let Provenance { origin, settings, .. } = &self.provenance;
        let made =
            |origin: &str| [Origin::Simulated, Origin::Procedural].map(Origin::as_str).contains(&origin);
        self.texture.as_ref().is_some_and(|texture| texture.clips().is_some())
            && !made(settings.get(CLIPS_ORIGIN).map_or(origin.as_str(), |origin| origin))
            && settings.get(LICENCE).is_none_or(|licence| licence.trim().is_empty())
    }
}

/// Plays clips in place of noise, in real time. It does not allocate; its output does not depend on block sizes.
#[derive(Debug, Clone)]
struct ClipsVoice {
    clips: Clips,
    seed: u64,
    /// Samples of the models for one of the clock, at most 1.
    ratio: f64,
    /// Samples of the clock that were played.
    played: u64,
    /// The sample of the models that is heard, counted from 0, and its value; none before the first.
    tick: Option<u64>,
    value: f64,
    /// Samples of a piece and those apart.
    length: u64,
    apart: u64,
    /// The quarter of a sine.
    rise: Box<[f64]>,
    /// Begins of the last piece and this one.
    starts: [usize; 2],
}

impl ClipsVoice {
    fn new(clips: Clips, RenderRates { rate_hz, models_hz }: RenderRates, seed: u64) -> Self {
        let samples = |seconds: f64| (seconds * models_hz).ceil();
        let fade = samples(FADE_S);
        Self {
            clips,
            seed,
            ratio: (models_hz / rate_hz).min(1.0),
            played: 0,
            tick: None,
            value: 0.0,
            length: samples(PIECE_S) as u64,
            apart: samples(APART_S) as u64,
            rise: (0..fade as usize).map(|n| (FRAC_PI_2 * (n as f64 + 0.5) / fade).sin()).collect(),
            starts: [0; 2],
        }
    }

    fn draw(&self, piece: u64, attempt: u64) -> u64 {
        let random = stream_seed(self.seed.wrapping_add(DRAWS * piece + attempt), "place");
        ((u128::from(random) * self.clips.samples() as u128) >> 64) as u64
    }

    /// The begin of a piece. Every second one keeps apart from where those beside it would go on.
    fn start(&self, piece: u64) -> usize {
        let all = self.clips.samples() as u64;
        let freely = self.draw(piece, 0);
        if piece.is_multiple_of(2) {
            return freely as usize;
        }
        let end = (self.draw(piece - 1, 0) + self.length) % all;
        let next = self.draw(piece + 1, 0);
        let away = |a: u64, b: u64| a.abs_diff(b).min(all - a.abs_diff(b));
        let is_apart = |start: &u64| {
            away(*start, end) > self.apart && away((start + self.length) % all, next) > self.apart
        };
        (0..DRAWS).map(|attempt| self.draw(piece, attempt)).find(is_apart).unwrap_or(freely) as usize
    }

    /// Moves to a sample of the models.
    fn move_to(&mut self, tick: u64) {
        let (piece, place) = (tick / self.length, (tick % self.length) as usize);
        if self.tick.is_none_or(|last| last / self.length != piece) {
            let last = piece.checked_sub(1).map_or(0, |last| self.start(last));
            self.starts = [last, self.start(piece)];
        }
        let [last, this] = self.starts;
        self.value = self.clips.at(this + place);
        if let Some(rise) = self.rise.get(place).filter(|_| piece > 0) {
            let fall = self.rise[self.rise.len() - 1 - place];
            self.value = rise * self.value + fall * self.clips.at(last + self.length as usize + place);
        }
        self.tick = Some(tick);
    }
}

impl LayerVoice for ClipsVoice {
    fn process(&mut self, samples: &mut [f64]) {
        for sample in samples {
            // The sum of many steps would drift.
            let tick = (self.played as f64 * self.ratio + 1e-6) as u64;
            if self.tick != Some(tick) {
                self.move_to(tick);
            }
            self.played += 1;
            *sample = self.value;
        }
    }

    fn copy_state_from(&mut self, other: &dyn LayerVoice) {
        if let Some(other) = other.downcast_ref::<Self>() {
            // The places of its own clips are drawn anew.
            (self.played, self.tick) = (other.played, None);
        }
    }

    fn boxed_clone(&self) -> Box<dyn LayerVoice> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::{Gaussian, Uniform};
    use haptograph_signal::spectrum::welch;
    use haptograph_signal::window::Window;

    const RATE_HZ: f64 = 10_000.0;
    const RATES: RenderRates = RenderRates { rate_hz: RATE_HZ, models_hz: RATE_HZ };

    /// Noise with bursts of 20 ms, four times a second, of unlike size.
    fn bursts(seconds: f64) -> Vec<f64> {
        let (mut draw, mut sizes, mut level) = (Uniform::new(1), Gaussian::new(2), 0.0);
        let mut samples = vec![0.0; (seconds * RATE_HZ) as usize];
        Gaussian::new(3).fill(&mut samples);
        for e in &mut samples {
            let mut chance = [0.0];
            draw.fill(&mut chance);
            level = if chance[0] < 4.0 / RATE_HZ { (0.5 * sizes.next_sample()).exp() } else { level * 0.995 };
            *e *= 0.2 + level;
        }
        samples
    }

    fn played(clips: &Clips, rates: RenderRates, seed: u64, samples: usize) -> Vec<f64> {
        let mut played = vec![0.0; samples];
        clips.voice(rates, seed).process(&mut played);
        played
    }

    fn moment(samples: &[f64], power: i32) -> f64 {
        samples.iter().map(|x| x.powi(power)).sum::<f64>() / samples.len() as f64
    }

    #[test]
    fn bytes_keep_the_samples_within_a_hundredth_of_each() {
        let samples = bursts(5.0);
        let (clips, scale) = (Clips::new(&samples).expect("in range"), moment(&samples, 2).sqrt());
        let errors = samples.iter().enumerate().map(|(n, e)| (clips.at(n) - e / scale).powi(2));
        let error_db = 10.0 * (errors.sum::<f64>() / samples.len() as f64).log10();
        assert!(error_db < -36.0, "{error_db} dB");
    }

    #[test]
    fn what_is_played_has_power_one_and_the_distribution_and_spectrum_of_what_was_recorded() {
        let clips = Clips::new(&bursts(20.0)).expect("in range");
        let recorded: Vec<f64> = (0..clips.samples()).map(|n| clips.at(n)).collect();
        let played = played(&clips, RATES, 7, 6_000_000);
        let power_db = 10.0 * moment(&played, 2).log10();
        assert!(power_db.abs() < 0.2, "{power_db} dB");
        let kurtosis = moment(&played, 4) / moment(&recorded, 4);
        assert!((kurtosis - 1.0).abs() < 0.1, "{kurtosis} of the recorded fourth moment");
        // Through fades too.
        let fades = |n: &usize| n % 10_000 < 200;
        let faded: Vec<f64> = (10_000..played.len()).filter(fades).map(|n| played[n]).collect();
        let power_db = 10.0 * moment(&faded, 2).log10();
        assert!(power_db.abs() < 1.0, "{power_db} dB in fades");
        let of = |samples: &[f64]| welch(samples, RATE_HZ, 10_000, 5_000, Window::Hann).expect("long enough");
        let (played, recorded) = (of(&played), of(&recorded));
        for third in 14..=36 {
            let middle_hz = 10f64.powf(f64::from(third) / 10.0);
            let [low, high] = [middle_hz / 1.122, middle_hz * 1.122];
            let off_db = 10.0 * (played.power_between(low, high) / recorded.power_between(low, high)).log10();
            assert!(off_db.abs() < 0.5, "{off_db} dB at {middle_hz} Hz");
        }
    }

    #[test]
    fn the_envelope_repeats_itself_little_more_than_the_recording_does() {
        let correlation = |samples: &[f64]| {
            let mut levels: Vec<f64> = samples.chunks(200).map(|part| moment(part, 2).sqrt()).collect();
            let mean = levels.iter().sum::<f64>() / levels.len() as f64;
            levels.iter_mut().for_each(|level| *level -= mean);
            let all = levels.iter().map(|a| a * a).sum::<f64>() / levels.len() as f64;
            let at = |lag: usize| {
                let both = levels.iter().zip(&levels[lag..]);
                both.map(|(a, b)| a * b).sum::<f64>() / (levels.len() - lag) as f64 / all
            };
            (10..levels.len() / 2).map(at).fold(0.0, f64::max)
        };
        let clips = Clips::new(&bursts(20.0)).expect("in range");
        let more = correlation(&played(&clips, RATES, 8, 1_200_000)) - correlation(&bursts(120.0));
        assert!(more < 0.1, "{more} more");
    }

    #[test]
    fn blocks_of_any_size_and_a_change_of_clips_give_the_same_samples() {
        let clips = Clips::new(&bursts(3.0)).expect("in range");
        let whole = played(&clips, RATES, 9, 40_000);
        let (mut voice, mut parts) = (clips.voice(RATES, 9), whole.clone());
        for part in parts.chunks_mut(977) {
            let mut next = Clips::new(&bursts(3.0)).expect("in range").voice(RATES, 9);
            next.copy_state_from(&*voice);
            voice = next;
            voice.process(part);
        }
        assert_eq!(parts, whole);
        assert_ne!(played(&clips, RATES, 10, 40_000), whole);
    }

    #[test]
    fn slower_models_hear_each_sample_once() {
        let clips = Clips::new(&bursts(3.0)).expect("in range");
        let own = played(&clips, RATES, 9, 9_000);
        for every in [2, 5, 48] {
            let clock = RenderRates { rate_hz: RATE_HZ * every as f64, ..RATES };
            let taken: Vec<f64> =
                played(&clips, clock, 9, 9_000 * every).into_iter().step_by(every).collect();
            assert_eq!(taken, own, "every {every}");
        }
    }

    #[test]
    fn at_another_rate_they_are_as_white_and_as_long() {
        let clips = Clips::new(&bursts(10.0)).expect("in range");
        let slower = clips.resampled(RATE_HZ, 2_500.0).expect("it changes");
        let slower: &Clips = (&*slower as &dyn std::any::Any).downcast_ref().expect("clips");
        assert_eq!(slower.samples(), 25_000);
        let samples: Vec<f64> = (0..slower.samples()).map(|n| slower.at(n)).collect();
        assert!((moment(&samples, 2) - 1.0).abs() < 1e-9);
        let spectrum = welch(&samples, 2_500.0, 1_000, 500, Window::Hann).expect("long enough");
        for (low, high) in [(10.0, 300.0), (300.0, 600.0), (600.0, 900.0), (900.0, 1_240.0)] {
            let band_db = 10.0 * (spectrum.power_between(low, high) / (high - low) * 1_250.0).log10();
            assert!(band_db.abs() < 0.7, "{band_db} dB from {low} to {high} Hz");
        }
    }

    #[test]
    fn what_is_no_excitation_is_refused() {
        let error = |samples: &[f64]| Clips::new(samples).expect_err("no excitation");
        for (samples, wrong) in [
            (vec![], ClipsError::Length { samples: 0 }),
            (vec![1.0; MAX_SAMPLES + 1], ClipsError::Length { samples: MAX_SAMPLES + 1 }),
            (vec![0.0; 3], ClipsError::Silent),
            (vec![f64::NAN, 1.0], ClipsError::Silent),
        ] {
            assert_eq!(error(&samples).downcast_ref(), Some(&wrong));
        }
    }
}
