//! One voice of a texture in real time: only constructors allocate, and the output does not depend on the sizes of blocks.

use super::Upsampler;
use crate::TextureModel;
use crate::interpolation::{Coefficients, Interpolator};
use crate::layers::{COMPONENTS, LayerVoices, SpectrumVoice, Stage};
use haptograph_signal::arma::{ArmaError, Form};
use haptograph_signal::noise::Gaussian;

/// Samples of excitation between noise and filter.
const BATCH: usize = 64;

/// White noise with the layers of the excitation.
#[derive(Debug, Clone)]
pub struct Excitation {
    noise: Gaussian,
    layers: LayerVoices,
}

impl Excitation {
    /// The excitation of `texture` at a rate; without a texture, Gaussian noise.
    pub fn new(texture: Option<&TextureModel>, rate_hz: f64, seed: u64) -> Self {
        let layers = |texture| LayerVoices::new(texture, Stage::Excitation, rate_hz, seed);
        Self { noise: Gaussian::new(seed), layers: texture.map(layers).unwrap_or_default() }
    }

    /// The next samples, of variance 1. They depend on time only, so they are also drawn in silence.
    pub fn fill(&mut self, out: &mut [f64]) {
        self.noise.fill(out);
        self.layers.process(out);
    }

    /// Gives samples of variance 1 another variance; exactly zero if that is zero.
    pub fn scale(samples: &mut [f64], variance: f64) {
        if variance > 0.0 {
            let deviation = variance.sqrt();
            samples.iter_mut().for_each(|e| *e *= deviation);
        } else {
            samples.fill(0.0);
        }
    }

    /// Continues the streams of the excitation that this one replaces.
    pub fn copy_state_from(&mut self, other: &Self) {
        self.noise.clone_from(&other.noise);
        self.layers.copy_state_from(&other.layers);
    }
}

/// Excitation in, vibration out: filter and high-pass, upsampling from a lower rate of the models, and the layers of the output.
#[derive(Debug, Clone)]
pub struct Synthesis {
    spectrum: SpectrumVoice,
    upsampler: Option<Box<Upsampler>>,
    layers: LayerVoices,
}

impl Synthesis {
    /// The synthesis of a texture at a rate, with a filter of this form where its models are not warped; without a texture, the
    /// filter alone.
    pub fn new(texture: Option<&TextureModel>, form: Form, rate_hz: f64, seed: u64) -> Self {
        let layers = |texture| LayerVoices::new(texture, Stage::Output, rate_hz, seed);
        let layers = texture.map(layers).unwrap_or_default();
        Self { spectrum: SpectrumVoice::new(form, texture), upsampler: None, layers }
    }

    /// The same with a filter at the lower rate that `upsampler` starts from.
    pub fn upsampled(self, upsampler: Option<Upsampler>) -> Self {
        Self { upsampler: upsampler.map(Box::new), ..self }
    }

    /// Changes the filter; invalid coefficients leave the old ones active.
    ///
    /// # Errors
    /// Coefficients of an unstable filter.
    pub fn set_filter(&mut self, ar: &[f64], ma: &[f64], gain: f64, warping: f64) -> Result<(), ArmaError> {
        self.spectrum.set(ar, ma, gain, warping)
    }

    /// Moves the layers to a speed, and to their components there.
    pub fn set_layers(&mut self, speed_m_s: f64, components: &[f64; COMPONENTS]) {
        self.layers.set(speed_m_s, components);
    }

    /// True if the output has layers.
    pub fn has_layers(&self) -> bool {
        !self.layers.is_empty()
    }

    /// The vibration of the next samples of excitation.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        match &mut self.upsampler {
            None => self.spectrum.process(excitation, out),
            Some(upsampler) => {
                // Of white noise the samples at the models' ticks are white noise of the same variance.
                for (e, y) in excitation.iter().zip(&mut *out) {
                    *y = upsampler.next(|| {
                        let mut made = [0.0];
                        self.spectrum.process(&[*e], &mut made);
                        made[0]
                    });
                }
            }
        }
        self.layers.process(out);
    }

    /// Group delay of the upsampling, s.
    pub fn group_delay_s(&self) -> f64 {
        self.upsampler.as_ref().map_or(0.0, |upsampler| upsampler.group_delay_s())
    }

    /// Continues the state of the synthesis that this one replaces.
    pub fn copy_state_from(&mut self, other: &Self) {
        self.spectrum.copy_state_from(&other.spectrum);
        if let (Some(new), Some(old)) = (&mut self.upsampler, &other.upsampler) {
            new.copy_state_from(old);
        }
        self.layers.copy_state_from(&other.layers);
    }
}

/// A texture along speed and force.
#[derive(Debug, Clone)]
pub struct TextureVoice {
    interpolator: Interpolator,
    coefficients: Coefficients,
    excitation: Excitation,
    synthesis: Synthesis,
}

impl TextureVoice {
    /// A voice at rest, at the rate of the texture's models. A graph has the seeds of its nodes `Excitation` and `ArmaFilter`.
    pub fn new(texture: &TextureModel, rate_hz: f64, excitation_seed: u64, synthesis_seed: u64) -> Self {
        Self {
            interpolator: Interpolator::new(texture),
            coefficients: Coefficients::SILENCE,
            excitation: Excitation::new(Some(texture), rate_hz, excitation_seed),
            synthesis: Synthesis::new(Some(texture), Form::Lattice, rate_hz, synthesis_seed),
        }
    }

    /// Moves to a speed, m/s, and a force, N.
    ///
    /// # Errors
    /// A mix of models that rounding made unstable.
    pub(crate) fn move_to(&mut self, speed_m_s: f64, force_n: f64) -> Result<(), ArmaError> {
        let Self { coefficients, synthesis, .. } = self;
        let spot = self.interpolator.interpolate(speed_m_s, force_n, coefficients);
        synthesis.layers.move_to(&spot);
        synthesis.set_filter(coefficients.ar(), coefficients.ma(), coefficients.gain, coefficients.warping)
    }

    /// The next samples of the vibration, m/s².
    pub(crate) fn play(&mut self, out: &mut [f64]) {
        let mut excitation = [0.0; BATCH];
        for out in out.chunks_mut(BATCH) {
            let excitation = &mut excitation[..out.len()];
            self.excitation.fill(excitation);
            Excitation::scale(excitation, self.coefficients.variance);
            self.synthesis.process(excitation, out);
        }
    }
}
