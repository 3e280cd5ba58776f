//! A layer is one file: these two are read, written, interpolated, resampled, and rendered by a voice and by banks, and no other
//! file names them.

#![allow(clippy::unwrap_used)]

use haptograph_signal::arma::Form;
use haptograph_surfaces::files::native;
use haptograph_surfaces::hull::Hull;
use haptograph_surfaces::layers::{
    COMPONENTS, Layer, LayerError, LayerKind, LayerSet, LayerVoice, RenderRates, Stage, grain, lines, parse,
};
use haptograph_surfaces::rendering::{
    RandomWalk, Synthesis, SynthesisSettings, Voice, synthesise, synthesise_many,
};
use haptograph_surfaces::resampling::{Method, resample};
use haptograph_surfaces::{ArmaModel, ModelAt, Origin, Provenance, Spot, Surface, TextureModel, VertexKind};
use serde::Deserialize;
use serde_json::{Value, json};
use std::fmt::{self, Write};
use std::sync::Arc;

/// A tone of a period in samples, whose amplitude is a part of the speed and grows over the map.
#[derive(Debug, Clone, PartialEq)]
struct Hum {
    period: f64,
    amplitudes: Vec<f64>,
}

#[derive(Debug, thiserror::Error)]
#[error("the hum has {0} amplitudes; it needs one for each model")]
struct HumError(usize);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HumDocument {
    period: f64,
    amplitudes: Vec<f64>,
}

#[derive(Debug, Clone)]
struct HumVoice {
    turn: f64,
    phase: f64,
    amplitude: f64,
}

const HUM: LayerKind = LayerKind {
    name: "hum",
    title: "hum",
    stage: Stage::Output,
    components: &["hum"],
    parse: |text| parse(text, |HumDocument { period, amplitudes }| Ok(Some(Hum { period, amplitudes }))),
    absent: || Value::Null,
};

impl Layer for Hum {
    fn kind(&self) -> &'static LayerKind {
        &HUM
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "        hum: (period: {:?}, amplitudes: {:?}),", self.period, self.amplitudes)
    }

    fn check(&self, models: &[ModelAt]) -> Result<(), LayerError> {
        match self.amplitudes.len() {
            count if count == models.len() => Ok(()),
            count => Err(LayerError::new(HumError(count))),
        }
    }

    fn resampled(&self, from_hz: f64, to_hz: f64) -> Option<Arc<dyn Layer>> {
        Some(Arc::new(Self { period: self.period * to_hz / from_hz, ..self.clone() }))
    }

    fn interpolate(&self, spot: &Spot, into: &mut [f64]) {
        into[0] = spot
            .vertices
            .iter()
            .zip(spot.weights)
            .map(|(model, w)| w * self.amplitudes[*model as usize])
            .sum();
    }

    fn voice(&self, _: RenderRates, _: u64) -> Box<dyn LayerVoice> {
        Box::new(HumVoice { turn: 1.0 / self.period, phase: 0.0, amplitude: 0.0 })
    }

    fn json(&self) -> Value {
        json!(self.period)
    }

    fn summary(&self, _: f64) -> String {
        format!("a hum of {} samples", self.period)
    }
}

impl LayerVoice for HumVoice {
    fn set(&mut self, speed_m_s: f64, components: &[f64]) {
        self.amplitude = speed_m_s * components[0];
    }

    fn process(&mut self, samples: &mut [f64]) {
        for y in samples {
            self.phase = (self.phase + self.turn).fract();
            *y += self.amplitude * (std::f64::consts::TAU * self.phase).sin();
        }
    }

    fn copy_state_from(&mut self, other: &dyn LayerVoice) {
        if let Some(other) = other.downcast_ref::<Self>() {
            self.phase = other.phase;
        }
    }

    fn boxed_clone(&self) -> Box<dyn LayerVoice> {
        Box::new(self.clone())
    }
}

/// An excitation of which every so-manieth sample is zero.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
struct Gaps {
    every: u32,
}

#[derive(Debug, Clone)]
struct GapsVoice {
    every: u32,
    at: u32,
}

const GAPS: LayerKind = LayerKind {
    name: "gaps",
    title: "gaps",
    stage: Stage::Excitation,
    components: &[],
    parse: |text| parse(text, |gaps: Gaps| Ok((gaps.every > 0).then_some(gaps))),
    absent: || Value::Null,
};

impl Layer for Gaps {
    fn kind(&self) -> &'static LayerKind {
        &GAPS
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "        gaps: (every: {}),", self.every)
    }

    fn voice(&self, _: RenderRates, seed: u64) -> Box<dyn LayerVoice> {
        Box::new(GapsVoice { every: self.every, at: (seed % u64::from(self.every)) as u32 })
    }

    fn json(&self) -> Value {
        json!(self.every)
    }

    fn summary(&self, _: f64) -> String {
        format!("gaps every {} samples", self.every)
    }
}

impl LayerVoice for GapsVoice {
    fn process(&mut self, samples: &mut [f64]) {
        for e in samples {
            self.at = (self.at + 1) % self.every;
            *e *= f64::from(self.at.min(1));
        }
    }

    fn copy_state_from(&mut self, other: &dyn LayerVoice) {
        if let Some(other) = other.downcast_ref::<Self>() {
            self.at = other.at;
        }
    }

    fn boxed_clone(&self) -> Box<dyn LayerVoice> {
        Box::new(self.clone())
    }
}

/// All that is needed to read files with both.
enum WithHumAndGaps {}

impl LayerSet for WithHumAndGaps {
    const KINDS: &'static [LayerKind] = &[grain::KIND, HUM, GAPS];
}

fn bare() -> TextureModel {
    let at = |(speed_m_s, force_n): (f64, f64)| ModelAt {
        speed_m_s,
        force_n,
        model: ArmaModel::from_ar(&[-1.2, 0.7], 5.0 * speed_m_s * force_n).unwrap(),
        kind: VertexKind::Measured,
    };
    let places = [(0.05, 0.5), (0.2, 0.5), (0.05, 2.0), (0.2, 2.0), (0.1, 1.0)];
    TextureModel::from_measured(10_000.0, places.map(at).to_vec(), &Hull::default()).unwrap()
}

fn layered() -> TextureModel {
    let texture = bare();
    let amplitudes = texture.models().iter().map(|at| 10.0 * at.force_n).collect();
    let texture = texture.with_layer(Arc::new(Hum { period: 40.0, amplitudes })).unwrap();
    texture.with_layer(Arc::new(Gaps { every: 7 })).unwrap()
}

fn played(texture: &TextureModel, seed: u64) -> Vec<f64> {
    let walk = RandomWalk { seconds: 0.1, cutoff_hz: 20.0, seed, ..RandomWalk::default() }.trajectory();
    let settings = SynthesisSettings { seed, ..SynthesisSettings::default() };
    synthesise(texture, &walk, &settings).unwrap()
}

#[test]
fn layers_are_read_and_written_with_their_texture() {
    let mut surface = Surface::new("a test", Provenance::new(Origin::Procedural, "a test"));
    surface.texture = Some(layered());
    let text = native::write(&surface);
    assert!(text.contains("        gaps: (every: 7),\n        hum: (period: 40.0, amplitudes: ["), "{text}");
    let read = |text: &str| native::read_with::<WithHumAndGaps>(text);
    assert_eq!(read(&text), Ok(surface));
    let refused = native::read(&text).unwrap_err().to_string();
    assert!(refused.contains("`gaps`") && refused.contains("`grain`"), "{refused}");
    let few = read(&text.replace("amplitudes: [", "amplitudes: [1.0, ")).unwrap_err().to_string();
    assert!(few.contains("one for each model"), "{few}");
    let wrong = read(&text.replace("every: 7", "every: seven")).unwrap_err();
    let line = text.lines().position(|line| line.contains("gaps")).unwrap() + 1;
    assert_eq!(wrong.place.map(|place| (place.line, place.column)), Some((line, 22)), "{wrong}");
    let twice = text.replacen("        gaps:", "        gaps: (every: 2),\n        gaps:", 1);
    assert!(read(&twice).is_err());
    let none = read(&text.replace("every: 7", "every: 0")).unwrap().texture.unwrap();
    assert_eq!(none.layer::<Gaps>(), None);
}

#[test]
fn layers_are_interpolated_and_resampled() {
    let texture = layered();
    let hum: &Hum = texture.layer().unwrap();
    let mut amplitude = [0.0];
    let spot =
        Spot { speed_m_s: 0.1, force_n: 1.0, triangle: 0, vertices: [0, 1, 2], weights: [0.25, 0.25, 0.5] };
    hum.interpolate(&spot, &mut amplitude);
    let of = |model: usize| hum.amplitudes[model];
    assert_eq!(amplitude, [0.25 * of(0) + 0.25 * of(1) + 0.5 * of(2)]);
    let slow = resample(&texture, 2500.0, Method::Spectral).unwrap().texture;
    assert_eq!(slow.layer::<Hum>().map(|hum| hum.period), Some(10.0));
    assert_eq!(slow.layer::<Gaps>(), texture.layer());
    let summaries: Vec<_> = texture.layers().map(|layer| layer.summary(0.0)).collect();
    assert_eq!(summaries, ["gaps every 7 samples", "a hum of 40 samples"]);
}

#[test]
fn layers_are_rendered_by_a_voice_and_by_banks_with_the_same_bits() {
    let (bare, layered) = (bare(), layered());
    let without = layered.clone().without_layer("hum");
    assert_ne!(played(&bare, 1), played(&without, 1));
    assert_ne!(played(&without, 1), played(&layered, 1));
    let textures = [&layered, &without, &bare, &layered];
    let walks: Vec<_> = (0..24)
        .map(|seed| RandomWalk { seconds: 0.1, cutoff_hz: 20.0, seed, ..RandomWalk::default() }.trajectory())
        .collect();
    let voice = |(number, trajectory)| Voice {
        texture: textures[number % textures.len()],
        trajectory,
        settings: SynthesisSettings { seed: number as u64, ..SynthesisSettings::default() },
    };
    let voices: Vec<_> = walks.iter().enumerate().map(voice).collect();
    for (voice, many) in voices.iter().zip(synthesise_many(&voices, 2).unwrap()) {
        let alone = synthesise(voice.texture, voice.trajectory, &voice.settings).unwrap();
        let bits = |vibration: &[f64]| vibration.iter().map(|y| y.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&alone), bits(&many), "voice {}", voice.settings.seed);
    }
}

/// A hum under the name of another layer, whose components it does not have.
#[derive(Debug, Clone)]
struct NamedAsLines(Hum);

const NAMED_AS_LINES: LayerKind = LayerKind { name: lines::KIND.name, ..HUM };

impl Layer for NamedAsLines {
    fn kind(&self) -> &'static LayerKind {
        &NAMED_AS_LINES
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        self.0.write(out)
    }

    fn interpolate(&self, spot: &Spot, into: &mut [f64]) {
        self.0.interpolate(spot, into);
    }

    fn voice(&self, rates: RenderRates, seed: u64) -> Box<dyn LayerVoice> {
        self.0.voice(rates, seed)
    }

    fn json(&self) -> Value {
        self.0.json()
    }

    fn summary(&self, rate_hz: f64) -> String {
        self.0.summary(rate_hz)
    }
}

/// What the synthesis makes of no excitation with each component of a frame at 1.
fn of_a_frame(texture: &TextureModel) -> Vec<f64> {
    let mut synthesis = Synthesis::new(Some(texture), Form::Lattice, texture.rate_hz(), 1);
    synthesis.set_layers(0.1, &[1.0; COMPONENTS]);
    let mut out = vec![0.0; 100];
    synthesis.process(&[0.0; 100], &mut out);
    out
}

#[test]
fn a_layer_without_components_in_a_frame_gets_zeros() {
    assert_eq!(of_a_frame(&layered()), [0.0; 100]);
}

#[test]
fn a_layer_named_as_another_gets_none_of_its_components() {
    let hum = Hum { period: 40.0, amplitudes: vec![3.0; bare().models().len()] };
    let texture = bare().with_layer(Arc::new(NamedAsLines(hum))).unwrap();
    let spot =
        Spot { speed_m_s: 0.1, force_n: 1.0, triangle: 0, vertices: [0, 1, 2], weights: [0.25, 0.25, 0.5] };
    assert_eq!(texture.interpolate_layers(&spot), None);
    assert_eq!(of_a_frame(&texture), [0.0; 100]);
}
