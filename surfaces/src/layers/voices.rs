//! The layers of a voice side by side.

use super::{COMPONENTS, LAYERS, Layer, LayerBank, LayerKind, LayerVoice, RenderRates, Stage};
use crate::TextureModel;
use crate::interpolation::Spot;
use haptograph_signal::noise::stream_seed;
use std::ops::Range;
use std::sync::Arc;

impl LayerKind {
    /// The place of its components among those of all [`LAYERS`]; `None` for a layer that is not among them.
    pub(crate) fn place(&self) -> Option<Range<usize>> {
        let mut start = 0;
        for kind in LAYERS {
            let end = start + kind.components.len();
            if (kind.name, kind.components) == (self.name, self.components) {
                return Some(start..end);
            }
            start = end;
        }
        None
    }
}

/// The layers of one stage in one voice. Real-time code; only the constructor allocates.
#[derive(Debug, Default)]
pub struct LayerVoices {
    voices: Vec<(Arc<dyn Layer>, Box<dyn LayerVoice>)>,
    /// The components of one layer.
    components: Box<[f64]>,
}

impl LayerVoices {
    /// The layers of `texture` at a stage; each has a random stream of its own under `seed`.
    pub fn new(texture: &TextureModel, stage: Stage, rate_hz: f64, seed: u64) -> Self {
        let rates = RenderRates { rate_hz, models_hz: texture.rate_hz() };
        let own = texture.layers.iter().filter(|layer| layer.kind().stage == stage);
        let most = own.clone().map(|layer| layer.kind().components.len()).max();
        let voice = |layer: &Arc<dyn Layer>| layer.voice(rates, stream_seed(seed, layer.kind().name));
        Self {
            components: vec![0.0; most.unwrap_or(0)].into(),
            voices: own.map(|layer| (layer.clone(), voice(layer))).collect(),
        }
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.voices.is_empty()
    }

    /// Moves to a position on the map.
    pub(crate) fn move_to(&mut self, spot: &Spot) {
        for (layer, voice) in &mut self.voices {
            let components = &mut self.components[..layer.kind().components.len()];
            components.fill(0.0);
            layer.interpolate(spot, components);
            voice.set(spot.speed_m_s, components);
        }
    }

    /// Moves to a speed, and to the components of all [`LAYERS`] there; those of other layers are zero.
    pub fn set(&mut self, speed_m_s: f64, components: &[f64; COMPONENTS]) {
        for (layer, voice) in &mut self.voices {
            let kind = layer.kind();
            match kind.place() {
                Some(place) => voice.set(speed_m_s, &components[place]),
                None => {
                    let own = &mut self.components[..kind.components.len()];
                    own.fill(0.0);
                    voice.set(speed_m_s, own);
                }
            }
        }
    }

    /// Changes the next samples of the stage.
    pub fn process(&mut self, samples: &mut [f64]) {
        self.voices.iter_mut().for_each(|(_, voice)| voice.process(samples));
    }

    /// Continues the states of those layers that `other` has too.
    pub fn copy_state_from(&mut self, other: &Self) {
        for (layer, new) in &mut self.voices {
            if let Some((_, old)) = other.voices.iter().find(|(old, _)| old.kind().name == layer.kind().name)
            {
                new.copy_state_from(&**old);
            }
        }
    }

    /// The layers of several voices, each of which has the same ones, in the form of banks.
    pub(crate) fn banks(all: Vec<Self>) -> Vec<Box<dyn LayerBank>> {
        let mut all: Vec<_> = all.into_iter().map(|voices| voices.voices.into_iter()).collect();
        let next = || {
            let (layers, voices): (Vec<_>, Vec<_>) = all.iter_mut().filter_map(Iterator::next).unzip();
            layers.first().map(|layer: &Arc<dyn Layer>| layer.bank(voices))
        };
        std::iter::from_fn(next).collect()
    }
}

impl Clone for LayerVoices {
    fn clone(&self) -> Self {
        let voices = self.voices.iter().map(|(layer, voice)| (layer.clone(), voice.boxed_clone()));
        Self { voices: voices.collect(), components: self.components.clone() }
    }
}
