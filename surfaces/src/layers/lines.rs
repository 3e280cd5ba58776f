//! Lines fixed in space: tones that regularly spaced threads, ridges and grooves add to the noise of a texture.
//!
//! A line of K cycles per metre has a frequency of K times the speed. Its phase is 2 pi K times the travelled distance, plus
//! a random walk for irregular distances. Its amplitude is interpolated over the map, as that of warped models is.

use super::{Layer, LayerError, LayerKind, LayerVoice, RenderRates, Stage, parse};
use crate::files::MAX_MODELS;
use crate::files::native::{Bounded, PerMm, write_numbers};
use crate::{ModelAt, Spot, TextureError, TextureModel};
use haptograph_signal::noise::Gaussian;
use haptograph_signal::units::decimal::{format_shifted, significant};
use serde::Deserialize;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::fmt::Write;
use std::sync::Arc;

/// Maximum number of lines of a texture.
pub const MAX_LINES: usize = 3;
/// Lines below this frequency are silent; from `WHOLE` times it on they have full power, Hz.
pub const LOWEST_HZ: f64 = 5.0;
const WHOLE: f64 = 1.5;
/// Lines above this fraction of the models' rate are silent; up to `WHOLE_OF_RATE` of it they have full power.
pub const HIGHEST_OF_RATE: f64 = 0.4;
const WHOLE_OF_RATE: f64 = 0.36;

/// A line fixed in space.
#[derive(Debug, Clone, PartialEq)]
pub struct SpatialLine {
    cycles_per_m: f64,
    diffusion_rad2_per_m: f64,
    powers_m2_s4: Vec<f64>,
}

impl SpatialLine {
    /// A line of `cycles_per_m` (above 0) whose phase variance grows by `diffusion_rad2_per_m` (at least 0) per metre, with
    /// its power at each model of the texture, (m/s²)², in their order.
    ///
    /// # Errors
    /// [`LineError::Line`] for numbers that are not finite or out of range.
    pub fn new(
        cycles_per_m: f64,
        diffusion_rad2_per_m: f64,
        powers_m2_s4: Vec<f64>,
    ) -> Result<Self, LayerError> {
        let sound = |x: f64| x.is_finite() && x >= 0.0;
        let all = sound(cycles_per_m)
            && cycles_per_m > 0.0
            && sound(diffusion_rad2_per_m)
            && powers_m2_s4.iter().all(|power| sound(*power));
        if !all {
            return Err(LayerError::new(LineError::Line { cycles_per_m }));
        }
        Ok(Self { cycles_per_m, diffusion_rad2_per_m, powers_m2_s4 })
    }
}

/// The lines of a texture: from 1 to [`MAX_LINES`].
#[derive(Debug)]
struct Lines(Vec<SpatialLine>);

impl Lines {
    /// These lines; `None` if there are none.
    fn new(lines: Vec<SpatialLine>) -> Result<Option<Self>, LayerError> {
        match lines.len() {
            0 => Ok(None),
            count if count > MAX_LINES => Err(LayerError::new(LineError::Lines { count })),
            _ => Ok(Some(Self(lines))),
        }
    }

    fn of_document(document: Bounded<LineDocument, MAX_LINES>) -> Result<Option<Self>, LayerError> {
        let lines = document.0.into_iter().map(|line| {
            SpatialLine::new(line.cycles_per_mm.si, line.diffusion_rad2_per_mm.si, line.powers_m2_s4.0)
        });
        Self::new(lines.collect::<Result<_, _>>()?)
    }
}

/// An error in the numbers of lines.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LineError {
    /// A line out of range.
    #[error(
        "the line at {cycles_per_m} cycles per metre: its frequency must be finite and above 0, its diffusion and powers finite and at least 0"
    )]
    Line {
        /// The cycles given.
        cycles_per_m: f64,
    },
    /// Too many lines.
    #[error("the texture has {count} lines; it may have {MAX_LINES} at most")]
    Lines {
        /// Number of lines given.
        count: usize,
    },
    /// A line whose number of powers differs from the number of models.
    #[error(
        "line {line} (from 0) has {powers} powers, but the map has {models} models; a line needs one power for each model"
    )]
    Powers {
        /// The line's number, from 0.
        line: usize,
        /// Number of its powers.
        powers: usize,
        /// Number of models.
        models: usize,
    },
    /// A line with power at zero speed or force.
    #[error(
        "line {line} (from 0) has power at model {vertex}, which stands at zero speed or force; it must be 0 there"
    )]
    AtRest {
        /// The line's number, from 0.
        line: usize,
        /// The model's number, from 0.
        vertex: usize,
    },
}

/// A line in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LineDocument {
    cycles_per_mm: PerMm,
    diffusion_rad2_per_mm: PerMm,
    powers_m2_s4: Bounded<f64, MAX_MODELS>,
}

/// The layer's type.
pub const KIND: LayerKind = LayerKind {
    name: "lines",
    title: "lines fixed in space",
    stage: Stage::Output,
    components: &["line_1", "line_2", "line_3"],
    parse: |text| parse(text, Lines::of_document),
    absent: || json!([]),
};

impl Layer for Lines {
    fn kind(&self) -> &'static LayerKind {
        &KIND
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let per_mm = |per_m: f64| format_shifted(per_m, -3);
        writeln!(out, "        lines: [")?;
        for line in &self.0 {
            writeln!(out, "            (")?;
            writeln!(out, "                cycles_per_mm: {},", per_mm(line.cycles_per_m))?;
            writeln!(out, "                diffusion_rad2_per_mm: {},", per_mm(line.diffusion_rad2_per_m))?;
            write_numbers(out, "                powers_m2_s4: ", &line.powers_m2_s4)?;
            writeln!(out, "            ),")?;
        }
        writeln!(out, "        ],")
    }

    fn check(&self, models: &[ModelAt]) -> Result<(), LayerError> {
        for (line, SpatialLine { powers_m2_s4, .. }) in self.0.iter().enumerate() {
            let (powers, count) = (powers_m2_s4.len(), models.len());
            if powers != count {
                return Err(LayerError::new(LineError::Powers { line, powers, models: count }));
            }
            let loud =
                |(at, power): (&ModelAt, &f64)| (at.speed_m_s == 0.0 || at.force_n == 0.0) && *power != 0.0;
            if let Some(vertex) = models.iter().zip(powers_m2_s4).position(loud) {
                return Err(LayerError::new(LineError::AtRest { line, vertex }));
            }
        }
        Ok(())
    }

    /// Writes the power of each line, (m/s²)²: the square of the mixed amplitude.
    fn interpolate(&self, spot: &Spot, into: &mut [f64]) {
        for (power, line) in into.iter_mut().zip(&self.0) {
            let amplitude = spot.vertices.iter().zip(spot.weights).fold(0.0, |sum, (model, weight)| {
                let at_model = line.powers_m2_s4.get(*model as usize);
                sum + weight * at_model.map_or(0.0, |power| power.sqrt())
            });
            *power = amplitude * amplitude;
        }
    }

    fn voice(&self, rates: RenderRates, seed: u64) -> Box<dyn LayerVoice> {
        Box::new(LineSource::new(&self.0, rates.rate_hz, rates.models_hz, seed))
    }

    fn json(&self) -> Value {
        let lines = self.0.iter().map(|line| json!({
            "cycles_per_mm": line.cycles_per_m / 1000.0, "diffusion_rad2_per_mm": line.diffusion_rad2_per_m / 1000.0,
            "powers_m2_s4": line.powers_m2_s4,
        }));
        lines.collect()
    }

    fn summary(&self, _: f64) -> String {
        let lines = self.0.iter().map(|line| significant(line.cycles_per_m / 1000.0, 3));
        format!("lines of {} cycles/mm", lines.collect::<Vec<_>>().join(" and "))
    }
}

impl TextureModel {
    /// The same texture with lines fixed in space in addition to its noise.
    ///
    /// # Errors
    /// [`LineError`] for more than [`MAX_LINES`], or one without a power for each model or with one at zero speed or force.
    pub fn with_lines(self, lines: Vec<SpatialLine>) -> Result<Self, TextureError> {
        match Lines::new(lines)? {
            Some(lines) => self.with_layer(Arc::new(lines)),
            None => Ok(self.without_layer(KIND.name)),
        }
    }
}

/// The gain of a line's power at a frequency; 0 outside the band that hand and filter can follow.
fn audible(frequency_hz: f64, models_hz: f64) -> f64 {
    let above = (frequency_hz / LOWEST_HZ - 1.0) / (WHOLE - 1.0);
    let below = (HIGHEST_OF_RATE - frequency_hz / models_hz) / (HIGHEST_OF_RATE - WHOLE_OF_RATE);
    above.min(below).clamp(0.0, 1.0)
}

/// Samples over which a step of the random walk is spread, so that phases move smoothly.
const STEP: u32 = 32;
/// Time in which amplitudes follow the map, s.
const FOLLOW_S: f64 = 0.003;
/// An amplitude that counts as silent, m/s².
const SILENT_M_S2: f64 = 1e-9;

/// Renders the lines of a texture in real time. It does not allocate; its output does not depend on block sizes.
#[derive(Debug, Clone)]
pub(crate) struct LineSource {
    lines: Vec<Voice>,
    noise: Gaussian,
    rate_hz: f64,
    models_hz: f64,
    follow: f64,
    speed_m_s: f64,
    until_step: u32,
}

#[derive(Debug, Clone)]
struct Voice {
    cycles_per_m: f64,
    diffusion_rad2_per_m: f64,
    /// Phase in cycles, 0 to 1.
    phase: f64,
    /// Phase increment of a sample: by travel, and by the random walk.
    turn: f64,
    wander: f64,
    amplitude_m_s2: f64,
    wanted_m_s2: f64,
}

impl LineSource {
    /// A source of `lines` at `rate_hz` for a texture whose models have the rate `models_hz`. Initial phases are random.
    pub(crate) fn new(lines: &[SpatialLine], rate_hz: f64, models_hz: f64, seed: u64) -> Self {
        let mut noise = Gaussian::new(seed);
        let voice = |line: &SpatialLine| Voice {
            cycles_per_m: line.cycles_per_m,
            diffusion_rad2_per_m: line.diffusion_rad2_per_m,
            // A normal deviate of many cycles, wrapped, is uniform.
            phase: (100.0 * noise.next_sample()).rem_euclid(1.0),
            turn: 0.0,
            wander: 0.0,
            amplitude_m_s2: 0.0,
            wanted_m_s2: 0.0,
        };
        Self {
            lines: lines.iter().map(voice).collect(),
            noise,
            rate_hz,
            models_hz,
            follow: 1.0 - (-1.0 / (FOLLOW_S * rate_hz)).exp(),
            speed_m_s: 0.0,
            until_step: 0,
        }
    }

    /// The random walk's next step.
    fn wander(&mut self) {
        self.until_step = STEP;
        let way_m = self.speed_m_s / self.rate_hz * f64::from(STEP);
        for line in &mut self.lines {
            let step_rad = (line.diffusion_rad2_per_m * way_m).sqrt() * self.noise.next_sample();
            line.wander = step_rad / (TAU * f64::from(STEP));
        }
    }
}

impl LayerVoice for LineSource {
    fn set(&mut self, speed_m_s: f64, powers_m2_s4: &[f64]) {
        self.speed_m_s = if speed_m_s.is_finite() { speed_m_s.max(0.0) } else { 0.0 };
        for (line, power) in self.lines.iter_mut().zip(powers_m2_s4) {
            let frequency_hz = line.cycles_per_m * self.speed_m_s;
            let power = power.max(0.0) * audible(frequency_hz, self.models_hz);
            line.wanted_m_s2 = (2.0 * power).sqrt();
            line.turn = frequency_hz / self.rate_hz;
        }
    }

    /// Adds the next samples of the lines to `out`.
    fn process(&mut self, out: &mut [f64]) {
        for y in out {
            if self.until_step == 0 {
                self.wander();
            }
            self.until_step -= 1;
            for line in &mut self.lines {
                *y += line.next(self.follow);
            }
        }
    }

    /// Continues phases, amplitudes and random walk, line by line.
    fn copy_state_from(&mut self, other: &dyn LayerVoice) {
        let Some(other) = other.downcast_ref::<Self>() else { return };
        self.noise.clone_from(&other.noise);
        (self.speed_m_s, self.until_step) = (other.speed_m_s, other.until_step);
        for (new, old) in self.lines.iter_mut().zip(&other.lines) {
            (new.phase, new.turn, new.wander) = (old.phase, old.turn, old.wander);
            (new.amplitude_m_s2, new.wanted_m_s2) = (old.amplitude_m_s2, old.wanted_m_s2);
        }
    }

    fn boxed_clone(&self) -> Box<dyn LayerVoice> {
        Box::new(self.clone())
    }
}

impl Voice {
    #[inline]
    fn next(&mut self, follow: f64) -> f64 {
        let turned = self.phase + self.turn + self.wander;
        self.phase = turned - turned.floor();
        self.amplitude_m_s2 += follow * (self.wanted_m_s2 - self.amplitude_m_s2);
        if self.wanted_m_s2 == 0.0 && self.amplitude_m_s2 < SILENT_M_S2 {
            self.amplitude_m_s2 = 0.0;
            return 0.0;
        }
        self.amplitude_m_s2 * (TAU * self.phase).sin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangulation::Triangle;

    const RATE_HZ: f64 = 10_000.0;

    /// One line of 1 cycle a millimetre.
    fn source(diffusion_rad2_per_m: f64) -> LineSource {
        let line = SpatialLine::new(1000.0, diffusion_rad2_per_m, vec![]).expect("sound");
        LineSource::new(&[line], RATE_HZ, RATE_HZ, 1)
    }

    const LOUD: [f64; 3] = [0.0, 0.5, 0.5];

    fn mixed_powers(line: SpatialLine, models: Triangle, weights: [f64; 3]) -> [f64; MAX_LINES] {
        let mut powers = [0.0; MAX_LINES];
        let spot = Spot { speed_m_s: 0.1, force_n: 1.0, triangle: 0, vertices: models, weights };
        Lines(vec![line]).interpolate(&spot, &mut powers);
        powers
    }

    /// Samples of a line that is silent at model 0 and has power 2 at the others.
    fn played(source: &mut LineSource, weights: [f64; 3], speed_m_s: f64, samples: usize) -> Vec<f64> {
        let line = SpatialLine::new(1.0, 0.0, vec![0.0, 2.0, 2.0]).expect("sound");
        source.set(speed_m_s, &mixed_powers(line, [0, 1, 2], weights));
        let mut out = vec![0.0; samples];
        source.process(&mut out);
        out
    }

    /// Share of the power within 2 Hz of a frequency.
    fn share(y: &[f64], frequency_hz: f64) -> f64 {
        let spectrum = haptograph_signal::spectrum::welch(
            y,
            RATE_HZ,
            10_000,
            5000,
            haptograph_signal::window::Window::Hann,
        )
        .expect("long enough");
        spectrum.power_between(frequency_hz - 2.0, frequency_hz + 2.0) / spectrum.power_between(1.0, 4999.0)
    }

    #[test]
    fn it_sounds_at_speed_times_cycles_with_the_maps_power() {
        for speed_m_s in [0.05, 0.2] {
            let y = played(&mut source(0.0), LOUD, speed_m_s, 40_000);
            let power = y[2000..].iter().map(|y| y * y).sum::<f64>() / 38_000.0;
            assert!((power - 2.0).abs() < 0.02, "{power}");
            assert!(share(&y[2000..], 1000.0 * speed_m_s) > 0.99);
            let half = played(&mut source(0.0), [0.5, 0.25, 0.25], speed_m_s, 40_000);
            let power = half[2000..].iter().map(|y| y * y).sum::<f64>() / 38_000.0;
            assert!((power - 0.5).abs() < 0.01, "{power}: half the amplitude");
        }
    }

    #[test]
    fn the_random_walk_widens_it_and_keeps_its_power() {
        let y = played(&mut source(400.0), LOUD, 0.2, 400_000);
        let power = y.iter().map(|y| y * y).sum::<f64>() / y.len() as f64;
        assert!((power - 2.0).abs() < 0.1, "{power}");
        // A coherence of 5 mm at 200 mm/s is a width of 13 Hz.
        assert!((0.1..0.4).contains(&share(&y, 200.0)), "{}", share(&y, 200.0));
    }

    #[test]
    fn it_is_silent_where_it_would_be_too_slow_or_too_fast_and_dies_away_at_rest() {
        assert!(played(&mut source(1.0), LOUD, 0.005, 2000).iter().all(|y| *y == 0.0));
        assert!(played(&mut source(1.0), LOUD, 4.0, 2000).iter().all(|y| *y == 0.0));
        let mut source = source(1.0);
        assert!(played(&mut source, LOUD, 0.1, 2000).iter().any(|y| y.abs() > 1.0));
        let tail = played(&mut source, [1.0, 0.0, 0.0], 0.0, 2000);
        assert!(tail[1000..].iter().all(|y| *y == 0.0));
    }

    #[test]
    fn the_grouping_of_samples_changes_no_bit_and_a_successor_goes_on() {
        let whole = played(&mut source(50.0), LOUD, 0.1, 1000);
        let mut first = source(50.0);
        let mut parts = played(&mut first, LOUD, 0.1, 333);
        let mut second = source(50.0);
        second.copy_state_from(&first);
        for samples in [1, 65, 601] {
            parts.extend(played(&mut second, LOUD, 0.1, samples));
        }
        assert_eq!(parts, whole);
    }

    #[test]
    fn numbers_out_of_range_are_refused_and_models_of_no_number_are_silent() {
        for (cycles, diffusion, power) in [(0.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, f64::NAN)] {
            let refused = SpatialLine::new(cycles, diffusion, vec![power]);
            let error = refused.unwrap_err();
            assert!(matches!(error.downcast_ref(), Some(LineError::Line { .. })));
        }
        let line = SpatialLine::new(1.0, 0.0, vec![1.0]).expect("sound");
        let powers = mixed_powers(line, [7, 8, u32::MAX], [0.4, 0.3, 0.3]);
        assert_eq!(powers, [0.0; MAX_LINES]);
        let line = SpatialLine::new(1.0, 0.0, vec![0.0, 4.0]).expect("sound");
        let powers = mixed_powers(line, [0, 1, u32::MAX], [0.5, 0.5, 0.0]);
        assert_eq!(powers, [1.0, 0.0, 0.0], "half the amplitude");
        let mut source = source(0.0);
        source.set(f64::NAN, &[f64::NAN; MAX_LINES]);
        let mut out = [0.0; 10];
        source.process(&mut out);
        assert_eq!(out, [0.0; 10]);
    }
}
